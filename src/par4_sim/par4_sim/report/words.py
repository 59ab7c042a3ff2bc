"""Numbers, units and names as people read them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot

_PERSONS = ('coulomb', 'stribeck')


def number(value: float, digits: int = 3) -> str:
    """Return a number with so many significant digits, without exponent where it is readable."""
    if not math.isfinite(value):
        return 'n/a'
    if value == 0.0:
        return '0'
    exponent = _exponent(value, digits)
    if not -5 < exponent < 7:
        return f'{value:.{digits - 1}e}'
    rounded = round(value, digits - 1 - exponent)
    return f'{rounded:.{max(digits - 1 - exponent, 0)}f}'


def with_std(value: float, std: float | None) -> tuple[str, str]:
    """Return value and standard deviation, the latter to two digits, both to the same decimals."""
    if not std or not math.isfinite(std):
        return number(value, 4), '0' if std == 0.0 else 'n/a'
    decimals = max(1 - _exponent(std, 2), 0)
    if decimals > 8:
        return number(value, 6), number(std, 2)
    return f'{value:.{decimals}f}', f'{std:.{decimals}f}'


def _exponent(value: float, digits: int) -> int:
    """Return the power of ten of a number rounded to so many significant digits."""
    return int(f'{value:.{digits - 1}e}'.partition('e')[2])


def percent(fraction: float, digits: int = 2) -> str:
    """Return a fraction as a percentage; 'n/a' for one that is not finite."""
    if not math.isfinite(fraction):
        return 'n/a'
    if 0.9 < fraction < 1.0:
        digits += 1
    return f'{number(100.0 * fraction, digits)} %'


def listed(parts: Sequence[str]) -> str:
    """Return 'a', 'a and b' or 'a, b and c'."""
    return ' and '.join(filter(None, (', '.join(parts[:-1]), parts[-1])))


def shortened(names: Sequence[str]) -> str:
    """Return names in words, the first three of many: 'a, b, c and 23 others'."""
    if len(names) <= 4:
        return listed(names)
    return f'{", ".join(names[:3])} and {len(names) - 3} others'


def capital(text: str) -> str:
    """Return a text as the beginning of a sentence."""
    return text[:1].upper() + text[1:]


def in_words(name: str) -> str:
    """Return the name of a parameter or effect in words."""
    words = [word.capitalize() if word in _PERSONS else word for word in name.split('_')]
    return ' '.join(words)


def joint_labels(machine: Robot | Axis) -> tuple[str, ...]:
    """Return what to call the joints in words and pictures."""
    if isinstance(machine, Axis):
        return (machine.joint,)
    return tuple(f'joint {joint}' for joint in range(len(machine.joint_names)))


def typeset(unit: str) -> str:
    """Return a unit with its exponents raised."""
    return re.sub(r'(?<=[a-zA-Z])[23]', lambda match: {'2': '²', '3': '³'}[match[0]], unit)


def phrase_on(machine: Robot | Axis, phrase: str) -> str:
    """Return what is said of torques, of a machine: a linear axis has forces."""
    return re.sub(r'\btorque\b', torque_name(machine), phrase)


def torque_name(machine: Robot | Axis) -> str:
    """Return 'torque', or 'force' on a linear axis."""
    return 'torque' if unit_on(machine, 'N m') == 'N m' else 'force'
