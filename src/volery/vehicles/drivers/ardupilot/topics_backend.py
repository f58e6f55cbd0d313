"""ArduPilot over its own ROS 2 topics and services, those of 4.7 and newer below ``ap``.

Home is where ``pose/filtered``, which is about home, puts it. The arming checks are asked for by
``prearm_check``, which answers whether they pass, not which of them fail. What these topics do not carry is
refused by name: speeds, turns to a heading, accelerations, attitudes, missions. Sticks are sent on ``joy``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import degrees, isfinite, nan
from typing import Any, NoReturn

from volery.base.errors import CapabilityError, UsageError
from volery.base.frames import (
    LocalFrame,
    attitude_enu_to_ned,
    enu_to_ned,
    ned_to_enu,
    quaternion_to_euler,
)
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.ros.graph import LATCHED, Node
from volery.ros.messages import message_class, new, request
from volery.vehicles.address import check_options
from volery.vehicles.driver import Acceleration, AttitudeTarget
from volery.vehicles.drivers.ardupilot.driver import ArduPilot
from volery.vehicles.drivers.ardupilot.modes import NUMBERS, RESTING, mode_name
from volery.vehicles.drivers.mavlink.backend import INT_FRAMES, Ack
from volery.vehicles.drivers.mavlink.graph_backend import PERIOD, GraphBackend
from volery.vehicles.drivers.mavlink.mavros_backend import to_ros_yaw_rate
from volery.vehicles.drivers.steps import DRONE_KIND, ROVER_KIND
from volery.vehicles.services import PlanItem
from volery.vehicles.telemetry import Answer, Attitude, Battery, Velocity

RELEASED = 0
"""Pulse width that gives a channel back to the transmitter."""
_CENTRE, _HALF = 1500.0, 500.0
"""Pulse width in microseconds of an axis of ``joy`` at 0, and its change up to 1."""
_MAP = "map"


class ArduPilotTopics(GraphBackend):
    """See ``ArduPilotBackend``. The constructor joins the graph, which takes execution time of the task.

    Args:
        kernel: clock and tasks.
        node: the node that commands the vehicle.
        name: name of the vehicle.
        namespace: namespace of the names, such as ``/drone_1``; empty for the root.
    """

    def __init__(self, kernel: Kernel, node: Node, name: str, namespace: str) -> None:
        super().__init__(kernel, node, name, namespace)
        self.services = None
        self._flying = False
        self._number = 0
        self._from_home: tuple[float, float, float] | None = None
        self._axes = [nan] * 4
        received: dict[str, tuple[str, Callable[[Any], None]]] = {
            "pose/filtered": ("geometry_msgs/msg/PoseStamped", self._on_pose),
            "geopose/filtered": ("geographic_msgs/msg/GeoPoseStamped", self._on_geopose),
            "twist/filtered": ("geometry_msgs/msg/TwistStamped", self._on_twist),
            "battery": ("sensor_msgs/msg/BatteryState", self._on_battery),
        }
        for topic, (kind, handler) in received.items():
            self._subscribe(f"ap/{topic}", kind, handler)
        status = self._name("ap/status")
        node.subscribe(status, "ardupilot_msgs/msg/Status", self._on_status, LATCHED, self._inbox)
        self._velocities = node.advertise(self._name("ap/cmd_vel"), "geometry_msgs/msg/TwistStamped")
        self._goals = node.advertise(self._name("ap/cmd_gps_pose"), "ardupilot_msgs/msg/GlobalPosition")
        self._sticks = node.advertise(self._name("ap/joy"), "sensor_msgs/msg/Joy")
        self._arming = node.client(self._name("ap/arm_motors"), "ardupilot_msgs/srv/ArmMotors")
        self._switch = node.client(self._name("ap/mode_switch"), "ardupilot_msgs/srv/ModeSwitch")
        self._takeoff = node.client(self._name("ap/experimental/takeoff"), "ardupilot_msgs/srv/Takeoff")
        self._check = node.client(self._name("ap/prearm_check"), "std_srvs/srv/Trigger")
        self._rate = node.rate(PERIOD)

    # -- what is received

    def _on_status(self, message: Any) -> None:
        seen = self.telemetry
        seen.autopilot = "ArduPilot"
        self._number = message.mode
        seen.armed, self._flying = bool(message.armed), bool(message.flying)
        seen.failsafe = len(message.failsafe) > 0
        seen.status = "critical" if seen.failsafe else ("active" if seen.armed else "standby")
        self._note_message()

    def _on_pose(self, message: Any) -> None:
        place = message.pose.position
        self._from_home = place.x, place.y, place.z
        self.telemetry.above_home = place.z
        self._note_message()

    def _on_geopose(self, message: Any) -> None:
        seen, place, turned = self.telemetry, message.pose.position, message.pose.orientation
        if place.latitude == 0.0 and place.longitude == 0.0:
            return
        here = Position(place.latitude, place.longitude, AMSL(place.altitude))
        seen.update_position(here)
        roll, pitch, yaw = quaternion_to_euler(attitude_enu_to_ned((turned.w, turned.x, turned.y, turned.z)))
        seen.attitude = Attitude(degrees(roll), degrees(pitch), degrees(yaw) % 360.0)
        if self._from_home is not None and not seen.armed:
            east, north, up = self._from_home
            frame = LocalFrame(here.latitude, here.longitude, place.altitude)
            latitude, longitude, amsl = frame.from_enu((-east, -north, -up))
            seen.home = Position(latitude, longitude, AMSL(amsl))
        self._note_message()

    def _on_twist(self, message: Any) -> None:
        linear = message.twist.linear
        north, east, down = enu_to_ned((linear.x, linear.y, linear.z))
        self.telemetry.velocity = Velocity(north, east, -down)

    def _on_battery(self, message: Any) -> None:
        self.telemetry.battery = Battery(message.percentage, message.voltage, -message.current)

    def _update(self) -> None:
        seen = self.telemetry
        if seen.autopilot:
            seen.mode = mode_name(seen.kind, self._number)
        flies = seen.mode != RESTING if seen.kind == ROVER_KIND else self._flying
        seen.flying = seen.armed and flies
        seen.ready = seen.armable and seen.position is not None and isfinite(seen.above_home)

    def _silence(self) -> str:
        topic = self._name("ap/status")
        return f"nothing publishes {topic}: is the agent running, and is the firmware 4.7 or newer?"

    def request_attitude(self) -> None:
        """Wait for an attitude, which is received anyway."""
        self._wait_for_attitude()

    def request_arming_checks(self) -> None:
        """Call ``prearm_check``."""
        response = self._call(self._check, request("std_srvs/srv/Trigger"))
        self.telemetry.armable = response is not None and bool(response.success)

    def lasting_reasons(self, since: Ns) -> Sequence[str]:
        """Return nothing: the checks that fail are not named."""
        return ()

    # -- what is sent

    def _note_answer(self, key: str, accepted: bool | None) -> None:
        if accepted is not None:
            result = "accepted" if accepted else "refused"
            self.telemetry.answers[key] = Answer(self._kernel.now(), accepted, result)

    def set_mode(self, mode: str) -> None:
        """Call ``mode_switch``."""
        number = NUMBERS.get(self.telemetry.kind, {}).get(mode)
        if number is None:
            raise UsageError(f"{self.telemetry.name} has no mode {mode!r}")
        response = self._call(self._switch, request("ardupilot_msgs/srv/ModeSwitch", mode=number))
        self._note_answer(Ack.MODE, None if response is None else bool(response.status))

    def arm(self, arm: bool, *, force: bool = False) -> None:
        """Call ``arm_motors``, which knows no force."""
        if force:
            self._refuse("to arm or disarm by force")
        response = self._call(self._arming, request("ardupilot_msgs/srv/ArmMotors", arm=arm))
        self._note_answer(Ack.ARM, None if response is None else bool(response.result))

    def takeoff(self, height: float) -> None:
        """Call ``experimental/takeoff``."""
        response = self._call(self._takeoff, request("ardupilot_msgs/srv/Takeoff", alt=height))
        self._note_answer(Ack.TAKEOFF, None if response is None else bool(response.status))

    def send_target(self, goal: Position) -> None:
        """Publish on ``cmd_gps_pose``; a rover's target has no altitude."""
        if self.telemetry.kind != DRONE_KIND:
            goal = Position(goal.latitude, goal.longitude, AboveHome(0.0))
        message = new(
            "ardupilot_msgs/msg/GlobalPosition",
            coordinate_frame=INT_FRAMES[type(goal.altitude)],
            latitude=goal.latitude,
            longitude=goal.longitude,
            altitude=goal.altitude.metres,
        )
        message.header.frame_id = _MAP
        self._goals.publish(message)

    def send_velocity(self, velocity: Velocity, yaw_rate: float) -> None:
        """Publish on ``cmd_vel`` in the axes of the earth."""
        message = new("geometry_msgs/msg/TwistStamped")
        message.header.frame_id = _MAP
        vector = message_class("geometry_msgs/msg/Vector3")
        message.twist.linear = vector(*ned_to_enu((velocity.north, velocity.east, -velocity.up)))
        message.twist.angular.z = to_ros_yaw_rate(yaw_rate)
        self._velocities.publish(message)

    def override_channels(self, channels: Sequence[int | None]) -> None:
        """Publish on ``joy``, whose axes are the channels from the first on; NaN releases one."""
        for place, width in enumerate(channels[: len(self._axes)]):
            if width is not None:
                self._axes[place] = nan if width == RELEASED else (width - _CENTRE) / _HALF
        self._sticks.publish(new("sensor_msgs/msg/Joy", axes=list(self._axes)))

    # -- what these topics do not carry

    def _refuse(self, what: str) -> NoReturn:
        raise CapabilityError(
            f"{self.telemetry.name}: {what} does not pass ArduPilot's topics; connect by MAVLink or MAVROS"
        )

    def set_speed(self, speed: float) -> None:
        """Refuse."""
        self._refuse("a speed for movements to a position")

    def turn(self, degrees: float) -> None:
        """Refuse."""
        self._refuse("a turn to a heading")

    def send_acceleration(self, acceleration: Acceleration, yaw_rate: float) -> None:
        """Refuse."""
        self._refuse("an acceleration")

    def send_attitude(self, target: AttitudeTarget) -> None:
        """Refuse."""
        self._refuse("an attitude")

    def upload(self, items: Sequence[PlanItem]) -> None:
        """Refuse."""
        self._refuse("a mission")

    def start_mission(self) -> None:
        """Refuse."""
        self._refuse("the start of a mission")


def open_topics(kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> ArduPilot:
    """Open an ArduPilot behind its own topics.

    Args:
        kernel: clock and tasks.
        node: the node that commands the vehicle.
        name: name of the vehicle.
        options: ``namespace`` of the topics, by default the root.
    """
    check_options("ardupilot", options, "namespace")
    return ArduPilot(kernel, name, ArduPilotTopics(kernel, node, name, options.get("namespace", "")))
