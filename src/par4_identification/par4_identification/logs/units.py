"""Units in which loggers write time, position, speed, torque and voltage.

A unit may have a factor: a column in `0.088deg` counts steps of 0.088 degrees.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
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
        scale: which number of the machine it needs besides: 'counts_per_turn' (divides),
            'motor_gain' or 'rated_torque' (multiply).
    """

    factor: float
    kind: JointKind | None = None
    scale: Literal['counts_per_turn', 'motor_gain', 'rated_torque'] | None = None


UNITS: dict[str, dict[str, Unit]] = {
    'time': {'s': Unit(1.0), 'ms': Unit(1e-3), 'us': Unit(1e-6), 'ns': Unit(1e-9),
             **dict.fromkeys(DATES, Unit(1.0))},
    'position': {
        'rad': Unit(1.0, 'revolute'), 'deg': Unit(TURN / 360.0, 'revolute'),
        'turn': Unit(TURN, 'revolute'), 'counts': Unit(TURN, 'revolute', 'counts_per_turn'),
        'm': Unit(1.0, 'linear'), 'cm': Unit(1e-2, 'linear'), 'mm': Unit(1e-3, 'linear'),
        'um': Unit(1e-6, 'linear')},
    'velocity': {
        'rad/s': Unit(1.0, 'revolute'), 'deg/s': Unit(TURN / 360.0, 'revolute'),
        'turn/s': Unit(TURN, 'revolute'), 'rpm': Unit(TURN / 60.0, 'revolute'),
        'counts/s': Unit(TURN, 'revolute', 'counts_per_turn'),
        'm/s': Unit(1.0, 'linear'), 'mm/s': Unit(1e-3, 'linear'),
        'mm/min': Unit(1e-3 / 60.0, 'linear')},
    'torque': {
        'Nm': Unit(1.0, 'revolute'), 'mNm': Unit(1e-3, 'revolute'), 'Ncm': Unit(1e-2, 'revolute'),
        'N': Unit(1.0, 'linear'), 'kN': Unit(1e3, 'linear'),
        'A': Unit(1.0, None, 'motor_gain'), 'mA': Unit(1e-3, None, 'motor_gain'),
        '%': Unit(1e-2, None, 'rated_torque'), 'permille': Unit(1e-3, None, 'rated_torque')},
    'voltage': {'V': Unit(1.0), 'mV': Unit(1e-3)},
}
"""Quantity -> unit as it is written on the command line."""
SPELLINGS = {'inc': 'counts', 'ticks': 'counts', 'inc/s': 'counts/s', 'ticks/s': 'counts/s',
             '°': 'deg', '°/s': 'deg/s', 'rev': 'turn', 'rev/s': 'turn/s', 'RPM': 'rpm',
             'U/min': 'rpm', '1/min': 'rpm', 'µm': 'um', 'μm': 'um', 'µs': 'us', 'μs': 'us',
             '‰': 'permille'}
"""Another spelling of a unit -> as it is written above."""
LARGEST_FACTOR = 1e9
"""Of a unit; its inverse is the smallest."""
MULTIPLES = {'time': '0.125ms', 'position': '0.088deg or 0.5um', 'velocity': '0.1rpm',
             'torque': '2.69mA', 'voltage': '0.1V'}
"""Quantity -> examples of units with a factor."""
SI = {'time': ('s', 's'), 'position': ('rad', 'm'), 'velocity': ('rad/s', 'm/s'),
      'torque': ('N m', 'N'), 'voltage': ('V', 'V')}
"""Quantity -> its SI unit for a revolute and for a linear joint."""


def unit_named(quantity: str, name: str) -> Unit:
    """Return a unit of a quantity, such as `deg`, `N m` or, with a factor, `0.088deg` or `-1Nm`.

    Raises:
        InputError: no such quantity or unit; lists those that exist.
    """
    if quantity not in UNITS:
        raise InputError(f'{quantity}: unknown; columns are {", ".join(UNITS)}'
                         + (', and a current is a torque in A' if quantity == 'current' else ''))
    factor, plain = _parted(name)
    known = UNITS[quantity]
    if plain not in known or (factor != 1.0 and plain in DATES) or (
            factor < 0.0 and quantity == 'time'):
        raise InputError(f'{quantity}: unit {name!r} is unknown; give one of {", ".join(known)}, '
                         f'or how much of one it is, such as {MULTIPLES[quantity]}')
    return replace(known[plain], factor=factor * known[plain].factor)


def plain_unit(name: str) -> str:
    """Return the name of a unit without its factor, as `UNITS` spells it if it is one of them."""
    return _parted(name)[1]


def _parted(name: str) -> tuple[float, str]:
    """Return factor and unit in a name such as `0.088 deg` or `N*m`."""
    text = re.sub(r'[\s*·]', '', name)
    if text in SPELLINGS:  # of which one begins with a number
        return 1.0, SPELLINGS[text]
    found = re.fullmatch(r'([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(.+)', text)
    factor, unit = (float(found[1]), found[2]) if found else (1.0, text)
    if not 1.0 / LARGEST_FACTOR <= abs(factor) <= LARGEST_FACTOR:
        return 1.0, name
    return factor, SPELLINGS.get(unit, unit)


def si_unit(quantity: str, kind: JointKind) -> str:
    """Return the SI unit of a quantity of a joint of that kind, for messages."""
    return SI[quantity][kind == 'linear']
