"""PX4's sequences over its own ROS 2 topics, in front of the simulated PX4."""

from __future__ import annotations

from typing import Any

import pytest

from rigs.missions import carried_out
from rigs.own_topics import flown_over_own_topics
from volery.base.errors import CapabilityError, LinkError
from volery.base.position import AMSL, Position
from volery.base.time import MS
from volery.kernel.virtual import VirtualKernel
from volery.ros.graph import EmbeddedGraph
from volery.vehicles import Drone
from volery.vehicles.driver import Land
from volery.vehicles.drivers.px4 import open_topics

WARM = "sim:px4?start=warm"


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

    miss, up, armed = flown_over_own_topics(WARM, "px4", open_topics, mission)
    assert miss < 2.0
    assert up == pytest.approx(15.0, abs=1.5)
    assert not armed


def test_a_velocity_is_repeated_by_the_caller_and_a_turn_is_held() -> None:
    def mission(drone: Any, pause: Any) -> tuple[str, float, float]:
        drone.takeoff(10)
        start = drone.position
        for _ in range(40):
            drone.set_velocity(north=2.0)
            pause(100 * MS)
        mode = drone.telemetry.mode
        drone.set_heading(90)
        return mode, drone.telemetry.distance(start, drone.position), drone.telemetry.attitude.heading

    mode, gone, heading = flown_over_own_topics(WARM, "px4", open_topics, mission)
    assert mode == "OFFBOARD"
    assert 5.0 < gone < 16.0
    assert heading == pytest.approx(90.0, abs=5.0)


def test_what_the_topics_do_not_carry_is_refused() -> None:
    kernel = VirtualKernel()
    graph = EmbeddedGraph(kernel)
    with pytest.raises(CapabilityError, match=r"1\.14 does not acknowledge"):
        open_topics(kernel, graph.node("control"), "craft_1", {"version": "1.14"})

    def mission(drone: Any, pause: Any) -> None:
        drone.wait_ready()
        with pytest.raises(CapabilityError, match="missions do not pass"):
            drone.upload_mission([Land()])

    flown_over_own_topics(WARM, "px4", open_topics, mission)


def test_without_an_agent_the_topic_is_named() -> None:
    kernel = VirtualKernel()
    driver = open_topics(kernel, EmbeddedGraph(kernel).node("control"), "craft_1", {})

    def body() -> None:
        with pytest.raises(LinkError, match="nothing publishes /fmu/out/vehicle_status_v1"):
            Drone(kernel, "craft_1", driver).takeoff(10)

    carried_out(kernel, body)
