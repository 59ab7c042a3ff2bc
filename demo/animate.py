"""Pictures of the robot in motion: an Adept cycle with a turn of the tool, as a GIF.

`python demo/animate.py --output docs/par4.gif`; no screen is needed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image
from rich.progress import track

from par4_kinematics.adept import adept_motion
from par4_kinematics.files import written_atomically
from par4_kinematics.robot import read_robot
from par4_sim.bullet import Camera, render

SLOWER = 12.0
"""Times slower than the real cycle of a quarter of a second."""
FRAMES_PER_SECOND = 12
COLOURS = 64


def main() -> None:
    """Write the GIF."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--output', type=Path, required=True)
    parser.add_argument('--robot', default='reference')
    parser.add_argument('--width', type=int, default=480)
    arguments = parser.parse_args()
    robot = read_robot(arguments.robot)
    motion = adept_motion(robot, theta_swing=1.5)
    count = round(motion.duration * SLOWER * FRAMES_PER_SECOND)
    rows = np.linspace(0, len(motion.t) - 1, count, endpoint=False).round().astype(int)
    size = (arguments.width, 3 * arguments.width // 4)
    frames = [Image.fromarray(render(robot, motion.x[row], *size, Camera(zoom=1.05))).quantize(
        COLOURS) for row in track(rows, description='drawing')]
    with written_atomically(arguments.output) as scratch:
        frames[0].save(scratch, save_all=True, append_images=frames[1:], loop=0,
                       duration=round(1000 / FRAMES_PER_SECOND), optimize=True)


if __name__ == '__main__':
    main()
