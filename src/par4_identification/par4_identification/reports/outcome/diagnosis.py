"""A diagnosis in words, and `diagnosis.json`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from par4_dynamics.parameters import Parameter, parts_of_orders
from par4_identification.diagnosis.experiment.next_experiment import NextExperiment
from par4_identification.diagnosis.search.shapes import highest_order
from par4_identification.diagnosis.verdict.answer import Cause, Diagnosis, Unusable
from par4_identification.diagnosis.verdict.unrelated import Unrelated
from par4_identification.reports.outcome.next_experiment import advice, next_experiment_json
from par4_identification.reports.outcome.outcome import FLOOR_EXCESS, LOUD, over_joints
from par4_identification.signals.rows import Run, longest_motion
from par4_kinematics.machine_units import parameter_unit, unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome, Remark, note
from par4_sim.report.results import plain
from par4_sim.report.words import (
    capital,
    in_words,
    joint_labels,
    listed,
    number,
    percent,
    torque_name,
)

TOLD = 6
"""Orders of a periodic torque that a sentence names one by one."""
NEAR = 0.51
"""Periods a turn of the joint by which an order, found as a whole number, may be off."""
ALL = 0.999
"""Share beyond which an interval says no more."""
NOISELESS = 1e-6
"""Noise floor over the torque below which no torque was measured as it is: a converter of 16 bits
alone makes ten times as much."""
NO_FUNCTION = 'a torque that follows nothing known of the motion'
"""What is left where it is too much for noise and no function fits it."""
FITTED_ALONE = 'something that acts in the fitted recordings alone'
"""What is left where far more is left of the fitted rows than of those held out."""
STANDS_OUT = 2.0
"""Standard deviations within which a sentence leaves a size out beside another that stands out."""


def outcome_of_diagnosis(diagnosis: Diagnosis | Unusable, machine: Robot | Axis,
                         experiment: NextExperiment | None = None) -> Outcome:
    """Return the verdict in words, and what to do next."""
    if isinstance(diagnosis, Unusable):
        # a reason says what was found and, behind a semicolon, what to do
        parts = [reason.partition('; ') for reason in diagnosis.reasons]
        return Outcome(
            f'These data cannot carry a diagnosis: {diagnosis.reasons[0]}.', 'bad',
            tuple(Remark(False, f'{capital(found)}.', f'{capital(do)}.' if do else '')
                  for found, _, do in parts))
    holdout, unit = diagnosis.holdout, unit_on(machine, 'N m')
    errors = [over_joints(rms) for rms in (
        holdout.baseline_rms, holdout.extended_rms, holdout.noise_floor_rms)]
    digits = 2 if number(errors[0], 2) != number(errors[1], 2) else 3
    before, after, noise = (f'{number(error, own)} {unit}'
                            for error, own in zip(errors, (digits, digits, 2)))
    remarks = _remarks(diagnosis, machine, experiment)
    nearest = diagnosis.remaining.nearest
    beside = (' and '.join([*(item.phrase for item in diagnosis.unnamed),
                            *_phrases_of_unrelated(diagnosis.remaining.unrelated),
                            *_phrase_of_swing(diagnosis.remaining.swing_hz),
                            *([FITTED_ALONE] if diagnosis.fitted_unlike else [])])
              or (nearest and f'{nearest.phrase}, which does not pass as a cause')
              or (diagnosis.remaining.no_noise and NO_FUNCTION)
              or 'a torque that changes from speed to speed')
    if diagnosis.verdict == 'clean':
        wandering = ('' if not diagnosis.remaining.unrelated.wanders else
                     ', most of it noise that wanders and follows nothing in the motion')
        sentence = (f'The model describes this machine down to its noise: on data it has not seen '
                    f'it leaves {before}, the noise floor being {noise}{wandering}, and no known '
                    f'cause explains any of that')
        share = holdout.loudness
        if share < LOUD:
            return Outcome(f'{sentence}.', 'good', remarks)
        return Outcome(f'{sentence}; that is {percent(share)} of the {torque_name(machine)}, so '
                       f'that whatever is smaller stays hidden.', 'fair', remarks)
    if diagnosis.verdict == 'unknown':
        return Outcome(
            f'The model is wrong by {before} on data it has not seen, the noise floor being '
            f'{noise}, and no cause in the library accounts for it; it looks like {beside}.',
            'fair', remarks)
    names = phrase_of_causes(diagnosis.causes, machine)
    rattling = not all(cause.predictable for cause in diagnosis.causes)
    if rattling and len(diagnosis.causes) == 1:
        return Outcome(
            f'The machine has {names}: its load rattles after the torque has turned over, by '
            f'{before} on data the model has not seen, the noise floor being {noise}, '
            f'which no function of the recorded motion gives.', 'fair', remarks)
    them = 'it' if len(diagnosis.causes) == 1 else 'them'
    falls = (f'falls from {before} to {after}' if before != after else f'stays at {after}')
    sentence = (f"The machine has {names}; with {them} the model's error on data it has not seen "
                f'{falls}, the noise floor being {noise}')
    if rattling:
        return Outcome(f'{sentence}; loads that rattle remain, which no function of the recorded '
                       f'motion gives.', 'fair', remarks)
    if diagnosis.verdict == 'partly_explained':
        return Outcome(f'{sentence}; without a name: {beside}.', 'fair', remarks)
    return Outcome(f'{sentence}.', 'good' if all(remark.good for remark in remarks) else 'fair',
                   remarks)


def _phrase_of_swing(frequency_hz: float | None) -> list[str]:
    return [] if frequency_hz is None else [
        f'something that swings at {number(frequency_hz, 2)} Hz']


def _phrases_of_unrelated(found: Unrelated) -> list[str]:
    """Return lines and bursts in words."""
    phrases = []
    if found.lines:
        frequencies = listed([number(line.frequency_hz, 3) for line in found.lines])
        phrases.append(f'a disturbance of {frequencies} Hz that follows nothing in the motion')
    if found.bursts:
        times = listed([f'{number(start, 3)} s' for start, _ in found.bursts[:3]])
        phrases.append(f'{"a burst" if len(found.bursts) == 1 else "bursts"} of noise at {times}')
    return phrases


def phrase_of_cause(cause: Cause, machine: Robot | Axis) -> str:
    """Return a cause with its size and joints, as '0.61 N m of cogging torque on joint 2'."""
    return ' '.join(filter(None, (_phrase_of_name(cause, machine), _phrase_of_joints(
        cause, machine))))


def phrase_of_causes(causes: Sequence[Cause], machine: Robot | Axis) -> str:
    """Return the causes with their sizes, the joints once where they are the same."""
    sizes = [_phrase_of_name(cause, machine) for cause in causes]
    joints = {_phrase_of_joints(cause, machine) for cause in causes}
    if len(causes) > 1 and len(joints) == 1 and joints != {''}:
        return f'{listed(sizes)}, {"both" if len(causes) == 2 else "all of them"} {joints.pop()}'
    return listed([phrase_of_cause(cause, machine) for cause in causes])


def _phrase_of_name(cause: Cause, machine: Robot | Axis) -> str:
    """Return a cause with its size, and the names from which these data do not tell it."""
    size = _phrase_of_size(cause, machine)
    return size if not cause.twins else (
        f'{size} (or {" or ".join(in_words(name) for name in cause.twins)})')


def _phrase_of_size(cause: Cause, machine: Robot | Axis) -> str:
    effect = cause.effect
    first, *others = effect.parameters
    if any(item.per_order and isinstance(cause.parameters[item.name].value, tuple)
           and item.is_shape for item in effect.parameters):
        return _phrase_of_orders(cause, machine)
    reach = _reach(cause)
    if reach is not None:
        return (f'{number(reach[0], 2)} to {number(reach[1], 2)} {unit_on(machine, first.unit)} of '
                f'{effect.phrase}')
    sizes = {item.name: _size(cause.parameters[item.name], machine) for item in effect.parameters}
    if any(item.unit == first.unit for item in others):  # parts of one whole, as x, y, z
        told = [name for name in sizes if _stands_out(cause.parameters[name])] or list(sizes)
        parts = ', '.join(f'{in_words(name)} {sizes[name]}' for name in told)
        return f'{effect.phrase} ({parts})'
    told = [item.name for item in effect.parameters
            if np.any(np.asarray(cause.parameters[item.name].value) != 0.0)
            and not (item.is_shape and np.all(np.asarray(
                cause.parameters[item.name].value) == item.default))]
    # a power of the speed is its size and its exponent, however uncertain each alone is
    power = any(item.at_unit_speed for item in effect.parameters)
    shown = {name for name in told if power or _stands_out(cause.parameters[name])} or set(told)
    amount = sizes[first.name]
    if first.unit in ('', '1'):
        amount = _size(cause.parameters[first.name], machine, 100.0) + ' %'
    shape = [_phrase_of_periods(cause.parameters[item.name].number, machine)
             if item.unit == '1/turn' else
             f'{in_words(item.name.removeprefix(f"{effect.name}_"))} {sizes[item.name]}'
             for item in others if item.name != 'phase' and item.name in shown]
    whole = f'{amount} of {effect.phrase}' if first.name in shown else effect.phrase
    return f'{whole} with {listed(shape)}' if shape else whole


def _reach(cause: Cause) -> tuple[float, float] | None:
    """Return the least and the greatest torque of a series, N m, whose terms say little; or None.
    """
    terms = [item for item in cause.effect.parameters if item.per_order]
    if not terms or any(item.is_shape for item in terms):  # of a periodic torque, orders
        return None
    values = {name: np.asarray(own.value, dtype=float) for name, own in cause.parameters.items()}
    for item in terms:  # as effects take them, (J, terms)
        values[item.name] = np.reshape(values[item.name], (-1, len(cause.joints))).T
    return cause.effect.reach(values)


def _phrase_of_orders(cause: Cause, machine: Robot | Axis) -> str:
    """Return a periodic torque of several orders, the strongest of them one by one."""
    first, *others = cause.effect.parameters
    periods = next(item.name for item in others if item.unit == '1/turn')
    relative = first.unit in ('', '1')
    unit = unit_on(machine, first.unit)
    orders = []
    for order, size in zip(np.ravel(cause.parameters[periods].value),
                           parts_of_orders(cause.parameters[first.name].value), strict=True):
        sizes = np.atleast_1d(np.asarray(size, dtype=float))
        mean = float(np.mean(sizes))
        text = f'{number(100.0 * mean, 2)} %' if relative else f'{number(mean, 2)} {unit}'
        orders.append((mean, f'{text} with {_phrase_of_periods(float(order), machine)}'))
    orders.sort(key=lambda item: -item[0])
    told = [text for _, text in orders[:TOLD]]
    if len(orders) > TOLD:
        told.append(f'{len(orders) - TOLD} weaker orders')
    return f'{cause.effect.phrase} of {len(orders)} orders ({", ".join(told)})'


def _phrase_of_periods(order: float, machine: Robot | Axis) -> str:
    """Return an order in words, with what makes it where the nameplate tells; a pitch of a slide.
    """
    if isinstance(machine, Axis) and machine.kind == 'linear':
        return f'a pitch of {number(2e3 * np.pi / order, 3)} mm'
    whole = abs(order - round(order)) < 1e-3
    count = f'{order:.0f}' if whole else number(order, 5)
    source = source_of_order(order, machine)
    return f'{count} periods a turn' + (f', {source}' if source else '')


def source_of_order(order: float, machine: Robot | Axis) -> str | None:
    """Return which part of a drive makes so many periods a turn of the joint, if that is known.

    A motor's magnets make multiples of its pole pairs in a turn of the motor, its slots other
    whole numbers; what is no whole number of them comes from behind the gear. A weight off the axis
    of the joint pulls once in its turn.
    """
    if not isinstance(machine, Axis) or machine.kind == 'linear':
        return None
    gear, pairs = machine.gear_ratio, machine.pole_pairs
    if order == 1.0:
        return 'as of a weight off the axis'
    if gear is None and pairs is None:
        return None
    in_motor = order / (gear or 1.0)
    times = round(in_motor)
    if times < 1 or abs(in_motor - times) > NEAR / (gear or 1.0):
        return 'of the gear or the encoder behind it'
    if pairs is not None and times % pairs == 0:
        multiple = times // pairs
        return 'the motor\'s pole pairs' if multiple == 1 else (
            f'{multiple} times the motor\'s pole pairs')
    if gear is not None and gear != 1.0 and times == 1:
        return 'a turn of the motor'
    return f'{times} in a turn of the motor, as of its slots' if (gear or 1.0) != 1.0 else (
        'as of the motor\'s slots')


def _stands_out(parameter: Parameter) -> bool:
    """Return whether a value, or one of the joints' values, is more than what chance makes."""
    return parameter.std is None or bool(np.any(told_from_zero(
        np.asarray(parameter.value, dtype=float), np.asarray(parameter.std, dtype=float))))


def told_from_zero(values: np.ndarray, stds: np.ndarray) -> np.ndarray:
    """Return which values (...) are farther from zero than their standard deviations explain."""
    return np.abs(values) > STANDS_OUT * stds


def _phrase_of_joints(cause: Cause, machine: Robot | Axis) -> str:
    joints = joint_labels(machine)
    if len(joints) == 1 or all(item.scope == 'machine' for item in cause.effect.parameters):
        return ''
    if len(cause.joints) == len(joints):
        return 'on all joints'
    numbers = listed([str(joint) for joint in cause.joints])
    return f'on joint{"s" if len(cause.joints) > 1 else ""} {numbers}'


def _size(parameter: Parameter, machine: Robot | Axis, factor: float = 1.0) -> str:
    """Return a value, or the range of those of the joints that are not zero by chance, with its
    unit if it has one.
    """
    unit = unit_on(machine, parameter.unit)
    values = factor * np.atleast_1d(np.asarray(parameter.value, dtype=float))
    if parameter.std is not None:
        told = told_from_zero(values, factor * np.atleast_1d(
            np.asarray(parameter.std, dtype=float)))
        values = values[told] if told.any() else values
    low, high = float(values.min()), float(values.max())
    text = number(float(values.mean()), 2)
    if high - low > 0.1 * max(abs(low), abs(high)):
        text = f'{number(low, 2)} to {number(high, 2)}'
    return text if unit in ('', '1') else f'{text} {unit}'


def _remarks(diagnosis: Diagnosis, machine: Robot | Axis, experiment: NextExperiment | None
             ) -> tuple[Remark, ...]:
    remarks = [_unnamed_remark(diagnosis, machine, index, experiment)
               for index in range(len(diagnosis.unnamed))]
    remarks += _remaining_remarks(diagnosis, machine, experiment)
    if any(cause.predictable for cause in diagnosis.causes):
        low, high = diagnosis.holdout.interval
        fraction = diagnosis.holdout.explained_fraction
        share = (f'{percent(fraction)} of the gap to the noise floor in mean squares (95 % '
                 f'interval {percent(low)} to {percent(high)})' if low < ALL else
                 f'more than {percent(ALL)} of the gap to the noise floor in mean squares')
        remarks.append(Remark(
            True, f'The extended model closes {share}, on rows that took no part in any fit.',
            'Simulate and feed forward with extended_model.yaml in place of the old model.'))
    for cause in diagnosis.causes:
        remarks += remarks_of_cause(cause, machine, experiment)
    unit, left = unit_on(machine, 'N m'), over_joints(diagnosis.holdout.extended_rms)
    if diagnosis.fitted_unlike:
        remarks.append(Remark(
            False, f'With what was found the fitted recordings leave '
            f'{number(diagnosis.fitted_rms, 2)} {unit}, those held out {number(left, 2)} {unit}: '
            f'something acts in the former that does not in the latter.',
            'Look at the fitted recordings for a sensor that failed, something that touched the '
            'machine or a load that swings; or diagnose others.'))
    if diagnosis.share < 1.0:
        remarks.append(note(
            f'Of these long logs {100.0 * diagnosis.share:.0f} % was looked at, in stretches '
            f'spread over all of them.', 'What shows only elsewhere: give those parts as bags of '
            'their own.'))
    if diagnosis.left_out:
        names = listed([in_words(name) for name in diagnosis.left_out])
        given = any(np.any(diagnosis.extended_model.parameters[name].value)
                    for name in diagnosis.left_out)
        remarks.append(note(
            f'The motion does not show the {names}; it is taken from the model.',
            'Record faster motions to have it fitted.') if given else Remark(
            False, f'The motion does not show the {names}; it is left out and counts as zero.',
            'Record faster motions, or give a model that knows it.'))
    if diagnosis.holdout.quietness < NOISELESS:
        remarks.append(note(
            'These torques have next to no noise: they were smoothed before they were logged, '
            'computed, or are what was asked for. A multiple of their noise floor says little.',
            'Log the torque or the current as it is measured.'))
    if isinstance(machine, Axis):
        remarks += [_remark_of_filters(diagnosis, machine),
                    *_unseen_orders(diagnosis.fit_runs, machine)]
    if diagnosis.verdict == 'clean':
        remarks.append(note('Effects below the noise floor of these data, and those that the base '
                            'parameters swallow, are not excluded.'))
    return tuple(remarks)


def remarks_of_cause(cause: Cause, machine: Robot | Axis, experiment: NextExperiment | None
                     ) -> list[Remark]:
    """Return what is to be said of a cause beside its size."""
    remarks = []
    if not cause.predictable:
        remarks.append(Remark(
            False, f'{capital(cause.effect.phrase)} is read off where the residual is large, '
            f'not off its course; the size is good to a third.',
            'Preload or adjust the transmission; feedforward alone does not remove it.'))
    assumed = cause.effect.assumes({name: np.asarray(parameter.value)
                                    for name, parameter in cause.parameters.items()})
    if assumed is not None:
        remarks.append(note(assumed))
    if _is_relative(cause, machine):
        remarks.append(note(
            f'{capital(cause.effect.phrase)} is measured against the joints that are '
            f'not named: what all joints have in common belongs to the base parameters.'))
    if cause.twins:
        remarks.append(Remark(
            False, f'On this motion {cause.effect.phrase} cannot be told from '
            f'{listed([in_words(name) for name in cause.twins])}.',
            advice(cause.effect.name, experiment)
            or 'To tell such names apart, add a bag of slow wide sweeps and one with a known '
            'payload.'))
    return remarks


def _remark_of_filters(diagnosis: Diagnosis, machine: Axis) -> Remark:
    """Return how the data of an axis became rows."""
    used = diagnosis.fit_runs[0].conditioning
    if used.steady:
        count = len({float(speed) for run in (*diagnosis.fit_runs, *diagnosis.holdout.runs)
                     for speed in run.speed[run.valid]})
        return note(
            f'These logs hold one speed after the other: the mean torque of each of the '
            f'{count} plateaus is a row.', 'Record a motion that goes faster and slower to see the '
            'inertia and what depends on the position.')
    return note(
        f'Filters chosen for these data: torque below {number(used.torque_cutoff_hz, 3)} Hz, '
        f'positions below {number(used.position_cutoff_hz, 3)} Hz, {number(used.row_rate_hz, 3)} '
        f'rows a second, friction above {number(used.low_speed, 2)} {unit_on(machine, "rad/s")}; '
        f'--cutoff, --rows and --low-speed set them.')


def _unseen_orders(runs: Sequence[Run], machine: Axis) -> list[Remark]:
    """Return which periodic torques of the motor are too quick for the filter, if any are."""
    longest = longest_motion(runs)
    if machine.gear_ratio is None or longest.conditioning.steady or not longest.valid.any():
        return []
    highest = highest_order(longest)
    unseen = [machine.gear_ratio * turns for turns in (1, 2, machine.pole_pairs)
              if turns is not None and machine.gear_ratio * turns > highest]
    if not unseen:
        return []
    orders = listed([f'{order:.0f}' for order in sorted(set(unseen))])
    cutoff = longest.conditioning.torque_cutoff_hz
    slow = 2.0 * np.pi * cutoff / max(unseen)
    return [note(
        f'What the motor does with {orders} periods a turn of the joint is too quick for '
        f'the filter of {number(cutoff, 3)} Hz at the speeds of this motion and was not looked '
        f'for.', f'To see it, move at {number(slow, 2)} rad/s and slower.')]


def _is_relative(cause: Cause, machine: Robot | Axis) -> bool:
    """Return whether some joints are named where only differences between joints can show."""
    return cause.effect.against_the_others and len(cause.joints) < len(joint_labels(machine))


def _unnamed_remark(diagnosis: Diagnosis, machine: Robot | Axis, index: int,
                    experiment: NextExperiment | None) -> Remark:
    item, unit = diagnosis.unnamed[index], unit_on(machine, 'N m')
    wrong = number(over_joints(diagnosis.holdout.baseline_rms), 2)
    joints = len(joint_labels(machine))
    where = '' if len(item.joints) == joints else (
        f' on joint{"s" if len(item.joints) > 1 else ""} '
        f'{listed([str(joint) for joint in item.joints])}')
    return Remark(
        False, f'{capital(item.phrase)}{where}, without a name, has '
        f'{number(item.torque_rms, 2)} {unit} rms where the model is wrong by {wrong} {unit}; it '
        f'explains {percent(item.share)} of what all causes explain of the squared error.',
        f'Look at the machine for something that acts as {item.phrase}. '
        f'{advice(item.phrase, experiment)}'.strip())


def _remaining_remarks(diagnosis: Diagnosis, machine: Robot | Axis,
                       experiment: NextExperiment | None) -> list[Remark]:
    remaining, found = diagnosis.remaining, diagnosis.remaining.unrelated
    unit = unit_on(machine, 'N m')
    remarks = []
    if remaining.nearest is not None:
        remarks.append(Remark(
            False, f'{capital(remaining.nearest.phrase)} would explain some of it, but does not '
            f'pass as a cause.',
            f'See among the rejected names why. {advice(remaining.nearest.name, experiment)}'
            .strip()))
    if remaining.swing_hz is not None:
        remarks.append(Remark(
            False, f'Most of what is left swings at {number(remaining.swing_hz, 2)} Hz and dies '
            f'down.', 'Look for what stands or hangs on something soft: the frame, the floor, a '
            'tool, a hose. Touch it while the robot moves.'))
    for line in found.lines:
        remarks.append(Remark(
            False, f'A disturbance of {number(line.frequency_hz, 3)} Hz with '
            f'{number(float(line.amplitude.max()), 2)} {unit} follows nothing in the motion.',
            'Look for what turns or hums at that frequency: mains, the floor, a machine nearby.'))
    if found.bursts:
        spans = listed([f'{number(start, 3)} to {number(end, 3)} s'
                        for start, end in found.bursts[:5]])
        remarks.append(Remark(
            False, f'The noise is larger for some time ({spans} of the data held out'
            f'{", and more" if len(found.bursts) > 5 else ""}).',
            'Look at what happened then; leave the stretch out or record again.'))
    beside = ', with what has no name taken off,' if diagnosis.unnamed else ''
    # the noise floor that the report gives is never louder than what is left
    excess = (f'{number(remaining.floor_excess, 2)} times' if remaining.floor_excess > 1.0
              else 'no more than')
    size = f'What is left{beside} is {excess} the noise floor'
    if remaining.no_noise:
        remarks.append(Remark(
            False, f'{size}, too much for noise.',
            'Look for what acts by itself: a load with play or on a soft coupling, something that '
            'touches the machine, a current that is not that of the motor.'))
        return remarks
    if found.wanders and remaining.swing_hz is None:
        remarks.append(note(
            f'{size}: noise that wanders, {number(float(found.wandering_rms.max()), 2)} {unit} rms '
            f'with a correlation time of {number(found.correlation_time, 2)} s, to judge by its '
            f'course, as it follows no function of the motion. Play in a joint leaves the same.',
            'See whether the torque is as restless while the machine rests; if not, look for play '
            'in its joints.'))
    else:
        remarks.append(Remark(remaining.floor_excess <= FLOOR_EXCESS, f'{size}.'))
    return remarks


def diagnosis_json(diagnosis: Diagnosis | Unusable, machine: Robot | Axis,
                   experiment: NextExperiment | None = None) -> dict[str, Any]:
    """Return `diagnosis.json`; what there is not is null."""
    if isinstance(diagnosis, Unusable):
        return {'schema': 'par4/diagnosis/1', 'verdict': diagnosis.verdict, 'causes': [],
                'unnamed': [], 'holdout': None, 'remaining': None, 'next_experiment': None,
                'extended_model': None, 'reasons': list(diagnosis.reasons)}
    holdout, found = diagnosis.holdout, diagnosis.remaining.unrelated
    unnamed, swing = diagnosis.unnamed, _phrase_of_swing(diagnosis.remaining.swing_hz)
    return plain({
        'schema': 'par4/diagnosis/1', 'verdict': diagnosis.verdict,
        'causes': [{
            'effect': cause.effect.name, 'joints': cause.joints,
            'parameters': {name: {'value': parameter.value, 'std': parameter.std,
                                  'unit': parameter_unit(machine, name, parameter.unit)}
                           for name, parameter in cause.parameters.items()},
            'indistinguishable_from': cause.twins, 'visible_fraction': cause.visible_fraction,
            'p_value': cause.p_value, 'margin': cause.margin, 'rival': cause.rival}
            for cause in diagnosis.causes],
        'unnamed': [{'acts_like': item.phrase, 'joints': item.joints,
                     'torque_rms': item.torque_rms, 'share': item.share} for item in unnamed],
        'holdout': {
            'baseline_rms': holdout.baseline_rms, 'extended_rms': holdout.extended_rms,
            'noise_floor_rms': holdout.noise_floor_rms,
            'explained_fraction': holdout.explained_fraction,
            'explained_fraction_ci': holdout.interval},
        'remaining': {
            'significant': bool(unnamed or found.lines or found.bursts or swing
                                or diagnosis.remaining.uneven or diagnosis.remaining.no_noise
                                or diagnosis.fitted_unlike),
            'looks_like': next((item.phrase for item in unnamed), swing[0] if swing else
                               NO_FUNCTION if diagnosis.remaining.no_noise else
                               FITTED_ALONE if diagnosis.fitted_unlike else None),
            'wandering_rms': found.wandering_rms if found.wanders else None,
            'correlation_time': found.correlation_time if found.wanders else None,
            'lines': [{'frequency_hz': line.frequency_hz, 'amplitude': line.amplitude}
                      for line in found.lines],
            'bursts': [{'start': start, 'end': end} for start, end in found.bursts]},
        'next_experiment': next_experiment_json(experiment),
        'extended_model': 'extended_model.yaml'})
