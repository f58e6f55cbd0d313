"""rospy for several nodes in one process, and message modules for rospy and its tools.

rospy keeps its node in module globals, so a process can have one. Importing its modules again gives another
set of globals that shares only the message classes with the first; the modules reference each other from
their import on, so both sets work side by side. A package that no distribution has any more, such as
roscopter, is exported as definitions and modules that rostopic and rosservice import.
"""

from __future__ import annotations

import atexit
import importlib
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from socket import SHUT_RDWR
from types import ModuleType
from typing import Any

from volery.base.errors import UsageError, choices, did_you_mean
from volery.ros.messages import Ros1Type, ServiceType, ros1_service, ros1_type, service_types, types

_importing = threading.Lock()
_MISSING = (
    "ROS 1 needs rospy, which this Python does not see: on Debian install python3-rospy, then run "
    "scripts/ros1-modules VENV for the virtual environment"
)


def available() -> bool:
    """Return whether rospy can be imported."""
    return find_spec("rospy") is not None and find_spec("genpy") is not None


def rospy_copy() -> Any:
    """Return a new copy of rospy that does not configure logging; ``UsageError`` if there is no rospy."""
    if not available():
        raise UsageError(_MISSING)
    with _importing:
        before = _take_out()
        try:
            made: Any = importlib.import_module("rospy")
            importlib.import_module("rospy.impl.registration")
        except ImportError as error:
            raise UsageError(f"rospy is there but cannot be imported: {error}") from error
        finally:
            _take_out()
            sys.modules.update(before)
    made.core.configure_logging = lambda *ignored, **ignored_too: None
    return made


class CopyServers:
    """The servers of a copy's node, whose threads rospy does not end at shutdown, one of them busy."""

    def __init__(self, rospy: Any) -> None:
        self._rospy = rospy
        start = rospy.impl.init.start_node

        def start_and_keep(*arguments: Any, **options: Any) -> Any:
            node = start(*arguments, **options)
            server, node_shutdown = node.server, node.shutdown

            def shutdown(reason: str) -> None:
                node.is_shutdown = True
                server.shutdown()  # ends its thread's loop before the socket goes
                node_shutdown(reason)

            node.shutdown = shutdown
            return node

        rospy.impl.init.start_node = start_and_keep

    def end(self) -> None:
        """Close the server sockets and release the copy."""
        server = self._rospy.impl.tcpros_base._tcpros_server
        accepting = server.tcp_ros_server if server is not None else None
        if accepting is not None and accepting.server_sock is not None:
            accepting.is_shutdown = True
            with suppress(OSError):
                accepting.server_sock.shutdown(SHUT_RDWR)  # wakes the thread that waits in accept
            accepting.server_sock.close()
        self._rospy.core._xmlrpc_cache.clear()
        atexit.unregister(self._rospy.core._ros_atexit)


def _take_out() -> dict[str, ModuleType]:
    names = [name for name in sys.modules if name == "rospy" or name.startswith("rospy.")]
    return {name: sys.modules.pop(name) for name in names}


@cache
def _raw_base() -> Any:
    """Return the base of all raw classes; created on demand, since genpy may not be installed."""
    genpy = import_module("genpy")

    class SerializedMessage(genpy.Message):  # type: ignore[misc,name-defined]  # genpy carries no types
        """A message as ROS 1 bytes under its type's name."""

        __slots__ = ["data"]
        _slot_types: tuple[str, ...] = ()
        _has_header = False

        def __init__(self, data: bytes = b"") -> None:
            self.data = data

        def serialize(self, buff: BytesIO) -> None:
            """Write the bytes."""
            buff.write(self.data)

        def deserialize(self, data: bytes) -> Any:
            """Store the bytes."""
            self.data = bytes(data)
            return self

    return SerializedMessage


def _made(kind: Ros1Type) -> Any:
    base = _raw_base()
    names = {"__slots__": [], "_type": kind.name, "_md5sum": kind.md5, "_full_text": kind.text}
    return type(kind.name.replace("/", "_"), (base,), names)


@cache
def raw_message_class(name: str) -> Any:
    """Return the class that carries messages of type `name`; ``UsageError`` if ROS 1 has no such type."""
    return _made(ros1_type(name))


@cache
def raw_service_class(kind: ServiceType) -> Any:
    """Return the class that carries requests and responses of a service type."""
    described = ros1_service(kind.name)
    names = {
        "_type": described.name,
        "_md5sum": described.md5,
        "_request_class": _made(described.request),
        "_response_class": _made(described.response),
    }
    return type(described.name.replace("/", "_"), (), names)


_NEXT = "=" * 80 + "\nMSG: "
_MANIFEST = """<?xml version="1.0"?>
<package format="2">
  <name>{name}</name>
  <version>1.0.0</version>
  <description>Interfaces of {name}, written out.</description>
  <maintainer email="maintainer@example.com">volery</maintainer>
  <license>Apache-2.0</license>
</package>
"""


ROS2_ONLY = "rcl_interfaces/"
"""Beginning of the types that no installation of ROS 1 has."""


def write_package(package: str, folder: Path) -> Path:
    """Write an interface package and return its folder.

    With `folder` on ``PYTHONPATH`` and ``ROS_PACKAGE_PATH``, ROS finds the package as if it were installed.

    Args:
        package: Name of a package that volery defines.
        folder: Parent of the package's folder.

    Raises:
        UsageError: the package is unknown, genpy is not installed, or the folder cannot be written.
    """
    messages = [name for name in types() if name.startswith(f"{package}/")]
    services = [name for name in service_types() if name.startswith(f"{package}/")]
    if not messages and not services:
        known = sorted({name.partition("/")[0] for name in (*types(), *service_types())})
        raise UsageError(f"no package {package!r}{did_you_mean(package, known)}; there is {choices(known)}")
    if not available():
        raise UsageError(
            "ROS 1's genpy makes the modules, and this Python does not see it: see `volery doctor`"
        )
    made = folder / package
    try:
        _write(made, "package.xml", _MANIFEST.format(name=package))
        _write(made, "__init__.py", "")
        _write_messages(made, messages)
        _write_services(made, services)
    except OSError as error:
        raise UsageError(f"{made} cannot be written: {error.strerror or error}") from error
    return made


def _write(folder: Path, name: str, text: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")


def _write_messages(made: Path, names: list[str]) -> None:
    modules = []
    for name in names:
        kind = ros1_type(name)
        label = kind.name.partition("/")[2]
        _write(made / "msg", f"{label}.msg", _own(kind))
        _write(made / "msg", f"_{label}.py", "\n".join(_message_module(kind)) + "\n")
        modules.append(f"from ._{label} import *\n")
    if modules:
        _write(made / "msg", "__init__.py", "".join(modules))


def _write_services(made: Path, names: list[str]) -> None:
    modules = []
    for name in names:
        kind = ros1_service(name)
        nested = [inner for half in (kind.request, kind.response) for inner, _ in _inner(half)]
        if not name.startswith(ROS2_ONLY) and any(inner.startswith(ROS2_ONLY) for inner in nested):
            continue  # a module that imports it would fail, and with it those of the whole package
        label = kind.name.partition("/")[2]
        halves = f"{_own(kind.request)}---\n{_own(kind.response)}"
        _write(made / "srv", f"{label}.srv", halves)
        lines = _service_module(kind.name, halves, kind.request, kind.response)
        _write(made / "srv", f"_{label}.py", "\n".join(lines) + "\n")
        modules.append(f"from ._{label} import *\n")
    if modules:
        _write(made / "srv", "__init__.py", "".join(modules))


def _own(kind: Ros1Type) -> str:
    """Return the type's own definition, without those of its nested types."""
    return kind.text.partition(_NEXT)[0].rstrip("\n") + "\n"


def _inner(kind: Ros1Type) -> Iterator[tuple[str, str]]:
    """Yield names and definitions of the nested types."""
    for section in kind.text.split(_NEXT)[1:]:
        name, _, text = section.partition("\n")
        yield name.strip(), text


def _context(*kinds: Ros1Type) -> Any:
    """Return a genmsg context with all nested types, so that genmsg reads no files."""
    loader = import_module("genmsg.msg_loader")
    context = import_module("genmsg").MsgContext.create_default()
    for kind in kinds:
        for name, text in _inner(kind):
            if not context.is_registered(name):
                context.register(name, loader.load_msg_from_string(context, text, name))
    return context


def _message_module(kind: Ros1Type) -> Iterator[str]:
    context = _context(kind)
    spec = import_module("genmsg.msg_loader").load_msg_from_string(context, _own(kind), kind.name)
    yield from import_module("genpy.generator").msg_generator(context, spec, {})


def _service_module(name: str, text: str, *halves: Ros1Type) -> Iterator[str]:
    context = _context(*halves)
    spec = import_module("genmsg.msg_loader").load_srv_from_string(context, text, name)
    yield from import_module("genpy.generator").srv_generator(context, spec, {})
