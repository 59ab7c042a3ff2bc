"""What the commands say of mistakes of the setup: first, on the terminal, the page and in JSON."""

from __future__ import annotations

import json
from pathlib import Path

import mistakes
import numpy as np
import pytest
from report_pages import checked_page
from test_commands import run, simulated

from par4_dynamics.model_from_file import read_model
from par4_identification.commands import bag as bag_command
from par4_identification.commands import diagnose, identify, validate
from par4_identification.logs.bag import read_bag
from par4_identification.logs.raw_bag import RawBag
from par4_identification.logs.read_log import read_log
from par4_sim.bags.bag_writer import BagWriter
from robots import REFERENCE

FIRST = 'Before anything else: '


@pytest.fixture(scope='module')
def right(tmp_path_factory):
    """Return the messages of a good bag."""
    folder = tmp_path_factory.mktemp('right')
    return read_bag(simulated(folder, 'right', read_model('table1', REFERENCE), 5, 10.0))


Message = tuple[int, str, int, np.ndarray | tuple, np.ndarray | tuple]
"""Received, topic, stamp, position and effort."""


def messages_of(raw: RawBag) -> list[Message]:
    """Return the joint states of a bag in the order in which they were received."""
    found, names = [], list(REFERENCE.joint_names)
    for topic, joints in raw.joints.items():
        position, effort = (joints.select(part, names) for part in (joints.position, joints.effort))
        for row, stamp in enumerate(joints.stamp):
            found.append((int(joints.received[row]), topic, int(stamp), *(
                () if np.isnan(part[row]).any() else part[row] for part in (position, effort))))
    return sorted(found, key=lambda message: message[0])


def written(path: Path, messages: list[Message]) -> Path:
    """Return the path of a bag with these messages."""
    with BagWriter(path) as writer:
        for received, topic, stamp, position, effort in messages:
            writer.write_joint_state(f'/{topic}', stamp, list(REFERENCE.joint_names), position,
                                     effort=effort, received=received)
    return path


@pytest.fixture(scope='module')
def bag(right, tmp_path_factory):
    """Return a bag in which the plugs of the amplifiers of joints 1 and 2 are exchanged."""
    return written(tmp_path_factory.mktemp('setup') / 'exchanged', [
        (received, topic, stamp, position,
         effort[[0, 2, 1, 3]] if topic == 'amplifier_voltage' else effort)
        for received, topic, stamp, position, effort in messages_of(right)])


def said_first(done, folder, kind: str, result: str) -> dict:
    """Return the first finding of a command that said it first everywhere."""
    assert done.code == 0, done.err
    assert done.out.startswith(FIRST)
    finding = json.loads((folder / result).read_text())['setup'][0]
    assert finding['finding'] == kind
    assert finding['evidence'] in ' '.join(done.out.split())
    return finding


@pytest.mark.usefixtures('unrendered')
def test_identification_says_exchanged_plugs_first_and_goes_on(bag, tmp_path):
    done = run(identify, bag, '--robot', 'reference', '--output', tmp_path, '--compare-true',
               'table1')
    finding = said_first(done, tmp_path, 'joints_exchanged', 'identification.json')
    assert finding['joints'] == [1, 2]
    assert 'torques' in finding['evidence']
    assert 'wiring' in finding['mend']
    inertia = json.loads((tmp_path / 'identification.json').read_text())['parameters'][
        'actuator_inertia']
    assert inertia['value'] == pytest.approx(0.113, rel=0.01)
    assert FIRST in checked_page(tmp_path / 'report.html', 1).text


@pytest.mark.usefixtures('unrendered')
def test_validation_says_it_too(bag, tmp_path):
    done = run(validate, bag, '--model', 'table1', '--robot', 'reference', '--output', tmp_path)
    said_first(done, tmp_path, 'joints_exchanged', 'validation.json')
    assert 'The model holds' in done.out


@pytest.mark.usefixtures('unrendered')
def test_diagnosis_says_it_too_and_finds_a_clean_machine(bag, tmp_path):
    done = run(diagnose, bag, '--robot', 'reference', '--output', tmp_path, '--no-simulate')
    said_first(done, tmp_path, 'joints_exchanged', 'diagnosis.json')
    assert 'The diagnosis went on with this mended' in ' '.join(done.out.split())
    assert json.loads((tmp_path / 'diagnosis.json').read_text())['verdict'] == 'clean'


@pytest.mark.usefixtures('unrendered')
def test_useless_data_are_unusable_with_the_finding_as_reason(bag, tmp_path, monkeypatch):
    monkeypatch.setattr('par4_identification.jobs.read_bags.read_log',
                        lambda *arguments: mistakes.standing(read_log(*arguments)))
    done = run(diagnose, bag, '--robot', 'reference', '--output', tmp_path)
    finding = said_first(done, tmp_path, 'not_moving', 'diagnosis.json')
    content = json.loads((tmp_path / 'diagnosis.json').read_text())
    assert content['verdict'] == 'unusable_data'
    assert content['causes'] == []
    assert finding['evidence'] in content['reasons'][0]


@pytest.mark.usefixtures('unrendered')
def test_stamps_in_milliseconds_end_in_no_error(bag, tmp_path, monkeypatch):
    monkeypatch.setattr('par4_identification.jobs.validate.read_log',
                        lambda *arguments: mistakes.in_milliseconds(read_log(*arguments)))
    done = run(validate, bag, '--model', 'table1', '--robot', 'reference', '--output', tmp_path)
    said_first(done, tmp_path, 'wrong_unit', 'validation.json')


def test_a_model_of_torques_in_another_unit_is_not_to_be_used(right, tmp_path):
    bag = written(tmp_path / 'mNm', [
        (received, topic, stamp, position, 1e3 * np.asarray(effort))
        for received, topic, stamp, position, effort in messages_of(right)])
    done = run(identify, bag, '--robot', 'reference', '--output', tmp_path / 'out', '--no-report')
    assert done.code == 0, done.err
    assert done.out.startswith(f'{FIRST}torques reach ')
    assert 'as mN m they would be' in ' '.join(done.out.split())
    assert 'do not use this model' in done.out
    assert 'can be trusted' not in done.out


SECOND = 1_000_000_000


def other_clock(messages: list[Message]) -> list[Message]:
    """Return messages of a recorder whose amplifiers have a clock ten hours ahead."""
    return [(received, topic, stamp + 36_000 * SECOND * (topic == 'amplifier_voltage'), *values)
            for received, topic, stamp, *values in messages]


def restarted_clock(messages: list[Message]) -> list[Message]:
    """Return messages of a clock that is set back by seven seconds in the middle."""
    middle = messages[len(messages) // 2][0]
    return [(received, topic, stamp - 7 * SECOND * (received > middle), *values)
            for received, topic, stamp, *values in messages]


def with_another(messages: list[Message], start: float, end: float, behind: int) -> list[Message]:
    """Return messages beside those of a second machine from `start` to `end`, s.

    It is elsewhere, pushes otherwise, talks half a millisecond later and stamps that less `behind`.
    """
    zero, later = messages[0][0], 500_000
    more = [(received + later, topic, stamp + later - behind, np.asarray(position) + 0.3,
             -0.5 * np.asarray(effort)) for received, topic, stamp, position, effort in messages
            if start * SECOND < received - zero < end * SECOND]
    return sorted([*messages, *more], key=lambda message: message[0])


def stalled(messages: list[Message], later: int) -> list[Message]:
    """Return messages of which those with a stamp from `later` on stall for 2 s after 4 s."""
    behind = messages[0][0] + 4 * SECOND
    return sorted([(received + 2 * SECOND * (stamp > later and received > behind), topic, stamp,
                    *values) for received, topic, stamp, *values in messages],
                  key=lambda message: message[0])


CLOCKS = {
    'two clocks': (other_clock, 'has another clock'),
    'a clock set back': (restarted_clock, 'the clock was set back once'),
    'a second simulation': (lambda messages: with_another(messages, 1.0, 9.0, -500 * SECOND),
                            'two machines or simulations with clocks of their own'),
    'a second simulation for a moment': (
        lambda messages: with_another(messages, 4.0, 4.05, -500 * SECOND),
        'clocks of their own talk on /joint_states; 49 messages'),
    'a second simulation after a restart': (
        lambda messages: with_another(restarted_clock(messages), 7.0, 9.0, -500 * SECOND),
        'two machines or simulations with clocks of their own'),
    'a second simulation that stalls': (
        lambda messages: stalled(with_another(messages, 1.0, 9.0, -500 * SECOND), 500 * SECOND),
        'two machines or simulations with clocks of their own'),
    'a second machine': (lambda messages: with_another(messages, 3.0, 3.3, 0),
                         'two machines or simulations talk on'),
}


@pytest.fixture(scope='module')
def clocks(right, tmp_path_factory):
    """Return a bag of each case, by its name; those of two sources are of another motion."""
    folder = tmp_path_factory.mktemp('clocks')
    other = read_bag(simulated(folder, 'other', read_model('table1', REFERENCE), 6, 10.0))
    return {case: written(folder / case.replace(' ', '_'), change(messages_of(
        other if case.startswith('a second') else right))) for case, (change, _) in CLOCKS.items()}


@pytest.mark.parametrize('case', CLOCKS)
def test_clocks_and_sources_are_told_and_the_sound_stretches_identified(case, clocks, tmp_path):
    done = run(identify, clocks[case], '--robot', 'reference', '--output', tmp_path, '--no-report')
    assert done.code == 0, done.err
    assert done.out.startswith(FIRST)
    assert CLOCKS[case][1] in ' '.join(done.out.split())
    content = json.loads((tmp_path / 'identification.json').read_text())
    assert content['parameters']['actuator_inertia']['value'] == pytest.approx(0.113, rel=0.02)


def test_two_simulations_whose_clocks_nearly_agree_are_refused_by_all_in_a_line(right, tmp_path):
    """As two that were started together: nothing tells whose a message is."""
    bag = written(tmp_path / 'near', with_another(messages_of(right), 0.0, 99.0, 40_500_000))
    for command in (identify, diagnose):
        done = run(command, bag, '--robot', 'reference', '--output', tmp_path / 'result')
        assert done.code == 2
        assert done.err.startswith('error: ')
        assert done.err.count('\n') == 1
        assert 'two machines or simulations on one topic' in done.err
    assert not (tmp_path / 'result').exists()
    done = run(bag_command, '--inspect', bag)
    assert done.code == 0
    assert done.out.count('two machines or simulations on one topic') == 1
    assert done.out.splitlines()[-1].startswith('no tool can use it: ')


@pytest.mark.usefixtures('unrendered')
@pytest.mark.parametrize('cases', [('two clocks', 'a second simulation'),
                                   ('a clock set back', 'a second machine')])
def test_clocks_and_sources_are_told_and_the_sound_stretches_diagnosed(cases, clocks, tmp_path):
    done = run(diagnose, clocks[cases[0]], '--holdout', clocks[cases[1]], '--robot', 'reference',
               '--output', tmp_path, '--no-simulate', '--no-report')
    assert done.code == 0, done.err
    assert done.out.startswith(FIRST)
    for case in cases:
        assert CLOCKS[case][1] in ' '.join(done.out.split())
    assert json.loads((tmp_path / 'diagnosis.json').read_text())['verdict'] == 'clean'


@pytest.mark.usefixtures('unrendered')
@pytest.mark.parametrize(('factor', 'told'), [
    (1.05, '4.76 %, 4.76 %, 4.76 %, 4.76 %; the voltage rules; check drives.gain'),
    (-1.0, '200 %, 200 %, 200 %, 200 %, as torques of opposite sign do; the voltage rules; check '
           'their signs')])
def test_torques_that_disagree_are_told_on_the_terminal(right, tmp_path, factor, told):
    path = written(tmp_path / 'bag', [
        (received, topic, stamp, position,
         factor * np.asarray(effort) if topic == 'joint_states' else effort)
        for received, topic, stamp, position, effort in messages_of(right)])
    words = f'{FIRST}{path}: effort and gain x amplifier voltage disagree by {told}'
    for command, options in ((identify, ('--no-report',)), (validate, ('--model', 'table1'))):
        done = run(command, path, '--robot', 'reference', '--output', tmp_path / 'out', *options)
        assert done.code == 0, done.err
        assert done.out.count('disagree by') == 1
        assert any(line.startswith(words) for line in done.out.splitlines())
