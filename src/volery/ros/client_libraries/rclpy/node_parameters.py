"""Parameters of rclpy: values, declarations with constraints, methods of the node, and services."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import IntEnum
from math import isclose
from typing import Any

import numpy as np

from volery.ros.client_libraries.rclpy.context import (
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
    private_name,
)
from volery.ros.graph import Node
from volery.ros.messages import new
from volery.ros.messages.client_classes import service_of

_RESULT = "rcl_interfaces/msg/SetParametersResult"
_DESCRIPTOR = "rcl_interfaces/msg/ParameterDescriptor"


class Parameter:
    """A name with a typed value."""

    class Type(IntEnum):
        """Parameter types of ``rcl_interfaces/msg/ParameterType``."""

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
            """Return the type of a Python value; raise ``TypeError`` if parameters cannot hold it."""
            found = _type_of(value)
            if found is None:
                raise TypeError(f"The given value {value!r} is not one of the allowed types for a parameter")
            return cls(found)

        def check(self, value: Any) -> bool:
            """Return whether *value* is of this type."""
            if isinstance(value, bool) and self is Parameter.Type.INTEGER:
                return True  # an int, as rclpy tests it
            empty = isinstance(value, _SEQUENCES) and not len(value)
            return _type_of(value) == self or (empty and self >= Parameter.Type.BYTE_ARRAY)

    def __init__(self, name: str, type_: Parameter.Type | None = None, value: Any = None) -> None:
        value = value.tolist() if isinstance(value, np.ndarray) else value
        self.name, self.value = name, value
        self.type_ = Parameter.Type.from_parameter_value(value) if type_ is None else Parameter.Type(type_)
        if not self.type_.check(value):
            raise ValueError(f"Type '{self.type_.name}' and value '{value}' do not agree")

    @classmethod
    def from_parameter_msg(cls, message: Any) -> Parameter:
        """Return the parameter in an ``rcl_interfaces/msg/Parameter``."""
        kind = Parameter.Type(message.value.type)
        value: Any = getattr(message.value, f"{kind.name.lower()}_value") if kind else None
        if kind is Parameter.Type.BYTE_ARRAY:
            value = bytes(value)
        elif isinstance(value, np.ndarray):
            value = value.tolist()
        return cls(message.name, kind, value)

    def get_parameter_value(self) -> Any:
        """Return the value as ``rcl_interfaces/msg/ParameterValue``."""
        message = new("rcl_interfaces/msg/ParameterValue", type=int(self.type_))
        if self.type_:
            value = list(self.value) if isinstance(self.value, _SEQUENCES) else self.value
            setattr(message, f"{self.type_.name.lower()}_value", value)
        return message

    def to_parameter_msg(self) -> Any:
        """Return the parameter as ``rcl_interfaces/msg/Parameter``."""
        return new("rcl_interfaces/msg/Parameter", name=self.name, value=self.get_parameter_value())

    def __repr__(self) -> str:
        return f"Parameter({self.name!r}, {self.type_.name}, {self.value!r})"


_SEQUENCES = (list, tuple, array)


def _type_of(value: Any) -> int | None:
    kinds = ((type(None), 0), (bool, 1), (int, 2), (float, 3), (str, 4), (bytes, 5))
    single = next((number for kind, number in kinds if isinstance(value, kind)), None)
    if single is not None or not isinstance(value, _SEQUENCES):
        return single
    inner = {_type_of(item) for item in value}
    if len(inner) > 1:
        return None
    return {1: 6, 2: 7, 3: 8, 4: 9, 5: 5}.get(next(iter(inner), 5) or -1)


# -- constraints of descriptors, with rclpy's texts

_NEAR = 1e-6
"""Relative distance within which a double counts as equal to a bound or a step."""


def constraint_violation(parameter: Parameter, descriptor: Any, *, declared: bool) -> str:
    """Return why *descriptor* forbids to set *parameter*, or ``""``.

    Args:
        parameter: The new value.
        descriptor: An ``rcl_interfaces/msg/ParameterDescriptor``.
        declared: Whether the parameter is already declared.
    """
    kind, value = parameter.type_, parameter.value
    if declared and descriptor.read_only:
        return f"Trying to set a read-only parameter: {parameter.name}."
    if not descriptor.dynamic_typing:
        if declared and not kind:
            return "Static parameter cannot be undeclared"
        if kind and descriptor.type and kind != descriptor.type:
            expected = Parameter.Type(descriptor.type).name
            return f"Wrong parameter type, expected 'Type.{expected}' got 'Type.{kind.name}'"
    if isinstance(value, int) and not isinstance(value, bool) and len(descriptor.integer_range):
        return _integer_violation(parameter, descriptor.integer_range[0])
    if isinstance(value, float) and len(descriptor.floating_point_range):
        return _double_violation(parameter, descriptor.floating_point_range[0])
    return ""


def _bounds(limits: Any) -> tuple[Any, Any]:
    return min(limits.from_value, limits.to_value), max(limits.from_value, limits.to_value)


def _integer_violation(one: Parameter, limits: Any) -> str:
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


def _double_violation(one: Parameter, limits: Any) -> str:
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


def flat(values: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the parameters of a dictionary of dictionaries by their names, with dots."""
    for key, value in values.items():
        name = f"{above}.{key}" if above else str(key)
        if isinstance(value, Mapping):
            yield from flat(value, name)
        else:
            yield name, value


# -- declared parameters of a node

Validator = Callable[[list[Parameter]], Any]
"""A callback that accepts or refuses new values with a ``SetParametersResult``."""


Changed = Callable[[list[Parameter], set[str], list[Parameter]], None]
"""Called with the parameters that were set, the names of those that are new, and the deleted parameters."""


class DeclaredParameters:
    """The declared parameters of one node. Values of a launch file override declared defaults."""

    def __init__(
        self, node: Node, overrides: Iterable[Parameter], undeclared_allowed: bool, changed: Changed
    ) -> None:
        self._node = node
        self._changed = changed
        self._undeclared_allowed = undeclared_allowed
        self._overrides = {override.name: override.value for override in overrides}
        self._parameters: dict[str, Parameter] = {}
        self._descriptors: dict[str, Any] = {}
        self.before: list[Callable[[list[Parameter]], list[Parameter]]] = []
        """Functions that change what is to be set."""
        self.validators: list[Validator] = []
        """Functions that accept or refuse it."""
        self.after: list[Callable[[list[Parameter]], None]] = []
        """Functions that get what has been set."""

    def declare_overrides(self, launched: Mapping[str, Any]) -> None:
        """Declare what the file overrides, and what the model or a launch file states."""
        stated = {name: list(value) if isinstance(value, tuple) else value for name, value in flat(launched)}
        for name, value in {**stated, **self._overrides}.items():
            if name not in self._parameters:
                self.declare(name, value)

    def all(self) -> dict[str, Parameter]:
        """Return the declared parameters by name."""
        return dict(self._parameters)

    def declare_builtin(self, name: str, value: Any) -> None:
        """Declare a parameter that every node has."""
        if self._override(name, self._private(name), None) is not None:
            self.declare(name, value)
            return
        self._descriptors[name] = new(_DESCRIPTOR, name=name, type=int(Parameter(name, value=value).type_))
        self._parameters[name] = Parameter(name, value=value)

    def _private(self, name: str) -> str:
        if not name or not all(name.split(".")):
            raise InvalidParameterException(name)
        return private_name(name)

    def declare(
        self, name: str, value: Any = None, descriptor: Any = None, ignore: bool = False
    ) -> Parameter:
        """Declare a parameter; see ``Node.declare_parameter``."""
        if name in self._parameters:
            raise ParameterAlreadyDeclaredException([name])
        private = self._private(name)
        kind = value if isinstance(value, Parameter.Type) else None
        if isinstance(value, type) and issubclass(value, (bool, int, float, str)):
            kind = Parameter.Type.from_parameter_value(value())
        default = None if kind is not None else value
        typed: Parameter.Type | None = None  # that of a default of rclcpp, whose empty lists have one, too
        if isinstance(default, Parameter):
            default, typed = default.value, default.type_
        given = default if ignore else self._override(name, private, default)
        described = self._descriptors[name] = descriptor or new(_DESCRIPTOR)
        if kind is None and given is not None and not described.dynamic_typing:
            kind = typed or Parameter(name, value=default if default is not None else given).type_
        described.name, described.type = name, int(kind or 0)
        # rclpy converts nothing: 50 from a launch file does not fit a double. Only an empty list has no type.
        empty = kind is not None and isinstance(given, _SEQUENCES) and not len(given)
        parameter = Parameter(name, kind if empty else None, given)
        refusal = self._refusal([parameter])
        if refusal.startswith("Wrong parameter type"):
            raise InvalidParameterTypeException(parameter, Parameter.Type(described.type).name)
        if refusal:
            raise InvalidParameterValueException(name, given, refusal)
        self._keep(parameter)
        self._changed([parameter], {name}, [])
        return parameter

    def _override(self, name: str, private: str, default: Any) -> Any:
        if name in self._overrides:
            return self._overrides[name]
        if not self._node.has_parameter(private):
            return default
        parameter = self._node.get_parameter(private)
        if isinstance(parameter, dict):
            return default  # others are below this name
        return list(parameter) if isinstance(parameter, tuple) else parameter

    def _keep(self, parameter: Parameter) -> None:
        self._parameters[parameter.name] = parameter
        if parameter.value is not None:
            self._node.set_parameter(self._private(parameter.name), parameter.value)

    def has(self, name: str) -> bool:
        """Return whether a parameter is declared."""
        return name in self._parameters

    def names(self) -> list[str]:
        """Return the names of all declared parameters in the order of their declaration."""
        return list(self._parameters)

    def get(self, name: str) -> Parameter:
        """Return the current value of a parameter."""
        parameter = self._parameters.get(name)
        if parameter is None:
            if self._undeclared_allowed:
                return Parameter(name)
            raise ParameterNotDeclaredException(name)
        if parameter.value is None and self._descriptors[name].type:
            raise ParameterUninitializedException(name)
        return parameter

    def descriptor(self, name: str) -> Any:
        """Return the descriptor of a parameter."""
        if name not in self._descriptors:
            raise ParameterNotDeclaredException(name)
        return self._descriptors[name]

    def describe(self, name: str, descriptor: Any, alternative: Any) -> Any:
        """Replace a descriptor; see ``Node.set_descriptor``."""
        if self.descriptor(name).read_only:
            raise ParameterImmutableException(name)
        current = self.get(name)
        descriptor.name, descriptor.type = name, int(current.type_)
        self._descriptors[name] = descriptor
        if constraint_violation(current, descriptor, declared=False) and alternative is not None:
            current = Parameter.from_parameter_msg(
                new("rcl_interfaces/msg/Parameter", name=name, value=alternative)
            )
            self._keep(current)
        return current.get_parameter_value()

    def undeclare(self, name: str) -> None:
        """Remove a parameter."""
        if name not in self._parameters:
            raise ParameterNotDeclaredException(name)
        if self._descriptors[name].read_only:
            raise ParameterImmutableException(name)
        gone = self._parameters.pop(name)
        del self._descriptors[name]
        if self._node.has_parameter(self._private(name)):
            self._node.delete_parameter(self._private(name))
        self._changed([], set(), [gone])

    def set(self, parameters: Sequence[Parameter]) -> Any:
        """Set all parameters or none; return a ``SetParametersResult``."""
        for prepare in self.before:
            parameters = prepare(list(parameters))
            if not parameters:
                return new(_RESULT, successful=False, reason="parameter list was modified to be empty")
        unknown = [parameter.name for parameter in parameters if parameter.name not in self._parameters]
        if unknown and not self._undeclared_allowed:
            raise ParameterNotDeclaredException(unknown)
        refusal = self._refusal(list(parameters))
        if refusal:
            return new(_RESULT, successful=False, reason=refusal)
        for parameter in parameters:
            kind = int(parameter.type_)
            self._descriptors.setdefault(parameter.name, new(_DESCRIPTOR, name=parameter.name, type=kind))
            self._keep(parameter)
        self._changed(list(parameters), set(unknown), [])
        for tell in self.after:
            tell(list(parameters))
        return new(_RESULT, successful=True)

    def _refusal(self, parameters: list[Parameter]) -> str:
        for parameter in parameters:
            if parameter.name in self._descriptors:
                declared = parameter.name in self._parameters
                violation = constraint_violation(
                    parameter, self._descriptors[parameter.name], declared=declared
                )
                if violation:
                    return violation
        for validator in self.validators:
            result = validator(parameters)
            if not result.successful:
                return result.reason or "a callback refused it"
        return ""


# -- methods of a node


class NodeParameters:
    """The methods of ``Node`` that concern parameters."""

    _declared: DeclaredParameters

    @property
    def _parameters(self) -> dict[str, Parameter]:
        """The parameters by name, as files read them that look behind rclpy's interface."""
        return self._declared.all()

    def declare_parameter(
        self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter:
        """Declare a parameter with its default value; the value of a launch file takes precedence."""
        return self._declared.declare(name, value, descriptor, ignore_override)

    def declare_parameters(
        self, namespace: str, parameters: Sequence[tuple[Any, ...]], ignore_override: bool = False
    ) -> list[Parameter]:
        """Declare parameters given as ``(name,)``, ``(name, value)`` or ``(name, value, descriptor)``."""
        prefix = f"{namespace}." if namespace else ""
        declared = []
        for name, *rest in parameters:
            value, descriptor = (*rest, None, None)[:2]
            declared.append(self._declared.declare(prefix + name, value, descriptor, ignore_override))
        return declared

    def undeclare_parameter(self, name: str) -> None:
        """Remove a parameter."""
        self._declared.undeclare(name)

    def has_parameter(self, name: str) -> bool:
        """Return whether a parameter is declared."""
        return self._declared.has(name)

    def get_parameter(self, name: str) -> Parameter:
        """Return the current value of a parameter."""
        return self._declared.get(name)

    def get_parameters(self, names: Sequence[str]) -> list[Parameter]:
        """Return the current values of parameters."""
        return [self._declared.get(name) for name in names]

    def get_parameter_or(self, name: str, alternative_value: Parameter | None = None) -> Parameter:
        """Return the current value of a parameter, or the alternative if it is not declared."""
        known = self._declared.has(name)
        return self._declared.get(name) if known else alternative_value or Parameter(name)

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter]:
        """Return the parameters below *prefix* by their names without it."""
        start = f"{prefix}." if prefix else ""
        names = [name for name in self._declared.names() if name.startswith(start)]
        return {name.removeprefix(start): self._declared.get(name) for name in names}

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> list[Any]:
        """Set each parameter independently of the others."""
        return [self._declared.set([one]) for one in parameter_list]

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> Any:
        """Set all parameters or none."""
        return self._declared.set(parameter_list)

    def describe_parameter(self, name: str) -> Any:
        """Return the descriptor of a parameter."""
        return self._declared.descriptor(name)

    def describe_parameters(self, names: Sequence[str]) -> list[Any]:
        """Return the descriptors of parameters."""
        return [self._declared.descriptor(name) for name in names]

    def add_on_set_parameters_callback(self, callback: Validator) -> None:
        """Call *callback* before values are set; it may refuse them."""
        self._declared.validators.insert(0, callback)

    def remove_on_set_parameters_callback(self, callback: Validator) -> None:
        """Remove a callback; raise ``ValueError`` if it was not added."""
        self._declared.validators.remove(callback)

    def add_pre_set_parameters_callback(self, callback: Callable[[list[Parameter]], list[Parameter]]) -> None:
        """Let *callback* change what is to be set, before it is checked."""
        self._declared.before.insert(0, callback)

    def remove_pre_set_parameters_callback(
        self, callback: Callable[[list[Parameter]], list[Parameter]]
    ) -> None:
        """Remove a callback; raise ``ValueError`` if it was not added."""
        self._declared.before.remove(callback)

    def add_post_set_parameters_callback(self, callback: Callable[[list[Parameter]], None]) -> None:
        """Call *callback* after values were set."""
        self._declared.after.insert(0, callback)

    def remove_post_set_parameters_callback(self, callback: Callable[[list[Parameter]], None]) -> None:
        """Remove a callback; raise ``ValueError`` if it was not added."""
        self._declared.after.remove(callback)

    def set_descriptor(self, name: str, descriptor: Any, alternative_value: Any = None) -> Any:
        """Describe a parameter anew; return its value as a message."""
        return self._declared.describe(name, descriptor, alternative_value)

    def get_parameter_type(self, name: str) -> Parameter.Type:
        """Return the type of the current value of a parameter."""
        return self._declared.get(name).type_

    def get_parameter_types(self, names: Sequence[str]) -> list[int]:
        """Return the numbers of the types of the current values of parameters."""
        return [int(self.get_parameter_type(name)) for name in names]

    def list_parameters(self, prefixes: Sequence[str], depth: int) -> Any:
        """Return a ``ListParametersResult`` of the names at most *depth* levels below a prefix (0: all)."""
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


# -- services

Handler = Callable[[NodeParameters, Any, Any], None]
"""Fills the response to a request for the parameters of a node."""


def _get(node: NodeParameters, request: Any, response: Any) -> None:
    try:
        response.values = [node.get_parameter(name).get_parameter_value() for name in request.names]
    except (ParameterNotDeclaredException, ParameterUninitializedException):
        response.values = []


def _types(node: NodeParameters, request: Any, response: Any) -> None:
    try:
        response.types = [int(node.get_parameter_type(name)) for name in request.names]
    except ParameterNotDeclaredException:
        response.types = []


def _describe(node: NodeParameters, request: Any, response: Any) -> None:
    try:
        response.descriptors = node.describe_parameters(request.names)
    except ParameterNotDeclaredException:
        response.descriptors = []


def _list(node: NodeParameters, request: Any, response: Any) -> None:
    response.result = node.list_parameters(request.prefixes, request.depth)


def _set(node: NodeParameters, request: Any, response: Any) -> None:
    response.results = [_set_messages(node, [parameter]) for parameter in request.parameters]


def _set_atomically(node: NodeParameters, request: Any, response: Any) -> None:
    response.result = _set_messages(node, request.parameters)


def _set_messages(node: NodeParameters, messages: list[Any]) -> Any:
    try:
        return node.set_parameters_atomically([Parameter.from_parameter_msg(message) for message in messages])
    except ParameterNotDeclaredException as error:
        return new("rcl_interfaces/msg/SetParametersResult", successful=False, reason=str(error))


_SERVICES: dict[str, tuple[str, Handler]] = {
    "describe_parameters": ("DescribeParameters", _describe),
    "get_parameter_types": ("GetParameterTypes", _types),
    "get_parameters": ("GetParameters", _get),
    "list_parameters": ("ListParameters", _list),
    "set_parameters": ("SetParameters", _set),
    "set_parameters_atomically": ("SetParametersAtomically", _set_atomically),
}


def serve_parameters(node: NodeParameters, create_service: Callable[..., object]) -> None:
    """Offer the services through which other nodes read and set the parameters of *node*.

    Args:
        node: The node whose parameters are served.
        create_service: The node's ``create_service``.
    """

    def callback(handler: Handler) -> Callable[[Any, Any], Any]:
        def respond(request: Any, response: Any) -> Any:
            handler(node, request, response)
            return response

        return respond

    for name, (kind, handler) in _SERVICES.items():
        create_service(service_of(f"rcl_interfaces/srv/{kind}"), f"~/{name}", callback(handler))
