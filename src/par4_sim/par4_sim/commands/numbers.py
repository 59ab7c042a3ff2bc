"""What the options of commands take as numbers: finite ones that a machine can have."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import click

LARGEST = 1e12
"""Largest value of any quantity in its unit; the squares of larger ones may overflow."""
FIRST_YEAR, LAST_YEAR = 1970, 2037
"""Whole years that a stamp of ROS holds."""


class Number(click.FloatRange):
    """A finite number within a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None
                ) -> float:
        """Return the number."""
        try:
            number = float(value)
        except ValueError:
            self.fail(_told(f'a number{_range(self)}', value), param, ctx)
        if not abs(number) <= LARGEST:
            self.fail(_told(f'a number{_range(self)}, finite and at most {LARGEST:g}', value),
                      param, ctx)
        return _within(self, 'a number', number, value, param, ctx)


class Whole(click.IntRange):
    """A whole number within a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Return the number."""
        try:
            number = int(value)
        except ValueError:
            self.fail(_told(f'a whole number{_range(self)}', value), param, ctx)
        return int(_within(self, 'a whole number', number, value, param, ctx))


def _within(asked: Number | Whole, kind: str, number: float, value: Any,
            param: click.Parameter | None, ctx: click.Context | None) -> float:
    """Return a number that is in the range that was asked for."""
    low, high = asked.min, asked.max
    if (low is not None and (number <= low if asked.min_open else number < low)) or (
            high is not None and number > high):
        asked.fail(_told(kind + _range(asked), value), param, ctx)
    return number


def _range(asked: Number | Whole) -> str:
    """Return the range of a number in words, to be put behind its kind."""
    if asked.min is None:
        return ''
    if asked.max is not None:
        return f' from {asked.min:g} to {asked.max:g}'
    return f' above {asked.min:g}' if asked.min_open else f' of {asked.min:g} or more'


def _told(expected: str, found: Any) -> str:
    """Return what was expected and what was found instead."""
    return f'expected {expected}, found {str(found)!r}'


class Numbers(click.ParamType[tuple[float, ...]]):
    """Positive numbers parted by commas."""

    name = 'number[,...]'

    def convert(self, value: str | tuple[float, ...], param: click.Parameter | None,
                ctx: click.Context | None) -> tuple[float, ...]:
        """Return the numbers."""
        if isinstance(value, tuple):
            return value
        try:
            numbers = tuple(float(part) for part in value.split(','))
        except ValueError:
            numbers = ()
        if not numbers or not all(0.0 < number <= LARGEST for number in numbers):
            self.fail(_told('a positive number, or several parted by commas', value), param, ctx)
        return numbers


class Date(click.DateTime):
    """A date in UTC that a stamp of ROS holds."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None
                ) -> datetime:
        """Return the date."""
        expected = (f'a date as 2026-03-31 or 2026-03-31T14:30:00, from {FIRST_YEAR} to '
                    f'{LAST_YEAR}, which a stamp holds')
        try:
            date = super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(_told(expected, value), param, ctx)
        if not FIRST_YEAR <= date.year <= LAST_YEAR:
            self.fail(_told(expected, value), param, ctx)
        return date


POSITIVE = Number(min=0.0, min_open=True)
NOT_NEGATIVE = Number(min=0.0)
ANY_SIGN = Number()
ANY_WHOLE = Whole()
FROM_ONE = Whole(min=1)
SEED = Whole(min=0)
