"""``connect_async``: the same vehicles for programs with ``asyncio``.

There is no second implementation: each awaited call is the blocking call, executed as a task of the kernel in
a thread of its own. Calls that are awaited at once go on side by side, also in virtual time, which passes
while at least one call is under way. Cancelling the awaiting task cancels the call.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import MS, Ns, from_seconds
from volery.kernel.task import Scope, Task
from volery.kernel.waiting import Signal, current_task, sleep
from volery.run.connect import connect
from volery.vehicles import Drone, Vehicle

LOOKED_AFTER: Ns = 20 * MS
"""Period at which new calls are taken up while others are under way."""


@dataclass
class _AwaitedCall:
    """One call of a program: what to execute, and the future that it awaits."""

    body: Callable[[], Any]
    future: asyncio.Future[Any]
    scope: Scope | None = None
    task: Task | None = None
    cancelled: threading.Event = field(default_factory=threading.Event)


class AsyncVehicle:
    """A vehicle whose methods are awaited: ``await drone.takeoff(10)``.

    It has all methods of ``Drone`` or ``Rover``. State is awaited with ``get``, as in
    ``await drone.get("position")``, or followed: ``async for position in drone.stream("position")``. Nouns
    such as ``parameters`` are called through ``run``: ``await drone.run(lambda one: one.parameters.all())``.

    Args:
        calls: queue of the thread that executes the calls.
        loop: event loop of the program.
        kind: class of the vehicle.
    """

    def __init__(
        self, calls: SimpleQueue[_AwaitedCall | None], loop: asyncio.AbstractEventLoop, kind: type[Vehicle]
    ) -> None:
        self._calls = calls
        self._loop = loop
        self._kind = kind
        self._vehicle: Any = None

    def __getattr__(self, name: str) -> Callable[..., Any]:
        found = getattr(self._kind, name, None) if not name.startswith("_") else None
        if found is None:
            raise AttributeError(f"{self._kind.__name__} has no {name!r}")
        if not callable(found):
            raise AttributeError(f'{name!r} is no method: await vehicle.get("{name}"), or run(...)')

        async def call(*arguments: Any, **named: Any) -> Any:
            return await self.run(lambda vehicle: getattr(vehicle, name)(*arguments, **named))

        return call

    async def get(self, name: str) -> Any:
        """Return the present value of a property of the vehicle, such as ``position``."""
        if not isinstance(getattr(self._kind, name, None), property):
            raise UsageError(f"get({name!r}): {self._kind.__name__} has no such property")
        return await self.run(lambda vehicle: getattr(vehicle, name))

    async def stream(self, name: str, period: float = 0.5) -> AsyncIterator[Any]:
        """Yield the value of a property every *period* seconds of the vehicle's time, the first at once.

        Args:
            name: property of the vehicle, such as ``position``.
            period: time between two values, s; a slower loop gets the latest value.

        Raises:
            UsageError: there is no such property, or the period is not above 0.
        """
        if not period > 0.0:
            raise UsageError(f"stream({name!r}): a period of {period} s; it must be above 0")
        yield await self.get(name)
        while True:
            await self.run(lambda vehicle: sleep(vehicle.kernel, from_seconds(period)))
            yield await self.get(name)

    async def run(self, function: Callable[[Any], Any]) -> Any:
        """Execute ``function(vehicle)`` and return what it returns."""
        call = _AwaitedCall(lambda: function(self._vehicle), self._loop.create_future())
        self._calls.put(call)
        try:
            return await call.future
        except asyncio.CancelledError:
            call.cancelled.set()
            raise


@asynccontextmanager
async def connect_async(url: str, kind: type[Vehicle] = Drone, **options: Any) -> AsyncIterator[AsyncVehicle]:
    """Connect to the vehicle at *url* as ``connect`` does, for ``async with``.

    Args:
        url: Address, such as ``sim:px4``.
        kind: ``Drone`` or ``Rover``.
        options: As of ``connect``.

    Raises:
        VoleryError: As for ``connect``.
    """
    loop = asyncio.get_running_loop()
    calls: SimpleQueue[_AwaitedCall | None] = SimpleQueue()
    vehicle = AsyncVehicle(calls, loop, kind)
    opened: asyncio.Future[None] = loop.create_future()
    closed: asyncio.Future[None] = loop.create_future()

    def execute() -> None:
        try:
            with connect(url, kind, **options) as found:
                vehicle._vehicle = found
                _settle(loop, opened, None, None)
                _Executor(found, loop, calls).execute()
        except BaseException as error:
            _settle(loop, opened if vehicle._vehicle is None else closed, None, error)
        else:
            _settle(loop, closed, None, None)

    thread = threading.Thread(target=execute, name=f"volery {url}", daemon=True)
    thread.start()
    await opened
    try:
        yield vehicle
    finally:
        calls.put(None)
        await asyncio.shield(closed)


class _Executor:
    """Executes the calls of one program in the thread of its kernel."""

    def __init__(
        self, vehicle: Vehicle, loop: asyncio.AbstractEventLoop, calls: SimpleQueue[_AwaitedCall | None]
    ) -> None:
        self._kernel = vehicle.kernel
        self._loop = loop
        self._calls = calls
        self._running: list[_AwaitedCall] = []
        self._ended = Signal(vehicle.kernel, f"a call of {vehicle.name}")
        self._closing = False

    def execute(self) -> None:
        """Execute calls until the program closes; calls under way are then cancelled."""
        while not self._closing:
            self._take_up()
            for call in self._running:
                if (call.cancelled.is_set() or self._closing) and call.scope is not None:
                    with self._kernel.guard:
                        self._kernel.cancel(call.scope, "its caller was cancelled")
            if self._running:
                self._ended.wait_for(self._has_ended, LOOKED_AFTER)
                self._running = [call for call in self._running if not call.task or not call.task.done]

    def _take_up(self) -> None:
        """Start the calls in the queue; wait for one if none is under way."""
        try:
            call = self._calls.get(block=not self._running)
            while True:
                if call is None:
                    self._closing = True
                else:
                    self._start(call)
                call = self._calls.get_nowait()
        except Empty:
            return

    def _has_ended(self) -> bool:
        return any(call.task is not None and call.task.done for call in self._running)

    def _start(self, call: _AwaitedCall) -> None:
        def body() -> None:
            try:
                result, failure = call.body(), None
            except Exception as error:
                result, failure = None, error
            _settle(self._loop, call.future, result, failure)
            self._ended.notify()

        kernel = self._kernel
        with kernel.interact():
            caller = current_task(kernel)
            call.scope = caller.scope.child("asyncio")
            call.task = kernel.spawn(body, "asyncio", caller.context, call.scope)
        self._running.append(call)


def _settle(
    loop: asyncio.AbstractEventLoop, future: asyncio.Future[Any], result: Any, failure: BaseException | None
) -> None:
    """Set the result of a future of another thread, unless it has one already."""

    def settle() -> None:
        if future.done():
            return
        if failure is not None:
            future.set_exception(failure)
        else:
            future.set_result(result)

    if not loop.is_closed():
        loop.call_soon_threadsafe(settle)
