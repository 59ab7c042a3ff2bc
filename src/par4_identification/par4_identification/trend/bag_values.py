"""What one bag says of a machine: one task, independent of all others."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from par4_dynamics.effects.backlash import Backlash
from par4_dynamics.effects.geometry_error import DIMENSIONS, GeometryError
from par4_dynamics.model import ActiveEffect, Model
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model
from par4_dynamics.parameters import Parameter
from par4_identification.changes.changes import observed
from par4_identification.changes.joint_values import (
    JointValues,
    fitted_values,
    torque_left,
    whitened,
)
from par4_identification.diagnosis.diagnosis import CONDITIONING
from par4_identification.diagnosis.evidence.estimates import effect_parameters
from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import Observations, with_nominal
from par4_identification.diagnosis.search.shapes import order_name
from par4_identification.diagnosis.verdict.rattle import gaps
from par4_identification.fitting.validation import LARGEST_ERROR
from par4_identification.logs.read_log import read_log
from par4_identification.setup_check.check import check_setup
from par4_identification.signals.scales import conditioning_for
from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.robot import Axis, Robot
from par4_kinematics.stamps import SECOND
from par4_sim.report.words import percent

EARLIEST = 946_684_800_000_000_000
"""Stamp (ns) of the year 2000: earlier ones count from the start of a machine or simulation."""
FORMAT = 3
"""Of what is kept of a bag; another one when the calculation changes."""


@dataclass(frozen=True)
class EffectSize:
    """The size of a known effect in one bag.

    Attributes:
        label: effect, parameter and, where each joint has one, the joint.
        value, std: of it.
        unit: of both.
    """

    label: str
    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class BagValues:
    """What a bag says.

    Attributes:
        bag: its path.
        stamp: of its first sample, ns since 1970.
        duration: s.
        terms: names of the base parameters.
        values: of every joint, (J, p).
        covariance: joint after joint, (J p, J p).
        effects: sizes of the known effects.
        findings: mistakes of the setup that were mended, sentences.
    """

    bag: str
    stamp: int
    duration: float
    terms: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    effects: tuple[EffectSize, ...] = ()
    findings: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON takes it."""
        return {'bag': self.bag, 'stamp': self.stamp, 'duration': self.duration,
                'terms': list(self.terms), 'values': self.values.tolist(),
                'covariance': self.covariance.tolist(),
                'effects': [vars(item) for item in self.effects],
                'findings': list(self.findings)}

    @classmethod
    def from_json(cls, content: Mapping[str, Any], bag: str) -> BagValues:
        """Return what `to_json` gave, of a bag that may have another path now.

        Raises:
            ValueError: it is something else, as a file that somebody has changed.
        """
        try:
            found = cls(bag, int(content['stamp']), float(content['duration']),
                        tuple(content['terms']), np.array(content['values'], dtype=float),
                        np.array(content['covariance'], dtype=float),
                        tuple(EffectSize(**item) for item in content['effects']),
                        tuple(content['findings']))
        except (KeyError, TypeError, OverflowError) as error:
            raise ValueError(f'no result of a bag: {error}') from error
        rows, columns = found.values.shape if found.values.ndim == 2 else (0, 0)
        if not (columns == len(found.terms) > 0 and found.covariance.shape == (
                rows * columns, rows * columns) and rows > 0):
            raise ValueError('values, covariance and terms do not go together')
        return found


def without_date(start_stamp: int) -> str:
    """Return that a bag whose stamps begin at `start_stamp`, ns, has no date, and what to do."""
    return (f'its stamps begin {start_stamp / SECOND:.0f} s after 1970, so it has no date; record '
            f'with the wall clock, give par4_bag times with dates, or simulate with par4_simulate '
            f'--date')


def values_of_bag(bag: str, machine: Robot | Axis, model_file: ModelFile | None = None,
                  namespace: str | None = None) -> BagValues:
    """Return what a bag says of a machine.

    Args:
        bag: path of it.
        machine: that it should be of.
        model_file: whose rigid body is known and whose effects are followed.
        namespace: that the topics sit under.

    Raises:
        Par4Error: a bag that cannot be read, has no date, is of another machine, or does not tell
            the parameters.
    """
    log = read_log(bag, machine, namespace)
    if log.start_stamp < EARLIEST:
        raise InputError(f'{bag}: {without_date(log.start_stamp)}')
    check = check_setup([log], machine)
    if check.useless:
        raise InputError(f'{bag}: {check.useless[0].evidence}')
    if any(finding.finding == 'wrong_dimensions' for finding in check.findings):
        raise InputError(f'{bag}: it does not fit the dimensions of {machine.name}; give the robot '
                         f'file of the machine that made it')
    rigid_body = model_file.rigid_body if model_file else 'paper'
    model = None if model_file is None else build_model(machine, model_file)
    model, loose = (None, ()) if model is None else _without_gaps(model)
    followed, known = ([], None) if model is None else _known(model)
    try:
        observations = observed(check.logs, machine, rigid_body, known, conditioning_for(
            check.logs, machine, CONDITIONING))
        if model is not None:
            observations = with_nominal(observations, model)
        found = fitted_values(observations, followed)
        evidence = whitened(observations, followed)
        fit = solve(evidence, followed)
    except np.linalg.LinAlgError as error:
        raise InputError(f'{bag}: no parameter can be told from it; record a longer motion of all '
                         f'joints') from error
    left = _relative_error(observations, found)
    if left > LARGEST_ERROR:
        raise InputError(f'{bag}: {percent(left)} of its torque is left by the model of '
                         f'{machine.name}; it seems to be of another robot')
    return BagValues(
        bag, log.start_stamp, float(log.t[-1]), tuple(term.name for term in found.terms),
        found.values, found.covariance,
        (*(size for index, item in enumerate(followed)
           for size in sizes_of_effect(item, effect_parameters(evidence, item, fit, index),
                              len(found.values))),
         *_gaps(loose, observations, found)),
        tuple(finding.evidence for finding in check.findings))


def _relative_error(observations: Observations, found: JointValues) -> float:
    """Return |residual| / |torque| of the base parameters of every joint, over all valid rows."""
    left, torque = 0.0, 0.0
    for run, rest in zip(observations.runs, torque_left(observations, found)):
        left += float(np.sum(rest[run.valid] ** 2))
        torque += float(np.sum(run.tau[run.valid] ** 2))
    return math.sqrt(left / max(torque, 1e-300))


def outcome_of_bag(bag: str, machine: Robot | Axis, model_file: ModelFile | None,
                   namespace: str | None) -> dict[str, Any]:
    """Return what a bag says as JSON takes it, or `error`: why it says nothing."""
    try:
        return values_of_bag(bag, machine, model_file, namespace).to_json()
    except Par4Error as error:
        return {'error': str(error)}
    except OSError as error:
        return {'error': f'{bag}: {error.strerror or error}'}


def _without_gaps(model: Model) -> tuple[Model, tuple[int, ...]]:
    """Return the model without backlash, and the joints that it says have some.

    A load that bounces in a gap follows no column: its gap is read from what the fit leaves.
    """
    loose = tuple(joint for active in model.effects if active.effect.name == Backlash.name
                  for joint in active.joints)
    return replace(model, effects=tuple(
        active for active in model.effects if active.effect.name != Backlash.name)), loose


def _known(model: Model) -> tuple[list[Hypothesis], Model]:
    """Return the effects whose sizes are followed, and the model of all that is known beside."""
    followed = [active for active in model.effects if _has_size(active)]
    kept = tuple(active for active in model.effects if active not in followed)
    hypotheses = [Hypothesis(active.effect, active.effect.shape_of_joints(
        active.values, active.joints), active.joints, _sets(active)) for active in followed]
    return hypotheses, replace(model, effects=kept)


def _has_size(active: ActiveEffect) -> bool:
    """Return whether one bag tells the size of an effect beside base parameters of each joint."""
    effect = active.effect
    return not (effect.fixed_coefficients or effect.against_the_others or effect.of_base
                ) and len(effect.coefficients(active.values)) > 0


def _sets(active: ActiveEffect) -> tuple[int, ...] | None:
    """Return which dimensions the model says are others, None for all that an effect has.

    One motion does not tell all dimensions apart.
    """
    if active.effect.name != GeometryError.name:
        return None
    return tuple(number for number, name in enumerate(DIMENSIONS) if active.values[name].any())


def _gaps(loose: Sequence[int], observations: Observations, found: JointValues
          ) -> list[EffectSize]:
    """Return the gaps of joints that are loose, where the motion tells them."""
    if not loose:
        return []
    told = gaps(observations, torque_left(observations, found))
    return [EffectSize(f'{Backlash.name}.gap[{joint}]', *gap, unit='rad')
            for joint, gap in enumerate(told) if joint in loose and gap is not None]


def sizes_of_effect(item: Hypothesis, parameters: Mapping[str, Any], joints: int
                    ) -> list[EffectSize]:
    """Return the sizes of an effect on a machine of so many joints, those that are fitted.

    What has no deviation is not fitted: a shape that the model leaves out, the range of a series.
    """
    found = []
    for parameter in item.named.parameters:
        told = parameters[parameter.name]
        if parameter.name in item.shape or told.std is None or not np.any(told.std):
            continue
        orders = _orders(item, told) if parameter.per_order else ('',)
        values, stds = (np.reshape(part, (len(orders), -1)) for part in (told.value, told.std))
        for order, own, own_std in zip(orders, values, stds):
            name = f'{item.effect.name}.{parameter.name}{order}'
            each = parameter.scope == 'joint' and joints > 1
            for place, (value, std) in enumerate(zip(own, own_std)):
                where = (f'[{item.joints[place]}]' if each else
                         f'.{"xyz"[place]}' if len(own) > 1 else '')
                found.append(EffectSize(name + where, float(value), float(std), told.unit))
    return found


def _orders(item: Hypothesis, told: Parameter) -> tuple[str, ...]:
    """Return what labels say of each order of a periodic torque or term of a series."""
    name = order_name(item.named)
    if name is None:
        return tuple(f'.term_{number}' for number in range(np.shape(told.value)[0]))
    orders = np.ravel(item.shape[name])
    return tuple(f'.order_{order:g}' for order in orders) if len(orders) > 1 else ('',)
