"""Pictures of residuals over what the motion offers, and of their statistics, as SVGs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_identification.reports.names import Names
from par4_sim.report.drawing import (
    AFTER,
    BEFORE,
    CALCULATED,
    CURVE,
    FAINT,
    FLOOR,
    INK,
    WIDTH,
    Axes,
    MaxNLocator,
    drawn,
    image,
    legend,
)

SMALLEST = 1e-12
"""N m: half of the width of a histogram of nothing."""
ENOUGH = 120
"""Rows without which no part of an abscissa is enlarged."""


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
    with drawn(0.6 + 2.2 * rows) as figure:
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
    with drawn(0.7 + (1.15 if joints > 1 else 1.9) * joints) as figure:
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
                first, last = np.percentile(values[joint], (0.5, 99.5))
                edges = np.linspace(first, last, 41)
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
    with drawn(4.0, WIDTH if joints > 1 else 0.6 * WIDTH) as figure:
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
            limit = max(4.0 * floor[joint], np.percentile(np.abs(values), 99.5), SMALLEST)
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
