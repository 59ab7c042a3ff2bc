"""Pictures of torques, residuals and motions over time, each an SVG as a data URI."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from par4_identification.reports.names import Names
from par4_sim.report.drawing import (
    AFTER,
    BEFORE,
    CALCULATED,
    FLOOR,
    IDLE,
    INK,
    MEASURED,
    Figure,
    MaxNLocator,
    drawn,
    envelope,
    image,
    legend,
    line,
)

WINDOW = 2.0
"""Seconds of a window in which single strokes can be seen."""
SLOW = 0.02
"""Speed that a speed axis shows at least: below it the friction of a joint is not known."""


@dataclass(frozen=True)
class TorqueTraces:
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


def torque_over_time(series: TorqueTraces, names: Names) -> str:
    """Return measured (red) and calculated (blue) torque with the residual beneath, per joint.

    The whole of it, and windows of slow and of fast motion: the paper's Fig. 7.
    """
    slow, fast = _slow_and_fast(series)
    residual = series.measured - series.calculated
    joints = len(names.joints)
    with drawn(0.5 + (1.9 if joints > 1 else 2.8) * joints) as figure:
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
    strokes = [(before, BEFORE)] + ([] if after is None else [(after, AFTER)])
    with drawn(0.6 + (1.25 if joints > 1 else 2.2) * joints) as figure:
        axes = figure.subplots(joints, 2, squeeze=False, sharey='row',
                               gridspec_kw={'width_ratios': (1.6, 1.0)})
        for joint, label in enumerate(names.joints):
            limit = 1.1 * max(np.abs(before[valid[:, joint], joint]).max(initial=1e-9),
                              2.5 * floor[joint])
            for axis, rows, draw in zip(axes[joint], (slice(None), window), (envelope, line),
                                        strict=True):
                axis.axhspan(-2.0 * floor[joint], 2.0 * floor[joint], color=FLOOR, linewidth=0)
                for values, colour in strokes:
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
    with drawn(0.6 + 1.5 * joints) as figure:
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


def measured_motion(t: np.ndarray, speed: np.ndarray, torque: np.ndarray, names: Names) -> str:
    """Return joint speed and torque (m, J) over time: what the data are, before any model."""
    joints = len(names.joints)
    with drawn(0.4 + 1.3 * joints) as figure:
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
    with drawn(2.6) as figure:
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
    with _joint_grid(names, names.torque) as (figure, axes):
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
    with _joint_grid(names, 'difference') as (figure, axes):
        for joint, axis in enumerate(axes.flat):
            envelope(axis, t, noise[:, joint], IDLE, 1.6)
            for (_, values), colour in zip(differences, colours, strict=False):
                envelope(axis, t, values[:, joint], colour, 1.8 if colour == INK else 1.1)
            axis.set_xlim(t[0], t[-1])
        legend(figure, (*((label, colour) for (label, _), colour in
                          zip(differences, colours, strict=False)), ('noise', IDLE)))
        return image(figure)


@contextmanager
def _joint_grid(names: Names, quantity: str) -> Iterator[tuple[Figure, np.ndarray]]:
    """Yield a figure with a picture a joint, two in a row, over time."""
    rows = -(-len(names.joints) // 2)
    with drawn(0.5 + 2.2 * rows) as figure:
        axes = figure.subplots(rows, 2, squeeze=False, sharey=True)
        for axis, label in zip(axes.flat, names.joints, strict=True):
            axis.set_title(label)
        for axis in axes[:, 0]:
            axis.set_ylabel(f'{quantity}, {names.torque_unit}')
        for axis in axes[-1]:
            axis.set_xlabel('time, s')
        yield figure, axes


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


def _slow_and_fast(series: TorqueTraces) -> tuple[slice, slice]:
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
