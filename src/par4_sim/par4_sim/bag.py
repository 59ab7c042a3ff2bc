"""Measured bags: writing rosbag2 folders that survive a kill, and reading them.

The only file that knows the bag library. A bag is written in the format of ROS 2 Jazzy (version 9)
as MCAP or sqlite3; it is read in either, with or without compression. Messages leave here as
columns of numpy arrays; joints and topics are found by name.
"""

from __future__ import annotations

import os
import sqlite3
import struct
import time
from array import array
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

import numpy as np
from numpy.typing import ArrayLike
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import Reader, StoragePlugin, Writer, WriterError
from rosbags.rosbag2.storage_mcap import ChunkInfo, McapReader, McapWriter, decompress
from rosbags.serde import SerdeError
from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)

from par4_kinematics.errors import InputError
from par4_kinematics.interface import JOINT_STATES, RECORDED_TOPICS, REFERENCE, Topic
from par4_sim.serialised import (
    JointStateTemplate,
    SerialisedMessages,
    joint_state_layout,
    messages_of_chunks,
    serialised_messages,
    trajectory_layout,
)

JOINT_STATE_TYPE = JOINT_STATES.type
TRAJECTORY_TYPE = REFERENCE.type
STORAGES = ('mcap', 'sqlite3')
FLUSH_PERIOD = 1.0
"""Seconds after which written messages are handed to the operating system."""

MOST_LAYOUTS = 16
"""Layouts in one topic that are decoded in bulk; every one costs a look at all messages."""

BATCH = 1 << 24
"""Bytes of messages that are decoded at a time, where the order of an MCAP file allows it."""
BATCH_MESSAGES = 1 << 16
"""Messages that are decoded at a time where the library reads them."""

STORAGE_SUFFIXES = {'.mcap': 'mcap', '.db3': 'sqlite3'}
ZSTD_SUFFIX = '.zstd'
_FOREVER = QosTime(9223372036, 854775807)
_QOS = Qos(QosHistory.KEEP_LAST, JOINT_STATES.depth, QosReliability.RELIABLE,
           QosDurability.VOLATILE, _FOREVER, _FOREVER, QosLiveliness.AUTOMATIC, _FOREVER, False)
_NANOSECONDS = 1_000_000_000
_ARRAYS = {JOINT_STATE_TYPE: ('position', 'velocity', 'effort'),
           TRAJECTORY_TYPE: ('positions', 'velocities', 'accelerations', 'effort')}


class BagWriter:
    """A rosbag2 folder being written; a context manager.

    The folder stands at its final path from the start. Closing completes it, also when the block
    raises: what was measured is kept. Killed, it keeps everything up to the last `flush`, and
    `repair_bag` recovers that. Writing flushes once a second; whoever may stop writing for longer
    calls `flush` itself. sqlite3 demands that one thread opens, writes and closes.

    Attributes:
        path: of the bag.
        failed: whether the disk refused something: the bag is then left as after a kill, without
            a metadata.yaml that would tell of more than it holds.
    """

    def __init__(self, path: str | Path, storage: str = 'mcap') -> None:
        """Create the folder `path`; `storage` is 'mcap' or 'sqlite3'.

        Raises:
            InputError: the path exists or cannot be created, or the storage is unknown.
        """
        self.path = Path(path)
        self.failed = False
        if storage not in STORAGES:
            raise InputError(f'storage {storage!r}: unknown; give one of {", ".join(STORAGES)}')
        self._typestore = get_typestore(Stores.ROS2_JAZZY)
        self._connections: dict[str, object] = {}
        self._templates: dict[tuple, JointStateTemplate] = {}
        try:
            self._writer = Writer(self.path, version=9, storage_plugin=StoragePlugin[
                storage.upper()])
            self._writer.open()
        except WriterError:
            raise InputError(f'{path}: exists already; give another path or remove it') from None
        except (OSError, sqlite3.Error) as error:
            raise InputError(f'{path}: cannot be created ({error}); give another path') from error
        self.flush()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, exc_type: type[BaseException] | None, exc_val: BaseException | None,
                 exc_tb: TracebackType | None) -> None:
        self.close()

    def declare_type(self, type_name: str, encoding: str, definition: str) -> None:
        """Make a message type known that ROS 2 Jazzy's common interfaces do not have.

        Raises:
            InputError: the definition cannot be understood.
        """
        if type_name in self._typestore.fielddefs:
            return
        try:
            types = (get_types_from_msg(definition, type_name) if encoding == 'ros2msg'
                     else get_types_from_idl(definition))
            self._typestore.register({name: fields for name, fields in types.items()
                                      if name not in self._typestore.fielddefs})
            self._typestore.hash_rihs01(type_name)
        except (TypesysError, KeyError, ValueError) as error:
            raise InputError(f'{type_name}: its definition cannot be understood ({error}); record '
                             'the types of docs/interface.md') from error

    def write_raw(self, topic: str, type_name: str, received: int,
                  data: bytes | memoryview) -> None:
        """Write one serialised message (CDR); the bag announces the contract's quality of service.

        Args:
            topic: name with its namespace.
            type_name: such as sensor_msgs/msg/JointState.
            received: ns, on a clock that never jumps: it orders the bag.
            data: the message as it came.

        Raises:
            InputError: a type without definition, or the disk refuses.
        """
        try:
            if topic not in self._connections:
                if type_name not in self._typestore.fielddefs:
                    raise InputError(f'{topic}: type {type_name} is unknown; record the types of '
                                     'docs/interface.md')
                self._connections[topic] = self._writer.add_connection(
                    topic, type_name, typestore=self._typestore,
                    offered_qos_profiles=[_QOS])
            self._writer.write(self._connections[topic], received, data)
        except (OSError, sqlite3.Error) as error:
            raise self._refused(error) from error
        if time.monotonic() - self._flushed > FLUSH_PERIOD:
            self.flush()

    def write_joint_state(self, topic: str, stamp: int, names: Sequence[str],
                          position: ArrayLike = (), velocity: ArrayLike = (),
                          effort: ArrayLike = (), received: int | None = None) -> None:
        """Write one JointState stamped `stamp`, ns; received then, or at `received`, ns."""
        parts = (position, velocity, effort)
        shape = (tuple(names), *map(len, parts))
        if shape not in self._templates:
            message = self._typestore.types[JOINT_STATE_TYPE](
                self._header(0), list(names), *(np.zeros(len(part)) for part in parts))
            self._templates[shape] = JointStateTemplate(
                self._typestore.serialize_cdr(message, JOINT_STATE_TYPE))
        self.write_raw(topic, JOINT_STATE_TYPE, int(stamp if received is None else received),
                       self._templates[shape].filled(int(stamp), parts))

    def write_trajectory(self, topic: str, stamp: int, names: Sequence[str],
                         time_from_start: ArrayLike, position: ArrayLike,
                         velocity: ArrayLike | None = None, acceleration: ArrayLike | None = None,
                         effort: ArrayLike | None = None, received: int | None = None) -> None:
        """Write one JointTrajectory of m points stamped `stamp`, ns.

        Args:
            topic: name with its namespace.
            stamp: of the header, ns; 0 = START_DELAY after receipt.
            names: of the J joints.
            time_from_start: (m,) ns.
            position, velocity, acceleration, effort: (m, J); None leaves the field empty.
            received: bag time, ns; without it `stamp`.
        """
        types = self._typestore.types
        columns = [None if part is None else np.ascontiguousarray(part, dtype=np.float64)
                   for part in (position, velocity, acceleration, effort)]
        points = [
            types['trajectory_msgs/msg/JointTrajectoryPoint'](
                *(np.empty(0) if part is None else part[index] for part in columns),
                types['builtin_interfaces/msg/Duration'](*divmod(int(after), _NANOSECONDS)))
            for index, after in enumerate(np.asarray(time_from_start))
        ]
        message = types[TRAJECTORY_TYPE](self._header(stamp), list(names), points)
        self._write_message(topic, TRAJECTORY_TYPE, stamp if received is None else received,
                            message)

    def flush(self) -> None:
        """Hand everything written so far to the operating system, so that a kill cannot lose it.

        The library's writer keeps up to 1 MiB of MCAP messages, or a whole sqlite3 transaction, to
        itself and offers no flush. This is the one place that reaches into its storage: it closes
        the open MCAP chunk, or commits.

        Raises:
            InputError: the disk refuses.
        """
        storage = self._writer.storage
        try:
            if not isinstance(storage, McapWriter):
                storage.conn.commit()
            else:
                if storage.chunk.msgs:
                    storage.close_chunk()
                storage.bio.flush()
        except (OSError, sqlite3.Error) as error:
            raise self._refused(error) from error
        self._flushed = time.monotonic()

    def close(self) -> None:
        """Complete the bag with its index and metadata.yaml.

        A second call does nothing, nor does one after the disk refused.

        Raises:
            InputError: the disk refuses.
        """
        if self._writer.storage is None:
            return
        try:
            self._writer.close()
        except (OSError, sqlite3.Error) as error:
            raise self._refused(error) from error

    def _refused(self, error: Exception) -> InputError:
        self.failed = True
        with suppress(OSError, sqlite3.Error):
            self._writer.abort()
        return InputError(f'{self.path}: cannot be written ({error}); free space and run '
                          f'par4_record --repair {self.path}')

    def _header(self, stamp: int) -> object:
        types = self._typestore.types
        return types['std_msgs/msg/Header'](
            types['builtin_interfaces/msg/Time'](*divmod(int(stamp), _NANOSECONDS)), '')

    def _write_message(self, topic: str, type_name: str, received: int, message: object) -> None:
        self.write_raw(topic, type_name, int(received),
                       self._typestore.serialize_cdr(message, type_name))


@dataclass(frozen=True)
class NamedColumns:
    """Rows whose columns carry joint names that may change from row to row.

    Attributes:
        topic: name with its namespace.
        received: bag time of each row, (n,) ns.
        stamp: of the header, (n,) ns, 0 = not set.
        layouts: every list of joint names that occurs.
        layout: which of them a row follows, (n,).
    """

    topic: str
    received: np.ndarray
    stamp: np.ndarray
    layouts: tuple[tuple[str, ...], ...]
    layout: np.ndarray

    def select(self, values: np.ndarray, joints: Sequence[str]) -> np.ndarray:
        """Return the columns of `values` of these joints (n, J); NaN where a row lacks one."""
        if self.layouts == (tuple(joints),):
            return values
        selected = np.full((len(self.layout), len(joints)), np.nan)
        for index, names in enumerate(self.layouts):
            rows = self.layout == index
            for column, joint in enumerate(joints):
                if joint in names:
                    selected[rows, column] = values[rows, names.index(joint)]
        return selected

    def names_count(self, joints: Sequence[str]) -> np.ndarray:
        """Return how many of these joints each row names, (n,)."""
        counts = np.array([len(set(joints) & set(names)) for names in self.layouts], dtype=int)
        return counts[self.layout]


@dataclass(frozen=True)
class JointSamples(NamedColumns):
    """The JointState messages of one topic, in the order of the bag.

    Attributes:
        position, velocity, effort: (n, widest layout); NaN where a message carries no value.
    """

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


@dataclass(frozen=True)
class TrajectoryPoints(NamedColumns):
    """The points of all JointTrajectory messages of one topic, in the order of the bag.

    Attributes:
        message: index of the message that a point came with, (n,).
        time_from_start: (n,) ns; absolute time = stamp + time_from_start.
        position, velocity, acceleration, effort: (n, widest layout); NaN where empty.
    """

    message: np.ndarray
    time_from_start: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray


@dataclass(frozen=True)
class RawBag:
    """The contract's topics of a bag, by their names in the contract.

    Attributes:
        path: of the bag.
        namespace: under which `joint_states` was found, '/' = none.
        joints: `joint_states` and, where it has messages, `amplifier_voltage`.
        trajectories: `reference` and `feedforward_torque`, where they have messages.
        ignored: type of every other topic.
        unreadable: number of messages of each topic that could not be decoded, where any.
    """

    path: Path
    namespace: str
    joints: dict[str, JointSamples]
    trajectories: dict[str, TrajectoryPoints]
    ignored: dict[str, str]
    unreadable: dict[str, int]


@dataclass(frozen=True)
class RecordedTopic:
    """A topic of a bag and when its messages were received, (n,) ns, in the order of the bag."""

    name: str
    type: str
    received: np.ndarray


class CutOffError(InputError):
    """A bag that is cut off or damaged, of which `repair_bag` may recover something."""


def recorded_topics(path: str | Path) -> tuple[RecordedTopic, ...]:
    """Return every topic of a rosbag2, whatever its type, in order of their names.

    Raises:
        InputError: no such bag, not a bag, or cut off or damaged.
    """
    path = Path(path)
    _refuse_incomplete(path)
    try:  # as in `read_bag`
        with Reader(path) as reader:
            types = {connection.topic: connection.msgtype for connection in reader.connections}
            received: dict[str, array[int]] = {topic: array('q') for topic in types}
            for connection, when, _ in reader.messages():
                received[connection.topic].append(when)
    except Exception as error:
        raise _cut_off(path, ' '.join(str(error).split()) or type(error).__name__) from error
    return tuple(RecordedTopic(topic, types[topic], np.array(received[topic], dtype=np.int64))
                 for topic in sorted(types))


def read_bag(path: str | Path, namespace: str | None = None) -> RawBag:
    """Return the contract's topics of a rosbag2 folder, or of a single .mcap or .db3 file.

    Args:
        path: of the bag.
        namespace: that the topics sit under; without it they are found by the last part of their
            name, wherever that is unambiguous.

    Raises:
        InputError: no such bag, not a bag, cut off or damaged, empty, without `joint_states`, or
            with several of them.
    """
    path = Path(path)
    _refuse_incomplete(path)
    # The library raises whatever its parsers meet in damaged data (its own errors, struct.error,
    # TypeError, those of sqlite3 and the decompressors), so that only the stage tells the cause.
    try:
        with Reader(path) as reader:
            topics = {}
            for connection in reader.connections:
                topics.setdefault(connection.topic, []).append(connection)
            types = {topic: parts[0].msgtype for topic, parts in topics.items()}
            filled = {topic for topic, parts in topics.items() if any(p.msgcount for p in parts)}
            chosen = _choose_topics(path, types, filled, namespace)
            typestore = get_typestore(Stores.ROS2_JAZZY)
            received = {topic: np.empty(0, dtype=np.int64) for topic in chosen.values()}
            blocks: dict[str, list[_Block]] = {topic: [] for topic in chosen.values()}
            for batch in _batches(reader, {topic: topics[topic] for topic in chosen.values()}):
                for topic, messages in batch.items():
                    blocks[topic] += _blocks(typestore, types[topic], messages,
                                             len(received[topic]))
                    received[topic] = np.append(received[topic], messages.received)
    except InputError:
        raise
    except Exception as error:
        raise _cut_off(path, ' '.join(str(error).split()) or type(error).__name__) from error
    for topic in chosen.values():
        told = sum(connection.msgcount for connection in topics[topic])
        if len(received[topic]) < told:
            raise _cut_off(path, f'metadata.yaml tells of {told} messages on {topic}, found are '
                                 f'{len(received[topic])}')

    joints, trajectories, unreadable = {}, {}, {}
    for name, topic in chosen.items():
        points = _points(types[topic], topic, received[topic], blocks[topic])
        decoded = points.messages
        if decoded < len(received[topic]):
            unreadable[topic] = len(received[topic]) - decoded
        if decoded and types[topic] == JOINT_STATE_TYPE:
            joints[name] = JointSamples(*points.named, *points.arrays)
        elif decoded:
            trajectories[name] = TrajectoryPoints(*points.named, points.message, points.after,
                                                  *points.arrays)
    topic = chosen[JOINT_STATES.name]
    if JOINT_STATES.name not in joints:
        raise InputError(f'{path}: none of the {len(received[topic])} messages on {topic} can be '
                         'decoded; record the bag again')
    return RawBag(path, topic[:-len(JOINT_STATES.name) - 1] or '/', joints, trajectories,
                  {name: kind for name, kind in sorted(types.items())
                   if name not in chosen.values()}, unreadable)


def _batches(reader: Reader, topics: dict[str, list[Connection]]
             ) -> Iterator[dict[str, SerialisedMessages]]:
    """Yield the messages of topics, each with its connections, in the order of the bag.

    The library makes an object of every message on the way. MCAP's chunks are therefore taken
    apart here, in bulk, where the library has found their index.
    """
    storages = getattr(reader.storage, 'storages', [reader.storage])
    if reader.compression_mode == 'message' or not all(
            isinstance(storage, McapReader) and storage.chunks for storage in storages):
        waiting = {topic: ([], []) for topic in topics}
        for count, (connection, received, data) in enumerate(reader.messages(
                [part for parts in topics.values() for part in parts]), 1):
            times, contents = waiting[connection.topic]
            times.append(received)
            contents.append(data)
            if count % BATCH_MESSAGES == 0:
                yield {topic: serialised_messages(*parts) for topic, parts in waiting.items()}
                waiting = {topic: ([], []) for topic in topics}
        yield {topic: serialised_messages(*parts) for topic, parts in waiting.items()}
        return
    for storage in storages:
        channels = {part.id: part.topic for part in storage.connections if part.topic in topics}
        chunks = sorted((chunk for chunk in storage.chunks
                         if any(chunk.channel_count.get(channel) for channel in channels)),
                        key=lambda chunk: chunk.chunk_start_offset)
        for batch in _in_order(chunks):
            yield messages_of_chunks(_records(storage.bio, batch), _expanded(batch), channels)


def _in_order(chunks: Sequence[ChunkInfo]) -> Iterator[Sequence[ChunkInfo]]:
    """Yield chunks in batches of some size, no message of which is older than the one before."""
    latest = np.maximum.accumulate([chunk.message_end_time for chunk in chunks])
    earliest = np.minimum.accumulate([chunk.message_start_time for chunk in chunks][::-1])[::-1]
    first = 0
    for last in range(len(chunks)):
        if last + 1 == len(chunks) or (latest[last] <= earliest[last + 1] and
                                       _expanded(chunks[first:last + 1]) > BATCH):
            yield chunks[first:last + 1]
            first = last + 1


def _expanded(chunks: Sequence[ChunkInfo]) -> int:
    return sum(chunk.uncompressed_size for chunk in chunks)


def _records(stream: BinaryIO, chunks: Sequence[ChunkInfo]) -> Iterator[bytes | memoryview]:
    """Yield the records of MCAP chunks, expanded; one buffer serves them all."""
    buffer = memoryview(bytearray(max((chunk.compressed_size for chunk in chunks), default=0)))
    for chunk in chunks:
        # behind opcode and size: two times, size when expanded, checksum, compression, size
        stream.seek(chunk.chunk_start_offset + 9 + 24)
        (checksum,) = struct.unpack('<I', stream.read(4))
        stream.seek(4 + len(chunk.compression) + 8, os.SEEK_CUR)
        found = stream.readinto(buffer[:chunk.compressed_size])
        yield decompress(buffer[:found], chunk.compression, chunk.uncompressed_size, checksum)


def _refuse_incomplete(path: Path) -> None:
    if not path.exists():
        raise InputError(f'{path}: no such bag; give the folder of a rosbag2, or its .mcap or .db3 '
                         'file')
    files = storage_files(path)
    if path.is_dir() and not (path / 'metadata.yaml').exists():
        raise _cut_off(path, 'no metadata.yaml')
    for file in files:
        for log in (Path(f'{file}-journal'), Path(f'{file}-wal')):
            if file.suffix == '.db3' and log.exists() and log.stat().st_size:
                raise _cut_off(path, f'{log.name} is left over')


def _cut_off(path: Path, reason: str) -> CutOffError:
    return CutOffError(f'{path}: the bag is cut off or damaged ({reason}); run par4_record '
                       f'--repair {path}')


def storage_files(path: Path) -> list[Path]:
    """Return the storage files of a bag; their order means nothing, messages are sorted by time."""
    candidates = [path] if path.is_file() else sorted(path.iterdir())
    files = [file for file in candidates
             if (file.with_suffix('') if file.suffix == ZSTD_SUFFIX else file).suffix
             in STORAGE_SUFFIXES]
    # A bag killed while its file was being compressed holds both; the plain one is complete.
    files = [file for file in files
             if file.suffix != ZSTD_SUFFIX or file.with_suffix('') not in files]
    if not files:
        raise InputError(f'{path}: not a rosbag2; expected a folder with .mcap or .db3 files, or '
                         'one such file')
    return files


def _choose_topics(path: Path, types: dict[str, str], filled: set[str],
                   namespace: str | None) -> dict[str, str]:
    """Return the full name of each recorded topic of the contract that has messages."""
    if not filled:
        raise InputError(f'{path}: the bag holds no message; record it again')
    spaces = {topic.name: _namespaces(topic, types, filled) for topic in RECORDED_TOPICS}
    asked = None if namespace is None else '/' + namespace.strip('/')
    home = _choose_namespace(path, JOINT_STATES.name, spaces[JOINT_STATES.name], asked)
    if home is None:
        where = '' if asked is None else f' under {asked}'
        held = ', '.join(f'{name} ({types[name]})' for name in sorted(filled))
        raise InputError(f'{path}: no {JOINT_STATES.name} ({JOINT_STATE_TYPE}) with messages'
                         f'{where}; the bag holds {held}; give --namespace or remap when recording')
    chosen = {}
    for name, found in spaces.items():
        space = home if home in found else _choose_namespace(path, name, found, asked)
        if space is not None:
            chosen[name] = f'{space.rstrip("/")}/{name}'
    return chosen


def _namespaces(topic: Topic, types: dict[str, str], filled: set[str]) -> list[str]:
    return sorted(name[:-len(topic.name) - 1] or '/' for name in filled
                  if name.endswith(f'/{topic.name}') and types[name] == topic.type)


def _choose_namespace(path: Path, name: str, found: list[str], asked: str | None) -> str | None:
    if asked is not None:
        return asked if asked in found else None
    if len(found) > 1:
        raise InputError(f'{path}: {name} is there under {", ".join(found)}; give one of them as '
                         '--namespace')
    return found[0] if found else None


def _decode(typestore: object, type_name: str, data: bytes) -> object | None:
    """Return the message, or None if it cannot be decoded.

    Stray bytes behind the message are let pass: rclpy's serialize_message leaves some.
    """
    definition = typestore.get_msgdef(type_name)
    try:
        if bytes(data[:2]) not in (b'\x00\x00', b'\x00\x01'):
            return None
        decode = definition.deserialize_cdr_le if data[1] else definition.deserialize_cdr_be
        return decode(memoryview(data)[4:], 0, definition.cls, typestore)[0]
    except (SerdeError, struct.error, ValueError):
        return None


def _nanoseconds(time_or_duration: object) -> int:
    return time_or_duration.sec * _NANOSECONDS + time_or_duration.nanosec


@dataclass(frozen=True)
class _Block:
    """Messages (m,) of one layout, of P points each.

    Attributes:
        rows: which messages, (m,).
        names: of their joints.
        stamp: (m,) ns.
        after: time from start of the points, (m, P) ns; a JointState is one point at 0.
        arrays: of the message type, (m, P, -).
    """

    rows: np.ndarray
    names: tuple[str, ...]
    stamp: np.ndarray
    after: np.ndarray
    arrays: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class _Points:
    """The points (n,) of all messages that could be decoded, and how many messages these are."""

    messages: int
    named: tuple[str, np.ndarray, np.ndarray, tuple[tuple[str, ...], ...], np.ndarray]
    message: np.ndarray
    after: np.ndarray
    arrays: list[np.ndarray]


def _points(type_name: str, topic: str, received: np.ndarray, blocks: Sequence[_Block]
            ) -> _Points:
    """Return the points of blocks of messages, which were received at (n,) ns."""
    count = np.full(len(received), -1)
    for block in blocks:
        count[block.rows] = block.after.shape[1]
    decoded = count >= 0
    count = np.maximum(count, 0)
    start = np.cumsum(count) - count
    stamp, after, layout = np.zeros((3, count.sum()), dtype=np.int64)
    layouts: dict[tuple[str, ...], int] = {}
    blocks = [block for block in blocks if block.after.size]
    places = [start[block.rows, None] + np.arange(block.after.shape[1]) for block in blocks]
    for block, place in zip(blocks, places, strict=True):
        stamp[place], after[place] = block.stamp[:, None], block.after
        layout[place] = layouts.setdefault(block.names, len(layouts))
    width = max(map(len, layouts), default=0)
    arrays = [np.empty((len(stamp), width)) for _ in _ARRAYS[type_name]]
    for block, place in zip(blocks, places, strict=True):
        for values, part in zip(arrays, block.arrays, strict=True):
            filled = min(part.shape[-1], width)
            values[place, :filled] = part[..., :filled]
            values[place, filled:] = np.nan
    return _Points(
        int(decoded.sum()),
        (topic, np.repeat(received, count), stamp, tuple(layouts), layout),
        np.repeat(np.cumsum(decoded) - 1, count), after, arrays)


def _blocks(typestore: object, type_name: str, messages: SerialisedMessages, before: int
            ) -> Iterator[_Block]:
    """Yield the messages by layout: of the first layouts in bulk, all others one by one.

    They are numbered from `before` on.
    """
    rows, layouts = np.arange(len(messages)), 0
    while len(rows):
        data = messages[rows[0]]
        message = _decode(typestore, type_name, data)
        layout = None
        if message is not None and layouts < MOST_LAYOUTS:
            layout = (joint_state_layout if type_name == JOINT_STATE_TYPE else trajectory_layout)(
                data)
        if layout is not None:
            alike = layout.followed_by(messages, rows[0], rows)
            yield _Block(before + rows[alike], layout.names, *layout.read(messages, rows[alike]))
            rows, layouts = rows[~alike], layouts + 1
            continue
        if message is not None:
            yield _block(type_name, before + rows[:1], message)
        rows = rows[1:]


def _block(type_name: str, row: np.ndarray, message: object) -> _Block:
    """Return a single message."""
    if type_name == JOINT_STATE_TYPE:
        names, points, after = message.name, [message], [0]
    else:
        names, points = message.joint_names, message.points
        after = [_nanoseconds(point.time_from_start) for point in points]
    return _Block(row, tuple(names), np.array([_nanoseconds(message.header.stamp)]),
                  np.array([after], dtype=np.int64), tuple(
                      _padded([getattr(point, part) for point in points])[None]
                      for part in _ARRAYS[type_name]))


def _padded(rows: Sequence[np.ndarray]) -> np.ndarray:
    """Return rows of any length as (n, longest), filled up with NaN."""
    table = np.full((len(rows), max(map(len, rows), default=0)), np.nan)
    for target, row in zip(table, rows, strict=True):
        target[:len(row)] = row
    return table
