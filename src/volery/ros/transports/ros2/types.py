"""Which of our types rclpy can carry, and their values as rclpy's in services."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.ros.messages import Message, ServiceType, from_cdr, message_name, to_cdr
from volery.ros.messages.idl import idl_fields, nested_types
from volery.ros.transports.ros2.carrier import HEADER, is_carrier, message_carrier, service_carrier


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
        return _carried_as_bytes(full, lambda: message_carrier(full))
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
        found = _carried_as_bytes(kind.name, lambda: service_carrier(kind))
        return Rclpyed(found, found.Request, found.Response)
    for half, ours in ((found.Request, kind.request), (found.Response, kind.response)):
        _compare(ours.__msgtype__, half)
    return Rclpyed(found, found.Request, found.Response)


def to_rclpy(message: Message, cls: type[Any]) -> Any:
    """Our value as rclpy's."""
    data = to_cdr(message)
    if is_carrier(cls):
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
