"""Scenarios: what is hidden, in which machine, how it moves and what is recorded, from a seed."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path

import numpy as np

from hidden.hiders import HIDERS, JOINTS, Values, scaled
from hidden.machines import Known, known_machine
from hidden.motions import SHAPES, draw_motion
from hidden.physics import Torques, in_band
from hidden.recording import PERIOD, Recording, Wander, loaded, record, simulation_of
from hidden.truth import BAND, CHAOTIC, EVERY, Truth, base_variants, usable
from par4_identification.log import read_log
from par4_kinematics.motion import Motion
from par4_sim.machine import Machine
from par4_sim.noise import Noise
from par4_sim.offline import simulate_to_bag

KINDS = ('single', 'pair', 'removed', 'clean', 'below', 'rods')
FIT, HELD_OUT = 16.0, 10.0
"""s"""
PLANNED = 150.0
"""Log-likelihood ratio on the planned motion at which a draw is kept: the real one, with coloured
noise, may be smaller."""
DRAWS = 6
"""Of sizes, before one that hardly shows is kept."""
BELOW = 1.0
"""Log-likelihood ratio on the planned motion of an effect below the floor."""


@dataclass(frozen=True)
class Task:
    """One scenario to make.

    Attributes:
        kind: 'single'; 'pair' of effects; 'removed': a single whose name and twins the library
            lacks; 'clean'; 'below' the noise; 'rods': a machine of real rods and bars.
        seed: of all that is drawn.
        effect: the first that is hidden, where there is one.
        coloured: whether the noise is.
        fidelity: of the plant.
        through_bag: whether the diagnosis reads bags.
    """

    kind: str
    seed: int
    effect: str | None
    coloured: bool
    fidelity: str = 'exact'
    through_bag: bool = False


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


def draw_scenario(task: Task) -> Scenario:
    """Return the scenario that a task draws."""
    random = np.random.default_rng((task.seed, KINDS.index(task.kind)))
    known = known_machine(random.choice(('reference', 'other', 'other friction')), random)
    shape = str(random.choice(SHAPES))
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
    noise = Noise(torque_noise=level, correlation_time=memory)
    feedforward = bool(random.uniform() < 0.5)
    floor = np.hypot(level * (1.0 if memory else np.sqrt(2.0 * BAND * PERIOD)),
                     np.zeros(4) if wander is None else wander.level)
    hidden: list[tuple[str, Values]] = []
    if task.kind == 'rods':
        hidden = [('distributed_rods', {'rod_mass': known.robot.bodies.rod_mass})]
        bodies = replace(known.machine.bodies, rod_mass=known.robot.bodies.rod_mass,
                         bar_mass=known.robot.bodies.bar_mass)
        machine = replace(known.machine, bodies=bodies)
    else:
        names = [] if task.effect is None else [task.effect]
        if task.kind == 'pair':
            others = [name for name in HIDERS if name not in (task.effect, *CHAOTIC)]
            names.append(str(random.choice(others)))
        hidden = [(name, _drawn_values(name, known, motions[0], floor, random,
                                       task.kind == 'below')) for name in names]
        machine = reduce(lambda machine, item: HIDERS[item[0]].build(machine, item[1]), hidden,
                         known.machine)
    return Scenario(task, known, machine, tuple(hidden), shape, motions, noise, wander,
                    feedforward)


def _drawn_values(name: str, known: Known, motion: Motion, floor: np.ndarray,
                  random: np.random.Generator, below: bool) -> Values:
    """Return values of a usual size that show on the planned motion, or of one below the floor."""
    hider = HIDERS[name]
    for _ in range(DRAWS):
        joints = np.sort(random.permutation(4)[:4 if random.uniform() < 0.5
                                               else random.integers(1, 3)])
        values = hider.draw(random, known, joints if hider.per_joint else np.array(JOINTS))
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
            wander=wander, name=name)
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
