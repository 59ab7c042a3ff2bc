"""Four measured axes, each from its file to a named cause by the commands alone.

Archives of simulated axes, made from the published numbers, always go this way; the measured ones
do where PAR4_AXES_DATA gives their folder.
"""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from axes import Motor, held_speeds, recorded, there_and_back
from click.testing import CliRunner
from measured_axes import DATA_SETS, LAAS_COLUMNS, VARIABLE, DataSet, answer, chosen

from par4_identification.commands.bag import make_bag
from par4_identification.commands.diagnose import diagnose_bags
from par4_identification.commands.identify import identify_bags
from par4_kinematics.errors import InputError
from par4_kinematics.robot import read_machine

pytestmark = pytest.mark.usefixtures('unrendered')
COMMANDS = {'par4_bag': make_bag, 'par4_diagnose': diagnose_bags, 'par4_identify': identify_bags}
NAMED = {data.name: data for data in DATA_SETS}
DRIVER = Motor(4.7e-6, 0.002, 1e-5, {72: (0.0047, -2.6), 18: (0.0010, 0.2)})
BARE = Motor(2e-5, 0.015, 1e-3, {7: (0.048, -0.3), 28: (0.019, 0.0), 14: (0.016, 3.0),
                                 12: (0.013, 1.2), 36: (0.0074, 2.1), 84: (0.005, 1.0)})
SERVO = Motor(5e-3, 0.01, 0.02, hanging=0.48, by_load=0.2)
RPM = [side * speed for speed in (2, 5, 10, 20, 30, 40, 50, 60, 80, 100, 120, 160, 200)
       for side in (1, -1)]


def call(words):
    """Run a command in this process; return what it prints."""
    done = CliRunner().invoke(COMMANDS[words[0]], list(words[1:]), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def table_of(log, *, counts=False, per_unit=1.0, empty=0):
    """Return time, position, speed or nothing, `empty` columns, and torque per unit, (n, k)."""
    q = log.q[:, 0] * (8192 / (2.0 * np.pi) if counts else 1.0)
    speed = [] if counts else [np.gradient(log.q[:, 0], log.t)]
    return np.column_stack((log.t, q, *speed, *np.zeros((empty, len(q))),
                            log.tau[:, 0] / per_unit))


def screw(load, rise, velocity):
    """Return the friction of a screw under a load, N m, that rises towards standstill."""
    return lambda speed: load + 5e-5 * speed + math.copysign(
        2.6e-3 + rise * math.exp(-(speed / velocity) ** 2), speed)


def simulated_archives(folder: Path) -> None:
    """Write archives with the tables and columns of the measured ones."""
    np.savez(folder / 'laas.npz', speed_test=table_of(
        recorded(DRIVER, lambda t: 5.3 * t + np.sin(1.1 * t), 16.0, 1000.0), per_unit=0.025,
        empty=1))
    np.savez(folder / 'odrive.npz', **{
        f'slow2_slower__{name}_0': table_of(recorded(
            BARE, way, duration, 500.0, counts=8192, noise=1e-3, seed=seed), counts=True,
            per_unit=0.0551).T
        for name, way, duration, seed in (
            ('nocomp', there_and_back, 24.0, 0),
            ('comp', lambda t: there_and_back(1.3 * t + 2.0), 18.0, 1))})
    np.savez(folder / 'screws.npz', **{
        f'drive{number}__{"n" if rpm < 0 else ""}{abs(rpm)}': table_of(log).T
        for number, drive in ((1, screw(3.6e-4, 6e-4, 4.0)), (2, screw(0.0, 0.0, 1.0)),
                              (3, screw(4.8e-4, 6e-4, 0.69)))
        for rpm, log in zip(RPM, held_speeds(drive, [rpm * np.pi / 30.0 for rpm in RPM], 1e-4,
                                             seed=number))})
    np.savez(folder / 'xl330.npz', **{
        f'sin_sin__kp{gain}': table_of(recorded(
            SERVO, lambda t: 0.9 * np.sin(2.0 * t) + 0.4 * np.sin(5.3 * t), 6.0, 200.0, 4096,
            1e-3, gain, stiffness), per_unit=0.07).T
        for gain, stiffness in ((100, 30.0), (200, 40.0), (400, 50.0), (800, 60.0))})


@pytest.fixture(scope='module', params=['simulated', 'measured'])
def archives(request, tmp_path_factory):
    """Return the folder of the archives."""
    if request.param == 'simulated':
        folder = tmp_path_factory.mktemp('archives')
        simulated_archives(folder)
        return folder
    if VARIABLE not in os.environ:
        pytest.skip(f'{VARIABLE} is not set')
    return Path(os.environ[VARIABLE])


def found(name, archives, folder):
    """Return diagnosis.json of a data set, and its causes by name."""
    told = answer(NAMED[name], archives, folder, call).diagnosis
    return told, {cause['effect']: cause for cause in told['causes']}


def test_a_driver_has_cogging_of_72_periods(archives, tmp_path):
    _, causes = found('laas', archives, tmp_path)
    assert list(causes) == ['cogging']
    parameters = causes['cogging']['parameters']
    strongest = int(np.argmax(parameters['amplitude']['value']))
    assert parameters['periods']['value'][strongest] == 72.0
    assert 0.15 < parameters['amplitude']['value'][strongest] / 0.025 < 0.21


def test_a_bare_motor_has_cogging_of_its_poles_and_slots(archives, tmp_path):
    _, causes = found('odrive', archives, tmp_path)
    assert list(causes) == ['cogging']
    assert {7.0, 12.0, 14.0, 28.0, 36.0} <= set(
        causes['cogging']['parameters']['periods']['value'])


def test_a_lead_screw_has_stribeck_friction_and_a_load(archives, tmp_path):
    _, causes = found('screw1', archives, tmp_path)
    assert set(causes) == {'torque_offset', 'stribeck'}
    assert 2.5 < causes['stribeck']['parameters']['stribeck_velocity']['value'][0] < 7.0


def test_a_screw_without_backlash_has_no_stribeck_friction(archives, tmp_path):
    told, causes = found('screw2', archives, tmp_path)
    assert told['verdict'] == 'clean'
    assert not causes


def test_a_worm_has_a_load_and_friction_that_falls_with_speed(archives, tmp_path):
    told, causes = found('screw3', archives, tmp_path)
    names = list(causes)
    assert names[0] == 'torque_offset'
    assert set(names[1:]) <= {'stribeck', 'nonlinear_viscous'}
    assert len(names) > 1 or told['verdict'] == 'partly_explained'


def test_a_servo_is_told_as_friction_without_a_wrong_name(request, archives, tmp_path):
    told, causes = found('xl330', archives, tmp_path)
    assert set(causes) <= {'load_dependent_friction'}
    if request.node.callspec.params['archives'] == 'simulated':
        share = causes['load_dependent_friction']['parameters']['coefficient']['value']
        assert np.ravel(share)[0] == pytest.approx(SERVO.by_load, rel=0.1)
    words = [item['acts_like'] for item in told['unnamed']]
    assert causes or any('friction' in word or 'load' in word for word in words)


def test_axis_files_are_those_of_the_data_sets():
    assert {read_machine(str(data.robot)).name for data in DATA_SETS} == {
        'laas', 'odrive', 'screws', 'xl330'}


def test_what_is_not_there_is_said_in_a_line(tmp_path):
    with pytest.raises(InputError, match='no such data set; there are laas, odrive, screw1'):
        chosen(['lass'])
    with pytest.raises(InputError, match='laas.npz: there is no such file; PAR4_AXES_DATA gives'):
        answer(NAMED['laas'], tmp_path, tmp_path, call)


# ------------------------------------------------------------------- of the measured driver alone


@pytest.fixture(scope='module')
def driver():
    """Return the measured archive of the driver."""
    if VARIABLE not in os.environ:
        pytest.skip(f'{VARIABLE} is not set')
    return Path(os.environ[VARIABLE])


def of_driver(run, columns=LAAS_COLUMNS):
    """Return the data set of one of its runs."""
    return DataSet(run, 'laas.npz', columns, (run,), (), '')


def test_the_measured_driver_is_identified_beside_its_cogging(driver, tmp_path):
    bag, out = str(tmp_path / 'bag'), tmp_path / 'out'
    call(['par4_bag', str(driver / 'laas.npz'), *LAAS_COLUMNS, '--array', 'speed_test', '--joints',
          'motor', '--between', '8.01', '40', '--output', bag])
    call(['par4_identify', bag, '--robot', str(NAMED['laas'].robot), '--output', str(out),
          '--no-report'])
    told = json.loads((out / 'identification.json').read_text())
    assert told['causes'] == ['cogging']
    assert told['parameters']['viscous_friction']['value'] > 0.0
    assert 4e-6 < told['parameters']['actuator_inertia']['value'] < 5.5e-6


def test_the_measured_driver_at_high_speed_is_given_no_name(driver, tmp_path):
    data = of_driver('accel', ('--columns', 'time=1:s position=2:rad torque=4:A', '--motor-gain',
                               '0.025'))
    told = answer(data, driver, tmp_path, call).diagnosis
    assert told['causes'] == []
    # it turns on and on
    assert not any('spring' in item['acts_like'] for item in told['unnamed'])


def test_measured_phases_are_those_of_the_table_that_compensates_them(driver, tmp_path):
    """The table took no part; where the motion goes one way a delay of a sample may be in them."""
    told = answer(of_driver('speed_test1 15.01 60'), driver, tmp_path, call).diagnosis
    parameters = next(cause for cause in told['causes']
                      if cause['effect'] == 'cogging')['parameters']
    table = np.ravel(np.load(driver / 'laas.npz')['table7200'])
    lines = np.fft.fft(table) / len(table)
    for order, phase, std in zip(parameters['periods']['value'], parameters['phase']['value'],
                                 parameters['phase']['std']):
        expected = np.angle(lines[int(order)]) + 0.5 * np.pi
        apart = float(np.abs(np.angle(np.exp(1j * (np.ravel(phase) - expected))))[0])
        if order == 72.0:
            assert np.degrees(apart) < 10.0
        if np.abs(lines[int(order)]) > 0.05 * np.abs(lines[72]):
            assert apart < 3.0 * np.ravel(std)[0]
