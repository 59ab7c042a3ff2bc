"""The recorder's noise: sizes, colours, seeds, stamps."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner
from flywheels import played, spinning

from par4_identification.logs.bag import read_bag
from par4_kinematics.errors import InputError
from par4_sim.commands.simulate import simulate
from par4_sim.machines.noise import Noise, NoiseSource

PERIOD = 1e-3


def drawn(noise, count, seed=0):
    """Return torque (n, 4), position (n, 4) and stamp errors (n,) ns of `count` samples."""
    source = NoiseSource(noise, PERIOD, seed)
    torque, position, stamp = [], [], []
    for _ in range(count):
        source.advance()
        torque.append(source.torque.copy())
        position.append(source.position.copy())
        stamp.append(source.stamp_ns)
    return np.array(torque), np.array(position), np.array(stamp)


def correlation(values, lag):
    """Return the autocorrelation (4,) at a lag in samples."""
    return np.mean(values[lag:] * values[:-lag], axis=0) / np.mean(values ** 2, axis=0)


def test_white_noise_has_its_rms_and_no_memory():
    torque, _, _ = drawn(Noise(torque_noise=0.2), 40_000)
    np.testing.assert_allclose(torque.std(axis=0), 0.2, rtol=0.02)
    np.testing.assert_allclose(torque.mean(axis=0), 0.0, atol=5 * 0.2 / np.sqrt(40_000))
    for lag in (1, 2, 10):
        np.testing.assert_allclose(correlation(torque, lag), 0.0, atol=0.025)
    across = np.corrcoef(torque.T)[np.triu_indices(4, 1)]
    np.testing.assert_allclose(across, 0.0, atol=0.025)


def test_coloured_noise_has_the_same_rms_and_forgets_exponentially():
    time = 5e-3
    torque, _, _ = drawn(Noise(torque_noise=0.2, correlation_time=time), 100_000)
    np.testing.assert_allclose(torque.std(axis=0), 0.2, rtol=0.03)
    for lag in (1, 3, 5, 10):
        np.testing.assert_allclose(correlation(torque, lag), np.exp(-lag * PERIOD / time),
                                   atol=0.03)


@pytest.mark.parametrize('time', [0.0, 4e-3])
def test_the_spectrum_is_flat_or_that_of_a_first_order_filter(time):
    count, segment = 131_072, 1024
    torque, _, _ = drawn(Noise(torque_noise=1.0, correlation_time=time), count)
    parts = torque.reshape(-1, segment, 4) * np.hanning(segment)[:, None]
    power = np.mean(np.abs(np.fft.rfft(parts, axis=1)) ** 2, axis=(0, 2))
    power *= 1.0 / np.sum(np.hanning(segment) ** 2)
    keep = np.exp(-PERIOD / time) if time else 0.0
    angle = 2.0 * np.pi * np.fft.rfftfreq(segment)
    expected = (1.0 - keep ** 2) / np.abs(1.0 - keep * np.exp(-1j * angle)) ** 2
    bands = np.array_split(np.arange(4, len(power) - 1), 8)
    np.testing.assert_allclose([power[band].mean() for band in bands],
                               [expected[band].mean() for band in bands], rtol=0.06)


def test_coloured_noise_is_stationary_from_the_first_sample_on():
    noise = Noise(torque_noise=1.0, correlation_time=0.1)
    first = np.array([drawn(noise, 1, seed)[0][0] for seed in range(300)])
    assert first.std() == pytest.approx(1.0, rel=0.1)


def test_each_noise_has_a_stream_of_its_own():
    everything = Noise(0.1, 2e-3, 1e-5, 5e-5)
    torque, position, stamp = drawn(everything, 700, seed=4)
    for other in (Noise(position_noise=1e-5, stamp_jitter=5e-5), Noise(0.3, 0.0, 1e-5, 5e-5)):
        _, same_position, same_stamp = drawn(other, 700, seed=4)
        np.testing.assert_array_equal(same_position, position)
        np.testing.assert_array_equal(same_stamp, stamp)
    same_torque, nothing, no_jitter = drawn(Noise(0.1, 2e-3), 700, seed=4)
    np.testing.assert_array_equal(same_torque, torque)
    assert not nothing.any()
    assert not no_jitter.any()
    twice, _, _ = drawn(Noise(0.2, 2e-3), 700, seed=4)
    np.testing.assert_allclose(twice, 2.0 * torque)
    assert abs(np.corrcoef(torque[:, 0], position[:, 0])[0, 1]) < 0.2


def test_a_seed_makes_the_same_noise_bit_for_bit_and_another_one_not():
    noise = Noise(0.1, 2e-3, 1e-5, 5e-5)
    first, again, other = (drawn(noise, 600, seed) for seed in (7, 7, 8))
    for one, two, three in zip(first, again, other):
        np.testing.assert_array_equal(one, two)
        assert not np.array_equal(one, three)


def test_jittered_stamps_keep_their_order_and_the_values_their_true_times():
    jitter = 2e-4
    clean = played(spinning())
    shaken = played(spinning(noise=Noise(stamp_jitter=jitter)))
    for name in ('q', 'qd', 'effort', 'true_torque'):
        np.testing.assert_array_equal(shaken[name], clean[name])
    error = shaken['time_ns'] - clean['time_ns']
    assert np.abs(error).max() < 0.5e6
    assert (np.diff(shaken['time_ns']) > 0).all()
    assert error.std() == pytest.approx(1e9 * jitter, rel=0.1)
    _, _, stamps = drawn(Noise(stamp_jitter=0.25 * PERIOD), 50_000)
    assert np.abs(stamps).max() < 0.5e9 * PERIOD
    assert np.std(stamps) == pytest.approx(0.25e9 * PERIOD, rel=0.05)


def test_jitter_that_would_mix_up_the_stamps_is_refused():
    with pytest.raises(InputError, match=r'0\.0003 s rms asked .* give 0\.00025 s or less'):
        spinning(noise=Noise(stamp_jitter=3e-4))


def test_noise_reaches_the_record_and_not_the_drives():
    clean = played(spinning(seed=3))
    noisy = played(spinning(seed=3, noise=Noise(0.5, 1e-3, 1e-3, 1e-5)))
    np.testing.assert_array_equal(noisy['true_torque'], clean['true_torque'])
    np.testing.assert_array_equal(noisy['qd'], clean['qd'])
    assert np.std(noisy['effort'] - clean['effort']) == pytest.approx(0.5, rel=0.1)
    assert np.std(noisy['q'] - clean['q']) == pytest.approx(1e-3, rel=0.05)


def test_a_run_is_reproduced_bit_for_bit_also_after_a_reset():
    noise = Noise(0.5, 1e-3, 1e-3, 1e-5)
    simulation = spinning(seed=3, noise=noise)
    first = played(simulation)
    again = played(spinning(seed=3, noise=noise))
    simulation.reset()
    reset = played(simulation)
    for name, values in first.items():
        np.testing.assert_array_equal(values, again[name])
        np.testing.assert_array_equal(values, reset[name])


def test_the_command_line_writes_noisy_bags_that_are_equal_bit_for_bit(tmp_path):
    options = ['adept', '--torque-noise', '0.1', '--noise-time', '0.005', '--position-noise',
               '1e-4', '--stamp-jitter', '1e-4', '--seed', '3']
    bags = []
    for name in ('one', 'two'):
        result = CliRunner().invoke(simulate, [*options, '--output', str(tmp_path / name)])
        assert result.exit_code == 0, result.output
        bags.append(read_bag(tmp_path / name).joints['joint_states'])
    for field in ('stamp', 'position', 'velocity', 'effort'):
        np.testing.assert_array_equal(getattr(bags[0], field), getattr(bags[1], field))
    spacing = np.diff(bags[0].stamp)
    assert np.std(spacing) == pytest.approx(np.sqrt(2.0) * 1e5, rel=0.1)
    resting = slice(0, 400)
    assert np.std(bags[0].position[resting], axis=0) == pytest.approx(1e-4, rel=0.15)
