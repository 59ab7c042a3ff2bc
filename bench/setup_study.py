"""How often mistakes of the setup are told: docs/setup_study.md.

Machines and motions come from tests/hidden, half of them with a hidden effect of the library; the
mistake is made to the recorded samples by tests/mistakes.py, which shares nothing with what looks
for it. Every recording is judged as it is, and some of them with eight mistakes, one at a time;
some are diagnosed too, to see whether the hidden effect is still named after the mend.

    python bench/setup_study.py                      the whole study, scoring seeds
    python bench/setup_study.py --scale 0.05 --first-seed 1000 --output /tmp/setup.md    developing

Scenarios are independent tasks on dask, on this machine or with `--scheduler` on others.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

import mistakes
import numpy as np
from blind_scores import share, table, wrapped
from blind_study import commit, machine_name, read_outcomes
from dask.distributed import Client, LocalCluster, as_completed
from hidden.hiders import HIDERS
from hidden.kept import read_kept
from hidden.recording import record
from hidden.scenario import Scenario, Task, draw_scenario
from rich.progress import Progress
from singular_log import singular_log

from par4_dynamics.model import Model
from par4_identification.diagnosis.diagnosis import diagnose
from par4_identification.diagnosis.verdict.answer import Unusable
from par4_identification.logs.log import Log
from par4_identification.setup_check.check import check_setup
from par4_identification.setup_check.finding import SetupCheck
from par4_identification.setup_check.unusable import diagnosed_if_sound
from par4_kinematics.robot import Robot

ROOT = Path(__file__).parents[1]
SCORING_SEED = 8_570_000
"""Seeds below are for developing, or were scored before what they showed changed the looks."""
RECORDINGS = 400
"""At scale 1."""
MISTAKEN, EACH = 0.125, 8
"""Share of the recordings that mistakes are made to, one at a time, and how many."""
EVERY_DIAGNOSED, DIAGNOSED = 6, 3
"""One in so many of those with mistakes is diagnosed as well, with so many of them; it has a hidden
effect, as every second recording has."""
TIMED = ('time_offset', 'actuator_lag')
"""Effects that are a delay by themselves: not hidden beside one."""
PLACED = ('encoder_offset', 'geometry_error', 'leg_length_error', 'encoder_eccentricity')
"""The same of zeros and dimensions."""


@dataclass(frozen=True)
class Case:
    """A mistake made to the logs of a scenario.

    Attributes:
        logs: with the mistake.
        robot: the robot file that is believed.
        model: that is known of the machine, or None.
        joints: that a right finding names; None where any will do.
        truth: its size in words.
    """

    logs: tuple[Log, ...]
    robot: Robot
    model: Model | None
    joints: tuple[tuple[int, ...], ...] | None
    truth: str


Make = Callable[[Sequence[Log], Scenario, np.random.Generator], Case]


def each(logs: Sequence[Log], change: Callable[[Log], Log]) -> tuple[Log, ...]:
    """Return all logs changed alike: a mistake of the setup is in all of them."""
    return tuple(map(change, logs))


def first(logs: Sequence[Log], change: Callable[[Log], Log]) -> tuple[Log, ...]:
    """Return the logs, the first changed: a fault of one log."""
    return change(logs[0]), *logs[1:]


def one_sign(random: np.random.Generator) -> float:
    """Return +1 or -1."""
    return float(random.choice((-1.0, 1.0)))


def exchange(logs, scenario, random):
    """Two plugs exchanged: of torques, positions or both."""
    columns = (('tau',), ('q',), ('q', 'tau'))[random.integers(3)]
    one, other = sorted(random.permutation(4)[:2].tolist())
    if len(columns) == 2:  # opposite legs exchanged as a whole are a mirror image: no mistake shows
        one, other = ((0, 1), (2, 3), (1, 2), (0, 3))[random.integers(4)]
        # ... and exchanged neighbours are the mirror image of the other two exchanged
        same = tuple(sorted(set(range(4)) - {one, other}))
        named = ((one, other), same)
    else:
        named = ((one, other),)
    return Case(each(logs, lambda log: mistakes.exchanged(log, one, other, *columns)),
                scenario.known.robot, None, named, f'{" and ".join(columns)} of {one}, {other}')


def reverse(logs, scenario, random):
    """The sign of some readings turned over."""
    columns = (('tau',), ('q',), ('q', 'tau'))[random.integers(3)]
    joints = (tuple(range(4)) if random.uniform() < 0.4 else (int(random.integers(4)),))
    return Case(each(logs, lambda log: mistakes.reversed_sign(log, joints, *columns)),
                scenario.known.robot, None, (joints,), f'{" and ".join(columns)} of {joints}')


def unit(logs, scenario, random):
    """Degrees, milliseconds, volts and N m mixed up, the latter two with and without a model."""
    robot, which = scenario.known.robot, int(random.integers(6))
    change = (mistakes.in_degrees, mistakes.in_milliseconds,
              lambda log: mistakes.torque_as_voltage(log, robot),
              lambda log: mistakes.voltage_as_torque(log, robot))[min(which, 3) if which < 4
                                                                  else which - 2]
    model = scenario.known.model if which >= 4 else None
    words = ('degrees', 'milliseconds', 'N m for volts', 'volts for N m',
             'N m for volts, with --model', 'volts for N m, with --model')[which]
    return Case(each(logs, change), robot, model, None, words)


def gain(logs, scenario, random):
    """All torques too large or too small by one factor, a model being given."""
    factor = float(np.exp(one_sign(random) * random.uniform(np.log(1.25), np.log(3.0))))
    return Case(each(logs, lambda log: mistakes.scaled(log, factor)), scenario.known.robot,
                scenario.known.model, None, f'{factor:.2f}, with --model')


def zero(logs, scenario, random):
    """The zeros of one, two or all joints off by 1.5 to 10 degrees."""
    count = int(random.choice((1, 1, 2, 4)))
    joints = np.sort(random.permutation(4)[:count])
    offsets = np.zeros(4)
    offsets[joints] = np.radians(random.uniform(1.5, 10.0, count)) * np.array(
        [one_sign(random) for _ in joints])
    return Case(each(logs, lambda log: mistakes.zero_off(log, offsets)), scenario.known.robot,
                None, (tuple(joints.tolist()),),
                ', '.join(f'{angle:.1f}' for angle in np.degrees(offsets)) + ' degrees')


def delay(logs, scenario, random):
    """The torque recorded 15 to 200 ms late or early."""
    late = one_sign(random) * float(np.exp(random.uniform(np.log(0.015), np.log(0.2))))
    return Case(each(logs, lambda log: mistakes.recorded_late(log, late)), scenario.known.robot,
                None, None, f'{1e3 * late:.1f} ms')


def dimensions(logs, scenario, random):
    """A length of the robot file wrong by 15 to 40 mm."""
    name = str(random.choice(('arm_length', 'forearm_length', 'base_radius', 'platform_radius')))
    error = one_sign(random) * float(random.uniform(0.015, 0.04))
    return Case(tuple(logs), mistakes.other_dimensions(scenario.known.robot, **{name: error}), None,
                None, f'{name} by {1e3 * error:.0f} mm')


def freeze(logs, scenario, random):
    """An encoder that stands still for 0.3 to 3 s while its joint moves."""
    joint, length = int(random.integers(4)), float(random.uniform(0.3, 3.0))
    start = moving_time(logs[0], random, length)
    return Case(first(logs, lambda log: mistakes.frozen(log, joint, start, start + length)),
                scenario.known.robot, None, ((joint,),), f'joint {joint} for {length:.1f} s')


def slip(logs, scenario, random):
    """A reading that jumps by 0.4 to 5 degrees and stays."""
    joint, step = int(random.integers(4)), one_sign(random) * np.radians(random.uniform(0.4, 5.0))
    at = moving_time(logs[0], random, 0.5)
    return Case(first(logs, lambda log: mistakes.slipped(log, joint, at, float(step))),
                scenario.known.robot, None, ((joint,),), f'{np.degrees(step):.2f} degrees')


def hold(logs, scenario, random):
    """A logger that repeats its readings for 10 to 40 ms, ten to thirty times."""
    length, count = float(random.uniform(0.01, 0.04)), int(random.integers(10, 31))
    end = float(logs[0].t[-1] - logs[0].t[0])
    starts = np.sort(random.uniform(0.5, end - 0.5, count))
    return Case(first(logs, lambda log: mistakes.held(log, starts, length)), scenario.known.robot,
                None, None, f'{count} times {1e3 * length:.0f} ms')


def spike(logs, scenario, random):
    """Three to fifteen single wrong samples of one reading."""
    column, joint = str(random.choice(('q', 'tau'))), int(random.integers(4))
    count = int(random.integers(3, 16))
    end = float(logs[0].t[-1] - logs[0].t[0])
    times = random.uniform(0.5, end - 0.5, count)
    largest = 0.5 if column == 'q' else 2.0 * float(np.abs(logs[0].tau[:, joint]).max())
    sizes = largest * random.uniform(0.2, 1.0, count) * np.array(
        [one_sign(random) for _ in range(count)])
    return Case(first(logs, lambda log: mistakes.spiked(log, column, joint, times, sizes)),
                scenario.known.robot, None, ((joint,),), f'{count} of {column}')


def clip(logs, scenario, random):
    """A converter that ends at the level that 1 to 4 % of the torques exceed."""
    level = float(np.quantile(np.abs(logs[0].tau), random.uniform(0.96, 0.99)))
    return Case(each(logs, lambda log: mistakes.clipped(log, level)), scenario.known.robot, None,
                None, f'{level:.1f} N m')


def drift(logs, scenario, random):
    """The clock of the torque 0.06 to 0.2 % fast or slow."""
    rate = one_sign(random) * float(random.uniform(6e-4, 2e-3))
    return Case(each(logs, lambda log: mistakes.fast_clock(log, rate)), scenario.known.robot, None,
                None, f'{100 * rate:.2f} %')


def singular(logs, scenario, random):
    """A motion that is led through a singular pose for a while."""
    return Case((singular_log(scenario.known, random), *logs[1:]), scenario.known.robot, None,
                None, 'one pass')


def stand(logs, scenario, random):  # noqa: ARG001
    """A machine that was never told to move."""
    return Case(each(logs, mistakes.standing), scenario.known.robot, None, ((0, 1, 2, 3),), 'all')


def moving_time(log: Log, random: np.random.Generator, length: float) -> float:
    """Return a time from which on the machine moves, s after the first sample."""
    speed = np.abs(np.diff(log.q, axis=0)).min(axis=1) / log.period
    end = float(log.t[-1] - log.t[0])
    choices = random.uniform(1.0, end - length - 1.0, 50)
    rows = [float(np.mean(speed[int(at / log.period):int((at + length) / log.period)]))
            for at in choices]
    return float(choices[int(np.argmax(np.array(rows) > 0.05))])


MISTAKES: dict[str, tuple[Make, tuple[str, ...]]] = {
    'joints_exchanged': (exchange, ()), 'sign_reversed': (reverse, ()), 'wrong_unit': (unit, ()),
    'common_gain': (gain, ()), 'zero_error': (zero, PLACED), 'delay': (delay, TIMED),
    'wrong_dimensions': (dimensions, PLACED), 'frozen_encoder': (freeze, ()),
    'encoder_slip': (slip, PLACED), 'held_samples': (hold, ()), 'spikes': (spike, ()),
    'clipped': (clip, ()), 'clock_drift': (drift, TIMED), 'singular_pose': (singular, ()),
    'not_moving': (stand, ())}
"""Kind -> how it is made, and the hidden effects that are the same thing."""


def outcomes_of(index: int, seed: int, mistaken: bool, diagnosed: bool) -> list[dict]:
    """Return what was found in a recording and after each mistake made to it, as plain data."""
    kinds = list(MISTAKES)
    # an odd number of kinds goes round, so that each meets logs with and without a hidden effect
    made = [kinds[(EACH * index + number) % len(kinds)] for number in range(EACH)
            ] if mistaken else []
    random = np.random.default_rng((seed, 13))
    alike = {name for kind in made for name in MISTAKES[kind][1]}
    effect = str(random.choice([name for name in HIDERS if name not in alike])
                 ) if index % 2 else None
    scenario = draw_scenario(Task('single' if effect else 'clean', seed, effect,
                                  coloured=bool(random.integers(2))))
    logs = [_recorded(scenario, number) for number in range(2 if diagnosed else 1)]
    started = time.process_time()
    good = check_setup(logs, scenario.known.robot)
    common = {'seed': seed, 'effect': effect, 'robot': scenario.known.name,
              'motion': scenario.shape}
    found = [common | {
        'kind': 'good', 'found': [finding.to_json() for finding in good.findings],
        'seconds': round(time.process_time() - started, 2),
        'log': float(sum(log.t[-1] - log.t[0] for log in logs)),
        **({'named': named(good)} if diagnosed else {})}]
    for number, kind in enumerate(made):
        case = MISTAKES[kind][0](logs, scenario, random)
        check = check_setup(case.logs, case.robot, case.model)
        found.append(common | {
            'kind': kind, 'truth': case.truth, 'right': is_right(kind, case, check),
            'found': [finding.to_json() for finding in check.findings],
            'certain': not check.useless,
            **({'named_good': found[0]['named'], 'named': named(check)}
               if diagnosed and number < DIAGNOSED else {})})
    return found


def outcomes_of_kept(path: Path) -> list[dict]:
    """Return what was found in the two logs of a kept recording without mistake."""
    kept, found = read_kept(path), []
    for log in (kept.fit, kept.heldout):
        started = time.process_time()
        check = check_setup([log], kept.robot)
        found.append({
            'kind': 'good', 'seed': kept.truth['seed'], 'log_name': f'{path.stem} {log.name}',
            'effect': ', '.join(item['effect'] for item in kept.truth['hidden']) or None,
            'robot': kept.truth['robot'], 'motion': kept.truth['motion'], 'kept': path.stem,
            'found': [finding.to_json() for finding in check.findings],
            'seconds': round(time.process_time() - started, 2), 'log': float(log.t[-1] - log.t[0])})
    return found


def is_right(kind: str, case: Case, found: SetupCheck) -> bool:
    """Return whether the mistake is found, nothing else is, and the joints are right."""
    if {finding.finding for finding in found.findings} != {kind}:
        return False
    joints = tuple(sorted({joint for finding in found.findings for joint in finding.joints}))
    return case.joints is None or joints in [tuple(sorted(each)) for each in case.joints]


def named(check: SetupCheck) -> list[list[str]]:
    """Return the sets of names that the diagnosis of mended logs gives."""
    fit, *held = check.logs
    diagnosis = diagnosed_if_sound(check, lambda sound: diagnose(
        [fit], sound.machine, holdout_logs=held))
    if isinstance(diagnosis, Unusable):
        return []
    return [[cause.effect.name, *cause.twins] for cause in diagnosis.causes]


def _recorded(scenario: Scenario, number: int) -> Log:
    """Return the log to fit (0) or held out (1) of a scenario."""
    known, wander = scenario.known, scenario.wander
    return record(
        known, scenario.machine, scenario.motions[number], fidelity='exact', noise=scenario.noise,
        seed=2 * scenario.task.seed + number,
        feedforward=known.model if scenario.feedforward else None,
        wander=wander and replace(wander, seed=wander.seed + 7 * number),
        name=('fit', 'held out')[number]).log


def attempted(task: tuple[int, int, bool, bool] | Path) -> list[dict]:
    """Return the outcomes of a task or of a kept recording, or the error that ended it."""
    try:
        return outcomes_of_kept(task) if isinstance(task, Path) else outcomes_of(*task)
    except Exception:
        seed = int(task.stem.rpartition('-')[2]) if isinstance(task, Path) else task[1]
        return [{'kind': 'error', 'seed': seed, 'error': traceback.format_exc()}]


def run(tasks: Sequence[tuple[int, int, bool, bool] | Path], scheduler: str | None, workers: int,
        results: Path) -> None:
    """Run tasks on dask and append each outcome to `results` as it comes."""
    os.environ['PYTHONPATH'] = os.pathsep.join(filter(None, (
        str(ROOT / 'tests'), str(ROOT / 'bench'), os.environ.get('PYTHONPATH'))))
    cluster = None if scheduler else LocalCluster(n_workers=workers, threads_per_worker=1,
                                                  dashboard_address=None)
    with Client(scheduler or cluster) as client, results.open('a') as file, Progress() as progress:
        bar = progress.add_task('looking', total=len(tasks))
        futures = client.map(attempted, tasks, pure=False)
        for future, outcomes in as_completed(futures, with_results=True):
            future.release()  # a worker that is lost would have its work done again
            file.writelines(json.dumps(outcome) + '\n' for outcome in outcomes)
            file.flush()
            progress.advance(bar)
    if cluster:
        cluster.close()


def keeps_effect(outcome: dict, key: str) -> bool:
    """Return whether the hidden effect is among the names."""
    return any(outcome['effect'] in names for names in outcome[key])


def report(outcomes: Sequence[dict], header: dict, planned: int) -> str:
    """Return docs/setup_study.md."""
    errors = [outcome for outcome in outcomes if 'error' in outcome]
    everything = sorted((outcome for outcome in outcomes if 'error' not in outcome),
                        key=lambda outcome: outcome['seed'])
    good = [outcome for outcome in everything if outcome['kind'] == 'good']
    outcomes = [outcome for outcome in everything if outcome['kind'] != 'good']
    rows, wrong = [], []
    for kind in MISTAKES:
        own = [outcome for outcome in outcomes if outcome['kind'] == kind]
        missed = [outcome for outcome in own if not outcome['found']]
        other = [outcome for outcome in own if outcome['found'] and not outcome['right']]
        rows.append((f'`{kind}`', len(own), share(own, lambda item: item['right']), len(other),
                     len(missed), sum(bool(item['effect']) for item in own),
                     sum(item['right'] for item in own if item['effect'])))
    for outcome in outcomes:
        if not outcome['right']:
            said = '; '.join(f'{item["finding"]} {item["joints"]}' for item in outcome['found'])
            wrong.append((outcome['kind'], outcome['seed'], outcome['truth'],
                          outcome['effect'] or '-', outcome['motion'], said or '-'))
    accused = [(outcome['seed'], outcome['effect'] or '-', item['finding'], item['evidence'])
               for outcome in good for item in outcome['found']]
    diagnosed = [item for item in outcomes if 'named' in item and item['right']
                 and item['certain'] and item['kind'] != 'singular_pose']  # a log of its own
    before = [item for item in diagnosed if keeps_effect(item, 'named_good')]
    per_log = np.array([item['seconds'] * 30.0 / item['log'] for item in good])
    lost = Counter(item['kind'] for item in before if not keeps_effect(item, 'named'))
    hidden = sum(bool(outcome['effect']) for outcome in outcomes)
    kept = sum('kept' in item for item in good)
    return wrapped(f'''# Study of mistakes of the setup

Written by `bench/setup_study.py`, good or bad. {header['date']}; {header['machine']}; commit
{header['commit']}; seeds from {header['first_seed']}; {len(good) - kept} of {planned} recordings
and {len(outcomes)} mistakes made to them, {hidden} of these beside a hidden effect of the library;
{len(errors)} recordings ended in an error.
{kept} of the logs without mistake were kept by the blind study;
some of them hide what no library has.

Each recording is of a machine and a motion of `tests/hidden` (two robots, four shapes of motion,
white and coloured noise, 16 s of log). The check sees it as it was recorded, and some of them with
{EACH} mistakes made to each by `tests/mistakes.py`, one at a time. Right: exactly this kind is
found, on the right joints. The log of a singular pose is calculated and hides nothing. A pair of
legs exchanged in positions and torques alike is the mirror image of the other pair exchanged, so
either counts.

## What was to be reached

{table(('', 'to reach', 'measured (95 % interval, Wilson)'), [
    ('right finding', '95 %', share(outcomes, lambda item: item['right'])),
    ('- without a hidden effect', '', share(
        [item for item in outcomes if not item['effect']], lambda item: item['right'])),
    ('- beside a hidden effect', '', share(
        [item for item in outcomes if item['effect']], lambda item: item['right'])),
    ('a finding on a log without mistake', 'at most 1 %', share(
        good, lambda item: item['found'])),
    ('- without a hidden effect', '', share(
        [item for item in good if not item['effect']], lambda item: item['found'])),
    ('hidden effect named after the mend, where it is named without the mistake', '85 %', share(
        before, lambda item: keeps_effect(item, 'named'))),
    ('hidden effect named after the mend, of all diagnosed', '', share(
        diagnosed, lambda item: keeps_effect(item, 'named'))),
    ('errors (tracebacks)', '0', str(len(errors)))])}

A diagnosis takes some 10 s a log, so few of the recordings with mistakes are diagnosed, with
{DIAGNOSED} of their mistakes; the others are checked alone.
The check takes {np.median(per_log):.2f} s of one core for 30 s of log (median; 95 %
of them below {np.quantile(per_log, 0.95):.2f} s).
{'Lost after the mend: ' + ', '.join(f'{kind} {count}' for kind, count in lost.items()) + '.'
 if lost else 'No hidden effect was lost by mending.'}

## By kind

{table(('mistake', 'made', 'right', 'another or more found', 'nothing found',
        'with a hidden effect', 'right of these'), rows)}

## Findings on logs without mistake

{table(('seed', 'hidden', 'finding', 'evidence'), accused) if accused else 'None.'}

## Every mistake that was not told right

{table(('mistake', 'seed', 'truth', 'hidden', 'motion', 'found'), wrong) if wrong else 'None.'}
''')


def main() -> None:
    """Run the study and write its report."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--scale', type=float, default=1.0,
                        help='1 = 400 recordings and 400 mistakes')
    parser.add_argument('--first-seed', type=int, default=SCORING_SEED)
    parser.add_argument('--mistaken', type=float, default=MISTAKEN,
                        help='share of the recordings that mistakes are made to')
    parser.add_argument('--every-diagnosed', type=int, default=EVERY_DIAGNOSED,
                        help='one in so many of these is diagnosed, too')
    parser.add_argument('--scheduler', help='address of a dask scheduler; default: this machine')
    parser.add_argument('--workers', type=int, default=os.cpu_count())
    parser.add_argument('--results', type=Path, default=ROOT / 'setup_study.jsonl')
    parser.add_argument('--kept', type=Path, help='folder of recordings of the blind study, whose '
                        'logs are judged as logs without mistake')
    parser.add_argument('--resume', action='store_true', help='keep what --results holds')
    parser.add_argument('--output', type=Path, default=ROOT / 'docs' / 'setup_study.md')
    arguments = parser.parse_args()
    header = {'date': datetime.date.today().isoformat(), 'machine': machine_name(),
              'commit': commit(), 'first_seed': arguments.first_seed}
    count = max(1, round(arguments.scale * RECORDINGS))
    mistaken = round(arguments.mistaken * count)
    tasks = [(index, arguments.first_seed + index, index < mistaken,
              index < mistaken and index % arguments.every_diagnosed == 1)
             for index in range(count)]
    if not arguments.resume:
        arguments.results.write_text('', encoding='utf-8')
    kept = [path for path in sorted(arguments.kept.glob('*.npz'))
            if not path.stem.startswith('large')] if arguments.kept else []  # a mistake itself
    done = {item.get('kept', item['seed']) for item in read_outcomes(arguments.results)
            if 'error' not in item}
    try:
        run([*(task for task in tasks if task[1] not in done),
             *(path for path in kept if path.stem not in done)], arguments.scheduler,
            arguments.workers, arguments.results)
    except KeyboardInterrupt:
        print('stopped: the report is of what is done, --resume goes on')
    seeds = {seed for _, seed, *_ in tasks}
    latest = {(item.get('log_name', item['seed']), item['kind']): item
              for item in read_outcomes(arguments.results)
              if item['seed'] in seeds or 'kept' in item}
    whole = {seed for seed, kind in latest if kind == 'good'}
    outcomes = [item for (seed, kind), item in latest.items()
                if kind != 'error' or seed not in whole]
    arguments.output.write_text(report(outcomes, header, count), encoding='utf-8')
    print(f'{arguments.output}: {len(outcomes)} outcomes')


if __name__ == '__main__':
    main()
