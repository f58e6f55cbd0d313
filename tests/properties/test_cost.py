from hypothesis import given
from hypothesis import strategies as st

from volery.cost import Tariff, load_catalogue, scale_time

KINDS = st.sampled_from(["intel-i5-3470", "rpi4-cortex-a72"])


@st.composite
def tariffs(draw: st.DrawFn) -> Tariff:
    law = load_catalogue().processor(draw(KINDS)).ros_law("roscpp")
    return Tariff(law, draw(st.floats(law.least_mhz, law.greatest_mhz)))


@given(tariffs(), st.integers(0, 200), st.integers(0, 200))
def test_the_price_of_publishing_is_linear_in_the_subscribers(tariff: Tariff, one: int, other: int) -> None:
    first, second, both = (tariff("publish", float(x)).background for x in (one, other, one + other))
    assert abs(first + second - both) <= 2  # each is rounded to a nanosecond


@given(tariffs(), st.floats(0, 1e7), st.floats(0, 1e7))
def test_a_longer_sleep_never_costs_less(tariff: Tariff, one: float, other: float) -> None:
    short, long = sorted((one, other))
    assert tariff("sleep", short).background <= tariff("sleep", long).background


@given(tariffs())
def test_nothing_is_free_inside_the_range(tariff: Tariff) -> None:
    for call in tariff.law.calls:
        price = tariff(call, 1.0)
        assert price.caller + price.background > 0
        assert price.caller >= 0
        assert price.background >= 0


@given(st.integers(0, 10**12), st.floats(100, 4000), st.floats(100, 4000))
def test_scaling_there_and_back_is_the_same_time(time: int, one: float, other: float) -> None:
    there = scale_time(time, ("cpu", one), ("cpu", other))
    back = scale_time(there, ("cpu", other), ("cpu", one))
    assert abs(back - time) <= other / one + 1
