"""Replacements of ``concurrent.futures`` and ``asyncio`` on the tasks and the clock of the run.

A thread of a pool is a task of its component. The event loop is asyncio's own, with a clock and a selector
that are the kernel's; what needs sockets, pipes or processes is refused. ``_running`` says how loops of
several components share one thread of the machine.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
from asyncio import events
from collections import deque
from collections.abc import Callable, Coroutine, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from types import ModuleType
from typing import Any, Self

from greenlet import getcurrent, gettrace, greenlet, settrace

from volery.base.time import MS, from_seconds, to_seconds
from volery.components.virtual_stdlib.process_environment import make_module
from volery.components.virtual_stdlib.synchronization import KernelBound, Thread, bind, longest_wait
from volery.kernel import waiting
from volery.kernel.api import Kernel

# -- pools of threads


class Future(KernelBound):
    """The result of a call that a pool executes."""

    def __init__(self) -> None:
        self._signal = waiting.Signal(self.kernel, "Future")
        self._state = "pending"
        self._result: Any = None
        self._error: BaseException | None = None
        self._callbacks: list[Callable[[Future], object]] = []

    def done(self) -> bool:
        """Return whether the call has ended or was cancelled."""
        return self._state in ("finished", "cancelled")

    def running(self) -> bool:
        """Return whether the call is being executed."""
        return self._state == "running"

    def cancelled(self) -> bool:
        """Return whether the call was cancelled."""
        return self._state == "cancelled"

    def cancel(self) -> bool:
        """Cancel the call unless it has begun; return whether it is cancelled."""
        if self._state == "pending":
            self._end("cancelled")
        return self.cancelled()

    def _end(self, state: str) -> None:
        self._state = state
        self._signal.notify()
        for callback in self._callbacks:
            callback(self)

    def set_running_or_notify_cancel(self) -> bool:
        """Record that the call begins; return False if it was cancelled."""
        if self._state == "pending":
            self._state = "running"
        return self.running()

    def set_result(self, result: Any) -> None:
        """End with a result."""
        self._result = result
        self._end("finished")

    def set_exception(self, exception: BaseException | None) -> None:
        """End with a failure."""
        self._error = exception
        self._end("finished")

    def exception(self, timeout: float | None = None) -> BaseException | None:
        """Wait for the end; return the failure, or None."""
        if not self._signal.wait_for(self.done, longest_wait(True, timeout), ends_activation=True):
            raise TimeoutError
        if self.cancelled():
            raise concurrent.futures.CancelledError
        return self._error

    def result(self, timeout: float | None = None) -> Any:
        """Wait for the end; return the result, or raise the failure."""
        error = self.exception(timeout)
        if error is not None:
            raise error
        return self._result

    def add_done_callback(self, fn: Callable[[Future], object]) -> None:
        """Call *fn* with the future when it has ended, or now."""
        if self.done():
            fn(self)
        else:
            self._callbacks.append(fn)


class ThreadPoolExecutor(KernelBound):
    """Executes calls in at most *max_workers* threads."""

    def __init__(
        self,
        max_workers: int | None = None,
        thread_name_prefix: str = "",
        initializer: Callable[..., object] | None = None,
        initargs: tuple[Any, ...] = (),
    ) -> None:
        if max_workers is not None and max_workers <= 0:
            raise ValueError("max_workers must be greater than 0")
        self._most = max_workers or _DEFAULT_WORKERS
        self._prefix = thread_name_prefix or "ThreadPoolExecutor"
        self._initialize = partial(initializer, *initargs) if initializer is not None else None
        self._waiting: deque[tuple[Future, Callable[[], Any]]] = deque()
        self._threads: list[Thread] = []
        self._idle = 0
        self._shut_down = False
        self._changed = waiting.Signal(self.kernel, self._prefix)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future:
        """Execute a call soon."""
        if self._shut_down:
            raise RuntimeError("cannot schedule new futures after shutdown")
        future: Future = bind(self.kernel, (Future,))["Future"]()
        self._waiting.append((future, partial(fn, *args, **kwargs)))
        if len(self._waiting) > self._idle and len(self._threads) < self._most:
            name = f"{self._prefix}_{len(self._threads)}"
            thread: Thread = bind(self.kernel, (Thread,))["Thread"](target=self._work, name=name)
            self._threads.append(thread)
            thread.start()
        else:
            self._changed.notify()
        return future

    def _work(self) -> None:
        if self._initialize is not None:
            self._initialize()
        while True:
            self._idle += 1
            self._changed.wait_for(lambda: self._waiting or self._shut_down, ends_activation=True)
            self._idle -= 1
            if not self._waiting:
                return
            future, call = self._waiting.popleft()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                result = call()
            except Exception as error:
                future.set_exception(error)
            else:
                future.set_result(result)

    def map(
        self,
        fn: Callable[..., Any],
        *iterables: Iterable[Any],
        timeout: float | None = None,
        chunksize: int = 1,
    ) -> Iterator[Any]:
        """Execute calls with the elements of iterables; return an iterator over the results, in order."""
        futures = [self.submit(fn, *given) for given in zip(*iterables, strict=False)]
        return (future.result(timeout) for future in futures)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; wait for the end of those that were taken."""
        self._shut_down = True
        if cancel_futures:
            for future, _ in self._waiting:
                future.cancel()
        self._changed.notify()
        if wait:
            for thread in self._threads:
                thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.shutdown()


_DEFAULT_WORKERS = 8
"""On every machine the same."""


def _ended(futures: list[Future], enough: Callable[[int], object], timeout: float | None) -> bool:
    """Wait until *enough* says of the number of ended futures that it is; return False after a time-out."""
    if not futures:
        return True
    changed = waiting.Signal(futures[0].kernel, "concurrent.futures")
    for one in futures:
        one.add_done_callback(lambda _: changed.notify())
    return changed.wait_for(
        lambda: enough(sum(future.done() for future in futures)),
        longest_wait(True, timeout),
        ends_activation=True,
    )


def as_completed(fs: Iterable[Future], timeout: float | None = None) -> Iterator[Future]:
    """Yield futures as they end."""
    left = list(dict.fromkeys(fs))
    while left:
        if not _ended(left, bool, timeout):
            raise TimeoutError(f"{len(left)} futures unfinished")
        for one in [one for one in left if one.done()]:
            left.remove(one)
            yield one


def wait(
    fs: Iterable[Future], timeout: float | None = None, return_when: str = concurrent.futures.ALL_COMPLETED
) -> tuple[set[Future], set[Future]]:
    """Wait for futures; return those that have ended and the others."""
    futures = list(dict.fromkeys(fs))

    def failed(one: Future) -> bool:
        return one.done() and one._error is not None

    def enough(done: int) -> bool:
        if return_when == concurrent.futures.ALL_COMPLETED or done == len(futures):
            return done == len(futures)
        return return_when == concurrent.futures.FIRST_COMPLETED or any(map(failed, futures))

    _ended(futures, lambda done: done > 0 and enough(done), timeout)
    done = {future for future in futures if future.done()}
    return done, set(futures) - done


def futures_module(kernel: Kernel) -> ModuleType:
    """Return the replacement of ``concurrent.futures``."""
    kept = ("ALL_COMPLETED", "FIRST_COMPLETED", "FIRST_EXCEPTION", "CancelledError", "InvalidStateError")
    names = {
        **{name: getattr(concurrent.futures, name) for name in kept},
        **bind(kernel, (Future, ThreadPoolExecutor)),
        "TimeoutError": TimeoutError,
        "as_completed": as_completed,
        "wait": wait,
    }
    return make_module("concurrent.futures", names)


# -- asyncio

_ROUNDS = 100
"""Rounds of a loop without waiting, after which it has taken ``_ROUNDS_TAKE``."""
_ROUNDS_TAKE = MS


class EventLoop(asyncio.BaseEventLoop):
    """asyncio's loop on the clock of the run. It is its own selector, which has nothing to select."""

    def __init__(self, kernel: Kernel) -> None:
        super().__init__()
        self._kernel = kernel
        self._clock_resolution = 1e-9
        self._selector = self
        self._awakened = False
        self._rounds = 0
        self._signal = waiting.Signal(kernel, "a loop of asyncio")

    def time(self) -> float:
        """Return the time of the run, s."""
        return to_seconds(self._kernel.now())

    def select(self, timeout: float | None) -> list[Any]:
        """Wait for a call from another task, at most *timeout* s."""
        within = None if timeout is None else from_seconds(timeout)
        if within is not None and within <= 0:
            self._rounds += 1
            if self._rounds >= _ROUNDS:
                self._rounds = 0
                waiting.sleep(self._kernel, _ROUNDS_TAKE)
        else:
            self._rounds = 0
            self._signal.wait_for(lambda: self._awakened, within, ends_activation=True)
        self._awakened = False
        return []

    def _process_events(self, event_list: list[Any]) -> None:
        """Do nothing: there are no events of files."""

    def _write_to_self(self) -> None:
        self._awakened = True
        self._signal.notify()

    def _check_running(self) -> None:
        if self.is_running():
            raise RuntimeError("This event loop is already running")

    def run_forever(self) -> None:
        """Run until ``stop`` is called."""
        base: Any = self  # whose private members are those that Python's own loops use
        base._check_closed()
        self._check_running()
        base._thread_id = 1  # by which asyncio knows that it runs
        try:
            with _running(self):
                while not base._stopping:
                    base._run_once()
        finally:
            base._stopping = False
            base._thread_id = None

    def run_in_executor(  # type: ignore[override]  # a pool is the run's, not Python's
        self, executor: ThreadPoolExecutor | None, func: Callable[..., Any], *args: Any
    ) -> asyncio.Future[Any]:
        """Call *func* in a thread, or by a pool."""
        pool = executor or bind(self._kernel, (ThreadPoolExecutor,))["ThreadPoolExecutor"](1)
        future = self.create_future()

        def finish(error: BaseException | None, result: Any) -> None:
            if future.done():
                return
            if error is None:
                future.set_result(result)
            else:
                future.set_exception(error)

        def ended(one: Any) -> None:
            self.call_soon_threadsafe(finish, one._error, one._result)

        pool.submit(func, *args).add_done_callback(ended)
        if executor is None:
            pool.shutdown(wait=False)
        return future

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:
        """Do nothing: each call had a thread of its own."""


_loops: dict[greenlet, EventLoop] = {}
"""Loops that run, by the flow of control that runs them."""


def _switched(event: str, flows: tuple[greenlet, greenlet]) -> None:
    events._set_running_loop(_loops.get(flows[1]))


@contextmanager
def _running(loop: EventLoop) -> Iterator[None]:
    """Let asyncio find *loop* as the running one.

    asyncio keeps the running loop by thread of the machine; in virtual time all tasks share one. So the loop
    is exchanged at each switch between tasks, while loops run.
    """
    flow, before = getcurrent(), gettrace()
    outer = _loops.get(flow)
    if not _loops:
        settrace(_switched)
    _loops[flow] = loop
    events._set_running_loop(loop)
    try:
        yield
    finally:
        if outer is None:
            del _loops[flow]
        else:
            _loops[flow] = outer
        events._set_running_loop(outer)
        if not _loops:
            settrace(before if before is not _switched else None)


_REFUSED = (
    *("open_connection", "open_unix_connection", "start_server", "start_unix_server", "subprocess", "Runner"),
    *("create_subprocess_exec", "create_subprocess_shell", "get_event_loop_policy", "set_event_loop_policy"),
    *("SelectorEventLoop", "DefaultEventLoopPolicy", "get_child_watcher", "set_child_watcher", "unix_events"),
    *("selector_events", "base_subprocess", "DefaultLoopFactory", "log", "runners", "threads"),
)
"""What needs sockets, pipes or processes, or would bring the machine's loop."""


class _Asyncio:
    """The functions of ``asyncio`` that concern loops, for one run."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._loops: dict[str, asyncio.AbstractEventLoop] = {}

    def _component(self) -> str:
        return waiting.current_task(self._kernel).context.component

    def new_event_loop(self) -> EventLoop:
        return EventLoop(self._kernel)

    def get_event_loop(self) -> asyncio.AbstractEventLoop:
        running = events._get_running_loop()
        if running is not None:
            return running
        found = self._loops.get(self._component())
        if found is None or found.is_closed():
            found = self._loops[self._component()] = self.new_event_loop()
        return found

    def set_event_loop(self, loop: asyncio.AbstractEventLoop | None) -> None:
        if loop is None:
            self._loops.pop(self._component(), None)
        else:
            self._loops[self._component()] = loop

    def run(self, main: Coroutine[Any, Any, Any], *, debug: bool | None = None) -> Any:
        if events._get_running_loop() is not None:
            raise RuntimeError("asyncio.run() cannot be called from a running event loop")
        loop = self.new_event_loop()
        try:
            return loop.run_until_complete(main)
        finally:
            left = asyncio.all_tasks(loop)
            for task in left:
                task.cancel()
            if left:
                loop.run_until_complete(asyncio.gather(*left, return_exceptions=True))
            loop.run_until_complete(loop.shutdown_asyncgens())
            loop.close()

    async def to_thread(self, func: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(None, partial(func, *args, **kwargs))

    def run_coroutine_threadsafe(
        self, coro: Coroutine[Any, Any, Any], loop: asyncio.AbstractEventLoop
    ) -> Future:
        future: Future = bind(self._kernel, (Future,))["Future"]()

        def finish(task: asyncio.Task[Any]) -> None:
            error = concurrent.futures.CancelledError() if task.cancelled() else task.exception()
            if error is None:
                future.set_result(task.result())
            else:
                future.set_exception(error)

        loop.call_soon_threadsafe(lambda: loop.create_task(coro).add_done_callback(finish))
        return future


def asyncio_modules(kernel: Kernel) -> dict[str, ModuleType]:
    """Return the replacements of ``asyncio`` and of the modules in it that are imported by name."""
    ours = _Asyncio(kernel)
    names = {
        name: value
        for name, value in vars(asyncio).items()
        if not name.startswith("_") and name not in _REFUSED
    }
    names.update({name: getattr(ours, name) for name in vars(_Asyncio) if not name.startswith("_")})
    parts = ("events", "exceptions", "futures", "locks", "queues", "tasks")
    return {
        "asyncio": make_module("asyncio", names),
        **{f"asyncio.{part}": vars(asyncio)[part] for part in parts},
    }
