"""The nodes as users run them: processes, topics, services, signals. One domain a test."""

from __future__ import annotations

import resource
import shutil
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from node_bench import (
    AWAY_Q,
    DEADLINE,
    EVERY_MILLISECOND,
    GAIN,
    HOME_Q,
    MILLISECOND,
    MODULES,
    ROBOT,
    SIMULATED,
    Bench,
    Simulated,
    joint_state,
    quintic_motion,
    reference_message,
    torque_of,
    torque_steps,
)
from par4_dynamics.model_file import EffectEntry, read_model_file, write_model_file
from par4_dynamics.model_from_file import read_model
from par4_identification.logs.bag import read_bag, recorded_topics
from par4_identification.logs.bag_repair import repair_bag
from par4_kinematics.adept import adept_motion
from par4_kinematics.errors import InputError
from par4_kinematics.files import read_yaml, resolve_builtin, write_yaml
from par4_kinematics.interface import (
    AMPLIFIER_VOLTAGE,
    CLOCK,
    DIAGNOSTICS,
    FEEDFORWARD_TORQUE,
    JOINT_STATES,
    PLATFORM_POSE,
    REFERENCE,
    ROBOT_DESCRIPTION,
    SHOWN_TOPICS,
    TRUE_POSE,
    TRUE_TORQUE,
    Topic,
)
from par4_kinematics.limits import limits_not_given
from par4_kinematics.motion import motion_of_joints
from par4_kinematics.motion_file import MOTION_SCHEMA, named_motion
from par4_kinematics.position import forward_kinematics, inverse_kinematics
from par4_kinematics.robot import JOINT_NAMES, read_robot
from par4_kinematics.ros.convert import (
    joint_values,
    read_trajectory,
    time_ns,
    write_joint_state,
    write_time,
)
from par4_kinematics.ros.parameters import tell_files_of_others
from par4_kinematics.ros.qos import message_type, qos_of
from par4_kinematics.stamps import SECOND
from par4_kinematics.workspace import home_pose
from par4_sim.description.robot_tree import tree_joint_positions
from par4_sim.ros.sample_publisher import SamplePublisher
from par4_sim.tracking.metrics import tracking_of
from par4_sim.tracking.run import feedforward_of, record_run
from robots import random_poses

ASKED = Duration(seconds=0.1)
"""How long the middleware is asked at a time for what has been received."""


def tool_angle(pose) -> float:
    return 2.0 * np.arctan2(pose.orientation.z, pose.orientation.w)


def test_kinematics_publishes_the_forward_kinematics_of_any_order_of_joints(bench):
    bench.start('par4_kinematics')
    poses = bench.listen(PLATFORM_POSE)
    states = bench.publisher(JOINT_STATES)
    bench.until_answered(lambda: states.publish(joint_state(HOME_Q)), poses)
    random = np.random.default_rng(1)
    q = inverse_kinematics(ROBOT.geometry, random_poses(ROBOT, 40, seed=2, share=0.5))
    poses.clear()
    for index, row in enumerate(q):
        names = random.permutation((*JOINT_NAMES, 'passive_0', 'passive_1')).tolist()
        states.publish(joint_state(row, SECOND + index, names))
    bench.wait(lambda: poses and time_ns(poses[-1].header.stamp) == SECOND + len(q) - 1,
               'the last pose')
    received = {time_ns(message.header.stamp) - SECOND: message.pose for message in poses}
    found = np.array([(received[index].position.x, received[index].position.y,
                       received[index].position.z,
                       tool_angle(received[index]) / ROBOT.geometry.rotation_amplification)
                      for index in range(len(q))])
    np.testing.assert_allclose(found, forward_kinematics(ROBOT.geometry, q), atol=1e-9)


def test_bad_joint_states_are_dropped_and_counted(bench):
    child = bench.start('par4_kinematics')
    poses, diagnostics = bench.listen(PLATFORM_POSE), bench.listen(DIAGNOSTICS)
    states = bench.publisher(JOINT_STATES)
    bench.until_answered(lambda: states.publish(joint_state(HOME_Q)), poses)
    bench.wait(lambda: diagnostics, 'diagnostics')
    poses.clear()
    short = joint_state(HOME_Q)
    short.position = short.position[:3]
    for bad in (joint_state(HOME_Q, names=JOINT_NAMES[1:]), short,
                joint_state((*HOME_Q[:3], np.nan)), joint_state((1.5, -1.5, 1.5, -1.5))):
        states.publish(bad)
    states.publish(joint_state(HOME_Q, 7 * SECOND))
    bench.wait(lambda: any(time_ns(pose.header.stamp) == 7 * SECOND for pose in poses),
               'the pose of a good message behind bad ones')
    bench.wait(lambda: bench.counts(diagnostics, 'par4_kinematics') == {
        'rejected_messages': 3, 'unreachable_poses': 1}, 'the counts')
    assert {time_ns(pose.header.stamp) for pose in poses} <= {SECOND, 7 * SECOND}
    assert child.poll() is None
    assert 'Traceback' not in bench.said()
    assert 'missing joint arm_joint_0' in bench.said()


def test_a_clock_before_zero_is_refused_and_ends_no_node(bench):
    """rclpy itself raises an error where it takes one."""
    diagnostics, nodes = bench.listen(DIAGNOSTICS), ('par4_kinematics', 'par4_feedforward')
    children = [bench.start(node, **SIMULATED) for node in nodes]
    clocks, clock = bench.publisher(CLOCK, len(nodes)), message_type(CLOCK)()
    clock.clock.sec = -5

    def told_or_ended() -> bool:
        clocks.publish(clock)
        return (any(child.poll() is not None for child in children)
                or all('rejected_messages' in bench.counts(diagnostics, node) for node in nodes))

    bench.wait(told_or_ended, 'refusals of the clock')
    assert [child.poll() for child in children] == [None] * len(nodes)
    assert '/clock: -5 s; a clock begins at 0' in bench.said()


def test_a_node_keeps_the_clock_that_it_was_started_with(bench):
    """By another one a motion would be over at once, while the robot goes on."""
    child = bench.start('par4_kinematics', **SIMULATED)
    client = bench.node.create_client(SetParameters, 'par4_kinematics/set_parameters')
    bench.wait(client.service_is_ready, 'the parameters of a node')
    answers = []
    for value in (False, True):
        asked = SetParameters.Request(
            parameters=[Parameter('use_sim_time', value=value).to_parameter_msg()])
        answer = client.call_async(asked)
        bench.wait(answer.done, 'an answer')
        answers.append(answer.result().results[0])
    assert [answer.successful for answer in answers] == [False, True]
    assert 'start it anew' in answers[0].reason
    assert child.poll() is None


@pytest.mark.parametrize('model', ['table1', 'table1_full'])
def test_feedforward_is_the_torque_of_the_model(bench, model):
    bench.start('par4_feedforward', model_file=model)
    answers = bench.listen(FEEDFORWARD_TORQUE)
    references = bench.publisher(REFERENCE)
    motion = quintic_motion(AWAY_Q)
    message = reference_message(motion, 3 * SECOND + 5)
    message.joint_names = [*JOINT_NAMES[::-1], 'tool']
    for point in message.points:
        for field in ('positions', 'velocities', 'accelerations'):
            setattr(point, field, [*list(getattr(point, field))[::-1], 0.5])
    answer = bench.until_answered(lambda: references.publish(message), answers)
    received = read_trajectory(answer, ('positions', 'effort'))
    np.testing.assert_allclose(received.effort, torque_of(model, motion), rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(received.q, motion.q)
    assert answer.header.stamp == message.header.stamp
    assert [point.time_from_start for point in answer.points] == [
        point.time_from_start for point in message.points]


def test_feedforward_of_a_motion_point_by_point_is_that_of_the_motion(bench):
    path = bench.folder / 'model.yaml'
    content = read_model_file('table1')
    write_model_file(path, content.model_copy(update={'effects': (
        EffectEntry(effect='presliding', parameters={'distance': {'value': 5e-3}}),
        EffectEntry(effect='friction_drift', parameters={
            'drop': {'value': 0.3}, 'time_constant': {'value': 0.2}}))}))
    bench.start('par4_feedforward', model_file=path)
    answers = bench.listen(FEEDFORWARD_TORQUE)
    references = bench.publisher(REFERENCE)
    motion = quintic_motion(HOME_Q + 0.1, period=1e-2)
    whole = reference_message(motion, 0)  # without a stamp: nothing of it is remembered
    bench.until_answered(lambda: references.publish(whole), answers)
    for point, t in zip(whole.points, motion.t):
        message = reference_message(motion, 10 * SECOND + round(t * SECOND))
        point.time_from_start.sec, point.time_from_start.nanosec = 0, 0
        message.points = [point]
        references.publish(message)
    bench.wait(lambda: len({time_ns(answer.header.stamp) for answer in answers}) > len(motion.t),
               'an answer to each point')
    told = {time_ns(answer.header.stamp): read_trajectory(answer, ('effort',)).effort[0]
            for answer in answers}
    np.testing.assert_allclose([told[stamp] for stamp in sorted(told) if stamp],
                               torque_of(path, motion), rtol=0.0, atol=1e-8)
    assert 'actuator_lag' not in bench.said()
    write_model_file(path, content.model_copy(update={'effects': (
        EffectEntry(effect='actuator_lag', parameters={'time_constant': {'value': 2e-3}}),)}))
    assert bench.call('par4_feedforward/reload_model').success
    bench.wait(lambda: f'actuator_lag of {path}: this torque follows from the motion around a '
               f'point' in bench.said(), 'a warning')


def test_feedforward_rejects_what_no_robot_can_do(bench):
    bench.start('par4_feedforward')
    answers, diagnostics = bench.listen(FEEDFORWARD_TORQUE), bench.listen(DIAGNOSTICS)
    references = bench.publisher(REFERENCE)
    motion = quintic_motion(HOME_Q + 0.1)
    good = reference_message(motion, SECOND)
    bench.until_answered(lambda: references.publish(good), answers)
    bench.wait(lambda: diagnostics, 'diagnostics')
    unreachable, not_finite = reference_message(motion, SECOND), reference_message(motion, SECOND)
    unreachable.points[5].positions = [1.5, -0.9, 1.5, -0.9]
    not_finite.points[5].accelerations[2] = np.nan
    for bad in (unreachable, not_finite):
        bad.header.stamp.sec = 50
        references.publish(bad)
    good.header.stamp.sec = 60
    references.publish(good)
    bench.wait(lambda: answers[-1].header.stamp.sec == 60, 'the answer to a good message')
    assert 50 not in {answer.header.stamp.sec for answer in answers}
    bench.wait(lambda: bench.counts(diagnostics, 'par4_feedforward') == {
        'rejected_messages': 1, 'unreachable_poses': 1}, 'the counts')


def test_reload_model_takes_a_good_file_and_keeps_the_old_model_on_a_bad_one(bench):
    path = bench.folder / 'model.yaml'
    content = read_model_file('table1')
    write_model_file(path, content)
    bench.start('par4_feedforward', model_file=path)
    answers = bench.listen(FEEDFORWARD_TORQUE)
    references = bench.publisher(REFERENCE)
    motion = quintic_motion(HOME_Q + 0.1)
    message = reference_message(motion, SECOND)

    def effort() -> np.ndarray:
        answers.clear()
        return read_trajectory(bench.until_answered(
            lambda: references.publish(message), answers), ('effort',)).effort

    before = effort()
    doubled = content.parameters['viscous_friction'].model_copy(update={'value': 4.08})
    write_model_file(path, content.model_copy(
        update={'parameters': content.parameters | {'viscous_friction': doubled}}))
    assert bench.call('par4_feedforward/reload_model').success
    after = torque_of(path, motion)
    bench.wait(lambda: np.allclose(effort(), after, atol=1e-9), 'torques of the new model')
    assert np.abs(after - before).max() > 0.1
    path.write_text('schema: par4/model/1\nparameters: {coulomb: {value: 1}}\n')
    refused = bench.call('par4_feedforward/reload_model')
    assert not refused.success
    assert 'coulomb' in refused.message
    np.testing.assert_allclose(effort(), after, atol=1e-9)


def bad_file(folder: Path, change: str) -> Path:
    """Return the path of a robot or model file with something wrong in it."""
    path = folder / f'{change}.yaml'
    package, name = ('par4_dynamics', 'table1') if 'model' in change else (
        'par4_kinematics', 'reference')
    source = Path(__file__).parents[1] / 'src' / package / package / 'builtin' / f'{name}.yaml'
    content = read_yaml(source)
    if change == 'wrong_schema':
        content['schema'] = 'par4/robot/9'
    elif change == 'negative_mass':
        content['bodies'] = {'rod_mass': -0.04}
    else:
        content['parameters']['platform_mass_1']['value'] = -0.8
    write_yaml(path, content)
    return path


@pytest.mark.parametrize(('node', 'parameter', 'value', 'said'), [
    *((node, 'robot_file', 'nowhere.yaml', 'nowhere.yaml: no such file') for node in (
        'par4_kinematics', 'par4_motion', 'par4_feedforward', 'par4_simulation')),
    ('par4_kinematics', 'robot_file', 'wrong_schema', 'expected schema par4/robot/1'),
    ('par4_simulation', 'robot_file', 'negative_mass', 'bodies.rod_mass'),
    ('par4_feedforward', 'model_file', 'negative_mass_model', 'must not be negative'),
    ('par4_simulation', 'model_file', 'negative_mass_model', 'must not be negative'),
    ('par4_simulation', 'fidelity', 'perfect', 'known are accurate, fast, exact'),
    ('par4_simulation', 'real_time_factor', '-1.0', 'real_time_factor: -1.0 is outside 0 to inf'),
    ('par4_simulation', 'real_time_factor', '1e-300', 'real_time_factor: 1e-300 is less than 0.0'),
    ('par4_simulation', 'real_time_factor', '.inf', 'real_time_factor: inf is no number'),
    ('par4_simulation', 'publish_rate_hz', 'often', "publish_rate_hz: expected a number, found "
                                                    "'often'"),
    *((node, 'seed', 10 ** 17, 'seed: 100000000000000000 is outside 0 to 9007199254740992')
      for node in ('par4_motion', 'par4_simulation')),
    ('par4_monitor', 'learning', 2 ** 53 + 1, 'learning: 9007199254740993 is outside 10 to 9007'),
    ('par4_kinematics', 'use_sim_time', 5, 'use_sim_time: expected true or false, found 5'),
    ('par4_record', 'use_sim_time', 'yes_please', "use_sim_time: expected true or false, found "
                                                  "'yes_please'"),
    ('par4_motion', 'qos_overrides./reference.publisher.depth', 10 ** 14,
     'qos_overrides of reference: not understood; depth is a whole number from 0 to 2^31 - 1'),
    *(('par4_motion', f'qos_overrides./{name}.depth', -1, 'depth is a whole number from 0')
      for name in ('reference.publisher', 'joint_states.subscription')),
    ('par4_motion', 'motion', 'dance', 'motion dance: no such file, and not a name (adept, '
                                       'excitation, circle, action); give one of these'),
    ('par4_record', 'storage', 'tape', 'known are mcap, sqlite3'),
    ('par4_record', 'output', '.', 'exists already'),
])
def test_what_a_node_cannot_start_with_is_said_in_one_line(bench, node, parameter, value, said):
    if value in ('wrong_schema', 'negative_mass', 'negative_mass_model'):
        value = bad_file(bench.folder, value)
    assert bench.ended(bench.start(node, **{parameter: value})) == 2
    line, = (bench.folder / f'{node}_0.txt').read_text().strip().splitlines()
    assert line.startswith('error: ')
    assert said in line


def test_a_motion_file_is_not_told_how_long_it_lasts(bench):
    write_yaml(bench.folder / 'own.yaml', {'schema': MOTION_SCHEMA, 'recipe': {'kind': 'circle'}})
    assert bench.ended(bench.start('par4_motion', motion='own.yaml', duration=5.0)) == 2
    assert bench.said().strip().endswith(
        'error: parameter duration: for adept, excitation, circle, found motion own.yaml, whose '
        'own duration it is; leave it out')


@pytest.mark.parametrize(('node', 'own'), [('par4_motion', {}),
                                           ('par4_simulation', {'fidelity': 'exact'})])
def test_limits_that_a_robot_file_leaves_out_are_told_once(bench, node, own):
    content = read_yaml(resolve_builtin('reference', 'par4_kinematics'))
    del content['limits'], content['drives']['torque_limit']
    write_yaml(bench.folder / 'robot.yaml', content)
    diagnostics = bench.listen(DIAGNOSTICS)
    bench.start(node, robot_file='robot.yaml', **own)
    bench.wait(lambda: diagnostics, 'diagnostics')
    line, = limits_not_given(read_robot(bench.folder / 'robot.yaml'))
    assert bench.said().count(line) == 1
    assert 'drives.torque_limit 200' in line


@pytest.mark.parametrize(('start', 'number'), [(Bench.execute, signal.SIGINT),
                                               (Bench.start, signal.SIGTERM),
                                               (Bench.start, signal.SIGHUP)])
def test_signals_end_every_node_properly(bench, start, number):
    """As a user starts them and as other tests do: a node takes all in the same way."""
    diagnostics = bench.listen(DIAGNOSTICS)
    own = {'par4_simulation': {'fidelity': 'exact'}, 'par4_motion': SIMULATED}
    children = {node: start(bench, node, **own.get(node, {})) for node in MODULES}
    bench.wait(lambda: {message.status[0].name for message in diagnostics} == {
        f'/{node}' for node in MODULES}, 'diagnostics of every node')
    for child in children.values():
        child.send_signal(number)
        child.send_signal(number)  # on Ctrl-C a terminal and ros2 launch send one each
    assert {node: bench.ended(child) for node, child in children.items()} == dict.fromkeys(
        MODULES, 0)
    assert 'Traceback' not in bench.said()


@pytest.mark.parametrize('fidelity', ['exact', 'fast'])
def test_the_simulation_follows_a_reference(bench, fidelity):
    simulated = Simulated(bench, fidelity=fidelity, publish_rate_hz=500.0)
    references, efforts = bench.publisher(REFERENCE), bench.publisher(FEEDFORWARD_TORQUE)
    motion = quintic_motion(AWAY_Q)
    with simulated.standing(reference=1, feedforward_torque=1):
        start_ns = (simulated.now_ns() // SECOND + 2) * SECOND
        effort = torque_of('table1_full', motion)
        efforts.publish(reference_message(motion, start_ns, effort))
        references.publish(reference_message(motion, start_ns))
    end_ns = start_ns + round(motion.duration * SECOND)
    simulated.wait_until(end_ns + SECOND // 2)
    positions = simulated.positions()
    error = np.array([positions[start_ns + round(t * SECOND)] - q
                      for t, q in zip(motion.t, motion.q, strict=True)])
    # the motion spans 0.4 rad; sticking friction is what the feedforward does not know
    assert np.abs(error).max() < 3e-3
    held = positions[max(positions)]
    np.testing.assert_allclose(held, motion.q[-1], atol=1e-3)
    counts = simulated.fresh_counts()
    assert not {'late_points', 'missing_effort', 'rejected_messages'} & counts.keys()


def test_effort_and_voltage_agree_and_the_truth_comes_on_request_only(bench):
    simulated = Simulated(bench, **EVERY_MILLISECOND)
    volts = bench.listen(AMPLIFIER_VOLTAGE)
    clock, description = bench.listen(CLOCK), bench.listen(ROBOT_DESCRIPTION)
    assert TRUE_POSE.name not in simulated.fresh_counts()
    poses = bench.listen(TRUE_POSE, 'par4_simulation/true_pose')
    torques = bench.listen(TRUE_TORQUE, 'par4_simulation/true_torque')
    bench.wait(lambda: poses and torques and clock and description and len(volts) > 200, 'all')
    assert description[0].data.startswith('<')
    efforts = {time_ns(message.header.stamp): joint_values(message, 'effort')
               for message in simulated.states}
    both = [message for message in volts if time_ns(message.header.stamp) in efforts]
    assert both
    for message in both:
        np.testing.assert_allclose(GAIN * joint_values(message, 'effort'),
                                   efforts[time_ns(message.header.stamp)], rtol=1e-12)
    home = poses[-1].pose.position
    np.testing.assert_allclose((home.x, home.y, home.z), home_pose(ROBOT)[:3], atol=1e-4)
    # gravity at rest: what the model says the machine needs to stand at home
    still = motion_of_joints('still', ROBOT.geometry, np.zeros(2), np.tile(HOME_Q, (2, 1)),
                             np.zeros((2, 4)), np.zeros((2, 4)))
    # it may differ from that by no more than what sticks
    sticks = read_model('table1_full', ROBOT).values['coulomb_friction'].max()
    np.testing.assert_allclose(joint_values(torques[-1], 'effort'),
                               torque_of('table1_full', still)[0], atol=sticks)


@pytest.mark.parametrize('publishes', [False, True])
def test_only_a_simulation_that_publishes_a_clock_counts_as_one(publishes):
    """ROS counts who could publish."""
    asked = mock.Mock()
    SamplePublisher(asked, ROBOT, '', publishes)
    topics = {call.args[0] for call in asked.publisher_of.call_args_list}
    assert JOINT_STATES in topics
    assert (CLOCK in topics) == publishes


def test_without_a_clock_a_simulation_publishes_all_else(bench):
    simulated = Simulated(bench, publish_clock='false')
    simulated.wait_until(SECOND // 2)
    assert CLOCK.name not in simulated.fresh_counts()


def test_passive_joints_come_with_a_sample_at_a_lower_rate(bench):
    """After the arms, about 30 times a second, without a second sample of any time."""
    simulated = Simulated(bench, **EVERY_MILLISECOND)
    poses = bench.listen(TRUE_POSE, 'par4_simulation/true_pose')
    motion = quintic_motion(HOME_Q + 0.2)
    references = bench.publisher(REFERENCE)
    with simulated.standing(reference=1):
        references.publish(reference_message(motion, simulated.now_ns() + SECOND // 2))
    bench.wait(lambda: poses and np.abs(joint_values(simulated.states[-1], 'position')
                                        - motion.q[-1]).max() < 1e-3, 'the end of the motion')
    end_ns = simulated.now_ns()
    bench.wait(lambda: time_ns(poses[-1].header.stamp) >= end_ns, 'the pose of each sample')
    stamps = np.array([time_ns(message.header.stamp) for message in simulated.states])
    assert (np.diff(stamps) > 0).all()
    assert all(tuple(message.name)[:4] == JOINT_NAMES for message in simulated.states)
    with_passive = np.array([len(message.name) > 4 for message in simulated.states])
    np.testing.assert_allclose(np.diff(stamps[with_passive]), 33 * MILLISECOND)
    pose_at = {time_ns(message.header.stamp): message.pose for message in poses}
    compared = 0
    for message in np.array(simulated.states)[with_passive]:
        assert len(message.name) == len(message.position) == len(message.velocity) == len(
            message.effort)
        pose = pose_at.get(time_ns(message.header.stamp))
        if pose is not None:
            compared += 1
            x = (pose.position.x, pose.position.y, pose.position.z,
                 tool_angle(pose) / ROBOT.geometry.rotation_amplification)
            expected = tree_joint_positions(ROBOT.geometry, x)
            # the arms as the encoders say
            np.testing.assert_allclose([expected[name] for name in message.name],
                                       message.position, atol=1e-4)
    assert compared > 5


def test_a_window_without_a_screen_is_refused_in_one_line(bench):
    bench.environment.pop('DISPLAY', None)
    assert bench.ended(bench.start('par4_simulation', window='true')) == 2
    said = bench.said()
    assert 'error: window asked, found no screen' in said
    assert 'Traceback' not in said


def test_a_stamp_of_zero_starts_reference_and_torque_together(bench):
    simulated = Simulated(bench)
    references, efforts = bench.publisher(REFERENCE), bench.publisher(FEEDFORWARD_TORQUE)
    motion = quintic_motion(HOME_Q + 0.15)
    with simulated.standing(reference=1, feedforward_torque=1):
        asked_ns = simulated.now_ns()
        references.publish(reference_message(motion, 0))
        efforts.publish(reference_message(motion, 0, torque_of('table1_full', motion)))
    bench.wait(lambda: np.abs(joint_values(simulated.states[-1], 'position')
                              - motion.q[-1]).max() < 1e-3, 'the end of the motion')
    positions = simulated.positions()
    times = np.array(sorted(positions))
    moved = np.array([np.abs(positions[stamp] - HOME_Q).max() for stamp in times]) > 1e-3
    assert times[np.argmax(moved)] >= asked_ns + SECOND // 5
    counts = simulated.fresh_counts()
    assert not {'late_points', 'missing_effort'} & counts.keys()


def test_late_points_and_missing_effort_are_counted(bench):
    simulated = Simulated(bench)
    references = bench.publisher(REFERENCE)
    simulated.wait_until(2 * SECOND)
    motion = quintic_motion(HOME_Q + 0.1)
    with simulated.standing(reference=2):
        references.publish(reference_message(motion, 1))
        start_ns = simulated.now_ns() + SECOND
        references.publish(reference_message(motion, start_ns))
    simulated.wait_until(start_ns + round(motion.duration * SECOND) + SECOND)
    counts = simulated.fresh_counts()
    assert counts['missing_effort'] == counts['late_points'] == len(motion.t)
    # nobody has given a torque yet: that is said once, in words
    assert bench.said().count('no feedforward_torque comes: driven without it') == 1
    assert 'missing_effort' not in bench.said()


def test_a_start_waits_for_its_torque_as_long_as_it_is_told_to(bench):
    simulated = Simulated(bench, feedforward_timeout=2 * DEADLINE)
    references, efforts = bench.publisher(REFERENCE), bench.publisher(FEEDFORWARD_TORQUE)
    motion = quintic_motion(HOME_Q + 0.1)
    with simulated.standing(reference=1):
        start_ns = simulated.now_ns() + SECOND
        references.publish(reference_message(motion, start_ns))
    counts: list[int] = []

    def stands() -> bool:
        counts.append(simulated.fresh_counts()[JOINT_STATES.name])
        return len(counts) > 1 and counts[-1] == counts[-2]

    bench.wait(stands, 'the clock to stand')
    assert simulated.now_ns() <= start_ns
    efforts.publish(reference_message(motion, start_ns, torque_of('table1_full', motion)))
    simulated.wait_until(start_ns + round(motion.duration * SECOND) + SECOND // 2)
    assert 'missing_effort' not in simulated.fresh_counts()


def test_a_machine_that_runs_without_its_torque_is_not_told_to_wait(bench):
    simulated = Simulated(bench, feedforward_timeout=0.001)
    references = bench.publisher(REFERENCE)
    still = motion_of_joints('still', ROBOT.geometry, np.arange(100.0), np.tile(HOME_Q, (100, 1)),
                             np.zeros((100, 4)), np.zeros((100, 4)))
    with simulated.standing(reference=1):
        references.publish(reference_message(still, simulated.now_ns() + SECOND))

    def told() -> bool:
        return any(status.message.startswith(
            'running without feedforward_torque: waited 0.001 s in vain')
            for status in bench.statuses(simulated.diagnostics, 'par4_simulation'))

    bench.wait(told, 'a simulation without torque')
    simulated.wait_until(simulated.now_ns() + 1)


def test_services_of_the_simulation(bench):
    simulated = Simulated(bench)
    references = bench.publisher(REFERENCE)
    motion = quintic_motion(HOME_Q + 0.2)
    with simulated.standing(reference=1):
        references.publish(reference_message(motion, simulated.now_ns() + SECOND // 2))
    bench.wait(lambda: np.abs(joint_values(simulated.states[-1], 'position')
                              - HOME_Q).max() > 0.1, 'the robot to move')
    simulated.pause()
    paused = simulated.fresh_counts()[JOINT_STATES.name]
    assert simulated.fresh_counts()[JOINT_STATES.name] == paused
    before_ns = simulated.now_ns()
    assert bench.call('par4_simulation/reset').success
    simulated.resume()
    simulated.wait_until(before_ns + SECOND)
    positions = simulated.positions()
    after = np.array([q for stamp, q in positions.items() if stamp > before_ns])
    # at home, what was queued is forgotten, and time did not run backward
    np.testing.assert_allclose(after, np.tile(HOME_Q, (len(after), 1)), atol=1e-3)
    stamps = [time_ns(message.header.stamp) for message in simulated.states]
    assert (np.diff(stamps) > 0).all()
    assert bench.call('par4_simulation/reload_model').success
    assert bench.call('par4_simulation/stop').success
    assert bench.ended(simulated.child) == 0


def test_a_model_that_is_read_anew_is_described_anew(bench):
    path = bench.folder / 'model.yaml'
    content = read_model_file('table1_full')
    write_model_file(path, content)
    descriptions = bench.listen(ROBOT_DESCRIPTION)
    Simulated(bench, model_file=path)
    bench.wait(lambda: descriptions, 'the description')
    mass = content.parameters['platform_mass_1']
    write_model_file(path, content.model_copy(update={'parameters': content.parameters | {
        'platform_mass_1': mass.model_copy(update={'value': mass.value + 0.3})}}))
    assert bench.call('par4_simulation/reload_model').success
    bench.wait(lambda: len(descriptions) > 1, 'the description of the new model')

    def whole_mass(description):
        return sum(float(own.get('value')) for own in ElementTree.fromstring(
            description.data).iter('mass'))

    before, after = map(whole_mass, descriptions)
    assert after - before == pytest.approx(0.3, abs=1e-3)


def lag_over_topics(bench, simulated, motion, inputs=(REFERENCE,)):
    """Return how far D was from a motion that begins elsewhere, m, (n, 3).

    The machine stands until it has heard a message on each of its `inputs`, so that nothing is
    late.
    """
    simulated.pause()
    references = bench.publisher(REFERENCE, len(inputs))
    first_ns = (simulated.now_ns() // SECOND + 1) * SECOND
    # looks ahead come every 2 ms of the simulation, which begins at 1 ms
    start_ns = first_ns + SECOND + MILLISECOND
    message = reference_message(quintic_motion(motion.q[0], motion.period), first_ns)
    for point in reference_message(motion, start_ns).points:
        write_time(point.time_from_start,
                   start_ns - first_ns + time_ns(point.time_from_start))
        message.points.append(point)

    def all_heard() -> bool:
        references.publish(message)  # nodes that do not know each other yet miss one
        simulated.fresh_counts()
        told = simulated.measures()
        return all(told[f'{topic.name}_age'] != 'none yet' for topic in inputs)

    bench.wait(all_heard, 'the simulation to hear all')
    simulated.resume()
    simulated.wait_until(start_ns + round(motion.duration * SECOND) + SECOND // 10)
    positions = simulated.positions()
    q = np.array([positions[start_ns + round(t * SECOND)] for t in motion.t])
    return forward_kinematics(ROBOT.geometry, q)[:, :3] - motion.x[:, :3]


def test_the_papers_run_over_topics_in_pybullet_is_that_without_ros(bench):
    """15 G under the loops alone (Fig. 4): the lag of D in the accurate plant, told by topics."""
    motion = adept_motion(ROBOT, period=1e-3)
    simulated = Simulated(bench, fidelity='accurate', **EVERY_MILLISECOND)
    lag = lag_over_topics(bench, simulated, motion)
    rms = np.sqrt(np.mean(np.sum(lag ** 2, axis=1)))
    machine = read_model('table1_full', ROBOT)
    alone = tracking_of(record_run(ROBOT, machine, motion, None, 'accurate'))
    exact = tracking_of(record_run(ROBOT, machine, motion, None, 'exact'))
    assert rms == pytest.approx(alone.rms, rel=0.02)
    assert alone.rms == pytest.approx(exact.rms, rel=0.02)  # two engines that share nothing


@pytest.mark.parametrize('drives', [
    {'drive_mode': 'torque'}, {'controller': 'predictive'}],
    ids=lambda drives: next(iter(drives.values())))
def test_lost_torque_is_counted_and_the_loop_takes_over(bench, drives):
    simulated = Simulated(bench, **drives, **EVERY_MILLISECOND)
    voltages = bench.listen(AMPLIFIER_VOLTAGE)
    references, efforts = bench.publisher(REFERENCE), bench.publisher(FEEDFORWARD_TORQUE)
    motion = quintic_motion(AWAY_Q)
    torque = torque_of('table1_full', motion)
    hole = slice(len(motion.t) // 3, 2 * len(motion.t) // 3)
    known = np.ones(len(motion.t), dtype=bool)
    known[hole] = False
    with simulated.standing(reference=1, feedforward_torque=1):
        start_ns = (simulated.now_ns() // SECOND + 2) * SECOND
        message = reference_message(motion, start_ns, torque)
        message.points = [point for point, there in zip(message.points, known) if there]
        efforts.publish(message)
        references.publish(reference_message(motion, start_ns))
    simulated.wait_until(start_ns + round(motion.duration * SECOND) + SECOND // 5)
    assert simulated.fresh_counts()['missing_effort'] == hole.stop - hole.start
    steps = torque_steps(voltages, start_ns)
    # Coulomb friction of 2.4 N m that sets in with the motion is the largest step that is asked
    assert steps.max() < 1.5 * np.abs(np.diff(torque, axis=0)).max()
    reached = joint_values(simulated.states[-1], 'position')
    assert np.abs(reached - motion.q[-1]).max() < 0.05
    assert np.abs(reached - HOME_Q).max() > 0.1


def test_predictive_control_over_topics_is_that_without_ros(bench):
    """With 90 of the 140 N m that the motion takes: the feedforward tells what will be missing."""
    weak = ROBOT.model_copy(update={'drives': ROBOT.drives.model_copy(
        update={'torque_limit': 90.0})})
    write_yaml(bench.folder / 'weak.yaml', weak.model_dump(mode='json', by_alias=True))
    bench.start('par4_feedforward', robot_file='weak.yaml', model_file='table1_full',
                torque_factor=2.0, **SIMULATED)
    simulated = Simulated(bench, robot_file='weak.yaml', controller='predictive',
                          controller_model='table1_full', feedforward_timeout=DEADLINE,
                          **EVERY_MILLISECOND)
    motion = adept_motion(ROBOT, period=1e-3, jerk=30_000.0)
    lag = lag_over_topics(bench, simulated, motion, (REFERENCE, FEEDFORWARD_TORQUE))
    peak = np.linalg.norm(lag, axis=1).max()
    machine = read_model('table1_full', weak)
    torque = feedforward_of(weak, machine, motion)
    alone, blind = (tracking_of(record_run(weak, machine, motion, torque, law=law, known=machine))
                    for law in ('predictive', 'computed_torque'))
    assert peak == pytest.approx(alone.peak, rel=0.05)
    assert peak < 0.6 * blind.peak
    assert simulated.fresh_counts().get('missing_effort', 0) == 0


def test_motion_feedforward_and_simulation_play_a_motion_together(bench):
    model = 'table1_full'
    bench.start('par4_feedforward', model_file=model, **SIMULATED)
    simulated = Simulated(bench)
    sent, efforts = bench.listen(REFERENCE), bench.listen(FEEDFORWARD_TORQUE)
    player = bench.start('par4_motion', motion='adept', **SIMULATED)
    assert bench.ended(player) == 0
    motion = named_motion('adept', ROBOT)
    bench.wait(lambda: sent and np.allclose(read_trajectory(sent[-1]).q[-1], motion.q[-1])
               and len(efforts) >= len(sent), 'torque for the last of the reference')
    chunks = [read_trajectory(message) for message in sent]
    q = np.concatenate([chunk.q for chunk in chunks])
    times = np.concatenate([chunk.stamp_ns + chunk.from_start_ns for chunk in chunks])
    np.testing.assert_allclose(q[-len(motion.q):], motion.q, atol=1e-12)
    np.testing.assert_allclose(np.diff(times) / SECOND, motion.period, atol=2e-9)
    filled = [read_trajectory(message, ('effort',)) for message in efforts]
    np.testing.assert_array_equal(
        np.concatenate([chunk.stamp_ns + chunk.from_start_ns for chunk in filled]), times)
    simulated.wait_until(int(times[-1]) + SECOND // 2)
    np.testing.assert_allclose(joint_values(simulated.states[-1], 'position'), motion.q[-1],
                               atol=2e-3)


def test_a_motion_that_begins_elsewhere_is_approached_from_where_the_robot_stands(bench):
    states = bench.node.create_publisher(JointState, JOINT_STATES.name, qos_of(JOINT_STATES))
    sent = bench.listen(REFERENCE)
    bench.start('par4_motion', motion='circle')
    motion = named_motion('circle', ROBOT)
    bench.until_answered(lambda: states.publish(joint_state(HOME_Q, time.time_ns())), sent)
    np.testing.assert_allclose(read_trajectory(sent[0]).q[0], HOME_Q, atol=1e-9)
    assert np.abs(motion.q[0] - HOME_Q).max() > 0.01


class Recorded:
    """A recorder of `bag` and a publisher of numbered joint states to it."""

    def __init__(self, bench: Bench, **parameters: Any) -> None:
        self.bench = bench
        self.diagnostics = bench.listen(DIAGNOSTICS)
        self.child = bench.start('par4_record', output='bag', **parameters)
        self.publishers = [bench.publisher(topic) for topic in (JOINT_STATES, AMPLIFIER_VOLTAGE)]
        self.published = 0
        bench.wait(lambda: self.publish(1) or (
            {JOINT_STATES.name, AMPLIFIER_VOLTAGE.name} <= self.counts().keys()),
            'the first message to be recorded')

    def publish(self, count: int) -> None:
        """Publish joint states whose stamp, in ms, and first position are their number."""
        for number in range(self.published + 1, self.published + 1 + count):
            message = joint_state((number, 0.0, 0.0, 0.0), number * MILLISECOND)
            write_joint_state(message, number * MILLISECOND, velocity=np.zeros(4),
                              effort=np.zeros(4))
            for publisher in self.publishers:
                publisher.publish(message)
        self.published += count

    def counts(self) -> dict[str, int]:
        return self.bench.counts(self.diagnostics, 'par4_record')

    def settle(self) -> None:
        """Wait until the recorder has taken all that was published and has flushed it.

        What its process has received it takes before it reports once more, and it flushes as often
        as it reports; the first report may have been under way.
        """
        for publisher in self.publishers:
            self.bench.wait(lambda publisher=publisher: publisher.wait_for_all_acked(ASKED),
                            'the process of the recorder to have received all')
        self.diagnostics.clear()
        self.bench.wait(lambda: len(self.bench.reports(self.diagnostics, 'par4_record')) > 2,
                        'the recorder to settle')

    def end(self, number: signal.Signals) -> int:
        """End the recorder with a signal and return how many messages it says were lost."""
        self.child.send_signal(number)
        assert self.bench.ended(self.child) == 0
        return int(self.bench.said().rsplit(' lost', 1)[0].rsplit(' ', 1)[1])


def numbers_in(path: Path, topic: Topic) -> list[int]:
    """Return the numbers of the recorded messages, which their positions confirm."""
    samples = read_bag(path).joints[topic.name]
    numbers = samples.stamp // MILLISECOND
    np.testing.assert_array_equal(samples.position[:, 0], numbers)
    return numbers.tolist()


def lost_between(numbers: list[int], last: int) -> int:
    """Return how many of numbers[0] .. last are missing in the increasing `numbers`."""
    assert (np.diff(numbers) > 0).all()
    return last - numbers[0] + 1 - len(numbers)


@pytest.mark.parametrize(('storage', 'number'), [('mcap', signal.SIGINT),
                                                 ('sqlite3', signal.SIGTERM)])
def test_what_is_published_is_recorded_or_counted_as_lost(bench, storage, number):
    recorded = Recorded(bench, storage=storage)
    recorded.publish(1500)
    recorded.settle()
    lost = recorded.end(number)
    assert lost == sum(lost_between(numbers_in(bench.folder / 'bag', topic), recorded.published)
                       for topic in (JOINT_STATES, AMPLIFIER_VOLTAGE))


def test_messages_lost_while_the_recorder_is_held_up_are_counted(bench):
    recorded = Recorded(bench)
    recorded.child.send_signal(signal.SIGSTOP)
    recorded.publish(6000)
    recorded.child.send_signal(signal.SIGCONT)
    recorded.settle()
    recorded.publish(1)
    recorded.settle()
    assert recorded.counts()['lost_messages'] > 0
    lost = recorded.end(signal.SIGTERM)
    assert lost == sum(lost_between(numbers_in(bench.folder / 'bag', topic), recorded.published)
                       for topic in (JOINT_STATES, AMPLIFIER_VOLTAGE))


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_a_full_disk_ends_the_recorder_with_one_line_and_what_was_recorded(bench, storage):
    limit = 1_500_000  # bytes that a file may have; the shared memory of the middleware needs some

    def start(node: str, **parameters: Any) -> subprocess.Popen:
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
        try:
            return bench.execute(node, **parameters)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))

    bench.start = start
    recorded = Recorded(bench, storage=storage)
    diagnostics = bench.listen(DIAGNOSTICS)
    bench.wait(lambda: recorded.publish(100) or recorded.child.poll() is not None, 'a full disk')
    # whoever watches the cell is told, too
    bench.wait(lambda: any('cannot be written' in status.message
                           and status.level == DiagnosticStatus.ERROR
                           for message in diagnostics for status in message.status),
               'the end on the diagnostics')
    assert recorded.child.returncode == 2
    errors = [line for line in bench.said().splitlines() if 'error: ' in line]
    assert len(errors) == 1
    assert 'cannot be written' in errors[0]
    assert 'Traceback' not in bench.said()
    left = 'bag'
    if storage == 'mcap':
        with pytest.raises(InputError, match='--repair'):
            read_bag(bench.folder / 'bag')
        left = 'mended'
        repair_bag(bench.folder / 'bag', bench.folder / left)
    assert len(numbers_in(bench.folder / left, JOINT_STATES)) > 100


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_a_killed_recording_is_mended(bench, storage):
    recorded = Recorded(bench, storage=storage)
    recorded.publish(500)
    recorded.settle()
    lost = recorded.counts().get('lost_messages', 0)
    recorded.child.kill()
    recorded.child.wait()
    repair = [sys.executable, '-m', MODULES['par4_record'], '--repair', 'bag']
    done = subprocess.run([*repair, '--output', 'mended'], cwd=bench.folder, capture_output=True,
                          text=True, timeout=DEADLINE)
    assert (done.returncode, done.stderr) == (0, '')
    assert lost == sum(lost_between(numbers_in(bench.folder / 'mended', topic), recorded.published)
                       for topic in (JOINT_STATES, AMPLIFIER_VOLTAGE))
    again = subprocess.run([*repair, '--output', 'mended'], cwd=bench.folder, capture_output=True,
                           text=True, timeout=DEADLINE)
    assert again.returncode == 2
    assert again.stderr.startswith('error: ')


def test_a_recording_of_nothing_leaves_its_path_to_the_next(bench):
    diagnostics = bench.listen(DIAGNOSTICS)
    for number in (1, 2):
        diagnostics.clear()
        child = bench.start('par4_record', output='bag', duration=0.5)
        # its own diagnostics are in the bag, but are no recording of a robot and begin no duration
        bench.wait(lambda: bench.counts(diagnostics, 'par4_record').get(DIAGNOSTICS.name, 0) > 2,
                   'diagnostics that are recorded')
        assert child.poll() is None
        child.send_signal(signal.SIGINT)
        assert bench.ended(child) == 0
        assert bench.said().count('bag: no message of the robot came, so no bag is left') == number
        assert not (bench.folder / 'bag').exists()


def test_a_bag_that_could_not_be_completed_is_told_until_the_end(bench):
    """A service said so, but diagnostics and exit code did not."""
    recorded = Recorded(bench)
    recorded.publish(10)
    recorded.settle()
    folder = bench.folder / 'bag'
    folder.rename(bench.folder / 'elsewhere')
    folder.write_text('in the way')
    asked = bench.call('par4_record/stop')
    assert not asked.success
    bench.wait(lambda: any(status.level == DiagnosticStatus.ERROR for status in
                           bench.statuses(recorded.diagnostics, 'par4_record')), 'an error')
    recorded.child.send_signal(signal.SIGINT)
    assert bench.ended(recorded.child) == 2
    assert bench.said().count('error: ') >= 1
    assert 'Traceback' not in bench.said()


def test_a_bag_that_is_removed_ends_its_recording(bench):
    recorded = Recorded(bench)
    recorded.publish(10)
    recorded.settle()
    shutil.rmtree(bench.folder / 'bag')
    assert bench.ended(recorded.child) == 2
    assert 'bag: removed while it was recorded' in bench.said()


def test_what_is_there_to_be_shown_is_recorded_in_every_bag_and_loses_nothing(bench):
    """The description comes once, before the recorder; all nodes number their diagnostics."""
    pose, description, others = (message_type(topic)() for topic in SHOWN_TOPICS)
    description.data, others.status = '<robot/>', [DiagnosticStatus(name='other')]
    latched = bench.node.create_publisher(type(description), '/robot_a/robot_description',
                                          qos_of(ROBOT_DESCRIPTION))
    latched.publish(description)
    diagnostics = bench.listen(DIAGNOSTICS)
    reports = [bench.publisher(DIAGNOSTICS) for _ in range(2)]
    for _ in range(50):  # which the recorder does not hear
        reports[0].publish(others)
    child = bench.start('par4_record', remap=('__ns:=/robot_a',), output='bag')

    def recorded() -> dict[str, int]:
        return bench.counts(diagnostics, 'robot_a/par4_record')

    bench.wait(lambda: ROBOT_DESCRIPTION.name in recorded(), 'the description')
    states, poses = (bench.publisher(replace(topic, name=f'/robot_a/{topic.name}'))
                     for topic in (JOINT_STATES, PLATFORM_POSE))
    for report in reports:
        bench.wait(lambda report=report: report.get_subscription_count() == 2,
                   'the recorder beside this bench')
    for _ in range(40):  # another node that is heard as far as this, and then no more
        reports[1].publish(others)
    for bag in ('bag', 'bag_2'):
        bench.wait(lambda: states.publish(joint_state(HOME_Q)) or poses.publish(pose) or
                   reports[0].publish(others) or
                   {JOINT_STATES.name, PLATFORM_POSE.name} <= recorded().keys(), 'all topics')
        stopped = bench.call('robot_a/par4_record/stop')
        assert f'{bag}: ' in stopped.message
        assert stopped.message.endswith(' 0 lost')
        topics = {topic.name: len(topic.received)
                  for topic in recorded_topics(bench.folder / bag)}
        assert topics.keys() == {'/robot_a/joint_states', '/robot_a/platform_pose',
                                 '/robot_a/robot_description', '/diagnostics'}
        assert topics['/robot_a/robot_description'] == 1
        assert read_bag(bench.folder / bag).namespace == '/robot_a'
        assert bench.call('robot_a/par4_record/start').success
        diagnostics.clear()
        bench.wait(lambda: recorded() and JOINT_STATES.name not in recorded(), 'a bag that begins')
    child.send_signal(signal.SIGINT)
    assert bench.ended(child) == 0
    assert not (bench.folder / 'bag_3').exists(), 'a description alone is no recording'


def test_a_recording_takes_the_next_path_that_is_free(bench):
    Recorded(bench)
    assert bench.call('par4_record/stop').success
    (bench.folder / 'bag_2').mkdir()
    again = bench.call('par4_record/start')
    assert again.success
    assert again.message.endswith('bag_3')


def test_positions_from_two_places_are_told_and_no_motion_begins_from_them(bench):
    """As of a panel that publishes the joints, too: which message comes last is chance."""
    diagnostics = bench.listen(DIAGNOSTICS)
    bench.start('par4_kinematics')
    sent = bench.listen(REFERENCE)
    child = bench.start('par4_motion', motion='circle')
    states = bench.publisher(JOINT_STATES, 2)
    other = np.array(HOME_Q) + 0.25
    backwards = joint_state(other, names=JOINT_NAMES[::-1])

    def both() -> bool:
        for message in (joint_state(HOME_Q), backwards):
            write_time(message.header.stamp, time.time_ns())
            states.publish(message)
        return any('jump to and fro' in status.message and status.level == DiagnosticStatus.ERROR
                   for status in bench.statuses(diagnostics, 'par4_kinematics'))

    bench.wait(both, 'an error')
    bench.wait(lambda: both() and child.poll() is not None, 'the end of the motion')
    assert child.returncode == 2
    assert not sent
    assert 'not begun: joint_states: the positions jump to and fro' in bench.said()


@pytest.mark.parametrize(('part', 'said'), [
    ('par4_kinematic', 'is par4_kinematics meant by par4_kinematic?'),
    ('par4_record', 'no part of it is for par4_kinematics'),
    (None, 'all are ignored; it is for no node'),
    ('/**', ''), ('/par4_kinematics', ''), ('robot_a/par4_kinematics', '')])
def test_a_parameter_file_for_another_node_is_told(part, said, tmp_path, monkeypatch):
    content = {part: {'ros__parameters': {'use_sim_time': False}}}
    write_yaml(tmp_path / 'file.yaml', content if part else {})
    monkeypatch.setattr(sys, 'argv', ['node', '--ros-args', '--params-file',
                                      str(tmp_path / 'file.yaml')])
    node = mock.Mock()
    node.get_name.return_value = 'par4_kinematics'
    tell_files_of_others(node)
    warnings = [call.args[0] for call in node.get_logger().warning.call_args_list]
    assert len(warnings) == bool(said)
    assert all(said in line for line in warnings)


def test_a_publisher_that_a_node_does_not_hear_is_told(bench):
    """Drivers of sensors often publish best effort: nodes waited, and said that all is well."""
    diagnostics = bench.listen(DIAGNOSTICS)
    bench.start('par4_kinematics')
    best_effort = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    states = bench.node.create_publisher(JointState, JOINT_STATES.name, best_effort)

    def told(level: bytes, words: str) -> bool:
        return any(status.level == level and words in status.message
                   for status in bench.statuses(diagnostics, 'par4_kinematics'))

    bench.wait(lambda: told(DiagnosticStatus.WARN, 'joint_states of'), 'a warning')
    assert any('Best effort publisher' in status.message
               for status in bench.statuses(diagnostics, 'par4_kinematics'))
    bench.node.destroy_publisher(states)
    diagnostics.clear()
    bench.wait(lambda: told(DiagnosticStatus.OK, 'waiting for joint_states'), 'its end')


def test_nodes_to_which_nothing_comes_say_what_they_wait_for(bench):
    """A node that only listens had nothing to say until something came."""
    robot = ('joint_states, which nobody publishes: start the driver of the robot, or '
             'par4_simulation, with the same ROS_DOMAIN_ID and namespace')
    motion = ('reference, which nobody publishes: start par4_motion with the same ROS_DOMAIN_ID '
              'and namespace')
    clock = '/clock, which nobody publishes: use_sim_time is for a simulation'
    children = [bench.start('par4_kinematics', **SIMULATED), bench.start('par4_monitor'),
                bench.start('par4_feedforward'), bench.start('par4_record', output='bag')]
    for name, awaited in (('par4_kinematics', f'{clock}; {robot}'), ('par4_monitor', robot),
                          ('par4_feedforward', motion), ('par4_record', robot)):
        line = f'[{name}]: waiting for {awaited}\n'
        bench.wait(lambda line=line: line in bench.said(), line)
    assert bench.said().count('waiting for') == len(children)


def test_the_recorder_ends_after_its_duration(bench):
    recorded = Recorded(bench, duration=2)
    bench.wait(lambda: recorded.publish(1) or recorded.child.poll() is not None,
               'the end of the recording')
    assert recorded.child.returncode == 0
    assert len(numbers_in(bench.folder / 'bag', JOINT_STATES)) > 0


def test_the_duration_counts_from_the_first_message_on_the_simulated_clock(bench):
    recorded = Recorded(bench, duration=2, **SIMULATED)
    clock = bench.publisher(CLOCK)
    message = message_type(CLOCK)()

    def at(seconds: int) -> bool:
        message.clock.sec = seconds
        clock.publish(message)
        recorded.publish(1)
        return recorded.child.poll() is not None

    def known(seconds: int) -> bool:
        """Of the clock single messages may be lost."""
        assert not at(seconds)
        return any(report.header.stamp.sec == seconds for report in recorded.diagnostics)

    for seconds in (50, 51):
        bench.wait(lambda seconds=seconds: known(seconds), 'the recorder to hear the clock')
        recorded.settle()
        assert recorded.child.poll() is None
    bench.wait(lambda: at(53), 'the end of the recording')
    assert recorded.child.returncode == 0


def test_the_recorder_stops_and_starts_on_request(bench):
    recorded = Recorded(bench)
    first = bench.call('par4_record/stop')
    assert first.success
    assert f'{bench.folder / "bag"}'.endswith(first.message.split(':')[0])
    in_first = numbers_in(bench.folder / 'bag', JOINT_STATES)
    assert not bench.call('par4_record/stop').success
    recorded.publish(50)
    recorded.settle()
    assert bench.call('par4_record/start').success
    recorded.diagnostics.clear()
    bench.wait(lambda: any(status.message.startswith('waiting for joint_states') for status in
                           bench.statuses(recorded.diagnostics, 'par4_record')),
               'a recorder that knows of no message of the bag before')
    between = recorded.published
    recorded.publish(50)
    recorded.settle()
    assert bench.call('par4_record/stop').success
    in_second = numbers_in(bench.folder / 'bag_2', JOINT_STATES)
    assert max(in_first) <= between - 50
    assert in_second == list(range(between + 1, between + 51))
