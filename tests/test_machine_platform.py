"""Masses, forces, gravity and dimensions of simulated machines, against energies by hand."""

from __future__ import annotations

import numpy as np
import pytest
from experiments import (
    ASIDE,
    FIDELITIES,
    HOME,
    TABLE,
    changed,
    entry,
    gradient,
    joint_inertia,
    machine_of,
    outward,
    plant_of,
    rods,
    rotation,
    weight_energy,
)

from par4_dynamics.mechanism import kinetic_energy, potential_energy
from par4_dynamics.state import GRAVITY
from par4_kinematics.position import inverse_kinematics
from robots import REFERENCE

GEOMETRY = REFERENCE.geometry
M_1, M_2, INERTIA = (TABLE[name] for name in (
    'platform_mass_1', 'platform_mass_2', 'actuator_inertia'))
FORCE = np.array((3.0, -4.0, 2.0))
ANCHOR = np.array((0.4, -0.3, 0.2))
TILT = (0.15, -0.2)
OFFSET = np.array((0.6, -0.4, 0.3, 0.0))
PHASE = np.array((0.0, 1.0, 2.0, 3.0))
BESIDE = np.array((0.09, -0.06, 0.03, 0.0))
ERRORS = {'arm_length': 6e-3, 'forearm_length': -9e-3, 'base_radius': 12e-3,
          'platform_radius': -6e-3, 'platform_bar_length': 15e-3}
LEG_ERRORS = {'arm_length': (0.05, 0.0, -0.04, 0.02), 'forearm_length': (0.0, 0.06, -0.05, 0.0)}
UNEVEN = GEOMETRY.with_errors(**{f'{name}_errors': error for name, error in LEG_ERRORS.items()})
TRUE = GEOMETRY.with_errors(**ERRORS)


def up_in_tilted_base():
    """Return the world's up (3,) as a base sees it that turned about its x, then its own y axis."""
    base_in_world = rotation(0, TILT[0]) @ rotation(1, TILT[1])
    return base_in_world.T @ (0.0, 0.0, 1.0)


def heavier(mass):
    """Return the energy of masses (4,), kg m, that hang on the lines of the arms."""
    def energy(x):
        return weight_energy(x) - GRAVITY * float(
            np.sum(mass * np.sin(inverse_kinematics(GEOMETRY, x))))
    return energy


def lifted(mass):
    """Return the energy of masses (4,), kg m, that hang below their horizontal arms."""
    def energy(x):
        # a quarter turn ahead of the arm, to the side towards which q grows
        q = inverse_kinematics(GEOMETRY, x)
        return weight_energy(x) - GRAVITY * float(np.sum(mass * np.cos(q)))
    return energy


def joints(x):
    return inverse_kinematics(GEOMETRY, x)


# name -> effects, energy of the pose x
ENERGIES = {
    'none': ((), weight_energy),
    'torque_offset': ((entry('torque_offset', offset=tuple(OFFSET)),),
                      lambda x: weight_energy(x) + OFFSET @ joints(x)),
    'cogging': ((entry('cogging', amplitude=tuple(OFFSET), periods=24.0, phase=tuple(PHASE)),),
                lambda x: weight_energy(x) - OFFSET @ np.cos(24.0 * joints(x) + PHASE) / 24.0),
    'cogging of two orders': (
        (entry('cogging', amplitude=(tuple(OFFSET), 0.2), periods=(24.0, 7.0),
               phase=(tuple(PHASE), 0.3)),),
        lambda x: (weight_energy(x) - OFFSET @ np.cos(24.0 * joints(x) + PHASE) / 24.0
                   - 0.2 * np.sum(np.cos(7.0 * joints(x) + 0.3)) / 7.0)),
    'arm_mass_offset': ((entry('arm_mass_offset', first_moment=tuple(BESIDE)),), lifted(BESIDE)),
    'arm_weight_difference': (
        (entry('arm_weight_difference', first_moment=tuple(BESIDE)),), heavier(BESIDE)),
    'payload at D': ((entry('payload', mass=1.5, half=1),),
                     lambda x: weight_energy(x, mass_1=M_1 + 1.5)),
    'payload at the other half': ((entry('payload', mass=1.5, half=2),),
                                  lambda x: weight_energy(x, mass_2=M_2 + 1.5)),
    'external_force': ((entry('external_force', x=FORCE[0], y=FORCE[1], z=FORCE[2]),),
                       lambda x: weight_energy(x) - FORCE @ x[:3]),
    'cable_spring': ((entry('cable_spring', stiffness=40.0, anchor=tuple(ANCHOR)),),
                     lambda x: weight_energy(x) + 20.0 * np.sum((x[:3] - ANCHOR) ** 2)),
    'a hose with a stiffness along each axis': (
        (entry('cable_spring', stiffness=(5.0, 0.0, 60.0), anchor=tuple(ANCHOR)),),
        lambda x: (weight_energy(x) + 2.5 * (x[0] - ANCHOR[0]) ** 2
                   + 30.0 * (x[2] - ANCHOR[2]) ** 2)),
    'base_tilt': ((entry('base_tilt', about_x=TILT[0], about_y=TILT[1]),),
                  lambda x: weight_energy(x, up=up_in_tilted_base())),
    'geometry_error': ((entry('geometry_error', **ERRORS),),
                       lambda x: weight_energy(x, geometry=TRUE)),
    'leg_length_error': ((entry('leg_length_error', **LEG_ERRORS),),
                         lambda x: weight_energy(x, geometry=UNEVEN)),
    'a payload on a tilted base': ((entry('payload', mass=0.8, half=2),
                                    entry('base_tilt', about_x=TILT[0], about_y=TILT[1])),
                                   lambda x: weight_energy(x, mass_2=M_2 + 0.8,
                                                           up=up_in_tilted_base())),
}


@pytest.mark.parametrize('fidelity', FIDELITIES)
@pytest.mark.parametrize('name', ENERGIES)
def test_the_slope_of_the_energy_holds_the_machine(name, fidelity):
    """And nothing else does: what held the machine without the effect lets it fall."""
    entries, energy = ENERGIES[name]
    geometry = {'geometry_error': TRUE, 'leg_length_error': UNEVEN}.get(name, GEOMETRY)
    with plant_of(machine_of(*entries, friction=False), fidelity, ASIDE) as plant:
        speeds = []
        for torque in (gradient(energy, ASIDE, geometry), gradient(weight_energy, ASIDE)):
            plant.reset(ASIDE)
            for _ in range(20):
                plant.step(torque)
            speeds.append(np.abs(plant.qd).max())
    assert speeds[0] < 2e-5
    assert (speeds[1] > 2e-3) == (name != 'none')


def test_signs_that_anyone_can_tell():
    """A force up relieves the drives; a base that leans over makes its low side carry more."""
    plain = gradient(weight_energy, HOME)
    assert (plain < 0.0).all()  # q is positive downwards: the drives pull the arms up
    assert (gradient(lambda x: weight_energy(x) - 5.0 * x[2], HOME) > plain).all()
    # turned about x by a > 0, what is at y > 0 goes up
    assert (rotation(0, 0.1) @ (0.0, 1.0, 0.0))[2] > 0.0
    # arms stretched out: a mass below them pulls towards the centre, the drive pushes q up
    with plant_of(machine_of(entry('arm_mass_offset', first_moment=0.05), friction=False),
                  'exact') as plant:
        plant.step(plain)
        assert (plant.qd < 0.0).all()


# ----------------------------------------------------------------------------- inertia

ROD = 0.06
LIGHTER = np.array((0.02, -0.03, 0.01, 0.0))
INERTIAS = {
    'none': ((), {}),
    'payload at D': ((entry('payload', mass=1.5, half=1),), {'mass_1': M_1 + 1.5}),
    'payload at the other half': ((entry('payload', mass=1.5, half=2),), {'mass_2': M_2 + 1.5}),
    'theta_inertia': ((entry('theta_inertia', inertia=0.01),), {'theta': 0.01}),
    'distributed_rods': ((entry('distributed_rods', rod_mass=ROD),), {'rod': ROD}),
    'joint_inertia_difference': ((entry('joint_inertia_difference', inertia=tuple(LIGHTER)),),
                                 {'actuator': INERTIA + LIGHTER}),
}


@pytest.mark.parametrize('fidelity', FIDELITIES)
@pytest.mark.parametrize('name', INERTIAS)
def test_a_push_is_answered_by_the_inertia(name, fidelity):
    """qdd from rest = M^-1 push, M from the velocities of points; four independent pushes."""
    entries, bodies = INERTIAS[name]
    held = {key: value for key, value in bodies.items() if key in ('mass_1', 'mass_2')}
    weight = gradient(lambda x: weight_energy(x, **held), ASIDE)
    found = []
    with plant_of(machine_of(*entries, friction=False), fidelity, ASIDE) as plant:
        for push in 10.0 * np.eye(4):
            plant.reset(ASIDE)
            plant.step(weight + push)
            found.append(plant.qd / (10.0 * plant.dt))
    expected, plain = (np.linalg.inv(joint_inertia(ASIDE, **part)) for part in (bodies, {}))
    np.testing.assert_allclose(found, expected, atol=5e-4 * np.abs(expected).max())
    assert (np.abs(expected - plain).max() > 0.01 * np.abs(plain).max()) == (name != 'none')


# ------------------------------------------------------------------------- dissipation


def speed_of_d(xd):
    return np.linalg.norm(xd[:, :3], axis=1)


def pivots(x, xd, qd):
    """Return the rates (n, 20) of passive joints: 2 rods a leg with 2 ends, 4 pivots of the bars.

    A rod does not spin about itself; half plates do not turn.
    """
    rates, step = [], 1e-6
    for pose, speed, turn in zip(x, xd, qd):
        rod = rods(GEOMETRY, pose)
        change = (rods(GEOMETRY, pose + step * speed) - rods(GEOMETRY, pose - step * speed)) / (
            2.0 * step)
        turning = np.cross(rod, change) / np.sum(rod ** 2, axis=1, keepdims=True)
        # the axis about which a positive qd carries the arm downwards
        axis = np.cross(outward(GEOMETRY), (0.0, 0.0, -1.0))
        elbow = np.linalg.norm(turning - turn[:, None] * axis, axis=1)
        plate = np.linalg.norm(turning, axis=1)
        rates.append(np.concatenate((elbow, elbow, plate, plate, np.full(4, abs(speed[3])))))
    return np.array(rates)


DISSIPATION = {
    'viscous drag': (entry('platform_drag', viscous=8.0),
                     lambda _x, xd, _qd: 8.0 * speed_of_d(xd) ** 2),
    'quadratic drag': (entry('platform_drag', quadratic=9.0),
                       lambda _x, xd, _qd: 9.0 * speed_of_d(xd) ** 3),
    'viscous theta': (entry('theta_friction', viscous=0.08),
                      lambda _x, xd, _qd: 0.08 * xd[:, 3] ** 2),
    'Coulomb theta': (entry('theta_friction', coulomb=0.4),
                      lambda _x, xd, _qd: 0.4 * np.abs(xd[:, 3])),
    'viscous pivots': (entry('passive_joint_friction', viscous=0.1),
                       lambda *motion: 0.1 * np.sum(pivots(*motion) ** 2, axis=1)),
    'Coulomb pivots': (entry('passive_joint_friction', coulomb=0.1),
                       lambda *motion: 0.1 * np.sum(pivots(*motion), axis=1)),
}
PUSHES = {'turn': gradient(lambda x: 2.5 * x[3], ASIDE),
          'slide': gradient(lambda x: 25.0 * x[0] - 15.0 * x[1] + 10.0 * x[2], ASIDE)}


@pytest.mark.parametrize('fidelity', FIDELITIES)
@pytest.mark.parametrize('name', DISSIPATION)
def test_the_energy_that_is_missing_is_what_the_friction_takes(name, fidelity):
    """Work of a constant push = energy gained + the integral of the power by hand."""
    effect, power = DISSIPATION[name]
    machine = machine_of(effect, friction=False)
    weight = gradient(weight_energy, ASIDE)
    seen = []
    for push in PUSHES.values():
        with plant_of(machine, fidelity, ASIDE) as plant:
            told = [(plant.x, plant.q)]
            for _ in range(320):
                plant.step(weight + push)
                told.append((plant.x, plant.q))
        x, q = (np.array(part) for part in zip(*told))
        # between two readings velocities are mean ones, at the middle
        middle, rate = 0.5 * (x[1:] + x[:-1]), np.diff(x, axis=0) / plant.dt
        taken = power(middle, rate, np.diff(q, axis=0) / plant.dt)
        lost = (np.sum(taken[:-1]) + 0.5 * taken[-1]) * plant.dt
        work = (weight + push) @ (0.5 * (q[-1] + q[-2]) - q[0])
        gained = (kinetic_energy(GEOMETRY, machine.bodies, middle[-1], rate[-1])
                  + potential_energy(GEOMETRY, machine.bodies, middle[-1])
                  - potential_energy(GEOMETRY, machine.bodies, x[0]))
        assert work - gained == pytest.approx(lost, rel=0.01, abs=2e-4 * work)
        seen.append(lost / work)
    assert max(seen) > 0.1


@pytest.mark.parametrize('fidelity', FIDELITIES)
@pytest.mark.parametrize(('name', 'errors'), [
    ('geometry_error', ERRORS), ('leg_length_error', LEG_ERRORS)])
def test_true_dimensions_close_the_loops(fidelity, name, errors):
    """At the pose every forearm of the true length ends on true arms, wherever these must be."""
    machine = machine_of(entry(name, **errors))
    with plant_of(machine, fidelity, ASIDE) as plant:
        q = plant.q
        np.testing.assert_allclose(plant.x, ASIDE, atol=1e-12)
    nominal = inverse_kinematics(GEOMETRY, ASIDE)
    assert np.abs(q - nominal).min() > 1e-3
    for leg, azimuth in enumerate(GEOMETRY.actuator_azimuth):
        length = {key: getattr(GEOMETRY, key) + np.broadcast_to(errors.get(key, 0.0), (4,))[leg]
                  for key in ERRORS}
        radial = np.array((np.cos(azimuth), np.sin(azimuth), 0.0))
        elbow = ((length['base_radius'] + length['arm_length'] * np.cos(q[leg])) * radial
                 - length['arm_length'] * np.sin(q[leg]) * np.array((0.0, 0.0, 1.0)))
        bar, theta = length['platform_bar_length'], ASIDE[3]
        # half plates translate: D to plate joint is what it is at theta = 0, D' = D + bar
        plate = ASIDE[:3] + length['platform_radius'] * radial
        if leg < 2:
            plate = plate + bar * np.array((-np.sin(theta), np.cos(theta), 0.0))
        plate = plate + (0.5 if leg >= 2 else -0.5) * bar * np.array((0.0, 1.0, 0.0))
        assert np.linalg.norm(plate - elbow) == pytest.approx(length['forearm_length'], abs=1e-9)


def test_code_switches_forces_on_as_a_model_does():
    told = []
    for machine in (changed(machine_of(friction=False), 'platform', force=FORCE),
                    machine_of(*ENERGIES['external_force'][0], friction=False)):
        with plant_of(machine, 'exact') as plant:
            for _ in range(10):
                plant.step(np.zeros(4))
            told.append(plant.q)
    np.testing.assert_array_equal(*told)
