"""A first look at transmissions that twist: what their springs carry is measured.

A spring twists by its compliance times the torque that it carries, and that is what the motor gives
beside what moves and brakes the motor itself. So the change of the load's torque follows from the
measured torque, and is linear in the compliances of all joints together, however sharply a load
swings and however much the joints move each other. A fit of the springs, which let the loads swing
by the motion alone, has many minima; this has one. What it leaves out, the damping of the springs
and what other causes do to the measured torque, makes its compliances some 10 % wrong: it tells
where a fit begins. Least squares of the equation of motion, with measured torques below a cut-off,
tell the stiffness of joints in Pham, Gautier and Poignet (2001), too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy

from par4_dynamics.effects.transmission import (
    load_inertia,
    transmission_columns,
    transmitted_torque,
)
from par4_identification.diagnosis.evidence.projection import Projection
from par4_identification.signals.run import Run

LOWER_BAND = 0.5
"""Share of the frequencies of rows, the lower ones, that tell the compliances if they tell any:
above, the second rate of a measured torque is mostly noise. Below, counts of encoders swing a load
much less, too."""
BANDS = 10
"""Of these, of which each tells how much of what is left may be noise."""
POSES = 20
"""Of a motion, whose inertias are looked at."""


@dataclass(frozen=True)
class Look:
    """What a first look at transmissions that twist promises.

    Attributes:
        compliance: (J,), rad/(N m); zero where a joint is rigid.
        squares: twice the gain in log-likelihood, at `LOWER_BAND` of the frequencies or at all of
            them, whichever is larger: loads that hardly damp swing at their resonance.
    """

    compliance: np.ndarray
    squares: float


def first_look(projection: Projection) -> Look:
    """Return which compliances explain most of the torque left in a projection."""
    evidence = projection.evidence
    runs = evidence.observations.runs
    if evidence.observations.steady:  # a plateau is no motion of a load
        return Look(np.zeros(evidence.observations.joints), 0.0)
    changes = [run.rows(transmission_columns(run.state.true, -_carried(run))) for run in runs]
    rest = projection.rest(np.concatenate(evidence.whitener.whiten(changes)))
    lower, whole = (_look_at(_lower(rest, evidence.ends, band), _lower(
        projection.residual, evidence.ends, band), runs, band) for band in (LOWER_BAND, 1.0))
    seen = lower if lower.compliance.any() else whole
    return replace(seen, squares=max(lower.squares, whole.squares))


def _look_at(columns: Sequence[np.ndarray], targets: Sequence[np.ndarray], runs: Sequence[Run],
             band: float) -> Look:
    """Return the look at the lower frequencies of columns (n, J) and target (n,) of each joint."""
    spectra, target = np.concatenate(columns), np.concatenate(targets)
    moment = spectra.T @ target - _noise_moment(runs, targets, band)
    factor, = scipy.linalg.qr(spectra, mode='r')
    factor = factor[:len(moment)]
    told = np.linalg.lstsq(factor.T, moment, rcond=None)[0]  # with the moment that is left
    compliance, left = scipy.optimize.nnls(factor, told)
    return Look(compliance, float(told @ told - left ** 2))


def _noise_moment(runs: Sequence[Run], targets: Sequence[np.ndarray], band: float) -> np.ndarray:
    """Return what noise adds to the products (J,) of the columns of joints and the target.

    The measured torque has the noise of the target. Its part of a column is the inertia of the load
    times minus the second rate of the noise, which is as much times the square of the frequency.
    Whitened noise has a variance of one at the most, or as much as the target has there.

    Args:
        runs: of the rows.
        targets: lower frequencies (n,) of each joint.
        band: share of the frequencies that these are.
    """
    inertia = np.average([_load_inertia(run) for run in runs], 0, [len(run.t) for run in runs])
    noise = []
    for spectrum in targets:
        rates = np.pi * band / runs[0].row_time * np.arange(len(spectrum)) / len(spectrum)
        bands = np.array_split(np.arange(len(spectrum)), BANDS)
        noise.append(sum(float(np.sum(rates[part] ** 2)) * min(
            1.0, float(np.mean(spectrum[part] ** 2))) for part in bands))
    return np.asarray(inertia * noise)


def _carried(run: Run) -> np.ndarray:
    """Return the torque (n, J), N m, that springs carry as the motors are measured.

    It is what rigid ones would carry as the motors move, and what is measured beyond the nominal
    torque of that motion.
    """
    beyond = run.tau - run.rows(run.state.known.torque)
    between = scipy.interpolate.make_interp_spline(run.t, beyond, min(3, len(run.t) - 1))
    within = np.clip(run.state.t, run.t[0], run.t[-1])
    return np.asarray(transmitted_torque(run.state.true) + between(within))


def _load_inertia(run: Run) -> np.ndarray:
    """Return the inertia of the loads of the joints, each by itself, (J,) kg m2."""
    inertia = load_inertia(run.state, np.linspace(run.t[0], run.t[-1], POSES))
    return np.asarray(np.mean(np.diagonal(inertia, axis1=1, axis2=2), axis=0))


def _lower(rows: np.ndarray, ends: np.ndarray, band: float) -> list[np.ndarray]:
    """Return the lower share of the frequencies (n, ...) of stacked rows (N, ...), by joint."""
    return [scipy.fft.dct(rows[first:last], axis=0, norm='ortho')[:int(band * (last - first))]
            for first, last in pairwise(ends)]
