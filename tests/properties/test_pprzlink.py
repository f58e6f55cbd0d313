"""Any frame of any message survives pprzlink's wire, whatever else is on it and however it is cut."""

from __future__ import annotations

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from volery.links.frame import Frame
from volery.links.pprzlink_codec import PprzlinkParser, encode, quantised
from volery.links.pprzlink_messages import PayloadField, message_names, message_type

INTEGERS = {"b": (-128, 127), "B": (0, 255), "h": (-(2**15), 2**15 - 1), "H": (0, 2**16 - 1)}
INTEGERS |= {"i": (-(2**31), 2**31 - 1), "I": (0, 2**32 - 1)}
TEXT = st.text(alphabet=st.characters(min_codepoint=1, max_codepoint=126), max_size=120)


def values(field: PayloadField) -> st.SearchStrategy[Any]:
    if field.text:
        return TEXT
    if field.code in INTEGERS:
        one: st.SearchStrategy[Any] = st.integers(*INTEGERS[field.code])
    else:
        one = st.floats(width=64 if field.code == "d" else 32, allow_nan=False)
    return st.lists(one, max_size=50).map(tuple) if field.length else one


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    kind = message_type(draw(st.sampled_from(message_names())))
    fields = {field.name: draw(values(field)) for field in kind.fields}
    return Frame(kind.name, fields, draw(st.integers(0, 255)), draw(st.integers(0, 15)))


@settings(max_examples=300, deadline=None)
@given(frames())
def test_the_wire_carries_every_message(frame: Frame) -> None:
    assert PprzlinkParser().feed(encode(frame)) == [frame] == [quantised(frame)]


@settings(max_examples=100, deadline=None)
@given(st.lists(frames(), min_size=1, max_size=4), st.lists(st.integers(1, 40), min_size=1))
def test_cuts_change_nothing(sent: list[Frame], cuts: list[int]) -> None:
    data = b"".join(encode(frame) for frame in sent)
    parser, heard, place = PprzlinkParser(), [], 0
    for number in range(len(data)):
        end = place + cuts[number % len(cuts)]
        heard += parser.feed(data[place:end])
        place = end
    assert heard == sent


@settings(max_examples=200, deadline=None)
@given(st.lists(st.one_of(st.binary(max_size=60), frames().map(encode)), max_size=6))
def test_noise_never_raises_and_every_byte_is_accounted_for(parts: list[bytes]) -> None:
    parser = PprzlinkParser()
    data = b"".join(parts)
    for frame in parser.feed(data):
        message_type(frame.name).pack(frame.fields)
    assert isinstance(parser.problem(), str)
    assert parser.statistics.octets == len(data)


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=80), frames())
def test_a_frame_after_noise_is_found_by_the_time_that_others_follow(noise: bytes, frame: Frame) -> None:
    """Noise can look like the head of a long frame; what follows shows that it was none."""
    parser = PprzlinkParser()
    heard = parser.feed(noise + encode(frame) + bytes(300))
    if not parser.statistics.unknown and not parser.statistics.frames_v1:
        assert frame in heard
