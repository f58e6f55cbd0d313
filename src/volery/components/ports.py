"""A required port: an object with the operations of an interface.

A call moves the caller's own task to the callee: what the caller owes is served at its own place, the
arguments travel, the task waits its turn, computes at the callee's place (its processor, its priority if it
states one), pays there before the result leaves, and travels back. A call between two processors carries
*copies* of arguments and result; on one processor both sides see the same objects.

A vehicle as what surrounds it sees it: where it really is. For components of the environment only.

A component of the application that requires a vehicle commands it and knows its autopilot's estimate. One of
the environment, such as a beacon, a judge or an obstacle, is given this instead.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any, NoReturn, TypeVar, overload

from volery.base.errors import UsageError, VoleryError, choices, did_you_mean
from volery.base.position import Position
from volery.components.instance import Instance
from volery.kernel.api import Kernel
from volery.kernel.task import Task
from volery.trace.events import Call

Transfer = Callable[[int], None]
"""Blocks the current task until so many bytes are at the other end; raises if they do not get there."""

Sent = TypeVar("Sent")

HEADER_BYTES = 64
"""Added to each direction of a call: TCP/IP headers (40) and the operation's name with framing."""


class Port:
    """``port.operation(...)`` calls the component at the other end.

    Raises what the callee raises if it is one of the project's errors, else ``ComponentError`` naming the
    callee.
    """

    def __init__(
        self, kernel: Kernel, caller: str, callee: Instance, there: Transfer | None, back: Transfer | None
    ) -> None:
        self._kernel = kernel
        self._caller = caller
        self._callee = callee
        self._there = there
        self._back = back

    @property
    def component(self) -> str:
        """The name of the component at the other end."""
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
        with kernel:  # the caller's code so far is served at the caller's place
            start = kernel.now()
            task = kernel.current()
        if task is None:
            raise UsageError(
                f"{self._callee.name}.{operation} can be called by a component or a mission only"
            )
        outcome = "ok"
        try:
            return self._there_and_back(task, operation, args, kwargs)
        except BaseException as error:
            outcome = type(error).__name__
            raise
        finally:
            with kernel.guard:
                kernel.record(Call(start, kernel.now(), self._caller, self._callee.name, operation, outcome))

    def _there_and_back(
        self, task: Task, operation: str, args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> Any:
        callee = self._callee
        far = task.context.processor is not callee.context.processor
        if far:
            args, kwargs = self._copied((args, kwargs), f"the arguments of {callee.name}.{operation}")
        self._move(self._there, (args, kwargs))
        with callee.visited(task, operation) as thing:
            result = invoke(callee, thing, operation, args, kwargs)
            if far:
                result = self._copied(result, f"the result of {callee.name}.{operation}")
        self._move(self._back, result)
        return result

    def _copied(self, content: Sent, what: str) -> Sent:
        """What arrives at another processor."""
        try:
            return deepcopy(content)
        except VoleryError:
            raise
        except Exception as error:
            raise UsageError(f"{what} cannot be copied to another processor: {error}") from error

    def _move(self, travel: Transfer | None, content: object) -> None:
        if travel is not None:
            with self._kernel:
                travel(HEADER_BYTES + size_of(content))


def invoke(
    callee: Instance, thing: object, operation: str, args: tuple[Any, ...], kwargs: dict[str, Any]
) -> Any:
    """The result of an operation of *callee*, whose object is *thing*. Errors as ``Port`` says."""
    try:
        return getattr(thing, operation)(*args, **kwargs)
    except VoleryError:
        raise
    except Exception as error:
        raise callee.fail(error, operation) from error


class PortList(Sequence[Port]):
    """The ports of a requirement that is connected to several components, in the order of the model.

    By index, or by the name of the component at the other end: ``drones[0]``, ``drones["drone_control_2"]``.
    """

    def __init__(self, ports: Sequence[Port]) -> None:
        self._ports = tuple(ports)
        self._by_name = {port.component: port for port in self._ports}

    @property
    def names(self) -> tuple[str, ...]:
        """The components at the other ends."""
        return tuple(self._by_name)

    @overload
    def __getitem__(self, which: int | str) -> Port: ...
    @overload
    def __getitem__(self, which: slice) -> Sequence[Port]: ...
    def __getitem__(self, which: int | str | slice) -> Port | Sequence[Port]:
        if isinstance(which, str):
            if which not in self._by_name:
                hint = did_you_mean(which, self._by_name)
                raise KeyError(f"nothing called {which!r} is connected{hint}: {choices(self._by_name)}")
            return self._by_name[which]
        return self._ports[which]

    def __len__(self) -> int:
        return len(self._ports)

    def __iter__(self) -> Iterator[Port]:
        return iter(self._ports)


def size_of(value: object) -> int:
    """Bytes that *value* takes on a network: 8 a number, text as UTF-8, 4 more for whatever has a length."""
    if value is None or isinstance(value, bool):
        return 1
    if isinstance(value, str):
        return 4 + len(value.encode())
    if isinstance(value, (bytes, bytearray, memoryview)):
        return 4 + len(value)
    parts = _parts(value)
    return 8 if parts is None else sum(map(size_of, parts)) + (4 if isinstance(value, Collection) else 0)


def _parts(value: object) -> Iterable[object] | None:
    """What *value* is made of, ``None`` if it is a number or the like."""
    if isinstance(value, Mapping):
        return [*value.keys(), *value.values()]
    if isinstance(value, Collection):
        return value
    if is_dataclass(value):
        return [getattr(value, item.name) for item in fields(value)]
    state = getattr(value, "__dict__", None)
    return list(state.values()) if state else None


class Body:
    """The vehicle called ``name``, by truth."""

    def __init__(self, kernel: Kernel, name: str, truth: Callable[[], Position]) -> None:
        self.name = name
        self._kernel = kernel
        self._truth = truth

    @property
    def position(self) -> Position:
        """Where it is, AMSL."""
        with self._kernel:
            return self._truth()
