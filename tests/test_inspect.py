"""`par4_bag --inspect`: what a bag holds, and whether its verdicts are what the tools then do."""

from __future__ import annotations

import json
import shutil
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from test_commands import run

from par4_dynamics.model_from_file import read_model
from par4_identification.commands import bag as bag_command
from par4_identification.commands import repair
from par4_identification.commands.inspect import inspect
from par4_identification.fitting.identification import identify
from par4_identification.inspection.fitness import fitness_of
from par4_identification.logs.log import Log
from par4_identification.logs.read_log import read_log
from par4_identification.setup_check.check import check_setup
from par4_kinematics.errors import InputError
from par4_kinematics.interface import (
    DIAGNOSTICS,
    PLATFORM_POSE,
    ROBOT_DESCRIPTION,
    SHOWN_TOPICS,
)
from par4_kinematics.motion_file import named_motion
from par4_kinematics.robot import Axis
from par4_sim.bags.bag_writer import BagWriter
from par4_sim.cell.layouts import absolute
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import build_simulation
from robots import REFERENCE

DATE = 1_780_000_000 * 10 ** 9


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Return a folder with bags of a motion, of rest, of another topic, and cut-off ones."""
    folder = tmp_path_factory.mktemp('bags')
    model = read_model('table1', REFERENCE)
    motion = named_motion('excitation', REFERENCE, 6.0)
    rest = {name: np.zeros_like(motion.q) for name in ('qd', 'qdd', 'xd', 'xdd')}
    still = replace(motion, q=np.tile(motion.q[0], (len(motion.t), 1)),
                    x=np.tile(motion.x[0], (len(motion.t), 1)), **rest)
    for name, played, storage, date in (('whole', motion, 'mcap', DATE),
                                        ('still', still, 'mcap', 0),
                                        ('plain', motion, 'sqlite3', 0)):
        simulation = build_simulation(REFERENCE, model, 'exact', 4e-3, seed=1, torque_noise=0.05)
        simulate_to_bag(simulation, played, REFERENCE, folder / name, None, storage,
                        lambda _: None, date)
    with BagWriter(folder / 'gripper') as bag:
        for row in range(200):
            bag.write_joint_state('/gripper', DATE + row * 10_000_000, ['finger'], [0.01 * row])
    for name in ('whole', 'plain'):
        shutil.copytree(folder / name, folder / f'cut_{name}')
        file, = (path for path in (folder / f'cut_{name}').iterdir() if path.suffix != '.yaml')
        file.write_bytes(file.read_bytes()[:file.stat().st_size * 3 // 4])
        (folder / f'cut_{name}' / 'metadata.yaml').unlink()
    return folder


def inspected(bag, *options):
    told = run(bag_command, '--inspect', bag, '--json', *options)
    assert (told.code, told.err) == (0, '')
    found = json.loads(told.out)
    return found, {item['tool']: item['use'] for item in found['fitness']}


def test_topics_rates_gaps_and_joints(bags, tmp_path):
    found, _ = inspected(bags / 'whole')
    topics = {topic['name']: topic for topic in found['topics']}
    assert topics['/joint_states']['rate'] == pytest.approx(250.0)
    assert topics['/joint_states']['gaps'] == 0
    assert topics['/reference']['by'] == 'receipt'
    assert [joint['name'] for joint in found['joints']] == list(REFERENCE.joint_names)
    motion = named_motion('excitation', REFERENCE, 6.0)
    for column, joint in enumerate(found['joints']):
        # the loops alone overshoot by some hundredths
        assert joint['lowest'] == pytest.approx(motion.q[:, column].min(), abs=0.05)
        assert joint['highest'] == pytest.approx(motion.q[:, column].max(), abs=0.05)
        assert found['motion'][column]['peak_speed'] == pytest.approx(
            np.abs(motion.qd[:, column]).max(), rel=0.25)
    with BagWriter(tmp_path / 'gaps') as bag:
        for row in (*range(100), *range(150, 300), *range(340, 400)):
            bag.write_joint_state('/joint_states', DATE + row * 10_000_000,
                                  (*REFERENCE.joint_names, 'finger'), np.full(5, 1e-3 * row))
    found, uses = inspected(tmp_path / 'gaps')
    topic, = found['topics']
    assert (topic['messages'], topic['gaps']) == (310, 2)
    assert topic['longest_gap'] == pytest.approx(0.51)
    assert 'finger' in {joint['name'] for joint in found['joints']}
    assert set(uses.values()) == {'no'}
    assert 'no torque' in found['fitness'][0]['reason']


def test_a_gripper_between_the_joint_states_makes_no_gaps(tmp_path):
    """Its stamps were of another clock: there were gaps of 1.8e9 s that the recorder had not."""
    with BagWriter(tmp_path / 'bag') as bag:
        for row in range(400):
            time = DATE + row * 10_000_000
            bag.write_joint_state('/joint_states', time, REFERENCE.joint_names,
                                  np.full(4, 1e-3 * row))
            if row % 2:
                bag.write_joint_state('/joint_states', row * 10_000_000, ['finger'], [0.01],
                                      received=time + 1)
    found, _ = inspected(tmp_path / 'bag')
    topic, = found['topics']
    assert (topic['messages'], topic['gaps']) == (600, 0)
    assert topic['rate'] == pytest.approx(100.0)
    assert topic['longest_gap'] == 0.0


def test_verdicts_are_what_the_tools_do(bags):
    for name, able in (('whole', True), ('still', False)):
        _, uses = inspected(bags / name)
        assert (uses['identify'] == 'yes') == (uses['diagnose'] == 'yes') == able
        log = read_log(bags / name, REFERENCE)
        with nullcontext() if able else pytest.raises(InputError):
            identify([log], REFERENCE)
    _, uses = inspected(bags / 'whole')
    assert (uses['validate'], uses['trend'], uses['monitor']) == ('yes', 'yes', 'weakly')
    assert inspected(bags / 'plain')[1]['trend'] == 'no', 'it has no date'


@pytest.mark.parametrize('name', ['cut_whole', 'cut_plain'])
def test_of_a_bag_that_is_cut_off_it_tells_what_can_be_recovered(bags, name):
    before = sorted(path.name for path in (bags / name).iterdir())
    found, uses = inspected(bags / name)
    assert 'run par4_record --repair' in found['cut_off']
    assert found['bag'] == str(bags / name)
    whole, _ = inspected(bags / name.removeprefix('cut_'))
    assert 2.0 < found['duration'] < whole['duration']
    assert uses['identify'] != 'no'
    assert sorted(path.name for path in (bags / name).iterdir()) == before


def test_a_bag_without_a_robot_is_shown_and_of_no_use(bags):
    found, uses = inspected(bags / 'gripper')
    assert [topic['name'] for topic in found['topics']] == ['/gripper']
    assert set(uses.values()) == {'no'}
    assert found['fitness'][0]['reason'].startswith('no joint_states')


def test_topics_that_are_there_to_be_shown_are_listed_and_change_nothing(bags, tmp_path):
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    stamp = types['builtin_interfaces/msg/Time'](0, 0)
    header = types['std_msgs/msg/Header'](stamp, 'base')
    pose = types['geometry_msgs/msg/Pose'](
        types['geometry_msgs/msg/Point'](0.0, 0.0, 0.0),
        types['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0))
    shown = {PLATFORM_POSE: types[PLATFORM_POSE.type](header, pose),
             ROBOT_DESCRIPTION: types[ROBOT_DESCRIPTION.type]('<robot/>'),
             DIAGNOSTICS: types[DIAGNOSTICS.type](header, [])}
    assert shown.keys() == {*SHOWN_TOPICS}
    with Reader(bags / 'whole') as reader, BagWriter(tmp_path / 'bag') as bag:
        for connection, received, data in reader.messages():
            bag.write_raw(connection.topic, connection.msgtype, received, data)
            for topic, message in shown.items():
                bag.write_raw(absolute(topic), topic.type, received,
                              store.serialize_cdr(message, topic.type))
    (found, uses), (bare, uses_bare) = (inspected(path) for path in (tmp_path / 'bag',
                                                                     bags / 'whole'))
    extra = {topic['name'] for topic in found['topics']} - {
        topic['name'] for topic in bare['topics']}
    assert extra == {absolute(topic) for topic in SHOWN_TOPICS}
    assert uses == uses_bare
    assert found | {'bag': '', 'topics': ''} == bare | {'bag': '', 'topics': ''}
    logs = [read_log(path, REFERENCE) for path in (tmp_path / 'bag', bags / 'whole')]
    np.testing.assert_array_equal(logs[0].q, logs[1].q)


def test_it_is_told_in_tables_and_a_line_a_tool(bags):
    told = run(bag_command, '--inspect', bags / 'whole')
    assert (told.code, told.err) == (0, '')
    assert max(map(len, told.out.splitlines()[:14])) <= 80 + len(str(bags))
    for heading in ('from, rad', 'to, rad', 'speed, rad/s'):
        assert heading in told.out
    for tool in ('identify: yes, ', 'validate: yes, ', 'diagnose: yes, ', 'trend: yes, ',
                 'monitor: weakly, '):
        assert sum(line.startswith(tool) for line in told.out.splitlines()) == 1, tool


def test_it_has_a_help_of_its_own_and_is_listed_in_that_of_the_command():
    own = run(bag_command, '--inspect', '--help')
    assert (own.code, own.err) == (0, '')
    assert 'bag to look at; it stays as it is' in own.out
    common = run(bag_command, '--help').out
    for option in inspect.params:
        assert option.opts[0] in common, option.name
    assert 'bag that was cut off; it stays as it is' in run(repair, '--repair', '--help').out


@pytest.mark.parametrize('content', [None, b'', b'schema: par4/robot/1'])
def test_what_is_no_bag_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / 'bag.mcap'
    if content is not None:
        path.write_bytes(content)
    told = run(bag_command, '--inspect', path)
    assert (told.code, told.out) == (2, '')
    assert told.err.startswith('error: ')
    assert told.err.count('\n') == 1


def test_a_bag_with_a_stretch_too_short_to_be_watched_is_judged_by_its_others(bags):
    log = read_log(bags / 'whole', REFERENCE)
    cut = replace(log, segments=(slice(0, 375), slice(375, len(log.t))))  # 1.5 s and the rest
    uses = {item.tool: item.use for item in fitness_of(check_setup([cut], REFERENCE))[0]}
    assert uses['monitor'] == 'weakly'


def uses_of_axis(q, tau, period):
    """Return tool -> use of the log of an axis."""
    log = Log('axis', ('motor',), 10 ** 18, period, period * np.arange(len(q)), q[:, None],
              tau[:, None], (slice(0, len(q)),), None, None)
    axis = Axis(schema='par4/axis/1', name='axis', joint='motor', kind='revolute', gain=1.0)
    return {item.tool: item.use for item in fitness_of(check_setup([log], axis))[0]}


def test_a_slow_axis_is_judged_by_the_filters_that_suit_it():
    """At 20 Hz, of which par4_identify and par4_diagnose make good use."""
    t, random = 0.05 * np.arange(2400), np.random.default_rng(1)
    rates = 2.0 * np.pi * np.array((0.021, 0.047, 0.083))
    q = 2.0 * np.sin(rates * t[:, None]).sum(axis=1)
    qd = 2.0 * (rates * np.cos(rates * t[:, None])).sum(axis=1)
    qdd = -2.0 * (rates ** 2 * np.sin(rates * t[:, None])).sum(axis=1)
    uses = uses_of_axis(q, 0.8 * qdd + 2.0 * np.sign(qd) + 1.5 * qd + random.normal(
        0.0, 0.01, len(t)), 0.05)
    assert (uses['identify'], uses['diagnose']) == ('yes', 'yes')


@pytest.mark.parametrize(('speeds', 'use'), [(12, 'yes'), (4, 'no')])
def test_steady_speeds_are_of_use_if_there_are_enough(speeds, use):
    random = np.random.default_rng(1)
    levels = np.concatenate([side * np.geomspace(0.5, 8.0, speeds // 2) for side in (1.0, -1.0)])
    speed = np.repeat(levels, 100)
    uses = uses_of_axis(0.1 * np.cumsum(speed), 2.0 * np.sign(speed) + 0.1 * speed + random.normal(
        0.0, 0.01, len(speed)), 0.1)
    assert (uses['identify'], uses['diagnose'], uses['validate']) == (use, use, 'no')
