"""How the vehicle is, for ``/diagnostics``: once a heartbeat, while somebody listens.

MAVROS's statuses, each behind the name of the vehicle node: ``FCU connection``, ``Heartbeat``, ``System``,
``Battery``, ``GPS``. Levels are those of ``diagnostic_msgs/DiagnosticStatus``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from volery.base.time import Ns
from volery.bridge.modes import mode_name
from volery.bridge.offering import Fields, Surroundings, Topic, Translate, stamped
from volery.links.mavlink import entry_name
from volery.ros.messages import message_class, new

DIAGNOSTICS = "/diagnostics"
_ARRAY = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN, ERROR, STALE = range(4)
LOW = 20
"""Percent of the battery below which one is warned."""
_SAFETY_ARMED = 128
_NO_FIX, _FIX_3D = 1, 3
_UNKNOWN_U16, _UNKNOWN_U8 = 65535, 255

_pair = message_class("diagnostic_msgs/msg/KeyValue")

TOPICS = (Topic(DIAGNOSTICS, _ARRAY, on_demand=True),)


class Found(NamedTuple):
    """One status: how grave, in words, and what it is made of."""

    level: int
    words: str
    values: Mapping[str, object] = {}


class Diagnostics:
    """Looks at the latest frames of each kind, which the wire keeps."""

    def __init__(self, around: Surroundings) -> None:
        self._wire, self._node = around.wire, around.node
        self._publish, self._wanted = around.publish, around.wanted

    def translators(self) -> Mapping[str, Translate]:
        """By the name of the frame."""
        return {"HEARTBEAT": self._heartbeat}

    def disconnected(self, stamp: Ns) -> None:
        """Publish that the autopilot has fallen silent."""
        self._tell(stamp, {"FCU connection": Found(ERROR, "not connected")})

    def _heartbeat(self, said: Fields, at: Ns) -> None:
        looks: dict[str, tuple[str, Callable[[Fields], Found]]] = {
            "System": ("SYS_STATUS", _system),
            "Battery": ("SYS_STATUS", _battery),
            "GPS": ("GPS_RAW_INT", _gps),
        }
        found = {"FCU connection": Found(OK, "connected"), "Heartbeat": self._beat(said)}
        for name, (frame, look) in looks.items():
            last = self._wire.last(frame)
            found[name] = Found(STALE, f"no {frame} yet") if last is None else look(last)
        self._tell(at, found)

    def _beat(self, said: Fields) -> Found:
        status = entry_name("MAV_STATE", said["system_status"])
        values = {
            "Vehicle type": entry_name("MAV_TYPE", said["type"]),
            "Autopilot type": entry_name("MAV_AUTOPILOT", said["autopilot"]),
            "Mode": mode_name(self._wire.firmware, said["custom_mode"]),
            "Armed": bool(said["base_mode"] & _SAFETY_ARMED),
            "System status": status,
        }
        grave = status in ("CRITICAL", "EMERGENCY")
        return Found(ERROR if grave else OK, status.lower() if grave else "Normal", values)

    def _tell(self, at: Ns, found: Mapping[str, Found]) -> None:
        if not self._wanted(DIAGNOSTICS):
            return
        name = self._node.name.lstrip("/")
        statuses = [_status(f"{name}: {what}", name, one) for what, one in found.items()]
        self._publish(DIAGNOSTICS, new(_ARRAY, header=stamped(at), status=statuses))


def _status(name: str, hardware: str, found: Found) -> Any:
    values = [_pair(key, str(one)) for key, one in found.values.items()]
    return new(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=found.level,
        name=name,
        message=found.words,
        hardware_id=hardware,
        values=values,
    )


def _system(said: Fields) -> Found:
    """Sensors that are switched on and not well, and the load of the autopilot's processor."""
    enabled, well = said["onboard_control_sensors_enabled"], said["onboard_control_sensors_health"]
    ill = enabled & ~well
    values = {
        "Sensor present": f"0x{said['onboard_control_sensors_present']:08X}",
        "Sensor enabled": f"0x{enabled:08X}",
        "Sensor health": f"0x{well:08X}",
        "CPU Load (%)": f"{said['load'] / 10.0:.1f}",
    }
    return Found(ERROR, f"sensors are not well: 0x{ill:08X}", values) if ill else Found(OK, "Normal", values)


def _battery(said: Fields) -> Found:
    millivolts, centiamperes = said["voltage_battery"], said["current_battery"]
    percent = said["battery_remaining"]
    if millivolts == _UNKNOWN_U16:
        return Found(STALE, "No data")
    values = {
        "Voltage": f"{millivolts / 1000.0:.2f}",
        "Current": "unknown" if centiamperes < 0 else f"{centiamperes / 100.0:.1f}",
        "Remaining": "unknown" if percent < 0 else f"{percent}",
    }
    low = 0 <= percent < LOW
    return Found(WARN, f"below {LOW} %", values) if low else Found(OK, "Normal", values)


def _gps(said: Fields) -> Found:
    kind, seen, spread = said["fix_type"], said["satellites_visible"], said["eph"]
    values = {
        "Satellites visible": "unknown" if seen == _UNKNOWN_U8 else f"{seen}",
        "Fix type": f"{kind}",
        "EPH (m)": "unknown" if spread == _UNKNOWN_U16 else f"{spread / 100.0:.2f}",
    }
    if kind <= _NO_FIX:
        return Found(WARN, "No satellites" if seen == 0 else "No fix", values)
    return Found(OK if kind >= _FIX_3D else WARN, "3D fix" if kind >= _FIX_3D else "2D fix", values)
