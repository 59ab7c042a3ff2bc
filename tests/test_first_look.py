"""What a first look at transmissions that twist tells, from the measured torque."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hidden.hiders import HIDERS
from hidden.machines import known_machine
from hidden.motions import draw_motion
from hidden.recording import record
from planned import evidence_of
from searches import MODEL, log_with, springs_in
from test_swing import evidence_of_axis

from par4_dynamics.effects.springs import Drive
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.search import first_look as module
from par4_identification.diagnosis.search.first_look import first_look
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.swing import _Twisting
from par4_sim.machines.noise import Noise
from robots import REFERENCE

LEAST = 2.0 * Rules().evidence


def projected(stiffness, seed=1, duration=6.0, **common):
    """Return what a machine with soft joints leaves of its log; zero is a rigid joint."""
    return project(evidence_of(log_with(('elastic_transmission', {
        'stiffness': stiffness, **common}), seed=seed, duration=duration), REFERENCE, MODEL), [])


def test_joints_that_hide_each_other_are_seen():
    """Each of them alone leaves more than none, or hardly less."""
    stiffness, damping_ratio = np.array((3000.0, 3400.0, 0.0, 0.0)), 0.1
    projection = projected(tuple(stiffness), damping_ratio=damping_ratio)
    soft, twisting = stiffness > 0.0, _Twisting(projection)
    for joint in np.flatnonzero(soft):
        alone = np.where(np.arange(4) == joint, 1.0 / stiffness[joint], 0.0)
        assert twisting._squares(alone, Drive(damping_ratio)) > 0.95 * projection.squares
    look = first_look(projection)
    np.testing.assert_allclose(1.0 / look.compliance[soft], stiffness[soft], rtol=0.05)
    assert np.all(look.compliance[~soft] < 0.02 * look.compliance.max())
    assert look.squares > 0.8 * projection.squares
    found = springs_in(projection)
    np.testing.assert_allclose(1.0 / found.compliance[soft], stiffness[soft], rtol=0.01)
    assert found.told['damping_ratio'] == pytest.approx(damping_ratio, rel=0.02)


def test_soft_joints_of_a_machine_made_from_its_parts_are_seen():
    """Its springs share nothing with the effect that the other logs are made of."""
    known = known_machine('reference')
    drives = known.robot.drives.model_copy(update={'encoder_counts': 2 ** 24})
    known = replace(known, robot=known.robot.model_copy(update={'drives': drives}))
    compliance = np.array((1.0 / 3000.0, 1.0 / 3400.0, 0.0, 0.0))
    machine = HIDERS['elastic_transmission'].build(
        known.machine, {'compliance': compliance, 'damping_ratio': 0.1})
    log = record(known, machine, draw_motion('excitation', known.robot, 8.0, 7), fidelity='exact',
                 noise=Noise(), seed=7, feedforward=known.model, wander=None, name='soft').log
    projection = project(evidence_of(log, known.robot, known.model, 0.03), [])
    look = first_look(projection)
    np.testing.assert_allclose(look.compliance[:2], compliance[:2], rtol=0.05)
    assert np.all(look.compliance[2:] < 0.05 * look.compliance.max())
    assert look.squares > 0.9 * projection.squares


@pytest.mark.parametrize('seed', range(6))
def test_soft_joints_come_out_roughly_whatever_damps_them(seed):
    """Whatever share of the inertia turns with the motor, too: the look takes the usual numbers."""
    random = np.random.default_rng(seed)
    soft = random.permutation(4)[:random.integers(1, 5)]
    stiffness = np.zeros(4)
    stiffness[soft] = np.exp(random.uniform(np.log(2500.0), np.log(20000.0), len(soft)))
    projection = projected(tuple(stiffness), seed, damping_ratio=float(np.exp(random.uniform(
        np.log(0.01), np.log(0.3)))), motor_share=float(random.choice((0.35, 0.5, 0.7))))
    look = first_look(projection)
    np.testing.assert_allclose(look.compliance[soft] * stiffness[soft], 1.0, atol=0.25)
    assert look.squares > 0.5 * projection.squares
    assert projection.squares - springs_in(projection).squares < 0.05 * projection.squares


def test_the_look_is_linear_in_the_torque_that_is_left():
    """The measured torque, which tells what the springs carry, stays as it is."""
    projection = projected((0.0, 5000.0, 0.0, 9000.0), damping_ratio=0.1)
    whole, half = (first_look(replace_residual(projection, share)) for share in (1.0, 0.5))
    np.testing.assert_allclose(half.compliance, 0.5 * whole.compliance, atol=0.02 * np.max(
        whole.compliance))
    assert half.squares == pytest.approx(0.25 * whole.squares, rel=0.05)
    against = first_look(replace_residual(projection, -1.0))
    assert against.squares < 0.05 * whole.squares


def replace_residual(projection, share):
    """Return a projection of which a share is left."""
    evidence = projection.evidence
    return project(replace(evidence, target=share * evidence.target), [])


def test_springs_that_lower_frequencies_do_not_tell_are_told_by_all(monkeypatch):
    """What promises something has a soft joint to begin with."""
    projection = projected((0.0, 5000.0, 0.0, 0.0))
    seen = first_look(projection)
    by_all = replace(seen, compliance=0.5 * seen.compliance)
    rigid = replace(seen, compliance=np.zeros(4), squares=0.0)
    monkeypatch.setattr(module, '_look_at', lambda _columns, _targets, _runs, band: (
        by_all if band == 1.0 else rigid))
    look = first_look(projection)
    assert look.squares == seen.squares
    np.testing.assert_array_equal(look.compliance, by_all.compliance)


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_noise_of_the_measured_torque_is_no_spring(monkeypatch, seed):
    """It is in the column as in the target, as if what drives a load swung with it."""
    projection = project(evidence_of_axis(0.0, seed, noise=40.0), [])
    assert first_look(projection).squares < LEAST
    monkeypatch.setattr(module, '_noise_moment', lambda *_: 0.0)
    assert first_look(projection).squares > LEAST


def test_plateaus_tell_no_springs():
    """Their rows have no rates."""
    evidence = evidence_of_axis(1e-4)
    run, = evidence.observations.runs
    steady = replace(run, conditioning=replace(run.conditioning, steady=True))
    still = replace(evidence, observations=replace(evidence.observations, runs=(steady,)))
    look = first_look(project(still, []))
    assert look.squares == 0.0
    assert not look.compliance.any()
