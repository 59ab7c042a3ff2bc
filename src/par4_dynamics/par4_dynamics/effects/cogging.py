"""Torque periodic in the joint angle, whatever the load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numba
import numpy as np

from par4_dynamics.effects.effect import (
    Base,
    Effect,
    EffectParameter,
    Shape,
    Signature,
    Values,
)
from par4_dynamics.state import State

LOWEST_PERIODS, HIGHEST_PERIODS = 4, 160
MOST_PERIODS = 4000
"""Of an axis: the teeth of a motor's gear, some tens of turns of which make one of the joint. Of a
slide it is the number of orders that are tried."""
OF_A_SPAN = 4.0
"""Orders of a slide that are tried in the distance at which its range tells two apart."""
AT_ONCE = 256
"""Rows of which powers are computed together."""
LEAST_TURNS = 1.5
"""Periods in the range of a joint below which they cannot be told from gravity. An axis that makes
as many turns tells what returns with each turn from any other function of its position."""


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _power_rows(phasor, exponents, columns):
    """Write sines, then cosines, (n, J, 2 k) of multiples (J, k) of the angles of exp(i q) (n, J).

    Each power is a product by the binary digits of its exponent, of many rows in each of its steps:
    so the compiler turns them into vector instructions.
    """
    count = exponents.shape[1]
    square, square_i, power, power_i = (np.empty(AT_ONCE), np.empty(AT_ONCE), np.empty(AT_ONCE),
                                        np.empty(AT_ONCE))  # real and imaginary parts
    for joint in range(phasor.shape[1]):
        for place in range(count):
            for first in range(0, phasor.shape[0], AT_ONCE):
                rows, left = min(AT_ONCE, phasor.shape[0] - first), exponents[joint, place]
                for row in range(rows):
                    unit = phasor[first + row, joint]
                    square[row], square_i[row] = unit.real, unit.imag
                    power[row], power_i[row] = 1.0, 0.0
                while left:
                    if left & 1:
                        for row in range(rows):
                            a, b, c, d = power[row], power_i[row], square[row], square_i[row]
                            power[row], power_i[row] = a * c - b * d, a * d + b * c
                    left >>= 1
                    for row in range(rows):
                        a, b = square[row], square_i[row]
                        square[row], square_i[row] = a * a - b * b, a * b + b * a
                for row in range(rows):
                    columns[first + row, joint, place] = power_i[row]
                    columns[first + row, joint, count + place] = power[row]


def waves_of_orders(state: State, orders: Sequence[Sequence[int]], step: float = 1.0) -> np.ndarray:
    """Return sines, then cosines, (n, J, 2 k) of k whole multiples of the positions of each joint.

    Args:
        state: the motion.
        orders: the multiples of each joint, (J, k).
        step: of which they are multiples, 1/m of what slides.
    """
    exponents = np.array(orders, dtype=np.int64)
    columns = np.empty((*state.q.shape, 2 * exponents.shape[1]))
    phasor = state.phasor if step == 1.0 else np.exp(1j * step * state.q, order='C')
    _power_rows(phasor, exponents, columns)
    return columns


def _waves(state: State, periods: float) -> np.ndarray:
    """Return sine and cosine of so many times the joint positions, (n, J, 2)."""
    if periods < 0 or periods != int(periods):  # a model file may have any number
        angle, waves = periods * state.q, np.empty((*state.q.shape, 2))
        waves[..., 0], waves[..., 1] = np.sin(angle), np.cos(angle)
        return waves
    return waves_of_orders(state, [(int(periods),)] * state.joints)


def order_step(slides: bool, span: float) -> float:
    """Return the distance of the orders worth trying: they are its multiples.

    What turns has whole ones, as its torque returns after one turn. What slides may have any, in
    1/m: those that its range of positions, `span` m, tells apart, a quarter of that from one to the
    next.
    """
    return 2.0 * np.pi / (OF_A_SPAN * max(span, 1e-9)) if slides else 1.0


def lowest_order(state: State, span: float, least_turns: float = LEAST_TURNS) -> int:
    """Return the lowest order worth trying of a joint that moves over a range of `span`, in steps.

    It has `least_turns` periods in that range. Of what turns it is at least `LOWEST_PERIODS`, or 1
    on an axis that makes `LEAST_TURNS` turns: a weight off its axis pulls once in a turn. The
    weight of an axis that is known to hang is a base term, though.
    """
    if state.slides:
        return int(np.ceil(least_turns * OF_A_SPAN))
    turns = state.geometry is None and span >= LEAST_TURNS * 2.0 * np.pi
    usual = (2 if state.hanging == 'turning' else 1) if turns else LOWEST_PERIODS
    return max(usual, int(np.ceil(least_turns * 2.0 * np.pi / max(span, 1e-3))))


def highest_order(state: State, step: float) -> int:
    """Return the highest order worth trying, in steps of `order_step`.

    An arm of a Par4 has `HIGHEST_PERIODS`. An axis may have the orders of a motor behind a gear:
    those that half the sample rate carries at the speeds of the slower quarter of its motion.
    """
    if state.geometry is not None:
        return HIGHEST_PERIODS
    speed = np.abs(state.qd)
    slower = float(np.quantile(speed[speed > 0.05 * np.max(speed)], 0.25)) if speed.any() else 1.0
    rate = 1.0 / float(state.t[1] - state.t[0])
    return int(np.clip(np.pi * rate / (slower * step), HIGHEST_PERIODS, MOST_PERIODS))


class Cogging(Effect):
    """tau_i += a_i sin(N q_i + phi_i), summed over the orders N: slots, magnets, teeth of a gear.

    The shape `periods` is one order or a tuple of K orders; each order has a column with its sine
    and one with its cosine. On a slide q is in metres and an order is 2 pi over a pitch.

    Attributes:
        least_turns: periods in the range of a joint below which an order is not sought.
    """

    name = 'cogging'
    phrase = 'cogging torque'
    of_angle = True
    least_turns: ClassVar[float] = LEAST_TURNS
    parameters = (
        EffectParameter('amplitude', 'N m', 'joint', per_order=True),
        EffectParameter('periods', '1/turn', 'machine', is_shape=True, per_order=True),
        EffectParameter('phase', 'rad', 'joint', per_order=True, qualifies=True))

    def shapes(self, state: State) -> tuple[Shape, ...]:
        span = float(np.max(np.ptp(state.q, axis=0)))  # of the joint that moves most
        step = order_step(state.slides, span)
        return tuple({'periods': step * steps}
                     for steps in range(lowest_order(
                         state, span, self.least_turns), highest_order(state, step) + 1))

    def parts(self, shape: Shape) -> tuple[Shape, ...]:
        periods = shape['periods']
        if not isinstance(periods, tuple):
            return (shape,)
        return tuple({**shape, 'periods': order} for order in periods)

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        periods = shape['periods']
        if isinstance(periods, tuple):
            return np.concatenate([_waves(state, order) for order in periods], axis=-1)
        return _waves(state, periods)

    def coefficients(self, values: Values) -> np.ndarray:
        amplitude, phase = (np.reshape(values[name], (len(values[name]), -1)).T  # (K, J)
                            for name in ('amplitude', 'phase'))
        waves = np.stack((amplitude * np.cos(phase), amplitude * np.sin(phase)), axis=1)
        return waves.reshape(-1, amplitude.shape[1])  # (2 K, J)

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        sine, cosine = coefficients[0::2].T, coefficients[1::2].T  # (J, K)
        found = {'amplitude': np.hypot(sine, cosine),
                 'periods': np.broadcast_to(shape['periods'], sine.shape).astype(float),
                 'phase': np.arctan2(cosine, sine)}
        if isinstance(shape['periods'], tuple):
            return found
        return {name: value[:, 0] for name, value in found.items()}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.q, 'joint position, rad')
