"""Drive gains G_i of (24) from runs with and without a known payload.

What is recorded of joint i, in terms of the gains of the robot file, is

    G_i V_i = e_i (b_i + m_1' w_1i + m_2' w_2i + k_i),    e_i = nominal over true gain,

with b_i all that belongs to the joint alone (i_act, arm gravity, friction), w_1, w_2 the columns of
the platform masses in (20), and k_i the torque of what is known: payload times w_1, and rods and
bars where these are taken as known. Nothing fixes e_i in b_i, which each joint may have of its own,
but k_i is known, and m_1' and m_2' are the same for all joints: the payload gives the gains their
common scale, payload and platform together their ratios.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from par4_dynamics.base_terms import (
    FRICTION,
    INERTIA,
    PLATFORM_MASSES,
    base_columns,
    base_terms,
    distributed_torque,
)
from par4_dynamics.model_file import RigidBody
from par4_dynamics.state import State
from par4_identification.estimators.estimate import Estimate
from par4_identification.estimators.problem import Series, per_output, problem_of
from par4_identification.estimators.weighted import weighted
from par4_identification.signals.run import Run
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot

OWN = (INERTIA, 'arm_gravity')
"""Base parameters of the bodies that each joint has of its own."""
SETTLED, TRIALS = 1e-12, 500
"""Relative change of the fit at which it has settled, and most trials until then; ten are enough
where gains are wrong by tens of percent."""
LONGER = 'record longer and faster motions with and without the payload'
"""What helps where the gains are not told."""


@dataclass(frozen=True)
class DriveGains:
    """Torque constants of the drives.

    Attributes:
        values: G_i, (J,), N m/V.
        covariance: of `values`, (J, J); what is common to all gains is in it.
        nominal: of the robot file, (J,), N m/V.
        bound: by which each gain may be off at most for a cause that is no noise, (J,), N m/V.
        p_value: chance that data in which the assumptions hold disagree with them so much; None
            where nothing is left to test.
    """

    values: np.ndarray
    covariance: np.ndarray
    nominal: np.ndarray
    bound: np.ndarray
    p_value: float | None = None

    @property
    def std(self) -> np.ndarray:
        """Standard deviations (J,), N m/V."""
        return np.sqrt(np.diag(self.covariance))


def named_columns(state: State) -> dict[str, np.ndarray]:
    """Return the columns (n, J) of (20) by the names of their parameters."""
    columns = base_columns(state)
    return {term.name: columns[..., index] for index, term in enumerate(base_terms(state))}


def friction_columns(columns: Mapping[str, np.ndarray], bag: str, bags: Sequence[str]
                     ) -> dict[str, np.ndarray]:
    """Return the friction columns (n, J) of a run of `bag`, of which every bag has its own."""
    return {f'{name} of {other}': columns[name] if other == bag else np.zeros_like(columns[name])
            for other in bags for name in FRICTION}


def estimate_per_joint(runs: Sequence[Run], targets: Sequence[np.ndarray],
                       columns: Sequence[Mapping[str, np.ndarray]]) -> Estimate:
    """Return the fit in which every joint has a value of its own of every column.

    Args:
        runs: rows.
        targets: (m, J) N m of each run.
        columns: name -> (n, J) of each run, at the rate of its log.

    Returns:
        Values name by name, in each joint by joint.

    Raises:
        InputError: too few rows, or columns that do not tell the values apart.
    """
    series = [Series(target, run.rows(np.stack(list(parts.values()), axis=-1)), run.valid)
              for run, target, parts in zip(runs, targets, columns, strict=True)]
    names = list(columns[0])
    return weighted(per_output(problem_of(series, names, [''] * len(names)), names))


def gains_of_payloads(runs: Sequence[Run], payloads: Mapping[str, float],
                      machine: Robot | Axis, rigid_body: RigidBody = 'paper') -> DriveGains:
    """Return the drive gains that runs with different known payloads tell.

    A fit of every joint by itself (friction of every bag its own, since it drifts with
    temperature), then the gains and platform masses nearest to its result by its covariance.

    Args:
        runs: rows of all bags.
        payloads: bag name -> known mass at D, kg; 0 where none is named.
        machine: that was recorded; its nominal gains scale the rows.
        rigid_body: 'paper' or 'full', for which rods and bars are known too.

    Raises:
        InputError: a machine without platform, the same payload in all bags, or motions that do
            not tell the gains.
    """
    if isinstance(machine, Axis):
        raise InputError(f'{machine.name}: a payload at the tool was given, but the machine is a '
                         f'single axis; leave it out')
    bags = list(dict.fromkeys(run.name for run in runs))
    if len({payloads.get(bag, 0.0) for bag in bags}) < 2:
        raise InputError('every bag carries the same payload; give bags with and without it')
    columns = []
    for run in runs:
        base = named_columns(run.state)
        known = payloads.get(run.name, 0.0) * base['platform_mass_1']
        if rigid_body == 'full':
            known = known + distributed_torque(machine.bodies, run.state)
        columns.append({name: base[name] for name in PLATFORM_MASSES} | {'drive gain': known}
                       | {name: base[name] for name in OWN}
                       | friction_columns(base, run.name, bags))
    estimate = estimate_per_joint(runs, [run.tau for run in runs], columns)
    joints = runs[0].tau.shape[1]
    found = np.arange(3 * joints).reshape(3, joints).T.ravel()  # joint by joint
    try:
        ratio, covariance, misfit = _common_masses(
            estimate.values[found].reshape(joints, 3), estimate.covariance[np.ix_(found, found)])
    except np.linalg.LinAlgError:
        raise InputError(f'the motions do not tell gains and platform masses apart; {LONGER}'
                         ) from None
    nominal = np.asarray(machine.drive_gain, dtype=float)
    if np.any(ratio < 0.1):
        raise InputError(f'the recorded torque comes out {ratio.min():.2g} times that of the known '
                         f'payload; check which bag carried it')
    slope = np.diag(-nominal / ratio ** 2)
    return DriveGains(nominal / ratio, slope @ covariance @ slope, nominal, np.zeros(joints),
                      float(scipy.special.chdtrc(2 * joints - 2, max(misfit, 0.0))))


def _common_masses(products: np.ndarray, covariance: np.ndarray
                   ) -> tuple[np.ndarray, np.ndarray, float]:
    """Return e (J,), its covariance (J, J) and chi-square of e_i m_1', e_i m_2', e_i as found.

    Args:
        products: (J, 3) of these, of each joint by itself.
        covariance: (3 J, 3 J).

    Raises:
        InputError: the fit does not settle.
        LinAlgError: what was found has no covariance.
    """
    joints = len(products)
    whitened = np.linalg.inv(np.linalg.cholesky(covariance))

    def left(unknown: np.ndarray) -> np.ndarray:
        ratio, masses = unknown[:joints], np.append(unknown[joints:], 1.0)
        return whitened @ (np.outer(ratio, masses) - products).ravel()

    def slopes(unknown: np.ndarray) -> np.ndarray:
        jacobian = np.zeros((joints, 3, joints + 2))
        for joint in range(joints):
            jacobian[joint, :, joint] = *unknown[joints:], 1.0
            jacobian[joint, :2, joints:] = unknown[joint] * np.eye(2)
        return whitened @ jacobian.reshape(3 * joints, -1)

    ratio = products[:, 2]
    start = np.append(ratio, ratio @ products[:, :2] / (ratio @ ratio))
    found = scipy.optimize.least_squares(left, start, slopes, method='lm', xtol=SETTLED,
                                         ftol=SETTLED, gtol=SETTLED, max_nfev=TRIALS)
    if not found.success:
        raise InputError(f'gains and platform masses do not settle in {TRIALS} trials; {LONGER}')
    spread = np.linalg.inv(found.jac.T @ found.jac)
    return found.x[:joints], spread[:joints, :joints], 2.0 * float(found.cost)
