"""The laws of the drives: what they promise, how far they are from instability, what they learn."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from par4_dynamics.mechanism import joint_mass_matrix
from par4_dynamics.model_from_file import read_model
from par4_kinematics.adept import adept_motion
from par4_kinematics.errors import InputError
from par4_kinematics.workspace import home_pose
from par4_sim.choices import STEP
from par4_sim.closed_loop.simulation import build_plant, build_simulation
from par4_sim.drives.laws import LAWS, command_of, controller_named
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.tracking.case import Plan, compared
from par4_sim.tracking.learning import learn
from par4_sim.tracking.run import feedforward_of, record_run
from par4_sim.tracking.stability import (
    Gains,
    gains_of_computed_torque,
    gains_of_loops,
    inertias_at,
    inertias_of_workspace,
    is_stable,
    lags_of,
    margin_at,
    margin_over,
)
from robots import REFERENCE, model_with

MACHINE = read_model('table1_full', REFERENCE)
TABLE_1 = read_model('table1', REFERENCE)
TRUE = machine_of_model(REFERENCE, MACHINE)
IDEAL = REFERENCE.model_copy(update={
    'drives': REFERENCE.drives.model_copy(update={'encoder_counts': 0})})
FRICTIONLESS = replace(MACHINE, values={
    **MACHINE.values, 'coulomb_friction': np.zeros(4), 'viscous_friction': np.zeros(4)})
SMOOTH = adept_motion(REFERENCE, jerk=30_000.0)
FAR = np.array((0.3, -0.2, -0.7, 0.5))
"""A pose where the joints feel inertias that differ and couple."""


def answer(law, offset):
    """Return errors (n, 4), rad, of 0.2 s after the joint references jump by offset (4,) at FAR."""
    plant = build_plant(machine_of_model(IDEAL, FRICTIONLESS), 'exact')
    plant.reset(FAR)
    controller = controller_named(law, IDEAL, 1e6, STEP, FRICTIONLESS)
    still = np.zeros((1, 4))
    holding = FRICTIONLESS.torque_of_platform(IDEAL.geometry, FAR, still[0], still[0])
    controller.restart(holding)
    wanted, errors = plant.q + offset, []
    target = np.concatenate((wanted, still[0], still[0], still[0], still[0]))
    for _ in range(800):
        errors.append(wanted - plant.q)
        command_of(controller.law, target, plant.q, plant.qd, controller.state,
                   controller.counts, controller.command)
        plant.step(controller.command)
    return STEP * np.arange(800), np.array(errors)


def test_computed_torque_makes_every_joint_one_and_the_same_linear_loop():
    """At a pose with strong coupling e obeys eddd + damping edd + stiffness ed + integral e = 0.

    The loops of the drives do not: the joint that is moved drags the others along.
    """
    offset = np.array((1e-3, 0.0, 0.0, 0.0))
    t, error = answer('computed_torque', offset)
    gains = gains_of_computed_torque(IDEAL, FRICTIONLESS)
    companion = np.array(((0.0, 1.0, 0.0), (0.0, 0.0, 1.0),
                          (-gains.integral, -gains.stiffness, -gains.damping)))
    begin = np.array((1e-3, 0.0, -gains.stiffness * 1e-3))
    expected = np.array([(expm(companion * time) @ begin)[0] for time in t[::8]])
    np.testing.assert_allclose(error[::8, 0], expected, atol=2e-5)
    assert np.abs(error[:, 1:]).max() < 2e-5
    _, dragged = answer('loops', offset)
    assert np.abs(dragged[:, 1:]).max() > 3.0 * np.abs(error[:, 1:]).max()


def test_both_laws_have_the_same_poles_on_the_mean_inertia_of_home():
    gains, per_inertia = gains_of_loops(REFERENCE.drives), gains_of_computed_torque(
        REFERENCE, MACHINE)
    mean = np.trace(joint_mass_matrix(REFERENCE.geometry, MACHINE.lumped_bodies(),
                                      (0.0, 0.0, -0.78, 0.0))) / 4.0
    np.testing.assert_allclose(np.sort(gains.poles(mean)), np.sort(per_inertia.poles(1.0)))


@pytest.mark.parametrize('law', LAWS)
@pytest.mark.parametrize('integral_gain', [300.0, 0.0])
def test_late_and_lost_feedforward_is_counted_and_never_a_jump(law, integral_gain):
    """A hole of 40 ms in the feedforward, at the highest torque."""
    drives = REFERENCE.drives.model_copy(update={'integral_gain': integral_gain})
    robot = REFERENCE.model_copy(update={'drives': drives})
    whole = feedforward_of(robot, MACHINE, SMOOTH)
    hole = slice(60, 100)

    def commands(torque):
        run = record_run(robot, MACHINE, SMOOTH, torque, law=law, known=MACHINE)
        return run.command[run.t < SMOOTH.duration + 0.1], run.counts['missing_effort'], run

    intact, missing, _ = commands(whole)
    assert missing == 0
    largest = np.abs(np.diff(intact, axis=0)).max()
    lost = whole.copy()
    lost[hole] = np.nan
    broken, missing, run = commands(lost)
    assert missing == hole.stop - hole.start
    assert np.abs(np.diff(broken, axis=0)).max() < 1.3 * largest
    assert np.abs(whole[hole]).max() > 5.0 * largest  # so a jump would show
    assert np.isfinite(run.pose).all()
    if law != 'torque':
        assert np.abs(run.q[-1] - SMOOTH.q[-1]).max() < 5e-3


def test_in_torque_mode_the_torque_is_the_command():
    torque = feedforward_of(REFERENCE, MACHINE, SMOOTH)
    run = record_run(REFERENCE, MACHINE, SMOOTH, torque, law='torque')
    # the command told for a time lies between those of the steps before and after it
    given = run.command[(run.t >= 0.0) & (run.t <= SMOOTH.duration)][::4]
    np.testing.assert_allclose(given[1:-1], torque[1:-1], atol=0.02 * np.abs(torque).max())
    # nobody corrects: an error of 3 % of the inertia is an error of 3 % of the way
    paper = record_run(REFERENCE, MACHINE, SMOOTH, feedforward_of(REFERENCE, TABLE_1, SMOOTH),
                       law='torque')
    gone = [np.abs(part.q[part.t <= SMOOTH.duration][-1] - SMOOTH.q[-1]).max()
            for part in (run, paper)]
    assert gone[0] < 0.3 * gone[1]


@pytest.mark.parametrize(('inertia', 'lag'), [(0.12, 0.0), (0.4, 1e-3), (3.0, 2e-3)])
def test_margins_are_those_of_the_loop_simulated_step_by_step(inertia, lag):
    """Just below its gain margin a loop comes to rest, just above it does not."""
    gains = gains_of_loops(REFERENCE.drives)
    margin = margin_at(gains, inertia, STEP, lag)

    def left(factor, extra_steps=0):
        position, speed, current, integral = 1.0, 0.0, 0.0, 0.0
        queue = [0.0] * extra_steps
        part = gains.scaled(factor)
        sizes = []
        for _ in range(24_000):
            integral -= 0.0
            queue.append(-part.stiffness * position - part.damping * speed - part.integral
                         * integral)
            command = queue.pop(0)
            integral += position * STEP
            fine = STEP / 40.0
            for _ in range(40 if lag else 1):
                step = fine if lag else STEP
                decay = math.exp(-step / lag) if lag else 0.0
                mean = (command + (current - command) * lag / step * (1.0 - decay)) if lag else (
                    command)
                current = command + (current - command) * decay
                position += step * speed + 0.5 * step ** 2 * mean / inertia
                speed += step * mean / inertia
            sizes.append(abs(position))
            if sizes[-1] > 1e6:
                break
        return max(sizes[-200:])

    assert is_stable(gains, inertia, STEP, lag)
    if lag == 0.0:
        assert left(0.98 * margin.gain) < 1.0 < left(1.02 * margin.gain)
        steps = int(margin.delay / STEP)
        assert left(1.0, steps - 1) < 1.0 < left(1.0, steps + 2)
    assert not is_stable(gains.scaled(1.01 * margin.gain), inertia, STEP, lag)
    assert 0.0 < margin.modulus <= 1.0


def largest_pole(gains, inertia, lag, late):
    """Return the largest modulus of the poles of a loop whose command comes `late` steps late."""
    rates = np.zeros((4, 4))  # of position, speed, current and command
    rates[0, 1], rates[1, 2], rates[2, 2:] = 1.0, 1.0 / inertia, (-1.0 / lag, 1.0 / lag)
    moved = expm(rates * STEP)
    feedback = np.zeros(4 + late)  # of position, speed, current, integral, commands on their way
    feedback[[0, 1, 3]] = -gains.stiffness, -gains.damping, -gains.integral
    closed = np.zeros((4 + late, 4 + late))
    closed[:3, :3], closed[3, 0], closed[3, 3] = moved[:3, :3], STEP, 1.0
    closed[:3] += np.outer(moved[:3, 3], np.eye(4 + late)[-1] if late else feedback)
    if late:
        closed[4], closed[5:, 4:-1] = feedback, np.eye(late - 1)
    return np.abs(np.linalg.eigvals(closed)).max()


@pytest.mark.parametrize(('gains', 'inertia', 'lag'), [
    (gains_of_loops(REFERENCE.drives), 0.4, 1e-3), (gains_of_loops(REFERENCE.drives), 3.0, 5e-4),
    (Gains(70.0, 350.0, 440e3), 0.037, 0.015)])
def test_a_loop_bears_the_delay_that_its_margin_says(gains, inertia, lag):
    """The last one is turned beyond -1 where it is large first: not that counts, but the rest."""
    steps = int(margin_at(gains, inertia, STEP, lag).delay / STEP)
    assert steps >= 1
    assert largest_pole(gains, inertia, lag, steps) < 1.0 < largest_pole(
        gains, inertia, lag, steps + 1)


def test_at_the_edge_of_stability_no_delay_is_borne():
    """Where an integral is nearly too much for an inertia, as much as where all gains are."""
    gains = Gains(0.28, 207.0, 194.0)
    low, high = 0.01, 1.0
    while high / low > 1.0 + 1e-9:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if is_stable(gains, middle) else (low, middle)
    assert margin_at(gains, low).delay < 1e-6
    assert largest_pole(gains, low, 1e-7, 1) > 1.0
    strong = gains_of_loops(REFERENCE.drives)
    limit = margin_at(strong, 0.4).gain
    assert margin_at(strong.scaled((1.0 - 1e-9) * limit), 0.4).delay < 1e-6


def test_lags_in_series_delay_by_their_sum():
    gains = gains_of_loops(REFERENCE.drives)
    delay = margin_at(gains, 0.4).delay
    for lags in ((1e-4, 2e-4), (2e-4, 1e-4), (1.5e-4, 1.5e-4), (3e-4, 0.0)):
        assert margin_at(gains, 0.4, STEP, *lags).delay == pytest.approx(delay - 3e-4, rel=5e-3)


def test_an_unstable_loop_has_no_margin():
    gains = Gains(1.0, 1.0, 1e4)
    assert not is_stable(gains, 1.0)
    assert margin_at(gains, 1.0).modulus == 0.0


def test_the_reference_robot_is_stable_over_its_workspace_with_either_law():
    loops = margin_over(gains_of_loops(REFERENCE.drives),
                        inertias_of_workspace(REFERENCE, TRUE))
    model = margin_over(gains_of_computed_torque(REFERENCE, TABLE_1),
                        inertias_of_workspace(REFERENCE, TRUE, TABLE_1))
    assert loops.modulus > 0.2
    assert loops.gain > 2.0
    assert model.modulus > 0.9  # the same at every pose, as far as the model is right


HIDDEN = {
    'nothing': FRICTIONLESS,
    'payload': model_with(FRICTIONLESS, 'payload', mass=5.0, half=1.0),
    'inertias': model_with(FRICTIONLESS, 'joint_inertia_difference',
                           inertia=(0.1, 0.2, -0.05, 0.05)),
    'lag': model_with(FRICTIONLESS, 'actuator_lag', time_constant=5e-3),
    'gains': model_with(FRICTIONLESS, 'drive_gain_error', relative=(-0.5, -0.1, 0.2, 0.4)),
    'dimensions': model_with(FRICTIONLESS, 'geometry_error', arm_length=-0.08)}
"""Machines by what they have beside the bodies of the model."""


def speeds_after_a_jump(robot, hidden, seconds, law='loops'):
    """Return the largest joint speeds of each step after a tiny jump at home, rad/s."""
    simulation = build_simulation(robot, hidden, 'exact', STEP, law=law, known=FRICTIONLESS)
    q = simulation.q
    simulation.queue_reference(np.array((0.01, 0.02)), np.tile(q + 1e-7 * np.arange(4), (2, 1)),
                               *np.zeros((2, 2, 4)))
    return np.abs(simulation.next_samples(round(seconds / STEP)).qd).max(axis=1)


def grows(speed):
    """Return whether speeds (n,) grow, above rounding, to 1 rad/s."""
    quarter = len(speed) // 4
    early, late = speed[quarter:2 * quarter].max(), speed[-quarter:].max()
    return late > max(1e-8, min(1.0, early))


@pytest.mark.parametrize('factor', [0.9, 1.1])
@pytest.mark.parametrize('law', ['loops', 'computed_torque'])
@pytest.mark.parametrize('hidden', sorted(HIDDEN))
def test_the_whole_machine_becomes_unstable_where_the_margin_says(hidden, law, factor):
    """At home, frictionless, with every gain of the drives at 0.9 and 1.1 of its limit."""
    machine = machine_of_model(IDEAL, HIDDEN[hidden])
    gains, known = (gains_of_loops(IDEAL.drives), None) if law == 'loops' else (
        gains_of_computed_torque(IDEAL, FRICTIONLESS), FRICTIONLESS)
    limit = margin_over(gains, inertias_at(IDEAL, machine, home_pose(IDEAL), known), STEP,
                        *lags_of(IDEAL, machine)).gain
    drives = IDEAL.drives.model_copy(update={
        'velocity_gain': factor * limit * IDEAL.drives.velocity_gain, 'torque_limit': 1e6})
    robot = IDEAL.model_copy(update={'drives': drives})
    # a lag makes a slow loop, which takes longer to grow
    speed = speeds_after_a_jump(robot, HIDDEN[hidden], 2.4 if hidden == 'lag' else 0.3, law)
    assert (speed[-100:].max() > 1.0) if factor > 1.0 else (speed[-100:].max() < 1e-5)


@pytest.mark.parametrize('factor', [0.9, 1.1])
@pytest.mark.parametrize('hidden', sorted(HIDDEN))
def test_an_integral_is_too_much_for_the_largest_inertia_where_its_loop_is_unstable(
        hidden, factor):
    machine = machine_of_model(IDEAL, HIDDEN[hidden])
    largest = inertias_at(IDEAL, machine, home_pose(IDEAL)).max()

    def robot_with(integral_gain):
        return IDEAL.model_copy(update={'drives': IDEAL.drives.model_copy(update={
            'integral_gain': integral_gain, 'torque_limit': 1e6})})

    low, high = 1.0, 1e4
    while high / low > 1.001:
        middle = math.sqrt(low * high)
        stable = is_stable(gains_of_loops(robot_with(middle).drives), largest, STEP,
                           *lags_of(IDEAL, machine))
        low, high = (middle, high) if stable else (low, middle)
    speed = speeds_after_a_jump(robot_with(factor * low), HIDDEN[hidden], 2.0)
    assert grows(speed) == (factor > 1.0)


def test_the_margin_of_a_comparison_is_that_of_the_machine_with_its_effects():
    def margin(name='', controller='loops', **values):
        machine = model_with(MACHINE, name, **values) if name else MACHINE
        return Plan(REFERENCE, machine, SMOOTH).margin(controller, TABLE_1)

    plain = margin()
    # where no lag is, all gains count over the smallest inertia
    for relative in (-0.5, 0.2):
        assert margin('drive_gain_error', relative=relative).gain == pytest.approx(
            plain.gain * (1.0 + relative), rel=1e-3)
    assert margin('torque_ripple', relative=0.1, periods=4.0, phase=0.0).gain == pytest.approx(
        0.9 * plain.gain, rel=1e-3)
    assert margin('actuator_lag', time_constant=1e-4).delay == pytest.approx(
        plain.delay - 1e-4, rel=1e-2)
    loaded, heavier = margin('payload', mass=5.0, half=1.0), margin(
        'joint_inertia_difference', inertia=0.1)
    assert loaded.modulus < 0.7 * plain.modulus
    assert loaded.inertia > 2.0 * plain.inertia
    assert heavier.gain > 1.5 * plain.gain
    law = 'computed_torque'
    assert margin('payload', law, mass=5.0, half=1.0).modulus < 0.9 * margin('', law).modulus
    assert margin('elastic_transmission', stiffness=2e4) is None
    assert margin('backlash', law, gap=1e-3) is None


def test_learning_takes_the_error_down_to_the_encoders_within_ten_cycles():
    """From TABLE 1 and even from nothing: below twice the encoders' resolution."""
    resolution = 2.0 * math.pi / REFERENCE.drives.encoder_counts
    start = feedforward_of(REFERENCE, TABLE_1, SMOOTH)
    for feedforward in (start, np.zeros_like(start)):
        learning = learn(REFERENCE, MACHINE, SMOOTH, feedforward, TABLE_1, cycles=10)
        cycles = learning.cycles
        # what is learned does not push the machine once it stands
        assert np.ptp(learning.run.q[learning.run.t > SMOOTH.duration], axis=0).max() < 1e-3
        assert cycles[0].joint_rms > 5.0 * resolution
        assert max(cycle.joint_rms for cycle in cycles[5:]) < resolution
        assert max(cycle.joint_peak for cycle in cycles[5:]) < 2.0 * resolution
        assert cycles[-1].rms < 0.02e-3


def test_learning_does_no_harm_where_the_machine_is_not_what_the_model_says():
    """Springs that ring below the cut-off: without its guard the law drives them to 50 mm."""
    machine = model_with(MACHINE, 'elastic_transmission', stiffness=20_000.0)
    start = feedforward_of(REFERENCE, TABLE_1, SMOOTH)
    learning = learn(REFERENCE, machine, SMOOTH, start, TABLE_1, cycles=6)
    errors = [cycle.joint_rms for cycle in learning.cycles]
    assert min(errors) < 0.9 * errors[0]
    assert max(errors) < 2.0 * errors[0]


def test_what_needs_a_model_is_left_out_where_there_is_none():
    plan = Plan(REFERENCE, MACHINE, SMOOTH)
    cases = compared(plan, ('loops', 'predictive'), {'none': None, 'table1': TABLE_1})
    assert [(case.controller, case.feedforward) for case in cases] == [
        ('loops', 'none'), ('loops', 'table1'), ('predictive', 'table1')]
    assert cases[-1].margin.modulus > cases[0].margin.modulus
    with pytest.raises(InputError, match='learning: needs a model'):
        compared(plan, ('learning',), {'none': None})
    with pytest.raises(InputError, match='known are loops'):
        controller_named('perfect', REFERENCE, 200.0, STEP)
    for law in ('computed_torque', 'predictive'):
        with pytest.raises(InputError, match=f'controller {law}: it needs a model'):
            controller_named(law, REFERENCE, 200.0, STEP)
