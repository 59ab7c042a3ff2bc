"""What an estimator says of its data, in words and as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from par4_identification.estimators.consistent import ConsistentEstimate
from par4_identification.estimators.estimate import Estimate
from par4_identification.estimators.instrumental import InstrumentalEstimate
from par4_identification.estimators.robust import RobustEstimate
from par4_identification.fitting.identification import Identification
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Remark
from par4_sim.report.words import in_words, listed, number, percent

IN_WORDS = {
    'weighted': 'weighted least squares', 'ordinary': 'ordinary least squares',
    'robust': 'robust estimation (Tukey\'s bisquare)',
    'instrumental': 'instrumental variables from the simulated motion',
    'consistent': 'least squares with positive masses, inertias and friction'}
SEEN = 0.01
"""p-value of the test of least squares below which a bias is seen."""
MATERIAL = 1.0
"""Bias over the standard deviation of least squares from which it matters."""
MANY_REJECTED = 0.05
"""Fraction of rejected rows above which they are no outliers."""


def estimator_in_words(identification: Identification) -> str:
    """Return how the parameters were estimated."""
    fitting = identification.fitting
    values = ('one value for each joint, platform masses shared' if fitting.per_joint
              else 'one value for all joints')
    return (f'{IN_WORDS[fitting.estimator]}; {values}; '
            f'{"with" if fitting.offsets else "without"} offsets')


def estimator_remarks(identification: Identification, machine: Robot | Axis
                      ) -> tuple[Remark, ...]:
    """Return what the estimator found beside the values; nothing for plain least squares."""
    estimate = identification.estimate
    if isinstance(estimate, InstrumentalEstimate):
        return (_bias_remark(estimate, machine),)
    if isinstance(estimate, RobustEstimate):
        return (_outlier_remark(estimate),)
    if isinstance(estimate, ConsistentEstimate):
        return (_physics_remark(estimate),)
    return ()


def _bias_remark(estimate: InstrumentalEstimate, machine: Robot | Axis) -> Remark:
    """Return whether least squares is biased."""
    bias = estimate.bias
    tested = f'test of Durbin, Wu and Hausman: p = {number(bias.p_value, 2)}'
    if bias.p_value > SEEN:
        return Remark(True, f'Least squares is not seen to be biased ({tested}).')
    sizes = np.abs(bias.difference) / estimate.least_squares.std
    if sizes.max() < MATERIAL:
        return Remark(True, f'Least squares is biased, but by no more than '
                            f'{number(sizes.max(), 2)} of its standard deviations: that does not '
                            f'matter ({tested}).')
    worst = [f'{in_words(str(label))} by {number(difference, 2)} {unit_on(machine, label.unit)}'
             for label, difference, size in zip(estimate.labels, bias.difference, sizes)
             if size >= MATERIAL]
    return Remark(False, f'Least squares is biased: {listed(worst)}, at most '
                         f'{number(sizes.max(), 2)} of its standard deviations ({tested}). The '
                         f'values here are free of that.',
                  'Keep to instruments for this machine, or lower the noise of its positions.')


def _outlier_remark(estimate: RobustEstimate) -> Remark:
    share = f'{percent(estimate.rejected)} of the rows contradict the others and do not count'
    if estimate.rejected <= MANY_REJECTED:
        return Remark(True, f'Outliers: {share}.')
    return Remark(False, f'Outliers: {share}: too many for chance.',
                  'Look in the report where they are; the machine may do something there that the '
                  'model lacks.')


def _physics_remark(estimate: ConsistentEstimate) -> Remark:
    if not estimate.active:
        return Remark(True, 'Physics changes nothing: least squares gives no negative mass, '
                            'inertia or friction.')
    held = listed([in_words(name) for name in estimate.active])
    return Remark(False, f'Held at the limit of what physics allows: {held}; the residual rises by '
                         f'{percent(estimate.rise)} over that of least squares.',
                  'Record a richer motion: the data do not tell these values.')


def estimator_json(identification: Identification) -> dict[str, Any]:
    """Return what `identification.json` says of the estimator."""
    fitting, estimate = identification.fitting, identification.estimate
    return {'name': fitting.estimator, 'per_joint': fitting.per_joint, 'offsets': fitting.offsets,
            **_findings(estimate)}


def _findings(estimate: Estimate) -> dict[str, Any]:
    names = [str(label) for label in estimate.labels]
    if isinstance(estimate, InstrumentalEstimate):
        bias = estimate.bias
        return {'bias_of_least_squares': {
            'p_value': bias.p_value, 'statistic': bias.statistic, 'freedom': bias.freedom,
            'difference': dict(zip(names, bias.difference)), 'std': dict(zip(names, bias.std)),
            'material': bool(bias.p_value <= SEEN and np.any(
                np.abs(bias.difference) >= MATERIAL * estimate.least_squares.std))},
            'relevance_of_instruments': estimate.relevance}
    if isinstance(estimate, RobustEstimate):
        return {'rejected': estimate.rejected}
    if isinstance(estimate, ConsistentEstimate):
        return {'active_constraints': estimate.active, 'residual_rise': estimate.rise}
    return {}
