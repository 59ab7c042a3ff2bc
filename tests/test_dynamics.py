"""Laws of the dynamics: two derivations, energy, power, linearity."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from par4_dynamics.base_terms import (
    BASE_TERMS,
    PLATFORM_MASSES,
    UNMODELLED,
    base_columns,
    base_terms,
    unmodelled_columns,
)
from par4_dynamics.direction import mean_signs
from par4_dynamics.effects.joint_friction_difference import JointFrictionDifference
from par4_dynamics.effects.spring_steps import swing_through
from par4_dynamics.effects.springs import Springs
from par4_dynamics.effects.time_offset import TimeOffset, _earlier_rows
from par4_dynamics.effects.time_rate import _rate_rows
from par4_dynamics.mechanism import (
    forward_dynamics,
    joint_mass_matrix,
    kinetic_energy,
    physical_bodies,
    potential_energy,
)
from par4_dynamics.model_file import ModelFile, read_model_file, write_model_file
from par4_dynamics.model_from_file import build_model, read_model
from par4_dynamics.rigid_body import COLUMNS, rigid_body_columns
from par4_dynamics.state import GRAVITY, State, state_of_joints, state_of_platform
from par4_kinematics.adept import adept_motion
from par4_kinematics.errors import InputError, UnreachableError
from par4_kinematics.files import write_text, write_yaml
from par4_kinematics.geometry import HOME
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import Axis
from par4_kinematics.velocity import AT_D, AT_D2, jacobian
from robots import REFERENCE, UNEVEN, model_with, other_model, random_poses

MACHINES = [(REFERENCE, read_model('table1', REFERENCE)),
            (REFERENCE, read_model('table1_full', REFERENCE)),
            (UNEVEN, replace(other_model(), rigid_body='full'))]
IDS = ['reference paper', 'reference full', 'other full']


def moving_state(robot, count=400, seed=3):
    random = np.random.default_rng(seed)
    x = random_poses(robot, count, seed)
    return state_of_platform(robot.geometry, np.zeros(count), x, random.normal(size=(count, 4)),
                             20.0 * random.normal(size=(count, 4)))


def rigid_torque(model, state):
    return model.torque(state) - (model.values['coulomb_friction'] * np.sign(state.qd)
                                  + model.values['viscous_friction'] * state.qd)


def equation_20(geometry, state, i_act, m_1, m_2, arm_gravity, f_c, f_v):
    """Return (20) as the paper writes it, with J_1, J_2 and T_2, misprints corrected."""
    j_1, j_2 = (jacobian(geometry, state.x, point) for point in (AT_D, AT_D2))
    h, theta, rate = geometry.platform_bar_length, state.x[:, 3], state.xd[:, 3]
    weight = np.array((0.0, 0.0, GRAVITY, 0.0))
    t_1 = np.diag((1.0, 1.0, 1.0, 0.0))
    a_1 = state.xdd @ t_1.T
    zero = np.zeros_like(theta)
    t_2 = np.broadcast_to(t_1, (len(theta), 4, 4)).copy()
    t_2[:, 0, 3], t_2[:, 1, 3] = -h * np.cos(theta), -h * np.sin(theta)
    t_2_rate = np.zeros_like(t_2)
    t_2_rate[:, 0, 3], t_2_rate[:, 1, 3] = h * np.sin(theta) * rate, -h * np.cos(theta) * rate
    a_2 = np.einsum('nij,nj->ni', t_2, state.xdd) + np.einsum('nij,nj->ni', t_2_rate, state.xd)
    a_2[:, 3] = zero
    return (i_act * state.qdd + np.einsum('nji,nj->ni', j_1, m_1 * (a_1 + weight))
            + np.einsum('nji,nj->ni', j_2, m_2 * (a_2 + weight)) - np.cos(state.q) * arm_gravity
            + f_c * np.sign(state.qd) + f_v * state.qd)


def unsimplified_torque(robot, model, state):
    """Return the torque of every single body, rods with m/6 (2 a_A + a_B) at A, and so on."""
    g, bodies = robot.geometry, robot.bodies
    single = physical_bodies(g, model.lumped_bodies(), bodies.rod_mass, bodies.bar_mass)
    theta, rate, curve = state.x[:, 3], state.xd[:, 3], state.xdd[:, 3]
    h = g.platform_bar_length
    up = np.array((0.0, 0.0, GRAVITY))
    a_d = state.xdd[:, :3] + up
    relative = h * np.stack((np.sin(theta) * rate ** 2 - np.cos(theta) * curve,
                             -np.cos(theta) * rate ** 2 - np.sin(theta) * curve,
                             np.zeros_like(theta)), axis=1)
    a_d2 = a_d + relative
    j_1, j_2 = (jacobian(g, state.x, point)[:, :3] for point in (AT_D, AT_D2))
    bar = 2.0 * single.bar_mass / 6.0
    tau = (np.einsum('nai,na->ni', j_1, single.half_plate_1 * a_d + bar * (2 * a_d + a_d2))
           + np.einsum('nai,na->ni', j_2, single.half_plate_2 * a_d2 + bar * (a_d + 2 * a_d2)))
    tau += single.motor_inertia * state.qdd - np.cos(state.q) * GRAVITY * single.arm_moment
    for leg, azimuth in enumerate(g.actuator_azimuth):
        e, z = np.array((np.cos(azimuth), np.sin(azimuth), 0.0)), np.array((0.0, 0.0, 1.0))
        q, qd, qdd = state.q[:, leg], state.qd[:, leg], state.qdd[:, leg]
        arm = g.arm_lengths[leg]
        tangent = -arm * (np.outer(np.sin(q), e) + np.outer(np.cos(q), z))
        radial = arm * (np.outer(np.cos(q), e) - np.outer(np.sin(q), z))
        a_a = tangent * qdd[:, None] - radial * qd[:, None] ** 2 + up
        a_b = a_d2 if leg < 2 else a_d
        rod = 2.0 * single.rod_mass / 6.0
        tau[:, leg] += np.einsum('na,na->n', tangent, rod * (2 * a_a + a_b))
        tau += np.einsum('nai,na->ni', j_2 if leg < 2 else j_1, rod * (a_a + 2 * a_b))
    tau += bodies.theta_inertia * curve[:, None] * jacobian(g, state.x)[:, 3]
    return tau


@pytest.mark.parametrize(('robot', 'model'), MACHINES, ids=IDS)
def test_equation_20_is_the_base_torque(robot, model):
    state = moving_state(robot)
    values = [model.values[term.name][0] for term in base_terms(state)]
    expected = equation_20(robot.geometry, state, *values)
    np.testing.assert_allclose(model.base_torque(state), expected, atol=1e-10)


@pytest.mark.parametrize(('robot', 'model'), MACHINES, ids=IDS)
def test_a_payload_takes_the_torque_that_moves_and_holds_the_tool(robot, model):
    """As much power as its kinetic and potential energy take up: J^T of force at D."""
    state, mass = moving_state(robot), 0.7
    added = model.with_payload(mass).torque(state) - model.torque(state)
    force = mass * (state.xdd[:, :3] + (0.0, 0.0, GRAVITY))
    np.testing.assert_allclose(np.sum(added * state.qd, axis=1),
                               np.sum(force * state.xd[:, :3], axis=1), atol=1e-9)
    assert model.with_payload(0.0) is model


@pytest.mark.parametrize(('robot', 'model'), MACHINES[1:], ids=IDS[1:])
def test_full_mechanism_is_the_sum_of_its_bodies(robot, model):
    robot = robot.model_copy(update={'bodies': robot.bodies.model_copy(
        update={'theta_inertia': 2e-3})})
    model = replace(model, bodies=robot.bodies)
    state = moving_state(robot)
    np.testing.assert_allclose(rigid_torque(model, state),
                               unsimplified_torque(robot, model, state), atol=1e-9)


def test_lumped_rods_and_bars_give_equation_20():
    """The unsimplified bodies with half masses at the ends are (20) to 1e-9."""
    model = read_model('table1_full', REFERENCE)
    state = moving_state(REFERENCE)
    # half masses instead of m/6 (2 a_A + a_B): the distributed correction must vanish exactly
    correction = unmodelled_columns(state)[..., :2] @ (REFERENCE.bodies.rod_mass,
                                                       REFERENCE.bodies.bar_mass)
    lumped = unsimplified_torque(REFERENCE, model, state) - correction
    paper = rigid_torque(read_model('table1', REFERENCE), state)
    np.testing.assert_allclose(lumped, paper, atol=1e-9)
    assert np.abs(correction).max() > 0.1


@pytest.mark.parametrize(('robot', 'model'), MACHINES, ids=IDS)
def test_forward_dynamics_inverts_inverse_dynamics(robot, model):
    state = moving_state(robot)
    xdd = forward_dynamics(robot.geometry, model.lumped_bodies(), state.x, state.xd,
                           rigid_torque(model, state))
    np.testing.assert_allclose(xdd, state.xdd, atol=1e-9)


@pytest.mark.parametrize(('robot', 'model'), MACHINES, ids=IDS)
def test_derivatives_of_the_bodies_torque_are_those_of_a_motion_nearby(robot, model):
    state = moving_state(robot, 50)
    state = replace(state, nominal=model.nominal(state))
    mass = joint_mass_matrix(robot.geometry, model.lumped_bodies(), state.x)
    np.testing.assert_allclose(state.torque_by_qdd, mass, rtol=1e-7, atol=1e-9)
    random, step = np.random.default_rng(8), 1e-6
    way = random.normal(size=(3, *state.q.shape))
    ahead, behind = (model.rigid_torque(state_of_joints(
        robot.geometry, state.t, *np.stack((state.q, state.qd, state.qdd)) + sign * step * way))
        for sign in (1.0, -1.0))
    change = sum(np.einsum('nij,nj->ni', by, part) for by, part in zip(
        (state.torque_by_q, state.torque_by_qd, state.torque_by_qdd), way))
    np.testing.assert_allclose((ahead - behind) / (2.0 * step), change, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize(('robot', 'model'), MACHINES, ids=IDS)
def test_mass_matrix_is_symmetric_positive_definite(robot, model):
    mass = joint_mass_matrix(robot.geometry, model.lumped_bodies(), random_poses(robot, 300, 5))
    np.testing.assert_allclose(mass, np.swapaxes(mass, 1, 2), atol=1e-12)
    assert np.linalg.eigvalsh(mass).min() > 0.3 * model.values['actuator_inertia'][0]


@pytest.mark.parametrize(('robot', 'model'), MACHINES, ids=IDS)
def test_power_balance(robot, model):
    """Joint power is the rate of kinetic and potential energy."""
    state, bodies, step = moving_state(robot), model.lumped_bodies(), 1e-5

    def energy(time):
        x = state.x + state.xd * time + 0.5 * state.xdd * time ** 2
        return (kinetic_energy(robot.geometry, bodies, x, state.xd + state.xdd * time)
                + potential_energy(robot.geometry, bodies, x))

    power = np.sum(rigid_torque(model, state) * state.qd, axis=1)
    np.testing.assert_allclose((energy(step) - energy(-step)) / (2 * step), power,
                               atol=1e-6 * np.abs(power).max())


@pytest.mark.parametrize(('robot', 'model'), MACHINES, ids=IDS)
def test_gravity_torque_is_the_gradient_of_potential_energy(robot, model):
    x = random_poses(robot, 100, 8)
    still = np.zeros_like(x)
    state = state_of_platform(robot.geometry, np.zeros(len(x)), x, still, still)
    step = 1e-6
    gradient = np.stack([
        (potential_energy(robot.geometry, model.lumped_bodies(), x + step * axis)
         - potential_energy(robot.geometry, model.lumped_bodies(), x - step * axis)) / (2 * step)
        for axis in np.eye(4)], axis=1)
    expected = np.einsum('nai,na->ni', jacobian(robot.geometry, x), gradient)
    np.testing.assert_allclose(rigid_torque(model, state), expected, atol=1e-7)


@pytest.mark.parametrize(('robot', 'model'), MACHINES, ids=IDS)
def test_regressor_times_values_is_inverse_dynamics(robot, model):
    state = moving_state(robot)
    columns = base_columns(state)
    chi = np.array([model.values[term.name][0] for term in base_terms(state)])
    np.testing.assert_allclose(columns @ chi + model.known_torque(state), model.torque(state),
                               atol=1e-12)
    for index, term in enumerate(base_terms(state)):
        unit = {name: np.zeros(4) for name in model.values} | {term.name: np.ones(4)}
        np.testing.assert_allclose(replace(model, values=unit).base_torque(state),
                                   columns[..., index], atol=1e-12)


@pytest.mark.parametrize(('robot', 'model'), MACHINES, ids=IDS)
def test_each_joint_may_have_values_of_its_own(robot, model):
    state, random = moving_state(robot), np.random.default_rng(4)
    own = replace(model, values={name: value * random.uniform(0.5, 1.5, 4)
                                 for name, value in model.values.items()})
    chi = np.array([own.values[term.name] for term in base_terms(state)])
    np.testing.assert_allclose(np.einsum('njp,pj->nj', base_columns(state), chi),
                               own.base_torque(state), atol=1e-12)


def test_order_of_the_columns_is_that_of_the_base_terms():
    assert (*(term.name for term in BASE_TERMS), *UNMODELLED) == COLUMNS
    assert UNMODELLED == ('rod_mass', 'bar_mass', 'theta_inertia')


def test_layout_of_a_state_in_memory_does_not_matter():
    model, state = MACHINES[1][1], moving_state(REFERENCE, 50)
    other = replace(state, **{name: np.asfortranarray(getattr(state, name))
                              for name in ('x', 'xd', 'xdd', 'q', 'qd', 'qdd')})
    assert np.array_equal(model.torque(other), model.torque(state))
    assert np.array_equal(base_columns(other), base_columns(state))


def test_no_kernel_is_compiled_anew_for_a_state_of_every_other_sample():
    """It takes seconds: a user would wait for it, and so would each process that runs tests."""
    kernels = mean_signs, _rate_rows, _earlier_rows, swing_through
    model, motion, compiled = MACHINES[0][1], adept_motion(REFERENCE), []
    for every, steps in ((1, 1), (1, 4), (2, 1)):
        t, *q = (getattr(motion, name)[::every] for name in ('t', 'q', 'qd', 'qdd'))
        state = state_of_joints(REFERENCE.geometry, t, *q)
        state = replace(state, nominal=model.nominal(state))
        assert np.array_equal(State(t, *q).direction, state.direction)
        assert TimeOffset().columns(state, {'expanded_at': 1e-3}).shape == (*state.q.shape, 1)
        spring, _ = Springs(state).torque(np.full(4, 1e-4), every=steps)
        assert spring.shape == state.q.shape
        compiled.append([len(kernel.signatures) for kernel in kernels])
    assert compiled == 3 * compiled[:1]


@pytest.mark.parametrize('shape', [(), (1,), (5,), (2, 3)])
@pytest.mark.parametrize(('robot', 'model'), MACHINES, ids=IDS)
def test_torque_straight_from_a_motion_is_that_of_its_state(robot, model, shape):
    """One sample takes another way than many."""
    state = moving_state(robot, max(1, math.prod(shape)))
    expected = model.torque(state)
    wide = (*shape, 4)
    platform = (part.reshape(wide) for part in (state.x, state.xd, state.xdd))
    joints = (part.reshape(wide) for part in (state.q, state.qd, state.qdd))
    for found, close in ((model.torque_of_platform(robot.geometry, *platform), 1e-11),
                         (model.torque_of_joints(robot.geometry, *joints), 1e-7)):
        assert found.shape == wide
        np.testing.assert_allclose(found.reshape(-1, 4), expected, atol=close)


def test_torque_straight_from_a_motion_knows_the_effects_and_their_time():
    plain = read_model('table1', REFERENCE)
    model = model_with(plain, 'friction_drift', drop=0.5, time_constant=10.0)
    state = moving_state(REFERENCE, 1)
    for now in (0.0, 20.0):
        expected = model.torque(replace(state, t=np.array((now,))))[0]
        assert (np.abs(expected - plain.torque(state)).max() > 0.1) == (now > 0.0)
        for found in (
                model.torque_of_platform(REFERENCE.geometry, state.x[0], state.xd[0],
                                         state.xdd[0], now),
                model.torque_of_joints(REFERENCE.geometry, state.q[0], state.qd[0], state.qdd[0],
                                       now)):
            np.testing.assert_allclose(found, expected, atol=1e-7)


@pytest.mark.parametrize(('pose', 'error', 'words'), [
    ((0.0, 0.0, -2.0, 0.0), UnreachableError, 'pose 0 .*leg 0 cannot'),
    ((0.0, np.nan, -0.78, 0.0), InputError, 'x: .* found nan in sample 0, column 1'),
    ((0.0, 0.0, -np.inf, 0.0), InputError, 'x: .* found -inf in sample 0, column 2'),
    ((0.0, 0.0, -0.78), InputError, 'matching shape'),
])
def test_one_sample_is_checked_as_many_are(pose, error, words):
    model, still = read_model('table1', REFERENCE), np.zeros(4)
    with pytest.raises(error, match=words):
        model.torque_of_platform(REFERENCE.geometry, pose, still, still)
    with pytest.raises(InputError, match='xdd: .* found nan'):
        model.torque_of_platform(REFERENCE.geometry, HOME, still, [np.nan] * 4)


def test_one_sample_of_joints_is_checked_as_many_are():
    model, still = read_model('table1', REFERENCE), np.zeros(4)
    for q, error, words in (((-1.5, 1.5, -1.5, 1.5), UnreachableError, 'does not close'),
                            ((0.3, np.nan, 0.3, 0.3), InputError, 'found nan in sample 0')):
        with pytest.raises(error, match=words):
            model.torque_of_joints(REFERENCE.geometry, q, still, still)
    with pytest.raises(InputError, match='found nan'):
        model.torque_of_joints(REFERENCE.geometry, [0.3] * 4, [np.nan] * 4, still)


def test_forces_on_the_platform_do_the_work_of_the_joints():
    state = moving_state(REFERENCE)
    force = np.array((3.0, -2.0, 5.0, 0.4))
    np.testing.assert_allclose(np.sum(state.torque_of_force(force) * state.qd, axis=1),
                               state.xd @ force, atol=1e-9)


def test_what_is_computed_of_a_motion_is_so_whatever_its_torque_and_not_of_a_motion_nearby():
    state = moving_state(REFERENCE)
    larger = REFERENCE.geometry.with_errors(arm_length=1e-4)
    jacobian_there, turns = state.jacobian, state.turns
    told = state.with_nominal(read_model('table1', REFERENCE).nominal(state))
    assert told.jacobian is jacobian_there
    assert told.turns is turns
    assert state.nominal is None
    assert told.known.torque.shape == state.q.shape
    for near in (told.nearby(REFERENCE.geometry, state.q + 1e-3, state.qd, state.qdd),
                 told.nearby(larger, state.q, state.qd, state.qdd),
                 told.nearby(REFERENCE.geometry, state.q, state.qd + 1.0, state.qdd)):
        theta = near.x[:, 3]
        np.testing.assert_array_equal(near.turns, np.column_stack((np.cos(theta), np.sin(theta))))


def test_state_of_joints_and_of_platform_agree():
    state = moving_state(UNEVEN)
    again = state_of_joints(UNEVEN.geometry, state.t, state.q, state.qd, state.qdd)
    np.testing.assert_allclose(again.x, state.x, atol=1e-9)
    np.testing.assert_allclose(again.xdd, state.xdd, atol=1e-6)


def test_simplification_error_is_that_of_the_paper():
    """Rods of 40 g make (20) wrong by about 2 % on a fast motion, as against Adams."""
    time = np.linspace(0.0, 0.25, 500)
    angle = 2.0 * np.pi * time / 0.25
    x = np.zeros((len(time), 4))
    x[:, 0], x[:, 2] = 0.1525 * np.cos(angle), -0.78
    rate = 2.0 * np.pi / 0.25
    xd, xdd = np.zeros_like(x), np.zeros_like(x)
    xd[:, 0] = -0.1525 * rate * np.sin(angle)
    xdd[:, 0] = -0.1525 * rate ** 2 * np.cos(angle)
    state = state_of_platform(REFERENCE.geometry, time, x, xd, xdd)
    full = rigid_torque(read_model('table1_full', REFERENCE), state)
    paper = rigid_torque(read_model('table1', REFERENCE), state)
    error = np.linalg.norm(paper - full) / np.linalg.norm(full)
    assert 0.01 < error < 0.04


def test_model_file_round_trip(tmp_path):
    model_file = read_model_file('table1')
    write_model_file(tmp_path / 'model.yaml', model_file)
    assert read_model_file(tmp_path / 'model.yaml') == model_file


@pytest.mark.parametrize(('change', 'words'), [
    ({'schema': 'par4/model/2'}, ('expected schema par4/model/1', "'par4/model/2'")),
    ({'parameters': {'platform_mass_1': {'value': -0.8}}}, ('must not be negative', '-0.8')),
    ({'parameters': {'mass': {'value': 0.8}}}, ('unknown parameter mass', 'actuator_inertia')),
    ({'rigid_body': 'soft'}, ('rigid_body', "'paper' or 'full'")),
])
def test_bad_model_files_are_refused_in_one_line(tmp_path, change, words):
    content = read_model_file('table1').to_yaml() | change
    write_text(tmp_path / 'model.yaml', str(content))
    with pytest.raises(InputError) as error:
        read_model_file(tmp_path / 'model.yaml')
    assert '\n' not in str(error.value)
    for word in (*words, 'model.yaml'):
        assert word in str(error.value)


@pytest.mark.parametrize(('name', 'right', 'wrong'), [
    ('platform_mass_1', 'kg', 'g'), ('actuator_inertia', 'kg m2', 'g m2'),
    ('actuator_inertia', 'kg m2', 'kg'), ('viscous_friction', 'N m s/rad', 'N m s/deg'),
    ('stribeck_torque', 'N m', 'mN m'), ('stribeck_velocity', 'rad/s', 'deg/s'),
    ('exponent', '1', '%'),
])
def test_a_unit_that_is_not_the_parameters_own_is_refused(tmp_path, name, right, wrong):
    """Numbers are never converted: 804.3 g would be a platform of 804.3 kg."""
    path = tmp_path / 'model.yaml'
    for unit in (right, None, wrong):
        content = read_model_file('table1').to_yaml() | {'effects': [
            {'effect': 'stribeck', 'parameters': {
                'stribeck_torque': {'value': 1.2}, 'stribeck_velocity': {'value': 0.1},
                'exponent': {'value': 1.0}}}]}
        for parameters in (content['parameters'], content['effects'][0]['parameters']):
            if name in parameters:
                parameters[name].pop('unit', None)
                parameters[name] |= {} if unit is None else {'unit': unit}
        write_yaml(path, content)
        if unit != wrong:
            read_model(path, REFERENCE)
    with pytest.raises(InputError) as error:
        read_model(path, REFERENCE)
    assert '\n' not in str(error.value)
    for word in (str(path), name, f"expected the unit '{right}'", f"found '{wrong}'"):
        assert word in str(error.value)


@pytest.mark.parametrize(('name', 'unit'), [
    ('actuator_inertia', 'kg*m^2'), ('actuator_inertia', 'kg·m²'), ('coulomb_friction', 'Nm'),
    ('viscous_friction', 'N m s'), ('viscous_friction', 'N·m·s/rad')])
def test_a_unit_may_be_spelled_as_others_do(name, unit):
    known = read_model_file('table1')
    parameters = {**known.parameters, name: known.parameters[name].model_copy(
        update={'unit': unit})}
    built = build_model(REFERENCE, known.model_copy(update={'parameters': parameters}))
    np.testing.assert_array_equal(built.values[name], read_model('table1', REFERENCE).values[name])


def test_a_slide_has_units_of_its_own():
    """Models of a slide are written with the units of a slide, and those of a joint mean them."""
    slide = Axis(schema='par4/axis/1', name='slide', joint='slide', kind='linear', gain=35.0)
    arm = slide.model_copy(update={'kind': 'revolute'})

    def model_file(inertia, friction, step):
        return ModelFile(parameters={
            'actuator_inertia': {'value': 95.0, 'unit': inertia},
            'coulomb_friction': {'value': 20.0, 'unit': friction},
            'viscous_friction': {'value': 200.0}},
            effects=({'effect': 'quantization', 'parameters': {
                'step': {'value': 0.1, 'unit': step}}},))

    for units in (('kg', 'N', 'N'), ('kg m2', 'N m', 'N m')):
        assert build_model(slide, model_file(*units)).effects[0].units == {'step': 'N m'}
    assert build_model(slide, model_file('kg', 'N', 'm')).effects[0].units == {'step': 'rad'}

    def periodic(unit):
        return ModelFile(parameters={name: {'value': 1.0} for name in (
            'actuator_inertia', 'coulomb_friction', 'viscous_friction')}, effects=(
            {'effect': 'cogging', 'parameters': {
                'amplitude': {'value': 0.1}, 'phase': {'value': 0.0, 'unit': 'rad'},
                'periods': {'value': 90.0, 'unit': unit}}},))

    for unit in ('rad/m', '1/m', '1/turn'):  # the second of earlier versions, the same number
        build_model(slide, periodic(unit))
    with pytest.raises(InputError, match="periods: expected the unit '1/turn', found '1/m'"):
        build_model(arm, periodic('1/m'))
    with pytest.raises(InputError, match="coulomb_friction: expected the unit 'N', found 'kN'"):
        build_model(slide, model_file('kg', 'kN', 'N'))
    with pytest.raises(InputError, match="actuator_inertia: expected the unit 'kg m2', found 'kg'"):
        build_model(arm, model_file('kg', 'N m', 'N m'))
    with pytest.raises(InputError, match="step: expected the unit 'm' or 'N', found ''"):
        build_model(slide, model_file('kg', 'N', ''))


def stribeck_of(joints, torque):
    """Return a model file with Stribeck friction on some joints."""
    return read_model_file('table1').to_yaml() | {'effects': [
        {'effect': 'stribeck', 'joints': joints, 'parameters': {
            'stribeck_torque': {'value': torque}, 'stribeck_velocity': {'value': 0.1}}}]}


@pytest.mark.parametrize(('joints', 'torque', 'expected'), [
    ([1, 0], [1, 2], [2, 1, 0, 0]), ([3, 2, 1, 0], 1.5, [1.5, 1.5, 1.5, 1.5]),
    ([0, 1, 2, 3], [1, 2, 3, 4], [1, 2, 3, 4]), ([2], [3], [0, 0, 3, 0]),
])
def test_listed_values_are_those_of_the_joints_listed(joints, torque, expected):
    model = build_model(REFERENCE, ModelFile.model_validate(stribeck_of(joints, torque)))
    np.testing.assert_array_equal(model.effects[0].values['stribeck_torque'], expected)


@pytest.mark.parametrize(('joints', 'torque', 'words'), [
    ([0, 0, 1], [1, 2, 3], ('effects.0.joints: a joint is listed twice', '[0, 0, 1]')),
    ([3, 2, 1, 0], [1, 2, 3, 4], ('stribeck_torque: 4 numbers are those of joints 0 to 3',
                                  '[3, 2, 1, 0]', 'ascending')),
    ([0, True], [1, 2], ('effects.0.joints.1: expected a whole number', 'True')),
    ([0], True, ('stribeck_torque.value: expected a finite number', 'True')),
    ([0], '1.5', ('stribeck_torque.value: expected a finite number', "'1.5'")),
])
def test_joints_and_values_that_are_unclear_are_refused(tmp_path, joints, torque, words):
    write_yaml(tmp_path / 'model.yaml', stribeck_of(joints, torque))
    with pytest.raises(InputError) as error:
        read_model(tmp_path / 'model.yaml', REFERENCE)
    assert '\n' not in str(error.value)
    for word in (*words, 'model.yaml'):
        assert word in str(error.value)


def test_unknown_effect_and_missing_parameter_are_refused():
    content = read_model_file('table1').to_yaml()
    wrong = ModelFile.model_validate(content | {'effects': [
        {'effect': 'friction', 'parameters': {}}]})
    with pytest.raises(InputError, match='unknown effect.*stribeck'):
        build_model(REFERENCE, wrong)
    misspelt = ModelFile.model_validate(content | {'effects': [
        {'effect': 'coging', 'parameters': {}}]})
    with pytest.raises(InputError, match="unknown effect 'coging'; did you mean cogging"):
        build_model(REFERENCE, misspelt)
    del content['parameters']['arm_gravity']
    with pytest.raises(InputError, match='missing parameters arm_gravity'):
        build_model(REFERENCE, ModelFile.model_validate(content))


@pytest.mark.parametrize('rigid_body', ['paper', 'full'])
@pytest.mark.parametrize('name', PLATFORM_MASSES)
def test_a_platform_has_one_mass_for_all_joints(name, rigid_body):
    content = read_model_file('table1').to_yaml() | {'rigid_body': rigid_body}
    content['parameters'][name]['value'] = [0.8, 0.8, 0.8, 0.9]
    with pytest.raises(InputError, match=f'{name}: expected one number for the machine, found'):
        build_model(REFERENCE, ModelFile.model_validate(content))
    content['parameters'][name]['value'] = [0.8, 0.8, 0.8, 0.8]
    build_model(REFERENCE, ModelFile.model_validate(content))


def test_bodies_heavier_than_their_lump_are_refused():
    heavy = REFERENCE.model_copy(update={'bodies': REFERENCE.bodies.model_copy(
        update={'rod_mass': 0.5})})
    with pytest.raises(InputError, match='half plate 1.*negative with a rod of 0.5 kg'):
        read_model('table1_full', heavy)


def test_negative_mass_in_robot_file_is_refused(tmp_path):
    from par4_kinematics.robot import read_robot
    content = REFERENCE.model_dump(by_alias=True, mode='json')
    content['bodies']['rod_mass'] = -0.04
    write_yaml(tmp_path / 'robot.yaml', content)
    with pytest.raises(InputError, match=r'rod_mass.*expected 0 or more .*-0.04'):
        read_robot(tmp_path / 'robot.yaml')


def test_arm_gravity_of_a_lone_arm():
    """With a weightless platform the holding torque is -cos q times the arm's moment."""
    model = read_model('table1', REFERENCE)
    light = replace(model, values={**model.values, 'platform_mass_1': np.zeros(4),
                                   'platform_mass_2': np.zeros(4)})
    x = random_poses(REFERENCE, 20, 2)
    still = np.zeros_like(x)
    state = state_of_platform(REFERENCE.geometry, np.zeros(20), x, still, still)
    np.testing.assert_allclose(light.torque(state),
                               -1.33 * np.cos(inverse_kinematics(REFERENCE.geometry, x)))


@pytest.mark.parametrize('period', [1e-3, 5e-3])
def test_direction_is_the_mean_of_the_sign_over_a_sample(period):
    """Accelerations are constant over a sample, positive, negative and none."""
    random = np.random.default_rng(41)
    qd, qdd = random.normal(0.0, 0.5, (200, 4)), random.normal(0.0, 300.0, (200, 4))
    qdd[:, 3] = 0.0
    instants = period * (np.arange(-2000, 2000) + 0.5) / 4000
    expected = np.mean(np.sign(qd[..., None] + qdd[..., None] * instants), axis=-1)
    assert np.mean((np.abs(expected) < 1.0).any(axis=1)) > 0.1
    bend = np.zeros(4)
    np.testing.assert_allclose(mean_signs(qd, qdd, period, bend), expected, atol=1e-3)
    np.testing.assert_array_equal(mean_signs(qd, qdd, 0.0, bend), np.sign(qd))
    assert mean_signs(np.zeros((1, 1)), np.zeros((1, 1)), period, bend) == 0.0


def test_a_joint_whose_speed_is_kept_up_where_it_turns_has_turned_before():
    """From above and from below, by the time in which it loses that speed."""
    time = np.linspace(-0.01, 0.01, 2001)[:, None]
    for side in (1.0, -1.0):
        qd, qdd = side * -200.0 * time, np.full_like(time, side * -200.0)
        kept, bent = (mean_signs(qd, qdd, 1e-3, np.array([bend])) for bend in (0.0, 0.1))
        turned = [float(time[np.argmin(np.abs(signs)), 0]) for signs in (kept, bent)]
        assert turned == pytest.approx([0.0, -0.0005], abs=1e-5)


@pytest.mark.parametrize(('robot', 'model'), MACHINES, ids=IDS)
def test_columns_of_friction_have_the_direction_of_their_state(robot, model):
    """Of the base torque and its columns, of effects of friction, and of a motion nearby."""
    motion = adept_motion(robot, cycles=4, round_trip=None)
    state = state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd,
                            period=2e-3)
    partly = (np.abs(state.direction) < 1.0) & (state.direction != 0.0)
    assert partly.sum() > 10
    state = replace(state, bend=np.array([0.0, 0.05, 0.1, 0.2]))
    for found in (state, state.moved(state.q, state.qd, state.qdd),
                  state.nearby(robot.geometry, state.q, state.qd, state.qdd)):
        column = rigid_body_columns(found)[..., COLUMNS.index('coulomb_friction')]
        np.testing.assert_array_equal(column, state.direction)
    difference = JointFrictionDifference().columns(state, {})
    np.testing.assert_array_equal(difference[..., 0], state.direction)
    at_instants = replace(state, period=0.0, bend=0.0)
    torque = model.torque(state) - model.torque(at_instants)
    np.testing.assert_allclose(torque, model.values['coulomb_friction'] * (
        state.direction - np.sign(state.qd)), atol=1e-9)
