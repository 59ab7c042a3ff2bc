"""What is wrong in all: what the look at the setup mended, and the rest of it in the diagnosis.

Zeros, dimensions and delays are effects of the library as well. Large ones are mended before the
diagnosis, which then sees the mended data: an error of 5.00 degrees mended as 4.91 is told as one
of 0.09 degrees. The sum of both is the value of the machine, and as sure as the rest is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.verdict.answer import Cause
from par4_identification.setup_check.finding import Amount, SetupCheck
from par4_kinematics.geometry import LEGS
from par4_sim.report.words import in_words, listed, number


def totals(check: SetupCheck, causes: Sequence[Cause] = ()) -> tuple[Amount, ...]:
    """Return how large what was mended is in all, an amount an effect.

    Args:
        check: of setup and logs; delays of several logs count with their mean.
        causes: of the diagnosis of the mended logs.
    """
    found = {cause.effect.name: cause for cause in causes}
    mended: dict[str, list[Amount]] = {}
    for finding in check.findings:
        if finding.amount is not None:
            mended.setdefault(finding.amount.effect, []).append(finding.amount)
    return tuple(_of_joints(amounts[0], found.get(effect)) if amounts[0].joints else
                 _of_machine(amounts, found.get(effect)) for effect, amounts in mended.items())


def total_lines(check: SetupCheck, causes: Sequence[Cause]) -> tuple[str, ...]:
    """Return a sentence for each cause of which a part had been mended before."""
    again = {cause.effect.name for cause in causes}
    lines = []
    for amount in totals(check, causes):
        if amount.effect not in again:
            continue
        parts = []
        for name, parameter in amount.parameters.items():
            values = np.atleast_1d(parameter.value)
            whose = [f' (joint {joint})' for joint in amount.joints] or ['']
            parts += [f'{in_words(name)} {number(float(value), 4)} {parameter.unit}{who}'
                      for value, who in zip(values, whose, strict=True)]
        lines.append(f'Together with what was mended before, {in_words(amount.effect)} is: '
                     f'{listed(parts)}.')
    return tuple(lines)


def _of_joints(mended: Amount, cause: Cause | None) -> Amount:
    parameters, joints = {}, set(mended.joints)
    if cause is not None:
        joints |= set(cause.joints)
    everyone = sorted(joints)
    for name, parameter in mended.parameters.items():
        value, std = np.zeros(LEGS), np.zeros(LEGS)
        value[list(mended.joints)] = parameter.value
        std[list(mended.joints)] = parameter.std
        if cause is not None:
            own, rest = list(cause.joints), cause.parameters[name]
            value[own] += rest.per_joint(len(own))
            if rest.std is not None:
                std[own] = rest.std
        parameters[name] = Parameter(value=tuple(value[everyone].tolist()),
                                     std=tuple(std[everyone].tolist()), unit=parameter.unit)
    return Amount(mended.effect, tuple(everyone), parameters)


def _of_machine(mended: Sequence[Amount], cause: Cause | None) -> Amount:
    parameters = {}
    for name in mended[0].parameters:
        own = [amount.parameters[name] for amount in mended]
        value = float(np.mean([parameter.number for parameter in own]))
        std = float(np.sqrt(np.sum([parameter.deviation ** 2 for parameter in own]))) / len(own)
        parameters[name] = Parameter(value=value, std=std, unit=own[0].unit)
    if cause is not None:
        for name, rest in cause.parameters.items():
            before, told = parameters.get(name), rest.std
            value = float(np.mean(rest.value))
            if before is not None:
                value += before.number
                told = before.std if told is None else told
            parameters[name] = Parameter(
                value=value, std=None if told is None else float(np.mean(told)),
                unit=rest.unit if before is None else before.unit)
    return Amount(mended[0].effect, (), parameters)
