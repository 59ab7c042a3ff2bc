"""The numbers that decide what gets a name; the only ones of search and verdict."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rules:
    """What a cause must show. Fixed before any scored study.

    Log-likelihoods are of whitened rows: half the squares that something removes. The noise of a
    row has three parts beside the measured one, since no torque is known exactly: each is a share
    (rms) of a torque that the model already has. See `Requirement`.

    Attributes:
        evidence: gain in log-likelihood that a cause must have on the rows that are fitted.
        margin: gain in log-likelihood that it must have on rows that no fit has seen.
        price: log-likelihood that each coefficient must be worth beside the others; of equal
            explanations the one with the fewest coefficients, hence joints, is taken.
        twin: difference in log-likelihood within which two names explain alike.
        equal: difference in log-likelihood within which the simpler of two names goes first.
        base_error: share (rms) of the measured torque that sampling, filters and base terms get
            wrong.
        noise_error: share of the squares of the noise by which its model may be wrong.
        named_error: share (rms) of the torque of named causes that may be wrong.
        unnamed_error: share (rms) of the torque of unnamed causes that may be wrong.
        floor_excess: rms of what is left over the noise floor beyond which it is described, as
            noise that wanders, lines or bursts.
    """

    evidence: float = 25.0
    margin: float = 8.0
    price: float = 6.5
    twin: float = 10.0
    equal: float = 2.0
    base_error: float = 3e-4
    noise_error: float = 0.006
    named_error: float = 0.035
    unnamed_error: float = 0.22
    floor_excess: float = 1.6
