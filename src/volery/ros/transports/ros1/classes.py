"""Our message types as classes that rospy takes: they carry a message's bytes as they are."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from io import BytesIO
from typing import Any

from volery.ros.messages import Ros1Type, ServiceType, ros1_service, ros1_type


@cache
def _carrier() -> Any:
    """The base of all of them. Made when first asked for, as genpy may not be there."""
    genpy = import_module("genpy")

    class Carrier(genpy.Message):  # type: ignore[misc,name-defined]  # genpy carries no types
        """Bytes of ROS 1 under a type's name."""

        __slots__ = ["data"]
        _slot_types: tuple[str, ...] = ()
        _has_header = False

        def __init__(self, data: bytes = b"") -> None:
            self.data = data

        def serialize(self, buff: BytesIO) -> None:
            """Write the bytes."""
            buff.write(self.data)

        def deserialize(self, data: bytes) -> Any:
            """Keep the bytes."""
            self.data = bytes(data)
            return self

    return Carrier


def _made(kind: Ros1Type) -> Any:
    base = _carrier()
    names = {"__slots__": [], "_type": kind.name, "_md5sum": kind.md5, "_full_text": kind.text}
    return type(kind.name.replace("/", "_"), (base,), names)


@cache
def message_carrier(name: str) -> Any:
    """The class that carries messages of type *name*. ``UsageError`` if ROS 1 has no such type."""
    return _made(ros1_type(name))


@cache
def service_carrier(kind: ServiceType) -> Any:
    """The class that rospy takes for a service type."""
    described = ros1_service(kind.name)
    names = {
        "_type": described.name,
        "_md5sum": described.md5,
        "_request_class": _made(described.request),
        "_response_class": _made(described.response),
    }
    return type(described.name.replace("/", "_"), (), names)
