"""`volery runs report` and `compare` on run folders, whole and cut short, and on flight logs."""

import io
import json

import pytest
from rich.console import Console
from typer.testing import CliRunner

from rigs.flown_records import Shape, write_run, write_tlog, write_ulog
from volery.cli.main import application
from volery.report.html_report import recover
from volery.report.terminal import comparison_table


def report(*arguments):
    return CliRunner().invoke(application(), ["runs", "report", *map(str, arguments)])


def compare(*arguments):
    return CliRunner().invoke(application(), ["runs", "compare", *map(str, arguments)])


@pytest.fixture
def folder(make_run, tmp_path):
    return make_run(tmp_path / "fast")


def test_it_writes_the_document_and_shows_the_tables(folder):
    result = report(folder)
    assert result.exit_code == 0, result.output
    assert (folder / "report.html").exists()
    assert "hospital-delivery" in result.stdout
    assert "report.html" in result.stderr


def test_several_are_compared(folder, tmp_path, make_run):
    slow = make_run(tmp_path / "slow", 600.0)
    result = compare(folder, slow)
    assert result.exit_code == 0, result.output
    assert "fast" in result.stdout
    assert "slow" in result.stdout


def test_the_comparison_is_written_as_a_page(folder, tmp_path, monkeypatch, make_run):
    monkeypatch.chdir(tmp_path)
    make_run(tmp_path / "slow", 600.0)
    result = compare("fast", "slow")
    assert "side by side: comparison.html" in result.stderr
    page = (tmp_path / "comparison.html").read_text()
    assert "fast/report.html" in page


def test_one_run_is_not_compared(folder):
    result = compare(folder)
    assert result.exit_code == 2
    assert "give a second run" in result.output


def test_one_report_writes_no_comparison(folder, tmp_path):
    assert report(folder).exit_code == 0
    assert not (tmp_path / "comparison.html").exists()


def test_the_comparison_fits_80_columns_with_whole_words(folder, tmp_path, make_run):
    records = [recover(one).record for one in (folder, make_run(tmp_path / "slow", 600.0))]
    console = Console(file=io.StringIO(), width=80)
    console.print(comparison_table(records, ["fast", "slow"]))
    said = console.file.getvalue()
    assert max(len(line) for line in said.splitlines()) <= 80
    for word in ("utilisation", "frequency", "rpi4-cortex-a72", "rover_north", "planned", "energy"):
        assert word in said


def test_json_is_the_record_and_nothing_else(folder, tmp_path, make_run):
    assert json.loads(report(folder, "--json").stdout)["system"] == "hospital-delivery"
    slow = make_run(tmp_path / "slow", 600.0)
    both = json.loads(compare(folder, slow, "--json").stdout)
    assert [one["allocation"] for one in both] == ["fast", "slow"]


def test_a_run_and_a_log_are_compared_phase_by_phase(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_run(tmp_path / "run")
    write_tlog(tmp_path / "slow.tlog", Shape(climb_m_s=1.0))
    result = compare("run", "slow.tlog")
    assert result.exit_code == 0, result.output
    assert "slow.tlog against run: 4 of 5 phases alike; most different is take-off" in " ".join(
        result.stdout.split()
    )
    assert (tmp_path / "comparison.html").exists()
    first, second = json.loads(compare("run", "slow.tlog", "--json").stdout)
    assert first["system"] == "flight"
    assert second["log"] == "slow.tlog"
    (found,) = second["comparison"]
    assert {one["phase"]: one["alike"] for one in found["phases"]} == {
        **dict.fromkeys(("armed", "mode GUIDED", "mode LAND", "landing"), True),
        "take-off": False,
    }


def test_the_page_of_logs_is_written_here_and_not_beside_them(tmp_path, monkeypatch):
    (tmp_path / "logs").mkdir()
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    logs = [write_tlog(tmp_path / "logs" / "1.tlog"), write_ulog(tmp_path / "logs" / "1.ulg")]
    result = compare("--between", *logs)
    assert result.exit_code == 0, result.output
    assert [path.name for path in (tmp_path / "here").iterdir()] == ["comparison.html"]
    assert sorted(path.name for path in (tmp_path / "logs").iterdir()) == ["1.tlog", "1.ulg"]


def test_within_states_how_far_ways_may_be_apart(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, shape in (("straight", Shape()), ("east", Shape(east_m=5.0))):
        write_run(tmp_path / name, shape)
    legs = [
        json.loads(compare("straight", "east", "--json", *more).stdout)[1]["comparison"][0]["phases"][0]
        for more in ((), ("--within", "6"))
    ]
    assert [one["path_m"] for one in legs] == [5.0, 5.0]
    assert [one["alike"] for one in legs] == [False, True]
    assert compare("straight", "east", "--within", "0").exit_code == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "give two run folders or flight logs"),
        (["1.tlog"], "give a second run or log to compare 1.tlog with"),
        (["1.tlog", "nothing"], "there is no 'nothing'"),
        (["1.tlog", "notes.txt"], "no flight log"),
        (["1.tlog", "empty"], "has no trace.mcap"),
        (["1.tlog", "sim:px4"], "--between sim:px4"),
        (["mission.py", "1.tlog"], "mission.py is to be flown"),
        (["--between", "1.tlog", "sim:px4"], "give the mission to fly on it"),
        (["--between", "1.tlog", "sim:"], "give the mission to fly on it"),
        (["mission.py", "--between", "1.tlog", "sim:"], "does not say which autopilot"),
        (["mission.py", "--between", "1.tlog", "sim:px5"], "px5"),
        (["mission.py", "--between", "1.tlog", "1.tlog"], "would not be flown"),
        (["mission.py", "1.tlog", "--between", "sim:px4", "1.tlog"], "1.tlog is too much"),
        (["nowhere.py", "--between", "1.tlog", "sim:px4"], "there is no file 'nowhere.py'"),
        (["mission.py", "--between", "notes.txt", "sim:px4"], "no flight log"),
    ],
)
def test_what_cannot_be_compared_is_named(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    write_tlog(tmp_path / "1.tlog")
    (tmp_path / "notes.txt").write_text("no log at all, only words of which there are some")
    (tmp_path / "mission.py").write_text("def mission(drone):\n    drone.takeoff(5)\n    drone.land()\n")
    (tmp_path / "empty").mkdir()
    kept = sorted(path.name for path in tmp_path.iterdir())
    result = compare(*arguments)
    assert result.exit_code == 2, result.output
    assert message in " ".join(result.output.split())
    assert sorted(path.name for path in tmp_path.iterdir()) == kept, "nothing is written"


def test_a_run_that_was_killed_is_recovered(folder):
    (folder / "run.json").unlink()
    trace = folder / "trace.mcap"
    trace.write_bytes(trace.read_bytes()[:-4000])
    result = report(folder, "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["outcome"]["status"] == "unfinished"
    assert (folder / "report.html").exists()


def test_something_else_is_refused(tmp_path):
    (tmp_path / "trace.mcap").write_bytes(b"no trace at all")
    result = report(tmp_path)
    assert result.exit_code == 2
    assert result.output.startswith("volery: ")
