"""An identified model as a machine can have it: what came out negative by chance is zero.

A diagnosis accepts such a value beside larger ones of the right sign; a plant takes no spring,
gap, friction or drag below zero.
"""

from __future__ import annotations

from par4_dynamics.model_file import EffectEntry, ModelFile
from par4_dynamics.parameters import Parameter

NONNEGATIVE: dict[str, tuple[str, ...]] = {
    'distributed_rods': ('bar_mass',),
    'elastic_transmission': ('stiffness',),  # 0 stands for a rigid joint
    'backlash': ('gap',),
    'cable_spring': ('stiffness',),
    'theta_friction': ('coulomb', 'viscous'),
    'passive_joint_friction': ('coulomb', 'viscous'),
    'platform_drag': ('viscous', 'quadratic')}
"""Parameters whose sign an effect tolerates and a plant does not."""


def realisable(model_file: ModelFile) -> ModelFile:
    """Return the model with the negative values of `NONNEGATIVE` parameters at zero."""
    return model_file.model_copy(update={'effects': tuple(map(_entry, model_file.effects))})


def _entry(entry: EffectEntry) -> EffectEntry:
    names = NONNEGATIVE.get(entry.effect, ())
    return entry.model_copy(update={'parameters': {
        name: _raised(parameter) if name in names else parameter
        for name, parameter in entry.parameters.items()}})


def _raised(parameter: Parameter) -> Parameter:
    value = parameter.value
    return parameter.model_copy(update={'value': tuple(max(part, 0.0) for part in value) if (
        isinstance(value, tuple)) else max(value, 0.0)})
