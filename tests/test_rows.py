"""Rows, their noise, rows sent back through whitening and filter, and columns on all processors."""

from __future__ import annotations

import math
import os
from dataclasses import replace

import numpy as np
import pytest
from measured import excitation
from planned import evidence_of, log_of, state_of_motion
from searches import MODEL
from test_search import bump

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_identification.diagnosis.evidence.evidence import gather
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import observe, with_nominal
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.evidence.side_by_side import side_by_side, threads_of_process
from par4_identification.diagnosis.evidence.whitener import Whitener, whitener_of_residuals
from par4_identification.diagnosis.search.orders import Lines, _Orders, best_orders
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.verdict.floor import (
    encoder_noise,
    noise_floor,
    rounding_noise,
)
from par4_identification.logs.log import Log
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.filtering import low_pass
from par4_identification.signals.noise import ArNoise
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.scales import conditioning_for
from par4_identification.signals.timing import TICK, timing_error
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis
from robots import REFERENCE, model_with

MOTOR = Axis(schema='par4/axis/1', name='motor', joint='motor', kind='revolute', gain=1.0)
WANDERING = ArNoise(np.array((1.2, -0.3, 0.05)), 0.01)
RIPPLE = {'relative': (0.05, 0.03, 0.04, 0.02), 'periods': 36.0, 'phase': (0.5, 0.0, 2.0, 1.0)}
SLIDE = 0.02
"""kg."""
COGGING = {'amplitude': 0.3, 'periods': 31.0, 'phase': (0.0, 1.0, 2.0, 3.0)}


def test_a_stretch_of_a_single_row_is_none():
    """Of one row nobody knows what time it stands for."""
    motion = excitation('reference', 6.0, 905)
    log = log_of(REFERENCE, motion.t, motion.q, MODEL.torque(state_of_motion(REFERENCE, motion)), 5)
    slow = Conditioning(position_cutoff_hz=12.0, torque_cutoff_hz=3.0, row_rate_hz=7.5)
    counts = set()
    for samples in range(1000, 1800, 50):
        torn = replace(log, segments=(slice(0, samples), slice(2000, len(log.t))))
        for run in runs_of_log(torn, REFERENCE, slow):
            counts.add(len(run.t))
            np.testing.assert_allclose(np.diff(run.t), run.row_time)
    assert min(counts) == 2


@pytest.mark.parametrize('rate', [1000.0, 250.0])
def test_rows_beside_a_jump_of_torque_know_what_the_times_of_readings_make(rate):
    """Each jump is early or late by a hundredth of a sample: an impulse, which the filter spreads.

    A step counts at the samples on both sides of it, so that its error is told up to sqrt(2) too
    large.
    """
    random = np.random.default_rng(4)
    t = np.arange(round(12.0 * rate)) / rate
    noise = random.normal(0.0, 0.02, len(t))
    steps = np.arange(round(0.2 * rate), len(t), round(0.4 * rate))
    torque = 20.0 * (np.searchsorted(steps, np.arange(len(t)), side='right') % 2)

    def run_of(tau):
        log = Log('jumps', ('motor',), 0, 1.0 / rate, t, (4.0 * t + np.sin(t))[:, None],
                  tau[:, None], (slice(0, len(t)),), None, None)
        return runs_of_log(log, MOTOR)[0]

    def late():
        off = np.zeros_like(t)
        off[steps] = 20.0 * 0.01 * random.normal(size=len(steps))
        return run_of(torque + off).tau

    run = run_of(torque + noise)
    plain = run_of(torque).tau
    made = np.sqrt(np.mean([(late() - plain) ** 2 for _ in range(200)], axis=0))
    near = made > 0.3 * made.max()
    assert near.sum() > 20
    ratio = run.timing_error[near] / made[near]
    assert 1.0 < np.sqrt(np.mean(ratio ** 2)) < 1.5
    assert not run_of(np.sin(t) + noise).timing_error.max() > 0.002


def test_a_slow_log_does_not_tell_at_which_tick_a_torque_jumped():
    """As with times of reading, its error is told up to sqrt(2) too large."""
    random = np.random.default_rng(5)
    conditioning, told, made = Conditioning(), [], []
    for _ in range(40):
        ticks = np.arange(4000) + random.integers(2)
        steps = np.arange(300, 4000, 400) + random.integers(0, 50, 10)
        torque = 15.0 * (np.searchsorted(steps, ticks, side='right') % 2)[:, None]
        true = low_pass(torque, conditioning.torque_cutoff_hz, 1e-3)[::2]
        made.append(low_pass(torque[::2], conditioning.torque_cutoff_hz, 2e-3) - true)
        told.append(timing_error(torque[::2], conditioning, 2e-3, 1, TICK))
        for period in (TICK, 5e-3):  # all ticks are told; a torque that goes on changes as much
            np.testing.assert_array_equal(timing_error(torque, conditioning, period, 1, TICK),
                                          timing_error(torque, conditioning, period, 1))
    told, made = (np.sqrt(np.mean(np.square(part))) for part in (told, made))
    assert 1.0 < told / made < 1.5


@pytest.mark.parametrize(('machine', 'low', 'high'), [(REFERENCE, 22.0, 28.0), (MOTOR, 0.7, 1.4)])
def test_the_ticks_of_a_drive_are_known_of_a_par4_alone(machine, low, high):
    t = 2e-3 * np.arange(3000)
    joints = len(machine.joint_names) if machine is REFERENCE else 1
    q = np.repeat(0.3 + 0.3 * np.sin(1.7 * t)[:, None], joints, axis=1)
    torque = np.repeat(15.0 * (np.arange(len(t)) // 150 % 2)[:, None], joints, axis=1)
    run, = runs_of_log(log_of(machine, t, q, torque, 6), machine)
    told, by_stamps = (np.sqrt(np.mean(np.square(part))) for part in (
        run.timing_error, timing_error(torque, run.conditioning, 2e-3, 1)))
    assert low * by_stamps < told < high * by_stamps


def slow_log(*lengths):
    """Return a log of an axis at 10 Hz in stretches of so many samples, 5 s between them."""
    ends = np.cumsum([0, *lengths])
    t = 0.1 * np.arange(ends[-1])
    q = (np.sin(0.4 * t) + 0.3 * np.sin(0.92 * t))[:, None]
    speed = np.gradient(q, 0.1, axis=0)
    noise = np.random.default_rng(1).normal(0.0, 0.01, q.shape)
    gaps = 5.0 * np.repeat(np.arange(len(lengths)), lengths)
    return Log('bag', MOTOR.joint_names, 0, 0.1, t + gaps, q, np.sign(speed) + 0.5 * speed + noise,
               tuple(map(slice, ends[:-1].tolist(), ends[1:].tolist())), None, None)


def test_a_stretch_with_too_few_samples_does_not_refuse_a_slow_log():
    log = slow_log(1179, 21)
    conditioning = conditioning_for([log], MOTOR, Conditioning())
    run, = runs_of_log(log, MOTOR, conditioning)
    alone, = runs_of_log(slow_log(1179), MOTOR, conditioning)
    assert np.array_equal(run.t, alone.t)
    with pytest.raises(InputError, match=r'no uninterrupted stretch of at least \d+\.\d s'):
        runs_of_log(slow_log(21, 21), MOTOR, conditioning)


@pytest.mark.parametrize(('rate', 'words'), [
    (0.5, 'recorded at 0.5 Hz by its stamps; at least 4 Hz are needed'),
    (5e5, 'its stamps say 5e.05 Hz: are they in seconds')])
def test_stamps_that_count_another_unit_are_named_as_the_reason(rate, words):
    """Samples put between those of such an axis would take all memory."""
    t = np.arange(400) / rate
    log = Log('strange', ('motor',), 0, 1.0 / rate, t, np.sin(t)[:, None], np.cos(t)[:, None],
              (slice(0, 400),), None, None)
    with pytest.raises(InputError, match=words):
        runs_of_log(log, MOTOR)


def test_rows_that_are_louder_count_for_as_much_less():
    """What jumps add is part of the noise: whitened, it has the size of any other row."""
    motion = excitation('reference', 8.0, 905)
    tau = MODEL.torque(state_of_motion(REFERENCE, motion))
    run, = runs_of_log(log_of(REFERENCE, motion.t, motion.q, tau, 5), REFERENCE)
    random = np.random.default_rng(8)
    jumps = np.where(np.arange(len(run.t))[:, None] % 20 < 4, 0.3, 0.0) * np.ones(4)
    run = replace(run, timing_error=jumps)
    observations = observe([run], REFERENCE, 'paper', None)
    left = random.normal(size=(40, *jumps.shape)) * np.hypot(0.05, jumps)
    whitener = whitener_of_residuals(observations, [left[0]], 0)
    assert [noise.size for noise in whitener.noise] == pytest.approx([0.05] * 4, rel=0.15)
    white = np.array([whitener.whiten([part[..., None]]) for part in left])[..., 0]
    for joint in range(4):
        own = white[:, joint, run.valid[:, joint]]
        for mask in (jumps[:, joint] > 0.0, jumps[:, joint] == 0.0):
            assert np.std(own[:, mask[run.valid[:, joint]]]) == pytest.approx(1.0, rel=0.2)
    share = np.mean(jumps[run.valid] > 0.0)
    assert whitener.timing_squares() == pytest.approx(
        share * run.valid.sum() / (1.0 + (0.05 / 0.3) ** 2), rel=0.05)


@pytest.mark.parametrize('missing', [0.0, 0.05, 0.6])
def test_the_adjoint_of_whitening_has_the_products_of_whitened_series(missing):
    random = np.random.default_rng(3)
    series, white = random.normal(size=(400, 3)), random.normal(size=400)
    valid = np.repeat(random.random(40) >= missing, 10)
    whitening = WANDERING.whitening(valid)
    np.testing.assert_allclose(whitening.adjoint(white) @ series, white @ whitening.of(series),
                               rtol=1e-10)
    assert not whitening.adjoint(white)[~valid].any()


@pytest.mark.parametrize('cycles', [0.0, 0.02, 0.3, 0.5])
def test_whitening_multiplies_the_power_of_a_wave_as_said(cycles):
    rows = np.arange(4000)
    wave = np.stack((np.cos(2.0 * np.pi * cycles * rows), np.sin(2.0 * np.pi * cycles * rows)), 1)
    white = WANDERING.whiten(wave, np.ones(len(rows), bool))[100:]
    assert np.sum(white ** 2) / np.sum(wave[100:] ** 2) == pytest.approx(
        WANDERING.whitened_power(np.array(cycles)), rel=1e-3)


@pytest.fixture(scope='module')
def evidence():
    """Rows of a machine with periodic torques and a bump, in noise that wanders."""
    model = model_with(model_with(MODEL, 'cogging', **COGGING), 'torque_ripple', **RIPPLE)
    motion = excitation('reference', 12.0, 905)
    state = state_of_motion(REFERENCE, motion)
    log = log_of(REFERENCE, motion.t, motion.q, model.torque(state) + bump(state), 5)
    plain = evidence_of(log, REFERENCE, MODEL)
    observations = with_nominal(plain.observations, MODEL)
    noise = tuple(replace(WANDERING, variance=(0.02 + 0.01 * joint) ** 2) for joint in range(4))
    return gather(observations, Whitener(noise, observations.runs))


@pytest.mark.parametrize('name', ['coulomb_asymmetry', 'arm_mass_offset', 'drive_gain_error'])
def test_rows_sent_back_have_the_products_of_filtered_and_whitened_columns(evidence, name):
    effect = CATALOGUE[name]
    white = evidence.target_left
    sent_back = evidence.sent_back(white)
    found = sum(np.einsum('nj,njk->jk', own, effect.columns(run.state, {}))
                for own, run in zip(sent_back, evidence.observations.runs))
    (block,), ends = evidence.blocks(effect, {}), evidence.ends
    wanted = [columns.T @ white[first:last]
              for columns, first, last in zip(block.columns, ends, ends[1:])]
    # the ends, through which the filter reflects, are some thousandths of 12 s
    np.testing.assert_allclose(found, wanted, atol=5e-3 * np.abs(wanted).max())


def test_columns_that_are_filtered_together_are_those_filtered_alone(evidence):
    effect, runs = CATALOGUE['cogging'], evidence.observations.runs
    shapes = [{'periods': float(order)} for order in range(7, 26)]
    observations = replace(evidence.observations, _kept={})
    observations.keep(effect, shapes)
    for shape in shapes:
        for found, run in zip(observations.effect_rows(effect, shape), runs, strict=True):
            np.testing.assert_array_equal(found, run.rows(effect.columns(run.state, shape)))


@pytest.mark.parametrize(('name', 'tolerance'), [('cogging', 0.15), ('torque_ripple', 0.25)])
def test_the_spectrum_over_positions_tells_what_each_order_explains(evidence, name, tolerance):
    """The strongest of all is among the strongest lines."""
    effect, projection = CATALOGUE[name], project(evidence, ())
    orders = np.arange(16.0, 161.0)
    told = Lines(effect, projection, 160.0).gains(orders)
    evidence.keep(effect, [{'periods': order} for order in orders])
    true = np.array([projection.gain(effect, {'periods': order}) for order in orders])
    strongest = true > 0.5 * true.max()
    assert strongest.sum() >= 3
    np.testing.assert_allclose(told[strongest], true[strongest], rtol=tolerance)
    assert told[np.argmax(true)] > 0.8 * told.max()


@pytest.mark.parametrize('period', [0.0005, 0.001])
def test_the_noise_floor_of_white_torque_is_what_rows_have_of_it(period):
    """It is read above the band of the torque; before, it was told 6 % too small."""
    log = log_of(MOTOR, np.arange(0.0, 60.0, period), np.sin(np.arange(0.0, 60.0, period))[:, None],
                 np.zeros((round(60.0 / period), 1)), 4, noise=0.7)
    run, = runs_of_log(log, MOTOR)
    assert run.noise_floor[0] == pytest.approx(np.std(run.tau[:, 0]), rel=0.04)


def test_the_chatter_of_a_drive_is_no_noise_floor():
    """It is loud in one band above that of the torque, noise is as loud in all."""
    t = np.arange(0.0, 60.0, 0.001)
    random = np.random.default_rng(8)
    chatter = 3.0 * np.sin(2.0 * np.pi * np.cumsum(440.0 + 20.0 * random.normal(size=len(t)))
                            * 0.001)
    log = log_of(MOTOR, t, np.sin(t)[:, None], np.zeros((len(t), 1)), 4, noise=0.7)
    quiet, = runs_of_log(log, MOTOR)
    loud, = runs_of_log(replace(log, tau=log.tau + chatter[:, None]), MOTOR)
    assert loud.noise_floor[0] < 1.2 * quiet.noise_floor[0]


@pytest.mark.parametrize(('asked', 'threads'), [('1', 1), ('3', 3)])
def test_as_many_threads_compute_as_other_libraries_are_told(monkeypatch, asked, threads):
    monkeypatch.setenv('OMP_NUM_THREADS', asked)
    assert threads_of_process() == threads


@pytest.mark.parametrize('asked', ['', '0', 'many'])
def test_without_a_number_of_threads_the_processors_count(monkeypatch, asked):
    monkeypatch.setenv('OMP_NUM_THREADS', asked)
    assert 1 <= threads_of_process() <= (os.cpu_count() or 1)


def test_what_is_computed_side_by_side_keeps_its_order_and_its_errors():
    assert side_by_side(lambda item: item ** 2, range(50)) == [item ** 2 for item in range(50)]
    with pytest.raises(ZeroDivisionError):
        side_by_side(lambda item: 1 / item, (1, 0))


def test_where_all_orders_are_found_the_search_for_more_ends(evidence):
    shape, gain = best_orders(CATALOGUE['cogging'], [{'periods': 31.0}], project(evidence, ()),
                              Rules())
    assert shape == {'periods': 31.0}
    assert gain > 1000.0


@pytest.fixture
def looks(monkeypatch):
    """How often the strongest line is looked for."""
    counted = []
    look = _Orders.strongest
    monkeypatch.setattr(_Orders, 'strongest', lambda *asked: counted.append(asked) or look(*asked))
    return counted


def test_orders_that_are_known_are_the_answer_after_two_looks(evidence, looks):
    ripple, projection = CATALOGUE['torque_ripple'], project(evidence, ())
    tried = [{'periods': order} for order in np.arange(6.0, 60.0)]
    anew, gain = best_orders(ripple, tried, projection, Rules())
    assert len(anew['periods']) == len(looks) - 1 > 1
    looks.clear()
    again, same = best_orders(ripple, tried, projection, Rules(), anew)
    assert again == anew
    assert len(looks) == 2
    assert same == pytest.approx(gain, rel=1e-6)


def test_orders_that_cannot_gain_what_is_wanted_are_not_sought_to_the_last(evidence, looks):
    """Whatever is wanted less than what they gain changes nothing, which costs no look more."""
    ripple, projection = CATALOGUE['torque_ripple'], project(evidence, ())
    tried = [{'periods': order} for order in np.arange(6.0, 60.0)]
    anew, gain = best_orders(ripple, tried, projection, Rules())
    whole = len(looks)
    assert best_orders(ripple, tried, projection, Rules(), wanted=0.99 * gain) == (anew, gain)
    assert len(looks) == 2 * whole
    looks.clear()
    # the first order gains half of them all at the most
    assert best_orders(ripple, tried, projection, Rules(), wanted=8.5 * gain) is None
    assert 1 <= len(looks) < whole
    looks.clear()
    assert best_orders(ripple, tried, projection, Rules(), anew, wanted=1e3 * gain) is None
    assert len(looks) == 1


def test_what_each_order_gains_beside_the_others_follows_from_one_fit_of_all(evidence):
    ripple, orders = CATALOGUE['torque_ripple'], (9.0, 20.0, 31.0)

    def beside(some):
        return project(evidence, (Hypothesis(ripple, {'periods': some}, (0, 1, 2, 3)),))

    whole = beside(orders)
    for order, gain in zip(orders, whole.last_gains):
        others = beside(tuple(own for own in orders if own != order))
        assert gain == pytest.approx(others.gain(ripple, {'periods': order}), rel=1e-9)
        assert whole.squares + gain == pytest.approx(others.squares, rel=1e-9)


def test_shapes_gain_together_what_each_of_them_gains(evidence):
    ripple, projection = CATALOGUE['torque_ripple'], project(evidence, ())
    shapes = [{'periods': order} for order in (9.5, 20.0, 31.25)]
    np.testing.assert_allclose(projection.gains_apart(ripple, shapes), [
        projection.gain(ripple, shape) for shape in shapes], rtol=1e-9)


def test_what_a_projection_leaves_is_orthogonal_to_its_columns(evidence):
    ripple = Hypothesis(CATALOGUE['torque_ripple'], {'periods': (9.0, 31.0)}, (0, 2))
    projection = project(evidence, (
        ripple, Hypothesis(CATALOGUE['theta_inertia'], {}, (0, 1, 2, 3))))
    design, left = projection.design, projection.residual
    assert np.abs(design.T @ left).max() < 1e-8 * np.linalg.norm(design, axis=0).max() * (
        np.linalg.norm(evidence.target))
    np.testing.assert_allclose(left, evidence.target - design @ np.linalg.lstsq(
        design, evidence.target, rcond=None)[0], atol=1e-7 * np.abs(evidence.target).max())
    assert projection.squares == pytest.approx(left @ left, rel=1e-9)


@pytest.mark.parametrize('change', [
    lambda orders: orders[1:], lambda orders: orders[:-1], lambda orders: (*orders, 50.0),
    lambda _: (7.0, 8.0)])
def test_orders_that_are_known_wrongly_are_found_anew(evidence, change):
    ripple, projection = CATALOGUE['torque_ripple'], project(evidence, ())
    tried = [{'periods': order} for order in np.arange(6.0, 60.0)]
    anew, _ = best_orders(ripple, tried, projection, Rules())
    known = {'periods': change(anew['periods'])}
    assert known != anew
    assert best_orders(ripple, tried, projection, Rules(), known)[0] == anew


def test_a_soft_transmission_is_no_reason_for_a_large_error():
    """What counts make of a load that swings with them is no floor of the rows."""
    motion = excitation('reference', 6.0, 905)
    log = log_of(REFERENCE, motion.t, motion.q, MODEL.torque(state_of_motion(REFERENCE, motion)), 5)
    runs = runs_of_log(log, REFERENCE)
    soft = model_with(MODEL, 'elastic_transmission', stiffness=3e3)
    np.testing.assert_array_equal(noise_floor(runs, soft), noise_floor(runs, MODEL))
    assert np.all(encoder_noise(runs, soft) > 2.0 * encoder_noise(runs, MODEL))


@pytest.mark.parametrize(('step', 'noise'), [(0.8, 0.02), (0.8, 0.1), (0.3, 0.05), (0.3, 0.5)])
def test_the_noise_floor_of_a_torque_in_coarse_steps_is_what_rows_have_of_it(step, noise):
    """Rounding of a torque that changes slowly is no white noise; under much noise it is.

    Between the two the noise is told too small, and with it what the steps make too large.
    """
    motion = excitation('reference', 12.0, 906)
    true = MODEL.torque(state_of_motion(REFERENCE, motion))
    log = log_of(REFERENCE, motion.t, motion.q, true, 5, noise=noise)
    run, = runs_of_log(replace(log, tau=step * np.round(log.tau / step)), REFERENCE)
    plain, = runs_of_log(replace(log, tau=true), REFERENCE)
    np.testing.assert_allclose(run.torque_step, step, rtol=1e-6)
    left = np.sqrt(np.mean((run.tau - plain.tau)[run.valid.all(axis=1)] ** 2, axis=0))
    told = np.hypot(run.noise_floor, rounding_noise([run], MODEL))
    assert np.all(told > 0.85 * left)
    assert np.all(told < 1.4 * left)
    assert np.all(noise_floor([run], MODEL) >= told)


@pytest.mark.parametrize('noise', [0.0, 0.05])
def test_a_torque_without_steps_has_no_noise_of_rounding(noise):
    motion = excitation('reference', 6.0, 907)
    log = log_of(REFERENCE, motion.t, motion.q, MODEL.torque(state_of_motion(REFERENCE, motion)), 5,
                 noise=noise)
    runs = runs_of_log(log, REFERENCE)
    assert not runs[0].torque_step.any()
    assert not rounding_noise(runs, MODEL).any()


def slide_of(friction):
    """Return the run of a mass of 20 g on a rail that is pushed to and fro, and what it leaves.

    Its motion is integrated in steps of 5 us. What is left is the force less the true law, with the
    mean direction over a sample and with the sign at the samples, N.
    """
    parts, period = 200, 1e-3
    axis = Axis(schema='par4/axis/1', name='slide', joint='slide', kind='linear', gain=1.0)
    fine = period / parts
    t = fine * np.arange(round(6.0 / fine))
    push = 6.0 * np.sin(2.0 * np.pi * 5.3 * t) + 5.0 * np.sin(2.0 * np.pi * 9.7 * t + 1.0)
    q = np.empty(len(t))
    place, speed = 0.0, 0.0
    for step, force in enumerate(push.tolist()):
        q[step] = place
        moved = speed + fine * (force - math.copysign(friction, speed)) / SLIDE
        place += 0.5 * fine * (speed + moved)
        speed = moved
    samples = slice(None, None, parts)
    log = log_of(axis, t[samples], q[samples, None], push[samples, None], 7, noise=0.0)
    run, = runs_of_log(log, axis, Conditioning())
    return run, *(run.tau - run.rows(SLIDE * state.qdd + friction * state.direction)
                  for state in (run.state, replace(run.state, period=0.0)))


def rms(values):
    return float(np.sqrt(np.mean(values ** 2)))


def test_friction_that_turns_between_two_samples_is_known_in_the_rows():
    """The sign of the speed at the samples is wrong by up to half a sample of friction."""
    run, mean, sign = slide_of(0.5)
    assert (np.abs(run.state.direction) < 1.0).sum() > 30
    assert rms(mean[run.valid]) < 0.35 * rms(sign[run.valid])


def test_what_the_low_pass_makes_of_times_of_turning_is_known_but_for_an_error():
    """Strong friction bends the speed where it turns, and the filter rounds the bend."""
    friction = 2.0
    run, left, _ = slide_of(friction)
    np.testing.assert_array_equal(run.timing_error, 0.0)
    known = run.with_friction(np.array([friction]), np.array([SLIDE]))
    told = known.timing_error
    turning = run.valid & (told > 0.2 * told.max())
    assert turning.sum() > 50
    assert 0.3 < rms(told[turning]) / rms(left[turning]) < 1.5
    assert rms(left[run.valid & ~turning]) < 0.3 * rms(left[turning])
    bent = run.tau - run.rows(SLIDE * known.state.qdd + friction * known.state.direction)
    assert rms(bent[turning]) < 0.5 * rms(left[turning])
