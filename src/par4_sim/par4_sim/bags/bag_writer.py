"""Writing rosbag2 folders that survive a kill.

A bag is written in the format of ROS 2 Jazzy (version 9) as MCAP or sqlite3. What reads bags is
`par4_identification.logs.bag`; each of the two knows the bag library.
"""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Sequence
from contextlib import closing, suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

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
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer
from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)

from par4_kinematics.errors import InputError
from par4_kinematics.files import unwritable
from par4_kinematics.interface import JOINT_STATES, REFERENCE, TOPICS
from par4_kinematics.stamps import SECOND
from par4_sim.bags.message_layout import JointStateTemplate
from par4_sim.choices import STORAGES, repair_command

if TYPE_CHECKING:
    from rosbags.typesys.store import Msg

RESERVE, ROOM = 'metadata.yaml.reserve', 1 << 14
"""File beside a sqlite3 bag while it is written, and its bytes: they make room for metadata.yaml,
which has some 700 for each topic, where the disk is full."""
FLUSH_PERIOD = 1.0
"""Seconds after which written messages are handed to the operating system."""
_FOREVER = QosTime(9223372036, 854775807)
Numbers = Sequence[float] | np.ndarray
"""Values of the joints of a message, (J,) or empty."""


class _Closed:
    """Stands for the storage of a sqlite3 bag whose file is closed."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def close(self, *_: object) -> None:
        """Do nothing."""

    add_msgtype = add_connection = write = abort = close


class BagWriter:
    """A rosbag2 folder being written; a context manager.

    The folder stands at its final path from the start. Closing completes it, also when the block
    raises: what was measured is kept. Killed, it keeps everything up to the last `flush`, and
    `repair_bag` recovers that. Writing flushes once a second; whoever may stop writing for longer
    calls `flush` itself. sqlite3 demands that one thread opens, writes and closes.

    Attributes:
        path: of the bag.
        failed: whether the disk refused something. A sqlite3 bag then ends with what was flushed
            last, and its metadata.yaml tells of that. An MCAP bag is left as after a kill, without
            a metadata.yaml that would tell of more than it holds.
    """

    def __init__(self, path: str | Path, storage: str = 'mcap',
                 later: str | Path | None = None) -> None:
        """Create the folder `path`; `storage` is 'mcap' or 'sqlite3'.

        `later` is where a complete bag will be put; one that is not complete is then thrown away.

        Raises:
            InputError: the path exists or cannot be created, or the storage is unknown.
        """
        self.path = Path(path)
        self.failed = False
        self._later = later
        if storage not in STORAGES:
            raise InputError(f'storage {storage!r}: unknown; give one of {", ".join(STORAGES)}')
        self._typestore = get_typestore(Stores.ROS2_JAZZY)
        self._connections: dict[str, Connection] = {}
        self._templates: dict[tuple[tuple[str, ...], tuple[int, ...]],
                              JointStateTemplate] = {}
        try:
            self._writer = Writer(self.path, version=9, storage_plugin=StoragePlugin[
                storage.upper()])
            self._writer.open()
            if isinstance(self._writer.storage, Sqlite3Writer):
                (self.path / RESERVE).write_bytes(bytes(ROOM))
        except WriterError:
            raise InputError(f'{path}: exists already; give another path or remove it') from None
        except (OSError, sqlite3.Error) as error:
            raise unwritable(later or path, error) from error
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
                    offered_qos_profiles=[_qos_of(topic, type_name)])
            self._writer.write(self._connections[topic], received, data)
        except (OSError, sqlite3.Error) as error:
            raise self._refused(error) from error
        if time.monotonic() - self._flushed > FLUSH_PERIOD:
            self.flush()

    def write_joint_state(self, topic: str, stamp: int, names: Sequence[str],
                          position: Numbers = (), velocity: Numbers = (),
                          effort: Numbers = (), received: int | None = None) -> None:
        """Write one JointState stamped `stamp`, ns; received then, or at `received`, ns."""
        parts = (position, velocity, effort)
        shape = tuple(names), tuple(map(len, parts))
        if shape not in self._templates:
            message = self._typestore.types[JOINT_STATES.type](
                self._header(0), list(names), *(np.zeros(len(part)) for part in parts))
            self._templates[shape] = JointStateTemplate(
                self._typestore.serialize_cdr(message, JOINT_STATES.type))
        self.write_raw(topic, JOINT_STATES.type, int(stamp if received is None else received),
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
                types['builtin_interfaces/msg/Duration'](*divmod(int(after), SECOND)))
            for index, after in enumerate(np.asarray(time_from_start))
        ]
        message = types[REFERENCE.type](self._header(stamp), list(names), points)
        self._write_message(topic, REFERENCE.type, stamp if received is None else received,
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
            if isinstance(storage, Sqlite3Writer):
                storage.conn.commit()
            if isinstance(storage, McapWriter):
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
            (self.path / RESERVE).unlink(missing_ok=True)
        except (OSError, sqlite3.Error) as error:
            raise self._refused(error) from error

    def _refused(self, error: Exception) -> InputError:
        self.failed = True
        with suppress(OSError, sqlite3.Error):
            self._writer.abort()
        told = unwritable(self._later or self.path, error)
        if self._later is not None:
            return told
        held = 0
        if (self.path / RESERVE).exists():
            with suppress(OSError, sqlite3.Error):
                held = self._end_here()
        if held:
            return InputError(f'{told}; the bag is complete, with the {held} messages until then')
        return InputError(f'{told}, then run {repair_command(self.path)}')

    def _end_here(self) -> int:
        """Complete a sqlite3 bag with the messages in its file; return how many, 0 = no bag.

        sqlite3 takes back what it could not write in whole, at the latest when it opens the file
        anew. Counts and times of the library's writer are of all that was given to it: they become
        those of what is there. For metadata.yaml there is the room that was kept.

        Raises:
            OSError, sqlite3.Error: the disk refuses again, or holds no sound file.
        """
        writer, file = self._writer, self.path / f'{self.path.name}.db3'
        with closing(sqlite3.connect(f'{file.absolute().as_uri()}?mode=rw', uri=True)) as database:
            topics = {key for key, in database.execute('SELECT id FROM topics')}
            held = {key: (count, first, last) for key, count, first, last in database.execute(
                'SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages '
                'GROUP BY topic_id')}
        if not held:
            return 0
        writer.connections = [one for one in writer.connections if one.id in topics]
        writer.counts = {one.id: held.get(one.id, (0,))[0] for one in writer.connections}
        writer.min_timestamp = min(first for _, first, _ in held.values())
        writer.max_timestamp = max(last for *_, last in held.values())
        (self.path / RESERVE).unlink()
        writer.storage = _Closed(file)
        writer.close()
        return sum(writer.counts.values())

    def _header(self, stamp: int) -> Msg:
        types = self._typestore.types
        return types['std_msgs/msg/Header'](
            types['builtin_interfaces/msg/Time'](*divmod(int(stamp), SECOND)), '')

    def _write_message(self, topic: str, type_name: str, received: int, message: object) -> None:
        self.write_raw(topic, type_name, int(received),
                       self._typestore.serialize_cdr(message, type_name))


def _qos_of(name: str, type_name: str) -> Qos:
    """Return the contract's quality of service of a topic; of any other that of `joint_states`."""
    topic = next((topic for topic in TOPICS if topic.type == type_name
                  and name.endswith(f'/{topic.name.lstrip("/")}')), JOINT_STATES)
    durability = QosDurability.TRANSIENT_LOCAL if topic.transient_local else QosDurability.VOLATILE
    return Qos(QosHistory.KEEP_LAST, topic.depth, QosReliability.RELIABLE, durability, _FOREVER,
               _FOREVER, QosLiveliness.AUTOMATIC, _FOREVER, False)
