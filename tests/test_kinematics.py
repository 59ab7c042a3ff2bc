"""Laws of position, velocity and acceleration on two robots of clearly different shape."""

from __future__ import annotations

import math
import pickle
import re

import numpy as np
import pytest

from par4_kinematics.acceleration import joint_motion, platform_motion
from par4_kinematics.errors import InputError, UnreachableError
from par4_kinematics.files import write_yaml
from par4_kinematics.geometry import HOME, Geometry
from par4_kinematics.linear_solve import inverse_columns
from par4_kinematics.position import (
    _forward_rows,
    forward_kinematics,
    inverse_kinematics,
    loop_opening,
)
from par4_kinematics.robot import Robot, read_robot
from par4_kinematics.velocity import (
    AT_D,
    AT_D2,
    condition_number,
    jacobian,
    jacobian_parts,
    jacobian_rate,
    joint_velocity,
)
from par4_kinematics.workspace import conditioning, home_pose, inside, reachable

REFERENCE = read_robot('reference')
OTHER = Robot.model_validate({
    'schema': 'par4/robot/1', 'name': 'other',
    'geometry': {'arm_length': 0.22, 'forearm_length': 0.61, 'base_radius': 0.16,
                 'platform_radius': 0.045, 'platform_bar_length': 0.06,
                 'actuator_azimuth': [0.9, 2.2, 3.8, 5.6],
                 'arm_length_errors': [0.01, -0.005, 0.0, 0.004],
                 'forearm_length_errors': [0.0, 0.012, -0.006, 0.003]},
    'drives': {'gain': [8.0, 8.0, 8.0, 8.0]},
    'limits': {'workspace': {'radius': 0.25, 'z': [-0.62, -0.48], 'theta': 0.6}}})
ROBOTS = pytest.mark.parametrize('robot', [REFERENCE, OTHER], ids=lambda robot: robot.name)
POINTS = pytest.mark.parametrize('point', [AT_D, AT_D2], ids=('at_D', 'at_D2'))


def poses_in(robot: Robot, count: int, seed: int) -> np.ndarray:
    """Return random poses (count, 4) within the robot's workspace limits."""
    generator = np.random.default_rng(seed)
    space = robot.limits.workspace
    radius = space.radius * np.sqrt(generator.uniform(0.0, 0.98, count))
    azimuth = generator.uniform(-np.pi, np.pi, count)
    return np.column_stack((radius * np.cos(azimuth), radius * np.sin(azimuth),
                            generator.uniform(*space.z, count),
                            generator.uniform(-space.theta, space.theta, count)))


def test_errors_are_added_to_those_of_the_file_and_packed_anew():
    geometry = OTHER.geometry
    assert geometry.packed[0] == 0.22  # kept, and not to be kept by the other one
    changed = geometry.with_errors(
        arm_length=0.03, forearm_length_errors=np.array((0.001, 0.0, 0.0, -0.002)))
    expected = Geometry.model_validate(geometry.model_dump() | {
        'arm_length': geometry.arm_length + 0.03,
        'forearm_length_errors': (0.001, 0.012, -0.006, 0.003 - 0.002)})
    assert changed == expected
    np.testing.assert_array_equal(changed.packed, expected.packed)
    hash(changed)  # as the file's does


def circle_poses(radius: float, z: float, theta: float) -> np.ndarray:
    azimuth = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    return np.column_stack((radius * np.cos(azimuth), radius * np.sin(azimuth),
                            np.full(48, z), np.full(48, theta)))


def joint_to_plate(geometry: Geometry, x: np.ndarray, leg: int) -> np.ndarray:
    """Return B_i - P_i in `base`, written out from the description of the mechanism."""
    bar = geometry.platform_bar_length * np.array((-math.sin(x[3]), math.cos(x[3]), 0.0))
    azimuth = geometry.actuator_azimuth[leg]
    radial = np.array((math.cos(azimuth), math.sin(azimuth), 0.0))
    half_bar = 0.5 * geometry.platform_bar_length * np.array((0.0, 1.0, 0.0))
    on_plate = (x[:3] + bar - half_bar) if leg < 2 else (x[:3] + half_bar)
    return on_plate + (geometry.platform_radius - geometry.base_radius) * radial


ANGLES = np.linspace(-np.pi, np.pi, 20001)
ARMS = np.stack((np.cos(ANGLES), -np.sin(ANGLES)))
"""Ways out and up of an arm of unit length at these angles."""


def reachable_by_search(geometry: Geometry, x: np.ndarray, leg: int) -> bool:
    """Return whether some angle of the arm leaves exactly a forearm to the plate joint."""
    azimuth = geometry.actuator_azimuth[leg]
    # out along the azimuth, across it and up; the arm turns in the first and the last of them
    x, y, up = joint_to_plate(geometry, x, leg)
    out, across = (x * math.cos(azimuth) + y * math.sin(azimuth),
                   y * math.cos(azimuth) - x * math.sin(azimuth))
    arm = geometry.arm_lengths[leg] * ARMS
    distance = np.sqrt((out - arm[0]) ** 2 + across ** 2 + (up - arm[1]) ** 2)
    return bool(distance.min() <= geometry.forearm_lengths[leg] <= distance.max())


def central_difference(function, value: np.ndarray, step: float) -> np.ndarray:
    """Return d function / d value, the derivative by component k in the last axis."""
    columns = []
    for axis in range(value.shape[-1]):
        shift = np.zeros(value.shape[-1])
        shift[axis] = step
        columns.append((function(value + shift) - function(value - shift)) / (2.0 * step))
    return np.stack(columns, axis=-1)


def path(robot: Robot, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return an analytic platform motion x, xd, xdd (n, 4) inside the workspace."""
    space = robot.limits.workspace
    middle = np.array((0.0, 0.0, np.mean(space.z), 0.0))
    size = np.array((0.6 * space.radius, 0.5 * space.radius, 0.4 * np.ptp(space.z),
                     0.9 * space.theta))
    rate = np.array((5.0, 7.0, 9.0, 11.0))
    phase = rate * t[:, None] + np.array((0.1, 0.9, 2.0, 3.0))
    return (middle + size * np.sin(phase), size * rate * np.cos(phase),
            -size * rate ** 2 * np.sin(phase))


@ROBOTS
def test_forward_kinematics_inverts_inverse_kinematics(robot):
    x = poses_in(robot, 500, 1)
    q = inverse_kinematics(robot.geometry, x)
    assert np.abs(forward_kinematics(robot.geometry, q) - x).max() < 1e-9
    assert np.abs(loop_opening(robot.geometry, q, x)).max() < 1e-12


@ROBOTS
def test_inverse_kinematics_closes_the_loops_with_elbows_outward(robot):
    geometry = robot.geometry
    for x in poses_in(robot, 50, 2):
        q = inverse_kinematics(geometry, x)
        for leg, azimuth in enumerate(geometry.actuator_azimuth):
            radial = np.array((math.cos(azimuth), math.sin(azimuth), 0.0))
            up = np.array((0.0, 0.0, 1.0))
            arm = geometry.arm_lengths[leg] * (math.cos(q[leg]) * radial - math.sin(q[leg]) * up)
            plate = joint_to_plate(geometry, x, leg)
            assert np.linalg.norm(plate - arm) == pytest.approx(
                geometry.forearm_lengths[leg], abs=1e-12)
            # Outward: the elbow lies on the far side of the line from actuator to plate joint.
            assert np.cross(plate, arm) @ np.cross(radial, up) > 0.0


@ROBOTS
def test_forward_kinematics_keeps_the_assembly_mode(robot):
    q = inverse_kinematics(robot.geometry, poses_in(robot, 100, 3))
    above = home_pose(robot) * (1.0, 1.0, -1.0, 1.0)
    for row in q:
        x = forward_kinematics(robot.geometry, row, start=above)
        assert x[2] < 0.0
        assert abs(x[3]) < math.pi / 2
        assert np.abs(inverse_kinematics(robot.geometry, x) - row).max() < 1e-6


@ROBOTS
def test_rows_of_a_batch_do_not_depend_on_their_neighbours(robot):
    q = inverse_kinematics(robot.geometry, poses_in(robot, 300, 4))
    together = forward_kinematics(robot.geometry, q)
    alone = np.array([forward_kinematics(robot.geometry, row) for row in q])
    assert np.abs(together - alone).max() < 1e-9


@ROBOTS
def test_forward_kinematics_refuses_joints_that_cannot_close(robot):
    with pytest.raises(UnreachableError, match=r'joint positions 1 .*does not close'):
        forward_kinematics(robot.geometry, [[0.3] * 4, [-1.5, 1.5, -1.5, 1.5]])


@ROBOTS
def test_unreachable_pose_names_the_leg(robot):
    geometry = robot.geometry
    reach = geometry.arm_length + geometry.forearm_length
    named = set()
    for x in np.random.default_rng(10).uniform(-0.9, 0.9, (300, 4)) * (reach, reach, reach, 0.8):
        lost = [leg for leg in range(4) if not reachable_by_search(geometry, x, leg)]
        if len(lost) != 1:
            continue
        with pytest.raises(UnreachableError, match=rf'pose 1 .*: leg {lost[0]} cannot') as caught:
            inverse_kinematics(geometry, [home_pose(robot), x])
        assert '\n' not in str(caught.value)
        named.update(lost)
    assert named == {0, 1, 2, 3}


@ROBOTS
def test_a_pose_is_solved_or_refused_but_never_nan(robot):
    geometry = robot.geometry
    reach = geometry.arm_length + geometry.forearm_length
    x = np.random.default_rng(5).uniform(-1.2, 1.2, (200, 4)) * (reach, reach, reach, math.pi)
    found = reachable(geometry, x)
    assert 0 < found.sum() < len(found)
    for pose, reached in zip(x, found, strict=True):
        assert reached == all(reachable_by_search(geometry, pose, leg) for leg in range(4))
        if reached:
            assert np.isfinite(inverse_kinematics(geometry, pose)).all()
        else:
            with pytest.raises(UnreachableError):
                inverse_kinematics(geometry, pose)


@ROBOTS
@POINTS
def test_jacobians_are_the_derivatives_of_inverse_kinematics(robot, point):
    geometry = robot.geometry
    x = poses_in(robot, 60, 6)

    def of_point(pose: np.ndarray) -> np.ndarray:
        theta = pose[..., 3]
        bar = point * geometry.platform_bar_length * np.stack(
            (-np.sin(theta), np.cos(theta), 0.0 * theta, 0.0 * theta), axis=-1)
        return pose + bar

    def joints(pose_of_point: np.ndarray) -> np.ndarray:
        return inverse_kinematics(geometry, 2.0 * pose_of_point - of_point(pose_of_point))

    expected = central_difference(joints, of_point(x), 1e-6)
    j_x, j_q = jacobian_parts(geometry, x, point)
    scale = np.abs(expected).max()
    assert np.abs(j_x / j_q[..., None] - expected).max() < 1e-7 * scale
    identity = jacobian(geometry, x, point) @ expected
    assert np.abs(identity - np.eye(4)).max() < 1e-6


@ROBOTS
def test_closed_form_inverse_is_that_of_general_elimination(robot):
    x = poses_in(robot, 300, 11)
    x[:, 3] *= math.radians(75.0) / robot.limits.workspace.theta
    j_x, _ = jacobian_parts(robot.geometry, x[reachable(robot.geometry, x)])
    assert len(j_x) > 200
    for matrix in j_x:
        found = np.array(inverse_columns(*(tuple(row) for row in matrix[:, :3]), *matrix[:2, 3])).T
        expected = np.linalg.inv(matrix)
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize('rows', [
    ((1.0, 2.0, 3.0), (3.0, 2.0, 1.0), (1.0, 0.0, 1.0), (2.0, 0.0, 2.0), 0.1, 0.2),
    ((1.0, 2.0, 3.0), (3.0, 2.0, 1.0), (1.0, 0.0, 1.0), (0.0, 1.0, 2.0), 0.0, 0.0),
    ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), (1.0, 0.0, 1.0), (0.0, 1.0, 2.0), 0.1, 0.1),
], ids=['parallel forearms', 'no lever', 'legs 0 and 1 alike'])
def test_singular_jacobian_has_no_finite_inverse(rows):
    assert not np.isfinite(inverse_columns(*rows)).all()


@ROBOTS
def test_a_sample_does_not_depend_on_how_many_there_are(robot):
    """Samples are computed several at a time, the last ones one by one."""
    motion = path(robot, np.linspace(0.0, 1.0, 21))
    joints = joint_motion(robot.geometry, *motion)
    forth = (joints.q, joints.qd, joints.qdd)
    platform = platform_motion(robot.geometry, *forth)
    for count in range(1, 21):
        some = joint_motion(robot.geometry, *(part[:count] for part in motion))
        back = platform_motion(robot.geometry, *(part[:count] for part in forth))
        for found, whole in ((some.q, joints.q), (some.qd, joints.qd), (some.qdd, joints.qdd),
                             (back.x, platform.x), (back.xd, platform.xd),
                             (back.xdd, platform.xdd)):
            np.testing.assert_allclose(found, whole[:count], rtol=1e-12, atol=1e-12)


@ROBOTS
@pytest.mark.parametrize('layout', [np.asfortranarray, lambda part: np.repeat(part, 2, axis=0)[::2],
                                    lambda part: np.hstack((part, part))[:, 4:]],
                         ids=['by columns', 'every other row', 'part of wider rows'])
def test_layout_in_memory_does_not_matter(robot, layout):
    motion = path(robot, np.linspace(0.0, 1.0, 50))
    joints = joint_motion(robot.geometry, *motion)
    again = joint_motion(robot.geometry, *(layout(part) for part in motion))
    assert np.array_equal(again.q, joints.q)
    assert np.array_equal(again.qdd, joints.qdd)
    forth = (joints.q, joints.qd, joints.qdd)
    assert np.array_equal(platform_motion(robot.geometry, *(layout(part) for part in forth)).xdd,
                          platform_motion(robot.geometry, *forth).xdd)


@ROBOTS
@POINTS
def test_jacobian_rate_is_the_derivative_of_the_jacobian(robot, point):
    t = np.linspace(0.0, 2.0, 50)
    step = 1e-5
    before, after = (jacobian(robot.geometry, path(robot, t + shift)[0], point)
                     for shift in (-step, step))
    expected = (after - before) / (2.0 * step)
    rate = jacobian_rate(robot.geometry, *path(robot, t)[:2], point)
    assert np.abs(rate - expected).max() < 1e-6 * np.abs(expected).max()


@ROBOTS
def test_both_jacobians_turn_theta_alike_and_differ_by_the_bar(robot):
    x = poses_in(robot, 40, 7)
    at_d, at_d2 = (jacobian(robot.geometry, x, point) for point in (AT_D, AT_D2))
    bar = robot.geometry.platform_bar_length
    assert np.abs(at_d[:, 3] - at_d2[:, 3]).max() < 1e-9 * np.abs(at_d[:, 3]).max()
    expected = at_d.copy()
    expected[:, 0] -= bar * np.cos(x[:, 3])[:, None] * at_d[:, 3]
    expected[:, 1] -= bar * np.sin(x[:, 3])[:, None] * at_d[:, 3]
    assert np.abs(at_d2 - expected).max() < 1e-9 * np.abs(at_d).max()


@ROBOTS
def test_joint_motion_is_the_derivative_of_the_joint_positions(robot):
    t = np.linspace(0.0, 2.0, 200)
    step = 1e-4
    motion = joint_motion(robot.geometry, *path(robot, t))
    before, after = (joint_motion(robot.geometry, *path(robot, t + shift))
                     for shift in (-step, step))
    assert np.abs((after.q - before.q) / (2.0 * step) - motion.qd).max() < 1e-5
    assert np.abs((after.qd - before.qd) / (2.0 * step) - motion.qdd).max() < 1e-3
    assert np.abs(motion.qdd).max() > 20.0
    assert np.abs(joint_velocity(robot.geometry, *path(robot, t)[:2]) - motion.qd).max() < 1e-12


@ROBOTS
def test_platform_motion_inverts_joint_motion(robot):
    x, xd, xdd = path(robot, np.linspace(0.0, 2.0, 200))
    joints = joint_motion(robot.geometry, x, xd, xdd)
    back = platform_motion(robot.geometry, joints.q, joints.qd, joints.qdd)
    for found, given in ((back.x, x), (back.xd, xd), (back.xdd, xdd)):
        assert np.abs(found - given).max() < 1e-9 * max(1.0, np.abs(given).max())


@pytest.mark.parametrize('shape', [(), (1,), (5,), (2, 3)])
def test_leading_axes_are_kept(shape):
    geometry = REFERENCE.geometry
    flat = poses_in(REFERENCE, max(1, math.prod(shape)), 8)
    x = flat.reshape((*shape, 4))
    speed = np.ones_like(x)
    q = inverse_kinematics(geometry, x)
    joints = joint_motion(geometry, x, speed, speed)
    for found, width in (
            (q, (4,)), (forward_kinematics(geometry, q), (4,)), (reachable(geometry, x), ()),
            (inside(REFERENCE, x), ()), (condition_number(geometry, x), ()),
            (jacobian(geometry, x), (4, 4)), (jacobian_rate(geometry, x, speed), (4, 4)),
            (joints.qdd, (4,)), (joint_velocity(geometry, x, speed), (4,)),
            (platform_motion(geometry, q, joints.qd, joints.qdd).xdd, (4,))):
        assert np.shape(found) == (*shape, *width)
    assert np.array_equal(q.reshape(-1, 4), inverse_kinematics(geometry, flat))


@pytest.mark.parametrize(('pose', 'message'), [
    ((0.0, 0.0, -0.78), r'shape \(\.\.\., 4\), found \(3,\)'),
    (np.zeros((4, 3)), r'shape \(\.\.\., 4\), found \(4, 3\)'),
    (0.5, r'found \(\)'),
    ((0.0, math.nan, -0.78, 0.0), 'found nan in sample 0, column 1'),
    ([HOME, (0.0, 0.0, math.inf, 0.0)], 'found inf in sample 1, column 2'),
])
def test_wrong_shapes_and_values_are_refused(pose, message):
    geometry = REFERENCE.geometry
    for function in (inverse_kinematics, forward_kinematics, reachable, jacobian,
                     condition_number):
        with pytest.raises(InputError, match=message):
            function(geometry, pose)


def test_shapes_that_do_not_match_are_refused():
    with pytest.raises(InputError, match='matching shape'):
        joint_motion(REFERENCE.geometry, np.tile(HOME, (3, 1)), np.zeros((2, 4)), np.zeros(4))


def test_reference_workspace_is_reachable_everywhere():
    geometry = REFERENCE.geometry
    for theta in np.radians((-45.0, 0.0, 45.0)):
        for z in np.linspace(-0.90, -0.55, 15):
            for radius in np.linspace(0.0, 0.5, 6):
                assert reachable(geometry, circle_poses(radius, z, theta)).all()


def over_disc(degrees: np.ndarray) -> np.ndarray:
    """Return poses (n, 4) of the disc r <= 0.5 m at z = -0.78 m for each theta."""
    return np.concatenate([circle_poses(radius, -0.78, math.radians(angle))
                           for angle in degrees for radius in np.linspace(0.0, 0.5, 11)])


def test_reference_conditioning():
    within = condition_number(REFERENCE.geometry, over_disc(np.linspace(-45.0, 45.0, 19)))
    assert within.min() == pytest.approx(3.6, abs=0.1)
    assert within.max() == pytest.approx(12.0, abs=0.5)
    beyond = condition_number(REFERENCE.geometry, over_disc(np.array((-75.0, 75.0))))
    assert beyond.min() == pytest.approx(14.0, abs=0.6)
    assert beyond.max() == pytest.approx(44.0, abs=1.0)


def test_reference_is_singular_only_near_a_right_angle():
    def determinant(degrees: np.ndarray) -> np.ndarray:
        return np.linalg.det(jacobian_parts(REFERENCE.geometry, over_disc(degrees))[0])

    assert determinant(np.linspace(-80.0, 80.0, 33)).min() > 0.0
    for angle in (-90.0, 90.0):  # the singular surface crosses the disc
        crossed = determinant(np.array((angle,)))
        assert crossed.min() < 0.0 < crossed.max()
    assert determinant(np.array((-100.0, 100.0))).max() < 0.0


@ROBOTS
def test_conditioning_summary_bounds_the_workspace(robot):
    summary = conditioning(robot)
    assert summary.reachable_fraction == 1.0
    assert summary.best < summary.median < summary.worst
    assert condition_number(robot.geometry, summary.worst_pose) == pytest.approx(summary.worst)
    random = condition_number(robot.geometry, poses_in(robot, 500, 9))
    assert random.max() < 1.05 * summary.worst
    assert random.min() > 0.9 * summary.best


def test_inside_is_the_cylinder_and_the_range_of_theta():
    assert inside(REFERENCE, HOME)
    assert inside(REFERENCE, (0.3, 0.39, -0.56, -0.78))
    assert inside(REFERENCE, (0.0, 0.0, -0.78, math.pi / 4.0))  # the paper's range, to the letter
    assert inside(REFERENCE, (0.0, 0.0, -0.78, -math.pi / 4.0))
    for pose in ((0.31, 0.4, -0.78, 0.0), (0.0, 0.0, -0.91, 0.0), (0.0, 0.0, -0.54, 0.0),
                 (0.0, 0.0, -0.78, 0.8), (0.0, 0.0, -0.78, -0.8)):
        assert not inside(REFERENCE, pose)


def test_home_lies_in_the_workspace_of_any_robot():
    assert tuple(home_pose(REFERENCE)) == HOME
    home = home_pose(OTHER)
    assert inside(OTHER, home)
    assert reachable(OTHER.geometry, home)
    assert tuple(home) != HOME


def test_workspace_limits_out_of_reach_are_refused():
    lost = OTHER.model_copy(update={'limits': OTHER.limits.model_copy(update={
        'workspace': OTHER.limits.workspace.model_copy(update={'z': (-2.0, -1.5)})})})
    for function in (home_pose, conditioning):
        with pytest.raises(InputError, match=r'robot other: .*set limits\.workspace'):
            function(lost)


@pytest.mark.parametrize(('part', 'key', 'value'), [
    ('bodies', 'rod_mass', True), ('geometry', 'arm_length', '0.375'),
    ('drives', 'gain', (True, 12.7, 12.7, 12.7)), ('drives', 'encoder_counts', '4096'),
    ('limits', 'joint_position', ('-1.0', 1.6)),
])
def test_what_only_looks_like_a_number_is_refused(tmp_path, part, key, value):
    content = REFERENCE.model_dump(by_alias=True)
    content[part][key] = value
    write_yaml(tmp_path / 'robot.yaml', content)
    with pytest.raises(InputError, match=rf'robot\.yaml: {part}\.{key}.* number.*found'):
        read_robot(tmp_path / 'robot.yaml')


@pytest.mark.parametrize(('part', 'value', 'words'), [
    ({'geometry': {'arm_length': 375}}, '375', 'expected metres, at most 10; .* millimetres'),
    ({'geometry': {'actuator_azimuth': (45, 135, 225, 315)}}, '315', 'radians, .* degrees'),
    ({'geometry': {'rotation_amplification': 0}}, '0', 'tool angle per theta, which is not 0'),
    ({'geometry': {'arm_length_errors': (0, 0, 1.5, 0)}}, '1.5', 'at most 0.1; .* millimetres'),
    ({'limits': {'joint_position': (-57, 92)}}, '92', 'radians, at most two turns, .* degrees'),
    ({'limits': {'joint_position': (1.6, -1.0)}}, '[1.6, -1.0]', 'lower limit, then the higher'),
    ({'limits': {'workspace': {'theta': 45}}}, '45', 'radians, at most two turns, .* degrees'),
    ({'limits': {'workspace': {'radius': 500}}}, '500', 'expected metres, .* millimetres'),
    ({'limits': {'workspace': {'z': (-900, -550)}}}, '-900', 'expected metres, .* millimetres'),
    ({'limits': {'workspace': {'z': (-0.55, -0.9)}}}, '[-0.55, -0.9]', 'lower limit, then'),
    ({'limits': {'workspace': {'z': (0.55, 0.9)}}}, '[0.55, 0.9]', 'are negative; .* sign'),
])
def test_numbers_in_other_units_and_impossible_ranges_are_refused(tmp_path, part, value, words):
    """The line names the key, what was found, what is possible and the likely mistake."""
    content = REFERENCE.model_dump(by_alias=True)
    where, change, below = 'robot.yaml: ', part, content
    while isinstance(change, dict):
        (key, change), = change.items()
        where, target, below = f'{where}{key}.', below, below[key]
    target[key] = change
    write_yaml(tmp_path / 'robot.yaml', content)
    with pytest.raises(InputError, match=re.escape(where[:-1]) + '.*' + words) as error:
        read_robot(tmp_path / 'robot.yaml')
    assert f'(found {value})' in str(error.value)


@pytest.mark.parametrize('part', [
    {'geometry': {'arm_length': 2.5, 'forearm_length': 6.0, 'base_radius': 1.5}},
    {'geometry': {'actuator_azimuth': (-0.25 * math.pi, 0.25 * math.pi, 3.9, 2.6 * math.pi)}},
    {'geometry': {'rotation_amplification': -1.0}},
    {'limits': {'joint_position': (-math.pi, 2.0 * math.pi)}},
    {'limits': {'workspace': {'radius': 3.0, 'z': (-6.0, 0.0), 'theta': math.pi}}},
])
def test_what_a_machine_may_be_is_not_refused(part):
    content = REFERENCE.model_dump(by_alias=True)
    for key, change in part.items():
        content[key] |= change
    read = Robot.model_validate(content).model_dump(by_alias=True)
    for key, change in part.items():
        for name, value in change.items():
            told = read[key][name]
            assert (told.items() >= value.items() if isinstance(value, dict) else told == value)


def test_a_geometry_from_another_process_takes_no_kernel_of_its_own():
    """To compile once more all kernels that read it takes long."""
    q = inverse_kinematics(REFERENCE.geometry, HOME)[None]
    compiled = []
    for geometry in (REFERENCE.geometry, pickle.loads(pickle.dumps(REFERENCE.geometry))):
        np.testing.assert_allclose(forward_kinematics(geometry, q)[0], HOME, atol=1e-9)
        compiled.append(len(_forward_rows.signatures))
    assert compiled == 2 * compiled[:1]
