"""PX4's modes as the wire knows them: main mode and sub-mode in one number, bits of the heartbeat, words.

PX4's commander: who decides the mode. The user's wish, and what a failsafe makes of it.

A failsafe replaces the mode that is flown, not the one that was wished for: when its cause goes away, some
give the wished mode back by themselves (the stream of OFFBOARD set-points is there again), others only when
the user asks for a mode, moves the sticks or disarms.
"""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.frames import Vector
from volery.base.time import MS, Ns
from volery.simulation.autopilots.manual_control import NEVER
from volery.simulation.autopilots.mavlink.command import ACCEPTED, TEMPORARILY_REJECTED, UNSUPPORTED
from volery.simulation.autopilots.px4 import events
from volery.simulation.autopilots.px4.offboard import SetpointStream
from volery.simulation.autopilots.px4.pilot_input import Joystick
from volery.simulation.autopilots.vehicle_state import Vehicle

CUSTOM, AUTO, GUIDED, STABILIZED, MANUAL_INPUT = 1, 4, 8, 16, 64
"""MAV_MODE_FLAG."""

BY_ITSELF = CUSTOM | AUTO | GUIDED | STABILIZED
BY_HAND = CUSTOM | STABILIZED | MANUAL_INPUT
BY_RATES = CUSTOM | MANUAL_INPUT
BY_COMPUTER = CUSTOM | STABILIZED


def custom_mode(main: int, sub: int = 0) -> int:
    """``custom_mode`` of the heartbeat."""
    return sub << 24 | main << 16


def main_and_sub(number: int) -> tuple[int, int]:
    """The inverse of ``custom_mode``."""
    return number >> 16 & 0xFF, number >> 24 & 0xFF


MANUAL, ALTCTL, POSCTL = custom_mode(1), custom_mode(2), custom_mode(3)
ORBIT, ACRO, OFFBOARD, STABILIZE = custom_mode(3, 1), custom_mode(5), custom_mode(6), custom_mode(7)
TAKEOFF, LOITER, MISSION = custom_mode(4, 2), custom_mode(4, 3), custom_mode(4, 4)
RTL, LAND, FOLLOW = custom_mode(4, 5), custom_mode(4, 6), custom_mode(4, 8)

WORDS: Mapping[int, str] = {
    MANUAL: "MANUAL",
    ALTCTL: "ALTCTL",
    POSCTL: "POSCTL",
    ORBIT: "ORBIT",
    ACRO: "ACRO",
    OFFBOARD: "OFFBOARD",
    STABILIZE: "STAB",
    TAKEOFF: "AUTO_TAKEOFF",
    LOITER: "AUTO_LOITER",
    MISSION: "AUTO_MISSION",
    RTL: "AUTO_RTL",
    LAND: "AUTO_LAND",
    FOLLOW: "AUTO_FOLLOW_TARGET",
}
"""How a refusal names a mode: OFFBOARD as recorded, the others as the firmware's status names them."""

NEEDS_STICKS = frozenset({MANUAL, ALTCTL, POSCTL, ACRO, STABILIZE})
"""Cannot be armed, or entered in the air, without MANUAL_CONTROL."""

AUTOMATIC = frozenset({TAKEOFF, LOITER, MISSION, RTL, LAND, ORBIT, FOLLOW})
"""Moving the sticks takes these over."""

NAVIGATION_STATE: Mapping[int, int] = {
    MANUAL: 0,
    ALTCTL: 1,
    POSCTL: 2,
    MISSION: 3,
    LOITER: 4,
    RTL: 5,
    ACRO: 10,
    OFFBOARD: 14,
    STABILIZE: 15,
    TAKEOFF: 17,
    LAND: 18,
    FOLLOW: 19,
    ORBIT: 21,
}
"""Bits by which events name modes: ``nav_state`` of VehicleStatus."""

DESCEND_STATE = 12


CRITICAL, INFO = 2, 6
"""MAV_SEVERITY."""

FORCE = 21_196

READY_AFTER: Ns = 8_600 * MS
"""Recorded: armable 8.56 to 9.16 s after boot."""

ATTITUDE_AFTER: Ns = 6_400 * MS
STARTED_AFTER: Ns = 4_000 * MS
REPORT_FROM: Ns = 2_084 * MS
REPORT_EVERY: Ns = 2_000 * MS

THROTTLE_HIGH = 0.2
"""Of the stick's way above its centre, in modes that hold the climb rate; in the others above its low end."""


class Commander:
    """``Vehicle.firmware_state`` of a PX4."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.reset()

    def reset(self) -> None:
        """As after a boot."""
        self.joystick = Joystick()
        self.stream = SetpointStream()
        self.log = events.EventLog(self.vehicle)
        self.requested = LOITER
        """The mode that the user wants."""
        self.after_disarming = LOITER
        self.failsafe = ""
        """What replaces the wished mode now: its name, or nothing."""
        self.failsafe_mode: int | None = None
        """The mode that the failsafe flies; ``None``: the wished one."""
        self.descending = False
        """Whether AUTO.LAND stands for the blind descent without a position."""
        self.takeoff_amsl: float | None = None
        """Altitude of the next take-off, where one was commanded."""
        self.minimum_height = 0.0
        """Of the next take-off, where that was raised to the least one; 0: it was not."""
        self.orbit: tuple[Vector, float, float] | None = None
        """Centre, radius, speed of a circle."""
        self.hold_delay_left = -1.0
        """Seconds of Hold that a failsafe may still take; below 0: all of COM_FAIL_ACT_T."""
        self.hold_until: Ns = NEVER
        self.after_hold = 0
        self.station_seen: Ns = NEVER
        self.ground = 0.0
        """Down about the estimator's origin of the ground where it was armed."""
        self.lifted_at: Ns = NEVER
        """When it left the ground."""
        self.flying = False
        self.took_off = False
        self.landed_at: Ns = NEVER
        self.reported: events.ArmingChecks | None = None
        self.reported_at: Ns = NEVER
        self.last_step: Ns = NEVER

    # -- what there is

    @property
    def above_ground(self) -> float:
        """Metres above where it was armed: the ground is flat."""
        return self.ground - self.vehicle.estimate.position[2]

    @property
    def ready(self) -> bool:
        """Sensors and estimator would let it arm."""
        vehicle = self.vehicle
        return vehicle.home is not None and vehicle.has_position

    def stream_alive(self) -> bool:
        """Whether OFFBOARD may be flown."""
        vehicle = self.vehicle
        return self.stream.alive(vehicle.kernel.now(), vehicle.seconds_parameter("COM_OF_LOSS_T"))

    def checks(self) -> events.ArmingChecks:
        """What the report of the arming checks says."""
        vehicle = self.vehicle
        age = vehicle.uptime()
        return events.ArmingChecks(
            started=age >= STARTED_AFTER,
            attitude=age >= ATTITUDE_AFTER,
            position=self.ready,
            sticks=self.joystick.valid,
            mission=len(vehicle.mission) > 0,
            offboard=self.stream_alive(),
            mode=vehicle.armed or vehicle.rules.modes[self.requested].armable,
        )

    def can_fly(self, number: int) -> bool:
        """Whether that mode has what it needs."""
        vehicle = self.vehicle
        mode = vehicle.rules.modes[number]
        if mode.needs_position and not vehicle.has_position:
            return False
        if number in NEEDS_STICKS and not self.joystick.valid:
            return False
        if number == OFFBOARD and not self.stream_alive():
            return False
        return number != MISSION or len(vehicle.mission) > 0

    # -- modes

    def request_mode(self, number: int) -> int:
        """The user asks for a mode; returns a MAV_RESULT. Disarmed every mode is accepted."""
        vehicle = self.vehicle
        if number not in vehicle.rules.modes:
            return ACCEPTED if not vehicle.armed else UNSUPPORTED
        if vehicle.armed and not self.can_fly(number):
            vehicle.send_text(CRITICAL, f"Switching to {WORDS[number]} is currently not available\t")
            group = OFFBOARD_IN_EVENTS if number == OFFBOARD else POSITION_IN_EVENTS
            self.log.send(events.MODE_REFUSED, bytes((0, 0, group, 0, 7)))
            return TEMPORARILY_REJECTED
        self._accept_mode(number)
        return ACCEPTED

    def _accept_mode(self, number: int) -> None:
        vehicle = self.vehicle
        self.requested = number
        if vehicle.rules.modes[number].armable:
            self.after_disarming = number
        self.end_failsafe()
        self.joystick.set_reference()
        self._fly(number)

    def _fly(self, number: int, anew: bool = False) -> None:
        mode = self.vehicle.rules.modes[number]
        if mode is not self.vehicle.mode or anew:
            self.vehicle.enter_mode(mode)

    def restart_mode(self, number: int) -> None:
        """Fly that mode from its start, although it may be flown already: its aim has changed."""
        again = self.vehicle.mode.number == number and self.failsafe_mode is None
        self._accept_mode(number)
        if again:
            self._fly(number, anew=True)

    def continue_with(self, number: int) -> None:
        """A mode has ended; another one follows by itself."""
        self.requested = number
        if self.vehicle.rules.modes[number].armable:
            self.after_disarming = number
        self.joystick.set_reference()
        self._fly(number)

    # -- failsafes

    def begin_failsafe(self, name: str, number: int) -> None:
        """Fly that mode instead of the wished one."""
        self.failsafe, self.failsafe_mode = name, number
        self.joystick.set_reference()
        self._fly(number)

    def end_failsafe(self) -> None:
        """Its cause is gone, or somebody took over."""
        self.failsafe, self.failsafe_mode, self.hold_until = "", None, NEVER
        self.descending = False

    def resume_requested(self) -> None:
        """Fly the wished mode again."""
        self.end_failsafe()
        self.joystick.set_reference()
        self._fly(self.requested)

    def pilot_takes_over(self) -> None:
        """The sticks moved in a mode that flies by itself."""
        if self.failsafe:
            self.log.send(events.PILOT_TOOK_OVER)
        else:
            self.vehicle.send_text(INFO, "Pilot took over using sticks\t")
        self._accept_mode(POSCTL)

    # -- arming

    def arm(self, force: bool) -> int:
        """By command; returns a MAV_RESULT. Why it is refused, only events say, but for the throttle."""
        vehicle = self.vehicle
        if vehicle.armed:
            return ACCEPTED
        if not force:
            if self._throttle_is_high():
                vehicle.send_text(CRITICAL, "Arming denied: throttle above center\t")
                self.log.send(events.THROTTLE_HIGH)
                return TEMPORARILY_REJECTED
            if not self.armable:
                vehicle.arming.refused_at = vehicle.kernel.now()
                return TEMPORARILY_REJECTED
        if vehicle.has_position and not (vehicle.home and vehicle.home.by_user):
            vehicle.set_home_here()
        self.joystick.lost_when_armed = not self.joystick.valid
        self.joystick.set_reference()
        self.took_off = False
        self.lifted_at = NEVER
        self.ground = vehicle.estimate.position[2]
        vehicle.arm()
        vehicle.send_text(INFO, "Armed by external command\t")
        self.log.send(events.ARMED, events.BY_COMMAND)
        self.report_minimum_height()
        return ACCEPTED

    def report_minimum_height(self) -> None:
        """Once, if the take-off that begins was raised to the least height."""
        if self.minimum_height and self.requested == TAKEOFF:
            self.vehicle.send_text(INFO, f"Using minimum takeoff altitude: {self.minimum_height:.2f} m\t")
            self.log.send(events.MINIMUM_TAKEOFF, events.float_argument(self.minimum_height))
        self.minimum_height = 0.0

    @property
    def armable(self) -> bool:
        """Whether the checks let it arm in the wished mode."""
        mode = self.vehicle.rules.modes[self.requested]
        return (
            self._position_checks_pass(mode.needs_position) and mode.armable and self.can_fly(self.requested)
        )

    def _position_checks_pass(self, to_go_by_position: bool) -> bool:
        """COM_ARM_WO_GPS: by sticks it also arms without a position."""
        if self.ready:
            return True
        allowed = self.vehicle.parameters["COM_ARM_WO_GPS"] != 0.0
        return not to_go_by_position and allowed and self.checks().attitude

    def _throttle_is_high(self) -> bool:
        if not self.joystick.valid or self.requested not in NEEDS_STICKS:
            return False
        by_thrust = self.vehicle.flies and self.requested in (
            MANUAL,
            STABILIZE,
            ACRO,
        )
        return self.joystick.now.throttle > (THROTTLE_HIGH - 1.0 if by_thrust else THROTTLE_HIGH)

    def disarm(self, force: bool) -> int:
        """By command; returns a MAV_RESULT."""
        vehicle = self.vehicle
        if not vehicle.armed:
            return ACCEPTED
        if vehicle.flies and not vehicle.landed and not force:
            vehicle.send_text(CRITICAL, "Disarming denied! Not landed\t")
            self.log.send(events.DISARM_REFUSED)
            return TEMPORARILY_REJECTED
        self.finish_disarming("external command", events.BY_COMMAND)
        return ACCEPTED

    def finish_disarming(self, words: str, reason: bytes) -> None:
        """Disarm, say by what, and go back to a mode that may be armed."""
        vehicle = self.vehicle
        vehicle.disarm()
        vehicle.send_text(INFO, f"Disarmed by {words}\t")
        self.log.send(events.DISARMED, reason)
        self.end_failsafe()
        self.takeoff_amsl = None
        self.requested = self.after_disarming
        self._fly(self.requested)

    # -- reports

    def report(self) -> None:
        """The arming checks, when they changed."""
        vehicle = self.vehicle
        now = vehicle.kernel.now()
        if vehicle.uptime() < REPORT_FROM or now - self.reported_at < REPORT_EVERY:
            return
        found = self.checks()
        if found != self.reported:
            self.reported, self.reported_at = found, now
            for event, arguments in events.arming_report(found):
                self.log.send(event, arguments)


OFFBOARD_IN_EVENTS, POSITION_IN_EVENTS = 6, 3
"""How an event names the wished mode, as far as recorded."""


def commander_of(vehicle: Vehicle) -> Commander:
    """The commander of a vehicle."""
    commander: Commander = vehicle.firmware_state
    return commander
