"""Every key of `model.yaml` in words; `python -m par4_dynamics.model_keys` prints its page."""

from __future__ import annotations

from importlib import resources

from par4_dynamics.base_terms import BASE_TERMS, TERMS, BaseTerm
from par4_kinematics.interface import table
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import AXIS_SCHEMA, Axis

KEYS = {
    'schema': ('**required**', '`par4/model/1`'),
    'rigid_body': ('`paper`', '`paper` is equation (20), with the mass of rods and bars at their '
                   'ends; `full` has it along them, by `rod_mass` and `bar_mass` of the robot '
                   'file'),
    'parameters': ('**required**', 'the base parameters, all that the machine has'),
    'effects': ('none', 'what the machine does beyond (20): a list of `effect`, `joints` (all if '
                'left out; none are given for an effect of the whole machine, such as a payload) '
                'and `parameters`; [effects](effects.md) lists the names'),
    'torque_limit': ('that of the robot file', 'of the drives, N m, where this machine needs '
                     'another one'),
    'provenance': ('none', 'where the model comes from; for readers'),
}
"""Key of a model file -> its default and what it is."""
WORDS = {
    'actuator_inertia': 'inertia of a motor with its arm and the share of the rods that counts to '
                        'it; of an axis, all that moves',
    'platform_mass_1': 'mass at D: half plate 1, the tool and the share of rods and bars',
    'platform_mass_2': "mass at D': half plate 2 and the share of rods and bars",
    'arm_gravity': 'torque that holds an arm when it is horizontal, rods included',
    'coulomb_friction': 'friction of a joint that does not depend on its speed',
    'viscous_friction': 'friction of a joint, per speed',
    'gravity_sine': 'of an axis that turns: a in the load a sin q + b cos q',
    'gravity_cosine': 'of an axis that turns: b in that load',
    'gravity_load': 'of an axis that slides: its load',
}
"""Base parameter -> what it is."""
SLIDE = Axis(schema=AXIS_SCHEMA, name='slide', joint='slide', kind='linear', gain=1.0)


def _row(term: BaseTerm) -> tuple[str, ...]:
    own, sliding = term.unit, unit_on(SLIDE, term.unit)
    if term not in BASE_TERMS:
        unit = sliding if term.name == 'gravity_load' else own
    else:
        unit = own if term.needs_platform or own == sliding else f'{own}; {sliding} on a slide'
    machines = 'Par4' if term.needs_platform else (
        'Par4, axis' if term in BASE_TERMS else 'axis with gravity')
    return (f'`{term.name}`', term.symbol, unit, machines,
            'not negative' if term.nonnegative else 'any', WORDS[term.name])


def markdown() -> str:
    """Return `docs/model_file.md`."""
    builtin = resources.files('par4_dynamics').joinpath('builtin', 'table1_full.yaml')
    keys = [(f'`{key}`', *words) for key, words in KEYS.items()]
    return f"""# The model file

Generated from `par4_dynamics/model_keys.py` by `make docs`; do not edit.

Identification writes a `model.yaml`; feedforward, simulation, validation and diagnosis read it.
`--model` and `model_file` take the path of one, or a built-in name. `table1` is TABLE 1 of the
paper on equation (20), and `table1_full` the same with the mass of rods and bars along them.
`table1_as_printed` has the viscous friction as it is printed, 20.4 N m s/rad, which is not
plausible.

{table(('key', 'default', 'what'), keys)}

Each parameter is `{{value, std, unit}}`. `value` and its standard deviation `std` are one number
for all joints, or a list with one number a joint; the masses of the platform are one number. `std`
may be left out. `unit` is checked and never converted.

## Base parameters

{table(('name', 'symbol', 'unit', 'of', 'value', 'what'), [_row(term) for term in TERMS.values()])}

[The model](model.md) has the equations.

## Example

The built-in `table1_full`, complete:

```yaml
{builtin.read_text(encoding='utf-8')}```

With an effect:

```yaml
schema: par4/model/1
parameters:
  actuator_inertia: {{value: 0.113, unit: kg m2}}
  platform_mass_1: {{value: 0.804, unit: kg}}
  platform_mass_2: {{value: 0.859, unit: kg}}
  arm_gravity: {{value: 1.33, unit: N m}}
  coulomb_friction: {{value: [2.4, 2.4, 2.5, 2.4], unit: N m}}    # one a joint
  viscous_friction: {{value: 2.04, unit: N m s/rad}}
effects:
  - effect: cogging
    joints: [2]
    parameters:
      periods: {{value: 24, unit: 1/turn}}
      amplitude: {{value: 0.6, unit: N m}}
      phase: {{value: 0.0, unit: rad}}
```

An axis that slides:

```yaml
schema: par4/model/1
parameters:
  actuator_inertia: {{value: 95.0, unit: kg}}
  coulomb_friction: {{value: 20.0, unit: N}}
  viscous_friction: {{value: 200.0, unit: N s/m}}
```
"""


if __name__ == '__main__':
    print(markdown(), end='')
