"""Types whose packages are not installed, carried as bytes: rclpy needs type support of no package for them.

``carrier.cpp`` is type support that reads nothing of what it carries. It is compiled once for an installation
of ROS 2 (under a second) and kept in the user's cache folder. It serves Fast DDS, the usual middleware.

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
from volery.ros.messages import Message, ServiceType, from_cdr, message_name, to_cdr, type_hash
from volery.ros.messages.store import idl_fields, nested_types

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


_WAYS = {
    "_CREATE_ROS_MESSAGE": "carrier_create",
    "_DESTROY_ROS_MESSAGE": "carrier_destroy",
    "_CONVERT_FROM_PY": "carrier_from_python",
    "_CONVERT_TO_PY": "carrier_to_python",
}
"""Where rclpy looks for what it does with a message, and who does it here."""


HEADER = b"\x00\x01\x00\x00"
"""Before the bytes of each message: plain CDR, little endian."""


def is_raw_class(cls: type[Any]) -> bool:
    """Whether *cls* is one of these."""
    return cls.__module__ == __name__


def raw_message_class(name: str) -> type[Any]:
    """A class that rclpy takes for the message type *name*: its objects have as ``data`` the CDR bytes behind
    their header, and what arrives is such bytes. Raises ``UsageError`` where it cannot be built.
    """
    return _message_class(name, _message_support(name))


def raw_service_class(kind: ServiceType) -> type[Any]:
    """The same for a service type: ``Request`` and ``Response`` are such classes."""
    names = kind.request.__msgtype__, kind.response.__msgtype__
    supports = [_message_support(name) for name in names]
    request, response = map(_message_class, names, supports)
    package, folder, label = kind.name.split("/")
    digest = sha256(kind.name.encode()).digest()  # stands for its hash, which nobody compares
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

    ways = {place: getattr(_library(), way)() for place, way in _WAYS.items()}
    return _class(name.rpartition("/")[2], {"_TYPE_SUPPORT": support, **ways}, {"__init__": make})


def _class(label: str, addresses: Mapping[str, int], inside: dict[str, Any]) -> type[Any]:
    """rclpy looks for addresses at the class of the class."""
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
    """``carrier.cpp``, compiled and loaded."""
    middleware = import_module("rclpy").get_rmw_implementation_identifier()
    if middleware != MIDDLEWARE:
        raise UsageError(f"such types are carried on {MIDDLEWARE} only, and this is {middleware}")
    library = ctypes.PyDLL(str(_compiled()))
    text, pointer = ctypes.c_char_p, ctypes.c_void_p
    library.carrier_message.argtypes = (text, text, text)
    library.carrier_service.argtypes = (text, text, text, pointer, pointer)
    for name in ("carrier_message", "carrier_service", *_WAYS.values()):
        getattr(library, name).restype = pointer
    return library


def _compiled() -> Path:
    """The library for this installation, from the user's cache folder if it is there."""
    source = files("volery.ros.transports.ros2").joinpath("carrier.cpp").read_bytes()
    prefixes = _prefixes()
    key = sha256(b"\0".join((source, *(str(one).encode() for one in prefixes)))).hexdigest()[:20]
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
    """Where this installation's headers and libraries are: the wheels' environment, or ROS's own folders."""
    named = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return tuple(Path(one) for one in (*filter(None, named), sys.prefix) if (Path(one) / "include").is_dir())


def _compile(source: bytes, prefixes: Sequence[Path], made: Path) -> None:
    compiler = shutil.which(os.environ.get("CXX", "g++"))
    if compiler is None:
        raise UsageError("there is no C++ compiler to build a carrier with: apt install g++")
    includes = [f"-I{one / 'include' / inner}" for one in prefixes for inner in ("", *HEADERS)]
    places = [f"-L{one / 'lib'}" for one in prefixes]
    fresh = made.with_suffix(f".{os.getpid()}")  # complete when it gets its name: others may build it, too
    command = [compiler, "-std=c++17", "-O1", "-shared", "-fPIC", "-x", "c++", "-", "-o", str(fresh)]
    done = subprocess.run(
        [*command, *includes, *places, *LIBRARIES], input=source, capture_output=True, check=False
    )
    if done.returncode:
        said = done.stderr.decode(errors="replace").partition("\n")[0]
        raise UsageError(f"no carrier could be built with {compiler}: {said}")
    fresh.rename(made)


def distribution() -> str:
    """``jazzy``, if the installation says so; else ``<distribution>``."""
    return os.environ.get("ROS_DISTRO") or "<distribution>"


@cache
def rclpy_class(name: str) -> Any:
    """rclpy's class of a message type, or a carrier of its bytes where the package is not installed.

    ``UsageError`` if neither can be, or if its class has other fields.
    """
    full = message_name(name)
    found = _installed(full)
    if found is None:
        return _carried_as_bytes(full, lambda: raw_message_class(full))
    _compare(full, found)
    return found


def _carried_as_bytes(full: str, make: Callable[[], type[Any]]) -> type[Any]:
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
    """rclpy's class, ``None`` if it has none."""
    package, kind, label = full.split("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), label)
    except (ImportError, AttributeError):
        return None


def _compare(full: str, found: Any) -> None:
    """Bytes are exchanged as they are, so both must mean the same by them."""
    theirs, ours = found.get_fields_and_field_types(), idl_fields(full)
    if list(theirs.items()) != list(ours.items()):
        raise UsageError(
            f"{full} has other fields in this ROS 2 ({', '.join(theirs)}) than in the definitions of Humble "
            f"({', '.join(ours)}); it cannot be carried"
        )
    for inner in nested_types(full):
        rclpy_class(inner)


def carried(name: str) -> bool:
    """Whether a message type is installed here, with our fields."""
    try:
        return _installed(message_name(name)) is not None and rclpy_class(name) is not None
    except UsageError:
        return False


class Rclpyed(NamedTuple):
    """A service type of rclpy, and what translates its two halves."""

    type: Any
    request: type[Any]
    response: type[Any]


@cache
def rclpy_service(kind: ServiceType) -> Rclpyed:
    """rclpy's class of a service type, or a carrier. ``UsageError`` as for messages."""
    found = _installed(kind.name)
    if found is None:
        found = _carried_as_bytes(kind.name, lambda: raw_service_class(kind))
        return Rclpyed(found, found.Request, found.Response)
    for half, ours in ((found.Request, kind.request), (found.Response, kind.response)):
        _compare(ours.__msgtype__, half)
    return Rclpyed(found, found.Request, found.Response)


def to_rclpy(message: Message, cls: type[Any]) -> Any:
    """Our value as rclpy's."""
    data = to_cdr(message)
    if is_raw_class(cls):
        return cls(data[len(HEADER) :])
    return _serialization().deserialize_message(data, cls)


def from_rclpy(name: str, message: Any) -> Any:
    """rclpy's value as ours."""
    if isinstance(message, bytes):
        return from_cdr(name, HEADER + message)
    return from_cdr(name, _serialization().serialize_message(message))


@cache
def _serialization() -> Any:
    return import_module("rclpy.serialization")
