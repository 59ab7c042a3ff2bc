"""The shortest time in which a path can be followed at all, and the motion that takes it.

Along a path q(s) the torque of the rigid bodies is a(s) sdd + b(s) sd^2 + c(s), so that limits of
torque and speed bound sdd and sd^2 linearly: time-optimal path parametrisation, solved by toppra.
Viscous friction is linear in sd and does not fit; it is taken from the speed of the profile before,
in two ways:

- As it is. At a fixed point the profile keeps the limits with all friction: a motion.
- As anything between nothing and what it is at most. This relaxes the limits. Of all profiles that
  keep them the time-optimal one is fastest at every s, so its speed bounds that of every profile
  that is possible, and with it the friction of the next turn. The time of each turn is a bound:
  nothing that keeps the torque limit follows the path faster.

Effects of a model take no part, nor do jerk and tracking: the bound holds whatever the controller.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from toppra import SplineInterpolator
from toppra.algorithm import TOPPRA
from toppra.constraint import DiscretizationType, LinearConstraint

from par4_dynamics.model import FRICTION, Model
from par4_dynamics.state import state_of_joints
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.motion import Motion, motion_of_joints
from par4_kinematics.robot import Robot

POINTS = 1000
"""Of the grid along a path."""
KNOTS = 150
"""Of the spline through a path."""
TURNS = 40
"""Times that friction is taken anew at most."""
SETTLED = 1e-6
"""Relative change of the time at which the turns end."""
AT_REST = 1e-6
"""Joint speed over its largest below which a motion rests."""


@dataclass(frozen=True)
class Profile:
    """Speed along a path between two rests.

    Attributes:
        path: of the joints over s, rad.
        s: grid, (n,).
        sd: speed, 1/s, (n,).
        torque: of the joints where each interval begins, friction included, (n - 1, 4) N m.
        duration: s.
    """

    path: SplineInterpolator
    s: np.ndarray
    sd: np.ndarray
    torque: np.ndarray
    duration: float


@dataclass(frozen=True)
class Fastest:
    """The time that a motion's path takes under the limits.

    Attributes:
        bound: nothing that keeps the limits is faster, s.
        profiles: that keep the limits, one between two rests.
    """

    bound: float
    profiles: tuple[Profile, ...]

    @property
    def duration(self) -> float:
        """Of the profiles together, s: the bound and this enclose the shortest time."""
        return sum(profile.duration for profile in self.profiles)


class _Limited(LinearConstraint):
    """low <= a u + b x + c <= high and x <= fastest, at the points of the grid."""

    def __init__(self, a: np.ndarray, b: np.ndarray, c: np.ndarray, low: np.ndarray,
                 high: np.ndarray, fastest: np.ndarray) -> None:
        super().__init__()
        self.discretization_type = DiscretizationType.Collocation
        self.dof = a.shape[1]
        size = np.broadcast_to(np.vstack((np.eye(LEGS), -np.eye(LEGS))), (len(a), 2 * LEGS, LEGS))
        bounds = np.stack((np.zeros(len(a)), fastest), axis=1)
        self._params = (a, b, c, size, np.hstack((high, -low)), None, bounds)

    def compute_constraint_params(self, path, gridpoints, *_args, **_kwargs):  # noqa: ARG002
        """Return what toppra asks for."""
        return self._params


def fastest_along(robot: Robot, model: Model, motion: Motion, torque_limit: float) -> Fastest:
    """Return the shortest time along the path of a motion, between the rests that it has.

    Args:
        robot: geometry and limit of joint speed.
        model: of the machine; its rigid bodies and friction.
        motion: whose path, not whose timing, is meant; at rest at both ends.
        torque_limit: of every joint, N m.

    Raises:
        InputError: the motion does not begin and end at rest, or no speed keeps the limits.
    """
    bound, profiles = 0.0, []
    for knots in _stretches(motion):
        path = _path(knots)
        terms = _Terms.along(robot, model, path)
        bound += _settled(terms, torque_limit, relaxed=True).duration
        profiles.append(_settled(terms, torque_limit, relaxed=False))
    return Fastest(bound, tuple(profiles))


def motion_of(fastest: Fastest, robot: Robot, name: str, period: float = 1e-3) -> Motion:
    """Return the time-optimal motion, stretched by a fraction of a period between two rests."""
    parts = []
    for profile in fastest.profiles:
        steps = int(np.ceil(profile.duration / period))
        pace = profile.duration / (steps * period)
        s, sd, sdd = _over_time(profile, pace * period * np.arange(steps + 1))
        sd, sdd = pace * sd, pace ** 2 * sdd
        q, slope, bend = (profile.path(s, order) for order in range(3))
        part = (q, slope * sd[:, None], bend * sd[:, None] ** 2 + slope * sdd[:, None])
        parts.append([values[1:] if parts else values for values in part])
    q, qd, qdd = (np.concatenate(column) for column in zip(*parts, strict=True))
    qdd[[0, -1]] = 0.0  # as every motion here: at rest before its first sample and after its last
    return motion_of_joints(name, robot.geometry, period * np.arange(len(q)), q, qd, qdd)


def _stretches(motion: Motion) -> list[np.ndarray]:
    """Return the joint positions (m, 4) of each stretch between two rests of a motion."""
    speed = np.abs(motion.qd).max(axis=1)
    still = speed <= AT_REST * speed.max()
    if not (still[0] and still[-1]):
        raise InputError(f'motion {motion.name}: it must begin and end at rest, found joint speeds '
                         f'of {speed[0]:.3g} and {speed[-1]:.3g} rad/s; add a start and a stop')
    moving = np.flatnonzero(~still)
    ends = np.flatnonzero(np.diff(moving) > 1)
    first = np.concatenate((moving[:1], moving[ends + 1])) - 1
    last = np.concatenate((moving[ends], moving[-1:])) + 1
    return [motion.q[begin:end + 1] for begin, end in zip(first, last, strict=True)]


def _path(q: np.ndarray) -> SplineInterpolator:
    """Return joint positions (m, 4) as a spline over their way, from 0 to 1."""
    way = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))))
    way /= way[-1]
    kept = [0]
    for row in range(1, len(way) - 1):
        if way[row] - way[kept[-1]] > 0.3 / KNOTS and 1.0 - way[row] > 0.3 / KNOTS:
            kept.append(row)
    kept.append(len(way) - 1)
    even = np.linspace(0.0, 1.0, KNOTS + 1)
    return SplineInterpolator(even, CubicSpline(way[kept], q[kept])(even))


@dataclass(frozen=True)
class _Terms:
    """What a path asks for at its grid (n,): torque a sdd + b sd^2 + c + friction, each (n, 4)."""

    path: SplineInterpolator
    s: np.ndarray
    slope: np.ndarray
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    dry: np.ndarray
    viscous: np.ndarray
    fastest: np.ndarray

    @classmethod
    def along(cls, robot: Robot, model: Model, path: SplineInterpolator) -> _Terms:
        """Return the terms of a path."""
        s = np.linspace(0.0, 1.0, POINTS + 1)
        q, slope, bend = (path(s, order) for order in range(3))
        still = np.zeros_like(q)

        def torque(qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
            return model.rigid_torque(state_of_joints(robot.geometry, s, q, qd, qdd))

        weight = torque(still, still)
        coulomb, viscous = (model.values[name] for name in FRICTION)
        return cls(path, s, slope, torque(still, slope) - weight, torque(slope, bend) - weight,
                   weight, coulomb * np.sign(slope), viscous * slope,
                   (robot.limits.joint_speed / np.abs(slope).max(axis=1)) ** 2)

    def profile(self, low: np.ndarray, high: np.ndarray) -> Profile:
        """Return the fastest profile with the torque of the bodies and dry friction within limits.
        """
        limited = _Limited(self.a, self.b, self.c + self.dry, low, high, self.fastest)
        solver = TOPPRA([limited], self.path, gridpoints=self.s, solver_wrapper='seidel')
        sdd, sd, _ = solver.compute_parameterization(0.0, 0.0)
        if sd is None:
            raise InputError('the torque limit does not hold the machine on this path: '
                             + self._worst(low, high))
        speed = sd[:-1, None]
        torque = (self.a[:-1] * sdd[:, None] + self.b[:-1] * speed ** 2 + self.c[:-1]
                  + self.dry[:-1] + self.viscous[:-1] * speed)
        return Profile(self.path, self.s, sd, torque,
                       float(np.sum(2.0 * np.diff(self.s) / (sd[1:] + sd[:-1]))))

    def _worst(self, low: np.ndarray, high: np.ndarray) -> str:
        """Return where standing or creeping along the path breaks the limit most."""
        asked = self.c + self.dry
        over = np.maximum(asked - high, low - asked)
        row, joint = np.unravel_index(np.argmax(over), over.shape)
        return (f'joint {joint} needs {asked[row, joint]:.4g} N m at {100.0 * self.s[row]:.0f} % '
                f'of the way, at most {high[row, joint]:.4g} N m are given; raise the limit')


def _settled(terms: _Terms, torque_limit: float, relaxed: bool) -> Profile:
    """Return the profile with viscous friction as it is, or as at most it is (relaxed)."""
    limit = np.full_like(terms.a, torque_limit)
    # no profile is faster than that of bodies which nothing but the speed limit slows down
    sd = np.sqrt(terms.fastest) if relaxed else np.zeros(len(terms.s))
    duration = 0.0
    for _ in range(TURNS):
        friction = terms.viscous * sd[:, None]
        if relaxed:
            low, high = -limit - np.maximum(friction, 0.0), limit - np.minimum(friction, 0.0)
        else:
            low, high = -limit - friction, limit - friction
        found = terms.profile(low, high)
        sd = found.sd if relaxed else 0.5 * (sd + found.sd) if duration else found.sd
        if abs(found.duration - duration) < SETTLED * found.duration:
            break
        duration = found.duration
    return found


def _over_time(profile: Profile, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return s, sd, sdd at times t of a profile whose acceleration is constant between points."""
    steps = 2.0 * np.diff(profile.s) / (profile.sd[1:] + profile.sd[:-1])
    at = np.concatenate(([0.0], np.cumsum(steps)))
    row = np.clip(np.searchsorted(at, t, side='right') - 1, 0, len(steps) - 1)
    sdd = np.diff(profile.sd ** 2) / (2.0 * np.diff(profile.s))
    after = np.minimum(t, at[-1]) - at[row]
    return (np.clip(profile.s[row] + profile.sd[row] * after + 0.5 * sdd[row] * after ** 2, 0.0,
                    1.0), np.maximum(profile.sd[row] + sdd[row] * after, 0.0), sdd[row])

