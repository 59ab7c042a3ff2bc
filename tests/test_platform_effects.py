"""Effects of platform, passive joints, encoders and dimensions against physics written out here.

A torque tau is held against the generalised force f on X = (x, y, z, theta) that virtual work
gives: tau . dq = f . dX, with dq / dX from differences of inverse kinematics alone.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from par4_dynamics.effects.catalogue import CATALOGUE, effect_named
from par4_dynamics.model_file import EffectEntry, ModelFile, read_model_file
from par4_dynamics.model_from_file import build_model, read_model
from par4_dynamics.parameters import Parameter
from par4_dynamics.state import GRAVITY, State, state_of_joints, state_of_platform
from par4_kinematics.errors import InputError
from par4_kinematics.files import write_text
from par4_kinematics.geometry import Geometry
from par4_kinematics.passive import passive_friction_force, passive_rates
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import Axis
from robots import REFERENCE, UNEVEN, growing_waves, model_with, other_model, random_poses

ROBOTS = pytest.mark.parametrize('robot', [REFERENCE, UNEVEN], ids=lambda robot: robot.name)
MODELS = {REFERENCE.name: read_model('table1', REFERENCE), UNEVEN.name: other_model()}
VALUES = {
    'payload': {'mass': 0.7, 'half': 2.0},
    'theta_inertia': {'inertia': 1.5e-3},
    'theta_friction': {'coulomb': 0.3, 'viscous': 0.05},
    'passive_joint_friction': {'coulomb': 0.05, 'viscous': 0.02},
    'base_tilt': {'about_x': 0.02, 'about_y': -0.03},
    'external_force': {'x': 2.0, 'y': -3.0, 'z': 1.5},
    'cable_spring': {'stiffness': (20.0, 5.0, 0.0), 'anchor': (0.3, -0.4, 0.0)},
    'platform_drag': {'viscous': 0.4, 'quadratic': 0.7},
    'encoder_offset': {'offset': (2e-3, -3e-3, 1e-3, 4e-3)},
    'encoder_eccentricity': {'amplitude': (1e-3, 5e-4, 1.5e-3, 8e-4),
                             'phase': (0.4, -2.0, 3.0, 1.2)},
    'geometry_error': {'arm_length': 5e-4, 'forearm_length': -8e-4, 'base_radius': 1e-3,
                       'platform_radius': -6e-4, 'platform_bar_length': 4e-4},
    'leg_length_error': {'arm_length': (5e-4, 0.0, -3e-4, 2e-4),
                         'forearm_length': (0.0, -4e-4, 6e-4, 3e-4)},
}


def exactly(values):
    """Return standard deviations of zero."""
    return {key: np.zeros(np.shape(value)) for key, value in values.items()}


EFFECTS = pytest.mark.parametrize('name', VALUES)
UP = np.array((0.0, 0.0, 1.0))
PIVOTS = np.array([2] * 8 + [4])
"""Joints of each group of `passive_rates`: two balls a forearm and end, four of the bars."""


def moving_state(robot, count=60, seed=11) -> State:
    random = np.random.default_rng(seed)
    return state_of_platform(
        robot.geometry, np.arange(count) * 1e-3, random_poses(robot, count, seed),
        random.normal(size=(count, 4)), 20.0 * random.normal(size=(count, 4)))


def model_with_effect(robot, name, **values):
    """Return the robot's model with an effect, read as from a `model.yaml`."""
    model_file = read_model_file('table1')
    plain = MODELS[robot.name].values
    return build_model(robot, ModelFile(
        parameters={key: Parameter(value=float(plain[key][0]), unit=parameter.unit)
                    for key, parameter in model_file.parameters.items()},
        effects=(EffectEntry(effect=name, parameters={
            key: Parameter(value=value) for key, value in values.items()}),)))


def effect_torque(robot, state, name, **values):
    """Return what the effect adds to the torque of the robot's model, (n, 4)."""
    model = model_with_effect(robot, name, **values)
    return model.torque(state) - model.without_effects().torque(state)


def values_of(name):
    """Return the values of `VALUES` as effects take them: (4,), vectors in their size."""
    effect = effect_named(name)
    sizes = {parameter.name: parameter.size for parameter in effect.parameters}
    return {key: np.array(value) if sizes[key] > 1 else np.broadcast_to(np.array(value), (4,))
            for key, value in VALUES[name].items()}


def slope(function, x, step=1e-6):
    """Return the derivative of function((n, 4) poses) by each coordinate, last axis."""
    parts = []
    for unit in np.eye(4):
        parts.append((function(x + step * unit) - function(x - step * unit)) / (2.0 * step))
    return np.stack(parts, axis=-1)


def force_of_torque(geometry, x, tau):
    """Return the generalised force (n, 4) on X that does the virtual work of tau."""
    return np.einsum('nj,njk->nk', tau, slope(lambda pose: inverse_kinematics(geometry, pose), x))


def point_d2(geometry, x):
    turned = np.stack((-np.sin(x[:, 3]), np.cos(x[:, 3]), 0.0 * x[:, 3]), axis=1)
    return x[:, :3] + geometry.platform_bar_length * turned


def arms_and_rods(geometry, x):
    """Return unit vectors of arms and vectors of forearms, each (n, 4, 3)."""
    q = inverse_kinematics(geometry, x)
    azimuth = np.array(geometry.actuator_azimuth)
    outward = np.stack((np.cos(azimuth), np.sin(azimuth), 0.0 * azimuth), axis=1)
    arms = np.cos(q)[..., None] * outward - np.sin(q)[..., None] * UP
    half_bar = np.array((0.0, 0.5 * geometry.platform_bar_length, 0.0))
    plate = np.stack([point_d2(geometry, x) - half_bar] * 2 + [x[:, :3] + half_bar] * 2, axis=1)
    joints = plate + geometry.platform_radius * outward
    elbows = geometry.base_radius * outward + np.array(geometry.arm_lengths)[:, None] * arms
    return arms, joints - elbows


def rate_matrices(geometry, x):
    """Return the relative angular velocities per Xdot, (n, 9, 3, 4), from turning directions."""
    def turning(directions):
        length = np.linalg.norm(directions(x), axis=-1, keepdims=True)[..., None]
        change = slope(directions, x)
        return np.cross(directions(x)[..., None], change, axis=2) / length ** 2

    arm = turning(lambda pose: arms_and_rods(geometry, pose)[0])
    rod = turning(lambda pose: arms_and_rods(geometry, pose)[1])
    bars = np.zeros((len(x), 1, 3, 4))
    bars[:, 0, 2, 3] = 1.0
    return np.concatenate((rod - arm, rod, bars), axis=1)


@ROBOTS
def test_passive_rates_are_those_of_turning_arms_and_rods(robot):
    state = moving_state(robot)
    expected = np.einsum('ngak,nk->nga', rate_matrices(robot.geometry, state.x), state.xd)
    rates = passive_rates(robot.geometry, state.x, state.xd)
    np.testing.assert_allclose(rates, expected, atol=1e-7)
    _, rods = arms_and_rods(robot.geometry, state.x)
    spin = np.einsum('nga,nga->ng', rates[:, 4:8], rods)
    np.testing.assert_allclose(spin, 0.0, atol=1e-12)
    assert np.abs(rates).max(axis=(0, 2)).min() > 0.5


@ROBOTS
def test_passive_friction_force_takes_its_power(robot):
    state = moving_state(robot)
    rates = passive_rates(robot.geometry, state.x, state.xd)
    speed = np.linalg.norm(rates, axis=2)
    sharp = passive_friction_force(robot.geometry, state.x, rates, 0.04, 0.01)
    power = np.sum(sharp * state.xd, axis=1)
    np.testing.assert_allclose(power, (0.04 * speed + 0.01 * speed ** 2) @ PIVOTS, rtol=1e-12)
    smooth = passive_friction_force(robot.geometry, state.x, rates, 0.04, 0.01, 0.5)
    power = np.sum(smooth * state.xd, axis=1)
    np.testing.assert_allclose(
        power, (0.04 * np.tanh(speed / 0.5) * speed + 0.01 * speed ** 2) @ PIVOTS, rtol=1e-12)
    still = passive_friction_force(
        robot.geometry, state.x, passive_rates(robot.geometry, state.x, 0.0 * state.xd), 0.04,
        0.01, 0.02)
    np.testing.assert_array_equal(still, 0.0)


@ROBOTS
@pytest.mark.parametrize('half', [1, 2])
def test_payload_is_a_mass_carried_by_its_half_plate(robot, half):
    state, mass, step = moving_state(robot), 0.7, 1e-4

    def point(x):
        return x[:, :3] if half == 1 else point_d2(robot.geometry, x)

    def position(time):
        return point(state.x + state.xd * time + 0.5 * state.xdd * time ** 2)

    acceleration = (position(step) - 2.0 * position(0.0) + position(-step)) / step ** 2
    expected = np.einsum('na,nak->nk', mass * (acceleration + GRAVITY * UP),
                         slope(point, state.x))
    tau = effect_torque(robot, state, 'payload', mass=mass, half=half)
    np.testing.assert_allclose(force_of_torque(robot.geometry, state.x, tau), expected, atol=1e-4)
    assert np.abs(tau).max() > 1.0


def test_payload_is_at_the_tool_unless_said_and_on_no_third_half():
    state = moving_state(REFERENCE)
    at_d = effect_torque(REFERENCE, state, 'payload', mass=0.5, half=1)
    np.testing.assert_array_equal(effect_torque(REFERENCE, state, 'payload', mass=0.5), at_d)
    heavier = replace(MODELS['reference'], values={
        **MODELS['reference'].values, 'platform_mass_1': np.full(4, 0.8043 + 0.5)})
    np.testing.assert_allclose(at_d, heavier.torque(state) - MODELS['reference'].torque(state),
                               atol=1e-10)
    with pytest.raises(InputError, match='payload, half: expected 1 .* found 3'):
        effect_torque(REFERENCE, state, 'payload', mass=0.5, half=3)


@ROBOTS
def test_theta_effects_are_moments_about_theta(robot):
    state = moving_state(robot)
    turn = state.xd[:, 3]
    side = turn / np.sqrt(turn ** 2 + 0.03 ** 2)  # the sign, but where theta rests
    for name, values, moment in (
            ('theta_inertia', {'inertia': 2e-3}, 2e-3 * state.xdd[:, 3]),
            ('theta_friction', {'coulomb': 0.3}, 0.3 * side),
            ('theta_friction', {'coulomb': 0.3, 'viscous': 0.1}, 0.3 * side + 0.1 * turn)):
        tau = effect_torque(robot, state, name, **values)
        expected = np.zeros_like(state.x)
        expected[:, 3] = moment
        np.testing.assert_allclose(force_of_torque(robot.geometry, state.x, tau), expected,
                                   atol=1e-7)
    np.testing.assert_allclose(np.sum(tau * state.qd, axis=1), (0.3 * side + 0.1 * turn) * turn,
                               atol=1e-10)


@pytest.mark.parametrize('name', ['theta_friction', 'passive_joint_friction'])
def test_friction_out_of_the_encoders_sight_is_sharp_in_motion_and_fades_at_rest(name):
    state = moving_state(REFERENCE)

    def torque(share, name=name):
        slowed = state_of_platform(REFERENCE.geometry, state.t, state.x, share * state.xd,
                                   state.xdd)
        return effect_torque(REFERENCE, slowed, name, coulomb=0.1)

    fast = torque(1e3)
    np.testing.assert_allclose(torque(2e3), fast, rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(torque(-1e3), -fast, atol=1e-12)
    assert np.abs(torque(1e-4)).max() < 0.05 * np.abs(fast).max()


@ROBOTS
def test_passive_joint_friction_resists_every_relative_rate(robot):
    state, coulomb, viscous = moving_state(robot), 0.05, 0.02
    matrices = rate_matrices(robot.geometry, state.x)
    rates = np.einsum('ngak,nk->nga', matrices, state.xd)
    speed = np.linalg.norm(rates, axis=2)
    slipping = coulomb * np.tanh(speed / 0.03)  # all of it, but where a joint rests
    moments = (slipping / speed + viscous)[..., None] * rates * PIVOTS[:, None]
    expected = np.einsum('nga,ngak->nk', moments, matrices)
    tau = effect_torque(robot, state, 'passive_joint_friction', coulomb=coulomb, viscous=viscous)
    np.testing.assert_allclose(force_of_torque(robot.geometry, state.x, tau), expected, atol=1e-5)
    np.testing.assert_allclose(np.sum(tau * state.qd, axis=1),
                               (slipping * speed + viscous * speed ** 2) @ PIVOTS, rtol=1e-6)
    back = replace(state, qd=-state.qd, xd=-state.xd)
    np.testing.assert_allclose(effect_torque(robot, back, 'passive_joint_friction',
                                             coulomb=coulomb, viscous=viscous), -tau, atol=1e-10)


def tilted_gravity(about_x, about_y):
    """Return gravity in a base turned about its x axis, then about its own y axis."""
    a, b = about_x, about_y
    turn_x = np.array(((1, 0, 0), (0, np.cos(a), -np.sin(a)), (0, np.sin(a), np.cos(a))))
    turn_y = np.array(((np.cos(b), 0, np.sin(b)), (0, 1, 0), (-np.sin(b), 0, np.cos(b))))
    return (turn_x @ turn_y).T @ (-GRAVITY * UP)


@ROBOTS
def test_base_tilt_is_the_slope_of_potential_energy(robot):
    state = moving_state(robot)
    values = {name: value[0] for name, value in MODELS[robot.name].values.items()}

    def force(gravity):
        def energy(x):
            arms, _ = arms_and_rods(robot.geometry, x)
            return -(values['platform_mass_1'] * x[:, :3] @ gravity
                     + values['platform_mass_2'] * point_d2(robot.geometry, x) @ gravity
                     + values['arm_gravity'] / GRAVITY * np.sum(arms @ gravity, axis=1))
        return slope(energy, state.x)

    still = replace(state, qd=0.0 * state.qd, qdd=0.0 * state.qdd, xd=0.0 * state.xd,
                    xdd=0.0 * state.xdd)
    level = MODELS[robot.name].torque(still)
    np.testing.assert_allclose(force_of_torque(robot.geometry, state.x, level),
                               force(-GRAVITY * UP), atol=1e-6)
    for about_x, about_y in ((1e-3, 0.0), (0.0, 1e-3), (-2e-2, 3e-2)):
        tau = effect_torque(robot, state, 'base_tilt', about_x=about_x, about_y=about_y)
        expected = force(tilted_gravity(about_x, about_y)) - force(-GRAVITY * UP)
        second_order = 1.2 * np.abs(force(-GRAVITY * UP)).max() * (about_x ** 2 + about_y ** 2)
        found = force_of_torque(robot.geometry, state.x, tau)
        np.testing.assert_allclose(found, expected, atol=second_order + 1e-7)
        assert np.abs(expected).max() > 10.0 * second_order


def test_a_base_turned_about_y_pulls_the_platform_along_x():
    """Its x axis points below the horizontal then: the drives push the platform back."""
    state = moving_state(REFERENCE)
    tau = effect_torque(REFERENCE, state, 'base_tilt', about_y=0.01)
    assert np.all(force_of_torque(REFERENCE.geometry, state.x, tau)[:, 0] < 0)


@ROBOTS
def test_external_force_takes_its_power_off_the_drives(robot):
    state, pull = moving_state(robot), np.array((2.0, -3.0, 1.5))
    tau = effect_torque(robot, state, 'external_force', x=2.0, y=-3.0, z=1.5)
    np.testing.assert_allclose(np.sum(tau * state.qd, axis=1), -state.xd[:, :3] @ pull, atol=1e-10)
    expected = np.broadcast_to(np.append(-pull, 0.0), state.x.shape)
    np.testing.assert_allclose(force_of_torque(robot.geometry, state.x, tau), expected, atol=1e-6)


def test_a_force_that_lifts_unloads_the_drives_like_a_lighter_platform():
    state = moving_state(REFERENCE)
    still = replace(state, qdd=0.0 * state.qdd, xd=0.0 * state.xd, xdd=0.0 * state.xdd)
    lifted = effect_torque(REFERENCE, still, 'external_force', z=0.4 * GRAVITY)
    carried = effect_torque(REFERENCE, still, 'payload', mass=0.4)
    np.testing.assert_allclose(lifted, -carried, atol=1e-10)


@ROBOTS
def test_cable_spring_is_the_slope_of_its_energy(robot):
    state, anchor = moving_state(robot), np.array((0.3, -0.4, 0.5))
    tau = effect_torque(robot, state, 'cable_spring', stiffness=20.0, anchor=tuple(anchor))
    expected = slope(lambda x: 10.0 * np.sum((x[:, :3] - anchor) ** 2, axis=1), state.x)
    np.testing.assert_allclose(force_of_torque(robot.geometry, state.x, tau), expected, atol=1e-5)
    half = effect_torque(robot, state, 'cable_spring', stiffness=(0.0, 20.0, 0.0),
                         anchor=tuple(anchor))
    expected = slope(lambda x: 10.0 * (x[:, 1] + 0.4) ** 2, state.x)
    np.testing.assert_allclose(force_of_torque(robot.geometry, state.x, half), expected, atol=1e-5)


@ROBOTS
def test_platform_drag_opposes_the_velocity_of_the_tool(robot):
    state = moving_state(robot)
    velocity = state.xd[:, :3]
    speed = np.linalg.norm(velocity, axis=1)
    tau = effect_torque(robot, state, 'platform_drag', viscous=0.4, quadratic=0.7)
    np.testing.assert_allclose(np.sum(tau * state.qd, axis=1), 0.4 * speed ** 2 + 0.7 * speed ** 3,
                               rtol=1e-9)
    expected = np.zeros_like(state.x)
    expected[:, :3] = (0.4 + 0.7 * speed)[:, None] * velocity
    np.testing.assert_allclose(force_of_torque(robot.geometry, state.x, tau), expected, atol=1e-6)


def encoder_readings(robot, error):
    """Return the true torque (n, 4) of a motion and its state as encoders with `error` read it.

    error(q) returns an error (4,) of the reading, its slope and its curvature in q.
    """
    t = np.linspace(0.0, 0.3, 301)
    true = state_of_platform(robot.geometry, t, *growing_waves(robot, t, 0.3))
    q, qd, qdd = true.q, true.qd, true.qdd
    wrong, first, second = error(q)
    read = state_of_joints(robot.geometry, t, q + wrong, (1.0 + first) * qd,
                           (1.0 + first) * qdd + second * qd ** 2)
    return MODELS[robot.name].torque(true), read


@ROBOTS
@pytest.mark.parametrize('kind', ['encoder_offset', 'encoder_eccentricity'])
def test_encoder_errors_give_back_the_torque_of_the_true_motion(robot, kind):
    values = values_of(kind)

    def error(q):
        if kind == 'encoder_offset':
            return values['offset'], 0.0 * q, 0.0 * q
        angle, size = q + values['phase'], values['amplitude']
        return size * np.sin(angle), size * np.cos(angle), -size * np.sin(angle)

    true_torque, read = encoder_readings(robot, error)
    before = true_torque - MODELS[robot.name].torque(read)
    after = before - effect_torque(robot, read, kind, **VALUES[kind])
    assert np.abs(before).max() > 0.02
    assert np.abs(after).max() < 2e-3 * np.abs(before).max()


@ROBOTS
def test_an_offset_of_one_encoder_changes_the_torque_of_all(robot):
    state, model, offset = moving_state(robot), MODELS[robot.name], 1e-4
    columns = effect_named('encoder_offset').columns(
        replace(state, nominal=model.nominal(state)), {})
    for joint, unit in enumerate(np.eye(4)):
        true = state_of_joints(robot.geometry, state.t, state.q - offset * unit, state.qd,
                               state.qdd)
        expected = (model.torque(true) - model.torque(state)) / offset
        scale = np.abs(expected).max()
        np.testing.assert_allclose(columns[..., joint], expected, atol=2e-3 * scale)
        assert np.abs(np.delete(expected, joint, axis=1)).max() > 0.05 * scale


@ROBOTS
@pytest.mark.parametrize('seed', [11, 12])
def test_teeth_move_with_the_zero_of_the_encoder(robot, seed):
    """They were felt at the true angle, which an encoder that was set anew does not read."""
    random, read = np.random.default_rng(seed), moving_state(robot)
    offset = random.uniform(-6e-3, 6e-3, 4)
    teeth = {'amplitude': random.uniform(0.3, 0.8, 4), 'periods': 60.0,
             'phase': random.uniform(0.0, 6.0, 4)}
    toothed = model_with(MODELS[robot.name], 'cogging', **teeth)
    true = state_of_joints(robot.geometry, read.t, read.q - offset, read.qd, read.qdd)
    expected = toothed.torque(true)
    told = model_with(toothed, 'encoder_offset', offset=offset).torque(read)
    moved = toothed.angle_torque(true) - toothed.angle_torque(read)
    assert np.abs(moved).max() > 0.1
    assert np.abs(told - expected).max() < 0.02


@ROBOTS
def test_geometry_error_is_the_torque_of_the_true_machine(robot):
    state, model = moving_state(robot), MODELS[robot.name]
    for name, error in VALUES['geometry_error'].items():
        true = robot.geometry.with_errors(**{name: error})
        expected = model.torque(
            state_of_joints(true, state.t, state.q, state.qd, state.qdd)) - model.torque(state)
        tau = effect_torque(robot, state, 'geometry_error', **{name: error})
        scale = np.abs(expected).max()
        np.testing.assert_allclose(tau, expected, atol=1e-3 * scale)
        assert scale > 1e-4


@ROBOTS
def test_leg_length_error_is_the_torque_of_the_true_machine(robot):
    """A forearm moves the platform by its direction, an arm by its own, and turns other levers."""
    state, model = moving_state(robot), MODELS[robot.name]
    for leg in range(4):
        for name in ('arm_length', 'forearm_length'):
            error = tuple((1e-4 * np.eye(4)[leg]).tolist())
            true = robot.geometry.with_errors(**{f'{name}_errors': error})
            expected = model.torque(
                state_of_joints(true, state.t, state.q, state.qd, state.qdd)) - model.torque(state)
            tau = effect_torque(robot, state, 'leg_length_error', **{
                **dict.fromkeys(('arm_length', 'forearm_length'), 0.0), name: error})
            scale = np.abs(expected).max()
            np.testing.assert_allclose(tau, expected, atol=1e-3 * scale)
            assert scale > 1e-4


@ROBOTS
def test_legs_that_are_all_as_much_longer_are_an_error_of_the_dimension(robot):
    state = moving_state(robot)
    for name in ('arm_length', 'forearm_length'):
        one = effect_torque(robot, state, 'geometry_error', **{name: 4e-4})
        each = effect_torque(robot, state, 'leg_length_error', **{
            **dict.fromkeys(('arm_length', 'forearm_length'), 0.0),
            name: 4e-4})
        np.testing.assert_allclose(each, one, atol=1e-3 * np.abs(one).max())


@pytest.mark.parametrize(('name', 'values'), [
    ('elastic_transmission', {'stiffness': 4e3}),
    ('backlash', {'gap': 1e-3}),
    ('load_dependent_friction', {'coefficient': 0.05}),
    ('encoder_offset', {'offset': (2e-3, -3e-3, 1e-3, 4e-3)}),
    ('encoder_eccentricity', VALUES['encoder_eccentricity']),
    ('geometry_error', VALUES['geometry_error']),
    ('leg_length_error', VALUES['leg_length_error'])])
def test_a_body_is_carried_and_shifted_whether_it_is_an_effect_or_known(name, values):
    """Rods and bars of a `full` model, or the same as effects of a `paper` one: one machine."""
    bodies = REFERENCE.bodies
    known = replace(MODELS[REFERENCE.name], rigid_body='full', bodies=bodies)
    told = model_with(MODELS[REFERENCE.name], 'distributed_rods',
                      rod_mass=bodies.rod_mass, bar_mass=bodies.bar_mass)
    if bodies.theta_inertia:
        told = model_with(told, 'theta_inertia', inertia=bodies.theta_inertia)
    t = np.linspace(0.0, 0.4, 801)
    state = state_of_platform(REFERENCE.geometry, t, *growing_waves(REFERENCE, t, 0.4))
    expected = model_with(known, name, **values).torque(state)
    np.testing.assert_allclose(model_with(told, name, **values).torque(state), expected, atol=1e-9)
    paper = model_with(MODELS[REFERENCE.name], name, **values).torque(state)
    own = expected - known.torque(state) - (paper - MODELS[REFERENCE.name].torque(state))
    assert np.abs(own).max() > 1e-4  # rods change what the effect does


def test_geometry_error_can_step_below_a_radius_of_zero():
    content = REFERENCE.geometry.model_dump() | {'platform_radius': 0.0}
    geometry = Geometry(**content)
    state = state_of_platform(geometry, np.zeros(1), np.array([[0.05, 0.02, -0.8, 0.1]]),
                              np.ones((1, 4)), np.ones((1, 4)))
    state = replace(state, nominal=MODELS['reference'].nominal(state))
    assert np.isfinite(effect_named('geometry_error').columns(state, {})).all()


def test_errors_beyond_what_closes_leave_the_motion_as_it_is_read():
    state = moving_state(REFERENCE)
    for offset, is_moved in ((1e-3, True), (2.5, False)):
        model = model_with_effect(REFERENCE, 'encoder_offset', offset=(offset,) * 4)
        assert (model.nominal(state).halfway is not None) is is_moved
        assert np.isfinite(model.torque(state)).all()
    assert MODELS['reference'].nominal(state).halfway is None


@EFFECTS
def test_values_return_from_their_coefficients(name):
    effect, values = effect_named(name), values_of(name)
    back = effect.values(effect.coefficients(values),
                         effect.shape_of({key: value[0] for key, value in values.items()}))
    assert set(back) == set(values) == {parameter.name for parameter in effect.parameters}
    for key, value in values.items():
        np.testing.assert_allclose(back[key], value, rtol=1e-12)


@ROBOTS
@EFFECTS
def test_torque_is_columns_times_coefficients(robot, name):
    effect, values, state = effect_named(name), values_of(name), moving_state(robot, 12)
    state = replace(state, nominal=model_with_effect(robot, name, **VALUES[name]).nominal(state))
    columns = effect.columns(state, effect.shape_of(
        {key: value[0] for key, value in values.items()}))
    coefficients = effect.coefficients(values)
    assert columns.shape == (*state.q.shape, len(coefficients))
    tau = effect_torque(robot, state, name, **VALUES[name])
    np.testing.assert_allclose(columns @ coefficients[:, 0], tau, rtol=1e-8, atol=1e-9)
    np.testing.assert_array_equal(coefficients, coefficients[:, :1] * np.ones(4))
    one = state_of_platform(robot.geometry, state.t[:1], state.x[:1], state.xd[:1], state.xdd[:1])
    np.testing.assert_allclose(effect_torque(robot, one, name, **VALUES[name]), tau[:1],
                               rtol=1e-6, atol=1e-7)


@EFFECTS
def test_typical_values_are_believed_and_the_signature_fits_the_motion(name):
    effect, state = effect_named(name), moving_state(REFERENCE, 5)
    base = MODELS['reference'].values
    assert effect.implausible(values_of(name), exactly(values_of(name)), base) is None
    signature = effect.signature(replace(state, nominal=MODELS['reference'].nominal(state)))
    assert signature.abscissa.shape == state.q.shape
    assert np.isfinite(signature.abscissa).all()
    assert ', ' in signature.label


@pytest.mark.parametrize(('name', 'wrong', 'reason'), [
    ('payload', {'mass': -0.1}, 'cannot weigh'),
    ('payload', {'mass': 50.0}, 'more than such a robot can carry'),
    ('theta_inertia', {'inertia': -1e-4}, 'cannot be negative'),
    ('theta_inertia', {'inertia': 0.1}, 'more than ten times'),
    ('theta_friction', {'coulomb': -0.3, 'viscous': 0.0}, 'must dissipate'),
    ('theta_friction', {'coulomb': 0.3, 'viscous': -0.05}, 'must dissipate'),
    ('theta_friction', {'coulomb': 8.0}, 'ten times'),
    ('passive_joint_friction', {'coulomb': -0.05, 'viscous': 0.0}, 'must dissipate'),
    ('passive_joint_friction', {'viscous': 2.0}, 'ten times'),
    ('base_tilt', {'about_x': 0.3}, 'seen by eye'),
    ('external_force', {'z': -80.0}, 'ten times'),
    ('cable_spring', {'stiffness': np.array((20.0, 5.0, -4.0))}, 'pulls back.* along z'),
    ('cable_spring', {'stiffness': np.array((1.0, 0.5, 0.0))}, 'no cable'),
    ('cable_spring', {'stiffness': np.array((20.0, 2e3, 5.0))}, 'stiff hose'),
    ('cable_spring', {'anchor': np.array((0.0, 20.0, 0.0))}, 'along y is too far'),
    ('platform_drag', {'viscous': -0.4, 'quadratic': 0.0}, 'must dissipate'),
    ('platform_drag', {'viscous': 40.0}, 'ten times'),
    ('encoder_offset', {'offset': (0.0, 0.0, -0.25, 0.0)}, 'not believed'),
    ('encoder_eccentricity', {'amplitude': (0.0, 0.04, 0.0, 0.0)}, 'badly mounted'),
    ('geometry_error', {'base_radius': -0.05}, 'in base_radius'),
    ('leg_length_error', {'forearm_length': (0.0, 0.0, 0.04, 0.0)}, 'forearm_length of leg 2'),
])
def test_implausible_values_are_refused_unless_they_may_be_chance(name, wrong, reason):
    values = values_of(name) | {
        key: value if isinstance(value, np.ndarray) else np.broadcast_to(np.array(value), (4,))
        for key, value in wrong.items()}
    for deviation, believed in ((0.0, False), (0.02, False), (3.0, True)):
        std = {key: deviation * np.abs(value) for key, value in values.items()}
        found = effect_named(name).implausible(values, std, MODELS['reference'].values)
        assert found is None if believed else re.search(reason, found)


@pytest.mark.parametrize(('name', 'large'), [
    ('encoder_offset', {'offset': np.radians((10.0, -10.0, 0.0, 5.0))}),
    ('encoder_eccentricity', {'amplitude': np.radians((0.4, 0.4, 0.0, 0.8))}),
    ('geometry_error', {'arm_length': np.full(4, 0.02), 'base_radius': np.full(4, -0.02)}),
    ('leg_length_error', {'arm_length': np.array((0.0, -0.02, 0.0, 0.0))}),
])
def test_large_errors_of_real_machines_are_believed(name, large):
    values = values_of(name) | large
    assert effect_named(name).implausible(values, exactly(values), {}) is None


def test_a_friction_part_estimated_just_below_zero_is_believed():
    values = {'coulomb': np.full(4, 0.3), 'viscous': np.full(4, -0.005)}
    for deviation, believed in ((2e-3, True), (1e-3, False)):
        std = {'coulomb': np.full(4, 0.01), 'viscous': np.full(4, deviation)}
        reason = effect_named('theta_friction').implausible(values, std, {})
        assert (reason is None) == believed


MODEL_YAML = """\
schema: par4/model/1
parameters:
  actuator_inertia: {value: 0.113, unit: kg m2}
  platform_mass_1: {value: 0.8043, unit: kg}
  platform_mass_2: {value: 0.8594, unit: kg}
  arm_gravity: {value: 1.33, unit: N m}
  coulomb_friction: {value: 2.43, unit: N m}
  viscous_friction: {value: 2.04, unit: N m s/rad}
effects:
  - {effect: payload, parameters: {mass: {value: 0.5, unit: kg}}}
  - {effect: base_tilt, parameters: {about_y: {value: 1e-2, unit: rad}}}
  - effect: cable_spring
    parameters: {stiffness: {value: 20, unit: N/m}, anchor: {value: [0.1, 0.2, 0.3], unit: m}}
  - {effect: encoder_offset, joints: [2], parameters: {offset: {value: 2e-3, unit: rad}}}
"""


def test_effects_are_read_from_a_model_file(tmp_path):
    path = tmp_path / 'model.yaml'
    write_text(path, MODEL_YAML)
    state = moving_state(REFERENCE)
    # the encoder shifts payload and cable, too, and the tilt pulls at the payload
    heavier = replace(MODELS['reference'], values={
        **MODELS['reference'].values,
        'platform_mass_1': MODELS['reference'].values['platform_mass_1'] + 0.5})
    held = model_with(heavier, 'cable_spring', stiffness=20.0, anchor=(0.1, 0.2, 0.3))
    expected = held.torque(state)
    for name, values in (('base_tilt', {'about_y': 1e-2}),
                         ('encoder_offset', {'offset': (0.0, 0.0, 2e-3, 0.0)})):
        expected = expected + model_with(held, name, **values).torque(state) - held.torque(state)
    found = read_model(path, REFERENCE).torque(state)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    write_text(path, MODEL_YAML.replace('[0.1, 0.2, 0.3]', '[0.1, 0.2]'))
    with pytest.raises(InputError, match='cable_spring, anchor: expected 3 numbers'):
        read_model(path, REFERENCE)
    write_text(path, MODEL_YAML.replace('{value: 20,', '{value: [20, 20, 20],'))
    np.testing.assert_array_equal(read_model(path, REFERENCE).torque(state), found)
    write_text(path, MODEL_YAML.replace('{value: 20,', '{value: [20, 0],'))
    with pytest.raises(InputError, match='stiffness: expected one number or 3 numbers'):
        read_model(path, REFERENCE)


@EFFECTS
def test_a_single_axis_has_no_platform(name):
    axis = Axis(schema='par4/axis/1', name='emps', joint='slide', kind='linear', gain=35.0)
    parameters = {key: Parameter(value=1.0) for key in ('actuator_inertia', 'coulomb_friction',
                                                        'viscous_friction')}
    entry = EffectEntry(effect=name, parameters={
        key: Parameter(value=value) for key, value in VALUES[name].items()})
    with pytest.raises(InputError, match='needs a platform'):
        build_model(axis, ModelFile(parameters=parameters, effects=(entry,)))
    assert name in CATALOGUE
