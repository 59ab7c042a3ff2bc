"""Pictures of a machine's life: series with their deviations, courses and events over the dates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_sim.report.drawing import BEFORE, CALCULATED, IDLE, INK, MEASURED, drawn, image

COLOURS = (CALCULATED, BEFORE, MEASURED, '#2a7a4b')
"""Of up to four series in one picture."""


@dataclass(frozen=True)
class Line:
    """A series in a picture.

    Attributes:
        label: of it.
        values, std: (n,).
        course: steps and drifts through them, (n,).
    """

    label: str
    values: np.ndarray
    std: np.ndarray
    course: np.ndarray


@dataclass(frozen=True)
class Panel:
    """One picture of several series of one kind.

    Attributes:
        title: what they are.
        unit: of the ordinate.
        lines: the series.
        events: numbers of the events that they take part in.
    """

    title: str
    unit: str
    lines: tuple[Line, ...]
    events: frozenset[int]


def life(dates: np.ndarray, panels: Sequence[Panel], events: Sequence[np.datetime64]) -> str:
    """Return panels below each other over the same dates, events as numbered lines.

    Args:
        dates: of the bags, datetime64, (n,).
        panels: top to bottom.
        events: dates of the events, numbered from 1.
    """
    with drawn(0.5 + 1.85 * len(panels)) as figure:
        axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
        for axis, panel in zip(axes, panels):
            strokes = []
            for colour, part in zip(COLOURS, panel.lines):
                axis.vlines(dates, part.values - 1.96 * part.std, part.values + 1.96 * part.std,
                            color=colour, alpha=0.3, linewidth=1.0)
                axis.plot(dates, part.values, 'o', color=colour, markersize=2.2, alpha=0.7,
                          markeredgewidth=0.0)
                strokes.append(axis.plot(dates, part.course, color=colour, linewidth=1.6))
            axis.set_title(panel.title)
            axis.set_ylabel(panel.unit)
            for number, date in enumerate(events, start=1):
                own = number in panel.events
                axis.axvline(date, color=INK if own else IDLE, linewidth=0.9 if own else 0.5,
                             linestyle='--' if own else ':', zorder=0)
                if own:
                    axis.annotate(str(number), (date, 1.0), xycoords=('data', 'axes fraction'),
                                  xytext=(2.5, -9), textcoords='offset points', fontsize=8.5,
                                  fontweight='bold', color=INK)
            if len(panel.lines) > 1:
                axis.legend([lines[-1] for lines in strokes], [part.label for part in panel.lines],
                            loc='lower right', ncols=len(panel.lines), handlelength=1.1,
                            bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0)
        return image(figure)
