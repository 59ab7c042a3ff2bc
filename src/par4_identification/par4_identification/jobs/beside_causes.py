"""Base parameters beside causes: where they alone come out as no machine can have them.

A torque that the model lacks, such as cogging, pulls friction below zero. What a diagnosis names is
then taken as known, and the base parameters are identified once more. If nothing mends that, the
viscous friction of an axis is left out: at few speeds, or where friction falls with the speed, it
comes out negative though all else is sound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.base_terms import FRICTION
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.diagnosis.progress import Progress
from par4_identification.diagnosis.verdict.answer import Diagnosis
from par4_identification.fitting.identification import (
    PLAIN,
    Identification,
    identify,
    what_to_do,
)
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.causes import phrase_of_causes
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.scales import Chosen, conditioning_for
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Remark
from par4_sim.report.words import capital, in_words

VISCOUS = FRICTION[1]


@dataclass(frozen=True)
class BesideCauses:
    """An identification beside named causes.

    Attributes:
        identification: with these causes, or without viscous friction.
        remark: why, and which.
    """

    identification: Identification
    remark: Remark


def beside_causes(alone: Identification, logs: Sequence[Log], machine: Robot | Axis,
                  conditioning: Conditioning, chosen: Chosen, progress: Progress
                  ) -> BesideCauses | None:
    """Return the identification beside what a diagnosis names, None if all is possible without.

    Where that does not help, it is that of an axis without viscous friction.

    Args:
        alone: base parameters of the logs without any causes.
        logs: behind it.
        machine: that was recorded.
        conditioning: of `alone`.
        chosen: what was set of the filters.
        progress: called with the name of each step.

    Raises:
        InputError: a value is impossible, and nothing mends that.
    """
    impossible = alone.impossible(machine)
    if impossible is None or alone.fitting.estimator not in PLAIN:
        return None
    progress('looking for causes of an impossible value')
    answer = diagnose(logs, machine, _with_rods(alone), progress=progress,
                      conditioning=conditioning_for(logs, machine, CONDITIONING, chosen))
    if isinstance(answer, Diagnosis) and answer.causes:
        known = answer.extended_model
        beside = identify(list(logs), machine, alone.rigid_body, conditioning=conditioning,
                          fitting=alone.fitting, beside=build_model(machine, known))
        found = replace(_widened(beside, known), causes=known.effects)
        if found.impossible(machine) is None:
            causes = phrase_of_causes(answer.causes, machine)
            return BesideCauses(found, Remark(
                False, f'Base parameters alone do not explain these data: {impossible}. So the '
                       f'model also has what par4_diagnose names: {causes}.',
                'Run par4_diagnose on these bags: its report shows how sure that is.'))
    if isinstance(machine, Axis) and impossible.startswith(VISCOUS):
        without = identify(list(logs), machine, alone.rigid_body, conditioning=conditioning,
                           fitting=alone.fitting, left_out=(VISCOUS,))
        if without.impossible(machine) is None:
            why = capital(impossible.replace(VISCOUS, in_words(VISCOUS)))
            return BesideCauses(without, Remark(
                False, f'{why}: at these speeds friction does not grow with the speed. It is left '
                       f'out and counts as zero.',
                'Record motions at several speeds in both directions.'))
    raise InputError(f'{impossible}, and so it remains beside all that par4_diagnose names; '
                     f'{what_to_do(machine)}')


def _with_rods(alone: Identification) -> ModelFile | None:
    """Return the model with which a diagnosis begins: where rods are known they are no cause.

    None for (20), which has their mass at their ends. The diagnosis fits the values anew, so that
    those of no machine are written as zero.
    """
    if alone.rigid_body == 'paper':
        return None
    parameters = dict(alone.parameters)
    for term in alone.terms:
        value = float(np.mean(parameters[term.name].value))
        parameters[term.name] = Parameter(
            value=max(value, 0.0) if term.nonnegative else value, unit=term.unit)
    return ModelFile(schema='par4/model/1', rigid_body=alone.rigid_body, parameters=parameters)


def _widened(beside: Identification, known: ModelFile) -> Identification:
    """Return an identification with the deviations of the joint fit where these are larger.

    That the causes are not known exactly is in these alone. The relative error is that of the whole
    torque.
    """
    estimate = beside.estimate
    joint = [np.max(np.asarray(known.parameters[label.name].std or 0.0, dtype=float))
             if label.name in known.parameters else 0.0 for label in estimate.labels]
    wider = np.maximum(1.0, joint / np.maximum(estimate.std, 1e-30))
    left, whole = (float(np.sqrt(sum(np.sum(part[run.valid] ** 2) for part, run in zip(
        parts, beside.runs)))) for parts in (estimate.residuals, [run.tau for run in beside.runs]))
    return replace(beside, estimate=replace(
        estimate, covariance=estimate.covariance * np.outer(wider, wider),
        relative_error=left / max(whole, 1e-30)))
