"""The numbers that decide what gets a name; the only ones of search and verdict."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rules:
    """What a cause must show. These numbers were fixed before any study that is scored.

    A log-likelihood is half the sum of the squares of whitened rows that a cause removes. No torque
    is known exactly. A row therefore has three errors beside its noise, each of which is a share
    (rms) of a torque that the model already has. `Requirement` says how they add up.

    Attributes:
        evidence: a cause must gain as much log-likelihood on the fitted rows.
        margin: a cause must gain as much log-likelihood on held-out rows.
        price: each coefficient must be worth as much log-likelihood beside the others. So the
            explanation with the fewest coefficients, and with the fewest joints, is taken among
            equal ones.
        twin: two names whose log-likelihoods differ by no more are twins.
        equal: of two names whose log-likelihoods differ by no more the simpler one goes first.
        base_error: share (rms) of the measured torque that sampling, filters and base terms get
            wrong.
        noise_error: share of the squares of the noise by which its model may be wrong.
        named_error: share (rms) of the torque of named causes that may be wrong.
        unnamed_error: share (rms) of the torque of unnamed causes that may be wrong.
        better: log-likelihood on rows held out by which an unnamed cause must explain more than
            names, to be told in their place. The laws of a machine that nearly hold lose some tens
            to a nameless function.
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
    better: float = 0.0
    floor_excess: float = 1.6


OF_AXIS = Rules(base_error=3e-3, named_error=0.1, better=100.0)
"""Of a single axis, which may be any machine: its friction, its springs and its gaps follow the
laws of the library less closely than those of a Par4, and so does its torque, which is often a
current times a constant. Delays and lags have no such laws (`error_of`)."""
