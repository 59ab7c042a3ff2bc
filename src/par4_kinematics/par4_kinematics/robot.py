"""What `robot.yaml` says of a machine: geometry, bodies, drives, limits; or a single axis."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field, StrictFloat, field_validator, model_validator

from par4_kinematics.files import (
    FileModel,
    Whole,
    expect_schema,
    parse,
    read_yaml,
    resolve_builtin,
)
from par4_kinematics.geometry import LEGS, Angle, Geometry, Length, ascending

ROBOT_SCHEMA = 'par4/robot/1'
AXIS_SCHEMA = 'par4/axis/1'
PAGE = 'docs/robot_file.md'
"""Of the documentation: every key of both files."""
Hanging = Literal['turning', 'sliding']
"""How a single axis carries a weight: on a lever that turns, or up and down."""
JOINT_NAMES = tuple(f'arm_joint_{leg}' for leg in range(LEGS))


class Bodies(FileModel):
    """Masses and an inertia that the base parameters do not tell apart.

    Attributes:
        rod_mass: m_5, of one rod, kg.
        bar_mass: m_3, of one bar, kg.
        theta_inertia: of what turns with theta, kg m2.
        tool_mass: kg.
    """

    rod_mass: StrictFloat = Field(0.0, ge=0)
    bar_mass: StrictFloat = Field(0.0, ge=0)
    theta_inertia: StrictFloat = Field(0.0, ge=0)
    tool_mass: StrictFloat = Field(0.0, ge=0)


class Drives(FileModel):
    """Actuators and their control loops.

    Attributes:
        gain: G_i, torque per amplifier volt (24), N m/V.
        torque_limit: N m, symmetric.
        velocity_gain: N m s/rad.
        position_gain: 1/s.
        integral_gain: 1/s2.
        speed_limit: of the speed that the position loop asks of the velocity loop, rad/s, or None.
        current_lag: time constant of the current loop, s.
        encoder_counts: counts per turn of the arm, 0 = ideal.
    """

    gain: tuple[StrictFloat, StrictFloat, StrictFloat, StrictFloat]
    torque_limit: StrictFloat = Field(200.0, gt=0)
    velocity_gain: StrictFloat = Field(40.0, ge=0)
    position_gain: StrictFloat = Field(60.0, ge=0)
    integral_gain: StrictFloat = Field(300.0, ge=0)
    speed_limit: StrictFloat | None = Field(None, gt=0)
    current_lag: StrictFloat = Field(0.0, ge=0)
    encoder_counts: Whole = Field(131072, ge=0)

    @model_validator(mode='after')
    def _gain_nonzero(self) -> Drives:
        if any(value <= 0 for value in self.gain):
            raise ValueError(f'drives.gain must be positive N m/V, found {list(self.gain)}')
        return self


class Workspace(FileModel):
    """Cylinder of D, m, and range of |theta|, rad."""

    radius: Length = Field(0.5, gt=0)
    z: Annotated[tuple[Length, Length], AfterValidator(ascending)] = (-0.90, -0.55)
    theta: Angle = Field(math.pi / 4.0, gt=0)

    @field_validator('z')
    @classmethod
    def _below_the_base(cls, z: tuple[float, float]) -> tuple[float, float]:
        if z[1] > 0.0:
            raise ValueError('expected heights in base, z up: below the actuators they are '
                             'negative; give them their sign')
        return z


class Limits(FileModel):
    """Ranges that motions must keep; rad, rad/s."""

    joint_position: Annotated[tuple[Angle, Angle], AfterValidator(ascending)] = (-1.0, 1.6)
    joint_speed: StrictFloat = Field(15.0, gt=0)
    workspace: Workspace = Workspace()


class Robot(FileModel):
    """A machine with the Par4 topology: the content of its `robot.yaml`.

    Attributes:
        schema_name: of the file.
        name: of the robot.
        geometry: dimensions, m and rad.
        bodies: masses and inertia that the base parameters do not tell apart.
        drives: gains, limits, loops and encoders of the four drives.
        limits: of joint positions and speeds, and of the workspace.
    """

    page: ClassVar[str] = PAGE
    schema_name: Literal['par4/robot/1'] = Field(alias='schema')
    name: str
    geometry: Geometry
    bodies: Bodies = Bodies()
    drives: Drives
    limits: Limits = Limits()

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the actuated joints, in the order of every array of this project."""
        return JOINT_NAMES

    @property
    def drive_gain(self) -> tuple[float, ...]:
        """G_i of each joint, N m/V."""
        return self.drives.gain


class Axis(FileModel):
    """A single motor-driven axis: no geometry, only joint-space terms apply.

    Attributes:
        name: of the axis.
        joint: name of its joint.
        kind: whether it slides or turns.
        gain: torque or force per volt, N m/V or N/V; None where torques are logged, not voltages.
        gravity: 'vertical' if the axis lifts a load, because it turns in a vertical plane or slides
            up and down; 'none' if not; 'unknown' lets the data tell.
        gear_ratio: turns of the motor for one turn of the joint, or None.
        pole_pairs: of the motor, or None.
        motor_gain: torque or force at the joint per ampere, N m/A or N/A, or None.
        rated_torque: torque or force at the joint of which a drive logs a share, N m or N, or None.
    """

    page: ClassVar[str] = PAGE
    schema_name: Literal['par4/axis/1'] = Field(alias='schema')
    name: str
    joint: str
    kind: Literal['linear', 'revolute']
    gain: StrictFloat | None = Field(None, gt=0)
    gravity: Literal['none', 'vertical', 'unknown'] = 'none'
    gear_ratio: StrictFloat | None = Field(None, gt=0)
    pole_pairs: Whole | None = Field(None, ge=1)
    motor_gain: StrictFloat | None = Field(None, gt=0)
    rated_torque: StrictFloat | None = Field(None, gt=0)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Name of the one joint."""
        return (self.joint,)

    @property
    def drive_gain(self) -> tuple[float, ...]:
        """Force or torque per volt of the one joint, 1 where the file does not say it."""
        return (self.gain or 1.0,)

    @property
    def hanging(self) -> Hanging | None:
        """How gravity loads the axis, if its base terms contain that load; else None."""
        if self.gravity == 'none':
            return None
        return 'turning' if self.kind == 'revolute' else 'sliding'


def read_machine(name_or_path: str | Path) -> Robot | Axis:
    """Return the machine of a `robot.yaml` of either schema, or of a built-in name.

    Raises:
        InputError: not found, not YAML, wrong schema or values out of range.
    """
    path = resolve_builtin(name_or_path, 'par4_kinematics')
    content = read_yaml(path)
    schema = expect_schema(content, (ROBOT_SCHEMA, AXIS_SCHEMA), str(path), PAGE)
    if schema == ROBOT_SCHEMA:
        return parse(content, Robot, str(path))
    return parse(content, Axis, str(path))


def read_robot(name_or_path: str | Path) -> Robot:
    """Return the Par4 robot of a `robot.yaml` or of a built-in name.

    Raises:
        InputError: see `read_machine`; also if the file describes an axis.
    """
    path = resolve_builtin(name_or_path, 'par4_kinematics')
    content = read_yaml(path)
    expect_schema(content, (ROBOT_SCHEMA,), str(path), PAGE)
    return parse(content, Robot, str(path))
