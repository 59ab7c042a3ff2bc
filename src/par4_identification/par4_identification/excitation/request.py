"""What an excitation shall be, apart from what computes it."""

from __future__ import annotations

from dataclasses import dataclass

from par4_kinematics.errors import InputError
from par4_kinematics.time_laws import require_positive

MAX_HARMONICS = 12
FEWEST_PERIODS = 2
SLOW_PERIOD = 4.0
"""Approximate length of a slow period, s, where no number of slow periods is asked for."""
ACCELERATION = 100.0
"""Default limit of acceleration, m/s2, that of the quasi-random excitation."""


@dataclass(frozen=True)
class DesignRequest:
    """What an excitation shall be.

    Attributes:
        duration: s.
        harmonics: of either path.
        base_frequency: of the fast path, Hz; None for one that suits the limits.
        slow_periods: of the slow path, at least two; None for about 4 s each.
        slow_fraction: share of the duration for them.
        starts: random paths that each optimisation begins with.
        seed: of the random starts.
    """

    duration: float = 20.0
    harmonics: int = 4
    base_frequency: float | None = None
    slow_periods: int | None = None
    slow_fraction: float = 0.4
    starts: int = 6
    seed: int = 0

    def __post_init__(self) -> None:
        require_positive({'duration': self.duration}, 'excitation design')
        if self.base_frequency is not None:
            require_positive({'base_frequency': self.base_frequency}, 'excitation design')
        for name, lowest, highest in (
                ('harmonics', 2, MAX_HARMONICS), ('slow_periods', FEWEST_PERIODS, 1000),
                ('starts', 1, 1000), ('seed', 0, 2 ** 63), ('slow_fraction', 0.1, 0.9)):
            value = getattr(self, name)
            if value is not None and not lowest <= value <= highest:
                raise InputError(f'excitation design: {name} must be {lowest:g} to {highest:g}, '
                                 f'found {value:g}')

    @property
    def slow_period(self) -> float:
        """About how long a period of the slow path is, s."""
        time = self.slow_fraction * self.duration
        return time / (self.slow_periods or max(FEWEST_PERIODS, round(time / SLOW_PERIOD)))
