"""The robot as `robot_description` tells it to planners and viewers: shapes, limits, masses.

`robot_tree.py` draws the robot as a tree. Here it gets what planners and controllers ask of a
description: limits of the arms from `robot.yaml`, shapes to collide, masses and inertias where the
bodies are known, and a `ros2_control` tag with the interfaces of the four drives.
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ElementTree

from par4_dynamics.mechanism import LumpedBodies, physical_bodies
from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import JOINT_NAMES, Robot
from par4_sim.description.chains import (
    arm_inertial,
    bar_inertial,
    plate_inertial,
    rod_inertial,
)
from par4_sim.description.leg_axes import SIDES
from par4_sim.description.robot_tree import PLATFORM_SLIDES, robot_description
from par4_sim.description.urdf import add_inertial

HARDWARE = 'mock_components/GenericSystem'
"""Plugin of the `ros2_control` tag: every installation has it; a driver puts its own there."""
INTERFACES = ('position', 'velocity', 'effort')


def complete_description(robot: Robot, bodies: LumpedBodies | None = None) -> str:
    """Return the URDF of the robot with limits, shapes to collide and a `ros2_control` tag.

    The loops are cut, as in `robot_tree.robot_description`. Arms turn within `joint_position`, with
    `joint_speed` and the torque limit of the drives; the platform slides within the workspace.

    Args:
        robot: geometry, limits, and the masses of one rod and one bar.
        bodies: lumped masses, kg, kg m2; without them the links have no mass.

    Raises:
        InputError: the bodies leave a negative mass beside rods and bars.
    """
    tree = ElementTree.fromstring(robot_description(robot))
    for link in tree.iter('link'):
        for empty in link.findall('inertial'):  # of links between that weigh nothing
            link.remove(empty)
        for visual in link.findall('visual'):
            collision = ElementTree.SubElement(link, 'collision')
            collision.extend(copy.deepcopy(part) for part in visual if part.tag != 'material')
    _limit(tree, robot)
    if bodies is not None:
        _weigh(tree, robot, bodies)
    _control(tree, robot)
    ElementTree.indent(tree)
    return ElementTree.tostring(tree, encoding='unicode') + '\n'


def _limit(tree: ElementTree.Element, robot: Robot) -> None:
    limits = robot.limits
    space = limits.workspace
    ranges = {PLATFORM_SLIDES[0]: (-space.radius, space.radius),
              PLATFORM_SLIDES[1]: (-space.radius, space.radius), PLATFORM_SLIDES[2]: space.z}
    for joint in tree.iter('joint'):
        name = str(joint.get('name'))
        if name in JOINT_NAMES:
            joint.set('type', 'revolute')
            lowest, highest = limits.joint_position
            ElementTree.SubElement(
                joint, 'limit', lower=repr(lowest), upper=repr(highest),
                effort=repr(robot.drives.torque_limit), velocity=repr(limits.joint_speed))
        limit = joint.find('limit')
        if name in ranges and limit is not None:  # no drive acts on it: the arms limit its speed
            limit.set('lower', repr(ranges[name][0]))
            limit.set('upper', repr(ranges[name][1]))


def _weigh(tree: ElementTree.Element, robot: Robot, bodies: LumpedBodies) -> None:
    geometry = robot.geometry
    single = physical_bodies(geometry, bodies, robot.bodies.rod_mass, robot.bodies.bar_mass)
    found = {f'arm_{leg}': arm_inertial(geometry, single, leg) for leg in range(LEGS)}
    found |= {f'rod_{leg}_{number}': rod_inertial(geometry, bodies, single, leg)
              for leg in range(LEGS) for number in range(len(SIDES))}
    found |= {f'bar_{number}': bar_inertial(geometry, bodies, single)
              for number in range(len(SIDES))}
    found |= {'half_plate_1': plate_inertial(geometry, float(single.half_plate_1)),
              'half_plate_2': plate_inertial(geometry, float(single.half_plate_2))}
    for link in tree.iter('link'):
        inertial = found.get(str(link.get('name')))
        if inertial is not None and inertial[0] > 0.0:
            add_inertial(link, *inertial)


def _control(tree: ElementTree.Element, robot: Robot) -> None:
    limits = robot.limits
    bounds = {'position': limits.joint_position,
              'velocity': (-limits.joint_speed, limits.joint_speed),
              'effort': (-robot.drives.torque_limit, robot.drives.torque_limit)}
    control = ElementTree.SubElement(tree, 'ros2_control', name=robot.name, type='system')
    hardware = ElementTree.SubElement(control, 'hardware')
    ElementTree.SubElement(hardware, 'plugin').text = HARDWARE
    for name in JOINT_NAMES:
        joint = ElementTree.SubElement(control, 'joint', name=name)
        for interface in INTERFACES:
            command = ElementTree.SubElement(joint, 'command_interface', name=interface)
            for word, bound in zip(('min', 'max'), bounds[interface], strict=True):
                ElementTree.SubElement(command, 'param', name=word).text = repr(bound)
        for interface in INTERFACES:
            ElementTree.SubElement(joint, 'state_interface', name=interface)
