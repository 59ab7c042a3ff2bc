"""Imposed displacement, and what the simplifications of (20) cost (the paper's Fig. 6)."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from browser import check_in_browser
from report_pages import checked_page
from ruamel.yaml import YAML
from test_commands import run

from par4_dynamics.model_file import read_model_file
from par4_dynamics.model_from_file import build_model, read_model
from par4_dynamics.state import state_of_joints
from par4_identification.commands import simplification
from par4_identification.fitting.simplification_cost import (
    ALL,
    NOTHING,
    adept_of,
    difference_of,
    rigid_model,
    study_simplification,
)
from par4_identification.reports.outcome.simplification import outcome_of_simplification
from par4_kinematics.errors import InputError, UnreachableError
from par4_kinematics.motion import Motion
from par4_kinematics.position import forward_kinematics
from par4_sim.closed_loop.imposed import imposed_run
from par4_sim.description.chains import engine_bodies
from par4_sim.machines.friction import Friction
from par4_sim.machines.machine import Machine
from par4_sim.plants.bullet import BulletPlant
from robots import OTHER, REFERENCE

TABLE_1 = read_model_file('table1')
WHOLE = rigid_model(REFERENCE, TABLE_1)
PAPER = replace(WHOLE, rigid_body='paper')
THETA = REFERENCE.limits.workspace.theta
COARSE = 0.5e-3
"""s; the noise of the experiment is a few hundredths of a percent and the tests are quick."""


def state_of(robot, run_of_it):
    return state_of_joints(robot.geometry, run_of_it.t, run_of_it.q, run_of_it.qd, run_of_it.qdd)


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


@pytest.fixture(scope='module')
def motion():
    return adept_of(REFERENCE, THETA, period=COARSE)


@pytest.fixture(scope='module')
def study(motion):
    return study_simplification(REFERENCE, WHOLE, motion, dt=COARSE)


# imposed displacement


@pytest.mark.parametrize('fidelity', ['accurate', 'fast'])
@pytest.mark.parametrize('robot', [REFERENCE, OTHER], ids=lambda robot: robot.name)
@pytest.mark.parametrize('rigid_body', ['paper', 'full'])
def test_imposed_torque_is_that_of_inverse_dynamics(robot, rigid_body, fidelity):
    """Without rods and bars it is the torque of (20), with them that of the whole mechanism."""
    model = replace(rigid_model(robot, TABLE_1), rigid_body=rigid_body)
    motion = adept_of(robot, 0.3, azimuth=0.2, period=COARSE)
    found = imposed_run(robot.geometry, model.lumped_bodies(), motion, fidelity, COARSE)
    needed = model.torque(state_of(robot, found))
    peak = np.abs(needed).max()
    assert 80.0 < peak < 400.0
    assert np.abs(found.torque - needed).max() < 1.5e-3 * peak
    assert rms(found.torque - needed) < 8e-4 * rms(needed)


def test_the_error_of_imposed_torque_falls_with_the_step():
    """What is left is the integrator, of second order, not the solver of the constraints."""
    errors = []
    for dt in (0.5e-3, 0.25e-3):
        found = imposed_run(REFERENCE.geometry, PAPER.lumped_bodies(),
                            adept_of(REFERENCE, THETA, period=dt), 'accurate', dt)
        errors.append(rms(found.torque - PAPER.torque(state_of(REFERENCE, found))))
    assert 1.8 < errors[0] / errors[1] < 4.5


def test_the_imposed_displacement_is_reached(motion):
    found = imposed_run(REFERENCE.geometry, WHOLE.lumped_bodies(), motion, 'accurate', COARSE)
    np.testing.assert_allclose(found.t, motion.t[1:len(found.t) + 1], atol=1e-12)
    np.testing.assert_allclose(found.q, motion.q[1:len(found.t) + 1], atol=1e-12)
    assert found.position_error < 1e-12
    assert found.opening < 1e-8
    assert np.abs(found.qd - motion.qd[1:len(found.t) + 1]).max() < 5e-3 * np.abs(motion.qd).max()
    assert len({len(part) for part in (found.t, found.q, found.qd, found.qdd, found.torque)}) == 1


def test_a_motion_with_samples_of_its_own_is_interpolated():
    """The torque is that of the interpolated motion; only the samples are as rare as they are."""
    found, same = (imposed_run(REFERENCE.geometry, PAPER.lumped_bodies(),
                               adept_of(REFERENCE, THETA, period=period), 'fast', COARSE)
                   for period in (1e-3, COARSE))
    np.testing.assert_allclose(found.t, same.t, atol=1e-12)
    assert np.abs(found.q - same.q).max() < 1e-5
    assert rms(found.torque - same.torque) < 0.02 * rms(same.torque)
    needed = PAPER.torque(state_of(REFERENCE, found))
    assert rms(found.torque - needed) < 1e-3 * rms(needed)


@pytest.mark.parametrize('fidelity', ['accurate', 'fast'])
def test_a_step_after_an_imposed_one_is_an_ordinary_step(fidelity):
    """With the torque that imposed motion needed and the friction, the motion goes on alike."""
    friction = Friction(coulomb=np.array((2.4, 2.0, 2.2, 2.6)), viscous=np.full(4, 2.0))
    bodies = WHOLE.lumped_bodies()
    motion = adept_of(REFERENCE, THETA)
    imposed = imposed_run(REFERENCE.geometry, bodies, motion, fidelity)
    plant = BulletPlant(Machine(REFERENCE.geometry, bodies, friction), fidelity)
    try:
        plant.reset(motion.x[0])
        for target in motion.q[1:200]:
            plant.impose(target)
        assert plant.time == pytest.approx(199 * plant.dt)
        for row in range(198, 258):  # of the imposed run: torque and motion at t of the plant
            speed = imposed.qd[row]
            plant.step(imposed.torque[row] + friction.coulomb * np.sign(speed)
                       + friction.viscous * speed)
        assert np.abs(plant.q - motion.q[259]).max() < 2e-5
        np.testing.assert_allclose(forward_kinematics(REFERENCE.geometry, plant.q, plant.x),
                                   plant.x, atol=5e-6)
        plant.reset(motion.x[0])
        q = plant.q
        hold = PAPER.torque(state_of_joints(REFERENCE.geometry, np.zeros(1), q[None],
                                            np.zeros((1, 4)), np.zeros((1, 4))))[0]
        for _ in range(50):
            plant.step(hold + 1.5)  # friction holds again
        np.testing.assert_array_equal(plant.q, q)
    finally:
        plant.close()


def test_impossible_displacements_are_refused(motion):
    bodies = WHOLE.lumped_bodies()
    plant = BulletPlant(Machine(REFERENCE.geometry, bodies, Friction()), 'fast')
    try:
        plant.reset(motion.x[0])
        with pytest.raises(UnreachableError, match='driven out of reach'):
            plant.impose((np.nan, 0.0, 0.0, 0.0))
    finally:
        plant.close()
    begins = 60
    parts = (getattr(motion, name)[begins:] for name in ('q', 'qd', 'qdd', 'x', 'xd', 'xdd'))
    with pytest.raises(InputError, match='motion cut: it begins at .* rad/s'):
        imposed_run(REFERENCE.geometry, bodies, Motion('cut', motion.t[:-begins], *parts))
    with pytest.raises(InputError, match='rod of 0.6 kg'):
        imposed_run(REFERENCE.geometry, replace(bodies, rod_mass=0.6), motion)


# what the simplifications cost


def test_difference_is_measured_over_each_joint_and_over_all():
    torque = np.array(((3.0, 0.0, 1.0, 2.0), (-3.0, 4.0, 1.0, 2.0)))
    found = difference_of(0.1 * torque * (1.0, 2.0, 0.0, 1.0), torque)
    np.testing.assert_allclose(found.of_rms, (0.1, 0.2, 0.0, 0.1))
    np.testing.assert_allclose(found.of_peak, (0.1, 0.2, 0.0, 0.1))
    np.testing.assert_allclose(found.rms, (0.3, 0.8 / np.sqrt(2.0), 0.0, 0.2))
    assert found.overall_of_peak == pytest.approx(0.8 / 4.0)
    assert found.overall_of_rms == pytest.approx(np.sqrt(
        (0.3 ** 2 + 0.8 ** 2 / 2.0 + 0.2 ** 2) / (9.0 + 8.0 + 1.0 + 4.0)))


def test_without_rods_and_bars_the_experiment_shows_noise_only(study):
    noise, whole = study.difference(NOTHING), study.difference(ALL)
    assert noise.overall_of_rms < 5e-4
    assert whole.overall_of_rms > 20.0 * noise.overall_of_rms
    assert study.formula_error < 1e-3
    assert study.position_error < 1e-12


def test_the_reference_robot_shows_the_papers_two_percent(study):
    """The paper's figure against Adams, on the 15 G motion with theta over its whole range."""
    whole = study.difference(ALL)
    assert whole.overall_of_rms == pytest.approx(0.02, abs=0.003)
    assert whole.overall_of_peak == pytest.approx(0.02, abs=0.003)


def test_the_single_bodies_of_the_robot_show_the_same(study, motion, monkeypatch):
    """Rods of 40 g with m l^2 / 12 and plates as light as they are, as in the paper's Adams.

    The plant's own bodies are heavier, with the same lumped and distributed masses; these here
    only need far more sweeps.
    """
    monkeypatch.setattr('par4_sim.description.chains.ROD_SHARE', 0.0)
    monkeypatch.setattr('par4_sim.description.chains.BAR_SHARE', 0.0)
    monkeypatch.setattr('par4_sim.plants.bullet.IMPOSED_ITERATIONS', 2000)
    single = engine_bodies(REFERENCE.geometry, WHOLE.lumped_bodies())
    assert (single.rod_mass, single.bar_mass) == (0.04, 0.03)
    found = imposed_run(REFERENCE.geometry, WHOLE.lumped_bodies(), motion, 'accurate', COARSE)
    whole = difference_of(found.torque - study.simplified, found.torque)
    assert whole.overall_of_rms == pytest.approx(study.difference(ALL).overall_of_rms, rel=5e-3)
    assert whole.overall_of_peak == pytest.approx(study.difference(ALL).overall_of_peak, rel=5e-3)


def test_rods_and_bars_alone_add_up(study):
    assert set(study.parts) == {'rods', 'bars'}
    assert study.additivity_error < 1e-3
    assert study.share('rods') + study.share('bars') == pytest.approx(1.0, abs=1e-3)
    assert 0.75 < study.share('rods') < 0.95
    for part in study.parts:
        assert study.difference(part).overall_of_rms > 5.0 * study.difference(
            NOTHING).overall_of_rms


def test_without_turning_everything_comes_from_the_rods():
    """Half plates that move alike do not accelerate the bars' ends against each other."""
    study = study_simplification(REFERENCE, WHOLE, adept_of(REFERENCE, 0.0, period=COARSE),
                                 dt=COARSE)
    assert study.share('rods') == pytest.approx(1.0, abs=1e-3)
    assert np.abs(study.contribution('bars')).max() < 1e-3 * np.abs(study.contribution(ALL)).max()


def test_a_difference_within_the_noise_gets_no_cause():
    """Bars alone, on a motion on which they leave nothing out: there are no shares to tell."""
    motion = adept_of(REFERENCE, 0.0, period=1e-3)
    model = replace(WHOLE, bodies=WHOLE.bodies.model_copy(update={'rod_mass': 0.0}))
    study = study_simplification(REFERENCE, model, motion, 'fast', 1e-3)
    outcome = outcome_of_simplification(study, motion)
    assert outcome.standing != 'good'
    assert 'hardly more than the noise' in outcome.sentence
    assert 'bars' not in outcome.sentence
    assert not outcome.remarks[0].good


def test_an_inertia_at_theta_is_a_part_of_its_own(motion):
    """Its torque is I thetadd on J_1's last row: power balance with the joints' speed."""
    inertia = 0.002
    model = replace(WHOLE, bodies=WHOLE.bodies.model_copy(update={'theta_inertia': inertia}))
    study = study_simplification(REFERENCE, model, motion, dt=COARSE)
    assert set(study.parts) == {'rods', 'bars', 'theta inertia'}
    rows = slice(1, len(study.t) + 1)
    power = np.sum(study.contribution('theta inertia') * motion.qd[rows], axis=1)
    expected = inertia * motion.xdd[rows, 3] * motion.xd[rows, 3]
    assert np.abs(power - expected).max() < 0.02 * np.abs(expected).max()


def test_pybullets_difference_is_proportional_to_rod_mass(motion):
    torques = {}
    for rod_mass in (0.0, 0.02, 0.04, 0.08):
        bodies = replace(WHOLE.lumped_bodies(), rod_mass=rod_mass, bar_mass=0.0)
        torques[rod_mass] = imposed_run(REFERENCE.geometry, bodies, motion, 'fast', COARSE).torque
    each = {rod_mass: (torque - torques[0.0]) / rod_mass for rod_mass, torque in torques.items()
            if rod_mass}
    for rod_mass in (0.02, 0.08):
        assert rms(each[rod_mass] - each[0.04]) < 2e-3 * rms(each[0.04])


def test_the_table_holds_the_experiment_and_its_limits(study):
    """One cell is the motion of the experiment; errors grow with rod mass, and not without it."""
    cells = {(cell.direction, round(cell.theta_range, 3), cell.rod_mass): cell
             for cell in study.table}
    assert len(cells) == 3 * 3 * 4
    whole = study.difference(ALL)
    same = cells['x', round(THETA, 3), REFERENCE.bodies.rod_mass]
    assert same.of_rms == pytest.approx(whole.overall_of_rms, rel=0.02)
    assert same.of_peak == pytest.approx(whole.overall_of_peak, rel=0.02)
    for direction in ('x', 'y', 'diagonal'):
        assert cells[direction, 0.0, 0.0].of_rms < 1e-12  # neither rods nor turning bars
        assert cells[direction, 0.0, 0.08].of_rms == pytest.approx(
            4.0 * cells[direction, 0.0, 0.02].of_rms, rel=0.05)
        errors = [cells[direction, round(THETA, 3), mass].of_rms
                  for mass in (0.0, 0.02, 0.04, 0.08)]
        assert errors == sorted(errors)


def test_motions_that_a_robot_cannot_make_have_no_figure():
    narrow = REFERENCE.model_copy(update={'limits': REFERENCE.limits.model_copy(update={
        'joint_speed': 10.0})})  # the diagonal needs 10.3 rad/s, y with theta 11.4
    study = study_simplification(narrow, WHOLE, adept_of(narrow, 0.0, period=1e-3), dt=1e-3)
    for cell in study.table:
        possible = cell.direction != 'diagonal' and not (
            cell.direction == 'y' and cell.theta_range == THETA)
        assert np.isfinite(cell.of_rms) == possible


def test_rods_too_heavy_for_the_base_parameters_are_left_out_of_the_table():
    heavy = REFERENCE.model_copy(update={'bodies': REFERENCE.bodies.model_copy(
        update={'rod_mass': 0.25})})
    study = study_simplification(heavy, rigid_model(heavy, TABLE_1),
                                 adept_of(heavy, 0.0, period=1e-3), 'fast', 1e-3)
    assert {cell.rod_mass for cell in study.table} == {0.0, 0.125, 0.25}


def test_friction_and_effects_take_no_part():
    as_printed = rigid_model(REFERENCE, read_model_file('table1_as_printed'))
    state = state_of_joints(REFERENCE.geometry, np.zeros(1), [[0.1, 0.2, 0.3, 0.25]],
                            [[1.0, -2.0, 3.0, 0.5]], [[5.0, 6.0, -7.0, 8.0]])
    np.testing.assert_array_equal(as_printed.torque(state), WHOLE.torque(state))
    friction = build_model(REFERENCE, read_model_file('table1_as_printed')).torque(state)
    assert np.abs(friction - as_printed.torque(state)).min() > 2.0
    assert read_model('table1_full', REFERENCE).bodies == WHOLE.bodies


# the command


@pytest.fixture(scope='module')
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp('simplification') / 'new'
    result = run(simplification, '--robot', 'reference', '--model', 'table1', '--output', folder,
                 '--fidelity', 'fast')
    assert result.code == 0, result.err
    result.folder = folder
    return result


def test_the_command_says_what_it_found(done):
    content = json.loads((done.folder / 'simplification.json').read_text())
    assert content['schema'] == 'par4/simplification/1'
    assert content['error']['overall']['of_rms'] == pytest.approx(0.0209, abs=3e-4)
    assert [len(content['error'][name]) for name in ('rms', 'largest', 'of_rms', 'of_peak')
            ] == [4] * 4
    assert list(content['parts']) == ['rod_mass', 'bar_mass']
    shares = [part['share'] for part in content['parts'].values()]
    assert sum(shares) == pytest.approx(1.0, abs=1e-3)
    assert content['noise']['overall']['of_rms'] < 2e-4
    assert content['provenance']['options'] == {'model': 'table1', 'fidelity': 'fast'}
    sentence = done.out.splitlines()[0]
    assert sentence.startswith('The simplifications of (20) cost 2.1 % of the rms torque')
    assert sentence.endswith('86 % of it comes from the rods and 14 % from the bars.')
    assert done.err == ''


def test_the_report_stands_alone(done):
    page = checked_page(done.folder / 'report.html', 2)
    check_in_browser(done.folder / 'report.html', 2)
    sentence = done.out.splitlines()[0]
    assert page.text.index(sentence) < page.text.index('What it rests on')
    for words in ('rods of 40 g', 'diagonal', '± 45.0°', 'share of the whole', 'noise'):
        assert words in page.text
    assert 'What was read' not in page.text  # there is no bag


@pytest.mark.parametrize(('arguments', 'words'), [
    (('--motion', 'nowhere'), 'motion nowhere: no such file'),
    (('--robot', 'nowhere'), 'nowhere: no such file'),
    (('--model', 'nowhere'), 'nowhere: no such file'),
    (('--fidelity', 'exact'), 'exact')])
def test_bad_input_is_refused_in_one_line(tmp_path, arguments, words):
    result = run(simplification, '--output', tmp_path / 'results', *arguments)
    assert result.code == 2
    assert len(result.err.splitlines()) == 1
    assert result.err.startswith('error: ')
    assert words in result.err
    assert not (tmp_path / 'results').exists()


@pytest.mark.parametrize(('bodies', 'words'), [
    ({}, 'are all 0, so (20) leaves nothing out'),
    ({'rod_mass': 0.6}, 'is negative with a rod of 0.6 kg')])
def test_robots_that_show_nothing_are_refused(tmp_path, bodies, words):
    content = REFERENCE.model_dump(mode='json', by_alias=True) | {'bodies': bodies}
    with (tmp_path / 'robot.yaml').open('w', encoding='utf-8') as stream:
        YAML(typ='safe', pure=True).dump(content, stream)
    result = run(simplification, '--robot', tmp_path / 'robot.yaml', '--output', tmp_path / 'new')
    assert result.code == 2
    assert len(result.err.splitlines()) == 1
    assert words in result.err
    assert not (tmp_path / 'new').exists()
