"""What a parameter's descriptor allows, refused in rclpy's words.

rclpy's parameters: declared, typed, and watched by callbacks.

What an rclpy node does with its parameters.

The services by which other nodes read and set a node's parameters.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Sequence
from enum import IntEnum
from math import isclose
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.ros.client_libraries.rclpy.errors import (
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from volery.ros.graph import Node
from volery.ros.messages import new
from volery.ros.messages.packages import service_class

if TYPE_CHECKING:
    from volery.ros.client_libraries.rclpy.node import Node

_NAMES = (
    "NOT_SET", "BOOL", "INTEGER", "DOUBLE", "STRING",
    "BYTE_ARRAY", "BOOL_ARRAY", "INTEGER_ARRAY", "DOUBLE_ARRAY", "STRING_ARRAY",
)  # fmt: skip
_NEAR = 1e-6
"""How near a double must be to a bound or a step to count as on it, relatively."""


def constraint_violation(one: Parameter, descriptor: Any, *, declared: bool) -> str:
    """Why *one* may not be set; empty if it may. *declared*: it has been there before."""
    if declared and descriptor.read_only:
        return f"Trying to set a read-only parameter: {one.name}."
    if not descriptor.dynamic_typing:
        if declared and not one.type_:
            return "Static parameter cannot be undeclared"
        if one.type_ and descriptor.type and one.type_ != descriptor.type:
            expected, given = _NAMES[descriptor.type], _NAMES[one.type_]
            return f"Wrong parameter type, expected 'Type.{expected}' got 'Type.{given}'"
    whole = isinstance(one.value, int) and not isinstance(one.value, bool)
    if whole and len(descriptor.integer_range):
        return _beyond_integers(one, descriptor.integer_range[0])
    if isinstance(one.value, float) and len(descriptor.floating_point_range):
        return _beyond_doubles(one, descriptor.floating_point_range[0])
    return ""


def _bounds(limits: Any) -> tuple[Any, Any]:
    return min(limits.from_value, limits.to_value), max(limits.from_value, limits.to_value)


def _beyond_integers(one: Parameter, limits: Any) -> str:
    least, most = _bounds(limits)
    if one.value in (least, most):
        return ""
    if not least < one.value < most:
        return f"Parameter {one.name} out of range. Min: {least}, Max: {most}, value: {one.value}"
    if limits.step and (one.value - least) % limits.step:
        return (
            f"The parameter value for {one.name} is not a valid step. "
            f"Min: {least}, max: {most}, value: {one.value}, step: {limits.step}"
        )
    return ""


def _beyond_doubles(one: Parameter, limits: Any) -> str:
    least, most = _bounds(limits)
    if any(isclose(one.value, bound, rel_tol=_NEAR) for bound in (least, most)):
        return ""
    if not least < one.value < most:
        return f"Parameter {one.name} out of range Min: {least}, Max: {most}, value: {one.value}"
    if limits.step:
        nearest = least + round((one.value - least) / limits.step) * limits.step
        if not isclose(nearest, one.value, rel_tol=_NEAR):
            return (
                f"The parameter value for {one.name} is not close enough to a valid step. "
                f"Min: {least}, max: {most}, value: {one.value}, step: {limits.step}"
            )
    return ""


_RESULT = "rcl_interfaces/msg/SetParametersResult"
_DESCRIPTOR = "rcl_interfaces/msg/ParameterDescriptor"


class Parameter:
    """A name with a typed value."""

    class Type(IntEnum):
        """As ``rcl_interfaces/msg/ParameterType``."""

        NOT_SET = 0
        BOOL = 1
        INTEGER = 2
        DOUBLE = 3
        STRING = 4
        BYTE_ARRAY = 5
        BOOL_ARRAY = 6
        INTEGER_ARRAY = 7
        DOUBLE_ARRAY = 8
        STRING_ARRAY = 9

        @classmethod
        def from_parameter_value(cls, value: Any) -> Parameter.Type:
            """The type of a Python value. ``TypeError`` if parameters cannot hold it."""
            found = _type_of(value)
            if found is None:
                raise TypeError(f"The given value {value!r} is not one of the allowed types for a parameter")
            return cls(found)

        def check(self, value: Any) -> bool:
            """Whether *value* is of this type."""
            return _type_of(value) == self or (isinstance(value, list) and not value and self >= 5)

    def __init__(self, name: str, type_: Parameter.Type | None = None, value: Any = None) -> None:
        value = list(value) if isinstance(value, (tuple, array, np.ndarray)) else value
        self.name, self.value = name, value
        self.type_ = Parameter.Type.from_parameter_value(value) if type_ is None else Parameter.Type(type_)
        if not self.type_.check(value):
            raise ValueError(f"Type '{self.type_.name}' and value '{value}' do not agree")

    @classmethod
    def from_parameter_msg(cls, message: Any) -> Parameter:
        """From ``rcl_interfaces/msg/Parameter``."""
        kind = Parameter.Type(message.value.type)
        value: Any = getattr(message.value, f"{kind.name.lower()}_value") if kind else None
        if kind is Parameter.Type.BYTE_ARRAY:
            value = bytes(value)
        elif isinstance(value, np.ndarray):
            value = value.tolist()
        return cls(message.name, kind, value)

    def get_parameter_value(self) -> Any:
        """As ``rcl_interfaces/msg/ParameterValue``."""
        message = new("rcl_interfaces/msg/ParameterValue", type=int(self.type_))
        if self.type_:
            setattr(message, f"{self.type_.name.lower()}_value", self.value)
        return message

    def to_parameter_msg(self) -> Any:
        """As ``rcl_interfaces/msg/Parameter``."""
        return new("rcl_interfaces/msg/Parameter", name=self.name, value=self.get_parameter_value())

    def __repr__(self) -> str:
        return f"Parameter({self.name!r}, {self.type_.name}, {self.value!r})"


def _type_of(value: Any) -> int | None:
    kinds = ((type(None), 0), (bool, 1), (int, 2), (float, 3), (str, 4), (bytes, 5))
    single = next((number for kind, number in kinds if isinstance(value, kind)), None)
    if single is not None or not isinstance(value, list):
        return single
    inner = {_type_of(item) for item in value}
    if len(inner) > 1:
        return None
    return {1: 6, 2: 7, 3: 8, 4: 9, 5: 5}.get(next(iter(inner), 5) or -1)


Watcher = Callable[[list[Parameter]], Any]


class DeclaredParameters:
    """The parameters of one node. What a launch file says overrides what is declared."""

    def __init__(self, node: Node, overrides: Iterable[Parameter], undeclared_allowed: bool) -> None:
        self._node = node
        self._undeclared_allowed = undeclared_allowed
        self._overrides = {one.name: one.value for one in overrides}
        self._parameters: dict[str, Parameter] = {}
        self._descriptors: dict[str, Any] = {}
        self._watchers: list[Watcher] = []

    def watch(self, callback: Watcher) -> None:
        """Ask it before values are set; it may refuse."""
        self._watchers.insert(0, callback)

    def unwatch(self, callback: Watcher) -> None:
        """Ask it no longer; ``ValueError`` if it was not asked."""
        self._watchers.remove(callback)

    def _private(self, name: str) -> str:
        if not name or not all(name.split(".")):
            raise InvalidParameterException(name)
        return f"~{name.replace('.', '/')}"

    def declare(
        self, name: str, value: Any = None, descriptor: Any = None, ignore: bool = False
    ) -> Parameter:
        """See ``Node.declare_parameter``."""
        if name in self._parameters:
            raise ParameterAlreadyDeclaredException([name])
        private = self._private(name)
        kind = value if isinstance(value, Parameter.Type) else None
        if isinstance(value, type) and issubclass(value, (bool, int, float, str)):
            kind = Parameter.Type.from_parameter_value(value())
        default = None if kind is not None else value
        given = default if ignore else self._given(name, private, default)
        described = self._descriptors[name] = descriptor or new(_DESCRIPTOR)
        if kind is None and given is not None and not described.dynamic_typing:
            kind = Parameter(name, value=default if default is not None else given).type_
        described.name, described.type = name, int(kind or 0)
        parameter = Parameter(name, kind if given is not None else None, self._fitting(kind, given))
        refused = self._refused([parameter])
        if refused.startswith("Wrong parameter type"):
            raise InvalidParameterTypeException(parameter, Parameter.Type(described.type).name)
        if refused:
            raise InvalidParameterValueException(name, given, refused)
        self._keep(parameter)
        return parameter

    def _given(self, name: str, private: str, default: Any) -> Any:
        if name in self._overrides:
            return self._overrides[name]
        return self._node.get_parameter(private) if self._node.has_parameter(private) else default

    def _fitting(self, kind: Parameter.Type | None, value: Any) -> Any:
        """A whole number in a launch file is a double where one was declared."""
        whole = isinstance(value, int) and not isinstance(value, bool)
        return float(value) if kind is Parameter.Type.DOUBLE and whole else value

    def _keep(self, parameter: Parameter) -> None:
        self._parameters[parameter.name] = parameter
        if parameter.value is not None:
            self._node.set_parameter(self._private(parameter.name), parameter.value)

    def has(self, name: str) -> bool:
        """Whether it is declared."""
        return name in self._parameters

    def names(self) -> list[str]:
        """All that are declared, in order."""
        return list(self._parameters)

    def get(self, name: str) -> Parameter:
        """Its value now."""
        found = self._parameters.get(name)
        if found is None:
            if self._undeclared_allowed:
                return Parameter(name)
            raise ParameterNotDeclaredException(name)
        if found.value is None and self._descriptors[name].type:
            raise ParameterUninitializedException(name)
        return found

    def descriptor(self, name: str) -> Any:
        """Its description."""
        if name not in self._descriptors:
            raise ParameterNotDeclaredException(name)
        return self._descriptors[name]

    def forget(self, name: str) -> None:
        """Undeclare it."""
        if name not in self._parameters:
            raise ParameterNotDeclaredException(name)
        if self._descriptors[name].read_only:
            raise ParameterImmutableException(name)
        del self._parameters[name], self._descriptors[name]
        if self._node.has_parameter(self._private(name)):
            self._node.delete_parameter(self._private(name))

    def set(self, parameters: Sequence[Parameter]) -> Any:
        """All or none; a ``SetParametersResult``."""
        unknown = [one.name for one in parameters if one.name not in self._parameters]
        if unknown and not self._undeclared_allowed:
            raise ParameterNotDeclaredException(unknown)
        why = self._refused(list(parameters))
        if why:
            return new(_RESULT, successful=False, reason=why)
        for parameter in parameters:
            kind = int(parameter.type_)
            self._descriptors.setdefault(parameter.name, new(_DESCRIPTOR, name=parameter.name, type=kind))
            self._keep(parameter)
        return new(_RESULT, successful=True)

    def _refused(self, parameters: list[Parameter]) -> str:
        for one in parameters:
            descriptor = self._descriptors.get(one.name)
            why = (
                ""
                if descriptor is None
                else constraint_violation(one, descriptor, declared=one.name in self._parameters)
            )
            if why:
                return why
        for watcher in self._watchers:
            result = watcher(parameters)
            if not result.successful:
                return result.reason or "a callback refused it"
        return ""


class NodeParameters:
    """The part of ``Node`` that is about parameters."""

    _declared: DeclaredParameters

    def declare_parameter(
        self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter:
        """Declare a parameter with its default; what a launch file gives comes first."""
        return self._declared.declare(name, value, descriptor, ignore_override)

    def declare_parameters(
        self, namespace: str, parameters: Sequence[tuple[Any, ...]], ignore_override: bool = False
    ) -> list[Parameter]:
        """Several: ``(name,)``, ``(name, value)`` or ``(name, value, descriptor)``."""
        prefix = f"{namespace}." if namespace else ""
        declared = []
        for name, *rest in parameters:
            value, descriptor = (*rest, None, None)[:2]
            declared.append(self._declared.declare(prefix + name, value, descriptor, ignore_override))
        return declared

    def undeclare_parameter(self, name: str) -> None:
        """Forget it."""
        self._declared.forget(name)

    def has_parameter(self, name: str) -> bool:
        """Whether it is declared."""
        return self._declared.has(name)

    def get_parameter(self, name: str) -> Parameter:
        """Its value now."""
        return self._declared.get(name)

    def get_parameters(self, names: Sequence[str]) -> list[Parameter]:
        """Several."""
        return [self._declared.get(name) for name in names]

    def get_parameter_or(self, name: str, alternative_value: Parameter | None = None) -> Parameter:
        """Its value now, or the alternative."""
        known = self._declared.has(name)
        return self._declared.get(name) if known else alternative_value or Parameter(name)

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter]:
        """Those below *prefix*, without it."""
        start = f"{prefix}." if prefix else ""
        names = [name for name in self._declared.names() if name.startswith(start)]
        return {name.removeprefix(start): self._declared.get(name) for name in names}

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> list[Any]:
        """Each for itself."""
        return [self._declared.set([one]) for one in parameter_list]

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> Any:
        """All or none."""
        return self._declared.set(parameter_list)

    def describe_parameter(self, name: str) -> Any:
        """Its descriptor."""
        return self._declared.descriptor(name)

    def add_on_set_parameters_callback(self, callback: Watcher) -> Watcher:
        """Ask it before values are set."""
        self._declared.watch(callback)
        return callback

    def remove_on_set_parameters_callback(self, callback: Watcher) -> None:
        """Ask it no longer."""
        self._declared.unwatch(callback)

    def get_parameter_type(self, name: str) -> Parameter.Type:
        """The type of its value now."""
        return self._declared.get(name).type_

    def get_parameter_types(self, names: Sequence[str]) -> list[Parameter.Type]:
        """Several."""
        return [self.get_parameter_type(name) for name in names]

    def describe_parameters(self, names: Sequence[str]) -> list[Any]:
        """Several descriptors."""
        return [self._declared.descriptor(name) for name in names]

    def list_parameters(self, prefixes: Sequence[str], depth: int) -> Any:
        """A ``ListParametersResult``: names at most *depth* levels below a prefix (0: all levels)."""
        result = new("rcl_interfaces/msg/ListParametersResult")
        for name in self._declared.names():
            if any(_is_below(name, prefix, depth) for prefix in prefixes or ("",)):
                result.names.append(name)
                above = name.rpartition(".")[0]
                if above and above not in result.prefixes:
                    result.prefixes.append(above)
        return result


def _is_below(name: str, prefix: str, depth: int) -> bool:
    if name == prefix:
        return True
    start = f"{prefix}." if prefix else ""
    return name.startswith(start) and (not depth or name.removeprefix(start).count(".") < depth)


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
