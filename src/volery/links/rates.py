"""What one link is sent regularly: a period for each message, messages of one period in one burst.

Asking is remembered while the autopilot boots; nothing is sent before ``start``. Knows names and periods, not
what a message holds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from volery.base.time import Ns
from volery.kernel.api import Handle, Kernel

Burst = Callable[[Sequence[str]], None]
"""Sends the named messages, in that order."""


class Streams:
    """The streams of one link. ``order`` is the order of messages within a burst; no period is shorter than
    ``least``.
    """

    def __init__(self, kernel: Kernel, order: Sequence[str], burst: Burst, *, least: Ns = 1) -> None:
        self._kernel = kernel
        self._least = least
        self._rank = {name: rank for rank, name in enumerate(order)}
        self._burst = burst
        self._periods: dict[str, Ns] = {}
        self._names: dict[Ns, tuple[str, ...]] = {}
        self._handles: dict[Ns, Handle] = {}
        self._started = False

    def period(self, name: str) -> Ns:
        """Nanoseconds between two of that message; 0 if it is not streamed."""
        return self._periods.get(name, 0)

    def set(self, names: Sequence[str], period: Ns) -> None:
        """Stream these from now on with that period; 0 stops them.

        The first burst comes one period from now.
        """
        for name in names:
            self._periods.pop(name, None)
            if period > 0:
                self._periods[name] = max(period, self._least)
        self._regroup()

    def start(self) -> None:
        """The autopilot has booted: send what was asked for."""
        self._started = True
        self._regroup()

    def stop(self) -> None:
        """Send nothing any more and forget what was asked for."""
        self._started = False
        self._periods.clear()
        self._regroup()

    def _regroup(self) -> None:
        groups: dict[Ns, list[str]] = {}
        for name, period in self._periods.items():
            groups.setdefault(period, []).append(name)
        last = len(self._rank)
        self._names = {
            period: tuple(sorted(names, key=lambda name: self._rank.get(name, last)))
            for period, names in groups.items()
        }
        for period in [period for period in self._handles if period not in groups]:
            self._handles.pop(period).cancel()
        if self._started:
            for period in groups:
                if period not in self._handles:
                    self._begin(period)

    def _begin(self, period: Ns) -> None:
        first = self._kernel.now()

        def due() -> None:
            if self._kernel.now() > first:
                self._burst(self._names[period])

        self._handles[period] = self._kernel.every(period, due)
