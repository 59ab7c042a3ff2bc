"""Motors behind springs and gaps, around any plant.

    J_m qmdd = tau - friction(qmd) - tau_s,    tau_s = k (e - clip(e, -gap/2, gap/2)) + c ed
    e = q_m - q_arm

The wrapped plant carries the rest of the inertia, is driven by tau_s and has no friction of its
own in these joints. tau_s is taken at the positions which both sides reach where the plant says
that its torque acts: for both kinds of plant that makes the coupling a leapfrog, which keeps
energy. Harmonics and loads of the machine act on the arms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numba
import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.geometry import LEGS
from par4_sim.machines.friction import (
    LOAD_COEFFICIENT,
    PRESLIDING_DISTANCE,
    Friction,
    bending_torque,
    bent,
    dry_friction,
    flowing_friction,
    friction_at,
)
from par4_sim.machines.machine import Machine
from par4_sim.machines.transmission import Transmission
from par4_sim.plants.plant import Plant

CONTACT_STIFFNESS = 1e5
"""Of a gap in a transmission that is rigid otherwise, N m/rad: 0.1 mrad at 10 N m."""
LARGEST_PHASE = 0.2
"""Phase of the fastest resonance in a step, rad: the leapfrog's frequency is right to 0.2 %."""
HELD = 1e-6
"""Response to a torque over the largest one, below which a joint does not answer: it is held."""
FRICTION_LEVELS = ('coulomb', 'viscous', 'coulomb_asymmetry', 'viscous_asymmetry',
                   'stribeck_torque', 'quadratic', 'power_torque', 'load_coefficient')
"""What makes the friction of a joint vanish where it is zero."""
STIFFNESS, GAP, DAMPING, INERTIA = 0, 1, 2, 3
Q, QD, BENDING = 0, 1, 2


@dataclass(frozen=True)
class Motors:
    """The motors' side of elastic joints.

    Attributes:
        elastic: whether a joint is, (4,) bool; the others stay with the plant.
        stiffness: N m/rad (4,).
        gap: total lost motion (4,), rad.
        damping: c (4,), N m s/rad.
        inertia: J_m (4,), kg m2.
        friction: of the motors.
        resonance: upper bound of the angular frequencies, rad/s.
    """

    elastic: np.ndarray
    stiffness: np.ndarray
    gap: np.ndarray
    damping: np.ndarray
    inertia: np.ndarray
    friction: Friction
    resonance: float

    @property
    def packed(self) -> np.ndarray:
        """(4, 4): stiffness (inf = rigid), gap, damping, inertia, as the kernel takes them."""
        return np.stack((np.where(self.elastic, self.stiffness, np.inf), self.gap, self.damping,
                         self.inertia))

    def substeps(self, dt: float) -> int:
        """Return into how many steps one of dt, s, must be cut."""
        return max(1, math.ceil(self.resonance * dt / LARGEST_PHASE))


def split_machine(machine: Machine) -> tuple[Machine, Motors]:
    """Return the machine that the springs drive, with rigid joints, and its motors.

    The arm's inertia that counts for damping and resonance is that of its joint alone, the
    smallest that a pose can make it.
    """
    transmission, friction = machine.transmission, machine.friction
    gap = np.broadcast_to(transmission.gap, (LEGS,)).astype(float)
    given = np.broadcast_to(transmission.stiffness, (LEGS,)).astype(float)
    elastic = np.isfinite(given) | (gap > 0.0)
    stiffness = np.where(np.isfinite(given), given, CONTACT_STIFFNESS)
    whole = np.broadcast_to(machine.bodies.actuator_inertia, (LEGS,))
    inertia = np.where(elastic, transmission.motor_share * whole, 0.0)
    both = transmission.motor_share * (1.0 - transmission.motor_share) * whole
    rate = np.where(elastic, np.sqrt(stiffness / both), 0.0)
    motors = Motors(
        elastic, stiffness, gap, 2.0 * transmission.damping_ratio * rate * both, inertia, friction,
        float(rate.max()))
    left: dict[str, Any] = {name: np.where(elastic, 0.0, getattr(friction, name))
                            for name in FRICTION_LEVELS}
    driven = replace(
        machine, transmission=Transmission(),
        bodies=replace(machine.bodies, actuator_inertia=whole - inertia),
        friction=replace(friction, **left))
    return driven, motors


@numba.njit(cache=True, error_model='numpy')
def spring_torque(stiffness, gap, damping, twist, rate):
    """Return the torque that a twist (rad) and its rate pass on, N m; flanks only push."""
    half = 0.5 * gap
    if gap == 0.0:
        return stiffness * twist + damping * rate
    if twist > half:
        return max(0.0, stiffness * (twist - half) + damping * rate)
    if twist < -half:
        return min(0.0, stiffness * (twist + half) + damping * rate)
    return 0.0


@numba.njit(cache=True, error_model='numpy')
def _slid(laws, joint, inertia, velocity, rolling, push, level, span):
    """Return the velocity after `span`; dry friction takes what it can, up to a standstill."""
    free = velocity + span * (push - flowing_friction(laws, joint, rolling)) / inertia
    loss = span * (level + dry_friction(laws, joint, free, abs(velocity))) / inertia
    if free > loss:
        return free - loss
    return free + loss if free < -loss else 0.0


@numba.njit(cache=True, error_model='numpy')
def motor_step(motors, friction, time, tau, q, qd, motor, h, acts, passed):
    """Advance the motors by h and write the torque passed on to the arms (4,), N m.

    Args:
        motors, friction: Motors.packed, Friction.packed.
        time: at the beginning, s.
        tau: of the motors (4,), N m.
        q, qd: of the arms (4,).
        motor: positions, velocities, bending of the friction (3, 4), moved on.
        h: step, s.
        acts: share of the step after which a torque of the plant acts: 1/2 or 0.
        passed: written.
    """
    friction = friction_at(friction, time + acts * h)
    for joint in range(4):
        if motors[STIFFNESS, joint] == np.inf:
            passed[joint] = tau[joint]
            continue
        inertia, velocity = motors[INERTIA, joint], motor[QD, joint]
        drift = acts * h * velocity
        twist = motor[Q, joint] + drift - q[joint] - acts * h * qd[joint]
        spring = spring_torque(motors[STIFFNESS, joint], motors[GAP, joint],
                               motors[DAMPING, joint], twist, velocity - qd[joint])
        passed[joint] = spring
        push, level = tau[joint] - spring, friction[joint, LOAD_COEFFICIENT] * abs(spring)
        if friction[joint, PRESLIDING_DISTANCE] > 0.0:
            push -= bending_torque(
                friction, joint, bent(friction, joint, motor[BENDING, joint], drift))
        # velocity-dependent friction at its mean over the step, from half a step on trial
        middle = _slid(friction, joint, inertia, velocity, velocity, push, level, 0.5 * h)
        after = _slid(friction, joint, inertia, velocity, middle, push, level, h)
        moved = h * (acts * velocity + (1.0 - acts) * after)
        if friction[joint, PRESLIDING_DISTANCE] > 0.0:
            motor[BENDING, joint] = bent(friction, joint, motor[BENDING, joint], moved)
        motor[Q, joint] += moved
        motor[QD, joint] = after


class ElasticPlant:
    """A plant behind springs; implements `Plant`. `q` and `qd` are the motors': encoders sit there.

    Args:
        plant: what the springs drive, with a step of `substeps` to this plant's one.
        motors: their side.
        substeps: of the wrapped plant.
    """

    def __init__(self, plant: Plant, motors: Motors, substeps: int) -> None:
        self.dt = substeps * plant.dt
        self.velocity_offset = plant.velocity_offset
        # the mean of a torque held over all substeps
        self.torque_offset = plant.torque_offset + 0.5 * (substeps - 1) * plant.dt
        self._plant = plant
        self._motors = motors
        self._packed = motors.packed
        self._friction = motors.friction.packed
        self._substeps = substeps
        self._acts = plant.torque_offset / plant.dt
        self._motor = np.zeros((3, LEGS))

    @property
    def driven(self) -> Plant:
        """What the springs drive."""
        return self._plant

    @property
    def kernel_state(self) -> tuple[Any, ...]:
        """What `motor_step` takes of the motors, their state, and the steps of the plant to one."""
        return self._packed, self._friction, self._motor, self._acts, self._substeps

    @property
    def time(self) -> float:
        """Seconds since the last reset."""
        return self._plant.time

    @property
    def q(self) -> np.ndarray:
        """Motor positions (4,), rad of the arms."""
        return np.where(self._motors.elastic, self._motor[Q], self._plant.q)

    @property
    def qd(self) -> np.ndarray:
        """Motor velocities (4,), rad/s."""
        return np.where(self._motors.elastic, self._motor[QD], self._plant.qd)

    @property
    def x(self) -> np.ndarray:
        """Pose of D and theta (4,), m, rad."""
        return self._plant.x

    @property
    def xd(self) -> np.ndarray:
        """Velocity of D and thetadot (4,)."""
        return self._plant.xd

    @property
    def arms(self) -> np.ndarray:
        """Positions of the arms (4,), rad."""
        return self._plant.q

    def reset(self, x: ArrayLike) -> None:
        """Put the machine at rest at pose x (4,), springs wound by what holds it there.

        Raises:
            UnreachableError: a pose that a leg cannot reach.
        """
        holding = self._holding_torque(x)
        self._plant.reset(x)
        self._motor[:] = 0.0
        self._motor[Q] = (self._plant.q + holding / self._motors.stiffness
                          + 0.5 * np.sign(holding) * self._motors.gap)

    def _holding_torque(self, x: ArrayLike) -> np.ndarray:
        """Return the torque (4,), N m, that holds the arms at pose x, from trials of one step.

        It is the smallest: what sticks by itself, or is held by a plate, needs none.
        """
        def speeds(tau: np.ndarray) -> np.ndarray:
            self._plant.reset(x)
            self._plant.step(tau)
            return self._plant.qd

        falling = speeds(np.zeros(LEGS))
        response = np.stack([speeds(unit) - falling for unit in np.eye(LEGS)], axis=1)
        return -np.linalg.lstsq(response, falling, rcond=HELD)[0]

    def step(self, tau: ArrayLike) -> None:
        """Advance by dt with motor torques tau (4,), N m, held.

        Raises:
            UnreachableError: the platform was driven out of reach.
        """
        torque, passed = np.array(tau, dtype=float), np.empty(LEGS)
        for _ in range(self._substeps):
            motor_step(self._packed, self._friction, self._plant.time, torque, self._plant.q,
                       self._plant.qd, self._motor, self._plant.dt, self._acts, passed)
            self._plant.step(passed)

    def passive_joints(self) -> dict[str, float]:
        """Return name -> position of the joints without a motor; see `Plant`."""
        return self._plant.passive_joints()

    def loop_opening(self) -> float:
        """Return the largest opening of a kinematic loop, m."""
        return self._plant.loop_opening()

    def close(self) -> None:
        """Release the wrapped plant."""
        self._plant.close()
