"""Axes whose travel is short, long or many turns, whatever the unit: nothing but it gives a scale.

The force is computed from the motion as it is; encoders of 17 bits over the travel read it.
"""

from __future__ import annotations

import numpy as np
import pytest
from axes import axis, built_up

from par4_dynamics.effects.position_torque import PositionTorque, goes_on_turning
from par4_dynamics.state import State
from par4_identification.diagnosis.diagnosis import CONDITIONING, LIBRARY, diagnose
from par4_identification.logs.log import Log
from par4_identification.signals.scales import conditioning_for

SLIDE = axis(kind='linear', gravity='none')
SCREW = axis(gravity='none')
"""A motor that turns many times to and fro."""
MASS, READ = 3.0, 2 ** 17
T = 1e-3 * np.arange(24_000)
LONG = 1e-3 * np.arange(36_000)
"""Long enough for friction that builds up in microns to be told from a function of the speed, and
for a delay of friction to pass for an inertia where it may."""


def recorded(travel, force, seed, distance=0.0, t=T):
    """Return the log of a motion to and fro with dry and viscous friction and a force beside them.

    `force` is a function of place and speed, over their deviations, in dry friction, which builds
    up over a distance after it has turned over.
    """
    random = np.random.default_rng(seed)
    q = sum(size * np.sin(2.0 * np.pi * frequency * t + random.uniform(0.0, 6.0))
            for frequency, size in ((0.13, 0.5), (0.31, 0.25), (0.55, 0.14), (1.1, 0.06)))
    q *= travel / np.ptp(q)
    qd = np.gradient(q, t)
    qdd = np.gradient(qd, t)
    dry = 0.8 * MASS * np.std(qdd) + 2.0
    place, speed = (q - q.mean()) / np.std(q), qd / np.std(qd)
    tau = (MASS * qdd + dry * (0.3 * speed + built_up(q, distance) + force(place, speed))
           + 0.02 * dry * random.standard_normal(len(t)))
    count = travel / READ
    return Log('to and fro', ('motor',), 1, 1e-3, t, (count * np.round(q / count))[:, None],
               tau[:, None], (slice(0, len(t)),), None, None), dry


def named(log, machine):
    """Return the diagnosis of a log by the whole library, and the names in it."""
    diagnosis = diagnose([log], machine, library=LIBRARY,
                         conditioning=conditioning_for([log], machine, CONDITIONING))
    return diagnosis, [cause.effect.name for cause in diagnosis.causes]


@pytest.mark.parametrize(('machine', 'travel', 'seed'), [(SLIDE, 8.0, 20), (SCREW, 60.0, 21)])
def test_soft_transmissions_do_not_explain_the_counts_of_encoders(machine, travel, seed):
    """They let less of them through, and the offset beside them would stand in noise."""
    log, dry = recorded(travel, lambda _place, _speed: 0.06, seed)
    diagnosis, names = named(log, machine)
    assert names == ['torque_offset']
    assert diagnosis.causes[0].parameters['offset'].value[0] == pytest.approx(0.06 * dry, rel=0.1)


@pytest.mark.parametrize(('q', 'goes_on'), [
    (30.0 * T / T[-1], True),  # on and on
    (30.0 * np.sin(np.pi * T / T[-1]), True),  # there and back once
    (30.0 * T / T[-1] + 3.0 * np.sin(T), True),  # on and on, with strokes back
    (30.0 * np.sin(2.0 * np.pi * 4.0 * T / T[-1]), False),
    (2.0 * np.pi * T / T[-1], False)])  # a turn is no more than a spring may take
def test_no_spring_is_wound_up_by_a_joint_that_goes_on_turning(q, goes_on):
    still = np.zeros((len(T), 1))
    state = State(T, q[:, None], still, still)
    assert goes_on_turning(state) == goes_on
    assert bool(PositionTorque().shapes(state)) != goes_on


@pytest.mark.parametrize(('machine', 'travel', 'seed', 'error', 't'), [
    (SCREW, 60.0, 18, 0.02, T),  # a motor that turns to and fro can wind a spring
    (SLIDE, 0.02, 16, 0.05, LONG)],  # which hides an inertia that a delay of friction is like
    ids=['screw', 'slide'])
def test_a_spring_over_all_of_the_travel_takes_no_inertia(machine, travel, seed, error, t):
    log, _ = recorded(travel, lambda place, _speed: 0.3 * place, seed, t=t)
    diagnosis, names = named(log, machine)
    assert names == ['position_torque']
    assert diagnosis.extended_model.parameters['actuator_inertia'].number == pytest.approx(
        MASS, rel=error)


@pytest.mark.parametrize(('machine', 'travel', 'distance', 't'), [
    (SCREW, 60.0, 0.12, T), (SLIDE, 8.0, 0.12, T), (SLIDE, 0.2, 1e-4, LONG)],
    ids=['screw', 'slide', 'short slide'])
def test_friction_builds_up_over_a_share_of_the_travel(machine, travel, distance, t):
    """The contact is not that of Dahl, so that the law has an error: it is named or has no name."""
    found = [named(recorded(travel, lambda _place, _speed: 0.0, seed, distance, t)[0],
                   machine)
             for seed in (31, 32)]
    assert ['presliding'] in [names for _, names in found]
    for diagnosis, names in found:
        if names:
            assert names == ['presliding']
            assert diagnosis.causes[0].parameters['distance'].number == pytest.approx(
                distance, rel=0.1)
        else:
            assert diagnosis.unnamed[0].kind == 'memory'
