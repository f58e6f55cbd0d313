"""Any frame of any message survives the wire, whatever else is on it and however it is cut."""

from __future__ import annotations

import struct
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from volery.links.frame import Frame
from volery.links.mavlink_codec import MavlinkParser, encode, quantised

RANGES = {
    "int8_t": (-(2**7), 2**7 - 1),
    "uint8_t": (0, 2**8 - 1),
    "int16_t": (-(2**15), 2**15 - 1),
    "uint16_t": (0, 2**16 - 1),
    "int32_t": (-(2**31), 2**31 - 1),
    "uint32_t": (0, 2**32 - 1),
    "int64_t": (-(2**63), 2**63 - 1),
    "uint64_t": (0, 2**64 - 1),
}
WIDTHS = {"float": 32, "double": 64}
TEXT = st.text(alphabet=st.characters(min_codepoint=32, max_codepoint=126), max_size=300)


def values(kind: str, length: int) -> st.SearchStrategy[Any]:
    if kind == "char":
        return TEXT.map(lambda text: text[: max(length, 1)])
    if kind in WIDTHS:
        one: st.SearchStrategy[Any] = st.floats(width=WIDTHS[kind], allow_nan=False)
    else:
        one = st.integers(*RANGES[kind])
    return st.lists(one, min_size=length, max_size=length).map(tuple) if length else one


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    definition = dialect.mavlink_map[draw(st.sampled_from(sorted(dialect.mavlink_map)))]
    lengths = dict(zip(definition.ordered_fieldnames, definition.array_lengths, strict=True))
    fields = {
        name: draw(values(kind, lengths[name]))
        for name, kind in zip(definition.fieldnames, definition.fieldtypes, strict=True)
    }
    return Frame(definition.msgname, fields, draw(st.integers(1, 255)), draw(st.integers(0, 255)))


@settings(max_examples=300, deadline=None)
@given(frames(), st.integers(0, 255))
def test_the_wire_carries_every_message(frame: Frame, sequence: int) -> None:
    data = encode(frame, sequence)
    (read,) = MavlinkParser().feed(data)
    known = {name: read.fields[name] for name in frame.fields}  # fields newer than pymavlink's arrive as 0
    assert read == quantised(frame)
    assert Frame(read.name, known, read.system, read.component) == frame


@settings(max_examples=150, deadline=None)
@given(frames())
def test_pymavlink_reads_the_same_values(frame: Frame) -> None:
    theirs = dialect.MAVLink(None).decode(bytearray(encode(frame, 0)))
    for name, value in frame.fields.items():
        read = getattr(theirs, name)
        assert (tuple(read) if isinstance(read, list) else read) == value or isinstance(value, str)


@settings(max_examples=150, deadline=None)
@given(st.lists(frames(), max_size=4), st.lists(TEXT, min_size=5, max_size=5), st.lists(st.integers(1, 40)))
def test_text_between_frames_and_any_cutting(sent: list[Frame], texts: list[str], cuts: list[int]) -> None:
    data = b"".join(text.encode() + encode(frame, 0) for text, frame in zip(texts, sent, strict=False))
    parser = MavlinkParser()
    read: list[Frame] = []
    for cut in cuts:
        read += parser.feed(data[:cut])
        data = data[cut:]
    read += parser.feed(data)
    assert read == [quantised(frame) for frame in sent]


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=600))
def test_noise_never_raises_and_what_follows_is_heard(noise: bytes) -> None:
    beat = Frame("HEARTBEAT", {"type": 2, "mavlink_version": 3}, 1, 1)
    parser = MavlinkParser()
    parser.feed(noise)
    parser.problem()
    heard = parser.feed(encode(beat, 0) * 40)  # long enough to complete any frame that the noise pretends
    assert quantised(beat) in heard


def test_the_strategy_knows_every_type() -> None:
    kinds = {kind for definition in dialect.mavlink_map.values() for kind in definition.fieldtypes}
    assert kinds <= {*RANGES, *WIDTHS, "char", "uint8_t_mavlink_version"}
    assert struct.calcsize("f") * 8 == WIDTHS["float"]
