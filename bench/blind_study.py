"""How often the diagnosis is right where the truth is hidden from it: docs/blind_study.md.

Scenarios come from tests/hidden, which shares no formula with the diagnosis: effect, size, joints,
robot, friction, motion, noise, all from seeds. What is visible and what is a twin the generator
computes from the truth. Scenarios are independent tasks on dask: on all cores by default, on the
machines of a cluster with `--scheduler tcp://ADDRESS:8786`, whose workers need this checkout
installed, `PYTHONPATH=tests` and the folder of recordings.

    python bench/blind_study.py                      the whole study, scoring seeds
    python bench/blind_study.py --scale 0.1 --first-seed 1000 --output /tmp/study.md    developing
    python bench/blind_study.py record --recordings DIR --number 30 --first-seed 1000
    python bench/blind_study.py score --recordings DIR --kinds single,pair --limit 100

`record` keeps logs and truth, a file a scenario; `score` diagnoses what is kept, which takes no
simulation, so that a changed diagnosis is scored again. Without either word both are done, and
nothing is kept unless `--recordings` says where.

Outcomes are appended to a JSON-lines file as they come; Ctrl-C ends a study early with a report of
what is done, and `--resume` goes on with it if the sources that decide are still the same.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

from blind_report import report
from blind_scores import Outcome, one_line
from dask.distributed import Client, LocalCluster, as_completed
from hidden.kept import file_name, generator_hash, read_header, read_kept
from hidden.scenario import KINDS, Task
from hidden.scoring import decisions, outcome_of
from hidden.study import made, tasks_of_study
from rich.console import Console
from rich.progress import track

from par4_identification.diagnosis.search.rules import Rules

ROOT = Path(__file__).parents[1]
SCORING_SEED = 8_000_000
"""Seeds below are for developing; thresholds are fixed before any seed from here on is run."""


def attempted(work: Callable[[object], Outcome], item: object) -> Outcome:
    """Return the outcome of an item, or the error that ended it: one must not end the study."""
    try:
        return work(item)
    except Exception:
        known = asdict(item) if isinstance(item, Task) else dict(
            zip(('kind', 'seed'), kind_and_seed(item)))
        return {**known, 'error': traceback.format_exc()}


def recorded(folder: Path, task: Task) -> Outcome:
    """Keep the recordings of a task unless they are there, made by the same sources."""
    path = folder / f'{file_name(task.kind, task.seed)}.npz'
    if not path.exists() or read_header(path)['generator'] != generator_hash():
        made(task).write(folder)
    return asdict(task)


def scored(path: Path) -> Outcome:
    """Return the outcome of a kept scenario."""
    return outcome_of(read_kept(path))


def recorded_and_scored(folder: Path | None, task: Task) -> Outcome:
    """Return the outcome of a task."""
    if folder is None:
        return outcome_of(made(task))
    recorded(folder, task)
    return scored(folder / f'{file_name(task.kind, task.seed)}.npz')


def kind_and_seed(path: Path) -> tuple[str, int]:
    """Return what a file of recordings is called after."""
    kind, _, seed = path.stem.rpartition('-')
    return kind, int(seed)


def sampled_paths(folder: Path, kinds: Sequence[str], limit: int | None
                  ) -> list[tuple[Path, tuple[str, int]]]:
    """Return the recordings of a folder with kind and seed, kinds in turn, `limit` at most.

    So the first ones are a sample of all.
    """
    found = []
    for row, kind in enumerate(kinds):
        own = sorted((kind_and_seed(path)[1], path) for path in folder.glob(f'{kind}-*.npz'))
        found += [(index, row, path, (kind, seed)) for index, (seed, path) in enumerate(own)]
    return [(path, key) for _, _, path, key in sorted(found)[:limit]]


def outcomes_of(work: Callable[[object], Outcome], items: Sequence[object],
                arguments: argparse.Namespace) -> Iterator[Outcome]:
    """Yield the outcome of each item as it comes, from this process or from dask's workers."""
    attempt = partial(attempted, work)
    if arguments.processes == 1 and not arguments.scheduler:
        yield from map(attempt, items)
        return
    # inherited by the workers, which dask keeps at one thread each
    os.environ['PYTHONPATH'] = os.pathsep.join(filter(None, (
        str(ROOT / 'tests'), str(ROOT / 'bench'), os.environ.get('PYTHONPATH'))))
    cluster = None if arguments.scheduler else LocalCluster(
        n_workers=arguments.processes, threads_per_worker=1, dashboard_address=None)
    try:
        with Client(arguments.scheduler or cluster) as client:
            futures = client.map(attempt, items, pure=False)
            for future, outcome in as_completed(futures, with_results=True):
                future.release()  # a worker that is lost would have its work done again
                yield outcome
    finally:
        if cluster:
            cluster.close()


def run(work: Callable[[object], Outcome], items: Sequence[object], results: Path | None,
        arguments: argparse.Namespace) -> list[Outcome]:
    """Return the outcomes of the items that were done before Ctrl-C, and append them to a file."""
    outcomes = []
    try:
        for outcome in track(outcomes_of(work, items, arguments), arguments.command or 'study',
                             total=len(items), console=Console(stderr=True)):
            outcomes.append(outcome)
            if results:
                with results.open('a', encoding='utf-8') as file:
                    file.write(json.dumps(outcome) + '\n')
    except KeyboardInterrupt:
        print('stopped: the report is of what is done, --resume goes on')
    for outcome in outcomes:
        if 'error' in outcome:
            print(f'{outcome["kind"]} {outcome["seed"]} failed:\n{outcome["error"]}',
                  file=sys.stderr)
    return outcomes


def read_outcomes(path: Path) -> list[Outcome]:
    """Return the header and the outcomes of a file; a line that was cut off is left out."""
    outcomes = []
    for line in path.read_text(encoding='utf-8').splitlines() if path.exists() else ():
        try:
            outcomes.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return outcomes


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


def study(work: Callable[[object], Outcome], items: Sequence[object],
          keys: Sequence[tuple[str, int]], first_seed: int, arguments: argparse.Namespace,
          parser: argparse.ArgumentParser) -> None:
    """Score the items that are not done yet and write the report of all.

    Args:
        work: item -> outcome.
        keys: kind and seed of each item.
    """
    header = {'date': datetime.date.today().isoformat(), 'machine': machine_name(),
              'commit': commit(), 'first_seed': first_seed, 'decisions': decisions(),
              'rules': ', '.join(f'{key} {value}' for key, value in asdict(Rules()).items())}
    kept = read_outcomes(arguments.results) if arguments.resume else []
    if kept and any(kept[0].get(key) != header[key] for key in ('rules', 'decisions')):
        parser.error(f'{arguments.results}: scored by other rules or sources of the diagnosis; '
                     f'start anew without --resume')
    if not kept:
        arguments.results.parent.mkdir(parents=True, exist_ok=True)
        arguments.results.write_text(json.dumps(header) + '\n', encoding='utf-8')
    latest = {(item['kind'], item['seed']): item for item in kept[1:]}
    left = [item for item, key in zip(items, keys)
            if key not in latest or 'error' in latest[key]]
    for outcome in run(work, left, arguments.results, arguments):
        latest[outcome['kind'], outcome['seed']] = outcome
    outcomes = [latest[key] for key in keys if key in latest]
    stale = sum(item.get('generator', generator_hash()) != generator_hash() for item in outcomes)
    if stale:
        print(f'{stale} of {len(outcomes)} recordings were made by other sources of the '
              f'generator or the simulation; `record` makes them anew')
    if arguments.output and any('error' not in outcome for outcome in outcomes):
        arguments.output.write_text(report(outcomes, header, len(items)), encoding='utf-8')
        print(arguments.output)
    print(one_line(outcomes))


def kinds_of(text: str) -> list[str]:
    """Return kinds from their names with commas between."""
    unknown = sorted(set(text.split(',')) - set(KINDS))
    if unknown:
        raise argparse.ArgumentTypeError(
            f'{", ".join(unknown)} asked; known are {", ".join(KINDS)}')
    return text.split(',')


def parser_of_arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    shared = argparse.ArgumentParser(add_help=False)
    shared.add_argument('--kinds', type=kinds_of, default=list(KINDS), metavar='A,B',
                        help=f'of {", ".join(KINDS)}')
    shared.add_argument('--limit', type=int, help='scenarios at most, of all kinds together')
    shared.add_argument('--processes', type=int, default=os.cpu_count(), help='on this machine')
    shared.add_argument('--scheduler', help='address of a dask scheduler; default: this machine')
    making = argparse.ArgumentParser(add_help=False)
    making.add_argument('--scale', type=float, default=1.0,
                        help='1 = the whole study, see COUNTS in tests/hidden/study.py')
    making.add_argument('--number', type=int, help='of scenarios of each kind, in place of --scale')
    making.add_argument('--first-seed', type=int, default=SCORING_SEED,
                        help=f'below {SCORING_SEED} for developing')
    scoring = argparse.ArgumentParser(add_help=False)
    scoring.add_argument('--results', type=Path, default=ROOT / 'blind_study.jsonl')
    scoring.add_argument('--resume', action='store_true', help='keep what --results holds')
    parser = argparse.ArgumentParser(description=__doc__, parents=[shared, making, scoring],
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--recordings', type=Path, help='folder to keep recordings in')
    parser.add_argument('--output', type=Path, default=ROOT / 'docs' / 'blind_study.md')
    parser.set_defaults(command=None)
    words = parser.add_subparsers(title='parts')
    record = words.add_parser('record', parents=[shared, making], help='keep recordings')
    record.set_defaults(command='record')
    score = words.add_parser('score', parents=[shared, scoring], help='diagnose kept recordings')
    score.add_argument('--output', type=Path, help='report to write, none by default')
    score.set_defaults(command='score')
    for word in (record, score):
        word.add_argument('--recordings', type=Path, required=True, help='their folder')
    return parser


def main() -> None:
    """Record, score, or both."""
    parser = parser_of_arguments()
    arguments = parser.parse_args()
    if arguments.command == 'score':
        found = sampled_paths(arguments.recordings, arguments.kinds, arguments.limit)
        if not found:
            parser.error(f'{arguments.recordings}: no recordings of {", ".join(arguments.kinds)}; '
                         f'make some with record')
        paths, keys = zip(*found)
        study(scored, paths, keys, min(seed for _, seed in keys), arguments, parser)
        return
    tasks = tasks_of_study(arguments.scale, arguments.first_seed, arguments.kinds,
                           arguments.number)[:arguments.limit]
    if arguments.recordings:
        arguments.recordings.mkdir(parents=True, exist_ok=True)
    if arguments.command == 'record':
        outcomes = run(partial(recorded, arguments.recordings), tasks, None, arguments)
        failed = sum('error' in outcome for outcome in outcomes)
        print(f'{arguments.recordings}: {len(outcomes) - failed} scenarios, {failed} failed')
        return
    study(partial(recorded_and_scored, arguments.recordings), tasks,
          [(task.kind, task.seed) for task in tasks], arguments.first_seed, arguments, parser)


if __name__ == '__main__':
    main()
