"""The page of a campaign: what it says about known rows; it is whole, offline and repeatable."""

from __future__ import annotations

import re

import pytest

import volery
from rigs.small_campaigns import COUNT, model  # noqa: F401  # a fixture
from volery.base.errors import UsageError
from volery.explore.campaign import CampaignRequest, prepare
from volery.explore.campaign_figures import MOST_LINES
from volery.explore.campaign_page import Findings, write_page
from volery.explore.campaign_store import CampaignStore
from volery.explore.points import CRASHED, FAILED, CampaignRow, VariantPoint
from volery.explore.search import Objective
from volery.explore.statistics import Interval
from volery.report.grids import Cell, Column, Grid

OBJECTIVES = (Objective("energy"), Objective("time"))


def text_of(page):
    """Return what a reader sees, without tags."""
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", re.sub(r"<style>.*?</style>", "", page, flags=re.S)))


@pytest.fixture
def page(model, tmp_path):  # noqa: F811
    """Write rows into a campaign and return its page."""

    def write(rows, findings=None):
        request = CampaignRequest.of(model, tmp_path / "out", {COUNT: [3, 4]}, on="stub")
        campaign = prepare(request)
        store = CampaignStore(campaign.folder, write=True)
        store.ask(row.point for row in rows)
        store.record(rows)
        store.close()
        with volery.Campaign(campaign.folder) as campaign:
            return write_page(campaign, findings).read_text()

    return write


def rows_of(*variants, seeds=10):
    """Return rows: for each variant its value, energy, time, and whether it meets its requirement."""
    found = []
    for value, energy, seconds, met in variants:
        for seed in range(seeds):
            observables = {"energy": energy + 0.1 * seed, "time": seconds + 0.1 * seed}
            point = VariantPoint({COUNT: value, "wind": f"{value} m/s"}, seed)
            found.append(
                CampaignRow(len(found), point, verdicts={"in_time": met}, observables=observables, cpu_s=0.5)
            )
    return found


def test_the_front_has_variants_that_meet_the_requirements_and_are_not_dominated(page):
    rows = rows_of((1, 10, 50, True), (2, 20, 30, True), (3, 25, 40, True), (4, 1, 1, False))
    drawn = page(rows, Findings(OBJECTIVES))
    assert re.search(r'aria-label="time against energy; 20 runs are not dominated"', drawn)
    assert "30 of 40 0.75" in text_of(drawn)
    assert "wind" in text_of(drawn)
    assert '"#run-12"' in drawn  # a point leads to its run
    assert '<tr id="run-12">' in drawn


def test_intervals_warn_when_the_runs_are_too_few(page):
    said = text_of(page(rows_of((1, 10, 50, True), seeds=3)))
    assert "Too few runs to know the probability well of: in_time" in said
    assert "3 of 3 1 0.2924 to 1" in said  # Clopper-Pearson: 0.025 ** (1 / 3)


def test_runs_that_failed_alike_are_one_line_with_an_example(page):
    rows = rows_of((1, 10, 50, True))
    for number in range(3):
        reason = f"drone_1: <b>{20 + number}.5 m</b> off its path"
        rows.append(CampaignRow(len(rows), VariantPoint({COUNT: 9}, number), FAILED, reason))
    rows.append(CampaignRow(len(rows), VariantPoint({COUNT: 9}, 7), CRASHED, "signal 9"))
    drawn = page(rows)
    assert "failed 3 drone_1: &lt;b&gt;20.5 m&lt;/b&gt; off its path 10" in text_of(drawn)
    assert "crashed 1 signal 9 13" in text_of(drawn)
    assert "<b>20" not in drawn


def test_effects_and_further_tables_are_shown(page):
    faults = Grid(
        "Faults", (Column("fault"), Column("take-off")), ((Cell("gps"), Cell("met", status="good")),)
    )
    effects = {
        "total index of time": {"wind": Interval(0.5, 0.4, 0.6, 9), "loss": Interval(0.1, 0.0, 0.2, 9)}
    }
    drawn = page(rows_of((1, 10, 50, True)), Findings(effects=effects, grids=[faults]))
    assert 'aria-label="total index of time: wind 0.5, loss 0.1"' in drawn
    assert "gps met" in text_of(drawn)


def test_many_runs_draw_a_part_of_them(page):
    drawn = page(rows_of((1, 10, 50, True), (2, 20, 30, True), seeds=2000), Findings(OBJECTIVES))
    assert f"the {MOST_LINES} runs that are drawn" in text_of(drawn)
    assert len(drawn) < 3_000_000


def test_the_same_rows_give_the_same_bytes_and_no_outside_address(page):
    rows = rows_of((1, 10, 50, True), (2, 20, 30, True))
    drawn = page(rows, Findings(OBJECTIVES))
    assert drawn == page(rows, Findings(OBJECTIVES))
    addresses = set(re.findall(r'(?:href|src|url)="?(https?:[^" ]*)', drawn))
    assert not addresses


def test_an_objective_that_no_run_observed_is_named(page):
    with pytest.raises(UsageError, match="no run observed 'price'; there is energy, time"):
        page(rows_of((1, 10, 50, True)), Findings((Objective("price"), Objective("time"))))


def test_a_campaign_without_a_finished_run_has_no_page(page):
    with pytest.raises(UsageError, match="no run is finished yet"):
        page([])


def test_of_many_parameters_those_are_drawn_that_matter_beside_the_result(page):
    def row(run):
        values = {f"p{place:02}": (run * (place + 3)) % 17 for place in range(12)}
        return CampaignRow(
            run, VariantPoint(values, run), observables={"energy": 10.0 * values["p11"] - values["p03"]}
        )

    drawn = page([row(run) for run in range(60)])
    assert "the 8 of 12 parameters that go most with energy" in text_of(drawn)
    lines = drawn[drawn.index("All runs") : drawn.index("Distributions")]
    assert ">p11<" in lines
    assert ">energy<" in lines


def test_a_single_run_and_an_infinite_value_are_said_in_words(page):
    said = text_of(page([CampaignRow(0, VariantPoint({COUNT: 3}, 1), observables={"time": float("inf")})]))
    assert "finished 1 run " in said
    assert "1 variant " in said
    infinite = [
        CampaignRow(n, VariantPoint({COUNT: n % 2}, n), observables={"time": [1.0, 2.0, float("inf")][n]})
        for n in range(3)
    ]
    assert "inf" in text_of(page(infinite))
