"""Springs and gaps between motors and arms, against textbook two-mass systems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flywheels import Flywheels

from par4_dynamics.mechanism import joint_mass_matrix, kinetic_energy, potential_energy
from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_platform
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.workspace import home_pose
from par4_sim.closed_loop.simulation import Simulation, build_plant
from par4_sim.machines.friction import Friction
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.machines.noise import Noise
from par4_sim.machines.transmission import Transmission
from par4_sim.plants.elastic import ElasticPlant, Motors, motor_step, split_machine
from par4_sim.plants.exact import ExactPlant
from robots import REFERENCE, growing_waves

MACHINE = machine_of_model(REFERENCE, read_model('table1_full', REFERENCE))
FRICTIONLESS = replace(MACHINE, friction=Friction())
HOME = home_pose(REFERENCE)
RIGID = np.inf
LOCKED = 1e9
"""Inertia of an arm that does not move, kg m2."""


def all_joints(value):
    return np.full(4, float(value))


def two_masses(stiffness=2e4, gap=0.0, damping=0.0, motor=0.05, arm=0.08, friction=None,
               substeps=2, dt=0.25e-3):
    """Return four pairs of inertias, each with a spring between them."""
    motors = Motors(np.full(4, True), all_joints(stiffness), all_joints(gap), all_joints(damping),
                    all_joints(motor), friction or Friction(), 0.0)
    return ElasticPlant(Flywheels(arm, dt / substeps), motors, substeps)


def run(plant, tau, steps):
    """Return motor positions, motor velocities and arm positions (n, 4) under constant torque."""
    told = []
    for _ in range(steps):
        plant.step(np.broadcast_to(tau, (4,)))
        told.append((plant.q, plant.qd, plant.arms))
    return (np.array(part) for part in zip(*told))


def frequency(values, dt):
    """Return the frequency (rad/s) of an oscillation (n,) around its mean, by zero crossings."""
    values = values - values.mean()
    before = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    crossing = before - values[before] / (values[before + 1] - values[before])
    return 2.0 * np.pi * (len(crossing) - 1) / ((crossing[-1] - crossing[0]) * dt)


# ---------------------------------------------------------------------------- two masses


@pytest.mark.parametrize('stiffness', [1e3, 1e4, 1e5])
def test_the_resonance_is_that_of_two_masses_on_a_spring(stiffness):
    motor, arm = 0.05, 0.08
    plant = two_masses(stiffness, motor=motor, arm=arm, substeps=4)
    run(plant, 1.0, 1)
    q, _, arms = run(plant, 0.0, 4000)
    expected = np.sqrt(stiffness * (1.0 / motor + 1.0 / arm))
    assert frequency((q - arms)[:, 0], plant.dt) == pytest.approx(expected, rel=2e-3)


def test_energy_and_momentum_are_kept():
    stiffness, motor, arm = 2e4, 0.05, 0.08
    plant = two_masses(stiffness, motor=motor, arm=arm)
    run(plant, 3.0, 10)
    told = []
    for _ in range(8000):
        plant.step(np.zeros(4))
        told.append((plant.q, plant.qd, plant.arms, plant._plant.qd))
    q, qd, arms, arm_rate = (np.array(part)[:, 0] for part in zip(*told))
    momentum = motor * qd + arm * arm_rate
    np.testing.assert_allclose(momentum, 3.0 * 10 * plant.dt, rtol=1e-9)
    energy = 0.5 * motor * qd ** 2 + 0.5 * arm * arm_rate ** 2 + 0.5 * stiffness * (q - arms) ** 2
    first, last = energy[:2000], energy[-2000:]
    assert np.ptp(energy) < 0.02 * energy.mean()  # a leapfrog's ripple
    assert abs(last.mean() - first.mean()) < 1e-4 * energy.mean()  # and no drift


def test_the_spring_swings_out_with_its_damping_ratio():
    stiffness, motor, arm, ratio = 2e4, 0.05, 0.08, 0.02
    both = motor * arm / (motor + arm)
    plant = two_masses(stiffness, damping=2.0 * ratio * np.sqrt(stiffness * both), motor=motor,
                       arm=arm, substeps=4)
    run(plant, 1.0, 1)
    q, _, arms = run(plant, 0.0, 400)
    twist = np.abs((q - arms)[:, 0])
    peaks = np.flatnonzero((twist[1:-1] > twist[:-2]) & (twist[1:-1] >= twist[2:])) + 1
    rate = np.sqrt(stiffness / both)
    slope = np.polyfit(peaks * plant.dt, np.log(twist[peaks]), 1)[0]
    assert -slope / rate == pytest.approx(ratio, rel=0.05)


def test_against_a_locked_arm_the_motor_turns_by_torque_over_stiffness():
    stiffness, tau = 2e4, np.array((5.0, -5.0, 20.0, 1.0))
    plant = two_masses(stiffness, damping=20.0, arm=LOCKED)
    run(plant, tau, 8000)
    np.testing.assert_allclose(plant.q, tau / stiffness, rtol=1e-3)
    np.testing.assert_allclose(plant.arms, 0.0, atol=1e-6)


@pytest.mark.parametrize('gap', [0.0, 1e-3, 5e-3])
def test_lost_motion_is_the_gap(gap):
    stiffness, push = 1e5, 2.0
    plant = two_masses(stiffness, gap=gap, damping=40.0, arm=LOCKED, substeps=4,
                       friction=Friction(viscous=all_joints(5.0)))
    ends = []
    for tau in (push, -push, push):
        run(plant, tau, 8000)
        ends.append(plant.q[0])
    assert ends[0] - ends[1] == pytest.approx(gap + 2.0 * push / stiffness, rel=1e-3)
    assert ends[2] == pytest.approx(ends[0], abs=1e-7)


def test_within_the_gap_the_motor_is_free():
    plant = two_masses(1e5, gap=0.1, motor=0.05)
    q, qd, arms = run(plant, 1.0, 100)
    t = plant.dt * np.arange(1, 101)
    np.testing.assert_allclose(q[:, 0], 0.5 * 20.0 * t ** 2, rtol=1e-9)
    np.testing.assert_allclose(qd[:, 0], 20.0 * t, rtol=1e-9)
    np.testing.assert_array_equal(arms, 0.0)


def test_a_motor_sticks_below_its_breakaway_torque_and_slides_above():
    friction = Friction(coulomb=all_joints(2.0), stribeck_torque=all_joints(0.5),
                        stribeck_velocity=all_joints(0.05))
    plant = two_masses(2e4, damping=20.0, arm=LOCKED, friction=friction)
    q, qd, _ = run(plant, (2.4, -2.4, 2.6, -2.6), 4000)
    np.testing.assert_array_equal(q[:, :2], 0.0)
    np.testing.assert_array_equal(qd[:, :2], 0.0)
    assert q[-1, 2] > 0.0 > q[-1, 3]
    np.testing.assert_array_equal(qd[-1], 0.0)  # it comes to rest for good


def test_friction_takes_its_torque_from_the_motion():
    coulomb, viscous, motor, arm, tau = 2.0, 1.5, 0.05, 0.08, 6.0
    plant = two_masses(1e5, damping=20.0, motor=motor, arm=arm, substeps=4, friction=Friction(
        coulomb=all_joints(coulomb), viscous=all_joints(viscous)))
    _, qd, _ = run(plant, tau, 4000)
    t = plant.dt * np.arange(1, 4001)
    rise = 1.0 - np.exp(-viscous * t / (motor + arm))
    np.testing.assert_allclose(qd[200:, 0], (tau - coulomb) / viscous * rise[200:], rtol=3e-3)
    assert qd[-1, 0] == pytest.approx((tau - coulomb) / viscous, rel=2e-5)


def test_presliding_gives_way_until_the_bent_contact_holds():
    distance, coulomb, push = 2e-3, 2.0, 0.2
    friction = Friction(coulomb=all_joints(coulomb), presliding_distance=distance,
                        viscous=all_joints(50.0))
    plant = two_masses(1e6, gap=1.0, friction=friction)  # the arm is out of reach
    run(plant, push, 4000)
    # f_c (1 - exp(-q / x_s)) = push
    np.testing.assert_allclose(plant.q, -distance * np.log(1.0 - push / coulomb), rtol=1e-3)


# ---------------------------------------------------------------------------- the mechanism


def elastic(machine, stiffness, **options):
    return replace(machine, transmission=Transmission(stiffness=all_joints(stiffness), **options))


def test_a_rigid_transmission_changes_nothing():
    assert Transmission().is_rigid
    assert isinstance(build_plant(MACHINE, 'exact'), ExactPlant)
    assert not Transmission(gap=np.array((0.0, 1e-3, 0.0, 0.0))).is_rigid
    assert not Transmission(stiffness=np.array((RIGID, 1e4, RIGID, RIGID))).is_rigid


def test_splitting_keeps_inertia_and_friction_once():
    machine = replace(MACHINE, transmission=Transmission(
        stiffness=np.array((RIGID, 1e4, 1e4, RIGID)), gap=np.array((0.0, 0.0, 0.0, 1e-3)),
        motor_share=0.3))
    driven, motors = split_machine(machine)
    np.testing.assert_allclose(driven.bodies.actuator_inertia + motors.inertia,
                               np.broadcast_to(MACHINE.bodies.actuator_inertia, (4,)))
    np.testing.assert_array_equal(motors.elastic, (False, True, True, True))
    np.testing.assert_allclose(motors.inertia[1:] / MACHINE.bodies.actuator_inertia[1:], 0.3)
    assert motors.inertia[0] == 0.0
    np.testing.assert_array_equal(driven.friction.coulomb > 0.0, (True, False, False, False))
    assert driven.transmission.is_rigid


@pytest.mark.parametrize('gap', [0.0, 2e-3])
def test_at_rest_the_springs_are_wound_by_gravity_and_lie_on_their_flanks(gap):
    stiffness = 2e3
    plant = build_plant(elastic(FRICTIONLESS, stiffness, gap=all_joints(gap)), 'exact')
    plant.reset(HOME)
    # potential energy over the joints: the torque that holds is its gradient
    geometry, step = REFERENCE.geometry, 1e-6
    ahead, behind = HOME + step * np.eye(4), HOME - step * np.eye(4)
    height = [potential_energy(geometry, MACHINE.bodies, x) for x in (ahead, behind)]
    q = [inverse_kinematics(geometry, x) for x in (ahead, behind)]
    holding = np.linalg.solve(q[0] - q[1], height[0] - height[1])
    wound = holding / stiffness + np.sign(holding) * 0.5 * gap
    np.testing.assert_allclose(plant.q - plant.arms, wound, rtol=1e-3)
    _, qd, arms = run(plant, holding, 400)
    assert np.abs(qd).max() < 1e-4
    np.testing.assert_allclose(arms[-1], arms[0], atol=1e-6)


@pytest.mark.parametrize(('fidelity', 'tolerance'), [('exact', 5e-3), ('fast', 0.02)])
def test_resonances_of_the_mechanism(fidelity, tolerance):
    stiffness = 1e4
    machine = elastic(FRICTIONLESS, stiffness, damping_ratio=0.0)
    driven, motors = split_machine(machine)
    mass = joint_mass_matrix(REFERENCE.geometry, driven.bodies, HOME)
    both = np.diag(1.0 / motors.inertia) + np.linalg.inv(mass)
    rates, shapes = np.linalg.eig(stiffness * both)
    for which in (np.argmin(rates), np.argmax(rates)):
        plant = build_plant(machine, fidelity)
        plant.reset(HOME)
        start = plant.q - plant.arms
        holding = stiffness * start
        shape, told = shapes[:, which], []
        for step in range(400):
            # a short push on the motors in the shape of one mode of the twist
            plant.step(holding + (5.0 * shape if step < 4 else 0.0))
            told.append((plant.q - plant.arms - start) @ shape)
        found = frequency(np.array(told[4:]), plant.dt)
        assert found == pytest.approx(np.sqrt(rates[which]), rel=tolerance)
        plant.close()


def test_the_energy_of_mechanism_motors_and_springs_is_kept():
    stiffness = 1e4
    machine = elastic(FRICTIONLESS, stiffness, damping_ratio=0.0)
    driven, motors = split_machine(machine)
    plant = build_plant(machine, 'exact')
    plant.reset(HOME)
    kinetic, potential = [], []
    for _ in range(800):  # it falls and swings
        plant.step(np.zeros(4))
        x, xd, twist = plant.x, plant.xd, plant.q - plant.arms
        kinetic.append(kinetic_energy(REFERENCE.geometry, driven.bodies, x, xd)
                       + 0.5 * np.sum(motors.inertia * plant.qd ** 2))
        potential.append(potential_energy(REFERENCE.geometry, driven.bodies, x)
                         + 0.5 * stiffness * np.sum(twist ** 2))
    energy = np.array(kinetic) + np.array(potential)
    assert np.ptp(energy) < 2e-3 * max(kinetic)


def test_a_stiffer_spring_is_nearer_to_a_rigid_machine():
    rigid = build_plant(MACHINE, 'exact')
    rigid.reset(HOME)
    tau = np.array((12.0, 3.0, -8.0, 5.0))
    for _ in range(200):
        rigid.step(tau)
    away = []
    for stiffness in (1e4, 1e5):
        plant = build_plant(elastic(MACHINE, stiffness), 'exact')
        plant.reset(HOME)
        for _ in range(200):
            plant.step(tau)
        away.append(np.abs(plant.x - rigid.x).max())
    assert away[1] < 0.25 * away[0] < 2e-3


def test_rigid_joints_beside_elastic_ones_move_with_their_arms():
    machine = replace(MACHINE, transmission=Transmission(
        stiffness=np.array((RIGID, 2e3, RIGID, RIGID))))
    plant = build_plant(machine, 'exact')
    plant.reset(HOME)
    q, _, arms = run(plant, (15.0, 5.0, 12.0, 15.0), 200)
    np.testing.assert_array_equal(q[:, (0, 2, 3)], arms[:, (0, 2, 3)])
    assert np.abs(q - arms)[:, 1].max() > 1e-4
    assert np.abs(arms[-1] - arms[0]).min() > 1e-3


def driven(fidelity, transmission):
    """Return encoder positions and true poses (n, 4) of a motion with feedforward."""
    model = read_model('table1_full', REFERENCE)
    machine = replace(MACHINE, transmission=transmission)
    t = np.arange(0.0, 0.4, 1e-3)
    state = state_of_platform(REFERENCE.geometry, t, *growing_waves(REFERENCE, t, 0.5))
    tau = model.torque(state)
    simulation = Simulation(REFERENCE, build_plant(machine, fidelity), 1e-3, 200.0, tau[0],
                            machine.amplifier, machine.sensors, Noise(), 0)
    simulation.queue_reference(0.1 + t, state.q, state.qd, state.qdd)
    simulation.queue_effort(0.1 + t, tau)
    samples = [simulation.next_sample() for _ in range(450)]
    simulation.close()
    return (np.array([sample.q for sample in samples]),
            np.array([sample.true_pose for sample in samples]))


@pytest.mark.parametrize('transmission', [
    Transmission(stiffness=all_joints(5e3)), Transmission(gap=all_joints(2e-3))])
def test_both_plants_agree_behind_springs_and_gaps(transmission):
    (q, x), (other_q, other_x) = (driven(fidelity, transmission) for fidelity in ('exact', 'fast'))
    rigid_q, rigid_x = driven('exact', Transmission())
    assert np.abs(q - other_q).max() < 5e-4
    assert np.abs(x - other_x).max() < 0.2 * np.abs(x - rigid_x).max()
    assert np.abs(rigid_q - q)[100:].max() > 5e-4


def test_joints_that_stick_beside_soft_ones_need_no_torque_to_be_held():
    """A small torque does not move them at all: before, the start was a singular system."""
    machine = replace(MACHINE, friction=Friction(coulomb=all_joints(9.0)),
                      transmission=Transmission(stiffness=np.array((RIGID, RIGID, 2e3, 2e3))))
    plant = build_plant(machine, 'exact')
    plant.reset(HOME)
    at_first = plant.arms.copy()
    for _ in range(200):
        plant.step(np.zeros(4))
    np.testing.assert_allclose(plant.arms[:2], at_first[:2], atol=1e-9)
    np.testing.assert_allclose(plant.arms[2:], at_first[2:], atol=1e-4)


def test_a_torque_that_nothing_may_write_to_takes_no_kernel_of_its_own():
    """To compile another one takes seconds."""
    plant, compiled = two_masses(), []
    for tau in (np.ones(4), np.broadcast_to(1.0, 4), np.ones((4, 2))[:, 0]):
        plant.step(tau)
        compiled.append(len(motor_step.signatures))
    assert compiled == 3 * compiled[:1]
