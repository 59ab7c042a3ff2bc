"""Zeros and dimensions as unknowns of (20): separable least squares beside all that is no matter.

The torque is linear in base parameters and in what effects of the library add; it is not in the
zeros of the encoders and the dimensions of the robot file. Gauss and Newton move these, with the
kinematics solved anew at every step; everything linear is refitted each time (variable projection,
Golub and Pereyra 1973). Standard deviations are clustered by half seconds (see `clustered`): what
the model lacks is coloured, and counts as often as it comes, not as often as it is sampled.

What is refitted beside the bodies: inertia and friction that all joints share, which is all that a
machine without other faults needs; or as much as the library knows and more: on each joint an
offset, a weight, inertia, friction, a lag of its own and a quadratic polynomial of all positions,
on the platform any constant force and moment, a spring and drag along each axis, friction about
theta, a mass beside the axis of the tool.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.base_terms import FRICTION, INERTIA
from par4_dynamics.effects.rest import fading_sign
from par4_dynamics.imbalance import imbalance_columns
from par4_dynamics.rigid_body import COLUMNS, rigid_body_columns
from par4_dynamics.state import State
from par4_identification.estimators.quadratic import quadratic_columns
from par4_identification.setup_check.clustered import basis_of, clustered_std, clusters_of
from par4_identification.setup_check.equations import (
    Equations,
    Stretch,
    closing,
    columns_at,
    equations_of,
)
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import LEGS, Geometry

JOINT_ALONE = tuple(COLUMNS.index(name) for name in (INERTIA, *FRICTION))
"""Columns of (20) that depend on the motion of one joint alone, whatever its zero."""
PLATFORM = tuple(index for index in range(len(COLUMNS)) if index not in JOINT_ALONE)
DIMENSIONS = ('arm_length', 'forearm_length', 'base_radius', 'platform_bar_length')
"""Base and platform radius act by their difference alone, so one of them stands for both."""
OF_LEGS = ('arm_length', 'forearm_length')
"""Dimensions that a leg may have of its own."""
ERRORS = LEGS + len(DIMENSIONS) + LEGS * len(OF_LEGS)
FIRST_LEG = LEGS + len(DIMENSIONS)
"""Where the errors of single legs begin: those of the arms, then those of the forearms."""
SMALL_STEP = 1e-4
"""rad and m of the finite differences."""
LONGEST_STEP = np.array((np.radians(5.0),) * LEGS + (0.025,) * (ERRORS - LEGS))
"""rad and m of a step of Gauss and Newton."""
STEPS = 8
SETTLED = 1e-4
"""rad and m."""
FEWEST = 100
"""Rows of each joint that are needed."""
SPACING = 0.75
"""Spacing of the rows that count, in half periods of the torque's cut-off."""
REVERSAL = 0.015
"""rad behind a reversal of a joint in which presliding and play have a say."""
FAR = 4.0
"""Ratio of the torque of a force on the platform to the usual from which a pose is too near a
singular one."""

NO_WAVES = np.zeros((2, LEGS))
"""Of the sine and the cosine of the angle of each joint, rad, in what its encoder reads."""


@dataclass(frozen=True)
class Placed:
    """Errors of zeros and dimensions with everything linear refitted.

    Attributes:
        values: of the zeros, rad, as read less true, of `DIMENSIONS`, m, true less that of the
            robot file, and of each leg's `OF_LEGS`, m, alike, (ERRORS,).
        std: of `values`; zero where they were not free.
        left: sum of squares that is left, N2 m2.
        columns: of the bodies, (m, p).
        basis: orthonormal basis of what they span, (m, r).
        chi: their values, (p,).
        residual: (m,) N m.
    """

    values: np.ndarray
    std: np.ndarray
    left: float
    columns: np.ndarray
    basis: np.ndarray
    chi: np.ndarray
    residual: np.ndarray


class Placement:
    """The rows of some logs as a function of zeros and dimensions.

    Args:
        stretches: of the logs; samples that no pose closes are marked as unknown.
        geometry: of the robot file.
        rows: of these, with the errors from which the search begins.
        open_share: of the samples that no pose closes.
        start: these errors, (ERRORS,).

    Attributes:
        size: number of rows that count.
        torque: rms, N m, of the torque in them.
        odd: share of the samples that do not close or lie beside a singular pose.
    """

    def __init__(self, stretches: Sequence[Stretch], geometry: Geometry, rows: Equations,
                 open_share: float, start: np.ndarray) -> None:
        self._stretches, self._geometry = stretches, geometry
        part = stretches[0]
        every = max(1, round(SPACING * 0.5 / (part.cutoff_hz * part.period)))
        loads = self._columns_at(start, _loads)
        lever = np.abs(loads[..., :LEGS]).max(axis=1)
        near = (lever <= FAR * np.median(lever, axis=0)).all(axis=1)
        self.odd = open_share + float(1.0 - near.mean())
        settled = np.concatenate([_travelled(part) for part in stretches]) > REVERSAL
        even = np.arange(len(rows.t)) % every == 0
        self._valid = rows.valid & settled & (near & even)[:, None]
        self.size = int(self._valid.sum())
        self._rows, self._loads = rows, loads
        self._torque = _stacked(rows.tau, self._valid)
        self.torque = float(np.sqrt(np.mean(self._torque ** 2)))
        self._cluster = clusters_of(rows.t, rows.log, self._valid)
        self._take_out(rows.columns[..., list(JOINT_ALONE)])

    def beside_much(self) -> Placement:
        """Return the same rows, beside loads, joints of their own and functions of the pose."""
        other = copy(self)
        other._take_out(np.concatenate(
            (self._loads, _own(self._rows), _polynomials(self._rows.q)), axis=-1))
        return other

    def _take_out(self, columns: np.ndarray) -> None:
        """Take columns (n, J, k), which no error moves, out of the torque and of the bodies'."""
        self._beside = basis_of(_stacked(columns, self._valid))
        self._target = self._reduced(self._torque)

    def _reduced(self, values: np.ndarray) -> np.ndarray:
        """Return values (m, ...) without what is taken out."""
        return values - self._beside @ (self._beside.T @ values)

    def _columns(self, values: np.ndarray, waves: np.ndarray = NO_WAVES) -> np.ndarray:
        """Return the bodies' columns (m, p) for these errors.

        Raises:
            UnreachableError: with these the mechanism does not close.
        """
        return _stacked(self._columns_at(values, _platform_columns, waves), self._valid)

    def _columns_at(self, values: np.ndarray, columns_of: Callable[[State], np.ndarray],
                    waves: np.ndarray = NO_WAVES) -> np.ndarray:
        moved = [replace(part, q=part.q - values[:LEGS] - waves[0] * np.sin(part.q)
                         - waves[1] * np.cos(part.q)) for part in self._stretches]
        return columns_at(moved, with_dimensions(self._geometry, values[LEGS:]),
                          columns_of=columns_of)

    def relative(self, solution: Placed) -> float:
        """Return |residual| / |torque| of a solution, the residual for each degree of freedom."""
        freedom = self.size - self._beside.shape[1] - len(solution.chi)
        return float(np.sqrt(solution.left / max(freedom, 1.0))) / max(self.torque, 1e-12)

    def fitted(self, values: np.ndarray) -> Placed:
        """Return what these errors leave.

        Raises:
            UnreachableError: with these the mechanism does not close.
        """
        return self._fitted(values, self._columns(values))

    def left_if_eccentric(self, joint: int) -> float:
        """Return the squares (N2 m2) that are left if the encoder of a joint is eccentric.

        All else is as in the robot file; amplitude and phase are fitted (Gauss, Newton).

        Raises:
            UnreachableError: so the mechanism does not close.
        """
        nothing, waves = np.zeros(ERRORS), NO_WAVES
        now = self._fitted(nothing, self._columns(nothing))
        for _ in range(STEPS):
            steps = np.zeros((2, 2, LEGS))
            steps[[0, 1], [0, 1], joint] = SMALL_STEP
            slopes = np.stack([self._reduced(
                (self._columns(nothing, waves + step) - now.columns) @ now.chi)
                for step in steps], axis=1) / SMALL_STEP
            slopes -= now.basis @ (now.basis.T @ slopes)
            change = np.linalg.lstsq(slopes, now.residual, rcond=1e-6)[0]
            ahead = waves + np.tensordot(change / SMALL_STEP, steps, axes=1)
            there = self._fitted(nothing, self._columns(nothing, ahead))
            if there.left >= now.left:
                break
            now, waves = there, ahead
            if np.abs(change).max() < SETTLED:
                break
        return now.left

    def _fitted(self, values: np.ndarray, columns: np.ndarray) -> Placed:
        reduced = self._reduced(columns)
        scale = np.maximum(np.linalg.norm(reduced, axis=0), 1e-12)
        left, sizes, right = np.linalg.svd(reduced / scale, full_matrices=False)
        kept = sizes > 1e-6 * sizes[0]
        shares = left.T @ self._target
        chi = right[kept].T @ (shares[kept] / sizes[kept]) / scale
        residual = self._target - left[:, kept] @ shares[kept]
        return Placed(values, np.zeros(ERRORS), float(residual @ residual), columns,
                      left[:, kept], chi, residual)

    def _slopes(self, solution: Placed, free: Sequence[int]) -> np.ndarray:
        """Return how the residual falls with some errors, the bodies refitted, (m, k)."""
        found = []
        for index in free:
            for step in (SMALL_STEP, -SMALL_STEP):
                ahead = solution.values.copy()
                ahead[index] += step
                try:
                    change = self._columns(ahead) - solution.columns
                except UnreachableError:
                    continue
                found.append(self._reduced(change @ solution.chi) / step)
                break
            else:
                raise UnreachableError('no step of an error keeps the mechanism closed')
        slopes = np.stack(found, axis=1)
        return slopes - solution.basis @ (solution.basis.T @ slopes)

    def linear(self, nothing: Placed, groups: Sequence[Sequence[int]]
               ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return values and deviations that groups of errors would have if all were linear."""
        slopes = self._slopes(nothing, range(ERRORS))
        found = []
        for group in groups:
            own = slopes[:, list(group)]
            step = np.linalg.lstsq(own, nothing.residual, rcond=1e-6)[0]
            found.append((step, self._std(nothing, own, nothing.residual - own @ step)))
        return found

    def solve(self, free: Sequence[int], start: np.ndarray) -> Placed:
        """Return the best values of some errors, the others as they are (Gauss, Newton).

        Raises:
            UnreachableError: with `start` the mechanism does not close.
        """
        free = list(free)
        now = self.fitted(start)
        slopes = self._slopes(now, free)
        for _ in range(STEPS):
            step = np.linalg.lstsq(slopes, now.residual, rcond=1e-6)[0]
            step *= min(1.0, float(np.min(LONGEST_STEP[free] / np.maximum(np.abs(step), 1e-12))))
            ahead = self._descended(now, free, step)
            if ahead is None:
                break
            settled = np.abs(ahead.values - now.values).max() < SETTLED
            now, slopes = ahead, self._slopes(ahead, free)
            if settled:
                break
        std = np.zeros(ERRORS)
        std[free] = self._std(now, slopes, now.residual)
        return replace(now, std=std)

    def _descended(self, now: Placed, free: Sequence[int], step: np.ndarray) -> Placed | None:
        """Return the solution a step or a part of it ahead; None where nothing is gained."""
        for part in (1.0, 0.4, 0.16, 0.06):
            values = now.values.copy()
            values[free] += part * step
            try:
                trial = self.fitted(values)
            except UnreachableError:
                continue
            if trial.left < now.left:
                return trial
        return None

    def _std(self, solution: Placed, slopes: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Return clustered standard deviations of values with these slopes (m, k)."""
        beside = np.column_stack((self._beside, solution.basis))
        return clustered_std(slopes, residual, self._cluster, beside)


def placement_at(stretches: Sequence[Stretch], geometry: Geometry, start: np.ndarray
                 ) -> Placement | None:
    """Return the rows that can be used with errors (ERRORS,); None where hardly a sample closes.

    Args:
        stretches: of the logs, positions as they were read.
        geometry: of the robot file.
        start: errors of zeros and dimensions from which the search begins.
    """
    zeros, there = start[:LEGS], with_dimensions(geometry, start[LEGS:])
    closed = [closing(replace(part, q=part.q - zeros), there) for part in stretches]
    try:
        rows = equations_of(closed, there)
    except UnreachableError:
        return None
    if (rows.valid.sum(axis=0) < FEWEST).any():
        return None
    samples = sum(len(part.t) for part in stretches)
    moved = sum(int((old.q - zeros != new.q).any(axis=1).sum())
                for old, new in zip(stretches, closed, strict=True))
    return Placement([replace(part, q=part.q + zeros) for part in closed], geometry, rows,
                     moved / samples, start)


def with_dimensions(geometry: Geometry, errors: np.ndarray) -> Geometry:
    """Return the geometry with dimensions changed by `errors` (ERRORS - LEGS,), m.

    A radius may fall below 0.
    """
    if not errors.any():
        return geometry
    common, of_legs = np.split(errors, (len(DIMENSIONS),))
    names = [*DIMENSIONS, *(f'{name}_errors' for name in OF_LEGS)]
    return geometry.with_errors(
        **dict(zip(names, (*common, *of_legs.reshape(-1, LEGS)), strict=True)))


def _travelled(stretch: Stretch) -> np.ndarray:
    """Return how far each joint has come since it last turned round, (n, J) rad."""
    forward = stretch.qd > 0.0
    turned = np.concatenate((np.ones_like(forward[:1]), forward[1:] != forward[:-1]))
    last = np.maximum.accumulate(np.where(turned, np.arange(len(forward))[:, None], 0), axis=0)
    return np.abs(stretch.q - np.take_along_axis(stretch.q, last, axis=0))


def _platform_columns(state: State) -> np.ndarray:
    return rigid_body_columns(state)[..., list(PLATFORM)]


def _loads(state: State) -> np.ndarray:
    """Return the torque (n, J, 14) of loads on the platform: forces and a moment, springs and drag
    along three axes, friction about theta, a mass of the tool beside its axis."""
    units = np.eye(LEGS)
    forces = [state.torque_of_force(unit) for unit in units]
    platform = state.platform
    away = platform.x[:, :3] - platform.x[:, :3].mean(axis=0)
    rate = platform.xd[:, 3:]
    springs = [forces[axis] * away[:, [axis]] for axis in range(3)]
    drags = [forces[axis] * platform.xd[:, [axis]] for axis in range(3)]
    turning = [forces[3] * part for part in (rate, fading_sign(rate))]
    return np.concatenate((np.stack(forces + springs + drags + turning, axis=-1),
                           imbalance_columns(state)), axis=-1)


def _own(rows: Equations) -> np.ndarray:
    """Return the torque (m, J, 7 J) of offset, weight, inertia, friction and lag of each joint."""
    rate = np.gradient(rows.tau, axis=0) / np.maximum(np.gradient(rows.t), 1e-9)[:, None]
    parts = np.stack((np.ones_like(rows.q), np.sin(rows.q), np.cos(rows.q), rate,
                      *(rows.columns[..., index] for index in JOINT_ALONE)), axis=-1)
    return (parts[:, :, None, :] * np.eye(LEGS)[:, :, None]).reshape(*rows.q.shape, -1)


def _polynomials(q: np.ndarray) -> np.ndarray:
    """Return linear and quadratic functions of the positions (m, J) on each joint, (m, J, k)."""
    functions = quadratic_columns(q)[:, 1:]
    return (functions[:, None, None, :] * np.eye(LEGS)[:, :, None]).reshape(*q.shape, -1)


def _stacked(values: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Return values (n, J, ...) at rows that count (n, J), joint after joint."""
    return np.concatenate([values[valid[:, joint], joint] for joint in range(LEGS)])
