"""Online motions: targets that change on the way, limits of every joint kept throughout."""

from __future__ import annotations

import numpy as np
import pytest

from par4_kinematics.errors import InputError, UnreachableError
from par4_kinematics.files import write_yaml
from par4_kinematics.motion import check_limits
from par4_kinematics.motion_file import read_motion
from par4_kinematics.online import OnlineReference, online_motion
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.time_laws import SCurve
from robots import REFERENCE

HOME = (0.0, 0.0, -0.78, 0.0)
SPEED, ACCELERATION, JERK = 6.0, 150.0, 8000.0


def moved(targets, start=HOME, **changes):
    limits = {'joint_speed': SPEED, 'joint_acceleration': ACCELERATION, 'joint_jerk': JERK}
    return online_motion(REFERENCE, start, targets, **{**limits, **changes})


@pytest.fixture(scope='module')
def wandering():
    """Twenty targets anywhere, each before the one before it is reached, the last to rest."""
    random = np.random.default_rng(16)
    times = np.cumsum(random.uniform(0.03, 0.12, 20))
    poses = np.array(HOME) + random.uniform(-1.0, 1.0, (20, 4)) * (0.2, 0.2, 0.08, 0.5)
    return np.column_stack((times, poses)), moved(np.column_stack((times, poses)).tolist())


def test_limits_are_kept_whatever_the_targets_do(wandering):
    _, motion = wandering
    assert np.abs(motion.qd).max() <= SPEED * (1.0 + 1e-9)
    assert np.abs(motion.qdd).max() <= ACCELERATION * (1.0 + 1e-9)
    assert np.abs(motion.qd).max() > 0.95 * SPEED
    assert np.abs(motion.qdd).max() > 0.99 * ACCELERATION
    jerk = np.diff(motion.qdd, axis=0) / motion.period
    assert 0.99 * JERK < np.abs(jerk).max() <= JERK * (1.0 + 1e-6)


def test_positions_speeds_and_accelerations_belong_together(wandering):
    """Trapezoids err by at most jerk period^2 / 4 a step in speed, also where a target comes."""
    _, motion = wandering
    for whole, slope, bend in ((motion.q, motion.qd, ACCELERATION), (motion.qd, motion.qdd, JERK)):
        gained = 0.5 * motion.period * (slope[1:] + slope[:-1])
        np.testing.assert_allclose(np.diff(whole, axis=0), gained, rtol=0.0,
                                   atol=0.26 * bend * motion.period ** 2)


def test_it_comes_to_rest_at_the_last_target(wandering):
    targets, motion = wandering
    np.testing.assert_allclose(motion.q[-1], inverse_kinematics(REFERENCE.geometry,
                                                                targets[-1, 1:]), atol=1e-9)
    np.testing.assert_array_equal(motion.qd[-1], 0.0)
    np.testing.assert_allclose(motion.x[-1], targets[-1, 1:], atol=1e-9)


def test_a_target_changes_nothing_before_it_comes(wandering):
    targets, motion = wandering
    for count in (3, 11):
        earlier = moved(targets[:count].tolist())
        rows = int(targets[count, 0] / motion.period)
        np.testing.assert_array_equal(earlier.q[:rows], motion.q[:rows])
        assert np.abs(earlier.q[rows + 20] - motion.q[rows + 20]).max() > 1e-3


def test_from_rest_to_rest_it_takes_the_time_of_the_quickest_law():
    """The slowest joint needs what the S-curve of this project needs; all arrive together."""
    pose = (0.15, -0.1, -0.72, 0.3)
    way = np.abs(inverse_kinematics(REFERENCE.geometry, pose)
                 - inverse_kinematics(REFERENCE.geometry, HOME))
    reference = OnlineReference(REFERENCE, HOME, SPEED, ACCELERATION, JERK)
    reference.aim(0.1, pose)
    slowest = max(SCurve(length, SPEED, ACCELERATION, JERK).duration for length in way)
    assert reference.arrival - 0.1 == pytest.approx(slowest, abs=1e-9)
    just_before = np.array(reference.at(reference.arrival - 0.3 * slowest)[1])
    assert (np.abs(just_before) > 1e-3).all()


def test_a_recipe_in_a_file_is_the_motion(tmp_path, wandering):
    targets, motion = wandering
    write_yaml(tmp_path / 'online.yaml', {'schema': 'par4/motion/1', 'recipe': {
        'kind': 'online', 'start': list(HOME), 'targets': targets.tolist(), 'joint_speed': SPEED,
        'joint_acceleration': ACCELERATION, 'joint_jerk': JERK}})
    np.testing.assert_array_equal(read_motion(tmp_path / 'online.yaml', REFERENCE).q, motion.q)


def test_a_way_beyond_the_limits_is_refused_with_the_first_limit_when_and_where():
    """Straight in the joints is no straight line of D: low down it sags out of the workspace."""
    motion = moved([(0.0, 0.3, 0.0, -0.89, 0.0)], (-0.3, 0.0, -0.89, 0.0))
    below = motion.x[:, 2] < REFERENCE.limits.workspace.z[0] - 1e-6
    assert below.any()
    first = motion.t[np.argmax(below)]
    with pytest.raises(InputError, match=rf'z of D .* from {first:.3f} s on, at the pose'):
        check_limits(motion, REFERENCE)


@pytest.mark.parametrize(('changes', 'message'), [
    ({'targets': []}, 'at least one target'),
    ({'targets': [(0.0, *HOME[:3])]}, 'targets of 4 numbers'),
    ({'start': HOME[:3]}, 'found 3 numbers'),
    ({'targets': [(0.2, *HOME), (0.1, *HOME)]}, 'in order of time'),
    ({'targets': [(-0.1, *HOME)]}, 'a time from 0 on'),
    ({'targets': [(0.0, *HOME)]}, 'targets are its start'),
    ({'joint_speed': 20.0}, 'above the 15 rad/s of robot reference'),
    ({'joint_jerk': 0.0}, 'joint_jerk must be positive')])
def test_bad_input_is_told(changes, message):
    given = {'targets': [(0.0, 0.1, 0.0, -0.78, 0.0)], **changes}
    with pytest.raises(InputError, match=message):
        moved(given.pop('targets'), given.pop('start', HOME), **given)


def test_a_target_out_of_reach_is_told():
    with pytest.raises(UnreachableError):
        moved([(0.0, 1.5, 0.0, -0.78, 0.0)])
