"""The main job end to end, on the real ROS 2 client library: see README.md.

par4_simulation, par4_feedforward, par4_motion and par4_record run as separate processes; what they
record is identified, validated and diagnosed by the offline tools.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from par4_dynamics import read_model_file
from par4_kinematics import InputError
from par4_kinematics.files import write_yaml
from par4_sim.cell.cell import COMPOSITIONS
from par4_sim.cell.running_cell import running_cell

BIN = Path(sys.executable).parent
CONSOLE = Console(highlight=False, soft_wrap=True)
FIT_SECONDS, VALIDATION_SECONDS = 20.0, 10.0
STARTING = 6.0
"""Seconds in which the nodes find each other and the motion is sent ahead."""
TORQUE_NOISE = 0.05
"""N m rms, on the recorded amplifier voltage."""
HIDDEN = {
    'cogging': {'amplitude': {'value': 0.6, 'unit': 'N m'},
                'periods': {'value': 24.0, 'unit': '1/turn'},
                'phase': {'value': [0.0, 1.0, 2.0, 3.0], 'unit': 'rad'}},
    'stribeck': {'stribeck_torque': {'value': 1.0, 'unit': 'N m'},
                 'stribeck_velocity': {'value': 0.12, 'unit': 'rad/s'}},
    'torque_offset': {'offset': {'value': [0.4, -0.3, 0.2, -0.5], 'unit': 'N m'}},
}


def environment() -> dict[str, str]:
    """Return the environment of the nodes: a domain of their own, nothing leaves this machine."""
    domain = 10 + os.getpid() % 90
    return {**os.environ, 'ROS_DOMAIN_ID': os.environ.get('ROS_DOMAIN_ID', str(domain)),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


def record(folder: Path, bag: Path, model: Path | str, seconds: float, seed: int, title: str
           ) -> None:
    """Play a quasi-random excitation on the simulated machine and record it into a bag."""
    log = folder / 'nodes.log'
    with log.open('a', encoding='utf-8') as stream:
        stream.write(f'--- {bag.name}: {title}, machine {model}\n')
    session = COMPOSITIONS['recording'].session({
        'machine': str(model), 'noise': str(TORQUE_NOISE), 'seed': str(seed),
        'duration': str(seconds), 'record': str(bag)})
    columns = (TextColumn('{task.description}'), BarColumn(), TimeElapsedColumn(),
               TextColumn(f'of about {seconds + STARTING:.0f} s'))
    try:
        with (running_cell(session, log, environment()) as cell,
              Progress(*columns, console=CONSOLE) as progress):
            task = progress.add_task(title, total=seconds + STARTING)
            began = time.monotonic()
            while not cell.played():
                progress.update(task, completed=time.monotonic() - began)
                time.sleep(0.1)
            progress.update(task, completed=seconds + STARTING)
    except InputError as error:
        CONSOLE.print(f'error: the motion was not played to its end: {error}', markup=False)
        CONSOLE.print(log.read_text(encoding='utf-8')[-2000:], markup=False)
        sys.exit(1)
    counted = [line for line in log.read_text(encoding='utf-8').splitlines() if bag.name in line]
    CONSOLE.print(f'  {counted[-1] if counted else bag}', markup=False)


def tool(executable: str, *arguments: object) -> None:
    """Run an offline tool in the foreground."""
    line = [str(BIN / executable), *map(str, arguments)]
    CONSOLE.print(f'\n$ {executable} {" ".join(map(str, arguments))}', style='bold', markup=False)
    if subprocess.run(line, check=False).returncode != 0:
        sys.exit(1)


def main() -> None:
    """Run the demo."""
    parser = argparse.ArgumentParser(description='Par4 end to end')
    parser.add_argument('--output', type=Path, default=Path('demo_output'))
    parser.add_argument('--hide', choices=sorted(HIDDEN), default='cogging',
                        help='effect that the second machine hides')
    arguments = parser.parse_args()
    folder: Path = arguments.output
    if folder.exists() and any(folder.iterdir()) and not (folder / 'nodes.log').exists():
        sys.exit(f'error: {folder} exists and holds no earlier demo; give another --output')
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    began = time.monotonic()
    CONSOLE.print(
        'A simulated Par4 plays quasi-random motions and is recorded; from the bags its dynamic '
        'parameters are identified (TABLE 1 of the paper), checked on another motion (its Fig. 7), '
        'and a second machine, which secretly has an effect the model lacks, is diagnosed. The '
        f'recorded torque has {TORQUE_NOISE} N m of noise.')

    CONSOLE.rule('1. Record: four nodes, real messages, pybullet')
    fit, check = folder / 'excitation_bag', folder / 'validation_bag'
    record(folder, fit, 'table1_full', FIT_SECONDS, 1, 'slow phase, then fast phase')
    record(folder, check, 'table1_full', VALIDATION_SECONDS, 2, 'another motion')

    CONSOLE.rule('2. Identify: TABLE 1')
    tool('par4_identify', fit, '--robot', 'reference', '--rigid-body', 'full',
         '--compare-true', 'table1_full', '--output', folder / 'identified')

    CONSOLE.rule('3. Validate on the other motion: Fig. 7')
    model = folder / 'identified' / 'model.yaml'
    tool('par4_validate', check, '--model', model, '--robot', 'reference',
         '--output', folder / 'validated')

    CONSOLE.rule('4. The same on a machine that hides an effect')
    hidden = folder / 'hidden_machine.yaml'
    content = read_model_file('table1_full').to_yaml()
    content['effects'] = [{'effect': arguments.hide, 'parameters': HIDDEN[arguments.hide]}]
    write_yaml(hidden, content)
    odd_fit, odd_check = folder / 'odd_excitation_bag', folder / 'odd_validation_bag'
    record(folder, odd_fit, hidden, FIT_SECONDS, 3, 'slow phase, then fast phase')
    record(folder, odd_check, hidden, VALIDATION_SECONDS, 4, 'another motion')
    tool('par4_validate', odd_check, '--model', model, '--robot', 'reference',
         '--output', folder / 'odd_validated')

    CONSOLE.rule('5. Diagnose: what is wrong, and why')
    tool('par4_diagnose', odd_fit, '--holdout', odd_check, '--model', model,
         '--robot', 'reference', '--output', folder / 'diagnosed')

    CONSOLE.rule('6. See what was recorded')
    tool('python', os.path.relpath(Path(__file__).with_name('animate.py')), '--bag', check,
         '--output', folder / 'par4.gif')

    CONSOLE.rule(f'done in {time.monotonic() - began:.0f} s')
    extended = folder / 'diagnosed' / 'extended_model.yaml'
    CONSOLE.print(f"""Everything lies in {folder}/:
  identified/report.html     TABLE 1
  validated/report.html      Fig. 7; odd_validated/report.html: the same on the odd machine
  diagnosed/report.html      what the model gets wrong, why, and what knowing it gains
  par4.gif, par4.png         the robot in the liveliest seconds of validation_bag
  *_bag/ (rosbag2, MCAP), nodes.log (what the nodes said)
To try next:
  .venv/bin/python demo/demo.py --hide stribeck        (or torque_offset)
  .venv/bin/par4_simulate adept --output {folder}/adept_bag --model {extended}
  README.md, docs/model.md, docs/diagnosis.md""", markup=False)


if __name__ == '__main__':
    main()
