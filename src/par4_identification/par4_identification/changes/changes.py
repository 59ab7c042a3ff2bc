"""What has changed since a model was right, or between two groups of bags.

The parameters of every joint now, against those before, are explained by the fewest readings. Of a
cause that the diagnosis names beside them nobody knows whether the model's parameters had
swallowed it: the direction in which it would have moved them counts as chance. Two groups of bags
are both fitted with the causes, so that there is nothing to swallow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.base_terms import INERTIA, BaseTerm
from par4_dynamics.effects.drive_gain_error import DriveGainError
from par4_dynamics.model import Model
from par4_dynamics.model_file import ModelFile, RigidBody
from par4_dynamics.model_from_file import build_model, torque_model
from par4_identification.changes.explanation import (
    Explanation,
    Read,
    explained,
    nothing_changed,
)
from par4_identification.changes.joint_values import (
    JointValues,
    fitted_values,
    torque_of_causes,
    values_of_model,
)
from par4_identification.changes.readings import Parameters, applied, readings_of
from par4_identification.changes.swallowed import swallowed_values
from par4_identification.diagnosis.diagnosis import CONDITIONING
from par4_identification.diagnosis.evidence.holdout import blocks_of_runs
from par4_identification.diagnosis.evidence.observations import Observations, observe, with_nominal
from par4_identification.diagnosis.verdict.answer import Diagnosis
from par4_identification.fitting.identification import identify_runs
from par4_identification.logs.log import Log
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.rows import runs_of_logs
from par4_identification.signals.run import Run
from par4_kinematics.robot import Axis, Robot


@dataclass(frozen=True)
class Changes:
    """What has changed since a model or since older bags, and how wrong the model is as it stands.

    Attributes:
        terms: the base parameters.
        before, after: parameters of every joint.
        explanation: the readings, and the part of the change that they do not explain.
        margins: gain in log-likelihood of each reading on held-out rows.
        parameters: those before, in the form that readings use.
        given_rms: rms that the model leaves on held-out rows with nothing fitted, (J,), N m.
        since: the model or the bags that the data are compared with, in words.
        swallowed: whether the parameters before may hold what the causes of those after add.
        of_these: whether the model was identified from recordings that are fitted, since when
            nothing can have changed.
    """

    terms: tuple[BaseTerm, ...]
    before: JointValues
    after: JointValues
    explanation: Explanation
    margins: tuple[float, ...]
    parameters: Parameters
    given_rms: np.ndarray
    since: str
    swallowed: bool
    of_these: bool = False

    @property
    def std(self) -> np.ndarray:
        """Standard deviations of after minus before, by which readings are judged, (J, p)."""
        return np.sqrt(np.diag(covariance_of_difference(
            self.before, self.after, self.swallowed))).reshape(self.after.values.shape)

    @property
    def read(self) -> tuple[Read, ...]:
        """The readings, strongest first."""
        return self.explanation.read

    @property
    def beyond_readings(self) -> bool:
        """Whether something has changed that no reading explains."""
        return not self.explanation.is_complete


def covariance_of_difference(before: JointValues, after: JointValues, swallowed: bool
                             ) -> np.ndarray:
    """Return the covariance (J p, J p) of after minus before.

    Args:
        before, after: parameters.
        swallowed: whether `before` may hold what the causes of `after` add.
    """
    covariance = before.covariance + after.covariance + sum(
        part.vague.T @ part.vague for part in (before, after))
    if swallowed:
        covariance = covariance + after.bias.T @ after.bias
    return covariance


def explained_change(before: JointValues, after: JointValues, swallowed: bool
                     ) -> tuple[Parameters, Explanation]:
    """Return the parameters before as readings take them, and the explanation of the change."""
    parameters = _as_readings_take(before, after)
    return parameters, explained(readings_of(before.terms, len(before.values)), parameters,
                                 after.values, covariance_of_difference(before, after, swallowed))


def _as_readings_take(before: JointValues, after: JointValues) -> Parameters:
    names = tuple(term.name for term in before.terms)
    return Parameters(names, before.values, after.known, before.gains)


def changes_since_model(diagnosis: Diagnosis, machine: Robot | Axis, model_file: ModelFile,
                        name: str, of_these: bool = False) -> Changes:
    """Return what differs from a model that was right.

    The parameters of a model that was identified from these very recordings differ, too, by what
    its causes had moved them; that is no change.

    Args:
        diagnosis: by which the model's rigid body and effects are known.
        machine: that was measured.
        model_file: what was believed, with its standard deviations.
        name: of the model, for messages.
        of_these: whether the model was identified from some of the recordings fitted.

    Raises:
        InputError: data that do not tell the parameters joint by joint.
    """
    model = build_model(machine, model_file)
    seen = diagnosis.evidence.observations
    before = values_of_model(model_file, machine, seen.terms)
    after = fitted_values(seen, diagnosis.hypotheses, diagnosis.unnamed_hypotheses)
    if of_these:
        return Changes(before.terms, before, after, nothing_changed(after.values.size), (),
                       _as_readings_take(before, after),
                       given_rms(diagnosis.holdout.runs, model), name, True, of_these)
    heldout = rows_beside(diagnosis, diagnosis.holdout.runs, machine, model)
    shared = not any(isinstance(parameter.value, tuple)
                     for parameter in model_file.parameters.values())
    after = replace(after, bias=swallowed_values(after, (seen, heldout), shared))
    return _changes(diagnosis, machine, model, before, after, swallowed=True, since=name)


def model_of_bags(logs: Sequence[Log], machine: Robot | Axis, baseline: ModelFile | None,
                  conditioning: Conditioning = CONDITIONING) -> ModelFile:
    """Return the model of earlier bags: base parameters beside what a baseline knows.

    Raises:
        InputError: data that do not excite the parameters.
    """
    rigid_body = baseline.rigid_body if baseline else 'paper'
    known = None if baseline is None else build_model(machine, baseline)
    seen = observed(logs, machine, rigid_body, known, conditioning)
    fit = identify_runs(seen.runs, seen.target, seen.base, rigid_body, terms=seen.terms)
    return fit.model_file({}).model_copy(
        update={'effects': baseline.effects if baseline else ()})


def changes_between(diagnosis: Diagnosis, machine: Robot | Axis, logs: Sequence[Log],
                    model_file: ModelFile, name: str,
                    conditioning: Conditioning = CONDITIONING) -> Changes:
    """Return what differs from earlier bags.

    Args:
        diagnosis: of the later bags, by the model of the earlier ones.
        machine: that was measured.
        logs: the earlier ones.
        model_file: `model_of_bags` of them.
        name: of the bags, for messages.
        conditioning: filters and rates, those of the diagnosis.

    Raises:
        InputError: data that do not tell the parameters joint by joint.
    """
    model = build_model(machine, model_file)
    seen = with_nominal(observed(logs, machine, model_file.rigid_body, model, conditioning),
                        model).with_terms_of(diagnosis.evidence.observations)
    before, after = (fitted_values(rows, diagnosis.hypotheses, diagnosis.unnamed_hypotheses)
                     for rows in (seen, diagnosis.evidence.observations))
    return _changes(diagnosis, machine, model, before, after, swallowed=False, since=name)


def observed(logs: Sequence[Log], machine: Robot | Axis, rigid_body: RigidBody,
             baseline: Model | None, conditioning: Conditioning) -> Observations:
    """Return the observations of logs; without the inertia, which steady speeds do not show.

    See `observe` for the other arguments.

    Raises:
        InputError, UnreachableError: as `runs_of_logs`.
    """
    seen = observe(runs_of_logs(logs, machine, conditioning), machine, rigid_body, baseline)
    return seen.without(INERTIA) if conditioning.steady else seen


def _changes(diagnosis: Diagnosis, machine: Robot | Axis, model: Model, before: JointValues,
             after: JointValues, swallowed: bool, since: str) -> Changes:
    # what a known gain adds follows from the values of the diagnosis; one that it found may have
    # been there before, and nobody knew
    gains = [np.ones(len(before.values))]
    if not swallowed:
        extended = torque_model(machine, diagnosis.extended_model, diagnosis.effects)
        gains.append(1.0 + gains_of(extended) - gains_of(model))
    parameters, explanation = min(
        (explained_change(replace(before, gains=own), after, swallowed) for own in gains),
        key=lambda item: (not item[1].is_complete, len(item[1].read)))
    heldout = rows_beside(diagnosis, diagnosis.holdout.runs, machine, model)
    margins = _margins(explanation.read, parameters, after, heldout, diagnosis)
    return Changes(before.terms, before, after, explanation, margins, parameters,
                   given_rms(diagnosis.holdout.runs, model), since, swallowed)


def rows_beside(diagnosis: Diagnosis, runs: Sequence[Run], machine: Robot | Axis,
                baseline: Model | None) -> Observations:
    """Return other rows than the fitted ones, with the nominal torque of a diagnosis.

    What a baseline knows follows from it.
    """
    rows = observe(list(runs), machine, 'paper' if baseline is None else baseline.rigid_body,
                   baseline)
    return with_nominal(rows, torque_model(machine, diagnosis.extended_model, diagnosis.effects)
                        ).with_terms_of(diagnosis.evidence.observations)


def gains_of(model: Model) -> np.ndarray:
    """Return recorded torque over true one by the drive gains that a model has, (J,)."""
    gains = np.ones_like(model.values[INERTIA])
    for active in model.effects:
        if isinstance(active.effect, DriveGainError):
            own = list(active.joints)
            gains[own] += active.values['relative'][own]
    return gains


def given_rms(runs: Sequence[Run], model: Model) -> np.ndarray:
    """Return the rms (J,), N m, that a model leaves of the torque as it stands."""
    left = [run.tau - run.rows(model.torque(run.state)) for run in runs]
    blocks = blocks_of_runs([run.t for run in runs], [run.valid for run in runs])
    return np.sqrt(blocks.mean_square(left))


def _margins(read: Sequence[Read], parameters: Parameters, after: JointValues,
             heldout: Observations, diagnosis: Diagnosis) -> tuple[float, ...]:
    """Return what each reading gains in log-likelihood beside the others on rows held out."""
    noise = diagnosis.evidence.whitener.noise
    own = [target - torque for target, torque in zip(
        heldout.target, torque_of_causes(after.causes, heldout))]

    def squares(readings: Sequence[Read]) -> float:
        values = applied([item.reading for item in readings], [item.size for item in readings],
                         parameters)
        total = 0.0
        for run, target, base in zip(heldout.runs, own, heldout.base):
            left = target - np.einsum('mjp,jp->mj', base, values)
            for joint, model in enumerate(noise):
                white = model.whiten(left[:, joint, None], run.valid[:, joint])
                total += float(np.sum(white ** 2))
        return total

    whole = squares(read)
    return tuple(0.5 * (squares([other for other in read if other is not item]) - whole)
                 for item in read)
