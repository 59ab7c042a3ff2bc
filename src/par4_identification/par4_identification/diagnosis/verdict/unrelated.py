"""What follows nothing in the motion: noise that wanders, lines of one frequency, bursts.

The residual of the final model is taken as a signal. White noise of the measured level is its
floor. What exceeds the floor without following the motion comes from the machine's surroundings and
is no error of its model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from par4_identification.diagnosis.evidence.fit import Fit, residuals
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.verdict.cycle import cycle_of
from par4_identification.signals.noise import fit_noise
from par4_identification.signals.position_noise import mean_spectrum
from par4_identification.signals.run import Run

CHANCE = 1e-4
"""Probability, over all frequencies or blocks of a joint, of an accident that passes for a finding.
"""
BACKGROUND = 31
"""Bins of the spectrum whose median is the level around a line."""
LOBE = 2
"""Bins on either side over which a line spreads."""
CYCLES = 8
"""Least periods of a line in the rows: slower than that it is no other than a drift, or what the
model gets wrong of the slowest part of the motion."""
OF_TORQUE = 0.02
"""Share of the torque that the model has at a frequency up to which a line there is its error."""
BURST = 0.25
"""s over which a burst is looked for."""
MEMORY = 60
"""Rows over which the correlation time of wandering noise is read."""
SLOWEST_SWING, LOOKED_FROM = 5.0, 3.0
"""Hz: lowest frequency at which something swings rather than drifts, and from which on power
counts."""
SWING_WINDOW = 256
"""Rows of a spectrum in which a swing shows; it dies down, so that longer ones see no more of it.
"""
SWING_BAND, SWINGS = 0.15, 0.6
"""Share of its frequency by which a swing may be off, and share of the power within that. Frames on
springs have 0.7 to 0.8, loads that bounce in a gap 0.2 to 0.45."""


@dataclass(frozen=True)
class Line:
    """A periodic disturbance.

    Attributes:
        frequency_hz: of the line.
        amplitude: (J,), N m.
    """

    frequency_hz: float
    amplitude: np.ndarray


@dataclass(frozen=True)
class Unrelated:
    """What the residual contains that follows nothing in the motion.

    Attributes:
        wandering_rms: of noise that wanders, beyond the floor, (J,) N m; zero where there is none.
        correlation_time: after which it is a third (1/e) of itself, s.
        lines: periodic disturbances, the largest first.
        bursts: times, (start, end) s since the start of the run, at which the noise is larger.
    """

    wandering_rms: np.ndarray
    correlation_time: float
    lines: tuple[Line, ...]
    bursts: tuple[tuple[float, float], ...]

    @property
    def wanders(self) -> bool:
        """Whether there is wandering noise."""
        return bool(np.any(self.wandering_rms > 0.0))


Left = tuple[Run, np.ndarray, np.ndarray]
"""A run, what the model leaves of its rows (m, J), and by what its causes may be wrong, N m."""


def left_of(observations: Observations, model: Sequence[Hypothesis], base_only: Fit, whole: Fit,
            rules: Rules) -> list[Left]:
    """Return of each run what a model leaves, and by what the torque of its causes may be wrong.

    That is a share of the difference that they make to the base terms (`Rules.named_error`), one
    of the torque of those without a name (`Rules.unnamed_error`), one of the measured torque
    (`Rules.base_error`), and what the times of readings make where the torque jumps.
    """
    before, after = (residuals(observations, part, fit)
                     for part, fit in (((), base_only), (model, whole)))
    unnamed = [np.zeros_like(part) for part in after]
    for item, coefficients in zip(model, whole.coefficients):
        if isinstance(item.effect, Kind):
            unnamed = [total + np.einsum('mjk,kj->mj', rows, coefficients) for total, rows in zip(
                unnamed, observations.effect_rows(item.effect, item.shape))]
    return [(run, left, np.sqrt((rules.named_error * (old - left)) ** 2
                                + (rules.unnamed_error * own) ** 2
                                + (rules.base_error * torque) ** 2 + run.timing_error ** 2))
            for run, old, left, own, torque in zip(
                observations.runs, before, after, unnamed, observations.varying)]


def unrelated(fit: Sequence[Left], heldout: Sequence[Left], floor: np.ndarray, rules: Rules,
              named: bool = True) -> Unrelated:
    """Return what residuals contain that follows nothing in the motion.

    Args:
        fit, heldout: what the model leaves of fitted and held-out rows, see `left_of`.
        floor: rms that a perfect model would leave, (J,), N m.
        rules: `Rules.floor_excess` tells how much more than that is more than noise.
        named: whether every cause of the model has a name. What others leave is often no noise, so
            that nothing in it is told as a burst unless most of the time only noise is left.
    """
    runs = [*fit, *heldout]
    if runs[0][0].conditioning.steady:  # plateaus do not follow each other in time
        return Unrelated(np.zeros_like(floor), 0.0, (), ())
    lines = lines_of(fit, heldout)
    rms = np.sqrt(np.stack([np.sum(np.where(run.valid, left, 0.0) ** 2, axis=0)
                            for run, left, _ in runs]).sum(axis=0)
                  / np.maximum(sum(run.valid.sum(axis=0) for run, _, _ in runs), 1))
    by_lines = np.sqrt(0.5 * sum((line.amplitude ** 2 for line in lines), np.zeros_like(rms)))
    more = np.sqrt(np.maximum(rms ** 2 - floor ** 2 - by_lines ** 2, 0.0))
    wanders = np.hypot(floor, more) > rules.floor_excess * floor
    memory = _correlation_time(runs) if wanders.any() else 0.0
    return Unrelated(np.where(wanders, more, 0.0), memory, lines,
                     _bursts(
                         heldout, floor, np.inf if named else rules.floor_excess))


def _correlation_time(runs: Sequence[Left]) -> float:
    """Return the time after which the residuals' autocorrelation falls below 1/e, s."""
    times = []
    for joint in range(runs[0][1].shape[1]):
        noise = fit_noise([left[:, joint] for _, left, _ in runs],
                          [run.valid[:, joint] for run, _, _ in runs])
        correlation = noise.autocovariance(MEMORY)
        below = np.flatnonzero(correlation < correlation[0] / np.e)
        times.append(below[0] if len(below) else MEMORY)
    run = runs[0][0]
    return float(np.median(times) * run.row_time)


def swing_of(parts: Sequence[Sequence[Left]]) -> float | None:
    """Return the frequency (Hz) at which most of what is left swings in every part of the data.

    A frame, a table or a tool on a spring answers the motion at its own frequency and dies down:
    no line of one frequency, and no function of the motion at the same time.
    """
    found = [_swing(runs) for runs in parts]
    return None if None in found else float(np.mean([item for item in found if item is not None]))


def _swing(runs: Sequence[Left]) -> float | None:
    spectrum = mean_spectrum([np.where(run.valid, left, 0.0) for run, left, _ in runs],
                             runs[0][0].row_time, np.hanning(SWING_WINDOW))
    if not spectrum.windows:
        return None
    frequency = spectrum.frequency
    total = np.where(frequency > LOOKED_FROM, spectrum.power.sum(axis=1), 0.0)
    peak = float(frequency[int(np.argmax(total))])
    near = np.abs(frequency - peak) <= max(SWING_BAND * peak, 2.5 * frequency[1])
    swings = peak >= SLOWEST_SWING and total[near].sum() > SWINGS * total.sum()
    return peak if swings else None


def lines_of(fit: Sequence[Left], heldout: Sequence[Left]) -> tuple[Line, ...]:
    """Return the frequencies that stand out of the spectrum in the fitted and held-out rows."""
    found: dict[float, np.ndarray] = {}
    joints = fit[0][1].shape[1]
    for joint in range(joints):
        here, there = _longest(fit, joint), _longest(heldout, joint)
        for frequency, _ in _peaks(*here, CHANCE):
            again = [amplitude for other, amplitude in _peaks(*there, 1e-2)
                     if abs(other - frequency) < 1.5 / (there[0][-1] - there[0][0])]
            if again:
                key = next((known for known in found
                            if abs(known - frequency) < 2.0 / (here[0][-1] - here[0][0])),
                           frequency)
                found.setdefault(key, np.zeros(joints))[joint] = again[0]
    return tuple(sorted((Line(frequency, amplitude) for frequency, amplitude in found.items()),
                        key=lambda line: -float(line.amplitude.max())))


def _longest(runs: Sequence[Left], joint: int
             ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float | None]:
    """Return time, residual, torque of the model and validity of a joint where it moves longest.

    The last is the number of rows after which it moves the same way again, if it does.
    """
    run, left, _ = max(runs, key=lambda part: int(part[0].valid[:, joint].sum()))
    return (run.t, left[:, joint], run.tau[:, joint] - left[:, joint], run.valid[:, joint],
            cycle_of(run.q[:, joint]))


def _peaks(time: np.ndarray, left: np.ndarray, torque: np.ndarray, valid: np.ndarray,
           cycle: float | None, chance: float) -> list[tuple[float, float]]:
    """Return frequency (Hz) and amplitude of the peaks that noise makes with that probability.

    Peaks at frequencies of the motion itself, where the model has far more torque, are no more than
    its error. So are those at multiples of the frequency of a `cycle` that do not stand far out of
    the multiples around them: whatever the model gets wrong comes again with the motion.
    """
    if valid.sum() < 4 * BACKGROUND:
        return []
    kept = np.where(valid, left - left[valid].mean(), 0.0) * np.hanning(len(left))
    power = np.abs(np.fft.rfft(kept)) ** 2
    followed = np.where(valid, torque - torque[valid].mean(), 0.0) * np.hanning(len(torque))
    error = (OF_TORQUE * np.abs(np.fft.rfft(followed))) ** 2
    frequency = np.fft.rfftfreq(len(kept), float(time[1] - time[0]))
    # the median of the squares of noise is ln 2 of their mean
    level = scipy.ndimage.median_filter(power, BACKGROUND, mode='mirror') / np.log(2.0)
    level = np.maximum(level, _repeated(power, None if cycle is None else len(kept) / cycle))
    limit = -np.log(chance / len(power))
    window = np.hanning(len(left))[valid].sum()
    found = []
    for place in range(CYCLES, len(power) - 1):
        if (power[place] > limit * level[place] and power[place] > error[place]
                and power[place] == power[place - 2:place + 3].max()):
            found.append((float(frequency[place]), float(2.0 * np.sqrt(power[place]) / window)))
    return sorted(found, key=lambda item: -item[1])


def _repeated(power: np.ndarray, cycles: float | None) -> np.ndarray:
    """Return the largest power (k,) around each multiple of a cycle's frequency, zero elsewhere.

    It is that of the four multiples on either side, without its own.

    Args:
        power: of a spectrum.
        cycles: that the data hold; None where the motion does not repeat itself.
    """
    level = np.zeros_like(power)
    if cycles is None:
        return level
    places = np.round(cycles * np.arange(int((len(power) - 2) / cycles) + 1)).astype(int)
    own = scipy.ndimage.maximum_filter(power, 2 * LOBE + 1)[places]
    others = np.array(4 * (True,) + (False,) + 4 * (True,))
    around = scipy.ndimage.maximum_filter(own, footprint=others, mode='mirror')
    for shift in range(-LOBE, LOBE + 1):
        near = np.clip(places + shift, 0, len(power) - 1)
        level[near] = np.maximum(level[near], around)
    return level


def _bursts(runs: Sequence[Left], floor: np.ndarray, most: float
            ) -> tuple[tuple[float, float], ...]:
    """Return when residuals are larger than noise of one size is by chance.

    That size is what they have most of the time, and no less than the floor: noise that follows the
    motion, as that of encoder counts does, is smaller in places. Where the causes' torque is large,
    so may be their error. Joints on which that size is more than `most` floors have none.
    """
    found = []
    for run, left, wrong in runs:
        period = run.row_time
        length = max(2, round(BURST / period))
        for joint in range(left.shape[1]):
            valid = run.valid[:, joint]
            noise = fit_noise([left[:, joint]], [valid])
            white = noise.whiten(left[:, [joint]], valid)[:, 0]
            usual = float(white[valid] @ white[valid]) / max(int(valid.sum()), 1)
            firsts = range(0, len(left) - length + 1, length)
            own = np.sqrt(np.mean(left[valid, joint] ** 2)) if valid.any() else 1.0
            white /= np.sqrt(1.0 + (wrong[:, joint] / max(own, 1e-30)) ** 2)
            spans = slice(0, len(firsts) * length)
            count = valid[spans].reshape(-1, length).sum(axis=1)
            squares = np.sum((white[spans] ** 2).reshape(-1, length), axis=1)
            enough = count > length // 2
            if enough.sum() < 8:
                continue
            of_floor = usual * (floor[joint] / max(own, 1e-30)) ** 2
            level = max(np.median(squares[enough] / count[enough]), of_floor)
            if level > most ** 2 * of_floor:
                continue
            # of Fisher's distribution; `scipy.stats`, where it has a name, is slow to load
            limit = scipy.special.fdtri(length, enough.sum() * length // 4,
                                        1.0 - CHANCE / len(firsts))
            for first, size, rows in zip(firsts, squares, count):
                if rows > length // 2 and size > 2.0 * limit * level * rows:
                    found.append((float(run.t[first]), float(run.t[first + length - 1])))
    return _merged(found)


def _merged(spans: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    merged: list[tuple[float, float]] = []
    for start, end in sorted(spans):
        if merged and start <= merged[-1][1] + BURST:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return tuple(merged)
