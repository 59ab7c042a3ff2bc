"""A kind of unnamed cause is the same function on every run: what one run tells holds on another.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from par4_dynamics.effects.cogging import waves_of_orders
from par4_dynamics.state import Nominal, State
from par4_identification.diagnosis.evidence.kind_functions import (
    Ranges,
    acceleration,
    creep,
    drift,
    gain,
    rate,
)

T = np.arange(0.0, 6.0, 0.01)
RANGES = Ranges(q=(np.array([-1.0]), np.array([1.0])), qd=np.array([1.0]), qdd=np.array([1.0]),
                torque=np.array([8.0]), end=6.0, platform=None)
BENT = slice(-5, None)
"""Columns of a gain that do not drift with time."""


def run_of(q, torque):
    """Return a run of one joint at these positions, with the nominal torque."""
    zeros = np.zeros((len(T), 1))
    return State(T, q[:, None], zeros, zeros, nominal=Nominal(
        torque[:, None], zeros, {}, lambda _state: zeros, lambda _state: zeros, {}))


def test_a_spring_has_its_rest_in_one_place_wherever_a_run_begins():
    near, far = (shift + 0.3 * np.sin(1.7 * T) for shift in (0.0, 0.6))
    columns = [creep(run_of(q, 0.0 * T), RANGES)[:, 0] for q in (near, far)]
    values = np.linalg.lstsq(columns[0], 50.0 * (near - 0.1), rcond=None)[0]
    np.testing.assert_allclose(columns[1] @ values, 50.0 * (far - 0.1), atol=1e-9)


def test_waves_are_sines_and_cosines_of_the_periods_of_each_joint():
    q = np.column_stack((np.sin(1.7 * T), 2.0 + 0.3 * T))
    orders = ((3, 160), (1, 17))
    angle = np.array(orders) * q[..., None]
    np.testing.assert_allclose(
        waves_of_orders(State(T, q, q, q), orders),
        np.concatenate((np.sin(angle), np.cos(angle)), axis=-1), atol=1e-11)


def test_an_amplifier_bends_at_the_same_torque_however_lively_a_run_is():
    lively = np.linspace(-20.0, 20.0, len(T))
    calm = np.clip(lively, -2.0, 2.0)
    here, there = (gain(run_of(0.0 * T, torque), RANGES)[:, 0, BENT] for torque in (lively, calm))
    same = lively == calm
    assert np.ptp(here[same], axis=0)[:4].min() > 0.1
    np.testing.assert_array_equal(here[same], there[same])


def test_an_inertia_of_a_slide_changes_with_its_place_whatever_the_unit_of_length():
    q = 0.4 * np.sin(1.7 * T)[:, None]
    qd, qdd = 0.68 * np.cos(1.7 * T)[:, None], -1.156 * np.sin(1.7 * T)[:, None]
    found = []
    for unit in (1.0, 1000.0):
        ranges = replace(RANGES, q=(np.array([-0.4 * unit]), np.array([0.4 * unit])),
                         qd=np.array([0.68 * unit]), qdd=np.array([1.156 * unit]))
        found.append(acceleration(State(T, unit * q, unit * qd, unit * qdd, slides=True), ranges))
    np.testing.assert_allclose(found[1], found[0], atol=1e-12)
    assert np.ptp(found[0][:, 0, 2]) > 0.1


def test_friction_that_changes_with_time_is_that_of_oil_that_warms_too():
    """Its viscous part falls to half within seconds, its dry part by a tenth."""
    qd = 0.7 * np.cos(1.7 * T)
    run = State(T, 0.4 * np.sin(1.7 * T)[:, None], qd[:, None], qd[:, None])
    warm = 1.0 - np.exp(-T / 2.5)
    friction = 2.0 * (1.0 - 0.1 * warm) * np.sign(qd) + 2.4 * (1.0 - 0.5 * warm) * qd
    known = np.column_stack((np.sign(qd), qd))  # of which base terms take what is constant
    columns = np.column_stack((known, drift(run, RANGES)[:, 0]))
    left = friction - columns @ np.linalg.lstsq(columns, friction, rcond=None)[0]
    alone = friction - known @ np.linalg.lstsq(known, friction, rcond=None)[0]
    assert np.std(left) < 0.1 * np.std(alone)


def test_what_acts_on_the_delivered_torque_sees_that_of_the_effects():
    """Those that follow from the nominal torque, too, such as a tilt or what springs carry."""
    torque, more = 5.0 * np.sin(T), 3.0 * np.sin(4.0 * T)
    state = run_of(0.0 * T, torque)
    with_more = state.with_nominal(replace(state.nominal, effects=lambda _: more[:, None]))
    whole = run_of(0.0 * T, torque + more)
    for function in (rate, gain):
        np.testing.assert_allclose(function(with_more, RANGES), function(whole, RANGES))
