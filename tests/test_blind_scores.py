"""What the blind study counts as right, wrong and covered, and what an ablation counts."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / 'bench'))

from ablation import UNCHANGED, changes_of_rules, report
from blind_scores import (
    carriers,
    found_of,
    is_exact,
    is_false,
    is_right,
    joints_told,
    rate,
    values_right,
    wrong_sets,
)
from blind_values import compared


def cause(effect, joints=(0, 1, 2, 3), twins=(), values=(), stds=()):
    return {'effect': effect, 'twins': list(twins), 'joints': list(joints),
            'values': dict(values), 'stds': dict(stds)}


def outcome(hidden, causes, strange=None, kind='single'):
    return {'kind': kind, 'hidden': [{'visible': True, 'twins': [], 'joint_sets': None, **item}
                                     for item in hidden],
            'causes': causes, 'strange': strange}


def test_each_hidden_effect_needs_a_set_of_its_own():
    hidden = [{'effect': 'cogging'}, {'effect': 'torque_offset'}]
    both = outcome(hidden, [cause('coulomb_asymmetry', twins=['torque_offset']), cause('cogging')])
    assert is_right(both)
    assert not is_false(both)
    assert not is_exact(both)
    one = outcome(hidden, [cause('torque_offset', twins=['cogging']), cause('stribeck')])
    assert found_of(one, ['cogging', 'torque_offset']) == ['cogging']
    assert not is_right(one)
    assert wrong_sets(one) == [{'stribeck'}]


def test_a_name_for_what_it_explains_as_well_is_not_wrong():
    strange = {'name': 'contact', 'visible': True, 'acts_like': [], 'twins': ['cable_spring']}
    assert not is_false(outcome([], [cause('cable_spring')], strange))
    assert is_false(outcome([], [cause('cogging')], strange))


def test_joints_are_right_if_they_are_one_of_the_fewest_sets():
    hidden = [{'effect': 'drive_gain_error', 'joint_sets': [[2], [0, 3]],
               'values': {'relative': [0.0, 0.1, -0.1, 0.0]}},
              {'effect': 'distributed_rods'}]
    told = [outcome(hidden, [cause('drive_gain_error', joints), cause('distributed_rods')])
            for joints in ((2,), (3, 0), (1, 2), (0, 1, 3))]
    assert joints_told(told) == [True, True, True, False]


def test_effects_of_a_real_machine_count_from_a_share_on():
    hidden = [{'effect': 'cogging', 'carried': 0.2}, {'effect': 'base_tilt', 'carried': 0.01}]
    assert carriers(outcome(hidden, [])) == ['cogging']


def numbers_of(effect, hidden, joints, values, stds, kind='single'):
    return list(compared(outcome([{'effect': effect, 'values': hidden}],
                                 [cause(effect, joints, (), values, stds)], kind=kind)))


def test_values_are_compared_where_they_mean_the_same():
    (offset,) = numbers_of('torque_offset', {'offset': [0.0, 0.3, 0.0, 0.0]}, [1],
                           {'offset': [0.33]}, {'offset': [0.02]})
    assert (offset.truth, offset.covered) == (0.3, True)
    (wide,) = numbers_of('torque_offset', {'offset': [0.0, 0.3, 0.0, 0.0]}, [1],
                         {'offset': [0.36]}, {'offset': [0.02]})
    assert not wide.covered
    phase = numbers_of('cogging', {'amplitude': [0.1] * 4, 'periods': 12.0, 'phase': [3.1] * 4},
                       [0], {'phase': [-3.14]}, {'phase': [0.05]})
    assert phase[0].found == pytest.approx(2.0 * math.pi - 3.14)
    assert phase[0].covered
    (stiffness,) = numbers_of('elastic_transmission', {'compliance': [0.0, 0.0, 1e-4, 0.0]}, [2],
                              {'stiffness': [1.01e4]}, {'stiffness': [100.0]})
    assert stiffness.truth == pytest.approx(1e4)
    drops = numbers_of('friction_drift', {'drop': 0.1, 'viscous_drop': 0.3, 'time_constant': 8.0},
                       [0, 1, 2, 3], {'drop': 0.1, 'viscous_drop': 0.3}, {'drop': 0.01,
                                                                         'viscous_drop': 0.01})
    assert [number.truth for number in drops] == [0.1, 0.3]
    anchor = numbers_of('cable_spring', {'stiffness': 20.0, 'anchor': [0.1, 0.2, 0.3]},
                        [0, 1, 2, 3], {'stiffness': [20.0, 21.0, 19.0], 'anchor': [0.1, 0.2, 0.4]},
                        {'stiffness': [1.0] * 3, 'anchor': [0.01] * 3})
    assert [number.covered for number in anchor] == [True, True, True, True, True, False]


def test_phases_are_those_of_the_angles_that_encoders_read():
    """Read angles are 0.01 rad more than true ones: sin(12 q + 0.5) is sin(12 read + 0.38)."""
    hidden = [{'effect': 'cogging', 'values': {'periods': 12.0, 'phase': [0.5] * 4}},
              {'effect': 'encoder_offset', 'values': {'offset': [0.0, 0.01, 0.0, 0.0]}}]
    told = cause('cogging', [0, 1], (), {'phase': [0.5, 0.38]}, {'phase': [0.01, 0.01]})
    assert [item.found - item.truth for item in compared(outcome(hidden, [told]))] == (
        pytest.approx([0.0, 0.0]))


def test_one_name_for_two_effects_of_the_same_torque_is_told_their_sum():
    hidden = [{'effect': 'torque_offset', 'values': {'offset': [0.0, 0.3, 0.0, 0.0]}},
              {'effect': 'coulomb_asymmetry', 'values': {'asymmetry': [0.1, -0.2, 0.0, 0.0]}}]
    offset = cause('torque_offset', [0, 1], (), {'offset': [0.1, 0.1]}, {'offset': [0.01] * 2})
    asymmetry = cause('coulomb_asymmetry', [0], (), {'asymmetry': [0.1]}, {'asymmetry': [0.01]})
    assert [item.truth for item in compared(outcome(hidden, [offset]))] == (
        pytest.approx([0.1, 0.1]))
    assert [item.truth for item in compared(outcome(hidden, [offset, asymmetry]))] == (
        pytest.approx([0.0, 0.3, 0.1]))


def test_differences_are_measured_against_the_joints_not_named():
    (gain,) = numbers_of('drive_gain_error', {'relative': [0.05, 0.05, 0.0, 0.05]}, [2],
                         {'relative': [-0.0476]}, {'relative': [1e-4]})
    assert gain.truth == pytest.approx(1.0 / 1.05 - 1.0)
    (friction,) = numbers_of('joint_friction_difference', {'coulomb': [0.2, 0.0, 0.0, 0.0]}, [0],
                             {'coulomb': [0.2]}, {'coulomb': [0.01]})
    assert friction.truth == pytest.approx(0.2)
    weights = numbers_of('arm_weight_difference', {'first_moment': [0.03, -0.02, 0.01, 0.02]},
                         [0, 1, 2], {'first_moment': [0.01, -0.04, -0.01]},
                         {'first_moment': [1e-3] * 3})
    assert [number.truth for number in weights] == pytest.approx([0.01, -0.04, -0.01])
    assert not numbers_of('joint_friction_difference', {'coulomb': [0.2, 0.1, 0.0, 0.3]},
                          [0, 1, 2, 3], {'coulomb': [0.1, 0.0, -0.1, 0.2]},
                          {'coulomb': [0.1] * 4})


def test_what_has_no_deviation_is_not_compared():
    assert not numbers_of('nonlinear_viscous', {'quadratic': [0.1] * 4}, [0],
                          {'exponent': [2.0]}, {'exponent': [0.0]})
    assert not numbers_of('backlash', {'gap': [0.1] * 4}, [0], {'gap': [0.2]}, {'gap': [0.01]})
    # nor what a hidden machine leaves to its default
    assert not numbers_of('stribeck', {'stribeck_torque': [0.5] * 4}, [0],
                          {'exponent': [2.0]}, {'exponent': [0.1]})


def test_values_of_large_causes_must_be_near():
    def large(value):
        return outcome([{'effect': 'time_offset', 'values': {'delay': 0.05}}],
                       [cause('time_offset', (0, 1, 2, 3), (), {'delay': value},
                              {'delay': 1e-5})])
    assert values_right(large(0.0512))
    assert not values_right(large(0.056))


def test_rates_have_wilson_intervals():
    assert rate([True] * 9 + [False]) == '9 of 10, 90.0% (59.6% to 98.2%)'
    assert rate([]) == '-'


def test_an_ablation_counts_what_came_and_went_where_all_changes_were_scored():
    changes = {'price off': ('price', 0.0), 'price x 2': ('price', 13.0)}

    def scored(path, change, *names, verdict='explained'):
        return {**outcome([{'effect': 'cogging', 'values': {}}],
                          [cause(name, (0,), (), {}, {}) for name in names]),
                'kind': 'single', 'path': path, 'change': change, 'verdict': verdict}

    told = report([
        scored('one', UNCHANGED, 'cogging'), scored('one', 'price off', 'cogging', 'base_tilt'),
        scored('one', 'price x 2', verdict='unknown'),
        scored('two', UNCHANGED, 'cogging')], changes)  # not under all changes: left out
    assert '1 recordings' in told
    rows = [[cell.strip() for cell in line.strip('|').split('|')] for line in told.splitlines()
            if line.startswith('| `price')]
    assert rows == [
        ['`price off`', '6.5 to 0', '0', '0', '1', '0', '0', '0', '0'],
        ['`price x 2`', '6.5 to 13', '0', '1', '0', '0', '1', '0', '0']]
    assert set(changes) <= set(changes_of_rules())
