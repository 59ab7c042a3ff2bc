"""What each rule of the diagnosis is worth: docs/ablation.md.

    python bench/ablation.py --recordings DIR --limit 40
    python bench/ablation.py --recordings DIR --factor 2

Each rule is switched off by a value at which it decides nothing, or moved by a factor either way,
one at a time, and recordings that `blind_study.py record` keeps are scored again. The run with
unchanged rules tells which changes would have decided anything otherwise (`traced`); the others
need not be run, as they would give the same answer.
"""

from __future__ import annotations

import argparse
import datetime
import json
import sys
import traceback
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

from blind_scores import Outcome, found_of, hidden_names, of_others, table, wrong_sets
from blind_study import commit, kinds_of, machine_name, read_outcomes, sampled_paths
from hidden.kept import read_kept
from hidden.scenario import KINDS
from hidden.scoring import decisions, outcome_of
from rich.console import Console
from rich.progress import track
from traced import Traced

from par4_identification.diagnosis.search.rules import Rules

ROOT = Path(__file__).parents[1]
Changes = dict[str, dict[str, Any]]
"""Name of a change -> rule -> its other value."""
NEVER, ALWAYS = 1e9, -1e9
OFF = {
    'p_value': 1.0, 'least_gain': 0.0, 'holdout_gain': ALWAYS, 'least_share': 0.0,
    'agreement': -1.0, 'transfer': NEVER, 'joint_p_value': 1.1, 'joint_share': 0.0,
    'twin_margin': 0.0, 'equal_margin': 1e-9, 'most': 12, 'least_evidence': 0.0,
    'least_alone': 0.0, 'fixed_range': (ALWAYS, NEVER), 'sufficient_share': 0.0,
    'left_score': 0.0, 'left_share': 0.0, 'distortion': NEVER, 'own_share': ALWAYS,
    'more_share': ALWAYS, 'most_share': NEVER, 'instead_share': NEVER, 'remaining_gain': NEVER,
    'ringing': NEVER, 'most_of_rest': NEVER, 'floor_excess': NEVER}
"""Values at which the rules of a diagnosis decide nothing; of rules that it does not have any more
nothing is tried."""


def changes_off() -> Changes:
    """Return each rule switched off."""
    return {f'{field.name} off': {field.name: OFF[field.name]} for field in fields(Rules)
            if field.name in OFF}


def changes_by(factor: float) -> Changes:
    """Return each rule that is a number moved by a factor either way."""
    values = {name: value for name, value in asdict(Rules()).items()
              if isinstance(value, (int, float)) and value}
    return {f'{name} x {scale:g}': {name: type(value)(scale * value) or 1}
            for name, value in values.items() for scale in (factor, 1.0 / factor)}


def changes_of_file(path: Path) -> Changes:
    """Return the changes of a JSON file: name -> rule -> value."""
    told = json.loads(path.read_text(encoding='utf-8'))
    return {name: {rule: tuple(value) if isinstance(value, list) else value
                   for rule, value in change.items()} for name, change in told.items()}


def traced_rules(changes: Changes, turned: set[str]) -> Rules:
    """Return the unchanged rules, which add to `turned` the changes that would decide otherwise."""
    traced = {}
    for name, value in asdict(Rules()).items():
        others = {change: moved[name] for change, moved in changes.items() if name in moved}
        if not others:
            continue
        if isinstance(value, tuple):
            traced[name] = tuple(
                Traced(part, {change: other[row] for change, other in others.items()}, turned)
                for row, part in enumerate(value))
        else:
            traced[name] = Traced(value, others, turned)
    return replace(Rules(), **traced)


def attempt(path: Path, changes: Changes) -> dict[str, Outcome | None]:
    """Return the outcomes of a scenario by change, '' for none; None where nothing would turn."""
    kept, turned = read_kept(path), set()
    outcomes: dict[str, Outcome | None] = {'': outcome_of(kept, traced_rules(changes, turned))}
    for name, change in changes.items():
        outcomes[name] = None
        if name in turned:
            try:
                outcomes[name] = outcome_of(kept, replace(Rules(), **change))
            except Exception:  # a rule may keep the others from what they cannot do
                outcomes[name] = {'error': traceback.format_exc()}
    return outcomes


def difference(before: Sequence[Outcome], after: Sequence[Outcome]) -> dict[str, int]:
    """Return how many right and wrong names came and went, and verdicts that changed."""
    counts: Counter[str] = Counter()
    for old, new in zip(of_others(before), of_others(after)):
        right = [Counter(found_of(item, hidden_names(item))) for item in (old, new)]
        wrong = [Counter('|'.join(sorted(names)) for names in wrong_sets(item))
                 for item in (old, new)]
        for what, (was, now) in (('right', right), ('wrong', wrong)):
            counts[f'{what} gained'] += (now - was).total()
            counts[f'{what} lost'] += (was - now).total()
        counts['verdicts'] += old['verdict'] != new['verdict']
        counts['clean lost'] += old['verdict'] == 'clean' != new['verdict']
    return counts


def report(results: Sequence[dict[str, Outcome | None]], changes: Changes) -> str:
    """Return docs/ablation.md."""
    rows = []
    values = asdict(Rules())
    for name, change in changes.items():
        turned = [item for item in results if item[name] is not None]
        run = [item for item in turned if 'error' not in item[name]]
        counts = difference([item[''] for item in run], [item[name] for item in run])
        moved = ', '.join(f'{values[rule]} to {value}' for rule, value in change.items())
        rows.append((f'`{name}`', moved, len(turned), *(counts[key] for key in (
            'right gained', 'right lost', 'wrong gained', 'wrong lost', 'verdicts', 'clean lost')),
            len(turned) - len(run)))
    rows.sort(key=lambda row: (not any(row[3:]), not row[2]))
    kinds = Counter(item['']['kind'] for item in results)
    whole = [item[''] for item in results]
    right = sum(len(found_of(item, hidden_names(item))) for item in of_others(whole))
    wrong = sum(len(wrong_sets(item)) for item in of_others(whole))
    return f'''# What each rule of the diagnosis is worth

Written by `python bench/ablation.py`. {datetime.date.today().isoformat()}; {machine_name()}; commit
{commit()}; sources of the diagnosis {decisions()}.

{len(results)} recordings of development seeds:
{', '.join(f'{count} {kind}' for kind, count in kinds.items())}. With
unchanged rules {right} right names and {wrong} wrong ones are given. Each line moves one rule and
leaves the others. "Turns" counts the recordings in which the moved rule would decide some
comparison otherwise; these alone were scored again, the answer of the others is the same by
construction. A right name is a hidden effect in a set of its own, a wrong one a cause whose set
holds nothing hidden (with what is taken out of the library, each). A rule with noughts in all
columns changed no answer here.

{table(('change', 'value', 'turns', 'right names gained', 'lost', 'wrong names gained', 'lost',
        'verdicts changed', 'clean no longer', 'failed'), rows)}
'''


def main() -> None:
    """Score under each change and write the table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--recordings', type=Path, required=True, help='their folder')
    parser.add_argument('--kinds', type=kinds_of, default=list(KINDS), metavar='A,B')
    parser.add_argument('--limit', type=int, help='recordings, kinds in turn')
    parser.add_argument('--factor', type=float, help='move each rule by it, either way')
    parser.add_argument('--changes', type=Path,
                        help='JSON file: name of a change -> rule -> other value')
    parser.add_argument('--results', type=Path, default=ROOT / 'ablation.jsonl',
                        help='where outcomes are kept; goes on with what it holds of these sources')
    parser.add_argument('--output', type=Path, default=ROOT / 'docs' / 'ablation.md')
    arguments = parser.parse_args()
    changes = (changes_of_file(arguments.changes) if arguments.changes
               else changes_by(arguments.factor) if arguments.factor else changes_off())
    key = {'decisions': decisions(), 'changes': json.loads(json.dumps(changes))}
    told = read_outcomes(arguments.results)
    if not told or told[0] != key:
        arguments.results.write_text(json.dumps(key) + '\n', encoding='utf-8')
        told = [key]
    done = {(item['']['kind'], item['']['seed']): item for item in told[1:]}
    results = []
    try:
        for path, (kind, seed) in track(sampled_paths(arguments.recordings, arguments.kinds,
                                                      arguments.limit),
                                        'ablating', console=Console(stderr=True)):
            if (kind, seed) not in done:
                done[kind, seed] = attempt(path, changes)
                with arguments.results.open('a', encoding='utf-8') as file:
                    file.write(json.dumps(done[kind, seed]) + '\n')
            results.append(done[kind, seed])
    except KeyboardInterrupt:
        print('stopped: the table is of what is done, the same call goes on')
    arguments.output.write_text(report(results, changes), encoding='utf-8')
    print(f'{arguments.output}: {len(results)} recordings, '
          f'{sum(item[name] is not None for item in results for name in changes)} runs under '
          f'changed rules')


if __name__ == '__main__':
    main()
