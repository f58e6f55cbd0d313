"""What the autopilot says of itself, as ROS messages: state, battery, texts, sticks, what a head-up
display shows.

``vfr_hud`` is AMSL.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import nan

from volery.base.time import Ns
from volery.bridge.modes import Firmware, mode_name
from volery.bridge.offering import BODY, LATCHED_STATE, Fields, Surroundings, Topic, Translate, stamped
from volery.links.status_texts import Texts
from volery.ros.messages import new

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

TOPICS = (
    Topic("state", "mavros_msgs/msg/State", LATCHED_STATE),
    Topic("extended_state", "mavros_msgs/msg/ExtendedState"),
    Topic("battery", "sensor_msgs/msg/BatteryState"),
    Topic("sys_status", "mavros_msgs/msg/SysStatus", on_demand=True),
    Topic("statustext/recv", "mavros_msgs/msg/StatusText"),
    Topic("vfr_hud", "mavros_msgs/msg/VfrHud"),
    Topic("rc/in", "mavros_msgs/msg/RCIn"),
    Topic("rc/out", "mavros_msgs/msg/RCOut", on_demand=True),
)


class Status:
    """Translates frames."""

    def __init__(self, around: Surroundings) -> None:
        self._publish, self._wanted = around.publish, around.wanted
        self._texts = Texts(self._say)
        self._text_at: Ns = 0

    def translators(self) -> Mapping[str, Translate]:
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
                mode=mode_name(Firmware(said["autopilot"], said["type"]), said["custom_mode"]),
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
        self._texts.hear(said)

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
