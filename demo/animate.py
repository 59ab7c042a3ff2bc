"""Pictures of the robot in motion, drawn offscreen: a GIF and, beside it, a still as PNG.

`python demo/animate.py --output docs/par4.gif` shows an Adept cycle in slow motion with a turn of
the tool, `--bag BAG` the liveliest seconds of what a bag measured, as fast as they were.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from rich.progress import track

from par4_identification import read_log
from par4_kinematics import InputError, Par4Error, Robot, forward_kinematics, read_robot
from par4_kinematics.adept import adept_motion
from par4_kinematics.files import written_atomically
from par4_kinematics.paths import refuse_unwritable
from par4_sim.pictures.view import View

SLOWER = 12.0
"""Times slower than the real cycle of a quarter of a second."""
SHOWN = 4.0
"""Seconds of a bag that are shown."""
FRAMES_PER_SECOND = 10
COLOURS = 96
NARROWEST, WIDEST = 40, 4000
"""Pixels of a picture."""


def adept_poses(robot: Robot) -> np.ndarray:
    """Return poses (n, 4), one a picture, of an Adept cycle with a turn of the tool."""
    motion = adept_motion(robot, theta_swing=1.5)
    count = round(motion.duration * SLOWER * FRAMES_PER_SECOND)
    return motion.x[np.linspace(0, len(motion.t) - 1, count, endpoint=False).round().astype(int)]


def measured_poses(robot: Robot, bag: Path) -> np.ndarray:
    """Return poses (n, 4), one a picture, of the liveliest seconds of a bag.

    Raises:
        InputError: a bag that cannot be read.
        UnreachableError: positions that do not close the loops of the robot.
    """
    log = read_log(bag, robot)
    every = max(1, round(1.0 / (FRAMES_PER_SECOND * log.period)))
    x = forward_kinematics(robot.geometry, log.q[::every])
    count = min(round(SHOWN * FRAMES_PER_SECOND), len(x))
    way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1))]
    first = int(np.argmax(way[count - 1:] - way[:len(way) - count + 1]))
    return x[first:first + count]


def animate(robot: Robot, poses: np.ndarray, output: Path, width: int = 480) -> None:
    """Write poses (n, 4) as a GIF, and the middle one as a PNG of the same name."""
    size = (width, 3 * width // 4)
    view = View(robot)
    frames = []
    for x in track(poses, description='drawing'):
        view.show(x)
        frames.append(Image.fromarray(view.picture(*size)).quantize(
            COLOURS, Image.Quantize.MAXCOVERAGE))  # the platform is small and of many colours
    view.show(poses[len(poses) // 2])
    still = Image.fromarray(view.picture(2 * size[0], 2 * size[1]))
    view.close()
    with written_atomically(output) as scratch:
        frames[0].save(scratch, save_all=True, append_images=frames[1:], loop=0,
                       duration=round(1000 / FRAMES_PER_SECOND), optimize=True)
    with written_atomically(output.with_suffix('.png')) as scratch:
        still.save(scratch)


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--output', type=Path, required=True, help='GIF to write')
    parser.add_argument('--robot', default='reference')
    parser.add_argument('--bag', type=Path, help='show what this bag measured')
    parser.add_argument('--width', type=int, default=480, help='pixels')
    arguments = parser.parse_args()
    try:
        if arguments.output.suffix.lower() != '.gif':
            raise InputError(f'--output {arguments.output}: expected a name that ends in .gif; the '
                             f'still goes into a .png beside it')
        if not NARROWEST <= arguments.width <= WIDEST:
            raise InputError(f'--width {arguments.width}: expected {NARROWEST} to {WIDEST} pixels')
        refuse_unwritable(arguments.output.parent)
        robot = read_robot(arguments.robot)
        poses = measured_poses(robot, arguments.bag) if arguments.bag else adept_poses(robot)
        animate(robot, poses, arguments.output, arguments.width)
    except Par4Error as error:
        print(f'error: {error}', file=sys.stderr)
        sys.exit(2)
    print(f'pictures: {arguments.output}, {arguments.output.with_suffix(".png")}')


if __name__ == '__main__':
    main()
