"""Reading bags: rosbag2 folders or single files, MCAP or sqlite3, with or without compression.

Messages leave here as columns of numpy arrays; joints and topics are found by name. What writes
bags is `par4_sim.bags.bag_writer`; each of the two knows the bag library.
"""

from __future__ import annotations

import os
import struct
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.storage_mcap import ChunkInfo, McapReader, decompress
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from par4_identification.logs.bag_files import cut_off, refuse_incomplete
from par4_identification.logs.bag_topics import choose_topics
from par4_identification.logs.raw_bag import RawBag
from par4_identification.logs.serialised import (
    SerialisedMessages,
    laid_out_alike,
    messages_of_chunks,
    numbers_of,
    serialised_messages,
)
from par4_identification.logs.topic_columns import (
    JOINT_ARRAYS,
    TRAJECTORY_ARRAYS,
    AlikeMessages,
    TopicColumns,
)
from par4_kinematics.errors import InputError
from par4_kinematics.files import why_no_text
from par4_kinematics.interface import JOINT_STATES, REFERENCE
from par4_kinematics.stamps import SECOND
from par4_sim.bags.message_layout import joint_state_layout, trajectory_layout

JOINT_STATE_TYPE = JOINT_STATES.type
TRAJECTORY_TYPE = REFERENCE.type
MOST_LAYOUTS = 16
"""Layouts in one topic that are decoded in bulk; every one costs a look at all messages."""

BATCH = 1 << 24
"""Bytes of messages that are decoded at a time, where the order of an MCAP file allows it."""
BATCH_MESSAGES = 1 << 16
"""Messages that are decoded at a time where the library reads them."""

_ARRAYS = {JOINT_STATE_TYPE: JOINT_ARRAYS, TRAJECTORY_TYPE: TRAJECTORY_ARRAYS}


@dataclass(frozen=True)
class RecordedTopic:
    """A topic of a bag and when its messages were received, (n,) ns, in the order of the bag."""

    name: str
    type: str
    received: np.ndarray


def recorded_topics(path: str | Path) -> tuple[RecordedTopic, ...]:
    """Return every topic of a rosbag2, whatever its type, in order of their names.

    Raises:
        InputError: no such bag, not a bag, or cut off or damaged.
    """
    path = Path(path)
    refuse_incomplete(path)
    try:  # as in `read_bag`
        with Reader(path) as reader:
            types = {connection.topic: connection.msgtype for connection in reader.connections}
            received: dict[str, array[int]] = {topic: array('q') for topic in types}
            for connection, when, _ in reader.messages():
                received[connection.topic].append(when)
    except Exception as error:
        raise cut_off(path, _reason(error)) from error
    return tuple(RecordedTopic(topic, types[topic], np.array(received[topic], dtype=np.int64))
                 for topic in sorted(types))


def _reason(error: Exception) -> str:
    """Return why a bag cannot be read, of what the library or its parsers say."""
    text = ' '.join(why_no_text(error).split())
    if 'metadata.yaml' in text or 'metadata key' in text:
        return 'its metadata.yaml is not understood'
    return text or type(error).__name__


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
    refuse_incomplete(path)
    # The library raises whatever its parsers meet in damaged data (its own errors, struct.error,
    # TypeError, those of sqlite3 and the decompressors), so that only the stage tells the cause.
    try:
        with Reader(path) as reader:
            topics: dict[str, list[Connection]] = {}
            for connection in reader.connections:
                topics.setdefault(connection.topic, []).append(connection)
            types = {topic: parts[0].msgtype for topic, parts in topics.items()}
            filled = {topic for topic, parts in topics.items() if any(p.msgcount for p in parts)}
            chosen = choose_topics(path, types, filled, namespace)
            typestore = get_typestore(Stores.ROS2_JAZZY)
            told = {topic: sum(connection.msgcount for connection in topics[topic])
                    for topic in chosen.values()}
            columns = {topic: TopicColumns(topic, count, _ARRAYS[types[topic]])
                       for topic, count in told.items()}
            for batch in _batches(reader, {topic: topics[topic] for topic in chosen.values()}):
                for topic, messages in batch.items():
                    columns[topic].append(messages.received, list(
                        _alike(typestore, types[topic], messages)))
    except InputError:
        raise
    except Exception as error:
        raise cut_off(path, _reason(error)) from error
    joints, trajectories, unreadable = {}, {}, {}
    for name, topic in chosen.items():
        found = columns[topic]
        if found.messages < told[topic]:
            raise cut_off(path, f'metadata.yaml tells of {told[topic]} messages on {topic}, found '
                                f'are {found.messages}')
        if found.decoded < found.messages:
            unreadable[topic] = found.messages - found.decoded
        if found.decoded and types[topic] == JOINT_STATE_TYPE:
            joints[name] = found.joint_samples()
        elif found.decoded:
            trajectories[name] = found.trajectory_points()
    topic = chosen[JOINT_STATES.name]
    if JOINT_STATES.name not in joints:
        raise InputError(f'{path}: none of the {columns[topic].messages} messages on {topic} can '
                         'be decoded; record the bag again')
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
        waiting: dict[str, tuple[list[int], list[bytes]]] = {
            topic: ([], []) for topic in topics}
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


def _records(stream: BufferedReader, chunks: Sequence[ChunkInfo]) -> Iterator[bytes | memoryview]:
    """Yield the records of MCAP chunks, expanded; one buffer serves them all."""
    most = max((chunk.compressed_size for chunk in chunks), default=0)
    buffer: Any = memoryview(bytearray(most))  # decompress says bytes, and takes any buffer
    for chunk in chunks:
        # behind opcode and size: two times, size when expanded, checksum, compression, size
        stream.seek(chunk.chunk_start_offset + 9 + 24)
        (checksum,) = struct.unpack('<I', stream.read(4))
        stream.seek(4 + len(chunk.compression) + 8, os.SEEK_CUR)
        found = stream.readinto(buffer[:chunk.compressed_size])
        yield decompress(buffer[:found], chunk.compression, chunk.uncompressed_size, checksum)


def _decode(typestore: Any, type_name: str, data: bytes) -> object | None:
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


def _nanoseconds(time_or_duration: Any) -> int:
    return time_or_duration.sec * SECOND + time_or_duration.nanosec


def _alike(typestore: Any, type_name: str, messages: SerialisedMessages
           ) -> Iterator[AlikeMessages]:
    """Yield the messages by layout: of the first layouts in bulk, all others one by one."""
    rows, layouts = np.arange(len(messages)), 0
    while len(rows):
        data = messages[rows[0]]
        message = _decode(typestore, type_name, data)
        layout = None
        if message is not None and layouts < MOST_LAYOUTS:
            layout = (joint_state_layout if type_name == JOINT_STATE_TYPE else trajectory_layout)(
                data)
        if layout is not None:
            alike = laid_out_alike(messages, rows[0], layout, rows)
            stamp, after, arrays = numbers_of(messages, layout, rows[alike])
            yield AlikeMessages(rows[alike], layout.names, stamp, after, arrays)
            rows, layouts = rows[~alike], layouts + 1
            continue
        if message is not None:
            yield _alone(type_name, rows[:1], message)
        rows = rows[1:]


def _alone(type_name: str, row: np.ndarray, message: Any) -> AlikeMessages:
    """Return a single message."""
    if type_name == JOINT_STATE_TYPE:
        names, points, after = message.name, [message], [0]
    else:
        names, points = message.joint_names, message.points
        after = [_nanoseconds(point.time_from_start) for point in points]
    return AlikeMessages(
        row, tuple(names), np.array([_nanoseconds(message.header.stamp)]),
        np.array([after], dtype=np.int64),
        tuple(_padded([getattr(point, part) for point in points])[None]
              for part in _ARRAYS[type_name]))


def _padded(rows: Sequence[np.ndarray]) -> np.ndarray:
    """Return rows of any length as (n, longest), filled up with NaN."""
    table = np.full((len(rows), max(map(len, rows), default=0)), np.nan)
    for target, row in zip(table, rows, strict=True):
        target[:len(row)] = row
    return table
