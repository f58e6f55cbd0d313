"""The folder of a campaign: rows are there once written, for readers too, and what is missing is known."""

from __future__ import annotations

import sqlite3

import pytest

from volery.base.errors import UsageError
from volery.explore.campaign_store import CampaignDiskError, CampaignStore
from volery.explore.points import CampaignRow, VariantPoint

POINTS = [
    VariantPoint({"a": "x", "b": 1}, 7),
    VariantPoint({"b": 1, "a": "x"}, 8),
    VariantPoint({"a": "y", "b": 2.5}, 7),
]


def row(run, **changed):
    return CampaignRow(
        run,
        POINTS[run],
        **{
            "verdicts": {"r": True, "q": None},
            "observables": {"e": 1.5 + run, f"only_{run}": 0.25},
            "sim_s": 2.0,
            "wall_s": 0.5,
            "cpu_s": 0.25,
            "host": "h",
            **changed,
        },
    )


@pytest.fixture
def store(tmp_path):
    made = CampaignStore(tmp_path / "c", write=True)
    yield made
    made.close()


def test_points_get_numbers_once(store):
    store.ask(POINTS[:2])
    store.ask([*POINTS, VariantPoint({"a": "x", "b": 1}, 7)])
    assert store.count() == (3, 0)
    assert [(run, point) for run, _, point in store.unfinished()] == list(enumerate(POINTS))


def test_rows_come_back_as_they_were_written_and_readers_see_them_at_once(store):
    store.ask(POINTS)
    reader = CampaignStore(store.folder)
    assert list(reader.rows()) == []
    rows = [row(2, status="failed", reason="why", verdicts={"new": False}), row(0)]
    store.record(rows, started=[1])
    assert list(reader.rows()) == sorted(rows, key=lambda one: one.run)
    assert reader.find(POINTS[2]) == rows[0]
    assert reader.find(POINTS[1]) is None
    assert reader.row(5) is None
    assert list(reader.unfinished()) == [(1, 1, POINTS[1])]
    assert reader.statuses() == {"failed": 1, "completed": 1}
    with pytest.raises(CampaignDiskError):
        reader.ask(POINTS)
    reader.close()


def test_columns_do_not_depend_on_the_order_in_which_rows_arrived(tmp_path):
    made = []
    for name, order in (("one", [0, 1, 2]), ("two", [2, 0, 1])):
        store = CampaignStore(tmp_path / name, write=True)
        store.ask(POINTS)
        for run in order:
            store.record([row(run)])
        columns = store.columns(store.kinds())
        made.append({key: list(map(str, column)) for key, column in columns.items()})
        assert [*columns][-5:] == ["sim_s", "wall_s", "cpu_s", "host", "attempt"]
        parts = [store.columns(store.kinds(), *part) for part in ((-1, 2), (1, 2))]
        assert [*parts[0]["e"], *parts[1]["e"]] == [1.5, 2.5, 3.5]
        store.close()
    assert list(made[0].items()) == list(made[1].items())
    assert made[0]["set.b"] == ["1", "1", "2.5"]
    assert made[0]["met.q"] == ["None"] * 3


def test_only_one_writes(store):
    with pytest.raises(UsageError, match="another process writes this campaign"):
        CampaignStore(store.folder, write=True)


def test_a_folder_without_a_campaign_is_refused(tmp_path):
    with pytest.raises(UsageError, match="holds no campaign"):
        CampaignStore(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="choose another folder"):
        CampaignStore(tmp_path / "file", write=True)


def test_a_full_disk_is_said_and_what_was_written_is_kept(store):
    store.ask(POINTS)
    store.record([row(0)])
    pages = store._rows.execute("PRAGMA page_count").fetchone()[0]
    store._rows.execute(f"PRAGMA max_page_count = {pages}")  # as if the disk ended here
    many = {f"observable_{k}": float(k) for k in range(2000)}
    with pytest.raises(CampaignDiskError, match=r"full.*resumes the campaign"):
        store.record([row(1, observables=many)])
    store._rows.execute("PRAGMA max_page_count = 1000000")
    assert list(store.rows()) == [row(0)]
    store.record([row(1, observables=many)])
    assert store.row(1).observables == many


def test_a_file_that_is_no_store_is_refused(tmp_path):
    (tmp_path / "rows.sqlite").write_bytes(b"no database" * 100)
    with pytest.raises((UsageError, CampaignDiskError), match="not a database"):
        CampaignStore(tmp_path, write=True)
    with pytest.raises(sqlite3.DatabaseError):
        sqlite3.connect(tmp_path / "rows.sqlite").execute("SELECT * FROM runs")
