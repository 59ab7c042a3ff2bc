"""Drives, records, encoders and transmissions of simulated robots in closed loop.

What is recorded is compared with what only a simulation knows: the torque that was delivered and
the pose that the platform took.
"""

from __future__ import annotations

import numpy as np
import pytest
from experiments import (
    HOME,
    IDEAL,
    changed,
    entry,
    gradient,
    machine_of,
    model_of,
    plant_of,
    played,
    weight_energy,
)

from par4_kinematics.position import inverse_kinematics
from par4_sim.closed_loop.simulation import build_simulation
from par4_sim.machines.transmission import Transmission
from robots import REFERENCE

GEOMETRY = REFERENCE.geometry
PLANTS = ['exact', 'fast']
RELATIVE = np.array((0.05, -0.03, 0.04, 0.0))
PHASE = np.array((0.5, -1.0, 2.0, 0.0))


def told_by(fidelity, *entries, known=None, duration=0.8, **base):
    """Return what the drives of a machine with effects tell of the first part of an excitation."""
    return played(build_simulation(IDEAL, model_of(*entries, **base), fidelity),
                  known or model_of(**base), duration)


def arms(told):
    """Return the true joint positions (n, 4), rad: those of the true pose."""
    return inverse_kinematics(GEOMETRY, told['true_pose'])


def share(told):
    """Return recorded over delivered torque - 1 (n, 4), NaN where there is hardly any."""
    true = told['true_torque']
    with np.errstate(invalid='ignore', divide='ignore'):
        return np.where(np.abs(true) > 2.0, told['effort'] / true - 1.0, np.nan)


# ------------------------------------------------------------------------------ drives


@pytest.mark.parametrize('fidelity', PLANTS)
def test_drive_gain_error(fidelity):
    """A motor that gives less than its constant says is told to give more: e > 0."""
    found = share(told_by(fidelity, entry('drive_gain_error', relative=tuple(RELATIVE))))
    assert np.isfinite(found).mean() > 0.2
    np.testing.assert_allclose(np.nanmin(found, axis=0), RELATIVE, atol=1e-9)
    np.testing.assert_allclose(np.nanmax(found, axis=0), RELATIVE, atol=1e-9)


@pytest.mark.parametrize('fidelity', PLANTS)
def test_torque_ripple(fidelity):
    told = told_by(fidelity, entry('torque_ripple', relative=tuple(RELATIVE), periods=20,
                                   phase=tuple(PHASE)))
    found, expected = share(told), RELATIVE * np.sin(20.0 * told['q'] + PHASE)
    # the delivered torque of a sample is that of two steps around it
    np.testing.assert_allclose(np.where(np.isnan(found), expected, found), expected, atol=1e-3)
    assert (np.nanmax(np.abs(found), axis=0)[:3] > 0.7 * np.abs(RELATIVE)[:3]).all()


@pytest.mark.parametrize('fidelity', PLANTS)
def test_actuator_lag(fidelity):
    """Recorded - delivered = T d(delivered)/dt: the torque comes late, it is not weaker."""
    told = told_by(fidelity, entry('actuator_lag', time_constant=3e-3), coulomb_friction=0.0)
    true = told['true_torque']
    rate = np.gradient(true, told['t'], axis=0)[100:-5]
    behind = (told['effort'] - true)[100:-5]
    np.testing.assert_allclose(np.sum(rate * behind, axis=0) / np.sum(rate ** 2, axis=0), 3e-3,
                               rtol=0.01)
    assert np.sqrt(np.mean((behind - 3e-3 * rate) ** 2)) < 0.02 * np.sqrt(np.mean(behind ** 2))


@pytest.mark.parametrize('fidelity', PLANTS)
def test_torque_saturation(fidelity):
    limit = np.array((6.5, 5.5, 4.5, 5.0))
    told = told_by(fidelity, entry('torque_saturation', limit=tuple(limit)))
    true, recorded = told['true_torque'], told['effort']
    assert (np.abs(true) <= limit).all()
    flat = np.abs(recorded) > limit + 1.0
    assert (flat.sum(axis=0) > 5).all()
    np.testing.assert_allclose(np.abs(true)[flat], np.broadcast_to(limit, true.shape)[flat])
    free = np.abs(recorded) < limit - 1.0
    np.testing.assert_allclose(true[free], recorded[free], atol=1e-9)


# ------------------------------------------------------------------------------ records


@pytest.mark.parametrize('fidelity', PLANTS)
@pytest.mark.parametrize('delay', [3e-3, -2e-3])
def test_time_offset(fidelity, delay):
    clean, late = told_by(fidelity), told_by(fidelity, entry('time_offset', delay=delay))
    np.testing.assert_array_equal(late['q'], clean['q'])
    np.testing.assert_array_equal(late['true_torque'], clean['true_torque'])
    shift = round(delay / 1e-3)
    inner = slice(10, -10)
    shifted = np.roll(clean['effort'], shift, axis=0)
    np.testing.assert_allclose(late['effort'][inner], shifted[inner], atol=1e-9)
    assert np.abs(late['effort'] - clean['effort'])[inner].max() > 0.1


@pytest.mark.parametrize('fidelity', PLANTS)
def test_quantization(fidelity):
    clean = told_by(fidelity)
    torque = told_by(fidelity, entry('quantization', unit='N m', step=0.25))
    np.testing.assert_array_equal(torque['q'], clean['q'])  # the drives do not see it
    steps = torque['effort'] / 0.25
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert 0.1 < np.abs(torque['effort'] - clean['effort']).max() <= 0.125 + 1e-9
    position = told_by(fidelity, entry('quantization', unit='rad', step=2e-3))
    steps = position['q'] / 2e-3
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    error = position['q'] - arms(position)
    assert np.abs(error).max() <= 1e-3 + 3e-6
    assert np.std(error) == pytest.approx(2e-3 / np.sqrt(12.0), rel=0.1)


@pytest.mark.parametrize('fidelity', PLANTS)
def test_encoder_offset_and_eccentricity(fidelity):
    """reading = q + offset + d sin(q + phi); the readings of speed follow, the arms do not know."""
    offset, size = np.array((4e-3, -6e-3, 2e-3, 0.0)), np.array((3e-3, 5e-3, 1e-3, 2e-3))
    told = told_by(fidelity, entry('encoder_offset', offset=tuple(offset)),
                   entry('encoder_eccentricity', amplitude=tuple(size), phase=tuple(PHASE)))
    q = arms(told)
    np.testing.assert_allclose(told['q'], q + offset + size * np.sin(q + PHASE), atol=5e-6)
    rate = np.gradient(told['q'], told['t'], axis=0)
    np.testing.assert_allclose(told['qd'][5:-5], rate[5:-5], atol=0.02 * np.abs(rate).max())
    assert np.ptp(q, axis=0).min() > 0.05


@pytest.mark.parametrize('fidelity', PLANTS)
def test_geometry_error_in_closed_loop(fidelity):
    """The drives bring true arms to the nominal angles; the platform is then elsewhere."""
    told = told_by(fidelity, entry('geometry_error', arm_length=4e-3, base_radius=-6e-3))
    longer = GEOMETRY.with_errors(arm_length=4e-3, base_radius=-6e-3)
    np.testing.assert_allclose(told['q'], inverse_kinematics(longer, told['true_pose']), atol=5e-6)
    assert np.abs(told['q'] - arms(told)).min() > 2e-4


# -------------------------------------------------------------------------- transmissions


def at_rest(fidelity, *entries, pull=0.0):
    """Return twist (4,) and torque (4,) of a frictionless machine that its drives hold at home."""
    force = entry('external_force', x=pull, y=0.5 * pull, z=30.0 if pull else 0.0)
    simulation = build_simulation(IDEAL, model_of(*entries, force, friction=False,
                                                  viscous_friction=1.0), fidelity)
    for _ in range(400):
        sample = simulation.next_sample()
    simulation.close()
    assert np.abs(sample.qd).max() < 2e-3
    twist = sample.q - inverse_kinematics(GEOMETRY, sample.true_pose)
    return twist, sample.effort, sample.true_pose


@pytest.mark.parametrize('fidelity', PLANTS)
@pytest.mark.parametrize('pull', [0.0, 15.0])
def test_an_elastic_transmission_twists_by_torque_over_stiffness(fidelity, pull):
    stiffness = np.array((2e3, 3e3, 1.5e3, 4e3))
    twist, torque, _ = at_rest(fidelity, entry('elastic_transmission', stiffness=tuple(stiffness)),
                               pull=pull)
    assert np.abs(torque).min() > 0.5
    np.testing.assert_allclose(twist, torque / stiffness, atol=2e-5)


@pytest.mark.parametrize('fidelity', PLANTS)
@pytest.mark.parametrize('pull', [0.0, 15.0])
def test_backlash_lies_on_the_side_of_the_load(fidelity, pull):
    """Half the gap towards the load, whichever way it pulls; both ways: the lost motion."""
    gap = np.array((4e-3, 6e-3, 5e-3, 0.0))
    twist, torque, pose = at_rest(fidelity, entry('backlash', gap=tuple(gap)), pull=pull)
    force = (pull, 0.5 * pull, 30.0 if pull else 0.0)
    load = gradient(lambda x: weight_energy(x) - np.dot(force, x[:3]), pose)
    np.testing.assert_allclose(torque, load, atol=0.05)
    np.testing.assert_allclose(twist, 0.5 * gap * np.sign(load), atol=2e-4)
    assert (load > 0.0).any() == bool(pull)


@pytest.mark.parametrize('fidelity', ['exact', 'fast', 'accurate'])
def test_code_switches_a_transmission_on_as_a_model_does(fidelity):
    told = []
    for machine in (changed(machine_of(), 'transmission', stiffness=np.full(4, 2e4)),
                    machine_of(entry('elastic_transmission', stiffness=2e4,
                                     damping_ratio=Transmission().damping_ratio))):
        with plant_of(machine, fidelity, HOME) as plant:
            for _ in range(10):
                plant.step((5.0, -5.0, 4.0, 0.0))
            told.append(plant.q)
    np.testing.assert_array_equal(*told)
