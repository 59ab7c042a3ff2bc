"""URDF text of Par4: open chains with mass for a rigid-body engine, one tree to look at.

URDF describes trees and Par4 has loops. `chains` cuts them at the plate joints and says which
points an engine has to hold together; `robot_description` cuts them there too and lets the
platform slide freely under the base, `tree_joint_positions` closes them. In both every arm is
horizontal at joint position zero, every rod vertical, and all link frames are parallel to `base`.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from par4_dynamics.mechanism import LumpedBodies, PhysicalBodies, physical_bodies
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.interface import BASE_FRAME, TOOL_FRAME
from par4_kinematics.position import forearm, inverse_kinematics
from par4_kinematics.robot import JOINT_NAMES, Robot

Fidelity = Literal['accurate', 'fast']

UP = np.array((0.0, 0.0, 1.0))
SIDES = (-1.0, 1.0)
"""Where the two of a pair of rods or bars are."""

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
    largest = min(np.min(bodies.actuator_inertia) / geometry.arm_length ** 2,
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


# ---------------------------------------------------------------------------- one leg


def _outward(geometry: Geometry, leg: int) -> np.ndarray:
    """Return e_i (3,)."""
    return np.array((geometry.packed[4 + 4 * leg], geometry.packed[5 + 4 * leg], 0.0))


def _sideways(geometry: Geometry, leg: int) -> np.ndarray:
    """Return z x e_i (3,), the axis about which q_i turns the arm downward."""
    return np.cross(UP, _outward(geometry, leg))


def _plate_joint(geometry: Geometry, leg: int) -> np.ndarray:
    """Return the vector (3,), m, from D (legs 2, 3) or D' (legs 0, 1) to B_i."""
    return np.array((geometry.packed[6 + 4 * leg], geometry.packed[7 + 4 * leg], 0.0))


def _swing_and_tilt(geometry: Geometry, rod: np.ndarray, angle: float, leg: int
                    ) -> tuple[float, float]:
    """Return the turns, rad, that take a rod of `leg` from vertical into the direction rod (3,).

    In the frame of the arm at q_i = angle: first about e_i (tilt), then about z x e_i (swing).
    """
    rod = rod / np.linalg.norm(rod)
    outward, sideways = _outward(geometry, leg), _sideways(geometry, leg)
    along_arm = rod @ (math.cos(angle) * outward - math.sin(angle) * UP)
    above_arm = rod @ (math.sin(angle) * outward + math.cos(angle) * UP)
    return math.atan2(-along_arm, -above_arm), math.asin(rod @ sideways)


def _rod_quaternion(geometry: Geometry, x: np.ndarray, angle: float, leg: int) -> np.ndarray:
    rod = np.array(forearm(geometry.packed, x, angle, leg))
    swing, tilt = (0.5 * turn for turn in _swing_and_tilt(geometry, rod, angle, leg))
    vector = (math.sin(swing) * math.cos(tilt) * _sideways(geometry, leg)
              + math.cos(swing) * math.sin(tilt) * _outward(geometry, leg)
              - math.sin(swing) * math.sin(tilt) * UP)
    return np.append(vector, math.cos(swing) * math.cos(tilt))


# ---------------------------------------------------------------------------- chains


def _rod_offsets(geometry: Geometry, leg: int, fidelity: Fidelity) -> list[np.ndarray]:
    """Return where the rods of `leg` start, from the middle of the elbow, m."""
    if fidelity == 'fast':
        return [np.zeros(3)]
    return [side * ROD_OFFSET * geometry.arm_length * _sideways(geometry, leg) for side in SIDES]


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
    mass = max(inertia / (0.5 * geometry.arm_length) ** 2, 2.0 * moment ** 2 / inertia)
    return mass, moment / mass * _outward(geometry, leg), np.full(3, inertia - moment ** 2 / mass)


def rod_inertial(geometry: Geometry, bodies: LumpedBodies, single: PhysicalBodies,
                 together: float = 1.0) -> Inertial:
    """Return what a rod weighs, or several together; along -z from the elbow.

    End masses need m l^2 / 4 for (20); distributed mass takes off its m l^2 / 6.
    """
    across = together * geometry.forearm_length ** 2 * (
        single.rod_mass / 4.0 - bodies.rod_mass / 6.0)
    return (together * single.rod_mass, -0.5 * geometry.forearm_length * UP,
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
    outward = _outward(geometry, leg)
    foot = geometry.base_radius * outward
    if fidelity == 'fast':
        foot = foot - _plate_joint(geometry, leg)
    robot = _document(leg_chain(leg))
    add_inertial(_add_link(robot, BASE_FRAME))

    add_inertial(_add_link(robot, 'arm'), *arm_inertial(geometry, single, leg))
    _add_joint(robot, JOINT_NAMES[leg], 'continuous', BASE_FRAME, 'arm', foot,
               _sideways(geometry, leg))

    offsets = _rod_offsets(geometry, leg, fidelity)
    together = 2.0 / len(offsets)
    for number, offset in enumerate(offsets):
        add_inertial(_add_link(robot, f'rod_{number}'),
                     *rod_inertial(geometry, bodies, single, together))
        _add_joint(robot, f'elbow_{number}', 'spherical', 'arm', f'rod_{number}',
                   geometry.arm_length * outward + offset)
    return _text(robot)


def _plate_urdf(geometry: Geometry, bodies: LumpedBodies, single: PhysicalBodies, name: str,
                fidelity: Fidelity) -> str:
    robot = _document(name)
    mass = single.half_plate_1 if name == PLATE_CHAINS[0] else single.half_plate_2
    if fidelity == 'fast':
        add_inertial(_add_link(robot, BASE_FRAME))
        _add_slides(robot, PLATE_SLIDES, PLATE_SLIDES)
    add_inertial(_add_link(robot, 'plate'), *plate_inertial(geometry, mass))
    if name == PLATE_CHAINS[0]:
        offsets = _bar_offsets(geometry, fidelity)
        together = 2.0 / len(offsets)
        for number, offset in enumerate(offsets):
            add_inertial(_add_link(robot, f'bar_{number}'),
                         *bar_inertial(geometry, bodies, single, together))
            _add_joint(robot, f'bar_rotation_{number}', 'continuous', 'plate', f'bar_{number}',
                       offset)
    return _text(robot)


def _closures(geometry: Geometry, fidelity: Fidelity) -> list[Closure]:
    result = []
    rod_end = (0.0, 0.0, -geometry.forearm_length)
    for leg in range(LEGS):
        plate = PLATE_CHAINS[0 if leg >= 2 else 1]
        joint = np.zeros(3) if fidelity == 'fast' else _plate_joint(geometry, leg)
        for number, offset in enumerate(_rod_offsets(geometry, leg, fidelity)):
            result.append(Closure(LinkPoint(leg_chain(leg), f'rod_{number}', rod_end),
                                  LinkPoint(plate, 'plate', tuple(joint + offset))))
    bar_end = (0.0, geometry.platform_bar_length, 0.0)
    for number, offset in enumerate(_bar_offsets(geometry, fidelity)):
        result.append(Closure(LinkPoint(PLATE_CHAINS[0], f'bar_{number}', bar_end),
                              LinkPoint(PLATE_CHAINS[1], 'plate', tuple(offset))))
    return result


# ---------------------------------------------------------------------------- tree

PLATFORM_SLIDES = ('platform_x', 'platform_y', 'platform_z')
"""Joints of the tree that place D; no such joints exist."""
THETA_JOINT = 'theta'
TOOL_JOINT = 'tool_rotation'
PAIR_OFFSET = 0.12
"""Drawn distance of a rod or bar from the middle of its pair, over the arm length."""
COLOURS = {'frame': (0.62, 0.65, 0.69), 'motor': (0.20, 0.22, 0.25), 'metal': (0.76, 0.78, 0.80),
           'carbon': (0.20, 0.21, 0.23), 'plate': (0.95, 0.58, 0.10), 'bar': (0.10, 0.40, 0.72),
           'belt': (0.22, 0.22, 0.22), 'pointer': (0.86, 0.13, 0.10), 'tail': (0.05, 0.50, 0.47)}
"""Drawn last, the main shape of a link gives it its colour in viewers that know one a link."""


def robot_description(robot: Robot) -> str:
    """Return the URDF of the whole robot as a tree: shapes to look at, no masses.

    The joint positions of a pose are those of `tree_joint_positions`; joints that follow another
    are also declared as mimics of it.
    """
    geometry = robot.geometry
    tree = _document(robot.name)
    for name, colour in COLOURS.items():
        material = ElementTree.SubElement(tree, 'material', name=name)
        ElementTree.SubElement(material, 'color', rgba=_numbers((*colour, 1.0)))
    _draw_frame(tree, geometry)
    for leg in range(LEGS):
        _draw_leg(tree, geometry, leg)
    _draw_platform(tree, geometry)
    return _text(tree)


def tree_joint_positions(geometry: Geometry, x: ArrayLike) -> dict[str, float]:
    """Return joint name -> position, rad or m, of every joint of `robot_description` at pose x.

    Raises:
        UnreachableError: a pose that a leg cannot reach.
    """
    x = np.asarray(x, dtype=float)
    q = inverse_kinematics(geometry, x)
    rods = np.array([[forearm(geometry.packed, x, angle, leg)] * len(SIDES)
                     for leg, angle in enumerate(q)])
    return dict(zip(JOINT_NAMES, q.tolist(), strict=True)) | passive_joint_positions(
        geometry, x, q, rods)


def passive_joint_positions(geometry: Geometry, x: np.ndarray, q: np.ndarray, rods: np.ndarray
                            ) -> dict[str, float]:
    """Return joint name -> position, rad or m, of the joints of the tree that no motor turns.

    Args:
        geometry: dimensions of the robot.
        x: pose of D and theta (4,), m, rad.
        q: positions of the arms (4,), rad.
        rods: directions of the two rods of each leg from elbow to plate, (4, 2, 3), any length.
    """
    positions = {}
    for leg, angle in enumerate(q):
        for number, rod in enumerate(rods[leg]):
            swing, tilt = _swing_and_tilt(geometry, rod, angle, leg)
            positions |= {f'swing_{leg}_{number}': swing, f'tilt_{leg}_{number}': tilt}
    positions |= dict(zip(PLATFORM_SLIDES, x[:3].tolist(), strict=True))
    theta = float(x[3])
    return positions | {
        THETA_JOINT: theta, 'bar_rotation_0': theta, 'bar_rotation_1': theta,
        'half_plate_2_rotation': -theta, TOOL_JOINT: geometry.rotation_amplification * theta}


def _draw_frame(tree: ElementTree.Element, geometry: Geometry) -> None:
    """Draw motors along the actuator axes, hung by brackets from a plate with a beam to each."""
    base = ElementTree.SubElement(tree, 'link', name=BASE_FRAME)
    arm = geometry.arm_length
    height, thickness = 0.21 * arm * UP, 0.05 * arm
    for leg in range(LEGS):
        outward, sideways = _outward(geometry, leg), _sideways(geometry, leg)
        foot = geometry.base_radius * outward
        for start, end, radius, colour in ((-0.13, -0.50, 0.115, 'motor'),
                                           (-0.50, -0.56, 0.085, 'metal'),
                                           (0.13, 0.20, 0.085, 'motor')):
            _draw_cylinder(base, colour, radius * arm, foot + start * arm * sideways,
                           foot + end * arm * sideways)
        for side in SIDES:
            bracket = foot + side * 0.12 * arm * sideways
            _draw_beam(base, 'frame', (0.04 * arm, 0.20 * arm), bracket - 0.11 * arm * UP,
                       bracket + height)
        _draw_beam(base, 'frame', (0.40 * arm, thickness), height,
                   foot + 0.14 * arm * outward + height)
    _draw_cylinder(base, 'frame', 0.2 * arm + 0.5 * geometry.base_radius,
                   height - 0.5 * thickness * UP, height + 0.5 * thickness * UP)


def _draw_leg(tree: ElementTree.Element, geometry: Geometry, leg: int) -> None:
    """Draw an arm, a tube that narrows, and the two rods with their ball joints."""
    length, outward = geometry.arm_length, _outward(geometry, leg)
    sideways, elbow = _sideways(geometry, leg), length * outward
    pair = PAIR_OFFSET * length * sideways
    arm = ElementTree.SubElement(tree, 'link', name=f'arm_{leg}')
    _draw_cylinder(arm, 'metal', 0.10 * length, -0.08 * length * sideways, 0.08 * length * sideways)
    _draw_cylinder(arm, 'metal', 0.025 * length, elbow - pair, elbow + pair)
    for start, end, radius in ((0.0, 0.35, 0.065), (0.35, 0.7, 0.056), (0.7, 1.02, 0.047)):
        _draw_cylinder(arm, 'carbon', radius * length, start * elbow, end * elbow)
    _add_joint(tree, JOINT_NAMES[leg], 'continuous', BASE_FRAME, f'arm_{leg}',
               geometry.base_radius * outward, sideways)
    for number, side in enumerate(SIDES):
        between, name = f'elbow_{leg}_{number}', f'rod_{leg}_{number}'
        ElementTree.SubElement(tree, 'link', name=between)
        rod = ElementTree.SubElement(tree, 'link', name=name)
        end = -geometry.forearm_length * UP
        for ball in (np.zeros(3), end):
            _draw(rod, 'metal', 'sphere', {'radius': 0.036 * length}, ball, UP)
        _draw_cylinder(rod, 'carbon', 0.017 * length, np.zeros(3), end)
        for turn, parent, child, origin, axis in (
                ('swing', f'arm_{leg}', between, elbow + side * pair, sideways),
                ('tilt', between, name, np.zeros(3), outward)):
            _add_joint(tree, f'{turn}_{leg}_{number}', 'continuous', parent, child, origin, axis,
                       mimic=None if number == 0 else (f'{turn}_{leg}_0', 1.0))


def _draw_platform(tree: ElementTree.Element, geometry: Geometry) -> None:
    arm = geometry.arm_length
    bar = np.array((0.0, geometry.platform_bar_length, 0.0))
    apart = np.array((PAIR_OFFSET * arm, 0.0, 0.0))
    height = 0.06 * arm * UP
    _add_slides(tree, PLATFORM_SLIDES, ('platform_slide_x', 'platform_slide_y', 'half_plate_1'))
    _draw_half_plate(tree, geometry, 'half_plate_1', (2, 3), apart)
    for number, side in enumerate(SIDES):
        link = ElementTree.SubElement(tree, 'link', name=f'bar_{number}')
        for end in (np.zeros(3), bar):
            _draw_cylinder(link, 'metal', 0.03 * arm, end, end + 1.6 * height)
        _draw_beam(link, 'bar', (0.06 * arm, 0.04 * arm), height, bar + height)
        _add_joint(tree, f'bar_rotation_{number}', 'continuous', 'half_plate_1', f'bar_{number}',
                   side * apart, mimic=(THETA_JOINT, 1.0))
    _draw_belt(tree, arm, bar)
    _add_joint(tree, THETA_JOINT, 'continuous', 'half_plate_1', 'middle_line')
    _draw_half_plate(tree, geometry, 'half_plate_2', (0, 1), apart)
    _add_joint(tree, 'half_plate_2_rotation', 'continuous', 'middle_line', 'half_plate_2', bar,
               mimic=(THETA_JOINT, -1.0))
    _draw_tool(tree, arm)
    _add_joint(tree, TOOL_JOINT, 'continuous', 'half_plate_1', TOOL_FRAME,
               mimic=(THETA_JOINT, geometry.rotation_amplification))


def _draw_half_plate(tree: ElementTree.Element, geometry: Geometry, name: str,
                     legs: tuple[int, int], apart: np.ndarray) -> None:
    link = ElementTree.SubElement(tree, 'link', name=name)
    arm = geometry.arm_length
    section = (0.10 * arm, 0.06 * arm)
    for leg in legs:
        joint = _plate_joint(geometry, leg)
        pair = PAIR_OFFSET * arm * _sideways(geometry, leg)
        _draw_cylinder(link, 'metal', 0.025 * arm, joint - pair, joint + pair)
        _draw_beam(link, 'plate', section, np.zeros(3), joint)
    _draw_beam(link, 'plate', section, -1.4 * apart, 1.4 * apart)


def _draw_belt(tree: ElementTree.Element, arm: float, bar: np.ndarray) -> None:
    """Draw, midway between the bars, the wheel at D' and the belt that turns the tool at D."""
    link = ElementTree.SubElement(tree, 'link', name='middle_line')
    low, high = 0.10 * arm * UP, 0.14 * arm * UP
    across = np.array((1.0, 0.0, 0.0))
    _draw_cylinder(link, 'metal', 0.09 * arm, bar + low, bar + high)
    for side in SIDES:
        _draw_beam(link, 'belt', (0.008 * arm, 0.03 * arm),
                   0.5 * (low + high) + side * 0.035 * arm * across,
                   bar + 0.5 * (low + high) + side * 0.09 * arm * across)


def _draw_tool(tree: ElementTree.Element, arm: float) -> None:
    """Draw a spindle, its pulley and, along x, a pointer of two colours that shows its angle."""
    tool = ElementTree.SubElement(tree, 'link', name=TOOL_FRAME)
    _draw_cylinder(tool, 'metal', 0.035 * arm, 0.14 * arm * UP, -0.36 * arm * UP)
    _draw_cylinder(tool, 'metal', 0.10 * arm, -0.30 * arm * UP, -0.34 * arm * UP)
    middle = -0.36 * arm * UP
    tail, tip = (middle + np.array((part * arm, 0.0, 0.0)) for part in (-0.40, 0.55))
    _draw_beam(tool, 'tail', (0.07 * arm, 0.05 * arm), middle, tail)
    for side in SIDES:
        _draw_beam(tool, 'pointer', (0.06 * arm, 0.05 * arm), tip,
                   tip + np.array((-0.18 * arm, side * 0.14 * arm, 0.0)))
    _draw_beam(tool, 'pointer', (0.07 * arm, 0.05 * arm), middle, tip)


# ---------------------------------------------------------------------------- writing URDF


def _numbers(values: ArrayLike) -> str:
    return ' '.join(repr(float(value)) for value in np.ravel(values))


def _document(name: str) -> ElementTree.Element:
    return ElementTree.Element('robot', name=name)


def _text(robot: ElementTree.Element) -> str:
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding='unicode') + '\n'


def _add_link(robot: ElementTree.Element, name: str) -> ElementTree.Element:
    return ElementTree.SubElement(robot, 'link', name=name)


def add_inertial(link: ElementTree.Element, mass: float = 0.0,
                 centre: ArrayLike = (0.0, 0.0, 0.0), inertia: ArrayLike = 0.0) -> None:
    """Give a link a mass, kg, a centre (3,), m, and central inertia about x, y, z, kg m2."""
    inertial = ElementTree.SubElement(link, 'inertial')
    ElementTree.SubElement(inertial, 'origin', xyz=_numbers(centre))
    ElementTree.SubElement(inertial, 'mass', value=_numbers(mass))
    xx, yy, zz = (_numbers(value) for value in np.broadcast_to(inertia, 3))
    ElementTree.SubElement(inertial, 'inertia', ixx=xx, iyy=yy, izz=zz, ixy='0', ixz='0', iyz='0')


def _add_joint(robot: ElementTree.Element, name: str, kind: str, parent: str, child: str,
               origin: ArrayLike = (0.0, 0.0, 0.0), axis: ArrayLike = UP,
               mimic: tuple[str, float] | None = None) -> None:
    joint = ElementTree.SubElement(robot, 'joint', name=name, type=kind)
    ElementTree.SubElement(joint, 'parent', link=parent)
    ElementTree.SubElement(joint, 'child', link=child)
    ElementTree.SubElement(joint, 'origin', xyz=_numbers(origin))
    ElementTree.SubElement(joint, 'axis', xyz=_numbers(axis))
    if kind == 'prismatic':
        ElementTree.SubElement(joint, 'limit', lower='-100', upper='100', effort='1e6',
                               velocity='1e6')
    if mimic is not None:
        leader, ratio = mimic
        ElementTree.SubElement(joint, 'mimic', joint=leader, multiplier=_numbers(ratio))


def _add_slides(robot: ElementTree.Element, joints: tuple[str, ...], links: tuple[str, ...]
                ) -> None:
    """Add joints that slide the last of three links along x, y, z from `base`, and the others."""
    for name in links[:-1]:
        add_inertial(_add_link(robot, name))
    for joint, parent, child, axis in zip(joints, (BASE_FRAME, *links[:-1]), links, np.eye(3),
                                          strict=True):
        _add_joint(robot, joint, 'prismatic', parent, child, axis=axis)


def _draw(link: ElementTree.Element, colour: str, shape: str, size: dict[str, ArrayLike],
          centre: np.ndarray, along: np.ndarray) -> None:
    """Add a shape whose own axis (x of a box, z of a cylinder) lies along a direction."""
    visual = ElementTree.SubElement(link, 'visual')
    x, y, z = along
    yaw, elevation = math.atan2(y, x), math.atan2(z, math.hypot(x, y))
    pitch = -elevation if shape == 'box' else 0.5 * math.pi - elevation
    ElementTree.SubElement(visual, 'origin', xyz=_numbers(centre), rpy=_numbers((0.0, pitch, yaw)))
    geometry = ElementTree.SubElement(visual, 'geometry')
    ElementTree.SubElement(geometry, shape, {name: _numbers(part) for name, part in size.items()})
    ElementTree.SubElement(visual, 'material', name=colour)


def _draw_cylinder(link: ElementTree.Element, colour: str, radius: float, start: np.ndarray,
                   end: np.ndarray) -> None:
    length = np.linalg.norm(end - start)
    _draw(link, colour, 'cylinder', {'radius': radius, 'length': length}, 0.5 * (start + end),
          end - start)


def _draw_beam(link: ElementTree.Element, colour: str, section: tuple[float, float],
               start: np.ndarray, end: np.ndarray) -> None:
    """Add a box from start to end; section is its width and height, m."""
    length = np.linalg.norm(end - start)
    _draw(link, colour, 'box', {'size': (length, *section)}, 0.5 * (start + end), end - start)
