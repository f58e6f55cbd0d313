"""The stream of set-points that keeps PX4 in OFFBOARD.

House code repeats it, so it survives a component that is busy. It ends as soon as the mode is seen to be
another: PX4 returns to OFFBOARD by itself when a stream resumes that it had missed (observed: even from RTL
and LAND), so whoever went on streaming after a takeover would steal the aircraft back. For the same reason
it pauses while the autopilot is not heard, until a heartbeat says that the mode is still OFFBOARD.
"""

from __future__ import annotations

from volery.base.time import MS, Ns, S
from volery.kernel.api import Handle, Kernel
from volery.vehicles.drivers.eviction import Eviction
from volery.vehicles.drivers.mavlink import commands as key
from volery.vehicles.drivers.px4.commands import Commands, Setpoint
from volery.vehicles.drivers.px4.modes import HOLD, OFFBOARD
from volery.vehicles.telemetry import Velocity

PERIOD: Ns = 100 * MS
"""PX4 wants more than 2 Hz; at 1.2 Hz it stayed in OFFBOARD, at 0.8 Hz it left and returned."""

DEAF_AFTER: Ns = S
"""A PX4 that has not heard the stream for so long has left OFFBOARD (COM_OF_LOSS_T); so it may be with us."""

ENTERED_WITHIN: Ns = 7 * S

STILL = Setpoint(Velocity(0.0, 0.0, 0.0))


class Offboard:
    """One stream. Where the carrier has a cycle, ``repeat`` is the loop's and the caller's business."""

    def __init__(self, kernel: Kernel, commands: Commands, eviction: Eviction) -> None:
        self._eviction = eviction
        self._streaming = False
        self._kernel = kernel
        self._commands = commands
        self._seen = commands.telemetry
        self._setpoint = STILL
        self._until: Ns | None = None
        self._began: Ns = 0
        self._asked: Ns | None = None
        self._entered = False
        self._leaving = False
        self._asked_to_hold: Ns = 0
        self._in_doubt: Ns = -1  # when it was last silent
        self._timer: Handle | None = None

    def look(self) -> None:
        """Notice at once that the mode was taken, not with the next set-point only."""
        if self._streaming and self._entered and self._seen.mode != OFFBOARD:
            self._end()

    @property
    def holds(self) -> bool:
        """The mode is ours, and stays."""
        return self._streaming and self._entered and not self._leaving and self._seen.mode == OFFBOARD

    def entered(self) -> bool:
        """It is in OFFBOARD because it was asked: a heartbeat that is younger than its consent says so."""
        if not self._entered and self._seen.mode == OFFBOARD:
            agreed = self._agreed()
            self._entered = agreed is not None and self._commands.beat > agreed
        return self._entered

    def _agreed(self) -> Ns | None:
        """MAVROS passes no answer on: there it is when the mode was asked for."""
        if self._commands.cycle is not None:
            return self._asked
        answer = self._seen.answers.get(key.MODE)
        return answer.at if answer is not None and answer.accepted else None

    def asks(self) -> None:
        """OFFBOARD is being commanded."""
        self._asked = self._kernel.now()

    def begin(self, setpoint: Setpoint, lasting: Ns | None = None) -> None:
        """Stream it from now on; after *lasting* let it hold its place, in AUTO.LOITER."""
        now = self._kernel.now()
        self._setpoint = setpoint
        self._until = None if lasting is None else now + lasting
        if not self.holds:
            self._entered = False
            self._began = now
            self._asked = None
        self._leaving = False
        self._streaming = True
        self._commands.setpoint(setpoint)
        if self._timer is None and self._commands.cycle is None:
            self._in_doubt = -1
            self._timer = self._kernel.every(PERIOD, self._tick)

    def repeat(self) -> None:
        """Once more, in the loop of a node."""
        if self._commands.cycle is not None:
            self._commands.setpoint(self._setpoint)

    def leave(self) -> None:
        """Another mode is being commanded: it goes on until that is seen, lest PX4 misses it meanwhile."""
        self._leaving = True

    def stop(self) -> None:
        """No set-point any more."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._streaming = self._entered = self._leaving = False

    def _tick(self) -> None:
        now = self._kernel.now()
        if not self.entered():
            if now - self._began > ENTERED_WITHIN:
                self.stop()
                return
        elif self._seen.mode != OFFBOARD:
            self._end()
            return
        if now - self._seen.heard > DEAF_AFTER:
            self._in_doubt = now
        if self._entered and self._commands.beat <= self._in_doubt:
            return
        if self._until is not None and now >= self._until:
            self._hold_its_place(now)
        self._commands.setpoint(self._setpoint)

    def _hold_its_place(self, now: Ns) -> None:
        if not self._leaving or now - self._asked_to_hold >= S:
            self._leaving = True
            self._asked_to_hold = now
            self._setpoint = STILL
            self._commands.set_mode(HOLD)

    def _end(self) -> None:
        """The mode is another one: ours, or somebody's. A failsafe's is told by its status. Somebody who took
        it into the one in which it would obey us has it.
        """
        taken = not self._leaving and not self._seen.failsafe and self._seen.mode == HOLD
        self.stop()
        if taken:
            self._eviction.begin()
