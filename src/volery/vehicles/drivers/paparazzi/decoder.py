"""What a Paparazzi rotorcraft's messages say, as ``Telemetry``. One method for each that is listened to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import degrees, isnan, nan
from typing import Any

from volery.base.frames import LocalFrame, Vector
from volery.base.position import AMSL, Position
from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.links.paparazzi_aircraft import PaparazziAircraft
from volery.links.pprzlink_messages import entry_name
from volery.trace.events import Text
from volery.vehicles.drivers.paparazzi.modes import (
    FAILSAFE,
    GOOD_FIX,
    GUIDED,
    HOME,
    HOME_WAYPOINT,
    NEEDS_CARE,
    PREPARING_BLOCKS,
    PREVENTS_ARMING,
    START,
    STATUS,
)
from volery.vehicles.drivers.steps import DRONE_KIND
from volery.vehicles.telemetry import Answer, Attitude, Battery, StatusText, Telemetry, Velocity

Fields = Mapping[str, Any]

POSITION, SPEED, ANGLE = 1 / 2**8, 1 / 2**19, 1 / 2**12
"""Metres, metres per second and radians of one count in ROTORCRAFT_FP."""

KINDS = {STATUS: DRONE_KIND, "PPRZ_MODE": "plane", "ROVER_STATUS": "Paparazzi rover"}
"""What sends this message is of this kind."""

EFFECT: Ns = 300 * MS
"""So long after motors were told to start, a status that says why they do not is the answer to that."""

NOTICE, WARNING = 5, 4


class Origin:
    """The local frame: east, north, up about a point that INS_REF tells. Altitudes are AMSL outside."""

    def __init__(self, fields: Fields) -> None:
        self.latitude: float = fields["lat0"] / 1e7
        self.longitude: float = fields["lon0"] / 1e7
        self.amsl: float = fields["hmsl0"] / 1000.0
        self._above_amsl: float = fields["alt0"] / 1000.0 - self.amsl  # of the ellipsoid's heights
        self._frame = LocalFrame(self.latitude, self.longitude, fields["alt0"] / 1000.0)

    def position(self, enu: Vector) -> Position:
        """Where on the globe."""
        latitude, longitude, height = self._frame.from_enu(enu)
        return Position(latitude, longitude, AMSL(height - self._above_amsl))

    def enu(self, latitude: float, longitude: float, amsl: float) -> Vector:
        """Where in the local frame."""
        return self._frame.to_enu(latitude, longitude, amsl + self._above_amsl)


class PaparazziDecoder:
    """Turns messages into telemetry. ``hear`` one; it says whether it was of interest.

    *record*: what it says in words goes into the trace, too. ``ours`` are the mode that we asked for last
    and, until it is seen, the one before. HOME and FAILSAFE are failsafes only where nobody asked for them.
    """

    def __init__(
        self, kernel: Kernel, telemetry: Telemetry, aircraft: PaparazziAircraft, *, record: bool
    ) -> None:
        self.origin: Origin | None = None
        self.ours: frozenset[str] = frozenset()
        self._asked_mode = ""
        self.settled = False  # the numbers of settings were checked
        self.starting: Ns | None = None  # since when motors are to start
        self.values: dict[int, tuple[Ns, float]] = {}
        self.block: tuple[Ns, int] = (-1, -1)
        self.good_fix = False
        self._kernel = kernel
        self._seen = telemetry
        self._records = record
        self._home_number, self._home = _home_of(aircraft)
        self._preparing = {block.number for block in aircraft.blocks if block.name in PREPARING_BLOCKS}
        self._origin_is_set = False
        self._arming = ""
        self._handlers: Mapping[str, Callable[[Fields], None]] = {
            "ROTORCRAFT_FP": self._flight,
            STATUS: self._status,
            "INS_REF": self._reference,
            "GPS_INT": self._satellites,
            "ENERGY": self._energy,
            "ROTORCRAFT_NAV_STATUS": self._navigation,
            "DL_VALUE": self._value,
            "WP_MOVED_ENU": self._moved,
            "INFO_MSG": lambda fields: self.say(NOTICE, fields["msg"]),
        }

    def hear(self, name: str, fields: Fields) -> bool:
        """Take note of a message of our aircraft. It is heard of once it has told what kind it is."""
        seen = self._seen
        if name in KINDS and not seen.kind:
            seen.kind, seen.autopilot = KINDS[name], "Paparazzi"
        if seen.kind:
            seen.last_message_ns = self._kernel.now()
        handler = self._handlers.get(name)
        if handler is None:
            return False
        handler(fields)
        return True

    def ask_mode(self, mode: str) -> None:
        """*mode* is about to be asked for."""
        if mode != self._asked_mode:
            self._asked_mode = mode
            self.ours = frozenset({mode, self._seen.mode})

    def say(self, severity: int, text: str) -> None:
        """Words of the aircraft's."""
        now = self._kernel.now()
        self._seen.texts.append(StatusText(now, severity, text))
        if self._records:
            self._kernel.record(Text(now, self._seen.name, severity, text))

    def judge_readiness(self) -> None:
        """It knows where it is, its attitude is aligned, and its settings are the ones that we write."""
        seen = self._seen
        seen.armable = bool(self._arming) and self._arming not in PREVENTS_ARMING
        placed = self._origin_is_set and seen.position is not None
        seen.ready = seen.armable and self.settled and self.good_fix and placed

    def _status(self, fields: Fields) -> None:
        seen = self._seen
        seen.mode = entry_name(STATUS, "ap_mode", fields["ap_mode"])
        seen.armed = bool(fields["ap_motors_on"])
        seen.flying = bool(fields["ap_in_flight"]) and seen.armed
        seen.failsafe = seen.mode in {FAILSAFE, HOME} and seen.mode != self._asked_mode
        if seen.mode == self._asked_mode:
            self.ours = frozenset({seen.mode})
        seen.fix = entry_name(STATUS, "gps_status", fields["gps_status"]).lower()
        self.good_fix = fields["gps_status"] >= GOOD_FIX
        self._hear_arming(entry_name(STATUS, "arming_status", fields["arming_status"]))
        self._hear_volts(fields["vsupply"])
        self.judge_readiness()

    def _hear_arming(self, word: str) -> None:
        self._seen.status = word.lower().replace("_", " ")
        now = self._kernel.now()
        began = self.starting
        refused = (
            began is not None and now - began >= EFFECT and word in PREVENTS_ARMING and not self._seen.armed
        )
        if refused:
            self.starting = None
            self._seen.answers[START] = Answer(now, False, word)
        if refused or (word != self._arming and word in NEEDS_CARE):
            self.say(WARNING, f"arming status: {self._seen.status}")
        self._arming = word

    def _reference(self, fields: Fields) -> None:
        """All zero: no origin has been set. Off the globe: garbled on the way."""
        latitude, longitude = fields["lat0"], fields["lon0"]
        if not (latitude or longitude) or abs(latitude) > 90 * 10**7 or abs(longitude) > 180 * 10**7:
            return
        self.origin = Origin(fields)
        self._origin_is_set = self.block[1] >= 0 and self.block[1] not in self._preparing
        self._place_home()
        self.judge_readiness()

    def _place_home(self) -> None:
        if self.origin is None:
            return
        east, north = self._home
        there = self.origin.position((east, north, 0.0))
        self._seen.home = Position(there.latitude, there.longitude, AMSL(self.origin.amsl))

    def _moved(self, fields: Fields) -> None:
        """The plan's HOME has another place than its XML says."""
        if fields["wp_id"] == self._home_number:
            self._home = fields["east"] * POSITION, fields["north"] * POSITION
            self._place_home()

    def _flight(self, fields: Fields) -> None:
        seen = self._seen
        heading = degrees(fields["psi"] * ANGLE) % 360.0
        seen.attitude = Attitude(degrees(fields["phi"] * ANGLE), degrees(fields["theta"] * ANGLE), heading)
        if self.origin is None:
            return
        seen.position = self.origin.position(_enu(fields, ""))
        seen.above_home = seen.position.altitude.metres - self.origin.amsl
        if seen.mode == GUIDED:
            seen.target = self.origin.position(_enu(fields, "carrot_"))
        seen.velocity = Velocity(fields["vnorth"] * SPEED, fields["veast"] * SPEED, fields["vup"] * SPEED)
        self.judge_readiness()

    def _satellites(self, fields: Fields) -> None:
        self._seen.satellites = fields["numsv"]

    def _energy(self, fields: Fields) -> None:
        """Paparazzi does not tell what remains, only what was drawn."""
        self._seen.battery = Battery(nan, fields["voltage"], fields["current"])

    def _hear_volts(self, volts: float) -> None:
        if isnan(self._seen.battery.amperes):
            self._seen.battery = Battery(nan, volts, nan)

    def _navigation(self, fields: Fields) -> None:
        """What INS_REF told before the origin was set is not to be relied on."""
        self.block = self._kernel.now(), fields["cur_block"]
        if self.block[1] in self._preparing:
            self._origin_is_set = False

    def _value(self, fields: Fields) -> None:
        self.values[fields["index"]] = self._kernel.now(), fields["value"]


def _enu(fields: Fields, prefix: str) -> Vector:
    """Metres in the local frame."""
    east, north, up = (fields[f"{prefix}{axis}"] * POSITION for axis in ("east", "north", "up"))
    return east, north, up


def _home_of(aircraft: PaparazziAircraft) -> tuple[int, tuple[float, float]]:
    """Number of the waypoint HOME, and where it is: east, north; at the origin if the plan says nothing."""
    for waypoint in aircraft.waypoints:
        if waypoint.name == HOME_WAYPOINT:
            known = not (isnan(waypoint.east) or isnan(waypoint.north))
            return waypoint.number, (waypoint.east, waypoint.north) if known else (0.0, 0.0)
    return -1, (0.0, 0.0)
