"""Events come out of the heap in C in the order in which they come out of the heap of Python."""

import gc
import weakref
from itertools import count
from types import ModuleType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.kernel import event_heap

TIMES = st.integers(0, 9) | st.integers(0, 2**63)
CALLS = st.lists(st.tuples(st.sampled_from(["push", "push", "pop", "replace"]), TIMES), max_size=300)


def outcome(module: Any, calls: list[tuple[str, int]], begun: list[int]) -> list[Any]:
    """Return what the calls return, and then what is left, in order."""
    tickets = count()
    heap = module.EventHeap([(when, next(tickets), "begun") for when in sorted(begun)])
    seen: list[Any] = []
    for name, when in calls:
        event = (when, next(tickets), object)
        if name == "push":
            module.heappush(heap, event)
        elif len(heap) == 0:
            with pytest.raises(IndexError):
                module.heappop(heap)
        else:
            seen.append(heap[0])
            seen.append(module.heappop(heap) if name == "pop" else module.heapreplace(heap, event))
    return seen + [module.heappop(heap) for _ in range(len(heap))]


@given(calls=CALLS, begun=st.lists(TIMES, max_size=20))
def test_events_have_the_same_order(
    twins_in_c: dict[str, ModuleType], calls: list[tuple[str, int]], begun: list[int]
) -> None:
    assert outcome(twins_in_c["event_heap"], calls, begun) == outcome(event_heap, calls, begun)


def test_times_beyond_64_bits_are_the_last(twins_in_c: dict[str, ModuleType]) -> None:
    module = twins_in_c["event_heap"]
    heap = module.EventHeap([(10**30, 1, "never"), (2**63, 2, "late"), (5, 3, "soon")])
    assert [module.heappop(heap)[2] for _ in range(3)] == ["soon", "late", "never"]


def test_what_is_no_event_is_refused(twins_in_c: dict[str, ModuleType]) -> None:
    module = twins_in_c["event_heap"]
    heap = module.EventHeap([(1, 1, "kept")])
    for wrong in (None, (), (1,), ("a", 1, None), (1, "b", None)):
        with pytest.raises(TypeError):
            module.heappush(heap, wrong)
        with pytest.raises(TypeError):
            module.heapreplace(heap, wrong)
        with pytest.raises(TypeError):
            module.EventHeap([wrong])
    for call in (module.heappush, module.heapreplace):
        with pytest.raises(TypeError):
            call([], (1, 1, None))
        with pytest.raises(TypeError):
            call(heap)
    with pytest.raises(TypeError):
        module.heappop([])
    with pytest.raises(IndexError):
        heap[1]
    assert len(heap) == 1
    assert heap[0] == (1, 1, "kept")


def test_events_are_freed(twins_in_c: dict[str, ModuleType]) -> None:
    module = twins_in_c["event_heap"]

    class Target:
        pass

    heap = module.EventHeap()
    targets = [Target() for _ in range(100)]
    for number, target in enumerate(targets):
        module.heappush(heap, (number, number, target))
        target.heap = heap  # type: ignore[attr-defined]  # a cycle
    kept = [weakref.ref(target) for target in targets]
    del targets, target
    for _ in range(50):
        module.heappop(heap)
    module.heapreplace(heap, (1, 1000, None))
    gc.collect()
    assert sum(one() is not None for one in kept) == 49
    del heap
    gc.collect()
    assert not any(one() for one in kept)
