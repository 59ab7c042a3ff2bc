"""Mending bags that were cut off: whatever whole messages the files still hold, in a new bag.

MCAP records are read directly, because a bag library refuses such files; so are the leaves of a
sqlite3 table whose tree is gone.
"""

from __future__ import annotations

import mmap
import shutil
import sqlite3
import struct
import tempfile
from binascii import crc32
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import lz4.frame
from backports import zstd

from par4_identification.logs.bag_files import STORAGE_SUFFIXES, ZSTD_SUFFIX, storage_files
from par4_identification.logs.sqlite_pages import rows_of_leaves
from par4_kinematics.errors import InputError
from par4_kinematics.files import written_atomically
from par4_sim.bags.bag_writer import BagWriter

_MCAP_MAGIC = b'\x89MCAP0\r\n'
_SQLITE_MAGIC = b'SQLite format 3\0'
_ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'


@dataclass(frozen=True)
class RepairSummary:
    """What came out of a cut-off bag.

    Attributes:
        source, output: paths.
        messages: number recovered, by topic.
        damaged: parts (MCAP chunks, sqlite3 files) that could be read in part or not at all.
        left_out: type of each topic whose messages lack a usable definition.
    """

    source: Path
    output: Path
    messages: dict[str, int]
    damaged: int
    left_out: dict[str, str]


@dataclass(frozen=True)
class _FoundMessage:
    topic: str
    type: str
    encoding: str
    definition: str
    received: int
    data: bytes


class _Salvage:
    """Everything that can still be read from the storage files of a bag."""

    def __init__(self) -> None:
        self.damaged = 0

    def messages(self, file: Path) -> Iterator[_FoundMessage]:
        """Yield the messages of a storage file."""
        with tempfile.TemporaryDirectory() as folder:
            storage = file
            if file.suffix == ZSTD_SUFFIX:
                storage = Path(folder, 'expanded', file.with_suffix('').name)
                self._expand(file, storage)
            with storage.open('rb') as stream:
                magic = stream.read(16)
            if magic.startswith(_MCAP_MAGIC):
                yield from self._mcap(storage)
            elif magic == _SQLITE_MAGIC:
                yield from self._sqlite3(storage, Path(folder))
            else:
                self.damaged += 1

    def _expand(self, file: Path, target: Path) -> None:
        target.parent.mkdir()
        with zstd.open(file, 'rb') as source, target.open('wb') as stream:
            try:
                shutil.copyfileobj(source, stream)
            except (zstd.ZstdError, EOFError):
                self.damaged += 1

    def _sqlite3(self, file: Path, folder: Path) -> Iterator[_FoundMessage]:
        # Opening a database with a journal or log beside it rolls it back or forward, which
        # writes: so it happens on a copy.
        shutil.copy(file, folder)
        logs = [log for log in (Path(f'{file}-journal'), Path(f'{file}-wal')) if log.exists()]
        for log in logs:
            shutil.copy(log, folder)
        damaged, lost, last = not logs and _admit_missing_pages(folder / file.name), False, 0
        topics: dict[int, tuple[str, str, str, str]] = {}
        connection = sqlite3.connect(folder / file.name)
        try:
            tables = {name for name, in connection.execute('SELECT name FROM sqlite_master')}
            # a damaged row may hold values of any type
            definitions = {} if 'message_definitions' not in tables else {
                kind: (encoding, text) for kind, encoding, text in connection.execute(
                    'SELECT topic_type, encoding, encoded_message_definition '
                    'FROM message_definitions')
                if isinstance(encoding, str) and isinstance(text, str)}
            topics = {key: (name, kind, *definitions.get(kind, ('', '')))
                      for key, name, kind in connection.execute(
                          'SELECT id, name, type FROM topics')
                      if isinstance(name, str) and isinstance(kind, str)}
            # In the order of the table, not of the index: a file cut off loses its end only.
            for row, key, received, data in connection.execute(
                    'SELECT id, topic_id, timestamp, data FROM messages ORDER BY id'):
                last = row
                if key in topics and isinstance(received, int) and isinstance(data, bytes):
                    yield _FoundMessage(*topics[key], received, data)
        except (sqlite3.Error, UnicodeDecodeError):  # the latter of words in its own complaints
            damaged = lost = True
        finally:
            connection.close()
            self.damaged += damaged
        for row, values in rows_of_leaves(folder / file.name) if lost and topics else ():
            match values:
                case (_, int(key), int(received), bytes(data)) if row > last and key in topics:
                    yield _FoundMessage(*topics[key], received, data)

    def _mcap(self, file: Path) -> Iterator[_FoundMessage]:
        schemas: dict[int, tuple[str, str, str]] = {}
        channels: dict[int, tuple[str, str, str, str]] = {}
        with file.open('rb') as stream, mmap.mmap(stream.fileno(), 0,
                                                  access=mmap.ACCESS_READ) as content:
            # Definitions stand in front of their first message, often in the first chunk, and once
            # more behind the data: so that a damaged first chunk costs no other.
            definitions = ((opcode, body) for opcode, body, whole in _records(
                content, len(_MCAP_MAGIC)) if whole and opcode in (0x03, 0x04))
            for opcode, body in chain(definitions, self._flat_records(content)):
                try:
                    if opcode == 0x03:
                        (key,) = struct.unpack_from('<H', body)
                        name, at = _text(body, 2)
                        encoding, at = _text(body, at)
                        schemas[key] = (name, encoding, _text(body, at)[0])
                    elif opcode == 0x04:
                        key, schema = struct.unpack_from('<HH', body)
                        channels[key] = (_text(body, 4)[0], *schemas.get(schema, ('', '', '')))
                    elif opcode == 0x05:
                        key, _, received = struct.unpack_from('<HIQ', body)
                        if key in channels:
                            yield _FoundMessage(*channels[key], received, body[22:])
                except (struct.error, UnicodeDecodeError):
                    self.damaged += 1

    def _flat_records(self, content: mmap.mmap) -> Iterator[tuple[int, bytes]]:
        """Yield the schemas, channels and messages up to the first that is incomplete.

        They stand in the file itself or in chunks, which are opened; of a chunk cut off, or of one
        that was written in part, the whole records in front count.
        """
        for opcode, body, whole in _records(content, len(_MCAP_MAGIC)):
            if opcode == 0x06:
                records = self._chunk(body, whole)
                for inner, inner_body, inner_whole in _records(records, 0):
                    if inner_whole:
                        yield inner, inner_body
            elif not whole or opcode in (0x00, 0x02, 0x0F):  # damage, footer, end of data
                return
            else:
                yield opcode, body

    def _chunk(self, body: bytes, whole: bool) -> bytes:
        """Return the records of a chunk, as far as they can be read."""
        try:
            _, _, size, checksum = struct.unpack_from('<QQQI', body)
            compression, at = _text(body, 28)
            packed = body[at + 8:]
            if compression == 'zstd':
                records = zstd.ZstdDecompressor().decompress(packed)
            elif compression == 'lz4':
                records = lz4.frame.LZ4FrameDecompressor().decompress(packed)
            else:
                records = packed
        except (struct.error, UnicodeDecodeError, zstd.ZstdError, RuntimeError):
            self.damaged += 1
            return b''
        if not whole:
            self.damaged += 1
        elif len(records) != size or (checksum and crc32(records) != checksum):
            self.damaged += 1
            return b''
        return records


def _admit_missing_pages(database: Path) -> bool:
    """Return whether pages are missing at the end; then the header, made to agree, lets it open.

    sqlite3 refuses a file with fewer pages than the header says, though those there are good.
    """
    with database.open('r+b') as stream:
        header = stream.read(100)
        if len(header) < 100:  # sqlite3 itself says that it is none
            return False
        page_size, said = struct.unpack('>H10xI', header[16:32])
        page_size = 65536 if page_size == 1 else max(page_size, 512)
        pages = database.stat().st_size // page_size
        if pages >= said:
            return False
        stream.truncate(pages * page_size)
        stream.seek(28)
        stream.write(struct.pack('>I', pages))
        return True


def _records(content: bytes | mmap.mmap, start: int) -> Iterator[tuple[int, bytes, bool]]:
    """Yield opcode and body of MCAP records from `start` on, and whether the body is whole."""
    at = start
    while at + 9 <= len(content):
        opcode, size = struct.unpack_from('<BQ', content, at)
        body = content[at + 9:at + 9 + size]
        yield opcode, body, len(body) == size
        at += 9 + size


def _text(body: bytes, at: int) -> tuple[str, int]:
    """Return the string of an MCAP record that starts at `at`, and where it ends."""
    (size,) = struct.unpack_from('<I', body, at)
    return body[at + 4:at + 4 + size].decode(), at + 4 + size


def repair_bag(path: str | Path, output: str | Path) -> RepairSummary:
    """Write what a cut-off bag still holds as a complete bag; `path` stays as it is.

    Recovers MCAP without its end (records and chunks are scanned from the front, a chunk cut in
    the middle gives the messages in front of the cut) and sqlite3 with a journal or with missing
    pages, with or without compression and metadata.yaml.

    Args:
        path: folder of the bag, or one .mcap or .db3 file.
        output: folder to be made; it appears when it is complete.

    Raises:
        InputError: no such bag, not a bag, nothing left in it, or `output` exists.
    """
    path, output = Path(path), Path(output)
    if not path.exists():
        raise InputError(f'{path}: no such bag; give the folder of a rosbag2, or its .mcap or .db3 '
                         'file')
    if output.exists():
        raise InputError(f'{output}: exists already; give another path or remove it')
    files = storage_files(path)
    storage = STORAGE_SUFFIXES[Path(files[0].name.removesuffix(ZSTD_SUFFIX)).suffix]
    salvage = _Salvage()
    messages: Counter[str] = Counter()
    left_out: dict[str, str] = {}
    with (written_atomically(output, new=True) as scratch,
          BagWriter(scratch, storage, output) as bag):
        for found in (message for file in files for message in salvage.messages(file)):
            if found.topic in left_out:
                continue
            if found.topic not in messages:
                try:
                    bag.declare_type(found.type, found.encoding, found.definition)
                except InputError:
                    left_out[found.topic] = found.type
                    continue
            # Message compression is written down in metadata.yaml only; no CDR begins like zstd.
            try:
                data = zstd.decompress(found.data) if found.data[:4] == _ZSTD_MAGIC else found.data
            except (zstd.ZstdError, EOFError):
                salvage.damaged += 1
                continue
            bag.write_raw(found.topic, found.type, found.received, data)
            messages[found.topic] += 1
        if not messages:
            raise InputError(f'{path}: no message can be recovered; record the bag again')
    return RepairSummary(path, output, dict(messages), salvage.damaged, left_out)
