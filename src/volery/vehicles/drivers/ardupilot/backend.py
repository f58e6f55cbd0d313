"""What can be sent to an ArduPilot, and how it is sent over MAVLink."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import Protocol

from volery.base.errors import UsageError
from volery.base.position import AboveHome, Position
from volery.base.time import Ns
from volery.links.mavlink_messages import constant
from volery.vehicles.driver import Acceleration, AttitudeTarget
from volery.vehicles.drivers.ardupilot.decoder import ArduPilotDecoder
from volery.vehicles.drivers.ardupilot.modes import (
    FENCE_PARAMETERS,
    LINK_LOSS_PARAMETERS,
    NUMBERS,
    STATION_PARAMETERS,
)
from volery.vehicles.drivers.ardupilot.versions import COVERAGE, DRAWN_BACK, PARAMETER_RULES
from volery.vehicles.drivers.mavlink.backend import (
    ATTITUDE_AND_RATES,
    INT_FRAMES,
    POSITION_ONLY,
    SHORTEST_TURN,
    UNCHANGED_CHANNEL,
    VELOCITY_AND_YAW_RATE,
    Backend,
    acceleration_fields,
)
from volery.vehicles.drivers.mavlink.client import FirmwareTraits, MavlinkClient
from volery.vehicles.drivers.steps import DRONE_KIND
from volery.vehicles.telemetry import Telemetry, Velocity

RELEASED = 0
"""Pulse width that gives a channel back to the transmitter."""

ARDUPILOT_FIRMWARE = FirmwareTraits(
    number=constant("MAV_AUTOPILOT_ARDUPILOTMEGA"),
    name="ArduPilot",
    called="an ArduPilot",
    oldest=(4, 0),  # the first version with requests of single messages
    estimator="EKF_STATUS_REPORT",
    coverage=COVERAGE,
    turning=ATTITUDE_AND_RATES,
    drawn_back=DRAWN_BACK,
    parameter_rules=PARAMETER_RULES,
    home_first=True,
)


_LASTING = (
    *("battery", "radio failsafe", "fs_thr", "rc not", "rc calib", "throttle", "safety switch"),
    *("not calibrated", "calibration needed", "frame", "parameter", "logging", "disarm switch", "interlock"),
    *("mission", "param", "mode not armable", "mode requires", "check fs_", "fence requires", "in fence"),
)
_PASSING = ("gps", "ekf", "ahrs", "position", "inconsistent", "settl", "wait", "init", "fix")
"""Words of arming checks that stay until they are mended, and of those that pass by themselves."""


def lasting_reasons(telemetry: Telemetry, since: Ns) -> Sequence[str]:
    """Return the arming checks that were reported more than once since then and stay.

    Args:
        telemetry: telemetry with the texts.
        since: begin of the wait, ns.
    """
    said = [text.text for text in telemetry.texts if text.at >= since and text.text.startswith("PreArm: ")]
    repeated = dict.fromkeys(text for text in said if said.count(text) > 1)
    return [text + _remedy(text.lower()) for text in repeated if _stays(text.lower())]


_REMEDIES = {
    "mode requires mission": "choose another mode at the transmitter's mode switch, or upload a mission",
    "mode not armable": "choose another mode at the transmitter's mode switch",
}
"""What mends an arming check whose own text does not say it."""


def _remedy(text: str) -> str:
    return next((f" ({remedy})" for check, remedy in _REMEDIES.items() if check in text), "")


def _stays(text: str) -> bool:
    return any(word in text for word in _LASTING) and not any(word in text for word in _PASSING)


class ArduPilotBackend(Backend, Protocol):
    """Commands of ArduPilot beyond those of every MAVLink autopilot."""

    def takeoff(self, height: float) -> None:
        """Climb to *height* metres above home, from the ground, armed, in GUIDED."""

    def send_target(self, goal: Position) -> None:
        """Go to *goal* in GUIDED. There is no acknowledgement, and the target does not expire."""

    def send_velocity(self, velocity: Velocity, yaw_rate: float) -> None:
        """Follow a velocity (m/s) and yaw rate (degrees/s, clockwise) in GUIDED for 3 s. Not acknowledged."""

    def send_acceleration(self, acceleration: Acceleration, yaw_rate: float) -> None:
        """Follow an acceleration and yaw rate (degrees/s, clockwise) in GUIDED for 3 s. Not acknowledged."""

    def send_attitude(self, target: AttitudeTarget) -> None:
        """Follow an attitude in GUIDED for 3 s; a thrust of 0.5 keeps the height. Not acknowledged."""

    def turn(self, degrees: float) -> None:
        """Turn to a heading in GUIDED."""

    def override_channels(self, channels: Sequence[int | None]) -> None:
        """Override RC channels 1 to 4 with pulse widths in µs; ``RELEASED``, or ``None`` for no change."""

    def start_mission(self) -> None:
        """Start the mission in AUTO, armed."""


class ArduPilotMavlink(MavlinkClient):
    """ArduPilot on a MAVLink link. See ``ArduPilotBackend``."""

    firmware = ARDUPILOT_FIRMWARE

    def _make_decoder(self, record: bool) -> ArduPilotDecoder:
        return ArduPilotDecoder(self._kernel, self.telemetry, record=record)

    def _requested_parameters(self) -> Sequence[str]:
        return (*LINK_LOSS_PARAMETERS.get(self.telemetry.kind, ()), *FENCE_PARAMETERS)

    def _absent_beside(self, name: str) -> Sequence[str]:
        return STATION_PARAMETERS[1:] if name == STATION_PARAMETERS[0] else super()._absent_beside(name)

    def lasting_reasons(self, since: Ns) -> Sequence[str]:
        """Return the arming checks that fail since then and that waiting does not mend."""
        return lasting_reasons(self.telemetry, since)

    def set_mode(self, mode: str) -> None:
        """Send DO_SET_MODE."""
        number = NUMBERS.get(self.telemetry.kind, {}).get(mode)
        if number is None:
            raise UsageError(f"{self.telemetry.name} has no mode {mode!r}")
        self._command("MAV_CMD_DO_SET_MODE", constant("MAV_MODE_FLAG_CUSTOM_MODE_ENABLED"), number)

    def takeoff(self, height: float) -> None:
        """Send NAV_TAKEOFF, whose altitude ArduPilot takes as above home."""
        self._command("MAV_CMD_NAV_TAKEOFF", 0, 0, 0, 0, 0, 0, height)

    def send_target(self, goal: Position) -> None:
        """Send SET_POSITION_TARGET_GLOBAL_INT; a rover's target has no altitude."""
        if self.telemetry.kind != DRONE_KIND:
            goal = Position(goal.latitude, goal.longitude, AboveHome(0.0))
        self._send_to(
            "SET_POSITION_TARGET_GLOBAL_INT",
            coordinate_frame=INT_FRAMES[type(goal.altitude)],
            type_mask=POSITION_ONLY,
            lat_int=round(goal.latitude * 1e7),
            lon_int=round(goal.longitude * 1e7),
            alt=goal.altitude.metres,
        )

    def send_velocity(self, velocity: Velocity, yaw_rate: float) -> None:
        """Send SET_POSITION_TARGET_LOCAL_NED."""
        self._send_to(
            "SET_POSITION_TARGET_LOCAL_NED",
            coordinate_frame=constant("MAV_FRAME_LOCAL_NED"),
            type_mask=VELOCITY_AND_YAW_RATE,
            vx=velocity.north,
            vy=velocity.east,
            vz=-velocity.up,
            yaw_rate=radians(yaw_rate),
        )

    def send_acceleration(self, acceleration: Acceleration, yaw_rate: float) -> None:
        """Send SET_POSITION_TARGET_LOCAL_NED."""
        self._send_to("SET_POSITION_TARGET_LOCAL_NED", **acceleration_fields(acceleration, yaw_rate))

    def turn(self, degrees: float) -> None:
        """Send CONDITION_YAW."""
        self._command("MAV_CMD_CONDITION_YAW", degrees, 0.0, SHORTEST_TURN, 0.0)

    def override_channels(self, channels: Sequence[int | None]) -> None:
        """Send RC_CHANNELS_OVERRIDE; the other channels are unchanged."""
        named = {f"chan{number}_raw": UNCHANGED_CHANNEL for number in range(1, 9)}
        for number, width in enumerate(channels, 1):
            if width is not None:
                named[f"chan{number}_raw"] = width
        self._send_to("RC_CHANNELS_OVERRIDE", **named)

    def start_mission(self) -> None:
        """Send MISSION_START."""
        self._command("MAV_CMD_MISSION_START", 0.0, 0.0)
