"""Mass of an unknown payload, and which half plate carries it, from bags with and without it.

What the machine is without it each joint tells for itself: inertia, gravity and platform masses of
(20) are fitted per joint, so that neither a wrong drive gain nor unequal arms can look like a
payload, and friction per bag, since it drifts with temperature. What bags with the payload have
beyond that is M_1 w_1 + M_2 w_2, the columns of the platform masses at D and D'. Every joint tells
M_1 and M_2; they are averaged by their covariance, which is widened by as much as the joints differ
beyond it (Birge's ratio), as they do where the drive gains are wrong against each other. A gain
error common to all joints goes into the mass. A payload on one half leaves the other of M_1, M_2
at zero.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from par4_dynamics.base_terms import PLATFORM_MASSES, distributed_torque
from par4_dynamics.model_file import RigidBody
from par4_identification.gains.known_payload import (
    OWN,
    estimate_per_joint,
    friction_columns,
    named_columns,
)
from par4_identification.signals.run import Run
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot

NAMED_FROM = 0.99
"""Probability from which it is said which half plate carries the payload."""
SEEN = 4.0
"""Standard deviations from zero at which a mass is told from none."""
LARGEST_SHARE = 0.1
"""Part of the payload on the other half, if it is beyond chance, above which both carry it."""


@dataclass(frozen=True)
class WeighedPayload:
    """What bags with an unknown payload say of it.

    Attributes:
        halves: M_1 at D and M_2 at D', fitted together, (2,), kg.
        covariance: of `halves`, (2, 2).
    """

    halves: np.ndarray
    covariance: np.ndarray

    @property
    def on_one(self) -> np.ndarray:
        """Mass if it is all on half 1, and if it is all on half 2, (2,), kg."""
        return self.halves - (self.halves / np.diag(self.covariance))[::-1] * self.covariance[0, 1]

    @property
    def log_likelihood_ratio(self) -> float:
        """Log of how much likelier the data are with the payload on half 1 than on half 2."""
        score = self.halves ** 2 / np.diag(self.covariance)  # what it costs to leave each out
        return 0.5 * float(score[0] - score[1])

    @property
    def likelier_half(self) -> int:
        """1 (D, the tool) or 2 (D')."""
        return 1 if self.log_likelihood_ratio >= 0.0 else 2

    @property
    def confidence(self) -> float:
        """Probability of the likelier half, both being as likely beforehand."""
        return 1.0 / (1.0 + math.exp(-min(abs(self.log_likelihood_ratio), 700.0)))

    @property
    def mass(self) -> float:
        """Mass on the likelier half, or on both together if both carry it, kg."""
        if self.on_both:
            return float(self.halves.sum())
        return float(self.on_one[self.likelier_half - 1])

    @property
    def std(self) -> float:
        """Standard deviation of `mass`, kg."""
        if self.on_both:
            return math.sqrt(self.covariance.sum())
        own = self.likelier_half - 1
        return math.sqrt(self.covariance[own, own]
                         - self.covariance[0, 1] ** 2 / self.covariance[1 - own, 1 - own])

    @property
    def is_seen(self) -> bool:
        """Whether there is a mass beyond chance; a negative one means that bags are swapped."""
        return abs(self.mass) > SEEN * self.std

    @property
    def on_both(self) -> bool:
        """Whether neither half alone can carry it."""
        other = 2 - self.likelier_half
        found, spread = abs(self.halves[other]), math.sqrt(self.covariance[other, other])
        return found > SEEN * spread and found > LARGEST_SHARE * np.abs(self.halves).sum()

    @property
    def half(self) -> int | None:
        """1 or 2 where the motion tells, None where it does not or where both carry it."""
        if not self.is_seen or self.on_both or self.confidence < NAMED_FROM:
            return None
        return self.likelier_half


def payload_of_runs(runs: Sequence[Run], loaded: Collection[str], machine: Robot | Axis,
                    rigid_body: RigidBody = 'paper') -> WeighedPayload:
    """Return what the runs of loaded bags have beyond those of the others.

    Args:
        runs: rows of all bags.
        loaded: names of the bags with the payload.
        machine: that was recorded.
        rigid_body: 'paper' or 'full'.

    Raises:
        InputError: a machine without platform, no bag without the payload or none with it, or
            motions that do not tell the masses.
    """
    if isinstance(machine, Axis):
        raise InputError(f'{machine.name}: an unknown payload was asked for, but the machine is a '
                         f'single axis and has no platform to carry it')
    bags = list(dict.fromkeys(run.name for run in runs))
    if not 0 < len(set(bags) & set(loaded)) < len(bags):
        raise InputError(f'unknown payload: it is on {", ".join(loaded) or "none"} of '
                         f'{", ".join(bags)}; give bags with and without it')
    columns, targets = [], []
    for run in runs:
        base = named_columns(run.state)
        absent = np.zeros_like(run.state.q)
        columns.append({f'payload, {name}': base[name] if run.name in loaded else absent
                        for name in PLATFORM_MASSES}
                       | {name: base[name] for name in (*PLATFORM_MASSES, *OWN)}
                       | friction_columns(base, run.name, bags))
        targets.append(run.tau)
        if rigid_body == 'full':
            targets[-1] = run.tau - run.rows(distributed_torque(machine.bodies, run.state))
    estimate = estimate_per_joint(runs, targets, columns)
    joints = runs[0].tau.shape[1]
    found = np.arange(2 * joints).reshape(2, joints).T.ravel()  # joint by joint
    return _common(estimate.values[found], estimate.covariance[np.ix_(found, found)])


def _common(halves: np.ndarray, covariance: np.ndarray) -> WeighedPayload:
    """Return the payload nearest to what each joint tells of M_1 and M_2, (2 J,)."""
    weight = np.linalg.inv(covariance)
    repeat = np.tile(np.eye(2), (len(halves) // 2, 1))
    spread = np.linalg.inv(repeat.T @ weight @ repeat)
    mean = spread @ repeat.T @ weight @ halves
    left = halves - repeat @ mean
    birge = float(left @ weight @ left) / (len(halves) - 2)
    return WeighedPayload(mean, spread * max(1.0, birge))
