"""One bag looked at as a whole: what it holds, how it moves, what each tool could do with it."""

from __future__ import annotations

import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from par4_identification.inspection.contents import (
    JointContent,
    TopicContent,
    joint_contents,
    topic_contents,
)
from par4_identification.inspection.fitness import (
    Fitness,
    JointTravel,
    fitness_of,
    joint_motions,
    unfit,
)
from par4_identification.logs.bag import read_bag, recorded_topics
from par4_identification.logs.bag_files import CutOffError
from par4_identification.logs.bag_repair import repair_bag
from par4_identification.logs.read_log import read_log
from par4_identification.setup_check.check import check_setup
from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.robot import Axis, Robot


@dataclass(frozen=True)
class Inspection:
    """What was found in a bag.

    Attributes:
        bag: its path.
        cut_off: why it cannot be read as it is, None if it can; then all else is of what
            `par4_record --repair` recovers.
        machine: name of the machine that it was taken to be a recording of.
        duration: from the first sample to the last, s; None where no samples can be used.
        topics, joints: that it holds.
        motion: of the joints of the machine.
        findings: what was repaired on reading it, and mistakes of the setup, sentences.
        fitness: of the bag for each tool.
    """

    bag: str
    cut_off: str | None
    machine: str
    duration: float | None
    topics: tuple[TopicContent, ...]
    joints: tuple[JointContent, ...]
    motion: tuple[JointTravel, ...]
    findings: tuple[str, ...]
    fitness: tuple[Fitness, ...]

    def to_json(self) -> dict[str, Any]:
        """Return it as plain dicts, lists, numbers and strings."""
        return {'schema': 'par4/inspection/1', **asdict(self)}


def inspect_bag(path: str | Path, machine: Robot | Axis, namespace: str | None = None
                ) -> Inspection:
    """Return what a bag holds and what each tool could do with it.

    A bag that is cut off is looked at as `par4_record --repair` would mend it; the bag itself
    stays as it is.

    Args:
        path: of the bag.
        machine: names the joints and, for voltages, the gains.
        namespace: that the topics sit under.

    Raises:
        InputError: no such bag, not a bag, or nothing in it can be read.
    """
    path = Path(path)
    try:
        return _inspected(path, path, machine, namespace, None)
    except CutOffError as error:
        reason = str(error)
    with tempfile.TemporaryDirectory() as folder:
        mended = Path(folder) / 'mended'
        repair_bag(path, mended)
        try:
            return _inspected(path, mended, machine, namespace, reason)
        except InputError as error:
            raise InputError(str(error).replace(str(mended), str(path))) from error


def _inspected(shown: Path, path: Path, machine: Robot | Axis, namespace: str | None,
               cut_off: str | None) -> Inspection:
    def told(error: Par4Error) -> str:
        return str(error).removeprefix(f'{path}: ').replace(str(path), str(shown))

    recorded = recorded_topics(path)
    try:
        bag = read_bag(path, namespace)
    except CutOffError:
        raise
    except InputError as error:
        if not recorded:
            raise
        return Inspection(str(shown), cut_off, machine.name, None, topic_contents(
            recorded, None, machine.joint_names), (), (), (), unfit(told(error)))
    topics = topic_contents(recorded, bag, machine.joint_names)
    joints = joint_contents(bag)
    try:
        log = read_log(path, machine, namespace)
    except InputError as error:
        return Inspection(str(shown), cut_off, machine.name, None, topics, joints, (), (),
                          unfit(told(error)))
    check = check_setup([log], machine)
    fitness, runs = fitness_of(check)
    return Inspection(
        str(shown), cut_off, machine.name, log.bag_accounts.duration, topics, joints,
        joint_motions(runs, machine.joint_names) if runs else (),
        (*log.bag_accounts.findings(),
         *(finding.sentence for finding in check.findings)), fitness)
