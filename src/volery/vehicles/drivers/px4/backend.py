"""What a PX4 can be sent, beyond what every MAVLink autopilot can.

PX4 over a MAVLink link.

PX4 over MAVROS.

OFFBOARD's stream is the node's loop while a call waits, and the caller's after it: a velocity that is not set
again within a second ends in PX4's failsafe. Likewise sticks. PX4's events do not come through.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isnan, nan, radians
from typing import Any, NamedTuple, Protocol

from volery.base.errors import UsageError
from volery.base.frames import heading_to_yaw
from volery.base.geoid import EGM96, Geoid
from volery.base.position import Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.links.mavlink_messages import constant
from volery.ros.graph import Node
from volery.ros.messages import new, request
from volery.vehicles.driver import ManualControl
from volery.vehicles.drivers.mavlink import backend as key
from volery.vehicles.drivers.mavlink.backend import (
    GLOBAL,
    INT_FRAMES,
    VELOCITY_AND_YAW,
    VELOCITY_AND_YAW_RATE,
    Backend,
)
from volery.vehicles.drivers.mavlink.client import Firmware, MavlinkClient
from volery.vehicles.drivers.mavlink.mavros_backend import FirmwareBehind, MavrosBackend, clockwise
from volery.vehicles.drivers.px4.decoder import PX4Decoder
from volery.vehicles.drivers.px4.link_loss import LINK_LOSS_PARAMETERS
from volery.vehicles.drivers.px4.modes import HOLD, MODES
from volery.vehicles.drivers.steps import DRONE_KIND
from volery.vehicles.telemetry import Velocity


class Setpoint(NamedTuple):
    """Of OFFBOARD: a velocity, and a heading in degrees, or, where that is NaN, degrees/s clockwise."""

    velocity: Velocity
    yaw_rate: float = 0.0
    heading: float = nan


_CHANGES_MODE = float(constant("MAV_DO_REPOSITION_FLAGS_CHANGE_MODE"))
"""In DO_REPOSITION: enter AUTO.LOITER for it. Without this PX4 refuses the command, and flies there."""
_NO_SPEED = -1.0
"""In DO_REPOSITION: as fast as it would anyhow."""


def reposition_fields(goal: Position) -> dict[str, Any]:
    """DO_REPOSITION as the fields of a COMMAND_INT; the altitude of *goal* is AMSL."""
    return {
        "frame": INT_FRAMES[GLOBAL],
        "command": constant("MAV_CMD_DO_REPOSITION"),
        "param1": _NO_SPEED,
        "param2": _CHANGES_MODE,
        "param4": nan,
        "x": round(goal.latitude * 1e7),
        "y": round(goal.longitude * 1e7),
        "z": goal.altitude.metres,
    }


def stick_axes(sticks: ManualControl, kind: str) -> dict[str, int]:
    """As in MANUAL_CONTROL: 1000 either way, and throttle 0 to 1000 with its centre at 500."""
    throttle = sticks.throttle if kind == DRONE_KIND else (sticks.throttle + 1.0) / 2.0
    return {
        "x": round(1000 * sticks.pitch),
        "y": round(1000 * sticks.roll),
        "z": round(1000 * throttle),
        "r": round(1000 * sticks.yaw),
    }


class PX4Backend(Backend, Protocol):
    """The port between PX4's sequences and what carries them."""

    @property
    def beat(self) -> Ns:
        """When the last heartbeat came: PX4's mode is only ever a second old, and as old as that."""

    def takeoff(self, amsl: float) -> None:
        """Climb from the ground, armed, to metres above mean sea level; at least its MIS_TAKEOFF_ALT."""

    def reposition(self, goal: Position) -> None:
        """Change to AUTO.LOITER and go there; the altitude is AMSL."""

    def setpoint(self, setpoint: Setpoint) -> None:
        """One of the stream without which there is no OFFBOARD."""

    def manual_control(self, sticks: ManualControl) -> None:
        """One of the stream without which there are no sticks."""

    def rewind(self) -> None:
        """The mission begins at its first item."""


PX4_FIRMWARE = Firmware(
    number=constant("MAV_AUTOPILOT_PX4"),
    name="PX4",
    called="a PX4",
    oldest=(1, 12),
    estimator="ESTIMATOR_STATUS",
    bytewise=True,
)

_LOCAL_NED = constant("MAV_FRAME_LOCAL_NED")
_NO_PITCH = -1.0


class PX4Mavlink(MavlinkClient):
    """See ``Commands``."""

    firmware = PX4_FIRMWARE
    _hearing: PX4Decoder

    def _listener(self, record: bool) -> PX4Decoder:
        return PX4Decoder(self._kernel, self.telemetry, record=record)

    def _wanted(self) -> Sequence[str]:
        return LINK_LOSS_PARAMETERS

    @property
    def beat(self) -> Ns:
        """When the last heartbeat came."""
        return self._hearing.beat

    def _refused(self, which: str) -> None:
        if which == key.ARM and not self.telemetry.armed:
            self._hearing.say_failing_checks()

    def check(self) -> None:
        """PX4 says by itself which checks fail, whenever one of them changes."""

    def set_mode(self, mode: str) -> None:
        """By DO_SET_MODE."""
        number = MODES.get(mode)
        if number is None:
            raise UsageError(f"{self.telemetry.name} has no mode {mode!r}")
        custom = constant("MAV_MODE_FLAG_CUSTOM_MODE_ENABLED")
        self._command("MAV_CMD_DO_SET_MODE", custom, number.main, number.sub)

    def takeoff(self, amsl: float) -> None:
        """By NAV_TAKEOFF, whose altitude PX4 takes as AMSL."""
        self._command("MAV_CMD_NAV_TAKEOFF", _NO_PITCH, 0, 0, nan, nan, nan, amsl)

    def reposition(self, goal: Position) -> None:
        """By DO_REPOSITION."""
        self._send_to("COMMAND_INT", **reposition_fields(goal))

    def setpoint(self, setpoint: Setpoint) -> None:
        """By SET_POSITION_TARGET_LOCAL_NED in frame 1: PX4 takes only that and 8."""
        turning = isnan(setpoint.heading)
        north, east, up = setpoint.velocity
        self._send_to(
            "SET_POSITION_TARGET_LOCAL_NED",
            coordinate_frame=_LOCAL_NED,
            type_mask=VELOCITY_AND_YAW_RATE if turning else VELOCITY_AND_YAW,
            vx=north,
            vy=east,
            vz=-up,
            yaw=0.0 if turning else radians(setpoint.heading),
            yaw_rate=radians(setpoint.yaw_rate),
        )

    def manual_control(self, sticks: ManualControl) -> None:
        """By MANUAL_CONTROL."""
        axes = stick_axes(sticks, self.telemetry.kind)
        self._send("MANUAL_CONTROL", target=self._system or 0, **axes)

    def rewind(self) -> None:
        """By MISSION_SET_CURRENT."""
        self._send_to("MISSION_SET_CURRENT", seq=0)


class PX4Mavros(MavrosBackend):
    """See ``Commands``."""

    behind = FirmwareBehind("PX4", HOLD)

    def __init__(self, kernel: Kernel, node: Node, name: str, namespace: str, geoid: Geoid = EGM96) -> None:
        super().__init__(kernel, node, name, namespace, geoid)
        self._whole = node.client(self._name("cmd/command_int"), "mavros_msgs/srv/CommandInt")
        self._current = node.client(self._name("mission/set_current"), "mavros_msgs/srv/WaypointSetCurrent")
        self._manual = node.advertise(self._name("manual_control/send"), "mavros_msgs/msg/ManualControl")

    @property
    def beat(self) -> Ns:
        """When the state came last."""
        return self._hearing.beat

    def check(self) -> None:
        """PX4 says by itself which checks fail, in events, which MAVROS does not pass on."""

    def _take_off_from(self) -> Mapping[str, float]:
        return {"latitude": nan, "longitude": nan, "yaw": nan}

    def reposition(self, goal: Position) -> None:
        """``cmd/command_int`` with DO_REPOSITION, which is not answered."""
        asked = request("mavros_msgs/srv/CommandInt", **reposition_fields(goal))
        self._call(self._whole, asked)

    def setpoint(self, setpoint: Setpoint) -> None:
        """``setpoint_raw/local``."""
        if isnan(setpoint.heading):
            yaw_rate = clockwise(setpoint.yaw_rate)
            self._publish_velocity(setpoint.velocity, VELOCITY_AND_YAW_RATE, yaw_rate=yaw_rate)
        else:
            yaw = heading_to_yaw(radians(setpoint.heading))
            self._publish_velocity(setpoint.velocity, VELOCITY_AND_YAW, yaw=yaw)

    def manual_control(self, sticks: ManualControl) -> None:
        """``manual_control/send``."""
        axes = {name: float(value) for name, value in stick_axes(sticks, self.telemetry.kind).items()}
        self._manual.publish(new("mavros_msgs/msg/ManualControl", **axes))

    def rewind(self) -> None:
        """``mission/set_current``."""
        self._call(self._current, request("mavros_msgs/srv/WaypointSetCurrent", wp_seq=0))
