"""Teeth and the zero of the encoder: where a tooth is felt says where the zero is, and reverse."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from measured import log_of_machine

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.model_from_file import read_model
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.diagnosis import diagnose
from par4_identification.diagnosis.verdict.answer import Cause
from par4_identification.diagnosis.verdict.true_angles import by_true_angles
from par4_sim.machines.machine_effects import machine_of_model
from robots import REFERENCE, model_with

SEARCHED = {name: CATALOGUE[name] for name in ('cogging', 'encoder_offset')}
PERIODS, PHASE, ZERO = 60.0, (0.5, -2.0, 1.5, 3.0), (0.0, 0.0, 0.0, 7e-3)


@pytest.fixture(scope='module')
def toothed():
    """Return logs of two motions of a machine with teeth, whose last encoder was set anew."""
    table = read_model('table1', REFERENCE)
    model = model_with(table, 'cogging', amplitude=0.6, periods=PERIODS, phase=PHASE)
    machine = machine_of_model(REFERENCE, model_with(model, 'encoder_offset', offset=ZERO))
    return [log_of_machine(REFERENCE, machine, table, duration=duration, seed=seed, noise=0.05)
            for duration, seed in ((10.0, 61), (7.0, 62))]


def test_known_teeth_show_the_zero_and_are_no_new_ones(toothed):
    fit, heldout = toothed
    known = diagnose([fit], REFERENCE, holdout_logs=[heldout], library={
        'cogging': CATALOGUE['cogging']}).extended_model
    entry = known.effects[-1]
    known = known.model_copy(update={'effects': (*known.effects[:-1], entry.model_copy(update={
        'parameters': {**entry.parameters, 'phase': entry.parameters['phase'].model_copy(
            update={'value': PHASE})}}))})
    cause, = diagnose([fit], REFERENCE, known, [heldout], library=SEARCHED).causes
    assert (cause.effect.name, cause.joints) == ('encoder_offset', (3,))
    offset, = cause.parameters['offset'].value
    assert offset == pytest.approx(ZERO[3], abs=3e-4)


def test_teeth_found_together_with_a_zero_are_told_by_the_true_angle(toothed):
    fit, heldout = toothed
    result = diagnose([fit], REFERENCE, holdout_logs=[heldout], library=SEARCHED)
    told = {cause.effect.name: cause for cause in result.causes}
    assert told['encoder_offset'].joints == (3,)
    phase = told['cogging'].parameters['phase']
    apart = np.remainder(np.subtract(phase.value, PHASE) + np.pi, 2.0 * np.pi) - np.pi
    assert np.all(np.abs(apart) < 3.0 * np.array(phase.std) + 0.02)
    # the angle that is read would turn the last one by 0.42 rad
    assert np.abs(apart).max() < 0.15


def test_orders_turn_by_their_number_and_what_is_bound_to_nothing_stays():
    zero = SimpleNamespace(effect=CATALOGUE['encoder_offset'], joints=(1,), parameters={
        'offset': Parameter(value=(0.01,), std=(1e-3,), unit='rad')})
    friction = SimpleNamespace(effect=CATALOGUE['stribeck'], joints=(1,), parameters={})
    teeth = Cause(CATALOGUE['cogging'], (0, 1), {
        'periods': Parameter(value=(10.0, 300.0), unit='1/turn'),
        'phase': Parameter(value=((0.1, 0.2), (0.3, 3.0)), std=((0.0, 0.0), (0.4, 0.4)),
                           unit='rad')}, (), 1.0, 0.0, 1.0, None, None)
    moved, *others = by_true_angles([teeth, friction, zero])
    assert others == [friction, zero]
    phase = moved.parameters['phase']
    np.testing.assert_allclose(phase.value, ((0.1, 0.3), (0.3, 6.0 - 2.0 * np.pi)))
    np.testing.assert_allclose(phase.std, ((0.0, 0.01), (0.4, 0.5)))
    assert by_true_angles([teeth]) == [teeth]


def test_zeros_of_several_joints_turn_the_teeth_of_each_though_none_has_a_deviation():
    zero = SimpleNamespace(effect=CATALOGUE['encoder_offset'], joints=(0, 2), parameters={
        'offset': Parameter(value=(0.01, -0.02), unit='rad')})
    teeth = Cause(CATALOGUE['cogging'], (0, 1, 2), {
        'periods': Parameter(value=10.0, unit='1/turn'),
        'phase': Parameter(value=(0.1, 0.2, 0.3), std=(0.1, 0.1, 0.1), unit='rad')},
        (), 1.0, 0.0, 1.0, None, None)
    phase = by_true_angles([teeth, zero])[0].parameters['phase']
    np.testing.assert_allclose(phase.value, (0.2, 0.2, 0.1))
    assert phase.std == (0.1, 0.1, 0.1)
