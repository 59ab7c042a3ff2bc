"""The direction of a joint, to which Coulomb friction is opposed."""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def mean_sign(qd, qdd, period, bend):
    """Return the mean sign of a joint's speed over a time `period` around an instant.

    A joint that turns back does so between two samples. Accelerations that are told by sampled
    positions are means over that time, so that of the friction belongs to them. A sign that changes
    at a sample comes up to half a sample early or late: at 15 G rows beside such a turn are then
    half as loud again as the noise of the torque.

    Args:
        qd, qdd: at the instant, rad/s, rad/s2.
        period: s; zero: the sign at the instant.
        bend: rad/s by which a low-pass of the positions keeps the speed up where the joint turns,
            as friction bends it there; see `State.bend`.
    """
    if bend != 0.0:
        qd += math.copysign(bend, qdd)
    half = 0.5 * abs(qdd) * period
    if abs(qd) < half:
        return qd / half
    return (1.0 if qd > 0.0 else 0.0) - (1.0 if qd < 0.0 else 0.0)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def mean_signs(qd, qdd, period, bend):
    """Return `mean_sign` of the joints' motion (n, J); bend of each joint, (J,)."""
    signs = np.empty_like(qd)
    for row in range(qd.shape[0]):
        for joint in range(qd.shape[1]):
            signs[row, joint] = mean_sign(qd[row, joint], qdd[row, joint], period,
                                          bend[joint])
    return signs
