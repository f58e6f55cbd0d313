"""What a vehicle carries: gimbal, camera, servos and gripper, by MAVLink commands.

Newer commands are tried first and the older ones after them, because autopilots differ in what they support.
An autopilot without the device refuses, and the error says so.
"""

from __future__ import annotations

from math import nan

from volery.base.errors import CapabilityError, NotArrived, Refused, UsageError
from volery.base.position import AMSL, Position
from volery.vehicles.limits import is_number
from volery.vehicles.services import Services

SHORTEST_US, LONGEST_US = 500, 2500
_MAVLINK_TARGETING = 2.0
"""MAV_MOUNT_MODE_MAVLINK_TARGETING."""
_NO_SECONDARY = (-1, -1, 0, 0, 0)
"""Rest of DO_GIMBAL_MANAGER_CONFIGURE: secondary control stays as it is; all gimbals."""


class Payload:
    """Devices of one vehicle.

    Args:
        name: name of the vehicle.
        services: services of its autopilot.
    """

    def __init__(self, name: str, services: Services) -> None:
        self._name = name
        self._services = services

    def point_gimbal(self, pitch: float, yaw: float = 0.0) -> None:
        """Point the gimbal.

        Args:
            pitch: degrees, up positive: -90 looks straight down.
            yaw: degrees clockwise from the nose.
        """
        self._check(f"point_gimbal({pitch!r}, {yaw!r})", (pitch, -180.0, 180.0), (yaw, -360.0, 360.0))
        asked = f"point the gimbal to a pitch of {pitch:g} and a yaw of {yaw:g} degrees"
        turn = ("MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW", pitch, yaw, nan, nan, 0, 0, 0)
        try:
            self._services.command(asked, *turn)
        except CapabilityError:
            mode = _MAVLINK_TARGETING
            self._services.command(asked, "MAV_CMD_DO_MOUNT_CONTROL", pitch, 0, yaw, 0, 0, 0, mode)
        except Refused:  # a PX4 obeys only the station that has taken control of the gimbal
            if self._services.sender is None:
                raise
            self._services.command(
                "take control of the gimbal",
                "MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE",
                *self._services.sender,
                *_NO_SECONDARY,
            )
            self._services.command(asked, *turn)

    def look_at(self, place: Position | None) -> None:
        """Keep the gimbal, or the nose of a vehicle without one, on a place; ``None`` ends that.

        Args:
            place: the place, with an altitude AMSL.
        """
        if place is None:
            self._services.command("look ahead again", "MAV_CMD_DO_SET_ROI_NONE")
            return
        if not isinstance(place, Position) or not isinstance(place.altitude, AMSL):
            raise UsageError(f"{self._name}: look_at({place}): give a Position with an altitude AMSL(...)")
        where = (place.latitude, place.longitude, place.altitude.metres)
        self._services.command(f"look at {place}", "MAV_CMD_DO_SET_ROI_LOCATION", 0, 0, 0, 0, *where)

    def trigger_camera(self) -> None:
        """Take one picture."""
        asked = "take a picture"
        try:
            self._services.command(asked, "MAV_CMD_IMAGE_START_CAPTURE", 0, 0, 1)
        except CapabilityError:
            self._services.command(asked, "MAV_CMD_DO_DIGICAM_CONTROL", 0, 0, 0, 0, 1)

    def trigger_camera_each(self, metres: float) -> None:
        """Take a picture each *metres* of the way; 0 ends that."""
        self._check(f"trigger_camera_each({metres!r})", (metres, 0.0, 10_000.0))
        asked = f"take a picture each {metres:g} m"
        self._services.command(asked, "MAV_CMD_DO_SET_CAM_TRIGG_DIST", metres, 0, 0)

    def set_servo(self, channel: int, microseconds: int) -> None:
        """Set the pulse width of an output that the autopilot does not use itself (ArduPilot).

        Args:
            channel: number of the output, from 1.
            microseconds: pulse width, 500 to 2500 µs.
        """
        call = f"set_servo({channel!r}, {microseconds!r})"
        self._check(call, (channel, 1, 32), (microseconds, SHORTEST_US, LONGEST_US))
        asked = f"set servo {channel} to {microseconds} µs"
        self._services.command(asked, "MAV_CMD_DO_SET_SERVO", channel, microseconds)

    def set_actuator(self, number: int, value: float) -> None:
        """Set one of six actuators that are assigned to an offboard computer (PX4, ``*_FUNC`` 301 to 306).

        Args:
            number: 1 to 6.
            value: -1 to 1.
        """
        self._check(f"set_actuator({number!r}, {value!r})", (number, 1, 6), (value, -1.0, 1.0))
        values = [value if place == number else nan for place in range(1, 7)]
        self._services.command(f"set actuator {number} to {value:g}", "MAV_CMD_DO_SET_ACTUATOR", *values, 0)

    def open_gripper(self, number: int = 1) -> None:
        """Release what the gripper holds."""
        self._check(f"open_gripper({number!r})", (number, 1, 8))
        self._move_gripper("open the gripper", number, 0)

    def close_gripper(self, number: int = 1) -> None:
        """Let the gripper hold."""
        self._check(f"close_gripper({number!r})", (number, 1, 8))
        self._move_gripper("close the gripper", number, 1)

    def _move_gripper(self, asked: str, number: int, action: int) -> None:
        try:
            self._services.command(asked, "MAV_CMD_DO_GRIPPER", number, action)
        except NotArrived as error:  # as PX4, whose module for it does not run then
            what = "nothing answers; a PX4 has a gripper with PD_GRIPPER_EN=1, after a reboot"
            raise CapabilityError(f"{self._name}: {asked}: {what}") from error

    def _check(self, call: str, *limited: tuple[object, float, float]) -> None:
        """Raise ``UsageError`` unless each number lies between its limits."""
        for value, low, high in limited:
            if not is_number(value) or not low <= value <= high:
                raise UsageError(f"{self._name}: {call}: {value!r} is not a number from {low:g} to {high:g}")
