"""DJI's message definitions: what they hold, and what their numbers mean."""

from __future__ import annotations

from typing import Any

import pytest

from volery.ros.messages import (
    cdr_size,
    from_cdr,
    message_class,
    new,
    request,
    service,
    service_types,
    to_cdr,
)
from volery.ros.messages.dji_constants import (
    ANGLE_YAW_RATE_HEIGHT,
    POSITION_YAW,
    SETPOINT_TOPICS,
    VELOCITY_YAW_RATE,
    DisplayMode,
    Flag,
    display_name,
)


def test_the_flags_of_the_three_topics_are_the_documented_ones() -> None:
    assert (POSITION_YAW, VELOCITY_YAW_RATE, ANGLE_YAW_RATE_HEIGHT) == (145, 73, 27)
    assert POSITION_YAW == Flag.HORIZONTAL_POSITION | Flag.VERTICAL_POSITION | Flag.STABLE
    assert VELOCITY_YAW_RATE == Flag.HORIZONTAL_VELOCITY | Flag.YAW_RATE | Flag.STABLE
    assert ANGLE_YAW_RATE_HEIGHT == Flag.VERTICAL_POSITION | Flag.YAW_RATE | Flag.BODY | Flag.STABLE
    assert len(SETPOINT_TOPICS) == 3


def test_tasks_have_the_numbers_that_the_ros_service_kept() -> None:
    task: Any = service("dji_sdk/DroneTaskControl").request
    assert (task.TASK_GOHOME, task.TASK_TAKEOFF, task.TASK_LAND) == (1, 4, 6)
    newer: Any = service("dji_osdk_ros/FlightTaskControl").request
    assert (newer.START_MOTOR, newer.STOP_MOTOR, newer.TASK_EXIT_LANDING) == (7, 8, 14)


def test_modes_go_by_their_public_names() -> None:
    assert display_name(DisplayMode.P_GPS) == "P_GPS"
    assert display_name(17) == "NAVI_SDK_CTRL"
    assert display_name(38) == "MODE_38"


@pytest.mark.parametrize("package", ["dji_sdk", "dji_osdk_ros"])
def test_a_mission_survives_its_bytes(package: str) -> None:
    point = new(f"{package}/MissionWaypoint", latitude=46.5, longitude=-103.25, altitude=12.5, target_yaw=-90)
    point.waypoint_action.command_parameter[15] = 65_535
    task = new(f"{package}/MissionWaypointTask", velocity_range=15.0, idle_velocity=5.0)
    task.mission_waypoint = [point, point]
    back = from_cdr(f"{package}/MissionWaypointTask", to_cdr(task))
    assert back == task
    assert len(to_cdr(task)) == cdr_size(task)
    assert back.mission_waypoint[1].waypoint_action.command_parameter[15] == 65_535


def test_nested_requests_are_made_of_plain_dicts() -> None:
    asked = request("dji_osdk_ros/JoystickAction", joystickCommand={"x": 1.0, "yaw": 90.0})
    assert (asked.joystickCommand.x, asked.joystickCommand.y, asked.joystickCommand.yaw) == (1.0, 0.0, 90.0)


def test_an_anomaly_is_one_bit_each() -> None:
    kind = message_class("dji_sdk/FlightAnomaly")
    bits = [getattr(kind, name) for name in dir(kind) if name.isupper()]
    assert sorted(bits) == [1 << place for place in range(13)]


def test_every_response_has_a_success_flag_or_a_value() -> None:
    for name in service_types():
        if name.startswith(("dji_sdk/", "dji_osdk_ros/")):
            assert service(name).response.__match_args__, name
