"""An event that ends the wait of one thread, from any thread and from signal handlers."""

from __future__ import annotations

from contextlib import suppress
from threading import Lock


class AutoResetEvent:
    """An event that is reset by the wait that it ends. Setting it twice ends one wait.

    It is a lock: CPython's ``SimpleQueue.get`` waits for ever where its timeout has passed when a signal or
    a stop of the process interrupts it (seen in 3.11.7); ``threading.Event`` may block in a signal handler.
    """

    def __init__(self) -> None:
        self._reset = Lock()
        self._reset.acquire()

    def set(self) -> None:
        """End the wait in progress, or else the next one."""
        with suppress(RuntimeError):  # it is set already
            self._reset.release()

    def wait(self, seconds: float) -> None:
        """Wait until the event is set, at most *seconds*."""
        self._reset.acquire(timeout=max(0.0, seconds))
