"""Machines that were changed on purpose, and what a mechanic would say of it.

The changes are made at the simulated machine: masses of its bodies, levels of its friction, the
amplifier between drive and arm. Nothing here knows the readings' formulas.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from hidden.hider import JOINTS, Values
from hidden.hiders import HIDERS
from hidden.machines import Known, known_machine
from hidden.motions import SHAPES, draw_motion
from hidden.physics import Torques, rate
from hidden.recording import PERIOD, Wander, drawn, record
from hidden.scenario import DRAWS, PLANNED, planned_strength
from hidden.truth import BAND

from par4_dynamics.state import GRAVITY
from par4_identification.logs.log import Log
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_kinematics.velocity import jacobian
from par4_sim.machines.machine import Machine
from par4_sim.machines.noise import Noise, NoiseSource

KINDS = ('payload 1', 'payload 2', 'friction of all', 'Coulomb friction of one',
         'viscous friction of one', 'gain of all', 'gain of one', 'inertia of one')
DURATION = 16.0
"""s of a recording."""
MEMORY = 0.05
"""s of a load that follows nothing."""
COMPANY = ('new', 'old', 'known')
"""When a hidden effect is beside the change: it came with it; it was there before and the model
lacks it; it was there before and the model has it."""
COMPANIONS = ('cogging', 'torque_ripple', 'stribeck', 'coulomb_asymmetry', 'torque_offset',
              'arm_mass_offset', 'distributed_rods', 'base_tilt', 'external_force', 'cable_spring',
              'theta_friction', 'platform_drag', 'time_offset', 'encoder_eccentricity')
"""Effects that may be hidden beside: none that is itself one of the changes."""


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
        effect: that is hidden beside the changes, with its values; None for none.
        beside: payload (kg) that turns with the tool after the change, and its distance from the
            tool's axis, m.
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
    effect: tuple[str, Values] | None = None
    beside: tuple[float, float] = (0.0, 0.0)

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
        if after and self.beside[0]:
            torque += torque_beside_axis(robot, motion, *self.beside)
        torque += drawn(NoiseSource(self.noise, PERIOD, seed), len(torque))
        if wander is not None:
            torque += wander.path(len(torque))
        count = 2.0 * np.pi / robot.drives.encoder_counts
        return Log(name=name, joint_names=robot.joint_names, start_stamp=0, period=PERIOD,
                   t=motion.t, q=count * np.round(motion.q / count), tau=torque,
                   segments=(slice(0, len(motion.t)),), reference=None, accounts=None)


def torque_beside_axis(robot: Robot, motion: Motion, mass: float, radius: float) -> np.ndarray:
    """Return what a point mass that turns with the tool adds to the torque, (n, 4) N m.

    By virtual work: the joints move the point p by its Jacobian, so that they carry
    J_p^T m (p'' - g).

    Args:
        robot: that carries it at the tool of half plate 1.
        motion: of the robot.
        mass: kg.
        radius: of the mass from the axis of the tool, m.
    """
    ratio = robot.geometry.rotation_amplification
    turned, period = ratio * motion.x[:, 3], float(motion.t[1] - motion.t[0])
    arm = radius * np.stack((np.cos(turned), np.sin(turned), np.zeros(len(turned))), axis=1)
    carried = rate(rate(motion.x[:, :3] + arm, period), period) + (0.0, 0.0, GRAVITY)
    pose_rates = jacobian(robot.geometry, motion.x)
    turn = ratio * np.stack((-arm[:, 1], arm[:, 0], np.zeros(len(turned))), axis=1)
    point_rates = pose_rates[:, :3] + turn[:, :, None] * pose_rates[:, 3:]
    return mass * np.einsum('nkj,nk->nj', point_rates, carried)


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


def drawn_machine(seed: int, kinds: tuple[str, ...], company: str | None = None,
                  effect: str | None = None, radius: float = 0.0) -> Changed:
    """Return a machine with changes of some kinds.

    Args:
        seed: of all that is drawn.
        kinds: of `KINDS`.
        company: of `COMPANY`: when an effect is hidden beside; None for never.
        effect: which, drawn from `COMPANIONS` if None.
        radius: of payloads at half plate 1 from the axis of the tool, m.
    """
    random = np.random.default_rng((seed, 15))
    known = known_machine(str(random.choice(('reference', 'other', 'other friction'))), random)
    before, rigid_body = known.machine, 'paper'
    if random.uniform() < 0.5:
        bodies = known.robot.bodies
        before, rigid_body = replace(before, bodies=replace(
            before.bodies, rod_mass=bodies.rod_mass, bar_mass=bodies.bar_mass)), 'full'
    changes = tuple(drawn_change(kind, known, random) for kind in kinds)
    noise = Noise(torque_noise=float(np.exp(random.uniform(np.log(0.02), np.log(0.2)))),
                  correlation_time=float(random.choice((0.0, random.uniform(0.005, 0.05)))))
    wander = random.uniform(0.02, 0.1, 4) if random.uniform() < 0.3 else None
    shapes = (str(random.choice(SHAPES)), str(random.choice(SHAPES)))
    after, beside = before, (0.0, 0.0)
    for change in changes:
        if change.kind == 'payload 1' and radius:
            beside = (change.size, radius)
        else:
            after = changed_machine(after, change)
    hidden = None
    if company is not None:
        if rigid_body == 'full':  # the weight of the rods may be what is hidden
            own = tuple(name for name in COMPANIONS if name != 'distributed_rods')
        else:
            own = COMPANIONS
        name = effect or str(random.choice(own))
        motion = draw_motion(shapes[1], known.robot, DURATION, seed)
        hidden = name, _drawn_values(name, known, motion, noise, wander, random)
        after = HIDERS[name].build(after, hidden[1])
        if company != 'new':
            before = HIDERS[name].build(before, hidden[1])
    return Changed(seed, known, rigid_body, before, after, changes, noise, wander, shapes, hidden,
                   beside)


def _drawn_values(name: str, known: Known, motion: Motion, noise: Noise,
                  wander: np.ndarray | None, random: np.random.Generator) -> Values:
    """Return values of an effect, of a usual size that shows on the planned motion."""
    level = noise.torque_noise * (1.0 if noise.correlation_time else np.sqrt(2.0 * BAND * PERIOD))
    floor = np.hypot(level, np.zeros(4) if wander is None else wander)
    hider = HIDERS[name]
    for _ in range(DRAWS):
        joints = np.sort(random.permutation(4)[:random.integers(1, 5)]) if hider.per_joint else (
            np.array(JOINTS))
        values = hider.draw(random, known, joints)
        if planned_strength(name, values, known, motion, floor) > PLANNED:
            break
    return values
