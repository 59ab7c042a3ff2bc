"""The units of this project, which speak of turning joints, as they are on a machine."""

from __future__ import annotations

from par4_kinematics.robot import Axis, Robot

_LINEAR_UNITS = {
    'kg m2': 'kg', 'kg m': 'kg', 'N m': 'N', 'N m s/rad': 'N s/m', 'N m s2/rad2': 'N s2/m2',
    'N m/rad': 'N/m', 'N m/V': 'N/V', 'rad': 'm', 'rad/s': 'm/s', '1/turn': 'rad/m'}
EARLIER_UNITS = {'rad/m': '1/m'}
"""Unit -> the one that files of earlier versions have for the same number."""


def unit_on(machine: Robot | Axis, unit: str) -> str:
    """Return a unit of this project, which speaks of turning joints, as it is on the machine."""
    if isinstance(machine, Axis) and machine.kind == 'linear':
        return _LINEAR_UNITS.get(unit, unit)
    return unit
