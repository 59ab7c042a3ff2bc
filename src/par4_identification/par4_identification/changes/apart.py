"""Recordings that differ are diagnosed without what they differ in."""

from __future__ import annotations

from typing import Protocol

from par4_dynamics.model_file import ModelFile
from par4_identification.changes.between_logs import (
    MOST,
    NEARLY_ALL,
    WORTH_A_TRY,
    LogDifferences,
    differences_between_logs,
    mends,
)
from par4_identification.diagnosis.diagnosis import Apart
from par4_identification.diagnosis.progress import Progress
from par4_identification.diagnosis.verdict.answer import Diagnosis, Unusable
from par4_kinematics.robot import Axis, Robot

ROUNDS = 3
"""Times that differences of recordings and causes are looked for in turn, at most."""


class Diagnose(Protocol):
    """Diagnoses the recordings."""

    def __call__(self, apart: Apart, *, bodies_alone: bool = False) -> Diagnosis | Unusable:
        """Return the diagnosis without what recordings have `apart`, or of no cause at all."""


def diagnosed_apart(diagnose: Diagnose, logs: int, machine: Robot | Axis,
                    baseline: ModelFile | None, progress: Progress
                    ) -> tuple[Diagnosis | Unusable, LogDifferences | None]:
    """Return the diagnosis of recordings, and how they differ if they do.

    They are compared by the bodies alone, and again beside the causes found. A load in one of them
    is large beside any cause, and there would be no end of causes that explain some of it.

    Args:
        diagnose: the recordings.
        logs: how many there are.
        machine: that was recorded.
        baseline: model whose effects are taken as known.
        progress: called with the name of each step.
    """
    def compared(whole: Diagnosis | Unusable, least: float
                 ) -> tuple[Diagnosis, LogDifferences] | None:
        progress('comparing the recordings')
        return _without_differences(diagnose, whole, machine, baseline, least) if isinstance(
            whole, Diagnosis) else None

    if logs > 1:
        found = compared(diagnose({}, bodies_alone=True), NEARLY_ALL)
        if found is not None:
            return found
    whole = diagnose({})
    return compared(whole, WORTH_A_TRY) or (whole, None)


def _without_differences(diagnose: Diagnose, whole: Diagnosis, machine: Robot | Axis,
                         baseline: ModelFile | None, least: float
                         ) -> tuple[Diagnosis, LogDifferences] | None:
    """Return a diagnosis without differences, and these; None if there are none worth it.

    Args:
        diagnose: the recordings.
        whole: their diagnosis with the differences.
        machine, baseline: of `diagnosed_apart`.
        least: see `differences_between_logs`.
    """
    between = differences_between_logs(whole, machine, baseline, least)
    if between is None:
        return None
    alike = diagnose(between.apart)
    for _ in range(ROUNDS):
        if not isinstance(alike, Diagnosis):
            return None
        # beside causes that the difference had hidden it may be read otherwise
        better = differences_between_logs(whole, machine, baseline, min(least, MOST), alike,
                                          between)
        if better is None or better.is_like(between):
            break
        alike, between = diagnose(better.apart), better
    return (alike, between) if isinstance(alike, Diagnosis) and (
        between.share > MOST or mends(alike, whole)) else None
