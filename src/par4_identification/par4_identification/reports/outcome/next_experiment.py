"""The next experiment in words, and as `diagnosis.json` has it."""

from __future__ import annotations

from typing import Any

from par4_identification.diagnosis.experiment.next_experiment import (
    LONGEST,
    NextExperiment,
    Separation,
)
from par4_sim.report.words import in_words, listed, number

NONE_AT_ALL = 1.0
"""Expected separation below which two names are the same torque."""
_ANOTHER_WAY = {
    frozenset(('torque_offset', 'coulomb_asymmetry')):
        'both shift the torque of both directions alike, the breakaway torques included; read the '
        'amplifiers with the drives off, where an offset shows and friction does not'}
_WAY = ('measure one of them by other means, or record with a known payload, which changes the '
        'load')


def advice(cause: str, experiment: NextExperiment | None) -> str:
    """Return what tells a cause from its twins; empty where nothing is known of that.

    Args:
        cause: name of its effect.
        experiment: the next motion, or why there is none.
    """
    mine = [item for item in experiment.separations
            if item.names[0] == cause] if experiment else []
    sentences = []
    decided = [f'{in_words(item.names[1])} by {number(item.expected, 2)}'
               for item in mine if item.separated]
    if decided and experiment and experiment.motion:
        motion = experiment.motion
        sentences.append(
            f'Play {experiment.file} ({motion.name}, {motion.duration:.0f} s) and give its bag '
            f'beside the old ones, one of them as --holdout: it is expected to tell '
            f'{in_words(cause)} from {listed(decided)} (difference of log-likelihood, of which 10 '
            f'decide).')
    sentences += [_without_motion(item) for item in mine if not item.separated]
    return ' '.join(sentences)


def _without_motion(item: Separation) -> str:
    first, second = map(in_words, item.names)
    way = _ANOTHER_WAY.get(frozenset(item.names), _WAY)
    if item.most < NONE_AT_ALL:
        return f'No motion of this machine tells {first} from {second}: {way}.'
    return (f'Within {LONGEST:.0f} s no motion of the library tells {first} from {second} '
            f'({number(item.most, 2)} in log-likelihood is expected at most): {way}.')


def next_experiment_json(experiment: NextExperiment | None) -> dict[str, Any] | None:
    """Return `next_experiment` of `diagnosis.json`, None where no motion separates anything."""
    if experiment is None or experiment.motion is None:
        return None
    return {'motion': experiment.file, 'separates': experiment.separates,
            'expected_separation': experiment.expected_separation}
