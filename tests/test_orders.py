"""Orders of periodic torques between those that are tried."""

from __future__ import annotations

import numpy as np
import pytest
from axes import axis
from planned import evidence_of, log_of

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.search.candidates import Candidates
from par4_identification.diagnosis.search.orders import _Orders, best_orders
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.shapes import shapes_of

T = np.arange(0.0, 20.0, 1e-3)
RIGID = ModelFile(schema='par4/model/1', parameters={
    'actuator_inertia': {'value': 0.2}, 'coulomb_friction': {'value': 1.5},
    'viscous_friction': {'value': 0.8}})


@pytest.mark.parametrize(('kind', 'travel', 'order'), [
    ('revolute', 3.0 * np.pi, 14.3), ('linear', 0.2, 2.0 * np.pi / 0.0137)])
def test_the_place_of_an_order_is_sought_where_the_order_may_be_worth_it(monkeypatch, kind, travel,
                                                                       order):
    """The look that finds no further one ends with the orders that are tried."""
    moved = []
    move = _Orders._moved
    monkeypatch.setattr(_Orders, '_moved', lambda *asked: moved.append(asked) or move(*asked))
    machine, cogging = axis(kind=kind), CATALOGUE['cogging']
    q = travel * (np.sin(0.5 * T) + 0.3 * np.sin(1.3 * T + 0.4))
    log = log_of(machine, T, q[:, None], 0.3 * np.sin(order * q)[:, None], 3)
    evidence = evidence_of(log, machine, build_model(machine, RIGID))
    shape, _ = best_orders(cogging, shapes_of(evidence.observations, cogging),
                           project(evidence, ()), Rules())
    assert shape['periods'] == pytest.approx(order, rel=1e-3)
    assert len(moved) == 1


def test_orders_that_were_given_up_are_sought_where_less_is_wanted():
    machine, cogging = axis(), CATALOGUE['cogging']
    q = 3.0 * np.pi * (np.sin(0.5 * T) + 0.3 * np.sin(1.3 * T + 0.4))
    log = log_of(machine, T, q[:, None], 0.3 * np.sin(14.0 * q)[:, None], 3)
    evidence = evidence_of(log, machine, build_model(machine, RIGID))
    candidates = Candidates({'cogging': cogging}, evidence, Rules())
    projection = project(evidence, ())
    assert candidates.best(cogging, projection, 1e9) is None
    found = candidates.best(cogging, projection, 1.0)
    assert found.hypothesis.shape == {'periods': 14.0}
    assert candidates.best(cogging, projection, 1e9) is found
