"""Traces of a page that can be zoomed into down to single samples, without any request outside.

uPlot (`uplot/`, its licence beside it) draws them; the page carries it, and the samples as 16-bit
numbers, which is finer than a pixel of the whole range by a factor of a hundred.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from markupsafe import Markup

MOST_VALUES = 800_000
"""Numbers of all traces together: 2 MB of page, a hundred seconds of two traces of four joints."""
LARGEST, MISSING = 32767, -32768
"""Of a 16-bit number."""


@dataclass(frozen=True)
class Trace:
    """One quantity over time.

    Attributes:
        name: in words.
        colour: as '#rrggbb'.
        values: (n, J), NaN where there is none.
    """

    name: str
    colour: str
    values: np.ndarray


@dataclass(frozen=True)
class Traces:
    """What a template shows, one chart a joint.

    Attributes:
        library, style: of uPlot.
        content: JSON that the script of the page reads.
        start, end: of what is shown, s.
    """

    library: Markup
    style: Markup
    content: Markup
    start: float
    end: float


def traces_of(t: np.ndarray, traces: Sequence[Trace], joints: Sequence[str], unit: str) -> Traces:
    """Return traces for a page.

    Args:
        t: of the samples, (n,) s, increasing; a gap of more than three periods is not bridged.
        traces: of the same quantity, drawn over each other.
        joints: labels, one a column.
        unit: of the values.
    """
    period = float(np.median(np.diff(t)))
    places = np.rint((t - t[0]) / period).astype(int)
    content = {
        'start': round(float(t[0]), 6), 'period': period, 'length': int(places[-1]) + 1,
        'joints': list(joints), 'unit': unit,
        'traces': [_packed(trace, places) for trace in traces]}
    folder = files(__package__) / 'uplot'
    library, style = ((folder / name).read_text(encoding='utf-8')
                      for name in ('uPlot.iife.min.js', 'uPlot.min.css'))
    # nothing in a script may look like its end
    return Traces(Markup(library), Markup(style),
                  Markup(json.dumps(content).replace('<', '\\u003c')), float(t[0]), float(t[-1]))


def shown_part(t: np.ndarray, error: np.ndarray, values: int) -> slice:
    """Return the samples of t (n,) that a page can carry, around the largest error (n,).

    Args:
        t: s.
        error: of each sample, 0 or more.
        values: numbers that a sample takes on the page.
    """
    most = MOST_VALUES // values
    if len(t) <= most:
        return slice(0, len(t))
    total = np.cumsum(np.concatenate(([0.0], error ** 2)))
    first = int(np.argmax(total[most:] - total[:-most]))
    return slice(first, first + most)


def _packed(trace: Trace, places: np.ndarray) -> dict[str, object]:
    """Return a trace as JSON takes it, on an even grid of `places` (n,)."""
    columns, scales = [], []
    for values in trace.values.T:
        scale = max(float(np.nanmax(np.abs(values), initial=0.0)), 1e-30) / LARGEST
        numbers = np.full(places[-1] + 1, MISSING, dtype='<i2')
        known = np.isfinite(values)
        numbers[places[known]] = np.rint(values[known] / scale)
        columns.append(base64.b64encode(numbers.tobytes()).decode())
        scales.append(scale)
    return {'name': trace.name, 'colour': trace.colour, 'scales': scales, 'columns': columns}
