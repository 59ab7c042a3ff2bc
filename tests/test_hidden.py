"""Effects hidden by the generator are found: a small, fixed sample of the blind study.

Seeds are those of development. `make blind` does the whole on seeds that nothing was tuned on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hidden import study
from hidden.hiders import HIDERS
from hidden.kept import Kept, generator_hash, read_kept
from hidden.outside import OUTSIDE
from hidden.physics import OutOfReach
from hidden.scenario import (
    KINDS,
    LARGE,
    UNREAL,
    Scenario,
    Task,
    draw_scenario,
    planned_strength,
    record_scenario,
    truth_of,
)
from hidden.scoring import outcome_of
from hidden.study import COUNTS, diagnosis_of, made, tasks_of_study
from hidden.truth import VISIBLE
from short_scenarios import short_scenario

from par4_identification.logs.log import Log
from par4_kinematics.errors import UnreachableError

HIDDEN = (Task('single', 5000, 'arm_mass_offset', True, 'fast'),
          Task('single', 5001, 'theta_friction', True),
          Task('single', 5002, 'stribeck', False),
          Task('single', 5003, 'encoder_offset', False),
          Task('pair', 105000, 'drive_gain_error', True))
"""Six effects on machines, and with motions, of consecutive seeds."""


def is_found(name, values, diagnosis):
    """Return whether a hidden effect is named, whatever looks like it, and has its true size."""
    own = [cause for cause in diagnosis.causes if cause.effect.name == name]
    if len(own) != 1:
        return False
    cause, = own
    for key, truth in values.items():
        found = np.atleast_1d(cause.parameters[key].value)
        expected = np.broadcast_to(truth, (4,))[list(cause.joints)][:len(found)]
        if not np.allclose(found, expected, rtol=0.0, atol=0.15 * np.abs(truth).max() + 0.02):
            return False
    return True


def test_five_of_six_hidden_effects_are_named_and_sized_and_none_gets_a_wrong_name():
    found = 0
    for task in HIDDEN:
        scenario = short_scenario(task)
        fit, heldout = record_scenario(scenario)
        truth = truth_of(scenario, fit)
        assert all(truth.strength(name) > VISIBLE for name, _ in scenario.hidden), task
        diagnosis = diagnosis_of(scenario, fit, heldout)
        hidden = {name for name, _ in scenario.hidden}
        for cause in diagnosis.causes:
            assert hidden & {cause.effect.name, *cause.twins}, (task, cause.effect.name)
        assert len(diagnosis.causes) <= len(hidden), task
        right = sum(is_found(name, values, diagnosis) for name, values in scenario.hidden)
        if right == len(hidden):
            assert diagnosis.holdout.explained_fraction > 0.8, task
        found += right
    assert found >= 5


def test_an_effect_outside_the_library_ends_as_unknown():
    scenario = short_scenario(Task('removed', 205000, 'viscous_asymmetry', False))
    fit, heldout = record_scenario(scenario)
    truth = truth_of(scenario, fit)
    assert truth.strength('viscous_asymmetry') > VISIBLE
    diagnosis = diagnosis_of(scenario, fit, heldout,
                             ('viscous_asymmetry', *truth.twins('viscous_asymmetry')))
    assert diagnosis.verdict == 'unknown'
    assert diagnosis.causes == ()


@pytest.mark.parametrize(('seed', 'coloured'), [(305000, False), (305001, True)])
def test_a_clean_machine_is_not_accused(seed, coloured, tmp_path):
    scenario = made(Task('clean', seed, None, coloured))
    kept = read_kept(scenario.write(tmp_path))
    assert kept.generator == generator_hash()
    assert kept.robot == scenario.robot
    for written, read in ((scenario.fit, kept.fit), (scenario.heldout, kept.heldout)):
        assert len(read.t) > 1000
        for field in ('t', 'q', 'tau'):
            np.testing.assert_array_equal(getattr(read, field), getattr(written, field))
    outcome = outcome_of(kept)
    assert outcome['causes'] == []
    # noise that wanders by itself may exceed the floor, but is nobody's function of the motion
    assert outcome['verdict'] in (('clean', 'unknown') if coloured else ('clean',))


def test_a_bag_holds_what_is_recorded_in_memory():
    task = Task('single', 7, 'torque_offset', True)
    short = draw_scenario(task)
    short = replace(short, motions=tuple(short.motions[1:]) * 2)
    in_memory, = record_scenario(short)[:1]
    through_bag, = record_scenario(replace(short, task=replace(task, through_bag=True)))[:1]
    first, second = in_memory.log, through_bag.log
    np.testing.assert_allclose(second.q, first.q, atol=1e-12)
    np.testing.assert_allclose(second.tau, first.tau, atol=1e-9)


def test_a_scenario_is_what_its_seed_says():
    task = Task('pair', 11, 'cogging', True)
    one, two = draw_scenario(task), draw_scenario(task)
    assert [name for name, _ in one.hidden] == [name for name, _ in two.hidden]
    np.testing.assert_array_equal(one.motions[0].q, two.motions[0].q)
    assert one.noise == two.noise
    other = draw_scenario(replace(task, seed=12))
    assert other.noise != one.noise
    assert not np.array_equal(other.motions[0].q, one.motions[0].q)


@pytest.mark.parametrize('lost', [OutOfReach('no pose'), UnreachableError('leg 0')])
def test_another_machine_is_drawn_where_one_leaves_its_reach(lost, monkeypatch):
    task, drawn = Task('clean', 11, None, True), list[Scenario]()

    def recorded(of, scenario, _started):
        drawn.append(scenario)
        if len(drawn) < 3:
            raise lost
        return of

    monkeypatch.setattr(study, '_recorded', recorded)
    assert study.made(task) is task
    assert all(scenario.task is task for scenario in drawn)
    assert drawn[0].noise == draw_scenario(task).noise
    assert len({scenario.noise for scenario in drawn}) == 3


def test_draws_that_all_leave_their_reach_end(monkeypatch):
    def recorded(*_of):
        raise OutOfReach('no pose')

    monkeypatch.setattr(study, '_recorded', recorded)
    with pytest.raises(OutOfReach):
        study.made(Task('clean', 11, None, True))


def test_a_study_is_the_same_list_of_distinct_tasks():
    tasks = tasks_of_study(1.0, 1_000_000)
    assert tasks == tasks_of_study(1.0, 1_000_000)
    assert len({task.seed for task in tasks}) == len(tasks) == sum(COUNTS.values())
    assert sum(task.fidelity == 'fast' for task in tasks) >= 20
    singles = [task.effect for task in tasks if task.kind == 'single']
    assert set(singles) == set(HIDERS)
    counts = [singles.count(effect) for effect in HIDERS]
    assert max(counts) - min(counts) <= 1
    assert min(task.seed for task in tasks) >= 1_000_000
    company = [task for task in tasks if task.kind == 'company']
    assert {task.effect for task in company} == set(HIDERS) - set(UNREAL)
    assert {task.outside for task in company} == set(OUTSIDE)
    assert len({(task.effect, task.outside) for task in company}) > 100
    assert all((task.outside is None) == (task.kind not in (
        'company', 'outside', 'lines', 'bursts')) for task in tasks)
    some = tasks_of_study(1.0, 1_000_000, ('single',), 10)
    assert some == [task for task in tasks if task.kind == 'single'][:10]
    others = tasks_of_study(1.0, 1_000_100, ('single',), 10)
    assert {task.effect for task in others} != {task.effect for task in some}


def drawn(kind, seed, effect=None, outside=None):
    return draw_scenario(Task(kind, seed, effect, True, outside=outside))


def test_kinds_are_drawn_as_they_are_described():
    triple = drawn('triple', 1, 'cogging')
    assert len({name for name, _ in triple.hidden}) == 3
    for seed in (1, 2):
        names = [name for name, _ in drawn('realistic', seed).hidden]
        assert 4 <= len(set(names)) == len(names) <= 8
        assert {'joint_friction_difference', 'joint_inertia_difference'} <= set(names)
    company = drawn('company', 3, 'stribeck', 'dead_band')
    assert company.outside[0].name == 'dead_band'
    assert [name for name, _ in company.hidden] == ['stribeck']
    wander = drawn('wander', 4)
    assert wander.wander.level.min() >= 0.05
    assert not wander.hidden
    odd = [drawn('coarse', seed, 'torque_offset') for seed in range(5, 9)]
    assert all(item.known.robot.drives.encoder_counts == 8192 or item.every > 1
               or item.shape in ('cycles', 'slow') for item in odd)
    for effect in LARGE:
        large = drawn('large', 7, effect)
        usual = drawn('single', 7, effect)
        sizes = [max(np.abs(value).max() for value in scenario.hidden[0][1].values())
                 for scenario in (large, usual)]
        assert sizes[0] > 2.0 * sizes[1]
        assert planned_strength(effect, large.hidden[0][1], large.known, large.motions[0],
                                np.full(4, 0.1)) > 10 * VISIBLE


def test_a_file_of_another_generator_is_told(tmp_path):
    t = np.arange(3.0)
    log = Log('fit', ('a', 'b', 'c', 'd'), 5, 1.0, t, np.zeros((3, 4)), np.ones((3, 4)),
              (slice(0, 3),), None, None)
    robot = draw_scenario(Task('clean', 1, None, False)).known.robot
    kept = Kept({'kind': 'clean', 'seed': 1}, robot, log, log, np.zeros((3, 4)), 'other')
    read = read_kept(kept.write(tmp_path))
    assert read.generator == 'other' != generator_hash()
    assert read.fit.segments == (slice(0, 3),)
    assert set(KINDS) == set(COUNTS)
