"""A recording, from which par4_identify then identifies a model.

Arguments: `ros2 launch par4_identification identification.launch.py --show-args`.
"""

from par4_sim.ros.launched import launch_description


def generate_launch_description():
    """Return the nodes, and the tool that follows them."""
    return launch_description('identification')
