"""What reaches the house from outside of virtual time: Ctrl-C, and the watchdog's accusations.

While the house runs in the main thread it owns SIGINT, and takes it where nothing of its own is half done.
Ctrl-C is posted to the hub, which raises it between two events; if user code is running it is also raised
there at once, so that an endless loop ends. A second Ctrl-C before the first was delivered is raised on the
spot. A handler that somebody else has installed is called instead.

Names code that freezes virtual time: a task that runs on the host, and virtual time does not move.

It samples now and then from a thread of its own and costs nothing in between.
"""

from __future__ import annotations

import os
import signal
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


def is_component_code(frame: FrameType | None) -> bool:
    """Whether it is user code that is at work, and not the house on its behalf."""
    return not _is_house(next(_outwards(frame), frame)) if frame is not None else False


def component_line(frame: FrameType | None) -> str:
    """``file:line`` of the innermost line of user code; of a house that is all alone, its own."""
    found = next((each for each in _outwards(frame) if not _is_house(each)), frame)
    return f"{found.f_code.co_filename}:{found.f_lineno}" if found is not None else "an unknown line"


class StallReport(NamedTuple):
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
        self._accusation: StallReport | None = None
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
                self._accusation = StallReport(task, now, what)
                signal.pthread_kill(main, signal.SIGINT)  # ends blocking calls too, such as time.sleep

    def _taken(self, number: int, frame: FrameType | None) -> None:
        accusation, self._accusation = self._accusation, None
        if accusation is not None:
            self._confront(accusation, frame)
        elif self._before is signal.default_int_handler:
            self._interrupt(frame)
        elif callable(self._before):
            self._before(number, frame)

    def _confront(self, accusation: StallReport, frame: FrameType | None) -> None:
        task, now, what = accusation
        if self._kernel.current() is not task or self._kernel.now() != now:
            return
        error = ComponentError(
            task.place.component, f"virtual time is frozen: {what}, in {component_line(frame)}"
        )
        if is_component_code(frame):
            raise error
        task.summons = task.summons or error

    def _interrupt(self, frame: FrameType | None) -> None:
        if self._pending:
            raise KeyboardInterrupt
        task = self._kernel.current()
        in_user_code = task is not None and is_component_code(frame)
        if not (in_user_code and task is not None and task.adopted):
            self._pending = True
            self._kernel.post(self._deliver)
        if in_user_code:
            raise KeyboardInterrupt

    def _deliver(self) -> None:
        if self._pending:
            self._pending = False
            raise KeyboardInterrupt


SAMPLES = 4
"""How often it looks within the time that it allows."""


class Watchdog:
    """Has a task accused that runs for *patience_s* seconds on the wall at one and the same virtual time.

    The flow of a script is exempt: virtual time stands still while that runs.
    """

    def __init__(self, kernel: Kernel, interrupts: Interrupts, patience_s: float) -> None:
        if patience_s <= 0.0:
            raise UsageError(f"a watchdog of {patience_s} s; it must be above 0")
        self._kernel, self._interrupts, self._patience_s = kernel, interrupts, patience_s
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None
        self._seen: tuple[Task | None, Ns] = (None, 0)
        self._since = 0.0  # on the wall: when it was first seen so

    def start(self) -> None:
        """Watch until ``stop``."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Watch no more."""
        self._stopped.set()

    def _watch(self) -> None:
        while not self._stopped.wait(self._patience_s / SAMPLES):
            self.look(monotonic())

    def look(self, moment: float) -> None:
        """Compare what runs at this *moment*, seconds on the wall, with what ran when it last looked."""
        task, now = self._kernel.current(), self._kernel.now()
        if task is None or task.adopted or self._seen != (task, now):
            self._seen, self._since = (task, now), moment
        elif moment - self._since >= self._patience_s:
            self._interrupts.accuse(task, now, f"it has not let go for {self._patience_s:g} s")
            self._since = moment
