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
from volery.vehicles.drivers.dji import backend as key
from volery.vehicles.drivers.dji.backend import DjiBackend
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

    def __init__(self, name: str, carrier: DjiBackend) -> None:
        self.name = name
        self.carrier = carrier
        self.telemetry = carrier.telemetry
        self.hearing = carrier.hearing
        self.stream = carrier.stream

    def accepted(self, which: str) -> bool:
        """Whether the last answer to that question was yes."""
        answer = self.telemetry.answers.get(which)
        return answer is not None and answer.accepted

    # -- before it does anything

    def activated(self) -> Step:
        """By the node's own parameters."""
        return Step(
            ask="activate",
            send=self.carrier.activate,
            done=lambda seen: self.hearing.activated,
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=key.ACTIVATION,
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
            send=lambda: self.carrier.ask(key.REFERENCE, self.carrier.names.reference()),
            done=lambda seen: seen.armed or self.accepted(key.REFERENCE),
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=key.REFERENCE,
            again=RESEND_PERIOD,
        )
        activate = self.activated()
        return (replace(activate, within=min(within, activate.within)), wait, refer)

    def authority(self) -> Step:
        """The program's, which everything takes but tasks."""
        return Step(
            ask="give the program the authority",
            send=self.carrier.authority,
            done=lambda seen: self.hearing.authority,
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=key.AUTHORITY,
            again=RESEND_PERIOD,
            advice="the pilot's mode switch must be at F (P on aircraft that have no F)",
        )

    def free(self) -> Sequence[Step]:
        """Out of a landing or a way home that was asked for before, where that takes a task."""
        doing = self.hearing.asked
        task = GO_HOME if doing == DisplayMode.NAVI_GO_HOME.name else LAND
        ask = self.carrier.names.interrupt(task) if doing in LANDING_MODES else None
        if ask is None or not self.telemetry.flying or self.telemetry.mode != doing:
            return ()
        return (
            Step(
                ask=f"leave {doing}",
                send=lambda: self.carrier.ask(key.TASK, ask),
                done=lambda seen: seen.mode in {WAITS, SDK},
                within=ANSWERED_WITHIN,
                answer=key.TASK,
                again=RESEND_PERIOD,
                enters=WAITS,
                leads_to=(doing,),
            ),
        )

    # -- set-points

    def aim(self, aim: Point | Moving | Manual) -> None:
        """Stream it from now on."""
        self.hearing.asked = SDK
        self.stream.aim(aim)
        self.carrier.stir()

    def to_point(
        self,
        ask: str,
        point: Callable[[], Point | None],
        done: Callable[[Telemetry], bool],
        within: Ns,
    ) -> Sequence[Step]:
        """Streamed until *done*; then it hovers by itself."""

        def send() -> None:
            aim = point()
            if aim is not None:
                self.aim(aim)

        step = Step(ask=ask, send=send, done=done, within=within, enters=SDK, leads_to=(WAITS,), armed=True)
        return (*self.free(), self.authority(), step, self.hover())

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
            done=lambda seen: self.carrier.quiet,
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

    def __init__(self, pieces: DjiSteps) -> None:
        self._pieces = pieces
        self._carrier = pieces.carrier
        self._seen = pieces.telemetry

    def arm(self) -> Sequence[Step]:
        """Start the motors."""
        step = Step(
            ask="start the motors",
            send=lambda: self._carrier.motors(True),
            done=lambda seen: seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=key.MOTORS,
            again=RESEND_PERIOD,
            leads_to=STARTS,
        )
        return (self._pieces.activated(), self._pieces.authority(), step)

    def disarm(self, force: bool) -> Sequence[Step]:
        """Stop the motors. In the air the aircraft would fall: that takes *force*."""
        if self._seen.flying and not force:
            said = "it flies, and would fall; land() first, or force it"
            raise Refused(self._pieces.name, "disarm", said)
        step = Step(
            ask="stop the motors",
            send=lambda: self._carrier.motors(False, force=force),
            done=lambda seen: not seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=key.MOTORS,
            again=RESEND_PERIOD,
        )
        alone = force and self._carrier.names.kills_without_authority
        return (self._pieces.authority(), step) if self._seen.armed and not alone else (step,)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Task 4, which starts the motors and goes to its own height; then to *height* by set-points."""
        pieces = self._pieces
        pieces.check_height(height, f"take off to {height:g} m")
        lift = Step(
            ask="take off",
            send=lambda: self._carrier.task(TAKE_OFF, DisplayMode.AUTO_TAKEOFF),
            done=self._off_the_ground,
            within=UP_WITHIN,
            answer=key.TASK,
            again=RESEND_PERIOD,
            enters=DisplayMode.AUTO_TAKEOFF.name,
            leads_to=STARTS,
            armed=True,
        )
        climb = pieces.to_point(
            f"climb to {height:g} m", lambda: pieces.over_here(height), climbed_to(height), within
        )
        return (*pieces.ready(), pieces.authority(), lift, *climb)

    def _off_the_ground(self, seen: Telemetry) -> bool:
        if self._carrier.is_m100 and not seen.above_home >= M100_GAINS_M:
            return False
        return seen.flying and seen.mode not in {mode.name for mode in TAKES_OFF}

    def return_home(self, within: Ns) -> Sequence[Step]:
        """Task 1: it climbs, goes home and lands; near home it lands at once."""
        return self._until_down(GO_HOME, DisplayMode.NAVI_GO_HOME, "return home and land", within)

    def land(self, within: Ns) -> Sequence[Step]:
        """Task 6, until the motors have stopped."""
        return self._until_down(LAND, DisplayMode.AUTO_LANDING, "land", within)

    def _until_down(self, task: int, mode: DisplayMode, ask: str, within: Ns) -> Sequence[Step]:
        if not self._seen.armed:
            return ()
        if not self._seen.flying:
            return self.disarm(force=False)
        begin = Step(
            ask=ask,
            send=lambda: self._carrier.task(task, mode),
            done=lambda seen: seen.mode == mode.name or not seen.armed,
            within=ANSWERED_WITHIN,
            answer=key.TASK,
            again=RESEND_PERIOD,
            enters=mode.name,
            leads_to=(WAITS, SDK),
        )
        return (self._pieces.quiet(), begin, disarmed_step(ask, mode.name, within))
