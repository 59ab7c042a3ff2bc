"""Base parameters that differ between the logs of one diagnosis.

A diagnosis takes its logs for those of one machine. One that was cold in the first and warm in the
second, or that carried a load in one of them, leaves an error that no cause of the library makes.
The parameters of each log by itself tell it, and a few readings say what happened in between.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.base_terms import OFFSET, BaseTerm
from par4_dynamics.effects.coulomb_asymmetry import CoulombAsymmetry
from par4_dynamics.effects.distributed_rods import DistributedRods
from par4_dynamics.effects.effect import beyond
from par4_dynamics.effects.torque_offset import TorqueOffset
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model, torque_model
from par4_identification.changes.changes import explained_change, gains_of, rows_beside
from par4_identification.changes.explanation import CHANCE, Explanation
from par4_identification.changes.explanation import MOST as MOST_READINGS
from par4_identification.changes.joint_values import JointValues, fitted_values, torque_left
from par4_identification.changes.readings import Parameters, applied
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import Observations, with_nominal
from par4_identification.diagnosis.verdict.answer import Diagnosis
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot

LEFT = 1.3
"""Rms that a model leaves on a joint, over the noise floor, from which on logs are compared."""
REFERENCES = 4
"""Logs at most that are tried as the one that the others are compared with."""
MOST = 0.75
"""Share of the squared error beyond the noise floor that must go with the readings. What a cause
without a name does to the parameters of motions that are not alike mends little of it."""
WORTH_A_TRY = 0.3
"""The same from which on the logs are diagnosed without the readings. Causes that were found beside
a load that one log carries are none, and hide what it does; without it they are others."""
NEARLY_ALL = 0.95
"""The same where no causes have been looked for: a load that a machine carries in one log alone, or
friction that fell as it warmed. Causes of all logs hide little of these, and look little like
them."""


@dataclass(frozen=True)
class LogDifference:
    """How a log differs from another one.

    Attributes:
        log, other: their names.
        parameters: those of the other, in the form that readings use.
        explanation: the readings.
    """

    log: str
    other: str
    parameters: Parameters
    explanation: Explanation

    @property
    def beyond(self) -> np.ndarray:
        """What the readings add to the parameters of the other log, (J, p)."""
        read = self.explanation.read
        return applied([item.reading for item in read], [item.size for item in read],
                       self.parameters) - self.parameters.values


@dataclass(frozen=True)
class LogDifferences:
    """How the logs of a diagnosis differ.

    Attributes:
        terms: the base parameters.
        of_logs: one for each log that is not like the one that they are compared with.
        share: of the squared error beyond the noise floor that goes once they are taken out.
    """

    terms: tuple[BaseTerm, ...]
    of_logs: tuple[LogDifference, ...]
    share: float

    @property
    def apart(self) -> dict[str, dict[str, np.ndarray]]:
        """What base parameters (J,) of each such log have beyond the other's, by name and term."""
        return {item.log: dict(zip(item.parameters.terms, item.beyond.T)) for item in self.of_logs}

    def is_like(self, other: LogDifferences) -> bool:
        """Return whether the same is told, as large within a standard deviation."""
        own, others = ({(item.log, item.other, read.reading): (read.size, read.std)
                        for item in part.of_logs for read in item.explanation.read}
                       for part in (self, other))
        return own.keys() == others.keys() and all(
            abs(size - others[key][0]) <= std for key, (size, std) in own.items())

    @property
    def is_complete(self) -> bool:
        """Whether the readings of each log leave nothing beyond chance."""
        return all(item.explanation.is_complete for item in self.of_logs)


def differences_between_logs(diagnosis: Diagnosis, machine: Robot | Axis,
                             baseline: ModelFile | None,
                             least: float = MOST, alike: Diagnosis | None = None,
                             before: LogDifferences | None = None) -> LogDifferences | None:
    """Return how logs differ in base parameters, if that is most of what is wrong with the model.

    Args:
        diagnosis: that leaves more than noise; of one that does not, logs are not compared. Noise
            that wanders may be what differs, and names what some logs alone have.
        machine: that was measured.
        baseline: model whose effects the diagnosis took as known.
        least: share of the squared error beyond the noise floor that must go with them.
        alike: a diagnosis of the same logs without `before`, differences found earlier. Its causes
            are those beside which parameters are fitted, by default those of the diagnosis.
    """
    if not _leaves_something(diagnosis):
        return None
    causes = _with_rods((alike or diagnosis).hypotheses, machine, baseline)
    whole = _all_rows(diagnosis, machine, baseline)
    if isinstance(machine, Robot):
        whole = _with_offsets(whole)
        causes = tuple(item for item in causes  # which would say the same
                       if not isinstance(item.effect, TorqueOffset | CoulombAsymmetry))
    if alike is not None and before is not None:
        whole = _with_nominal(whole, alike, before, machine)
    names = [run.name for run in whole.runs]
    parts = {name: _of_runs(whole, [own == name for own in names]) for name in names}
    gains = gains_of(torque_model(machine, (alike or diagnosis).extended_model,
                                  (alike or diagnosis).effects))
    values = {name: replace(found, gains=gains) for name, part in parts.items()
              if (found := _values(part, causes)) is not None}
    if len(values) < 2:
        return None
    against = min((_against(values, name) for name in _most_alike(values)), key=_readings)
    differences = tuple(item for item in against if item.explanation.read)
    if not differences:
        return None
    share = _share_mended(whole, diagnosis, differences, causes)
    return LogDifferences(whole.terms, differences, share) if share > least else None


def mends(alike: Diagnosis, whole: Diagnosis) -> bool:
    """Return whether a diagnosis without differences leaves little of what another one leaves."""
    after, before = (_beyond_floor(item) for item in (alike, whole))
    return after < (1.0 - MOST) * before


def _beyond_floor(diagnosis: Diagnosis) -> float:
    """Return the squared error of fitted rows and those held out over that of the noise floor."""
    floor = np.maximum(diagnosis.holdout.noise_floor_rms, 1e-30)
    return sum(float(np.sum(np.maximum((rms / floor) ** 2 - 1.0, 0.0)))
               for rms in (diagnosis.fitted_rms, diagnosis.holdout.extended_rms))


def _leaves_something(diagnosis: Diagnosis) -> bool:
    """Return whether a diagnosis leaves more than noise of fitted rows or of those held out."""
    holdout = diagnosis.holdout
    return diagnosis.verdict not in ('clean', 'explained') or diagnosis.fitted_unlike or bool(
        np.any(holdout.extended_rms > LEFT * holdout.noise_floor_rms))


def _with_rods(causes: Sequence[Hypothesis], machine: Robot | Axis, baseline: ModelFile | None
               ) -> Sequence[Hypothesis]:
    """Return causes with the inertia of rods, which (20) lumps, where nobody has named it.

    Every Par4 has rods, and what lumping them does to parameters differs from a slow motion to a
    fast one.
    """
    full = baseline is not None and baseline.rigid_body == 'full'
    if full or not isinstance(machine, Robot) or any(
            isinstance(item.effect, DistributedRods) for item in causes):
        return causes
    return (*causes, Hypothesis(DistributedRods(), {}, tuple(range(len(machine.joint_names)))))


def _against(values: Mapping[str, JointValues], other: str) -> tuple[LogDifference, ...]:
    """Return how logs differ from another one, those that do, if only by what no reading tells."""
    return tuple(
        difference for name, found in values.items() if name != other
        for difference in [LogDifference(name, other, *explained_change(
            values[other], found, swallowed=False))]
        if difference.explanation.p_value < CHANCE)


def _readings(differences: Sequence[LogDifference]) -> int:
    """Return how many readings it takes: fewest where the odd log is told and not all others.

    What no reading tells counts as more than the most that are told.
    """
    return sum(len(item.explanation.read) or MOST_READINGS + 1 for item in differences)


def _all_rows(diagnosis: Diagnosis, machine: Robot | Axis, baseline: ModelFile | None
              ) -> Observations:
    """Return the rows that were fitted and those of logs that were held out."""
    fitted = diagnosis.evidence.observations
    names = {run.name for run in fitted.runs}
    kept = [run for run in diagnosis.holdout.runs if run.name not in names]
    if not kept:
        return fitted
    known = None if baseline is None else build_model(machine, baseline)
    rows = rows_beside(diagnosis, kept, machine, known)
    return replace(fitted, runs=(*fitted.runs, *rows.runs), target=(*fitted.target, *rows.target),
                   base=(*fitted.base, *rows.base), _kept={})


def _with_nominal(rows: Observations, alike: Diagnosis, before: LogDifferences,
                  machine: Robot | Axis) -> Observations:
    """Return rows with the nominal torque of a diagnosis of what is alike.

    Joints carry what their log has beyond it, too.
    """
    runs = tuple(replace(run, apart=before.apart.get(run.name, {})) for run in rows.runs)
    return with_nominal(replace(rows, runs=runs),
                        torque_model(machine, alike.extended_model, alike.effects))


def _with_offsets(rows: Observations) -> Observations:
    """Return rows of a Par4 with a constant torque of every joint among the base parameters.

    An amplifier may have another one in one log. The weight of an arm would take its place.
    """
    return replace(rows, terms=(*rows.terms, OFFSET), base=tuple(
        np.concatenate([base, np.ones((*base.shape[:2], 1))], axis=2) for base in rows.base),
        _kept={})


def _of_runs(rows: Observations, chosen: Sequence[bool]) -> Observations:
    """Return the observations of some runs."""
    places = [place for place, own in enumerate(chosen) if own]
    return replace(rows, runs=tuple(rows.runs[place] for place in places),
                   target=tuple(rows.target[place] for place in places),
                   base=tuple(rows.base[place] for place in places), _kept={})


def _values(rows: Observations, causes: Sequence[Hypothesis]) -> JointValues | None:
    """Return what a log tells of the parameters.

    None where it does not tell them apart, or tells values that no machine has: a law of friction
    that is missing makes others of a slow motion than of a fast one.
    """
    try:
        found = fitted_values(rows, causes)
    except InputError:
        return None
    never = [term.nonnegative for term in found.terms]
    unlike = beyond(found.values[:, never], found.std[:, never], low=0.0)
    return found if unlike is None else None


def _most_alike(values: Mapping[str, JointValues]) -> list[str]:
    """Return some logs from which the others differ least, the least first."""
    def distance(one: JointValues, other: JointValues) -> float:
        change = (one.values - other.values).ravel()
        return float(change @ np.linalg.solve(one.covariance + other.covariance, change))

    return sorted(values, key=lambda name: sum(
        distance(values[name], other) for other in values.values()))[:REFERENCES]


def _share_mended(rows: Observations, diagnosis: Diagnosis, differences: Sequence[LogDifference],
                  causes: Sequence[Hypothesis]) -> float:
    """Return the share of the squared error beyond the floor that goes with the differences."""
    added = {item.log: item.beyond for item in differences}
    alike = replace(rows, _kept=dict(rows._kept), target=tuple(
        target - np.einsum('mjp,jp->mj', base, added[run.name]) if run.name in added else target
        for run, target, base in zip(rows.runs, rows.target, rows.base)))
    floor = np.maximum(diagnosis.holdout.noise_floor_rms, 1e-30)
    before, after = (_excess(part, fitted_values(part, causes), floor)
                     for part in (rows, alike))
    return 1.0 - max(after, 0.0) / before if before > 0.0 else 0.0


def _excess(rows: Observations, found: JointValues, floor: np.ndarray) -> float:
    """Return the mean square of what is left, over that of the floor (J,), beyond one."""
    left = [np.where(run.valid, part / floor, 0.0)
            for run, part in zip(rows.runs, torque_left(rows, found))]
    count = sum(int(run.valid.sum()) for run in rows.runs)
    return sum(float(np.sum(part ** 2)) for part in left) / max(count, 1) - 1.0
