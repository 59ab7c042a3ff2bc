"""Scenarios: what is hidden, in which machine, how it moves and what is recorded, from a seed."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hidden.hider import JOINTS, Hider, Values, on, scaled, signs
from hidden.hiders import DIMENSIONS, HIDERS
from hidden.machines import Known, known_machine
from hidden.motions import ODD_SHAPES, SHAPES, draw_motion
from hidden.outside import OUTSIDE, Outside
from hidden.physics import OutOfReach, Torques, in_band
from hidden.recording import PERIOD, Recording, Wander, loaded, record, simulation_of
from hidden.truth import BAND, CHAOTIC, EVERY, Truth, base_variants, build, usable
from par4_identification.logs.read_log import read_log
from par4_kinematics.motion import Motion
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.machines.machine import Machine
from par4_sim.machines.noise import Noise

KINDS = ('single', 'pair', 'removed', 'clean', 'below', 'rods', 'triple', 'company', 'outside',
         'realistic', 'wander', 'lines', 'bursts', 'coarse', 'large')
"""In the order of their seeds."""
FIT, HELD_OUT = 16.0, 10.0
"""s"""
PLANNED = 150.0
"""Log-likelihood ratio on the planned motion at which a draw is kept: the real one, with coloured
noise, may be smaller."""
DRAWS = 6
"""Of sizes, before one that hardly shows is kept."""
BELOW = 1.0
"""Log-likelihood ratio on the planned motion of an effect below the floor."""


LARGE = ('encoder_offset', 'geometry_error', 'drive_gain_error', 'time_offset')
"""Effects that a careless setup makes large."""
COARSE_COUNTS, COARSE_EVERY = 8192, (1, 2, 5)
"""Encoder counts a turn; samples at 1 kHz from row to row of a coarse log."""
PROMPTED, PROMPT = ('time_offset', 'actuator_lag'), 0.2
"""Effects that a drive in service has at this share of the largest size; else no other would carry
a share of the error beside them."""
UNREAL = (*CHAOTIC, 'elastic_transmission')
"""Effects that the truth of a machine with many others cannot judge."""


@dataclass(frozen=True)
class Task:
    """One scenario to make.

    Attributes:
        kind: what is hidden:
            'single', 'pair', 'triple': so many effects of the library;
            'removed': a single whose name and twins the library lacks;
            'clean': nothing; 'below': an effect below the noise;
            'rods': a machine of real rods and bars;
            'company': one effect beside one cause outside the library; 'outside': that alone;
            'realistic': four to eight effects, joints that differ among them;
            'wander', 'lines', 'bursts': nothing, under noise that wanders far, has lines, bursts;
            'coarse': a single with coarse encoders, a slow logger or an odd motion;
            'large': a single of the size of a setup mistake.
        seed: of all that is drawn.
        effect: the first that is hidden, where there is one.
        coloured: whether the noise is.
        fidelity: of the plant.
        through_bag: whether the diagnosis reads bags.
        outside: name of the cause outside the library, where there is one.
    """

    kind: str
    seed: int
    effect: str | None
    coloured: bool
    fidelity: str = 'exact'
    through_bag: bool = False
    outside: str | None = None


@dataclass(frozen=True)
class Scenario:
    """A machine with what is hidden in it and how it is recorded."""

    task: Task
    known: Known
    machine: Machine
    hidden: tuple[tuple[str, Values], ...]
    shape: str
    motions: tuple[Motion, Motion]
    noise: Noise
    wander: Wander | None
    feedforward: bool
    outside: tuple[Outside, Values] | None = None
    every: int = 1


def draw_scenario(task: Task, again: int = 0) -> Scenario:
    """Return the scenario that a task draws.

    Args:
        task: the task.
        again: how many of its draws cannot be recorded or judged.
    """
    random = np.random.default_rng((task.seed, KINDS.index(task.kind), *([again] if again else ())))
    known = known_machine(random.choice(('reference', 'other', 'other friction')), random)
    shape, every = str(random.choice(SHAPES)), 1
    if task.kind == 'coarse':
        known, shape, every = _coarsened(known, shape, random)
    motions = tuple(draw_motion(shape, known.robot, duration, 2 * task.seed + 1_000_000_000 * more)
                    for duration, more in ((FIT, 0), (HELD_OUT, 1)))
    level = float(np.exp(random.uniform(np.log(0.02), np.log(0.2))))
    memory, wander = 0.0, None
    if task.coloured:
        which = random.integers(3)  # noise of the record, a load, or both
        memory = float(random.uniform(5e-3, 0.05)) if which != 1 else 0.0
        if which != 0:
            wander = Wander(random.uniform(0.03, 0.1) * random.uniform(0.5, 1.5, 4),
                            float(random.uniform(0.01, 0.1)), task.seed)
    if task.kind == 'wander':
        wander = Wander(random.uniform(0.1, 0.4) * random.uniform(0.5, 1.5, 4),
                        float(np.exp(random.uniform(np.log(0.03), np.log(1.0)))), task.seed)
    noise = Noise(torque_noise=level, correlation_time=memory)
    feedforward = bool(random.uniform() < 0.5)
    floor = np.hypot(level * (1.0 if memory else np.sqrt(2.0 * BAND * PERIOD)),
                     np.zeros(4) if wander is None else wander.level)
    outside = None
    if task.outside is not None:
        cause = OUTSIDE[task.outside]
        joints = np.sort(random.permutation(4)[:random.integers(1, 5)])
        outside = cause, cause.draw(random, known, joints)
    if task.kind == 'rods':
        hidden = [('distributed_rods', {'rod_mass': known.robot.bodies.rod_mass})]
        bodies = replace(known.machine.bodies, rod_mass=known.robot.bodies.rod_mass,
                         bar_mass=known.robot.bodies.bar_mass)
        machine = replace(known.machine, bodies=bodies)
    else:
        hidden = _drawn_effects(task, known, motions, floor, random)
        machine = build(known.machine, hidden)
    return Scenario(task, known, machine, tuple(hidden), shape, motions, noise, wander,
                    feedforward, outside, every)


def _coarsened(known: Known, shape: str, random: np.random.Generator) -> tuple[Known, str, int]:
    """Return the machine, the motion's shape and the rows of a log that nobody took care of."""
    counts = COARSE_COUNTS if random.uniform() < 0.6 else known.robot.drives.encoder_counts
    every = int(random.choice(COARSE_EVERY))
    if random.uniform() < 0.5:
        shape = str(random.choice(ODD_SHAPES))
    elif counts != COARSE_COUNTS and every == 1:
        every = COARSE_EVERY[-1]
    drives = known.robot.drives.model_copy(update={'encoder_counts': counts})
    return (replace(known, robot=known.robot.model_copy(update={'drives': drives})), shape, every)


def _drawn_effects(task: Task, known: Known, motions: tuple[Motion, Motion], floor: np.ndarray,
                   random: np.random.Generator) -> list[tuple[str, Values]]:
    """Return the effects of a task, as (name, values)."""
    if task.kind == 'large':
        return [(task.effect, _large_values(task.effect, known, motions, random))]
    if task.kind == 'realistic':
        return _usual_machine(known, random)
    names = [] if task.effect is None else [task.effect]
    for _ in range({'pair': 1, 'triple': 2}.get(task.kind, 0)):
        names.append(str(random.choice([
            name for name in HIDERS if name not in (*names, *CHAOTIC)])))
    return [(name, _drawn_values(name, known, motions[0], floor, random, task.kind == 'below'))
            for name in names]


def _drawn_joints(hider: Hider, random: np.random.Generator) -> np.ndarray:
    joints = np.sort(random.permutation(4)[:4 if random.uniform() < 0.5
                                           else random.integers(1, 3)])
    return joints if hider.per_joint else np.array(JOINTS)


def _usual_machine(known: Known, random: np.random.Generator) -> list[tuple[str, Values]]:
    """Return four to eight effects, each as large as usual and none that the others shut out.

    No two joints of a machine are alike; most rods weigh something.
    """
    names = ['joint_friction_difference', 'joint_inertia_difference']
    if random.uniform() < 0.7:
        names.append('distributed_rods')
    pool = [name for name in HIDERS if name not in (*names, *UNREAL, 'distributed_rods')]
    names += map(str, random.choice(pool, random.integers(4, 9) - len(names), replace=False))
    drawn = []
    for name in names:
        hider = HIDERS[name]
        joints = np.array(JOINTS) if name in names[:2] else _drawn_joints(hider, random)
        values = hider.draw(random, known, joints)
        drawn.append((name, scaled(hider, values, PROMPT) if name in PROMPTED else values))
    return drawn


def _large_values(name: str, known: Known, motions: tuple[Motion, Motion],
                  random: np.random.Generator) -> Values:
    """Return values of a setup mistake with which the machine still reaches where it is sent."""
    while True:
        joints = random.permutation(4)[:random.integers(1, 3)]
        way = signs(random, joints)
        values = {
            'encoder_offset': lambda joints=joints, way=way: {'offset': on(
                joints, way * np.radians(random.uniform(2.0, 10.0, len(joints))))},
            'geometry_error': lambda way=way: {
                str(random.choice(DIMENSIONS)): way[0] * random.uniform(5e-3, 20e-3)},
            'drive_gain_error': lambda joints=joints, way=way: {'relative': on(
                joints, way * random.uniform(0.1, 0.5, len(joints)))},
            'time_offset': lambda: {'delay': random.uniform(0.01, 0.1)}}[name]()
        machine = HIDERS[name].build(known.machine, values)
        try:
            for motion in motions:
                Torques(motion.t, motion.q).recorded(machine)
        except OutOfReach:
            continue
        return values


def _drawn_values(name: str, known: Known, motion: Motion, floor: np.ndarray,
                  random: np.random.Generator, below: bool) -> Values:
    """Return values of a usual size that show on the planned motion, or of one below the floor."""
    hider = HIDERS[name]
    for _ in range(DRAWS):
        values = hider.draw(random, known, _drawn_joints(hider, random))
        if name in CHAOTIC:
            return values
        strength = planned_strength(name, values, known, motion, floor)
        if below:
            return scaled(hider, values, min(1.0, float(np.sqrt(BELOW / max(strength, 1e-9)))))
        if strength > PLANNED:
            break
    return values


def planned_strength(name: str, values: Values, known: Known, motion: Motion, floor: np.ndarray
                     ) -> float:
    """Return about what log-likelihood ratio an effect has if the machine moves as planned.

    Args:
        floor: rms of the noise in the band, (4,) N m, taken as white there.
    """
    torques = Torques(motion.t, motion.q)
    plain = torques.recorded(known.machine)
    valid = usable(motion.q)[::EVERY]

    def rows(machine: Machine) -> np.ndarray:
        change = in_band(torques.recorded(machine) - plain, BAND, PERIOD)[::EVERY] / floor
        return np.where(valid, change, 0.0).ravel()

    effect = rows(HIDERS[name].build(known.machine, values))
    base = np.linalg.qr(np.stack([rows(item) for item in base_variants(known.machine)], axis=1))[0]
    left = effect - base @ (base.T @ effect)
    return 0.5 * float(left @ left)


def record_scenario(scenario: Scenario) -> tuple[Recording, Recording]:
    """Return the recordings to fit and held out."""
    task, known = scenario.task, scenario.known
    told = []
    for motion, more, name in zip(scenario.motions, (0, 1), ('fit', 'held out')):
        wander = scenario.wander and replace(scenario.wander, seed=scenario.wander.seed + 7 * more)
        recording = record(
            known, scenario.machine, motion, fidelity=task.fidelity, noise=scenario.noise,
            seed=2 * task.seed + more, feedforward=known.model if scenario.feedforward else None,
            wander=wander, name=name, outside=scenario.outside, every=scenario.every)
        if task.through_bag:
            machine = (loaded(scenario.machine, wander, len(recording.t)) if wander
                       else scenario.machine)
            simulation = simulation_of(known, machine, task.fidelity, scenario.noise,
                                       2 * task.seed + more)
            with tempfile.TemporaryDirectory() as folder:
                bag = Path(folder) / name.replace(' ', '_')
                simulate_to_bag(simulation, motion, known.robot, bag,
                                known.model if scenario.feedforward else None)
                recording = replace(recording, log=read_log(bag, known.robot))
        told.append(recording)
    return tuple(told)


def truth_of(scenario: Scenario, recording: Recording) -> Truth:
    """Return what a recording of the scenario holds."""
    return Truth(recording, scenario.known, scenario.hidden)
