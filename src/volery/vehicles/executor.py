"""The one executor of steps: time-outs, refusals, starting over, takeover and silence, for every driver.

It waits on telemetry. MAVLink does not say who changed a mode; so a mode that the autopilot is in without our
having commanded it belongs to somebody else, and in the air it is never fought.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from volery.base.errors import (
    Failsafe,
    LinkLost,
    NotArrived,
    Overridden,
    Refused,
    VehicleError,
    VoleryError,
)
from volery.base.time import MS, Ns, S, to_seconds
from volery.kernel.api import Action, Handle, Kernel
from volery.kernel.waiting import sleep
from volery.vehicles.driver import Driver, Step
from volery.vehicles.telemetry import Telemetry

RESTARTS = 3
"""How often a sequence that is undone before lift-off is started over."""

REASON_WAIT: Ns = 500 * MS
"""The autopilot's reason often comes just after its refusal; so long it is waited for."""

RECENT_TEXT_S = 3.0
"""A text that is older is quoted with its age."""

LINK_TIMEOUT: Ns = 5 * S
"""A link that says nothing for so long is lost: five missed heartbeats."""


Check = Callable[[str, Ns], VehicleError | None]
"""Told what is asked and the time with each message of telemetry: the error that ends it, or ``None``."""


def _no_check(_asked: str, _now: Ns) -> None:
    """Nothing ends it."""


class StepExecutor:
    """Runs steps for one vehicle. ``commanded`` is the mode that was asked for last; empty when not ours."""

    def __init__(self, kernel: Kernel, driver: Driver, silence: Ns = LINK_TIMEOUT) -> None:
        self._kernel = kernel
        self._driver = driver
        self._silence = silence
        self.commanded = ""
        self._kept = ""  # the mode that was ours before, until the one commanded last is seen
        self.turn = 0  # whose it is: what was begun in an earlier one ends
        self.successor = ""  # what took the vehicle from it

    def perform(
        self,
        asked: str,
        plan: Callable[[], Sequence[Step]],
        *,
        restarts: int = 0,
        look: Check = _no_check,
    ) -> None:
        """Run the steps of *plan*; while it is undone before lift-off start over, at most *restarts* times.

        Raises:
            Refused: the autopilot said no; its own words are quoted.
            Overridden, Failsafe: somebody else has the vehicle.
            NotArrived: not seen to be done in time.
            LinkLost: the autopilot has fallen silent.
            VehicleError: what *look* returns.
        """
        undone = ""
        for _ in range(restarts + 1):
            undone = self._sequence(asked, plan(), look)
            if not undone:
                return
        times = f" before lift-off, each time it was started over ({restarts} times)" if restarts else ""
        raise Overridden(self._driver.name, asked, undone + times + self.last_words())

    def give_way(self, successor: str) -> None:
        """What is under way in another task ends now: *successor* takes the vehicle."""
        self.turn += 1
        self.successor = successor
        self._driver.telemetry.changed.notify()

    def is_ours(self) -> bool:
        """It is in the mode that was commanded last, still in the one that was ours before if that was
        refused, or in the one in which it obeys a computer.
        """
        return self._driver.telemetry.mode in {self.commanded, self._kept, self._driver.handover}

    def command(self, mode: str) -> None:
        """*mode* is being asked for: it is ours from now on."""
        if mode != self.commanded:
            self._kept, self.commanded = self.commanded, mode

    def entered(self) -> None:
        """The mode that was commanded last is seen: what was ours before is no more."""
        self._kept = ""

    def lose(self) -> None:
        """Somebody else has it: nothing is sent to it any more, no set-point and no stick either."""
        self.commanded = self._kept = ""
        self._driver.stop()

    def check_ours(self, asked: str) -> None:
        """Raise ``Overridden`` if it flies in a mode that this program did not command."""
        seen = self._driver.telemetry
        if not seen.flying or self.is_ours():
            return
        self.lose()
        kind = Failsafe if seen.failsafe else Overridden
        raise kind(
            self._driver.name,
            asked,
            f"is in {seen.mode} (status {seen.status}), which this program did not command"
            f"{self.last_words()}; to hand it over, switch the vehicle to {self._driver.handover}",
        )

    def _sequence(self, asked: str, steps: Sequence[Step], look: Check) -> str:
        """Why it was undone on the ground; empty if all is done."""
        turn = self.turn
        for step in steps:
            if turn != self.turn:
                raise self.taken_over(asked)
            undone = _StepRun(self, self._kernel, self._driver, asked, step, look).run()
            if undone:
                return undone
        return ""

    def taken_over(self, asked: str) -> Overridden:
        """Another part of the same program has it now."""
        return Overridden(self._driver.name, asked, f"{self.successor} took its place")

    def wait(self, holds: Callable[[], bool], within: Ns) -> bool:
        """Until it *holds* of the telemetry (True), at most for *within* (False)."""
        cycle = self._driver.cycle
        if cycle is None:
            return self._driver.telemetry.changed.wait_for(holds, within, ends_activation=True)
        until = self._kernel.now() + within
        while not holds():
            if self._kernel.now() >= until:
                return False
            cycle()
        return True

    def silent(self) -> bool:
        """It spoke before, but not for so long that the link counts as lost."""
        return self._kernel.now() - self._driver.telemetry.heard >= self._silence

    def patience(self) -> Ns:
        """How much longer it may be silent."""
        return self._driver.telemetry.heard + self._silence - self._kernel.now()

    def last_words(self) -> str:
        """What the autopilot said last, and how long ago if that is long."""
        texts = self._driver.telemetry.texts
        if not texts:
            return ""
        ago = to_seconds(self._kernel.now() - texts[-1].at)
        return f"; it last said {texts[-1].text!r}" + (
            f" ({ago:.0f} s before)" if ago > RECENT_TEXT_S else ""
        )


class _StepRun:
    """One step under way."""

    def __init__(
        self, owner: StepExecutor, kernel: Kernel, driver: Driver, asked: str, step: Step, look: Check
    ) -> None:
        self._owner = owner
        self._turn = owner.turn
        self._look = look
        self._stopped: VehicleError | None = None  # what ends it, seen by *look*
        self._kernel = kernel
        self._driver = driver
        self._asked = asked
        self._step = step
        self._seen: Telemetry = driver.telemetry
        self._began: Ns = kernel.now()
        self._mode_before = self._seen.mode
        self._was_armed = self._seen.armed
        self._changed = ""  # what somebody else did
        self._repeated = False

    def run(self) -> str:
        """Why it was undone before lift-off; empty if it is done."""
        step = self._step
        skipped = step.skippable and step.done(self._seen)
        if not skipped:
            self._check_not_fought()
        if step.enters:
            self._owner.command(step.enters)  # also where it is in that mode already: it is ours now
        if skipped:
            self._settle()
            return ""
        self._seen.answers.pop(step.answer, None)
        if self._driver.cycle is None:
            self._wait_for_telemetry()
        else:
            self._go_round(self._driver.cycle)
        return self._judge()

    def _settle(self) -> None:
        if self._step.enters:
            self._owner.entered()

    def _check_not_fought(self) -> None:
        """Guided is never commanded over a failsafe, not even over one that took the mode we were in."""
        seen, enters = self._seen, self._step.enters
        if seen.flying and seen.failsafe and enters == self._driver.handover and seen.mode != enters:
            raise self._taken(f"is in a failsafe, in {seen.mode}")

    # -- waiting

    def _wait_for_telemetry(self) -> None:
        handles: list[Handle] = []
        with self._kernel as kernel:
            self._step.send()
            if self._step.again is not None:
                handles.append(_later(kernel, self._step.again, self._ask_again))
            if self._step.keep is not None:
                handles.append(_later(kernel, self._step.keep.period, self._step.keep.action))
            try:
                while not self._over():
                    left = self._time_left()
                    self._seen.changed.wait_for(self._over, left, ends_activation=True)
            finally:
                for handle in handles:
                    handle.cancel()

    def _go_round(self, cycle: Action) -> None:
        """The node's own loop, in the caller's task."""
        step = self._step
        step.send()
        asked_at = kept_at = self._kernel.now()
        while not self._over():
            self._time_left()
            cycle()
            now = self._kernel.now()
            if step.again is not None and now - asked_at >= step.again:
                asked_at = now
                self._ask_again()
            if step.keep is not None and now - kept_at >= step.keep.period:
                kept_at = now
                step.keep.action()

    def _ask_again(self) -> None:
        if self._step.answer not in self._seen.answers and not self._over():
            self._repeated = bool(self._step.answer)
            self._step.send()

    def _over(self) -> bool:
        """Done, refused, taken by somebody else, or not to be gone on with."""
        step, seen = self._step, self._seen
        if self._turn != self._owner.turn:
            return True
        if step.done(seen):
            return True
        if self._is_refused() and not self._repeated:
            return True
        self._notice_changes()
        if not self._changed:
            self._stopped = self._stopped or self._look(self._asked, self._kernel.now())
        return bool(self._changed) or self._stopped is not None

    def _is_refused(self) -> bool:
        """Of what was asked twice it proves nothing: the first may have been obeyed, and its answer lost."""
        answer = self._seen.answers.get(self._step.answer)
        return answer is not None and not answer.accepted

    def _notice_changes(self) -> None:
        step, seen = self._step, self._seen
        ours = step.enters or step.mode
        if seen.mode == ours or seen.mode in step.leads_to:
            self._mode_before = seen.mode
        elif ours and seen.mode != self._mode_before and not self._changed:
            self._changed = f"changed from {self._mode_before} to {seen.mode}"
        self._changed = self._changed or step.lost()
        self._was_armed = self._was_armed or seen.armed
        if step.armed and self._was_armed and not seen.armed and not self._changed:
            self._changed = f"was disarmed in {seen.mode}"

    def _time_left(self) -> Ns:
        """Until the time-out or until the silence is too long; raises when one of them has come."""
        if self._owner.silent():
            raise self._lost()
        left = self._began + self._step.within - self._kernel.now()
        if left <= 0:
            raise self._refused() if self._is_refused() else self._late()
        return min(left, self._owner.patience())

    # -- the end

    def _judge(self) -> str:
        if self._turn != self._owner.turn:
            raise self._owner.taken_over(self._asked)
        if self._step.done(self._seen):
            self._settle()
            return ""
        if self._stopped is not None and not self._changed:
            raise self._stopped
        taken = bool(self._changed) and (self._seen.flying or self._seen.failsafe)
        if taken:
            self._owner.lose()
        self._hear_reasons()
        if not self._changed:
            raise self._refused()
        if taken:
            raise self._taken(self._changed)
        return self._changed

    def _hear_reasons(self) -> None:
        until = self._kernel.now() + REASON_WAIT
        if self._driver.cycle is None:
            sleep(self._kernel, REASON_WAIT)
            return
        while self._kernel.now() < until:
            self._driver.cycle()

    def _refused(self) -> Refused:
        texts = self._seen.texts_since(self._began, severity=5)
        answer = self._seen.answers[self._step.answer]
        said = "; ".join(dict.fromkeys(texts)) or "gave no reason"
        what = f"the autopilot refused to {self._step.ask} ({answer.result}): {said}"
        return Refused(self._driver.name, self._asked, what + self._advice())

    def _taken(self, what: str) -> Overridden:
        seen = self._seen
        kind = Failsafe if seen.failsafe else Overridden
        said = self._owner.last_words()
        back = f"; to hand it back, switch the vehicle to {self._driver.handover}"
        return kind(self._driver.name, self._asked, f"{what} (status {seen.status}){said}{back}")

    def _late(self) -> NotArrived:
        texts = self._seen.texts_since(self._began)
        said = f"; the autopilot said {'; '.join(dict.fromkeys(texts[-3:]))!r}" if texts else ""
        unanswered = ""
        if self._step.answer and self._step.answer not in self._seen.answers:
            unanswered = "; the autopilot never answered"
        within = to_seconds(self._step.within)
        what = f"to {self._step.ask} was not seen within {within:g} s; {_whereabouts(self._seen)}"
        return NotArrived(self._driver.name, self._asked, f"{what}{unanswered}{said}{self._advice()}")

    def _lost(self) -> VoleryError:
        seen = self._seen
        ago = seen.silence(self._kernel.now())
        wrong = self._driver.problem()
        why = f"; {wrong}" if wrong is not None else ""
        return LinkLost(
            f"{seen.name}: {self._asked}: nothing was heard for {ago:.1f} s{why}; "
            f"last: {_whereabouts(seen)}, at {to_seconds(seen.heard):.1f} s"
        )

    def _advice(self) -> str:
        return f"; {self._step.advice}" if self._step.advice else ""


def _later(kernel: Kernel, period: Ns, action: Callable[[], None]) -> Handle:
    """Each *period* from one period on."""
    first = True

    def tick() -> None:
        nonlocal first
        if first:
            first = False
            return
        action()

    return kernel.every(period, tick)


def _whereabouts(seen: Telemetry) -> str:
    armed = "armed" if seen.armed else "disarmed"
    where = f"at {seen.position}" if seen.position is not None else "position unknown"
    return f"{where}, mode {seen.mode or 'unknown'}, {armed}"
