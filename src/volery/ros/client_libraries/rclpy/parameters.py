"""rclpy's parameters: declared, typed, and watched by callbacks."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Sequence
from enum import IntEnum
from typing import Any

import numpy as np

from volery.ros.client_libraries.rclpy.constraints import unfit
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


class Declared:
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
            why = "" if descriptor is None else unfit(one, descriptor, declared=one.name in self._parameters)
            if why:
                return why
        for watcher in self._watchers:
            result = watcher(parameters)
            if not result.successful:
                return result.reason or "a callback refused it"
        return ""
