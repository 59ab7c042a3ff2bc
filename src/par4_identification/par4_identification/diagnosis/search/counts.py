"""The false causes that encoder counts make, by errors in the columns of a fit.

Positions in counts give the model's torque a noise e that the measured torque has not, so that a
residual holds -e. A column Z of a cause has a noise E of the same positions, and so has X of the
base terms, N: the moment of the cause with the residual is not that of the machine, but changed by
-(E - N (X^T X)^-1 X^T Z)^T e. Coarse encoders on slow motions look like rods, theta inertia,
Stribeck friction, presliding or gaps in this way (errors in variables, attenuation).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from par4_dynamics.base_terms import base_columns
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.evidence import (
    Evidence,
    Hypothesis,
    Projection,
    spread,
)
from par4_identification.diagnosis.search.law import Dithered, delivered

DOUBT = 2.0
"""How many times what the counts are computed to do they may do."""
TINY = 1e-9
"""Of the size of a column: what is left of it that the design follows."""


@dataclass
class Counts:
    """The moments that the noise of counts gives hypotheses, each computed once.

    Args:
        dithered: the motion as encoders could have told it that count otherwise.
    """

    dithered: Dithered
    _moments: dict[tuple[object, ...], np.ndarray] = field(default_factory=dict)
    _torque: list[np.ndarray] | None = None

    def imitate(self, projection: Projection, hypothesis: Hypothesis) -> float:
        """Return how much of the log-likelihood of a cause, on fitted rows, counts could give.

        Their effect is allowed to be anything up to `DOUBT` times what is computed.
        """
        if not self.dithered.draws:
            return 0.0
        evidence = projection.evidence
        own = evidence.columns(hypothesis)
        rest = projection.rest(own)
        gram, moment = rest.T @ rest, rest.T @ projection.residual
        scale = np.sqrt(np.maximum(np.einsum('nk,nk->k', own, own), 1e-30))
        values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
        kept = values > TINY
        root = vectors[:, kept] / np.sqrt(values[kept])
        found, added = (root.T @ (part / scale)
                        for part in (moment, self._moment(evidence, hypothesis, own)))
        share = float(np.clip(-found @ added / max(added @ added, 1e-30), 0.0, DOUBT))
        without = found + share * added
        return 0.5 * float(found @ found - without @ without)

    def _moment(self, evidence: Evidence, hypothesis: Hypothesis, own: np.ndarray) -> np.ndarray:
        """Return what brings the moment (k,) of a hypothesis's columns back to the machine's."""
        key = hypothesis.key
        if key not in self._moments:
            of_cause, of_base = self._products(evidence, hypothesis)
            base = evidence.base
            fitted = np.linalg.lstsq(base.T @ base, of_base, rcond=1e-12)[0]
            self._moments[key] = of_cause - own.T @ (base @ fitted)
        return self._moments[key]

    def _products(self, evidence: Evidence, hypothesis: Hypothesis
                  ) -> tuple[np.ndarray, np.ndarray]:
        """Return E^T e (k,) of a cause's columns and N^T e (p,) of the base columns."""
        effect, shape = hypothesis.effect, hypothesis.shape
        everywhere = tuple(range(evidence.observations.joints))
        acting = everywhere if effect.shared else hypothesis.joints

        def columns(state: State) -> np.ndarray:
            return np.concatenate((effect.columns(state, shape), base_columns(state)), axis=2)

        if self._torque is None:
            self._torque = self.dithered.noise(evidence, delivered)
        runs = evidence.observations.runs
        told = [columns(run.state) for run in runs]
        width = told[0].shape[2] - evidence.base.shape[1]
        of_cause, of_base = [], []  # of each draw
        for draw, torque in zip(self.dithered.draws, self._torque):
            noise = evidence.whitener.whiten([
                run.rows(columns(moved.state) - part)
                for run, moved, part in zip(runs, draw.runs, told)])
            of_cause.append(spread([rows[:, :width][:, hypothesis.columns] for rows in noise],
                                   acting, effect.shared).T @ torque[:, 0])
            of_base.append(spread([rows[:, width:] for rows in noise], everywhere,
                                  shared=True).T @ torque[:, 0])
        return np.mean(of_cause, axis=0), np.mean(of_base, axis=0)
