"""A motion too slow to show the inertia of the actuators: a model that is given tells it."""

from __future__ import annotations

import numpy as np
import pytest
from axes import Motor, held_speeds, recorded
from planned import log_of

from par4_dynamics.model_file import EffectEntry, ModelFile, read_model_file
from par4_dynamics.model_from_file import build_model, read_model
from par4_dynamics.parameters import Parameter
from par4_dynamics.state import state_of_platform
from par4_identification.changes.changes import changes_since_model
from par4_identification.changes.readings import FrictionFactor
from par4_identification.confrontation.confrontation import model_before
from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.diagnosis.experiment.next_experiment import Prospect
from par4_identification.diagnosis.nominal.start import is_mended
from par4_identification.diagnosis.verdict.answer import Unusable
from par4_identification.reports.outcome.diagnosis import outcome_of_diagnosis
from par4_identification.signals.scales import conditioning_for
from par4_kinematics.motion_file import named_motion
from par4_kinematics.robot import Axis
from robots import REFERENCE

SLOW = Motor(0.05, 0.5, 0.3, {11: (0.15, 0.4)})
MACHINE = Axis.model_validate({'schema': 'par4/axis/1', 'name': 'axis', 'joint': 'motor',
                               'kind': 'revolute', 'gain': 1.0})


def model_of(motor):
    """Return the model of a motor without its cogging."""
    return ModelFile(schema='par4/model/1', parameters={
        'actuator_inertia': Parameter(value=motor.inertia, std=0.0, unit='kg m2'),
        'coulomb_friction': Parameter(value=motor.coulomb, std=0.01, unit='N m'),
        'viscous_friction': Parameter(value=motor.viscous, std=0.01, unit='N m s/rad')})


def diagnosed(fit, heldout, model):
    """Return the diagnosis of logs of the axis."""
    return diagnose(fit, MACHINE, model, heldout, conditioning=conditioning_for(
        [*fit, *heldout], MACHINE, CONDITIONING))


@pytest.fixture(scope='module')
def slow():
    """Return two logs of an axis, the second of which is faster, by `diagnose`'s names."""
    fit = recorded(SLOW, lambda t: 1.5 * np.sin(0.11 * t) + 0.5 * np.sin(0.3 * t), 60.0, 200.0,
                   4096, 0.1, stiffness=20.0)
    heldout = recorded(SLOW, lambda t: 1.5 * np.sin(2.0 * t), 20.0, 200.0, 4096, 0.1, seed=1,
                       stiffness=20.0)
    return {'fit': [fit], 'heldout': [heldout]}


def test_the_inertia_is_that_of_the_model(slow):
    found = diagnosed(**slow, model=model_of(SLOW))
    assert found.left_out == ('actuator_inertia',)
    assert [cause.effect.name for cause in found.causes] == ['cogging']
    assert found.extended_model.parameters['actuator_inertia'].value == SLOW.inertia
    # rows of the faster motion count, where the inertia takes 0.21 N m rms
    assert np.mean([run.valid.mean() for run in found.holdout.runs]) > 0.6
    assert found.holdout.extended_rms[0] < 0.1
    assert any('taken from the model' in remark.text
               for remark in outcome_of_diagnosis(found, MACHINE, None).remarks)
    changes_since_model(found, MACHINE, model_of(SLOW), 'the model')


def test_without_a_model_it_is_left_out(slow):
    found = diagnosed(slow['fit'], [], None)
    assert found.left_out == ('actuator_inertia',)
    assert [cause.effect.name for cause in found.causes] == ['cogging']
    assert found.extended_model.parameters['actuator_inertia'].value == 0.0
    assert any('counts as zero' in remark.text
               for remark in outcome_of_diagnosis(found, MACHINE, None).remarks)


def test_what_has_changed_is_told_of_steady_speeds():
    speeds = [side * speed for speed in (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 15.0)
              for side in (1.0, -1.0)]
    logs = held_speeds(lambda speed: 0.1 + np.copysign(0.7, speed) + 0.3 * speed, speeds, 2e-3)
    found = diagnosed(logs, [], model_of(SLOW))
    assert [cause.effect.name for cause in found.causes] == ['torque_offset']
    changes = changes_since_model(found, MACHINE, model_of(SLOW), 'the model')
    assert [item.reading for item in changes.read] == [FrictionFactor(None, ('coulomb_friction',))]


def crawling(speed):
    """Return the motion of a Par4's platform that goes this fast, m/s or so."""
    t = np.arange(0.0, 30.0, 2e-3)
    angles = speed / 0.1 * np.outer(t, (1.0, 1.31, 1.73, 0.83))
    size = np.array((0.1, 0.1, 0.05, 0.3))
    centre = np.array((0.0, -0.08, -0.7, 0.0))
    rates = angles[1] / t[1]
    return state_of_platform(REFERENCE.geometry, t, centre + size * np.sin(angles),
                             size * rates * np.cos(angles), -size * rates ** 2 * np.sin(angles))


def test_a_par4_that_crawls_is_diagnosed_with_a_model_that_tells_its_inertia():
    table1 = read_model_file('table1')
    cogging = EffectEntry(effect='cogging', joints=(2,), parameters={
        'amplitude': Parameter(value=(1.0,), unit='N m'), 'periods': Parameter(value=24.0),
        'phase': Parameter(value=(0.3,), unit='rad')})
    machine = build_model(REFERENCE, table1.model_copy(update={'effects': (cogging,)}))
    fit, heldout = (log_of(REFERENCE, state.t, state.q, machine.torque(state), seed)
                    for seed, state in enumerate((crawling(0.02), crawling(0.025))))
    refused = diagnose([fit], REFERENCE, holdout_logs=[heldout], library={})
    assert isinstance(refused, Unusable)
    assert 'does not excite actuator_inertia' in refused.reasons[0]
    found = diagnose([fit], REFERENCE, table1, [heldout])
    assert found.left_out == ('actuator_inertia',)
    assert [(cause.effect.name, cause.joints) for cause in found.causes] == [('cogging', (2,))]
    given = read_model('table1', REFERENCE).values['actuator_inertia']
    for model_file in (found.extended_model, model_before(found)):
        assert np.all(build_model(REFERENCE, model_file).values['actuator_inertia'] == given)
    # a quicker motion would show the inertia; what it is is known
    planned = Prospect(found.evidence, REFERENCE, found.extended_model, found.effects).of_motion(
        named_motion('excitation', REFERENCE, 6.0))
    assert planned.base.shape[1] == found.evidence.base.shape[1]


@pytest.mark.parametrize(('value', 'std', 'coulomb', 'viscous', 'expected'), [
    (0.11, 0.01, 2.4, 2.0, True), (0.11, 0.05, 2.4, 2.0, False), (-0.11, 0.01, 2.4, 2.0, False),
    (0.11, None, 2.4, 2.0, False), (0.11, 0.01, 2.4, -0.1, False),
    (0.11, 0.01, (2.4, -0.1, 2.4, 2.4), 2.0, False)])
def test_base_values_are_those_of_a_machine_by_inertia_and_friction(
        value, std, coulomb, viscous, expected):
    """The inertia is positive and of some accuracy; friction does not drive."""
    assert is_mended({
        'actuator_inertia': Parameter(value=value, std=std, unit='kg m2'),
        'coulomb_friction': Parameter(value=coulomb, unit='N m'),
        'viscous_friction': Parameter(value=viscous, unit='N m s/rad')}) == expected
