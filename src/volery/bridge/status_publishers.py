"""What the autopilot says of itself, as ROS messages: state, battery, texts, sticks, what a head-up
display shows.

``vfr_hud`` is AMSL.

How the vehicle is, for ``/diagnostics``: once a heartbeat, while somebody listens.

MAVROS's statuses, each behind the name of the vehicle node: ``FCU connection``, ``Heartbeat``, ``System``,
``Battery``, ``GPS``. Levels are those of ``diagnostic_msgs/DiagnosticStatus``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import nan
from typing import Any, NamedTuple

from volery.base.time import Ns
from volery.bridge.mode_names import AutopilotType, mode_name
from volery.bridge.node_interface import (
    BODY,
    LATCHED_STATE,
    Fields,
    InterfaceContext,
    Topic,
    Translator,
    stamped,
)
from volery.links.mavlink_conventions import StatusTextAssembler
from volery.links.mavlink_messages import entry_name
from volery.ros.messages import message_class, new

_UNKNOWN_U16 = 65535
_SERVOS = 16
_SYS_STATUS = {
    "sensors_present": "onboard_control_sensors_present",
    "sensors_enabled": "onboard_control_sensors_enabled",
    "sensors_health": "onboard_control_sensors_health",
    "load": "load",
    "voltage_battery": "voltage_battery",
    "current_battery": "current_battery",
    "battery_remaining": "battery_remaining",
    "drop_rate_comm": "drop_rate_comm",
    "errors_comm": "errors_comm",
    "errors_count1": "errors_count1",
    "errors_count2": "errors_count2",
    "errors_count3": "errors_count3",
    "errors_count4": "errors_count4",
}
"""Fields of the message and of the frame."""

STATUS_TOPICS = (
    Topic("state", "mavros_msgs/msg/State", LATCHED_STATE),
    Topic("extended_state", "mavros_msgs/msg/ExtendedState"),
    Topic("battery", "sensor_msgs/msg/BatteryState"),
    Topic("sys_status", "mavros_msgs/msg/SysStatus", on_demand=True),
    Topic("statustext/recv", "mavros_msgs/msg/StatusText"),
    Topic("vfr_hud", "mavros_msgs/msg/VfrHud"),
    Topic("rc/in", "mavros_msgs/msg/RCIn"),
    Topic("rc/out", "mavros_msgs/msg/RCOut", on_demand=True),
)


class StatusPublisher:
    """Translates frames."""

    def __init__(self, around: InterfaceContext) -> None:
        self._publish, self._wanted = around.publish, around.wanted
        self._texts = StatusTextAssembler(self._say)
        self._text_at: Ns = 0

    def translators(self) -> Mapping[str, Translator]:
        """By the name of the frame."""
        return {
            "HEARTBEAT": self._heartbeat,
            "EXTENDED_SYS_STATE": self._extended_state,
            "SYS_STATUS": self._sys_status,
            "STATUSTEXT": self._text,
            "VFR_HUD": self._vfr_hud,
            "RC_CHANNELS": self._rc_in,
            "SERVO_OUTPUT_RAW": self._rc_out,
        }

    def disconnected(self, stamp: Ns) -> None:
        """Publish that the autopilot has fallen silent."""
        self._publish("state", new("mavros_msgs/msg/State", header=stamped(stamp)))

    def _heartbeat(self, said: Fields, at: Ns) -> None:
        base = said["base_mode"]
        self._publish(
            "state",
            new(
                "mavros_msgs/msg/State",
                header=stamped(at),
                connected=True,
                armed=bool(base & 128),
                guided=bool(base & 8),
                manual_input=bool(base & 64),
                mode=mode_name(AutopilotType(said["autopilot"], said["type"]), said["custom_mode"]),
                system_status=said["system_status"],
            ),
        )

    def _extended_state(self, said: Fields, at: Ns) -> None:
        message = new(
            "mavros_msgs/msg/ExtendedState",
            header=stamped(at),
            vtol_state=said["vtol_state"],
            landed_state=said["landed_state"],
        )
        self._publish("extended_state", message)

    def _sys_status(self, said: Fields, at: Ns) -> None:
        if self._wanted("sys_status"):
            fields = {ours: said[theirs] for ours, theirs in _SYS_STATUS.items()}
            self._publish("sys_status", new("mavros_msgs/msg/SysStatus", header=stamped(at), **fields))
        self._battery(said, at)

    def _battery(self, said: Fields, at: Ns) -> None:
        """Current is negative while it discharges (sensor_msgs/BatteryState)."""
        millivolts, centiamperes = said["voltage_battery"], said["current_battery"]
        percent = said["battery_remaining"]
        self._publish(
            "battery",
            new(
                "sensor_msgs/msg/BatteryState",
                header=stamped(at, BODY),
                voltage=nan if millivolts == _UNKNOWN_U16 else millivolts / 1000.0,
                current=nan if centiamperes < 0 else -centiamperes / 100.0,
                percentage=nan if percent < 0 else percent / 100.0,
                temperature=nan,
                charge=nan,
                capacity=nan,
                design_capacity=nan,
                power_supply_status=2,
                present=True,
            ),
        )

    def _text(self, said: Fields, at: Ns) -> None:
        """A long one, which comes in pieces, is published whole."""
        self._text_at = at
        self._texts.add(said)

    def _say(self, severity: int, text: str) -> None:
        header = stamped(self._text_at)
        message = new("mavros_msgs/msg/StatusText", header=header, severity=severity, text=text)
        self._publish("statustext/recv", message)

    def _vfr_hud(self, said: Fields, at: Ns) -> None:
        self._publish(
            "vfr_hud",
            new(
                "mavros_msgs/msg/VfrHud",
                header=stamped(at),
                airspeed=said["airspeed"],
                groundspeed=said["groundspeed"],
                heading=said["heading"],
                throttle=said["throttle"] / 100.0,
                altitude=said["alt"],
                climb=said["climb"],
            ),
        )

    def _rc_in(self, said: Fields, at: Ns) -> None:
        channels = [said[f"chan{number}_raw"] for number in range(1, said["chancount"] + 1)]
        message = new("mavros_msgs/msg/RCIn", header=stamped(at), rssi=said["rssi"], channels=channels)
        self._publish("rc/in", message)

    def _rc_out(self, said: Fields, at: Ns) -> None:
        """Ports 1 to 16; the second eight are missing in MAVLink 1."""
        if self._wanted("rc/out"):
            channels = [said.get(f"servo{number}_raw", 0) for number in range(1, _SERVOS + 1)]
            self._publish("rc/out", new("mavros_msgs/msg/RCOut", header=stamped(at), channels=channels))


DIAGNOSTICS = "/diagnostics"
_ARRAY = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN, ERROR, STALE = range(4)
LOW = 20
"""Percent of the battery below which one is warned."""
_SAFETY_ARMED = 128
_NO_FIX, _FIX_3D = 1, 3
_UNKNOWN_U16_diagnostics, _UNKNOWN_U8 = 65535, 255

_pair = message_class("diagnostic_msgs/msg/KeyValue")

DIAGNOSTIC_TOPICS = (Topic(DIAGNOSTICS, _ARRAY, on_demand=True),)


class Finding(NamedTuple):
    """One status: how grave, in words, and what it is made of."""

    level: int
    words: str
    values: Mapping[str, object] = {}


class DiagnosticsPublisher:
    """Looks at the latest frames of each kind, which the wire keeps."""

    def __init__(self, around: InterfaceContext) -> None:
        self._wire, self._node = around.wire, around.node
        self._publish, self._wanted = around.publish, around.wanted

    def translators(self) -> Mapping[str, Translator]:
        """By the name of the frame."""
        return {"HEARTBEAT": self._heartbeat}

    def disconnected(self, stamp: Ns) -> None:
        """Publish that the autopilot has fallen silent."""
        self._tell(stamp, {"FCU connection": Finding(ERROR, "not connected")})

    def _heartbeat(self, said: Fields, at: Ns) -> None:
        looks: dict[str, tuple[str, Callable[[Fields], Finding]]] = {
            "System": ("SYS_STATUS", _system),
            "Battery": ("SYS_STATUS", _battery),
            "GPS": ("GPS_RAW_INT", _gps),
        }
        found = {"FCU connection": Finding(OK, "connected"), "Heartbeat": self._beat(said)}
        for name, (frame, look) in looks.items():
            last = self._wire.last(frame)
            found[name] = Finding(STALE, f"no {frame} yet") if last is None else look(last)
        self._tell(at, found)

    def _beat(self, said: Fields) -> Finding:
        status = entry_name("MAV_STATE", said["system_status"])
        values = {
            "Vehicle type": entry_name("MAV_TYPE", said["type"]),
            "Autopilot type": entry_name("MAV_AUTOPILOT", said["autopilot"]),
            "Mode": mode_name(self._wire.firmware, said["custom_mode"]),
            "Armed": bool(said["base_mode"] & _SAFETY_ARMED),
            "System status": status,
        }
        grave = status in ("CRITICAL", "EMERGENCY")
        return Finding(ERROR if grave else OK, status.lower() if grave else "Normal", values)

    def _tell(self, at: Ns, found: Mapping[str, Finding]) -> None:
        if not self._wanted(DIAGNOSTICS):
            return
        name = self._node.name.lstrip("/")
        statuses = [_status(f"{name}: {what}", name, one) for what, one in found.items()]
        self._publish(DIAGNOSTICS, new(_ARRAY, header=stamped(at), status=statuses))


def _status(name: str, hardware: str, found: Finding) -> Any:
    values = [_pair(key, str(one)) for key, one in found.values.items()]
    return new(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=found.level,
        name=name,
        message=found.words,
        hardware_id=hardware,
        values=values,
    )


def _system(said: Fields) -> Finding:
    """Sensors that are switched on and not well, and the load of the autopilot's processor."""
    enabled, well = said["onboard_control_sensors_enabled"], said["onboard_control_sensors_health"]
    ill = enabled & ~well
    values = {
        "Sensor present": f"0x{said['onboard_control_sensors_present']:08X}",
        "Sensor enabled": f"0x{enabled:08X}",
        "Sensor health": f"0x{well:08X}",
        "CPU Load (%)": f"{said['load'] / 10.0:.1f}",
    }
    return (
        Finding(ERROR, f"sensors are not well: 0x{ill:08X}", values) if ill else Finding(OK, "Normal", values)
    )


def _battery(said: Fields) -> Finding:
    millivolts, centiamperes = said["voltage_battery"], said["current_battery"]
    percent = said["battery_remaining"]
    if millivolts == _UNKNOWN_U16_diagnostics:
        return Finding(STALE, "No data")
    values = {
        "Voltage": f"{millivolts / 1000.0:.2f}",
        "Current": "unknown" if centiamperes < 0 else f"{centiamperes / 100.0:.1f}",
        "Remaining": "unknown" if percent < 0 else f"{percent}",
    }
    low = 0 <= percent < LOW
    return Finding(WARN, f"below {LOW} %", values) if low else Finding(OK, "Normal", values)


def _gps(said: Fields) -> Finding:
    kind, seen, spread = said["fix_type"], said["satellites_visible"], said["eph"]
    values = {
        "Satellites visible": "unknown" if seen == _UNKNOWN_U8 else f"{seen}",
        "Fix type": f"{kind}",
        "EPH (m)": "unknown" if spread == _UNKNOWN_U16_diagnostics else f"{spread / 100.0:.2f}",
    }
    if kind <= _NO_FIX:
        return Finding(WARN, "No satellites" if seen == 0 else "No fix", values)
    return Finding(OK if kind >= _FIX_3D else WARN, "3D fix" if kind >= _FIX_3D else "2D fix", values)
