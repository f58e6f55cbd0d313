"""Somebody has the vehicle in the very mode in which it obeys programs.

The mode does not show it. So he has it until he has chosen another mode in between, or it is disarmed.
"""

from __future__ import annotations

from volery.base.time import MS, Ns
from volery.kernel.api import Handle, Kernel
from volery.vehicles.telemetry import Telemetry

LOOK_PERIOD: Ns = 100 * MS


class Eviction:
    """Of this program from *mode*."""

    def __init__(self, kernel: Kernel, telemetry: Telemetry, mode: str) -> None:
        self._kernel = kernel
        self._seen = telemetry
        self._mode = mode
        self._watch: Handle | None = None

    @property
    def stands(self) -> bool:
        """He still has it."""
        return self._watch is not None

    @property
    def handover(self) -> str:
        """To which mode somebody must switch to hand it over; words that are no mode while it stands."""
        return f"another mode and then to {self._mode}" if self.stands else self._mode

    def begin(self) -> None:
        """He has it from now on."""
        if self._watch is None:
            self._watch = self._kernel.every(LOOK_PERIOD, self._look)

    def end(self) -> None:
        """Over, or nobody asks any more."""
        if self._watch is not None:
            self._watch.cancel()
            self._watch = None

    def _look(self) -> None:
        if self._seen.mode != self._mode or not self._seen.armed:
            self.end()
