"""A flight under a control law with the operator's switch on top.

The loop runs at a fixed period: it looks at the switch, executes the manoeuvre, applies its command and
records the terms of its loops. Between two samples it looks at the switch when a report of it arrives, and
releases at once. One function, ``_look``, decides who has control; nothing is sent while the transmitter has
it. During calls that block, such as the take-off, a second task looks at the switch and aborts them.

An emergency landing is the autopilot's own from its first moment, so that it needs no link; the law's descent
follows if the autopilot refuses, or if the settings state it. Descents are limited so that the last command
may last for some seconds after the link is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import inf, isfinite, isnan, nan

from volery.base.errors import CapabilityError, NotArrived, OffTrack, Overridden, VehicleError, VoleryError
from volery.base.frames import LocalFrame
from volery.base.time import MS, Ns, S, from_seconds, to_seconds
from volery.control.actuation import Actuation, MeasuredState, MotionCommand
from volery.control.law_watch import ErrorWatch, FollowWatch, ended_off
from volery.control.laws import PidGains, PidLaw
from volery.control.manoeuvres import LawManoeuvre, LoopSample, SteppedDescent
from volery.control.safety_switch import (
    Authority,
    Emergency,
    KnownInputs,
    SafetyState,
    SwitchSettings,
    decide,
)
from volery.control.vehicle_answer import LEAST_SHARE, suited
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import Rate, sleep
from volery.trace.events import NOTICE, ControlSample, Text
from volery.vehicles import Drone

PERIOD: Ns = 50 * MS
WATCH_PERIOD: Ns = 50 * MS
"""Time after which the switch is looked at again if no report of it arrives."""
POLL_PERIOD: Ns = 10 * MS
"""Time between two looks where the loop of this program receives the reports, as over ROS."""
SWITCH_WITHIN_S = 30.0
"""Time within which the operator must move the switch to its middle position before a flight."""
DESCENT_FACTOR, DESCENT_MARGIN_S = 1.5, 20.0
"""Time-out of the landing law over the time that its rates need."""
REPORTS_WITHIN: Ns = 3 * S
"""Time within which the rate of the reports must be known."""
HOLDS_FOR: Ns = 2 * S
"""Time for which the drone holds between a law that was ended and the landing."""
STILL_SPEED = 0.15
"""Speed in m/s below which a descending drone may stand on the ground."""
STILL_FOR_S = 2.0
LASTS_S = 3.0
"""Time in s for which an autopilot follows the last command after the link is lost: ArduPilot's
RC_OVERRIDE_TIME and GUID_TIMEOUT. PX4's times are shorter.
"""
LEAST_DESCENT = 0.8
"""Rate of descent in m/s that is harmless at the ground."""
MARGIN = 1.5
"""Height in m that is left when the last command ends: the drone still has to stop."""


def limited_descent(command: MotionCommand, height: float) -> MotionCommand:
    """Return the command with a descent that may last ``LASTS_S`` longer without a hard touch-down.

    Args:
        command: command of a law.
        height: height above home, m; an unknown one is a low one.
    """
    room = (height - MARGIN) / LASTS_S if isfinite(height) else 0.0
    return command._replace(up=max(command.up, -max(LEAST_DESCENT, room)))


class ControlledFlight:
    """Flies a manoeuvre under a law.

    Args:
        drone: the drone.
        manoeuvre: what to fly.
        actuation: how commands are applied.
        switch: the operator's switch; ``None`` flies without one.
        period: sample time, ns.
        height: height of the take-off, m above home.
        as_stated: whether the gains of a loop are flown as they are, and not suited to the vehicle.
        on_sample: called before each sample of the manoeuvre with the time in s since it began, for pushes
            and changes of gains.
    """

    def __init__(
        self,
        drone: Drone,
        manoeuvre: LawManoeuvre,
        actuation: Actuation,
        *,
        switch: SwitchSettings | None = None,
        period: Ns = PERIOD,
        height: float = 5.0,
        as_stated: Callable[[str], bool] = lambda _: False,
        on_sample: Callable[[float], None] = lambda _: None,
    ) -> None:
        self._drone, self._manoeuvre, self._actuation = drone, manoeuvre, actuation
        self._switch, self._period, self._height = switch, period, height
        self._on_sample = on_sample
        self._as_stated = as_stated
        self._landing = SteppedDescent()
        self._usual: dict[PidLaw, PidGains] = {}
        self._suited: dict[PidLaw, PidGains] = {}
        self._shares: dict[str, float] = {}
        self._errors, self._follows = ErrorWatch(manoeuvre.laws), FollowWatch()
        self._last: dict[str, LoopSample] = {}
        self._still_s = 0.0
        self._state = SafetyState()
        self._looked_at: Ns = -1
        self._frame: LocalFrame | None = None
        self._engaged = False
        self._watching = False
        self._watched_from = Authority.MANUAL

    @property
    def authority(self) -> Authority:
        """Who has control."""
        return self._state.authority

    def run(self) -> str:
        """Take off if the drone stands, fly the manoeuvre and land.

        Returns:
            How far from its last set-points the manoeuvre ended, if that is too far; else an empty text.

        Raises:
            VehicleError: the switch was not received in its middle position, or the drone cannot be flown.
            CapabilityError: the vehicle reports too rarely for a law.
            OffTrack: the law was ended since its error grew or the drone did not follow; it was landed.
        """
        self._await_switch()
        self._await_reports()
        self._suit_gains()
        if not self._drone.flying:
            self._blocking(lambda: self._actuation.take_off(self._height))
            self._engaged = self.authority is Authority.AUTONOMOUS
            self._suit_gains()  # to the reports in flight
        if not self._fly(self._manoeuvre):
            return ""
        off = ended_off(self._last.values(), self._manoeuvre.accuracy)
        self._land()
        return off

    # -- the vehicle

    def _await_reports(self) -> None:
        """Wait until it is known how often the vehicle reports, at most for ``REPORTS_WITHIN``."""
        kernel, seen = self._drone.kernel, self._drone.telemetry
        until = kernel.now() + REPORTS_WITHIN
        reports = (seen.position_reports, seen.heading_reports)
        while any(isnan(report.seconds) for report in reports) and kernel.now() < until:
            sleep(kernel, POLL_PERIOD)
            self._drone.telemetry  # noqa: B018  # a node's loop is run by reading it

    def _suit_gains(self) -> None:
        """Suit the gains that the user has not stated to how the vehicle answers and reports."""
        answer, seen = self._actuation.answer, self._drone.telemetry
        if answer is None:
            return
        if seen.position_reports.seconds > answer.velocity_within_s:
            raise CapabilityError(
                f"{self._drone.name} reports its velocity each {seen.position_reports.seconds:.2f} s; tilt "
                f"angles of a law need it each {answer.velocity_within_s:g} s; fly by set-points, or request "
                f"more reports (rate= in the address)"
            )
        for manoeuvre in (self._manoeuvre, self._landing):
            for loop, law in manoeuvre.laws.items():
                process = answer.of(loop)
                if process is None or self._as_stated(loop) or not isinstance(law, PidLaw):
                    continue
                if self._suited.get(law, law.gains) != law.gains:
                    continue  # changed by the user since
                reports_s = (seen.heading_reports if loop == "yaw" else seen.position_reports).seconds
                usual = self._usual.setdefault(law, law.gains)
                gains, share = suited(usual, process, reports_s, to_seconds(self._period))
                if share < LEAST_SHARE:
                    raise CapabilityError(
                        f"{self._drone.name}: no law of {loop} is stable on it: it is reported each "
                        f"{reports_s:.1f} s; request more reports"
                    )
                law.gains = self._suited[law] = gains
                if manoeuvre is self._manoeuvre and self._shares.get(loop, 1.0) != share:
                    self._shares[loop] = share
                    self._note(
                        f"gains of {loop} are {share:.2f} of the usual ones (kp {gains.kp:.3g}), for how it "
                        f"answers and a report each {reports_s:.2f} s"
                    )

    # -- the switch

    def _await_switch(self) -> None:
        """Wait until the operator gives control."""
        if self._switch is None:
            self._state = SafetyState(Authority.AUTONOMOUS, 0, "there is no switch")
            return
        kernel = self._drone.kernel
        until = kernel.now() + from_seconds(SWITCH_WITHIN_S)
        while self._look() is not Authority.AUTONOMOUS:
            if kernel.now() >= until:
                raise NotArrived(self._drone.name, "wait for the safety switch", self._missing_switch())
            sleep(kernel, WATCH_PERIOD)

    def _missing_switch(self) -> str:
        """Return in words why the switch does not give control, and the remedy."""
        assert self._switch is not None
        received, channel = self._received(), self._switch.channel
        without = "fly without a switch (--switch none)"
        if not any(received._replace(pulse=one).valid for one in self._drone.telemetry.rc):
            return f"no transmitter is received at all; switch one on, or {without}"
        if not received.valid:
            return (
                f"channel {channel} has no signal; state the channel of the switch (--switch), or {without}"
            )
        low, high = self._switch.middle
        return f"channel {channel} is at {received.pulse} us; move it to {low} to {high} us, or {without}"

    def _received(self) -> KnownInputs:
        assert self._switch is not None
        telemetry, now = self._drone.telemetry, self._drone.kernel.now()
        channels = telemetry.rc
        index = self._switch.channel - 1
        pulse = channels[index] if index < len(channels) else 0
        age = to_seconds(now - telemetry.rc_ns) if telemetry.rc_ns >= 0 else inf
        return KnownInputs(pulse, age, telemetry.silence(now), telemetry.rc_ns != self._looked_at)

    def _look(self) -> Authority:
        """Look at the switch and return who has control; a change is recorded."""
        if self._switch is not None:
            state = decide(self._switch, self._state, self._received())
            if state.authority is not self._state.authority:
                self._note(f"{state.authority.value}: {state.why}")
            self._state = state
            self._looked_at = self._drone.telemetry.rc_ns
        return self._state.authority

    def _await_report(self, within: Ns) -> bool:
        """Wait for the next report of the switch, at most for *within* ns; return whether there was one."""
        telemetry, last = self._drone.telemetry, self._looked_at
        if not telemetry.detects_silence:  # this task runs the loop of the node that receives the reports
            sleep(self._drone.kernel, min(within, POLL_PERIOD))
            return self._drone.telemetry.rc_ns != last
        return telemetry.changed.wait_for(lambda: telemetry.rc_ns != last, within, ends_activation=True)

    def _note(self, text: str) -> None:
        kernel = self._drone.kernel
        kernel.record(Text(kernel.now(), f"{self._drone.name} control", NOTICE, text))

    # -- calls that block

    def _blocking(self, call: Callable[[], None]) -> None:
        """Make a call that blocks; the switch aborts it."""
        with self._watched():
            try:
                call()
            except Overridden:
                if self.authority is Authority.AUTONOMOUS:
                    raise

    @contextmanager
    def _watched(self) -> Iterator[None]:
        """Look at the switch in a task of its own while the context lasts."""
        if self._switch is None:
            yield
            return
        self._watching = True
        self._watched_from = self.authority
        name = f"switch of {self._drone.name}"
        task = self._drone.kernel.spawn(self._watch, name, ExecutionContext(name))
        try:
            yield
        finally:
            self._watching = False
            kernel = self._drone.kernel
            while not task.done:
                sleep(kernel, WATCH_PERIOD)

    def _watch(self) -> None:
        while self._watching:
            authority = self._look()
            if authority is Authority.MANUAL:
                self._release()
                return
            if authority is Authority.LANDING and self._watched_from is Authority.AUTONOMOUS:
                self._watched_from = authority
                kernel, name = self._drone.kernel, f"landing of {self._drone.name}"
                kernel.spawn(self._abort, name, ExecutionContext(name))
            self._await_report(WATCH_PERIOD)

    def _abort(self) -> None:
        """Abort the call that blocks by a landing, or by a stop where the law is to descend."""
        with suppress(VoleryError):  # the flight lands, whatever came of this
            if self._drone.flying and not self._autopilot_lands:
                self._drone.hold()
            else:
                self._drone.land()

    def _release(self) -> None:
        self._engaged = False
        try:
            self._drone.hand_over()
        except VoleryError as error:
            self._note(f"it was released, but remains in {self._drone.mode}: {error}")

    # -- the loop

    def _fly(self, manoeuvre: LawManoeuvre) -> bool:
        """Fly *manoeuvre*; return whether it ended, and not the flight."""
        kernel = self._drone.kernel
        rate = Rate(kernel, self._period)
        last = kernel.now()
        begun = last
        while not manoeuvre.done:
            self._await_sample(rate)
            authority = self._look()
            now = kernel.now()
            sample_s, last = max(to_seconds(now - last), 1e-3), now
            if authority is Authority.LANDING:
                self._land()
                return False
            if authority is Authority.MANUAL:
                if self._engaged:
                    self._release()
                if not self._drone.armed:
                    self._note("the pilot has landed and disarmed")
                    return False
                continue
            if not self._take_control(manoeuvre):
                continue
            self._on_sample(to_seconds(now - begun))
            wrong = self._sample(manoeuvre, sample_s) or manoeuvre.stuck
            if wrong:
                self._give_up(wrong)
                return False
        return True

    def _give_up(self, wrong: str) -> None:
        """Hold, then land by the autopilot, and raise what was wrong."""
        self._note(f"{wrong}; it holds, then the autopilot lands it")
        ended = "it held and landed"
        try:
            self._blocking(self._stop)
            if self.authority is Authority.MANUAL:
                self._fly_on_by_pilot()
            else:
                self._finish_landing()
        except VehicleError as error:
            if isinstance(error, Overridden):
                raise
            ended = str(error)
        raise OffTrack(self._drone.name, "fly under a law", f"{wrong}; {ended}")

    def _stop(self) -> None:
        try:
            self._drone.hold()
            sleep(self._drone.kernel, HOLDS_FOR)
        except VehicleError as error:
            if isinstance(error, Overridden):
                raise
            self._note(f"it does not hold: {error}")

    def _await_sample(self, rate: Rate) -> None:
        """Sleep until the next sample is due; a takeover in the meantime releases at once."""
        kernel = self._drone.kernel
        while self._switch is not None and self._engaged and kernel.now() < rate.due:
            if self._await_report(rate.due - kernel.now()) and self._look() is Authority.MANUAL:
                self._release()
        rate.sleep()

    def _take_control(self, manoeuvre: LawManoeuvre) -> bool:
        if not self._engaged:
            self._blocking(self._actuation.engage)
            if self.authority is Authority.MANUAL:
                return False
            manoeuvre.reset()
            self._errors.reset()
            self._follows.reset()
            self._engaged = True
        return True

    def _sample(self, manoeuvre: LawManoeuvre, sample_s: float) -> str:
        """Fly one sample; return what is wrong with the law or the vehicle, in words."""
        measured = self._measure()
        command, samples = manoeuvre.step(measured, sample_s)
        command = limited_descent(command, measured.up)
        self._actuation.apply(command, measured, sample_s)
        for sample in samples:
            self._record(sample)
            self._last[sample.loop] = sample
        wrong = self._errors.check(samples, sample_s)
        if not wrong and self._actuation.answer is not None:
            wrong = self._follows.check(command, measured, sample_s)
        return wrong

    def _measure(self) -> MeasuredState:
        """Return what telemetry reports; an old position is unknown."""
        seen = self._drone.telemetry
        north = east = nan
        if seen.position is not None and seen.located:
            if self._frame is None:
                at = seen.home or seen.position
                self._frame = LocalFrame(at.latitude, at.longitude, at.altitude.metres)
            here = seen.position
            east, north, _ = self._frame.to_enu(here.latitude, here.longitude, here.altitude.metres)
        heading = seen.attitude.heading if not seen.stale else nan
        return MeasuredState(heading, north, east, seen.above_home, *seen.velocity, self._actuation.lead)

    def _record(self, one: LoopSample) -> None:
        kernel, terms = self._drone.kernel, one.terms
        figures = (terms.error, terms.proportional, terms.integral, terms.derivative, terms.output)
        kernel.record(
            ControlSample(
                kernel.now(),
                self._drone.name,
                one.loop,
                one.controller,
                one.unit,
                one.period,
                one.goal,
                one.measurement,
                *map(float, figures),
            )
        )

    # -- the landing

    @property
    def _autopilot_lands(self) -> bool:
        """Whether an emergency landing is the autopilot's own."""
        return self._switch is not None and self._switch.emergency is Emergency.AUTOPILOT

    def _land(self) -> None:
        """Land: in an emergency by the autopilot, which then needs no link, else under the landing law."""
        if self.authority is Authority.LANDING and self._autopilot_lands:
            try:
                self._finish_landing()
            except VehicleError as error:
                if isinstance(error, Overridden) or not self._drone.armed:
                    raise
                self._note(f"the law lands it: {error}")
            else:
                return
        self._descend()

    def _finish_landing(self) -> None:
        """Let the autopilot land, and the pilot after a takeover."""
        self._blocking(self._drone.land)
        if self.authority is Authority.MANUAL:
            self._fly_on_by_pilot()

    def _descend(self) -> None:
        """Descend under the landing law to the ground, where the autopilot detects it and disarms.

        The autopilot lands all the way where the law cannot: without telemetry, a height or control.
        """
        kernel, seen, landing = self._drone.kernel, self._drone.telemetry, self._landing
        landing.reset()
        self._still_s = 0.0
        self._errors, self._follows = ErrorWatch(landing.laws), FollowWatch()
        rate = Rate(kernel, self._period)
        begun = last = kernel.now()
        needed_s = landing.duration(seen.above_home) if isfinite(seen.above_home) else 0.0
        until = last + from_seconds(DESCENT_FACTOR * needed_s + DESCENT_MARGIN_S)
        try:
            while kernel.now() < until:
                self._await_sample(rate)
                now = kernel.now()
                sample_s, last = max(to_seconds(now - last), 1e-3), now
                before = self.authority
                if self._look() is Authority.MANUAL:
                    self._release()
                    self._fly_on_by_pilot()
                    return
                if not self._drone.armed:
                    return
                if self.authority is not before and self._autopilot_lands:
                    break
                if self._drone.telemetry.stale or not isfinite(self._drone.telemetry.above_home):
                    break
                if self._take_control(landing) and self._is_down(self._sample(landing, sample_s), sample_s):
                    break
            else:
                self._note(
                    f"the landing law was not down after {to_seconds(kernel.now() - begun):.0f} s, at "
                    f"{self._drone.telemetry.above_home:.1f} m above home; the autopilot lands it"
                )
        except VehicleError as error:
            if isinstance(error, Overridden):
                raise
            self._note(f"the autopilot lands: {error}")
        self._finish_landing()

    def _is_down(self, wrong: str, sample_s: float) -> bool:
        """Return whether the landing law has done its part: it stands, or what is *wrong* ends the law."""
        seen = self._drone.telemetry
        still = abs(seen.velocity.up) < STILL_SPEED and seen.above_home < 1.0
        self._still_s = self._still_s + sample_s if still else 0.0
        if self._drone.landed or self._still_s >= STILL_FOR_S:
            return True
        if wrong:
            self._note(f"the landing law: {wrong}; the autopilot lands it")
        return bool(wrong)

    def _fly_on_by_pilot(self) -> None:
        """Wait until the pilot has landed, or gives control back."""
        while self._drone.armed and self._look() is Authority.MANUAL:
            sleep(self._drone.kernel, S // 10)
        if self._drone.armed:
            self._land()
