"""What amplifiers deliver of what is asked: gain, ripple, lag, limit."""

from __future__ import annotations

import numpy as np
import pytest
from flywheels import Flywheels, played, spinning

from par4_sim.machines.amplifier import Amplifier, deliver, lag_shares
from robots import REFERENCE

DT = 0.25e-3


def delivered(amplifier, commands, q=None, current_lag=0.0):
    """Return the torques (n, 4) of commands (n, 4) held for a step each, from rest at zero."""
    q = np.zeros_like(commands) if q is None else q
    lag = lag_shares(current_lag, amplifier.time_constant, DT)
    currents, torque = np.zeros((2, 4)), np.empty(4)
    result = []
    for command, angle in zip(commands, q):
        deliver(amplifier.packed, lag, currents, command, angle, torque)
        result.append(torque.copy())
    return np.array(result)


def test_a_perfect_amplifier_delivers_what_is_asked():
    commands = np.random.default_rng(1).normal(size=(50, 4))
    np.testing.assert_array_equal(delivered(Amplifier(), commands), commands)


def test_gain_error_is_the_share_by_which_the_record_exceeds_the_truth():
    error = np.array((0.03, -0.02, 0.0, 0.05))
    told = played(spinning(amplifier=Amplifier(gain_error=error)))
    moving = np.abs(told['true_torque']) > 1.0
    ratio = np.where(moving, told['effort'] / np.where(moving, told['true_torque'], 1.0), np.nan)
    np.testing.assert_allclose(np.nanmean(ratio, axis=0), 1.0 + error, rtol=1e-12)


def test_the_delivered_torque_moves_the_machine():
    inertia = np.array((0.5, 1.0, 2.0, 0.7))
    plant = Flywheels(inertia)
    told = played(spinning(plant, amplifier=Amplifier(gain_error=np.full(4, 0.1))))
    impulse = DT * np.cumsum(plant.applied, axis=0)[-1]
    np.testing.assert_allclose(impulse, inertia * plant.qd, rtol=1e-9)
    qdd = np.gradient(told['qd'], 1e-3, axis=0)[100:-100]
    np.testing.assert_allclose(told['effort'][100:-100], 1.1 * inertia * qdd,
                               atol=2e-3 * np.abs(told['effort']).max())


def test_ripple_is_periodic_in_the_position_and_scales_with_the_torque():
    amplifier = Amplifier(ripple=np.array((0.03, 0.02, 0.01, 0.0)),
                          ripple_periods=np.array((8.0, 20.0, 3.0, 8.0)),
                          ripple_phase=np.array((0.4, -1.0, 2.0, 0.0)))
    plant = Flywheels()
    ideal = REFERENCE.model_copy(update={
        'drives': REFERENCE.drives.model_copy(update={'encoder_counts': 0})})
    told = played(spinning(plant, ideal, amplifier))
    large = np.abs(told['true_torque']) > 5.0
    wave = np.where(large, told['effort'] / np.where(large, told['true_torque'], 1.0) - 1.0, 0.0)
    angle = amplifier.ripple_periods * told['q'] + amplifier.ripple_phase
    expected = np.where(large, amplifier.ripple * np.sin(angle), 0.0)
    np.testing.assert_allclose(wave, expected, atol=1e-4)
    assert np.abs(wave[:, 0]).max() > 0.025


def test_ripple_repeats_after_a_period():
    turn = np.linspace(0.0, 2.0 * np.pi / 6.0, 50)[:, None] * np.ones(4)
    amplifier = Amplifier(ripple=np.full(4, 0.02), ripple_periods=np.full(4, 6.0))
    commands = np.full((50, 4), 10.0)
    once, again = (delivered(amplifier, commands, q) for q in (turn, turn + 2.0 * np.pi / 6.0))
    np.testing.assert_allclose(once, again, atol=1e-12)
    np.testing.assert_allclose((10.0 / once).max(axis=0), 1.02, atol=1e-4)


@pytest.mark.parametrize('place', ['drive', 'amplifier'])
def test_a_lag_answers_a_step_as_a_first_order_system(place):
    constant, steps = 2e-3, 40
    ends = DT * np.arange(steps + 1)
    # the mean of 1 - exp(-t / T) over each step
    area = ends + constant * np.exp(-ends / constant)
    expected = np.diff(area) / DT
    torque = delivered(Amplifier(time_constant=constant if place == 'amplifier' else 0.0),
                       np.ones((steps, 4)), current_lag=constant if place == 'drive' else 0.0)
    np.testing.assert_allclose(torque, expected[:, None] * np.ones(4), rtol=1e-12)


@pytest.mark.parametrize(('first', 'second'), [(1e-3, 3e-3), (3e-3, 1e-3), (2e-3, 2e-3)])
def test_two_lags_in_series_answer_as_a_second_order_system(first, second):
    ends = DT * np.arange(61)
    if first == second:
        rest = (ends + 2.0 * first) * np.exp(-ends / first)  # -integral of (1 + t/T) exp(-t/T)
    else:
        rest = (first ** 2 * np.exp(-ends / first) - second ** 2 * np.exp(-ends / second)) / (
            first - second)
    expected = np.diff(ends + rest) / DT
    torque = delivered(Amplifier(time_constant=second), np.ones((60, 4)), current_lag=first)
    np.testing.assert_allclose(torque[:, 0], expected, atol=1e-6)


def test_behind_a_ramp_the_torque_is_late_by_the_sum_of_the_time_constants():
    slope = 100.0
    commands = slope * DT * np.arange(400)[:, None] * np.ones(4)
    late = delivered(Amplifier(time_constant=2e-3), commands, current_lag=1e-3)
    np.testing.assert_allclose(commands[-1] - late[-1], slope * 3e-3, rtol=1e-6)


@pytest.mark.parametrize(('known', 'hidden'), [(0.0, 3e-3), (2e-3, 0.0), (1e-3, 2e-3)])
def test_the_lags_show_between_recorded_and_delivered_torque_of_a_run(known, hidden):
    drives = REFERENCE.drives.model_copy(update={'current_lag': known})
    told = played(spinning(robot=REFERENCE.model_copy(update={'drives': drives}),
                           amplifier=Amplifier(time_constant=hidden)))
    rate = np.gradient(told['true_torque'], 1e-3, axis=0)[100:-50]
    excess = (told['effort'] - told['true_torque'])[100:-50]
    found = np.sum(rate * excess, axis=0) / np.sum(rate * rate, axis=0)
    np.testing.assert_allclose(found, known + hidden, rtol=5e-3)


def test_the_limit_cuts_what_is_delivered_and_not_what_is_recorded():
    limit = np.array((3.0, 5.0, np.inf, 8.0))
    told = played(spinning(amplifier=Amplifier(torque_limit=limit)))
    true, recorded = told['true_torque'], told['effort']
    assert (np.abs(true) <= limit).all()
    assert (np.abs(recorded) > limit + 1.0).any(axis=0)[[0, 1, 3]].all()
    for joint, bound in enumerate(limit):
        # samples average two steps: judge where neither is near the limit
        asked = np.abs(recorded[:, joint])
        free, flat = asked < bound - 1.0, asked > bound + 1.0
        np.testing.assert_allclose(true[free, joint], recorded[free, joint], atol=1e-9)
        np.testing.assert_allclose(np.abs(true[flat, joint]), bound)


def test_the_order_is_lag_then_gain_then_limit():
    amplifier = Amplifier(gain_error=np.full(4, -0.5), torque_limit=np.full(4, 1.5),
                          time_constant=1e-3)
    torque = delivered(amplifier, np.ones((200, 4)))
    assert 0.0 < torque[0, 0] < 0.5
    np.testing.assert_array_equal(torque[-1], 1.5)
