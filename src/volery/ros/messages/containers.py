"""The files of recordings: records and chunks of rosbag 1 and MCAP, with or without an index.

A file whose writer was killed has no index, and one may be damaged; it is read record by record from the
start. Messages stay bytes here; ``recorded_types`` decodes them by their connection's definition.
"""

from __future__ import annotations

import bz2
import sqlite3
import struct
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import replace
from heapq import heappop, heappush
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, ChunkIndex, Footer, Schema
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag1,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    Qos,
    QosDurability,
)
from rosbags.rosbag1 import ReaderError as Reader1Error
from rosbags.rosbag1 import reader as rosbag1_reader
from rosbags.rosbag2 import Reader as Reader2
from rosbags.rosbag2 import ReaderError as Reader2Error
from rosbags.rosbag2.metadata import ReaderMetadata, parse_qos
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.typesys.base import TypesysError

from volery.base.time import Ns, S
from volery.ros.messages.encodings import our_name
from volery.ros.messages.json_schemas import ros_name_of

_LENGTH = struct.Struct("<I")
_STAMP = struct.Struct("<II")
_MESSAGE, _CHUNK, _CONNECTION = 2, 5, 7
_LARGEST = 1 << 30
"""Length, bytes, above which a record is taken as damaged."""
MAX_CHUNK = 256 << 20
"""Decompressed size, bytes, above which a chunk is taken as damaged: 46 kB can hold 1.5 GB."""
DAMAGE = (
    Reader1Error,
    Reader2Error,
    McapError,
    TypesysError,
    sqlite3.Error,
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
    """Return the content of a chunk, which may be of several frames.

    Raises:
        ValueError: The data is damaged, larger than ``MAX_CHUNK`` or compressed in an unknown way.
    """
    limit = MAX_CHUNK + 1
    try:
        match compression:
            case "" | "none":
                content = data
            case "bz2":
                content = _of_frames(bz2.BZ2Decompressor, data, limit)
            case "lz4":
                content = _of_frames(lz4.frame.LZ4FrameDecompressor, data, limit)
            case "zstd":
                with zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK).stream_reader(
                    data, read_across_frames=True
                ) as reader:
                    content = reader.read(limit)
            case _:
                raise ValueError(f"compression {compression!r} is unknown")
    except (OSError, RuntimeError, EOFError, zstandard.ZstdError) as error:
        raise ValueError(f"{compression} data is damaged: {error}") from None
    if len(content) > MAX_CHUNK:
        raise ValueError(f"a chunk holds more than {MAX_CHUNK} bytes")
    return content


def _of_frames(decompressor: Any, data: bytes, limit: int) -> bytes:
    content = b""
    while data and len(content) < limit:
        one = decompressor()
        content += bytes(one.decompress(data, limit - len(content)))
        if not one.eof:
            break
        data = one.unused_data or b""
    return content


# rosbags decompresses without a limit; its table of decompressors is replaced.
rosbag1_reader.decompressors.update(
    bz2=lambda data: decompressed("bz2", data), lz4=lambda data: decompressed("lz4", data)
)


class Offer(NamedTuple):
    """What is known of a connection beside its type.

    Attributes:
        latched: Whether late subscribers get the last message: latched in ROS 1, transient local in ROS 2.
        sender: Name of the publishing node; empty if it was not recorded.
        qos: Profiles that ROS 2's publishers of the topic offer.
    """

    latched: bool = False
    sender: str = ""
    qos: tuple[Qos, ...] = ()


NO_OFFER = Offer()


class RecordedTopic(NamedTuple):
    """A connection as a recording states it: a topic, and the type, encoding and definition of its messages.

    Attributes:
        topic: Name of the topic.
        type: Name of the type, as written.
        encoding: ``cdr``, ``ros1`` or another encoding of the messages.
        schema: ``msg``, ``idl`` or another language of the definition; empty without one.
        definition: Text that defines the type.
        digest: Checksum of the definition, if it is recorded.
        offer: What is known beside the type.
    """

    topic: str
    type: str
    encoding: str
    schema: str
    definition: str
    digest: str = ""
    offer: Offer = NO_OFFER


class RawMessage(NamedTuple):
    """An encoded message of a recording, with its connection."""

    at: Ns
    source: RecordedTopic
    data: bytes


_LANGUAGES = {MessageDefinitionFormat.MSG: "msg", MessageDefinitionFormat.IDL: "idl"}


def source_of(connection: Connection) -> RecordedTopic:
    """Return a connection of rosbags' readers."""
    ext, name = connection.ext, connection.msgtype
    if isinstance(ext, ConnectionExtRosbag2):
        qos = tuple(ext.offered_qos_profiles)
        encoding, offer = ext.serialization_format, Offer(is_latched(qos), "", qos)
    else:
        encoding, offer = "ros1", Offer(bool(ext.latching), ext.callerid or "")
        name = our_name(name.replace("/msg/", "/"))
    language, text = _LANGUAGES.get(connection.msgdef.format, ""), connection.msgdef.data
    return RecordedTopic(connection.topic, name, encoding, language, text, connection.digest, offer)


def is_latched(profiles: Collection[Qos]) -> bool:
    """Return whether one of the profiles keeps messages for late subscribers."""
    return any(profile.durability == QosDurability.TRANSIENT_LOCAL for profile in profiles)


# -- rosbag 1


def recover_rosbag1(path: Path) -> Iterator[RawMessage]:
    """Yield the complete messages of a rosbag of format 2.0, in the order of the file."""
    connections: dict[bytes, RecordedTopic] = {}
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
    header: dict[str, bytes], data: bytes, connections: dict[bytes, RecordedTopic]
) -> RawMessage | None:
    kind = _kind(header)
    number, stamp = header.get("conn", b""), header.get("time", b"")
    if kind == _CONNECTION and number:
        fields = {
            key: value.decode(errors="replace")
            for key, value in {"topic": header.get("topic", b""), **_fields(data)}.items()
        }
        offer = Offer(fields.get("latching") == "1", fields.get("callerid", ""))
        text, sum_ = fields.get("message_definition", ""), fields.get("md5sum", "")
        name = our_name(fields.get("type", ""))
        connections[number] = RecordedTopic(fields["topic"], name, "ros1", "msg", text, sum_, offer)
    connection = connections.get(number)
    if kind != _MESSAGE or connection is None or len(stamp) != _STAMP.size:
        return None
    seconds, rest = _STAMP.unpack(stamp)
    return RawMessage(seconds * S + rest, connection, data)


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


# -- MCAP


_SCHEMAS = {"ros2msg": "msg", "ros1msg": "msg", "ros2idl": "idl", "omgidl": "idl"}
_TRUE = ("1", "true", "True")


def _qos(text: str) -> list[Qos]:
    with suppress(*DAMAGE):
        return parse_qos(text)
    return []


def _connection_of(channel: Channel, schema: Schema | None, count: int = 0) -> Connection:
    """Return a channel in the terms of rosbags, which know two languages of definitions."""
    schema = schema or Schema(0, b"", "", "")
    format_ = {"msg": MessageDefinitionFormat.MSG, "idl": MessageDefinitionFormat.IDL}.get(
        _SCHEMAS.get(schema.encoding, ""), MessageDefinitionFormat.NONE
    )
    text, metadata = schema.data.decode(errors="replace"), channel.metadata
    ext: ConnectionExtRosbag1 | ConnectionExtRosbag2 = ConnectionExtRosbag2(
        channel.message_encoding, _qos(metadata.get("offered_qos_profiles", ""))
    )
    if channel.message_encoding == "ros1":
        ext = ConnectionExtRosbag1(metadata.get("callerid"), int(metadata.get("latching") in _TRUE))
    digest = metadata.get("md5sum", "") or metadata.get("topic_type_hash", "")
    definition = MessageDefinition(format_, text)
    name = ros_name_of(schema.name) if channel.message_encoding == "json" and schema.name else schema.name
    return Connection(channel.id, channel.topic, name, definition, digest, count, ext, None)


def recover_mcap(path: Path, damage: list[str]) -> Iterator[RawMessage]:
    """Yield the complete messages of an MCAP file, in the order of the file. Damaged chunks are skipped.

    Args:
        path: The file.
        damage: What is damaged or missing is added to it.
    """
    schemas: dict[int, Schema] = {}
    sources: dict[int, RecordedTopic] = {}
    ended = False
    with path.open("rb") as file:
        try:
            for record in _mcap_records(file, damage):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    sources[record.id] = source_of(_connection_of(record, schemas.get(record.schema_id)))
                elif isinstance(record, McapMessage) and record.channel_id in sources:
                    yield RawMessage(record.log_time, sources[record.channel_id], record.data)
                ended = ended or isinstance(record, Footer)
        except DAMAGE as error:
            damage.append(str(error) or type(error).__name__)
    if not ended:
        damage.append("its end is missing")


def _mcap_records(file: BinaryIO, damage: list[str]) -> Iterator[object]:
    """Yield the records of an MCAP file, those of its chunks among them."""
    for record in StreamReader(file, emit_chunks=True, record_size_limit=_LARGEST).records:
        if not isinstance(record, Chunk):
            yield record
            continue
        try:
            inner = _records_of(record)
        except DAMAGE as error:
            damage.append(str(error) or type(error).__name__)
        else:
            yield from inner


def _records_of(chunk: Chunk) -> list[Any]:
    content = decompressed(chunk.compression, chunk.data)
    return breakup_chunk(replace(chunk, compression="", data=content), validate_crc=True)


class NotIndexedError(ValueError):
    """An MCAP file that is to be read from start to end."""


class McapStorage:
    """Reader of an indexed MCAP file with messages of any encoding, as rosbags' readers call it.

    Raises:
        NotIndexedError: when it is opened, if the file has no index of its chunks.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: BinaryIO | None = None
        self._chunks: list[ChunkIndex] = []
        self.connections: list[Connection] = []
        self.metadata = ReaderMetadata(0, 2**63 - 1, 0, 0, None, None, None, None)

    def open(self) -> None:
        """Read the index."""
        self._file = self._path.open("rb")
        try:
            self._read_index(SeekingReader(self._file, record_size_limit=_LARGEST))
        except BaseException:
            self.close()
            raise

    def _read_index(self, reader: SeekingReader) -> None:
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            raise NotIndexedError("it has no index")
        statistics = summary.statistics
        counts = statistics.channel_message_counts
        if any(count not in summary.channels for count in counts) or (counts and not summary.chunk_indexes):
            raise NotIndexedError("its index is not complete")
        self._chunks = sorted(summary.chunk_indexes, key=lambda one: one.message_start_time)
        self.connections = [
            _connection_of(channel, summary.schemas.get(channel.schema_id), counts.get(number, 0))
            for number, channel in sorted(summary.channels.items())
        ]
        if statistics.message_count:
            start, end = statistics.message_start_time, statistics.message_end_time + 1
            self.metadata = self.metadata._replace(
                duration=end - start, start_time=start, end_time=end, message_count=statistics.message_count
            )

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def messages(
        self, connections: Collection[Connection], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, time and bytes of the messages in order of time, decompressing as it goes."""
        wanted = {connection.id: connection for connection in connections}
        waiting: list[tuple[int, int, Connection, bytes]] = []
        count = 0
        for chunk in self._chunks:
            while waiting and waiting[0][0] < chunk.message_start_time:
                at, _, connection, data = heappop(waiting)
                yield connection, at, data
            for record in _records_of(self._chunk_at(chunk)):
                if isinstance(record, McapMessage) and record.channel_id in wanted:
                    count += 1
                    heappush(waiting, (record.log_time, count, wanted[record.channel_id], record.data))
        while waiting:
            at, _, connection, data = heappop(waiting)
            yield connection, at, data

    def _chunk_at(self, index: ChunkIndex) -> Chunk:
        assert self._file is not None
        if not 0 < index.chunk_length <= _LARGEST:
            raise ValueError(f"a chunk of {index.chunk_length} bytes")
        self._file.seek(index.chunk_start_offset)
        stream = ReadDataStream(BytesIO(self._file.read(index.chunk_length)))
        stream.read1()
        stream.read8()
        chunk: Chunk = Chunk.read(stream)
        return chunk


class _Folder(DirectoryReader):
    """rosbags' reader of a folder, which drops messages whose connection the metadata states otherwise."""

    def open(self) -> None:
        """Open the files, and give their connections the QoS and the checksum that the metadata states."""
        super().open()
        for storage in self.storages:
            storage.connections = [self._aligned(connection) for connection in storage.connections]

    def _aligned(self, stored: Connection) -> Connection:
        same = [
            (place, one)
            for place, one in enumerate(self.connections)
            if (one.topic, one.msgtype) == (stored.topic, stored.msgtype)
        ]
        for _, one in same:
            if one.ext == stored.ext:
                return stored._replace(digest=one.digest)
        if not same:
            number = max((connection.id for connection in self.connections), default=0) + 1
            self.connections.append(stored._replace(id=number, owner=self))
            return stored
        place, stated = same[0]
        if isinstance(stated.ext, ConnectionExtRosbag2) and not stated.ext.offered_qos_profiles:
            stated = self.connections[place] = stated._replace(ext=stored.ext)
        return stored._replace(ext=stated.ext, digest=stated.digest)

    STORAGE_PLUGINS: Any = MappingProxyType({**DirectoryReader.STORAGE_PLUGINS, "mcap": McapStorage})


class Rosbag2Reader(Reader2):
    """rosbags' reader of folders and files of rosbag 2, with the reader of MCAP of this module."""

    STORAGE_PLUGINS: Any = MappingProxyType({**Reader2.STORAGE_PLUGINS, "dir": _Folder, ".mcap": McapStorage})
