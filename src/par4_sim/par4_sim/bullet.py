"""Par4 simulated by pybullet's rigid-body engine; the only file that knows pybullet.

The engine integrates by symplectic Euler: the velocity read at t_k belongs to t_k - dt/2, the
torque of step k acts as at t_k. Loops are closed by point-to-point constraints, dry friction is a
motor that holds each joint still with limited torque: real sticking.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.arrays import as_rows
from par4_kinematics.errors import InputError, UnreachableError
from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import Robot
from par4_sim.friction import (
    BACK_COULOMB,
    DRY_DROP,
    FORWARD_COULOMB,
    LOAD_COEFFICIENT,
    PRESLIDING_DISTANCE,
    STRIBECK_TORQUE,
    behind_load_friction,
    bending_torque,
    bent,
    dry_friction,
    flowing_friction,
    friction_at,
)
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
    passive_joint_positions,
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
IMPOSED_ITERATIONS = 400
"""Sweeps of a step with imposed motion, of any fidelity: between arms that cannot give way the
solver converges more slowly (after 80 sweeps a jump of 15 G costs 5 % of the torque)."""
CLOSING_RATE = 0.8
"""Share of a loop's opening that a step closes."""
UNLIMITED = 1e7
"""Force of a constraint, N, and speed of a joint, rad/s, that no motion reaches."""
STANDSTILL = 1e-12
"""Speed of a joint, rad/s, that the solver's rounding leaves to one that is held."""
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
        self._friction = _JointFriction(machine)
        self._is_pushed = not machine.platform.is_none
        mechanism = chains(machine.geometry, machine.bodies, fidelity)

        self._client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(*machine.gravity.tolist(), physicsClientId=self._client)
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
        self._steps = 0
        self._read_arms()
        self._qd_before = self._qd
        self._xd_before = np.zeros(LEGS)
        self._hold_still(self._friction.at_rest)

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
        self._xd_before = np.zeros(LEGS)
        self._friction.restart(self._q)
        self._hold_still(self._friction.at_rest)

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
        torque = np.array(tau, dtype=float)
        for load in self._machine.loads:
            torque -= load(self.time, self.q, velocity)
        for harmonic in self._machine.harmonics:
            torque[harmonic.joint] -= harmonic.torque(self._q[harmonic.joint])
        torque -= self._friction.torque(self.time, self._q, velocity)
        if self._friction.varies:
            self._hold_still(self._friction.dry(self.time, velocity, torque))
        for (body, link), value in zip(self._arms, torque.tolist(), strict=True):
            pybullet.setJointMotorControl2(body, link, pybullet.TORQUE_CONTROL, force=value,
                                           physicsClientId=self._client)
        if self._is_pushed:
            self._push_platform(velocity)
        self._advance()
        if self._friction.bears_load:
            self._friction.load = torque + self._motor_torques()

    def _motor_torques(self) -> np.ndarray:
        """Return the torque (4,), N m, with which motors acted on the joints in the last step."""
        return np.array([pybullet.getJointState(body, link, physicsClientId=self._client)[3]
                         for body, link in self._arms])

    def _push_platform(self, qd: np.ndarray) -> None:
        """Let the forces on the platform act at D and about theta during the next step."""
        x, xd = self._platform()
        force = self._machine.platform.generalised_force(
            self._machine.geometry, x, 1.5 * xd - 0.5 * self._xd_before, self._q, qd)
        self._xd_before = xd
        chain = PLATE_CHAINS[0]
        body, link = self._links[chain, 'plate']
        pybullet.applyExternalForce(body, link, force[:3].tolist(), x[:3].tolist(),
                                    pybullet.WORLD_FRAME, physicsClientId=self._client)
        pybullet.setJointMotorControl2(*self._links[chain, 'bar_0'], pybullet.TORQUE_CONTROL,
                                       force=float(force[3]), physicsClientId=self._client)

    def impose(self, q_next: ArrayLike) -> np.ndarray:
        """Advance by dt so that the arms arrive at q_next (4,), rad, whatever torque that takes.

        The rigid bodies alone answer: friction, loads and forces do not act during this step.

        Returns:
            The motor torque (4,), N m, that acted during the step; like that of `step` it belongs
            to the time before the step, t_k, and to the central differences of q around it.

        Raises:
            UnreachableError: the engine lost the mechanism.
        """
        speeds = (np.asarray(q_next, dtype=float) - self._q) / self.dt
        for (body, link), speed in zip(self._arms, speeds.tolist(), strict=True):
            pybullet.setJointMotorControl2(body, link, pybullet.VELOCITY_CONTROL,
                                           targetVelocity=speed, force=UNLIMITED,
                                           physicsClientId=self._client)
        self._xd_before = self.xd
        self._use_iterations(IMPOSED_ITERATIONS)
        self._advance()
        torque = self._motor_torques()
        self._use_iterations(ITERATIONS[self._fidelity])
        self._hold_still(self._friction.at_rest)
        return torque

    def _use_iterations(self, number: int) -> None:
        pybullet.setPhysicsEngineParameter(numSolverIterations=number,
                                           physicsClientId=self._client)

    def _advance(self) -> None:
        pybullet.stepSimulation(physicsClientId=self._client)
        self._steps += 1
        self._qd_before = self._qd
        self._read_arms()
        if not np.isfinite(self._q).all():
            raise UnreachableError(
                f'after {self.time:.4f} s the joint positions are {self._q.tolist()}: the machine '
                f'was driven out of reach; check the torques and the motion')

    def _hold_still(self, limits: np.ndarray) -> None:
        """Let motors hold the joints still with at most these torques (4,), N m."""
        for (body, link), limit in zip(self._arms, limits.tolist(), strict=True):
            pybullet.setJointMotorControl2(body, link, pybullet.VELOCITY_CONTROL,
                                           targetVelocity=0.0, force=limit,
                                           physicsClientId=self._client)

    def passive_joints(self) -> dict[str, float]:
        """Return name -> position, rad or m, of the joints of `robot_description` without a motor.

        Arms, rods, half plate 1 and bar_0 are where the engine has them, the rest of the platform
        follows; one rod a forearm ('fast') counts for both.
        """
        rods = [[self._rod(leg, number if (leg_chain(leg), f'rod_{number}') in self._links else 0)
                 for number in range(2)] for leg in range(LEGS)]
        return passive_joint_positions(self._machine.geometry, self.x, self._q, np.array(rods))

    def _rod(self, leg: int, number: int) -> np.ndarray:
        """Return the direction (3,) of a rod from elbow to plate, in `base`."""
        x, y, z, w = pybullet.getLinkState(
            *self._links[leg_chain(leg), f'rod_{number}'], computeForwardKinematics=1,
            physicsClientId=self._client)[1]
        return np.array((-x * z - w * y, w * x - y * z, x * x + y * y - 0.5))

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


@numba.njit(cache=True, error_model='numpy')
def _smooth_friction(laws, time, velocity, moved, bending):
    """Return the friction (4,), N m, that is not dry; `bending` (4,) goes on by `moved`, rad."""
    laws, torque = friction_at(laws, time), np.empty(4)
    for joint in range(4):
        torque[joint] = flowing_friction(laws, joint, velocity[joint])
        if laws[joint, PRESLIDING_DISTANCE] > 0.0:
            bending[joint] = bent(laws, joint, bending[joint], moved[joint])
            torque[joint] += bending_torque(laws, joint, bending[joint])
        else:  # dry levels that differ between the directions: a symmetric one and this
            torque[joint] += 0.5 * (laws[joint, FORWARD_COULOMB] - laws[joint, BACK_COULOMB])
    return torque


class _JointFriction:
    """Friction of a machine's joints as an engine takes it: dry levels apart from a torque.

    Attributes:
        varies: whether the dry levels do.
        bears_load: whether they depend on the torque that goes on behind the friction.
        load: that torque in the last step (4,), N m; None where it is not known.
    """

    def __init__(self, machine: Machine) -> None:
        self._laws = machine.friction.packed
        self.bears_load = bool(np.any(self._laws[:, LOAD_COEFFICIENT]))
        self.varies = self.bears_load or bool(np.any(self._laws[:, (STRIBECK_TORQUE, DRY_DROP)]))
        self.restart(np.zeros(LEGS))

    def restart(self, q: np.ndarray) -> None:
        """Begin at joint positions q (4,) with unbent contacts."""
        self._q = q
        self._bending = np.zeros(LEGS)
        self.load: np.ndarray | None = None

    @property
    def at_rest(self) -> np.ndarray:
        """Dry friction of resting, unloaded joints (4,), N m."""
        return self.dry(0.0, np.zeros(LEGS), np.zeros(LEGS))

    def torque(self, time: float, q: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the friction (4,), N m, that is not dry; contacts bend on to q (4,)."""
        moved, self._q = q - self._q, q
        return _smooth_friction(self._laws, time, velocity, moved, self._bending)

    def dry(self, time: float, velocity: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Return the torque (4,), N m, up to which a joint is held, `torque` (4,) driving it."""
        laws, result = friction_at(self._laws, time), np.empty(LEGS)
        for joint in range(LEGS):
            speed = abs(velocity[joint])
            level = 0.5 * sum(dry_friction(laws, joint, side, speed) for side in (-1.0, 1.0))
            if speed > STANDSTILL:
                direction = math.copysign(1.0, velocity[joint])
                load = behind_load_friction(laws, joint, direction,
                                            torque[joint] - direction * level)
            else:  # what holds a joint tells which part of its torque goes on
                load = torque[joint] if self.load is None else self.load[joint]
            result[joint] = level + laws[joint, LOAD_COEFFICIENT] * abs(load)
        return result


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
        self._body = _load(_weightless(robot_description(robot)), self._client, fixed=True)
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
