"""A diagnosis in words, and `diagnosis.json`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.diagnosis import Cause, Diagnosis
from par4_identification.diagnosis.next_experiment import NextExperiment
from par4_identification.outcome.next_experiment import advice, next_experiment_json
from par4_identification.outcome.outcome import FLOOR_EXCESS, over_joints
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome, Remark
from par4_sim.report.results import plain
from par4_sim.report.words import (
    in_words,
    joint_labels,
    listed,
    number,
    percent,
    unit_on,
)

ALL = 0.999
"""Share beyond which an interval says no more."""
STANDS_OUT = 2.0
"""Standard deviations within which a sentence leaves a size out beside another that stands out."""


def outcome_of_diagnosis(diagnosis: Diagnosis, machine: Robot | Axis,
                         experiment: NextExperiment | None = None) -> Outcome:
    """Return the verdict in words, and what to do next."""
    if diagnosis.verdict == 'unusable_data':
        # a reason says what was found and, behind a semicolon, what to do
        parts = [reason.partition('; ') for reason in diagnosis.reasons]
        return Outcome(
            f'These data cannot carry a diagnosis: {parts[0][0]}.', 'bad',
            tuple(Remark(False, f'{_capital(found)}.', f'{_capital(do)}.' if do else '')
                  for found, _, do in parts))
    holdout, unit = diagnosis.holdout, unit_on(machine, 'N m')
    before, after, noise = (f'{number(over_joints(rms), 2)} {unit}' for rms in (
        holdout.baseline_rms, holdout.extended_rms, holdout.noise_floor_rms))
    remarks = _remarks(diagnosis, experiment)
    nearest = diagnosis.remaining.nearest
    looks_like = (diagnosis.remaining.phrase
                  or (nearest and f'{nearest.phrase}, which does not pass as a cause')
                  or 'something that follows nothing in the motion')
    if diagnosis.verdict == 'clean':
        return Outcome(
            f'The model describes this machine down to its noise: on data it has not seen it '
            f'leaves {before}, the noise floor being {noise}, and no known cause explains any of '
            f'that.', 'good', remarks)
    if diagnosis.verdict == 'unknown':
        return Outcome(
            f'The model is wrong by {before} on data it has not seen, the noise floor being '
            f'{noise}, and no cause in the library accounts for it; it looks like {looks_like}.',
            'fair', remarks)
    names = phrase_of_causes(diagnosis.causes, machine)
    rattling = not all(cause.predictable for cause in diagnosis.causes)
    if rattling and len(diagnosis.causes) == 1:
        return Outcome(
            f'The machine has {names}: its load rattles after the torque has turned over, by '
            f'{before} on data the model has not seen, the noise floor being {noise}, '
            f'which no function of the recorded motion gives.', 'fair', remarks)
    them = 'it' if len(diagnosis.causes) == 1 else 'them'
    sentence = (f"The machine has {names}; with {them} the model's error on data it has not seen "
                f'falls from {before} to {after}, the noise floor being {noise}')
    if rattling:
        return Outcome(f'{sentence}; loads that rattle remain, which no function of the recorded '
                       f'motion gives.', 'fair', remarks)
    if diagnosis.verdict == 'partly_explained':
        return Outcome(f'{sentence}; {looks_like} remains unexplained.', 'fair', remarks)
    return Outcome(f'{sentence}.', 'good' if all(remark.good for remark in remarks) else 'fair',
                   remarks)


def phrase_of_cause(cause: Cause, machine: Robot | Axis) -> str:
    """Return a cause with its size and joints, as '0.61 N m of cogging torque on joint 2'."""
    return ' '.join(filter(None, (_phrase_of_size(cause, machine), _phrase_of_joints(
        cause, machine))))


def phrase_of_causes(causes: Sequence[Cause], machine: Robot | Axis) -> str:
    """Return the causes with their sizes, the joints once where they are the same."""
    sizes = [_phrase_of_size(cause, machine) for cause in causes]
    joints = {_phrase_of_joints(cause, machine) for cause in causes}
    if len(causes) > 1 and len(joints) == 1 and joints != {''}:
        return f'{listed(sizes)}, {"both" if len(causes) == 2 else "all of them"} {joints.pop()}'
    return listed([phrase_of_cause(cause, machine) for cause in causes])


def _phrase_of_size(cause: Cause, machine: Robot | Axis) -> str:
    effect = cause.effect
    first, *others = effect.parameters
    sizes = {item.name: _size(cause.parameters[item.name], machine) for item in effect.parameters}
    if any(item.unit == first.unit for item in others):  # parts of one whole, as x, y, z
        parts = ', '.join(f'{in_words(name)} {size}' for name, size in sizes.items())
        return f'{effect.phrase} ({parts})'
    shown = {item.name for item in effect.parameters
             if _stands_out(cause.parameters[item.name])} or set(sizes)
    amount = sizes[first.name]
    if first.unit in ('', '1'):
        amount = _size(cause.parameters[first.name], machine, 100.0) + ' %'
    shape = [f'{sizes[item.name].rsplit(" ", 1)[0]} periods a turn' if item.unit == '1/turn' else
             f'{in_words(item.name.removeprefix(f"{effect.name}_"))} {sizes[item.name]}'
             for item in others if item.name != 'phase' and item.name in shown]
    whole = f'{amount} of {effect.phrase}' if first.name in shown else effect.phrase
    return f'{whole} with {listed(shape)}' if shape else whole


def _stands_out(parameter: Parameter) -> bool:
    """Return whether a value, or one of the joints' values, is more than what chance makes."""
    return parameter.std is None or bool(np.any(
        np.abs(parameter.value) > STANDS_OUT * np.asarray(parameter.std)))


def _phrase_of_joints(cause: Cause, machine: Robot | Axis) -> str:
    joints = joint_labels(machine)
    if len(joints) == 1 or all(item.scope == 'machine' for item in cause.effect.parameters):
        return ''
    if len(cause.joints) == len(joints):
        return 'on all joints'
    numbers = listed([str(joint) for joint in cause.joints])
    return f'on joint{"s" if len(cause.joints) > 1 else ""} {numbers}'


def _size(parameter: Parameter, machine: Robot | Axis, factor: float = 1.0) -> str:
    """Return a value, or the range of the joints' values, with its unit if it has one."""
    unit = unit_on(machine, parameter.unit)
    values = factor * np.atleast_1d(np.asarray(parameter.value, dtype=float))
    low, high = float(values.min()), float(values.max())
    text = number(float(values.mean()), 2)
    if high - low > 0.1 * max(abs(low), abs(high)):
        text = f'{number(low, 2)} to {number(high, 2)}'
    return text if unit in ('', '1') else f'{text} {unit}'


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _remarks(diagnosis: Diagnosis, experiment: NextExperiment | None) -> tuple[Remark, ...]:
    remarks = [Remark(False, f'Names were withheld: {reason}.') for reason in diagnosis.reasons]
    remarks.append(_remaining_remark(diagnosis))
    if any(cause.predictable for cause in diagnosis.causes):
        low, high = diagnosis.holdout.interval
        fraction = diagnosis.holdout.explained_fraction
        share = (f'{percent(fraction)} of the gap to the noise floor in mean squares (95 % '
                 f'interval {percent(low)} to {percent(high)})' if low < ALL else
                 f'more than {percent(ALL)} of the gap to the noise floor in mean squares')
        remarks.append(Remark(
            True, f'The extended model closes {share}, on rows that took no part in finding it.',
            'Simulate and feed forward with extended_model.yaml in place of the old model.'))
    for cause in diagnosis.causes:
        if not cause.predictable:
            remarks.append(Remark(
                False, f'{_capital(cause.effect.phrase)} is read off where the residual is large, '
                f'not off its course; the size is good to a third.',
                'Preload or adjust the transmission; feedforward alone does not remove it.'))
        if cause.twins:
            remarks.append(Remark(
                False, f'On this motion {cause.effect.phrase} cannot be told from '
                f'{listed([in_words(name) for name in cause.twins])}.',
                advice(cause.effect.name, experiment)
                or 'To tell such names apart, add a bag of slow wide sweeps and one with a known '
                'payload.'))
    if diagnosis.verdict == 'clean':
        remarks.append(Remark(True, 'Effects below the noise floor of these data, and those that '
                                    'the base parameters swallow, are not excluded.'))
    return tuple(remarks)


def _remaining_remark(diagnosis: Diagnosis) -> Remark:
    remaining = diagnosis.remaining
    if remaining.significant:
        return Remark(
            False, f'{_capital(remaining.phrase)}, without a name, would remove '
            f'{percent(remaining.gain.share)} of the squared error left on held-out rows (95 % '
            f'interval {percent(remaining.gain.low)} to {percent(remaining.gain.high)}).',
            f'Look for a cause outside the library that acts as {remaining.phrase}.')
    if remaining.nearest is not None:
        return Remark(
            False, f'{_capital(remaining.nearest.phrase)} would explain some of it, on held-out '
            f'rows as well, but does not pass as a cause.',
            'See among the rejected names why; more data or a motion of another kind may decide.')
    size = (f'Nothing that follows the motion remains; the residual is '
            f'{number(remaining.floor_excess, 2)} times the noise floor')
    if remaining.floor_excess <= FLOOR_EXCESS:
        return Remark(True, f'{size}.')
    return Remark(False, f'{size}, which is more than noise should leave.',
                  'Record a bag with dwells, so that the noise is measured, and look for a source '
                  'of noise that changes with time.')


def diagnosis_json(diagnosis: Diagnosis, machine: Robot | Axis,
                   experiment: NextExperiment | None = None) -> dict[str, Any]:
    """Return `diagnosis.json`; what there is not is null."""
    holdout, remaining = diagnosis.holdout, diagnosis.remaining
    content = {
        'schema': 'par4/diagnosis/1', 'verdict': diagnosis.verdict,
        'causes': [{
            'effect': cause.effect.name, 'joints': cause.joints,
            'parameters': {name: {'value': parameter.value, 'std': parameter.std,
                                  'unit': unit_on(machine, parameter.unit)}
                           for name, parameter in cause.parameters.items()},
            'indistinguishable_from': cause.twins, 'visible_fraction': cause.visible_fraction,
            'p_value': cause.p_value} for cause in diagnosis.causes],
        'holdout': holdout and {
            'baseline_rms': holdout.baseline_rms, 'extended_rms': holdout.extended_rms,
            'noise_floor_rms': holdout.noise_floor_rms,
            'explained_fraction': holdout.explained_fraction,
            'explained_fraction_ci': holdout.interval},
        'remaining': remaining and {
            'significant': remaining.significant, 'looks_like': remaining.looks_like},
        'next_experiment': next_experiment_json(experiment),
        'extended_model': diagnosis.extended_model and 'extended_model.yaml'}
    if diagnosis.reasons:
        content['reasons'] = diagnosis.reasons
    return plain(content)
