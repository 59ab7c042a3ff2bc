"""What every law of a drive shares: gains, state, limits, and what happens without feedforward.

A law is a compiled function of target, encoder readings and state that writes a command; it runs
at the rate of the drive, inside the compiled control step, and is chosen there by its number.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import ClassVar

import numba
import numpy as np

from par4_kinematics.geometry import LEGS

LOOPS, COMPUTED_TORQUE, TORQUE = 0, 1, 2
"""Numbers of the laws: `drive`, `computed_torque`, `torque_mode`."""
SPEEDS, COMMANDS, LIMITED = 0, 1, 2
"""Which of the two limits was met, in the counts; and either, counted once where both were."""
INTEGRAL, FEEDFORWARD, CARRIED, CORRECTION = 0, 1, 2, 3
"""Rows of a state: the integral, the last feedforward torque, a torque carried over where no
integral can take it, N m, and an acceleration that looking ahead adds, rad/s2."""
FADING = 0.02
"""Time constant with which a carried torque fades once feedforward is there again, s."""


@numba.njit(cache=True, error_model='numpy')
def hand_over(target, state, per_torque, dt):
    """Take feedforward over that stops, and give it back where it sets in, without a jump.

    The integral takes it; without an integral it is carried, and fades when feedforward returns.

    Args:
        target: (TARGET,); feedforward of zero on all joints is none.
        state: (4, 4), changed.
        per_torque: what the integral makes, N m a unit; 0 where there is none.
        dt: s.
    """
    had, has = False, False
    for joint in range(4):
        had = had or state[FEEDFORWARD, joint] != 0.0
        has = has or target[8 + joint] != 0.0
    fade = math.exp(-dt / FADING) if has else 1.0
    for joint in range(4):
        state[CARRIED, joint] *= fade
        if had != has:
            change = state[FEEDFORWARD, joint] - target[8 + joint]
            if per_torque > 0.0:
                state[INTEGRAL, joint] += change / per_torque
            else:
                state[CARRIED, joint] += change
        state[FEEDFORWARD, joint] = target[8 + joint]


class Controller(ABC):
    """Four drives: target and encoder readings in, torque command out.

    The velocity that they see is the one that the amplifier's own fine interpolation gives.

    Attributes:
        number: of the law.
        gains: three of the law, limit of command and of speed, dt, (6,).
        geometry, bodies: of the model that the law knows, as the kernels take them; empty where
            it needs none.
        state: (4, 4), see `INTEGRAL`.
        stride: physics steps between looks ahead; 0 for a law that never looks ahead.
        horizon: s of the reference that it looks ahead; 0 for a law that never does.
        unsolved: looks ahead whose program was not solved, so that nothing was corrected.
        counts: of limited speeds, of limited commands, and of either, (3,).
        command: torque asked of the amplifiers after clipping (4,), N m; volts times gain.
    """

    number: ClassVar[int]

    def __init__(self, gains: np.ndarray, geometry: np.ndarray | None = None,
                 bodies: np.ndarray | None = None) -> None:
        self.gains = gains
        self.geometry = np.empty(0) if geometry is None else np.array(geometry)
        self.bodies = np.empty(0) if bodies is None else np.array(bodies)
        self.state, self.command = np.zeros((4, LEGS)), np.zeros(LEGS)
        self.counts = np.zeros(3, dtype=np.int64)
        self.stride = self.unsolved = 0
        self.horizon = 0.0

    @property
    def law(self) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
        """Number, gains, geometry and bodies, as `par4_sim.drives.laws.command_of` takes them."""
        return self.number, self.gains, self.geometry, self.bodies

    @property
    @abstractmethod
    def per_torque(self) -> float:
        """What one unit of the integral makes, N m; 0 without an integral."""

    def look_ahead(  # noqa: B027  most laws have nothing to look at
            self, times: np.ndarray, points: np.ndarray, t: float, error: np.ndarray,
            rate: np.ndarray) -> None:
        """Correct the law for what lies ahead; called every `stride` steps.

        Args:
            times, points: of the ReferenceQueue.
            t: s.
            error, rate: of the joints and of their speeds now, reference less reading, (4,).
        """

    @property
    def saturated_commands(self) -> int:
        """Count of clipped commands, each joint and step."""
        return int(self.counts[COMMANDS])

    @property
    def saturated_speeds(self) -> int:
        """Count of clipped speeds, each joint and step."""
        return int(self.counts[SPEEDS])

    @property
    def limited(self) -> int:
        """Count of joints and steps with a clipped command, a clipped speed or both."""
        return int(self.counts[LIMITED])

    def restart(self, holding: np.ndarray) -> None:
        """Begin settled: the integrals supply the command `holding` (4,), N m; counts stay."""
        per_torque = self.per_torque
        self.state[:] = 0.0
        if per_torque > 0.0:
            self.state[INTEGRAL] = holding / per_torque
        else:
            self.state[CARRIED] = holding
        self.command[:] = holding
