"""Where ROS is not installed, an error says which package brings it."""

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from volery.base.errors import UsageError
from volery.calibration.ros import probe_environment
from volery.calibration.ros.probe_environment import check_client, roscpp_flags
from volery.cli.main import application


@pytest.fixture
def nothing_installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(probe_environment, "available", lambda: False)


def test_an_unknown_library() -> None:
    with pytest.raises(UsageError, match="no client library 'rosjava'; there is rclpy, roscpp or rospy"):
        check_client("rosjava")


def test_no_roscore(nothing_installed: None) -> None:
    with pytest.raises(UsageError, match=r"no roscore.*python3-roslaunch and rosout"):
        check_client("roscpp")


def test_no_rospy(nothing_installed: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda program: f"/usr/bin/{program}")
    with pytest.raises(UsageError, match=r"python3-rospy and python3-std-msgs.*scripts/ros1-modules"):
        check_client("rospy")


def test_no_roscpp(nothing_installed: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match="pkg-config, which is not there"):
        roscpp_flags()
    finds_nothing = tmp_path / "pkg-config"
    finds_nothing.write_text("#!/bin/sh\necho 'Package roscpp was not found' >&2\nexit 1\n")
    finds_nothing.chmod(0o755)
    with pytest.raises(UsageError, match=r"libroscpp-dev, libstd-msgs-dev.*Package roscpp was not found"):
        roscpp_flags()


def test_no_rclpy_in_that_python(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"nowhere/python: No such file"):
        check_client("rclpy", "/nowhere/python")
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho 'ModuleNotFoundError: no rclpy' >&2\nexit 1\n")
    python.chmod(0o755)
    with pytest.raises(UsageError, match=r"does not see rclpy \(ModuleNotFoundError: no rclpy\).*--python"):
        check_client("rclpy", str(python))


def test_the_command_ends_with_status_2_and_no_traceback(nothing_installed: None, tmp_path: Path) -> None:
    out = tmp_path / "catalogue.yaml"
    done = CliRunner().invoke(
        application(), ["cost", "calibrate", "ros", "--client", "roscpp", "--out", str(out)]
    )
    assert done.exit_code == 2
    assert "no roscore on this machine" in done.stderr
    assert not list(tmp_path.iterdir())


def test_measuring_a_model_without_nodes(tmp_path: Path) -> None:
    done = CliRunner().invoke(application(), ["cost", "validate", str(tmp_path / "nowhere.yaml")])
    assert done.exit_code == 2
    done = CliRunner().invoke(application(), ["cost", "validate", str(tmp_path), "--runs", "0"])
    assert "--runs 0: give at least 1" in done.stderr
