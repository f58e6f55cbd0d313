"""Counters inside expressions: a reading is the sum of the weights that were counted since the last one."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from volery.cost.ticks import Ticks

CALLS = st.lists(st.none() | st.integers(0, 3), max_size=60)  # a reading, or one of the counters


@given(weights=st.lists(st.integers(0, 2**40), min_size=4, max_size=4), calls=CALLS)
def test_readings_are_sums_of_weights(weights: list[int], calls: list[int | None]) -> None:
    ticks = Ticks()
    counters = [ticks.counter(weight) for weight in weights]
    expected = 0
    for number in (*calls, None):
        if number is None:
            assert ticks.take() == expected
            expected = 0
        else:
            counters[number]()
            expected += weights[number]
