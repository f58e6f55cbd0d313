"""The chunk in C and the chunk in Python have the same bytes, whatever the events."""

import gc
import weakref
from types import ModuleType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.trace.chunk import Chunk
from volery.trace.encoding import OWN_EVENTS, PUBLISHED, Codec, Layout, _annotation
from volery.trace.events import Message, Published, Slice, Text

LAYOUTS: dict[type[Any], Layout] = {
    **{kind: Codec(kind).layout for kind in OWN_EVENTS},
    Published: PUBLISHED,
}
VALUES: dict[str, st.SearchStrategy[Any]] = {
    "Ns": st.integers(0, 3_000_000_000) | st.integers(0, 2**63 - 1),
    "int": st.integers(-(2**31), 2**31 - 1),
    "float": st.floats(),
    "bool": st.booleans(),
    "str": st.sampled_from(["", "a", "node", "drøne", "\udc80"]) | st.text(max_size=40),
    "bytes": st.binary(max_size=40),
}


@pytest.fixture(scope="module")
def in_c(twins_in_c: dict[str, ModuleType]) -> ModuleType:
    return twins_in_c["chunk"]


def event(kind: type[Any]) -> st.SearchStrategy[Any]:
    return st.builds(kind, *(VALUES[_annotation(kind, name)] for name in kind._fields))


class Written:
    """What one kind of chunk makes of events, as the writer of a trace uses it."""

    def __init__(self, chunk_type: Any) -> None:
        self.filled: list[Any] = []
        self.opened: list[tuple[Any, ...]] = []
        self.chunk = chunk_type(self._end_second)
        self.writers = {kind: self.chunk.writer(layout, self._open) for kind, layout in LAYOUTS.items()}

    def _end_second(self, now: int) -> None:
        self.filled.append(self.chunk.take())
        self.chunk.end = min(now // 1_000_000_000 * 1_000_000_000 + 1_000_000_000, 2**63 - 1)

    def _open(self, *subject: str) -> int:
        self.opened.append(subject)
        self.chunk.add(b"channel " + str(len(self.opened)).encode())
        return len(self.opened) * 31 % 65536

    def write(self, events: list[Any]) -> "Written":
        for one in events:
            self.writers[type(one)](one)
        self.filled.append(self.chunk.take())
        return self


@given(events=st.lists(st.one_of([event(kind) for kind in LAYOUTS]), max_size=30))
def test_bytes_indexes_and_counts_are_the_same(in_c: ModuleType, events: list[Any]) -> None:
    plain, compiled = Written(Chunk).write(events), Written(in_c.Chunk).write(events)
    assert compiled.filled == plain.filled
    assert [list(one[2]) for one in compiled.filled if one] == [list(one[2]) for one in plain.filled if one]
    assert compiled.opened == plain.opened


def test_a_long_chunk_grows_its_buffers(in_c: ModuleType) -> None:
    events = [Text(number, "s" * (number % 50), 6, "x" * number) for number in range(3000)]
    assert Written(in_c.Chunk).write(events).filled == Written(Chunk).write(events).filled


def test_a_lost_message_is_logged_when_it_was_sent(in_c: ModuleType) -> None:
    [_, filled] = Written(in_c.Chunk).write([Message(7, -1, "t", "p", "s", 3)]).filled
    assert filled[4:] == (7, 7)


@pytest.mark.parametrize(
    "wrong",
    [
        Slice(-5, -1, "p", 0, "t", "c"),
        Slice(1, 2, "p", 2**31, "t", "c"),
        Slice(1, 2**63, "p", 0, "t", "c"),
        Slice(1, 2, "p", 0, "t", None),  # type: ignore[arg-type]
        Slice(1, 2, "p", "0", "t", "c"),  # type: ignore[arg-type]
    ],
)
def test_what_cannot_be_encoded_raises_and_leaves_no_record(in_c: ModuleType, wrong: Slice) -> None:
    written = Written(in_c.Chunk).write([])
    good = Slice(1, 2, "p", 0, "t", "c")
    written.write([good])
    with pytest.raises((OverflowError, TypeError)):
        written.writers[Slice](wrong)
    written.write([good])
    assert written.filled[-1][0] == written.filled[-2][0].removeprefix(b"channel 1")


def test_what_is_no_event_is_refused(in_c: ModuleType) -> None:
    writer = Written(in_c.Chunk).writers[Slice]
    for wrong in (None, (), (1, 2)):
        with pytest.raises(TypeError, match="no event of this kind"):
            writer(wrong)


@pytest.mark.parametrize("wrong", [Layout(-1, 0, ()), Layout(0, 0, (99,)), Layout(0, 0, (), "qs", (0, 1))])
def test_a_wrong_layout_is_refused(in_c: ModuleType, wrong: Layout) -> None:
    with pytest.raises(ValueError, match="not"):
        in_c.Chunk(print).writer(wrong, len)


def test_an_error_of_a_callback_comes_out(in_c: ModuleType) -> None:
    chunk = in_c.Chunk([].index)
    with pytest.raises(ValueError, match="0 is not in list"):
        chunk.writer(LAYOUTS[Text], len)(Text(0, "", 1, ""))
    chunk.end = 10
    with pytest.raises(TypeError):
        chunk.writer(LAYOUTS[Text], len)(Text(0, "", 1, ""))


def test_a_chunk_and_its_owner_are_freed(in_c: ModuleType) -> None:
    written = Written(in_c.Chunk).write([Text(1, "a", 2, "b")])
    alive = weakref.ref(written)
    del written
    gc.collect()
    assert alive() is None
