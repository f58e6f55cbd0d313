"""The chunk of a trace that is being filled: message records in the order of the events, and their index.

Format: https://mcap.dev/spec, message and message index records.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable
from operator import itemgetter
from typing import Any

from volery.trace.encoding import EventLayout, encoder, fields

_MESSAGE = 5
_MESSAGE_INDEX = 7
_FRAME = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_OVERHEAD = _FRAME.size - struct.calcsize("<BQ")  # what the length counts beside the data

Filled = tuple[bytes, bytes, dict[int, int], dict[int, int], int, int]
"""The records of a chunk and its index records; by channel, where its index begins in these and how many
messages it has; the least and the greatest log time, ns."""


class Chunk:
    """The records of a chunk. ``end`` is when it ends, ns.

    Args:
        end_second: Called with the publish time of an event at or after ``end``, before the event is
            written; it has to set ``end``.
    """

    def __init__(self, end_second: Callable[[int], None]) -> None:
        self.end = 0
        self._end_second = end_second
        self._records = bytearray()
        self._indexes: dict[int, array[int]] = {}

    def add(self, record: bytes) -> None:
        """Add a record that is not a message."""
        self._records += record

    def writer(self, layout: EventLayout, open_channel: Callable[..., int]) -> Callable[[Any], None]:
        """Return the function that writes events of one kind.

        Args:
            layout: Where the fields of these events go.
            open_channel: Returns the channel of a combination of the fields ``subject``; called once for
                each.
        """
        log_of, publish_of = itemgetter(layout.log), itemgetter(layout.publish)
        subject_of = fields(layout.subject)
        data_of = itemgetter(layout.data) if layout.data >= 0 else encoder(layout)
        pack = _FRAME.pack
        channels: dict[tuple[str, ...], int] = {}

        def write(event: Any) -> None:
            log, publish = log_of(event), publish_of(event)
            if log < 0:
                log = publish
            if publish >= self.end:
                self._end_second(publish)
            subject = subject_of(event)
            channel = channels.get(subject)
            if channel is None:
                channel = channels[subject] = open_channel(*subject)
            data = data_of(event)
            records = self._records
            index = self._indexes.get(channel)
            if index is None:
                index = self._indexes[channel] = array("Q")
            index.append(log)
            index.append(len(records))
            records += pack(_MESSAGE, _OVERHEAD + len(data), channel, 0, log, publish)
            records += data

        return write

    def take(self) -> Filled | None:
        """Return what was written and begin an empty chunk. Without a message it is None, and all stays."""
        if not self._indexes:
            return None
        indexes = b""
        offsets = {}
        for channel, index in self._indexes.items():
            offsets[channel] = len(indexes)
            pairs = index.tobytes()
            indexes += struct.pack("<BQHI", _MESSAGE_INDEX, 6 + len(pairs), channel, len(pairs)) + pairs
        counts = {channel: len(index) // 2 for channel, index in self._indexes.items()}
        first = min(min(index[::2]) for index in self._indexes.values())
        last = max(max(index[::2]) for index in self._indexes.values())
        records = bytes(self._records)
        self._records = bytearray()
        self._indexes = {}
        return records, indexes, offsets, counts, first, last
