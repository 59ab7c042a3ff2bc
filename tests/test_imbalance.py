"""A mass that the tool carries beside its axis: its torque, and what a diagnosis makes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hidden.machines import known_machine
from hidden.motions import draw_motion
from planned import log_of, state_of_motion

from par4_dynamics.imbalance import imbalance_columns
from par4_identification.diagnosis.diagnosis import LIBRARY, diagnose
from par4_identification.setup_check.calibration import calibration_of
from par4_identification.setup_check.equations import stretches_of

KNOWN = known_machine('reference')
ROBOT = KNOWN.robot
MOMENT = np.array((0.004, -0.003))
"""kg m at theta = 0: 0.25 kg 20 mm beside the axis."""

OF_PLATFORM = {name: effect for name, effect in LIBRARY.items()
               if effect.needs_platform or effect.shared}


def rate(values, period):
    """Return the time derivative of values (n, ...), to fourth order."""
    ahead, behind = np.roll(values, -1, axis=0), np.roll(values, 1, axis=0)
    farther, before = np.roll(values, -2, axis=0), np.roll(values, 2, axis=0)
    return (8.0 * (ahead - behind) - (farther - before)) / (12.0 * period)


def torque_of_mass(motion):
    """Return the torque (n, 4) of the mass on the joints, by where it is at each instant.

    The force is the mass times the acceleration of its place beside D; the moment about theta is
    what is left of the change of its energy.
    """
    turn = ROBOT.geometry.rotation_amplification * motion.x[:, 3]
    place = np.stack((np.cos(turn) * MOMENT[0] - np.sin(turn) * MOMENT[1],
                      np.sin(turn) * MOMENT[0] + np.cos(turn) * MOMENT[1]), axis=1)
    speed = rate(place, motion.period)
    force = rate(speed, motion.period)
    energy = np.sum(motion.xd[:, :2] * speed, axis=1)
    moment = (rate(energy, motion.period) - np.sum(force * motion.xd[:, :2], axis=1)) / np.where(
        np.abs(motion.xd[:, 3]) > 0.02, motion.xd[:, 3], np.inf)
    state = state_of_motion(ROBOT, motion)
    return state.torque_of_force(np.column_stack((force, np.zeros(len(force)), moment)))


def test_the_torque_is_that_of_a_mass_where_it_is():
    motion = draw_motion('excitation', ROBOT, 8.0, 3)
    turning = np.abs(motion.xd[:, 3]) > 0.5
    turning[:5] = turning[-5:] = False
    assert turning.mean() > 0.3
    torque = imbalance_columns(state_of_motion(ROBOT, motion)) @ MOMENT
    true = torque_of_mass(motion)
    assert np.std(true[turning]) > 0.05
    error = (torque - true)[turning]
    assert np.sqrt(np.mean(error ** 2)) < 0.01 * np.std(true[turning])


def test_an_axis_has_no_tool():
    state = replace(state_of_motion(ROBOT, draw_motion('excitation', ROBOT, 4.0, 3)), geometry=None)
    with pytest.raises(TypeError, match='platform'):
        imbalance_columns(state)


@pytest.fixture(scope='module')
def logs():
    """Return a log to fit and one to hold out of a machine whose tool has the mass."""
    made = []
    for duration, seed in ((8.0, 1), (6.0, 2)):
        motion = draw_motion('excitation', ROBOT, duration, seed)
        state = state_of_motion(ROBOT, motion)
        torque = KNOWN.model.torque(state) + imbalance_columns(state) @ MOMENT
        made.append(log_of(ROBOT, motion.t, motion.q, torque, seed))
    return made


def test_it_is_told_as_what_it_acts_like(logs):
    fit, heldout = logs
    found = diagnose([fit], ROBOT, None, [heldout], library=OF_PLATFORM)
    cause, = found.unnamed
    assert (found.verdict, found.causes, cause.kind) == ('unknown', (), 'imbalance')
    assert cause.share > 0.95


def test_it_moves_no_zero_and_no_dimension(logs):
    assert calibration_of(stretches_of(logs), ROBOT.geometry) is None
