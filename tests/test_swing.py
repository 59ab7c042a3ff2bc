"""Compliances of transmissions whose loads swing, from torque written down on its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hidden.scenario import Task, draw_scenario, record_scenario
from hidden.study import diagnosis_of
from planned import evidence_of, log_of

from par4_dynamics.effects.transmission import DAMPING_RATIO, MOTOR_SHARE
from par4_dynamics.model import build_model
from par4_dynamics.model_file import ModelFile
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.swing import compliances
from par4_kinematics.robot import Axis

AXIS = Axis(schema='par4/axis/1', name='arm', joint='arm', kind='revolute', gain=1.0)
INERTIA, COULOMB, VISCOUS = 0.2, 1.5, 0.8
LOAD = (1.0 - MOTOR_SHARE) * INERTIA
MODEL = build_model(AXIS, ModelFile(schema='par4/model/1', parameters={
    'actuator_inertia': {'value': INERTIA}, 'coulomb_friction': {'value': COULOMB},
    'viscous_friction': {'value': VISCOUS}}))
T = np.arange(0.0, 12.0, 1e-3)
RATES = 2.0 * np.pi * np.array((0.4, 1.1, 2.3, 4.1, 6.7, 9.8, 13.1, 17.3, 21.7))
SIZES = 0.3 / (1.0 + (RATES / 6.0) ** 2)
LEAST = 2.0 * Rules().evidence


def evidence_of_axis(compliance, seed=1, noise=0.05):
    """Return rows of an axis whose load hangs on a spring, in closed form.

    Of each sine of the motor the load makes (1 + 2 i d r) / (1 - r^2 + 2 i d r), r the frequency
    over that of the load on its spring, d the damping ratio.
    """
    phase = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, len(RATES))
    waves = SIZES * np.exp(1j * (RATES * T[:, None] + phase))
    r = RATES * np.sqrt(LOAD * compliance)
    loss = 2j * DAMPING_RATIO * r
    follows = (1.0 + loss) / (1.0 - r ** 2 + loss)
    q, qd = waves.sum(axis=1).real, (1j * RATES * waves).sum(axis=1).real
    inertia = INERTIA - LOAD + LOAD * follows
    tau = ((-RATES ** 2 * waves) @ inertia).real + COULOMB * np.sign(qd) + VISCOUS * qd
    log = log_of(AXIS, T, q[:, None], tau[:, None], seed, noise)
    return evidence_of(log, AXIS, MODEL, noise)


@pytest.mark.parametrize('resonance', [17.0, 22.0, 35.0, 60.0, 100.0])
def test_the_compliance_of_a_swinging_axis_comes_out(resonance):
    """Its load swings within the band of the motion, at its edge or far above."""
    true = 1.0 / (LOAD * (2.0 * np.pi * resonance) ** 2)
    found, ratio = compliances(project(evidence_of_axis(true), []), LEAST)
    assert found[0] == pytest.approx(true, rel=0.05)
    assert ratio > LEAST


@pytest.mark.parametrize('resonance', [35.0, 40.0, 45.0])
def test_the_springs_take_all_but_the_noise_from_the_target(resonance):
    """Which leaves about one square a row."""
    true = 1.0 / (LOAD * (2.0 * np.pi * resonance) ** 2)
    projection = project(evidence_of_axis(true, noise=0.5), [])
    _, ratio = compliances(projection, LEAST)
    before = float(projection.residual @ projection.residual)
    assert before > 2.0 * projection.evidence.rows
    assert before - ratio == pytest.approx(projection.evidence.rows, rel=0.2)


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_a_rigid_axis_has_none_worth_a_name(seed):
    found = compliances(project(evidence_of_axis(0.0, seed), []), LEAST)
    assert found is None or found[1] < LEAST


def test_a_load_that_swings_the_other_way_is_no_spring():
    true = 1.0 / (LOAD * (2.0 * np.pi * 35.0) ** 2)
    evidence = evidence_of_axis(true)
    assert compliances(project(evidence, []), LEAST) is not None
    other = replace(evidence, target=-evidence.target)
    assert compliances(project(other, []), LEAST) is None


@pytest.fixture(scope='module')
def machine():
    """Return a machine with swinging arms, made from its physics, and its diagnosis."""
    scenario = draw_scenario(Task('single', 30031, 'elastic_transmission', False))
    return scenario, diagnosis_of(scenario, *record_scenario(scenario))


def test_soft_joints_of_the_machine_come_out_with_their_stiffness(machine):
    scenario, diagnosis = machine
    assert [cause.effect.name for cause in diagnosis.causes] == ['elastic_transmission']
    cause, true = diagnosis.causes[0], scenario.hidden[0][1]['compliance']
    assert cause.twins == ()
    stiffness = np.full(4, np.inf)
    stiffness[list(cause.joints)] = cause.parameters['stiffness'].value
    soft = true > 0.1 * true.max()
    assert soft.sum() >= 2
    np.testing.assert_allclose(stiffness[soft], 1.0 / true[soft], rtol=0.1)
    # a joint that hardly twists comes out as one that hardly does
    assert np.all(stiffness[~soft] > 5.0 * stiffness[soft].max())
    assert diagnosis.holdout.explained_fraction > 0.9


def test_the_rigid_machine_of_the_same_seed_has_no_springs(machine):
    scenario = replace(machine[0], machine=machine[0].known.machine, hidden=())
    diagnosis = diagnosis_of(scenario, *record_scenario(scenario))
    assert diagnosis.causes == ()
    assert diagnosis.verdict == 'clean'
    found = compliances(project(diagnosis.evidence, []), LEAST)
    assert found is None or found[1] < LEAST
