"""A measured log made into rows.

Positions are low-passed and differentiated; for accelerations they are first freed from the noise
of encoder counts. Torque and every column then pass the same zero-phase low-pass, so that neither
sign(qd) nor a delay of the filter can look like a cause. Rows are taken at a low rate. Rows near
standstill are marked invalid, wider than the filter reaches, because a resting joint does not say
what its friction torque is. A joint that accelerates hard turns back between two samples; its
friction counts as its mean there (`State.direction`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from par4_dynamics.state import State, state_of_joints
from par4_identification.logs.jumps import count_of
from par4_identification.logs.log import Log
from par4_identification.logs.masks import near
from par4_identification.logs.stamps import SHORTEST_PERIOD
from par4_identification.logs.stretches import SHORTEST
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.filtering import (
    central_difference,
    low_pass,
    second_difference,
)
from par4_identification.signals.finer import finer
from par4_identification.signals.plateaus import plateaus_of
from par4_identification.signals.position_noise import position_noise
from par4_identification.signals.run import Run
from par4_identification.signals.smoothing import Smoother, smoother_of, speed_noise
from par4_identification.signals.timing import TICK, timing_error, turning_error
from par4_identification.signals.torque_noise import samples_for_floor, white_floor
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot

SLOWEST_AXIS_HZ = 4.0
"""Rate of a log below which splines between the samples of an axis tell nothing."""
SLOWEST_HZ = 50.0
"""Rate below which a motion that goes faster and slower cannot be filtered."""
WHOLE = 0.01
"""Part of a step by which readings of torques may miss a multiple of it."""
AT_FIRST = 0.05
"""s in which a log that begins at rest stays there."""


def runs_of_logs(logs: Sequence[Log], machine: Robot | Axis,
                 conditioning: Conditioning | None = None) -> list[Run]:
    """Return the rows of logs; the plateaus of steady speeds are one run.

    Raises:
        InputError, UnreachableError: as `runs_of_log`.
    """
    if conditioning is not None and conditioning.steady:
        return [_run_of_plateaus(logs, machine, conditioning)]
    return [run for log in logs for run in runs_of_log(log, machine, conditioning)]


def runs_of_log(log: Log, machine: Robot | Axis, conditioning: Conditioning | None = None
                ) -> list[Run]:
    """Return the rows of every uninterrupted stretch of `log` that is long enough for the filters.

    Raises:
        InputError: a log too slow for the filters, or with no stretch of at least a second.
        UnreachableError: joint positions with which the mechanism does not close.
    """
    conditioning = conditioning or Conditioning()
    if conditioning.steady:
        return [_run_of_plateaus([log], machine, conditioning)]
    rate = 1.0 / log.period
    if isinstance(machine, Axis) and rate < SLOWEST_AXIS_HZ:
        raise InputError(f'{log.name}: recorded at {rate:.3g} Hz by its stamps; at least '
                         f'{SLOWEST_AXIS_HZ:g} Hz are needed, 1000 Hz are better; where stamps '
                         f'count milliseconds, write seconds')
    if rate < 2.5 * conditioning.position_cutoff_hz:
        scale = rate / (2.5 * conditioning.position_cutoff_hz)
        if rate < SLOWEST_HZ:
            raise InputError(f'{log.name}: recorded at {rate:.1f} Hz; at least {SLOWEST_HZ:g} Hz '
                             f'are needed, 1000 Hz are better; an axis that holds each speed for '
                             f'2 s may be slower')
        conditioning = replace(
            conditioning, position_cutoff_hz=scale * conditioning.position_cutoff_hz,
            torque_cutoff_hz=scale * conditioning.torque_cutoff_hz,
            row_rate_hz=scale * conditioning.row_rate_hz)
    samples = samples_for_floor(conditioning, log.period, machine)
    long = [segment for segment in log.segments
            if (segment.stop - segment.start) * log.period >= SHORTEST
            and segment.stop - segment.start >= samples]
    runs = _runs(replace(log, segments=tuple(long)), machine, conditioning) if long else []
    if not runs:
        least = max(SHORTEST, 4.0 * conditioning.reach, samples * log.period)
        raise InputError(f'{log.name}: no uninterrupted stretch of at least {least:.1f} s, which '
                         f'the filters need; record longer or without gaps'
                         + ('' if log.period > SHORTEST_PERIOD else
                            f' (its stamps say {rate:.3g} Hz: are they in seconds?)'))
    return runs


def _runs(log: Log, machine: Robot | Axis, conditioning: Conditioning) -> list[Run]:
    """Return the rows of the stretches of a log, all long enough for the filters."""
    fine = finer(log, machine)
    # white noise of samples between which others are put has its power in fewer frequencies
    noise = np.zeros(log.q.shape[1]) if isinstance(machine, Robot) else np.sqrt(
        log.period / fine.period) * position_noise([log.q[part] for part in log.segments],
                                                   log.period, log.integrated)
    counts = machine.drives.encoder_counts if isinstance(machine, Robot) else 0
    smoother = smoother_of([fine.q[part] for part in fine.segments], counts, fine.period)
    runs = [_run(fine, segment, machine, conditioning, smoother, counts,
                 white_floor(log.tau[measured], conditioning, log.period, machine),
                 log.period, noise)
            for measured, segment in zip(log.segments, fine.segments)]
    return [run for run in runs if len(run.t) > 1]


def are_coarse(counts: int, conditioning: Conditioning, period: float) -> bool:
    """Return whether encoders blur speeds beyond that from which on friction is known.

    Filtered positions then tell speeds better. They round off the turn of a joint, where friction
    changes its sign; coarse counts blur it more.
    """
    cutoff = min(conditioning.position_cutoff_hz, 0.4 / period)
    return speed_noise(counts, cutoff, period) > conditioning.low_speed


def _run_of_plateaus(logs: Sequence[Log], machine: Robot | Axis, conditioning: Conditioning
                     ) -> Run:
    """Return the plateaus of logs of an axis as rows, from the fastest one way to the other."""
    if not isinstance(machine, Axis):
        raise InputError(f'{logs[0].name}: steady speeds asked of a robot; they are read of single '
                         f'axes')
    plateaus = sorted((item for log in logs for item in plateaus_of(log)),
                      key=lambda item: item.speed)
    if not plateaus:
        raise InputError(f'{logs[0].name}: holds no speed for 2 s, as the other logs do; leave it '
                         f'out')
    number = np.arange(float(len(plateaus)))
    q, speed, torque, deviation = (np.array([getattr(item, name) for item in plateaus])[:, None]
                                   for name in ('q', 'speed', 'torque', 'deviation'))
    moving = np.abs(speed) >= conditioning.low_speed
    return Run(
        name=logs[0].name, state=State(number, q, speed, np.zeros_like(q),
                                       hanging=machine.hanging, slides=machine.kind == 'linear'),
        t=number, speed=speed, tau=torque, valid=moving, standstill=np.zeros_like(moving),
        noise_floor=np.sqrt(np.mean(deviation ** 2, axis=0)), conditioning=conditioning,
        _first=0, _every=1, timing_error=np.zeros_like(torque),
        turning_error=np.zeros_like(torque))


def _run(log: Log, segment: slice, machine: Robot | Axis, conditioning: Conditioning,
         smoother: Smoother, counts: int, noise_floor: np.ndarray, sampled: float,
         noise: np.ndarray) -> Run:
    period = log.period
    q, smooth = (low_pass(told, conditioning.position_cutoff_hz, period)
                 for told in (log.q[segment], smoother(log.q[segment])))
    coarse = are_coarse(counts, conditioning, period)
    q = smooth if coarse else q
    qd, qdd = central_difference(q, period), second_difference(smooth, period)
    tau = low_pass(log.tau[segment], conditioning.torque_cutoff_hz, period)

    geometry = machine.geometry if isinstance(machine, Robot) else None
    state = state_of_joints(geometry, log.t[segment], q, qd, qdd, period)
    at_first = state.t < state.t[0] + AT_FIRST
    rests = np.all(np.abs(state.qd[at_first]) < conditioning.low_speed)
    state = replace(state, measured=None if rests else log.tau[segment], told_hz=smoother.told_hz(
        period, conditioning.position_cutoff_hz))
    if isinstance(machine, Axis):
        state = replace(state, hanging=machine.hanging, slides=machine.kind == 'linear')
    every = max(1, round(1.0 / (conditioning.row_rate_hz * period)))

    reach = int(np.ceil(conditioning.reach / period))
    slow = np.abs(state.qd) < conditioning.low_speed
    valid = ~near(slow, reach)
    moving = np.abs(state.qd) >= conditioning.low_speed / 4
    resting = ~near(moving, 2 * reach)
    if log.doubtful is not None:
        trusted = ~near(log.doubtful[segment], 2 * reach)
        valid, resting = valid & trusted, resting & trusted
    first = 2 * reach
    window = slice(first, len(state.t) - first, every)
    return Run(
        name=log.name, state=state, t=state.t[window], speed=state.qd[window],
        tau=tau[window], valid=valid[window], standstill=resting[window],
        noise_floor=noise_floor, conditioning=conditioning,
        _first=first, _every=every, period=sampled, smoother=smoother,
        likely=low_pass(smoother.likely(log.q[segment]), conditioning.position_cutoff_hz, period),
        coarse=coarse, counts=counts, position_noise=noise, integrated=log.integrated,
        torque_step=_torque_step(log.tau[segment]),
        timing_error=timing_error(log.tau[segment], conditioning, period, round(
            sampled / period), TICK if geometry is not None else np.inf)[window],
        turning_error=turning_error(qd, conditioning, period)[window])


def _torque_step(torque: np.ndarray) -> np.ndarray:
    """Return the step (J,), N m, of which all readings (n, J) are multiples, zero without one."""
    steps = np.abs(np.diff(torque, axis=0))
    return np.array([count_of(own[own > 0.0], WHOLE) if np.any(own > 0.0) else 0.0
                     for own in steps.T])
