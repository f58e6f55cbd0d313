"""What can be sent to any MAVLink autopilot: the interface of its two backends, mission items, and constants.

A driver reaches its autopilot through a backend: a MAVLink link, or MAVROS topics and services on a graph.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees, isfinite, isnan, nan, radians
from typing import Any, Protocol

from volery.base.errors import CapabilityError, LinkError, UsageError
from volery.base.frames import euler_to_quaternion, wrap
from volery.base.position import AMSL, AboveGround, AboveHome, Altitude, Position
from volery.base.time import Ns, S, to_seconds
from volery.kernel.api import Action, Kernel
from volery.links.mavlink_messages import constant
from volery.vehicles.driver import Acceleration, AttitudeTarget
from volery.vehicles.firmware_versions import Meaning, VersionRule
from volery.vehicles.services import PlanItem, Services
from volery.vehicles.telemetry import Telemetry

POSITION_ONLY = 0x0DF8
VELOCITY_AND_YAW_RATE = 0x05C7
ACCELERATION_AND_YAW_RATE = 0x043F
"""Type masks of SET_POSITION_TARGET_*: a bit that is set means ignore that field."""

ATTITUDE_AND_HEADING, ATTITUDE_AND_YAW_RATE, ATTITUDE_AND_RATES = 0b111, 0b011, 0b000
"""Type masks of SET_ATTITUDE_TARGET, likewise."""
TURN_FORGOTTEN_AFTER: Ns = S // 2
"""Pause after which a turn begins anew from the measured heading."""
MOST_AHEAD_DEG = 20.0
"""The stated heading leads the measured one by at most this: with 45 ArduCopter 4.8 overshot by 25 %, with
20 by 7 %.
"""

MEASURED_HEADING: VersionRule[bool] = VersionRule(
    "whether the measured heading beside a yaw rate draws it back",
    Meaning((0, 0), False, "it turns at the stated rate"),
)

FORCE = 21196.0
"""Parameter 2 of COMPONENT_ARM_DISARM: skip the checks; disarm in the air, too."""

GROUND_SPEED = 1.0
UNCHANGED = -1.0
OWN_SPEED = -1.0
"""In DO_CHANGE_SPEED: back to the autopilot's own speed."""
SHORTEST_TURN = 0.0

UNCHANGED_CHANNEL = 65535
"""In RC_CHANNELS_OVERRIDE: this channel stays as it is."""

ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
ACTIVE = constant("MAV_STATE_ACTIVE")
FAILSAFE = (constant("MAV_STATE_CRITICAL"), constant("MAV_STATE_EMERGENCY"))
UNDEFINED = constant("MAV_LANDED_STATE_UNDEFINED")
ON_GROUND = constant("MAV_LANDED_STATE_ON_GROUND")

GLOBAL = constant("MAV_FRAME_GLOBAL")
ABOVE_HOME = constant("MAV_FRAME_GLOBAL_RELATIVE_ALT")
FRAMES: Mapping[type[Altitude], int] = {
    AMSL: GLOBAL,
    AboveHome: ABOVE_HOME,
    AboveGround: constant("MAV_FRAME_GLOBAL_TERRAIN_ALT"),
}
"""MAV_FRAME of a global position in degrees, by the kind of its altitude."""
INT_FRAMES: Mapping[type[Altitude], int] = {
    AMSL: constant("MAV_FRAME_GLOBAL_INT"),
    AboveHome: constant("MAV_FRAME_GLOBAL_RELATIVE_ALT_INT"),
    AboveGround: constant("MAV_FRAME_GLOBAL_TERRAIN_ALT_INT"),
}
"""MAV_FRAME of a global position in 1e-7 degrees, by the kind of its altitude."""


class Ack:
    """Keys of acknowledgements in ``Telemetry.answers``."""

    MODE = "mode"
    ARM = "arm"
    TAKEOFF = "take-off"
    SPEED = "speed"
    HEADING = "heading"
    TARGET = "target"
    MISSION = "mission"
    START = "mission start"


def mission_item(
    command: str, *parameters: float, at: Position | None = None, z: float = 0.0, frame: int = ABOVE_HOME
) -> PlanItem:
    """Return a mission item.

    Args:
        command: name of the MAV_CMD.
        parameters: up to four parameters; the others are 0.
        at: place, altitude and frame at once.
        z: altitude in *frame*, m, for an item without a place.
        frame: MAV_FRAME of an item without a place.
    """
    first, second, third, fourth = (*parameters, 0.0, 0.0, 0.0, 0.0)[:4]
    given = (first, second, third, fourth)
    if at is None:
        return PlanItem(constant(command), frame, given, 0.0, 0.0, z)
    at_frame = FRAMES.get(type(at.altitude))
    if at_frame is None:
        raise UsageError(f"{at}: autopilots take AMSL, AboveHome and AboveGround")
    return PlanItem(constant(command), at_frame, given, at.latitude, at.longitude, at.altitude.metres)


def acceleration_fields(acceleration: Acceleration, yaw_rate: float) -> dict[str, Any]:
    """Return an acceleration and yaw rate (degrees/s) as the fields of SET_POSITION_TARGET_LOCAL_NED."""
    return {
        "coordinate_frame": constant("MAV_FRAME_LOCAL_NED"),
        "type_mask": ACCELERATION_AND_YAW_RATE,
        "afx": acceleration.north,
        "afy": acceleration.east,
        "afz": -acceleration.up,
        "yaw_rate": radians(yaw_rate),
    }


class AttitudeStream:
    """Attitudes as the fields of SET_ATTITUDE_TARGET.

    Beside a yaw rate the quaternion states a heading, because some firmware reads both: the measured one, or
    where the firmware only turns from the stated heading, one that is integrated from the rates.

    Args:
        kernel: clock.
        turning: type mask with which the firmware takes an attitude beside a yaw rate.
        drawn_back: whether the measured heading beside a yaw rate would draw the firmware back.
    """

    def __init__(self, kernel: Kernel, turning: int, drawn_back: VersionRule[bool]) -> None:
        self._kernel = kernel
        self._turning = turning
        self._drawn_back = drawn_back
        self._heading = nan
        self._yaw_rate = 0.0
        self._stated_at: Ns = 0

    def fields(self, target: AttitudeTarget, seen: Telemetry) -> dict[str, Any]:
        """Return the fields of the next message.

        Args:
            target: the attitude.
            seen: telemetry of the vehicle.
        """
        turns = isnan(target.heading)
        heading = self._turned(seen) if turns else target.heading
        heading = heading if isfinite(heading) else 0.0
        self._heading, self._yaw_rate, self._stated_at = heading, target.yaw_rate, self._kernel.now()
        return {
            "type_mask": self._turning if turns else ATTITUDE_AND_HEADING,
            "q": euler_to_quaternion(radians(target.roll), radians(target.pitch), radians(heading)),
            "body_yaw_rate": radians(target.yaw_rate) if turns else 0.0,
            "thrust": target.thrust,
        }

    def _turned(self, seen: Telemetry) -> float:
        measured = seen.attitude.heading
        passed = self._kernel.now() - self._stated_at
        begins = isnan(self._heading) or passed > TURN_FORGOTTEN_AFTER
        if begins or not self._drawn_back.by(seen.version):
            return measured
        ahead = degrees(wrap(radians(self._heading + self._yaw_rate * to_seconds(passed) - measured)))
        return measured + min(max(ahead, -MOST_AHEAD_DEG), MOST_AHEAD_DEG)


class Backend(Protocol):
    """Sends commands to a MAVLink autopilot. Acknowledgements arrive in ``telemetry.answers`` under ``Ack``.

    With a ``cycle`` the methods block; without one they do not.
    """

    telemetry: Telemetry

    @property
    def cycle(self) -> Action | None:
        """See ``Driver``."""

    @property
    def parameters(self) -> Mapping[str, float] | None:
        """Parameters that the driver requested, by name; ``None`` until all answers have arrived.

        Parameters that the firmware does not have are missing.
        """

    @property
    def services(self) -> Services | None:
        """See ``Driver``."""

    def poll(self) -> None:
        """Process received messages without waiting."""

    def set_mode(self, mode: str) -> None:
        """Change the mode, by the firmware's own name."""

    def arm(self, arm: bool, *, force: bool = False) -> None:
        """Arm or disarm; *force* skips the checks, or stops the motors in the air."""

    def set_speed(self, speed: float) -> None:
        """Set the speed over ground, m/s, for movements to a position; -1 means the autopilot's own."""

    def send_attitude(self, target: AttitudeTarget) -> None:
        """Send one attitude set-point. Not acknowledged."""

    def request_attitude(self) -> None:
        """See ``Driver``."""

    def request_obstacles(self) -> None:
        """See ``Driver``."""

    def request_arming_checks(self) -> None:
        """Request the texts of the arming checks that fail now."""

    def lasting_reasons(self, since: Ns) -> Sequence[str]:
        """Return the arming checks that fail since then and that waiting does not mend."""

    def failing_checks(self) -> Sequence[str]:
        """Return the arming checks that are known to fail now; where they arrive as texts, nothing."""

    def upload(self, items: Sequence[PlanItem]) -> None:
        """Replace the mission; continues an upload in progress."""

    def request_mission_progress(self) -> None:
        """Request progress of the mission from now on."""

    def request_target(self) -> None:
        """Request reports of the autopilot's target from now on."""

    def problem(self) -> LinkError | CapabilityError | None:
        """Return what is wrong with the link, or why the vehicle is not supported, as an error to raise."""

    def close(self) -> None:
        """Stop all communication."""
