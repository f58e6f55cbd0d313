"""Backend over MAVROS: an autopilot behind topics and services of a graph, as a commanding node uses them.

MAVROS does not pass on everything: neither the kind of vehicle (``Drone`` or ``Rover`` states it) nor the
result of the arming checks. Here a vehicle is ready once it has a local position, a fix and a home.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import degrees, nan, radians
from typing import Any, NamedTuple

from volery.base.frames import (
    attitude_enu_to_ned,
    attitude_ned_to_enu,
    enu_to_ned,
    ned_to_enu,
    quaternion_to_euler,
)
from volery.base.geoid import EGM96, EGM96_NAME, Geoid, parse_geoid
from volery.base.position import AMSL, Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.links.mavlink_messages import constant, entry_name
from volery.ros.graph import Node, Publisher
from volery.ros.messages import message_class, new, request
from volery.vehicles.address import check_options
from volery.vehicles.driver import Acceleration, AttitudeTarget
from volery.vehicles.drivers.mavlink.backend import (
    ACCELERATION_AND_YAW_RATE,
    ACTIVE,
    FAILSAFE,
    FORCE,
    GROUND_SPEED,
    MEASURED_HEADING,
    ON_GROUND,
    UNCHANGED,
    UNDEFINED,
    VELOCITY_AND_YAW_RATE,
    Ack,
    AttitudeStream,
)
from volery.vehicles.drivers.mavlink.graph_backend import PERIOD, GraphBackend
from volery.vehicles.drivers.mavlink.mavros_services import MavrosServices, to_waypoint
from volery.vehicles.drivers.steps import ROVER_KIND
from volery.vehicles.firmware_versions import VersionRule
from volery.vehicles.services import NO_RULES, ParameterRules, PlanItem
from volery.vehicles.telemetry import Answer, Battery, StatusText, Telemetry, Velocity

MAVROS_OPTIONS = ("geoid", "namespace")
NO_FIX = -1

Handler = Callable[[Any], None]


class FirmwareBehind(NamedTuple):
    """The firmware behind the vehicle node: its name, the mode in which its rovers rest, its missions."""

    autopilot: str
    resting: str
    home_first: bool
    """Whether item 0 of a mission is home."""
    turning: int
    """Type mask of SET_ATTITUDE_TARGET beside a yaw rate."""
    drawn_back: VersionRule[bool] = MEASURED_HEADING
    """See ``AttitudeStream``."""
    parameter_rules: ParameterRules = NO_RULES
    """Its parameters with other names in other versions, and those that it writes itself."""


class MavrosDecoder:
    """Decodes messages of MAVROS topics into telemetry. One method for each topic.

    Attributes:
        node_seen: the state topic is published, with or without an autopilot.
        last_heartbeat_ns: time of the last state of a connected autopilot; -1 before the first.

    Args:
        kernel: clock.
        telemetry: written by the decoder.
        geoid: geoid of the altitudes, which MAVROS states above the ellipsoid.
        firmware: the firmware behind the vehicle node.
    """

    def __init__(self, kernel: Kernel, telemetry: Telemetry, geoid: Geoid, firmware: FirmwareBehind) -> None:
        self.node_seen = False
        self.last_heartbeat_ns: Ns = -1
        self._firmware = firmware
        self._kernel = kernel
        self._telemetry = telemetry
        self._geoid = geoid
        self._landed_state = UNDEFINED
        self._active = False
        self._has_fix = False
        self._has_local_position = False

    def topics(self) -> Mapping[str, tuple[str, Handler]]:
        """Return type and handler of each topic."""
        return {
            "state": ("mavros_msgs/msg/State", self._state),
            "extended_state": ("mavros_msgs/msg/ExtendedState", self._extended_state),
            "global_position/global": ("sensor_msgs/msg/NavSatFix", self._global),
            "global_position/rel_alt": ("std_msgs/msg/Float64", self._relative_altitude),
            "global_position/compass_hdg": ("std_msgs/msg/Float64", self._heading),
            "local_position/velocity_local": ("geometry_msgs/msg/TwistStamped", self._velocity),
            "home_position/home": ("mavros_msgs/msg/HomePosition", self._home),
            "battery": ("sensor_msgs/msg/BatteryState", self._battery),
            "statustext/recv": ("mavros_msgs/msg/StatusText", self._text),
            "mission/reached": ("mavros_msgs/msg/WaypointReached", self._reached),
            "rc/in": ("mavros_msgs/msg/RCIn", self._rc),
        }

    def update_flying(self) -> None:
        """Update ``flying``; it depends on the kind of vehicle, which may become known later."""
        telemetry = self._telemetry
        if telemetry.kind == ROVER_KIND:
            telemetry.flying = telemetry.armed and telemetry.mode != self._firmware.resting
        elif self._landed_state == UNDEFINED:
            telemetry.flying = telemetry.armed and self._active
        else:
            telemetry.flying = self._landed_state != ON_GROUND

    def _note_message(self) -> None:
        self._telemetry.note_message(self._kernel.now())
        self._telemetry.changed.notify()

    def _state(self, message: Any) -> None:
        self.node_seen = True
        if not message.connected:
            return
        telemetry = self._telemetry
        self.last_heartbeat_ns = self._kernel.now()
        telemetry.autopilot = self._firmware.autopilot
        telemetry.mode = message.mode
        telemetry.armed = bool(message.armed)
        telemetry.status = entry_name("MAV_STATE", message.system_status).lower()
        telemetry.failsafe = message.system_status in FAILSAFE
        self._active = message.system_status == ACTIVE
        self._note_message()

    def _extended_state(self, message: Any) -> None:
        self._landed_state = message.landed_state
        self._note_message()

    def _global(self, message: Any) -> None:
        self._has_fix = message.status.status > NO_FIX
        if message.latitude != 0.0 or message.longitude != 0.0:
            self._telemetry.update_position(self._to_position(message))
        self._update_ready()
        self._note_message()

    def _to_position(self, place: Any) -> Position:
        latitude, longitude = place.latitude, place.longitude
        return Position(latitude, longitude, AMSL(self._geoid.to_amsl(latitude, longitude, place.altitude)))

    def _relative_altitude(self, message: Any) -> None:
        self._telemetry.above_home = message.data

    def _heading(self, message: Any) -> None:
        self._telemetry.attitude = self._telemetry.attitude._replace(heading=message.data)

    def orientation(self, message: Any) -> None:
        """Decode the orientation of ``imu/data``: the FLU body in ENU. The heading is that of the compass."""
        turned = message.orientation
        ned = attitude_enu_to_ned((turned.w, turned.x, turned.y, turned.z))
        roll, pitch, _ = quaternion_to_euler(ned)
        self._telemetry.attitude = self._telemetry.attitude._replace(roll=degrees(roll), pitch=degrees(pitch))

    def _velocity(self, message: Any) -> None:
        linear = message.twist.linear
        north, east, down = enu_to_ned((linear.x, linear.y, linear.z))
        self._telemetry.velocity = Velocity(north, east, -down)
        self._has_local_position = True
        self._update_ready()

    def _home(self, message: Any) -> None:
        self._telemetry.home = self._to_position(message.geo)
        self._update_ready()

    def _update_ready(self) -> None:
        telemetry = self._telemetry
        located = telemetry.position is not None and telemetry.home is not None
        fixed = self._has_fix or telemetry.external_pose_ns >= 0
        telemetry.ready = telemetry.armable = fixed and self._has_local_position and located

    def _battery(self, message: Any) -> None:
        """Decode the battery; in ROS the current of a discharge is negative."""
        amperes = -message.current if message.current == message.current else nan
        self._telemetry.battery = Battery(message.percentage, message.voltage, amperes)

    def _text(self, message: Any) -> None:
        self._telemetry.texts.append(StatusText(self._kernel.now(), message.severity, message.text))

    def _rc(self, message: Any) -> None:
        self._telemetry.rc = tuple(int(pulse) for pulse in message.channels)
        self._telemetry.rc_ns = self._kernel.now()
        self._telemetry.changed.notify()

    def _reached(self, message: Any) -> None:
        self._telemetry.mission_reached = message.wp_seq


class MavrosBackend(GraphBackend):
    """See ``Backend``. The constructor joins the graph, which takes execution time of the calling task.

    Args:
        kernel: clock and tasks.
        node: the node that commands the vehicle.
        name: name of the vehicle.
        namespace: namespace of the vehicle node, such as ``/drone_1``.
        geoid: geoid of the altitudes.
    """

    firmware: FirmwareBehind

    def __init__(self, kernel: Kernel, node: Node, name: str, namespace: str, geoid: Geoid = EGM96) -> None:
        super().__init__(kernel, node, name, namespace)
        self._decoder = MavrosDecoder(kernel, self.telemetry, geoid, self.firmware)
        for topic, (message_type, handler) in self._decoder.topics().items():
            self._subscribe(topic, message_type, handler)
        self._velocity = node.advertise(self._name("setpoint_raw/local"), "mavros_msgs/msg/PositionTarget")
        self._set_mode = node.client(self._name("set_mode"), "mavros_msgs/srv/SetMode")
        self._arming = node.client(self._name("cmd/arming"), "mavros_msgs/srv/CommandBool")
        self._takeoff = node.client(self._name("cmd/takeoff"), "mavros_msgs/srv/CommandTOL")
        self._long = node.client(self._name("cmd/command"), "mavros_msgs/srv/CommandLong")
        self._push = node.client(self._name("mission/push"), "mavros_msgs/srv/WaypointPush")
        self._attitude: Publisher | None = None
        self._attitudes = AttitudeStream(kernel, self.firmware.turning, self.firmware.drawn_back)
        self._receives_attitude = False
        self._rate = node.rate(PERIOD)
        self.services = MavrosServices(
            kernel,
            node,
            self.telemetry,
            self._namespace,
            self._spin,
            geoid=geoid,
            home_first=self.firmware.home_first,
            parameter_rules=self.firmware.parameter_rules,
        )

    def _update(self) -> None:
        self._decoder.update_flying()

    def request_attitude(self) -> None:
        """Subscribe to ``imu/data``, at the first call, and wait for a message."""
        if self._receives_attitude:
            return
        self._receives_attitude = True
        self._subscribe("imu/data", "sensor_msgs/msg/Imu", self._decoder.orientation)
        self._wait_for_attitude()

    def _silence(self) -> str:
        if self._decoder.node_seen:
            return f"the vehicle node at {self._namespace} receives no autopilot"
        return f"no vehicle node publishes {self._name('state')}"

    # -- services

    def _note_answer(self, key: str, response: Any | None) -> None:
        if response is not None:
            result = entry_name("MAV_RESULT", response.result)
            self.telemetry.answers[key] = Answer(self._kernel.now(), response.success, result)

    def _command(self, command: str, *parameters: float) -> Any | None:
        named = {f"param{number}": float(value) for number, value in enumerate(parameters, 1)}
        asked = request("mavros_msgs/srv/CommandLong", command=constant(command), **named)
        return self._call(self._long, asked)

    def set_mode(self, mode: str) -> None:
        """Call ``set_mode``; the response states that the command was sent, not that it was obeyed."""
        self._call(self._set_mode, request("mavros_msgs/srv/SetMode", custom_mode=mode))

    def arm(self, arm: bool, *, force: bool = False) -> None:
        """Call ``cmd/arming``, or ``cmd/command`` by force."""
        if force:
            response = self._command("MAV_CMD_COMPONENT_ARM_DISARM", float(arm), FORCE)
        else:
            response = self._call(self._arming, request("mavros_msgs/srv/CommandBool", value=arm))
        self._note_answer(Ack.ARM, response)

    def takeoff(self, altitude: float) -> None:
        """Call ``cmd/takeoff``; the meaning of *altitude* (m) depends on the firmware."""
        asked = request("mavros_msgs/srv/CommandTOL", altitude=altitude, **self._takeoff_fields())
        self._note_answer(Ack.TAKEOFF, self._call(self._takeoff, asked))

    def _takeoff_fields(self) -> Mapping[str, float]:
        """Return place and heading of the take-off; without these the firmware takes off in place."""
        return {}

    def set_speed(self, speed: float) -> None:
        """Call ``cmd/command`` with DO_CHANGE_SPEED."""
        response = self._command("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, speed, UNCHANGED)
        self._note_answer(Ack.SPEED, response)

    def request_arming_checks(self) -> None:
        """Call ``cmd/command`` with RUN_PREARM_CHECKS."""
        self._command("MAV_CMD_RUN_PREARM_CHECKS")

    def upload(self, items: Sequence[PlanItem]) -> None:
        """Call ``mission/push``."""
        waypoints = [to_waypoint(item, number == 0) for number, item in enumerate(items)]
        asked = request("mavros_msgs/srv/WaypointPush", start_index=0, waypoints=waypoints)
        response = self._call(self._push, asked)
        if response is not None:
            result = "ACCEPTED" if response.success else f"{response.wp_transfered} items went over"
            self.telemetry.answers[Ack.MISSION] = Answer(self._kernel.now(), response.success, result)

    # -- topics

    def _publish_velocity(self, velocity: Velocity, yaw_rate: float) -> None:
        """Publish a velocity and yaw rate (degrees/s, clockwise) on ``setpoint_raw/local``."""
        message = new(
            "mavros_msgs/msg/PositionTarget",
            coordinate_frame=constant("MAV_FRAME_LOCAL_NED"),
            type_mask=VELOCITY_AND_YAW_RATE,
            yaw_rate=to_ros_yaw_rate(yaw_rate),
        )
        vector = message_class("geometry_msgs/msg/Vector3")
        message.velocity = vector(*ned_to_enu((velocity.north, velocity.east, -velocity.up)))
        self._velocity.publish(message)

    def _publish_acceleration(self, acceleration: Acceleration, yaw_rate: float) -> None:
        """Publish an acceleration and yaw rate (degrees/s, clockwise) on ``setpoint_raw/local``."""
        north, east, up = acceleration
        vector = message_class("geometry_msgs/msg/Vector3")
        message = new(
            "mavros_msgs/msg/PositionTarget",
            coordinate_frame=constant("MAV_FRAME_LOCAL_NED"),
            type_mask=ACCELERATION_AND_YAW_RATE,
            acceleration_or_force=vector(*ned_to_enu((north, east, -up))),
            yaw_rate=to_ros_yaw_rate(yaw_rate),
        )
        self._velocity.publish(message)

    def send_attitude(self, target: AttitudeTarget) -> None:
        """Publish on ``setpoint_raw/attitude``, which is advertised at the first call."""
        if self._attitude is None:
            name = self._name("setpoint_raw/attitude")
            self._attitude = self._node.advertise(name, "mavros_msgs/msg/AttitudeTarget")
        fields = self._attitudes.fields(target, self.telemetry)
        w, x, y, z = attitude_ned_to_enu(fields["q"])
        rate = to_ros_yaw_rate(degrees(fields["body_yaw_rate"]))
        message = new(
            "mavros_msgs/msg/AttitudeTarget",
            type_mask=fields["type_mask"],
            orientation=message_class("geometry_msgs/msg/Quaternion")(x=x, y=y, z=z, w=w),
            body_rate=message_class("geometry_msgs/msg/Vector3")(0.0, 0.0, rate),
            thrust=target.thrust,
        )
        self._attitude.publish(message)


def to_ros_yaw_rate(degrees: float) -> float:
    """Convert a yaw rate from degrees/s clockwise to rad/s anticlockwise (REP 103)."""
    return -radians(degrees)


def namespace_and_geoid(driver: str, name: str, options: Mapping[str, str]) -> tuple[str, Geoid]:
    """Return the namespace of a vehicle node and the geoid of its altitudes.

    Args:
        driver: name of the driver, for errors.
        name: name of the vehicle.
        options: ``namespace``, by default ``/`` and *name*; ``geoid``: ``egm96`` (default) or metres.
    """
    check_options(driver, options, *MAVROS_OPTIONS)
    return options.get("namespace", f"/{name}"), parse_geoid(options.get("geoid", EGM96_NAME))
