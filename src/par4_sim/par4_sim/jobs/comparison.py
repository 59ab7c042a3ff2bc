"""What a command was asked to compare: controllers with models on a simulated machine."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from par4_dynamics.model import Model
from par4_kinematics.motion import Motion
from par4_kinematics.motion_file import NAMED_MOTIONS
from par4_kinematics.paths import refuse_unwritable
from par4_kinematics.robot import Robot, read_robot
from par4_sim.choices import PERIOD
from par4_sim.jobs.motion import cycles_asked, motion_asked
from par4_sim.machines.machine_effects import read_true_model
from par4_sim.tracking.case import Plan, models_named


@dataclass(frozen=True)
class ComparisonRequest:
    """What a command was asked to compare, read.

    Attributes:
        robot: geometry, drives, limits.
        machine: as it truly is.
        motion: within the robot's limits.
        controllers: of CONTROLLERS.
        models: by what to call them; None for none.
        cycles: how often the motion repeats itself.
        fidelity: of the plant.
        learning_cycles: how often a learning controller does the motion.
        output: folder.
        options: as they were given, for the provenance.
    """

    robot: Robot
    machine: Model
    motion: Motion
    controllers: tuple[str, ...]
    models: dict[str, Model | None]
    cycles: int
    fidelity: str
    learning_cycles: int
    output: Path
    options: dict[str, Any]

    def plan(self, motion: Motion, **changes: Any) -> Plan:
        """Return the plan of a motion; `changes` are further fields of `Plan`."""
        return Plan(self.robot, self.machine, motion, fidelity=self.fidelity,
                    learning_cycles=self.learning_cycles, **changes)


def read_asked(motion: str, robot: str, machine: str, controller: tuple[str, ...],
               feedforward: tuple[str, ...], output: Path, fidelity: str, learning_cycles: int,
               **played: Any) -> ComparisonRequest:
    """Return what the options of `comparison_options` ask for.

    Raises:
        InputError: a file that cannot be read, options of another motion, limits of the robot
            not kept, or an output that cannot be written.
        UnreachableError: a sample of the motion that the mechanism cannot take.
    """
    asked = read_robot(robot)
    truth = read_true_model(machine, asked)
    models = models_named(feedforward, asked)
    moved = motion_asked(motion, asked, **played)
    refuse_unwritable(output)
    cycles = cycles_asked(motion, asked, played['duration'], played['period'], played['cycles'])
    if motion in NAMED_MOTIONS and played['period'] is None:
        played['period'] = PERIOD
    options = {'motion': motion, 'machine': machine, 'controller': list(controller),
               'feedforward': list(feedforward), 'fidelity': fidelity,
               'learning_cycles': learning_cycles, **played}
    return ComparisonRequest(asked, truth, moved, controller, models, cycles, fidelity,
                             learning_cycles, output, options)
