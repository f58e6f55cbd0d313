"""Parameters: one tree of values. A node's own are those below its name."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from typing import Any

from volery.base.errors import UsageError, did_you_mean


class Parameters:
    """Values by absolute name; a namespace reads as a ``dict`` of what is below it."""

    def __init__(self) -> None:
        self._tree: dict[str, Any] = {}

    @staticmethod
    def _steps(name: str) -> list[str]:
        return [step for step in name.split("/") if step]

    def has(self, name: str) -> bool:
        """Whether there is such a parameter or namespace."""
        try:
            self.get(name)
        except UsageError:
            return False
        return True

    def get(self, name: str) -> Any:
        """A copy of the value, or ``UsageError``."""
        value: Any = self._tree
        for step in self._steps(name):
            if not isinstance(value, dict) or step not in value:
                hint = did_you_mean(name, self.names())
                raise UsageError(f"no parameter {name!r}{hint}")
            value = value[step]
        return deepcopy(value)

    def set(self, name: str, value: Any) -> None:
        """Set a value; a ``dict`` replaces a whole namespace."""
        *path, last = self._steps(name) or [""]
        if not last:
            raise UsageError("the root of the parameters cannot be set; name a parameter")
        branch = self._tree
        for step in path:
            inner = branch.get(step)
            if not isinstance(inner, dict):
                inner = branch[step] = {}
            branch = inner
        branch[last] = deepcopy(value)

    def delete(self, name: str) -> None:
        """Remove a value or a namespace; ``UsageError`` if there is none."""
        self.get(name)
        *path, last = self._steps(name)
        branch = self._tree
        for step in path:
            branch = branch[step]
        del branch[last]

    def names(self) -> list[str]:
        """The absolute names of all parameters, sorted."""
        return sorted(_leaves("", self._tree))


def _leaves(prefix: str, branch: dict[str, Any]) -> Iterator[str]:
    for step, value in branch.items():
        if isinstance(value, dict):
            yield from _leaves(f"{prefix}/{step}", value)
        else:
            yield f"{prefix}/{step}"
