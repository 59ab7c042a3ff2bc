"""What the report of a diagnosis shows of one cause: its values and its signature."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from par4_dynamics.model_from_file import torque_model
from par4_dynamics.parameters import Parameter, parts_of_orders
from par4_identification.diagnosis.verdict.answer import Cause, Diagnosis
from par4_identification.reports.names import Names
from par4_identification.reports.outcome.causes import phrase_of_cause, told_from_zero
from par4_identification.reports.residual_plots import signature
from par4_kinematics.machine_units import parameter_unit, unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.words import (
    in_words,
    joint_labels,
    listed,
    number,
    percent,
    typeset,
    with_std,
)

FOLDED = 9.0
"""Periods in the range of a joint above which a periodic signature is drawn over one period."""
MOST_PARTS = 30
"""Of the lowest order's period that the common period may have, as waves of 7 and 36 share 1."""
DRIFT = 1.0
"""rad by which a wave may be off at one end of the range where it is right at the other."""


def cause_cells(diagnosis: Diagnosis, index: int, machine: Robot | Axis, names: Names
                 ) -> dict[str, Any]:
    cause = diagnosis.causes[index]
    heading = phrase_of_cause(cause, machine)
    image, abscissa = _signature_of_cause(diagnosis, index, machine, names)
    return {
        'heading': heading, 'name': in_words(cause.effect.name), 'signature': image,
        'abscissa': abscissa.rsplit(',', 1)[0],
        'parameters': [parameter_cells(cause, parameter.name, machine)
                       for parameter in cause.effect.parameters],
        'gain': percent(cause.gain.share),
        'interval': f'{percent(cause.gain.low)} to {percent(cause.gain.high)}',
        'p_value': f'{cause.p_value:.0e}' if cause.p_value > 1e-12 else '< 1e-12',
        'visible': percent(cause.visible_fraction), 'margin': number(cause.margin, 3),
        'rival': 'no cause' if cause.rival is None else in_words(cause.rival),
        'twins': listed([in_words(name) for name in cause.twins]) if cause.twins else ''}


def parameter_cells(cause: Cause, name: str, machine: Robot | Axis) -> dict[str, Any]:
    """Return a line of values with standard deviations: those of the machine or one a joint.

    A size that the data do not tell from zero is no finding: only its deviation is printed.
    """
    parameter = cause.parameters[name]
    shape = [item for item in cause.effect.parameters if item.per_order and item.is_shape]
    own = next(item for item in cause.effect.parameters if item.name == name)
    series = own.per_order and not shape  # its terms are no orders
    if series or (shape and isinstance(cause.parameters[shape[0].name].value, tuple)):
        return _order_cells(parameter, name, machine)
    scope, is_size = own.scope, own.is_size
    values, stds = (np.atleast_1d(np.asarray(part, dtype=float))
                    for part in (parameter.value, parameter.std))
    cells = [f'0 ± {number(float(std), 2)}' if is_size and not told else
             ' ± '.join(with_std(float(value), float(std)))
             for value, std, told in zip(values, stds, told_from_zero(values, stds), strict=True)]
    joints = len(joint_labels(machine))
    if scope == 'machine':
        cells = [', '.join(cells)]
    alike = len(set(cells)) == 1 and len(cause.joints) == joints
    common = joints > 1 and (len(cells) == 1 or alike)
    if not common:
        found = dict(zip(cause.joints, cells, strict=True))
        cells = [found.get(joint, '') for joint in range(joints)]
    return {'name': in_words(name), 'cells': cells[:1] if common else cells, 'common': common,
            'unit': typeset(parameter_unit(machine, name, parameter.unit))}


def _order_cells(parameter: Parameter, name: str, machine: Robot | Axis) -> dict[str, Any]:
    """Return a line of values of several orders, each with those of its joints."""
    orders = [' / '.join(' ± '.join(with_std(float(value), float(std))) for value, std in zip(
        np.atleast_1d(own), np.atleast_1d(error), strict=True))
        for own, error in zip(parts_of_orders(parameter.value), parts_of_orders(parameter.std),
                              strict=True)]
    return {'name': in_words(name), 'cells': [', '.join(orders)], 'common': True,
            'unit': typeset(parameter_unit(machine, name, parameter.unit))}


def _signature_of_cause(diagnosis: Diagnosis, index: int, machine: Robot | Axis, names: Names
                        ) -> tuple[str, str]:
    """Return the signature plot of a cause and the label of its abscissa."""
    cause, holdout = diagnosis.causes[index], diagnosis.holdout
    model = torque_model(machine, diagnosis.extended_model, diagnosis.effects)
    added = model.effects[len(diagnosis.refitted_model.effects):]
    places, own, label = [], [], ''
    for run in holdout.runs:
        state = replace(run.state, nominal=model.nominal(run.state))
        view = cause.effect.signature(state)
        label = view.label
        places.append(run.rows(np.ascontiguousarray(view.abscissa)))
        own.append(run.rows(added[index].torque(state)))
    quantity, _, unit = label.rpartition(', ')
    unit = typeset(unit_on(machine, unit))
    label = f'{quantity}, {unit}'
    period = _period(cause, places)
    if period:
        places = [np.mod(place, period) for place in places]
        sliding = isinstance(machine, Axis) and machine.kind == 'linear'
        one = (f'a pitch of {number(1e3 * period, 3)} mm' if sliding else
               f'one of {number(2.0 * np.pi / period, 4)} periods a turn')
        label = f'{quantity} within {one}, {unit}'
    drawn: dict[str, list[np.ndarray]] = {
        name: [] for name in ('place', 'before', 'alone', 'own')}
    for joint in cause.joints:
        masks = [run.valid[:, joint] for run in holdout.runs]
        for name, parts in (('place', places), ('before', holdout.baseline), ('own', own),
                            ('alone', [new + torque for new, torque in
                                       zip(holdout.extended, own, strict=True)])):
            drawn[name].append(np.concatenate([part[mask, joint] for part, mask in
                                               zip(parts, masks, strict=True)]))
    image = signature(drawn['place'], label, drawn['before'], drawn['alone'], drawn['own'],
                      [names.joints[joint] for joint in cause.joints], names)
    return image, label


def _period(cause: Cause, places: Sequence[np.ndarray]) -> float | None:
    """Return the period over which a signature of many periods is folded, rad, else None."""
    rates = [np.atleast_1d(cause.parameters[item.name].value) for item in cause.effect.parameters
             if item.unit == '1/turn']
    if not rates:
        return None
    span = float(np.ptp(np.concatenate(places)))
    common = common_order(rates[0], span)
    return None if common is None or span * common <= 2.0 * np.pi * FOLDED else (
        2.0 * np.pi / common)


def common_order(orders: np.ndarray, span: float) -> float | None:
    """Return the order after whose period all orders (k,) return; None if there is none.

    Orders of a motor behind a gear, or on a slide, are no whole numbers. Waves that are taken for
    multiples of the common one stay within `DRIFT` of them over the whole span of places, rad.
    """
    lowest = float(np.min(orders))
    ratios = [Fraction(float(order) / lowest).limit_denominator(MOST_PARTS) for order in orders]
    if any(abs(order - lowest * float(ratio)) * span > DRIFT
           for order, ratio in zip(orders, ratios)):
        return None
    return lowest / math.lcm(*(ratio.denominator for ratio in ratios))
