"""Machines that were changed on purpose, and what a mechanic would say of it.

The changes are made at the simulated machine: masses of its bodies, levels of its friction, the
amplifier between drive and arm. Nothing here knows the readings' formulas.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from hidden.machines import Known, known_machine
from hidden.motions import SHAPES, draw_motion
from hidden.physics import Torques
from hidden.recording import PERIOD, Wander, drawn, record

from par4_identification.logs.log import Log
from par4_sim.machine import Machine
from par4_sim.noise import Noise, NoiseSource

KINDS = ('payload 1', 'payload 2', 'friction of all', 'Coulomb friction of one',
         'viscous friction of one', 'gain of all', 'gain of one', 'inertia of one')
DURATION = 16.0
"""s of a recording."""
MEMORY = 0.05
"""s of a load that follows nothing."""


@dataclass(frozen=True)
class Change:
    """What was done to a machine.

    Attributes:
        kind: of KINDS.
        joint: the one it concerns, None for all.
        size: kg, share of the friction or of the torque, N m, N m s/rad, kg m2.
    """

    kind: str
    joint: int | None
    size: float


@dataclass(frozen=True)
class Changed:
    """A machine before and after, and how it is recorded.

    Attributes:
        seed: of all that was drawn.
        known: what is known of it.
        rigid_body: by which its model is identified.
        before, after: the machines.
        changes: between them.
        noise: of the recorder.
        wander: levels of a load that follows nothing, (4,) N m, None without one.
        shapes: of the motions before and after.
    """

    seed: int
    known: Known
    rigid_body: str
    before: Machine
    after: Machine
    changes: tuple[Change, ...]
    noise: Noise
    wander: np.ndarray | None
    shapes: tuple[str, str]

    def log(self, after: bool, number: int = 0, closed_loop: bool = False) -> Log:
        """Return recording number `number` before or after the change.

        Args:
            after: the change, or before it.
            number: of the recording; each has a motion of its own.
            closed_loop: simulate drives that follow the motion; else the machine is led along it
                exactly and its torque follows from the equations of motion, which is quick.
        """
        seed = 10 * self.seed + 2 * number + after
        machine, robot = self.after if after else self.before, self.known.robot
        motion = draw_motion(self.shapes[after], robot, DURATION, seed)
        wander = None if self.wander is None else Wander(self.wander, MEMORY, seed)
        name = f'{"after" if after else "before"} {number}'
        if closed_loop:
            return record(self.known, machine, motion, fidelity='exact', noise=self.noise,
                          seed=seed, feedforward=None, wander=wander, name=name).log
        torque = Torques(motion.t, motion.q).recorded(machine)
        torque += drawn(NoiseSource(self.noise, PERIOD, seed), len(torque))
        if wander is not None:
            torque += wander.path(len(torque))
        count = 2.0 * np.pi / robot.drives.encoder_counts
        return Log(name=name, joint_names=robot.joint_names, start_stamp=0, period=PERIOD,
                   t=motion.t, q=count * np.round(motion.q / count), tau=torque,
                   segments=(slice(0, len(motion.t)),), reference=None, accounts=None)


def drawn_change(kind: str, known: Known, random: np.random.Generator) -> Change:
    """Return a change of a kind, of a size that a shop would care about."""
    joint, sign = int(random.integers(4)), float(random.choice((-1.0, 1.0)))
    coulomb, viscous, inertia = (float(np.mean(known.model.values[name])) for name in (
        'coulomb_friction', 'viscous_friction', 'actuator_inertia'))
    share = float(random.uniform(0.1, 0.4))
    size = {
        'payload 1': float(np.exp(random.uniform(np.log(0.1), np.log(2.0)))),
        'payload 2': float(np.exp(random.uniform(np.log(0.1), np.log(2.0)))),
        'friction of all': sign * share,
        'Coulomb friction of one': sign * share * coulomb,
        'viscous friction of one': sign * share * viscous,
        'gain of all': sign * float(random.uniform(0.02, 0.1)),
        'gain of one': sign * float(random.uniform(0.02, 0.1)),
        'inertia of one': sign * float(random.uniform(0.03, 0.15)) * inertia}[kind]
    return Change(kind, joint if kind.endswith('one') else None, size)


def changed_machine(machine: Machine, change: Change) -> Machine:
    """Return the machine after a change."""
    bodies, friction, amplifier = machine.bodies, machine.friction, machine.amplifier
    which = np.array([float(change.joint in (None, joint)) for joint in range(4)])
    if change.kind in ('payload 1', 'payload 2'):
        name = f'platform_mass_{change.kind[-1]}'
        return replace(machine, bodies=replace(
            bodies, **{name: getattr(bodies, name) + change.size}))
    if change.kind == 'inertia of one':
        return replace(machine, bodies=replace(
            bodies, actuator_inertia=bodies.actuator_inertia + change.size * which))
    if change.kind in ('gain of all', 'gain of one'):
        return replace(machine, amplifier=replace(
            amplifier, gain_error=amplifier.gain_error + change.size * which))
    if change.kind == 'friction of all':
        return replace(machine, friction=replace(
            friction, coulomb=friction.coulomb * (1.0 + change.size),
            viscous=friction.viscous * (1.0 + change.size)))
    name = 'coulomb' if change.kind.startswith('Coulomb') else 'viscous'
    return replace(machine, friction=replace(
        friction, **{name: getattr(friction, name) + change.size * which}))


def drawn_machine(seed: int, kinds: tuple[str, ...]) -> Changed:
    """Return a machine with changes of some kinds."""
    random = np.random.default_rng((seed, 15))
    known = known_machine(str(random.choice(('reference', 'other', 'other friction'))), random)
    before, rigid_body = known.machine, 'paper'
    if random.uniform() < 0.5:
        bodies = known.robot.bodies
        before, rigid_body = replace(before, bodies=replace(
            before.bodies, rod_mass=bodies.rod_mass, bar_mass=bodies.bar_mass)), 'full'
    changes = tuple(drawn_change(kind, known, random) for kind in kinds)
    after = before
    for change in changes:
        after = changed_machine(after, change)
    noise = Noise(torque_noise=float(np.exp(random.uniform(np.log(0.02), np.log(0.2)))),
                  correlation_time=float(random.choice((0.0, random.uniform(0.005, 0.05)))))
    wander = random.uniform(0.02, 0.1, 4) if random.uniform() < 0.3 else None
    return Changed(seed, known, rigid_body, before, after, changes, noise, wander,
                   (str(random.choice(SHAPES)), str(random.choice(SHAPES))))
