"""Words on one link: cut into STATUSTEXT messages, and held back as the firmware holds them back."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.simulation.autopilots.simulated.mavlink.habits import Texts
from volery.simulation.autopilots.simulated.sticks import NEVER

WAITING = 4
"""Texts that wait for a ground station; older ones are lost."""

STATION_SILENT: Ns = 2500 * MS
"""A ground station that has been silent for that long is not there."""

GROUND_STATION = 6
"""MAV_TYPE_GCS."""

Chunks = list[dict[str, Any]]


class TextLine:
    """The texts of one link. *send* sends the fields of one message."""

    def __init__(self, kernel: Kernel, habits: Texts, send: Callable[[dict[str, Any]], None]) -> None:
        self._kernel = kernel
        self._habits = habits
        self._send = send
        self._waiting: deque[Chunks] = deque(maxlen=WAITING)
        self._free_at: Ns = NEVER
        self._due = False
        self._station_seen: Ns = NEVER

    def on_heartbeat(self, kind: int) -> None:
        """Somebody's heartbeat came in through the link; *kind* is a MAV_TYPE."""
        if kind == GROUND_STATION:
            self._station_seen = self._kernel.now()
            self._flush()

    def put(self, text: Chunks) -> None:
        """Send it, as soon as it may be."""
        if not (self._habits.to_stations or self._habits.spacing):
            self._tell(text)
            return
        self._waiting.append(text)
        self._flush()

    def _tell(self, text: Chunks) -> None:
        for fields in text:
            self._send(fields)

    def _listened_to(self) -> bool:
        heard = self._kernel.now() - self._station_seen <= STATION_SILENT
        return heard or not self._habits.to_stations

    def _flush(self) -> None:
        now = self._kernel.now()
        if self._due or not self._waiting or not self._listened_to():
            return
        if now >= self._free_at:
            self._tell(self._waiting.popleft())
            self._free_at = now + self._habits.spacing
        if self._waiting:
            self._due = True
            self._kernel.call_at(self._free_at, self._go_on)

    def _go_on(self) -> None:
        self._due = False
        self._flush()
