"""Causes of single axes, each made by physics of its own: what is named, and what is not accused.

The plants are stepped in time in `axes.recorded` or here; no formula of an effect makes a log.
"""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import mistakes
import numpy as np
import pytest
from axes import Motor, axis, built_up, recorded

from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.diagnosis import CONDITIONING, LIBRARY, diagnose
from par4_identification.logs.jumps import joints_of_recordings
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.causes import source_of_order
from par4_identification.reports.outcome.diagnosis import diagnosis_json, outcome_of_diagnosis
from par4_identification.reports.outcome.diagnosis_remarks import remarks_of_cause
from par4_identification.setup_check.check import check_setup
from par4_identification.signals.scales import conditioning_for

SPINDLE = Motor(0.03, 0.2, 0.02)
ONCE_IN_A_TURN = ('torque_offset', 'stribeck', 'cogging', 'encoder_eccentricity', 'time_offset')
SPRINGS = ('torque_offset', 'position_torque', 'friction_drift')


def turns(t):
    """Return positions that go over some turns and back, now faster, now slower."""
    return 18.0 * np.sin(0.5 * t) + 4.0 * np.sin(1.7 * t)


def logged(q, tau, period=1e-3):
    """Return the log of a motion and its torque, (n,) each."""
    return Log('axis', ('motor',), 1, period, period * np.arange(len(q)), q[:, None], tau[:, None],
               (slice(0, len(q)),), None, None)


def diagnosed(log, machine, names=ONCE_IN_A_TURN):
    """Return the diagnosis of a log by some names with the scales that suit it."""
    library = {name: LIBRARY[name] for name in names}
    return diagnose([log], machine, library=library,
                    conditioning=conditioning_for([log], machine, CONDITIONING))


def named(diagnosis):
    """Return the names of a diagnosis."""
    return [cause.effect.name for cause in diagnosis.causes]


# ------------------------------------------------------------------------- once in a turn


def test_a_weight_off_the_axis_is_a_torque_once_in_a_turn():
    """Before, orders began at four: the machine was called clean at ten times its noise."""
    log = recorded(replace(SPINDLE, hanging=0.33), turns, 14.0, 400.0, noise=0.02)
    cause, = diagnosed(log, axis()).causes
    assert cause.effect.name == 'cogging'
    assert cause.parameters['periods'].value == 1.0
    assert cause.parameters['amplitude'].value == pytest.approx((0.33,), rel=0.02)
    assert source_of_order(1.0, axis(gear_ratio=30)) == 'as of a weight off the axis'


def test_the_weight_of_an_axis_that_hangs_is_no_cause():
    log = recorded(replace(SPINDLE, hanging=0.33), turns, 14.0, 400.0, noise=0.02)
    assert named(diagnosed(log, axis(gravity='vertical'))) == []


def test_an_encoder_beside_its_shaft_is_no_torque():
    """The motion is that of the shaft; what is read runs ahead and behind it once in a turn."""
    log = recorded(SPINDLE, turns, 14.0, 400.0, noise=0.01, counts=1 << 20)
    cause, = diagnosed(replace(log, q=log.q + 4e-3 * np.sin(log.q + 1.0)), axis()).causes
    assert cause.effect.name == 'encoder_eccentricity'
    assert cause.parameters['amplitude'].value == pytest.approx((4e-3,), rel=0.1)
    assert cause.parameters['phase'].value == pytest.approx((1.0,), abs=0.1)


@pytest.mark.parametrize('amplitude', [0.02, 0.05])
def test_the_encoder_of_any_axis_may_be_mounted_badly(amplitude):
    """The arms of a Par4 have none that is off by more than a degree; this was ripple then."""
    log = recorded(SPINDLE, turns, 14.0, 400.0, noise=0.002)
    read = log.q + amplitude * np.sin(log.q + 1.0)
    library = (*ONCE_IN_A_TURN, 'torque_ripple')
    cause, = diagnosed(replace(log, q=read), axis(), library).causes
    assert cause.effect.name == 'encoder_eccentricity'
    assert cause.parameters['amplitude'].value == pytest.approx((amplitude,), rel=0.02)
    assert cause.parameters['phase'].value == pytest.approx((1.0,), abs=0.05)


# ------------------------------------------------------------------------- offsets


@pytest.mark.parametrize(('seed', 'averaged'), [(3, 12), (4, 16)])
def test_an_offset_of_a_torque_that_is_averaged_follows_no_position(seed, averaged):
    """Such a torque has hardly noise: a law that is a little wrong lets other terms count."""
    random = np.random.default_rng(seed)
    waves = random.uniform([0.3, 0.4, 0.0], [0.9, 1.4, 6.0], (3, 3))

    def motion(t):
        return sum(size * np.sin(rate * t + phase) for size, rate, phase in waves)

    log = recorded(Motor(0.3, 1.2, 0.4), motion, 40.0, 1000.0, counts=1 << 20, noise=0.003)
    tau = np.convolve(log.tau[:, 0], np.ones(averaged) / averaged)[:len(log.tau)] + 0.8
    diagnosis = diagnosed(replace(log, tau=tau[:, None]), axis(), (
        'torque_offset', 'position_torque', 'time_offset', 'coulomb_asymmetry', 'stribeck'))
    assert 'position_torque' not in named(diagnosis)
    offset = next(cause for cause in diagnosis.causes if cause.effect.name == 'torque_offset')
    assert offset.parameters['offset'].value == pytest.approx((0.8,), rel=0.05)


# ------------------------------------------------------------------------- springs


def sprung(seed, noise):
    """Return the log of an axis with a return spring, which moves from place to place and rests."""
    random, period = np.random.default_rng(seed), 4e-3
    speed = np.concatenate([np.r_[np.full(round(abs(step) / 1.2 / period), np.copysign(1.2, step)),
                                  np.zeros(100)]
                            for step in np.diff(np.r_[0.0, random.uniform(0.0, 1.5, 14)])])
    kernel = np.hanning(61) / np.hanning(61).sum()
    speed = np.convolve(speed, kernel, 'same')
    q = period * np.cumsum(speed)
    tau = (0.05 * np.gradient(speed, period) + 0.8 * np.sign(speed) + 0.2 * speed
           + 2.2 * (q + 0.6) + noise * random.standard_normal(len(q)))
    return logged(np.round(q * 6366.0) / 6366.0, tau, period)


def test_a_spring_is_no_polynomial_of_the_ninth_degree():
    """It was one on the fitted rows, beyond doubt, and none at all where others go."""
    found = diagnosed(sprung(121, 0.003), axis(), SPRINGS)
    assert named(found) == ['position_torque']
    coefficients = found.causes[0].parameters['coefficients']
    _, slope = np.ravel(coefficients.value)  # of the first degree
    low, high = found.causes[0].parameters['range'].value
    assert abs(slope - 2.2 * 0.5 * (high - low)) < 2.0 * np.ravel(coefficients.std)[1]


def about(t):
    """Return positions that go to and fro within half a turn."""
    return (0.9 * np.sin(0.9 * t) + 0.4 * np.sin(2.3 * t + 1.0) + 0.1 * np.sin(7.5 * t + 2.0))


@pytest.mark.parametrize('width', [0.3, 0.4])
def test_what_a_series_of_a_magnet_lacks_is_no_cogging(width):
    """Ten polynomials leave waves of a narrow magnet, but some more do not."""
    def pull(q):
        return -1.2 * (q - 0.2) / width * np.exp(-((q - 0.2) / width) ** 2)

    log = recorded(Motor(0.1, 0.5, 0.3, held=pull), about, 20.0, 400.0, noise=0.04, counts=200_000)
    assert named(diagnosed(log, axis(), ('position_torque', 'cogging'))) == ['position_torque']


def test_cogging_beside_a_spring_keeps_its_name():
    """Of waves that go on over all positions a series needs many more terms."""
    motor = Motor(0.1, 0.5, 0.3, lines={11: (0.1, 1.0)}, held=lambda q: 0.8 * (q - 0.3))
    log = recorded(motor, about, 20.0, 400.0, noise=0.04, counts=200_000)
    found = diagnosed(log, axis(), ('position_torque', 'cogging'))
    assert sorted(named(found)) == ['cogging', 'position_torque']
    amplitude = next(cause for cause in found.causes if cause.effect.name == 'cogging')
    assert amplitude.parameters['amplitude'].value == pytest.approx((0.1,), rel=0.05)


@pytest.mark.parametrize('seed', [121, 122, 123])
def test_an_inertia_that_a_strong_cause_hides_comes_back_beside_it(seed):
    """The spring makes it negative, so that it is left out at first."""
    found = diagnosed(sprung(seed, 0.03), axis(), SPRINGS)
    assert named(found) == ['position_torque']
    assert found.left_out == () == found.unnamed
    assert found.base_after['actuator_inertia'].value == pytest.approx(0.05, rel=0.02)
    assert found.base_after['coulomb_friction'].value == pytest.approx(0.8, rel=0.02)


# ------------------------------------------------------------------------- filters


def test_lines_of_counts_do_not_raise_the_filter_of_the_torque():
    """A loop that answers counts at a steady speed has lines, which fold to any frequency."""
    t = 1e-3 * np.arange(16000)
    q = 3.0 * np.sin(2.0 * np.pi * 0.4 * t) + 0.2 * np.sin(2.0 * np.pi * 2.1 * t)
    random = np.random.default_rng(5)
    tau = (0.01 * np.gradient(np.gradient(q, t), t) + 0.02 * np.gradient(q, t)
           + 0.005 * random.standard_normal(len(t)))
    lines = 0.05 * np.sin(2.0 * np.pi * 413.0 * t)

    def cutoff(torque):
        return conditioning_for([logged(q, torque)], axis(), CONDITIONING).torque_cutoff_hz

    assert cutoff(tau + lines) == cutoff(tau) == CONDITIONING.torque_cutoff_hz
    assert cutoff(tau + 0.05 * np.sin(2.0 * np.pi * 60.0 * t)) > 80.0  # as of a motor's slots


# ------------------------------------------------------------------------- what is left


def loose(gap, stiffness=1000.0, damping=1.0, load=0.09):
    """Return the log of a motor that moves its load through a gap (rad) and a soft coupling."""
    period = 2.5e-4
    t = period * np.arange(72000)
    q = (0.6 * np.sin(2.0 * np.pi * 0.5 * t) + 0.25 * np.sin(2.0 * np.pi * 1.3 * t + 1.0)
         + 0.06 * np.sin(2.0 * np.pi * 3.1 * t + 2.0))
    qd = np.gradient(q, t)
    there, speed, passed = q[0], qd[0], np.zeros(len(t))
    for row in range(len(t)):
        apart = q[row] - there
        if abs(apart) > 0.5 * gap:
            passed[row] = (stiffness * (apart - np.copysign(0.5 * gap, apart))
                           + damping * (qd[row] - speed))
        speed += period * (passed[row] - 0.05 * np.tanh(speed / 0.01)) / load
        there += period * speed
    noise = 0.02 * np.random.default_rng(0).standard_normal(len(t))
    tau = 0.02 * np.gradient(qd, t) + 0.1 * np.sign(qd) + 0.05 * qd + passed + noise
    return logged(q[::4], tau[::4])


def test_an_axis_whose_error_is_no_noise_is_not_clean():
    """No function of the motion tells where a load is that swings in a gap."""
    found = diagnosed(loose(6e-3), axis())
    assert found.holdout.baseline_rms[0] > 20.0 * found.holdout.noise_floor_rms[0]
    assert found.verdict == 'unknown'
    assert 'follows nothing known of the motion' in outcome_of_diagnosis(found, axis()).sentence
    assert diagnosis_json(found, axis())['remaining']['significant'] is True


def uneven(seed):
    """Return the log of a motor whose load swings behind a gear, the teeth of which push it."""
    random, period = np.random.default_rng(seed), 2.5e-4
    speed = np.concatenate([np.r_[np.full(round(abs(step) / 1.2 / period), np.copysign(1.2, step)),
                                  np.zeros(1000)]
                            for step in np.diff(np.r_[0.0, random.uniform(-2.0, 2.0, 8)])])
    kernel = np.hanning(1200) / np.hanning(1200).sum()
    speed = np.convolve(speed, kernel, 'same')
    asked = period * np.cumsum(speed)
    q = qd = there = moved = held = 0.0
    positions, torques = np.empty_like(asked), np.empty_like(asked)
    for row in range(len(asked)):
        error = 28.0 * (asked[row] - q) + speed[row] - qd
        held += 1500.0 * period * error
        torque = 75.0 * error + held
        ratio = 1.0 + 0.04 * np.cos(100.0 * q)
        passed = (4000.0 * (q + 4e-4 * np.sin(100.0 * q) - there) + 3.0 * (ratio * qd - moved))
        qd += period * (torque - ratio * passed - 2.5 * np.tanh(qd / 1e-3) - 3.0 * qd) / 0.4
        moved += period * passed / 0.25
        q += period * qd
        there += period * moved
        positions[row], torques[row] = q, torque
    noise = 0.08 * random.standard_normal(len(asked))
    return logged(positions[::4], (torques + noise)[::4])


@pytest.mark.parametrize('seed', [2, 3])
def test_a_load_that_swings_behind_its_gear_is_not_late(seed):
    """At the frequency of the swing it is, by 9 ms, and nearly all of the error is there."""
    found = diagnosed(uneven(seed), axis(), ('time_offset', 'actuator_lag'))
    assert found.verdict == 'unknown'
    assert named(found) == []


# ------------------------------------------------------------------------- setup


def stage(friction, seed=0):
    """Return the log of a stage on a given motion with friction (n,) of its positions."""
    t = 2e-3 * np.arange(13000)
    q = (0.15 * np.sin(2.0 * np.pi * 0.2 * t) + 0.03 * np.sin(2.0 * np.pi * 0.9 * t + 1.0)
         + 0.008 * np.sin(2.0 * np.pi * 2.3 * t + 2.0))
    noise = 0.04 * np.random.default_rng(seed).standard_normal(len(t))
    return logged(q, 0.3 * np.gradient(np.gradient(q, t), t) + np.gradient(q, t) + friction(q)
                  + noise, 2e-3)


def slipping_springs(q):
    """Return the force of three springs that slip, one after the other, as they are drawn (n,)."""
    force = np.zeros(len(q))
    for limit, stiffness in ((2.4, 2400.0), (2.0, 1000.0), (1.6, 400.0)):
        own = 0.0
        for row, step in enumerate(np.diff(q)):
            own = min(max(own + stiffness * step, -limit), limit)
            force[row + 1] += own
    return force


def test_friction_that_builds_up_is_no_delay():
    """It lags behind the motion, too, but the torque of the bodies does not."""
    assert check_setup([stage(slipping_springs)], axis()).findings == ()


@pytest.mark.parametrize('distance', [2e-5, 4e-5])
def test_friction_of_a_slide_builds_up_over_microns(distance):
    """A length has no scale of its own, as an angle has: the travel gives it."""
    log = stage(lambda q: 3.0 * built_up(q, distance))
    cause, = diagnosed(log, axis(kind='linear', gravity='none'),
                       ('presliding', 'time_offset', 'stribeck')).causes
    assert cause.effect.name == 'presliding'
    assert cause.parameters['distance'].number == pytest.approx(distance, rel=0.1)


def test_a_delay_of_dry_friction_is_a_delay():
    log = stage(lambda q: 3.0 * np.sign(np.gradient(q)))
    late, = check_setup([mistakes.recorded_late(log, 0.05)], axis()).findings
    assert late.finding == 'delay'


def test_a_slide_slips_by_millimetres():
    log = stage(lambda q: 3.0 * np.sign(np.gradient(q)))
    slip, = check_setup([mistakes.slipped(log, 0, 9.0, 0.02)], axis(kind='linear')).findings
    assert slip.finding == 'encoder_slip'
    assert 'jumps by 20.0 +- ' in slip.evidence
    assert ' mm within a sample' in slip.evidence
    assert 'degrees' not in slip.evidence


def test_recordings_of_an_axis_that_were_joined_are_cut_apart():
    """A slip does not change the speed of the only joint; samples that are missing do."""
    log = stage(lambda q: 3.0 * np.sign(np.gradient(q)))
    kept = np.r_[0:4000, 4400:13000]
    width = np.ones(len(kept) - 1)
    assert joints_of_recordings(log.q[kept], width).tolist() == [4000]
    slipped = mistakes.slipped(log, 0, 9.0, 0.02).q[:len(kept)]
    assert joints_of_recordings(slipped, width).tolist() == []


@pytest.mark.parametrize('lacking', [None, 2])
def test_trials_of_one_length_that_were_joined_are_cut_apart(lacking):
    """The joint is brought home between them, and each begins from rest."""
    place = np.r_[0.0, 0.31, 0.05, 0.4, -0.2, 0.15, 0.0]
    if lacking is not None:
        place[lacking] = place[lacking - 1]  # where it was brought, to the same place
    t = 1e-2 * np.arange(501)
    q = np.concatenate([start + 0.05 * (1.0 - np.cos(2.0 * np.pi * t / 5.0)) for start in place])
    jumps = 501 * (1 + np.flatnonzero(np.abs(np.diff(place)) > 1e-9))
    found = joints_of_recordings(q[:, None], np.ones(len(q) - 1))
    assert set(jumps) <= set(found)
    assert np.all(found % 501 == 0)
    moved = q.copy()
    moved[jumps[0]:] += 0.3
    moved[jumps[0]:jumps[0] + 7] -= 0.3  # a jump in any row
    assert len(joints_of_recordings(moved[:, None], np.ones(len(q) - 1))) < len(jumps)


@pytest.mark.parametrize('tones', [(2.0,), (2.0, 0.7)])
def test_a_spring_is_told_only_where_it_is_not_the_inertia(tones):
    """On a single sine the acceleration is the position turned over, also on rows held out."""
    time = 1e-3 * np.arange(20000)
    q, qdd = (sum(1.2 / len(tones) * scale(2.0 * np.pi * tone) * np.sin(2.0 * np.pi * tone * time)
                  for tone in tones) for scale in (np.ones_like, lambda turn: -turn ** 2))
    qd = np.gradient(q, time)
    tau = (0.004 * qdd + 0.02 * qd + 0.1 * np.sign(qd) + 0.3 * q ** 3
           + 0.01 * np.random.default_rng(2).standard_normal(len(time)))
    found = diagnosed(logged(q, tau), axis(), ('position_torque', 'torque_offset'))
    if len(tones) > 1:
        assert named(found) == ['position_torque']
        assert found.base_after['actuator_inertia'].value == pytest.approx(0.004, rel=0.05)
    else:
        assert named(found) == []
        assert [item.kind for item in found.unnamed] == ['position']
        assert 'does not tell it from the inertia' in ' '.join(
            reason for item in found.rejected for reason in (item.reason,))


@pytest.mark.parametrize(('name', 'values', 'is_said'), [
    ('elastic_transmission', {'motor_share': 0.5}, True),
    ('elastic_transmission', {'motor_share': 0.7}, False),  # the data told it
    ('backlash', {'gap': (0.002,)}, True),
    ('load_dependent_friction', {'coefficient': (0.02,)}, True)])
def test_what_a_size_takes_for_granted_is_said(name, values, is_said):
    cause = SimpleNamespace(
        effect=LIBRARY[name], joints=(0,), twins=(), predictable=True,
        parameters={key: Parameter(value=value) for key, value in values.items()})
    said = [remark.text for remark in remarks_of_cause(cause, axis(), None)]
    assert len(said) == is_said
    assert all('is taken to' in text for text in said)


@pytest.mark.parametrize('noise', [0.0, 1e-3])
def test_torques_without_noise_are_said_to_be_smoothed_or_computed(noise):
    time = 1e-3 * np.arange(20000)
    q, qd, qdd = (scale * part(1.3 * time) + other * part(4.1 * time) for scale, other, part in (
        (1.0, 0.3, np.sin), (1.3, 1.23, np.cos), (-1.69, -5.043, np.sin)))
    tau = 0.5 * qdd + 2.0 * qd + noise * np.random.default_rng(1).standard_normal(len(time))
    found = diagnosed(logged(q, tau), axis(), ('torque_offset',))
    said = ' '.join(remark.text for remark in outcome_of_diagnosis(found, axis()).remarks)
    assert ('These torques have next to no noise' in said) == (noise == 0.0)


def misreading(periods, size, duration=14.0, step=5e-4, loop=120.0, seed=0):
    """Return the log of a rigid motor whose encoder, which its loop follows, errs in waves."""
    random, every = np.random.default_rng(seed), 5
    t = step * np.arange(round(duration / step))
    asked = turns(t)
    speed, acceleration = np.gradient(asked, step), np.gradient(np.gradient(asked, step), step)
    q, qd, last, read, torques = float(asked[0]), float(speed[0]), None, [], []
    for wanted, rate, change in zip(asked.tolist(), speed.tolist(), acceleration.tolist()):
        told = q + size * math.sin(periods * q + 1.0)
        told_rate = rate if last is None else (told - last) / step
        last = told
        torque = SPINDLE.inertia * (change + loop ** 2 * (wanted - told)
                                    + 2.0 * loop * (rate - told_rate)) + SPINDLE.viscous * rate
        read.append(told)
        torques.append(torque)
        friction = SPINDLE.viscous * qd + SPINDLE.coulomb * math.tanh(qd / 1e-3)
        qd += step * (torque + SPINDLE.coulomb * math.tanh(rate / 1e-3) - friction
                      ) / SPINDLE.inertia
        torques[-1] += SPINDLE.coulomb * math.tanh(rate / 1e-3)
        q += step * qd
    tau = np.array(torques)[::every] + random.normal(0.0, 0.01, len(torques[::every]))
    return logged(np.array(read)[::every], tau, every * step)


def test_a_reading_that_is_wrong_several_times_a_turn_is_no_cogging():
    """Its torque grows with the square of the speed; that of slots does not."""
    periods = 40
    found = diagnosed(misreading(periods, 4e-5), axis())
    assert found.verdict == 'unknown'
    assert named(found) == []
    slots = recorded(replace(SPINDLE, lines={periods: (0.1, 0.3)}), turns, 14.0, 400.0, noise=0.01,
                     counts=1 << 20)
    assert named(diagnosed(slots, axis())) == ['cogging']
