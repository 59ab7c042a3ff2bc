"""What has changed, in the words of a mechanic, and `changes` of `diagnosis.json`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from par4_dynamics.base_terms import FRICTION, INERTIA, OFFSET, PLATFORM_MASSES, TERMS
from par4_dynamics.effects.payload import Payload
from par4_identification.changes.changes import Changes
from par4_identification.changes.explanation import CHANCE, Read
from par4_identification.changes.readings import (
    TURNING,
    Added,
    FrictionFactor,
    GainFactor,
    LoadFactor,
    Reading,
    SlidingPayload,
    applied,
    mass_on_lever,
)
from par4_identification.diagnosis.verdict.answer import Diagnosis, Holdout, Verdict
from par4_identification.reports.outcome.outcome import over_joints
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome, Remark
from par4_sim.report.results import plain
from par4_sim.report.words import capital, in_words, joint_labels, listed, number, percent

FRACTIONS = ((1 / 2, 'half'), (1 / 3, 'a third'), (1 / 4, 'a quarter'))
NEAR = 0.02
"""Share within which a fraction is said in words."""
HALF, FAR = 0.5, 3.0
"""Share of the error, and ratio to the noise floor, of which what was found mends little if as much
is left."""
SEVERAL = 'friction'


def phrase_of_reading(reading: Reading, size: float, machine: Robot | Axis) -> str:
    """Return a reading with its size, as 'a payload of 0.61 kg at half plate 1'."""
    where = 'all joints' if reading.joint is None else f'joint {reading.joint}'
    if len(joint_labels(machine)) == 1:
        where = joint_labels(machine)[0]
    up, amount = size > 0.0, abs(size)
    if isinstance(reading, GainFactor):
        whose = 'all torques' if reading.joint is None else f'all torques of {where}'
        source = 'gains or supply' if reading.joint is None else 'gain of its drive'
        return f'{whose} {_share(amount)} {"larger" if up else "smaller"} ({source})'
    if isinstance(reading, FrictionFactor):
        name = SEVERAL if len(reading.kinds) > 1 else in_words(reading.kinds[0])
        weather = '' if reading.joint is not None else ' (cold)' if up else ' (warm)'
        return f'{name} {_share(amount)} {"higher" if up else "lower"} on {where}{weather}'
    if isinstance(reading, LoadFactor):
        return f'the load that hangs on {where} {_share(amount)} {"larger" if up else "smaller"}'
    if isinstance(reading, SlidingPayload):
        return f'a payload of {number(amount, 2)} kg{"" if up else " less"} on {where}'
    assert isinstance(reading, Added)
    return _phrase_of_added(reading, amount, up, where, machine)


def _phrase_of_added(reading: Added, amount: float, up: bool, where: str,
                     machine: Robot | Axis) -> str:
    if reading.parameter in PLATFORM_MASSES:
        half = PLATFORM_MASSES.index(reading.parameter) + 1
        less = '' if up else ' less'
        return f'a payload of {number(amount, 2)} kg{less} at half plate {half}'
    term = OFFSET if reading.parameter == OFFSET.name else TERMS[reading.parameter]
    unit = unit_on(machine, term.unit)
    name = {INERTIA: 'inertia of the arm', 'arm_gravity': 'weight of the arm',
            OFFSET.name: 'constant torque',
            'gravity_load': 'load'}.get(reading.parameter, in_words(reading.parameter))
    if reading.parameter in TURNING:
        part = 'sine' if reading.parameter == TURNING[0] else 'cosine'
        name = f'the load that goes with the {part} of the angle'
    if isinstance(machine, Axis) and reading.parameter == INERTIA:
        name = 'moving mass' if machine.kind == 'linear' else 'inertia'
    return f'{name} of {where} {"up" if up else "down"} by {number(amount, 2)} {unit}'


def _share(amount: float) -> str:
    """Return 'a third' or '4 %'."""
    for fraction, words in FRACTIONS:
        if abs(amount - fraction) < NEAR:
            return words
    return f'{number(100.0 * amount, 2)} %'


def phrases_of_changes(changes: Changes, machine: Robot | Axis) -> list[str]:
    """Return every reading with its size, strongest first."""
    point = _point_on_lever(changes)
    first = next((item for item in changes.read if _is_load(item.reading)), None)
    return [phrase_of_reading(item.reading, item.size, machine) + (
        f', as of {number(point[0], 2)} kg at {number(point[1], 2)} m from its axis'
        if point is not None and item is first else '')
        for item in changes.read]


def _hangs_more(changes: Changes) -> tuple[float, float]:
    """Return by how much more hangs on an axis that turns, and its deviation, N m.

    Zero where no reading says so, and where less hangs on it.
    """
    loads = [item for item in changes.read if _is_load(item.reading)]
    if not loads:
        return 0.0, 0.0
    now = changes.parameters
    places = [now.terms.index(name) for name in TURNING]
    after = applied([item.reading for item in loads], [item.size for item in loads], now)
    old, new = now.values[0, places], after[0, places]
    moment = float(np.hypot(*(new - old)))
    share = max(item.std / abs(item.size) for item in loads)
    return (moment, share * moment) if np.hypot(*new) > np.hypot(*old) else (0.0, 0.0)


def _is_load(reading: Reading) -> bool:
    return isinstance(reading, LoadFactor) or (
        isinstance(reading, Added) and reading.parameter in TURNING)


def _point_on_lever(changes: Changes) -> tuple[float, float] | None:
    """Return mass (kg) and distance (m) of a point that explains more load and more inertia."""
    moment, _ = _hangs_more(changes)
    inertia = sum(item.size for item in changes.read if item.reading == Added(None, INERTIA))
    return mass_on_lever(moment, inertia) if min(moment, inertia) > 0.0 else None


def verdict_with_changes(verdict: Verdict, changes: Changes) -> Verdict:
    """Return the verdict once changes count: a model that is wrong by a payload is not clean."""
    return verdict_beside(verdict, bool(changes.read), changes.beyond_readings)


def verdict_beside(verdict: Verdict, is_read: bool, is_beyond: bool) -> Verdict:
    """Return the verdict beside readings, if there are any.

    Args:
        verdict: without them.
        is_read: whether something has changed that readings tell.
        is_beyond: whether something has that none does.
    """
    if verdict == 'clean' and is_read:
        return 'partly_explained' if is_beyond else 'explained'
    if verdict == 'clean' and is_beyond:
        return 'unknown'
    if verdict == 'explained' and is_beyond:
        return 'partly_explained'
    if verdict == 'unknown' and is_read:
        return 'partly_explained'
    return verdict


def with_changes(outcome: Outcome, changes: Changes, diagnosis: Diagnosis,
                 machine: Robot | Axis) -> Outcome:
    """Return the outcome of a diagnosis with what has changed in front.

    Args:
        outcome: without the changes.
        changes: since the model or between groups of bags.
        diagnosis: by itself.
        machine: that was measured.
    """
    holdout = diagnosis.holdout
    # differences between joints are values of the joints, which the readings tell
    told_by_readings = diagnosis.verdict in ('clean', 'explained') and all(
        cause.effect.against_the_others for cause in diagnosis.causes)
    unit = unit_on(machine, 'N m')
    given = f'{number(over_joints(changes.given_rms), 2)} {unit}'
    if changes.of_these:
        return replace(outcome, sentence=f'{outcome.sentence} What has changed since '
                                         f'{changes.since} is not told, as it was identified from '
                                         f'recordings that are fitted here.')
    if not changes.read and not changes.beyond_readings:
        return replace(outcome, sentence=f'{outcome.sentence} Since {changes.since} no base '
                                         f'parameter has changed beyond chance.')
    phrases = phrases_of_changes(changes, machine)
    told = listed(phrases) if phrases else (
        f'base parameters that no known reading explains ({listed(_left_labels(changes)[:3])})')
    before, after, floor = (f'{number(over_joints(rms), 2)} {unit}' for rms in (
        holdout.baseline_rms, holdout.extended_rms, holdout.noise_floor_rms))
    sentence = (f'Since {changes.since} this has changed: {told}. On data it has not seen that '
                f'model leaves {given} as it stands, {before} with its base parameters fitted '
                f'anew, {after} with what was found, the noise floor being {floor}.')
    if not told_by_readings:
        sentence += f' {outcome.sentence}'
    remarks = [*twin_remarks(changes.read, machine), *_left_remarks(changes),
               *_beside_unnamed(changes, diagnosis), *_mends_little(changes, holdout)]
    return replace(outcome, sentence=sentence, standing='fair' if remarks or (
        outcome.standing != 'good') else 'good', remarks=(*remarks, *outcome.remarks))


def twin_remarks(read: Sequence[Read], machine: Robot | Axis) -> list[Remark]:
    """Return which readings others would explain as well."""
    remarks = []
    for item in read:
        if item.twins:
            others = listed([name_of_reading(twin, machine) for twin in item.twins])
            remarks.append(Remark(
                False, f'{capital(phrase_of_reading(item.reading, item.size, machine))}: on this '
                f'motion {others} would explain it as well.',
                'Record a longer and faster motion'
                f'{" that turns theta" if isinstance(machine, Robot) else ""} to tell them apart.'))
    return remarks


def _left_remarks(changes: Changes) -> list[Remark]:
    if not changes.beyond_readings:
        return []
    return [Remark(False, f'Base parameters differ beyond that, most in '
                          f'{listed(_left_labels(changes)[:3])}, as no known reading explains.',
                   'Look at those joints for what else has been done to the machine.')]


def _beside_unnamed(changes: Changes, diagnosis: Diagnosis) -> list[Remark]:
    """Return that changes may be a part of what has no name, where something has none."""
    if not (changes.read and diagnosis.unnamed):
        return []
    return [Remark(False, 'Base parameters are fitted beside the named causes alone: what is told '
                          'as changed may be a part of what has no name.',
                   'Give bags of before (--before): what they hold as well is no change.')]


def _mends_little(changes: Changes, holdout: Holdout) -> list[Remark]:
    """Return that what has changed leaves most of the error, if it does."""
    given, after, floor = (over_joints(rms) for rms in (
        changes.given_rms, holdout.extended_rms, holdout.noise_floor_rms))
    if after < max(HALF * given, FAR * floor):
        return []
    return [Remark(False, f'With what was found {percent(after / given)} of the error stay, '
                          f'{number(after / floor, 2)} times the noise floor: its size may be that '
                          f'of something else, or of a part of the recordings.',
                   'If the machine changed within a recording, cut it there with par4_bag '
                   '--between; look at the residuals over time in the report.')]


def name_of_reading(reading: Reading, machine: Robot | Axis) -> str:
    """Return a reading without a size, as 'the inertia of the arm of joint 2'."""
    where = 'all joints' if reading.joint is None else f'joint {reading.joint}'
    if len(joint_labels(machine)) == 1:
        where = joint_labels(machine)[0]
    if isinstance(reading, GainFactor):
        return f'the gain of {where}'
    if isinstance(reading, FrictionFactor):
        kinds = SEVERAL if reading.kinds == FRICTION else in_words(reading.kinds[0])
        return f'{kinds} of {where}'
    if isinstance(reading, LoadFactor):
        return f'the load that hangs on {where}'
    if isinstance(reading, SlidingPayload):
        return f'a payload on {where}'
    assert isinstance(reading, Added)
    if reading.parameter in PLATFORM_MASSES:
        return f'a payload at half plate {PLATFORM_MASSES.index(reading.parameter) + 1}'
    return f'{in_words(reading.parameter)} of {where}'


def _left_labels(changes: Changes) -> list[str]:
    """Return the parameters that differ beyond the readings, most certain first, in words."""
    return [label_in_words(changes.after.labels[index]) for index in _left_places(changes)]


def label_in_words(label: str) -> str:
    """Return a parameter of a joint in words; the platform has its masses, whatever a joint tells.
    """
    name, _, joint = label.rstrip(']').partition('[')
    if not joint:
        return in_words(name)
    return f'{in_words(name)} ' + (f'as joint {joint} tells it' if name in PLATFORM_MASSES
                                   else f'of joint {joint}')


def _left_places(changes: Changes) -> list[int]:
    """Return which values differ beyond what the readings explain, most certain first."""
    if not changes.beyond_readings:
        return []
    explanation = changes.explanation
    off = np.abs(explanation.left) / np.maximum(explanation.left_std, 1e-30)
    limit = scipy.stats.norm.isf(0.5 * CHANCE / len(off))
    order = np.argsort(-off)
    return [int(index) for index in order if off[index] > limit] or [int(order[0])]


def changes_json(changes: Changes, machine: Robot | Axis) -> list[dict[str, Any]]:
    """Return the field `changes`: an entry for each parameter that a reading moves.

    What no reading explains has an entry with `reading` null for each value that is off.
    """
    entries = []
    for item, margin in zip(changes.read, changes.margins, strict=True):
        for moved in item.reading.moved(changes.parameters, changes.terms):
            entries.append({
                'parameter': moved.parameter, 'before': moved.before,
                'after': moved.before + moved.slope * item.size,
                'std': abs(moved.slope) * item.std, 'unit': unit_on(machine, moved.unit),
                'p_value': item.p_value,
                'reading': phrase_of_reading(item.reading, item.size, machine),
                'margin': margin,
                'indistinguishable_from': [name_of_reading(twin, machine)
                                           for twin in item.twins]})
    explanation = changes.explanation
    for index in _left_places(changes):
        after = float(changes.after.values.ravel()[index])
        entries.append({
            'parameter': changes.after.labels[index],
            'before': after - float(explanation.left[index]), 'after': after,
            'std': float(explanation.left_std[index]),
            'unit': unit_on(machine, changes.terms[index % len(changes.terms)].unit),
            'p_value': explanation.left_p, 'reading': None, 'margin': None,
            'indistinguishable_from': []})
    return plain(entries)


def payload_causes_json(changes: Changes, machine: Robot | Axis) -> list[dict[str, Any]]:
    """Return payloads among the readings as entries of `causes`: they can be named."""
    found = []
    for item, margin in zip(changes.read, changes.margins, strict=True):
        parameters = _payload_parameters(changes, item)
        if parameters is None or (item.size <= 0.0 and not _is_load(item.reading)):
            continue
        found.append({
            'effect': Payload.name, 'joints': list(range(len(joint_labels(machine)))),
            'parameters': parameters,
            'indistinguishable_from': [name_of_reading(twin, machine) for twin in item.twins],
            # a fit of the base parameters swallows all of it
            'visible_fraction': 0.0, 'p_value': item.p_value, 'margin': margin, 'rival': None})
    return plain(found)


def _payload_parameters(changes: Changes, item: Read) -> dict[str, Any] | None:
    """Return the parameters of a reading that is a payload, None of another one."""
    reading = item.reading
    mass = {'mass': {'value': item.size, 'std': item.std, 'unit': 'kg'}}
    if isinstance(reading, SlidingPayload):
        return mass
    if _is_load(reading):
        if item is not next(other for other in changes.read if _is_load(other.reading)):
            return None  # told with the first
        value, std = _hangs_more(changes)
        if value <= 0.0:
            return None
        found = {'moment': {'value': value, 'std': std, 'unit': 'N m'}}
        point = _point_on_lever(changes)
        return found if point is None else {
            **found, 'mass': {'value': point[0], 'unit': 'kg'},
            'distance': {'value': point[1], 'unit': 'm'}}
    if isinstance(reading, Added) and reading.parameter in PLATFORM_MASSES:
        half = float(PLATFORM_MASSES.index(reading.parameter) + 1)
        return {**mass, 'half': {'value': half, 'std': 0.0, 'unit': '1'}}
    return None


def diagnosis_json_with_changes(content: dict[str, Any], changes: Changes | None,
                                machine: Robot | Axis) -> dict[str, Any]:
    """Return `diagnosis.json` with causes and errors as the changes make them.

    Args:
        content: of the diagnosis by itself.
        changes: None where no model was given or nothing could be compared.
        machine: that was measured.
    """
    if changes is None:
        return content
    return {**content,
            'causes': [*payload_causes_json(changes, machine), *content['causes']],
            'holdout': {**content['holdout'], 'given_rms': plain(changes.given_rms)},
            'changes': changes_json(changes, machine)}


def error_rows(changes: Changes, refitted: np.ndarray, extended: np.ndarray
               ) -> Sequence[tuple[str, np.ndarray]]:
    """Return the held-out rms (J,) of the model as it stands, fitted anew and with the findings."""
    return (('model as it stands', changes.given_rms), ('base parameters fitted anew', refitted),
            ('with what was found', extended))
