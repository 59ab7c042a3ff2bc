"""Parameters that a node does not have are told, and those of other nodes are not taken for slips.
"""

from __future__ import annotations

import dataclasses
import difflib
import itertools
import os
import subprocess
import sys
from contextlib import nullcontext
from importlib import import_module
from types import SimpleNamespace
from unittest import mock

import pytest
from node_server import MODULES
from ruamel.yaml import YAML

from executables import NODES, SCRIPTS
from par4_kinematics.errors import InputError
from par4_kinematics.files import write_yaml
from par4_kinematics.ros import parameters
from par4_kinematics.ros.motion_parameters import MotionParameters
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.ros.parameters import (
    ALIKE,
    NodeParameters,
    declare,
    page,
    tell_unknown_overrides,
)
from par4_kinematics.ros.process import _initialise
from par4_sim.cell.cell import COMPOSITIONS

RECORD = 'from par4_identification_start import record; raise SystemExit(record())'


def parameters_of(node: str) -> type[NodeParameters]:
    """Return the dataclass of the parameters of a node."""
    node_class, = (value for value in vars(import_module(MODULES[node])).values()
                   if isinstance(value, type) and issubclass(value, Par4Node)
                   and value is not Par4Node)
    return node_class.PARAMETERS


def names_of(node: str) -> list[str]:
    """Return the names of the parameters of a node."""
    return [field.name for field in dataclasses.fields(parameters_of(node))]


def noted(monkeypatch: pytest.MonkeyPatch, given: list[str], arguments: list[str]) -> list[str]:
    """Return what `par4_motion` notes where these parameters are given.

    Raises:
        InputError: it refuses them.
    """
    node = mock.Mock()
    node.get_name.return_value = 'par4_motion'
    node.get_parameters_by_prefix.return_value = given
    node.get_parameter.side_effect = lambda _: SimpleNamespace(value=1)
    monkeypatch.setattr(parameters.sys, 'argv', ['par4_motion', '--ros-args', *arguments])
    declare(node, MotionParameters)
    node.get_logger.return_value.warning.assert_not_called()
    return [call.args[0] for call in node.get_logger.return_value.info.call_args_list]


def test_a_path_at_home_is_meant_as_in_a_shell(monkeypatch, tmp_path):
    """No shell expands it behind `:=`; the node made a folder of the name `~`."""
    monkeypatch.setenv('HOME', str(tmp_path))
    node = mock.Mock()
    node.get_parameters_by_prefix.return_value = ['motion']
    node.get_parameter.side_effect = lambda _: SimpleNamespace(value='~/mine.yaml')
    assert declare(node, MotionParameters).motion == str(tmp_path / 'mine.yaml')
    session = COMPOSITIONS['cell'].session({'record': '~/bag', 'motion': 'circle'})
    told = {part.executable: part.parameters for part in session.nodes}
    assert told['par4_record']['output'] == str(tmp_path / 'bag')


@pytest.mark.parametrize('arguments', [
    ['-p', 'motions:=adept'], ['-p', 'par4_motion:motions:=adept'], ['--params-file', 'cell.yaml']])
def test_a_misspelt_parameter_is_refused_with_the_name_that_was_meant(monkeypatch, arguments):
    """The node said so and moved the robot all the same."""
    with pytest.raises(InputError) as refused:
        noted(monkeypatch, ['motions'], arguments)
    assert str(refused.value) == (
        'parameter motions (did you mean motion?): unknown; known are robot_file, motion, '
        'duration, seed, period, listeners')


def test_a_name_like_no_other_is_refused_where_this_node_alone_was_given_it(monkeypatch, tmp_path):
    given = ['colour', 'durations', 'shape']
    with pytest.raises(InputError, match=r'^parameter colour, durations .did you mean duration\?.: '
                                         r'unknown; known are '):
        noted(monkeypatch, given, ['-p', 'colour:=red'])
    for part, said in (('/**', None), ('par4_feedforward', None), ('par4_motion', 'shape'),
                       ('/robot_a/par4_motion', 'shape')):
        write_yaml(tmp_path / 'file.yaml', {part: {'ros__parameters': {'shape': 1}}})
        arguments = ['--params-file', str(tmp_path / 'file.yaml')]
        with pytest.raises(InputError, match=f'^parameter {said}: ') if said else nullcontext():
            assert noted(monkeypatch, ['shape'], arguments) == [
                'no parameters of this node, ignored: shape']


def test_what_ros_gives_and_what_other_nodes_of_a_file_take_is_no_fault(monkeypatch):
    of_ros = ['use_sim_time', 'start_type_description_service',
              'qos_overrides./joint_states.subscription.depth']
    assert noted(monkeypatch, of_ros, ['-p', 'use_sim_time:=true']) == []
    foreign = sorted(set(names_of('par4_simulation')) - set(names_of('par4_motion')))
    assert noted(monkeypatch, foreign, ['--params-file', 'cell.yaml']) == [
        f'no parameters of this node, ignored: {", ".join(foreign)}']


def test_no_parameter_of_a_node_looks_like_a_slip_of_another_ones():
    names = {node: names_of(node) for node in MODULES}
    for own, other in itertools.permutations(MODULES, 2):
        for name in set(names[other]) - set(names[own]):
            assert not difflib.get_close_matches(name, names[own], 1, ALIKE), (name, own)


@pytest.mark.parametrize('node', MODULES)
def test_the_example_in_help_sets_what_there_is_and_not_to_its_default(node, monkeypatch):
    """It was `-p robot_file:=reference`, which is what the node has without it."""
    known = parameters_of(node)
    example = page(known).partition('Example:\n  ')[2]
    name, ros, *words = example.split()
    assert (name, ros, {*words[::2]}) == (node, '--ros-args', {'-p'})
    given = {word.partition(':=')[0]: YAML(typ='safe').load(word.partition(':=')[2])
             for word in words[1::2]}
    fake = mock.Mock()
    fake.get_parameters_by_prefix.return_value = list(given)
    fake.get_parameter.side_effect = lambda asked: SimpleNamespace(value=given[asked])
    monkeypatch.setattr(parameters.sys, 'argv', example.split())
    assert declare(fake, known) != known()
    # by wall time a motion beside a simulation ends in an error
    assert given.get('use_sim_time', node == 'par4_simulation')


@pytest.mark.parametrize('node', MODULES)
def test_every_node_refuses_a_misspelt_parameter(bench, node):
    assert bench.ended(bench.start(node, robot_fiel='reference', use_sim_time='true')) == 2
    line, = (bench.folder / f'{node}_0.txt').read_text().splitlines()
    meant = '' if node == 'par4_record' else ' (did you mean robot_file?)'
    assert line.startswith(f'error: parameter robot_fiel{meant}: unknown; known are ')
    assert [path.name for path in bench.folder.iterdir() if path.is_dir()] in ([], ['log'])


def test_an_override_of_quality_of_service_that_no_topic_takes_is_told(bench):
    bench.start('par4_kinematics', **{
        'qos_overrides./joint_statez.subscription.depth': 5,
        'qos_overrides./joint_states.subscription.depth': 6})
    bench.wait(lambda: 'qos_overrides./joint_statez' in bench.said(), 'a warning')
    warning, = (line for line in bench.said().splitlines() if 'qos_overrides' in line)
    assert ('unknown parameter qos_overrides./joint_statez.subscription.depth (did you mean '
            'qos_overrides./joint_states.subscription.depth?) ignored; known are ') in warning
    assert warning.endswith('/platform_pose.publisher with history, depth, reliability')


def test_an_override_for_another_node_of_a_file_is_no_warning(monkeypatch):
    monkeypatch.setattr(parameters.sys, 'argv', ['par4_motion', '--ros-args', '--params-file', 'a'])
    node = mock.Mock(publishers=[SimpleNamespace(topic_name='/reference')],
                     subscriptions=[SimpleNamespace(topic_name='/joint_states')])
    node.get_parameters_by_prefix.return_value = [
        '/reference.publisher.depth', '/reference.subscription.depth', '/voltage.publisher.depth']
    tell_unknown_overrides(node)
    log = node.get_logger.return_value
    log.warning.assert_not_called()
    log.info.assert_called_once_with(
        'no parameters of this node, ignored: qos_overrides./reference.subscription.depth, '
        'qos_overrides./voltage.publisher.depth')


@pytest.mark.parametrize('line', ['motion:=circle', '-p motion:=circle', '/a:=/b',
                                  '--ros-args -p seed:=1 -- motion:=circle'])
def test_what_stands_outside_of_the_arguments_of_ros_is_refused(line):
    """rcl would take motion:=circle for another name of a topic, and the default be played."""
    strange = line.rpartition('-- ')[2].split()[0]
    with pytest.raises(InputError, match=rf'unknown argument {strange}; parameters are given as '
                                         r'--ros-args -p NAME:=VALUE'):
        _initialise(['par4_motion', *line.split()])


@pytest.mark.parametrize('domain', ['233', '-1', 'cell'])
def test_a_domain_that_there_is_not_is_refused(monkeypatch, domain):
    monkeypatch.setenv('ROS_DOMAIN_ID', domain)
    with pytest.raises(InputError, match=f'ROS_DOMAIN_ID: {domain} found; set a whole number from '
                                         f'0 to 232'):
        _initialise(['par4_motion'])


@pytest.mark.parametrize(('words', 'said'), [
    (('--params-file', 'nosuch.yaml'), "'--params-file nosuch.yaml' is not understood; ROS says "
     '"Error opening YAML file"; give a parameter file as --config prints it'),
    (('-p', 'output:='), "'-p output:=' is not understood; give -p NAME:=VALUE with a value"),
    (('-p', 'out-put:=bag'), 'names have letters, digits and _, and do not begin with a digit'),
    (('-r', '__ns:=/1abc'), "'-r __ns:=/1abc' is not understood; give -r FROM:=TO"),
    (('--log-level', 'loud'), 'give --log-level debug, info, warn, error or fatal'),
    (('-x',), "ROS arguments: ['-x']; give them as --ros-args")])
def test_what_ros_does_not_understand_is_said_in_one_line(words, said, tmp_path):
    done = subprocess.run([sys.executable, '-c', RECORD, '--ros-args', *words], cwd=tmp_path,
                          capture_output=True, text=True, check=False, timeout=100)
    line, = done.stderr.splitlines()
    assert line.startswith('error: ROS arguments: ')
    assert said in line
    assert done.returncode == 2
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize('name', NODES)
def test_a_shell_that_asks_for_completion_starts_no_node(name):
    """It hung: README's recipe waits for the end of what it asks."""
    start = SCRIPTS[name]
    done = subprocess.run(
        [sys.executable, '-c',
         f'from {start.module} import {start.attr}; raise SystemExit({start.attr}())'],
        env=os.environ | {f'_{name.upper()}_COMPLETE': 'bash_source'}, capture_output=True,
        text=True, check=False, timeout=20)
    assert (done.returncode, done.stdout) == (2, '')
    assert done.stderr == (f'error: {name}: a node takes ROS parameters and has no completion; see '
                           f'{name} --help\n')


@pytest.mark.parametrize('option', ['--help', '--config', '--version'])
def test_help_and_defaults_may_go_unread_and_a_full_disk_is_said(option):
    command = [sys.executable, '-c', RECORD, option]
    with open('/dev/full', 'w') as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False,
                              timeout=100)
    assert done.returncode == 2
    assert done.stderr == 'error: standard output: No space left on device; free space\n'
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False,
                          timeout=100)
    os.close(writer)
    assert done.returncode == 0
    assert done.stderr == ''
