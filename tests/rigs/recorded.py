"""Telemetry as autopilots sent it, heard again: extracts of recorded flights.

An extract holds, of the messages that a driver listens to, those that brought a change, with the time in
milliseconds since its beginning.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from volery.base.time import MS
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.mavlink_codec import quantised
from volery.vehicles.telemetry import Telemetry

GOLDEN = Path(__file__).parents[1] / "golden"


@cache
def extract(folder: str, name: str) -> list[Any]:
    return list(json.loads((GOLDEN / folder / f"{name}.json").read_text()))


class Recorded:
    """The extracts of one folder, heard by one driver's *hearing*."""

    def __init__(self, folder: str, hearing: Callable[[VirtualKernel, Telemetry], Any]) -> None:
        self._folder, self._hearing = folder, hearing

    def hear(self, hearing: Any, frame: Frame) -> None:
        assert hearing.handle_message(frame.name, frame.fields)

    def replayed(self, name: str) -> Iterator[tuple[float, Telemetry]]:
        """The telemetry after each message of an extract, with its time in seconds."""
        kernel = VirtualKernel()
        seen = Telemetry(kernel, "recorded")
        hearing = self._hearing(kernel, seen)
        for ms, message, fields in extract(self._folder, name):
            kernel.call_at(ms * MS, lambda: None)
            kernel.run(ms * MS)
            self.hear(hearing, quantised(Frame(message, fields, 1, 1)))
            yield ms / 1000.0, seen

    def changes(self, name: str, *facts: str) -> list[Any]:
        """The values of these facts in the order in which they changed."""
        found: list[Any] = []
        for _, seen in self.replayed(name):
            now = tuple(getattr(seen, fact) for fact in facts)
            if not found or found[-1] != now:
                found.append(now)
        return found
