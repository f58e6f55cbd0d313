"""Events become ROS 2 messages and back."""

from math import isnan, nan

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from volery.testing.sample_run import sample_events
from volery.trace.encoding import OWN_EVENTS, EventCodec, type_name
from volery.trace.events import Charge, Slice, Text, VehicleState


def test_every_event_of_a_run_survives_the_round_trip() -> None:
    codecs = {kind: EventCodec(kind) for kind in OWN_EVENTS}
    seen = set()
    for event in sample_events(seconds=30.0):
        codec = codecs.get(type(event))
        if codec is not None:
            again = codec.decode(codec.encode(event))
            assert repr(again) == repr(event)  # NaN differs from itself, its text does not
            assert type(again) is type(event)
            seen.add(type(event))
    assert seen == set(OWN_EVENTS)


def test_definition_has_wide_numbers_first_and_strings_last() -> None:
    assert EventCodec(Slice).definition == (
        "int64 start\nint64 end\nint32 core\nstring processor\nstring task\nstring component\n"
    )
    assert EventCodec(VehicleState).definition.endswith("bool armed\nstring vehicle\nstring mode\n")
    assert type_name(Slice) == "volery_msgs/msg/Slice"


def test_bytes_are_those_of_cdr() -> None:
    data = EventCodec(Text).encode(Text(1, "ab", 4, "c"))
    assert data == (
        b"\x00\x01\x00\x00"  # little-endian CDR
        b"\x01\x00\x00\x00\x00\x00\x00\x00"  # at
        b"\x04\x00\x00\x00"  # severity
        b"\x03\x00\x00\x00ab\x00\x00"  # source, padded
        b"\x02\x00\x00\x00c\x00\x00\x00"  # text, padded
    )


def test_strings_in_any_script_and_with_lone_surrogates() -> None:
    codec = EventCodec(Text)
    assert codec.decode(codec.encode(Text(0, "drøne", 1, "日本 \0 x"))).text == "日本 \0 x"
    assert codec.decode(codec.encode(Text(0, "", 1, "\udc80"))).text == "?"


def test_more_strings_than_are_cached_are_decoded() -> None:
    codec = EventCodec(Text)
    for number in range(10_000):
        event = Text(number, "s", 6, f"line {number}")
        assert codec.decode(codec.encode(event)) == event


def test_garbage_is_refused() -> None:
    codec = EventCodec(Charge)
    good = codec.encode(Charge(1, "a", "b", "code", 2, 3, nan))
    assert isnan(codec.decode(good).energy)
    with pytest.raises(ValueError, match="little-endian"):
        codec.decode(b"\x00\x00" + good[2:])
    with pytest.raises(ValueError, match="cut short"):
        codec.decode(good[:-4])


def test_an_independent_reader_of_ros_messages_agrees() -> None:
    """rosbags parses our definitions and reads our bytes, every field of every kind of event."""
    store = get_typestore(Stores.EMPTY)
    for kind in OWN_EVENTS:
        store.register(get_types_from_msg(EventCodec(kind).definition, type_name(kind)))
    compared = set()
    for event in sample_events(seconds=30.0):
        kind = type(event)
        if kind in OWN_EVENTS:
            message = store.deserialize_cdr(EventCodec(kind).encode(event), type_name(kind))
            fields = {name: getattr(message, name) for name in kind._fields}
            assert repr(fields) == repr(event._asdict())
            compared.add(kind)
        if len(compared) == len(OWN_EVENTS):
            break
    else:
        raise AssertionError(f"never seen: {set(OWN_EVENTS) - compared}")
