"""Sufficiency: do the names explain what is wrong, or do they stand in for something else?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from par4_dynamics.effects.effect import Effect
from par4_dynamics.effects.elastic_transmission import ElasticTransmission
from par4_identification.diagnosis.evidence import project, residuals, solve
from par4_identification.diagnosis.holdout import Gain
from par4_identification.diagnosis.nameless import BLOCKS, available_blocks, fit_block, ranges_of
from par4_identification.diagnosis.rules import Rules
from par4_identification.diagnosis.selection import Candidate, Found, Selection, Selector

LIKE_FILTERS = ('presliding', 'stribeck', 'actuator_lag', 'time_offset', 'elastic_transmission',
                'backlash')
"""Effects that a little of is left by every sampled and filtered record: at low speed, in time, and
of the encoders' noise."""
Verdict = Literal['clean', 'explained', 'partly_explained', 'unknown', 'unusable_data']


@dataclass(frozen=True)
class Remaining:
    """What the causes leave.

    Attributes:
        significant: whether a nameless block explains some of it on held-out rows.
        looks_like: that block.
        gain: of the best block.
        floor_excess: rms over the noise floor.
        explained_share: of all that the causes and that block explain, the share of the causes.
        instead: a nameless block that by itself explains more than the causes do.
        nearest: where nothing is named, the effect that explains most without passing as a cause.
    """

    significant: bool
    looks_like: str | None
    gain: Gain
    floor_excess: float
    explained_share: float = 1.0
    instead: str | None = None
    nearest: Effect | None = None

    @property
    def phrase(self) -> str:
        """What it looks like, in words; empty where nothing is significant."""
        return '' if self.looks_like is None else BLOCKS[self.looks_like].phrase


@dataclass(frozen=True)
class Compared:
    """A nameless block against the causes, on held-out rows.

    Attributes:
        name: of the block.
        beside: residuals (m, J) of each run after both.
        gain: of both over the causes.
        instead: whitened squares that the block leaves without the causes.
    """

    name: str
    beside: tuple[np.ndarray, ...]
    gain: Gain
    instead: float


def remaining_of(selector: Selector, found: Sequence[Found], before: Sequence[np.ndarray],
                 after: Sequence[np.ndarray], floor: np.ndarray) -> Remaining:
    """Return what remains of held-out residuals (m, J) `before` and `after` the causes found."""
    heldout, blocks, rules = selector.heldout, selector.blocks, selector.rules
    old, new = (heldout.whitened(part) for part in (before, after))
    compared = _compared(selector, found, new)
    best = max(compared, key=lambda item: item.gain.low)
    torque = sum(np.sum(np.where(run.valid, run.tau, 0.0) ** 2)
                 for run in heldout.observations.runs)
    significant = (best.gain.share > rules.remaining_gain and best.gain.low > 0.0
                   and (blocks.sums(after) - blocks.sums(best.beside)).sum()
                   > rules.least_share ** 2 * torque)
    explained = float(old @ old - new @ new)
    missing = float(new @ new) * best.gain.share if significant else 0.0
    margin = max(rules.instead_share * explained, 2.0 * rules.twin_margin)
    better = _least_left(selector, found) - margin if found else 0.0
    beaten_by = [item for item in compared
                 if item.gain.share > rules.remaining_gain and item.instead < better]
    mean_square = blocks.mean_square(after).sum()
    return Remaining(
        significant=significant, looks_like=best.name if significant else None, gain=best.gain,
        floor_excess=float(np.sqrt(mean_square / max((floor ** 2).sum(), 1e-30))),
        explained_share=explained / max(explained + missing, 1e-30) if found else 0.0,
        instead=min(beaten_by, key=lambda item: item.instead).name if beaten_by else None)


def _compared(selector: Selector, found: Sequence[Found], left: np.ndarray) -> list[Compared]:
    """Return the nameless blocks that count, `left` (N,) being what the causes leave, whitened."""
    evidence, heldout = selector.evidence, selector.heldout
    hypotheses = [item.hypothesis for item in found]
    ranges = ranges_of(evidence.observations, residuals(
        evidence.observations, hypotheses, solve(evidence, hypotheses)))
    compared = []
    for name in available_blocks(evidence.observations, hypotheses):
        fit = fit_block(BLOCKS[name], evidence, heldout.observations, hypotheses, ranges)
        gain = selector.blocks.whitened_gain(left, heldout.whitened(fit.beside))
        if BLOCKS[name].like_filters and gain.share <= selector.rules.most_of_rest:
            continue
        instead = heldout.whitened(fit.instead)
        compared.append(Compared(name, fit.beside, gain, float(instead @ instead)))
    return compared


def _least_left(selector: Selector, found: Sequence[Found]) -> float:
    """Return the least of what the causes, or a rival in place of one, leave of held-out rows."""
    hypotheses = [item.hypothesis for item in found]
    models = [hypotheses, *([*hypotheses[:index], rival, *hypotheses[index + 1:]]
                            for index, item in enumerate(found) for rival in item.rivals)]
    left = [selector.heldout.left(model, solve(selector.evidence, model)) for model in models]
    return min(float(rows @ rows) for rows in left)


def left_over(selector: Selector, selection: Selection) -> Candidate | None:
    """Return what of the library still explains most, if much, without being a cause.

    Beside the right causes nothing does, but what sampling, filters and standstill leave.
    Beside causes it counts only where it is what they get wrong of their own torque: alone it
    would explain more. Another small effect, as every machine has, is not held against them, nor
    what explains nothing of the held-out rows.
    """
    projection, base = (project(selector.evidence, part) for part in (selection.hypotheses, ()))
    named = {item.effect.name for item in selection.hypotheses}
    if ElasticTransmission.name in named:
        return None  # whose resonances are right to some percent only
    twins = {name for item in selection.found for name in item.twins}
    spared = {*named, *twins, *selection.shadows, *LIKE_FILTERS}
    least = max(selector.rules.left_score,
                selector.rules.left_share * selector.evidence_of(selection.hypotheses))
    found = []
    for name, effect in selector.library.items():
        candidate = None if name in spared else selector.best(effect, projection)
        if candidate is None or candidate.score(selector.evidence.rows) < least:
            continue
        if named and (base.gain(candidate.hypothesis)
                      < selector.rules.distortion * candidate.likelihood_ratio):
            continue
        if selector.heldout_gain(candidate.hypothesis, selection.hypotheses).share <= 0.0:
            continue
        found.append(candidate)
    return max(found, key=lambda item: item.score(selector.evidence.rows), default=None)


def own_share(selector: Selector, selection: Selection) -> float:
    """Return how much of what all causes explain is lost if each is taken away by itself.

    1 for causes that have nothing to do with each other, little for names that share what they
    explain, more for names that explain it only together.
    """
    hypotheses = selection.hypotheses
    whole = selector.evidence_of(hypotheses)
    own = sum(whole - selector.evidence_of([other for other in hypotheses if other is not item])
              for item in hypotheses)
    return own / max(whole, 1e-30)


def rings(selector: Selector, selection: Selection) -> bool:
    """Return whether transmissions that twist, no cause though, explain much of what is left."""
    effect = selector.library.get(ElasticTransmission.name)
    projection = project(selector.evidence, selection.hypotheses)
    candidate = None if effect is None else selector.best(effect, projection)
    return candidate is not None and candidate.likelihood_ratio > selector.rules.ringing * float(
        projection.residual @ projection.residual)


def verdict_of(found: Sequence[Found], remaining: Remaining, left_over: Candidate | None,
               own_share: float, rules: Rules) -> tuple[Verdict, str]:
    """Return the verdict and, where names are withheld, why.

    Args:
        found: the causes.
        remaining: what nameless blocks still find.
        left_over: what of the library still explains something without being a cause.
        own_share: of the causes, see the function of that name.
        rules: thresholds.
    """
    wrong = (remaining.significant or left_over is not None
             or remaining.floor_excess > rules.floor_excess)
    if not found:
        return ('unknown' if wrong else 'clean'), ''
    least = rules.own_share if len(found) == 2 else rules.more_share
    if len(found) > 1 and not least <= own_share <= rules.most_share:
        how = 'much the same' if own_share < least else 'only together what is wrong'
        return 'unknown', (f'the {len(found)} names found explain {how}; a cause that is not in '
                           f'the library is more likely')
    if remaining.significant and remaining.explained_share < rules.sufficient_share:
        return 'unknown', (f'the names found explain {remaining.explained_share:.0%} of what they '
                           f'and {BLOCKS[remaining.looks_like].phrase} explain together; a cause '
                           f'that is not in the library is more likely')
    if remaining.instead is not None:
        return 'unknown', (f'{BLOCKS[remaining.instead].phrase} by itself explains more than the '
                           f'names found; a cause that is not in the library is more likely')
    if left_over is not None:
        return 'unknown', (f'what the names found leave still looks like '
                           f'{left_over.hypothesis.label}, which is no cause either; a cause that '
                           f'is not in the library is more likely')
    return ('partly_explained' if wrong else 'explained'), ''
