"""What a MAV_TYPE is, for those that can be commanded.

What the messages that all MAVLink autopilots send say, as ``Telemetry``. One method for each message.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from math import degrees, nan
from typing import Any

from volery.base.errors import UsageError
from volery.base.position import AMSL, Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.links.mavlink_conventions import StatusTextAssembler
from volery.links.mavlink_messages import constant, entry_name
from volery.trace.events import Text
from volery.vehicles.drivers.mavlink.backend import ACTIVE, ARMED, FAILSAFE, ON_GROUND, UNDEFINED
from volery.vehicles.drivers.steps import DRONE_KIND, ROVER_KIND
from volery.vehicles.telemetry import Attitude, Battery, StatusText, Telemetry, Velocity

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


def vehicle_kind(mav_type: int) -> str:
    """Its kind; for others MAVLink's own word."""
    return KINDS.get(mav_type) or entry_name("MAV_TYPE", mav_type).lower().replace("_", " ")


Fields = Mapping[str, Any]
Handler = Callable[[Fields], None]

PREARM_CHECK = constant("MAV_SYS_STATUS_PREARM_CHECK")
HORIZONTAL_POSITION = constant("ESTIMATOR_POS_HORIZ_ABS")
NO_POSITION = constant("ESTIMATOR_CONST_POS_MODE")
"""The same bits stand in ArduPilot's EKF_STATUS_REPORT and in PX4's ESTIMATOR_STATUS."""
COMPLETE = constant("MISSION_STATE_COMPLETE")
_UNKNOWN_16 = 65535
_UNKNOWN = -1


class TelemetryDecoder(ABC):
    """Turns messages into telemetry. ``hear`` one; it says whether it was of interest.

    ``autopilot`` is the firmware's name, ``resting`` the mode in which an armed rover stands, ``beat`` when
    the last heartbeat came. *record*: the autopilot's texts go into the trace, too.
    """

    autopilot = ""
    resting = ""

    def __init__(self, kernel: Kernel, telemetry: Telemetry, *, record: bool = True) -> None:
        self.beat: Ns = -1
        self._kernel = kernel
        self._seen = telemetry
        self._records = record
        self._texts = StatusTextAssembler(self.say)
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
            "STATUSTEXT": self._texts.add,
            "MISSION_ITEM_REACHED": self._reached,
            "MISSION_CURRENT": self._mission_current,
        }

    def hear(self, name: str, fields: Fields) -> bool:
        """Take note of a message of our autopilot. One that puts it off the globe is left unheard."""
        self._seen.last_message_ns = self._kernel.now()
        handler = self._handlers.get(name)
        if handler is None:
            return False
        try:
            handler(fields)
        except UsageError:
            return False
        return True

    @abstractmethod
    def _mode_name(self, number: int) -> str:
        """The firmware's name of a ``custom_mode``."""

    def _judge_ready(self) -> None:
        """It could arm now, and the estimator has a position."""
        self._seen.ready = self._seen.armable and self._estimates_position

    def _heartbeat(self, fields: Fields) -> None:
        seen = self._seen
        self.beat = self._kernel.now()
        seen.kind = vehicle_kind(fields["type"])
        seen.autopilot = self.autopilot
        seen.mode = self._mode_name(fields["custom_mode"])
        seen.armed = bool(fields["base_mode"] & ARMED)
        status: int = fields["system_status"]
        seen.status = entry_name("MAV_STATE", status).lower()
        seen.failsafe = status in FAILSAFE
        self._judge_flying(status)

    def _judge_flying(self, status: int) -> None:
        """The landed state says it, where it is sent; a rover rests in one mode, else is off once armed."""
        seen = self._seen
        if seen.kind != DRONE_KIND:
            seen.flying = seen.armed and seen.mode != self.resting
        elif self._landed_state == UNDEFINED:
            seen.flying = seen.armed and status == ACTIVE

    def _extended_state(self, fields: Fields) -> None:
        self._landed_state = fields["landed_state"]
        if self._landed_state != UNDEFINED and self._seen.kind == DRONE_KIND:
            self._seen.flying = self._landed_state != ON_GROUND

    def _global_position(self, fields: Fields) -> None:
        """Before there is an estimate, ArduPilot sends zeros and PX4 nothing."""
        latitude, longitude = fields["lat"], fields["lon"]
        if latitude == 0 and longitude == 0:
            return
        seen = self._seen
        seen.position = Position(latitude / 1e7, longitude / 1e7, AMSL(fields["alt"] / 1000.0))
        seen.above_home = fields["relative_alt"] / 1000.0
        seen.velocity = Velocity(fields["vx"] / 100.0, fields["vy"] / 100.0, -fields["vz"] / 100.0)
        heading: int = fields["hdg"]
        if heading != _UNKNOWN_16:
            roll, pitch, _ = seen.attitude
            seen.attitude = Attitude(roll, pitch, heading / 100.0)

    def _sys_status(self, fields: Fields) -> None:
        seen = self._seen
        seen.armable = bool(fields["onboard_control_sensors_health"] & PREARM_CHECK)
        volts, amperes = fields["voltage_battery"], fields["current_battery"]
        remaining: int = fields["battery_remaining"]
        seen.battery = Battery(
            nan if remaining == _UNKNOWN else remaining / 100.0,
            nan if volts == _UNKNOWN_16 else volts / 1000.0,
            nan if amperes == _UNKNOWN else amperes / 100.0,
        )
        self._judge_ready()

    def _estimator(self, fields: Fields) -> None:
        flags: int = fields["flags"]
        self._estimates_position = bool(flags & HORIZONTAL_POSITION) and not flags & NO_POSITION
        self._judge_ready()

    def _home_position(self, fields: Fields) -> None:
        altitude = AMSL(fields["altitude"] / 1000.0)
        self._seen.home = Position(fields["latitude"] / 1e7, fields["longitude"] / 1e7, altitude)

    def _target(self, fields: Fields) -> None:
        altitude = AMSL(fields["alt"])
        self._seen.target = Position(fields["lat_int"] / 1e7, fields["lon_int"] / 1e7, altitude)

    def _gps(self, fields: Fields) -> None:
        self._seen.fix = entry_name("GPS_FIX_TYPE", fields["fix_type"]).lower()
        self._seen.satellites = fields["satellites_visible"]

    def _attitude(self, fields: Fields) -> None:
        heading = degrees(fields["yaw"]) % 360.0
        self._seen.attitude = Attitude(degrees(fields["roll"]), degrees(fields["pitch"]), heading)

    def _reached(self, fields: Fields) -> None:
        self._seen.mission_reached = fields["seq"]

    def _mission_current(self, fields: Fields) -> None:
        self._seen.mission_item = fields["seq"]
        self._seen.mission_ended = fields["mission_state"] == COMPLETE

    def say(self, severity: int, text: str) -> None:
        """The autopilot says this."""
        now = self._kernel.now()
        self._seen.texts.append(StatusText(now, severity, text))
        if self._records:
            self._kernel.record(Text(now, self._seen.name, severity, text))
