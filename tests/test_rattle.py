"""Backlash is named where loads rattle after their torque turns over, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hidden.scenario import Task, draw_scenario, record_scenario
from hidden.study import diagnosis_of
from searches import log_with
from short_scenarios import short_scenario

from par4_dynamics.effects.transmission import load_inertia, transmitted_torque
from par4_dynamics.mechanism import joint_mass_matrix
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model
from par4_identification.diagnosis.diagnosis import diagnose
from par4_identification.diagnosis.evidence.fit import residuals, solve
from par4_identification.diagnosis.evidence.observations import observe, with_nominal
from par4_identification.diagnosis.verdict.rattle import gaps, rattle
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.diagnosis import diagnosis_json, outcome_of_diagnosis
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.robot import Axis
from robots import REFERENCE


def diagnosed(scenario):
    """Return a machine, its diagnosis and the recordings of both."""
    recordings = record_scenario(scenario)
    return scenario, diagnosis_of(scenario, *recordings), recordings


@pytest.fixture(scope='module')
def case():
    """Return a machine with a gap in one joint, its diagnosis and the recordings of both."""
    return diagnosed(draw_scenario(Task('single', 30035, 'backlash', False)))


@pytest.fixture(scope='module')
def loose(case):
    """Return the rows of that machine, fitted, and what the base model leaves of them."""
    observations = case[1].evidence.observations
    return observations, residuals(observations, [], solve(case[1].evidence, []))


def test_backlash_is_named_on_its_joints_with_its_size_more_often_than_not(case):
    """In one joint or all, also under noise that exceeds its white floor; never by another name."""
    others = (diagnosed(short_scenario(Task('single', seed, 'backlash', coloured)))
              for seed, coloured in ((30036, False), (907, True)))
    named = []
    for scenario, diagnosis, _ in (case, *others):
        gap = scenario.hidden[0][1]['gap']
        assert diagnosis.verdict in ('partly_explained', 'unknown')
        for cause in diagnosis.causes:
            assert (cause.effect.name, cause.joints) == ('backlash', tuple(np.flatnonzero(gap)))
            value, std = (np.array(part) for part in (cause.parameters['gap'].value,
                                                      cause.parameters['gap'].std))
            assert np.all(np.abs(value - gap[gap > 0.0]) < 2.0 * std)
            assert np.all(std < value)
            assert not cause.predictable
            assert diagnosis.verdict == 'partly_explained'
            assert diagnosis.extended_model.effects[-1].effect == 'backlash'
            outcome = outcome_of_diagnosis(diagnosis, scenario.known.robot)
            assert 'backlash' in outcome.sentence
            assert 'rattles' in outcome.sentence
            named.append(cause)
    assert len(named) >= 2


def test_without_it_in_the_library_the_machine_stays_unknown(case):
    scenario, _, recordings = case
    diagnosis = diagnosis_of(scenario, *recordings, ('backlash',))
    assert (diagnosis.verdict, diagnosis.causes) == ('unknown', ())


def test_rows_that_are_slower_than_bounces_tell_of_none(loose):
    observations, left = loose
    slow = replace(observations, runs=tuple(
        replace(run, _every=2 * run._every) for run in observations.runs))
    assert rattle([(observations, left)]) is not None
    assert rattle([(slow, left)]) is None
    assert any(gaps(observations, left))
    assert not any(gaps(slow, left))


@pytest.mark.parametrize('inertia', [0.0, 1e-3])
def test_an_axis_whose_inertia_counts_as_zero_has_no_load_that_rattles(inertia):
    machine = Axis.model_validate({'schema': 'par4/axis/1', 'name': 'axis', 'joint': 'motor',
                                   'kind': 'revolute', 'gain': 1.0})
    t = 2e-3 * np.arange(5000)
    q, tau = np.sin(3.0 * t)[:, None], np.cos(3.0 * t)[:, None]
    runs = runs_of_log(Log('axis', ('motor',), 1, 2e-3, t, q, tau, (slice(0, len(t)),), None, None),
                       machine)
    nominal = build_model(machine, ModelFile.model_validate({
        'schema': 'par4/model/1', 'parameters': {name: {'value': value} for name, value in (
            ('actuator_inertia', inertia), ('coulomb_friction', 0.1), ('viscous_friction', 0.0))}}))
    observations = with_nominal(observe(runs, machine, 'paper', None), nominal)
    random = np.random.default_rng(0)
    left = [random.normal(size=run.tau.shape) for run in runs]
    assert rattle([(observations, left)]) is None
    assert bool(gaps(observations, left)[0]) == (inertia > 0.0)


def test_what_a_torque_leaves_that_jumps_at_an_unknown_time_is_no_bounce(loose):
    observations, left = loose
    unknown = replace(observations, runs=tuple(
        replace(run, timing_error=2.0 * np.broadcast_to(run.noise_floor, run.tau.shape))
        for run in observations.runs))
    assert rattle([(observations, left)]) is not None
    assert rattle([(unknown, left)]) is None


def test_every_part_of_the_data_must_rattle(loose):
    observations, left = loose
    assert rattle([(observations, left)]) is not None
    noise = np.random.default_rng(1)
    still = [noise.normal(0.0, 0.5, part.shape) for part in left]
    assert rattle([(observations, left), (observations, still)]) is None


def test_what_a_load_leaves_that_leans_on_a_flank_does_not_know_its_size(loose):
    """Noise may have any size; a stiffness that differs from tooth to tooth leaves more under load.
    """
    observations, left = loose
    random = np.random.default_rng(3)

    def with_more(ratio, quantile):
        parts = []
        for run, part in zip(observations.runs, left):
            load = np.abs(np.stack([np.interp(run.t, run.state.t, joint)
                                    for joint in transmitted_torque(run.state).T], axis=1))
            loaded = load > np.quantile(load, quantile, axis=0)
            parts.append(part + ratio * run.noise_floor * loaded * random.normal(size=part.shape))
        return parts

    assert rattle([(observations, with_more(1.0, 0.0))]) is not None
    assert rattle([(observations, with_more(2.0, 0.0))]) is not None
    assert rattle([(observations, with_more(3.0, 0.5))]) is None


@pytest.mark.parametrize(('hertz', 'is_told'), [(4.0, False), (30.0, True)])
def test_bounces_are_quick(loose, hertz, is_told):
    """What a supply that sags under load leaves bends where loads change sides, but smoothly."""
    observations, _ = loose
    random = np.random.default_rng(4)
    left = []
    for run in observations.runs:
        around = np.stack([np.exp(-np.min(np.abs(run.t[:, None] - run.state.t[np.flatnonzero(
            np.diff(np.sign(load)))]), axis=1) ** 2 / 2e-3) for load in
            transmitted_torque(run.state).T], axis=1)
        left.append(20.0 * around * np.sin(2.0 * np.pi * hertz * run.t)[:, None]
                    + run.noise_floor * random.normal(size=around.shape))
    assert (rattle([(observations, left)]) is not None) == is_told


def test_base_values_of_leaning_rows_make_no_bounces(loose):
    """What fits these alone may leave much of all others, as beside a cause of another kind."""
    observations, _ = loose
    random = np.random.default_rng(5)
    parts = []
    for run, base in zip(observations.runs, observations.base):
        bent = base @ (2.0 / np.abs(base).max(axis=(0, 1)))
        leans = np.stack([
            np.array([np.all((time - changes > 0.15) | (changes - time > 0.05)) for time in run.t])
            for changes in (run.state.t[:-1][np.diff(np.sign(joint)) != 0.0]
                            for joint in transmitted_torque(run.state).T)], axis=1)
        parts.append(run.noise_floor * random.normal(size=bent.shape) + np.where(leans, bent, 0.0))
    assert rattle([(observations, parts), (observations, parts)]) is None


def test_bounces_that_have_moved_the_base_values_are_still_told(loose):
    observations, left = loose
    moved = [part + base @ (0.3 * np.abs(base).max(axis=(0, 1)) ** -1)
             for part, base in zip(left, observations.base)]
    found, again = (rattle([(observations, own), (observations, own)]) for own in (left, moved))
    assert again.joints == found.joints
    np.testing.assert_allclose(again.gap, found.gap, rtol=1e-6)


@pytest.mark.parametrize('shape', [
    lambda _run, load: np.ones_like(load),                  # noise
    lambda _run, load: np.abs(load),                        # noise that grows with the load
    lambda run, _load: np.exp(-(run.speed / 0.2) ** 2),      # noise where joints turn round
], ids=['everywhere', 'under load', 'at low speed'])
@pytest.mark.parametrize('seed', [1, 2, 3])
def test_other_noise_is_no_rattle(loose, shape, seed):
    observations, left = loose
    random = np.random.default_rng(seed)
    noises = []
    for run, part in zip(observations.runs, left):
        load = np.stack([np.interp(run.t, run.state.t, joint)
                         for joint in transmitted_torque(run.state).T], axis=1)
        noises.append(shape(run, load) * random.normal(0.0, 1.0, part.shape))
    assert rattle([(observations, noises)]) is None


def test_the_load_has_the_inertia_of_the_mechanism_less_that_of_the_motors(loose, case):
    observations, _ = loose
    run = observations.runs[0]
    times = run.t[[10, 400, 900]]
    inertia = load_inertia(run.state, times)
    geometry = run.state.geometry
    known = case[0].known.model
    values = run.state.nominal.values
    for time, found in zip(times, inertia):
        x = np.array([np.interp(time, run.state.t, axis) for axis in run.state.x.T])
        bodies = replace(
            known.lumped_bodies(), actuator_inertia=values['actuator_inertia'],
            platform_mass_1=float(values['platform_mass_1'][0]),
            platform_mass_2=float(values['platform_mass_2'][0]))
        whole = joint_mass_matrix(geometry, bodies, x)
        np.testing.assert_allclose(
            found, whole - 0.5 * np.diag(values['actuator_inertia']), atol=1e-9)
        np.testing.assert_allclose(found, found.T, atol=1e-9)
        assert np.all(np.linalg.eigvalsh(found) > 0.0)


def swinging_frame(state):
    """Return the torque (n, 4) that the drives need where the frame swings along y at 9 Hz.

    What moves pushes the frame, a mass on a spring with 2 % of damping, and its acceleration acts
    on the platform.
    """
    moving, mass, pulse = 1.5, 30.0, 2.0 * np.pi * 9.0
    step = float(state.t[1] - state.t[0])
    place = speed = 0.0
    force = np.zeros((len(state.t), 4))
    for row, asked in enumerate(state.xdd[:, 1]):
        acceleration = -pulse ** 2 * place - 0.04 * pulse * speed - moving / mass * asked
        speed += step * acceleration
        place += step * speed
        force[row, 1] = moving * acceleration
    return state.torque_of_force(force)


def test_a_frame_that_swings_is_no_backlash():
    logs = [log_with(seed=seed, duration=duration, beside=swinging_frame)
            for seed, duration in ((1, 12.0), (2, 8.0))]
    diagnosis = diagnose(logs[:1], REFERENCE, holdout_logs=logs[1:])
    assert (diagnosis.verdict, diagnosis.causes) == ('unknown', ())
    assert np.all(diagnosis.holdout.baseline_rms > 10.0 * diagnosis.holdout.noise_floor_rms)
    assert diagnosis.remaining.swing_hz == pytest.approx(9.0, abs=0.5)
    outcome = outcome_of_diagnosis(diagnosis, REFERENCE)
    assert 'something that swings at 9.0 Hz' in outcome.sentence
    assert diagnosis_json(diagnosis, REFERENCE)['remaining']['looks_like'] == (
        'something that swings at 9.0 Hz')
