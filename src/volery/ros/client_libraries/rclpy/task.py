"""rclpy's ``Future`` and ``Task``: results that come later, and coroutines that an executor carries on."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Generator
from inspect import iscoroutinefunction
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from volery.ros.client_libraries.rclpy.executors import Executor


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
