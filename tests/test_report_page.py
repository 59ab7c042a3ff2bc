"""The first screen of a report: each finding has the mark that its kind asks for."""

from __future__ import annotations

import re

from par4_sim.report.outcome import Outcome, Remark, note
from par4_sim.report.page import rendered


def page_of(outcome: Outcome) -> str:
    """Return a report that has nothing but its first screen."""
    return rendered('par4_sim.report', 'base.html', outcome, 'a report', 'Findings', {})


def test_what_is_only_told_has_neither_the_mark_of_a_strength_nor_that_of_a_weakness():
    page = page_of(Outcome('It moves.', 'fair', (
        Remark(True, 'It fits.'), Remark(False, 'It rattles.', 'Tighten it.'),
        note('It was not weighed.', 'Weigh it.'))))
    assert dict(re.findall(r'<li class="(\w+)">(.*)\.</li>', page)) == {
        'good': 'It fits', 'poor': 'It rattles', 'plain': 'It was not weighed', 'next': 'Weigh it'}
    marks = dict(re.findall(r'li(?:\.(\w+))?::before \{.*content: "(.)"', page))
    # a note has the mark and the size of any line
    assert '.plain' not in page
    assert marks == {'': '\N{EN DASH}', 'good': '✓', 'poor': '!', 'next': '→'}


def test_the_advice_of_troubles_comes_first_and_notes_weaken_nothing():
    told = note('It was not weighed.', 'Weigh it.')
    assert told.good
    outcome = Outcome('It moves.', 'fair', (told, Remark(False, 'It rattles.', 'Tighten it.')))
    assert outcome.advice == ('Tighten it.', 'Weigh it.')
