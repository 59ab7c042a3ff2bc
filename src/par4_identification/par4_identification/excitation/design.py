"""An excitation motion by design: optimised periodic paths, slow and then fast, repeated.

From rest at home through a few slow periods (friction, gravity) and many fast ones (inertias,
masses, viscous friction) of two Fourier paths back to rest at home, joined by short quintics. All
periods of a phase are the same samples, so that what differs between them in a log is noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from par4_dynamics.model import Model
from par4_identification.excitation.fourier_path import FourierPath
from par4_identification.excitation.motion_limits import MotionLimits, largest_loads
from par4_identification.excitation.path_optimisation import PathProblem, optimised_path
from par4_identification.excitation.request import FEWEST_PERIODS, DesignRequest
from par4_identification.excitation.transition import shortest_durations, transition
from par4_identification.signals.conditioning import Conditioning
from par4_kinematics.errors import InputError
from par4_kinematics.excitation import MARGIN, SLOW_ACCELERATION, SLOW_JOINT_SPEED
from par4_kinematics.motion import Motion, check_limits, motion_of_platform, sample_times
from par4_kinematics.robot import Robot
from par4_kinematics.workspace import home_pose

PERIOD = 1e-3
"""s between samples of the motion."""
FASTEST_HARMONIC = 0.5
"""Highest frequency of a path, over the cut-off of identification's torque filter."""
BASE_SHARE = 0.4
"""Base frequency of the fast path over that at which one harmonic meets speed and acceleration."""
PHASES = 48
"""Points of a path at which it may be entered or left."""
SHRINK = 0.97
"""Factor by which paths and transitions shrink that exceed a limit after all: between samples, or
because of effects of the model."""
SMALLEST = 0.3
"""Share of the size of the optimised path below which the limits are refused as impossible."""


@dataclass(frozen=True)
class Repeats:
    """Where a path is repeated.

    Attributes:
        path: one period of it.
        first: sample with which the first period begins.
        samples: of one period.
        count: of periods.
    """

    path: FourierPath
    first: int
    samples: int
    count: int


@dataclass(frozen=True)
class Design:
    """A designed excitation.

    Attributes:
        motion: from rest at home to rest at home.
        slow, fast: its phases.
        loads: largest share of each limit, kind -> 0 to 1.
    """

    motion: Motion
    slow: Repeats
    fast: Repeats
    loads: dict[str, float]


def design_excitation(robot: Robot, model: Model, limits: MotionLimits,
                      request: DesignRequest | None = None, noise: np.ndarray | float = 1.0,
                      progress: Callable[[float], None] | None = None) -> Design:
    """Return the motion that tells the base parameters best within the limits.

    The slow path is optimised alone, the fast one to go with it, and the slow one again to go with
    that. The same arguments give the same motion.

    Args:
        robot: the machine.
        model: its torque, roughly.
        limits: never exceeded at any sample.
        request: duration, paths, seed.
        noise: torque noise of the joints, (4,) or one for all; only ratios count.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: limits that the machine or the duration do not allow.
    """
    request = request or DesignRequest()
    conditioning = Conditioning()
    inner = limits.within(MARGIN)
    slow_limits = inner.slower(MARGIN * SLOW_JOINT_SPEED, MARGIN * SLOW_ACCELERATION)
    t = sample_times(request.duration, PERIOD)
    slow_samples = _slow_samples(request, conditioning)
    fast_samples = _fast_samples(robot, limits, request, conditioning)
    slow_time = request.slow_fraction * request.duration
    fast_time = request.duration - slow_time
    of_joints = np.broadcast_to(np.asarray(noise, dtype=float), (len(robot.joint_names),))
    relative_noise = of_joints / of_joints.max()

    def path(within: MotionLimits, samples: int, time: float, known: np.ndarray, step: int
             ) -> tuple[FourierPath, np.ndarray]:
        problem = PathProblem(
            robot.geometry, model.without_effects(), within, samples * PERIOD,
            conditioning.row_rate_hz * time, relative_noise, known, conditioning)
        best = optimised_path(problem, request.harmonics, request.starts,
                              np.random.default_rng((request.seed, step)),
                              lambda share: progress and progress((step + share) / 3.0))
        return best, problem.information(best)

    # a trace, so that a determinant is there whatever the first path looks like
    nothing = 1e-9 * np.eye(len(model.values))
    _, known = path(slow_limits, slow_samples, slow_time, nothing, 0)
    fast, known = path(inner, fast_samples, fast_time, known, 1)
    slow, _ = path(slow_limits, slow_samples, slow_time, known, 2)
    share, worst, kind = 1.0, math.inf, ''
    while share >= SMALLEST:
        motion, parts = _assembled(
            robot, model, (slow_limits.gentler(share), inner.gentler(share)), t, slow_time,
            (slow.scaled(share), fast.scaled(share)))
        loads = largest_loads(limits, motion, robot, model)
        kind, worst = max(loads.items(), key=lambda item: item[1])
        if worst <= 1.0:
            check_limits(motion, robot)
            return Design(motion, *parts, loads)
        share *= SHRINK
    raise InputError(f'excitation design: {kind} stays {worst:.3g} times its limit however small '
                     f'the motion; raise that limit or lower the others')


def _slow_samples(request: DesignRequest, conditioning: Conditioning) -> int:
    """Return the samples of a period of the slow path.

    Raises:
        InputError: so many periods that identification's filter would take its harmonics away.
    """
    shortest = request.harmonics / (FASTEST_HARMONIC * conditioning.torque_cutoff_hz)
    if request.slow_period < shortest:
        raise InputError(
            f'excitation design: slow periods of {request.slow_period:.3g} s asked, in which '
            f'{request.harmonics} harmonics are beyond the filter of identification at '
            f'{conditioning.torque_cutoff_hz:g} Hz; ask for fewer periods, of {shortest:.3g} s or '
            f'more')
    return round(request.slow_period / PERIOD)


def _fast_samples(robot: Robot, limits: MotionLimits, request: DesignRequest,
                  conditioning: Conditioning) -> int:
    """Return the samples of a period of the fast path.

    Raises:
        InputError: harmonics that identification's filter would take away.
    """
    highest = FASTEST_HARMONIC * conditioning.torque_cutoff_hz / request.harmonics
    frequency = request.base_frequency
    if frequency is None:
        # D moves about as fast as an elbow
        fastest = robot.geometry.arm_length * limits.joint_speed
        frequency = min(BASE_SHARE * limits.acceleration / (2.0 * math.pi * fastest), highest)
        # at least four periods have to fit
        frequency = max(frequency, 4.0 / ((1.0 - request.slow_fraction) * request.duration))
    if frequency > highest:
        raise InputError(
            f'excitation design: {request.harmonics} harmonics of {frequency:.3g} Hz asked; '
            f'identification filters at {conditioning.torque_cutoff_hz:g} Hz, so at most '
            f'{highest:.3g} Hz; lower the base frequency or the harmonics, or give more time')
    return max(2 * request.harmonics, round(1.0 / (frequency * PERIOD)))


def _assembled(robot: Robot, model: Model, limits: tuple[MotionLimits, MotionLimits],
               t: np.ndarray, slow_time: float, paths: tuple[FourierPath, FourierPath]
               ) -> tuple[Motion, tuple[Repeats, Repeats]]:
    """Return home -> slow periods -> fast periods -> home at times t, and the phases.

    About `slow_time` s are for the slow periods; what the fast ones do not fill is rest at home.

    Raises:
        InputError: no way between the paths within the limits, or too little time.
    """
    slow, fast = paths
    home = np.zeros((3, 1, 4))
    home[0] = home_pose(robot)
    entries = [path.sample(np.arange(PHASES) / PHASES * path.period) for path in paths]

    def shortest(start: np.ndarray, end: np.ndarray, within: MotionLimits) -> np.ndarray:
        return shortest_durations(start, end, robot.geometry, model.without_effects(), within)

    into = shortest(home, entries[0], limits[0])
    enter_slow = int(np.argmin(into))
    between = shortest(entries[0][:, [enter_slow]], entries[1], limits[1])
    home_again = shortest(entries[1], home, limits[1])
    enter_fast = int(np.argmin(between + home_again))
    moves = np.array((into[enter_slow], between[enter_fast], home_again[enter_fast]))
    if not np.isfinite(moves).all():
        raise InputError('excitation design: no short way within the limits between home and the '
                         'paths; raise the limits of speed, acceleration or torque')
    period = t[1]
    into_samples, between_samples, home_samples = np.ceil(moves / period - 1e-9).astype(int)
    slow_samples, fast_samples = (round(path.period / period) for path in paths)
    slow_periods = round(slow_time / slow.period)
    free = len(t) - 1 - slow_periods * slow_samples - int(
        into_samples + between_samples + home_samples)
    fast_periods = free // fast_samples
    if fast_periods < FEWEST_PERIODS:
        raise InputError(
            f'excitation design: {t[-1]:g} s leave {max(free, 0) * period:.3g} s for fast periods '
            f'of {fast.period:.3g} s beside {moves.sum():.3g} s of transitions; at least '
            f'{FEWEST_PERIODS} are needed; give more time or a higher base frequency')
    slow_state, fast_state = entries[0][:, enter_slow], entries[1][:, enter_fast]
    first_slow = int(into_samples)
    first_fast = first_slow + slow_periods * slow_samples + int(between_samples)
    parts = (
        _move(home[:, 0], slow_state, into_samples, period),
        _periods(slow, enter_slow, slow_samples, slow_periods),
        _move(slow_state, fast_state, between_samples, period),
        _periods(fast, enter_fast, fast_samples, fast_periods),
        _move(fast_state, home[:, 0], home_samples, period))
    x = np.concatenate(parts, axis=1)
    x = np.concatenate((x, np.repeat(home, len(t) - x.shape[1], axis=1)), axis=1)
    motion = motion_of_platform('designed excitation', robot.geometry, t, *x)
    return motion, (Repeats(slow, first_slow, slow_samples, slow_periods),
                    Repeats(fast, first_fast, fast_samples, int(fast_periods)))


def _move(start: np.ndarray, end: np.ndarray, samples: int, period: float) -> np.ndarray:
    """Return the samples (3, n, 4) of a transition, its end left out."""
    return transition(start, end, samples * period, np.arange(samples) * period)


def _periods(path: FourierPath, entry: int, samples: int, count: int) -> np.ndarray:
    """Return whole periods (3, n, 4) of a path from one of its entries on."""
    t = (entry / PHASES + np.arange(samples) / samples) * path.period
    return np.tile(path.sample(t), (1, count, 1))
