"""The false causes that encoder counts make, by errors in the columns of a fit.

Positions in counts give the model's torque an error e that the measured torque does not have, so
the residual contains -e. The column Z of a cause and the columns X of the base terms are computed
from the same positions. The product of Z with the residual is therefore not that of the machine,
but differs by -(Z - X (X^T X)^-1 X^T Z)^T e (errors in variables). In this way coarse encoders on
slow motions look like rods, theta inertia, Stribeck friction, presliding or gaps. The filter of the
positions makes this zero on the mean of a log; it is more where the motion is lively and less where
it is calm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from par4_dynamics.base_terms import base_columns
from par4_dynamics.effects.effect import Shape
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.dithered import Dithered, delivered
from par4_identification.diagnosis.evidence.evidence import BASE, Evidence
from par4_identification.diagnosis.evidence.fit import Fit, corrected
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Key, key_of
from par4_identification.diagnosis.evidence.projection import Projection
from par4_identification.diagnosis.evidence.side_by_side import side_by_side

DOUBT = 2.0
"""How many times what the counts are computed to do they may do."""
NEGLIGIBLE, NEGLIGIBLE_SHARE = 1.0, 0.01
"""Log-likelihood that counts may give, or share of the cause's, without being looked at closely."""
TINY = 1e-9
"""Of the size of a column: what is left of it that the design follows."""


def counted_squares(dithered: Dithered, evidence: Evidence) -> float:
    """Return by how much the torque error that encoder counts make exceeds the noise.

    The value is in whitened squares on the rows of the evidence, the mean over the draws. It is
    positive where the noise model lacks a part of that error because unnamed functions took it
    away, since it follows the motion. It is zero if the counts are not known.
    """
    draws = dithered.noise(evidence, delivered)
    squares = float(np.mean([np.sum(draw ** 2) for draw in draws])) if draws else 0.0
    return max(squares - evidence.rows, 0.0)


@dataclass
class Counts:
    """The moments that the noise of counts gives hypotheses, each computed once.

    Args:
        dithered: the motion as encoders could have read it whose counts lie elsewhere.
    """

    dithered: Dithered
    _moments: dict[tuple[object, int], np.ndarray] = field(default_factory=dict)
    _products: dict[tuple[Key, int], np.ndarray] = field(default_factory=dict)
    _sent_back: list[list[np.ndarray]] | None = None

    def imitate(self, projection: Projection, hypothesis: Hypothesis, spare: float = 0.0) -> float:
        """Return how much of the log-likelihood of a cause, on fitted rows, counts could make.

        Their effect may be up to `DOUBT` times as large as computed. If one draw says that they
        make next to nothing, or no more than the cause can spare, the others are not computed.

        Args:
            projection: of the causes beside it.
            hypothesis: the cause.
            spare: log-likelihood that the cause may lose without another answer.
        """
        draws = len(self.dithered.draws)
        if not draws:
            return 0.0
        size, gram, moment = projection.beside(hypothesis)
        scale = np.sqrt(np.maximum(size, 1e-30))
        values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
        kept = values > TINY
        root = vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None]
        found = root.T @ moment
        added = root.T @ self.moment(projection.evidence, hypothesis, 1)
        most = DOUBT * np.linalg.norm(found) * np.linalg.norm(added)
        if most > max(NEGLIGIBLE, NEGLIGIBLE_SHARE * 0.5 * float(found @ found), spare):
            added = root.T @ self.moment(projection.evidence, hypothesis, draws)
        share = float(np.clip(-found @ added / max(added @ added, 1e-30), 0.0, DOUBT))
        without = found + share * added
        return 0.5 * float(found @ found - without @ without)

    def corrected(self, evidence: Evidence, fit: Fit) -> Fit:
        """Return a fit without the bias that counts give its values (errors in variables).

        The error that counts make in the model's torque changes the products of the columns with
        the target. The draws give that change; it is put back (Fuller, Measurement Error Models,
        1987).
        """
        draws = len(self.dithered.draws)
        if not draws:
            return fit
        moments = [self._of_base(evidence, draws)]
        for item in fit.hypotheses:
            own = np.concatenate([self._of_shape(evidence, item, shape, draws)
                                  for shape in item.effect.parts(item.shape)], axis=1)
            moments.append(_stacked(item, own))
        return corrected(evidence, fit, np.concatenate(moments))

    def moment(self, evidence: Evidence, hypothesis: Hypothesis, draws: int) -> np.ndarray:
        """Return what brings the moment (k,) of a hypothesis's columns back to the machine's.

        It is the mean of so many draws.
        """
        if (hypothesis.key, draws) not in self._moments:
            fitted = np.linalg.lstsq(sum(evidence.products(BASE, BASE)),
                                     self._of_base(evidence, draws), rcond=1e-12)[0]
            moment = np.concatenate([
                self._of_shape(evidence, hypothesis, shape, draws) - np.stack([
                    products @ fitted for products in evidence.products(
                        key_of(hypothesis.effect, shape), BASE)])
                for shape in hypothesis.effect.parts(hypothesis.shape)], axis=1)
            self._moments[hypothesis.key, draws] = _stacked(hypothesis, moment)
        return self._moments[hypothesis.key, draws]

    def _of_base(self, evidence: Evidence, draws: int) -> np.ndarray:
        """Return X^T e (p,) of the base terms, the mean of so many draws."""
        columns = partial(base_columns, terms=evidence.observations.terms)
        return self._mean(evidence, BASE, columns, draws).sum(axis=0)

    def _of_shape(self, evidence: Evidence, hypothesis: Hypothesis, shape: Shape, draws: int
                  ) -> np.ndarray:
        """Return Z^T e (J, k) of an effect's columns at a shape, the mean of so many draws."""
        effect = hypothesis.effect
        return self._mean(evidence, key_of(effect, shape), partial(effect.columns, shape=shape),
                          draws)

    def _mean(self, evidence: Evidence, key: Key, columns: Callable[[State], np.ndarray],
              draws: int) -> np.ndarray:
        errors = self._errors(evidence)
        return np.mean(side_by_side(
            lambda draw: self._of_draw(errors[draw], key, columns, draw), range(draws)), axis=0)

    def _of_draw(self, errors: Sequence[np.ndarray], key: Key,
                 columns: Callable[[State], np.ndarray], draw: int) -> np.ndarray:
        """Return Z^T e (J, k) of columns, joint by joint, in one draw; computed once for a key.

        `errors` (n, J) of each run are those that `_errors` returns for the draw.
        """
        if (key, draw) not in self._products:
            self._products[key, draw] = sum(
                np.einsum('nj,njk->jk', error, columns(moved.state))
                for error, moved in zip(errors, self.dithered.draws[draw].runs))
        return self._products[key, draw]

    def _errors(self, evidence: Evidence) -> list[list[np.ndarray]]:
        """Return e, sent back through whitening and filter, (n, J) of each run in each draw.

        Its products with columns at the samples are those of e with their whitened rows.
        """
        if self._sent_back is None:
            self._sent_back = [evidence.sent_back(draw[:, 0])
                               for draw in self.dithered.noise(evidence, delivered)]
        return self._sent_back


def _stacked(hypothesis: Hypothesis, moment: np.ndarray) -> np.ndarray:
    """Return moments (J, K) of an effect's columns in the order of a hypothesis's, (k,)."""
    own = moment[:, hypothesis.columns]
    return own.sum(axis=0) if hypothesis.effect.shared else own[list(hypothesis.joints)].ravel()
