"""Values of loads that swing on their transmissions, without what encoder counts make of them.

A load amplifies at its resonance what the encoder of its motor misreads. The model's torque then
holds a swing that the machine's does not have. Least squares make it small, by more damping than
the machine has: twice as much where the counts are 48 urad and the load swings at 65 Hz. The
noise-free derivative of the squares is known: the machine's motion is read again by encoders whose
counts lie elsewhere, and what they make of the derivative is taken out of it (corrected score,
Nakamura 1990).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from par4_dynamics.effects.elastic_transmission import (
    COMMON,
    ElasticTransmission,
    drive_of,
)
from par4_dynamics.effects.springs import Drive, Springs
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.dithered import Dithered, delivered
from par4_identification.diagnosis.evidence.doubt import with_doubt
from par4_identification.diagnosis.evidence.estimates import told_values
from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.projection import Projection
from par4_identification.diagnosis.search.causes import Hypotheses, others_of
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.search.swing import BOUNDS, stiffnesses_of
from par4_identification.diagnosis.verdict.answer import Cause

STEPS, LONGEST = 8, 0.3
"""Of the descent, and its longest step in the logarithm of a compliance or of the damping."""
TOLD_WITHIN = 0.2
"""Standard deviation of a logarithm up to which these rows tell the value; others stay."""
TWISTS = 4.0
"""Compliance over that of the stiffest transmission from which on a joint twists."""
SMALL, SETTLED = 0.1, 0.1
"""Step over its own standard deviation, and over the way so far, that is the last."""
WRONG = 0.5
"""Share of the correction that may be wrong."""
KEPT = 0.5
"""Least share of what a cause explains of rows held out that it explains with other values. Counts
are a small part of a torque; what takes more away is a descent that ran into a resonance."""

Moved = tuple[Hypothesis, Hypothesis]
"""A cause as least squares have it, and as it is told."""


def without_count_bias(search: Search, model: Hypotheses) -> tuple[Hypotheses, list[Moved]]:
    """Return a model whose swinging loads have unbiased values, and what was changed.

    Nothing is, where the noise of the positions is not known.
    """
    changed: list[Moved] = []
    for item in model:
        others = others_of(model, item)
        told = unbiased(item, search.weighing.beside(others), search.belief.dithered)
        if told is not None and search.belief.objection(told, others) is None and (
                search.weighing.gains(told, others)[1]
                > KEPT * search.weighing.gains(item, others)[1]):
            model = tuple(told if other is item else other for other in model)
            changed.append((item, told))
    return model, changed


def with_doubt_of_counts(search: Search, causes: Sequence[Cause], named: Sequence[Hypothesis],
                         changed: Sequence[Moved]) -> list[Cause]:
    """Return causes with deviations that include what a correction may have got wrong.

    Args:
        search: of the causes.
        causes: of the named hypotheses, in their order.
        named: these.
        changed: see `without_count_bias`.
    """
    result = list(causes)
    for before, told in changed:
        if told not in named:
            continue
        index = list(named).index(told)
        biased = [before if item is told else item for item in named]
        fit = search.weighing.corrected(search.pool.solution(biased))
        result[index] = replace(result[index], parameters=with_doubt(
            result[index].parameters,
            told_values(search.pool.evidence, before, fit, index), WRONG))
    return result


def unbiased(item: Hypothesis, projection: Projection, dithered: Dithered) -> Hypothesis | None:
    """Return a cause with other compliances, damping and share, None if nothing is to change.

    That is where nothing swings or counts are not known. A step of the descent that turns back is
    halved, and so are all that follow it: what counts do to the slopes is not in its matrix. Less
    damping makes what is misread swing more, so that the descent may run away: its first step is
    the answer then.

    Args:
        item: the cause, as least squares have it.
        projection: what the other causes leave of the fitted rows.
        dithered: the motion as encoders could have read it whose counts lie elsewhere.
    """
    if not isinstance(item.effect, ElasticTransmission) or not dithered.draws:
        return None
    evidence, loads = projection.evidence, _Loads(item, item.effect, projection.evidence)
    rigid = [draw[:, 0] for draw in dithered.noise(evidence, delivered)]
    change = last = np.zeros(loads.count)
    moves, pace = np.ones(loads.count, dtype=bool), 1.0
    way: list[np.ndarray] = []
    for _ in range(STEPS):
        torque = partial(loads.torque, change)
        here = projection.rest(np.concatenate(evidence.whitener.whiten(
            [run.rows(torque(run.state)) for run in evidence.observations.runs])))
        slopes = here[:, 1:]
        score = slopes.T @ (projection.residual - here[:, 0])
        for noise, of_rigid in zip(dithered.noise(evidence, torque), rigid):
            score += (slopes + projection.rest(noise[:, 1:])).T @ (
                noise[:, 0] + of_rigid) / len(rigid)
        gram = slopes.T @ slopes
        if not way:
            whole = np.linalg.pinv(gram, rcond=1e-12, hermitian=True)
            moves = loads.twist & (np.sqrt(np.diag(whole)) < TOLD_WITHIN)
            if not moves.any():
                return None
        step = np.zeros(loads.count)
        step[moves] = np.linalg.pinv(gram[np.ix_(moves, moves)], rcond=1e-12,
                                     hermitian=True) @ score[moves]
        if step @ gram @ last < 0.0:
            pace *= 0.5
        last = step
        change = loads.possible(change + np.clip(pace * step, -LONGEST, LONGEST))
        way.append(change)
        if last @ gram @ last < SMALL ** 2 * moves.sum() + SETTLED ** 2 * change @ gram @ change:
            return loads.told(change)
    return loads.told(way[0])


class _Loads:
    """Loads that swing, as functions of the logarithms of their numbers.

    These are the compliances, and the damping ratio and the motor share if they are told.

    Args:
        item: the cause that they begin with.
        effect: its own.
        evidence: the rows.

    Attributes:
        count: of logarithms, the last ones those of what the transmissions have in common.
        twist: which of them may change: that of a joint that is all but rigid may not, (count,).
    """

    def __init__(self, item: Hypothesis, effect: ElasticTransmission, evidence: Evidence) -> None:
        self._item, self._effect = item, effect
        self._start = effect.exact_at(item.shape, evidence.observations.joints)
        self._twisting = np.flatnonzero(self._start > 0.0)
        self._drive = drive_of(item.shape)
        self._common = [name for name in COMMON if name in item.shape]
        self._springs: dict[int, Springs] = {}
        _, stiff = stiffnesses_of(evidence.observations.runs[0].state)
        self.count = len(self._twisting) + len(self._common)
        self.twist = np.append(self._start[self._twisting] > TWISTS / stiff,
                               np.full(len(self._common), True))

    def torque(self, change: np.ndarray, state: State) -> np.ndarray:
        """Return the torque of a motion at a change (count,), and its slopes there.

        They are (n, J, 1 + count), N m, the torque first.
        """
        if id(state) not in self._springs:
            self._springs[id(state)] = Springs(state)
        springs, values = self._springs[id(state)], self._values(change)
        told = [*self._twisting, *(state.joints + COMMON.index(name) for name in self._common)]
        return np.concatenate((springs.torque(*values)[1][..., None],
                               springs.slopes(*values)[..., told]), axis=-1)

    def possible(self, change: np.ndarray) -> np.ndarray:
        """Return a change (count,) whose damping and share are ones of a transmission."""
        changed = change.copy()
        for number, name in enumerate(self._common, len(self._twisting)):
            changed[number] = np.clip(
                change[number], *np.log(np.array(BOUNDS[name]) / getattr(self._drive, name)))
        return changed

    def told(self, change: np.ndarray) -> Hypothesis:
        """Return the cause at a change."""
        compliance, drive = self._values(change)
        shape = self._effect.expansion(
            compliance, {name: getattr(drive, name) for name in self._common})
        sets = self._item.sets
        return replace(self._item, shape=shape if sets is None
                       else self._effect.shape_of_sets(shape, sets))

    def _values(self, change: np.ndarray) -> tuple[np.ndarray, Drive]:
        compliance = self._start.copy()
        twisting = len(self._twisting)
        compliance[self._twisting] *= np.exp(change[:twisting])
        return compliance, replace(self._drive, **{
            name: getattr(self._drive, name) * float(np.exp(more))
            for name, more in zip(self._common, change[twisting:])})
