"""A bell that ends the wait of one thread, from any thread and from signal handlers."""

from __future__ import annotations

from contextlib import suppress
from threading import Lock


class Bell:
    """Rings are not counted: any number of them end one wait, in progress or the next.

    A lock, because CPython's ``SimpleQueue.get`` waits for ever where its timeout has passed when a signal or
    a stop of the process interrupts it (seen in 3.11.7), and an ``Event`` may block in a signal handler.
    """

    def __init__(self) -> None:
        self._silent = Lock()
        self._silent.acquire()

    def ring(self) -> None:
        """End the wait in progress, or else the next one."""
        with suppress(RuntimeError):  # it has rung already
            self._silent.release()

    def wait(self, seconds: float) -> None:
        """Wait for a ring, at most *seconds*."""
        self._silent.acquire(timeout=max(0.0, seconds))
