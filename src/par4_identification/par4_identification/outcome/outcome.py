"""An outcome in words: one sentence, the findings behind it, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from par4_identification.diagnosis.rules import Rules
from par4_identification.log import Log

FLOOR_EXCESS = Rules().floor_excess
"""Residual over noise floor above which a model misses something."""
LARGEST_ERROR = 0.3
"""Relative error above which a model does not describe a machine."""

Standing = Literal['good', 'fair', 'bad']


@dataclass(frozen=True)
class Remark:
    """One finding in words.

    Attributes:
        good: False where it weakens the result.
        text: a sentence.
        advice: what to do next; empty if nothing follows from it.
    """

    good: bool
    text: str
    advice: str = ''


@dataclass(frozen=True)
class Outcome:
    """What a tool found, in words.

    Attributes:
        sentence: all of it, with its numbers.
        standing: how far the result serves its purpose.
        remarks: the findings behind it.
        first: what was wrong with setup or log and is to be read before all else, sentences.
    """

    sentence: str
    standing: Standing
    remarks: tuple[Remark, ...]
    first: tuple[str, ...] = ()

    @property
    def advice(self) -> tuple[str, ...]:
        """What to do next, troubles first."""
        ordered = sorted(self.remarks, key=lambda remark: remark.good)
        return tuple(dict.fromkeys(remark.advice for remark in ordered if remark.advice))


def data_remark(logs: Sequence[Log]) -> Remark:
    """Return whether the data needed repair."""
    repairs = sum(len(log.accounts.findings()) for log in logs)
    if not repairs:
        return Remark(True, 'The data needed no repair.')
    return Remark(False, f'The data needed {repairs} repair{"s" if repairs > 1 else ""}, listed '
                         f'under "What was read".')


def duration(logs: Sequence[Log]) -> float:
    """Return the measured time of all logs, s."""
    return sum(log.accounts.duration for log in logs)


def over_joints(rms: np.ndarray) -> float:
    """Return one number for the rms (J,) of joints that count alike."""
    return float(np.sqrt(np.mean(np.square(rms))))
