"""Filters and rates that suit a log: those of a Par4, or for an axis what its data tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from par4_identification.logs.jumps import count_of
from par4_identification.logs.log import Log
from par4_identification.logs.stretches import in_pieces
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.filtering import (
    central_difference,
    fewest_samples,
    low_pass,
    second_difference,
)
from par4_identification.signals.plateaus import follow_the_position, hold_speeds
from par4_identification.signals.position_noise import (
    mean_spectrum,
    noise_gain,
    noise_variance,
)
from par4_identification.signals.rows import SLOWEST_HZ, are_coarse, runs_of_log
from par4_identification.signals.smoothing import smoother_of
from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.robot import Axis, Robot

ENERGY = 0.998
"""Share of the torque's squares above its noise that the filter must let through."""
INSIDE = 1.5
"""Cut-off over the frequency up to which they reach."""
OF_RATE = 0.1
"""Highest cut-off of the torque over the sample rate: its noise is measured above four times it."""
POSITION = 2.0
"""Cut-off of the positions of an axis over that of its torque: half that of a Par4, as encoders
and stamps of unknown make are often noisier, and noise would turn the sign of a slow motion."""
UNRESOLVED = 0.01
"""Share of the squares of the acceleration that noise of the positions may have. Noise in a column
makes its coefficient too small by as much (errors in variables)."""
MAINS_HZ, LINE, BESIDE = (50.0, 60.0), 30.0, (3, 10)
"""Frequencies of mains; ratio of a line to the median beside it, from which it is one; and from how
many hertz to how many beside it that is taken."""
LEAST_POSITION = 0.1
"""Cut-off of the positions over that of the torque, at the least."""
LEAST_CUTOFF = 5.0
"""Hz, of the torque, however coarse the encoders are."""
ANSWERED, LEAST_SECONDS = 0.5, 5.0
"""Coherence of torque and noise of positions above which a drive answers that noise, and the
shortest stretch (s) whose coherence says so: of signals that do not belong together, it is less
than a fifth there."""
OPTIONS = {'cutoff_hz': ('--cutoff', 'higher'), 'row_rate_hz': ('--rows', 'higher'),
           'low_speed': ('--low-speed', 'lower')}
"""What a user sets -> its option, and which way there are more rows."""
FEWEST_ROWS = 20
"""Rows of a joint below which no result can be had."""
LOW_SPEED_SHARE = 0.01
"""Low speed over the speed that a twentieth of the motion exceeds."""


@dataclass(frozen=True)
class Chosen:
    """What a user sets; None leaves the choice to the data.

    Attributes:
        cutoff_hz: of the torque.
        row_rate_hz: of the rows.
        low_speed: below which friction is not known, rad/s, of a linear axis m/s.
    """

    cutoff_hz: float | None = None
    row_rate_hz: float | None = None
    low_speed: float | None = None


def conditioning_for(logs: Sequence[Log], machine: Robot | Axis, usual: Conditioning,
                     chosen: Chosen | None = None) -> Conditioning:
    """Return how the signals of logs of a machine become rows.

    The arms of a Par4 have the usual filters. Where its encoders are coarse and much of what they
    tell is rounding from some frequency on, its rows end there: the drives answer what the encoders
    tell, so that the torque follows the rounding. An axis may be any machine: its cut-off is the
    usual one or, where its torque reaches higher above its noise, so high that it passes, or lower
    where a drive answers its encoder; its positions pass as far as their noise lets the
    acceleration be told; its low speed goes with its speeds and with the steps of its positions.
    Where it holds one speed after the other, and no filter is asked for, each plateau of its speed
    is a row, unless its torque follows the position within them.

    Args:
        logs: of the machine.
        machine: a robot or an axis.
        usual: conditioning of a Par4 logged at 1 kHz.
        chosen: what a user sets.

    Raises:
        InputError: a cut-off or a rate that the samples do not carry, or that leaves no rows.
    """
    chosen = chosen or Chosen()
    rate = min(1.0 / log.period for log in logs)
    cutoff, low_speed = usual.torque_cutoff_hz, usual.low_speed
    if (isinstance(machine, Axis) and chosen.cutoff_hz is None and chosen.row_rate_hz is None
            and hold_speeds(logs, SLOWEST_HZ)
            and (rate < SLOWEST_HZ or not follow_the_position(logs, machine.kind == 'revolute'))):
        return replace(usual, steady=True, low_speed=chosen.low_speed or 0.0)
    if isinstance(machine, Robot):
        cutoff = max(min(LEAST_CUTOFF, cutoff), min(cutoff, _known_hz(logs, machine, usual)))
    if isinstance(machine, Axis):
        cutoff = _cutoff_of_axis(logs, cutoff, OF_RATE * rate)
        slowest, resolved = zip(*(_low_speeds(log, cutoff) for log in logs))
        low_speed = max(min(slowest), *resolved, 1e-9)
    if chosen.cutoff_hz is not None:
        cutoff = chosen.cutoff_hz
        if not 0.0 < cutoff < 0.2 * rate:
            raise InputError(f'--cutoff {cutoff:g} Hz asked of samples at {rate:.4g} Hz, which '
                             f'carry up to {0.2 * rate:.3g} Hz; give less or record faster')
    scale = cutoff / usual.torque_cutoff_hz
    row_rate = usual.row_rate_hz * scale
    if chosen.row_rate_hz is not None:
        row_rate = chosen.row_rate_hz
        if not 2.0 * cutoff <= row_rate <= rate:
            raise InputError(f'--rows {row_rate:g} Hz asked of a torque low-passed at {cutoff:.3g} '
                             f'Hz and sampled at {rate:.4g} Hz; give {2.0 * cutoff:.3g} to '
                             f'{rate:.4g} Hz')
    if chosen.low_speed is not None:
        low_speed = chosen.low_speed
    position = usual.position_cutoff_hz * scale
    if isinstance(machine, Axis):
        position = min(POSITION * cutoff, max(LEAST_POSITION * cutoff, resolved_hz(logs)))
    found = replace(usual, position_cutoff_hz=position, torque_cutoff_hz=cutoff,
                    row_rate_hz=row_rate, low_speed=low_speed)
    if chosen != Chosen():
        _refuse_without_rows(logs, machine, usual, chosen, found)
    return found


def _refuse_without_rows(logs: Sequence[Log], machine: Robot | Axis, usual: Conditioning,
                         chosen: Chosen, found: Conditioning) -> None:
    """Refuse what a user sets if it leaves a joint without the rows that it has otherwise.

    Raises:
        InputError: names the options without which there are rows.
    """
    left = _rows_of_joints(logs, machine, found)
    else_there = _rows_of_joints(logs, machine, conditioning_for(logs, machine, usual))
    lost = np.flatnonzero((left < FEWEST_ROWS) & (else_there >= FEWEST_ROWS))
    if not len(lost):
        return

    def mends(option: str) -> bool:
        try:
            without = conditioning_for(logs, machine, usual, replace(chosen, **{option: None}))
        except InputError:  # the others alone do not go together, or leave no rows either
            return False
        return bool((_rows_of_joints(logs, machine, without)[lost] >= FEWEST_ROWS).all())

    given = [option for option in OPTIONS if getattr(chosen, option) is not None]
    causes = [option for option in given if mends(option)] or given
    told = ' and '.join(f'{OPTIONS[option][0]} {getattr(chosen, option):g}' for option in causes)
    other = ' or '.join(dict.fromkeys(OPTIONS[option][1] for option in causes))
    joint = int(lost[np.argmin(left[lost])])
    raise InputError(f'{told}: joint {joint} has {left[joint]} usable rows with that and '
                     f'{else_there[joint]} without; give a {other} number or leave it out')


def _rows_of_joints(logs: Sequence[Log], machine: Robot | Axis, conditioning: Conditioning
                    ) -> np.ndarray:
    """Return how many rows of each joint (J,) say something; none where the filters need more."""
    count = np.zeros(logs[0].q.shape[1], dtype=int)
    for log in map(in_pieces, logs):
        longest = log.period * max((part.stop - part.start for part in log.segments), default=0)
        # filters that remember longer than any stretch lasts would only take time and memory
        if not conditioning.steady and longest <= 4.0 * conditioning.reach:
            continue
        try:
            count += sum(run.valid.sum(axis=0) for run in runs_of_log(log, machine, conditioning))
        except Par4Error:
            continue
    return count


def _known_hz(logs: Sequence[Log], robot: Robot, usual: Conditioning) -> float:
    """Return the frequency, Hz, up to which coarse encoders tell the motion of all logs."""
    counts = robot.drives.encoder_counts
    return min((smoother_of([log.q[segment] for segment in log.segments], counts,
                            log.period).known_hz(log.period)
                for log in logs if are_coarse(counts, usual, log.period)), default=np.inf)


def _cutoff_of_axis(logs: Sequence[Log], usual: float, highest: float) -> float:
    """Return the cut-off (Hz) of the torque of an axis: the usual one, or as far as it reaches.

    Where its drive answers the noise of its positions, rows end at half of what these tell.
    """
    cutoff, told = max(usual, *map(_reach, logs)), resolved_hz(logs)
    if told < POSITION * cutoff and any(_answers_noise(log, told) for log in logs):
        cutoff = max(LEAST_CUTOFF, told / POSITION)
    return min(highest, cutoff)


def _answers_noise(log: Log, told: float) -> bool:
    """Return whether the torque of an axis follows what its positions hold beyond the motion.

    That is so if the two are coherent in the octave above the frequency (Hz) up to which positions
    tell the motion: a drive makes a torque of the steps of its encoder. Other torques there, waves
    over the position among them, do not follow the noise.
    """
    length, coherent = max(round(1.0 / log.period), 16), [np.zeros(0)]
    for segment in log.segments:
        q, tau = log.q[segment][:, 0], log.tau[segment][1:, 0]
        if len(tau) > LEAST_SECONDS * length and np.ptp(q) > 0.0 and np.ptp(tau) > 0.0:
            with np.errstate(invalid='ignore'):  # where a signal has nothing, they share nothing
                frequency, share = scipy.signal.coherence(np.diff(q), tau, 1.0 / log.period,
                                                          nperseg=length)
            coherent.append(share[(frequency > told) & (frequency < 2.0 * told)])
    shares = np.nan_to_num(np.concatenate(coherent))
    return bool(len(shares) and np.mean(shares) > ANSWERED)


def _reach(log: Log) -> float:
    """Return the cut-off (Hz) that passes what the torque has above its noise.

    Only what a filter can pass is counted. Counts at a steady speed make lines, which fold to any
    frequency up to half the sample rate and say nothing of how far the torque of the motion
    reaches.
    """
    spectrum = mean_spectrum([log.tau[segment] for segment in log.segments], log.period)
    frequency, power = spectrum.frequency, spectrum.power.sum(axis=1)
    noise = float(spectrum.level(frequency > 0.8 * frequency[-1]).sum())
    inside = (frequency > 0.0) & (frequency <= OF_RATE / log.period)
    above = np.cumsum(np.where(inside, np.maximum(power - 2.0 * noise, 0.0), 0.0))
    if above[-1] < noise * len(power):
        return 0.0  # no more than its noise
    return INSIDE * float(frequency[np.searchsorted(above, ENERGY * above[-1])])


def resolved_hz(logs: Sequence[Log]) -> float:
    """Return the frequency (Hz) up to which the positions of logs tell the acceleration.

    Counts and noise of a position are white, or those of the speed that it is the integral of. In
    the second difference their power grows with the fourth or second power of the frequency, while
    a motion has most of its acceleration at low ones. Hum of the mains that the torque does not
    have is none: nothing moves without a torque.
    """
    length = min(max(round(1.0 / log.period), 16) for log in logs) // 2
    told, noisy = np.zeros(length), np.zeros(length)
    highest = np.inf
    for log in logs:
        spectrum = mean_spectrum([second_difference(log.q[segment], log.period)
                                  for segment in log.segments], log.period)
        frequency = spectrum.frequency
        noise = (noise_gain(frequency, log.period, log.integrated)
                 * float(noise_variance(spectrum, log.period, log.integrated).sum()))
        torque = mean_spectrum([log.tau[segment] for segment in log.segments], log.period)
        power = _without_hum(frequency, spectrum.power.sum(axis=1), torque.power.sum(axis=1))
        told += np.maximum(power - 2.0 * noise, 0.0)[:length]
        noisy += noise[:length]
        highest = min(highest, float(frequency[-1]))
    few = np.cumsum(noisy) <= UNRESOLVED * np.maximum(np.cumsum(told), 1e-300)
    return highest * float(np.flatnonzero(few)[-1] + 1) / length if few.any() else 0.0


def _without_hum(frequency: np.ndarray, power: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Return the power (k,) of a reading without lines of the mains that its torque (k,) lacks."""
    found = power.copy()
    spacing = frequency[1] - frequency[0]
    near, far = (round(hertz / spacing) for hertz in BESIDE)
    for mains in MAINS_HZ:
        for place in np.arange(mains, frequency[-1], mains):
            middle = round(place / spacing)
            line = slice(middle - near + 1, middle + near)
            beside = np.r_[middle - far:middle - near + 1, middle + near:middle + far + 1]
            beside = beside[(beside > 0) & (beside < len(power))]
            own, other = (float(own[line].max() / max(np.median(own[beside]), 1e-300))
                          for own in (power, torque))
            if own > LINE and other < own / LINE:
                found[line] = np.median(power[beside])
    return found


def _low_speeds(log: Log, cutoff: float) -> tuple[float, float]:
    """Return two speeds below which the direction is not known.

    The first is a small part of the speeds of the motion, the second one step of the position in
    the time that the filter of the torque remembers.
    """
    speeds, steps = [], []
    for segment in log.segments:
        q = log.q[segment]
        if len(q) < fewest_samples():
            continue
        steps.append(np.abs(np.diff(q, axis=0)).ravel())
        smooth = low_pass(q, min(4.0 * cutoff, 0.4 / log.period), log.period)
        speeds.append(np.abs(central_difference(smooth, log.period)).ravel())
    if not speeds:
        return np.inf, 0.0
    step, speed = np.concatenate(steps), np.concatenate(speeds)
    moved = step[step > 1e-12]
    return (LOW_SPEED_SHARE * float(np.quantile(speed, 0.95)),
            cutoff * count_of(moved) if len(moved) else 0.0)
