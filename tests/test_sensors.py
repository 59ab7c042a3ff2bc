"""What encoders tell and how the torque is recorded."""

from __future__ import annotations

import numpy as np
import pytest
from flywheels import Flywheels, played, spinning, wave

from par4_sim.machines.sensors import Sensors, read_encoders
from robots import REFERENCE

IDEAL = REFERENCE.model_copy(update={
    'drives': REFERENCE.drives.model_copy(update={'encoder_counts': 0})})


def told(sensors, q, qd=None, counts=0):
    """Return position and velocity readings (n, 4) of true positions q (n, 4)."""
    qd = np.zeros_like(q) if qd is None else qd
    readings, rates = np.empty_like(q), np.empty_like(q)
    for row in range(len(q)):
        read_encoders(sensors.encoders(counts), q[row], qd[row], np.zeros(4), readings[row],
                      rates[row])
    return readings, rates


def test_perfect_sensors_tell_the_truth():
    q, qd, _ = wave(np.arange(0.0, 1.0, 1e-2))
    readings, rates = told(Sensors(), q, qd)
    np.testing.assert_array_equal(readings, q)
    np.testing.assert_array_equal(rates, qd)


def test_drives_bring_the_reading_not_the_arm_to_the_reference():
    offset = np.array((2e-3, -4e-3, 0.0, 8e-3))
    plant = Flywheels()
    simulation = spinning(plant, IDEAL, sensors=Sensors(encoder_offset=offset))
    t = np.array((0.3, 3.0))
    simulation.queue_reference(t, np.full((2, 4), 0.2), np.zeros((2, 4)), np.zeros((2, 4)))
    for _ in range(2500):
        sample = simulation.next_sample()
    np.testing.assert_allclose(sample.q, 0.2, atol=1e-4)
    np.testing.assert_allclose(plant.q, 0.2 - offset, atol=1e-4)


def test_an_offset_does_not_move_a_resting_machine():
    plant = Flywheels(start=0.3)
    simulation = spinning(plant, sensors=Sensors(encoder_offset=np.full(4, 0.01)))
    np.testing.assert_allclose(simulation.q, 0.31, atol=5e-5)
    samples = [simulation.next_sample() for _ in range(100)]
    np.testing.assert_array_equal(plant.q, 0.3)
    np.testing.assert_allclose(samples[-1].q, 0.31, atol=5e-5)


def test_eccentricity_is_once_per_turn_and_its_velocity_is_consistent():
    size, phase = np.array((1e-3, 5e-4, 0.0, 2e-3)), np.array((0.0, 1.0, 2.0, -0.7))
    sensors = Sensors(eccentricity=size, eccentricity_phase=phase)
    t = np.arange(0.0, 1.0, 1e-3)
    q, qd = np.outer(2.0 * np.pi * t, np.ones(4)), np.full((1000, 4), 2.0 * np.pi)
    readings, rates = told(sensors, q, qd)
    spectrum = np.fft.rfft(readings - q, axis=0) / 500.0
    np.testing.assert_allclose(np.abs(spectrum[1]), size, atol=1e-12)
    np.testing.assert_allclose(np.delete(np.abs(spectrum), 1, axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose((readings - q)[0], size * np.sin(phase), atol=1e-15)
    np.testing.assert_allclose(np.gradient(readings, 1e-3, axis=0)[1:-1], rates[1:-1], rtol=1e-6)


def test_readings_stand_on_the_coarser_of_counts_and_steps():
    q = np.random.default_rng(3).uniform(-1.0, 1.5, (400, 4))
    counts = 8192
    counted = 2.0 * np.pi / counts
    steps = np.array((0.0, 1e-4, 5e-3, 0.02))
    readings, _ = told(Sensors(position_step=steps), q, counts=counts)
    rules = np.maximum(steps, counted)
    np.testing.assert_allclose(readings / rules, np.round(readings / rules), atol=1e-9)
    error = readings - q
    assert (np.abs(error) <= 0.5 * rules * (1 + 1e-9)).all()
    np.testing.assert_allclose(np.std(error, axis=0), rules / np.sqrt(12.0), rtol=0.06)


def test_the_recorded_torque_stands_on_its_steps_and_the_true_one_does_not():
    steps = np.array((0.0, 0.1, 0.5, 0.02))
    stepped = played(spinning(sensors=Sensors(torque_step=steps)))
    smooth = played(spinning())
    np.testing.assert_array_equal(stepped['true_torque'], smooth['true_torque'])
    np.testing.assert_array_equal(stepped['effort'][:, 0], smooth['effort'][:, 0])
    for joint in (1, 2, 3):
        ratio = stepped['effort'][:, joint] / steps[joint]
        np.testing.assert_allclose(ratio, np.round(ratio), atol=1e-9)
        error = np.abs(stepped['effort'] - smooth['effort'])[:, joint]
        assert 0.3 * steps[joint] < error.max() <= 0.5 * steps[joint] * (1 + 1e-9)


@pytest.mark.parametrize('periods', [-5, -1, 1, 2, 7])
def test_a_delay_of_whole_samples_shifts_the_record_and_nothing_else(periods):
    clean = played(spinning())
    late = played(spinning(sensors=Sensors(torque_delay=periods * 1e-3)))
    for name in ('time_ns', 'q', 'qd', 'true_torque'):
        np.testing.assert_array_equal(late[name], clean[name])
    if periods > 0:
        np.testing.assert_array_equal(late['effort'][periods:], clean['effort'][:-periods])
    else:
        np.testing.assert_array_equal(late['effort'][:periods], clean['effort'][-periods:])


@pytest.mark.parametrize('delay', [-2.3e-3, -4e-4, 1.7e-4, 6.1e-4, 3.9e-3])
def test_a_delay_is_right_below_the_sample_period(delay):
    clean = played(spinning(robot=IDEAL))
    late = played(spinning(robot=IDEAL, sensors=Sensors(torque_delay=delay)))
    np.testing.assert_array_equal(late['q'], clean['q'])
    t = clean['time_ns'] * 1e-9
    inside = slice(100, -20)
    for joint in range(4):
        expected = np.interp(t - delay, t, clean['effort'][:, joint])
        np.testing.assert_allclose(late['effort'][inside, joint], expected[inside],
                                   atol=2e-3 * np.abs(expected).max())
    rate = np.gradient(clean['effort'], 1e-3, axis=0)[inside]
    found = -np.sum(rate * (late['effort'] - clean['effort'])[inside], axis=0) / np.sum(
        rate * rate, axis=0)
    np.testing.assert_allclose(found, delay, rtol=0.02, atol=5e-6)
