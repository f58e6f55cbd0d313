"""Telemetry logs as ground stations write them: 8 bytes big-endian microseconds, a raw frame, and so on.

QGroundControl, MAVExplorer and ``mavlogdump.py`` read them. The stamp is Unix time where the clock is real;
in virtual time it counts from the start of the run.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from volery.base.time import US, Ns, S
from volery.kernel.api import Kernel
from volery.links.link import Frame, Link, Receiver, ReceiveStatistics
from volery.links.mavlink_codec import MavlinkParser, whole_frame
from volery.links.mavlink_messages import encode

_STAMP = struct.Struct(">Q")


class TlogTap:
    """A link that writes every frame, both ways, to a file. ``epoch_us`` is Unix time at the run's start."""

    def __init__(self, kernel: Kernel, link: Link, path: Path, epoch_us: int = 0) -> None:
        self.name = link.name
        self._kernel = kernel
        self._link = link
        self._epoch_us = epoch_us
        self._file = path.open("wb")
        self._sequences: dict[tuple[int, int], int] = {}
        self._flushed: Ns = 0

    @property
    def heard(self) -> ReceiveStatistics | None:
        """What the link has heard so far, if it is one of bytes."""
        heard: ReceiveStatistics | None = getattr(self._link, "heard", None)
        return heard

    def send(self, frame: Frame) -> None:
        """Send and write down."""
        self._write(frame)
        self._link.send(frame)

    def receive(self, receiver: Receiver) -> None:
        """From now on hand what arrives to *receiver*, and write it down."""

        def write_and_hand_over(frame: Frame) -> None:
            self._write(frame)
            receiver(frame)

        self._link.receive(write_and_hand_over)

    def problem(self) -> str:
        """What is wrong with the wire."""
        return self._link.problem()

    def close(self) -> None:
        """Close the link and finish the file."""
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
    """One frame of a log; ``at_us`` as it stands there."""

    at_us: int
    frame: Frame


def read_tlog(path: Path) -> Iterator[Entry]:
    """The known frames of a log in order. A cut end and damaged places are passed over."""
    data = path.read_bytes()
    place = 0
    while place + _STAMP.size < len(data):
        length = whole_frame(data, place + _STAMP.size)
        if not length:
            place += 1
            continue
        start = place + _STAMP.size
        frames = MavlinkParser().feed(data[start : start + length])
        if frames:
            yield Entry(_STAMP.unpack_from(data, place)[0], frames[0])
        place = start + length
