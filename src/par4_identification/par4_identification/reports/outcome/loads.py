"""What bags with payloads tell beside the base parameters: drive gains, or the payload itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from par4_dynamics.model_file import RigidBody
from par4_identification.gains.known_payload import gains_of_payloads
from par4_identification.gains.unknown_payload import payload_of_runs
from par4_identification.logs.log import Log
from par4_identification.logs.stretches import in_pieces
from par4_identification.reports.outcome.drive_gain import gains_json, gains_remarks
from par4_identification.reports.outcome.payload import payload_json, payload_remark
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.rows import runs_of_logs
from par4_identification.signals.run import Run
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Remark


def known_payloads(runs: Sequence[Run], masses: Mapping[str, float], machine: Robot | Axis,
                   rigid_body: RigidBody) -> tuple[tuple[Remark, ...], dict[str, Any]]:
    """Return the drive gains in words and as fields of `identification.json`.

    Nothing without payloads; no field where bags or motions do not tell the gains.
    """
    if not any(masses.values()):
        return (), {}
    try:
        gains = gains_of_payloads(runs, masses, machine, rigid_body)
    except InputError as error:
        return (Remark(False, f'The known payload does not tell the drive gains: {error}.'),), {}
    return (gains_remarks(gains, machine, 'By the known payload',
                          'the payload is in kg, the bags that carried it are named and the '
                          'voltages are in V'),
            {'drive_gain': gains_json(gains)})


def weighed_payload(runs: Sequence[Run], loaded: Sequence[Log], machine: Robot | Axis,
                    rigid_body: RigidBody, conditioning: Conditioning
                    ) -> tuple[tuple[Remark, ...], dict[str, Any]]:
    """Return the payload in words and as fields of `identification.json`; nothing without one.

    Args:
        runs: of the bags without it.
        loaded: bags with it.
        machine: that was recorded.
        rigid_body: 'paper' or 'full'.
        conditioning: filters and rates, those of `runs`.

    Raises:
        InputError: motions that do not tell the masses.
    """
    if not loaded:
        return (), {}
    names = [log.name for log in loaded]
    with_it = runs_of_logs([in_pieces(log) for log in loaded], machine, conditioning)
    payload = payload_of_runs([*runs, *with_it], names, machine, rigid_body)
    return (payload_remark(payload, names),), {'payload': payload_json(payload, names)}
