"""Sizes beside a drive that is wrong are those of the machine, not those of its record."""

from __future__ import annotations

import numpy as np
from hidden.hiders import HIDERS
from hidden.machines import known_machine
from hidden.motions import draw_motion
from hidden.physics import Torques
from planned import evidence_of, log_of

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.model_file import EffectEntry, read_model_file
from par4_dynamics.model_from_file import read_model
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.diagnosis import diagnose
from par4_identification.diagnosis.evidence.evidence import gather
from par4_identification.diagnosis.evidence.observations import with_nominal
from robots import model_with

KNOWN = known_machine('reference')
RELATIVE = np.array((0.4, 0.0, -0.3, 0.0))
HIDDEN = {'torque_offset': {'offset': np.array((0.8, -0.6, 0.7, 0.5))},
          'external_force': {'x': 4.0, 'y': -6.0, 'z': 5.0},
          'drive_gain_error': {'relative': RELATIVE}}


def recorded(seed, duration):
    """Return the log of a machine that has `HIDDEN`, by the physics of the hidden machines."""
    machine = KNOWN.machine
    for name, values in HIDDEN.items():
        machine = HIDERS[name].build(machine, values)
    motion = draw_motion('circles', KNOWN.robot, duration, seed)
    return log_of(KNOWN.robot, motion.t, motion.q, Torques(motion.t, motion.q).recorded(machine),
                  seed, noise=0.03)


def test_a_drive_that_is_wrong_by_much_leaves_the_sizes_of_the_others_right():
    """As recorded they would be off by its error, up to 40 %."""
    library = {name: CATALOGUE[name] for name in (*HIDDEN, 'torque_ripple', 'theta_inertia')}
    answer = diagnose([recorded(11, 12.0)], KNOWN.robot, holdout_logs=[recorded(12, 8.0)],
                      library=library)
    causes = {cause.effect.name: cause for cause in answer.causes}
    assert answer.verdict == 'explained'
    assert set(causes) == set(HIDDEN)
    assert causes['drive_gain_error'].joints == (0, 2)
    for name, truth in HIDDEN.items():
        cause = causes[name]
        for key, value in truth.items():
            told = cause.parameters[key]
            expected = value if np.ndim(value) == 0 else value[list(cause.joints)]
            np.testing.assert_allclose(told.value, expected, rtol=0.02)


def test_a_gain_that_the_model_knows_scales_what_is_found_beside_it():
    gain = EffectEntry(effect='drive_gain_error', parameters={
        'relative': Parameter(value=tuple(RELATIVE), unit='1')})
    baseline = read_model_file('table1').model_copy(update={'effects': (gain,)})
    answer = diagnose([recorded(11, 12.0)], KNOWN.robot, holdout_logs=[recorded(12, 8.0)],
                      baseline=baseline, library={name: CATALOGUE[name] for name in (
                          'torque_offset', 'external_force', 'theta_inertia')})
    causes = {cause.effect.name: cause for cause in answer.causes}
    assert set(causes) == {'torque_offset', 'external_force'}
    for name, cause in causes.items():
        for key, value in HIDDEN[name].items():
            expected = value if np.ndim(value) == 0 else value[list(cause.joints)]
            # as recorded they would be 30 % off and more
            np.testing.assert_allclose(cause.parameters[key].value, expected, rtol=0.1)


def test_columns_of_another_scale_are_not_used_again():
    """Of the same rows, with the noise that they have: an offset is recorded as its drive tells."""
    model = read_model('table1', KNOWN.robot)
    offset = CATALOGUE['torque_offset']
    before = evidence_of(recorded(11, 8.0), KNOWN.robot, model)
    plain, = before.blocks(offset, {})
    scaled = gather(with_nominal(before.observations, model_with(
        model, 'drive_gain_error', relative=RELATIVE)), before.whitener, before)
    block, = scaled.blocks(offset, {})
    for column, other, relative in zip(block.columns, plain.columns, RELATIVE, strict=True):
        np.testing.assert_allclose(column, (1.0 + relative) * other)
