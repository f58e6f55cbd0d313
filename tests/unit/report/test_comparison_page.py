"""The page of a comparison: what it takes, pairs and draws."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from rigs.flown_records import Shape, write_dataflash, write_run, write_tlog
from volery.base.errors import UsageError
from volery.report.comparison_page import Comparison, read_side
from volery.trace.attachments import RunSetup
from volery.trace.mcap_writer import McapWriter


def drawn(compared: Comparison) -> dict:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', compared.html(), re.DOTALL)
    assert found is not None
    return json.loads(found[1])


def test_curves_and_their_differences_count_from_arming(tmp_path: Path) -> None:
    sides = [read_side(write_run(tmp_path / "run")), read_side(write_tlog(tmp_path / "1.tlog", Shape(1.0)))]
    data = drawn(Comparison(sides))
    assert [one["name"] for one in data["vehicles"]] == ["run", "1.tlog"]
    assert data["end"] == pytest.approx(45.0, abs=0.11)
    height, other = (one["height"] for one in data["vehicles"])
    assert np.interp(5.0, height["t"], height["v"]) == pytest.approx(4.0, abs=0.05)
    assert np.interp(5.0, other["t"], other["v"]) == pytest.approx(2.0, abs=0.15)
    (difference,) = data["differences"]
    assert np.interp(8.0, difference["height"]["t"], difference["height"]["v"]) == pytest.approx(
        -5.0, abs=0.15
    )
    assert np.interp(8.0, difference["distance"]["t"], difference["distance"]["v"]) == pytest.approx(
        5.0, abs=0.15
    )


def test_the_page_shows_verdict_phases_and_texts(tmp_path: Path) -> None:
    sides = [
        read_side(write_run(tmp_path / "run")),
        read_side(write_dataflash(tmp_path / "1.bin", Shape(also_said="<b>EKF failsafe</b>"))),
    ]
    compared = Comparison(sides)
    page = compared.write(tmp_path).read_text()
    (verdict,) = (one.verdict for one in compared.all_flights)
    assert verdict in page
    assert "mode GUIDED" in page
    assert "&lt;b&gt;EKF failsafe&lt;/b&gt;" in page, "what an autopilot says is no markup"


def test_each_further_side_is_compared_with_the_first(tmp_path: Path) -> None:
    names = ("a", "b", "c")
    shapes = (Shape(), Shape(1.0), Shape(4.0))
    sides = [read_side(write_run(tmp_path / name, shape)) for name, shape in zip(names, shapes, strict=True)]
    compared = Comparison(sides)
    assert [one.labels for one in compared.all_flights] == [("a", "b"), ("a", "c")]
    assert "comparison" not in compared.plain()[0]
    assert [len(one["comparison"]) for one in compared.plain()[1:]] == [1, 1]
    assert json.dumps(compared.plain())


def test_sides_of_the_same_name_go_by_their_paths(tmp_path: Path) -> None:
    for name in ("before", "after"):
        (tmp_path / name).mkdir()
    sides = [read_side(write_run(tmp_path / name / "run")) for name in ("before", "after")]
    assert Comparison(sides).labels == [str(tmp_path / "before" / "run"), str(tmp_path / "after" / "run")]


def test_a_run_without_a_vehicle_is_not_compared_with_a_log(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    writer = McapWriter(tmp_path / "run" / "trace.mcap", RunSetup("computing", "code"))
    writer.outcome("completed", "")
    writer.close()
    sides = [read_side(tmp_path / "run"), read_side(write_tlog(tmp_path / "1.tlog"))]
    with pytest.raises(UsageError, match="run has no vehicle"):
        Comparison(sides)
    assert "<script" not in Comparison([sides[0], sides[0]]).html(), "there is nothing to draw"


def test_a_page_that_cannot_be_written(tmp_path: Path) -> None:
    sides = [read_side(write_run(tmp_path / name)) for name in ("a", "b")]
    with pytest.raises(UsageError, match=r"cannot write .*comparison\.html"):
        Comparison(sides).write(tmp_path / "nowhere")
