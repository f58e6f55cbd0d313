"""Ports between processes: an operation is a service of the graph, its arguments and result are JSON.

JSON is extended by tuples, mappings with any keys, enumerations, and dataclasses of ``volery`` or of a module
beside the component's file. No other type is ever created from received text.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import partial
from typing import Any, Protocol

from volery.base.errors import ComponentError, UsageError, VoleryError
from volery.base.time import Ns, S
from volery.components.instance import RunningInstance
from volery.components.loader import SHARED_MODULE_PREFIX, USER_MODULE_PREFIX
from volery.components.ports import ComponentPort, invoke
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext, Scope, Task
from volery.kernel.waiting import current_task
from volery.model.instances import Instance as InstanceModel
from volery.model.system import System
from volery.ros.graph import Client, Node, ServiceError
from volery.ros.graph.work import Work
from volery.ros.messages import RosMessage, define_all, request, service
from volery.run.distributed.call_types import CallTypes, Find, OperationType
from volery.run.distributed.plan import NODE, operations, service_name

_KIND = "!"
_TUPLE, _MAPPING = "tuple", "mapping"
_VOLERY = "volery."


class ValueCodec:
    """Encoder and decoder of the values of one process."""

    def __init__(self, find: Find) -> None:
        self._find = find

    def to_text(self, value: object, what: str) -> str:
        """Encode *value*. Raises ``UsageError`` that names *what* if its type cannot be sent."""
        return json.dumps(_encode(value, what))

    def from_text(self, text: str) -> Any:
        """Decode the text of ``to_text``. Raises ``UsageError`` for any other text."""
        try:
            return json.loads(text, object_hook=self._made)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise UsageError(f"not the value of a port: {error}") from error

    def _made(self, found: dict[str, Any]) -> Any:
        kind = found.get(_KIND)
        if kind is None:
            return found
        content = found["value"]
        if kind == _TUPLE:
            return tuple(content)
        if kind == _MAPPING:
            return dict(content)
        cls = self._class(kind)
        if issubclass(cls, Enum):
            return cls[content]
        if not is_dataclass(cls):
            raise ValueError(f"{kind} is no dataclass")
        made = cls(**{field.name: content.pop(field.name) for field in fields(cls) if field.init})
        for name, value in content.items():
            object.__setattr__(made, name, value)
        return made

    def _class(self, kind: str) -> type[Any]:
        module, _, name = kind.partition(":")
        if module.startswith(SHARED_MODULE_PREFIX):
            found = self._find(module.removeprefix(SHARED_MODULE_PREFIX))
        else:
            ours = module.startswith(_VOLERY) and not module.startswith(USER_MODULE_PREFIX)
            found = sys.modules.get(module) if ours else None
        cls = getattr(found, name, None)
        if not isinstance(cls, type):
            raise ValueError(f"no class {name} in {module} here")
        return cls


def _encode(value: object, what: str) -> Any:
    if value is None or isinstance(value, (bool, str)):
        return value
    for kind, code in _CODES.items():
        if isinstance(value, kind):
            return code(value, what)
    if is_dataclass(value) and not isinstance(value, type):
        content = {field.name: _encode(getattr(value, field.name), what) for field in fields(value)}
        return {_KIND: _name(value, what), "value": content}
    raise _unfit(value, what)


def _tuple(value: tuple[Any, ...], what: str) -> Any:
    if type(value) is not tuple:
        raise _unfit(value, what)  # a named tuple would lose its type
    return {_KIND: _TUPLE, "value": [_encode(one, what) for one in value]}


def _mapping(value: dict[Any, Any], what: str) -> Any:
    if all(isinstance(key, str) for key in value) and _KIND not in value:
        return {key: _encode(one, what) for key, one in value.items()}
    pairs = [[_encode(key, what), _encode(one, what)] for key, one in value.items()]
    return {_KIND: _MAPPING, "value": pairs}


def _name(value: object, what: str) -> str:
    cls = type(value)
    module = cls.__module__
    known = (
        module.startswith(SHARED_MODULE_PREFIX)
        if module.startswith(USER_MODULE_PREFIX)
        else module.startswith(_VOLERY)
    )
    if not known:
        raise _unfit(value, what)
    return f"{module}:{cls.__qualname__}"


_CODES: Mapping[type, Callable[[Any, str], Any]] = {
    Enum: lambda value, what: {_KIND: _name(value, what), "value": value.name},
    int: lambda value, what: int(value),
    float: lambda value, what: float(value),
    list: lambda value, what: [_encode(one, what) for one in value],
    tuple: _tuple,
    dict: _mapping,
}


def _unfit(value: object, what: str) -> UsageError:
    return UsageError(
        f"{what}: a {type(value).__qualname__} cannot be sent to another process; use numbers, text, lists, "
        "mappings, or dataclasses of a module beside the components"
    )


CALL = "volery_msgs/srv/Call"


class CallFormat(Protocol):
    """How the calls of one operation are written into messages."""

    type: str

    def request(self, args: tuple[Any, ...], kwargs: dict[str, Any], what: str) -> RosMessage:
        """Return the request; raise ``UsageError`` that names *what* if a value cannot be sent."""

    def arguments(self, asked: Any) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """Return the arguments of a request, by position and by name."""

    def response(self, result: Any, what: str) -> RosMessage:
        """Return the response with a result; raise ``UsageError`` that names *what*."""

    def failure(self, error: str) -> RosMessage:
        """Return the response of an operation that failed."""

    def error(self, answer: Any) -> str:
        """Return why the operation failed."""

    def result(self, answer: Any) -> Any:
        """Return the result of a response."""


class JsonCalls:
    """Calls of any operation as JSON in ``volery_msgs/srv/Call``."""

    type = CALL

    def __init__(self, values: ValueCodec) -> None:
        self._values = values

    def request(self, args: tuple[Any, ...], kwargs: dict[str, Any], what: str) -> RosMessage:
        """See ``CallFormat``."""
        made: RosMessage = request(CALL, arguments=self._values.to_text([list(args), kwargs], what))
        return made

    def arguments(self, asked: Any) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """See ``CallFormat``."""
        args, kwargs = self._values.from_text(asked.arguments)
        return tuple(args), kwargs

    def response(self, result: Any, what: str) -> RosMessage:
        """See ``CallFormat``."""
        made: RosMessage = service(CALL).response(True, self._values.to_text(result, what))
        return made

    def failure(self, error: str) -> RosMessage:
        """See ``CallFormat``."""
        made: RosMessage = service(CALL).response(False, error)
        return made

    def error(self, answer: Any) -> str:
        """See ``CallFormat``."""
        return str(answer.result)

    def result(self, answer: Any) -> Any:
        """See ``CallFormat``."""
        return self._values.from_text(answer.result)


class TypedCalls:
    """Calls of one operation as messages of its own service type."""

    def __init__(self, types: CallTypes, kind: OperationType, find: Find) -> None:
        self.type = kind.name
        self._types, self._kind, self._find = types, kind, find

    def request(self, args: tuple[Any, ...], kwargs: dict[str, Any], what: str) -> RosMessage:
        """See ``CallFormat``."""
        return self._types.request(self._kind, args, kwargs, what)

    def arguments(self, asked: Any) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """See ``CallFormat``."""
        return (), self._types.arguments(self._kind, asked, self._find)

    def response(self, result: Any, what: str) -> RosMessage:
        """See ``CallFormat``."""
        return self._types.response(self._kind, result, what)

    def failure(self, error: str) -> RosMessage:
        """See ``CallFormat``."""
        return self._types.failure(self._kind, error)

    def error(self, answer: Any) -> str:
        """See ``CallFormat``."""
        return str(answer.error)

    def result(self, answer: Any) -> Any:
        """See ``CallFormat``."""
        return self._types.result(self._kind, answer, self._find)


class CallFormats:
    """The formats of a process: typed where *types* has the operation, else JSON."""

    def __init__(
        self, system: System, values: ValueCodec, find: Find, types: CallTypes | None = None
    ) -> None:
        self._system, self._json, self._find, self._types = system, JsonCalls(values), find, types
        if types is not None:
            define_all(types.definitions)

    def of(self, callee: InstanceModel, operation: str) -> CallFormat:
        """Return the format of an operation of *callee*."""
        for interface in callee.component.provides.values():
            kind = self._types.operations.get((interface, operation)) if self._types else None
            if self._types is not None and kind is not None:
                return TypedCalls(self._types, kind, self._find)
        return self._json


_DISCOVERY: Ns = 10 * S
"""Longest wait for the server of an operation before its first call."""


class RemotePort(ComponentPort):
    """Port to a component of another process.

    A call raises ``ComponentError`` that names the callee if the operation fails or its process is gone.
    """

    def __init__(
        self,
        kernel: Kernel,
        caller: str,
        callee: RunningInstance,
        clients: Mapping[str, Client],
        formats: Mapping[str, CallFormat],
    ) -> None:
        super().__init__(kernel, caller, callee, None, None)
        self._clients = clients
        self._formats = formats
        self._met: set[str] = set()  # operations whose server was discovered

    def _execute(self, task: Task, operation: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        written = self._formats[operation]
        asked = written.request(args, kwargs, f"the arguments of {self.component}.{operation}")
        client = self._clients[operation]
        if operation not in self._met and client.wait(_DISCOVERY):  # ROS 2 may know of it after the start
            self._met.add(operation)
        try:
            answer = client.call(asked)
        except ServiceError as error:
            raise ComponentError(self.component, f"{operation} failed: {error.what}") from error
        if not answer.done:
            raise ComponentError(self.component, written.error(answer).removeprefix(f"{self.component}: "))
        return written.result(answer)


class PortClients:
    """Creates the ports of the components of one process to those of others.

    Clients are created with the port, long before the first call: on ROS 2 a response is lost if the server
    has not discovered its client yet.
    """

    def __init__(self, kernel: Kernel, system: System, node: Node, formats: CallFormats) -> None:
        self._kernel, self._system, self._node, self._formats = kernel, system, node, formats
        self._clients: dict[str, Client] = {}

    def __call__(self, caller: InstanceModel, callee: InstanceModel) -> RemotePort:
        """Return the port of *caller* in this process to *callee* in another."""
        provided = operations(self._system, callee)
        far = RunningInstance(self._kernel, callee.name, operations=provided)
        formats = {name: self._formats.of(callee, name) for name in provided}
        clients = {name: self._client(service_name(callee, name), formats[name].type) for name in provided}
        return RemotePort(self._kernel, caller.name, far, clients, formats)

    def _client(self, name: str, service_type: str) -> Client:
        known = self._clients.get(name)
        if known is None:
            known = self._clients[name] = self._node.client(name, service_type)
        return known


class PortServer:
    """Serves the operations of the components of one process to others, with one task for each call."""

    def __init__(self, kernel: Kernel, node: Node, formats: CallFormats, scope: Scope) -> None:
        self._kernel, self._node, self._formats, self._scope = kernel, node, formats, scope
        self._group = node.group(self._start)

    def serve(self, model: InstanceModel, instance: RunningInstance) -> None:
        """Advertise the operations of *instance*."""
        for operation in instance.operations:
            written = self._formats.of(model, operation)
            handler = partial(self._answer, instance, operation, written)
            self._node.serve(service_name(model, operation), written.type, handler, self._group)

    def _start(self, work: Work) -> None:
        self._kernel.spawn(work.run, f"{NODE} (call)", ExecutionContext(NODE), self._scope)

    def _answer(
        self, instance: RunningInstance, operation: str, written: CallFormat, asked: Any
    ) -> RosMessage:
        try:
            args, kwargs = written.arguments(asked)
            with instance.serving(current_task(self._kernel), operation) as thing:
                result = invoke(instance, thing, operation, args, kwargs)
            return written.response(result, f"the result of {instance.name}.{operation}")
        except VoleryError as error:
            return written.failure(str(error))
