"""Readers and writers of recordings: rosbag 1, rosbag 2 and MCAP.

Times are ns as in the recording: since the Unix epoch, or since the start of a simulated run. A rosbag 1 or
MCAP file whose writer was killed has no index; it is recovered record by record from the start.
"""

from __future__ import annotations

import bz2
import shutil
import struct
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from io import BytesIO
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Literal, NamedTuple, Protocol, Self

import lz4.frame
import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, Schema
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import ReaderError as Reader1Error
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag1 import WriterError as Writer1Error
from rosbags.rosbag1 import reader as rosbag1_reader
from rosbags.rosbag2 import Reader as Reader2
from rosbags.rosbag2 import ReaderError as Reader2Error
from rosbags.rosbag2 import StoragePlugin, storage_mcap
from rosbags.rosbag2 import Writer as Writer2
from rosbags.rosbag2 import WriterError as Writer2Error
from rosbags.typesys import get_types_from_idl
from rosbags.typesys.base import TypesysError

from volery.base.errors import UsageError
from volery.base.time import Ns, S
from volery.ros.messages.encodings import from_cdr, from_ros1, our_name, ros1_type, to_cdr, to_ros1
from volery.ros.messages.message import Message
from volery.ros.messages.store import message_class, message_name, parse_messages, store

_LENGTH = struct.Struct("<I")
_STAMP = struct.Struct("<II")
_MESSAGE, _CHUNK, _CONNECTION = 2, 5, 7
_LARGEST = 1 << 30
"""Length, bytes, above which a record is taken as damaged."""
MAX_CHUNK = 256 << 20
"""Decompressed size, bytes, above which a chunk is taken as damaged: 46 kB can hold 1.5 GB."""
MAX_SALVAGED = 2 << 30
"""Bytes of messages, decompressed, that are salvaged of a damaged recording: they are sorted in memory."""
DAMAGE = (
    Reader1Error,
    Reader2Error,
    McapError,
    TypesysError,
    zstandard.ZstdError,
    struct.error,
    EOFError,
    OSError,
    RuntimeError,
    ArithmeticError,
    AssertionError,
    LookupError,
    MemoryError,
    TypeError,
    ValueError,
)
"""What the readers of rosbags and mcap raise at damaged bytes."""


def decompressed(compression: str, data: bytes) -> bytes:
    """Return the content of a chunk.

    Raises:
        ValueError: The data is damaged, larger than ``MAX_CHUNK`` or compressed in an unknown way.
    """
    limit = MAX_CHUNK + 1
    try:
        match compression:
            case "" | "none":
                content = data
            case "bz2":
                content = bz2.BZ2Decompressor().decompress(data, limit)
            case "lz4":
                content = bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, limit))
            case "zstd":
                with zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK).stream_reader(data) as reader:
                    content = reader.read(limit)
            case _:
                raise ValueError(f"compression {compression!r} is unknown")
    except (OSError, RuntimeError, EOFError, zstandard.ZstdError) as error:
        raise ValueError(f"{compression} data is damaged: {error}") from None
    if len(content) > MAX_CHUNK:
        raise ValueError(f"a chunk holds more than {MAX_CHUNK} bytes")
    return content


# rosbags decompresses without a limit; its tables of decompressors are replaced.
storage_mcap.DECOMPRESSORS.update(
    lz4=lambda data, size: decompressed("lz4", data), zstd=lambda data, size: decompressed("zstd", data)
)
rosbag1_reader.decompressors.update(
    bz2=lambda data: decompressed("bz2", data), lz4=lambda data: decompressed("lz4", data)
)


class RawMessage(NamedTuple):
    """An encoded message of a recording, with type and definition of its connection."""

    at: Ns
    topic: str
    type: str
    definition: str
    data: bytes


def recover_rosbag1(path: Path) -> Iterator[RawMessage]:
    """Yield the complete messages of a rosbag of format 2.0, in the order of the file."""
    connections: dict[bytes, dict[str, bytes]] = {}
    with path.open("rb") as file:
        file.readline()
        for header, data in _records(file):
            kind = _kind(header)
            inner = _records(BytesIO(_unpacked(header, data))) if kind == _CHUNK else iter([(header, data)])
            for head, body in inner:
                found = _rosbag1_message(head, body, connections)
                if found is not None:
                    yield found


def _kind(header: dict[str, bytes]) -> int:
    return (header.get("op") or b"\0")[0]


def _rosbag1_message(
    header: dict[str, bytes], data: bytes, connections: dict[bytes, dict[str, bytes]]
) -> RawMessage | None:
    kind = _kind(header)
    number, stamp = header.get("conn", b""), header.get("time", b"")
    if kind == _CONNECTION and number:
        connections[number] = {"topic": header.get("topic", b""), **_fields(data)}
    connection = connections.get(number)
    if kind != _MESSAGE or connection is None or len(stamp) != _STAMP.size:
        return None
    seconds, rest = _STAMP.unpack(stamp)
    topic, name, text = (
        connection.get(key, b"").decode(errors="replace") for key in ("topic", "type", "message_definition")
    )
    return RawMessage(seconds * S + rest, topic, name, text, data)


def _records(file: BinaryIO) -> Iterator[tuple[dict[str, bytes], bytes]]:
    """Yield header and data of each complete record, and the part of a chunk at the end."""
    while True:
        header, whole = _block(file)
        if not whole:
            return
        fields = _fields(header)
        data, whole = _block(file)
        if whole or fields.get("op") == bytes([_CHUNK]):  # the last chunk may be incomplete
            yield fields, data


def _block(file: BinaryIO) -> tuple[bytes, bool]:
    """Return a block's data, and whether it is complete."""
    head = file.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return b"", False
    (length,) = _LENGTH.unpack(head)
    data = file.read(length) if length <= _LARGEST else b""
    return data, len(data) == length


def _fields(header: bytes) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    place = 0
    while place + _LENGTH.size <= len(header):
        (length,) = _LENGTH.unpack_from(header, place)
        place += _LENGTH.size
        name, _, value = header[place : place + length].partition(b"=")
        found[name.decode(errors="replace")] = value
        place += length
    return found


def _unpacked(header: dict[str, bytes], data: bytes) -> bytes:
    """Return a chunk's content, decompressed; empty if it is damaged."""
    try:
        return decompressed(header.get("compression", b"none").decode(errors="replace"), data)
    except ValueError:
        return b""


def recover_mcap(path: Path) -> Iterator[RawMessage]:
    """Yield the complete messages of an MCAP file, in the order of the file. Damaged chunks are skipped."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    with path.open("rb") as file:
        try:
            for record in _mcap_records(file):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, McapMessage) and record.channel_id in channels:
                    channel = channels[record.channel_id]
                    schema = schemas.get(channel.schema_id)
                    name = schema.name if schema else ""
                    text = schema.data.decode(errors="replace") if schema else ""
                    yield RawMessage(record.log_time, channel.topic, name, text, record.data)
        except DAMAGE:
            return  # the file ends here or is damaged


def _mcap_records(file: BinaryIO) -> Iterator[object]:
    """Yield the records of an MCAP file, those of its chunks among them."""
    for record in StreamReader(file, emit_chunks=True, record_size_limit=_LARGEST).records:
        if not isinstance(record, Chunk):
            yield record
            continue
        with suppress(*DAMAGE):
            content = decompressed(record.compression, record.data)
            whole = replace(record, compression="", data=content)
            yield from breakup_chunk(whole, validate_crc=True)


OF_THE_RUN = "/volery/"
"""Prefix of the topics of a run's trace that carry no ROS messages."""

ROSBAG1, ROSBAG2, MCAP = "rosbag 1", "rosbag 2", "MCAP"
_SUFFIXES = {".bag": ROSBAG1, ".mcap": MCAP, ".db3": ROSBAG2}


class BagTopic(NamedTuple):
    """A recorded topic, its type (``package/msg/Name``) and its number of messages."""

    name: str
    type: str
    messages: int


class BagMessage(NamedTuple):
    """A recorded message."""

    at: Ns
    topic: str
    message: Message


@dataclass(frozen=True)
class Bag:
    """A recording.

    Attributes:
        path: The file or folder.
        format: ``ROSBAG1``, ``ROSBAG2`` or ``MCAP``.
        topics: All recorded topics, by name.
        start: Time of the first message, ns.
        end: Time of the last message, ns.
        complete: False if the recording was cut short; its complete messages are read.
        unreadable: Reasons why messages of a topic cannot be decoded, by topic.
        damage: What was found to be damaged while messages were read; their reader appends to it.
    """

    path: Path
    format: str
    topics: tuple[BagTopic, ...]
    start: Ns
    end: Ns
    complete: bool
    unreadable: dict[str, str]
    damage: list[str] = field(default_factory=list, compare=False)

    @property
    def usual(self) -> list[str]:
        """Topics that are read by default: all that can be decoded, without those of a run's trace."""
        names = (topic.name for topic in self.topics if not topic.name.startswith(OF_THE_RUN))
        return [name for name in names if name not in self.unreadable]

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Yield the messages of `topics` (by default of all that can be decoded), in order of time."""
        readable = {topic.name: topic.type for topic in self.topics if topic.name not in self.unreadable}
        wanted = readable if topics is None else {name: readable[name] for name in topics if name in readable}
        decode = from_ros1 if self.format == ROSBAG1 else from_cdr
        for raw in self._raw():
            if raw.topic in wanted:
                try:
                    message = decode(wanted[raw.topic], raw.data)
                except (UsageError, RecursionError, *DAMAGE):
                    self._note(f"messages of {raw.topic} that do not fit their type are left out")
                    continue
                yield BagMessage(raw.at, raw.topic, message)

    def _note(self, what: str) -> None:
        if what not in self.damage:
            self.damage.append(what)

    def _raw(self) -> Iterator[RawMessage]:
        if not self.complete:
            yield from self._salvaged()
            return
        last, given = -1, Counter[tuple[str, bytes]]()  # of the messages at time `last`
        try:
            with _reader(self.path, self.format) as reader:
                for connection, at, data in reader.messages():
                    raw = RawMessage(at, connection.topic, connection.msgtype, "", bytes(data))
                    if at != last:
                        last, given = at, Counter()
                    given[raw.topic, raw.data] += 1
                    yield raw
        except DAMAGE as error:
            self._note(f"a part of {self.path} is damaged and left out: {error}")
            for raw in self._salvaged():
                if raw.at == last and given[raw.topic, raw.data]:
                    given[raw.topic, raw.data] -= 1
                elif raw.at >= last:
                    yield raw

    def _salvaged(self) -> list[RawMessage]:
        """Return the complete messages of the undamaged chunks, in order of time."""
        if self.format == ROSBAG2 and self.path.is_dir():
            files = sorted(self.path.glob("*.mcap"))
        else:
            files = [self.path]
        recover = recover_rosbag1 if self.format == ROSBAG1 else recover_mcap
        found, size = [], 0
        for raw in chain.from_iterable(recover(file) for file in files):
            size += len(raw.data)
            if size > MAX_SALVAGED:
                self._note(f"{self.path} is damaged; only its first {MAX_SALVAGED >> 20} MB are salvaged")
                break
            found.append(raw)
        return sorted(found, key=lambda raw: raw.at)


def open_bag(path: Path) -> Bag:
    """Open a recording.

    Args:
        path: A ``.bag`` or ``.mcap`` file, or the folder of a rosbag 2.

    Raises:
        UsageError: there is none, or nothing of it can be read.
    """
    if not path.exists():
        raise UsageError(f"no recording {path}")
    kind = ROSBAG2 if path.is_dir() else _SUFFIXES.get(path.suffix)
    if kind is None:
        raise UsageError(f"{path}: a recording is a .bag or .mcap file, or the folder of a rosbag 2")
    try:
        return _indexed(path, kind)
    except DAMAGE as error:
        if kind != ROSBAG2:
            return _salvaged(path, kind, str(error))
        inside = sorted(path.glob("*.mcap")) if path.is_dir() else []
        if not inside:
            raise UsageError(f"{path} is no rosbag 2 that can be read: {error}") from error
        return _salvaged(inside[0], MCAP, str(error))


def _reader(path: Path, kind: str) -> Any:
    return Reader1(path) if kind == ROSBAG1 else Reader2(path)


def _indexed(path: Path, kind: str) -> Bag:
    with _reader(path, kind) as reader:
        topics: dict[str, BagTopic] = {}
        unreadable: dict[str, str] = {}
        for connection in reader.connections:
            known = topics.get(connection.topic)
            count = (connection.msgcount or 0) + (known.messages if known else 0)
            topics[connection.topic] = BagTopic(connection.topic, connection.msgtype, count)
            text = connection.msgdef.data if connection.msgdef is not None else ""
            idl = connection.msgdef is not None and connection.msgdef.format == MessageDefinitionFormat.IDL
            _learn(connection.topic, connection.msgtype, text, unreadable, idl=idl)
        start, end = (reader.start_time, reader.end_time - 1) if reader.message_count else (0, 0)
    listed = tuple(topics[name] for name in sorted(topics))
    return Bag(path, kind, listed, start, end, True, unreadable)


def _salvaged(path: Path, kind: str, problem: str) -> Bag:
    found: dict[str, BagTopic] = {}
    unreadable: dict[str, str] = {}
    times: list[Ns] = []
    for raw in recover_rosbag1(path) if kind == ROSBAG1 else recover_mcap(path):
        name = raw.type if raw.type.count("/") == 2 else our_name(raw.type)
        if raw.topic not in found:
            _learn(raw.topic, name, raw.definition, unreadable)
        count = found[raw.topic].messages if raw.topic in found else 0
        found[raw.topic] = BagTopic(raw.topic, name, count + 1)
        times.append(raw.at)
    if not times:
        raise UsageError(f"{path}: nothing of it can be read: {problem}")
    listed = tuple(found[name] for name in sorted(found))
    return Bag(path, kind, listed, min(times), max(times), False, unreadable)


def _learn(topic: str, name: str, text: str, unreadable: dict[str, str], *, idl: bool = False) -> None:
    """Define unknown types from the recording's definitions."""
    if name in store().fielddefs:
        return
    try:
        parsed = get_types_from_idl(text) if idl else parse_messages(name, text)
        store().register({key: what for key, what in parsed.items() if key not in store().fielddefs})
    except (RecursionError, SyntaxError, *DAMAGE) as error:  # classes are made of source code
        problem = str(error)
    else:
        problem = "" if name in store().fielddefs else "the name cannot be that of a type"
    if problem:
        unreadable[topic] = f"its type {name} is not known and not defined in the recording: {problem}"


_METADATA_VERSION: Literal[9] = 9
"""Version of rosbag2's metadata.yaml; Jazzy and later write it, Iron and later read it."""


class BagWriter(Protocol):
    """A recording in progress; a context manager. It must be closed to be complete."""

    def write(self, topic: str, at: Ns, message: Message) -> None:
        """Add a message at time `at`, ns; raise ``UsageError`` if this format does not support its type."""

    def close(self) -> None:
        """Complete the recording."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None: ...


class _Writer:
    def __init__(self, path: Path, writer: Any) -> None:
        self._path = path
        self._writer = writer
        self._connections: dict[str, tuple[str, Connection]] = {}
        try:
            writer.open()
        except (Writer1Error, Writer2Error, OSError) as error:
            raise UsageError(f"{path} cannot be written: {error}") from error

    def _connection(self, topic: str, name: str) -> Connection:
        known = self._connections.get(topic)
        if known is None:
            known = self._connections[topic] = name, self._connect(topic, name)
        if known[0] != name:
            raise UsageError(f"{self._path}: topic {topic} carries {known[0]}, not {name}")
        return known[1]

    def _connect(self, topic: str, name: str) -> Connection:
        raise NotImplementedError

    def close(self) -> None:
        """Complete the recording."""
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


class Rosbag1Writer(_Writer):
    """Writer of a ``.bag`` file, which ROS 1 and Debian's ``rosbag`` read."""

    def __init__(self, path: Path) -> None:
        path.unlink(missing_ok=True)
        super().__init__(path, Writer1(path))

    def _connect(self, topic: str, name: str) -> Connection:
        kind = ros1_type(name)
        made: Connection = self._writer.add_connection(
            topic, message_name(name), msgdef=kind.text, md5sum=kind.md5
        )
        return made

    def write(self, topic: str, at: Ns, message: Message) -> None:
        """Add a message."""
        self._writer.write(self._connection(topic, message.__msgtype__), at, to_ros1(message))


class Rosbag2Writer(_Writer):
    """Writer of a folder with an MCAP file, which ``ros2 bag``, Foxglove and PlotJuggler read."""

    def __init__(self, path: Path) -> None:
        if path.is_dir() and (path / "metadata.yaml").exists():
            shutil.rmtree(path)
        super().__init__(path, Writer2(path, version=_METADATA_VERSION, storage_plugin=StoragePlugin.MCAP))

    def _connect(self, topic: str, name: str) -> Connection:
        message_class(name)
        made: Connection = self._writer.add_connection(topic, message_name(name), typestore=store())
        return made

    def write(self, topic: str, at: Ns, message: Message) -> None:
        """Add a message."""
        self._writer.write(self._connection(topic, message.__msgtype__), at, to_cdr(message))


def create_bag(path: Path) -> BagWriter:
    """Begin a recording; an older one of the same kind is replaced.

    Args:
        path: ``NAME.bag`` for a rosbag 1, any other name for the folder of a rosbag 2 in MCAP.

    Raises:
        UsageError: it cannot be written there.
    """
    return Rosbag1Writer(path) if path.suffix == ".bag" else Rosbag2Writer(path)
