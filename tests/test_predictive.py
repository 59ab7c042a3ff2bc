"""Model predictive control: computed torque without limits, and limits kept before they are met."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import nnls

from par4_dynamics.model_from_file import read_model
from par4_kinematics.adept import adept_motion
from par4_kinematics.motion import waypoints_motion
from par4_sim.choices import STEP
from par4_sim.closed_loop.simulation import build_plant, build_simulation
from par4_sim.drives import predictive
from par4_sim.drives.computed_torque import ComputedTorque
from par4_sim.drives.controller import CORRECTION
from par4_sim.drives.laws import command_of
from par4_sim.drives.prediction import responses
from par4_sim.drives.predictive import HORIZON
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.tracking.case import Plan
from par4_sim.tracking.metrics import tracking_of
from par4_sim.tracking.run import feedforward_of, record_run
from robots import REFERENCE, model_with, with_drives

MACHINE = read_model('table1_full', REFERENCE)
TABLE_1 = read_model('table1', REFERENCE)
SMOOTH = adept_motion(REFERENCE, jerk=30_000.0)
TRAPEZOIDS = adept_motion(REFERENCE)
LAWS = ('loops', 'computed_torque', 'predictive')


def followed(robot, motion, law, machine=MACHINE, known=MACHINE):
    run = record_run(robot, machine, motion, feedforward_of(robot, known, motion), law=law,
                     known=known)
    return run, tracking_of(run, space=robot.limits.workspace)


def test_its_margin_is_that_of_computed_torque_over_the_whole_workspace():
    plan = Plan(REFERENCE, MACHINE, SMOOTH)
    margin = plan.margin('predictive', TABLE_1)
    assert margin == plan.margin('computed_torque', TABLE_1)
    assert margin.modulus > 0.9
    assert plan.margin('loops', None).modulus < 0.5 * margin.modulus


@pytest.mark.parametrize('motion', [SMOOTH, TRAPEZOIDS], ids=['smooth', 'torque that jumps'])
def test_where_no_limit_is_met_it_is_computed_torque_to_the_last_bit(motion):
    ahead, _ = followed(REFERENCE, motion, 'predictive')
    plain, _ = followed(REFERENCE, motion, 'computed_torque')
    np.testing.assert_array_equal(ahead.command, plain.command)
    np.testing.assert_array_equal(ahead.pose, plain.pose)


def test_errors_of_the_coupled_machine_answer_to_corrections_as_predicted():
    """Held corrections on an exact plant without friction, at a pose with strong coupling."""
    robot = with_drives(encoder_counts=0, integral_gain=0.0)
    values = {**MACHINE.values, 'coulomb_friction': np.zeros(4), 'viscous_friction': np.zeros(4)}
    free_of_friction = MACHINE.__class__(MACHINE.rigid_body, values, MACHINE.bodies)
    plant = build_plant(machine_of_model(robot, free_of_friction), 'exact')
    pose, still = np.array((0.3, -0.2, -0.7, 0.5)), np.zeros(4)
    plant.reset(pose)
    law = ComputedTorque(robot, free_of_friction, 1e6, STEP)
    law.restart(free_of_friction.torque_of_platform(robot.geometry, pose, still, still))
    target = np.concatenate((plant.q, np.zeros(16)))
    begin = plant.q.copy()
    corrections = np.random.default_rng(3).normal(0.0, 20.0, (10, 4))
    _, forced = responses(law.gains[0], law.gains[1], 2e-3, len(corrections))
    expected = forced @ corrections
    for row, correction in enumerate(corrections):
        law.state[CORRECTION] = correction
        for step in range(8):
            if step == 4:
                found = np.stack((begin - plant.q, -plant.qd))
                np.testing.assert_allclose(found[0], expected[row, 0], atol=0.03 * np.abs(
                    expected[:, 0]).max())
                np.testing.assert_allclose(found[1], expected[row, 1], atol=0.03 * np.abs(
                    expected[:, 1]).max())
            command_of(law.law, target, plant.q, plant.qd, law.state, law.counts, law.command)
            plant.step(law.command)


def test_the_law_without_limits_is_optimal_and_corrections_cost_their_own_square():
    """Integral of stiffness^2 e^2 + (damping^2 - 2 stiffness) ed^2 + a^2 = optimum + that of c^2.
    """
    damping, stiffness = ComputedTorque(REFERENCE, MACHINE, 200.0, STEP).gains[:2]
    assert damping ** 2 > 2.0 * stiffness

    def cost(correction):
        def rate(t, state):
            e, ed, _, _ = state
            c = correction(t)
            feedback = damping * ed + stiffness * e + c
            return (ed, -feedback, stiffness ** 2 * e ** 2
                    + (damping ** 2 - 2.0 * stiffness) * ed ** 2 + feedback ** 2, c ** 2)

        end = solve_ivp(rate, (0.0, 0.6), (1e-2, -0.5, 0.0, 0.0), rtol=1e-9, atol=1e-12,
                        max_step=1e-3).y[:, -1]
        return end[2], end[3]

    optimum, _ = cost(np.zeros_like)
    for correction in (lambda t: 40.0 * np.sin(90.0 * t) * (t < 0.1),
                       lambda t: -30.0 * (t < 0.03)):
        total, own = cost(correction)
        assert total - optimum == pytest.approx(own, rel=1e-3)


def test_the_programs_are_solved_to_the_optimum(monkeypatch):
    """Least distance by another method: nonnegative least squares (Lawson and Hanson 1974)."""
    seen = []
    solve = predictive.daqp.solve

    def kept(cost, slope, rows, high, low, *args, **options):
        answer = solve(cost, slope, rows, high, low, *args, **options)
        seen.append((cost, rows, high, low, answer[0]))
        return answer

    monkeypatch.setattr(predictive.daqp, 'solve', kept)
    followed(with_drives(torque_limit=90.0), SMOOTH, 'predictive')
    assert len(seen) > 100
    for cost, rows, high, low, found in seen[::25]:
        np.testing.assert_array_equal(cost, np.eye(len(cost)))
        bounded = np.concatenate((-high, low)) > -1e20
        sides, bounds = np.vstack((-rows, rows))[bounded], np.concatenate((-high, low))[bounded]
        force, _ = nnls(np.vstack((sides.T, bounds)), np.append(np.zeros(rows.shape[1]), 1.0))
        rest = np.vstack((sides.T, bounds)) @ force - np.append(np.zeros(rows.shape[1]), 1.0)
        nearest = -rest[:-1] / rest[-1]
        np.testing.assert_allclose(found, nearest, atol=2e-3 * np.abs(nearest).max())


def test_programs_that_are_not_solved_are_counted_and_leave_computed_torque(monkeypatch):
    robot = with_drives(torque_limit=110.0)
    solved, _ = followed(robot, SMOOTH, 'predictive')
    assert solved.counts['unsolved_programs'] == 0
    solve = predictive.daqp.solve
    monkeypatch.setattr(predictive.daqp, 'solve', lambda *args, **options: (
        *solve(*args, **options)[:2], -1, {}))
    run, _ = followed(robot, SMOOTH, 'predictive')
    assert run.counts['unsolved_programs'] > 50
    plain, _ = followed(robot, SMOOTH, 'computed_torque')
    np.testing.assert_array_equal(run.command, plain.command)


@pytest.mark.parametrize(('motion', 'limit'), [(SMOOTH, 110.0), (SMOOTH, 70.0), (TRAPEZOIDS, 70.0)])
def test_a_motion_that_asks_for_more_torque_than_there_is_is_followed_best(motion, limit):
    """142 N m would be needed; looking ahead brakes before the torque is missing."""
    found = {law: followed(with_drives(torque_limit=limit), motion, law)[1] for law in LAWS}
    assert found['predictive'].peak < 0.6 * min(found[law].peak for law in LAWS[:2])
    assert found['predictive'].rms < 0.6 * min(found[law].rms for law in LAWS[:2])
    assert all(part.peak_torque <= limit for part in found.values())


@pytest.mark.parametrize('known', [TABLE_1, MACHINE], ids=['TABLE 1', 'no payload'])
def test_with_a_model_that_is_wrong_it_still_gains_and_comes_to_rest(known):
    machine = model_with(MACHINE, 'payload', mass=0.1, half=1.0)
    robot = with_drives(torque_limit=80.0)
    (run, ahead), (_, plain) = (followed(robot, SMOOTH, law, machine, known)
                                for law in ('predictive', 'computed_torque'))
    assert ahead.peak < 0.7 * plain.peak
    assert np.abs(run.q[-1] - SMOOTH.q[-1]).max() < 1e-3
    assert np.abs(run.qd[-1]).max() < 0.01


def test_the_speed_limit_is_kept_before_it_is_met():
    limit = 7.0
    found = {law: followed(with_drives(speed_limit=limit), SMOOTH, law)[1] for law in LAWS}
    assert found['predictive'].peak_speed < 1.005 * limit
    assert found['loops'].peak_speed > 1.05 * limit
    assert found['computed_torque'].peak_speed > 1.05 * limit


def test_d_stays_in_the_workspace_where_the_torque_to_stop_is_missing():
    """A move to 0.1 mm from the edge that asks for 113 N m to brake, of which there are 80."""
    motion = waypoints_motion(REFERENCE, ((0.2, 0.0, -0.75, 0.0), (0.4999, 0.0, -0.75, 0.0)),
                              speed=5.0, acceleration=150.0, jerk=30_000.0)
    found = {law: followed(with_drives(torque_limit=80.0), motion, law)[1] for law in LAWS}
    assert found['predictive'].outside < 0.05e-3
    assert min(found['loops'].outside, found['computed_torque'].outside) > 1e-3


@pytest.mark.parametrize(('law', 'ahead'), [('computed_torque', 0.0), ('predictive', HORIZON)])
def test_a_machine_waits_for_the_torque_of_all_that_its_drives_look_at(law, ahead):
    simulation = build_simulation(REFERENCE, MACHINE, 'exact', law=law, known=MACHINE)
    rest = np.zeros((200, 4))
    times = 1e-3 * np.arange(1, 201)
    simulation.queue_reference(times, rest + simulation.q, rest, rest)
    simulation.queue_effort(times[:100], rest[:100] + 1.0)
    while not simulation.effort_missing():
        simulation.next_sample()
    assert simulation.time == pytest.approx(times[100] - ahead, abs=3e-3)
    simulation.queue_effort(times[100:], rest[100:] + 1.0)
    assert not simulation.effort_missing()
