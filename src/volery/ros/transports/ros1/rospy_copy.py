"""A copy of rospy for each node, and message classes for rospy that carry bytes.

rospy keeps its node in module globals, so a process can have one. Importing its modules again gives another
set of globals that shares only the message classes with the first; the modules reference each other from
their import on, so both sets work side by side.
"""

from __future__ import annotations

import atexit
import importlib
import sys
import threading
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from io import BytesIO
from socket import SHUT_RDWR
from types import ModuleType
from typing import Any

from volery.base.errors import UsageError
from volery.ros.messages import Ros1Type, ServiceType, ros1_service, ros1_type

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

    class RawMessage(genpy.Message):  # type: ignore[misc,name-defined]  # genpy carries no types
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

    return RawMessage


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
