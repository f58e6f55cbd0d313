"""Flight of the mission on board: one leg for each item that navigates, actions between them, and conditions.

Actions between two legs are done when the first of the legs ends. A condition lets the next leg begin and
delays only the actions that follow it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import hypot, pi, sqrt

from volery.base.elementary import atan2, cos, sin
from volery.base.frames import Vector
from volery.base.time import Ns, from_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.to_point import (
    Brake,
    ClimbStraight,
    DescendAndLand,
    ReturnAndLand,
    ToPoint,
    bearing,
)
from volery.simulation.autopilots.onboard_mission import (
    CONDITION_DELAY,
    CONDITION_DISTANCE,
    DELAY,
    JUMP,
    LAND,
    LOITER_TIME,
    LOITER_TURNS,
    LOITER_UNLIMITED,
    RETURN,
    SPLINE_WAYPOINT,
    TAKEOFF,
    WAYPOINT,
    MissionItem,
)
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, FlightManoeuvre

FOREVER = -1

LEAST_CLIMB = 1.0
"""Height above the ground to which a take-off climbs at least [m]."""


@dataclass
class Leg:
    """A manoeuvre, the condition that it is done, and the time to stay then [ns]."""

    manoeuvre: FlightManoeuvre
    done: Callable[[], bool]
    stay: Ns = 0


MakeLeg = Callable[[AutopilotVehicle, MissionItem, bool], Leg]
"""Creates a leg from the vehicle, the item, and whether the mission goes on to a waypoint without a stop."""


def _ignore(*_event: object) -> None:
    """Do nothing: the default of mission events."""


@dataclass(frozen=True, kw_only=True)
class MissionRules:
    """What a firmware does while it flies a mission."""

    first_item: int = 1
    """Index of the first item that is flown: 1 where item 0 is the home position."""
    restarts: bool = False
    """Whether a mission that has ended begins anew when its mode is entered again."""
    reports_actions: bool = False
    """Whether ``item_done`` is called for items that do not navigate, too."""
    item_begins: Callable[[AutopilotVehicle, int, MissionItem], None] = _ignore
    item_done: Callable[[AutopilotVehicle, int, MissionItem], None] = _ignore
    act: Callable[[AutopilotVehicle, MissionItem], None] = _ignore
    """Execute an item that does not navigate."""
    action_begins: Callable[[AutopilotVehicle, int, MissionItem], None] = _ignore
    """Called for items that do not navigate: for the first before the next leg begins, for others after."""
    action_done: Callable[[AutopilotVehicle, int, MissionItem], None] = _ignore
    """Called when they are done."""
    jumped: Callable[[AutopilotVehicle, int, int, int], None] = _ignore
    """Called with the index of a jump, how often it has been done, and how often it is to be."""
    ended: Callable[[AutopilotVehicle], FlightManoeuvre | None] = _ignore
    """Called at the end; returns what is flown then, or ``None``."""


class FlyMission(FlightManoeuvre):
    """Fly the mission on board from its current item.

    Args:
        vehicle: The vehicle.
        make_leg: Creates the leg of an item.
        rules: How the firmware treats items and reports progress.
        leaves_ground: Whether the mission may start the motors by itself; ``None``: only a start command may.
    """

    def __init__(
        self,
        vehicle: AutopilotVehicle,
        make_leg: MakeLeg,
        rules: MissionRules,
        leaves_ground: Callable[[AutopilotVehicle], bool] | None = None,
    ) -> None:
        super().__init__(vehicle)
        self.slow_start = True
        self._make_leg = make_leg
        self._rules = rules
        self._leaves_ground = leaves_ground
        self._leg: Leg | None = None
        self._of_leg = (0, MissionItem(WAYPOINT))
        """Index and item of the leg; an upload may replace the mission meanwhile."""
        self._reached_at: Ns | None = None
        self._jumps: dict[int, int] = {}
        self._held: deque[tuple[int, MissionItem]] = deque()
        self._begun_later: list[tuple[int, MissionItem]] = []
        """Actions that are reported as begun after the next leg."""
        self._condition_since: Ns = 0
        self._waiting: Brake | None = None
        """What is flown during a pause."""
        self._first_action = True
        self.started = False
        """Whether the mission may leave the ground: by a start command, or by *leaves_ground*."""

    @property
    def flown(self) -> FlightManoeuvre:
        """The manoeuvre of the leg, if there is one."""
        return self if self._leg is None else self._leg.manoeuvre

    def enter(self) -> None:
        """Wait for the next step: the mission begins once the vehicle is armed."""
        self._leg = None
        if self._rules.restarts and self.vehicle.mission.complete:
            self.vehicle.mission.restart()
        self.started = self.started or (self.vehicle.armed and not self.vehicle.landed)

    def start(self) -> None:
        """Permit to leave the ground, and begin if armed."""
        self.started = True
        if self.vehicle.armed and self._leg is None:
            self._begin_current()

    def takeoff_requested(self) -> bool:
        """Return whether the mission may leave the ground and its leg requests it."""
        if not self.started and self._leaves_ground is not None:
            self.started = self._leaves_ground(self.vehicle)
        if self._leg is None:
            self._begin_current()
        return self.started and self._leg is not None and self._leg.manoeuvre.takeoff_requested()

    def step(self) -> None:
        """Continue the leg, or begin the next when it is done; wait during a pause."""
        if self._waiting is not None:
            self._waiting.step()
            return
        self._progress()
        if self._leg is not None and self.vehicle.armed and not self.vehicle.landed:
            self._leg.manoeuvre.step()
            self._mirror(self._leg.manoeuvre)

    def pause(self) -> bool:
        """Stop on the way to a waypoint; other items do not pause. A second pause changes nothing."""
        leg = self._leg
        flies = leg is not None and isinstance(leg.manoeuvre, ToPoint) and not leg.manoeuvre.taking_off
        if not flies or self._reached_at is not None or self.vehicle.landed:
            return False
        if self._waiting is None:
            self._waiting = Brake(self.vehicle, self.vehicle.tuning.accel)
        return True

    def resume(self) -> bool:
        """Continue on the way to the waypoint."""
        self._waiting = None
        return True

    def on_ground(self) -> None:
        """Continue the mission: a leg may end on the ground."""
        self._progress()

    def item_chosen(self) -> None:
        """Begin the chosen item at the next step."""
        self._leg = self._waiting = None

    def _progress(self) -> None:
        if self._leg is None:
            self._begin_current()
        leg, now = self._leg, self.vehicle.kernel.now()
        if leg is None:
            return
        self._run_held()
        if self._reached_at is None and leg.done():
            self._reached_at = now
        if self._reached_at is not None and leg.stay >= 0 and now - self._reached_at >= leg.stay:
            self._finish()

    def _mirror(self, manoeuvre: FlightManoeuvre) -> None:
        self.target, self.landing, self.taking_off = manoeuvre.target, manoeuvre.landing, manoeuvre.taking_off

    # -- from item to item

    def _begin_current(self) -> None:
        plan = self.vehicle.mission
        if len(plan) and not plan.complete:
            self._advance_to(max(self._rules.first_item, plan.current))

    def _finish(self) -> None:
        index, item = self._of_leg
        self._rules.item_done(self.vehicle, index, item)
        self._advance_to(index + 1)

    def _advance_to(self, index: int) -> None:
        vehicle, plan = self.vehicle, self.vehicle.mission
        self._leg = None
        self._held.clear()
        self._first_action = True
        for _ in range(len(plan) + 100):  # jumps may form a loop without a leg in it
            if index >= len(plan):
                break
            item = plan[index]
            if item.navigates:
                self._begin(index, item)
                self._report_later()
                return
            index = self._act(index, item)
        self._report_later()
        plan.complete = True
        if not self._rules.restarts:
            plan.current = 0
        self.target, self.landing, self.taking_off = None, False, False
        after = self._rules.ended(vehicle)
        if after is not None:
            self._leg, self._reached_at = Leg(after, lambda: False), None
            after.enter()
            self._mirror(after)

    def _begin(self, index: int, item: MissionItem) -> None:
        vehicle = self.vehicle
        vehicle.mission.current = index
        self._rules.item_begins(vehicle, index, item)
        self._of_leg = index, item
        self._leg = self._make_leg(vehicle, item, self._goes_on(index))
        self._reached_at = None
        self._leg.manoeuvre.enter()
        self._mirror(self._leg.manoeuvre)

    def _goes_on(self, index: int) -> bool:
        """Return whether the next item that navigates is a waypoint and this one has no stop."""
        plan = self.vehicle.mission
        following = next((item for item in plan.items[index + 1 :] if item.navigates), None)
        stops = plan[index].param1 > 0.0
        return following is not None and following.command in (WAYPOINT, SPLINE_WAYPOINT) and not stops

    # -- actions

    def _act(self, index: int, item: MissionItem) -> int:
        """Do an item that does not navigate and return the index of the next."""
        if item.command == JUMP:
            return self._jump(index, item)
        first, self._first_action = self._first_action, False
        if first:
            self._rules.action_begins(self.vehicle, index, item)
        elif not self._held:
            self._begun_later.append((index, item))
        if item.is_condition or self._held:
            if not self._held:
                self._condition_since = self.vehicle.kernel.now()
            self._held.append((index, item))
        else:
            self._do(item)
            self._rules.action_done(self.vehicle, index, item)
            if self._rules.reports_actions:
                self._rules.item_done(self.vehicle, index, item)
        return index + 1

    def _report_later(self) -> None:
        for index, item in self._begun_later:
            self._rules.action_begins(self.vehicle, index, item)
        self._begun_later.clear()

    def _jump(self, index: int, item: MissionItem) -> int:
        done = self._jumps.get(index, 0)
        if item.param2 != FOREVER and done >= item.param2:
            return index + 1
        self._jumps[index] = done + 1
        self._rules.jumped(self.vehicle, index, done + 1, round(item.param2))
        return max(self._rules.first_item, round(item.param1))

    def _do(self, item: MissionItem) -> None:
        self._rules.act(self.vehicle, item)

    def _run_held(self) -> None:
        while self._held:
            index, item = self._held[0]
            if item.is_condition and not self._met(item):
                return
            self._held.popleft()
            self._condition_since = self.vehicle.kernel.now()
            if not item.is_condition or item.command not in (CONDITION_DELAY, CONDITION_DISTANCE):
                self._do(item)
            self._rules.action_done(self.vehicle, index, item)
            if self._held:
                self._rules.action_begins(self.vehicle, *self._held[0])

    def _met(self, item: MissionItem) -> bool:
        if item.command == CONDITION_DELAY:
            return self.vehicle.kernel.now() - self._condition_since >= from_seconds(item.param1)
        if item.command == CONDITION_DISTANCE and self._leg is not None:
            return self._leg.manoeuvre.distance() <= item.param1
        return True


class FlyCircle(FlightManoeuvre):
    """Fly a circle at a height.

    Args:
        vehicle: The vehicle.
        centre: Centre, north, east, down about the estimator's origin [m].
        radius: Radius [m], at least 1.
        rate: Turn rate [rad/s]; negative: anticlockwise.
    """

    def __init__(self, vehicle: AutopilotVehicle, centre: Vector, radius: float, rate: float) -> None:
        super().__init__(vehicle)
        self._centre, self._radius, self._rate = centre, max(1.0, radius), rate
        self._angle = 0.0
        self.turned = 0.0
        """Angle flown so far [rad]."""

    def enter(self) -> None:
        """Begin where the vehicle is."""
        self.target = self._centre
        self._angle = self._bearing()

    def raise_by(self, height: float) -> None:
        """Raise the circle [m]."""
        north, east, down = self._centre
        self._centre = self.target = (north, east, down - height)

    def _bearing(self) -> float:
        north, east, _ = self.vehicle.estimate.position
        return atan2(east - self._centre[1], north - self._centre[0])

    def step(self) -> None:
        """Fly along the tangent, with a correction towards the circle."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        north, east, _ = vehicle.estimate.position
        angle = self._bearing()
        passed = (angle - self._angle + pi) % (2.0 * pi) - pi
        self._angle = angle
        away = hypot(north - self._centre[0], east - self._centre[1])
        pull = self._radius - away
        if abs(pull) < 0.5 * self._radius:
            self.turned += abs(passed)
        fastest = sqrt(tuning.accel * self._radius)  # the largest centripetal acceleration
        along = max(-fastest, min(fastest, self._rate * self._radius))
        velocity = (pull * cos(angle) - along * sin(angle), pull * sin(angle) + along * cos(angle), 0.0)
        vehicle.drive(
            Setpoint(
                Control.VELOCITY_HEIGHT,
                position=self._centre,
                velocity=velocity,
                yaw=(angle + pi) if vehicle.commanded.yaw is None else vehicle.commanded.yaw,
                speed=vehicle.commanded.speed or tuning.speed,
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )


# --- legs of a multirotor ----------------------------------------------------------------------------------


def item_point(vehicle: AutopilotVehicle, item: MissionItem) -> Vector:
    """Return the point of an item; without coordinates or height, the vehicle's own."""
    here = vehicle.estimate.position
    point = vehicle.point(item.frame, item.x / 1e7, item.y / 1e7, item.z)
    if not item.has_place:
        return here[0], here[1], (point_height(vehicle, item) if item.z else here[2])
    return point if item.z else (point[0], point[1], here[2])


def point_height(vehicle: AutopilotVehicle, item: MissionItem) -> float:
    """Return an item's height as down about the estimator's origin [m]."""
    latitude, longitude, _ = vehicle.estimate.geodetic
    return vehicle.point(item.frame, latitude, longitude, item.z)[2]


def copter_leg(vehicle: AutopilotVehicle, item: MissionItem, goes_on: bool) -> Leg:
    """Return the leg of a multirotor for an item that navigates."""
    if item.command == TAKEOFF:
        return _take_off(vehicle, item)
    if item.command == LAND:
        return Leg(
            LandAt(vehicle, item_point(vehicle, item) if item.has_place else None), lambda: vehicle.landed
        )
    if item.command == RETURN:
        return Leg(ReturnAndLand(vehicle), lambda: vehicle.landed)
    if item.command == LOITER_TURNS:
        return _turns(vehicle, item)
    if item.command == DELAY:
        waiting = ToPoint(vehicle)
        return Leg(waiting, lambda: True, from_seconds(max(0.0, item.param1)))
    return _go(vehicle, item, goes_on)


def _take_off(vehicle: AutopilotVehicle, item: MissionItem) -> Leg:
    home = vehicle.home.ned[2] if vehicle.home else 0.0
    lowest = vehicle.height + (LEAST_CLIMB if vehicle.landed else 0.0)
    climbing = ClimbStraight(vehicle, max(lowest, home - point_height(vehicle, item)))
    return Leg(climbing, climbing.arrived)


def _go(vehicle: AutopilotVehicle, item: MissionItem, goes_on: bool) -> Leg:
    point = item_point(vehicle, item)
    here = vehicle.estimate.position
    away = hypot(point[0] - here[0], point[1] - here[1])
    facing = (
        bearing(here, point) if vehicle.tuning.face_path and away > vehicle.tuning.waypoint_radius else None
    )
    going = ToPoint(vehicle, point, facing)
    stay = from_seconds(max(0.0, item.param1)) if item.command in (WAYPOINT, LOITER_TIME) else 0
    if item.command == LOITER_UNLIMITED:
        stay = FOREVER
    return Leg(going, lambda: going.arrived(passing=goes_on), stay)


def _turns(vehicle: AutopilotVehicle, item: MissionItem) -> Leg:
    tuning = vehicle.tuning
    radius = abs(item.param3) or tuning.circle_radius
    rate = tuning.circle_rate * (-1.0 if item.param3 < 0.0 else 1.0)
    circling = FlyCircle(vehicle, item_point(vehicle, item), radius, rate)
    return Leg(circling, lambda: circling.turned >= 2.0 * pi * item.param1)


class LandAt(FlightManoeuvre):
    """Fly level to a point, then land there.

    Args:
        vehicle: The vehicle.
        point: The point; ``None``: land at the present position.
    """

    def __init__(self, vehicle: AutopilotVehicle, point: Vector | None) -> None:
        super().__init__(vehicle)
        self._landing = DescendAndLand(vehicle, point)
        self._going: ToPoint | None = None
        if point is not None:
            self._going = ToPoint(vehicle, (point[0], point[1], vehicle.estimate.position[2]))

    def enter(self) -> None:
        """Begin with the flight, or with the landing."""
        (self._going or self._landing).enter()
        self.target = self._going.target if self._going else None
        self.landing = self._going is None

    def step(self) -> None:
        """Fly, then descend."""
        if self._going is not None and self._going.arrived():
            self._going = None
            self._landing.enter()
            self.target = None
            self.landing = True
        (self._going or self._landing).step()
