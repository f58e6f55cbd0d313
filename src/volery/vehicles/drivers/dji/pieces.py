"""Pieces that sequences of steps are made of: readiness, authority, set-points, and their end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from volery.base.errors import OutOfBounds
from volery.base.time import Ns, S
from volery.ros.messages.dji import SETPOINT_HEIGHTS, DisplayMode
from volery.vehicles.driver import Step
from volery.vehicles.drivers.dji import carrier as key
from volery.vehicles.drivers.dji.carrier import Carrier
from volery.vehicles.drivers.dji.hearing import COMES_DOWN
from volery.vehicles.drivers.dji.names import GO_HOME, LAND
from volery.vehicles.drivers.dji.stream import ByHand, Moving, Point, yaw_of
from volery.vehicles.drivers.steps import ANSWERED_WITHIN, READY_WITHIN, at_once, nothing
from volery.vehicles.telemetry import Telemetry

ASK_AGAIN: Ns = 2 * S

SDK, WAITS = DisplayMode.NAVI_SDK_CTRL.name, DisplayMode.P_GPS.name
STARTS = (DisplayMode.ENGINE_START.name, DisplayMode.ATTITUDE.name, WAITS, SDK)
"""Modes that the start of the motors leads through."""
DESCENDS = frozenset(mode.name for mode in COMES_DOWN)


class Pieces:
    """What it takes to have one aircraft do something."""

    def __init__(self, name: str, carrier: Carrier) -> None:
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
            again=ASK_AGAIN,
            advice="the node activates with app_id and enc_key among its parameters",
        )

    def ready(self, within: Ns = READY_WITHIN) -> Sequence[Step]:
        """Activated, a position that may be trusted, and a local reference."""
        wait = Step(
            ask="be ready to go by position",
            send=nothing,
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
            again=ASK_AGAIN,
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
            again=ASK_AGAIN,
            advice="the pilot's mode switch must be at F (P on aircraft that have no F)",
        )

    def free(self) -> Sequence[Step]:
        """Out of a landing or a way home that was asked for before, where that takes a task."""
        doing = self.hearing.asked
        task = GO_HOME if doing == DisplayMode.NAVI_GO_HOME.name else LAND
        ask = self.carrier.names.interrupt(task) if doing in DESCENDS else None
        if ask is None or not self.telemetry.flying or self.telemetry.mode != doing:
            return ()
        return (
            Step(
                ask=f"leave {doing}",
                send=lambda: self.carrier.ask(key.TASK, ask),
                done=lambda seen: seen.mode in {WAITS, SDK},
                within=ANSWERED_WITHIN,
                answer=key.TASK,
                again=ASK_AGAIN,
                enters=WAITS,
                leads_to=(doing,),
            ),
        )

    # -- set-points

    def aim(self, aim: Point | Moving | ByHand) -> None:
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
        return at_once("hover", self.stream.stop)

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
