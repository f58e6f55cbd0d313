import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.base.time import HOUR, MINUTE, MS, US, S, clock, from_seconds, to_seconds


def test_durations() -> None:
    assert (US, MS, S, MINUTE, HOUR) == (10**3, 10**6, 10**9, 60 * 10**9, 3600 * 10**9)


@pytest.mark.parametrize(
    ("seconds", "ns"),
    [
        (0.1, 100_000_000),
        (1e-9, 1),
        (0.4e-9, 0),
        (-1.5, -1_500_000_000),
        (0, 0),
        (86400.000001, 86400 * S + US),
    ],
)
def test_seconds_at_the_door(seconds: float, ns: int) -> None:
    assert from_seconds(seconds) == ns


@given(st.integers(-(2**51), 2**51))
def test_seconds_and_back_is_exact_for_26_days(ns: int) -> None:
    assert from_seconds(to_seconds(ns)) == ns


@pytest.mark.parametrize(
    ("ns", "text"),
    [
        (0, "0:00:00.000"),
        (127 * S + 250 * MS, "0:02:07.250"),
        (25 * HOUR + 1, "25:00:00.000"),
        (999_999, "0:00:00.000"),
        (-90 * S, "-0:01:30.000"),
    ],
)
def test_a_clock_for_people(ns: int, text: str) -> None:
    assert clock(ns) == text
