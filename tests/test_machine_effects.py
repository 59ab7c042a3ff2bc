"""What the effects of a model do to simulated machines, held against what they do to the model.

The two are written apart. Each effect runs in closed loop on the machine; what is recorded beyond
the torque of (20) must be what the effect says of that motion. The physics of each by itself is in
test_machine_friction.py, test_machine_platform.py and test_machine_signals.py.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from experiments import FIDELITIES, HOME, IDEAL, TABLE, entry, machine_of, model_of, played
from scipy.signal import butter, sosfiltfilt

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_joints
from par4_kinematics.errors import InputError, UnreachableError
from par4_sim.closed_loop.simulation import build_plant, build_simulation
from par4_sim.machines.machine_effects import machine_of_model
from robots import REFERENCE

EXAMPLES = {
    'torque_offset': {'offset': (0.5, -0.4, 0.3, 0.2)},
    'stribeck': {'stribeck_torque': (1.2, 0.8, 0.5, 1.0), 'stribeck_velocity': 0.3},
    'cogging': {'amplitude': (0.5, 0.3, 0.4, 0.6), 'periods': 24, 'phase': (0.0, 1.0, -2.0, 3.0)},
    'distributed_rods': {'rod_mass': 0.08},
    'payload': {'mass': 1.0, 'half': 2},
    'theta_inertia': {'inertia': 4e-3},
    'theta_friction': {'coulomb': 0.4, 'viscous': 0.05},
    'passive_joint_friction': {'coulomb': 0.05, 'viscous': 0.02},
    'base_tilt': {'about_x': 0.02, 'about_y': -0.03},
    'external_force': {'x': 3.0, 'y': -4.0, 'z': 2.0},
    'cable_spring': {'stiffness': (40.0, 0.0, 60.0), 'anchor': (0.3, -0.2, 0.1)},
    'position_torque': {'coefficients': (0.1, 0.4, -0.2), 'range': (-1.0, 1.5)},
    'platform_drag': {'viscous': 2.0, 'quadratic': 1.5},
    'encoder_offset': {'offset': (3e-3, -5e-3, 2e-3, 4e-3)},
    'encoder_eccentricity': {'amplitude': (5e-3, 4e-3, 3e-3, 6e-3),
                             'phase': (0.5, -1.0, 2.0, 0.0)},
    'geometry_error': {'arm_length': 1e-3, 'forearm_length': -2e-3, 'base_radius': 1.5e-3,
                       'platform_radius': -1e-3, 'platform_bar_length': 2e-3},
    'leg_length_error': {'arm_length': (1e-3, 0.0, -2e-3, 5e-4),
                         'forearm_length': (0.0, 1.5e-3, -1e-3, 0.0)},
    'coulomb_asymmetry': {'asymmetry': (0.3, -0.2, 0.1, 0.4)},
    'viscous_asymmetry': {'asymmetry': (0.3, -0.2, 0.1, 0.4)},
    'nonlinear_viscous': {'quadratic': (0.2, 0.1, -0.1, 0.15), 'torque': (0.5, -0.3, 0.4, 0.2),
                          'exponent': 0.5},
    'load_dependent_friction': {'coefficient': (0.1, 0.05, 0.08, 0.02)},
    'friction_drift': {'drop': 0.1, 'viscous_drop': 0.4, 'time_constant': 1.5},
    'presliding': {'distance': 5e-3},
    'joint_friction_difference': {'coulomb': (0.4, -0.3, 0.2, 0.1),
                                  'viscous': (-0.1, 0.2, 0.3, 0.1)},
    'joint_inertia_difference': {'inertia': (0.02, -0.01, 0.015, 0.01)},
    'arm_mass_offset': {'first_moment': (0.05, -0.03, 0.02, 0.04)},
    'arm_weight_difference': {'first_moment': (0.05, -0.03, 0.02, 0.04)},
    'drive_gain_error': {'relative': (0.05, -0.03, 0.04, -0.02)},
    'torque_ripple': {'relative': (0.05, 0.03, 0.04, 0.02), 'periods': 16,
                      'phase': (0.0, 1.0, -2.0, 3.0)},
    'actuator_lag': {'time_constant': 2e-3},
    'time_offset': {'delay': 2e-3},
    'torque_saturation': {'limit': 8.0},
    'elastic_transmission': {'stiffness': (2e4, 1.5e4, 3e4, 2.5e4)},
    'backlash': {'gap': (4e-3, 6e-3, 5e-3, 3e-3)},
    'quantization': {'step': 1e-3},
}
SIZES = {name: {parameter.name for parameter in effect.parameters if parameter.is_size}
         for name, effect in CATALOGUE.items()}
OF_FIRST_ORDER = ('base_tilt',)
APART = ('quantization', 'torque_saturation', 'elastic_transmission', 'backlash')
READABLE = [name for name in EXAMPLES if name not in APART]


def test_every_effect_has_an_example():
    assert set(EXAMPLES) == set(CATALOGUE)


# ------------------------------------------------------------------- machine against model


def moving(told, dilation=6):
    """Return where each joint moves, and theta with it, away from reversals and ends, (n, 4)."""
    theta_rate = np.gradient(told['true_pose'][:, 3], told['t'])
    slow = (np.abs(told['qd']) < 0.05) | (np.abs(theta_rate) < 0.1)[:, None]
    window = np.ones(2 * dilation + 1)
    near = np.stack([np.convolve(column, window, mode='same') > 0.5 for column in slow.T], axis=1)
    near[:200] = near[-20:] = True
    return ~near


def rate(values, period):
    """Return the derivative of values (n, 4) in time, exact for polynomials of degree four."""
    ends = np.pad(values, ((2, 2), (0, 0)), mode='edge')
    return (8.0 * (ends[3:-1] - ends[1:-3]) - (ends[4:] - ends[:-4])) / (12.0 * period)


def recorded(model, known=None, slow=1.0):
    """Return what was told, the state of that motion, the torque beyond (20), where joints move."""
    told = played(build_simulation(IDEAL, model, 'exact'), known or model, slow=slow)
    state = state_of_joints(REFERENCE.geometry, told['t'], told['q'], told['qd'],
                            rate(told['qd'], 1e-3))
    state = replace(state, nominal=model.nominal(state))
    return told, state, told['effort'] - state.nominal.torque, moving(told)


def rms(values, where):
    return float(np.sqrt(np.mean(values[where] ** 2)))


def test_without_effects_nothing_is_left():
    told, _, left, where = recorded(model_of())
    assert where.mean() > 0.4
    assert rms(left, where) < 5e-4 * rms(told['effort'], where)


def assert_alike(found, expected, where, tolerance):
    """Size and sign on every joint, and what is left, over the rms of the effect."""
    size = rms(expected, where)
    for joint in range(4):
        a, b = found[where[:, joint], joint], expected[where[:, joint], joint]
        if np.sqrt(np.mean(b ** 2)) > 0.3 * size:
            assert abs(float(a @ b / (b @ b)) - 1.0) < tolerance
    assert rms(found - expected, where) < tolerance * size


@pytest.mark.parametrize('name', READABLE)
def test_what_is_recorded_beyond_the_model_is_the_torque_of_the_effect(name):
    model = model_of(entry(name, **EXAMPLES[name]))
    _, state, found, where = recorded(model)
    expected = model.effects[0].torque(state)
    assert rms(expected, where) > 0.03
    assert_alike(found, expected, where, 0.05 if name in OF_FIRST_ORDER else 0.01)


OF_SOME_JOINTS = [name for name in READABLE if not CATALOGUE[name].of_machine]
ONLY_ONCE = {'stribeck', 'nonlinear_viscous', 'presliding', 'friction_drift', 'actuator_lag',
             'encoder_eccentricity', 'cable_spring', 'torque_saturation', 'elastic_transmission',
             'backlash', 'quantization'}
"""Two of them with numbers of their own are no third one of these laws."""


@pytest.mark.parametrize('name', OF_SOME_JOINTS)
def test_on_some_joints_it_is_recorded_there_alone_as_in_the_model(name):
    """Numbers that are listed for the other joints count for nothing."""
    model = model_of(entry(name, joints=(1, 2), **EXAMPLES[name]))
    _, state, found, where = recorded(model)
    expected = model.effects[0].torque(state)
    assert rms(expected, where) > 0.02
    assert_alike(found, expected, where, 0.02)
    everywhere = model_of(entry(name, **EXAMPLES[name])).effects[0].torque(state)
    assert rms(everywhere - expected, where) > 0.005


@pytest.mark.parametrize('name', [name for name in READABLE if name not in ONLY_ONCE])
def test_an_effect_that_is_listed_twice_adds_to_itself(name):
    smaller = {key: tuple(0.4 * np.array(value)) if isinstance(value, tuple) else 0.4 * value
               for key, value in EXAMPLES[name].items() if key in SIZES[name]}
    model = model_of(entry(name, **EXAMPLES[name]), entry(name, **{**EXAMPLES[name], **smaller}))
    _, state, found, where = recorded(model)
    expected = sum(active.torque(state) for active in model.effects)
    assert_alike(found, expected, where, 0.05)


@pytest.mark.parametrize('name', sorted(ONLY_ONCE))
def test_an_effect_that_a_joint_has_once_is_refused_a_second_time(name):
    unit = 'rad' if name == 'quantization' else ''
    one = entry(name, unit=unit, **EXAMPLES[name])
    with pytest.raises(InputError, match=f'{name} is listed twice for joints .*make one entry'):
        machine_of(one, one)
    if not CATALOGUE[name].of_machine:
        apart = [entry(name, joints=joints, unit=unit, **EXAMPLES[name])
                 for joints in ((0, 2), (1, 3))]
        assert same(machine_of(*apart), machine_of(one))


@pytest.mark.parametrize(('name', 'size', 'scale'), [('cogging', 'amplitude', 10.0),
                                                     ('torque_ripple', 'relative', 1.0)])
def test_orders_of_the_machine_are_those_of_the_model(name, size, scale):
    """Two orders in one entry, and a third that another entry gives two of the joints."""
    model = model_of(
        entry(name, **{size: (tuple(scale * np.array((0.05, 0.03, 0.04, 0.02))), scale * 0.05)},
              periods=(16.0, 9.0), phase=((0.0, 1.0, -2.0, 3.0), 0.4)),
        entry(name, joints=(1, 2), **{size: scale * 0.06}, periods=5.0, phase=0.2))
    _, state, found, where = recorded(model)
    expected = sum(active.torque(state) for active in model.effects)
    assert rms(expected, where) > 0.03
    assert_alike(found, expected, where, 0.01)


FORCES = {'external_force': {'x': 20.0, 'y': -30.0, 'z': 40.0},
          'cable_spring': {'stiffness': (30.0, 60.0, 40.0), 'anchor': (0.5, 0.4, -0.2)},
          'platform_drag': {'viscous': 15.0, 'quadratic': 8.0},
          'theta_friction': {'coulomb': 0.3, 'viscous': 0.25},
          'passive_joint_friction': {'coulomb': 0.2, 'viscous': 0.05}}


def test_every_force_on_the_platform_has_an_example():
    assert set(FORCES) == {name for name, effect in CATALOGUE.items() if effect.is_force}


@pytest.mark.parametrize('name', FORCES)
def test_forces_but_friction_pull_at_other_poses_with_another_torque(name):
    model = model_of(entry(name, **FORCES[name]))
    _, state, _, _ = recorded(model)
    pull = state.nominal.pull
    if CATALOGUE[name].rubs:
        assert pull is None
    else:
        np.testing.assert_array_equal(pull(state), model.effects[0].torque(state))


@pytest.mark.parametrize('name', FORCES)
def test_joints_carry_forces_on_the_platform_with_friction(name):
    friction = entry('load_dependent_friction', coefficient=(0.08, 0.1, 0.06, 0.09))
    model = model_of(friction, entry(name, **FORCES[name]))
    _, state, found, where = recorded(model)
    of_load, of_force = (active.torque(state) for active in model.effects)
    unloaded = replace(state, nominal=model_of(friction).nominal(state))
    assert rms(of_load - model.effects[0].torque(unloaded), where) > 0.02
    assert_alike(found - of_force, of_load, where, 0.01)


@pytest.mark.parametrize(('name', 'values', 'slow', 'base', 'least'), [
    # elasticity shows where torque changes fast, and is of first order where it is stiff
    ('elastic_transmission', {'stiffness': (6e4, 5e4, 8e4, 7e4)}, 1.0, {}, 0.015),
    # backlash is of first order where the load keeps its side: a heavy plate, slowly
    ('backlash', {'gap': (0.01, 0.02, 0.015, 0.008)}, 3.0, {'platform_mass_1': 3.0}, 0.02),
])
def test_a_load_that_is_not_where_its_motor_is(name, values, slow, base, least):
    """Below the resonances: averaged over 40 ms, without the jumps of Coulomb friction."""
    model = model_of(entry(name, **values), coulomb_friction=0.0, **base)
    _, state, found, where = recorded(model, slow=slow)
    weight = np.hanning(42)[1:-1] / np.sum(np.hanning(42))
    found, expected = (np.stack([np.convolve(column, weight, mode='same') for column in torque.T],
                                axis=1) for torque in (found, model.effects[0].torque(state)))
    assert rms(expected, where) > least
    assert_alike(found, expected, where, 0.1)


@pytest.mark.parametrize(('name', 'values'), [
    ('theta_friction', {'coulomb': 0.12, 'viscous': 0.01}),
    ('passive_joint_friction', {'coulomb': 0.03, 'viscous': 0.002})])
def test_a_load_that_swings_turns_its_own_joints_with_friction(name, values):
    """They turn otherwise than they would with motors that do not twist, and brake the swing."""
    springs = entry('elastic_transmission', stiffness=(4e3, 4.4e3, 3.6e3, 4e3), damping_ratio=0.1)
    model = model_of(springs, entry(name, **values), coulomb_friction=0.0)
    _, state, found, where = recorded(model)
    in_band = butter(4, 40.0, fs=1000.0, output='sos')
    where = np.zeros_like(where)
    where[300:-200] = True

    def left(state):
        expected = sum(active.torque(state) for active in model.effects)
        return rms(sosfiltfilt(in_band, found - expected, axis=0), where)

    swing = sosfiltfilt(in_band, found - model.effects[1].torque(state), axis=0)
    assert left(state) < 0.06 * rms(swing, where)
    blind = replace(state, nominal=replace(state.nominal, slips=lambda _: None))
    assert left(blind) > 8.0 * left(state)


ON_EACH_OTHER = [
    *((name, other) for name in ('drive_gain_error', 'torque_ripple') for other in (
        'payload', 'torque_offset', 'external_force', 'cable_spring', 'friction_drift',
        'actuator_lag')),
    ('base_tilt', 'payload'), ('base_tilt', 'arm_weight_difference'),
    ('encoder_offset', 'external_force'), ('encoder_offset', 'cable_spring'),
    ('encoder_eccentricity', 'cable_spring'), ('geometry_error', 'cable_spring'),
    ('leg_length_error', 'cable_spring'), ('encoder_eccentricity', 'platform_drag'),
    ('presliding', 'coulomb_asymmetry'), ('presliding', 'joint_friction_difference'),
    ('encoder_eccentricity', 'joint_friction_difference'), ('time_offset', 'presliding')]
LARGE = {**EXAMPLES, **FORCES, 'drive_gain_error': {'relative': (0.5, -0.4, 0.3, 0.6)},
         'torque_ripple': {**EXAMPLES['torque_ripple'], 'relative': (0.2, 0.15, 0.18, 0.1)},
         'payload': {'mass': 3.0, 'half': 2}, 'actuator_lag': {'time_constant': 5e-3},
         'torque_offset': {'offset': (2.0, -1.5, 1.0, 2.0)},
         'friction_drift': {'drop': 0.5, 'viscous_drop': 0.6, 'time_constant': 0.5},
         'presliding': {'distance': 0.04},
         'coulomb_asymmetry': {'asymmetry': (1.0, -0.8, 0.6, 0.9)},
         'joint_friction_difference': {'coulomb': (0.8, -0.8, 0.6, 0.5),
                                       'viscous': (1.5, 2.0, 1.0, 3.0)},
         'encoder_eccentricity': {'amplitude': (0.02, 0.015, 0.01, 0.02),
                                  'phase': (0.5, -1.0, 2.0, 0.0)},
         'arm_weight_difference': {'first_moment': (0.6, -0.3, 0.4, 0.5)}}


@pytest.mark.parametrize(('name', 'other'), ON_EACH_OTHER)
def test_what_two_effects_do_together_is_that_of_the_model_with_both(name, other):
    """A wrong gain scales a payload, a tilt lets it pull aside: more than both by themselves."""
    entries = [entry(part, **LARGE[part]) for part in (name, other)]
    model = model_of(*entries)
    _, state, found, where = recorded(model)
    expected = model.torque(state) - state.nominal.torque
    apart = sum(model_of(part).torque(state) - state.nominal.torque for part in entries)
    together = rms(expected - apart, where)
    assert together > 0.02
    assert rms(found - expected, where) < 0.3 * together


def test_friction_grows_with_what_springs_pass_on():
    """That swings, and has no share of the motor's inertia in it."""
    springs = entry('elastic_transmission', stiffness=(4e3, 4.4e3, 3.6e3, 4e3), damping_ratio=0.1)
    model = model_of(springs, entry('load_dependent_friction', coefficient=0.08),
                     coulomb_friction=0.0)
    _, state, found, where = recorded(model)
    in_band = butter(4, 40.0, fs=1000.0, output='sos')

    def left(state):
        expected = sum(active.torque(state) for active in model.effects)
        return rms(sosfiltfilt(in_band, found - expected, axis=0), where)

    friction = rms(model.effects[1].torque(state), where)
    assert left(state) < 0.04 * friction
    rigid = replace(state.nominal, passed=lambda state: state.known.load)
    assert left(replace(state, nominal=rigid)) > 0.15 * friction


def test_a_saturated_machine_gets_no_more_than_its_limit():
    """The motion that it then makes needs the limit; what is recorded is more."""
    model = model_of(entry('torque_saturation', limit=8.0))
    told, state, found, where = recorded(model, model_of())
    cut = where & (np.abs(told['effort']) > 8.5)
    assert cut.sum() > 100
    needed = state.nominal.torque
    assert rms(needed - told['true_torque'], where) < 0.01 * rms(needed, where)
    assert np.mean(np.abs(needed[where]) > 8.1) < 5e-3  # rows beside a jump
    np.testing.assert_array_less(0.0, (found * np.sign(needed))[cut])
    reading = model.effects[0].torque(state)
    assert rms(reading, where) < 0.01 * rms(found, cut)


# ------------------------------------------------------------------- from a file to a run


def text_of(name: str) -> str:
    """Return the model.yaml of TABLE 1 with an effect, as a user writes it."""
    unit = ', unit: rad' if name == 'quantization' else ''
    parameters = '\n'.join(
        f'      {key}: {{value: {list(value) if isinstance(value, tuple) else value}{unit}}}'
        for key, value in EXAMPLES[name].items())
    base = '\n'.join(f'  {key}: {{value: {value}}}' for key, value in TABLE.items())
    return (f'schema: par4/model/1\nrigid_body: full\nparameters:\n{base}\n'
            f'effects:\n  - effect: {name}\n    parameters:\n{parameters}\n')


def same(one, other) -> bool:
    """Return whether two machines, or parts of them, are alike."""
    if is_dataclass(one):
        return all(same(getattr(one, field.name), getattr(other, field.name))
                   for field in fields(one))
    return np.array_equal(one, other) if isinstance(one, np.ndarray) else one == other


@pytest.mark.parametrize('name', EXAMPLES)
def test_a_model_file_switches_the_effect_on_in_every_plant(name, tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_text(text_of(name), encoding='utf-8')
    model = read_model(path, REFERENCE)
    plain = model.without_effects()
    assert not same(machine_of_model(REFERENCE, model), machine_of_model(REFERENCE, plain))
    assert same(machine_of_model(REFERENCE, plain), machine_of_model(REFERENCE, plain))
    for fidelity in FIDELITIES:
        simulation = build_simulation(REFERENCE, model, fidelity)
        home, t = simulation.q, np.array((0.003, 1.003))
        simulation.queue_reference(t, np.stack((home, home + 0.3)), np.full((2, 4), 0.3),
                                   np.zeros((2, 4)))
        for _ in range(20):
            sample = simulation.next_sample()
        simulation.close()
        for value in (sample.q, sample.qd, sample.effort, sample.true_torque, sample.true_pose):
            assert np.isfinite(value).all()
        assert (sample.q > home + 1e-4).all()
        np.testing.assert_allclose(sample.true_pose, HOME, atol=0.02)


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_all_effects_at_once(fidelity):
    entries = [entry(name, unit='rad' if name == 'quantization' else '', **values)
               for name, values in EXAMPLES.items()]
    simulation = build_simulation(REFERENCE, model_of(*entries), fidelity)
    for _ in range(20):
        sample = simulation.next_sample()
    simulation.close()
    np.testing.assert_allclose(sample.true_pose, HOME, atol=0.05)


# --------------------------------------------------------------------- impossible machines


@pytest.mark.parametrize(('name', 'values', 'message'), [
    ('coulomb_asymmetry', {'asymmetry': (0.0, 3.0, 0.0, 0.0)}, 'Coulomb friction back: -0.57'),
    ('coulomb_asymmetry', {'asymmetry': -3.0}, 'Coulomb friction forward: -0.57'),
    ('viscous_asymmetry', {'asymmetry': 2.5}, 'viscous friction back: -0.46'),
    ('joint_friction_difference', {'coulomb': -2.5}, 'Coulomb friction forward: -0.07'),
    ('joint_friction_difference', {'viscous': -2.5}, 'viscous friction forward: -0.46'),
    ('load_dependent_friction', {'coefficient': -0.1}, 'friction of load: -0.1'),
    ('load_dependent_friction', {'coefficient': 1.5}, 'at most 0.9'),
    ('presliding', {'distance': -1e-3}, 'presliding, distance: .* -0.001'),
    ('friction_drift', {'drop': 1.2, 'time_constant': 1.0}, 'share of friction lost'),
    ('friction_drift', {'drop': 0.2, 'viscous_drop': 1.2, 'time_constant': 1.0},
     'share of friction lost'),
    ('friction_drift', {'drop': 0.2, 'time_constant': 0.0},
     'friction_drift, time_constant: .* found 0'),
    ('drive_gain_error', {'relative': -1.5}, 'drive gain'),
    ('torque_ripple', {'relative': 1.2, 'periods': 8, 'phase': 0.0}, 'torque ripple'),
    ('torque_ripple', {'relative': (0.5, 0.6), 'periods': (8, 9), 'phase': 0.0}, 'torque ripple'),
    ('actuator_lag', {'time_constant': -1e-3}, 'time constant of the actuators'),
    ('torque_saturation', {'limit': -5.0}, 'torque_saturation, limit: .* found -5'),
    ('elastic_transmission', {'stiffness': -1e4}, 'stiffness'),
    ('backlash', {'gap': -1e-3}, 'gap'),
    ('joint_inertia_difference', {'inertia': (0.0, 0.0, -0.2, 0.0)},
     'actuator inertia, kg m2: -0.087'),
    ('payload', {'mass': -1.0, 'half': 1}, 'half plate 1, kg: -0.1957'),
    ('payload', {'mass': -1.0, 'half': 2}, 'half plate 2, kg: -0.1406'),
    ('payload', {'mass': 1.0, 'half': 3}, 'expected 1 .* or 2'),
    ('distributed_rods', {'rod_mass': -0.01}, 'rod mass'),
    ('theta_inertia', {'inertia': -1e-3}, 'theta inertia'),
    ('theta_friction', {'viscous': -0.1}, 'viscous friction of theta'),
    ('theta_friction', {'coulomb': -0.1}, 'Coulomb friction of theta'),
    ('passive_joint_friction', {'coulomb': -0.1}, 'Coulomb friction of theta or pivots'),
    ('geometry_error', {'base_radius': 1.5}, 'geometry_error: .*cannot close'),
    ('geometry_error', {'arm_length': -0.5}, 'geometry_error: arm_length: .* more than 0'),
    ('leg_length_error', {'arm_length': (-0.5, 0.0, 0.0, 0.0)}, 'leg_length_error: .*at most 0.1'),
    ('platform_drag', {'viscous': -1.0}, 'drag'),
    ('cable_spring', {'stiffness': -40.0, 'anchor': (0.0, 0.0, 0.0)}, 'stiffness of the cable'),
    ('cable_spring', {'stiffness': (4.0, -4.0, 40.0), 'anchor': (0.0, 0.0, 0.0)},
     'stiffness of the cable'),
    ('stribeck', {'stribeck_torque': 1.0, 'stribeck_velocity': 0.0},
     'stribeck, stribeck_velocity: .* found 0'),
    ('stribeck', {'stribeck_torque': -3.0, 'stribeck_velocity': 0.1}, 'friction at rest: -0.57'),
    ('nonlinear_viscous', {'torque': 0.3, 'exponent': -0.5}, 'exponent'),
    ('quantization', {'step': -1e-3}, 'quantization, step: .* found -0.001'),
])
def test_a_size_that_no_machine_can_have_is_refused(name, values, message):
    unit = 'rad' if name == 'quantization' else ''
    with pytest.raises(InputError, match=message) as caught:
        machine_of(entry(name, unit=unit, **values))
    assert '\n' not in str(caught.value)


def test_dimensions_that_do_not_reach_home_are_refused():
    machine = machine_of(entry('geometry_error', forearm_length=-0.5))
    for fidelity in FIDELITIES:
        plant = build_plant(machine, fidelity)
        with pytest.raises(UnreachableError, match='leg'):
            plant.reset(HOME)
        plant.close()
