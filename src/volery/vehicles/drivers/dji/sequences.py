"""Steps of the DJI driver: readiness, authority, set-points, motors and tasks.

A task (take-off, landing, going home) is what a DJI aircraft does by itself after one request.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from volery.base.errors import OutOfBounds, PositionLost, Refused
from volery.base.frames import LocalFrame
from volery.base.time import Ns, S
from volery.ros.messages.dji_constants import SETPOINT_HEIGHTS, DisplayMode
from volery.vehicles.driver import Step
from volery.vehicles.drivers.dji.backend import DjiBackend, SdkAck
from volery.vehicles.drivers.dji.decoder import DESCENDING_MODES, TAKES_OFF
from volery.vehicles.drivers.dji.node_interfaces import GO_HOME, LAND, TAKE_OFF
from volery.vehicles.drivers.dji.setpoints import SdkPoint, Target, yaw_of
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
"""Modes that the aircraft enters while the motors start."""
TAKE_OFF_MODES = frozenset(mode.name for mode in TAKES_OFF)
LANDING_MODES = frozenset(mode.name for mode in DESCENDING_MODES)


ON_THE_WAY = (
    "towards a position a DJI aircraft is slow (an M600 at most 3 m/s); without GPS (gps_health below 4), "
    "into a no-fly zone, and beyond 30 m height or 50 m from home without a transmitter since power-on, it "
    "does not obey"
)
WAITS_LOW = (
    "aircraft with downward vision may wait at about 0.7 m where the ground looks unsuitable: the pilot "
    "holds the throttle down"
)
ONLY_THE_PILOT = "only the pilot can, with the mode switch or the sticks"


class DjiSteps:
    """Common steps for one aircraft."""

    def __init__(self, name: str, backend: DjiBackend) -> None:
        self.name = name
        self.backend = backend
        self.telemetry = backend.telemetry
        self.decoder = backend.decoder
        self.stream = backend.stream

    def accepted(self, which: str) -> bool:
        """Return whether the last answer under *which* was positive."""
        answer = self.telemetry.answers.get(which)
        return answer is not None and answer.accepted

    # -- readiness

    def activated(self) -> Step:
        """Return a step that activates the SDK with the node's own parameters."""
        return Step(
            ask="activate",
            send=self.backend.activate,
            done=lambda seen: self.decoder.activated,
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=SdkAck.ACTIVATION,
            again=RESEND_PERIOD,
            advice="the node activates with app_id and enc_key among its parameters",
        )

    def ready(self, within: Ns = READY_WITHIN) -> Sequence[Step]:
        """Return steps that activate, wait for a healthy position, and set the local reference."""
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
            send=lambda: self.backend.request(SdkAck.REFERENCE, self.backend.interface.reference()),
            done=lambda seen: seen.armed or self.accepted(SdkAck.REFERENCE),
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=SdkAck.REFERENCE,
            again=RESEND_PERIOD,
        )
        activate = self.activated()
        return (replace(activate, within=min(within, activate.within)), wait, refer)

    def authority(self) -> Step:
        """Return a step that obtains the control authority, which everything but tasks needs."""
        return Step(
            ask="give the program the authority",
            send=self.backend.authority,
            done=lambda seen: self.decoder.authority,
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=SdkAck.AUTHORITY,
            again=RESEND_PERIOD,
            advice="the pilot's mode switch must be at P (A3, N3, M210), or at F (M100)",
        )

    def leave_descent(self, asked: str) -> Sequence[Step]:
        """Return a step that leaves a commanded landing or return, for which set-points are no means.

        Args:
            asked: the command in words.

        Raises:
            Refused: the node has no request for it, or answers none until the landing is finished.
        """
        doing = self.decoder.commanded
        if doing not in LANDING_MODES or not self.telemetry.flying or self.telemetry.mode != doing:
            return ()
        goes = self.decoder.displayed == DisplayMode.NAVI_GO_HOME
        ask = self.backend.interface.interrupt(GO_HOME if goes else LAND)
        if ask is None or self.backend.is_busy:
            node = (
                "dji_sdk 3.8 has no request that ends it"
                if ask is None
                else ("the node of 4.1 answers nothing until it is finished")
            )
            raise Refused(self.name, asked, f"it is in {doing}; {node}: {ONLY_THE_PILOT}")
        return (
            Step(
                ask=f"leave {doing}",
                send=lambda: self.backend.request(SdkAck.TASK, ask),
                done=lambda seen: seen.mode in {WAITS, SDK},
                within=ANSWERED_WITHIN,
                answer=SdkAck.TASK,
                again=RESEND_PERIOD,
                enters=WAITS,
                leads_to=(doing,),
            ),
        )

    # -- set-points

    def follow(self, target: Target) -> None:
        """Stream set-points for *target* from now on."""
        self.decoder.commanded = SDK
        self.stream.follow(target)
        self.backend.wake()

    def to_point(
        self,
        ask: str,
        point: Callable[[], SdkPoint | None],
        done: Callable[[Telemetry], bool],
        within: Ns,
    ) -> Sequence[Step]:
        """Return steps that stream set-points to a point until *done*; then the aircraft hovers by itself.

        Args:
            ask: the command in words.
            point: returns the point; called when the step begins.
            done: whether telemetry shows the effect; a place that is not to be trusted shows none.
            within: time-out, ns.
        """

        def send() -> None:
            target = point()
            if target is not None:
                self.follow(target)

        step = Step(
            ask=ask,
            send=send,
            done=lambda seen: self.decoder.located and done(seen),
            within=within,
            enters=SDK,
            leads_to=(WAITS,),
            armed=True,
            advice=ON_THE_WAY,
        )
        return (*self.leave_descent(ask), self.authority(), step, self.hover())

    def over_here(self, height: float) -> SdkPoint | None:
        """Return the present place at *height* metres above home; ``None`` without a position."""
        here = self.telemetry.position
        if here is None:
            return None
        return SdkPoint(LocalFrame(here.latitude, here.longitude), height, yaw_of(self.telemetry))

    def check_height(self, height: float, asked: str) -> None:
        """Raise ``OutOfBounds`` for a height (m above home) outside the range of set-points."""
        low, high = SETPOINT_HEIGHTS
        if not low <= height <= high:
            what = f"{height:.1f} m above home; set-points of DJI aircraft go from {low:g} to {high:g} m"
            raise OutOfBounds(self.name, asked, what)

    def hover(self) -> Step:
        """Return a step that stops the set-points."""
        return immediate_step("hover", self.stream.stop)

    def quiet(self) -> Step:
        """Return a step that waits until no set-point is on its way, which would end the next task."""
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
"""Time-out of the take-off task: motors within 5 s, lift-off within 20 s, then the climb."""
M100_GAINS_M = 0.8
"""Height above home at which an M100 counts as off the ground.

The SDK's demo uses 1 m; for a take-off to about 1.2 m that leaves little margin for the drift of the height.
"""


class DjiTasks:
    """Steps for motors and tasks. Tasks need no authority; the motors do."""

    def __init__(self, steps: DjiSteps) -> None:
        self._steps = steps
        self._backend = steps.backend
        self._telemetry = steps.telemetry

    def arm(self) -> Sequence[Step]:
        """Return steps that start the motors."""
        step = Step(
            ask="start the motors",
            send=lambda: self._backend.motors(True),
            done=lambda seen: seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=SdkAck.MOTORS,
            again=RESEND_PERIOD,
            leads_to=STARTS,
        )
        return (self._steps.activated(), self._steps.authority(), step)

    def disarm(self, force: bool) -> Sequence[Step]:
        """Return steps that stop the motors; in the air only with *force*."""
        if self._telemetry.flying and not force:
            said = "it flies, and would fall; land() first, or force it"
            raise Refused(self._steps.name, "disarm", said)
        step = Step(
            ask="stop the motors",
            send=lambda: self._backend.motors(False, force=force),
            done=lambda seen: not seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=SdkAck.MOTORS,
            again=RESEND_PERIOD,
            advice=f"while it takes off or lands the node of 4.1 answers nothing: {ONLY_THE_PILOT}"
            if self._backend.interface.blocks
            else f"dji_sdk 3.8 stops the motors on the ground only: {ONLY_THE_PILOT}",
        )
        interface = self._backend.interface
        alone = force and interface.kills_without_authority
        return (self._steps.authority(), step) if self._telemetry.armed and not alone else (step,)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Return steps for task 4, which climbs to a fixed height, and then to *height* by set-points."""
        steps = self._steps
        steps.check_height(height, f"take off to {height:g} m")
        standing: Sequence[Step] = ()
        if self._telemetry.armed and not self._telemetry.flying:
            standing = self.disarm(force=False)  # task 4 works only while the motors stand
        lift = Step(
            ask="take off",
            send=lambda: self._backend.task(TAKE_OFF, DisplayMode.AUTO_TAKEOFF),
            done=self._off_the_ground,
            within=UP_WITHIN,
            answer=SdkAck.TASK,
            again=RESEND_PERIOD,
            enters=DisplayMode.AUTO_TAKEOFF.name,
            leads_to=STARTS,
            armed=True,
        )
        climb = steps.to_point(
            f"climb to {height:g} m", lambda: steps.over_here(height), climbed_to(height), within
        )
        return (*standing, *steps.ready(), steps.authority(), lift, *climb)

    def _off_the_ground(self, seen: Telemetry) -> bool:
        if self._backend.is_m100 and not seen.above_home >= M100_GAINS_M:
            return False
        return seen.flying and seen.mode not in TAKE_OFF_MODES

    def return_home(self, within: Ns) -> Sequence[Step]:
        """Return steps for task 1: climb, go home and land; near home it lands at once.

        Without satellites the aircraft lands where it has drifted to, in the same mode.
        """
        steps = self._until_down(GO_HOME, DisplayMode.NAVI_GO_HOME, "return home and land", within)
        return (*steps, immediate_step("land at home", self._check_located)) if steps else ()

    def _check_located(self) -> None:
        """Raise ``PositionLost`` if it landed without a position."""
        seen = self._telemetry
        if not seen.located:
            what = f"it has landed without a position (its GPS reports {seen.fix}), perhaps far from home"
            raise PositionLost(seen.name, "return home", what)

    def land(self, within: Ns) -> Sequence[Step]:
        """Return steps for task 6; done when the motors have stopped."""
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
            answer=SdkAck.TASK,
            again=RESEND_PERIOD,
            enters=mode.name,
            leads_to=(WAITS, SDK),
        )
        end = replace(disarmed_step(ask, mode.name, within), advice=WAITS_LOW)
        return (self._steps.quiet(), begin, end)
