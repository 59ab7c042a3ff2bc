"""Model predictive control: computed torque whose corrections keep the limits that lie ahead.

Computed torque runs at the rate of the drive, with an acceleration c added to what it asks for:

    a = qdd_ref + damping edot + stiffness e + c,  so that  eddot + damping edot + stiffness e = -c

Every PERIOD the law looks HORIZON ahead. Where command, joints and platform will keep their limits
by themselves, c = 0 and the law is computed torque, with its poles and its margin. Where they will
not, c is the first of the corrections that

    minimise the sum of |J c_k|^2 over the horizon
    subject to |command| <= torque limit, |qd| <= speed limit, the pose in the workspace

J c_k is the acceleration of the platform that a correction makes, theta taken at the platform's
radius. The command ahead is what the model and the feedforward that is queued say; it is linear in
the corrections about those of the look before. Limits are soft, at a price far above that of the
corrections, so that there always is a solution.

The cost has nothing to tune. With damping^2 >= 2 stiffness the law without limits is optimal
(Kalman 1964) for the integral of

    stiffness^2 |e|^2 + (damping^2 - 2 stiffness) |edot|^2 + |a - qdd_ref|^2

and what corrections add to that integral is the integral of |c|^2, in any metric; that of J changes
little over the horizon. So the program is linear-quadratic control over an infinite horizon with
limits over a finite one (the closed-loop paradigm of Kouvaritakis, Rossiter and Schuurmans 2000).

Feedforward that is late or lost is handed over ahead as it is now, so that the law degrades as
computed torque does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import daqp
import numpy as np

from par4_dynamics.model import Model
from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import Robot
from par4_sim.drives.computed_torque import ComputedTorque
from par4_sim.drives.controller import CORRECTION
from par4_sim.drives.prediction import predict, responses

PERIOD = 2e-3
"""Seconds between looks ahead, and over which each correction is held."""
HORIZON = 0.05
"""Seconds looked ahead: an error decays to 4 % meanwhile, and 150 m/s2 bring 5 m/s to rest."""
SCALE = 100.0
"""m/s2: unit of the corrections in the program."""
SOFTNESS = 1e-6
"""What a limit gives way, in the solver's unit, for a unit of its multiplier."""
NEAR = 0.8
"""Share of a limit of speed or workspace below which it takes no part in the program."""
SOFT = 8
"""The solver's mark of a limit that gives way where it must."""
UNBOUNDED = 1e30
"""What the solver takes for no bound."""


class Predictive(ComputedTorque):
    """Computed torque that looks ahead.

    Args:
        robot: geometry, limits, and the loops whose poles are taken over.
        model: whose rigid bodies are known.
        torque_limit: of the commands, N m.
        dt: s.

    Attributes:
        programs: how many times limits lay ahead and a program was put up.
    """

    def __init__(self, robot: Robot, model: Model, torque_limit: float, dt: float) -> None:
        super().__init__(robot, model, torque_limit, dt)
        self.stride = max(1, round(PERIOD / dt))
        self._interval = self.stride * dt
        count = max(1, round(HORIZON / self._interval))
        self.horizon = count * self._interval
        damping, stiffness = self.gains[:2]
        self._free, self._forced = responses(damping, stiffness, self._interval, count)
        error, rate = self._forced[:, 0], self._forced[:, 1]
        asked = np.eye(count) + damping * rate + stiffness * error
        self._responses = (asked, -rate, -error)
        self._limits = _limits_of(robot, torque_limit)
        self._torques, self._speeds, self._poses = np.empty((3, count, LEGS))
        self._inertias, self._pulls = np.empty((2, count, LEGS, LEGS))
        self._units = SCALE / np.array((1.0, 1.0, 1.0, robot.geometry.platform_radius))
        self._cost, self._slope = np.eye(LEGS * count), np.zeros(LEGS * count)
        self._plan = np.zeros((count, LEGS))
        self.programs = 0

    def restart(self, holding: np.ndarray) -> None:
        """Begin settled with the command `holding` (4,), N m, nothing planned."""
        super().restart(holding)
        self._plan[:] = 0.0

    def look_ahead(self, times: np.ndarray, points: np.ndarray, t: float, error: np.ndarray,
                   rate: np.ndarray) -> None:
        """Set the correction of the next PERIOD; see `Controller.look_ahead`."""
        plan = np.concatenate((self._plan[1:], np.zeros((1, LEGS))))
        errors = self._free @ np.stack((error, rate)) + self._forced @ plan
        known = predict(self.gains, self.geometry, self.bodies, self.state, times, points, t,
                        self._interval, errors, plan, self._torques, self._inertias, self._speeds,
                        self._poses, self._pulls)
        self._plan = self._planned(plan) if known else np.zeros_like(plan)
        self.state[CORRECTION] = self._plan[0]

    def _planned(self, plan: np.ndarray) -> np.ndarray:
        """Return the corrections (count, 4), rad/s2, from what `plan` leads to."""
        nothing = np.zeros_like(plan)
        places, place_pulls = _of_workspace(self._poses, self._pulls)
        alike = np.broadcast_to(np.eye(LEGS), self._pulls.shape)
        pulls = (self._inertias, alike, place_pulls)
        without = [values - np.einsum('nkj,nj->nk', pull, response @ plan)
                   for values, pull, response in zip(
                       (self._torques, self._speeds, places), pulls, self._responses, strict=True)]
        if all(limit.kept(values) for limit, values in zip(self._limits, without, strict=True)):
            return nothing
        to_joints = np.linalg.inv(self._pulls) * self._units
        rows, low, high = (np.concatenate(parts) for parts in zip(*(
            limit.rows(values, pull, response, to_joints) for limit, values, pull, response in zip(
                self._limits, without, pulls, self._responses, strict=True)), strict=True))
        self.programs += 1
        found, _, flag, _ = daqp.solve(
            self._cost, self._slope, rows, high, low, np.full(len(rows), SOFT, dtype=np.intc),
            rho_soft=SOFTNESS)
        if flag < 1:
            self.unsolved += 1
            return nothing
        return np.einsum('njk,nk->nj', to_joints, found.reshape(plan.shape))


@dataclass(frozen=True)
class _Limit:
    """Bounds of k values that are looked at.

    Attributes:
        low, high: (k,).
        near: distance from a bound below which a value takes part in the program, (k,).
    """

    low: np.ndarray
    high: np.ndarray
    near: np.ndarray

    def kept(self, values: np.ndarray) -> bool:
        """Return whether values (n, k) keep the bounds."""
        return bool(((values >= self.low) & (values <= self.high)).all())

    def rows(self, values: np.ndarray, pulls: np.ndarray, response: np.ndarray,
             to_joints: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return coefficients (r, 4 count) of the program and their bounds (r,), twice.

        Args:
            values: without corrections (n, k).
            pulls: what the values gain by the joints' response (n, k, 4).
            response: of a joint to its corrections (n, count).
            to_joints: corrections by the program's variables (count, 4, 4).
        """
        look, which = np.nonzero((values > self.high - self.near) | (values < self.low + self.near))
        along = np.einsum('rj,ijk->rik', pulls[look, which], to_joints)
        rows = response[look][:, :, None] * along
        at = values[look, which]
        return (rows.reshape(len(look), response.shape[1] * LEGS), self.low[which] - at,
                self.high[which] - at)


def _limits_of(robot: Robot, torque_limit: float) -> tuple[_Limit, _Limit, _Limit]:
    """Return the limits of torque, of joint speed and of radius, z and theta."""
    limits, space = robot.limits, robot.limits.workspace
    fastest = min(limits.joint_speed, robot.drives.speed_limit or math.inf)
    torque, speed = np.full(LEGS, torque_limit), np.full(LEGS, fastest)
    span = np.array((space.radius, space.z[1] - space.z[0], space.theta))
    return (_Limit(-torque, torque, np.full(LEGS, math.inf)),
            _Limit(-speed, speed, (1.0 - NEAR) * speed),
            _Limit(np.array((-UNBOUNDED, space.z[0], -space.theta)),
                   np.array((space.radius, space.z[1], space.theta)), (1.0 - NEAR) * span))


def _of_workspace(poses: np.ndarray, pulls: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return radius, z and theta (n, 3) of poses (n, 4), and their pulls (n, 3, 4)."""
    radius = np.hypot(poses[:, 0], poses[:, 1])
    outward = poses[:, :2] / np.maximum(radius, np.finfo(float).tiny)[:, None]
    along = np.einsum('na,nab->nb', outward, pulls[:, :2])
    return (np.column_stack((radius, poses[:, 2:])),
            np.concatenate((along[:, None], pulls[:, 2:]), axis=1))
