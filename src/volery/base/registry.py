"""Plug-ins: how a lower package reaches a higher one, by name, through entry points.

Third parties register with an entry point of their own package; a test or a script calls ``add``.
"""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from volery.base.errors import UsageError, choices, did_you_mean

T = TypeVar("T")


class Registry(Generic[T]):
    """Plug-ins of one kind by name: ``drivers.load("ardupilot")``."""

    def __init__(self, group: str, noun: str) -> None:
        self.group, self.noun = group, noun
        self._added: dict[str, T] = {}

    def add(self, name: str, thing: T) -> None:
        """Register *thing* for this process."""
        self._added[name] = thing

    def _installed(self) -> dict[str, dict[str, EntryPoint]]:
        """Return {name: {value: entry point}}, with several values if packages disagree."""
        found: dict[str, dict[str, EntryPoint]] = {}
        for point in entry_points(group=self.group):
            found.setdefault(point.name, {})[point.value] = point
        return found

    def names(self) -> list[str]:
        """Return all names, sorted, without importing anything."""
        return sorted(self._added.keys() | self._installed().keys())

    def load(self, name: str) -> T:
        """Import and return the plug-in *name*.

        Raises:
            UsageError: The name is unknown (the message lists the valid names), two packages register it, or
                the import fails.
        """
        if name in self._added:
            return self._added[name]
        installed = self._installed()
        if name not in installed:
            hint = did_you_mean(name, self.names())
            raise UsageError(f"no {self.noun} named {name!r}{hint}; there is {choices(self.names())}")
        if len(installed[name]) > 1:
            raise UsageError(
                f"two packages provide the {self.noun} {name!r}: {' and '.join(sorted(installed[name]))}"
            )
        (point,) = installed[name].values()
        try:
            loaded: T = point.load()
        except (ImportError, AttributeError) as error:
            raise UsageError(f"the {self.noun} {name!r} cannot be loaded: {error}") from error
        return loaded
