"""Types whose packages are not installed, carried as bytes: rclpy needs type support of no package for them.

``carrier.cpp`` is type support that reads nothing of what it carries. It is compiled once for an installation
of ROS 2 (under a second) and kept in the user's cache folder. It serves Fast DDS, the usual middleware.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any

from volery.base.errors import UsageError
from volery.ros.messages import ServiceType, type_hash

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


def is_carrier(cls: type[Any]) -> bool:
    """Whether *cls* is one of these."""
    return cls.__module__ == __name__


def message_carrier(name: str) -> type[Any]:
    """A class that rclpy takes for the message type *name*: its objects have as ``data`` the CDR bytes behind
    their header, and what arrives is such bytes. Raises ``UsageError`` where it cannot be built.
    """
    return _message_class(name, _message_support(name))


def service_carrier(kind: ServiceType) -> type[Any]:
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
