"""What reaches the house from outside of virtual time: Ctrl-C, and the watchdog's accusations.

While the house runs in the main thread it owns SIGINT, and takes it where nothing of its own is half done.
Ctrl-C is posted to the hub, which raises it between two events; if user code is running it is also raised
there at once, so that an endless loop ends. A second Ctrl-C before the first was delivered is raised on the
spot. A handler that somebody else has installed is called instead.
"""

from __future__ import annotations

import os
import signal
import sysconfig
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from volery.base.errors import ComponentError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType, TracebackType

    from volery.base.time import Ns
    from volery.kernel.api import Kernel
    from volery.kernel.task import Task

LONGEST_WAIT_S = 0.25
"""The main thread waits for nothing longer than this at a stretch: Python runs handlers between bytecodes,
and a signal that arrives just before the thread falls asleep does not wake it."""

_HOUSE = f"{Path(__file__).parents[1]}{os.sep}"
_EXAMPLES = f"{_HOUSE}examples{os.sep}"
_LIBRARIES = (
    "<frozen",
    *{sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")},
)


def _is_house(frame: FrameType) -> bool:
    file = frame.f_code.co_filename
    return file.startswith(_HOUSE) and not file.startswith(_EXAMPLES)


def _outwards(frame: FrameType | None) -> Iterator[FrameType]:
    """*frame* and its callers, libraries left out."""
    while frame is not None:
        if _is_house(frame) or not frame.f_code.co_filename.startswith(_LIBRARIES):
            yield frame
        frame = frame.f_back


def is_users(frame: FrameType | None) -> bool:
    """Whether it is user code that is at work, and not the house on its behalf."""
    return not _is_house(next(_outwards(frame), frame)) if frame is not None else False


def users_line(frame: FrameType | None) -> str:
    """``file:line`` of the innermost line of user code; of a house that is all alone, its own."""
    found = next((each for each in _outwards(frame) if not _is_house(each)), frame)
    return f"{found.f_code.co_filename}:{found.f_lineno}" if found is not None else "an unknown line"


class Accusation(NamedTuple):
    """It was this task, at this virtual time, that would not let go."""

    task: Task
    now: Ns
    what: str


class Interrupts:
    """Owns SIGINT within its context, if that is entered in the main thread."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._before: Any = None
        self._lock = threading.Lock()  # an accusation is made while the handler is in place, or not at all
        self._accusation: Accusation | None = None
        self._pending = False

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._taken)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._before is not None:
            with self._lock:
                signal.signal(signal.SIGINT, self._before)
                self._before = None
        if isinstance(error, KeyboardInterrupt):
            self._pending = False  # raised in user code before it was delivered
        self._deliver()

    def accuse(self, task: Task, now: Ns, what: str) -> None:
        """Raise a ``ComponentError`` in *task* if it is still at work at *now*. From any thread."""
        main = threading.main_thread().ident
        with self._lock:
            if self._before is not None and main is not None:
                self._accusation = Accusation(task, now, what)
                signal.pthread_kill(main, signal.SIGINT)  # ends blocking calls too, such as time.sleep

    def _taken(self, number: int, frame: FrameType | None) -> None:
        accusation, self._accusation = self._accusation, None
        if accusation is not None:
            self._confront(accusation, frame)
        elif self._before is signal.default_int_handler:
            self._interrupt(frame)
        elif callable(self._before):
            self._before(number, frame)

    def _confront(self, accusation: Accusation, frame: FrameType | None) -> None:
        task, now, what = accusation
        if self._kernel.current() is not task or self._kernel.now() != now:
            return
        error = ComponentError(
            task.place.component, f"virtual time is frozen: {what}, in {users_line(frame)}"
        )
        if is_users(frame):
            raise error
        task.summons = task.summons or error

    def _interrupt(self, frame: FrameType | None) -> None:
        if self._pending:
            raise KeyboardInterrupt
        task = self._kernel.current()
        in_user_code = task is not None and is_users(frame)
        if not (in_user_code and task is not None and task.adopted):
            self._pending = True
            self._kernel.post(self._deliver)
        if in_user_code:
            raise KeyboardInterrupt

    def _deliver(self) -> None:
        if self._pending:
            self._pending = False
            raise KeyboardInterrupt
