"""Par4 simulated by pybullet's rigid-body engine; the only file that knows pybullet.

The engine integrates by symplectic Euler: the velocity read at t_k belongs to t_k - dt/2, the
torque of step k acts as at t_k. Loops are closed by point-to-point constraints, dry friction is a
motor that holds each joint still with limited torque: real sticking.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from par4_dynamics.state import GRAVITY
from par4_kinematics.arrays import as_rows
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import Robot
from par4_sim.friction import dry_friction
from par4_sim.machine import Machine
from par4_sim.plant import STEP
from par4_sim.urdf import (
    PLATE_CHAINS,
    PLATE_SLIDES,
    Fidelity,
    LinkPoint,
    chains,
    leg_chain,
    link_positions,
    robot_description,
    tree_joint_positions,
)


@contextlib.contextmanager
def _silent_stderr() -> Iterator[None]:
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


with _silent_stderr():  # its import announces from C when it was built
    import pybullet

ITERATIONS = {'accurate': 200, 'fast': 80}
"""Sweeps of the constraint solver in a step. They alternate in direction; only even numbers end on
the motors of dry friction, so that a joint which these can hold has no velocity at all."""
CLOSING_RATE = 0.8
"""Share of a loop's opening that a step closes."""
UNLIMITED = 1e7
"""Force of a constraint, N, and speed of a joint, rad/s, that no motion reaches."""
FIRST_LINK = -1
"""The engine's index of the first link of a chain."""


class BulletPlant:
    """The machine in pybullet; implements `Plant`. Its first pose comes from `reset`.

    Args:
        machine: what it is.
        fidelity: 'accurate' has every rod and bar and free half plates, 'fast' one rod a forearm
            and half plates that slide; see `par4_sim.urdf.chains`.
        dt: physics step, s.

    Raises:
        InputError: the lumped masses leave a body without mass or inertia.
    """

    def __init__(self, machine: Machine, fidelity: Fidelity, dt: float = STEP) -> None:
        self.dt = dt
        self.velocity_offset = -0.5 * dt
        self.torque_offset = 0.0
        self._machine = machine
        self._fidelity = fidelity
        self._friction = machine.friction.packed
        self._stribeck_joints = np.flatnonzero(self._friction[:, 2]).tolist()
        mechanism = chains(machine.geometry, machine.bodies, fidelity)

        self._client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=dt, numSubSteps=0, numSolverIterations=ITERATIONS[fidelity],
            solverResidualThreshold=0.0, erp=CLOSING_RATE, enableFileCaching=0,
            physicsClientId=self._client)
        self._bodies = {name: _load(urdf, self._client, fixed=True)
                        for name, urdf in mechanism.fixed.items()}
        self._bodies |= {name: _load(urdf, self._client, fixed=False)
                         for name, urdf in mechanism.floating.items()}
        self._links = {(name, link): (body, index) for name, body in self._bodies.items()
                       for link, index in self._freed_links(body).items()}
        self._arms = [self._links[leg_chain(leg), 'arm'] for leg in range(LEGS)]
        self._closures = [(self._centred(closure.first), self._centred(closure.second))
                          for closure in mechanism.closures]
        for first, second in self._closures:
            self._hold_together(first, second)
        self._set_dry_friction(range(LEGS), np.zeros(LEGS))
        self._steps = 0
        self._read_arms()
        self._qd_before = self._qd

    def _freed_links(self, body: int) -> dict[str, int]:
        """Return link name -> index, after taking off damping, speed limits, default motors."""
        name, _ = pybullet.getBodyInfo(body, physicsClientId=self._client)
        indices = {name.decode(): FIRST_LINK}
        for index in range(pybullet.getNumJoints(body, physicsClientId=self._client)):
            joint = pybullet.getJointInfo(body, index, physicsClientId=self._client)
            indices[joint[12].decode()] = index
            if joint[2] == pybullet.JOINT_SPHERICAL:
                pybullet.setJointMotorControlMultiDof(
                    body, index, pybullet.POSITION_CONTROL, targetPosition=(0, 0, 0, 1),
                    force=(0, 0, 0), physicsClientId=self._client)
            else:
                pybullet.setJointMotorControl2(body, index, pybullet.VELOCITY_CONTROL, force=0.0,
                                               physicsClientId=self._client)
        for index in indices.values():
            pybullet.changeDynamics(body, index, linearDamping=0.0, angularDamping=0.0,
                                    jointDamping=0.0, maxJointVelocity=UNLIMITED,
                                    physicsClientId=self._client)
        return indices

    def _centred(self, point: LinkPoint) -> tuple[int, int, np.ndarray]:
        """Return body, link and the point (3,) relative to the link's centre of mass, m."""
        body, link = self._links[point.chain, point.link]
        centre = pybullet.getDynamicsInfo(body, link, physicsClientId=self._client)[3]
        return body, link, np.array(point.position) - centre

    def _hold_together(self, first: tuple[int, int, np.ndarray],
                       second: tuple[int, int, np.ndarray]) -> None:
        constraint = pybullet.createConstraint(
            *first[:2], *second[:2], pybullet.JOINT_POINT2POINT, (0, 0, 0), first[2].tolist(),
            second[2].tolist(), physicsClientId=self._client)
        pybullet.changeConstraint(constraint, maxForce=UNLIMITED, physicsClientId=self._client)

    @property
    def time(self) -> float:
        """Seconds since the last reset."""
        return self._steps * self.dt

    @property
    def q(self) -> np.ndarray:
        """Joint positions (4,), rad."""
        return self._q.copy()

    @property
    def qd(self) -> np.ndarray:
        """Joint velocities (4,), rad/s, half a step ago."""
        return self._qd.copy()

    @property
    def x(self) -> np.ndarray:
        """Pose of D and theta (4,), m, rad: where the engine has half plate 1 and a bar."""
        return self._platform()[0]

    @property
    def xd(self) -> np.ndarray:
        """Velocity of D and thetadot (4,), half a step ago."""
        return self._platform()[1]

    def _platform(self) -> tuple[np.ndarray, np.ndarray]:
        chain = PLATE_CHAINS[0]
        theta, theta_rate = self._joint(*self._links[chain, 'bar_0'])
        if self._fidelity == 'fast':
            slides = [self._joint(*self._links[chain, slide]) for slide in PLATE_SLIDES]
            place, velocity = zip(*slides, strict=True)
        else:
            body = self._bodies[chain]
            place, _ = pybullet.getBasePositionAndOrientation(body, physicsClientId=self._client)
            velocity, _ = pybullet.getBaseVelocity(body, physicsClientId=self._client)
        return np.array((*place, theta)), np.array((*velocity, theta_rate))

    def _joint(self, body: int, link: int) -> tuple[float, float]:
        return pybullet.getJointState(body, link, physicsClientId=self._client)[:2]

    def _read_arms(self) -> None:
        states = np.array([self._joint(body, link) for body, link in self._arms])
        self._q, self._qd = states.T

    def reset(self, x: ArrayLike) -> None:
        """Put the machine at rest at pose x (4,); raises UnreachableError."""
        (pose,), _ = as_rows(x, 'pose x')
        positions = link_positions(self._machine.geometry, self._fidelity, pose)
        for chain_and_link, position in positions.items():
            self._place(*self._links[chain_and_link], position)
        self._steps = 0
        self._read_arms()
        self._qd_before = self._qd

    def _place(self, body: int, link: int, position: np.ndarray) -> None:
        """Put a link at rest at its joint position, see `link_positions`."""
        if np.ndim(position) == 0:
            pybullet.resetJointState(body, link, float(position), 0.0,
                                     physicsClientId=self._client)
        elif len(position) == 4:
            pybullet.resetJointStateMultiDof(body, link, position.tolist(), (0, 0, 0),
                                             physicsClientId=self._client)
        else:
            pybullet.resetBasePositionAndOrientation(body, position.tolist(), (0, 0, 0, 1),
                                                     physicsClientId=self._client)
            pybullet.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0), physicsClientId=self._client)

    def step(self, tau: ArrayLike) -> None:
        """Advance by dt with actuator torques tau (4,), N m, held.

        Raises:
            UnreachableError: the engine lost the mechanism.
        """
        # friction and loads at t_k: the velocity read is half a step old
        velocity = 1.5 * self._qd - 0.5 * self._qd_before
        torque = np.asarray(tau, dtype=float) - self._friction[:, 1] * velocity
        for load in self._machine.loads:
            torque = torque - load(self.time, self.q, velocity)
        self._set_dry_friction(self._stribeck_joints, velocity)
        for (body, link), value in zip(self._arms, torque.tolist(), strict=True):
            pybullet.setJointMotorControl2(body, link, pybullet.TORQUE_CONTROL, force=value,
                                           physicsClientId=self._client)
        pybullet.stepSimulation(physicsClientId=self._client)
        self._steps += 1
        self._qd_before = self._qd
        self._read_arms()
        if not np.isfinite(self._q).all():
            raise UnreachableError(
                f'after {self.time:.4f} s the joint positions are {self._q.tolist()}: the machine '
                f'was driven out of reach; check the torques and the motion')

    def _set_dry_friction(self, joints: Iterable[int], velocity: np.ndarray) -> None:
        """Let motors hold these joints still with at most their dry friction at `velocity`."""
        for joint in joints:
            body, link = self._arms[joint]
            pybullet.setJointMotorControl2(
                body, link, pybullet.VELOCITY_CONTROL, targetVelocity=0.0,
                force=dry_friction(self._friction[joint], abs(velocity[joint])),
                physicsClientId=self._client)

    def loop_opening(self) -> float:
        """Return the largest distance between the two points of a cut ball joint, m."""
        return max(float(np.linalg.norm(self._point(*first) - self._point(*second)))
                   for first, second in self._closures)

    def _point(self, body: int, link: int, point: np.ndarray) -> np.ndarray:
        """Return a point of a link, given from its centre of mass, in `base`."""
        if link == FIRST_LINK:
            centre, quaternion = pybullet.getBasePositionAndOrientation(
                body, physicsClientId=self._client)
        else:
            centre, quaternion = pybullet.getLinkState(
                body, link, computeForwardKinematics=1, physicsClientId=self._client)[:2]
        # not multiplyTransforms, which is single precision
        vector, scalar = np.array(quaternion[:3]), quaternion[3]
        turned = 2.0 * np.cross(vector, point)
        return np.array(centre) + point + scalar * turned + np.cross(vector, turned)

    def close(self) -> None:
        """Release the engine; the plant cannot be used afterwards."""
        pybullet.disconnect(physicsClientId=self._client)


def _load(urdf: str, client: int, fixed: bool) -> int:
    """Return the body of a URDF text; the engine reads files only."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'body.urdf'
        path.write_text(urdf, encoding='utf-8')
        return pybullet.loadURDF(str(path), useFixedBase=fixed,
                                 flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
                                 physicsClientId=client)


@dataclass(frozen=True)
class Camera:
    """A view of the whole robot; angles in degrees, elevation negative to look down.

    Attributes:
        yaw_deg: direction of view about z.
        elevation_deg: direction of view against the horizontal.
        zoom: above 1 comes nearer.
    """

    yaw_deg: float = 20.0
    elevation_deg: float = -14.0
    zoom: float = 1.0


FRONT = Camera()
FIELD_OF_VIEW_DEG = 45.0
SUPERSAMPLING = 2
"""Pixels drawn for one of the picture, each way: smooth edges."""


def render(robot: Robot, x: ArrayLike, width: int = 640, height: int = 480,
           camera: Camera = FRONT) -> np.ndarray:
    """Return a picture (height, width, 3), uint8, of the robot at pose x (4,).

    It is drawn from `robot_description` in an engine of its own, so it serves every plant and log.

    Raises:
        UnreachableError: a pose that a leg cannot reach.
    """
    positions = tree_joint_positions(robot.geometry, x)
    reach = robot.geometry.arm_length + robot.geometry.forearm_length
    view = pybullet.computeViewMatrixFromYawPitchRoll(
        (0.0, 0.0, -0.35 * reach), 1.4 * reach / camera.zoom, camera.yaw_deg, camera.elevation_deg,
        0.0, 2)
    projection = pybullet.computeProjectionMatrixFOV(
        FIELD_OF_VIEW_DEG, width / height, 0.05 * reach, 10.0 * reach)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = _load(_weightless(robot_description(robot)), client, fixed=True)
        for index in range(pybullet.getNumJoints(body, physicsClientId=client)):
            name = pybullet.getJointInfo(body, index, physicsClientId=client)[1].decode()
            pybullet.resetJointState(body, index, positions[name], physicsClientId=client)
        picture = pybullet.getCameraImage(
            SUPERSAMPLING * width, SUPERSAMPLING * height, view, projection,
            lightDirection=(0.6, -0.9, 1.6), renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=client)
    finally:
        pybullet.disconnect(physicsClientId=client)
    fine = np.reshape(picture[2], (height, SUPERSAMPLING, width, SUPERSAMPLING, 4))[..., :3]
    return fine.mean(axis=(1, 3)).round().astype(np.uint8)


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
