"""The fewest readings that explain the difference between two sets of base parameters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy

from par4_dynamics.base_terms import TERMS
from par4_dynamics.effects.effect import CERTAIN
from par4_identification.changes.readings import Parameters, Reading, applied, applied_sets

CHANCE = 1e-4
"""Chance, for all that is tried together, at which machines without a change show one."""
MOST = 6
"""Readings at most; beyond, everything has changed and no list of readings says what."""
READING_ERROR = 0.01
"""Share (rms) by which what a reading does may differ from what really happened: a payload is no
point, a joint that warms does not change its friction by exactly one factor."""
MAIN = 0.9
"""Share of the squares of a change that readings must explain to be told where more than chance is
left."""
EQUAL = 0.01
"""Squares within which sets explain the same; told is the one whose readings undo least of each
other: friction of a joint by a factor and less Coulomb friction is but more viscous friction."""
TWIN = 10.0
"""Difference in log-likelihood within which two readings explain alike."""
STEPS = 4
"""Of Gauss and Newton: the change is a product of factors and sums, each linear."""
KEPT = 12
"""Sets of readings from which the next larger ones are built."""
PAIRS = 2
"""Sets up to this size are tried all."""
BESIDE = 256
"""Sets that are fitted side by side."""


@dataclass(frozen=True)
class Read:
    """A reading that is part of the explanation.

    Attributes:
        reading: what happened.
        size: how much, in the reading's unit.
        std: of the size.
        p_value: chance that its gain is none, for all readings that were tried.
        twins: readings that would explain the data as well in its place.
    """

    reading: Reading
    size: float
    std: float
    p_value: float
    twins: tuple[Reading, ...]


@dataclass(frozen=True)
class Explanation:
    """What of a difference readings explain.

    Attributes:
        read: the readings, strongest first.
        p_value: chance that there is no change at all.
        left: difference that no reading follows, (J p,).
        left_std: its standard deviations, (J p,).
        left_p: chance that this is none.
    """

    read: tuple[Read, ...]
    p_value: float
    left: np.ndarray
    left_std: np.ndarray
    left_p: float

    @property
    def is_complete(self) -> bool:
        """Whether nothing beyond chance is left."""
        return self.left_p > CHANCE


def nothing_changed(size: int) -> Explanation:
    """Return the explanation where so many values cannot have changed."""
    return Explanation((), 1.0, np.zeros(size), np.zeros(size), 1.0)


@dataclass(frozen=True)
class _Fit:
    """Readings with their sizes, the squares that they leave and the covariance of the sizes."""

    chosen: tuple[int, ...]
    sizes: np.ndarray
    squares: float
    covariance: np.ndarray


class _Difference:
    """A difference in units of its chance, and how far each set of readings explains it.

    Args:
        readings: that may have happened.
        before: the parameters.
        after: values (J, p).
        covariance: of the difference, (J p, J p).
    """

    def __init__(self, readings: Sequence[Reading], before: Parameters, after: np.ndarray,
                 covariance: np.ndarray) -> None:
        self.readings, self.before, self.after = tuple(readings), before, after
        self.root = _inverse_root(covariance)
        never = np.array([name in TERMS and TERMS[name].nonnegative for name in before.terms])
        self._least = np.where((never & (before.values >= 0.0)).ravel(),
                               -CERTAIN * np.sqrt(np.diag(covariance)), -np.inf)
        self._fits: dict[tuple[int, ...], _Fit] = {}

    @property
    def none(self) -> _Fit:
        """The fit without any reading."""
        return self.fit(())

    def left(self, fit: _Fit) -> np.ndarray:
        """Return what a fit leaves of the difference, (J p,)."""
        found = applied([self.readings[index] for index in fit.chosen], fit.sizes, self.before)
        return (self.after - found).ravel()

    def way(self, fit: _Fit) -> float:
        """Return how far the readings of a fit go, each by itself, in deviations."""
        alone = (applied([self.readings[index]], [size], self.before) - self.before.values
                 for index, size in zip(fit.chosen, fit.sizes))
        return sum(float(np.linalg.norm(self.root @ move.ravel())) for move in alone)

    def fit(self, chosen: Sequence[int]) -> _Fit:
        """Return the readings of these numbers, fitted together; computed once."""
        fit, = self.fits([chosen])
        return fit

    def fits(self, sets: Iterable[Sequence[int]]) -> list[_Fit]:
        """Return what `fit` does of sets of one size, computed side by side."""
        keys = [tuple(sorted(chosen)) for chosen in sets]
        new = [key for key in dict.fromkeys(keys) if key not in self._fits]
        for begin in range(0, len(new), BESIDE):
            for fit in self._fitted(new[begin:begin + BESIDE]):
                self._fits[fit.chosen] = fit
        return [self._fits[key] for key in keys]

    def _fitted(self, sets: Sequence[tuple[int, ...]]) -> list[_Fit]:
        count = len(sets[0])
        each = [[self.readings[index] for index in chosen] for chosen in sets]
        sizes = np.zeros((len(sets), count))
        covariance = np.zeros((len(sets), count, count))
        steps = np.vstack((np.zeros(count), np.eye(count)))
        for _ in range(STEPS if count else 0):
            tried = self._applied(each, sizes[:, None] + steps)
            start = tried[:, 0]
            slopes = np.stack([tried[:, place] - start for place in range(1, 1 + count)], axis=2)
            slopes = self.root @ slopes
            scale = np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-30)
            slopes = slopes / scale
            across = slopes.transpose(0, 2, 1)
            inverse = np.linalg.pinv(across @ slopes, rcond=1e-9, hermitian=True)
            rest = self.root @ (self.after.ravel() - start)[..., None]
            sizes = sizes + (inverse @ (across @ rest))[..., 0] / scale[:, 0]
            covariance = inverse / (scale.transpose(0, 2, 1) * scale)
        told = self._applied(each, sizes)
        rest = self.root @ (self.after.ravel() - told)[..., None]
        squares = (rest.transpose(0, 2, 1) @ rest)[:, 0, 0]
        if count:  # no machine has friction that drives, nor a factor that turns over
            least = np.array([[reading.least for reading in chosen] for chosen in each])
            squares[np.any(told < self._least, axis=1) | np.any(sizes <= least, axis=1)] = np.inf
        return [_Fit(*fit) for fit in zip(sets, sizes, squares.tolist(), covariance)]

    def _applied(self, each: Sequence[Sequence[Reading]], sizes: np.ndarray) -> np.ndarray:
        """Return the values (m, ..., J p) after each of m sets of readings."""
        return applied_sets(each, sizes, self.before).reshape(*sizes.shape[:-1], -1)


def explained(readings: Sequence[Reading], before: Parameters, after: np.ndarray,
              covariance: np.ndarray) -> Explanation:
    """Return the fewest readings that explain how the parameters of a machine became others.

    A further reading is taken while the best one gains more than chance gives the best of as many
    and more than the readings before it may get wrong of what they say.

    Args:
        readings: that may have happened.
        before: the parameters.
        after: values (J, p).
        covariance: of the difference of the values, joint after joint, (J p, J p).
    """
    difference = _Difference(readings, before, after, covariance)
    nothing, size = difference.none, after.size
    p_value = _chance(nothing.squares, size)
    best = _fewest(difference)  # one direction may show what all together drown
    places = sorted(range(len(best.chosen)), key=lambda place: _without(
        difference, best, place).squares, reverse=True)  # chances of many are zero
    read = [_read(difference, best, place) for place in places]
    left = difference.left(best)
    return Explanation(tuple(read), p_value, left,
                       np.sqrt(_allowed(difference, best) * np.diag(covariance)),
                       _left_p(difference, best) if read else p_value)


def _fewest(difference: _Difference) -> _Fit:
    """Return the smallest set of readings beside which no other is worth taking.

    Where they leave more than chance, something has happened that no reading is: only those that
    explain nearly all of the change are told, if there are such, for the others may imitate it.
    """
    count = len(difference.readings)
    best_of_size = []
    best, kept = difference.none, [difference.none]
    for size in range(1, min(MOST, count, difference.after.size - 1) + 1):
        larger = (combinations(range(count), size) if size <= PAIRS else
                  {tuple(sorted((*fit.chosen, more))) for fit in kept for more in range(count)
                   if more not in fit.chosen})
        fits = sorted(difference.fits(larger), key=lambda fit: fit.squares)
        kept = fits[:KEPT]
        wrong = READING_ERROR ** 2 * (difference.none.squares - best.squares)
        needed = float(scipy.special.chdtri(1, CHANCE / count)) + wrong
        if best.squares - kept[0].squares <= needed:
            # one more may be worth nothing by itself and two much: only while chance is left
            break
        best = min((fit for fit in fits if fit.squares < fits[0].squares + EQUAL),
                   key=difference.way)
        best_of_size.append(best)
    if _left_p(difference, best) > CHANCE:
        return best
    main = (1.0 - MAIN) * difference.none.squares
    return next((fit for fit in best_of_size if fit.squares < main), difference.none)


def _allowed(difference: _Difference, fit: _Fit) -> float:
    """Return the factor on the variance by what the readings of a fit may get wrong."""
    wrong = READING_ERROR ** 2 * (difference.none.squares - fit.squares)
    return 1.0 + wrong / max(difference.after.size - len(fit.chosen), 1)


def _left_p(difference: _Difference, fit: _Fit) -> float:
    """Return the chance that what a fit leaves is none."""
    return _chance(fit.squares / _allowed(difference, fit),
                   max(difference.after.size - len(fit.chosen), 1))


def _chance(squares: float, size: int) -> float:
    """Return the chance that so many standard normal numbers have larger squares."""
    return float(scipy.special.chdtrc(size, max(squares, 0.0)))


def _without(difference: _Difference, fit: _Fit, place: int) -> _Fit:
    """Return a fit without one of its readings."""
    return difference.fit(fit.chosen[:place] + fit.chosen[place + 1:])


def _read(difference: _Difference, best: _Fit, place: int) -> Read:
    """Return one of the readings of a fit with its evidence and its twins, the nearest first."""
    without = _without(difference, best, place)
    others, gain = without.chosen, without.squares - best.squares
    count = len(difference.readings)
    twins = [index for index in range(count) if index not in best.chosen
             and difference.fit((*others, index)).squares - best.squares < 2.0 * TWIN
             and without.squares - difference.fit((*others, index)).squares > 0.5 * gain]
    twins.sort(key=lambda index: difference.fit((*others, index)).squares)
    return Read(
        difference.readings[best.chosen[place]], float(best.sizes[place]),
        float(np.sqrt(best.covariance[place, place])),
        min(1.0, count * _chance(gain, 1)),
        tuple(difference.readings[index] for index in twins))


def _inverse_root(covariance: np.ndarray) -> np.ndarray:
    """Return R with R^T R = covariance^-1; a direction without chance has a rounding of it."""
    scale = np.sqrt(np.diag(covariance))
    scale = np.where(scale > 0.0, scale, 1e-12)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    values = np.maximum(values, 1e-12 * values[-1])
    return (vectors / np.sqrt(values)).T / scale
