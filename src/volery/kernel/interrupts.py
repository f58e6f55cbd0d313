"""Interrupts of virtual time from outside: Ctrl-C, and the watchdog for tasks that freeze it.

While a kernel runs in the main thread it owns SIGINT. Ctrl-C is posted to the hub, which raises it between
two events; if component code is running, it is also raised there at once, so that an endless loop ends. At
the prompt of an interactive session, where nothing of volery executes, it is raised at once as well. A
second Ctrl-C before the first was delivered is raised immediately. A handler that the user's program has
installed is called instead. The watchdog uses the same signal, since it also ends blocking system calls.
"""

from __future__ import annotations

import os
import signal
import sys
import sysconfig
import threading
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from volery.base.errors import ComponentError, UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType, TracebackType

    from volery.base.time import Ns
    from volery.kernel.api import Kernel
    from volery.kernel.task import Task

LONGEST_WAIT_S = 0.25
"""Longest single wait of the main thread: Python runs signal handlers between bytecodes, and a signal that
arrives just before the thread blocks does not wake it."""

SAMPLES_PER_PATIENCE = 4
"""Samples that the watchdog takes within the time that it allows."""

_FRAMEWORK = f"{Path(__file__).parents[1]}{os.sep}"
_EXAMPLES = f"{_FRAMEWORK}examples{os.sep}"
_LIBRARIES = (
    "<frozen",
    *{sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")},
)

_COMPILERS = ("numba", "llvmlite")


def _is_framework(frame: FrameType) -> bool:
    file = frame.f_code.co_filename
    return file.startswith(_FRAMEWORK) and not file.startswith(_EXAMPLES)


def _callers(frame: FrameType | None) -> Iterator[FrameType]:
    """Yield `frame` and its callers without those of libraries."""
    while frame is not None:
        if _is_framework(frame) or not frame.f_code.co_filename.startswith(_LIBRARIES):
            yield frame
        frame = frame.f_back


def is_component_code(frame: FrameType | None) -> bool:
    """Return whether component code executes, directly or in a library, and not the framework."""
    return not _is_framework(next(_callers(frame), frame)) if frame is not None else False


def is_outside(frame: FrameType | None) -> bool:
    """Return whether nothing of the framework executes: a script between two calls, a prompt."""
    return not any(_is_framework(each) for each in _callers(frame))


def is_compiling(frame: FrameType | None) -> bool:
    """Return whether numba compiles a function or reads one from its cache.

    A compiled function that executes has no frame, so an endless loop in one is none of this.
    """
    while frame is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] in _COMPILERS:
            return True
        frame = frame.f_back
    return False


def component_line(frame: FrameType | None) -> str:
    """Return ``file:line`` of the innermost line of component code, else of the framework."""
    caller = next((each for each in _callers(frame) if not _is_framework(each)), frame)
    return f"{caller.f_code.co_filename}:{caller.f_lineno}" if caller is not None else "an unknown line"


class StallReport(NamedTuple):
    """A task that has not blocked, and the virtual time at which it has not."""

    task: Task
    now: Ns
    what: str


class Interrupts:
    """Owner of SIGINT while it is entered, if it is entered in the main thread."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._before: Any = None
        self._entered = False
        self._lock = threading.Lock()  # a stall is reported while the handler is installed, or not at all
        self._stall: StallReport | None = None
        self._pending = False

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._handle)
            self._entered = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._entered:
            with self._lock:
                self._entered = False
                if (
                    signal.getsignal(signal.SIGINT) == self._handle
                ):  # else a later session passes it on to here
                    signal.signal(signal.SIGINT, self._before)
        if isinstance(error, KeyboardInterrupt):
            self._pending = False  # raised in component code before it was delivered
        self._deliver()

    def report_stall(self, task: Task, now: Ns, what: str) -> None:
        """Raise a ``ComponentError`` in `task` if it still executes at time `now`; from any thread."""
        main = threading.main_thread().ident
        with self._lock:
            if self._entered and main is not None:
                self._stall = StallReport(task, now, what)
                signal.pthread_kill(main, signal.SIGINT)  # also ends blocking calls, such as time.sleep

    def _handle(self, number: int, frame: FrameType | None) -> None:
        stall, self._stall = self._stall, None
        if stall is not None:
            self._raise_stall(stall, frame)
        elif self._entered and self._before is signal.default_int_handler:
            self._interrupt(frame)
        elif callable(self._before):
            self._before(number, frame)

    def _raise_stall(self, stall: StallReport, frame: FrameType | None) -> None:
        task, now, what = stall
        if self._kernel.current() is not task or self._kernel.now() != now:
            return
        error = ComponentError(
            task.context.component, f"virtual time is frozen: {what}, in {component_line(frame)}"
        )
        if is_component_code(frame):
            raise error
        task.pending_cancellation = task.pending_cancellation or error

    def _interrupt(self, frame: FrameType | None) -> None:
        if self._pending:
            raise KeyboardInterrupt
        task = self._kernel.current()
        if task is not None and task.adopted and is_outside(frame):
            raise KeyboardInterrupt
        in_component = task is not None and is_component_code(frame)
        if not (in_component and task is not None and task.adopted):
            self._pending = True
            self._kernel.post(self._deliver)
        if in_component:
            raise KeyboardInterrupt

    def _deliver(self) -> None:
        if self._pending:
            self._pending = False
            raise KeyboardInterrupt


class Watchdog:
    """Thread that reports a task which executes for `patience_s` of wall time at one virtual time.

    The flow of a script is exempt, since virtual time stands still while a script executes. So is the time
    in which numba compiles: what a component calls for the first time takes minutes on a busy machine.
    """

    def __init__(self, kernel: Kernel, interrupts: Interrupts, patience_s: float) -> None:
        if patience_s <= 0.0:
            raise UsageError(f"a watchdog of {patience_s} s; it must be above 0")
        self._kernel, self._interrupts, self._patience_s = kernel, interrupts, patience_s
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None
        self._seen: tuple[Task | None, Ns] = (None, 0)
        self._since = 0.0  # monotonic time at which `_seen` was first seen, s

    def start(self) -> None:
        """Watch until ``stop``."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stop watching."""
        self._stopped.set()

    def _watch(self) -> None:
        while not self._stopped.wait(self._patience_s / SAMPLES_PER_PATIENCE):
            main = threading.main_thread().ident
            frame = None if main is None else sys._current_frames().get(main)
            self.check(monotonic(), compiling=is_compiling(frame))

    def check(self, moment: float, *, compiling: bool = False) -> None:
        """Compare what runs at `moment`, monotonic seconds, with the previous sample."""
        task, now = self._kernel.current(), self._kernel.now()
        if compiling or task is None or task.adopted or self._seen != (task, now):
            self._seen, self._since = (task, now), moment
        elif moment - self._since >= self._patience_s:
            self._interrupts.report_stall(task, now, f"it has not let go for {self._patience_s:g} s")
            self._since = moment
