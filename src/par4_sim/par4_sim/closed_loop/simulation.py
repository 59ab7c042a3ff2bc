"""The closed loop: plant, drives, sensors; sampled at the publishing rate. No ROS, no clock."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, fields, replace
from typing import Generic, TypeVar

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.state import state_of_platform
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import Robot
from par4_kinematics.workspace import home_pose
from par4_sim.choices import FIDELITIES, STEP
from par4_sim.closed_loop.driven import can_be_driven, drive_plant, drive_samples
from par4_sim.drives.control_loop import ControlLoop
from par4_sim.drives.controller import Controller
from par4_sim.drives.drive import DriveLoops
from par4_sim.drives.laws import controller_named
from par4_sim.drives.reference import ReferenceQueue
from par4_sim.drives.reference_curve import STILL, ReferenceLimits
from par4_sim.drives.reference_points import ReferencePoints
from par4_sim.machines.amplifier import Amplifier
from par4_sim.machines.machine import LoadTorque, Machine
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.machines.noise import Noise, NoiseSource
from par4_sim.machines.sensors import Sensors
from par4_sim.plants.elastic import ElasticPlant, split_machine
from par4_sim.plants.exact import ExactPlant
from par4_sim.plants.plant import Plant

RESTING = 0.05
"""Joint speed below which a machine that holds its place counts as resting, rad/s."""

Time = TypeVar('Time', int, np.ndarray)


@dataclass(frozen=True)
class Told(Generic[Time]):
    """What the machine tells, and what only a simulation knows: `Sample`, or n `Samples`.

    Attributes:
        time_ns: the stamp, int or (n,): when the values are valid on the simulation's clock, but
            for jitter.
        q, qd: encoder positions and velocities (4,) or (n, 4), rad, rad/s.
        effort: nominal torque G_i V_i, likewise, N m.
        voltage: amplifier input after clipping, V.
        true_torque: torque that the amplifiers deliver, N m.
        true_pose: x, y, z, theta, m, rad.
        true_q: joint positions where the encoders sit, rad.
    """

    time_ns: Time
    q: np.ndarray
    qd: np.ndarray
    effort: np.ndarray
    voltage: np.ndarray
    true_torque: np.ndarray
    true_pose: np.ndarray
    true_q: np.ndarray


Sample = Told[int]
Samples = Told[np.ndarray]


class Simulation:
    """A machine under its drives, advanced one published sample at a time.

    Reference -> drives -> amplifiers -> plant -> encoders -> recorder. The drives close their
    loops on the encoders; noise, delay and steps of the recorded torque do not reach them. The
    machine runs ahead of the samples where a recorded torque is early (`torque_delay` < 0).

    Args:
        robot: geometry, drives, limits.
        plant: the machine; reset by this class.
        sample_period: s, a whole number of physics steps.
        torque_limit: of the drives, N m.
        holding_torque: command that keeps the machine at rest at `pose`, (4,) N m; the drives
            begin with it.
        amplifier, sensors: as they truly are.
        noise: of the recorder.
        seed: of the noise.
        pose: where the machine rests at first (4,); None for home.
        controller: law of the drives; None for their own loops.
        limits: what the drives follow at the most; None for all that they are told.
        kept: physics steps of which `delivered` tells the torque.

    Attributes:
        sample_period: s.
        torque_limit: N m.

    Raises:
        InputError: a period that is not a whole number of steps, a jitter too large for it.
    """

    def __init__(self, robot: Robot, plant: Plant, sample_period: float, torque_limit: float,
                 holding_torque: np.ndarray, amplifier: Amplifier, sensors: Sensors, noise: Noise,
                 seed: int, pose: np.ndarray | None = None,
                 controller: Controller | None = None,
                 limits: ReferenceLimits | None = None, kept: int = 0) -> None:
        self._substeps = round(sample_period / plant.dt)
        if self._substeps < 1 or abs(self._substeps * plant.dt - sample_period) > 1e-9:
            raise InputError(f'publish rate: {1 / sample_period:g} Hz asked, the physics runs at '
                             f'{1 / plant.dt:g} Hz; give a rate that divides it')
        self.sample_period = sample_period
        self.torque_limit = torque_limit
        self._plant = plant
        self._gain = np.asarray(robot.drives.gain)
        self._seed = seed
        self._noise = noise
        self._holding_torque = holding_torque
        self._loop = ControlLoop(
            robot.drives, controller or DriveLoops(robot.drives, torque_limit, plant.dt), amplifier,
            sensors, plant, self._substeps, kept)
        self._driven = plant if can_be_driven(plant, self._loop) else None
        self._ahead = self._loop.steps_ahead
        self._pose = home_pose(robot) if pose is None else pose
        plant.reset(self._pose)
        self._reference = ReferenceQueue(plant.q, limits)
        self.reset()

    def reset(self) -> None:
        """Put the machine at rest where it began, one period after time 0, nothing queued.

        Counts stay.
        """
        self._plant.reset(self._pose)
        self._reference.restart(self.q)
        self._loop.restart(self._plant.q, self._holding_torque)
        self._source = NoiseSource(self._noise, self.sample_period, self._seed)
        self._readings: deque[tuple[np.ndarray, np.ndarray, np.ndarray]] = deque()
        self._steps = 0
        self._samples = 1  # a stamp of zero would mean 'not set'

    @property
    def plant(self) -> Plant:
        """The machine."""
        return self._plant

    @property
    def q(self) -> np.ndarray:
        """Joint positions (4,), rad, as the encoders tell them."""
        return self._loop.reading(self._plant.q)

    @property
    def time(self) -> float:
        """Time of the next sample, s."""
        return self._samples * self.sample_period

    @property
    def counts(self) -> dict[str, int]:
        """What went wrong so far, by name."""
        return {'late_points': self._reference.late_points,
                'missing_effort': self._reference.missing_effort,
                'interrupted_references': self._reference.interrupted,
                'saturated_commands': self._loop.controller.saturated_commands,
                'saturated_speeds': self._loop.controller.saturated_speeds,
                'unsolved_programs': self._loop.controller.unsolved}

    @property
    def limited(self) -> int:
        """Joints and physics steps so far in which a torque, a speed or both were limited."""
        return self._loop.controller.limited

    @property
    def delivered(self) -> np.ndarray:
        """Torque of the amplifiers (n, 4), N m, of the last physics steps, as many as are kept."""
        return self._loop.delivered(self._steps)

    @property
    def starved(self) -> bool:
        """Whether a moving reference was not gone on with, so that the drives brake or braked."""
        return self._reference.starved

    @property
    def following_error(self) -> np.ndarray:
        """Distance of the joints from what the drives follow now (4,), rad."""
        return self._reference.target(self._reached(self._steps))[:LEGS] - self.q

    @property
    def rests(self) -> bool:
        """Whether neither the joints move nor what the drives follow now."""
        asked = self._reference.target(self._reached(self._steps))[LEGS:2 * LEGS]
        return bool(np.abs(asked).max() < STILL and np.abs(self._plant.qd).max() < RESTING)

    def end_reference(self) -> None:
        """Forget what is queued beyond now: what moves ends in a ramp, as if no more had come."""
        self._reference.end_here(self._reached(self._steps))

    def brake(self) -> None:
        """Forget what is queued and bring the machine to rest from where it is."""
        self._reference.brake(self._reached(self._steps), self.q, self._plant.qd)

    def queue_reference(self, times: np.ndarray, q: np.ndarray, qd: np.ndarray,
                        qdd: np.ndarray) -> None:
        """Queue reference points (n, 4) at simulation times (n,), s; see `queue_points`."""
        self.queue_points(ReferencePoints.of_motion(times, q, qd, qdd))

    def queue_points(self, points: ReferencePoints, looked_at: bool = True) -> None:
        """Queue reference points at simulation times; see `ReferenceQueue.queue_points`.

        Raises:
            InputError: the way to the first point breaks a limit, or one between points that were
                not `looked_at`.
        """
        self._reference.queue_points(self._reached(self._steps), points, looked_at)

    def check_start(self, points: ReferencePoints) -> None:
        """Refuse points that do not begin at rest near where the machine stands.

        Raises:
            InputError: names the joint that would move or jump.
        """
        self._reference.check_start(self._reached(self._steps), points)

    @property
    def begun(self) -> bool:
        """Whether reference points were queued since the machine was put at rest."""
        return self._reference.begun

    def queue_effort(self, times: np.ndarray, tau: np.ndarray) -> None:
        """Queue feedforward torques (n, 4), N m, for the reference points at `times`."""
        self._reference.queue_effort(times, tau)

    def effort_missing(self) -> bool:
        """Return whether a point that the next sample uses or looks ahead at lacks its torque."""
        return self._reference.uncovered(
            self._reached(self._needed()) + self._loop.controller.horizon)

    def next_sample(self) -> Sample:
        """Return the sample valid at the current time and advance by one sample period.

        Its stamp is off by the recorder's jitter.

        Raises:
            UnreachableError: the machine was driven out of its workspace.
        """
        needed = self._needed()
        self._reference.foresee(self._reached(needed))
        while self._steps < needed:
            self._advance(needed)
        self._reference.use_until(self._reached(needed))
        self._source.advance()
        q, qd, pose = self._readings.popleft()
        told = self._loop.record((self._samples - 1) * self._substeps, q, qd, self._source.torque,
                                 self._source.position)
        stamp_ns = round(self._samples * self.sample_period * 1e9) + self._source.stamp_ns
        self._samples += 1
        return Sample(stamp_ns, told[0], told[1], told[2], told[2] / self._gain, told[3], pose,
                      q)

    def next_samples(self, count: int) -> Samples:
        """Return what as many calls of `next_sample` do, to the last digit.

        Where all that acts is compiled, all of it happens in one call, in half the time. Nothing
        can be queued meanwhile.

        Raises:
            UnreachableError: the machine was driven out of its workspace.
        """
        if self._driven is None or count < 1:
            told = [self.next_sample() for _ in range(count)]
            return Samples(*(np.array([getattr(sample, part.name) for sample in told])
                             for part in fields(Told)))
        first = self._samples
        self._samples += count - 1
        needed = self._needed()
        self._reference.foresee(self._reached(needed))
        torque_noise, position_noise, jitter_ns = self._source.take(count)
        recorded, readings = drive_samples(
            self._driven, self._loop, self._reference, self.sample_period, self._steps, first,
            self._substeps, self._ahead, np.array(self._readings).reshape(-1, 3, LEGS),
            torque_noise, position_noise)
        self._steps = max(self._steps, needed)
        self._readings = deque((q, qd, pose) for q, qd, pose in readings[count:])
        self._reference.use_until(self._reached(needed))
        self._samples += 1
        number = np.arange(first, first + count)
        stamp_ns = np.rint(number * self.sample_period * 1e9).astype(np.int64) + jitter_ns
        q, qd, effort, torque = recorded.transpose(1, 0, 2)
        return Samples(stamp_ns, q, qd, effort, effort / self._gain, torque, readings[:count, 2],
                       readings[:count, 0])

    def _needed(self) -> int:
        """Return how many physics steps the next sample takes."""
        return (self._samples - 1) * self._substeps + self._ahead

    def _reached(self, steps: int) -> float:
        """Return the time, s, that so many physics steps reach."""
        return self.sample_period + steps * self._plant.dt

    def _advance(self, needed: int) -> None:
        """Do one physics step, or all in one call up to `needed` or to where a sample is due.

        The true readings are kept where one is.
        """
        plant, since = self._plant, self._steps % self._substeps
        due = since == 0
        q, qd = plant.q, plant.qd
        pose = plant.x if due else np.empty(0)
        if self._driven is not None:
            count = min(needed - self._steps, self._substeps - since)
            drive_plant(self._driven, self._loop, self._reference, self.sample_period,
                        self._steps, count)
            self._steps += count
            if due:
                self._readings.append((q, qd, pose))
            return
        plant.step(self._loop.torque(self._reference, self._reached(self._steps), self._steps, q,
                                     qd))
        self._steps += 1
        if due:
            if plant.velocity_offset < 0.0:
                qd = qd - plant.velocity_offset / plant.dt * (plant.qd - qd)
            self._readings.append((q, qd, pose))

    def close(self) -> None:
        """Release the plant."""
        self._plant.close()


def build_plant(machine: Machine, fidelity: str, dt: float = STEP) -> Plant:
    """Return the plant of that fidelity, with springs and gaps where transmissions are not rigid.

    `dt` is the step of its physics, s.

    Raises:
        InputError: unknown fidelity, masses that make a body negative.
    """
    if fidelity not in FIDELITIES:
        raise InputError(f'fidelity {fidelity!r} asked; known are {", ".join(FIDELITIES)}')
    if not machine.transmission.is_rigid:
        driven, motors = split_machine(machine)
        substeps = motors.substeps(dt)
        return ElasticPlant(build_plant(driven, fidelity, dt / substeps), motors, substeps)
    if fidelity == 'exact':
        return ExactPlant(machine, dt)
    from par4_sim.plants.bullet import BulletPlant  # pybullet is slow to load and not always needed
    return BulletPlant(machine, 'accurate' if fidelity == 'accurate' else 'fast', dt)


def build_simulation(robot: Robot, model: Model, fidelity: str, sample_period: float = 1e-3,
                     seed: int = 0, loads: tuple[LoadTorque, ...] = (),
                     pose: np.ndarray | None = None, law: str = 'loops',
                     known: Model | None = None, limits: ReferenceLimits | None = None,
                     step: float = STEP, **noise: float) -> Simulation:
    """Return the simulation of the machine that `model` describes, at rest.

    Args:
        robot: geometry, drives, limits.
        model: the machine as it truly is.
        fidelity: of the plant, one of FIDELITIES.
        sample_period: time between recorded samples, s.
        seed: of the noise.
        loads: further torques on the joints.
        pose: pose (4,), m and rad, at which it rests at first; None for home.
        law: of the drives, one of LAWS.
        known: model that the law of the drives uses, if it needs one.
        limits: of the references that the drives follow; None to follow any reference.
        step: of the physics and the drives, s.
        noise: sizes by name, as `Noise` has them.

    Raises:
        InputError: unknown fidelity or law, a rate that does not divide the physics', masses
            that make a body negative, a jitter that mixes up the stamps.
        UnreachableError: a pose that a leg cannot reach.
    """
    machine = machine_of_model(robot, model)
    machine = replace(machine, loads=(*machine.loads, *loads))
    plant = build_plant(machine, fidelity, step)
    limit = model.limit_of_drives(robot)
    still = np.zeros((1, LEGS))
    pose = home_pose(robot) if pose is None else np.asarray(pose, dtype=float)
    at_rest = state_of_platform(robot.geometry, np.zeros(1), pose[None], still, still)
    return Simulation(robot, plant, sample_period, limit, model.torque(at_rest)[0],
                      machine.amplifier, machine.sensors, Noise(**noise), seed, pose,
                      controller_named(law, robot, limit, plant.dt, known), limits)
