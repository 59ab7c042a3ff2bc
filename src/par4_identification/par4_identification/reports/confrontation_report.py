"""What the report shows of the confrontation with the simulation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from par4_identification.confrontation.confrontation import Confrontation, Differences, Unsimulated
from par4_identification.reports.names import Names
from par4_identification.reports.outcome.confrontation import MILLI, confrontation_in_words
from par4_identification.reports.outcome.outcome import over_joints
from par4_identification.reports.time_plots import measured_and_simulated
from par4_sim.report.words import number

Rows = list[tuple[str, list[str], str]]


def confrontation_cells(confrontation: Confrontation | Unsimulated | None, names: Names
                        ) -> dict[str, Any] | None:
    """Return words, pictures and the table of rms; None where nothing was simulated."""
    if confrontation is None:
        return None
    if isinstance(confrontation, Unsimulated):
        return {'words': f'The simulation could not be confronted: {confrontation.reason}.',
                'torque': '', 'motion': '', 'rows': []}
    same = confrontation.same
    pictures = {'torque': measured_and_simulated(
        confrontation.t, confrontation.measured, None if same else confrontation.baseline,
        confrontation.extended, confrontation.valid, names), 'motion': ''}
    rows = _rows('torque', confrontation.torque, names.torque_unit, same)
    if confrontation.motion is not None and confrontation.deviations is not None:
        measured, before, after = (MILLI * values for values in confrontation.deviations)
        t = np.linspace(confrontation.start, confrontation.end, len(measured))
        pictures['motion'] = measured_and_simulated(
            t, measured, None if same else before, after, np.ones_like(measured, dtype=bool),
            replace(names, torque='deviation', torque_unit='mrad'))
        rows += _rows('motion', confrontation.motion, 'mrad', same, MILLI)
    if confrontation.tracking is not None:
        rows += [(f'tracking, feedforward from the {name} model', _cells(rms, MILLI), 'mrad')
                 for name, rms in zip(('old', 'extended'), confrontation.tracking, strict=True)]
    return {'words': confrontation_in_words(confrontation), 'rows': rows, **pictures}


def _rows(quantity: str, differences: Differences, unit: str, same: bool, factor: float = 1.0
          ) -> Rows:
    parts = [('old model', differences.baseline), ('extended model', differences.extended)]
    if same:
        parts = [('model', differences.extended)]
    return [(f'{quantity}, {name}', _cells(rms, factor), unit)
            for name, rms in (*parts, ('noise floor', differences.floor))]


def _cells(rms: np.ndarray, factor: float) -> list[str]:
    return [number(float(value)) for value in factor * rms] + [number(factor * over_joints(rms))]
