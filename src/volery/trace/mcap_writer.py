"""Writer of the events of a run as an MCAP file with ROS 2 messages: ``trace.mcap``.

The same run gives the same bytes: no wall time, no version. Chunks end with each simulated second and are
written at once, so a killed process loses at most the last simulated second. They are compressed by zstd at a
fixed level; zstd's bytes depend on its own version alone, and the events in them on nothing.
Records other than messages are built by the ``mcap`` library; messages, of which there are millions, by
``Chunk``.

Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from zstandard import ZstdCompressor

from volery.base.files import RecordFile
from volery.base.time import Ns, S
from volery.trace.attachments import SETUP_ATTACHMENT, RunSetup, to_json
from volery.trace.chunk import Chunk
from volery.trace.encoding import OWN_EVENTS, PUBLISHED, EventCodec, type_name
from volery.trace.events import Event, Published, Record, VehicleState

MAGIC = b"\x89MCAP0\r\n"
TRACE_SCHEMA = "volery-trace/1"
TRACE_FILE = "trace.mcap"
"""Name of the trace in a run folder."""

OUTCOME = "outcome"
"""The metadata that states how the run ended: ``status`` and ``reason``."""
COMPRESSION = "zstd"
"""The compression of chunks, in the words of the format."""
_LEVEL = 3  # an eighth of the size; level 9 would save another quarter for six times the time
_ROS2_PROFILE = "ros2"

Definitions = Callable[[str], str]
"""Returns the complete ``ros2msg`` text of a type such as ``std_msgs/msg/String``, dependencies included."""


class Attachment(NamedTuple):
    """A file that is attached to a trace."""

    name: str
    media_type: str
    data: bytes


def _no_definition(_: str) -> str:
    return ""


def _record(thing: records.McapRecord) -> bytes:
    builder = RecordBuilder()
    thing.write(builder)
    return builder.end()  # type: ignore[no-untyped-call, no-any-return]  # the library left it bare


class McapWriter:
    """A listener of the event stream that writes ``trace.mcap``. Call it with events, then ``close`` it.

    Args:
        path: The file to write. For a full disk, see ``RecordFile``.
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
        self._output = RecordFile(path)
        self._definitions = definitions
        self._summary = _Summary()
        self._compressor = ZstdCompressor(level=_LEVEL)
        self._chunk = Chunk(self._end_second)
        self._chunk.end = S
        self._schemas: dict[str, int] = {}
        self._writers: dict[type[Any], Record] = {
            Published: self._chunk.writer(PUBLISHED, self._published_channel)
        }
        for kind in OWN_EVENTS:
            codec = EventCodec(kind)
            self._writers[kind] = self._chunk.writer(codec.layout, partial(self._own_channel, codec))
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
        filled = self._chunk.take()
        if filled is None:
            return
        body, indexes, offsets, counts, first, last = filled
        packed = self._compressor.compress(body)
        chunk = _record(records.Chunk(COMPRESSION, packed, last, first, zlib.crc32(body), len(body)))
        start = self._output.size
        entry = records.ChunkIndex(
            chunk_length=len(chunk),
            chunk_start_offset=start,
            compression=COMPRESSION,
            compressed_size=len(packed),
            message_end_time=last,
            message_index_length=len(indexes),
            message_index_offsets={
                channel: start + len(chunk) + offset for channel, offset in offsets.items()
            },
            message_start_time=first,
            uncompressed_size=len(body),
        )
        if self._output.write(chunk + indexes):
            self._summary.chunk(entry, counts)

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
            self._chunk.add(record)
        return known

    def _channel(self, topic: str, schema: int, metadata: dict[str, str]) -> int:
        channel = len(self._summary.channels) + 1
        record = _record(records.Channel(channel, topic, "cdr", metadata, schema))
        self._summary.channels.append(record)
        self._chunk.add(record)
        return channel

    def _own_channel(self, codec: EventCodec, subject: str = "") -> int:
        """Return the channel of events of one kind; each vehicle's states and each topic have their own."""
        name = f"{subject}/state" if codec.kind is VehicleState else codec.kind.__name__.lower() + subject
        schema = self._schema(type_name(codec.kind), codec.definition)
        return self._channel(f"/volery/{name}", schema, {})

    def _published_channel(self, topic: str, message_type: str, publisher: str) -> int:
        schema = self._schema(message_type, self._definitions(message_type))
        return self._channel(topic, schema, {"publisher": publisher})

    def _end_second(self, now: Ns) -> None:
        self.flush()
        self._chunk.end = (now // S + 1) * S


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
