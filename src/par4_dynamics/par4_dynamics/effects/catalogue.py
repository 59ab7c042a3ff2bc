"""All effects by name; `python -m par4_dynamics.effects.catalogue` prints docs/effects.md."""

from __future__ import annotations

import difflib
from collections.abc import Mapping

from par4_dynamics.effects.actuator_lag import ActuatorLag
from par4_dynamics.effects.arm_mass_offset import ArmMassOffset
from par4_dynamics.effects.arm_weight_difference import ArmWeightDifference
from par4_dynamics.effects.backlash import Backlash
from par4_dynamics.effects.base_tilt import BaseTilt
from par4_dynamics.effects.cable_spring import CableSpring
from par4_dynamics.effects.cogging import Cogging
from par4_dynamics.effects.coulomb_asymmetry import CoulombAsymmetry
from par4_dynamics.effects.distributed_rods import DistributedRods
from par4_dynamics.effects.drive_gain_error import DriveGainError
from par4_dynamics.effects.effect import Effect, EffectParameter, Machine
from par4_dynamics.effects.elastic_transmission import ElasticTransmission
from par4_dynamics.effects.encoder_eccentricity import EncoderEccentricity
from par4_dynamics.effects.encoder_offset import EncoderOffset
from par4_dynamics.effects.external_force import ExternalForce
from par4_dynamics.effects.friction_drift import FrictionDrift
from par4_dynamics.effects.geometry_error import GeometryError
from par4_dynamics.effects.joint_friction_difference import JointFrictionDifference
from par4_dynamics.effects.joint_inertia_difference import JointInertiaDifference
from par4_dynamics.effects.leg_length_error import LegLengthError
from par4_dynamics.effects.load_dependent_friction import LoadDependentFriction
from par4_dynamics.effects.nonlinear_viscous import NonlinearViscous
from par4_dynamics.effects.passive_joint_friction import PassiveJointFriction
from par4_dynamics.effects.payload import Payload
from par4_dynamics.effects.platform_drag import PlatformDrag
from par4_dynamics.effects.position_torque import PositionTorque
from par4_dynamics.effects.presliding import Presliding
from par4_dynamics.effects.quantization import Quantization
from par4_dynamics.effects.stribeck import Stribeck
from par4_dynamics.effects.theta_friction import ThetaFriction
from par4_dynamics.effects.theta_inertia import ThetaInertia
from par4_dynamics.effects.time_offset import TimeOffset
from par4_dynamics.effects.torque_offset import TorqueOffset
from par4_dynamics.effects.torque_ripple import TorqueRipple
from par4_dynamics.effects.torque_saturation import TorqueSaturation
from par4_dynamics.effects.viscous_asymmetry import ViscousAsymmetry
from par4_kinematics.errors import InputError

CATALOGUE: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        TorqueOffset(),
        Stribeck(),
        Cogging(),
        DistributedRods(),
        Payload(),
        ThetaInertia(),
        ThetaFriction(),
        PassiveJointFriction(),
        BaseTilt(),
        ExternalForce(),
        CableSpring(),
        PositionTorque(),
        PlatformDrag(),
        EncoderOffset(),
        EncoderEccentricity(),
        GeometryError(),
        LegLengthError(),
        CoulombAsymmetry(),
        ViscousAsymmetry(),
        NonlinearViscous(),
        LoadDependentFriction(),
        FrictionDrift(),
        Presliding(),
        JointFrictionDifference(),
        JointInertiaDifference(),
        ArmMassOffset(),
        ArmWeightDifference(),
        DriveGainError(),
        TorqueRipple(),
        ActuatorLag(),
        TimeOffset(),
        TorqueSaturation(),
        ElasticTransmission(),
        Backlash(),
        Quantization(),
    )
}


SEVERAL_ORDERS = """\
effects:
  - effect: cogging
    parameters:
      periods: {value: [7, 14, 84], unit: 1/turn}
      amplitude: {value: [[0.30, 0.28, 0.31, 0.30], 0.12, 0.05], unit: N m}
      phase: {value: [[0.0, 1.6, 3.1, -1.6], 0.4, 0.0], unit: rad}
"""
"""For docs/effects.md: of order 7 each joint has its own, of 14 and 84 all have the same."""


ALIKE = 0.8
"""Likeness of two names, of 0 to 1, from which on one is taken for the other misspelt."""


SOUGHT_ON: dict[Machine, str] = {'par4': 'Par4', 'revolute': 'axis', 'linear': 'slide'}
"""Machine -> how docs/effects.md calls it."""


def effect_named(name: str, library: Mapping[str, Effect] = CATALOGUE) -> Effect:
    """Return the effect of that name in a library.

    Raises:
        InputError: no such effect; says which it may be meant for, or lists all.
    """
    if name not in library:
        alike = difflib.get_close_matches(name, library, 1, ALIKE)
        known = (f'did you mean {alike[0]}? All are in docs/effects.md' if alike else
                 f'known effects are {", ".join(library)}')
        raise InputError(f'unknown effect {name!r}; {known}')
    return library[name]


def markdown() -> str:
    """Return `docs/effects.md`."""
    rows = []
    for effect in CATALOGUE.values():
        formula = (effect.__doc__ or '').partition('\n')[0].rstrip('.').replace('|', '\\|')
        parameters = ', '.join(
            f'`{parameter.name}` ({meaning_of(parameter)})' for parameter in effect.parameters)
        sought = ', '.join(words for machine, words in SOUGHT_ON.items()
                           if effect.is_sought_on(machine))
        rows.append(f'| `{effect.name}` | {effect.phrase} | {sought or "-"} | {formula} | '
                    f'{parameters} |')
    return f"""# Effects

Generated from `par4_dynamics/effects/` by `make docs`; do not edit.

What a machine can do that (20) does not say, as `model.yaml` and `diagnosis.json` name it. Torques
are what the recorded torque G V contains on top of the model; s = sign(qd). `par4_diagnose` looks
for an effect on the machines that are listed: a Par4, an axis that turns, a slide.

| effect | in words | looked for on | what it does | parameters |
|---|---|---|---|---|
{chr(10).join(rows)}

## Orders of a periodic torque

`cogging` and `torque_ripple` may have several orders: a motor has one for its slots, one for its
pole pairs, one for the teeth of its gear, and multiples of them. `periods` is then a list of the
orders, and each other parameter is either one number for all orders or a list with one entry an
order. An entry is one number for all joints, or a list with one number a joint:

```yaml
{SEVERAL_ORDERS}```

Where `periods` is one number, a list is one number a joint.
"""


def meaning_of(parameter: EffectParameter) -> str:
    """Return unit, scope, number of values, default and meaning of a parameter in words."""
    unit = parameter.unit if parameter.other_unit is None else (
        f'{parameter.unit} or {parameter.other_unit}')
    whole = ', of the machine' if parameter.scope == 'machine' else ', of each joint'
    numbers = f', one number or {parameter.size}' if parameter.uniform else (
        f', {parameter.size} numbers' if parameter.size > 1 else '')
    if parameter.per_order:
        numbers = ', of each order or term'
    default = parameter.default
    optional = '' if default is None else (
        f', as `{default}` if not given' if isinstance(default, str)
        else f', {default:g} if not given')
    meaning = f'; {parameter.meaning}' if parameter.meaning else ''
    return f'{unit}{whole}{numbers}{optional}{meaning}'


if __name__ == '__main__':
    print(markdown(), end='')
