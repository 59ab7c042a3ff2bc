"""The report of what the simplifications of (20) cost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from par4_identification.fitting.simplification_cost import ALL, NOTHING, PARTS, Simplification
from par4_identification.reports.outcome.outcome import over_joints
from par4_identification.reports.outcome.simplification import share_in_words
from par4_identification.reports.page import joint_cells, page_of, picture_names
from par4_identification.reports.time_plots import differences_over_time, torque_of_mechanism
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_sim.report.outcome import Outcome
from par4_sim.report.words import number, percent, typeset


def report_of_simplification(study: Simplification, outcome: Outcome, robot: Robot, motion: Motion,
                             provenance: dict[str, Any]) -> str:
    """Return the report of what the simplifications of (20) cost.

    Args:
        study: the experiment.
        outcome: in words.
        robot: that was moved.
        motion: that was imposed.
        provenance: of the run.
    """
    names = picture_names(robot)
    differences = {variant: torque - study.simplified for variant, torque in study.torques.items()}
    noise = differences.pop(NOTHING)
    labels = {variant: 'all parts' if variant == ALL else f'{variant} alone'
              for variant in differences}
    return page_of(
        'simplification.html', robot, (), outcome,
        f'Simplifications of (20) on {robot.name}, motion {motion.name}', 'What it rests on',
        provenance,
        over_time=torque_of_mechanism(study.t, study.torques[ALL], study.simplified, names),
        parts_over_time=differences_over_time(
            study.t, [(labels[name], values) for name, values in differences.items()], noise,
            names),
        parts=[_part_cells(study, variant) for variant in (*study.parts, ALL, NOTHING)],
        per_joint=_simplification_rows(study, labels | {NOTHING: 'noise'}, names.torque_unit),
        **_simplification_table(study))


def _part_cells(study: Simplification, variant: str) -> dict[str, str]:
    found, is_part = study.difference(variant), variant in study.parts
    return {
        'name': variant if is_part else {ALL: 'all parts', NOTHING: 'none: noise'}[variant],
        'value': number(study.parts[variant]) if is_part else '',
        'unit': typeset('kg m2' if PARTS.get(variant) == 'theta_inertia' else 'kg')
                if is_part else '',
        'of_rms': percent(found.overall_of_rms, 3), 'of_peak': percent(found.overall_of_peak, 3),
        'share': share_in_words(study.share(variant)) if is_part else ''}


def _simplification_rows(study: Simplification, labels: dict[str, str], unit: str
                         ) -> list[tuple[str, list[str], str]]:
    torque, whole = study.torques[ALL], study.difference(ALL)
    rms, peak = np.sqrt(np.mean(torque ** 2, axis=0)), np.abs(torque).max(axis=0)
    rows = [('rms torque', joint_cells(rms, over_joints(rms), number), unit),
            ('peak torque', joint_cells(peak, peak.max(), number), unit),
            ('rms error', joint_cells(whole.rms, over_joints(whole.rms), number), unit),
            ('largest error', joint_cells(whole.largest, whole.largest.max(), number), unit)]
    for title, joints, overall in (('rms error / rms torque', 'of_rms', 'overall_of_rms'),
                                   ('largest error / peak torque', 'of_peak', 'overall_of_peak')):
        for variant, label in labels.items():
            found = study.difference(variant)
            rows.append((f'{title}, {label}', joint_cells(
                getattr(found, joints), getattr(found, overall),
                lambda value: percent(value, 3)), ''))
    return rows


def _simplification_table(study: Simplification) -> dict[str, Any]:
    masses = sorted({cell.rod_mass for cell in study.table})
    rows: dict[tuple[str, float], list[str]] = {}
    for cell in study.table:  # rod masses increase within a row
        rows.setdefault((cell.direction, cell.theta_range), []).append(
            f'{percent(cell.of_rms)}, {percent(cell.of_peak)}' if math.isfinite(cell.of_rms)
            else 'n/a')
    return {'masses': [f'{1000.0 * mass:.4g} g' for mass in masses],
            'table': [{'direction': direction, 'cells': cells,
                       'theta': f'± {number(math.degrees(theta))}°' if theta else 'fixed'}
                      for (direction, theta), cells in rows.items()]}
