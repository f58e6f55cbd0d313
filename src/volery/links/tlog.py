"""Telemetry logs as ground stations write them: records of a time stamp and a raw MAVLink frame.

The stamp is a big-endian number of 8 bytes in microseconds. QGroundControl, MAVExplorer and ``mavlogdump.py``
read such files. The stamp is Unix time where the clock is real; in virtual time it counts from the start of
the run. MAVProxy writes the number of the link into its two lowest bits, and so does this module; other
ground stations leave microseconds there.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from volery.base.time import US, Ns, S
from volery.kernel.api import Kernel
from volery.links.frame import Frame
from volery.links.link import Link, Receiver
from volery.links.mavlink_codec import STX, STX_V1, MavlinkParser, encode, frame_length

_STAMP = struct.Struct(">Q")
LINK_BITS = 3
"""Bits of a stamp in which MAVProxy writes the number of the link."""
_FRAME_START = re.compile(b"[" + bytes((STX, STX_V1)) + b"]")


class TlogTap:
    """A link that writes every sent and received frame to a file.

    Args:
        kernel: Clock of the stamps.
        link: The link to record.
        path: File to write.
        epoch_us: Unix time at the start of the run, in microseconds.
        number: Number of the link, 0 to 3.
    """

    def __init__(self, kernel: Kernel, link: Link, path: Path, epoch_us: int = 0, number: int = 0) -> None:
        self.name = link.name
        self._number = number
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
        stamp = (self._epoch_us + now // US) & ~LINK_BITS | self._number
        self._file.write(_STAMP.pack(stamp) + encode(frame, sequence))
        if now - self._flushed >= S:
            self._flushed = now
            self._file.flush()


class LoggedFrame(NamedTuple):
    """One frame of a log: its stamp in microseconds, and its sequence number."""

    at_us: int
    frame: Frame
    sequence: int


def read_tlog(path: Path) -> Iterator[LoggedFrame]:
    """Yield the frames of known messages of a log in order. Damaged parts and a cut end are skipped."""
    data = path.read_bytes()
    after = 0
    while (match := _FRAME_START.search(data, after + _STAMP.size)) is not None:
        start = match.start()
        length = frame_length(data, start)
        after = start + length if length else start + 1 - _STAMP.size
        frames = MavlinkParser().feed(data[start:after])
        if frames:
            sequence = data[start + (4 if data[start] == STX else 2)]
            yield LoggedFrame(_STAMP.unpack_from(data, start - _STAMP.size)[0], frames[0], sequence)


def has_links(entries: Iterable[LoggedFrame]) -> bool:
    """Return whether the two lowest bits of the stamps are numbers of links, as in MAVProxy's logs.

    A sender numbers its frames one by one on each link. If they follow each other within the frames of equal
    bits, and not in the order of the log, the bits are links; else they are microseconds.
    """
    last: dict[tuple[int, ...], int] = {}
    following: Counter[int] = Counter()
    for at_us, frame, sequence in entries:
        sender = frame.system, frame.component
        for key in (sender, (*sender, at_us & LINK_BITS)):
            following[len(key)] += last.get(key) == sequence
            last[key] = (sequence + 1) % 256
    return following[3] > following[2]
