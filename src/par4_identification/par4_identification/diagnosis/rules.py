"""What a cause must show before it gets its name."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rules:
    """What a cause must show; fixed before any scored run.

    Attributes:
        p_value: family-wise, over all effects and shapes tried.
        least_gain: least gain in log-likelihood beside the other causes; hardly less than the 50 at
            which an effect is called visible.
        holdout_gain: least share of the held-out squares, whitened, that it removes.
        least_share: least rms of what of its torque the rest of the model cannot follow, over
            that of the measured torque, on some joint; sampling and filters do not reproduce the
            torque of fast motion any better.
        agreement: least cosine between its visible torques as two interleaved halves of the fit
            rows estimate them.
        transfer: largest distance between the torques of its estimates from fit and from held-out
            rows, over the torque: a cause keeps its parameters when the motion changes.
        joint_p_value: below which a joint keeps an effect that others have.
        joint_share: least share of the effect's likelihood ratio that a joint must carry.
        twin_margin: difference of log-likelihood within which another name is as good.
        equal_margin: difference of score within which the simpler of two names goes first.
        most: number of causes at which a search ends.
        least_evidence: least share of what all causes explain that each must add: the torque of a
            strong cause is right to some percent (rms).
        least_alone: least share (rms) of a cause's visible torque that no other cause has.
        fixed_range: of the coefficients of effects whose size is known.
        sufficient_share: least share of what anything explains that the causes must explain.
        left_score: least score of an effect of the library that is no cause and yet counts as
            something left,
        left_share: and least share of it of what the causes explain.
        distortion: least ratio of what it explains alone to what it explains beside the causes.
        own_share: least share, of what two causes explain together, that is lost if each is taken
            away by itself,
        more_share: least share of three causes and more,
        most_share: and most of any number: beyond it they explain much together and little alone.
        instead_share: how much more of the held-out squares than the names a nameless function
            explains by itself, over what they do, if they only stand in for it; at least the
            margin of twins.
        remaining_gain: held-out gain of nameless blocks that counts as something left.
        ringing: share of the squares left beyond which twisting transmissions, though no cause, are
            nearer than a gap.
        most_of_rest: held-out gain of nameless blocks beyond which what is left does not rattle, or
            is more of the torque's rate than sampling leaves.
        floor_excess: residual over noise floor beyond which something is wrong though no block
            explains it.
    """

    p_value: float = 1e-3
    least_gain: float = 40.0
    holdout_gain: float = 0.01
    least_share: float = 3e-4
    agreement: float = 0.6
    transfer: float = 0.2
    joint_p_value: float = 1e-3
    joint_share: float = 0.0005
    twin_margin: float = 10.0
    equal_margin: float = 2.0
    most: int = 4
    least_evidence: float = 1.25e-3
    least_alone: float = 0.1
    fixed_range: tuple[float, float] = (0.5, 1.5)
    sufficient_share: float = 0.95
    left_score: float = 40.0
    left_share: float = 5e-4
    distortion: float = 1.25
    own_share: float = 0.15
    more_share: float = 0.5
    most_share: float = 1.25
    instead_share: float = 0.002
    remaining_gain: float = 0.004
    ringing: float = 0.3
    most_of_rest: float = 0.5
    floor_excess: float = 1.6
