"""The picture of parameters that deviate, with their intervals, as an SVG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from par4_sim.report.drawing import AFTER, BEFORE, CURVE, WIDTH, drawn, image, legend


@dataclass(frozen=True)
class Bar:
    """Relative deviations of one quantity from a common zero, with standard deviations."""

    label: str
    values: tuple[float, ...]
    stds: tuple[float, ...]


def deviation_bars(bars: Sequence[Bar], kinds: Sequence[str], label: str) -> str:
    """Return a point with its 95 % interval for each value of each bar, in percent.

    Args:
        bars: one a line, top to bottom; values and stds as fractions.
        kinds: what each value is.
        label: of the abscissa.
    """
    colours = (AFTER, BEFORE, CURVE)
    count = len(kinds)
    with drawn(0.8 + (0.2 + 0.16 * count) * len(bars), 0.8 * WIDTH) as figure:
        axis = figure.subplots()
        axis.axvline(0.0, color='#8a9199', linewidth=0.8)
        for row, bar in enumerate(bars):
            for index, (value, std) in enumerate(zip(bar.values, bar.stds, strict=True)):
                height = row + 0.22 * (index - 0.5 * (count - 1))
                axis.errorbar(100.0 * value, height, xerr=196.0 * std or None, fmt='od'[std == 0.0],
                              markersize=4.5, color=colours[index], elinewidth=1.6, capsize=3.0)
        axis.set_yticks(range(len(bars)), [bar.label for bar in bars])
        axis.set_ylim(max(len(bars), 1) - 0.5, -0.5)
        axis.grid(axis='y', visible=False)
        axis.tick_params(axis='y', length=0)
        axis.set_xlabel(label)
        legend(figure, tuple(zip(kinds, colours, strict=False)))
        return image(figure)
