"""What each number of the diagnosis is worth: docs/ablation.md.

    python bench/ablation.py --recordings DIR DIR --limit 60

Each number of `Rules` is switched off, halved and doubled, one at a time, and recordings that
`blind_study.py record` keeps are scored again under each change; `--changes off` and `--changes
factor` take less time. Recordings must be of development:
what is scored here is no longer unseen. Outcomes are appended to a file as they come; the same call
goes on with what it holds, as long as the sources that decide are the same.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import sys
import traceback
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

from blind_scores import Outcome, found_of, hidden_names, of_others, table, wrapped, wrong_sets
from blind_study import commit, kinds_of, machine_name, outcomes_of, read_outcomes, sampled_paths
from hidden.kept import read_kept
from hidden.scenario import KINDS
from hidden.scoring import decisions, outcome_of
from rich.console import Console
from rich.progress import track

from par4_identification.diagnosis.search.rules import Rules

ROOT = Path(__file__).parents[1]
FACTOR = 2.0
OFF = {'evidence': 1.0, 'floor_excess': 1e9}
"""Values at which numbers decide nothing, where that is not zero: a log-likelihood of 1 is chance.
"""
UNCHANGED = 'as it is'
Changes = dict[str, tuple[str, float]]
"""Name of a change -> the number that is moved, and to what."""
Item = tuple[Path, str, tuple[str, float] | None]


def changes_of_rules(asked: str = 'all') -> Changes:
    """Return each number switched off ('off'), halved and doubled ('factor'), or 'all' of these.

    A number that is off anyway is left out.
    """
    found = {}
    for name, value in asdict(Rules()).items():
        if value == OFF.get(name, 0.0):
            continue
        if asked != 'factor':
            found[f'{name} off'] = name, OFF.get(name, 0.0)
        if asked != 'off':
            found[f'{name} / {FACTOR:g}'] = name, value / FACTOR
            found[f'{name} x {FACTOR:g}'] = name, value * FACTOR
    return found


def scored_under(item: Item) -> Outcome:
    """Return the outcome of a recording under a change, or the error that ended it.

    A number may keep a diagnosis from what it cannot do: that, too, is what it is worth.
    """
    path, name, change = item
    rules = Rules() if change is None else replace(Rules(), **dict([change]))
    try:
        outcome = outcome_of(read_kept(path), rules)
    except Exception:
        outcome = {'error': traceback.format_exc()}
    return {**outcome, 'path': str(path), 'change': name}


def difference(before: Sequence[Outcome], after: Sequence[Outcome]) -> Counter[str]:
    """Return how many right and wrong names came and went, and verdicts that changed."""
    counts: Counter[str] = Counter()
    for old, new in zip(of_others(before), of_others(after), strict=True):
        right = [Counter(found_of(item, hidden_names(item))) for item in (old, new)]
        wrong = [Counter('|'.join(sorted(names)) for names in wrong_sets(item))
                 for item in (old, new)]
        for what, (was, now) in (('right', right), ('wrong', wrong)):
            counts[f'{what} gained'] += (now - was).total()
            counts[f'{what} lost'] += (was - now).total()
        counts['verdicts'] += old['verdict'] != new['verdict']
        counts['clean lost'] += old['verdict'] == 'clean' != new['verdict']
    return counts


def report(outcomes: Sequence[Outcome], changes: Changes) -> str:
    """Return docs/ablation.md of the recordings that were scored under every change."""
    by_change: dict[str, dict[str, Outcome]] = {name: {} for name in (UNCHANGED, *changes)}
    for outcome in outcomes:
        by_change[outcome['change']][outcome['path']] = outcome
    paths = sorted(set.intersection(*(set(found) for found in by_change.values())))
    whole = [by_change[UNCHANGED][path] for path in paths]
    values, rows = asdict(Rules()), []
    for name, (rule, value) in changes.items():
        run = [path for path in paths if 'error' not in by_change[name][path]]
        counts = difference([by_change[UNCHANGED][path] for path in run],
                            [by_change[name][path] for path in run])
        rows.append((f'`{name}`', f'{values[rule]:g} to {value:g}', *(counts[key] for key in (
            'right gained', 'right lost', 'wrong gained', 'wrong lost', 'verdicts', 'clean lost')),
            len(paths) - len(run)))
    kinds = Counter(outcome['kind'] for outcome in whole)
    right = sum(len(found_of(item, hidden_names(item))) for item in of_others(whole))
    wrong = sum(len(wrong_sets(item)) for item in of_others(whole))
    idle = [row[0] for row in rows if not any(row[2:])]
    return wrapped(f'''# What each number of the diagnosis is worth

Written by `python bench/ablation.py`. {datetime.date.today().isoformat()}; {machine_name()}; commit
{commit()}; sources of the diagnosis {decisions()}.

{len(paths)} recordings of development seeds:
{', '.join(f'{count} {kind}' for kind, count in sorted(kinds.items()))}. With the numbers of
`diagnosis/search/rules.py` {right} right names and {wrong} wrong ones are given. Each line moves
one number and leaves the others. A right name is a hidden effect in a set of its own, a wrong one a
cause whose set holds nothing hidden (with what is taken out of the library, each). Switched off
means {', '.join(f'{name} = {value:g}' for name, value in OFF.items())}, the others 0.

{table(('change', 'value', 'right names gained', 'lost', 'wrong names gained', 'lost',
        'verdicts changed', 'clean no longer', 'failed'), rows)}

No answer changed under: {', '.join(idle) or 'none of them'}.
''')


def parser_of_arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--recordings', type=Path, nargs='+', required=True, help='their folders')
    parser.add_argument('--changes', choices=('all', 'off', 'factor'), default='all')
    parser.add_argument('--kinds', type=kinds_of, default=list(KINDS), metavar='A,B')
    parser.add_argument('--limit', type=int, help='recordings of a folder, kinds in turn')
    parser.add_argument('--processes', type=int, default=os.cpu_count(), help='on this machine')
    parser.add_argument('--scheduler', help='address of a dask scheduler; default: this machine')
    parser.add_argument('--results', type=Path, default=ROOT / 'ablation.jsonl',
                        help='where outcomes are kept')
    parser.add_argument('--output', type=Path, default=ROOT / 'docs' / 'ablation.md')
    return parser


def main() -> None:
    """Score under each change and write the table."""
    arguments = parser_of_arguments().parse_args()
    changes, key = changes_of_rules(arguments.changes), {'decisions': decisions()}
    told = read_outcomes(arguments.results)
    if not told or told[0] != key:
        arguments.results.write_text(json.dumps(key) + '\n', encoding='utf-8')
        told = [key]
    outcomes = [outcome for outcome in told[1:] if outcome['change'] in (UNCHANGED, *changes)]
    done = {(outcome['path'], outcome['change']) for outcome in outcomes}
    paths = chain.from_iterable(
        [path for path, _ in sampled_paths(folder, arguments.kinds, arguments.limit)]
        for folder in arguments.recordings)
    items: list[Item] = [(path, name, change) for path in paths
                         for name, change in ((UNCHANGED, None), *changes.items())
                         if (str(path), name) not in done]
    try:
        for outcome in track(outcomes_of(scored_under, items, arguments), 'ablating',
                             total=len(items), console=Console(stderr=True)):
            outcomes.append(outcome)
            with arguments.results.open('a', encoding='utf-8') as file:
                file.write(json.dumps(outcome) + '\n')
    except KeyboardInterrupt:
        print('stopped: the table is of what is done, the same call goes on')
    arguments.output.write_text(report(outcomes, changes), encoding='utf-8')
    print(f'{arguments.output}: {len(outcomes)} outcomes')


if __name__ == '__main__':
    main()
