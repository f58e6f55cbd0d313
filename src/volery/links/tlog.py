"""Telemetry logs as ground stations write them: records of a time stamp and a raw MAVLink frame.

The stamp is a big-endian number of 8 bytes in microseconds. QGroundControl, MAVExplorer and ``mavlogdump.py``
read such files. The stamp is Unix time where the clock is real; in virtual time it counts from the start of
the run.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from volery.base.time import US, Ns, S
from volery.kernel.api import Kernel
from volery.links.frame import Frame
from volery.links.link import Link, Receiver
from volery.links.mavlink_codec import STX, STX_V1, MavlinkParser, encode, frame_length

_STAMP = struct.Struct(">Q")
_FRAME_START = re.compile(b"[" + bytes((STX, STX_V1)) + b"]")


class TlogTap:
    """A link that writes every sent and received frame to a file.

    Args:
        kernel: Clock of the stamps.
        link: The link to record.
        path: File to write.
        epoch_us: Unix time at the start of the run, in microseconds.
    """

    def __init__(self, kernel: Kernel, link: Link, path: Path, epoch_us: int = 0) -> None:
        self.name = link.name
        self._kernel = kernel
        self._link = link
        self._epoch_us = epoch_us
        self._file = path.open("wb")
        self._sequences: dict[tuple[int, int], int] = {}
        self._flushed: Ns = 0

    @property
    def statistics(self) -> object:
        """Receive statistics of the recorded link, or None if it keeps none."""
        return getattr(self._link, "statistics", None)

    def send(self, frame: Frame) -> None:
        """Record and send *frame*."""
        self._write(frame)
        self._link.send(frame)

    def receive(self, receiver: Receiver) -> None:
        """Record every frame that arrives from now on and call *receiver* with it."""

        def write_and_deliver(frame: Frame) -> None:
            self._write(frame)
            receiver(frame)

        self._link.receive(write_and_deliver)

    def problem(self) -> str:
        """Return what is wrong with the recorded link, or ``""``."""
        return self._link.problem()

    def close(self) -> None:
        """Close the link and the file."""
        self._link.close()
        self._file.close()

    def _write(self, frame: Frame) -> None:
        if self._file.closed:
            return
        sender = frame.system, frame.component
        sequence = self._sequences.get(sender, 0)
        self._sequences[sender] = sequence + 1
        now = self._kernel.now()
        self._file.write(_STAMP.pack(self._epoch_us + now // US) + encode(frame, sequence))
        if now - self._flushed >= S:
            self._flushed = now
            self._file.flush()


class Entry(NamedTuple):
    """One frame of a log, with its stamp in microseconds."""

    at_us: int
    frame: Frame


def read_tlog(path: Path) -> Iterator[Entry]:
    """Yield the frames of known messages of a log in order. Damaged parts and a cut end are skipped."""
    data = path.read_bytes()
    after = 0
    while (found := _FRAME_START.search(data, after + _STAMP.size)) is not None:
        start = found.start()
        length = frame_length(data, start)
        after = start + length if length else start + 1 - _STAMP.size
        frames = MavlinkParser().feed(data[start:after])
        if frames:
            yield Entry(_STAMP.unpack_from(data, start - _STAMP.size)[0], frames[0])
