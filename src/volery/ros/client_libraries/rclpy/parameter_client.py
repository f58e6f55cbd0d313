"""Parameters of other nodes: ``rclpy.parameter_client``, ``rclpy.parameter_event_handler``, files of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from volery.base.time import from_seconds
from volery.ros.client_libraries.rclpy.executors import CallbackGroup, Future
from volery.ros.client_libraries.rclpy.node import Node
from volery.ros.client_libraries.rclpy.node_parameters import Parameter, flat
from volery.ros.client_libraries.rclpy.qos import qos_profile_parameter_events
from volery.ros.messages import message_class, new
from volery.ros.messages.client_classes import service_of
from volery.ros.messages.store import distribution

# -- values in text


def _yaml(text: str) -> Any:
    return YAML(typ="safe", pure=True).load(text)


def get_parameter_value(string_value: str) -> Any:
    """Return the ``ParameterValue`` of a text, which is read as YAML."""
    try:
        found = _yaml(string_value)
        return Parameter("", value=string_value if found is None else found).get_parameter_value()
    except (YAMLError, TypeError):
        return Parameter("", value=string_value).get_parameter_value()


def parameter_value_to_python(parameter_value: Any) -> Any:
    """Return the value in a ``ParameterValue``."""
    return Parameter.from_parameter_msg(new("rcl_interfaces/msg/Parameter", value=parameter_value)).value


def parameter_dict_from_yaml_file(
    parameter_file: str,
    use_wildcard: bool = False,
    target_nodes: Sequence[str] | None = None,
    namespace: str = "",
) -> dict[str, Any]:
    """Return the parameters in a file by their names, as ``rcl_interfaces/msg/Parameter``.

    Args:
        parameter_file: A file of ROS 2: nodes with ``ros__parameters``.
        use_wildcard: Whether the parameters of the node ``/**`` count, too.
        target_nodes: Full names of the nodes whose parameters count; None for all.
        namespace: Put before each name.

    Raises:
        RuntimeError: The file has no parameters for these nodes.
    """
    content = _yaml(Path(parameter_file).read_text(encoding="utf-8")) or {}
    nodes = [name for name in content if name != "/**"]
    wanted = nodes if target_nodes is None else [name for name in target_nodes if name in content]
    if target_nodes is not None and not wanted and not (use_wildcard and "/**" in content):
        raise RuntimeError(
            f"Param file does not contain parameters for {', '.join(target_nodes)},"
            f"only for nodes: {list(content)}"
        )
    found: dict[str, Any] = {}
    for name in (*(["/**"] if use_wildcard and "/**" in content else []), *wanted):
        if "ros__parameters" not in (content[name] or {}):
            raise RuntimeError(f"YAML file is not a valid ROS parameter file for node {name}")
        for key, value in flat(content[name]["ros__parameters"], namespace):
            found[key] = Parameter(key, value=value).to_parameter_msg()
    return found


PARAMETER_TEXTS: dict[str, Any] = {
    "PARAMETER_SEPARATOR_STRING": ".",
    **{
        one.__name__: one
        for one in (get_parameter_value, parameter_dict_from_yaml_file, parameter_value_to_python)
    },
}
"""Part of ``rclpy.parameter``."""


# -- a client

_KINDS = {
    "get_parameters": "GetParameters",
    "set_parameters": "SetParameters",
    "set_parameters_atomically": "SetParametersAtomically",
    "list_parameters": "ListParameters",
    "describe_parameters": "DescribeParameters",
    "get_parameter_types": "GetParameterTypes",
}
Done = Callable[[Future], Any] | None
_READS_ITS_NODE = distribution() not in ("humble", "iron", "jazzy")
"""Whether a client takes the parameters of its node alone from a file; before Kilted it takes all."""


class AsyncParameterClient:
    """Reads and sets the parameters of another node by its services; each call returns a future."""

    def __init__(
        self,
        node: Node,
        remote_node_name: str,
        qos_profile: Any = None,
        callback_group: CallbackGroup | None = None,
    ) -> None:
        self.node, self.remote_node_name = node, remote_node_name
        self._clients = {
            name: node.create_client(
                service_of(f"rcl_interfaces/srv/{kind}"),
                f"{remote_node_name}/{name}",
                callback_group=callback_group,
            )
            for name, kind in _KINDS.items()
        }

    def services_are_ready(self) -> bool:
        """Return whether the other node serves its parameters."""
        return all(client.service_is_ready() for client in self._clients.values())

    def wait_for_services(self, timeout_sec: float | None = None) -> bool:
        """Block until the other node serves its parameters; return False after a time-out."""
        kernel = self.node.context.kernel
        until = None if timeout_sec is None else kernel.now() + from_seconds(timeout_sec)
        for client in self._clients.values():
            left = None if until is None else max(0, until - kernel.now()) / 1e9
            if not client.wait_for_service(left):
                return False
        return True

    def _call(self, name: str, callback: Done, **fields: Any) -> Future:
        client = self._clients[name]
        future = client.call_async(client.srv_type.Request(**fields))
        if callback is not None:
            future.add_done_callback(callback)
        return future

    def get_parameters(self, names: Sequence[str], callback: Done = None) -> Future:
        """Request values."""
        return self._call("get_parameters", callback, names=list(names))

    def get_parameter_types(self, names: Sequence[str], callback: Done = None) -> Future:
        """Request types."""
        return self._call("get_parameter_types", callback, names=list(names))

    def describe_parameters(self, names: Sequence[str], callback: Done = None) -> Future:
        """Request descriptors."""
        return self._call("describe_parameters", callback, names=list(names))

    def list_parameters(
        self, prefixes: Sequence[str] | None = None, depth: int | None = None, callback: Done = None
    ) -> Future:
        """Request the names of parameters."""
        return self._call("list_parameters", callback, prefixes=list(prefixes or ()), depth=depth or 0)

    def set_parameters(self, parameters: Sequence[Any], callback: Done = None) -> Future:
        """Set each parameter independently of the others."""
        return self._call("set_parameters", callback, parameters=_messages(parameters))

    def set_parameters_atomically(self, parameters: Sequence[Any], callback: Done = None) -> Future:
        """Set all parameters or none."""
        return self._call("set_parameters_atomically", callback, parameters=_messages(parameters))

    def delete_parameters(self, names: Sequence[str], callback: Done = None) -> Future:
        """Set parameters to nothing, which nodes allow for those of dynamic type."""
        return self.set_parameters([Parameter(name) for name in names], callback)

    def load_parameter_file(
        self, parameter_file: str, use_wildcard: bool = False, callback: Done = None
    ) -> Future:
        """Set the parameters that a file has for the node."""
        return self.set_parameters(self._of_file(parameter_file, use_wildcard), callback)

    def load_parameter_file_atomically(
        self, parameter_file: str, use_wildcard: bool = False, callback: Done = None
    ) -> Future:
        """Set the parameters that a file has for the node, all or none."""
        return self.set_parameters_atomically(self._of_file(parameter_file, use_wildcard), callback)

    def _of_file(self, parameter_file: str, use_wildcard: bool) -> list[Any]:
        name = f"/{self.remote_node_name.removeprefix('/')}"
        nodes = [name] if _READS_ITS_NODE else None
        return list(parameter_dict_from_yaml_file(parameter_file, use_wildcard, nodes).values())

    def on_parameter_event(
        self, callback: Callable[[Any], Any], qos_profile: Any = None, **options: Any
    ) -> Any:
        """Subscribe to the changes of the parameters of all nodes."""
        return _on_events(self.node, callback, qos_profile, options)


def _messages(parameters: Sequence[Any]) -> list[Any]:
    return [
        parameter.to_parameter_msg() if isinstance(parameter, Parameter) else parameter
        for parameter in parameters
    ]


def _on_events(node: Node, callback: Callable[[Any], Any], qos_profile: Any, options: dict[str, Any]) -> Any:
    kind = message_class("rcl_interfaces/msg/ParameterEvent")
    used = qos_profile or qos_profile_parameter_events
    return node.create_subscription(kind, "/parameter_events", callback, used, **options)


# -- events


@dataclass(eq=False)
class ParameterCallbackHandle:
    """A callback for one parameter of one node."""

    parameter_name: str
    node_name: str
    callback: Callable[[Any], Any]


@dataclass(eq=False)
class ParameterEventCallbackHandle:
    """A callback for all changes of parameters."""

    callback: Callable[[Any], Any]


class ParameterEventHandler:
    """Calls back when parameters change, of any node."""

    def __init__(self, node: Node, qos_profile: Any = None, **options: Any) -> None:
        self.node = node
        self._one: list[ParameterCallbackHandle] = []
        self._all: list[ParameterEventCallbackHandle] = []
        self._subscription = _on_events(node, self._on_event, qos_profile, options)

    def _full(self, node_name: str) -> str:
        if not node_name:
            return self.node.get_fully_qualified_name()
        above = self.node.get_namespace().rstrip("/")
        return node_name if node_name.startswith("/") else f"{above}/{node_name}"

    def _on_event(self, event: Any) -> None:
        for one in list(self._one):
            found = self.get_parameter_from_event(event, one.parameter_name, one.node_name)
            if found is not None:
                one.callback(found)
        for each in list(self._all):
            each.callback(event)

    @staticmethod
    def get_parameters_from_event(event: Any) -> list[Any]:
        """Return the new and the changed parameters of an event."""
        return [*event.new_parameters, *event.changed_parameters]

    @staticmethod
    def get_parameter_from_event(event: Any, parameter_name: str, node_name: str) -> Any:
        """Return a parameter of a node if an event is about it, or None."""
        if event.node != node_name:
            return None
        found = ParameterEventHandler.get_parameters_from_event(event)
        return next((one for one in found if one.name == parameter_name), None)

    def add_parameter_callback(
        self, parameter_name: str, node_name: str, callback: Callable[[Any], Any]
    ) -> ParameterCallbackHandle:
        """Call *callback* with each new value of a parameter of a node; "" is this node."""
        handle = ParameterCallbackHandle(parameter_name, self._full(node_name), callback)
        self._one.insert(0, handle)
        return handle

    def add_parameter_event_callback(self, callback: Callable[[Any], Any]) -> ParameterEventCallbackHandle:
        """Call *callback* with each event."""
        handle = ParameterEventCallbackHandle(callback)
        self._all.insert(0, handle)
        return handle

    def remove_parameter_callback(self, handle: ParameterCallbackHandle) -> None:
        """Remove a callback; raise ``ValueError`` if it was not added."""
        self._one.remove(handle)

    def remove_parameter_event_callback(self, handle: ParameterEventCallbackHandle) -> None:
        """Remove a callback; raise ``ValueError`` if it was not added."""
        self._all.remove(handle)

    def destroy(self) -> None:
        """Remove the subscription."""
        self.node.destroy_subscription(self._subscription)


PARAMETER_CLIENT = {"AsyncParameterClient": AsyncParameterClient}
"""Content of ``rclpy.parameter_client``."""
PARAMETER_EVENTS = {
    kind.__name__: kind
    for kind in (ParameterCallbackHandle, ParameterEventCallbackHandle, ParameterEventHandler)
}
"""Content of ``rclpy.parameter_event_handler``."""
