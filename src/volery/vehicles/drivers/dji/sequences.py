"""Pieces that sequences of steps are made of: readiness, authority, set-points, and their end.

Motors and tasks: what a DJI aircraft does by itself once it is told to, off the ground and back to it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from volery.base.errors import OutOfBounds, Refused
from volery.base.time import Ns, S
from volery.ros.messages.dji_constants import SETPOINT_HEIGHTS, DisplayMode
from volery.vehicles.driver import Step
from volery.vehicles.drivers.dji.backend import Ack, DjiBackend
from volery.vehicles.drivers.dji.decoder import DESCENDING_MODES, TAKES_OFF
from volery.vehicles.drivers.dji.node_interfaces import GO_HOME, LAND, TAKE_OFF
from volery.vehicles.drivers.dji.setpoints import Manual, Moving, Point, yaw_of
from volery.vehicles.drivers.steps import (
    ANSWERED_WITHIN,
    ARMED_WITHIN,
    READY_WITHIN,
    climbed_to,
    disarmed_step,
    immediate_step,
    send_nothing,
)
from volery.vehicles.telemetry import Telemetry

RESEND_PERIOD: Ns = 2 * S

SDK, WAITS = DisplayMode.NAVI_SDK_CTRL.name, DisplayMode.P_GPS.name
STARTS = (DisplayMode.ENGINE_START.name, DisplayMode.ATTITUDE.name, WAITS, SDK)
"""Modes that the start of the motors leads through."""
LANDING_MODES = frozenset(mode.name for mode in DESCENDING_MODES)


class DjiSteps:
    """What it takes to have one aircraft do something."""

    def __init__(self, name: str, backend: DjiBackend) -> None:
        self.name = name
        self.backend = backend
        self.telemetry = backend.telemetry
        self.decoder = backend.decoder
        self.stream = backend.stream

    def accepted(self, which: str) -> bool:
        """Whether the last answer to that question was yes."""
        answer = self.telemetry.answers.get(which)
        return answer is not None and answer.accepted

    # -- before it does anything

    def activated(self) -> Step:
        """By the node's own parameters."""
        return Step(
            ask="activate",
            send=self.backend.activate,
            done=lambda seen: self.decoder.activated,
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=Ack.ACTIVATION,
            again=RESEND_PERIOD,
            advice="the node activates with app_id and enc_key among its parameters",
        )

    def ready(self, within: Ns = READY_WITHIN) -> Sequence[Step]:
        """Activated, a position that may be trusted, and a local reference."""
        wait = Step(
            ask="be ready to go by position",
            send=send_nothing,
            done=lambda seen: seen.ready or seen.armed,
            within=within,
            skippable=True,
            advice=f"its {self.telemetry.fix or 'gps health'} must be above 3: give it a view of the sky",
        )
        refer = Step(
            ask="set its local reference",
            send=lambda: self.backend.request(Ack.REFERENCE, self.backend.interface.reference()),
            done=lambda seen: seen.armed or self.accepted(Ack.REFERENCE),
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=Ack.REFERENCE,
            again=RESEND_PERIOD,
        )
        activate = self.activated()
        return (replace(activate, within=min(within, activate.within)), wait, refer)

    def authority(self) -> Step:
        """The program's, which everything takes but tasks."""
        return Step(
            ask="give the program the authority",
            send=self.backend.authority,
            done=lambda seen: self.decoder.authority,
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=Ack.AUTHORITY,
            again=RESEND_PERIOD,
            advice="the pilot's mode switch must be at F (P on aircraft that have no F)",
        )

    def leave_descent(self) -> Sequence[Step]:
        """Out of a landing or a way home that was asked for before, where that takes a task."""
        doing = self.decoder.commanded
        task = GO_HOME if doing == DisplayMode.NAVI_GO_HOME.name else LAND
        ask = self.backend.interface.interrupt(task) if doing in LANDING_MODES else None
        if ask is None or not self.telemetry.flying or self.telemetry.mode != doing:
            return ()
        return (
            Step(
                ask=f"leave {doing}",
                send=lambda: self.backend.request(Ack.TASK, ask),
                done=lambda seen: seen.mode in {WAITS, SDK},
                within=ANSWERED_WITHIN,
                answer=Ack.TASK,
                again=RESEND_PERIOD,
                enters=WAITS,
                leads_to=(doing,),
            ),
        )

    # -- set-points

    def follow(self, target: Point | Moving | Manual) -> None:
        """Stream it from now on."""
        self.decoder.commanded = SDK
        self.stream.follow(target)
        self.backend.wake()

    def to_point(
        self,
        ask: str,
        point: Callable[[], Point | None],
        done: Callable[[Telemetry], bool],
        within: Ns,
    ) -> Sequence[Step]:
        """Streamed until *done*; then it hovers by itself."""

        def send() -> None:
            target = point()
            if target is not None:
                self.follow(target)

        step = Step(ask=ask, send=send, done=done, within=within, enters=SDK, leads_to=(WAITS,), armed=True)
        return (*self.leave_descent(), self.authority(), step, self.hover())

    def over_here(self, height: float) -> Point | None:
        """Where it is, that high above home; ``None`` while it does not know."""
        here = self.telemetry.position
        return None if here is None else Point(here.latitude, here.longitude, height, yaw_of(self.telemetry))

    def check_height(self, height: float, asked: str) -> None:
        """Raise ``OutOfBounds`` where no set-point goes."""
        low, high = SETPOINT_HEIGHTS
        if not low <= height <= high:
            what = f"{height:.1f} m above home; set-points of DJI aircraft go from {low:g} to {high:g} m"
            raise OutOfBounds(self.name, asked, what)

    def hover(self) -> Step:
        """Without set-points."""
        return immediate_step("hover", self.stream.stop)

    def quiet(self) -> Step:
        """A set-point still on its way would end what is asked for next. Who takes it meanwhile has it."""
        return Step(
            ask="send no more set-points",
            send=self.stream.stop,
            done=lambda seen: self.backend.quiet,
            within=ANSWERED_WITHIN,
            skippable=True,
            mode=self.telemetry.mode,
            leads_to=(WAITS, SDK),
        )


UP_WITHIN: Ns = 35 * S
"""Of the take-off itself: motors within 5 s, off the ground within 20 s, then to the fixed height."""
M100_GAINS_M = 0.8
"""An M100 counts as off the ground once it is so much above home. The SDK's demo asks for 1 m; of a take-off
to about 1.2 m that leaves little for the drift of a height.
"""


class DjiTasks:
    """Take-off, landing and going home need no authority; the motors do."""

    def __init__(self, steps: DjiSteps) -> None:
        self._steps = steps
        self._backend = steps.backend
        self._telemetry = steps.telemetry

    def arm(self) -> Sequence[Step]:
        """Start the motors."""
        step = Step(
            ask="start the motors",
            send=lambda: self._backend.motors(True),
            done=lambda seen: seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=Ack.MOTORS,
            again=RESEND_PERIOD,
            leads_to=STARTS,
        )
        return (self._steps.activated(), self._steps.authority(), step)

    def disarm(self, force: bool) -> Sequence[Step]:
        """Stop the motors. In the air the aircraft would fall: that takes *force*."""
        if self._telemetry.flying and not force:
            said = "it flies, and would fall; land() first, or force it"
            raise Refused(self._steps.name, "disarm", said)
        step = Step(
            ask="stop the motors",
            send=lambda: self._backend.motors(False, force=force),
            done=lambda seen: not seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=Ack.MOTORS,
            again=RESEND_PERIOD,
        )
        alone = force and self._backend.interface.kills_without_authority
        return (self._steps.authority(), step) if self._telemetry.armed and not alone else (step,)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Task 4, which starts the motors and goes to its own height; then to *height* by set-points."""
        steps = self._steps
        steps.check_height(height, f"take off to {height:g} m")
        lift = Step(
            ask="take off",
            send=lambda: self._backend.task(TAKE_OFF, DisplayMode.AUTO_TAKEOFF),
            done=self._off_the_ground,
            within=UP_WITHIN,
            answer=Ack.TASK,
            again=RESEND_PERIOD,
            enters=DisplayMode.AUTO_TAKEOFF.name,
            leads_to=STARTS,
            armed=True,
        )
        climb = steps.to_point(
            f"climb to {height:g} m", lambda: steps.over_here(height), climbed_to(height), within
        )
        return (*steps.ready(), steps.authority(), lift, *climb)

    def _off_the_ground(self, seen: Telemetry) -> bool:
        if self._backend.is_m100 and not seen.above_home >= M100_GAINS_M:
            return False
        return seen.flying and seen.mode not in {mode.name for mode in TAKES_OFF}

    def return_home(self, within: Ns) -> Sequence[Step]:
        """Task 1: it climbs, goes home and lands; near home it lands at once."""
        return self._until_down(GO_HOME, DisplayMode.NAVI_GO_HOME, "return home and land", within)

    def land(self, within: Ns) -> Sequence[Step]:
        """Task 6, until the motors have stopped."""
        return self._until_down(LAND, DisplayMode.AUTO_LANDING, "land", within)

    def _until_down(self, task: int, mode: DisplayMode, ask: str, within: Ns) -> Sequence[Step]:
        if not self._telemetry.armed:
            return ()
        if not self._telemetry.flying:
            return self.disarm(force=False)
        begin = Step(
            ask=ask,
            send=lambda: self._backend.task(task, mode),
            done=lambda seen: seen.mode == mode.name or not seen.armed,
            within=ANSWERED_WITHIN,
            answer=Ack.TASK,
            again=RESEND_PERIOD,
            enters=mode.name,
            leads_to=(WAITS, SDK),
        )
        return (self._steps.quiet(), begin, disarmed_step(ask, mode.name, within))
