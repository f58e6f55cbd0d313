"""PX4's missions: which items are accepted, how they are flown and reported."""

from __future__ import annotations

from itertools import takewhile

from volery.base.frames import Vector
from volery.base.time import from_seconds
from volery.links.mavlink_messages import constant
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import (
    FOREVER,
    Leg,
    MissionRules,
    item_point,
    point_height,
)
from volery.simulation.autopilots.manoeuvres.to_point import bearing
from volery.simulation.autopilots.mavlink.messages import Command
from volery.simulation.autopilots.onboard_mission import (
    CHANGE_SPEED,
    DELAY,
    GLOBAL,
    GLOBAL_INT,
    GLOBAL_RELATIVE,
    GLOBAL_RELATIVE_INT,
    JUMP,
    LAND,
    LOITER_TIME,
    LOITER_UNLIMITED,
    RETURN,
    SET_HOME,
    TAKEOFF,
    WAYPOINT,
    MissionItem,
)
from volery.simulation.autopilots.px4 import event_interface, modes
from volery.simulation.autopilots.px4.commands import on_return
from volery.simulation.autopilots.px4.flight_modes import Descent, Hold, Px4TakeOff
from volery.simulation.autopilots.px4.modes import commander_of
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, FlightManoeuvre
from volery.trace.events import CRITICAL, INFO

UNSUPPORTED_FRAME = constant("MAV_MISSION_UNSUPPORTED_FRAME")
UNSUPPORTED = constant("MAV_MISSION_UNSUPPORTED")

MISSION_FRAME = constant("MAV_FRAME_MISSION")

ROI_LOCATION, ROI_NONE, ROI = 195, 197, 201
FLOWN = frozenset(
    {WAYPOINT, LOITER_UNLIMITED, LOITER_TIME, RETURN, LAND, TAKEOFF, DELAY, JUMP, CHANGE_SPEED}
    | {SET_HOME, ROI, ROI_LOCATION, ROI_NONE}
)
NO_DEVICE = frozenset({203, 205, 206, 211, 214, 530, 1000, 2000, 2001, 2500, 2501})
"""Items for cameras, mounts and grippers: stored, read back and passed; the original has none either."""

FRAMES = (GLOBAL, GLOBAL_INT, GLOBAL_RELATIVE, GLOBAL_RELATIVE_INT, MISSION_FRAME)

REACHED_AGAIN = 10
"""Number of repetitions of MISSION_ITEM_REACHED."""


def request_message(number: int) -> str:
    """Return the message that requests an item: the deprecated one for the first item."""
    return "MISSION_REQUEST" if number == 0 else "MISSION_REQUEST_INT"


def stored_item(item: MissionItem) -> MissionItem | int:
    """Return an item as sent, or the MAV_MISSION_RESULT that refuses it."""
    if item.command not in FLOWN | NO_DEVICE:
        return UNSUPPORTED
    return item if item.frame in FRAMES else UNSUPPORTED_FRAME


def report_refused_item(vehicle: AutopilotVehicle) -> None:
    """Report that an uploaded item is refused."""
    vehicle.send_text(CRITICAL, "IGN MISSION_ITEM: Invalid item\t")
    commander_of(vehicle).log.send(event_interface.ITEM_INVALID)


def give_up(vehicle: AutopilotVehicle) -> None:
    """Report that an upload has stopped; nothing is acknowledged."""
    vehicle.send_text(CRITICAL, "Operation timeout\t")
    commander_of(vehicle).log.send(event_interface.MISSION_TIMEOUT)


def item_done(vehicle: AutopilotVehicle, index: int, _item: MissionItem) -> None:
    """Send MISSION_ITEM_REACHED with its repetitions, which the next item that is reached ends."""
    commander, began = commander_of(vehicle), vehicle.kernel.now()
    if commander.version.counts_actions:
        following = vehicle.mission.items[index + 1 :]
        index += sum(1 for _ in takewhile(lambda one: one.command == RETURN or not one.navigates, following))
    commander.reached = index, began

    def send() -> None:
        if commander.reached == (index, began):
            vehicle.output.send_event("MISSION_ITEM_REACHED", {"seq": index})

    send()
    for again in range(1, REACHED_AGAIN + 1):
        vehicle.kernel.call_at(began + again * commander.version.mission_period, send)


def item_begins(vehicle: AutopilotVehicle, index: int, item: MissionItem) -> None:
    """Report that a mission begins, and the height of a take-off."""
    commander = commander_of(vehicle)
    commander.mission_finished, version = False, commander.version
    if index == 0 and version.mission_words:
        vehicle.send_text(INFO, "Executing Mission\t")
        commander.log.send(event_interface.MISSION_BEGINS)
    if item.command == TAKEOFF and vehicle.home is not None:
        above = vehicle.home.ned[2] - point_height(vehicle, item)
        begins = "Climb" if version.mission_words else "Takeoff"
        vehicle.send_text(INFO, f"{begins} to {above:.1f} meters above home\t")
        commander_of(vehicle).log.send(event_interface.MISSION_TAKEOFF, event_interface.float_argument(above))


def ended(vehicle: AutopilotVehicle) -> None:
    """Enter AUTO.LOITER after the mission."""
    _finish(vehicle)
    vehicle.kernel.call_at(vehicle.kernel.now(), lambda: _loiter(vehicle))


def _finish(vehicle: AutopilotVehicle) -> None:
    """Note and report that the mission has ended."""
    commander = commander_of(vehicle)
    commander.mission_finished = True
    commander.after_disarming = modes.LOITER
    if commander.version.mission_words:
        vehicle.send_text(INFO, f"Mission finished, {'landed' if vehicle.landed else 'loitering'}\t")
        commander.log.send(
            event_interface.MISSION_ENDED_LANDED if vehicle.landed else event_interface.MISSION_ENDED
        )


def _loiter(vehicle: AutopilotVehicle) -> None:
    if vehicle.armed and not vehicle.landed and vehicle.mode.number == modes.MISSION:
        commander_of(vehicle).continue_with(modes.LOITER)


def act(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    """Execute an item that does not navigate."""
    if item.command == CHANGE_SPEED and item.param2 > 0.0:
        vehicle.commanded.speed = item.param2
    elif item.command in (ROI, ROI_LOCATION):
        vehicle.commanded.look_at = item_point(vehicle, item)
    elif item.command == ROI_NONE:
        vehicle.commanded.look_at = None
    elif item.command == SET_HOME:
        here = item.param1 == 1.0
        latitude, longitude, amsl = (
            vehicle.estimate.geodetic if here else vehicle.flight.from_ned(item_point(vehicle, item))
        )
        vehicle.set_home(latitude, longitude, amsl, by_user=True)


MISSION_RULES = MissionRules(first_item=0, item_begins=item_begins, item_done=item_done, act=act, ended=ended)


class ReturnFromMission(FlightManoeuvre):
    """Item RETURN_TO_LAUNCH: enter AUTO.RTL."""

    def step(self) -> None:
        """Change the mode after the present step."""
        vehicle = self.vehicle
        vehicle.kernel.call_at(vehicle.kernel.now(), self._change)

    def _change(self) -> None:
        if self.vehicle.armed and self.vehicle.mode.number == modes.MISSION:
            _finish(self.vehicle)
            on_return(self.vehicle, _NO_COMMAND)


_NO_COMMAND = Command(RETURN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, GLOBAL_RELATIVE, is_int=False)


class MissionLand(FlightManoeuvre):
    """Fly level to a point and land there; without a point, land here."""

    def __init__(self, vehicle: AutopilotVehicle, point: Vector | None) -> None:
        super().__init__(vehicle)
        self._landing = Descent(vehicle, point)
        down = vehicle.estimate.position[2]
        self._going = None if point is None else Hold(vehicle, (point[0], point[1], down))

    def enter(self) -> None:
        """Start with the flight to the point, if there is one."""
        (self._going or self._landing).enter()
        self.landing = self._going is None

    def step(self) -> None:
        """Fly to the point, then descend."""
        if self._going is not None and self._going.near(1.0, 2.0):
            self._going = None
            self._landing.enter()
            self.landing = True
        (self._going or self._landing).step()


class FlyToItem(Hold):
    """Fly to the point of an item; from the ground, climb vertically to its height first."""

    def __init__(self, vehicle: AutopilotVehicle, point: Vector, yaw: float | None) -> None:
        super().__init__(vehicle, point, yaw)
        self.slow_start = True
        self._climbing: Px4TakeOff | None = Px4TakeOff(vehicle, point[2]) if vehicle.landed else None

    def enter(self) -> None:
        """Start with the climb, if the vehicle is on the ground."""
        super().enter()
        if self._climbing is not None:
            self._climbing.enter()

    def takeoff_requested(self) -> bool:
        """Return True: a mission takes off."""
        return True

    def step(self) -> None:
        """Climb, then fly to the point."""
        if self._climbing is not None and self._climbing.arrived():
            self._climbing = None
        self.taking_off = self._climbing is not None
        if self._climbing is not None:
            self._climbing.step()
        else:
            super().step()


def leg(vehicle: AutopilotVehicle, item: MissionItem, _goes_on: bool) -> Leg:
    """Return the leg of a multirotor for an item that navigates."""
    if item.command == TAKEOFF:
        climbing = Px4TakeOff(vehicle, point_height(vehicle, item))
        return Leg(climbing, climbing.arrived)
    if item.command == LAND:
        place = item_point(vehicle, item) if item.has_place else None
        return Leg(MissionLand(vehicle, place), lambda: vehicle.landed)
    if item.command == RETURN:
        return Leg(ReturnFromMission(vehicle), lambda: False)
    return _go(vehicle, item)


def _go(vehicle: AutopilotVehicle, item: MissionItem) -> Leg:
    p = vehicle.parameters
    point = vehicle.estimate.position if item.command == DELAY else item_point(vehicle, item)
    far = not Hold(vehicle, point).near(p["NAV_ACC_RAD"], 1e9)
    going = FlyToItem(vehicle, point, bearing(vehicle.estimate.position, point) if far else None)
    reach = item.param2 if item.command == WAYPOINT and item.param2 > 0.0 else p["NAV_ACC_RAD"]
    stay = from_seconds(max(0.0, item.param1)) if item.command in (WAYPOINT, LOITER_TIME, DELAY) else 0
    if item.command == LOITER_UNLIMITED:
        stay = FOREVER
    return Leg(going, lambda: going.near(reach, p["NAV_MC_ALT_RAD"]), stay)
