"""Missions as DJI aircraft take them."""

from __future__ import annotations

from math import degrees

import pytest

from volery.base.errors import UsageError
from volery.base.position import AMSL, AboveGround, AboveHome, Altitude, Position
from volery.vehicles import ChangeSpeed, Land, MissionItem, ReturnHome, TakeOff, Waypoint
from volery.vehicles.drivers.dji.missions import plan_of

HOME = Position(46.0, -103.0, AMSL(900.0))


def point(metres_north: float, altitude: Altitude | None = None) -> Position:
    return Position(46.0 + metres_north / 111_195.0, -103.0, altitude or AboveHome(10.0))


def plan(*items: MissionItem) -> object:
    return plan_of("d", "dji_sdk", items, HOME, HOME)


def test_a_takeoff_becomes_a_waypoint_over_the_place_and_the_rest_counts_from_home() -> None:
    made = plan_of(
        "d",
        "dji_osdk_ros",
        [
            TakeOff(6.0),
            ChangeSpeed(4.0),
            Waypoint(point(20.0, AMSL(915.0)), stay_s=2.5, heading=270.0),
            ReturnHome(),
        ],
        HOME,
        HOME,
    )
    assert (made.takeoff, made.end) == (6.0, None)
    task = made.task
    assert task.__msgtype__ == "dji_osdk_ros/msg/MissionWaypointTask"
    assert (task.idle_velocity, task.velocity_range, task.action_on_finish) == (4.0, 15.0, 1)
    assert [one.altitude for one in task.mission_waypoint] == [6.0, 15.0]
    last = task.mission_waypoint[1]
    assert (last.has_action, last.target_yaw, task.yaw_mode) == (1, -90, 3)
    assert last.waypoint_action.command_parameter[0] == 2500


def test_one_that_ends_in_the_air_says_where() -> None:
    made = plan_of("d", "dji_sdk", [Waypoint(point(5.0)), Waypoint(point(15.0))], HOME, HOME)
    assert made.end == point(15.0)
    assert made.takeoff is None
    assert made.task.action_on_finish == 0
    assert made.task.yaw_mode == 0


def test_landing_elsewhere_is_a_waypoint_over_it() -> None:
    made = plan_of("d", "dji_sdk", [TakeOff(8.0), Land(point(30.0, AboveHome(0.0)))], HOME, HOME)
    assert [one.altitude for one in made.task.mission_waypoint] == [8.0, 8.0]
    assert made.task.action_on_finish == 2


def test_an_m300_takes_radians_and_turns_at_waypoints() -> None:
    items = [TakeOff(6.0), ChangeSpeed(4.0), Waypoint(point(20.0, AMSL(915.0)), heading=270.0), Land()]
    made = plan_of("d", "dji_osdk_ros", items, HOME, HOME, second_kind=True)
    settings = made.task
    assert settings.__msgtype__ == "dji_osdk_ros/msg/WaypointV2InitSetting"
    assert (settings.missTotalLen, settings.finishedAction, settings.autoFlightSpeed) == (2, 2, 4.0)
    first, last = settings.mission
    assert (degrees(first.latitude), degrees(first.longitude)) == pytest.approx((46.0, -103.0))
    assert (first.relativeHeight, first.headingMode) == (6.0, 0)
    assert (last.relativeHeight, last.headingMode, last.heading) == (15.0, 3, -90.0)
    assert {one.waypointType for one in settings.mission} == {2}


def test_an_m300_does_not_stay_and_takes_more_waypoints() -> None:
    many = [Waypoint(point(float(number))) for number in range(1, 201)]
    made = plan_of("d", "dji_osdk_ros", many, HOME, HOME, second_kind=True)
    assert made.task.missTotalLen == 200
    with pytest.raises(UsageError, match="does not stay at waypoints"):
        plan_of("d", "dji_osdk_ros", [*many, Waypoint(point(5.0), stay_s=1.0)], HOME, HOME, second_kind=True)


@pytest.mark.parametrize(
    ("items", "wrong"),
    [
        ((TakeOff(5.0),), "2 to 99 waypoints; this one has 1"),
        ((Waypoint(point(5.0)), TakeOff(5.0), Waypoint(point(9.0))), "item 2: .*takes off first"),
        ((Waypoint(point(1.0)), ReturnHome(), Waypoint(point(5.0))), "item 3: .*ends with"),
        ((ChangeSpeed(3.0), Waypoint(point(1.0)), ChangeSpeed(4.0), Waypoint(point(5.0))), "one speed"),
        ((ChangeSpeed(1.0), Waypoint(point(1.0)), Waypoint(point(5.0))), "2 to 15 m/s, not at 1"),
        ((Waypoint(point(1.0)), Waypoint(point(5.0, AboveGround(5.0)))), "AMSL and AboveHome"),
    ],
)
def test_a_mission_that_cannot_be_flown_is_refused_before_it_is_sent(
    items: tuple[MissionItem, ...], wrong: str
) -> None:
    with pytest.raises(UsageError, match=wrong):
        plan(*items)
