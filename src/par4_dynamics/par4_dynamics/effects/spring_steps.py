"""The motion of loads behind springs, step by step: compiled.

A step is implicit and of fourth order in the frequency. Slopes obey the same equations of motion as
the motion itself with another right side, so that one pass gives them all.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_dynamics.effects.rest import RESTING_RATE


@numba.njit(cache=True, error_model='numpy', nogil=True)
def swing_through(load, place, by_motion, turning, slipping, friction, motor, soft, compliance,
                  lag, more, h, beta, driven, stiffer, spring, change, told, slopes):
    """Integrate c (M sdd + C sd + K s) + c d sd + s = c T_0 by Newmark's method (1959).

    Its gamma is 1/2, so that nothing is damped by the steps. Only the `soft` joints (k,) twist;
    `compliance`, `lag` and `beta` (k,) are theirs. M, C and K (3, n, J, J) of a row are those of
    its `place`, M without the inertia of the motors, `motor` (J,). T_0 has the friction of joints
    that turn with the load (`LoadFriction`) as if these turned as with motors that do not twist, at
    `slipping` (n, G, 3); `turning` (n, G, 3, J) is by how much they do by the speed of each joint,
    `friction` (2, G) is Coulomb and viscous. A step takes it at the speed that is predicted for it,
    as a damper that takes as much there. `motor` and `soft` are tuples:
    each number of joints is compiled by itself, its loops unrolled. Twist, speed and acceleration
    are told, (3, n, J). `slopes` (n, J, p) are those of the change of the torque by the logarithm
    of each compliance, of the damping ratio and of the motor share, with p = k + 2, or none with
    p = 0. A larger share takes `driven` (n, J) from T_0 and `motor` from M; the logarithm of the
    damping grows with that of the share by `stiffer`.
    """
    joints, count = len(motor), len(soft)
    wanted = slopes.shape[2]
    twist, speed, rate = np.empty(count), np.zeros(count), np.zeros(count)
    twists, speeds, rates = (np.zeros((wanted, count)), np.zeros((wanted, count)),
                             np.zeros((wanted, count)))
    for k in range(count):
        twist[k] = compliance[k] * load[0, soft[k]]
        if wanted > 0:
            twists[k, k] = twist[k]
            twists[count + 1, k] = -compliance[k] * driven[0, soft[k]]
    matrix, inertia = np.empty((count, count)), np.empty((joints, joints))
    by_speed, slipped, ahead = np.empty((joints, joints)), np.zeros(joints), np.empty(count)
    for row in range(len(load)):
        by_twist = by_motion[2, place[row]]
        for i in range(joints):
            for other in range(joints):
                by_speed[i, other] = by_motion[1, place[row], i, other]
        for i in range(joints):
            for other in range(joints):
                inertia[i, other] = by_motion[0, place[row], i, other]
            inertia[i, i] -= motor[i]
        _predicted(soft, twist, speed, rate, h, beta)
        if friction.shape[1] > 0:
            for k in range(count):
                ahead[k] = speed[k] + 0.5 * h * rate[k]
            _slipped(turning[place[row]], slipping[place[row]], friction, soft, ahead, by_speed,
                     slipped)
        for k in range(count):
            slow = more[row] * lag[k]
            for other in range(count):
                matrix[k, other] = compliance[k] * (
                    inertia[soft[k], soft[other]] + 0.5 * h * by_speed[soft[k], soft[other]]
                    + beta[other] * h * h * by_twist[soft[k], soft[other]])
            matrix[k, k] += 0.5 * h * slow + beta[k] * h * h
            rate[k] = compliance[k] * (load[row, soft[k]] + slipped[soft[k]] - _by_twist(
                by_speed[soft[k]], by_twist[soft[k]], soft, speed, twist)
                ) - slow * speed[k] - twist[k]
        _factored(soft, matrix)
        _corrected(soft, matrix, twist, speed, rate, h, beta)
        for i in range(joints):
            change[row, i] = slipped[i] - _by_rate(inertia[i], soft, rate) - _by_twist(
                by_speed[i], by_twist[i], soft, speed, twist)
            spring[row, i] = load[row, i] + change[row, i]
        for k in range(count):
            spring[row, soft[k]] = twist[k] / compliance[k]
            told[0, row, soft[k]] = twist[k]
            told[1, row, soft[k]] = speed[k]
            told[2, row, soft[k]] = rate[k]
        for p in range(wanted):
            _predicted(soft, twists[p], speeds[p], rates[p], h, beta)
            for k in range(count):
                slow = more[row] * lag[k]
                rates[p, k] = (-compliance[k] * _by_twist(
                    by_speed[soft[k]], by_twist[soft[k]], soft, speeds[p], twists[p])
                    - slow * speeds[p, k] - twists[p, k])
                if p == count:
                    rates[p, k] -= slow * speed[k]
                elif p == count + 1:
                    rates[p, k] -= stiffer * slow * speed[k] + compliance[k] * (
                        driven[row, soft[k]] - motor[soft[k]] * rate[k])
                elif p == k:  # c T_0 grows with c, what damps it with its root
                    rates[p, k] += twist[k] + 0.5 * slow * speed[k]
            _corrected(soft, matrix, twists[p], speeds[p], rates[p], h, beta)
            for i in range(joints):
                slopes[row, i, p] = -_by_rate(inertia[i], soft, rates[p]) - _by_twist(
                    by_speed[i], by_twist[i], soft, speeds[p], twists[p])
        if wanted > 0:
            for k in range(count):
                slopes[row, soft[k], count + 1] += motor[soft[k]] * rate[k]


@numba.njit(cache=True, error_model='numpy')
def _slipped(turning, slipping, friction, soft, speed, by_speed, slipped):
    """Add dampers in the place of friction to `by_speed`, and to a load what that leaves of it.

    `slipped` (J,) is the torque of the dampers where nothing twists less that of the friction, N m.
    """
    slipped[:] = 0.0
    for g in range(friction.shape[1]):
        size = fixed = 0.0
        for axis in range(3):
            w = slipping[g, axis]
            fixed += w * w
            for k in range(len(soft)):
                w -= turning[g, axis, soft[k]] * speed[k]
            size += w * w
        damper = friction[1, g] + friction[0, g] / math.sqrt(size + RESTING_RATE ** 2)
        more = damper - friction[1, g] - friction[0, g] / math.sqrt(fixed + RESTING_RATE ** 2)
        for axis in range(3):
            for i in range(len(slipped)):
                slipped[i] += more * turning[g, axis, i] * slipping[g, axis]
                for other in range(len(slipped)):
                    by_speed[i, other] += damper * turning[g, axis, i] * turning[g, axis, other]


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def _predicted(soft, twist, speed, rate, h, beta):
    """Move twist and speed to the next step, but for what its acceleration does."""
    for k in range(len(soft)):
        twist[k] += h * speed[k] + (0.5 - beta[k]) * h * h * rate[k]
        speed[k] += 0.5 * h * rate[k]


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def _corrected(soft, factors, twist, speed, rate, h, beta):
    """Solve for the acceleration, of which `rate` is the right side, and add what it does."""
    count = len(soft)
    for k in range(count):
        for other in range(k):
            rate[k] -= factors[k, other] * rate[other]
    for k in range(count - 1, -1, -1):
        for other in range(k + 1, count):
            rate[k] -= factors[k, other] * rate[other]
        rate[k] *= factors[k, k]
    for k in range(count):
        twist[k] += beta[k] * h * h * rate[k]
        speed[k] += 0.5 * h * rate[k]


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def _factored(soft, matrix):
    """Replace a matrix by its triangular factors, with reciprocals on the diagonal.

    Without pivots: it is an inertia whose rows are scaled, and little more.
    """
    for k in range(len(soft)):
        matrix[k, k] = 1.0 / matrix[k, k]
        for row in range(k + 1, len(soft)):
            matrix[row, k] *= matrix[k, k]
            for column in range(k + 1, len(soft)):
                matrix[row, column] -= matrix[row, k] * matrix[k, column]


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def _by_rate(inertia, soft, rate):
    """Return the torque of a joint that accelerations of the twists take, N m."""
    total = 0.0
    for k in range(len(soft)):
        total += inertia[soft[k]] * rate[k]
    return total


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def _by_twist(by_speed, by_twist, soft, speed, twist):
    """Return the torque of a joint that goes with the twists and their speeds, N m."""
    total = 0.0
    for k in range(len(soft)):
        total += by_speed[soft[k]] * speed[k] + by_twist[soft[k]] * twist[k]
    return total
