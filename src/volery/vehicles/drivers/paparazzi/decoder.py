"""Decoder of a Paparazzi rotorcraft's messages, the names of its firmware, and what the driver assumes of it.

One method for each message.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import degrees, isnan, nan
from typing import Any

from volery.base.frames import LocalFrame, Vector
from volery.base.position import AMSL, Position
from volery.base.time import MS, Ns, S, to_seconds
from volery.kernel.api import Kernel
from volery.links.paparazzi_aircraft import PaparazziAircraft
from volery.links.pprzlink_messages import entry_name, entry_value, message_type
from volery.trace.events import NOTICE, WARNING, Text
from volery.vehicles.drivers.steps import DRONE_KIND
from volery.vehicles.telemetry import (
    PILOT_FLIES,
    PROGRAM_MAY_FLY,
    Answer,
    Attitude,
    Battery,
    StatusText,
    Telemetry,
    Velocity,
    pulse_of,
)

STATUS = "ROTORCRAFT_STATUS"

KILL, FAILSAFE, HOME = "KILL", "FAILSAFE", "HOME"
NAV, GUIDED = "NAV", "GUIDED"
ATTITUDE_MODE, HEIGHT_MODE = "ATTITUDE_DIRECT", "ATTITUDE_RC_CLIMB"

NUMBERS: Mapping[str, int] = {
    word: number for number, word in enumerate(message_type(STATUS).words("ap_mode"))
}
"""Numbers of the modes."""

GOOD_FIX = entry_value(STATUS, "gps_status", "3D")
"""Least ``gps_status`` for a position."""

NEEDS_CARE = message_type(STATUS).words("arming_status")[8:]
"""Values of ``arming_status`` that state why it does not arm."""

PREVENTS_ARMING = frozenset({"AHRS_NOT_ALLIGNED", "OUT_OF_GEOFENCE", "LOW_BATTERY"})
"""Values that last until the cause is removed. The others concern a pilot's sticks."""

START = "start of the motors"
"""Key of a refusal: the arming status after the command to start the motors."""

CHANGE = "change of mode"
"""Key of an acknowledgement: the value of the setting 'mode' after it was written."""

LASTING_FAILSAFES = frozenset({FAILSAFE, HOME})
"""Modes in which it may stay in the air: HOME hovers, FAILSAFE of version 6.2 keeps its height."""

# Settings that the driver writes; an aircraft's XML defines their numbers.
AUTO2 = "auto2"
KILL_THROTTLE = "kill_throttle"
MODE = "mode"

START_BLOCK, TAKEOFF_BLOCK, LAND_BLOCK = "Start Engine", "Takeoff", "land here"
"""Blocks of the stock rotorcraft plan; the options ``start``, ``takeoff`` and ``land`` name others."""

PREPARING_BLOCKS = ("Wait GPS", "Geo init")
"""Blocks in which the origin of the local frame is not set yet. A plan need not have them."""

HOME_WAYPOINT = "HOME"

ASSUMED: Mapping[str, str] = {
    "GET_SETTING": "is answered with DL_VALUE: the numbers of 'mode' and 'kill_throttle' are checked so",
    "SETTING": "is answered at once with DL_VALUE, which has the value in force",
    "SETTING of 'mode'": "KILL, FAILSAFE and HOME always; NAV and GUIDED while no transmitter is received",
    "SETTING of 'auto2'": "what the third position of the mode switch means, at once where it is in it",
    "SETTING of 'kill_throttle'": "0 starts the motors in every mode but KILL, 1 stops them, in the air, too",
    "RC_UP": "counts as a transmitter if the aircraft takes its sticks from the datalink: roll, pitch "
    "(nose up +), yaw, throttle, mode switch (127 is AUTO2), kill switch (127 is off)",
    "GUIDED_SETPOINT_NED": "about the origin in INS_REF; stands until the next one",
    "ROTORCRAFT_FP": "in GUIDED its carrot is the set-point, of any sender",
    "block 'Start Engine'": "starts the motors, in NAV",
    "block 'Takeoff'": "climbs straight up to some 2 m",
    "block 'land here'": "in flight: takes the touch-down point from where it is, descends, and stops the "
    "motors",
    "FAILSAFE": "levels out without a position; it should descend and become KILL on the ground, but "
    "version 6.2 keeps its height",
    "GUIDED on the ground": "lifts off as soon as the motors run",
    "height above home": "is the height above the origin: block 'Geo init' sets it where the aircraft stands",
    "ATTITUDE_RC_CLIMB": "keeps the height at which it began; version 6.2 does not follow the throttle; "
    "ATTITUDE_Z_HOLD keeps the height at which it began whatever the throttle says",
}
"""What the driver assumes. All but ATTITUDE_RC_CLIMB was seen of version 6.2 in its own simulator."""


Fields = Mapping[str, Any]

POSITION, SPEED, ANGLE = 1 / 2**8, 1 / 2**19, 1 / 2**12
"""Metres, metres per second and radians of one count in ROTORCRAFT_FP."""

KINDS = {STATUS: DRONE_KIND, "PPRZ_MODE": "plane", "ROVER_STATUS": "Paparazzi rover"}
"""Kind of the vehicle that sends a message."""

EFFECT: Ns = 300 * MS
"""Time after the command to start the motors from which a status that prevents arming is its answer."""

MISSED_AFTER: Ns = 3 * S
"""Time without a position, while other messages arrive, after which it counts for nothing."""
PAUSE: Ns = S
"""Silence of the link after which the position has all of ``MISSED_AFTER`` again."""

MAX_PPRZ = 9600
"""Full thrust in ROTORCRAFT_FP, full deflection in ROTORCRAFT_RADIO_CONTROL; above half AUTO2."""
LOST_FILTERS = frozenset({4, 5, 6, 8})
"""GPS_LOST, IMU_LOST, COV_ERR and ERROR in STATE_FILTER_STATUS."""


class ReportedOrigin:
    """The local frame: east, north, up about the point in INS_REF. Altitudes outside are AMSL."""

    def __init__(self, fields: Fields) -> None:
        self.latitude: float = fields["lat0"] / 1e7
        self.longitude: float = fields["lon0"] / 1e7
        self.amsl: float = fields["hmsl0"] / 1000.0
        self._ellipsoid_above_amsl: float = fields["alt0"] / 1000.0 - self.amsl
        self._frame = LocalFrame(self.latitude, self.longitude, fields["alt0"] / 1000.0)

    def position(self, enu: Vector) -> Position:
        """Return the position of a point in the local frame."""
        latitude, longitude, height = self._frame.from_enu(enu)
        return Position(latitude, longitude, AMSL(height - self._ellipsoid_above_amsl))

    def enu(self, latitude: float, longitude: float, amsl: float) -> Vector:
        """Return a position in the local frame."""
        return self._frame.to_enu(latitude, longitude, amsl + self._ellipsoid_above_amsl)


class PaparazziDecoder:
    """Decodes messages into telemetry. HOME and FAILSAFE are failsafes unless this program commanded them.

    Attributes:
        ours: the mode commanded last and, until that is seen, the one before.
        settings_checked: the numbers of the settings were checked.
        starting: when the motors were commanded to start; ``None`` if they were not.
        values: time and value of received settings, by number.
        block: time and number of the last reported block of the flight plan.
        good_fix: the GPS receiver has a 3D fix.
        status_at: time of the last status; -1 before the first.
        transmitter: a transmitter is received, or sticks by datalink.
        thrust: thrust as last reported, in its own counts.

    Args:
        kernel: clock and record.
        telemetry: written by the decoder.
        aircraft: definition of the aircraft from its XML.
        record: whether the aircraft's texts are recorded.
    """

    def __init__(
        self, kernel: Kernel, telemetry: Telemetry, aircraft: PaparazziAircraft, *, record: bool
    ) -> None:
        self.origin: ReportedOrigin | None = None
        self.ours: frozenset[str] = frozenset()
        self.settings_checked = False
        self.starting: Ns | None = None
        self.values: dict[int, tuple[Ns, float]] = {}
        self.block: tuple[Ns, int] = (-1, -1)
        self.good_fix = False
        self.status_at: Ns = -1
        self.transmitter = False
        self.thrust = 0
        self._flight_at: Ns = -1
        self._resumed_at: Ns = -1  # when messages began to arrive again
        self._lack = ""
        self._kernel = kernel
        self._telemetry = telemetry
        self._records = record
        self._home_number, self._home = _home_of(aircraft)
        self._preparing = {block.number for block in aircraft.blocks if block.name in PREPARING_BLOCKS}
        self._commanded_mode = ""
        self._origin_is_set = False
        self._arming = ""
        self._handlers: Mapping[str, Callable[[Fields], None]] = {
            "ROTORCRAFT_FP": self._flight,
            STATUS: self._status,
            "ROTORCRAFT_RADIO_CONTROL": self._radio,
            "INS_REF": self._reference,
            "GPS_INT": self._satellites,
            "ENERGY": self._energy,
            "ROTORCRAFT_NAV_STATUS": self._navigation,
            "DL_VALUE": self._value,
            "WP_MOVED_ENU": self._moved,
            "STATE_FILTER_STATUS": self._state_filter,
            "INFO_MSG": lambda fields: self.add_text(NOTICE, fields["msg"]),
        }

    def handle_message(self, name: str, fields: Fields) -> bool:
        """Decode a message; return whether it was used. The link counts once the kind of vehicle is known."""
        telemetry = self._telemetry
        if name in KINDS and not telemetry.kind:
            telemetry.kind, telemetry.autopilot = KINDS[name], "Paparazzi"
        now = self._kernel.now()
        if telemetry.last_message_ns < now - PAUSE:
            self._resumed_at = now
        if telemetry.kind:
            telemetry.note_message(now)
        handler = self._handlers.get(name)
        if handler is not None:
            handler(fields)
        self._tell_lack()
        return handler is not None

    def is_old(self) -> bool:
        """Return whether ROTORCRAFT_FP is not sent any more while other messages arrive."""
        last = self._telemetry.last_message_ns
        return last - max(self._flight_at, self._resumed_at) > MISSED_AFTER

    def lacks_position(self) -> str:
        """Return why there is no position that counts, in words; empty if there is one."""
        last = self._telemetry.last_message_ns
        if not self.good_fix:
            fix = self._telemetry.fix or "none reported"
            return f"it has no 3D fix ({fix}), its position counts for nothing"
        if self.origin is None:
            return "it has not reported the origin of its local frame (INS_REF)"
        if self._flight_at < 0:
            return "it has not reported its position (ROTORCRAFT_FP)"
        if self.is_old():
            ago = to_seconds(last - self._flight_at)
            return (
                f"its position (ROTORCRAFT_FP) is not sent any more, the last {ago:.1f} s ago, while other "
                f"messages arrive; look at its telemetry mode"
            )
        return ""

    def _tell_lack(self) -> None:
        """Report once in flight that the position does not count any more."""
        lack = self.lacks_position() if self._telemetry.flying else ""
        if lack and not self._lack:
            self._telemetry.velocity = Velocity(nan, nan, self._telemetry.velocity.up)
            self.add_text(WARNING, lack)
        self._lack = lack

    def note_commanded(self, mode: str) -> None:
        """Note that *mode* is being commanded."""
        if mode != self._commanded_mode:
            self._commanded_mode = mode
            self.ours = frozenset({mode, self._telemetry.mode})

    def add_text(self, severity: int, text: str) -> None:
        """Add a text of the aircraft."""
        now = self._kernel.now()
        self._telemetry.texts.append(StatusText(now, severity, text))
        if self._records:
            self._kernel.record(Text(now, self._telemetry.name, severity, text))

    def update_ready(self) -> None:
        """Update ``ready``: it has a position, an aligned attitude, and checked settings."""
        telemetry = self._telemetry
        telemetry.armable = bool(self._arming) and self._arming not in PREVENTS_ARMING
        located = self._origin_is_set and telemetry.position is not None
        telemetry.ready = telemetry.armable and self.settings_checked and self.good_fix and located
        telemetry.ready = telemetry.ready and not self.lacks_position()

    def _status(self, fields: Fields) -> None:
        telemetry = self._telemetry
        telemetry.mode = entry_name(STATUS, "ap_mode", fields["ap_mode"])
        telemetry.armed = bool(fields["ap_motors_on"])
        telemetry.flying = bool(fields["ap_in_flight"]) and telemetry.armed
        commanded = telemetry.mode == self._commanded_mode
        telemetry.failsafe = telemetry.mode in {FAILSAFE, HOME} and not commanded
        telemetry.failsafe_lasts = telemetry.failsafe and telemetry.mode in LASTING_FAILSAFES
        self.status_at = self._kernel.now()
        self.transmitter = entry_name(STATUS, "rc_status", fields["rc_status"]) == "OK"
        if commanded:
            self.ours = frozenset({telemetry.mode})
        telemetry.fix = entry_name(STATUS, "gps_status", fields["gps_status"]).lower()
        self.good_fix = fields["gps_status"] >= GOOD_FIX
        self._update_arming(entry_name(STATUS, "arming_status", fields["arming_status"]))
        if isnan(telemetry.battery.amperes):
            telemetry.battery = Battery(nan, fields["vsupply"], nan)
        self.update_ready()

    def _radio(self, fields: Fields) -> None:
        """Decode the transmitter: roll, pitch, throttle, yaw, mode switch, kill switch."""
        if entry_name("ROTORCRAFT_RADIO_CONTROL", "status", fields["status"]) != "OK":
            channels: tuple[int, ...] = (0,) * 6
        else:
            sticks = (pulse_of(fields[name] / MAX_PPRZ) for name in ("roll", "pitch", "throttle", "yaw"))
            mode = PROGRAM_MAY_FLY if fields["mode"] > MAX_PPRZ // 2 else PILOT_FLIES
            channels = (*sticks, mode, pulse_of(fields["kill"] / MAX_PPRZ))
        self._telemetry.rc, self._telemetry.rc_ns = channels, self._kernel.now()

    def _update_arming(self, status: str) -> None:
        telemetry, began, now = self._telemetry, self.starting, self._kernel.now()
        telemetry.status = status.lower().replace("_", " ")
        refused = (
            began is not None and now - began >= EFFECT and status in PREVENTS_ARMING and not telemetry.armed
        )
        if refused:
            self.starting = None
            telemetry.answers[START] = Answer(now, False, status)
        if refused or (status != self._arming and status in NEEDS_CARE):
            self.add_text(WARNING, f"arming status: {telemetry.status}")
        self._arming = status

    def _reference(self, fields: Fields) -> None:
        """Store the origin; zeros mean that none is set, a point off the globe was garbled on the way."""
        latitude, longitude = fields["lat0"], fields["lon0"]
        if not (latitude or longitude) or abs(latitude) > 90 * 10**7 or abs(longitude) > 180 * 10**7:
            return
        self.origin = ReportedOrigin(fields)
        self._origin_is_set = self.block[1] >= 0 and self.block[1] not in self._preparing
        self._update_home()
        self.update_ready()

    def _update_home(self) -> None:
        if self.origin is None:
            return
        east, north = self._home
        there = self.origin.position((east, north, 0.0))
        self._telemetry.home = Position(there.latitude, there.longitude, AMSL(self.origin.amsl))

    def _moved(self, fields: Fields) -> None:
        """Take the new place of the plan's waypoint HOME."""
        if fields["wp_id"] == self._home_number:
            self._home = fields["east"] * POSITION, fields["north"] * POSITION
            self._update_home()

    def _flight(self, fields: Fields) -> None:
        telemetry = self._telemetry
        heading = degrees(fields["psi"] * ANGLE) % 360.0
        telemetry.attitude = Attitude(
            degrees(fields["phi"] * ANGLE), degrees(fields["theta"] * ANGLE), heading
        )
        self.thrust = fields["thrust"]
        telemetry.thrust = self.thrust / MAX_PPRZ
        if self.origin is None:
            return
        self._flight_at = self._kernel.now()
        position = self.origin.position(_enu(fields, ""))
        telemetry.update_position(position)
        telemetry.above_home = position.altitude.metres - self.origin.amsl
        if telemetry.mode == GUIDED:
            telemetry.target = self.origin.position(_enu(fields, "carrot_"))
        north, east, up = (fields[name] * SPEED for name in ("vnorth", "veast", "vup"))
        telemetry.velocity = Velocity(north, east, up) if self.good_fix else Velocity(nan, nan, up)
        self.update_ready()

    def _state_filter(self, fields: Fields) -> None:
        self._telemetry.note_estimate(fields["state_filter_mode"] not in LOST_FILTERS)

    def _satellites(self, fields: Fields) -> None:
        self._telemetry.satellites = fields["numsv"]

    def _energy(self, fields: Fields) -> None:
        """Decode the battery; Paparazzi reports what was drawn, not what remains."""
        self._telemetry.battery = Battery(nan, fields["voltage"], fields["current"])

    def _navigation(self, fields: Fields) -> None:
        """Store the block; an INS_REF received before the origin was set is not valid."""
        self.block = self._kernel.now(), fields["cur_block"]
        if self.block[1] in self._preparing:
            self._origin_is_set = False

    def _value(self, fields: Fields) -> None:
        self.values[fields["index"]] = self._kernel.now(), fields["value"]


def _enu(fields: Fields, prefix: str) -> Vector:
    """Return a point in the local frame, m."""
    east, north, up = (fields[f"{prefix}{axis}"] * POSITION for axis in ("east", "north", "up"))
    return east, north, up


def _home_of(aircraft: PaparazziAircraft) -> tuple[int, tuple[float, float]]:
    """Return number and (east, north) of waypoint HOME; the origin if the plan does not state its place."""
    for waypoint in aircraft.waypoints:
        if waypoint.name == HOME_WAYPOINT:
            known = not (isnan(waypoint.east) or isnan(waypoint.north))
            return waypoint.number, (waypoint.east, waypoint.north) if known else (0.0, 0.0)
    return -1, (0.0, 0.0)
