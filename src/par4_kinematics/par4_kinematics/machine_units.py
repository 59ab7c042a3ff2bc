"""The units of this project, which speak of turning joints, as they are on a machine."""

from __future__ import annotations

import re

from par4_kinematics.robot import Axis, Robot

_LINEAR_UNITS = {
    'kg m2': 'kg', 'kg m': 'kg', 'N m': 'N', 'N m s/rad': 'N s/m', 'N m s2/rad2': 'N s2/m2',
    'N m/rad': 'N/m', 'N m/V': 'N/V', 'rad': 'm', 'rad/s': 'm/s', '1/turn': 'rad/m'}
_BEHIND_NUMBER = re.compile(r'(?<=\d )(?:' + '|'.join(
    re.escape(unit) for unit in sorted(_LINEAR_UNITS, key=len, reverse=True)) + r')(?![\w/])')


def unit_on(machine: Robot | Axis, unit: str) -> str:
    """Return a unit of this project, which speaks of turning joints, as it is on the machine."""
    if isinstance(machine, Axis) and machine.kind == 'linear':
        return _LINEAR_UNITS.get(unit, unit)
    return unit


def words_on(machine: Robot | Axis, words: str) -> str:
    """Return a text with the units behind its numbers as they are on the machine."""
    return _BEHIND_NUMBER.sub(lambda found: unit_on(machine, found[0]), words)


def parameter_unit(machine: Robot | Axis, name: str, unit: str) -> str:
    """Return the unit of a parameter as it is on the machine: a phase is an angle on all."""
    return unit if name == 'phase' else unit_on(machine, unit)


def spelled_alike(one: str, other: str) -> bool:
    """Return whether two texts are one unit, as 'kg*m^2', 'kg·m²' and 'kg m2' are.

    Angles count as numbers, so that 'N m s' is 'N m s/rad' and '1/m' is 'rad/m'.
    """
    return _spelled(one) == _spelled(other)


def _spelled(unit: str) -> str:
    bare = re.sub(r'[\s*·⋅^()]', '', unit.replace('²', '2').replace('³', '3'))
    return re.sub(r'/?rad2?', '', bare).removeprefix('1')
