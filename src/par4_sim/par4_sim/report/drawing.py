"""What the pictures of all reports share: colours, style, strokes, legend, and the SVG itself."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes as Axes  # also for those who draw with what is here
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure as Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator as MaxNLocator
from matplotlib.typing import RcKeyType

MEASURED, CALCULATED = '#c8102e', '#1a56a8'
BEFORE, AFTER, CURVE, FAINT = '#d9822b', '#1a56a8', '#1b1b1b', '#f3d9bd'
FLOOR, IDLE, INK = '#dfe5ea', '#b8bec4', '#3a4046'
WIDTH = 10.4
"""Inches; a report is as wide."""
PIXELS = 700
"""Columns of an envelope."""
STYLE: dict[RcKeyType, Any] = {
    'svg.hashsalt': 'par4', 'font.size': 8.5, 'axes.titlesize': 9, 'axes.labelsize': 8.5,
    'axes.titleweight': 'bold', 'axes.titlelocation': 'left',
    'axes.titley': 1.0,  # else each is lifted above what stands over its axes: nothing, in a fifth
    # of the time of a picture
    'axes.spines.top': False, 'axes.spines.right': False, 'axes.edgecolor': '#8a9199',
    'axes.labelcolor': INK, 'axes.linewidth': 0.7, 'xtick.color': '#8a9199',
    'ytick.color': '#8a9199', 'xtick.labelcolor': INK, 'ytick.labelcolor': INK, 'text.color': INK,
    'axes.grid': True, 'grid.color': '#eceff2', 'grid.linewidth': 0.7, 'axes.axisbelow': True,
    'legend.frameon': False, 'legend.fontsize': 8.5, 'lines.linewidth': 1.0,
    'path.simplify_threshold': 0.2}


@contextmanager
def drawn(height: float, width: float = WIDTH) -> Iterator[Figure]:
    """Yield a figure of `height` and `width` inches, as wide as a report, in the style of all."""
    with rc_context(STYLE):
        yield Figure((width, height), layout='constrained')


def line(axis: Axes, t: np.ndarray, values: np.ndarray, colour: str, width: float) -> None:
    """Draw values over time."""
    axis.plot(t, values, color=colour, linewidth=width)


def envelope(axis: Axes, t: np.ndarray, values: np.ndarray, colour: str, width: float) -> None:
    """Draw lowest and highest value of each pixel column: spikes stay, the file does not grow."""
    if len(t) < 2 * PIXELS:
        gap = np.append(np.diff(t) > 3.0 * np.median(np.diff(t)), False)
        line(axis, t, np.where(gap, np.nan, values), colour, width)
        return
    edges = np.linspace(t[0], t[-1], PIXELS + 1)
    starts = np.searchsorted(t, edges[:-1])
    filled = np.append(np.diff(starts) > 0, True)
    finite = np.isfinite(values)
    low = np.minimum.reduceat(np.where(finite, values, np.inf), starts.clip(max=len(t) - 1))
    high = np.maximum.reduceat(np.where(finite, values, -np.inf), starts.clip(max=len(t) - 1))
    shown = filled & (low <= high)
    low, high = np.where(shown, low, np.nan), np.where(shown, high, np.nan)
    middle = 0.5 * (edges[1:] + edges[:-1])
    axis.fill_between(middle, low, high, color=colour, linewidth=0.5 * width)


def dated(axis: Axes) -> None:
    """Label dates below an axis by months and days, and the year at its end."""
    locator = AutoDateLocator(minticks=4, maxticks=9)
    axis.xaxis.set_major_locator(locator)
    axis.xaxis.set_major_formatter(ConciseDateFormatter(
        locator, offset_formats=['', '%Y', '%Y', '%Y', '%d %B %Y', '%d %B %Y']))


def legend(figure: Figure, entries: Sequence[tuple[str, str]]) -> None:
    """Put texts and colours above a figure."""
    figure.legend([Patch(color=colour) for _, colour in entries], [text for text, _ in entries],
                  loc='outside upper right', ncols=len(entries), handlelength=1.1,
                  handleheight=0.7)


def svg_of(figure: Figure) -> str:
    """Return the figure as an SVG.

    Drawing it lays it out; `savefig` would draw it twice, once to do that alone.
    """
    stream = io.StringIO()
    FigureCanvasSVG(figure).print_svg(stream, metadata={'Date': None, 'Creator': None})
    return stream.getvalue()


def image(figure: Figure) -> str:
    """Return the figure as a data URI of an SVG that names no address."""
    svg = re.sub(r'<metadata>.*?</metadata>|<!DOCTYPE.*?>', '', svg_of(figure), flags=re.DOTALL)
    return 'data:image/svg+xml;base64,' + base64.b64encode(svg.encode()).decode()
