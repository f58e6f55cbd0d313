"""`volery runs`: every run folder is listed with its outcome, and folders without a run are told apart."""

import json
import os

from typer.testing import CliRunner

from volery.cli.main import application
from volery.requirements.accounts import Accounts
from volery.requirements.record import write_record
from volery.trace.attachments import RunSetup


def runs(*arguments):
    return CliRunner().invoke(application(), ["runs", *map(str, arguments)])


def made(folder, at, allocation="fast", **outcome):
    folder.mkdir(parents=True)
    record = Accounts(RunSetup("patrol", "code", allocation)).record("completed", "")
    record = record.model_copy(update={"sim_s": 12.5, "outcome": record.outcome.model_copy(update=outcome)})
    os.utime(write_record(record, folder), (at, at))


def test_runs_are_listed_with_their_outcome_the_newest_last(tmp_path):
    made(tmp_path / "b-1", 1_000_000_000, allocation="slow", requirements_met=False)
    made(tmp_path / "demo" / "fast", 2_000_000_000, status="failed")
    cut = tmp_path / "cut"
    cut.mkdir()
    (cut / "trace.mcap").write_bytes(b"")
    os.utime(cut, (1_500_000_000, 1_500_000_000))
    (tmp_path / "nothing").mkdir()
    os.utime(tmp_path / "nothing", (1_600_000_000, 1_600_000_000))
    found = json.loads(runs(tmp_path, "--json").stdout)
    assert [one["folder"] for one in found] == ["b-1", "cut", "nothing", "demo/fast"]
    assert [one["met"] for one in found] == [False, None, None, None]
    assert [one["outcome"].split(";")[0] for one in found] == ["completed", "unfinished", "empty", "failed"]
    said = " ".join(runs(tmp_path).stdout.split())
    assert "not met" in said
    assert "12.5 s" in said


def test_a_record_of_something_else_is_unfinished(tmp_path):
    (tmp_path / "x").mkdir()
    for text in ("[]", '{"outcome": 3, "system": ""}', "[" * 20_000):
        (tmp_path / "x" / "run.json").write_text(text)
        assert json.loads(runs(tmp_path, "--json").stdout)[0]["outcome"].startswith("unfinished")


def test_no_folder_is_bad_input(tmp_path):
    result = runs(tmp_path / "runs")
    assert result.exit_code == 2
    assert "there is no folder" in " ".join(result.output.split())
