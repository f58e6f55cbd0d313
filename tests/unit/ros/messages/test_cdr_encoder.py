"""Bytes of the generated encoder are those of rosbags, for every type and wherever strings end."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from volery.base.errors import UsageError
from volery.ros.messages import cdr_size, define, from_cdr, message_class, new, to_cdr
from volery.ros.messages.cdr_encoder import abridged, encode
from volery.ros.messages.message import LONG, MessageField, RosMessage
from volery.ros.messages.store import store, types

TYPES = sorted(types())
TEXT = some.text(max_size=9)
LIMITS = {
    "int8": 7, "int16": 15, "int32": 31, "int64": 63, "uint8": 8, "uint16": 16, "uint32": 32, "uint64": 64,
    "byte": 7, "char": 8, "octet": 8,
}  # fmt: skip


def values(base: str) -> some.SearchStrategy[Any]:
    if base == "string":
        return TEXT
    if base == "bool":
        return some.booleans()
    if base.startswith("float"):
        return some.floats(width=32, allow_nan=False)
    bits = LIMITS[base]
    return some.integers(-(2**bits) if base.startswith("int") else 0, 2**bits - 1)  # a byte has no sign


def of_field(field: MessageField) -> some.SearchStrategy[Any]:
    one = values(field.base) if field.nested is None else messages(field.nested)
    if field.length is None:
        return one
    return some.lists(one, min_size=field.length, max_size=field.length or 3)


def messages(cls: type[RosMessage]) -> some.SearchStrategy[Any]:
    return some.builds(cls, **{field.name: of_field(field) for field in cls.fields_of})


def by_rosbags(message: RosMessage) -> bytes:
    return bytes(store().serialize_cdr(message.copy(), message.__msgtype__))


@settings(max_examples=120, deadline=None)
@given(some.data())
def test_the_bytes_are_those_of_rosbags(data: some.DataObject) -> None:
    message = data.draw(messages(message_class(data.draw(some.sampled_from(TYPES)))))
    encoded = to_cdr(message)
    assert encoded == by_rosbags(message)
    assert to_cdr(from_cdr(message.__msgtype__, encoded)) == encoded


@pytest.mark.parametrize("length", range(9))
def test_numbers_behind_a_text_are_aligned(length: int) -> None:
    message = new("sensor_msgs/msg/NavSatFix", header={"frame_id": "x" * length}, latitude=math.pi)
    assert to_cdr(message) == by_rosbags(message)
    assert struct.pack("<d", math.pi) in to_cdr(message)


def test_every_type_has_an_encoder() -> None:
    for name in TYPES:
        message = message_class(name)()
        assert to_cdr(message) == by_rosbags(message), name


@pytest.mark.parametrize(
    ("kind", "fields", "named"),
    [
        ("std_msgs/msg/UInt8", {"data": 256}, "data is 256, not a uint8"),
        ("std_msgs/msg/Float32", {"data": 1e300}, "data is 1e\\+300, not a float32"),
        ("std_msgs/msg/String", {"data": 5}, "data is 5, not a string"),
        ("geometry_msgs/msg/PoseStamped", {"pose": 3}, "pose is 3, not a geometry_msgs/msg/Pose"),
    ],
)
def test_a_value_that_does_not_fit_is_named(kind: str, fields: dict[str, Any], named: str) -> None:
    with pytest.raises(UsageError, match=named):
        to_cdr(new(kind, **fields))


@pytest.mark.parametrize("count", [LONG // 4 - 1, *range(LONG // 4, LONG // 4 + 9)])
@pytest.mark.parametrize("place", ["", "x", "xyz"])
def test_a_size_is_known_without_encoding_long_arrays(count: int, place: str) -> None:
    message = new(
        "sensor_msgs/msg/LaserScan", header={"frame_id": place}, ranges=[1.0] * count, intensities=[2.0]
    ).copy()
    data, missing = abridged(message)
    whole = encode(message)
    assert len(data) + missing == len(whole) == cdr_size(message)
    assert bool(missing) == (4 * count >= LONG)
    assert missing or data == whole


def test_long_arrays_in_lists_of_messages_are_counted() -> None:
    define("encoder_test_msgs/msg/Rig", "sensor_msgs/Image[] images\nfloat64[600] cells\nfloat64 end")
    images = [new("sensor_msgs/msg/Image", encoding="x" * one, data=bytes(5000 + one)) for one in range(9)]
    message = new("encoder_test_msgs/msg/Rig", images=images).copy()
    data, missing = abridged(message)
    assert missing > 9 * 4992
    assert len(data) + missing == len(by_rosbags(message)) == cdr_size(message)
