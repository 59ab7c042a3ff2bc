"""Pictures of a machine's life: series with their deviations, courses and events over the dates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from par4_sim.report.drawing import (
    BEFORE,
    CALCULATED,
    IDLE,
    INK,
    MEASURED,
    Axes,
    dated,
    drawn,
    image,
)

COLOURS = (CALCULATED, BEFORE, MEASURED, '#2a7a4b')
"""Of up to four series in one picture."""
SIDE_STEP = 0.0018
"""Share of the time shown by which the points of several series stand beside each other."""
EVENTFUL, QUIET = 2.0, 1.25
"""Inches that a panel is high, with and without an event in it."""
HEADROOM = 0.16
"""Share of a panel's range that is left free above, for the numbers of the events."""


@dataclass(frozen=True)
class PlottedSeries:
    """A series in a picture.

    Attributes:
        label: of it.
        values, std: (n,).
        course: steps and drifts through them, (n,).
        steps: first bags after a step, where the course is not joined.
    """

    label: str
    values: np.ndarray
    std: np.ndarray
    course: np.ndarray
    steps: tuple[int, ...]


@dataclass(frozen=True)
class Panel:
    """One picture of several series of one kind.

    Attributes:
        title: what they are.
        unit: of the ordinate.
        lines: the series.
        events: number of each event that they take part in -> the bag at which they do.
    """

    title: str
    unit: str
    lines: tuple[PlottedSeries, ...]
    events: Mapping[int, int]


def life(dates: np.ndarray, panels: Sequence[Panel], events: Sequence[np.datetime64]) -> str:
    """Return panels below each other over the same dates, events as numbered lines.

    Args:
        dates: of the bags, datetime64, (n,).
        panels: top to bottom; those without an event are lower.
        events: dates of the events, numbered from 1.
    """
    heights = [EVENTFUL if panel.events else QUIET for panel in panels]
    with drawn(0.5 + sum(heights)) as figure:
        axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True,
                               height_ratios=heights)[:, 0]
        for axis, panel in zip(axes, panels):
            _series(axis, dates, panel)
            for number, date in enumerate(events, start=1):
                own = number in panel.events
                date = dates[panel.events[number]] if own else date
                axis.axvline(date, color=INK if own else IDLE, linewidth=0.9 if own else 0.7,
                             linestyle='--' if own else ':', zorder=0)
                if own:
                    axis.annotate(str(number), (date, 1.0), xycoords=('data', 'axes fraction'),
                                  xytext=(3, -10), textcoords='offset points', fontsize=9,
                                  fontweight='bold', color=INK)
        dated(axes[-1])
        return image(figure)


def _series(axis: Axes, dates: np.ndarray, panel: Panel) -> None:
    """Draw the series of a panel, each with its course."""
    strokes = []
    for place, (colour, part) in enumerate(zip(COLOURS, panel.lines)):
        # joints beside each other, so that none hides another
        beside = dates + SIDE_STEP * (place - 0.5 * (len(panel.lines) - 1)) * (
            dates[-1] - dates[0]).astype('timedelta64[s]')
        axis.vlines(beside, part.values - 1.96 * part.std, part.values + 1.96 * part.std,
                    color=colour, alpha=0.35, linewidth=0.9)
        axis.plot(beside, part.values, 'o', color=colour, markersize=2.6, markeredgewidth=0.0)
        for first, end in pairwise((0, *part.steps, len(dates))):
            stroke = axis.plot(dates[first:end], part.course[first:end], color=colour,
                               linewidth=1.5)
        strokes.append(stroke[0])
    axis.set_title(panel.title)
    axis.set_ylabel(panel.unit)
    low, high = axis.get_ylim()
    axis.set_ylim(low, high + HEADROOM * (high - low))
    if len(panel.lines) > 1:
        axis.legend(strokes, [part.label for part in panel.lines], loc='lower right',
                    ncols=len(panel.lines), handlelength=1.1, bbox_to_anchor=(1.0, 0.98),
                    borderaxespad=0.0)
