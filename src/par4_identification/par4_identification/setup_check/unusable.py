"""A diagnosis of data that a mistake of the setup may have made useless."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from par4_identification.diagnosis.split import manageable
from par4_identification.diagnosis.verdict.answer import Diagnosis, Unusable
from par4_identification.fitting.identification import singular_refused
from par4_identification.setup_check.finding import Finding, SetupCheck
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.run import Run
from par4_kinematics.errors import InputError, Par4Error

Result = TypeVar('Result')


def diagnosed_if_sound(check: SetupCheck, diagnose: Callable[[SetupCheck], Diagnosis | Unusable]
                       ) -> Diagnosis | Unusable:
    """Return the diagnosis of mended data, or what makes them unusable."""
    if check.useless:
        return _unusable(check, tuple(map(_reason, check.useless)))
    return diagnose(check)


def sound_or_refused(check: SetupCheck, work: Callable[[], Result]) -> Result:
    """Return the result of work on mended data; where it fails, the finding that says why.

    Raises:
        InputError: the work fails; names the finding that makes the data useless, if any.
    """
    try:
        with singular_refused():
            return work()
    except Par4Error as error:
        if check.useless:
            raise InputError(_reason(check.useless[0])) from error
        raise


def _reason(finding: Finding) -> str:
    """Return what makes data useless and what to do, as one sentence without its full stop."""
    return finding.sentence.removesuffix('.')


def _unusable(check: SetupCheck, reasons: tuple[str, ...]) -> Unusable:
    """Return why data are unusable, with rows to be looked at; of long logs, those of stretches."""
    runs: list[Run] = []
    fitted, held, _ = manageable(check.logs, (), check.machine, Conditioning())
    for log in (*fitted, *held):
        try:
            runs += runs_of_log(log, check.machine)
        except Par4Error:
            continue
    return Unusable(reasons, tuple(runs))
