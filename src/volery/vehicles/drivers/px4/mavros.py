"""PX4 over MAVROS.

OFFBOARD's stream is the node's loop while a call waits, and the caller's after it: a velocity that is not set
again within a second ends in PX4's failsafe. Likewise sticks. PX4's events do not come through.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan, nan, radians

from volery.base.frames import heading_to_yaw
from volery.base.geoid import EGM96, Geoid
from volery.base.position import Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.ros.graph import Node
from volery.ros.messages import new, request
from volery.vehicles.driver import Sticks
from volery.vehicles.drivers.mavlink.mavros import Behind, MavrosCarrier, clockwise
from volery.vehicles.drivers.mavlink.vocabulary import VELOCITY_AND_YAW, VELOCITY_AND_YAW_RATE
from volery.vehicles.drivers.px4.commands import Setpoint, reposition_fields, stick_axes
from volery.vehicles.drivers.px4.modes import HOLD


class MavrosCommands(MavrosCarrier):
    """See ``Commands``."""

    behind = Behind("PX4", HOLD)

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

    def sticks(self, sticks: Sticks) -> None:
        """``manual_control/send``."""
        axes = {name: float(value) for name, value in stick_axes(sticks, self.telemetry.kind).items()}
        self._manual.publish(new("mavros_msgs/msg/ManualControl", **axes))

    def rewind(self) -> None:
        """``mission/set_current``."""
        self._call(self._current, request("mavros_msgs/srv/WaypointSetCurrent", wp_seq=0))
