"""The periodic path whose torques tell the base parameters best.

J(c) = -log det M(c) / 2 p + 0.3 log cond M'(c) + penalty: M = sum over rows of W^T S^-1 W is the
information on the p base parameters of (23), whose inverse is the covariance of their least squares
estimate (D-optimality), S the noise of the joints, and M' is M with its diagonal scaled to 1. The
penalty is the square of what exceeds a limit. M sums over samples that are functions of X, Xd, Xdd,
and these are linear in the Fourier coefficients c: differences in the 12 numbers of each sample
give the whole gradient, whatever the number of coefficients.

Platform coordinates: workspace and accelerations are given there, the inverse kinematics is closed
and cheap, and the paper's own motions are displacements in operational space.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from par4_dynamics.base_terms import base_columns, base_terms
from par4_dynamics.model import Model
from par4_dynamics.state import State, state_of_platform
from par4_identification.excitation.fourier_path import FourierPath, fourier_basis
from par4_identification.excitation.motion_limits import MotionLimits
from par4_identification.signals.conditioning import Conditioning
from par4_kinematics.geometry import Geometry

SAMPLES_PER_HARMONIC = 24
"""Samples in a period of the highest harmonic at which a path is judged."""
CONDITION_WEIGHT = 0.3
"""Weight of log cond beside log det."""
ROUGH_PENALTY, PENALTY = 1.0, 30.0
"""Weights of squared excesses: of the first optimisation from each start and of the second."""
ROUGH_ITERATIONS, ITERATIONS = 60, 200
"""Most iterations of the first optimisation from each start and of the second."""
REFINED = 3
"""One in so many of the starts, the best ones, is optimised further."""
START_SPREAD = 0.6
"""Standard deviation of random coefficients of harmonic k over 1 / k of what it may have alone."""
DIFFERENCE = 1e-5
"""Step of the finite differences, over the size of the number that is varied."""


@dataclass(frozen=True)
class PathProblem:
    """What a periodic path is optimised for.

    Attributes:
        geometry: of the machine.
        model: its torque; effects are left out.
        limits: to be kept.
        period: s.
        rows: identification rows per joint that all repeats of the path give.
        noise: of the rows of each joint, N m, (4,).
        known: information that other parts of the motion give, (p, p).
        conditioning: how identification makes rows, for its low-speed mask.
    """

    geometry: Geometry
    model: Model
    limits: MotionLimits
    period: float
    rows: float
    noise: np.ndarray
    known: np.ndarray
    conditioning: Conditioning

    def information(self, path: FourierPath) -> np.ndarray:
        """Return the information M (p, p) of a path within the limits."""
        samples = SAMPLES_PER_HARMONIC * path.harmonics
        x = path.sample(np.arange(samples) * self.period / samples)
        state = self._state(x)
        return _information(self._rows(state, base_columns(state), samples))

    def _state(self, x: np.ndarray) -> State:
        """Return the state of X, Xd, Xdd (3, n, 4), drawn into the workspace."""
        return state_of_platform(self.geometry, np.zeros(x.shape[1]), self.limits.nearest(x[0]),
                                 x[1], x[2])

    def _rows(self, state: State, columns: np.ndarray, samples: int) -> np.ndarray:
        """Return columns (n, J, p), weighted so that the squares of `samples` of them sum to M."""
        weight = validity(state.qd, state.qdd, self.conditioning) * self.rows / (
            samples * self.noise ** 2)
        return columns * np.sqrt(weight)[..., None]

    def _excess(self, x: np.ndarray, state: State, columns: np.ndarray) -> np.ndarray:
        """Return the sum of squared excesses over the limits of each sample, (n,)."""
        chi = np.stack([self.model.values[term.name] for term in base_terms(state)])
        tau = np.einsum('njp,pj->nj', columns, chi) + self.model.distributed_torque(state)
        loads = self.limits.loads(state, x[0], tau).values()
        return sum((np.maximum(load - 1.0, 0.0) ** 2).sum(axis=1) for load in loads)

    def cost(self, x: np.ndarray, penalty: float) -> tuple[float, np.ndarray]:
        """Return J of the samples X, Xd, Xdd (3, n, 4) and its gradient (3, n, 4)."""
        samples = x.shape[1]
        state = self._state(x)
        columns = base_columns(state)
        information = self.known + _information(self._rows(state, columns, samples))
        value, slope = criterion(information)
        value += penalty * self._excess(x, state, columns).sum()
        # every sample varied in each of its 12 numbers at once
        size = np.maximum(np.abs(x).max(axis=1), 1e-3) * DIFFERENCE  # (3, 4)
        steps = np.einsum('ab,s->asb', np.diag(size.ravel()), (1.0, -1.0)).reshape(24, 3, 4)
        varied = (x[:, None] + steps.transpose(1, 0, 2)[:, :, None]).reshape(3, 24 * samples, 4)
        state = self._state(varied)
        columns = base_columns(state)
        rows = self._rows(state, columns, samples)
        change = (np.einsum('njp,njp->n', rows @ slope, rows)
                  + penalty * self._excess(varied, state, columns)).reshape(3, 4, 2, samples)
        gradient = (change[:, :, 0] - change[:, :, 1]) / (2.0 * size[..., None])
        return value, gradient.transpose(0, 2, 1)


def validity(qd: np.ndarray, qdd: np.ndarray, conditioning: Conditioning) -> np.ndarray:
    """Return how likely identification keeps rows with joint motion qd, qdd (n, J): 0 to 1.

    It drops what is nearer to low speed than its filter reaches. |qd / qdd| is the time to the
    next reversal; smooth, so that a gradient sees the mask coming.
    """
    reach = conditioning.reach
    near = (reach * qdd) ** 2 + conditioning.low_speed ** 2
    return 1.0 / (1.0 + (near / np.maximum(qd ** 2, 1e-12)) ** 2)


def criterion(information: np.ndarray) -> tuple[float, np.ndarray]:
    """Return D-optimality with conditioning of M (p, p), to be minimised, and its slope in M."""
    size = len(information)
    diagonal = np.diag(information)
    scale = 1.0 / np.sqrt(diagonal)
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    values = np.maximum(values, np.finfo(float).eps)  # of a singular matrix rounding makes any sign
    scaled = vectors * scale[:, None]
    value = -(np.log(values).sum() + np.log(diagonal).sum()) / (2.0 * size)
    slope = -(scaled / values) @ scaled.T / (2.0 * size)
    # cond W is the root of cond M
    value += 0.5 * CONDITION_WEIGHT * np.log(values[-1] / values[0])
    for index, sign in ((-1, 1.0), (0, -1.0)):
        slope += 0.5 * CONDITION_WEIGHT * sign * (
            np.outer(scaled[:, index], scaled[:, index]) / values[index]
            - np.diag(vectors[:, index] ** 2 / diagonal))
    return float(value), slope


def optimised_path(problem: PathProblem, harmonics: int, starts: int,
                   generator: np.random.Generator,
                   progress: Callable[[float], None] | None = None) -> FourierPath:
    """Return the best path of optimisations from `starts` random ones.

    All are optimised roughly, the best third of them further.

    Args:
        problem: what it is for.
        harmonics: of the path.
        starts: number of random paths.
        generator: of their coefficients.
        progress: called with the share done, 0 to 1.
    """
    samples = SAMPLES_PER_HARMONIC * harmonics
    basis = fourier_basis(np.arange(samples) * problem.period / samples, problem.period, harmonics)
    unit = _units(problem, harmonics)
    order = np.repeat(np.arange(1, harmonics + 1), 2)[:, None]
    refined = -(-starts // REFINED)
    work = starts * ROUGH_ITERATIONS + refined * ITERATIONS
    done = 0

    def coefficients(free: np.ndarray) -> np.ndarray:
        found = unit * free.reshape(unit.shape)
        found[0] += problem.limits.middle
        return found

    def optimised(free: np.ndarray, penalty: float, iterations: int) -> tuple[float, np.ndarray]:
        def cost(flat: np.ndarray) -> tuple[float, np.ndarray]:
            value, slope = problem.cost(basis @ coefficients(flat), penalty)
            return value, (unit * np.einsum('onc,ona->ca', basis, slope)).ravel()

        nonlocal done
        result = scipy.optimize.minimize(cost, free.ravel(), jac=True, method='L-BFGS-B',
                          options={'maxiter': iterations, 'maxcor': 20})
        done += iterations
        if progress:
            progress(done / work)
        return float(result.fun), result.x

    rough = []
    for _ in range(starts):
        free = np.zeros_like(unit)
        free[1:] = START_SPREAD / order * generator.standard_normal(unit[1:].shape)
        rough.append(optimised(free, ROUGH_PENALTY, ROUGH_ITERATIONS))
    rough.sort(key=lambda found: found[0])
    best = min((optimised(free, PENALTY, ITERATIONS) for _, free in rough[:refined]),
               key=lambda found: found[0])
    return FourierPath(coefficients(best[1]), problem.period)


def _units(problem: PathProblem, harmonics: int) -> np.ndarray:
    """Return what size each coefficient may have alone, (2 harmonics + 1, 4)."""
    limits, geometry = problem.limits, problem.geometry
    rate = 2.0 * np.pi / problem.period * np.repeat(np.arange(1, harmonics + 1), 2)[:, None]
    lever = np.array((1.0, 1.0, 1.0, geometry.platform_bar_length))
    reach = np.array((limits.extent[0], *limits.extent))
    # D moves about as fast as an elbow
    speed = geometry.arm_length * limits.joint_speed / lever
    unit = np.minimum(reach, np.minimum(speed / rate, limits.acceleration / lever / rate ** 2))
    return np.concatenate((0.3 * reach[None], unit))


def _information(rows: np.ndarray) -> np.ndarray:
    flat = rows.reshape(-1, rows.shape[-1])
    return flat.T @ flat
