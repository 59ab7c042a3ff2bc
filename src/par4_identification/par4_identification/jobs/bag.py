"""par4_bag: a bag in the contract's format from CSV, numpy or MATLAB logs of any machine."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from rich.console import Console

from par4_identification.logs.column_choice import (
    Choice,
    Scales,
    chosen_columns,
    motion_choice,
    named_otherwise,
)
from par4_identification.logs.measured_bag import write_measured
from par4_identification.logs.measured_files import measured_of_files
from par4_identification.logs.measured_torque import WITHOUT_GAIN
from par4_identification.logs.tables import Part
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import JOINT_NAMES, Axis, Robot, read_machine
from par4_sim.report.terminal import say

ALIKE = 0.01
"""Share by which two statements of one gain may differ."""


def make_bag(files: tuple[str, ...], columns: str, output: Path, robot: str | None,
             joints: str | None, array: str | None, rate: float | None,
             counts_per_turn: tuple[float, ...], motor_gain: tuple[float, ...],
             rated_torque: tuple[float, ...], between: tuple[float, float] | None, unwrap: bool,
             wraps_after: float | None, storage: str) -> None:
    """Make a bag of FILES: CSV, .npz or .mat, parts of one recording in order.

    Files with different columns and a time of the same name are put beside each other.

    Says what it read and what looks wrong; the other tools then read the bag.
    """
    choices = chosen_columns(columns)
    machine = None if robot is None else read_machine(robot)
    if 'torque' not in choices and isinstance(machine, Axis) and machine.gain is None:
        raise InputError(f'--columns: {WITHOUT_GAIN.format(machine.name)}')
    motion = motion_choice(choices)
    names = joint_names(machine, joints, len(motion.columns))
    if output.exists():
        raise InputError(f'{output}: exists already; give another path or remove it')
    start, end = between or (-float('inf'), float('inf'))
    if not start < end:
        raise InputError(f'--between {start:g} {end:g}: ends before it has begun; give the earlier '
                         f'time first')
    scales = Scales(counts_per_turn, scale_of('motor_gain', motor_gain, choices, machine),
                    scale_of('rated_torque', rated_torque, choices, machine))
    with Console(stderr=True).status('reading the files') as status:
        measured = measured_of_files(files, choices, scales,
                                     Part(array, rate, start, end, unwrap, wraps_after))
        kind = machine.kind if isinstance(machine, Axis) else 'revolute'
        if machine is not None and measured.kind != kind:
            turns, slides = 'a joint that turns', 'one that slides'
            found, own = (slides, turns) if measured.kind == 'linear' else (turns, slides)
            raise InputError(
                f'{motion.quantity} in {motion.unit} is of {found}, {robot} says {own}; mend kind '
                f'in the robot file, or --columns'
                + ('' if kind == 'revolute' else ': of an encoder on the motor give the way of a '
                   'count, such as position=2:0.5um'))
        write_measured(measured, names, output, storage, lambda share: status.update(
            f'writing {output}: {share:.0%}'))
    lifts = isinstance(machine, Axis) and machine.gravity != 'none'
    say(*measured.account(), *(f'look at this: {finding}' for finding in (
        *named_otherwise(choices), *measured.findings(lifts))),
        f'{output}: {len(measured.stamp)} samples of {", ".join(names)} '
        f'({", ".join(measured.values)})', whole=True)


def scale_of(name: Literal['motor_gain', 'rated_torque'], given: tuple[float, ...],
             choices: dict[str, Choice], machine: Robot | Axis | None) -> tuple[float, ...]:
    """Return a number of the machine that units of torques need: as given, or of the robot file.

    Raises:
        InputError: the two differ.
    """
    known = getattr(machine, name, None)
    if known is None or all(choice.meaning.scale != name for choice in choices.values()):
        return given
    if given and not np.allclose(given, known, rtol=ALIKE):
        assert isinstance(machine, Axis)
        ratio, gears = known / given[0], machine.gear_ratio
        behind = gears is not None and np.isclose(ratio, gears, rtol=ALIKE)
        unit = unit_on(machine, 'N m') + ('/A' if name == 'motor_gain' else '')
        raise InputError(
            f'--{name.replace("_", "-")} {given[0]:g}: the robot file says {known:g} {unit} '
            + ('at the joint, behind its gear' if behind else
               f'at the joint, {ratio:.3g} times as much')
            + '; leave the option out, or mend the file')
    return given or (known,)


def joint_names(machine: Robot | Axis | None, joints: str | None, count: int) -> tuple[str, ...]:
    """Return the names of `count` joints.

    Raises:
        InputError: both or neither given, or names of another number of joints.
    """
    if machine is not None and joints is not None:
        raise InputError('--joints and --robot both name the joints; give one of them')
    if machine is not None:
        names, source = machine.joint_names, '--robot'
    elif joints is not None:
        names, source = tuple(name.strip() for name in joints.split(',')), '--joints'
    elif count == LEGS:
        names, source = JOINT_NAMES, 'a Par4'
    else:
        raise InputError(f'no names for {count} columns of positions: name the joints by --joints '
                         f'as in the robot.yaml, or give --robot')
    if len(names) != count or len(set(names)) < count or not all(names):
        raise InputError(f'{source}: {len(names)} joints ({", ".join(names)}), the positions have '
                         f'{count} columns; give one column a joint, each with its own name')
    return names
