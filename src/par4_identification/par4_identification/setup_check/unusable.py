"""A diagnosis of data that a mistake of the setup may have made useless."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from par4_identification.diagnosis.verdict.answer import Diagnosis, Unusable
from par4_identification.setup_check.finding import Finding, SetupCheck
from par4_identification.signals.rows import Run, runs_of_log
from par4_kinematics.errors import InputError, Par4Error

Result = TypeVar('Result')

SINGULAR = ('the equations of these data are singular, so that no parameter can be told; record a '
            'longer motion of all joints, and check that torque and position belong together')


def diagnosed_if_sound(check: SetupCheck, diagnose: Callable[[SetupCheck], Diagnosis | Unusable]
                       ) -> Diagnosis | Unusable:
    """Return the diagnosis of mended data, or what makes them unusable."""
    if check.useless:
        return _unusable(check, tuple(map(_reason, check.useless)))
    try:
        return diagnose(check)
    except np.linalg.LinAlgError:
        return _unusable(check, (SINGULAR,))


def sound_or_refused(check: SetupCheck, work: Callable[[], Result]) -> Result:
    """Return the result of work on mended data; where it fails, the finding that says why.

    Raises:
        InputError: the work fails; names the finding that makes the data useless, if any.
    """
    try:
        return work()
    except (Par4Error, np.linalg.LinAlgError) as error:
        if check.useless:
            raise InputError(_reason(check.useless[0])) from error
        if isinstance(error, Par4Error):
            raise
        raise InputError(SINGULAR) from error


def _reason(finding: Finding) -> str:
    """Return what makes data useless and what to do, as one sentence without its full stop."""
    return f'{finding.evidence}; {finding.mend[0].lower()}{finding.mend[1:].removesuffix(".")}'


def _unusable(check: SetupCheck, reasons: tuple[str, ...]) -> Unusable:
    runs: list[Run] = []
    for log in check.logs:
        try:
            runs += runs_of_log(log, check.machine)
        except Par4Error:
            continue
    return Unusable(reasons, tuple(runs))
