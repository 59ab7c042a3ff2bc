"""The complete description: limits, shapes to collide, masses, and the tag of ros2_control."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from test_urdf import chain_masses, numbers, placed_links

from par4_dynamics.mechanism import kinetic_energy
from par4_dynamics.model_from_file import read_model
from par4_kinematics.robot import JOINT_NAMES
from par4_sim.description.robot_description import complete_description
from par4_sim.description.robot_tree import tree_joint_positions
from robots import REFERENCE, UNEVEN, random_poses

STEP = 1e-4
"""s, of the differences."""


@pytest.mark.parametrize('robot', [REFERENCE, UNEVEN], ids=lambda robot: robot.name)
def test_arms_have_the_limits_of_the_robot_file(robot):
    tree = ElementTree.fromstring(complete_description(robot))
    joints = {joint.get('name'): joint for joint in tree.findall('joint')}
    for name in JOINT_NAMES:
        limit = joints[name].find('limit')
        assert joints[name].get('type') == 'revolute'
        assert (float(limit.get('lower')), float(limit.get('upper'))) == pytest.approx(
            robot.limits.joint_position)
        assert float(limit.get('velocity')) == robot.limits.joint_speed
        assert float(limit.get('effort')) == robot.drives.torque_limit
    # urdfdom refuses a sliding or turning joint without a limit
    assert all(joint.find('limit') is not None for joint in joints.values()
               if joint.get('type') in ('revolute', 'prismatic'))


def test_every_shape_that_is_seen_collides():
    tree = ElementTree.fromstring(complete_description(REFERENCE))
    for link in tree.findall('link'):
        seen, solid = ([(part.find('origin').attrib, [(shape.tag, shape.attrib) for shape in
                                                      part.find('geometry')])
                        for part in link.findall(kind)] for kind in ('visual', 'collision'))
        assert seen == solid
    assert len(list(tree.iter('collision'))) > 50


@pytest.mark.parametrize('model', ['table1', 'table1_full'])
def test_the_masses_have_the_kinetic_energy_of_the_mechanism(model):
    """Every link moved by its joints alone, against the equations of motion."""
    bodies = read_model(model, REFERENCE).lumped_bodies()
    tree = ElementTree.fromstring(complete_description(REFERENCE, bodies))
    masses = chain_masses(complete_description(REFERENCE, bodies))
    random = np.random.default_rng(4)
    for x in random_poses(REFERENCE, 4, 4):
        xd = random.normal(size=4) * (1.0, 1.0, 1.0, 3.0)
        before, after = (placed_links(tree, tree_joint_positions(
            REFERENCE.geometry, x + side * STEP * xd)) for side in (-1.0, 1.0))
        energy = 0.0
        for name, (mass, centre, inertia) in masses.items():
            (r0, p0), (r1, p1) = before[name], after[name]
            velocity = (p1 + r1 @ centre - p0 - r0 @ centre) / (2.0 * STEP)
            turned = r0.T @ r1  # in the frame of the link
            rate = np.array((turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0],
                             turned[1, 0] - turned[0, 1])) / (4.0 * STEP)
            energy += 0.5 * mass * velocity @ velocity + 0.5 * inertia @ rate ** 2
        assert energy == pytest.approx(float(kinetic_energy(REFERENCE.geometry, bodies, x, xd)),
                                       rel=1e-3)


def test_masses_are_those_that_engines_take_and_links_between_have_none():
    text = complete_description(REFERENCE, read_model('table1_full', REFERENCE).lumped_bodies())
    for mass, _, inertia in chain_masses(text).values():
        assert mass > 0.0
        assert inertia.min() > 0.0
        assert 2.0 * inertia.max() <= inertia.sum() * (1.0 + 1e-12)
    assert not list(ElementTree.fromstring(complete_description(REFERENCE)).iter('inertial'))


def test_the_drives_are_told_to_ros2_control():
    control = ElementTree.fromstring(complete_description(REFERENCE)).find('ros2_control')
    assert control.get('type') == 'system'
    assert control.find('hardware/plugin').text
    assert [joint.get('name') for joint in control.findall('joint')] == list(JOINT_NAMES)
    for joint in control.findall('joint'):
        for kind in ('command_interface', 'state_interface'):
            assert [item.get('name') for item in joint.findall(kind)] == [
                'position', 'velocity', 'effort']
        bounds = [[float(numbers(param.text)[0]) for param in item.findall('param')]
                  for item in joint.findall('command_interface')]
        assert bounds == [list(REFERENCE.limits.joint_position),
                          [-REFERENCE.limits.joint_speed, REFERENCE.limits.joint_speed],
                          [-REFERENCE.drives.torque_limit, REFERENCE.drives.torque_limit]]
