"""The table as Parquet: the types of its columns, what is missing in them, and what it needs."""

from __future__ import annotations

import subprocess
import sys

from pyarrow import bool_, float64, int64, string
from pyarrow.parquet import read_table

from volery.explore import parquet_table
from volery.explore.campaign_store import CampaignStore
from volery.explore.parquet_table import write_parquet
from volery.explore.points import CampaignRow, VariantPoint

POINTS = [
    VariantPoint({"name": "é, two", "whole": 3, "mixed": 1, "flag": True}, 7),
    VariantPoint({"whole": 4, "mixed": 2.5, "flag": False}, 8),
    VariantPoint({"name": ""}, 9),
]
ROWS = [
    CampaignRow(0, POINTS[0], "completed", "", {"late": None, "landing": True}, {"energy": 1.5}, host="one"),
    CampaignRow(1, POINTS[1], "failed", "why", {"landing": False}, {}, host="two"),
    CampaignRow(2, POINTS[2], "completed", "", {"late": True}, {"energy": 2.0}, host="one"),
]


def filled(folder):
    store = CampaignStore(folder, write=True)
    store.ask(POINTS)
    store.record(ROWS)
    return store


def test_columns_have_their_types_and_nothing_where_nothing_was(tmp_path, monkeypatch):
    monkeypatch.setattr(parquet_table, "PART", 2)
    store = filled(tmp_path)
    write_parquet(store, tmp_path / "rows.parquet")
    store.close()
    table = read_table(tmp_path / "rows.parquet")
    assert {one.name: one.type for one in table.schema if one.name.startswith(("set.", "met."))} == {
        "set.name": string(),
        "set.whole": int64(),
        "set.mixed": float64(),
        "set.flag": bool_(),
        "met.late": bool_(),
        "met.landing": bool_(),
    }
    found = table.to_pydict()
    assert found["set.name"] == ["é, two", None, ""]
    assert found["set.whole"] == [3, 4, None]
    assert found["set.mixed"] == [1.0, 2.5, None]
    assert found["set.flag"] == [True, False, None]
    assert found["met.late"] == [None, None, True]
    assert found["met.landing"] == [True, False, None]
    assert found["energy"][::2] == [1.5, 2.0]
    assert found["energy"][1] != found["energy"][1]
    assert (found["run"], found["seed"]) == ([0, 1, 2], [7, 8, 9])
    assert (found["reason"], found["host"]) == (["", "why", ""], ["one", "two", "one"])
    assert not list(tmp_path.glob(".*.part"))


def test_a_table_is_written_without_pandas(tmp_path):
    filled(tmp_path).close()
    code = (
        "import sys; from pathlib import Path; from volery.explore.campaign_store import CampaignStore\n"
        "from volery.explore.parquet_table import write_parquet; folder = Path(sys.argv[1])\n"
        "write_parquet(CampaignStore(folder), folder / 'rows.parquet'); print('pandas' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code, tmp_path], check=True, capture_output=True, text=True)
    assert done.stdout == "False\n"
