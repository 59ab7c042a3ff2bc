"""Effects of joints, drives and records against physics written down here on its own."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from par4_dynamics.effects.catalogue import CATALOGUE, SEVERAL_ORDERS
from par4_dynamics.effects.effect import FAST, beyond
from par4_dynamics.effects.guide import GUIDES
from par4_dynamics.effects.springs import DAMPING_RATIO, Springs
from par4_dynamics.effects.transmission import MOTOR_SHARE, motor_side
from par4_dynamics.model_file import EffectEntry, ModelFile, read_model_file, write_model_file
from par4_dynamics.model_from_file import build_model, read_model
from par4_dynamics.parameters import Parameter
from par4_dynamics.state import GRAVITY, State, state_of_joints, state_of_platform
from par4_kinematics.errors import InputError
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.robot import Axis
from robots import OTHER, REFERENCE, growing_waves, model_with, other_model, without_coulomb

AXIS = Axis(schema='par4/axis/1', name='arm', joint='arm', kind='revolute', gain=1.0)

EXAMPLES = {
    'coulomb_asymmetry': {'asymmetry': (0.3, -0.2, 0.1, 0.25)},
    'viscous_asymmetry': {'asymmetry': (0.1, -0.2, 0.05, 0.15)},
    'nonlinear_viscous': {'quadratic': (0.1, 0.05, -0.02, 0.2), 'torque': 0.0, 'exponent': 2.0},
    'load_dependent_friction': {'coefficient': (0.05, 0.02, 0.1, 0.03)},
    'friction_drift': {'drop': 0.1, 'viscous_drop': 0.3, 'time_constant': 2.0},
    'presliding': {'distance': 3e-3},
    'joint_friction_difference': {'coulomb': (0.2, -0.3, 0.1, 0.0),
                                  'viscous': (-0.1, 0.2, 0.0, 0.05)},
    'joint_inertia_difference': {'inertia': (0.005, -0.01, 0.002, 0.008)},
    'arm_mass_offset': {'first_moment': (0.02, -0.03, 0.01, 0.05)},
    'arm_weight_difference': {'first_moment': (0.02, -0.03, 0.0, 0.05)},
    'drive_gain_error': {'relative': (0.03, -0.02, 0.05, 0.01)},
    'torque_ripple': {'relative': (0.02, 0.01, 0.03, 0.015), 'periods': 24.0,
                      'phase': (0.3, -1.0, 2.0, 0.0)},
    'actuator_lag': {'time_constant': 2e-3},
    'time_offset': {'delay': -3e-3},
    'torque_saturation': {'limit': 12.0},
    'elastic_transmission': {'stiffness': (8e3, 2e4, 1.5e4, 1e4), 'damping_ratio': 0.08,
                             'motor_share': 0.7},
    'backlash': {'gap': (1e-3, 2e-3, 0.5e-3, 3e-3)},
    'quantization': {'step': 1e-4},
}
NEEDS_PLATFORM = {'arm_mass_offset', 'arm_weight_difference'}
NO_TORQUE = {'quantization'}
OPTIONAL = {'nonlinear_viscous', 'joint_friction_difference'}


def arrays(values, joints=4):
    return {name: np.broadcast_to(np.asarray(value, dtype=float), (4,))[:joints].copy()
            for name, value in values.items()}


def state_of(robot, model, period=1e-3):
    motion = excitation_motion(robot, 4.0, seed=5, period=period, acceleration=60.0)
    state = state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd)
    return replace(state, nominal=model.nominal(state))


MODELS = {'reference': (REFERENCE, read_model('table1', REFERENCE)),
          'other': (OTHER, replace(other_model(), rigid_body='full'))}


@pytest.fixture(scope='module', params=MODELS)
def case(request):
    """Return robot, model, state of a moving robot."""
    robot, model = MODELS[request.param]
    return robot, model, state_of(robot, model)


@pytest.fixture(scope='module')
def axis_case():
    """Return model and state of a single axis."""
    model = build_model(AXIS, axis_file())
    t = np.arange(0.0, 4.0, 1e-3)[:, None]
    rates = np.array((3.0, 7.0, 11.0))
    state = State(t[:, 0], *(np.sum(part, axis=1, keepdims=True) for part in (
        0.3 * np.sin(rates * t), 0.3 * rates * np.cos(rates * t),
        -0.3 * rates ** 2 * np.sin(rates * t))))
    return model, replace(state, nominal=model.nominal(state))


def axis_file(*entries):
    parameters = {'actuator_inertia': {'value': 0.2}, 'coulomb_friction': {'value': 1.5},
                  'viscous_friction': {'value': 0.8}}
    return ModelFile(schema='par4/model/1', parameters=parameters, effects=entries)


def entry(name, values, joints=None):
    unit = 'rad' if name == 'quantization' else ''
    return EffectEntry(effect=name, joints=joints, parameters={
        key: {'value': value, 'unit': unit} for key, value in values.items()})


def added(model, state, name, joints=(0, 1, 2, 3), **values):
    """Return what an effect adds to the model's torque, (n, 4)."""
    return model_with(model, name, joints, **values).torque(state) - model.torque(state)


def friction_of(model, state, name, **values):
    """Return the friction of the model with an effect: torque minus that of the bodies."""
    return model_with(model, name, **values).torque(state) - model.rigid_torque(state)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


# ---------------------------------------------------------------- the structure of all of them


@pytest.mark.parametrize('name', EXAMPLES)
def test_values_return_from_coefficients(name):
    effect, values = CATALOGUE[name], arrays(EXAMPLES[name])
    shape = effect.shape_of({key: value[0] for key, value in values.items()})
    found = effect.values(effect.coefficients(values), shape)
    assert set(found) == {parameter.name for parameter in effect.parameters}
    for key, value in values.items():
        np.testing.assert_allclose(found[key], value, rtol=1e-12, err_msg=key)


def test_power_law_values_return_from_coefficients():
    effect = CATALOGUE['nonlinear_viscous']
    values = arrays({'quadratic': 0.0, 'torque': (0.5, 0.3, 0.2, 0.4), 'exponent': 0.5})
    found = effect.values(effect.coefficients(values), {'exponent': 0.5})
    for key, value in values.items():
        np.testing.assert_allclose(found[key], value)


@pytest.mark.parametrize('name', EXAMPLES)
def test_torque_is_columns_times_coefficients(case, name):
    _, _, state = case
    effect, values = CATALOGUE[name], arrays(EXAMPLES[name])
    coefficients = effect.coefficients(values)
    shape = effect.shape_of({key: value[0] for key, value in values.items()})
    if name == 'elastic_transmission':
        shape = effect.expansion(coefficients[:, 0], shape)
    columns = effect.columns(state, shape)
    assert columns.shape == (*state.q.shape, len(coefficients))
    torque = effect.torque(state, values, (0, 1, 2, 3))
    np.testing.assert_allclose(torque, np.einsum('njk,kj->nj', columns, coefficients), atol=1e-9)
    assert (rms(torque) == 0.0) == (name in NO_TORQUE)


@pytest.mark.parametrize('name', [name for name in EXAMPLES
                                  if name not in NO_TORQUE and not CATALOGUE[name].shared])
def test_acts_on_its_joints_only(case, name):
    _, _, state = case
    torque = CATALOGUE[name].torque(state, arrays(EXAMPLES[name]), (1, 3))
    assert rms(torque[:, [0, 2]]) == 0.0
    assert min(rms(torque[:, 1]), rms(torque[:, 3])) > 0.0


@pytest.mark.parametrize('name', EXAMPLES)
def test_shapes_and_signature_fit_the_motion(case, name):
    _, _, state = case
    effect = CATALOGUE[name]
    shapes = effect.shapes(state)
    assert bool(shapes) == (name not in {'torque_saturation', 'quantization'})
    for shape in (*shapes[:1], *shapes[-1:]):
        assert np.isfinite(effect.columns(state, shape)).all()
        for nearby in effect.refined(shape, 1.0):
            assert set(nearby) == set(shape)
    signature = effect.signature(state)
    assert signature.abscissa.shape == state.q.shape
    assert np.isfinite(signature.abscissa).all()
    assert effect.phrase


@pytest.mark.parametrize('name', EXAMPLES)
def test_one_sample_is_enough(case, name):
    robot, model, state = case
    one = state_of_joints(robot.geometry, state.t[:1], state.q[1500:1501], state.qd[1500:1501],
                          state.qdd[1500:1501])
    assert np.isfinite(added(model, one, name, **EXAMPLES[name])).all()


@pytest.mark.parametrize('joints', [(0, 1, 2, 3), (1, 3)])
@pytest.mark.parametrize('name', EXAMPLES)
def test_read_from_a_model_file(case, name, joints):
    robot, _, state = case
    base = read_model_file('table1')
    effect = CATALOGUE[name]
    scopes = {parameter.name: parameter.scope for parameter in effect.parameters}
    values = {key: value if scopes[key] == 'joint' else float(np.max(value))
              for key, value in EXAMPLES[name].items()}
    content = base.model_copy(update={'effects': (entry(name, values, joints),)})
    if effect.of_machine and len(joints) < 4:
        with pytest.raises(InputError, match=f'{name} is of the whole machine, found joints .1, 3'):
            build_model(robot, content)
        return
    model = build_model(robot, content)
    acting = {key: np.where(np.isin(np.arange(4), joints), value, 0.0)
              if scopes[key] == 'joint' else value for key, value in EXAMPLES[name].items()}
    expected = added(model.without_effects(), state, name, joints, **acting)
    np.testing.assert_allclose(model.torque(state) - model.without_effects().torque(state),
                               expected, atol=1e-12)


def test_a_number_of_the_whole_machine_is_one():
    base = read_model_file('table1')

    def delayed(delay):
        return build_model(REFERENCE, base.model_copy(update={
            'effects': (entry('time_offset', {'delay': delay}),)})).effects[0].values['delay']

    np.testing.assert_array_equal(delayed((2e-3,) * 4), np.full(4, 2e-3))
    for several in ((0.0, 0.0, 1e-2, 0.0), (1e-3, 2e-3)):
        with pytest.raises(InputError, match='delay: expected one number, of the whole machine'):
            delayed(several)


def test_an_effect_of_no_joint_is_refused():
    with pytest.raises(ValueError, match='no joint is listed; leave joints out'):
        entry('stribeck', {'stribeck_torque': 1.0, 'stribeck_velocity': 0.1}, ())


@pytest.mark.parametrize('name', EXAMPLES)
def test_no_sample_is_enough(case, name):
    _, model, state = case
    assert added(model, state.part(slice(0, 0)), name, **EXAMPLES[name]).shape == (0, 4)


@pytest.mark.parametrize('name', EXAMPLES)
def test_a_wrong_parameter_is_refused(name):
    base = read_model_file('table1')
    values = dict.fromkeys(EXAMPLES[name], 0.01)
    missing = dict(list(values.items())[1:])
    for wrong in ({**values, 'colour': 1.0}, {} if name in OPTIONAL else missing):
        with pytest.raises(InputError, match=f'effect {name}: expected parameters'):
            build_model(REFERENCE, base.model_copy(update={'effects': (entry(name, wrong),)}))


@pytest.mark.parametrize('name', EXAMPLES)
def test_single_axis(axis_case, name):
    model, state = axis_case
    values = {key: float(np.ravel(value)[0]) for key, value in EXAMPLES[name].items()}
    if name in NEEDS_PLATFORM:
        with pytest.raises(InputError, match='needs a platform'):
            build_model(AXIS, axis_file(entry(name, values)))
        return
    extended = build_model(AXIS, axis_file(entry(name, values)))
    torque = extended.torque(state) - model.torque(state)
    assert torque.shape == state.q.shape
    assert np.isfinite(torque).all()
    assert (rms(torque) == 0.0) == (name in NO_TORQUE)


BASE = {'actuator_inertia': 0.1, 'platform_mass_1': 0.8, 'platform_mass_2': 0.8,
        'arm_gravity': 1.3, 'coulomb_friction': 2.4, 'viscous_friction': 2.0}


def reason_against(name, values, deviation=0.0):
    """Return why values cannot be real, each known to a share `deviation` of its size."""
    full = arrays({**EXAMPLES[name], **values})
    std = {key: deviation * np.abs(value) for key, value in full.items()}
    return CATALOGUE[name].implausible(full, std, arrays(BASE))


@pytest.mark.parametrize('name', CATALOGUE)
def test_no_deviation_refuses_values_that_a_machine_may_have_exactly(name):
    """A search computes deviations only where the exact values are refused."""
    random, effect = np.random.default_rng(11), CATALOGUE[name]
    possible = 0
    for _ in range(2000):
        values, std = {}, {}
        for parameter in effect.parameters:
            count = 4 if parameter.size == 1 else parameter.size
            each = random.uniform(-5.0, 5.0) + random.choice((0.0, 0.2)) * random.normal(size=count)
            values[parameter.name] = random.choice((-1.0, 0.0, 1.0, 1.0)) * 10.0 ** each
            std[parameter.name] = np.abs(values[parameter.name]) * 10.0 ** random.uniform(-3.0, 3.0)
        exact = {key: 0.0 * own for key, own in std.items()}
        with np.errstate(over='ignore', invalid='ignore'):  # a speed to the power of 1e5
            if effect.implausible(values, exact, arrays(BASE)) is None:
                possible += 1
                assert effect.implausible(values, std, arrays(BASE)) is None
    assert possible


@pytest.mark.parametrize('name', EXAMPLES)
def test_typical_size_is_plausible(name):
    assert reason_against(name, {}) is None


def test_an_estimate_is_out_of_bounds_by_more_than_chance_or_not_at_all():
    assert beyond(-0.1, 0.0, low=0.0) == 0
    assert beyond(-0.1, 0.04, low=0.0) is None
    assert beyond(-0.1, 0.03, low=0.0) == 0
    assert beyond((0.5, 1.2, 2.0, -3.0), 0.1, high=1.0) == 2
    assert beyond((0.5, 1.2, 2.0, -3.0), (0.1, 0.01, 0.5, 0.1), -4.0, 1.0) == 1
    assert beyond((0.5, 1.2), 0.0, low=(0.0, 1.3), high=2.0) == 1
    assert beyond((0.5, 1.2), 0.0) is None


@pytest.mark.parametrize(('name', 'values', 'reason'), [
    ('coulomb_asymmetry', {'asymmetry': (0.1, -3.0, 0, 0)},
     '-3 N m is not less than the Coulomb friction 2.4 N m: it would drive'),
    ('viscous_asymmetry', {'asymmetry': (0.1, 2.5, 0, 0)},
     '2.5 N m s/rad is not less than the viscous friction 2 N m s/rad: it would drive'),
    ('nonlinear_viscous', {'quadratic': -2.0}, 'drive the joint'),
    ('nonlinear_viscous', {'quadratic': 20.0}, 'three times'),
    ('nonlinear_viscous', {'torque': -9.0, 'exponent': 0.5}, 'drive the joint'),
    ('nonlinear_viscous', {'torque': 0.3, 'exponent': 1.02}, 'is viscous friction'),
    ('load_dependent_friction', {'coefficient': (0.05, -0.02, 0.05, 0.05)}, 'cannot fall'),
    ('load_dependent_friction', {'coefficient': 0.8}, 'loses'),
    ('friction_drift', {'drop': -0.2}, 'Coulomb friction that warms up falls'),
    ('friction_drift', {'drop': 1.5}, 'Coulomb friction that warms up falls'),
    ('friction_drift', {'viscous_drop': -0.2}, 'viscous friction that warms up falls'),
    ('friction_drift', {'viscous_drop': 1.5}, 'viscous friction that warms up falls'),
    ('friction_drift', {'time_constant': -1.0}, 'must be positive'),
    ('presliding', {'distance': -1e-3}, 'positive distance'),
    ('presliding', {'distance': 0.5}, 'positive distance'),
    ('joint_friction_difference', {'coulomb': (0, 0, -3.0, 0)}, 'coulomb'),
    ('joint_friction_difference', {'viscous': (0, 0, -3.0, 0)}, 'viscous'),
    ('joint_inertia_difference', {'inertia': (0.01, 0.01, 0.01, -0.2)}, 'inertia'),
    ('arm_mass_offset', {'first_moment': 1.0}, 'beside the arm'),
    ('arm_weight_difference', {'first_moment': (0.0, 0.0, -0.9, 0.0)}, 'by which one arm differs'),
    ('drive_gain_error', {'relative': (0.01, -0.9, 0, 0)}, 'wrong unit'),
    ('drive_gain_error', {'relative': (0.01, 11.7, 0, 0)}, 'wrong unit'),
    ('torque_ripple', {'relative': 0.6}, 'ripple'),
    ('actuator_lag', {'time_constant': -2e-3}, 'lags'),
    ('actuator_lag', {'time_constant': 0.2}, 'lags'),
    ('time_offset', {'delay': -0.2}, 'stamps'),
    ('torque_saturation', {'limit': 1.0}, 'could not move'),
    ('elastic_transmission', {'stiffness': (2e4, -2e4, 2e4, 2e4)}, 'not against it'),
    ('elastic_transmission', {'stiffness': -1e4}, 'not against it'),
    ('elastic_transmission', {'stiffness': 5.0}, 'expected 100'),
    ('elastic_transmission', {'stiffness': 1e8}, 'expected 100'),
    ('backlash', {'gap': -1e-3}, 'negative'),
    ('backlash', {'gap': 0.2}, 'not backlash'),
    ('quantization', {'step': -1e-4}, 'must be positive'),
])
def test_wrong_sign_or_size_is_implausible_unless_it_may_be_chance(name, values, reason):
    for deviation in (0.0, 0.02):
        assert reason in reason_against(name, values, deviation)
    assert reason_against(name, values, 100.0) is None


@pytest.mark.parametrize(('name', 'values'), [
    ('drive_gain_error', {'relative': (1.0, -1.0 / 3.0, 0.5, -0.5)}),  # half, 1.5 times, ...
    ('time_offset', {'delay': 0.1}), ('time_offset', {'delay': -0.1}),
])
def test_large_errors_of_real_machines_are_plausible(name, values):
    assert reason_against(name, values) is None


def test_friction_of_a_motor_before_its_screw_may_build_up_over_half_a_radian():
    distance, exact = {'distance': np.array([0.5])}, {'distance': np.zeros(1)}
    presliding = CATALOGUE['presliding']
    assert presliding.implausible(distance, exact, {FAST: np.ones(1)}) is None
    assert presliding.implausible(distance, exact, {}) is not None


def test_a_stiff_joint_beside_an_elastic_one_may_have_any_sign():
    """Noise gives a rigid joint a compliance or a gap of either sign, which accuses nobody."""
    for name, parameter, values, noise in (
            ('elastic_transmission', 'stiffness', (8e3, -3e5, 4e5, -2e6), 2e-6),
            ('backlash', 'gap', (2e-3, -1e-4, 5e-5, 0.0), 5e-5)):
        full = arrays({parameter: values, 'damping_ratio': DAMPING_RATIO,
                       'motor_share': MOTOR_SHARE})
        size = full[parameter]
        # the same noise of 1 / k on each joint
        spread = noise * size ** 2 if parameter == 'stiffness' else noise * np.ones(4)
        for share, fine in ((1.0, True), (0.1, False)):
            reason = CATALOGUE[name].implausible(
                full, {parameter: share * spread, 'damping_ratio': np.zeros(4),
                       'motor_share': np.zeros(4)}, arrays(BASE))
            assert (reason is None) == fine


# ------------------------------------------------------------------------------------ friction


def test_coulomb_asymmetry_has_two_plateaus(case):
    _, model, state = case
    asymmetry = np.array(EXAMPLES['coulomb_asymmetry']['asymmetry'])
    still = replace(state, qd=np.where(np.abs(state.qd) < 0.05, 0.0, state.qd))
    dry = (friction_of(model, still, 'coulomb_asymmetry', asymmetry=asymmetry)
           - model.values['viscous_friction'] * still.qd)
    level = model.values['coulomb_friction']
    for joint in range(4):
        forward, backward = still.qd[:, joint] > 0, still.qd[:, joint] < 0
        np.testing.assert_allclose(dry[forward, joint], level[joint] + asymmetry[joint])
        np.testing.assert_allclose(dry[backward, joint], asymmetry[joint] - level[joint])
        resting = ~forward & ~backward
        assert resting.any()
        np.testing.assert_allclose(dry[resting, joint], 0.0, atol=1e-9)


def test_viscous_asymmetry_has_two_slopes(case):
    _, model, state = case
    asymmetry = np.array(EXAMPLES['viscous_asymmetry']['asymmetry'])
    wet = (friction_of(model, state, 'viscous_asymmetry', asymmetry=asymmetry)
           - model.values['coulomb_friction'] * np.sign(state.qd))
    slope = model.values['viscous_friction']
    for joint in range(4):
        for side, expected in ((1.0, slope + asymmetry), (-1.0, slope - asymmetry)):
            rows = side * state.qd[:, joint] > 0.1
            found = np.linalg.lstsq(state.qd[rows, joint, None], wet[rows, joint], rcond=None)
            np.testing.assert_allclose(found[0][0], expected[joint], rtol=1e-9)


def test_nonlinear_viscous_grows_with_a_power_of_speed(case):
    """Twice the speed: four times the quadratic torque, 2^a times the power law; both oppose."""
    _, model, state = case
    twice = replace(state, qd=2.0 * state.qd)
    forms = {'quadratic': ({'quadratic': 0.3, 'torque': 0.0, 'exponent': 1.0}, 4.0),
             'power law': ({'quadratic': 0.0, 'torque': 0.5, 'exponent': 0.4}, 2.0 ** 0.4)}
    total = 0.0
    for values, ratio in forms.values():
        effect, full = CATALOGUE['nonlinear_viscous'], arrays(values)
        torque = effect.torque(state, full, (0, 1, 2, 3))
        np.testing.assert_allclose(effect.torque(twice, full, (0, 1, 2, 3)), ratio * torque)
        assert np.all(torque * state.qd >= 0.0)
        total = total + torque
    at_one = replace(state, qd=np.ones_like(state.qd))
    both = {'quadratic': 0.3, 'torque': 0.5, 'exponent': 0.4}
    np.testing.assert_allclose(added(model, state, 'nonlinear_viscous', **both), total, atol=1e-12)
    np.testing.assert_allclose(added(model, at_one, 'nonlinear_viscous', **both), 0.8)


def test_load_dependent_friction_takes_a_share_of_the_transmitted_power(case):
    _, model, state = case
    share = np.array(EXAMPLES['load_dependent_friction']['coefficient'])
    lost = added(model, state, 'load_dependent_friction', coefficient=share) * state.qd
    nothing = {'coulomb_friction': np.zeros(4), 'viscous_friction': np.zeros(4)}
    load = replace(model, values={**model.values, **nothing}).torque(state)
    np.testing.assert_allclose(lost, share * np.abs(load * state.qd), atol=1e-9)


def test_friction_drift_is_exponential_in_time(case):
    _, model, state = case
    drop, viscous_drop, constant = 0.1, 0.4, 0.7
    dry = model.values['coulomb_friction'] * np.sign(state.qd)
    wet = model.values['viscous_friction'] * state.qd
    warm = friction_of(model, state, 'friction_drift', drop=drop, viscous_drop=viscous_drop,
                       time_constant=constant)
    # 1 - e^-1 of the drop after a time constant, 1 - e^-3 after three
    for times, gone in ((0.0, 0.0), (1.0, 0.6321206), (3.0, 0.9502129)):
        row = int(np.argmin(np.abs(state.t - times * constant)))
        expected = dry[row] * (1.0 - drop * gone) + wet[row] * (1.0 - viscous_drop * gone)
        np.testing.assert_allclose(warm[row], expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(('name', 'values', 'part'), [
    *((name, EXAMPLES[name], 'drop') for name in (
        'coulomb_asymmetry', 'load_dependent_friction', 'presliding')),
    ('stribeck', {'stribeck_torque': 0.4, 'stribeck_velocity': 0.2}, 'drop'),
    ('joint_friction_difference', {'coulomb': (0.2, -0.3, 0.1, 0.0)}, 'drop'),
    ('joint_friction_difference', {'viscous': (-0.1, 0.2, 0.0, 0.05)}, 'viscous_drop'),
    ('viscous_asymmetry', EXAMPLES['viscous_asymmetry'], 'viscous_drop'),
    ('nonlinear_viscous', EXAMPLES['nonlinear_viscous'], 'viscous_drop')])
def test_what_an_effect_adds_to_friction_falls_with_it(case, name, values, part):
    """As on the simulated machine, where warming lowers every level of its kind of friction."""
    _, model, state = case
    warmth = 1.0 - np.exp(-state.t / 0.7)[:, None]
    cold = added(model, state, name, **values)
    assert rms(cold) > 0.01
    for drops in ({'drop': 0.3, 'viscous_drop': 0.0}, {'drop': 0.0, 'viscous_drop': 0.4}):
        warming = model_with(model, 'friction_drift', time_constant=0.7, **drops)
        warm = model_with(warming, name, **values).torque(state) - warming.torque(state)
        np.testing.assert_allclose(warm, cold * (1.0 - drops[part] * warmth), atol=1e-9)


def test_a_model_file_with_one_drop_means_both(case):
    robot, _, state = case
    base = read_model_file('table1')

    def torque(**drops):
        return build_model(robot, base.model_copy(update={'effects': (
            entry('friction_drift', {**drops, 'time_constant': 0.7}),)})).torque(state)

    np.testing.assert_array_equal(torque(drop=0.3), torque(drop=0.3, viscous_drop=0.3))
    assert rms(torque(drop=0.3) - torque(drop=0.3, viscous_drop=0.0)) > 0.1


def test_presliding_follows_the_differential_equation(case):
    """dz/dq = (1 - z s) / d by many small steps between samples."""
    _, model, state = case
    distance, fine = 3e-3, 200
    z = np.zeros(4)
    expected = np.zeros_like(state.q)
    for row in range(1, 1200):
        step = (state.q[row] - state.q[row - 1]) / fine
        for _ in range(fine):
            z = z + (1.0 - z * np.sign(step)) * step / distance
        expected[row] = z
    dry = (friction_of(model, state, 'presliding', distance=distance)
           - model.values['viscous_friction'] * state.qd)
    share = dry / model.values['coulomb_friction']
    np.testing.assert_allclose(share[:1200], expected[:1200], atol=2e-3)
    assert np.abs(share).max() <= 1.0 + 1e-9
    assert np.abs(share[:, 0]).max() > 0.99


def test_presliding_saves_twice_the_level_times_the_distance_a_reversal(axis_case):
    """From -f_c to f_c over the distance: the work 2 f_c d is not spent."""
    model, _ = axis_case
    t = np.arange(0.0, 4.0, 1e-4)[:, None]
    rate, distance = np.pi, 2e-3  # reversals at 0.5, 1.5, 2.5 and 3.5 s, 0.8 rad apart
    state = State(t[:, 0], 0.4 * np.sin(rate * t), 0.4 * rate * np.cos(rate * t),
                  -0.4 * rate ** 2 * np.sin(rate * t))
    presliding = build_model(AXIS, axis_file(entry('presliding', {'distance': distance})))
    change = (presliding.torque(state) - model.torque(state))[:, 0]
    saved = -np.trapezoid(change, state.q[:, 0])
    # the start from z = 0 saves half of a reversal
    assert saved == pytest.approx((4 * 2.0 + 1.0) * 1.5 * distance, rel=0.01)


def test_presliding_signature_restarts_at_reversals(case):
    _, _, state = case
    travel = CATALOGUE['presliding'].signature(state).abscissa
    assert np.all(travel[2:] * np.sign(np.diff(state.q, axis=0))[1:] >= 0.0)
    assert rms(travel) > 1e-2


# ------------------------------------------------------------------- differences between joints


def test_joint_differences_are_the_base_terms_of_single_joints(case):
    _, model, state = case
    own = arrays(EXAMPLES['joint_friction_difference'])
    inertia = arrays(EXAMPLES['joint_inertia_difference'])['inertia']
    moment = arrays(EXAMPLES['arm_weight_difference'])['first_moment']
    friction = {'coulomb_friction': model.values['coulomb_friction'] + own['coulomb'],
                'viscous_friction': model.values['viscous_friction'] + own['viscous']}
    for name, values in (
            ('joint_friction_difference', friction),
            ('arm_weight_difference',
             {'arm_gravity': model.values['arm_gravity'] + GRAVITY * moment}),
            ('joint_inertia_difference',
             {'actuator_inertia': model.values['actuator_inertia'] + inertia})):
        expected = replace(model, values={**model.values, **values}).torque(state)
        np.testing.assert_allclose(model_with(model, name, **EXAMPLES[name]).torque(state),
                                   expected, atol=1e-9)


def test_arm_mass_offset_is_the_slope_of_potential_energy(case):
    """A point mass below the line of the arm, placed in space."""
    robot, model, state = case
    mass, along, below, step = 0.2, 0.15, 0.1, 1e-5
    geometry = robot.geometry
    z = np.array((0.0, 0.0, 1.0))
    for leg, azimuth in enumerate(geometry.actuator_azimuth):
        e = np.array((np.cos(azimuth), np.sin(azimuth), 0.0))

        def height(q, distance, e=e):
            line = np.outer(np.cos(q), e) - np.outer(np.sin(q), z)
            # perpendicular to the line in the arm's plane, straight down at q = 0
            across = np.outer(-np.sin(q), e) - np.outer(np.cos(q), z)
            return (geometry.base_radius * e + along * line + distance * across)[:, 2]

        q = state.q[:, leg]
        slope = [mass * GRAVITY * (height(q + step, d) - height(q - step, d)) / (2.0 * step)
                 for d in (below, 0.0)]
        found = added(model, state, 'arm_mass_offset', first_moment=mass * below)[:, leg]
        np.testing.assert_allclose(found, slope[0] - slope[1], atol=1e-8)


# -------------------------------------------------------------------------- drives and records


def test_a_motor_with_more_inertia_takes_more_of_what_its_spring_would_pass_on(case):
    """Half of the actuator's inertia turns with the motor, that of its own difference, too."""
    _, model, state = case
    inertia = np.array((0.02, -0.01, 0.015, 0.0))
    model = model_with(model, 'joint_inertia_difference', inertia=inertia)
    state = state.with_nominal(model.nominal(state))
    expected = 0.5 * (model.values['actuator_inertia'] + inertia) * state.qdd
    np.testing.assert_allclose(motor_side(state, state.qdd, 0.5), expected)


def test_drive_gain_error_scales_the_record(case):
    _, model, state = case
    relative = np.array(EXAMPLES['drive_gain_error']['relative'])
    np.testing.assert_allclose(
        model_with(model, 'drive_gain_error', relative=relative).torque(state),
        model.torque(state) * (1.0 + relative))


def test_torque_ripple_modulates_the_torque(case):
    _, model, state = case
    values = arrays(EXAMPLES['torque_ripple'])
    ratio = model_with(model, 'torque_ripple', **EXAMPLES['torque_ripple']).torque(state)
    needed = model.torque(state)
    expected = np.empty_like(needed)
    for joint in range(4):
        wave = np.sin(24 * state.q[:, joint] + values['phase'][joint])
        expected[:, joint] = needed[:, joint] * (1.0 + values['relative'][joint] * wave)
    np.testing.assert_allclose(ratio, expected, atol=1e-9)


@pytest.mark.parametrize('periods', [0.0, 1.0, 4.0, 22.0, 127.0, 160.0, 161.0, 22.5, -3.0])
@pytest.mark.parametrize('name', ['cogging', 'torque_ripple'])
def test_a_torque_is_periodic_in_the_angle_by_any_number(case, name, periods):
    """Whole numbers within the library are powers of exp(i q), others are not."""
    _, _, state = case
    effect, size, phase = CATALOGUE[name], np.array((0.6, 0.1, 0.0, 0.3)), np.arange(4.0)
    values = {effect.parameters[0].name: size, 'periods': np.full(4, periods), 'phase': phase}
    for here in (state, replace(state, q=np.asfortranarray(state.q - 3.0))):
        carried = here.nominal.torque if name == 'torque_ripple' else 1.0
        expected = size * carried * np.sin(periods * here.q + phase)
        columns = effect.columns(here, {'periods': periods})
        close = 1e-12 * np.max(np.abs(carried))
        np.testing.assert_allclose(np.einsum('njk,kj->nj', columns, effect.coefficients(values)),
                                   expected, rtol=0.0, atol=close)
        np.testing.assert_allclose(effect.torque(here, values, (0, 1, 2, 3)), expected, rtol=0.0,
                                   atol=close)


ORDERS = {'periods': [7.0, 14.0, 84.5], 'phase': [(0.0, 1.6, 3.1, -1.6), 0.4, 0.0]}
SIZES = [(0.3, 0.28, 0.31, 0.25), 0.12, (0.05, 0.02, 0.0, 0.03)]


def with_orders(name, joints=None, **changes):
    """Return an entry of a model file with several orders."""
    size = CATALOGUE[name].parameters[0].name
    return EffectEntry(effect=name, joints=joints, parameters={
        key: {'value': value} for key, value in {**ORDERS, size: SIZES, **changes}.items()})


@pytest.mark.parametrize('name', ['cogging', 'torque_ripple'])
@pytest.mark.parametrize('joints', [None, (0, 3)])
def test_several_orders_add_up(case, name, joints):
    robot, _, state = case
    base = read_model_file('table1')
    model = build_model(robot, base.model_copy(update={'effects': (with_orders(name, joints),)}))
    found = model.torque(state) - model.without_effects().torque(state)
    carried = model.without_effects().torque(state) if name == 'torque_ripple' else 1.0
    expected = np.zeros_like(state.q)
    for order, size, phase in zip(ORDERS['periods'], SIZES, ORDERS['phase']):
        expected += np.array(size) * carried * np.sin(order * state.q + np.array(phase))
    idle = [joint for joint in range(4) if joints and joint not in joints]
    expected[:, idle] = 0.0
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize('name', ['cogging', 'torque_ripple'])
def test_values_of_several_orders_return_from_coefficients(case, name):
    robot, _, state = case
    base, effect = read_model_file('table1'), CATALOGUE[name]
    model = build_model(robot, base.model_copy(update={'effects': (with_orders(name),)}))
    values, state = model.effects[0].values, replace(state, nominal=model.nominal(state))
    shape = effect.shape_of({key: value[0] for key, value in values.items()})
    assert shape == {'periods': (7.0, 14.0, 84.5)}
    coefficients = effect.coefficients(values)
    back = effect.values(coefficients, shape)
    assert set(back) == set(values)
    for key in ('periods', effect.parameters[0].name):
        np.testing.assert_allclose(back[key], values[key])
    seen = values[effect.parameters[0].name] > 0.0  # without a size there is no phase
    np.testing.assert_allclose(back['phase'][seen], values['phase'][seen])
    columns = effect.columns(state, shape)
    assert columns.shape == (*state.q.shape, 6)
    np.testing.assert_allclose(np.einsum('njk,kj->nj', columns, coefficients),
                               model.effects[0].torque(state), atol=1e-9)
    zero = {key: np.zeros_like(value) for key, value in values.items()}
    reason = effect.implausible(values, zero, arrays(BASE))
    assert (reason is None) == (name == 'cogging')
    assert name == 'cogging' or '0.31' in reason


def test_a_list_of_one_order_is_that_order(case):
    robot, _, state = case
    base = read_model_file('table1')
    torques = [build_model(robot, base.model_copy(update={'effects': (
        with_orders('cogging', periods=periods, amplitude=size, phase=phase),)})).torque(state)
        for periods, size, phase in ((24.0, (0.1, 0.2, 0.3, 0.4), 0.5),
                                     ([24.0], [(0.1, 0.2, 0.3, 0.4)], 0.5))]
    np.testing.assert_array_equal(*torques)


@pytest.mark.parametrize(('changes', 'words'), [
    ({'amplitude': [0.1, 0.2]}, 'amplitude: expected .* each of the 3 orders; found 2 entries'),
    ({'amplitude': [0.1, (0.1, 0.2, 0.3), 0.1]}, 'amplitude: .* 4 joints or 4, found 3'),
    ({'periods': [7.0, 14.0, 7.0]}, 'periods: .* that differ'),
    ({'periods': [7.0, 14.0, -7.0]}, 'periods: .* positive'),
    ({'periods': [7.0, (14.0, 15.0), 8.0]}, 'periods: expected one number, or a list'),
    ({'periods': 7.0}, 'phase: .* a list in a list, which needs a list of periods'),
])
def test_orders_that_do_not_match_are_refused(changes, words):
    base = read_model_file('table1')
    with pytest.raises(InputError, match=words) as caught:
        build_model(REFERENCE, base.model_copy(update={
            'effects': (with_orders('cogging', **changes),)}))
    assert '\n' not in str(caught.value)


def test_orders_go_through_a_file_as_the_docs_show_them(tmp_path):
    path, again = tmp_path / 'model.yaml', tmp_path / 'again.yaml'
    text = '\n'.join(('schema: par4/model/1', 'parameters:', *(
        f'  {name}: {{value: {value}}}' for name, value in BASE.items()), SEVERAL_ORDERS))
    path.write_text(text, encoding='utf-8')
    write_model_file(again, read_model_file(path))
    first, second = (read_model(file, REFERENCE).effects[0].values for file in (path, again))
    for name, value in first.items():
        np.testing.assert_array_equal(value, second[name])
    np.testing.assert_array_equal(first['periods'], np.tile((7.0, 14.0, 84.0), (4, 1)))
    np.testing.assert_array_equal(first['amplitude'][2], (0.31, 0.12, 0.05))
    path.write_text(text.replace('viscous_friction: {value: 2.0}',
                                 'viscous_friction: {value: [[2.0, 2.0]]}'), encoding='utf-8')
    with pytest.raises(InputError, match='viscous_friction: expected one number or one a joint'):
        read_model_file(path)


def test_orders_may_have_standard_deviations_of_their_own():
    value = [(0.3, 0.2, 0.3, 0.2), 0.1]
    for std in (0.01, [0.01, 0.02], [(0.01, 0.02, 0.01, 0.02), 0.01]):
        assert Parameter(value=value, std=std).std is not None
    for std, words in (([0.01], 'as many numbers'), ([0.01, (0.01, 0.02)], 'as many numbers'),
                       ([(0.01, 0.02), 0.01], 'as many numbers'),
                       ([(0.01, 0.02, -0.01, 0.02), 0.01], 'must not be negative')):
        with pytest.raises(ValueError, match=words):
            Parameter(value=value, std=std)


@pytest.mark.parametrize('name', ['cogging', 'torque_ripple'])
def test_periods_are_tried_from_what_the_joint_that_moves_most_can_tell(case, name):
    _, _, state = case
    angles = state.q[0] + np.array((0.3, 1.0, 0.5, 0.4)) * (state.q - state.q[0])
    widest = np.ptp(angles, axis=0).max()
    shapes = CATALOGUE[name].shapes(replace(state, q=angles))
    turns = widest / (2.0 * np.pi) * np.array([shape['periods'] for shape in shapes])
    least = {'cogging': 1.5, 'torque_ripple': 1.0}[name]  # which goes with the load
    assert turns[0] >= least
    assert turns[0] - np.diff(turns)[0] < least


def test_a_lagging_drive_delivers_what_the_motion_needs(case):
    """The command of the model with lag, through a first-order drive, is the needed torque."""
    _, model, state = case
    model, constant, period = without_coulomb(model), 4e-3, 1e-3
    needed = model.torque(state)
    command = model_with(model, 'actuator_lag', time_constant=constant).torque(state)
    delivered = needed.copy()
    decay = np.exp(-period / constant)
    for row in range(1, len(needed)):  # exact for a command that is straight between samples
        slope = (command[row] - command[row - 1]) / period
        delivered[row] = (command[row] - constant * slope + decay * (
            delivered[row - 1] - command[row - 1] + constant * slope))
    without = rms(command - needed)
    assert rms(delivered - needed) < 0.02 * without
    rising = np.gradient(needed, state.t, axis=0) > 10.0
    assert np.all((command - needed)[rising] > 0.0)


@pytest.mark.parametrize('delay', [3.5e-3, -2.5e-3, 1e-3])
def test_time_offset_is_the_torque_of_another_time(case, delay):
    robot, model, _ = case
    model, half = without_coulomb(model), 5e-4
    fine = state_of(robot, model, half)
    rows = np.arange(100, len(fine.t) - 100, 2)
    state = replace(fine, **{key: getattr(fine, key)[rows]
                             for key in ('t', 'q', 'qd', 'qdd', 'x', 'xd', 'xdd')})
    late = model.torque(fine)[rows - round(delay / half)]
    found = model_with(model, 'time_offset', delay=delay).torque(state)
    inner = slice(10, -10)
    change = rms((late - model.torque(state))[inner])
    assert rms((found - late)[inner]) < 0.01 * change
    # the best point of expansion finds the delay again
    effect = CATALOGUE['time_offset']
    state = replace(state, nominal=model.nominal(state))
    target = (late - model.torque(state))[inner].ravel()
    best = (np.inf, None)
    shape = None
    for grid in (effect.shapes(state), None, None, None):
        for tried in grid or effect.refined(shape, 0.5):
            column = effect.columns(state, tried)[inner].reshape(-1, 1)
            coefficient = np.linalg.lstsq(column, target, rcond=None)[0]
            left = rms(target - column @ coefficient)
            if left < best[0]:
                best = left, float(coefficient[0])
                shape = tried
    assert best[1] == pytest.approx(delay, rel=0.01)


def test_time_offset_of_no_delay_is_the_limit_of_small_ones(case):
    robot, model, _ = case
    state = waves(robot)
    state = replace(state, nominal=without_coulomb(model).nominal(state))
    none, small = (CATALOGUE['time_offset'].columns(state, {'expanded_at': delay})[INNER]
                   for delay in (0.0, 1e-6))
    np.testing.assert_allclose(none, small, atol=1e-3 * rms(none))


def test_lag_and_delay_are_exact_in_the_band_of_the_rows(case):
    """Columns of a 40 Hz torque at 1 kHz against calculus: a lag and a delay are almost alike."""
    robot, model, _ = case
    state = waves(robot)
    omega, phase = 2.0 * np.pi * 40.0, np.arange(4)

    def torque(t):
        return np.sin(omega * t[:, None] + phase)

    t = np.arange(1000) * 1e-3
    still = np.zeros((len(t), 4))
    nominal = replace(without_coulomb(model).nominal(state), torque=torque(t), added=0.0)
    state = replace(state, t=t, q=still, qd=still, qdd=still, nominal=nominal)
    inner = slice(20, -20)
    rate = CATALOGUE['actuator_lag'].columns(state, {})[inner, :, 0]
    expected = omega * np.cos(omega * t[:, None] + phase)[inner]
    assert rms(rate - expected) < 3e-4 * rms(expected)
    for delay in (2e-4, -3.5e-4, 2.5e-3):
        column = CATALOGUE['time_offset'].columns(state, {'expanded_at': delay})[inner, :, 0]
        change = (torque(t - delay) - torque(t))[inner]
        assert rms(column * delay - change) < 3e-4 * rms(change)


def test_saturation_delivers_no_more_than_the_limit(case):
    _, model, state = case
    needed = model.torque(state)
    limit = 0.6 * np.abs(needed).max(axis=0)
    found = model_with(model, 'torque_saturation', limit=limit).torque(state)
    beyond = np.abs(needed) > limit
    assert beyond.any(axis=0).all()
    np.testing.assert_allclose(np.abs(found)[beyond],
                               np.broadcast_to(limit, needed.shape)[beyond])
    assert np.all(np.sign(found[beyond]) == np.sign(needed[beyond]))
    np.testing.assert_allclose(found[~beyond], needed[~beyond])


# -------------------------------------------------------------------------------- transmissions


def motor_reading(state, load_shift):
    """Return the state that encoders on the motors record when the loads are `load_shift` behind.

    Derivatives of fourth order in space of samples: not those of the effect.
    """
    def rate(values):
        result = np.zeros_like(values)
        result[2:-2] = (8.0 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])) / (
            12.0 * (state.t[1] - state.t[0]))
        return result

    speed = rate(load_shift)
    return state_of_joints(state.geometry, state.t, state.q + load_shift, state.qd + speed,
                           state.qdd + rate(speed))


def load_side(model, state):
    """Return the torque behind the transmission, half of the actuator's inertia before it."""
    return model.rigid_torque(state) - 0.5 * model.values['actuator_inertia'] * state.qdd


def recorded(model, motor, load):
    """Return the drives' torque when motors and loads move differently."""
    return (0.5 * model.values['actuator_inertia'] * motor.qdd + load_side(model, load)
            + model.values['coulomb_friction'] * np.sign(motor.qd)
            + model.values['viscous_friction'] * motor.qd)


INNER = slice(20, -20)


def waves(robot):
    """Return a motion all derivatives of which are smooth: the torque's curvature counts here."""
    t = np.arange(0.0, 1.0, 1e-3)
    return state_of_platform(robot.geometry, t, *growing_waves(robot, t, 1.0))


def test_elastic_transmission_lets_the_load_fall_behind(case):
    """The load's motion is known first; motors lead it by the torque over the stiffness."""
    assert MOTOR_SHARE == 0.5
    robot, model, _ = case
    load = waves(robot)
    stiffness = np.array((1e5, 2e5, 1.5e5, 1e5))
    errors = []
    for softer in (1.0, 0.25):
        motor = motor_reading(load, load_side(model, load) / (softer * stiffness))
        expected = recorded(model, motor, load) - model.torque(motor)
        found = added(model, motor, 'elastic_transmission', stiffness=softer * stiffness)
        errors.append(rms((found - expected)[INNER]) / rms(expected[INNER]))
    assert errors[0] < 0.02
    assert errors[1] < 5.0 * errors[0]  # of first order: the relative error grows with 1/k


def test_one_elastic_joint_moves_the_torque_of_all(case):
    robot, model, _ = case
    load = waves(robot)
    lead = np.zeros_like(load.q)
    lead[:, 1] = load_side(model, load)[:, 1] / 1e5
    motor = motor_reading(load, lead)
    expected = recorded(model, motor, load) - model.torque(motor)
    found = added(model, motor, 'elastic_transmission', stiffness=(0.0, 1e5, 0.0, 0.0))
    assert rms((found - expected)[INNER]) < 0.02 * rms(expected[INNER])
    assert rms(expected[INNER, 0]) > 0.05 * rms(expected[INNER, 1])


def test_columns_of_a_swinging_transmission_are_its_slopes(case):
    """Beside the compliances that they are exact at, the torque differs in second order only."""
    robot, model, _ = case
    effect, load = CATALOGUE['elastic_transmission'], waves(robot)
    state = replace(load, nominal=model.nominal(load))
    here = np.array((2e-4, 1e-4, 3e-4, 1.5e-4))
    aside = np.array((1e-4, -2e-4, 1e-4, -2e-4))
    aside -= here * (here @ aside) / (here @ here)
    columns = effect.columns(state, effect.expansion(here))
    errors = []
    for share in (0.02, 0.01):
        there = here + share * aside
        torque = effect.torque(state, arrays({'stiffness': tuple(1.0 / there),
                                              'damping_ratio': DAMPING_RATIO,
                                              'motor_share': MOTOR_SHARE}), (0, 1, 2, 3))
        errors.append(rms((columns @ there - torque)[INNER]))
        assert errors[-1] < 0.1 * rms((columns @ (there - here))[INNER])
    assert errors[1] < 0.3 * errors[0]


def test_elastic_axis_is_two_masses_and_a_spring(axis_case):
    """Of the load torque T = J_l q_l'': J_m (q_l + T/k)'' + J_l q_l'' - J (q_l + T/k)''."""
    model, _ = axis_case
    t = np.arange(0.0, 2.0, 5e-4)
    w, stiffness, j_l = 20.0, 5e3, 0.1
    lead = 1.0 - j_l * w ** 2 / stiffness  # q_m / q_l of a sine
    wave = np.sin(w * t)[:, None]
    state = State(t, lead * wave, lead * w * np.cos(w * t)[:, None], -lead * w ** 2 * wave)
    elastic = build_model(AXIS, axis_file(entry('elastic_transmission', {'stiffness': stiffness})))
    found = (elastic.torque(state) - model.torque(state))[10:-10]
    expected = -j_l * w ** 2 * (1.0 - lead) * wave[10:-10]
    np.testing.assert_allclose(found, expected, atol=0.02 * np.abs(expected).max())


@pytest.mark.parametrize('period', [5e-4, 4e-3])
@pytest.mark.parametrize('given', [{}, {'damping_ratio': 0.2}, {'motor_share': 0.8}])
@pytest.mark.parametrize('speed', [0.5, 0.95, 1.5])
def test_a_soft_axis_swings_as_a_damped_oscillator(axis_case, speed, given, period):
    """q_l / q_m = (1 + 2 i d r) / (1 - r^2 + 2 i d r), r the frequency over the resonance.

    The load swings against a resting motor: with a ratio smaller by the root of the motor's share
    than that with which the two swing against each other. Slow samples shift no resonance.
    """
    model, _ = axis_case
    t = np.arange(0.0, 4.0, period)
    share = given.get('motor_share', MOTOR_SHARE)
    stiffness, j_l = 500.0, 0.2 * (1.0 - share)
    r = speed
    w = r * np.sqrt(stiffness / j_l)
    wave = np.exp(1j * w * t)[:, None]
    state = State(t, wave.real, (1j * w * wave).real, (-w ** 2 * wave).real)
    elastic = build_model(AXIS, axis_file(entry('elastic_transmission', {
        'stiffness': stiffness, **given})))
    swung = slice(round(2.0 / period), -10)
    found = (elastic.torque(state) - model.torque(state))[swung]
    ratio = given.get('damping_ratio', DAMPING_RATIO)
    loss = 2j * np.sqrt(share) * ratio * r
    expected = (-j_l * w ** 2 * wave * ((1.0 + loss) / (1.0 - r ** 2 + loss) - 1.0)).real
    expected = expected[swung]
    np.testing.assert_allclose(found, expected, atol=0.03 * np.abs(expected).max())


@pytest.mark.parametrize(('stiffness', 'off'), [(2e4, 0.15), (1e5, 0.05), (1e6, 0.03), (1e9, 0.01)])
def test_no_spring_is_too_stiff_for_slow_samples(case, stiffness, off):
    """Its load follows the motor, although no sample tells its resonance."""
    robot, model, _ = case
    load = waves(robot)
    slow = slice(None, None, 20)
    state = state_of_joints(load.geometry, load.t[slow], load.q[slow], load.qd[slow],
                            load.qdd[slow])
    springs = Springs(replace(state, nominal=model.nominal(state)))
    spring, _ = springs.torque(np.full(4, 1.0 / stiffness))
    rigid, _ = springs.torque(np.zeros(4))
    assert rms(spring - rigid) < off * rms(rigid)


def test_a_stiff_joint_leaves_the_swing_of_a_soft_one_as_it_is(case):
    """Samples that are too slow for the one are not for the other."""
    robot, model, _ = case
    load = waves(robot)
    springs = Springs(replace(load, nominal=model.nominal(load)))
    alone, beside = (springs.torque(np.array((0.0, 4e-4, stiff, 0.0)))[0][:, 1]
                     for stiff in (0.0, 1e-9))
    rigid = springs.torque(np.zeros(4))[0][:, 1]
    assert rms(alone - rigid) > 0.05 * rms(rigid)
    assert rms(alone - beside) < 1e-4 * rms(alone - rigid)


MASSES = {'distributed_rods', 'payload', 'theta_inertia', 'joint_inertia_difference',
          'arm_mass_offset', 'arm_weight_difference'}
BEHIND = {*MASSES, 'external_force', 'platform_drag', 'theta_friction', 'passive_joint_friction'}
ON_THEIR_OWN = [name for name, effect in CATALOGUE.items()
                if not (effect.needs_nominal or effect.of_axis or name == 'cable_spring')]


@pytest.mark.parametrize('name', ON_THEIR_OWN)
def test_springs_carry_what_acts_behind_them(case, name):
    """Masses and forces there twist it as (20) does; drives and friction of their joints do not.
    """
    _, model, state = case

    def twisted(some):
        return added(some, state, 'elastic_transmission', stiffness=8e3, damping_ratio=0.05)

    beside = model_with(model, name, **GUIDES[name].usual)
    more = np.abs(twisted(beside) - twisted(model)).max()
    own = np.abs(beside.torque(state) - model.torque(state)).max()
    # an arm that lies flat weighs the same where its spring lets it go
    carried = (4e-3 if name == 'arm_weight_difference' else 5e-3) * own
    assert (more > carried) == (name in BEHIND)
    assert more > carried or more < 1e-9


@pytest.mark.parametrize(('name', 'values', 'read'), [
    ('encoder_offset', {'offset': (0.02, -0.015, 0.01, 0.025)},
     lambda q: q + np.array((0.02, -0.015, 0.01, 0.025))),
    ('encoder_eccentricity', {'amplitude': 0.012, 'phase': (0.3, 1.0, 2.0, -1.0)},
     lambda q: q + 0.012 * np.sin(q + np.array((0.3, 1.0, 2.0, -1.0))))])
def test_springs_carry_the_load_where_it_is_not_where_it_is_read(case, name, values, read):
    """A zero error of a degree made the springs of a machine 3 % too stiff."""
    _, model, load = case
    springs = partial(added, name='elastic_transmission', stiffness=8e3, damping_ratio=0.05)
    misread = load.moved(read(load.q), load.qd, load.qdd)
    if name == 'encoder_eccentricity':
        t = load.t
        misread = load.moved(read(load.q), np.gradient(read(load.q), t, axis=0),
                             np.gradient(np.gradient(read(load.q), t, axis=0), t, axis=0))
    true = springs(model, load)
    told = springs(model_with(model, name, **values), misread)
    ignored = springs(model, misread)
    middle = slice(200, -200)
    assert rms((told - true)[middle]) < 0.2 * rms((ignored - true)[middle])
    assert rms((told - true)[middle]) < 0.03 * rms(true[middle])


def test_backlash_leaves_the_load_half_a_gap_behind(case):
    """Away from the crossings the load stands on one flank of the gap."""
    _, model, load = case
    gap = np.array(EXAMPLES['backlash']['gap'])
    flank = np.sign(load_side(model, load))
    motor = state_of_joints(load.geometry, load.t, load.q + 0.5 * gap * flank, load.qd, load.qdd)
    expected = recorded(model, motor, load) - model.torque(motor)
    found = added(model, motor, 'backlash', gap=gap)
    turns = np.any(np.diff(flank, axis=0) != 0, axis=1).astype(float)
    near = np.convolve(turns, np.ones(31), mode='same') > 0
    away = np.append(~near, False)
    assert away.sum() > 200
    np.testing.assert_allclose(found[away], expected[away],
                               atol=0.05 * rms(expected[away]))
    assert rms(expected[away]) > 0.005


def test_backlash_moves_the_load_by_the_gap_at_each_reversal(axis_case):
    """The torque twice integrated over time is the load's inertia times its extra way."""
    model, _ = axis_case
    t = np.arange(0.0, 1.0, 1e-3)
    acceleration = np.where(t < 0.5, 10.0, -10.0)[:, None]
    speed = np.concatenate(([[0.0]], np.cumsum(acceleration[:-1], axis=0) * 1e-3))
    position = np.concatenate(([[0.0]], np.cumsum(speed[:-1], axis=0) * 1e-3))
    state = State(t, position, speed, acceleration)
    gap, j_l = 2e-3, 0.1
    slack = build_model(AXIS, axis_file(entry('backlash', {'gap': gap})))
    change = (slack.torque(state) - model.torque(state))[:, 0]
    # the load goes from half a gap behind to half a gap ahead, then rests on that flank
    assert np.sum(np.cumsum(change)) * 1e-6 == pytest.approx(j_l * gap, rel=0.01)
    assert np.abs(change[:450]).max() < 1e-9
    assert np.abs(change[550:]).max() < 1e-9
