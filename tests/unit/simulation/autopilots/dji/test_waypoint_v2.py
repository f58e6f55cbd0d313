"""Missions of the second kind, on a simulated M300."""

from __future__ import annotations

from collections.abc import Callable
from math import nan, radians
from typing import Any

import pytest

from volery.ros.messages import new
from volery.ros.messages.dji_constants import HeadingMode, WaypointType

Make = Callable[..., Any]
TAKE_OFF = 4
M300 = {"AIRCRAFT": 5.0}


def settings(*norths: float, **changes: Any) -> Any:
    """A mission northward from home, 8 m high."""
    made = new("dji_osdk_ros/WaypointV2InitSetting", maxFlightSpeed=10.0, autoFlightSpeed=5.0, **changes)
    for north in norths:
        made.mission.append(
            new(
                "dji_osdk_ros/WaypointV2",
                latitude=radians(46.0 + north / 111_195.0),
                longitude=radians(-103.0),
                relativeHeight=8.0,
                waypointType=WaypointType.STRAIGHT_AND_STOP,
            )
        )
    return made


def accepts(yard: Any, name: str, kind: str, **fields: Any) -> bool:
    return bool(yard.call(f"waypointV2_{name}", kind, **fields).result)


def upload(yard: Any, mission: Any) -> bool:
    stated = accepts(yard, "initSetting", "InitWaypointV2Setting", waypointV2InitSettings=mission)
    return stated and accepts(yard, "uploadMission", "UploadWaypointV2Mission")


def ready(yard: Any) -> None:
    yard.hear("flight_status", "gps_position", "display_mode")
    yard.wait(0.5)
    obtained = yard.call("/obtain_release_control_authority", "ObtainControlAuthority", enable_obtain=True)
    assert obtained.result


def test_it_is_flown_paused_and_resumed(apron: Make) -> None:
    yard = apron("dji_osdk_ros", parameters=M300)

    def body() -> None:
        ready(yard)
        assert yard.call("/get_drone_type", "GetDroneType").drone_type == 2
        mission = settings(10.0, 60.0, finishedAction=2)
        mission.mission[1].headingMode, mission.mission[1].heading = HeadingMode.BY_WAYPOINT, 90.0
        assert not yard.call("waypointV2_downloadMission", "DownloadWaypointV2Mission").result
        begun = yard.kernel.now()
        assert upload(yard, mission)
        assert yard.kernel.now() - begun >= 1_000_000_000
        assert yard.call("waypointV2_downloadMission", "DownloadWaypointV2Mission").mission == mission.mission
        assert not accepts(yard, "startMission", "StartWaypointV2Mission")  # on the ground
        assert yard.call("/flight_task_control", "FlightTaskControl", task=TAKE_OFF).result
        assert accepts(yard, "startMission", "StartWaypointV2Mission")
        assert yard.mode == 14
        yard.until(lambda: yard.place[1] > 20.0)
        assert accepts(yard, "pauseMission", "PauseWaypointV2Mission")
        yard.wait(7.0)
        assert (yard.mode, yard.place[1] < 35.0) == (6, True)
        assert accepts(yard, "setGlobalCruisespeed", "SetGlobalCruisespeed", global_cruisespeed=9.0)
        speed = yard.call("waypointV2_getGlobalCruisespeed", "GetGlobalCruisespeed")
        assert (speed.global_cruisespeed, speed.result) == (9.0, True)
        assert accepts(yard, "resumeMission", "ResumeWaypointV2Mission")
        yard.until(lambda: yard.status == 0, within=120.0)
        assert yard.place[1] == pytest.approx(60.0, abs=1.5)

    yard.run(body)


@pytest.mark.parametrize(
    ("norths", "speed"),
    [
        ((10.0,), 5.0),  # one waypoint
        ((10.0, nan), 5.0),  # nowhere
        ((10.0, 20.0), 20.0),  # too fast
    ],
)
def test_settings_that_make_no_sense_are_refused(
    apron: Make, norths: tuple[float, ...], speed: float
) -> None:
    yard = apron("dji_osdk_ros", parameters=M300)

    def body() -> None:
        ready(yard)
        mission = settings(*norths)
        mission.autoFlightSpeed = speed
        assert not upload(yard, mission)
        assert not accepts(yard, "uploadMission", "UploadWaypointV2Mission")  # none was stated

    yard.run(body)


@pytest.mark.parametrize(("parameters", "kind"), [(M300, 1), ({"AIRCRAFT": 4.0}, 2)])
def test_an_aircraft_refuses_missions_of_the_other_kind(
    apron: Make, parameters: dict[str, float], kind: int
) -> None:
    yard = apron("dji_osdk_ros", parameters=parameters)

    def body() -> None:
        ready(yard)
        if kind == 2:
            assert not upload(yard, settings(10.0, 20.0))
            return
        task = new("dji_osdk_ros/MissionWaypointTask", velocity_range=10.0, idle_velocity=5.0)
        point = new("dji_osdk_ros/MissionWaypoint", latitude=46.0, longitude=-103.0, altitude=8.0)
        task.mission_waypoint = [point, point.copy()]
        assert not yard.call("mission_waypoint_upload", "MissionWpUpload", waypoint_task=task).result

    yard.run(body)
