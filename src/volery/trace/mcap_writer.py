"""Writer of the events of a run as an MCAP file with ROS 2 messages: ``trace.mcap``.

The same run gives the same bytes: no wall time, no version. Chunks end with each simulated second and are
written at once, so a killed process loses at most the last simulated second. They are compressed by zstd at a
fixed level; zstd's bytes depend on its own version alone, and the events in them on nothing.
Records other than messages are built by the ``mcap`` library; messages, of which there are millions, by
precompiled encoders.

Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections import defaultdict
from collections.abc import Callable, Iterable
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from zstandard import ZstdCompressor

from volery.base.files import Output
from volery.base.time import Ns, S
from volery.trace.attachments import SETUP_ATTACHMENT, RunSetup, to_json
from volery.trace.encoding import LITTLE_ENDIAN_CDR, OWN_EVENTS, Codec, type_name
from volery.trace.events import NONE, Event, Message, Published, Record, VehicleState

MAGIC = b"\x89MCAP0\r\n"
TRACE_SCHEMA = "volery-trace/1"
TRACE_FILE = "trace.mcap"
"""Name of the trace in a run folder."""

OUTCOME = "outcome"
"""The metadata that states how the run ended: ``status`` and ``reason``."""
MESSAGE_FRAME = "BQHIQQ"
"""The header of a message record: opcode, length, channel, sequence, log time, publish time."""
MESSAGE_OVERHEAD = struct.calcsize(f"<{MESSAGE_FRAME}") - 9
"""Bytes that a message record's length counts beside its data: the header without opcode and length."""
COMPRESSION = "zstd"
"""The compression of chunks, in the words of the format."""
_LEVEL = 3  # an eighth of the size; level 9 would save another quarter for six times the time
_ROS2_PROFILE = "ros2"
_MESSAGE = int(Opcode.MESSAGE)

Definitions = Callable[[str], str]
"""Returns the complete ``ros2msg`` text of a type such as ``std_msgs/msg/String``, dependencies included."""


class Attachment(NamedTuple):
    """A file that is attached to a trace."""

    name: str
    media_type: str
    data: bytes


def _no_definition(_: str) -> str:
    return ""


def _times(kind: type[Any]) -> Callable[[Any], tuple[Ns, Ns]]:
    """Return the function that gives an event's end and begin: MCAP's log time and publish time."""
    if kind is Message:
        return lambda event: (event.sent if event.received == NONE else event.received, event.sent)
    fields = kind._fields
    for log, publish in (("end", "start"), ("finished", "released"), ("at", "at")):
        if log in fields:
            return itemgetter(fields.index(log), fields.index(publish))
    raise TypeError(f"{kind.__name__} has no field for its time")


def _record(thing: records.McapRecord) -> bytes:
    builder = RecordBuilder()
    thing.write(builder)
    return builder.end()  # type: ignore[no-untyped-call, no-any-return]  # the library left it bare


class McapWriter:
    """A listener of the event stream that writes ``trace.mcap``. Call it with events, then ``close`` it.

    Args:
        path: The file to write. For a full disk, see ``Output``.
        setup: The set-up of the run, which is attached.
        attachments: Further files to attach.
        definitions: Returns the definition of each type of published message; called once a type.

    Raises:
        UsageError: the file cannot be created.
    """

    def __init__(
        self,
        path: Path,
        setup: RunSetup,
        attachments: Iterable[Attachment] = (),
        definitions: Definitions = _no_definition,
    ) -> None:
        self.path = path
        self._output = Output(path)
        self._definitions = definitions
        self._summary = _Summary()
        self._compressor = ZstdCompressor(level=_LEVEL)
        self._body = bytearray()
        self._indexes = _empty_indexes()
        self._chunk_ends: Ns = S
        self._schemas: dict[str, int] = {}
        self._published: dict[tuple[str, str, str], int] = {}
        self._writers: dict[type[Any], Callable[[Any], None]] = {kind: self._own(kind) for kind in OWN_EVENTS}
        self._writers[Published] = self._write_published
        self._output.write(MAGIC + _record(records.Header(profile=_ROS2_PROFILE, library="volery")))
        self.metadata("volery", {"schema": TRACE_SCHEMA, "seed": str(setup.seed)})
        self.attach(Attachment(SETUP_ATTACHMENT, "application/json", to_json(setup)))
        for attachment in attachments:
            self.attach(attachment)

    @property
    def problem(self) -> str:
        """Why the trace is incomplete; empty if it is complete."""
        return self._output.problem

    def __call__(self, event: Event) -> None:
        """Write one event."""
        self._writers[type(event)](event)

    def listener(self, kind: type[Any]) -> Record:
        """Return what writes events of *kind*."""
        return self._writers[kind]

    def attach(self, attachment: Attachment) -> None:
        """Attach a file to the trace, without a time."""
        self.flush()
        name, media_type, data = attachment
        record = _record(records.Attachment(0, 0, name, media_type, data))
        index = records.AttachmentIndex(self._output.size, len(record), 0, 0, len(data), name, media_type)
        if self._output.write(record):
            self._summary.attachments.append(index)

    def metadata(self, name: str, values: dict[str, str]) -> None:
        """Add a metadata record to the trace."""
        self.flush()
        record = _record(records.Metadata(name=name, metadata=values))
        index = records.MetadataIndex(offset=self._output.size, length=len(record), name=name)
        if self._output.write(record):
            self._summary.metadata.append(index)

    def outcome(self, status: str, reason: str) -> None:
        """Record how the run ended. A trace without that is of a killed run."""
        self.metadata(OUTCOME, {"status": status, "reason": reason})

    def flush(self) -> None:
        """End the chunk and write it: it survives the end of this process."""
        if not self._indexes:
            return
        body = bytes(self._body)
        indexes = self._indexes
        self._body = bytearray()
        self._indexes = _empty_indexes()
        first = min(min(index[::2]) for index in indexes.values())
        last = max(max(index[::2]) for index in indexes.values())
        packed = self._compressor.compress(body)
        chunk = _record(records.Chunk(COMPRESSION, packed, last, first, zlib.crc32(body), len(body)))
        listed = b""
        offsets = {}
        for channel, index in indexes.items():
            offsets[channel] = self._output.size + len(chunk) + len(listed)
            listed += _index_record(channel, index)
        entry = records.ChunkIndex(
            chunk_length=len(chunk),
            chunk_start_offset=self._output.size,
            compression=COMPRESSION,
            compressed_size=len(packed),
            message_end_time=last,
            message_index_length=len(listed),
            message_index_offsets=offsets,
            message_start_time=first,
            uncompressed_size=len(body),
        )
        if self._output.write(chunk + listed):
            self._summary.chunk(entry, {channel: len(index) // 2 for channel, index in indexes.items()})

    def close(self) -> None:
        """Write what is left, the summary and the index. A second call does nothing."""
        if self._output.closed:
            return
        self.flush()
        self._output.write(_record(records.DataEnd(0)))
        self._output.write(self._summary.bytes(self._output.size) + MAGIC)
        self._output.close()

    def _schema(self, name: str, text: str) -> int:
        known = self._schemas.get(name)
        if known is None:
            known = self._schemas[name] = len(self._schemas) + 1
            record = _record(records.Schema(id=known, data=text.encode(), encoding="ros2msg", name=name))
            self._summary.schemas.append(record)
            self._body += record
        return known

    def _channel(self, topic: str, schema: int, metadata: dict[str, str]) -> int:
        channel = len(self._summary.channels) + 1
        record = _record(records.Channel(channel, topic, "cdr", metadata, schema))
        self._summary.channels.append(record)
        self._body += record
        return channel

    def _own(self, kind: type[Any]) -> Callable[[Any], None]:
        """Return the function that writes events of one kind: the hot path."""
        codec = Codec(kind)
        pack = struct.Struct(f"<{MESSAGE_FRAME}{codec.codes}").pack
        overhead = MESSAGE_OVERHEAD + codec.fixed
        times, numbers, words = _times(kind), codec.numbers, codec.words
        tails, new_tail = codec.tails, codec.tail
        channels: dict[str, int] = {}
        subject_of = attrgetter("vehicle") if kind is VehicleState else None

        def write(event: Any) -> None:
            log, publish = times(event)
            if publish >= self._chunk_ends:
                self._end_second(publish)
            subject = subject_of(event) if subject_of else ""
            channel = channels.get(subject)
            if channel is None:
                topic = f"/volery/{subject}/state" if subject_of else f"/volery/{kind.__name__.lower()}"
                schema = self._schema(type_name(kind), codec.definition)
                channel = channels[subject] = self._channel(topic, schema, {})
            strings = words(event)
            tail = tails.get(strings) or new_tail(strings)
            body = self._body
            mark = self._indexes[channel].append
            mark(log)
            mark(len(body))
            length = overhead + len(tail)
            body += pack(_MESSAGE, length, channel, 0, log, publish, LITTLE_ENDIAN_CDR, *numbers(event))
            body += tail

        return write

    def _write_published(self, event: Published) -> None:
        if event.at >= self._chunk_ends:
            self._end_second(event.at)
        key = (event.topic, event.type, event.publisher)
        channel = self._published.get(key)
        if channel is None:
            schema = self._schema(event.type, self._definitions(event.type))
            channel = self._channel(event.topic, schema, {"publisher": event.publisher})
            self._published[key] = channel
        self._indexes[channel].extend((event.at, len(self._body)))
        length = MESSAGE_OVERHEAD + len(event.data)
        self._body += struct.pack(f"<{MESSAGE_FRAME}", _MESSAGE, length, channel, 0, event.at, event.at)
        self._body += event.data

    def _end_second(self, now: Ns) -> None:
        self.flush()
        self._chunk_ends = (now // S + 1) * S


def _empty_indexes() -> defaultdict[int, array[int]]:
    """Return a mapping of channel to log time and offset in the chunk of each message, alternating."""
    return defaultdict(lambda: array("Q"))


def _index_record(channel: int, index: array[int]) -> bytes:
    pairs = index.tobytes()
    return struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + len(pairs), channel, len(pairs)) + pairs


class _Summary:
    """The summary at the end of the file, with which readers find chunks without reading all of it."""

    def __init__(self) -> None:
        self.schemas: list[bytes] = []
        self.channels: list[bytes] = []
        self._chunks: list[bytes] = []
        self._first: Ns | None = None
        self._last: Ns = 0
        self.attachments: list[records.AttachmentIndex] = []
        self.metadata: list[records.MetadataIndex] = []
        self._counts: dict[int, int] = {}

    def chunk(self, entry: records.ChunkIndex, counts: dict[int, int]) -> None:
        """Add a chunk that was written, with the number of messages of each channel."""
        self._chunks.append(_record(entry))
        self._first = min(
            entry.message_start_time, entry.message_start_time if self._first is None else self._first
        )
        self._last = max(entry.message_end_time, self._last)
        for channel, count in counts.items():
            self._counts[channel] = self._counts.get(channel, 0) + count

    def _statistics(self) -> records.Statistics:
        return records.Statistics(
            attachment_count=len(self.attachments),
            channel_count=len(self.channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=self._last,
            message_start_time=self._first or 0,
            metadata_count=len(self.metadata),
            schema_count=len(self.schemas),
        )

    def bytes(self, start: int) -> bytes:
        """Return the summary section and the footer of a file whose data section ends at *start*."""
        groups = [
            (Opcode.SCHEMA, b"".join(self.schemas)),
            (Opcode.CHANNEL, b"".join(self.channels)),
            (Opcode.STATISTICS, _record(self._statistics())),
            (Opcode.CHUNK_INDEX, b"".join(self._chunks)),
            (Opcode.ATTACHMENT_INDEX, b"".join(_record(entry) for entry in self.attachments)),
            (Opcode.METADATA_INDEX, b"".join(_record(entry) for entry in self.metadata)),
        ]
        body = b""
        offsets = b""
        for opcode, data in groups:
            if data:
                offsets += _record(records.SummaryOffset(opcode, start + len(body), len(data)))
                body += data
        summary = body + offsets
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, start + len(body))
        return summary + footer + struct.pack("<I", zlib.crc32(footer, zlib.crc32(summary)))
