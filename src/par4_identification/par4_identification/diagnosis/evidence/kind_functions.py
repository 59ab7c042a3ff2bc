"""Functions of the motion that kinds of unnamed causes are made of, and their scales.

Each function returns columns (n, J, k) of a motion, N m per unit coefficient, of the size 1 on the
fitted data.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
import scipy
from numpy.polynomial.legendre import legvander

from par4_dynamics.effects.cogging import waves_of_orders
from par4_dynamics.effects.rest import fading_sign
from par4_dynamics.effects.shifted import shift_columns
from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.imbalance import imbalance_columns
from par4_dynamics.state import State

SLIPS = np.geomspace(1e-3, 0.5, 9)
"""rad: deflections at which the springs of friction with a memory slip."""
RELAXATIONS = (0.1, 0.4, 1.6, 6.4)
"""s: times in which the force of a spring that creeps dies away."""
READING_DEGREE = 3
"""Of the polynomial of a joint's position by which its reading may be wrong."""
Periods = tuple[tuple[int, ...], ...]
"""Periods a turn, of each joint."""


@dataclass(frozen=True)
class PlatformRanges:
    """Scales of the platform's motion in the fitted data, (4,) each.

    Attributes:
        x: lowest and highest pose.
        xd, xdd: largest speed and acceleration.
        force: forces, N, and moment, N m, each of which takes joint torques of 1 N m (rms).
    """

    x: tuple[np.ndarray, np.ndarray]
    xd: np.ndarray
    xdd: np.ndarray
    force: np.ndarray

    def place(self, x: np.ndarray) -> np.ndarray:
        """Return poses (n, 4) in -1 .. 1 of the fitted ones."""
        return _within(x, *self.x)


@dataclass(frozen=True)
class Ranges:
    """Scales and periods of the fitted data, which make a kind the same function on others."""

    q: tuple[np.ndarray, np.ndarray]
    qd: np.ndarray
    qdd: np.ndarray
    torque: np.ndarray
    end: float
    platform: PlatformRanges | None
    periods: Periods = ()
    step: float = 1.0

    def waves(self, state: State) -> np.ndarray:
        """Return sines and cosines (n, J, 2 k) of the periods, which are multiples of `step`."""
        return waves_of_orders(state, self.periods, self.step)

    def place(self, q: np.ndarray) -> np.ndarray:
        """Return joint positions (n, J) in -1 .. 1 of the fitted ones."""
        return _within(q, *self.q)

    @property
    def of_platform(self) -> PlatformRanges:
        """The scales of the platform.

        Raises:
            TypeError: the machine has none.
        """
        if self.platform is None:
            raise TypeError('an axis has no platform')
        return self.platform


def _within(values: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return values in -1 .. 1 of low .. high."""
    return 2.0 * (values - low) / np.maximum(high - low, 1e-12) - 1.0


def splines(values: np.ndarray, low: np.ndarray, high: np.ndarray, count: int) -> np.ndarray:
    """Return cubic B-splines (n, J, count) of values (n, J) over low .. high (J,)."""
    unit = np.clip((values - low) / np.maximum(high - low, 1e-12), 0.0, 1.0)
    knots = np.concatenate(([0.0] * 3, np.linspace(0.0, 1.0, count - 2), [1.0] * 3))
    # they are inside, which it would look for one by one, in most of its time
    flat = scipy.interpolate.BSpline.design_matrix(
        np.minimum(unit.ravel(), 1.0 - 1e-12), knots, 3, extrapolate=True).toarray()
    return flat.reshape(*values.shape, count)


def position(state: State, ranges: Ranges) -> np.ndarray:
    """Return a smooth function of each joint's position."""
    return splines(state.q, *ranges.q, 10)


def speed(state: State, ranges: Ranges) -> np.ndarray:
    """Return a function of each joint's speed that turns over with it, fine at low speeds."""
    sign = state.direction
    if state.geometry is None:  # of an axis, whose speeds may be any, and whose ways may differ
        decays = [np.exp(-(state.qd / (share * ranges.qd)) ** 2) for share in (0.01, 0.03, 0.1)]
        slow = [decay * part for decay in decays for part in (sign, np.ones_like(sign))]
    else:
        slow = [np.exp(-(state.qd / low) ** 2) * sign for low in (0.05, 0.15, 0.5)]
    smooth = splines(np.abs(state.qd), np.zeros_like(ranges.qd), ranges.qd, 6)
    return np.concatenate((np.stack([*slow, np.ones_like(sign), np.abs(state.qd)], axis=-1),
                           smooth * sign[..., None]), axis=-1)


def time(state: State, ranges: Ranges) -> np.ndarray:
    """Return a smooth function of the time."""
    times = np.broadcast_to(state.t[:, None], state.q.shape)
    return splines(times, np.zeros(state.joints), np.full(state.joints, ranges.end), 6)


def acceleration(state: State, ranges: Ranges) -> np.ndarray:
    """Return the acceleration, its size and direction, and both with the position."""
    scaled = state.qdd / ranges.qdd
    angle = ranges.place(state.q) if state.slides else state.q
    bent = [np.sin(angle) * scaled, np.cos(angle) * scaled, state.direction * np.abs(scaled),
            (state.qd / ranges.qd) ** 2 * np.cos(angle)]
    return np.stack([scaled, np.abs(scaled), *bent], axis=-1)


def platform(state: State, ranges: Ranges) -> np.ndarray:
    """Return pose, speed and acceleration of the platform, and products of these, of all axes."""
    motion, scales = state.platform, ranges.of_platform
    x, xd, xdd = scales.place(motion.x), motion.xd / scales.xd, motion.xdd / scales.xdd
    parts = [x, xd, xdd, *(xdd * x[:, [axis]] for axis in range(4)),
             *(xd * xd[:, [axis]] for axis in range(4))]
    features = np.concatenate(parts, axis=1)
    return np.broadcast_to(features[:, None, :], (*state.q.shape, features.shape[1]))


def periodic(state: State, ranges: Ranges) -> np.ndarray:
    """Return waves over the position of each joint."""
    return ranges.waves(state)


def torque(state: State, ranges: Ranges) -> np.ndarray:
    """Return the delivered torque times waves over the position."""
    return state.delivered[..., None] * ranges.waves(state)


def rate(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    """Return the rate of the delivered torque."""
    # The second rate would do, too, but the noise of encoder counts in it is that of the torque.
    return time_rate(state, state.delivered)[..., None]


def reading(state: State, ranges: Ranges) -> np.ndarray:
    """Return what positions make of the torque that are misread by a polynomial of themselves."""
    errors = legvander(ranges.place(state.q), READING_DEGREE)  # (n, J, k), by its own position
    return np.concatenate([shift_columns(state.halfway, errors[..., degree])
                           for degree in range(READING_DEGREE + 1)], axis=-1)


def load(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    """Return the delivered torque, and its size in the direction of the speed."""
    delivered = state.delivered
    return np.stack((delivered, np.abs(delivered) * state.direction), axis=-1)


def wrench(state: State, ranges: Ranges) -> np.ndarray:
    """Return joint torques of forces on the platform: constant, by place, side and speed."""
    motion, scales = state.platform, ranges.of_platform
    x, xd = scales.place(motion.x), motion.xd / scales.xd
    side = np.concatenate((np.sign(xd[:, :3]), fading_sign(motion.xd[:, 3:])), axis=1)
    forces = scales.force * np.stack((np.ones_like(x), x, side, xd, np.abs(xd) * xd))
    return np.stack([state.torque_of_force(axis * force)
                     for axis in np.eye(4) for force in forces], axis=-1)


def imbalance(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    """Return joint torques of a mass of the tool beside its axis, along x and along y."""
    return imbalance_columns(state)


def place(state: State, ranges: Ranges) -> np.ndarray:
    """Return friction that is a smooth function of the position."""
    return splines(state.q, *ranges.q, 20) * state.direction[..., None]


def uneven(state: State, ranges: Ranges) -> np.ndarray:
    """Return friction that has a level and waves around it over the position."""
    waves = ranges.waves(state)
    level = np.ones_like(waves[..., :1])
    return np.concatenate((level, waves), axis=-1) * state.direction[..., None]


def memory(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    """Return springs that slip at a deflection, those of `SLIPS`."""
    return elastic_slip(np.ascontiguousarray(state.q), SLIPS)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def elastic_slip(q, slips):
    """Return springs that follow q (n, J) and slip at a deflection, (n, J, k), over that.

    Prandtl's stop operators: their sums make any friction with a memory of the way it came
    (Maxwell slip, Dahl, Bouc and Wen).
    """
    share = np.zeros((*q.shape, len(slips)))
    for row in range(1, q.shape[0]):
        for joint in range(q.shape[1]):
            step = q[row, joint] - q[row - 1, joint]
            for k in range(len(slips)):
                moved = share[row - 1, joint, k] + step / slips[k]
                share[row, joint, k] = min(max(moved, -1.0), 1.0)
    return share


def pose(state: State, ranges: Ranges) -> np.ndarray:
    """Return friction of the joints that changes with the pose of the platform."""
    x = ranges.of_platform.place(state.platform.x)
    features = np.concatenate((np.ones_like(x[:, :1]), x, x ** 2), axis=1)
    return features[:, None, :] * state.direction[..., None]


def creep(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    """Return a spring at rest anywhere, and others whose forces die away with `RELAXATIONS`."""
    start = state.q[0]
    period = (state.t[-1] - state.t[0]) / max(len(state.t) - 1, 1)
    columns = [np.ones_like(state.q), state.q]
    for relaxation in RELAXATIONS:
        moved = state.q - start
        columns.append(moved - _crept(moved, np.exp(-period / relaxation)))
    return np.stack(columns, axis=-1)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _crept(moved, kept):
    """Return where the dampers of springs in series come that are moved (n, J).

    From sample to sample they keep this share of their distance. `scipy.signal` has this filter,
    too, but takes a second to load.
    """
    crept = np.empty_like(moved)
    crept[0] = (1.0 - kept) * moved[0]
    for row in range(1, len(moved)):
        crept[row] = (1.0 - kept) * moved[row] + kept * crept[row - 1]
    return crept


def gain(state: State, ranges: Ranges) -> np.ndarray:
    """Return what a gain adds that changes with the time, the torque or the speed."""
    delivered = state.delivered
    drifts = time(state, ranges) * delivered[..., None]
    bent = [np.tanh(delivered / (share * ranges.torque)) for share in (0.03, 0.1, 0.3)]
    bent += [delivered * np.abs(part) / scale
             for part, scale in ((delivered, ranges.torque), (state.qd, ranges.qd))]
    return np.concatenate((drifts, np.stack(bent, axis=-1)), axis=-1)


def coupling(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    """Return the delivered torques of the other joints."""
    delivered = state.delivered
    return np.stack([np.delete(delivered, joint, axis=1) for joint in range(state.joints)], axis=1)


def drift(state: State, ranges: Ranges) -> np.ndarray:
    """Return Coulomb and viscous friction that are smooth functions of the time."""
    over_time = time(state, ranges)
    return np.concatenate([over_time * part[..., None] for part in (
        state.direction, state.qd / ranges.qd)], axis=-1)


Function = Callable[[State, Ranges], np.ndarray]
"""Columns (n, J, k) of a motion at these scales."""
