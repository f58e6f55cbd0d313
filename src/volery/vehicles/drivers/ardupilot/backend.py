"""What an ArduPilot can be sent, beyond what every MAVLink autopilot can.

What an ArduPilot's messages say beyond those of every MAVLink autopilot.

ArduPilot over a MAVLink link.

ArduPilot over MAVROS.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import Protocol

from volery.base.errors import UsageError
from volery.base.geoid import EGM96, Geoid
from volery.base.position import AboveHome, Position
from volery.kernel.api import Kernel
from volery.links.mavlink_messages import constant
from volery.ros.graph import Node
from volery.ros.messages import new
from volery.vehicles.drivers.ardupilot.link_loss import LINK_LOSS_PARAMETERS
from volery.vehicles.drivers.ardupilot.modes import NUMBERS, mode_name
from volery.vehicles.drivers.mavlink import backend as key
from volery.vehicles.drivers.mavlink import decoder
from volery.vehicles.drivers.mavlink.backend import (
    INT_FRAMES,
    LEFT_ALONE,
    POSITION_ONLY,
    SHORTEST_WAY,
    VELOCITY_AND_YAW_RATE,
    Backend,
    frame_of,
)
from volery.vehicles.drivers.mavlink.client import Firmware, MavlinkClient
from volery.vehicles.drivers.mavlink.mavros_backend import FirmwareBehind, MavrosBackend, clockwise
from volery.vehicles.drivers.steps import DRONE_KIND
from volery.vehicles.telemetry import Telemetry, Velocity

RELEASED = 0
"""The pulse width that gives a channel back to the transmitter."""


class ArduPilotBackend(Backend, Protocol):
    """The port between ArduPilot's sequences and what carries them."""

    def takeoff(self, height: float) -> None:
        """Climb to metres above home, from the ground, armed, in GUIDED."""

    def target(self, goal: Position) -> None:
        """In GUIDED: go there. Has no answer and no time-out."""

    def follow(self, velocity: Velocity, yaw_rate: float) -> None:
        """In GUIDED: m/s, and degrees/s clockwise. Has no answer; stands for 3 s."""

    def turn(self, degrees: float) -> None:
        """In GUIDED: to this heading."""

    def override(self, channels: Sequence[int | None]) -> None:
        """Pulse widths of channels 1 to 4 in microseconds; ``RELEASED``, or ``None`` for leave it alone."""

    def start_mission(self) -> None:
        """In AUTO, armed: begin."""


class ArduPilotDecoder(decoder.TelemetryDecoder):
    """ArduPilot's mode names; its estimator speaks in EKF_STATUS_REPORT."""

    autopilot = "ArduPilot"
    resting = "HOLD"

    def __init__(self, kernel: Kernel, telemetry: Telemetry, *, record: bool = True) -> None:
        super().__init__(kernel, telemetry, record=record)
        self._handlers["EKF_STATUS_REPORT"] = self._estimator

    def _mode_name(self, number: int) -> str:
        return mode_name(self._seen.kind, number)


ARDUPILOT_FIRMWARE = Firmware(
    number=constant("MAV_AUTOPILOT_ARDUPILOTMEGA"),
    name="ArduPilot",
    called="an ArduPilot",
    oldest=(4, 0),  # the first that can be asked for single messages
    estimator="EKF_STATUS_REPORT",
)


class ArduPilotMavlink(MavlinkClient):
    """See ``Commands``."""

    firmware = ARDUPILOT_FIRMWARE

    def _listener(self, record: bool) -> ArduPilotDecoder:
        return ArduPilotDecoder(self._kernel, self.telemetry, record=record)

    def _wanted(self) -> Sequence[str]:
        return LINK_LOSS_PARAMETERS.get(self.telemetry.kind, ())

    def set_mode(self, mode: str) -> None:
        """By DO_SET_MODE."""
        number = NUMBERS.get(self.telemetry.kind, {}).get(mode)
        if number is None:
            raise UsageError(f"{self.telemetry.name} has no mode {mode!r}")
        self._command("MAV_CMD_DO_SET_MODE", constant("MAV_MODE_FLAG_CUSTOM_MODE_ENABLED"), number)

    def takeoff(self, height: float) -> None:
        """By NAV_TAKEOFF, whose altitude ArduPilot takes above home."""
        self._command("MAV_CMD_NAV_TAKEOFF", 0, 0, 0, 0, 0, 0, height)

    def target(self, goal: Position) -> None:
        """By SET_POSITION_TARGET_GLOBAL_INT; a rover's has no altitude."""
        if self.telemetry.kind != DRONE_KIND:
            goal = Position(goal.latitude, goal.longitude, AboveHome(0.0))
        self._send_to(
            "SET_POSITION_TARGET_GLOBAL_INT",
            coordinate_frame=INT_FRAMES[frame_of(goal)],
            type_mask=POSITION_ONLY,
            lat_int=round(goal.latitude * 1e7),
            lon_int=round(goal.longitude * 1e7),
            alt=goal.altitude.metres,
        )

    def follow(self, velocity: Velocity, yaw_rate: float) -> None:
        """By SET_POSITION_TARGET_LOCAL_NED."""
        self._send_to(
            "SET_POSITION_TARGET_LOCAL_NED",
            coordinate_frame=constant("MAV_FRAME_LOCAL_NED"),
            type_mask=VELOCITY_AND_YAW_RATE,
            vx=velocity.north,
            vy=velocity.east,
            vz=-velocity.up,
            yaw_rate=radians(yaw_rate),
        )

    def turn(self, degrees: float) -> None:
        """By CONDITION_YAW."""
        self._command("MAV_CMD_CONDITION_YAW", degrees, 0.0, SHORTEST_WAY, 0.0)

    def override(self, channels: Sequence[int | None]) -> None:
        """By RC_CHANNELS_OVERRIDE; the other channels are left alone."""
        named = {f"chan{number}_raw": LEFT_ALONE for number in range(1, 9)}
        for number, width in enumerate(channels, 1):
            if width is not None:
                named[f"chan{number}_raw"] = width
        self._send_to("RC_CHANNELS_OVERRIDE", **named)

    def start_mission(self) -> None:
        """By MISSION_START."""
        self._command("MAV_CMD_MISSION_START", 0.0, 0.0)


CHANNELS = 18


class ArduPilotMavros(MavrosBackend):
    """See ``Commands``."""

    behind = FirmwareBehind("ArduPilot", "HOLD")

    def __init__(self, kernel: Kernel, node: Node, name: str, namespace: str, geoid: Geoid = EGM96) -> None:
        super().__init__(kernel, node, name, namespace, geoid)
        target = "mavros_msgs/msg/GlobalPositionTarget"
        self._target = node.advertise(self._name("setpoint_raw/global"), target)
        self._override = node.advertise(self._name("rc/override"), "mavros_msgs/msg/OverrideRCIn")

    def turn(self, degrees: float) -> None:
        """``cmd/command`` with CONDITION_YAW."""
        answer = self._command("MAV_CMD_CONDITION_YAW", degrees, 0.0, SHORTEST_WAY, 0.0)
        self._answer(key.HEADING, answer)

    def start_mission(self) -> None:
        """``cmd/command`` with MISSION_START."""
        self._answer(key.START, self._command("MAV_CMD_MISSION_START", 0.0, 0.0))

    def target(self, goal: Position) -> None:
        """``setpoint_raw/global``: the altitude goes through in the frame that is named."""
        message = new(
            "mavros_msgs/msg/GlobalPositionTarget",
            coordinate_frame=INT_FRAMES[frame_of(goal)],
            type_mask=POSITION_ONLY,
            latitude=goal.latitude,
            longitude=goal.longitude,
            altitude=goal.altitude.metres,
        )
        self._target.publish(message)

    def follow(self, velocity: Velocity, yaw_rate: float) -> None:
        """``setpoint_raw/local``."""
        self._publish_velocity(velocity, VELOCITY_AND_YAW_RATE, yaw_rate=clockwise(yaw_rate))

    def override(self, channels: Sequence[int | None]) -> None:
        """``rc/override``."""
        widths = [LEFT_ALONE if width is None else width for width in channels]
        widths += [LEFT_ALONE] * (CHANNELS - len(widths))
        self._override.publish(new("mavros_msgs/msg/OverrideRCIn", channels=widths))
