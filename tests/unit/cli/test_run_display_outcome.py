"""Run folders: one that stays empty is not left behind, one with a file is."""

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
