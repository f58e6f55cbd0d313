"""Missions of DJI aircraft: waypoints above the place of take-off, one speed, one final action.

An M300 takes missions of a second kind only, whose places are in radians and whose waypoints have no stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import isnan, radians
from typing import Any, NamedTuple

from volery.base.errors import Refused, UsageError
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import Ns, S
from volery.ros.messages import message_class
from volery.ros.messages.dji_constants import (
    M300,
    MISSION_SPEEDS,
    NEW_NAMES,
    DisplayMode,
    HeadingMode,
    WaypointType,
)
from volery.vehicles.driver import ChangeSpeed, Land, MissionItem, ReturnHome, Step, TakeOff, Waypoint
from volery.vehicles.drivers.dji.backend import SdkAck, nothing
from volery.vehicles.drivers.dji.node_interfaces import SECOND_KIND
from volery.vehicles.drivers.dji.sequences import LANDING_MODES, RESEND_PERIOD, SDK, WAITS, DjiSteps, DjiTasks
from volery.vehicles.drivers.steps import ANSWERED_WITHIN, arrived_at, send_nothing
from volery.vehicles.telemetry import Telemetry

FEWEST, MOST, MOST_OF_SECOND_KIND = 2, 99, 65_535
USUAL_SPEED = 5.0
STAY = 0
NO_ACTION, GO_HOME, LAND = 0, 1, 2
YAW_AUTO, YAW_BY_WAYPOINT = 0, 3
GO_ON_WITHOUT_RC = 1
DAMPING_M = 0.2


class SdkRoute(NamedTuple):
    """A mission as an aircraft of either kind flies it: waypoints, speed in m/s, and the final action."""

    points: Sequence[Waypoint]
    speed: float
    finish: int


class SdkMission(NamedTuple):
    """A mission for the aircraft.

    Args:
        task: the uploaded message.
        takeoff: height of a preceding take-off, m, which is not part of the message.
        end: where it ends in the air; ``None`` if it lands.
    """

    task: Any
    takeoff: float | None
    end: Position | None


def plan_of(
    name: str,
    package: str,
    mission: Sequence[MissionItem],
    home: Position,
    here: Position,
    *,
    second_kind: bool = False,
) -> SdkMission:
    """Return the mission as messages of *package*; a take-off becomes a waypoint above the present place.

    Args:
        name: name of the vehicle, for errors.
        package: package of the messages.
        mission: items of the mission.
        home: home position, AMSL.
        here: present position, AMSL.
        second_kind: whether the aircraft takes missions of the second kind.

    Raises:
        UsageError: the speed changes on the way, it lands or returns before the end, it has too few or too
            many waypoints, or stays at one of the second kind.
    """
    items = list(mission)
    takeoff = items.pop(0).height if isinstance(items[0], TakeOff) else None  # type: ignore[union-attr]
    above = [] if takeoff is None else [Waypoint(Position(here.latitude, here.longitude, AboveHome(takeoff)))]
    route = _route(name, above, items)
    points = route.points
    most = MOST_OF_SECOND_KIND if second_kind else MOST
    if not FEWEST <= len(points) <= most:
        raise UsageError(
            f"{name}: a DJI mission has {FEWEST} to {most} waypoints; this one has {len(points)}"
        )
    if second_kind and any(point.stay_s > 0.0 for point in points):
        raise UsageError(f"{name}: a mission of an M300 does not stay at waypoints; goto() and hold() do")
    task = _settings(route, home) if second_kind else _task(package, route, home)
    return SdkMission(task, takeoff, points[-1].position if route.finish == NO_ACTION else None)


def _route(name: str, above: Sequence[Waypoint], items: Sequence[MissionItem]) -> SdkRoute:
    """Return the route through the waypoint *above* the place of take-off, if there is one, and *items*."""
    points = list(above)
    speeds: set[float] = set()
    finish = NO_ACTION
    for number, item in enumerate(items, start=1 + len(above)):
        if finish != NO_ACTION:
            raise UsageError(f"{name}: mission item {number}: a DJI mission ends with landing or going home")
        if isinstance(item, Waypoint):
            points.append(item)
        elif isinstance(item, ChangeSpeed):
            speeds.add(item.speed)
        elif isinstance(item, ReturnHome):
            finish = GO_HOME
        elif isinstance(item, Land):
            finish = LAND
            points += [Waypoint(over)] if (over := _over(item, points)) is not None else []
        else:
            raise UsageError(f"{name}: mission item {number}: a DJI mission takes off first or not at all")
    if len(speeds) > 1:
        raise UsageError(f"{name}: a DJI mission has one speed; this one states {sorted(speeds)}")
    return SdkRoute(points, _speed(name, speeds), finish)


def _over(item: Land, points: Sequence[Waypoint]) -> Position | None:
    """Return the landing place at the height of the last waypoint; ``None`` to land in place."""
    if item.position is None or not points:
        return None
    return Position(item.position.latitude, item.position.longitude, points[-1].position.altitude)


def _speed(name: str, speeds: set[float]) -> float:
    speed = next(iter(speeds), USUAL_SPEED)
    low, high = MISSION_SPEEDS
    if not low <= speed <= high:
        raise UsageError(f"{name}: a DJI mission flies at {low:g} to {high:g} m/s, not at {speed:g}")
    return speed


def _task(package: str, route: SdkRoute, home: Position) -> Any:
    turns = any(not isnan(point.heading) for point in route.points)
    made: Any = message_class(f"{package}/msg/MissionWaypointTask")()
    made.velocity_range, made.idle_velocity = MISSION_SPEEDS.highest, route.speed
    made.action_on_finish, made.mission_exec_times = route.finish, 1
    made.yaw_mode = YAW_BY_WAYPOINT if turns else YAW_AUTO
    made.action_on_rc_lost = GO_ON_WITHOUT_RC
    made.mission_waypoint = [_waypoint(package, point, home) for point in route.points]
    return made


def _waypoint(package: str, point: Waypoint, home: Position) -> Any:
    made: Any = message_class(f"{package}/msg/MissionWaypoint")()
    made.latitude, made.longitude = point.position.latitude, point.position.longitude
    made.altitude = above_home(point.position, home)
    made.damping_distance = DAMPING_M
    if not isnan(point.heading):
        made.target_yaw = round(_yaw(point))
    if point.stay_s > 0.0:
        made.has_action, made.action_time_limit = 1, min(65_535, round(point.stay_s) + 60)
        action = made.waypoint_action
        action.action_repeat = 0x11
        action.command_list[0] = STAY
        action.command_parameter[0] = min(65_535, round(point.stay_s * 1000.0))
    return made


def _yaw(point: Waypoint) -> float:
    """Return the heading at a waypoint, degrees from -180 to 180."""
    return (point.heading + 180.0) % 360.0 - 180.0


def _settings(route: SdkRoute, home: Position) -> Any:
    """Return the mission as one of the second kind, whose final actions have the same numbers."""
    made: Any = message_class(SECOND_KIND)()
    made.missTotalLen, made.finishedAction = len(route.points), route.finish
    made.maxFlightSpeed, made.autoFlightSpeed = MISSION_SPEEDS.highest, route.speed
    for point in route.points:
        one: Any = message_class(f"{NEW_NAMES}/msg/WaypointV2")()
        one.latitude, one.longitude = radians(point.position.latitude), radians(point.position.longitude)
        one.relativeHeight = above_home(point.position, home)
        one.waypointType = WaypointType.STRAIGHT_AND_STOP
        one.dampingDistance = round(100.0 * DAMPING_M)
        one.maxFlightSpeed, one.autoFlightSpeed = made.maxFlightSpeed, route.speed
        if not isnan(point.heading):
            one.headingMode, one.heading = HeadingMode.BY_WAYPOINT, _yaw(point)
        made.mission.append(one)
    return made


def above_home(position: Position, home: Position) -> float:
    """Return metres above *home* (AMSL), the place of take-off.

    Raises:
        UsageError: the altitude is neither AMSL nor above home.
    """
    if isinstance(position.altitude, AboveHome):
        return position.altitude.metres
    if isinstance(position.altitude, AMSL):
        return position.altitude.metres - home.altitude.metres
    raise UsageError(f"{position}: a DJI aircraft takes AMSL and AboveHome")


def check_amsl(goal: Position, asked: str, seen: Telemetry) -> None:
    """Raise ``Refused`` for an altitude AMSL while that of home is not stated.

    Args:
        goal: goal or waypoint.
        asked: the command in words.
        seen: telemetry of the aircraft.
    """
    if isinstance(goal.altitude, AMSL) and not seen.amsl_known:
        raise Refused(seen.name, asked, seen.amsl_remedy)


FLYING = DisplayMode.NAVI_MISSION.name


class MissionRunner:
    """Steps for the mission that this program uploaded last."""

    def __init__(self, steps: DjiSteps, tasks: DjiTasks) -> None:
        self._steps = steps
        self._tasks = tasks
        self._backend = steps.backend
        self._telemetry = steps.telemetry
        self._plan: SdkMission | None = None

    def upload(self, mission: Sequence[MissionItem]) -> Sequence[Step]:
        """Return steps that upload a mission."""
        home, here = self._telemetry.home, self._telemetry.position
        if home is None or here is None:
            said = "it does not know where it is yet; wait_ready() first"
            raise Refused(self._steps.name, "upload a mission", said)
        for item in mission:
            if isinstance(item, Waypoint):
                check_amsl(item.position, "upload a mission", self._telemetry)
        interface = self._backend.interface
        second_kind = interface.package == NEW_NAMES and self._backend.decoder.aircraft == M300
        plan = plan_of(self._steps.name, interface.package, mission, home, here, second_kind=second_kind)

        def keep() -> None:
            self._plan = plan

        count = len(plan.task.mission if second_kind else plan.task.mission_waypoint)
        *before, last = interface.mission(plan.task)
        uploads = [
            Step(
                ask=f"take a mission of {count} waypoints",
                send=partial(self._backend.request, SdkAck.MISSION, ask, accepted),
                done=lambda seen: self._steps.accepted(SdkAck.MISSION),
                within=30 * S + count * 2 * S,
                answer=SdkAck.MISSION,
                again=5 * S,
            )
            for ask, accepted in (*((one, nothing) for one in before), (last, keep))
        ]
        return (self._steps.activated(), self._steps.authority(), *uploads)

    def start(self, within: Ns) -> Sequence[Step]:
        """Return steps that take off, start the mission, and wait for its end."""
        plan = self._plan
        if plan is None:
            raise Refused(self._steps.name, "start the mission", "none was uploaded by this program")
        lift: Sequence[Step] = ()
        if not self._telemetry.flying:
            if plan.takeoff is None:
                said = "it is on the ground, and no TakeOff comes first"
                raise Refused(self._steps.name, "start the mission", said)
            lift = self._tasks.takeoff(plan.takeoff, within)
        begin = Step(
            ask="start the mission",
            send=partial(self._begin, plan),
            done=lambda seen: self._steps.accepted(SdkAck.START),
            within=ANSWERED_WITHIN,
            answer=SdkAck.START,
            again=RESEND_PERIOD,
            enters=FLYING,
            leads_to=(WAITS, SDK),
            armed=True,
        )
        return (*lift, self._steps.authority(), self._steps.quiet(), begin, self._over(plan, within))

    def _begin(self, plan: SdkMission) -> None:
        self._steps.stream.stop()
        self._steps.decoder.commanded = FLYING
        self._backend.request(SdkAck.START, self._backend.interface.start_mission(plan.task))

    def _over(self, plan: SdkMission, within: Ns) -> Step:
        """Return a step that ends when disarmed, or at rest at an end in the air."""
        end = plan.end

        def over(seen: Telemetry) -> bool:
            if not seen.armed:
                return True
            return (
                end is not None
                and arrived_at(end, False)(seen)
                and (seen.mode != FLYING or self._backend.is_m100)
            )

        return Step(
            ask="finish the mission",
            send=send_nothing,
            done=over,
            within=within,
            mode=FLYING,
            leads_to=(WAITS, *sorted(LANDING_MODES)),
        )
