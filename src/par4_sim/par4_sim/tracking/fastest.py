"""How fast a path can be followed: by pace, until a limit is broken.

A motion keeps its path and the shape of its timing, its own or the time-optimal one; at pace p it
takes 1/p of the time with p times the speed and p^2 times the acceleration. The fastest pace at
which a peak error of D and the limit of joint speed are kept, with drives that clip what exceeds
the torque limit, is found by bisection, below the pace at which the motion would take the time
that nothing can be faster than.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.model import Model
from par4_kinematics.errors import Par4Error
from par4_kinematics.motion import Motion, check_limits
from par4_sim.choices import OWN, PEAK, TIMINGS
from par4_sim.tracking.case import Case, Plan
from par4_sim.tracking.metrics import (
    errors_of,
    first_limited_torque,
    longest_axis,
    point_in_words,
)

RESOLUTION = 2e-3
"""Relative resolution of the pace."""
LEAST_PACE = 0.1
"""Pace below which nothing is looked for."""


@dataclass(frozen=True)
class Reached:
    """The fastest that a controller does a motion.

    Attributes:
        timing: of the motion that was given, of TIMINGS.
        case: that run.
        pace: over the motion that was given.
        acceleration: largest along the longest direction of the path, m/s2.
        limited_by: what breaks first just above that pace, where and when.
    """

    timing: str
    case: Case
    pace: float
    acceleration: float
    limited_by: str


@dataclass(frozen=True)
class Unreached:
    """A controller that keeps the limits at no pace.

    Attributes:
        timing: of the motion that was given, of TIMINGS.
        controller, feedforward: as of a `Case`.
        limited_by: what breaks even at the slowest pace, where and when.
    """

    timing: str
    controller: str
    feedforward: str
    limited_by: str


def at_pace(motion: Motion, pace: float) -> Motion:
    """Return the motion done `pace` times as fast."""
    return replace(
        motion, t=motion.t / pace, qd=pace * motion.qd, qdd=pace ** 2 * motion.qdd,
        xd=pace * motion.xd, xdd=pace ** 2 * motion.xdd)


def fastest_case(plan: Plan, controller: str, name: str, model: Model | None, bound: float,
                 peak: float = PEAK, timing: str = OWN, acceleration: float = math.inf,
                 jerk: float = math.inf) -> Reached | Unreached:
    """Return the fastest that a controller does the motion of a plan within its limits.

    Args:
        plan: robot, machine and motion.
        controller, name, model: as `Plan.case`.
        bound: time that no controller can undercut, s.
        peak: limit of the peak error of D, m.
        timing: what the motion of the plan has.
        acceleration, jerk: limits of the motion asked of the joints, rad/s2, rad/s3.
    """
    def tried(pace: float) -> Case | str:
        """Return the case of a pace, or what breaks."""
        asked = replace(plan, motion=at_pace(plan.motion, pace))
        try:
            check_limits(asked.motion, plan.robot, acceleration, jerk)
            case = asked.case(controller, name, model)
        except Par4Error as error:
            return str(error)
        return _broken(case, peak) or case

    high = plan.motion.duration / bound
    low = min(1.0, high)
    case, reason = tried(low), 'the bound of time-optimal motion'
    while isinstance(case, str):
        high, reason = low, case
        if low < LEAST_PACE:
            return Unreached(timing, controller, name, reason)
        low *= 0.7
        case = tried(low)
    while high / low > 1.0 + RESOLUTION:
        middle = 0.5 * (low + high)
        found = tried(middle)
        if isinstance(found, str):
            high, reason = middle, found
        else:
            low, case = middle, found
    axis = longest_axis(case.run)
    return Reached(timing, case, low, float(np.abs(case.run.motion.xdd[:, axis]).max()), reason)


def fastest_cases(plans: Mapping[str, Plan], pairs: Sequence[tuple[str, str, Model | None]],
                  bound: float, peak: float = PEAK, acceleration: float = math.inf,
                  jerk: float = math.inf, progress: Callable[[str], None] = lambda _: None
                  ) -> list[Reached | Unreached]:
    """Return the fastest of every controller with every model in every timing of a path.

    Args:
        plans: timing -> plan with the motion of that timing.
        pairs: of `pairs_of`.
        bound, peak, acceleration, jerk: as `fastest_case`.
        progress: told what is being simulated.
    """
    reached: list[Reached | Unreached] = []
    for timing, plan in plans.items():
        for controller, name, model in pairs:
            progress(f'looking for the fastest pace of {controller} with {name}, '
                     f'{TIMINGS[timing]}')
            reached.append(fastest_case(plan, controller, name, model, bound, peak, timing,
                                        acceleration, jerk))
    return reached


def _broken(case: Case, peak: float) -> str:
    """Return why a run does not keep the limit of the error, where and when; empty if it does.

    The drives keep the torque limit by themselves; where it was met before the error grew beyond
    its limit, the torque is what is missing.
    """
    run = case.run
    distance = np.linalg.norm(errors_of(run), axis=1)
    over = np.flatnonzero(distance > peak)
    if not len(over):
        return ''
    t, place = float(run.motion.t[over[0]]), run.motion.x[over[0], :3]
    limited = first_limited_torque(run)
    if limited and limited[0] < t:
        return limited[1]
    return f'error of D above {1e3 * peak:.3g} mm at {t:.4f} s, at {point_in_words(place)}'
