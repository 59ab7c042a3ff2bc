"""A second diagnosis below the frequency at which loads swing on their transmissions.

A load amplifies at its resonance what the encoder of its motor misreads: counts of 48 urad become
0.1 N m where a transmission of 7,000 N m/rad hardly damps. Where that lies in the band of the rows,
no value of the stiffness leaves less than a rigid machine does, and the springs are missed, or told
with the damping that hides what the counts make of them. Below the resonance the loads lag and
amplify little by little, which the rows tell as well, and the counts swing nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from par4_dynamics.effects.elastic_transmission import ElasticTransmission
from par4_dynamics.effects.springs import USUAL, Drive, Springs
from par4_dynamics.model_from_file import torque_model
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.diagnosis.search.first_look import LOWER_BAND
from par4_identification.diagnosis.search.swing import Swing
from par4_identification.diagnosis.verdict.answer import EITHER_SIDE, Cause, Diagnosis
from par4_identification.signals.conditioning import Conditioning
from par4_kinematics.robot import Axis, Robot

IN_BAND = 2.0
"""Resonance, as it is found, over the cut-off of the torque up to which counts swing a load within
the rows."""
MOST_DAMPING = 0.06
"""Of loads that swing on transmissions; more may hide what counts make of them. A plant whose loads
had 0.08 was told to a percent, so that more is told where hardly anything is left."""
NEARLY_ALL = 0.05
"""Share of the squares that the first diagnosis leaves up to which the second leaves next to none.
Springs that were told for gaps left 0.35 and more."""


def resonance(swings: Sequence[Swing], observations: Observations) -> float | None:
    """Return the lowest resonance (Hz) of loads that a search found to swing, None if none does.

    Args:
        swings: what searches found, one after the other.
        observations: rows with their nominal torque.
    """
    found = [(swing, replace(USUAL, **swing.told)) for swing in swings]
    springs = [Springs(run.state) for run in observations.runs]
    return min((float(own.resonances(swing.compliance, drive).min())
                for own in springs for swing, drive in found), default=None)


def below_resonance(answer: Diagnosis, conditioning: Conditioning, floor_excess: float
                    ) -> Conditioning | None:
    """Return filters below the resonance of loads that may swing; None if none does in the rows.

    There is none either where nothing more than noise is left, as counts have then hidden nothing,
    and where loads bounce in a gap: that leaves more than noise, and looks like a spring where the
    bounces are too quick for the rows.
    """
    if (answer.swing_hz is None or answer.remaining.floor_excess < floor_excess
            or answer.swing_hz > IN_BAND * conditioning.torque_cutoff_hz
            or not all(cause.predictable for cause in answer.causes)):
        return None
    return replace(conditioning,
                   position_cutoff_hz=LOWER_BAND * conditioning.position_cutoff_hz,
                   torque_cutoff_hz=LOWER_BAND * conditioning.torque_cutoff_hz,
                   row_rate_hz=LOWER_BAND * conditioning.row_rate_hz)


def is_better(second: Diagnosis, first: Diagnosis, machine: Robot | Axis) -> bool:
    """Return whether a second diagnosis, below the resonance, takes the place of the first.

    It has to leave less of its held-out rows than the first would. Loads that swing in it must be
    named and damp as those of machines mostly do, unless they and the other names leave nothing and
    next to nothing of the squares. Where the first has not named them, they must leave nothing, as
    loads that bounce in a gap would not, or next to nothing and no cause without a name; else no
    more causes without a name than the first.
    If the first has found nothing, it is enough that springs come nearest to a cause: then neither
    has one that would leave less.
    """
    before, after = (_springs_of(answer.causes) for answer in (first, second))
    left = _share_left(second, first, machine)
    explains, takes_nearly_all = second.verdict == 'explained', left < NEARLY_ALL
    told = second.swing_hz is None or bool(after and explains and takes_nearly_all) or (
        any(_may_be_usual(cause, second) for cause in after)
        and (explains or bool(before and len(second.unnamed) <= len(first.unnamed))
             or (takes_nearly_all and not second.unnamed)))
    nearly = first.verdict == 'clean' and isinstance(second.remaining.nearest, ElasticTransmission)
    return nearly or (told and left < 1.0)


def _springs_of(causes: Sequence[Cause]) -> list[Cause]:
    """Return the soft transmissions among causes."""
    return [cause for cause in causes if isinstance(cause.effect, ElasticTransmission)]


def _may_be_usual(springs: Cause, answer: Diagnosis) -> bool:
    """Return whether the loads of transmissions may damp as those of machines do, by the deviation.
    """
    damping, share = (springs.parameters[name] for name in ('damping_ratio', 'motor_share'))
    least = damping.number - EITHER_SIDE * damping.deviation
    loads = Springs(answer.evidence.observations.runs[0].state)
    return float(loads.damping_of_loads(Drive(least, share.number)).mean()) <= MOST_DAMPING


def _share_left(second: Diagnosis, first: Diagnosis, machine: Robot | Axis) -> float:
    """Return what the second leaves of its held-out rows over what the first does, in squares."""
    model = torque_model(machine, first.extended_model, first.effects)
    left = np.concatenate([(run.tau - run.rows(model.torque(run.state)))[run.valid]
                           for run in second.holdout.runs])
    return float(np.mean(second.holdout.extended_rms ** 2) / np.mean(left ** 2))
