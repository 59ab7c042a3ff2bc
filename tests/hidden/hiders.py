"""What may be hidden: each effect of the library as parts of a machine, see `hider`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hidden.friction_hiders import (
    COULOMB_ASYMMETRY,
    FRICTION_DRIFT,
    JOINT_FRICTION_DIFFERENCE,
    LOAD_DEPENDENT_FRICTION,
    NONLINEAR_VISCOUS,
    PRESLIDING,
    STRIBECK,
    VISCOUS_ASYMMETRY,
)
from hidden.hider import (
    JOINTS,
    Column,
    Family,
    Hider,
    Scene,
    Values,
    all_joints,
    each_joint,
    field_hider,
    on,
    part,
    signs,
)
from par4_kinematics.geometry import LEGS
from par4_sim.machines.machine import Harmonic, Machine

RATED = 20.0
"""N m: motors of this size; their cogging and ripple are shares of it."""
DIMENSIONS = ('arm_length', 'forearm_length', 'base_radius', 'platform_radius',
              'platform_bar_length')


# --- drives, transmissions, record ------------------------------------------------------------

DRIVE_GAIN_ERROR = field_hider(
    'drive_gain_error', 'amplifier', {'relative': 'gain_error'},
    lambda random, _known, joints: {'relative': on(
        joints[:3], signs(random, joints[:3]) * random.uniform(0.01, 0.05, len(joints[:3])))},
    [all_joints({'relative': 0.02}, ('relative',))], ('relative',), own_joints=True)


def _with_harmonics(machine: Machine, values: Values) -> Machine:
    added = tuple(Harmonic(joint, float(values['amplitude'][joint]), float(values['periods']),
                           float(values['phase'][joint]))
                  for joint in JOINTS if values['amplitude'][joint])
    return replace(machine, harmonics=(*machine.harmonics, *added))


def _waves(unit: Callable[[float, float], Values], scene: Scene) -> Family:
    """Return waves of periods that a smooth effect could look like, and of those hidden."""
    lowest = max(6, math.ceil(2.0 * math.pi / scene.reach))
    return [[Column(unit(float(periods), phase)) for phase in (0.0, 0.5 * math.pi)]
            for periods in (*range(lowest, lowest + 24, 3), *scene.periods)]


def _drawn_periods(random: np.random.Generator) -> float:
    return float(random.integers(12, 81))


COGGING = Hider(
    'cogging', _with_harmonics,
    lambda random, _known, joints: {
        'amplitude': on(joints, random.uniform(0.005, 0.03, len(joints)) * RATED),
        'periods': _drawn_periods(random), 'phase': random.uniform(-3.1, 3.1, LEGS)},
    ('amplitude',),
    lambda scene: _waves(lambda periods, phase: {
        'amplitude': on(JOINTS, 0.2), 'periods': periods, 'phase': np.full(LEGS, phase)}, scene),
    own_joints=True)


def _rippled(machine: Machine, values: Values) -> Machine:
    return part(machine, 'amplifier', ripple=values['relative'],
                ripple_periods=np.full(LEGS, values['periods']), ripple_phase=values['phase'])


TORQUE_RIPPLE = Hider(
    'torque_ripple', _rippled,
    lambda random, _known, joints: {
        'relative': on(joints, random.uniform(0.01, 0.03, len(joints))),
        'periods': _drawn_periods(random), 'phase': random.uniform(-3.1, 3.1, LEGS)},
    ('relative',),
    lambda scene: _waves(lambda periods, phase: {
        'relative': on(JOINTS, 0.02), 'periods': periods, 'phase': np.full(LEGS, phase)}, scene),
    own_joints=True)

ACTUATOR_LAG = field_hider(
    'actuator_lag', 'amplifier', {'time_constant': 'time_constant'},
    lambda random, _known, _joints: {'time_constant': random.uniform(2e-4, 5e-3)},
    [[({'time_constant': 1e-3}, 0.0, 10.0)]], ('time_constant',), per_joint=False)

TIME_OFFSET = field_hider(
    'time_offset', 'sensors', {'delay': 'torque_delay'},
    lambda random, _known, _joints: {
        'delay': random.choice((-1.0, 1.0)) * random.uniform(5e-4, 5e-3)},
    # between these the torque of a delay is nearly linear in it
    [[({'delay': 1e-3 * delay}, 0.75, 1.3)]
     for size in (0.2, 0.35, 0.6, 1.0, 1.7, 2.9, 4.9) for delay in (-size, size)],
    ('delay',), per_joint=False)

BACKLASH = field_hider(
    'backlash', 'transmission', {'gap': 'gap'},
    lambda random, _known, joints: {'gap': on(
        joints, random.uniform(1e-3, 5e-3, len(joints)))},
    [each_joint({'gap': 1e-3}, ('gap',), 0.0, 10.0)], ('gap',))


def _elastic(machine: Machine, values: Values) -> Machine:
    compliance = values['compliance']
    # a rigid joint in this machine stays rigid
    with np.errstate(divide='ignore'):
        stiffness = np.where(compliance > 0.0, 1.0 / compliance, machine.transmission.stiffness)
    return part(machine, 'transmission', stiffness=stiffness,
                **{name: values.get(name, getattr(machine.transmission, name))
                   for name in ('damping_ratio', 'motor_share')})


ELASTIC_TRANSMISSION = Hider(
    'elastic_transmission', _elastic,
    lambda random, _known, joints: {
        'compliance': on(
            joints, np.exp(-random.uniform(np.log(1e3), np.log(1e5), len(joints)))),
        'damping_ratio': float(np.exp(random.uniform(np.log(0.01), np.log(0.1)))),
        'motor_share': float(random.uniform(0.3, 0.85))},
    ('compliance',),
    lambda _scene: [[
        Column({'compliance': on([joint], 1e-4)}, 0.0, 20.0) for joint in JOINTS]])


# --- loads of the joints ----------------------------------------------------------------------

def _offset(machine: Machine, values: Values) -> Machine:
    added = tuple(Harmonic(joint, float(level), 0.0, 0.5 * math.pi)
                  for joint, level in enumerate(values['offset']) if level)
    return replace(machine, harmonics=(*machine.harmonics, *added))


TORQUE_OFFSET = Hider(
    'torque_offset', _offset,
    lambda random, _known, joints: {'offset': on(
        joints, signs(random, joints) * random.uniform(0.1, 1.0, len(joints)))},
    ('offset',),
    lambda _scene: [[Column({'offset': on(JOINTS, 0.3)})]], own_joints=True)


def _arm_hider(name: str, torque: float, phase: float) -> Hider:
    """Return a hider of weights on arms: that of 1 kg m has torque sin(q + phase), N m."""
    def weighed(machine: Machine, values: Values) -> Machine:
        added = tuple(Harmonic(joint, torque * float(moment), 1.0, phase)
                      for joint, moment in enumerate(values['first_moment']) if moment)
        return replace(machine, harmonics=(*machine.harmonics, *added))

    return Hider(
        name, weighed,
        lambda random, _known, joints: {'first_moment': on(
            joints, signs(random, joints) * random.uniform(0.05, 0.5, len(joints)) / 9.81)},
        ('first_moment',),
        lambda _scene: [[Column({'first_moment': on(JOINTS, 0.03)})]], own_joints=True)


# off the line to the elbow a weight is highest at q = 90 degrees; on it, it pulls down most where
# the arm lies flat
ARM_MASS_OFFSET = _arm_hider('arm_mass_offset', 9.81, 0.0)
ARM_WEIGHT_DIFFERENCE = _arm_hider('arm_weight_difference', -9.81, 0.5 * math.pi)


# --- bodies, gravity, geometry, platform ------------------------------------------------------

def _heavier(machine: Machine, values: Values) -> Machine:
    bodies = machine.bodies
    return part(machine, 'bodies', **{key: getattr(bodies, key) + value
                                      for key, value in values.items()})


DISTRIBUTED_RODS = Hider(
    'distributed_rods', _heavier,
    lambda random, _known, _joints: {'rod_mass': random.uniform(0.02, 0.08)},
    ('rod_mass',),
    lambda _scene: [[Column({'rod_mass': 0.04}, 0.0)]],
    per_joint=False)

THETA_INERTIA = Hider(
    'theta_inertia', _heavier,
    lambda random, _known, _joints: {'theta_inertia': np.exp(
        random.uniform(np.log(1e-4), np.log(5e-3)))},
    ('theta_inertia',),
    lambda _scene: [[Column({'theta_inertia': 1e-3}, 0.0)]],
    per_joint=False)

JOINT_INERTIA_DIFFERENCE = Hider(
    'joint_inertia_difference', _heavier,
    lambda random, known, joints: {'actuator_inertia': on(
        joints[:3], signs(random, joints[:3]) * random.uniform(0.02, 0.1, len(joints[:3]))
        * known.model.values['actuator_inertia'][joints[:3]])},
    ('actuator_inertia',),
    lambda _scene: [[Column({'actuator_inertia': on(JOINTS, 0.005)})]], own_joints=True)


def _tilted(machine: Machine, values: Values) -> Machine:
    """Turn the base about a level axis; seen from it gravity turns the other way (Rodrigues)."""
    axis = np.array((values['about_x'], values['about_y'], 0.0))
    angle = float(np.linalg.norm(axis))
    axis = axis / angle
    down = machine.gravity
    turned = (down * math.cos(angle) - np.cross(axis, down) * math.sin(angle)
              + axis * (axis @ down) * (1.0 - math.cos(angle)))
    return replace(machine, gravity=turned)


def _draw_tilt(random, _known, _joints):
    size, heading = math.radians(random.uniform(0.2, 3.0)), random.uniform(-math.pi, math.pi)
    return {'about_x': size * math.cos(heading), 'about_y': size * math.sin(heading)}


BASE_TILT = Hider(
    'base_tilt', _tilted, _draw_tilt, ('about_x', 'about_y'),
    lambda _scene: [[Column({'about_x': 0.02, 'about_y': 0.0}),
                                     Column({'about_x': 0.0, 'about_y': 0.02})]], per_joint=False)


def _pulled(machine: Machine, values: Values) -> Machine:
    force = np.array([values[axis] for axis in 'xyz'])
    return part(machine, 'platform', force=machine.platform.force + force)


def _draw_force(random, _known, _joints):
    way = random.standard_normal(3)
    return dict(zip('xyz', random.uniform(1.0, 5.0) * way / np.linalg.norm(way)))


EXTERNAL_FORCE = Hider(
    'external_force', _pulled, _draw_force, ('x', 'y', 'z'),
    lambda _scene: [[Column(dict(zip('xyz', 2.0 * row)))
                                     for row in np.eye(3)]], per_joint=False)


def _roped(machine: Machine, values: Values) -> Machine:
    return part(machine, 'platform', spring=values['stiffness'], anchor=values['anchor'])


def _draw_rope(random, _known, _joints):
    """A hose that hangs pulls along one direction, one that bends with a stiffness in each."""
    away = random.uniform(-0.5, 0.5, 3) + (0.0, 0.0, 0.2)
    stiffness = random.uniform(5.0, 50.0, 3)
    if random.uniform() < 0.3:
        stiffness *= np.eye(3)[random.integers(3)]
    return {'stiffness': stiffness, 'anchor': np.where(stiffness > 0.0, away, 0.0)}


def _rope_family(_scene):
    """Two springs on each axis, to either side: together, one to any anchor between."""
    return [[Column({'stiffness': 5.0 * axis, 'anchor': side * axis}, 0.0)
             for axis in np.eye(3) for side in (-1.5, 1.5)]]


CABLE_SPRING = Hider('cable_spring', _roped, _draw_rope, ('stiffness',), _rope_family,
                     per_joint=False)

THETA_FRICTION = field_hider(
    'theta_friction', 'platform', {'coulomb': 'theta_coulomb', 'viscous': 'theta_viscous'},
    lambda random, _known, _joints: {'coulomb': random.uniform(0.1, 0.5),
                                   'viscous': random.uniform(0.0, 0.1)},
    [[({'coulomb': 0.2}, 0.0, 5.0), ({'viscous': 0.05}, 0.0, 5.0)]],
    ('coulomb', 'viscous'), per_joint=False)

PASSIVE_JOINT_FRICTION = field_hider(
    'passive_joint_friction', 'platform', {'coulomb': 'pivot_coulomb', 'viscous': 'pivot_viscous'},
    lambda random, _known, _joints: {'coulomb': random.uniform(0.01, 0.1),
                                   'viscous': random.uniform(0.0, 0.02)},
    [[({'coulomb': 0.03}, 0.0, 5.0), ({'viscous': 0.01}, 0.0, 5.0)]],
    ('coulomb', 'viscous'), per_joint=False)


def _draw_drag(random, _known, _joints):
    if random.uniform() < 0.5:
        return {'viscous': random.uniform(0.1, 1.0)}
    return {'quadratic': random.uniform(0.1, 1.0)}


PLATFORM_DRAG = field_hider(
    'platform_drag', 'platform', {'viscous': 'viscous_drag', 'quadratic': 'quadratic_drag'},
    _draw_drag, [[({'viscous': 0.5}, 0.0, 10.0), ({'quadratic': 0.5}, 0.0, 10.0)]],
    ('viscous', 'quadratic'), per_joint=False)

ENCODER_OFFSET = field_hider(
    'encoder_offset', 'sensors', {'offset': 'encoder_offset'},
    lambda random, _known, joints: {'offset': on(
        joints, signs(random, joints) * np.radians(random.uniform(0.05, 0.5, len(joints))))},
    [each_joint({'offset': 2e-3}, ('offset',), -10.0, 10.0)], ('offset',))


def _eccentric(machine: Machine, values: Values) -> Machine:
    return part(machine, 'sensors', eccentricity=values['amplitude'],
                eccentricity_phase=values['phase'])


ENCODER_ECCENTRICITY = Hider(
    'encoder_eccentricity', _eccentric,
    lambda random, _known, joints: {
        'amplitude': on(joints, np.radians(np.exp(
            random.uniform(np.log(0.01), np.log(0.1), len(joints))))),
        'phase': random.uniform(-3.1, 3.1, LEGS)},
    ('amplitude',),
    lambda _scene: [[
        Column({'amplitude': on([joint], 1e-3), 'phase': np.full(LEGS, phase)}, -10.0, 10.0)
        for phase in (0.0, 0.5 * math.pi) for joint in JOINTS]])


def _resized(machine: Machine, values: Values) -> Machine:
    old = machine.geometry.model_dump()
    new = {key: old[key] + value for key, value in values.items()}
    # validated anew: a copy would keep what is cached of the nominal dimensions
    return replace(machine, geometry=type(machine.geometry).model_validate({**old, **new}))


def _draw_geometry(random, _known, _joints):
    names = random.choice(DIMENSIONS, size=random.integers(1, 4), replace=False)
    return {str(name): random.choice((-1.0, 1.0)) * random.uniform(2e-4, 2e-3) for name in names}


GEOMETRY_ERROR = Hider(
    'geometry_error', _resized, _draw_geometry, DIMENSIONS,
    lambda _scene: [[Column({name: 1e-3}, -10.0, 10.0)
                                     for name in DIMENSIONS]], per_joint=False)


def _uneven(machine: Machine, values: Values) -> Machine:
    old = machine.geometry.model_dump()
    new = {f'{key}_errors': tuple(np.add(old[f'{key}_errors'], value).tolist())
           for key, value in values.items()}
    return replace(machine, geometry=type(machine.geometry).model_validate({**old, **new}))


def _draw_legs(random, _known, joints):
    """Return errors of the arm or of the forearm of each leg."""
    longer = random.integers(0, 2, len(joints))
    size = signs(random, joints) * np.exp(random.uniform(
        np.log(2e-4), np.log(2e-3), len(joints)))
    return {'arm_length': on(joints, np.where(longer, size, 0.0)),
            'forearm_length': on(joints, np.where(longer, 0.0, size))}


LEG_LENGTH_ERROR = Hider(
    'leg_length_error', _uneven, _draw_legs, ('arm_length', 'forearm_length'),
    lambda _scene: [[Column({name: on([joint], 1e-3)}, -10.0, 10.0)
                     for name in ('arm_length', 'forearm_length') for joint in JOINTS]])


HIDERS: dict[str, Hider] = {hider.name: hider for hider in (
    STRIBECK, COULOMB_ASYMMETRY, VISCOUS_ASYMMETRY, NONLINEAR_VISCOUS, LOAD_DEPENDENT_FRICTION,
    FRICTION_DRIFT, PRESLIDING, JOINT_FRICTION_DIFFERENCE, DRIVE_GAIN_ERROR, COGGING,
    TORQUE_RIPPLE, ACTUATOR_LAG, TIME_OFFSET, BACKLASH, ELASTIC_TRANSMISSION, TORQUE_OFFSET,
    ARM_MASS_OFFSET, DISTRIBUTED_RODS, THETA_INERTIA, THETA_FRICTION, PASSIVE_JOINT_FRICTION,
    JOINT_INERTIA_DIFFERENCE, BASE_TILT, EXTERNAL_FORCE, CABLE_SPRING, PLATFORM_DRAG,
    ENCODER_OFFSET, ENCODER_ECCENTRICITY, GEOMETRY_ERROR,
    LEG_LENGTH_ERROR, ARM_WEIGHT_DIFFERENCE,
)}
"""All of the catalogue but `NOT_HIDDEN`. Studies draw them by their place: a new one goes last."""
NOT_HIDDEN = {
    'payload',  # in one run it is part of the masses of the plates, so that it takes two to tell it
    'position_torque',  # of single axes, which tests/axes.py has; what hides these is a Par4
    'torque_saturation', 'quantization',  # add no torque to a motion; no diagnosis names them
}
"""Effects of the catalogue without a hider."""
