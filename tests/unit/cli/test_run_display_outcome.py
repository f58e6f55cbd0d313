"""Run folders: one that stays empty is not left behind; others are listed, reported and removed."""

import json

import pytest
from typer.testing import CliRunner

from volery.cli.main import application
from volery.cli.run_display import run_folder


def test_an_empty_folder_is_removed_with_the_folders_made_for_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with run_folder(None, "mission") as folder:
        assert folder.is_dir()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_a_file_stays(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with run_folder(None, "mission") as folder:
        (folder / "run.json").write_text("{}")
    with run_folder(None, "mission"):
        pass
    assert [str(one.relative_to(tmp_path)) for one in (tmp_path / "runs").iterdir()] == ["runs/mission-1"]


def test_a_folder_that_was_there_stays_though_it_is_empty(tmp_path):
    (tmp_path / "mine").mkdir()
    with run_folder(tmp_path / "mine", "mission"):
        pass
    assert (tmp_path / "mine").is_dir()


@pytest.mark.parametrize("text", ["def mission(drone)\n    pass\n", "def misson(drone):\n    pass\n"])
def test_a_mission_that_cannot_be_loaded_leaves_no_folder(tmp_path, monkeypatch, text):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wrong.py").write_text(text)
    result = CliRunner().invoke(application(), ["fly", "wrong.py", "--on", "sim:ardupilot"])
    assert result.exit_code == 2, result.output
    assert not (tmp_path / "runs").exists()


def test_runs_are_listed_with_vehicles_and_size_reported_and_removed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "up.py").write_text("def mission(drone):\n    drone.takeoff(3)\n")
    volery = CliRunner(env={"COLUMNS": "80"})
    for autopilot in ("px4", "ardupilot"):
        flown = volery.invoke(application(), ["fly", "up.py", "--on", f"sim:{autopilot}?start=warm"])
        assert flown.exit_code == 0, flown.output
    assert "not counted" not in flown.output
    listed = json.loads(volery.invoke(application(), ["runs", "--json"]).stdout)
    assert [(one["folder"], one["vehicles"]) for one in listed] == [("up-1", "px4"), ("up-2", "ardupilot")]
    assert all(one["bytes"] > 10_000 for one in listed)
    shown = volery.invoke(application(), ["runs"]).stdout
    assert "ardupilot" in shown
    assert "completed" in shown
    refused = volery.invoke(application(), ["runs", "remove", "up-3", "up-1"])
    assert refused.exit_code == 2
    assert (tmp_path / "runs" / "up-1").is_dir()
    assert volery.invoke(application(), ["runs", "remove", "runs/up-1/"]).exit_code == 0
    assert [one.name for one in (tmp_path / "runs").iterdir()] == ["up-2"]
