"""ArduPilot's sequences over its own ROS 2 topics, in front of the simulated ArduPilot."""

from __future__ import annotations

from typing import Any

import pytest

from rigs.own_topics import flown_over_own_topics
from volery.base.errors import CapabilityError
from volery.base.position import AMSL, Position
from volery.base.time import MS
from volery.vehicles.drivers.ardupilot import open_topics

WARM = "sim:ardupilot?start=warm"


def test_the_five_lines_of_the_readme() -> None:
    def mission(drone: Any, pause: Any) -> tuple[float, float, bool]:
        drone.takeoff(10)
        home = drone.home
        goal = Position(home.latitude + 0.0002, home.longitude + 0.0002, AMSL(home.altitude.metres + 15.0))
        drone.goto(goal)
        miss = drone.telemetry.distance(drone.position, goal)
        up = drone.position.altitude.metres - home.altitude.metres
        drone.land()
        return miss, up, drone.armed

    miss, up, armed = flown_over_own_topics(WARM, "ardupilot", open_topics, mission)
    assert miss < 3.0
    assert up == pytest.approx(15.0, abs=1.5)
    assert not armed


def test_a_velocity_is_flown_and_a_speed_or_a_turn_is_refused_by_name() -> None:
    def mission(drone: Any, pause: Any) -> float:
        drone.takeoff(10)
        start = drone.position
        for _ in range(40):
            drone.set_velocity(east=2.0)
            pause(100 * MS)
        gone = drone.telemetry.distance(start, drone.position)
        for refused in (lambda: drone.set_heading(90), lambda: drone.goto(start, speed=3.0)):
            with pytest.raises(CapabilityError, match="does not pass ArduPilot's topics"):
                refused()
        return gone

    gone = flown_over_own_topics(WARM, "ardupilot", open_topics, mission)
    assert 5.0 < gone < 16.0
