"""docs/blind_study.md from the outcomes of a study."""

from __future__ import annotations

import statistics
from collections import Counter, defaultdict
from collections.abc import Sequence

from blind_scores import (
    SINGLES,
    Outcome,
    carriers,
    found_of,
    gained,
    hidden_names,
    is_accused,
    is_clean,
    is_described,
    is_false,
    is_right,
    is_visible,
    joints_told,
    named,
    of_kind,
    rate,
    scores,
    share,
    table,
    visible_of,
    wrapped,
    wrong_sets,
)
from blind_values import LEFT_OUT, compared
from hidden.outside import OUTSIDE
from hidden.scoring import RATTLING
from hidden.truth import GREY, TWIN, VISIBLE


def confusion(outcomes: Sequence[Outcome]) -> str:
    """Return rows hidden, columns named first, as a list of what was named instead."""
    rows = []
    singles = visible_of(outcomes, *SINGLES)
    for effect in sorted({hidden_names(outcome)[0] for outcome in singles}):
        own = [outcome for outcome in singles if hidden_names(outcome) == [effect]]
        first = Counter((named(outcome) or [f'({outcome["verdict"]})'])[0] for outcome in own)
        others = ', '.join(f'{name} {count}' for name, count in first.most_common()
                           if name != effect)
        twins = Counter(name for outcome in own for name in outcome['hidden'][0]['twins'])
        joints = joints_told(own)
        rows.append((
            f'`{effect}`', len(own), first[effect], others or '-',
            sum(map(is_right, own)), f'{sum(joints)} of {len(joints)}' if joints else '-',
            sum(map(is_false, own)), gained(own).partition(',')[0],
            ', '.join(f'{name} {count}' for name, count in twins.most_common(4)) or '-'))
    return table(('hidden', 'visible', 'named first', 'named first instead', 'in a set',
                  'joints right', 'a wrong name', 'gain of the true model\'s', 'true twins'), rows)


def matrix(outcomes: Sequence[Outcome]) -> str:
    """Return the confusion matrix proper: rows hidden, columns named first."""
    singles = visible_of(outcomes, *SINGLES)
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
    removed = visible_of(outcomes, 'removed')
    rows = []
    for effect in sorted({hidden_names(outcome)[0] for outcome in removed}):
        own = [outcome for outcome in removed if hidden_names(outcome) == [effect]]
        names = Counter(name for outcome in own for name in named(outcome))
        rows.append((f'`{effect}`', len(own), sum(item['verdict'] == 'unknown' for item in own),
                     ', '.join(f'{name} {count}' for name, count in names.most_common()) or '-'))
    return table(('taken out', 'visible', 'unknown', 'named instead'), rows)


def outside_table(outcomes: Sequence[Outcome]) -> str:
    """Return how causes outside the library are met, alone and beside one of it."""
    rows = []
    everyone = visible_of(outcomes, 'company', 'outside')
    for cause in sorted({outcome['strange']['name'] for outcome in everyone}):
        own = [outcome for outcome in everyone if outcome['strange']['name'] == cause]
        beside, alone = of_kind(own, 'company'), of_kind(own, 'outside')
        wrong = Counter(' or '.join(sorted(names)) for item in own for names in wrong_sets(item))
        kinds = Counter(item['kind'] for outcome in own for item in outcome['unnamed'])
        rows.append((
            cause, f'{sum(map(is_right, beside))} of {len(beside)}',
            f'{sum(not is_false(item) for item in alone)} of {len(alone)}',
            ', '.join(f'{name} {count}' for name, count in wrong.most_common(5)) or '-',
            ', '.join(f'{name} {count}' for name, count in kinds.most_common(5)) or '-',
            f'{sum(map(is_described, own))} of {len(own)}'
            if OUTSIDE[cause].acts_like else '-'))
    return table(("outside", "library's cause named", 'no wrong name alone', 'wrong names',
                  'unnamed causes', 'a kind that describes it'), rows)


def coverage_table(outcomes: Sequence[Outcome]) -> str:
    """Return how often 95 % intervals hold the truth, by effect, parameters in words."""
    numbers: dict[str, dict[str, list[bool]]] = defaultdict(lambda: defaultdict(list))
    for outcome in outcomes:
        for number in compared(outcome):
            numbers[number.effect][number.parameter].append(number.covered)
    return table(('effect', 'intervals that hold the truth', 'by parameter'), [
        (f'`{effect}`', rate([flag for flags in own.values() for flag in flags]),
         ', '.join(f'{parameter} {sum(flags)} of {len(flags)}'
                   for parameter, flags in sorted(own.items())))
        for effect, own in sorted(numbers.items())])


def real_table(outcomes: Sequence[Outcome]) -> str:
    """Return how often each effect of real machines is named, where it carries enough."""
    asked, found = Counter(), Counter()
    for outcome in of_kind(outcomes, 'realistic'):
        asked.update(carriers(outcome))
        found.update(set(found_of(outcome, hidden_names(outcome))) & set(carriers(outcome)))
    return table(('effect of a real machine', 'carries 5 % of the error', 'named'), [
        (f'`{effect}`', count, found[effect]) for effect, count in asked.most_common()])


def breakdown(outcomes: Sequence[Outcome]) -> str:
    """Return how often single effects are right by robot, motion, noise, plant, log."""
    rows = []
    usual, coarse = visible_of(outcomes, *SINGLES), visible_of(outcomes, 'coarse')
    for own_kind, what, key in (
            (usual, 'robot', lambda item: item['robot']),
            (usual, 'motion', lambda item: item['motion']),
            (usual, 'noise', lambda item: 'coloured' if item['coloured'] else 'white'),
            (usual, 'feedforward', lambda item: 'with' if item['feedforward'] else 'without'),
            (usual, 'plant', lambda item: f'pybullet {item["fidelity"]}'
             if item['fidelity'] != 'exact' else 'exact'),
            (usual, 'data', lambda item: 'bags' if item['through_bag'] else 'in memory'),
            (coarse, 'coarse: counts', lambda item: item['encoder_counts']),
            (coarse, 'coarse: rate, Hz', lambda item: item['rate']),
            (coarse, 'coarse: motion', lambda item: item['motion'])):
        for value in sorted(set(map(key, own_kind))):
            own = [item for item in own_kind if key(item) == value]
            rows.append((what, value, share(own, is_right), share(own, is_false)))
    return table(('', '', 'right name or a set that holds it', 'a wrong name'), rows)


def is_missed(outcome: Outcome) -> bool:
    """Return whether something of a scenario went wrong."""
    kind = outcome['kind']
    if kind in ('removed', 'clean', 'wander'):
        return is_accused(outcome) or (kind == 'removed' and is_visible(outcome)
                                       and outcome['verdict'] != 'unknown')
    if kind in ('lines', 'bursts'):
        return is_accused(outcome) or is_clean(outcome)
    if kind == 'realistic':
        found = found_of(outcome, hidden_names(outcome))
        return is_false(outcome) or not set(carriers(outcome)) <= set(found)
    return is_false(outcome) or (kind != 'below' and is_visible(outcome)
                                 and not is_right(outcome)) or not all(joints_told([outcome]))


def misses(outcomes: Sequence[Outcome]) -> str:
    """Return every scenario that went wrong, to be run again by its seed."""
    rows = []
    for outcome in filter(is_missed, outcomes):
        causes = '; '.join(' or '.join((cause['effect'], *cause['twins']))
                           + f' on {"".join(map(str, cause["joints"]))}'
                           for cause in outcome['causes'])
        held = [f'{item["effect"]} ({item["strength"]:.0f})' for item in outcome['hidden']]
        if outcome['strange']:
            held.append(f'{outcome["strange"]["name"]} ({outcome["strange"]["strength"]:.0f})')
        rows.append((outcome['kind'], outcome['seed'], ', '.join(held) or '-', outcome['robot'],
                     'coloured' if outcome['coloured'] else 'white', outcome['verdict'],
                     causes or '-'))
    return table(('kind', 'seed', 'hidden (log-likelihood ratio)', 'robot', 'noise', 'verdict',
                  'named'), rows)


def report(outcomes: Sequence[Outcome], header: dict, planned: int) -> str:
    """Return docs/blind_study.md of what is done of the planned scenarios."""
    failed = sum('error' in outcome for outcome in outcomes)
    outcomes = sorted((outcome for outcome in outcomes if 'error' not in outcome),
                      key=lambda outcome: outcome['seed'])
    kinds = Counter(outcome['kind'] for outcome in outcomes)
    made = ', '.join(f'{count} {kind}' for kind, count in kinds.items())
    seen = ', '.join(f'{len(visible_of(outcomes, kind))} {kind}' for kind in kinds
                     if any(item['hidden'] or item['strange'] for item in of_kind(outcomes, kind)))
    bullet = sum(outcome['fidelity'] != 'exact' for outcome in outcomes)
    bags = sum(outcome['through_bag'] for outcome in outcomes)
    parts = ', '.join(f'{statistics.median(item["seconds"][part] for item in outcomes):.1f} s '
                      f'to {part}' for part in ('record', 'truth', 'diagnose'))
    left_out = '; '.join(f'`{effect}`: {why}' for effect, why in LEFT_OUT.items())
    return wrapped(f'''# Blind study

Written by `make blind` (`bench/blind_study.py`), good or bad. {header['date']};
{header['machine']}; commit {header['commit']}; seeds from {header['first_seed']}.

The generator (`tests/hidden`) builds machines from physical parts, shares no formula with the
diagnosis and computes from the truth what is visible (log-likelihood ratio above {VISIBLE:g} on the
fit data, at the true noise, base parameters free), what a twin is (another effect within
{TWIN:g} of it) and which sets of joints are right: those that have it, of the sets
within {TWIN:g} of the best one the smallest, and larger ones that no smaller one equals to within
{GREY:g}. {len(outcomes)} of {planned} scenarios, whose kinds are mixed: {made}. Visible, and
counted: {seen}.
{bullet} ran in pybullet, {bags} through bags; {failed} failed. A scenario of 26 s of log takes, on
one core: {parts}. Recordings are made once and scored again and again:
`python bench/blind_study.py record`, then `score`.

Decisions: sources {header['decisions']}; {header['rules']}.

## What was to be reached

{scores(outcomes)}

Several effects and sets: each hidden effect must be in a set of its own; a wrong name is a cause
whose set holds nothing that is hidden. "No twin" and "visible" are the generator's words. The gain
is that of the weighted held-out squares over what the true model would gain, where that is more
than the noise itself leaves; {' and '.join(RATTLING)} is left out of it: the true machine itself
does not rattle alike twice. What an effect of a real machine carries is what the true model without
it leaves on the held-out log, base parameters fitted again.

## By effect

{confusion(outcomes)}

## Confusion matrix

{matrix(outcomes)}

## Taken out of the library

{removed_table(outcomes)}

## Outside the library

{outside_table(outcomes)}

## Machines as they are

{real_table(outcomes)}

## Intervals of diagnosed parameters

Values of causes whose name is the hidden one, of all kinds. Left out: {left_out}; differences
told for all four joints; parameters that are fixed; `bar_mass` where rods are real.

{coverage_table(outcomes)}

## By circumstance

{breakdown(outcomes)}

## Every miss

{misses(outcomes)}
''')
