"""roscopter's names: what it publishes and takes, under the same names, in the same types and units.

Differences from roscopter: it waits for frames instead of asking a thousand times a second; ``rc`` also
comes of RC_CHANNELS and ``raw_imu`` of SCALED_IMU and HIGHRES_IMU, where the autopilot sends those
instead; an arming that is refused is told as a warning, and on ``state``: the service's type has no place
for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from volery.base.time import Ns
from volery.bridge.autopilot_link import ALL
from volery.bridge.command_services import ARM_DISARM, CommandServices
from volery.bridge.mode_names import AutopilotType, mode_name
from volery.bridge.motion_publishers import IMU_SOURCES, imu_source
from volery.bridge.node_interface import (
    Fields,
    InterfaceContext,
    NamingScheme,
    NodeInterface,
    OutgoingMessage,
    Service,
    Subscription,
    Topic,
    Translator,
    merge_translators,
    stamped,
)
from volery.links.mavlink_messages import entry_name
from volery.ros.messages import new, service

CHANNELS = 8
MILLI = 1000.0
FIX_3D = 3
NO_FIX, FIX, GPS = -1, 0, 1
"""sensor_msgs/NavSatStatus."""
SAFETY_ARMED, GUIDED_ENABLED = 128, 8
"""MAV_MODE_FLAG."""
EMPTY = "std_srvs/srv/Empty"
RC = "roscopter/msg/RC"

TOPICS = (
    Topic("gps", "sensor_msgs/msg/NavSatFix"),
    Topic("rc", RC),
    Topic("state", "roscopter/msg/State"),
    Topic("vfr_hud", "roscopter/msg/VFR_HUD"),
    Topic("attitude", "roscopter/msg/Attitude"),
    Topic("raw_imu", "roscopter/msg/Mavlink_RAW_IMU"),
)
_ANGLES = ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed")
_MEASURED = tuple(f"{axis}{kind}" for kind in ("acc", "gyro", "mag") for axis in "xyz")


class Roscopter:
    """Translators and handlers."""

    def __init__(self, around: InterfaceContext) -> None:
        self._wire, self._publish, self._warn = around.wire, around.publish, around.warn
        self._commands = CommandServices(around)

    def translators(self) -> Mapping[str, Translator]:
        """By the name of the frame."""
        return {
            "GPS_RAW_INT": self._gps,
            "RC_CHANNELS": self._rc,
            "RC_CHANNELS_RAW": self._rc_raw,
            "HEARTBEAT": self._state,
            "VFR_HUD": self._vfr_hud,
            "ATTITUDE": self._attitude,
            **{name: partial(self._raw_imu, name) for name in IMU_SOURCES},
        }

    def _gps(self, said: Fields, at: Ns) -> None:
        """AMSL, as the receiver says it."""
        place = {"latitude": said["lat"] / 1e7, "longitude": said["lon"] / 1e7, "altitude": said["alt"] / 1e3}
        message = new("sensor_msgs/msg/NavSatFix", header=stamped(at), **place)
        message.status.status = FIX if said["fix_type"] >= FIX_3D else NO_FIX
        message.status.service = GPS
        self._publish("gps", message)

    def _rc(self, said: Fields, at: Ns) -> None:
        channels = [said[f"chan{number}_raw"] for number in range(1, CHANNELS + 1)]
        self._publish("rc", new(RC, channel=channels))

    def _rc_raw(self, said: Fields, at: Ns) -> None:
        if self._wire.last("RC_CHANNELS") is None:
            self._rc(said, at)

    def _state(self, said: Fields, at: Ns) -> None:
        base = said["base_mode"]
        mode = mode_name(AutopilotType(said["autopilot"], said["type"]), said["custom_mode"])
        armed, guided = bool(base & SAFETY_ARMED), bool(base & GUIDED_ENABLED)
        self._publish("state", new("roscopter/msg/State", armed=armed, guided=guided, mode=mode))

    def _vfr_hud(self, said: Fields, at: Ns) -> None:
        names = ("airspeed", "groundspeed", "heading", "throttle", "alt", "climb")
        self._publish("vfr_hud", new("roscopter/msg/VFR_HUD", **{name: said[name] for name in names}))

    def _attitude(self, said: Fields, at: Ns) -> None:
        self._publish("attitude", new("roscopter/msg/Attitude", **{name: said[name] for name in _ANGLES}))

    def _raw_imu(self, name: str, said: Fields, at: Ns) -> None:
        """Thousandths of g, of rad/s and of gauss, whichever of the three is sent."""
        if imu_source(self._wire) != name:
            return
        measured = {one: said[one] for one in _MEASURED}
        if name == "HIGHRES_IMU":
            measured = _in_thousandths(measured)
        time = said["time_boot_ms"] * 1000 if name == "SCALED_IMU" else said["time_usec"]
        message = new("roscopter/msg/Mavlink_RAW_IMU", header=stamped(at), time_usec=time, **measured)
        self._publish("raw_imu", message)

    def services(self) -> Mapping[str, Service]:
        """Handlers by the service's name, with its type."""
        return {"arm": (EMPTY, partial(self._arm, 1.0)), "disarm": (EMPTY, partial(self._arm, 0.0))}

    def _arm(self, arm: float, request: Any) -> Any:
        accepted, result = self._commands.ask(ARM_DISARM, arm)
        if not accepted:
            what = "arm" if arm else "disarm"
            self._warn(f"{what}: the autopilot says {entry_name('MAV_RESULT', result)}")
        return service(EMPTY).response()


def _in_thousandths(measured: Mapping[str, float]) -> dict[str, int]:
    """HIGHRES_IMU's m/s^2, rad/s and gauss as those of RAW_IMU."""
    return {name: round(value * _PER_UNIT[name[1:]]) for name, value in measured.items()}


_PER_UNIT = {"acc": MILLI / 9.80665, "gyro": MILLI, "mag": MILLI}


def send_rc(message: Any, now: Ns) -> OutgoingMessage:
    """``send_rc``: microseconds; 0 gives a channel back to the operator's remote control."""
    channels = {f"chan{number}_raw": int(value) for number, value in enumerate(message.channel, start=1)}
    return "RC_CHANNELS_OVERRIDE", channels


def _nothing(stamp: Ns) -> None:
    """Nobody is told that the autopilot has fallen silent: ``state`` has no word for it."""


def offer(around: InterfaceContext) -> NodeInterface:
    """All that is served; ``send_rc`` with *control* only."""
    made = Roscopter(around)
    return NodeInterface(
        topics=TOPICS,
        translators=merge_translators(made.translators()),
        subscriptions=(Subscription("send_rc", RC, send_rc),) if around.control else (),
        services=made.services(),
        disconnected=_nothing,
    )


ROSCOPTER = NamingScheme("roscopter", offer, {ALL: 10}, home=False)
