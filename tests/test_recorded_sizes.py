"""Sizes beside a drive that is wrong are those of its record, and the report says so."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hidden.hiders import HIDERS
from hidden.machines import known_machine
from hidden.motions import draw_motion
from hidden.physics import Torques

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.parameters import Parameter
from par4_identification.reports.outcome.diagnosis_remarks import remarks_of_records

RELATIVE = np.array((0.0, 0.05, 0.0, -0.1))
TEETH = {'amplitude': np.array((0.5, 0.4, 0.3, 0.6)), 'periods': 24.0, 'phase': np.zeros(4)}


def cause(name, joints, **values):
    """Return a named cause with values, of the joints that it acts on."""
    return SimpleNamespace(effect=CATALOGUE[name], joints=joints, parameters={
        key: Parameter(value=value) for key, value in values.items()})


DRIVES = cause('drive_gain_error', (1, 3), relative=(0.05, -0.1))


def test_a_drive_that_is_wrong_scales_what_acts_on_its_joint():
    """By the physics of the hidden machines, the factor is the one that the remark tells."""
    known = known_machine('reference')
    motion = draw_motion('circles', known.robot, 8.0, 7)
    torques = Torques(motion.t, motion.q)

    def record(**hidden):
        machine = known.machine
        for name, values in hidden.items():
            machine = HIDERS[name].build(machine, values)
        return torques.recorded(machine)

    teeth = record(cogging=TEETH) - record()
    recorded = (record(cogging=TEETH, drive_gain_error={'relative': RELATIVE})
                - record(drive_gain_error={'relative': RELATIVE}))
    factors = np.ones(4)
    factors[list(DRIVES.joints)] = DRIVES.effect.recorded({'relative': np.array((0.05, -0.1))})
    np.testing.assert_allclose(recorded, factors * teeth, atol=1e-9)
    assert np.std(teeth) > 0.1

    first, second = remarks_of_records([DRIVES, cause('cogging', (0, 1, 2, 3), amplitude=0.5)])
    for remark, joint, factor in ((first, 1, '1.05'), (second, 3, '0.900')):
        assert remark.text == (f'Joint {joint} records {factor} times its torque, and so the size '
                               f'of cogging torque there is the recorded one.')
        assert f'Divide it by {factor} ' in remark.advice


def test_only_torques_of_the_joint_itself_are_those_of_the_record():
    """Platform forces are told by all joints; what scales with the model's torque is not scaled."""
    beside = [cause('external_force', (0, 1, 2, 3), x=1.0),
              cause('load_dependent_friction', (1,), coefficient=(0.05,)),
              cause('torque_offset', (0, 2), offset=(0.5, 0.4))]
    assert remarks_of_records([DRIVES, *beside]) == []
    assert remarks_of_records(beside) == []
    remark, = remarks_of_records([*beside, DRIVES, cause('torque_offset', (1,), offset=(0.3,)),
                                  cause('stribeck', (0, 1), stribeck_torque=(0.5, 0.5))])
    assert f'the size of {CATALOGUE["torque_offset"].phrase} and ' in remark.text
