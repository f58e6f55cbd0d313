"""The lines of a timeline by C and by Python have the same bytes, whatever the spans."""

import gc
import json
import weakref
from types import ModuleType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.trace.events import Slice
from volery.trace.spans import Spans

TIMES = st.integers(0, 5000) | st.integers(-(2**61), 2**61)
TEXTS = st.sampled_from(["", '"a"', '"drøne"', '"\udc80"']) | st.text(max_size=20)
SLICES = st.builds(
    Slice,
    st.integers(0, 5) | TIMES,
    st.integers(0, 5) | TIMES,
    st.sampled_from(["onboard", "ground"]),
    st.integers(0, 2),
    st.sampled_from(["t", "u"]),
    st.sampled_from(["c", "d", "drøne"]),
)
CALLS = st.one_of(
    st.tuples(st.just("slice"), SLICES),
    st.tuples(st.just("slice"), SLICES),
    st.tuples(st.just("complete"), TEXTS, TIMES, TIMES, TEXTS),
    st.tuples(st.just("pair"), TEXTS, TIMES, TIMES, TEXTS, TEXTS, TEXTS),
    st.tuples(st.just("mark"), TEXTS, st.sampled_from("tg"), TIMES, TEXTS),
    st.tuples(st.just("add"), TEXTS),
)


class Written:
    """What one kind of spans writes, as the writer of a timeline uses it."""

    def __init__(self, spans_type: Any) -> None:
        self.data = b""
        self.lasts: list[int] = []
        self.spans = spans_type(self._write, self._track, self._name)

    def _write(self, data: bytes) -> bool:
        self.data += data
        return True

    def _track(self, processor: str, core: int) -> str:
        self.spans.add(f'{{"thread of":"{processor} {core}"}}')
        return f'"pid":"{processor}","tid":{core}'

    def _name(self, task: str, component: str) -> str:
        return f'"{component}/{task}"'

    def write(self, calls: list[tuple[Any, ...]]) -> "Written":
        for name, *arguments in calls:
            getattr(self.spans, name)(*arguments)
            self.lasts.append(self.spans.last)
        self.spans.end_slices()
        self.spans.close()
        return self


@given(calls=st.lists(CALLS, max_size=40))
def test_bytes_are_the_same(twins_in_c: dict[str, ModuleType], calls: list[tuple[Any, ...]]) -> None:
    plain, compiled = Written(Spans).write(calls), Written(twins_in_c["spans"].Spans).write(calls)
    assert compiled.data == plain.data
    assert compiled.lasts == plain.lasts


def test_a_long_timeline_is_written_in_parts(twins_in_c: dict[str, ModuleType]) -> None:
    calls = [("slice", Slice(2 * k, 2 * k + 1, "p", k % 3, f"t{k % 7}", "c")) for k in range(5000)]
    compiled = Written(twins_in_c["spans"].Spans).write(calls)
    assert compiled.data == Written(Spans).write(calls).data
    assert sum(line.get("ph") == "X" for line in json.loads(compiled.data)) == 5000


def test_nothing_is_an_empty_array(twins_in_c: dict[str, ModuleType]) -> None:
    assert Written(twins_in_c["spans"].Spans).write([]).data == b"[]\n"


def test_what_is_no_slice_or_no_text_is_refused_and_leaves_no_line(twins_in_c: dict[str, ModuleType]) -> None:
    written = Written(twins_in_c["spans"].Spans)
    for wrong in (None, (1, 2), Slice("0", 2, "p", 0, "t", "c")):  # type: ignore[arg-type]
        with pytest.raises(TypeError):
            written.spans.slice(wrong)
    for call in (("add", 5), ("complete", 5, 0, 0, ""), ("pair", "", 0, 0, "", "", None)):
        with pytest.raises(TypeError):
            written.write([call])
    assert written.write([]).data == b"[]\n"


def test_an_error_of_a_callback_comes_out(twins_in_c: dict[str, ModuleType]) -> None:
    spans = twins_in_c["spans"].Spans([].index, [].index, [].index)
    spans.slice(Slice(0, 1, "p", 0, "t", "c"))
    for call in (spans.end_slices, spans.close):
        with pytest.raises(ValueError, match="not in list"):
            call()


def test_spans_and_their_owner_are_freed(twins_in_c: dict[str, ModuleType]) -> None:
    written = Written(twins_in_c["spans"].Spans).write([("slice", Slice(0, 1, "p", 0, "t", "c"))])
    alive = weakref.ref(written)
    del written
    gc.collect()
    assert alive() is None
