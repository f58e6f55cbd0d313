"""What a component's required ports are: ports to components, and vehicles as the environment observes them.

A call moves the caller's own task to the callee: its pending execution time is served in its own context, the
arguments travel, the task waits for the callee, executes in the callee's context (its processor, its priority
if it states one), is charged there before the result leaves, and travels back. A call between two processors
carries copies of arguments and result; on one processor both sides see the same objects.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any, NoReturn, TypeVar, overload

from volery.base.errors import UsageError, VoleryError, choices, did_you_mean
from volery.base.position import Position
from volery.components.instance import RunningInstance
from volery.kernel.api import Kernel
from volery.kernel.task import Task
from volery.trace.events import Call

Transfer = Callable[[int], None]
"""Blocks the current task until a number of bytes has arrived at the other end; raises if they are lost."""

Sent = TypeVar("Sent")

HEADER_BYTES = 64
"""Bytes added to each direction of a call: TCP/IP headers (40) and the operation's name with framing."""


class ComponentPort:
    """A required port: ``port.operation(...)`` calls the component at the other end.

    The call raises the callee's exception if it is one of the project's errors, else a ``ComponentError``
    that names the callee.
    """

    def __init__(
        self,
        kernel: Kernel,
        caller: str,
        callee: RunningInstance,
        request: Transfer | None,
        reply: Transfer | None,
    ) -> None:
        self._kernel = kernel
        self._caller = caller
        self._callee = callee
        self._request = request
        self._reply = reply

    @property
    def component(self) -> str:
        """Name of the component at the other end."""
        return self._callee.name

    def __getattr__(self, operation: str) -> Callable[..., Any]:
        if operation.startswith("__"):
            raise AttributeError(operation)
        valid = self._callee.operations
        if operation not in valid:
            hint = did_you_mean(operation, valid)
            raise AttributeError(
                f"{self._callee.name} provides no operation {operation!r}{hint}: {choices(valid)}"
            )
        return partial(self._call, operation)

    def __deepcopy__(self, memo: object) -> NoReturn:
        raise UsageError(f"a port (here: to {self._callee.name}) cannot be sent to another processor")

    def _call(self, operation: str, /, *args: Any, **kwargs: Any) -> Any:
        kernel = self._kernel
        with kernel.interact():  # the caller's code so far is served in the caller's context
            start = kernel.now()
            task = kernel.current()
        if task is None:
            raise UsageError(
                f"{self._callee.name}.{operation} can be called by a component or a mission only"
            )
        outcome = "ok"
        try:
            return self._execute(task, operation, args, kwargs)
        except BaseException as error:
            outcome = type(error).__name__
            raise
        finally:
            with kernel.guard:
                kernel.record(Call(start, kernel.now(), self._caller, self._callee.name, operation, outcome))

    def _execute(self, task: Task, operation: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        callee = self._callee
        far = task.context.processor is not callee.context.processor
        if far:
            args, kwargs = self._copy((args, kwargs), f"the arguments of {callee.name}.{operation}")
        self._transfer(self._request, (args, kwargs))
        with callee.serving(task, operation) as thing:
            result = invoke(callee, thing, operation, args, kwargs)
            if far:
                result = self._copy(result, f"the result of {callee.name}.{operation}")
        self._transfer(self._reply, result)
        return result

    def _copy(self, content: Sent, what: str) -> Sent:
        try:
            return deepcopy(content)
        except VoleryError:
            raise
        except Exception as error:
            raise UsageError(f"{what} cannot be copied to another processor: {error}") from error

    def _transfer(self, transfer: Transfer | None, content: object) -> None:
        if transfer is not None:
            with self._kernel.interact():
                transfer(HEADER_BYTES + size_of(content))


def invoke(
    callee: RunningInstance, thing: object, operation: str, args: tuple[Any, ...], kwargs: dict[str, Any]
) -> Any:
    """Return the result of an operation of *callee*, whose object is ``thing``; errors: ``ComponentPort``."""
    try:
        return getattr(thing, operation)(*args, **kwargs)
    except VoleryError:
        raise
    except Exception as error:
        raise callee.component_error(error, operation) from error


class PortList(Sequence[ComponentPort]):
    """A required port that is connected to several components, in the order of the model.

    An element is accessed by index or by the name of the component at the other end: ``drones[0]``,
    ``drones["drone_control_2"]``.
    """

    def __init__(self, ports: Sequence[ComponentPort]) -> None:
        self._ports = tuple(ports)
        self._by_name = {port.component: port for port in self._ports}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the components at the other ends."""
        return tuple(self._by_name)

    @overload
    def __getitem__(self, which: int | str) -> ComponentPort: ...
    @overload
    def __getitem__(self, which: slice) -> Sequence[ComponentPort]: ...
    def __getitem__(self, which: int | str | slice) -> ComponentPort | Sequence[ComponentPort]:
        if isinstance(which, str):
            if which not in self._by_name:
                hint = did_you_mean(which, self._by_name)
                raise KeyError(f"nothing called {which!r} is connected{hint}: {choices(self._by_name)}")
            return self._by_name[which]
        return self._ports[which]

    def __len__(self) -> int:
        return len(self._ports)

    def __iter__(self) -> Iterator[ComponentPort]:
        return iter(self._ports)


def size_of(value: object) -> int:
    """Return the size of a value on a network in bytes.

    A number takes 8, a text its UTF-8 encoding; whatever has a length takes 4 more.
    """
    if value is None or isinstance(value, bool):
        return 1
    if isinstance(value, str):
        return 4 + len(value.encode())
    if isinstance(value, (bytes, bytearray, memoryview)):
        return 4 + len(value)
    parts = _parts(value)
    return 8 if parts is None else sum(map(size_of, parts)) + (4 if isinstance(value, Collection) else 0)


def _parts(value: object) -> Iterable[object] | None:
    """Return the elements of a value, or None if it has none, as a number."""
    if isinstance(value, Mapping):
        return [*value.keys(), *value.values()]
    if isinstance(value, Collection):
        return value
    if is_dataclass(value):
        return [getattr(value, item.name) for item in fields(value)]
    state = getattr(value, "__dict__", None)
    return list(state.values()) if state else None


class TrueVehicle:
    """The true state of a vehicle, for components of the environment such as a beacon or an obstacle.

    A component of the application commands the vehicle instead, and receives its autopilot's estimate.
    """

    def __init__(self, kernel: Kernel, name: str, truth: Callable[[], Position]) -> None:
        self.name = name
        self._kernel = kernel
        self._truth = truth

    @property
    def position(self) -> Position:
        """True position, with its altitude AMSL."""
        with self._kernel.interact():
            return self._truth()
