"""Pictures of the robot, offscreen or in a window."""

from __future__ import annotations

import os
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.errors import InputError
from par4_kinematics.robot import Robot
from par4_sim.description.robot_tree import (
    robot_description,
    tree_joint_positions,
)
from par4_sim.plants.engine import load_body, pybullet


@dataclass(frozen=True)
class Camera:
    """A view of the whole robot; angles in degrees, elevation negative to look down.

    Attributes:
        yaw_deg: direction of view about z.
        elevation_deg: direction of view against the horizontal.
        zoom: above 1 comes nearer.
    """

    yaw_deg: float = 27.0
    elevation_deg: float = -22.0
    zoom: float = 1.0


FRONT = Camera()
FIELD_OF_VIEW_DEG = 45.0
WINDOW_CLOSER = 0.65
"""Distance of the camera of a window, whose field of view is wider, over that of a picture."""
SUPERSAMPLING = 2
"""Pixels drawn for one of the picture, each way: smooth edges."""


class View:
    """The robot, drawn from `robot_description` in an engine of its own: for any plant or log.

    Args:
        robot: what is drawn.
        window: on the screen instead of offscreen.

    Raises:
        InputError: a window without a screen.
    """

    def __init__(self, robot: Robot, window: bool = False) -> None:
        self._geometry = robot.geometry
        self._reach = robot.geometry.arm_length + robot.geometry.forearm_length
        if window:
            require_screen()
        self._client = pybullet.connect(pybullet.GUI if window else pybullet.DIRECT)
        self._body = load_body(_weightless(robot_description(robot)), self._client, fixed=True)
        self._joints = {
            pybullet.getJointInfo(self._body, index, physicsClientId=self._client)[1].decode():
            index for index in range(pybullet.getNumJoints(
                self._body, physicsClientId=self._client))}
        if window:
            pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_GUI, 0,
                                              physicsClientId=self._client)
            pybullet.resetDebugVisualizerCamera(
                WINDOW_CLOSER * self._distance(FRONT), FRONT.yaw_deg, FRONT.elevation_deg,
                self._centre, physicsClientId=self._client)

    @property
    def _centre(self) -> tuple[float, float, float]:
        return 0.0, 0.0, -0.36 * self._reach

    def _distance(self, camera: Camera) -> float:
        return 1.4 * self._reach / camera.zoom

    @property
    def open(self) -> bool:
        """Whether it can be drawn in: a window may have been closed by its user."""
        return bool(pybullet.isConnected(self._client))

    def show(self, x: ArrayLike) -> None:
        """Draw the robot at pose x (4,), m and rad; raises UnreachableError."""
        positions = tree_joint_positions(self._geometry, x)
        for name, index in self._joints.items():
            pybullet.resetJointState(self._body, index, positions[name],
                                     physicsClientId=self._client)

    def picture(self, width: int, height: int, camera: Camera = FRONT) -> np.ndarray:
        """Return a picture (height, width, 3), uint8, of what is shown."""
        view = pybullet.computeViewMatrixFromYawPitchRoll(
            self._centre, self._distance(camera), camera.yaw_deg, camera.elevation_deg, 0.0, 2)
        projection = pybullet.computeProjectionMatrixFOV(
            FIELD_OF_VIEW_DEG, width / height, 0.05 * self._reach, 10.0 * self._reach)
        pixels = pybullet.getCameraImage(
            SUPERSAMPLING * width, SUPERSAMPLING * height, view, projection,
            lightDirection=(0.6, -0.9, 1.6), renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client)[2]
        fine = np.reshape(pixels, (height, SUPERSAMPLING, width, SUPERSAMPLING, 4))[..., :3]
        return fine.mean(axis=(1, 3)).round().astype(np.uint8)

    def close(self) -> None:
        """Release the engine; the view cannot be used afterwards."""
        if self.open:
            pybullet.disconnect(physicsClientId=self._client)


def render(robot: Robot, x: ArrayLike, width: int = 640, height: int = 480,
           camera: Camera = FRONT) -> np.ndarray:
    """Return a picture (height, width, 3), uint8, of the robot at pose x (4,).

    Raises:
        UnreachableError: a pose that a leg cannot reach.
    """
    view = View(robot)
    try:
        view.show(x)
        return view.picture(width, height, camera)
    finally:
        view.close()


def require_screen() -> None:
    """Raise InputError where there is no screen: the engine would end the process."""
    if sys.platform.startswith('linux') and not os.environ.get('DISPLAY'):
        raise InputError('window asked, found no screen (DISPLAY is not set); start it on a '
                         'desktop or leave out window:=true')


def _weightless(urdf: str) -> str:
    """Return a URDF with zero mass where it says none; the engine would warn and take 1 kg."""
    tree = ElementTree.fromstring(urdf)
    for link in tree.iter('link'):
        if link.find('inertial') is None:
            inertial = ElementTree.SubElement(link, 'inertial')
            ElementTree.SubElement(inertial, 'mass', value='0')
            ElementTree.SubElement(inertial, 'inertia', dict.fromkeys(
                ('ixx', 'iyy', 'izz', 'ixy', 'ixz', 'iyz'), '0'))
    return ElementTree.tostring(tree, encoding='unicode')
