"""Missions of the second kind: ``waypointV2_...`` of the vehicle node of ``dji_osdk_ros`` 4.1.

An M300 takes these only, other aircraft refuse them. A request states the settings with all waypoints, in
radians, a second one uploads them. Not simulated: actions at waypoints, points of interest, the throttle
stick's effect on the speed, curves to a waypoint, and the topics of events and states.
"""

from __future__ import annotations

from collections.abc import Callable
from math import degrees
from typing import Any

from volery.base.time import Ns, S
from volery.ros.messages import message_class
from volery.ros.messages.dji_constants import (
    M300,
    MISSION_SPEEDS,
    NEW_NAMES,
    NO_CODE,
    HeadingMode,
    MissionAck,
    WaypointType,
)
from volery.simulation.autopilots.dji.flight_controller import FlightController
from volery.simulation.autopilots.dji.sdk_commands import YAW_BY_WAYPOINT, YAW_LOCKED, mission_refusal
from volery.simulation.autopilots.dji.sdk_services import Reply, Served, accepting

MAX_WAYPOINTS = 65_535
UPLOAD_PERIOD: Ns = S
"""Time that the upload takes; assumed."""
PASSED = (WaypointType.CURVE, WaypointType.COORDINATED)
"""Waypoints at which the aircraft does not stop."""
COORDINATED_TURNS = 1


def mission_task(settings: Any) -> Any:
    """Return a mission of the second kind as one of the first."""
    task: Any = message_class(f"{NEW_NAMES}/msg/MissionWaypointTask")()
    task.velocity_range, task.idle_velocity = settings.maxFlightSpeed, settings.autoFlightSpeed
    task.action_on_finish = settings.finishedAction
    task.mission_exec_times = settings.repeatTimes + 1
    headings = {point.headingMode for point in settings.mission}
    if HeadingMode.BY_WAYPOINT in headings:
        task.yaw_mode = YAW_BY_WAYPOINT
    elif headings == {HeadingMode.FIXED}:
        task.yaw_mode = YAW_LOCKED
    if all(point.waypointType in PASSED for point in settings.mission):
        task.trace_mode = COORDINATED_TURNS
    for point in settings.mission:
        one: Any = message_class(f"{NEW_NAMES}/msg/MissionWaypoint")()
        one.latitude, one.longitude = degrees(point.latitude), degrees(point.longitude)
        one.altitude, one.target_yaw = point.relativeHeight, round(point.heading)
        task.mission_waypoint.append(one)
    return task


class WaypointV2Services:
    """Services for missions of the second kind of one aircraft."""

    def __init__(self, controller: FlightController) -> None:
        self._controller = controller
        self._settings: Any = None

    def table(self) -> tuple[Served, ...]:
        """Return the services."""
        controller = self._controller

        def only_m300(handle: Callable[[Any], int]) -> Callable[[Any], int]:
            return lambda request: handle(request) if controller.aircraft == M300 else NO_CODE

        def start(request: Any) -> int:
            return controller.start_mission(from_start=True)

        def resume(request: Any) -> int:
            return controller.start_mission(from_start=False)

        def leave(request: Any) -> int:
            return controller.leave_mission()

        accepted = accepting(
            f"{NEW_NAMES}/waypointV2_",
            NEW_NAMES,
            ("initSetting", "InitWaypointV2Setting", only_m300(self._init)),
            ("uploadMission", "UploadWaypointV2Mission", only_m300(self._upload)),
            ("startMission", "StartWaypointV2Mission", only_m300(start)),
            ("stopMission", "StopWaypointV2Mission", only_m300(leave)),
            ("pauseMission", "PauseWaypointV2Mission", only_m300(leave)),
            ("resumeMission", "ResumeWaypointV2Mission", only_m300(resume)),
            ("setGlobalCruisespeed", "SetGlobalCruisespeed", only_m300(self._set_speed)),
        )
        return (
            *(self._slow(one) if one.name.endswith("uploadMission") else one for one in accepted),
            self._query("downloadMission", "DownloadWaypointV2Mission", self._downloaded),
            self._query("getGlobalCruisespeed", "GetGlobalCruisespeed", self._speed),
        )

    def _slow(self, served: Served) -> Served:
        """Return the service with an answer that comes after the upload."""
        kernel = self._controller.vehicle.kernel

        def answer(request: Any) -> Reply:
            until = kernel.now() + UPLOAD_PERIOD
            return Reply(served.answer(request).response, lambda: kernel.now() >= until)

        return served._replace(answer=answer)

    def _query(self, name: str, kind: str, values: Callable[[], tuple[Any, bool]]) -> Served:
        kind = f"{NEW_NAMES}/srv/{kind}"
        response = message_class(f"{kind}_Response")
        return Served(f"{NEW_NAMES}/waypointV2_{name}", kind, lambda _: Reply(response(*values())))

    def _init(self, request: Any) -> int:
        """Keep the settings of a mission that makes sense."""
        settings = request.waypointV2InitSettings.copy()
        if mission_refusal(mission_task(settings), MAX_WAYPOINTS):
            return NO_CODE
        self._settings = settings
        return MissionAck.OK

    def _upload(self, _request: Any) -> int:
        if self._settings is None:
            return NO_CODE
        return self._controller.upload(mission_task(self._settings), MAX_WAYPOINTS)

    def _downloaded(self) -> tuple[Any, bool]:
        there = self._settings is not None and self._controller.task is not None
        return (self._settings.copy().mission if there else [], there)

    def _set_speed(self, request: Any) -> int:
        speed, task = request.global_cruisespeed, self._controller.task
        good = task is not None and 0.0 < speed <= min(task.velocity_range, MISSION_SPEEDS.highest)
        return self._controller.mission_speed(speed) if good else NO_CODE

    def _speed(self) -> tuple[float, bool]:
        task = self._controller.task
        return (task.idle_velocity if task is not None else 0.0, task is not None)
