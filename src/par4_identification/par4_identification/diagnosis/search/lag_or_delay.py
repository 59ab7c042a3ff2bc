"""Whether a torque that is late is late by a lag or by a delay.

Both add the rate of the torque to it, so that they are alike to first order in the time. They
differ in second order, by half of the squared time of its curvature. Both are late by the same time
at all frequencies. Loads that swing or bounce are not, but look like it at one of them.

Encoder counts give the torque of the model an error e, and its rate the error de/dt. A lag
amplifies e and a delay only moves it. So least squares favour the delay if e is noise that the
counts added, and the lag if e is motion that the filter took away. The products of the columns with
these errors are known from the draws of `Dithered` and are therefore taken out of the normal
equations.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.dithered import Dithered, delivered, stacked
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.projection import Projection
from par4_identification.signals.filtering import low_pass

WRONG = 0.5
"""A lag T and a delay T differ by T^2 / 2. From this share of it on, the other law is believed; and
neither is if low frequencies have a time that differs by this share of it from that of the others.
"""
TOLD = 0.5
"""A column is judged only if at least this share of its squares is no error of counts."""
DOUBT = 0.25
"""Share of what counts are computed to do to a coefficient by which that may be wrong."""
NO_CHANCE = 10.0
"""Log-likelihood from which what differs from the law counts as no chance."""
OCTAVES = (4.0, 8.0)
"""Cut-off of the torque over a frequency that parts low ones from the others. Beside the cut-off
itself most of a rate is what counts make of it."""


def obeys(dithered: Dithered, projection: Projection, hypothesis: Hypothesis, time: float,
          inflation: float = 1.0) -> bool:
    """Return whether a torque that is `time` (s) late follows the law of an effect.

    Each of the other columns of `_orders` is fitted beside the effect's own. Its coefficient is
    0 for the true effect. That of d2(torque)/dt2 is +-time^2 / 2 for a lag in place of a delay
    or the reverse, that of low frequencies the difference of their time to that of the others.
    Without draws the answer is yes. `inflation` enlarges the variances for the errors of the
    model (`Requirement.inflation`).
    """
    if not dithered.draws:
        return True
    evidence = projection.evidence
    orders = _orders(hypothesis, evidence.observations.runs[0].conditioning.torque_cutoff_hz)
    whole = stacked(evidence, [run.rows(orders(run.state)) for run in evidence.observations.runs])
    columns = projection.rest(whole)
    if not columns[:, 0] @ columns[:, 0] > 0.0:  # it is nothing, and nothing tells its law
        return True
    told = columns.T @ columns, columns.T @ projection.residual
    (gram, moment), blurred = told, np.zeros_like(told[0])
    for torque, noise in zip(dithered.noise(evidence, delivered), dithered.noise(evidence, orders)):
        moved, alone = projection.rest(whole + noise), projection.rest(noise)
        gram = gram - moved.T @ noise / len(dithered.draws)
        moment = moment + moved.T @ torque[:, 0] / len(dithered.draws)
        blurred = blurred + alone.T @ alone / len(dithered.draws)

    def differs(column: int, size: float) -> bool:
        """Return whether a column has a coefficient that is no chance and not small to `size`.
        """
        apart = np.array((-told[0][0, column] / told[0][0, 0], 1.0))
        pair = np.ix_((0, column), (0, column))
        if apart @ (blurred - (1.0 - TOLD) * told[0])[pair] @ apart > 0.0:
            return False
        (found, gain), (before, _) = (_beside(*part, column) for part in ((gram, moment), told))
        wrong = WRONG * size + DOUBT * abs(found - before)
        return gain >= inflation * NO_CHANCE and abs(found) >= wrong

    sizes = (0.5 * time ** 2, *(abs(time) for _ in OCTAVES))
    return not any(differs(column, size) for column, size in enumerate(sizes, start=1))


def _orders(hypothesis: Hypothesis, cutoff_hz: float) -> Callable[[State], np.ndarray]:
    """Return the column of an effect, the second rate of the torque, and the low frequencies of the
    column, `OCTAVES` below a cut-off, (n, J, 2 + k).
    """

    def columns(state: State) -> np.ndarray:
        own = hypothesis.effect.columns(state, hypothesis.shape)
        bend = time_rate(state, time_rate(state, state.delivered))
        period = float(state.t[1] - state.t[0])
        return np.concatenate((own, bend[..., None], *(
            low_pass(own, cutoff_hz / octave, period) for octave in OCTAVES)), axis=2)

    return columns


def _beside(gram: np.ndarray, moment: np.ndarray, column: int) -> tuple[float, float]:
    """Return the coefficient of a column beside the first, and what it gains in log-likelihood."""
    pair = [0, column]
    both = np.linalg.solve(gram[np.ix_(pair, pair)], moment[pair])
    return float(both[1]), 0.5 * float(both @ moment[pair] - moment[0] ** 2 / gram[0, 0])
