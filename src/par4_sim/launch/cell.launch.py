"""A simulated robot cell: simulation, feedforward and platform pose, a motion and a recorder.

Arguments: `ros2 launch par4_sim cell.launch.py --show-args`. When one part ends, all end.
"""

from pathlib import Path

from par4_sim.ros.launched import launch_description


def generate_launch_description():
    """Return the nodes."""
    return launch_description('cell', Path(__file__).parents[1] / 'rviz' / 'par4.rviz')
