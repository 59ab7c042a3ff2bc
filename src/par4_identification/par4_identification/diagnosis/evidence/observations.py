"""The data of a diagnosis: rows, and the columns of effects, filtered once and kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from par4_dynamics.base_terms import BaseTerm, base_columns, base_terms
from par4_dynamics.effects.effect import Effect, Shape
from par4_dynamics.model import Model
from par4_dynamics.model_file import RigidBody
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.kind import Kind, key_of
from par4_identification.fitting.identification import known_torque
from par4_identification.signals.run import Run
from par4_kinematics.robot import Axis, Robot

LEAST_SURE = 0.3
"""Share of the rows that are enough for a diagnosis."""
WORSE = 4.0
"""Ratio of mean squares from which rows are left out where a law does not tell a torque."""
AT_ONCE = 8
"""Shapes whose columns are filtered together."""


@dataclass(frozen=True)
class Observations:
    """Rows of some runs against a baseline model.

    Attributes:
        runs: uninterrupted stretches.
        target: torque minus what the baseline knows besides its base terms, (m, J) a run.
        base: base columns, (m, J, p) a run.
        terms: the base terms.
        known: the baseline, if there is one.
    """

    runs: tuple[Run, ...]
    target: tuple[np.ndarray, ...]
    base: tuple[np.ndarray, ...]
    terms: tuple[BaseTerm, ...]
    known: Model | None = None
    _kept: dict[Any, Any] = field(default_factory=dict)

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.target[0].shape[1]

    @property
    def of_axis(self) -> bool:
        """Whether the machine is a single axis."""
        return self.runs[0].state.geometry is None

    @property
    def steady(self) -> bool:
        """Whether each row is the mean of a stretch of constant speed."""
        return self.runs[0].conditioning.steady

    @property
    def varying(self) -> tuple[np.ndarray, ...]:
        """The measured torque, (m, J) a run, without the constant weight that a slide lifts.

        A share of it by which the torque may be wrong is constant, too, and no cause looks like it.
        """
        torques = tuple(run.tau for run in self.runs)
        if self.runs[0].state.hanging != 'sliding':
            return torques
        moving = np.concatenate([run.tau[run.valid.any(axis=1)] for run in self.runs])
        weight = moving.sum(axis=0) / max(len(moving), 1)
        return tuple(torque - weight for torque in torques)

    def without(self, name: str, values: np.ndarray | float = 0.0) -> Observations:
        """Return the observations without the column of a base parameter, of known values (J,)."""
        own = [term.name for term in self.terms].index(name)
        kept = [index for index in range(len(self.terms)) if index != own]
        return replace(self, base=tuple(part[..., kept] for part in self.base),
                       target=tuple(target - values * part[..., own]
                                    for target, part in zip(self.target, self.base)),
                       terms=tuple(self.terms[index] for index in kept))

    def with_terms_of(self, others: Observations, known: Mapping[str, np.ndarray] | None = None
                      ) -> Observations:
        """Return the observations without base parameters that others do not have.

        `known` has their values (J,); without it they count as zero.
        """
        kept = self
        for term in self.terms:
            if term not in others.terms:
                kept = kept.without(term.name, 0.0 if known is None else known[term.name])
        return kept

    def effect_rows(self, effect: Effect | Kind, shape: Shape) -> tuple[np.ndarray, ...]:
        """Return the filtered columns (m, J, K) of an effect in each run.

        Those of its parts are computed once.
        """
        parts = effect.parts(shape)
        self.keep(effect, parts)
        rows = [self._kept[key_of(effect, part)] for part in parts]
        if len(parts) == 1:
            return rows[0]
        # any choice of parts may be asked for: it is not kept
        return tuple(np.concatenate(part, axis=2) for part in zip(*rows))

    def keep(self, effect: Effect | Kind, shapes: Sequence[Shape]) -> None:
        """Compute the filtered columns of an effect at shapes of one part each, some together.

        A filter takes hardly longer for several columns than for one.
        """
        missing = [shape for shape in shapes if key_of(effect, shape) not in self._kept]
        for first in range(0, len(missing), AT_ONCE):
            some = missing[first:first + AT_ONCE]
            of_runs = []
            for run in self.runs:
                columns = [_recorded(effect, shape, run.state) for shape in some]
                rows = run.rows(np.concatenate([part.reshape(len(part), -1) for part in columns],
                                               axis=1) if len(some) > 1 else columns[0])
                ends = np.cumsum([part[0].size for part in columns])[:-1]
                of_runs.append([np.ascontiguousarray(own).reshape(len(own), *part.shape[1:])
                                for own, part in zip(np.split(
                                    rows.reshape(len(rows), -1), ends, axis=1), columns)])
            for shape, *of_shape in zip(some, *of_runs):
                self._kept[key_of(effect, shape)] = tuple(of_shape)


def observe(runs: list[Run], machine: Robot | Axis, rigid_body: RigidBody, baseline: Model | None
            ) -> Observations:
    """Return the observations of `runs`.

    Args:
        runs: rows of the logs.
        machine: geometry and bodies.
        rigid_body: 'paper' or 'full', where there is no baseline.
        baseline: model whose rigid body and effects are taken as known; its base parameters are
            fitted anew.
    """
    if baseline is not None:
        runs = [_with_nominal_torque(run, baseline) for run in runs]
    targets, bases = [], []
    for run in runs:
        known = (known_torque(machine, rigid_body, run.state) if baseline is None
                 else baseline.known_torque(run.state))
        targets.append(run.tau - run.rows(known))
        bases.append(run.rows(base_columns(run.state)))
    return Observations(tuple(runs), tuple(targets), tuple(bases), base_terms(runs[0].state),
                        baseline)


def _recorded(effect: Effect | Kind, shape: Shape, state: State) -> np.ndarray:
    """Return the columns (n, J, K) of an effect as drives tell them whose scale is known."""
    columns = effect.columns(state, shape)
    if isinstance(effect, Kind) or effect.scales or effect.retimes or state.nominal is None:
        return columns
    return columns * np.broadcast_to(state.nominal.scale, state.q.shape)[..., None]


def with_nominal(observations: Observations, model: Model) -> Observations:
    """Return the observations with the torque of `model` as nominal torque.

    What the baseline knows may follow from it: a gain scales a payload that it does not know, too.
    Of what is bound to the angles of the joints the zero of an encoder moves what the baseline
    knows; the rest is fitted by the angle that is read (see `verdict/true_angles.py`).
    """
    known, target = observations.known, observations.target
    bound = known or replace(model, effects=())
    runs = tuple(_with_nominal_torque(run, model, bound) for run in observations.runs)
    if known is not None:
        target = tuple(
            part if old.state.nominal is None else part - new.rows(
                known.following_torque(new.state) - known.following_torque(old.state))
            for part, old, new in zip(target, observations.runs, runs))
    kept = lasting(observations._kept) if same_scale(observations.runs, runs) else {}
    return replace(observations, _kept=kept, runs=runs, target=target)


def same_scale(runs: Sequence[Run], others: Sequence[Run]) -> bool:
    """Return whether drives tell the torque of runs in the same scale, as far as known."""
    return all(np.array_equal(scale, other) for scale, other in zip(*(
        [1.0 if run.state.nominal is None else run.state.nominal.scale for run in part]
        for part in (runs, others)), strict=True))


def _with_nominal_torque(run: Run, model: Model, bound: Model | None = None) -> Run:
    own = replace(model, apart=dict(run.apart)) if run.apart else model
    return replace(run, state=run.state.with_nominal(own.nominal(run.state, bound)))


def remembered(observations: Observations, memory: float) -> Observations:
    """Return the observations without rows that follow from what was before a log, see `Run`."""
    return replace(observations, runs=tuple(run.remembered(memory) for run in observations.runs))


def sure_rows(observations: Observations, model: Model) -> Observations:
    """Return the observations without rows where the law of an effect does not tell its torque.

    They stay as they are where that would leave less than `LEAST_SURE` of them.

    Args:
        observations: rows.
        model: with the effects that the machine is believed to have.
    """
    runs = list(observations.runs)
    for active in model.effects:
        runs = [run.without(active.effect.is_unsure(run.state)) for run in runs]
    before, after = (sum(int(run.valid.sum()) for run in part)
                     for part in (observations.runs, runs))
    return observations if after < LEAST_SURE * before or before == after else replace(
        observations, runs=tuple(runs))


def is_worse_where_unsure(observations: Observations, model: Model, left: Sequence[np.ndarray]
                          ) -> bool:
    """Return whether far more is left where a law does not tell a torque than elsewhere.

    Args:
        observations: rows.
        model: with the effects that the machine is believed to have.
        left: of the rows of each run, (m, J), N m.
    """
    sure = [run.valid for run in sure_rows(observations, model).runs]
    unsure = [run.valid & ~valid for run, valid in zip(observations.runs, sure)]
    there, elsewhere = (
        sum(float(np.sum(part[valid] ** 2)) for part, valid in zip(left, masks))
        / max(sum(int(valid.sum()) for valid in masks), 1) for masks in (unsure, sure))
    return there > WORSE * elsewhere


def lasting(kept: dict[Any, Any]) -> dict[Any, Any]:
    """Return those of the kept columns whose effect does not depend on the nominal torque."""
    return {(source, shape): value for (source, shape), value in kept.items()
            if not source.needs_nominal}
