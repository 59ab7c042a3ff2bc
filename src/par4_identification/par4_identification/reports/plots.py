"""Every picture of the reports of this package, each an SVG as a data URI."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from par4_sim.report.drawing import (
    AFTER,
    BEFORE,
    CALCULATED,
    CURVE,
    FAINT,
    FLOOR,
    IDLE,
    INK,
    MEASURED,
    STYLE,
    WIDTH,
    envelope,
    image,
    legend,
    line,
)

WINDOW = 2.0
"""Seconds of a window in which single strokes can be seen."""
SLOW = 0.02
"""Speed that a speed axis shows at least: below it the friction of a joint is not known."""
ENOUGH = 120
"""Rows without which no part of an abscissa is enlarged."""


@dataclass(frozen=True)
class Series:
    """Rows of measured and calculated torque on one time axis.

    Attributes:
        t: s, increasing, gaps allowed, (m,).
        speed: of the joints, (m, J).
        measured, calculated: (m, J).
        moving: rows at which friction is known, (m, J).
    """

    t: np.ndarray
    speed: np.ndarray
    measured: np.ndarray
    calculated: np.ndarray
    moving: np.ndarray


@dataclass(frozen=True)
class Names:
    """What axes are labelled with.

    Attributes:
        joints: one a joint.
        torque: 'torque' or 'force'.
        torque_unit, speed_unit: of that and of joint speed.
    """

    joints: tuple[str, ...]
    torque: str
    torque_unit: str
    speed_unit: str


def torque_over_time(series: Series, names: Names) -> str:
    """Return measured (red) and calculated (blue) torque with the residual beneath, per joint.

    The whole of it, and windows of slow and of fast motion: the paper's Fig. 7.
    """
    slow, fast = _slow_and_fast(series)
    residual = series.measured - series.calculated
    joints = len(names.joints)
    with rc_context(STYLE):
        figure = Figure((WIDTH, 0.5 + (1.9 if joints > 1 else 2.8) * joints), layout='constrained')
        axes = figure.subplots(2 * joints, 3, squeeze=False, gridspec_kw={
            'width_ratios': (1.5, 1.0, 1.0), 'height_ratios': (2.2, 1.0) * joints})
        for joint, label in enumerate(names.joints):
            upper, lower = axes[2 * joint], axes[2 * joint + 1]
            moving = series.moving[:, joint]
            counted = moving if moving.any() else ~moving
            limit = 1.15 * np.abs(residual[counted, joint]).max(initial=1e-9)
            for column, (rows, title) in enumerate((
                    (slice(None), 'all'), (slow, 'slow motion'), (fast, 'fast motion'))):
                over, under = upper[column], lower[column]
                draw = envelope if column == 0 else line
                t = series.t[rows]
                draw(over, t, series.measured[rows, joint], MEASURED, 2.2)
                draw(over, t, series.calculated[rows, joint], CALCULATED, 0.9)
                left, still = residual[rows, joint], ~moving[rows]
                draw(under, t, np.where(still, left, np.nan), IDLE, 0.8)
                draw(under, t, np.where(still, np.nan, left), INK, 0.8)
                over.set_title(label if column == 0 else f'{label}, {title}')
                under.set_ylim(-limit, limit)
                under.yaxis.set_major_locator(MaxNLocator(3, symmetric=True))
                for axis in (over, under):
                    axis.set_xlim(t[0], t[-1])
                    axis.tick_params(labelbottom=axis in axes[-1])
            for rows in (slow, fast):
                upper[0].axvspan(series.t[rows][0], series.t[rows][-1], color=FLOOR, zorder=0,
                                 linewidth=0)
            upper[0].set_ylabel(f'{names.torque}, {names.torque_unit}')
            lower[0].set_ylabel(f'residual,\n{names.torque_unit}')
        for axis in axes[-1]:
            axis.set_xlabel('time, s')
        figure.align_ylabels(axes[:, 0])
        legend(figure, (('measured', MEASURED), ('calculated', CALCULATED),
                        ('residual', INK), ('residual near standstill', IDLE)))
        return image(figure)


def residual_over_time(t: np.ndarray, before: np.ndarray, after: np.ndarray | None,
                       valid: np.ndarray, floor: np.ndarray, names: Names) -> str:
    """Return residuals (m, J) before and after, whole and in a window, over the noise floor (J,).

    Without `after` only one is drawn.
    """
    joints = len(names.joints)
    window = _largest_window(t, np.where(valid, before, 0.0))
    drawn = [(before, BEFORE)] + ([] if after is None else [(after, AFTER)])
    with rc_context(STYLE):
        figure = Figure((WIDTH, 0.6 + (1.25 if joints > 1 else 2.2) * joints), layout='constrained')
        axes = figure.subplots(joints, 2, squeeze=False, sharey='row',
                               gridspec_kw={'width_ratios': (1.6, 1.0)})
        for joint, label in enumerate(names.joints):
            limit = 1.1 * max(np.abs(before[valid[:, joint], joint]).max(initial=1e-9),
                              2.5 * floor[joint])
            for axis, rows, draw in zip(axes[joint], (slice(None), window), (envelope, line),
                                        strict=True):
                axis.axhspan(-2.0 * floor[joint], 2.0 * floor[joint], color=FLOOR, linewidth=0)
                for values, colour in drawn:
                    kept = np.where(valid[rows, joint], values[rows, joint], np.nan)
                    draw(axis, t[rows], kept, colour, 0.9)
                axis.set_xlim(t[rows][0], t[rows][-1])
                axis.set_ylim(-limit, limit)
                axis.xaxis.set_major_locator(MaxNLocator(7))
                axis.yaxis.set_major_locator(MaxNLocator(4))
                axis.tick_params(labelbottom=joint == joints - 1)
            axes[joint, 0].set_title(label)
            axes[joint, 0].set_ylabel(f'residual, {names.torque_unit}')
        for axis in axes[-1]:
            axis.set_xlabel('time, s')
        entries = [('residual', BEFORE)] if after is None else [
            ('residual of the old model', BEFORE), ('residual of the extended model', AFTER)]
        legend(figure, (*entries, ('noise floor, ± 2 standard deviations', FLOOR)))
        return image(figure)


def measured_and_simulated(t: np.ndarray, measured: np.ndarray, before: np.ndarray | None,
                           after: np.ndarray, valid: np.ndarray, names: Names) -> str:
    """Return measured and simulated values (m, J) per joint, and simulated minus measured.

    Left the window in which the old model differs most, right the differences of valid rows over
    all of it. `before` is None where there is one model only; `names` tells the quantity.
    """
    simulated = [(after, AFTER)] if before is None else [(before, BEFORE), (after, AFTER)]
    window = _largest_window(t, np.where(valid, simulated[0][0] - measured, 0.0))
    joints = len(names.joints)
    with rc_context(STYLE):
        figure = Figure((WIDTH, 0.6 + 1.5 * joints), layout='constrained')
        axes = figure.subplots(joints, 2, squeeze=False, gridspec_kw={'width_ratios': (1.4, 1.0)})
        for joint, label in enumerate(names.joints):
            over, beside = axes[joint]
            line(over, t[window], measured[window, joint], MEASURED, 2.4)
            for values, colour in simulated:
                line(over, t[window], values[window, joint], colour, 1.0)
                envelope(beside, t, np.where(valid[:, joint], values[:, joint]
                                             - measured[:, joint], np.nan), colour, 0.9)
            over.set_title(label)
            over.set_ylabel(f'{names.torque},\n{names.torque_unit}')
            beside.set_ylabel(f'difference,\n{names.torque_unit}')
            for axis, rows in ((over, window), (beside, slice(None))):
                axis.set_xlim(t[rows][0], t[rows][-1])
                axis.yaxis.set_major_locator(MaxNLocator(4))
                axis.tick_params(labelbottom=joint == joints - 1)
        for axis in axes[-1]:
            axis.set_xlabel('time, s')
        figure.align_ylabels(axes)
        entries = [('simulated', AFTER)] if before is None else [
            ('simulated, old model', BEFORE), ('simulated, extended model', AFTER)]
        legend(figure, (('measured', MEASURED), *entries))
        return image(figure)


def signature(abscissa: Sequence[np.ndarray], label: str, before: Sequence[np.ndarray],
              alone: Sequence[np.ndarray], curve: Sequence[np.ndarray], titles: Sequence[str],
              names: Names) -> str:
    """Return what a cause looks like: residuals over the abscissa where it shows, and its curve.

    Args:
        abscissa: of the rows of each joint drawn, (m,).
        label: of the abscissa, with unit.
        before: residual without any cause, (m,) a joint; its quartiles are drawn.
        alone: residual with every cause but this, (m,) a joint; binned medians.
        curve: the torque of the cause itself, (m,) a joint; binned medians.
        titles: one a joint drawn.
        names: for the torque's unit.
    """
    count = len(titles)
    columns = 1 if count == 1 else 2
    rows = -(-count // columns)
    with rc_context(STYLE):
        figure = Figure((WIDTH, 0.6 + 2.2 * rows), layout='constrained')
        axes = figure.subplots(rows, columns, squeeze=False, sharey=True)
        for axis, where, old, left, own, title in zip(axes.flat, abscissa, before, alone, curve,
                                                      titles, strict=False):
            axis.set_title(title)
            if not len(where):
                _at_rest(axis)
                continue
            if len(where) < ENOUGH:
                order = np.argsort(where)
                axis.plot(where, left, 'o', color=BEFORE, markersize=3.6)
                axis.plot(where[order], own[order], color=CURVE, linewidth=1.3)
                continue
            low, high = _where_it_acts(where, own)
            inside = np.count_nonzero((where >= low) & (where <= high))
            edges = np.linspace(low, high, int(np.clip(inside // 12, 8, 72)) + 1)
            middle = 0.5 * (edges[1:] + edges[:-1])
            axis.fill_between(middle, *(_binned(where, old, edges, share)
                                        for share in (25.0, 75.0)), color=FAINT, linewidth=0)
            axis.plot(middle, _binned(where, left, edges, 50.0), 'o', color=BEFORE, markersize=3.6)
            axis.plot(middle, _binned(where, own, edges, 50.0), color=CURVE, linewidth=1.3)
            axis.set_xlim(edges[0], edges[-1])
        for axis in axes[:, 0]:
            axis.set_ylabel(f'{names.torque}, {names.torque_unit}')
        for axis in axes[-1]:
            axis.set_xlabel(label)
        for axis in axes.flat[count:]:
            axis.set_visible(False)
        legend(figure, (('residual of the old model, middle half of a bin', FAINT),
                        ('median residual of the model without this cause', BEFORE),
                        ('the cause as identified', CURVE)))
        return image(figure)


def residual_over_motion(views: Sequence[tuple[str, Sequence[np.ndarray]]],
                         residuals: Sequence[np.ndarray], floor: np.ndarray, names: Names) -> str:
    """Return medians and quartiles of the residual over what the motion offers, per joint.

    Args:
        views: label with unit, and the values of each joint's rows, (m_j,).
        residuals: of the same rows, (m_j,) a joint.
        floor: noise floor, (J,), N m.
        names: labels.
    """
    joints = len(names.joints)
    with rc_context(STYLE):
        figure = Figure((WIDTH, 0.7 + (1.15 if joints > 1 else 1.9) * joints),
                        layout='constrained')
        axes = figure.subplots(joints, len(views), squeeze=False, sharey='row', sharex='col')
        for joint, (label, left) in enumerate(zip(names.joints, residuals, strict=True)):
            axes[joint, 0].set_title(label)
            axes[joint, 0].set_ylabel(f'residual, {names.torque_unit}')
            if not len(left):
                _at_rest(*axes[joint])
                continue
            low, high = np.percentile(left, (5.0, 95.0))
            limit = max(-low, high, 3.0 * floor[joint], 1e-9)
            for axis, (_, values) in zip(axes[joint], views, strict=True):
                edges = np.linspace(*np.percentile(values[joint], (0.5, 99.5)), 41)
                middle = 0.5 * (edges[1:] + edges[:-1])
                lower, median, upper = (_binned(values[joint], left, edges, share)
                                        for share in (25.0, 50.0, 75.0))
                axis.axhspan(-floor[joint], floor[joint], color=FLOOR, linewidth=0)
                axis.fill_between(middle, lower, upper, color=AFTER, alpha=0.25, linewidth=0)
                axis.plot(middle, median, color=AFTER, linewidth=1.3)
                axis.set_ylim(-limit, limit)
                axis.yaxis.set_major_locator(MaxNLocator(3, symmetric=True))
        for axis, (label, _) in zip(axes[-1], views, strict=True):
            axis.set_xlabel(label)
            axis.xaxis.set_major_locator(MaxNLocator(5))
        figure.align_ylabels(axes[:, 0])
        legend(figure, (('median residual, middle half', AFTER),
                        ('noise floor, ± 1 standard deviation', FLOOR)))
        return image(figure)


def residual_statistics(residuals: Sequence[np.ndarray], floor: np.ndarray,
                        correlation: np.ndarray, rows: np.ndarray, spacing: float, names: Names
                        ) -> str:
    """Return histogram and autocorrelation of the residual of each joint.

    Args:
        residuals: valid rows of each joint, (m_j,).
        floor: noise floor, (J,), N m; drawn as a normal density.
        correlation: at lags 0, 1, .. rows, (lags, J).
        rows: number behind it, (J,), for the band in which that of white noise stays.
        spacing: of rows, s.
        names: labels.
    """
    joints = len(names.joints)
    with rc_context(STYLE):
        figure = Figure((WIDTH if joints > 1 else 0.6 * WIDTH, 4.0), layout='constrained')
        axes = figure.subplots(2, joints, squeeze=False, sharey='row')
        lag = np.arange(len(correlation)) * spacing
        for joint, label in enumerate(names.joints):
            upper, lower = axes[:, joint]
            values = residuals[joint]
            upper.set_title(label)
            upper.set_xlabel(f'residual, {names.torque_unit}')
            lower.set_xlabel('lag, s')
            if not len(values):
                _at_rest(upper, lower)
                continue
            limit = max(4.0 * floor[joint], np.percentile(np.abs(values), 99.5))
            edges = np.linspace(-limit, limit, 61)
            density, _ = np.histogram(values, edges)
            middle = 0.5 * (edges[1:] + edges[:-1])
            upper.fill_between(middle, density / (len(values) * (edges[1] - edges[0])), step='mid',
                               color=CALCULATED, alpha=0.35, linewidth=0)
            if floor[joint] > 0.0:
                normal = np.exp(-0.5 * (middle / floor[joint]) ** 2) / (
                    floor[joint] * np.sqrt(2.0 * np.pi))
                upper.plot(middle, normal, color=INK)
            band = 1.96 / np.sqrt(max(rows[joint], 1))
            lower.axhspan(-band, band, color=FLOOR, linewidth=0)
            lower.plot(lag[1:], correlation[1:, joint], color=CALCULATED, linewidth=1.2)
            lower.set_xlim(0.0, lag[-1])
            lower.set_ylim(min(-0.5, 1.1 * correlation.min()), 1.0)
        unit = names.torque_unit
        axes[0, 0].set_ylabel(f'density, 1/({unit})' if ' ' in unit else f'density, 1/{unit}')
        axes[1, 0].set_ylabel('autocorrelation, 1')
        legend(figure, (('residual', CALCULATED), ('noise floor', INK),
                        ('95 % band of white noise', FLOOR)))
        return image(figure)


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
    with rc_context(STYLE):
        figure = Figure((0.8 * WIDTH, 0.8 + (0.2 + 0.16 * count) * len(bars)),
                        layout='constrained')
        axis = figure.subplots()
        axis.axvline(0.0, color='#8a9199', linewidth=0.8)
        for row, bar in enumerate(bars):
            for index, (value, std) in enumerate(zip(bar.values, bar.stds, strict=True)):
                height = row + 0.22 * (index - 0.5 * (count - 1))
                axis.errorbar(100.0 * value, height, xerr=196.0 * std or None, fmt='od'[std == 0.0],
                              markersize=4.5, color=colours[index], elinewidth=1.6, capsize=3.0)
        axis.set_yticks(range(len(bars)), [bar.label for bar in bars])
        axis.set_ylim(len(bars) - 0.5, -0.5)
        axis.grid(axis='y', visible=False)
        axis.tick_params(axis='y', length=0)
        axis.set_xlabel(label)
        legend(figure, tuple(zip(kinds, colours, strict=False)))
        return image(figure)


def measured_motion(t: np.ndarray, speed: np.ndarray, torque: np.ndarray, names: Names) -> str:
    """Return joint speed and torque (m, J) over time: what the data are, before any model."""
    joints = len(names.joints)
    with rc_context(STYLE):
        figure = Figure((WIDTH, 0.4 + 1.3 * joints), layout='constrained')
        axes = figure.subplots(joints, 2, squeeze=False)
        for joint, label in enumerate(names.joints):
            for axis, values, colour in zip(axes[joint], (speed, torque), (INK, MEASURED),
                                            strict=True):
                envelope(axis, t, values[:, joint], colour, 0.9)
                axis.set_xlim(t[0], t[-1])
            fastest = max(1.1 * np.abs(speed[:, joint]).max(), SLOW)
            axes[joint, 0].set_ylim(-fastest, fastest)
            axes[joint, 0].set_title(label)
            axes[joint, 0].set_ylabel(f'speed, {names.speed_unit}')
            axes[joint, 1].set_ylabel(f'{names.torque}, {names.torque_unit}')
        for axis in axes[-1]:
            axis.set_xlabel('time, s')
        return image(figure)


def proposed_motion(t: np.ndarray, displacement: np.ndarray, speed: np.ndarray, names: Names
                    ) -> str:
    """Return a motion over time: D and theta from where it begins (m, 4), joint speeds (m, J)."""
    colours = (MEASURED, CALCULATED, INK, BEFORE)
    with rc_context(STYLE):
        figure = Figure((WIDTH, 2.6), layout='constrained')
        axes = figure.subplots(1, 3)
        for axis, columns, labels, title in zip(
                axes, (1e3 * displacement[:, :3], np.degrees(displacement[:, 3:]), speed),
                (('x', 'y', 'z'), ('',), names.joints),
                ('D, mm', 'theta, degrees', f'joint speed, {names.speed_unit}'), strict=True):
            for column, label, colour in zip(columns.T, labels, colours, strict=False):
                axis.plot(t, column, color=colour, linewidth=0.9, label=label)
            axis.set_title(title)
            axis.set_xlabel('time, s')
            axis.set_xlim(t[0], t[-1])
            if len(labels) > 1:
                axis.margins(y=0.3)  # room for the legend
                axis.legend(loc='upper right', ncols=len(labels))
        return image(figure)


def torque_of_mechanism(t: np.ndarray, mechanism: np.ndarray, simplified: np.ndarray, names: Names
                        ) -> str:
    """Return the torques (m, 4) of the mechanism and of (20) over time: the paper's Fig. 6."""
    with rc_context(STYLE):
        figure, axes = _joint_grid(names, names.torque)
        for joint, axis in enumerate(axes.flat):
            envelope(axis, t, mechanism[:, joint], CALCULATED, 2.6)
            envelope(axis, t, simplified[:, joint], MEASURED, 0.9)
            axis.set_xlim(t[0], t[-1])
        legend(figure, (('whole mechanism in pybullet', CALCULATED), ('(20)', MEASURED)))
        return image(figure)


def differences_over_time(t: np.ndarray, differences: Sequence[tuple[str, np.ndarray]],
                          noise: np.ndarray, names: Names) -> str:
    """Return labelled differences (m, 4) of torque over time, the whole first, and their noise."""
    colours = (INK, BEFORE, AFTER, MEASURED)
    with rc_context(STYLE):
        figure, axes = _joint_grid(names, 'difference')
        for joint, axis in enumerate(axes.flat):
            envelope(axis, t, noise[:, joint], IDLE, 1.6)
            for (_, values), colour in zip(differences, colours, strict=False):
                envelope(axis, t, values[:, joint], colour, 1.8 if colour == INK else 1.1)
            axis.set_xlim(t[0], t[-1])
        legend(figure, (*((label, colour) for (label, _), colour in
                          zip(differences, colours, strict=False)), ('noise', IDLE)))
        return image(figure)


def _joint_grid(names: Names, quantity: str) -> tuple[Figure, np.ndarray]:
    """Return a figure with a picture a joint, two in a row, over time."""
    rows = -(-len(names.joints) // 2)
    figure = Figure((WIDTH, 0.5 + 2.2 * rows), layout='constrained')
    axes = figure.subplots(rows, 2, squeeze=False, sharey=True)
    for axis, label in zip(axes.flat, names.joints, strict=True):
        axis.set_title(label)
    for axis in axes[:, 0]:
        axis.set_ylabel(f'{quantity}, {names.torque_unit}')
    for axis in axes[-1]:
        axis.set_xlabel('time, s')
    return figure, axes


# windows, bins, strokes


def _windows(t: np.ndarray) -> list[slice]:
    """Return uninterrupted windows of `WINDOW` seconds, or all rows if there is none."""
    if len(t) < 3:
        return [slice(0, len(t))]
    spacing = float(np.median(np.diff(t)))
    length = min(len(t), round(WINDOW / spacing) + 1)
    starts = range(0, len(t) - length + 1, max(1, length // 4))
    windows = [slice(first, first + length) for first in starts
               if t[first + length - 1] - t[first] < (length + 2) * spacing]
    return windows or [slice(0, len(t))]


def _slow_and_fast(series: Series) -> tuple[slice, slice]:
    """Return the window in which moving joints are slowest and the one in which they are fastest.
    """
    windows = _windows(series.t)
    speed = np.sqrt([np.mean(series.speed[window] ** 2) for window in windows])
    moving = np.array([series.moving[window].mean() for window in windows])
    lively = moving >= 0.8 * np.percentile(moving, 90)
    return (windows[int(np.argmin(np.where(lively, speed, np.inf)))],
            windows[int(np.argmax(speed))])


def _largest_window(t: np.ndarray, values: np.ndarray) -> slice:
    windows = _windows(t)
    return windows[int(np.argmax([np.sum(values[window] ** 2) for window in windows]))]


def _where_it_acts(abscissa: np.ndarray, curve: np.ndarray) -> tuple[float, float]:
    """Return the range of the abscissa where a curve is more than its tails, with a margin."""
    low, high = np.percentile(abscissa, (0.5, 99.5))
    acting = abscissa[np.abs(curve) > 0.1 * np.abs(curve).max()]
    if len(acting):
        first, last = np.percentile(acting, (2.0, 98.0))
        margin = 0.75 * (last - first)
        near, far = max(low, first - margin), min(high, last + margin)
        if np.count_nonzero((abscissa >= near) & (abscissa <= far)) >= ENOUGH:
            low, high = near, far
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def _binned(abscissa: np.ndarray, values: np.ndarray, edges: np.ndarray, share: float
            ) -> np.ndarray:
    """Return a percentile of the values in each bin, NaN in bins of fewer than four."""
    bin_of = np.digitize(abscissa, edges)
    parts = [values[bin_of == index] for index in range(1, len(edges))]
    return np.array([np.percentile(part, share) if len(part) >= 4 else np.nan for part in parts])


def _at_rest(*axes: Axes) -> None:
    for axis in axes:
        axis.text(0.5, 0.5, 'at rest', transform=axis.transAxes, ha='center', va='center')
