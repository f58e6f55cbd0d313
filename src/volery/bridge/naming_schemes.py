"""The naming schemes of MAVROS, of roscopter and of autopilots themselves: topics, services, types and units.

Differences from MAVROS: publishers are reliable, as in ROS 1; the node sends with the system id of a ground
station, which is the only one from which ArduPilot accepts manual control; the node requests the streams that
it publishes, as roscopter does; topics that few nodes need are published only while they have a subscription.

Differences from roscopter: the node waits for frames instead of polling a thousand times a second; ``rc`` is
also published from RC_CHANNELS, and ``raw_imu`` from SCALED_IMU and HIGHRES_IMU, where the autopilot sends
those instead; a refused arming is reported as a warning and on ``state``, because the type of the service has
no field for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from volery.base.time import Ns
from volery.bridge.ardupilot_interface import OLDEST as OLDEST_ARDUPILOT
from volery.bridge.ardupilot_interface import RATES as ARDUPILOT_RATES
from volery.bridge.ardupilot_interface import ArduPilotInterface
from volery.bridge.autopilot_link import (
    ALL,
    EXTENDED_STATUS,
    EXTRA1,
    EXTRA2,
    POSITION,
    RAW_SENSORS,
    RC,
    AutopilotType,
    mode_name,
)
from volery.bridge.commands import ARM_DISARM, TARGET_TOPICS, CommandServices, TargetPublisher, subscriptions
from volery.bridge.motion_publishers import (
    IMU_SOURCES,
    IMU_TOPICS,
    POSE_TOPICS,
    TRANSFORM_TOPICS,
    ImuPublisher,
    PosePublisher,
    TransformPublisher,
    imu_source,
)
from volery.bridge.node_interface import (
    Fields,
    InterfaceContext,
    NamingScheme,
    NodeInterface,
    OutgoingMessage,
    PublishedByNode,
    Service,
    SubscribedTopic,
    Translator,
    merge_translators,
    stamped,
)
from volery.bridge.parameter_services import PARAMETER_TOPICS, ParameterServices
from volery.bridge.payload_services import (
    PAYLOAD_TOPICS,
    LogServices,
    mount_services,
    payload_subscriptions,
    raw_subscription,
)
from volery.bridge.plan_services import (
    GEOFENCE,
    PLAN_TOPICS,
    RALLY_POINTS,
    MissionServices,
    PlanServices,
)
from volery.bridge.position_estimates import estimate_subscriptions
from volery.bridge.px4_commands import PX4Commands
from volery.bridge.px4_telemetry import RATES as PX4_RATES
from volery.bridge.px4_telemetry import ControlMode, PX4Telemetry
from volery.bridge.status_publishers import (
    DIAGNOSTIC_TOPICS,
    STATUS_TOPICS,
    DiagnosticsPublisher,
    StatusPublisher,
)
from volery.bridge.trajectory_setpoints import TRAJECTORY_TOPICS, TrajectorySetpoints
from volery.links.mavlink_messages import constant, entry_name
from volery.ros.messages import new, service
from volery.ros.messages.package_versions import use_version, versions_of

MAVROS_STREAMS: Mapping[int, int] = {
    RAW_SENSORS: 1,
    EXTENDED_STATUS: 2,
    RC: 1,
    POSITION: 10,
    EXTRA1: 4,
    EXTRA2: 1,
}

MAVROS_TOPICS = (
    *STATUS_TOPICS,
    *POSE_TOPICS,
    *IMU_TOPICS,
    *TARGET_TOPICS,
    *TRAJECTORY_TOPICS,
    *PLAN_TOPICS,
    *PARAMETER_TOPICS,
    *PAYLOAD_TOPICS,
    *TRANSFORM_TOPICS,
    *DIAGNOSTIC_TOPICS,
)


def mavros_interface(context: InterfaceContext) -> NodeInterface:
    """Return the interface of a node under MAVROS's names."""
    status, commands = StatusPublisher(context), CommandServices(context)
    missions, parameters, logs = MissionServices(context), ParameterServices(context), LogServices(context)
    lists = (missions, PlanServices(context, GEOFENCE), PlanServices(context, RALLY_POINTS))
    poses, diagnostics = PosePublisher(context), DiagnosticsPublisher(context)
    trajectories = TrajectorySetpoints(context)
    others = (ImuPublisher(context), TargetPublisher(context), TransformPublisher(context))
    parts = (status, poses, *others, missions, parameters, logs, diagnostics)

    def disconnected(stamp: Ns) -> None:
        status.disconnected(stamp)
        diagnostics.disconnected(stamp)

    def due(now: Ns) -> Callable[[], None] | None:
        jobs = (one.due(now) for one in (trajectories, *lists))
        return next((job for job in jobs if job is not None), None)

    raw = () if context.parameter_services else (raw_subscription(context.node.namespace),)
    return NodeInterface(
        topics=MAVROS_TOPICS,
        translators=merge_translators(*(part.translators() for part in parts)),
        subscriptions=(
            *subscriptions(context.geoid),
            *trajectories.subscriptions(),
            *estimate_subscriptions(context.geoid),
            *payload_subscriptions(),
            *raw,
        ),
        due=due,
        services={
            **commands.services(),
            **parameters.services(),
            **logs.services(),
            **mount_services(commands),
            **trajectories.services(),
            **{name: one for part in lists for name, one in part.services().items()},
        },
        disconnected=disconnected,
    )


_SENSORS = (
    *("altitude", "battery", "global_position/", "imu/", "local_position/"),
    *("setpoint_raw/target_", "statustext/"),
)
"""Topics for which MAVROS 2.9 uses rclcpp's ``SensorDataQoS``."""

MAVROS = NamingScheme("mavros", mavros_interface, MAVROS_STREAMS, home=True, sensors=_SENSORS)


CHANNELS = 8
MILLI = 1000.0
FIX_3D = 3
NO_FIX, FIX, GPS = -1, 0, 1
"""sensor_msgs/NavSatStatus."""
SAFETY_ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
GUIDED_ENABLED = constant("MAV_MODE_FLAG_GUIDED_ENABLED")
EMPTY = "std_srvs/srv/Empty"
RC_TYPE = "roscopter/msg/RC"

ROSCOPTER_TOPICS = (
    PublishedByNode("gps", "sensor_msgs/msg/NavSatFix"),
    PublishedByNode("rc", RC_TYPE),
    PublishedByNode("state", "roscopter/msg/State"),
    PublishedByNode("vfr_hud", "roscopter/msg/VFR_HUD"),
    PublishedByNode("attitude", "roscopter/msg/Attitude"),
    PublishedByNode("raw_imu", "roscopter/msg/Mavlink_RAW_IMU"),
)
_ANGLES = ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed")
_MEASURED = tuple(f"{axis}{kind}" for kind in ("acc", "gyro", "mag") for axis in "xyz")


class RoscopterInterface:
    """Translators and handlers under roscopter's names."""

    def __init__(self, context: InterfaceContext) -> None:
        self._link, self._publish, self._warn = context.link, context.publish, context.warn
        self._commands = CommandServices(context)

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        return {
            "GPS_RAW_INT": self._gps,
            "RC_CHANNELS": self._rc,
            "RC_CHANNELS_RAW": self._rc_raw,
            "HEARTBEAT": self._state,
            "VFR_HUD": self._vfr_hud,
            "ATTITUDE": self._attitude,
            **{name: partial(self._raw_imu, name) for name in IMU_SOURCES},
        }

    def _gps(self, fields: Fields, at: Ns) -> None:
        """Publish the fix with the AMSL altitude of the receiver."""
        place = {
            "latitude": fields["lat"] / 1e7,
            "longitude": fields["lon"] / 1e7,
            "altitude": fields["alt"] / 1e3,
        }
        message = new("sensor_msgs/msg/NavSatFix", header=stamped(at), **place)
        message.status.status = FIX if fields["fix_type"] >= FIX_3D else NO_FIX
        message.status.service = GPS
        self._publish("gps", message)

    def _rc(self, fields: Fields, at: Ns) -> None:
        channels = [fields[f"chan{number}_raw"] for number in range(1, CHANNELS + 1)]
        self._publish("rc", new(RC_TYPE, channel=channels))

    def _rc_raw(self, fields: Fields, at: Ns) -> None:
        if self._link.last("RC_CHANNELS") is None:
            self._rc(fields, at)

    def _state(self, fields: Fields, at: Ns) -> None:
        base = fields["base_mode"]
        mode = mode_name(AutopilotType(fields["autopilot"], fields["type"]), fields["custom_mode"])
        armed, guided = bool(base & SAFETY_ARMED), bool(base & GUIDED_ENABLED)
        self._publish("state", new("roscopter/msg/State", armed=armed, guided=guided, mode=mode))

    def _vfr_hud(self, fields: Fields, at: Ns) -> None:
        names = ("airspeed", "groundspeed", "heading", "throttle", "alt", "climb")
        self._publish("vfr_hud", new("roscopter/msg/VFR_HUD", **{name: fields[name] for name in names}))

    def _attitude(self, fields: Fields, at: Ns) -> None:
        self._publish("attitude", new("roscopter/msg/Attitude", **{name: fields[name] for name in _ANGLES}))

    def _raw_imu(self, name: str, fields: Fields, at: Ns) -> None:
        """Publish the measurement in thousandths of g, of rad/s and of gauss."""
        if imu_source(self._link) != name:
            return
        measured = {one: fields[one] for one in _MEASURED}
        if name == "HIGHRES_IMU":
            measured = _in_thousandths(measured)
        time = fields["time_boot_ms"] * 1000 if name == "SCALED_IMU" else fields["time_usec"]
        message = new("roscopter/msg/Mavlink_RAW_IMU", header=stamped(at), time_usec=time, **measured)
        self._publish("raw_imu", message)

    def services(self) -> Mapping[str, Service]:
        """Return types and handlers by service name."""
        return {"arm": (EMPTY, partial(self._arm, 1.0)), "disarm": (EMPTY, partial(self._arm, 0.0))}

    def _arm(self, arm: float, request: Any) -> Any:
        accepted, result = self._commands.send_command(ARM_DISARM, arm)
        if not accepted:
            what = "arm" if arm else "disarm"
            self._warn(f"{what}: the autopilot answers {entry_name('MAV_RESULT', result)}")
        return service(EMPTY).response()


def _in_thousandths(measured: Mapping[str, float]) -> dict[str, int]:
    """Convert the m/s^2, rad/s and gauss of HIGHRES_IMU to the units of RAW_IMU."""
    return {name: round(value * _PER_UNIT[name[1:]]) for name, value in measured.items()}


_PER_UNIT = {"acc": MILLI / 9.80665, "gyro": MILLI, "mag": MILLI}


def send_rc(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``send_rc``: microseconds; 0 returns a channel to the operator's remote control."""
    channels = {f"chan{number}_raw": int(value) for number, value in enumerate(message.channel, start=1)}
    return "RC_CHANNELS_OVERRIDE", channels


def _ignore_disconnection(stamp: Ns) -> None:
    """Publish nothing, because ``state`` cannot express that the autopilot has stopped sending."""


def roscopter_interface(context: InterfaceContext) -> NodeInterface:
    """Return the interface of a node under roscopter's names; it contains ``send_rc`` only with *control*."""
    interface = RoscopterInterface(context)
    return NodeInterface(
        topics=ROSCOPTER_TOPICS,
        translators=merge_translators(interface.translators()),
        subscriptions=(SubscribedTopic("send_rc", RC_TYPE, send_rc),) if context.control else (),
        services=interface.services(),
        disconnected=_ignore_disconnection,
    )


ROSCOPTER = NamingScheme("roscopter", roscopter_interface, {ALL: 10}, home=False)


def px4_interface(version: str, context: InterfaceContext) -> NodeInterface:
    """Return the interface of a PX4 of *version* under the names of its uXRCE-DDS client."""
    offboard = ControlMode()
    telemetry = PX4Telemetry(context, offboard, version)
    commands = PX4Commands(context, offboard, telemetry, CommandServices(context))
    return NodeInterface(
        topics=telemetry.topics(),
        translators=merge_translators(telemetry.translators()),
        subscriptions=commands.subscriptions(),
        services=commands.handlers(),
        disconnected=_ignore_disconnection,
    )


def _px4(version: str) -> NamingScheme:
    return NamingScheme(
        "px4",
        partial(px4_interface, version),
        streams={},
        home=False,
        messages=PX4_RATES,
        as_received=True,
        prepare=partial(use_version, "px4_msgs", version),
    )


def ardupilot_interface(version: str, context: InterfaceContext) -> NodeInterface:
    """Return the interface of an ArduPilot of *version* under the names of its DDS client."""
    interface = ArduPilotInterface(context, version)
    return NodeInterface(
        topics=interface.topics(),
        translators=merge_translators(interface.translators()),
        subscriptions=interface.subscriptions(),
        services=interface.services(),
        disconnected=_ignore_disconnection,
    )


def _ardupilot(version: str) -> NamingScheme:
    return NamingScheme(
        "ap",
        partial(ardupilot_interface, version),
        streams={},
        home=False,
        messages=ARDUPILOT_RATES,
        as_received=True,
    )


_NEWEST, *_OLDER = versions_of("px4_msgs")

MAVLINK_SCHEMES: Mapping[str, NamingScheme] = {
    "mavros": MAVROS,
    "roscopter": ROSCOPTER,
    "px4": _px4(_NEWEST),
    **{f"px4-{version}": _px4(version) for version in _OLDER},
    "ardupilot": _ardupilot("4.8"),
    f"ardupilot-{OLDEST_ARDUPILOT}": _ardupilot(OLDEST_ARDUPILOT),
}
"""All schemes of vehicles that speak MAVLink, by the names that models and options have for them."""
