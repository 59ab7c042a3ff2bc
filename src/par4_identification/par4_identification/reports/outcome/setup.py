"""Mistakes of the setup and faults of the log in words, said before anything else, and in JSON."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from par4_identification.setup_check.finding import SetupCheck
from par4_sim.report.outcome import Outcome
from par4_sim.report.results import plain


def setup_lines(check: SetupCheck, work: str) -> tuple[str, ...]:
    """Return what is to be read first, a paragraph a finding.

    Args:
        check: of setup and logs.
        work: what went on with the mended data, as 'diagnosis'.
    """
    lines = [f'Before anything else: {log.name}: {text}.'
             for log in check.logs if log.accounts
             for text in (*log.accounts.of_clocks(), *log.accounts.of_torques())]
    for finding in check.findings:
        went_on = f' The {work} went on with this mended.' if finding.certain else ''
        lines.append(f'Before anything else: {finding.evidence}.{went_on} {finding.mend}')
    return tuple(lines)


def with_setup(outcome: Outcome, check: SetupCheck, work: str) -> Outcome:
    """Return the outcome with what was wrong with the setup in front of it."""
    standing = outcome.standing
    lines = setup_lines(check, work)
    if lines and standing == 'good':
        standing = 'fair'
    if check.useless:
        standing = 'bad'
    return replace(outcome, first=lines, standing=standing,
                   remarks=(*outcome.remarks, *check.remarks))


def setup_json(check: SetupCheck) -> list[dict[str, Any]]:
    """Return the field `setup` of the results."""
    return plain([finding.to_json() for finding in check.findings])
