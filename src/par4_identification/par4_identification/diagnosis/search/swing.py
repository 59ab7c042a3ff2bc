"""A search for the compliances of transmissions, whose resonances make the fit far from linear."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

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
from par4_identification.diagnosis.search.first_look import Look

COARSE_STEP = 2
"""Samples from step to step of the integration while resonances are wide."""
ROUNDS, TRIALS = 5, 20
"""Of descents from where the last one came to; of compliances in one of them."""
SETTLED = 1e-4
"""Share of the squares that a last step gains."""
IN_BAND = 0.7
"""Highest resonance whose damping is told, over the frequency to which encoders tell the motion."""
BOUNDS = dict(zip(COMMON, (DAMPING_RATIOS, MOTOR_SHARES)))
ENDED = {'damping_ratio': (0.0, 0.99 * DAMPING_RATIOS[1]),
         'motor_share': (1.01 * MOTOR_SHARES[0], 0.99 * MOTOR_SHARES[1])}
"""Within these a search has not ended at a bound: what does is none that the data tell."""
WIDE = Drive(0.15, USUAL.motor_share)
"""What transmissions have in common on the way from a first look: the basin of a narrow resonance
does not reach as far. Where wide ones leave more than rigid transmissions do, narrow ones are not
tried."""
ALIKE = 0.1
"""Change of a compliance, over the largest, up to which two first looks are alike."""
RIGID, LEAST, LINEAR = 2.0, 1e-3, 10.0
"""Compliance of a joint that is taken for rigid, at the most; least one in a descent; and that from
which on a descent goes by its logarithm. Over that of the stiffest transmission that is believed.
"""
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
        first_look: compliances (J,) of the first look from which the search came here.
    """

    compliance: np.ndarray
    squares: float
    first_look: np.ndarray
    told: dict[str, float] = field(default_factory=dict)


def swing_in(projection: Projection, look: Look, price: float, known: Sequence[Swing] = ()
             ) -> Swing:
    """Return the transmissions that twist, by the torque that they leave in a projection.

    Args:
        projection: whose residual is the target.
        look: first one at it.
        price: twice the gain that a damping ratio or a motor share other than the usual one must be
            worth.
        known: results beside other causes, or with another nominal torque. A descent begins at the
            last one whose first look was most like this one. If it was not alike, the better of
            this descent and one from the look is the answer.
    """
    twisting = _Twisting(projection)

    def begun_anew() -> Swing:
        seen = Swing(look.compliance, 0.0, look.compliance)
        wide = twisting.descended(seen, WIDE)
        return twisting.freed(twisting.descended(seen), price) if wide.squares > 0.0 else wide

    if not known:
        return begun_anew()
    closest = min(reversed(known), key=lambda swing: _change(swing.first_look, look.compliance))
    begun = np.where(closest.compliance > 0.0, closest.compliance, look.compliance)
    again = twisting.freed(twisting.descended_from(replace(
        closest, compliance=begun, first_look=look.compliance)), price)
    if _change(closest.first_look, look.compliance) <= ALIKE:
        return again
    return max(again, begun_anew(), key=lambda found: found.squares)


class _Twisting:
    """What is left of the target of a projection beside transmissions that twist."""

    def __init__(self, projection: Projection) -> None:
        self._projection = projection
        self._evidence = projection.evidence
        runs = projection.evidence.observations.runs
        self._springs = {id(run.state): Springs(run.state) for run in runs}
        self._joints = projection.evidence.observations.joints
        self._believed = stiffnesses_of(runs[0].state)
        self._least, self._linear = (share / self._believed[1] for share in (LEAST, LINEAR))

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
        scale = np.append(np.full(len(free), self._linear), believed[0, len(free):])
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


def _change(before: np.ndarray, after: np.ndarray) -> float:
    """Return the largest change of compliances (J,), over the largest of them."""
    return float(np.max(np.abs(after - before)) / np.max(after))


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
    return COARSE_STEP if drive == WIDE else 1


def _square(values: np.ndarray) -> float:
    return float(values @ values)
