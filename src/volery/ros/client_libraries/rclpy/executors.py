"""rclpy's executors, callback groups, futures and tasks.

An executor waits until a callback of one of its nodes is ready and runs it. The callback that became ready
first runs first; of several at one instant, the one of the node and the group that were created first.

These classes share one module because each refers to the others: a future schedules its callbacks on an
executor, a task runs on an executor, and an executor takes callbacks from the queues of callback groups.
"""

from __future__ import annotations

from asyncio import AbstractEventLoop, _get_running_loop
from collections import deque
from collections.abc import Callable, Coroutine, Generator, Sequence
from contextvars import ContextVar
from functools import partial
from inspect import iscoroutine
from types import TracebackType
from typing import Any, ClassVar, NamedTuple, Protocol, Self
from weakref import WeakSet

from volery.base.time import US, Ns, from_seconds
from volery.kernel.waiting import Signal, current_task, end_activation, poll
from volery.ros.client_libraries.rclpy.context import (
    ConditionReachedException,
    Context,
    Contexts,
    ExternalShutdownException,
    ShutdownException,
    TimeoutException,
)
from volery.ros.graph import ReadyCallbacks, Work

Run = Callable[[], None]

EMPTY_SPIN: Ns = 80 * US
"""Time of ``spin_once(timeout_sec=0)`` that finds no callback, ns; of rclpy Jazzy, measured."""


class Ready(NamedTuple):
    """What an executor may run next: since when, what takes it, and the queue and node that it is of."""

    since: Ns
    take: Callable[[], Run | None]
    queue: CallbackQueue | None = None
    node: Any = None


# -- callback groups


class CallbackGroup:
    """Callbacks of a node that share a rule about concurrency. Each node has its own queue for a group.

    Subclasses of users decide by ``can_execute`` and ``beginning_execution``. The entity that they get is
    that of the queue, or None if the queue has several.
    """

    def __init__(self) -> None:
        self.entities: WeakSet[Any] = WeakSet()

    def add_entity(self, entity: Any) -> None:
        """Record an entity of the group."""
        self.entities.add(entity)

    def has_entity(self, entity: Any) -> bool:
        """Return whether an entity is of the group."""
        return entity in self.entities

    def can_execute(self, entity: Any) -> bool:
        """Return whether another callback of the group may start now."""
        return True

    def beginning_execution(self, entity: Any) -> bool:
        """Record that a callback starts; return False if it may not."""
        return True

    def ending_execution(self, entity: Any) -> None:
        """Record that a callback has ended."""


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """One callback at a time."""

    def __init__(self) -> None:
        super().__init__()
        self._running = False

    def can_execute(self, entity: Any) -> bool:
        """Return whether no callback of the group runs."""
        return not self._running

    def beginning_execution(self, entity: Any) -> bool:
        """Record that a callback starts; return False if another one runs."""
        free, self._running = not self._running, True
        return free

    def ending_execution(self, entity: Any) -> None:
        """Record that a callback has ended."""
        self._running = False


class ReentrantCallbackGroup(CallbackGroup):
    """Callbacks may run concurrently, also several runs of one callback."""


class CallbackQueue:
    """Ready callbacks of one group of one node."""

    def __init__(self, group: CallbackGroup, ready: ReadyCallbacks) -> None:
        self.group, self.ready = group, ready
        self._entities: list[Any] = []

    def add(self, entity: Any) -> None:
        """Record an entity whose callbacks go into this queue."""
        self._entities.append(entity)
        self.group.add_entity(entity)

    @property
    def entity(self) -> Any:
        """The only entity of the queue, or None."""
        return self._entities[0] if len(self._entities) == 1 else None


# -- futures and tasks

_in_task: ContextVar[bool] = ContextVar("in a coroutine that an executor of rclpy runs", default=False)


class Future:
    """A result that is available later. Its callbacks run on *executor*, or at once without one."""

    def __init__(self, *, executor: Executor | None = None) -> None:
        self._executor = executor
        self._done = self._cancelled = False
        self._result: Any = None
        self._exception: BaseException | None = None
        self._callbacks: list[Callable[[Future], Any]] = []
        self._at_once: list[Callable[[], Any]] = []

    def __await__(self) -> Generator[Any, None, Any]:
        while not self._done:
            loop = None if _in_task.get() else _get_running_loop()
            if loop is None:
                yield self
            else:
                yield from self._in_loop(loop)
        return self.result()

    def _in_loop(self, loop: AbstractEventLoop) -> Generator[Any, None, None]:
        """Wait in a coroutine that a loop of asyncio runs."""
        done = loop.create_future()

        def finish() -> None:
            if not done.done():
                done.set_result(None)

        self.on_done(lambda: loop.call_soon_threadsafe(finish))
        yield from done

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
        for action in self._at_once:
            action()
        callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            self._call(callback)

    def on_done(self, action: Callable[[], Any]) -> None:
        """Call *action* when the future is done, at once and not by the executor."""
        if self._done:
            action()
        else:
            self._at_once.append(action)

    def abandon(self) -> None:
        """Forget all callbacks: the future will not be completed."""
        self._callbacks.clear()
        self._at_once.clear()

    def _call(self, callback: Callable[[Future], Any]) -> None:
        if self._executor is None:
            callback(self)
        else:
            self._executor.create_task(callback, self)

    def remove_done_callback(self, callback: Callable[[Future], Any]) -> bool:
        """Remove a callback; return whether it was there."""
        found = callback in self._callbacks
        if found:
            self._callbacks.remove(callback)
        return found

    def add_done_callback(self, callback: Callable[[Future], Any]) -> None:
        """Call *callback* with the future when it is done, or soon if it already is."""
        if self._done:
            self._call(callback)
        else:
            self._callbacks.append(callback)


class Task(Future):
    """A function or coroutine that an executor runs. Its result is the result of the future."""

    def __init__(
        self,
        handler: Callable[..., Any] | Coroutine[Any, Any, Any],
        args: tuple[Any, ...],
        executor: Executor,
    ) -> None:
        super().__init__(executor=executor)
        self._scheduler = executor
        self._handler, self._args = handler, args
        self._coroutine: Coroutine[Any, Any, Any] | None = None
        self._executing = False

    def executing(self) -> bool:
        """Return whether the task runs now."""
        return self._executing

    def __call__(self) -> None:
        """Run until the coroutine waits for a future or has ended."""
        if self._done or self._executing:
            return
        self._executing = True
        try:
            self._step()
        finally:
            self._executing = False

    def _step(self) -> None:
        try:
            if self._coroutine is None:
                made = self._handler(*self._args) if callable(self._handler) else self._handler
                if not iscoroutine(made):
                    self.set_result(made)
                    return
                self._coroutine = made
            token = _in_task.set(True)
            try:
                awaited = self._coroutine.send(None)
            finally:
                _in_task.reset(token)
        except StopIteration as end:
            self.set_result(end.value)
        except Exception as error:
            self.set_exception(error)
            raise
        else:
            if isinstance(awaited, Future) and not awaited.done():
                awaited.on_done(lambda: self._scheduler.schedule(self))
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
        self._taken = Ready(0, lambda: None)
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

    def create_task(self, callback: Any, *args: Any, **fields: Any) -> Task:
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
        future.on_done(self.wake)
        within = _timeout_ns(timeout_sec)
        until = None if within is None else self._kernel.now() + within
        while self._context.ok() and not future.done() and not self._is_shutdown:
            left = None if until is None else until - self._kernel.now()
            if left is not None and left < 0:
                return
            found = self._wait(left, future.done)
            if found is None:
                return
            self._run(found)

    def spin_once_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Wait for a callback and run it, unless *future* is done first."""
        found = None if future.done() else self._wait(_timeout_ns(timeout_sec), future.done)
        if found is not None:
            self._run(found)

    def wait_for_ready_callbacks(
        self,
        timeout_sec: float | None = None,
        nodes: Any = None,
        condition: Callable[[], bool] = lambda: False,
    ) -> tuple[Task, Any, Any]:
        """Return the next callback as a task, its entity and its node, for executors of users.

        Raises:
            TimeoutException: Nothing became ready in time.
            ShutdownException: The executor was shut down.
            ConditionReachedException: *condition* holds.
        """
        from_nodes = None if nodes is None else list(nodes)
        run = self._wait(_timeout_ns(timeout_sec), condition, from_nodes)
        if run is None:
            if self._is_shutdown:
                raise ShutdownException()
            raise ConditionReachedException() if condition() else TimeoutException()
        task = run if isinstance(run, Task) else Task(run, (), self)
        return task, self._taken.queue and self._taken.queue.entity, self._taken.node

    def can_execute(self, entity: Any) -> bool:
        """Return whether the callback group of an entity lets it run."""
        return bool(entity.callback_group.can_execute(entity))

    def _run(self, run: Run) -> None:
        run()

    def _wait(
        self, within: Ns | None, ends: Callable[[], bool] = lambda: False, nodes: list[Any] | None = None
    ) -> Run | None:
        """Return what to run next, or None after a time-out or when *ends* holds."""
        found: Ready | None = None

        def ready() -> bool:
            nonlocal found
            found = self._next(nodes)
            return found is not None or self._is_shutdown or not self._context.running or ends()

        if within == 0 and not ready():
            poll(self._kernel, EMPTY_SPIN, executed=True)
        while True:
            kernel = self._kernel
            with kernel.interact():
                if within != 0:
                    end_activation(kernel)
                    self._changed.wait_for(ready, within)
                else:
                    found = self._next(nodes)
                arrived = kernel.now() if found is None else found.since
                run = None
                if found is not None:
                    self._taken = found
                    run = found.take()
                if within != 0:
                    current_task(kernel).release(arrived)
            if found is None or run is not None:
                break
        if run is None and not self._context.running and not self._is_shutdown:
            self._on_context_shutdown()
        return run

    def _on_context_shutdown(self) -> None:
        """Handle a context that was shut down while the executor waited."""
        raise ExternalShutdownException()

    def _next(self, nodes: list[Any] | None = None) -> Ready | None:
        """Return what has been ready longest."""
        best: Ready | None = None
        if self._tasks:
            best = Ready(self._tasks[0][0], lambda: self._tasks.popleft()[1])
        for node in self._nodes if nodes is None else nodes:
            for queue in node.queues:
                since = queue.ready.oldest
                if since is None or (best is not None and since >= best.since):
                    continue
                if queue.group.can_execute(queue.entity):
                    best = Ready(since, partial(self._take, queue), queue, node)
        return best

    def _take(self, queue: CallbackQueue) -> Run | None:
        """Remove the next callback of a queue; None if its group does not let it begin."""
        if not queue.group.beginning_execution(queue.entity):
            return None
        work: Work = queue.ready.take()  # which charges its cost

        def run() -> None:
            try:
                work.run()
            finally:
                queue.group.ending_execution(queue.entity)
                self.wake()

        return run


async def await_or_execute(callback: Any, *args: Any) -> Any:
    """Return the result of a function or of a coroutine function."""
    found = callback(*args)
    return await found if iscoroutine(found) else found


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

    def _next(self, nodes: list[Any] | None = None) -> Ready | None:
        return super()._next(nodes) if self._free > 0 else None

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

    def _wait(
        self, within: Ns | None, ends: Callable[[], bool] = lambda: False, nodes: list[Any] | None = None
    ) -> Run | None:
        found = super()._wait(within, ends, nodes)
        self._raise_error()
        return found
