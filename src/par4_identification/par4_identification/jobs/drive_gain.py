"""par4_drive_gain: the gains of the drives from static pushes on a force sensor."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from par4_identification.gains.force_timing import late_readings
from par4_identification.gains.static_push import gains_of_pushes, pushes_of_log, read_force
from par4_identification.jobs.read_bags import read_bags
from par4_identification.reports.outcome.drive_gain import (
    drive_gain_json,
    gains_rows,
    outcome_of_gains,
)
from par4_identification.reports.outcome.results import provenance
from par4_kinematics.errors import InputError
from par4_kinematics.paths import refuse_unwritable
from par4_kinematics.robot import read_robot
from par4_sim.report.results import write_results
from par4_sim.report.terminal import print_table, say


def find_gains(pushes: tuple[str, ...], robot: str, output: Path,
               coulomb_friction: float | None, namespace: str | None) -> None:
    """Find the drive gains from bags of static pushes and the readings t,fx,fy,fz of a sensor.

    t is the stamp in seconds on the clock of the bag, the force that on the platform in `base`, N.
    """
    machine = read_robot(robot)
    pairs = bags_with_readings(pushes)
    refuse_unwritable(output)
    with Console(stderr=True).status('reading the bags') as status:
        forces = [read_force(readings) for _, readings in pairs]
        logs = read_bags([bag for bag, _ in pairs], machine, namespace, status.update)
        found = [push for log, force in zip(logs, forces, strict=True)
                 for push in pushes_of_log(log, force, machine)]
        status.update('estimating')
        gains = gains_of_pushes(found, machine, coulomb_friction)
        status.update('comparing the times of force and torque')
        late = late_readings(list(zip(logs, forces, strict=True)), machine, gains,
                             coulomb_friction)
        outcome = outcome_of_gains(gains, machine, logs, len(found), late)
        origin = provenance('par4_drive_gain', machine, [bag for bag, _ in pairs], {
            'readings': [readings for _, readings in pairs],
            'coulomb_friction': coulomb_friction, 'namespace': namespace})
        status.update('drawing the report')
        # the plot library is slow to load, and some homes make it talk on stderr
        from par4_identification.reports.gains_report import report_of_gains
        write_results(output, {
            'drive_gain.json': drive_gain_json(gains, logs, len(found), origin, late),
            'report.html': report_of_gains(gains, outcome, machine, logs, origin)})
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for name in ('', 'nominal', 'gain, N m/V', 'std', 'bound', 'difference'):
        table.add_column(name, justify='right' if name else 'left', no_wrap=True)
    for row in gains_rows(gains, machine):
        table.add_row(*row)
    print_table(table)
    reservations = [f'- {remark.text} {remark.advice}'.rstrip() for remark in outcome.remarks
                    if not remark.good]
    say(outcome.sentence, *reservations)
    say(f'results and report: {output}', whole=True)


def bags_with_readings(pushes: Sequence[str]) -> list[tuple[str, str]]:
    """Return bag and file of readings of each argument BAG=FORCE.csv.

    Raises:
        InputError: another form.
    """
    pairs: list[tuple[str, str]] = []
    for push in pushes:
        bag, _, readings = push.rpartition('=')
        if not bag or not readings:
            raise InputError(f'{push}: expected BAG=FORCE.csv, the bag and the readings of the '
                             f'force sensor')
        pairs.append((bag, readings))
    return pairs
