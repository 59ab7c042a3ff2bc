"""A search for the compliances of transmissions, whose resonances make the fit far from linear."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import scipy

from par4_dynamics.effects.elastic_transmission import (
    COMMON,
    DAMPING_RATIOS,
    MOTOR_SHARES,
    ElasticTransmission,
    believed_stiffnesses,
)
from par4_dynamics.effects.springs import USUAL, Drive, Springs
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.kind import Key
from par4_identification.diagnosis.evidence.projection import Projection

TRIED = 19
"""Compliances of a joint that are tried: a resonance apart at the coarse damping."""
VISIBLE = 10.0
"""The stiffest of them over the stiffest that is believed."""
COARSE_DAMPING = 0.4
"""Ratio in the first search: wide resonances overlap, and so do the basins of the fit."""
COARSE_STEP = 2
"""Samples from step to step of the integration in the first search."""
LOWER_BAND = 0.5
"""Share of the frequencies of rows, the lower ones, in which counts swing a load much less."""
PROMISED, NEAR = 0.2, 0.5
"""Shares of the gain that is wanted: which a first look must promise to be followed, and which it
must promise, or compliances alone be worth, for numbers in common to be looked at. Where springs
were found, the first look promised a quarter at the least; where there were none, up to a third."""
SWEEPS, ROUNDS, TRIALS = 3, 5, 20
"""Of the first look over the joints; of descents from where the last one came to; of compliances
in one of them."""
SETTLED = 1e-4
"""Share of the squares that a last step gains."""
IN_BAND = 0.7
"""Highest resonance whose damping is told, over the frequency to which encoders tell the motion."""
BOUNDS = dict(zip(COMMON, (DAMPING_RATIOS, MOTOR_SHARES)))
ENDED = {'damping_ratio': (0.0, 0.99 * DAMPING_RATIOS[1]),
         'motor_share': (1.01 * MOTOR_SHARES[0], 0.99 * MOTOR_SHARES[1])}
"""Within these a search has not ended at a bound: what does is none that the data tell."""
COARSE = tuple(Drive(COARSE_DAMPING, share) for share in (USUAL.motor_share, 0.75))
"""What transmissions have in common in the first look."""
NARROWER = Drive(0.15, USUAL.motor_share)
"""The same on the way from there: the basin of a narrow resonance does not reach as far."""
RIGID, LEAST = 2.0, 1e-3
"""Compliance of a joint that is taken for rigid, at the most, and least compliance in a descent;
over that of the stiffest transmission that is believed."""
AT_BOUND = 1e-6
"""Of x, for a value a sinh(x): a logarithm where it is large, in proportion where it is small, as
torques are. What starts as near to its bound starts there. A step that ends at a bound just ahead
is none, and the descent would end with it."""
DIGITS = 9
"""Of x, so that a torque that was computed at a trial is found again."""
WIDEST, SHORTEST = 0.7, 1e-4
"""First step of x at the most, and share of it below which a step ends a descent."""


@dataclass(frozen=True)
class Swing:
    """Transmissions that twist.

    Attributes:
        compliance: (J,), rad/(N m).
        told: damping ratio and motor share by their names, where the data tell them from the usual
            ones.
        squares: twice the gain in log-likelihood with the torque as large as these make it, so
            that noise in the columns cannot pass as a twist of another size or sign.
        first_look: number of the compliance that a first look chose for each joint, None where it
            is rigid. Where the descent began.
    """

    compliance: np.ndarray
    squares: float
    first_look: tuple[int | None, ...]
    told: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Look:
    """What a first look at transmissions that twist promises, as if no joint moved another.

    Attributes:
        chosen: number of the compliance tried of each joint, None where it is rigid.
        squares: twice the gain in log-likelihood.
        alone: the same as `chosen` of the one joint that explains most if all others are rigid.
        drive: what the transmissions have in common.
    """

    chosen: tuple[int | None, ...]
    squares: float
    alone: tuple[int | None, ...]
    drive: Drive


def first_look(projection: Projection, band: float = 1.0) -> Look:
    """Return which of the compliances tried explain most of the torque left in a projection.

    `band` is the share of the frequencies that is looked at, from zero on.
    """
    return _Twisting(projection).first_look(band)


def swing_in(projection: Projection, look: Look, price: float, known: Swing | None = None,
             wanted: float = 0.0) -> Swing:
    """Return the transmissions that twist, by the torque that they leave in a projection.

    Args:
        projection: whose residual is the target.
        look: first one at it.
        price: twice the gain that a damping ratio or a motor share other than the usual one must be
            worth.
        known: result beside other causes, or with another nominal torque. The descent begins
            there. Its end is the answer if it leaves less than the first look promises, or if that
            look chooses as it did then, which is much quicker. If not, the better of two descents
            is.
        wanted: twice the gain of which the first look must promise, or compliances alone be worth,
            `NEAR` for the other numbers to be looked at.
    """
    twisting, chosen = _Twisting(projection), look.chosen

    def told(found: Swing) -> Swing:
        near = max(found.squares, look.squares) > NEAR * wanted
        return twisting.freed(found, price) if near else found

    again = None
    if known is not None:
        again = told(twisting.descended_from(replace(known, first_look=chosen)))
        if again.squares > look.squares or known.first_look == chosen:
            return again
    best = told(twisting.descended_anew(look))
    return best if again is None or again.squares < best.squares else again


def swing_below(projection: Projection, least: float) -> Swing | None:
    """Return the transmissions that twist by the lower frequencies of the rows alone, roughly.

    These tell soft transmissions whose resonance, where encoder counts swing the loads, leaves more
    of all rows than a rigid machine does. None if a first look at them promises too little.

    Args:
        projection: whose residual is the target.
        least: twice the gain in log-likelihood that the first look must promise.
    """
    twisting = _Twisting(projection)
    look = twisting.first_look(LOWER_BAND)
    return Swing(twisting.tried(look.chosen), look.squares, look.chosen) if (
        look.squares > least) else None


class _Twisting:
    """What is left of the target of a projection beside transmissions that twist."""

    def __init__(self, projection: Projection) -> None:
        self._projection = projection
        self._evidence = projection.evidence
        runs = projection.evidence.observations.runs
        self._springs = {id(run.state): Springs(run.state) for run in runs}
        self._joints = projection.evidence.observations.joints
        self._believed = stiffnesses_of(runs[0].state)
        self._least = LEAST / self._believed[1]
        soft, stiff = self._believed
        self._grid = np.geomspace(VISIBLE / stiff, 1.0 / soft, TRIED)

    def first_look(self, band: float) -> Look:
        """Return what `first_look` does."""
        single = np.concatenate([self._grid[:, None] * unit for unit in np.eye(self._joints)])
        target = self._lower(self._projection.residual, band)
        looks = [Look(*_first_look(self._lower(self._projection.rest(
            self._torques(single, drive)), band), target, self._joints), drive)
            for drive in COARSE]
        return max(looks, key=lambda look: look.squares)

    def tried(self, chosen: tuple[int | None, ...]) -> np.ndarray:
        """Return the compliances (J,) that a first look chose, those of stiff joints small."""
        return np.array([3.0 / self._believed[1] if index is None else self._grid[index]
                         for index in chosen])

    def _lower(self, rows: np.ndarray, band: float) -> np.ndarray:
        """Return the lower share of the frequencies of stacked rows (N, ...), of each joint."""
        if band == 1.0:
            return rows
        ends = self._evidence.ends
        return np.concatenate([
            scipy.fft.dct(rows[first:last], axis=0, norm='ortho')[:int(band * (last - first))]
            for first, last in pairwise(ends)])

    def descended(self, start: Swing, drive: Drive = USUAL) -> Swing:
        """Return where compliances and the numbers that `start` tells come to.

        What the first order of the twists misses changes little on the way and takes most of the
        time: it is that of where a descent began, which begins again from where it came to.
        """
        free, names = np.flatnonzero(start.compliance > 0.0), list(start.told)
        columns = [*free, *(self._joints + COMMON.index(name) for name in names)]

        def parts(trial: np.ndarray) -> tuple[np.ndarray, Drive]:
            compliance = np.zeros(self._joints)
            compliance[free] = trial[:len(free)]
            return compliance, replace(drive, **dict(zip(names, trial[len(free):].tolist())))

        believed = np.stack([np.append(np.full(len(free), compliance), [
            BOUNDS[name][side] for name in names])
            for side, compliance in enumerate((self._least, 1.0 / self._believed[0]))])
        scale = np.append(np.full(len(free), self._grid[0]), believed[0, len(free):])
        box = np.arcsinh(believed / scale)

        def values(x: np.ndarray) -> np.ndarray:
            return np.asarray(scale * np.sinh(np.round(x, DIGITS)))

        def slopes(x: np.ndarray, missed: list[np.ndarray]) -> np.ndarray:
            trial = values(x)
            return self._slopes(*parts(trial), missed, columns) * np.hypot(1.0, scale / trial)

        def onward(here: np.ndarray, missed: list[np.ndarray]) -> np.ndarray:
            return _descended(lambda x: self._left(*parts(values(x)), missed),
                              lambda x: slopes(x, missed), here, box)

        begun = np.append(start.compliance[free], list(start.told.values()))
        here = np.clip(np.arcsinh(begun / scale), *box)
        squares = self._squares(*parts(values(here)))
        for _ in range(ROUNDS):
            missed = self._missed(*parts(values(here)))
            there = onward(here, missed)
            left = self._squares(*parts(values(there)))
            gained = squares - left
            if gained > 0.0:
                here, squares = there, left
            if gained <= SETTLED * squares:
                break
        compliance, drive = parts(values(here))
        return Swing(compliance, _square(self._projection.residual) - squares, start.first_look,
                     {name: getattr(drive, name) for name in names})

    def descended_anew(self, look: Look) -> Swing:
        """Return where the compliances of a first look come to.

        Other joints may swing much as the soft one does, so that there are several minima. Joints
        are rigid to begin with where the look says so; once, all are but the one that explains most
        alone.
        """
        return max((self._by_and_by(chosen, look)
                    for chosen in dict.fromkeys((look.chosen, look.alone)) if any(
                        index is not None for index in chosen)),
                   key=lambda found: found.squares)

    def _by_and_by(self, chosen: tuple[int | None, ...], look: Look) -> Swing:
        """Return where compliances come to as resonances get narrower, at last those of all joints.
        """
        compliance = self.tried(chosen)
        soft = np.array([index is not None for index in chosen])
        found = Swing(np.where(soft, compliance, 0.0), 0.0, look.chosen)
        for drive in (look.drive, NARROWER, USUAL):
            found = self.descended(found, drive)
        return self.descended(replace(
            found, compliance=np.where(soft, found.compliance, compliance)))

    def descended_from(self, known: Swing) -> Swing:
        """Return where a swing found before comes to, without numbers that end at a bound."""
        found = self.descended(known)
        told = {name: value for name, value in found.told.items() if _is_told(name, value)}
        return found if told == found.told else self.descended(replace(found, told=told))

    def freed(self, found: Swing, price: float) -> Swing:
        """Return what also tells those numbers in common that the data tell; see `swing_in`.

        One that ends at a bound may do so for want of the other.
        """
        refused: dict[str, Swing] = {}
        for name in (*COMMON, COMMON[0]):
            if name in found.told or refused.get(name) is found or (
                    name == 'damping_ratio' and not self._rings_in_band(found)):
                continue
            more = self.descended(replace(
                found, told={**found.told, name: getattr(USUAL, name)}))
            if more.squares - found.squares > price and all(
                    _is_told(key, value) for key, value in more.told.items()):
                found = more
            else:
                refused[name] = found
        return found

    def _rings_in_band(self, found: Swing) -> bool:
        """Return whether encoders tell what the softest load does at its resonance.

        Where they do not, too little of it swings, which looks like damping.
        """
        drive = replace(USUAL, **found.told)
        return all(
            self._springs[id(run.state)].resonances(found.compliance, drive).min()
            < IN_BAND * run.state.told_hz for run in self._evidence.observations.runs)

    def _torque(self, state: State, key: Key) -> np.ndarray:
        drive, *compliance = key[1]
        return self._springs[id(state)].torque(np.array(compliance), drive, _every(drive))[1]

    def _torques(self, trials: np.ndarray, drive: Drive) -> np.ndarray:
        """Return the whitened, stacked torques (N, k) of compliances (k, J)."""
        return self._evidence.torques(
            [(ElasticTransmission, (drive, *row)) for row in trials], self._torque)

    def _squares(self, trial: np.ndarray, drive: Drive) -> float:
        """Return what the exact torque of springs leaves of the target, in squares."""
        return _square(self._projection.residual - self._projection.rest(
            self._torques(trial[None], drive)[:, 0]))

    def _missed(self, trial: np.ndarray, drive: Drive) -> list[np.ndarray]:
        """Return what the first order misses of the load's torque in each run, (n, J), N m."""
        return [springs.missed(trial, drive, _every(drive)) for springs in self._springs.values()]

    def _left(self, trial: np.ndarray, drive: Drive, missed: list[np.ndarray]) -> np.ndarray:
        return self._projection.residual + self._turned([
            springs.torque(trial, drive, _every(drive), own)[1][..., None]
            for springs, own in zip(self._springs.values(), missed)])[:, 0]

    def _slopes(self, trial: np.ndarray, drive: Drive, missed: list[np.ndarray],
                columns: list[int]) -> np.ndarray:
        return self._turned([springs.slopes(trial, drive, _every(drive), own)[..., columns]
                             for springs, own in zip(self._springs.values(), missed)])

    def _turned(self, torques: list[np.ndarray]) -> np.ndarray:
        """Return minus what the projection leaves of torques (n, J, k) in each run, (N, k)."""
        evidence = self._evidence
        return -self._projection.rest(np.concatenate(evidence.whitener.whiten([
            run.rows(own) for run, own in zip(evidence.observations.runs, torques)])))


def _is_told(name: str, value: float) -> bool:
    """Return whether the data tell a number that transmissions share: it is not at a bound."""
    lowest, highest = ENDED[name]
    return lowest < value < highest


def stiffnesses_of(state: State) -> tuple[float, float]:
    """Return the least and the greatest stiffness that is believed of a machine, N m/rad.

    `state` is a motion of it with its nominal torque.
    """
    return believed_stiffnesses(
        float(state.known.values['actuator_inertia'][0]) if state.geometry is None else None)


def without_rigid(compliance: np.ndarray, state: State) -> np.ndarray:
    """Return the compliances (J,) that a descent found, zero where the joint is rigid."""
    _, stiff = stiffnesses_of(state)
    return np.where(compliance > RIGID / stiff, compliance, 0.0)


def _first_look(alone: np.ndarray, target: np.ndarray, joints: int
                ) -> tuple[tuple[int | None, ...], float, tuple[int | None, ...]]:
    """Return which compliances explain most, and how much, if no joint moves another.

    They are the numbers of those tried, a joint each, None where it is rigid. The last are those of
    the one joint that explains most by itself.

    Args:
        alone: torque of each of `TRIED` compliances on each joint, the others rigid, (n, J * g).
        target: (n,).
        joints: J.
    """
    moment, gram = alone.T @ target, alone.T @ alone
    chosen = np.full(joints, -1)  # rigid
    squares = 0.0
    for _ in range(SWEEPS):
        for joint in range(joints):
            others = np.array([index for other, index in enumerate(chosen)
                               if other != joint and index >= 0], dtype=int)
            first = joint * TRIED
            own = np.arange(first, first + TRIED)
            rest = 2.0 * moment[others].sum() - gram[np.ix_(others, others)].sum()
            worth = (rest + 2.0 * moment[own] - gram[own, own]
                     - 2.0 * gram[np.ix_(own, others)].sum(axis=1))
            best = int(np.argmax(worth))
            chosen[joint], squares = ((own[best], float(worth[best])) if worth[best] > rest
                                      else (-1, float(rest)))
    joint, number = divmod(int(np.argmax(2.0 * moment - gram.diagonal())), TRIED)
    return (tuple(None if index < 0 else int(index) % TRIED for index in chosen), squares,
            tuple(number if own == joint else None for own in range(joints)))


def _descended(left: Callable[[np.ndarray], np.ndarray], slopes: Callable[[np.ndarray], np.ndarray],
               start: np.ndarray, believed: np.ndarray) -> np.ndarray:
    """Return the minimum x (p,) of |left|^2 near `start` (p,).

    `left` (n,) and its slopes (n, p) are those of x. `believed` has the lowest and the highest x;
    `start` lies between them.

    The box of the first step is `WIDEST`, so that the search stays in the basin where it begins.
    """
    lowest, highest = believed
    start = np.where(start < lowest + AT_BOUND, lowest, start)
    start = np.where(start > highest - AT_BOUND, highest, start)
    # around 1 in steps of `WIDEST`: the first step, and the last, are measured by where it begins
    found = scipy.optimize.least_squares(
        lambda steps: left(start + WIDEST * (steps - 1.0)), np.ones_like(start),
        lambda steps: WIDEST * slopes(start + WIDEST * (steps - 1.0)),
        method='dogbox', bounds=(1.0 + (lowest - start) / WIDEST, 1.0 + (highest - start) / WIDEST),
        ftol=SETTLED, xtol=SHORTEST, max_nfev=TRIALS)
    return start + WIDEST * (found.x - 1.0)


def _every(drive: Drive) -> int:
    """Return the samples from step to step of the integration."""
    return COARSE_STEP if drive in (*COARSE, NARROWER) else 1


def _square(values: np.ndarray) -> float:
    return float(values @ values)
