"""Keeps virtual time from running ahead of the clock on the wall."""

from __future__ import annotations

from contextlib import suppress
from queue import Empty, SimpleQueue
from time import monotonic_ns
from typing import TYPE_CHECKING

from volery.base.errors import UsageError
from volery.base.time import to_seconds
from volery.kernel.interrupt import LONGEST_WAIT_S

if TYPE_CHECKING:
    from volery.base.time import Ns


class Pacer:
    """Lets *pace* seconds pass in one second on the wall, at most: time that was lost is not made good."""

    def __init__(self, pace: float) -> None:
        if pace <= 0.0:
            raise UsageError(f"a pace of {pace}: give seconds per second on the wall, above 0")
        self._pace = pace
        self._anchor: tuple[int, Ns] | None = None  # a moment on the wall and in virtual time
        self._bell: SimpleQueue[None] = (
            SimpleQueue()
        )  # unlike an Event's, its ring is safe in a signal handler

    def rest(self) -> None:
        """Virtual time stands still until the next ``wait``."""
        self._anchor = None

    def ring(self) -> None:
        """End the wait that is under way, or else the next; from any thread."""
        self._bell.put(None)

    def wait(self, now: Ns, when: Ns) -> Ns | None:
        """``None`` if *when* has come; else what time it is after a wait, which may have been cut short."""
        if self._anchor is None:
            self._anchor = (monotonic_ns(), now)
        wall, virtual = self._anchor
        ahead = to_seconds(when - virtual) / self._pace - to_seconds(monotonic_ns() - wall)
        if ahead <= 0.0:
            return None
        with suppress(Empty):
            self._bell.get(timeout=min(ahead, LONGEST_WAIT_S))
        passed = int((monotonic_ns() - wall) * self._pace)
        return max(now, min(virtual + passed, when))
