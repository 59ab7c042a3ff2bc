"""A torque that follows the position of an axis: a spring, a cable, a counterweight, a cam."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import legvander

from par4_dynamics.effects.effect import (
    Base,
    Effect,
    EffectParameter,
    Shape,
    Signature,
    Values,
    single,
)
from par4_dynamics.state import State

HIGHEST_DEGREE = 9
WIDEST = 4.0 * np.pi
"""rad: what goes further goes on turning, so that no spring is wound up, if it does not come back.
"""
FLAT = 2.0
"""Standard deviations within which every term but the constant one makes it an offset."""
QUARTER, RETURNS = 0.25, 3
"""Shares of its way at either end that a joint which comes and goes must reach, and how often it
must go from one to the other, as the motor of a screw does."""


def goes_on_turning(state: State) -> bool:
    """Return whether a joint goes on turning, so that no spring can follow its position."""
    if state.slides:
        return False
    low, way = state.q.min(axis=0), np.ptp(state.q, axis=0)
    for q in ((state.q - low) / np.maximum(way, 1e-12)).T[way > WIDEST]:
        ends = q[np.abs(q - 0.5) > 0.5 - QUARTER] > 0.5
        if np.count_nonzero(np.diff(ends)) < RETURNS:
            return True
    return False


def polynomials(q: np.ndarray, low: float, high: float, degree: int) -> np.ndarray:
    """Return the Legendre polynomials up to a degree, (..., degree + 1), of positions q (...).

    From `low` to `high` their argument goes from -1 to 1; beyond them it stays.
    """
    return legvander(np.clip(2.0 * (q - low) / (high - low) - 1.0, -1.0, 1.0), degree)


def _lowest(shape: Shape) -> int:
    """Return the degree of the first polynomial of a shape."""
    return int(single(shape.get('lowest', 0.0)))


class PositionTorque(Effect):
    """tau_i += sum_k c_ik P_k(u): Legendre polynomials, k = 0, 1, ..., u = -1 .. 1 over `range`.

    Beyond the range the torque stays what it is at its end. The degree is a shape of its own:
    `diagnose` takes as many terms as the data carry. The weight of a slide that hangs is a base
    term, so that there is nothing for P_0 to tell: the search begins with P_1.
    """

    name = 'position_torque'
    phrase = 'torque that follows the position'
    parameters = (EffectParameter('coefficients', 'N m', 'joint', per_order=True),
                  EffectParameter('range', 'rad', 'machine', size=2, qualifies=True))
    needs_both_ways = True
    of_axis = True

    def shapes(self, state: State) -> tuple[Shape, ...]:
        low, high = float(state.q.min()), float(state.q.max())
        if low == high or goes_on_turning(state):
            return ()
        weighed = {'lowest': 1.0} if state.hanging == 'sliding' else {}
        return tuple({'degree': float(degree), 'low': low, 'high': high, **weighed}
                     for degree in range(1, HIGHEST_DEGREE + 1))

    def free_numbers(self, shape: Shape) -> int:
        return 1  # the degree: the range is that of the motion

    def terms(self, shape: Shape) -> int:
        return int(single(shape['degree']))

    def with_fewer_terms(self, shape: Shape) -> tuple[Shape, ...]:
        return tuple({**shape, 'degree': float(degree)} for degree in range(1, self.terms(shape)))

    def simpler(self, values: Values, std: Values) -> str | None:
        sizes, deviations = (np.atleast_2d(part['coefficients'])[:, 1:] for part in (values, std))
        constant = sizes.size and np.all(np.abs(sizes) <= FLAT * deviations)
        return 'torque_offset' if constant else None

    def with_more_terms(self, shape: Shape, count: int) -> Shape | None:
        return {**shape, 'degree': float(self.terms(shape) + count)}

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        found = polynomials(state.q, single(shape['low']), single(shape['high']),
                            int(single(shape['degree'])))
        return found[..., _lowest(shape):]

    def coefficients(self, values: Values) -> np.ndarray:
        found = values['coefficients']  # (J, K), or (J,) of one term
        return np.reshape(found, (len(found), -1)).T

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        return {'coefficients': np.pad(coefficients.T, ((0, 0), (_lowest(shape), 0))),
                'range': np.array((single(shape['low']), single(shape['high'])))}

    def shape_of(self, values: Values) -> Shape:
        low, high = (float(end) for end in values['range'])
        terms = np.size(values['coefficients'])
        return {'degree': float(terms - 1), 'low': low, 'high': high}

    def torque(self, state: State, values: Values, joints: tuple[int, ...]) -> np.ndarray:
        coefficients = self.coefficients(values)
        columns = self.columns(state, self.shape_of(
            {'coefficients': coefficients[:, 0], 'range': values['range']}))
        torque = np.einsum('njk,kj->nj', columns, coefficients)
        return np.where(np.isin(np.arange(torque.shape[1]), joints), torque, 0.0)

    def reach(self, values: Values) -> tuple[float, float]:
        low, high = (float(end) for end in values['range'])
        coefficients = self.coefficients(values)
        torque = polynomials(np.linspace(low, high, 1001), low, high,
                             len(coefficients) - 1) @ coefficients
        return float(torque.min()), float(torque.max())

    def senseless(self, values: Values) -> str | None:
        low, high = (float(end) for end in values['range'])
        return None if low < high else (
            f'range: expected two positions, the lower one first; found {low:g}, {high:g}')

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.q, 'joint position, rad')
