"""Par4 cut into open chains with mass, which a rigid-body engine holds together.

URDF describes trees and Par4 has loops. `chains` cuts them at the plate joints and says which
points an engine has to hold together. Every arm is horizontal at joint position zero, every rod
vertical, and all link frames are parallel to `base`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from par4_dynamics.mechanism import LumpedBodies, PhysicalBodies, physical_bodies
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.interface import BASE_FRAME
from par4_kinematics.position import forearm, inverse_kinematics
from par4_kinematics.robot import JOINT_NAMES
from par4_sim.description.leg_axes import (
    SIDES,
    outward_of,
    plate_joint_of,
    sideways_of,
    swing_and_tilt,
)
from par4_sim.description.urdf import (
    UP,
    add_inertial,
    add_joint,
    add_link,
    add_slides,
    document,
    text_of,
)

Fidelity = Literal['accurate', 'fast']

# What moves depends on the lumped masses and on the distributed part of rods and bars, not on how
# the rest is divided between rods, bars, plates and arms; nor, as the half plates only translate,
# on how far apart the two rods of a forearm or the two bars are. So these are free, and chosen for
# the iterative solvers of rigid-body engines, which converge slowly where a light body joins heavy
# ones: with rods of 40 g, 9 cm apart, 200 sweeps answer a random torque 18 % wrong, so 0.004 %.
ROD_SHARE = 0.25
"""Mass of a rod of a chain over the largest that the lumped masses leave room for."""
BAR_SHARE = 0.2
"""The same for a bar, after the rods."""
ROD_OFFSET = 0.75
"""Distance of a rod from the middle of its pair, over the arm length."""
BAR_OFFSET = 1.0
"""Distance of a bar from the middle of the pair, over the arm length."""
PLATE_GYRATION = 0.5
"""Radius of gyration of a half plate, over the arm length."""
AXIAL_INERTIA = 1e-3
"""Inertia of a rod about itself over that across; nothing turns a rod about itself."""

PLATE_CHAINS = ('half_plate_1', 'half_plate_2')
"""Chains of the half plates at D and D': link plate, at D also bar_0 (and bar_1)."""
PLATE_SLIDES = ('slide_x', 'slide_y', 'plate')
"""Links that slide along x, y, z under a half plate of the fast mechanism."""


def leg_chain(leg: int) -> str:
    """Return the name of the chain with the links arm, rod_0 (and rod_1) of `leg`."""
    return f'leg_{leg}'


@dataclass(frozen=True)
class LinkPoint:
    """A point of a link, named as in the URDF of its chain; position (3,) in its frame, m."""

    chain: str
    link: str
    position: tuple[float, ...]


@dataclass(frozen=True)
class Closure:
    """Two points that belong together: a cut ball joint."""

    first: LinkPoint
    second: LinkPoint


@dataclass(frozen=True)
class Chains:
    """The mechanism cut into open chains.

    Attributes:
        fixed: chain name -> URDF, for those that stand on the ground.
        floating: chain name -> URDF, for those whose first link is free.
        closures: what closes the loops.
    """

    fixed: dict[str, str]
    floating: dict[str, str]
    closures: tuple[Closure, ...]


def chains(geometry: Geometry, bodies: LumpedBodies, fidelity: Fidelity) -> Chains:
    """Return the chains whose closed motion is that of the mechanism with `bodies`.

    'accurate' is the whole mechanism: two rods a forearm, two bars, free half plates that the
    rods alone keep parallel. 'fast' has one rod a forearm with the mass of both, both bars in
    one, and half plates that slide; each leg is moved so that its rod ends at D or D'.

    Raises:
        InputError: the lumped masses leave a body without mass or inertia.
    """
    single = engine_bodies(geometry, bodies)
    legs = {leg_chain(leg): _leg_urdf(geometry, bodies, single, leg, fidelity)
            for leg in range(LEGS)}
    plates = {name: _plate_urdf(geometry, bodies, single, name, fidelity)
              for name in PLATE_CHAINS}
    closures = tuple(_closures(geometry, fidelity))
    if fidelity == 'fast':
        return Chains(legs | plates, {}, closures)
    return Chains(legs, plates, closures)


def engine_bodies(geometry: Geometry, bodies: LumpedBodies) -> PhysicalBodies:
    """Return single bodies with the lumped masses of `bodies` that suit an iterative solver.

    Raises:
        InputError: the lumped masses leave a body without mass or inertia.
    """
    largest = min(np.min(bodies.actuator_inertia / np.square(geometry.arm_lengths)),
                  0.5 * bodies.platform_mass_1, 0.5 * bodies.platform_mass_2)
    rod_mass = max(ROD_SHARE * largest, bodies.rod_mass)
    rest = min(bodies.platform_mass_1, bodies.platform_mass_2) - 2.0 * rod_mass
    bar_mass = max(BAR_SHARE * rest, bodies.bar_mass)
    result = physical_bodies(geometry, bodies, rod_mass, bar_mass)
    if not min(result.motor_inertia.min(), result.half_plate_1, result.half_plate_2) > 0:
        raise InputError(
            f'masses of the simulated bodies: actuator_inertia {np.min(bodies.actuator_inertia):g} '
            f'kg m2, platform_mass_1 {bodies.platform_mass_1:g} kg, platform_mass_2 '
            f'{bodies.platform_mass_2:g} kg, rod_mass {bodies.rod_mass:g} kg and bar_mass '
            f'{bodies.bar_mass:g} kg leave a body without mass; raise the first three or lower '
            f'the last two')
    return result


def link_positions(geometry: Geometry, fidelity: Fidelity, x: ArrayLike
                   ) -> dict[tuple[str, str], np.ndarray]:
    """Return (chain, link) -> position of its joint that closes the loops at pose x (4,).

    One number for a joint that turns or slides, rad or m; a quaternion (x, y, z, w) for a ball
    joint; the place (3,), m, for a free link.

    Raises:
        UnreachableError: a pose that a leg cannot reach.
    """
    x = np.asarray(x, dtype=float)
    angles = inverse_kinematics(geometry, x)
    positions = {}
    for leg, angle in enumerate(angles):
        positions[leg_chain(leg), 'arm'] = angle
        for number in range(len(_rod_offsets(geometry, leg, fidelity))):
            positions[leg_chain(leg), f'rod_{number}'] = _rod_quaternion(geometry, x, angle, leg)
    bar = geometry.platform_bar_length * np.array((-math.sin(x[3]), math.cos(x[3]), 0.0))
    for chain, centre in zip(PLATE_CHAINS, (x[:3], x[:3] + bar), strict=True):
        if fidelity == 'fast':
            positions |= {(chain, slide): value
                          for slide, value in zip(PLATE_SLIDES, centre, strict=True)}
        else:
            positions[chain, 'plate'] = centre
    for number in range(len(_bar_offsets(geometry, fidelity))):
        positions[PLATE_CHAINS[0], f'bar_{number}'] = x[3]
    return positions


def _rod_quaternion(geometry: Geometry, x: np.ndarray, angle: float, leg: int) -> np.ndarray:
    rod = np.array(forearm(geometry.packed, x, angle, leg))
    swing, tilt = (0.5 * turn for turn in swing_and_tilt(geometry, rod, angle, leg))
    vector = (math.sin(swing) * math.cos(tilt) * sideways_of(geometry, leg)
              + math.cos(swing) * math.sin(tilt) * outward_of(geometry, leg)
              - math.sin(swing) * math.sin(tilt) * UP)
    return np.append(vector, math.cos(swing) * math.cos(tilt))


def _rod_offsets(geometry: Geometry, leg: int, fidelity: Fidelity) -> list[np.ndarray]:
    """Return where the rods of `leg` start, from the middle of the elbow, m."""
    if fidelity == 'fast':
        return [np.zeros(3)]
    return [side * ROD_OFFSET * geometry.arm_length * sideways_of(geometry, leg) for side in SIDES]


def _bar_offsets(geometry: Geometry, fidelity: Fidelity) -> list[np.ndarray]:
    """Return where the bars start, from D, m."""
    if fidelity == 'fast':
        return [np.zeros(3)]
    return [np.array((side * BAR_OFFSET * geometry.arm_length, 0.0, 0.0)) for side in SIDES]


Inertial = tuple[float, np.ndarray, np.ndarray]
"""Of a link: mass, kg; centre (3,), m; central inertia about x, y, z (3,), kg m2."""


def arm_inertial(geometry: Geometry, single: PhysicalBodies, leg: int) -> Inertial:
    """Return what an arm weighs, its motor included.

    Only the inertia about the axis and the gravity moment count: any mass does that leaves the
    central inertia positive.
    """
    inertia, moment = float(single.motor_inertia[leg]), float(single.arm_moment[leg])
    mass = max(inertia / (0.5 * geometry.arm_lengths[leg]) ** 2, 2.0 * moment ** 2 / inertia)
    return mass, moment / mass * outward_of(geometry, leg), np.full(3, inertia - moment ** 2 / mass)


def rod_inertial(geometry: Geometry, bodies: LumpedBodies, single: PhysicalBodies, leg: int,
                 together: float = 1.0) -> Inertial:
    """Return what a rod of a leg weighs, or several together; along -z from the elbow.

    End masses need m l^2 / 4 for (20); distributed mass takes off its m l^2 / 6.
    """
    length = geometry.forearm_lengths[leg]
    across = together * length ** 2 * (single.rod_mass / 4.0 - bodies.rod_mass / 6.0)
    return (together * single.rod_mass, -0.5 * length * UP,
            across * np.array((1.0, 1.0, AXIAL_INERTIA)))


def bar_inertial(geometry: Geometry, bodies: LumpedBodies, single: PhysicalBodies,
                 together: float = 1.0) -> Inertial:
    """Return what a bar weighs, or several together; along y, with its share of theta's inertia."""
    length = geometry.platform_bar_length
    inertia = together * (length ** 2 * (single.bar_mass / 4.0 - bodies.bar_mass / 6.0)
                          + 0.5 * bodies.theta_inertia)
    return together * single.bar_mass, np.array((0.0, 0.5 * length, 0.0)), np.full(3, inertia)


def plate_inertial(geometry: Geometry, mass: float) -> Inertial:
    """Return what a half plate weighs; as it only translates, its inertia never counts."""
    return mass, np.zeros(3), np.full(3, mass * (PLATE_GYRATION * geometry.arm_length) ** 2)


def _leg_urdf(geometry: Geometry, bodies: LumpedBodies, single: PhysicalBodies, leg: int,
              fidelity: Fidelity) -> str:
    outward = outward_of(geometry, leg)
    foot = geometry.base_radius * outward
    if fidelity == 'fast':
        foot = foot - plate_joint_of(geometry, leg)
    robot = document(leg_chain(leg))
    add_inertial(add_link(robot, BASE_FRAME))

    add_inertial(add_link(robot, 'arm'), *arm_inertial(geometry, single, leg))
    add_joint(robot, JOINT_NAMES[leg], 'continuous', BASE_FRAME, 'arm', foot,
              sideways_of(geometry, leg))

    offsets = _rod_offsets(geometry, leg, fidelity)
    together = 2.0 / len(offsets)
    for number, offset in enumerate(offsets):
        add_inertial(add_link(robot, f'rod_{number}'),
                     *rod_inertial(geometry, bodies, single, leg, together))
        add_joint(robot, f'elbow_{number}', 'spherical', 'arm', f'rod_{number}',
                  geometry.arm_lengths[leg] * outward + offset)
    return text_of(robot)


def _plate_urdf(geometry: Geometry, bodies: LumpedBodies, single: PhysicalBodies, name: str,
                fidelity: Fidelity) -> str:
    robot = document(name)
    mass = single.half_plate_1 if name == PLATE_CHAINS[0] else single.half_plate_2
    if fidelity == 'fast':
        add_inertial(add_link(robot, BASE_FRAME))
        add_slides(robot, PLATE_SLIDES, PLATE_SLIDES)
    add_inertial(add_link(robot, 'plate'), *plate_inertial(geometry, mass))
    if name == PLATE_CHAINS[0]:
        offsets = _bar_offsets(geometry, fidelity)
        together = 2.0 / len(offsets)
        for number, offset in enumerate(offsets):
            add_inertial(add_link(robot, f'bar_{number}'),
                         *bar_inertial(geometry, bodies, single, together))
            add_joint(robot, f'bar_rotation_{number}', 'continuous', 'plate', f'bar_{number}',
                      offset)
    return text_of(robot)


def _closures(geometry: Geometry, fidelity: Fidelity) -> list[Closure]:
    result = []
    for leg in range(LEGS):
        rod_end = (0.0, 0.0, -geometry.forearm_lengths[leg])
        plate = PLATE_CHAINS[0 if leg >= 2 else 1]
        joint = np.zeros(3) if fidelity == 'fast' else plate_joint_of(geometry, leg)
        for number, offset in enumerate(_rod_offsets(geometry, leg, fidelity)):
            result.append(Closure(LinkPoint(leg_chain(leg), f'rod_{number}', rod_end),
                                  LinkPoint(plate, 'plate', tuple(joint + offset))))
    bar_end = (0.0, geometry.platform_bar_length, 0.0)
    for number, offset in enumerate(_bar_offsets(geometry, fidelity)):
        result.append(Closure(LinkPoint(PLATE_CHAINS[0], f'bar_{number}', bar_end),
                              LinkPoint(PLATE_CHAINS[1], 'plate', tuple(offset))))
    return result
