"""The clearance from what range sensors measure: what ends an operation, and what does not."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Any

import pytest

from volery.base.errors import CapabilityError, ObstacleNear, UsageError
from volery.base.frames import Vector
from volery.base.position import AboveHome, Position
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import sleep
from volery.trace.events import Operation
from volery.vehicles import Limits
from volery.vehicles.drivers.mavlink.obstacle_decoder import ObstacleDecoder
from volery.vehicles.monitors import ObstacleMonitor
from volery.vehicles.telemetry import Attitude, Telemetry, Velocity

Make = Callable[..., Any]
EAST, NORTH, UP = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
LATITUDE, LONGITUDE = -35.3632610, 149.1652300
PER_M = 1.0 / 111_000.0


def advanced(kernel: VirtualKernel, until: int) -> VirtualKernel:
    kernel.call_at(until, lambda: None)
    kernel.run(until)
    return kernel


def seen_by(
    direction: Vector, metres: float, velocity: Velocity, kernel: VirtualKernel | None = None
) -> Telemetry:
    kernel = advanced(kernel or VirtualKernel(), 10 * S)
    seen = Telemetry(kernel, "craft")
    seen.flying, seen.velocity = True, velocity
    seen.note_message(kernel.now())
    seen.note_obstacle(("DISTANCE_SENSOR", 0), direction, metres)
    return seen


@pytest.mark.parametrize(
    ("direction", "metres", "velocity", "said"),
    [
        (EAST, 10.5, Velocity(0.0, 4.0, 0.0), "an obstacle is 10.5 m to the east, approached at 4.0 m/s"),
        (EAST, 10.7, Velocity(0.0, 4.0, 0.0), ""),  # it stands 5.1 m before it
        (EAST, 2.0, Velocity(0.0, -4.0, 0.0), ""),  # away from it
        (EAST, 2.0, Velocity(4.0, 0.0, 0.0), ""),  # along it
        (EAST, 2.0, Velocity(0.0, 0.1, 0.0), ""),  # it stands
        (NORTH, 4.0, Velocity(1.0, 0.0, 0.0), "4.0 m to the north"),
        (UP, 4.0, Velocity(0.0, 0.0, 1.0), "4.0 m above"),
        (NORTH, 4.0, Velocity(nan, nan, nan), ""),
        (NORTH, inf, Velocity(5.0, 0.0, 0.0), ""),
    ],
)
def test_what_is_left_after_braking_counts(
    direction: Vector, metres: float, velocity: Velocity, said: str
) -> None:
    seen = seen_by(direction, metres, velocity)
    error = ObstacleMonitor(seen).check("goto", 10 * S, 5.0)
    assert (said in str(error)) if said else error is None
    assert ObstacleMonitor(seen).check("goto", 10 * S, 0.0) is None


def test_an_old_measurement_does_not_count_and_silent_sensors_end_the_operation() -> None:
    kernel = VirtualKernel()
    seen = seen_by(EAST, 2.0, Velocity(0.0, 4.0, 0.0), kernel)
    for second, said in ((11, "approached"), (12, ""), (13, ""), (14, "measured nothing for 4 s")):
        seen.last_message_ns = second * S
        advanced(kernel, second * S)
        error = ObstacleMonitor(seen).check("goto", second * S, 5.0)
        assert (said in str(error)) if said else error is None, second


def test_nothing_is_judged_on_the_ground() -> None:
    seen = seen_by(EAST, 2.0, Velocity(0.0, 4.0, 0.0))
    seen.flying = False
    assert ObstacleMonitor(seen).check("goto", 10 * S, 5.0) is None


def test_directions_turn_with_the_heading() -> None:
    seen = seen_by(UP, inf, Velocity(0.0, 0.0, 0.0))
    seen.attitude = Attitude(0.0, 0.0, 90.0)
    handlers = ObstacleDecoder(seen).handlers
    sensor = {"min_distance": 20, "max_distance": 4000}
    handlers["DISTANCE_SENSOR"]({**sensor, "orientation": 2, "current_distance": 500})  # right: south
    handlers["DISTANCE_SENSOR"]({**sensor, "orientation": 25, "current_distance": 100})  # the ground
    assert [one.metres for one in seen.obstacles.values()] == [5.0]
    assert next(iter(seen.obstacles.values())).direction == pytest.approx((0.0, -1.0, 0.0), abs=1e-9)
    handlers["DISTANCE_SENSOR"]({**sensor, "orientation": 2, "current_distance": 4000})  # nothing in range
    assert not seen.obstacles
    sectors = {"increment": 90, "increment_f": 0.0, "angle_offset": 0.0, "max_distance": 1000}
    distances = [65535, 300, 1001, 0]
    handlers["OBSTACLE_DISTANCE"]({**sectors, "frame": 12, "distances": distances})
    assert [one.direction[1] for one in seen.obstacles.values()] == [pytest.approx(-1.0)]
    handlers["OBSTACLE_DISTANCE"]({**sectors, "frame": 0, "distances": distances})  # from north
    assert [one.direction[0] for one in seen.obstacles.values()] == [pytest.approx(1.0)]
    seen.obstacles.clear()
    seen.attitude = Attitude(0.0, 0.0, nan)
    handlers["DISTANCE_SENSOR"]({**sensor, "orientation": 0, "current_distance": 500})
    assert not seen.obstacles


@pytest.mark.parametrize("wrong", [-1.0, inf, nan])
def test_a_clearance_is_a_length(wrong: float) -> None:
    with pytest.raises(UsageError, match="clearance="):
        Limits(clearance=wrong)


def test_a_drone_is_stopped_before_an_obstacle(bench: Make) -> None:
    """The wall is 60 m north of home: 8 m left where the drone is when it is stopped."""
    at = bench(limits=Limits(clearance=5.0))
    at.kernel.every(S // 5, lambda: say_distance(at))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (4.0, 0.0, 0.0)
        at.after(2.3, lambda: setattr(at.craft, "north", 52.5))
        at.after(4.0, lambda: setattr(at.craft, "velocity", (0.0, 0.0, 0.0)))
        drone.goto(Position(LATITUDE + 58 * PER_M, LONGITUDE, AboveHome(10.0)))

    at.autopilot.take = lambda name, fields: None  # it does not jump to its goal
    with pytest.raises(ObstacleNear, match=r"7\.[0-9] m to the north.*it holds there"):
        at.fly(mission)
    assert [one.outcome for one in at.recorded(Operation)][-1] == "ObstacleNear"


@pytest.mark.parametrize("period", [S // 20, S // 10, S // 4])
def test_velocities_in_a_loop_are_stopped_however_quick_it_is(bench: Make, period: int) -> None:
    """Each call replaces the monitor of the one before, which would have looked later."""
    at = bench(limits=Limits(clearance=5.0))
    at.kernel.every(S // 5, lambda: say_distance(at))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity, at.craft.north = (4.0, 0.0, 0.0), 40.0
        for _ in range(400):
            drone.set_velocity(north=4.0)
            sleep(at.kernel, period)
            at.craft.north += 4.0 * period / S

    with pytest.raises(ObstacleNear):
        at.fly(mission)
    assert 48.0 < at.craft.north < 52.0


def say_distance(at: Any) -> None:
    at.autopilot.say(
        "DISTANCE_SENSOR",
        orientation=0,
        min_distance=20,
        max_distance=4000,
        current_distance=round(100 * (60.0 - at.craft.north)),
    )


def test_without_range_sensors_a_clearance_is_refused(bench: Make) -> None:
    at = bench(limits=Limits(clearance=5.0))
    with pytest.raises(CapabilityError, match="a clearance of 5 m cannot be kept; set its range sensors up"):
        at.fly(lambda drone: drone.takeoff(10))
    assert not at.craft.armed


def test_distances_are_requested_only_for_a_clearance(bench: Make) -> None:
    requested = {132.0, 330.0}  # DISTANCE_SENSOR, OBSTACLE_DISTANCE

    def intervals(at: Any) -> set[float]:
        return {f.fields["param1"] for f in at.autopilot.received if f.fields.get("command") == 511}

    plain = bench()
    plain.fly(lambda drone: drone.takeoff(10))
    assert not intervals(plain) & requested
    wary = bench(limits=Limits(clearance=5.0))
    wary.kernel.every(S // 5, lambda: say_distance(wary))
    wary.fly(lambda drone: drone.takeoff(10))
    assert intervals(wary) >= requested
