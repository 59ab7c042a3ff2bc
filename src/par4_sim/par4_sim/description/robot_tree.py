"""Par4 as one URDF tree of shapes to look at, and the joint positions that close its loops.

`robot_description` cuts the loops at the plate joints and lets the platform slide freely under the
base; `tree_joint_positions` closes them. Every arm is horizontal at joint position zero, every rod
vertical, and all link frames are parallel to `base`.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.interface import BASE_FRAME, TOOL_FRAME
from par4_kinematics.position import forearm, inverse_kinematics
from par4_kinematics.robot import JOINT_NAMES, Robot
from par4_sim.description.leg_axes import (
    SIDES,
    outward_of,
    plate_joint_of,
    sideways_of,
    swing_and_tilt,
)
from par4_sim.description.urdf import (
    UP,
    add_joint,
    add_slides,
    document,
    draw,
    draw_beam,
    draw_cylinder,
    numbers,
    text_of,
)

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
    tree = document(robot.name)
    for name, colour in COLOURS.items():
        material = ElementTree.SubElement(tree, 'material', name=name)
        ElementTree.SubElement(material, 'color', rgba=numbers((*colour, 1.0)))
    _draw_frame(tree, geometry)
    for leg in range(LEGS):
        _draw_leg(tree, geometry, leg)
    _draw_platform(tree, geometry)
    return text_of(tree)


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
    positions: dict[str, float] = {}
    for leg, angle in enumerate(q):
        for number, rod in enumerate(rods[leg]):
            swing, tilt = swing_and_tilt(geometry, rod, angle, leg)
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
        outward, sideways = outward_of(geometry, leg), sideways_of(geometry, leg)
        foot = geometry.base_radius * outward
        for start, end, radius, colour in ((-0.13, -0.50, 0.115, 'motor'),
                                           (-0.50, -0.56, 0.085, 'metal'),
                                           (0.13, 0.20, 0.085, 'motor')):
            draw_cylinder(base, colour, radius * arm, foot + start * arm * sideways,
                          foot + end * arm * sideways)
        for side in SIDES:
            bracket = foot + side * 0.12 * arm * sideways
            draw_beam(base, 'frame', (0.04 * arm, 0.20 * arm), bracket - 0.11 * arm * UP,
                      bracket + height)
        draw_beam(base, 'frame', (0.40 * arm, thickness), height,
                  foot + 0.14 * arm * outward + height)
    draw_cylinder(base, 'frame', 0.2 * arm + 0.5 * geometry.base_radius,
                  height - 0.5 * thickness * UP, height + 0.5 * thickness * UP)


def _draw_leg(tree: ElementTree.Element, geometry: Geometry, leg: int) -> None:
    """Draw an arm, a tube that narrows, and the two rods with their ball joints."""
    length, outward = geometry.arm_lengths[leg], outward_of(geometry, leg)
    sideways, elbow = sideways_of(geometry, leg), length * outward
    pair = PAIR_OFFSET * length * sideways
    arm = ElementTree.SubElement(tree, 'link', name=f'arm_{leg}')
    draw_cylinder(arm, 'metal', 0.10 * length, -0.08 * length * sideways, 0.08 * length * sideways)
    draw_cylinder(arm, 'metal', 0.025 * length, elbow - pair, elbow + pair)
    for start, end, radius in ((0.0, 0.35, 0.065), (0.35, 0.7, 0.056), (0.7, 1.02, 0.047)):
        draw_cylinder(arm, 'carbon', radius * length, start * elbow, end * elbow)
    add_joint(tree, JOINT_NAMES[leg], 'continuous', BASE_FRAME, f'arm_{leg}',
              geometry.base_radius * outward, sideways)
    for number, side in enumerate(SIDES):
        between, name = f'elbow_{leg}_{number}', f'rod_{leg}_{number}'
        ElementTree.SubElement(tree, 'link', name=between)
        rod = ElementTree.SubElement(tree, 'link', name=name)
        tip = -geometry.forearm_lengths[leg] * UP
        for ball in (np.zeros(3), tip):
            draw(rod, 'metal', 'sphere', {'radius': 0.036 * length}, ball, UP)
        draw_cylinder(rod, 'carbon', 0.017 * length, np.zeros(3), tip)
        for turn, parent, child, origin, axis in (
                ('swing', f'arm_{leg}', between, elbow + side * pair, sideways),
                ('tilt', between, name, np.zeros(3), outward)):
            add_joint(tree, f'{turn}_{leg}_{number}', 'continuous', parent, child, origin, axis,
                      mimic=None if number == 0 else (f'{turn}_{leg}_0', 1.0))


def _draw_platform(tree: ElementTree.Element, geometry: Geometry) -> None:
    arm = geometry.arm_length
    bar = np.array((0.0, geometry.platform_bar_length, 0.0))
    apart = np.array((PAIR_OFFSET * arm, 0.0, 0.0))
    height = 0.06 * arm * UP
    add_slides(tree, PLATFORM_SLIDES, ('platform_slide_x', 'platform_slide_y', 'half_plate_1'))
    _draw_half_plate(tree, geometry, 'half_plate_1', (2, 3), apart)
    for number, side in enumerate(SIDES):
        link = ElementTree.SubElement(tree, 'link', name=f'bar_{number}')
        for end in (np.zeros(3), bar):
            draw_cylinder(link, 'metal', 0.03 * arm, end, end + 1.6 * height)
        draw_beam(link, 'bar', (0.06 * arm, 0.04 * arm), height, bar + height)
        add_joint(tree, f'bar_rotation_{number}', 'continuous', 'half_plate_1', f'bar_{number}',
                  side * apart, mimic=(THETA_JOINT, 1.0))
    _draw_belt(tree, arm, bar)
    add_joint(tree, THETA_JOINT, 'continuous', 'half_plate_1', 'middle_line')
    _draw_half_plate(tree, geometry, 'half_plate_2', (0, 1), apart)
    add_joint(tree, 'half_plate_2_rotation', 'continuous', 'middle_line', 'half_plate_2', bar,
              mimic=(THETA_JOINT, -1.0))
    _draw_tool(tree, arm)
    add_joint(tree, TOOL_JOINT, 'continuous', 'half_plate_1', TOOL_FRAME,
              mimic=(THETA_JOINT, geometry.rotation_amplification))


def _draw_half_plate(tree: ElementTree.Element, geometry: Geometry, name: str,
                     legs: tuple[int, int], apart: np.ndarray) -> None:
    link = ElementTree.SubElement(tree, 'link', name=name)
    arm = geometry.arm_length
    section = (0.10 * arm, 0.06 * arm)
    for leg in legs:
        joint = plate_joint_of(geometry, leg)
        pair = PAIR_OFFSET * arm * sideways_of(geometry, leg)
        draw_cylinder(link, 'metal', 0.025 * arm, joint - pair, joint + pair)
        draw_beam(link, 'plate', section, np.zeros(3), joint)
    draw_beam(link, 'plate', section, -1.4 * apart, 1.4 * apart)


def _draw_belt(tree: ElementTree.Element, arm: float, bar: np.ndarray) -> None:
    """Draw, midway between the bars, the wheel at D' and the belt that turns the tool at D."""
    link = ElementTree.SubElement(tree, 'link', name='middle_line')
    low, high = 0.10 * arm * UP, 0.14 * arm * UP
    across = np.array((1.0, 0.0, 0.0))
    draw_cylinder(link, 'metal', 0.09 * arm, bar + low, bar + high)
    for side in SIDES:
        draw_beam(link, 'belt', (0.008 * arm, 0.03 * arm),
                  0.5 * (low + high) + side * 0.035 * arm * across,
                  bar + 0.5 * (low + high) + side * 0.09 * arm * across)


def _draw_tool(tree: ElementTree.Element, arm: float) -> None:
    """Draw a spindle, its pulley and, along x, a pointer of two colours that shows its angle."""
    tool = ElementTree.SubElement(tree, 'link', name=TOOL_FRAME)
    draw_cylinder(tool, 'metal', 0.035 * arm, 0.14 * arm * UP, -0.36 * arm * UP)
    draw_cylinder(tool, 'metal', 0.10 * arm, -0.30 * arm * UP, -0.34 * arm * UP)
    middle = -0.36 * arm * UP
    tail, tip = (middle + np.array((part * arm, 0.0, 0.0)) for part in (-0.40, 0.55))
    draw_beam(tool, 'tail', (0.07 * arm, 0.05 * arm), middle, tail)
    for side in SIDES:
        draw_beam(tool, 'pointer', (0.06 * arm, 0.05 * arm), tip,
                  tip + np.array((-0.18 * arm, side * 0.14 * arm, 0.0)))
    draw_beam(tool, 'pointer', (0.07 * arm, 0.05 * arm), middle, tip)
