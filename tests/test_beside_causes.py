"""Base parameters that no machine can have alone, identified beside what a diagnosis names."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from axes import Motor, recorded
from click.testing import CliRunner
from experiments import entry, model_of
from foreign import log_of
from measured import log_of_model

from par4_dynamics.model_from_file import read_model
from par4_identification.commands.bag import make_bag
from par4_identification.commands.identify import identify_bags
from par4_identification.fitting.identification import identify
from par4_identification.jobs.beside_causes import beside_causes
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.scales import Chosen, conditioning_for
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis
from robots import REFERENCE

MOTOR = Motor(4.7e-6, 0.002, 1e-5, {})
STIFFNESS = 0.002
"""N m/rad: at 2 rad/s it looks like 20 times the motor's inertia, with the other sign."""
MACHINE = Axis.model_validate({'schema': 'par4/axis/1', 'name': 'axis', 'joint': 'motor',
                               'kind': 'revolute', 'gain': 1.0})


@pytest.fixture(scope='module')
def sprung():
    """Return the log of a motor that turns a spring, which the base model lacks."""
    log = recorded(MOTOR, lambda t: np.sin(2.0 * t) + 0.5 * np.sin(5.3 * t), 20.0, 1000.0)
    return replace(log, tau=log.tau + STIFFNESS * log.q)


@pytest.fixture(scope='module')
def conditioning(sprung):
    """Return the filters of the log."""
    return conditioning_for([sprung], MACHINE, Conditioning())


def test_a_spring_that_made_the_inertia_negative_is_part_of_the_model(sprung, conditioning):
    alone = identify([sprung], MACHINE, conditioning=conditioning)
    assert alone.impossible().startswith('actuator_inertia identified as -')
    found = beside_causes(alone, [sprung], MACHINE, conditioning, Chosen(), lambda _step: None)
    values = found.identification.parameters
    assert values['actuator_inertia'].value == pytest.approx(MOTOR.inertia, rel=0.02)
    assert values['coulomb_friction'].value == pytest.approx(MOTOR.coulomb, rel=0.02)
    assert values['viscous_friction'].value == pytest.approx(MOTOR.viscous, rel=0.02)
    # of the whole torque, of which the spring's is a large part
    assert found.identification.estimate.relative_error < 0.01
    written = found.identification.model_file({}, MACHINE)
    assert [entry.effect for entry in written.effects] == ['position_torque']
    assert 'actuator_inertia' in found.remark.text
    assert 'follows the position' in found.remark.text


def test_rods_that_are_known_count_once():
    """Torques that are read early pull friction below zero; the rods are no cause beside that."""
    read_early = model_of(entry('time_offset', delay=-2e-3), coulomb_friction=0.3,
                          viscous_friction=0.01)
    log = log_of_model(REFERENCE, replace(read_early, rigid_body='full'), duration=12.0, seed=3)
    alone = identify([log], REFERENCE, 'full')
    assert alone.impossible().startswith('viscous_friction identified as -')
    found = beside_causes(alone, [log], REFERENCE, Conditioning(), Chosen(), lambda _step: None)
    identification = found.identification
    assert [item.effect for item in identification.causes] == ['time_offset']
    for name in ('platform_mass_1', 'platform_mass_2', 'arm_gravity'):
        assert identification.parameters[name].value == pytest.approx(
            float(read_early.values[name][0]), rel=3e-3)


def test_what_is_possible_is_left_as_it_is(sprung, conditioning):
    healthy = replace(sprung, tau=sprung.tau - STIFFNESS * sprung.q)
    alone = identify([healthy], MACHINE, conditioning=conditioning)
    asked = []
    assert beside_causes(alone, [healthy], MACHINE, conditioning, Chosen(), asked.append) is None
    assert asked == []


def test_what_no_cause_makes_possible_is_refused(sprung, conditioning):
    turned = replace(sprung, tau=STIFFNESS * sprung.q - sprung.tau)  # the sign of the torque
    alone = identify([turned], MACHINE, conditioning=conditioning)
    with pytest.raises(InputError, match='so it remains beside all that par4_diagnose names; che'):
        beside_causes(alone, [turned], MACHINE, conditioning, Chosen(), lambda _step: None)


def test_viscous_friction_that_one_speed_does_not_show_is_left_out():
    """To and fro at one speed: friction that falls as the axis starts to move made it negative."""
    t = 1e-3 * np.arange(20000)
    ramp = np.clip(np.sin(2.0 * np.pi * t / 4.0) / 0.15, -1.0, 1.0)
    speed = 0.2 * np.sin(0.5 * np.pi * ramp)
    torque = (np.gradient(speed, 1e-3) + np.sign(speed) * (1.5 + 0.5 * np.exp(-np.abs(speed) / 0.1))
              + 0.05 * np.random.default_rng(0).standard_normal(len(t)))
    log = log_of(t, 1e-3 * np.cumsum(speed), torque)
    filters = conditioning_for([log], MACHINE, Conditioning())
    alone = identify([log], MACHINE, conditioning=filters)
    assert alone.impossible(MACHINE).startswith('viscous_friction identified as -')
    found = beside_causes(alone, [log], MACHINE, filters, Chosen(), lambda _step: None)
    assert [term.name for term in found.identification.left_out] == ['viscous_friction']
    written = found.identification.model_file({}, MACHINE)
    assert written.parameters['viscous_friction'].value == 0.0
    assert written.parameters['coulomb_friction'].value == pytest.approx(1.58, rel=0.05)
    assert found.remark.text.startswith('Viscous friction identified as -')
    assert 'is left out and counts as zero' in found.remark.text


def test_the_command_writes_the_model_with_the_cause(sprung, tmp_path):
    table = np.column_stack((sprung.t, sprung.q, sprung.tau))
    np.savetxt(tmp_path / 'log.csv', table, delimiter=',', header='t,q,tau', comments='')
    robot = tmp_path / 'axis.yaml'
    robot.write_text('schema: par4/axis/1\nname: axis\njoint: motor\nkind: revolute\ngain: 1.0\n')
    bag, out = str(tmp_path / 'bag'), tmp_path / 'out'
    CliRunner().invoke(make_bag, [
        str(tmp_path / 'log.csv'), '--columns', 'time=t:s position=q:rad torque=tau:Nm',
        '--joints', 'motor', '--output', bag], catch_exceptions=False)
    told = CliRunner().invoke(identify_bags, [bag, '--robot', str(robot), '--output', str(out),
                                              '--no-report'], catch_exceptions=False)
    assert told.exit_code == 0, told.output
    assert '- Base parameters alone do not explain these data: actuator_inertia' in told.output
    written = json.loads((out / 'identification.json').read_text())
    assert written['causes'] == ['position_torque']
    model = read_model(str(out / 'model.yaml'), MACHINE)
    assert [active.effect.name for active in model.effects] == ['position_torque']
    assert model.values['actuator_inertia'][0] == pytest.approx(MOTOR.inertia, rel=0.02)
