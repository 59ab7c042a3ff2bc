"""The simulated robot alone; `ros2 launch par4_sim simulation.launch.py --show-args`."""

from pathlib import Path

from par4_sim.ros.launched import launch_description


def generate_launch_description():
    """Return the nodes."""
    return launch_description('simulation', Path(__file__).parents[1] / 'rviz' / 'par4.rviz')
