"""The files of a run: what is in them besides the result, and how none is ever half there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from par4_dynamics.model_file import ModelFile
from par4_dynamics.parameters import Parameter
from par4_identification.logs.bag_hash import bag_sha256
from par4_identification.logs.log import Log
from par4_kinematics.machine_units import parameter_unit
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.results import origin


def data_of_logs(logs: Sequence[Log]) -> list[dict[str, Any]]:
    """Return what was read, repaired and dropped, a bag each."""
    return [{**log.bag_accounts.to_json(), 'findings': log.bag_accounts.findings()} for log in logs]


def provenance(tool: str, machine: Robot | Axis, bags: Sequence[str | Path],
               options: Mapping[str, Any]) -> dict[str, Any]:
    """Return where a model comes from: tool, date, versions, machine, bags with hashes, options."""
    return origin(tool, machine, options) | {
        'bags': [{'path': str(bag), 'sha256': bag_sha256(bag)} for bag in bags]}


def bags_of(model_file: ModelFile) -> frozenset[str]:
    """Return the hashes of the bags that a model was identified from, as far as it tells them."""
    bags = model_file.provenance.get('bags')
    return frozenset(str(bag.get('sha256')) for bag in bags if isinstance(bag, dict)
                     ) if isinstance(bags, list) else frozenset()


def model_in_units(model_file: ModelFile, machine: Robot | Axis) -> ModelFile:
    """Return the model with the units of its parameters as they are on the machine."""
    def converted(parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
        return {name: parameter.model_copy(update={
                    'unit': parameter_unit(machine, name, parameter.unit)})
                for name, parameter in parameters.items()}

    return model_file.model_copy(update={
        'parameters': converted(model_file.parameters),
        'effects': tuple(entry.model_copy(update={'parameters': converted(entry.parameters)})
                         for entry in model_file.effects)})
