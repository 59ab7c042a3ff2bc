"""Identifying the base parameters of a machine from measured logs: TABLE 1."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from par4_dynamics.base_terms import (
    BASE_TERMS,
    INERTIA,
    OFFSET,
    PLATFORM_MASSES,
    BaseTerm,
    base_columns,
    base_terms,
    distributed_torque,
)
from par4_dynamics.effects.torque_offset import TorqueOffset
from par4_dynamics.model import Model
from par4_dynamics.model_file import EffectEntry, ModelFile, RigidBody
from par4_dynamics.model_from_file import build_model
from par4_dynamics.parameters import Parameter
from par4_dynamics.state import State
from par4_identification.estimators.consistent import consistent
from par4_identification.estimators.estimate import Estimate, condition_number
from par4_identification.estimators.instrumental import InstrumentalEstimate, instrumental
from par4_identification.estimators.ordinary import ordinary
from par4_identification.estimators.problem import (
    Problem,
    Series,
    per_output,
    problem_of,
    with_offsets,
)
from par4_identification.estimators.robust import robust
from par4_identification.estimators.weighted import weighted
from par4_identification.fitting.physical import physical_constraints
from par4_identification.fitting.simulated import simulated_log
from par4_identification.logs.log import Log, refuse_logs
from par4_identification.logs.stretches import in_pieces
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.rows import runs_of_log, runs_of_logs
from par4_identification.signals.run import Run
from par4_kinematics.errors import InputError
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot

SINGULAR = ('the equations of these data are singular, so that no parameter can be told; record a '
            'longer motion of all joints, and check that torque and position belong together')
INSIGNIFICANT = 3.0
"""Standard deviations within which a negative value is taken for zero."""
OTHER_JOINTS = ('whether other joints moved at the same time, whose weight and inertia an axis '
                'does not know')
"""What spoils the log of an axis and cannot be seen in it."""
PLAIN: Mapping[str, Callable[[Problem], Estimate]] = {
    'weighted': weighted, 'ordinary': ordinary, 'robust': robust}
"""Estimators that need nothing but the rows."""
MOST_SIMULATIONS = 4
SETTLED = 0.05
"""Change of the values, in standard deviations, at which simulating again changes nothing."""


@dataclass(frozen=True)
class Fitting:
    """How parameters are estimated.

    Attributes:
        estimator: of ESTIMATORS.
        per_joint: a value of its own for each joint, but for the platform's masses.
        offsets: with a constant torque of each joint.
    """

    estimator: str = 'weighted'
    per_joint: bool = False
    offsets: bool = False

    def problem(self, series: Sequence[Series], terms: Sequence[BaseTerm]) -> Problem:
        """Return the problem of base columns (m, J, p) with these terms."""
        problem = problem_of(series, [term.name for term in terms], [term.unit for term in terms])
        if self.per_joint:
            problem = per_output(problem, {term.name for term in terms} - set(PLATFORM_MASSES))
        return with_offsets(problem, OFFSET.name, OFFSET.unit) if self.offsets else problem

    def shared_condition(self, series: Sequence[Series]) -> float | None:
        """Return the condition number of base columns (m, J, p) if more than these is estimated."""
        return condition_number(series) if self.per_joint or self.offsets else None


@dataclass(frozen=True)
class Identification:
    """Identified base parameters.

    Attributes:
        terms: the base parameters, in the order of (23).
        estimate: the fit; its labels say which parameter, and of which joint, each value is.
        rigid_body: 'paper' for (20), 'full' with the robot's rods and bars distributed.
        runs: the rows that were fitted.
        fitting: estimator and options of the fit.
        shared_condition: if joints have values of their own or offsets were fitted, the condition
            number of the same rows without these; else None.
        causes: effects whose torque was taken as known; they belong to the model.
    """

    terms: tuple[BaseTerm, ...]
    estimate: Estimate
    rigid_body: RigidBody
    runs: tuple[Run, ...]
    fitting: Fitting = Fitting()
    shared_condition: float | None = None
    causes: tuple[EffectEntry, ...] = ()

    @property
    def excitation(self) -> float:
        """Condition number that tells how well the motion excites the parameters of (23)."""
        return self.estimate.condition_number if self.shared_condition is None else (
            self.shared_condition)

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Values with standard deviations, by name: one number, or one for each joint."""
        return {term.name: self._parameter(term.name, term.unit) for term in self.terms}

    @property
    def left_out(self) -> tuple[BaseTerm, ...]:
        """Base terms that were not fitted because the data do not show them."""
        known = {term.name for term in self.terms}
        return tuple(term for term in BASE_TERMS
                     if not term.needs_platform and term.name not in known)

    @property
    def offsets(self) -> Parameter | None:
        """The constant torque of each joint, if it was estimated."""
        return self._parameter(OFFSET.name, OFFSET.unit) if self.fitting.offsets else None

    def _parameter(self, name: str, unit: str) -> Parameter:
        found = [(float(value), float(std), label.output) for label, value, std in
                 zip(self.estimate.labels, self.estimate.values, self.estimate.std)
                 if label.name == name]
        if found[0][2] is None:
            return Parameter(value=found[0][0], std=found[0][1], unit=unit)
        return Parameter(value=tuple(value for value, _, _ in found),
                         std=tuple(std for _, std, _ in found), unit=unit)

    def model_file(self, provenance: dict[str, Any], machine: Robot | Axis | None = None
                   ) -> ModelFile:
        """Return the model to be written.

        A parameter that is negative by noise only, or that was not fitted, is written as zero.

        Args:
            provenance: where it comes from.
            machine: that was recorded; errors then use its units.

        Raises:
            InputError: a parameter came out negative that physics forbids to be.
        """
        parameters = {**self.parameters, **{
            term.name: Parameter(value=0.0, unit=term.unit) for term in self.left_out}}
        impossible = self.impossible(machine)
        if impossible is not None:
            raise InputError(f'{impossible}; {what_to_do(machine)}')
        for term in self.terms:
            value = np.atleast_1d(np.asarray(parameters[term.name].value, dtype=float))
            if not term.nonnegative or np.all(value >= 0.0):
                continue
            kept = np.maximum(value, 0.0).tolist()
            shared = not isinstance(parameters[term.name].value, tuple)
            parameters[term.name] = parameters[term.name].model_copy(
                update={'value': kept[0] if shared else tuple(kept)})
        offsets = () if self.offsets is None else (
            EffectEntry(effect=TorqueOffset.name, parameters={'offset': self.offsets}),)
        return ModelFile(schema='par4/model/1', rigid_body=self.rigid_body, parameters=parameters,
                         effects=(*self.causes, *offsets), provenance=provenance)

    def impossible(self, machine: Robot | Axis | None = None) -> str | None:
        """Return which value is negative beyond noise though physics forbids it, None if none is.

        `machine` was recorded; with it the value has its units.
        """
        for term in self.terms:
            parameter = self.parameters[term.name]
            value = np.atleast_1d(np.asarray(parameter.value, dtype=float))
            std = np.atleast_1d(np.asarray(parameter.std, dtype=float))
            worst = int(np.argmin(value + INSIGNIFICANT * std))
            if term.nonnegative and value[worst] < -INSIGNIFICANT * std[worst]:
                joint = f' of joint {worst}' if len(value) > 1 else ''
                unit = term.unit if machine is None else unit_on(machine, term.unit)
                return (f'{term.name}{joint} identified as {value[worst]:.4g} {unit}, which is '
                        f'impossible')
        return None


def what_to_do(machine: Robot | Axis | None) -> str:
    """Return what to do about a value that no machine can have."""
    if isinstance(machine, Axis):
        return (f'check the sign of torque and position and {OTHER_JOINTS}, or record a richer '
                f'motion')
    return 'check the sign, order and gains of the joints, or record a richer motion'


def known_torque(machine: Robot | Axis, rigid_body: RigidBody, state: State) -> np.ndarray:
    """Return what `rigid_body` knows of the torque (n, J) beside (20), N m."""
    if rigid_body == 'paper' or isinstance(machine, Axis):
        return np.zeros_like(state.q)
    return distributed_torque(machine.bodies, state)


@contextmanager
def singular_refused() -> Iterator[None]:
    """Refuse data whose equations are singular.

    Raises:
        InputError: they are.
    """
    try:
        yield
    except np.linalg.LinAlgError as error:
        raise InputError(SINGULAR) from error


@singular_refused()
def identify(logs: list[Log], machine: Robot | Axis, rigid_body: RigidBody = 'paper',
             payloads: dict[str, float] | None = None,
             conditioning: Conditioning | None = None, fitting: Fitting | None = None,
             beside: Model | None = None, left_out: Collection[str] = ()) -> Identification:
    """Return the base parameters that explain the logs best.

    Args:
        logs: measured data; runs are never joined.
        machine: geometry and bodies.
        rigid_body: 'paper' or 'full'.
        payloads: log name -> known mass at the tool, kg, carried in that log.
        conditioning: filters and rates.
        fitting: estimator, values per joint, offsets.
        beside: model whose distributed bodies and effects are taken as known.
        left_out: names of base terms that are not fitted, with a PLAIN estimator.

    Raises:
        InputError: no log, two of one name, readings that are no numbers, data that cannot be
            filtered or do not excite the parameters; for instruments, a log without a reference or
            a machine that cannot be simulated.
        UnreachableError: joint positions with which the mechanism does not close; for instruments,
            the simulated machine leaves its workspace.
    """
    refuse_logs(logs)
    targets, bases = [], []
    fitting, payloads = fitting or Fitting(), payloads or {}
    steady = conditioning is not None and conditioning.steady
    runs = runs_of_logs(logs if steady else [in_pieces(log) for log in logs], machine,
                        conditioning)
    terms = base_terms(runs[0].state)
    if steady and fitting.estimator == 'instrumental':
        raise InputError('--estimator instrumental asked of logs that hold steady speeds, whose '
                         'motion it would simulate; use another estimator')
    hidden = {*left_out, *((INERTIA,) if steady else ())}
    shown = [index for index, term in enumerate(terms) if term.name not in hidden]
    for run in runs:
        columns = base_columns(run.state)
        known = (known_torque(machine, rigid_body, run.state) if beside is None
                 else beside.known_torque(run.state))
        payload = payloads.get(run.name, 0.0)
        if payload:
            names = [term.name for term in terms]
            known = known + payload * columns[..., names.index('platform_mass_1')]
        targets.append(run.tau - run.rows(known))
        bases.append(run.rows(columns)[..., shown])
    terms = tuple(terms[index] for index in shown)
    if fitting.estimator in PLAIN:
        return identify_runs(runs, targets, bases, rigid_body, fitting, terms)
    series = _series(runs, targets, bases)
    problem = fitting.problem(series, terms)
    estimate = consistent(problem, physical_constraints(problem.labels, machine, rigid_body))
    identification = Identification(terms, estimate, rigid_body, tuple(runs), fitting,
                                    fitting.shared_condition(series))
    if fitting.estimator == 'consistent':
        return identification
    return _with_instruments(identification, targets, bases, logs, machine, payloads, conditioning)


@singular_refused()
def identify_runs(runs: Sequence[Run], targets: Sequence[np.ndarray], bases: Sequence[np.ndarray],
                  rigid_body: RigidBody, fitting: Fitting | None = None,
                  terms: Sequence[BaseTerm] | None = None) -> Identification:
    """Return the fit of base columns (m, J, p) to targets (m, J) of runs, by a PLAIN estimator.

    `terms` are those of the columns, by default all that apply.

    Raises:
        InputError: data that do not excite the parameters.
    """
    fitting, terms = fitting or Fitting(), tuple(terms or base_terms(runs[0].state))
    series = _series(runs, targets, bases)
    estimate = PLAIN[fitting.estimator](fitting.problem(series, terms))
    return Identification(terms, estimate, rigid_body, tuple(runs), fitting,
                          fitting.shared_condition(series))


def _series(runs: Sequence[Run], targets: Sequence[np.ndarray], bases: Sequence[np.ndarray]
            ) -> list[Series]:
    return [Series(target, base, run.valid) for run, target, base in zip(runs, targets, bases)]


def _with_instruments(start: Identification, targets: Sequence[np.ndarray],
                      bases: Sequence[np.ndarray], logs: Sequence[Log], machine: Robot | Axis,
                      payloads: Mapping[str, float], conditioning: Conditioning | None
                      ) -> Identification:
    """Return the estimate by instruments from simulations with the estimate before."""
    identification = start
    for _ in range(MOST_SIMULATIONS):
        model = build_model(machine, identification.model_file({}, machine))
        simulated = []
        for log in logs:
            simulated += runs_of_log(in_pieces(simulated_log(
                log, machine, model.with_payload(payloads.get(log.name, 0.0)))), machine,
                conditioning)
        runs = tuple(replace(run, valid=run.valid & other.valid)
                     for run, other in zip(start.runs, simulated, strict=True))
        columns = start.fitting.problem(
            _series(simulated, targets, [run.rows(base_columns(run.state)) for run in simulated]),
            start.terms)
        problem = start.fitting.problem(_series(runs, targets, bases), start.terms)
        estimate: InstrumentalEstimate = instrumental(
            problem, [part.columns for part in columns.series])
        step = np.abs(estimate.values - identification.estimate.values) / estimate.std
        identification = replace(start, estimate=estimate, runs=runs)
        if step.max() < SETTLED:
            break
    return identification
