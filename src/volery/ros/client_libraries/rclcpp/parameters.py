"""Handlers of the requests about parameters of rclcpp's nodes, whose rules are those of rclpy's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from volery.base.time import S
from volery.ros.client_libraries.abi_codec import CppFiber, Reader, Writer
from volery.ros.client_libraries.cpp.requests import Simple, WithFiber
from volery.ros.client_libraries.rclcpp.session import RosNode, Session
from volery.ros.client_libraries.rclpy.node_parameters import (
    DeclaredParameters,
    NodeParameters,
    Parameter,
    serve_parameters,
)
from volery.ros.graph import EmbeddedGraph, Publisher, QoS
from volery.ros.messages import from_cdr, new, to_cdr
from volery.ros.messages.client_classes import adopt, library_of

_EVENTS = "/parameter_events"
_PARAMETER = "rcl_interfaces/msg/Parameter"


def read_parameters(arguments: Reader) -> list[Parameter]:
    """Read a list of parameters."""
    count = arguments.integer()
    return [Parameter.from_parameter_msg(from_cdr(_PARAMETER, arguments.raw())) for _ in range(count)]


def write_parameters(writer: Writer, parameters: Sequence[Parameter]) -> Writer:
    """Append a list of parameters."""
    writer.integer(len(parameters))
    for parameter in parameters:
        writer.raw(to_cdr(parameter.to_parameter_msg()))
    return writer


class _Served(NodeParameters):
    """What the services of a node for its parameters use."""

    def __init__(self, declared: DeclaredParameters) -> None:
        self._declared = declared


def create_parameters(
    session: Session, node: RosNode, overrides: list[Parameter], undeclared: bool, served: bool
) -> DeclaredParameters:
    """Return the parameters of a new node.

    Args:
        session: Session of the component.
        node: The node.
        overrides: Values that the file gives, which come before those of the model.
        undeclared: Whether parameters may be set that are not declared.
        served: Whether other nodes read and set them through services.
    """
    events: list[Publisher] = []

    def publish(changed: list[Parameter], new_names: set[str], deleted: list[Parameter]) -> None:
        graph = session.graph
        if not isinstance(graph, EmbeddedGraph) or not graph.has_subscribers(_EVENTS):
            return
        if not events:
            events.append(node.node.advertise(_EVENTS, "rcl_interfaces/msg/ParameterEvent", QoS(1000)))
        seconds, rest = divmod(session.now(), S)
        stamp = {"sec": seconds, "nanosec": rest}
        event = new("rcl_interfaces/msg/ParameterEvent", node=node.node.name, stamp=stamp)
        for one in changed:
            into = event.new_parameters if one.name in new_names else event.changed_parameters
            into.append(one.to_parameter_msg())
        event.deleted_parameters = [one.to_parameter_msg() for one in deleted]
        events[0].publish(event)

    parameters = DeclaredParameters(node.node, overrides, undeclared, publish)
    parameters.declare_builtin("use_sim_time", False)
    if served and isinstance(session.graph, EmbeddedGraph):  # the node of a transport serves them itself
        ready = node.queues[0].ready

        def create_service(kind: Any, name: str, callback: Callable[[Any, Any], Any]) -> object:
            def handler(request: Any) -> Any:
                adopt(request, library_of(kind.Request))
                return callback(request, kind.Response())

            return node.node.serve(name, kind._type, handler, ready)

        serve_parameters(_Served(parameters), create_service)
    return parameters


def _declared(session: Session, arguments: Reader) -> DeclaredParameters:
    found: DeclaredParameters = session.find(arguments.integer(), RosNode).parameters
    return found


def _declare(session: Session, fiber: CppFiber, arguments: Reader) -> bytes:
    declared, name = _declared(session, arguments), arguments.text()
    message = new(_PARAMETER, name=name, value=from_cdr("rcl_interfaces/msg/ParameterValue", arguments.raw()))
    kind = arguments.integer()
    descriptor = from_cdr("rcl_interfaces/msg/ParameterDescriptor", arguments.raw())
    ignore = arguments.flag()
    value = Parameter.Type(kind) if kind else Parameter.from_parameter_msg(message)
    made: list[Parameter] = []
    session.spin(fiber, lambda: made.append(declared.declare(name, value, descriptor, ignore)))
    return write_parameters(Writer(), made).done()


def _get(session: Session, arguments: Reader) -> bytes:
    return write_parameters(Writer(), [_declared(session, arguments).get(arguments.text())]).done()


def _set(session: Session, fiber: CppFiber, arguments: Reader) -> bytes:
    declared, parameters = _declared(session, arguments), read_parameters(arguments)
    results: list[Any] = []
    session.spin(fiber, lambda: results.append(declared.set(parameters)))
    return Writer().raw(to_cdr(results[0])).done()


def _describe(session: Session, arguments: Reader) -> bytes:
    return Writer().raw(to_cdr(_declared(session, arguments).descriptor(arguments.text()))).done()


def _list(session: Session, arguments: Reader) -> bytes:
    declared = _declared(session, arguments)
    prefixes = [arguments.text() for _ in range(arguments.integer())]
    found = _Served(declared).list_parameters(prefixes, arguments.integer())
    return Writer().raw(to_cdr(found)).done()


class _ParameterCallback:
    """A callback of the code in one of the lists of a node's parameters."""

    def __init__(self, callbacks: list[Any], callback: Callable[[list[Parameter]], Any]) -> None:
        self._callbacks, self._callback = callbacks, callback
        callbacks.insert(0, callback)

    def close(self) -> None:
        """Remove the callback."""
        if self._callback in self._callbacks:
            self._callbacks.remove(self._callback)


def _add_callback(session: Session, arguments: Reader) -> int:
    declared, when, number = _declared(session, arguments), arguments.text(), arguments.integer()

    def call(parameters: list[Parameter]) -> Reader:
        return Reader(session.call_back(number, write_parameters(Writer(), parameters).done()))

    def validate(parameters: list[Parameter]) -> Any:
        return from_cdr("rcl_interfaces/msg/SetParametersResult", call(parameters).raw())

    kinds: dict[str, tuple[list[Any], Callable[[list[Parameter]], Any]]] = {
        "pre": (declared.before, lambda parameters: read_parameters(call(parameters))),
        "on": (declared.validators, validate),
        "post": (declared.after, call),
    }
    return session.keep(_ParameterCallback(*kinds[when]))


PARAMETERS: dict[str, Simple[Session]] = {
    "param_get": _get,
    "param_describe": _describe,
    "param_list": _list,
    "param_undeclare": lambda session, arguments: _declared(session, arguments).undeclare(arguments.text()),
}
"""Handlers of requests that may fail with an exception of rclcpp's."""

PARAMETERS_WITH_FIBER: dict[str, WithFiber[Session]] = {"param_declare": _declare, "param_set": _set}
"""The same for requests that call callbacks of the code."""

PLAIN_PARAMETERS: dict[str, Simple[Session]] = {
    "param_has": lambda session, arguments: _declared(session, arguments).has(arguments.text()),
    "param_callback": _add_callback,
}
"""Handlers of requests that do not fail."""
