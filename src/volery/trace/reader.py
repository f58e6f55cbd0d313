"""The reader of a trace, complete or cut anywhere.

A trace whose writer was killed has no summary and may end within a chunk. The reader therefore never uses the
summary: it goes through the records from the start, takes every whole one and reports what is missing.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from zstandard import ZstdDecompressor, ZstdError

from volery.base.errors import UsageError
from volery.base.time import Ns, clock
from volery.trace.attachments import SETUP_ATTACHMENT, RunSetup, setup_from_json
from volery.trace.encoding import OWN_EVENTS, EventCodec, type_name
from volery.trace.events import Event, Published
from volery.trace.mcap_writer import COMPRESSION, MAGIC, TRACE_SCHEMA, Attachment

_Decoder = Callable[[Ns, bytes], Event | None]
_MESSAGE = int(Opcode.MESSAGE)
_HEAD = struct.Struct("<BQ")
_FRAME = struct.Struct("<HIQQ")
# start, end, uncompressed size, checksum, length of the name of the compression
_CHUNK_HEAD = struct.Struct("<QQQII")
_CHUNK_OVERHEAD = _CHUNK_HEAD.size + 8
_LARGEST_CHUNK = 1 << 30  # bytes; one of volery has a second of events
_DAMAGE = (McapError, ZstdError, struct.error, ValueError, LookupError, TypeError, OverflowError)
"""What damaged records raise in ``mcap.records`` and here."""


@dataclass(frozen=True)
class Trace:
    """A run, read back: its events in the order in which they were recorded.

    ``complete`` is False if the writer never finished; ``lost`` then states what is missing.
    """

    setup: RunSetup
    events: tuple[Event, ...]
    attachments: dict[str, Attachment] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    complete: bool = True
    lost: str = ""


def read(path: Path) -> Trace:
    """Read the trace in a file.

    Raises:
        UsageError: it is no trace, or cut before its set-up.
    """
    with OpenTrace(path) as reading:
        events = tuple(reading.events())
    return Trace(reading.setup, events, reading.attachments, reading.metadata, reading.complete, reading.lost)


class _ChunkRecord(NamedTuple):
    opcode: int
    content: bytes
    missing: int  # bytes that are cut off


class OpenTrace:
    """An open trace: iterate over ``events()`` once, then see ``complete`` and ``lost``.

    The set-up and the attachments made at the start are available at once, later ones when ``events()`` has
    passed them. A context manager, since it holds the file open.

    Raises:
        UsageError: it is no trace, or cut before its set-up.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.attachments: dict[str, Attachment] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.complete = False
        self.lost = ""
        self._schemas: dict[int, str] = {}
        self._decoders: dict[int, _Decoder | None] = {}
        self._wanted: Callable[[type[Any]], bool] = lambda kind: True
        self._last: Ns = 0
        try:
            self._file: BinaryIO = path.open("rb")
        except OSError as error:
            raise UsageError(f"cannot read {path}: {error.strerror or error}") from error
        self._size = path.stat().st_size
        self._records = self._walk()
        self._pending: _ChunkRecord | None = None
        try:
            if self._file.read(len(MAGIC)) != MAGIC:
                raise UsageError(f"{path} is not a trace: it does not begin as an MCAP file does")
            self.setup = self._read_beginning()
        except UsageError:
            self._file.close()
            raise

    def __enter__(self) -> OpenTrace:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def events(self, only: Collection[type[Any]] | None = None) -> Iterator[Event]:
        """Yield all events, or those of the kinds in *only*, in the order in which they were recorded."""
        if only is not None:
            self._wanted = only.__contains__
        record = self._pending
        while record is not None:
            if record.opcode == Opcode.CHUNK:
                try:
                    yield from self._events_of_chunk(record)
                except _DAMAGE as error:
                    self._lose(f"a part that follows {clock(self._last)} is damaged: {error}")
            elif record.opcode == Opcode.DATA_END:
                self.complete = not record.missing
            record = self._next()
        if not (self.complete and self._ends_well()):
            self._lose(f"the writer never finished; what follows {clock(self._last)} is missing")
        self.complete = not self.lost

    def _lose(self, what: str) -> None:
        if what not in self.lost:
            self.lost = f"{self.lost}; {what}" if self.lost else what

    def _read_beginning(self) -> RunSetup:
        self._pending = self._next()
        while self._pending is not None and self._pending.opcode != Opcode.CHUNK:
            if self._pending.opcode == Opcode.DATA_END:
                break
            self._pending = self._next()
        if self.metadata.get("volery", {}).get("schema", TRACE_SCHEMA) != TRACE_SCHEMA:
            found = self.metadata["volery"]["schema"]
            raise UsageError(f"{self.path} has schema {found!r}; this version reads {TRACE_SCHEMA!r}")
        if SETUP_ATTACHMENT not in self.attachments:
            what = "does not contain the set-up of its run: cut too early, or not a trace of volery"
            raise UsageError(f"{self.path} {what}")
        return setup_from_json(self.attachments[SETUP_ATTACHMENT].data)

    def _walk(self) -> Iterator[_ChunkRecord]:
        while True:
            head = self._file.read(_HEAD.size)
            if len(head) < _HEAD.size:
                return
            opcode, length = _HEAD.unpack(head)
            content = self._file.read(min(length, self._size))
            yield _ChunkRecord(opcode, content, length - len(content))
            if opcode in (Opcode.DATA_END, Opcode.FOOTER) or len(content) < length:
                return

    def _next(self) -> _ChunkRecord | None:
        """Return the next record, after storing attachments and metadata."""
        record = next(self._records, None)
        if record is None or record.missing:
            return record
        try:
            if record.opcode == Opcode.ATTACHMENT:
                found = records.Attachment.read(_stream(record.content))
                self.attachments[found.name] = Attachment(found.name, found.media_type, found.data)
            elif record.opcode == Opcode.METADATA:
                words = records.Metadata.read(_stream(record.content))
                self.metadata[words.name] = dict(words.metadata)
        except _DAMAGE as error:
            self._lose(f"an attachment is damaged: {error}")
        return record

    def _ends_well(self) -> bool:
        self._file.seek(0, 2)
        self._file.seek(max(0, self._file.tell() - len(MAGIC)))
        return self._file.read() == MAGIC

    def _events_of_chunk(self, record: _ChunkRecord) -> Iterator[Event]:
        if len(record.content) < _CHUNK_OVERHEAD:
            return
        *_, size, checksum, name_length = _CHUNK_HEAD.unpack_from(record.content)
        content = record.content[_CHUNK_HEAD.size :]
        compression, content = content[:name_length].decode(), content[name_length + 8 :]
        if compression == COMPRESSION:
            body = _decompressed(content, size)
        elif compression:
            what = f"is compressed by {compression!r}; traces of volery are by {COMPRESSION} or not at all"
            raise UsageError(f"{self.path} {what}")
        else:
            body = content
        if checksum and not record.missing and zlib.crc32(body) != checksum:  # 0: none was computed
            self._lose(f"a part that follows {clock(self._last)} is damaged: its checksum is wrong")
            return
        yield from self._events_of_body(body)

    def _events_of_body(self, body: bytes) -> Iterator[Event]:
        at, size = 0, len(body)
        while at + _HEAD.size <= size:
            opcode, length = _HEAD.unpack_from(body, at)
            at += _HEAD.size
            if at + length > size:
                return
            if opcode == _MESSAGE:
                channel, _, log, _ = _FRAME.unpack_from(body, at)
                self._last = max(self._last, log)
                decode = self._decoders.get(channel, self._unknown_channel)
                if decode is not None:
                    event = decode(log, body[at + _FRAME.size : at + length])
                    if event is not None:
                        yield event
            elif opcode == Opcode.SCHEMA:
                schema = records.Schema.read(_stream(body[at : at + length]))
                self._schemas[schema.id] = schema.name
            elif opcode == Opcode.CHANNEL:
                channel = records.Channel.read(_stream(body[at : at + length]))
                self._decoders[channel.id] = self._decoder(channel)
            at += length

    def _decoder(self, channel: records.Channel) -> _Decoder | None:
        """Return what makes events of the messages of *channel*, None if they are not wanted."""
        schema, topic = self._schemas[channel.schema_id], channel.topic
        codec = _codecs().get(schema)
        if not self._wanted(Published if codec is None else codec.kind):
            return None
        if codec is None:
            publisher = channel.metadata.get("publisher", "")
            return lambda log, data: Published(log, topic, schema, publisher, data)
        decode = codec.decode

        def read_own(_: Ns, data: bytes) -> Event:
            try:
                event: Event = decode(data)
            except (ValueError, struct.error) as error:
                what = f"holds a {schema} that this version cannot read: {error}"
                raise UsageError(f"{self.path} {what}") from error
            return event

        return read_own

    def _unknown_channel(self, _: Ns, __: bytes) -> None:
        self._lose("what a channel carries stood in a damaged part: its events are missing")


@cache
def _codecs() -> dict[str, EventCodec]:
    return {type_name(kind): EventCodec(kind) for kind in OWN_EVENTS}


def _decompressed(content: bytes, size: int) -> bytes:
    """Return the *size* bytes in *content*, fewer if it is cut."""
    with ZstdDecompressor().stream_reader(content) as stream:
        return stream.read(min(size, _LARGEST_CHUNK))


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))
