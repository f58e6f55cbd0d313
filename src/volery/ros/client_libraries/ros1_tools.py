"""The small Python packages of ROS 1.

``genpy``, ``roslib``, ``rospkg``, ``rosunit``, ``rostest`` and ``sensor_msgs.point_cloud2``, and the
command-line tools that files import: ``rosnode``, ``rosparam``, ``rosservice`` and ``rostopic``.
"""

from __future__ import annotations

import struct
import unittest
from collections import namedtuple
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from math import isnan
from types import ModuleType
from typing import Any, ClassVar, NamedTuple

from volery.base.errors import UsageError, did_you_mean
from volery.ros.client_libraries.library_base import file_of_user, library_module, scalar
from volery.ros.messages import RosMessage, Workspace
from volery.ros.messages.client_classes import (
    ROSPY,
    DeserializationError,
    MessageException,
    SerializationError,
    message_of,
    service_of,
)
from volery.ros.messages.encodings import our_name, ros1_name

# -- packages


class ResourceNotFound(Exception):  # noqa: N818 - rospkg's name
    """A package was not found."""

    def __init__(self, name: str, ros_paths: Sequence[str] = ()) -> None:
        super().__init__(name)
        self.ros_paths = list(ros_paths)


class RosPack:
    """``rospkg.RosPack`` over the workspace that the file sees."""

    workspace: ClassVar[Workspace]

    def __init__(self, ros_paths: Any = None) -> None:
        self.ros_paths = ros_paths

    @classmethod
    def get_instance(cls, ros_paths: Any = None) -> RosPack:
        """Return a new one."""
        return cls(ros_paths)

    def list(self) -> list[str]:
        """Return the names of all packages."""
        return sorted(self.workspace.names(file_of_user()))

    def get_path(self, name: str) -> str:
        """Return the folder of a package; raise ``ResourceNotFound`` if there is none."""
        file = file_of_user()
        found = self.workspace.find(name, file)
        if found is None:
            near = did_you_mean(name, self.workspace.names(file))
            raise ResourceNotFound(
                f"{name}{near}: no such package in the file's workspace or in ROS_PACKAGE_PATH"
            )
        return str(found.folder)


def get_pkg_dir(rospack: type[RosPack], package: str, required: bool = True, **options: Any) -> str | None:
    """Return the folder of a package; without *required*, None if there is none."""
    try:
        return rospack().get_path(package)
    except ResourceNotFound:
        if required:
            raise
        return None


def load_manifest(package_name: str, bootstrap_version: str = "0.7") -> None:
    """Do nothing: files find the packages of their workspace without it."""


# -- tests


class _Report(unittest.TestResult):
    """Writes one line of each test."""

    def __init__(self, write: Any) -> None:
        super().__init__()
        self._write = write

    def addSuccess(self, test: Any) -> None:  # noqa: N802 - unittest's name
        """Write that a test has passed."""
        self._write(f"[{test.id().rpartition('.')[2]}] ... ok")

    def addFailure(self, test: Any, err: Any) -> None:  # noqa: N802 - unittest's name
        """Write that a test has failed."""
        super().addFailure(test, err)
        self._write(f"[{test.id().rpartition('.')[2]}] ... FAILURE: {err[1]}")

    def addError(self, test: Any, err: Any) -> None:  # noqa: N802 - unittest's name
        """Write that a test has raised an error."""
        super().addError(test, err)
        self._write(f"[{test.id().rpartition('.')[2]}] ... ERROR: {type(err[1]).__name__}: {err[1]}")


class _Tests:
    """``rosunit`` and ``rostest`` of one run."""

    def __init__(self, rospy: Any) -> None:
        self._rospy = rospy

    def run(self, package: str, test_name: str, test: Any, sysargs: Any = None, *more: Any, **_: Any) -> None:
        """Run a ``TestCase`` in this component; it ends with status 1 if a test fails.

        Args:
            package: Name of the package, for reports.
            test_name: Name of the test, for reports.
            test: Class derived from ``unittest.TestCase``, or a function that returns a suite.
            sysargs: Command line, not used.
            more: Not used.
        """
        loader = unittest.defaultTestLoader
        suite = loader.loadTestsFromTestCase(test) if isinstance(test, type) else test()
        result = _Report(self._rospy.loginfo)
        suite.run(result)
        failed, errors = len(result.failures), len(result.errors)
        verdict = "SUCCESS" if result.wasSuccessful() else "FAIL"
        text = (
            f"{test_name}: RESULT: {verdict}, TESTS: {result.testsRun}, ERRORS: {errors}, FAILURES: {failed}"
        )
        (self._rospy.loginfo if result.wasSuccessful() else self._rospy.logerr)(text)
        if not result.wasSuccessful():
            raise SystemExit(1)

    def is_publisher(self, topic: str, publisher_id: str) -> bool:
        """Return whether a node publishes a topic."""
        return self._has(0, topic, publisher_id)

    def is_subscriber(self, topic: str, subscriber_id: str) -> bool:
        """Return whether a node subscribes to a topic."""
        return self._has(1, topic, subscriber_id)

    def _has(self, kind: int, topic: str, node: str) -> bool:
        _, _, state = self._rospy.get_master().getSystemState()
        full, wanted = self._rospy.resolve_name(topic), self._rospy.resolve_name(node)
        return any(name == full and wanted in nodes for name, nodes in state[kind])


# -- classes by name, and the command-line tools as modules


def get_message_class(message_type: str, reload_on_error: bool = False) -> Any:
    """Return the class of a message type, such as ``std_msgs/String``; None if it is unknown."""
    try:
        return message_of(our_name(message_type), ROSPY)
    except UsageError:
        return None


def get_service_class(service_type: str, reload_on_error: bool = False) -> Any:
    """Return the class of a service type, such as ``std_srvs/Empty``; None if it is unknown."""
    try:
        return service_of(service_type.replace("/", "/srv/"), ROSPY)
    except UsageError:
        return None


class ROSServiceException(Exception):  # noqa: N818 - rosservice's name
    """A service or its type is unknown."""


class RosParamException(Exception):  # noqa: N818 - rosparam's name
    """A parameter is unknown."""


class _Commands:
    """What ``rosnode``, ``rosparam``, ``rosservice`` and ``rostopic`` ask of the graph of one run."""

    def __init__(self, rospy: Any) -> None:
        self._rospy = rospy
        self._sessions = rospy.Publisher.sessions

    def get_node_names(self, namespace: str | None = None) -> list[str]:
        """Return the names of all nodes, or of those in a namespace."""
        with self._sessions.kernel.interact():
            names: list[str] = self._sessions.graph.node_names()
        below = f"/{(namespace or '').strip('/')}/".replace("//", "/")
        return [name for name in names if name.startswith(below) or name == below.rstrip("/")]

    def rosnode_ping(
        self, node_name: str, max_count: int | None = None, verbose: bool = False, **_: Any
    ) -> bool:
        """Return whether a node is there."""
        return self._rospy.resolve_name(node_name) in self.get_node_names()

    def kill_nodes(self, node_names: Iterable[str]) -> tuple[list[str], list[str]]:
        """Shut nodes of rospy down; return the names of those, and of the others."""
        wanted = list(node_names)
        ended = [name for name in wanted if self._sessions.shut_down(self._rospy.resolve_name(name))]
        return ended, [name for name in wanted if name not in ended]

    def get_param(self, param: str) -> Any:
        """Return a parameter; raise ``MasterError`` if there is none."""
        return self._rospy.get_master().getParam(param)[2]

    def set_param(self, param: str, value: str, verbose: bool = False) -> None:
        """Set a parameter to a text as of a command line."""
        self._rospy.set_param(param, scalar(value))

    def delete_param(self, param: str, verbose: bool = False) -> None:
        """Remove a parameter; raise ``RosParamException`` if there is none."""
        try:
            self._rospy.delete_param(param)
        except KeyError as error:
            raise RosParamException(str(error)) from error

    def list_params(self, ns: str) -> list[str]:
        """Return the names of the parameters in a namespace."""
        full = self._rospy.resolve_name(ns).rstrip("/")
        return [name for name in self._rospy.get_param_names() if name.startswith(f"{full}/")]

    def upload_params(self, ns: str, values: Any, verbose: bool = False) -> None:
        """Set the parameters of a namespace."""
        for key, value in values.items():
            self._rospy.set_param(f"{ns.rstrip('/')}/{key}", value)

    def _services(self) -> Any:
        with self._sessions.kernel.interact():
            return self._sessions.graph.services()

    def get_service_list(self, node: str | None = None, namespace: str | None = None, **_: Any) -> list[str]:
        """Return the names of all services, of one node or in one namespace."""
        below = f"/{(namespace or '').strip('/')}/".replace("//", "/")
        services = [service for service in self._services() if node in (None, service.server)]
        return [one.name for one in services if one.name.startswith(below)]

    def get_service_type(self, service_name: str) -> str | None:
        """Return the type of a service; None if there is none."""
        full = self._rospy.resolve_name(service_name)
        return next((ros1_name(service.type) for service in self._services() if service.name == full), None)

    def get_service_class_by_name(self, service_name: str) -> Any:
        """Return the class of a service; raise ``ROSServiceException`` if there is none."""
        kind = self.get_service_type(service_name)
        if kind is None:
            raise ROSServiceException(f"Service [{service_name}] is not available.")
        return get_service_class(kind)

    def get_topic_type(self, topic: str, blocking: bool = False) -> tuple[Any, Any, Any]:
        """Return the type of a topic, its name and None; None three times if there is none."""
        full = self._rospy.resolve_name(topic)
        while not self._rospy.is_shutdown():
            for name, kind in self._rospy.get_master().getTopicTypes()[2]:
                if name == full:
                    return kind, name, None
            if not blocking:
                break
            self._rospy.sleep(0.1)
        return None, None, None

    def get_topic_class(self, topic: str, blocking: bool = False) -> tuple[Any, Any, Any]:
        """Return the class of a topic, its name and None; None three times if there is none."""
        kind, name, rest = self.get_topic_type(topic, blocking)
        return (None if kind is None else get_message_class(kind)), name, rest

    def get_topic_list(self, master: Any = None) -> tuple[list[Any], list[Any]]:
        """Return the published and the subscribed topics, each as name, type and nodes."""
        publishers, subscribers, _ = self._rospy.get_master().getSystemState()[2]
        kinds = dict(self._rospy.get_master().getTopicTypes()[2])
        return tuple([(name, kinds[name], nodes) for name, nodes in of] for of in (publishers, subscribers))  # type: ignore[return-value]  # two of them

    def find_by_type(self, topic_type: str) -> list[str]:
        """Return the topics of a type."""
        return [name for name, kind in self._rospy.get_master().getTopicTypes()[2] if kind == topic_type]

    def modules(self) -> dict[str, ModuleType]:
        """Return the four modules by name."""
        found: dict[str, tuple[Any, ...]] = {
            "rosnode": (self.get_node_names, self.kill_nodes, self.rosnode_ping),
            "rosparam": (
                *(self.get_param, self.set_param, self.delete_param, self.list_params, self.upload_params),
                RosParamException,
            ),
            "rosservice": (
                *(self.get_service_list, self.get_service_type, self.get_service_class_by_name),
                ROSServiceException,
            ),
            "rostopic": (self.get_topic_type, self.get_topic_class, self.get_topic_list, self.find_by_type),
        }
        return {
            name: library_module(name, {one.__name__: one for one in listed}, _REFUSED)
            for name, listed in found.items()
        }


_REFUSED = {
    "rosparam.load_file": "read the file by yaml.safe_load, then use rosparam.upload_params",
    "rosservice.call_service": "use rospy.ServiceProxy",
    "rostopic.ROSTopicHz": "the report states the rates of topics",
}
"""Names that are not there on purpose, and what to do instead."""


def _genpy() -> dict[str, ModuleType]:
    """Return the modules of ``genpy`` by name, and ``roslib.message``."""
    times = {name: message_of(f"builtin_interfaces/msg/{name}", ROSPY) for name in ("Time", "Duration")}
    errors = (MessageException, SerializationError, DeserializationError)
    names = {"Message": RosMessage, **{error.__name__: error for error in errors}, **times}
    classes = {one.__name__: one for one in (get_message_class, get_service_class)}
    parts = {
        "genpy.message": library_module("genpy.message", {**names, **classes}),
        "genpy.rostime": library_module("genpy.rostime", times),
    }
    inside = {name.partition(".")[2]: module for name, module in parts.items()}
    return {
        "genpy": library_module("genpy", {**names, **inside}),
        **parts,
        "roslib.message": library_module("roslib.message", {**names, **classes}),
    }


# -- sensor_msgs.point_cloud2

_FORMATS = {1: "b", 2: "B", 3: "h", 4: "H", 5: "i", 6: "I", 7: "f", 8: "d"}
"""Formats of ``struct`` by the datatype of a ``PointField``."""


class _Layout(NamedTuple):
    code: struct.Struct
    names: tuple[str, ...]


def _layout(cloud_fields: Any, big: bool, wanted: Sequence[str] | None) -> _Layout:
    code, names, at = ">" if big else "<", [], 0
    for field in sorted(cloud_fields, key=lambda one: one.offset):
        if wanted is not None and field.name not in wanted:
            continue
        if field.datatype not in _FORMATS:
            raise ValueError(f"field {field.name}: unknown datatype {field.datatype} of a PointField")
        code += "x" * (field.offset - at) + f"{field.count}{_FORMATS[field.datatype]}"
        at = field.offset + field.count * struct.calcsize(_FORMATS[field.datatype])
        names += (
            [field.name] if field.count == 1 else [f"{field.name}_{index}" for index in range(field.count)]
        )
    return _Layout(struct.Struct(code), tuple(names))


def read_points(
    cloud: Any, field_names: Sequence[str] | None = None, skip_nans: bool = False, uvs: Iterable[Any] = ()
) -> Iterator[tuple[Any, ...]]:
    """Yield the points of a ``PointCloud2`` as tuples.

    Args:
        cloud: The cloud.
        field_names: Fields to read, always in the order of their offsets; all by default.
        skip_nans: Whether points with a value that is not a number are left out.
        uvs: Columns and rows of the points to read; all by default.
    """
    layout = _layout(cloud.fields, cloud.is_bigendian, field_names)
    data = bytes(cloud.data)
    pairs = list(uvs) or [(u, v) for v in range(cloud.height) for u in range(cloud.width)]
    for u, v in pairs:
        point = layout.code.unpack_from(data, v * cloud.row_step + u * cloud.point_step)
        if not (skip_nans and any(isnan(value) for value in point)):
            yield point


def read_points_list(
    cloud: Any, field_names: Sequence[str] | None = None, skip_nans: bool = False, uvs: Iterable[Any] = ()
) -> list[Any]:
    """Return the points as named tuples; see ``read_points``.

    As in sensor_msgs, the names are assigned in the order given, the values in that of the offsets.
    """
    names = list(field_names) if field_names else [field.name for field in cloud.fields]
    point: Any = namedtuple("Point", names)  # type: ignore[misc]  # the names are the cloud's
    return [point._make(one) for one in read_points(cloud, names, skip_nans, uvs)]


def create_cloud(header: Any, fields: Sequence[Any], points: Iterable[Sequence[Any]]) -> Any:
    """Return a ``PointCloud2`` of one row with these fields and points."""
    code = _layout(fields, big=False, wanted=None).code
    listed = [code.pack(*point) for point in points]
    kind = message_of("sensor_msgs/msg/PointCloud2", ROSPY)
    made: Any = kind(header=header, height=1, width=len(listed), fields=list(fields))
    made.point_step, made.row_step = code.size, code.size * len(listed)
    made.data = b"".join(listed)
    return made


def create_cloud_xyz32(header: Any, points: Iterable[Sequence[float]]) -> Any:
    """Return a ``PointCloud2`` of one row with the fields x, y and z in single precision."""
    fields = [
        message_of("sensor_msgs/msg/PointField", ROSPY)(name=name, offset=4 * index, datatype=7, count=1)
        for index, name in enumerate("xyz")
    ]
    return create_cloud(header, fields, points)


_CLOUDS = {one.__name__: one for one in (read_points, read_points_list, create_cloud, create_cloud_xyz32)}


def modules(rospy: ModuleType) -> dict[str, ModuleType]:
    """Return the modules of one run by name.

    Args:
        rospy: Module that tests use.
    """
    rospack = type("RosPack", (RosPack,), {"workspace": Workspace()})
    packages = library_module(
        "roslib.packages",
        {"get_pkg_dir": partial(get_pkg_dir, rospack), "InvalidROSPkgException": ResourceNotFound},
    )
    tests = _Tests(rospy)
    classes = {name: message_of(f"sensor_msgs/msg/{name}", ROSPY) for name in ("PointCloud2", "PointField")}
    generated = _genpy()
    in_roslib = {"load_manifest": load_manifest, "packages": packages, "message": generated["roslib.message"]}
    return {
        **generated,
        **_Commands(rospy).modules(),
        "roslib": library_module("roslib", in_roslib),
        "roslib.packages": packages,
        "rospkg": library_module("rospkg", {"ResourceNotFound": ResourceNotFound, "RosPack": rospack}),
        "rosunit": library_module("rosunit", {"unitrun": tests.run}),
        "rostest": library_module(
            "rostest",
            {
                "rosrun": tests.run,
                "run": tests.run,
                "unitrun": tests.run,
                "is_publisher": tests.is_publisher,
                "is_subscriber": tests.is_subscriber,
            },
        ),
        "sensor_msgs.point_cloud2": library_module("sensor_msgs.point_cloud2", {**_CLOUDS, **classes}),
    }
