"""Message and service classes for rclpy: those of installed packages, and raw ones that carry bytes.

A raw class needs no installed package: ``carrier.cpp`` is type support that does not read the bytes it
carries. It is compiled once per installation of ROS 2 (in less than a second), kept in the user's cache
folder, and supports Fast DDS, the default middleware.

Which of our types rclpy can carry, and their values as rclpy's in services.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.ros.messages import RosMessage, ServiceType, from_cdr, message_name, to_cdr, type_hash
from volery.ros.messages.store import distribution, idl_fields, nested_types

HEADERS = (
    "fastcdr",
    "rcutils",
    "rmw",
    "rosidl_runtime_c",
    "rosidl_typesupport_fastrtps_cpp",
    "rosidl_typesupport_introspection_c",
    "rosidl_typesupport_interface",
)
LIBRARIES = ("-lfastcdr", "-lrosidl_runtime_c")
MIDDLEWARE = "rmw_fastrtps_cpp"


_CONVERSIONS = {
    "_CREATE_ROS_MESSAGE": "carrier_create",
    "_DESTROY_ROS_MESSAGE": "carrier_destroy",
    "_CONVERT_FROM_PY": "carrier_from_python",
    "_CONVERT_TO_PY": "carrier_to_python",
}
"""Attributes in which rclpy looks for its conversions, and the functions that implement them."""


HEADER = b"\x00\x01\x00\x00"
"""Header of each message's bytes: plain CDR, little endian."""


def is_raw_class(cls: type[Any]) -> bool:
    """Return whether `cls` is a raw class."""
    return cls.__module__ == __name__


def raw_message_class(name: str) -> type[Any]:
    """Return a raw class of a message type for rclpy.

    The attribute ``data`` of its objects is the CDR bytes behind their header; received messages are such
    bytes. Raises ``UsageError`` if the type support cannot be built.
    """
    return _message_class(name, _message_support(name))


def raw_service_class(kind: ServiceType) -> type[Any]:
    """Return a raw class of a service type for rclpy; its ``Request`` and ``Response`` are raw classes."""
    names = kind.request.__msgtype__, kind.response.__msgtype__
    supports = [_message_support(name) for name in names]
    request, response = map(_message_class, names, supports)
    package, folder, label = kind.name.split("/")
    digest = sha256(kind.name.encode()).digest()  # in place of the type's hash, which is not compared
    support = _library().carrier_service(f"{package}::{folder}".encode(), label.encode(), digest, *supports)
    inside = {"Request": request, "Response": response}
    return _class(label, {"_TYPE_SUPPORT": support}, inside)


def _message_support(name: str) -> int:
    package, folder, label = name.split("/")
    made: int = _library().carrier_message(f"{package}::{folder}".encode(), label.encode(), type_hash(name))
    return made


def _message_class(name: str, support: int) -> type[Any]:
    def make(self: Any, data: bytes = b"") -> None:
        self.data = data

    ways = {place: getattr(_library(), way)() for place, way in _CONVERSIONS.items()}
    return _class(name.rpartition("/")[2], {"_TYPE_SUPPORT": support, **ways}, {"__init__": make})


def _class(label: str, addresses: Mapping[str, int], inside: dict[str, Any]) -> type[Any]:
    """Return a class with these addresses in its metaclass, where rclpy looks for them."""
    capsules: dict[str, Any] = {name: _capsule(address, None, None) for name, address in addresses.items()}
    made: type[Any] = type(f"Metaclass_{label}", (type,), capsules)(
        label, (), {**inside, "__module__": __name__}
    )
    return made


_capsule = ctypes.pythonapi.PyCapsule_New
_capsule.restype = ctypes.py_object
_capsule.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)


# -- the library


@cache
def _library() -> Any:
    """Return ``carrier.cpp``, compiled and loaded."""
    middleware = import_module("rclpy").get_rmw_implementation_identifier()
    if middleware != MIDDLEWARE:
        raise UsageError(f"such types are carried on {MIDDLEWARE} only, and this is {middleware}")
    library = ctypes.PyDLL(str(_compiled()))
    text, pointer = ctypes.c_char_p, ctypes.c_void_p
    library.carrier_message.argtypes = (text, text, text)
    library.carrier_service.argtypes = (text, text, text, pointer, pointer)
    for name in ("carrier_message", "carrier_service", *_CONVERSIONS.values()):
        getattr(library, name).restype = pointer
    return library


def _compiled() -> Path:
    """Return the path of the library for this installation, compiled unless the user's cache has it."""
    source = files("volery.ros.transports.ros2").joinpath("carrier.cpp").read_bytes()
    prefixes = _prefixes()
    key = sha256(b"\0".join((source, *(str(prefix).encode() for prefix in prefixes)))).hexdigest()[:20]
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "volery" / "ros2"
    made = folder / f"carrier-{key}.so"
    if not made.exists():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _compile(source, prefixes, made)
        except OSError as error:
            raise UsageError(f"{made} cannot be written: {error.strerror or error}") from error
    return made


def _prefixes() -> tuple[Path, ...]:
    """Return the folders of this installation's headers and libraries: the wheels', or ROS's own."""
    named = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return tuple(Path(one) for one in (*filter(None, named), sys.prefix) if (Path(one) / "include").is_dir())


def _compile(source: bytes, prefixes: Sequence[Path], made: Path) -> None:
    compiler = shutil.which(os.environ.get("CXX", "g++"))
    if compiler is None:
        raise UsageError("there is no C++ compiler to build a carrier with: apt install g++")
    includes = [f"-I{prefix / 'include' / inner}" for prefix in prefixes for inner in ("", *HEADERS)]
    places = [f"-L{prefix / 'lib'}" for prefix in prefixes]
    fresh = made.with_suffix(f".{os.getpid()}")  # renamed when complete: other processes may build it, too
    command = [compiler, "-std=c++17", "-O1", "-shared", "-fPIC", "-x", "c++", "-", "-o", str(fresh)]
    done = subprocess.run(
        [*command, *includes, *places, *LIBRARIES], input=source, capture_output=True, check=False
    )
    if done.returncode:
        output = done.stderr.decode(errors="replace").partition("\n")[0]
        raise UsageError(f"no carrier could be built with {compiler}: {output}")
    fresh.rename(made)


@cache
def rclpy_class(name: str) -> Any:
    """Return rclpy's class of a message type, or a raw class if its package is not installed.

    Raises:
        UsageError: neither is available, or the installed class has other fields.
    """
    full = message_name(name)
    found = _installed(full)
    if found is None:
        return _raw_class(full, lambda: raw_message_class(full))
    _compare(full, found)
    return found


def _raw_class(full: str, make: Callable[[], type[Any]]) -> type[Any]:
    try:
        return make()
    except UsageError as error:
        package = full.partition("/")[0]
        ubuntu = f"ros-{distribution()}-{package.replace('_', '-')}"
        raise UsageError(
            f"rclpy has no type support for {full}: its package is not installed ({ubuntu}, or built with "
            f"colcon), and it cannot be carried without: {error}"
        ) from error


def _installed(full: str) -> Any:
    """Return rclpy's class of a type; None if its package is not installed."""
    package, kind, label = full.split("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), label)
    except (ImportError, AttributeError):
        return None


def _compare(full: str, found: Any) -> None:
    """Raise ``UsageError`` if rclpy's class has other fields: the bytes are exchanged unchanged."""
    theirs, ours = found.get_fields_and_field_types(), idl_fields(full)
    if list(theirs.items()) != list(ours.items()):
        raise UsageError(
            f"{full} has other fields in this ROS 2 ({', '.join(theirs)}) than in the definitions of "
            f"{distribution().capitalize()} ({', '.join(ours)}); it cannot be carried"
        )
    for inner in nested_types(full):
        rclpy_class(inner)


def carried(name: str) -> bool:
    """Return whether a message type is installed with the fields that volery defines."""
    try:
        return _installed(message_name(name)) is not None and rclpy_class(name) is not None
    except UsageError:
        return False


class RclpyService(NamedTuple):
    """rclpy's class of a service type with those of its request and response."""

    type: Any
    request: type[Any]
    response: type[Any]


@cache
def rclpy_service(kind: ServiceType) -> RclpyService:
    """Return rclpy's class of a service type, or a raw one; ``UsageError`` as for messages."""
    found = _installed(kind.name)
    if found is None:
        found = _raw_class(kind.name, lambda: raw_service_class(kind))
        return RclpyService(found, found.Request, found.Response)
    for half, ours in ((found.Request, kind.request), (found.Response, kind.response)):
        _compare(ours.__msgtype__, half)
    return RclpyService(found, found.Request, found.Response)


def to_rclpy(message: RosMessage, cls: type[Any]) -> Any:
    """Convert a message to rclpy's class `cls`."""
    data = to_cdr(message)
    if is_raw_class(cls):
        return cls(data[len(HEADER) :])
    return _serialization().deserialize_message(data, cls)


def from_rclpy(name: str, message: Any) -> Any:
    """Convert a message of rclpy to the message type `name`."""
    if isinstance(message, bytes):
        return from_cdr(name, HEADER + message)
    return from_cdr(name, _serialization().serialize_message(message), surplus=True)


@cache
def _serialization() -> Any:
    return import_module("rclpy.serialization")
