"""The shortest time in which a path can be followed at all, and the motion that takes it.

Along a path q(s) the torque of the rigid bodies is a(s) sdd + b(s) sd^2 + c(s), so that limits of
torque, speed and acceleration bound sdd and sd^2 linearly: time-optimal path parametrisation,
solved by toppra. Viscous friction is linear in sd and does not fit; it is taken from the speed of
the profile before, in two ways:

- As it is, and with it what the effects of the model add that need no more than the motion (those
  of the drives and transmissions act on a torque that jumps here). At a fixed point the profile
  keeps the limits with that model: a motion.
- As anything between nothing and what it is at most. This relaxes the limits. Of all profiles that
  keep them the time-optimal one is fastest at every s, so its speed bounds that of every profile
  that is possible, and with it the friction of the next turn. The time of each turn is a bound:
  nothing that keeps the limits follows the path faster.

The bound knows bodies and friction, whatever the controller; effects take no part in it, nor does
the jerk. A limit of jerk is kept by a second step, `par4_sim.tracking.jerk_limit`, which is not
optimal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from toppra import SplineInterpolator
from toppra.algorithm import TOPPRA
from toppra.constraint import DiscretizationType, LinearConstraint

from par4_dynamics.base_terms import FRICTION
from par4_dynamics.model import Model
from par4_dynamics.state import state_of_joints
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.motion import Motion, motion_of_joints
from par4_kinematics.robot import Robot
from par4_sim.choices import STEP
from par4_sim.tracking.jerk_limit import jerk_limited
from par4_sim.tracking.way import LONGEST, Profile, Way, joints_over_time

POINTS = 1000
"""Points of the grid along a path."""
KNOTS = 150
"""Knots of the spline through a path."""
TURNS = 40
"""Most times that friction is computed anew for the speeds of the timing before."""
SETTLED = 1e-6
"""Relative change of the time below which friction is not computed anew."""
RESTING_SHARE = 1e-6
"""Joint speed over its largest below which a motion rests."""


@dataclass(frozen=True)
class PathLimits:
    """What a motion along a path has to keep beside the joint speed of the robot.

    Attributes:
        torque: of every joint, N m.
        acceleration, jerk: of every joint, rad/s2, rad/s3.
    """

    torque: float
    acceleration: float = math.inf
    jerk: float = math.inf


@dataclass(frozen=True)
class Fastest:
    """The time that a motion's path takes under the limits.

    Attributes:
        bound: nothing that keeps the limits of torque, speed and acceleration is faster, s.
        profiles: that keep them, one between two rests.
        ways: the same with the jerk limited, where it is.
        effects: of the model, by name; the bound knows none of them.
        unknown: those that the ways do not know either.
    """

    bound: float
    profiles: tuple[Profile, ...]
    ways: tuple[Way, ...]
    effects: tuple[str, ...]
    unknown: tuple[str, ...]

    @property
    def duration(self) -> float:
        """Of all ways together, s."""
        return sum(way.duration for way in self.ways)


class _Limited(LinearConstraint):  # type: ignore[misc]  # toppra tells no types
    """low <= a u + b x + c <= high and x <= fastest, at the points of the grid."""

    def __init__(self, a: np.ndarray, b: np.ndarray, c: np.ndarray, low: np.ndarray,
                 high: np.ndarray, fastest: np.ndarray) -> None:
        super().__init__()
        self.discretization_type = DiscretizationType.Collocation
        self.dof = rows = a.shape[1]
        size = np.broadcast_to(np.vstack((np.eye(rows), -np.eye(rows))), (len(a), 2 * rows, rows))
        bounds = np.stack((np.zeros(len(a)), fastest), axis=1)
        self._params = (a, b, c, size, np.hstack((high, -low)), None, bounds)

    def compute_constraint_params(self, *_args: object, **_kwargs: object
                                  ) -> tuple[np.ndarray | None, ...]:
        """Return what toppra asks for."""
        return self._params


def fastest_along(robot: Robot, model: Model, motion: Motion, limits: PathLimits) -> Fastest:
    """Return the shortest time along the path of a motion, between the rests that it has.

    Args:
        robot: geometry and limit of joint speed.
        model: of the machine.
        motion: whose path, not whose timing, is meant; at rest at both ends.
        limits: to be kept.

    Raises:
        InputError: the motion does not begin and end at rest, or never moves; no speed keeps the
            limits, or only one at which it takes longer than `LONGEST`.
    """
    longest = max(LONGEST, motion.duration)
    known = replace(model, effects=tuple(
        active for active in model.effects if not active.effect.needs_nominal))
    bound, profiles, ways = 0.0, [], []
    for knots in _stretches(motion):
        path = _path(knots)
        bound += _settled(_Terms.along(robot, model.without_effects(), path), limits,
                          longest, relaxed=True).duration
        profile = _settled(_Terms.along(robot, known, path), limits, longest, relaxed=False)
        profiles.append(profile)
        ways.append(profile if math.isinf(limits.jerk) else jerk_limited(
            robot, known, profile, limits.torque, limits.acceleration, limits.jerk))
    return Fastest(bound, tuple(profiles), tuple(ways),
                   tuple(active.effect.name for active in model.effects),
                   tuple(active.effect.name for active in model.effects
                         if active not in known.effects))


def motion_of(fastest: Fastest, robot: Robot, name: str, period: float = 1e-3) -> Motion:
    """Return the time-optimal motion, stretched by a fraction of a period between two rests."""
    parts: list[list[np.ndarray]] = []
    for way in fastest.ways:
        steps = int(np.ceil(way.duration / period - 1e-9))
        pace = way.duration / (steps * period)
        first = 1 if parts else 0  # the rest between two ways belongs to the way before
        parts.append([pace ** order * values[first:] for order, values in enumerate(
            joints_over_time(way, pace * period * np.arange(steps + 1)))])
    q, qd, qdd = (np.concatenate(column) for column in zip(*parts, strict=True))
    qdd[[0, -1]] = 0.0  # as every motion here: at rest before its first sample and after its last
    return motion_of_joints(name, robot.geometry, period * np.arange(len(q)), q, qd, qdd)


def _stretches(motion: Motion) -> list[np.ndarray]:
    """Return the joint positions (m, 4) of each stretch between two rests of a motion."""
    speed = np.abs(motion.qd).max(axis=1)
    if not speed.any():
        raise InputError(f'motion {motion.name}: it rests throughout; give one that goes somewhere')
    still = speed <= RESTING_SHARE * speed.max()
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
    """What a path asks for at its grid (n,): torque a sdd + b sd^2 + c + friction, each (n, 4).

    The accelerations of the joints are slope sdd + bend sd^2. Of a, a_effects is what the effects
    of the model make that acts like inertia.
    """

    robot: Robot
    model: Model
    path: SplineInterpolator
    s: np.ndarray
    slope: np.ndarray
    bend: np.ndarray
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    a_effects: np.ndarray
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
        at_rest, pushed = (state_of_joints(robot.geometry, s, q, still, qdd)
                           for qdd in (still, slope))
        a_effects = still + sum(active.torque(pushed) - active.torque(at_rest)
                                for active in model.effects)
        coulomb, viscous = (model.values[name] for name in FRICTION)
        return cls(robot, model, path, s, slope, bend,
                   torque(still, slope) - weight + a_effects,
                   torque(slope, bend) - weight, weight, a_effects,
                   coulomb * np.sign(slope), viscous * slope,
                   (robot.limits.joint_speed / np.abs(slope).max(axis=1)) ** 2)

    def profile(self, low: np.ndarray, high: np.ndarray, acceleration: float, other: np.ndarray
                ) -> Profile:
        """Return the fastest profile with the torque of the bodies and dry friction within limits.

        Args:
            low, high: limits of these torques (n, 4), N m.
            acceleration: limit of the joints, rad/s2.
            other: torques that the limits were narrowed by, part of the profile's (n, 4), N m.
        """
        a, b, c = self.a, self.b, self.c + self.dry
        if math.isfinite(acceleration):
            most = np.full_like(c, acceleration)
            a, b, c = (np.hstack(parts) for parts in (
                (a, self.slope), (b, self.bend), (c, np.zeros_like(c))))
            low, high = np.hstack((low, -most)), np.hstack((high, most))
        solver = TOPPRA([_Limited(a, b, c, low, high, self.fastest)], self.path,
                        gridpoints=self.s, solver_wrapper='seidel')
        sdd, sd, _ = solver.compute_parameterization(0.0, 0.0)
        if sd is None:
            raise InputError('the torque limit does not hold the machine on this path: '
                             + self._worst(low, high))
        torque = (self.a[:-1] * sdd[:, None] + self.b[:-1] * sd[:-1, None] ** 2 + self.c[:-1]
                  + self.dry[:-1] + other[:-1])
        return Profile(self.path, self.s, sd, torque)

    def others(self, profile: Profile) -> np.ndarray:
        """Return what viscous friction and effects but inertia add along a profile (n, 4), N m.

        Effects may look at the whole motion, so they see one in even steps of time.
        """
        viscous = self.viscous * profile.sd[:, None]
        if not self.model.effects:
            return viscous
        t = STEP * np.arange(max(3, math.ceil(profile.duration / STEP) + 1))
        state = state_of_joints(self.robot.geometry, t, *joints_over_time(profile, t))
        added = self.model.torque(state) - self.model.without_effects().torque(state)
        along, _, sdd = profile.over_time(t)
        added -= sdd[:, None] * np.stack([np.interp(along, self.s, column)
                                          for column in self.a_effects.T], axis=1)
        # the first and the last sample rest, where friction does not know its side yet
        rising = np.concatenate(([False], np.diff(along[:-1]) > 0.0, [False]))
        return viscous + np.stack([np.interp(self.s, along[rising], column[rising])
                                   for column in added.T], axis=1)

    def _worst(self, low: np.ndarray, high: np.ndarray) -> str:
        """Return where standing or creeping along the path breaks the limit most."""
        asked = self.c + self.dry
        low, high = low[:, :LEGS], high[:, :LEGS]
        over = np.maximum(asked - high, low - asked)
        row, joint = np.unravel_index(np.argmax(over), over.shape)
        return (f'joint {joint} needs {asked[row, joint]:.4g} N m at {100.0 * self.s[row]:.0f} % '
                f'of the way, at most {high[row, joint]:.4g} N m are given; raise the limit')


def _settled(terms: _Terms, limits: PathLimits, longest: float, relaxed: bool) -> Profile:
    """Return the profile with friction and effects as they are, or friction as at most (relaxed).

    Raises:
        InputError: no speed keeps the limits, or it takes more than `longest` seconds.
    """
    limit = np.full_like(terms.a, limits.torque)
    # no profile is faster than that of bodies which nothing but the speed limit slows down
    fastest = terms.viscous * np.sqrt(terms.fastest)[:, None]
    other, duration = (fastest if relaxed else np.zeros_like(limit)), 0.0
    for _ in range(TURNS):
        if relaxed:
            low, high = -limit - np.maximum(other, 0.0), limit - np.minimum(other, 0.0)
        else:
            low, high = -limit - other, limit - other
        found = terms.profile(low, high, limits.acceleration, other)
        if not found.duration <= longest:  # nan, too
            why = ('with the limits of the robot; raise them' if math.isinf(limits.acceleration)
                   else f'with joint accelerations of at most {limits.acceleration:g} rad/s2; '
                        f'raise that limit')
            raise InputError(f'between two rests the path takes more than the {longest:g} s that '
                             f'are looked at, {why}')
        if relaxed:
            other = terms.viscous * found.sd[:, None]
        else:
            now = terms.others(found)
            other = 0.5 * (other + now) if duration else now
        if abs(found.duration - duration) < SETTLED * found.duration:
            break
        duration = found.duration
    return found
