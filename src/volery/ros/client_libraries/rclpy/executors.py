"""rclpy's callback groups: what may run while something else of the group runs.

rclpy's ``Future`` and ``Task``: results that come later, and coroutines that an executor carries on.

rclpy's executors: they wait for whatever becomes ready of their nodes, and run it.

What became ready first runs first; of several at one instant, that of the node and the group which came
first.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Coroutine, Generator
from inspect import iscoroutinefunction
from types import TracebackType
from typing import TYPE_CHECKING, Any, ClassVar, Self

from volery.base.time import Ns, from_seconds
from volery.kernel.waiting import Signal, current_task, end_activation
from volery.ros.client_libraries.rclpy.context import Context, Contexts
from volery.ros.client_libraries.rclpy.errors import ExternalShutdownException
from volery.ros.graph import Group
from volery.ros.graph.callbacks import Work

if TYPE_CHECKING:
    from volery.ros.client_libraries.rclpy.node import Node


class CallbackGroup:
    """A node's callbacks that share a rule. Each node that uses it has a queue of its own in it."""

    exclusive = True

    def __init__(self) -> None:
        self._running = 0

    def can_run(self) -> bool:
        """Whether another of its callbacks may start now."""
        return not (self.exclusive and self._running)

    def begin(self) -> None:
        """One of its callbacks starts."""
        self._running += 1

    def end(self) -> None:
        """One of its callbacks has ended."""
        self._running -= 1


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """One callback at a time."""


class ReentrantCallbackGroup(CallbackGroup):
    """Callbacks may run beside each other, and beside themselves."""

    exclusive = False


class Queue:
    """What is ready of one group of one node."""

    def __init__(self, group: CallbackGroup, ready: Group) -> None:
        self.group, self.ready = group, ready

    def take(self) -> Work:
        """The next one, paid for; the group has begun it."""
        work = self.ready.take()
        self.group.begin()
        return work


class Future:
    """A result that is not there yet. Its callbacks run when the executor spins, if it has one."""

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
        """Whether it has a result, failed, or was cancelled."""
        return self._done

    def cancelled(self) -> bool:
        """Whether it was cancelled."""
        return self._cancelled

    def cancel(self) -> None:
        """Nobody wants the result any more."""
        if not self._done:
            self._cancelled = True
            self._finish()

    def result(self) -> Any:
        """The result, ``None`` while there is none; raises what it failed with."""
        if self._exception is not None:
            raise self._exception
        return self._result

    def exception(self) -> BaseException | None:
        """What it failed with."""
        return self._exception

    def set_result(self, result: Any) -> None:
        """It is there."""
        self._result = result
        self._finish()

    def set_exception(self, exception: BaseException) -> None:
        """It will never be there."""
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
        """Call it when the result is there; soon, if it is."""
        if self._done:
            self._call(callback)
        else:
            self._callbacks.append(callback)


class Task(Future):
    """A function or a coroutine that an executor carries out; its result is the future's."""

    def __init__(self, handler: Callable[..., Any], args: tuple[Any, ...], executor: Executor) -> None:
        super().__init__(executor=executor)
        self._handler, self._args = handler, args
        self._coroutine: Coroutine[Any, Any, Any] | None = None

    def __call__(self) -> None:
        """Carry on until it waits for a future or has ended."""
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
            self._wait_for(awaited)

    def _wait_for(self, awaited: Any) -> None:
        assert self._executor is not None
        if isinstance(awaited, Future) and not awaited.done():
            awaited.add_done_callback(lambda _: self._carry_on())
        else:
            self._carry_on()

    def _carry_on(self) -> None:
        assert self._executor is not None
        self._executor.later(self)


Run = Callable[[], None]


def _within(timeout_sec: float | None) -> Ns | None:
    """rclpy's time-outs: ``None`` and negative ones are for ever."""
    return None if timeout_sec is None or timeout_sec < 0 else from_seconds(timeout_sec)


class Executor:
    """What all executors share."""

    contexts: ClassVar[Contexts]

    def __init__(self, *, context: Context | None = None) -> None:
        self._context = context or self.contexts.here()
        self._kernel = self._context.kernel
        self._nodes: list[Node] = []
        self._tasks: deque[tuple[Ns, Task]] = deque()
        self._filled = Signal(self._kernel, "an executor's callbacks")
        self._over = False
        self._context.when_over(self.wake)

    @property
    def context(self) -> Context:
        """The context that it belongs to."""
        return self._context

    # -- nodes and tasks

    def add_node(self, node: Node) -> bool:
        """Spin this node, too; False if it does already."""
        if node in self._nodes:
            return False
        self._nodes.append(node)
        node.executor = self
        return True

    def remove_node(self, node: Node) -> None:
        """Spin it no longer."""
        if node in self._nodes:
            self._nodes.remove(node)
            node.drop_executor(self)

    def get_nodes(self) -> list[Node]:
        """The nodes that it spins."""
        return list(self._nodes)

    def create_task(self, callback: Callable[..., Any], *args: Any, **fields: Any) -> Task:
        """Carry out a function or a coroutine when it spins."""
        task = Task(lambda: callback(*args, **fields), (), self) if fields else Task(callback, args, self)
        self.later(task)
        return task

    def later(self, task: Task) -> None:
        """Carry *task* on when it spins."""
        self._tasks.append((self._kernel.now(), task))
        self.wake()

    def wake(self) -> None:
        """Let it look again. House code may call it."""
        self._filled.notify()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Stop spinning and let go of the nodes."""
        self._over = True
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
        """Run callbacks as they come until the context or this executor is shut down."""
        while self._context.ok() and not self._over:
            self.spin_once()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait for a callback and run it."""
        found = self._wait(_within(timeout_sec))
        if found is not None:
            self._run(found)

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks as they come until *future* is done."""
        future.add_done_callback(lambda _: self.wake())
        within = _within(timeout_sec)
        until = None if within is None else self._kernel.now() + within
        while self._context.ok() and not future.done() and not self._over:
            left = None if until is None else until - self._kernel.now()
            if left is not None and left < 0:
                return
            found = self._wait(left, future)
            if found is None:
                return
            self._run(found)

    def spin_once_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Wait for a callback and run it, unless *future* is done first."""
        found = None if future.done() else self._wait(_within(timeout_sec), future)
        if found is not None:
            self._run(found)

    def _run(self, run: Run) -> None:
        run()

    def _wait(self, within: Ns | None, future: Future | None = None) -> Run | None:
        """What is to run next; ``None`` if nothing came in time or *future* is done."""

        def ready() -> bool:
            done = future is not None and future.done()
            return done or self._next() is not None or self._over or not self._context.running

        with self._kernel as kernel:
            if within != 0:
                end_activation(kernel)
                self._filled.wait_for(ready, within)
            found = self._next()
            arrived = kernel.now() if found is None else found[0]
            run = found[1]() if found is not None else None
            if within != 0:
                current_task(kernel).release(arrived)
        if run is None and not self._context.running:
            self._interrupted()
        return run

    def _interrupted(self) -> None:
        """The context was shut down while it waited."""
        raise ExternalShutdownException()

    def _next(self) -> tuple[Ns, Callable[[], Run]] | None:
        """What has been ready longest, and how it is taken."""
        best: tuple[Ns, Callable[[], Run]] | None = None
        if self._tasks:
            best = self._tasks[0][0], self._take_task
        for node in self._nodes:
            for queue in node.queues:
                since = queue.ready.oldest
                if since is not None and queue.group.can_run() and (best is None or since < best[0]):
                    best = since, lambda queue=queue: self._take(queue)
        return best

    def _take_task(self) -> Run:
        return self._tasks.popleft()[1]

    def _take(self, queue: Queue) -> Run:
        work: Work = queue.take()

        def run() -> None:
            try:
                work.run()
            finally:
                queue.group.end()
                self.wake()

        return run


class SingleThreadedExecutor(Executor):
    """One callback after the other."""


class MultiThreadedExecutor(Executor):
    """Each callback in a task of its own, at most *num_threads* at once (4 unless it is given).

    Tasks never run at the same instant as each other's Python code, but while one waits another goes on.
    """

    def __init__(self, num_threads: int | None = None, *, context: Context | None = None) -> None:
        super().__init__(context=context)
        self._free = num_threads or 4
        self._failed: list[BaseException] = []

    def _next(self) -> tuple[Ns, Callable[[], Run]] | None:
        return super()._next() if self._free > 0 else None

    def _run(self, run: Run) -> None:
        self._free -= 1

        def body() -> None:
            try:
                run()
            except Exception as error:
                self._failed.append(error)
            finally:
                self._free += 1
                self.wake()

        self._context.spawn(body, "executor's thread")
        self._raise_failed()

    def _interrupted(self) -> None:
        """Threads end quietly, as rclpy's do."""

    def _raise_failed(self) -> None:
        if self._failed:
            raise self._failed.pop(0)

    def _wait(self, within: Ns | None, future: Future | None = None) -> Run | None:
        found = super()._wait(within, future)
        self._raise_failed()
        return found
