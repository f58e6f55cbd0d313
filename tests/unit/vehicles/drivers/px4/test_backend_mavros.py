"""PX4's sequences over a vehicle node with MAVROS's names, in front of the scripted PX4."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rigs.missions import carried_out
from volery.base.errors import Overridden, UsageError
from volery.base.position import AboveHome, Position
from volery.base.time import MS
from volery.bridge import serve_vehicle
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import sleep
from volery.links.in_process_link import in_process_pair
from volery.ros.graph import EmbeddedGraph
from volery.vehicles import Drone
from volery.vehicles.drivers.mavros import MAVROS
from volery.vehicles.drivers.px4.modes import HOLD

Make = Callable[..., Any]
NEAR = Position(45.4675168, -73.7578362, AboveHome(12.0))
SETPOINT, STICKS = "SET_POSITION_TARGET_LOCAL_NED", "MANUAL_CONTROL"


def flown(at: Any, mission: Callable[[Any], Any]) -> Any:
    """What *mission* returns, flown over the graph."""
    kernel = at.kernel = VirtualKernel()
    link, theirs = in_process_pair(kernel, name="radio")
    at.autopilot = type(at.autopilot)(kernel, theirs)
    at.craft = at.autopilot.craft
    graph = EmbeddedGraph(kernel)
    serve_vehicle(graph, link, "craft_1", ExecutionContext("vehicle node"))

    def body() -> Any:
        open_driver = MAVROS.on_graph
        assert open_driver is not None
        driver = open_driver(kernel, graph.node("control"), "craft_1", {"autopilot": "px4"})
        return mission(Drone(kernel, "craft_1", driver))

    return carried_out(kernel, body)


def test_a_flight(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(NEAR)
        assert at.craft.up == pytest.approx(12.0, abs=0.01)
        drone.goto(Position(45.4675168, -73.7575, AboveHome(15.0)), speed=4.0)
        drone.hold()
        drone.return_home()

    flown(at, mission)
    assert not at.craft.armed
    climb = next(f for f in at.autopilot.sent("COMMAND_LONG") if f["command"] == 22)
    assert climb["param7"] == pytest.approx(42.575, abs=1e-3)


def test_a_velocity_is_repeated_by_the_loop_and_the_caller(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> float:
        drone.takeoff(10)
        for _ in range(40):
            drone.set_velocity(north=2.0)
            sleep(at.kernel, 100 * MS)
        north = at.craft.north
        drone.set_heading(90)
        drone.land()
        return float(north)

    assert flown(at, mission) > 6.0
    assert at.craft.heading == pytest.approx(90, abs=1)


def test_a_pilot_takes_over(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        for turn in range(60):
            if turn == 30:
                at.autopilot.enter(HOLD)
            drone.set_velocity(north=2.0)
            sleep(at.kernel, 100 * MS)

    with pytest.raises(Overridden, match=r"is in AUTO\.LOITER.*another mode"):
        flown(at, mission)
    assert at.craft.mode == HOLD


def test_sticks_are_repeated_by_the_caller(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(0.0, 0.0, 0.5, 0.0)
        drone.altitude_hold()
        for _ in range(20):
            drone.manual_control(0.3, 0.0, 0.5, 0.0)
            sleep(at.kernel, 100 * MS)
        drone.land()

    flown(at, mission)
    assert {"x": 300, "z": 500} in [{"x": f["x"], "z": f["z"]} for f in at.autopilot.sent(STICKS)]
    assert not at.craft.armed


def test_an_unknown_autopilot_behind_mavros(bench: Make) -> None:
    at = bench()
    assert MAVROS.on_graph is not None
    with pytest.raises(UsageError, match=r"autopilot='px5' over MAVROS.*px4"):
        MAVROS.on_graph(at.kernel, None, "craft_1", {"autopilot": "px5"})
