"""Which of our types rclpy can carry, and their values as rclpy's in services."""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.messages import Message, ServiceType, from_cdr, message_name, to_cdr
from volery.messages.idl import idl_fields, nested_types


def distribution() -> str:
    """``jazzy``, if the installation says so; else ``<distribution>``."""
    return os.environ.get("ROS_DISTRO") or "<distribution>"


@cache
def rclpy_class(name: str) -> Any:
    """rclpy's class of a message type. ``UsageError`` if it has none, or one with other fields."""
    full = message_name(name)
    found = _installed(full)
    _compare(full, found)
    return found


def _installed(full: str) -> Any:
    package, kind, label = full.split("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), label)
    except (ImportError, AttributeError) as error:
        ubuntu = f"ros-{distribution()}-{package.replace('_', '-')}"
        raise UsageError(
            f"rclpy has no type support for {full}: it takes only types whose package is installed with it "
            f"({ubuntu}, or built with colcon), and this Python does not see {package}"
        ) from error


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
    """Whether rclpy carries a message type here."""
    try:
        rclpy_class(name)
    except UsageError:
        return False
    return True


class Rclpyed(NamedTuple):
    """A service type of rclpy, and what translates its two halves."""

    type: Any
    request: type[Any]
    response: type[Any]


@cache
def rclpy_service(kind: ServiceType) -> Rclpyed:
    """rclpy's class of a service type. ``UsageError`` as for messages."""
    found = _installed(kind.name)
    for half, ours in ((found.Request, kind.request), (found.Response, kind.response)):
        _compare(ours.__msgtype__, half)
    return Rclpyed(found, found.Request, found.Response)


def to_rclpy(message: Message, cls: type[Any]) -> Any:
    """Our value as rclpy's."""
    return _serialization().deserialize_message(to_cdr(message), cls)


def from_rclpy(name: str, message: Any) -> Any:
    """rclpy's value as ours."""
    return from_cdr(name, _serialization().serialize_message(message))


@cache
def _serialization() -> Any:
    return import_module("rclpy.serialization")
