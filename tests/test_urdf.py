"""The URDF texts: well-formed trees, poses of the drawn robot, masses of the simulated chains."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from par4_dynamics.mechanism import LumpedBodies
from par4_kinematics.errors import InputError
from par4_kinematics.files import read_yaml
from par4_kinematics.geometry import LEGS
from par4_kinematics.interface import BASE_FRAME, PLATFORM_POSE, ROBOT_DESCRIPTION, TOOL_FRAME
from par4_kinematics.robot import JOINT_NAMES
from par4_sim.description.chains import chains, engine_bodies, link_positions
from par4_sim.description.robot_tree import (
    passive_joint_positions,
    robot_description,
    tree_joint_positions,
)
from robots import REFERENCE, UNEVEN, random_poses

ROBOTS = [REFERENCE, UNEVEN]
BODIES = LumpedBodies(np.array((0.113, 0.12, 0.1, 0.11)), 0.8, 0.9, np.full(4, 1.33))


def numbers(text):
    return np.array([float(part) for part in text.split()])


def turn(axis, angle):
    """Return the rotation matrix about a unit axis."""
    x, y, z = axis
    skew = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    return np.eye(3) + math.sin(angle) * skew + (1.0 - math.cos(angle)) * skew @ skew


def placed_links(tree, positions):
    """Return link name -> (rotation, place) of a tree, by its joints alone."""
    placed = {BASE_FRAME: (np.eye(3), np.zeros(3))}
    waiting = tree.findall('joint')
    while waiting:
        joint = next(j for j in waiting if j.find('parent').get('link') in placed)
        waiting.remove(joint)
        rotation, place = placed[joint.find('parent').get('link')]
        place = place + rotation @ numbers(joint.find('origin').get('xyz'))
        axis = numbers(joint.find('axis').get('xyz'))
        position = positions[joint.get('name')]
        if joint.get('type') == 'prismatic':
            place = place + rotation @ axis * position
        else:
            rotation = rotation @ turn(axis, position)
        placed[joint.find('child').get('link')] = (rotation, place)
    return placed


@pytest.mark.parametrize('robot', ROBOTS, ids=lambda robot: robot.name)
def test_the_description_is_a_tree_of_the_contract(robot):
    tree = ElementTree.fromstring(robot_description(robot))
    links = [link.get('name') for link in tree.findall('link')]
    joints = {joint.get('name'): joint for joint in tree.findall('joint')}
    children = [joint.find('child').get('link') for joint in joints.values()]
    parents = {joint.find('parent').get('link') for joint in joints.values()}
    assert tree.get('name') == robot.name
    assert len(set(links)) == len(links)
    assert len(joints) == len(links) - 1
    assert sorted(children) == sorted(set(links) - {BASE_FRAME})
    assert parents <= set(links)
    assert {*JOINT_NAMES} <= set(joints)
    assert TOOL_FRAME in links
    assert {joint.get('type') for joint in joints.values()} == {'continuous', 'prismatic'}
    materials = {material.get('name') for material in tree.findall('material')}
    assert {m.get('name') for m in tree.iter('material')} == materials


@pytest.mark.parametrize('robot', ROBOTS, ids=lambda robot: robot.name)
def test_the_drawn_robot_is_closed_at_every_pose(robot):
    """Rods end at the plate joints of the model, the tool is at D and turns amplified."""
    geometry = robot.geometry
    tree = ElementTree.fromstring(robot_description(robot))
    bar = geometry.platform_bar_length
    for x in random_poses(robot, 12, seed=3):
        placed = placed_links(tree, tree_joint_positions(geometry, x))
        d = x[:3]
        d_2 = d + bar * np.array((-math.sin(x[3]), math.cos(x[3]), 0.0))
        for name, place in (('half_plate_1', d), ('half_plate_2', d_2)):
            np.testing.assert_allclose(placed[name][1], place, atol=1e-14)
            np.testing.assert_allclose(placed[name][0], np.eye(3), atol=1e-14)
        np.testing.assert_allclose(placed[TOOL_FRAME][1], d, atol=1e-14)
        np.testing.assert_allclose(
            placed[TOOL_FRAME][0],
            turn((0.0, 0.0, 1.0), geometry.rotation_amplification * x[3]), atol=1e-13)
        for leg, azimuth in enumerate(geometry.actuator_azimuth):
            outward = np.array((math.cos(azimuth), math.sin(azimuth), 0.0))
            half = np.array((0.0, 0.5 * bar, 0.0))
            joint = (d + half if leg >= 2 else d_2 - half) + geometry.platform_radius * outward
            ends = []
            for number in range(2):
                rotation, place = placed[f'rod_{leg}_{number}']
                ends.append(place - geometry.forearm_lengths[leg] * rotation[:, 2])
            np.testing.assert_allclose(np.mean(ends, axis=0), joint, atol=1e-14)
            # the two rods are a parallelogram whose short sides lie along the actuator's axis
            apart = ends[1] - ends[0]
            np.testing.assert_allclose(apart @ outward, 0.0, atol=1e-14)
            np.testing.assert_allclose(apart[2], 0.0, atol=1e-14)
            assert np.linalg.norm(apart) > 0.01
        for number in range(2):
            rotation, place = placed[f'bar_{number}']
            end = place + bar * rotation[:, 1]
            np.testing.assert_allclose(end - d_2, place - d, atol=1e-14)


def test_mimics_say_what_the_positions_say():
    tree = ElementTree.fromstring(robot_description(REFERENCE))
    positions = tree_joint_positions(REFERENCE.geometry, (0.1, -0.05, -0.8, 0.4))
    assert {joint.get('name') for joint in tree.findall('joint')} == set(positions)
    followers = 0
    for joint in tree.findall('joint'):
        mimic = joint.find('mimic')
        if mimic is not None:
            followers += 1
            assert positions[joint.get('name')] == pytest.approx(
                float(mimic.get('multiplier')) * positions[mimic.get('joint')])
    assert followers == 2 * LEGS + 4


def chain_masses(urdf):
    """Return link name -> (mass, centre, diagonal inertia)."""
    result = {}
    for link in ElementTree.fromstring(urdf).findall('link'):
        inertial = link.find('inertial')
        if inertial is None:
            continue
        inertia = inertial.find('inertia')
        result[link.get('name')] = (
            float(inertial.find('mass').get('value')),
            numbers(inertial.find('origin').get('xyz')),
            np.array([float(inertia.get(axis)) for axis in ('ixx', 'iyy', 'izz')]))
    return result


@pytest.mark.parametrize('fidelity', ['accurate', 'fast'])
@pytest.mark.parametrize(('rod_mass', 'bar_mass'), [(0.0, 0.0), (0.04, 0.03), (0.3, 0.1)])
def test_the_chains_have_the_lumped_masses(fidelity, rod_mass, bar_mass):
    """Base parameters from the URDF: rods and bars count half at each end."""
    geometry = REFERENCE.geometry
    bodies = replace(BODIES, rod_mass=rod_mass, bar_mass=bar_mass, theta_inertia=0.002)
    mechanism = chains(geometry, bodies, fidelity)
    urdf = mechanism.fixed | mechanism.floating
    rods_at_plate = np.zeros(2)
    for leg in range(LEGS):
        masses = chain_masses(urdf[f'leg_{leg}'])
        rods = [part for name, part in masses.items() if name.startswith('rod')]
        both = sum(mass for mass, _, _ in rods)
        rods_at_plate[0 if leg >= 2 else 1] += 0.5 * both
        arm_mass, centre, inertia = masses['arm']
        reach = math.hypot(*centre[:2]) * np.sign(
            centre[0] * math.cos(geometry.actuator_azimuth[leg]))
        at_axis = inertia[2] + arm_mass * reach ** 2
        assert at_axis + 0.5 * both * geometry.arm_length ** 2 == pytest.approx(
            bodies.actuator_inertia[leg], rel=1e-12)
        assert 9.81 * (arm_mass * reach + 0.5 * both * geometry.arm_length) == pytest.approx(
            bodies.arm_gravity[leg], rel=1e-12)
        # end masses minus m l^2 / 6 of the distributed part
        across = sum(inertia[0] for _, _, inertia in rods)
        assert across == pytest.approx(geometry.forearm_length ** 2 * (
            0.25 * both - 2.0 * rod_mass / 6.0), rel=1e-12)
    plate_1, plate_2 = (chain_masses(urdf[name]) for name in ('half_plate_1', 'half_plate_2'))
    bars = [part for name, part in plate_1.items() if name.startswith('bar')]
    both = sum(mass for mass, _, _ in bars)
    assert plate_1['plate'][0] + rods_at_plate[0] + 0.5 * both == pytest.approx(
        bodies.platform_mass_1, rel=1e-12)
    assert plate_2['plate'][0] + rods_at_plate[1] + 0.5 * both == pytest.approx(
        bodies.platform_mass_2, rel=1e-12)
    assert sum(inertia[2] for _, _, inertia in bars) == pytest.approx(
        geometry.platform_bar_length ** 2 * (0.25 * both - 2.0 * bar_mass / 6.0) + 0.002,
        rel=1e-12)


@pytest.mark.parametrize('fidelity', ['accurate', 'fast'])
def test_no_link_has_an_inertia_that_engines_refuse(fidelity):
    """Positive and none above the sum of the others, even with a heavy tool inertia."""
    mechanism = chains(REFERENCE.geometry, replace(BODIES, theta_inertia=0.05), fidelity)
    for urdf in (mechanism.fixed | mechanism.floating).values():
        for name, (mass, _, inertia) in chain_masses(urdf).items():
            if name == BASE_FRAME or name.startswith('slide'):
                continue
            assert mass > 0
            assert inertia.min() > 0
            assert 2.0 * inertia.max() <= inertia.sum() * (1.0 + 1e-12)


def test_the_single_bodies_keep_room_for_distributed_rods():
    heavy = replace(BODIES, rod_mass=0.3)
    assert engine_bodies(REFERENCE.geometry, heavy).rod_mass == 0.3
    light = replace(BODIES, rod_mass=0.001)
    assert engine_bodies(REFERENCE.geometry, light).rod_mass > 0.05


@pytest.mark.parametrize('change', [
    {'rod_mass': 0.5}, {'platform_mass_2': 0.0}, {'actuator_inertia': np.zeros(4)},
    {'bar_mass': 0.9}])
def test_masses_that_leave_nothing_are_refused(change):
    with pytest.raises(InputError, match='kg') as caught:
        chains(REFERENCE.geometry, replace(BODIES, **change), 'fast')
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('fidelity', ['accurate', 'fast'])
def test_every_placed_link_exists(fidelity):
    mechanism = chains(REFERENCE.geometry, BODIES, fidelity)
    links = {(chain, link) for chain, urdf in (mechanism.fixed | mechanism.floating).items()
             for link in chain_masses(urdf) if link != BASE_FRAME}
    assert set(link_positions(REFERENCE.geometry, fidelity, (0.0, 0.0, -0.78, 0.0))) == links
    for closure in mechanism.closures:
        assert {(point.chain, point.link) for point in (closure.first, closure.second)} <= links


@pytest.mark.parametrize('robot', ROBOTS, ids=lambda robot: robot.name)
def test_the_arms_come_first_and_the_rest_follows_pose_and_rods(robot):
    """Rods of any length and a pose give the passive joints; each rod for itself."""
    for x in random_poses(robot, 5, seed=8):
        positions = tree_joint_positions(robot.geometry, x)
        assert tuple(positions)[:LEGS] == JOINT_NAMES
        q = np.array([positions[name] for name in JOINT_NAMES])
        rods = np.array([[placed_rod(robot, positions, leg, number) for number in range(2)]
                         for leg in range(LEGS)])
        found = passive_joint_positions(robot.geometry, x, q, 3.0 * rods)
        assert [*JOINT_NAMES, *found] == list(positions)
        np.testing.assert_allclose(list(found.values()), list(positions.values())[LEGS:],
                                   atol=1e-14)


def placed_rod(robot, positions, leg, number):
    """Return the direction of a drawn rod from elbow to plate."""
    placed = placed_links(ElementTree.fromstring(robot_description(robot)), positions)
    return -placed[f'rod_{leg}_{number}'][0][:, 2]


def test_the_view_of_rviz_is_of_this_robot():
    """Its frame and topics are those of the contract, and it is installed."""
    package = Path(__file__).parents[1] / 'src' / 'par4_sim'
    view = read_yaml(package / 'rviz' / 'par4.rviz')['Visualization Manager']
    assert view['Global Options']['Fixed Frame'] == BASE_FRAME
    shown = {display['Class'].split('/')[1]: display for display in view['Displays']}
    assert set(shown) == {'Grid', 'RobotModel', 'TF', 'Pose'}
    description = shown['RobotModel']['Description Topic']
    assert description['Value'] == ROBOT_DESCRIPTION.name
    assert description['Durability Policy'] == 'Transient Local'
    assert shown['Pose']['Topic']['Value'] == PLATFORM_POSE.name
    assert "['rviz/par4.rviz']" in (package / 'setup.py').read_text(encoding='utf-8')
