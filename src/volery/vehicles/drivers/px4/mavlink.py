"""PX4 over a MAVLink link."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan, nan, radians

from volery.base.errors import UsageError
from volery.base.position import Position
from volery.base.time import Ns
from volery.links.mavlink import constant
from volery.vehicles.driver import Sticks
from volery.vehicles.drivers.mavlink import commands as key
from volery.vehicles.drivers.mavlink.conversation import Conversation, Firmware
from volery.vehicles.drivers.mavlink.vocabulary import VELOCITY_AND_YAW, VELOCITY_AND_YAW_RATE
from volery.vehicles.drivers.px4.commands import Setpoint, reposition_fields, stick_axes
from volery.vehicles.drivers.px4.hearing import Hearing
from volery.vehicles.drivers.px4.modes import MODES
from volery.vehicles.drivers.px4.silence import WANTED

PX4 = Firmware(
    number=constant("MAV_AUTOPILOT_PX4"),
    name="PX4",
    called="a PX4",
    oldest=(1, 12),
    estimator="ESTIMATOR_STATUS",
    bytewise=True,
)

_LOCAL_NED = constant("MAV_FRAME_LOCAL_NED")
_NO_PITCH = -1.0


class MavlinkCommands(Conversation):
    """See ``Commands``."""

    firmware = PX4
    _hearing: Hearing

    def _listener(self, record: bool) -> Hearing:
        return Hearing(self._kernel, self.telemetry, record=record)

    def _wanted(self) -> Sequence[str]:
        return WANTED

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

    def sticks(self, sticks: Sticks) -> None:
        """By MANUAL_CONTROL."""
        axes = stick_axes(sticks, self.telemetry.kind)
        self._send("MANUAL_CONTROL", target=self._system or 0, **axes)

    def rewind(self) -> None:
        """By MISSION_SET_CURRENT."""
        self._send_to("MISSION_SET_CURRENT", seq=0)
