"""The stream of set-points that keeps PX4 in OFFBOARD.

House code repeats it, so it survives a component that is busy. It ends as soon as the mode is seen to be
another: PX4 returns to OFFBOARD by itself when a stream resumes that it had missed (observed: even from RTL
and LAND), so whoever went on streaming after a takeover would steal the aircraft back. For the same reason
it pauses while the autopilot is not heard, until a heartbeat says that the mode is still OFFBOARD.

The stream of sticks, which PX4 wants more than twice a second (COM_RC_LOSS_T).

Once PX4 has had sticks it misses them in every mode: half a second after the last ones it holds, then
returns home, even in AUTO.LOITER. So they go on, centred, after they were used. Sticks that *move* in a mode
that flies by itself take the aircraft over into POSCTL; so in such modes only centred ones are sent, and
they are centred before such a mode is asked for.
"""

from __future__ import annotations

from volery.base.time import MS, Ns, S
from volery.kernel.api import Handle, Kernel
from volery.vehicles.driver import ManualControl
from volery.vehicles.drivers.mavlink import backend as key
from volery.vehicles.drivers.px4.backend import PX4Backend, Setpoint
from volery.vehicles.drivers.px4.modes import HOLD, MANUAL_MODES, OFFBOARD
from volery.vehicles.drivers.steps import Takeover
from volery.vehicles.telemetry import Velocity

SETPOINT_PERIOD: Ns = 100 * MS
"""PX4 wants more than 2 Hz; at 1.2 Hz it stayed in OFFBOARD, at 0.8 Hz it left and returned."""

DEAF_AFTER: Ns = S
"""A PX4 that has not heard the stream for so long has left OFFBOARD (COM_OF_LOSS_T); so it may be with us."""

ENTERED_WITHIN: Ns = 7 * S

STILL = Setpoint(Velocity(0.0, 0.0, 0.0))


class OffboardStream:
    """One stream. Where the carrier has a cycle, ``repeat`` is the loop's and the caller's business."""

    def __init__(self, kernel: Kernel, commands: PX4Backend, eviction: Takeover) -> None:
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
            self._timer = self._kernel.every(SETPOINT_PERIOD, self._tick)

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
        if now - self._seen.last_message_ns > DEAF_AFTER:
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


MANUAL_CONTROL_PERIOD: Ns = 50 * MS
SETTLED: Ns = 500 * MS
"""After so long sticks that were centred count no longer as moving."""

CENTRED = ManualControl()
_ROVER_CENTRED = ManualControl(throttle=0.0)


class ManualControlStream:
    """Repeats the sticks for as long as the mode is ours."""

    def __init__(self, kernel: Kernel, commands: PX4Backend) -> None:
        self.held: ManualControl | None = None
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

    def hold(self, sticks: ManualControl) -> None:
        """Keep sending these."""
        self.held = sticks
        self._send()
        if self._timer is None and self._commands.cycle is None and self.held is not None:
            self._timer = self._kernel.every(MANUAL_CONTROL_PERIOD, self._send)

    def hold_any(self) -> None:
        """Sticks that were never set are centred in the air, and idle on the ground."""
        if self.held is None:
            self.hold(self._centre if self._seen.flying else ManualControl(throttle=0.0))

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
    def _centre(self) -> ManualControl:
        return _ROVER_CENTRED if self._seen.kind == "rover" else CENTRED

    def _send(self) -> None:
        if self.held is None:
            return
        mode, flying = self._seen.mode, self._seen.flying
        by_sticks = mode in MANUAL_MODES
        if mode == self._asked_mode:
            self._mode_before = ""
        if flying and by_sticks and mode not in {self._asked_mode, self._mode_before}:
            self.stop()  # somebody else flies it now, by their own sticks
            return
        self._commands.manual_control(self.held if by_sticks or not flying else self._centre)
