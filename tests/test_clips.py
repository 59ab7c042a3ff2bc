"""Positions and speeds that clip are told from rests, stops and speeds that are kept."""

from __future__ import annotations

import numpy as np
import pytest
from axes import axis
from foreign import COULOMB, INERTIA, VISCOUS, identified, read, swings, torque_of

from par4_identification.logs.clips import clipped
from par4_identification.logs.column_choice import chosen_columns
from par4_identification.logs.masks import stretches
from par4_identification.logs.measured import Measured
from par4_identification.logs.measured_bag import write_measured
from par4_identification.logs.measured_files import measured_of_files
from par4_identification.logs.read_log import read_log

T, Q, QD, QDD = swings(40.0)
TAU = torque_of(QD, QDD)
COUNT = 2.0 * np.pi / 2 ** 14


def moves(amax, vmax, way, dwell, jerk=0.0, rate=1000.0, times=12):
    """Return positions and speeds (n,) of moves to and fro with rests between."""
    ramp = round(rate * vmax / amax)
    speed = np.clip(np.arange(round(rate * way / vmax) + ramp) / ramp, 0.0, 1.0) * vmax
    speed = np.minimum(speed, speed[::-1])
    one = np.concatenate((speed, np.zeros(round(rate * dwell))))
    qd = np.concatenate([np.concatenate((one, -one)) for _ in range(times)])
    if jerk:
        width = round(rate * jerk)
        qd = np.convolve(qd, np.full(width, 1.0 / width), 'same')
    return np.cumsum(qd) / rate, qd


@pytest.mark.parametrize('share', [0.7, 0.95])
@pytest.mark.parametrize('held', ['torque', 'voltage'])
def test_a_clipped_speed_is_no_way(tmp_path, share, held):
    """Taken as it was it made an elastic transmission of a sound axis."""
    top = np.quantile(np.abs(QD), share)
    noise = 1e-4 * np.random.default_rng(3).standard_normal(len(T))
    path, unit = tmp_path / 'log.csv', {'torque': 'Nm', 'voltage': 'V'}[held]
    np.savetxt(path, np.stack((T, np.clip(QD + noise, -top, top), TAU), axis=1), delimiter=',',
               header='t,w,tau', fmt='%.9g', comments='')
    measured = measured_of_files([path], chosen_columns(
        f'time=t:s velocity=w:rad/s {held}=tau:{unit}'))
    assert any(f'velocity of joint 0: stands at exactly -{top:.4g} and {top:.4g} rad/s' in line
               and 'the position has no number there' in line for line in measured.findings())
    write_measured(measured, ('motor',), tmp_path / 'bag')
    log = read_log(tmp_path / 'bag', axis())
    assert len(log.segments) > 1
    # the end of a clipped stretch is cut off a third digit of friction, no more
    np.testing.assert_allclose(identified(log), (INERTIA, COULOMB, VISCOUS), rtol=0.01)


@pytest.mark.parametrize('jitter', [0.0, 1e-4])
def test_clipped_positions_are_left_out(tmp_path, jitter):
    """Uneven stamps, on which positions are interpolated, do not hide them."""
    top = 0.8 * np.abs(Q).max()
    stamps = T + jitter * np.random.default_rng(4).standard_normal(len(T))
    log = read(tmp_path / 'bag', stamps, np.clip(Q, -top, top), TAU)
    share, levels, unit = log.bag_accounts.clipped['motor']
    assert levels == (-top, top)
    assert unit == 'rad'
    assert share == pytest.approx(np.mean(np.abs(Q) >= top))
    assert any(f'stands at exactly -{top:.4g} and {top:.4g} rad' in line
               for line in log.bag_accounts.of_clocks())
    assert np.abs(log.q).max() < top + 1e-6
    np.testing.assert_allclose(identified(log), (INERTIA, COULOMB, VISCOUS), rtol=0.02)


def test_par4_bag_says_what_is_clipped_of_a_log_with_positions():
    top = 0.8 * np.abs(QD).max()
    stamp = np.arange(len(T)) * 1_000_000
    said = Measured('revolute', stamp, {
        'position': np.clip(Q, -1.0, 9.0)[:, None], 'velocity': np.clip(QD, -top, top)[:, None],
        'torque': TAU[:, None]}, len(T), 0).findings()
    assert any('position of joint 0: stands at exactly -1 rad' in line
               and 'the tools leave these rows out' in line for line in said)
    assert any('velocity of joint 0: stands at exactly' in line
               and 'the recorded position rules' in line for line in said)


def torque_at_rests(qd):
    """Return the torque of moves (n,): what friction holds in a rest fades, as springs let it."""
    tau = torque_of(qd, np.gradient(qd, 1e-3), 0.1)
    for first, last in stretches(np.abs(qd) < 1e-9):
        tau[first:last] += 0.3 * tau[max(first - 1, 0)] * np.exp(-1e-2 * np.arange(last - first))
    return tau


@pytest.mark.parametrize('jerk', [0.0, 0.05])
@pytest.mark.parametrize('count', [COUNT, 6.0 * COUNT, 20.0 * COUNT])
@pytest.mark.parametrize('amax', [5.0, 50.0, 500.0])
def test_positions_of_a_rest_are_not_clipped(jerk, count, amax):
    """Behind a coarse encoder a rest begins and ends with a slope."""
    q, qd = moves(amax, 1.0, 1.0, 0.4, jerk)
    assert not clipped(np.round(q / count) * count, torque_at_rests(qd)).any()


def test_positions_against_a_mechanical_stop_are_not_clipped():
    """A stop ends a motion at once, and the drive pushes against it; a joint leaves it slowly."""
    q, qd = moves(5.0, 1.0, 1.0, 0.4)
    stop, tau = 0.95, torque_at_rests(qd)
    for first, last in stretches(q > stop):
        tau[first:last] += np.linspace(20.0, -5.0, last - first)
        leaving = np.arange(min(400, len(q) - last))
        q[last:last + 400] = np.minimum(q[last:last + 400], stop)
        q[last + leaving] = np.maximum(q[last + leaving], stop - 2.5e-6 * leaving ** 2)
    assert not clipped(np.round(np.minimum(q, stop) / COUNT) * COUNT, tau).any()


@pytest.mark.parametrize('jerk', [0.0, 0.05])
@pytest.mark.parametrize('lag', [0, 8])
def test_a_speed_that_is_kept_is_not_clipped(jerk, lag):
    """Speeds in coarse steps stand still to the last digit; the torque tells, also if late."""
    _, qd = moves(5.0, 20.0, 100.0, 0.4, jerk)
    step = 0.1
    tau = np.roll(torque_of(qd, np.gradient(qd, 1e-3), 0.1), lag)
    speed = np.round((qd + 0.02 * np.random.default_rng(5).standard_normal(len(qd))) / step) * step
    assert not clipped(speed, tau).any()
    top = 18.0 * np.sign(qd)
    assert clipped(np.where(np.abs(qd) > 18.0, top, qd), tau).any()
