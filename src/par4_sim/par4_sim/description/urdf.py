"""URDF text: links, joints, inertia and shapes as elements of a document."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.interface import BASE_FRAME

UP = np.array((0.0, 0.0, 1.0))


def numbers(values: ArrayLike) -> str:
    """Return numbers as an attribute has them."""
    return ' '.join(repr(float(value)) for value in np.ravel(values))


def document(name: str) -> ElementTree.Element:
    """Return a document without links."""
    return ElementTree.Element('robot', name=name)


def text_of(robot: ElementTree.Element) -> str:
    """Return the text of a document, indented."""
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding='unicode') + '\n'


def add_link(robot: ElementTree.Element, name: str) -> ElementTree.Element:
    """Add a link and return it."""
    return ElementTree.SubElement(robot, 'link', name=name)


def add_inertial(link: ElementTree.Element, mass: float = 0.0,
                 centre: ArrayLike = (0.0, 0.0, 0.0), inertia: ArrayLike = 0.0) -> None:
    """Give a link a mass, kg, a centre (3,), m, and central inertia about x, y, z, kg m2."""
    inertial = ElementTree.SubElement(link, 'inertial')
    ElementTree.SubElement(inertial, 'origin', xyz=numbers(centre))
    ElementTree.SubElement(inertial, 'mass', value=numbers(mass))
    xx, yy, zz = (numbers(value) for value in np.broadcast_to(inertia, 3))
    ElementTree.SubElement(inertial, 'inertia', ixx=xx, iyy=yy, izz=zz, ixy='0', ixz='0', iyz='0')


def add_joint(robot: ElementTree.Element, name: str, kind: str, parent: str, child: str,
              origin: ArrayLike = (0.0, 0.0, 0.0), axis: ArrayLike = UP,
              mimic: tuple[str, float] | None = None) -> None:
    """Add a joint between two links; `mimic` is the joint that it follows and the ratio."""
    joint = ElementTree.SubElement(robot, 'joint', name=name, type=kind)
    ElementTree.SubElement(joint, 'parent', link=parent)
    ElementTree.SubElement(joint, 'child', link=child)
    ElementTree.SubElement(joint, 'origin', xyz=numbers(origin))
    ElementTree.SubElement(joint, 'axis', xyz=numbers(axis))
    if kind == 'prismatic':
        ElementTree.SubElement(joint, 'limit', lower='-100', upper='100', effort='1e6',
                               velocity='1e6')
    if mimic is not None:
        leader, ratio = mimic
        ElementTree.SubElement(joint, 'mimic', joint=leader, multiplier=numbers(ratio))


def add_slides(robot: ElementTree.Element, joints: tuple[str, ...], links: tuple[str, ...]
               ) -> None:
    """Add joints that slide the last of three links along x, y, z from `base`, and the others."""
    for name in links[:-1]:
        add_inertial(add_link(robot, name))
    for joint, parent, child, axis in zip(joints, (BASE_FRAME, *links[:-1]), links, np.eye(3),
                                          strict=True):
        add_joint(robot, joint, 'prismatic', parent, child, axis=axis)


def draw(link: ElementTree.Element, colour: str, shape: str, size: dict[str, ArrayLike],
         centre: np.ndarray, along: np.ndarray) -> None:
    """Add a shape whose own axis (x of a box, z of a cylinder) lies along a direction."""
    visual = ElementTree.SubElement(link, 'visual')
    x, y, z = along
    yaw, elevation = math.atan2(y, x), math.atan2(z, math.hypot(x, y))
    pitch = -elevation if shape == 'box' else 0.5 * math.pi - elevation
    ElementTree.SubElement(visual, 'origin', xyz=numbers(centre), rpy=numbers((0.0, pitch, yaw)))
    geometry = ElementTree.SubElement(visual, 'geometry')
    ElementTree.SubElement(geometry, shape, {name: numbers(part) for name, part in size.items()})
    ElementTree.SubElement(visual, 'material', name=colour)


def draw_cylinder(link: ElementTree.Element, colour: str, radius: float, start: np.ndarray,
                  end: np.ndarray) -> None:
    """Add a cylinder from start to end."""
    length = float(np.linalg.norm(end - start))
    draw(link, colour, 'cylinder', {'radius': radius, 'length': length}, 0.5 * (start + end),
         end - start)


def draw_beam(link: ElementTree.Element, colour: str, section: tuple[float, float],
              start: np.ndarray, end: np.ndarray) -> None:
    """Add a box from start to end; section is its width and height, m."""
    length = float(np.linalg.norm(end - start))
    draw(link, colour, 'box', {'size': (length, *section)}, 0.5 * (start + end), end - start)
