"""The place of an effect in the library decides nothing: not its name, its values nor its twins."""

from __future__ import annotations

import random
from functools import cache

import numpy as np
import pytest
from searches import LOADED, OFFSET, log_with

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.state import State
from par4_identification.diagnosis.diagnosis import LIBRARY, diagnose
from robots import REFERENCE

LIBRARY_OF_LOGS = (
    'torque_offset', 'stribeck', 'external_force', 'cable_spring', 'coulomb_asymmetry',
    'viscous_asymmetry', 'load_dependent_friction', 'drive_gain_error', 'actuator_lag',
    'time_offset')
"""With two exact twins, a delay that is nearly a lag, a force that is a cable without spring."""
LOGS = {
    'an offset': (('torque_offset', {'offset': OFFSET}),),
    'a force beside friction of the load': (
        ('external_force', {'x': 1.5, 'y': 0.0, 'z': -1.0}), LOADED),
    'a lag': (('actuator_lag', {'time_constant': 0.004}),),
    'nothing': ()}
ORDERS = ('reversed', 'shuffled')


def in_order(names, order):
    """Return the library of some names in an order."""
    names = list(names)
    if order == 'reversed':
        names.reverse()
    if order == 'shuffled':
        random.Random(7).shuffle(names)
    return {name: LIBRARY[name] for name in names}


@cache
def diagnosed(name, order):
    """Return the diagnosis of a log by the library in an order."""
    fitted, heldout = (log_with(*LOGS[name], seed=seed, duration=6.0) for seed in (1, 2))
    return diagnose([fitted], REFERENCE, library=in_order(LIBRARY_OF_LOGS, order),
                    holdout_logs=[heldout])


@pytest.mark.parametrize('order', ORDERS)
@pytest.mark.parametrize('name', LOGS)
def test_the_order_of_the_library_decides_nothing(name, order):
    """Names in their order, joints, twins, rivals and values are the same."""
    one, other = diagnosed(name, 'as it is'), diagnosed(name, order)
    assert bool(one.causes) == bool(LOGS[name])
    assert one.verdict == other.verdict
    assert [item.kind for item in one.unnamed] == [item.kind for item in other.unnamed]
    assert ([(cause.effect.name, cause.joints, cause.twins, cause.rival) for cause in one.causes]
            == [(cause.effect.name, cause.joints, cause.twins, cause.rival)
                for cause in other.causes])
    for mine, theirs in zip(one.causes, other.causes, strict=True):
        assert list(mine.parameters) == list(theirs.parameters)
        for parameter, value in mine.parameters.items():
            assert theirs.parameters[parameter].value == pytest.approx(value.value, rel=1e-6)
            assert theirs.parameters[parameter].std == pytest.approx(value.std, rel=1e-4)


JOINT_EFFECTS = [effect for effect in CATALOGUE.values()
                 if not (effect.shared or effect.needs_nominal or effect.name == 'quantization')]


@pytest.mark.parametrize('effect', JOINT_EFFECTS, ids=lambda effect: effect.name)
def test_the_law_of_a_joint_has_as_many_variables_as_its_columns_follow(effect):
    """Of twins the law with the fewest is told first, so it must have no more."""
    random = np.random.default_rng(5)
    t = 1e-2 * np.arange(200)
    moves, others = ({name: random.uniform(-1.0, 1.0, (200, 4)) for name in ('q', 'qd', 'qdd')}
                     for _ in range(2))
    moves['qd'][50:60] = 0.0
    shape = effect.shapes(State(t, **moves))[0]
    followed = [name for name, other in others.items() if not np.array_equal(
        effect.columns(State(t, **moves), shape),
        effect.columns(State(t, **{**moves, name: other}), shape))]
    assert len(followed) == effect.variables
