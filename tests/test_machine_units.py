"""Units of texts and parameters as they are on a machine."""

from __future__ import annotations

import pytest

from par4_kinematics.machine_units import words_on
from par4_kinematics.robot import Axis

TURNS, SLIDES = (Axis(schema='par4/axis/1', name=kind, joint='motor', kind=kind, gain=1.0)
                 for kind in ('revolute', 'linear'))


@pytest.mark.parametrize(('words', 'told'), [
    ('found -3.1 N m at 0.2 rad/s, which drives', 'found -3.1 N at 0.2 m/s, which drives'),
    ('a stiffness of 43 N m/rad', 'a stiffness of 43 N/m'),
    ('more than 2 N m s2/rad2, or 1e+03 N m', 'more than 2 N s2/m2, or 1e+03 N'),
    ('3 radians, 5 N meter and 7 rad/sample', '3 radians, 5 N meter and 7 rad/sample'),
    ('explains 37 in log-likelihood', 'explains 37 in log-likelihood')])
def test_units_behind_numbers_are_those_of_the_machine(words, told):
    assert words_on(SLIDES, words) == told
    assert words_on(TURNS, words) == words
