"""The drives' queue of references and their loops."""

from __future__ import annotations

import numpy as np
import pytest
from experiments import IDEAL, MOTION, entry, model_of
from flywheels import spinning

from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_platform
from par4_kinematics.errors import InputError
from par4_sim.closed_loop.simulation import build_simulation
from par4_sim.drives.drive import DriveLoops
from par4_sim.drives.reference import TARGET, ReferenceQueue, interpolate
from par4_sim.drives.waiting_torque import MOST_WAITING
from robots import REFERENCE, growing_waves


def polynomial(t, order):
    """Return a polynomial of degree five and its derivatives, different on each joint."""
    factors = np.array((1.0, -0.5, 2.0, 0.3))
    base = np.polynomial.Polynomial((0.1, 0.2, -0.3, 0.5, 1.0, -0.7))
    return np.outer((base.deriv(order) if order else base)(np.asarray(t)), factors)


def read(queue, t):
    target = np.zeros(TARGET)
    interpolate(queue.times, queue.points, t, 0.0, target)
    return target


def filled(spacing=0.01):
    t = np.arange(0.0, 0.5, spacing)
    queue = ReferenceQueue(polynomial([0.0], 0)[0])
    queue.queue(-1.0, t, *(polynomial(t, order) for order in range(3)))
    return queue, t


def test_quintic_hermite_reproduces_a_polynomial_of_degree_five():
    queue, _ = filled(0.05)
    for t in np.linspace(0.0, 0.449, 37):
        np.testing.assert_allclose(read(queue, t)[:4], polynomial([t], 0)[0], atol=1e-12)
        np.testing.assert_allclose(read(queue, t)[4:8], polynomial([t], 1)[0], atol=1e-10)
        np.testing.assert_allclose(read(queue, t)[12:16], polynomial([t], 2)[0], atol=1e-8)


def test_before_the_first_and_after_the_last_point_the_drive_holds():
    queue, t = filled()
    for time, point in ((-2.0, 0), (0.7, -1)):
        target = read(queue, time)
        np.testing.assert_array_equal(target[:4], polynomial(t, 0)[point])
        np.testing.assert_array_equal(target[4:8], 0.0)


def test_a_new_message_replaces_everything_from_its_first_time_on():
    queue, _ = filled()
    later = np.arange(0.2, 0.3, 0.01)
    queue.queue(0.0, later, *(2.0 * polynomial(later, order) for order in range(3)))
    np.testing.assert_allclose(read(queue, 0.15)[:4], polynomial([0.15], 0)[0], atol=1e-9)
    np.testing.assert_allclose(read(queue, 0.25)[:4], 2.0 * polynomial([0.25], 0)[0], atol=1e-9)
    assert queue.end == pytest.approx(later[-1])


def test_late_points_are_dropped_and_counted():
    queue = ReferenceQueue(np.zeros(4))
    t = np.arange(0.0, 0.1, 0.01)
    queue.queue(0.045, t, *(polynomial(t, order) for order in range(3)))
    assert queue.late_points == 5
    np.testing.assert_allclose(read(queue, 0.05)[:4], polynomial([0.05], 0)[0])
    queue.queue(1.0, t, *(polynomial(t, order) for order in range(3)))
    assert queue.late_points == 15


def test_effort_is_matched_by_time_whichever_comes_first():
    t = np.arange(0.0, 0.1, 0.01)
    tau = np.outer(t, np.ones(4)) + 1.0
    for effort_first in (False, True):
        queue = ReferenceQueue(np.zeros(4))
        if effort_first:
            queue.queue_effort(t + 5e-5, tau)
        queue.queue(-0.1, t, *(polynomial(t, order) for order in range(3)))
        if not effort_first:
            queue.queue_effort(t + 5e-5, tau)
        np.testing.assert_allclose(read(queue, 0.055)[8:12], 1.055, atol=1e-9)
        assert not queue.uncovered(0.1)
        queue.use_until(0.2)
        assert queue.missing_effort == 0


def test_missing_effort_counts_as_zero_and_is_counted():
    t = np.arange(0.0, 0.1, 0.01)
    queue = ReferenceQueue(np.zeros(4))
    queue.queue(-0.1, t, *(polynomial(t, order) for order in range(3)))
    queue.queue_effort(t[:4], np.ones((4, 4)))
    queue.queue_effort(t[6:] + 2e-3, np.ones((4, 4)))  # too far from any point
    assert queue.uncovered(0.1)
    queue.use_until(0.2)
    assert queue.missing_effort == 6
    np.testing.assert_allclose(read(queue, 0.025)[8:12], 1.0)
    np.testing.assert_allclose(read(queue, 0.035)[8:12], 0.0)
    np.testing.assert_allclose(read(queue, 0.065)[8:12], 0.0)


def test_a_torque_serves_one_point_and_the_newest_of_one_time_rules():
    t = np.array((0.0, 5e-5, 0.1))
    still = np.zeros((3, 4))
    queue = ReferenceQueue(np.zeros(4))
    queue.queue_effort(np.array((0.0, 0.1)), np.ones((2, 4)))
    queue.queue_effort(np.array((0.1,)), np.full((1, 4), 2.0))
    queue.queue(-0.1, t, still, still, still)
    given = queue.points[-3:, 12]
    np.testing.assert_array_equal(np.isnan(given), (False, True, False))
    assert given[2] == 2.0


def test_torques_of_references_that_never_come_are_forgotten():
    """As where the drives have tripped and a stream goes on: they must not pile up."""
    queue = ReferenceQueue(np.zeros(4))
    now = 0.0
    for step in range(5000):
        now = 1e-3 * step
        queue.queue_effort(np.array((now + 0.5,)), np.ones((1, 4)))
        queue.use_until(now)
    assert queue.waiting == pytest.approx(1500, abs=2)
    late = np.array((now + 0.3, now + 0.4))
    still = np.zeros((2, 4))
    queue.queue(now, late, still, still, still)
    np.testing.assert_array_equal(queue.points[-2:, 12], 1.0)
    assert queue.waiting == pytest.approx(1498, abs=2)


def test_torques_far_ahead_of_any_reference_wait_in_a_bounded_number():
    """As of a stream that is refused: those that are needed first are kept."""
    queue, times = ReferenceQueue(np.zeros(4)), np.arange(MOST_WAITING + 1) * 1e-3
    for part in (slice(1, None, 2), slice(0, None, 2)):
        queue.queue_effort(times[part], np.ones((len(times[part]), 4)))
    assert queue.waiting == MOST_WAITING
    still = np.zeros((3, 4))
    queue.queue(-0.1, np.array((0.0, times[-2], times[-1])), still, still, still)
    np.testing.assert_array_equal(queue.points[-3:, 12], (1.0, 1.0, np.nan))


def test_torques_in_any_order_and_pieces_meet_their_points():
    random = np.random.default_rng(5)
    t = np.arange(0.0, 2.0, 1e-3)
    still = np.zeros((len(t), 4))
    queue = ReferenceQueue(np.zeros(4))
    order = random.permutation(len(t))
    for part in np.array_split(order, 23):
        queue.queue_effort(t[part] + random.uniform(-9e-5, 9e-5), np.outer(t[part], np.ones(4)))
        if part[0] == order[0]:
            queue.queue(-0.1, t, still, still, still)
    np.testing.assert_array_equal(queue.points[-len(t):, 12], t)


def test_points_that_lie_behind_do_not_pile_up():
    queue = ReferenceQueue(np.zeros(4))
    for chunk in range(60):
        t = 0.1 * chunk + np.arange(0.0, 0.1, 1e-3)
        queue.queue(0.1 * chunk - 0.05, t, *(polynomial(t, order) for order in range(3)))
        for now in t[::10]:
            queue.use_until(now)
            expected = polynomial([now + 0.004], 0)[0]
            np.testing.assert_allclose(read(queue, now + 0.004)[:4], expected, rtol=1e-6)
    assert len(queue.times) < 3000
    assert queue.missing_effort == pytest.approx(6000, abs=20)


def test_a_resting_drive_leaves_smoothly_for_a_start_elsewhere():
    queue = ReferenceQueue(np.zeros(4))
    t = np.array((1.2, 1.3))
    queue.queue(1.0, t, np.ones((2, 4)), np.zeros((2, 4)), np.zeros((2, 4)))
    path = np.array([read(queue, time)[0] for time in np.linspace(0.9, 1.25, 36)])
    assert path[0] == 0.0
    assert path[-1] == 1.0
    assert np.abs(np.diff(path)).max() < 0.12


def test_the_velocity_loop_is_proportional_and_the_position_loop_integrates():
    drives = REFERENCE.drives
    loops = DriveLoops(drives, 1000.0, 1e-3)
    target = np.zeros(TARGET)
    target[:4] = 0.01
    first = loops.follow(target, np.zeros(4), np.zeros(4)).copy()
    np.testing.assert_allclose(first, drives.velocity_gain * drives.position_gain * 0.01)
    second = loops.follow(target, np.zeros(4), np.zeros(4)).copy()
    np.testing.assert_allclose(second - first, drives.velocity_gain * drives.integral_gain
                               * 0.01 * 1e-3)
    braked = loops.follow(np.zeros(TARGET), np.zeros(4), np.ones(4))
    assert braked[0] < -0.9 * drives.velocity_gain


def test_torque_is_limited_counted_and_does_not_wind_up():
    loops = DriveLoops(REFERENCE.drives, 50.0, 1e-3)
    target = np.zeros(TARGET)
    target[:4] = 1.0
    for _ in range(100):
        torque = loops.follow(target, np.zeros(4), np.zeros(4))
    np.testing.assert_array_equal(torque, 50.0)
    assert loops.saturated_commands == 400
    released = loops.follow(np.zeros(TARGET), np.zeros(4), np.zeros(4))
    np.testing.assert_allclose(released, 0.0)


def test_speed_is_limited_counted_and_does_not_wind_up():
    drives = REFERENCE.drives.model_copy(update={'speed_limit': 2.0})
    loops = DriveLoops(drives, 1000.0, 1e-3)
    target = np.zeros(TARGET)
    target[:4] = (1.0, -1.0, 1e-3, 0.0)
    still = np.zeros(4)
    for _ in range(100):
        command = loops.follow(target, still, still)
    np.testing.assert_allclose(command[:2], drives.velocity_gain * np.array((2.0, -2.0)))
    np.testing.assert_array_equal(loops.state[0, :2], 0.0)
    assert loops.state[0, 2] == pytest.approx(0.1e-3)
    assert loops.saturated_speeds == 200
    assert loops.saturated_commands == 0
    assert loops.limited == 200
    # at the limit's speed the velocity loop asks for no torque
    at_speed = loops.follow(target, still, np.array((2.0, -2.0, 0.0, 0.0)))
    np.testing.assert_allclose(at_speed[:2], 0.0, atol=1e-12)


def test_a_limited_speed_makes_a_long_way_last_and_shows_in_the_counts():
    drives = REFERENCE.drives.model_copy(update={'speed_limit': 1.0})
    simulation = spinning(robot=REFERENCE.model_copy(update={'drives': drives}))
    t = np.array((0.01, 2.0))
    simulation.queue_reference(t, np.full((2, 4), 0.5), np.zeros((2, 4)), np.zeros((2, 4)))
    speed = np.array([simulation.next_sample().qd for _ in range(900)])
    assert 0.95 < speed.max() < 1.02
    assert simulation.counts['saturated_speeds'] > 1000
    assert simulation.counts['saturated_commands'] == 0


def test_feedforward_sets_in_and_stops_without_a_jump():
    loops = DriveLoops(REFERENCE.drives, 1000.0, 1e-3)
    loops.restart(np.full(4, -3.0))
    target = np.zeros(TARGET)
    np.testing.assert_allclose(loops.follow(target, np.zeros(4), np.zeros(4)), -3.0)
    target[8:12] = target[16:] = -3.0
    np.testing.assert_allclose(loops.follow(target, np.zeros(4), np.zeros(4)), -3.0)
    target[8:12] = target[16:] = 0.0
    np.testing.assert_allclose(loops.follow(target, np.zeros(4), np.zeros(4)), -3.0)


def simulated(feedforward, seed=0, noise=0.0, fidelity='exact', periods=700, rest=0.2):
    model = read_model('table1_full', REFERENCE)
    simulation = build_simulation(REFERENCE, model, fidelity, 1e-3, seed, torque_noise=noise)
    t = np.arange(0.0, 0.5, 1e-3)
    state = state_of_platform(REFERENCE.geometry, t, *growing_waves(REFERENCE, t, 0.5))
    simulation.queue_reference(t + rest, state.q, state.qd, state.qdd)
    if feedforward:
        simulation.queue_effort(t + rest, model.torque(state))
    samples = [simulation.next_sample() for _ in range(periods)]
    times = np.array([sample.time_ns for sample in samples]) * 1e-9
    q = np.array([sample.q for sample in samples])
    moving = (times > rest) & (times < rest + t[-1])
    wanted = np.stack([np.interp(times[moving] - rest, t, state.q[:, joint])
                       for joint in range(4)], axis=1)
    return samples, q[moving] - wanted, simulation


def test_the_simulation_tracks_and_feedforward_improves_it():
    _, without, _ = simulated(False)
    _, helped, _ = simulated(True)
    assert 1e-3 < np.sqrt(np.mean(without ** 2)) < 2e-2
    assert np.sqrt(np.mean(helped ** 2)) < 0.1 * np.sqrt(np.mean(without ** 2))


def test_a_seed_makes_the_same_samples_bit_for_bit():
    first, _, _ = simulated(True, seed=5, noise=0.1, periods=300)
    again, _, _ = simulated(True, seed=5, noise=0.1, periods=300)
    other, _, _ = simulated(True, seed=6, noise=0.1, periods=300)
    same = [np.array_equal(a.voltage, b.voltage) and np.array_equal(a.q, b.q)
            for a, b in zip(first, again)]
    assert all(same)
    assert not np.array_equal(first[10].voltage, other[10].voltage)
    noise = np.array([a.effort - b.effort for a, b in zip(first, other)])[:150]
    assert np.std(noise) == pytest.approx(0.1 * np.sqrt(2.0), rel=0.1)


def test_effort_is_gain_times_voltage_and_stamps_are_even():
    samples, _, simulation = simulated(True, periods=50)
    gain = np.asarray(REFERENCE.drives.gain)
    for sample in samples:
        np.testing.assert_allclose(sample.effort, gain * sample.voltage)
        np.testing.assert_allclose(sample.effort, sample.true_torque, atol=1e-9)
    assert set(np.diff([sample.time_ns for sample in samples])) == {1_000_000}
    assert samples[0].time_ns > 0
    simulation.reset()
    assert simulation.next_sample().time_ns == samples[0].time_ns


@pytest.mark.parametrize('delay', [0.0, 1.4e-3, -1.4e-3])
@pytest.mark.parametrize('rate', [500, 200, 50])
def test_samples_at_a_low_rate_are_some_of_those_at_a_high_one(rate, delay):
    """Torques as well as positions: the steps between two samples do not overwrite what is told."""
    told = []
    for own in (1000, rate):
        simulation = build_simulation(IDEAL, model_of(entry('time_offset', delay=delay)),
                                      'exact', 1.0 / own)
        simulation.queue_reference(0.1 + MOTION.t, MOTION.q, MOTION.qd, MOTION.qdd)
        told.append(simulation.next_samples(round(0.6 * own)))
    many, few = told
    same = np.searchsorted(many.time_ns, few.time_ns)
    np.testing.assert_array_equal(many.time_ns[same], few.time_ns)
    assert np.ptp(many.effort, axis=0).min() > 2.0
    for name in ('q', 'effort', 'true_torque'):
        np.testing.assert_allclose(getattr(few, name), getattr(many, name)[same], rtol=0,
                                   atol=1e-9)


def test_a_resting_machine_stays_at_home():
    model = read_model('table1_full', REFERENCE)
    simulation = build_simulation(REFERENCE, model, 'exact')
    samples = [simulation.next_sample() for _ in range(500)]
    np.testing.assert_allclose(samples[-1].true_pose, samples[0].true_pose, atol=1e-9)


def test_rates_that_do_not_divide_and_unknown_fidelity_are_refused():
    model = read_model('table1', REFERENCE)
    with pytest.raises(InputError, match='3000 Hz asked, the physics runs at 4000 Hz'):
        build_simulation(REFERENCE, model, 'exact', 1.0 / 3000.0)
    with pytest.raises(InputError, match='known are accurate, fast, exact'):
        build_simulation(REFERENCE, model, 'perfect')
