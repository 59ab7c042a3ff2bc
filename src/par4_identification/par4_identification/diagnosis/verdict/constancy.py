"""Whether a named cause has one size everywhere, as its law says.

The size of a cause, such as a stiffness or a coefficient of friction, is the same at all times and
speeds and in all places. Where it follows one of these, something else only resembles the name: a
cable that jumped is no constant torque, and a hose that is slack in half of the workspace is no
spring. A law is never quite that of a machine, so its torque may follow them a little. What a law
gets wrong is another share of it in slow stretches than in lively ones. So a size may follow how
lively the motion is, and what follows it less than that counts beside it: else a motion that begins
slowly and ends fast makes every law that is a little wrong seem to change with time.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy

from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.projection import Projection
from par4_identification.diagnosis.search.causes import Hypotheses
from par4_identification.diagnosis.search.rules import OF_PAR4
from par4_identification.diagnosis.search.search import Search
from par4_identification.signals.run import Run

STRETCH = 1.0
"""s of motion over which it is more or less lively."""

Follows = Callable[[Run], np.ndarray]
"""What a size may follow, at the rows of a run, (m, J)."""


def _along(axis: int) -> Follows:
    return lambda run: np.broadcast_to(run.rows(run.state.platform.x)[:, [axis]], run.q.shape)


FACTORS: dict[str, Follows] = {
    'time': lambda run: np.broadcast_to(run.t[:, None], run.q.shape),
    'the speed of the joint': lambda run: np.abs(run.speed),
    'the direction of the joint': lambda run: np.sign(run.speed),
    'the position of the joint': lambda run: run.q}
OF_PLATFORM: dict[str, Follows] = {
    f'the position of the platform along {name}': _along(axis) for axis, name in enumerate('xyz')}


def followed_by(search: Search, cause: Hypothesis, others: Hypotheses) -> str | None:
    """Return what the size of a named cause follows beside others, None if it is of one size.

    It follows something if on the fitted rows and, by themselves, on those held out a size that
    grows with it explains more, by the share that the torque of an unnamed cause may be wrong
    (`Rules.unnamed_error`) and by more than chance (`Rules.price`, `Rules.margin`). That share is
    larger by as much as torques of a machine may be wrong by more than those of a Par4: for its
    laws, and for how they are measured. A series over the position has no law: it has the root of
    that factor.
    """
    rules, pool = search.rules, search.pool
    fitted, heldout = (
        _shares(part, cause, others, enough) for part, enough in (
            (pool.evidence, rules.price * pool.width(cause)), (pool.heldout, rules.margin)))
    shares = {name: min(share, heldout[name]) for name, share in fitted.items()}
    most = max(shares, key=lambda name: shares[name])
    larger = (rules.named_error / OF_PAR4.named_error) ** (0.5 if cause.named.is_series else 1.0)
    share = rules.unnamed_error ** 2 * larger
    return most if shares[most] > share else None


def _liveliness(run: Run) -> np.ndarray:
    """Return the rms of each joint's speed around each row, (m, J); zero of plateaus."""
    if run.conditioning.steady:
        return np.zeros_like(run.q)
    length = max(1, round(STRETCH / run.row_time))
    squares = scipy.ndimage.uniform_filter1d(run.speed ** 2, length, axis=0, mode='nearest')
    return np.sqrt(np.maximum(squares, 0.0))


def _shares(evidence: Evidence, cause: Hypothesis, others: Hypotheses, enough: float
            ) -> dict[str, float]:
    """Return what sizes that follow something explain more, over what they explain with the cause.

    Where a size that follows how lively the motion is explains more than they, it is what they
    explain beside that. It is zero where they explain no more than `enough` log-likelihood more, if
    what is left were noise: where a model leaves more than that, columns explain some of it by
    chance.
    """
    observations = evidence.observations
    without, beside = Projection(evidence, others), Projection(evidence, (*others, cause))
    own, torque = 0.5 * (without.squares - beside.squares), evidence.columns(cause)
    noise = max(1.0, beside.squares / max(evidence.rows, 1))

    def following(factor: Follows) -> np.ndarray:
        values = [factor(run) for run in observations.runs]
        rows = np.concatenate([part[:, joint] for joint in range(observations.joints)
                               for part in values])
        return beside.rest(torque * rows[:, None])

    def gain(columns: np.ndarray) -> float:
        moment = columns.T @ beside.residual
        return 0.5 * float(moment @ np.linalg.lstsq(columns.T @ columns, moment, rcond=1e-9)[0])

    lively = following(_liveliness)
    of_lively, shares = gain(lively), {}
    for name, factor in {**FACTORS, **({} if observations.of_axis else OF_PLATFORM)}.items():
        columns = following(factor)
        more = gain(columns)
        if more < of_lively:
            more = gain(np.hstack((lively, columns))) - of_lively
        shares[name] = more / (own + more) if more > enough * noise else 0.0
    return shares
