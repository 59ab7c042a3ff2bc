"""What the axes of pictures and traces are labelled with."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Names:
    """What axes are labelled with.

    Attributes:
        joints: one a joint.
        torque: 'torque' or 'force'.
        torque_unit, speed_unit: of that and of joint speed.
    """

    joints: tuple[str, ...]
    torque: str
    torque_unit: str
    speed_unit: str
