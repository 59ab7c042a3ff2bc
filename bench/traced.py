"""Numbers that know what else they could be, and tell whether that would decide otherwise.

A rule that is moved changes a diagnosis only if some comparison on the way comes out otherwise.
`Traced` numbers stand in for the rules of one run: they count as what they are, carry along what
they would be under each change, through sums, products and powers, and write down the changes for
which a comparison would have turned out differently. Where a change is not written down, the run
under that change is the same run, step by step, and need not be done.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np


class Traced(np.float64):
    """A number with its values under other rules; a float64, so that it goes first in every pair.

    Args:
        value: as it is.
        others: change -> what it would be.
        turned: changes that would have decided otherwise, added to.
    """

    def __new__(cls, value: float, others: Mapping[str, float], turned: set[str]) -> Traced:
        """Return the number."""
        made = super().__new__(cls, value)
        made.others = dict(others)
        made.turned = turned
        return made


def _value(number: Any, change: str) -> Any:
    return number.others.get(change, _plain(number)) if isinstance(number, Traced) else number


def _plain(number: Any) -> Any:
    return float(number) if isinstance(number, Traced) else number


def _changes(*numbers: Any) -> set[str]:
    return {change for number in numbers if isinstance(number, Traced) for change in number.others}


def _computed(law: Callable, swapped: bool) -> Callable:
    def compute(self: Traced, other: Any) -> Any:
        pair = (other, self) if swapped else (self, other)
        result = law(*map(_plain, pair))
        if np.ndim(result):
            raise TypeError('a rule meets an array: its comparisons cannot be traced')
        return Traced(result, {change: law(*(_value(item, change) for item in pair))
                               for change in _changes(*pair)}, self.turned)

    return compute


def _compared(law: Callable) -> Callable:
    def compare(self: Traced, other: Any) -> Any:
        result = law(_plain(self), _plain(other))
        if np.ndim(result):
            raise TypeError('a rule meets an array: its comparisons cannot be traced')
        self.turned.update(change for change in _changes(self, other)
                           if law(_value(self, change), _value(other, change)) != result)
        return result

    return compare


for _name in ('add', 'sub', 'mul', 'truediv', 'pow'):
    _law = getattr(operator, _name)
    setattr(Traced, f'__{_name}__', _computed(_law, swapped=False))
    setattr(Traced, f'__r{_name}__', _computed(_law, swapped=True))
for _name in ('lt', 'le', 'gt', 'ge', 'eq', 'ne'):
    setattr(Traced, f'__{_name}__', _compared(getattr(operator, _name)))
Traced.__hash__ = np.float64.__hash__
