"""Recordings of a machine: what a bag would hold, and the truth behind it.

Every recording is made without noise of the recorder, which never reaches the drives; the noise
that a seed draws is added afterwards and so is known to the last digit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from hidden.hider import Values
from hidden.machines import Known
from hidden.outside import Act, Outside
from hidden.physics import Torques, in_band
from par4_dynamics.model import Model
from par4_dynamics.state import state_of_joints, state_of_platform
from par4_identification.logs.log import Log
from par4_kinematics.approach import with_approach
from par4_kinematics.motion import Motion
from par4_kinematics.workspace import home_pose
from par4_sim.closed_loop.simulation import Simulation, build_plant
from par4_sim.drives.held_load import HeldLoad
from par4_sim.machines.machine import Machine
from par4_sim.machines.noise import Noise, NoiseSource
from par4_sim.plants.plant import Plant

DWELL = 0.5
"""s of rest before and after."""
PERIOD = 1e-3
FOLD = 200.0
"""Hz: faster torque moves no arm as far as a sample tells."""


@dataclass(frozen=True)
class Wander:
    """A load on the drives that follows nothing: first order with a memory, in N m rms.

    Attributes:
        level: (4,), N m rms.
        memory: s.
        seed: of its path.
    """

    level: np.ndarray
    memory: float
    seed: int

    def path(self, samples: int) -> np.ndarray:
        """Return the load at the first samples (n, 4), N m, held for a sample each."""
        source = NoiseSource(Noise(torque_noise=1.0, correlation_time=self.memory), PERIOD,
                             self.seed)
        return self.level * drawn(source, samples)

    def load(self, samples: int) -> HeldLoad:
        """Return the load as a machine takes it."""
        return HeldLoad(self.path(samples), PERIOD)


def drawn(source: NoiseSource, samples: int) -> np.ndarray:
    """Return the torque noise of the first samples, (n, 4)."""
    rows = np.empty((samples, 4))
    for row in rows:
        source.advance()
        row[:] = source.torque
    return rows


class Lossy:
    """A plant that a cause outside the library takes torque from; implements `Plant`.

    Args:
        plant: the mechanism.
        act: what torque is lost between drives and plant.

    Attributes:
        lost: the torque lost in each step, (4,) N m.
    """

    def __init__(self, plant: Plant, act: Act) -> None:
        self._plant = plant
        self._act = act
        self.lost: list[np.ndarray] = []

    def __getattr__(self, name: str):
        return getattr(self._plant, name)

    def step(self, tau: np.ndarray) -> None:
        """Advance under what the cause leaves of the torque."""
        self.lost.append(np.array(self._act(self._plant, tau)))
        self._plant.step(tau - self.lost[-1])


@dataclass(frozen=True)
class Recording:
    """A log and the truth behind it.

    Attributes:
        log: what the diagnosis sees.
        t: time since the machine began, (n,) s.
        reading: of ideal encoders, (n, 4) rad: without counts.
        counted: what the encoders tell, (n, 4) rad, of which the log has every `every`-th sample.
        every: samples from row to row of the log.
        torque: recorded, without noise, (n, 4) N m; wandering load and outside cause are in it.
        noise: what the recorder added and what it folds into its band of the drives' answers to
            encoder counts, (n, 4) N m.
        wander: the wandering load, (n, 4) N m, zero without one.
        outside: what a cause outside the library adds to the recorded torque, (n, 4) N m.
    """

    log: Log
    t: np.ndarray
    reading: np.ndarray
    counted: np.ndarray
    every: int
    torque: np.ndarray
    noise: np.ndarray
    wander: np.ndarray
    outside: np.ndarray


def holding_torque(known: Known) -> np.ndarray:
    """Return what the drives believe keeps the machine at home, (4,) N m."""
    still = np.zeros((1, 4))
    rest = state_of_platform(known.robot.geometry, np.zeros(1), home_pose(known.robot)[None],
                             still, still)
    return known.model.torque(rest)[0]


def simulation_of(known: Known, machine: Machine, fidelity: str, noise: Noise, seed: int,
                  outside: tuple[Outside, Values] | None = None, kept: int = 0) -> Simulation:
    """Return the simulation of a machine at rest, with the torques of `kept` physics steps."""
    robot = known.robot
    plant = build_plant(machine, fidelity)
    if outside and outside[0].starts:
        plant = Lossy(plant, outside[0].starts(known, outside[1], plant.dt))
    return Simulation(robot, plant, PERIOD, robot.drives.torque_limit, holding_torque(known),
                      machine.amplifier, machine.sensors, noise, seed, kept=kept)


def record(known: Known, machine: Machine, motion: Motion, *, fidelity: str, noise: Noise,
           seed: int, feedforward: Model | None, wander: Wander | None, name: str,
           outside: tuple[Outside, Values] | None = None, every: int = 1) -> Recording:
    """Return the recording of a motion on a machine; see `Simulation` for what is asked.

    Args:
        outside: a cause outside the library and its values.
        every: samples from row to row of the log.
    """
    simulation = simulation_of(known, machine, fidelity, Noise(), seed)
    # encoders or dimensions that err see home elsewhere: as into a bag, the drives are led there
    motion = with_approach(motion, known.robot, simulation.q)
    samples = round((motion.duration + 2.0 * DWELL) / PERIOD)
    each = round(PERIOD / simulation.plant.dt)
    simulation.close()
    if wander:
        machine = loaded(machine, wander, samples)
    simulation = simulation_of(known, machine, fidelity, Noise(), seed, outside, samples * each)
    plant = simulation.plant
    start = simulation.time + DWELL
    simulation.queue_reference(start + motion.t, motion.q, motion.qd, motion.qdd)
    if feedforward:
        state = state_of_joints(known.robot.geometry, motion.t, motion.q, motion.qd, motion.qdd)
        simulation.queue_effort(start + motion.t, feedforward.torque(state))
    told = simulation.next_samples(samples)
    # drives answer encoder counts at every step; what of that a recorder folds into its band
    delivered = simulation.delivered
    steps = np.arange(len(delivered)) * plant.dt + plant.torque_offset
    fold = min(FOLD, 0.4 / (every * PERIOD))
    smooth = CubicSpline(steps, in_band(delivered, fold, plant.dt))
    folded = told.true_torque - smooth(np.arange(samples) * PERIOD)
    simulation.close()
    sensors = machine.sensors
    true = told.true_q
    reading = true + sensors.encoder_offset + sensors.eccentricity * np.sin(
        true + sensors.eccentricity_phase)
    torque, counted = told.effort, told.q
    added = drawn(NoiseSource(noise, PERIOD, seed), samples)
    t = np.arange(samples) * PERIOD
    path = wander.path(samples) if wander else np.zeros_like(torque)
    strange = np.zeros_like(torque)
    if isinstance(plant, Lossy):
        lost = np.array(plant.lost)
        lost = 0.5 * (lost + np.concatenate((lost[:1], lost[:-1])))
        strange = Torques(t, reading).amplified(machine, lost[::each][:samples], true)
    if outside and outside[0].tells:
        more = outside[0].tells(outside[1], t, torque, np.random.default_rng((seed, 9)))
        torque, strange = torque + more, strange + more
    rows = slice(0, samples, every)
    log = Log(name=name, joint_names=known.robot.joint_names, start_stamp=int(told.time_ns[0]),
              period=every * PERIOD, t=t[rows], q=counted[rows], tau=(torque + added)[rows],
              segments=(slice(0, len(t[rows])),), reference=None, accounts=None)
    return Recording(log, t, reading, counted, every, torque - folded, added + folded, path,
                     strange)


def loaded(machine: Machine, wander: Wander, samples: int) -> Machine:
    """Return the machine with a wandering load."""
    return replace(machine, loads=(*machine.loads, wander.load(samples)))
