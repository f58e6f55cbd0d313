"""MAVLink's status texts, which go in chunks of 50 characters when they are longer.

Values of parameters in PARAM_VALUE and PARAM_SET, where the firmware puts whole numbers into the bytes
of the float (MAVLink's "bytewise" encoding: PX4). ArduPilot writes the number itself, as a real one.

What one link is sent regularly: a period for each message, messages of one period in one burst.

Asking is remembered while the autopilot boots; nothing is sent before ``start``. Knows names and periods, not
what a message holds.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from volery.base.time import Ns
from volery.kernel.api import Handle, Kernel

CHUNK = 50

Say = Callable[[int, str], None]


def status_text_chunks(severity: int, text: str, number: int) -> list[dict[str, Any]]:
    """The fields of the STATUSTEXTs that carry *text*; *number* tells those of one text from others'."""
    return [
        {"severity": severity, "text": text[start : start + CHUNK], "id": number, "chunk_seq": place}
        for place, start in enumerate(range(0, max(1, len(text)), CHUNK))
    ]


class StatusTextAssembler:
    """Puts chunks together. A text whose end is lost is told when the next one begins."""

    def __init__(self, say: Say) -> None:
        self._say = say
        self._number = 0
        self._severity = 0
        self._parts: dict[int, str] = {}

    def hear(self, fields: Mapping[str, Any]) -> None:
        """A STATUSTEXT: ``id`` 0 is a whole text; chunks of one text share another."""
        number: int = fields["id"]
        if self._parts and number != self._number:
            self._tell()
        if number == 0:
            self._say(fields["severity"], fields["text"])
            return
        self._number = number
        self._severity = fields["severity"]
        self._parts[fields["chunk_seq"]] = fields["text"]
        if len(fields["text"]) < CHUNK:
            self._tell()

    def _tell(self) -> None:
        parts = self._parts
        text = "".join(parts.get(number, " ... ") for number in range(max(parts) + 1))
        self._parts = {}
        self._say(self._severity, text)


REAL32 = 9
"""MAV_PARAM_TYPE."""

_REAL, _WHOLE, _UNSIGNED = struct.Struct("<f"), struct.Struct("<i"), struct.Struct("<I")


def to_bytewise(kind: int, value: float) -> float:
    """The real number whose bytes are those of an integer; a real number is itself."""
    if kind == REAL32:
        return value
    number: float = _REAL.unpack(_UNSIGNED.pack(int(value) & 0xFFFF_FFFF))[0]
    return number


def from_bytewise(kind: int, value: float) -> float:
    """What ``to_bytewise`` was given."""
    if kind == REAL32:
        return value
    return float(_WHOLE.unpack(_REAL.pack(value))[0])


Burst = Callable[[Sequence[str]], None]
"""Sends the named messages, in that order."""


class MessageStreams:
    """The streams of one link. ``order`` is the order of messages within a burst; no period is shorter than
    ``least``.
    """

    def __init__(self, kernel: Kernel, order: Sequence[str], burst: Burst, *, least: Ns = 1) -> None:
        self._kernel = kernel
        self._least = least
        self._rank = {name: rank for rank, name in enumerate(order)}
        self._burst = burst
        self._periods: dict[str, Ns] = {}
        self._names: dict[Ns, tuple[str, ...]] = {}
        self._handles: dict[Ns, Handle] = {}
        self._started = False

    def period(self, name: str) -> Ns:
        """Nanoseconds between two of that message; 0 if it is not streamed."""
        return self._periods.get(name, 0)

    def set(self, names: Sequence[str], period: Ns) -> None:
        """Stream these from now on with that period; 0 stops them.

        The first burst comes one period from now.
        """
        for name in names:
            self._periods.pop(name, None)
            if period > 0:
                self._periods[name] = max(period, self._least)
        self._regroup()

    def start(self) -> None:
        """The autopilot has booted: send what was asked for."""
        self._started = True
        self._regroup()

    def stop(self) -> None:
        """Send nothing any more and forget what was asked for."""
        self._started = False
        self._periods.clear()
        self._regroup()

    def _regroup(self) -> None:
        groups: dict[Ns, list[str]] = {}
        for name, period in self._periods.items():
            groups.setdefault(period, []).append(name)
        last = len(self._rank)
        self._names = {
            period: tuple(sorted(names, key=lambda name: self._rank.get(name, last)))
            for period, names in groups.items()
        }
        for period in [period for period in self._handles if period not in groups]:
            self._handles.pop(period).cancel()
        if self._started:
            for period in groups:
                if period not in self._handles:
                    self._begin(period)

    def _begin(self, period: Ns) -> None:
        first = self._kernel.now()

        def due() -> None:
            if self._kernel.now() > first:
                self._burst(self._names[period])

        self._handles[period] = self._kernel.every(period, due)
