"""A callback of a node that is ready."""

from __future__ import annotations

from collections.abc import Callable

from volery.base.time import Ns


class Work:
    """A callback that is ready: since when, ns, and what runs it, as component code."""

    def __init__(self, arrived: Ns, run: Callable[[], None]) -> None:
        self.arrived = arrived
        self.run = run
