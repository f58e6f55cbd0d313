"""The ROS node of a DJI aircraft (``dji_sdk`` 3.8 or the vehicle node of ``dji_osdk_ros``) and its topics.

Only topics with subscribers are built and published, which saves hundreds of messages a second; where the
graph takes the place of a link, only messages that a subscriber uses.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import degrees, isfinite, radians
from typing import Any, NamedTuple

from volery.base.elementary import cos
from volery.base.errors import UsageError
from volery.base.frames import attitude_ned_to_enu, frd_to_flu, ned_to_enu
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Handle
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import sleep
from volery.ros.graph import DEFAULT, LATCHED, CallFailedError, Node, Publisher, QoS, RosGraph, Work
from volery.ros.messages import message_class
from volery.ros.messages.dji_constants import (
    A3,
    M100,
    M600,
    N3,
    NEW_NAMES,
    OLD_NAMES,
    SETPOINT,
    SETPOINT_TOPICS,
    GimbalMode,
)
from volery.simulation.autopilots.dji.flight_controller import FlightController, controller_of
from volery.simulation.autopilots.dji.sdk_services import Answer, SdkServices
from volery.simulation.autopilots.dji.waypoint_v2 import WaypointV2Services
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import Text

INERTIAL, FAST, NORMAL, SLOW = 2_500_000, 10 * MS, 20 * MS, 200 * MS
"""Periods of the node's groups of topics: 400, 100, 50 and 5 Hz."""

EARTH_M = 6_378_137.0
"""Earth radius of the flat-earth conversion of the local position [m]."""

FIX, GPS = 0, 1
"""The node never reports another status than a fix."""

SWITCH_AT_F: Mapping[str, float] = {A3: -1.0, N3: -1.0, M100: 8000.0}
"""Value of the mode switch in ``rc`` at F by type of aircraft; at A it is 0, at P the opposite."""
OTHER_AT_F = -10_000.0
"""The same for other aircraft: the size is known, the sign is assumed."""
AXES: Mapping[str, int] = {A3: 12, N3: 12}
"""Number of axes in ``rc`` where it is not six."""

Builder = Callable[[FlightController, Ns], Any]
"""Returns a message stamped with a ROS time, or None while there is none."""


class SdkTopic(NamedTuple):
    """Name, type, period, builder and QoS of one topic."""

    name: str
    type: str
    period: Ns
    build: Builder
    qos: QoS = DEFAULT


_time: Any = message_class("builtin_interfaces/msg/Time")
_header_of: Any = message_class("std_msgs/msg/Header")
_vector3: Any = message_class("geometry_msgs/msg/Vector3")
_quaternion_of: Any = message_class("geometry_msgs/msg/Quaternion")
_quaternion_stamped: Any = message_class("geometry_msgs/msg/QuaternionStamped")
_vector_stamped: Any = message_class("geometry_msgs/msg/Vector3Stamped")
_uint8: Any = message_class("std_msgs/msg/UInt8")
_nav_sat_fix: Any = message_class("sensor_msgs/msg/NavSatFix")
_joy: Any = message_class("sensor_msgs/msg/Joy")


def _header(stamp: Ns, frame: str) -> Any:
    return _header_of(_time(stamp // S, stamp % S), frame)


def _vector(values: tuple[float, float, float]) -> Any:
    return _vector3(*values)


def _quaternion(controller: FlightController) -> Any:
    w, x, y, z = attitude_ned_to_enu(controller.vehicle.estimate.quaternion)
    return _quaternion_of(x, y, z, w)


def _attitude(controller: FlightController, stamp: Ns) -> Any:
    return _quaternion_stamped(_header(stamp, "body_FLU"), _quaternion(controller))


def _imu(controller: FlightController, stamp: Ns) -> Any:
    estimate = controller.vehicle.estimate
    made: Any = message_class("sensor_msgs/msg/Imu")(_header(stamp, "body_FLU"))
    made.orientation = _quaternion(controller)
    made.angular_velocity = _vector(frd_to_flu(estimate.rates))
    made.linear_acceleration = _vector(frd_to_flu(estimate.accel))
    return made


def _rates(controller: FlightController, stamp: Ns) -> Any:
    """Return the angular rates; an M100 does not send them."""
    if controller.aircraft == M100:
        return None
    rates = frd_to_flu(controller.vehicle.estimate.rates)
    return _vector_stamped(_header(stamp, "body_FLU"), _vector(rates))


def _acceleration(controller: FlightController, stamp: Ns) -> Any:
    """Return the acceleration over ground; an M100 does not send it."""
    if controller.aircraft == M100:
        return None
    acceleration = ned_to_enu(controller.vehicle.estimate.acceleration)
    return _vector_stamped(_header(stamp, "ground_ENU"), _vector(acceleration))


def _velocity(controller: FlightController, stamp: Ns) -> Any:
    velocity = ned_to_enu(controller.vehicle.estimate.velocity)
    return _vector_stamped(_header(stamp, "ground_ENU"), _vector(velocity))


def _gimbal_angle(controller: FlightController, stamp: Ns) -> Any:
    """Return roll, pitch and yaw of the gimbal in degrees, as the flight controller sends them."""
    return _vector_stamped(_header(stamp, "ground_ENU"), _vector(controller.gimbal.angles()))


def _byte(value: int) -> Any:
    return _uint8(value)


def _display_mode(controller: FlightController, _stamp: Ns) -> Any:
    """Return the display mode; an M100 has none."""
    return None if controller.aircraft == M100 else _byte(controller.mode)


def _fix(stamp: Ns, place: tuple[float, float, float]) -> Any:
    made = _nav_sat_fix(_header(stamp, "/gps"))
    made.status.status, made.status.service = FIX, GPS
    made.latitude, made.longitude, made.altitude = place
    return made


def _gps_position(controller: FlightController, stamp: Ns) -> Any:
    """Return the position with its pressure altitude."""
    return _fix(stamp, controller.place())


def _local_position(controller: FlightController, stamp: Ns) -> Any:
    """Return the position, east-north-up about the reference."""
    reference = controller.reference
    if reference is None:
        return None
    latitude, longitude, altitude = controller.place()
    made: Any = message_class("geometry_msgs/msg/PointStamped")(_header(stamp, "/local"))
    made.point.x = radians(longitude - reference[1]) * EARTH_M * cos(radians(reference[0]))
    made.point.y = radians(latitude - reference[0]) * EARTH_M
    made.point.z = altitude - reference[2]
    return made


def _local_frame_ref(controller: FlightController, stamp: Ns) -> Any:
    reference = controller.reference
    return None if reference is None else _fix(stamp, reference)


def _height(controller: FlightController, _stamp: Ns) -> Any:
    """Return what the topic shows, which is a height above the take-off point for few aircraft only."""
    return message_class("std_msgs/msg/Float32")(controller.height_below())


def _rc(controller: FlightController, stamp: Ns) -> Any:
    """Return roll, pitch, yaw, throttle (-1..1), mode switch and gear."""
    pulses = controller.vehicle.rc.pulses()
    roll, pitch, throttle, yaw, switch = ((pulse - 1500) / 500.0 for pulse in pulses[:5])
    switch *= SWITCH_AT_F.get(controller.aircraft, OTHER_AT_F)
    axes = [roll, pitch, yaw, throttle, switch]
    axes += [0.0] * (AXES.get(controller.aircraft, 6) - len(axes))
    return _joy(_header(stamp, ""), axes, [])


def _rc_connection(controller: FlightController, _stamp: Ns) -> Any:
    """Return whether the transmitter is received; an M600 with its usual firmware does not tell."""
    return None if controller.aircraft == M600 else _byte(int(controller.rc_connected))


def _battery(controller: FlightController, stamp: Ns) -> Any:
    """Return the battery state in mV, mA and percent, as the flight controller sends it."""
    estimate = controller.vehicle.estimate
    made: Any = message_class("sensor_msgs/msg/BatteryState")(_header(stamp, ""))
    made.voltage = estimate.battery_volts * 1000.0
    made.current = -estimate.battery_amps * 1000.0
    made.capacity = controller.vehicle.flight.capacity_as / 3.6
    made.percentage = float(round(estimate.battery_left * 100.0))
    made.present = True
    return made


TOPICS: tuple[SdkTopic, ...] = (
    SdkTopic("attitude", "geometry_msgs/msg/QuaternionStamped", FAST, _attitude),
    SdkTopic("imu", "sensor_msgs/msg/Imu", INERTIAL, _imu),
    SdkTopic("angular_velocity_fused", "geometry_msgs/msg/Vector3Stamped", FAST, _rates),
    SdkTopic("acceleration_ground_fused", "geometry_msgs/msg/Vector3Stamped", FAST, _acceleration),
    SdkTopic("flight_status", "std_msgs/msg/UInt8", NORMAL, lambda one, _: _byte(one.status)),
    SdkTopic("display_mode", "std_msgs/msg/UInt8", NORMAL, _display_mode),
    SdkTopic("gps_health", "std_msgs/msg/UInt8", NORMAL, lambda one, _: _byte(one.gps_health)),
    SdkTopic("gps_position", "sensor_msgs/msg/NavSatFix", NORMAL, _gps_position),
    SdkTopic("local_position", "geometry_msgs/msg/PointStamped", NORMAL, _local_position),
    SdkTopic("height_above_takeoff", "std_msgs/msg/Float32", NORMAL, _height),
    SdkTopic("velocity", "geometry_msgs/msg/Vector3Stamped", NORMAL, _velocity),
    SdkTopic("gimbal_angle", "geometry_msgs/msg/Vector3Stamped", NORMAL, _gimbal_angle),
    SdkTopic("rc", "sensor_msgs/msg/Joy", NORMAL, _rc),
    SdkTopic("rc_connection_status", "std_msgs/msg/UInt8", NORMAL, _rc_connection),
    SdkTopic("battery_state", "sensor_msgs/msg/BatteryState", SLOW, _battery),
)
"""All periodic topics except ``flight_anomaly``, whose type depends on the package."""

REFERENCE = SdkTopic("local_frame_ref", "sensor_msgs/msg/NavSatFix", 0, _local_frame_ref, LATCHED)


def topics(package: str) -> tuple[SdkTopic, ...]:
    """Return all periodic topics with the types of a package."""
    kind = f"{package}/msg/FlightAnomaly"
    return (
        *TOPICS,
        SdkTopic("flight_anomaly", kind, NORMAL, lambda one, _: message_class(kind)(one.anomalies)),
    )


SUBSCRIBER_CHECK_PERIOD: Ns = 200 * MS
"""Interval at which the node checks which topics have subscribers."""

JOY = "sensor_msgs/msg/Joy"


def _raise(_index: int, error: Exception) -> None:
    raise error


class _TopicGroup:
    """Topics of one period."""

    def __init__(self, endpoint: DjiEndpoint, period: Ns, listed: list[tuple[SdkTopic, Publisher]]) -> None:
        self._endpoint = endpoint
        self._check_every = max(1, SUBSCRIBER_CHECK_PERIOD // period)
        self._listed = listed
        self._subscribed: list[tuple[SdkTopic, Publisher]] = []
        self._round = 0
        self._rests_until: Ns = 0  # no topic is awaited before

    @property
    def wanted(self) -> bool:
        """Whether any of the topics has a subscriber."""
        return any(publisher.subscribers() for _, publisher in self._listed)

    def publish(self) -> None:
        """Publish the topics that have subscribers, as a framework callback."""
        if self._round % self._check_every == 0:
            self._subscribed = [one for one in self._listed if one[1].subscribers()]
            self._rests_until = 0
        self._round += 1
        now = self._endpoint.now()
        if not self._subscribed or now < self._rests_until or not self._endpoint.is_active:
            return
        stamp, controller = self._endpoint.stamp(), self._endpoint.controller
        built = [
            (publisher, topic.build(controller, stamp))
            for topic, publisher in self._subscribed
            if publisher.awaited_from() <= now
        ]
        self._endpoint.publish([one for one in built if one[1] is not None])
        self._rests_until = min(publisher.awaited_from() for _, publisher in self._subscribed)


class DjiEndpoint:
    """Protocol endpoint of one aircraft on a ROS graph."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        self._vehicle = vehicle
        self._kernel = vehicle.kernel
        self._on = False
        self._clocks: list[Handle] = []
        self._inertial: Handle | None = None
        self._requests: deque[Work] = deque()  # of the node of 4.1, which answers one after the other
        self._busy = False
        self._packages: dict[Ns, _TopicGroup] = {}
        self._graph: RosGraph | None = None
        self._node: Node | None = None
        self._reference: Publisher | None = None
        self._place = ExecutionContext(vehicle.name)

    @property
    def controller(self) -> FlightController:
        """Flight controller behind the node."""
        return controller_of(self._vehicle)

    @property
    def is_active(self) -> bool:
        """Whether the aircraft is on and has booted."""
        return self._on and self._vehicle.uptime() >= self._vehicle.rules.startup.ready_after

    def now(self) -> Ns:
        """Return the time of the kernel."""
        return self._kernel.now()

    def stamp(self) -> Ns:
        """Return the present ROS time."""
        return (self._graph.epoch if self._graph else 0) + self._kernel.now()

    # -- ROS graph

    def publish(self, messages: Sequence[tuple[Publisher, Any]]) -> None:
        """Publish messages that were built for this call."""
        if self._node is not None and messages:
            self._node.publish_all(messages, _raise)

    def join(self, graph: RosGraph, namespace: str, place: ExecutionContext) -> None:
        """Serve on a graph.

        Args:
            graph: The ROS graph.
            namespace: Such as ``/drone_1/dji_sdk``; one that ends in ``dji_osdk_ros`` has the names of 4.1.
            place: Execution context that is charged for the node's computing.

        Raises:
            UsageError: If the namespace ends in another name, or the aircraft is on a graph already.
        """
        above, _, package = namespace.rstrip("/").rpartition("/")
        if package not in (OLD_NAMES, NEW_NAMES):
            raise UsageError(
                f"{self._vehicle.name}: a DJI node is reached under {OLD_NAMES} or {NEW_NAMES}, as in "
                f"/{self._vehicle.name}/{OLD_NAMES}; not under {namespace!r}"
            )
        if self._node is not None:
            raise UsageError(f"{self._vehicle.name} is on a graph already, as {self._node.name}")
        self._graph, self._place = graph, place
        node = self._node = graph.node(package, above or "/", context=place)
        self._advertise(node, package)
        self._listen(node, package)
        services = SdkServices(self.controller, self._publish_reference)
        group = node.group(self._start_next if package == NEW_NAMES else self._start)
        second_kind = WaypointV2Services(self.controller).table() if package == NEW_NAMES else ()
        for served in (*services.table(package), *second_kind):
            node.serve(served.name, served.type, partial(self._answer, served.answer), group)
        if self._on:
            self.start()

    def _advertise(self, node: Node, package: str) -> None:
        listed: dict[Ns, list[tuple[SdkTopic, Publisher]]] = {INERTIAL: [], FAST: [], NORMAL: [], SLOW: []}
        for topic in topics(package):
            publisher = node.advertise(f"{package}/{topic.name}", topic.type, topic.qos)
            slower = topic.period == INERTIAL and self.controller.aircraft == M100
            listed[FAST if slower else topic.period].append((topic, publisher))
        self._packages = {period: _TopicGroup(self, period, some) for period, some in listed.items()}
        self._reference = node.advertise(f"{package}/{REFERENCE.name}", REFERENCE.type, REFERENCE.qos)

    def _publish_reference(self) -> None:
        message = REFERENCE.build(self.controller, self.stamp())
        if self._reference is not None and message is not None:
            self._reference.publish(message)

    def _listen(self, node: Node, package: str) -> None:
        """Subscribe to the set-point topics. The node of 4.1 has a service instead."""
        if package == NEW_NAMES:
            return
        group = node.group(lambda work: work.run())
        for name, flag in SETPOINT_TOPICS.items():
            node.subscribe(f"{package}/{name}", JOY, partial(self._setpoint, flag), group=group)
        node.subscribe(f"{package}/{SETPOINT}generic", JOY, self._generic, group=group)
        node.subscribe(f"{package}/gimbal_angle_cmd", f"{package}/msg/Gimbal", self._gimbal, group=group)

    def _setpoint(self, flag: int, message: Any) -> None:
        with self._kernel.guard:
            if self.is_active:
                self.controller.handle_setpoint(tuple(float(axis) for axis in message.axes[:4]), flag)

    def _gimbal(self, message: Any) -> None:
        """Handle ``gimbal_angle_cmd``: radians, and a bit of ``mode`` for each axis that keeps its angle."""
        mode = message.mode
        kept = (GimbalMode.KEEPS_ROLL, GimbalMode.KEEPS_PITCH, GimbalMode.KEEPS_YAW)
        angles = (message.roll, message.pitch, message.yaw)
        wanted = [None if mode & keeps else degrees(angle) for keeps, angle in zip(kept, angles, strict=True)]
        with self._kernel.guard:
            if self.is_active and all(isfinite(angle) for angle in angles):
                relative = not mode & GimbalMode.ABSOLUTE
                self.controller.gimbal.point(wanted, message.ts, relative=relative)

    def _generic(self, message: Any) -> None:
        if len(message.axes) >= 5 and 0.0 <= message.axes[4] < 256.0:
            self._setpoint(int(message.axes[4]), message)

    def _start(self, work: Work) -> None:
        """Start a task for a request."""
        self._kernel.spawn(work.run, f"{self._vehicle.name} (service)", self._place, self._kernel.root)

    def _start_next(self, work: Work) -> None:
        """Queue a request; the node of 4.1 runs in one thread."""
        self._requests.append(work)
        if not self._busy:
            self._busy = True
            self._kernel.spawn(
                self._run_requests, f"{self._vehicle.name} (services)", self._place, self._kernel.root
            )

    def _run_requests(self) -> None:
        """Answer the queued requests in order."""
        while self._requests:
            self._requests.popleft().run()
        self._busy = False

    def _answer(self, answer: Answer, request: Any) -> Any:
        with self._kernel.guard:
            response, finished = answer(request)
        if finished is not None:
            while not finished():
                sleep(self._kernel, NORMAL)
        if response is None:
            raise CallFailedError("the aircraft has refused")
        return response

    # -- protocol endpoint

    def start(self) -> None:
        """Start publishing after power-on."""
        self.stop()
        self._on = True
        for period, group in self._packages.items():
            if period == INERTIAL:
                self._clocks.append(self._kernel.every(SUBSCRIBER_CHECK_PERIOD, self._follow_demand))
            else:
                self._clocks.append(self._kernel.every(period, group.publish))

    def stop(self) -> None:
        """Stop publishing."""
        self._on = False
        for clock in self._clocks:
            clock.cancel()
        self._clocks.clear()
        self._stop_inertial()

    def _follow_demand(self) -> None:
        """Run the clock of the fastest group only while it has subscribers: it is four times as costly."""
        group = self._packages[INERTIAL]
        if not group.wanted:
            self._stop_inertial()
        elif self._inertial is None:
            self._inertial = self._kernel.every(INERTIAL, group.publish)

    def _stop_inertial(self) -> None:
        if self._inertial is not None:
            self._inertial.cancel()
            self._inertial = None

    def close(self) -> None:
        """Leave the graph."""
        if self._node is not None:
            self._node.close()
            self._node = None

    def send_text(self, severity: int, text: str) -> None:
        """Record the text; there is no topic for it."""
        self._kernel.record(Text(self._kernel.now(), self._vehicle.name, severity, text))

    def parameter_changed(self, name: str) -> None:
        """Send nothing: the protocol has no parameters."""

    def mode_changed(self) -> None:
        """Send nothing: the mode is published periodically."""

    def home_changed(self) -> None:
        """Send nothing: the protocol has no home position."""

    def send_message(self, message: str) -> None:
        """Send nothing: all messages are periodic."""

    def send_event(self, message: str, fields: dict[str, Any]) -> None:
        """Send nothing: the protocol has no events."""

    def after_reply(self, action: Action) -> None:
        """Execute the action at once."""
        action()
