"""When a series of estimates stepped or began to drift, with a computed rate of false alarms.

The series is a constant, perhaps with a wave of a year, plus steps, changes of slope and single odd
values. One more of these is taken while the best one, of all times and kinds, gains more in squares
than chance gives with the probability asked for. The probability of one test is that of a false
alarm over the number of kinds: the expected number of false alarms is then at most the number of
values times what was asked for, whatever the tests have in common (Bonferroni). The scatter from
value to value beyond the stated deviations is measured on what is left, and so is its memory.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy

BreakKind = Literal['step', 'slope', 'both', 'odd']
KINDS: tuple[BreakKind, ...] = ('step', 'slope', 'both', 'odd')
LASTING: tuple[BreakKind, ...] = ('step', 'slope', 'both')
YEAR = 365.25
"""Days."""
WHOLE = 0.8 * YEAR
"""Days that a series must span before a wave of a year is told from a drift."""
FEWEST = 6
"""Values, below which nothing is looked for."""
MOST = 12
"""Breaks of a series."""
ROUNDS = 4
"""In which breaks are moved to where they explain most beside the others."""


@dataclass(frozen=True)
class Break:
    """A place where a series changes.

    Attributes:
        index: of the first value after it; of a drift that of the last value before it.
        kind: 'step', 'slope', 'both' or 'odd' (one value that does not belong).
        step: of the level, 0 for a slope.
        slope: change of the slope, a day, 0 for a step.
        std: standard deviations of step and slope.
    """

    index: int
    kind: BreakKind
    step: float = 0.0
    slope: float = 0.0
    std: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Course:
    """A series as steps and drifts.

    Attributes:
        breaks: in order of time, odd values among them.
        fitted: values of the course, (n,), without the wave of a year and odd values.
        wave: of a year, (n,).
        scatter: standard deviation of a value beyond its own.
    """

    breaks: tuple[Break, ...]
    fitted: np.ndarray
    wave: np.ndarray
    scatter: float

    @property
    def changes(self) -> tuple[Break, ...]:
        """The breaks without odd values."""
        return tuple(item for item in self.breaks if item.kind != 'odd')


@dataclass(frozen=True)
class _Series:
    """Weighted values and the columns that every course has."""

    t: np.ndarray
    values: np.ndarray
    sigma: np.ndarray
    fixed: np.ndarray

    def columns(self, item: Break) -> np.ndarray:
        """Return the columns (n, 1 or 2) of a break."""
        places = np.arange(len(self.t))
        step = (places >= item.index).astype(float)
        slope = np.maximum(self.t - self.t[item.index], 0.0)
        return np.stack({'step': (step,), 'slope': (slope,), 'both': (step, slope),
                         'odd': ((places == item.index).astype(float),)}[item.kind], axis=1)

    def design(self, breaks: list[Break]) -> np.ndarray:
        """Return all columns, weighted."""
        parts = [self.fixed, *(self.columns(item) for item in breaks)]
        return np.hstack(parts) / self.sigma[:, None]

    def solved(self, breaks: list[Break]) -> tuple[np.ndarray, float, int]:
        """Return values of the columns, squares that are left and degrees of freedom."""
        design, target = self.design(breaks), self.values / self.sigma
        scale = np.maximum(np.linalg.norm(design, axis=0), 1e-30)
        found, _, rank, _ = np.linalg.lstsq(design / scale, target, rcond=1e-10)
        left = target - (design / scale) @ found
        return found / scale, float(left @ left), len(target) - int(rank)


def course_of(t: np.ndarray, values: np.ndarray, std: np.ndarray, chance: float,
              yearly: bool = False) -> Course:
    """Return where a series steps and drifts; a constant where no value is in any doubt.

    Args:
        t: days, increasing, (n,).
        values: (n,).
        std: their standard deviations, (n,).
        chance: of a false alarm, a value of the series.
        yearly: whether it may have a wave of a year, which is no change.
    """
    count = len(t)
    fixed = np.ones((count, 1))
    if yearly and count and t[-1] - t[0] > WHOLE:
        phase = 2.0 * np.pi * t / YEAR
        fixed = np.stack((np.ones(count), np.sin(phase), np.cos(phase)), axis=1)
    scatter = _first_scatter(values, std)
    sigma = np.hypot(std, scatter)
    if count and not sigma.any():
        return Course((), np.full(count, np.median(values)), np.zeros(count), 0.0)
    series = _Series(t, values, sigma, fixed)
    breaks: list[Break] = []
    if count >= FEWEST:
        for _ in range(2):  # the scatter is known once the breaks are
            breaks = _breaks(series, chance)
            scatter, memory = _scatter(series, breaks, std)
            wide = np.sqrt((1.0 + memory) / (1.0 - memory))
            series = replace(series, sigma=wide * np.hypot(std, scatter))
        breaks = _breaks(series, chance)
    return _course(series, breaks, scatter)


def _first_scatter(values: np.ndarray, std: np.ndarray) -> float:
    """Return the scatter that differences of neighbours show beyond their deviations."""
    if len(values) < 3:
        return 0.0
    spread = np.median(np.abs(np.diff(values))) / 0.6745 / np.sqrt(2.0)
    return float(np.sqrt(max(spread ** 2 - np.median(std) ** 2, 0.0)))


def _scatter(series: _Series, breaks: list[Break], std: np.ndarray) -> tuple[float, float]:
    """Return scatter beyond the deviations and its correlation from value to value, 0 to 0.9."""
    found, _, freedom = series.solved(breaks)
    left = series.values - (series.design(breaks) @ found) * series.sigma
    variance = float(left @ left) / max(freedom, 1)
    memory = float(left[1:] @ left[:-1] / max(left @ left, 1e-300))
    bound = 2.0 / np.sqrt(len(left))  # what chance gives
    return (float(np.sqrt(max(variance - np.mean(std ** 2), 0.0))),
            min(memory, 0.9) if memory > bound else 0.0)


def _breaks(series: _Series, chance: float) -> list[Break]:
    """Return the breaks that gain more than chance gives.

    A drift may be taken for many odd values, and one odd value for two steps: of a search that
    begins with lasting changes and one that takes all kinds the one that explains more is right.
    """
    each = chance / len(KINDS)
    lasting = _grown(series, [], each, LASTING)
    found = [_grown(series, start, each, KINDS) for start in (lasting, [])]
    costs = [_cost(series, breaks, each) for breaks in found]
    return sorted(found[costs.index(min(costs))], key=lambda item: item.index)


def _cost(series: _Series, breaks: list[Break], each: float) -> float:
    """Return the squares that breaks leave and those that chance would give as many of them."""
    _, left, freedom = series.solved(breaks)
    return left + sum(_needed(2 if item.kind == 'both' else 1, freedom, each) for item in breaks)


def _grown(series: _Series, start: list[Break], each: float, kinds: tuple[BreakKind, ...]
           ) -> list[Break]:
    """Return breaks to which those worth taking are added, and of which the others are dropped."""
    breaks = list(start)
    while len(breaks) < MOST:
        worth, best = _best(series, breaks, each, kinds)
        if best is None or worth <= 0.0:
            break
        breaks = _moved(series, [*breaks, best], each, kinds)
    dropped = True
    while dropped and breaks:
        worths = [_worth(series, [*breaks[:place], *breaks[place + 1:]], item, each)
                  for place, item in enumerate(breaks)]
        weakest = int(np.argmin(worths))
        dropped = worths[weakest] <= 0.0
        if dropped:
            breaks.pop(weakest)
    return breaks


def _moved(series: _Series, breaks: list[Break], each: float, kinds: tuple[BreakKind, ...]
           ) -> list[Break]:
    """Return the breaks, each where and of the kind that explains most beside the others."""
    for _ in range(ROUNDS):
        before = list(breaks)
        for place in range(len(breaks)):
            others = [*breaks[:place], *breaks[place + 1:]]
            worth, best = _best(series, others, each, kinds)
            if best is not None and worth > _worth(series, others, breaks[place], each) + 1e-9:
                breaks[place] = best
        if breaks == before:
            break
    return breaks


def _worth(series: _Series, others: list[Break], item: Break, each: float) -> float:
    """Return what a break gains in squares beyond what chance gives."""
    _, before, _ = series.solved(others)
    _, after, freedom = series.solved([*others, item])
    own = 2 if item.kind == 'both' else 1
    return before - after - _needed(own, freedom, each)


def _needed(own: int, freedom: int, each: float) -> float:
    """Return the gain in squares of unit variance that chance exceeds with a probability."""
    return own * float(scipy.stats.f.isf(each, own, max(freedom, 1)))


def _best(series: _Series, others: list[Break], each: float, kinds: tuple[BreakKind, ...]
          ) -> tuple[float, Break | None]:
    """Return the break that gains most beside others, with its gain beyond chance."""
    basis, _ = np.linalg.qr(_regular(series.design(others)))
    target = series.values / series.sigma
    left = target - basis @ (basis.T @ target)
    freedom = len(target) - basis.shape[1] - 2
    if freedom < 1:
        return 0.0, None
    count = len(series.t)
    places = np.arange(count)
    columns = {
        'step': (places[:, None] >= places).astype(float),
        'slope': np.maximum(series.t[:, None] - series.t, 0.0),
        'odd': np.eye(count)}
    rests, gains = {}, {}
    for kind, block in columns.items():
        block = block / series.sigma[:, None]
        rest = block - basis @ (basis.T @ block)
        size = np.sum(rest ** 2, axis=0)
        told = size > 1e-9 * np.maximum(np.sum(block ** 2, axis=0), 1e-300)
        rests[kind] = rest
        gains[kind] = np.where(told, (left @ rest) ** 2 / np.where(told, size, 1.0), 0.0)
    gains['both'] = _gain_of_two(rests['step'], rests['slope'], left)
    # a step needs a value on either side, a drift two after it
    for kind, least, most in (('step', 1, count), ('slope', 0, count - 2), ('both', 1, count - 2)):
        gains[kind][:least] = gains[kind][most:] = 0.0
    for item in others:
        if item.kind == 'odd':  # two beside each other are a change
            gains['odd'][max(item.index - 1, 0):item.index + 2] = 0.0
    found: tuple[float, Break | None] = (0.0, None)
    for kind in kinds:
        index = int(np.argmax(gains[kind]))
        worth = float(gains[kind][index]) - _needed(2 if kind == 'both' else 1, freedom, each)
        if worth > found[0]:
            found = (worth, Break(index, kind))
    return found


def _regular(design: np.ndarray) -> np.ndarray:
    """Return columns of unit length."""
    return design / np.maximum(np.linalg.norm(design, axis=0), 1e-30)


def _gain_of_two(first: np.ndarray, second: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Return the squares that pairs of columns (n, k) take of what is left, (k,)."""
    aa, bb, ab = (np.sum(x * y, axis=0) for x, y in (
        (first, first), (second, second), (first, second)))
    a, b = left @ first, left @ second
    determinant = aa * bb - ab ** 2
    told = determinant > 1e-9 * np.maximum(aa * bb, 1e-300)
    gain = (bb * a ** 2 - 2.0 * ab * a * b + aa * b ** 2) / np.where(told, determinant, 1.0)
    return np.where(told, gain, 0.0)


def _course(series: _Series, breaks: list[Break], scatter: float) -> Course:
    """Return the course of breaks with their sizes."""
    design = series.design(breaks)
    found, _, _ = series.solved(breaks)
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-30)
    inverse = np.linalg.pinv((design / scale).T @ (design / scale), rcond=1e-12, hermitian=True)
    deviation = np.sqrt(np.diag(inverse)) / scale
    wave = series.fixed[:, 1:] @ found[1:series.fixed.shape[1]]
    fitted, first, sized = np.full(len(series.t), found[0]), series.fixed.shape[1], []
    for item in breaks:
        block = series.columns(item)
        own = slice(first, first + block.shape[1])
        values, std = found[own], deviation[own]
        first = own.stop
        if item.kind != 'odd':
            fitted = fitted + block @ values
        places = {'step': (0, None), 'odd': (0, None), 'slope': (None, 0), 'both': (0, 1)}
        (step, step_std), (slope, slope_std) = (
            (0.0, 0.0) if place is None else (float(values[place]), float(std[place]))
            for place in places[item.kind])
        sized.append(replace(item, step=step, slope=slope, std=(step_std, slope_std)))
    return Course(tuple(sized), fitted, wave, scatter)
