"""Gains of a flight under a law as parameters of a node on real ROS 2, changed by plain rclpy in flight."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from volery.trace.events import ControlSample
from volery.trace.reader import read

from .conftest import HERE, python_of, surroundings

pytestmark = pytest.mark.integration

FLIGHT = "from volery.cli.main import main; raise SystemExit(main())"
LIMIT_S = 300


def test_a_gain_that_rclpy_sets_is_used_in_flight(tmp_path: Path) -> None:
    out = tmp_path / "run"
    python, environment = python_of("jazzy"), surroundings()
    arguments = ["control", "go", "rotation", "--graph", "ros2", "--angle", "0", "--angle", "30"]
    arguments += ["--hold", "20"]  # in which the gain is set
    arguments += ["--on", "sim:ardupilot?start=warm", "--speed", "3", "--out", str(out)]
    told = {"env": environment, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    tune = [python, str(HERE / "rclpy_parameters.py"), "/volery_go", "yaw.kp", "1.5"]
    tuner = subprocess.Popen(tune, **told)  # before the flight, for which it waits
    flight = subprocess.Popen([python, "-c", FLIGHT, *arguments], **told)
    try:
        said, why = tuner.communicate(timeout=LIMIT_S)
        assert tuner.returncode == 0, why[-2000:]
        assert float(said) == 2.2
        _, why = flight.communicate(timeout=LIMIT_S)
        assert flight.returncode == 0, why[-2000:]
    finally:
        for process in (tuner, flight):
            process.kill()
            process.communicate()
    events = list(read(out / "trace.mcap").events)
    turn = [
        one for one in events if isinstance(one, ControlSample) and one.loop == "yaw" and one.goal == 30.0
    ]
    assert any(one.error and one.proportional == pytest.approx(1.5 * one.error, rel=1e-6) for one in turn)
