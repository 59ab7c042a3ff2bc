"""par4_bag --inspect: what a bag holds and what each tool could do with it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from par4_identification.inspection.inspection import Inspection, inspect_bag
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot, read_machine
from par4_sim.report.results import plain
from par4_sim.report.terminal import print_table, say


def inspect(bag: Path, robot: str, namespace: str | None, as_json: bool) -> None:
    """Say what a bag holds and what each tool could do with it."""
    machine = read_machine(robot)
    with Console(stderr=True).status('reading the bag'):
        found = inspect_bag(bag, machine, namespace)
    if as_json:
        print(json.dumps(plain(found.to_json()), indent=2))
        return
    _show(found, machine)


def _show(found: Inspection, machine: Robot | Axis) -> None:
    length = '' if found.duration is None else f', {found.duration:.4g} s'
    say(f'{found.bag}: read as a recording of {found.machine}{length}')
    if found.cut_off is not None:
        say(f'not readable as it is: {found.cut_off}; what follows can be recovered')
    print_table(_table(
        ('topic', 'type', 'messages', 'Hz', 'gaps', 'longest', 'by'), (2, 3, 4, 5),
        [(topic.name, topic.type.rpartition('/')[2], str(topic.messages),
          _number(topic.rate), _number(topic.gaps),
          '' if not topic.gaps else f'{topic.longest_gap:.3g} s', topic.by)
         for topic in found.topics]))
    moves = {motion.name: motion for motion in found.motion}
    rows = []
    for joint in found.joints:
        motion = moves.get(joint.name)
        also = [said for name, said in (('velocity', 'velocity'), ('effort', 'torque'))
                if getattr(joint, name)]
        rows.append((joint.name, str(joint.samples), _number(joint.lowest),
                     _number(joint.highest),
                     '' if motion is None else f'{motion.peak_speed:.3g}',
                     '' if motion is None else f'{motion.seconds:.3g} s', ', '.join(also)))
    if rows:
        way, speed = unit_on(machine, 'rad'), unit_on(machine, 'rad/s')
        print_table(_table(('joint', 'samples', f'from, {way}', f'to, {way}', f'speed, {speed}',
                            'moves', 'also'), (1, 2, 3, 4, 5), rows))
    for finding in found.findings:
        say(f'look at this: {finding}')
    reasons = {item.reason for item in found.fitness}
    if len(reasons) == 1:
        say(f'no tool can use it: {reasons.pop()}')
        return
    for item in found.fitness:
        say(f'{item.tool}: {item.use}, {item.reason}')


def _table(names: Sequence[str], numbers: Sequence[int], rows: Sequence[Sequence[str]]) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for index, name in enumerate(names):
        table.add_column(name, justify='right' if index in numbers else 'left', overflow='fold')
    for row in rows:
        table.add_row(*row)
    return table


def _number(value: float | None) -> str:
    return '' if value is None else f'{value:.4g}'
