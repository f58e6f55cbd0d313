"""MAVROS's services for parameters, plans, logs, commands and corrections, as a client.

Clients and subscriptions are made at the first use: a node that flies only pays for none of them. Parameters
are reached as in MAVROS 1 (``param/get``, ``param/set``) where these are served, else as in MAVROS 2, where
they are parameters of the node ``param``. MAVROS repeats lost requests itself; what a service does not
answer for is reported as ``NotArrived``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isclose
from typing import Any, TypeVar

from volery.base.errors import CapabilityError, NotArrived, Refused
from volery.base.frames import (
    Vector,
    attitude_ned_to_enu,
    euler_to_quaternion,
    pose_covariance_ned_to_enu,
)
from volery.base.geoid import Geoid
from volery.base.position import Position
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Kernel
from volery.links.mavlink_messages import constant, entry_name
from volery.ros.graph import Node, QoS, ServiceError
from volery.ros.messages import message_class, new, request
from volery.vehicles.external_pose import ExternalPose
from volery.vehicles.services import (
    NO_RULES,
    LogEntry,
    Parameter,
    ParameterRules,
    PlanItem,
    mavlink_parameter_name,
    missing_parameter,
)
from volery.vehicles.telemetry import Telemetry

ANSWERED_WITHIN: Ns = 15 * S
"""The vehicle node repeats a request to the autopilot for some seconds before it gives up."""
LISTED_WITHIN: Ns = 120 * S
"""All parameters over a slow radio."""
SETTLED_AFTER: Ns = 500 * MS
"""A list counts as the present one if no other has arrived for this time."""
PIECE_WITHIN: Ns = 20 * S
AGAIN: Ns = 2 * S

INTEGER, DOUBLE = 2, 3
"""rcl_interfaces/ParameterType."""
INT32, REAL32 = constant("MAV_PARAM_TYPE_INT32"), constant("MAV_PARAM_TYPE_REAL32")
_ACCEPTED = constant("MAV_RESULT_ACCEPTED")
_UNSUPPORTED = constant("MAV_RESULT_UNSUPPORTED")
_LISTS = {0: "mission", 1: "geofence", 2: "rally points"}
_NAMES = {0: "mission", 1: "geofence", 2: "rallypoint"}
_TOPICS = {
    0: ("mission/waypoints",),
    1: ("geofence/waypoints", "geofence/fences"),
    2: ("rallypoint/waypoints", "rallypoint/rallypoints"),
}
"""MAVROS 1 and 2 name two of the lists differently."""

SAME_DEGREES = 1e-6
LOG_QUEUE = QoS(1000)
"""A piece of a log is a hundred messages, which arrive within one round of the loop."""

T = TypeVar("T")


class MavrosServices:
    """``Services`` of one autopilot behind MAVROS.

    Args:
        kernel: clock and tasks.
        node: the node that commands the vehicle.
        telemetry: telemetry of the vehicle.
        namespace: namespace of the vehicle node.
        spin: one round of the node's loop.
        geoid: geoid of the altitudes, which MAVROS states above the ellipsoid.
        home_first: whether item 0 of a mission is home, as in ArduPilot.
        parameter_rules: its parameters with other names in other versions, and those that it writes itself.
    """

    files = None
    sender = None

    def __init__(
        self,
        kernel: Kernel,
        node: Node,
        telemetry: Telemetry,
        namespace: str,
        spin: Action,
        *,
        geoid: Geoid,
        home_first: bool,
        parameter_rules: ParameterRules = NO_RULES,
    ) -> None:
        self.home_first = home_first
        self.parameter_rules = parameter_rules
        self._kernel = kernel
        self._node = node
        self._telemetry = telemetry
        self._name = telemetry.name
        self._namespace = namespace
        self._spin = spin
        self._geoid = geoid
        self._inbox = node.group()
        self._clients: dict[tuple[str, str], Any] = {}
        self._lists: dict[int, tuple[Ns, list[Any]]] = {}  # time of arrival and items of each list
        self._entries: dict[int, Any] = {}
        self._no_logs = False
        self._pieces: dict[int, bytes] = {}
        self._log = -1
        self._listens_to_logs = False
        self._corrections: Any = None
        self._poses: Any = None
        self._origins: Any = None
        self._origin: Any = None  # the last one that was stated
        self._pulled = False

    # -- the graph

    def _client(self, name: str, kind: str) -> Any:
        if (name, kind) not in self._clients:
            self._clients[name, kind] = self._node.client(f"{self._namespace}/{name}", _full(kind))
        return self._clients[name, kind]

    def _call(self, asked: str, name: str, kind: str, within: Ns = ANSWERED_WITHIN, **fields: Any) -> Any:
        """Return the response of a service; *kind* is one of mavros_msgs, unless it names its package.

        Raises:
            CapabilityError: the vehicle node has no such service.
            NotArrived: it does not answer.
        """
        client = self._client(name, kind)
        if not client.ready() and not client.wait(S):
            raise CapabilityError(
                f"{self._name}: {asked}: nothing serves {self._namespace}/{name}; load that plugin of MAVROS"
            )
        try:
            return client.call(request(_full(kind), **fields), within=within)
        except ServiceError as error:
            raise NotArrived(self._name, asked, str(error)) from None

    def _until(self, asked: str, found: Callable[[], T | None], within: Ns, again: Action | None = None) -> T:
        """Run the node's loop until *found* returns something; *again* is called each two seconds."""
        began = last = self._kernel.now()
        while True:
            value = found()
            if value is not None:
                return value
            now = self._kernel.now()
            if now - began > within:
                raise NotArrived(self._name, asked, f"nothing arrived within {within / S:g} s")
            if again is not None and now - last > AGAIN:
                last = now
                again()
            self._spin()
            self._inbox.spin_available()

    # -- commands

    def command(self, asked: str, command: str, *parameters: float, within: Ns = 0) -> None:
        """See ``Services``."""
        named = {f"param{number}": float(value) for number, value in enumerate(parameters, 1)}
        began = self._kernel.now()
        number = constant(command)
        answer = self._call(
            asked, "cmd/command", "CommandLong", within or ANSWERED_WITHIN, command=number, **named
        )
        if answer.result == _UNSUPPORTED:
            raise CapabilityError(f"{self._name}: {asked}: the autopilot does not support {command}")
        if not answer.success or answer.result != _ACCEPTED:
            self._spin()
            said = self._telemetry.texts_since(began)
            why = f"; it said {said[-1]!r}" if said else ""
            result = entry_name("MAV_RESULT", answer.result)
            raise Refused(self._name, asked, f"{result} to {command}{why}")

    # -- parameters

    def parameter_name(self, name: str) -> str:
        """See ``Services``."""
        return mavlink_parameter_name(self._name, name)

    def _as_parameter(self, name: str, value: float) -> Parameter:
        return Parameter(name, float(value), INT32 if isinstance(value, int) else REAL32)

    def _is_mavros_1(self) -> bool:
        """Return whether ``param/get`` is served; MAVROS 2 has ROS 2's parameter services instead."""
        client = self._client("param/get", "ParamGet")
        return client.ready() or bool(client.wait(S))

    def _pull(self, asked: str) -> None:
        answer = self._call(asked, "param/pull", "ParamPull", LISTED_WITHIN, force_pull=True)
        if not answer.success:
            raise NotArrived(self._name, asked, f"{answer.param_received} parameters arrived, not all")
        self._pulled = True

    def _pulled_values(self, asked: str) -> dict[str, float | int]:
        """Return what MAVROS has pulled, as ROS parameters."""
        if self._is_mavros_1():
            name = f"{self._namespace}/param"
            parameter = self._node.get_parameter(name, None)
            if not isinstance(parameter, dict) or not parameter:
                raise NotArrived(self._name, asked, f"there are no ROS parameters {name}")
            return parameter
        kind = "rcl_interfaces/srv/ListParameters"
        names = list(self._call(asked, "param/list_parameters", kind).result.names)
        values = self._ros2_values(asked, names)
        return {name: value for name, value in zip(names, values, strict=True) if value is not None}

    def _ros2_values(self, asked: str, names: list[str]) -> list[float | int | None]:
        """Return parameters of MAVROS 2; ``None`` for those that there are not."""
        kind = "rcl_interfaces/srv/GetParameters"
        values = self._call(asked, "param/get_parameters", kind, names=names).values
        return [_plain(value) for value in values]

    def read_parameter(self, name: str) -> Parameter:
        """See ``Services``."""
        asked = f"read the parameter {name}"
        value = self._read(asked, name)
        if value is None and not self._pulled:
            self._pull(asked)  # MAVROS answers from what it has pulled
            value = self._read(asked, name)
        if value is None:
            raise missing_parameter(
                self._name, name, self._pulled_values(asked), self.parameter_rules.renamed.get(name)
            )
        return self._as_parameter(name, value)

    def _read(self, asked: str, name: str) -> float | int | None:
        if self._is_mavros_1():
            answer = self._call(asked, "param/get", "ParamGet", param_id=name)
            return answer.value.integer or answer.value.real if answer.success else None
        return self._ros2_values(asked, [name])[0]

    def write_parameter(self, name: str, value: float) -> Parameter:
        """See ``Services``."""
        asked = f"set the parameter {name} to {value:g}"
        whole = self._is_whole(asked, name)
        if whole and value != round(value):
            raise Refused(self._name, asked, "it takes whole numbers only")
        if whole and not -(2**31) <= value < 2**31:
            raise Refused(self._name, asked, "it takes whole numbers of 32 bits")
        if self._is_mavros_1():
            given = {"integer": round(value), "real": 0.0} if whole else {"integer": 0, "real": value}
            answer = self._call(asked, "param/set", "ParamSet", param_id=name, value=given)
            kept = answer.value.integer or answer.value.real
        else:
            typed = (
                {"type": INTEGER, "integer_value": round(value)}
                if whole
                else {"type": DOUBLE, "double_value": value}
            )
            message = new("rcl_interfaces/msg/ParameterValue", **typed)
            answer = self._call(asked, "param/set", "ParamSetV2", param_id=name, value=message)
            kept = _plain(answer.value)
        if kept is None or (not answer.success and isclose(kept, value)):
            raise NotArrived(self._name, asked, "the autopilot does not answer")
        if not isclose(kept, value, rel_tol=1e-6, abs_tol=1e-6):
            raise Refused(self._name, asked, f"the autopilot keeps {kept:g}")
        return self._as_parameter(name, kept)

    def _is_whole(self, asked: str, name: str) -> bool:
        """Return whether a parameter takes whole numbers; a value of 0 has no type in ``param/get``."""
        parameter = self.read_parameter(name)
        if parameter.value:
            return parameter.type == INT32
        if not self._pulled:
            self._pull(asked)
        return isinstance(self._pulled_values(asked).get(name), int)

    def read_parameters(self) -> dict[str, Parameter]:
        """See ``Services``."""
        asked = "read all parameters"
        self._pull(asked)
        found = self._pulled_values(asked)
        return {name: self._as_parameter(name, value) for name, value in found.items()}

    # -- plans

    def download_items(self, kind: int) -> list[PlanItem]:
        """See ``Services``."""
        asked = f"read its {_LISTS[kind]}"
        if kind not in self._lists:
            self._lists[kind] = (-1, [])
            for topic in _TOPICS[kind]:
                self._node.subscribe(
                    f"{self._namespace}/{topic}",
                    "mavros_msgs/msg/WaypointList",
                    lambda message: self._keep_list(kind, message),
                    group=self._inbox,
                )
        answer = self._call(asked, f"{_NAMES[kind]}/pull", "WaypointPull", LISTED_WITHIN)
        if not answer.success:
            raise Refused(self._name, asked, f"{answer.wp_received} items arrived, not all")

        def settled() -> list[Any] | None:
            at, items = self._lists[kind]
            whole = at >= 0 and len(items) == answer.wp_received
            return items if whole and self._kernel.now() - at >= SETTLED_AFTER else None

        return [_item(one) for one in self._until(asked, settled, ANSWERED_WITHIN)]

    def _keep_list(self, kind: int, message: Any) -> None:
        self._lists[kind] = (self._kernel.now(), list(message.waypoints))

    def upload_items(self, kind: int, items: Sequence[PlanItem]) -> None:
        """See ``Services``."""
        asked = f"store {len(items)} items of its {_LISTS[kind]}"
        if not items:
            if not self._call(asked, f"{_NAMES[kind]}/clear", "WaypointClear").success:
                raise Refused(self._name, asked, "the vehicle node reports no success; it gives no reason")
            return
        waypoints = [to_waypoint(item, number == 0) for number, item in enumerate(items)]
        lasting = 30 * S + len(items) * S
        push = f"{_NAMES[kind]}/push"
        answer = self._call(asked, push, "WaypointPush", lasting, start_index=0, waypoints=waypoints)
        if not answer.success:
            detail = f"{answer.wp_transfered} of {len(items)} items were taken; MAVROS gives no reason"
            raise Refused(self._name, asked, detail)

    # -- logs

    def _listen_to_logs(self) -> None:
        if not self._listens_to_logs:
            self._listens_to_logs = True
            raw = f"{self._namespace}/log_transfer/raw"
            for name, keep in (("LogEntry", self._keep_entry), ("LogData", self._keep_piece)):
                topic = f"{raw}/log_{name.removeprefix('Log').lower()}"
                self._node.subscribe(topic, f"mavros_msgs/msg/{name}", keep, LOG_QUEUE, self._inbox)

    def _keep_entry(self, message: Any) -> None:
        if message.num_logs:
            self._entries[message.id] = message
        else:
            self._no_logs = True

    def _keep_piece(self, message: Any) -> None:
        if message.id == self._log and len(message.data):
            self._pieces[message.offset] = bytes(message.data)

    def list_logs(self) -> list[LogEntry]:
        """See ``Services``."""
        asked = "list its logs"
        self._listen_to_logs()
        self._entries.clear()
        self._no_logs = False

        def ask() -> None:
            name = "log_transfer/raw/log_request_list"
            self._call(asked, name, "LogRequestList", start=0, end=0xFFFF)

        def whole() -> list[LogEntry] | None:
            if self._no_logs:
                return []
            entries = [self._entries[number] for number in sorted(self._entries)]
            if not entries or len(entries) < entries[0].num_logs:
                return None
            return [LogEntry(entry.id, entry.size, _seconds(entry.time_utc)) for entry in entries]

        ask()
        return self._until(asked, whole, ANSWERED_WITHIN, ask)

    def read_log(self, entry: LogEntry, offset: int, count: int) -> bytes:
        """See ``Services``."""
        asked = f"read log {entry.number} from byte {offset}"
        count = min(count, entry.size - offset)
        self._listen_to_logs()
        self._log, self._pieces = entry.number, {}

        def missing() -> int:
            place = offset
            while place < offset + count and place in self._pieces:
                place += len(self._pieces[place])
            return place

        def ask() -> None:
            place = missing()
            rest = offset + count - place
            name = "log_transfer/raw/log_request_data"
            self._call(asked, name, "LogRequestData", id=entry.number, offset=place, count=rest)

        def whole() -> bytes | None:
            if missing() < offset + count:
                return None
            return b"".join(self._pieces[piece] for piece in sorted(self._pieces) if piece >= offset)[:count]

        ask()
        return self._until(asked, whole, PIECE_WITHIN, ask)

    def end_log_transfer(self) -> None:
        """See ``Services``."""
        self._call("end the transfer of logs", "log_transfer/raw/log_request_end", "LogRequestEnd")

    # -- corrections

    def send_corrections(self, message: bytes) -> None:
        """See ``Services``."""
        if self._corrections is None:
            name = f"{self._namespace}/gps_rtk/send_rtcm"
            self._corrections = self._node.advertise(name, "mavros_msgs/msg/RTCM")
            self._until("RTK corrections", lambda: self._corrections.subscribers() or None, ANSWERED_WITHIN)
        self._corrections.publish(new("mavros_msgs/msg/RTCM", data=list(message)))

    def send_landing_target(self, offset: Vector) -> None:
        """See ``Services``."""
        raise CapabilityError(
            f"{self._name}: send a landing target: not over MAVROS; connect by MAVLink, or fly velocities "
            "towards it, as volery.autonomy.precision_landing gives them"
        )

    # -- flight without satellites

    def send_external_pose(self, pose: ExternalPose) -> None:
        """Publish on ``vision_pose/pose_cov``, which is advertised at the first call."""
        if self._poses is None:
            name = f"{self._namespace}/vision_pose/pose_cov"
            self._poses = self._node.advertise(name, "geometry_msgs/msg/PoseWithCovarianceStamped")
        message = new("geometry_msgs/msg/PoseWithCovarianceStamped")
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(pose.time, S)
        message.header.frame_id = "map"
        message.pose.pose.position = message_class("geometry_msgs/msg/Point")(pose.east, pose.north, pose.up)
        w, x, y, z = attitude_ned_to_enu(euler_to_quaternion(*pose.attitude_ned()))
        message.pose.pose.orientation = message_class("geometry_msgs/msg/Quaternion")(x, y, z, w)
        message.pose.covariance = pose_covariance_ned_to_enu(pose.covariance_ned())
        self._poses.publish(message)

    def set_origin(self, place: Position) -> None:
        """Publish on ``global_position/set_gp_origin`` until ``gp_origin`` states it."""
        kind = "geographic_msgs/msg/GeoPointStamped"
        if self._origins is None:
            at = f"{self._namespace}/global_position"
            self._origins = self._node.advertise(f"{at}/set_gp_origin", kind)
            self._node.subscribe(f"{at}/gp_origin", kind, self._keep_origin, group=self._inbox)
        self._origin = None
        latitude, longitude = place.latitude, place.longitude
        message = new(kind)
        message.position.latitude, message.position.longitude = latitude, longitude
        message.position.altitude = self._geoid.to_ellipsoidal(latitude, longitude, place.altitude.metres)

        def stated() -> bool | None:
            if self._origin is None:
                return None
            at = self._origin.position
            near = max(abs(at.latitude - latitude), abs(at.longitude - longitude)) <= SAME_DEGREES
            return True if near else None

        asked = f"take {place} as the origin of its estimator"
        self._until(asked, lambda: self._origins.subscribers() or None, ANSWERED_WITHIN)
        self._origins.publish(message)
        self._until(asked, stated, ANSWERED_WITHIN, lambda: self._origins.publish(message))

    def _keep_origin(self, message: Any) -> None:
        self._origin = message


def _full(kind: str) -> str:
    return kind if "/" in kind else f"mavros_msgs/srv/{kind}"


def _plain(value: Any) -> float | int | None:
    """Return a ParameterValue as a number."""
    if value.type == INTEGER:
        return int(value.integer_value)
    return float(value.double_value) if value.type == DOUBLE else None


def _seconds(stamp: Any) -> int:
    """Return the seconds of a time; MAVROS 2 puts them into the nanoseconds."""
    return int(stamp.sec or stamp.nanosec)


def to_waypoint(item: PlanItem, current: bool) -> Any:
    """Return an item as MAVROS has it."""
    first, second, third, fourth = item.parameters
    return new(
        "mavros_msgs/msg/Waypoint",
        frame=item.frame,
        command=item.command,
        is_current=current,
        autocontinue=True,
        param1=first,
        param2=second,
        param3=third,
        param4=fourth,
        x_lat=item.latitude,
        y_long=item.longitude,
        z_alt=item.z,
    )


def _item(waypoint: Any) -> PlanItem:
    parameters = (waypoint.param1, waypoint.param2, waypoint.param3, waypoint.param4)
    place = waypoint.x_lat, waypoint.y_long
    return PlanItem(waypoint.command, waypoint.frame, parameters, *place, waypoint.z_alt)
