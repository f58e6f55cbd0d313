"""Decoder of the messages that all MAVLink autopilots send. One method for each message."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from math import degrees, nan
from typing import Any, ClassVar

from volery.base.errors import UsageError
from volery.base.position import AMSL, Position
from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.links.mavlink_messages import StatusTextAssembler, constant, entry_name
from volery.trace.events import Text
from volery.vehicles.drivers.mavlink.backend import ACTIVE, ARMED, FAILSAFE, ON_GROUND, UNDEFINED
from volery.vehicles.drivers.mavlink.obstacle_decoder import ObstacleDecoder
from volery.vehicles.drivers.steps import DRONE_KIND, ROVER_KIND
from volery.vehicles.telemetry import Attitude, Battery, StatusText, Telemetry, Velocity

Fields = Mapping[str, Any]
Handler = Callable[[Fields], None]

KINDS: Mapping[int, str] = {
    2: DRONE_KIND,  # quadrotor
    3: DRONE_KIND,  # coaxial helicopter
    4: DRONE_KIND,  # helicopter
    13: DRONE_KIND,  # hexarotor
    14: DRONE_KIND,  # octorotor
    15: DRONE_KIND,  # tricopter
    29: DRONE_KIND,  # dodecarotor
    35: DRONE_KIND,  # decarotor
    10: ROVER_KIND,
    11: ROVER_KIND,  # boat: the same firmware
}
"""Kind of vehicle by MAV_TYPE."""

PREARM_CHECK = constant("MAV_SYS_STATUS_PREARM_CHECK")
HORIZONTAL_POSITION = constant("ESTIMATOR_POS_HORIZ_ABS")
"""The same bit is used in ArduPilot's EKF_STATUS_REPORT and in PX4's ESTIMATOR_STATUS."""
NO_POSITION = constant("EKF_CONST_POS_MODE")
COMPLETE = constant("MISSION_STATE_COMPLETE")
_UNKNOWN_16 = 65535
RC_CHANNELS = 18
"""Channels in RC_CHANNELS."""


class TelemetryDecoder(ABC):
    """Decodes MAVLink messages into telemetry.

    Attributes:
        autopilot: name of the firmware.
        resting: mode in which an armed rover stands.
        last_heartbeat_ns: time of the last heartbeat; -1 before the first.

    Args:
        kernel: clock and record.
        telemetry: written by the decoder.
        record: whether the autopilot's texts are recorded.
    """

    autopilot: ClassVar[str] = ""
    resting: ClassVar[str] = ""

    def __init__(self, kernel: Kernel, telemetry: Telemetry, *, record: bool = True) -> None:
        self.last_heartbeat_ns: Ns = -1
        self._kernel = kernel
        self._telemetry = telemetry
        self._records = record
        self._texts = StatusTextAssembler(self.add_text)
        self._landed_state = UNDEFINED
        self._estimates_position = False
        self._handlers: dict[str, Handler] = {
            "HEARTBEAT": self._heartbeat,
            "GLOBAL_POSITION_INT": self._global_position,
            "SYS_STATUS": self._sys_status,
            "EXTENDED_SYS_STATE": self._extended_state,
            "HOME_POSITION": self._home_position,
            "POSITION_TARGET_GLOBAL_INT": self._target,
            "GPS_RAW_INT": self._gps,
            "ATTITUDE": self._attitude,
            "VFR_HUD": self._vfr_hud,
            "STATUSTEXT": self._texts.add,
            "RC_CHANNELS": self._rc_channels,
            "MISSION_ITEM_REACHED": self._reached,
            "MISSION_CURRENT": self._mission_current,
        }

    def handles(self, name: str) -> bool:
        """Return whether messages of that name are decoded."""
        return name in self._handlers

    def handle_message(self, name: str, fields: Fields) -> bool:
        """Decode a message; return whether it was used. Positions off the globe are discarded."""
        self._telemetry.note_message(self._kernel.now())
        if "time_boot_ms" in fields:
            self._telemetry.update_clock(fields["time_boot_ms"] * MS)
        handler = self._handlers.get(name)
        if handler is None:
            return False
        try:
            handler(fields)
        except UsageError:
            return False
        return True

    def decode_obstacles(self) -> None:
        """Decode the messages of range sensors from now on."""
        self._handlers.update(ObstacleDecoder(self._telemetry).handlers)

    def add_text(self, severity: int, text: str) -> None:
        """Add a text of the autopilot."""
        now = self._kernel.now()
        self._telemetry.texts.append(StatusText(now, severity, text))
        if self._records:
            self._kernel.record(Text(now, self._telemetry.name, severity, text))

    @abstractmethod
    def _mode_name(self, number: int) -> str:
        """Return the firmware's name of a ``custom_mode``."""

    def _update_ready(self) -> None:
        """Update ``ready``: it could arm now; estimator, position and home are known."""
        telemetry = self._telemetry
        located = telemetry.position is not None and telemetry.home is not None
        telemetry.ready = telemetry.armable and self._estimates_position and located

    def _heartbeat(self, fields: Fields) -> None:
        telemetry = self._telemetry
        self.last_heartbeat_ns = self._kernel.now()
        mav_type: int = fields["type"]
        telemetry.kind = KINDS.get(mav_type) or entry_name("MAV_TYPE", mav_type).lower().replace("_", " ")
        telemetry.autopilot = self.autopilot
        telemetry.mode = self._mode_name(fields["custom_mode"])
        telemetry.armed = bool(fields["base_mode"] & ARMED)
        status: int = fields["system_status"]
        telemetry.status = entry_name("MAV_STATE", status).lower()
        telemetry.failsafe = status in FAILSAFE
        # drones send a landed state; a rover rests in one mode, and else drives once it is armed
        if telemetry.kind != DRONE_KIND:
            telemetry.flying = telemetry.armed and telemetry.mode != self.resting
        elif self._landed_state == UNDEFINED:
            telemetry.flying = telemetry.armed and status == ACTIVE

    def _extended_state(self, fields: Fields) -> None:
        self._landed_state = fields["landed_state"]
        if self._landed_state != UNDEFINED and self._telemetry.kind == DRONE_KIND:
            self._telemetry.flying = self._landed_state != ON_GROUND

    def _global_position(self, fields: Fields) -> None:
        """Decode the position; before there is an estimate, ArduPilot sends zeros and PX4 nothing."""
        latitude, longitude = fields["lat"], fields["lon"]
        if latitude == 0 and longitude == 0:
            return
        telemetry = self._telemetry
        telemetry.update_position(Position(latitude / 1e7, longitude / 1e7, AMSL(fields["alt"] / 1000.0)))
        telemetry.above_home = fields["relative_alt"] / 1000.0
        telemetry.velocity = Velocity(fields["vx"] / 100.0, fields["vy"] / 100.0, -fields["vz"] / 100.0)
        self._heading(fields["hdg"])

    def _heading(self, centidegrees: int) -> None:
        if centidegrees != _UNKNOWN_16:
            roll, pitch, _ = self._telemetry.attitude
            self._telemetry.attitude = Attitude(roll, pitch, centidegrees / 100.0)

    def _sys_status(self, fields: Fields) -> None:
        self._telemetry.armable = bool(fields["onboard_control_sensors_health"] & PREARM_CHECK)
        volts, amperes = fields["voltage_battery"], fields["current_battery"]
        remaining: int = fields["battery_remaining"]
        # not measured: -1 in the definition; a current of -100 (-1 A) from PX4, 0 V from ArduPilot
        self._telemetry.battery = Battery(
            remaining / 100.0 if 0 <= remaining <= 100 else nan,
            volts / 1000.0 if 0 < volts < _UNKNOWN_16 else nan,
            amperes / 100.0 if amperes >= 0 else nan,
        )
        self._update_ready()

    def _no_position(self) -> int:
        """Return the flags of the estimator's state with which there is no horizontal position."""
        return NO_POSITION

    def _estimator(self, fields: Fields) -> None:
        flags: int = fields["flags"]
        self._estimates_position = bool(flags & HORIZONTAL_POSITION) and not flags & self._no_position()
        self._telemetry.note_estimate(self._estimates_position)
        self._update_ready()

    def _home_position(self, fields: Fields) -> None:
        altitude = AMSL(fields["altitude"] / 1000.0)
        self._telemetry.home = Position(fields["latitude"] / 1e7, fields["longitude"] / 1e7, altitude)
        self._update_ready()

    def _target(self, fields: Fields) -> None:
        altitude = AMSL(fields["alt"])
        self._telemetry.target = Position(fields["lat_int"] / 1e7, fields["lon_int"] / 1e7, altitude)

    def _gps(self, fields: Fields) -> None:
        self._telemetry.fix = entry_name("GPS_FIX_TYPE", fields["fix_type"]).lower()
        self._telemetry.satellites = fields["satellites_visible"]

    def _attitude(self, fields: Fields) -> None:
        heading = degrees(fields["yaw"]) % 360.0
        self._telemetry.attitude = Attitude(degrees(fields["roll"]), degrees(fields["pitch"]), heading)

    def _vfr_hud(self, fields: Fields) -> None:
        self._telemetry.thrust = fields["throttle"] / 100.0

    def _rc_channels(self, fields: Fields) -> None:
        count = min(fields["chancount"], RC_CHANNELS)
        self._telemetry.rc = tuple(fields[f"chan{number}_raw"] for number in range(1, count + 1))
        self._telemetry.rc_ns = self._kernel.now()

    def _reached(self, fields: Fields) -> None:
        self._telemetry.mission_reached = fields["seq"]

    def _mission_current(self, fields: Fields) -> None:
        self._telemetry.mission_item = fields["seq"]
        self._telemetry.mission_ended = fields["mission_state"] == COMPLETE
