"""par4_simplification: the paper's validation of (20) against the whole mechanism."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from rich.console import Console

from par4_dynamics.model_from_file import read_file_and_model
from par4_identification.fitting.simplification_cost import (
    adept_of,
    rigid_model,
    study_simplification,
)
from par4_identification.reports.outcome.results import provenance
from par4_identification.reports.outcome.simplification import (
    outcome_of_simplification,
    simplification_json,
)
from par4_kinematics.motion_file import named_motion
from par4_kinematics.paths import refuse_unwritable
from par4_kinematics.robot import read_robot
from par4_sim.report.results import write_results
from par4_sim.report.terminal import say


def simplify(robot: str, model: str, output: Path, motion: str | None,
             fidelity: Literal['accurate', 'fast']) -> None:
    """Measure what equation (20) leaves out, by imposed displacement in pybullet (Fig. 6)."""
    machine = read_robot(robot)
    rigid = rigid_model(machine, read_file_and_model(model, machine)[0])
    imposed = (adept_of(machine, machine.limits.workspace.theta) if motion is None else
               named_motion(motion, machine))
    refuse_unwritable(output)
    options = {'model': model, 'motion': motion, 'fidelity': fidelity}
    origin = provenance('par4_simplification', machine, (), options)
    with Console(stderr=True).status('preparing the mechanism') as status:
        study = study_simplification(machine, rigid, imposed, fidelity, progress=status.update)
        outcome = outcome_of_simplification(study, imposed)
        status.update('drawing the report')
        # the plot library is slow to load, and some homes make it talk on stderr
        from par4_identification.reports.simplification_report import report_of_simplification
        write_results(output, {
            'simplification.json': simplification_json(study, machine, imposed, fidelity, origin),
            'report.html': report_of_simplification(study, outcome, machine, imposed, origin)})
    say(outcome.sentence)
    say(f'results and report: {output}', whole=True)
