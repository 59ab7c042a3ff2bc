"""An identified model as a machine can have it: what came out negative by chance is zero.

A diagnosis accepts such a value beside larger ones of the right sign; a plant takes no spring,
gap, friction or drag below zero.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from par4_dynamics.base_terms import BASE_TERMS
from par4_dynamics.effects.catalogue import CATALOGUE, effect_named
from par4_dynamics.effects.effect import Effect
from par4_dynamics.model_file import EffectEntry, ModelFile
from par4_dynamics.parameters import Parameter


def realisable(model_file: ModelFile, library: Mapping[str, Effect] = CATALOGUE) -> ModelFile:
    """Return the model with the negative values of nonnegative parameters at zero.

    Its effects are those of `library`.
    """
    return model_file.model_copy(update={
        'parameters': realisable_base(model_file.parameters),
        'effects': tuple(_raised(entry, effect_named(entry.effect, library))
                         for entry in model_file.effects)})


def realisable_base(parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Return base parameters, by name, with the negative values of nonnegative ones at zero."""
    return _with_zeros(parameters, {term.name for term in BASE_TERMS if term.nonnegative})


def _raised(entry: EffectEntry, effect: Effect) -> EffectEntry:
    names = {parameter.name for parameter in effect.parameters if parameter.nonnegative}
    return entry.model_copy(update={'parameters': _with_zeros(entry.parameters, names)})


def _with_zeros(parameters: Mapping[str, Parameter], names: Collection[str]
                ) -> dict[str, Parameter]:
    return {name: _at_least_zero(parameter) if name in names else parameter
            for name, parameter in parameters.items()}


def _at_least_zero(parameter: Parameter) -> Parameter:
    value = parameter.value
    return parameter.model_copy(update={'value': tuple(max(part, 0.0) for part in value) if (
        isinstance(value, tuple)) else max(value, 0.0)})
