"""What a run keeps: everything, its summary, or nothing, with the same figures."""

from __future__ import annotations

from pathlib import Path

import pytest

import volery
from volery.base.errors import UsageError
from volery.cli.run_display import recorded_folder
from volery.run.result import Options

STARTER = Path(__file__).parents[3] / "examples" / "starter"


def figures(run):
    return run.record.model_dump(exclude={"wall_s", "real_time_factor", "versions"})


def test_the_figures_are_the_same_whatever_is_kept(tmp_path):
    runs = {
        "full": Options(fidelity="code", out=tmp_path / "full"),
        "summary": Options(fidelity="code", out=tmp_path / "summary", record="summary"),
        "none": Options(fidelity="code"),
    }
    done = {name: volery.simulate(STARTER, options) for name, options in runs.items()}
    assert figures(done["full"]) == figures(done["summary"]) == figures(done["none"])
    assert {file.name for file in (tmp_path / "summary").iterdir()} == {"run.json"}
    assert {"run.json", "trace.mcap"} <= {file.name for file in (tmp_path / "full").iterdir()}
    assert done["none"].folder is None


def test_a_summary_removes_the_trace_of_an_earlier_run(tmp_path):
    (tmp_path / "trace.mcap").write_bytes(b"of another run")
    volery.simulate(STARTER, Options(out=tmp_path, record="summary"))
    assert not (tmp_path / "trace.mcap").exists()


def test_an_unknown_record_is_refused():
    with pytest.raises(UsageError, match=r"no record 'all'; there is full or summary"):
        Options(record="all")
    with (
        pytest.raises(UsageError, match=r"--record all: there is full, none or summary"),
        recorded_folder(None, "mission", "all"),
    ):
        pass


def test_no_folder_can_be_named_for_no_record(tmp_path):
    with pytest.raises(UsageError, match="leave out --out"), recorded_folder(tmp_path, "mission", "none"):
        pass
