"""Encoding of a vehicle's telemetry as MAVLink messages.

A message with unknown content is not encoded; an unknown field has MAVLink's value for unknown: -1, the
largest integer, or NaN. Three fields have no such value and are zero: throttle, load and sensors. Local
positions are about home.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import hypot, isnan, nan, radians
from typing import Any, NamedTuple

from volery.base.frames import LocalFrame, wrap
from volery.base.position import Position
from volery.base.time import MS, US
from volery.bridge.autopilot_link import DJI_ID, GENERIC_ID, PAPARAZZI_ID, AutopilotType, mode_number
from volery.kernel.api import Kernel
from volery.links.mavlink_messages import constant
from volery.ros.messages.dji_constants import HEALTHY_GPS
from volery.vehicles.driver import Driver

Fields = dict[str, Any]

AUTOPILOTS: Mapping[str, int] = {"Paparazzi": PAPARAZZI_ID, "DJI": DJI_ID}
"""MAV_AUTOPILOT by the first word of the driver's autopilot name."""
KINDS: Mapping[str, int] = {"drone": constant("MAV_TYPE_QUADROTOR")}
"""MAV_TYPE by the kind of vehicle. The number of rotors is unknown: a quadrotor stands for any multirotor."""

FIXES: Mapping[str, int] = {
    "no_fix": 1,
    "2d": 2,
    "3d": 3,
    "dgps": 4,
    "rtk": 5,
    **{f"gps health {health}": 3 if health >= HEALTHY_GPS else 1 for health in range(6)},
}
"""GPS_FIX_TYPE by the name that the autopilot gives to a fix."""

CUSTOM_MODE_ENABLED = constant("MAV_MODE_FLAG_CUSTOM_MODE_ENABLED")
GUIDED_ENABLED = constant("MAV_MODE_FLAG_GUIDED_ENABLED")
SAFETY_ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
STANDBY = constant("MAV_STATE_STANDBY")
ACTIVE = constant("MAV_STATE_ACTIVE")
CRITICAL = constant("MAV_STATE_CRITICAL")
ON_GROUND = constant("MAV_LANDED_STATE_ON_GROUND")
IN_AIR = constant("MAV_LANDED_STATE_IN_AIR")
MAVLINK_2 = 3
UNKNOWN_U8, UNKNOWN_U16 = 255, 65_535
_MOST_MS = 1 << 32


class EncodedMessage(NamedTuple):
    """How one message is encoded.

    Args:
        source: Returns what the message is made of: None while it is unknown, another object after an update.
        fields: Returns the fields of the message.
    """

    source: Callable[[], object]
    fields: Callable[[], Fields]


class TelemetryEncoder:
    """Encodes the telemetry of *driver*."""

    def __init__(self, kernel: Kernel, driver: Driver) -> None:
        self._kernel, self._driver = kernel, driver
        self._seen = driver.telemetry
        self._encoded: dict[str, object] = {}  # source of the last encoding
        self.messages: Mapping[str, EncodedMessage] = self._make_messages()

    def _make_messages(self) -> Mapping[str, EncodedMessage]:
        seen = self._seen
        return {
            "HEARTBEAT": EncodedMessage(lambda: self._received(self.mode is not None), self._heartbeat),
            "SYS_STATUS": EncodedMessage(
                lambda: self._received(not all(isnan(one) for one in seen.battery)), self._sys_status
            ),
            "EXTENDED_SYS_STATE": EncodedMessage(self._received, self._extended_sys_state),
            "GPS_RAW_INT": EncodedMessage(
                lambda: self._received(seen.position is not None), self._gps_raw_int
            ),
            "GLOBAL_POSITION_INT": EncodedMessage(self._known_position, self._global_position_int),
            "LOCAL_POSITION_NED": EncodedMessage(
                lambda: None if seen.home is None else self._known_position(), self._local_position_ned
            ),
            "ATTITUDE": EncodedMessage(
                lambda: None if any(map(isnan, seen.attitude)) else seen.attitude, self._attitude
            ),
            "VFR_HUD": EncodedMessage(
                lambda: None if isnan(seen.attitude.heading) else self._known_position(), self._vfr_hud
            ),
            "HOME_POSITION": EncodedMessage(lambda: seen.home, self._home_position),
            "GPS_GLOBAL_ORIGIN": EncodedMessage(lambda: seen.home, self._gps_global_origin),
            "MISSION_CURRENT": EncodedMessage(
                lambda: None if seen.mission_item < 0 else seen.mission_item,
                lambda: {"seq": seen.mission_item},
            ),
            "MISSION_ITEM_REACHED": EncodedMessage(
                lambda: None if seen.mission_reached < 0 else seen.mission_reached,
                lambda: {"seq": seen.mission_reached},
            ),
        }

    def encode_new(self, name: str) -> Fields | None:
        """Return the fields of a message, None if they are unknown or unchanged since the last time."""
        message = self.messages[name]
        source = message.source()
        if source is None or source is self._encoded.get(name):
            return None
        self._encoded[name] = source
        return message.fields()

    def encode(self, name: str) -> Fields | None:
        """Return the fields of a message, or None if they are unknown."""
        self._encoded.pop(name, None)
        return self.encode_new(name)

    # -- sources

    def _received(self, known: bool = True) -> object:
        return self._seen.last_message_ns if known and self._seen.last_message_ns >= 0 else None

    def _known_position(self) -> Position | None:
        seen = self._seen
        unknown = isnan(seen.above_home) or any(map(isnan, seen.velocity))
        return None if unknown else seen.position

    @property
    def autopilot(self) -> AutopilotType:
        """Autopilot and type of the vehicle, which determine the mode names."""
        seen = self._seen
        maker = seen.autopilot.partition(" ")[0]
        return AutopilotType(AUTOPILOTS.get(maker, GENERIC_ID), KINDS.get(seen.kind, 0))

    @property
    def mode(self) -> int | None:
        """Number of the current mode, or None. Only the first word of the driver's mode is the name."""
        return mode_number(self.autopilot, self._seen.mode.partition(" ")[0])

    def _boot_ms(self) -> int:
        return self._kernel.now() // MS % _MOST_MS

    # -- fields

    def _heartbeat(self) -> Fields:
        seen, firmware = self._seen, self.autopilot
        guided = GUIDED_ENABLED if seen.mode == self._driver.offboard_mode else 0
        return {
            "type": firmware.kind,
            "autopilot": firmware.autopilot,
            "base_mode": CUSTOM_MODE_ENABLED | guided | (SAFETY_ARMED if seen.armed else 0),
            "custom_mode": self.mode,
            "system_status": CRITICAL if seen.failsafe else ACTIVE if seen.armed else STANDBY,
            "mavlink_version": MAVLINK_2,
        }

    def _sys_status(self) -> Fields:
        remaining, volts, amperes = self._seen.battery
        return {
            "voltage_battery": UNKNOWN_U16 if isnan(volts) else min(round(volts * 1e3), UNKNOWN_U16 - 1),
            "current_battery": -1 if isnan(amperes) else min(max(round(amperes * 1e2), 0), 32_767),
            "battery_remaining": -1 if isnan(remaining) else round(remaining * 100.0),
        }

    def _extended_sys_state(self) -> Fields:
        return {"vtol_state": 0, "landed_state": IN_AIR if self._seen.flying else ON_GROUND}

    def _gps_raw_int(self) -> Fields:
        seen = self._seen
        return {
            "time_usec": self._kernel.now() // US,
            "fix_type": FIXES.get(seen.fix, 0),
            **_coordinates(seen.position, "lat", "lon", "alt"),
            "eph": UNKNOWN_U16,
            "epv": UNKNOWN_U16,
            "vel": UNKNOWN_U16,
            "cog": UNKNOWN_U16,
            "satellites_visible": seen.satellites or UNKNOWN_U8,
        }

    def _global_position_int(self) -> Fields:
        seen = self._seen
        north, east, up = (round(one * 100.0) for one in seen.velocity)
        heading = seen.attitude.heading
        return {
            "time_boot_ms": self._boot_ms(),
            **_coordinates(seen.position, "lat", "lon", "alt"),
            "relative_alt": round(seen.above_home * 1e3),
            "vx": north,
            "vy": east,
            "vz": -up,
            "hdg": UNKNOWN_U16 if isnan(heading) else round(heading * 100.0) % 36_000,
        }

    def _local_position_ned(self) -> Fields:
        seen = self._seen
        assert seen.home is not None
        assert seen.position is not None
        east, north, _ = local_frame(seen.home).to_enu(
            seen.position.latitude, seen.position.longitude, seen.home.altitude.metres
        )
        velocity = seen.velocity
        return {
            "time_boot_ms": self._boot_ms(),
            "x": north,
            "y": east,
            "z": -seen.above_home,
            "vx": velocity.north,
            "vy": velocity.east,
            "vz": -velocity.up,
        }

    def _attitude(self) -> Fields:
        roll, pitch, heading = (radians(one) for one in self._seen.attitude)
        rates = {"rollspeed": nan, "pitchspeed": nan, "yawspeed": nan}
        return {"time_boot_ms": self._boot_ms(), "roll": roll, "pitch": pitch, "yaw": wrap(heading), **rates}

    def _vfr_hud(self) -> Fields:
        seen = self._seen
        assert seen.position is not None
        return {
            "airspeed": nan,
            "groundspeed": hypot(seen.velocity.north, seen.velocity.east),
            "heading": round(seen.attitude.heading) % 360,
            "throttle": 0,
            "alt": seen.position.altitude.metres,
            "climb": seen.velocity.up,
        }

    def _home_position(self) -> Fields:
        unknown = {f"approach_{axis}": nan for axis in "xyz"}
        place = _coordinates(self._seen.home, "latitude", "longitude", "altitude")
        return {**place, "x": 0.0, "y": 0.0, "z": 0.0, "q": (nan,) * 4, **unknown}

    def _gps_global_origin(self) -> Fields:
        return _coordinates(self._seen.home, "latitude", "longitude", "altitude")


def local_frame(home: Position) -> LocalFrame:
    """Return the frame of local positions about *home*."""
    return LocalFrame(home.latitude, home.longitude, home.altitude.metres)


def _coordinates(position: Position | None, latitude: str, longitude: str, altitude: str) -> Fields:
    assert position is not None
    return {
        latitude: round(position.latitude * 1e7),
        longitude: round(position.longitude * 1e7),
        altitude: round(position.altitude.metres * 1e3),
    }
