"""Drift from a model: what it acts like, how much, since when; and not on a healthy machine."""

from __future__ import annotations

from collections import Counter
from functools import partial
from threading import Lock
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_joints
from par4_identification.logs.log import Log
from par4_identification.ros.monitor_node import BLIND, STILL, MonitorNode
from par4_identification.trend.drift import WORDS, DriftWatch, projections
from par4_identification.trend.windows import WINDOW
from par4_kinematics.errors import InputError
from par4_kinematics.interface import AMPLIFIER_VOLTAGE, JOINT_STATES, Topic
from par4_kinematics.motion_file import named_motion
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.ros.convert import write_joint_state
from par4_kinematics.ros.diagnostics import OK, WARN, NodeState
from par4_kinematics.stamps import SECOND
from robots import REFERENCE

MODEL = read_model('table1', REFERENCE)
LENGTHS = np.full((4, 4), 10.0)


def window(odd: dict[str, np.ndarray]) -> Log:
    """Return two seconds of motion of a machine whose torque has more than the model's."""
    motion = named_motion('excitation', REFERENCE, 8.0, 3)
    part = slice(4000, 4000 + round(WINDOW * 1000))
    t, q, qd, qdd = (getattr(motion, name)[part] for name in ('t', 'q', 'qd', 'qdd'))
    tau = MODEL.torque(state_of_joints(REFERENCE.geometry, t, q, qd, qdd))
    signals = dict(zip(WORDS, (np.ones_like(qd), np.sign(qd), qd, qdd), strict=True))
    for name, size in odd.items():
        tau = tau + size * signals[name]
    return Log('window', REFERENCE.joint_names, 1, 1e-3, t, q, tau, (slice(0, len(t)),), None, None)


def test_a_model_without_error_leaves_nothing():
    projected, lengths, rms = projections(window({}), REFERENCE, MODEL)
    assert (np.abs(projected) / lengths < 2e-3).all()
    assert (rms < 0.01).all()


@pytest.mark.parametrize('name', WORDS)
def test_what_is_added_to_the_torque_is_what_is_told(name):
    healthy, lengths, _ = projections(window({}), REFERENCE, MODEL)
    size = np.array((0.0, 0.0, 0.05, 0.0))
    projected, _, _ = projections(window({name: size}), REFERENCE, MODEL)
    change = projected - healthy
    kind = list(WORDS).index(name)
    assert change[2, kind] / lengths[2, kind] == pytest.approx(size[2], rel=0.01)
    assert np.argmax(np.abs(change[2])) == kind
    np.testing.assert_allclose(change[[0, 1, 3]], 0.0, atol=1e-9)


def watched(random: np.random.Generator, count: int, watch: DriftWatch,
            shift: np.ndarray | float = 0.0) -> None:
    """Let windows of unit scatter pass, their projections shifted."""
    for _ in range(count):
        watch.take(WINDOW * (watch.windows + 1), random.normal(size=(4, 4)) + shift, LENGTHS)


def test_healthy_windows_do_not_alarm():
    """Five machines for 5.5 hours each."""
    for seed in range(5):
        watch, random = DriftWatch(4), np.random.default_rng(seed)
        watched(random, 10_000, watch)
        assert not watch.drifts


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_drift_is_told_with_joint_kind_size_and_time(sign):
    watch, random = DriftWatch(4), np.random.default_rng(4)
    watched(random, 200, watch)
    shift = np.zeros((4, 4))
    shift[1, 2] = sign * 5.0
    watched(random, 15, watch, shift)
    drift, = watch.drifts
    assert (drift.joint, drift.acts_like) == (1, 'viscous friction')
    assert drift.size == pytest.approx(sign * 5.0 / 10.0, rel=0.2)
    assert drift.since == pytest.approx(200 * WINDOW, abs=3 * WINDOW)
    assert 'joint 1 has' in str(drift)
    assert f'{sign * 0.5:+.1f}'[0] in str(drift)


@pytest.mark.parametrize('seed', range(20))
def test_a_strong_drift_acts_like_what_has_most_torque(seed):
    """Far beyond the scatter of every word; only the torque along each tells them apart."""
    watch, random = DriftWatch(4, learning=10), np.random.default_rng(seed)
    watched(random, 30, watch)
    shift = np.zeros((4, 4))
    shift[2] = 20.0, 50.0, 44.0, -15.0
    watched(random, 15, watch, shift)
    drift, = watch.drifts
    assert (drift.joint, drift.acts_like) == (2, 'Coulomb friction')
    assert drift.size == pytest.approx(5.0, rel=0.1)  # a window or two before it may count


def test_one_odd_window_is_no_drift_and_a_machine_that_is_mended_none_more():
    watch, random = DriftWatch(4), np.random.default_rng(5)
    watched(random, 100, watch)
    watched(random, 1, watch, 1e6)
    assert not watch.drifts
    watched(random, 40, watch, 4.0)
    assert len(watch.drifts) == 4
    watched(random, 400, watch)
    assert not watch.drifts


def test_an_alarm_that_fades_neither_comes_and_goes_nor_lies_in_the_future():
    """Windows near the bound of noise add and take; the clock begins anew in the midst of it."""
    watch, random = DriftWatch(4, learning=30), np.random.default_rng(9)
    watched(random, 30, watch)
    changes, alarmed = 0, False
    for shift in (4.0,) * 8 + (0.0,) * 4 + (0.0, 3.0) * 15 + (0.0,) * 25:
        watched(random, 1, watch, np.where(np.arange(4)[:, None] == 2, shift, 0.0))
        changes += alarmed != bool(watch.drifts)
        alarmed = bool(watch.drifts)
        if watch.windows == 50:
            assert f'beside its model since {30 * WINDOW:.0f} s' in str(watch.drifts[0])
            watch.clock_set_back()
            assert 'since before the clock was set back' in str(watch.drifts[0])
    assert changes == 2


@pytest.mark.parametrize('faulty', [50, 2000])
def test_an_alarm_ends_soon_after_a_repair_however_old_it_is(faulty):
    watch, random = DriftWatch(4, learning=30), np.random.default_rng(8)
    watched(random, 30, watch)
    watched(random, faulty, watch, 8.0)
    assert len(watch.drifts) == 4
    watched(random, 25, watch)
    assert not watch.drifts


def test_a_joint_that_rests_keeps_no_other_from_being_watched():
    watch, random = DriftWatch(4, learning=10), np.random.default_rng(3)
    rests = np.where(np.arange(4)[:, None] == 3, np.nan, 0.0)
    watched(random, 10, watch, rests)
    assert (watch.learning, watch.unknown) == (0, (3,))
    viscous = 20.0 * (np.arange(4) == 2)
    watched(random, 20, watch, rests + np.where(np.arange(4)[:, None] == 1, viscous, 0.0))
    drift, = watch.drifts
    assert (drift.joint, drift.acts_like) == (1, 'viscous friction')
    watched(random, 100, watch)  # now it moves, and is learnt from
    assert watch.unknown == ()
    assert not watch.drifts
    watched(random, 20, watch, np.where(np.arange(4)[:, None] == 3, viscous, 0.0))
    drift, = watch.drifts
    assert (drift.joint, drift.acts_like) == (3, 'viscous friction')
    assert drift.since == pytest.approx(130 * WINDOW, abs=3 * WINDOW)


def test_windows_without_any_scatter_are_learnt_from():
    """As of a simulation without noise; rounding is no drift, and a drift is one from then on."""
    watch, random = DriftWatch(4, learning=10), np.random.default_rng(7)
    same, rounding = np.full((4, 4), 0.3), 1e-12
    for _ in range(10):
        watch.take(WINDOW * (watch.windows + 1), same, LENGTHS)
    for _ in range(1000):
        watch.take(WINDOW * (watch.windows + 1), same + rounding * random.normal(size=(4, 4)),
                   LENGTHS)
    assert not watch.drifts
    shift = np.zeros((4, 4))
    shift[1, 2] = 0.1
    for _ in range(10):
        watch.take(WINDOW * (watch.windows + 1), same + shift, LENGTHS)
    drift, = watch.drifts
    assert (drift.joint, drift.acts_like) == (1, 'viscous friction')
    assert drift.size == pytest.approx(0.1 / 10.0)
    assert drift.since == pytest.approx(1010 * WINDOW)


def test_joints_that_rest_say_nothing():
    watch, random = DriftWatch(4), np.random.default_rng(6)
    watched(random, 100, watch)
    resting = np.full((4, 4), np.nan)
    for _ in range(100):
        watch.take(1000.0, resting, resting)
    assert not watch.drifts


@pytest.fixture
def monitor() -> SimpleNamespace:
    """Return the state of a `par4_monitor` that takes messages and counts windows."""
    node = SimpleNamespace(counts=Counter(), looked=0, wall_clock=None, get_logger=mock.Mock(),
                           _gain=np.asarray(REFERENCE.drive_gain), _robot=REFERENCE, _skipped=0,
                           _counting=Lock())
    for name in ('_forget', '_skip', '_leave_other_times', '_keep', 'reject', 'count'):
        setattr(node, name, partial(getattr(MonitorNode, name), node))

    def look() -> None:
        node.looked += 1
        node.window = node._position, node._torque or node._effort
        node._forget()

    node._look = look
    node._forget()
    return node


def send(node: SimpleNamespace, first: float, last: float,
         topics: tuple[Topic, ...] = (JOINT_STATES, AMPLIFIER_VOLTAGE), effort: float | None = 0.0
         ) -> None:
    """Let a monitor take a message of each topic every 10 ms; of None without efforts."""
    message = JointState(name=list(JOINT_NAMES))
    efforts = {} if effort is None else {'effort': np.full(4, effort)}
    for time in np.arange(first, last, 0.01):
        write_joint_state(message, round(time * SECOND), np.zeros(4), **efforts)
        for topic in topics:
            MonitorNode._taken(node, topic)(message)


def test_a_clock_that_is_set_back_or_a_stray_stamp_does_not_blind_the_monitor(monitor):
    send(monitor, 1000.0, 1001.0)
    send(monitor, 5.0, 10.0)
    assert monitor.looked == 2
    for _ in range(2):  # the first ends the window, the second would begin the next
        send(monitor, 1e9, 1e9 + 0.015)
    send(monitor, 10.0, 15.0)
    assert monitor.looked == 4
    assert monitor.counts['skipped_windows'] == 3


@pytest.mark.parametrize('tick', [1000.0, 1.0], ids=['stands still', 'whole seconds'])
def test_stamps_that_do_not_move_are_told_until_they_move(monitor, tick):
    monitor._watch = DriftWatch(4)
    for number in range(200):
        time = 5000.0 + 0.005 * number // tick * tick
        send(monitor, time, time + 0.005)
        state = MonitorNode._judged(monitor)
        if number < STILL:
            assert (state.level, state.text[:8]) == (OK, 'learning')
    assert state.level == WARN
    assert state.text.startswith('the stamps of joint_states do not move')
    assert state.detail.endswith(' before, the last at 5000.000 s')
    send(monitor, 5000.0, 5005.0)
    assert MonitorNode._judged(monitor).text.startswith('learning')


def test_a_monitor_names_the_joints_that_it_still_learns(monitor):
    monitor._watch = DriftWatch(4, learning=10)
    rests = np.where(np.arange(4)[:, None] == 3, np.nan, 0.0)
    watched(np.random.default_rng(4), 10, monitor._watch, rests)
    assert MonitorNode._judged(monitor) == NodeState(
        OK, 'follows its model; still learning: arm_joint_3')
    watched(np.random.default_rng(5), 10, monitor._watch)
    assert MonitorNode._judged(monitor) == NodeState(OK, 'follows its model')


def test_messages_that_come_twice_are_no_stamps_that_do_not_move(monitor):
    monitor._watch = DriftWatch(4)
    for time in np.arange(0.0, 10.0, 0.01):
        for _ in range(3):
            send(monitor, time, time + 0.005)
        assert MonitorNode._judged(monitor).level == OK


def test_a_monitor_that_can_look_at_nothing_says_so_and_why(monitor):
    """As of voltages that end while positions go on: it said that the machine follows its model."""
    monitor._watch, monitor._model = DriftWatch(4), read_model('table1', REFERENCE)
    monitor._look, monitor._window = (partial(function, monitor) for function in (
        MonitorNode._look, MonitorNode._window))
    monitor._rms = np.full(4, np.nan)
    send(monitor, 0.0, 3.0 * WINDOW)
    assert MonitorNode._judged(monitor).level == OK
    send(monitor, 3.0 * WINDOW, (3.0 + BLIND - 1.0) * WINDOW, (JOINT_STATES,), None)
    assert MonitorNode._judged(monitor).level == OK
    send(monitor, (3.0 + BLIND - 1.0) * WINDOW, (6.0 + BLIND) * WINDOW, (JOINT_STATES,), None)
    state = MonitorNode._judged(monitor)
    assert state.level == WARN
    assert state.text.startswith('nothing is looked at')
    assert '0 samples with position and torque' in state.detail
    send(monitor, (6.0 + BLIND) * WINDOW, (9.0 + BLIND) * WINDOW)
    assert MonitorNode._judged(monitor).level == OK


def test_voltages_without_joint_states_do_not_pile_up(monitor):
    send(monitor, 0.0, 60.0, (AMPLIFIER_VOLTAGE,))
    assert len(monitor._torque) < 500


@pytest.mark.parametrize('topics', [(JOINT_STATES,), (JOINT_STATES, AMPLIFIER_VOLTAGE)],
                         ids=['effort', 'voltage'])
def test_a_torque_that_no_drive_gives_is_left_out_of_a_window_and_told(monitor, topics):
    """In N m or V; the largest that counts is ten times the limit."""
    topic, unit = topics[-1], 1.0 if len(topics) == 1 else monitor._gain[2]
    absurd, most = -1e12, 10.0 * REFERENCE.drives.torque_limit
    send(monitor, 0.0, 0.5, topics)
    for time, torque in ((0.5, absurd), (0.51, most * (1.0 - 1e-9))):
        message = JointState(name=list(JOINT_NAMES))
        for part in topics:
            write_joint_state(message, round(time * SECOND), np.zeros(4),
                              effort=np.array((0.0, 0.0, torque / unit, 0.0)) * (part is topic))
            MonitorNode._taken(monitor, part)(message)
    send(monitor, 0.52, 2.015, topics)
    positions, torques = monitor.window
    assert monitor.looked == 1
    ended_by = max(positions)  # its voltage belongs to the next window
    assert positions.keys() - torques.keys() - {ended_by} == {SECOND // 2}
    assert np.abs([*torques.values()]).max() == pytest.approx(most)
    assert monitor.counts['rejected_messages'] == 1
    said, = (call.args[0] for call in monitor.get_logger().warning.call_args_list)
    assert said.startswith(f'{topic.name}: arm_joint_2 has -1e+12 N m, more than 10 times the '
                           f'torque_limit of 200 N m of robot reference')


def test_an_effort_that_is_no_number_is_told_and_good_voltages_are_looked_at(monitor):
    for time in np.arange(0.0, 2.015, 0.01):
        send(monitor, time, time + 0.005, (AMPLIFIER_VOLTAGE,))
        with pytest.raises(InputError, match='effort: arm_joint_0 has nan; send finite numbers'):
            send(monitor, time, time + 0.005, (JOINT_STATES,), np.nan)
    positions, torques = monitor.window
    assert monitor.looked == 1
    assert positions.keys() == torques.keys()
