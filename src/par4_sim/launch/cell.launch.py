"""A simulated robot cell: simulation, feedforward and platform pose, on the simulation's clock.

When one part ends or cannot start, all end.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from par4_kinematics.robot import read_robot
from par4_sim.urdf import robot_description

PICTURES_HZ = 31.0
"""Of robot_state_publisher: with a shorter period than that of the passive joints in joint_states,
it takes each message with them whole, and arms and rods are drawn at the same time."""


def generate_launch_description():
    """Return the nodes; see `ros2 launch par4_sim cell.launch.py --show-args`."""
    robot = {'robot_file': LaunchConfiguration('robot_file')}
    clock = {'use_sim_time': True}
    return LaunchDescription([
        DeclareLaunchArgument('robot_file', default_value='reference',
                              description='robot.yaml or built-in name'),
        DeclareLaunchArgument('machine', default_value='table1_full',
                              description='model.yaml of the machine as it truly is'),
        DeclareLaunchArgument('model', default_value='table1',
                              description='model.yaml of the feedforward'),
        DeclareLaunchArgument('fidelity', default_value='fast',
                              choices=['accurate', 'fast', 'exact'],
                              description='how exactly the mechanism is simulated'),
        DeclareLaunchArgument('window', default_value='false',
                              choices=['true', 'false'],
                              description='show the robot in a window of pybullet'),
        DeclareLaunchArgument('rviz', default_value='false',
                              choices=['true', 'false'],
                              description='show the robot in RViz'),
        # first, because its packages may be missing: then nothing has started yet
        OpaqueFunction(function=_rviz, condition=IfCondition(LaunchConfiguration('rviz'))),
        Node(package='par4_sim', executable='par4_simulation', output='screen',
             on_exit=Shutdown(reason='par4_simulation has ended'),
             parameters=[robot, {'model_file': LaunchConfiguration('machine'),
                                 'fidelity': LaunchConfiguration('fidelity'),
                                 'window': LaunchConfiguration('window')}]),
        Node(package='par4_dynamics', executable='par4_feedforward', output='screen',
             on_exit=Shutdown(reason='par4_feedforward has ended'),
             parameters=[robot, clock, {'model_file': LaunchConfiguration('model')}]),
        Node(package='par4_kinematics', executable='par4_kinematics', output='screen',
             on_exit=Shutdown(reason='par4_kinematics has ended'),
             parameters=[robot, clock]),
    ])


def _rviz(context):
    """Return robot_state_publisher, whose own description goes nowhere, and RViz."""
    robot = read_robot(LaunchConfiguration('robot_file').perform(context))
    view = Path(__file__).parents[1] / 'rviz' / 'par4.rviz'
    clock = {'use_sim_time': True}
    return [
        Node(package='robot_state_publisher', executable='robot_state_publisher',
             on_exit=Shutdown(reason='robot_state_publisher has ended'),
             parameters=[clock, {
                 'robot_description': ParameterValue(robot_description(robot), value_type=str),
                 'publish_frequency': PICTURES_HZ}],
             remappings=[('robot_description', '~/robot_description')]),
        Node(package='rviz2', executable='rviz2', arguments=['-d', str(view)],
             parameters=[clock]),
    ]
