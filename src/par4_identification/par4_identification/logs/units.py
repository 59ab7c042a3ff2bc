"""Units in which loggers write time, position, speed, torque and voltage."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from par4_identification.logs.dates import DATES
from par4_kinematics.errors import InputError

JointKind = Literal['revolute', 'linear']
TURN = 2.0 * math.pi
LOWEST_RATE_HZ, HIGHEST_RATE_HZ = 0.5, 1e6
"""Rates of samples outside of which a table is refused: its unit of time is surely wrong."""


@dataclass(frozen=True)
class Unit:
    """A unit of a quantity.

    Attributes:
        factor: SI units in it.
        kind: of the joints that have it, None for any.
        scale: which number of the machine it needs besides: 'counts_per_turn' (divides) or
            'motor_gain' (multiplies).
    """

    factor: float
    kind: JointKind | None = None
    scale: Literal['counts_per_turn', 'motor_gain'] | None = None


UNITS: dict[str, dict[str, Unit]] = {
    'time': {'s': Unit(1.0), 'ms': Unit(1e-3), 'us': Unit(1e-6), 'ns': Unit(1e-9),
             **dict.fromkeys(DATES, Unit(1.0))},
    'position': {
        'rad': Unit(1.0, 'revolute'), 'deg': Unit(TURN / 360.0, 'revolute'),
        'turn': Unit(TURN, 'revolute'), 'counts': Unit(TURN, 'revolute', 'counts_per_turn'),
        'm': Unit(1.0, 'linear'), 'mm': Unit(1e-3, 'linear')},
    'velocity': {
        'rad/s': Unit(1.0, 'revolute'), 'deg/s': Unit(TURN / 360.0, 'revolute'),
        'turn/s': Unit(TURN, 'revolute'), 'rpm': Unit(TURN / 60.0, 'revolute'),
        'counts/s': Unit(TURN, 'revolute', 'counts_per_turn'),
        'm/s': Unit(1.0, 'linear'), 'mm/s': Unit(1e-3, 'linear')},
    'torque': {
        'Nm': Unit(1.0, 'revolute'), 'mNm': Unit(1e-3, 'revolute'), 'N': Unit(1.0, 'linear'),
        'A': Unit(1.0, None, 'motor_gain'), 'mA': Unit(1e-3, None, 'motor_gain')},
    'voltage': {'V': Unit(1.0), 'mV': Unit(1e-3)},
}
"""Quantity -> unit as it is written on the command line."""
HINTS = {'torque': '; a share of the rated torque, such as per mille, is given as A, with a '
                   '--motor-gain of the rated torque at the joint over 1000'}
"""Quantity -> what to do where none of its units is that of a column."""
SI = {'time': ('s', 's'), 'position': ('rad', 'm'), 'velocity': ('rad/s', 'm/s'),
      'torque': ('N m', 'N'), 'voltage': ('V', 'V')}
"""Quantity -> its SI unit for a revolute and for a linear joint."""


def unit_named(quantity: str, name: str) -> Unit:
    """Return a unit of a quantity; spaces in its name do not count (`N m`).

    Raises:
        InputError: no such quantity or unit; lists those that exist.
    """
    if quantity not in UNITS:
        raise InputError(f'{quantity}: unknown; columns are {", ".join(UNITS)}')
    known = UNITS[quantity]
    if name.replace(' ', '') not in known:
        raise InputError(f'{quantity}: unit {name!r} is unknown; give one of {", ".join(known)}'
                         f'{HINTS.get(quantity, "")}')
    return known[name.replace(' ', '')]


def si_unit(quantity: str, kind: JointKind) -> str:
    """Return the SI unit of a quantity of a joint of that kind, for messages."""
    return SI[quantity][kind == 'linear']
