"""What a report shows: the mark of each finding, the period of a wave."""

from __future__ import annotations

import re

import numpy as np
import pytest

from par4_identification.reports.cause_cells import common_order
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


@pytest.mark.parametrize(('orders', 'span', 'common'), [
    ((72.0,), 6.0, 72.0), ((7.0, 36.0), 6.0, 1.0), ((36.0, 84.0), 6.0, 12.0),
    ((30.2, 60.4), 20.0, 30.2), ((628.3, 1256.6), 0.5, 628.3), ((0.3, 0.4), 50.0, 0.1),
    ((628.3, 700.0), 2.0, None)])
def test_waves_are_drawn_over_the_period_after_which_all_return(orders, span, common):
    """Behind a gear and on a slide the orders of a motor are no whole numbers."""
    found = common_order(np.array(orders), span)
    assert found == (None if common is None else pytest.approx(common))
