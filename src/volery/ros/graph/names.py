"""ROS names: their syntax and their absolute forms.

The rules are those that ROS 1 and ROS 2 share: tokens of letters, digits and underscores that do not begin
with a digit, joined by single slashes; ``/a`` is absolute, ``a`` relative to the namespace, ``~a`` private to
the node. See http://wiki.ros.org/Names and https://design.ros2.org/articles/topic_and_service_names.html.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from volery.base.errors import UsageError

_TOKEN = r"[A-Za-z_][A-Za-z0-9_]*"
_NAME = re.compile(rf"(?:~/?|/)?{_TOKEN}(?:/{_TOKEN})*\Z")
_NODE = re.compile(rf"{_TOKEN}\Z")
_NAMESPACE = re.compile(rf"/|(?:/{_TOKEN})+\Z")
_PART = "letters, digits and underscores, not beginning with a digit"
_RULE = f"{_PART}, parts joined by single slashes"


def check(name: str, what: str = "name") -> None:
    """Raise ``UsageError`` if `name` is no valid ROS name."""
    if not _NAME.match(name) or "__" in name:
        raise UsageError(
            f"{name!r} is no valid ROS {what}: {_RULE}; '/' before makes it absolute, '~' private"
        )


def node_name(name: str, namespace: str) -> str:
    """Return the full name of a node; ``UsageError`` if its name or its namespace is not valid."""
    if not _NODE.match(name) or "__" in name:
        raise UsageError(f"{name!r} is no valid ROS node name: {_PART}, without slashes")
    if not _NAMESPACE.fullmatch(namespace):
        raise UsageError(f"{namespace!r} is no valid ROS namespace: '/' or absolute, {_RULE}")
    return join(namespace, name)


def join(namespace: str, name: str) -> str:
    """Return `name` below `namespace`."""
    return f"{namespace.rstrip('/')}/{name}"


def absolute(name: str, namespace: str, node: str) -> str:
    """Return the absolute form of `name` as used by the node of full name `node` in `namespace`."""
    check(name)
    if name.startswith("/"):
        return name
    if name.startswith("~"):
        return join(node, name[1:].lstrip("/"))
    return join(namespace, name)


def remapping(remaps: Mapping[str, str], namespace: str, node: str) -> dict[str, str]:
    """Return remappings with both sides absolute."""
    return {absolute(old, namespace, node): absolute(new, namespace, node) for old, new in remaps.items()}
