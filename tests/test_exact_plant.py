"""The exact plant against energy, inverse dynamics, and the physics of sticking."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from par4_dynamics.mechanism import kinetic_energy, potential_energy
from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_platform
from par4_kinematics.errors import UnreachableError
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import JOINT_NAMES
from par4_sim.description.robot_tree import tree_joint_positions
from par4_sim.machines.friction import Friction
from par4_sim.machines.machine import Machine
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.plants.exact import ExactPlant
from robots import REFERENCE, UNEVEN, growing_waves, model_with, other_model

HOME = np.array((0.0, 0.0, -0.78, 0.0))


def free_machine(model, robot=REFERENCE):
    return Machine(robot.geometry, model.lumped_bodies(), Friction())


def holding(model, x, robot=REFERENCE):
    still = np.zeros((1, 4))
    return model.torque(state_of_platform(robot.geometry, np.zeros(1), x[None], still, still))[0]


@pytest.mark.parametrize('name', ['table1', 'table1_full'])
def test_energy_is_kept(name):
    model = read_model(name, REFERENCE)
    plant = ExactPlant(free_machine(model), dt=1e-3)
    plant.reset((0.1, 0.05, -0.7, 0.3))
    bodies = model.lumped_bodies()
    start = potential_energy(REFERENCE.geometry, bodies, plant.x)
    worst, peak = 0.0, 0.0
    for _ in range(300):
        plant.step(np.zeros(4))
        kinetic = kinetic_energy(REFERENCE.geometry, bodies, plant.x, plant.xd)
        potential = potential_energy(REFERENCE.geometry, bodies, plant.x)
        worst, peak = max(worst, abs(kinetic + potential - start)), max(peak, kinetic)
    assert peak > 1.0
    assert worst < 1e-6 * peak


@pytest.mark.parametrize(('robot', 'model'), [
    (REFERENCE, read_model('table1_full', REFERENCE)), (UNEVEN, other_model())],
    ids=['reference', 'uneven'])
def test_inverse_dynamics_drives_the_plant_along_the_motion(robot, model):
    """Torques of a smooth motion, friction included, reproduce it to the order of the step."""
    steps, dt = 1200, 0.25e-3
    t = np.arange(steps + 1) * dt
    # a held torque acts at the middle of its step
    state = state_of_platform(robot.geometry, t + 0.5 * dt,
                              *growing_waves(robot, t + 0.5 * dt, t[-1]))
    torque = model.torque(state)
    x, _, _ = growing_waves(robot, t, t[-1])
    expected = inverse_kinematics(robot.geometry, x)
    plant = ExactPlant(machine_of_model(robot, model), dt)
    plant.reset(x[0])
    worst = 0.0
    for k in range(steps):
        plant.step(torque[k])
        worst = max(worst, np.abs(plant.q - expected[k + 1]).max())
    assert np.ptp(expected, axis=0).max() > 0.2
    assert worst < 1e-3


def test_a_held_joint_stays_where_it_is():
    model = read_model('table1_full', REFERENCE)
    plant = ExactPlant(machine_of_model(REFERENCE, model))
    plant.reset(HOME)
    q = plant.q
    torque = holding(model, HOME) + (2.4, -2.4, 2.0, 0.0)  # below f_c = 2.43
    for _ in range(2000):
        plant.step(torque)
    np.testing.assert_array_equal(plant.q, q)


def test_breakaway_at_the_coulomb_level():
    model = read_model('table1', REFERENCE)
    plant = ExactPlant(machine_of_model(REFERENCE, model))
    for excess, moves in ((-0.01, False), (0.05, True)):
        plant.reset(HOME)
        q = plant.q
        for _ in range(400):
            plant.step(holding(model, HOME) + np.full(4, 2.43 + excess))
        assert (np.abs(plant.q - q).max() > 1e-5) == moves


def test_stribeck_raises_breakaway():
    model = model_with(read_model('table1', REFERENCE), 'stribeck', stribeck_torque=1.0,
                       stribeck_velocity=0.1)
    plant = ExactPlant(machine_of_model(REFERENCE, model))
    plant.reset(HOME)
    q = plant.q
    for _ in range(400):
        plant.step(holding(model, HOME) + np.full(4, 3.3))
    np.testing.assert_array_equal(plant.q, q)
    for _ in range(400):
        plant.step(holding(model, HOME) + np.full(4, 3.5))
    assert np.abs(plant.q - q).max() > 1e-3


def test_friction_takes_the_energy_that_is_lost():
    """Free decay: the energy lost is the work of f_c |qd| + f_v qd^2."""
    model = read_model('table1', REFERENCE)
    bodies = model.lumped_bodies()
    plant = ExactPlant(machine_of_model(REFERENCE, model))
    plant.reset(HOME)
    push = holding(model, HOME)

    def energy():
        return float(kinetic_energy(REFERENCE.geometry, bodies, plant.x, plant.xd)
                     + potential_energy(REFERENCE.geometry, bodies, plant.x))

    work = lost = 0.0
    for k in range(3000):
        torque = push + 12.0 * np.sin(2 * np.pi * 2.0 * k * plant.dt) * np.array((1, -1, .5, .2))
        before, q = plant.qd, plant.q
        plant.step(torque)
        work += float(torque @ (plant.q - q))
        speed = 0.5 * (before + plant.qd)
        lost += float(np.sum(2.43 * np.abs(plant.q - q) + 2.04 * speed ** 2 * plant.dt))
    change = energy() - float(potential_energy(REFERENCE.geometry, bodies, HOME))
    assert lost > 1.0
    assert abs(work - lost - change) < 2e-3 * lost


def test_joints_come_to_rest_and_stay():
    model = read_model('table1', REFERENCE)
    plant = ExactPlant(machine_of_model(REFERENCE, model))
    plant.reset(HOME)
    torque = holding(model, HOME)
    for _ in range(400):
        plant.step(torque + 8.0)
    assert np.abs(plant.qd).max() > 0.1
    for _ in range(4000):
        plant.step(torque)
    np.testing.assert_array_equal(plant.qd, 0.0)


@pytest.mark.parametrize(('name', 'values', 'extra'), [
    ('torque_offset', {'offset': (0.5, -0.4, 0.3, 0.0)},
     lambda q: np.array((0.5, -0.4, 0.3, 0.0)) + 0.0 * q),
    ('cogging', {'amplitude': 0.7, 'periods': 24.0, 'phase': (0.0, 1.0, 2.0, 3.0)},
     lambda q: 0.7 * np.sin(24.0 * q + np.array((0.0, 1.0, 2.0, 3.0)))),
])
def test_an_effect_loads_the_drives_with_its_torque(name, values, extra):
    """What holds the frictionless machine still is gravity plus the effect, by its physics."""
    model = model_with(read_model('table1', REFERENCE), name, **values)
    machine = machine_of_model(REFERENCE, model)
    machine = replace(machine, friction=Friction())
    plant = ExactPlant(machine)
    plant.reset(HOME)
    plain = holding(read_model('table1', REFERENCE), HOME)
    plant.step(plain + extra(plant.q))
    assert np.abs(plant.qd).max() < 1e-9
    plant.reset(HOME)
    plant.step(plain)
    moved = np.abs(plant.qd)
    assert moved.max() > 1e-4


def test_out_of_reach_is_an_error_not_a_nan():
    plant = ExactPlant(free_machine(read_model('table1', REFERENCE)))
    with pytest.raises(UnreachableError, match='leg'):
        plant.reset((0.9, 0.0, -0.78, 0.0))
    plant.reset(HOME)

    def drive_away():
        for _ in range(20000):
            plant.step((80.0, -80.0, 60.0, 10.0))

    with pytest.raises(UnreachableError, match='driven out of reach'):
        drive_away()


def test_passive_joints_are_those_of_the_pose():
    plant = ExactPlant(free_machine(read_model('table1', REFERENCE)))
    plant.reset((0.1, 0.05, -0.75, 0.3))
    for _ in range(100):
        plant.step((5.0, -5.0, 3.0, 1.0))
    expected = tree_joint_positions(REFERENCE.geometry, plant.x)
    passive = plant.passive_joints()
    assert {*passive, *JOINT_NAMES} == set(expected)
    assert not {*passive} & {*JOINT_NAMES}
    assert passive == {name: expected[name] for name in passive}
