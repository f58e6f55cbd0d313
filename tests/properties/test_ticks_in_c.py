"""Counters in C and in Python count the same."""

import gc
import sys
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.cost.ticks import Ticks

CALLS = st.lists(st.none() | st.integers(0, 3), max_size=60)  # a reading, or one of the counters


@given(weights=st.lists(st.integers(0, 2**40), min_size=4, max_size=4), calls=CALLS)
def test_counts_are_the_same(
    twins_in_c: dict[str, ModuleType], weights: list[int], calls: list[int | None]
) -> None:
    read = []
    for kind in (Ticks, twins_in_c["ticks"].Ticks):
        ticks = kind()
        counters = [ticks.counter(weight) for weight in weights]
        read.append([ticks.take() if one is None else counters[one]() for one in (*calls, None)])
    assert read[0] == read[1]
    expected = sum(weights[one] for one in calls if one is not None)
    assert sum(one for one in read[1] if one is not None) == expected


def test_a_counter_keeps_its_sum_and_frees_it(twins_in_c: dict[str, ModuleType]) -> None:
    ticks = twins_in_c["ticks"].Ticks()
    before = sys.getrefcount(ticks)
    counters = [ticks.counter(weight) for weight in range(10)]
    assert sys.getrefcount(ticks) == before + 10
    del counters
    gc.collect()
    assert sys.getrefcount(ticks) == before


def test_a_weight_is_a_number(twins_in_c: dict[str, ModuleType]) -> None:
    with pytest.raises(TypeError):
        twins_in_c["ticks"].Ticks().counter("a")
