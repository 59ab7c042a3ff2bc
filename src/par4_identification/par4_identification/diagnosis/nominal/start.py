"""The base parameters that a diagnosis starts from, or the reasons why there are none.

The data of a Par4 must show all its base parameters. Only the inertia of its actuators may stay
unclear until causes are found. An axis may be any machine. If the bodies alone do not explain
enough of its torque, they are fitted again beside a torque that depends on the position, periodic
or not, and beside a constant one; an inertia that its motion does not show is that of the model
that was given, or left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.base_terms import FRICTION, INERTIA
from par4_dynamics.effects.cogging import Cogging
from par4_dynamics.effects.effect import Effect
from par4_dynamics.effects.position_torque import PositionTorque
from par4_dynamics.effects.torque_offset import TorqueOffset
from par4_dynamics.model_file import RigidBody
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.evidence import gather
from par4_identification.diagnosis.evidence.fit import residuals, solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.evidence.whitener import flat_whitener
from par4_identification.diagnosis.nominal.gate import is_vague, too_few, unusable
from par4_identification.diagnosis.search.candidates import Candidates
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.fitting.identification import Identification, identify_runs
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot

STRONGER = 2.0
"""Acceleration over that which all but a hundredth of the rows to fit stay below, up to which a
model without inertia is held against rows."""
BOUND = Cogging(), PositionTorque()
"""Torques that depend on the position alone."""
LOAD = TorqueOffset()
"""A load that hangs on a drum, which a log that mostly lowers it makes driving friction of."""


@dataclass(frozen=True)
class Start:
    """Where a diagnosis starts.

    Attributes:
        observations: rows to fit, without the column of a parameter that they do not show.
        identification: base parameters; None if they cannot be fitted at all.
        left_out: names of parameters that the motion does not show.
        reasons: why the data cannot carry a diagnosis, each with what to do; empty if they can.
        unless_mended: why they cannot unless causes are found beside which the motion shows the
            inertia, and friction brakes; empty if that is no reason.
        bound: whether most of the torque depends on the position alone, or on nothing.
        inertia: of the actuators where the motion does not show it and a model tells it, (J,),
            kg m2 or kg; its torque is not in the rows then.
    """

    observations: Observations
    identification: Identification | None
    left_out: tuple[str, ...]
    reasons: tuple[str, ...]
    unless_mended: tuple[str, ...] = ()
    bound: bool = False
    inertia: np.ndarray | None = None

    @property
    def fitted(self) -> Identification:
        """The base parameters.

        Raises:
            TypeError: they cannot be fitted.
        """
        if self.identification is None:
            raise TypeError('no base parameters to start from')
        return self.identification


def start_of(observations: Observations, machine: Robot | Axis, rigid_body: RigidBody, rules: Rules,
             inertia: np.ndarray | None = None) -> Start:
    """Return where a diagnosis of these rows of a machine starts.

    Args:
        observations: rows to fit.
        machine: that was recorded.
        rigid_body: 'paper' or 'full'.
        rules: of the search.
        inertia: that a model tells of the actuators, (J,), for a motion that does not show it.
    """
    start = _start(observations, None, machine, rigid_body)
    if not start.reasons:
        return start
    known = observations.without(INERTIA, 0.0 if inertia is None else inertia)
    if not observations.of_axis:
        if (start.unless_mended and inertia is not None and len(start.reasons) == 1
                and _is_vague(start.fitted)):
            again = _start(known, None, machine, rigid_body, (INERTIA,))
            return start if again.reasons else replace(again, inertia=inertia)
        return replace(start, reasons=()) if start.unless_mended else start
    bound = () if observations.steady else (*BOUND, LOAD)
    for effects in ((), *((effect,) for effect in bound)):
        target = _without(effects, observations, rules) if effects else None
        again = _start(observations, target, machine, rigid_body)
        if _hides_inertia(again):  # of which a negative value that may be chance is no reason
            left = None if target is None else [
                part + less - whole
                for part, less, whole in zip(target, known.target, observations.target)]
            again = replace(_start(known, left, machine, rigid_body, (INERTIA,)), inertia=inertia)
        if not again.reasons:
            return replace(again, bound=bool(effects))
    return start


def start_beside(start: Start, observations: Observations, target: Sequence[np.ndarray],
                 machine: Robot | Axis, rigid_body: RigidBody) -> Start | None:
    """Return a start beside causes, with the inertia that they hid; None if it stays hidden.

    A strong cause may make an inertia negative that the motion shows well once the cause is known.

    Args:
        start: without an inertia, or with one that is vague.
        observations: all rows to fit, with the column of the inertia.
        target: of these, without the torque of the causes found from `start`, (m, J) a run, N m.
        machine: that was recorded.
        rigid_body: 'paper' or 'full'.
    """
    again = _start(observations, target, machine, rigid_body)
    return None if again.reasons or _hides_inertia(again) else replace(again, bound=start.bound)


def start_beside_position(start: Start, observations: Observations, machine: Robot | Axis,
                          rigid_body: RigidBody, rules: Rules) -> Start | None:
    """Return a start beside all torques that depend on the position; None if there is none.

    A wave and a constant together may hide an inertia that neither hides alone, and without it
    neither is told from what it leaves. Arguments as of `start_beside`.
    """
    if not observations.of_axis or observations.steady:
        return None
    return start_beside(start, observations, _without(BOUND, observations, rules), machine,
                        rigid_body)


def is_mended(parameters: Mapping[str, Parameter]) -> bool:
    """Return whether base parameters beside causes can be those of a machine.

    The motion shows the inertia, and both parts of the friction brake.
    """
    found = parameters[INERTIA]
    value, std = (float(np.max(np.asarray(part, dtype=float))) for part in (
        found.value, np.inf if found.std is None else found.std))
    return value > 0.0 and not is_vague(value, std) and all(
        np.min(np.asarray(parameters[name].value, dtype=float)) >= 0.0 for name in FRICTION)


def shown(heldout: Observations, start: Start) -> Observations:
    """Return held-out rows as far as a start can say something of them.

    Without an inertia it says nothing of accelerations that are stronger than the fitted ones.
    """
    if not start.left_out:
        return heldout
    if start.inertia is not None:
        return heldout.without(INERTIA, start.inertia)
    heldout = heldout.without(INERTIA)
    most = STRONGER * max(float(np.quantile(np.abs(run.rows(run.state.qdd)[run.valid]), 0.99))
                          for run in start.observations.runs if run.valid.any())
    return replace(heldout, runs=tuple(
        replace(run, valid=run.valid & (np.abs(run.rows(run.state.qdd)) <= most))
        for run in heldout.runs))


def _start(observations: Observations, target: Sequence[np.ndarray] | None, machine: Robot | Axis,
           rigid_body: RigidBody, left_out: tuple[str, ...] = ()) -> Start:
    """Return where a diagnosis starts that fits the base terms to `target`, by default all."""
    try:
        identification = identify_runs(
            observations.runs, observations.target if target is None else target,
            observations.base, rigid_body, terms=observations.terms)
    except InputError as error:
        return Start(observations, None, left_out, tuple(too_few(observations)) or (str(error),))
    found = unusable(observations, identification, machine, target)
    reasons = tuple(reason.text for reason in found)
    return Start(observations, identification, left_out, reasons,
                 reasons if all(reason.is_of_cause for reason in found) else ())


def _hides_inertia(start: Start) -> bool:
    """Return whether the motion does not tell the inertia, or tells one that none can have."""
    return start.identification is None or (
        _inertia(start.identification)[0] < 0.0 or _is_vague(start.identification))


def _is_vague(identification: Identification) -> bool:
    """Return whether the motion does not tell the inertia."""
    return is_vague(*_inertia(identification))


def _inertia(identification: Identification) -> tuple[float, float]:
    """Return the inertia of an actuator and its standard deviation, kg m2."""
    names = [term.name for term in identification.terms]
    value, std = (part[names.index(INERTIA)] for part in (
        identification.estimate.values, identification.estimate.std))
    return float(value), float(std)


def _without(effects: Sequence[Effect], observations: Observations, rules: Rules
             ) -> tuple[np.ndarray, ...]:
    """Return the target (m, J) of each run without effects, each found beside those before it."""
    squares = sum(np.sum(np.where(run.valid, target, 0.0) ** 2, axis=0)
                  for run, target in zip(observations.runs, observations.target))
    rows = sum(run.valid.sum(axis=0) for run in observations.runs)
    sigma = np.sqrt(squares / np.maximum(rows, 1))
    evidence = gather(observations, flat_whitener(observations, np.maximum(sigma, 1e-30)))
    model: tuple[Hypothesis, ...] = ()
    for effect in effects:
        found = Candidates({effect.name: effect}, evidence, rules).best(
            effect, project(evidence, model))
        if found is not None:
            model = (*model, found.hypothesis)
    fit = solve(evidence, model)  # of which both have the base parameters
    left, whole = (residuals(observations, part, fit) for part in (model, ()))
    return tuple(target - (without - rest) for target, without, rest in zip(
        observations.target, whole, left))
