"""A PX4 over MAVROS: apart from ``backend``, because a flight over a link imports nothing of ROS.

The stream of OFFBOARD is repeated by the node's loop while a call waits, and by the caller after the call:
a velocity that is not set again within a second ends in PX4's failsafe. The same holds for manual control.
PX4's events do not pass MAVROS.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import nan

from volery.base.geoid import EGM96, Geoid
from volery.base.position import Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.ros.graph import Node
from volery.ros.messages import new, request
from volery.vehicles.driver import AttitudeTarget, ManualControl
from volery.vehicles.drivers.mavlink.backend import ATTITUDE_AND_YAW_RATE
from volery.vehicles.drivers.mavlink.mavros_backend import (
    FirmwareBehind,
    MavrosBackend,
    namespace_and_geoid,
)
from volery.vehicles.drivers.px4.backend import OffboardSetpoint, manual_control_axes, reposition_fields
from volery.vehicles.drivers.px4.driver import PX4
from volery.vehicles.drivers.px4.modes import HOLD
from volery.vehicles.drivers.px4.versions import PARAMETER_RULES


class PX4Mavros(MavrosBackend):
    """PX4 over MAVROS. See ``PX4Backend``."""

    firmware = FirmwareBehind(
        "PX4", HOLD, home_first=False, turning=ATTITUDE_AND_YAW_RATE, parameter_rules=PARAMETER_RULES
    )

    def __init__(self, kernel: Kernel, node: Node, name: str, namespace: str, geoid: Geoid = EGM96) -> None:
        super().__init__(kernel, node, name, namespace, geoid)
        self._command_int = node.client(self._name("cmd/command_int"), "mavros_msgs/srv/CommandInt")
        self._current = node.client(self._name("mission/set_current"), "mavros_msgs/srv/WaypointSetCurrent")
        self._manual = node.advertise(self._name("manual_control/send"), "mavros_msgs/msg/ManualControl")

    @property
    def last_heartbeat_ns(self) -> Ns:
        """Time of the last state."""
        return self._decoder.last_heartbeat_ns

    def request_arming_checks(self) -> None:
        """Do nothing: PX4 reports failing checks in events, which do not pass MAVROS."""

    def lasting_reasons(self, since: Ns) -> Sequence[str]:
        """Return nothing: see ``request_arming_checks``."""
        return ()

    def _takeoff_fields(self) -> Mapping[str, float]:
        return {"latitude": nan, "longitude": nan, "yaw": nan}

    def reposition(self, goal: Position, heading: float | None) -> None:
        """Call ``cmd/command_int`` with DO_REPOSITION, which is not acknowledged."""
        asked = request("mavros_msgs/srv/CommandInt", **reposition_fields(goal, heading))
        self._call(self._command_int, asked)

    def send_setpoint(self, setpoint: OffboardSetpoint | AttitudeTarget) -> None:
        """Publish on ``setpoint_raw/attitude`` or ``setpoint_raw/local``."""
        if isinstance(setpoint, AttitudeTarget):
            self.send_attitude(setpoint)
        elif setpoint.acceleration is not None:
            self._publish_acceleration(setpoint.acceleration, setpoint.yaw_rate)
        else:
            self._publish_velocity(setpoint.velocity, setpoint.yaw_rate)

    def send_manual_control(self, control: ManualControl) -> None:
        """Publish on ``manual_control/send``."""
        axes = manual_control_axes(control, self.telemetry.kind)
        floats = {name: float(value) for name, value in axes.items()}
        self._manual.publish(new("mavros_msgs/msg/ManualControl", **floats))

    def rewind_mission(self) -> None:
        """Call ``mission/set_current``."""
        self._call(self._current, request("mavros_msgs/srv/WaypointSetCurrent", wp_seq=0))


def open_mavros(kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> PX4:
    """Open a PX4 behind MAVROS names, on *node*; for *options* see ``namespace_and_geoid``."""
    where = namespace_and_geoid("px4", name, options)
    return PX4(kernel, name, PX4Mavros(kernel, node, name, *where))
