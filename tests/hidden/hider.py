"""What a hider is: how to build a machine with an effect, its usual sizes, its family of shapes.

A hider knows no torque: that is what the machine makes of the effect, see `physics`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hidden.machines import Known
from par4_kinematics.geometry import LEGS
from par4_sim.machines.machine import Machine

Values = dict[str, np.ndarray | float]
"""Parameter -> one number, or (4,) for the joints."""
JOINTS = tuple(range(LEGS))


@dataclass(frozen=True)
class Column:
    """One direction in which an effect can be larger.

    Attributes:
        values: of the effect, of a usual size.
        low, high: bounds of the factor on them.
    """

    values: Values
    low: float = -5.0
    high: float = 5.0


@dataclass(frozen=True)
class Scene:
    """What a family may depend on.

    Attributes:
        reach: least range of a joint, rad.
        periods: a turn, of waves that are hidden.
    """

    reach: float
    periods: tuple[float, ...] = ()


Family = list[list[Column]]
"""One list of columns for each shape: torques of a shape add up, shapes exclude each other."""


@dataclass(frozen=True)
class Hider:
    """One effect.

    Attributes:
        name: as `diagnosis.json` has it.
        build: (machine, values) -> machine with the effect.
        draw: (random, known, joints (k,)) -> values of a usual size.
        sizes: parameters that scale the effect; the others shape it.
        family: scene -> shapes and columns.
        own_joints: whether what it does to a joint shows in that joint's torque alone; a column
            of the family is then one for each joint.
        per_joint: whether each joint has it or not.
    """

    name: str
    build: Callable[[Machine, Values], Machine]
    draw: Callable[[np.random.Generator, Known, np.ndarray], Values]
    sizes: tuple[str, ...]
    family: Callable[[Scene], Family]
    own_joints: bool = False
    per_joint: bool = True


def part(machine: Machine, name: str, **added) -> Machine:
    """Return the machine with a part whose fields are changed."""
    return replace(machine, **{name: replace(getattr(machine, name), **added)})


def on(joints, values) -> np.ndarray:
    """Return (4,) with values on some joints."""
    full = np.zeros(LEGS)
    full[list(joints)] = values
    return full


def signs(random: np.random.Generator, joints) -> np.ndarray:
    """Return +-1 for each joint."""
    return random.choice((-1.0, 1.0), len(joints))


def field_hider(name: str, part_name: str, fields: dict[str, str],
                draw, units: list[list[tuple[Values, float, float]]], sizes, **kind) -> Hider:
    """Return a hider whose parameters are fields of one part of the machine.

    Args:
        fields: parameter -> field.
        units: shapes; each a list of usual values with the bounds of their factor.
    """
    def build(machine: Machine, values: Values) -> Machine:
        own = getattr(machine, part_name)
        changed = {}
        for parameter, value in values.items():
            old = getattr(own, fields[parameter])
            additive = parameter in sizes
            changed[fields[parameter]] = old + value if additive else value
        return part(machine, part_name, **changed)

    def family(_scene):
        return [[Column(*unit) for unit in shape] for shape in units]

    return Hider(name, build, draw, sizes, family, **kind)


def all_joints(values: Values, sizes: tuple[str, ...], low: float = -5.0, high: float = 5.0):
    """Return the same values on all joints, to be split."""
    return [({key: on(JOINTS, value) if key in sizes else value
              for key, value in values.items()}, low, high)]


def each_joint(values: Values, sizes: tuple[str, ...], low: float = -5.0, high: float = 5.0):
    """Return the same values on each joint alone."""
    return [({key: on([joint], value) if key in sizes else value
              for key, value in values.items()}, low, high) for joint in JOINTS]


def scaled(hider: Hider, values: Values, factor: float) -> Values:
    """Return values of another size and the same shape."""
    return {key: value * factor if key in hider.sizes else value for key, value in values.items()}
