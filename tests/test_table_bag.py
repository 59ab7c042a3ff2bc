"""Bags made from logs of any machine: what is written is what was measured, and what is said of it.

The measured axes of docs/measured.md are taken from the folder that PAR4_AXES_DATA names, where it
is set; archives of the same layout, made here, always go the same way.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from measured import excitation
from planned import state_of_motion
from scipy.io import savemat

from par4_dynamics.model_from_file import read_model
from par4_identification.commands import bag
from par4_identification.jobs.bag import joint_names
from par4_identification.logs.column_choice import chosen_columns, named_otherwise
from par4_identification.logs.measured import Measured
from par4_identification.logs.measured_bag import write_measured
from par4_identification.logs.measured_files import measured_of_files
from par4_identification.logs.read_log import read_log
from par4_identification.logs.tables import Part
from par4_identification.logs.units import UNITS
from par4_kinematics.errors import InputError
from par4_kinematics.robot import JOINT_NAMES, Axis, read_machine
from recording import VARIABLE as EMPS_VARIABLE
from recording import data_path, read_recording
from robots import REFERENCE

VARIABLE = 'PAR4_AXES_DATA'
DOCS = Path(__file__).parents[1] / 'docs' / 'measured.md'
PERIOD, COUNT = 2e-3, 400
T = PERIOD * np.arange(COUNT)
Q = 1.2 * np.sin(9.0 * T) + 0.3 * np.sin(31.0 * T)
QD = 10.8 * np.cos(9.0 * T) + 9.3 * np.cos(31.0 * T)
TAU = 0.4 * np.sign(QD) + 0.02 * QD
COLUMNS = 'time=t:s position=q:rad velocity=qd:rad/s torque=tau:Nm'


def axis(joint='motor', kind='revolute', gain=2.0):
    return Axis.model_validate({'schema': 'par4/axis/1', 'name': 'axis', 'joint': joint,
                                'kind': kind, 'gain': gain})


@pytest.fixture
def tool(capsys, monkeypatch):
    """Return the executable: arguments -> exit code, what it printed, its complaint."""
    def run(*arguments):
        monkeypatch.setattr(sys, 'argv', ['par4_bag', *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            bag.main()
        said = capsys.readouterr()
        return SimpleNamespace(code=stop.value.code, out=said.out, err=said.err)
    return run


def csv(path, **columns):
    """Write columns as a CSV with full precision and return its path."""
    np.savetxt(path, np.stack(list(columns.values()), axis=1), fmt='%.17g', delimiter=',',
               header=','.join(columns), comments='')
    return path


# ----------------------------------------------------------------------------- what comes back


def test_a_par4_comes_back_from_foreign_units(tool, tmp_path):
    """Degrees, milliseconds from 1970, amperes and volts, columns in any order, two files."""
    motion = excitation('reference', 4.0, 77)
    torque = read_model('table1', REFERENCE).torque(state_of_motion(REFERENCE, motion))
    gain, constant = np.array(REFERENCE.drive_gain), (0.5, 0.6, 0.7, 0.8)
    first = 1.7e12 + 1e3 * motion.t
    half, files = len(motion.t) // 2, []
    for name, rows in (('one', slice(None, half)), ('two', slice(half, None))):
        files.append(csv(
            tmp_path / f'{name}.csv',
            **{f'amps {joint}': torque[rows, joint] / constant[joint] for joint in range(4)},
            stamp=first[rows],
            **{f'volts {joint}': torque[rows, joint] / gain[joint] for joint in range(4)},
            **{f'deg {joint}': np.degrees(motion.q[rows, joint]) for joint in range(4)}))
    told = tool(*files, '--columns', "time=stamp:ms position=10-13:deg voltage='volts 0,volts 1,"
                "volts 2,volts 3':V torque=1-4:A", '--motor-gain', '0.5,0.6,0.7,0.8', '--output',
                tmp_path / 'bag')
    assert told.code == 0, told.err
    assert 'look at this' not in told.out
    samples = f'{len(motion.t)} samples of {", ".join(JOINT_NAMES)} (position, voltage, torque)'
    assert samples in ' '.join(told.out.split())
    log = read_log(tmp_path / 'bag', REFERENCE)
    assert log.accounts.findings() == ()  # efforts and voltages agree
    assert log.accounts.torque_source == 'amplifier_voltage'
    assert log.start_stamp == 1_700_000_000_000_000_000
    np.testing.assert_allclose(log.t, motion.t, atol=1e-6)
    np.testing.assert_allclose(log.q, motion.q, atol=1e-12)
    np.testing.assert_allclose(log.tau, torque, atol=1e-10)


@pytest.mark.parametrize(('columns', 'values', 'options'), [
    ('time=1:s position=2:rad torque=3:Nm', (T, Q, TAU), ()),
    ('time=1:us position=2:turn torque=3:mNm', (1e6 * T, Q / (2.0 * np.pi), 1e3 * TAU), ()),
    ('time=1:ns position=2:counts torque=3:A', (1e9 * T, Q / (2.0 * np.pi) * 4096, TAU / 0.05),
     ('--counts-per-turn', 4096, '--motor-gain', 0.05)),
    ('position=2:deg torque=3:mA', (T, np.degrees(Q), 1e3 * TAU / 0.05),
     ('--rate', 1.0 / PERIOD, '--motor-gain', 0.05)),
    ('time=1:0.125ms position=2:-0.1deg torque=3:2.69mA', (
        8e3 * T, -10.0 * np.degrees(Q), 1e3 * TAU / 0.05 / 2.69), ('--motor-gain', 0.05)),
    ('time=1:µs position=2:ticks torque=3:%', (1e6 * T, Q / (2.0 * np.pi) * 4096, TAU / 0.024),
     ('--counts-per-turn', 4096, '--rated-torque', 2.4)),
    ('time=1:s position=2:° torque=3:permille', (T, np.degrees(Q), TAU / 0.0024),
     ('--rated-torque', 2.4)),
    ("time=1:s position=2:rad torque=3:'0.5 N*m'", (T, Q, 2.0 * TAU), ()),
    ('time=1:ms position=2:rad voltage=3:V', (1e3 * T, Q, 0.5 * TAU), ()),
    ('time=1:s position=2:rad voltage=3:mV', (T + 700.0, Q, 500.0 * TAU), ()),
])
@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_an_axis_comes_back_from_any_unit(columns, values, options, storage, tool, tmp_path):
    np.savez(tmp_path / 'log.npz', run=np.stack(values))
    told = tool(tmp_path / 'log.npz', '--columns', columns, '--joints', 'motor', '--output',
                tmp_path / 'bag', '--storage', storage, *options)
    assert told.code == 0, told.err
    log = read_log(tmp_path / 'bag', axis())
    assert log.accounts.findings() == ()
    assert log.start_stamp == 1_000_000_000
    np.testing.assert_allclose(log.t, T, atol=1e-9)
    np.testing.assert_allclose(log.q[:, 0], Q, atol=1e-12)
    np.testing.assert_allclose(log.tau[:, 0], TAU, atol=1e-12)


def test_an_axis_with_torques_needs_no_gain(tool, tmp_path):
    path = csv(tmp_path / 'log.csv', t=T, q=Q, tau=TAU, volts=0.5 * TAU)
    robot = tmp_path / 'axis.yaml'
    robot.write_text('{schema: par4/axis/1, name: bare, joint: motor, kind: revolute}')
    nobody_knows = ('voltages and no torque, and the robot file of bare has no gain; write '
                    'gain into it')
    told = tool(path, '--columns', 'time=t:s position=q:rad voltage=volts:V', '--robot', robot,
                '--output', tmp_path / 'bag')
    assert (told.code, told.err.count('\n')) == (2, 1)
    assert f'error: --columns: {nobody_knows}' in told.err
    machine = read_machine(robot)
    for name, columns, options in (('volts', 'voltage=volts:V', ('--joints', 'motor')),
                                   ('both', 'torque=tau:Nm voltage=volts:V', ('--robot', robot))):
        told = tool(path, '--columns', f'time=t:s position=q:rad {columns}', *options, '--output',
                    tmp_path / name)
        assert told.code == 0, told.err
    with pytest.raises(InputError, match=nobody_knows):
        read_log(tmp_path / 'volts', machine)
    log = read_log(tmp_path / 'both', machine)
    assert log.accounts.torque_source == 'effort'
    np.testing.assert_allclose(log.tau[:, 0], TAU, atol=1e-12)
    robot.write_text('{schema: par4/axis/1, name: bare, joint: motor, kind: revolute, gain: 2.0}')
    np.testing.assert_allclose(read_log(tmp_path / 'both', read_machine(robot)).tau[:, 0], TAU,
                               atol=1e-12)


@pytest.mark.parametrize(('quantity', 'unit', 'si'), [
    ('torque', 'Ncm', 0.01), ('torque', 'kN', 1000.0), ('position', 'cm', 0.01)])
def test_units_of_catalogues_are_read(quantity, unit, si, tool, tmp_path):
    units = {'position': 'rad' if unit == 'Ncm' else 'm', 'torque': 'N', quantity: unit}
    said = tool(csv(tmp_path / 'log.csv', t=T, q=Q, tau=TAU), '--columns',
                f'time=t:s position=q:{units["position"]} torque=tau:{units["torque"]}',
                '--joints', 'motor', '--output', tmp_path / 'bag')
    assert said.code == 0, said.err
    whole = {'position': Q, 'torque': TAU}[quantity]
    assert f'{quantity}: {si * whole.min():.4g} to {si * whole.max():.4g} ' in said.out


@pytest.mark.parametrize(('columns', 'told'), [
    ('position=q:rad velocity=qd:rad/s torque=tau:Nm', 0), ('velocity=qd:rad/s torque=tau:Nm', 1)])
def test_a_speed_that_repeats_matters_where_it_is_all_there_is(columns, told, tool, tmp_path):
    """Drives round their speeds; the position that was read beside it tells the motion."""
    rng = np.random.default_rng(4)
    held = np.maximum.accumulate(np.where(rng.random(len(T)) < 0.2, np.arange(len(T)), 0))
    said = tool(csv(tmp_path / 'log.csv', t=T, q=Q, qd=QD[held], tau=TAU), '--columns',
                f'time=t:s {columns}', '--joints', 'motor', '--output', tmp_path / 'bag')
    assert said.code == 0, said.err
    assert said.out.count('of the readings repeat while it moves') == told


@pytest.mark.parametrize('unit', UNITS['velocity'])
def test_a_speed_fits_its_position_in_every_unit_and_in_no_other(unit, tool, tmp_path):
    factors = {'rad/s': 1.0, 'deg/s': 180.0 / np.pi, 'turn/s': 0.5 / np.pi, 'rpm': 30.0 / np.pi,
               'counts/s': 500.0 / np.pi, 'm/s': 1.0, 'mm/s': 1e3, 'mm/min': 6e4}
    linear = unit in ('m/s', 'mm/s', 'mm/min')
    path = csv(tmp_path / 'log.csv', t=T, q=Q, qd=factors[unit] * QD, tau=TAU)
    for said, right in ((unit, True), ('mm/s' if unit == 'm/s' else 'm/s' if linear else
                                       'rpm' if unit == 'rad/s' else 'rad/s', False)):
        told = tool(path, '--columns', f'time=t:s position=q:{"m" if linear else "rad"} '
                    f'velocity=qd:{said} torque=tau:{"N" if linear else "Nm"}', '--joints',
                    'motor', '--output', tmp_path / f'bag {right}',
                    *(('--counts-per-turn', 1000) if said == 'counts/s' else ()))
        assert told.code == 0, told.err
        assert ('times the slope of the position' in told.out) == (not right)


@pytest.mark.parametrize('shift', [0.0, 3e-4])
@pytest.mark.parametrize('every', [1, 2])
@pytest.mark.parametrize('order', [1, -1])
def test_tables_beside_each_other_are_one_recording(order, every, shift, tool, tmp_path):
    """A logger wrote a file for each signal, with a time of its own and at another rate."""
    tau = 0.02 * QD
    files = [csv(tmp_path / 'angle.csv', t=T, q=Q),
             csv(tmp_path / 'one.csv', t=T[:200:every] + shift, tau=tau[:200:every]),
             csv(tmp_path / 'two.csv', t=T[200::every] + shift, tau=tau[200::every])]
    told = tool(*(files if order > 0 else (*files[1:], files[0])),
                '--columns', 'time=t:s position=q:rad torque=tau:Nm', '--joints', 'motor',
                '--output', tmp_path / 'bag')
    assert told.code == 0, told.err
    rows = len(T) if not shift else len(T) + len(T[::every])
    assert f'{rows} of {len(T) + len(T[::every])} rows of 2 tables beside each other' in told.out
    assert 'hold no number' not in told.out
    log = read_log(tmp_path / 'bag', axis())
    times = log.t + 1e-9 * (log.start_stamp - 1_000_000_000)
    np.testing.assert_allclose(log.q[:, 0], np.interp(times, T, Q), atol=2e-3)
    np.testing.assert_allclose(log.tau[:, 0], np.interp(times, T + shift, tau), atol=2e-3)
    assert len(log.t) > 0.9 * len(T) / every


def test_a_stamp_that_is_repeated_in_one_of_two_tables_takes_nothing_apart(tool, tmp_path):
    again = np.insert(np.arange(len(T)), 200, 199)
    told = tool(csv(tmp_path / 'angle.csv', t=T[again], q=Q[again]),
                csv(tmp_path / 'torque.csv', t=T, tau=0.02 * QD), '--columns',
                'time=t:s position=q:rad torque=tau:Nm', '--joints', 'motor', '--output',
                tmp_path / 'bag')
    assert told.code == 0, told.err
    assert f'position: {len(T) + 1} rows' in told.out
    assert f'bag: {len(T) + 1} samples of motor' in told.out  # no row takes the place of another
    assert f'torque: {len(T)} rows' in told.out
    assert told.out.count('at 500 Hz') == 2
    assert told.out.count('0 gaps') == 2
    np.testing.assert_allclose(read_log(tmp_path / 'bag', axis()).tau[:, 0], 0.02 * QD, atol=1e-9)


def test_gaps_of_each_table_are_told(tool, tmp_path):
    kept = np.abs(T - 0.4) > 0.05
    told = tool(csv(tmp_path / 'angle.csv', t=T, q=Q),
                csv(tmp_path / 'torque.csv', t=T[kept] + 7e-4, tau=TAU[kept]), '--columns',
                'time=t:s position=q:rad torque=tau:Nm', '--joints', 'motor', '--output',
                tmp_path / 'bag')
    lines = [line for line in told.out.splitlines() if 'rows, ' in line]
    assert [line.partition(':')[0] for line in lines] == ['position', 'torque']
    assert '0 gaps' in lines[0]
    assert '1 gaps, the longest 0.104 s' in lines[1]


def test_times_of_day_of_two_tables_are_those_of_one_night(tool, tmp_path):
    """The recording begins before midnight; the second file has its rows after it alone."""
    files = []
    for name, first, values in (('q', 0, Q), ('tau', 150, TAU)):
        rows = [f'{_clock(86399.8 + time)},{value!r}' for time, value in zip(
            T[first:].tolist(), values[first:].tolist())]
        path = tmp_path / f'{name}.csv'
        path.write_text('\n'.join([f't,{name}', *rows]) + '\n')
        files.append(path)
    told = tool(*files, '--columns', 'time=t:clock position=q:rad torque=tau:Nm', '--joints',
                'motor', '--output', tmp_path / 'bag')
    assert told.code == 0, told.err
    log = read_log(tmp_path / 'bag', axis())
    np.testing.assert_allclose(log.q[:, 0], Q[150:], atol=1e-9)


def _clock(seconds):
    """Return a time of day as loggers write it."""
    seconds %= 86400.0
    return f'{int(seconds // 3600):02d}:{int(seconds % 3600 // 60):02d}:{seconds % 60:09.6f}'


def test_joints_of_a_quantity_in_several_files_are_refused_by_name(tool, tmp_path):
    told = tool(csv(tmp_path / 'one.csv', t=T, q0=Q, i0=TAU), csv(tmp_path / 'two.csv', t=T, q1=Q),
                '--columns', 'time=t:s position=q0,q1:rad torque=i0,i1:Nm', '--joints', 'a,b',
                '--output', tmp_path / 'bag')
    assert told.code == 2
    assert 'one.csv: has some columns of position (q0, q1) only' in told.err


@pytest.mark.parametrize(('angles', 'torques', 'words'), [
    ({'t': T, 'q': Q}, {'s': T, 'tau': TAU}, "no column 'tau'"),  # no common time
    ({'t': T, 'q': Q}, {'t': T, 'current': TAU}, 'torques.csv: has none of the columns q, tau'),
    ({'t': T, 'q': Q}, {'t': T + 100.0, 'tau': TAU}, 'of one clock in one unit'),
    ({'t': T, 'q': Q}, {'t': 1e3 * T, 'tau': TAU}, 'of one clock in one unit'),
    ({'t': T, 'q': Q}, {'t': T[:5], 'tau': TAU[:5]}, 'torques.csv: 5 rows with a time'),
    ({'t': T, 'q': Q, 'tau': TAU}, {'t': T, 'tau': TAU}, 'both have torque'),
    ({'t': T, 'q': Q}, {'t': T[::-1], 'tau': TAU}, 'torques.csv: its time goes back')])
def test_files_that_are_no_tables_of_one_recording_are_refused(angles, torques, words, tool,
                                                               tmp_path):
    told = tool(csv(tmp_path / 'angles.csv', **angles), csv(tmp_path / 'torques.csv', **torques),
                '--columns', 'time=t:s position=q:rad torque=tau:Nm', '--joints', 'motor',
                '--output', tmp_path / 'bag')
    assert told.code == 2
    assert words in told.err
    assert len(told.err.splitlines()) == 1
    assert not (tmp_path / 'bag').exists()


def test_a_table_that_has_nothing_in_the_part_that_is_meant_is_refused(tool, tmp_path):
    told = tool(csv(tmp_path / 'angles.csv', t=T, q=Q),
                csv(tmp_path / 'torques.csv', t=T[:200], tau=TAU[:200]), '--columns',
                'time=t:s position=q:rad torque=tau:Nm', '--joints', 'motor', '--between', '0.5',
                '0.8', '--output', tmp_path / 'bag')
    assert told.code == 2
    assert 'torques.csv: 0 of 200 rows are left, at least 20 are needed' in told.err
    assert len(told.err.splitlines()) == 1
    assert not (tmp_path / 'bag').exists()


@pytest.mark.parametrize(('columns', 'told'), [
    ('position=angle_deg:rad torque=tau:Nm', ["position: column 'angle_deg' is read in rad, its "
                                              'name says deg; if it is right, give '
                                              'position=angle_deg:deg']),
    ('position=angle_deg:deg torque=tau:Nm', []),
    ("position='q (rad)':deg torque='load [mNm]':'N m'", ['says rad', 'says mNm']),
    ("position='q (rad)':rad torque='load [mNm]':mNm", []),
    ('position=2:rad velocity=speed_rpm:rad/s torque=tau:Nm', ['says rpm']),
    ('position=pos_m:rad torque=turn_A:Nm', []),
    ("position='pos [m]':mm torque='current (A)':N", ['says m', 'says A']),
    ("position='q [°]':0.1deg torque='load [%]':N*m", ['says %']),
    ("position='q (raw)':0.1deg torque='load_mA':2.69mA", []),
    ("position='pos [inc]':0.5um torque=F:kN", []),
    ("position='q [rad]':0.1deg torque=tau:Nm", ["give position='q [rad]':rad"]),
    ("position='pos [inc]':um torque=F:kN", ["give position='pos [inc]':counts"]),
    ('time=t_ms:s position=rad_or_deg:deg torque=degree:Nm', ['says ms'])])
def test_a_column_whose_name_says_another_unit_is_told(columns, told):
    found = named_otherwise(chosen_columns(columns))
    assert len(found) == len(told)
    assert all(words in line for line, words in zip(found, told))


def test_such_a_column_is_pointed_at_beside_what_looks_wrong(tool, tmp_path):
    said = tool(csv(tmp_path / 'log.csv', t=T, q_deg=np.degrees(Q), tau=TAU), '--columns',
                'time=t:s position=q_deg:rad torque=tau:Nm', '--joints', 'motor', '--output',
                tmp_path / 'bag')
    assert said.code == 0
    assert "look at this: position: column 'q_deg' is read in rad" in ' '.join(said.out.split())


@pytest.mark.parametrize(('torque', 'gravity', 'told'), [
    (np.abs(QD), None, 1), (np.abs(QD), 'none', 1), (np.abs(QD), 'vertical', 0), (QD, None, 0),
    (5.0 + QD, None, 0)])
def test_a_torque_without_a_sign_is_told(torque, gravity, told, tool, tmp_path):
    """That of a joint which holds a weight may have one sign."""
    machine = '--joints', 'motor'
    if gravity is not None:
        machine = '--robot', tmp_path / 'axis.yaml'
        machine[1].write_text('{schema: par4/axis/1, name: lift, joint: motor, kind: revolute, '
                              f'gravity: {gravity}}}')
    said = tool(csv(tmp_path / 'log.csv', t=T, q=Q, tau=torque), '--columns',
                'time=t:s position=q:rad torque=tau:Nm', *machine, '--output', tmp_path / 'bag')
    assert said.code == 0
    assert said.out.count('is its sign lost?') == told


def test_positions_that_jump_do_not_spoil_the_look_at_speeds(tool, tmp_path):
    """Where trials are joined the joint was brought elsewhere."""
    q = Q + 3.0 * (np.arange(len(Q)) >= 100) - 2.0 * (np.arange(len(Q)) >= 200)
    said = tool(csv(tmp_path / 'log.csv', t=T, q=q, qd=QD, tau=TAU), '--columns',
                'time=t:s position=q:rad velocity=qd:rad/s torque=tau:Nm', '--joints', 'motor',
                '--output', tmp_path / 'bag')
    assert said.code == 0
    assert 'velocity of joint 0' not in said.out


def test_the_velocity_of_an_axis_will_do_for_a_position(tool, tmp_path):
    slow, fast = QD.copy(), QD.copy()
    fast[37] = np.nan
    for name, velocity in (('whole', slow), ('gap', fast)):
        told = tool(csv(tmp_path / f'{name}.csv', t=T, qd=velocity, tau=TAU), '--columns',
                    'time=t:s velocity=qd:rad/s torque=tau:Nm', '--joints', 'motor', '--output',
                    tmp_path / name)
        assert told.code == 0, told.err
        assert 'no position: it is the integral of the velocity' in told.out
        assert 'position: 1 of' not in told.out
        q = read_log(tmp_path / name, axis()).q[:, 0]
        np.testing.assert_allclose(q - q[0], Q - Q[0], atol=2e-3 * np.ptp(Q))
    told = tool(tmp_path / 'whole.csv', '--columns', 'time=t:s velocity=qd:rad/s torque=tau:Nm',
                '--joints', 'motor', '--output', tmp_path / 'turned', '--unwrap')
    assert '--unwrap is for positions; these are the integral of the velocity' in told.err
    with pytest.raises(InputError, match='found velocity, torque; needed are position'):
        chosen_columns('velocity=1-4:rad/s torque=5-8:Nm')


@pytest.mark.parametrize('column', ['position=q:rad', 'velocity=qd:rad/s'])
def test_what_a_joint_moves_while_the_logger_pauses_is_no_wrap(tool, tmp_path, column):
    """A bench that logs each of its speeds for a while was told to unwrap its encoder."""
    time = np.arange(0.0, 12.0, 0.002)
    speed = np.where(time < 6.0, 20.0, 30.0)
    q = np.cumsum(0.002 * speed)
    kept = (time % 3.0) < 1.0
    told = tool(csv(tmp_path / 'log.csv', t=time[kept], q=q[kept], qd=speed[kept],
                    tau=0.1 + 0.01 * speed[kept]), '--columns',
                f'time=t:s {column} torque=tau:Nm', '--joints', 'motor', '--output',
                tmp_path / 'bag')
    assert '3 gaps, the longest 2' in told.out
    assert 'jumps' not in told.out


def test_a_fast_motor_in_a_slow_log_is_no_encoder_that_wraps(tool, tmp_path):
    """At 10 turns a second and 30 Hz a wheel goes on by 0.4 turns between two late readings."""
    time = np.cumsum(np.random.default_rng(4).choice((0.02, 0.033, 0.06), 1500))
    speed = 2.0 * np.pi * np.interp(time % 10.0, (0.0, 6.0, 7.0, 9.0, 10.0), (1, 1, -10, -10, 1))
    q = np.cumsum(speed * np.diff(time, prepend=0.0))
    common = ('--columns', 'time=t:s position=q:rad torque=tau:Nm', '--joints', 'wheel', '--output')
    told = tool(csv(tmp_path / 'log.csv', t=time, q=q, tau=np.sign(speed)), *common,
                tmp_path / 'bag')
    assert 'jumps' not in told.out
    q[700:] += 2.0 * np.pi
    told = tool(csv(tmp_path / 'one.csv', t=time, q=q, tau=np.sign(speed)), *common,
                tmp_path / 'one')
    assert 'at row 701; where the encoder wraps around' in told.out


def test_a_part_of_a_log_and_an_encoder_that_wraps(tool, tmp_path):
    turns = 3.0 * T / T[-1]
    path = csv(tmp_path / 'log.csv', t=T, q=turns % 1.0, tau=TAU)
    common = (path, '--columns', 'time=t:s position=q:turn torque=tau:Nm', '--joints', 'motor',
              '--between', 0.2, 0.6)
    told = tool(*common, '--output', tmp_path / 'wrapped')
    assert 'jumps by 0.99' in told.out
    assert '--unwrap' in told.out
    speed = np.full(len(T), 3.0 / T[-1])
    told = tool(csv(tmp_path / 'fast.csv', t=T, q=turns % 1.0, qd=speed, tau=TAU), '--columns',
                'time=t:s position=q:turn velocity=qd:turn/s torque=tau:Nm', '--joints', 'motor',
                '--between', 0.4, 0.6, '--output', tmp_path / 'fast')
    assert re.search(r'jumps by [0-9.]+ turns at row \d+; where', told.out)
    assert 'not the slope' not in told.out
    told = tool(*common, '--output', tmp_path / 'bag', '--unwrap')
    assert 'look at this' not in told.out
    log, rows = read_log(tmp_path / 'bag', axis()), (T >= 0.2) & (T <= 0.6)
    assert len(log.t) == rows.sum() == 201
    np.testing.assert_allclose(log.q[:, 0] - log.q[0, 0],
                               2.0 * np.pi * (turns[rows] - turns[rows][0]), atol=1e-9)


def test_positions_go_on_behind_cells_that_hold_no_number(tool, tmp_path):
    """A turn is not lost where a cell is empty, whichever joint and wherever it is."""
    turns = 3.0 * T / T[-1]
    wrapped, other = turns % 1.0, (0.5 - turns) % 1.0
    wrapped[[0, 150, 151, -1]] = np.nan
    path = csv(tmp_path / 'log.csv', t=T, p=wrapped, q=other, tau=TAU, u=TAU)
    told = tool(path, '--columns', 'time=t:s position=p,q:turn torque=tau,u:Nm', '--joints',
                'a,b', '--unwrap', '--output', tmp_path / 'bag')
    assert 'position: 4 of 800 cells hold no number' in told.out
    assert 'jumps' not in told.out
    measured = measured_of_files([path], chosen_columns(
        'time=t:s position=p,q:turn torque=tau,u:Nm'), part=Part(unwrap=True))
    for q, expected in zip(measured.values['position'].T, (turns, -turns)):
        off = q / (2.0 * np.pi) - expected
        known = np.isfinite(off)
        assert known.sum() >= COUNT - 4
        np.testing.assert_allclose(off[known], off[known][0], atol=1e-9)


def test_what_looks_wrong_is_said(tool, tmp_path):
    t, tau = T.copy(), TAU.copy()
    t[100:] += 0.05  # a gap
    t[200] = t[199]
    t[300:] -= 0.4
    t[350] = np.nan
    tau[10:15] = np.nan
    path = csv(tmp_path / 'log.csv', t=t, q=2e4 * np.rint(10.0 * Q), qd=np.zeros(COUNT), tau=tau)
    told = tool(path, '--columns', COLUMNS, '--joints', 'motor', '--output', tmp_path / 'bag')
    assert told.code == 0, told.err
    for words in ('399 of 400 rows', '3 gaps', 'the longest 0.052 s', '1 rows without a time',
                  '1 stamps repeated', '1 times the clock goes back',
                  'torque: 5 of 399 cells hold no number',
                  'velocity of joint 0: the same in all rows'):
        assert words in told.out, words
    path = csv(tmp_path / 'counts.csv', t=T, q=np.rint(1e4 * Q), qd=np.flip(QD), tau=TAU)
    told = tool(path, '--columns', COLUMNS, '--joints', 'motor', '--output', tmp_path / 'counts')
    assert 'whole numbers up to' in told.out or 'jumps by' in told.out
    assert 'not the slope of the position' in told.out


@pytest.mark.parametrize(('name', 'rows', 'value', 'words'), [
    ('q', slice(None), np.nan, ('position: 400 of 400 cells hold no number',
                                'position of joint 0: no numbers; is it the right column?')),
    ('tau', slice(None), np.inf, ('torque of joint 0: no numbers; is it the right column?',)),
    ('q', slice(1, None), np.nan, ('position of joint 0: the same in all rows',)),
    ('q', 100, np.inf, ('position: 1 of 400 cells hold no number',)),
    ('q', slice(100, 102), np.inf, ('position: 2 of 400 cells hold no number',)),
    ('q', 100, 1e308, ('position: 1 of 400 cells are beyond 1e+12 rad; mend the file there',)),
    ('q', slice(100, 102), (-1.7e308, 1.7e308), ('position: 2 of 400 cells are beyond 1e+12',)),
    ('qd', 100, 1e308, ('velocity: 1 of 400 cells are beyond 1e+12 rad/s',)),
    ('tau', 100, 1e308, ('torque: 1 of 400 cells are beyond 1e+12 N m',)),
], ids=str)
@pytest.mark.parametrize('unwrap', [False, True])
def test_what_is_no_reading_is_said_and_nothing_else(unwrap, name, rows, value, words, tmp_path):
    """Neither a warning of numpy nor jumps by infinitely many turns."""
    columns = {'t': T, 'q': Q.copy(), 'qd': QD.copy(), 'tau': TAU.copy()}
    columns[name][rows] = value
    path = csv(tmp_path / 'log.csv', **columns)
    measured = measured_of_files([path], chosen_columns(COLUMNS), part=Part(unwrap=unwrap))
    assert measured.account()
    found = measured.findings()
    for line in words:
        assert any(one.startswith(line) for one in found), found
    assert all('cells' in one or 'right column' in one for one in found), found


@pytest.mark.parametrize(('kind', 'after', 'told'), [
    ('revolute', 0.12, True), ('linear', 0.12, True), ('linear', 9.0, False),
    ('revolute', 9.0, False)])
def test_a_counter_that_starts_again_behind_a_gear_is_told(kind, after, told):
    """Its wraps are no whole turns of the joint, so that --unwrap does not put them together."""
    fine = np.arange(20 * COUNT) * PERIOD / 20
    q = 0.5 * np.sin(2.0 * fine) % after
    found = Measured(kind, np.rint(1e9 * fine).astype(np.int64), {'position': q[:, None]},
                     len(q), 0).findings()
    assert any('as a counter that starts again' in line for line in found) == told, found


@pytest.mark.parametrize('missing', [slice(0), slice(100, 103), slice(50, 300)])
def test_the_rate_is_that_of_stamps_which_are_rounded(missing):
    """Dates are seconds since 1970, to a quarter of a microsecond; loggers round to as much."""
    stamp = np.delete(1_000_000 * np.arange(COUNT) + 700 * (np.arange(COUNT) % 7), missing)
    values = {'position': np.delete(Q, missing)[:, None]}
    measured = Measured('revolute', stamp, values, len(stamp), 0)
    assert ' s at 1000 Hz (every 1 ms +- 0.0017 ms rms), ' in measured.account()[0]


@pytest.mark.parametrize(('columns', 'kind', 'words'), [
    ({'t': 1e3 * T}, 'q:rad torque=tau:Nm', 'time: 2 s from row to row; is its unit right?'),
    ({'t': 1e-3 * T}, 'q:rad torque=tau:Nm', 'time: 2e-06 s from row to row'),
    ({'q': 1e5 * Q}, 'q:rad torque=tau:Nm', 'are the units of positions and times right?'),
    ({'q': 1e3 * Q}, 'q:m torque=tau:N', 'are the units of positions and times right?'),
    ({}, 'q:rad torque=tau:Nm', None), ({}, 'q:m torque=tau:N', None)])
def test_times_and_ways_that_no_machine_has_are_told(columns, kind, words, tmp_path):
    path = csv(tmp_path / 'log.csv', **{'t': T, 'q': Q, 'tau': TAU} | columns)
    found = measured_of_files([path], chosen_columns(f'time=t:s position={kind}')).findings()
    odd = [line for line in found if 'right?' in line]
    assert len(odd) == (words is not None)
    assert words is None or words in odd[0]


@pytest.mark.parametrize(('given', 'words'), [
    ((), None), ((8.0,), None), ((8.05,), None),
    ((0.08,), '--motor-gain 0.08: the robot file says 8 N m/A at the joint, behind its gear'),
    ((4.0,), 'the robot file says 8 N m/A at the joint, 2 times as much')])
def test_a_current_is_torque_by_the_gain_of_the_robot_file(given, words, tool, tmp_path):
    """The nameplate's is that of the motor, before the gear."""
    (tmp_path / 'robot.yaml').write_text(
        'schema: par4/axis/1\nname: elbow\njoint: elbow\nkind: revolute\ngain: 1.0\n'
        'gear_ratio: 100\nmotor_gain: 8.0\n')
    path = csv(tmp_path / 'log.csv', t=T, q=Q, current=TAU)
    options = ('--motor-gain', *given) if given else ()
    told = tool(path, '--columns', 'time=t:s position=q:rad torque=current:A', *options,
                '--robot', tmp_path / 'robot.yaml', '--output', tmp_path / 'bag')
    if words is not None:
        assert told.code == 2
        assert words in told.err
        return
    assert told.code == 0, told.err
    factor = given[0] if given else 8.0
    assert f'torque: {factor * TAU.min():.4g} to {factor * TAU.max():.4g} N m' in told.out


def test_a_share_is_torque_by_the_rated_torque_of_the_robot_file(tool, tmp_path):
    (tmp_path / 'robot.yaml').write_text('schema: par4/axis/1\nname: a\njoint: a\nkind: revolute\n'
                                         'rated_torque: 2.4\n')
    path = csv(tmp_path / 'log.csv', t=T, q=Q, load=TAU)
    words = (path, '--columns', 'time=t:s position=q:rad torque=load:%', '--robot',
             tmp_path / 'robot.yaml', '--output', tmp_path / 'bag')
    told = tool(*words, '--rated-torque', 2.5)
    assert told.code == 2
    assert '--rated-torque 2.5: the robot file says 2.4 N m at the joint, 0.96 times' in told.err
    told = tool(*words)
    assert told.code == 0, told.err
    assert f'torque: {0.024 * TAU.min():.4g} to {0.024 * TAU.max():.4g} N m' in told.out


@pytest.mark.parametrize(('kind', 'columns', 'words'), [
    ('revolute', 'position=q:mm torque=tau:N',
     'position in mm is of one that slides, {} says a joint that turns; mend kind in the robot '
     'file, or --columns\n'),
    ('linear', 'position=q:deg torque=tau:Nm',
     'position in deg is of a joint that turns, {} says one that slides; mend kind in the robot '
     'file, or --columns: of an encoder on the motor give the way of a count, such as '
     'position=2:0.5um\n')])
def test_a_unit_of_the_other_kind_of_axis_is_refused(kind, columns, words, tool, tmp_path):
    robot = tmp_path / 'robot.yaml'
    robot.write_text(f'schema: par4/axis/1\nname: a\njoint: a\nkind: {kind}\n')
    told = tool(csv(tmp_path / 'log.csv', t=T, q=Q, tau=TAU), '--columns', f'time=t:s {columns}',
                '--robot', robot, '--output', tmp_path / 'bag')
    assert told.code == 2
    assert told.err == f'error: {words.format(robot)}'


def test_a_counter_goes_on_whose_unit_turns_its_sign(tmp_path):
    counter = np.round(-Q * 1e3) % 256
    path = csv(tmp_path / 'log.csv', t=T, q=counter, tau=TAU)
    measured = measured_of_files(
        [path], chosen_columns('time=t:s position=q:-0.001rad torque=tau:Nm'),
        part=Part(wraps_after=256.0))
    way = measured.values['position'][:, 0]
    np.testing.assert_allclose(way - way[0], Q - Q[0], atol=1.1e-3)


def test_a_number_that_its_unit_makes_infinite_is_none(tmp_path):
    turns = Q / (2.0 * np.pi)
    turns[100] = 1e308
    path = csv(tmp_path / 'log.csv', t=T, q=turns, qd=QD, tau=TAU)
    measured = measured_of_files([path], chosen_columns(COLUMNS.replace('q:rad ', 'q:turn ')))
    assert measured.findings() == ('position: 1 of 400 cells hold no number',)


@pytest.mark.parametrize('value', [0.0, 0.7])
def test_a_column_that_stands_still_is_told_with_an_empty_cell_too(value, tmp_path):
    q = np.full(COUNT, value)
    q[5] = np.nan
    path = csv(tmp_path / 'log.csv', t=T, q=q, qd=QD, tau=TAU)
    found = measured_of_files([path], chosen_columns(COLUMNS)).findings()
    assert 'position of joint 0: the same in all rows; is it the right column?' in found


@pytest.mark.parametrize(('columns', 'twins'), [
    ('position=q,q:rad torque=tau,qd:Nm', ('position of joint 1', 'position of joint 0')),
    ('position=q,p:rad torque=tau,3:Nm', ('torque of joint 1', 'position of joint 0')),
    ('position=q,p:rad torque=tau,rest:Nm voltage=qd,zero:V', None)])
def test_columns_with_the_same_numbers_are_told(columns, twins, tmp_path):
    """It may be meant where two drives move one joint; those that rest are told as such."""
    q = Q.copy()
    q[7] = np.nan
    path = csv(tmp_path / 'log.csv', t=T, tau=TAU, q=q, qd=QD, p=2.0 * Q, rest=np.zeros(COUNT),
               zero=np.zeros(COUNT))
    found = [line for line in measured_of_files(
        [path], chosen_columns('time=t:s ' + columns)).findings() if 'the same numbers' in line]
    assert found == ([] if twins is None else [
        f'{twins[0]}: the same numbers as {twins[1]}; is it the right column?'])


@pytest.mark.parametrize('empty', [slice(0, 0), slice(150, 250), slice(None, None, 2)])
def test_a_speed_is_the_slope_across_gaps_and_empty_cells(empty, tmp_path):
    """What a machine did in a gap is not known; a wrong speed stands out all the same."""
    t, q = T + 3.0 * (T >= 0.4), Q.copy()
    q[empty] = np.nan
    for qd, wrong in ((QD, None), (100.0 * QD, 'times the slope of the position'),
                      (np.flip(Q), 'not the slope of the position')):
        path = csv(tmp_path / 'log.csv', t=t, q=q, qd=qd, tau=TAU)
        found = [line for line in measured_of_files([path], chosen_columns(COLUMNS)).findings()
                 if 'cells' not in line]
        if wrong is None:
            assert found == []
        else:
            line, = found
            assert line.startswith('velocity of joint 0: ')
            assert wrong in line


def test_a_span_of_an_array_is_its_columns():
    for mark in (' ', ',', ', '):  # entries may be parted by commas, as columns are
        chosen = chosen_columns(f'position=q[2-4]:rad{mark}torque=tau[1],tau[3],5:Nm')
        assert chosen['position'].columns == ('q[2]', 'q[3]', 'q[4]')
        assert chosen['torque'].columns == ('tau[1]', 'tau[3]', '5')


def test_dates_become_stamps(tool, tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text('t,q,tau\n' + ''.join(
        f'2026-01-01T00:00:{t:06.3f},{q!r},{tau!r}\n'
        for t, q, tau in zip(T.tolist(), Q.tolist(), TAU.tolist())))
    told = tool(path, '--columns', 'time=t:iso position=q:rad torque=tau:Nm', '--joints', 'motor',
                '--output', tmp_path / 'bag')
    assert told.code == 0, told.err
    log = read_log(tmp_path / 'bag', axis())
    assert log.start_stamp == pytest.approx(1_767_225_600 * 10 ** 9, abs=1000)
    assert log.period == pytest.approx(PERIOD, rel=1e-4)


def test_times_of_day_go_on_after_midnight(tool, tmp_path):
    path = tmp_path / 'log.csv'
    seconds = 86400.0 - 0.3 + T
    path.write_text('t;q;tau\n' + ''.join(
        f'{t // 3600 % 24:02.0f}:{t // 60 % 60:02.0f}:{t % 60:06.3f};{q!r};{tau!r}\n'
        for t, q, tau in zip(seconds.tolist(), Q.tolist(), TAU.tolist())))
    told = tool(path, '--columns', 'time=t:clock position=q:rad torque=tau:Nm', '--joints', 'motor',
                '--output', tmp_path / 'bag')
    assert told.code == 0, told.err
    assert 'look at this' not in told.out
    log = read_log(tmp_path / 'bag', axis())
    assert len(log.t) == COUNT
    assert log.period == pytest.approx(PERIOD, rel=1e-4)


@pytest.mark.parametrize('lowest', [0, -2 ** 15])
def test_a_counter_that_starts_again_goes_on(lowest, tool, tmp_path):
    """Its range is no whole number of turns, and the counter may have a sign."""
    counts = np.rint(20000.0 * np.linspace(-9.3, 14.0, COUNT)).astype(int)
    path = csv(tmp_path / 'log.csv', t=T, q=(counts - lowest) % 2 ** 16 + lowest, tau=TAU)
    options = (path, '--columns', 'time=t:s position=q:counts torque=tau:Nm', '--counts-per-turn',
               20000, '--joints', 'motor')
    assert '--wraps-after' in tool(*options, '--output', tmp_path / 'jumping').out
    told = tool(*options, '--wraps-after', 65536, '--output', tmp_path / 'bag')
    assert 'look at this' not in told.out
    q = read_log(tmp_path / 'bag', axis()).q[:, 0]
    np.testing.assert_allclose(q - q[0], 2.0 * np.pi / 20000.0 * (counts - counts[0]), atol=1e-9)


@pytest.mark.parametrize(('kind', 'unit'), [('revolute', 'rad'), ('linear', 'm')])
@pytest.mark.parametrize('rate', [47.0, 1000.0])
def test_a_bag_whose_counter_starts_again_is_read_as_one_that_counts_on(kind, unit, rate, tmp_path):
    """Stamps that are not even are no reason to interpolate across a restart."""
    t = np.arange(0.0, 40.0, 1.0 / rate) + np.random.default_rng(0).uniform(
        0.0, 0.01 / rate, round(40.0 * rate))
    q = 40.0 * np.sin(0.4 * t) + 3.0 * np.sin(1.3 * t)
    measured = Measured(kind, np.rint(1e9 * (1.0 + t)).astype(np.int64), {
        'position': ((q + 12.5) % 25.0 - 12.5)[:, None], 'torque': np.cos(t)[:, None]}, len(t), 0)
    said, = measured.findings()
    assert f'jumps by 25 {unit}' in said
    write_measured(measured, ('motor',), tmp_path / 'bag')
    log = read_log(tmp_path / 'bag', axis(kind=kind))
    count, way, told = log.bag_accounts.restarts['motor']
    assert count == np.count_nonzero(np.diff((q + 12.5) // 25.0))
    assert (way, told) == (pytest.approx(25.0, rel=1e-3), unit)
    assert any('as a counter that starts again; put together' in line
               for line in log.bag_accounts.of_clocks())
    off = log.q[:, 0] - np.interp(log.t, t - t[0], q)
    np.testing.assert_allclose(off, np.median(off), atol=0.05)


def test_readings_that_stray_to_one_place_are_no_counter():
    t = 1e-3 * np.arange(4000)
    q = 0.15 + 0.02 * np.sin(3.0 * t)
    q[500::700] = 0.198
    assert not any('starts again' in line for line in Measured(
        'linear', np.rint(1e9 * (1.0 + t)).astype(np.int64), {'position': q[:, None]}, len(t), 0
        ).findings())


@pytest.mark.parametrize('longest', [1, 60])
def test_readings_that_repeat_in_no_rhythm_are_told(longest):
    random, t = np.random.default_rng(6), 1e-3 * np.arange(20000)
    q = np.sin(3.0 * t) + 0.2 * np.sin(11.0 * t)
    fresh = np.cumsum(random.integers(1, longest + 1, len(t)))
    held = q[fresh[np.searchsorted(fresh, np.arange(fresh[0], len(t)), 'right') - 1]]
    found = [line for line in Measured('revolute', np.rint(1e9 * (1.0 + t[:len(held)])).astype(
        np.int64), {'position': held[:, None]}, len(held), 0).findings() if 'no rhythm' in line]
    assert len(found) == (longest > 1)
    assert all('for up to 60 ms' in line for line in found)


def with_dead_band(values, band):
    kept = [values[0]]
    for value in values[1:]:
        kept.append(value if abs(value - kept[-1]) >= band else kept[-1])
    return np.array(kept)


@pytest.mark.parametrize(('position', 'torque', 'told'), [
    (lambda q: np.interp(np.arange(len(q)), np.arange(0, len(q), 16), q[::16]).round(6), None,
     'position of joint 0: bends every 16 rows and is straight between: interpolated'),
    (lambda q: np.round(q / 0.02) * 0.02, None,
     'position of joint 0: in steps of 0.02 rad, 0.8'),
    (None, lambda tau: with_dead_band(tau, 0.6), 'and never changes by less than 0.6'),
    (None, lambda tau: np.round(tau / 0.6) * 0.6, None),
    (None, lambda tau: np.repeat(tau[::100][np.random.default_rng(9).permutation(200)], 100), None),
    (lambda q: q.round(4), None, None), (None, None, None)])
def test_what_a_logger_made_of_readings_is_told(position, torque, told):
    """Not what coarse steps of a torque look like, nor one that is set to random levels."""
    t = 1e-3 * np.arange(20000)
    q = np.sin(3.0 * t) + 0.2 * np.sin(11.0 * t + 1.0)
    tau = (8.0 * np.cos(5.0 * t) + 2.0 * np.sin(17.0 * t)
           + np.random.default_rng(7).normal(0.0, 0.05, len(t)))
    values = {'position': q if position is None else position(q),
              'torque': tau if torque is None else torque(tau)}
    found = [line for line in Measured('revolute', np.rint(1e9 * (1.0 + t)).astype(np.int64), {
        name: column[:, None] for name, column in values.items()}, len(t), 0).findings()
        if 'changes every' not in line]
    assert len(found) == (told is not None)
    assert all(told in line for line in found)


def test_lengths_that_start_again_go_on(tmp_path):
    way = np.linspace(0.0, 33.0, COUNT)
    path = csv(tmp_path / 'log.csv', t=T, q=way % 10.0, tau=TAU)
    measured = measured_of_files([path], chosen_columns('time=t:s position=q:mm torque=tau:N'),
                                 part=Part(wraps_after=10.0))
    np.testing.assert_allclose(measured.values['position'][:, 0], 1e-3 * way, atol=1e-12)


# ---------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(('columns', 'words'), [
    ('position=q', "'position=q' is not QUANTITY=COLUMN:UNIT"),
    ('q:rad', "'q:rad' is not QUANTITY=COLUMN:UNIT"),
    ('angle=q:rad', 'angle: unknown; columns are time, position'),
    ('position=q:grad', "position: unit 'grad' is unknown; give one of rad, deg"),
    ('position=q:rad torque=tau:counts', "torque: unit 'counts' is unknown; give one of Nm, mNm, "
     'Ncm, N, kN, A, mA, %, permille, or how much of one it is, such as 2.69mA'),
    ('position=q:0deg torque=tau:Nm', "position: unit '0deg' is unknown"),
    ('position=q:1e99deg torque=tau:Nm', "position: unit '1e99deg' is unknown"),
    ('time=t:-1s position=q:deg torque=tau:Nm', "time: unit '-1s' is unknown"),
    ('time=t:2iso position=q:deg torque=tau:Nm', "time: unit '2iso' is unknown"),
    ('position=q:rad current=i:A', 'columns are time, position, velocity, torque, voltage, and a '
                                   'current is a torque in A'),
    ('position=q:rad', 'found position; needed are position and torque or voltage'),
    ('position=q:rad position=p:rad torque=3:Nm', 'position is given twice'),
    ('position=1,2:rad torque=3:Nm', 'torque has 1 columns, expected 2, as position has'),
    ('time=1-2:s position=3:rad torque=4:Nm', 'time has 2 columns, expected 1'),
    ('position=1:m torque=2:Nm', 'position in m, torque in Nm; a joint turns or slides'),
    ("position='q:rad", 'close the quotes'),
    ('position=joint angle:rad torque=3:Nm', "write for example 'time=1:ms position=angle:deg "
     "torque=current:A', a name with spaces as torque='motor current':A"),
    ('position=q[3-1]:rad torque=tau[1-3]:Nm', "'q[3-1]' is no span"),
    ('position=1-4:rad torque=1-4:Nm', '1 is position and torque; a column is one of them'),
    ('time=t:s position=q:rad torque=t:Nm', 't is time and torque; a column is one of them'),
])
def test_columns_that_make_no_sense_are_refused(columns, words):
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        chosen_columns(columns)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(('options', 'words'), [
    (('--columns', COLUMNS), 'no names for 1 columns of positions: name the joints by --joints'),
    (('--columns', COLUMNS, '--joints', 'a,b'), '2 joints (a, b), the positions have 1 columns'),
    (('--columns', COLUMNS, '--joints', 'a', '--robot', 'reference'), 'give one of them'),
    (('--columns', COLUMNS, '--robot', 'reference'), '4 joints'),
    (('--columns', COLUMNS, '--joints', 'a', '--rate', 500), 'not both'),
    (('--columns', 'position=q:rad torque=tau:Nm', '--joints', 'a'), 'or --rate in Hz'),
    (('--columns', 'time=t:s position=q:rad torque=current:A', '--joints', 'a'),
     'torque in A: give --motor-gain, the torque at the joint per ampere'),
    (('--columns', 'time=t:s position=q:rad torque=tau:%', '--joints', 'a'),
     'torque in %: give --rated-torque, the rated torque at the joint, N m (on a slide N), that of '
     'the nameplate times the gear ratio; or write it into the robot file as rated_torque; where '
     'nobody knows it, 100 gives torques in percent'),
    (('--columns', 'time=t:s position=q:counts torque=tau:Nm', '--joints', 'a'),
     'position in counts: give --counts-per-turn, the counts of the encoder for one turn of the '
     'joint, behind its gear; of a slide give the way of a count instead, such as '
     'position=2:0.5um'),
    (('--columns', COLUMNS, '--joints', 'a', '--rated-torque', 2.4),
     '--rated-torque is for % or permille, found time in s'),
    (('--columns', 'time=t:s position=q:rad torque=tau:A', '--joints', 'a'),
     'N m/A (on a slide N/A), that of the nameplate times the gear ratio; or write it into the '
     'robot file as motor_gain'),
    (('--columns', 'time=t:s position=q:counts torque=tau:Nm', '--joints', 'a',
      '--counts-per-turn', '8,9'), '--counts-per-turn has 2 numbers'),
    (('--columns', COLUMNS, '--joints', 'a', '--counts-per-turn', 4096),
     '--counts-per-turn is for counts or counts/s, found time in s, position in rad, velocity in '
     'rad/s, torque in Nm; mend --columns or leave it out'),
    (('--columns', COLUMNS, '--joints', 'a', '--motor-gain', 0.1),
     '--motor-gain is for A or mA, found time in s, position in rad'),
    (('--columns', 'time=t:s position=angle:rad torque=tau:Nm', '--joints', 'a'),
     "no column 'angle'; there are 4: t, q, qd, tau"),
    (('--columns', 'time=t:us position=q:rad torque=tau:Nm', '--joints', 'a'),
     'median spacing of the samples is 2e-09 s'),
    (('--columns', COLUMNS, '--joints', 'a', '--between', 5, 6),
     '0 of 400 rows are left, at least 20 are needed, the time goes from 0 to 0.798 s; give a '
     'longer log, or more of it by --between'),
    (('--columns', COLUMNS, '--joints', 'a', '--between', 0.5, 0.2),
     '--between 0.5 0.2: ends before it has begun'),
    (('--columns', COLUMNS, '--joints', 'a', '--array', 'run'), 'is for .npz and .mat'),
    (('--columns', 'time=t:s position=q:mm torque=tau:N', '--joints', 'a', '--unwrap'),
     '--unwrap is for joints that turn'),
    (('--columns', COLUMNS, '--joints', 'a', '--unwrap', '--wraps-after', 3.0),
     'for jumps by a turn of the joint, --wraps-after for others: give one of them'),
    (('--columns', 'time=t:s velocity=qd:rad/s torque=tau:Nm', '--joints', 'a', '--wraps-after', 3),
     '--wraps-after is for positions; these are the integral of the velocity'),
    (('--columns', COLUMNS, '--joints', 'a', '--wraps-after', 0),
     "--wraps-after: expected a number above 0, found '0'"),
    (('--columns', COLUMNS, '--joints', 'a', '--motor-gain', '-1'), 'expected a positive number'),
    ((), "Missing option '--columns'"),
])
def test_bad_input_is_one_line_and_leaves_nothing(options, words, tool, tmp_path):
    path = csv(tmp_path / 'log.csv', t=T, q=Q, qd=QD, tau=TAU)
    told = tool(path, *options, '--output', tmp_path / 'bag')
    assert told.code == 2
    line, = told.err.strip().splitlines()
    assert line.startswith('error: ')
    assert words in line
    assert os.listdir(tmp_path) == ['log.csv']


def test_a_time_that_no_stamp_holds_is_refused(tool, tmp_path):
    """As a flipped bit makes it of one sample."""
    late = T.copy()
    late[-1] = 1e300
    path = csv(tmp_path / 'log.csv', t=late, q=Q, qd=QD, tau=TAU)
    told = tool(path, '--columns', COLUMNS, '--joints', 'a', '--output', tmp_path / 'bag')
    assert told.code == 2
    assert 'the time goes from 0 to 1e+300 s, beyond what a stamp holds' in told.err
    assert not (tmp_path / 'bag').exists()


@pytest.mark.parametrize(('first', 'second'), [(5.0, 0.0), (2e8, -1.0)])
def test_a_clock_that_goes_back_far_leaves_every_sample_its_stamp(first, second, tool, tmp_path):
    """Stamps before zero mean that there is none: half of the samples were lost."""
    time = np.where(T < 0.4, T + first, T - 0.4 + second)
    path = csv(tmp_path / 'log.csv', t=time, q=Q, qd=QD, tau=TAU)
    told = tool(path, '--columns', COLUMNS, '--joints', 'motor', '--output', tmp_path / 'bag')
    assert told.code == 0, told.err
    assert '1 times the clock goes back' in told.out
    assert '400 of 400 rows, 0.796 s at 500 Hz' in told.out  # it was the last time less the first
    log = read_log(tmp_path / 'bag', axis())
    assert not any('stamp' in finding for finding in log.accounts.findings())
    np.testing.assert_allclose(log.q[:, 0], Q, atol=1e-12)


def test_files_must_follow_each_other_and_a_bag_is_never_replaced(tool, tmp_path):
    path = csv(tmp_path / 'log.csv', t=T, q=Q, qd=QD, tau=TAU)
    told = tool(path, path, '--columns', COLUMNS, '--joints', 'a', '--output', tmp_path / 'bag')
    assert told.code == 2
    assert 'begins at 0 s, before' in told.err
    for code in (0, 2):
        told = tool(path, '--columns', COLUMNS, '--joints', 'a', '--output', tmp_path / 'bag')
        assert told.code == code
    assert 'exists already' in told.err


@pytest.mark.parametrize('empty', [((), (0,)), ((-1,), ()), ((-2, -1), (0, 1))])
def test_files_follow_each_other_where_cells_of_time_are_empty(empty, tool, tmp_path):
    """The second one "begins at 0.4 s, before the first one ends at nan s"."""
    half, times, files = COUNT // 2, [T[:COUNT // 2].copy(), T[COUNT // 2:].copy()], []
    for number, (time, places) in enumerate(zip(times, empty)):
        rows = slice(number * half, (number + 1) * half)
        time[list(places)] = np.nan
        files.append(csv(tmp_path / f'{number}.csv', t=time, q=Q[rows], qd=QD[rows],
                         tau=TAU[rows]))
    told = tool(*files, '--columns', COLUMNS, '--joints', 'a', '--output', tmp_path / 'bag')
    assert told.code == 0, told.err
    assert f'{sum(map(len, empty))} rows without a time, left out' in told.out
    told = tool(*files[::-1], '--columns', COLUMNS, '--joints', 'a', '--output', tmp_path / 'no')
    assert told.code == 2
    assert f'begins at 0 s, before {files[1]} ends at 0.798 s' in told.err


@pytest.mark.parametrize('order', [('full', 'empty'), ('empty', 'full')])
def test_a_file_whose_columns_are_empty_is_named(order, tool, tmp_path):
    for name, count in (('full', COUNT), ('empty', 0)):
        np.savez(tmp_path / f'{name}.npz', t=T[:count], q=Q[:count], qd=QD[:count],
                 tau=TAU[:count])
    told = tool(*(tmp_path / f'{name}.npz' for name in order), '--columns', COLUMNS, '--joints',
                'a', '--output', tmp_path / 'bag')
    assert told.code == 2
    assert told.err == f'error: {tmp_path / "empty.npz"}: its columns are empty; leave it out\n'


def test_a_bag_goes_where_a_link_leads(tool, tmp_path):
    path = csv(tmp_path / 'log.csv', t=T, q=Q, qd=QD, tau=TAU)
    (tmp_path / 'link').symlink_to(tmp_path / 'elsewhere' / 'bag')
    for code in (0, 2):
        told = tool(path, '--columns', COLUMNS, '--joints', 'a', '--output', tmp_path / 'link')
        assert told.code == code, told.err
    assert f'{tmp_path / "link"}: exists already' in told.err
    assert len(read_log(tmp_path / 'elsewhere' / 'bag', axis('a')).t) == COUNT


def in_its_own_process(*words, out, err, folder):
    """Return the exit code of the executable with other streams."""
    code = f'import sys; sys.argv = {["par4_bag", *map(str, words)]!r}\n' + (
        'from par4_identification_start import bag; bag()')
    return subprocess.run([sys.executable, '-c', code], cwd=folder, stdout=out, stderr=err,
                          check=False, timeout=200).returncode


@pytest.fixture
def unread():
    """Return a pipe that nobody reads any more."""
    reader, writer = os.pipe()
    os.close(reader)
    yield writer
    os.close(writer)


def test_a_bag_is_made_whether_or_not_its_words_are_read(unread, tmp_path):
    path = csv(tmp_path / 'log.csv', t=T, q=Q, qd=QD, tau=TAU)
    words = (path, '--columns', COLUMNS, '--joints', 'a', '--output')
    errors, full = tmp_path / 'errors', 'standard output: No space left on device; the work is done'
    with errors.open('w') as err, open('/dev/full', 'w') as no_room:
        for name, out, errs, code, said in (
                ('unread', unread, err, 0, ''), ('both', unread, unread, 0, ''),
                ('full', no_room, err, 2, full), ('all', no_room, no_room, 2, '')):
            assert in_its_own_process(*words, name, out=out, err=errs, folder=tmp_path) == code
            assert len(read_log(tmp_path / name, axis('a')).t) == COUNT
            assert said in errors.read_text()
            assert errors.read_text().count('\n') == bool(said)
            errors.write_text('')
            err.seek(0)


@pytest.mark.parametrize(('option', 'code'), [('--help', 0), ('--version', 0), ('--nothing', 2)])
def test_help_and_refusals_may_go_unread(option, code, unread, tmp_path):
    assert in_its_own_process(option, out=unread, err=unread, folder=tmp_path) == code


def test_a_robot_file_names_the_joints_and_must_fit(tool, tmp_path):
    path = csv(tmp_path / 'log.csv', t=T, q=Q, qd=QD, tau=TAU)
    robot = tmp_path / 'robot.yaml'
    for kind, code in (('linear', 2), ('revolute', 0)):
        robot.write_text(f'schema: par4/axis/1\nname: a\njoint: shaft\nkind: {kind}\ngain: 2.0\n',
                         encoding='utf-8')
        told = tool(path, '--columns', COLUMNS, '--robot', robot, '--output', tmp_path / 'bag')
        assert told.code == code
    np.testing.assert_allclose(read_log(tmp_path / 'bag', axis('shaft')).q[:, 0], Q)
    assert joint_names(None, None, 4) == JOINT_NAMES
    assert joint_names(REFERENCE, None, 4) == JOINT_NAMES


# ------------------------------------------------------------------------ the measured machines


def documented():
    """Return the commands of docs/measured.md that make bags of published data."""
    return [line for line in DOCS.read_text(encoding='utf-8').splitlines()
            if line.startswith('par4_bag $DATA')]


def runs_of(folder, command):
    """Return the names of the tables that a documented command is for."""
    if '--array' not in command:
        return ['']
    file = re.search(r'\$DATA/(\S+)', command)[1]
    with np.load(folder / file) as archive:
        tables = [name for name in archive.files if archive[name].ndim == 2]
    if file != 'laas.npz':
        return tables
    return [name for name in tables if ('torque=5:A' in command) == name.startswith('speed')]


def made(tool, folder, command, run, output):
    """Return the log of the bag that a documented command makes."""
    words = shlex.split(command.replace('$DATA', str(folder)).replace('$RUN', run))[1:]
    place = words.index('--output') + 1
    words[place] = str(output / words[place])
    told = tool(*words)
    assert told.code == 0, told.err
    joint = words[words.index('--joints') + 1]
    return told.out, read_log(words[place], axis(joint, 'linear' if joint == 'carriage' else
                                                 'revolute', 35.0))


def synthetic(folder):
    """Write archives of the layout of the measured ones."""
    rest = np.zeros(COUNT)
    turns, amps = Q / (2.0 * np.pi), TAU / 0.025
    np.savez(folder / 'laas.npz', speed_test=np.stack((T, Q, QD, rest, amps, rest), axis=1),
             accel=np.stack((T, Q, QD, amps, rest, rest), axis=1), table7200=np.arange(7200))
    np.savez(folder / 'odrive.npz', slow2__comp_0=np.stack((T, 8192 * turns, TAU / 0.0551)),
             kt_Nm_per_A=0.0551, map_static_A=rest)
    np.savez(folder / 'screws.npz', drive1__20=np.stack((T, Q, QD, TAU)),
             drive1__n20=np.stack((T, -Q, -QD, -TAU)))
    np.savez(folder / 'xl330.npz', mass=0.49, sin_sin__kp100=np.stack((
        T, Q, QD, TAU / 35.0, rest, rest, rest, rest)))
    savemat(folder / 'DATA_EMPS.mat', {'t': T[:, None], 'qm': Q[:, None],
                                       'vir': TAU[:, None] / 35.0, 'gtau': 35.0})


def test_the_documented_commands_make_bags_of_files_of_that_layout(tool, tmp_path):
    synthetic(tmp_path)
    commands = [line for line in documented() if '--between' not in line]  # of the whole file
    assert len(commands) == 6
    for command in commands:
        for run in runs_of(tmp_path, command):
            _, log = made(tool, tmp_path, command, run, tmp_path)
            sign = -1.0 if run == 'drive1__n20' else 1.0
            np.testing.assert_allclose(log.t, T, atol=1e-9)
            np.testing.assert_allclose(log.q[:, 0], sign * Q, atol=1e-9)
            np.testing.assert_allclose(log.tau[:, 0], sign * TAU, atol=1e-9)


def test_the_published_file_of_emps_becomes_a_bag(tool, tmp_path):
    path = data_path()
    if path is None:
        pytest.skip(f'{EMPS_VARIABLE} is not set')
    command, = (line for line in documented() if 'EMPS' in line)
    recording = read_recording(path)
    _, log = made(tool, path.parent, command.replace('DATA_EMPS.mat', path.name), '', tmp_path)
    np.testing.assert_allclose(log.q[:, 0], recording.position, atol=1e-9)
    np.testing.assert_allclose(log.tau[:, 0], 35.0 * recording.voltage, atol=1e-6)


def test_every_measured_run_becomes_a_bag(tool, tmp_path):
    """Of long lists of runs every eighth; what the archive holds comes back but for its clock."""
    if VARIABLE not in os.environ:
        pytest.skip(f'{VARIABLE} is not set')
    folder = Path(os.environ[VARIABLE])
    for command in documented():
        if 'EMPS' in command or '--between' in command:
            continue
        runs = runs_of(folder, command)
        for run in runs[::8] if len(runs) > 8 else runs:
            _, log = made(tool, folder, command, run, tmp_path)
            file = re.search(r'\$DATA/(\S+)', command)[1]
            with np.load(folder / file) as archive:
                table = archive[run] if archive[run].shape[0] < 10 else archive[run].T
            unit = 2.0 * np.pi / 8192 if 'counts' in command else 1.0
            inside = np.interp(log.t, table[0] - table[0, 0], unit * table[1])
            assert np.median(np.abs(log.q[:, 0] - inside)) < 1e-3 * np.ptp(log.q)
            assert len(log.t) > 0.98 * len(table[0]) or run == 'static'  # which holds and waits
