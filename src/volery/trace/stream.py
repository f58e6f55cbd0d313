"""Distribution of the events of a run to those who listen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.trace.events import Event, Record


class _Guard:
    """Passes events to a listener, and calls *failed* with what it raises."""

    def __init__(self, listener: Record, failed: Callable[[Exception], None]) -> None:
        self._listener, self._failed = listener, failed

    def __call__(self, event: Event) -> None:
        """Pass one event."""
        try:
            self._listener(event)
        except Exception as error:
            self._failed(error)


class Stream:
    """Distributes every event to its listeners. Itself a ``Record``.

    A listener with a method ``listener(kind)`` takes only some kinds of events, or takes some by a faster
    function: the method returns what takes events of a kind, None if they do not matter to it. A run records
    thousands of events a second, so the listeners of each kind are looked up once.
    """

    def __init__(self) -> None:
        self._taps: list[Record] = []
        self._guarded: dict[Record, Callable[[Exception], None]] = {}
        self._routes: dict[type[Any], tuple[Record, ...]] = {}

    def tap(self, listener: Record) -> None:
        """Add a listener of every event, or of those that its method ``listener`` selects."""
        self._taps.append(listener)
        self._routes.clear()

    def tap_guarded(self, listener: Record, failed: Callable[[Exception], None]) -> None:
        """Add a listener whose error does not end the run: it is removed, and *failed* is called."""

        def remove(error: Exception) -> None:
            self._taps.remove(listener)
            self._routes.clear()
            failed(error)

        self._guarded[listener] = remove
        self.tap(listener)

    def __call__(self, event: Event) -> None:
        """Pass *event* to its listeners."""
        kind: type[Any] = event.__class__
        routes = self._routes.get(kind)
        if routes is None:
            routes = self._routes[kind] = self._listeners(kind)
        for listener in routes:
            listener(event)

    def _listeners(self, kind: type[Any]) -> tuple[Record, ...]:
        found: list[Record] = []
        for tap in self._taps:
            select = getattr(tap, "listener", None)
            listener = tap if select is None else select(kind)
            if listener is not None:
                failed = self._guarded.get(tap)
                found.append(listener if failed is None else _Guard(listener, failed))
        return tuple(found)
