"""Ctrl-C, taken where nothing of the house is half done.

While the house runs in the main thread it owns SIGINT. An interrupt is posted to the hub, which raises it
between two events; if user code is running it is also raised there at once, so that an endless loop ends. A
second Ctrl-C before the first was delivered is raised on the spot. A handler that somebody else has installed
is called instead.
"""

from __future__ import annotations

import signal
import sysconfig
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from types import FrameType

    from volery.kernel.api import Kernel

_HOUSE = str(Path(__file__).parents[1])
_EXAMPLES = str(Path(_HOUSE, "examples"))
_LIBRARIES = tuple({sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")})


def users_frame(frame: FrameType | None) -> FrameType | None:
    """The innermost frame, from *frame* outwards, of code that is neither the house's nor a library's.

    ``None`` if the house stands nearer than any such frame: then it is the house that is at work.
    """
    while frame is not None:
        file = frame.f_code.co_filename
        if file.startswith(_HOUSE) and not file.startswith(_EXAMPLES):
            return None
        if not file.startswith((*_LIBRARIES, "<frozen")):
            return frame
        frame = frame.f_back
    return None


class Interrupts:
    """Owns SIGINT within its context, if that is entered in the main thread."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._before: Any = None
        self.pending = False

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._taken)
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
            self._before = None
        self._deliver()

    def _taken(self, number: int, frame: FrameType | None) -> None:
        if self._before is not signal.default_int_handler:
            if callable(self._before):
                self._before(number, frame)
            return
        if self.pending:
            raise KeyboardInterrupt
        task = self._kernel.current()
        in_user_code = task is not None and users_frame(frame) is not None
        if not (in_user_code and task is not None and task.adopted):
            self.pending = True
            self._kernel.post(self._deliver)
        if in_user_code:
            raise KeyboardInterrupt

    def _deliver(self) -> None:
        if self.pending:
            self.pending = False
            raise KeyboardInterrupt
