"""Small flight logs in the formats of ArduPilot, PX4 and ground stations, made byte by byte."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from math import cos, radians, sin
from pathlib import Path

from volery.links.frame import Frame
from volery.links.mavlink_codec import encode

Rows = Iterable[Sequence[float]]


def dataflash(
    path: Path, tables: Mapping[str, tuple[str, Rows]], texts: Iterable[tuple[float, str]] = ()
) -> Path:
    """Write a binary DataFlash log of messages with ``TimeUS`` (Q) and floats (f).

    Args:
        path: file to write.
        tables: name → columns after the time, and rows of time in s and values.
        texts: times in s and what was said.
    """
    out = bytearray()

    def definition(kind: int, length: int, name: str, form: str, columns: str) -> bytes:
        return struct.pack(
            "<3sBB4s16s64s", b"\xa3\x95\x80", kind, length, name.encode(), form.encode(), columns.encode()
        )

    out += definition(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
    for kind, (name, (columns, rows)) in enumerate(tables.items(), 129):
        count = len(columns.split(","))
        out += definition(kind, 11 + 4 * count, name, "Q" + "f" * count, f"TimeUS,{columns}")
        for time, *values in rows:
            out += struct.pack(f"<2sBQ{count}f", b"\xa3\x95", kind, round(time * 1e6), *values)
    out += definition(255, 75, "MSG", "QZ", "TimeUS,Message")
    for time, text in texts:
        out += struct.pack("<2sBQ64s", b"\xa3\x95", 255, round(time * 1e6), text.encode())
    path.write_bytes(out)
    return path


def ulog(path: Path, tables: Mapping[str, tuple[str, Rows]], texts: Iterable[tuple[float, str]] = ()) -> Path:
    """Write a ULog of messages with ``timestamp`` (uint64) and floats.

    Args:
        path: file to write.
        tables: name → fields such as ``float[4] q;float x``, and rows of time in s and values.
        texts: times in s and what was said.
    """
    out = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1_000_000))

    def record(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<Hc", len(content), kind) + content

    out += record(b"B", bytes(40))
    for name, (fields, _) in tables.items():
        out += record(b"F", f"{name}:uint64_t timestamp;{fields};".encode())
    for number, name in enumerate(tables):
        out += record(b"A", struct.pack("<BH", 0, number) + name.encode())
    data = [
        (time, number, values) for number, (_, rows) in enumerate(tables.values()) for time, *values in rows
    ]
    for time, number, values in sorted(data, key=lambda one: one[0]):
        stamp = struct.pack("<HQ", number, 1_000_000 + round(time * 1e6))
        out += record(b"D", stamp + struct.pack(f"<{len(values)}f", *values))
    for time, text in texts:
        head = struct.pack("<BQ", ord("6"), 1_000_000 + round(time * 1e6))
        out += record(b"L", head + text.encode())
    path.write_bytes(out)
    return path


def tlog(path: Path, frames: Iterable[tuple[float, Frame]]) -> Path:
    """Write a telemetry log of frames with their times in s."""
    with path.open("wb") as file:
        for number, (time, frame) in enumerate(frames):
            file.write(struct.pack(">Q", round(time * 1e6)) + encode(frame, number % 256))
    return path


def yaw_quaternion(degrees: float) -> list[float]:
    """Return w, x, y, z of a heading."""
    half = radians(degrees) / 2.0
    return [cos(half), 0.0, 0.0, sin(half)]
