"""Zeros of the encoders and dimensions of the robot file that are far off.

The torque is linear in the base parameters but not in zeros and dimensions. These are found by
Gauss and Newton with the kinematics solved anew at every step and the base parameters refitted
(separable least squares). Errors are added one at a time, the one that explains most first, and
each must explain much: what little a friction law can borrow from four zeros is no mistake of the
setup. Small errors are the library's (encoder_offset, geometry_error) and left to the diagnosis.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.base_terms import base_columns
from par4_dynamics.rigid_body import COLUMNS, rigid_body_columns
from par4_dynamics.state import State
from par4_identification.logs.log import Log
from par4_identification.setup_check.equations import Equations, Stretch, equations_of
from par4_identification.setup_check.finding import Finding
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.robot import Robot
from par4_sim.report.words import in_words, listed, number, percent

JOINT_ALONE = tuple(COLUMNS.index(name) for name in (
    'actuator_inertia', 'coulomb_friction', 'viscous_friction'))
"""Columns of (20) that depend on the motion of one joint alone."""
PLATFORM = tuple(index for index in range(len(COLUMNS)) if index not in JOINT_ALONE)
DIMENSIONS = ('arm_length', 'forearm_length', 'base_radius', 'platform_bar_length')
"""Base and platform radius act by their difference alone, so one of them stands for both."""
ERRORS = LEGS + len(DIMENSIONS)
BAR = ERRORS - 1
SMALLEST = np.array((math.radians(1.0),) * LEGS + (6e-3,) * len(DIMENSIONS))
"""rad and m from which an error is a mistake of the setup."""
SMALL_STEP = np.array((1e-4,) * ERRORS)
"""rad and m of the finite differences."""
LONGEST_STEP = np.array((math.radians(5.0),) * LEGS + (0.025,) * len(DIMENSIONS))
LARGEST = np.array((math.radians(20.0),) * LEGS + (0.08,) * len(DIMENSIONS))
STEPS = 7
SETTLED = 1e-5
"""rad and m."""
FEWER, FEWER_DIMENSION, FEWER_BAR = 0.93, 0.965, 0.93
"""Most of the squared error in motion that one more error may leave, while zeros and while only
dimensions are looked for, and where it is the bar's. Effects of the library leave 0.96, 0.972 and
0.955."""
FEWER_ZERO = 0.92
"""The same of all that was found in the first place."""
BETTER = 0.97
"""Most of the squared error of errors found one by one that all zeros together must leave."""
KEPT = 1.08
"""Factor by which the squared error must rise without an error that is kept."""
SURE = 11.0
"""Standard deviations of white residuals by which a mistake stands out; residuals are not white."""
LARGEST_ERROR = 0.3
"""|residual| / |torque| in motion with which the rest is believed."""
MOST = 5
"""Errors that are looked for together."""
SAMPLES, LEAST_RATE = 1500, 3.0
"""About how many samples are enough, and the least rate of them, in cut-offs of the torque."""
TRIED = 2
"""Candidates that are fitted before one is added."""


@dataclass(frozen=True)
class Calibration:
    """Errors of zeros and dimensions.

    Attributes:
        values: of each zero, rad, as read less true, and each of `DIMENSIONS`, m, true less that
            of the robot file; zero where there is no mistake.
        std: of `values`, for white residuals.
        before, after: |residual| / |torque| in motion without and with them.
    """

    values: np.ndarray
    std: np.ndarray
    before: float
    after: float

    @property
    def zeros(self) -> np.ndarray:
        """Error of each zero, rad, (LEGS,)."""
        return self.values[:LEGS]

    def mended(self, log: Log) -> Log:
        """Return the log with the zeros taken off."""
        return replace(log, q=log.q - self.zeros) if self.zeros.any() else log

    def right_robot(self, robot: Robot) -> Robot:
        """Return the robot with the dimensions that were found."""
        if not self.values[LEGS:].any():
            return robot
        return robot.model_copy(update={
            'geometry': with_dimensions(robot.geometry, self.values[LEGS:])})


def with_dimensions(geometry: Geometry, errors: np.ndarray) -> Geometry:
    """Return the geometry with `DIMENSIONS` changed by `errors`, m; a radius may fall below 0."""
    content = geometry.model_dump()
    return Geometry.model_construct(**{**content, **{
        name: content[name] + float(error)
        for name, error in zip(DIMENSIONS, errors, strict=True)}})


def _platform_columns(state: State) -> np.ndarray:
    return rigid_body_columns(state)[..., list(PLATFORM)]


def _pulls(state: State) -> np.ndarray:
    """Return the torque (n, J, 36) of forces on the platform that grow with its position, and of
    offset, weight, inertia and friction of each arm by itself."""
    forces = [state.torque_of_force(axis) for axis in np.eye(LEGS)]
    away = state.x[:, :3] - state.x[:, :3].mean(axis=0)
    columns = forces + [force * away[:, [axis]] for force in forces for axis in range(3)]
    for joint in np.eye(LEGS):
        columns += [np.broadcast_to(joint, state.q.shape), joint * np.cos(state.q),
                    joint * state.qdd, joint * state.qd, joint * np.sign(state.qd)]
    return np.stack(columns, axis=-1)


def _turning(state: State) -> np.ndarray:
    """Return the torque (n, J, 2) of Coulomb and viscous friction about theta."""
    rate = state.xd[:, 3:]
    return np.stack([state.torque_of_force(np.eye(LEGS)[3] * part)
                     for part in (np.sign(rate), rate)], axis=-1)


def _rates(rows: Equations) -> np.ndarray:
    """Return the rate of the torque (m, J), N m/s: what a drive that lags adds."""
    step = np.gradient(rows.t)
    return np.gradient(rows.tau, axis=0) / np.maximum(step, 1e-9)[:, None]


@dataclass(frozen=True)
class _Solution:
    values: np.ndarray
    std: np.ndarray
    left: float
    chi: np.ndarray


class _Problem:
    """The platform's part of (22) as a function of zeros and dimensions.

    What is not to decide is taken out of torque and columns: friction about theta, a lag of each
    drive, and for zeros all that a joint does by itself, with inertia and friction of its own and
    a quadratic polynomial of the positions; none of this changes with a zero, as a polynomial of
    shifted positions is one of the positions. Dimensions show in how gravity changes with the pose,
    so for them it is what pulls at the platform instead (`_pulls`).
    """

    def __init__(self, stretches: Sequence[Stretch], geometry: Geometry, rows: Equations,
                 zeros: bool) -> None:
        self._stretches, self._geometry, self._valid = stretches, geometry, rows.valid
        turning = equations_of(stretches, geometry, columns_of=_turning).columns
        rates = _rates(rows)
        if zeros:
            self._own = []
            for joint in range(LEGS):
                own = np.column_stack((rows.columns[:, joint, list(JOINT_ALONE)],
                                       rates[:, joint], turning[:, joint]))
                self._own.append(np.linalg.qr(np.column_stack((
                    rows.slack[joint], rows.without_slack(own, joint))))[0])
        else:
            pulls = equations_of(stretches, geometry, columns_of=_pulls).columns
            late = rates[..., None] * np.eye(LEGS)
            everything = np.concatenate((pulls, turning, late), axis=-1)
            self._own = np.linalg.qr(np.concatenate([
                everything[self._valid[:, joint], joint] for joint in range(LEGS)]))[0]
        self.target = self._reduced(rows.tau)

    def _reduced(self, values: np.ndarray) -> np.ndarray:
        """Return values (m, J, ...) at valid rows, joint after joint, without what is taken out."""
        parts = [values[self._valid[:, joint], joint] for joint in range(LEGS)]
        if isinstance(self._own, list):
            return np.concatenate([rows - basis @ (basis.T @ rows)
                                   for rows, basis in zip(parts, self._own, strict=True)])
        rows = np.concatenate(parts)
        return rows - self._own @ (self._own.T @ rows)

    def columns(self, values: np.ndarray) -> np.ndarray:
        """Return the columns (m, J, p), rods and bars among them, for these errors."""
        return self.rows(values, _platform_columns).columns

    def rows(self, values: np.ndarray, columns_of: Callable[[State], np.ndarray] = base_columns
             ) -> Equations:
        """Return the equations for these errors."""
        moved = [replace(part, q=part.q - values[:LEGS]) for part in self._stretches]
        return equations_of(moved, with_dimensions(self._geometry, values[LEGS:]),
                            columns_of=columns_of)

    def slopes(self, values: np.ndarray, chi: np.ndarray, torque: np.ndarray,
               which: Sequence[int]) -> np.ndarray:
        """Return d(W chi)/d(errors) (m, k) of some errors."""
        found = []
        for index in which:
            ahead = values.copy()
            ahead[index] += SMALL_STEP[index]
            found.append(self._reduced(self.columns(ahead) @ chi - torque) / SMALL_STEP[index])
        return np.stack(found, axis=1)

    def solve(self, free: Sequence[int], start: np.ndarray) -> _Solution:
        """Return the best values of some errors, the others as they are (Gauss, Newton)."""
        free, values = list(free), start.copy()
        best = self._fitted(values)
        std = np.zeros(ERRORS)
        for _ in range(STEPS if free else 0):
            columns = self.columns(best.values)
            base = self._reduced(columns)
            residual = self.target - base @ best.chi
            slopes = self.slopes(best.values, best.chi, columns @ best.chi, free)
            basis = np.linalg.qr(base)[0]  # what the base parameters can mimic is taken out
            slopes = slopes - basis @ (basis.T @ slopes)
            step, _, _, _ = np.linalg.lstsq(slopes, residual, rcond=1e-6)
            inverse = np.linalg.pinv(slopes.T @ slopes, rcond=1e-10, hermitian=True)
            std = np.zeros(ERRORS)
            std[free] = np.sqrt(np.maximum(np.diag(inverse), 0.0) * best.left
                                / max(len(residual), 1))
            step *= min(1.0, float(np.min(LONGEST_STEP[free] / np.maximum(np.abs(step), 1e-12))))
            for _ in range(3):
                values = best.values.copy()
                values[free] += step
                try:
                    trial = self._fitted(values)
                except UnreachableError:
                    trial = None
                if trial is not None and trial.left < best.left:
                    break
                step = 0.4 * step
            else:
                break
            best = trial
            if np.abs(step).max() < SETTLED:
                break
        return replace(best, std=std)

    def _fitted(self, values: np.ndarray) -> _Solution:
        base = self._reduced(self.columns(values))
        information = base.T @ base
        moment = base.T @ self.target
        chi = np.linalg.lstsq(information, moment, rcond=1e-10)[0]
        residual = self.target - base @ chi
        return _Solution(values, np.zeros(ERRORS), float(residual @ residual), chi)

    def nearest(self, solution: _Solution, chosen: Sequence[int], among: Sequence[int]
                ) -> list[int]:
        """Return errors that are not chosen, the one that promises most first."""
        columns = self.columns(solution.values)
        base = self._reduced(columns)
        residual = self.target - base @ solution.chi
        slopes = self.slopes(solution.values, solution.chi, columns @ solution.chi, range(ERRORS))
        basis = np.linalg.qr(np.column_stack((base, slopes[:, list(chosen)])))[0]
        slopes = slopes - basis @ (basis.T @ slopes)
        gain = (slopes.T @ residual) ** 2 / np.maximum(np.sum(slopes ** 2, axis=0), 1e-30)
        return [int(index) for index in np.argsort(-gain)
                if index in among and index not in chosen]


def calibration_of(stretches: Sequence[Stretch], geometry: Geometry, rows: Equations
                   ) -> Calibration | None:
    """Return the zeros and dimensions that are far off, or None.

    Zeros are looked for first, beside joints that have inertia and friction of their own, together
    with dimensions, which otherwise would pass for zeros; then dimensions alone, which show best
    where all joints are alike.

    Args:
        stretches: of the logs.
        geometry: of the robot file.
        rows: of these.
    """
    if (rows.valid.sum(axis=0) < 100).any():
        return None
    every = min(max(1, round(len(rows.t) / SAMPLES)), max(1, round(
        1.0 / (stretches[0].period * LEAST_RATE * stretches[0].cutoff_hz))))
    if every > 1:
        stretches = [part.thinned(every) for part in stretches]
        rows = equations_of(stretches, geometry)
    for alone, among, fewer, least in ((True, range(ERRORS), FEWER, FEWER_ZERO),
                                       (False, range(LEGS, ERRORS), FEWER_DIMENSION,
                                        FEWER_DIMENSION)):
        problem = _Problem(stretches, geometry, rows, alone)
        nothing = problem.solve((), np.zeros(ERRORS))
        found = _selected(problem, nothing, among, fewer)
        large = (np.abs(found.values) > SMALLEST) & (np.abs(found.values) > SURE * found.std)
        if not large.any() or found.left > least * nothing.left:
            continue
        values = np.where(large, found.values, 0.0)
        after = problem.rows(values).fit().error
        if after < min(LARGEST_ERROR, rows.fit().error):
            return Calibration(values, np.where(large, found.std, 0.0), rows.fit().error, after)
    return None


def _selected(problem: _Problem, nothing: _Solution, among: Sequence[int], fewer: float
              ) -> _Solution:
    """Return the errors that each explain much, found one by one, or all zeros together."""
    now, chosen = nothing, []
    while len(chosen) < MOST:
        try:
            trials = [(problem.solve([*chosen, index], now.values), index)
                      for index in problem.nearest(now, chosen, among)[:TRIED]]
        except UnreachableError:  # an error more and the mechanism does not close
            break
        trial, index = min(trials, key=lambda item: item[0].left)
        least = FEWER_BAR if index == BAR else fewer
        if trial.left > least * now.left or (np.abs(trial.values) > LARGEST).any():
            break
        now, chosen = trial, [*chosen, index]
    if 0 in among:
        try:
            zeros = problem.solve(range(LEGS), np.zeros(ERRORS))
        except UnreachableError:
            zeros = nothing
        least = BETTER if chosen else FEWER_ZERO
        if zeros.left < least * now.left and (np.abs(zeros.values) < LARGEST).all():
            now, chosen = zeros, list(range(LEGS))
    for index in list(chosen) if len(chosen) > 1 else ():
        start = now.values.copy()
        start[index] = 0.0
        try:
            without = problem.solve([other for other in chosen if other != index], start)
        except UnreachableError:  # it is what makes the mechanism close
            continue
        if without.left < KEPT * now.left:
            now, chosen = without, [other for other in chosen if other != index]
    return now


def calibration_findings(calibration: Calibration, robot: Robot) -> list[Finding]:
    """Return what zeros and dimensions say, as findings."""
    gain = (f'with that the rigid bodies leave {percent(calibration.after)} of the torque in '
            f'motion instead of {percent(calibration.before)}')
    found = []
    joints = tuple(int(joint) for joint in np.flatnonzero(calibration.zeros))
    if joints:
        sizes = [f'{number(math.degrees(calibration.zeros[joint]), 3)} +- '
                 f'{number(math.degrees(calibration.std[joint]), 2)} degrees (joint {joint})'
                 for joint in joints]
        offsets = [f'{number(calibration.zeros[joint], 4)} rad from joint {joint}'
                   for joint in joints]
        found.append(Finding(
            'zero_error', joints, None,
            f'positions read too large by {listed(sizes)}; {gain}',
            f'Set the zero of the encoder anew, or take {listed(offsets)} where the messages are '
            'made.', True))
    wrong = [(name, float(error), float(std)) for name, error, std in
             zip(DIMENSIONS, calibration.values[LEGS:], calibration.std[LEGS:], strict=True)
             if error]
    if wrong:
        sizes = [f'{in_words(name)} {number(1e3 * getattr(robot.geometry, name), 4)} mm, these '
                 f'data say {number(1e3 * (getattr(robot.geometry, name) + error), 4)} +- '
                 f'{number(1e3 * std, 2)} mm' for name, error, std in wrong]
        lines = ', '.join(f'{name}: {getattr(robot.geometry, name) + error:.4f}'
                          for name, error, _ in wrong)
        radius = (' (or platform_radius changed by as much the other way: only their difference '
                  'shows)' if any(name == 'base_radius' for name, _, _ in wrong) else '')
        found.append(Finding(
            'wrong_dimensions', tuple(range(LEGS)), None,
            f'the robot file has {listed(sizes)}; {gain}',
            f'Measure the machine and set geometry: {{{lines}}}{radius} in the robot file.', True))
    return found
