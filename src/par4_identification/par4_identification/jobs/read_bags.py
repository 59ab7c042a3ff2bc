"""The bags that a tool was given, each read once."""

from __future__ import annotations

import os
from collections.abc import Sequence
from hashlib import sha256

from par4_identification.diagnosis.progress import Progress
from par4_identification.logs.log import Log
from par4_identification.logs.read_log import read_log
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot


def read_bags(bags: Sequence[str], machine: Robot | Axis, namespace: str | None,
              progress: Progress) -> tuple[Log, ...]:
    """Return the logs of bags.

    Args:
        bags: paths.
        machine: that made them.
        namespace: that the topics sit under.
        progress: is told which bag is read.

    Raises:
        InputError: a bag that cannot be read, that is there twice, or that holds the readings of
            another one; its rows would count twice.
    """
    _refuse_twice(bags)
    logs = []
    for bag in bags:
        progress(f'reading {bag}')
        logs.append(read_log(bag, machine, namespace))
    _refuse_copies(logs, bags)
    return tuple(logs)


def _refuse_twice(bags: Sequence[str]) -> None:
    found = [os.path.realpath(bag) for bag in bags]
    for index, path in enumerate(found):
        if path in found[:index]:
            raise InputError(f'{bags[index]}: given twice; give every bag once')


def _refuse_copies(logs: Sequence[Log], bags: Sequence[str]) -> None:
    """Refuse a bag that holds the readings of another one: rows that were fitted confirm nothing.

    Raises:
        InputError: names both.
    """
    seen: dict[bytes, str] = {}
    for log, bag in zip(logs, bags, strict=True):
        readings = sha256(log.q.tobytes() + log.tau.tobytes()).digest()
        if readings in seen:
            raise InputError(f'{bag}: holds the same readings as {seen[readings]}; give another '
                             f'recording, or leave it out')
        seen[readings] = bag
