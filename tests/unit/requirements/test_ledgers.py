"""Spread of durations: exact where promised, close where promised."""

from hypothesis import given
from hypothesis import strategies as st

from volery.requirements.ledgers import Distribution


def spread(durations: list[int]) -> Distribution:
    found = Distribution()
    for duration in durations:
        found.add(duration)
    return found


def test_nothing_observed_is_none_not_zero() -> None:
    assert spread([]).mean() is None
    assert spread([]).quantile(0.95) is None


@given(st.lists(st.integers(0, 10**13), min_size=1), st.sampled_from([0.5, 0.95, 0.99, 1.0]))
def test_quantiles_are_never_too_low_and_at_most_two_permille_too_high(
    values: list[int], share: float
) -> None:
    found = spread(values)
    exact = next(value for rank, value in enumerate(sorted(values), start=1) if rank >= share * len(values))
    measured = found.quantile(share)
    assert measured is not None
    assert exact <= measured <= exact * 1.002
    assert measured <= found.largest == max(values)
    assert found.mean() == sum(values) / len(values)


@given(st.permutations(list(range(0, 5_000_000, 99_991))))
def test_order_does_not_matter(values: list[int]) -> None:
    assert spread(values).quantile(0.95) == spread(sorted(values)).quantile(0.95)


def test_memory_does_not_grow_with_observations() -> None:
    found = spread([(index * 2_654_435_761) % 10**9 for index in range(50_000)])
    assert len(found._buckets) < 12_000
