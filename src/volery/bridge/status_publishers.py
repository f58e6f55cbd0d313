"""Publishers of the state, battery, texts, RC channels and instruments, and of ``/diagnostics``.

Altitude in ``vfr_hud`` is AMSL. Diagnostics are published once per heartbeat while ``/diagnostics`` has a
subscription. As in MAVROS, the status names follow the name of the vehicle node: ``FCU connection``,
``Heartbeat``, ``System``, ``Battery``, ``GPS``. Levels are those of ``diagnostic_msgs/DiagnosticStatus``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import nan
from typing import Any, NamedTuple

from volery.base.time import Ns
from volery.bridge.autopilot_link import AutopilotType, mode_name
from volery.bridge.node_interface import (
    BODY,
    LATCHED_STATE,
    Fields,
    InterfaceContext,
    PublishedByNode,
    Translator,
    stamped,
)
from volery.links.mavlink_messages import StatusTextAssembler, constant, entry_name
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
"""Fields of the ROS message and of the MAVLink message."""

STATUS_TOPICS = (
    PublishedByNode("state", "mavros_msgs/msg/State", LATCHED_STATE),
    PublishedByNode("extended_state", "mavros_msgs/msg/ExtendedState"),
    PublishedByNode("battery", "sensor_msgs/msg/BatteryState"),
    PublishedByNode("sys_status", "mavros_msgs/msg/SysStatus", on_demand=True),
    PublishedByNode("statustext/recv", "mavros_msgs/msg/StatusText"),
    PublishedByNode("vfr_hud", "mavros_msgs/msg/VfrHud"),
    PublishedByNode("rc/in", "mavros_msgs/msg/RCIn"),
    PublishedByNode("rc/out", "mavros_msgs/msg/RCOut", on_demand=True),
)


class StatusPublisher:
    """Publishes state, battery, texts, RC channels and instruments."""

    def __init__(self, context: InterfaceContext) -> None:
        self._publish, self._wanted = context.publish, context.wanted
        self._texts = StatusTextAssembler(self._publish_text)
        self._text_at: Ns = 0

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
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
        """Publish that the autopilot has stopped sending."""
        self._publish("state", new("mavros_msgs/msg/State", header=stamped(stamp)))

    def _heartbeat(self, fields: Fields, at: Ns) -> None:
        base = fields["base_mode"]
        self._publish(
            "state",
            new(
                "mavros_msgs/msg/State",
                header=stamped(at),
                connected=True,
                armed=bool(base & 128),
                guided=bool(base & 8),
                manual_input=bool(base & 64),
                mode=mode_name(AutopilotType(fields["autopilot"], fields["type"]), fields["custom_mode"]),
                system_status=fields["system_status"],
            ),
        )

    def _extended_state(self, fields: Fields, at: Ns) -> None:
        message = new(
            "mavros_msgs/msg/ExtendedState",
            header=stamped(at),
            vtol_state=fields["vtol_state"],
            landed_state=fields["landed_state"],
        )
        self._publish("extended_state", message)

    def _sys_status(self, fields: Fields, at: Ns) -> None:
        if self._wanted("sys_status"):
            values = {ours: fields[theirs] for ours, theirs in _SYS_STATUS.items()}
            self._publish("sys_status", new("mavros_msgs/msg/SysStatus", header=stamped(at), **values))
        self._battery(fields, at)

    def _battery(self, fields: Fields, at: Ns) -> None:
        """Publish the battery; the current is negative while discharging (sensor_msgs/BatteryState)."""
        millivolts, centiamperes = fields["voltage_battery"], fields["current_battery"]
        percent = fields["battery_remaining"]
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

    def _text(self, fields: Fields, at: Ns) -> None:
        """Publish a text, joining the chunks of a long one."""
        self._text_at = at
        self._texts.add(fields)

    def _publish_text(self, severity: int, text: str) -> None:
        header = stamped(self._text_at)
        message = new("mavros_msgs/msg/StatusText", header=header, severity=severity, text=text)
        self._publish("statustext/recv", message)

    def _vfr_hud(self, fields: Fields, at: Ns) -> None:
        self._publish(
            "vfr_hud",
            new(
                "mavros_msgs/msg/VfrHud",
                header=stamped(at),
                airspeed=fields["airspeed"],
                groundspeed=fields["groundspeed"],
                heading=fields["heading"],
                throttle=fields["throttle"] / 100.0,
                altitude=fields["alt"],
                climb=fields["climb"],
            ),
        )

    def _rc_in(self, fields: Fields, at: Ns) -> None:
        channels = [fields[f"chan{number}_raw"] for number in range(1, fields["chancount"] + 1)]
        message = new("mavros_msgs/msg/RCIn", header=stamped(at), rssi=fields["rssi"], channels=channels)
        self._publish("rc/in", message)

    def _rc_out(self, fields: Fields, at: Ns) -> None:
        """Publish the outputs 1 to 16; MAVLink 1 has only eight."""
        if self._wanted("rc/out"):
            channels = [fields.get(f"servo{number}_raw", 0) for number in range(1, _SERVOS + 1)]
            self._publish("rc/out", new("mavros_msgs/msg/RCOut", header=stamped(at), channels=channels))


DIAGNOSTICS = "/diagnostics"
_ARRAY = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN, ERROR, STALE = range(4)
LOW = 20
"""Percentage of the battery below which the level is WARN."""
_SAFETY_ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
_NO_FIX, _FIX_3D = 1, 3
_UNKNOWN_U8 = 255

_pair = message_class("diagnostic_msgs/msg/KeyValue")

DIAGNOSTIC_TOPICS = (PublishedByNode(DIAGNOSTICS, _ARRAY, on_demand=True),)


class Diagnostic(NamedTuple):
    """One status: level, message and values."""

    level: int
    message: str
    values: Mapping[str, object] = {}


class DiagnosticsPublisher:
    """Publishes diagnostics of the latest frames that the link keeps."""

    def __init__(self, context: InterfaceContext) -> None:
        self._link, self._node = context.link, context.node
        self._publish, self._wanted = context.publish, context.wanted

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        return {"HEARTBEAT": self._heartbeat}

    def disconnected(self, stamp: Ns) -> None:
        """Publish that the autopilot has stopped sending."""
        self._publish_findings(stamp, {"FCU connection": Diagnostic(ERROR, "not connected")})

    def _heartbeat(self, fields: Fields, at: Ns) -> None:
        checks: dict[str, tuple[str, Callable[[Fields], Diagnostic]]] = {
            "System": ("SYS_STATUS", _system),
            "Battery": ("SYS_STATUS", _battery),
            "GPS": ("GPS_RAW_INT", _gps),
        }
        found = {"FCU connection": Diagnostic(OK, "connected"), "Heartbeat": self._heartbeat_finding(fields)}
        for name, (frame, check) in checks.items():
            last = self._link.last(frame)
            found[name] = Diagnostic(STALE, f"no {frame} yet") if last is None else check(last)
        self._publish_findings(at, found)

    def _heartbeat_finding(self, fields: Fields) -> Diagnostic:
        status = entry_name("MAV_STATE", fields["system_status"])
        values = {
            "Vehicle type": entry_name("MAV_TYPE", fields["type"]),
            "Autopilot type": entry_name("MAV_AUTOPILOT", fields["autopilot"]),
            "Mode": mode_name(self._link.autopilot, fields["custom_mode"]),
            "Armed": bool(fields["base_mode"] & _SAFETY_ARMED),
            "System status": status,
        }
        critical = status in ("CRITICAL", "EMERGENCY")
        return Diagnostic(ERROR if critical else OK, status.lower() if critical else "Normal", values)

    def _publish_findings(self, at: Ns, found: Mapping[str, Diagnostic]) -> None:
        if not self._wanted(DIAGNOSTICS):
            return
        name = self._node.name.lstrip("/")
        statuses = [_status(f"{name}: {what}", name, one) for what, one in found.items()]
        self._publish(DIAGNOSTICS, new(_ARRAY, header=stamped(at), status=statuses))


def _status(name: str, hardware: str, found: Diagnostic) -> Any:
    values = [_pair(key, str(one)) for key, one in found.values.items()]
    return new(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=found.level,
        name=name,
        message=found.message,
        hardware_id=hardware,
        values=values,
    )


def _system(fields: Fields) -> Diagnostic:
    """Return the enabled sensors that are unhealthy, and the load of the autopilot's processor."""
    enabled, healthy = fields["onboard_control_sensors_enabled"], fields["onboard_control_sensors_health"]
    unhealthy = enabled & ~healthy
    values = {
        "Sensor present": f"0x{fields['onboard_control_sensors_present']:08X}",
        "Sensor enabled": f"0x{enabled:08X}",
        "Sensor health": f"0x{healthy:08X}",
        "CPU Load (%)": f"{fields['load'] / 10.0:.1f}",
    }
    return (
        Diagnostic(ERROR, f"sensors are not well: 0x{unhealthy:08X}", values)
        if unhealthy
        else Diagnostic(OK, "Normal", values)
    )


def _battery(fields: Fields) -> Diagnostic:
    millivolts, centiamperes = fields["voltage_battery"], fields["current_battery"]
    percent = fields["battery_remaining"]
    if millivolts == _UNKNOWN_U16:
        return Diagnostic(STALE, "No data")
    values = {
        "Voltage": f"{millivolts / 1000.0:.2f}",
        "Current": "unknown" if centiamperes < 0 else f"{centiamperes / 100.0:.1f}",
        "Remaining": "unknown" if percent < 0 else f"{percent}",
    }
    low = 0 <= percent < LOW
    return Diagnostic(WARN, f"below {LOW} %", values) if low else Diagnostic(OK, "Normal", values)


def _gps(fields: Fields) -> Diagnostic:
    kind, seen, spread = fields["fix_type"], fields["satellites_visible"], fields["eph"]
    values = {
        "Satellites visible": "unknown" if seen == _UNKNOWN_U8 else f"{seen}",
        "Fix type": f"{kind}",
        "EPH (m)": "unknown" if spread == _UNKNOWN_U16 else f"{spread / 100.0:.2f}",
    }
    if kind <= _NO_FIX:
        return Diagnostic(WARN, "No satellites" if seen == 0 else "No fix", values)
    return Diagnostic(OK if kind >= _FIX_3D else WARN, "3D fix" if kind >= _FIX_3D else "2D fix", values)
