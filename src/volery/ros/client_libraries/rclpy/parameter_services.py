"""The services by which other nodes read and set a node's parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from volery.ros.client_libraries.rclpy.errors import (
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from volery.ros.client_libraries.rclpy.parameters import Parameter
from volery.ros.messages import new
from volery.ros.messages.packages import service_class

if TYPE_CHECKING:
    from volery.ros.client_libraries.rclpy.node import Node

Answer = Callable[["Node", Any, Any], None]


def _get(node: Node, request: Any, response: Any) -> None:
    try:
        response.values = [node.get_parameter(name).get_parameter_value() for name in request.names]
    except (ParameterNotDeclaredException, ParameterUninitializedException):
        response.values = []


def _types(node: Node, request: Any, response: Any) -> None:
    try:
        response.types = [int(node.get_parameter_type(name)) for name in request.names]
    except ParameterNotDeclaredException:
        response.types = []


def _describe(node: Node, request: Any, response: Any) -> None:
    try:
        response.descriptors = node.describe_parameters(request.names)
    except ParameterNotDeclaredException:
        response.descriptors = []


def _list(node: Node, request: Any, response: Any) -> None:
    response.result = node.list_parameters(request.prefixes, request.depth)


def _set(node: Node, request: Any, response: Any) -> None:
    response.results = [_atomically(node, [one]) for one in request.parameters]


def _set_atomically(node: Node, request: Any, response: Any) -> None:
    response.result = _atomically(node, request.parameters)


def _atomically(node: Node, given: list[Any]) -> Any:
    try:
        return node.set_parameters_atomically([Parameter.from_parameter_msg(one) for one in given])
    except ParameterNotDeclaredException as error:
        return new("rcl_interfaces/msg/SetParametersResult", successful=False, reason=str(error))


_SERVICES: dict[str, tuple[str, Answer]] = {
    "describe_parameters": ("DescribeParameters", _describe),
    "get_parameter_types": ("GetParameterTypes", _types),
    "get_parameters": ("GetParameters", _get),
    "list_parameters": ("ListParameters", _list),
    "set_parameters": ("SetParameters", _set),
    "set_parameters_atomically": ("SetParametersAtomically", _set_atomically),
}


def serve_parameters(node: Node) -> None:
    """Serve them below the node's name, in its default callback group."""
    for name, (kind, answer) in _SERVICES.items():
        node.create_service(service_class(f"rcl_interfaces/srv/{kind}"), f"~/{name}", _bound(node, answer))


def _bound(node: Node, answer: Answer) -> Callable[[Any, Any], Any]:
    def callback(request: Any, response: Any) -> Any:
        answer(node, request, response)
        return response

    return callback
