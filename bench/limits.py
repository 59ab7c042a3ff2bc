"""Where looking ahead pays: motions that ask for more than torque, speed or workspace allow.

Each controller follows the same motion with the feedforward of the exact model and of TABLE 1 on a
machine whose drives are limited. Prints a table in Markdown, and how much time of a core the
predictive law takes for a look ahead where a limit is near. `python bench/limits.py`.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from par4_dynamics.model_from_file import read_model
from par4_kinematics.adept import adept_motion
from par4_kinematics.motion import Motion, waypoints_motion
from par4_kinematics.robot import read_robot
from par4_sim.drives.predictive import Predictive
from par4_sim.tracking.case import Plan

ROBOT = read_robot('reference')
MACHINE = read_model('table1_full', ROBOT)
MODELS = {'exact': MACHINE, 'TABLE 1': read_model('table1', ROBOT)}
CONTROLLERS = ('loops', 'computed_torque', 'predictive')
JERK = 30_000.0


@dataclass(frozen=True)
class Limited:
    """A motion and the limits of the drives that follow it."""

    motion: Motion
    drives: dict[str, float]


CYCLE = adept_motion(ROBOT, jerk=JERK)
TRAPEZOIDS = adept_motion(ROBOT)
TO_THE_EDGE = waypoints_motion(ROBOT, ((0.2, 0.0, -0.75, 0.0), (0.4999, 0.0, -0.75, 0.0)),
                               speed=5.0, acceleration=150.0, jerk=JERK)
CASES = {
    '15 G, jerk limited (140 N m), 110 N m': Limited(CYCLE, {'torque_limit': 110.0}),
    '15 G, jerk limited, 90 N m': Limited(CYCLE, {'torque_limit': 90.0}),
    '15 G, jerk limited, 70 N m': Limited(CYCLE, {'torque_limit': 70.0}),
    '15 G, trapezoids (142 N m), 90 N m': Limited(TRAPEZOIDS, {'torque_limit': 90.0}),
    '15 G, trapezoids, 70 N m': Limited(TRAPEZOIDS, {'torque_limit': 70.0}),
    '15 G, jerk limited (7.76 rad/s), 7 rad/s': Limited(CYCLE, {'speed_limit': 7.0}),
    'to 0.1 mm from the edge (113 N m), 80 N m': Limited(TO_THE_EDGE, {'torque_limit': 80.0}),
}


def main() -> None:
    """Print the table and the times."""
    looks: list[float] = []
    look = Predictive.look_ahead

    def timed(self: Predictive, *arguments: object) -> None:
        solved = self.programs
        begin = time.thread_time()
        look(self, *arguments)
        if self.programs > solved:
            looks.append(time.thread_time() - begin)

    Predictive.look_ahead = timed
    print('| motion, limit | feedforward | controller | rms, mm | peak, mm | peak speed, rad/s '
          '| outside, mm | arrival, ms |\n|---|---|---|---|---|---|---|---|')
    for name, limited in CASES.items():
        robot = ROBOT.model_copy(update={
            'drives': ROBOT.drives.model_copy(update=limited.drives)})
        plan = Plan(robot, MACHINE, limited.motion)
        for called, model in MODELS.items():
            for controller in CONTROLLERS:
                found = plan.case(controller, called, model).tracking
                print(f'| {name} | {called} | {controller} | {1e3 * found.rms:.2f} '
                      f'| {1e3 * found.peak:.2f} | {found.peak_speed:.2f} '
                      f'| {1e3 * found.outside:.2f} | {1e3 * found.arrival:.0f} |', flush=True)
    shares = 1e3 * np.quantile(looks, (0.5, 0.9, 0.99))
    print(f'{len(looks)} programs: median {shares[0]:.2f} ms, 90 % {shares[1]:.2f} ms, 99 % '
          f'{shares[2]:.2f} ms a look ahead')


if __name__ == '__main__':
    main()
