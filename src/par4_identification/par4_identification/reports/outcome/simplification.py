"""The cost of the simplifications of (20) in words, and `simplification.json`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from par4_identification.fitting.simplification_cost import (
    ALL,
    NOTHING,
    PARTS,
    Difference,
    Simplification,
)
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_sim.report.outcome import Outcome, Remark, Standing, note
from par4_sim.report.results import plain
from par4_sim.report.words import listed, number, percent

ENOUGH = 10.0
"""Times its noise that a difference must be for the experiment to show it."""
LOOSE = 1e-2
"""Share of a difference by which its parts may miss it."""


def outcome_of_simplification(study: Simplification, motion: Motion) -> Outcome:
    """Return what the simplifications of (20) cost on a motion."""
    whole, noise = study.difference(ALL), study.difference(NOTHING)
    factor = whole.overall_of_rms / max(noise.overall_of_rms, 1e-30)
    shares = [f'{share_in_words(study.share(part))} of it comes from the {part}' if first else
              f'{share_in_words(study.share(part))} from the {part}'
              for first, part in zip((True, False, False), study.parts, strict=False)]
    end = listed(shares) if factor >= ENOUGH else (
        'that is hardly more than the noise of the experiment')
    sentence = (
        f'The simplifications of (20) cost {percent(whole.overall_of_rms)} of the rms torque and '
        f'at most {percent(whole.overall_of_peak)} of the peak torque on the motion '
        f'{motion.name}; {end}.')
    loose, formula = study.additivity_error, study.formula_error / whole.overall_of_peak
    remarks = (
        Remark(factor >= ENOUGH,
               f'With the mass of rods and bars at their ends pybullet needs the torque of (20) to '
               f'{percent(noise.overall_of_rms)} rms and {percent(noise.overall_of_peak)} of the '
               f'peak: that is the noise of the experiment, the simplifications cost '
               f'{number(factor, 2)} times as much.',
               '' if factor >= ENOUGH else 'Use a motion that is smoother or faster.'),
        Remark(loose <= LOOSE,
               f'The parts alone add up to the whole within {percent(loose)} of it.'),
        Remark(formula <= 1.0 / ENOUGH,
               f'The formula of the whole mechanism agrees with pybullet within '
               f'{percent(study.formula_error)} of the peak torque on every mechanism moved here; '
               f'the table is calculated with it.'),
        Remark(True, f'The joints are where the motion wants them within '
                     f'{number(study.position_error, 2)} rad; the loops open by '
                     f'{number(study.opening, 2)} m.'),
        note('Friction and effects take no part: they would be the same on both sides.'))
    standing: Standing = 'good' if all(remark.good for remark in remarks) else (
        'fair' if factor > 1.0 else 'bad')
    return Outcome(sentence, standing, remarks)


def share_in_words(share: float) -> str:
    """Return a share in percent, to a tenth of a percent: below is noise."""
    return percent(round(share, 3) + 0.0)  # no -0


def simplification_json(study: Simplification, robot: Robot, motion: Motion, fidelity: str,
                        provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return `simplification.json`; null in the table where the robot's limits forbid a motion."""
    return plain({
        'schema': 'par4/simplification/1', 'robot': robot.name,
        'motion': {'name': motion.name, 'duration': motion.duration},
        'fidelity': fidelity,
        'error': {**_json_of(study.difference(ALL)),
                  'rms_torque': np.sqrt(np.mean(study.torques[ALL] ** 2, axis=0)),
                  'peak_torque': np.abs(study.torques[ALL]).max(axis=0)},
        'parts': {PARTS[part]: {'value': value, 'share': study.share(part),
                                'error': _json_of(study.difference(part))}
                  for part, value in study.parts.items()},
        'noise': _json_of(study.difference(NOTHING)),
        'additivity_error': study.additivity_error, 'formula_error': study.formula_error,
        'position_error': study.position_error, 'loop_opening': study.opening,
        'table': [asdict(cell) for cell in study.table], 'provenance': provenance})


def _json_of(difference: Difference) -> dict[str, Any]:
    return {'rms': difference.rms, 'largest': difference.largest,
            'of_rms': difference.of_rms, 'of_peak': difference.of_peak,
            'overall': {'of_rms': difference.overall_of_rms,
                        'of_peak': difference.overall_of_peak}}
