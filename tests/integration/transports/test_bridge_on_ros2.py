"""``volery ros bridge`` on real ROS 2: plain rclpy hears the vehicle and arms it, and we fly one behind
MAVROS's names.
"""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from .conftest import HERE, LIMIT_S, python_of, surroundings
from .test_dji_on_ros1 import COMMAND

pytestmark = pytest.mark.integration

Beside = Callable[..., dict[str, Any]]


@pytest.fixture
def beside() -> Iterator[Beside]:
    """Starts a bridge with these options; runs a script beside it and gives what it printed."""
    python, around = python_of("jazzy"), surroundings()
    started: list[subprocess.Popen[str]] = []

    def run(
        script: str, argument: str, *options: str, url: str = "sim:ardupilot?start=warm"
    ) -> dict[str, Any]:
        bridge = (
            python,
            *COMMAND[1:],
            "ros",
            "bridge",
            url,
            "--graph",
            "ros2",
            "--speed",
            "4",
        )
        started.append(subprocess.Popen([*bridge, *options, "--quiet"], env=around))
        command = [python, str(HERE / script), argument]
        done = subprocess.run(
            command, env=around, capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
        assert done.returncode == 0, done.stderr[-3000:]
        found: dict[str, Any] = json.loads(done.stdout)
        return found

    yield run
    for bridge in started:
        bridge.send_signal(signal.SIGINT)
        assert bridge.wait(LIMIT_S) == 0


def test_plain_rclpy_hears_a_vehicle_and_arms_it(beside: Beside) -> None:
    found = beside("rclpy_ground.py", "/craft", "--names", "roscopter", "--namespace", "/craft")
    assert found["place"] == pytest.approx([46.0825, -103.8995, 900.0], abs=10.0)
    assert found["place"][0] == pytest.approx(46.0825, abs=0.001)
    assert found["armed"]
    assert "roscopter" in found["nodes"]


def test_a_vehicle_behind_mavros(beside: Beside) -> None:
    found = beside("ros2_flight.py", "mavros+ros2:///mavros")
    assert found["home"] == pytest.approx(900.0, abs=2.0)
    assert found["went"] == pytest.approx(0.00008, abs=1e-5)
    assert not found["armed"]
    assert found["changed"] == 0.5
    assert found["parameters"] > 800
    assert found["rally"] == 1
    assert abs(found["roll"]) < 10.0


@pytest.mark.parametrize(("autopilot", "mode"), [("px4", "AUTO.LOITER"), ("ardupilot", "GUIDED")])
def test_a_vehicle_behind_its_own_names(beside: Beside, autopilot: str, mode: str) -> None:
    url = f"sim:{autopilot}?start=warm"
    found = beside("ros2_own_topics.py", f"{autopilot}+ros2:///", "--names", autopilot, url=url)
    assert found["home"] == pytest.approx(900.0, abs=2.0)
    assert found["went"] == pytest.approx(0.00008, abs=1e-5)
    assert found["mode"] == mode
    assert not found["armed"]


def test_the_graph_is_shown_to_whoever_has_just_come(beside: Beside) -> None:
    """All of it: who joins knows nobody at first."""
    found = beside("ros2_shown.py", "/mavros/state,/mavros/mavros,/mavros/cmd/arming")
    assert found["nodes"] == ["/mavros/mavros"]
    topics = {topic["name"]: topic for topic in found["topics"]}
    assert topics["/mavros/state"]["publishers"] == ["/mavros/mavros"]
    assert len(topics) > 40
    assert "/mavros/cmd/arming" in {service["name"] for service in found["services"]}
    assert {service["server"] for service in found["services"]} == {"/mavros/mavros"}
