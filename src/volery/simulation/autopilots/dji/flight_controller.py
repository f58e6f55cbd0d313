"""Decisions of a DJI flight controller: SDK authority, motors, tasks, set-points, missions, batteries.

Requests return the answer of the aircraft as a code. Topics and services are not known here.
"""

from __future__ import annotations

from itertools import pairwise
from math import dist, hypot, inf, radians
from typing import Any

from volery.base.time import Ns, S, from_seconds
from volery.ros.messages.dji_constants import (
    A3,
    M100,
    M210,
    M300,
    M600,
    N3,
    NO_CODE,
    AuthorityAck,
    DisplayMode,
    FlightStatus,
    M100MotorsAck,
    M100Status,
    MissionAck,
    TaskAck,
)
from volery.simulation.autopilots.dji.gimbal import Gimbal
from volery.simulation.autopilots.dji.parameters import aircraft_type
from volery.simulation.autopilots.dji.sdk_commands import (
    GO_HOME_AT_END,
    LAND_AT_END,
    LONGEST_PATH_M,
    MAX_WAYPOINTS,
    NO_ACTION,
    NO_EXIT,
    YAW_BY_WAYPOINT,
    YAW_LOCKED,
    SdkControl,
    mission_items,
    mission_refusal,
    sdk_command,
)
from volery.simulation.autopilots.manoeuvres.to_point import DescendAndLand
from volery.simulation.autopilots.onboard_mission import GLOBAL_RELATIVE, MissionItem
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import INFO, WARNING

SWITCH, F_ABOVE, P_BELOW = 5, 1700, 1300
"""Channel of the mode switch, and its pulse widths [us] for F and P; A is between them."""
SWITCH_PULSES = {"P": 1000, "A": 1500, "F": 2000}
"""Pulse widths of the simulated transmitter by position of the mode switch [us]."""

GRANTS_AT = {A3: "P", N3: "P", M100: "F", M600: "PAF", M210: "PF", M300: "PF"}
"""Positions of the mode switch at which a program is given the authority, by type of aircraft."""

RC_LOST_AFTER: Ns = 3 * S
"""Time without a transmitter after which the aircraft acts."""
RC_LOST_HOVERS = 1
"""Value of RC_LOST_ACTION: it hovers."""
NO_RC_RADIUS_M, NO_RC_HEIGHT_M = 50.0, 30.0
"""Farthest distance from home, and greatest height, of a flight without a transmitter since power-on."""
BORDER_M = 1.0
"""Distance from a border at which a set-point that leads across it ends: assumed."""
HOME_IS_LEVEL, HOME_IS_UNKNOWN = 5, 0
"""``gps_health`` with the position trusted, and without."""
RANGE_M = 7.0
"""Greatest distance to the ground that the downward sensors of an M210 measure; beyond it latches."""
CONFIRM_BELOW_M = 0.7
"""Height at which a landing waits for a confirmation if LAND_WAITS says so."""

ENGINE_START_TIME: Ns = 2 * S
"""Time after the start of the motors in which ENGINE_START is shown: assumed."""
FINISHED_LANDING_TIME: Ns = 3 * S
"""Time after a landing in which an M100 shows FINISHED_LANDING: assumed."""

AUTONOMOUS_MODES = frozenset(
    {
        DisplayMode.AUTO_TAKEOFF,
        DisplayMode.AUTO_LANDING,
        DisplayMode.NAVI_GO_HOME,
        DisplayMode.FORCE_AUTO_LANDING,
    }
)
"""Modes that set-points do not end."""
LANDING_MODES = frozenset({DisplayMode.AUTO_LANDING, DisplayMode.FORCE_AUTO_LANDING})


class FlightController:
    """State that only this firmware keeps about a vehicle (``AutopilotVehicle.firmware_state``).

    ``has_authority`` is true while an onboard program has the SDK authority.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        self.vehicle = vehicle
        self._activates_at_power_on = False
        self._aircraft = vehicle.parameters.changes, aircraft_type(vehicle.parameters)
        vehicle.rc.transmitter[SWITCH - 1] = SWITCH_PULSES[GRANTS_AT[self.aircraft][0]]
        self.reset()

    def reset(self) -> None:
        """Reset to the state after power-on."""
        self.activated = self._activates_at_power_on
        self.has_authority = False
        self.reference: tuple[float, float, float] | None = None
        """Origin of the local position [deg, m AMSL], or None."""
        self.task: Any = None
        """Waypoint mission as uploaded, or None."""
        self.gimbal = Gimbal(self.vehicle.kernel)
        self.anomalies = 0
        self.landing_confirmed = False
        self._switch = self._switch_position()
        self._last_setpoint_ns: Ns = NEVER
        self._requested_by_sdk = False
        self._place: tuple[float, float] = (0.0, 0.0)
        self._range = 0.0
        self._low_battery_at: Ns = NEVER
        self._rc_lost_at: Ns = NEVER
        self._had_rc = False

    # -- reported state

    @property
    def aircraft(self) -> str:
        """Type of the aircraft, such as A3 or M100."""
        parameters = self.vehicle.parameters
        if self._aircraft[0] != parameters.changes:
            self._aircraft = parameters.changes, aircraft_type(parameters)
        return self._aircraft[1]

    @property
    def rc_connected(self) -> bool:
        """Whether the transmitter is received."""
        return self.vehicle.parameters["RC_CONNECTED"] > 0.0

    @property
    def without_rc(self) -> bool:
        """Whether there was no transmitter since power-on, so that the flight is limited."""
        return not self._had_rc and not self.rc_connected

    @property
    def mode(self) -> int:
        """Display mode."""
        vehicle = self.vehicle
        starting = (
            vehicle.armed
            and vehicle.landed
            and vehicle.kernel.now() - vehicle.arming.armed_at < ENGINE_START_TIME
        )
        return DisplayMode.ENGINE_START if starting else vehicle.mode.number

    @property
    def status(self) -> int:
        """Flight status, in the numbering of this type of aircraft."""
        vehicle = self.vehicle
        if self.aircraft == M100:
            return self._m100_status()
        if not vehicle.armed:
            return FlightStatus.STOPPED
        return FlightStatus.ON_GROUND if vehicle.landed else FlightStatus.IN_AIR

    def _m100_status(self) -> int:
        vehicle = self.vehicle
        if not vehicle.armed or vehicle.landed:
            if vehicle.armed and self._is(DisplayMode.AUTO_TAKEOFF):
                return M100Status.TAKING_OFF
            landed = (
                vehicle.ground.landed_at != NEVER
                and vehicle.kernel.now() - vehicle.ground.landed_at < FINISHED_LANDING_TIME
            )
            return M100Status.FINISHED_LANDING if landed else M100Status.ON_GROUND
        if self._is(DisplayMode.AUTO_TAKEOFF):
            return M100Status.TAKING_OFF
        return M100Status.LANDING if vehicle.mode.number in LANDING_MODES else M100Status.IN_AIR

    @property
    def gps_health(self) -> int:
        """GPS health, 0 to 5; 0 until the position is trusted, and again without satellites."""
        vehicle = self.vehicle
        good = vehicle.has_position and vehicle.estimate.fix_type >= 3
        return HOME_IS_LEVEL if good else HOME_IS_UNKNOWN

    def place(self) -> tuple[float, float, float]:
        """Return latitude, longitude [deg] and altitude [m] as they are reported.

        Without satellites the place stays as it was; the altitude, which is by pressure, goes on.
        """
        vehicle = self.vehicle
        if vehicle.uptime() < vehicle.rules.startup.origin_after:
            return 0.0, 0.0, 0.0
        latitude, longitude, amsl = vehicle.estimate.geodetic
        if vehicle.estimate.fix_type >= 3 and vehicle.estimate.position_ok:
            self._place = (latitude, longitude)
        return *self._place, amsl + vehicle.parameters["PRESSURE_OFFSET"]

    def height_below(self) -> float:
        """Return what ``height_above_takeoff`` shows: on an M210 the distance to the ground, or 0 [m]."""
        height = self.vehicle.height
        if self.aircraft == M100:
            return height
        if self.aircraft not in (M210, M300):
            return 0.0
        if height <= RANGE_M:
            self._range = height
        return self._range

    def _is(self, mode: DisplayMode) -> bool:
        return self.vehicle.mode.number == mode

    # -- requests of programs

    def activate(self) -> bool:
        """Accept any activation key."""
        self.activated = True
        return True

    def activate_at_power_on(self) -> None:
        """Activate now and after each power-on, as the node of 4.1 does."""
        self._activates_at_power_on = self.activated = True

    def set_authority(self, wanted: bool) -> int:
        """Give the authority to a program or take it back; the pilot's mode switch may refuse it."""
        if wanted and not self.activated:
            return NO_CODE
        allowed = GRANTS_AT[self.aircraft]
        if wanted and self._switch not in allowed:
            return AuthorityAck.NEEDS_F if allowed == "F" else AuthorityAck.NEEDS_P
        self.has_authority = wanted
        if not wanted and self._is(DisplayMode.NAVI_SDK_CTRL):
            self.hover()
        return AuthorityAck.OBTAINED if wanted else AuthorityAck.RELEASED

    def motors(self, on: bool) -> int:
        """Start or stop the motors; they stop on the ground only."""
        own = self.aircraft == M100
        if not self.has_authority:
            return M100MotorsAck.NEEDS_AUTHORITY if own else NO_CODE
        if not self.vehicle.landed:
            return M100MotorsAck.IN_AIR if own else TaskAck.IN_AIR
        if on == self.vehicle.armed:
            return M100MotorsAck.ALREADY_DONE if own else TaskAck.MOTORS_ON if on else TaskAck.MOTORS_OFF
        if not on:
            self.kill()
            return TaskAck.OK
        return TaskAck.OK if self._start_motors() else NO_CODE

    def kill(self) -> None:
        """Stop the motors, also in flight."""
        if self.vehicle.armed:
            self.vehicle.disarm()
            self.vehicle.send_text(INFO, "motors stopped")
            self.hover()

    def bars(self, north: float, east: float) -> bool:
        """Return whether motion in this direction leads into a no-fly zone, or too far without a transmitter.

        The aircraft brakes ahead of the border and hovers there.
        """
        vehicle, size = self.vehicle, hypot(north, east)
        if size == 0.0 or not vehicle.has_position:
            return False
        here, velocity = vehicle.estimate.position, vehicle.estimate.velocity
        square = velocity[0] * velocity[0] + velocity[1] * velocity[1]
        reach = (BORDER_M + square / (2.0 * vehicle.tuning.accel)) / size
        ahead = here[0] + reach * north, here[1] + reach * east
        middle, radius = self._no_fly_zone()
        closer = dist(ahead, middle) < dist(here[:2], middle)
        if closer and dist(ahead, middle) < radius:
            self._warn_once("a no-fly zone is ahead")
            return True
        if not self.without_rc or vehicle.home is None:
            return False
        home = vehicle.home.ned[:2]
        return dist(ahead, home) > NO_RC_RADIUS_M and dist(ahead, home) > dist(here[:2], home)

    @property
    def ceiling(self) -> float:
        """Greatest height above home of a set-point [m]; infinite with a transmitter."""
        return NO_RC_HEIGHT_M if self.without_rc else inf

    def _no_fly_zone(self) -> tuple[tuple[float, float], float]:
        """Return the middle of the no-fly zone, north and east, and its radius [m]; 0: none."""
        parameters = self.vehicle.parameters
        middle = parameters["NO_FLY_NORTH"], parameters["NO_FLY_EAST"]
        return middle, parameters["NO_FLY_RADIUS"]

    def _start_motors(self) -> bool:
        vehicle = self.vehicle
        if not vehicle.landed or not self.activated:
            return False
        middle, radius = self._no_fly_zone()
        if vehicle.has_position and dist(vehicle.estimate.position[:2], middle) < radius:
            vehicle.send_text(WARNING, "it stands in a no-fly zone")
            return False
        if vehicle.has_position:
            vehicle.set_home_here()
        vehicle.arm()
        vehicle.send_text(INFO, "motors started")
        return True

    def take_off(self) -> int:
        """Start the motors and climb to TAKEOFF_HEIGHT; only while the motors stand.

        With running motors an M100 accepts the task and does not fly it.
        """
        vehicle = self.vehicle
        if not vehicle.landed:
            return TaskAck.IN_AIR
        if vehicle.armed:
            return TaskAck.OK if self.aircraft == M100 else TaskAck.MOTORS_ON
        if not vehicle.has_position:
            return TaskAck.BAD_GPS
        if not self._start_motors():
            return NO_CODE
        self._enter(DisplayMode.AUTO_TAKEOFF, by_sdk=True)
        return TaskAck.OK

    def go_home(self, by_sdk: bool = True) -> int:
        """Climb, fly home and land; near home, land at once."""
        vehicle = self.vehicle
        home = vehicle.home
        if vehicle.landed:
            return TaskAck.NOT_IN_AIR
        if by_sdk and self._is(DisplayMode.FORCE_AUTO_LANDING):
            return TaskAck.ALREADY_RUNNING  # documented: a critical battery overrides the SDK; code assumed
        if home is None:
            return TaskAck.NO_HOME_POINT
        if not vehicle.has_position:
            return TaskAck.BAD_GPS
        north, east, _ = vehicle.estimate.position
        near = hypot(home.ned[0] - north, home.ned[1] - east) < vehicle.parameters["GO_HOME_NEAR"]
        self._enter(DisplayMode.AUTO_LANDING if near else DisplayMode.NAVI_GO_HOME, by_sdk=by_sdk)
        return TaskAck.OK

    def land(self, by_sdk: bool = True) -> int:
        """Land at the present position."""
        if self.vehicle.landed:
            return TaskAck.NOT_IN_AIR
        forced = by_sdk and self._is(DisplayMode.FORCE_AUTO_LANDING)
        if forced or (self._is(DisplayMode.AUTO_LANDING) and self._requested_by_sdk):
            return TaskAck.ALREADY_RUNNING
        self._enter(DisplayMode.AUTO_LANDING, by_sdk=by_sdk)
        return TaskAck.OK

    def confirm_landing(self) -> int:
        """Go on with a landing that waits at CONFIRM_BELOW_M."""
        if self.vehicle.mode.number not in LANDING_MODES:
            return TaskAck.NOT_RUNNING
        self.landing_confirmed = True
        return TaskAck.OK

    def interrupt(self, *modes: DisplayMode) -> int:
        """Hover if one of these modes is flown on request of a program."""
        if self.vehicle.mode.number not in modes or not self._requested_by_sdk:
            return TaskAck.NOT_RUNNING
        self.hover()
        return TaskAck.OK

    def brake(self) -> bool:
        """Stop and hover."""
        if self.vehicle.landed:
            return False
        self.hover()
        return True

    def hover(self) -> None:
        """Enter P_GPS, or ATTITUDE without a position or with the mode switch at A."""
        by_position = self._switch != "A" and self.vehicle.has_position
        self._enter(DisplayMode.P_GPS if by_position else DisplayMode.ATTITUDE)

    def set_reference(self) -> bool:
        """Set the origin of the local position here."""
        if self.gps_health == HOME_IS_UNKNOWN:
            return False
        self.reference = self.place()
        return True

    def handle_setpoint(self, numbers: tuple[float, ...], flag: int) -> None:
        """Follow a set-point; without authority or running motors it has no effect.

        Args:
            numbers: x, y, z and yaw as ``flag`` defines them.
            flag: Control flag of the onboard SDK.
        """
        vehicle = self.vehicle
        if not self.has_authority or not vehicle.armed or vehicle.mode.number in AUTONOMOUS_MODES:
            return
        command = sdk_command(numbers, flag, vehicle.estimate.position)
        if command is None:
            self._warn_once(f"set-points with flag 0x{flag:02X} are not flown here, or its numbers are none")
            return
        self._last_setpoint_ns = vehicle.kernel.now()
        if not self._is(DisplayMode.NAVI_SDK_CTRL):
            self._enter(DisplayMode.NAVI_SDK_CTRL, by_sdk=True)
        if isinstance(vehicle.manoeuvre, SdkControl):
            vehicle.manoeuvre.command = command
            vehicle.run_manoeuvre()

    def _warn_once(self, text: str) -> None:
        if text not in self.vehicle.reports.sent_once:
            self.vehicle.reports.sent_once.add(text)
            self.vehicle.send_text(WARNING, text)

    # -- missions

    def upload(self, task: Any, most: int = MAX_WAYPOINTS) -> int:
        """Replace the mission if it is valid and has at most so many waypoints."""
        if not self.has_authority:
            return MissionAck.NEEDS_AUTHORITY
        found = mission_refusal(task, most)
        code = NO_CODE if found else self._place_refusal(task)
        if code:
            why = found or MissionAck(code).name.lower().replace("_", " ")
            self.vehicle.send_text(WARNING, f"mission refused: {why}")
            return code
        self.task = task
        self.vehicle.mission.replace(mission_items(task))
        return MissionAck.OK

    def _place_refusal(self, task: Any) -> int:
        """Return the code for a mission that is too long, or too far without a transmitter; else OK."""
        vehicle = self.vehicle
        places = [
            vehicle.point(GLOBAL_RELATIVE, point.latitude, point.longitude, point.altitude)
            for point in task.mission_waypoint
        ]
        if sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(places)) > LONGEST_PATH_M:
            return MissionAck.PATH_TOO_LONG
        middle, radius = self._no_fly_zone()
        if any(_distance_to_leg(middle, a[:2], b[:2]) < radius for a, b in pairwise(places)):
            return MissionAck.CROSSES_NO_FLY_ZONE
        if not self.without_rc:
            return MissionAck.OK
        home = vehicle.home.ned if vehicle.home else vehicle.estimate.position
        if any(hypot(place[0] - home[0], place[1] - home[1]) > NO_RC_RADIUS_M for place in places):
            return MissionAck.FAR_FROM_HOME
        if any(point.altitude > NO_RC_HEIGHT_M for point in task.mission_waypoint):
            return MissionAck.TOO_HIGH
        return MissionAck.OK

    def _start_refusal(self, from_start: bool) -> int:
        """Return the code for a mission that cannot be started; else OK."""
        vehicle = self.vehicle
        checks = (
            (not self.has_authority, MissionAck.NEEDS_AUTHORITY),
            (self.task is None or (not from_start and vehicle.mission.complete), NO_CODE),
            (vehicle.landed, MissionAck.NOT_TAKEN_OFF),
            (self.gps_health == HOME_IS_UNKNOWN, MissionAck.BAD_GPS),
            (vehicle.mode.number in AUTONOMOUS_MODES, MissionAck.BUSY),
        )
        return next((code for found, code in checks if found), MissionAck.OK)

    def start_mission(self, *, from_start: bool) -> int:
        """Start the mission from its first point, or resume it; in flight only."""
        refusal = self._start_refusal(from_start)
        if refusal:
            return refusal
        vehicle = self.vehicle
        if from_start:
            vehicle.mission.restart()
        self._enter(DisplayMode.NAVI_MISSION, by_sdk=True)
        vehicle.commanded.speed = self.task.idle_velocity
        if self.task.yaw_mode == YAW_LOCKED:
            vehicle.commanded.yaw = vehicle.estimate.attitude[2]
        return MissionAck.OK

    def leave_mission(self) -> int:
        """Hover instead of the mission."""
        if not self._is(DisplayMode.NAVI_MISSION):
            return NO_CODE
        self.hover()
        return MissionAck.OK

    def mission_speed(self, metres_per_second: float) -> int:
        """Set the speed of the mission [m/s]."""
        if self.task is None:
            return NO_CODE
        self.task.idle_velocity = metres_per_second
        if self._is(DisplayMode.NAVI_MISSION):
            self.vehicle.commanded.speed = metres_per_second
        return MissionAck.OK

    def item_begins(self, number: int, _item: MissionItem) -> None:
        """Turn to the heading of the waypoint, if the mission defines headings."""
        if self.task is not None and self.task.yaw_mode == YAW_BY_WAYPOINT:
            point = self.task.mission_waypoint[number % len(self.task.mission_waypoint)]
            self.vehicle.commanded.yaw = radians(point.target_yaw)

    def mission_ended(self) -> None:
        """Execute the action at the end of the mission."""
        finish = self.task.action_on_finish if self.task is not None else NO_ACTION
        if finish == GO_HOME_AT_END:
            self.go_home()
        elif finish == LAND_AT_END:
            self.land()
        elif finish != NO_EXIT:
            self.hover()

    # -- automatic actions

    def step(self) -> None:
        """Run the automatic actions, ten times a second."""
        self._read_switch()
        self._watch_transmitter()
        if not self.vehicle.armed:
            self._low_battery_at = NEVER
            return
        if self.vehicle.landed:
            self._stop_motors_automatically()
        else:
            self._update_flight()

    def _read_switch(self) -> None:
        """Read the mode switch; any change withdraws the authority, and in flight the aircraft hovers."""
        now = self._switch_position()
        if now == self._switch:
            return
        self._switch = now
        self.has_authority = False
        self.vehicle.send_text(INFO, f"the mode switch is at {now}")
        if self.vehicle.armed and not self.vehicle.landed:
            self.hover()

    def _switch_position(self) -> str:
        pulse = self.vehicle.rc[SWITCH]
        return "F" if pulse > F_ABOVE else "P" if pulse < P_BELOW else "A"

    def _watch_transmitter(self) -> None:
        """Go home or hover once the transmitter has been lost for RC_LOST_AFTER; set-points do not end it."""
        vehicle, now = self.vehicle, self.vehicle.kernel.now()
        if self.rc_connected:
            self._had_rc, self._rc_lost_at = True, NEVER
            return
        if not self._had_rc:
            return
        if self._rc_lost_at == NEVER:
            self._rc_lost_at = now
            vehicle.send_text(WARNING, "transmitter lost")
        flies = vehicle.armed and not vehicle.landed
        if not flies or now - self._rc_lost_at < RC_LOST_AFTER or vehicle.mode.number in AUTONOMOUS_MODES:
            return
        if round(vehicle.parameters["RC_LOST_ACTION"]) != RC_LOST_HOVERS:
            self.go_home(by_sdk=False)

    def _update_flight(self) -> None:
        vehicle = self.vehicle
        number, manoeuvre = vehicle.mode.number, vehicle.manoeuvre
        timeout = from_seconds(vehicle.parameters["SETPOINT_TIMEOUT"])
        self._act_on_low_battery()
        if number == DisplayMode.NAVI_SDK_CTRL:
            if vehicle.kernel.now() - self._last_setpoint_ns > timeout:
                self.hover()
        elif number == DisplayMode.AUTO_TAKEOFF:
            if vehicle.height > vehicle.parameters["TAKEOFF_HEIGHT"] - 0.1:
                self.hover()
        elif number == DisplayMode.NAVI_GO_HOME:
            if manoeuvre.landing:
                self._enter(DisplayMode.AUTO_LANDING, by_sdk=self._requested_by_sdk)
                if isinstance(vehicle.manoeuvre, DescendAndLand) and vehicle.home is not None:
                    vehicle.manoeuvre.point = vehicle.home.ned
        elif number == DisplayMode.P_GPS and not vehicle.has_position:
            vehicle.send_text(WARNING, "position lost")
            self.hover()
        elif number == DisplayMode.ATTITUDE and vehicle.has_position and self._switch != "A":
            self.hover()

    def _stop_motors_automatically(self) -> None:
        vehicle = self.vehicle
        now, parameters = vehicle.kernel.now(), vehicle.parameters
        number = vehicle.mode.number
        if number in LANDING_MODES and now - vehicle.ground.landed_at >= from_seconds(
            parameters["LANDED_STOP"]
        ):
            self.kill()
            return
        if vehicle.manoeuvre.takeoff_requested():
            vehicle.ground.idle_since = now
        elif now - vehicle.ground.idle_since >= from_seconds(parameters["IDLE_STOP"]):
            self.kill()

    def low_battery(self) -> None:
        """Report a low battery; after LOW_BATTERY_DELAY the aircraft goes home."""
        self.vehicle.send_text(WARNING, "battery low")
        self._low_battery_at = self.vehicle.kernel.now()

    def _act_on_low_battery(self) -> None:
        vehicle = self.vehicle
        delay = vehicle.seconds_parameter("LOW_BATTERY_DELAY")
        if self._low_battery_at == NEVER or vehicle.kernel.now() - self._low_battery_at < delay:
            return
        self._low_battery_at = NEVER
        if vehicle.mode.number not in LANDING_MODES:
            self.go_home(by_sdk=False)

    def critical_battery(self) -> None:
        """Report a critical battery and land."""
        self.vehicle.send_text(WARNING, "battery critical")
        if self.vehicle.armed and not self.vehicle.landed:
            self._enter(DisplayMode.FORCE_AUTO_LANDING)

    def _enter(self, mode: DisplayMode, *, by_sdk: bool = False) -> None:
        self._requested_by_sdk = by_sdk
        self.landing_confirmed = False
        self.vehicle.enter_mode(self.vehicle.rules.modes[mode])


def _distance_to_leg(point: tuple[float, float], start: tuple[float, ...], end: tuple[float, ...]) -> float:
    """Return the distance of a point from a straight leg [m]."""
    north, east = end[0] - start[0], end[1] - start[1]
    square = north * north + east * east
    along = (point[0] - start[0]) * north + (point[1] - start[1]) * east
    share = min(1.0, max(0.0, along / square)) if square else 0.0
    return dist(point, (start[0] + share * north, start[1] + share * east))


def controller_of(vehicle: AutopilotVehicle) -> FlightController:
    """Return the flight controller of a vehicle."""
    controller: FlightController = vehicle.firmware_state
    return controller
