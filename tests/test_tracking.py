"""How well motions are followed: what the figures mean, and laws that every run obeys."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from browser import check_in_browser
from click.testing import CliRunner

from par4_dynamics.model_from_file import read_model
from par4_kinematics.adept import adept_motion
from par4_kinematics.circle import circle_motion
from par4_kinematics.errors import InputError
from par4_kinematics.files import write_yaml
from par4_kinematics.motion import Motion
from par4_kinematics.motion_file import MOTION_SCHEMA
from par4_sim.commands.track import track
from par4_sim.jobs.motion import motion_asked
from par4_sim.tracking.case import Case, Plan
from par4_sim.tracking.comparison import outcome_of_tracking
from par4_sim.tracking.learning import Cycle
from par4_sim.tracking.metrics import errors_of, tracking_of
from par4_sim.tracking.run import TrackedRun, feedforward_of, record_run
from par4_sim.tracking.stability import Margin
from robots import REFERENCE, model_with

MACHINE = read_model('table1_full', REFERENCE)
PAPERS_RUN = adept_motion(REFERENCE)


def recorded(motion, feedforward=None, machine=MACHINE, robot=REFERENCE):
    torque = None if feedforward is None else feedforward_of(robot, feedforward, motion)
    return record_run(robot, machine, motion, torque)


@pytest.fixture(scope='module')
def alone():
    return recorded(PAPERS_RUN)


@pytest.fixture(scope='module')
def helped():
    return recorded(PAPERS_RUN, MACHINE)


def test_the_papers_run_overshoots_and_a_model_removes_it(alone, helped):
    """Fig. 4: "the overshoot is important"; a dynamic model "should give better results"."""
    without, exact = tracking_of(alone), tracking_of(helped)
    paper = tracking_of(recorded(PAPERS_RUN, read_model('table1', REFERENCE)))
    assert 0.012 < without.rms < 0.016
    assert without.excursion > 0.015
    assert without.overshoot > 0.015
    assert exact.rms < paper.rms < 0.4e-3
    assert paper.excursion < 1e-3
    assert max(without.peak_torque, exact.peak_torque) < 150.0
    assert without.saturated == exact.saturated == 0.0


@pytest.mark.parametrize('run_name', ['alone', 'helped'])
def test_over_a_closed_cycle_the_motors_work_is_what_friction_takes(run_name, request):
    run = request.getfixturevalue(run_name)
    speed = np.abs(run.qd)
    friction = np.sum(MACHINE.values['coulomb_friction'] * speed
                      + MACHINE.values['viscous_friction'] * speed ** 2, axis=1)
    found = tracking_of(run)
    assert found.energy == pytest.approx(np.trapezoid(friction, run.t), rel=5e-3)
    assert found.driving_energy > 1.5 * found.energy
    assert tracking_of(run, cycles=4).energy == pytest.approx(found.energy / 4.0)


def test_without_an_integral_the_lag_is_the_torque_over_both_gains():
    """Slowly e = (tau - tau at the start) / (velocity_gain position_gain): the error constant.

    The drives begin settled, with the torque that holds the machine at the start.
    """
    drives = REFERENCE.drives.model_copy(update={'integral_gain': 0.0, 'encoder_counts': 0})
    robot = REFERENCE.model_copy(update={'drives': drives})
    motion = circle_motion(robot, radius=0.1, speed=0.2)
    run = recorded(motion, robot=robot)
    rows = slice(400, -400)
    q = np.stack([np.interp(motion.t, run.t, run.q[:, joint]) for joint in range(4)], axis=1)
    lag = (motion.q - q)[rows]
    torque = feedforward_of(robot, MACHINE, motion)
    expected = (torque[rows] - torque[0]) / (drives.velocity_gain * drives.position_gain)
    sliding = np.abs(motion.qd[rows]) > 0.15  # the jump of Coulomb friction is no slow torque
    np.testing.assert_allclose(lag[sliding], expected[sliding], atol=0.1 * np.abs(expected).max())
    assert np.corrcoef(lag[sliding], expected[sliding])[0, 1] > 0.995


def test_a_machine_at_rest_does_not_stir_when_feedforward_sets_in():
    """The integrals hold the weight; torque that comes for the first point is not added to it."""
    run = recorded(PAPERS_RUN, MACHINE)
    np.testing.assert_allclose(run.pose[run.t < 0.0], np.broadcast_to(
        PAPERS_RUN.x[0], (80, 4)), atol=2e-6)
    half_a_count = math.pi / REFERENCE.drives.encoder_counts
    np.testing.assert_allclose(run.command[0], run.feedforward[0], atol=1.1 * half_a_count * (
        REFERENCE.drives.velocity_gain * REFERENCE.drives.position_gain))


def swinging(decay: float, rate: float, size: float, axis: int = 0) -> TrackedRun:
    """Return a run that arrives in time and then swings about the end, by formula."""
    t = 0.25e-3 * np.arange(4001)
    asked = 1e-3 * np.arange(501)
    x = np.zeros((len(asked), 4))
    x[:, axis] = 0.3 * np.minimum(asked / 0.4, 1.0)
    pose = np.zeros((len(t), 4))
    after = np.maximum(t - 0.4, 0.0)
    pose[:, axis] = 0.3 * np.minimum(t / 0.4, 1.0) + size * np.exp(-decay * after) * np.sin(
        rate * after)
    still, torque = np.zeros_like(x), np.zeros((len(t), 4))
    counts = {'saturated_commands': 0, 'saturated_speeds': 0, 'unsolved_programs': 0}
    return TrackedRun(Motion('ramp', asked, still, still, still, x, still, still), t, pose, torque,
                      torque, torque, torque, None, counts, 0)


@pytest.mark.parametrize('axis', [0, 1, 2])
def test_overshoot_and_settling_time_are_those_of_iso_9283(axis):
    decay, rate, size, band = 20.0, 100.0, 5e-3, 0.5e-3
    found = tracking_of(swinging(decay, rate, size, axis), band=band)
    top = math.atan(rate / decay) / rate
    assert found.overshoot == pytest.approx(size * math.exp(-decay * top) * math.sin(rate * top),
                                            rel=1e-3)
    after = np.linspace(0.0, 0.5, 500_001)
    last = after[np.abs(size * np.exp(-decay * after) * np.sin(rate * after)) > band][-1]
    entering = band / (0.3 / 0.4)  # before the end of the ramp
    assert found.settling_time == pytest.approx(last + entering, abs=1e-3)
    assert found.arrival == pytest.approx(max(0.4 + last - 0.5, 0.0), abs=1e-3)
    assert found.excursion == pytest.approx(found.overshoot, rel=1e-4)


def test_a_path_that_wanders_settles_on_its_last_way_only():
    """Passing the attained position earlier, on the way to elsewhere, is no first crossing."""
    run = swinging(20.0, 100.0, 0.0)
    wave = 0.1 * np.sin(2.0 * np.pi * 3.0 * np.minimum(run.motion.t, 0.4))
    x = run.motion.x.copy()
    x[:, 0] = wave
    pose = run.pose.copy()
    pose[:, 0] = np.interp(run.t, run.motion.t, wave)
    found = tracking_of(replace(run, motion=replace(run.motion, x=x), pose=pose))
    assert found.overshoot == 0.0
    assert found.settling_time == pytest.approx(0.0, abs=1e-3)


def test_a_swing_within_the_limit_band_is_no_overshoot():
    found = tracking_of(swinging(20.0, 100.0, 0.4e-3))
    assert found.overshoot == 0.0
    assert found.settling_time == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize('axis', [0, 1, 2])
def test_what_leaves_the_band_near_the_end_has_not_settled(axis):
    """A swing that does not fade is in the band at the last sample; its overshoot is known."""
    found = tracking_of(swinging(0.0, 100.0 * math.pi, 2e-3, axis))
    assert not found.settled
    assert math.isnan(found.settling_time)
    assert math.isnan(found.arrival)
    assert found.overshoot == pytest.approx(2e-3, rel=0.02)
    assert tracking_of(swinging(0.0, 100.0 * math.pi, 2e-3, axis), band=3e-3).settled


@pytest.mark.usefixtures('unrendered')
def test_the_command_says_what_has_not_settled(tmp_path):
    done = told('adept', '--band', 0.001, '--feedforward', 'none', '--feedforward', 'table1',
                '--output', tmp_path)
    assert done.exit_code == 0, done.output
    runs = json.loads((tmp_path / 'tracking.json').read_text())['runs']
    assert all(run[name] is None for run in runs for name in ('settling_time', 'arrival'))
    assert all(run['overshoot'] > 0.0 for run in runs)
    assert done.output.count('not settled') == 2
    page = (tmp_path / 'report.html').read_text()
    assert page.count('<td class="number">not settled</td>') == 4
    assert 'Loops alone: not settled, D leaves the limit band of ± 0.001 mm' in page


@pytest.mark.parametrize(('axis', 'side'), [(0, 1), (1, -1), (2, 1), (2, -1)])
def test_what_lies_outside_the_workspace_is_told(axis, side):
    """Beyond the radius, above and below; at the edge it is not outside."""
    space = REFERENCE.limits.workspace
    run = swinging(20.0, 100.0, 0.0)
    edge = np.zeros(4)
    edge[2] = np.mean(space.z)
    edge[axis] = side * space.radius if axis < 2 else space.z[side > 0]
    pose = np.tile(edge, (len(run.t), 1))
    assert tracking_of(replace(run, pose=pose), space=space).outside == 0.0
    pose[70, axis] += side * 0.003
    assert tracking_of(replace(run, pose=pose), space=space).outside == pytest.approx(0.003)


def test_errors_are_taken_at_equal_times():
    """A pure delay of d on a ramp of speed v is an error of v d."""
    run = swinging(20.0, 100.0, 0.0)
    late = replace(run, pose=np.concatenate((np.zeros((40, 4)), run.pose[:-40])))
    error = errors_of(late)[50:400]
    np.testing.assert_allclose(error[:, 0], -0.01 * 0.3 / 0.4, rtol=1e-6)
    np.testing.assert_array_equal(error[:, 1:], 0.0)


def test_what_the_exact_model_leaves_is_the_sampling_of_its_torque():
    """Between the points, torque is interpolated linearly."""
    rms = []
    for period in (1e-3, 2.5e-4):
        motion = motion_asked('adept', REFERENCE, period=period, jerk=30_000.0)
        assert motion.period == pytest.approx(period)
        rms.append(tracking_of(recorded(motion, MACHINE)).rms)
    assert rms[1] < 0.25 * rms[0] < 5e-6


def test_what_is_said_of_stability_follows_from_the_margin(alone):
    case = Case('loops', 'none', alone, tracking_of(alone),
                margin=Plan(REFERENCE, MACHINE, PAPERS_RUN).margin('loops', None))
    for told, words in ((case, 'Over the workspace the open loop of loops stays 0.26 from -1;'),
                        (replace(case, margin=Margin(0.0, 0.0, 0.0, 9.0)),
                         'poses at which loops would be unstable without friction.'),
                        (replace(case, margin=None), 'is not told: the transmissions have springs'),
                        (replace(case, margin=None, controller='torque'), '')):
        remarks = outcome_of_tracking([told], PAPERS_RUN, 'here', REFERENCE, 0.5e-3).remarks
        found = [part.text for part in remarks if 'open loop' in part.text
                 or 'stab' in part.text]
        assert len(found) == bool(words)
        assert words in ''.join(found)


@pytest.mark.parametrize(('cycles', 'good', 'words'), [
    ([3.22e-4], True, 'one cycle shows no learning; the error of D was 0.322 mm rms, that of'),
    ([3.22e-4, 1.4e-5], True, 'within 2 cycles the error of D fell from 0.322 mm to 0.0140 mm rms'),
    ([3.22e-4, 3.219e-4], False, 'within 2 cycles the error of D did not fall from 0.322 mm rms;'),
    ([3.22e-4, 4e-4], False, 'within 2 cycles the error of D did not fall from 0.322 mm rms;')])
def test_what_is_said_of_learning_is_what_came_of_it(alone, cycles, good, words):
    """The best cycle is that of the least error of the joints, here the last."""
    learned = tuple(Cycle(rms, 1e-5 / number, 1e-4) for number, rms in enumerate(cycles, start=1))
    case = Case('learning', 'table1', alone, tracking_of(alone), learned)
    remark = outcome_of_tracking([case], PAPERS_RUN, 'here', REFERENCE, 0.5e-3).remarks[-1]
    assert words in remark.text
    assert remark.good == good


def test_what_is_limited_shows():
    drives = REFERENCE.drives.model_copy(update={'torque_limit': 60.0})
    run = recorded(PAPERS_RUN, MACHINE, robot=REFERENCE.model_copy(update={'drives': drives}))
    found = tracking_of(run)
    assert found.saturated == pytest.approx(np.mean(np.abs(run.command) > 59.999), rel=0.05)
    assert found.saturated > 0.02
    assert found.peak_torque <= 60.0
    assert found.peak > 5e-3


def test_a_sample_that_is_limited_counts_once_and_none_before_the_record_does():
    """Drives that may not move are limited in every sample, and in their torque here and there."""
    drives = REFERENCE.drives.model_copy(update={'torque_limit': 60.0, 'speed_limit': 1e-6})
    run = recorded(PAPERS_RUN, MACHINE, robot=REFERENCE.model_copy(update={'drives': drives}))
    assert run.counts['saturated_speeds'] == run.torque.size
    assert run.counts['saturated_commands'] > 100
    assert tracking_of(run).saturated == 1.0


@pytest.mark.parametrize('law', ['computed_torque', 'torque'])
def test_laws_without_a_limit_of_speed_count_their_limited_torques(law):
    drives = REFERENCE.drives.model_copy(update={'torque_limit': 100.0})
    run = record_run(REFERENCE.model_copy(update={'drives': drives}), MACHINE, PAPERS_RUN,
                     feedforward_of(REFERENCE, MACHINE, PAPERS_RUN), law=law, known=MACHINE)
    assert run.limited == run.counts['saturated_commands'] > 100


def told(*arguments):
    return CliRunner().invoke(track, [str(part) for part in arguments])


def test_the_command_writes_the_contract(tmp_path):
    done = told('adept', '--feedforward', 'none', '--feedforward', 'table1', '--cycles', 2,
                '--jerk', 30000, '--output', tmp_path / 'out')
    assert done.exit_code == 0, done.output
    content = json.loads((tmp_path / 'out' / 'tracking.json').read_text())
    assert content['schema'] == 'par4/tracking/1'
    assert [(run['controller'], run['feedforward']) for run in content['runs']] == [
        ('loops', 'none'), ('loops', 'table1')]
    for run in content['runs']:
        assert {'rms', 'peak', 'overshoot', 'settling_time', 'peak_torque', 'rms_torque',
                'energy'} <= run.keys()
        assert all(math.isfinite(value) for value in run.values() if isinstance(value, float))
    assert content['motion'] == {'name': 'adept', 'duration': 0.5, 'cycles': 2}
    page = (tmp_path / 'out' / 'report.html').read_text()
    assert page.count('<img src="data:image/svg+xml;base64,') == 2
    check_in_browser(tmp_path / 'out' / 'report.html', 2)
    assert 'http' not in page.replace('http-equiv', '')
    assert 'loops alone' in done.output


@pytest.mark.parametrize(('arguments', 'message'), [
    (('excitation', '--cycles', 2), 'cycles: for the motion adept'),
    (('adept', '--duration', 2), '--duration: for the motions excitation and circle, found motion '
                                 'adept; leave it away, give --cycles or write'),
    (('circle', '--motion-seed', 0), '--motion-seed: for the motion excitation, found motion circ'),
    (('adept', '--acceleration', 30), 'round trip of 0.25 s'),
    (('adept', '--feedforward', 'nothing'), 'nothing: no such file'),
    (('nowhere.yaml',), 'nowhere.yaml: no such file')])
def test_bad_input_is_one_line_and_nothing_is_written(tmp_path, arguments, message):
    done = told(*arguments, '--output', tmp_path / 'out')
    assert isinstance(done.exception, InputError)
    assert message in str(done.exception)
    assert '\n' not in str(done.exception)
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize('option', ['duration', 'motion_seed', 'period', 'cycles', 'jerk'])
def test_an_option_that_a_motion_file_would_ignore_is_refused(tmp_path, option):
    path = tmp_path / 'mine.yaml'
    write_yaml(path, {'schema': MOTION_SCHEMA, 'recipe': {'kind': 'circle', 'turns': 1}})
    flag = f'--{option.replace("_", "-")}'
    done = told(path, flag, 0.01 if option == 'period' else 1, '--output', tmp_path / 'out')
    assert isinstance(done.exception, InputError)
    assert str(done.exception) == (f'{flag}: found the motion file {path}, which is played as it '
                                   f'is; leave it away or change the file')
    assert motion_asked(str(path), REFERENCE).name == 'circle'


@pytest.mark.usefixtures('unrendered')
def test_the_energy_of_a_cycle_does_not_depend_on_how_many_are_asked_for(tmp_path):
    """But for the first and last turn of a circle, in which it gets up to speed and stops."""
    def energy(*arguments):
        done = told(*arguments, '--feedforward', 'table1_full', '--output', tmp_path)
        assert done.exit_code == 0, done.output
        content = json.loads((tmp_path / 'tracking.json').read_text())
        return content['motion']['cycles'], content['runs'][0]['energy']

    for short, long, numbers in ((('adept',), ('adept', '--cycles', 4), (1, 4)),
                                 (('circle',), ('circle', '--duration', 9.5), (3, 5))):
        (few, once), (many, each) = energy(*short), energy(*long)
        assert (few, many) == numbers
        assert each == pytest.approx(once, rel=0.1)


def test_a_payload_that_the_model_does_not_know_costs_accuracy():
    machine = model_with(MACHINE, 'payload', mass=0.5, half=1.0)
    blind = tracking_of(recorded(PAPERS_RUN, MACHINE, machine))
    aware = tracking_of(recorded(PAPERS_RUN, machine, machine))
    assert blind.rms > 3.0 * aware.rms
