"""PX4's modes and its commander, which decides the mode that is flown and whether the vehicle may arm.

A mode is main mode and sub-mode in one number. A failsafe replaces the mode that is flown, not the requested
one: some failsafes return to the requested mode when their cause ends (the stream of OFFBOARD set-points),
the others only when the user requests a mode, moves the sticks or disarms.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import dist

from volery.base.frames import Vector
from volery.base.time import MS, Ns, S
from volery.kernel.api import Handle
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import item_point
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, TEMPORARILY_REJECTED, UNSUPPORTED
from volery.simulation.autopilots.mavlink.microservices import FENCE
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.px4 import event_interface
from volery.simulation.autopilots.px4.external_vision import ExternalVision
from volery.simulation.autopilots.px4.geofence import fence_breach
from volery.simulation.autopilots.px4.home_correction import HomeCorrection
from volery.simulation.autopilots.px4.offboard import ManualControlState, OffboardSetpoints
from volery.simulation.autopilots.px4.position_control import PositionLoops
from volery.simulation.autopilots.px4.simulated_faults import FaultInjector
from volery.simulation.autopilots.px4.versions import ALTITUDE_CRUISE, EXTERNAL, POSITION_SLOW, Px4Version
from volery.simulation.autopilots.state_groups import NEVER, Home
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, FlightManoeuvre, Mode
from volery.trace.events import CRITICAL, INFO

CUSTOM, AUTO, GUIDED, STABILIZED, MANUAL_INPUT = 1, 4, 8, 16, 64
"""MAV_MODE_FLAG."""

AUTO_BITS = CUSTOM | AUTO | GUIDED | STABILIZED
MANUAL_BITS = CUSTOM | STABILIZED | MANUAL_INPUT
RATE_BITS = CUSTOM | MANUAL_INPUT
OFFBOARD_BITS = CUSTOM | STABILIZED
"""``base_mode`` of a disarmed vehicle, as recorded."""


def custom_mode(main: int, sub: int = 0) -> int:
    """Return ``custom_mode`` of the heartbeat."""
    return sub << 24 | main << 16


def main_and_sub(number: int) -> tuple[int, int]:
    """Return main mode and sub-mode of a ``custom_mode``."""
    return number >> 16 & 0xFF, number >> 24 & 0xFF


MANUAL, ALTCTL, POSCTL = custom_mode(1), custom_mode(2), custom_mode(3)
ORBIT, ACRO, OFFBOARD, STABILIZE = custom_mode(3, 1), custom_mode(5), custom_mode(6), custom_mode(7)
TAKEOFF, LOITER, MISSION = custom_mode(4, 2), custom_mode(4, 3), custom_mode(4, 4)
RTL, LAND, FOLLOW = custom_mode(4, 5), custom_mode(4, 6), custom_mode(4, 8)
TERMINATION = custom_mode(10)

NEEDS_STICKS = frozenset({MANUAL, ALTCTL, POSCTL, ACRO, STABILIZE})
"""Modes that cannot be armed, or entered in flight, without MANUAL_CONTROL."""

AUTOMATIC = frozenset({TAKEOFF, LOITER, MISSION, RTL, LAND, ORBIT, FOLLOW})
"""Modes that moved sticks take over."""

_MODES = (
    Mode(MANUAL, "MANUAL", MANUAL_BITS, FlightManoeuvre, pilot=True),
    Mode(ALTCTL, "ALTCTL", MANUAL_BITS, FlightManoeuvre, pilot=True),
    Mode(POSCTL, "POSCTL", MANUAL_BITS, FlightManoeuvre, pilot=True),
    Mode(ORBIT, "ORBIT", OFFBOARD_BITS, FlightManoeuvre, needs_position=True, armable=False),
    Mode(ACRO, "ACRO", RATE_BITS, FlightManoeuvre, pilot=True),
    Mode(OFFBOARD, "OFFBOARD", OFFBOARD_BITS, FlightManoeuvre, needs_position=True),
    Mode(STABILIZE, "STABILIZED", MANUAL_BITS, FlightManoeuvre, pilot=True),
    Mode(TAKEOFF, "AUTO.TAKEOFF", AUTO_BITS, FlightManoeuvre, needs_position=True),
    Mode(LOITER, "AUTO.LOITER", AUTO_BITS, FlightManoeuvre, needs_position=True),
    Mode(MISSION, "AUTO.MISSION", AUTO_BITS, FlightManoeuvre, needs_position=True),
    Mode(RTL, "AUTO.RTL", AUTO_BITS, FlightManoeuvre, needs_position=True, armable=False),
    Mode(LAND, "AUTO.LAND", AUTO_BITS, FlightManoeuvre, armable=False),
    Mode(FOLLOW, "AUTO.FOLLOW", OFFBOARD_BITS, FlightManoeuvre, needs_position=True, armable=False),
    Mode(TERMINATION, "TERMINATION", CUSTOM, FlightManoeuvre, armable=False),
)
"""What the kinds of vehicles share of each mode, without its manoeuvre."""


def mode_table(
    manoeuvres: Mapping[int, Callable[[AutopilotVehicle], FlightManoeuvre]], *, flies: bool
) -> dict[int, Mode]:
    """Return the modes of one kind of vehicle.

    Args:
        manoeuvres: Manoeuvre by mode; the vehicle has no other modes.
        flies: Whether sticks command thrust and POSCTL needs a position, as on a multirotor.
    """
    return {
        mode.number: replace(
            mode,
            manoeuvre=manoeuvres[mode.number],
            manual_throttle=flies and mode.number in (MANUAL, ACRO, STABILIZE),
            needs_position=mode.needs_position or (flies and mode.number == POSCTL),
        )
        for mode in _MODES
        if mode.number in manoeuvres
    }


FORCE = 21_196

OFFBOARD_LOST, STICKS_LOST, LINK_LOST, POSITION_LOST = "offboard", "sticks", "link", "position"
OUTSIDE_FENCE = "geofence"
BATTERY_CRITICAL, BATTERY_EMERGENCY = "battery critical", "battery emergency"
"""Names of failsafes."""

TAKEN_OVER = frozenset({STICKS_LOST, LINK_LOST, OUTSIDE_FENCE, BATTERY_CRITICAL, BATTERY_EMERGENCY})
"""Failsafes that a mode of the user ends for as long as their cause lasts; the status stays critical.

Recorded of lost sticks; the others follow the documentation.
"""

READY_AFTER: Ns = 8_600 * MS
"""Recorded: armable 8.56 to 9.16 s after boot."""

ATTITUDE_AFTER: Ns = 6_400 * MS
STARTED_AFTER: Ns = 4_000 * MS
HOME_CHECK_FROM: Ns = 10_000 * MS
"""From then on a missing home position is reported; the recorded reports of a boot do not contain it."""

REPORT_FROM: Ns = 2_084 * MS
REPORT_EVERY: Ns = 2_000 * MS
REFUSALS_EVERY: Ns = S
"""Time after the report of a refused mode for which others are refused without a report."""

RETURN_CHECKED_EVERY: Ns = 2_000 * MS
"""Period at which the destination of a return is taken from the home position, while no return is flown."""

RANGE_STREAM = 11
"""Stream of noise that decides on ``reads_range``."""

THREE_IN_FIVE = 0.8416
"""Deviation within which three of five draws are.

EKF2 works in steps of 8 ms in SIH; samples of its range finder and cycles of the flight tasks are 20 ms
apart. So EKF2 states a valid height by the range finder in two of five steps, and the tasks read two of five.
In three of their five positions to each other they meet, and the landing ends at MPC_LAND_CRWL. Logged: 14 of
35 landings, 11 of the 20 that had a noise of their own.
"""

THROTTLE_HIGH = 0.2
"""Throttle that refuses arming, above the centre of the stick; in modes that command thrust, above its low
end.
"""


class CommanderState:
    """State that only PX4 keeps about a vehicle (``AutopilotVehicle.firmware_state``).

    Args:
        vehicle: The vehicle.
        version: Version of the firmware.
    """

    def __init__(self, vehicle: AutopilotVehicle, version: Px4Version) -> None:
        self.vehicle = vehicle
        self.version = version
        self.reset()

    def reset(self) -> None:
        """Reset to the state after a boot."""
        self.faults, self.vision = FaultInjector(self.vehicle), ExternalVision(self.vehicle)
        self._forget_mission()
        self._refused_at: Ns = NEVER
        self.joystick = ManualControlState()
        self.stream = OffboardSetpoints()
        self.control = PositionLoops(self.vehicle)
        self.log = event_interface.EventBuffer(self.vehicle, self.version.events)
        self.home_correction = HomeCorrection(self.vehicle) if self.version.corrects_home else None
        self.requested = LOITER
        """Mode that the user requested."""
        self.after_disarming = LOITER
        self.failsafe = ""
        """Name of the active failsafe, or empty."""
        self.taken_over = ""
        """Name of the failsafe that the user ended while its cause lasted, or empty."""
        self.failsafe_mode: int | None = None
        """Mode that the failsafe flies; None: the requested one."""
        self.descending = False
        """Whether AUTO.LAND is the level descent without a position."""
        self.takeoff_amsl: float | None = None
        """Commanded altitude of the next take-off [m], or None."""
        self.minimum_height = 0.0
        """Height [m] to which the next take-off was raised, or 0."""
        self.orbit: tuple[Vector, float, float] | None = None
        """Centre, radius [m] and speed [m/s] of a circle."""
        self.terminated = False
        """Whether the motors are stopped until a boot, or in 1.14 until a command."""
        self.hold_delay_left = -1.0
        """Remaining hold before a failsafe acts [s]; negative: all of COM_FAIL_ACT_T."""
        self.hold_until: Ns = NEVER
        self.after_hold = 0
        self.calibration: list[Handle] = []
        """Steps of the calibration in hand that are still to come."""
        self.station_seen: Ns = NEVER
        self.ground = 0.0
        """Height of the ground at arming, down about the estimator's origin [m]."""
        self.reads_range = False
        """Whether the flight tasks see the height that EKF2 states by the range finder."""
        self.lifted_at: Ns = NEVER
        """Time of the last lift-off."""
        self.flying = False
        self.took_off = False
        self.landed_at: Ns = NEVER
        self.reported: event_interface.ArmingChecks | None = None
        self.reported_at: Ns = NEVER
        self.last_step: Ns = NEVER
        self.return_to: Home | None = None
        """Destination of a return: the home position as of the last check."""
        self._return_checked: Ns = NEVER

    def _forget_mission(self) -> None:
        """Reset what is known of the mission, which is examined anew."""
        self._examined: tuple[list[MissionItem], list[MissionItem] | None] | None = None
        """Mission and fence that were examined last."""
        self.has_mission = False
        """Whether there is a mission that was found feasible when it was examined: at the first tick after it
        or the fence arrived.
        """
        self.mission_finished = False
        """Whether the mission, a take-off or a landing has ended since the mission arrived."""
        self.reached: tuple[int, Ns] | None = None
        """Mission item that was reached last, and when."""

    # -- state

    @property
    def above_ground(self) -> float:
        """Height above the place of arming [m]; the ground is flat."""
        return self.ground - self.vehicle.estimate.position[2]

    @property
    def ready(self) -> bool:
        """Whether sensors and estimator allow arming."""
        vehicle = self.vehicle
        return vehicle.home is not None and vehicle.has_position

    def stream_alive(self) -> bool:
        """Return whether the stream of OFFBOARD set-points is younger than COM_OF_LOSS_T."""
        vehicle = self.vehicle
        return self.stream.alive(vehicle.kernel.now(), vehicle.seconds_parameter("COM_OF_LOSS_T"))

    @property
    def has_sticks(self) -> bool:
        """Whether manual control has been taken in."""
        return self.joystick.taken_in(self.vehicle.kernel.now())

    @property
    def mission_required(self) -> bool:
        """Whether arming needs a mission on board (COM_ARM_MIS_REQ)."""
        return self.vehicle.parameters["COM_ARM_MIS_REQ"] != 0.0

    def examine_mission(self) -> None:
        """Examine the mission, if it or the uploaded fence is another one."""
        vehicle = self.vehicle
        items, fence = vehicle.mission.items, vehicle.points.get(FENCE)
        if self._examined is not None and items is self._examined[0] and fence is self._examined[1]:
            return
        if self._examined is None or items is not self._examined[0]:
            self.mission_finished, self.reached = False, None
        self._examined = items, fence
        self.has_mission = bool(items) and self._first_is_near(items) and self._is_within(items)

    def _is_within(self, items: list[MissionItem]) -> bool:
        """Return whether a mission is within the fence, whatever GF_ACTION is, and say what is not."""
        vehicle = self.vehicle
        for place, item in enumerate(items, start=1):
            if item.has_place and item.navigates and fence_breach(vehicle, item_point(vehicle, item)):
                vehicle.send_text(CRITICAL, f"Geofence violation for waypoint {place}\t")
                self.log.send(event_interface.MISSION_OUTSIDE, struct.pack("<h", place))
                return False
        return True

    def _first_is_near(self, items: list[MissionItem]) -> bool:
        vehicle = self.vehicle
        most = vehicle.parameters["MIS_DIST_1WP"]
        first = next((item for item in items if item.navigates and item.has_place), None)
        if first is None or most <= 0.0 or not vehicle.has_position:
            return True
        return dist(item_point(vehicle, first)[:2], vehicle.estimate.position[:2]) < most

    def checks(self) -> event_interface.ArmingChecks:
        """Return the results of the arming checks."""
        vehicle = self.vehicle
        age = vehicle.uptime()
        return event_interface.ArmingChecks(
            started=age >= STARTED_AFTER,
            attitude=age >= ATTITUDE_AFTER,
            position=self.ready,
            sticks=self.has_sticks,
            mission=self.has_mission,
            mission_required=self.mission_required,
            home=vehicle.home is not None or age < HOME_CHECK_FROM,
            offboard=self.stream_alive(),
            mode=vehicle.armed or vehicle.rules.modes[self.requested].armable,
        )

    def can_fly(self, number: int) -> bool:
        """Return whether the requirements of a mode are met."""
        vehicle = self.vehicle
        mode = vehicle.rules.modes[number]
        if vehicle.mode.number == TERMINATION:
            return False
        if mode.needs_position and not vehicle.has_position:
            return False
        if number in NEEDS_STICKS and not self.has_sticks:
            return False
        if number == OFFBOARD and not self.stream_alive():
            return False
        return number != MISSION or self.has_mission

    # -- modes

    def request_mode(self, number: int, *, says_why: bool = True) -> int:
        """Enter a mode on request of the user, and return a MAV_RESULT.

        A disarmed vehicle accepts every mode. A terminated one stays so.

        Args:
            number: ``custom_mode``.
            says_why: Whether a text and an event report a refusal.
        """
        vehicle = self.vehicle
        known = number in vehicle.rules.modes and number != TERMINATION
        refused = main_and_sub(number) in self.version.refused_modes
        if vehicle.mode.number == TERMINATION:
            return TEMPORARILY_REJECTED
        if not vehicle.armed and not known:
            return ACCEPTED
        if vehicle.armed and (refused or (known and not self.can_fly(number))):
            if says_why:
                self._report_refusal(number)
            return TEMPORARILY_REJECTED
        if not known:
            return UNSUPPORTED
        self._accept_mode(number)
        return ACCEPTED

    def _report_refusal(self, number: int) -> None:
        """Report that a mode is not available, at most once a second."""
        now = self.vehicle.kernel.now()
        if self._refused_at != NEVER and now - self._refused_at <= REFUSALS_EVERY:
            return
        self._refused_at = now
        asked = main_and_sub(number)
        words = f"Switching to {self.version.words[asked]} is currently not available\t"
        self.vehicle.send_text(CRITICAL, words)
        self.log.send(event_interface.MODE_REFUSED, bytes((0, 0, *asked, MODES_IN_EVENTS[asked])))

    def _accept_mode(self, number: int) -> None:
        self.requested = number
        self._keep_for_disarming(number)
        if self.failsafe in TAKEN_OVER:
            self.taken_over = self.failsafe
        self.end_failsafe()
        self.joystick.set_reference()
        self._fly(number)

    def _keep_for_disarming(self, number: int) -> None:
        """Remember a requested mode that may be armed as the one after disarming."""
        kept = number != TAKEOFF or self.version.keeps_takeoff
        if kept and self.vehicle.rules.modes[number].armable:
            self.after_disarming = number

    def _fly(self, number: int, restart: bool = False) -> None:
        mode = self.vehicle.rules.modes[number]
        if mode is not self.vehicle.mode or restart:
            self.vehicle.enter_mode(mode)

    def restart_mode(self, number: int) -> None:
        """Enter a mode again because its target has changed."""
        again = self.vehicle.mode.number == number and self.failsafe_mode is None
        self._accept_mode(number)
        if again:
            self._fly(number, restart=True)

    def continue_with(self, number: int) -> None:
        """Enter the mode that follows after a mode has ended."""
        self.requested = number
        self._keep_for_disarming(number)
        self.joystick.set_reference()
        self._fly(number)

    # -- failsafes

    def begin_failsafe(self, name: str, number: int) -> None:
        """Fly a mode instead of the requested one."""
        self.failsafe, self.failsafe_mode = name, number
        self.joystick.set_reference()
        self._fly(number)

    def end_failsafe(self) -> None:
        """Clear the failsafe after its cause ended or the user took over."""
        self.failsafe, self.failsafe_mode, self.hold_until = "", None, NEVER
        self.descending = False

    def resume_requested(self) -> None:
        """Fly the requested mode again."""
        self.end_failsafe()
        self.joystick.set_reference()
        self._fly(self.requested)

    def pilot_takes_over(self) -> None:
        """Enter POSCTL because the sticks moved in an automatic mode."""
        if self.failsafe:
            self.log.send(event_interface.PILOT_TOOK_OVER)
        else:
            self.vehicle.send_text(INFO, "Pilot took over using sticks\t")
        self._accept_mode(POSCTL)

    # -- arming

    def arm(self, *, for_mission: bool = False) -> int:
        """Arm by command, and return a MAV_RESULT. No command from outside skips the checks.

        Reasons of a refusal appear in events, except for the throttle.

        Args:
            for_mission: The command is MISSION_START.
        """
        vehicle = self.vehicle
        if vehicle.armed:
            return ACCEPTED
        if self._throttle_is_high():
            vehicle.send_text(CRITICAL, "Arming denied: throttle above center\t")
            self.log.send(event_interface.THROTTLE_HIGH)
            return TEMPORARILY_REJECTED
        if not self.armable:
            vehicle.arming.refused_at = vehicle.kernel.now()
            if self.version.says_failing_checks:
                vehicle.send_text(CRITICAL, "Arming denied: Resolve system health failures first\t")
                self.log.send(event_interface.ARMING_DENIED)
            return TEMPORARILY_REJECTED
        if vehicle.has_position and not (vehicle.home and vehicle.home.by_user):
            vehicle.set_home_here()
        self.joystick.lost_when_armed = not self.has_sticks
        self.joystick.set_reference()
        self.took_off = False
        self.lifted_at = NEVER
        self.ground = vehicle.estimate.position[2]
        self.reads_range = abs(vehicle.flight.draw(RANGE_STREAM, vehicle.kernel.now() // MS)) < THREE_IN_FIVE
        vehicle.arm()
        vehicle.send_text(INFO, f"Armed by {'mission start' if for_mission else 'external command'}\t")
        reason = event_interface.BY_MISSION if for_mission else event_interface.BY_COMMAND
        self.log.send(event_interface.ARMED, reason)
        self.report_minimum_height()
        return ACCEPTED

    def report_minimum_height(self) -> None:
        """Report once that a take-off was raised to the minimum height."""
        if self.minimum_height and self.requested == TAKEOFF:
            words = self.version.takeoff_words.format(self.minimum_height)
            self.vehicle.send_text(INFO, f"{words}\t")
            self.log.send(
                event_interface.MINIMUM_TAKEOFF, event_interface.float_argument(self.minimum_height)
            )
        self.minimum_height = 0.0

    @property
    def armable(self) -> bool:
        """Whether the checks allow arming in the requested mode (COM_ARM_WO_GPS included)."""
        mode = self.vehicle.rules.modes[self.requested]
        if self.terminated or not mode.armable or not self.can_fly(self.requested):
            return False
        if self.mission_required and not self.has_mission:
            return False
        vehicle = self.vehicle
        if vehicle.estimate.battery_left < vehicle.parameters["BAT_CRIT_THR"]:
            return False
        if vehicle.parameters["GF_ACTION"] and fence_breach(vehicle, vehicle.estimate.position):
            return False
        if self.ready:
            return True
        without_position = self.vehicle.parameters["COM_ARM_WO_GPS"] != 0.0
        return not mode.needs_position and without_position and self.checks().attitude

    def _throttle_is_high(self) -> bool:
        if not self.has_sticks or self.requested not in NEEDS_STICKS:
            return False
        by_thrust = self.vehicle.flies and self.requested in (MANUAL, STABILIZE, ACRO)
        return self.joystick.now.throttle > (THROTTLE_HIGH - 1.0 if by_thrust else THROTTLE_HIGH)

    def stop_motors(self) -> None:
        """Stop the motors, armed or not; the vehicle stays armed and cannot be armed again."""
        self.terminated = True
        if self.vehicle.arming.motors_stopped_at == NEVER:
            self.vehicle.arming.motors_stopped_at = self.vehicle.kernel.now()
        self.vehicle.run_manoeuvre()

    def release_motors(self) -> None:
        """Let the motors turn again."""
        self.terminated = False
        self.vehicle.arming.motors_stopped_at = NEVER

    def terminate(self) -> None:
        """Enter the mode TERMINATION, which nothing leaves, and stop the motors."""
        self.end_failsafe()
        self.requested = self.after_disarming = TERMINATION
        self.stop_motors()
        self._fly(TERMINATION)

    def disarm(self, force: bool) -> int:
        """Disarm by command, and return a MAV_RESULT."""
        vehicle = self.vehicle
        if not vehicle.armed:
            return ACCEPTED
        in_air = not vehicle.landed or (self.terminated and self.flying)
        if vehicle.flies and in_air and not force:
            vehicle.send_text(CRITICAL, self.version.not_landed)
            self.log.send(event_interface.DISARM_REFUSED)
            return TEMPORARILY_REJECTED
        self.finish_disarming("external command", event_interface.BY_COMMAND)
        return ACCEPTED

    def finish_disarming(self, words: str, reason: bytes) -> None:
        """Disarm, report the reason, and return to an armable mode."""
        vehicle = self.vehicle
        if self.flying or self.took_off:
            self.mission_finished = self.mission_finished or vehicle.mode.number in (RTL, LAND)
        vehicle.disarm()
        vehicle.send_text(INFO, f"Disarmed by {words}\t")
        self.log.send(event_interface.DISARMED, reason)
        self.end_failsafe()
        self.taken_over = ""
        self.takeoff_amsl = None
        self.requested = self.after_disarming
        self._fly(self.requested)

    def check_return(self) -> None:
        """Take the destination of a return from the home position, from time to time and not in a return.

        A return that begins right after home was moved ends at the old one: measured on 1.14.
        """
        vehicle, now = self.vehicle, self.vehicle.kernel.now()
        due = self._return_checked == NEVER or now - self._return_checked >= RETURN_CHECKED_EVERY
        if self.return_to is None or (due and vehicle.mode.number != RTL):
            self.return_to, self._return_checked = vehicle.home, now

    # -- reports

    def report(self) -> None:
        """Send the arming checks if they changed, at most every two seconds."""
        vehicle = self.vehicle
        now = vehicle.kernel.now()
        if vehicle.uptime() < REPORT_FROM or now - self.reported_at < REPORT_EVERY:
            return
        found = self.checks()
        if found != self.reported:
            self.reported, self.reported_at = found, now
            for event, arguments in event_interface.arming_report(found):
                self.log.send(event, arguments)


MODES_IN_EVENTS: Mapping[tuple[int, int], int] = {
    (1, 0): 0,
    (2, 0): 1,
    (3, 0): 2,
    (4, 4): 3,
    (4, 3): 4,
    (4, 5): 5,
    (5, 0): 6,
    (6, 0): 7,
    (7, 0): 8,
    POSITION_SLOW: 9,
    (4, 2): 10,
    (4, 6): 11,
    (4, 8): 12,
    (3, 1): 14,
    **{mode: 16 + place for place, mode in enumerate(EXTERNAL)},
    ALTITUDE_CRUISE: 24,
}
"""``navigation_mode_t`` of the event interface, by main mode and sub-mode."""


def commander_of(vehicle: AutopilotVehicle) -> CommanderState:
    """Return the commander of a vehicle."""
    commander: CommanderState = vehicle.firmware_state
    return commander
