"""PX4's event interface. Numbers, levels and arguments are as recorded.

The number of an event is a hash of its name; the names here state the observed cause. The reasons of a
refusal to arm appear in events only: a report of all checks is sent when it changes, at most every two
seconds, as a summary, the checks that fail, and a summary of the sensors.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Mapping
from itertools import islice
from typing import Any, NamedTuple

from volery.simulation.autopilots.mavlink.messages import boot_ms
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle


class EventToSend(NamedTuple):
    """One event; ``levels`` holds internal and external severity."""

    id: int
    levels: int


ARMED = EventToSend(0x0190CAF3, 0x66)
DISARMED = EventToSend(0x01F46777, 0x66)
DISARM_REFUSED = EventToSend(0x017C97C5, 0x62)
THROTTLE_HIGH = EventToSend(0x011AB045, 0x62)
TAKEOFF_DETECTED = EventToSend(0x01414569, 0x66)
LANDING_DETECTED = EventToSend(0x019638AC, 0x66)
LANDING_HERE = EventToSend(0x0132B2DE, 0x66)
RETURNING = EventToSend(0x01352CE4, 0x66)
RETURN_ACTIVATED = EventToSend(0x0114827B, 0x66)
RETURN_HOME = EventToSend(0x01AA3FA9, 0x66)
RETURN_CLIMB = EventToSend(0x018C8C09, 0x66)
RETURN_FLY = EventToSend(0x01F62F50, 0x66)
RETURN_DESCEND = EventToSend(0x01B911E0, 0x66)
RETURN_LAND = EventToSend(0x0102D3AA, 0x66)
MISSION_TAKEOFF = EventToSend(0x01E7315E, 0x66)
MISSION_TIMEOUT = EventToSend(0x01820270, 0x33)
MINIMUM_TAKEOFF = EventToSend(0x01DBF722, 0x66)
FAILSAFE = EventToSend(0x01DEDBD0, 0x42)
FAILSAFE_HOLD = EventToSend(0x01D11DF6, 0x42)
FAILSAFE_AFTER_HOLD = EventToSend(0x0194CA8A, 0x42)
FENCE_DISTANCE = EventToSend(0x0115F1B8, 0x42)
REPOSITION_OUTSIDE = EventToSend(0x01CDEBC4, 0x33)
STICKS_LOST = EventToSend(0x0155CD44, 0x62)
STICKS_BACK = EventToSend(0x010AE2BD, 0x66)
PILOT_TOOK_OVER = EventToSend(0x010EAC3F, 0x66)
MODE_REFUSED = EventToSend(0x01A04397, 0x62)
FRAME_UNSUPPORTED = EventToSend(0x01B04541, 0x33)
SETPOINT_INVALID = EventToSend(0x015637A5, 0x33)

CHECKS_SUMMARY = EventToSend(0x01A893E0, 0x88)
NO_ATTITUDE = EventToSend(0x019F748F, 0x22)
NO_LOCAL_POSITION = EventToSend(0x01D31BB9, 0x33)
NO_GLOBAL_POSITION = EventToSend(0x0198C273, 0x33)
NO_MISSION = EventToSend(0x0105C2D9, 0x66)
NO_OFFBOARD_SIGNAL = EventToSend(0x012F1DC7, 0x33)
NO_STICKS = EventToSend(0x0106ED29, 0x44)
MODE_NOT_ARMABLE = EventToSend(0x011C8F61, 0x66)
NO_HOME = EventToSend(0x01013630, 0x66)
ITEM_INVALID = EventToSend(0x01FEB270, 0x33)
MISSION_OUTSIDE = EventToSend(0x012B352D, 0x63)
MISSION_BEGINS = EventToSend(0x01EE01B1, 0x66)
MISSION_ENDED = EventToSend(0x014762F6, 0x66)
MISSION_ENDED_LANDED = EventToSend(0x01771204, 0x66)
ARMING_DENIED = EventToSend(0x0102089D, 0x62)
FENCE_HEIGHT = EventToSend(0x018EFA75, 0x42)
STILL_STARTING = EventToSend(0x0167C97B, 0x66)
SENSORS_SUMMARY = EventToSend(0x011D3727, 0x88)

BY_COMMAND, BY_MISSION, BY_LANDING, BY_WAITING = b"\x04", b"\x05", b"\x06", b"\x07"
"""Reasons of arming and disarming, as arguments."""

FIRST_SEQUENCE = 65_526
"""Sequence number before the first event after a boot."""

_EVENTS_OF_OFFBOARD, _EVENTS_OF_STICKS = 1 << 20, 1 << 7

_MISSION_STATE, _RETURN_STATE, _GROUP = 3, 5, 0x14
"""``nav_state`` of AUTO.MISSION and AUTO.RTL, and the health component of checks of modes."""

KEPT_EVENTS = 20
"""Number of events that a client may request again."""


class EventBuffer:
    """Numbered events of one vehicle.

    Args:
        vehicle: The vehicle.
        replaced: What the version of the firmware sends instead of an event; ``None``: nothing.
    """

    def __init__(self, vehicle: AutopilotVehicle, replaced: Mapping[EventToSend, EventToSend | None]) -> None:
        self._vehicle = vehicle
        self._replaced = replaced
        self.latest = FIRST_SEQUENCE
        self._kept: deque[dict[str, Any]] = deque(maxlen=KEPT_EVENTS)

    def send(self, event: EventToSend, arguments: bytes = b"") -> None:
        """Send an event on all links, or what the version sends instead of it."""
        sent = self._replaced.get(event, event)
        if sent is None:
            return
        self.latest = (self.latest + 1) % 65_536
        fields = {
            "id": sent.id,
            "event_time_boot_ms": boot_ms(self._vehicle),
            "sequence": self.latest,
            "log_levels": sent.levels,
            "arguments": tuple(arguments),
        }
        self._kept.append(fields)
        self._vehicle.output.send_event("EVENT", fields)

    def send_again(self, first: int, last: int) -> None:
        """Send events that a client missed, by their sequence numbers, and report those that are not kept.

        Args:
            first: First sequence number.
            last: Last sequence number; before ``first``, the numbers run over 65535.
        """
        kept = {fields["sequence"]: fields for fields in self._kept}
        wanted = ((first + step) % 65_536 for step in range((last - first) % 65_536 + 1))
        for sequence in islice(wanted, 2 * KEPT_EVENTS):
            if sequence in kept:
                self._vehicle.output.send_event("EVENT", kept[sequence])
            else:
                self._report_missing(sequence)

    def _report_missing(self, sequence: int) -> None:
        oldest = self._kept[0]["sequence"] if self._kept else self.latest
        fields = {
            "target_system": 0,
            "target_component": 0,
            "sequence": sequence,
            "sequence_oldest_available": oldest,
            "reason": 0,
        }
        self._vehicle.output.send_event("RESPONSE_EVENT_ERROR", fields)


class ArmingChecks(NamedTuple):
    """Results of the arming checks."""

    started: bool
    attitude: bool
    position: bool
    sticks: bool
    mission: bool
    mission_required: bool
    """Whether a missing mission refuses arming in every mode."""
    home: bool
    offboard: bool
    mode: bool
    """Whether the requested mode may be armed."""


def _modes(checks: ArmingChecks) -> int:
    """Return the modes that could be flown now, one bit for each ``nav_state`` of VehicleStatus."""
    missing: list[int] = []
    if not checks.position:
        missing += [2, 3, 4, 5, 17, 18, 19, 20, 21, 22]
    if not checks.attitude:
        missing += [12]
    if not checks.sticks:
        missing += [0, 1, 2, 10, 15]
    if not checks.mission:
        missing += [3]
    if not checks.offboard:
        missing += [14]
    allowed = 0xFFFF_FFFF
    for state in missing:
        allowed &= ~(1 << state)
    return allowed


ALL_MODES = 0xFFFF_FFFF


def arming_report(checks: ArmingChecks) -> list[tuple[EventToSend, bytes]]:
    """Return the events that report these checks."""
    able = _modes(checks)
    armable = 0 if checks.mission_required and not checks.mission else able
    errors = 0 if checks.offboard else _EVENTS_OF_OFFBOARD
    warnings = 0 if checks.sticks else _EVENTS_OF_STICKS
    found = [(CHECKS_SUMMARY, struct.pack("<BIIII", 0, errors, warnings, armable, able))]
    if not checks.attitude:
        found.append((NO_ATTITUDE, bytes.fromhex("3ed07e0014")))
    if not checks.position:
        found.append((NO_LOCAL_POSITION, bytes.fromhex("3c007e0014")))
        found.append((NO_GLOBAL_POSITION, bytes.fromhex("3800000014")))
    if not checks.mission:
        forbids = ALL_MODES if checks.mission_required else 1 << _MISSION_STATE
        found.append((NO_MISSION, struct.pack("<IB", forbids, _GROUP)))
    if not checks.home:
        found.append((NO_HOME, struct.pack("<IB", 1 << _RETURN_STATE, _GROUP)))
    if not checks.offboard:
        found.append((NO_OFFBOARD_SIGNAL, bytes.fromhex("0040000014")))
    if not checks.sticks:
        found.append((NO_STICKS, bytes.fromhex("ffffffff07")))
    if not checks.mode:
        found.append((MODE_NOT_ARMABLE, bytes.fromhex("20303c0014")))
    if not checks.started:
        found.append((STILL_STARTING, bytes.fromhex("ffffffff0c")))
    sensors = 0x80 * checks.sticks | 0x08 * checks.position | 0x02
    found.append((SENSORS_SUMMARY, bytes((0, sensors, 0x18 if checks.started else 0x08, 0x02, 0x28))))
    return found


def float_argument(value: float) -> bytes:
    """Return a number as the argument of an event."""
    return struct.pack("<f", value)
