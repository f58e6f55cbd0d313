"""A simulated DJI served on a real roscore by ``volery vehicle serve``, flown from here over real topics."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import pytest

import volery
from volery import AboveHome, Position
from volery.ros.transports.ros1 import Roscore

pytestmark = pytest.mark.integration

COMMAND = (sys.executable, "-uc", "from volery.cli.main import main; main()")


def test_it_takes_off_goes_and_lands(
    roscore: Roscore, start: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The vehicle four times as fast as real time, and we in real time: it must do for set-points."""
    served = start(*COMMAND, "vehicle", "serve", "dji", "--graph", "ros1", "--speed", "4")
    said = served.stdout.readline()
    assert "serving dji on ros1" in said, said + served.stdout.read()
    monkeypatch.setenv("ROS_MASTER_URI", roscore.uri)
    with volery.connect("dji+ros1:///dji_sdk") as drone:
        drone.wait_ready()
        drone.takeoff(4.0)
        home = drone.home
        goal = Position(home.latitude + 0.00008, home.longitude, AboveHome(5.0))
        drone.goto(goal)
        assert drone.position.latitude == pytest.approx(goal.latitude, abs=8e-6)
        assert drone.altitude.metres == pytest.approx(5.0, abs=0.4)
        drone.land()
        assert not drone.armed
