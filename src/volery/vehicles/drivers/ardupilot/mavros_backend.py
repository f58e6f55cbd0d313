"""An ArduPilot over MAVROS: apart from ``backend``, because a flight over a link imports nothing of ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from volery.base.geoid import EGM96, Geoid
from volery.base.position import Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.ros.graph import Node
from volery.ros.messages import new
from volery.vehicles.driver import Acceleration
from volery.vehicles.drivers.ardupilot.backend import lasting_reasons
from volery.vehicles.drivers.ardupilot.driver import ArduPilot
from volery.vehicles.drivers.ardupilot.modes import RESTING
from volery.vehicles.drivers.ardupilot.versions import DRAWN_BACK, PARAMETER_RULES
from volery.vehicles.drivers.mavlink.backend import (
    ATTITUDE_AND_RATES,
    INT_FRAMES,
    POSITION_ONLY,
    SHORTEST_TURN,
    UNCHANGED_CHANNEL,
    Ack,
)
from volery.vehicles.drivers.mavlink.mavros_backend import (
    FirmwareBehind,
    MavrosBackend,
    namespace_and_geoid,
)
from volery.vehicles.telemetry import Velocity

CHANNELS = 18
"""Length of the array in MAVROS's OverrideRCIn."""


class ArduPilotMavros(MavrosBackend):
    """ArduPilot over MAVROS. See ``ArduPilotBackend``."""

    firmware = FirmwareBehind(
        "ArduPilot",
        RESTING,
        home_first=True,
        turning=ATTITUDE_AND_RATES,
        drawn_back=DRAWN_BACK,
        parameter_rules=PARAMETER_RULES,
    )

    def __init__(self, kernel: Kernel, node: Node, name: str, namespace: str, geoid: Geoid = EGM96) -> None:
        super().__init__(kernel, node, name, namespace, geoid)
        target = "mavros_msgs/msg/GlobalPositionTarget"
        self._target = node.advertise(self._name("setpoint_raw/global"), target)
        self._override = node.advertise(self._name("rc/override"), "mavros_msgs/msg/OverrideRCIn")

    def lasting_reasons(self, since: Ns) -> Sequence[str]:
        """Return the arming checks that fail since then and that waiting does not mend."""
        return lasting_reasons(self.telemetry, since)

    def turn(self, degrees: float) -> None:
        """Call ``cmd/command`` with CONDITION_YAW."""
        response = self._command("MAV_CMD_CONDITION_YAW", degrees, 0.0, SHORTEST_TURN, 0.0)
        self._note_answer(Ack.HEADING, response)

    def start_mission(self) -> None:
        """Call ``cmd/command`` with MISSION_START."""
        self._note_answer(Ack.START, self._command("MAV_CMD_MISSION_START", 0.0, 0.0))

    def send_target(self, goal: Position) -> None:
        """Publish on ``setpoint_raw/global``; the altitude is passed on in the stated frame."""
        message = new(
            "mavros_msgs/msg/GlobalPositionTarget",
            coordinate_frame=INT_FRAMES[type(goal.altitude)],
            type_mask=POSITION_ONLY,
            latitude=goal.latitude,
            longitude=goal.longitude,
            altitude=goal.altitude.metres,
        )
        self._target.publish(message)

    def send_velocity(self, velocity: Velocity, yaw_rate: float) -> None:
        """Publish on ``setpoint_raw/local``."""
        self._publish_velocity(velocity, yaw_rate)

    def send_acceleration(self, acceleration: Acceleration, yaw_rate: float) -> None:
        """Publish on ``setpoint_raw/local``."""
        self._publish_acceleration(acceleration, yaw_rate)

    def override_channels(self, channels: Sequence[int | None]) -> None:
        """Publish on ``rc/override``."""
        widths = [UNCHANGED_CHANNEL if width is None else width for width in channels]
        widths += [UNCHANGED_CHANNEL] * (CHANNELS - len(widths))
        self._override.publish(new("mavros_msgs/msg/OverrideRCIn", channels=widths))


def open_mavros(kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> ArduPilot:
    """Open an ArduPilot behind MAVROS names, on *node*; for *options* see ``namespace_and_geoid``."""
    where = namespace_and_geoid("ardupilot", name, options)
    return ArduPilot(kernel, name, ArduPilotMavros(kernel, node, name, *where))
