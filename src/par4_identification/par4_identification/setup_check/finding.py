"""What a look at setup and log finds, and what becomes of the data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from par4_dynamics.parameters import Parameter
from par4_identification.logs.log import Log
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Remark

FindingName = Literal[
    'joints_exchanged', 'sign_reversed', 'wrong_unit', 'common_gain', 'zero_error', 'delay',
    'wrong_dimensions', 'frozen_encoder', 'encoder_slip', 'held_samples', 'spikes', 'clipped',
    'clock_drift', 'singular_pose', 'not_moving']


@dataclass(frozen=True)
class Amount:
    """How large a mistake is that the library knows as an effect, too.

    Attributes:
        effect: name of the effect.
        joints: that it concerns; none where it concerns the machine.
        parameters: of the effect, one number or one a joint in `joints`.
    """

    effect: str
    joints: tuple[int, ...]
    parameters: Mapping[str, Parameter]


@dataclass(frozen=True)
class Finding:
    """One mistake of the setup or fault of the log.

    Attributes:
        finding: its kind.
        joints: that it concerns, in ascending order.
        when: start and end of the time it concerns, s since the start of the log; None where it
            concerns all of it.
        evidence: what was found, a sentence with its numbers.
        mend: what to do at the machine, in a file or on the command line, a sentence.
        certain: whether the data were mended, so that the work goes on with them.
        useless: whether the data cannot be used as they are; never of what is certain.
        amount: what was mended, where the diagnosis may find the rest of it.
    """

    finding: FindingName
    joints: tuple[int, ...]
    when: tuple[float, float] | None
    evidence: str
    mend: str
    certain: bool
    useless: bool = False
    amount: Amount | None = None

    @property
    def sentence(self) -> str:
        """What was found and what to do about it, as one sentence."""
        return f'{self.evidence}; {self.mend[0].lower()}{self.mend[1:]}'

    def to_json(self) -> dict[str, Any]:
        """Return the finding as the interface contract has it."""
        return {'finding': self.finding, 'joints': list(self.joints),
                'when': None if self.when is None else list(self.when),
                'evidence': self.evidence, 'mend': self.mend}


@dataclass(frozen=True)
class SetupCheck:
    """The findings, and the data and the machine with what is certain mended.

    Attributes:
        findings: in the order in which they were found and mended.
        logs: mended, in the order in which they were given.
        machine: with the mended dimensions.
        remarks: what cannot be seen in these data or was not looked at, and what would show it.
    """

    findings: tuple[Finding, ...]
    logs: tuple[Log, ...]
    machine: Robot | Axis
    remarks: tuple[Remark, ...] = ()

    @property
    def useless(self) -> tuple[Finding, ...]:
        """The findings that forbid to go on."""
        return tuple(finding for finding in self.findings if finding.useless)

    def after(self, findings: Sequence[Finding], logs: Sequence[Log] | None = None,
              machine: Robot | Axis | None = None) -> SetupCheck:
        """Return the check with more findings and with what they mended."""
        return replace(self, findings=(*self.findings, *findings),
                       logs=self.logs if logs is None else tuple(logs),
                       machine=self.machine if machine is None else machine)

    def remarking(self, remark: Remark) -> SetupCheck:
        """Return the check with one more remark, once."""
        return self if remark in self.remarks else replace(self, remarks=(*self.remarks, remark))
