"""The confrontation with the simulation in words, and `simulation` of `diagnosis.json`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from par4_identification.confrontation.confrontation import Confrontation, Differences, Unsimulated
from par4_identification.reports.outcome.outcome import over_joints
from par4_sim.report.outcome import Remark
from par4_sim.report.results import plain
from par4_sim.report.words import number

MILLI = 1e3
"""rad to mrad, as people read them."""


def remarks_of_confrontation(confrontation: Confrontation | Unsimulated | None
                             ) -> tuple[Remark, ...]:
    """Return what the simulation says of the models; nothing without one."""
    if confrontation is None:
        return ()
    if isinstance(confrontation, Unsimulated):
        found, _, advice = confrontation.reason.partition('; ')
        return (Remark(False, f'The simulation could not be confronted: {found}.',
                       f'{advice[:1].upper()}{advice[1:]}.' if advice else ''),)
    remarks = [Remark(True, f'Run through pybullet along the {confrontation.followed}, the '
                      f'simulated torque {_change(confrontation, confrontation.torque, "N m")}.')]
    if confrontation.motion is not None:
        remarks.append(Remark(True, 'The simulated motion '
                              f'{_change(confrontation, confrontation.motion, "mrad", MILLI)}.'))
    if confrontation.tracking is not None:
        before, after = (f'{number(MILLI * over_joints(rms), 2)}'
                         for rms in confrontation.tracking)
        remarks.append(Remark(
            True, f'A simulated machine with what was found follows within {after} mrad rms with '
            f'feedforward from the extended model, {before} mrad from the old one.'))
    if confrontation.drives_unlike:
        remarks.append(Remark(
            False, f'The motion was not compared: {confrontation.why}.',
            'Give the gains and limits of the machine in drives of the robot file, and record '
            'feedforward_torque where there is one.'))
    return tuple(remarks)


def confrontation_in_words(confrontation: Confrontation) -> str:
    """Return what was simulated, and how."""
    stretch = (f'{number(confrontation.end - confrontation.start, 2)} s of '
               f'{Path(confrontation.log).name}, from {number(confrontation.start)} s on, were run '
               f'through the pybullet plant ({confrontation.fidelity})')
    if confrontation.why:
        return (f'{stretch}. Its drives followed the measured motion, helped by the feedforward of '
                f'the model that was simulated, because {confrontation.why}; so only the torque is '
                f'compared.')
    return f'{stretch}. Its drives, those of the robot file, followed the reference of the bag.'


def simulation_json(confrontation: Confrontation | Unsimulated | None) -> dict[str, Any] | None:
    """Return the field `simulation` of `diagnosis.json`; null where nothing was simulated."""
    if confrontation is None:
        return None
    if isinstance(confrontation, Unsimulated):
        return {'failed': confrontation.reason}
    tracking = confrontation.tracking
    return plain({
        'bag': confrontation.log, 'start': confrontation.start, 'end': confrontation.end,
        'fidelity': confrontation.fidelity, 'followed': confrontation.followed,
        'why': confrontation.why or None, 'torque': _differences_json(confrontation.torque),
        'motion': confrontation.motion and _differences_json(confrontation.motion),
        'tracking': tracking and {'baseline_rms': tracking[0], 'extended_rms': tracking[1]}})


def _differences_json(rms: Differences) -> dict[str, Any]:
    return {'baseline_rms': rms.baseline, 'extended_rms': rms.extended, 'floor_rms': rms.floor}


def _change(confrontation: Confrontation, differences: Differences, unit: str, factor: float = 1.0
            ) -> str:
    before, after, floor = (number(factor * over_joints(rms), 2) for rms in (
        differences.baseline, differences.extended, differences.floor))
    if confrontation.same:
        return f'differs from the measured one by {after} {unit} rms, the noise being {floor}'
    return (f'differs from the measured one by {after} {unit} rms with the extended model, by '
            f'{before} with the old one, the noise being {floor}')
