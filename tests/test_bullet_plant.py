"""The pybullet plant against inverse dynamics, the equations of motion, energy and friction."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet
import pytest

from par4_dynamics.mechanism import forward_dynamics, kinetic_energy, potential_energy
from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_joints, state_of_platform
from par4_kinematics.errors import InputError, UnreachableError
from par4_kinematics.leg import plate_joint
from par4_kinematics.position import forward_kinematics, inverse_kinematics
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.velocity import joint_velocity
from par4_sim.description.robot_tree import tree_joint_positions
from par4_sim.machines.friction import Friction
from par4_sim.machines.machine import Machine
from par4_sim.pictures.view import View, render
from par4_sim.pictures.window import Window, follow
from par4_sim.plants.bullet import BulletPlant
from par4_sim.plants.exact import ExactPlant
from robots import REFERENCE, UNEVEN, other_model, random_poses

ANIMATE = Path(__file__).parents[1] / 'demo' / 'animate.py'

FIDELITIES = ['accurate', 'fast']
HOME = np.array((0.0, 0.0, -0.78, 0.0))
EDGE = np.array((-0.3, 0.3, -0.58, -0.7))
NOTHING = np.zeros(4)


def frictionless(model):
    still = {name: np.zeros(4) for name in ('coulomb_friction', 'viscous_friction')}
    return replace(model, values=model.values | still)


PAPER = frictionless(read_model('table1', REFERENCE))
FULL = frictionless(read_model('table1_full', REFERENCE))
WITH_TOOL = replace(FULL, bodies=FULL.bodies.model_copy(update={'theta_inertia': 0.004}))


def machine_of(model, robot=REFERENCE, friction=None, loads=()):
    return Machine(robot.geometry, model.lumped_bodies(), friction or Friction(), loads=loads)


@pytest.fixture
def plant_of():
    """Build plants and close them after the test."""
    plants = []

    def build(*arguments, **options):
        plants.append(BulletPlant(*arguments, **options))
        return plants[-1]

    yield build
    for plant in plants:
        plant.close()


def there_and_back(t, duration, start, size):
    """Return x, xd, xdd (n, 4) of start + size sin^4: smooth in jerk, at rest at both ends."""
    rate = np.pi / duration
    sine, cosine = np.sin(rate * t)[:, None], np.cos(rate * t)[:, None]
    return (start + size * sine ** 4, size * 4.0 * rate * sine ** 3 * cosine,
            size * rate ** 2 * (12.0 * sine ** 2 * cosine ** 2 - 4.0 * sine ** 4))


def driven(plant, robot, model, duration, start, size):
    """Return q, qd (n + 1, 4), torques (n, 4) and largest loop opening of a driven motion."""
    t = np.arange(round(duration / plant.dt)) * plant.dt
    wanted = state_of_platform(robot.geometry, t, *there_and_back(t, duration, start, size))
    read = state_of_platform(robot.geometry, t, *there_and_back(
        t + plant.velocity_offset, duration, start, size))
    feedforward = model.torque(wanted)
    inertia = model.values['actuator_inertia']
    plant.reset(wanted.x[0])
    q, qd, torques, opening = [plant.q], [plant.qd], [], 0.0
    for k in range(len(t)):
        torques.append(feedforward[k] + inertia * (
            4000.0 * (wanted.q[k] - plant.q) + 60.0 * (read.qd[k] - plant.qd)))
        plant.step(torques[-1])
        q.append(plant.q)
        qd.append(plant.qd)
        opening = max(opening, plant.loop_opening())
    return np.array(q), np.array(qd), np.array(torques), opening


def torque_of_motion(geometry, model, dt, q, qd):
    """Return the torques (n - 1, 4) that the motion read needs at t_1 .. t_(n-1).

    A velocity belongs to the middle of the step before its reading.
    """
    middle, change = 0.5 * (qd[1:-1] + qd[2:]), (qd[2:] - qd[1:-1]) / dt
    t = np.arange(len(middle)) * dt
    return model.torque(state_of_joints(geometry, t, q[1:-1], middle, change))


@pytest.mark.parametrize('fidelity', FIDELITIES)
@pytest.mark.parametrize(('model', 'turn'), [(PAPER, 0.0), (FULL, 0.0), (FULL, 1.2),
                                             (WITH_TOOL, -1.2)],
                         ids=['paper', 'full', 'full turning', 'tool turning'])
def test_the_torque_is_that_of_inverse_dynamics(plant_of, fidelity, model, turn):
    """Applied = model of the motion made, within 0.02 % of the peak at 20 G."""
    plant = plant_of(machine_of(model), fidelity)
    size = np.array((0.3, 0.05, 0.05, turn))
    q, qd, torques, opening = driven(plant, REFERENCE, model, 0.25, HOME - 0.5 * size, size)
    needed = torque_of_motion(REFERENCE.geometry, model, plant.dt, q, qd)
    peak = np.abs(needed).max()
    assert 80.0 < peak < 200.0
    assert np.abs(torques[1:] - needed).max() < 2e-4 * peak
    assert opening < 3e-6


def test_another_model_is_told_apart():
    """The limit of the test above is far below what it has to notice."""
    t = np.linspace(0.0, 0.25, 100)
    state = state_of_platform(REFERENCE.geometry, t, *there_and_back(
        t, 0.25, HOME, np.array((0.3, 0.05, 0.05, 0.6))))
    full, paper, tool = (model.torque(state) for model in (FULL, PAPER, WITH_TOOL))
    for other in (paper, tool):
        assert np.abs(full - other).max() > 50 * 2e-4 * np.abs(full).max()


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_another_robot(plant_of, fidelity):
    model = frictionless(other_model())
    plant = plant_of(machine_of(model, UNEVEN), fidelity)
    size = np.array((0.15, -0.1, 0.05, 0.8))
    start = np.array((-0.05, 0.05, -0.55, -0.3))
    q, qd, torques, opening = driven(plant, UNEVEN, model, 0.25, start, size)
    needed = torque_of_motion(UNEVEN.geometry, model, plant.dt, q, qd)
    assert np.abs(torques[1:] - needed).max() < 3e-4 * np.abs(needed).max()
    assert opening < 2e-6
    np.testing.assert_allclose(forward_kinematics(UNEVEN.geometry, plant.q)[0:4], plant.x,
                               atol=2e-6)


@pytest.mark.parametrize('fidelity', FIDELITIES)
@pytest.mark.parametrize('x', [HOME, EDGE], ids=['home', 'edge'])
def test_jumps_of_torque_are_answered_within_a_step(plant_of, fidelity, x):
    """The solver converges at once: white torque noise is found again in the motion."""
    plant = plant_of(machine_of(FULL), fidelity)
    plant.reset(x)
    random, start = np.random.default_rng(5), plant.q
    q, qd, torques = [plant.q], [plant.qd], []
    for _ in range(80):
        torques.append(random.normal(0.0, 10.0, 4) - 90.0 * (plant.q - start) - 3.0 * plant.qd)
        plant.step(torques[-1])
        q.append(plant.q)
        qd.append(plant.qd)
    needed = torque_of_motion(REFERENCE.geometry, FULL, plant.dt, np.array(q), np.array(qd))
    residual = np.array(torques)[1:] - needed
    assert np.sqrt(np.mean(residual ** 2)) < 1e-3 * 10.0


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_the_platform_obeys_the_equations_of_motion(plant_of, fidelity):
    """xdd of the engine's own platform = M^-1 (G^T tau - c), derived from the energy."""
    plant = plant_of(machine_of(WITH_TOOL), fidelity)
    plant.reset((0.1, 0.05, -0.75, 0.3))
    torques = 20.0 * np.sin(np.arange(200)[:, None] * plant.dt * np.array((60, 75, 90, 50)))
    x, xd = [plant.x], [plant.xd]
    for torque in torques:
        plant.step(torque)
        x.append(plant.x)
        xd.append(plant.xd)
    x, xd = np.array(x), np.array(xd)
    expected = forward_dynamics(
        REFERENCE.geometry, WITH_TOOL.lumped_bodies(), x[1:-1], 0.5 * (xd[1:-1] + xd[2:]),
        torques[1:])
    found = (xd[2:] - xd[1:-1]) / plant.dt
    assert (np.ptp(expected, axis=0) > (20.0, 5.0, 20.0, 100.0)).all()
    error = np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)
    assert error.max() < 5e-4


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_energy_of_a_free_fall_is_kept(plant_of, fidelity):
    plant = plant_of(machine_of(WITH_TOOL), fidelity)
    plant.reset((0.1, 0.05, -0.7, 0.4))
    bodies, geometry = WITH_TOOL.lumped_bodies(), REFERENCE.geometry
    x, xd = [plant.x], [plant.xd]
    for _ in range(800):
        plant.step(NOTHING)
        x.append(plant.x)
        xd.append(plant.xd)
    x, xd = np.array(x), np.array(xd)
    kinetic = kinetic_energy(geometry, bodies, x[1:-1], 0.5 * (xd[1:-1] + xd[2:]))
    change = kinetic + potential_energy(geometry, bodies, x[1:-1]) - potential_energy(
        geometry, bodies, x[0])
    assert kinetic.max() > 1.0
    assert np.abs(change).max() < 2e-4 * kinetic.max()


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_reset_closes_the_loops_at_any_pose(plant_of, fidelity):
    plant = plant_of(machine_of(FULL), fidelity)
    for x in random_poses(REFERENCE, 10, seed=1):
        plant.reset(x)
        assert plant.loop_opening() < 1e-12
        np.testing.assert_allclose(plant.x, x, atol=1e-15)
        np.testing.assert_allclose(plant.q, inverse_kinematics(REFERENCE.geometry, x), atol=1e-15)
        np.testing.assert_array_equal((plant.qd, plant.xd), 0.0)
        assert plant.time == 0.0


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_an_open_loop_is_seen(plant_of, fidelity):
    plant = plant_of(machine_of(FULL), fidelity)
    plant.reset(HOME)
    body, link = plant._arms[2]
    pybullet.resetJointState(body, link, plant.q[2] + 1e-3, physicsClientId=plant._client)
    along, _, up = plate_joint(REFERENCE.geometry.packed, *HOME[:3], 1.0, 0.0, 2)
    assert plant.loop_opening() == pytest.approx(1e-3 * np.hypot(along, up), rel=1e-3)


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_readings_agree_with_kinematics_in_motion(plant_of, fidelity):
    """x and theta come from the engine, q from the arms; the velocity is half a step older."""
    plant = plant_of(machine_of(FULL), fidelity)
    plant.reset((0.05, -0.1, -0.75, 0.2))
    for _ in range(150):
        before = plant.q, plant.x
        plant.step((4.0, -9.0, 2.0, -1.0))
    x, middle = plant.x, 0.5 * (before[1] + plant.x)
    assert np.abs(plant.qd).min() > 0.1
    np.testing.assert_allclose(forward_kinematics(REFERENCE.geometry, plant.q, x), x, atol=2e-6)
    np.testing.assert_allclose((plant.q - before[0]) / plant.dt, plant.qd, rtol=1e-9)
    np.testing.assert_allclose((x - before[1]) / plant.dt, plant.xd, atol=1e-9)
    np.testing.assert_allclose(joint_velocity(REFERENCE.geometry, middle, plant.xd), plant.qd,
                               atol=1e-4 * np.abs(plant.qd).max())
    assert plant.time == pytest.approx(150 * plant.dt)


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_a_plant_forgets_at_reset(plant_of, fidelity):
    """The run after a reset is that of a new plant, to the last bit."""
    friction = Friction(np.full(4, 1.0), np.full(4, 2.0), stribeck_torque=np.full(4, 1.0),
                        stribeck_velocity=np.full(4, 0.1), presliding_distance=1e-3)

    def run(plant):
        plant.reset((0.1, 0.05, -0.8, 0.3))
        for k in range(60):
            plant.step(8.0 * np.sin(0.1 * k + np.arange(4)))
        return plant.q

    used = plant_of(machine_of(FULL, friction=friction), fidelity)
    run(used)
    np.testing.assert_array_equal(run(used), run(plant_of(machine_of(FULL, friction=friction),
                                                          fidelity)))


def test_two_plants_do_not_disturb_each_other(plant_of):
    torque = np.array((5.0, -3.0, 2.0, 1.0))

    def run(*plants):
        for plant in plants:
            plant.reset(HOME)
        for _ in range(60):
            for plant in plants:
                plant.step(torque)
        return [plant.q for plant in plants]

    model = frictionless(other_model())
    alone = [run(plant_of(machine_of(model), 'fast'))[0],
             run(plant_of(machine_of(FULL), 'accurate'))[0]]
    together = run(plant_of(machine_of(model), 'fast'), plant_of(machine_of(FULL), 'accurate'))
    np.testing.assert_array_equal(together, alone)
    closed = BulletPlant(machine_of(FULL), 'fast')
    left = plant_of(machine_of(model), 'fast')
    closed.close()
    np.testing.assert_array_equal(run(left)[0], alone[0])


def gravity_torque(model, x):
    still = np.zeros((1, 4))
    return model.torque(state_of_platform(REFERENCE.geometry, np.zeros(1), [x], still, still))[0]


@pytest.mark.parametrize('fidelity', FIDELITIES)
@pytest.mark.parametrize('x', [HOME, EDGE], ids=['home', 'edge'])
def test_a_held_joint_stays_where_it_is(plant_of, fidelity, x):
    plant = plant_of(machine_of(FULL, friction=Friction(coulomb=np.full(4, 2.43))), fidelity)
    plant.reset(x)
    q = plant.q
    torque = gravity_torque(FULL, x) + (2.3, -2.3, 1.9, 0.0)
    for _ in range(round(1.0 / plant.dt)):
        plant.step(torque)
    np.testing.assert_array_equal(plant.q, q)
    assert np.abs(plant.qd).max() < 1e-15


@pytest.mark.parametrize('fidelity', FIDELITIES)
@pytest.mark.parametrize('direction', [1.0, -1.0])
def test_breakaway_at_coulomb_and_stribeck_level(plant_of, fidelity, direction):
    friction = Friction(np.array((2.0, 3.0, 2.0, 2.0)), NOTHING,
                        stribeck_torque=np.array((1.0, 0.5, 0.0, 1.0)),
                        stribeck_velocity=np.full(4, 0.1))
    plant = plant_of(machine_of(PAPER, friction=friction), fidelity)
    hold = gravity_torque(PAPER, HOME)
    for joint, level in enumerate((3.0, 3.5, 2.0, 3.0)):
        for share, moves in ((0.99, False), (1.01, True)):
            plant.reset(HOME)
            q = plant.q
            torque = hold.copy()
            torque[joint] += direction * share * level
            for _ in range(100):
                plant.step(torque)
            moved = direction * (plant.q - q)
            assert (moved[joint] > 1e-5) == moves
            np.testing.assert_array_equal(np.delete(moved, joint), 0.0)


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_stick_and_slip_agree_with_the_exact_plant(plant_of, fidelity):
    """Slow torque waves with friction of every kind, sticking and reversing, and a load."""
    friction = Friction(np.array((2.4, 2.0, 2.2, 2.6)), np.array((2.0, 1.5, 2.5, 2.0)),
                        stribeck_torque=np.array((1.2, 0.8, 0.0, 1.0)),
                        stribeck_velocity=np.array((0.1, 0.2, 1.0, 0.3)))

    def load(time, q, qd):
        return 0.7 * np.sin(24.0 * q) + 0.3 * qd + np.array((0.0, 5.0 * time, 0.0, -0.5))

    machine = machine_of(FULL, friction=friction, loads=(load,))
    hold = gravity_torque(FULL, HOME)
    paths = []
    for plant in (plant_of(machine, fidelity), ExactPlant(machine)):
        plant.reset(HOME)
        path = [plant.q]
        for k in range(1600):
            t = k * plant.dt + plant.torque_offset
            wave = np.sin(2.0 * np.pi * 5.0 * t + np.array((0.0, 1.0, 2.5, 4.0)))
            plant.step(hold + np.array((7.0, 5.0, 6.0, 8.0)) * wave * min(1.0, 10.0 * t))
            path.append(plant.q)
        paths.append(np.array(path))
    found, expected = paths
    resting = np.abs(np.diff(expected, axis=0)).max(axis=1) == 0.0
    assert resting.sum() > 20
    assert (np.ptp(expected, axis=0) > 0.01).all()
    assert np.abs(found - expected).max() < 5e-3 * np.ptp(expected, axis=0).min()


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_the_drives_supply_the_loads(plant_of, fidelity):
    """A load is balanced by the same torque on top; it sees the time and state of the step."""
    seen = []

    def load(time, q, qd):
        seen.append((time, q, qd))
        return np.array((1.5, -2.0, 0.5, 3.0)) * (1.0 + 10.0 * time) + 0.4 * qd

    free = plant_of(machine_of(FULL, friction=Friction(viscous=np.full(4, 0.4))), fidelity)
    loaded = plant_of(machine_of(FULL, loads=(load,)), fidelity)
    for plant in (free, loaded):
        plant.reset(HOME)
    for k in range(100):
        torque = np.array((3.0, -2.0, 1.0, 0.0))
        free.step(torque)
        before = loaded.q
        loaded.step(torque + np.array((1.5, -2.0, 0.5, 3.0)) * (1.0 + 10.0 * k * loaded.dt))
        assert seen[-1][0] == pytest.approx(k * loaded.dt)
        np.testing.assert_array_equal(seen[-1][1], before)
    assert np.abs(free.qd).max() > 0.3
    np.testing.assert_allclose(loaded.q, free.q, atol=1e-12)


def test_viscous_friction_acts_at_the_time_of_the_step(plant_of):
    """Not half a step late as the velocity read: 0.02 % of the peak again, with f_v = 20.4."""
    model = replace(FULL, values=FULL.values | {'viscous_friction': np.full(4, 20.4)})
    plant = plant_of(machine_of(FULL, friction=Friction(viscous=np.full(4, 20.4))), 'fast')
    size = np.array((0.3, 0.05, 0.05, 0.5))
    q, qd, torques, _ = driven(plant, REFERENCE, model, 0.25, HOME - 0.5 * size, size)
    needed = torque_of_motion(REFERENCE.geometry, model, plant.dt, q, qd)
    assert np.abs(torques[1:] - needed).max() < 2e-4 * np.abs(needed).max()


def test_impossible_machines_and_poses_are_refused(plant_of):
    with pytest.raises(InputError, match='rod'):
        plant_of(machine_of(replace(FULL, bodies=FULL.bodies.model_copy(
            update={'rod_mass': 0.6}))), 'fast')
    plant = plant_of(machine_of(FULL), 'fast')
    plant.reset(EDGE)
    with pytest.raises(UnreachableError, match='leg'):
        plant.reset((0.9, 0.0, -0.78, 0.0))
    np.testing.assert_allclose(plant.x, EDGE, atol=1e-15)
    with pytest.raises(UnreachableError, match='driven out of reach'):
        plant.step((np.nan, 0.0, 0.0, 0.0))


def test_a_picture_shows_the_pose(plant_of):
    """Size, colours of the robot, a difference between poses; and no effect on a plant."""
    plants = [plant_of(machine_of(FULL), 'fast') for _ in range(2)]
    pictures = []
    for plant, drawn in zip(plants, (True, False)):
        plant.reset(HOME)
        for _ in range(2):
            plant.step(NOTHING)
            if drawn:
                pictures.append(render(REFERENCE, plant.x, 96, 64))
    np.testing.assert_array_equal(plants[0].q, plants[1].q)
    picture, same = pictures
    assert picture.shape == (64, 96, 3)
    assert picture.dtype == np.uint8
    background = (picture == 255).all(axis=-1)
    assert 0.5 < background.mean() < 0.97
    other = render(REFERENCE, EDGE, 96, 64)
    assert np.mean(other != picture) > 10 * np.mean(same != picture)
    red = (other[..., 0] > 150) & (other[..., 1] < 90)
    assert red.any()  # the arrow of the tool


def test_a_picture_without_numpy_in_the_engine(monkeypatch):
    """Some builds of the engine return the pixels as a flat tuple."""
    expected = render(REFERENCE, HOME, 32, 24)
    original = pybullet.getCameraImage

    def as_tuple(*arguments, **options):
        width, height, pixels, *rest = original(*arguments, **options)
        return (width, height, tuple(np.ravel(pixels).tolist()), *rest)

    monkeypatch.setattr(pybullet, 'getCameraImage', as_tuple)
    np.testing.assert_array_equal(render(REFERENCE, HOME, 32, 24), expected)


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_passive_joints_are_read_from_the_engine_and_close_the_picture(plant_of, fidelity):
    """At rest those of the pose; in motion off by no more than the loops are open."""
    plant = plant_of(machine_of(FULL), fidelity)

    def difference():
        expected = tree_joint_positions(REFERENCE.geometry, plant.x)
        found = plant.passive_joints()
        assert {*found} == {*expected} - {*JOINT_NAMES}
        return max(abs(found[name] - expected[name]) for name in found)

    for x in random_poses(REFERENCE, 5, seed=4):
        plant.reset(x)
        assert difference() < 1e-14
    for k in range(300):
        plant.step(20.0 * np.sin(0.05 * k + np.arange(4)))
    assert np.abs(plant.qd).max() > 1.0
    # angles of rods and arms: the opening over the lever it acts on
    assert difference() < 5.0 * plant.loop_opening() / REFERENCE.geometry.arm_length
    # it is the engine's rod that is read, not the pose
    before = plant.passive_joints()
    body, link = plant._links['leg_1', 'rod_0']
    tilted = np.array((0.1, 0.0, 0.0, 1.0)) / np.hypot(0.1, 1.0)
    pybullet.resetJointStateMultiDof(body, link, tilted.tolist(), (0, 0, 0),
                                     physicsClientId=plant._client)
    changed = {name for name, value in plant.passive_joints().items() if value != before[name]}
    moved = 2 if fidelity == 'fast' else 1
    assert changed == {f'{turn}_1_{number}' for turn in ('swing', 'tilt')
                       for number in range(moved)}


def test_a_view_goes_on_from_pose_to_pose():
    view = View(REFERENCE)
    for x in (HOME, EDGE, HOME):
        view.show(x)
        np.testing.assert_array_equal(view.picture(48, 36), render(REFERENCE, x, 48, 36))
    assert view.open
    view.close()
    assert not view.open


def test_a_window_follows_the_newest_pose_until_it_is_not_wanted():
    view = View(REFERENCE)
    pose, waits = list(HOME), []
    poses = [EDGE, (5.0, 0.0, -0.78, 0.0), HOME]  # the second cannot be drawn

    def look(seconds):
        assert seconds == pytest.approx(1.0 / 30.0)
        waits.append(view.picture(48, 36))
        if poses:
            pose[:] = poses.pop(0)

    follow(view, pose, lambda: len(waits) < 4, look)
    home, edge = (render(REFERENCE, x, 48, 36) for x in (HOME, EDGE))
    for found, expected in zip(waits, (home, edge, edge, home), strict=True):
        np.testing.assert_array_equal(found, expected)
    assert not view.open


def test_a_window_without_a_screen_is_refused(monkeypatch):
    monkeypatch.setattr('sys.platform', 'linux')
    monkeypatch.delenv('DISPLAY', raising=False)
    for build in (lambda: View(REFERENCE, window=True), lambda: Window(REFERENCE, HOME)):
        with pytest.raises(InputError, match='no screen') as caught:
            build()
        assert '\n' not in str(caught.value)


@pytest.mark.parametrize(('words', 'said'), [
    (('--output', 'x.png'), '--output x.png: expected a name that ends in .gif'),
    (('--output', 'x.gif', '--width', '-5'), '--width -5: expected 40 to 4000 pixels'),
    (('--output', 'file/x.gif'), 'file: results cannot be written there (not a directory)'),
    (('--output', 'x.gif', '--bag', 'nowhere'), 'nowhere: no such bag')])
def test_pictures_that_cannot_be_drawn_are_told_before_they_are_drawn(words, said, tmp_path):
    (tmp_path / 'file').touch()
    done = subprocess.run([sys.executable, ANIMATE, *words], cwd=tmp_path, capture_output=True,
                          text=True, check=False)
    assert done.returncode == 2
    line, = done.stderr.splitlines()
    assert line.startswith(f'error: {said}')
    assert [path.name for path in tmp_path.iterdir()] == ['file']
