"""Feedforward that comes message by message against that of the whole motion at once."""

from __future__ import annotations

import numpy as np
import pytest
from experiments import entry, model_of
from test_machine_effects import EXAMPLES

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.feedforward import KEPT, Feedforward
from par4_dynamics.model_from_file import read_model
from par4_kinematics.errors import InputError
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.stamps import SECOND
from robots import REFERENCE

MOTION = excitation_motion(REFERENCE, 4.0, seed=3)
STAMP = np.rint(MOTION.t * SECOND).astype(np.int64)
NOW = 1_770_000_000 * SECOND
"""On a wall clock, ns."""
DRIVES = 5.0
"""Times the torque of the drives: an effect may ask for more."""
FAST = 2500
"""Row from which on the motion is fast."""
PRESLIDING = entry('presliding', distance=5e-3)
DRIFT = entry('friction_drift', drop=0.3, viscous_drop=0.4, time_constant=1.5)


def effort_of(feedforward, rows, stamp=NOW):
    """Return the torques (n, 4) of a message with some of the motion's points."""
    first = STAMP[rows][0]
    return feedforward.effort(int(stamp + first), STAMP[rows] - first, MOTION.q[rows],
                              MOTION.qd[rows], MOTION.qdd[rows])


def effort_of_messages(feedforward, size, count):
    """Return the torques (count, 4) of the first points of the motion, so many a message."""
    return np.concatenate([effort_of(feedforward, slice(row, min(row + size, count)))
                           for row in range(0, count, size)])


def whole_torque(model, count=None):
    return model.torque_of_joints(REFERENCE.geometry, MOTION.q, MOTION.qd, MOTION.qdd,
                                  MOTION.t)[:count]


@pytest.mark.parametrize('size', [1, 7, 250, 4001])
def test_friction_that_remembers_is_that_of_the_whole_motion(size):
    """Each message began without friction and, since 1970, warm: 2.4 and 3 N m were missing."""
    model = model_of(PRESLIDING, DRIFT)
    told = effort_of_messages(Feedforward(REFERENCE, model), size, len(STAMP))
    np.testing.assert_allclose(told, whole_torque(model), rtol=0.0, atol=1e-8)


@pytest.mark.parametrize('name', EXAMPLES)
def test_a_stream_of_single_points_has_the_torque_of_every_effect_but_those_told(name):
    model = model_of(entry(name, unit='rad' if name == 'quantization' else '', **EXAMPLES[name]))
    feedforward = Feedforward(REFERENCE, model, DRIVES)
    effort_of(feedforward, slice(0, FAST))
    told = np.concatenate([effort_of(feedforward, slice(row, row + 1))
                           for row in range(FAST, FAST + 200)])
    off = np.abs(told - whole_torque(model)[FAST:FAST + 200]).max()
    assert feedforward.around == ((name,) if CATALOGUE[name].looks_around else ())
    assert (off > 0.1) if feedforward.around else (off < 1e-8)


def test_friction_of_joints_with_distances_of_their_own_goes_on():
    model = model_of(entry('presliding', (0, 1), distance=2e-3),
                     entry('presliding', (2,), distance=2e-2))
    told = effort_of_messages(Feedforward(REFERENCE, model), 10, 1000)
    np.testing.assert_allclose(told, whole_torque(model, 1000), rtol=0.0, atol=1e-8)


def test_what_goes_on_has_the_level_of_joint_and_direction_and_the_scale_of_the_drive():
    model = model_of(PRESLIDING, DRIFT, entry('drive_gain_error', relative=(0.3, -0.2, 0.0, 0.4)),
                     entry('torque_ripple', relative=0.2, periods=11.0, phase=0.3),
                     entry('coulomb_asymmetry', asymmetry=(0.5, -0.3, 0.4, 0.2)),
                     entry('joint_friction_difference', coulomb=(0.6, -0.5, 0.3, 0.0)))
    told = effort_of_messages(Feedforward(REFERENCE, model), 10, 1000)
    np.testing.assert_allclose(told, whole_torque(model, 1000), rtol=0.0, atol=1e-8)


def test_a_way_that_takes_the_place_of_points_goes_on_from_those_before_it():
    """Several ways to rest are sent, the one that begins last first."""
    model = model_of(entry('presliding', distance=0.05))
    feedforward, whole = Feedforward(REFERENCE, model), whole_torque(model)
    effort_of_messages(feedforward, 1, FAST)
    effort_of(feedforward, slice(FAST, FAST + 900))
    for ahead in (800, 400, 399, 200, -30, -400, 0, 500):
        rows = slice(FAST + ahead, FAST + ahead + 500)
        np.testing.assert_allclose(effort_of(feedforward, rows), whole[rows], rtol=0.0, atol=1e-8)


def test_without_a_past_friction_is_that_of_the_direction():
    """A single point of a joint that moves had none, 0.9 N m instead of 2.4 with the rest."""
    model = model_of(PRESLIDING)
    plain = whole_torque(read_model('table1', REFERENCE))
    row = int(np.argmax(np.abs(MOTION.qd).min(axis=1)))
    for stamp in (NOW, -int(STAMP[row])):  # the latter is none
        told = effort_of(Feedforward(REFERENCE, model), slice(row, row + 1), stamp)
        np.testing.assert_allclose(told[0], plain[row], rtol=0.0, atol=1e-9)


def test_a_message_without_a_stamp_is_a_motion_of_its_own():
    model = model_of(PRESLIDING, DRIFT)
    feedforward = Feedforward(REFERENCE, model)
    effort_of(feedforward, slice(0, 1000))
    np.testing.assert_allclose(
        feedforward.effort(0, STAMP, MOTION.q, MOTION.qd, MOTION.qdd), whole_torque(model),
        rtol=0.0, atol=1e-8)
    rows = slice(1000, 1300)  # and leaves what is remembered as it was
    np.testing.assert_allclose(effort_of(feedforward, rows), whole_torque(model)[rows], rtol=0.0,
                               atol=1e-8)


def test_a_clock_that_is_set_back_begins_anew():
    model = model_of(PRESLIDING, DRIFT)
    feedforward = Feedforward(REFERENCE, model)
    effort_of(feedforward, slice(0, 3000))
    told = [effort_of(feedforward, slice(row, row + 100), SECOND) for row in range(0, 1000, 100)]
    np.testing.assert_allclose(np.concatenate(told), whole_torque(model, 1000), rtol=0.0,
                               atol=1e-8)


def test_a_message_that_is_refused_is_not_remembered():
    model = model_of(PRESLIDING)
    feedforward = Feedforward(REFERENCE, model)
    effort_of(feedforward, slice(0, 1000))
    rows = slice(1000, 1300)
    with pytest.raises(InputError, match='beyond the limit'):
        feedforward.effort(int(NOW + STAMP[1000]), STAMP[rows] - STAMP[1000], MOTION.q[rows],
                           MOTION.qd[rows], MOTION.qdd[rows] + 1e4)
    np.testing.assert_allclose(effort_of(feedforward, rows), whole_torque(model)[rows], rtol=0.0,
                               atol=1e-8)


def test_a_stream_leaves_no_more_behind_than_what_may_be_replaced():
    feedforward = Feedforward(REFERENCE, model_of(PRESLIDING))
    rows = slice(0, 1)
    for second in range(60):
        effort_of(feedforward, rows, NOW + second * SECOND)
    assert len(feedforward._past) <= KEPT // SECOND + 2
    effort_of(feedforward, rows, SECOND)
    assert len(feedforward._past) == 1
