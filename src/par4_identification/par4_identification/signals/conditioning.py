"""Filters and rates by which measured signals become rows."""

from __future__ import annotations

from dataclasses import dataclass

from par4_identification.signals.filtering import reach_of


@dataclass(frozen=True)
class Conditioning:
    """How measured signals become rows.

    Attributes:
        position_cutoff_hz: low-pass of positions before they are differentiated; four times the
            torque's, so that it does not distort what the torque's lets through: at twice, the
            reversals bias i_act by 0.04 %.
        torque_cutoff_hz: low-pass of the torque and of every column.
        row_rate_hz: rate of the rows kept.
        low_speed: below this joint speed (rad/s) friction is not known. Creeping before a joint
            sticks biases i_act by 0.03 % if it is 0.02.
        steady: whether an axis holds one speed after the other, so that each plateau of its speed
            is a row and nothing is filtered.
    """

    position_cutoff_hz: float = 160.0
    torque_cutoff_hz: float = 40.0
    row_rate_hz: float = 100.0
    low_speed: float = 0.05
    steady: bool = False

    @property
    def reach(self) -> float:
        """Half the time over which the low-passes remember, s."""
        return reach_of(min(self.torque_cutoff_hz, 0.5 * self.position_cutoff_hz))
