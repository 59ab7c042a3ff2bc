"""Bags: what goes in comes out, whatever the storage; what was cut off comes back."""

from __future__ import annotations

import hashlib
import shutil
import signal
import sqlite3
import subprocess
import sys
from binascii import crc32
from dataclasses import fields
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from par4_identification.logs import bag as bag_module
from par4_identification.logs import serialised as serialised_module
from par4_identification.logs.bag import read_bag, recorded_topics
from par4_identification.logs.bag_repair import repair_bag
from par4_identification.logs.sqlite_pages import rows_of_leaves
from par4_identification.logs.topic_columns import JOINT_ARRAYS, AlikeMessages, TopicColumns
from par4_kinematics.errors import InputError
from par4_kinematics.interface import RECORDED_TOPICS, ROBOT_DESCRIPTION, SHOWN_TOPICS
from par4_sim.bags import bag_writer
from par4_sim.bags.bag_writer import BagWriter
from par4_sim.choices import STORAGES

JOINTS = ('arm_joint_0', 'arm_joint_1', 'arm_joint_2', 'arm_joint_3')
JOINT_STATE = 'sensor_msgs/msg/JointState'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
MILLISECOND = 1_000_000
STORE = get_typestore(Stores.ROS2_JAZZY)
START = 1_700_000_000_123_456_789


def serialised(stamp: int, names=JOINTS, position=(), effort=(), little_endian=True,
               frame='base') -> bytes:
    """Return a JointState made by the library alone."""
    types = STORE.types
    header = types['std_msgs/msg/Header'](
        types['builtin_interfaces/msg/Time'](*divmod(stamp, 10**9)), frame)
    message = types[JOINT_STATE](header, list(names), np.asarray(position, float), np.empty(0),
                                 np.asarray(effort, float))
    return bytes(STORE.serialize_cdr(message, JOINT_STATE, little_endian=little_endian))


def fill(writer: BagWriter, first: int, last: int, topic: str = '/joint_states') -> None:
    for index in range(first, last):
        writer.write_joint_state(topic, START + index * MILLISECOND, JOINTS,
                                 position=index + np.arange(4) / 8, effort=-index - np.arange(4))


def small_bag(path: Path, storage: str = 'mcap', count: int = 50, topic: str = '/joint_states'
              ) -> Path:
    with BagWriter(path, storage) as writer:
        fill(writer, 0, count, topic)
    return path


def foreign_bag(path: Path, plugin: StoragePlugin, mode: CompressionMode = CompressionMode.NONE,
                count: int = 300, version: int = 9) -> Path:
    """Write a bag with the library alone, as another recorder would."""
    writer = Writer(path, version=version, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection('/joint_states', JOINT_STATE, typestore=STORE)
        for index in range(count):
            stamp = START + index * MILLISECOND
            writer.write(connection, stamp, serialised(
                stamp, position=index + np.arange(4) / 8, effort=-index - np.arange(4)))
    return path


def storage_file(path: Path) -> Path:
    return next(file for file in path.iterdir() if file.suffix in ('.mcap', '.db3', '.zstd'))


def assert_prefix(path: Path, least: int, most: int) -> int:
    """Check that a bag holds the first of `fill`'s samples, all of them right; return how many."""
    samples = read_bag(path).joints['joint_states']
    count = len(samples.stamp)
    assert least <= count <= most
    index = np.arange(count)
    np.testing.assert_array_equal(samples.stamp, START + index * MILLISECOND)
    np.testing.assert_array_equal(samples.position, index[:, None] + np.arange(4) / 8)
    np.testing.assert_array_equal(samples.effort, -index[:, None] - np.arange(4))
    return count


@pytest.mark.parametrize('storage', STORAGES)
def test_joint_states_come_back_as_written(tmp_path, storage):
    generator = np.random.default_rng(1)
    position, velocity, effort = generator.normal(size=(3, 30, 4))
    received = START + np.sort(generator.integers(0, 10**9, 30))
    stamp = START + generator.integers(0, 10**9, 30)
    with BagWriter(tmp_path / 'bag', storage) as writer:
        for row in range(30):
            writer.write_joint_state('/joint_states', stamp[row], JOINTS, position[row],
                                     velocity[row], effort[row], received=received[row])
    samples = read_bag(tmp_path / 'bag').joints['joint_states']
    np.testing.assert_array_equal(samples.stamp, stamp)
    np.testing.assert_array_equal(samples.received, received)
    for found, written in ((samples.position, position), (samples.velocity, velocity),
                           (samples.effort, effort)):
        np.testing.assert_array_equal(found, written)
    assert samples.layouts == (JOINTS,)


@pytest.mark.parametrize('storage', STORAGES)
def test_another_reader_understands_the_bag(tmp_path, storage):
    with BagWriter(tmp_path / 'bag', storage) as writer:
        fill(writer, 0, 5)
        writer.write_trajectory('/reference', START, JOINTS, [0, 10], np.ones((2, 4)))
    with AnyReader([tmp_path / 'bag']) as reader:  # checks the definitions against their hashes
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        profiles = [connection.ext.offered_qos_profiles[0] for connection in reader.connections]
        messages = [reader.deserialize(data, connection.msgtype)
                    for connection, _, data in reader.messages()]
    assert counts == {'/joint_states': 5, '/reference': 1}
    assert {(profile.depth, profile.reliability.name, profile.durability.name)
            for profile in profiles} == {(1000, 'RELIABLE', 'VOLATILE')}
    assert [list(message.position) for message in messages if hasattr(message, 'position')] == [
        list(index + np.arange(4) / 8) for index in range(5)]
    assert 'version: 9' in (tmp_path / 'bag' / 'metadata.yaml').read_text()


@pytest.mark.parametrize('storage', STORAGES)
def test_a_latched_message_is_announced_as_such_and_after_a_repair_too(tmp_path, storage):
    """So that playing the bag latches it again, for viewers that come later."""
    with BagWriter(tmp_path / 'bag', storage) as writer:
        fill(writer, 0, 5)
        for topic in ('/robot_a/robot_description', '/remarks'):
            writer.write_raw(topic, ROBOT_DESCRIPTION.type, START, STORE.serialize_cdr(
                STORE.types[ROBOT_DESCRIPTION.type]('<robot/>'), ROBOT_DESCRIPTION.type))
    repair_bag(tmp_path / 'bag', tmp_path / 'mended')
    for name in ('bag', 'mended'):
        with AnyReader([tmp_path / name]) as reader:
            profiles = {connection.topic: connection.ext.offered_qos_profiles[0]
                        for connection in reader.connections}
        assert {topic: (profile.depth, profile.durability.name)
                for topic, profile in profiles.items()} == {
            '/joint_states': (1000, 'VOLATILE'), '/remarks': (1000, 'VOLATILE'),
            '/robot_a/robot_description': (1, 'TRANSIENT_LOCAL')}


def some_messages(generator: np.random.Generator) -> list[tuple[str, bytes]]:
    """Return type and content of messages of twelve layouts a type, whole and not, in any order."""
    types, made = STORE.types, []
    values = [0.0, -0.0, np.nan, np.inf, *generator.normal(size=9)]
    for kind in 12 * (JOINT_STATE, TRAJECTORY):
        lengths = generator.integers(9, size=generator.integers(5))
        names = ['j' * length + chr(955) for length in lengths]
        frame = 'f' * generator.integers(6)
        # of each array of up to two points, which are mostly alike
        sizes = generator.choice([0, len(names), 3], (2, 4), p=(0.2, 0.7, 0.1))
        sizes = sizes[np.zeros(2, dtype=int) if generator.random() < 0.8 else [0, 1]]
        sizes = sizes[:generator.integers(3)] if kind == TRAJECTORY else sizes[:1, :3]
        little_endian = generator.random() < 0.8
        for _ in range(12):
            header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](
                int(generator.integers(-2**31, 2**31)), int(generator.integers(2**32))), frame)
            arrays = [[generator.choice(values, size) for size in row] for row in sizes]
            if kind == TRAJECTORY:
                arrays = [[types['trajectory_msgs/msg/JointTrajectoryPoint'](
                    *row, types['builtin_interfaces/msg/Duration'](int(generator.integers(9)), 7))
                    for row in arrays]]
            data = bytearray(STORE.serialize_cdr(
                types[kind](header, names, *(arrays[0] if kind == JOINT_STATE else arrays)), kind,
                little_endian=little_endian))
            harm = generator.integers(12)
            if harm == 0:
                del data[generator.integers(len(data)):]
            elif harm == 1:
                data += generator.bytes(4)
            elif harm == 2:
                data[generator.integers(len(data))] = generator.integers(256)
            made.append((kind, bytes(data)))
    return [made[index] for index in generator.permutation(len(made))]


@pytest.mark.parametrize('seed', range(6))
def test_bulk_decoding_finds_what_the_library_decodes_one_by_one(tmp_path, seed, monkeypatch):
    generator = np.random.default_rng(seed)
    topics = {JOINT_STATE: '/joint_states', TRAJECTORY: '/reference'}
    with BagWriter(tmp_path / 'bag', STORAGES[seed % 2]) as writer:
        for kind, data in some_messages(generator):
            writer.write_raw(topics[kind], kind, START + int(generator.integers(50)), data)
    monkeypatch.setattr(bag_module, 'BATCH_MESSAGES', 37)
    bulk = read_bag(tmp_path / 'bag')
    monkeypatch.setattr(bag_module, 'BATCH_MESSAGES', 10**6)
    monkeypatch.setattr(bag_module, 'MOST_LAYOUTS', 0)
    alone = read_bag(tmp_path / 'bag')
    assert bulk.unreadable.keys() == set(topics.values())
    assert bulk.unreadable == alone.unreadable
    for found, wanted in ((bulk.joints['joint_states'], alone.joints['joint_states']),
                          (bulk.trajectories['reference'], alone.trajectories['reference'])):
        assert found.layouts == wanted.layouts
        for name in (field.name for field in fields(found) if field.name != 'layouts'):
            np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))


def test_messages_of_one_layout_are_decoded_together(tmp_path, monkeypatch):
    small_bag(tmp_path / 'bag')
    decoded = []
    monkeypatch.setattr(bag_module, '_decode', lambda *arguments, decode=bag_module._decode: (
        decoded.append(arguments), decode(*arguments))[1])
    assert_prefix(tmp_path / 'bag', 50, 50)
    assert len(decoded) == 1


def test_bags_of_all_storages_are_read_by_the_same_kernels(tmp_path):
    """Others would have to be compiled when a user reads the first bag of another storage."""
    compiled = []
    for name, plugin, mode in (('plain', StoragePlugin.MCAP, CompressionMode.NONE),
                               ('chunks', StoragePlugin.MCAP, CompressionMode.STORAGE),
                               ('pages', StoragePlugin.SQLITE3, CompressionMode.NONE)):
        assert_prefix(foreign_bag(tmp_path / name, plugin, mode, 50), 50, 50)
        compiled.append([len(kernel.signatures) for kernel in (
            serialised_module._take_messages, serialised_module._same, serialised_module._gather)])
    assert compiled == 3 * compiled[:1]


@pytest.mark.parametrize('mode', [CompressionMode.NONE, CompressionMode.STORAGE])
@pytest.mark.parametrize('ahead', [0, 100, 10**6])
def test_messages_keep_the_order_of_the_library(tmp_path, mode, ahead, monkeypatch):
    monkeypatch.setattr(bag_module, 'BATCH', 0)
    generator = np.random.default_rng(7)
    writer = Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        # two publishers of one topic, and times that repeat within and across the chunks of 1 MiB
        connections = [writer.add_connection('/joint_states', JOINT_STATE, typestore=STORE,
                                             offered_qos_profiles=profiles)
                       for profiles in ((), (bag_writer._qos_of('/joint_states', JOINT_STATE),))]
        for index in range(15000):
            received = START + index // 7 + int(generator.integers(ahead + 1))
            writer.write(connections[generator.integers(2)], received,
                         serialised(START + index, position=generator.normal(size=4)))
    with AnyReader([tmp_path / 'bag']) as reader:
        assert len(reader.readers[0].storage.storages[0].chunks) > 1
        messages = [(received, reader.deserialize(data, JOINT_STATE).header.stamp.nanosec)
                    for _, received, data in reader.messages()]
    samples = read_bag(tmp_path / 'bag').joints['joint_states']
    assert list(zip(samples.received, samples.stamp % 10**9, strict=True)) == messages


def test_written_joint_states_are_the_librarys_bytes(tmp_path):
    generator = np.random.default_rng(8)
    wanted = []
    with BagWriter(tmp_path / 'bag') as writer:
        for index in range(60):
            names = ['j' * generator.integers(1, 6) for _ in range(generator.integers(5))]
            position, effort = (generator.normal(size=generator.choice([0, len(names)]))
                                for _ in range(2))
            writer.write_joint_state('/joint_states', START + index, names, position=position,
                                     effort=list(effort))
            wanted.append(serialised(START + index, names, position, effort, frame=''))
    with AnyReader([tmp_path / 'bag']) as reader:
        assert [bytes(data) for *_, data in reader.messages()] == wanted


def test_raw_messages_pass_byte_for_byte(tmp_path):
    data = serialised(START, position=[1, 2, 3, 4])
    with BagWriter(tmp_path / 'bag') as writer:
        writer.write_raw('/joint_states', JOINT_STATE, START, data)
    with AnyReader([tmp_path / 'bag']) as reader:
        assert [bytes(found) for *_, found in reader.messages()] == [data]


def test_trajectories_become_points(tmp_path):
    generator = np.random.default_rng(2)
    q, qd, qdd, tau = generator.normal(size=(4, 3, 4))
    with BagWriter(tmp_path / 'bag') as writer:
        fill(writer, 0, 1)
        writer.write_trajectory('/reference', START + 5, JOINTS, [0, 20, 2 * 10**9 + 3], q, qd, qdd)
        writer.write_trajectory('/reference', START + 9, JOINTS[::-1], [7], q[:1],
                                received=START + 100)
        writer.write_trajectory('/feedforward_torque', START, JOINTS, [0, 1, 2], q, effort=tau)
    trajectories = read_bag(tmp_path / 'bag').trajectories
    points = trajectories['reference']
    np.testing.assert_array_equal(points.stamp + points.time_from_start,
                                  START + np.array([5, 25, 2 * 10**9 + 8, 16]))
    np.testing.assert_array_equal(points.message, [0, 0, 0, 1])
    np.testing.assert_array_equal(points.received, START + np.array([5, 5, 5, 100]))
    np.testing.assert_array_equal(points.select(points.position, JOINTS),
                                  np.vstack([q, q[:1, ::-1]]))
    np.testing.assert_array_equal(points.velocity, np.vstack([qd, np.full((1, 4), np.nan)]))
    np.testing.assert_array_equal(points.acceleration[:3], qdd)
    assert np.isnan(points.effort).all()
    np.testing.assert_array_equal(trajectories['feedforward_torque'].effort, tau)


def test_joints_are_selected_by_name_in_every_message(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        writer.write_joint_state('/joint_states', START, ('b', 'passive', 'a'), [2, 9, 1])
        writer.write_joint_state('/joint_states', START + 1, ('a', 'b'), [1, 2])
        writer.write_joint_state('/joint_states', START + 2, ('passive', 'b'), [9, 2])
    samples = read_bag(tmp_path / 'bag').joints['joint_states']
    np.testing.assert_array_equal(samples.select(samples.position, ('a', 'b')),
                                  [[1, 2], [1, 2], [np.nan, 2]])
    np.testing.assert_array_equal(samples.names_count(('a', 'b')), [2, 2, 1])


@pytest.mark.parametrize(('plugin', 'mode'), [
    (plugin, mode) for plugin in StoragePlugin for mode in CompressionMode
    if (plugin, mode) != (StoragePlugin.SQLITE3, CompressionMode.STORAGE)])  # no such thing
def test_compressed_bags_read_like_plain_ones(tmp_path, plugin, mode):
    assert assert_prefix(foreign_bag(tmp_path / 'bag', plugin, mode), 300, 300)


def test_older_bag_version_and_single_file_are_read(tmp_path):
    assert_prefix(foreign_bag(tmp_path / 'old', StoragePlugin.SQLITE3, version=8), 300, 300)
    assert_prefix(storage_file(small_bag(tmp_path / 'bag')), 50, 50)


def test_big_endian_messages_are_read(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        writer.write_raw('/joint_states', JOINT_STATE, START,
                         serialised(START, position=[1, 2, 3, 4], little_endian=False))
    samples = read_bag(tmp_path / 'bag').joints['joint_states']
    assert samples.stamp[0] == START
    np.testing.assert_array_equal(samples.position, [[1, 2, 3, 4]])


def test_stray_bytes_are_let_pass_and_garbage_is_counted(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        writer.write_raw('/joint_states', JOINT_STATE, START,
                         serialised(START, position=[1, 2, 3, 4]) + bytes(8))
        for garbage in (b'', b'\x00\x01', b'\xff' * 80, serialised(START, position=[1] * 4)[:-20],
                        b'\x00\x01\x00\x00' + b'\xff' * 80):
            writer.write_raw('/joint_states', JOINT_STATE, START + 1, garbage)
    raw = read_bag(tmp_path / 'bag')
    np.testing.assert_array_equal(raw.joints['joint_states'].position, [[1, 2, 3, 4]])
    assert raw.unreadable == {'/joint_states': 5}


def test_namespace_is_found_or_chosen(tmp_path):
    small_bag(tmp_path / 'one', topic='/left/arm/joint_states')
    assert read_bag(tmp_path / 'one').namespace == '/left/arm'
    with BagWriter(tmp_path / 'two') as writer:
        for space, value in (('/left', 1.0), ('/right', 2.0), ('', 3.0)):
            writer.write_joint_state(f'{space}/joint_states', START, ('a',), [value])
            writer.write_joint_state(f'{space}/amplifier_voltage', START, ('a',), effort=[-value])
    for namespace, value in (('left', 1.0), ('/right/', 2.0), ('/', 3.0)):
        raw = read_bag(tmp_path / 'two', namespace)
        assert raw.namespace == '/' + namespace.strip('/')
        assert raw.joints['joint_states'].position[0, 0] == value
        assert raw.joints['amplifier_voltage'].effort[0, 0] == -value
        assert len(raw.ignored) == 4
    with pytest.raises(InputError, match=r'joint_states is there under /, /left, /right; .*--name'):
        read_bag(tmp_path / 'two')
    with pytest.raises(InputError, match=r'no joint_states .* under /up; .*/left/joint_states'):
        read_bag(tmp_path / 'two', 'up')


def test_a_topic_without_messages_makes_no_namespace_ambiguous(tmp_path):
    with Writer(tmp_path / 'bag', version=9) as writer:
        writer.add_connection('/silent/joint_states', JOINT_STATE, typestore=STORE)
        states = writer.add_connection('/arm/joint_states', JOINT_STATE, typestore=STORE)
        writer.write(states, START, serialised(START, position=[0] * 4))
    assert read_bag(tmp_path / 'bag').namespace == '/arm'


def test_other_topics_are_ignored_and_listed(tmp_path):
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg('float64 level', 'site_msgs/msg/Tank'))
    path = small_bag(tmp_path / 'plain')
    with Writer(tmp_path / 'bag', version=9) as writer:
        tank = writer.add_connection('/tank', 'site_msgs/msg/Tank', typestore=store)
        text = writer.add_connection('/other/joint_states', 'std_msgs/msg/String', typestore=store)
        states = writer.add_connection('/joint_states', JOINT_STATE, typestore=STORE)
        for connection in (tank, text):
            writer.write(connection, START, b'\x00\x01\x00\x00' + bytes(8))
        writer.write(states, START, serialised(START, position=[0] * 4))
    raw = read_bag(tmp_path / 'bag')
    assert raw.ignored == {'/tank': 'site_msgs/msg/Tank',
                           '/other/joint_states': 'std_msgs/msg/String'}
    assert read_bag(path).ignored == {}


def test_unusable_paths_are_refused_in_one_line(tmp_path):
    (tmp_path / 'folder').mkdir()
    (tmp_path / 'notes.txt').write_text('no bag')
    (tmp_path / 'fake.mcap').write_text('no bag')
    BagWriter(tmp_path / 'empty').close()
    with BagWriter(tmp_path / 'other') as writer:
        writer.write_trajectory('/reference', START, JOINTS, [0], np.zeros((1, 4)))
    for name, words in (('absent', 'no such bag'), ('folder', 'not a rosbag2'),
                        ('notes.txt', 'not a rosbag2'), ('fake.mcap', 'damaged.*magic'),
                        ('empty', 'no message'),
                        ('other', r'no joint_states .*holds /reference \(trajectory_msgs')):
        with pytest.raises(InputError, match=words) as refusal:
            read_bag(tmp_path / name)
        assert '\n' not in str(refusal.value)
        assert str(refusal.value).startswith(str(tmp_path / name))


def test_writer_refuses_what_exists_and_unknown_storage(tmp_path):
    path = small_bag(tmp_path / 'bag')
    with pytest.raises(InputError, match='exists already'):
        BagWriter(path)
    assert_prefix(path, 50, 50)
    with pytest.raises(InputError, match='mcap, sqlite3'):
        BagWriter(tmp_path / 'new', 'tape')
    (tmp_path / 'file').touch()
    with pytest.raises(InputError, match=r'cannot be written \(not a directory\); give another'):
        BagWriter(tmp_path / 'file' / 'bag')


def test_writer_refuses_types_without_definition(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        with pytest.raises(InputError, match='site_msgs/msg/Tank is unknown'):
            writer.write_raw('/tank', 'site_msgs/msg/Tank', START, b'')
        fill(writer, 0, 3)
    assert_prefix(tmp_path / 'bag', 3, 3)


@pytest.mark.parametrize('storage', STORAGES)
def test_an_exception_keeps_what_was_measured(tmp_path, storage):
    def interrupted() -> None:
        with BagWriter(tmp_path / 'bag', storage) as writer:
            fill(writer, 0, 10)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert_prefix(tmp_path / 'bag', 10, 10)


def run_and_kill(code: str, *arguments: str) -> None:
    """Run code in a child that prints a line when it is ready, and kill it there."""
    child = subprocess.Popen([sys.executable, '-c', code, *arguments], stdin=subprocess.PIPE,
                             stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout.readline() == 'ready\n'
    finally:
        child.kill()
        child.communicate()
    assert child.returncode == -signal.SIGKILL


WRITE = """
import sys
from par4_sim.bags import bag_writer
from par4_sim.bags.bag_writer import BagWriter
bag_writer.FLUSH_PERIOD = 1e9  # however slow this machine is, nothing is flushed by itself
sys.path.insert(0, sys.argv[3])
from test_bag import fill
writer = BagWriter(sys.argv[1], sys.argv[2])
fill(writer, 0, 700)
writer.flush()
fill(writer, 700, int(sys.argv[4]))
print('ready', flush=True)
sys.stdin.read()
"""


@pytest.mark.parametrize('storage', STORAGES)
def test_killed_writer_is_recovered_up_to_the_flush(tmp_path, storage):
    run_and_kill(WRITE, str(tmp_path / 'bag'), storage, str(Path(__file__).parent), '900')
    with pytest.raises(InputError, match=r'cut off .*; run par4_record --repair'):
        read_bag(tmp_path / 'bag')
    summary = repair_bag(tmp_path / 'bag', tmp_path / 'mended')
    count = assert_prefix(tmp_path / 'mended', 700, 900)
    assert summary.messages == {'/joint_states': count}


def test_killed_writer_leaves_a_journal_that_is_rolled_back(tmp_path):
    # More than sqlite3's page cache, so that pages of the open transaction are in the file.
    run_and_kill(WRITE, str(tmp_path / 'bag'), 'sqlite3', str(Path(__file__).parent), '40000')
    journal = next((tmp_path / 'bag').glob('*-journal'))
    assert journal.stat().st_size > 0
    repair_bag(tmp_path / 'bag', tmp_path / 'mended')
    assert_prefix(tmp_path / 'mended', 700, 700)
    assert journal.stat().st_size > 0
    shutil.copy(tmp_path / 'mended' / 'metadata.yaml', tmp_path / 'bag')
    with pytest.raises(InputError, match='journal is left over'):
        read_bag(tmp_path / 'bag')


@pytest.mark.parametrize('storage', STORAGES)
def test_writing_flushes_once_a_second(tmp_path, storage, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(bag_writer.time, 'monotonic', lambda: now[0])
    writer = BagWriter(tmp_path / 'bag', storage)
    for second in range(3):
        fill(writer, 10 * second, 10 * second + 10)
        now[0] += 1.01
    # The next message finds the second over.
    fill(writer, 30, 31)
    shutil.copytree(tmp_path / 'bag', tmp_path / 'as_killed')
    writer.close()
    repair_bag(tmp_path / 'as_killed', tmp_path / 'mended')
    assert_prefix(tmp_path / 'mended', 31, 31)


def digests(path: Path) -> dict[str, str]:
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in path.iterdir()}


def cut(path: Path, target: Path, size: int) -> Path:
    """Copy the storage file of a bag, cut to `size` bytes, without metadata.yaml."""
    target.mkdir()
    file = storage_file(path)
    (target / file.name).write_bytes(file.read_bytes()[:size])
    return target


COMPRESSIONS = (CompressionMode.NONE, CompressionMode.MESSAGE, CompressionMode.STORAGE,
                CompressionMode.FILE)


@pytest.mark.parametrize('mode', COMPRESSIONS)
def test_mcap_cut_anywhere_gives_back_what_is_in_front(tmp_path, mode):
    # Several chunks of 1 MiB when expanded.
    path = foreign_bag(tmp_path / 'bag', StoragePlugin.MCAP, mode, count=12000)
    size = storage_file(path).stat().st_size
    generator = np.random.default_rng(3)
    previous = 0
    for number, end in enumerate([*np.sort(generator.integers(size // 3, size - 1, 4)), size]):
        broken = cut(path, tmp_path / f'cut_{number}', end)
        before = digests(broken)
        with pytest.raises(InputError, match='--repair'):
            read_bag(broken)
        summary = repair_bag(broken, tmp_path / f'mended_{number}')
        count = assert_prefix(tmp_path / f'mended_{number}', max(previous, 1), 12000)
        assert summary.messages == {'/joint_states': count}
        assert digests(broken) == before
        if mode in (CompressionMode.NONE, CompressionMode.MESSAGE):
            # Nothing is lost but the message at the cut, the index and the footer.
            assert count >= 12000 * end / size * 0.75
        previous = count
    assert previous == 12000


def test_lz4_chunks_are_recovered(tmp_path):
    with Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.storage.compression = 'lz4'
        writer.storage.compressor = lz4.frame.compress
        connection = writer.add_connection('/joint_states', JOINT_STATE, typestore=STORE)
        for index in range(12000):
            stamp = START + index * MILLISECOND
            writer.write(connection, stamp, serialised(
                stamp, position=index + np.arange(4) / 8, effort=-index - np.arange(4)))
    assert_prefix(tmp_path / 'bag', 12000, 12000)
    size = storage_file(tmp_path / 'bag').stat().st_size
    repair_bag(cut(tmp_path / 'bag', tmp_path / 'cut', size * 2 // 3), tmp_path / 'mended')
    assert_prefix(tmp_path / 'mended', 6000, 9000)


@pytest.mark.parametrize('part', [0.4, 0.6, 0.8, 0.99])
def test_sqlite3_cut_short_gives_back_what_is_in_front(tmp_path, part):
    path = small_bag(tmp_path / 'bag', 'sqlite3', 6000)
    broken = cut(path, tmp_path / 'cut', int(part * storage_file(path).stat().st_size))
    before = digests(broken)
    summary = repair_bag(broken, tmp_path / 'mended')
    assert_prefix(tmp_path / 'mended', int(0.8 * part * 6000), 5999)
    assert summary.damaged == 1
    assert digests(broken) == before


def test_sqlite3_without_the_tree_of_its_messages_gives_back_its_leaves(tmp_path):
    """The tree grew upwards behind the first leaves, and its middle went with the end."""
    path = small_bag(tmp_path / 'bag', 'sqlite3', 12000)
    size = storage_file(path).stat().st_size
    for part in (0.3, 0.5):
        broken = cut(path, tmp_path / f'cut_{part}', int(part * size))
        repair_bag(broken, tmp_path / f'mended_{part}')
        assert_prefix(tmp_path / f'mended_{part}', int(0.8 * part * 12000), 11999)


@pytest.mark.parametrize('page_size', [512, 4096, 65536])
def test_leaves_of_sqlite3_tell_the_rows_of_their_table(tmp_path, page_size):
    random = np.random.default_rng(page_size)
    rows = [(index, int(number), random.bytes(int(length)), None)
            for index, (number, length) in enumerate(zip(
                random.integers(-2 ** 62, 2 ** 62, 300) >> random.integers(0, 62, 300),
                random.choice([0, 1, 60, 400, 5000, 90000], 300)), 1)]
    with sqlite3.connect(tmp_path / 'table.db3') as database:
        database.execute(f'PRAGMA page_size = {page_size}')
        database.execute('CREATE TABLE rows (id INTEGER PRIMARY KEY, number INTEGER, data BLOB, '
                         'spare TEXT)')
        database.executemany('INSERT INTO rows VALUES (?, ?, ?, ?)', rows)
    database.close()
    found = {row: values for row, values in rows_of_leaves(tmp_path / 'table.db3')
             if len(values) == 4}
    assert found == {row[0]: (None, *row[1:]) for row in rows}
    whole = (tmp_path / 'table.db3').read_bytes()
    (tmp_path / 'cut.db3').write_bytes(whole[:len(whole) // 2])
    left = dict(rows_of_leaves(tmp_path / 'cut.db3'))
    assert 50 < len(left) < 300
    assert all(found[row] == values for row, values in left.items() if row in found)


def test_a_header_of_sqlite3_alone_is_refused_in_one_line(tmp_path):
    path = small_bag(tmp_path / 'bag', 'sqlite3', 200)
    for size in (16, 40, 99):
        with pytest.raises(InputError, match='no message can be recovered'):
            repair_bag(cut(path, tmp_path / f'cut_{size}', size), tmp_path / 'mended')


def test_a_schema_of_sqlite3_that_is_no_text_is_refused_in_one_line(tmp_path):
    path = small_bag(tmp_path / 'bag', 'sqlite3', 200)
    file = storage_file(path)
    content = file.read_bytes()
    file.write_bytes(content.replace(b'CREATE TABLE topics', b'CREATE TABLE\x80topics'))
    assert file.read_bytes() != content
    with pytest.raises(InputError, match='no message can be recovered'):
        repair_bag(path, tmp_path / 'mended')


def test_rows_of_sqlite3_with_values_of_other_types_are_left_out(tmp_path):
    path = small_bag(tmp_path / 'bag', 'sqlite3', 200)
    with sqlite3.connect(storage_file(path)) as database:
        database.execute("UPDATE messages SET data = 'text' WHERE id = 3")
        database.execute("UPDATE messages SET timestamp = 'now' WHERE id = 4")
        database.execute("INSERT INTO topics (id, name, type, serialization_format, "
                         "offered_qos_profiles, type_description_hash) "
                         "VALUES (77, x'00ff', 3, 'cdr', '', '')")
        database.execute("UPDATE messages SET topic_id = 77 WHERE id = 5")
    database.close()
    assert sum(repair_bag(path, tmp_path / 'mended').messages.values()) == 197


def test_a_damaged_chunk_costs_only_itself(tmp_path):
    path = foreign_bag(tmp_path / 'bag', StoragePlugin.MCAP, CompressionMode.STORAGE, count=12000)
    file = storage_file(path)
    content = bytearray(file.read_bytes())
    middle = content.index(b'zstd') + 2000  # inside the first chunk
    content[middle:middle + 64] = bytes(64)
    file.write_bytes(content)
    summary = repair_bag(path, tmp_path / 'mended')
    samples = read_bag(tmp_path / 'mended').joints['joint_states']
    assert summary.damaged == 1
    assert 0 < len(samples.stamp) < 12000
    index = (samples.stamp - START) // MILLISECOND
    np.testing.assert_array_equal(samples.position, index[:, None] + np.arange(4) / 8)
    assert index[-1] == 11999


def test_a_chunk_that_fails_its_checksum_is_left_out(tmp_path):
    path = foreign_bag(tmp_path / 'bag', StoragePlugin.MCAP, count=12000)
    file = storage_file(path)
    content = bytearray(file.read_bytes())
    chunk = 8 + 9 + int.from_bytes(content[9:17], 'little')  # behind magic and header record
    assert content[chunk] == 0x06
    size = int.from_bytes(content[chunk + 25:chunk + 33], 'little')
    records = chunk + 9 + 40  # no compression has an empty name
    checksum = crc32(content[records:records + size])
    content[chunk + 33:chunk + 37] = checksum.to_bytes(4, 'little')
    file.write_bytes(content)
    assert repair_bag(path, tmp_path / 'good').messages == {'/joint_states': 12000}
    content[records + size - 1] ^= 0x40
    file.write_bytes(content)
    summary = repair_bag(path, tmp_path / 'mended')
    assert summary.damaged == 1
    assert 0 < summary.messages['/joint_states'] < 12000


def test_repair_of_a_good_bag_is_a_copy(tmp_path):
    for storage in STORAGES:
        summary = repair_bag(small_bag(tmp_path / storage, storage), tmp_path / f'{storage}_copy')
        assert summary.damaged == 0
        assert_prefix(tmp_path / f'{storage}_copy', 50, 50)


def test_repair_joins_split_bags(tmp_path):
    (tmp_path / 'split').mkdir()
    for number, first in ((2, 0), (10, 20)):
        with BagWriter(tmp_path / f'part_{number}') as writer:
            fill(writer, first, first + 20)
        shutil.copy(storage_file(tmp_path / f'part_{number}'), tmp_path / 'split')
    repair_bag(tmp_path / 'split', tmp_path / 'mended')
    assert_prefix(tmp_path / 'mended', 40, 40)


def test_repair_keeps_foreign_types_it_understands(tmp_path):
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg('float64 level', 'site_msgs/msg/Tank'))
    for plugin in StoragePlugin:
        path = tmp_path / plugin.name
        with Writer(path, version=9, storage_plugin=plugin) as writer:
            tank = writer.add_connection('/tank', 'site_msgs/msg/Tank', typestore=store)
            odd = writer.add_connection('/odd', 'site_msgs/msg/Odd', msgdef='not a definition',
                                        rihs01='RIHS01_00')
            states = writer.add_connection('/joint_states', JOINT_STATE, typestore=store)
            for connection, data in (
                    (tank, b'\x00\x01\x00\x00' + np.float64(2.5).tobytes()), (odd, b'\x00\x01'),
                    (states, serialised(START, position=[0] * 4))):
                writer.write(connection, START, data)
        (path / 'metadata.yaml').unlink()
        summary = repair_bag(path, tmp_path / f'{plugin.name}_mended')
        assert summary.messages == {'/tank': 1, '/joint_states': 1}
        assert summary.left_out == {'/odd': 'site_msgs/msg/Odd'}
        with AnyReader([tmp_path / f'{plugin.name}_mended']) as reader:
            levels = [reader.deserialize(data, connection.msgtype).level
                      for connection, _, data in reader.messages() if connection.topic == '/tank']
        assert levels == [2.5]


def test_repair_refuses_in_one_line_and_leaves_no_output(tmp_path):
    path = small_bag(tmp_path / 'bag')
    (tmp_path / 'folder').mkdir()
    (tmp_path / 'hollow').mkdir()
    (tmp_path / 'hollow' / 'hollow.mcap').touch()
    (tmp_path / 'hollow' / 'hollow.db3').write_bytes(b'SQLite format 3\0' + bytes(100))
    for source, output, words in (
            (tmp_path / 'absent', tmp_path / 'out', 'no such bag'),
            (tmp_path / 'folder', tmp_path / 'out', 'not a rosbag2'),
            (tmp_path / 'hollow', tmp_path / 'out', 'no message can be recovered'),
            (path, tmp_path / 'folder', 'exists already')):
        with pytest.raises(InputError, match=words) as refusal:
            repair_bag(source, output)
        assert '\n' not in str(refusal.value)
    assert sorted(file.name for file in tmp_path.iterdir()) == ['bag', 'folder', 'hollow']
    assert not list((tmp_path / 'folder').iterdir())


FULL_DISK = """
import resource, sys
from par4_kinematics.errors import InputError
from par4_sim.bags.bag_writer import BagWriter
sys.path.insert(0, sys.argv[3])
from test_bag import fill
resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))
try:
    with BagWriter(sys.argv[1], sys.argv[2]) as writer:
        for block in range(50):
            fill(writer, 10 * block, 10 * block + 10)
            writer.flush()
except InputError as error:
    print(error)
"""


@pytest.mark.parametrize('storage', STORAGES)
def test_full_disk_is_said_in_one_line(tmp_path, storage):
    done = subprocess.run([sys.executable, '-c', FULL_DISK, str(tmp_path / 'bag'), storage,
                           str(Path(__file__).parent)], capture_output=True, text=True, check=True)
    assert 'cannot be written' in done.stdout
    assert done.stdout.count('\n') == 1
    if storage == 'sqlite3':
        assert_complete(tmp_path / 'bag', done.stdout)
        return
    assert not (tmp_path / 'bag' / 'metadata.yaml').exists()  # it would tell of more than there is
    with pytest.raises(InputError, match='--repair'):
        read_bag(tmp_path / 'bag')
    repair_bag(tmp_path / 'bag', tmp_path / 'mended')
    assert assert_prefix(tmp_path / 'mended', 10, 490)


def assert_complete(path: Path, said: str) -> None:
    """Assert that a sqlite3 bag ends with what was flushed, and that its metadata tell of that."""
    assert sorted(file.suffix for file in path.iterdir()) == ['.db3', '.yaml']
    count = assert_prefix(path, 10, 490)
    assert f'the bag is complete, with the {count} messages until then' in said
    assert '--repair' not in said
    with AnyReader([path]) as reader:
        received = [received for _, received, _ in reader.messages()]
        assert (reader.message_count, reader.start_time, reader.end_time - 1) == (
            count, min(received), max(received))
        assert [connection.msgcount for connection in reader.connections] == [count]


TAKEN = """
import os, rosbags.rosbag2
abort = rosbags.rosbag2.Writer.abort
def taken(writer):
    abort(writer)
    with open(os.path.join(os.path.dirname(sys.argv[1]), 'of_another'), 'wb', 0) as file:
        try:
            while file.write(bytes(512)):
                pass
        except OSError:
            pass
rosbags.rosbag2.Writer.abort = taken
"""
"""Another program takes what sqlite3 gives back where it could not write."""


@pytest.mark.parametrize('blocks', [1, 2000])
def test_a_full_file_system_leaves_a_bag_that_can_be_read(tmp_path, blocks):
    """Also where more came since the last flush than sqlite3 keeps in memory, 2 MB."""
    disk = tmp_path / 'disk'
    disk.mkdir()
    script = FULL_DISK.replace('resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))', TAKEN)
    script = script.replace('range(50)', 'range(2000)').replace(
        'writer.flush()', f'block % {blocks} or writer.flush()')
    small = ['unshare', '--user', '--map-root-user', '--mount', 'sh', '-c']
    mount = f'mount -t tmpfs -o size=120k par4 {disk}'
    if subprocess.run([*small, mount], capture_output=True, check=False).returncode:
        pytest.skip('this system lets no user mount a file system of his own')
    done = subprocess.run([*small, f'{mount} && "$@" && cp -r {disk}/bag {tmp_path}', 'sh',
                           sys.executable, '-c', script, str(disk / 'bag'), 'sqlite3',
                           str(Path(__file__).parent)], capture_output=True, text=True, check=True)
    assert done.stdout.count('cannot be written (database or disk is full)') == 1
    assert_complete(tmp_path / 'bag', done.stdout)


def test_a_disk_that_is_full_from_the_start_leaves_a_bag_to_repair(tmp_path):
    writer = BagWriter(tmp_path / 'bag', 'sqlite3')
    fill(writer, 0, 5)
    assert '--repair' in str(writer._refused(OSError(28, 'No space left on device')))
    with pytest.raises(InputError, match='no metadata.yaml'):
        read_bag(tmp_path / 'bag')


@pytest.mark.parametrize('times', [0, 1])
def test_the_room_that_is_kept_is_enough_and_is_given_back(tmp_path, times):
    with BagWriter(tmp_path / 'bag', 'sqlite3') as writer:
        fill(writer, 0, 5)
        for topic in (*RECORDED_TOPICS, *SHOWN_TOPICS) * times:
            writer.write_raw(f'/{topic.type:_<99}', topic.type, START, b'')
    assert sorted(file.suffix for file in (tmp_path / 'bag').iterdir()) == ['.db3', '.yaml']
    assert (tmp_path / 'bag' / 'metadata.yaml').stat().st_size < bag_writer.ROOM / 2


def test_a_full_disk_names_the_bag_that_was_asked_for(tmp_path, monkeypatch):
    def refuse(*_: object) -> None:
        raise OSError(28, 'No space left on device')

    path = small_bag(tmp_path / 'bag')
    monkeypatch.setattr('rosbags.rosbag2.Writer.write', refuse)
    with pytest.raises(InputError) as refusal:
        repair_bag(path, tmp_path / 'mended')
    assert str(refusal.value).startswith(f'{tmp_path / "mended"}: cannot be written (')
    assert '--repair' not in str(refusal.value)
    assert sorted(item.name for item in tmp_path.iterdir()) == ['bag']


def test_metadata_that_tell_of_more_than_there_is_are_noticed(tmp_path):
    with BagWriter(tmp_path / 'bag', 'sqlite3') as writer:
        fill(writer, 0, 20)
    with sqlite3.connect(next((tmp_path / 'bag').glob('*.db3'))) as database:
        database.execute('DELETE FROM messages WHERE id > 12')
    with pytest.raises(InputError, match='metadata.yaml tells of 20 messages on .* found are 12'):
        read_bag(tmp_path / 'bag')


@pytest.mark.parametrize(('content', 'said'), [
    (b'{{{{', 'its metadata.yaml is not understood'),
    (b'hello: 1', 'its metadata.yaml is not understood'),
    (b'\x89PNG', 'it holds bytes that are no text')])
def test_metadata_of_something_else_are_said_shortly(content, said, tmp_path):
    path = small_bag(tmp_path / 'bag')
    (path / 'metadata.yaml').write_bytes(content)
    for read in (read_bag, recorded_topics):
        with pytest.raises(InputError, match=rf'bag is cut off or damaged \({said}') as refused:
            read(path)
        assert len(str(refused.value)) < 150 + 2 * len(str(path))


@pytest.mark.parametrize('storage', STORAGES)
def test_messages_are_written_as_they_came(tmp_path, storage):
    kept = [index for index in range(100) if index not in {30, 31, 77}]
    with BagWriter(tmp_path / 'bag', storage) as writer:
        for index in kept:
            writer.write_raw('/arm/joint_states', JOINT_STATE, START + index,
                             serialised(START + index * MILLISECOND, position=[index] * 4))
        writer.write_raw('/arm/amplifier_voltage', JOINT_STATE, START + 100, serialised(START))
        with pytest.raises(InputError, match='exists already'):
            BagWriter(tmp_path / 'bag')
    samples = read_bag(tmp_path / 'bag').joints['joint_states']
    np.testing.assert_array_equal(samples.position[:, 0], kept)


def test_recording_in_progress_survives_a_kill(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        writer.write_raw('/joint_states', JOINT_STATE, START, serialised(START, position=[1] * 4))
        writer.flush()
        shutil.copytree(tmp_path / 'bag', tmp_path / 'as_killed')
    assert repair_bag(tmp_path / 'as_killed', tmp_path / 'mended').messages == {'/joint_states': 1}


@pytest.mark.parametrize('expected', [0, 3, 10, 1000])
def test_columns_of_batches_are_those_of_all_messages(expected):
    """Whatever number the bag tells of, when joints come late and a message cannot be read."""
    columns = TopicColumns('/joint_states', expected, JOINT_ARRAYS)
    wanted = []
    for batch, names in enumerate((('a',), ('a',), ('a', 'b'), ('b', 'a', 'c'), ('a',))):
        position = 10.0 * batch + np.arange(2.0 * len(names)).reshape(2, 1, -1)
        nothing = np.empty((2, 1, 0))
        columns.append(np.arange(3) + 3 * batch, [AlikeMessages(
            np.array([0, 2]), names, np.array([7, 8]) + batch, np.zeros((2, 1), dtype=int),
            (position, nothing, position if batch == 3 else nothing))])
        wanted += [dict(zip(names, row)) for row in position[:, 0]]
    found = columns.joint_samples()
    assert (columns.messages, columns.decoded) == (15, 10)
    np.testing.assert_array_equal(found.received, np.delete(np.arange(15), slice(1, 15, 3)))
    np.testing.assert_array_equal(found.stamp[:4], (7, 8, 8, 9))
    assert found.layouts == (('a',), ('a', 'b'), ('b', 'a', 'c'))
    np.testing.assert_array_equal(
        found.select(found.position, 'abc'),
        [[row.get(name, np.nan) for name in 'abc'] for row in wanted])
    assert np.isnan(found.velocity).all()
    assert found.velocity.shape == found.position.shape == (10, 3)
    np.testing.assert_array_equal(np.isfinite(found.effort[:, 0]), np.arange(10) // 2 == 3)
