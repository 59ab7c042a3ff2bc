"""What is to be said of a diagnosis beside its first sentence, and what to do about each thing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_identification.diagnosis.experiment.next_experiment import NextExperiment
from par4_identification.diagnosis.search.shapes import highest_visible_order
from par4_identification.diagnosis.verdict.answer import Cause, Diagnosis
from par4_identification.reports.outcome.next_experiment import advice
from par4_identification.reports.outcome.outcome import FLOOR_EXCESS, over_joints
from par4_identification.signals.run import Run, longest_motion
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Remark, note
from par4_sim.report.words import (
    capital,
    in_words,
    joint_labels,
    listed,
    number,
    percent,
    phrase_on,
)

ALL = 0.999
"""Share beyond which an interval says no more."""
NOISELESS = 1e-6
"""Noise floor over the torque below which no torque was measured as it is: a converter of 16 bits
alone makes ten times as much."""


def remarks_of_diagnosis(diagnosis: Diagnosis, machine: Robot | Axis,
                         experiment: NextExperiment | None) -> tuple[Remark, ...]:
    """Return the remarks: on what has no name, on what is left, on the model and on each cause."""
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
            f'something acts in the fitted ones alone.',
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
    if diagnosis.below_hz is not None:
        cutoff = number(diagnosis.fit_runs[0].conditioning.torque_cutoff_hz, 3)
        remarks.append(note(
            f'Loads swing at {number(diagnosis.below_hz, 2)} Hz on their transmissions, where the '
            f'counts of the encoders drown what they tell: this answer rests on torques below '
            f'{cutoff} Hz.', 'Finer encoders tell more; --cutoff sets the limit.'))
    if diagnosis.verdict == 'clean':
        remarks.append(note('Effects below the noise floor of these data, and those that the base '
                            'parameters swallow, are not excluded.'))
    return tuple(remarks)


def remarks_of_cause(cause: Cause, machine: Robot | Axis, experiment: NextExperiment | None
                     ) -> list[Remark]:
    """Return what is to be said of a cause beside its size."""
    remarks, phrase = [], phrase_on(machine, cause.effect.phrase)
    if not cause.predictable:
        remarks.append(Remark(
            False, f'{capital(phrase)} is read off where the residual is large, '
            f'not off its course; the size is good to a third.',
            'Preload or adjust the transmission; feedforward alone does not remove it.'))
    assumed = cause.effect.assumes({name: np.asarray(parameter.value)
                                    for name, parameter in cause.parameters.items()})
    if assumed is not None:
        remarks.append(note(assumed))
    if _is_relative(cause, machine):
        remarks.append(note(
            f'{capital(phrase)} is measured against the joints that are '
            f'not named: what all joints have in common belongs to the base parameters.'))
    if cause.twins:
        remarks.append(Remark(
            False, f'On this motion {phrase} cannot be told from '
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
    highest = highest_visible_order(longest)
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
    phrase = phrase_on(machine, item.phrase)
    wrong = number(over_joints(diagnosis.holdout.baseline_rms), 2)
    joints = len(joint_labels(machine))
    where = '' if len(item.joints) == joints else (
        f' on joint{"s" if len(item.joints) > 1 else ""} '
        f'{listed([str(joint) for joint in item.joints])}')
    return Remark(
        False, f'{capital(phrase)}{where}, without a name, has '
        f'{number(item.torque_rms, 2)} {unit} rms where the model is wrong by {wrong} {unit}; it '
        f'explains {percent(item.share)} of what all causes explain of the squared error.',
        f'Look at the machine for something that acts as {phrase}. '
        f'{advice(item.phrase, experiment)}'.strip())


def _remaining_remarks(diagnosis: Diagnosis, machine: Robot | Axis,
                       experiment: NextExperiment | None) -> list[Remark]:
    remaining, found = diagnosis.remaining, diagnosis.remaining.unrelated
    unit = unit_on(machine, 'N m')
    remarks = []
    if remaining.nearest is not None:
        nearest = capital(phrase_on(machine, remaining.nearest.phrase))
        remarks.append(Remark(
            False, f'{nearest} would explain some of it, but does not pass as a cause.',
            f'The rejected names in the report say why. '
            f'{advice(remaining.nearest.name, experiment)}'.strip()))
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
            False, f'The error of the model is larger for a while ({spans} of the data held out'
            f'{", and more" if len(found.bursts) > 5 else ""}), and nothing that was tried says '
            f'why.',
            'Look at what happened then: a push, a slip, a stop, another load; leave the stretch '
            'out (--between of par4_bag) or record again. If nothing did, look at how the machine '
            'moved: what shows in slow motions alone may be a periodic torque that elsewhere is '
            'too quick for the filter; record a slow motion.'))
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
