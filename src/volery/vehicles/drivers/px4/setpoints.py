"""Streams that PX4 needs: set-points in OFFBOARD, and manual control.

Both are repeated by framework callbacks, so they survive a component that is busy; with a backend that has a
cycle the node's own loop repeats them.
"""

from __future__ import annotations

from volery.base.time import MS, Ns, S
from volery.kernel.api import Handle, Kernel
from volery.vehicles.driver import AttitudeTarget, ManualControl
from volery.vehicles.drivers.mavlink.backend import Ack
from volery.vehicles.drivers.px4.backend import OffboardSetpoint, PX4Backend
from volery.vehicles.drivers.px4.modes import HOLD, MANUAL_MODES, OFFBOARD
from volery.vehicles.drivers.steps import ROVER_KIND, Takeover
from volery.vehicles.telemetry import Velocity

SETPOINT_PERIOD: Ns = 100 * MS
"""PX4 needs more than 2 Hz; at 1.2 Hz it stayed in OFFBOARD, at 0.8 Hz it left OFFBOARD and returned."""
LINK_IN_DOUBT_AFTER: Ns = S
"""A PX4 that has not received the stream for this time has left OFFBOARD (COM_OF_LOSS_T); our own silence may
mean that it receives nothing either.
"""
ENTERED_WITHIN: Ns = 7 * S

MANUAL_CONTROL_PERIOD: Ns = 50 * MS
SETTLED: Ns = 1 * S
"""Time after which centred manual control no longer counts as moving. PX4 filters the movement with 0.3 s of
its own clock: after 0.5 s a PX4 1.14 that lagged behind left AUTO.LAND for POSCTL.
"""

STILL = OffboardSetpoint(Velocity(0.0, 0.0, 0.0))
CENTRED = ManualControl()
_ROVER_CENTRED = ManualControl(throttle=0.0)


class OffboardStream:
    """Stream of set-points that keeps PX4 in OFFBOARD.

    The stream ends as soon as another mode is seen. PX4 returns to OFFBOARD by itself when a missing stream
    resumes (observed even from RTL and LAND), so a stream that continued after a takeover would take the
    aircraft back. For the same reason the stream pauses while nothing is received from the autopilot, until a
    heartbeat reports that the mode is still OFFBOARD, and likewise after this program has been frozen.
    """

    def __init__(self, kernel: Kernel, backend: PX4Backend, takeover: Takeover) -> None:
        self._kernel = kernel
        self._backend = backend
        self._takeover = takeover
        self._telemetry = backend.telemetry
        self._setpoint: OffboardSetpoint | AttitudeTarget = STILL
        self._lasting: Ns | None = None
        self._began_at = self._telemetry.moment()
        self._began: Ns = 0
        self._commanded_at: Ns | None = None  # when OFFBOARD was commanded
        self._hold_commanded_at: Ns = 0
        self._streaming = self._entered = self._leaving = False
        self._in_doubt_at: Ns = -1  # when the link was silent last, or this program
        self._doubted = False  # no younger heartbeat has reported OFFBOARD
        self._ticked_at: Ns = 0
        self._timer: Handle | None = None

    def check(self) -> None:
        """Detect at once, not only with the next set-point, that another has changed the mode."""
        if self._streaming and self._entered and self._telemetry.mode != OFFBOARD:
            self._end()

    @property
    def holds(self) -> bool:
        """Whether OFFBOARD is ours and stays."""
        entered = self._streaming and self._entered and not self._leaving
        return entered and self._telemetry.mode == OFFBOARD

    @property
    def leaving(self) -> bool:
        """Whether the stream is ending, so that AUTO.LOITER is our own."""
        return self._streaming and self._leaving

    def entered(self) -> bool:
        """Return whether OFFBOARD was entered by our command.

        It was if a heartbeat that is younger than the acknowledgement reports it. MAVROS passes on no
        acknowledgement; there the time of the command is used.
        """
        if not self._entered and self._telemetry.mode == OFFBOARD:
            agreed = self._commanded_at
            if self._backend.cycle is None:
                answer = self._telemetry.answers.get(Ack.MODE)
                agreed = answer.at if answer is not None and answer.accepted else None
            self._entered = agreed is not None and self._backend.last_heartbeat_ns > agreed
        return self._entered

    def note_commanded(self) -> None:
        """Note that OFFBOARD is being commanded."""
        self._commanded_at = self._kernel.now()

    def begin(self, setpoint: OffboardSetpoint | AttitudeTarget, lasting: Ns | None = None) -> None:
        """Stream *setpoint*; after *lasting* enter AUTO.LOITER."""
        now = self._kernel.now()
        self._setpoint = setpoint
        self._lasting, self._began_at = lasting, self._telemetry.moment()
        if not self.holds:
            self._entered = False
            self._began = now
            self._commanded_at = None
        self._leaving = False
        self._streaming = True
        self._note_gap(now)
        if not self._is_in_doubt():
            self._backend.send_setpoint(setpoint)
        if self._timer is None and self._backend.cycle is None:
            self._in_doubt_at = -1
            self._timer = self._kernel.every(SETPOINT_PERIOD, self._tick)

    def repeat(self) -> None:
        """Send the set-point again, from the loop of a node."""
        if self._backend.cycle is not None:
            self._backend.send_setpoint(self._setpoint)

    def leave(self) -> None:
        """Note that another mode is being commanded; the stream goes on until that mode is seen.

        The end of the stream, which enters AUTO.LOITER, waits for it: it would overrule a landing or a return
        whose mode no heartbeat has shown yet.
        """
        self._leaving = True
        if self._lasting is not None:
            self._lasting = max(self._lasting, self._telemetry.elapsed(self._began_at) + ENTERED_WITHIN)

    def _note_gap(self, now: Ns) -> None:
        """Doubt OFFBOARD after a gap in the stream: this program was frozen, or its computer.

        What arrives within a second after it may be older than the gap.
        """
        timed = self._backend.cycle is None
        if timed and self._entered and now - self._ticked_at > LINK_IN_DOUBT_AFTER:
            self._in_doubt_at, self._doubted = now + S, True
        self._ticked_at = now

    def _is_in_doubt(self) -> bool:
        return self._entered and self._backend.last_heartbeat_ns <= self._in_doubt_at

    def _note_if_lost(self) -> None:
        """Note a failsafe that an interruption of the stream has caused."""
        seen = self._telemetry
        if self._entered and self._doubted and seen.failsafe and seen.mode != OFFBOARD:
            seen.stream_lost = "the stream of set-points was interrupted"

    def stop(self) -> None:
        """Stop the stream."""
        self._note_if_lost()
        self._doubted = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._streaming = self._entered = self._leaving = False

    def _tick(self) -> None:
        now = self._kernel.now()
        self._note_gap(now)
        if not self.entered():
            if now - self._began > ENTERED_WITHIN:
                self.stop()
                return
        elif self._telemetry.mode != OFFBOARD:
            self._end()
            return
        if now - self._telemetry.last_message_ns > LINK_IN_DOUBT_AFTER:
            self._in_doubt_at, self._doubted = now, True
        if self._is_in_doubt():
            return
        self._doubted = False
        if self._lasting is not None and self._telemetry.elapsed(self._began_at) >= self._lasting:
            self._command_hold(now)
        self._backend.send_setpoint(self._setpoint)

    def _command_hold(self, now: Ns) -> None:
        if not self._leaving or now - self._hold_commanded_at >= S:
            self._leaving = True
            self._hold_commanded_at = now
            self._setpoint = STILL
            self._backend.set_mode(HOLD)

    def _end(self) -> None:
        """End the stream in another mode; a pilot who entered AUTO.LOITER, which obeys us, has control."""
        taken = not self._leaving and not self._telemetry.failsafe and self._telemetry.mode == HOLD
        self.stop()
        if taken:
            self._takeover.begin()


TAKEN_IN: Ns = 500 * MS
"""Time after which manual control counts: a mode of sticks was refused at the first sample, accepted 0.3 s
later.
"""


FORGOTTEN_AFTER: Ns = 500 * MS
"""Time that PX4 takes to notice the loss of manual control, beyond COM_RC_LOSS_T."""


class ManualControlStream:
    """Stream of manual control, which PX4 needs more than twice a second (COM_RC_LOSS_T).

    Once PX4 has received manual control, a failsafe acts in every mode if it ends: half a second after the
    last sample it holds, then it returns home, even in AUTO.LOITER. So the stream goes on, centred, after
    manual flight. Manual control that moves in an autonomous mode makes PX4 change to POSCTL; so in such
    modes only centred samples are sent, and the stream is centred before such a mode is commanded.
    """

    def __init__(self, kernel: Kernel, backend: PX4Backend) -> None:
        self.held: ManualControl | None = None
        self._kernel = kernel
        self._backend = backend
        self._telemetry = backend.telemetry
        self._commanded_mode = ""
        self._mode_before = ""
        self._centred_at: Ns = 0
        self._began_at: Ns = 0
        self._ended_at: Ns | None = None
        self._timer: Handle | None = None

    def note_commanded(self, mode: str) -> None:
        """Note that *mode* is being commanded."""
        if mode != self._commanded_mode:
            self._mode_before = self._telemetry.mode
        self._commanded_mode = mode

    def hold(self, control: ManualControl) -> None:
        """Send *control* at once and repeat it."""
        if self.held is None:
            self._began_at = self._kernel.now()
        self._ended_at = None
        self.held = control
        self._send()
        if self._timer is None and self._backend.cycle is None and self.held is not None:
            self._timer = self._kernel.every(MANUAL_CONTROL_PERIOD, self._send)

    def hold_any(self) -> None:
        """Repeat neutral control if none was ever set: centred in the air, idle throttle on the ground."""
        if self.held is None:
            self.hold(self._centre if self._telemetry.flying else ManualControl(throttle=0.0))

    def centre(self) -> None:
        """Repeat centred control if manual control was ever set."""
        if self.held is not None and self.held != self._centre:
            self._centred_at = self._kernel.now()
            self.hold(self._centre)

    def repeat(self) -> None:
        """Send again, from the loop of a node."""
        if self._backend.cycle is not None:
            self._send()

    def taken_in(self) -> bool:
        """Return whether the stream has lasted until PX4 counts it."""
        return self.held is not None and self._kernel.now() - self._began_at >= TAKEN_IN

    def settled(self) -> bool:
        """Return whether the stream has been centred long enough not to count as moving."""
        return self.held is None or self._kernel.now() - self._centred_at >= SETTLED

    def stop(self) -> None:
        """Stop the stream."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self.held is not None:
            self._ended_at = self._kernel.now()
        self.held = None

    def forgotten(self, lost_after: Ns) -> bool:
        """Return whether PX4 no longer counts the stream, which it does for *lost_after* after its end."""
        return self._ended_at is None or self._kernel.now() - self._ended_at >= lost_after + FORGOTTEN_AFTER

    @property
    def _centre(self) -> ManualControl:
        return _ROVER_CENTRED if self._telemetry.kind == ROVER_KIND else CENTRED

    def _send(self) -> None:
        if self.held is None:
            return
        mode, flying = self._telemetry.mode, self._telemetry.flying
        is_manual = mode in MANUAL_MODES
        if mode == self._commanded_mode:
            self._mode_before = ""
        if flying and is_manual and mode not in {self._commanded_mode, self._mode_before}:
            self.stop()  # a pilot flies it now
            return
        self._backend.send_manual_control(self.held if is_manual or not flying else self._centre)
