"""What can still be read of a recording that was cut short: record after record from the start.

A rosbag 1 or an MCAP file whose writer was killed has no index. Both are sequences of records nevertheless.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import lz4.frame
from mcap.exceptions import McapError
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader

from volery.base.time import Ns, S

_LENGTH = struct.Struct("<I")
_STAMP = struct.Struct("<II")
_MESSAGE, _CHUNK, _CONNECTION = 2, 5, 7
_LARGEST = 1 << 30
"""Bytes; a record that says it is longer is damaged."""


class RawMessage(NamedTuple):
    """A message as it lies in the file, and what its connection says of its type."""

    at: Ns
    topic: str
    type: str
    definition: str
    data: bytes


def salvage_rosbag1(path: Path) -> Iterator[RawMessage]:
    """The whole messages of a rosbag of format 2.0, in the order of the file."""
    connections: dict[bytes, dict[str, bytes]] = {}
    with path.open("rb") as file:
        file.readline()
        for header, data in _records(file):
            kind = header.get("op", b"\0")[0]
            inner = _records(BytesIO(_unpacked(header, data))) if kind == _CHUNK else iter([(header, data)])
            for head, body in inner:
                found = _rosbag1_message(head, body, connections)
                if found is not None:
                    yield found


def _rosbag1_message(
    header: dict[str, bytes], data: bytes, connections: dict[bytes, dict[str, bytes]]
) -> RawMessage | None:
    kind = header.get("op", b"\0")[0]
    if kind == _CONNECTION:
        connections[header["conn"]] = {"topic": header["topic"], **_fields(data)}
    connection = connections.get(header.get("conn", b""))
    if kind != _MESSAGE or connection is None:
        return None
    seconds, rest = _STAMP.unpack(header["time"])
    topic, name, text = (
        connection.get(key, b"").decode(errors="replace") for key in ("topic", "type", "message_definition")
    )
    return RawMessage(seconds * S + rest, topic, name, text, data)


def _records(file: BinaryIO) -> Iterator[tuple[dict[str, bytes], bytes]]:
    """Header and data of each record that is whole, and what there is of a chunk at the end."""
    while True:
        header, whole = _block(file)
        if not whole:
            return
        fields = _fields(header)
        data, whole = _block(file)
        if whole or fields.get("op") == bytes([_CHUNK]):  # of the last chunk there is at least a part
            yield fields, data


def _block(file: BinaryIO) -> tuple[bytes, bool]:
    """What there is of a block, and whether that is all of it."""
    head = file.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return b"", False
    (length,) = _LENGTH.unpack(head)
    data = file.read(length) if length <= _LARGEST else b""
    return data, len(data) == length


def _fields(header: bytes) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    place = 0
    while place + _LENGTH.size <= len(header):
        (length,) = _LENGTH.unpack_from(header, place)
        place += _LENGTH.size
        name, _, value = header[place : place + length].partition(b"=")
        found[name.decode(errors="replace")] = value
        place += length
    return found


def _unpacked(header: dict[str, bytes], data: bytes) -> bytes:
    """A chunk's content; nothing of one that cannot be unpacked."""
    try:
        compression = header.get("compression", b"none")
        if compression == b"bz2":
            return bz2.decompress(data)
        return bytes(lz4.frame.decompress(data)) if compression == b"lz4" else data
    except (OSError, RuntimeError, ValueError):
        return b""


def salvage_mcap(path: Path) -> Iterator[RawMessage]:
    """The whole messages of an MCAP file, in the order of the file."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    with path.open("rb") as file:
        try:
            for record in StreamReader(file, emit_chunks=False).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Message) and record.channel_id in channels:
                    channel = channels[record.channel_id]
                    schema = schemas.get(channel.schema_id)
                    name = schema.name if schema else ""
                    text = schema.data.decode(errors="replace") if schema else ""
                    yield RawMessage(record.log_time, channel.topic, name, text, record.data)
        except (McapError, struct.error, EOFError, ValueError, RuntimeError):
            return  # here the file ends, or is damaged
