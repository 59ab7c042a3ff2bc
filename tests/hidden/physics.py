"""The torque that a machine's recorder would tell along a given reading of its encoders.

The chain of the simulation backwards: encoders, transmission, mechanism (its equations of motion
from the energy), friction, amplifier, delay of the record. Of what a plant does it leaves out
sticking. Arms behind springs and gaps are integrated forward from where the motors are.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numba
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from par4_dynamics.mechanism import (
    BIAS,
    EQUATION_ROWS,
    MASS,
    RATES,
    equations_sample,
    packed_mechanism,
)
from par4_kinematics.acceleration import platform_motion
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import LEGS
from par4_kinematics.position import forward_kinematics
from par4_sim.machines.friction import (
    LOAD_COEFFICIENT,
    PRESLIDING_DISTANCE,
    Friction,
    bending_torque,
    bent,
    dry_friction,
    flowing_friction,
    friction_at,
)
from par4_sim.machines.machine import Machine
from par4_sim.machines.platform_forces import add_pivot_force, platform_force_sample
from par4_sim.plants.elastic import split_machine, spring_torque
from par4_sim.plants.exact_steps import FREE, MODE, QD, WORK_ROWS, Q, X, advance, machine_constants

RIGID = 1e5
"""N m/rad: of a spring that stands for a rigid joint beside elastic ones."""
PHASE = 0.35
"""rad: of its vibration in a step."""


class OutOfReach(ValueError):
    """A machine that cannot follow a reading: its legs are too short there."""


@numba.njit(cache=True, error_model='numpy')
def _mechanism_rows(constants, platform, pivots, x, xd, xdd, q, qd, torque):
    motion, equations = np.empty((2, 4)), np.empty((EQUATION_ROWS, 4))
    force = np.empty(4)
    for row in range(x.shape[0]):
        motion[0], motion[1] = x[row], xd[row]
        if equations_sample(constants, motion, equations) >= 0:
            return row
        platform_force_sample(platform, x[row], xd[row], force)
        if pivots:
            add_pivot_force(platform, constants, x[row], xd[row], q[row], qd[row], force)
        push = np.empty(4)
        for axis in range(4):
            push[axis] = equations[BIAS, axis] - force[axis]
            for other in range(4):
                push[axis] += equations[MASS + axis, other] * xdd[row, other]
        torque[row] = np.linalg.solve(equations[RATES:BIAS].T.copy(), push)
    return -1


@numba.njit(cache=True, error_model='numpy')
def _friction_rows(laws, t, q, qd, load, torque):
    for joint in range(q.shape[1]):
        bending = 0.0
        for row in range(q.shape[0]):
            now = friction_at(laws, t[row])
            side = 1.0 if qd[row, joint] > 0.0 else -1.0
            level = dry_friction(now, joint, side, abs(qd[row, joint]))
            total = side * (level + now[joint, LOAD_COEFFICIENT] * abs(load[row, joint]))
            total += flowing_friction(now, joint, qd[row, joint])
            if laws[joint, PRESLIDING_DISTANCE] > 0.0:
                if row > 0:
                    bending = bent(laws, joint, bending, q[row, joint] - q[row - 1, joint])
                total += bending_torque(now, joint, bending)
            torque[row, joint] = total


@numba.njit(cache=True, error_model='numpy')
def _spring_rows(constants, friction, harmonics, springs, motors, state, steps, dt, passed):
    """Let arms follow motors over springs; write what is passed on to the arms, (n, 4).

    Args:
        springs: stiffness, gap, damping (3, 4).
        motors: positions, velocities and a torque fed to the arms besides, in the middle of the
            steps, (3, n steps, 4).
        passed: at a sample the mean of the steps that meet there.
    """
    work, tau = np.zeros((WORK_ROWS, 4)), np.empty(4)
    passed[:] = 0.0
    for step in range(motors.shape[1]):
        for joint in range(4):
            tau[joint] = motors[2, step, joint] + spring_torque(
                springs[0, joint], springs[1, joint], springs[2, joint],
                motors[0, step, joint] - state[Q, joint] - 0.5 * dt * state[QD, joint],
                motors[1, step, joint] - state[QD, joint])
            if step % steps == 0:
                passed[step // steps, joint] += 0.5 * tau[joint]
            if (step + 1) % steps == 0:
                passed[(step + 1) // steps, joint] += 0.5 * tau[joint]
        leg = advance(constants, friction, harmonics, state, work, step * dt, tau, dt)
        if leg >= 0:
            return leg
    return -1


def rate(values: np.ndarray, period: float) -> np.ndarray:
    """Return the time derivative of smooth samples (n, ...), fourth order, second at the ends."""
    slope = np.gradient(values, period, axis=0)
    slope[2:-2] = (8.0 * (values[3:-1] - values[1:-3]) - values[4:] + values[:-4]) / (12.0 * period)
    return slope


def in_band(values: np.ndarray, cutoff: float, period: float) -> np.ndarray:
    """Return samples (n, ...) below a frequency, Hz, without a shift in time."""
    return sosfiltfilt(butter(4, cutoff, fs=1.0 / period, output='sos'), values, axis=0)


@dataclass
class Torques:
    """Torques along one reading of the encoders.

    Attributes:
        t: time since the machine began at rest, (n,) s, even.
        reading: of ideal encoders (n, 4), rad.
    """

    t: np.ndarray
    reading: np.ndarray
    _mechanisms: dict = field(default_factory=dict)
    _motions: dict = field(default_factory=dict)
    _frictions: dict = field(default_factory=dict)

    @property
    def period(self) -> float:
        """s."""
        return float(self.t[1] - self.t[0])

    def recorded(self, machine: Machine) -> np.ndarray:
        """Return the torque (n, 4), N m, that the recorder of `machine` would tell."""
        q = self._true_positions(machine)
        load = self._mechanism(machine, q)
        if machine.transmission.is_rigid:
            total = load + self._friction(machine, q, load)
        else:
            total = self._behind_springs(machine, q)
        for row in machine.loads:
            total = total + np.array([row(*now) for now in zip(self.t, q, rate(q, self.period))])
        return self.amplified(machine, total, q)

    def _true_positions(self, machine: Machine) -> np.ndarray:
        sensors = machine.sensors
        if not np.any(sensors.eccentricity):
            return np.ascontiguousarray(self.reading - sensors.encoder_offset)
        q = self.reading
        for _ in range(6):
            q = self.reading - sensors.encoder_offset - sensors.eccentricity * np.sin(
                q + sensors.eccentricity_phase)
        return np.ascontiguousarray(q)

    def _motion(self, machine: Machine, q: np.ndarray):
        key = (q.tobytes(), machine.geometry.packed.tobytes())
        if key not in self._motions:
            qd = rate(q, self.period)
            try:
                self._motions[key] = qd, platform_motion(machine.geometry, q, qd,
                                                         rate(qd, self.period))
            except UnreachableError as error:
                raise OutOfReach(str(error)) from error
        return self._motions[key]

    def _mechanism(self, machine: Machine, q: np.ndarray) -> np.ndarray:
        """Return the torque (n, 4) behind friction."""
        constants = packed_mechanism(machine.geometry, machine.bodies, machine.gravity)
        key = (q.tobytes(), constants.tobytes(), machine.platform.packed.tobytes())
        if key not in self._mechanisms:
            qd, motion = self._motion(machine, q)
            torque = np.empty_like(q)
            lost = _mechanism_rows(constants, machine.platform.packed, machine.platform.has_pivots,
                                   motion.x, motion.xd, motion.xdd, q, qd, torque)
            if lost >= 0:
                raise OutOfReach(f'sample {lost} is out of reach')
            self._mechanisms[key] = torque
        torque = self._mechanisms[key].copy()
        for item in machine.harmonics:
            torque[:, item.joint] += item.amplitude * np.sin(
                item.periods * q[:, item.joint] + item.phase)
        return torque

    def _friction(self, machine: Machine, q: np.ndarray, load: np.ndarray) -> np.ndarray:
        laws = machine.friction.packed
        carried = load.tobytes() if np.any(laws[:, LOAD_COEFFICIENT]) else b''
        key = q.tobytes(), laws.tobytes(), carried
        if key not in self._frictions:
            torque = np.empty_like(q)
            _friction_rows(laws, self.t, q, rate(q, self.period), load, torque)
            self._frictions[key] = torque
        return self._frictions[key]

    def _behind_springs(self, machine: Machine, q: np.ndarray) -> np.ndarray:
        """Return the motors' torque (n, 4) where the arms follow them over springs and gaps."""
        driven, motors = split_machine(machine)
        inertia = np.broadcast_to(driven.bodies.actuator_inertia, (LEGS,))
        rigid = ~motors.elastic
        springs = np.stack((np.where(rigid, RIGID, motors.stiffness), motors.gap,
                            np.where(rigid, 0.5 * np.sqrt(RIGID * inertia), motors.damping)))
        # a rigid joint is a very stiff one that carries only what the others' elasticity changes
        feed = np.where(rigid, self._mechanism(machine, q), 0.0)
        steps = max(1, int(np.ceil(self.period * np.sqrt(
            np.max(springs[0] / inertia)) / PHASE)))
        way = CubicSpline(self.t, q)
        middle = (np.arange((len(q) - 1) * steps) + 0.5) * self.period / steps
        state = np.zeros((6, LEGS))
        state[X] = forward_kinematics(driven.geometry, q[0])
        state[Q], state[MODE] = q[0], FREE
        passed = np.empty_like(q)
        lost = _spring_rows(
            machine_constants(driven), Friction().packed, driven.harmonic_rows, springs,
            np.stack((way(middle), way(middle, 1), CubicSpline(self.t, feed)(middle))),
            state, steps, self.period / steps, passed)
        if lost >= 0:
            raise OutOfReach('the arms leave their reach')
        qdd = rate(rate(q, self.period), self.period)
        return passed + motors.inertia * qdd + self._friction(machine, q, passed)

    def amplified(self, machine: Machine, torque: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return the record of a torque (n, 4), N m, that the machine needs at true q (n, 4)."""
        amplifier = machine.amplifier
        wave = np.sin(amplifier.ripple_periods * q + amplifier.ripple_phase)
        asked = torque * (1.0 + amplifier.gain_error) * (1.0 + amplifier.ripple * wave)
        if amplifier.time_constant:
            asked = asked + amplifier.time_constant * rate(asked, self.period)
        if machine.sensors.torque_delay:
            late = np.clip(self.t - machine.sensors.torque_delay, self.t[0], self.t[-1])
            asked = CubicSpline(self.t, asked)(late)
        return asked
