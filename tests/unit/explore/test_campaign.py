"""A campaign by its coordinator alone: what is asked, recorded, resumed and refused. The engine is a stub."""

from __future__ import annotations

import pytest

import volery
from rigs.small_campaigns import COUNT, model, same_rows  # noqa: F401  # a fixture
from volery.base.errors import ModelError, UsageError
from volery.explore import campaign as campaign_module
from volery.explore import parquet_table
from volery.explore.campaign import CampaignRequest, prepare
from volery.explore.executors import EngineLostError, open_executor
from volery.explore.points import VariantPoint
from volery.model.builder import ModelBuilder


@pytest.fixture
def explore(model, tmp_path):  # noqa: F811
    def run(out="out", space=None, on="stub", **stated):
        return volery.explore(model, tmp_path / out, space or {COUNT: [3, 4]}, on=on, **stated)

    return run


def test_every_run_is_a_row_and_the_table_has_all_of_it(explore):
    campaign = explore(seeds=10)
    table = campaign.table()
    assert len(table) == 20
    assert list(table[f"set.{COUNT}"]) == [3] * 10 + [4] * 10
    assert table["seed"][:10].tolist() == table["seed"][10:].tolist()
    assert set(table["status"]) == {"completed"}
    assert {"met.in_time", "drone_1.energy", "sim_s", "wall_s", "attempt"} < set(table.columns)
    import pandas

    written = pandas.read_parquet(campaign.folder / "rows.parquet")
    assert written["drone_1.energy"].tolist() == table["drone_1.energy"].tolist()
    assert volery.Campaign(campaign.folder).table().equals(table)


def test_a_lost_engine_is_named_and_the_campaign_goes_on_where_it_was(explore):
    with pytest.raises(EngineLostError, match=r"stub://7 was lost after \d+ of 20 runs: the cable was cut"):
        explore(seeds=10, on="stub://7")
    assert 0 < volery.Campaign(explore.__closure__[1].cell_contents / "out").count()[1] < 20
    resumed = explore(seeds=10).table()
    assert same_rows(resumed, explore("undisturbed", seeds=10).table())
    assert resumed["attempt"].max() == 2


def test_more_seeds_and_values_add_runs(explore):
    first = explore(seeds=5)
    assert first.count() == (10, 10)
    more = explore(seeds=6, space={COUNT: [3, 4, 5]})
    assert more.count() == (18, 18)
    assert same_rows(more.table()[:10], first.table()[:10])


def test_points_of_a_search_are_made_once_and_returned_in_order(explore):
    campaign = explore(seeds=1)
    points = [VariantPoint({COUNT: 9}, 4), VariantPoint({COUNT: 3}, 5), VariantPoint({COUNT: 9}, 4)]
    rows = campaign.evaluate(points)
    assert [row.point for row in rows] == points
    assert [row.run for row in rows] == [2, 3, 2]
    assert campaign.evaluate(points[::-1]) == rows[::-1]


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (
            lambda folder, monkeypatch: (folder / "counter.py").write_text("pass"),
            "another state of the model",
        ),
        (
            lambda folder, monkeypatch: monkeypatch.setattr(
                campaign_module, "installed_version", lambda: "9"
            ),
            r"another volery, .* and not 9",
        ),
    ],
)
def test_rows_that_could_not_be_compared_are_refused(explore, model, monkeypatch, change, what):  # noqa: F811
    campaign = explore()
    change(model, monkeypatch)
    with pytest.raises(UsageError, match=what):
        explore()
    with pytest.raises(UsageError, match="could not be compared"):
        campaign.run([VariantPoint({}, 3)])


@pytest.mark.parametrize(
    ("stated", "error", "what"),
    [
        ({"space": {"components.Conter.parameters.count": [1]}}, ModelError, "did you mean 'Counter'"),
        ({"space": {"allocation": ["only", "slw"]}}, UsageError, "did you mean 'slow'"),
        ({"seedz": 3}, UsageError, "no argument 'seedz'"),
        ({"seeds": 0}, ModelError, "at least 1"),
        ({"on": "dusk://h:1"}, UsageError, "did you mean 'dask'"),
        ({"on": "dask"}, UsageError, "the address of the scheduler"),
        ({"on": "processes://h"}, UsageError, "have no address"),
        ({"workers": -1}, UsageError, "1 or more"),
    ],
)
def test_what_cannot_be_run_is_said_before_anything_is(explore, stated, error, what):
    with pytest.raises(error, match=what):
        explore(**stated)


def test_progress_is_shown_with_the_time_left(explore):
    shown = []
    explore(seeds=50, show=shown.append)
    assert (shown[-1].finished, shown[-1].asked, shown[-1].left_s) == (100, 100, 0.0)
    assert shown[-1].statuses == {"completed": 100}


def test_a_model_that_was_built_in_python_is_carried(tmp_path, model):  # noqa: F811
    built = ModelBuilder("built", folder=model)
    built.add("components", "Counter", language="python", path="counter.py", active=True)
    built.add("application", "counter", is_="Counter")
    built.add("platform.processors", "pc", is_="rpi4-cortex-a72", frequency="1500 MHz")
    built.add("allocations", "only", counter="pc")
    with prepare(CampaignRequest.of(built, tmp_path / "out", on="stub", seeds=3)) as campaign:
        campaign.run(campaign.specification.run_points())
        assert campaign.count() == (3, 3)
        assert campaign.setting.model is built
    with pytest.raises(UsageError, match="was built in Python"):
        volery.Campaign(tmp_path / "out").evaluate([VariantPoint({}, 1)])


@pytest.mark.parametrize("part", [4, 5, 100])
def test_a_table_is_exported_in_parts(explore, monkeypatch, part):
    import pandas

    campaign = explore(seeds=4)
    monkeypatch.setattr(parquet_table, "PART", part)
    assert pandas.read_parquet(campaign.export())["run"].tolist() == list(range(8))


def test_an_unknown_run_is_refused(explore):
    with pytest.raises(UsageError, match="no run 99; its runs are 0 to 1"):
        explore().row(99)


def test_an_engine_of_this_machine_has_its_processors():
    executor, workers = open_executor(workers=3)
    executor.shutdown()
    assert workers == 3


def test_a_value_that_is_wrong_in_every_run_is_refused_before_the_first(explore, tmp_path):
    with pytest.raises(ModelError, match=r"environment\.wind\.speed: 'fast' is not a number with a unit"):
        explore(space={"environment.wind.speed": ["2 m/s", "fast"]})
    assert not (tmp_path / "out").exists()
