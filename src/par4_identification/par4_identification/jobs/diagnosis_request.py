"""What par4_diagnose was asked for."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from par4_identification.reports.outcome.results import provenance
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.scales import Chosen
from par4_kinematics.robot import Axis, Robot

TOOL = 'par4_diagnose'


@dataclass(frozen=True)
class DiagnosisRequest:
    """What `par4_diagnose` was asked for, as the command line has it.

    Attributes:
        bags: to diagnose.
        holdout: to confirm on.
        before: of the machine as it was.
        robot, model: file or built-in name; no model where none was believed.
        output: folder.
        namespace: that the topics sit under.
        cutoff, rows, low_speed: of the filters; None leaves them to the data.
        simulate: whether the model is run along the measured motion, before and after.
        report: whether the page is drawn.
    """

    bags: tuple[str, ...]
    holdout: tuple[str, ...]
    before: tuple[str, ...]
    robot: str
    model: str | None
    output: Path
    namespace: str | None
    cutoff: float | None
    rows: float | None
    low_speed: float | None
    simulate: bool
    report: bool

    @property
    def every_bag(self) -> tuple[str, ...]:
        """All bags, in the order in which they are read."""
        return (*self.bags, *self.holdout, *self.before)

    @property
    def chosen(self) -> Chosen:
        """What was set of the filters."""
        return Chosen(self.cutoff, self.rows, self.low_speed)

    def provenance(self, machine: Robot | Axis, conditioning: Conditioning) -> dict[str, Any]:
        """Return where the results come from."""
        return provenance(TOOL, machine, self.every_bag, {
            'holdout': self.holdout, 'before': self.before, 'model': self.model,
            'namespace': self.namespace, **asdict(conditioning)})
