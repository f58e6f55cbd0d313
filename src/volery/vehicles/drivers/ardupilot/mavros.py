"""ArduPilot over MAVROS."""

from __future__ import annotations

from collections.abc import Sequence

from volery.base.geoid import EGM96, Geoid
from volery.base.position import Position
from volery.kernel.api import Kernel
from volery.ros.graph import Node
from volery.ros.messages import new
from volery.vehicles.drivers.mavlink import commands as key
from volery.vehicles.drivers.mavlink.items import INT_FRAMES, frame_of
from volery.vehicles.drivers.mavlink.mavros import Behind, MavrosCarrier, clockwise
from volery.vehicles.drivers.mavlink.vocabulary import (
    LEFT_ALONE,
    POSITION_ONLY,
    SHORTEST_WAY,
    VELOCITY_AND_YAW_RATE,
)
from volery.vehicles.telemetry import Velocity

CHANNELS = 18


class MavrosCommands(MavrosCarrier):
    """See ``Commands``."""

    behind = Behind("ArduPilot", "HOLD")

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
