"""Nodes that run together: the table, the launch files made of it, and `par4_cell`."""

from __future__ import annotations

import dataclasses
import json
import os
import runpy
import select
import shutil
import signal
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import launch_stand_in
import numpy as np
import pytest
import rclpy
from rclpy.node import Node

from node_bench import HOME_Q, MODULES, torque_steps
from par4_identification.logs.read_log import read_log
from par4_kinematics import interface
from par4_kinematics.errors import InputError
from par4_kinematics.files import read_yaml
from par4_kinematics.ros.convert import joint_values, time_ns
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.workspace import home_pose
from par4_sim.cell.cell import CLOCK, COMPOSITIONS, NodePart, Session, ToolPart
from par4_sim.cell.running_cell import RunningCell, command_line_of, run_session, running_cell
from par4_sim.choices import POSITION_LAWS
from par4_sim.commands import cell
from par4_sim.description.robot_tree import tree_joint_positions
from par4_sim.ros.sample_publisher import PASSIVE_PERIOD_NS
from par4_sim.ros.simulation_parameters import SimulationParameters
from robots import REFERENCE

SOURCES = Path(__file__).parents[1] / 'src'
LAUNCH_FILES = {path.name.partition('.')[0]: path for path in SOURCES.glob('*/launch/*.launch.py')}
ALL_PARTS = {'motion': 'circle', 'record': 'bag'}


def session_of(name: str, **given: str) -> Session:
    known = {argument.name for argument in COMPOSITIONS[name].arguments}
    return COMPOSITIONS[name].session({key: text for key, text in (ALL_PARTS | given).items()
                                       if key in known})


def names(session: Session) -> list[str]:
    return [part.executable for part in session.nodes]


@pytest.mark.parametrize('name', COMPOSITIONS)
def test_every_part_exists_and_takes_its_parameters(name):
    session = session_of(name)
    parts = [*session.nodes, *([session.then] if session.then else [])]
    assert not any(part.of_ros for part in session.nodes)
    for part in parts:
        assert (part.package, part.executable) in {row[:2] for row in interface.EXECUTABLES}
    for part in session.nodes:
        module = import_module(MODULES[part.executable])
        node, = (value for value in vars(module).values() if isinstance(value, type)
                 and issubclass(value, Par4Node) and value is not Par4Node)
        known = {field.name: type(field.default) for field in dataclasses.fields(node.PARAMETERS)}
        known['use_sim_time'] = bool
        for parameter, value in part.parameters.items():
            assert type(value) is known[parameter], (part.executable, parameter)


@pytest.mark.parametrize('controller', POSITION_LAWS)
def test_a_controller_is_told_what_it_needs(controller):
    parts = {part.executable: part.parameters
             for part in session_of('cell', controller=controller, model='table1_full').nodes}
    drives = SimulationParameters(**{key: value
                                     for key, value in parts['par4_simulation'].items()
                                     if key in ('controller', 'controller_model')})
    assert (drives.law, drives.controller_model) == (controller, 'table1_full')
    looks_ahead = parts['par4_feedforward']['torque_factor'] > 1.0
    assert looks_ahead == (controller == 'predictive')


@pytest.mark.parametrize('name', COMPOSITIONS)
@pytest.mark.parametrize(('argument', 'text'), [
    ('physics_step', '0.001'), ('real_time_factor', '0.63'), ('real_time_factor', '0'),
    ('publish_rate_hz', '250')])
def test_what_a_slow_simulation_proposes_can_be_given_to_it(name, argument, text):
    simulation = session_of(name, **{argument: text}).nodes[0]
    assert simulation.parameters[argument] == float(text)
    default = session_of(name).nodes[0].parameters[argument]
    assert default == getattr(SimulationParameters(), argument)


def test_a_controller_of_positions_in_torque_mode_is_refused():
    assert SimulationParameters(drive_mode='torque').law == 'torque'
    with pytest.raises(InputError, match="'predictive' asked with drive_mode torque"):
        _ = SimulationParameters(drive_mode='torque', controller='predictive').law


def test_a_motion_waits_for_all_that_take_references():
    for name in ('cell', 'recording', 'identification'):
        for record in ('bag', '') if name == 'cell' else ('bag',):
            session = session_of(name, record=record)
            takers = {'par4_simulation', 'par4_feedforward', 'par4_record'} & {*names(session)}
            assert session.player.parameters['listeners'] == len(takers)


def test_a_real_robot_takes_the_place_of_the_simulation():
    session = session_of('recording', simulated='false', namespace='/robot_a')
    assert 'par4_simulation' not in names(session)
    assert not any(part.parameters['use_sim_time'] for part in session.nodes)
    assert session.player.parameters['listeners'] == 3
    assert session.remappings == ()


def test_a_namespace_has_a_clock_of_its_own_and_reaches_every_node():
    assert interface.CLOCK.name == CLOCK
    for given, clock in (({'namespace': 'robot_a'}, '/robot_a/clock'),
                         ({'namespace': 'robot_a', 'clock': '/time'}, '/time')):
        session = session_of('cell', **given)
        for part in session.nodes:
            line = ' '.join(command_line_of(part, session))
            assert f'-r __ns:=/robot_a -r /clock:={clock}' in line
    assert not any('-r' in command_line_of(part, session_of('cell')) for part in session.nodes)


@pytest.mark.parametrize('name', ['2026', 'true', '1e3', "Ann's", 'a: b', '[a', '~', 'a #b'])
def test_texts_reach_a_node_as_texts(name):
    session = session_of('recording', record=name)
    part, = (part for part in session.nodes if part.executable == 'par4_record')
    _, *arguments = command_line_of(part, session)
    context = rclpy.Context()
    rclpy.init(args=arguments, context=context)
    try:
        node = Node('node', context=context, automatically_declare_parameters_from_overrides=True)
        assert node.get_parameter('output').value == name
        assert node.get_parameter('use_sim_time').value is True
        node.destroy_node()
    finally:
        context.try_shutdown()


@pytest.mark.parametrize(('given', 'said'), [
    ({'speed': '1'}, 'argument speed: unknown; known are robot_file'),
    ({'fidelity': 'perfect'}, "argument fidelity: 'perfect' asked; known are accurate, fast"),
    ({'window': 'yes'}, "argument window: 'yes' asked; known are true, false"),
    ({'seed': '1.5'}, "argument seed: expected a whole number, found '1.5'"),
    ({'noise': 'much'}, "argument noise: expected a number, found 'much'"),
])
def test_arguments_that_make_no_sense_are_refused(given, said):
    with pytest.raises(InputError, match=said):
        COMPOSITIONS['cell'].session(given)


@pytest.mark.parametrize(('name', 'given', 'said'), [
    ('recording', {'record': ''}, 'argument record: found an empty text; leave it out for recordi'),
    ('recording', {'noise': ''}, 'argument noise: found an empty text; leave it out for 0.0'),
    ('identification', {'record': 'a', 'output': './a/'}, 'output: ./a/ is the bag of'),
    ('identification', {'output': f'{__file__}/results'},
     'results: results cannot be written there .not a directory.; give another folder as the arg'),
    ('identification', {'output': 'a\0b'}, 'written there .* give another folder as the argument'),
    ('cell', {'namespace': '1abc'}, "argument namespace: '1abc' is no name of ROS; give parts of"),
    ('cell', {'namespace': 'a/b c'}, "argument namespace: 'a/b c' is no name of ROS"),
    ('cell', {'clock': '5x'}, "argument clock: '5x' is no name of ROS"),
    ('cell', {'motion': 'nope'}, 'motion nope: no such file, and not a name .adept, excit'),
    ('cell', {'robot_file': 'nope'}, 'robot_file: nope: no such file, and not a built-in name'),
    ('simulation', {'machine': 'nope'}, 'machine: nope: no such file, and not a built-in name'),
    ('recording', {'model': '/'}, 'argument model: /: is a folder, and not a built-in name .table1')
])
def test_what_cannot_be_is_refused_before_a_node_starts(name, given, said):
    with pytest.raises(InputError, match=said):
        COMPOSITIONS[name].session(given)


def test_an_argument_given_twice_is_refused(monkeypatch, capsys):
    monkeypatch.setattr('sys.argv', ['par4_cell', 'cell', 'motion:=adept', 'motion:=circle'])
    with pytest.raises(SystemExit) as stop:
        cell.main()
    assert stop.value.code == 2
    assert capsys.readouterr().err == (
        "error: argument motion: given twice, as 'adept' and 'circle'; give it once\n")


def test_the_argument_of_launch_files_alone_is_refused_with_the_reason(monkeypatch, capsys):
    monkeypatch.setattr('sys.argv', ['par4_cell', 'cell', 'rviz:=true'])
    with pytest.raises(SystemExit) as stop:
        cell.main()
    assert stop.value.code == 2
    line, = capsys.readouterr().err.splitlines()
    assert line.startswith('error: argument rviz: RViz is no part of this suite, ros2 launch')


@pytest.fixture
def launched(monkeypatch):
    """Return what gives the description of a launch file, with `launch` stood in for."""
    launch_stand_in.install(monkeypatch)
    yield lambda name: runpy.run_path(str(LAUNCH_FILES[name]))['generate_launch_description']()
    sys.modules.pop('par4_sim.ros.launched', None)


def test_every_composition_has_a_launch_file_that_is_installed():
    assert LAUNCH_FILES.keys() == COMPOSITIONS.keys()
    for path in LAUNCH_FILES.values():
        assert f'launch/{path.name}' in (path.parents[1] / 'setup.py').read_text()


@pytest.mark.parametrize('name', COMPOSITIONS)
def test_a_launch_file_starts_the_nodes_of_its_composition(launched, name):
    description = launched(name)
    declared = {argument.given[0]: argument for argument in description.given[0][:-1]}
    known = {argument.name: argument for argument in COMPOSITIONS[name].arguments}
    assert declared.keys() - {'rviz'} == known.keys()
    for argument in known.values():
        assert tuple(declared[argument.name].choices or ()) == argument.allowed
    given = {key: text for key, text in ALL_PARTS.items() if key in known}
    nodes = launch_stand_in.started(description, **given, namespace='robot_a')
    session = session_of(name, namespace='robot_a')
    assert [node.executable for node in nodes] == names(session)
    for node, part in zip(nodes, session.nodes, strict=True):
        assert node.namespace == 'robot_a'
        assert node.remappings == [('/clock', '/robot_a/clock')]
        # a node of a launch that was killed ends by itself
        assert node.additional_env == {'PAR4_RUNNER': str(os.getpid())}
        # a bag `2026` and a description in XML stay texts
        assert node.parameters == [{
            key: launch_stand_in.ParameterValue(value, value_type=str)
            if isinstance(value, str) else value
            for key, value in part.parameters.items() if value != ''}]


def test_rviz_comes_first_because_it_may_be_missing(launched):
    started = launch_stand_in.started(launched('cell'), rviz='true', namespace='robot_a')
    assert [node.executable for node in started][:3] == [
        'rviz2', 'robot_state_publisher', 'par4_simulation']
    assert Path(started[0].arguments[1]).is_file()
    for node in started[:2]:  # the frames of two robots have the same names
        assert {('/clock', '/robot_a/clock'), ('/tf', 'tf'), ('/tf_static', 'tf_static')} <= {
            *node.remappings}


def frames_part(name: str, **given: str) -> NodePart:
    """Return the node of ROS in a session that publishes frames."""
    part, = (part for part in session_of(name, tf='true', **given).nodes if part.of_ros)
    return part


@pytest.mark.parametrize('name', ['simulation', 'cell'])
def test_frames_are_published_where_they_are_asked_for(name):
    assert not any(part.of_ros for part in session_of(name).nodes)
    part = frames_part(name)
    assert (part.package, part.executable) == ('robot_state_publisher', 'robot_state_publisher')
    # faster than the messages with passive joints, so that it takes each of them
    assert 1e9 / part.parameters['publish_frequency'] < PASSIVE_PERIOD_NS
    joints = {joint.get('name') for joint in ElementTree.fromstring(
        part.parameters['robot_description']).findall('joint')}
    assert joints == tree_joint_positions(REFERENCE.geometry, home_pose(REFERENCE)).keys()
    names_with, names_without = (names(session_of(name, tf=tf)) for tf in ('true', 'false'))
    assert names_with == ['robot_state_publisher', *names_without]


def test_frames_come_of_ros_alone():
    with (pytest.raises(InputError, match='robot_state_publisher: not found .* install package'),
          running_cell(session_of('cell', tf='true'))):
        pass


@pytest.fixture
def of_ros(tmp_path, monkeypatch):
    """Return the file into which a stand-in for robot_state_publisher writes how it was started."""
    path = tmp_path / 'lib' / 'robot_state_publisher' / 'robot_state_publisher'
    path.parent.mkdir(parents=True)
    path.write_text(f"""#!{sys.executable}
import json, signal, sys
blocked = [*map(int, signal.pthread_sigmask(signal.SIG_BLOCK, ()))]
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
with open({str(tmp_path / 'started.tmp')!r}, 'w') as file:
    json.dump([blocked, sys.argv[1:]], file)
import os
os.rename({str(tmp_path / 'started.tmp')!r}, {str(tmp_path / 'started')!r})
signal.sigwait([signal.SIGINT])
""")
    path.chmod(0o755)
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    return tmp_path / 'started'


def test_a_node_of_ros_is_started_with_the_description_and_heeds_signals(of_ros, bench):
    """It does not unblock what this project's nodes are started with."""
    session = session_of('simulation', namespace='robot_a', tf='true')
    part, _ = session.nodes
    session = dataclasses.replace(session, nodes=(part,))
    with running_cell(session, bench.folder / 'nodes.log') as cell:
        bench.wait(of_ros.exists, 'its start')
        blocked, arguments = json.loads(of_ros.read_text())
    assert blocked == []
    process, = (process for _, process in cell.processes)
    assert process.returncode == 0
    context = rclpy.Context()
    rclpy.init(args=['node', *arguments], context=context)
    try:
        node = Node('node', context=context, automatically_declare_parameters_from_overrides=True)
        told = node.get_parameter('robot_description').value
        assert node.get_parameter('publish_frequency').value == part.parameters['publish_frequency']
        assert told.split() == part.parameters['robot_description'].split()
        assert node.resolve_topic_name('/tf') == '/robot_a/tf'
        assert node.resolve_topic_name('robot_description') == '/robot_a/node/robot_description'
        assert node.resolve_topic_name('/clock') == '/robot_a/clock'
        node.destroy_node()
    finally:
        context.try_shutdown()


@pytest.mark.usefixtures('of_ros')
def test_a_node_of_ros_starts_where_nothing_can_end_it_with_a_killed_cell(monkeypatch):
    monkeypatch.setattr('par4_sim.cell.running_cell.END_WITH_US', ('no-such-program', '--'))
    program, *_ = command_line_of(frames_part('simulation'), session_of('simulation', tf='true'))
    assert Path(program).name == 'robot_state_publisher'


@pytest.mark.skipif(shutil.which('setpriv') is None, reason='needs setpriv of util-linux, which '
                    'every Debian and Ubuntu has; without it the node goes on, see workstation.md')
def test_a_node_of_ros_ends_with_a_cell_that_is_killed(of_ros, bench):
    code = """
import dataclasses, signal, sys
from pathlib import Path
from par4_sim.cell.cell import COMPOSITIONS
from par4_sim.cell.running_cell import running_cell
session = COMPOSITIONS['simulation'].session({'tf': 'true'})
part, _ = session.nodes
with running_cell(dataclasses.replace(session, nodes=(part,)), Path(sys.argv[1])) as cell:
    print(cell.processes[0][1].pid, flush=True)
    signal.pause()
"""
    with subprocess.Popen([sys.executable, '-c', code, str(bench.folder / 'nodes.log')],
                          stdout=subprocess.PIPE, text=True) as killed:
        end = os.pidfd_open(int(killed.stdout.readline()))
        try:
            bench.wait(of_ros.exists, 'its start')
            killed.kill()
            bench.wait(lambda: select.select([end], (), (), 0.0)[0], 'its end')
        finally:
            os.close(end)


def ends(node, code: int) -> list:
    return node.on_exit(SimpleNamespace(returncode=code), None)


@pytest.mark.parametrize('name', COMPOSITIONS)
@pytest.mark.parametrize('code', [0, 2, -9])
def test_a_part_that_ends_too_early_ends_all(launched, name, code):
    known = {argument.name for argument in COMPOSITIONS[name].arguments}
    given = {key: text for key, text in ALL_PARTS.items() if key in known}
    count = len(session_of(name).nodes)
    for index in range(count):
        node = launch_stand_in.started(launched(name), **given)[index]
        if node.executable != 'par4_motion' or code != 0:
            action, = ends(node, code)
            if code == 0:
                assert launch_stand_in.kinds([action]) == ['Shutdown']
                continue
            # which `launch` answers with exit code 1 and this line; a shutdown ends with 0
            with pytest.raises(RuntimeError, match=f'{node.executable} .* exit code {code}'):
                action.function(None)
            assert ends(node, code) == []
            # nor does a motion that is interrupted then have played
            player = launch_stand_in.started(launched(name), **given)
            ends(player[index], code)
            assert all(ends(other, 0) == [] for other in player)


def test_a_played_motion_ends_all_and_then_the_model_is_identified(launched):
    nodes = {node.executable: node for node in
             launch_stand_in.started(launched('recording'), record='bag')}
    assert launch_stand_in.kinds(ends(nodes['par4_motion'], 0)) == ['Shutdown']
    nodes = {node.executable: node for node in
             launch_stand_in.started(launched('identification'), record='bag', output='there')}
    signals = ends(nodes.pop('par4_motion'), 0)
    told = [event.event.process_matcher.given[0] for event in signals]
    assert told == list(nodes.values())
    *others, last = nodes.values()
    assert [ends(node, 0) for node in others] == [[], []]
    tool, = ends(last, 0)
    assert tool.cmd[1:] == ['bag', '--robot', 'reference', '--rigid-body', 'paper', '--output',
                            'there']
    assert launch_stand_in.kinds(ends(tool, 0)) == ['Shutdown']
    with pytest.raises(RuntimeError, match='par4_identify has ended with exit code 2'):
        ends(tool, 2)[0].function(None)


def test_a_misspelt_argument_of_a_launch_is_told(launched):
    first, *nodes = launch_stand_in.started(launched('cell'), motoin='adept', of_another_file='1')
    assert first.msg == 'argument motoin is unknown and ignored; did you mean motion?'
    assert launch_stand_in.kinds(nodes) == ['Node'] * 3


def test_a_recorder_that_fails_at_the_end_leaves_nothing_to_identify(launched):
    nodes = launch_stand_in.started(launched('identification'))
    ends(nodes.pop(), 0)
    assert launch_stand_in.kinds(ends(nodes[-1], 2)) == ['OpaqueFunction']


def test_a_recording_by_processes_and_what_follows_it(bench, monkeypatch, capfd):
    for name, value in bench.environment.items():
        monkeypatch.setenv(name, value)
    session = session_of('recording', namespace='robot_a', fidelity='exact', duration='1.0',
                         record=str(bench.folder / 'bag'))
    follows = ToolPart('par4_identification', 'par4_record', (
        '--repair', str(bench.folder / 'bag'), '--output', str(bench.folder / 'copy')))
    log = bench.folder / 'nodes.log'
    assert run_session(dataclasses.replace(session, then=follows), log) == 0, log.read_text()
    assert f'{bench.folder / "copy"}: ' in capfd.readouterr().out
    assert 'Traceback' not in log.read_text()
    recorded = read_log(bench.folder / 'copy', REFERENCE)
    assert recorded.accounts.namespace == '/robot_a'
    # the recorder was there before the motion began
    moved = abs(recorded.q - recorded.q[0])
    assert moved[:100].max() < 1e-3
    assert moved.max() > 0.1


def test_when_a_part_is_killed_all_end_and_it_is_said_which(bench):
    session = COMPOSITIONS['cell'].session({'fidelity': 'exact'})
    log = bench.folder / 'nodes.log'
    processes = []
    with (pytest.raises(InputError, match='par4_feedforward has ended with exit code -9'),
          running_cell(session, log, bench.environment) as cell):
        processes = [process for _, process in cell.processes]
        bench.wait(lambda: log.read_text().count('robot reference') == 2, 'two nodes that run')
        assert not cell.played()
        processes[1].kill()
        bench.wait(cell.played, 'the end of all')
    assert len(processes) == 3
    assert [process.returncode for process in processes] == [0, -9, 0]


def still_runs(process: int) -> bool:
    """Return whether a process of that number is there and has not ended."""
    try:
        told = Path(f'/proc/{process}/stat').read_text()
    except OSError:
        return False
    return told.rpartition(')')[2].split()[0] != 'Z'


def test_when_who_runs_them_is_killed_the_nodes_brake_and_end(bench):
    states = bench.listen(interface.JOINT_STATES)
    log = bench.folder / 'nodes.log'
    runner = subprocess.Popen(
        [sys.executable, '-m', 'par4_sim.commands.cell', 'cell', 'fidelity:=exact',
         'motion:=circle', 'duration:=60.0', f'record:={bench.folder / "bag"}',
         '--log', str(log)], env=bench.environment)
    bench.children.append(runner)
    bench.wait(lambda: states and abs(joint_values(states[-1], 'position') - HOME_Q).max() > 0.1,
               'a motion')
    nodes = [int(number) for number in Path(
        f'/proc/{runner.pid}/task/{runner.pid}/children').read_text().split()]
    runner.kill()
    bench.wait(lambda: not any(map(still_runs, nodes)), 'the end of all nodes')
    bench.drain(states)
    said = log.read_text()
    assert len(nodes) == said.count('the process that runs this node has ended') == 5
    assert 'Traceback' not in said
    assert 'ended in motion' not in said
    speeds = np.abs([joint_values(message, 'velocity') for message in states]).max(axis=1)
    assert speeds.max() > 0.3
    assert speeds[-1] < 0.05, 'it was left in motion'
    recorded = read_log(bench.folder / 'bag', REFERENCE)
    assert not recorded.accounts.unreadable


def test_an_interrupt_of_all_at_once_leaves_no_robot_in_motion_and_a_whole_bag(bench):
    """As Ctrl-C below `ros2 launch`: every node is interrupted at the same time."""
    states, voltages = bench.listen(interface.JOINT_STATES), bench.listen(
        interface.AMPLIFIER_VOLTAGE)
    session = session_of('cell', fidelity='exact', motion='excitation', duration='30.0',
                         record=str(bench.folder / 'bag'))
    log = bench.folder / 'nodes.log'
    with running_cell(session, log, bench.environment) as cell:
        bench.wait(lambda: states and abs(joint_values(states[-1], 'position') - HOME_Q).max()
                   > 0.2, 'a motion')  # the bag may end before what was heard last
        asked_ns = time_ns(states[-1].header.stamp)
        for _, process in cell.processes:
            process.send_signal(signal.SIGINT)
        for _, process in cell.processes:
            bench.ended(process)
        assert [process.returncode for _, process in cell.processes] == [0] * 5, log.read_text()
    bench.drain(states)
    said = log.read_text()
    assert 'Traceback' not in said
    assert 'error' not in said.lower(), said
    speeds = np.abs([joint_values(message, 'velocity') for message in states]).max(axis=1)
    assert speeds.max() > 0.3
    assert speeds[-1] < 0.05, 'it was left in motion'
    assert torque_steps(voltages, asked_ns).max() < 15.0
    # the bag ends in motion and is whole: nothing is to be mended
    recorded = read_log(bench.folder / 'bag', REFERENCE)
    assert not recorded.accounts.unreadable
    assert np.abs(recorded.q - recorded.q[0]).max() > 0.1
    whole = read_yaml(bench.folder / 'bag' / 'metadata.yaml')['rosbag2_bagfile_information']
    assert f'bag: {whole["message_count"]} messages' in said


def test_the_motion_ends_before_the_robot_that_it_brakes(tmp_path):
    session = COMPOSITIONS['cell'].session({'motion': 'adept'})
    cell, told = RunningCell(session, tmp_path / 'log'), []
    for part in session.nodes:
        process = mock.Mock(poll=mock.Mock(return_value=None))
        process.send_signal.side_effect = lambda _, name=part.executable: (
            told.append(name), os.kill(os.getpid(), signal.SIGINT))  # another Ctrl-C
        process.wait.side_effect = lambda name=part.executable, **_: told.append(f'{name} ended')
        cell.processes.append((part, process))
    with pytest.raises(KeyboardInterrupt):
        cell.end()
    assert told[:2] == ['par4_motion', 'par4_motion ended']
    assert sorted(told[2:5]) == ['par4_feedforward', 'par4_kinematics', 'par4_simulation']
    assert len(told) == 8


def test_nothing_starts_where_an_executable_is_missing(tmp_path):
    missing = Session((NodePart('par4_sim', 'par4_simulation', {}),
                       NodePart('par4_sim', 'par4_nowhere', {})))
    cell = running_cell(missing, tmp_path / 'log')
    with pytest.raises(InputError, match='par4_nowhere: not found'), cell:
        pytest.fail('it started')
    assert not (tmp_path / 'log').exists()
