"""Effects of the library in the friction of the joints."""

from __future__ import annotations

import numpy as np

from hidden.hider import (
    JOINTS,
    Column,
    Hider,
    Values,
    all_joints,
    field_hider,
    on,
    part,
    signs,
)
from hidden.machines import Known
from par4_kinematics.geometry import LEGS
from par4_sim.machines.machine import Machine


def coulomb(known: Known) -> np.ndarray:
    """Return f_c (4,), N m."""
    return known.model.values['coulomb_friction']


def viscous(known: Known) -> np.ndarray:
    """Return f_v (4,), N m s/rad."""
    return known.model.values['viscous_friction']


STRIBECK = field_hider(
    'stribeck', 'friction',
    {'stribeck_torque': 'stribeck_torque', 'stribeck_velocity': 'stribeck_velocity'},
    lambda random, known, joints: {
        'stribeck_torque': on(joints, random.uniform(0.2, 0.6, len(joints))
                              * coulomb(known)[joints]),
        'stribeck_velocity': np.full(LEGS, np.exp(random.uniform(np.log(0.02), np.log(0.3))))},
    [all_joints({'stribeck_torque': 0.5, 'stribeck_velocity': np.full(LEGS, speed)},
                ('stribeck_torque',), 0.0)
     for speed in (0.02, 0.035, 0.06, 0.1, 0.17, 0.3, 0.5)],
    ('stribeck_torque',), own_joints=True)

COULOMB_ASYMMETRY = field_hider(
    'coulomb_asymmetry', 'friction', {'asymmetry': 'coulomb_asymmetry'},
    lambda random, known, joints: {'asymmetry': on(
        joints, signs(random, joints) * random.uniform(0.05, 0.2, len(joints))
        * coulomb(known)[joints])},
    [all_joints({'asymmetry': 0.3}, ('asymmetry',))], ('asymmetry',), own_joints=True)

VISCOUS_ASYMMETRY = field_hider(
    'viscous_asymmetry', 'friction', {'asymmetry': 'viscous_asymmetry'},
    lambda random, known, joints: {'asymmetry': on(
        joints, signs(random, joints) * random.uniform(0.05, 0.2, len(joints))
        * viscous(known)[joints])},
    [all_joints({'asymmetry': 0.2}, ('asymmetry',))], ('asymmetry',), own_joints=True)


def _nonlinear_viscous(random, known, joints):
    share = random.uniform(0.1, 0.3, len(joints)) * viscous(known)[joints]
    if random.uniform() < 0.5:
        # that share of the viscous torque at 2 rad/s
        return {'quadratic': on(joints, share / 2.0)}
    exponent = random.choice((0.35, 0.5, 1.5, 2.5))
    return {'torque': on(joints, share * 2.0 ** (1.0 - exponent)),
            'exponent': np.full(LEGS, exponent)}


NONLINEAR_VISCOUS = field_hider(
    'nonlinear_viscous', 'friction',
    {'quadratic': 'quadratic', 'torque': 'power_torque', 'exponent': 'power_exponent'},
    _nonlinear_viscous,
    [all_joints({'quadratic': 0.2}, ('quadratic',))]
    + [all_joints({'torque': 0.3, 'exponent': np.full(LEGS, exponent)}, ('torque',))
       for exponent in (0.25, 0.35, 0.5, 0.7, 1.4, 1.7, 2.4, 2.8)],
    ('quadratic', 'torque'), own_joints=True)

LOAD_DEPENDENT_FRICTION = field_hider(
    'load_dependent_friction', 'friction', {'coefficient': 'load_coefficient'},
    lambda random, _known, joints: {'coefficient': on(
        joints, random.uniform(0.01, 0.1, len(joints)))},
    [all_joints({'coefficient': 0.03}, ('coefficient',), 0.0)], ('coefficient',), own_joints=True)

def _draw_warming(random, _known, _joints):
    """A warm lubricant is thinner; the friction between surfaces falls less or not at all."""
    viscous = random.uniform(0.1, 0.4)
    return {'drop': random.uniform(0.0, 1.0) * viscous, 'viscous_drop': viscous,
            'time_constant': random.uniform(2.0, 20.0)}


FRICTION_DRIFT = field_hider(
    'friction_drift', 'friction',
    {'drop': 'dry_drop', 'viscous_drop': 'flowing_drop', 'time_constant': 'warming_time'},
    _draw_warming,
    [[({size: 0.2, 'time_constant': constant}, 0.0, 5.0) for size in ('drop', 'viscous_drop')]
     for constant in (0.8, 1.5, 3.0, 6.0, 12.0, 25.0, 50.0)],
    ('drop', 'viscous_drop'), per_joint=False)

PRESLIDING = field_hider(
    'presliding', 'friction', {'distance': 'presliding_distance'},
    lambda random, _known, _joints: {
        'distance': 1e-3 * np.exp(random.uniform(np.log(0.5), np.log(10.0)))},
    [[({'distance': 1e-3 * distance}, 0.9, 1.1)]
     for distance in (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0)],
    ('distance',), per_joint=False)


def _friction_difference(machine: Machine, values: Values) -> Machine:
    friction = machine.friction
    return part(machine, 'friction', coulomb=friction.coulomb + values.get('coulomb', 0.0),
                viscous=friction.viscous + values.get('viscous', 0.0))


def _draw_friction_difference(random, known, joints):
    joints = joints[:3]  # the same on all joints is the base model's
    share = signs(random, joints) * random.uniform(0.02, 0.2, len(joints))
    other = signs(random, joints) * random.uniform(0.02, 0.2, len(joints))
    return {'coulomb': on(joints, share * coulomb(known)[joints]),
            'viscous': on(joints, other * viscous(known)[joints])}


JOINT_FRICTION_DIFFERENCE = Hider(
    'joint_friction_difference', _friction_difference, _draw_friction_difference,
    ('coulomb', 'viscous'),
    lambda _scene: [[Column({key: on(JOINTS, 0.2)})
                     for key in ('coulomb', 'viscous')]],
    own_joints=True)
