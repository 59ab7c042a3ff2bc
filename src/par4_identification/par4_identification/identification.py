"""Identifying the base parameters of a machine from measured logs: TABLE 1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_dynamics.base_terms import BaseTerm, base_columns, base_terms, distributed_torque
from par4_dynamics.model_file import ModelFile
from par4_dynamics.parameters import Parameter
from par4_dynamics.state import State
from par4_identification.least_squares import Estimate, Series, fit
from par4_identification.log import Log
from par4_identification.rows import Conditioning, Run, runs_of_log
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot

INSIGNIFICANT = 3.0
"""Standard deviations within which a negative value is taken for zero."""


@dataclass(frozen=True)
class Identification:
    """Identified base parameters.

    Attributes:
        terms: which parameters, in the order of the estimate.
        estimate: the fit.
        rigid_body: 'paper' for (20), 'full' with the robot's rods and bars distributed.
        runs: the rows behind it.
    """

    terms: tuple[BaseTerm, ...]
    estimate: Estimate
    rigid_body: str
    runs: tuple[Run, ...]

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Values with standard deviations, by name."""
        return {term.name: Parameter(value=float(value), std=float(std), unit=term.unit)
                for term, value, std in zip(self.terms, self.estimate.values, self.estimate.std)}

    def model_file(self, provenance: dict) -> ModelFile:
        """Return the model to be written; what is negative by noise only is written as zero.

        Raises:
            InputError: a parameter came out negative that physics forbids to be.
        """
        parameters = dict(self.parameters)
        for term in self.terms:
            value, std = parameters[term.name].value, parameters[term.name].std
            if not term.nonnegative or value >= 0.0:
                continue
            if value < -INSIGNIFICANT * std:
                raise InputError(
                    f'{term.name} identified as {value:.4g} {term.unit}, which is impossible; '
                    f'check the sign, order and gains of the joints, or record a richer motion')
            parameters[term.name] = parameters[term.name].model_copy(update={'value': 0.0})
        return ModelFile(schema='par4/model/1', rigid_body=self.rigid_body,
                         parameters=parameters, provenance=provenance)


def known_torque(machine: Robot | Axis, rigid_body: str, state: State) -> np.ndarray:
    """Return what `rigid_body` knows of the torque (n, J) beside (20), N m."""
    if rigid_body == 'paper' or isinstance(machine, Axis):
        return np.zeros_like(state.q)
    return distributed_torque(machine.bodies, state)


def identify(logs: list[Log], machine: Robot | Axis, rigid_body: str = 'paper',
             payloads: dict[str, float] | None = None,
             conditioning: Conditioning | None = None) -> Identification:
    """Return the base parameters that explain the logs best.

    Args:
        logs: measured data; runs are never joined.
        machine: geometry and bodies.
        rigid_body: 'paper' or 'full'.
        payloads: log name -> known mass at the tool, kg, carried in that log.
        conditioning: filters and rates.

    Raises:
        InputError: data that cannot be filtered or do not excite the parameters.
    """
    runs, targets, bases = [], [], []
    for log in logs:
        payload = (payloads or {}).get(log.name, 0.0)
        for run in runs_of_log(log, machine, conditioning):
            columns = base_columns(run.state)
            known = known_torque(machine, rigid_body, run.state)
            if payload:
                names = [term.name for term in base_terms(run.state)]
                known = known + payload * columns[..., names.index('platform_mass_1')]
            targets.append(run.tau - run.rows(known))
            bases.append(run.rows(columns))
            runs.append(run)
    return identify_runs(runs, targets, bases, rigid_body)


def identify_runs(runs: Sequence[Run], targets: Sequence[np.ndarray], bases: Sequence[np.ndarray],
                  rigid_body: str) -> Identification:
    """Return the fit of base columns (m, J, p) to targets (m, J) of runs.

    Raises:
        InputError: data that do not excite the parameters.
    """
    series = [Series(target, base, run.valid) for run, target, base in zip(runs, targets, bases)]
    return Identification(base_terms(runs[0].state), fit(series), rigid_body, tuple(runs))
