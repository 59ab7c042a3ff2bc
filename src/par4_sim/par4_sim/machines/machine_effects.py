"""What the effects of a model do to the simulated machine.

Written from the physics of each effect, apart from the regressors of `par4_dynamics.effects`:
tests hold one against the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from par4_dynamics.effects.position_torque import polynomials
from par4_dynamics.model import ActiveEffect, Model
from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import GRAVITY
from par4_kinematics.errors import InputError
from par4_kinematics.files import parse
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.robot import Robot
from par4_sim.machines.friction import Friction
from par4_sim.machines.machine import Harmonic, Machine


def machine_of_model(robot: Robot, model: Model) -> Machine:
    """Return the machine that `model` describes, its effects included.

    Raises:
        InputError: an effect of a size that no machine can have.
    """
    machine = Machine(
        robot.geometry, model.lumped_bodies(),
        Friction(model.values['coulomb_friction'], model.values['viscous_friction']))
    for number, active in enumerate(model.effects):
        _refuse_a_second(active, model.effects[:number])
        machine = _with_effect(machine, active)
    _refuse_the_impossible(machine)
    return machine


def read_true_model(name_or_path: str | Path, robot: Robot) -> Model:
    """Return the model of a `model.yaml` or built-in name that a simulated machine can have.

    Raises:
        InputError: see `read_model` and `machine_of_model`; it names the file.
    """
    model = read_model(name_or_path, robot)
    try:
        machine_of_model(robot, model)
    except InputError as error:
        raise InputError(f'{name_or_path}: {error}') from None
    return model


ONCE = ('stribeck', 'nonlinear_viscous', 'friction_drift', 'presliding', 'actuator_lag',
        'torque_saturation', 'elastic_transmission', 'backlash', 'encoder_eccentricity',
        'cable_spring', 'quantization')
"""Effects that a simulated joint, or machine, has once. All others add to themselves."""


def _refuse_a_second(active: ActiveEffect, before: Sequence[ActiveEffect]) -> None:
    """Raise an InputError where a joint has an effect again that it can have only once."""
    name = active.effect.name
    for other in before:
        again = sorted(set(active.joints) & set(other.joints))
        if name in ONCE and other.effect.name == name and other.units == active.units and again:
            raise InputError(f'effect {name} is listed twice for joints {again}: a simulated '
                             f'machine has it once; make one entry of the two')


def _refuse_the_impossible(machine: Machine) -> None:
    """Raise an InputError that names what no machine can have."""
    friction, amplifier, bodies = machine.friction, machine.amplifier, machine.bodies
    platform, sensors = machine.platform, machine.sensors
    for what, values, lowest, highest in (
            ('Coulomb friction forward', friction.coulomb + friction.coulomb_asymmetry, 0.0, None),
            ('Coulomb friction back', friction.coulomb - friction.coulomb_asymmetry, 0.0, None),
            ('viscous friction forward', friction.viscous + friction.viscous_asymmetry, 0.0, None),
            ('viscous friction back', friction.viscous - friction.viscous_asymmetry, 0.0, None),
            ('friction at rest', friction.coulomb - np.abs(friction.coulomb_asymmetry)
             + friction.stribeck_torque, 0.0, None),
            ('Stribeck velocity, rad/s', friction.stribeck_velocity, 1e-6, None),
            ('exponent of Stribeck friction', friction.stribeck_exponent, 1e-2, 10.0),
            ('exponent of friction', friction.power_exponent, 1e-2, None),
            ('friction of load', friction.load_coefficient, 0.0, 0.9),
            ('presliding distance, rad', friction.presliding_distance, 0.0, None),
            ('share of friction lost', (friction.dry_drop, friction.flowing_drop), -10.0, 1.0),
            ('time constant of friction, s', friction.warming_time, 1e-6, None),
            ('relative error of a drive gain', amplifier.gain_error, -0.9, None),
            ('torque ripple', np.abs(amplifier.ripple.reshape(LEGS, -1)).sum(axis=1), 0.0, 0.9),
            ('time constant of the actuators, s', amplifier.time_constant, 0.0, None),
            ('torque limit, N m', amplifier.torque_limit, 1e-6, None),
            ('stiffness, N m/rad', machine.transmission.stiffness, 1.0, None),
            ('gap, rad', machine.transmission.gap, 0.0, None),
            ('actuator inertia, kg m2', bodies.actuator_inertia, 1e-9, None),
            ('mass of half plate 1, kg', bodies.platform_mass_1, 1e-9, None),
            ('mass of half plate 2, kg', bodies.platform_mass_2, 1e-9, None),
            ('rod mass, kg', bodies.rod_mass, 0.0, None),
            ('bar mass, kg', bodies.bar_mass, 0.0, None),
            ('theta inertia, kg m2', bodies.theta_inertia, 0.0, None),
            ('viscous friction of theta or pivots',
             (platform.theta_viscous, platform.pivot_viscous), 0.0, None),
            ('Coulomb friction of theta or pivots',
             (platform.theta_coulomb, platform.pivot_coulomb), 0.0, None),
            ('drag', (platform.viscous_drag, platform.quadratic_drag), 0.0, None),
            ('stiffness of the cable, N/m', platform.spring, 0.0, None),
            ('step of a record', (sensors.position_step, sensors.torque_step), 0.0, None)):
        low, high = float(np.min(values)), float(np.max(values))
        if low < lowest or (highest is not None and high > highest):
            found = low if low < lowest else high
            limit = f'at least {lowest:g}' if low < lowest else f'at most {highest:g}'
            raise InputError(f'{what}: {found:.4g} with the effects of the model, a simulated '
                             f'machine needs {limit}; change the effect or its base parameter')


Fields = tuple[str, Mapping[str, str]]
"""A part of `Machine` and which of its fields take which parameters of the effect."""

ON_JOINTS: dict[str, Fields] = {
    'stribeck': ('friction', {'stribeck_torque': 'stribeck_torque',
                              'stribeck_velocity': 'stribeck_velocity',
                              'stribeck_exponent': 'exponent'}),
    'coulomb_asymmetry': ('friction', {'coulomb_asymmetry': 'asymmetry'}),
    'viscous_asymmetry': ('friction', {'viscous_asymmetry': 'asymmetry'}),
    'nonlinear_viscous': ('friction', {'quadratic': 'quadratic', 'power_torque': 'torque',
                                       'power_exponent': 'exponent'}),
    'load_dependent_friction': ('friction', {'load_coefficient': 'coefficient'}),
    'presliding': ('friction', {'presliding_distance': 'distance'}),
    'drive_gain_error': ('amplifier', {'gain_error': 'relative'}),
    'torque_saturation': ('amplifier', {'torque_limit': 'limit'}),
    'backlash': ('transmission', {'gap': 'gap'}),
    'encoder_offset': ('sensors', {'encoder_offset': 'offset'}),
    'encoder_eccentricity': ('sensors', {'eccentricity': 'amplitude',
                                         'eccentricity_phase': 'phase'}),
}
"""Effects that are fields of a part, (4,), on the joints they act on."""
OF_MACHINE: dict[str, Fields] = {
    'friction_drift': ('friction', {'dry_drop': 'drop', 'flowing_drop': 'viscous_drop',
                                    'warming_time': 'time_constant'}),
    'theta_friction': ('platform', {'theta_coulomb': 'coulomb', 'theta_viscous': 'viscous'}),
    'passive_joint_friction': ('platform', {'pivot_coulomb': 'coulomb',
                                            'pivot_viscous': 'viscous'}),
    'platform_drag': ('platform', {'viscous_drag': 'viscous', 'quadratic_drag': 'quadratic'}),
    'actuator_lag': ('amplifier', {'time_constant': 'time_constant'}),
    'time_offset': ('sensors', {'torque_delay': 'delay'}),
}
"""Effects that are fields of a part with one number for the machine."""


def _with_effect(machine: Machine, active: ActiveEffect) -> Machine:
    name = active.effect.name
    if name in ON_JOINTS:
        part, fields = ON_JOINTS[name]
        return _changed(machine, part, **{
            field: _acting(active, parameter, getattr(getattr(machine, part), field))
            if name in ONCE else getattr(getattr(machine, part), field) + _acting(active, parameter)
            for field, parameter in fields.items()})
    if name in OF_MACHINE:
        part, fields = OF_MACHINE[name]
        return _changed(machine, part, **{
            field: _whole(active, parameter)
            + (0.0 if name in ONCE else getattr(getattr(machine, part), field))
            for field, parameter in fields.items()})
    return _OTHERS[name](machine, active)


def _changed(machine: Machine, part: str, **fields: object) -> Machine:
    return replace(machine, **{part: replace(getattr(machine, part), **fields)})


def _acting(active: ActiveEffect, name: str, elsewhere: np.ndarray | float = 0.0) -> np.ndarray:
    """Return a parameter (4,) that is `elsewhere` on joints without the effect."""
    values = np.array(np.broadcast_to(elsewhere, (LEGS,)), dtype=float)
    joints = list(active.joints)
    values[joints] = active.values[name][joints]
    return values


def _whole(active: ActiveEffect, name: str) -> float:
    """Return a parameter of the machine."""
    return float(active.values[name][active.joints[0]])


def _joint_friction_difference(machine: Machine, active: ActiveEffect) -> Machine:
    friction = machine.friction
    return _changed(machine, 'friction', coulomb=friction.coulomb + _acting(active, 'coulomb'),
                    viscous=friction.viscous + _acting(active, 'viscous'))


def _with_harmonics(machine: Machine, active: ActiveEffect, amplitude: np.ndarray,
                    periods: np.ndarray, phase: np.ndarray) -> Machine:
    """Return the machine with waves (4,), or (4, K) of K orders, on the joints of the effect."""
    waves = np.stack([np.reshape(part, (LEGS, -1)) for part in (amplitude, periods, phase)])
    added = tuple(Harmonic(joint, *map(float, wave))
                  for joint in active.joints for wave in waves[:, joint].T)
    return replace(machine, harmonics=(*machine.harmonics, *added))


def _torque_offset(machine: Machine, active: ActiveEffect) -> Machine:
    return _with_harmonics(machine, active, active.values['offset'], np.zeros(LEGS),
                           np.full(LEGS, 0.5 * math.pi))


def _cogging(machine: Machine, active: ActiveEffect) -> Machine:
    return _with_harmonics(machine, active, active.values['amplitude'], active.values['periods'],
                           active.values['phase'])


def _torque_ripple(machine: Machine, active: ActiveEffect) -> Machine:
    """Add the orders to those that the torque constants have."""
    acting = np.isin(np.arange(LEGS), active.joints)
    added = {'ripple': np.where(acting, active.values['relative'].T, 0.0).T,
             'ripple_periods': active.values['periods'], 'ripple_phase': active.values['phase']}
    return _changed(machine, 'amplifier', **{
        field: np.hstack([np.reshape(part, (LEGS, -1)) for part in (
            getattr(machine.amplifier, field), wave)]) for field, wave in added.items()})


def _arm_mass_offset(machine: Machine, active: ActiveEffect) -> Machine:
    return _with_harmonics(machine, active, GRAVITY * active.values['first_moment'],
                           np.ones(LEGS), np.zeros(LEGS))


def _with_bodies(machine: Machine, **added: np.ndarray | float) -> Machine:
    return _changed(machine, 'bodies', **{name: getattr(machine.bodies, name) + more
                                          for name, more in added.items()})


def _distributed_rods(machine: Machine, active: ActiveEffect) -> Machine:
    return _with_bodies(machine, rod_mass=_whole(active, 'rod_mass'),
                        bar_mass=_whole(active, 'bar_mass'))


def _payload(machine: Machine, active: ActiveEffect) -> Machine:
    half = _whole(active, 'half')
    if half not in (1.0, 2.0):
        raise InputError(f"effect payload, half: expected 1 (at D) or 2 (at D'), found {half:g}")
    return _with_bodies(machine, **{f'platform_mass_{half:.0f}': _whole(active, 'mass')})


def _theta_inertia(machine: Machine, active: ActiveEffect) -> Machine:
    return _with_bodies(machine, theta_inertia=_whole(active, 'inertia'))


def _arm_weight_difference(machine: Machine, active: ActiveEffect) -> Machine:
    return _with_bodies(machine, arm_gravity=GRAVITY * _acting(active, 'first_moment'))


def _joint_inertia_difference(machine: Machine, active: ActiveEffect) -> Machine:
    return _with_bodies(machine, actuator_inertia=_acting(active, 'inertia'))


def _base_tilt(machine: Machine, active: ActiveEffect) -> Machine:
    """Turn the base about its x axis, then about its own y axis; gravity stays."""
    a, b = _whole(active, 'about_x'), _whole(active, 'about_y')
    about_x = np.array(((1.0, 0.0, 0.0), (0.0, math.cos(a), -math.sin(a)),
                        (0.0, math.sin(a), math.cos(a))))
    about_y = np.array(((math.cos(b), 0.0, math.sin(b)), (0.0, 1.0, 0.0),
                        (-math.sin(b), 0.0, math.cos(b))))
    return replace(machine, gravity=(about_x @ about_y).T @ machine.gravity)


def _geometry_error(machine: Machine, active: ActiveEffect) -> Machine:
    return _resized(machine, active, {name: values[0] for name, values in active.values.items()})


def _leg_length_error(machine: Machine, active: ActiveEffect) -> Machine:
    return _resized(machine, active, {
        f'{name}_errors': _acting(active, name, 0.0) for name in active.values})


def _resized(machine: Machine, active: ActiveEffect, errors: Mapping[str, ArrayLike]) -> Machine:
    true = machine.geometry.with_errors(**errors).model_dump()
    return replace(machine, geometry=parse(true, Geometry, f'effect {active.effect.name}'))


def _external_force(machine: Machine, active: ActiveEffect) -> Machine:
    force = np.array([_whole(active, axis) for axis in 'xyz'])
    return _changed(machine, 'platform', force=machine.platform.force + force)


def _cable_spring(machine: Machine, active: ActiveEffect) -> Machine:
    return _changed(machine, 'platform', spring=active.values['stiffness'],
                    anchor=active.values['anchor'])


def _position_torque(machine: Machine, active: ActiveEffect) -> Machine:
    low, high = map(float, active.values['range'])
    terms = np.reshape(active.values['coefficients'], (LEGS, -1))
    terms = np.where(np.isin(np.arange(LEGS), active.joints)[:, None], terms, 0.0)

    def load(_time: float, q: np.ndarray, _qd: np.ndarray) -> np.ndarray:
        return np.sum(terms * polynomials(q, low, high, terms.shape[1] - 1), axis=1)

    return replace(machine, loads=(*machine.loads, load))


def _elastic_transmission(machine: Machine, active: ActiveEffect) -> Machine:
    stiffness = _acting(active, 'stiffness', machine.transmission.stiffness)
    # 0 stands for a rigid joint
    return _changed(machine, 'transmission', damping_ratio=_whole(active, 'damping_ratio'),
                    motor_share=_whole(active, 'motor_share'),
                    stiffness=np.where(stiffness == 0.0, np.inf, stiffness))


def _quantization(machine: Machine, active: ActiveEffect) -> Machine:
    field = 'torque_step' if active.units['step'] == 'N m' else 'position_step'
    return _changed(machine, 'sensors', **{
        field: _acting(active, 'step', getattr(machine.sensors, field))})


_OTHERS: dict[str, Callable[[Machine, ActiveEffect], Machine]] = {
    'joint_friction_difference': _joint_friction_difference,
    'torque_offset': _torque_offset,
    'cogging': _cogging,
    'torque_ripple': _torque_ripple,
    'arm_mass_offset': _arm_mass_offset,
    'arm_weight_difference': _arm_weight_difference,
    'distributed_rods': _distributed_rods,
    'payload': _payload,
    'theta_inertia': _theta_inertia,
    'joint_inertia_difference': _joint_inertia_difference,
    'base_tilt': _base_tilt,
    'geometry_error': _geometry_error,
    'leg_length_error': _leg_length_error,
    'external_force': _external_force,
    'cable_spring': _cable_spring,
    'position_torque': _position_torque,
    'elastic_transmission': _elastic_transmission,
    'quantization': _quantization,
}
