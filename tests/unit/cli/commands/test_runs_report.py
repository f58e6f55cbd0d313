"""`volery runs report` and `compare` on run folders, whole and cut short."""

import io
import json

import pytest
from rich.console import Console
from typer.testing import CliRunner

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
