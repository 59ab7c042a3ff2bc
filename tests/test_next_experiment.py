"""Two names that the data cannot tell apart: the proposed motion, run on the machine, decides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured import DWELL, simulation_of

from par4_dynamics.mechanism import STANDARD_GRAVITY
from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_joints
from par4_identification.diagnosis.diagnosis import LIBRARY, diagnose
from par4_identification.diagnosis.experiment.motion_library import joined, motion_library
from par4_identification.diagnosis.experiment.next_experiment import (
    Prospect,
    Trial,
    difference,
    moments,
    next_experiment,
    squared_rest,
    twins_of,
)
from par4_identification.logs.log import Log
from par4_identification.reports.diagnosis_report import report_of_diagnosis
from par4_identification.reports.outcome.diagnosis import diagnosis_json, outcome_of_diagnosis
from par4_kinematics.approach import with_approach
from par4_kinematics.circle import circle_motion
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.motion import check_limits
from par4_kinematics.motion_file import read_motion, write_motion
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.workspace import home_pose
from par4_sim.drives.held_load import HeldLoad
from par4_sim.machines.machine import Harmonic
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.machines.platform_forces import PlatformForces
from robots import OTHER, REFERENCE, model_with, other_model

NOISE = 0.3
MODEL = read_model('table1', REFERENCE)
CLEAN = machine_of_model(REFERENCE, MODEL)


def log_of_motion(machine, motion, seed, noise=NOISE):
    """Return the log of a motion on a machine whose drives know (20)."""
    simulation = simulation_of(REFERENCE, machine, MODEL, seed, noise)
    motion = with_approach(motion, REFERENCE, simulation.q)
    start = simulation.time + DWELL
    simulation.queue_reference(start + motion.t, motion.q, motion.qd, motion.qdd)
    state = state_of_joints(REFERENCE.geometry, motion.t, motion.q, motion.qd, motion.qdd)
    simulation.queue_effort(start + motion.t, MODEL.torque(state))
    told = simulation.next_samples(round((motion.duration + 2 * DWELL) / 1e-3))
    return Log(name=f'{motion.name} {seed}', joint_names=REFERENCE.joint_names, start_stamp=0,
               period=1e-3, t=np.arange(len(told.q)) * 1e-3, q=told.q, tau=told.effort,
               segments=(slice(0, len(told.q)),), reference=None, accounts=None)


def circles(*sizes):
    return joined([circle_motion(REFERENCE, radius=radius, speed=speed)
                   for radius, speed in sizes], f'circles {sizes}', REFERENCE)


def gentle(duration, seed):
    return excitation_motion(REFERENCE, duration, seed, slow_fraction=0.2, acceleration=15.0,
                             joint_speed=2.5)


NARROW = (circles((0.1, 1.0), (0.05, 1.0)), circles((0.07, 1.2)))
GENTLE = (gentle(6.0, 1), gentle(5.0, 2))


# machines with a cause, from physics

def with_friction(**fields):
    return replace(CLEAN, friction=replace(CLEAN.friction, **{
        name: np.full(4, value) for name, value in fields.items()}))


def with_constant_load(level):
    return replace(CLEAN, loads=(HeldLoad(np.full((1, 4), level), 1.0),))


def with_weights(first_moment):
    """A weight beside each arm: the drives supply the slope of -m g r cos q, its energy."""
    return replace(CLEAN, harmonics=tuple(
        Harmonic(joint, 9.81 * first_moment, 1.0, 0.0) for joint in range(4)))


def tilted(angle):
    turn = np.array(((1.0, 0.0, 0.0), (0.0, np.cos(angle), -np.sin(angle)),
                     (0.0, np.sin(angle), np.cos(angle))))
    return replace(CLEAN, gravity=turn.T @ STANDARD_GRAVITY)


def with_platform(**fields):
    return replace(CLEAN, platform=PlatformForces(**fields))


def with_lag(time_constant):
    return machine_of_model(REFERENCE, model_with(MODEL, 'actuator_lag',
                                                  time_constant=time_constant))


def with_rods(mass):
    return replace(CLEAN, bodies=replace(CLEAN.bodies, rod_mass=mass))


PAIRS = [
    ('stribeck', 'nonlinear_viscous', GENTLE,
     with_friction(stribeck_torque=0.105, stribeck_velocity=0.2)),
    ('nonlinear_viscous', 'stribeck', NARROW,
     with_friction(power_torque=-0.8, power_exponent=0.4)),
    ('torque_offset', 'arm_mass_offset', NARROW, with_constant_load(0.5)),
    ('arm_mass_offset', 'torque_offset', NARROW, with_weights(0.03)),
    ('base_tilt', 'torque_offset', NARROW, tilted(0.01)),
    ('theta_friction', 'passive_joint_friction', NARROW, with_platform(theta_viscous=0.05)),
    ('passive_joint_friction', 'theta_friction', NARROW, with_platform(pivot_viscous=0.01)),
    ('actuator_lag', 'time_offset', NARROW, with_lag(0.6e-3)),
]


def names(diagnosis):
    return {cause.effect.name for cause in diagnosis.causes}


def diagnosis_of(logs, heldout, effects):
    return diagnose(logs, REFERENCE, holdout_logs=[heldout],
                    library={name: LIBRARY[name] for name in effects})


@pytest.mark.parametrize('noise', [NOISE, NOISE / 6.0])
@pytest.mark.parametrize(('delay', 'verdict'), [(0.0, 'clean'), (-1.5e-3, 'explained')])
def test_noise_of_encoder_counts_is_no_rate_of_the_torque(delay, verdict, noise):
    """In gentle motion counts are most of the noise, in the torque's model as in its rates."""
    machine = machine_of_model(REFERENCE, model_with(MODEL, 'time_offset', delay=delay))
    old, heldout = (log_of_motion(machine, motion, seed, noise)
                    for seed, motion in enumerate(GENTLE))
    diagnosis = diagnosis_of([old], heldout, ('actuator_lag', 'time_offset'))
    assert diagnosis.verdict == verdict


@pytest.mark.parametrize(('truth', 'twin', 'motions', 'machine'), PAIRS,
                         ids=[pair[0] + '-' + pair[1] for pair in PAIRS])
def test_the_proposed_motion_separates_twins(truth, twin, motions, machine):
    old, heldout = (log_of_motion(machine, motion, 10 + seed)
                    for seed, motion in enumerate(motions))
    first = diagnosis_of([old], heldout, (truth, twin))
    cause, = first.causes
    assert {cause.effect.name, *cause.twins} == {truth, twin}

    experiment = next_experiment(first, REFERENCE)
    check_limits(experiment.motion, REFERENCE)
    trial = Trial(Prospect(first.evidence, REFERENCE, first.extended_model, first.effects),
                  twins_of(first.evidence, first.hypotheses, 0, LIBRARY[cause.twins[0]]))
    expected = [trial.if_true(number, (experiment.motion,)) for number in (0, 1)]
    assert experiment.expected_separation == pytest.approx(min(expected))
    assert [set(pair) for pair in experiment.separates] == [{truth, twin}]
    assert abs(experiment.separations[0].present) < 10.0

    new = log_of_motion(machine, experiment.motion, 7)
    second = diagnosis_of([old, new], heldout, (truth, twin))
    decided, = second.causes
    assert decided.effect.name == truth
    assert decided.twins == ()
    realised = difference(second.evidence,
                          twins_of(second.evidence, second.hypotheses, 0, LIBRARY[twin]))
    assert 1.0 / 3.0 < realised / expected[cause.effect.name != truth] < 3.0


@pytest.mark.parametrize(('machine', 'library', 'nearest'), [
    (with_friction(stribeck_torque=0.4, stribeck_velocity=0.2), ('platform_drag',),
     'platform_drag'),
    (with_weights(0.06), ('theta_friction', 'cable_spring'), 'cable_spring')])
def test_the_proposed_motion_tells_what_has_no_name_from_the_nearest_name(
        machine, library, nearest):
    """Weights beside the arms pull like springs, and are more like these than like friction."""
    old, heldout = (log_of_motion(machine, motion, seed) for seed, motion in enumerate(GENTLE))
    first = diagnosis_of([old], heldout, library)
    experiment = next_experiment(first, REFERENCE)
    (pair,), (item,) = first.doubts, experiment.separations
    assert pair.names == item.names == (first.unnamed[0].phrase, nearest)
    assert item.expected > 2.0 * item.present
    assert f'Play motion.yaml ({experiment.motion.name}' in ' '.join(
        remark.advice for remark in outcome_of_diagnosis(first, REFERENCE, experiment).remarks)

    new = log_of_motion(machine, experiment.motion, 7)
    second = diagnosis_of([old, new], heldout, library)
    assert 1.0 / 3.0 < difference(second.evidence, pair) / item.expected < 3.0


@pytest.mark.usefixtures('unrendered')
def test_an_exact_twin_gets_words_and_others_a_motion():
    """An offset is Coulomb asymmetry on every motion, weights beside the arms only on narrow ones.
    """
    old, heldout = (log_of_motion(with_constant_load(0.5), motion, seed)
                    for seed, motion in enumerate(NARROW))
    assert next_experiment(diagnosis_of([old], heldout, ('torque_offset',)), REFERENCE) is None

    exact = diagnosis_of([old], heldout, ('torque_offset', 'coulomb_asymmetry'))
    experiment = next_experiment(exact, REFERENCE)
    assert experiment.motion is None
    assert experiment.separations[0].most < 1.0
    assert diagnosis_json(exact, REFERENCE, experiment)['next_experiment'] is None
    outcome = outcome_of_diagnosis(exact, REFERENCE, experiment)
    assert any('with the drives off' in remark.advice for remark in outcome.remarks)

    both = diagnosis_of([old], heldout, ('torque_offset', 'coulomb_asymmetry', 'arm_mass_offset'))
    experiment = next_experiment(both, REFERENCE)
    assert experiment.separates == (('torque_offset', 'arm_mass_offset'),)
    assert diagnosis_json(both, REFERENCE, experiment)['next_experiment'] == {
        'motion': 'motion.yaml', 'separates': [['torque_offset', 'arm_mass_offset']],
        'expected_separation': experiment.expected_separation}
    outcome = outcome_of_diagnosis(both, REFERENCE, experiment)
    page = report_of_diagnosis(both, outcome, REFERENCE, [], {}, experiment)
    assert 'with the drives off' in page
    assert f'Play motion.yaml ({experiment.motion.name}' in page


@pytest.mark.parametrize(('robot', 'model'), [(REFERENCE, MODEL), (OTHER, other_model())],
                         ids=['reference', 'other'])
def test_motions_of_the_library_keep_the_limits_and_read_back(robot, model, tmp_path):
    motions = motion_library(robot, model)
    assert len(motions) > 20
    assert len({motion.name for motion in motions}) == len(motions)
    home = inverse_kinematics(robot.geometry, home_pose(robot))
    for motion in motions:
        check_limits(motion, robot)
        np.testing.assert_allclose(motion.q[[0, -1]], [home, home], atol=2e-3)
        for rest in (motion.qd[[0, -1]], motion.xd[[0, -1]]):
            np.testing.assert_allclose(rest, 0.0, atol=1e-9)
        state = state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd)
        assert np.abs(model.torque(state)).max() < robot.drives.torque_limit
        # positions, speeds and accelerations are of one motion, but for jumps of acceleration
        slope = np.gradient(motion.q, motion.period, axis=0)
        assert np.abs(slope - motion.qd).max() < 0.02 * np.abs(motion.qd).max()
    write_motion(tmp_path / 'motion.yaml', motions[0], 'platform')
    np.testing.assert_allclose(read_motion(tmp_path / 'motion.yaml', robot).q, motions[0].q,
                               atol=1e-9)
    again = motion_library(robot, model)
    assert all(np.array_equal(one.q, other.q) for one, other in zip(motions, again, strict=True))


def test_moments_of_stretches_give_the_residual_of_least_squares():
    random = np.random.default_rng(3)
    design, signal = random.standard_normal((60, 5)), random.standard_normal(60)
    design[:, 4] = design[:, 0] - 2.0 * design[:, 1]  # one column says nothing new
    products = sum(moments(design[rows], signal[rows]) for rows in (slice(0, 25), slice(25, 60)))
    left = signal - design @ np.linalg.lstsq(design, signal, rcond=None)[0]
    assert squared_rest(products) == pytest.approx(left @ left)
