"""rclpy's executors, callback groups, futures and tasks.

An executor waits until a callback of one of its nodes is ready and runs it. The callback that became ready
first runs first; of several at one instant, the one of the node and the group that were created first.

These classes share one module because each refers to the others: a future schedules its callbacks on an
executor, a task runs on an executor, and an executor takes callbacks from the queues of callback groups.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Coroutine, Generator, Sequence
from inspect import iscoroutinefunction
from types import TracebackType
from typing import Any, ClassVar, Protocol, Self

from volery.base.time import Ns, from_seconds
from volery.kernel.waiting import Signal, current_task, end_activation
from volery.ros.client_libraries.rclpy.context import Context, Contexts, ExternalShutdownException
from volery.ros.graph import Group, Work

Run = Callable[[], None]


# -- callback groups


class CallbackGroup:
    """Callbacks of a node that share a rule about concurrency. Each node has its own queue for a group."""

    exclusive = True

    def __init__(self) -> None:
        self._running = 0

    def can_run(self) -> bool:
        """Return whether another callback of the group may start now."""
        return not (self.exclusive and self._running)

    def begin(self) -> None:
        """Record that a callback starts."""
        self._running += 1

    def end(self) -> None:
        """Record that a callback has ended."""
        self._running -= 1


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """One callback at a time."""


class ReentrantCallbackGroup(CallbackGroup):
    """Callbacks may run concurrently, also several runs of one callback."""

    exclusive = False


class CallbackQueue:
    """Ready callbacks of one group of one node."""

    def __init__(self, group: CallbackGroup, ready: Group) -> None:
        self.group, self.ready = group, ready

    def take(self) -> Work:
        """Remove and return the next callback. Its cost is charged and its group has begun it."""
        work = self.ready.take()
        self.group.begin()
        return work


# -- futures and tasks


class Future:
    """A result that is available later. Its callbacks run on *executor*, or at once without one."""

    def __init__(self, *, executor: Executor | None = None) -> None:
        self._executor = executor
        self._done = self._cancelled = False
        self._result: Any = None
        self._exception: BaseException | None = None
        self._callbacks: list[Callable[[Future], Any]] = []

    def __await__(self) -> Generator[Future, None, Any]:
        while not self._done:
            yield self
        return self.result()

    def done(self) -> bool:
        """Return whether the future has a result, has failed or was cancelled."""
        return self._done

    def cancelled(self) -> bool:
        """Return whether the future was cancelled."""
        return self._cancelled

    def cancel(self) -> None:
        """Cancel the future, unless it is done."""
        if not self._done:
            self._cancelled = True
            self._finish()

    def result(self) -> Any:
        """Return the result, or None while there is none. Raises the exception of a failed future."""
        if self._exception is not None:
            raise self._exception
        return self._result

    def exception(self) -> BaseException | None:
        """Return the exception of a failed future, or None."""
        return self._exception

    def set_result(self, result: Any) -> None:
        """Complete the future with a result."""
        self._result = result
        self._finish()

    def set_exception(self, exception: BaseException) -> None:
        """Complete the future with a failure."""
        self._exception = exception
        self._finish()

    def _finish(self) -> None:
        self._done = True
        callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            self._call(callback)

    def _call(self, callback: Callable[[Future], Any]) -> None:
        if self._executor is None:
            callback(self)
        else:
            self._executor.create_task(callback, self)

    def add_done_callback(self, callback: Callable[[Future], Any]) -> None:
        """Call *callback* with the future when it is done, or soon if it already is."""
        if self._done:
            self._call(callback)
        else:
            self._callbacks.append(callback)


class Task(Future):
    """A function or coroutine that an executor runs. Its result is the result of the future."""

    def __init__(self, handler: Callable[..., Any], args: tuple[Any, ...], executor: Executor) -> None:
        super().__init__(executor=executor)
        self._scheduler = executor
        self._handler, self._args = handler, args
        self._coroutine: Coroutine[Any, Any, Any] | None = None

    def __call__(self) -> None:
        """Run until the coroutine waits for a future or has ended."""
        try:
            if self._coroutine is None and not iscoroutinefunction(self._handler):
                self.set_result(self._handler(*self._args))
                return
            if self._coroutine is None:
                self._coroutine = self._handler(*self._args)
            awaited = self._coroutine.send(None)
        except StopIteration as end:
            self.set_result(end.value)
        except Exception as error:
            self.set_exception(error)
            raise
        else:
            if isinstance(awaited, Future) and not awaited.done():
                awaited.add_done_callback(lambda _: self._scheduler.schedule(self))
            else:
                self._scheduler.schedule(self)


# -- executors


class ExecutorNode(Protocol):
    """What an executor uses of a node."""

    @property
    def queues(self) -> Sequence[CallbackQueue]:
        """The queues of the node's callback groups, in the order of their creation."""

    def attach_executor(self, executor: Executor) -> None:
        """Let *executor* spin the node from now on."""

    def detach_executor(self, executor: Executor) -> None:
        """Stop using *executor*, if it spins the node."""


def _timeout_ns(timeout_sec: float | None) -> Ns | None:
    """Return a time-out of rclpy in ns. None and negative values mean no time-out."""
    return None if timeout_sec is None or timeout_sec < 0 else from_seconds(timeout_sec)


class Executor:
    """Base class of all executors."""

    contexts: ClassVar[Contexts]

    def __init__(self, *, context: Context | None = None) -> None:
        self._context = context or self.contexts.current()
        self._kernel = self._context.kernel
        self._nodes: list[ExecutorNode] = []
        self._tasks: deque[tuple[Ns, Task]] = deque()
        self._changed = Signal(self._kernel, "an executor's callbacks")
        self._is_shutdown = False
        self._context.on_end(self.wake)

    @property
    def context(self) -> Context:
        """Context of the executor."""
        return self._context

    # -- nodes and tasks

    def add_node(self, node: ExecutorNode) -> bool:
        """Spin *node* as well; return False if the executor already does."""
        if node in self._nodes:
            return False
        self._nodes.append(node)
        node.attach_executor(self)
        return True

    def remove_node(self, node: ExecutorNode) -> None:
        """Stop spinning *node*."""
        if node in self._nodes:
            self._nodes.remove(node)
            node.detach_executor(self)

    def get_nodes(self) -> list[ExecutorNode]:
        """Return the nodes that the executor spins."""
        return list(self._nodes)

    def create_task(self, callback: Callable[..., Any], *args: Any, **fields: Any) -> Task:
        """Run a function or coroutine when the executor spins."""
        task = Task(lambda: callback(*args, **fields), (), self) if fields else Task(callback, args, self)
        self.schedule(task)
        return task

    def schedule(self, task: Task) -> None:
        """Start or continue *task* when the executor spins."""
        self._tasks.append((self._kernel.now(), task))
        self.wake()

    def wake(self) -> None:
        """Check again for ready callbacks. May be called from framework callbacks."""
        self._changed.notify()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Stop spinning and remove all nodes."""
        self._is_shutdown = True
        for node in tuple(self._nodes):
            self.remove_node(node)
        self.wake()
        return True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.shutdown()

    # -- spinning

    def spin(self) -> None:
        """Run callbacks until the context or this executor is shut down."""
        while self._context.ok() and not self._is_shutdown:
            self.spin_once()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait for a callback and run it."""
        found = self._wait(_timeout_ns(timeout_sec))
        if found is not None:
            self._run(found)

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks until *future* is done."""
        future.add_done_callback(lambda _: self.wake())
        within = _timeout_ns(timeout_sec)
        until = None if within is None else self._kernel.now() + within
        while self._context.ok() and not future.done() and not self._is_shutdown:
            left = None if until is None else until - self._kernel.now()
            if left is not None and left < 0:
                return
            found = self._wait(left, future)
            if found is None:
                return
            self._run(found)

    def spin_once_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Wait for a callback and run it, unless *future* is done first."""
        found = None if future.done() else self._wait(_timeout_ns(timeout_sec), future)
        if found is not None:
            self._run(found)

    def _run(self, run: Run) -> None:
        run()

    def _wait(self, within: Ns | None, future: Future | None = None) -> Run | None:
        """Return what to run next, or None after a time-out or when *future* is done."""

        def ready() -> bool:
            done = future is not None and future.done()
            return done or self._next() is not None or self._is_shutdown or not self._context.running

        with self._kernel as kernel:
            if within != 0:
                end_activation(kernel)
                self._changed.wait_for(ready, within)
            found = self._next()
            arrived = kernel.now() if found is None else found[0]
            run = found[1]() if found is not None else None
            if within != 0:
                current_task(kernel).release(arrived)
        if run is None and not self._context.running:
            self._on_context_shutdown()
        return run

    def _on_context_shutdown(self) -> None:
        """Handle a context that was shut down while the executor waited."""
        raise ExternalShutdownException()

    def _next(self) -> tuple[Ns, Callable[[], Run]] | None:
        """Return the ready time of what has been ready longest, and the function that takes it."""
        best: tuple[Ns, Callable[[], Run]] | None = None
        if self._tasks:
            best = self._tasks[0][0], lambda: self._tasks.popleft()[1]
        for node in self._nodes:
            for queue in node.queues:
                since = queue.ready.oldest
                if since is not None and queue.group.can_run() and (best is None or since < best[0]):
                    best = since, lambda queue=queue: self._take(queue)
        return best

    def _take(self, queue: CallbackQueue) -> Run:
        work: Work = queue.take()

        def run() -> None:
            try:
                work.run()
            finally:
                queue.group.end()
                self.wake()

        return run


class SingleThreadedExecutor(Executor):
    """Runs one callback after the other."""


class MultiThreadedExecutor(Executor):
    """Runs each callback in a task of its own, at most *num_threads* at once (4 by default).

    Two tasks never execute Python code at the same instant, but while one waits another continues.
    """

    def __init__(self, num_threads: int | None = None, *, context: Context | None = None) -> None:
        super().__init__(context=context)
        self._free = num_threads or 4
        self._errors: list[BaseException] = []

    def _next(self) -> tuple[Ns, Callable[[], Run]] | None:
        return super()._next() if self._free > 0 else None

    def _run(self, run: Run) -> None:
        self._free -= 1

        def body() -> None:
            try:
                run()
            except Exception as error:
                self._errors.append(error)
            finally:
                self._free += 1
                self.wake()

        self._context.spawn(body, "executor's thread")
        self._raise_error()

    def _on_context_shutdown(self) -> None:
        """Return without an exception, as rclpy's executor threads do."""

    def _raise_error(self) -> None:
        if self._errors:
            raise self._errors.pop(0)

    def _wait(self, within: Ns | None, future: Future | None = None) -> Run | None:
        found = super()._wait(within, future)
        self._raise_error()
        return found
