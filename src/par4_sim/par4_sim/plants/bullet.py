"""Par4 simulated by pybullet's rigid-body engine.

The engine integrates by symplectic Euler: the velocity read at t_k belongs to t_k - dt/2, the
torque of step k acts as at t_k. Loops are closed by point-to-point constraints, dry friction is a
motor that holds each joint still with limited torque: real sticking.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.arrays import as_rows
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import LEGS
from par4_sim.choices import STEP
from par4_sim.description.chains import (
    PLATE_CHAINS,
    PLATE_SLIDES,
    Fidelity,
    LinkPoint,
    chains,
    leg_chain,
    link_positions,
)
from par4_sim.description.robot_tree import passive_joint_positions
from par4_sim.machines.machine import Machine
from par4_sim.plants.engine import load_body, pybullet
from par4_sim.plants.engine_friction import JointFriction

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
FIRST_LINK = -1
"""The engine's index of the first link of a chain."""


class BulletPlant:
    """The machine in pybullet; implements `Plant`. Its first pose comes from `reset`.

    Args:
        machine: what it is.
        fidelity: 'accurate' has every rod and bar and free half plates, 'fast' one rod a forearm
            and half plates that slide; see `par4_sim.description.chains.chains`.
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
        self._friction = JointFriction(machine)
        self._is_pushed = not machine.platform.is_none
        mechanism = chains(machine.geometry, machine.bodies, fidelity)

        self._client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(*machine.gravity.tolist(), physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=dt, numSubSteps=0, numSolverIterations=ITERATIONS[fidelity],
            solverResidualThreshold=0.0, erp=CLOSING_RATE, enableFileCaching=0,
            physicsClientId=self._client)
        self._bodies = {name: load_body(urdf, self._client, fixed=True)
                        for name, urdf in mechanism.fixed.items()}
        self._bodies |= {name: load_body(urdf, self._client, fixed=False)
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
        client = self._client  # not by name, which takes longer than the reading
        states = [pybullet.getJointState(body, link, client) for body, link in self._arms]
        self._q = np.array([state[0] for state in states])
        self._qd = np.array([state[1] for state in states])

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
        if not math.isfinite(sum(self._q.tolist())):
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
        # not multiplyTransforms, which is single precision; not by arrays, which take longer
        x, y, z, w = quaternion
        along, across, up = point.tolist()
        turned = (2.0 * (y * up - z * across), 2.0 * (z * along - x * up),
                  2.0 * (x * across - y * along))
        return np.array((
            centre[0] + along + w * turned[0] + (y * turned[2] - z * turned[1]),
            centre[1] + across + w * turned[1] + (z * turned[0] - x * turned[2]),
            centre[2] + up + w * turned[2] + (x * turned[1] - y * turned[0])))

    def close(self) -> None:
        """Release the engine; the plant cannot be used afterwards."""
        pybullet.disconnect(physicsClientId=self._client)
