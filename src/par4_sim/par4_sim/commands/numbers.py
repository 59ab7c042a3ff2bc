"""What the options of commands take as numbers: finite ones that a machine can have."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import click

LARGEST = 1e12
"""Largest value of any quantity in its unit; the squares of larger ones may overflow."""
FIRST_YEAR, LAST_YEAR = 1970, 2037
"""Whole years that a stamp of ROS holds."""


class AnyNumber(click.types.FloatParamType):
    """A finite number."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None
                ) -> float:
        """Return the number."""
        number = super().convert(value, param, ctx)
        if not abs(number) <= LARGEST:
            self.fail(f'{number:g} is not a finite number of at most {LARGEST:g}', param, ctx)
        return number


ANY_SIGN = AnyNumber()


class Number(click.FloatRange):
    """A finite number within a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None
                ) -> float:
        """Return the number."""
        return super().convert(ANY_SIGN.convert(value, param, ctx), param, ctx)


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
            self.fail(f'{value!r} is not a positive number, or several parted by commas', param,
                      ctx)
        return numbers


class Date(click.DateTime):
    """A date in UTC that a stamp of ROS holds."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None
                ) -> datetime:
        """Return the date."""
        date = super().convert(value, param, ctx)
        if not FIRST_YEAR <= date.year <= LAST_YEAR:
            self.fail(f'{value} is not within {FIRST_YEAR} to {LAST_YEAR}, which a stamp holds',
                      param, ctx)
        return date


POSITIVE = Number(min=0.0, min_open=True)
NOT_NEGATIVE = Number(min=0.0)
SEED = click.IntRange(min=0)
