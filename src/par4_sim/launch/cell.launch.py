"""A simulated robot cell: simulation, feedforward and platform pose, on the simulation's clock."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
    """Return the three nodes; see `ros2 launch par4_sim cell.launch.py --show-args`."""
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
                              description='accurate, fast or exact'),
        Node(package='par4_sim', executable='par4_simulation', output='screen',
             parameters=[robot, {'model_file': LaunchConfiguration('machine'),
                                 'fidelity': LaunchConfiguration('fidelity')}]),
        Node(package='par4_dynamics', executable='par4_feedforward', output='screen',
             parameters=[robot, clock, {'model_file': LaunchConfiguration('model')}]),
        Node(package='par4_kinematics', executable='par4_kinematics', output='screen',
             parameters=[robot, clock]),
    ])
