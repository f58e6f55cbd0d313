"""What is said of a vehicle: its telemetry as the fields of MAVLink's messages.

What is not known is not said, or said to be unknown in MAVLink's own way: -1, the largest integer, NaN. Three
fields have no such value and are zero: throttle, load and sensors. Local positions are about home.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import hypot, isnan, nan, radians
from typing import Any, NamedTuple

from volery.base.frames import LocalFrame, wrap
from volery.base.position import Position
from volery.base.time import MS, US
from volery.bridge.mode_names import DJI_ID, GENERIC_ID, PAPARAZZI_ID, AutopilotType, mode_number
from volery.kernel.api import Kernel
from volery.links.mavlink_messages import constant
from volery.ros.messages.dji_constants import HEALTHY_GPS
from volery.vehicles.driver import Driver

Fields = dict[str, Any]

AUTOPILOTS: Mapping[str, int] = {"Paparazzi": PAPARAZZI_ID, "DJI": DJI_ID}
"""MAV_AUTOPILOT by the first of the driver's words."""
KINDS: Mapping[str, int] = {"drone": constant("MAV_TYPE_QUADROTOR")}
"""MAV_TYPE by the driver's word. How many rotors a drone has is not known: it stands for a multirotor."""

FIXES: Mapping[str, int] = {
    "no_fix": 1,
    "2d": 2,
    "3d": 3,
    "dgps": 4,
    "rtk": 5,
    **{f"gps health {health}": 3 if health >= HEALTHY_GPS else 1 for health in range(6)},
}
"""GPS_FIX_TYPE by the autopilot's word."""

CUSTOM_MODE_ENABLED, GUIDED_ENABLED, SAFETY_ARMED = 1, 8, 128
STANDBY, ACTIVE, CRITICAL = 3, 4, 5
ON_GROUND, IN_AIR = 1, 2
MAVLINK_2 = 3
UNKNOWN_U8, UNKNOWN_U16 = 255, 65_535
_MOST_MS = 1 << 32


class Message(NamedTuple):
    """``made_of`` is what it is made of: ``None`` while that is not known, and another object when it was
    heard anew.
    """

    made_of: Callable[[], object]
    fields: Callable[[], Fields]


class TelemetryEncoder:
    """Says what *driver* has heard."""

    def __init__(self, kernel: Kernel, driver: Driver) -> None:
        self._kernel, self._driver = kernel, driver
        self._seen = driver.telemetry
        self._said: dict[str, object] = {}
        self.messages: Mapping[str, Message] = self._all()

    def _all(self) -> Mapping[str, Message]:
        seen = self._seen
        return {
            "HEARTBEAT": Message(lambda: self._heard(self.mode is not None), self._heartbeat),
            "SYS_STATUS": Message(
                lambda: self._heard(not all(isnan(one) for one in seen.battery)), self._sys_status
            ),
            "EXTENDED_SYS_STATE": Message(self._heard, self._extended_sys_state),
            "GPS_RAW_INT": Message(lambda: self._heard(seen.position is not None), self._gps_raw_int),
            "GLOBAL_POSITION_INT": Message(self._placed, self._global_position_int),
            "LOCAL_POSITION_NED": Message(
                lambda: None if seen.home is None else self._placed(), self._local_position_ned
            ),
            "ATTITUDE": Message(
                lambda: None if any(map(isnan, seen.attitude)) else seen.attitude, self._attitude
            ),
            "VFR_HUD": Message(
                lambda: None if isnan(seen.attitude.heading) else self._placed(), self._vfr_hud
            ),
            "HOME_POSITION": Message(lambda: seen.home, self._home_position),
            "GPS_GLOBAL_ORIGIN": Message(lambda: seen.home, self._gps_global_origin),
            "MISSION_CURRENT": Message(
                lambda: None if seen.mission_item < 0 else seen.mission_item,
                lambda: {"seq": seen.mission_item},
            ),
            "MISSION_ITEM_REACHED": Message(
                lambda: None if seen.mission_reached < 0 else seen.mission_reached,
                lambda: {"seq": seen.mission_reached},
            ),
        }

    def anew(self, name: str) -> Fields | None:
        """The fields of a message; ``None`` if nothing is known, or nothing was heard since it was said."""
        message = self.messages[name]
        made_of = message.made_of()
        if made_of is None or made_of is self._said.get(name):
            return None
        self._said[name] = made_of
        return message.fields()

    def again(self, name: str) -> Fields | None:
        """The same, for whoever asks: also what was said before."""
        self._said.pop(name, None)
        return self.anew(name)

    # -- what they are made of

    def _heard(self, known: bool = True) -> object:
        return self._seen.last_message_ns if known and self._seen.last_message_ns >= 0 else None

    def _placed(self) -> Position | None:
        seen = self._seen
        unknown = isnan(seen.above_home) or any(map(isnan, seen.velocity))
        return None if unknown else seen.position

    @property
    def firmware(self) -> AutopilotType:
        """Whose modes they are."""
        seen = self._seen
        maker = seen.autopilot.partition(" ")[0]
        return AutopilotType(AUTOPILOTS.get(maker, GENERIC_ID), KINDS.get(seen.kind, 0))

    @property
    def mode(self) -> int | None:
        """The number of its mode. What the driver says behind the name, as by whom it is, has none."""
        return mode_number(self.firmware, self._seen.mode.partition(" ")[0])

    def _boot_ms(self) -> int:
        return self._kernel.now() // MS % _MOST_MS

    # -- the fields

    def _heartbeat(self) -> Fields:
        seen, firmware = self._seen, self.firmware
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
            **_on_globe(seen.position, "lat", "lon", "alt"),
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
            **_on_globe(seen.position, "lat", "lon", "alt"),
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
        place = _on_globe(self._seen.home, "latitude", "longitude", "altitude")
        return {**place, "x": 0.0, "y": 0.0, "z": 0.0, "q": (nan,) * 4, **unknown}

    def _gps_global_origin(self) -> Fields:
        return _on_globe(self._seen.home, "latitude", "longitude", "altitude")


def local_frame(home: Position) -> LocalFrame:
    """The frame of local positions."""
    return LocalFrame(home.latitude, home.longitude, home.altitude.metres)


def _on_globe(position: Position | None, latitude: str, longitude: str, altitude: str) -> Fields:
    assert position is not None
    return {
        latitude: round(position.latitude * 1e7),
        longitude: round(position.longitude * 1e7),
        altitude: round(position.altitude.metres * 1e3),
    }
