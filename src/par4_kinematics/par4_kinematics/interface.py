"""The contract with other programs as one table: topics, services, executables, parameters.

Readable without ROS; `python -m par4_kinematics.interface` prints `docs/interface.md`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from par4_kinematics.robot import JOINT_NAMES

BASE_FRAME = 'base'
TOOL_FRAME = 'tool'


@dataclass(frozen=True)
class Topic:
    """A topic: relative name (a namespace or a remap moves it), message type, who to whom."""

    name: str
    type: str
    source: str
    target: str
    content: str
    transient_local: bool = False
    depth: int = 1000

    @property
    def qos_yaml(self) -> str:
        """Durability in words."""
        return (f'reliable, {"transient local" if self.transient_local else "volatile"}, '
                f'keep last {self.depth}')


JOINT_STATES = Topic(
    'joint_states', 'sensor_msgs/msg/JointState', 'robot or simulation', 'all',
    f'{JOINT_NAMES[0]} .. {JOINT_NAMES[-1]} selected by name, any order, other joints ignored; '
    'rad, rad/s; effort = nominal G_i V_i, N m')
AMPLIFIER_VOLTAGE = Topic(
    'amplifier_voltage', 'sensor_msgs/msg/JointState', 'robot or simulation', 'recorder',
    "same names; effort carries the amplifier's input in V, after clipping; torque = G_i V_i (24)")
REFERENCE = Topic(
    'reference', 'trajectory_msgs/msg/JointTrajectory', 'motion', 'feedforward, drive',
    '1..N points: positions, velocities, accelerations of the four joints; time = header.stamp + '
    'time_from_start; a stamp of zero starts 0.2 s after receipt')
FEEDFORWARD_TORQUE = Topic(
    'feedforward_torque', 'trajectory_msgs/msg/JointTrajectory', 'feedforward', 'drive',
    'the reference with effort filled, N m; stamp and times copied')
PLATFORM_POSE = Topic(
    'platform_pose', 'geometry_msgs/msg/PoseStamped', 'kinematics', 'users',
    f'pose of D in `{BASE_FRAME}`, rotation = tool angle = rotation_amplification x theta')
ROBOT_DESCRIPTION = Topic(
    'robot_description', 'std_msgs/msg/String', 'simulation', 'viewers',
    'URDF (tree with the loops cut)', transient_local=True, depth=1)
CLOCK = Topic('/clock', 'rosgraph_msgs/msg/Clock', 'simulation (`publish_clock`)', 'all',
              'simulated time; QoS as ROS defines; one simulation a domain, or remap it')
DIAGNOSTICS = Topic(
    '/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', 'every node', 'users',
    'what the node does now (ERROR: it does not move by its own fault), late steps, rejected and '
    'missed messages, unreachable poses, ages of the inputs; the pace of the simulation')
TRUE_TORQUE = Topic('~/true_torque', 'sensor_msgs/msg/JointState', 'simulation', 'tests only',
                    'what a real robot would not tell; never read by identification')
TRUE_POSE = Topic('~/true_pose', 'geometry_msgs/msg/PoseStamped', 'simulation', 'tests only',
                  'what a real robot would not tell; never read by identification')

TOPICS = (JOINT_STATES, AMPLIFIER_VOLTAGE, REFERENCE, FEEDFORWARD_TORQUE, PLATFORM_POSE,
          ROBOT_DESCRIPTION, CLOCK, DIAGNOSTICS, TRUE_TORQUE, TRUE_POSE)
RECORDED_TOPICS = (JOINT_STATES, AMPLIFIER_VOLTAGE, REFERENCE, FEEDFORWARD_TORQUE)
"""What identification reads: `par4_record` writes it, and `par4_simulate` leaves it in its bag."""
SHOWN_TOPICS = (PLATFORM_POSE, ROBOT_DESCRIPTION, DIAGNOSTICS)
"""What `par4_record` writes beside it, for programs that show a bag; no tool reads it."""

COUNTS = {
    'saturated_commands': 'torques that the drives wanted and cut to their torque_limit, counted '
                          'for each joint and physics step',
    'saturated_speeds': 'speeds that the drives wanted and cut to their speed_limit, counted for '
                        'each joint and physics step',
    'late_points': 'reference points left out because they came after their time',
    'missing_effort': 'reference points without a feedforward torque, which counts as 0',
    'interrupted_references': 'references that ended in motion and were not gone on with, so that '
                              'the drives braked',
    'unsolved_programs': 'looks ahead in which predictive control found no correction',
    'late_steps': 'samples that came more than a sample period after their time',
    'rejected_messages': 'messages that could not be used',
    'unreachable_poses': 'poses that a leg does not reach, or joints that do not close the '
                         'mechanism',
    'missed_messages': 'messages that were published and did not come',
    'lost_messages': 'messages that were published and are not in the bag',
    'clock_jumps': 'times that the clock jumped back',
    'skipped_windows': 'windows of par4_monitor that could not be looked at',
}
"""What nodes count on the diagnostics, and `par4_simulate` tells of its run."""

SERVICES = (
    ('par4_simulation', ('~/reset', '~/stop', '~/pause', '~/resume')),
    ('par4_motion', ('~/stop',)),
    ('par4_record', ('~/start', '~/stop')),
    ('nodes with a model', ('~/reload_model',)),
)
"""All std_srvs/srv/Trigger."""

EXECUTABLES = (
    ('par4_kinematics', 'par4_kinematics', 'node: joint_states -> platform_pose'),
    ('par4_kinematics', 'par4_motion',
     'node: plays a motion (adept, excitation, circle, a file) as `reference`'),
    ('par4_dynamics', 'par4_feedforward', 'node: reference -> feedforward_torque'),
    ('par4_sim', 'par4_simulation', 'node: the simulated Par4 with drives and sensors'),
    ('par4_sim', 'par4_simulate',
     'offline: the same simulation without ROS, same topics in the bag'),
    ('par4_sim', 'par4_cell',
     'runs simulation, cell, recording or identification together, as the launch files do'),
    ('par4_sim', 'par4_push',
     'offline: static pushes on a simulated force sensor, a bag and its readings'),
    ('par4_sim', 'par4_track',
     'offline: how well controllers and models make a machine follow a motion'),
    ('par4_sim', 'par4_fastest',
     'offline: the shortest cycle of a path within torque and a peak error, and its bound'),
    ('par4_identification', 'par4_record', 'node: records a bag; `--repair BAG` mends one cut off'),
    ('par4_identification', 'par4_monitor',
     'node: measured against model torque, live; what drifts, how and since when'),
    ('par4_identification', 'par4_excite',
     'offline: designs an excitation motion file and says what to expect of it'),
    ('par4_identification', 'par4_bag',
     'offline: makes a bag from CSV, .npz or .mat logs of any machine; `--inspect BAG` says '
     'what a bag holds and what each tool could do with it'),
    ('par4_identification', 'par4_identify', 'offline: identifies a model from bags'),
    ('par4_identification', 'par4_validate', 'offline: cross-validates a model on a bag'),
    ('par4_identification', 'par4_diagnose', 'offline: names what the model gets wrong'),
    ('par4_identification', 'par4_trend',
     'offline: parameters and effects of dated bags over time, and when they changed'),
    ('par4_identification', 'par4_simplification',
     'offline: what (20) leaves out, by imposed displacement in pybullet'),
    ('par4_identification', 'par4_drive_gain',
     'offline: drive gains from static pushes on a force sensor'),
)

SCHEMAS = (
    ('robot.yaml', 'par4/robot/1', 'a robot with the Par4 topology; its keys: '
                                   '[robot_file.md](robot_file.md)'),
    ('robot.yaml', 'par4/axis/1', 'a single motor-driven axis; its keys: '
                                  '[robot_file.md](robot_file.md)'),
    ('model.yaml', 'par4/model/1', 'parameters and effects: identification, feedforward and '
                                   'simulation share it; its keys: '
                                   '[model_file.md](model_file.md)'),
    ('motion.yaml', 'par4/motion/1', 'a recipe, or samples in a CSV beside it; its keys: '
                                     '[motion_file.md](motion_file.md)'),
    ('identification.json', 'par4/identification/1',
     'written by `par4_identify`; its keys: [result_files.md](result_files.md)'),
    ('validation.json', 'par4/validation/1',
     'written by `par4_validate`; its keys: [result_files.md](result_files.md)'),
    ('diagnosis.json', 'par4/diagnosis/1',
     'written by `par4_diagnose`; its keys: [result_files.md](result_files.md)'),
    ('trend.json', 'par4/trend/1', 'written by `par4_trend`'),
    ('simplification.json', 'par4/simplification/1', 'written by `par4_simplification`'),
    ('tracking.json', 'par4/tracking/1', 'written by `par4_track`'),
    ('fastest.json', 'par4/fastest/1', 'written by `par4_fastest`'),
    ('drive_gain.json', 'par4/drive_gain/1', 'written by `par4_drive_gain`'),
    ('par4_bag --inspect BAG --json', 'par4/inspection/1',
     'printed: what a bag holds and is good for'),
)

START_DELAY = 0.2
"""Seconds from receipt to the start of a reference whose stamp is zero."""


def table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """Return a table as the generated pages have it."""
    lines = ['| ' + ' | '.join(header) + ' |', '|' + '---|' * len(header)]
    return '\n'.join(lines + ['| ' + ' | '.join(row) + ' |' for row in rows])


def markdown() -> str:
    """Return `docs/interface.md`."""
    topics = [(f'`{topic.name}`', topic.type.replace('/msg/', '/'),
               f'{topic.source} -> {topic.target}', topic.content) for topic in TOPICS]
    services = [(f'`{node}`', ', '.join(f'`{name}`' for name in names)) for node, names in SERVICES]
    return f"""# Interface

Generated from `par4_kinematics/interface.py` by `make docs`; do not edit.

## Topics

Reliable, volatile, keep last {JOINT_STATES.depth}; `{ROBOT_DESCRIPTION.name}`
{ROBOT_DESCRIPTION.qos_yaml}.
A stamp is the time at which the value is valid, never that of publishing. With a simulation all
stamps are on its clock and every other node runs with `use_sim_time`.

{table(('topic', 'type', 'from -> to', 'content'), topics)}

## Counts

What `{DIAGNOSTICS.name}` counts of things that went wrong; `par4_simulate` prints those of its run.

{table(('count', 'of what'), [(f'`{a}`', b) for a, b in COUNTS.items()])}

## Services (std_srvs/Trigger)

{table(('node', 'services'), services)}

## Executables

{table(('package', 'executable', 'purpose'), [(a, f'`{b}`', c) for a, b, c in EXECUTABLES])}

## Files

SI units, radians; YAML 1.2 (`1e-3` is a number).

{table(('file', 'schema', 'content'), [(f'`{a}`', f'`{b}`', c) for a, b, c in SCHEMAS])}
"""


if __name__ == '__main__':
    print(markdown(), end='')
