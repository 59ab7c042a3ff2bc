"""Coulomb friction that builds up over a distance after each reversal (Dahl)."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numba
import numpy as np

from par4_dynamics.effects.asymmetry import ASYMMETRY
from par4_dynamics.effects.effect import (
    FAST,
    Base,
    Effect,
    EffectParameter,
    Shape,
    Signature,
    Values,
    beyond,
    single,
)
from par4_dynamics.effects.grid import around
from par4_dynamics.effects.position_torque import WIDEST
from par4_dynamics.state import State

DISTANCES = np.geomspace(2e-4, 3.2e-2, 9)
"""rad, of an arm."""
OF_TRAVEL = np.geomspace(5e-5, 2.5e-2, 11)
"""The same of a slide, over its travel, as a length has no scale of its own, and of a motor that
turns often."""
LONGEST, LONGEST_OF_AXIS = 0.1, 1.0
"""rad, of an axis rad or m: its position may be that of a motor before a gear or a screw."""
STROKE = 2.0
"""Strokes over the distance from which on friction has built up and tells of it."""
BACK = 0.05
"""Share of the travel that must go in such strokes in either direction."""


@numba.njit(cache=True, error_model='numpy', nogil=True)
def dahl_sample(share, dq, distance):
    """Return the share z of the Coulomb level after a step dq without reversal, exactly.

    dz/dq = (1 - z sign(qd)) / distance.
    """
    side = float(np.sign(dq))
    return side + (share - side) * math.exp(-abs(dq) / distance)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _share_rows(q, distance, share):
    for row in range(1, q.shape[0]):
        for joint in range(q.shape[1]):
            share[row, joint] = dahl_sample(share[row - 1, joint],
                                            q[row, joint] - q[row - 1, joint], distance)


def built_up(q: np.ndarray, distance: float, start: np.ndarray | float = 0.0) -> np.ndarray:
    """Return the share -1 .. 1 of the Coulomb level that friction has along positions (n, J).

    It builds up over `distance`, in the unit of the positions, from `start`, (J,) or one number.
    """
    share = np.empty(q.shape)
    share[:1] = start
    _share_rows(np.ascontiguousarray(q, dtype=float), distance, share)
    return share


def levels_of(whole: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the dry friction of the joints, the mean of both directions and half the difference.

    Each is (J,), N m; `whole` is that of `Nominal`.
    """
    level = whole['coulomb_friction']
    return level, whole.get(ASYMMETRY, np.zeros_like(level))


def plateaus(level: np.ndarray, asymmetry: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return the dry friction (n, J), N m, that has built up to a share (n, J) of -1 .. 1.

    Args:
        level: f_c, the mean of both directions, (J,) N m.
        asymmetry: half their difference, (J,) N m.
        share: of the level of the direction.
    """
    return level * share + asymmetry * np.abs(share)


def _goes_both_ways(q: np.ndarray, stroke: float) -> bool:
    """Return whether a joint of a motion (n, J) goes to and fro by strokes of that length.

    Where it always goes one way and jerks back a little, friction never builds up the other way.
    """
    for positions in q.T:
        steps = np.diff(positions)
        turns = np.flatnonzero(np.diff(np.sign(steps)) != 0) + 1
        strokes = np.diff(positions[np.r_[0, turns, len(positions) - 1]])
        long = strokes[np.abs(strokes) >= stroke]
        travel = float(np.sum(np.abs(strokes)))
        if min(np.sum(long[long > 0.0]), -np.sum(long[long < 0.0])) > BACK * travel:
            return True
    return False


class Presliding(Effect):
    """tau_i += f_c (z - sign(qd)): f_c z takes the place of f_c sign(qd) of (20).

    f_c is the level of the joint and of the direction where these differ by an effect. z is 0 at
    the start of a log and approaches sign(qd) over `distance`; references that come one after the
    other are one motion, see `Feedforward`.
    """

    name = 'presliding'
    phrase = 'elastic presliding before friction breaks away'
    friction_term = 'coulomb_friction'
    parameters = (EffectParameter(
        'distance', 'rad', 'machine', is_shape=True, vanishing=True, positive=True,
        meaning='D of dz/dq = (1 - z sign(qd)) / D, with z = 0 at the first stamp'),)
    needs_nominal = True
    fixed_coefficients = True
    variables = 2

    def shapes(self, state: State) -> tuple[Shape, ...]:
        span = float(np.max(np.ptp(state.q, axis=0)))
        distances = span * OF_TRAVEL if state.slides or span > WIDEST else DISTANCES
        return tuple({'distance': float(distance)} for distance in distances
                     if distance < span and _goes_both_ways(state.q, STROKE * distance))

    def refined(self, shape: Shape, step: float) -> tuple[Shape, ...]:
        return around('distance', single(shape['distance']), (DISTANCES[1] / DISTANCES[0]) ** step)

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        share = built_up(state.q, single(shape['distance']))
        level, asymmetry = levels_of(state.known.whole)
        at_once = level * state.direction + asymmetry * (state.qd != 0.0)
        return (plateaus(level, asymmetry, share) - at_once)[..., None]

    def coefficients(self, values: Values) -> np.ndarray:
        return np.ones_like(values['distance'])[None]

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        distance = float(values['distance'][0])
        longest, unit = (LONGEST_OF_AXIS, 'rad or m') if FAST in base else (LONGEST, 'rad')
        if beyond(distance, std['distance'][0], 0.0, longest) is not None:
            return (f'friction builds up within a positive distance of at most {longest:g} {unit}, '
                    f'found {distance:.3g}')
        return None

    def signature(self, state: State) -> Signature:
        side = np.sign(np.diff(state.q, axis=0, prepend=state.q[:1]))
        # the row before a step of another sign is the reversal
        turns = np.zeros(state.q.shape, dtype=int)
        turns[1:-1] = np.where(side[2:] != side[1:-1], np.arange(1, len(side) - 1)[:, None], 0)
        last = np.maximum.accumulate(turns, axis=0)
        return Signature(state.q - np.take_along_axis(state.q, last, axis=0),
                         'travel since the last reversal, rad')
