"""The stream of sticks, which PX4 wants more than twice a second (COM_RC_LOSS_T).

Once PX4 has had sticks it misses them in every mode: half a second after the last ones it holds, then
returns home, even in AUTO.LOITER. So they go on, centred, after they were used. Sticks that *move* in a mode
that flies by itself take the aircraft over into POSCTL; so in such modes only centred ones are sent, and
they are centred before such a mode is asked for.
"""

from __future__ import annotations

from volery.base.time import MS, Ns
from volery.kernel.api import Handle, Kernel
from volery.vehicles.driver import Sticks
from volery.vehicles.drivers.px4.commands import Commands
from volery.vehicles.drivers.px4.modes import BY_STICKS

PERIOD: Ns = 50 * MS
SETTLED: Ns = 500 * MS
"""After so long sticks that were centred count no longer as moving."""

CENTRED = Sticks()
_ROVER_CENTRED = Sticks(throttle=0.0)


class StickStream:
    """Repeats the sticks for as long as the mode is ours."""

    def __init__(self, kernel: Kernel, commands: Commands) -> None:
        self.held: Sticks | None = None
        self._kernel = kernel
        self._commands = commands
        self._seen = commands.telemetry
        self._asked_mode = ""
        self._mode_before = ""
        self._centred_at: Ns = 0
        self._timer: Handle | None = None

    def asks_for(self, mode: str) -> None:
        """This mode is being commanded."""
        if mode != self._asked_mode:
            self._mode_before = self._seen.mode
        self._asked_mode = mode

    def hold(self, sticks: Sticks) -> None:
        """Keep sending these."""
        self.held = sticks
        self._send()
        if self._timer is None and self._commands.cycle is None and self.held is not None:
            self._timer = self._kernel.every(PERIOD, self._send)

    def hold_any(self) -> None:
        """Sticks that were never set are centred in the air, and idle on the ground."""
        if self.held is None:
            self.hold(self._centre if self._seen.flying else Sticks(throttle=0.0))

    def centre(self) -> None:
        """Let go of them: from now on centred, if they were ever used."""
        if self.held is not None and self.held != self._centre:
            self._centred_at = self._kernel.now()
            self.hold(self._centre)

    def repeat(self) -> None:
        """Once more, in the loop of a node."""
        if self._commands.cycle is not None:
            self._send()

    def settled(self) -> bool:
        """Centred for so long that they do not count as moving."""
        return self.held is None or self._kernel.now() - self._centred_at >= SETTLED

    def stop(self) -> None:
        """No sticks any more."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self.held = None

    @property
    def _centre(self) -> Sticks:
        return _ROVER_CENTRED if self._seen.kind == "rover" else CENTRED

    def _send(self) -> None:
        if self.held is None:
            return
        mode, flying = self._seen.mode, self._seen.flying
        by_sticks = mode in BY_STICKS
        if mode == self._asked_mode:
            self._mode_before = ""
        if flying and by_sticks and mode not in {self._asked_mode, self._mode_before}:
            self.stop()  # somebody else flies it now, by their own sticks
            return
        self._commands.sticks(self.held if by_sticks or not flying else self._centre)
