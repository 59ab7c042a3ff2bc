"""The recordings that a diagnosis rests on: their logs, with what was wrong of their setup."""

from __future__ import annotations

from dataclasses import dataclass

from par4_dynamics.model import Model
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model
from par4_identification.changes.changes import model_of_bags
from par4_identification.diagnosis.diagnosis import CONDITIONING
from par4_identification.diagnosis.progress import Progress
from par4_identification.fitting.axis_gravity import with_gravity_told
from par4_identification.jobs.diagnosis_request import DiagnosisRequest
from par4_identification.jobs.read_bags import read_bags
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.setup import setup_lines
from par4_identification.setup_check.check import check_setup
from par4_identification.setup_check.finding import SetupCheck
from par4_identification.setup_check.unusable import sound_or_refused
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.scales import Chosen, conditioning_for
from par4_kinematics.robot import Axis, Robot


@dataclass(frozen=True)
class Earlier:
    """Bags of the machine as it was.

    Attributes:
        logs: mended.
        model_file: identified from them.
        setup_lines: what was wrong with their setup.
    """

    logs: tuple[Log, ...]
    model_file: ModelFile
    setup_lines: tuple[str, ...]

    @classmethod
    def of(cls, check: SetupCheck, machine: Robot | Axis, baseline: ModelFile | None,
           conditioning: Conditioning) -> Earlier:
        """Return earlier bags, whose setup was checked, with their model.

        Raises:
            InputError: no model can be identified from them.
        """
        model_file = sound_or_refused(check, lambda: model_of_bags(
            check.logs, machine, baseline, conditioning))
        return cls(check.logs, model_file, tuple(
            f'In the bags before: {line}' for line in setup_lines(check, 'comparison')))


@dataclass(frozen=True)
class Recorded:
    """What a diagnosis rests on.

    Attributes:
        check: of the setup of the bags to diagnose and to confirm on, whose logs are mended.
        fitted: how many of its logs are fitted; the others confirm.
        conditioning: of all logs.
        baseline: the model that was believed, or what the earlier bags tell; None without both.
        earlier: bags of the machine as it was, if any.
        as_set: whether a user sets filters or rates.
    """

    check: SetupCheck
    fitted: int
    conditioning: Conditioning
    baseline: ModelFile | None
    earlier: Earlier | None
    as_set: bool

    @property
    def machine(self) -> Robot | Axis:
        """The machine with what the check mended."""
        return self.check.machine


def recorded(asked: DiagnosisRequest, machine: Robot | Axis,
             believed: tuple[ModelFile, Model] | None, progress: Progress) -> Recorded:
    """Read all bags and look for mistakes of the setup.

    Args:
        asked: which bags, and how they are filtered.
        machine: as its file has it.
        believed: the model that was believed, as its file has it and as it is of this machine.
        progress: called with the name of each step.

    Raises:
        InputError: a bag that cannot be used, or earlier ones of which no model can be identified.
    """
    baseline, known = believed or (None, None)
    logs = read_bags(asked.every_bag, machine, asked.namespace, progress)
    progress('looking for mistakes of the setup')
    own, as_set = len(asked.bags) + len(asked.holdout), asked.chosen != Chosen()
    conditioning = conditioning_for(logs, machine, CONDITIONING, asked.chosen)
    as_given = machine
    for group in (logs[:own], logs[own:]) if asked.before else (logs,):
        machine = machine if _hangs(machine) else with_gravity_told(as_given, group, conditioning)
    if not asked.before:
        check = check_setup(logs[:own], machine, known)
        conditioning = conditioning_for(check.logs, check.machine, CONDITIONING, asked.chosen)
        return Recorded(check, len(asked.bags), conditioning, baseline, None, as_set)
    before = check_setup(logs[own:], machine)
    earlier = Earlier.of(before, machine, baseline, conditioning)
    check = check_setup(logs[:own], machine, build_model(machine, earlier.model_file))
    mended = conditioning_for((*check.logs, *before.logs), machine, CONDITIONING, asked.chosen)
    if mended != conditioning:  # which were those of logs with their mistakes
        earlier = Earlier.of(before, machine, baseline, mended)
    return Recorded(check, len(asked.bags), mended, earlier.model_file, earlier, as_set)


def _hangs(machine: Robot | Axis) -> bool:
    """Return whether a machine is an axis that is known to lift a load."""
    return isinstance(machine, Axis) and machine.gravity == 'vertical'
