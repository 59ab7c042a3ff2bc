"""What counts as right and wrong in the blind study, and the table of what is to be reached.

Every predicate takes one outcome, as `hidden.scoring.outcome_of` returns it.
"""

from __future__ import annotations

import statistics
import textwrap
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from blind_values import compared
from hidden.hider import JOINTS
from hidden.hiders import HIDERS
from hidden.outside import OUTSIDE
from scipy.stats import binomtest

Outcome = dict[str, Any]
SINGLES = ('single', 'rods')
CARRIED = 0.05
"""Share of the explainable held-out error from which an effect of a real machine must be named."""
LARGE_ERROR = 0.05
"""Of the values of large causes."""


def named(outcome: Outcome) -> list[str]:
    """Return the first names of the causes."""
    return [cause['effect'] for cause in outcome['causes']]


def said(outcome: Outcome) -> list[set[str]]:
    """Return the sets of names that the causes stand for."""
    return [{cause['effect'], *cause['twins']} for cause in outcome['causes']]


def hidden_names(outcome: Outcome) -> list[str]:
    """Return what is hidden."""
    return [item['effect'] for item in outcome['hidden']]


def visible_names(outcome: Outcome) -> list[str]:
    """Return what is hidden and visible."""
    return [item['effect'] for item in outcome['hidden'] if item['visible']]


def found_of(outcome: Outcome, names: Iterable[str]) -> list[str]:
    """Return which of these names are each in a set of its own."""
    left, found = said(outcome), []
    for name in names:
        match = next((names for names in left if name in names), None)
        if match is not None:
            left.remove(match)
            found.append(name)
    return found


def is_right(outcome: Outcome) -> bool:
    """Return whether each hidden effect is in a set of its own."""
    return found_of(outcome, hidden_names(outcome)) == hidden_names(outcome)


def wrong_sets(outcome: Outcome) -> list[set[str]]:
    """Return the causes that stand for nothing that is hidden.

    An effect of the library that explains a cause outside of it as well as that itself is not
    wrong.
    """
    allowed = {*hidden_names(outcome), *(outcome['strange'] or {}).get('twins', ())}
    return [names for names in said(outcome) if not names & allowed]


def is_false(outcome: Outcome) -> bool:
    """Return whether a cause stands for nothing that is hidden."""
    return bool(wrong_sets(outcome))


def is_visible(outcome: Outcome) -> bool:
    """Return whether all that is hidden is visible."""
    strange = outcome['strange']
    return all(item['visible'] for item in outcome['hidden']) and (
        strange is None or strange['visible'])


def is_clean(outcome: Outcome) -> bool:
    """Return whether the machine is called clean."""
    return outcome['verdict'] == 'clean'


def is_accused(outcome: Outcome) -> bool:
    """Return whether anything is named."""
    return bool(outcome['causes'])


def is_exact(outcome: Outcome) -> bool:
    """Return whether the names are those hidden and no others."""
    return said(outcome) == [{name} for name in hidden_names(outcome)]


def is_described(outcome: Outcome) -> bool:
    """Return whether an unnamed cause is of a kind that describes the one outside the library.

    Which kinds do is asked of the generator as it is now: a kept recording may be older.
    """
    kinds = {item['kind'] for item in outcome['unnamed']}
    return bool(kinds & set(OUTSIDE[outcome['strange']['name']].acts_like))


def joints_told(outcomes: Iterable[Outcome]) -> list[bool]:
    """Return for each cause named like a visible one whether its joints are right."""
    told = []
    for outcome in outcomes:
        sets = {item['effect']: [*item['joint_sets'], own_joints(item)]
                for item in outcome['hidden'] if item['visible'] and item['joint_sets']}
        told += [sorted(cause['joints']) in sets[cause['effect']] for cause in outcome['causes']
                 if cause['effect'] in sets]
    return told


def own_joints(item: dict[str, Any]) -> list[int]:
    """Return the joints that have a hidden effect: a right answer, whatever explains as much.

    The sets of the generator are those of an effect that grows in proportion to its size. That of
    an encoder zero of degrees, or of a soft transmission, does not.
    """
    sizes = [np.asarray(item['values'].get(size, 0.0)) for size in HIDERS[item['effect']].sizes]
    return [joint for joint in JOINTS if any(np.any(size[..., joint] if size.ndim else size)
                                             for size in sizes)]


def values_right(outcome: Outcome) -> bool:
    """Return whether the name is right and every value near the hidden one."""
    numbers = [number for number in compared(outcome) if number.truth]
    return is_right(outcome) and bool(numbers) and all(
        number.within(LARGE_ERROR) for number in numbers)


def carriers(outcome: Outcome) -> list[str]:
    """Return the effects of a real machine that carry a share of the explainable error."""
    return [item['effect'] for item in outcome['hidden'] if item['carried'] >= CARRIED]


def of_kind(outcomes: Sequence[Outcome], *kinds: str) -> list[Outcome]:
    """Return the outcomes of some kinds."""
    return [outcome for outcome in outcomes if outcome['kind'] in kinds]


def visible_of(outcomes: Sequence[Outcome], *kinds: str) -> list[Outcome]:
    """Return the outcomes of some kinds in which all that is hidden is visible."""
    return list(filter(is_visible, of_kind(outcomes, *kinds)))


def rate(good: Sequence[bool]) -> str:
    """Return count, share and Wilson interval in words."""
    if not good:
        return '-'
    count = sum(map(bool, good))
    interval = binomtest(count, len(good)).proportion_ci(method='wilson')
    return (f'{count} of {len(good)}, {count / len(good):.1%} '
            f'({interval.low:.1%} to {interval.high:.1%})')


def share(outcomes: Sequence[Outcome], good: Callable[[Outcome], object]) -> str:
    """Return in how many outcomes something holds, in words."""
    return rate([bool(good(outcome)) for outcome in outcomes])


def wrapped(page: str) -> str:
    """Return a page of Markdown with its paragraphs wrapped at 100 columns; the rest stays."""
    return '\n\n'.join(part if part.lstrip().startswith(('#', '|', '-', '`')) else textwrap.fill(
        ' '.join(part.split()), 100, break_long_words=False, break_on_hyphens=False)
        for part in page.strip().split('\n\n')) + '\n'


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


def scores(outcomes: Sequence[Outcome]) -> str:
    """Return the table of what is to be reached."""
    singles = visible_of(outcomes, *SINGLES)
    alone = [outcome for outcome in singles if not outcome['hidden'][0]['twins']]
    pairs, triples = visible_of(outcomes, 'pair'), visible_of(outcomes, 'triple')
    removed, outside = visible_of(outcomes, 'removed'), visible_of(outcomes, 'outside')
    clean, wander = of_kind(outcomes, 'clean'), of_kind(outcomes, 'wander')
    white, coloured = ([item for item in clean if item['coloured'] is which]
                       for which in (False, True))
    company, real = visible_of(outcomes, 'company'), of_kind(outcomes, 'realistic')
    coarse, large = visible_of(outcomes, 'coarse'), visible_of(outcomes, 'large')
    sizes = [len(names) for outcome in singles for names in said(outcome)]
    below = [outcome for outcome in of_kind(outcomes, 'below') if not is_visible(outcome)]
    numbers = [number for outcome in outcomes for number in compared(outcome)]

    def wrong_given(own: Sequence[Outcome]) -> str:
        return rate([flag for item in own for flag in
                     [True] * len(wrong_sets(item))
                     + [False] * (len(item['causes']) - len(wrong_sets(item)))])

    def nameless(item: Outcome) -> bool:
        return not is_false(item) if item['strange'] else not is_accused(item)

    return table(('', 'to reach', 'measured (95 % interval, Wilson)'), [
        ('**one effect**: right, or a set that holds it', '97 %', share(singles, is_right)),
        ('- exactly, where no twin exists', '96 %', share(alone, is_exact)),
        ('- first name right, where no twin exists', '-', share(
            alone, lambda item: named(item)[:1] == hidden_names(item))),
        ('- a wrong name', 'at most 0.5 %', share(singles, is_false)),
        ('- median size of the sets', '-', statistics.median(sizes) if sizes else '-'),
        ('- held-out gain, of what the true model would gain', '-', gained(singles)),
        ('**joints** of one effect: those that have it, the fewest of equal sets', '95 %',
         rate(joints_told(singles))),
        ('- of all kinds', '-', rate(joints_told(outcomes))),
        ('**pairs**: both', '92 %', share(pairs, is_right)),
        ('- a wrong name', '-', share(pairs, is_false)),
        ('- held-out gain', '-', gained(pairs)),
        ('**three at once**: all three', '75 %', share(triples, is_right)),
        ('- two of them at least', '95 %', share(
            triples, lambda item: len(found_of(item, hidden_names(item))) >= 2)),
        ('- wrong, of the names given', 'at most 2 %', wrong_given(triples)),
        ("**company** of a cause outside the library: the library's cause named", '85 %',
         share(company, is_right)),
        ('- a wrong name', 'at most 3 %', share(company, is_false)),
        ('- an unnamed cause of a kind that describes it', '-', share(
            [item for item in company if item['strange']['acts_like']], is_described)),
        ('**machines as they are**: of the effects that carry 5 % of the error, named', '85 %',
         rate([name in found_of(item, hidden_names(item)) for item in real
               for name in carriers(item)])),
        ('- wrong, of the names given', 'at most 3 %', wrong_given(real)),
        ('- held-out gain', '90 %', gained(real)),
        ('**taken out of the library or outside it**: no name', '97 %',
         share([*removed, *outside], nameless)),
        ('- taken out', '-', share(removed, nameless)),
        ('- outside it altogether', '-', share(outside, nameless)),
        ('- taken out, called clean', '-', share(removed, is_clean)),
        ('- outside it, called clean', '-', share(
            [item for item in outside if item['strange']['acts_like']], is_clean)),
        ('- outside it, an unnamed cause of a kind that describes it', '-', share(
            [item for item in outside if item['strange']['acts_like']], is_described)),
        ('**clean**: accused', 'at most 0.5 %', share(clean, is_accused)),
        ('- white noise', '-', share(white, is_accused)),
        ('- coloured noise', '-', share(coloured, is_accused)),
        ('- called clean, white noise', '-', share(white, is_clean)),
        ('- called clean, coloured noise', '-', share(coloured, is_clean)),
        ('**clean under wandering noise**: called clean, the noise described', '80 %', share(
            wander, lambda item: is_clean(item) and item['wandering'])),
        ('- called clean', '-', share(wander, is_clean)),
        ('- accused', '-', share(wander, is_accused)),
        ('**lines** in the record: called clean', 'never', share(
            visible_of(outcomes, 'lines'), is_clean)),
        ('- accused', '-', share(of_kind(outcomes, 'lines'), is_accused)),
        ('**bursts** in the record: called clean', 'never', share(
            visible_of(outcomes, 'bursts'), is_clean)),
        ('- accused', '-', share(of_kind(outcomes, 'bursts'), is_accused)),
        ('**95 % intervals** that hold the truth', '92 to 97 %',
         rate([number.covered for number in numbers])),
        ('**coarse** encoders, slow logs, odd motions: right or honest', '-', share(
            coarse, lambda item: not is_false(item))),
        ('- right, or a set that holds it', '-', share(coarse, is_right)),
        ('- a wrong name', 'at most 1 %', share(coarse, is_false)),
        ('**large** causes: right', '-', share(large, is_right)),
        ('- and every value within 5 %', 'all', share(large, values_right)),
        ('- a wrong name', '-', share(large, is_false)),
        ('name for an effect that is not visible', '-', share(below, is_accused))])


def one_line(outcomes: Sequence[Outcome]) -> str:
    """Return the summary of some outcomes in a line."""
    failed = sum('error' in outcome for outcome in outcomes)
    outcomes = [outcome for outcome in outcomes if 'error' not in outcome]
    found = [name in found_of(outcome, hidden_names(outcome)) for outcome in outcomes
             for name in visible_names(outcome) if outcome['kind'] not in ('removed', 'below')]
    seconds = [outcome['seconds']['diagnose'] for outcome in outcomes]
    return (f'{len(outcomes)} scenarios, {failed} failed: '
            f'{sum(found)} of {len(found)} visible effects named; '
            f'{sum(map(is_false, of_others(outcomes)))} logs with a wrong name; joints right in '
            f'{sum(joints_told(outcomes))} of {len(joints_told(outcomes))}; '
            f'{statistics.median(seconds) if seconds else 0.0:.1f} s of one core each')


def of_others(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Return the outcomes with names that can be wrong: for what is taken out, each is."""
    return [outcome if outcome['kind'] != 'removed' else {**outcome, 'hidden': []}
            for outcome in outcomes]
