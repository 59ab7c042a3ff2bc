"""How often the diagnosis is right where the truth is hidden from it: docs/blind_study.md.

Scenarios come from tests/hidden, which shares no formula with the diagnosis: effect, size, joints,
robot, friction, motion, noise, all from seeds. What is visible and what is a twin the generator
computes from the truth. Scenarios are independent tasks on dask: on all cores by default, on the
machines of a cluster with `--scheduler tcp://ADDRESS:8786`, whose workers need this checkout
installed and `PYTHONPATH=tests`.

    python bench/blind_study.py                      the whole study, scoring seeds
    python bench/blind_study.py --scale 0.1 --first-seed 1000 --output /tmp/study.md    developing

Outcomes are appended to a JSON-lines file as they come; Ctrl-C ends a study early with a report of
what is done, and `--resume` goes on with it if the rules are still the same.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import statistics
import subprocess
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

import numpy as np
from dask.distributed import Client, LocalCluster, as_completed
from hidden.scenario import Task
from hidden.study import outcome_of, tasks_of_study
from hidden.truth import CHAOTIC, TWIN, VISIBLE
from rich.progress import Progress
from scipy.stats import binomtest

from par4_identification.diagnosis.rules import Rules

ROOT = Path(__file__).parents[1]
SCORING_SEED = 7_000_000
"""Seeds below are for developing; thresholds are fixed before any seed from here on is run."""
Outcome = dict


def attempted(task: Task) -> Outcome:
    """Return the outcome of a task, or the error that ended it: one must not end the study."""
    try:
        return outcome_of(task)
    except Exception:
        return {**asdict(task), 'error': traceback.format_exc()}


def run(tasks: Sequence[Task], scheduler: str | None, results: Path) -> None:
    """Run tasks on dask and append each outcome to `results` as it comes."""
    # inherited by the workers, which dask keeps at one thread each
    os.environ['PYTHONPATH'] = os.pathsep.join(
        filter(None, (str(ROOT / 'tests'), os.environ.get('PYTHONPATH'))))
    cluster = None if scheduler else LocalCluster(
        n_workers=os.cpu_count(), threads_per_worker=1, dashboard_address=None)
    with Client(scheduler or cluster) as client, results.open('a') as file, Progress() as progress:
        bar = progress.add_task('diagnosing', total=len(tasks))
        futures = client.map(attempted, tasks, pure=False)
        for _, outcome in as_completed(futures, with_results=True):
            file.write(json.dumps(outcome) + '\n')
            file.flush()
            progress.advance(bar)
    if cluster:
        cluster.close()


def read_outcomes(path: Path) -> list[Outcome]:
    """Return the header and the outcomes of a file; a line that was cut off is left out."""
    outcomes = []
    for line in path.read_text(encoding='utf-8').splitlines() if path.exists() else ():
        try:
            outcomes.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return outcomes


def named(outcome: Outcome) -> list[str]:
    """Return the first names of the causes."""
    return [cause['effect'] for cause in outcome['causes']]


def said(outcome: Outcome) -> list[set[str]]:
    """Return the sets of names that the causes stand for."""
    return [{cause['effect'], *cause['twins']} for cause in outcome['causes']]


def hidden_names(outcome: Outcome) -> list[str]:
    """Return what is hidden."""
    return [item['effect'] for item in outcome['hidden']]


def is_right(outcome: Outcome) -> bool:
    """Return whether each hidden effect is in a set of its own."""
    left = said(outcome)
    for name in hidden_names(outcome):
        match = next((names for names in left if name in names), None)
        if match is None:
            return False
        left.remove(match)
    return True


def is_false(outcome: Outcome) -> bool:
    """Return whether a cause stands for nothing that is hidden."""
    return any(not names & set(hidden_names(outcome)) for names in said(outcome))


def is_visible(outcome: Outcome) -> bool:
    """Return whether all that is hidden is visible."""
    return all(item['visible'] for item in outcome['hidden'])


def share(outcomes: Sequence[Outcome], good: Callable[[Outcome], bool]) -> str:
    """Return count, share and Wilson interval in words."""
    if not outcomes:
        return '-'
    count = sum(map(bool, map(good, outcomes)))
    interval = binomtest(count, len(outcomes)).proportion_ci(method='wilson')
    return (f'{count} of {len(outcomes)}, {count / len(outcomes):.1%} '
            f'({interval.low:.1%} to {interval.high:.1%})')


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ['---'] * len(head), *rows]
    return '\n'.join('| ' + ' | '.join(map(str, line)) + ' |' for line in lines)


def gained(outcomes: Sequence[Outcome]) -> str:
    """Return the median and the lower quartile of the gain over that of the true model."""
    shares = [outcome['gain']['found'] / outcome['gain']['possible'] for outcome in outcomes
              if outcome['gain'] and outcome['gain']['possible'] > outcome['gain']['left']]
    if not shares:
        return '-'
    return (f'median {np.median(shares):.1%}, mean {np.mean(shares):.1%}, lower quartile '
            f'{np.quantile(shares, 0.25):.1%} ({len(shares)} scenarios)')


def of_kind(outcomes: Sequence[Outcome], *kinds: str) -> list[Outcome]:
    """Return the outcomes of some kinds."""
    return [outcome for outcome in outcomes if outcome['kind'] in kinds]


def scores(outcomes: Sequence[Outcome]) -> str:
    """Return the table of what is to be reached."""
    singles = list(filter(is_visible, of_kind(outcomes, 'single', 'rods')))
    alone = [outcome for outcome in singles if not outcome['hidden'][0]['twins']]
    pairs = list(filter(is_visible, of_kind(outcomes, 'pair')))
    removed = list(filter(is_visible, of_kind(outcomes, 'removed')))
    clean = of_kind(outcomes, 'clean')
    white, coloured = ([item for item in clean if item['coloured'] is which]
                       for which in (False, True))
    sizes = [len(names) for outcome in singles for names in said(outcome)]
    below = [outcome for outcome in of_kind(outcomes, 'below') if not is_visible(outcome)]

    def accused(outcome: Outcome) -> bool:
        return bool(outcome['causes'])

    return table(('', 'to reach', 'measured (95 % interval, Wilson)'), [
        ('right name, or a set that holds it', '95 %', share(singles, is_right)),
        ('exactly the right name where no twin exists', '90 %', share(
            alone, lambda item: said(item) == [set(hidden_names(item))])),
        ('first name right where no twin exists', '-', share(
            alone, lambda item: named(item)[:1] == hidden_names(item))),
        ('median size of the sets', 'at most 2', statistics.median(sizes) if sizes else '-'),
        ('both causes of a pair', '80 %', share(pairs, is_right)),
        ('wrong name (single effects)', 'at most 2 %', share(singles, is_false)),
        ('wrong name (pairs)', '-', share(pairs, is_false)),
        ('false accusation on clean logs', 'at most 2 %', share(clean, accused)),
        ('- white noise', '', share(white, accused)),
        ('- coloured noise', '', share(coloured, accused)),
        ('effect outside the library ends as "unknown"', '90 %', share(
            removed, lambda item: item['verdict'] == 'unknown')),
        ('- gets a name', '-', share(removed, accused)),
        ('- is called clean', '-', share(removed, lambda item: item['verdict'] == 'clean')),
        ('held-out gain, of what the true model would gain', '90 %', gained(singles)),
        ('- pairs', '', gained(pairs)),
        ('name for an effect that is not visible', '-', share(below, accused)),
        ('called clean, white noise', '-', share(
            white, lambda item: item['verdict'] == 'clean')),
        ('called clean, coloured noise (else "unknown")', '-', share(
            coloured, lambda item: item['verdict'] == 'clean'))])


def confusion(outcomes: Sequence[Outcome]) -> str:
    """Return rows hidden, columns named first, as a list of what was named instead."""
    rows = []
    singles = list(filter(is_visible, of_kind(outcomes, 'single', 'rods')))
    for effect in sorted({hidden_names(outcome)[0] for outcome in singles}):
        own = [outcome for outcome in singles if hidden_names(outcome) == [effect]]
        first = Counter((named(outcome) or [f'({outcome["verdict"]})'])[0] for outcome in own)
        others = ', '.join(f'{name} {count}' for name, count in first.most_common()
                           if name != effect)
        twins = Counter(name for outcome in own for name in outcome['hidden'][0]['twins'])
        rows.append((
            f'`{effect}`', len(own), first[effect], others or '-',
            sum(map(is_right, own)), sum(map(is_false, own)), gained(own).partition(',')[0],
            ', '.join(f'{name} {count}' for name, count in twins.most_common(4)) or '-'))
    return table(('hidden', 'visible', 'named first', 'named first instead',
                  'in a set', 'a wrong name', 'gain of the true model\'s', 'true twins'), rows)


def matrix(outcomes: Sequence[Outcome]) -> str:
    """Return the confusion matrix proper: rows hidden, columns named first."""
    singles = list(filter(is_visible, of_kind(outcomes, 'single', 'rods')))
    cells = Counter((hidden_names(outcome)[0], (named(outcome) or [outcome['verdict']])[0])
                    for outcome in singles)
    rows = sorted({row for row, _ in cells})
    columns = [*rows, *sorted({column for _, column in cells} - set(rows))]
    keys = {name: str(number) for number, name in enumerate(columns, start=1)}
    return table(('hidden \\ named first', *(keys[name] for name in columns)), [
        (f'{keys[row]} `{row}`', *(cells[row, column] or '' for column in columns))
        for row in rows]) + '\n\nColumns: ' + ', '.join(
            f'{number} {name}' for name, number in keys.items()) + '.'


def removed_table(outcomes: Sequence[Outcome]) -> str:
    """Return what became of effects that the library lacked."""
    removed = list(filter(is_visible, of_kind(outcomes, 'removed')))
    rows = []
    for effect in sorted({hidden_names(outcome)[0] for outcome in removed}):
        own = [outcome for outcome in removed if hidden_names(outcome) == [effect]]
        names = Counter(name for outcome in own for name in named(outcome))
        rows.append((f'`{effect}`', len(own), sum(item['verdict'] == 'unknown' for item in own),
                     ', '.join(f'{name} {count}' for name, count in names.most_common()) or '-'))
    return table(('taken out', 'visible', 'unknown', 'named instead'), rows)


def breakdown(outcomes: Sequence[Outcome]) -> str:
    """Return how often single effects are right by robot, motion, noise, plant."""
    singles = list(filter(is_visible, of_kind(outcomes, 'single', 'rods')))
    rows = []
    for what, key in (('robot', lambda item: item['robot']),
                      ('motion', lambda item: item['motion']),
                      ('noise', lambda item: 'coloured' if item['coloured'] else 'white'),
                      ('feedforward', lambda item: 'with' if item['feedforward'] else 'without'),
                      ('plant', lambda item: f'pybullet {item["fidelity"]}'
                       if item['fidelity'] != 'exact' else 'exact'),
                      ('data', lambda item: 'bags' if item['through_bag'] else 'in memory')):
        for value in sorted(set(map(key, singles))):
            own = [item for item in singles if key(item) == value]
            rows.append((what, value, share(own, is_right), share(own, is_false)))
    return table(('', '', 'right name or a set that holds it', 'a wrong name'), rows)


def misses(outcomes: Sequence[Outcome]) -> str:
    """Return every scenario that went wrong, to be run again by its seed."""
    rows = []
    for outcome in outcomes:
        visible = [item for item in outcome['hidden'] if item['visible']]
        wrong = is_false(outcome) if outcome['kind'] != 'removed' else bool(outcome['causes'])
        missed = (outcome['kind'] in ('single', 'pair', 'rods') and is_visible(outcome)
                  and not is_right(outcome))
        unsaid = outcome['kind'] == 'removed' and visible and outcome['verdict'] != 'unknown'
        if wrong or missed or unsaid:
            causes = '; '.join(' or '.join((cause['effect'], *cause['twins']))
                               for cause in outcome['causes'])
            held = ', '.join(f'{item["effect"]} ({item["strength"]:.0f})'
                             for item in outcome['hidden'])
            rows.append((outcome['kind'], outcome['seed'], held or '-', outcome['robot'],
                         'coloured' if outcome['coloured'] else 'white', outcome['verdict'],
                         causes or '-'))
    return table(('kind', 'seed', 'hidden (log-likelihood ratio)', 'robot', 'noise', 'verdict',
                  'named'), rows)


def machine_name() -> str:
    """Return what this runs on."""
    return (f'{platform.machine()}, {os.cpu_count()} cores, {platform.system()}, Python '
            f'{platform.python_version()}')


def commit() -> str:
    """Return the commit of this checkout, and whether files differ from it."""
    def git(*words: str) -> str:
        return subprocess.run(('git', '-C', str(ROOT), *words), capture_output=True, text=True,
                              check=False).stdout.strip()

    changed = ' with changes' if git('status', '--porcelain', 'src', 'tests') else ''
    return (git('rev-parse', '--short', 'HEAD') or 'no commit') + changed


def report(outcomes: Sequence[Outcome], header: dict, planned: int) -> str:
    """Return docs/blind_study.md of what is done of the planned scenarios."""
    failed = sum('error' in outcome for outcome in outcomes)
    outcomes = sorted((outcome for outcome in outcomes if 'error' not in outcome),
                      key=lambda outcome: outcome['seed'])
    kinds = Counter(outcome['kind'] for outcome in outcomes)
    made = ', '.join(f'{count} {kind}' for kind, count in kinds.items())
    visible = [sum(map(is_visible, of_kind(outcomes, *group)))
               for group in (('single', 'rods'), ('pair',), ('removed',))]
    bullet = sum(outcome['fidelity'] != 'exact' for outcome in outcomes)
    bags = sum(outcome['through_bag'] for outcome in outcomes)
    each = statistics.median(sum(outcome['seconds'].values()) for outcome in outcomes)
    diagnosing = statistics.median(outcome['seconds']['diagnose'] for outcome in outcomes)
    return f'''# Blind study

Written by `make blind` (`bench/blind_study.py`), good or bad. {header['date']};
{header['machine']}; commit {header['commit']}; seeds from {header['first_seed']}, scale
{header['scale']:g}.

The generator (`tests/hidden`) builds machines from physical parts, shares no formula with the
diagnosis and computes from the truth what is visible (log-likelihood ratio above {VISIBLE:g} on the
fit data, at the true noise, base parameters free) and what a twin is (another effect within
{TWIN:g} of it). {len(outcomes)} of {planned} scenarios, whose kinds are mixed: {made}.
Visible, and counted: {visible[0]} single effects (rods included), {visible[1]} pairs,
{visible[2]} taken out of the library. {bullet} ran in pybullet, {bags} through bags;
{failed} failed. {each:.1f} s a scenario on one core, {diagnosing:.1f} s of it the diagnosis of
26 s of log.

Rules: {header['rules']}.

## What was to be reached

{scores(outcomes)}

Pairs and sets: each hidden effect must be in a set of its own; a wrong name is a cause whose set
holds nothing that is hidden. "No twin" and "visible" are the generator's words. The gain is that of
the weighted held-out squares over what the true model would gain, where that is more than the noise
itself leaves; {' and '.join(CHAOTIC)} is left out of it: the true machine itself does not rattle
alike twice.

## By effect

{confusion(outcomes)}

## Confusion matrix

{matrix(outcomes)}

## Taken out of the library

{removed_table(outcomes)}

## By circumstance

{breakdown(outcomes)}

## Every miss

{misses(outcomes)}
'''


def main() -> None:
    """Run the study and write its report."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--scale', type=float, default=1.0,
                        help='1 = 400 single effects, 100 pairs, 100 taken out, 400 clean logs')
    parser.add_argument('--first-seed', type=int, default=SCORING_SEED,
                        help=f'below {SCORING_SEED} for developing')
    parser.add_argument('--scheduler', help='address of a dask scheduler; default: this machine')
    parser.add_argument('--results', type=Path, default=ROOT / 'blind_study.jsonl')
    parser.add_argument('--resume', action='store_true', help='keep what --results holds')
    parser.add_argument('--output', type=Path, default=ROOT / 'docs' / 'blind_study.md')
    arguments = parser.parse_args()
    header = {'date': datetime.date.today().isoformat(), 'machine': machine_name(),
              'commit': commit(), 'first_seed': arguments.first_seed, 'scale': arguments.scale,
              'rules': ', '.join(f'{key} {value}' for key, value in asdict(Rules()).items())}
    kept = read_outcomes(arguments.results) if arguments.resume else []
    if kept and kept[0].get('rules') != header['rules']:
        parser.error(f'{arguments.results}: made with other rules; start anew without --resume')
    if not kept:
        arguments.results.write_text(json.dumps(header) + '\n', encoding='utf-8')
    tasks = tasks_of_study(arguments.scale, arguments.first_seed)
    wanted = {(task.kind, task.seed) for task in tasks}
    done = {(item['kind'], item['seed']) for item in kept[1:] if 'error' not in item}
    try:
        run([task for task in tasks if (task.kind, task.seed) not in done], arguments.scheduler,
            arguments.results)
    except KeyboardInterrupt:
        print('stopped: the report is of what is done, --resume goes on')
    latest = {(item['kind'], item['seed']): item
              for item in read_outcomes(arguments.results)[1:]}
    outcomes = [latest[key] for key in latest if key in wanted]
    arguments.output.write_text(report(outcomes, header, len(tasks)), encoding='utf-8')
    print(f'{arguments.output}: {len(outcomes)} scenarios')


if __name__ == '__main__':
    main()
