"""The loop around a simulation: its times, its orders, its patience."""

from __future__ import annotations

import itertools
import subprocess
import sys
from dataclasses import replace
from threading import Event, Thread
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

from par4_dynamics.model_from_file import read_model
from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.limits import EndSwitches
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.ros.convert import Trajectory
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.stamps import SECOND
from par4_kinematics.workspace import home_pose
from par4_sim.closed_loop.simulation import Sample, Simulation, build_simulation
from par4_sim.drives.reference_curve import ReferenceLimits
from par4_sim.drives.reference_points import ROOM
from par4_sim.ros import simulation_node
from par4_sim.ros.inbox import MOST, Inbox
from par4_sim.ros.pace import Pace
from par4_sim.ros.physics_loop import End, PhysicsLoop
from par4_sim.ros.simulation_node import SimulationNode
from robots import REFERENCE

PERIOD_NS = 2_000_000
HOME_Q = inverse_kinematics(REFERENCE.geometry, home_pose(REFERENCE))


def simulation() -> Simulation:
    return build_simulation(REFERENCE, read_model('table1', REFERENCE), 'exact',
                            PERIOD_NS / SECOND, limits=ReferenceLimits(REFERENCE))


class Run:
    """A loop that runs as fast as it can, and what it published."""

    def __init__(self, feedforward_timeout: float = 0.0, following_error_limit: float = 0.0,
                 factor: float = 0.0) -> None:
        self.times: list[int] = []
        self.samples: list[Sample] = []
        self.refused: list[Par4Error] = []
        self.loop = PhysicsLoop(simulation(), self.publish, self.refused.append, factor,
                                feedforward_timeout, following_error_limit,
                                EndSwitches(REFERENCE), Pace(factor, 'exact', 0.25e-3))

    def publish(self, time_ns: int, sample: Sample) -> None:
        self.times.append(time_ns)
        self.samples.append(sample)

    def go_on(self, count: int) -> None:
        """Run in this thread until `count` samples more are out."""
        end = len(self.times) + count
        self.loop.run(lambda: len(self.times) >= end)


def restarted(after: int) -> Run:
    """Return a loop that was restarted after so many samples."""
    run = Run()
    run.go_on(after)
    restart = Thread(target=run.loop.restart)
    restart.start()
    while restart.is_alive():
        run.go_on(1)
    return run


def rest_at_home(start: float, count: int = 5) -> Trajectory:
    times = np.arange(count) * PERIOD_NS + round(start * SECOND)
    still = np.zeros((count, 4))
    return Trajectory(0, times, np.tile(HOME_Q, (count, 1)), still, still, still)


def test_samples_come_every_period():
    run = Run()
    run.go_on(50)
    assert run.times == [(index + 1) * PERIOD_NS for index in range(50)]
    assert run.loop.now_ns == run.times[-1]


@pytest.mark.parametrize(('factor', 'stall', 'late'), [
    (1.0, 0.003, 0), (1.0, 0.005, 1), (0.1, 0.035, 0), (0.1, 0.045, 1), (10.0, 0.00035, 0),
    (10.0, 0.00045, 1)])
def test_a_sample_is_late_by_more_than_its_period_on_the_clock_of_the_wall(factor, stall, late):
    """A stall of the wall's clock in one sample, whose period is 2 ms of simulated time."""
    class Clock:
        now = 0.0

        def monotonic(self):
            return self.now

        def sleep(self, seconds):
            self.now += seconds

    class Stalled(Run):
        def publish(self, time_ns, sample):
            super().publish(time_ns, sample)
            clock.now += stall if len(self.times) == 5 else 0.0

    clock, run = Clock(), Stalled(factor=factor)
    with mock.patch('par4_sim.ros.physics_loop.time', clock):
        run.go_on(10)
    assert run.loop.late_steps == late


@pytest.mark.parametrize('other', [None, simulation()])
def test_time_goes_on_after_a_restart_and_the_machine_is_at_home(other):
    run = Run()
    points = rest_at_home(0.02)
    run.loop.queue_reference(0, Trajectory(0, points.from_start_ns + SECOND // 20, points.q + 0.05,
                                           points.qd, points.qdd))
    run.go_on(150)
    moved = run.samples[-1].q
    assert np.abs(moved - HOME_Q).max() > 0.03
    restart = Thread(target=run.loop.restart, args=(other,))
    restart.start()
    while restart.is_alive():
        run.go_on(1)
    run.go_on(10)
    assert (np.diff(run.times) == PERIOD_NS).all()
    np.testing.assert_allclose(run.samples[-1].q, HOME_Q, atol=1e-3)
    assert run.samples[-1].time_ns < run.times[-1]


def test_a_pause_is_answered_once_the_last_sample_is_out():
    """It is asked for while a sample is on its way."""
    run, out = Run(), []

    def pause() -> None:
        run.loop.pause()
        out.append(len(run.times))

    asking = Thread(target=pause)

    def publish(time_ns: int, sample: Sample) -> None:
        if len(run.times) == 20:
            asking.start()
            while asking.is_alive() and run.loop._orders.empty():
                pass
        run.publish(time_ns, sample)

    run.loop._publish = publish
    run.loop.run(lambda: len(run.times) > 20 and not asking.is_alive())
    assert out == [21]
    looks = iter(range(3))
    run.loop.run(lambda: next(looks) == 2)
    assert len(run.times) == 21


def test_references_are_queued_by_the_time_that_is_published():
    run = restarted(10)
    start_ns = run.loop.now_ns + 50 * PERIOD_NS
    points = rest_at_home(0.0, count=400)
    ramp = points.q.copy()
    ramp[200:] += 0.05
    run.loop.queue_reference(start_ns, Trajectory(0, points.from_start_ns, ramp, points.qd,
                                                  points.qdd))
    run.go_on(50 + 400)
    moved = np.array([np.abs(sample.q - HOME_Q).max() > 0.01 for sample in run.samples])
    first = run.times[int(np.argmax(moved))]
    assert start_ns + 199 * PERIOD_NS <= first <= start_ns + 220 * PERIOD_NS


def test_a_start_waits_for_its_torque_and_orders_are_carried_out_meanwhile():
    run = Run(feedforward_timeout=3600.0)
    run.loop.queue_reference(0, rest_at_home(0.1))
    looks = iter(range(10))
    run.loop.run(lambda: next(looks) == 9)
    assert run.times[-1] < 0.1 * SECOND
    stood_at = len(run.times)
    looks = iter(range(3))
    run.loop.run(lambda: next(looks) == 2)
    assert len(run.times) == stood_at
    run.loop.queue_effort(0, rest_at_home(0.1))
    run.go_on(100)
    assert run.loop.counts['missing_effort'] == 0


def test_patience_ends_and_what_is_missing_is_counted():
    run = Run(feedforward_timeout=0.05)
    run.loop.queue_reference(0, rest_at_home(0.1))
    run.go_on(100)
    assert run.loop.counts['missing_effort'] == 5


def test_a_loop_waits_until_its_patience_ends_and_is_unaided_until_torque_is_there(monkeypatch):
    run, now = Run(feedforward_timeout=10.0), 0.0
    monkeypatch.setattr('time.monotonic', lambda: now)
    run.loop.queue_reference(0, rest_at_home(0.1, count=50))

    def look() -> tuple[bool, bool, int]:
        """Return what the loop is and how many samples it has published after a few turns."""
        looks = iter(range(60))
        run.loop.run(lambda: next(looks) == 59)
        return run.loop.waiting, run.loop.unaided, len(run.times)

    *state, stood_at = look()
    assert state == [True, False]
    now = 9.9
    assert look() == (True, False, stood_at)
    now = 10.1
    assert look() == (False, True, stood_at + 59)
    run.loop.queue_effort(0, rest_at_home(0.1, count=50))
    *state, _ = look()
    assert state == [False, False]


def test_a_loop_that_has_ended_takes_no_orders(monkeypatch):
    monkeypatch.setattr('par4_sim.ros.physics_loop.PATIENCE', 0.01)
    with pytest.raises(InputError, match='the simulation has ended'):
        Run().loop.restart()


def test_an_order_that_a_busy_loop_does_not_take_in_time_is_withdrawn(monkeypatch):
    monkeypatch.setattr('par4_sim.ros.physics_loop.PATIENCE', 0.01)
    loop, entered, free, ends = Run().loop, Event(), Event(), iter((False, False, True))

    def finished() -> bool:
        entered.set()
        free.wait(10.0)
        return next(ends)

    thread = Thread(target=loop.run, args=(finished,))
    thread.start()
    entered.wait(10.0)
    with pytest.raises(InputError, match='busy and nothing was changed'):
        loop.pause()
    other = mock.Mock()
    with pytest.raises(InputError, match='busy and nothing was changed'):
        loop.restart(other)
    other.close.assert_called_once_with()
    free.set()
    thread.join(10.0)
    assert not loop.paused
    other.reset.assert_not_called()


def test_too_far_from_its_reference_the_machine_brakes_and_takes_no_more_until_a_restart():
    run = Run(following_error_limit=0.005)
    still = np.zeros((2, 4))
    reference = Trajectory(0, np.array((0, SECOND // 10)), np.stack((HOME_Q, HOME_Q + 0.3)), still,
                           still)
    run.loop.queue_reference(SECOND // 5, reference)
    run.go_on(300)
    assert 'rad from its reference, beyond 0.005 rad' in run.loop.fault
    stopped = run.samples[-1].q
    assert np.abs(run.samples[-1].qd).max() < 0.01
    assert np.abs(stopped - HOME_Q - 0.3).max() > 0.02
    run.loop.queue_reference(run.loop.now_ns, reference)
    run.go_on(50)
    assert 'call ~/reset' in str(run.refused[0])
    np.testing.assert_allclose(run.samples[-1].q, stopped, atol=1e-3)
    restart = Thread(target=run.loop.restart)
    restart.start()
    while restart.is_alive():
        run.go_on(1)
    assert run.loop.fault == ''
    run.loop.queue_reference(run.loop.now_ns, rest_at_home(0.0))
    run.go_on(10)
    assert len(run.refused) == 1


@pytest.mark.parametrize(('pose', 'push', 'told'), [
    ((0.0, 0.0, -0.895, 0.0), (199.0,) * 4, 'z of D'),
    ((0.0, 0.0, -0.78, 0.75), (199.0,) * 4, 'theta'),
    ((0.0, 0.0, -0.895, 0.0), (20.0,) * 4, '')])
def test_a_machine_that_is_pushed_beyond_its_limits_is_braked(pose, push, told):
    """No reference breaks one: a feedforward torque within that of the drives does."""
    run = Run(following_error_limit=0.25)
    there = inverse_kinematics(REFERENCE.geometry, np.array(pose))
    push = np.array(push) * np.sign((there - HOME_Q) if told == 'theta' else 1.0)
    still = np.zeros((2, 4))
    begin, went = SECOND // 5, 3 * SECOND // 2
    run.loop.queue_reference(begin, Trajectory(0, np.array((0, went)), np.stack((HOME_Q, there)),
                                               still, still))
    run.go_on(900)
    assert run.loop.fault == ''
    times = np.array((0, SECOND // 100, 3 * SECOND // 10, 31 * SECOND // 100))
    four = np.zeros((4, 4))
    start = run.loop.now_ns + SECOND // 10
    run.loop.queue_effort(start, Trajectory(0, times, np.tile(there, (4, 1)), four, four,
                                            np.stack((four[0], push, push, four[0]))))
    run.loop.queue_reference(start, Trajectory(0, times, np.tile(there, (4, 1)), four, four))
    run.go_on(500)
    if not told:
        assert run.loop.fault == ''
        return
    assert f'the machine is outside its limits: {told}' in run.loop.fault
    assert 'braked; call ~/reset' in run.loop.fault
    assert np.abs(run.samples[-1].qd).max() < 0.02


def test_a_machine_is_stopped_for_where_it_is_not_for_what_its_encoders_tell():
    """Recorded noise and a wrong zero are no place of the machine."""
    run = Run()
    run.go_on(1)
    sample = run.samples[0]
    run.loop._watch(replace(sample, q=sample.q + 3.0))
    assert run.loop.fault == ''
    run.loop._watch(replace(sample, true_q=sample.true_q + 3.0))
    assert 'joint position' in run.loop.fault


@pytest.mark.parametrize(('row', 'allowed'), [
    ((0.2, 0.0, -0.7, 0.0), ''), ((0.504, 0.0, -0.7, 0.0), ''), ((0.51, 0.0, -0.7, 0.0), 'radius'),
    ((0.0, 0.0, -0.54, 0.0), 'z of D'), ((0.0, 0.0, -0.7, -0.9), 'theta'),
    ((np.nan, 0.0, -0.7, 0.0), 'no number')])
def test_end_switches_leave_room_for_overshoot_and_none_for_what_is_no_number(row, allowed):
    found = EndSwitches(REFERENCE).breach(HOME_Q, np.zeros(4), np.array(row))
    assert (found is None) == (allowed == '')
    assert found is None or allowed in found.found
    inside = np.array((0.2, 0.0, -0.7, 0.0))
    for q, qd, what in ((HOME_Q + 3.0, np.zeros(4), 'joint position'),
                        (HOME_Q, np.array((0.0, 16.6, 0.0, 0.0)), 'joint speed')):
        assert what in EndSwitches(REFERENCE).breach(q, qd, inside).found
    assert EndSwitches(REFERENCE).breach(HOME_Q, np.full(4, 16.4), inside) is None


def wave(seconds: float) -> Trajectory:
    """Return an oscillation of all joints that begins at rest."""
    t = np.arange(0, round(seconds * SECOND) + 1, PERIOD_NS)
    phase = 2.0 * np.pi * t / SECOND
    q, qd, qdd = (0.1 * part[:, None] + np.zeros(4) for part in (
        1.0 - np.cos(phase), 2.0 * np.pi * np.sin(phase), 4.0 * np.pi ** 2 * np.cos(phase)))
    return Trajectory(0, t, HOME_Q + q, qd, qdd)


def test_a_motion_from_before_a_restart_is_refused_until_one_begins_where_the_machine_stands():
    """Its sender does not know of the restart and would move the machine all by itself."""
    whole, run = wave(2.0), Run()

    def send(start_ns: int, part: slice) -> None:
        run.loop.queue_reference(start_ns, Trajectory(
            0, whole.from_start_ns[part], whole.q[part], whole.qd[part], whole.qdd[part]))

    start_ns = 20 * PERIOD_NS
    send(start_ns, slice(0, 100))
    run.go_on(100)
    assert not run.refused
    restart = Thread(target=run.loop.restart)
    restart.start()
    while restart.is_alive():
        run.go_on(1)
    assert run.loop.restarted
    since = len(run.samples)
    start_ns = run.loop.now_ns - 120 * PERIOD_NS
    run.loop.queue_reference(start_ns - SECOND, rest_at_home(0.0))  # over: it is not looked at
    for first in range(150, 400, 50):  # both where it moves and where it turns, 0.2 rad from home
        send(start_ns, slice(first, first + 50))
    run.go_on(500)
    assert run.loop.restarted, 'what is refused begins nothing'
    assert len(run.refused) == 5
    assert all('begin at rest where the machine stands' in str(error) for error in run.refused)
    assert 'rad/s' in str(run.refused[0])
    assert 'rad from where it stands' in str(run.refused[2])
    np.testing.assert_allclose([sample.q for sample in run.samples[since:]],
                               np.tile(HOME_Q, (len(run.samples) - since, 1)), atol=1e-3)
    start_ns = run.loop.now_ns + 20 * PERIOD_NS
    for first in range(0, 1000, 50):
        send(start_ns, slice(first, first + 50))
    run.go_on(500)
    assert not run.loop.restarted
    assert len(run.refused) == 5
    assert np.ptp([sample.q for sample in run.samples[-500:]], axis=0).min() > 0.15


def braked_at_the_end(run: Run) -> None:
    speeds = np.abs([sample.qd for sample in run.samples]).max(axis=1)
    assert speeds.max() > 0.3
    assert speeds[-1] < 0.05
    effort = np.array([sample.effort for sample in run.samples])
    assert np.abs(np.diff(effort[50:], axis=0)).max() < 15.0


def test_a_loop_that_is_to_end_in_motion_lets_others_brake_and_then_brakes_itself(monkeypatch):
    run = Run()
    run.loop.queue_reference(100 * PERIOD_NS, wave(60.0))
    run.go_on(250)
    monkeypatch.setattr('par4_sim.ros.physics_loop.GRACE', np.inf)
    monkeypatch.setattr('par4_sim.ros.physics_loop.LONGEST_END', np.inf)
    run.loop.end()
    run.go_on(150)
    assert run.loop.ended is None
    assert np.abs(run.samples[-1].qd).max() > 0.1
    monkeypatch.setattr('par4_sim.ros.physics_loop.GRACE', 0.0)
    run.go_on(1)
    run.loop.queue_reference(run.loop.now_ns, rest_at_home(0.1))
    run.loop.run(lambda: False)
    assert run.loop.ended is End.BRAKED
    assert 'the simulation is ending' in str(run.refused[0])
    braked_at_the_end(run)
    assert run.loop.counts['interrupted_references'] == 1


@pytest.mark.parametrize(('end', 'told'), [
    (None, []), (End.PAUSED, []), (End.AT_REST, []),
    (End.BRAKED, ['asked to end in motion; ended at rest, braked by the drives']),
    (End.IN_MOTION, ['asked to end in motion; ended in motion: the time to brake in was over'])])
def test_the_node_warns_of_an_end_that_it_was_asked_for_in_motion(end, told):
    found = []
    SimulationNode._tell_end(SimpleNamespace(
        _physics=SimpleNamespace(ended=end),
        get_logger=lambda: SimpleNamespace(warning=found.append)))
    assert found == told


def test_a_loop_ends_where_others_have_braked(monkeypatch):
    run = Run()
    monkeypatch.setattr('par4_sim.ros.physics_loop.GRACE', np.inf)
    monkeypatch.setattr('par4_sim.ros.physics_loop.LONGEST_END', np.inf)
    run.loop.queue_reference(100 * PERIOD_NS, wave(1.0))  # a whole period: it ends at rest
    run.go_on(250)
    run.loop.end()
    run.loop.run(lambda: False)
    assert run.loop.ended is End.AT_REST
    braked_at_the_end(run)
    assert run.loop.counts['interrupted_references'] == 0
    assert len(run.times) < 1000


def test_a_loop_does_not_wait_for_rest_or_torque_or_a_pause_for_ever(monkeypatch):
    monkeypatch.setattr('par4_sim.ros.physics_loop.GRACE', np.inf)
    monkeypatch.setattr('par4_sim.ros.physics_loop.LONGEST_END', np.inf)
    run = Run(feedforward_timeout=3600.0)
    run.loop.queue_reference(0, rest_at_home(0.1))
    looks = iter(range(60))
    run.loop.run(lambda: next(looks) == 59)
    assert run.loop.waiting
    run.loop.end()
    run.loop.run(lambda: False)
    assert run.loop.ended is End.AT_REST

    run = Run()
    run.loop.queue_reference(0, wave(60.0))
    run.go_on(100)
    monkeypatch.setattr('par4_sim.ros.physics_loop.LONGEST_END', 0.0)
    run.loop.end()
    run.loop.run(lambda: False)
    assert run.loop.ended is End.IN_MOTION

    run = Run()
    run.go_on(10)
    run.loop.paused = True
    run.loop.end()
    run.loop.run(lambda: False)
    assert run.loop.ended is End.PAUSED


@pytest.mark.parametrize(('latest', 'samples'), [(60.0, 25), (1.0, 10)])
def test_a_loop_with_few_turns_has_more_time_to_end_in(monkeypatch, latest, samples):
    """A second of the wall clock brings it 0.02 s further here."""
    run, now = Run(), 0.0
    monkeypatch.setattr('par4_sim.ros.physics_loop.GRACE', np.inf)
    monkeypatch.setattr('par4_sim.ros.physics_loop.LONGEST_END', 25.5 * PERIOD_NS / SECOND)
    monkeypatch.setattr('par4_sim.ros.physics_loop.LATEST_END', latest + 0.05)
    run.loop.queue_reference(0, wave(60.0))
    run.go_on(100)
    monkeypatch.setattr('time.monotonic', lambda: now)
    publish = run.loop._publish

    def slowly(time_ns: int, sample: Sample) -> None:
        nonlocal now
        now += 0.1
        publish(time_ns, sample)

    run.loop._publish, run.loop._factor = slowly, 1.0
    run.loop.end()
    run.loop.run(lambda: False)
    assert run.loop.ended is End.IN_MOTION
    assert len(run.times) == 100 + samples + 2  # noted with the next sample, ended behind it


def test_a_stream_of_single_points_is_what_they_are_at_once():
    """Many messages between two samples: the same motion as in one, however they are grouped."""
    t = np.arange(0, 400) * PERIOD_NS
    wave = 0.1 * (1.0 - np.cos(2.0 * np.pi * t / t[-1]))[:, None]
    slope = 0.2 * np.pi / (t[-1] / SECOND) * np.sin(2.0 * np.pi * t / t[-1])[:, None]
    still = np.zeros((len(t), 4))
    whole = Trajectory(0, t, HOME_Q + wave, slope + still, still)
    told = []
    for pieces in (1, 400, 7):
        run = Run()
        for part in np.array_split(np.arange(len(t)), pieces):
            run.loop.queue_reference(int(t[part[0]]) + 40 * PERIOD_NS, Trajectory(
                0, t[part] - t[part[0]], whole.q[part], whole.qd[part], whole.qdd[part]))
        run.go_on(440)
        assert not run.refused
        told.append(np.array([sample.q for sample in run.samples]))
    np.testing.assert_allclose(told[1], told[0], atol=1e-12)
    np.testing.assert_allclose(told[2], told[0], atol=1e-12)
    assert np.ptp(told[0], axis=0).min() > 0.15


def test_one_message_of_a_burst_that_tears_is_refused_alone():
    run = Run()
    for index in range(100):
        q = HOME_Q + (0.5 if index == 50 else 0.0)
        run.loop.queue_reference((40 + index) * PERIOD_NS, Trajectory(
            0, np.zeros(1, dtype=np.int64), q[None], np.zeros((1, 4)), np.zeros((1, 4))))
    run.go_on(150)
    assert len(run.refused) == 1
    assert 'joint speed' in str(run.refused[0])
    np.testing.assert_allclose(run.samples[-1].q, HOME_Q, atol=1e-3)


def test_a_flood_does_not_stop_the_clock():
    inbox = Inbox()

    class Flood:
        """A point without end: each look at it brings the next."""

        rows = np.zeros((1, 16))

        @property
        def times(self) -> np.ndarray:
            inbox.put(0, Flood())
            return np.ones(1)

    inbox.put(0, Flood())
    assert 1 < sum(len(group) for group in inbox.take(0)) <= MOST


def test_many_points_are_followed_like_few_and_a_restart_keeps_their_times():
    """More than are moved in memory, behind others and before others, their torques in parts."""
    t = PERIOD_NS // 4 * np.arange(3 * ROOM)
    phase = 2.0 * np.pi * t / SECOND
    q, qd, qdd = (0.05 * part[:, None] + np.zeros(4) for part in (
        1.0 - np.cos(phase), 2.0 * np.pi * np.sin(phase), 4.0 * np.pi ** 2 * np.cos(phase)))
    whole = Trajectory(0, t, HOME_Q + q, qd, qdd, 2.0 + np.sin(phase)[:, None] * np.ones(4))
    told = []
    for borders in ([0, len(t)], [0, 100, len(t) - 100, len(t)],
                    [0, *range(1, len(t), 500), len(t)]):
        run = restarted(3)
        start_ns = run.loop.now_ns + 40 * PERIOD_NS
        for first, end in itertools.pairwise(borders):
            part = slice(first, end)
            points = Trajectory(0, t[part] - t[first], whole.q[part], whole.qd[part],
                                whole.qdd[part], whole.effort[part])
            run.loop.queue_reference(start_ns + int(t[first]), points)
            run.loop.queue_effort(start_ns + int(t[first]), points)
        run.go_on(40 + len(t) // 4 - 10)  # it ends in motion: not to where it is braked
        assert not run.refused
        assert run.loop.counts['missing_effort'] == run.loop.counts['late_points'] == 0
        told.append(np.array([np.concatenate((sample.q, sample.effort))
                              for sample in run.samples[-len(t) // 4:]]))
    np.testing.assert_allclose(told[1], told[0], atol=1e-9)
    np.testing.assert_allclose(told[2], told[0], atol=1e-9)
    assert np.ptp(told[0], axis=0).min() > 0.08


def test_all_that_a_reference_needs_is_compiled_before_a_node_can_be_found():
    """In a process of its own, where nothing else has compiled or loaded it."""
    told = subprocess.run(
        [sys.executable, '-c',
         'from par4_kinematics.robot import read_robot\n'
         'from par4_sim.drives import reference, waiting_torque\n'
         'from par4_sim.ros.simulation_node import compiled_limits\n'
         'compiled_limits(read_robot("reference"))\n'
         'print(len(waiting_torque._give.signatures), len(reference._pass.signatures))'],
        capture_output=True, text=True, check=True).stdout
    assert [int(count) > 0 for count in told.split()] == [True, True]


def test_memory_for_large_messages_is_kept():
    """In a process of its own, whose heap it changes; by the pages that the system has to give."""
    told = subprocess.run(
        [sys.executable, '-c',
         'import resource\n'
         'from concurrent.futures import ThreadPoolExecutor\n'
         'from par4_sim.ros.kept_memory import keep_memory\n'
         'def pages():\n'
         '    return resource.getrusage(resource.RUSAGE_THREAD).ru_minflt\n'
         'def take():\n'
         '    before, copies = pages(), [bytearray(14 << 20) for _ in range(2)]\n'
         '    return pages() - before\n'
         'with ThreadPoolExecutor(1) as thread:\n'
         '    thread.submit(keep_memory).result()\n'
         '    print(*(thread.submit(take).result() for _ in range(3)))'],
        capture_output=True, text=True, check=True).stdout
    assert max(int(count) for count in told.split()) < 100


def test_the_thread_that_takes_references_keeps_memory_before_it_takes_any(monkeypatch):
    done = []
    monkeypatch.setattr(simulation_node, 'keep_memory', lambda: done.append('kept'))
    monkeypatch.setattr(Par4Node, 'work', lambda _: done.append('works'))
    SimulationNode._serve_callbacks(object.__new__(SimulationNode))
    assert done == ['kept', 'works']
