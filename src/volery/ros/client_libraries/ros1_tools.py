"""The small Python packages of ROS 1: ``roslib``, ``rospkg``, ``rosunit``, ``rostest``, ``point_cloud2``."""

from __future__ import annotations

import struct
import unittest
from collections import namedtuple
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from math import isnan
from types import ModuleType
from typing import Any, ClassVar, NamedTuple

from volery.base.errors import did_you_mean
from volery.ros.client_libraries.library_base import file_of_user, library_module
from volery.ros.messages import Workspace
from volery.ros.messages.client_classes import ROSPY, message_of

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
    names = list(field_names) if field_names else [one.name for one in cloud.fields]
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
    return {
        "roslib": library_module("roslib", {"load_manifest": load_manifest, "packages": packages}),
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
