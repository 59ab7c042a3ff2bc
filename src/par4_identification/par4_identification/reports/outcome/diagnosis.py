"""A diagnosis in words, and `diagnosis.json`."""

from __future__ import annotations

from typing import Any

from par4_identification.diagnosis.experiment.next_experiment import NextExperiment
from par4_identification.diagnosis.verdict.answer import Diagnosis, Unusable
from par4_identification.diagnosis.verdict.unrelated import Unrelated
from par4_identification.reports.outcome.causes import phrase_of_causes
from par4_identification.reports.outcome.diagnosis_remarks import remarks_of_diagnosis
from par4_identification.reports.outcome.next_experiment import next_experiment_json
from par4_identification.reports.outcome.outcome import LOUD, over_joints
from par4_kinematics.machine_units import parameter_unit, unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome, Remark
from par4_sim.report.results import plain
from par4_sim.report.words import (
    capital,
    in_words,
    listed,
    number,
    percent,
    phrase_on,
    torque_name,
    with_std,
)

NO_FUNCTION = 'a torque that follows nothing known of the motion'
"""What is left where it is too much for noise and no function fits it."""
FITTED_ALONE = 'something that acts in the fitted recordings alone'
"""What is left where far more is left of the fitted rows than of those held out."""


def parameters_beside_causes(diagnosis: Diagnosis | Unusable, machine: Robot | Axis
                             ) -> tuple[str, ...]:
    """Return a line with the parameters beside the causes; none where there is no cause."""
    if isinstance(diagnosis, Unusable) or not diagnosis.causes:
        return ()
    parts = [f'{in_words(name)} {" ± ".join(with_std(value.number, value.deviation))} '
             f'{unit_on(machine, value.unit)}' for name, value in diagnosis.base_after.items()]
    causes = 'this cause' if len(diagnosis.causes) == 1 else 'these causes'
    return (f'Beside {causes} the parameters are {listed(parts)}.',)


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
    remarks = remarks_of_diagnosis(diagnosis, machine, experiment)
    nearest = diagnosis.remaining.nearest
    beside = (' and '.join([*(phrase_on(machine, item.phrase) for item in diagnosis.unnamed),
                            *_phrases_of_unrelated(diagnosis.remaining.unrelated),
                            *_phrase_of_swing(diagnosis.remaining.swing_hz),
                            *([FITTED_ALONE] if diagnosis.fitted_unlike else [])])
              or (nearest and f'{phrase_on(machine, nearest.phrase)}, which does not pass as a '
                              f'cause')
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
    way = 'falls' if errors[1] < errors[0] else 'rises'
    falls = f'{way} from {before} to {after}' if before != after else f'stays at {after}'
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
        phrases.append(f'{"an error" if len(found.bursts) == 1 else "errors"} that '
                       f'{"is" if len(found.bursts) == 1 else "are"} larger for a while from '
                       f'{times} on')
    return phrases


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
