"""A vehicle as what surrounds it sees it: where it really is. For components of the environment only.

A component of the application that requires a vehicle commands it and knows its autopilot's estimate. One of
the environment, such as a beacon, a judge or an obstacle, is given this instead.
"""

from __future__ import annotations

from collections.abc import Callable

from volery.base.position import Position
from volery.kernel.api import Kernel


class Body:
    """The vehicle called ``name``, by truth."""

    def __init__(self, kernel: Kernel, name: str, truth: Callable[[], Position]) -> None:
        self.name = name
        self._kernel = kernel
        self._truth = truth

    @property
    def position(self) -> Position:
        """Where it is, AMSL."""
        with self._kernel:
            return self._truth()
