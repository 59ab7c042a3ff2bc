"""What a cause must gain to get a name; tests of another kind have their numbers beside them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Rules:
    """What a cause must gain. These numbers were fixed before any study that is scored.

    The log-likelihood that a cause gains is half the sum of squares of whitened rows that it
    removes. No torque is known exactly. So a row has four errors besides its noise, each of which
    is a share (rms) of a torque: the measured one, that of the named and of the unnamed causes, and
    what encoder counts make of the model's. `Requirement` says how they add up.

    Attributes:
        evidence: log-likelihood that a cause must gain on the fitted rows.
        margin: log-likelihood that a cause must gain on held-out rows; an unnamed one twice as
            much.
        price: log-likelihood that each coefficient must be worth beside the others. So the
            explanation with the fewest coefficients and joints is taken among equal ones.
        twin: largest difference of the log-likelihoods of two names that are twins.
        base_error: share (rms) of the measured torque that sampling, filters and base terms get
            wrong.
        noise_error: share of the squares of the noise by which its model may be wrong.
        named_error: share (rms) of the torque of named causes that may be wrong.
        unnamed_error: share (rms) that may be wrong of the torque of unnamed causes, and of what
            encoder counts make of the model's torque.
        better: log-likelihood on held-out rows by which an unnamed cause must explain more than
            names, to be told in their place. A law that nearly holds on a machine explains some
            tens less than an unnamed function.
        floor_excess: ratio of the rms of the remainder to the noise floor above which the
            remainder is described, as noise that wanders, lines or bursts.
    """

    evidence: float = 25.0
    margin: float = 8.0
    price: float = 6.5
    twin: float = 10.0
    base_error: float = 3e-4
    noise_error: float = 0.006
    named_error: float = 0.035
    unnamed_error: float = 0.22
    better: float = 0.0
    floor_excess: float = 1.6


OF_PAR4 = Rules()
"""Rules for a Par4."""
OF_AXIS = Rules(base_error=3e-3, named_error=0.1, better=100.0)
"""Rules for a single axis. It may be any machine, so its friction, springs and gaps follow the laws
of the library less closely than those of a Par4. Its torque, often a current times a constant, is
known less exactly, too. Delays and lags keep the error of a Par4, see `error_of`."""


def rules_for(of_axis: bool) -> Rules:
    """Return the rules of a single axis or of a Par4."""
    return OF_AXIS if of_axis else OF_PAR4


def rules_of_no_cause(of_axis: bool) -> Rules:
    """Return rules by which nothing is a cause: what bodies and base friction leave is left."""
    return replace(rules_for(of_axis), evidence=math.inf, margin=math.inf)
