"""Times that loggers write as dates or as times of day."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import UTC, datetime

import numpy as np

DAY = 86400.0
"""s, after which a time of day starts again."""
CLOCK = re.compile(r'(?:(?P<hours>\d+):)?(?P<minutes>[0-5]?\d):(?P<seconds>[0-5]?\d(?:[.,]\d*)?)'
                   r'(?:\s*(?P<half>[AaPp])[Mm])?')


def _of_iso(cell: str) -> float:
    found = datetime.fromisoformat(cell)
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


def _of_date(cell: str, order: str) -> float:
    """Return s since 1970 of a date whose day, month and year stand in an order, as in `%d.%m.%Y`.

    They are parted by points, slashes or lines.
    """
    date, _, clock = cell.replace(', ', ' ').partition(' ')
    day = datetime.strptime(re.sub('[/-]', '.', date), order).replace(tzinfo=UTC)
    seconds = _of_clock(clock.strip())
    if clock.count(':') < 2 or seconds >= DAY:  # hours and minutes would pass for minutes and s
        raise ValueError(f'{clock!r} is no time of a day with hours, minutes and seconds')
    return day.timestamp() + seconds


def _of_clock(cell: str) -> float:
    """Return s since midnight, or since another zero."""
    found = CLOCK.fullmatch(cell)
    if found is None:
        raise ValueError(f'{cell!r} is no time of day')
    hours = float(found['hours'] or 0)
    if found['half']:
        if not 1.0 <= hours <= 12.0:
            raise ValueError(f'{cell!r} is no time of half a day')
        hours = hours % 12.0 + 12.0 * (found['half'] in 'Pp')
    return hours * 3600.0 + float(found['minutes']) * 60.0 + float(
        found['seconds'].replace(',', '.'))


DATES: dict[str, Callable[[str], float]] = {
    'iso': _of_iso,
    'dmy': lambda cell: _of_date(cell, '%d.%m.%Y'),
    'mdy': lambda cell: _of_date(cell, '%m.%d.%Y'),
    'clock': _of_clock,
}
"""Unit of a time -> what reads a cell: s since 1970, in UTC where no zone is told; of `clock` s
since midnight. They raise ValueError for what is no such time."""
EXAMPLES = {'iso': '2026-01-31T23:59:59.999', 'dmy': '31.01.2026 23:59:59.999',
            'mdy': '01/31/2026 11:59:59.999 PM', 'clock': '23:59:59.999'}
"""Unit -> how such times look."""


def day_after_day(time: np.ndarray) -> np.ndarray:
    """Return times of day (n,), s, that go on after midnight; NaN where there is none."""
    going_on, known = time.copy(), np.isfinite(time)
    going_on[known] = np.unwrap(time[known], period=DAY)
    return going_on


def unit_of_date(cell: str) -> str:
    """Return the units whose times look like a cell, in words, '' if none does."""
    fitting = [unit for unit, read in DATES.items() if _reads(read, cell)]
    return ' or '.join(fitting)


def _reads(read: Callable[[str], float], cell: str) -> bool:
    try:
        read(cell.strip())
    except ValueError:
        return False
    return True
