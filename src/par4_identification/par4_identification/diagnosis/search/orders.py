"""The orders of a periodic torque, found together: the strongest first, each beside the others."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from par4_dynamics.effects.effect import Effect, Shape, single
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.projection import Projection, project
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.shapes import best_shape, order_name

MOST = 16
"""Orders of a torque; what a motor, its gear and its encoder have together."""
ALL_TRIED = 200
"""Orders up to which each is tried; of more, those with the strongest lines."""
STRONGEST = 32
"""Lines that are looked at closely."""


def best_orders(effect: Effect, shapes: Sequence[Shape], projection: Projection, rules: Rules
                ) -> tuple[Shape, float]:
    """Return the orders of an effect beside a projection, and twice what they gain.

    An order after the first must gain the sum of three things: what every cause must gain, what
    chance gives to the best of so many orders, and what an error of the orders before it may make.
    Orders are waves on any machine, so that error is the one of a Par4, also on an axis. The range
    of positions must also be wide enough to tell the order from those before it.

    Args:
        effect: with a shape parameter that may be a tuple of orders.
        shapes: one order each, evenly spaced.
        projection: of the causes beside it.
        rules: what a cause must gain.
    """
    name = order_name(effect)
    if name is None:
        raise TypeError(f'{effect.name} has no orders')
    evidence, joints = projection.evidence, range(projection.evidence.observations.joints)
    orders = np.array([single(shape[name]) for shape in shapes])
    apart = 0.999 * _resolution(projection)
    first, gain = _strongest(effect, name, orders, projection, (), apart)
    found = [first]
    before = project(evidence, ()).squares
    while len(found) < MOST:
        hypothesis = Hypothesis(effect, _shape(name, found), tuple(joints))
        beside = project(evidence, (*projection.hypotheses, hypothesis))
        order, more = _strongest(effect, name, orders, beside, found, apart)
        coefficients = 2 * (1 if effect.shared else len(joints))
        named = max(before - beside.squares, 0.0)
        needed = (rules.evidence + 0.5 * coefficients * np.log(max(evidence.rows, 2))
                  + np.log(len(orders)) + 0.5 * Rules.named_error ** 2 * named)
        if 0.5 * more < needed:
            break
        found.append(order)
        gain += more
    return _shape(name, sorted(found)), gain


def _shape(name: str, orders: Sequence[float]) -> Shape:
    return {name: orders[0] if len(orders) == 1 else tuple(orders)}


def _resolution(projection: Projection) -> float:
    """Return the distance of two orders that the range of positions tells apart."""
    runs = projection.evidence.observations.runs
    span = max(float(np.max(np.ptp(run.q, axis=0))) for run in runs)
    return 2.0 * np.pi / max(span, 1e-9)


def _strongest(effect: Effect, name: str, orders: np.ndarray, projection: Projection,
               found: Sequence[float], apart: float) -> tuple[float, float]:
    """Return the order that gains most and twice its gain, -inf where none is left.

    Orders that are not `apart` from those that were found before gain nothing.
    """
    def is_new(some: np.ndarray) -> np.ndarray:
        return np.min(np.abs(some[:, None] - [*found, np.inf]), axis=1) >= apart

    def worth(some: Sequence[Shape]) -> np.ndarray:
        new = is_new(np.array([single(shape[name]) for shape in some]))
        return np.where(new, projection.gains(effect, some), -np.inf)

    if len(orders) > ALL_TRIED:
        power = np.where(is_new(orders), line_powers(projection, orders), -1.0)
        orders = np.sort(orders[np.argsort(-power)[:STRONGEST]])
    shape, gain = best_shape(effect, [{name: float(order)} for order in orders], worth)
    return single(shape[name]), gain


def line_powers(projection: Projection, orders: np.ndarray) -> np.ndarray:
    """Return the strength of each order in the residual, (k,), without units.

    They are computed from the whitened residual and the unfiltered wave. A whitening filter changes
    little of a wave but its size and phase. The phase shift changes its sign with the direction of
    motion, so the two directions are summed separately.
    """
    evidence = projection.evidence
    runs, ends = evidence.observations.runs, evidence.ends
    step = float(np.min(np.diff(orders))) if len(orders) > 1 else 1.0
    numbers = np.round((orders - orders[0]) / step).astype(int)
    power = np.zeros(numbers[-1] + 1)
    for joint in range(evidence.observations.joints):
        residual = projection.residual[ends[joint]:ends[joint + 1]]
        q = np.concatenate([run.q[:, joint] for run in runs])
        speed = np.concatenate([run.speed[:, joint] for run in runs])
        for side in (speed > 0.0, speed < 0.0):
            waves = np.exp(1j * orders[0] * q[side])
            power += _line_powers(residual[side] * waves, np.exp(1j * step * q[side]), len(power))
    return power[numbers]


@numba.njit(cache=True, error_model='numpy')
def _line_powers(values, phasor, count):
    """Return |sum_n values_n phasor_n^k|^2 for k = 0, 1, ... (count,)."""
    total = np.zeros(count, np.complex128)
    for row in range(len(values)):
        power = values[row]
        for k in range(count):
            total[k] += power
            power *= phasor[row]
    return total.real ** 2 + total.imag ** 2
