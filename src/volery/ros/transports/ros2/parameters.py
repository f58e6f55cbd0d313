"""Parameters in ROS 2 belong to nodes: a node's own by rclpy, another's by its parameter services.

A name below a node's full name is that node's: ``/ns/node/gains/p`` is ``gains.p`` of ``/ns/node``. There
are no others.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

from volery.base.errors import LinkSilent, UsageError

PATIENCE_S = 5.0


def owner(name: str, own: str, others: list[str]) -> tuple[str, str]:
    """Whose parameter it is, and its name there (empty for all of them); ``KeyError`` if nobody's."""
    candidates = [one for one in (own, *others) if name == one or name.startswith(f"{one}/")]
    if not candidates:
        raise KeyError(name)
    node = max(candidates, key=len)
    return node, name[len(node) + 1 :].replace("/", ".")


def leaves(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """A value, or each value of a namespace, by its dotted name."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(f"{prefix}.{key}" if prefix else str(key), inner)
    else:
        yield prefix, value


def tree(prefix: str, values: dict[str, Any]) -> Any:
    """The value at *prefix*, or what is below it as a ``dict``; ``KeyError`` where there is neither."""
    if prefix in values:
        return values[prefix]
    made: dict[str, Any] = {}
    for name, value in values.items():
        if not prefix or name.startswith(f"{prefix}."):
            *path, last = name[len(prefix) + 1 if prefix else 0 :].split(".")
            branch = made
            for step in path:
                branch = branch.setdefault(step, {})
            branch[last] = value
    if not made:
        raise KeyError(prefix)
    return made


class OwnParameters:
    """Those of a node of this process."""

    def __init__(self, node: Any) -> None:
        self._node = node

    def get(self, prefix: str) -> Any:
        """See ``tree``."""
        values = {name: _plain(one.value) for name, one in self._node._parameters.items()}
        return tree(prefix, values)

    def set(self, prefix: str, value: Any) -> None:
        """Set a value or a namespace."""
        parameter = import_module("rclpy.parameter").Parameter
        try:
            wanted = [parameter(name, value=one) for name, one in leaves(prefix, value)]
        except (TypeError, ValueError) as error:
            raise UsageError(f"parameter {prefix}: ROS 2 cannot hold {value!r}: {error}") from error
        for one in self._node.set_parameters(wanted):
            if not one.successful:
                raise UsageError(f"parameter {prefix}: refused: {one.reason}")

    def delete(self, prefix: str) -> None:
        """Remove a value or a namespace."""
        self.get(prefix)
        for name in list(self._node._parameters):
            if name == prefix or name.startswith(f"{prefix}."):
                self._node.undeclare_parameter(name)


class OtherParameters:
    """Those of a node elsewhere, by its services."""

    def __init__(self, node: Any, name: str) -> None:
        self._node, self._name = node, name
        self._services = import_module("rcl_interfaces.srv")

    def _call(self, kind: Any, service: str, request: Any) -> Any:
        client = self._node.create_client(kind, f"{self._name}/{service}")
        try:
            if not client.wait_for_service(PATIENCE_S):
                raise LinkSilent(f"node {self._name} offers no parameters")
            ended = threading.Event()
            future = client.call_async(request)
            future.add_done_callback(lambda _: ended.set())
            if not ended.wait(PATIENCE_S):
                raise LinkSilent(f"node {self._name} does not answer about its parameters")
            return future.result()
        finally:
            self._node.destroy_client(client)

    def get(self, prefix: str) -> Any:
        """See ``tree``."""
        kind = self._services.ListParameters
        names = list(self._call(kind, "list_parameters", kind.Request()).result.names)
        kind = self._services.GetParameters
        values = self._call(kind, "get_parameters", kind.Request(names=names)).values
        read: Callable[[Any], Any] = import_module("rclpy.parameter").parameter_value_to_python
        return tree(prefix, {name: _plain(read(value)) for name, value in zip(names, values, strict=True)})

    def set(self, prefix: str, value: Any) -> None:
        """Set a value or a namespace."""
        parameter = import_module("rclpy.parameter").Parameter
        kind = self._services.SetParameters
        wanted = [parameter(name, value=one).to_parameter_msg() for name, one in leaves(prefix, value)]
        for one in self._call(kind, "set_parameters", kind.Request(parameters=wanted)).results:
            if not one.successful:
                raise UsageError(f"parameter {self._name}/{prefix}: refused: {one.reason}")

    def delete(self, prefix: str) -> None:
        """Not possible from outside."""
        raise UsageError(f"parameter {prefix} of {self._name}: in ROS 2 only the node itself can remove it")


def _plain(value: Any) -> Any:
    """Arrays as lists."""
    return value.tolist() if hasattr(value, "tolist") else list(value) if isinstance(value, tuple) else value
