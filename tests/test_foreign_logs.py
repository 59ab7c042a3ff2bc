"""Logs as machines of others give them: what is wrong with them is said as what it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axes import axis
from click.testing import CliRunner
from foreign import log_of, read, swings, torque_of
from scipy.signal import lfilter

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_identification.commands.diagnose import diagnose_bags
from par4_identification.commands.identify import identify_bags
from par4_identification.diagnosis.diagnosis import CONDITIONING, LIBRARY, diagnose
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import observe
from par4_identification.diagnosis.search.rules import OF_AXIS
from par4_identification.diagnosis.verdict.answer import Unusable
from par4_identification.diagnosis.verdict.sure import is_no_noise
from par4_identification.fitting.identification import identify
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.diagnosis import outcome_of_diagnosis
from par4_identification.reports.outcome.gravity import gravity_remarks
from par4_identification.setup_check.check import check_setup
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.scales import conditioning_for
from par4_sim.report.words import number

T, Q, QD, QDD = swings()


@pytest.mark.parametrize('lower', [-1.0, -0.85])
def test_a_force_at_its_limit_is_clipped_and_not_held(lower):
    """Friction that turns over ends each stand by a jump, as a held reading does."""
    tau = 95.0 * QDD + 40.0 * QD + 200.0 * np.sign(QD) + 3.0 * np.random.default_rng(
        0).standard_normal(len(T))
    limit = 0.5 * np.abs(tau).max()
    log = log_of(T, Q, np.clip(tau, lower * limit, limit))
    check = check_setup([log], axis(kind='linear'))
    said, = check.findings
    assert said.finding == 'clipped'
    levels = {-1.0: number(limit, 3), -0.85: f'{number(0.85 * limit, 3)} and {number(limit, 3)}'}
    assert f'stands at exactly {levels[lower]} N for' in said.evidence
    at_end = (log.tau == log.tau.min()) | (log.tau == log.tau.max())
    np.testing.assert_array_equal(check.logs[0].doubtful, at_end)
    logs = list(check.logs)
    found = identify(logs, axis(kind='linear'), conditioning=conditioning_for(
        logs, axis(kind='linear'), Conditioning()))
    np.testing.assert_allclose(found.estimate.values, (95.0, 200.0, 40.0), rtol=0.01)


def test_a_torque_in_coarse_steps_is_not_clipped():
    _, q, qd, qdd = swings(seed=3)
    tau = np.round(torque_of(qd, qdd, 0.1) / 2.0) * 2.0
    assert check_setup([log_of(T, q, tau)], axis()).findings == ()


@pytest.mark.parametrize('levels', [(-2.0, 2.0), (0.0, 2.0), (-2.0, 0.0, 2.0)])
def test_a_torque_that_switches_between_levels_is_not_clipped(levels):
    """Random steps, as they are used to identify motors, come to their ends from far away."""
    random, inertia, viscous = np.random.default_rng(4), 0.02, 0.15
    tau = np.repeat(random.choice(levels, 150), 200)
    slower = np.exp(-1e-3 * viscous / inertia)
    qd = lfilter((0.0, (1.0 - slower) / viscous), (1.0, -slower), tau)
    log = log_of(1e-3 * np.arange(len(tau)), 1e-3 * np.cumsum(qd), tau)
    check = check_setup([log], axis())
    assert check.findings == ()
    assert check.logs[0].doubtful is None or not check.logs[0].doubtful.any()
    # what is put on even stamps is no more exact than the curve between them, but where it hits one
    shaken = log.tau + 1e-6 * random.normal(size=log.tau.shape)
    shaken[20_000:20_200] = log.tau[20_000:20_200]
    assert check_setup([replace(log, tau=shaken)], axis()).findings == ()


def turned_round_at(speed: float, lag: float) -> Log:
    """Return a log of a cart that is driven by +-13 N, turned round at a speed; 150 Hz, 20 s.

    Its force follows the recorded one through a first-order lag, s.
    """
    mass, friction, viscous, period, every = 6.3, 2.5, 10.0, 1.0 / 3000.0, 20
    x = v = force = 0.0
    wanted, rows = 13.0, []
    for step in range(round(20.0 / period)):
        if step % every == 0:
            wanted = -13.0 if v > speed else 13.0 if v < -speed else wanted
            rows.append((step * period, 1e-4 * round(1e4 * x), wanted))
        force += (wanted - force) * period / lag
        v += (force - friction * np.tanh(v / 1e-3) - viscous * v) / mass * period
        x += v * period
    return log_of(*np.array(rows).T)


@pytest.mark.parametrize(('speed', 'lag'), [(0.25, 0.003), (0.3, 0.012)])
def test_a_delay_that_leaves_an_axis_no_inertia_is_none(speed, lag):
    """A quarter of its period later a switched force is friction: it goes as the speed's sign."""
    log, cart = turned_round_at(speed, lag), axis(kind='linear')
    assert 'delay' not in [finding.finding for finding in check_setup([log], cart).findings]
    found = identify([log], cart, conditioning=conditioning_for([log], cart, Conditioning()))
    assert 5.0 < found.estimate.values[0] < 8.0


def told_of_gravity(tau, machine):
    log = log_of(T, Q, tau)
    return gravity_remarks(machine, [log], conditioning_for([log], machine, CONDITIONING))


@pytest.mark.parametrize(('kind', 'load', 'words'), [
    ('revolute', 6.0 * np.sin(Q) + 1.5 * np.cos(Q), 'A torque a sin q + b cos q of up to 6.18 N m'),
    ('linear', np.full(len(T), 50.0), 'A constant force of 50.0 N')])
def test_an_axis_that_hangs_though_its_file_denies_it_is_told(kind, load, words):
    tau = torque_of(QD, QDD) + load
    said, = told_of_gravity(tau, axis(kind=kind))
    assert said.text.startswith(f'{words}, as of a weight, explains 100 %')
    assert 'does not speak of it, which means gravity: none' in said.text
    assert 'write gravity: vertical into it' in said.advice
    said, = told_of_gravity(tau, axis(kind=kind, gravity='none'))
    assert 'says gravity: none' in said.text
    assert told_of_gravity(tau, axis(kind=kind, gravity='vertical')) == ()


@pytest.mark.parametrize('load', [0.0, 6.0 * Q, 0.3])
def test_springs_offsets_and_nothing_are_no_weight_of_a_turning_axis(load):
    assert told_of_gravity(torque_of(QD, QDD) + load, axis()) == ()


def test_the_commands_suggest_gravity(tmp_path):
    read(tmp_path / 'bag', T, Q, torque_of(QD, QDD) + 6.0 * np.sin(Q))
    robot = tmp_path / 'axis.yaml'
    robot.write_text('schema: par4/axis/1\nname: axis\njoint: motor\nkind: revolute\ngain: 1.0\n')
    for command in (identify_bags, diagnose_bags):
        told = CliRunner().invoke(command, [
            str(tmp_path / 'bag'), '--robot', str(robot), '--output', str(tmp_path / command.name),
            '--no-report'], catch_exceptions=False)
        assert told.exit_code == 0
        assert 'write gravity: vertical into it; with gravity: unknown the data tell' in told.output


def test_a_delay_is_said_to_look_like_a_low_pass_of_the_current():
    late = 0.003
    share = 1.0 - np.exp(-1e-3 / late)
    tau = lfilter((share,), (1.0, share - 1.0), torque_of(QD, QDD, noise=0.0))
    log = log_of(T, Q, tau + 0.01 * np.random.default_rng(1).standard_normal(len(T)))
    found = diagnose([log], axis(), conditioning=conditioning_for([log], axis(), CONDITIONING),
                     library={name: LIBRARY[name] for name in ('time_offset', 'actuator_lag')})
    cause, = found.causes
    assert cause.effect.name == 'time_offset'
    assert cause.parameters['delay'].value == pytest.approx(late, rel=0.3)
    said = ' '.join(remark.text for remark in outcome_of_diagnosis(found, axis()).remarks)
    assert 'A first-order low pass of the logged torque or current, with a time constant of' in said


@pytest.mark.parametrize('weight', [0.0, 1177.0])
def test_a_constant_weight_hides_no_stribeck_friction(weight):
    """It is not wrong by a share that follows the motion; 0.3 % of it was 3.5 N, and all clean."""
    t, q, qd, qdd = swings(40.0, fastest=0.3)
    q, qd, qdd = 0.25 * q, 0.25 * qd, 0.25 * qdd
    tau = (120.0 * qdd + 60.0 * qd + np.sign(qd) * (40.0 + 18.0 * np.exp(-(qd / 0.1) ** 2))
           + weight + np.random.default_rng(0).standard_normal(len(t)))
    machine, log = axis(kind='linear', gravity='vertical'), log_of(t, q, tau)
    found = diagnose([log], machine, conditioning=conditioning_for([log], machine, CONDITIONING),
                     library={name: LIBRARY[name] for name in ('stribeck', 'torque_ripple')})
    cause, = found.causes
    assert cause.effect.name == 'stribeck'
    assert cause.parameters['stribeck_torque'].value == pytest.approx((18.0,), rel=0.05)


def test_a_constant_weight_excuses_nothing_that_is_left():
    """With five times 0.3 % of the weight, 40 N of a rest that follows nothing passed for clean."""
    generator = np.random.default_rng(3)
    pushes = np.repeat(generator.standard_normal(len(T) // 500), 500)
    tau = torque_of(QD, QDD, 1.0) + 5000.0 + 40.0 * pushes
    machine, log = axis(kind='linear', gravity='vertical'), log_of(T, Q, tau)
    observations = observe(runs_of_log(log, machine), machine, 'paper', None)
    rest = [40.0 * run.at_rows(pushes[:, None]) for run in observations.runs]
    nothing = [np.zeros_like(part) for part in rest]
    assert is_no_noise(observations, rest, nothing, (), np.ones(1), OF_AXIS)


@pytest.mark.parametrize(('names', 'share', 'expected'), [
    (('position_torque',), 0.05, True), (('position_torque', 'cogging'), 0.05, True),
    (('torque_offset',), 0.05, True), (('position_torque',), 0.03, False),
    (('stribeck',), 0.05, False),
    (('stribeck',), 0.12, True), (('cogging', 'stribeck'), 0.05, False)])
def test_a_series_explains_what_it_follows_more_closely_than_a_law_does(names, share, expected):
    """A spring that creeps left 7 % of its torque, 33 times the noise, and all was explained."""
    machine, log = axis(kind='linear'), log_of(T, Q, torque_of(QD, QDD, 1.0))
    observations = observe(runs_of_log(log, machine), machine, 'paper', None)
    torque = [100.0 * np.sin(7.0 * run.q) for run in observations.runs]
    left = [share * part for part in torque]
    named = [Hypothesis(CATALOGUE[name], {}, (0,)) for name in names]
    assert is_no_noise(observations, left, torque, named, np.full(1, 1e-3), OF_AXIS) is expected


@pytest.mark.parametrize(('sign', 'verdict'), [(1.0, 'explained'), (-1.0, None)])
def test_a_load_on_a_drum_that_is_mostly_lowered_drives_no_friction(sign, verdict):
    """It was refused for friction that drives; with its torque turned over it was explained."""
    t = np.arange(0.0, 60.0, 0.01)
    speed = np.interp(t % 12.0, (0, 1, 8, 9, 9.5, 11, 11.5, 12), (0, -3, -3, 0, 9, 9, 0, 0))
    tau = (0.29 + 0.02 * np.sign(speed) + 0.001 * speed + 0.0005 * np.gradient(speed, t)
           + 0.003 * np.random.default_rng(0).standard_normal(len(t)))
    log = log_of(t, np.cumsum(speed) * 0.01, sign * tau)
    answer = diagnose([log], axis(), conditioning=conditioning_for([log], axis(), CONDITIONING))
    if verdict is None:
        assert isinstance(answer, Unusable)
        assert 'friction comes out driving the joint' in answer.reasons[0]
        return
    cause, = answer.causes
    assert (answer.verdict, cause.effect.name) == (verdict, 'torque_offset')
    np.testing.assert_allclose(cause.parameters['offset'].value, 0.29, rtol=0.01)
