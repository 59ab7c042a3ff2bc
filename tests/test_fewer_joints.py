"""Joints of a cause beside one that is not found yet: its torque must not look like more joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hidden.hiders import HIDERS
from hidden.scenario import Task, record_scenario
from searches import cause, search_of
from short_scenarios import short_scenario

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_identification.diagnosis.diagnosis import LIBRARY, diagnose
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.search.joints import choices

SEARCHED = {name: LIBRARY[name] for name in (
    'encoder_offset', 'leg_length_error', 'distributed_rods')}
RODS = {'rod_mass': 0.04}
ONE_JOINT = {'encoder_offset': (2, {'offset': np.array((0.0, 0.0, 0.009, 0.0))}),
             'leg_length_error': (1, {'forearm_length': np.array((0.0, 0.005, 0.0, 0.0))})}
SEEDS = 13, 15
"""Of motions and noise: circles, and a mixture."""


def answer_of(seed, name):
    """Return what is told of a machine with one wrong joint, or leg, and rods with mass."""
    _, values = ONE_JOINT[name]
    scenario = short_scenario(Task('single', seed, name, True))
    machine = HIDERS['distributed_rods'].build(
        HIDERS[name].build(scenario.known.machine, values), RODS)
    fit, heldout = record_scenario(replace(scenario, machine=machine))
    return diagnose([fit.log], scenario.known.robot, None, [heldout.log], library=SEARCHED)


def test_rods_beside_one_wrong_joint_make_no_more_joints_of_it():
    """Four lengths of legs take up a good part of the rods, so that these are not looked for."""
    right = 0
    for seed in SEEDS:
        for name, (joint, _) in ONE_JOINT.items():
            told = {own.effect.name: own.joints for own in answer_of(seed, name).causes}
            right += told == {name: (joint,), 'distributed_rods': (0, 1, 2, 3)}
    assert right >= 3


def test_a_rigid_joint_is_no_part_of_springs():
    """What other causes leave there seems to twist it, with any sign."""
    springs = CATALOGUE['elastic_transmission']
    soft = Hypothesis(springs, springs.expansion(np.array((0.0, 3e-4, 0.0, 2e-4))), (0, 1, 2, 3))
    told = [item.sets for item in choices(soft, (0, 1, 2, 3))]
    assert told == [(1,), (3,), (1, 3)]
    assert len(list(choices(Hypothesis(springs, {}, (0, 1, 2, 3)), (0, 1, 2, 3)))) == 15


@pytest.mark.parametrize(('offset', 'joints', 'starts'), [
    ((0.3, -0.3, 0.005, 0.0), (0, 1, 2, 3), [(0, 1)]),
    # two joints explain it, too, but are more than it takes
    ((0.5, -0.1, 0.005, 0.0), (0, 1, 2, 3), [(0,)]),
    # two are more than half of three
    ((0.4, -0.4, 0.4, 0.0), (0, 1, 2), [])])
def test_fewer_joints_are_where_another_name_may_grow(offset, joints, starts):
    """The fewest of at most half of them that explain nearly as much."""
    search = search_of(('torque_offset', {'offset': offset}), library=('torque_offset', 'stribeck'))
    found = search._starts_without(cause('torque_offset', joints), ())
    assert [[item.joints for item in start] for start in found] == [[fewer] for fewer in starts]
