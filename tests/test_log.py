"""Logs: each disorder of a real bag is mended to the truth, and counted."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from par4_identification.logs.accounts import SHORTEST_SEGMENT
from par4_identification.logs.bag_repair import repair_bag
from par4_identification.logs.jumps import joints_of_recordings, without_turns
from par4_identification.logs.log import Log
from par4_identification.logs.read_log import read_log
from par4_identification.logs.stamps import CROWDED
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.errors import InputError
from par4_kinematics.robot import JOINT_NAMES, Axis, read_robot
from par4_sim.bags.bag_writer import BagWriter

ROBOT = read_robot('reference')
GAIN = np.array(ROBOT.drive_gain)
PERIOD = 1_000_000
START = 1_700_000_000_123_456_789
COUNT = 2000
JOINT = np.arange(4)
TORQUE_CURVATURE = 20 * (2 * np.pi * 0.8) ** 2
"""Largest second derivative of `true_torque`, N m/s2."""


def true_position(stamp) -> np.ndarray:
    """Return q (n, 4) at stamps, ns."""
    t = 1e-9 * (np.asarray(stamp) - START)[:, None]
    return 0.4 * np.sin(2 * np.pi * (0.7 + 0.2 * JOINT) * t + JOINT)


def true_torque(stamp) -> np.ndarray:
    """Return tau (n, 4) at stamps, ns."""
    t = 1e-9 * (np.asarray(stamp) - START)[:, None]
    return 20 * np.sin(2 * np.pi * (0.5 + 0.1 * JOINT) * t - JOINT)


def even(count: int = COUNT, period: int = PERIOD) -> np.ndarray:
    return START + period * np.arange(count)


def write(writer: BagWriter, topic: str, stamp, position=None, effort=None, names=JOINT_NAMES,
          received=None) -> None:
    """Write joint states in this order; `names` is one list or one a message."""
    if received is None:
        received = np.maximum.accumulate(stamp) + np.arange(len(stamp))
    for row in range(len(stamp)):
        writer.write_joint_state(
            topic, stamp[row], names if isinstance(names[0], str) else names[row],
            () if position is None else position[row], effort=() if effort is None else effort[row],
            received=int(received[row]))


def bag(path: Path, stamp, position=None, voltage_stamp=None, voltage=None, received=None,
        voltage_received=None) -> Path:
    """Write a bag of positions and voltages; without other arguments those of the truth."""
    voltage_stamp = stamp if voltage_stamp is None else voltage_stamp
    with BagWriter(path) as writer:
        write(writer, '/joint_states', stamp,
              true_position(stamp) if position is None else position, received=received)
        write(writer, '/amplifier_voltage', voltage_stamp, effort=(
            true_torque(voltage_stamp) / GAIN if voltage is None else voltage),
            received=received if voltage_received is None else voltage_received)
    return path


def stamps_of(log: Log) -> np.ndarray:
    return log.start_stamp + np.rint(1e9 * log.t).astype(np.int64)


def assert_true(log: Log, position_error: float = 0.0, torque_error: float = 0.0) -> None:
    """Check a log against the truth at its own stamps, and that its segments cover it evenly."""
    stamp = stamps_of(log)
    np.testing.assert_allclose(log.q, true_position(stamp), rtol=0, atol=position_error)
    np.testing.assert_allclose(log.tau, true_torque(stamp), rtol=0, atol=torque_error + 1e-13)
    assert [segment.start for segment in log.segments] == [
        0, *[segment.stop for segment in log.segments[:-1]]]
    assert log.segments[-1].stop == len(log.t) == len(log.q) == len(log.tau)
    for segment in log.segments:
        np.testing.assert_allclose(np.diff(log.t[segment]), log.period, rtol=1e-9)
    json.dumps(log.accounts.to_json())


def assert_clean_bits(log: Log) -> None:
    """Check that a log is what the undisturbed bag gives, bit for bit."""
    np.testing.assert_array_equal(log.q, true_position(even()))
    np.testing.assert_array_equal(log.tau, true_torque(even()) / GAIN * GAIN)
    np.testing.assert_allclose(log.t, 1e-9 * PERIOD * np.arange(COUNT), rtol=1e-12)
    assert log.segments == (slice(0, COUNT),)


def test_even_samples_pass_bit_for_bit(tmp_path):
    log = read_log(bag(tmp_path / 'bag', even()), ROBOT)
    assert_clean_bits(log)
    assert log.name == str(tmp_path / 'bag')
    assert log.start_stamp == START
    assert log.period == pytest.approx(1e-3, rel=1e-12)
    assert log.joint_names == JOINT_NAMES
    assert log.accounts.findings() == ()
    assert log.accounts.torque_source == 'amplifier_voltage'
    assert log.reference is None
    assert log.accounts.position.read == log.accounts.torque.read == COUNT
    assert not log.accounts.resampled


def test_period_that_is_no_whole_number_of_nanoseconds_is_even(tmp_path):
    stamp = START + np.rint(1e9 / 3000 * np.arange(COUNT)).astype(np.int64)
    log = read_log(bag(tmp_path / 'bag', stamp), ROBOT)
    np.testing.assert_array_equal(log.q, true_position(stamp))
    assert log.period == pytest.approx(1 / 3000, rel=1e-9)
    assert log.accounts.findings() == ()


def test_shifting_the_clock_changes_nothing(tmp_path):
    generator = np.random.default_rng(1)
    stamp = even() + generator.integers(-PERIOD // 5, PERIOD // 5, COUNT)
    kept = generator.random(COUNT) > 0.02
    kept[700:760] = False
    position, voltage = true_position(stamp), true_torque(stamp) / GAIN
    logs = [read_log(bag(tmp_path / str(shift), stamp[kept] + shift, position[kept],
                         voltage=voltage[kept]), ROBOT)
            for shift in (0, -START + 10**9, 3 * 10**17 + 1)]
    for log in logs[1:]:
        np.testing.assert_array_equal(log.t, logs[0].t)
        np.testing.assert_array_equal(log.q, logs[0].q)
        np.testing.assert_array_equal(log.tau, logs[0].tau)
        assert log.segments == logs[0].segments
        assert log.accounts.position == logs[0].accounts.position
    assert logs[2].start_stamp - logs[0].start_stamp == 3 * 10**17 + 1


def test_jitter_is_resampled_to_the_truth(tmp_path):
    generator = np.random.default_rng(2)
    reach = PERIOD // 5
    stamp = even() + generator.integers(-reach, reach, COUNT)
    log = read_log(bag(tmp_path / 'bag', stamp), ROBOT)
    # The difference of two uniform deviations has sqrt(2/3) of their reach as rms.
    assert log.accounts.position.jitter_rms == pytest.approx(1e-9 * reach * np.sqrt(2 / 3), rel=.05)
    assert log.accounts.resampled
    assert log.period == pytest.approx(1e-3, rel=1e-4)
    assert log.accounts.position.gaps == log.accounts.filled == 0
    assert_true(log, 1e-8, (1.4e-3) ** 2 / 8 * TORQUE_CURVATURE)
    assert any('uneven stamps' in finding for finding in log.accounts.findings())


@pytest.mark.parametrize('own_topic', [False, True])
def test_stamps_that_jitter_beside_even_readings_are_put_back(tmp_path, own_topic):
    generator = np.random.default_rng(6)
    late = np.clip(generator.normal(0.0, 0.15 * PERIOD, COUNT), -0.4 * PERIOD, 0.4 * PERIOD)
    stamp = even() + late.astype(np.int64)
    kept = generator.random(COUNT) > 0.04
    kept[1000:1040] = False
    log = read_log(bag(
        tmp_path / 'bag', stamp[kept], true_position(even())[kept],
        even() if own_topic else stamp[kept],
        true_torque(even() if own_topic else even()[kept]) / GAIN), ROBOT)
    assert log.accounts.jitter == pytest.approx(0.15e-3, rel=0.05)
    assert not log.accounts.resampled
    assert any('put back every 1 ms' in finding for finding in log.accounts.findings())
    # the end of a line through n stamps has a deviation of two over the root of n of theirs
    moved = 3.0 * 2.0 / np.sqrt(900.0) * 0.15e-3
    slope, torque_slope = (np.abs(np.diff(true(even()), axis=0)).max() / 1e-3
                           for true in (true_position, true_torque))
    assert_true(log, slope * moved, torque_slope * moved + (4e-3) ** 2 / 8 * TORQUE_CURVATURE)


def test_samples_that_a_logger_filled_in_are_no_samples(tmp_path):
    generator = np.random.default_rng(8)
    measured = generator.random(COUNT) > 0.05
    measured[[0, 700, 701, 702, -1]] = True, False, False, False, True
    stamp = even()
    noise = generator.normal(0.0, 0.05, (COUNT, 4))
    position, torque = (np.stack([np.interp(stamp - START, stamp[measured] - START, own[measured])
                                  for own in values.T], axis=1)
                        for values in (true_position(stamp), true_torque(stamp) + noise))
    log = read_log(bag(tmp_path / 'bag', stamp, position, voltage=torque / GAIN), ROBOT)
    assert log.accounts.interpolated == np.count_nonzero(~measured)
    assert any('filled them in' in finding for finding in log.accounts.findings())
    assert len(log.t) == COUNT
    np.testing.assert_allclose(log.q, true_position(stamp), rtol=0, atol=1e-8)
    np.testing.assert_array_equal(log.q[measured], position[measured])


def test_a_slow_log_on_a_finer_grid_keeps_its_own_samples(tmp_path):
    slow = even(COUNT // 4, 4 * PERIOD)
    stamp = even(4 * len(slow) - 3)
    position, torque = (np.stack([np.interp(stamp - START, slow - START, own)
                                  for own in values.T], axis=1)
                        for values in (true_position(slow), true_torque(slow)))
    log = read_log(bag(tmp_path / 'bag', stamp, position, voltage=torque / GAIN), ROBOT)
    assert log.accounts.interpolated == 3 * (len(slow) - 1)
    assert log.period == pytest.approx(4e-3)
    np.testing.assert_array_equal(log.q, position[::4])


def test_readings_in_steps_are_on_a_line_by_chance(tmp_path):
    stamp = even()
    count, step = 2.0 * np.pi / 4096, 0.4
    position, torque = (np.round(values / size) * size for values, size in (
        (true_position(stamp), count), (true_torque(stamp), step)))
    log = read_log(bag(tmp_path / 'bag', stamp, position, voltage=torque / GAIN), ROBOT)
    assert log.accounts.interpolated == 0
    np.testing.assert_array_equal(log.q, position)


def test_readings_of_a_machine_at_rest_tell_nothing_of_stamps(tmp_path):
    generator = np.random.default_rng(7)
    stamp = even() + generator.integers(-PERIOD // 5, PERIOD // 5, COUNT)
    rest = np.tile(true_position(even())[:1], (COUNT, 1))
    log = read_log(bag(tmp_path / 'bag', stamp, rest, voltage=true_torque(stamp) / GAIN), ROBOT)
    assert log.accounts.jitter == 0.0
    assert log.accounts.resampled


def test_deviations_of_a_thousandth_are_no_jitter(tmp_path):
    generator = np.random.default_rng(3)
    stamp = even() + generator.integers(-PERIOD // 3000, PERIOD // 3000, COUNT)
    log = read_log(bag(tmp_path / 'bag', stamp, true_position(even()),
                       voltage=true_torque(even()) / GAIN), ROBOT)
    np.testing.assert_array_equal(log.q, true_position(even()))
    assert not log.accounts.resampled


def test_short_gaps_are_filled(tmp_path):
    kept = np.ones(COUNT, dtype=bool)
    lost = [300, 500, 501, 900, 901, 902]
    kept[lost] = False
    log = read_log(bag(tmp_path / 'bag', even()[kept]), ROBOT)
    assert_true(log, 1e-8, (4e-3) ** 2 / 8 * TORQUE_CURVATURE)
    np.testing.assert_array_equal(log.q[kept], true_position(even())[kept])
    np.testing.assert_array_equal(log.tau[kept], (true_torque(even()) / GAIN * GAIN)[kept])
    accounts = log.accounts
    assert (accounts.filled, accounts.position.gaps, accounts.position.lost) == (6, 3, 6)
    assert accounts.torque.lost == 6
    assert accounts.position.longest_gap == pytest.approx(4e-3)
    assert log.segments == (slice(0, COUNT),)


def test_long_gaps_cut_the_log(tmp_path):
    kept = np.ones(COUNT, dtype=bool)
    kept[600:650] = False
    kept[1200:1204] = False
    log = read_log(bag(tmp_path / 'bag', even()[kept]), ROBOT)
    assert_true(log)
    np.testing.assert_array_equal(stamps_of(log), even()[kept])
    assert log.segments == (slice(0, 600), slice(600, 1150), slice(1150, COUNT - 54))
    accounts = log.accounts
    assert (accounts.filled, accounts.position.gaps, accounts.position.lost) == (0, 2, 54)
    assert accounts.position.longest_gap == pytest.approx(51e-3)
    assert accounts.segments == 3


def test_a_pause_of_any_length_keeps_both_sides(tmp_path):
    stamp = even()
    stamp[1000:] += 3_141_592_653
    log = read_log(bag(tmp_path / 'bag', stamp), ROBOT)
    assert_true(log)
    assert log.segments == (slice(0, 1000), slice(1000, COUNT))
    assert log.t[1000] - log.t[999] == pytest.approx(3.142592653, abs=1e-9)
    assert not log.accounts.resampled


def test_shreds_between_gaps_are_dropped_and_counted(tmp_path):
    kept = np.ones(COUNT, dtype=bool)
    kept[500:510] = kept[510 + SHORTEST_SEGMENT - 1:600] = False
    log = read_log(bag(tmp_path / 'bag', even()[kept]), ROBOT)
    assert_true(log)
    assert log.accounts.short_segments == SHORTEST_SEGMENT - 1
    assert log.segments == (slice(0, 500), slice(500, COUNT - 100))


def test_repeated_samples_are_dropped(tmp_path):
    order = np.sort(np.r_[np.arange(COUNT), [5, 5, 700, 1500]])
    # One more comes again ten samples later.
    order = np.insert(order, 1000, order[990])
    # And a whole block: no clock was set back, for the values are the same.
    order = np.insert(order, 1800, order[1750:1790])
    log = read_log(bag(tmp_path / 'bag', even()[order]), ROBOT)
    assert_clean_bits(log)
    assert log.accounts.clock_resets == 0
    for counts in (log.accounts.position, log.accounts.torque):
        assert (counts.repeated, counts.conflicting, counts.out_of_order) == (45, 0, 0)
        assert (counts.gaps, counts.jitter_rms, counts.crowded) == (0, 0, 0)


def test_samples_out_of_order_are_sorted(tmp_path):
    order = np.arange(COUNT)
    order[[100, 101]] = order[[101, 100]]
    order[[400, 401, 402, 403, 404]] = order[[404, 400, 401, 402, 403]]  # one too early
    order[[800, 801, 802, 803]] = order[[801, 802, 803, 800]]  # one too late
    log = read_log(bag(tmp_path / 'bag', even()[order]), ROBOT)
    assert_clean_bits(log)
    assert log.accounts.position.out_of_order == log.accounts.torque.out_of_order == 1 + 4 + 1
    assert log.accounts.clock_resets == 0


def test_shuffled_windows_are_no_clock_reset(tmp_path):
    generator = np.random.default_rng(4)
    order = np.concatenate([start + generator.permutation(8) for start in range(0, COUNT, 8)])
    log = read_log(bag(tmp_path / 'bag', even()[order]), ROBOT)
    assert_clean_bits(log)
    assert log.accounts.clock_resets == 0
    newest = np.maximum.accumulate(order)
    assert log.accounts.position.out_of_order == np.count_nonzero(order < newest)


def test_contradictions_are_dropped_or_refused(tmp_path):
    def doubled(every: int) -> tuple[np.ndarray, np.ndarray]:
        order = np.sort(np.r_[np.arange(COUNT), np.arange(7, COUNT, every)])
        position = true_position(even()[order])
        position[np.r_[False, np.diff(order) == 0]] += 1.0
        return even()[order], position

    stamp, position = doubled(100)
    log = read_log(bag(tmp_path / 'few', stamp, position, voltage_stamp=even()), ROBOT)
    assert_clean_bits(log)
    assert log.accounts.position.conflicting == 20
    stamp, position = doubled(10)
    with pytest.raises(InputError, match='200 of 2200 samples on /joint_states have the stamp'):
        read_log(bag(tmp_path / 'many', stamp, position, voltage_stamp=even()), ROBOT)


def test_samples_too_close_for_a_spline_are_dropped(tmp_path):
    stamp = np.sort(np.r_[even(), even()[[250, 750]] + round(0.6 * CROWDED * PERIOD)])
    position = true_position(stamp)
    position[[251, 752]] += 1e-4  # encoder noise over so short a time is a wild speed
    log = read_log(bag(tmp_path / 'bag', stamp, position), ROBOT)
    assert log.accounts.position.crowded == log.accounts.torque.crowded == 2
    assert_clean_bits(log)


@pytest.mark.parametrize('ratio', [2, 5, 10])
def test_slower_torque_is_interpolated(tmp_path, ratio):
    coarse = even()[::ratio]
    log = read_log(bag(tmp_path / 'bag', even(), voltage_stamp=coarse), ROBOT)
    assert_true(log, 0.0, (1e-9 * PERIOD * ratio) ** 2 / 8 * TORQUE_CURVATURE)
    inside = slice(6 * ratio, -6 * ratio)
    bend = (1e-9 * PERIOD * ratio) ** 2 / 8 * TORQUE_CURVATURE  # what straight lines miss
    assert np.abs(log.tau - true_torque(even()[:len(log.t)]))[inside].max() < 0.02 * bend
    at_stamps = np.arange(0, len(log.t), ratio)
    np.testing.assert_array_equal(log.tau[at_stamps], true_torque(coarse) / GAIN * GAIN)
    assert log.accounts.without_torque == ratio - 1
    assert log.accounts.torque.period == pytest.approx(1e-3 * ratio)


def test_faster_torque_is_taken_where_positions_are(tmp_path):
    fine = even(4 * COUNT, PERIOD // 4)
    assert_clean_bits(read_log(bag(tmp_path / 'bag', even(), voltage_stamp=fine), ROBOT))


def test_torque_between_the_positions_is_interpolated(tmp_path):
    between = even(COUNT + 1) - PERIOD // 2
    log = read_log(bag(tmp_path / 'bag', even(), voltage_stamp=between), ROBOT)
    assert_true(log, 0.0, (1e-9 * PERIOD) ** 2 / 8 * TORQUE_CURVATURE)
    assert len(log.t) == COUNT


def test_no_torque_is_made_up_in_its_gaps(tmp_path):
    kept = np.ones(COUNT, dtype=bool)
    kept[800:900] = kept[1990:] = False
    kept[1500:1502] = False
    log = read_log(bag(tmp_path / 'bag', even(), voltage_stamp=even()[kept]), ROBOT)
    assert_true(log, 0.0, (3e-3) ** 2 / 8 * TORQUE_CURVATURE)
    assert log.segments == (slice(0, 800), slice(800, 1890))
    assert log.accounts.without_torque == 110
    assert (log.accounts.torque.gaps, log.accounts.torque.lost) == (2, 102)
    assert log.accounts.position.gaps == 0


def test_joints_are_found_by_name_in_any_order(tmp_path):
    generator = np.random.default_rng(5)
    names = (*JOINT_NAMES, 'passive_1', 'gripper')
    orders = [generator.permutation(6) for _ in range(COUNT)]
    shuffled = [[names[index] for index in order] for order in orders]
    values = np.hstack([true_position(even()), generator.normal(size=(COUNT, 2))])
    with BagWriter(tmp_path / 'bag') as writer:
        write(writer, '/joint_states', even(),
              [row[order] for row, order in zip(values, orders, strict=True)], names=shuffled)
        write(writer, '/amplifier_voltage', even(), effort=(true_torque(even()) / GAIN)[:, ::-1],
              names=JOINT_NAMES[::-1])
    log = read_log(tmp_path / 'bag', ROBOT)
    assert_clean_bits(log)
    in_order = sum((np.diff([list(order).index(joint) for joint in range(4)]) > 0).all()
                   for order in orders)
    assert log.accounts.reordered == COUNT - in_order
    assert log.accounts.ignored_joints == ('gripper', 'passive_1')


def test_messages_without_all_joints_are_counted_apart(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        write(writer, '/joint_states', even(), true_position(even()),
              received=even())
        write(writer, '/joint_states', even(30), np.ones((30, 2)), names=('wheel_1', 'wheel_2'))
        write(writer, '/joint_states', even(7) + PERIOD // 2, np.ones((7, 2)),
              names=('arm_joint_0', 'arm_joint_2'))
        write(writer, '/amplifier_voltage', even(), effort=true_torque(even()) / GAIN)
    log = read_log(tmp_path / 'bag', ROBOT)
    assert_clean_bits(log)
    assert log.accounts.position.other_joints == 30
    assert log.accounts.position.incomplete == 7
    assert log.accounts.position.not_finite == 0
    assert log.accounts.position.read == COUNT + 37


def test_messages_that_name_a_joint_twice_are_counted_and_not_used(tmp_path):
    """Nothing says which of two positions of a joint is the true one."""
    position = np.hstack([true_position(even()), true_position(even())[:, 3:]])
    doubled = (*JOINT_NAMES, 'arm_joint_0')
    rows = {300, 700, 701}
    plain = [row not in rows for row in range(COUNT)]
    with BagWriter(tmp_path / 'bag') as writer:
        write(writer, '/joint_states', even(), [
            row[:4] if keep else row[::-1] for row, keep in zip(position, plain, strict=True)],
            names=[JOINT_NAMES if keep else doubled[::-1] for keep in plain])
        write(writer, '/amplifier_voltage', even(), effort=true_torque(even()) / GAIN)
    log = read_log(tmp_path / 'bag', ROBOT)
    assert_true(log, 1e-8)
    assert (log.accounts.position.named_twice, log.accounts.position.incomplete) == (3, 0)
    assert 'positions: 3 of 2000 samples name a joint more than once, dropped' in (
        log.accounts.findings())
    with BagWriter(tmp_path / 'all') as writer:
        write(writer, '/joint_states', even(), position, names=doubled)
        write(writer, '/amplifier_voltage', even(), effort=true_torque(even()) / GAIN)
    with pytest.raises(InputError, match='every message on /joint_states names arm_joint_0 more '
                                         'than once, .* which position counts; give each joint'):
        read_log(tmp_path / 'all', ROBOT)


def test_other_joints_may_be_named_twice(tmp_path):
    position = np.hstack([true_position(even()), np.zeros((COUNT, 2))])
    with BagWriter(tmp_path / 'bag') as writer:
        write(writer, '/joint_states', even(), position, names=(*JOINT_NAMES, 'gripper', 'gripper'))
        write(writer, '/amplifier_voltage', even(), effort=true_torque(even()) / GAIN)
    assert_clean_bits(read_log(tmp_path / 'bag', ROBOT))


def test_missing_joints_are_named(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        write(writer, '/joint_states', even(200), true_position(even(200))[:, :3],
              names=('arm_joint_0', 'axis_1', 'arm_joint_2'))
    with pytest.raises(InputError, match=r'has no position of arm_joint_1, arm_joint_3, .*'
                                         r'/joint_states holds arm_joint_0, arm_joint_2, axis_1; '
                                         r'give the robot file of this machine by --robot, or '):
        read_log(tmp_path / 'bag', ROBOT)
    with BagWriter(tmp_path / 'torque') as writer:
        write(writer, '/joint_states', even(200), true_position(even(200)))
        write(writer, '/amplifier_voltage', even(200), effort=np.ones((200, 1)), names=('motor',))
    with pytest.raises(InputError, match=r'no voltage of arm_joint_0, .*/amplifier_voltage '
                                         r'holds motor'):
        read_log(tmp_path / 'torque', ROBOT)


def test_nan_is_dropped_and_filled(tmp_path):
    position, voltage = true_position(even()), true_torque(even()) / GAIN
    position[[300, 700]] = np.nan
    position[900, 2] = np.inf
    position[1200:1240, 1] = np.nan
    voltage[1600, 3] = np.nan
    log = read_log(bag(tmp_path / 'bag', even(), position, voltage=voltage), ROBOT)
    assert_true(log, 1e-8, (2e-3) ** 2 / 8 * TORQUE_CURVATURE)
    assert (log.accounts.position.not_finite, log.accounts.torque.not_finite) == (43, 1)
    assert log.accounts.filled == 3
    assert log.segments == (slice(0, 1200), slice(1200, COUNT - 40))
    # Samples came; none of them was lost.
    assert log.accounts.position.lost == log.accounts.torque.lost == 0


def test_effort_is_used_without_voltage(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        write(writer, '/joint_states', even(), true_position(even()), true_torque(even()))
    log = read_log(tmp_path / 'bag', ROBOT)
    np.testing.assert_array_equal(log.tau, true_torque(even()))
    assert log.accounts.torque_source == 'effort'
    assert log.accounts.torque_disagreement is None


@pytest.mark.parametrize('factor', [1.0, 1.005, 0.8])
def test_voltage_rules_and_disagreement_is_reported(tmp_path, factor):
    effort = true_torque(even()) * np.array([1, 1, factor, 1])
    with BagWriter(tmp_path / 'bag') as writer:
        write(writer, '/joint_states', even(), true_position(even()), effort)
        write(writer, '/amplifier_voltage', even(), effort=true_torque(even()) / GAIN)
    log = read_log(tmp_path / 'bag', ROBOT)
    assert_clean_bits(log)
    assert log.accounts.torque_source == 'amplifier_voltage'
    np.testing.assert_allclose(log.accounts.torque_disagreement,
                               [0, 0, abs(1 - factor) / max(1, factor), 0], atol=1e-12)
    reported = [finding for finding in log.accounts.findings() if 'disagree' in finding]
    assert len(reported) == (factor == 0.8)


def test_effort_of_nan_is_no_effort(tmp_path):
    nothing = np.full((COUNT, 4), np.nan)
    with BagWriter(tmp_path / 'both') as writer:
        write(writer, '/joint_states', even(), true_position(even()), nothing)
        write(writer, '/amplifier_voltage', even(), effort=true_torque(even()) / GAIN)
    log = read_log(tmp_path / 'both', ROBOT)
    assert_clean_bits(log)
    assert log.accounts.torque_disagreement is None
    with BagWriter(tmp_path / 'none') as writer:
        write(writer, '/joint_states', even(), true_position(even()), nothing)
    with pytest.raises(InputError, match='no torque, neither amplifier_voltage nor effort'):
        read_log(tmp_path / 'none', ROBOT)


def test_positions_are_needed(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        write(writer, '/joint_states', even(), effort=true_torque(even()))
    with pytest.raises(InputError, match='/joint_states carries no position of arm_joint_0, '):
        read_log(tmp_path / 'bag', ROBOT)


def test_a_topic_on_another_clock_is_moved_by_its_receipt(tmp_path):
    """Ten hours apart, received within a millisecond of each other."""
    shift = 36_000 * 10 ** 9
    stamp = even()
    path = bag(tmp_path / 'bag', stamp, voltage_stamp=stamp + shift, voltage=true_torque(stamp)
               / GAIN, received=stamp + 10 ** 6, voltage_received=stamp + 10 ** 6)
    log = read_log(path, ROBOT)
    assert_true(log)
    assert log.accounts.clock_offset == pytest.approx(-36_000.0, abs=1e-3)
    assert any('another clock' in finding for finding in log.accounts.findings())


@pytest.mark.parametrize('rate', [4, 10, 16, 25, 40])
def test_a_machine_that_is_read_slowly_is_one_machine(rate, tmp_path):
    """It swings from sample to sample; to leave some of them out made the rate another one."""
    stamp = even(30 * rate, 1_000_000_000 // rate)
    position = sum(true_position(START + share * (stamp - START)) for share in (1, 3, 5, 7))
    log = read_log(bag(tmp_path / 'bag', stamp, position), ROBOT)
    assert len(log.t) == len(stamp)
    assert log.accounts.findings() == ()
    with pytest.raises(InputError, match=f'recorded at {rate}.0 Hz; at least 50 Hz are needed'):
        runs_of_log(log, ROBOT)


@pytest.mark.parametrize('period', [PERIOD // 2, 100 * PERIOD])
def test_two_machines_on_one_topic_are_told(period, tmp_path):
    stamp = even(2 * COUNT, period)
    position = true_position(even(2 * COUNT, PERIOD // 2))
    position[1::2] += 0.5
    with pytest.raises(InputError, match='jump to and fro .*two machines'):
        read_log(bag(tmp_path / 'bag', stamp, position), ROBOT)


def test_a_coarse_potentiometer_that_trembles_is_one_machine(tmp_path):
    stamp, count = even(), np.radians(1.0)
    noise = 0.4 * count * np.random.default_rng(0).standard_normal((len(stamp), 4))
    position = count * np.round((true_position(stamp) + noise) / count)
    assert len(read_log(bag(tmp_path / 'bag', stamp, position), ROBOT).t) == len(stamp)


def test_too_few_samples_are_refused(tmp_path):
    read_log(bag(tmp_path / 'enough', even(20)), ROBOT)
    for name, stamp, voltage_stamp in (
            ('short', even(19), even(19)), ('shreds', even(400)[np.arange(400) % 30 < 15], even()),
            ('no_overlap', even(), even() + 10**11), ('single', even(1), even())):
        with pytest.raises(InputError, match='usable samples') as refusal:
            read_log(bag(tmp_path / name, stamp, voltage_stamp=voltage_stamp), ROBOT)
        assert '\n' not in str(refusal.value)


def test_cut_off_bag_is_refused_and_read_after_repair(tmp_path):
    path = bag(tmp_path / 'bag', even())
    file = path / 'bag.mcap'
    file.write_bytes(file.read_bytes()[:file.stat().st_size // 3])
    with pytest.raises(InputError, match=f'par4_record --repair {path}'):
        read_log(path, ROBOT)
    repair_bag(path, tmp_path / 'no_torque')
    with pytest.raises(InputError, match='no torque'):
        read_log(tmp_path / 'no_torque', ROBOT)
    # Messages of both topics in the order of time, as they are recorded.
    with BagWriter(tmp_path / 'mixed') as writer:
        for index, stamp in enumerate(even()):
            write(writer, '/joint_states', [stamp], true_position([stamp]), received=[index])
            write(writer, '/amplifier_voltage', [stamp], effort=true_torque([stamp]) / GAIN,
                  received=[index])
    file = tmp_path / 'mixed' / 'mixed.mcap'
    file.write_bytes(file.read_bytes()[:file.stat().st_size // 2])
    summary = repair_bag(tmp_path / 'mixed', tmp_path / 'mended')
    log = read_log(tmp_path / 'mended', ROBOT)
    assert_true(log)
    assert len(log.t) == summary.messages['/amplifier_voltage'] > COUNT / 3


def test_namespaces_and_extra_topics(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        for space, sign in (('/left', 1), ('/right', -1)):
            write(writer, f'{space}/joint_states', even(), sign * true_position(even()))
            write(writer, f'{space}/amplifier_voltage', even(),
                  effort=sign * true_torque(even()) / GAIN)
    assert_clean_bits(read_log(tmp_path / 'bag', ROBOT, 'left'))
    log = read_log(tmp_path / 'bag', ROBOT, '/right')
    np.testing.assert_array_equal(log.q, -true_position(even()))
    assert log.accounts.namespace == '/right'
    assert set(log.accounts.ignored_topics) == {'/left/joint_states', '/left/amplifier_voltage'}
    with pytest.raises(InputError, match='under /left, /right'):
        read_log(tmp_path / 'bag', ROBOT)


@pytest.mark.parametrize('back', [0.02, 0.3, 0.9, 2.0, 40.0])
@pytest.mark.parametrize('late', [0, 3])
def test_clock_set_back_cuts_the_log(tmp_path, back, late):
    stamp = even()
    stamp[1000:] -= round(1e9 * back)
    # Values follow the wall clock; the voltages of the old clock still arrive after the reset.
    position, torque = true_position(even()), true_torque(even())
    log = read_log(bag(tmp_path / 'bag', stamp, position, voltage=torque / GAIN, received=even(),
                       voltage_received=even() + late * PERIOD + 1), ROBOT)
    np.testing.assert_array_equal(log.q, position)
    np.testing.assert_array_equal(log.tau, torque / GAIN * GAIN)
    assert log.segments == (slice(0, 1000), slice(1000, COUNT))
    assert (np.diff(log.t) > 0).all()
    accounts = log.accounts
    assert accounts.clock_resets == 1
    assert accounts.position.gaps == accounts.torque.gaps == 0
    assert accounts.position.out_of_order == accounts.torque.out_of_order == 0
    assert any('set back' in finding for finding in accounts.findings())


def test_slow_torque_is_not_interpolated_across_a_reset(tmp_path):
    stamp, coarse = even(), even()[::20]
    voltage = true_torque(coarse) / GAIN
    voltage[coarse >= stamp[1010]] *= -1  # nothing in between is right
    position = true_position(stamp)
    log = read_log(bag(tmp_path / 'bag', stamp - 10**10 * (stamp >= stamp[1010]), position, coarse -
                       10**10 * (coarse >= stamp[1010]), voltage, received=stamp,
                       voltage_received=coarse + 1), ROBOT)
    assert log.accounts.clock_resets == 1
    # From the last voltage before the reset to the first after it there is none.
    kept = np.r_[0:1001, 1020:1981]
    np.testing.assert_array_equal(log.q, position[kept])
    sign = np.where(kept < 1010, 1, -1)[:, None]
    np.testing.assert_allclose(log.tau, sign * true_torque(stamp[kept]), rtol=0,
                               atol=(20e-3) ** 2 / 8 * TORQUE_CURVATURE)


def test_clock_set_back_twice_to_zero(tmp_path):
    run = PERIOD * np.arange(400)
    stamp = np.r_[run[:300] + 5 * 10**9, run, run]
    position = true_position(even(len(stamp)))
    voltage = true_torque(even(len(stamp))) / GAIN
    log = read_log(bag(tmp_path / 'bag', stamp, position, voltage=voltage,
                       received=even(len(stamp))), ROBOT)
    np.testing.assert_array_equal(log.q, position)
    assert log.segments == (slice(0, 300), slice(300, 700), slice(700, 1100))
    assert log.accounts.clock_resets == 2
    assert log.accounts.position.not_stamped == 0


def test_messages_without_stamp(tmp_path):
    stamp = even()
    stamp[[50, 51, 400]] = 0
    log = read_log(bag(tmp_path / 'few', stamp, true_position(even()),
                       voltage=true_torque(even()) / GAIN, received=even()), ROBOT)
    assert_true(log, 1e-8, (3e-3) ** 2 / 8 * TORQUE_CURVATURE)
    assert log.accounts.position.not_stamped == log.accounts.torque.not_stamped == 3
    assert log.accounts.clock_resets == 0
    with pytest.raises(InputError, match='no message on /joint_states has a header stamp'):
        read_log(bag(tmp_path / 'all', np.zeros(COUNT, dtype=int), true_position(even()),
                     voltage_stamp=even(), received=even()), ROBOT)


def test_everything_at_once(tmp_path):
    generator = np.random.default_rng(6)
    stamp = even() + generator.integers(-PERIOD // 5, PERIOD // 5, COUNT)
    order = np.flatnonzero(generator.random(COUNT) > 0.01)
    order = order[(order < 900) | (order > 950)]
    order = np.sort(np.r_[order, generator.choice(order, 30)])
    swap = np.arange(10, len(order) - 10, 97)
    order[swap], order[swap + 1] = order[swap + 1], order[swap].copy()
    position = true_position(stamp[order])
    holes = generator.choice(len(order), 15, replace=False)
    position[holes, generator.integers(0, 4, 15)] = np.nan
    coarse = even(COUNT // 2, 2 * PERIOD) + generator.integers(-PERIOD // 5, PERIOD // 5, 1000)
    log = read_log(bag(tmp_path / 'bag', stamp[order], position, voltage_stamp=coarse), ROBOT)
    assert_true(log, 1e-7, (2.5e-3) ** 2 / 8 * TORQUE_CURVATURE)
    assert len(log.segments) == 2
    assert len(log.t) > COUNT - 60
    assert log.accounts.position.repeated >= 20
    assert log.accounts.position.not_finite > 0


def reference_bag(path: Path, *messages, names=JOINT_NAMES) -> Path:
    """Write a measured bag with references (stamp, received, first and last point in ms)."""
    with BagWriter(path) as writer:
        write(writer, '/joint_states', even(), true_position(even()), true_torque(even()))
        for stamp, received, first, last in messages:
            after = PERIOD * np.arange(first, last)
            wanted = true_position((stamp or START) + after)[:, :len(names)]
            writer.write_trajectory('/reference', stamp, names, after, wanted, 2 * wanted,
                                    3 * wanted, received=received)
    return path


def test_reference_is_read_by_name_and_replaced_by_later_messages(tmp_path):
    path = reference_bag(tmp_path / 'bag', (START, START, 0, 500),
                         (START + 300 * PERIOD, START + 250 * PERIOD, 0, 400),
                         (START + 600 * PERIOD, START + 550 * PERIOD, 0, 10))
    reference = read_log(path, ROBOT).reference
    np.testing.assert_allclose(reference.t, 1e-3 * np.arange(610), atol=1e-12)
    wanted = true_position(even(610))
    np.testing.assert_array_equal(reference.q, wanted)
    np.testing.assert_array_equal(reference.qd, 2 * wanted)
    np.testing.assert_array_equal(reference.qdd, 3 * wanted)


def test_reference_without_stamp_starts_after_receipt(tmp_path):
    received = START + 700 * PERIOD
    log = read_log(reference_bag(tmp_path / 'bag', (0, received, 0, 50)), ROBOT)
    np.testing.assert_allclose(log.reference.t, 0.7 + 0.2 + 1e-3 * np.arange(50), atol=2e-6)


def test_unusable_reference_is_ignored_aloud(tmp_path):
    log = read_log(reference_bag(tmp_path / 'bag', (START, START, 0, 50), names=JOINT_NAMES[:2]),
                   ROBOT)
    assert log.reference is None
    assert 'reference ignored: /reference lacks arm_joint_2, arm_joint_3' in log.accounts.findings()
    assert_true(log)


def test_single_axis(tmp_path):
    axis = Axis(schema='par4/axis/1', name='slide', joint='carriage', kind='linear', gain=35.15)
    with BagWriter(tmp_path / 'bag') as writer:
        write(writer, '/joint_states', even(), true_position(even())[:, :1], names=('carriage',))
        write(writer, '/amplifier_voltage', even(), effort=true_torque(even())[:, :1],
              names=('carriage',))
    log = read_log(tmp_path / 'bag', axis)
    np.testing.assert_array_equal(log.q, true_position(even())[:, :1])
    np.testing.assert_array_equal(log.tau, 35.15 * true_torque(even())[:, :1])


def test_a_log_that_begins_or_ends_in_a_quick_motion_is_not_cut():
    """A motor that dashes off: no step is like the median of those around it. Counts a sample."""
    start = np.array((0.8, 9.7, 26.4, 40.6, 49.9, 57.2, 69.2, 82.0, 88.9, 108.6, 130.5, 134.1))
    dash = np.concatenate((start, np.linspace(134.0, 1.0, 60)))
    steps = np.concatenate((dash, np.full(20000, 1.0), dash[::-1]))
    q = np.concatenate(([0.0], np.cumsum(steps)))[:, None] * 2.0 * np.pi / 8192.0
    width = np.ones(len(steps))
    assert len(joints_of_recordings(q, width)) == 0
    assert len(joints_of_recordings(q[::-1], width)) == 0
    for row in (0, 2, len(q) - 1, len(q) - 2):
        wrong = q.copy()
        wrong[row] += 0.7
        cuts = joints_of_recordings(wrong, width)
        assert {row, row + 1} & set(cuts.tolist())


@pytest.mark.parametrize('jitter', [0, 20_000])
def test_two_recordings_joined_without_a_gap_are_cut_where_positions_jump(tmp_path, jitter):
    """Nothing is filtered across the joint, and no encoder is said to have slipped there."""
    stamp = even() + np.random.default_rng(1).integers(-jitter, jitter + 1, COUNT)
    later = even() + 3_700 * PERIOD * (np.arange(COUNT) >= 1200)
    log = read_log(bag(tmp_path / 'joined', stamp, true_position(later), voltage=true_torque(
        later) / GAIN), ROBOT)
    assert [segment.stop - segment.start for segment in log.segments] == [
        pytest.approx(1200, abs=2), pytest.approx(800, abs=2)]
    said, = log.bag_accounts.of_clocks()
    assert 'jump within a sample at 1.2 s' in said
    nearest = np.searchsorted(stamp, stamps_of(log) - PERIOD // 2).clip(0, COUNT - 1)
    true = true_position(later)[nearest]
    assert np.abs(log.q - true).max() < 0.01


@pytest.mark.parametrize('case', ['a slip', 'a spike of all', 'held', 'a quick motion'])
def test_what_is_no_joint_of_recordings_does_not_cut_the_log(tmp_path, case):
    stamp = even()
    position, torque = true_position(stamp), true_torque(stamp)
    if case == 'a slip':
        position[900:, 1] += 0.05
    elif case == 'a spike of all':
        position[900:902] += 0.3
    elif case == 'held':
        position[900:930], torque[900:930] = position[900], torque[900]
    else:  # after a long rest in which readings flicker
        share = np.clip((stamp[:, None] - stamp[1500]) / (7.0 * PERIOD), 0.0, 1.0)
        position = (position[:1] + 0.1 * np.sin(0.5 * np.pi * share) ** 2
                    + 1e-5 * np.random.default_rng(2).integers(0, 2, position.shape))
    log = read_log(bag(tmp_path / 'bag', stamp, position, voltage=torque / GAIN), ROBOT)
    assert len(log.segments) == 1
    assert log.bag_accounts.jumps == ()
    assert len(log.t) == COUNT


def test_a_sample_of_elsewhere_at_the_beginning_is_cut_off(tmp_path):
    """As where a clock that was set back gives one sample the stamp of the first one."""
    stamp = even()
    position = true_position(stamp)
    position[0] += 0.4
    log = read_log(bag(tmp_path / 'bag', stamp, position), ROBOT)
    assert stamps_of(log)[0] == stamp[1]
    assert_true(log)


@pytest.mark.parametrize('turn', [2.0 * np.pi, 360.0])
def test_a_reading_that_wraps_round_is_put_together(tmp_path, turn):
    """No encoder is said to have slipped, and radians beyond half a turn are not degrees."""
    stamp = even()
    position = true_position(stamp) * turn / (2.0 * np.pi)
    wrapped = position.copy()
    wrapped[:, 1] = position[:, 1] % turn
    log = read_log(bag(tmp_path / 'wraps', stamp, wrapped), ROBOT)
    np.testing.assert_allclose(log.q, position, rtol=0, atol=1e-9)
    wraps = np.count_nonzero(np.abs(np.diff(wrapped[:, 1])) > 0.5 * turn)
    assert log.bag_accounts.wraps == {JOINT_NAMES[1]: wraps}
    said, = log.bag_accounts.of_clocks()
    assert f'the position of {JOINT_NAMES[1]} jumps by a whole turn {wraps} times' in said
    assert log.bag_accounts.jumps == ()


@pytest.mark.parametrize('speed', [0.1, 8.0, 100.0, 300.0])
def test_a_reading_that_wraps_round_in_a_fast_turn_is_put_together(speed):
    """Where it turns by a tenth and more from sample to sample, or where a sample is missing."""
    count = np.delete(np.arange(2000), [400, 700, 701, 1500])
    q = speed * np.sin(np.pi * 1e-3 * count)[:, None] * np.array((1.0, 0.5))
    found, often = without_turns(q % (2.0 * np.pi), np.diff(count).astype(float))
    moved = found - q
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0], moved.shape), atol=1e-9 * speed)
    assert often.sum() == np.count_nonzero(np.abs(np.diff(q % (2.0 * np.pi), axis=0)) > np.pi)


def test_numbers_that_no_sensor_tells_are_dropped(tmp_path):
    stamp = even()
    voltage = true_torque(stamp) / GAIN
    voltage[100::400, 2] = 1e300
    log = read_log(bag(tmp_path / 'damaged', stamp, voltage=voltage), ROBOT)
    assert log.bag_accounts.torque.not_finite == 5
    assert_true(log, torque_error=TORQUE_CURVATURE * (1e-9 * PERIOD) ** 2)


def test_a_joint_without_numbers_is_said(tmp_path):
    position = true_position(even())
    position[:, 2] = np.nan
    with pytest.raises(InputError, match='2000 not finite.*record every joint as a number'):
        read_log(bag(tmp_path / 'nan', even(), position), ROBOT)


def test_a_position_that_no_encoder_tells_is_dropped(tmp_path):
    stamp = np.delete(even(), 500)
    position = true_position(stamp)
    position[502, 1] = -1e160
    log = read_log(bag(tmp_path / 'damaged', stamp, position), ROBOT)
    assert log.bag_accounts.position.not_finite == 1
    assert np.abs(log.q).max() < 0.5
