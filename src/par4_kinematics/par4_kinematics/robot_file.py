"""Every key of `robot.yaml` in words; `python -m par4_kinematics.robot_file` prints its page.

Types, ranges and defaults come from the schema itself; units, frames and users stand here.
"""

from __future__ import annotations

import types
from collections.abc import Iterator, Sequence
from importlib import resources
from typing import Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from par4_kinematics.files import FileModel
from par4_kinematics.interface import table
from par4_kinematics.robot import AXIS_SCHEMA, ROBOT_SCHEMA, Axis, Robot

_MOTIONS = 'motions, drivers and simulated drives refuse what leaves it'
_FULL = 'models with `rigid_body: full`; check of the setup'
_LOOPS = 'simulated drives; check of the setup'
_AS_ARM = 'as `arm_length`'
ROBOT_KEYS = {
    'schema': ('', 'says what the file describes', 'every reader'),
    'name': ('', 'of the robot, free', 'reports, messages'),
    'geometry.arm_length': ('m', 'L, from the axis of the motor to the elbow',
                            'every tool: kinematics and dynamics'),
    'geometry.forearm_length': ('m', 'l, of the rods, from the elbow to the platform',
                                _AS_ARM),
    'geometry.base_radius': ('m', 'from the origin of `base` to the axis of each motor',
                             _AS_ARM),
    'geometry.platform_radius': ('m', 'from the middle of the platform to the joints of the rods, '
                                 'at theta = 0', _AS_ARM),
    'geometry.platform_bar_length': ('m', 'h, of the bars that join the two half plates',
                                     _AS_ARM),
    'geometry.actuator_azimuth': ('rad', 'of legs 0 to 3, in `base`, from x towards y',
                                  _AS_ARM),
    'geometry.rotation_amplification': ('', 'angle of the tool over theta (belt, gear); 1 without',
                                        '`platform_pose`, pictures'),
    'geometry.arm_length_errors': ('m', 'of legs 0 to 3, added to `arm_length`: what a calibration '
                                   'found', _AS_ARM),
    'geometry.forearm_length_errors': ('m', 'of legs 0 to 3, added to `forearm_length`',
                                       _AS_ARM),
    'bodies.rod_mass': ('kg', 'm_5, of one rod (a forearm has two)', _FULL),
    'bodies.bar_mass': ('kg', 'm_3, of one of the two bars', _FULL),
    'bodies.theta_inertia': ('kg m2', 'of all that turns with theta, as felt at theta',
                             'models with `rigid_body: full`'),
    'bodies.tool_mass': ('kg', 'of the tool, which the platform masses of a model contain',
                         'check of the setup'),
    'drives.gain': ('N m/V', 'G of joints 0 to 3, above 0: torque at the joint per volt at the '
                    'amplifier (24)', 'every tool that reads or writes `amplifier_voltage`'),
    'drives.torque_limit': ('N m', 'largest torque at the joint, either way; a `torque_limit` of '
                            'the model takes its place', 'simulated drives; `par4_excite`, '
                            '`par4_track`, `par4_fastest`; check of the setup'),
    'drives.velocity_gain': ('N m s/rad', 'of the velocity loop', _LOOPS),
    'drives.position_gain': ('1/s', 'of the position loop', _LOOPS),
    'drives.integral_gain': ('1/s2', 'of the integral in the position loop', 'simulated drives'),
    'drives.speed_limit': ('rad/s', 'of the speed that the position loop asks for',
                           'simulated drives; predictive control'),
    'drives.current_lag': ('s', 'time constant of the current loop', 'simulated drives'),
    'drives.encoder_counts': ('1/turn', 'counts per turn of the arm; 0 is an ideal encoder',
                              'simulated sensors; filters of identification and diagnosis; check '
                              'of the setup'),
    'limits.joint_position': ('rad', 'lowest and highest angle of every arm, from the horizontal, '
                              'positive downward', _MOTIONS),
    'limits.joint_speed': ('rad/s', 'highest speed of every arm; also sets the pace of '
                           '`excitation` and of the way to a start',
                           'motions, drivers and simulated drives refuse what exceeds it'),
    'limits.workspace.radius': ('m', 'of the cylinder about the z axis of `base` that D keeps',
                                _MOTIONS),
    'limits.workspace.z': ('m', 'lowest and highest z of D, in `base`: below the motors, so '
                           'negative; home is in their middle where z = -0.78 m is outside',
                           _MOTIONS),
    'limits.workspace.theta': ('rad', 'largest theta, either way', _MOTIONS),
}
"""Key of a robot file -> unit, what it is, what uses it."""
_ORDERS = 'sources of a periodic torque in `par4_diagnose`, where the joint turns'
AXIS_KEYS = {
    'schema': ('', 'says what the file describes', 'every reader'),
    'name': ('', 'of the axis, free', 'reports, messages'),
    'joint': ('', 'name of its joint on `joint_states`', 'every reader of bags; `par4_bag`'),
    'kind': ('', '`revolute` turns (rad, N m), `linear` slides (m, N)', 'units, base terms, which '
             'effects are sought'),
    'gain': ('N m/V or N/V', 'torque or force at the joint per volt at the amplifier; needed only '
             'where the log has voltages and neither torque nor current', 'every tool that reads '
             '`amplifier_voltage`'),
    'gravity': ('', '`vertical` if the axis turns in a vertical plane or slides up and down, '
                '`none` if it carries no weight, `unknown` to let the data tell; with a weight, '
                'friction that differs between the directions counts as part of it', 'base terms'),
    'gear_ratio': ('', 'turns of the motor for one turn of the joint', _ORDERS),
    'pole_pairs': ('', 'of the motor', _ORDERS),
    'motor_gain': ('N m/A or N/A', 'torque or force at the joint, behind the gear, per ampere',
                   '`par4_bag`, for columns in A or mA'),
    'rated_torque': ('N m or N', 'torque or force at the joint, behind the gear, of which a drive '
                     'logs a share', '`par4_bag`, for columns in % or permille'),
}
"""Key of an axis file -> unit, what it is, what uses it."""
TURNING = """\
schema: par4/axis/1
name: elbow
joint: elbow
kind: revolute
gravity: vertical     # it swings in a vertical plane
gear_ratio: 101
pole_pairs: 7
motor_gain: 5.6       # N m/A at the joint
"""
SLIDING = """\
schema: par4/axis/1
name: slide
joint: carriage
kind: linear
gain: 35.0            # N/V; its logs have voltages
"""


def leaves(schema: type[FileModel], above: str = '') -> Iterator[tuple[str, FieldInfo]]:
    """Yield every key that a file of `schema` may have, with dots between its levels."""
    for name, field in schema.model_fields.items():
        key = above + (field.alias or name)
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, FileModel):
            yield from leaves(inner, f'{key}.')
        else:
            yield key, field


def type_of(annotation: Any) -> str:
    """Return what a key takes, in words."""
    parts = get_args(annotation)
    if get_origin(annotation) is Sequence:
        inner = get_args(parts[0])
        return 'list of lists of numbers' if inner else f'list of {type_of(parts[0])}s'
    if get_origin(annotation) in (Union, types.UnionType):
        return type_of(next(part for part in parts if part is not types.NoneType))
    if get_origin(annotation) is Literal:
        return ', '.join(f'`{part}`' for part in parts)
    if get_origin(annotation) is tuple:
        return f'{len(parts)} numbers'
    if parts:  # a type with its checks
        return type_of(parts[0])
    return {float: 'number', int: 'whole number', str: 'text'}[annotation]


def range_of(field: FieldInfo) -> str:
    """Return the bounds of a number, in words."""
    bounds = {name: getattr(check, name) for check in field.metadata for name in ('gt', 'ge')
              if hasattr(check, name)}
    return ''.join(f', {"above" if name == "gt" else "at least"} {bound}'
                   for name, bound in bounds.items())


def default_of(field: FieldInfo) -> str:
    """Return what a key that is left out has, in words."""
    if field.is_required():
        return '**required**'
    if field.default is None:
        return '-'
    if isinstance(field.default, tuple):
        return f'[{", ".join(f"{part:.4g}" for part in field.default)}]'
    return f'{field.default:.6g}' if isinstance(field.default, float) else str(field.default)


def _keys(schema: type[FileModel], words: dict[str, tuple[str, str, str]]) -> str:
    return table(('key', 'type', 'unit', 'default', 'what', 'used by'), [
        (f'`{key}`', type_of(field.annotation) + range_of(field), words[key][0], default_of(field),
         *words[key][1:]) for key, field in leaves(schema)])


def markdown() -> str:
    """Return `docs/robot_file.md`."""
    reference = resources.files('par4_kinematics').joinpath('builtin', 'reference.yaml')
    return f"""# The robot file

Generated from `par4_kinematics/robot_file.py` and the schema by `make docs`; do not edit.

`--robot` of the commands and `robot_file` of the nodes take the path of such a file, or
`reference`, the built-in robot. There are two kinds: a robot with the Par4 topology, and a single
motor-driven axis, which turns or slides. Only the offline tools that read bags take an axis.

Numbers are in SI units and radians, without quotes; `1e-3` is a number. A dot in a key is a level
of the file: `drives.gain` is `gain` under `drives`. A key that does not exist, a type or a range
that does not hold is refused in one line. Frame `base` has its origin in the middle of the four
motors' axes and its z axis upward; D is the point of half plate 1 that carries the tool
([conventions](model.md#conventions)). Torques and speeds are those of the joint, behind the gear.

## A Par4: `{ROBOT_SCHEMA}`

{_keys(Robot, ROBOT_KEYS)}

A key that is left out has its default; `-` is none. The defaults of `limits` and `drives` are the
values of the reference robot, which are hardly those of yours: write your own before a machine
moves. Commands that hold a motion against limits say which of them the file does not give.

The built-in `reference`, complete:

```yaml
{reference.read_text(encoding='utf-8')}```

[Your own robot](your_own_robot.md) writes such a file step by step and checks it.

## A single axis: `{AXIS_SCHEMA}`

{_keys(Axis, AXIS_KEYS)}

An axis has no dimensions and no limits: nothing here moves it. On a sliding axis positions are in
m, forces in N, and every parameter has the unit that follows: an inertia is a mass in kg, viscous
friction is in N s/m.

An axis that turns:

```yaml
{TURNING}```

One that slides:

```yaml
{SLIDING}```

[A fault found on one axis](one_axis.md) uses such a file from the log to the cause;
[measured machines](measured.md) has axes that were measured, and how their logs become bags.
"""


if __name__ == '__main__':
    print(markdown(), end='')
