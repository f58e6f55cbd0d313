"""The stream: events go out to writers and observers, in the order in which they happened to be told."""

from __future__ import annotations

from volery.trace.events import Event, Record


class Stream:
    """Hands every event to every tap. Itself a ``Record``."""

    def __init__(self) -> None:
        self._taps: list[Record] = []

    def tap(self, listener: Record) -> None:
        """From now on *listener* is told every event."""
        self._taps.append(listener)

    def __call__(self, event: Event) -> None:
        """Tell everybody."""
        for listener in self._taps:
            listener(event)
