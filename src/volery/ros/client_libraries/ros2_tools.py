"""The small Python packages of ROS 2: ``ament_index_python``, ``sensor_msgs_py``, ``rosidl_runtime_py``."""

from __future__ import annotations

from collections import OrderedDict, namedtuple
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from io import StringIO
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.lib.recfunctions import structured_to_unstructured
from ruamel.yaml import YAML

from volery.base.errors import did_you_mean
from volery.ros.client_libraries.library_base import file_of_user, library_module
from volery.ros.messages import Workspace
from volery.ros.messages.client_classes import RCLPY, message_of
from volery.ros.messages.packages import define_packages
from volery.ros.messages.packages import modules as interface_modules
from volery.ros.messages.slot_types import DEFINITION
from volery.ros.messages.store import action_types, service_types, types
from volery.ros.messages.workspace import Package, entries

# -- ament_index_python


class PackageNotFoundError(KeyError):
    """A package was not found."""

    def __str__(self) -> str:
        return str(self.args[0])


class InvalidResourceTypeNameError(ValueError):
    """A type of a resource is empty or has a slash."""


class InvalidResourceNameError(ValueError):
    """A name of a resource is empty or has a slash."""


_INDEX = Path("share", "ament_index", "resource_index")


class _AmentIndex:
    """The packages that a file sees: those that are installed, and sources, which need no build."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace

    def _find(self, package_name: str) -> Package:
        if not package_name or "/" in package_name:
            raise ValueError(f"'{package_name}' is not a valid package name")
        file = file_of_user()
        found = self._workspace.installed(package_name) or self._workspace.find(package_name, file)
        if found is None:
            near = did_you_mean(package_name, self._workspace.names(file))
            paths = [str(entry) for entry in entries("AMENT_PREFIX_PATH")]
            raise PackageNotFoundError(
                f"package '{package_name}' not found{near}, searching: {paths} and the workspace of the file"
            )
        return found

    def get_package_prefix(self, package_name: str) -> str:
        found = self._find(package_name)
        return str(found.prefix or found.folder)

    def get_package_share_directory(self, package_name: str, print_warning: bool = True) -> str:
        return str(self._find(package_name).folder)

    def get_package_share_path(self, package_name: str, print_warning: bool = True) -> Path:
        return self._find(package_name).folder

    def get_packages_with_prefixes(self) -> dict[str, str]:
        names = sorted(self._workspace.names(file_of_user()))
        return {name: self.get_package_prefix(name) for name in names}

    def get_search_paths(self) -> list[str]:
        return [str(entry) for entry in entries("AMENT_PREFIX_PATH") if entry.is_dir()]

    def get_resources(self, resource_type: str) -> dict[str, str]:
        self._check(resource_type, "type", InvalidResourceTypeNameError)
        found: dict[str, str] = {}
        for prefix in entries("AMENT_PREFIX_PATH"):
            folder = prefix / _INDEX / resource_type
            for file in sorted(folder.iterdir()) if folder.is_dir() else ():
                if file.is_file() and not file.name.startswith("."):
                    found.setdefault(file.name, str(prefix))
        return found

    def get_resource_types(self) -> set[str]:
        folders = [prefix / _INDEX for prefix in entries("AMENT_PREFIX_PATH")]
        return {one.name for folder in folders if folder.is_dir() for one in folder.iterdir()}

    def has_resource(self, resource_type: str, resource_name: str) -> Any:
        self._check(resource_name, "name", InvalidResourceNameError)
        return self.get_resources(resource_type).get(resource_name, False)

    def get_resource(self, resource_type: str, resource_name: str) -> tuple[str, str]:
        prefix = self.has_resource(resource_type, resource_name)
        if not prefix:
            raise LookupError(f"Could not find the resource '{resource_name}' of type '{resource_type}'")
        file = Path(prefix) / _INDEX / resource_type / resource_name
        return file.read_text(encoding="utf-8"), prefix

    @staticmethod
    def _check(given: str, what: str, error: type[ValueError]) -> None:
        assert given, f"The resource {what} must not be empty"
        if "/" in given:
            raise error(f"Resource {what} '{given}' is invalid")


def _ament_modules(workspace: Workspace) -> dict[str, ModuleType]:
    index = _AmentIndex(workspace)
    functions = {name: getattr(index, name) for name in vars(_AmentIndex) if name.startswith(("get", "has"))}
    errors = {
        one.__name__: one
        for one in (PackageNotFoundError, InvalidResourceNameError, InvalidResourceTypeNameError)
    }
    constants = {
        "AMENT_PREFIX_PATH_ENV_VAR": "AMENT_PREFIX_PATH",
        "RESOURCE_INDEX_SUBFOLDER": str(_INDEX),
    }
    top = "ament_index_python"
    inside = {**functions, **errors, **constants}
    parts = {
        part: library_module(f"{top}.{part}", inside)
        for part in ("constants", "packages", "resources", "search_paths")
    }
    return {
        top: library_module(top, {**inside, **parts}),
        **{f"{top}.{part}": module for part, module in parts.items()},
    }


# -- sensor_msgs_py.point_cloud2

_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Types of numpy by the datatype of a ``PointField``."""


def dtype_from_fields(fields: Iterable[Any], point_step: int | None = None) -> Any:
    """Return the structured type of numpy of a point; a field of several values has names with an index."""
    names, offsets, formats = [], [], []
    for number, field in enumerate(fields):
        kind = np.dtype(_DTYPES[field.datatype])
        name = field.name or f"unnamed_field_{number}"
        for index in range(field.count):
            names.append(name if field.count == 1 else f"{name}_{index}")
            offsets.append(field.offset + index * kind.itemsize)
            formats.append(kind)
    layout: Any = {"names": names, "formats": formats, "offsets": offsets}
    if point_step is not None:
        layout["itemsize"] = point_step
    return np.dtype(layout)


def read_points(
    cloud: Any,
    field_names: Sequence[str] | None = None,
    skip_nans: bool = False,
    uvs: Any = None,
    reshape_organized_cloud: bool = False,
) -> Any:
    """Return the points of a ``PointCloud2`` as a structured array of numpy.

    Args:
        cloud: The cloud.
        field_names: Fields to read; all by default.
        skip_nans: Whether points with a value that is not a number are left out.
        uvs: Columns and rows of the points to read, or their indices; all by default.
        reshape_organized_cloud: Whether the array has the height and the width of the cloud.
    """
    kind = dtype_from_fields(cloud.fields, cloud.point_step)
    count = cloud.width * cloud.height
    points = np.ndarray(shape=(count,), dtype=kind, buffer=bytes(cloud.data)[: count * cloud.point_step])
    if field_names is not None:
        unknown = [name for name in field_names if name not in kind.names]
        assert not unknown, f"Requested field is not in the fields of the PointCloud: {unknown}"
        points = points[list(field_names)]
    if bool(np.little_endian) is bool(cloud.is_bigendian):
        points = points.byteswap().view(points.dtype)
    if skip_nans and not cloud.is_dense:
        whole = np.ones(len(points), dtype=bool)
        for name in points.dtype.names or ():
            whole &= ~np.isnan(points[name])
        points = points[whole]
    if uvs is not None:
        chosen = np.asarray(list(uvs))
        points = points[chosen[:, 1] * cloud.width + chosen[:, 0] if chosen.ndim > 1 else chosen]
    return points.reshape(cloud.height, cloud.width) if reshape_organized_cloud else points


def read_points_numpy(cloud: Any, *args: Any, **options: Any) -> Any:
    """Return the points as an array of one row each; all fields must have one type. See ``read_points``."""
    points = read_points(cloud, *args, **options)
    kinds = {points.dtype[name] for name in points.dtype.names}
    assert len(kinds) == 1, "All fields need to have the same datatype. Use `read_points()` otherwise."
    return structured_to_unstructured(points)


def read_points_list(cloud: Any, *args: Any, **options: Any) -> list[Any]:
    """Return the points as named tuples. See ``read_points``."""
    points = read_points(cloud, *args, **options)
    kind: Any = namedtuple("Point", points.dtype.names)  # type: ignore[misc]  # the names are the cloud's
    return [kind._make(one) for one in points.tolist()]


_NOT_FITTING = "The points do not have as many values as there are fields"


def create_cloud(header: Any, fields: Sequence[Any], points: Any, point_step: int | None = None) -> Any:
    """Return a ``PointCloud2`` of these fields and points: an array of numpy, or an iterable of points."""
    kind = dtype_from_fields(fields, point_step)
    if not isinstance(points, np.ndarray):
        made = np.zeros(len(points := list(points)), dtype=kind)
        for one in points:
            assert len(one) == len(kind.names), _NOT_FITTING
        made[:] = [tuple(point) for point in points]
        points = made
    elif points.dtype.names is None:
        assert points.shape[-1] == len(kind.names), _NOT_FITTING
        made = np.zeros(points.shape[:-1], dtype=kind)
        for index, name in enumerate(kind.names):
            made[name] = points[..., index]
        points = made
    elif points.dtype != kind:
        points = points.astype(kind)
    height, width = (1, len(points)) if points.ndim == 1 else points.shape
    cloud: Any = message_of("sensor_msgs/msg/PointCloud2", RCLPY)()
    cloud.header, cloud.fields, cloud.height, cloud.width = header, list(fields), height, width
    cloud.point_step = points.dtype.itemsize
    cloud.row_step = cloud.point_step * width
    cloud.data = points.tobytes()
    return cloud


def create_cloud_xyz32(header: Any, points: Any) -> Any:
    """Return a ``PointCloud2`` with the fields x, y and z in single precision."""
    field = message_of("sensor_msgs/msg/PointField", RCLPY)
    fields = [field(name=name, offset=4 * at, datatype=7, count=1) for at, name in enumerate("xyz")]
    return create_cloud(header, fields, points)


# -- rosidl_runtime_py


def _interface(kind: str, identifier: str) -> Any:
    package, _, name = identifier.replace("::", "/").partition("/")
    name = name.rpartition("/")[2]
    if not package or not name:
        raise ValueError(f"Expected the full name of {kind}, got '{identifier}'")
    module = interface_modules(package, RCLPY).get(f"{package}.{kind}")
    if module is None and define_packages(file_of_user(), [package]):
        module = interface_modules(package, RCLPY).get(f"{package}.{kind}")
    if module is None:
        raise ModuleNotFoundError(f"No module named '{package}'")
    return getattr(module, name)


def _interfaces(kind: str, package_names: Iterable[str] = ()) -> dict[str, list[str]]:
    """Return the interfaces of a kind by package, of all that a file has used or volery has by default."""
    wanted = set(package_names)
    found: dict[str, list[str]] = {}
    for full in _KNOWN[kind]():
        package, _, rest = full.partition("/")
        if (not wanted or package in wanted) and "_" not in rest:  # those are parts of actions
            found.setdefault(package, []).append(rest if "/" in rest else f"{kind}/{rest}")
    unknown = sorted(wanted - {name.partition("/")[0] for known in _KNOWN.values() for name in known()})
    if unknown:
        raise LookupError(f"Unknown package '{unknown[0]}'")
    return found


_KNOWN = {"msg": types, "srv": service_types, "action": action_types}


def get_interfaces(package_names: Iterable[str] = ()) -> dict[str, list[str]]:
    """Return the interfaces by package, such as ``msg/String``."""
    found: dict[str, list[str]] = {}
    for kind in _KNOWN:
        for package, names in _interfaces(kind, package_names).items():
            found.setdefault(package, []).extend(names)
    return {package: sorted(names) for package, names in found.items()}


def get_interface_packages() -> dict[str, str]:
    """Return the packages that have interfaces; none has an installation prefix."""
    return dict.fromkeys(get_interfaces(), "")


def set_message_fields(
    msg: Any, values: Mapping[str, Any], expand_header_auto: bool = False, expand_time_now: bool = False
) -> list[Any]:
    """Set fields of a message from a dictionary, as ``ros2 topic pub`` does.

    Raises:
        AttributeError: The message has no such field.
        TypeError: *values* is no dictionary.
    """
    if not isinstance(values, Mapping):
        raise TypeError(f"Value '{values}' is expected to be a dictionary but is a {type(values).__name__}")
    for name, value in values.items():
        before = getattr(msg, name)
        if hasattr(before, "get_fields_and_field_types") and isinstance(value, Mapping):
            set_message_fields(before, value)
        elif isinstance(value, list) and any(isinstance(one, Mapping) for one in value):
            kind = msg.get_fields_and_field_types()[name].partition("[")[0]
            kind = kind.removeprefix("sequence<").rstrip(">").partition(",")[0]
            items = [_interface("msg", kind)() for _ in value]
            for item, one in zip(items, value, strict=True):
                set_message_fields(item, one)
            setattr(msg, name, items)
        else:
            setattr(msg, name, _fitting(before, value))
    return []


def _fitting(before: Any, value: Any) -> Any:
    """Return a value as the field takes it: text from YAML may be a number, a number an integer."""
    if isinstance(before, (bool, int, float, str)) and not isinstance(value, type(before)):
        return type(before)(value)
    return value


def message_to_ordereddict(
    msg: Any, *, truncate_length: int | None = None, no_arr: bool = False, no_str: bool = False
) -> OrderedDict[str, Any]:
    """Return the fields of a message, nested ones as dictionaries."""
    options = {"truncate_length": truncate_length, "no_arr": no_arr, "no_str": no_str}
    fields = msg.get_fields_and_field_types()
    return OrderedDict((name, _plain(getattr(msg, name), options, fields[name])) for name in fields)


def _plain(value: Any, options: dict[str, Any], kind: str) -> Any:
    longest = options["truncate_length"]
    if hasattr(value, "get_fields_and_field_types"):
        return message_to_ordereddict(value, **options)
    if isinstance(value, (str, bytes)):
        if options["no_str"]:
            return f"<string length: <{len(value)}>>"
        return value if longest is None or len(value) <= longest else f"{value[:longest]!s}..."
    if isinstance(value, (bool, int, float)):
        return value
    if options["no_arr"]:
        return f"<array type: {kind.partition('[')[0]}, length: {len(value)}>"
    items = [_plain(one, options, kind) for one in list(value)[:longest]]
    items = [item.item() if isinstance(item, np.generic) else item for item in items]
    return [*items, "..."] if longest is not None and len(value) > longest else items


def message_to_yaml(msg: Any, **options: Any) -> str:
    """Return the fields of a message as YAML."""
    text = StringIO()
    writer = YAML(typ="safe", pure=True)
    writer.default_flow_style = False
    writer.sort_base_mapping_type_on_output = False  # type: ignore[assignment]  # its stubs say None
    options.pop("flow_style", None)
    writer.dump(_as_dict(message_to_ordereddict(msg, **options)), text)
    return text.getvalue()


def _as_dict(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _as_dict(one) for name, one in value.items()}
    return [_as_dict(one) for one in value] if isinstance(value, list) else value


def message_to_csv(msg: Any, **options: Any) -> str:
    """Return the values of the fields of a message with commas between them."""

    def flat(value: Any) -> list[str]:
        if isinstance(value, dict):
            return [one for inner in value.values() for one in flat(inner)]
        return [one for inner in value for one in flat(inner)] if isinstance(value, list) else [str(value)]

    return ",".join(flat(message_to_ordereddict(msg, **options)))


def _names(*functions: Any) -> dict[str, Any]:
    return {function.__name__: function for function in functions}


def modules() -> dict[str, ModuleType]:
    """Return the modules of one run by name."""
    kinds = {"get_message": "msg", "get_service": "srv", "get_action": "action"}
    utilities: dict[str, Any] = {name: partial(_interface, kind) for name, kind in kinds.items()}
    clouds = {
        **_names(dtype_from_fields, read_points, read_points_numpy, read_points_list),
        **_names(create_cloud, create_cloud_xyz32),
        "PointCloud2": message_of("sensor_msgs/msg/PointCloud2", RCLPY),
        "PointField": message_of("sensor_msgs/msg/PointField", RCLPY),
    }
    listed: dict[str, Any] = {
        "get_message_interfaces": partial(_interfaces, "msg"),
        "get_service_interfaces": partial(_interfaces, "srv"),
        "get_action_interfaces": partial(_interfaces, "action"),
        **_names(get_interfaces, get_interface_packages),
    }
    written = _names(message_to_csv, message_to_ordereddict, message_to_yaml)
    point_cloud2 = library_module("sensor_msgs_py.point_cloud2", clouds)
    inside = library_module("rosidl_runtime_py.utilities", utilities)
    top = {**written, **listed, "set_message_fields": set_message_fields, "utilities": inside}
    definition = library_module("rosidl_parser.definition", DEFINITION)
    return {
        **_ament_modules(Workspace()),
        "rosidl_parser": library_module("rosidl_parser", {"definition": definition}),
        "rosidl_parser.definition": definition,
        "sensor_msgs_py": library_module("sensor_msgs_py", {"point_cloud2": point_cloud2}),
        "sensor_msgs_py.point_cloud2": point_cloud2,
        "rosidl_runtime_py": library_module("rosidl_runtime_py", top),
        "rosidl_runtime_py.convert": library_module("rosidl_runtime_py.convert", written),
        "rosidl_runtime_py.get_interfaces": library_module("rosidl_runtime_py.get_interfaces", listed),
        "rosidl_runtime_py.set_message": library_module(
            "rosidl_runtime_py.set_message", _names(set_message_fields)
        ),
        "rosidl_runtime_py.utilities": inside,
    }
