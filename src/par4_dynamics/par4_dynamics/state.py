"""What every term and effect is computed from: the motion of a machine over a log."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from par4_dynamics.direction import mean_signs
from par4_dynamics.load_friction import LoadFriction
from par4_kinematics.acceleration import (
    JointMotion,
    joint_motion,
    platform_motion,
    platform_motion_at,
)
from par4_kinematics.arrays import as_matching_rows
from par4_kinematics.geometry import Geometry
from par4_kinematics.position import inverse_kinematics, turns_of
from par4_kinematics.robot import Hanging
from par4_kinematics.velocity import carried_by, jacobian, moved_by

GRAVITY = 9.81
"""m/s2, along -z of `base`."""
OF_MOTION = ('direction', 'phasor', 'turns', 'jacobian')
"""What is computed of a motion when it is first asked for, whatever its nominal torque."""
SMALL_ANGLE, SMALL_RATE = 1e-5, 1e-3
"""rad, rad/s: steps of central differences; small against any motion, large against the rounding of
(20)."""


@dataclass(frozen=True)
class Nominal:
    """The nominal torque of a motion, which effects need that scale or shift torque.

    Attributes:
        torque: of the model without effects, (n, J) N m.
        load: the torque that the joints carry behind their friction, (n, J) N m: of all bodies and
            of forces on the platform, those among the effects (`Effect.is_body`, `is_force`).
        values: base parameter name -> (J,).
        whole: the same with what effects add to them (`Effect.base_part`).
        body_torque: function of another motion; returns the torque of its bodies, (n, J) N m, which
            is `load` without the forces.
        pull: function of another motion; returns the torque of forces on the platform that change
            little with a motion that changes little, (n, J) N m: not that of friction, whose sign
            turns and which takes long to compute (`Effect.rubs`). None if there are none.
        angle_torque: function of another motion; returns the torque of the effects that are bound
            to where each joint is (`Effect.of_angle`), (n, J) N m.
        added: torque of the effects whose torque does not depend on the nominal one, (n, J) N m.
        unscaled: function of this motion; returns the torque of the effects that a wrong scale of a
            drive scales with `torque`, (n, J) N m. While causes are sought, they are those known
            before: a gain that scaled a found one, too, could stand in its place. `scale` does
            that in the columns of the others.
        scale: recorded over delivered torque, (n, J), as far as known.
        effects: the same of all effects of the machine itself, found ones, too.
        scaling: the same of those that scale it (`Effect.scales`).
        slips: function of another motion; returns the friction of joints that turn with the load,
            None if it has none (`Effect.slips`).
        friction: function of this motion; returns the friction of the effects (n, J), N m, by the
            base parameter that they are part of (`Effect.friction_term`).
        passed: function of this motion; returns what goes on behind the friction of the actuated
            joints, (n, J) N m: `load`, or what springs pass on of it while it swings.
        halfway: the motion halfway between the one read and the true one, of a machine whose
            readings or dimensions are known to be wrong, see `Effect.halfway`; else None.
        true: the same all the way: the true motion, with its load.
    """

    torque: np.ndarray
    load: np.ndarray
    values: Mapping[str, np.ndarray]
    body_torque: Callable[[State], np.ndarray]
    angle_torque: Callable[[State], np.ndarray]
    whole: Mapping[str, np.ndarray]
    pull: Callable[[State], np.ndarray] | None = None
    added: np.ndarray | float = 0.0
    unscaled: Callable[[State], np.ndarray | float] = lambda _: 0.0
    scale: np.ndarray | float = 1.0
    effects: Callable[[State], np.ndarray | float] = lambda _: 0.0
    scaling: Callable[[State], np.ndarray | float] = lambda _: 0.0
    slips: Callable[[State], LoadFriction | None] = lambda _: None
    passed: Callable[[State], np.ndarray] = lambda state: state.known.load
    friction: Callable[[State], Mapping[str, np.ndarray]] = lambda _: {}
    halfway: State | None = None
    true: State | None = None

    @property
    def independent(self) -> np.ndarray:
        """The torque of all that does not follow from other torques, (n, J) N m."""
        return self.torque + self.added

    def moved_load(self, state: State) -> np.ndarray:
        """Return the torque of bodies and of `pull` along another motion, (n, J) N m."""
        torque = self.body_torque(state)
        return torque if self.pull is None else torque + self.pull(state)


class Platform(NamedTuple):
    """Motion of the platform of a machine that has one.

    Attributes:
        geometry: dimensions of the machine.
        x, xd, xdd: pose of D and theta, (n, 4).
    """

    geometry: Geometry
    x: np.ndarray
    xd: np.ndarray
    xdd: np.ndarray


@dataclass(frozen=True)
class State:
    """Motion of n samples of a machine with J joints; SI, radians.

    Attributes:
        t: time since the start of the log, (n,) s.
        q, qd, qdd: joints, (n, J).
        geometry: dimensions, or None for a single axis; then x, xd, xdd are None too.
        x, xd, xdd: pose of D (in `base`) and theta, and their derivatives, (n, 4).
        nominal: nominal torque of this motion; None if only the motion is known.
        hanging: how gravity loads a single axis; None if it does not, and with a geometry.
        slides: whether it is a single axis that slides. Its positions are metres, of which none is
            a turn.
        period: time between samples whose positions tell speeds and accelerations, s; zero where
            these are those of the instants.
        bend: speed, rad/s, that the low-pass of the positions leaves where a joint turns back. Its
            friction bends the speed there, and the low-pass rounds the bend. (J,), or of all.
        told_hz: frequency, Hz, up to which a model may let the positions swing a load. Beyond it
            motors follow the noise of their encoders. Infinite if the data show no such noise.
        measured: torque of the motors, (n, J) N m, of a recording that begins in motion; else None.
            It tells how loads swing at the first sample, which depends on what was before.
    """

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    geometry: Geometry | None = None
    x: np.ndarray | None = None
    xd: np.ndarray | None = None
    xdd: np.ndarray | None = None
    nominal: Nominal | None = None
    hanging: Hanging | None = None
    slides: bool = False
    period: float = 0.0
    bend: np.ndarray | float = 0.0
    told_hz: float = np.inf
    measured: np.ndarray | None = None

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return self.q.shape[1]

    @property
    def platform(self) -> Platform:
        """The motion of the platform.

        Raises:
            TypeError: a single axis has none.
        """
        if self.geometry is None or self.x is None or self.xd is None or self.xdd is None:
            raise TypeError('a single axis has no platform')
        return Platform(self.geometry, self.x, self.xd, self.xdd)

    @property
    def known(self) -> Nominal:
        """The nominal torque.

        Raises:
            TypeError: only the motion is known.
        """
        if self.nominal is None:
            raise TypeError('the nominal torque of this motion is not known')
        return self.nominal

    @cached_property
    def friction(self) -> Mapping[str, np.ndarray]:
        """The friction of the effects (n, J), N m, see `Nominal.friction`."""
        return self.known.friction(self)

    @cached_property
    def delivered(self) -> np.ndarray:
        """The torque that the drives deliver, (n, J) N m."""
        return self.known.torque + self.known.effects(self)

    @cached_property
    def scaled(self) -> np.ndarray:
        """That of it which a wrong scale of a drive scales, (n, J) N m; see `Nominal.unscaled`."""
        return self.known.torque + self.known.unscaled(self)

    @cached_property
    def told(self) -> np.ndarray:
        """What the drives tell of it, in whatever scale, (n, J) N m; a record may have it late."""
        return self.delivered + self.known.scaling(self)

    @property
    def halfway(self) -> State:
        """The motion halfway to the true one; this one where no reading is known to be wrong.

        The slope of a torque there, times the way, is the change of the torque to second order.
        """
        return self.known.halfway or self

    @property
    def true(self) -> State:
        """The true motion; this one where no reading is known to be wrong."""
        return self.known.true or self

    @property
    def bends(self) -> tuple[float, ...]:
        """`bend` of each joint, (J,) rad/s."""
        return tuple(np.broadcast_to(self.bend, self.joints).astype(float).tolist())

    @cached_property
    def direction(self) -> np.ndarray:
        """sign(qd), (n, J); where a joint turns back between two samples, its mean there."""
        return mean_signs(np.ascontiguousarray(self.qd), np.ascontiguousarray(self.qdd),
                          self.period, np.array(self.bends))

    @cached_property
    def phasor(self) -> np.ndarray:
        """exp(i q), (n, J), contiguous: kept, as its powers cost less than sine and cosine."""
        return np.exp(1j * self.q, order='C')

    @cached_property
    def turns(self) -> np.ndarray:
        """cos theta and sin theta of the platform, (n, 2)."""
        return turns_of(self.platform.x)

    @cached_property
    def jacobian(self) -> np.ndarray:
        """J_1 of (2), (n, 4, 4)."""
        return jacobian(self.platform.geometry, self.platform.x)

    @cached_property
    def torque_by_q(self) -> np.ndarray:
        """Stiffness: d/dq_j of the bodies' torque of joint i, (n, J, J) N m/rad, [:, i, j]."""
        return self._central_difference('q', SMALL_ANGLE, self.known.body_torque)

    @cached_property
    def torque_by_qd(self) -> np.ndarray:
        """The same by qd_j, N m s/rad: the torque being a square of speeds, this is exact."""
        return self._central_difference('qd', 1.0, self.known.body_torque)

    @cached_property
    def torque_by_qdd(self) -> np.ndarray:
        """The same by qdd_j, kg m2: the inertia matrix, exact as the torque is linear in it."""
        torque = self.known.body_torque
        here = torque(self._moved_by('qdd', 0.0))
        return np.stack([torque(self._moved_by('qdd', joint)) - here
                         for joint in np.eye(self.joints)], axis=-1)

    @cached_property
    def load_by_q(self) -> np.ndarray:
        """`torque_by_q` with the forces that pull at the platform, see `Nominal.pull`."""
        return self.torque_by_q + self._pull_by('q', SMALL_ANGLE)

    @cached_property
    def load_by_qd(self) -> np.ndarray:
        """`torque_by_qd` with the same forces."""
        return self.torque_by_qd + self._pull_by('qd', SMALL_RATE)

    @cached_property
    def angle_torque_by_q(self) -> np.ndarray:
        """The same of the effects that are bound to where each joint is, (n, J, J) N m/rad."""
        ahead, behind = (self.known.angle_torque(replace(self, q=self.q + step))
                         for step in (SMALL_ANGLE, -SMALL_ANGLE))
        return ((ahead - behind) / (2.0 * SMALL_ANGLE))[..., None] * np.eye(self.joints)

    def _pull_by(self, name: str, step: float) -> np.ndarray | float:
        """Return the slopes of the forces' torque, as those of the bodies'."""
        pull = self.known.pull
        return 0.0 if pull is None else self._central_difference(name, step, pull)

    def _central_difference(self, name: str, step: float, torque: Callable[[State], np.ndarray]
                            ) -> np.ndarray:
        return np.stack([(torque(self._moved_by(name, step * joint))
                          - torque(self._moved_by(name, -step * joint))) / (2.0 * step)
                         for joint in np.eye(self.joints)], axis=-1)

    def _moved_by(self, name: str, change: ArrayLike) -> State:
        """Return the motion with q, qd or qdd changed by (J,)."""
        motion = {part: getattr(self, part) for part in ('q', 'qd', 'qdd')}
        motion[name] = motion[name] + change
        return (state_of_joints(None, self.t, **motion) if self.geometry is None
                else self.nearby(self.geometry, **motion))

    def nearby(self, geometry: Geometry, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> State:
        """Return a motion whose joint positions or dimensions differ little from those of this one.

        The pose follows from this one by one step of Newton's method, a small part of the work of
        forward kinematics. It is off by the square of the change, which a difference of torques to
        both sides does not see.
        """
        platform = self.platform
        x, turns = platform.x, self.turns
        if q is not self.q or geometry is not platform.geometry:
            shift = q - (self.q if geometry is platform.geometry
                         else inverse_kinematics(geometry, x, turns))
            x = x + moved_by(self.jacobian, shift)
            turns = turns_of(x)
        moved = platform_motion_at(geometry, x, qd, qdd, turns)
        nearby = State(self.t, q, qd, qdd, geometry, x, moved.xd, moved.xdd, period=self.period,
                       bend=self.bend)
        vars(nearby)['turns'] = turns
        return nearby

    def with_nominal(self, nominal: Nominal) -> State:
        """Return the same motion with a nominal torque; what is known of the motion stays known."""
        state = replace(self, nominal=nominal)
        vars(state).update((name, vars(self)[name]) for name in OF_MOTION if name in vars(self))
        return state

    def moved(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray,
              geometry: Geometry | None = None) -> State:
        """Return another motion (n, J) of this log, by its own or by other dimensions.

        Raises:
            UnreachableError: joint positions with which the mechanism does not close.
        """
        moved = state_of_joints(geometry or self.geometry, self.t, q, qd, qdd, self.period)
        return replace(moved, bend=self.bend, hanging=self.hanging, slides=self.slides,
                       told_hz=self.told_hz, measured=self.measured)

    def part(self, rows: slice) -> State:
        """Return the motion of some of the samples, without its nominal torque."""
        def cut(values: np.ndarray | None) -> np.ndarray | None:
            return None if values is None else values[rows]

        return replace(self, nominal=None, t=self.t[rows], q=self.q[rows], qd=self.qd[rows],
                       qdd=self.qdd[rows], x=cut(self.x), xd=cut(self.xd), xdd=cut(self.xdd),
                       measured=cut(self.measured))

    def torque_of_force(self, force: ArrayLike) -> np.ndarray:
        """Return the joint torques J_1^T f (n, 4), N m, that carry a generalised force f.

        Args:
            force: (n, 4) or (4,): force at D in `base`, N, and moment about theta, N m.
        """
        force = np.broadcast_to(np.asarray(force, dtype=float), self.platform.x.shape)
        return carried_by(self.jacobian, force)


def state_of_joints(geometry: Geometry | None, t: ArrayLike, q: ArrayLike, qd: ArrayLike,
                    qdd: ArrayLike, period: float = 0.0) -> State:
    """Return the state of a joint motion (n, J) at times t (n,), s.

    Args:
        geometry: dimensions, or None for a single axis.
        t, q, qd, qdd: the motion.
        period: see `State`.

    With a geometry the platform motion is computed, by forward kinematics.

    Raises:
        UnreachableError: joint positions with which the mechanism does not close.
    """
    t = np.asarray(t, dtype=float)
    if geometry is None:
        return State(t, np.asarray(q, dtype=float), np.asarray(qd, dtype=float),
                     np.asarray(qdd, dtype=float), period=period)
    (q, qd, qdd), _ = as_matching_rows({'q': q, 'qd': qd, 'qdd': qdd})
    platform = platform_motion(geometry, q, qd, qdd)
    return State(t, q, qd, qdd, geometry, platform.x, platform.xd, platform.xdd, period=period)


def state_of_platform(geometry: Geometry, t: ArrayLike, x: ArrayLike, xd: ArrayLike,
                      xdd: ArrayLike) -> State:
    """Return the state of a platform motion x, xd, xdd (n, 4) of D and theta at times t (n,), s.

    Raises:
        UnreachableError: a pose that a leg cannot reach.
    """
    (x, xd, xdd), _ = as_matching_rows({'x': x, 'xd': xd, 'xdd': xdd})
    joints: JointMotion = joint_motion(geometry, x, xd, xdd)
    return State(np.asarray(t, dtype=float), joints.q, joints.qd, joints.qdd, geometry, x, xd, xdd)
