"""A model of the noise gives way to a smaller one once causes are found, not to a wandering one."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from planned import log_of

from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model
from par4_identification.diagnosis.diagnosis import CONDITIONING
from par4_identification.diagnosis.evidence.evidence import gather
from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.observations import observe, with_nominal
from par4_identification.diagnosis.evidence.unnamed import Kinds
from par4_identification.diagnosis.evidence.whitener import flat_whitener
from par4_identification.diagnosis.search.whitening import quieter
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.robot import Axis

AXIS = Axis(schema='par4/axis/1', name='arm', joint='arm', kind='revolute', gain=1.0)
MODEL = build_model(AXIS, ModelFile(schema='par4/model/1', parameters={
    'actuator_inertia': {'value': 0.2}, 'coulomb_friction': {'value': 1.5},
    'viscous_friction': {'value': 0.8}}))
T = np.arange(0.0, 40.0, 1e-3)


def noise_beside(noise, before):
    """Return the noise model (of one joint) that stood before, and that beside the base model.

    Args:
        noise: added to the torque, (n,), N m.
        before: standard deviation of the rows' noise so far, which is taken for white, N m.
    """
    q = 0.7 * np.sin(2.9 * T) + 0.3 * np.sin(7.1 * T + 1.0)
    qd, qdd = np.gradient(q, T), np.gradient(np.gradient(q, T), T)
    tau = 0.2 * qdd + 1.5 * np.sign(qd) + 0.8 * qd + noise
    runs = runs_of_log(log_of(AXIS, T, q[:, None], tau[:, None], 1, 0.0), AXIS, CONDITIONING)
    rows = with_nominal(observe(runs, AXIS, 'paper', None), MODEL)
    whitener = flat_whitener(rows, np.array([before]))
    found = quieter(whitener, rows, (), solve(gather(rows, whitener), ()), Kinds(rows))
    return whitener.noise[0], found.noise[0]


def wandering(size, correlation_time, seed):
    """Return noise (n,), N m, whose correlation falls to 1/e within a time, s."""
    decay = np.exp(-T[1] / correlation_time)
    steps = np.random.default_rng(seed).normal(0.0, size * np.sqrt(1.0 - decay ** 2), len(T))
    return scipy.signal.lfilter([1.0], [1.0, -decay], steps)


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_noise_that_is_smaller_takes_the_place_of_the_first(seed):
    old, new = noise_beside(np.random.default_rng(seed).normal(0.0, 0.05, len(T)), before=0.3)
    assert new.size < 0.5 * old.size


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_noise_that_only_wanders_more_does_not(seed):
    """Each of its rows is all but known from those before, and yet it is larger than the first."""
    old, new = noise_beside(wandering(0.5, 0.5, seed), before=0.3)
    assert new is old
