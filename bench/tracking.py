"""What a model is worth: the 15 G cycle with feedforward of TABLE 1, identified, extended, exact.

Each machine hides something. Its model is identified from one simulated log with noise of 0.05 N m,
diagnosed with two, and the extended model comes from the diagnosis, by the commands that a user
has. Then the machine follows the jerk-limited 15 G cycle under the drives' loops with each
feedforward, with points a millisecond apart and with one at every step of the drives. Prints a
table in Markdown. `python bench/tracking.py [--output DIR] [NAME...]`.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from par4_dynamics.model_file import read_model_file
from par4_dynamics.model_from_file import read_model
from par4_kinematics.adept import adept_motion
from par4_kinematics.files import write_yaml
from par4_kinematics.robot import read_robot
from par4_sim.choices import STEP
from par4_sim.tracking.case import Plan, compared

ROBOT = read_robot('reference')
JERK = 30_000.0
"""m/s3: 15 G are reached within 5 ms."""
PERIODS = (1e-3, STEP)
"""Seconds between the points of the reference: as usual over topics, and as drives step."""
NOISE = 0.05
"""N m rms on the recorded torque."""
FIRST_SEED = 7_600
"""Tests use seeds far below."""


def effect(name: str, joints: tuple[int, ...] = (0, 1, 2, 3), **parameters: tuple[object, str]
           ) -> dict:
    """Return an effect as `model.yaml` has it; parameters are (value, unit)."""
    return {'effect': name, 'joints': list(joints),
            'parameters': {key: {'value': value, 'unit': unit}
                           for key, (value, unit) in parameters.items()}}


STRIBECK = effect('stribeck', stribeck_torque=(2.0, 'N m'), stribeck_velocity=(0.3, 'rad/s'))
COGGING = effect('cogging', amplitude=(3.0, 'N m'), periods=(24.0, '1/turn'), phase=(0.4, 'rad'))
DIFFERENCES = (
    effect('joint_friction_difference', (0, 2), coulomb=([2.0, -1.0], 'N m'),
           viscous=([0.8, -0.6], 'N m s/rad')),
    effect('joint_inertia_difference', (1,), inertia=(0.02, 'kg m2')))
PAYLOAD = effect('payload', mass=(0.5, 'kg'), half=(1.0, '1'))


@dataclass(frozen=True)
class Hidden:
    """A machine and what is known of it before.

    Attributes:
        base: built-in model that it obeys apart from its effects.
        effects: that it has beside.
        known: rigid bodies that identification assumes.
        later: effects that come after the identification.
    """

    base: str
    effects: tuple[dict, ...] = ()
    known: str = 'full'
    later: tuple[dict, ...] = ()


MACHINES = {
    'obeys (20)': Hidden('table1', known='paper'),
    'rods': Hidden('table1_full', known='paper'),
    'Stribeck': Hidden('table1_full', (STRIBECK,)),
    'cogging': Hidden('table1_full', (COGGING,)),
    'joint differences': Hidden('table1_full', DIFFERENCES),
    'payload': Hidden('table1_full', later=(PAYLOAD,)),
    'all but the payload': Hidden('table1_full', (STRIBECK, COGGING, *DIFFERENCES)),
}


def run(*arguments: object) -> None:
    """Run a command of this environment; what it prints is only shown if it fails."""
    command = [str(Path(sys.executable).parent / str(arguments[0])), *map(str, arguments[1:])]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f'{" ".join(command)}: {done.stderr.strip()}')


def models_of(hidden: Hidden, folder: Path, seed: int) -> dict[str, Path | str]:
    """Return the models of a machine by name, from TABLE 1 to the exact one."""
    before, exact = folder / 'before.yaml', folder / 'exact.yaml'
    for path, effects in ((before, hidden.effects), (exact, hidden.effects + hidden.later)):
        content = read_model_file(hidden.base).to_yaml()
        write_yaml(path, {**content, 'effects': list(effects)})
    for row, (name, machine) in enumerate((('learned', before), ('seen', exact),
                                           ('held_out', exact))):
        if name == 'seen' and not hidden.later:
            continue  # the log of the identification shows it all
        run('par4_simulate', 'excitation', '--duration', 20, '--model', machine, '--torque-noise',
            NOISE, '--motion-seed', seed + row, '--seed', seed + row, '--output', folder / name)
    run('par4_identify', folder / 'learned', '--robot', 'reference', '--rigid-body', hidden.known,
        '--output', folder / 'identified', '--no-report')
    seen = folder / ('seen' if hidden.later else 'learned')
    identified = folder / 'identified' / 'model.yaml'
    run('par4_diagnose', seen, '--holdout', folder / 'held_out', '--robot', 'reference', '--model',
        identified, '--output', folder / 'diagnosed')
    extended = folder / 'diagnosed' / 'extended_model.yaml'
    return {'TABLE 1': 'table1', 'identified': identified,
            'extended': extended if extended.exists() else identified, 'exact': exact}


def causes_of(folder: Path, changed: bool) -> str:
    """Return what the diagnosis named, and what it reads of a machine that has changed since."""
    content = json.loads((folder / 'diagnosed' / 'diagnosis.json').read_text())
    names = [cause['effect'] for cause in content['causes']]
    readings = dict.fromkeys(change['reading'] for change in content['changes'] if changed)
    told = ', '.join((*names, *filter(None, readings)))
    return f'{content["verdict"]}: {told}' if told else content['verdict']


def main() -> None:
    """Print the table, and write it as JSON where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('machines', nargs='*', metavar='NAME', help=', '.join(MACHINES))
    parser.add_argument('--output', type=Path, help='folder to keep bags, models and table.json in')
    parser.add_argument('--first-seed', type=int, default=FIRST_SEED, help='of the logs')
    asked = parser.parse_args()
    print('| machine | diagnosis | points every | TABLE 1 | identified | extended | exact '
          '| identified / exact | extended / exact | identified / extended |\n' + 10 * '|---' + '|')
    table = {}
    with tempfile.TemporaryDirectory() as scratch:
        for row, (name, hidden) in enumerate(MACHINES.items()):
            if asked.machines and name not in asked.machines:
                continue
            folder = (asked.output or Path(scratch)) / name.replace(' ', '_')
            folder.mkdir(parents=True, exist_ok=True)
            paths = models_of(hidden, folder, asked.first_seed + 10 * row)
            told = causes_of(folder, bool(hidden.later))
            models = {key: read_model(path, ROBOT) for key, path in paths.items()}
            table[name] = {}
            for period in PERIODS:
                plan = Plan(ROBOT, models['exact'], adept_motion(ROBOT, jerk=JERK, period=period))
                rms = {case.feedforward: 1e3 * case.tracking.rms
                       for case in compared(plan, ('loops',), models)}
                ratios = (rms['identified'] / rms['exact'], rms['extended'] / rms['exact'],
                          rms['identified'] / rms['extended'])
                print(f'| {name} | {told} | {1e3 * period:g} ms | '
                      + ' | '.join(f'{value:.4f}' for value in rms.values()) + ' | '
                      + ' | '.join(f'{value:.2f}' for value in ratios) + ' |', flush=True)
                table[name][f'{1e3 * period:g} ms'] = rms
    if asked.output:
        (asked.output / 'table.json').write_text(json.dumps(table, indent=2))


if __name__ == '__main__':
    main()
