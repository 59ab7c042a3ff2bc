"""What lies between reference and plant, and back: encoders, drives, amplifiers; with its history.

One physics step is one call of the compiled `control_step`, which takes arrays alone: a compiled
plant can call it between its own steps.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import Drives
from par4_sim.drives.controller import TORQUE as TORQUE_MODE
from par4_sim.drives.controller import Controller
from par4_sim.drives.laws import command_of
from par4_sim.drives.reference import TARGET, ReferenceQueue, interpolate
from par4_sim.machines.amplifier import Amplifier, deliver, lag_shares
from par4_sim.machines.sensors import Sensors, read_encoders, round_to
from par4_sim.plants.plant import Plant

COMMAND, TORQUE = 0, 1
"""The two histories: what is asked of the amplifiers and what they deliver."""
SPARE = 4
"""Rows of the history beyond those that are read."""


@numba.njit(cache=True, error_model='numpy')
def control_step(times, points, t, q, qd, encoders, law, amplifier, lag, drive, currents,
                 saturated, history, step, lead):
    """Write command and delivered torque of one physics step into its row of the history.

    Args:
        times, points: of the ReferenceQueue.
        t: time of the step's beginning on the queue's clock, s.
        q, qd: true positions and velocities (4,).
        encoders, law, amplifier, lag: as `read_encoders`, `command_of` and `deliver` take them.
        drive, currents: states of `command_of` (4, 4) and of `deliver` (2, 4), moved on.
        saturated: counts (3,), raised.
        history: (2, n, 4) command and torque; step s has row s % n.
        step: number of the step.
        lead: from the reading of q to the time where the torque acts, s.
    """
    target, silence = np.empty(TARGET), np.zeros(4)
    reading, rate = np.empty(4), np.empty(4)
    row = step % history.shape[1]
    interpolate(times, points, t, lead, target)
    if law[0] == TORQUE_MODE and t >= times[-1]:
        # the last torque was meant for a motion that is over: nothing but the loops would end it
        target[8:12] = target[16:20] = 0.0
    read_encoders(encoders, q, qd, silence, reading, rate)
    command_of(law, target, reading, rate, drive, saturated, history[COMMAND, row])
    for joint in range(4):
        reading[joint] = q[joint] + lead * qd[joint]
    deliver(amplifier, lag, currents, history[COMMAND, row], reading, history[TORQUE, row])


@numba.njit(cache=True, error_model='numpy')
def _between(history, position, values):
    """Write a history (n, 4) at a fractional step, linearly interpolated, into values (4,)."""
    before = math.floor(position)
    part = position - before
    rows = history.shape[0]
    first, second = int(before) % rows, int(before + 1) % rows
    for joint in range(4):
        values[joint] = history[first, joint]
        if part > 0.0:
            values[joint] += part * (history[second, joint] - history[first, joint])


@numba.njit(cache=True, error_model='numpy')
def record_sample(history, sample_step, shifts, encoders, torque_step, q, qd, torque_noise,
                  position_noise, told):
    """Write what is recorded at the beginning of a step: see `ControlLoop.record`.

    Args:
        history: (2, n, 4) command and torque.
        sample_step: number of the step.
        shifts: steps from the sample back to where command and torque are read, (2,).
        encoders: as `read_encoders` takes them.
        torque_step: of the recorded torque, (4,) N m.
        q, qd: true positions and velocities there (4,).
        torque_noise, position_noise: added before rounding (4,), N m, rad.
        told: (4, 4), written.
    """
    read_encoders(encoders, q, qd, position_noise, told[0], told[1])
    _between(history[COMMAND], sample_step - shifts[COMMAND], told[2])
    _between(history[TORQUE], sample_step - shifts[TORQUE], told[3])
    for joint in range(4):
        told[2, joint] = round_to(told[2, joint] + torque_noise[joint], torque_step[joint])


class ControlLoop:
    """Drives closed over the encoders, and the amplifiers that carry out their commands.

    Args:
        drives: lag of their currents, counts of their encoders.
        controller: their law.
        amplifier, sensors: as they truly are.
        plant: for the times at which its readings and torques are valid.
        substeps: physics steps from sample to sample, all done before a sample is recorded.
        kept: physics steps whose torques stay in the history, beyond those that are read.

    Attributes:
        controller: the law and what it counts.
        steps_ahead: physics steps from the beginning of a sample to where it is recorded.
    """

    def __init__(self, drives: Drives, controller: Controller, amplifier: Amplifier,
                 sensors: Sensors, plant: Plant, substeps: int, kept: int = 0) -> None:
        self.controller = controller
        self._law = controller.law
        self._encoders = sensors.encoders(drives.encoder_counts)
        self._torque_step = np.broadcast_to(sensors.torque_step, (LEGS,)).astype(float)
        self._amplifier = amplifier.packed
        self._lag = lag_shares(drives.current_lag, amplifier.time_constant, plant.dt)
        self._lead = plant.torque_offset
        # steps from the row that is valid at a sample's time to the sample's own
        shift = plant.torque_offset / plant.dt
        self._shifts = np.round((shift + sensors.torque_delay / plant.dt, shift), 9)
        self.steps_ahead = max(substeps, math.ceil(-self._shifts.min()) + 1)
        rows = self.steps_ahead + max(0, math.ceil(self._shifts.max())) + SPARE + kept
        self._history = np.zeros((2, rows, LEGS))
        self._currents = np.zeros((2, LEGS))

    @property
    def kernel_state(self) -> tuple[object, ...]:
        """What `control_step` takes from here, in its order; the lead last."""
        return (self._encoders, self._law, self._amplifier, self._lag, self.controller.state,
                self._currents, self.controller.counts, self._history, self._lead)

    @property
    def recorder_state(self) -> tuple[object, ...]:
        """What `record_sample` takes from here behind the number of the step, in its order."""
        return self._shifts, self._encoders, self._torque_step

    def delivered(self, steps: int) -> np.ndarray:
        """Return the torque (n, 4), N m, of the last of so many steps, as many as are kept."""
        rows = self._history.shape[1]
        return self._history[TORQUE, np.arange(max(0, steps - rows), steps) % rows]

    def restart(self, q: np.ndarray, holding: np.ndarray) -> None:
        """Begin settled at positions q (4,) with the commands `holding` (4,), N m."""
        self.controller.restart(holding)
        self._currents[:] = holding
        self._history[COMMAND] = holding
        torque = np.empty(LEGS)
        deliver(self._amplifier, self._lag, self._currents, holding, q, torque)
        self._history[TORQUE] = torque

    def reading(self, q: np.ndarray) -> np.ndarray:
        """Return what the encoders tell of the true positions q (4,), rad."""
        told, rest = np.empty(LEGS), np.zeros(LEGS)
        read_encoders(self._encoders, q, rest, rest, told, np.empty(LEGS))
        return told

    def torque(self, reference: ReferenceQueue, t: float, step: int, q: np.ndarray,
               qd: np.ndarray) -> np.ndarray:
        """Return the torque (4,), N m, delivered in step number `step`, which begins at t, s."""
        if self.controller.stride and step % self.controller.stride == 0:
            self._look_ahead(reference, t, q, qd)
        control_step(reference.times, reference.points, t, q, qd, self._encoders,
                     self._law, self._amplifier, self._lag, self.controller.state,
                     self._currents, self.controller.counts, self._history, step, self._lead)
        return self._history[TORQUE, step % self._history.shape[1]]

    def _look_ahead(self, reference: ReferenceQueue, t: float, q: np.ndarray, qd: np.ndarray
                    ) -> None:
        reading, rate, silence = np.empty(LEGS), np.empty(LEGS), np.zeros(LEGS)
        read_encoders(self._encoders, q, qd, silence, reading, rate)
        target = reference.target(t)
        self.controller.look_ahead(reference.times, reference.points, t,
                                   target[:4] - reading, target[4:8] - rate)

    def record(self, step: int, q: np.ndarray, qd: np.ndarray, torque_noise: np.ndarray,
               position_noise: np.ndarray) -> np.ndarray:
        """Return what is recorded at the beginning of a step, `steps_ahead` of which are done.

        Args:
            step: number of the physics step.
            q, qd: true positions and velocities there (4,).
            torque_noise, position_noise: added before rounding (4,), N m, rad.

        Returns:
            (4, 4): encoder positions and velocities, recorded torque, true torque.
        """
        told = np.empty((4, LEGS))
        record_sample(self._history, step, self._shifts, self._encoders, self._torque_step, q, qd,
                      torque_noise, position_noise, told)
        return told
