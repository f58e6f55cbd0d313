"""Files written for rclpy say the same on the embedded graph, in virtual time, and on real ROS 2."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from .conftest import HERE, python_of, surroundings
from .files_on_ros import Case, compare, embedded, observed, running

pytestmark = pytest.mark.integration

FILES = HERE / "ros_files" / "ros2"
STRING = "std_msgs/msg/String"
GAINS = {"gains.p": 2.0, "gains.i": 0.1, "gains.d": 0.07}  # those that the thesis flew with
CASES = {
    "topics": Case(
        {"listener": {"listeners": 0}, "talker": {"listeners": 1}},
        {"/topic": (STRING, 25), "/repeated": (STRING, 25), "/last": (STRING, 1)},
    ),
    "services": Case({"switch": {}, "asker": {"listeners": 0}}, {"/told": (STRING, 11)}),
    "parameters": Case({"parameters": {"my_parameter": "earth", "listeners": 0}}, {"/told": (STRING, 10)}),
    "lifecycle": Case({"managed": {}, "station": {"listeners": 0}}, {"/told": (STRING, 20)}),
    "controller": Case(
        {"controller": {**GAINS, "listeners": 0}, "plant": {"steps": 250, "listeners": 1}},
        {
            "/pose": ("geometry_msgs/msg/PoseStamped", 250),
            "/cmd_vel": ("geometry_msgs/msg/Twist", 250),
            "/reached": ("std_msgs/msg/Int32", 4),
        },
    ),
}


def arguments(given: Mapping[str, Any]) -> list[str]:
    """As ``ros2 run`` takes them."""
    return ["--ros-args", *(word for key, value in given.items() for word in ("-p", f"{key}:={value}"))]


@pytest.mark.parametrize("name", CASES)
def test_the_same_messages(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    python = python_of("jazzy")
    around = surroundings()
    programs = [
        [python, str(FILES / f"{one}.py"), *(arguments(given) if given else ())]
        for one, given in case.observed_files()
    ]
    with observed(python, "ros2", case, FILES, around) as said, running(programs, around):
        real = said()
    compare(case, embedded(case, "rclpy", FILES, tmp_path / "embedded"), real)
