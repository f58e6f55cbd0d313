"""The velocity-level vehicle on a real roscore, observed, retuned and flown with Debian's own tools."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import Any

import pytest

from .conftest import LIMIT_S, Run
from .test_bridge_on_ros1 import until
from .test_dji_on_ros1 import COMMAND

pytestmark = pytest.mark.integration


def test_debian_tools_observe_it_change_its_gains_and_fly_it(start: Callable[..., Any], ros: Run) -> None:
    cube = start(*COMMAND, "control", "go", "cube", "--graph", "ros1", "--rounds", "0")
    wanted = {"/cmd_vel", "/poseupdate", "/odom"}
    until(lambda: wanted <= set(ros("rostopic", "list").split()), "its topics")
    ros("rosparam", "set", "/test_via_point/kp", "0.9")
    assert float(ros("rosparam", "get", "/test_via_point/kp")) == 0.9
    assert "position" in ros("rostopic", "echo", "-n1", "/poseupdate")
    cube.send_signal(signal.SIGINT)
    assert cube.wait(LIMIT_S) == 1


def test_any_node_can_fly_it(start: Callable[..., Any], ros: Run) -> None:
    vehicle = start(*COMMAND, "control", "go", "cube", "--graph", "ros1", "--no-controller")
    until(lambda: "/odom" in ros("rostopic", "list"), "its topics")
    start("rostopic", "pub", "-r", "10", "/cmd_vel", "geometry_msgs/Twist", "[1.0, 0, 0]", "[0, 0, 0]")

    def ahead() -> bool:
        return float(ros("rostopic", "echo", "-n1", "/poseupdate/pose/pose/position/x").split()[0]) > 1.0

    until(ahead, "a metre ahead")
    vehicle.send_signal(signal.SIGINT)
    assert vehicle.wait(LIMIT_S) == 1
