"""What a launch file says of a node, and how it is told of the end, for every face."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from volery.kernel.task import Place


class Launch(NamedTuple):
    """A node's namespace, its remappings and its private parameters."""

    namespace: str = "/"
    remaps: Mapping[str, str] = {}
    parameters: Mapping[str, Any] = {}


AtEnd = Callable[[Place, Callable[[], object]], None]
"""Has something done at a place when the run ends, by which components have been cancelled already."""


def never(place: Place, last: Callable[[], object]) -> None:
    """Where runs end without a word."""
