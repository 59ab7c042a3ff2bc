"""A motion is played with feedforward and recorded, on a simulated or a real robot.

Arguments: `ros2 launch par4_identification recording.launch.py --show-args`. When the motion has
been played, or one part fails, all end.
"""

from par4_sim.ros.launched import launch_description


def generate_launch_description():
    """Return the nodes."""
    return launch_description('recording')
