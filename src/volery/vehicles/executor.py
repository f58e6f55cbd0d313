"""The executor of steps, one for all drivers: time-outs, refusals, restarts, takeover and link loss.

A driver states what to send and how telemetry shows that it is done; everything that can go wrong meanwhile
is handled here, once. MAVLink does not say who changed a mode. A mode that this program did not command is
therefore taken as the choice of a pilot, another station or a failsafe, and is never overridden in flight.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from volery.base.errors import Failsafe, LinkLost, NotArrived, Overridden, Refused, VehicleError
from volery.base.time import MS, Ns, S, to_seconds
from volery.kernel.api import Action, Handle, Kernel
from volery.kernel.waiting import sleep
from volery.trace.events import Text
from volery.vehicles.driver import Driver, Step
from volery.vehicles.telemetry import REFRESHED_AFTER, STALE_AFTER, Telemetry, describe_state, failsafe_cause
from volery.vehicles.vehicle_clock import COMPARED_AFTER

RESTARTS = 3
"""How often a sequence that is undone before lift-off is started again."""
REASON_WAIT: Ns = 500 * MS
"""Time to wait for the text with the reason, which often follows a refusal."""
RECENT_TEXT_S = 3.0
"""Texts older than this are quoted with their age."""
INTERRUPTED_SHOWS_AFTER: Ns = 3 * S
"""Time after which a command that was interrupted on its way shows: two heartbeats and a delay."""
LINK_TIMEOUT: Ns = 5 * S
"""Time without a message after which the link counts as lost: five missed heartbeats."""

MONITOR_PERIOD: Ns = 200 * MS
"""Shortest time between two checks of an operation, which are made at telemetry messages."""

TAKES_BACK = "resume() takes the vehicle back, land() lands it"
"""The remedy for a failsafe that an order of safety may end."""

Check = Callable[[str, Ns], VehicleError | None]
"""``check(operation, now)`` runs each ``MONITOR_PERIOD`` and returns an error to end the step."""


def _no_check(_operation: str, _now: Ns) -> None:
    """Accept everything."""


class StepExecutor:
    """Executes steps for one vehicle and tracks which mode this program commanded.

    Args:
        kernel: clock and tasks.
        driver: the driver of the vehicle.
        link_timeout: time without a message after which the link counts as lost, ns.
    """

    def __init__(self, kernel: Kernel, driver: Driver, link_timeout: Ns = LINK_TIMEOUT) -> None:
        self._kernel = kernel
        self._driver = driver
        self._link_timeout = link_timeout
        self._silent_after = min(link_timeout, STALE_AFTER)
        self.commanded = ""  # mode that this program commanded last; empty while another has control
        self._previous = ""  # mode commanded before, until the one commanded last is seen
        self._clock_reported = False
        self._claim = 0  # counts aborts; steps begun under an earlier claim end
        self._successor = ""  # what aborted the steps in progress
        self._taking_back = False  # from a failsafe that a stream of this program has caused
        self._interrupted_ns: Ns | None = None  # when Ctrl-C or SIGTERM ended a sequence

    def execute(
        self,
        asked: str,
        plan: Callable[[], Sequence[Step]],
        *,
        restarts: int = 0,
        check: Check = _no_check,
    ) -> None:
        """Execute the steps of *plan* in order.

        Args:
            asked: the operation, for error messages.
            plan: returns the steps; called again for each restart.
            restarts: how often to start again after the sequence was undone before lift-off.
            check: may end the operation.

        Raises:
            Refused: the autopilot refused; its own text is quoted.
            Overridden: another station, a pilot or another task of this program has control.
            Failsafe: the autopilot has entered a failsafe.
            NotArrived: the effect was not seen in time.
            LinkLost: the link timed out.
            VehicleError: *check* returned it.
        """
        undone = ""
        for _ in range(restarts + 1):
            try:
                undone = self._execute_once(asked, plan(), check)
            except (KeyboardInterrupt, SystemExit):
                self._interrupted_ns = self._kernel.now()
                raise
            if not undone:
                return
        times = f" before lift-off, each time it was started over ({restarts} times)" if restarts else ""
        raise Overridden(self._driver.name, asked, undone + times + self.last_text())

    def _execute_once(self, asked: str, steps: Sequence[Step], check: Check) -> str:
        """Return why the sequence was undone on the ground; empty if all steps are done."""
        claim = self._claim
        telemetry = self._driver.telemetry
        for step in steps:
            if claim != self._claim:
                raise self.aborted(asked)
            if step.skippable and step.done(telemetry):
                if step.enters:
                    self.set_commanded(step.enters)  # the vehicle is in that mode already: it is ours now
                    self._previous = ""
                continue
            undone = _StepRun(self, asked, step, check).run()
            if undone:
                return undone
        return ""

    # -- control

    def abort_for(self, successor: str) -> None:
        """Abort the operation in progress; *successor* controls the vehicle from now on."""
        self._claim += 1
        self._successor = successor
        self._driver.telemetry.changed.notify()

    def aborted(self, asked: str) -> Overridden:
        """Return the error for an operation that another task of this program has aborted."""
        return Overridden(self._driver.name, asked, f"{self._successor} took its place")

    def is_ours(self) -> bool:
        """Return whether the vehicle is in a mode of this program.

        These are the mode commanded last, the one before if that command was refused, and the offboard mode.
        """
        return self._driver.telemetry.mode in {self.commanded, self._previous, self._driver.offboard_mode}

    def set_commanded(self, mode: str) -> None:
        """Take *mode* as commanded by this program from now on."""
        if mode != self.commanded:
            self._previous, self.commanded = self.commanded, mode

    def release_control(self) -> None:
        """Stop all repeated messages: another station, a pilot or a failsafe has control."""
        self.commanded = self._previous = ""
        self._driver.stop()

    def check_ours(self, asked: str) -> None:
        """Raise ``Overridden`` or ``Failsafe`` if it flies in a mode not commanded by this program."""
        telemetry = self._driver.telemetry
        if not telemetry.flying:
            telemetry.stream_lost = ""
            return
        ours = self.is_ours()  # lets the driver notice a stream that has ended
        if telemetry.stream_lost:
            self.release_control()
            raise Failsafe(
                self._driver.name,
                asked,
                f"{telemetry.stream_lost}: the autopilot is in {telemetry.mode} (status {telemetry.status})"
                f"{self.last_text()}; {TAKES_BACK}",
            )
        if ours:
            return
        self.release_control()
        cause = failsafe_cause(telemetry, self._kernel.now())
        hand_over = f"to hand it over, switch the vehicle to {self._driver.offboard_mode}"
        raise (Failsafe if cause else Overridden)(
            self._driver.name,
            asked,
            f"is in {telemetry.mode} (status {telemetry.status}), which this program did not command"
            f"{_because(cause)}{self.last_text()}; {TAKES_BACK if telemetry.failsafe_lasts else hand_over}",
        )

    def take_back(self) -> bool:
        """Take the vehicle back from a failsafe that an order of safety may end; False if there is none.

        A stream of this program has caused it, or it does not end on the ground by itself.
        """
        telemetry = self._driver.telemetry
        if not (telemetry.stream_lost or telemetry.failsafe_lasts) or not telemetry.flying:
            return False
        telemetry.stream_lost = ""
        self.set_commanded(telemetry.mode)
        self._taking_back = True
        return True

    def check_link(self, asked: str, to_safety: bool) -> None:
        """Raise ``LinkLost`` if the link has timed out; after a silence wait until the state is fresh.

        What is sent on a lost link may be obeyed much later; an order of safety is sent all the same. A mode
        from before a silence must decide nothing.
        """
        telemetry, now = self._driver.telemetry, self._kernel.now()
        fresh = now - telemetry.last_message_ns < self._silent_after and now >= telemetry.fresh_from
        if fresh or telemetry.last_message_ns < 0:
            return
        if telemetry.detects_silence and not to_safety and self.link_lost():
            raise self.link_lost_error(asked)
        if telemetry.stale and not self.link_lost():
            self.wait(lambda: not telemetry.stale or self.link_lost(), REFRESHED_AFTER)

    def link_lost_error(self, asked: str) -> LinkLost:
        """Return the error for a lost link."""
        telemetry = self._driver.telemetry
        ago = telemetry.silence(self._kernel.now())
        problem = self._driver.problem()
        why = f"; {problem}" if problem is not None else ""
        return LinkLost(
            f"{telemetry.name}: {asked}: no message was received for {ago:.1f} s{why}; "
            f"last: {describe_state(telemetry)}, at {to_seconds(telemetry.last_message_ns):.1f} s"
        )

    # -- telemetry and link

    def wait(self, condition: Callable[[], bool], within: Ns) -> bool:
        """Wait until *condition* holds; return False if it does not hold after *within* (ns)."""
        cycle = self._driver.cycle
        if cycle is None:
            return self._driver.telemetry.changed.wait_for(condition, within, ends_activation=True)
        until = self._kernel.now() + within
        while not condition():
            if self._kernel.now() >= until:
                return False
            cycle()
        return True

    def wait_for_interrupted(self) -> None:
        """Wait until a command that was interrupted on its way would show: it may have armed the vehicle."""
        since, self._interrupted_ns = self._interrupted_ns, None
        telemetry = self._driver.telemetry
        if since is not None and not telemetry.armed:
            within = since + INTERRUPTED_SHOWS_AFTER - self._kernel.now()
            self.wait(lambda: telemetry.armed, max(0, within))

    def report_clock(self, rate: float) -> None:
        """Record once that the vehicle's clock runs *rate* times as fast, and whose seconds count where."""
        if self._clock_reported:
            return
        self._clock_reported = True
        said = (
            f"its clock runs {rate:.1f} times as fast as this computer's: time-outs and the durations of "
            "set-points are in its seconds; those of the report and of lost links are in this computer's"
        )
        self._kernel.record(Text(self._kernel.now(), self._driver.name, 5, said))

    def link_lost(self) -> bool:
        """Return whether the last message is older than the link time-out."""
        return self._kernel.now() - self._driver.telemetry.last_message_ns >= self._link_timeout

    def last_text(self) -> str:
        """Return the autopilot's last text as the end of an error message, with its age if it is old."""
        texts = self._driver.telemetry.texts
        if not texts:
            return ""
        ago = to_seconds(self._kernel.now() - texts[-1].at)
        return f"; it last said {texts[-1].text!r}" + (
            f" ({ago:.0f} s before)" if ago > RECENT_TEXT_S else ""
        )


class _StepRun:
    """Execution of one step."""

    def __init__(self, executor: StepExecutor, asked: str, step: Step, check: Check) -> None:
        self._executor = executor
        self._kernel = executor._kernel
        self._driver = driver = executor._driver
        self._claim = executor._claim
        self._asked = asked
        self._step = step
        self._check = check
        self._telemetry: Telemetry = driver.telemetry
        self._began_at = self._telemetry.moment()
        self._began: Ns = self._began_at.at
        self._mode_before = self._telemetry.mode
        self._was_armed = self._telemetry.armed
        self._taken = ""  # how another station, a pilot or a failsafe has changed it
        self._stopped: VehicleError | None = None  # error returned by *check*
        self._check_due: Ns = self._began
        self._late = False  # at the last check
        self._repeated = False

    def run(self) -> str:
        """Return why the step was undone before lift-off; empty if it is done."""
        step, telemetry = self._step, self._telemetry
        mode = telemetry.mode
        if step.enters:
            in_failsafe = telemetry.flying and telemetry.failsafe and mode != step.enters
            # the offboard mode is never commanded over a failsafe, not even over one that interrupted us
            taking_back, self._executor._taking_back = self._executor._taking_back, False
            if in_failsafe and step.enters == self._driver.offboard_mode and not taking_back:
                raise self._control_lost(f"is in a failsafe, in {mode}")
            self._executor.set_commanded(step.enters)
        telemetry.answers.pop(step.answer, None)
        cycle = self._driver.cycle
        if cycle is None:
            self._wait_for_telemetry()
        else:
            self._spin(cycle)
        if self._claim == self._executor._claim and step.done(telemetry):
            if step.enters:
                self._executor._previous = ""
            return ""
        return self._fail()

    # -- waiting

    def _wait_for_telemetry(self) -> None:
        step, changed = self._step, self._telemetry.changed
        handles: list[Handle] = []
        kernel = self._kernel
        with kernel.interact():
            step.send()
            if step.again is not None:
                handles.append(_repeat(kernel, step.again, self._send_again))
            if step.keep is not None:
                handles.append(_repeat(kernel, step.keep.period, step.keep.action))
            try:
                while not self._over():
                    changed.wait_for(self._over_or_late, self._time_left(), ends_activation=True)
            finally:
                for handle in handles:
                    handle.cancel()

    def _spin(self, cycle: Action) -> None:
        """Run the node's own loop in the caller's task until the step is over."""
        step = self._step
        step.send()
        sent_at = kept_at = self._kernel.now()
        while not self._over():
            self._time_left()
            cycle()
            now = self._kernel.now()
            if step.again is not None and now - sent_at >= step.again:
                sent_at = now
                self._send_again()
            if step.keep is not None and now - kept_at >= step.keep.period:
                kept_at = now
                step.keep.action()

    def _send_again(self) -> None:
        if self._step.answer not in self._telemetry.answers and not self._over():
            self._repeated = bool(self._step.answer)
            self._step.send()

    def _over(self) -> bool:
        """Return whether the step is done, refused, taken over, aborted or stopped by the check."""
        if self._claim != self._executor._claim or self._step.done(self._telemetry):
            return True
        # the refusal of a repeated command proves nothing: the first may have been obeyed, its answer lost
        if not self._repeated and self._is_refused():
            return True
        self._detect_takeover()
        now = self._kernel.now()
        if not self._taken and self._stopped is None and now >= self._check_due:
            self._check_due = now + MONITOR_PERIOD
            self._stopped = self._check(self._asked, now) or self._failed()
            self._late = self._elapsed() >= self._step.within
        return bool(self._taken) or self._stopped is not None

    def _over_or_late(self) -> bool:
        return self._over() or (self._late and self._elapsed() >= self._step.within)

    def _elapsed(self) -> Ns:
        """Return the time since the step began, ns; after five seconds on the clock that counts.

        Shorter time-outs are those of answers, which also take the time of the link.
        """
        mine = self._kernel.now() - self._began
        theirs = self._telemetry.elapsed(self._began_at) if mine >= COMPARED_AFTER else mine
        if theirs != mine:
            self._executor.report_clock(theirs / mine)
        return theirs

    def _failed(self) -> VehicleError | None:
        """Return the error of a step that can no longer be done."""
        why = self._step.fails()
        if not why:
            return None
        what = f"{why}; {describe_state(self._telemetry)}{self._advice()}"
        return self._step.failure(self._driver.name, self._asked, what)

    def _is_refused(self) -> bool:
        answer = self._telemetry.answers.get(self._step.answer)
        return answer is not None and not answer.accepted

    def _detect_takeover(self) -> None:
        step, telemetry = self._step, self._telemetry
        expected = step.enters or step.mode
        if telemetry.mode == expected or telemetry.mode in step.leads_to:
            self._mode_before = telemetry.mode
        elif expected and telemetry.mode != self._mode_before and not self._taken:
            self._taken = f"changed from {self._mode_before} to {telemetry.mode}"
        self._taken = self._taken or step.lost()
        self._was_armed = self._was_armed or telemetry.armed
        if step.armed and self._was_armed and not telemetry.armed and not self._taken:
            self._taken = f"was disarmed in {telemetry.mode}"

    def _time_left(self) -> Ns:
        """Return the time until the step or the link times out; raise if either has timed out."""
        now = self._kernel.now()
        patience = self._telemetry.last_message_ns + self._executor._link_timeout - now
        if patience <= 0:
            raise self._executor.link_lost_error(self._asked)
        left = self._step.within - self._elapsed()
        if left <= 0:
            raise self._refused() if self._is_refused() else self._not_arrived()
        return min(left, patience)

    # -- failures

    def _fail(self) -> str:
        """Raise the error that ended the step, or return why it was undone on the ground."""
        if self._claim != self._executor._claim:
            raise self._executor.aborted(self._asked)
        if self._stopped is not None and not self._taken:
            raise self._stopped
        in_flight = bool(self._taken) and (self._telemetry.flying or self._telemetry.failsafe)
        if in_flight:
            self._executor.release_control()
        self._wait_for_reasons()
        if not self._taken:
            raise self._refused()
        if in_flight:
            raise self._control_lost(self._taken)
        return self._taken

    def _wait_for_reasons(self) -> None:
        until = self._kernel.now() + REASON_WAIT
        if self._driver.cycle is None:
            sleep(self._kernel, REASON_WAIT)
            return
        while self._kernel.now() < until:
            self._driver.cycle()

    def _refused(self) -> Refused:
        texts = self._telemetry.texts_since(self._began, severity=5)
        answer = self._telemetry.answers[self._step.answer]
        reason = "; ".join(dict.fromkeys(texts)) or "gave no reason"
        what = f"the autopilot refused to {self._step.ask} ({answer.result}): {reason}"
        return Refused(self._driver.name, self._asked, what + self._advice())

    def _control_lost(self, what: str) -> Overridden:
        telemetry = self._telemetry
        cause = failsafe_cause(telemetry, self._kernel.now())
        kind = Failsafe if cause else Overridden
        why = f"{_because(cause)}{self._executor.last_text()}"
        back = f"; to hand it back, switch the vehicle to {self._driver.offboard_mode}"
        return kind(self._driver.name, self._asked, f"{what} (status {telemetry.status}){why}{back}")

    def _not_arrived(self) -> NotArrived:
        telemetry, step = self._telemetry, self._step
        texts = telemetry.texts_since(self._began)
        said = f"; the autopilot said {'; '.join(dict.fromkeys(texts[-3:]))!r}" if texts else ""
        unanswered = step.answer and step.answer not in telemetry.answers
        within = to_seconds(step.within)
        what = f"to {step.ask} was not seen within {within:g} s; {describe_state(telemetry)}"
        what += "; the autopilot never answered" if unanswered else ""
        return NotArrived(self._driver.name, self._asked, f"{what}{said}{self._advice()}")

    def _advice(self) -> str:
        advice = self._step.advice
        said = advice if isinstance(advice, str) else advice()
        return f"; {said}" if said else ""


def _repeat(kernel: Kernel, period: Ns, action: Action) -> Handle:
    """Call *action* each *period*, for the first time after one period."""
    first = True

    def tick() -> None:
        nonlocal first
        if first:
            first = False
            return
        action()

    return kernel.every(period, tick)


def _because(cause: str) -> str:
    return f"; failsafe ({cause})" if cause else ""
