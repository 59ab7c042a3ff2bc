"""A cross-validation in words, and `validation.json`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from par4_identification.fitting.validation import LARGEST_ERROR, Errors, Validation
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.outcome import (
    FLOOR_EXCESS,
    LOUD,
    data_remark,
    duration,
    over_joints,
)
from par4_identification.reports.outcome.results import data_of_logs
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome, Remark, note
from par4_sim.report.results import plain
from par4_sim.report.words import number, percent, torque_name


def outcome_of_validation(validation: Validation, floor: np.ndarray, machine: Robot | Axis,
                          log: Log, seen: bool) -> Outcome:
    """Return how well a model calculates the torque of a log.

    Args:
        validation: errors.
        floor: noise floor of each joint, (J,), N m.
        machine: that was measured.
        log: the data.
        seen: whether the model was identified from this log.
    """
    unit, torque = unit_on(machine, 'N m'), torque_name(machine)
    if not validation.moving.any():
        return Outcome('Nothing is validated: no joint moves in this bag.', 'bad', (
            Remark(False, 'A resting joint does not tell its friction.',
                   'Give a bag in which the joints move.'), data_remark([log])))
    total = total_errors(validation, validation.moving)
    moving = validation.moving.any(axis=0)
    rms, noise = over_joints(validation.without_standstill.rms[moving]), over_joints(floor[moving])
    remarks = (
        Remark(False, 'This very bag took part in making the model: this is no cross-validation.',
               'Give a bag of another motion.') if seen else
        Remark(True, 'The model does not name this bag among those it was identified from.'),
        _floor_remark(rms / max(noise, 1e-12)),
        note(f'Of the rows {percent(1.0 - float(validation.moving.mean()))} are near standstill, '
             f'where friction holds whatever is needed; they count apart.'),
        data_remark([log]))
    sentence = (
        f'Over {number(duration([log]), 2)} s of recording the model calculates the {torque} to '
        f'{percent(total["relative_error"])} while the joints move: it leaves {number(rms, 2)} '
        f'{unit} rms, the noise floor being {number(noise, 2)} {unit}')
    if seen:
        return Outcome(f'{sentence}; but this bag took part in making the model.', 'fair', remarks)
    if rms <= FLOOR_EXCESS * noise:
        if total['relative_error'] < LOUD:
            return Outcome(f'{sentence}. The model holds.', 'good', remarks)
        return Outcome(f'{sentence}. The model holds, but whatever is smaller than so much noise '
                       f'stays hidden.', 'fair', remarks)
    if total['relative_error'] <= LARGEST_ERROR:
        return Outcome(f'{sentence}. It describes the machine, but not all that it does.', 'fair',
                       remarks)
    return Outcome(f'{sentence}. It does not describe this machine.', 'bad', (Remark(
        False, f'More than {percent(LARGEST_ERROR)} of the {torque} is not explained.',
        'Check that robot, model and bag belong together: order, sign, zero and gain of the '
        'joints.'), *remarks))


def _floor_remark(excess: float) -> Remark:
    size = f'While the joints move the residual is {number(excess, 2)} times the noise floor'
    if excess <= FLOOR_EXCESS:
        return Remark(True, f'{size}: hardly more than noise is left.')
    return Remark(False, f'{size}.', 'Run par4_diagnose on this bag and those of the '
                                     'identification: it looks for the cause.')


def total_errors(validation: Validation, rows: np.ndarray) -> dict[str, float]:
    """Return rms (N m), relative_error and r2 over all joints together, over `rows` (m, J)."""
    measured = np.where(rows, validation.measured, 0.0)
    residual = np.where(rows, validation.measured - validation.calculated, 0.0)
    count = np.maximum(rows.sum(axis=0), 1)
    square, power = float(np.sum(residual ** 2)), float(np.sum(measured ** 2))
    variance = power - float(np.sum(measured.sum(axis=0) ** 2 / count))
    return {'rms': math.sqrt(square / rows.sum()) if rows.any() else math.nan,
            'relative_error': math.sqrt(square / power) if power > 0.0 else math.nan,
            'r2': 1.0 - square / variance if variance > 0.0 else math.nan}


def validation_json(validation: Validation, log: Log) -> dict[str, Any]:
    """Return `validation.json`; null where no row counts."""
    return plain({
        'schema': 'par4/validation/1', **errors_by_joint(validation.everything),
        'overall': total_errors(validation, np.ones_like(validation.moving)),
        'without_standstill': {**errors_by_joint(validation.without_standstill),
                               'overall': total_errors(validation, validation.moving)},
        'data': {'bags': data_of_logs([log])}})


def errors_by_joint(errors: Errors) -> dict[str, np.ndarray]:
    """Return rms, relative_error and r2 of each joint, (J,); NaN where no row counts."""
    return {name: np.where(errors.rows > 0, getattr(errors, name), np.nan)
            for name in ('rms', 'relative_error', 'r2')}
