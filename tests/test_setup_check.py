"""Mistakes of the setup and faults of the log: found, mended, and never found where there are none.

Two recordings, one clean and one with a hidden effect, serve all tests; what is wrong is made by
`mistakes`, which knows nothing of what looks for it.
"""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from unittest import mock

import mistakes
import numpy as np
import pytest
from axes import axis
from hidden.hiders import HIDERS
from hidden.machines import known_machine
from hidden.motions import draw_motion
from hidden.recording import record
from singular_log import singular_log

from par4_dynamics.model_from_file import read_model
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis import split
from par4_identification.logs.log import Log, Reference
from par4_identification.reports.outcome.setup import with_setup
from par4_identification.setup_check import calibration, timing
from par4_identification.setup_check.check import check_setup
from par4_identification.setup_check.clustered import basis_of, clustered_std, clusters_of
from par4_identification.setup_check.drive_answer import DriveAnswer, answer_of
from par4_identification.setup_check.equations import equations_of, stretches_of
from par4_identification.setup_check.finding import Amount, Finding, SetupCheck
from par4_identification.setup_check.held_readings import Held, held_stretches
from par4_identification.setup_check.mending import filled
from par4_identification.setup_check.mute_torques import mute_torques
from par4_identification.setup_check.scale import UNSEEN
from par4_identification.setup_check.spikes import spikes
from par4_identification.setup_check.total import total_lines, totals
from par4_identification.setup_check.unusable import diagnosed_if_sound
from par4_identification.signals.filtering import low_pass
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.approach import with_approach
from par4_kinematics.errors import UnreachableError
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.position import closes
from par4_kinematics.robot import Axis, Drives
from par4_sim.closed_loop.simulation import build_simulation
from par4_sim.machines.noise import Noise
from par4_sim.report.outcome import Outcome
from robots import REFERENCE

TABLE = read_model('table1', REFERENCE)
SEED = 8_400_001


def recorded(machine, seed: int):
    """Return the log of 10 s of a machine."""
    known = known_machine('reference')
    return record(known, machine, draw_motion('excitation', REFERENCE, 9.0, seed),
                  fidelity='exact', noise=Noise(torque_noise=0.05), seed=seed, feedforward=None,
                  wander=None, name='drive test').log


@pytest.fixture(scope='module')
def clean():
    """Return the log of a machine that is as the robot file says."""
    return recorded(known_machine('reference').machine, SEED)


@pytest.fixture(scope='module')
def sticky():
    """Return the log of a machine with Stribeck friction on all joints."""
    known = known_machine('reference')
    values = HIDERS['stribeck'].draw(np.random.default_rng(3), known, np.arange(4))
    return recorded(HIDERS['stribeck'].build(known.machine, values), SEED + 1)


def found(log, robot=REFERENCE, model=None):
    """Return the kinds and joints that are found in a log, and the check."""
    check = check_setup([log], robot, model)
    return [(finding.finding, finding.joints) for finding in check.findings], check


def error_of(log, robot=REFERENCE) -> float:
    """Return |residual| / |torque| of the rigid bodies in motion."""
    return equations_of(stretches_of([log]), robot.geometry).fit().error


@pytest.mark.parametrize('name', ['clean', 'sticky'])
def test_nothing_is_found_in_a_good_log_and_nothing_changed(name, request):
    log = request.getfixturevalue(name)
    kinds, check = found(log)
    assert kinds == []
    assert check.logs[0] is log
    assert check.machine is REFERENCE


LATE, OFFSET = 0.0637, np.radians((0.0, 0.0, -5.0, 0.0))
SETUP = {
    'plugs of two torques': (
        lambda log: mistakes.exchanged(log, 1, 2, 'tau'), 'joints_exchanged', (1, 2)),
    'plugs of two encoders': (
        lambda log: mistakes.exchanged(log, 0, 3, 'q'), 'joints_exchanged', (0, 3)),
    'sign of a torque': (
        lambda log: mistakes.reversed_sign(log, [3], 'tau'), 'sign_reversed', (3,)),
    'sign of an encoder': (
        lambda log: mistakes.reversed_sign(log, [0], 'q'), 'sign_reversed', (0,)),
    'all angles counted upwards': (
        lambda log: mistakes.reversed_sign(log, range(4), 'q'), 'sign_reversed', (0, 1, 2, 3)),
    'all signs': (
        lambda log: mistakes.reversed_sign(log, range(4), 'q', 'tau'), 'sign_reversed',
        (0, 1, 2, 3)),
    'degrees': (mistakes.in_degrees, 'wrong_unit', (0, 1, 2, 3)),
    'milliseconds': (mistakes.in_milliseconds, 'wrong_unit', (0, 1, 2, 3)),
    'late torque': (lambda log: mistakes.recorded_late(log, LATE), 'delay', (0, 1, 2, 3)),
    'early torque': (lambda log: mistakes.recorded_late(log, -LATE), 'delay', (0, 1, 2, 3)),
    'fast clock': (lambda log: mistakes.fast_clock(log, 0.0012), 'clock_drift', (0, 1, 2, 3)),
    'zero of an encoder': (lambda log: mistakes.zero_off(log, OFFSET), 'zero_error', (2,)),
    'slip': (lambda log: mistakes.slipped(log, 1, 4.0, 0.02), 'encoder_slip', (1,)),
}


@pytest.mark.parametrize('name', ['clean', 'sticky'])
@pytest.mark.parametrize('case', SETUP)
def test_a_mistake_is_told_and_mended(case, name, request):
    """The mended log fits the rigid bodies as the log without the mistake did."""
    make, kind, joints = SETUP[case]
    log = request.getfixturevalue(name)
    kinds, check = found(make(log))
    assert kinds == [(kind, joints)]
    assert check.findings[0].certain
    assert check.findings[0].mend
    assert error_of(check.logs[0]) < 1.3 * error_of(log)


@pytest.mark.parametrize('start', [6.5, 7.0, 7.5])
def test_what_is_late_in_one_part_is_no_clock_that_drifts(clean, start):
    assert 'clock_drift' not in dict(found(mistakes.late_from(clean, start, 0.02))[0])


@pytest.mark.parametrize('shape', ['slow', 'circles'])
def test_friction_that_falls_while_a_machine_warms_up_is_no_clock_that_drifts(shape):
    """Both change what goes with the speed as time goes on; a clock is told beside it all the same.
    """
    known = known_machine('reference')
    warming = HIDERS['friction_drift'].build(
        known.machine, {'drop': 0.5, 'viscous_drop': 0.5, 'time_constant': 7.0})
    log = record(known, warming, draw_motion(shape, REFERENCE, 20.0, SEED + 4), fidelity='exact',
                 noise=Noise(torque_noise=0.05), seed=4, feedforward=None, wander=None,
                 name='drive test').log
    assert found(log)[0] == []
    # in pieces, too: the machine does not grow cold at a gap
    ends = np.linspace(0, len(log.t), 6).astype(int)
    pieces = replace(log, segments=tuple(
        slice(first, last - 20) for first, last in pairwise(ends)))
    assert found(pieces)[0] == []
    if shape == 'circles':
        assert found(mistakes.fast_clock(log, 0.0012))[0] == [('clock_drift', (0, 1, 2, 3))]


def test_many_slips_of_an_encoder_are_one_finding(clean):
    times = np.arange(2.0, 8.0)
    slipped = clean
    for at in times:
        slipped = mistakes.slipped(slipped, 1, at, 0.02)
    kinds, check = found(slipped)
    assert kinds == [('encoder_slip', (1,))]
    assert f'jumps {len(times)} times' in check.findings[0].evidence
    assert '1.15 to 1.15' in check.findings[0].evidence
    assert error_of(check.logs[0]) < 1.3 * error_of(clean)


def test_exchanged_legs_are_put_right_up_to_the_mirror_image_of_the_machine(clean):
    kinds, check = found(mistakes.exchanged(clean, 0, 1, 'q', 'tau'))
    assert kinds in ([('joints_exchanged', (0, 1))], [('joints_exchanged', (2, 3))])
    assert error_of(check.logs[0]) == pytest.approx(error_of(clean), rel=0.1)


@pytest.mark.parametrize('delay', [-0.18, -0.02, 0.015, 0.19])
def test_the_delay_is_right_to_a_fifth_of_a_millisecond(clean, delay):
    late = mistakes.recorded_late(clean, delay)
    _, check = found(late)
    # what is moved back by the right delay is what was recorded
    mended = check.logs[0]
    rows = np.searchsorted(clean.t, mended.t[1000:-1000] - 0.5e-3)
    slope = np.gradient(clean.tau, clean.period, axis=0)[rows]
    wrong = mended.tau[1000:-1000] - clean.tau[rows]
    assert abs(np.sum(slope * wrong) / np.sum(slope ** 2)) < 2e-4


def test_a_delay_that_nothing_tells_is_none(clean, monkeypatch):
    """A torque that stays the same tells no time; its deviation ended in a traceback."""
    refined = timing._refined

    def vague(*args, **more):
        return replace(refined(*args, **more), delay_std=np.inf)

    late = mistakes.recorded_late(clean, 0.02)
    assert [kind for kind, _ in found(late)[0]] == ['delay']
    monkeypatch.setattr(timing, '_refined', vague)
    assert found(late)[0] == []


@pytest.mark.parametrize('factor', [0.25, 0.5, 2.0, 10.0])
@pytest.mark.parametrize('name', ['clean', 'sticky'])
def test_samples_stamped_at_another_rate_are_put_right(factor, name, request):
    log = request.getfixturevalue(name)
    kinds, check = found(mistakes.at_another_rate(log, factor))
    assert kinds == [('wrong_unit', (0, 1, 2, 3))]
    assert check.logs[0].period == pytest.approx(log.period, rel=1e-12)
    np.testing.assert_allclose(check.logs[0].t, log.t, rtol=1e-12)


def test_a_rate_that_is_off_by_no_whole_number_makes_the_data_useless(clean):
    kinds, check = found(mistakes.at_another_rate(clean, 1.5))
    assert kinds == [('wrong_unit', (0, 1, 2, 3))]
    assert check.useless
    rate = float(re.search(r'came at (\d+) a second', check.findings[0].evidence)[1])
    assert rate == pytest.approx(1.0 / clean.period, rel=0.06)


@pytest.mark.parametrize('offsets', [(0.0, -7.0, 0.0, 4.0), (6.0, -4.0, -8.0, 3.0),
                                     (-9.0, 9.0, 5.0, -3.0)])
@pytest.mark.parametrize('name', ['clean', 'sticky'])
def test_zeros_of_several_joints_with_both_signs_are_measured(offsets, name, request):
    """The last ones open the mechanism, or turn it into poses that no machine takes."""
    log = request.getfixturevalue(name)
    kinds, check = found(mistakes.zero_off(log, np.radians(offsets)))
    assert kinds == [('zero_error', tuple(int(joint) for joint in np.flatnonzero(offsets)))]
    assert np.abs(np.mean(check.logs[0].q - log.q, axis=0)).max() < np.radians(0.8)


@pytest.mark.parametrize('joint', [0, 2])
def test_an_eccentric_encoder_is_no_wrong_zero(joint):
    """Over less than a turn it nearly is one; the diagnosis names it."""
    wrong = HIDERS['encoder_eccentricity'].build(
        known_machine('reference').machine,
        {'amplitude': np.where(np.arange(4) == joint, 0.03, 0.0), 'phase': np.full(4, 0.8)})
    log = recorded(wrong, SEED)
    with mock.patch.object(calibration, '_is_eccentric', return_value=False):
        assert found(log)[0] == [('zero_error', (joint,))]
    kinds, check = found(log)
    assert kinds == []
    assert check.logs[0] is log


def test_a_reference_counts_from_the_zeros_of_the_encoders(clean):
    """Drives follow what encoders read: how far they are behind is the same with zeros mended."""
    offsets = np.array((0.0, 0.05, 0.0, -0.04))
    behind = 1e-3 * np.sin(clean.t)[:, None]
    still = np.zeros_like(clean.q)
    found = calibration.Calibration(np.append(offsets, np.zeros(calibration.ERRORS - 4)),
                                    np.zeros(calibration.ERRORS), 0.2, 0.01)
    log = replace(clean, q=clean.q + offsets, reference=Reference(
        clean.t, clean.q + offsets + behind, still, still))
    mended = found.mended(log)
    np.testing.assert_allclose(mended.q, clean.q, atol=1e-12)
    np.testing.assert_allclose(mended.reference.q - mended.q, np.broadcast_to(
        behind, clean.q.shape), atol=1e-12)
    assert found.mended(replace(log, reference=None)).reference is None


def test_a_value_is_told_in_all():
    """The diagnosis sees what the mend has left; the machine has both."""
    mended = Finding('zero_error', (1, 2), None, '', '', True, amount=Amount(
        'encoder_offset', (1, 2), {'offset': Parameter(value=(0.1, -0.05), std=(2e-3, 2e-3),
                                                       unit='rad')}))
    late = [Finding('delay', (), None, '', '', True, amount=Amount('time_offset', (), {
        'delay': Parameter(value=value, std=3e-4, unit='s')})) for value in (0.041, 0.043)]
    left = Parameter(value=(-0.004, 0.01), std=(1e-4, 2e-4), unit='rad')
    rest = SimpleNamespace(effect=SimpleNamespace(name='encoder_offset'), joints=(2, 3),
                           parameters={'offset': left})
    check = SetupCheck((mended, *late), (), REFERENCE)
    zeros, delay = totals(check, [rest])
    assert zeros.joints == (1, 2, 3)
    assert zeros.parameters['offset'].value == pytest.approx((0.1, -0.054, 0.01))
    assert zeros.parameters['offset'].std == pytest.approx((2e-3, 1e-4, 2e-4))
    assert delay.parameters['delay'].value == pytest.approx(0.042)
    line, = total_lines(check, [rest])
    assert 'offset -0.05400 rad (joint 2)' in line


def test_zeros_of_all_joints_are_no_wrong_dimension(clean):
    offsets = np.radians((5.0, 4.0, 6.0, 5.0))
    kinds, check = found(mistakes.zero_off(clean, offsets))
    assert kinds == [('zero_error', (0, 1, 2, 3))]
    assert np.abs(np.mean(check.logs[0].q - clean.q, axis=0)).max() < np.radians(0.6)


@pytest.mark.parametrize(('name', 'error'), [('arm_length', 0.03), ('base_radius', -0.025)])
def test_a_wrong_dimension_is_measured(clean, name, error):
    kinds, check = found(clean, mistakes.other_dimensions(REFERENCE, **{name: error}))
    assert kinds == [('wrong_dimensions', (0, 1, 2, 3))]
    true = getattr(REFERENCE.geometry, name)
    assert getattr(check.machine.geometry, name) == pytest.approx(true, abs=0.004)
    assert f'{name}: ' in check.findings[0].mend


@pytest.mark.parametrize(('name', 'leg', 'error'), [
    ('forearm_length', 1, 0.02), ('arm_length', 3, -0.012)])
def test_the_length_of_one_leg_is_no_wrong_zero(clean, name, leg, error):
    """It turns the joint's reading for a pose, as a zero does."""
    key = f'{name}_errors'
    robot = mistakes.other_dimensions(REFERENCE, **{key: error * np.eye(4)[leg]})
    kinds, check = found(clean, robot)
    assert kinds == [('wrong_dimensions', (leg,))]
    for lengths in ('arm_length_errors', 'forearm_length_errors'):
        np.testing.assert_allclose(getattr(check.machine.geometry, lengths), 0.0, atol=0.004)
    finding, = check.findings
    assert f'of leg {leg}, these data say' in finding.evidence
    assert f'{key}: [' in finding.mend
    assert finding.amount.effect == 'leg_length_error'


def test_deviations_hold_what_lasts():
    """An error that lasts half a second, as what a model lacks does, is one error, not fifty."""
    t = 0.01 * np.arange(3000)
    slopes, valid = np.sin(3.0 * t)[:, None] * np.ones((1, 2)), np.ones((3000, 2), dtype=bool)
    design = np.concatenate(slopes.T)[:, None]
    cluster = clusters_of(t, np.zeros(3000), valid)
    ratios = []
    for seed in range(60):
        lasting = np.repeat(np.random.default_rng(seed).normal(size=60), 50)
        residual = np.concatenate((lasting, lasting))  # both joints miss the same
        error = float(design[:, 0] @ residual / (design[:, 0] @ design[:, 0]))
        left = residual - error * design[:, 0]
        ratios.append((error / clustered_std(design, left, cluster, design[:, :0])[0]) ** 2)
    assert 0.7 < np.sqrt(np.mean(ratios)) < 1.3


def test_deviations_of_few_clusters_are_not_too_small():
    """Beside ten columns, eight half seconds of coloured error hide most of what they lack."""
    random = np.random.default_rng(5)
    cluster = np.repeat(np.arange(8), 50)
    ratios = []
    for _ in range(200):
        waves = np.cumsum(random.standard_normal((400, 11)), axis=0)  # as slow as the clusters
        basis, slopes = basis_of(waves[:, :10]), waves[:, 10:]
        own = slopes - basis @ (basis.T @ slopes)
        error = np.repeat(random.standard_normal(8), 50)
        error -= basis @ (basis.T @ error)
        value = float(own[:, 0] @ error / (own[:, 0] @ own[:, 0]))
        left = error - own[:, 0] * value
        ratios.append(abs(value) / clustered_std(slopes, left, cluster, basis)[0])
    assert np.median(ratios) < 1.0
    assert np.mean(np.array(ratios) > 4.0) < 0.01


@pytest.mark.parametrize('wrong', [1.0, 30.0])
def test_a_heavy_cluster_is_held_against_the_others(wrong):
    """A pose near a singular one outweighs a log; the others tell the value by themselves, too."""
    random = np.random.default_rng(6)
    cluster = np.repeat(np.arange(40), 50)
    size = np.where(cluster == 7, 30.0, 1.0)
    ratios, deviations = [], []
    for _ in range(200):
        slopes = (size * random.standard_normal(2000))[:, None]
        error = np.repeat(random.standard_normal(40), 50) + random.standard_normal(2000)
        error[cluster == 7] *= wrong
        value = float(slopes[:, 0] @ error / (slopes[:, 0] @ slopes[:, 0]))
        std = clustered_std(slopes, error - slopes[:, 0] * value, cluster, slopes[:, :0])[0]
        ratios.append(abs(value) / std)
        deviations.append(std)
    assert np.mean(np.array(ratios) > 4.0) < 0.01
    alone = np.sqrt(2.0 / (39 * 50))  # what the others tell
    assert 0.5 * alone < np.median(deviations) < 2.0 * max(alone, wrong * np.sqrt(2.0 / 50) / 30.0)


@pytest.mark.parametrize('seed', [29, 30])
def test_a_short_log_has_no_wrong_zeros_but_those_that_are(seed):
    """What a fit of three seconds of motion leaves says little of what it got wrong."""
    simulation = build_simulation(REFERENCE, TABLE, 'exact', seed=seed, torque_noise=0.1)
    motion = with_approach(excitation_motion(REFERENCE, 6.0, seed=seed), REFERENCE, simulation.q)
    simulation.queue_reference(0.5 + motion.t, motion.q, motion.qd, motion.qdd)
    told = simulation.next_samples(3502)
    short = Log('short', REFERENCE.joint_names, 0, 1e-3, 1e-9 * told.time_ns, told.q, told.effort,
                (slice(0, 3502),), None, None)
    assert found(short)[0] == []
    assert found(mistakes.zero_off(short, np.radians((0.0, 0.0, 0.0, 5.0))))[0] == [
        ('zero_error', (3,))]


def test_what_hangs_on_one_cluster_has_no_deviation():
    cluster = np.repeat(np.arange(6), 20)
    slopes = np.where(cluster == 2, 1.0, 0.0)[:, None]
    left = np.random.default_rng(1).standard_normal(120)
    left -= slopes[:, 0] * (slopes[:, 0] @ left) / (slopes[:, 0] @ slopes[:, 0])
    assert clustered_std(slopes, left, cluster, slopes[:, :0]).tolist() == [np.inf]


def test_a_small_error_is_not_told_as_a_larger_one_of_another_dimension(clean):
    """It is the diagnosis's to name; a forearm that is some 12 mm too short imitates it."""
    kinds, _ = found(clean, mistakes.other_dimensions(REFERENCE, base_radius=-0.007))
    assert 'wrong_dimensions' not in {kind for kind, _ in kinds}


@pytest.mark.parametrize('gains', [(1.41, 1.0, 0.88, 1.0), (1.0, 0.6, 1.0, 1.3)])
def test_gains_far_off_are_no_zeros_and_no_dimensions(clean, gains):
    """The diagnosis names them; the look at the setup does not know them."""
    kinds, _ = found(replace(clean, tau=clean.tau / np.array(gains)))
    assert not {'zero_error', 'wrong_dimensions'} & {kind for kind, _ in kinds}


@pytest.mark.parametrize('factor', [0.6, 1.9])
def test_a_common_factor_needs_a_model_to_be_seen(sticky, factor):
    wrong = mistakes.scaled(sticky, factor)
    kinds, check = found(wrong, model=TABLE)
    assert kinds == [('common_gain', (0, 1, 2, 3))]
    np.testing.assert_allclose(check.logs[0].tau, sticky.tau, rtol=0.03)
    kinds, check = found(wrong)
    assert kinds == []
    assert 'cannot be seen' in check.remarks[0].text


def test_what_is_not_looked_for_is_said_with_the_reason(clean, monkeypatch):
    assert found(clean)[1].remarks == (UNSEEN,)
    monkeypatch.setattr('par4_identification.setup_check.check.timing_of', mock.Mock(
        side_effect=np.linalg.LinAlgError))
    monkeypatch.setattr('par4_identification.setup_check.check.pace_of', mock.Mock(
        side_effect=UnreachableError))
    kinds, check = found(clean)
    assert kinds == []
    first, second, third = check.remarks
    assert first.text == ('Not looked for: a wrong pace of the samples, because the mechanism does '
                          'not close with the recorded positions.')
    assert second.text == ('Not looked for: delays, because the equations of these data are '
                           'singular.')
    assert third == UNSEEN
    assert not first.good
    outcome = with_setup(Outcome('All is well.', 'good', ()), check, 'diagnosis')
    assert outcome.remarks == check.remarks
    assert 'Check by hand what was not looked for' in outcome.advice[0]


def test_delays_of_a_log_with_too_little_motion_are_not_looked_for(clean):
    part = slice(3000, 3100)
    short = replace(clean, name='short', t=clean.t[part], q=clean.q[part], tau=clean.tau[part],
                    segments=(slice(0, 100),), doubtful=None)
    check = check_setup([clean, short], REFERENCE)
    assert not check.findings
    assert [remark.text for remark in check.remarks if remark != UNSEEN] == [
        'Not looked for: delays in short, because a joint hardly moves or the mechanism does not '
        'close with the recorded positions.']


def test_many_logs_with_too_little_motion_are_said_in_one_line(clean):
    part = slice(3000, 3100)
    short = [replace(clean, name=f'short{number}', t=clean.t[part], q=clean.q[part],
                     tau=clean.tau[part], segments=(slice(0, 100),), doubtful=None)
             for number in range(6)]
    check = check_setup([clean, *short], REFERENCE)
    remark, = (remark.text for remark in check.remarks if remark != UNSEEN)
    assert remark.startswith('Not looked for: delays in short0, short1, short2 and 3 others, beca')


@pytest.mark.parametrize(('factor', 'unit'), [(1e-3, 'kN m'), (1e3, 'mN m')])
def test_torques_in_another_unit_are_put_right_exactly(sticky, factor, unit):
    wrong = replace(sticky, tau=factor * sticky.tau)
    kinds, check = found(wrong, model=TABLE)
    assert kinds == [('wrong_unit', (0, 1, 2, 3))]
    assert f'the log carries {unit}' in check.findings[0].evidence
    np.testing.assert_allclose(check.logs[0].tau, sticky.tau, rtol=1e-12)


@pytest.mark.parametrize('make', [mistakes.torque_as_voltage, mistakes.voltage_as_torque])
def test_volts_and_torques_are_told_apart(clean, make):
    wrong = make(clean, REFERENCE)
    kinds, check = found(wrong, model=TABLE)
    assert kinds == [('wrong_unit', (0, 1, 2, 3))]
    assert check.findings[0].certain
    np.testing.assert_allclose(check.logs[0].tau, clean.tau)
    kinds, check = found(wrong)  # by torque limit or mass alone: seen, but not to be mended
    assert kinds == [('wrong_unit', (0, 1, 2, 3))]
    assert check.useless


def test_torques_are_not_held_against_a_limit_that_the_robot_file_does_not_give(clean):
    """Strong drives of another robot are no mistake; the reference robot's limit says nothing."""
    fields = REFERENCE.drives.model_dump(exclude={'torque_limit'})
    strong = REFERENCE.model_copy(update={'drives': Drives(**fields)})
    factor = 400.0 / np.abs(clean.tau).max()
    kinds, check = found(replace(clean, tau=factor * clean.tau), strong)
    assert kinds == []
    said, = [remark.text for remark in check.remarks if 'Torques reach' in remark.text]
    assert 'gives no drives.torque_limit' in said
    assert '200 N m' in said
    given = strong.model_copy(update={'drives': Drives(**fields, torque_limit=200.0)})
    assert found(replace(clean, tau=factor * clean.tau), given)[0] == [
        ('wrong_unit', (0, 1, 2, 3))]


def test_drives_answer_counts_by_their_gains(clean):
    """Between half of the product of the gains and all of it, on a motion that strains nothing."""
    drives = REFERENCE.drives
    right = answer_of([clean], drives)
    assert 0.45 < right.measured / (drives.velocity_gain * drives.position_gain) < 1.1
    assert not right.scaled_by(drives.gain[0])
    wrong = answer_of([mistakes.torque_as_voltage(clean, REFERENCE)], drives)
    assert wrong.measured == pytest.approx(drives.gain[0] * right.measured)
    assert wrong.scaled_by(drives.gain[0])
    # recorders show between two fifths and all of the answer
    assert [DriveAnswer(share, 1.0).scaled_by(1.0 / gain) for share, gain in (
        (0.29, 1.6), (0.29, 3.5), (0.01, 3.5))] == [False, True, False]
    assert answer_of([clean], Drives(gain=drives.gain)) is None  # gains that the file does not tell
    smooth = replace(clean, tau=np.tile(np.sin(clean.t)[:, None], 4))
    assert answer_of([smooth], drives) is None


def test_drives_that_take_the_speed_from_the_encoder_tell_no_scale_by_their_answer(
        clean, monkeypatch):
    """They answer the change of a reading, too: harder than the product of the gains says."""
    drives = REFERENCE.drives
    fast = clean.q - low_pass(clean.q, 0.1 / clean.period, clean.period)
    change = np.diff(fast, axis=0, prepend=fast[:1])
    answer = 5.0 * drives.velocity_gain * drives.position_gain * change
    log = replace(clean, tau=clean.tau - answer)
    assert answer_of([log], drives) is None
    assert found(log)[0] == []
    # by the product of the gains it would be the answer of torques in a wrong unit
    monkeypatch.setattr('par4_identification.setup_check.drive_answer.DIFFERENCED', np.inf)
    assert answer_of([log], drives).scaled_by(drives.gain[0])


def test_gentle_torques_beyond_any_drive_are_in_the_wrong_unit(clean):
    """Ten times the torque, below the limit of these drives: their answer tells."""
    strong = REFERENCE.model_copy(update={
        'drives': REFERENCE.drives.model_copy(update={'torque_limit': 5000.0})})
    kinds, check = found(mistakes.torque_as_voltage(clean, strong), strong)
    assert kinds == [('wrong_unit', (0, 1, 2, 3))]
    assert check.useless
    assert 'answer' in check.findings[0].evidence
    assert found(clean, strong)[0] == []


def test_a_joint_that_rests_is_not_frozen(clean):
    """It slows down, stands to the last count while the others move, and starts again slowly."""
    q = clean.q.copy()
    count = 2.0 * np.pi / REFERENCE.drives.encoder_counts
    t = np.clip((clean.t - 4.0) / 0.5, 0.0, 1.0), np.clip((clean.t - 6.0) / 0.5, 0.0, 1.0)
    fade = 1.0 - t[0] ** 2 * (3.0 - 2.0 * t[0]) + t[1] ** 2 * (3.0 - 2.0 * t[1])
    q[:, 2] = count * np.round((0.3 + fade * (q[:, 2] - 0.3)) / count)
    assert np.ptp(q[4600:5900, 2]) == 0.0
    assert np.ptp(q[4600:5900, 1]) > 0.4
    assert held_stretches(replace(clean, q=q)) == []


@pytest.mark.parametrize('is_held', [False, True])
def test_a_single_joint_that_rests_and_starts_at_once_is_not_frozen(is_held):
    """No other joint tells that the machine moved; a held reading makes up its way in a jump."""
    t = 4e-3 * np.arange(3000)
    q = np.where(t < 3.0, 0.0, 1.2 * (t - 3.0) + 0.1)
    if is_held:
        q[1500:1520] = q[1500]
    q = np.round(q / 1e-5)[:, None] * 1e-5
    tau = 2.0 + 0.1 * np.random.default_rng(1).normal(size=q.shape)
    log = Log('started', ('motor',), 1, 4e-3, t, q, tau, (slice(0, len(t)),), None, None)
    assert [(held.start, held.end) for held in held_stretches(log)] == (
        [(1500, 1520)] if is_held else [])


def test_what_a_controller_interpolates_between_counts_is_not_held_as_it_starts():
    """It tells a tenth of a count, which is no jump beside what the joint travels in a sample."""
    t = 4e-3 * np.arange(3000)
    q = np.where(t < 2.0, 1e-5 * t, 2e-5 + 0.6 * (1.0 - np.cos(1.5 * (t - 2.0))))
    q[300:320] = q[300]
    log = Log('interpolated', ('motor',), 1, 4e-3, t, q[:, None], np.sin(7.0 * t)[:, None],
              (slice(0, len(t)),), None, None)
    assert held_stretches(log) == []
    q[320:] += 1e-2
    assert [(held.start, held.end) for held in held_stretches(replace(log, q=q[:, None]))] == [
        (300, 320)]


def test_a_logger_of_an_axis_that_holds_is_told_once():
    """Where its force goes on for a sample while it holds, that is no frozen encoder."""
    t = 2e-3 * np.arange(6000)
    q, tau = 0.5 * np.sin(1.3 * t), np.cos(5.0 * t)
    for first in (700, 1500, 3100):
        q[first:first + 25] = q[first]
        tau[first:first + 25] = tau[first]
    tau[3124] = np.cos(5.0 * t[3124])
    log = Log('holding', ('motor',), 1, 2e-3, t, q[:, None], tau[:, None], (slice(0, len(t)),),
              None, None)
    finding, = check_setup([log], axis()).findings
    assert finding.finding == 'held_samples'
    assert finding.evidence.startswith('3 times ')


def test_a_short_stretch_that_creeps_does_not_tell_how_fine_an_encoder_is():
    """Samples that were filled in beside a gap are small parts of a count apart there."""
    t, count = 2e-3 * np.arange(6000), 2.0 * np.pi / 131072
    q = np.stack([0.4 * np.sin(1.3 * t + phase) for phase in range(4)], axis=1)
    q[:200] = q[200] + 40.0 * count * ((t[:200] - t[200]) / 0.4)[:, None]
    q = count * np.round(q / count)
    for joint, rows in enumerate(((31, 62, 83), (22, 51, 74), (43, 92, 113), (54, 75, 106))):
        q[rows, joint] += np.array((1e-6, -2e-6, 1e-6)) * count
    tau = np.cos(7.0 * t)[:, None] + np.random.default_rng(3).normal(size=q.shape)
    log = Log('creeping', REFERENCE.joint_names, 1, 2e-3, t, q, tau,
              (slice(0, 200), slice(200, len(t))), None, None)
    assert held_stretches(log) == []
    q[100:120] = q[100]
    q[120:200] += 30.0 * count
    held, = held_stretches(replace(log, q=q))
    assert (held.end, held.joints) == (120, (0, 1, 2, 3))


def test_a_reading_with_a_fixed_number_of_digits_is_not_frozen_where_it_turns_round():
    """Of 100 degrees five digits leave steps of 0.01 degrees, of small angles finer ones."""
    t = 2e-4 * np.arange(20000)
    degrees = 110.0 * np.sin(2.0 * np.pi * 0.6 * t) ** 5
    q = np.radians([float(f'{value:.5g}') for value in degrees])[:, None]
    log = Log('written', ('motor',), 1, 2e-4, t, q, np.sin(7.0 * t)[:, None],
              (slice(0, len(t)),), None, None)
    assert held_stretches(log) == []
    q = q.copy()
    q[6500:6700] = q[6500]
    held, = held_stretches(replace(log, q=q))
    assert (held.start, held.end) == (6500, 6700)


def test_a_payload_and_warm_friction_are_no_common_factor(sticky):
    for values in ({'platform_mass_1': 1.4}, {'coulomb_friction': 1.5, 'viscous_friction': 1.2}):
        model = replace(TABLE, values=TABLE.values | {
            name: np.full(4, value) for name, value in values.items()})
        assert found(sticky, model=model)[0] == []


def test_held_samples_are_left_out_of_the_rows(clean):
    starts = np.array((2.013, 3.101, 4.44, 6.2, 7.357))
    kinds, check = found(mistakes.held(clean, starts, 0.025))
    assert kinds == [('held_samples', (0, 1, 2, 3))]
    mended = check.logs[0]
    run, = runs_of_log(mended, REFERENCE)
    for start in starts:
        inside = (run.t > start) & (run.t < start + 0.025)
        assert inside.any()
        assert not run.valid[inside].any()
    assert run.valid.mean() > 0.5
    assert error_of(mended) < 1.3 * error_of(clean)


def test_what_is_filled_goes_on_from_both_sides(clean):
    """Across a hole of 20 ms a cubic is right to its fourth derivative."""
    log = mistakes.held(clean, np.array((5.0,)), 0.02)
    held, = held_stretches(log)
    assert held == Held(held.start, held.end, (0, 1, 2, 3), True)
    assert (held.end - held.start) * log.period == pytest.approx(0.02)
    rest = np.abs(filled(log, [held]).q - clean.q).max()
    assert rest < 0.03 * np.abs(log.q - clean.q).max()


@pytest.mark.parametrize(('acceleration', 'is_doubtful'), [
    (0.0, False), (0.1, False), (3.0, True)])
def test_what_a_single_joint_repeats_at_a_steady_speed_is_filled_in(acceleration, is_doubtful):
    """Of a slow log with a repeat every third of a second no row was left."""
    t = 5e-3 * np.arange(4000)
    q = (0.4 * t + acceleration * 0.16 * (1.0 - np.cos(2.5 * t)))[:, None]
    held = [Held(first, first + 6, (0,), True) for first in range(100, 3900, 70)]
    repeated = q.copy()
    for item in held:
        repeated[item.start:item.end] = repeated[item.start]
    log = Log('slow', ('motor',), 1, 5e-3, t, repeated, np.sin(t)[:, None], (slice(0, 4000),),
              None, None)
    mended = filled(log, held)
    np.testing.assert_allclose(mended.q, q, atol=5e-4)
    assert mended.doubtful.any() == is_doubtful


def test_a_frozen_encoder_is_cut_out(clean):
    kinds, check = found(mistakes.frozen(clean, 2, 4.0, 5.2))
    assert kinds == [('frozen_encoder', (2,))]
    start, end = check.findings[0].when
    assert start == pytest.approx(4.0, abs=0.01)
    assert end == pytest.approx(5.2, abs=0.01)
    mended = check.logs[0]
    assert len(mended.segments) == 2
    assert not ((mended.t > 4.002) & (mended.t < 5.198)).any()
    assert error_of(mended) < 1.3 * error_of(clean)


def test_an_encoder_that_never_moves_makes_the_data_useless(clean):
    kinds, check = found(mistakes.frozen(clean, 1, 0.0, np.inf))
    assert kinds == [('frozen_encoder', (1,))]
    assert check.useless


@pytest.mark.parametrize('level', [0.0, 1.7])
def test_a_torque_that_stands_still_while_its_joint_turns_round_is_left_out(clean, level):
    tau = clean.tau.copy()
    tau[5000:7000, 1] = level
    kinds, check = found(replace(clean, tau=tau))
    assert kinds == [('held_samples', (1,))]
    assert not check.useless
    start, end = check.findings[0].when
    assert (start, end) == (pytest.approx(clean.t[5000]), pytest.approx(clean.t[7000], abs=2e-3))
    assert error_of(check.logs[0]) < 1.3 * error_of(clean)
    tau[:, 1] = level
    kinds, check = found(replace(clean, tau=tau))
    assert kinds == [('held_samples', (1,))]
    assert check.useless


def test_a_torque_that_is_told_of_two_joints_is_left_out(clean):
    tau = clean.tau.copy()
    tau[:6000, 3] = tau[:6000, 0]
    kinds, check = found(replace(clean, tau=tau))
    assert kinds == [('held_samples', (3,))]
    assert 'that of joint 0' in check.findings[0].evidence
    assert check.logs[0].t[0] == pytest.approx(clean.t[6000])


@pytest.mark.parametrize(('slows', 'told'), [(0.0, [(1000, 5000)]), (0.6, [])])
def test_a_joint_that_something_else_drives_has_no_torque_of_its_own(slows, told):
    """Another motor turns the axis for some time; left alone it would slow down."""
    t = 0.002 * np.arange(10_000)
    turning = 0.5 * np.sin(2.0 * t) + 0.3 * np.sin(0.7 * t)
    past = np.clip(t - t[1000], 0.0, t[5000] - t[1000])
    q = turning + 3.0 * (past - 0.5 * slows * past ** 2 / (t[5000] - t[1000]))
    carried = (np.arange(len(t)) >= 1000) & (np.arange(len(t)) < 5000)
    tau = np.where(carried, 0.0, 2.0 * np.cos(3.0 * t))
    q[1000:5000] -= turning[1000:5000] - turning[1000]
    q[5000:] += q[4999] - q[5000]
    log = Log('driven', ('motor',), 0, 0.002, t, q[:, None], tau[:, None], (slice(0, len(t)),),
              None, None)
    assert [(item.start, item.end) for item in mute_torques(log)] == told


@pytest.mark.parametrize(('start', 'end'), [(0, 6000), (3000, 12_000), (2000, 9000)])
def test_an_axis_that_nothing_else_swings_does_not_turn_round_by_one_torque(start, end):
    """One with a weight may; the log is then left as it is."""
    t = 0.002 * np.arange(12_000)
    q, tau = np.sin(0.7 * t) + 0.2 * np.sin(2.0 * t), 2.0 * np.cos(3.0 * t)
    tau[start:end] = 0.5
    log = Log('mute', ('motor',), 0, 0.002, t, q[:, None], tau[:, None], (slice(0, len(t)),), None,
              None)
    assert [(item.start, item.end) for item in mute_torques(log, swings=False)] == [(start, end)]
    assert mute_torques(log) == []
    told, = [finding.when for finding in check_setup([log], axis()).findings]
    assert told == (pytest.approx(t[start]), pytest.approx(t[end - 1], abs=3e-3))


def test_drives_without_power_and_drives_at_their_limit_may_turn_joints_round(clean):
    top = np.abs(clean.tau).max(axis=0)
    for tau in (np.where(clean.t[:, None] < 4.0, 0.0, clean.tau),
                np.where(clean.t[:, None] < 4.0, top, clean.tau)):
        assert mute_torques(replace(clean, tau=tau)) == []


@pytest.mark.parametrize(('column', 'size'), [('q', 0.2), ('tau', 60.0)])
def test_spikes_are_interpolated(clean, column, size):
    times, sizes = np.array((2.0, 3.5, 6.1, 7.7)), size * np.array((1.0, -1.0, 0.7, -0.8))
    kinds, check = found(mistakes.spiked(clean, column, 3, times, sizes))
    assert kinds == [('spikes', (3,))]
    assert np.abs(getattr(check.logs[0], column) - getattr(clean, column)).max() < 0.05 * size


def test_a_quick_turn_at_a_low_rate_is_no_spike(clean):
    """Beside a long rest it stands out of its neighbours' median, but goes round smoothly."""
    t = 0.005 * np.arange(2000)
    turn = 0.1 * np.exp(-0.5 * ((t - 9.0) / 0.02) ** 2)
    log = replace(clean, period=0.005, t=t, q=turn[:, None] * np.ones((1, 4)),
                  tau=np.zeros((2000, 4)), segments=(slice(0, 2000),), reference=None)
    assert not spikes(log, 'q').any()
    wrong = log.q.copy()
    wrong[1800, 2] += 0.03
    assert np.argwhere(spikes(replace(log, q=wrong), 'q')).tolist() == [[1800, 2]]


def test_a_clipped_torque_does_not_count(clean):
    level = float(np.quantile(np.abs(clean.tau), 0.98))
    log = mistakes.clipped(clean, level)
    kinds, check = found(log)
    assert [kind for kind, _ in kinds] == ['clipped']
    assert check.logs[0].doubtful[np.abs(log.tau) == level].mean() > 0.9
    assert error_of(check.logs[0]) < error_of(log)


def test_an_amplifier_at_its_limit_is_no_mistake(clean):
    level = float(np.quantile(np.abs(clean.tau), 0.98))
    robot = REFERENCE.model_copy(update={
        'drives': REFERENCE.drives.model_copy(update={'torque_limit': level})})
    assert found(mistakes.clipped(clean, level), robot)[0] == []


def test_a_singular_pose_is_left_out():
    log = singular_log(known_machine('reference'), np.random.default_rng(0))
    kinds, check = found(log)
    assert kinds == [('singular_pose', (0, 1, 2, 3))]
    assert 'theta 1.5' in check.findings[0].evidence
    assert error_of(check.logs[0]) < 0.1


def test_a_machine_at_rest_is_said_to_rest(clean):
    kinds, check = found(mistakes.standing(clean))
    assert kinds == [('not_moving', (0, 1, 2, 3))]
    assert check.useless


def test_an_axis_has_signs_and_times_but_no_plugs_or_zeros(clean):
    axis = Axis.model_validate({'schema': 'par4/axis/1', 'name': 'one', 'joint': 'a',
                                'kind': 'revolute', 'gain': 1.0})
    # the inertia and friction of one joint of the robot, driven alone
    q, period = clean.q[:, :1], clean.period
    qd = np.gradient(q, period, axis=0)
    tau = 0.2 * np.gradient(qd, period, axis=0) + 1.5 * np.sign(qd) + 0.8 * qd
    noise = 0.05 * np.random.default_rng(1).standard_normal(q.shape)
    log = replace(clean, joint_names=('a',), q=q, tau=tau + noise)
    assert found(log, axis)[0] == []
    kinds, check = found(replace(log, tau=-log.tau), axis)
    assert kinds == [('sign_reversed', (0,))]
    # a negative inertia explains the torque as well
    assert 'which so far only negative masses or friction do' in check.findings[0].evidence
    assert 'instead of' not in check.findings[0].evidence
    assert 'downwards' not in check.findings[0].mend  # as the angles of a Par4 count
    assert found(mistakes.recorded_late(log, 0.05), axis)[0] == [('delay', (0,))]


def test_a_fault_of_one_log_leaves_the_other_alone(clean, sticky):
    check = check_setup([clean, mistakes.recorded_late(sticky, 0.05)], REFERENCE)
    assert [finding.finding for finding in check.findings] == ['delay']
    assert check.logs[0] is clean


def test_findings_are_what_the_interface_says(clean):
    _, check = found(mistakes.frozen(clean, 2, 4.0, 4.5))
    content = check.findings[0].to_json()
    assert list(content) == ['finding', 'joints', 'when', 'evidence', 'mend']
    assert content['joints'] == [2]
    assert len(content['when']) == 2


def test_closing_is_judged_sample_by_sample():
    home = np.array((0.3, 0.3, 0.3, 0.3))
    apart = np.array((1.5, -1.5, 1.5, -1.5))
    q = np.array((home, apart, home, apart, apart, home))
    assert closes(REFERENCE.geometry, q).tolist() == [True, False, True, False, False, True]


def _pushed(answers: bool) -> Log:
    """Return the log of a motor with eight pulses of 3 ms, which turn it or do not."""
    t = 0.001 * np.arange(12_000)
    smooth = 0.9 * np.sin(5.0 * t) + 0.5 * np.sin(11.0 * t + 0.4)
    pulses = np.zeros_like(t)
    for number, row in enumerate(range(1500, 11_500, 1300)):
        pulses[row:row + 3] = (2.5, -3.0)[number % 2]
    parts = 20
    torque = np.repeat(smooth + answers * pulses, parts)
    speed, place, q = 0.0, 0.0, np.empty_like(t)
    for step, own in enumerate(torque):
        if step % parts == 0:
            q[step // parts] = place
        speed += 0.001 / parts / 0.02 * (own - 0.08 * speed - 0.1 * np.tanh(speed / 0.01))
        place += 0.001 / parts * speed
    return Log('pushed', ('motor',), 0, 0.001, t, q[:, None], (smooth + pulses)[:, None],
               (slice(0, len(t)),), None, None)


@pytest.mark.parametrize(('answers', 'told'), [(True, []), (False, [('spikes', (0,))])])
def test_pulses_of_torque_that_the_motion_answers_are_no_loose_plug(answers, told):
    motor = Axis(schema='par4/axis/1', name='motor', joint='motor', kind='revolute', gain=1.0)
    log = _pushed(answers)
    assert spikes(log, 'tau').any()
    kinds, check = found(log, motor)
    assert [item for item in kinds if item[0] == 'spikes'] == told
    assert np.array_equal(check.logs[0].tau, log.tau) == answers


def test_no_dimension_is_wrong_where_rigid_bodies_leave_less_than_their_lumping_does(monkeypatch):
    """Cycles that are repeated give the same small error anew, so that any dimension seems sure."""
    nothing = SimpleNamespace(odd=0.0)
    sure = SimpleNamespace(values=np.eye(calibration.ERRORS)[6] * 0.013, std=None)
    monkeypatch.setattr(calibration, 'placement_at', lambda *_: nothing)
    monkeypatch.setattr(calibration, '_explained', lambda _: (sure, 0.002))
    for before, told in ((0.0025, False), (0.02, True)):
        monkeypatch.setattr(calibration, '_error', lambda *known, size=before: (
            0.0020 if known[2].any() else size))
        assert (calibration.calibration_of([], REFERENCE.geometry) is not None) == told


@pytest.mark.parametrize(('apart', 'told'), [(0.004, False), (0.06, True)])
def test_no_zero_is_wrong_where_each_log_by_itself_has_no_such_error(apart, told, monkeypatch):
    """The machine changed between the logs: zeros take a sixth of the error away."""
    stretches = [SimpleNamespace(log=log, tau=np.ones((10, 4))) for log in (0, 0, 1)]
    sure = SimpleNamespace(values=np.eye(calibration.ERRORS)[1] * 0.05, std=None)
    monkeypatch.setattr(calibration, 'placement_at', lambda *_: SimpleNamespace(
        odd=0.0, fitted=lambda _values: SimpleNamespace(left=1.0),
        left_if_eccentric=lambda _joint: 1.0))
    monkeypatch.setattr(calibration, '_explained', lambda _: (sure, 0.060))
    monkeypatch.setattr(calibration, '_error', lambda parts, _geometry, values: (
        0.060 if values.any() else 0.072 if len(parts) == len(stretches) else apart))
    assert (calibration.calibration_of(stretches, REFERENCE.geometry) is not None) == told


def test_readings_that_leak_into_each_other_move_no_zero(clean):
    """A zero takes a tenth of what they leave; the diagnosis has to say what it is."""
    q = clean.q.copy()
    q[:, 3] += 0.05 * q[:, 2]
    assert found(replace(clean, q=q))[0] == []


@pytest.mark.parametrize(('step', 'held'), [
    *((step, held) for step in (0.5, 1.0, 2.0, 4.0) for held in (False, True)), (8.0, False)])
def test_a_torque_in_coarse_steps_is_not_held_and_a_logger_that_holds_is(step, held):
    """Its readings repeat by chance, four times in a row in any log of 20 s."""
    random, t = np.random.default_rng(7), 1e-3 * np.arange(20_000)
    q = -0.1 * np.sin(2.0 * np.pi * 0.9 * t)
    tau = 100.0 * np.sin(2.0 * np.pi * 0.9 * t) + random.normal(0.0, 2.0, len(t))
    tau = step * np.round(tau / step)
    if held:
        tau[5000:5060] = tau[5000]
    log = Log('coarse', ('motor',), 1, 1e-3, t, q[:, None], tau[:, None], (slice(0, len(t)),),
              None, None)
    assert [item.torque for item in held_stretches(log)] == [True] * held


@pytest.mark.parametrize('held', [False, True])
def test_a_torque_in_coarse_steps_stands_still_at_a_steady_speed(held):
    """In steps of a signed byte it stood for up to 2 s, and jumped where the joint slowed down."""
    random, period = np.random.default_rng(8), 0.02
    gain = 6.0 * np.sin(np.linspace(0.0, np.pi, 100))
    cycle = np.concatenate((gain, np.zeros(100), np.full(50, -gain.sum() / 50.0)))
    qdd = np.concatenate([sign * cycle for sign in (1.0, -1.0) * 12])
    qd = np.cumsum(qdd) * period
    q = np.cumsum(qd) * period
    tau = 2.0 * qdd + 3.0 * np.tanh(qd / 0.05) + random.normal(0.0, 0.05, len(q))
    tau = 0.25 * np.round(tau / 0.25)
    if held:
        tau[2560:2585] = tau[2560]
    log = Log('coarse', ('motor',), 1, period, period * np.arange(len(q)),
              1e-3 * np.round(1e3 * q)[:, None], tau[:, None], (slice(0, len(q)),), None, None)
    assert [item.end for item in held_stretches(log)] == [2585] * held


def test_of_a_long_log_that_is_useless_only_stretches_are_looked_at(clean, monkeypatch):
    """Its rows are drawn, and need memory like any others."""
    count, rows = 8, len(clean.t)
    long = replace(
        clean, t=np.concatenate([clean.t + 2.0 * copy * clean.t[-1] for copy in range(count)]),
        q=np.tile(clean.q, (count, 1)), tau=np.tile(clean.tau, (count, 1)), doubtful=None,
        segments=tuple(slice(copy * rows, (copy + 1) * rows) for copy in range(count)))
    useless = Finding('not_moving', (), None, 'it rests', 'Move it.', False, useless=True)
    check = SetupCheck((useless,), (long,), REFERENCE)
    whole = diagnosed_if_sound(check, mock.Mock())
    monkeypatch.setattr(split, 'MOST', long.tau.size // 8)
    some = diagnosed_if_sound(check, mock.Mock())
    assert whole.reasons == some.reasons == ('it rests; move it',)
    more, less = (sum(len(run.t) for run in found.fit_runs) for found in (whole, some))
    assert 0 < less < 0.5 * more
