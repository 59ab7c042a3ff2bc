"""What protects a machine and tells its state, with nodes as processes."""

from __future__ import annotations

import dataclasses
import runpy
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import nullcontext
from functools import partial
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest
from rclpy.clock import Clock
from rclpy.duration import Duration
from rclpy.serialization import serialize_message
from rclpy.time import Time
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from node_bench import (
    AWAY_Q,
    DEADLINE,
    EVERY_MILLISECOND,
    HOME_Q,
    MILLISECOND,
    MODULES,
    ROBOT,
    SELDOM,
    SIMULATED,
    UNHEARD,
    Bench,
    Simulated,
    quintic_motion,
    reference_message,
    torque_of,
    torque_steps,
)
from par4_dynamics.model_from_file import read_model
from par4_identification.fitting.identification import identify
from par4_identification.logs.read_log import read_log
from par4_identification.ros.record_node import RecordNode
from par4_kinematics.adept import adept_motion
from par4_kinematics.approach import with_approach
from par4_kinematics.errors import InputError
from par4_kinematics.files import read_yaml, write_yaml
from par4_kinematics.interface import (
    AMPLIFIER_VOLTAGE,
    DIAGNOSTICS,
    FEEDFORWARD_TORQUE,
    JOINT_STATES,
    REFERENCE,
)
from par4_kinematics.motion import Motion, motion_of_joints
from par4_kinematics.motion_file import named_motion, write_motion
from par4_kinematics.position import forward_kinematics
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.ros.clock_watch import TO_AND_FRO, ClockWatch
from par4_kinematics.ros.convert import joint_values, time_ns, write_joint_state
from par4_kinematics.ros.node import NOT_LOGGED, Par4Node
from par4_kinematics.ros.parameters import config
from par4_kinematics.stamps import SECOND
from par4_kinematics.workspace import inside
from par4_sim.ros.sample_publisher import SamplePublisher
from par4_sim.ros.simulation_node import RESET, SimulationNode
from par4_sim.ros.simulation_parameters import SimulationParameters
from par4_sim.ros.zero_stamp import ZeroStamps

OK, WARN, ERROR = b'\x00', b'\x01', b'\x02'
GAIN = np.asarray(ROBOT.drives.gain)
JUMP = SimpleNamespace(delta=Duration(nanoseconds=-SECOND))


def wait_for_state(bench: Bench, diagnostics: list, node: str, level: bytes, text: str) -> Any:
    """Return the first status from now on of at least that level, with `text` in its message."""
    diagnostics.clear()

    def found() -> Any:  # a busy machine may add a warning of late steps
        return next((status for status in bench.statuses(diagnostics, node)
                     if status.level >= level and text in status.message), None)

    return bench.wait(found, f'{node} to tell {text!r}')


def first_part(motion: Motion, share: float) -> Motion:
    """Return the first samples of a motion, which end in motion."""
    count = int(share * len(motion.t))
    return Motion(motion.name, *(getattr(motion, name)[:count]
                                 for name in ('t', 'q', 'qd', 'qdd', 'x', 'xd', 'xdd')))


def test_references_beyond_the_limits_are_refused_and_interrupted_ones_are_braked(bench):
    bench.start('par4_feedforward', model_file='table1_full', **SIMULATED)
    simulated = Simulated(bench, **EVERY_MILLISECOND)
    voltages, answers = bench.listen(AMPLIFIER_VOLTAGE), bench.listen(FEEDFORWARD_TORQUE)
    references = bench.publisher(REFERENCE, 2)
    motion = quintic_motion(AWAY_Q)

    def changed(field: str, value: float) -> Any:
        message = reference_message(motion, simulated.now_ns() + SECOND // 2)
        setattr(message.points[7], field, [*HOME_Q[:3], value])
        return message

    # an acceleration that only a model can judge: for the drives its time is over
    steep = reference_message(motion, 1)
    steep.points[7].accelerations = [9000.0] * 4
    simulated.wait_until(round(motion.duration * SECOND) + SECOND)
    with simulated.standing(reference=4):
        # a jump, which only the drives see
        torn = reference_message(motion, simulated.now_ns() + SECOND // 2)
        for point in torn.points[len(motion.t) // 2:]:
            point.positions = [value + 0.1 for value in point.positions]
        for message in (changed('positions', 2.9), changed('velocities', 1e160),
                        changed('accelerations', -1e160), torn):
            references.publish(message)
    bench.wait(lambda: simulated.fresh_counts().get('rejected_messages') == 4, 'refusals')
    simulated.fresh_counts()  # refusals of a topic are told once a second
    references.publish(steep)
    diagnostics = simulated.diagnostics
    bench.wait(lambda: bench.counts(diagnostics, 'par4_feedforward').get('rejected_messages') == 4,
               'refusals of feedforward')
    np.testing.assert_allclose(joint_values(simulated.states[-1], 'position'), HOME_Q, atol=1e-3)
    assert 'joint position 2.9 rad is outside -1 to 1.6 rad' in bench.said()

    def limit_told() -> bool:
        references.publish(steep)  # of many refusals in a second one is told
        return 'limit of 200 N m' in bench.said()

    bench.wait(limit_told, 'the limit of the torque')

    # the stream ends in mid-motion, as after a kill of its sender: at rest, without a step
    asked_ns = simulated.now_ns()
    references.publish(reference_message(first_part(motion, 0.5), 0))
    status = wait_for_state(bench, diagnostics, 'par4_simulation', WARN, 'starved: reference')
    assert 'interrupted_references' in {pair.key for pair in status.values}
    simulated.wait_until(simulated.current_ns() + SECOND)
    assert torque_steps(voltages, asked_ns).max() < 15.0
    rest = joint_values(simulated.states[-1], 'position')
    assert np.abs(joint_values(simulated.states[-1], 'velocity')).max() < 0.05
    assert np.abs(rest - HOME_Q).max() > 0.05
    assert inside(ROBOT, forward_kinematics(ROBOT.geometry, rest))

    # it goes on with a reference from where it rests
    way = quintic_motion(rest)
    way = motion_of_joints('back', ROBOT.geometry, way.t, way.q[::-1], -way.qd[::-1],
                           way.qdd[::-1])
    answers.clear()
    references.publish(reference_message(way, 0))
    wait_for_state(bench, diagnostics, 'par4_simulation', OK, 'running')
    bench.wait(lambda: answers, 'torque for it')


def test_motion_brakes_on_its_path_on_ctrl_c_and_on_stop(bench):
    # at half pace: on a busy machine the motion would come too late to be followed
    simulated = Simulated(bench, real_time_factor=0.5, **EVERY_MILLISECOND)
    voltages = bench.listen(AMPLIFIER_VOLTAGE)
    excitation = named_motion('excitation', ROBOT, 20.0)
    for stop in (lambda child: child.send_signal(signal.SIGINT),
                 lambda _: bench.call('par4_motion/stop')):
        simulated.current_ns()
        before = joint_values(simulated.states[-1], 'position')
        child = bench.start('par4_motion', motion='excitation', duration=20.0, **SIMULATED)
        bench.wait(lambda start=before: np.abs(
            joint_values(simulated.states[-1], 'position') - start).max() > 0.1, 'a motion')
        began_ns = simulated.now_ns()
        stop(child)
        assert bench.ended(child) == 0
        simulated.wait_until(simulated.current_ns() + SECOND)
        assert np.abs(joint_values(simulated.states[-1], 'velocity')).max() < 0.05
        assert torque_steps(voltages, began_ns).max() < 15.0
        # the path of the motion, or the approach to it, was not left
        path = with_approach(excitation, ROBOT, before)
        rest = joint_values(simulated.states[-1], 'position')
        assert np.abs(path.q - rest).max(axis=1).min() < 0.02
        counts = simulated.fresh_counts()  # no way to rest helps who gets no turn for a second
        assert 'interrupted_references' not in counts or 'late_points' in counts
    assert bench.said().count('stopped: at rest') == 2
    assert 'Traceback' not in bench.said()


def test_a_fault_is_an_error_until_reset_and_resume_says_so(bench):
    simulated = Simulated(bench, following_error_limit=0.002)
    references = bench.publisher(REFERENCE)
    # 15 G under the loops alone lag further than that
    references.publish(reference_message(adept_motion(ROBOT), 0))
    for _ in range(2):  # the state lasts
        wait_for_state(bench, simulated.diagnostics, 'par4_simulation', ERROR, 'call ~/reset')
    refused = bench.call('par4_simulation/resume')
    assert not refused.success
    assert 'call ~/reset' in refused.message
    assert bench.call('par4_simulation/reset').success
    wait_for_state(bench, simulated.diagnostics, 'par4_simulation', WARN, RESET)
    references.publish(reference_message(quintic_motion(AWAY_Q), 0))
    wait_for_state(bench, simulated.diagnostics, 'par4_simulation', OK, 'running')
    assert bench.call('par4_simulation/pause').success
    wait_for_state(bench, simulated.diagnostics, 'par4_simulation', WARN, 'paused')


def test_diagnostics_tell_pace_ages_and_dead_inputs_and_foreign_joints_are_no_fault(bench):
    simulated = Simulated(bench)
    bench.start('par4_kinematics', **SIMULATED)
    child = bench.start('par4_record', output='bag', **SIMULATED)
    diagnostics = simulated.diagnostics
    gripper = JointState(name=['finger'], position=[0.01], velocity=[0.0], effort=[0.0])
    fingers = bench.publisher(JOINT_STATES, 3)  # nodes and bench
    wait_for_state(bench, diagnostics, 'par4_kinematics', OK, 'running')
    for _ in range(40):
        fingers.publish(gripper)
    wait_for_state(bench, diagnostics, 'par4_simulation', OK, 'running')
    bench.wait(lambda: float(simulated.measures()['real_time_factor']) > 0.0, 'a measured pace')
    told = simulated.measures()
    assert told['reference_age'] == 'none yet'
    assert told['reference_received'] == '0'
    wait_for_state(bench, diagnostics, 'par4_record', OK, 'recording')
    simulated.child.kill()
    for node in ('par4_kinematics', 'par4_record'):
        status = wait_for_state(bench, diagnostics, node, WARN, 'dead input: joint_states')
        assert 'rejected_messages' not in {pair.key for pair in status.values}
    child.send_signal(signal.SIGINT)
    assert bench.ended(child) == 0
    lost = int(bench.said().split(' lost')[0].rsplit(' ', 1)[1])
    assert lost < 5000, 'another publisher fakes loss'


def test_a_robot_whose_joints_have_other_names_is_told(bench):
    """A gripper that speaks first is one, too, until the robot does."""
    diagnostics = bench.listen(DIAGNOSTICS)
    for node in ('par4_kinematics', 'par4_monitor', 'par4_motion'):
        bench.start(node)
    states = bench.publisher(JOINT_STATES, 3)
    message = JointState(name=['joint_1', 'joint_2', 'joint_3', 'joint_4'])
    write_joint_state(message, 0, HOME_Q)
    states.publish(message)
    for node in ('par4_kinematics', 'par4_monitor', 'par4_motion'):
        wait_for_state(bench, diagnostics, node, WARN,
                       'joint_states tell of joint_1, joint_2, joint_3, joint_4 only; the joints '
                       'of the robot are arm_joint_0, arm_joint_1, arm_joint_2, arm_joint_3')
    message.name = list(JOINT_NAMES)
    diagnostics.clear()
    states.publish(message)
    bench.wait(lambda: any('joint_1' not in status.message for status in bench.statuses(
        diagnostics, 'par4_kinematics')), 'par4_kinematics to have heard the robot')


def test_the_clock_of_a_simulation_that_was_killed_is_no_second_one(bench, monkeypatch):
    """The middleware knows it for some 20 s more; two that run make the clock jump to and fro."""
    wall = SimpleNamespace(now=99.0)
    monkeypatch.setattr('par4_kinematics.ros.clock_watch.time',
                        SimpleNamespace(monotonic=lambda: wall.now))
    watch = ClockWatch(bench.node, bench.node.get_clock(), lambda: None)
    watch._on_jump(JUMP)
    wall.now = 100.0
    assert watch.state(1) is None
    state = watch.state(2)
    assert state.level == WARN
    assert 'may have been killed' in state.text
    wall.now = 99.9
    watch._on_jump(JUMP)
    wall.now = 100.0
    state = watch.state(2)
    assert state.level == ERROR
    assert state.text.startswith('2 publish /clock: end all but one simulation')
    wall.now = 99.0 + TO_AND_FRO
    assert watch.state(2).level == WARN


def test_jumps_of_a_clock_are_told_at_once_and_then_now_and_then(bench, monkeypatch):
    """Two clocks make it jump all the time."""
    told, jumps, logger = [], [], bench.node.get_logger()
    log = logger.log
    monkeypatch.setattr(logger, 'log', lambda text, *args, **kwargs: told.append(text) if log(
        text, *args, **kwargs) else None)
    wall_clock = WallClock()
    watch = ClockWatch(bench.node, wall_clock, lambda: jumps.append(1))
    for second in range(25):
        wall_clock.seconds = 100.0 + second
        watch._on_jump(JUMP)
    assert len(told) == 3
    assert told[0].startswith('the clock jumped back by 1.000 s')
    assert len(jumps) == 25
    assert 'clock_jumps' in NOT_LOGGED


class WallClock(Clock):
    """Whose time is set."""

    seconds = 0.0

    def now(self) -> Time:
        """Return the time that was set."""
        return Time(nanoseconds=round(self.seconds * SECOND))


@pytest.mark.parametrize('slash', ['', '/'])
def test_a_bag_of_more_than_one_run_is_told_once(tmp_path, slash):
    """The second bag stands beside the first, not in it, however the path of that ends."""
    node = SimpleNamespace(
        parameters=SimpleNamespace(output=f'{tmp_path}/bag{slash}', storage='mcap'), _bag=None,
        _begun_bags=0, _path=tmp_path / 'bag', _received=Counter(), _numbering={}, _newest={},
        _latched={}, get_logger=lambda: log,
        get_clock=lambda: SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=SECOND)))
    log = mock.Mock()
    for bags in (1, 2):
        RecordNode._start(node)
        node._began_ns = 1
        for _ in range(3):
            RecordNode.clock_jumped_back(node)
        assert log.warning.call_count == bags
        node._bag.close()
        node._bag = None
    assert f'{tmp_path}/bag_2 holds more than one run' in log.warning.call_args.args[0]


def test_an_empty_bag_that_cannot_be_removed_is_told(tmp_path, monkeypatch):
    refused = mock.Mock(side_effect=PermissionError(13, 'Permission denied'))
    monkeypatch.setattr('par4_identification.ros.record_node.shutil.rmtree', refused)
    node = SimpleNamespace(_bag=mock.Mock(), _path=tmp_path / 'bag', _received=Counter(),
                           _newest={}, _write_waiting=lambda: None, _lost=lambda: 0)
    line = RecordNode._stop(node)
    refused.assert_called_once_with(tmp_path / 'bag')
    assert line.endswith('the bag cannot be removed: Permission denied')


def test_a_restart_of_the_simulation_is_noticed_by_all_and_two_are_told_by_both(bench):
    simulated = Simulated(bench, publish_rate_hz=100)
    diagnostics = simulated.diagnostics
    # without use_sim_time a motion says so instead of playing years ahead
    lost = bench.start('par4_motion', motion='adept')
    assert bench.ended(lost) == 2
    assert 'use_sim_time:=true' in bench.said()
    recorder = bench.start('par4_record', output='bag', **SIMULATED)
    bench.start('par4_feedforward', **SIMULATED)
    player = bench.start('par4_motion', motion='excitation', duration=60.0, **SIMULATED)
    wait_for_state(bench, diagnostics, 'par4_feedforward', OK, '')
    wait_for_state(bench, diagnostics, 'par4_motion', OK, 'playing')
    wait_for_state(bench, diagnostics, 'par4_record', OK, 'recording')
    simulated.child.kill()
    simulated.child.wait()
    for node in ('par4_feedforward', 'par4_motion', 'par4_record'):
        wait_for_state(bench, diagnostics, node, WARN, '/clock came, but no more')
    second = bench.start('par4_simulation', fidelity='exact', publish_rate_hz=100)
    assert bench.ended(player) == 2
    wait_for_state(bench, diagnostics, 'par4_record', OK, 'recording')
    bench.wait(lambda: '[par4_feedforward]: the clock jumped back by' in bench.said(),
               'feedforward to notice')
    said = bench.said()
    assert 'excitation aborted: the clock jumped back' in said
    assert 'bag holds more than one run' in said
    assert 'Traceback' not in said
    # a reference meant for another clock is refused
    references, refusals = bench.publisher(REFERENCE), []
    diagnostics.clear()
    strange = reference_message(quintic_motion(AWAY_Q), 1_800_000_000 * SECOND)

    def refused() -> bool:
        refusals.extend(status for status in bench.statuses(diagnostics, 'par4_simulation')
                        if status.level == WARN and 'rejected_messages' in status.message)
        return bool(refusals)

    # the first to listen may be another than the new simulation
    bench.until_answered(lambda: refused() or references.publish(strange), refusals)
    bench.start('par4_simulation', fidelity='exact', publish_clock='true',
                publish_rate_hz=100)
    for node in ('par4_simulation', 'par4_record'):
        wait_for_state(bench, diagnostics, node, ERROR, '2 publish /clock')
    bench.wait(lambda: bench.counts(diagnostics, 'par4_record').get('clock_jumps', 0) > 20,
               'two clocks to jump to and fro')
    for child in (second, recorder):
        child.send_signal(signal.SIGINT)
    assert bench.ended(recorder) == 0
    # the state tells it, not a line for each jump
    assert bench.said().count('bag holds more than one run') == 1
    assert 'clock_jumps' not in bench.said()
    found = ' '.join(read_log(bench.folder / 'bag', ROBOT).bag_accounts.of_clocks())
    assert 'the clock was set back once, as when a simulation is started again' in found
    assert 'two machines or simulations with clocks of their own talk on /joint_states' in found


def test_a_motion_ends_when_the_simulation_ends_in_order(bench):
    """Its clock stands then, so that no further points are ever due."""
    simulated = Simulated(bench)
    player = bench.start('par4_motion', motion='excitation', duration=60.0, **SIMULATED)
    wait_for_state(bench, simulated.diagnostics, 'par4_motion', OK, 'playing')
    simulated.child.send_signal(signal.SIGINT)
    assert bench.ended(simulated.child) == 0
    assert bench.ended(player) == 2
    assert 'excitation aborted: nobody publishes joint_states any more' in bench.said()


def test_a_motion_that_the_robot_did_not_follow_has_not_been_played(bench, tmp_path):
    """Its drives tripped on the way, so that it stands near home."""
    simulated = Simulated(bench, following_error_limit=5e-4)
    write_motion(tmp_path / 'away.yaml', quintic_motion(AWAY_Q))
    player = bench.start('par4_motion', motion=str(tmp_path / 'away.yaml'), **SIMULATED)
    assert bench.ended(player) == 2
    assert 'the robot did not follow' in bench.said()
    wait_for_state(bench, simulated.diagnostics, 'par4_simulation', ERROR, 'call ~/reset')


def test_a_trip_ends_a_motion_whose_reference_stays_near_the_machine(bench):
    simulated = Simulated(bench, following_error_limit=1e-4)
    write_yaml(bench.folder / 'near.yaml', {
        'schema': 'par4/motion/1', 'recipe': {'kind': 'circle', 'radius': 0.01, 'speed': 0.01}})
    player = bench.start('par4_motion', motion='near.yaml', **SIMULATED)
    assert bench.ended(player) == 2
    wait_for_state(bench, simulated.diagnostics, 'par4_simulation', ERROR, 'call ~/reset')
    said = bench.said()
    assert 'circle aborted: the robot did not follow, it says: arm_joint_' in said
    # another is not begun until the machine is put in order
    player = bench.start('par4_motion', motion='near.yaml', **SIMULATED)
    assert bench.ended(player) == 2
    assert 'circle not begun: the robot says: arm_joint_' in bench.said()


def test_a_fault_is_told_at_once_and_once():
    physics = SimpleNamespace(fault='', restarted=False)
    node = SimpleNamespace(_fault='', _physics=physics, report=mock.Mock())
    for fault, restarted, reports in (
            ('', False, 0), ('tripped', False, 1), ('tripped', False, 1), ('', False, 2),
            ('', True, 3), ('', True, 3), ('', False, 4)):
        physics.fault, physics.restarted = fault, restarted
        SimulationNode._tell_new_fault(node)
        assert node.report.call_count == reports


def test_two_robots_in_two_namespaces_do_not_hear_each_other(bench):
    """In one domain, each with a clock of its own."""
    diagnostics, states = bench.listen(DIAGNOSTICS), {}
    for name in ('robot_a', 'robot_b'):
        states[name] = bench.listen(JOINT_STATES, f'/{name}/joint_states')
        bench.start('par4_simulation', fidelity='exact', **SELDOM, remap=(
            f'__ns:=/{name}', f'/clock:=/{name}/clock'))
    bench.wait(lambda: all(states.values()), 'both robots')
    player = bench.start('par4_motion', motion='circle', duration=1.0, listeners=1, **SIMULATED,
                         remap=('__ns:=/robot_a', '/clock:=/robot_a/clock'))
    assert bench.ended(player) == 0
    bench.wait(lambda: np.ptp([joint_values(message, 'position') for message in states['robot_a']],
                              axis=0).max() > 0.1, 'what the robot told of it')
    heard = len(states['robot_b'])
    bench.wait(lambda: len(states['robot_b']) > heard, 'the other robot')
    moved = {name: np.ptp([joint_values(message, 'position') for message in messages], axis=0)
             for name, messages in states.items()}
    assert moved['robot_a'].max() > 0.1
    assert moved['robot_b'].max() < 1e-3
    for name in states:
        status = wait_for_state(bench, diagnostics, f'{name}/par4_simulation', OK, 'running')
        assert status.level < ERROR, 'two clocks are told where they are one topic'


def test_late_steps_are_worth_a_warning_from_a_share_on():
    node = SimpleNamespace(_published=1000, _samples=SimpleNamespace(
        published={JOINT_STATES.name: 2000}))
    node._arrivals = {FEEDFORWARD_TORQUE.name: SimpleNamespace(received=0)}
    node._unaided = lambda: SimulationNode._unaided(node)
    worrying = SimulationNode.worrying
    assert not worrying(node, {'late_steps': 50})
    node._published = 1000
    assert worrying(node, {'late_steps': 51})
    node._published = 1000
    assert worrying(node, {'late_steps': 1, 'late_points': 1})
    assert not worrying(node, {})
    assert not worrying(node, {'missing_effort': 1000})  # of which there never was any
    node._arrivals[FEEDFORWARD_TORQUE.name].received = 1
    assert worrying(node, {'missing_effort': 1})


def receiving(now_ns: int) -> tuple[SimpleNamespace, mock.Mock]:
    """Return a `par4_simulation` that takes trajectories at `now_ns`, and what it gives them to."""
    physics = mock.Mock(torque_limit=200.0, now_ns=now_ns)
    node = SimpleNamespace(_physics=physics, _limits=mock.Mock(), _zero_stamps=ZeroStamps(),
                           _robot=ROBOT, parameters=SimulationParameters())
    node._start_ns = partial(SimulationNode._start_ns, node)
    return node, physics


def standing(q: np.ndarray, stamp_ns: int) -> JointTrajectory:
    """Return a second at rest at q (4,) with torques."""
    still = np.zeros((2, 4))
    return reference_message(
        motion_of_joints('still', ROBOT.geometry, np.arange(2.0), q + still, still, still),
        stamp_ns, still)


@pytest.mark.parametrize(('start', 'said'), [
    (1801, 'starts 1801 s ahead of the clock'), (1.8e9, r'starts 1.8e\+09 s ahead of the clock'),
    (-1002, 'ended 1001 s before the clock'), (999, ''), (-1000.5, '')])
@pytest.mark.parametrize('topic', [REFERENCE, FEEDFORWARD_TORQUE], ids=lambda topic: topic.name)
def test_what_another_clock_has_stamped_is_refused(topic, start, said):
    """A second of points; torques of another clock would wait for as long as it is ahead."""
    now_ns = 2000 * SECOND
    node, physics = receiving(now_ns)
    message = standing(HOME_Q, now_ns + round(start * SECOND))
    take = SimulationNode._on_reference if topic is REFERENCE else SimulationNode._on_effort
    with pytest.raises(InputError, match=said) if said else nullcontext():
        take(node, serialize_message(message))
    queued = [*physics.queue_reference.call_args_list, *physics.queue_effort.call_args_list]
    assert len(queued) == (not said)


def test_a_torque_without_a_stamp_goes_to_the_reference_of_its_positions():
    """One without positions, as a sender of torques alone may write them, to that of its times."""
    node, physics = receiving(SECOND)
    for q in (HOME_Q, HOME_Q + 0.1):
        SimulationNode._on_reference(node, serialize_message(standing(q, 0)))
        physics.now_ns += MILLISECOND
    alone = standing(HOME_Q, 0)
    for point in alone.points:
        point.positions, point.velocities, point.accelerations = [], [], []
    for message in (standing(HOME_Q + 0.1, 0), alone):
        SimulationNode._on_effort(node, serialize_message(message))
    first, second = (call.args[0] for call in physics.queue_reference.call_args_list)
    assert second == first + MILLISECOND
    assert [call.args[0] for call in physics.queue_effort.call_args_list] == [second, first]


def test_the_simulation_ends_once_its_last_samples_have_arrived():
    """They go with their publisher; it does not wait for ever for a listener that was killed."""
    publishers = {topic: mock.Mock() for topic in (JOINT_STATES, AMPLIFIER_VOLTAGE)}
    samples = SimpleNamespace(_publishers=publishers)
    SimulationNode.close(SimpleNamespace(
        _samples=SimpleNamespace(close=lambda: SamplePublisher.close(samples)),
        _physics=mock.Mock(), _window=None))
    for publisher in publishers.values():
        patience, = publisher.wait_for_all_acked.call_args.args
        assert 0 < patience.nanoseconds < 2 * SECOND


SOURCES = Path(__file__).parents[1] / 'src'
DRIVER = Path(__file__).parents[1] / 'examples' / 'driver' / 'driver.py'
SLOW_DRIVER = f"""
import sys
sys.path.insert(0, {str(DRIVER.parent)!r})
import driver
from par4_kinematics.robot import Limits
driver.ROBOT = driver.ROBOT.model_copy(update={{'limits': Limits()}})  # not given
driver.PERIOD, driver.BACKLOG = 0.005, 10**9
driver.main()
"""
"""It leaves out no cycle of which it is late: what it follows and tells is that of a quick machine.
"""


def test_a_resting_node_looks_again_while_something_comes_but_not_for_ever():
    def looks(*waiting: int) -> int:
        """Return at how many looks inputs are asked that have something so many times."""
        left, asked = list(waiting), [0] * len(waiting)

        def take_from(index: int) -> bool:
            asked[index] += 1
            left[index] -= 1
            return left[index] >= 0

        Par4Node._rest(SimpleNamespace(REST=0.0, LOOKS=10, _inputs=[
            lambda index=index: take_from(index) for index in range(len(waiting))]))
        assert len(set(asked)) == 1, 'every input is looked at'
        return asked[0]

    assert looks(0, 0) == 1
    assert looks(3, 0) == looks(0, 3) == 4
    assert looks(10**6, 0) == 10, 'then services and timers have their turn'


def test_a_node_that_another_one_ended_says_that_who_ran_them_has_ended(monkeypatch):
    """`par4_motion` fails where the simulation has noticed it first."""
    told = []
    node = SimpleNamespace(finished=True, failure=InputError('nobody publishes joint_states'),
                           _look_at_runner=lambda: told.append('the runner has ended'))
    monkeypatch.setattr('par4_kinematics.ros.node.SingleThreadedExecutor', mock.Mock())
    with pytest.raises(InputError, match='nobody publishes'):
        Par4Node._serve(node)
    assert told


def test_a_flood_of_references_is_followed_and_loses_nothing(bench):
    simulated = Simulated(bench)
    references = bench.publisher(REFERENCE)
    motion = quintic_motion(AWAY_Q, 1e-3)
    with simulated.standing(reference=len(motion.t)):
        start_ns = simulated.now_ns() + SECOND
        for row in range(len(motion.t)):  # a message a millisecond, as the contract allows
            single = Motion('point', *(getattr(motion, name)[row:row + 1]
                                       for name in ('t', 'q', 'qd', 'qdd', 'x', 'xd', 'xdd')))
            references.publish(reference_message(single, start_ns))
    simulated.wait_until(start_ns + round(motion.duration * SECOND) + SECOND // 2)
    np.testing.assert_allclose(joint_values(simulated.states[-1], 'position'), AWAY_Q, atol=2e-3)
    assert 'late_points' not in simulated.fresh_counts()
    # and 20,000 points at once, at rest where it stands
    count = 20_000
    rest = np.zeros((count, 4))
    standing = Motion('rest', np.arange(count) * 2e-5, np.tile(AWAY_Q, (count, 1)), rest, rest,
                      rest, rest, rest)
    message = reference_message(standing, 0)  # starts when it comes, whenever that is
    references.publish(message)
    bench.wait(lambda: simulated.fresh_counts().get('missing_effort', 0) > len(motion.t),
               'the first of them to be followed')
    np.testing.assert_allclose(joint_values(simulated.states[-1], 'position'), AWAY_Q, atol=2e-3)
    counts = simulated.fresh_counts()
    assert not {'missed_messages', 'rejected_messages'} & counts.keys()


@pytest.mark.parametrize(('late', 'turns'), [(0.5, 1), (-0.5, 2)])
def test_a_driver_that_is_late_listens_all_the_same(late, turns):
    driver = SimpleNamespace(now=5.0 + late)

    def spin(timeout_sec: float) -> None:
        told.append(timeout_sec)
        driver.now += 0.75 * timeout_sec if len(told) == 1 else timeout_sec

    told: list[float] = []
    runpy.run_path(str(DRIVER))['Driver'].listen_until(
        driver, 5.0, SimpleNamespace(spin_once=spin))
    assert len(told) == turns
    assert min(told) == max(0.0, -0.25 * late)


def test_a_driver_does_not_stand_at_its_first_reference_to_compile(bench):
    """It would be silent for seconds, and its motion aborted."""
    told = subprocess.run(
        [sys.executable, '-c',
         f'import sys; sys.path.insert(0, {str(DRIVER.parent)!r})\n'
         'import driver, rclpy\n'
         'from par4_sim.drives import reference, waiting_torque\n'
         'rclpy.init()\n'
         'driver.Driver()\n'
         'print(len(waiting_torque._give.signatures), len(reference._pass.signatures))'],
        env=bench.environment, capture_output=True, text=True, check=True).stdout
    assert [int(count) > 0 for count in told.split()] == [True, True]


def test_a_foreign_robot_is_moved_recorded_and_identified(bench):
    """The driver of docs/hardware.md, on the wall clock: no simulation takes part."""
    told = bench.folder / 'driver.txt'
    with told.open('w') as output:
        child = subprocess.Popen([sys.executable, '-c', SLOW_DRIVER], env=bench.environment,
                                 cwd=bench.folder, stdout=output, stderr=subprocess.STDOUT)
    bench.children.append(child)
    states = bench.listen(JOINT_STATES)
    bench.start('par4_feedforward')
    recorder = bench.start('par4_record', output='bag')
    bench.wait(lambda: len(states) > 5, 'the robot')
    player = bench.start('par4_motion', motion='excitation', duration=6.0, listeners=3)
    assert bench.ended(player) == 0
    now_ns = time.time_ns()
    bench.wait(lambda: time_ns(states[-1].header.stamp) > now_ns, 'the end of the motion')
    recorder.send_signal(signal.SIGINT)
    assert bench.ended(recorder) == 0
    assert 'Traceback' not in bench.said()
    found = identify([read_log(bench.folder / 'bag', ROBOT)], ROBOT, 'paper')
    table = read_model('table1', ROBOT)
    for term, value in zip(found.terms, found.estimate.values, strict=True):
        np.testing.assert_allclose(value, table.values[term.name][0], rtol=0.03)
    # it brakes by itself when it is told to end in mid-motion
    rest = joint_values(states[-1], 'position')
    states.clear()
    player = bench.start('par4_motion', motion='excitation', duration=60.0)
    bench.wait(lambda: states and np.abs(
        joint_values(states[-1], 'position') - rest).max() > 0.02, 'a motion')
    child.send_signal(signal.SIGTERM)
    assert bench.ended(child) == 0
    # and who comes in its place is not sent on from the middle of the path
    assert bench.ended(player) == 2
    assert 'excitation aborted: nobody publishes joint_states any more' in bench.said()
    assert 'stopped, joints at 0.000 rad/s' in told.read_text()
    assert 'leaves out are those of the reference robot: limits.joint_position' in told.read_text()
    # of its last messages a busy machine misses some; between those that came nothing jumps
    stamps = np.array([time_ns(state.header.stamp) for state in states]) / SECOND
    q = np.array([joint_values(state, 'position') for state in states])
    steps = np.diff(stamps)
    near = steps < 0.02
    assert np.abs(np.diff(q, axis=0)[near] / steps[near, None]).max() < 10.0


def test_the_monitor_tells_which_joint_drifts_and_what_it_acts_like(bench):
    """A machine by its stamps, faster than the wall clock: healthy, then stiff in joint 2."""
    diagnostics = bench.listen(DIAGNOSTICS)
    bench.start('par4_monitor', model_file='table1', learning=10, **{
        f'qos_overrides./{JOINT_STATES.name}.subscription.depth': UNHEARD})
    states = bench.publisher(JOINT_STATES, depth=UNHEARD)  # it hears all, however fast it comes
    motion = named_motion('excitation', ROBOT, 40.0)
    rows = slice(1000, len(motion.t) - 1000, 8)
    torque = torque_of('table1', motion)[rows]
    q, qd = motion.q[rows], motion.qd[rows]
    random = np.random.default_rng(0)
    sent = 0

    def publish(friction: float) -> None:
        nonlocal sent
        message = JointState(name=list(JOINT_NAMES))
        for _ in range(250):
            row = sent % (2 * len(q) - 2)  # there and back, without a jump of position
            sign = 1.0 if row < len(q) else -1.0
            row = row if row < len(q) else 2 * len(q) - 2 - row
            # on the way back friction acts the other way round, all else as on the way there
            dry = 2.0 * (2.43 * np.sign(qd[row]) + 2.04 * qd[row]) if sign < 0.0 else 0.0
            stiff = friction * sign * np.sign(qd[row]) * (0.0, 0.0, 1.0, 0.0)
            sent += 1
            write_joint_state(message, sent * 8 * MILLISECOND, q[row], effort=(
                torque[row] - dry + stiff + 0.05 * random.normal(size=4)))
            states.publish(message)
        bench.executor.spin_once(timeout_sec=0.02)

    def told(text: str, friction: float) -> bool:
        publish(friction)
        newest = bench.statuses(diagnostics, 'par4_monitor')[-1:]
        return bool(newest) and text in newest[0].message

    bench.wait(lambda: told('follows its model', 0.0), 'the monitor to have learnt')
    bench.wait(lambda: told('drifts from its model: arm_joint_2 (Coulomb friction)', 0.5),
               'the drift')
    status = bench.statuses(diagnostics, 'par4_monitor')[-1]
    assert status.level == WARN
    assert 'joint 2 has +0.' in status.message
    assert 'beside its model since' in status.message


def test_the_monitor_tells_stamps_that_do_not_move(bench):
    diagnostics = bench.listen(DIAGNOSTICS)
    bench.start('par4_monitor', model_file='table1')
    states = bench.publisher(JOINT_STATES)
    message = JointState(name=list(JOINT_NAMES))
    write_joint_state(message, 12 * SECOND, np.zeros(4), effort=np.zeros(4))

    def told() -> bool:
        states.publish(message)
        bench.executor.spin_once(timeout_sec=0.02)
        newest = bench.statuses(diagnostics, 'par4_monitor')[-1:]
        return bool(newest) and 'the stamps of joint_states do not move' in newest[0].message

    bench.wait(told, 'the stamps to be told')
    status = bench.statuses(diagnostics, 'par4_monitor')[-1]
    assert status.level == WARN
    assert 'the last at 12.000 s' in status.message


@pytest.mark.parametrize(('package', 'node'), [
    ('par4_sim', 'simulation'), ('par4_identification', 'record'), ('par4_kinematics', 'motion')])
def test_ctrl_c_while_a_node_starts_shows_no_traceback(bench, package, node):
    code = f"""
import sys
import par4_kinematics.ros.start as start
load = start.import_module
start.import_module = lambda name: (print('loading', flush=True), load(name))[1]
from {package}_start import {node}
sys.exit({node}())
"""
    for seconds in (0.0, 0.4, 1.5):  # whatever it is doing then
        child = subprocess.Popen([sys.executable, '-c', code], env=bench.environment,
                                 cwd=bench.folder, stdout=subprocess.PIPE,
                                 stderr=subprocess.STDOUT, text=True)
        bench.children.append(child)
        assert child.stdout.readline() == 'loading\n'
        time.sleep(seconds)
        child.send_signal(signal.SIGINT)
        said, _ = child.communicate(timeout=DEADLINE)
        assert (child.returncode, 'Traceback' in said) == (0, False), said
        shutil.rmtree(bench.folder / 'recording', ignore_errors=True)


@pytest.mark.parametrize('node', MODULES)
def test_the_parameter_file_of_a_node_has_its_defaults(node):
    """`make docs` writes them."""
    module = import_module(MODULES[node])
    node_class, = (value for value in vars(module).values() if isinstance(value, type)
                   and issubclass(value, Par4Node) and value is not Par4Node)
    path = SOURCES / MODULES[node].split('.')[0] / 'config' / f'{node}.yaml'
    assert path.read_text() == config(node, node_class.PARAMETERS), 'run make docs'
    told = read_yaml(path)['/**']['ros__parameters']
    assert told == dataclasses.asdict(node_class.PARAMETERS())


def test_a_parameter_file_is_taken(bench):
    done = subprocess.run(
        [sys.executable, '-m', MODULES['par4_simulation'], '--ros-args', '--params-file',
         str(SOURCES / 'par4_sim' / 'config' / 'par4_simulation.yaml'), '-p',
         'fidelity:=perfect'], env=bench.environment, cwd=bench.folder, capture_output=True,
        text=True, timeout=DEADLINE)
    assert done.returncode == 2
    assert done.stderr.startswith("error: parameter fidelity: 'perfect' asked")
    assert done.stderr.count('\n') == 1
