"""Distribution of the events of a run to those who listen."""

from __future__ import annotations

from typing import Any

from volery.trace.events import Event, Record


class Stream:
    """Distributes every event to its listeners. Itself a ``Record``.

    A listener with a method ``listener(kind)`` takes only some kinds of events, or takes some by a faster
    function: the method returns what takes events of a kind, None if they do not matter to it. A run records
    thousands of events a second, so the listeners of each kind are looked up once.
    """

    def __init__(self) -> None:
        self._taps: list[Record] = []
        self._routes: dict[type[Any], tuple[Record, ...]] = {}

    def tap(self, listener: Record) -> None:
        """Add a listener of every event, or of those that its method ``listener`` selects."""
        self._taps.append(listener)
        self._routes.clear()

    def __call__(self, event: Event) -> None:
        """Pass *event* to its listeners."""
        kind: type[Any] = event.__class__
        routes = self._routes.get(kind)
        if routes is None:
            routes = self._routes[kind] = self._listeners(kind)
        for listener in routes:
            listener(event)

    def _listeners(self, kind: type[Any]) -> tuple[Record, ...]:
        found: list[Record | None] = []
        for tap in self._taps:
            select = getattr(tap, "listener", None)
            found.append(tap if select is None else select(kind))
        return tuple(one for one in found if one is not None)
