"""The stream: events go out to writers and observers, in the order in which they happened to be told."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from volery.trace.events import Event, Record


@runtime_checkable
class Choosy(Protocol):
    """A tap that does not listen to every kind of event, or has a shorter way in for some."""

    def listener(self, kind: type[Any]) -> Record | None:
        """What is to be called with events of *kind*; ``None`` if they do not matter here."""


class Stream:
    """Hands every event to every tap. Itself a ``Record``.

    A run tells thousands of events a second, so the way of each kind of event to its listeners is found once.
    """

    def __init__(self) -> None:
        self._taps: list[Record] = []
        self._ways = _Ways(self._taps)

    def tap(self, listener: Record) -> None:
        """From now on *listener* is told every event; if it is ``Choosy``, those that it asks for."""
        self._taps.append(listener)
        self._ways.clear()

    def __call__(self, event: Event) -> None:
        """Tell everybody."""
        for listener in self._ways[type(event)]:
            listener(event)


class _Ways(dict[type[Any], tuple[Record, ...]]):
    """Kind of event -> who is told, found when the first of its kind is told."""

    def __init__(self, taps: list[Record]) -> None:
        super().__init__()
        self._taps = taps

    def __missing__(self, kind: type[Any]) -> tuple[Record, ...]:
        found = [tap.listener(kind) if isinstance(tap, Choosy) else tap for tap in self._taps]
        ways = self[kind] = tuple(listener for listener in found if listener is not None)
        return ways
