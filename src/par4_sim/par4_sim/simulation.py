"""The closed loop: plant, drives, sensors; sampled at the publishing rate. No ROS, no clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.state import state_of_platform
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import Robot
from par4_kinematics.workspace import home_pose
from par4_sim.drive import DriveLoops
from par4_sim.exact import ExactPlant
from par4_sim.machine import Machine
from par4_sim.machine_effects import machine_of_model
from par4_sim.plant import STEP, Plant
from par4_sim.reference import ReferenceQueue, interpolate

Fidelity = Literal['accurate', 'fast', 'exact']
FIDELITIES: tuple[str, ...] = ('accurate', 'fast', 'exact')


@dataclass(frozen=True)
class Sample:
    """What the machine tells at one time, and what only a simulation knows.

    Attributes:
        time_ns: when the values are valid, on the simulation's clock.
        q, qd: encoder positions and velocities (4,), rad, rad/s.
        effort: nominal torque G_i V_i (4,), N m.
        voltage: amplifier input after clipping (4,), V.
        true_torque: torque on the arms (4,), N m.
        true_pose: x, y, z, theta (4,), m, rad.
    """

    time_ns: int
    q: np.ndarray
    qd: np.ndarray
    effort: np.ndarray
    voltage: np.ndarray
    true_torque: np.ndarray
    true_pose: np.ndarray


class Simulation:
    """A machine under its drives, advanced one published sample at a time.

    Args:
        robot: geometry, drives, limits.
        plant: the machine; reset by this class.
        sample_period: s, a whole number of physics steps.
        seed: of the measurement noise.
        torque_noise: standard deviation of the noise on the recorded voltage, as torque, N m.
        torque_limit: of the drives, N m.
        holding_torque: what keeps the machine at rest at home, (4,) N m; the drives begin with it.
    """

    def __init__(self, robot: Robot, plant: Plant, sample_period: float, seed: int,
                 torque_noise: float, torque_limit: float, holding_torque: np.ndarray) -> None:
        self._substeps = round(sample_period / plant.dt)
        if self._substeps < 1 or abs(self._substeps * plant.dt - sample_period) > 1e-9:
            raise InputError(f'publish rate: {1 / sample_period:g} Hz asked, the physics runs at '
                             f'{1 / plant.dt:g} Hz; give a rate that divides it')
        self.sample_period = sample_period
        self._robot = robot
        self._plant = plant
        self._gain = np.asarray(robot.drives.gain)
        self._seed = seed
        self._noise = torque_noise
        self._drives = DriveLoops(robot.drives, torque_limit, plant.dt)
        self._holding_torque = holding_torque
        self._target = np.zeros(12)
        plant.reset(home_pose(robot))
        self._reference = ReferenceQueue(plant.q)
        self.reset()

    def reset(self) -> None:
        """Put the machine at rest at home, one period after time 0, nothing queued; counts stay."""
        self._plant.reset(home_pose(self._robot))
        self._reference.restart(self._plant.q)
        self._drives.restart(self._holding_torque)
        self._random = np.random.default_rng(self._seed)
        self._samples = 1  # a stamp of zero would mean 'not set'

    @property
    def plant(self) -> Plant:
        """The machine."""
        return self._plant

    @property
    def time(self) -> float:
        """Time up to which the machine has been advanced, s."""
        return self._samples * self.sample_period

    @property
    def counts(self) -> dict[str, int]:
        """What went wrong so far, by name."""
        return {'late_points': self._reference.late_points,
                'missing_effort': self._reference.missing_effort,
                'saturated_commands': self._drives.saturated}

    def queue_reference(self, times: np.ndarray, q: np.ndarray, qd: np.ndarray,
                        qdd: np.ndarray) -> None:
        """Queue reference points (n, 4) at simulation times (n,), s; see `ReferenceQueue`."""
        self._reference.queue(self.time, times, q, qd, qdd)

    def queue_effort(self, times: np.ndarray, tau: np.ndarray) -> None:
        """Queue feedforward torques (n, 4), N m, for the reference points at `times`."""
        self._reference.queue_effort(times, tau)

    def effort_missing(self) -> bool:
        """Return whether the next sample would use a reference point without its torque."""
        return self._reference.uncovered(self.time + self.sample_period)

    def next_sample(self) -> Sample:
        """Return the sample valid at the current time and advance by one sample period.

        Raises:
            UnreachableError: the machine was driven out of its workspace.
        """
        plant = self._plant
        start = self.time
        q, qd, pose = plant.q, plant.qd, plant.x
        before, command_before = self._drives.torque.copy(), self._drives.command.copy()
        self._step(start)
        torque, command = self._drives.torque.copy(), self._drives.command.copy()
        if plant.torque_offset > 0.0:
            # held torques of both neighbouring steps are half a step away from the sample
            torque, command = 0.5 * (before + torque), 0.5 * (command_before + command)
        if plant.velocity_offset < 0.0:
            qd = 0.5 * (qd + plant.qd)
        for substep in range(1, self._substeps):
            self._step(start + substep * plant.dt)
        self._reference.use_until(start + self.sample_period)
        measured = command + self._noise * self._random.standard_normal(4)
        time_ns = round(self._samples * self.sample_period * 1e9)
        self._samples += 1
        return Sample(time_ns, self._drives.encoder(q), qd, measured, measured / self._gain,
                      torque, pose)

    def _step(self, time: float) -> None:
        plant = self._plant
        interpolate(self._reference.times, self._reference.points, time, self._target)
        plant.step(self._drives.follow(self._target, self._drives.encoder(plant.q), plant.qd))

    def close(self) -> None:
        """Release the plant."""
        self._plant.close()


def build_plant(machine: Machine, fidelity: str, dt: float = STEP) -> Plant:
    """Return the plant of that fidelity.

    Raises:
        InputError: unknown fidelity.
    """
    builders: dict[str, Callable[[], Plant]] = {'exact': lambda: ExactPlant(machine, dt)}
    if fidelity in ('accurate', 'fast'):
        from par4_sim.bullet import BulletPlant  # pybullet is slow to load and not always needed
        builders[fidelity] = lambda: BulletPlant(machine, fidelity, dt)
    if fidelity not in builders:
        raise InputError(f'fidelity {fidelity!r} asked; known are {", ".join(FIDELITIES)}')
    return builders[fidelity]()


def build_simulation(robot: Robot, model: Model, fidelity: str, sample_period: float = 1e-3,
                     seed: int = 0, torque_noise: float = 0.0) -> Simulation:
    """Return the simulation of the machine that `model` describes, at rest at home.

    Raises:
        InputError: unknown fidelity, a rate that does not divide the physics', masses that make
            a body negative.
    """
    plant = build_plant(machine_of_model(robot, model), fidelity)
    limit = model.torque_limit or robot.drives.torque_limit
    still = np.zeros((1, LEGS))
    at_rest = state_of_platform(robot.geometry, np.zeros(1), home_pose(robot)[None], still, still)
    return Simulation(robot, plant, sample_period, seed, torque_noise, limit,
                      model.torque(at_rest)[0])
