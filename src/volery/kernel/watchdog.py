"""Names code that freezes virtual time: a task that runs on the host, and virtual time does not move.

It samples now and then from a thread of its own and costs nothing in between.
"""

from __future__ import annotations

import threading
from time import monotonic
from typing import TYPE_CHECKING

from volery.base.errors import UsageError

if TYPE_CHECKING:
    from volery.base.time import Ns
    from volery.kernel.api import Kernel
    from volery.kernel.interrupt import Interrupts
    from volery.kernel.task import Task

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
