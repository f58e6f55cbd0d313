"""MAVLink conventions above single messages, which both ends of a link implement.

Status texts longer than 50 characters are sent in chunks; some firmwares send integer parameters as the bytes
of a float; telemetry streams have a period per message.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from volery.base.time import Ns
from volery.kernel.api import Handle, Kernel

# -- status texts

CHUNK = 50

OnText = Callable[[int, str], None]
"""Called with severity and text."""


def status_text_chunks(severity: int, text: str, number: int) -> list[dict[str, Any]]:
    """Return the fields of the STATUSTEXT messages that carry *text*.

    Args:
        severity: MAV_SEVERITY.
        text: Text of any length.
        number: Id that distinguishes the chunks of this text from those of others; 0 for a single chunk.
    """
    return [
        {"severity": severity, "text": text[start : start + CHUNK], "id": number, "chunk_seq": sequence}
        for sequence, start in enumerate(range(0, max(1, len(text)), CHUNK))
    ]


class StatusTextAssembler:
    """Joins chunks to texts. A text whose last chunk is lost is reported when the next text begins."""

    def __init__(self, on_text: OnText) -> None:
        self._on_text = on_text
        self._number = 0
        self._severity = 0
        self._parts: dict[int, str] = {}

    def add(self, fields: Mapping[str, Any]) -> None:
        """Add a STATUSTEXT. Its ``id`` is 0 for a whole text; the chunks of one text share another id."""
        number: int = fields["id"]
        if self._parts and number != self._number:
            self._report()
        if number == 0:
            self._on_text(fields["severity"], fields["text"])
            return
        self._number = number
        self._severity = fields["severity"]
        self._parts[fields["chunk_seq"]] = fields["text"]
        if len(fields["text"]) < CHUNK:
            self._report()

    def _report(self) -> None:
        parts = self._parts
        text = "".join(parts.get(number, " ... ") for number in range(max(parts) + 1))
        self._parts = {}
        self._on_text(self._severity, text)


# -- parameter values

REAL32 = 9
"""MAV_PARAM_TYPE."""

_REAL, _SIGNED, _UNSIGNED = struct.Struct("<f"), struct.Struct("<i"), struct.Struct("<I")


def to_bytewise(kind: int, value: float) -> float:
    """Return a parameter value in MAVLink's "bytewise" encoding, which PX4 uses.

    The result is the float whose bytes are those of the integer. ArduPilot sends the number itself instead.

    Args:
        kind: MAV_PARAM_TYPE; a value of type REAL32 is returned unchanged.
        value: The number.
    """
    if kind == REAL32:
        return value
    number: float = _REAL.unpack(_UNSIGNED.pack(int(value) & 0xFFFF_FFFF))[0]
    return number


def from_bytewise(kind: int, value: float) -> float:
    """Return the number that ``to_bytewise`` encoded."""
    if kind == REAL32:
        return value
    return float(_SIGNED.unpack(_REAL.pack(value))[0])


# -- telemetry streams

Burst = Callable[[Sequence[str]], None]
"""Sends the named messages, in that order."""


class MessageStreams:
    """Telemetry streams of one link: a period for each message; messages of one period are sent in one burst.

    Requests are stored while the autopilot boots; nothing is sent before ``start``.

    Args:
        kernel: Clock of the streams.
        order: Names of messages in their order within a burst.
        burst: Sends the messages of one burst.
        least: Shortest period in ns.
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
        """Return the period of a message in ns; 0 if it is not streamed."""
        return self._periods.get(name, 0)

    def set(self, names: Sequence[str], period: Ns) -> None:
        """Stream messages with a new period; the first burst is sent one period from now.

        Args:
            names: Names of the messages.
            period: Period in ns; 0 stops the messages.
        """
        for name in names:
            self._periods.pop(name, None)
            if period > 0:
                self._periods[name] = max(period, self._least)
        self._regroup()

    def start(self) -> None:
        """Start the requested streams, because the autopilot has booted."""
        self._started = True
        self._regroup()

    def stop(self) -> None:
        """Stop all streams and forget the requests."""
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
                    self._start_group(period)

    def _start_group(self, period: Ns) -> None:
        first = self._kernel.now()

        def due() -> None:
            if self._kernel.now() > first:
                self._burst(self._names[period])

        self._handles[period] = self._kernel.every(period, due)
