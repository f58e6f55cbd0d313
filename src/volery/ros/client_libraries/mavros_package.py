"""The Python package ``mavros`` of MAVROS 1: its services, set-point topics and files, on the graph.

Each component has a namespace of its own (``mavros.set_namespace``). Services are clients of that namespace's
server, made when they are first used. Files on the vehicle (``mavros.ftp``) are not offered.
"""

from __future__ import annotations

import csv
import struct
from collections.abc import Callable, Iterator
from functools import partial
from types import ModuleType
from typing import Any, NamedTuple

from volery.ros.client_libraries.library_base import library_module
from volery.ros.client_libraries.rospy.session import ROSException
from volery.ros.messages.client_classes import ROSPY, message_of, service_of

DEFAULT_NAMESPACE = "mavros"

_SERVICES: dict[str, dict[str, tuple[str, str]]] = {
    "command": {
        "long": ("cmd/command", "CommandLong"),
        "int": ("cmd/command_int", "CommandInt"),
        "arming": ("cmd/arming", "CommandBool"),
        "set_home": ("cmd/set_home", "CommandHome"),
        "takeoff": ("cmd/takeoff", "CommandTOL"),
        "land": ("cmd/land", "CommandTOL"),
        "trigger_control": ("cmd/trigger_control", "CommandTriggerControl"),
    },
    "mission": {
        "pull": ("mission/pull", "WaypointPull"),
        "push": ("mission/push", "WaypointPush"),
        "clear": ("mission/clear", "WaypointClear"),
        "set_current": ("mission/set_current", "WaypointSetCurrent"),
    },
}
"""Services by module and name: topic and type in ``mavros_msgs``."""
_SETPOINTS = {
    "accel_accel": ("setpoint_accel/accel", "geometry_msgs/msg/Vector3Stamped"),
    "attitude_cmd_vel": ("setpoint_attitude/cmd_vel", "geometry_msgs/msg/TwistStamped"),
    "attitude_throttle": ("setpoint_attitude/att_throttle", "std_msgs/msg/Float64"),
    "attitude_pose": ("setpoint_attitude/attitude", "geometry_msgs/msg/PoseStamped"),
    "attitude_posecov": ("setpoint_attitude/attitude", "geometry_msgs/msg/PoseWithCovarianceStamped"),
    "position_local": ("setpoint_position/local", "geometry_msgs/msg/PoseStamped"),
    "velocity_cmd_vel": ("setpoint_velocity/cmd_vel", "geometry_msgs/msg/TwistStamped"),
}
"""Set-point topics by the end of the name of the function that makes their publisher."""


class _Namespaces:
    """The namespaces of the components of one run."""

    def __init__(self, rospy: Any) -> None:
        self.rospy = rospy
        self._names: dict[str, str] = {}
        self._proxies: dict[tuple[str, str], Any] = {}
        self._followers: dict[str, list[Callable[[], Any]]] = {}

    @property
    def _component(self) -> str:
        return str(self.rospy.Publisher.sessions.component)

    def get_namespace(self) -> str:
        """Return the namespace; it is set to the default if it was not set."""
        if self._component not in self._names:
            self.set_namespace()
        return self._names[self._component]

    def set_namespace(self, ns: str = DEFAULT_NAMESPACE) -> None:
        """Set the namespace of the server."""
        self._names[self._component] = ns
        for follower in self._followers.get(self._component, []):
            follower()

    def register_on_namespace_update(self, cb: Callable[[], Any]) -> None:
        """Call *cb* whenever the namespace is set."""
        self._followers.setdefault(self._component, []).append(cb)

    def get_topic(self, *args: str) -> str:
        """Return the name of a topic or service below the namespace."""
        return "/".join((self.get_namespace(), *args))

    def service(self, name: str, kind: str) -> Any:
        """Return the client of a service."""
        full = self.get_topic(name)
        key = self._component, full
        if key not in self._proxies:
            self._proxies[key] = self.rospy.ServiceProxy(full, service_of(f"mavros_msgs/srv/{kind}", ROSPY))
        return self._proxies[key]

    def proxies(self, module: str) -> dict[str, Any]:
        """Return the functions that call the services of a module."""

        def call(name: str, kind: str, *args: Any, **fields: Any) -> Any:
            return self.service(name, kind)(*args, **fields)

        return {name: partial(call, *of) for name, of in _SERVICES[module].items()}

    # -- mavros.setpoint, mavros.mission, mavros.utils

    def publisher(self, topic: str, kind: str, **options: Any) -> Any:
        """Return a publisher of set-points."""
        return self.rospy.Publisher(self.get_topic(topic), message_of(kind, ROSPY), **options)

    def subscribe_waypoints(self, cb: Callable[[Any], Any], **options: Any) -> Any:
        """Call *cb* with the mission whenever it changes."""
        kind = message_of("mavros_msgs/msg/WaypointList", ROSPY)
        return self.rospy.Subscriber(self.get_topic("mission", "waypoints"), kind, cb, **options)

    def wait_fcu_connection(self, timeout: float | None = None) -> bool:
        """Block until the server is connected to its autopilot; return False after a time-out in seconds."""
        kind, topic = message_of("mavros_msgs/msg/State", ROSPY), self.get_topic("state")
        ends = None if timeout is None else self.rospy.get_time() + timeout
        while True:
            left = None if ends is None else ends - self.rospy.get_time()
            if left is not None and left <= 0.0:
                return False
            try:
                if self.rospy.wait_for_message(topic, kind, left).connected:
                    return True
            except ROSException:
                if self.rospy.is_shutdown():
                    raise
                return False

    def fault(self, *args: Any, **options: Any) -> None:
        """Log an error and end the component with status 1."""
        self.rospy.logerr(" ".join(map(str, args)))
        raise SystemExit(1)

    def print_if(self, cond: Any, *args: Any, **options: Any) -> None:
        """Log if *cond* holds."""
        if cond:
            self.rospy.loginfo(" ".join(map(str, args)))

    # -- mavros.param

    def param_get(self, param_id: str) -> float:
        """Return a parameter of the autopilot; raise ``IOError`` if it has none of that name."""
        answer = self.service("param/get", "ParamGet")(param_id=param_id)
        if not answer.success:
            raise OSError(f"Request failed: there is no parameter {param_id}")
        return _value_of(answer.value)

    def param_set(self, param_id: str, value: float) -> float:
        """Set a parameter of the autopilot; return its new value, raise ``IOError`` if it is refused."""
        whole = isinstance(value, int)
        given = message_of("mavros_msgs/msg/ParamValue", ROSPY)(
            integer=value if whole else 0, real=0.0 if whole else float(value)
        )
        answer = self.service("param/set", "ParamSet")(param_id=param_id, value=given)
        if not answer.success:
            raise OSError(f"Request failed: {param_id} = {value} was refused")
        return _value_of(answer.value)

    def param_get_all(self, force_pull: bool = False) -> tuple[int, list[Parameter]]:
        """Return the number of parameters received and all parameters."""
        answer = self.service("param/pull", "ParamPull")(force_pull=force_pull)
        if not answer.success:
            raise OSError("Request failed: the parameters were not received")
        param = self.rospy.get_param(self.get_topic("param"), {})
        return answer.param_received, [Parameter(name, param[name]) for name in sorted(param)]

    def param_set_list(self, param_list: list[Parameter]) -> int:
        """Set parameters of the autopilot; return how many."""
        for one in param_list:
            self.param_set(one.param_id, one.param_value)
        return len(param_list)


class Parameter(NamedTuple):
    """A parameter of the autopilot."""

    param_id: str
    param_value: float = 0


def _value_of(value: Any) -> float:
    return int(value.integer) if value.integer else float(value.real)


# -- mavros.mavlink


def convert_to_payload64(payload_bytes: Any) -> tuple[int, ...]:
    """Return bytes as the words of ``mavros_msgs/Mavlink.payload64``, filled with zeros."""
    data = bytes(payload_bytes)
    count = -(-len(data) // 8)
    return struct.unpack(f"<{count}Q", data.ljust(8 * count, b"\0"))


def convert_to_bytes(msg: Any) -> bytearray:
    """Return the bytes of a ``mavros_msgs/Mavlink``; raise ``ValueError`` if its payload is too short."""
    payload = struct.pack(f"<{len(msg.payload64)}Q", *msg.payload64)
    if len(payload) < msg.len:
        raise ValueError("Specified message length is bigger than payload64")
    ids = msg.seq, msg.sysid, msg.compid
    if msg.magic == _MAVLINK_1:
        head = struct.pack("<6B", msg.magic, msg.len, *ids, msg.msgid)
    else:
        number = msg.msgid.to_bytes(3, "little")
        head = struct.pack("<7B", msg.magic, msg.len, msg.incompat_flags, msg.compat_flags, *ids) + number
    return bytearray(head + payload[: msg.len] + struct.pack("<H", msg.checksum) + bytes(msg.signature))


_MAVLINK_1 = 254


def convert_to_rosmsg(rospy: Any, mavmsg: Any, stamp: Any = None) -> Any:
    """Return a packed message of pymavlink as ``mavros_msgs/Mavlink``."""
    data, payload = bytes(mavmsg.get_msgbuf()), bytes(mavmsg.get_payload())
    flags = (0, 0) if data[0] == _MAVLINK_1 else (data[2], data[3])
    header = message_of("std_msgs/msg/Header", ROSPY)(stamp=stamp or rospy.get_rostime())
    return message_of("mavros_msgs/msg/Mavlink", ROSPY)(
        header=header,
        framing_status=1,
        magic=data[0],
        len=len(payload),
        incompat_flags=flags[0],
        compat_flags=flags[1],
        seq=mavmsg.get_seq(),
        sysid=mavmsg.get_srcSystem(),
        compid=mavmsg.get_srcComponent(),
        msgid=mavmsg.get_msgId(),
        checksum=mavmsg.get_crc(),
        payload64=convert_to_payload64(payload),
    )


_HEAD = "QGC WPL"


class QGroundControlWP:
    """Missions as text of QGroundControl's older format, ``QGC WPL 120``."""

    file_header = f"{_HEAD} 120"
    known_versions = (110, 120)

    def read(self, file_: Any) -> Iterator[Any]:
        """Yield the waypoints of an open file."""
        rows = csv.reader(file_, delimiter="\t")
        head = next(rows, [""])[0]
        if not head.startswith(_HEAD) or int(head.rpartition(" ")[2]) not in self.known_versions:
            raise ValueError(f"the first line is {head!r}, not {self.file_header!r}")
        for row in rows:
            if row and not row[0].startswith("#"):
                numbers = [float(one) for one in row[4:11]]
                yield message_of("mavros_msgs/msg/Waypoint", ROSPY)(
                    is_current=bool(int(row[1])),
                    frame=int(row[2]),
                    command=int(row[3]),
                    **dict(zip(_NUMBERS, numbers, strict=True)),
                    autocontinue=bool(int(row[11])),
                )

    def write(self, file_: Any, waypoints: Any) -> None:
        """Write waypoints to an open file."""
        rows = csv.writer(file_, delimiter="\t", lineterminator="\r\n")
        rows.writerow((self.file_header,))
        for number, one in enumerate(waypoints):
            values = (getattr(one, name) for name in _NUMBERS)
            rows.writerow(
                (number, int(one.is_current), one.frame, one.command, *values, int(one.autocontinue))
            )


_NUMBERS = ("param1", "param2", "param3", "param4", "x_lat", "y_long", "z_alt")


def modules(rospy: ModuleType) -> dict[str, ModuleType]:
    """Return the modules of ``mavros`` of one run by name.

    Args:
        rospy: Module whose entities are used.
    """
    of = _Namespaces(rospy)
    setpoints: dict[str, Any] = {
        f"get_pub_{name}": partial(of.publisher, *about) for name, about in _SETPOINTS.items()
    }
    for name in ("Header", "Float64"):
        setpoints[name] = message_of(f"std_msgs/msg/{name}", ROSPY)
    for name in ("TwistStamped", "PoseStamped", "PoseWithCovarianceStamped", "Vector3", "Vector3Stamped"):
        setpoints[name] = message_of(f"geometry_msgs/msg/{name}", ROSPY)
    for name in ("Point", "Quaternion"):
        setpoints[name] = message_of(f"geometry_msgs/msg/{name}", ROSPY)
    missions = {
        "subscribe_waypoints": of.subscribe_waypoints,
        "QGroundControlWP": QGroundControlWP,
        **{name: message_of(f"mavros_msgs/msg/{name}", ROSPY) for name in ("Waypoint", "WaypointList")},
    }
    params = {
        "Parameter": Parameter,
        **{one.__name__: one for one in (of.param_get, of.param_set, of.param_get_all, of.param_set_list)},
    }
    utils = {one.__name__: one for one in (of.wait_fcu_connection, of.fault, of.print_if)}
    raw = {
        "convert_to_bytes": convert_to_bytes,
        "convert_to_payload64": convert_to_payload64,
        "convert_to_rosmsg": partial(convert_to_rosmsg, rospy),
        "Mavlink": message_of("mavros_msgs/msg/Mavlink", ROSPY),
    }
    parts = {
        "command": library_module("mavros.command", of.proxies("command")),
        "mavlink": library_module("mavros.mavlink", raw),
        "mission": library_module("mavros.mission", {**of.proxies("mission"), **missions}),
        "param": library_module("mavros.param", params),
        "setpoint": library_module("mavros.setpoint", setpoints),
        "utils": library_module("mavros.utils", utils),
    }
    base = (of.get_namespace, of.set_namespace, of.register_on_namespace_update, of.get_topic)
    whole = {"DEFAULT_NAMESPACE": DEFAULT_NAMESPACE, **{one.__name__: one for one in base}}
    return {
        "mavros": library_module("mavros", {**whole, **parts}),
        **{f"mavros.{part}": module for part, module in parts.items()},
    }
