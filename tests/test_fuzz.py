"""Outside data of every kind at its worst: read, or refused in one line; `make fuzz` tries more."""

from __future__ import annotations

import io
import json
import multiprocessing
import resource
import shutil
import struct
import sys
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import click
import numpy as np
import pytest
import scipy
from fuzzing import bent, damaged, odd, refused_in_a_line
from hypothesis import given
from hypothesis import strategies as st

from executables import TOOLS
from node_bench import HOME_Q, MODULES, ROBOT, quintic_motion
from par4_dynamics.model_from_file import read_model
from par4_identification.gains.static_push import read_force
from par4_identification.jobs.inspect import inspect
from par4_identification.logs.bag_repair import repair_bag
from par4_identification.logs.column_choice import chosen_columns
from par4_identification.logs.measured_files import measured_of_files
from par4_identification.logs.read_log import read_log
from par4_identification.trend.bag_values import BagValues, EffectSize
from par4_identification.trend.kept import FOLDER, Kept
from par4_kinematics import motion_file, robot
from par4_kinematics.errors import LONGEST_LINE, InputError
from par4_kinematics.interface import AMPLIFIER_VOLTAGE, JOINT_STATES, REFERENCE
from par4_kinematics.motion_file import read_motion, read_samples
from par4_kinematics.ros.convert import joint_values, read_trajectory
from par4_kinematics.ros.goal_server import goal_motion, tolerances
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.ros.parameters import declare
from par4_kinematics.ros.serialised_trajectory import read_serialised_trajectory
from par4_sim.bags.bag_writer import BagWriter
from par4_sim.cell.cell import COMPOSITIONS
from par4_sim.commands import entry
from par4_sim.drives.reference_curve import ReferenceLimits

JOINTS = ROBOT.joint_names
BUILTIN = Path(robot.__file__).parent / 'builtin' / 'reference.yaml'
ROBOT_TEXT = BUILTIN.read_text()
AXIS_TEXT = """schema: par4/axis/1
name: slide
joint: slide
kind: linear
gain: 35.0
gear_ratio: 10.0
"""
MODEL_TEXT = """schema: par4/model/1
rigid_body: paper
parameters:
  actuator_inertia: {value: 0.113, std: 0.001, unit: kg m2}
  platform_mass_1: {value: 0.8043, std: 0.005, unit: kg}
  platform_mass_2: {value: 0.8594, std: 0.005, unit: kg}
  arm_gravity: {value: 1.33, std: 0.017, unit: N m}
  coulomb_friction: {value: [2.43, 2.4, 2.5, 2.4], std: 0.012, unit: N m}
  viscous_friction: {value: 2.04, std: 0.008, unit: N m s/rad}
effects:
  - effect: stribeck
    joints: [0, 1]
    parameters: {stribeck_torque: {value: 1.2, unit: N m},
                 stribeck_velocity: {value: 0.12, unit: rad/s}}
provenance: {bags: [a, b], date: 2026-01-01}
"""
MOTION_TEXT = """schema: par4/motion/1
recipe:
  kind: waypoints
  poses: [[0.0, 0.0, -0.7, 0.0], [0.05, 0.0, -0.7, 0.1]]
  speed: 1.0
  acceleration: 10.0
  dwell: 0.0
  period: 0.01
"""


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Return a folder for the files of all examples of this module."""
    return tmp_path_factory.mktemp('fuzz')


def written(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


# ------------------------------------------------------------------------------------------- YAML


@given(content=st.one_of(bent(ROBOT_TEXT), bent(AXIS_TEXT)))
def test_robot_files(folder, content):
    path = written(folder, 'robot.yaml', content)
    refused_in_a_line(lambda: robot.read_machine(path))


@given(content=bent(MODEL_TEXT))
def test_model_files(folder, content):
    path = written(folder, 'model.yaml', content)
    refused_in_a_line(lambda: read_model(path, ROBOT))


@given(content=bent(MOTION_TEXT))
def test_motion_files(folder, content):
    path = written(folder, 'motion.yaml', content)
    # what a recipe makes is computed in full, so that a long one takes seconds: keep it short
    with mock.patch('par4_kinematics.motion.MAX_SAMPLES', 20_000):
        refused_in_a_line(lambda: read_motion(path, ROBOT))


# ------------------------------------------------------------------------------------------- tables


def samples_text() -> str:
    motion = quintic_motion(np.asarray(quintic_motion.__globals__['AWAY_Q']), 0.02)
    rows = np.column_stack((motion.t, motion.q, motion.qd, motion.qdd))
    header = ','.join(('t', *motion_file.JOINT_COLUMNS))
    return '\n'.join([header, *(','.join(map(repr, row)) for row in rows.tolist()), ''])


SAMPLES_TEXT = samples_text()
FORCE_TEXT = 't,fx,fy,fz\n' + '\n'.join(f'{0.01 * row},0.0,0.5,{row}' for row in range(40)) + '\n'
TABLE = np.column_stack((np.arange(150) * 1e-3, np.sin(np.arange(150) / 20.0),
                         np.cos(np.arange(150) / 20.0)))
TABLE_TEXT = 't;q;tau\n' + '\n'.join(';'.join(map(repr, row)) for row in TABLE.tolist()) + '\n'


@given(content=bent(SAMPLES_TEXT), frame=st.sampled_from(('joint', 'platform')))
def test_samples_of_a_motion(folder, content, frame):
    path = written(folder, 'samples.csv', content)
    refused_in_a_line(lambda: read_samples(path, frame))


@given(content=bent(FORCE_TEXT))
def test_force_readings(folder, content):
    path = written(folder, 'push.csv', content)
    refused_in_a_line(lambda: read_force(path))


def measured(path: Path, columns: str) -> None:
    result = measured_of_files([path], chosen_columns(columns))
    result.account()
    result.findings()


@given(content=bent(TABLE_TEXT), turned=st.sampled_from((';', ',', '\t', ' ')))
def test_tables_of_loggers(folder, content, turned):
    path = written(folder, 'log.csv', content.replace(b';', turned.encode()))
    refused_in_a_line(lambda: measured(path, 'time=t:s position=q:rad torque=3:Nm'))


KEPT_TEXT = json.dumps(BagValues(
    'a', 7, 20.0, ('inertia', 'friction'), np.ones((1, 2)), np.eye(2),
    (EffectSize('backlash.gap', 1e-3, 1e-4, 'rad'),)).to_json(), indent=1)


@given(content=bent(KEPT_TEXT))
def test_results_of_bags_that_were_kept(folder, content):
    """What cannot be read is computed anew."""
    (folder / FOLDER).mkdir(exist_ok=True)
    written(folder, f'{FOLDER}/key.json', content)
    found = Kept(folder, ROBOT, None, None).read('key')
    assert found is None or BagValues.from_json(found, 'b').values.size


COLUMNS = {'t': TABLE[:, 0], 'q': TABLE[:, 1], 'tau': TABLE[:, 2]}


def numpy_archive() -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **COLUMNS)
    return stream.getvalue()


@given(content=damaged(numpy_archive()))
def test_archives_of_loggers(folder, content):
    path = written(folder, 'log.npz', content)
    refused_in_a_line(lambda: measured(path, 'time=t:s position=q:rad torque=tau:Nm'))


def matlab_archive(compressed: bool) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(stream, COLUMNS, do_compression=compressed)
    return stream.getvalue()


@given(content=st.one_of(damaged(matlab_archive(False)), damaged(matlab_archive(True))))
def test_matlab_files(folder, content):
    path = written(folder, 'log.mat', content)
    fork = multiprocessing.get_context('fork')  # what is loaded need not be loaded again
    with mock.patch.object(multiprocessing, 'get_context', return_value=fork):
        refused_in_a_line(lambda: measured(path, 'time=t:s position=q:rad torque=tau:Nm'))
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss < 2**21  # kB


def test_a_matlab_file_that_crashes_its_reader_is_refused_in_a_line(folder):
    path = folder / 'log.mat'
    scipy.io.savemat(path, COLUMNS)
    content = bytearray(path.read_bytes())
    for place, size in ((145, 0x7fffffff), (174, 0x80000000), (0, 0)):
        struct.pack_into('<I', content, place, size)
        path.write_bytes(content)
        with pytest.raises(InputError, match='log.mat: '):
            measured(path, 'time=t:s position=q:rad torque=tau:Nm')


@given(words=st.lists(st.one_of(odd, st.builds(
    '{}={}:{}'.format, st.sampled_from(('time', 'position', 'torque', 'voltage', 'x')),
    st.one_of(odd, st.builds('{}-{}'.format, st.integers(0, 10**12), st.integers(0, 10**12))),
    st.sampled_from(('s', 'rad', 'Nm', 'V', 'm', '')))), max_size=4))
def test_columns_of_a_command_line(words):
    refused_in_a_line(lambda: chosen_columns(' '.join(words)))


# ------------------------------------------------------------------------------------------- bags


@pytest.fixture(scope='module')
def bags(folder):
    """Return the files of a small bag of either storage, by name."""
    motion = quintic_motion(np.asarray(quintic_motion.__globals__['AWAY_Q']))
    found = {}
    for storage in ('mcap', 'sqlite3'):
        path = folder / f'whole_{storage}'
        with BagWriter(path, storage) as bag:
            for row in range(150):
                stamp = 10**9 + 2_000_000 * row
                bag.write_joint_state(f'/{JOINT_STATES.name}', stamp, JOINTS, motion.q[row],
                                      motion.qd[row], motion.qdd[row])
                bag.write_joint_state(f'/{AMPLIFIER_VOLTAGE.name}', stamp, JOINTS,
                                      effort=motion.qdd[row])
                if row % 50 == 0:
                    bag.write_trajectory(f'/{REFERENCE.name}', stamp, JOINTS, [0, 1_000_000],
                                         motion.q[:2], motion.qd[:2], motion.qdd[:2])
        assert read_log(path, ROBOT).accounts.samples == 150
        found[storage] = {file.name: file.read_bytes() for file in path.iterdir()}
    return found


def damaged_bag(folder: Path, files: dict[str, bytes], data: Any) -> Path:
    """Write a bag of which one file is damaged and return its path."""
    path = folder / 'bag'
    shutil.rmtree(path, ignore_errors=True)
    path.mkdir()
    victim = data.draw(st.sampled_from(sorted(files)))
    for name, content in files.items():
        if name != victim:
            (path / name).write_bytes(content)
        elif name.endswith('.yaml'):
            (path / name).write_bytes(data.draw(bent(content.decode())))
        else:
            (path / name).write_bytes(data.draw(damaged(content)))
    return path


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
@given(data=st.data())
def test_bags(folder, bags, storage, data):
    path, mended = damaged_bag(folder, bags[storage], data), folder / 'mended'
    shutil.rmtree(mended, ignore_errors=True)
    refused_in_a_line(lambda: read_log(path, ROBOT))
    if refused_in_a_line(lambda: repair_bag(path, mended)) is None:
        assert not mended.exists()
    else:
        refused_in_a_line(lambda: read_log(mended, ROBOT))


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
@given(data=st.data(), as_json=st.booleans())
def test_bags_that_are_inspected(folder, bags, storage, data, as_json):
    path = damaged_bag(folder, bags[storage], data)
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        refused_in_a_line(lambda: inspect(path, 'reference', None, as_json=as_json))


# ----------------------------------------------------------------------------------------- messages


values = st.one_of(st.floats(), st.sampled_from((1e160, -1e160, 1e308, 0.0)))
arrays = st.lists(values, max_size=6)
names = st.lists(st.one_of(st.sampled_from(JOINTS), st.text(max_size=2000)), max_size=6)
times = st.builds(SimpleNamespace, sec=st.integers(-2**31, 2**31 - 1),
                  nanosec=st.integers(0, 2**32 - 1))
headers = st.builds(SimpleNamespace, stamp=times)


@given(message=st.builds(SimpleNamespace, header=headers, name=names, position=arrays,
                         velocity=arrays, effort=arrays),
       field=st.sampled_from(('position', 'velocity', 'effort')))
def test_joint_states(message, field):
    refused_in_a_line(lambda: joint_values(message, field))


points = st.lists(st.builds(SimpleNamespace, positions=arrays, velocities=arrays,
                            accelerations=arrays, effort=arrays, time_from_start=times),
                  max_size=3)
fitting = st.lists(values, min_size=4, max_size=4)
fitting_points = st.lists(st.builds(
    SimpleNamespace, positions=fitting, velocities=fitting, accelerations=fitting, effort=fitting,
    time_from_start=times), max_size=3)
LIMITS = ReferenceLimits(ROBOT)


def taken(trajectory: Any) -> None:
    """Do with a trajectory what the simulation does before it follows it."""
    LIMITS.check(trajectory.times(0), np.hstack((trajectory.q, trajectory.qd, trajectory.qdd)))


@given(message=st.one_of(
    st.builds(SimpleNamespace, header=headers, joint_names=names, points=points),
    st.builds(SimpleNamespace, header=headers, joint_names=st.just(list(JOINTS)),
              points=fitting_points)))
def test_references(message):
    refused_in_a_line(lambda: taken(read_trajectory(message)))


tolerance_lists = st.lists(st.builds(
    SimpleNamespace, name=st.one_of(st.sampled_from(JOINTS), st.text(max_size=2000)),
    position=values), max_size=5)


@given(names=st.one_of(names, st.just(list(JOINTS))), items=st.one_of(points, fitting_points),
       header=st.one_of(headers, st.just(SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0)))),
       bounds=tolerance_lists)
def test_goals_of_an_action(names, items, header, bounds):
    goal = SimpleNamespace(trajectory=SimpleNamespace(header=header, joint_names=names,
                                                      points=items))
    refused_in_a_line(lambda: tolerances(bounds, 0.1))
    # a long way is sampled in full, which takes seconds: keep it short
    with mock.patch('par4_kinematics.motion.MAX_SAMPLES', 20_000):
        refused_in_a_line(lambda: goal_motion(goal, ROBOT, np.asarray(HOME_Q)))


def serialised() -> bytes:
    """Return a JointTrajectory of three points as CDR, written by hand."""
    parts = [b'\x00\x01\x00\x00', struct.pack('<iI', 1, 0), struct.pack('<I', 1), bytes(4),
             struct.pack('<I', 4)]
    for name in JOINTS:
        text = name.encode() + b'\x00'
        parts.append(struct.pack('<I', len(text)) + text + bytes(-len(text) % 4))
    body = b''.join(parts) + struct.pack('<I', 3)
    for point in range(3):
        for _ in range(3):
            body += struct.pack('<I', 4)
            body += bytes(-(len(body) - 4) % 8) + struct.pack('<4d', *quintic_motion.__globals__[
                'HOME_Q'])
        body += struct.pack('<I', 0) + struct.pack('<iI', point + 1, 0)
    return body


SERIALISED = serialised()


def test_the_message_to_be_damaged_is_a_whole_one():
    assert len(read_serialised_trajectory(SERIALISED).from_start_ns) == 3


@given(content=st.one_of(damaged(SERIALISED), st.binary(max_size=100)))
def test_serialised_references(content):
    refused_in_a_line(lambda: taken(read_serialised_trajectory(content)))


# ------------------------------------------------------------------------------------ command lines


COMMANDS = {name: next(item for item in vars(import_module(module)).values()
                       if isinstance(item, click.Command)) for name, module in TOOLS.items()}


@pytest.mark.parametrize('name', sorted(COMMANDS))
@given(data=st.data())
def test_command_lines(folder, name, data):
    """What the command then does with good words is not of interest here."""
    command = COMMANDS[name]
    options = [option for parameter in command.params for option in parameter.opts
               if option.startswith('-')]
    word = st.one_of(odd, st.sampled_from(['--', '-', '--help', '--nothing', str(folder),
                                           *options]),
                     st.builds('{}={}'.format, st.sampled_from(options or ['--x']), odd))
    words = data.draw(st.lists(word.filter(lambda text: '\x00' not in text), max_size=8))
    out, err = io.StringIO(), io.StringIO()
    with (mock.patch.object(command, 'callback', return_value=None),
          mock.patch.object(sys, 'argv', [name, *words]), redirect_stdout(out),
          redirect_stderr(err), pytest.raises(SystemExit) as stop):
        entry.run(command)
    said = err.getvalue()
    assert stop.value.code in (0, 2)
    assert (stop.value.code == 2) == bool(said), (words, said)
    assert len(said) <= LONGEST_LINE + len('error: \n')
    assert said.count('\n') == len(said.splitlines()) == (1 if said else 0)


@given(name=st.sampled_from(sorted(COMPOSITIONS)),
       given_texts=st.dictionaries(st.one_of(odd, st.sampled_from(
           [argument.name for argument in COMPOSITIONS['identification'].arguments])), odd,
           max_size=4))
def test_arguments_of_compositions(name, given_texts):
    refused_in_a_line(lambda: COMPOSITIONS[name].session(given_texts))


def parameters_of(node: str) -> type:
    node_class, = (value for value in vars(import_module(MODULES[node])).values()
                   if isinstance(value, type) and issubclass(value, Par4Node)
                   and value is not Par4Node)
    return node_class.PARAMETERS


@pytest.mark.parametrize('node', MODULES)
@given(data=st.data())
def test_parameters_of_nodes(node, data):
    parameters = parameters_of(node)
    known = list(parameters.__dataclass_fields__)
    texts = st.one_of(odd, st.floats(), st.integers(-2**63, 2**63 - 1), st.booleans(),
                      st.lists(st.integers(), max_size=1000), st.none())
    asked = data.draw(st.dictionaries(st.one_of(st.sampled_from(known), odd), texts, max_size=4))
    fake = mock.Mock()
    fake.get_parameters_by_prefix.return_value = {
        name: SimpleNamespace(value=value) for name, value in asked.items()}
    refused_in_a_line(lambda: declare(fake, parameters))


def test_aliases_that_stand_for_millions_of_values_are_refused_in_a_line(folder):
    """The one that once printed 25 MB."""
    from fuzzing import aliases

    path = written(folder, 'bomb.yaml', (ROBOT_TEXT.replace('name: reference', '')
                                           + aliases(9, 10).replace('bomb:', 'name:')).encode())
    with pytest.raises(InputError) as refusal:
        robot.read_machine(path)
    assert 'name: ' in str(refusal.value)
    assert len(str(refusal.value)) <= LONGEST_LINE


@pytest.mark.parametrize(('large', 'disagreement'), [(1e29, 1.0), (1e300, 0.0)])
def test_a_torque_that_no_sensor_tells_is_compared_with_nothing(folder, large, disagreement):
    """As a flipped bit makes it; drawn once among some hundred damaged bags.

    A square of it would be infinite; a smaller one is compared as any other.
    """
    path = folder / f'large_{large:g}'
    motion = quintic_motion(np.asarray(quintic_motion.__globals__['AWAY_Q']))
    with BagWriter(path) as bag:
        for row in range(150):
            stamp, effort = 10**9 + 2_000_000 * row, np.full(4, large if row == 10 else 1.0)
            bag.write_joint_state(f'/{JOINT_STATES.name}', stamp, JOINTS, motion.q[row],
                                  effort=effort)
            bag.write_joint_state(f'/{AMPLIFIER_VOLTAGE.name}', stamp, JOINTS,
                                  effort=np.ones(4) / ROBOT.drives.gain)
    told = read_log(path, ROBOT).accounts.torque_disagreement
    np.testing.assert_allclose(told, disagreement, atol=1e-9)
