"""Base parameters and causes as one model file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from par4_dynamics.base_terms import BASE_TERMS, BaseTerm
from par4_dynamics.model_file import EffectEntry, ModelFile
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.estimates import (
    deviations_of_base,
    effect_parameters,
)
from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.fit import Fit
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.fitting.realisable import realisable_base


def base_parameters(evidence: Evidence, fit: Fit, errors: Sequence[np.ndarray] = ()
                    ) -> dict[str, Parameter]:
    """Return the base parameters of a fit with their standard deviations.

    `errors` are torques by which the model may be wrong, see `torque_errors`.
    """
    std = deviations_of_base(evidence, fit, errors)
    return {term.name: Parameter(value=float(value), std=float(error), unit=term.unit)
            for term, value, error in zip(evidence.observations.terms, fit.base, std)}


def extended_model(baseline: ModelFile | None, rigid_body: str, evidence: Evidence,
                    hypotheses: Sequence[Hypothesis], fit: Fit,
                    errors: Sequence[np.ndarray] = ()) -> ModelFile:
    """Return the baseline with refitted base parameters and the causes added.

    `errors` are torques by which the model may be wrong, as in `base_parameters`.
    """
    added = tuple(
        EffectEntry(effect=hypothesis.effect.name, joints=hypothesis.joints,
                    parameters=effect_parameters(evidence, hypothesis, fit, index))
        for index, hypothesis in enumerate(hypotheses))
    return baseline_with(baseline, rigid_body, base_parameters(evidence, fit, errors),
                          evidence.observations.terms, added)


def as_told(model: ModelFile, told: Sequence[Mapping[str, Parameter]]) -> ModelFile:
    """Return a model whose last effects have the values and deviations that a diagnosis tells."""
    first = len(model.effects) - len(told)
    effects = tuple(entry.model_copy(update={'parameters': {**entry.parameters, **parameters}})
                    for entry, parameters in zip(model.effects[first:], told))
    return model.model_copy(update={'effects': (*model.effects[:first], *effects)})


def baseline_with(baseline: ModelFile | None, rigid_body: str, fitted: Mapping[str, Parameter],
                   terms: Sequence[BaseTerm], added: tuple[EffectEntry, ...]) -> ModelFile:
    """Return the baseline with other base parameters and more effects.

    A base parameter that came out slightly negative is written as zero. One that the motion does
    not show stays as the baseline has it, or is written as zero without one.
    """
    parameters = realisable_base({term.name: fitted[term.name] for term in terms})
    for term in BASE_TERMS:  # a motion that does not show it does not need it
        if not term.needs_platform and term.name not in parameters:
            zero = Parameter(value=0.0, unit=term.unit)
            parameters[term.name] = zero if baseline is None else (
                baseline.parameters.get(term.name, zero))
    return ModelFile(schema='par4/model/1', rigid_body=rigid_body, parameters=parameters,
                     effects=(*(baseline.effects if baseline else ()), *added),
                     torque_limit=baseline.torque_limit if baseline else None)
