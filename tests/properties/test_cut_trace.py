"""A trace that is cut anywhere gives the events before the cut, and says so."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.errors import UsageError
from volery.testing.sample_run import sample_events, sample_setup
from volery.trace.mcap_writer import McapWriter
from volery.trace.reader import read


@cache
def whole() -> tuple[bytes, int, list[str]]:
    """A trace, the size of its beginning, and its events as text."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "trace.mcap"
        writer = McapWriter(path, sample_setup())
        begun = path.stat().st_size
        events = list(sample_events(seconds=3.0))
        for event in events:
            writer(event)
        writer.close()
        return path.read_bytes(), begun, [repr(event) for event in events]


def events_before(cut: int) -> list[str] | None:
    data, _, _ = whole()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "trace.mcap"
        path.write_bytes(data[:cut])
        try:
            trace = read(path)
        except UsageError:
            return None
    assert trace.complete == (cut == len(data))
    assert bool(trace.lost) == (cut < len(data))
    return [repr(event) for event in trace.events]


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_a_cut_leaves_a_prefix(draw: st.DataObject) -> None:
    data, begun, events = whole()
    cut = draw.draw(st.integers(0, len(data)))
    found = events_before(cut)
    if cut < begun:
        assert found is None
    else:
        assert found is not None
        assert found == events[: len(found)]


def test_a_later_cut_never_leaves_less() -> None:
    data, begun, events = whole()
    counts = [len(events_before(cut) or []) for cut in range(begun, len(data) + 1, 997)]
    assert counts == sorted(counts)
    assert len(events_before(len(data)) or []) == len(events)


def test_every_byte_of_the_beginning() -> None:
    _, begun, _ = whole()
    assert all(events_before(cut) is None for cut in range(begun))
    assert events_before(begun) == []
