"""A log of a motion that turns the platform into a singular pose and back.

Recorded machines keep away from such poses, so the torque is the one that the rigid bodies and
friction need on a path of sines, with noise, and positions in encoder counts.
"""

from __future__ import annotations

import numpy as np
from hidden.machines import Known
from scipy.interpolate import CubicSpline

from par4_dynamics.state import state_of_platform
from par4_identification.logs.log import Log
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.velocity import jacobian_parts
from par4_kinematics.workspace import home_pose

PERIOD, DURATION = 1e-3, 16.0
NEAR = 0.015
"""rad short of the singular pose; at it torques would be infinite."""
NOISE = 0.05
"""N m rms."""


def singular_log(known: Known, random: np.random.Generator) -> Log:
    """Return the log of a machine whose platform once turns almost into a singular pose."""
    robot, home = known.robot, home_pose(known.robot)
    t = np.arange(0.0, DURATION, PERIOD)
    size = 0.15 * robot.limits.workspace.radius
    x = np.tile(home, (len(t), 1))
    for axis in range(4):
        for hertz in random.uniform(0.2, 1.6, 5):
            wave = np.sin(2.0 * np.pi * hertz * t + random.uniform(-np.pi, np.pi))
            x[:, axis] += (size if axis < 3 else 0.25) / 2.5 * wave
    at = random.uniform(5.0, DURATION - 4.0)
    bump = np.where(np.abs(t - at) < 1.0, 0.5 * (1.0 + np.cos(np.pi * (t - at))), 0.0) ** 2
    x[:, 3] = (1.0 - bump) * x[:, 3] + bump * (singular_angle(known) - NEAR)
    path = CubicSpline(t, x)
    state = state_of_platform(robot.geometry, t, x, path(t, 1), path(t, 2))
    count = 2.0 * np.pi / robot.drives.encoder_counts
    q = count * np.round(inverse_kinematics(robot.geometry, x) / count)
    tau = known.model.torque(state) + NOISE * random.standard_normal(state.q.shape)
    return Log(name='past a singular pose', joint_names=robot.joint_names, start_stamp=0,
               period=PERIOD, t=t, q=q, tau=tau, segments=(slice(0, len(t)),), reference=None,
               accounts=None)


def singular_angle(known: Known) -> float:
    """Return the smallest theta above home's at which det J_x changes its sign, rad."""
    theta = np.linspace(0.0, 2.0, 4001)
    poses = np.tile(home_pose(known.robot), (len(theta), 1))
    poses[:, 3] = theta
    sign = np.sign(np.linalg.det(jacobian_parts(known.robot.geometry, poses)[0]))
    return float(theta[np.flatnonzero(sign != sign[0])[0]])
