"""A velocity that is repeated for as long as it is to last: one message may be lost, and some autopilots
forget it, others never do.
"""

from __future__ import annotations

from volery.base.time import Ns
from volery.kernel.api import Action, Handle, Kernel
from volery.vehicles.telemetry import Telemetry


class Following:
    """Each *period*, as long as the vehicle is in *mode*: in another one it is somebody else's."""

    def __init__(self, kernel: Kernel, telemetry: Telemetry, mode: str, period: Ns) -> None:
        self._kernel = kernel
        self._seen = telemetry
        self._mode = mode
        self._period = period
        self._handle: Handle | None = None

    def begin(self, say: Action, stop: Action, lasting: Ns) -> None:
        """*say* it from now on for so long; then *stop*, once."""
        self.end()
        until = self._kernel.now() + lasting

        def repeat() -> None:
            if self._seen.mode != self._mode:
                self.end()
            elif self._kernel.now() < until:
                say()
            else:
                self.end()
                stop()

        self._handle = self._kernel.every(self._period, repeat)

    def end(self) -> None:
        """It is not repeated any more."""
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None
