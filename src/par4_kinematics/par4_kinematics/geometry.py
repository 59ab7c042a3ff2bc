"""The dimensions of a robot with the Par4 topology.

Frame `base`: origin at the centre of the four actuator axes, z up. Legs 0 and 1 carry half plate
2 (its point D'), legs 2 and 3 carry half plate 1 (its point D), which also carries the tool.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field, StrictFloat, field_validator, model_validator

from par4_kinematics.files import FileModel

LEGS = 4
POSE_NAMES = ('x', 'y', 'z', 'theta')
HOME = (0.0, 0.0, -0.78, 0.0)
"""Default pose X = (x, y, z, theta) of D, m and rad."""

LARGEST_ERROR = 0.1
"""Largest difference of an arm or forearm from those of the other legs, m."""
LONGEST = 10.0
"""Longest dimension of a machine of this kind, m: some have arms of one metre."""
ARM, FOREARM = 20, 24
"""Where `Geometry.packed` has the arm and the forearm of leg 0; those of the others follow."""
PACKED = 28
"""Length of `Geometry.packed`."""
WIDEST = 4.0 * math.pi
"""Largest angle that a file may give, rad: two turns."""


def _in_metres(value: float) -> float:
    if abs(value) > LONGEST:
        raise ValueError(f'expected metres, at most {LONGEST:g}; are these millimetres?')
    return value


def _small(value: float) -> float:
    if abs(value) > LARGEST_ERROR:
        raise ValueError(f'expected metres, at most {LARGEST_ERROR:g}; are these millimetres?')
    return value


def _in_radians(value: float) -> float:
    if abs(value) > WIDEST:
        raise ValueError(f'expected radians, at most two turns, {WIDEST:.4g}; are these degrees?')
    return value


def ascending(limits: tuple[float, float]) -> tuple[float, float]:
    """Return a range of a file.

    Raises:
        ValueError: its ends are exchanged, or the same.
    """
    if limits[0] >= limits[1]:
        raise ValueError('expected the lower limit, then the higher one; exchange them')
    return limits


Length = Annotated[StrictFloat, AfterValidator(_in_metres)]
"""In a file, m."""
Error = Annotated[StrictFloat, AfterValidator(_small)]
"""Of a length, m."""
Angle = Annotated[StrictFloat, AfterValidator(_in_radians)]
"""In a file, rad."""


class Geometry(FileModel):
    """Dimensions in metres and radians, as in `robot.yaml`.

    Attributes:
        arm_length: L, actuator axis P_i to elbow A_i.
        forearm_length: l, elbow A_i to plate joint B_i.
        base_radius: R, origin to actuator axis P_i.
        platform_radius: r_p, centre of the platform to B_i at theta = 0.
        platform_bar_length: h, length of the bars that join the half plates, D to D'.
        actuator_azimuth: azimuth of the four legs.
        rotation_amplification: tool angle per theta (belt and pulleys).
        arm_length_errors, forearm_length_errors: of each leg, added to the lengths of all; what a
            calibration of the machine found.
    """

    arm_length: Length = Field(gt=0)
    forearm_length: Length = Field(gt=0)
    base_radius: Length = Field(ge=0)
    platform_radius: Length = Field(ge=0)
    platform_bar_length: Length = Field(gt=0)
    actuator_azimuth: tuple[Angle, Angle, Angle, Angle] = (
        0.25 * math.pi, 0.75 * math.pi, 1.25 * math.pi, 1.75 * math.pi)
    rotation_amplification: StrictFloat = 4.0
    arm_length_errors: tuple[Error, Error, Error, Error] = (0.0, 0.0, 0.0, 0.0)
    forearm_length_errors: tuple[Error, Error, Error, Error] = (0.0, 0.0, 0.0, 0.0)

    @field_validator('rotation_amplification')
    @classmethod
    def _turns_the_tool(cls, amplification: float) -> float:
        if amplification == 0.0:
            raise ValueError('expected the tool angle per theta, which is not 0; give 1 where no '
                             'belt or gear amplifies theta')
        return amplification

    @model_validator(mode='after')
    def _loops_can_close(self) -> Geometry:
        if not (min(self.arm_lengths) > 0.0 and min(self.forearm_lengths) > 0.0):
            raise ValueError('expected arm_length_errors and forearm_length_errors that leave a '
                             'length, as they are added to arm_length and forearm_length')
        across = abs(self.base_radius - self.platform_radius)
        # at the centre legs of one length are the same, whatever their azimuth
        reaches = np.add(self.arm_lengths, self.forearm_lengths)
        lost = np.flatnonzero(across >= reaches)
        if len(lost):
            reach = float(reaches[lost].min())
            legs = f'leg{"s" if len(lost) > 1 else ""} {", ".join(map(str, lost))}'
            raise ValueError(
                f'{legs} cannot close the loops: with the platform centred each plate '
                f'joint is {across:.3f} m from its actuator at the least (base_radius, '
                f'platform_radius), arm_length and forearm_length together reach {reach:.3f} m, '
                f'{across - reach:.3g} m less; lengthen them or bring the radii together')
        return self

    @property
    def arm_lengths(self) -> tuple[float, ...]:
        """L of each leg, m."""
        return tuple(self.arm_length + error for error in self.arm_length_errors)

    @property
    def forearm_lengths(self) -> tuple[float, ...]:
        """l of each leg, m."""
        return tuple(self.forearm_length + error for error in self.forearm_length_errors)

    def with_errors(self, **errors: ArrayLike) -> Geometry:
        """Return the geometry with errors, m, added to its attributes of these names.

        Each is one number, or (4,) for `arm_length_errors` and `forearm_length_errors`. The result
        is not validated: the slope of a torque at a radius of 0 needs one below 0.
        """
        content = self.model_dump()
        for name, error in errors.items():
            sums = np.add(content[name], error).tolist()
            content[name] = tuple(sums) if isinstance(sums, list) else sums
        return Geometry.model_construct(**content)

    @cached_property
    def packed(self) -> np.ndarray:
        """The dimensions as the compiled kernels take them.

        (L, l, R, h, then for each leg cos and sin of its azimuth and x, y of the vector from D
        (legs 2, 3) or D' (legs 0, 1) to B_i, then L of each leg, then l of each), shape (28,).
        Nobody writes to it. It is not marked so: kernels are compiled once more for such memory,
        and plants and unpickled geometries have the other.
        """
        packed = np.empty(PACKED)
        packed[:4] = (self.arm_length, self.forearm_length, self.base_radius,
                      self.platform_bar_length)
        for leg, azimuth in enumerate(self.actuator_azimuth):
            cosine, sine = math.cos(azimuth), math.sin(azimuth)
            side = 0.5 * self.platform_bar_length * (1 if leg >= 2 else -1)
            packed[4 + 4 * leg:8 + 4 * leg] = (
                cosine, sine, self.platform_radius * cosine, self.platform_radius * sine + side)
        packed[ARM:FOREARM], packed[FOREARM:] = self.arm_lengths, self.forearm_lengths
        return packed
