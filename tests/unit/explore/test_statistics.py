import numpy as np
import pytest
from scipy import stats

from volery.base.errors import UsageError
from volery.explore.points import FAILED, CampaignRow, VariantPoint
from volery.explore.statistics import (
    bootstrap,
    compared,
    least_runs,
    mean,
    met,
    observed,
    paired,
    percentile,
    probability,
    read_until,
)

REPETITIONS = 2000


def share_covered(intervals, truth):
    return np.mean([truth in one for one in intervals])


@pytest.mark.parametrize(("p", "runs"), [(0.5, 50), (0.8, 100), (0.9, 200), (0.95, 400)])
def test_coverage_of_wilson(p, runs):
    of = {count: probability(count, runs, method="wilson") for count in range(runs + 1)}
    draws = np.random.default_rng(1).binomial(runs, p, REPETITIONS)
    assert 0.93 <= share_covered([of[one] for one in draws], p) <= 0.97


@pytest.mark.parametrize(("p", "runs"), [(0.5, 20), (0.9, 20), (0.99, 20), (0.99, 200), (0.992, 20)])
def test_coverage_of_clopper_pearson_and_of_what_few_runs_get(p, runs):
    draws = np.random.default_rng(2).binomial(runs, p, REPETITIONS)
    for method in ("clopper-pearson", ""):
        of = {count: probability(count, runs, method=method) for count in range(runs + 1)}
        assert share_covered([of[one] for one in draws], p) >= (0.95 if method else 0.94)


def test_of_20_runs_at_99_percent_an_interval_covers_or_says_that_they_are_too_few():
    draws = set(np.random.default_rng(7).binomial(20, 0.99, REPETITIONS))
    found = [probability(int(one), 20) for one in draws]
    assert all("too few runs" in one.sentence("delivered") or 0.99 in one for one in found)
    assert "too few runs" in found[0].sentence("delivered")


def test_too_few_runs_are_said():
    one = probability(20, 20)
    assert one.method == "clopper-pearson"
    assert "too few runs: 0 failures seen" in one.sentence("delivered")
    assert not probability(60, 100).too_few


def test_coverage_of_t_and_bootstrap():
    values = np.random.default_rng(3).normal(10.0, 2.0, (REPETITIONS, 25))
    assert 0.93 <= share_covered([mean(one) for one in values], 10.0) <= 0.97
    skewed = np.random.default_rng(4).exponential(1.0, (REPETITIONS, 60))
    assert 0.93 <= share_covered([bootstrap(one, np.mean) for one in skewed], 1.0) <= 0.97


@pytest.mark.parametrize("runs", [80, 200])
def test_coverage_of_percentiles(runs):
    values = np.random.default_rng(5).lognormal(0.0, 0.3, (REPETITIONS, runs))
    truth = float(stats.lognorm(0.3).ppf(0.95))
    assert 0.93 <= share_covered([percentile(one, 0.95) for one in values], truth) <= 0.97


def test_a_percentile_of_few_runs_has_no_interval():
    needed = least_runs(0.95)
    few = percentile(np.arange(needed - 1.0), 0.95)
    assert few.high == np.inf
    assert f"{needed} needed" in few.too_few
    assert not percentile(np.arange(float(needed)), 0.95).too_few


@pytest.mark.parametrize(
    ("text", "truth"), [("x within 10 %", np.exp(0.045)), ("x.p90 within 15 %", stats.lognorm(0.3).ppf(0.9))]
)
def test_coverage_when_runs_stop_as_soon_as_they_are_enough(text, truth):
    until, random, found = read_until(text), np.random.default_rng(6), []
    for _ in range(REPETITIONS):
        values = random.lognormal(0.0, 0.3, 4000)
        found.append(truth in until.enough(lambda runs, values=values: until.of(values[:runs]), 4000))
    assert 0.93 <= np.mean(found) <= 0.97


def test_coverage_of_a_probability_when_runs_stop_as_soon_as_they_are_enough():
    until, random, found = read_until("met.probability within 5 %"), np.random.default_rng(8), []
    for _ in range(REPETITIONS // 4):
        total = np.cumsum(random.random(2000) < 0.9)
        found.append(
            0.9 in until.enough(lambda runs, total=total: probability(int(total[runs - 1]), runs), 2000)
        )
    assert 0.93 <= np.mean(found) <= 0.975


def test_runs_that_were_not_enough_are_said():
    values = np.random.default_rng(9).normal(1.0, 1.0, 40)
    until = read_until("time within 1 %")
    assert (
        until.enough(lambda runs: until.of(values[:runs]), 40).too_few
        == "not time.mean within 1 % after 40 runs"
    )


def test_reading_conditions():
    until = read_until("drone_1.energy.p95 within 200 J at 99 %")
    assert (until.name, until.statistic, until.within, until.relative, until.level) == (
        "drone_1.energy", "p95", 200.0, False, 0.99
    )  # fmt: skip
    assert read_until("delivery_time within 5 %").relative
    assert not read_until("in_time.probability within 1 %").relative


@pytest.mark.parametrize(
    "text", ["", "energy", "energy within", "energy within five", "energy within 0 %", "e.p0 within 5 %",
             "energy within 5 % at 100 %", "energy within -1 J", "energy within 5 pc", "e.p100 within 1 %"]
)  # fmt: skip
def test_wrong_conditions_name_the_remedy(text):
    with pytest.raises(UsageError, match=r"delivery_time.p95 within 5 %|percentile is between"):
        read_until(text)


def rows_of(values, **verdicts):
    return [
        CampaignRow(number, VariantPoint(seed=number), observables={"time": value}, verdicts=verdicts)
        for number, value in enumerate(values)
    ]


def test_pairs_with_the_same_seed_need_fewer_runs():
    random = np.random.default_rng(7)
    common = random.normal(100.0, 10.0, 30)
    result = compared(rows_of(common), rows_of(common + 1.0 + random.normal(0.0, 0.5, 30)), "time")
    assert result.differs
    assert 1.0 in result.difference
    assert result.saved > 100
    assert result.correlation > 0.99


def test_runs_that_failed_are_left_out_of_pairs_and_meet_no_requirement():
    rows = rows_of([1.0, 2.0, 3.0, 4.0], fast=True)
    failed = [
        *rows[:3],
        CampaignRow(3, VariantPoint(seed=3), FAILED, observables={"time": 0.0}, verdicts={"fast": True}),
    ]
    assert np.isnan(observed(failed, "time")[3])
    assert compared(rows, failed, "time").left_out == 1
    assert met(failed, "fast").estimate == 0.75
    with pytest.raises(UsageError, match="'slow'; there is fast"):
        met(failed, "slow")
    with pytest.raises(UsageError, match="needs 2"):
        paired({1: 1.0}, {1: 2.0})


def test_sentences():
    assert probability(197, 200, method="wilson").sentence("delivered in 8 min") == (
        "delivered in 8 min: 0.956 to 0.995 (95 %, 200 runs; too few runs: 3 failures seen, "
        "5 needed for a narrow interval)"
    )
    assert mean([1.0, 2.0, 3.0]).sentence("time", "s") == "time: -0.5 to 4.5 s (95 %, 3 runs)"
    assert mean([5.0]).sentence("time", "s").startswith("time: 5 s, no interval (95 %, 1 run; too few")
    assert mean([]).sentence("time") == "time: not known, no run shows it"
