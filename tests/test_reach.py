"""Robots whose loops cannot close, and poses out of reach: the legs are named, and the gap."""

from __future__ import annotations

import math

import numpy as np
import pytest

from par4_kinematics.errors import InputError, UnreachableError
from par4_kinematics.files import write_yaml
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.position import forearm, inverse_kinematics
from par4_kinematics.reach import leg_gaps
from par4_kinematics.robot import Robot, read_robot
from par4_kinematics.workspace import home_pose, reachable
from robots import REFERENCE, UNEVEN


def skewed() -> Robot:
    """Return a robot with two actuators moved towards +x."""
    content = REFERENCE.model_dump(by_alias=True)
    content['geometry']['actuator_azimuth'] = (0.4, 2.2, 4.0, 5.9)
    return Robot.model_validate(content)


ROBOTS = [REFERENCE, UNEVEN, skewed()]


def gap_by_search(geometry: Geometry, x: np.ndarray, leg: int) -> float:
    """Return the smallest distance of the forearm's end from the plate joint over the arm."""
    angles = np.linspace(-math.pi, math.pi, 20001)
    lengths = np.array([math.hypot(*forearm(geometry.packed, x, angle, leg)) for angle in angles])
    forearm_length = geometry.forearm_lengths[leg]
    return max(lengths.min() - forearm_length, forearm_length - lengths.max(), 0.0)


@pytest.mark.parametrize('robot', ROBOTS, ids=['reference', 'uneven', 'skewed'])
def test_the_gap_is_that_of_the_best_arm(robot):
    geometry = robot.geometry
    reach = geometry.arm_length + geometry.forearm_length
    poses = np.random.default_rng(2).uniform(-1.0, 1.0, (30, 4)) * (reach, reach, reach, 0.8)
    for x in poses:
        gaps = leg_gaps(geometry, x)
        assert (gaps == 0.0).all() == reachable(geometry, x)
        np.testing.assert_allclose(gaps, [gap_by_search(geometry, x, leg) for leg in range(LEGS)],
                                   atol=1e-7 * reach)
        if gaps.any():
            with pytest.raises(UnreachableError) as caught:
                inverse_kinematics(geometry, x)
            for leg in range(LEGS):
                assert (f'leg {leg} cannot reach it by {gaps[leg]:.3g} m' in str(caught.value)) == (
                    gaps[leg] > 0.0)


@pytest.mark.parametrize(('change', 'missing'), [
    ({'arm_length': 0.05, 'forearm_length': 0.1}, 0.065),
    ({'base_radius': 1.5}, 0.24),
    ({'platform_radius': 2.0}, 0.525),
    ({'base_radius': 1.26}, 0.0),
    ({'base_radius': 1.5, 'actuator_azimuth': [0.4, 2.2, 4.0, 5.9]}, 0.24),
])
def test_a_robot_whose_loops_cannot_close_is_refused(tmp_path, change, missing):
    content = REFERENCE.model_dump(by_alias=True, mode='json')
    content['geometry'].update(change)
    write_yaml(tmp_path / 'robot.yaml', content)
    with pytest.raises(InputError, match='legs 0, 1, 2, 3 cannot close') as caught:
        read_robot(tmp_path / 'robot.yaml')
    message = str(caught.value)
    assert '\n' not in message
    assert message.startswith(str(tmp_path / 'robot.yaml'))
    found = float(message.split(' m less')[0].rsplit(' ', 1)[1])
    assert found == pytest.approx(missing, abs=1e-9)


def test_the_one_leg_that_cannot_close_is_named():
    content = REFERENCE.geometry.model_dump() | {
        'base_radius': 1.25, 'arm_length_errors': (0.0, 0.0, -0.1, 0.0)}
    with pytest.raises(ValueError, match=r'leg 2 cannot close the loops: .* 0\.09 m less'):
        Geometry.model_validate(content)
    content |= {'arm_length': 0.08, 'base_radius': 0.1}
    with pytest.raises(ValueError, match=r'arm_length_errors .* that leave a length'):
        Geometry.model_validate(content)


@pytest.mark.parametrize('change', [
    {'base_radius': 1.25}, {'platform_radius': 1.4}, {'arm_length': 0.05},
    {'arm_length': 1.5}, {'forearm_length': 0.1}, {'platform_bar_length': 3.0},
    {'actuator_azimuth': [0.4, 2.2, 4.0, 5.9]}])
def test_a_robot_whose_loops_can_close_is_read(change):
    """Odd as it may be, with the platform centred there is a height that all legs reach."""
    geometry = Geometry.model_validate(REFERENCE.geometry.model_dump() | change)
    reach = geometry.arm_length + geometry.forearm_length
    poses = np.zeros((4001, 4))
    poses[:, 1] = -0.5 * geometry.platform_bar_length
    poses[:, 2] = np.linspace(-reach, 0.0, len(poses))
    assert reachable(geometry, poses).any()


@pytest.mark.parametrize(('robot', 'z', 'lost'), [
    (REFERENCE, (-2.0, -1.5), (0, 1, 2, 3)),
    (REFERENCE, (-0.3, -0.1), (0, 1, 2, 3)),
    (REFERENCE, (-1.18, -1.18), (2, 3)),
    (skewed(), (-1.174, -1.174), (2,)),
], ids=['too low', 'too high', 'for two', 'for one'])
def test_a_home_out_of_reach_names_the_legs(robot, z, lost):
    workspace = robot.limits.workspace.model_copy(update={'z': z})
    robot = robot.model_copy(update={'limits': robot.limits.model_copy(
        update={'workspace': workspace})})
    with pytest.raises(InputError, match='set limits.workspace') as caught:
        home_pose(robot)
    assert '\n' not in str(caught.value)
    assert [leg for leg in range(LEGS) if f'leg {leg} cannot' in str(caught.value)] == list(lost)
