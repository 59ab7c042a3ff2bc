"""Rows at which the law of a cause that was found does not tell its torque."""

from __future__ import annotations

import numpy as np
import pytest
from searches import MODEL, log_with

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.effects.rest import MAY_REST
from par4_identification.diagnosis.diagnosis import diagnose
from par4_identification.diagnosis.evidence import observations
from par4_identification.diagnosis.evidence.observations import (
    is_worse_where_unsure,
    observe,
    sure_rows,
)
from par4_identification.signals.rows import runs_of_log
from robots import REFERENCE, model_with

COULOMB, LATE = 0.5, 5e-3
RUBBING = model_with(MODEL, 'theta_friction', coulomb=COULOMB)


def late_to_turn(state):
    """Return friction of theta, N m, whose belts stretch: it turns round 5 ms after theta does."""
    rate = state.platform.xd[:, 3]
    sign = np.sign(np.interp(state.t - LATE, state.t, rate))
    return COULOMB * sign[:, None] * state.torque_of_force((0.0, 0.0, 0.0, 1.0))


@pytest.fixture(scope='module')
def logs():
    return [log_with(seed=seed, duration=duration, beside=late_to_turn)
            for seed, duration in ((1, 12.0), (2, 8.0))]


@pytest.fixture
def rows(logs):
    return observe(runs_of_log(logs[0], REFERENCE), REFERENCE, 'paper', None)


def test_friction_that_is_late_to_turn_is_explained_by_its_law(logs):
    fit, heldout = logs
    library = {name: CATALOGUE[name] for name in (
        'theta_friction', 'distributed_rods', 'passive_joint_friction', 'theta_inertia')}
    result = diagnose([fit], REFERENCE, holdout_logs=[heldout], library=library)
    assert result.verdict == 'explained'
    cause, = result.causes
    assert cause.effect.name == 'theta_friction'
    coulomb = cause.parameters['coulomb']
    assert coulomb.number == pytest.approx(COULOMB, abs=3.0 * coulomb.deviation)
    assert coulomb.deviation < 0.02 * COULOMB


@pytest.mark.parametrize('name', ['theta_friction', 'passive_joint_friction'])
def test_rows_are_left_out_where_theta_may_rest_and_as_far_as_filters_reach(rows, name):
    run, = rows.runs
    left, = sure_rows(rows, model_with(MODEL, name, coulomb=COULOMB)).runs
    slow = run.state.t[np.abs(run.state.platform.xd[:, 3]) < MAY_REST]
    away = np.array([np.abs(slow - t).min() for t in run.t])
    reach = run.conditioning.reach
    assert not left.valid[away < reach - 2e-3].any()
    np.testing.assert_array_equal(left.valid[away > reach + 2e-3], run.valid[away > reach + 2e-3])
    assert left.valid.sum() < run.valid.sum()


def test_rows_stay_where_nothing_is_unsure_or_too_few_would_be_left(rows, monkeypatch):
    assert sure_rows(rows, MODEL) is rows
    assert sure_rows(rows, model_with(MODEL, 'cogging', amplitude=0.3, periods=24.0, phase=0.0)
                     ) is rows
    monkeypatch.setattr(observations, 'LEAST_SURE', 0.99)
    assert sure_rows(rows, RUBBING) is rows


def test_rows_that_are_sure_are_left_as_they_are_once_more(rows):
    once = sure_rows(rows, RUBBING)
    again = sure_rows(once, RUBBING)
    assert all(new.valid is old.valid for new, old in zip(again.runs, once.runs))


@pytest.mark.parametrize(('factor', 'worse'), [(1.0, False), (1.7, False), (2.5, True)])
def test_rows_count_against_a_law_where_far_more_is_left_than_elsewhere(rows, factor, worse):
    run, = rows.runs
    sure = sure_rows(rows, RUBBING).runs[0].valid
    left = np.random.default_rng(4).standard_normal(sure.shape) * np.where(sure, 1.0, factor)
    left[~run.valid] = 100.0
    assert is_worse_where_unsure(rows, RUBBING, [left]) == worse
    assert not is_worse_where_unsure(rows, MODEL, [left])
