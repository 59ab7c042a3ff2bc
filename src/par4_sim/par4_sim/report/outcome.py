"""An outcome in words: one sentence, the findings behind it, and what to do next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Standing = Literal['good', 'fair', 'bad']


@dataclass(frozen=True)
class Remark:
    """One finding in words.

    Attributes:
        good: False where it weakens the result.
        text: a sentence.
        advice: what to do next; empty if nothing follows from it.
        is_note: whether it says only what was done, or what these data do not tell, which speaks
            neither for the result nor against it.
    """

    good: bool
    text: str
    advice: str = ''
    is_note: bool = False

    @property
    def mark(self) -> str:
        """The class of its line in a report: 'good', 'poor' or 'plain'."""
        return 'plain' if self.is_note else 'good' if self.good else 'poor'


def note(text: str, advice: str = '') -> Remark:
    """Return a remark that speaks neither for the result nor against it."""
    return Remark(True, text, advice, is_note=True)


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
