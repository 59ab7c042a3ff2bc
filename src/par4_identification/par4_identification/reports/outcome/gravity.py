"""A load that the file of an axis denies and its data tell, in words."""

from __future__ import annotations

from collections.abc import Sequence

from par4_identification.fitting.axis_gravity import unsaid_load
from par4_identification.logs.log import Log
from par4_identification.signals.conditioning import Conditioning
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Remark
from par4_sim.report.words import number, percent


def gravity_remarks(machine: Robot | Axis, logs: Sequence[Log], conditioning: Conditioning
                    ) -> tuple[Remark, ...]:
    """Return that an axis may hang, where its file says that it does not; else nothing."""
    found = unsaid_load(machine, logs, conditioning)
    if found is None or not isinstance(machine, Axis):
        return ()
    size, explained = found
    slides = machine.kind == 'linear'
    what = ('A constant force' if slides else 'A torque a sin q + b cos q') + (
        f' of {"" if slides else "up to "}{number(size, 3)} {unit_on(machine, "N m")}')
    says = 'says' if 'gravity' in machine.model_fields_set else 'does not speak of it, which means'
    return (Remark(
        False, f'{what}, as of a weight, explains {percent(explained)} of what inertia and '
               f'friction leave (in squares); the robot file {says} gravity: none.',
        f'If the axis {"slides up and down" if slides else "turns in a vertical plane"}, write '
        'gravity: vertical into it; with gravity: unknown the data tell.'),)
