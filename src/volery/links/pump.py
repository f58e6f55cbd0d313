"""The thread behind a carrier: it waits until a file can be read and hands what it reads to the house."""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Callable

_JOIN_S = 5.0


class Pump:
    """Runs *body* in a thread of its own from ``start`` to ``stop``. *body* waits only in ``readable``.

    What *body* hands to the house may be looked at before ``start`` returns: let go of it when all is in
    place.
    """

    def __init__(self, name: str, body: Callable[[Pump], None]) -> None:
        self._wake_read, self._wake_write = os.pipe()
        self._stopped = threading.Event()
        self._body = body
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @property
    def stopped(self) -> bool:
        """It was told to stop."""
        return self._stopped.is_set()

    def start(self) -> None:
        """Let it go, once."""
        self._thread.start()

    def readable(self, file: int) -> bool:
        """Wait until *file* (a descriptor) can be read, or has ended; False: stop."""
        ready, _, _ = select.select([file, self._wake_read], [], [])
        return not self.stopped and file in ready

    def stop(self) -> None:
        """Ask it to end, and wait for that. From any thread but its own."""
        if self.stopped:
            return
        self._stopped.set()
        os.write(self._wake_write, b"!")
        self._thread.join(_JOIN_S)
        if not self._thread.is_alive():
            os.close(self._wake_read)
            os.close(self._wake_write)

    def _run(self) -> None:
        self._body(self)
