"""ArduPilot over a MAVLink link."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians

from volery.base.errors import UsageError
from volery.base.position import AboveHome, Position
from volery.links.mavlink import constant
from volery.vehicles.drivers.ardupilot.hearing import Hearing
from volery.vehicles.drivers.ardupilot.modes import NUMBERS
from volery.vehicles.drivers.ardupilot.silence import WANTED
from volery.vehicles.drivers.arrival import DRONE_KIND
from volery.vehicles.drivers.mavlink.conversation import Conversation, Firmware
from volery.vehicles.drivers.mavlink.items import INT_FRAMES, frame_of
from volery.vehicles.drivers.mavlink.vocabulary import (
    LEFT_ALONE,
    POSITION_ONLY,
    SHORTEST_WAY,
    VELOCITY_AND_YAW_RATE,
)
from volery.vehicles.telemetry import Velocity

ARDUPILOT = Firmware(
    number=constant("MAV_AUTOPILOT_ARDUPILOTMEGA"),
    name="ArduPilot",
    called="an ArduPilot",
    oldest=(4, 0),  # the first that can be asked for single messages
    estimator="EKF_STATUS_REPORT",
)


class MavlinkCommands(Conversation):
    """See ``Commands``."""

    firmware = ARDUPILOT

    def _listener(self, record: bool) -> Hearing:
        return Hearing(self._kernel, self.telemetry, record=record)

    def _wanted(self) -> Sequence[str]:
        return WANTED.get(self.telemetry.kind, ())

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
