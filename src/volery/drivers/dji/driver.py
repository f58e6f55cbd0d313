"""A DJI aircraft's sequences: what it wants to be asked, and how one sees it done.

What shapes them: tasks (take-off, landing, going home) need no authority, everything else does; a take-off
goes to a fixed height of its own, the rest is climbed by set-points; a position is a stream of remaining
offsets; and the authority is the pilot's to take at any time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import radians

from volery.base.errors import CapabilityError, LinkError, OutOfBounds, Refused
from volery.base.frames import heading_to_yaw
from volery.base.position import Position
from volery.base.time import Ns, S
from volery.drivers.arrival import NEAR_UP_M, STANDING_M_S, at, standing
from volery.drivers.dji import carrier as key
from volery.drivers.dji.carrier import Carrier
from volery.drivers.dji.hearing import COMES_DOWN, TAKES_OFF
from volery.drivers.dji.missions import Plan, above_home, plan_of
from volery.drivers.dji.names import GO_HOME, LAND, START_MISSION, TAKE_OFF
from volery.drivers.dji.stream import STILL, ByHand, Moving, Point, yaw_of
from volery.drivers.steps import (
    ANSWERED_WITHIN,
    ARMED_WITHIN,
    READY_WITHIN,
    STOPPED_WITHIN,
    TURNED_WITHIN,
    at_once,
    check_not_idle,
    heads,
    nothing,
)
from volery.kernel.api import Action, Kernel
from volery.messages.dji import SETPOINT_HEIGHTS, DisplayMode
from volery.vehicles.driver import Capability, Step, Sticks
from volery.vehicles.mission import MissionItem
from volery.vehicles.telemetry import Telemetry, Velocity

UP_WITHIN: Ns = 35 * S
"""Of the take-off itself: motors within 5 s, off the ground within 20 s, then to the fixed height."""
ASK_AGAIN: Ns = 2 * S
M100_GAINS_M = 0.8
"""An M100 counts as off the ground once it is so much above home. The SDK's demo asks for 1 m; of a take-off
to about 1.2 m that leaves little for the drift of a height.
"""
LOW_THROTTLE = 0.3
"""Below it, in the air, thrust by the sticks would let it fall."""

SDK, WAITS, TAKING_OFF = (
    DisplayMode.NAVI_SDK_CTRL.name,
    DisplayMode.P_GPS.name,
    DisplayMode.AUTO_TAKEOFF.name,
)
STARTS = (DisplayMode.ENGINE_START.name, DisplayMode.ATTITUDE.name, WAITS, SDK)
"""Modes that the start of the motors leads through."""

CAN = frozenset(Capability) - {Capability.TERRAIN}
_NOTHING: frozenset[Capability] = frozenset()


class Dji:
    """The driver. See ``vehicles.driver.Driver`` for what the methods mean."""

    comes_down = frozenset(mode.name for mode in COMES_DOWN)
    cycle: Action | None = None

    def __init__(self, kernel: Kernel, name: str, carrier: Carrier) -> None:
        self.name = name
        self.telemetry = carrier.telemetry
        self._kernel = kernel
        self._carrier = carrier
        self._stream = carrier.stream
        self._hearing = carrier.hearing
        self._plan: Plan | None = None

    @property
    def handover(self) -> str:
        """It hovers and takes commands: by position, or without one in ATTITUDE. In ``NAVI_SDK_CTRL``, which
        no pilot can choose, it obeys a computer already: another node of ours has had it.
        """
        seen = self.telemetry
        if seen.mode == SDK:
            return SDK
        return DisplayMode.ATTITUDE.name if seen.mode == DisplayMode.ATTITUDE.name else WAITS

    @property
    def capabilities(self) -> frozenset[Capability]:
        """All but terrain; none until it has been heard."""
        return CAN if self.telemetry.kind else _NOTHING

    def look(self) -> None:
        """What arrives is taken in by itself."""

    def problem(self) -> LinkError | CapabilityError | None:
        """What is wrong with the way to the aircraft."""
        return self._carrier.problem()

    def if_silent(self) -> str:
        """Assumed: the public definitions do not say, and no parameter of the aircraft can be read."""
        return (
            "it brakes and hovers where it is (assumed: within 0.5 s), until its battery is low or the pilot "
            "takes it; landing, going home and missions go on"
        )

    def close(self) -> None:
        """Stop talking."""
        self._carrier.close()

    # -- on the ground

    def ready(self, within: Ns) -> Sequence[Step]:
        """Activated, a position that may be trusted, and a local reference."""
        activate = Step(
            ask="activate",
            send=self._carrier.activate,
            done=lambda seen: self._hearing.activated,
            within=min(within, ANSWERED_WITHIN),
            skippable=True,
            answer=key.ACTIVATION,
            again=ASK_AGAIN,
            advice="the node activates with app_id and enc_key among its parameters",
        )
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
            send=self._refer,
            done=lambda seen: seen.armed or self._accepted(key.REFERENCE),
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=key.REFERENCE,
            again=ASK_AGAIN,
        )
        return (activate, wait, refer)

    def _refer(self) -> None:
        self._carrier.ask(key.REFERENCE, self._carrier.names.reference())

    def _accepted(self, which: str) -> bool:
        answer = self.telemetry.answers.get(which)
        return answer is not None and answer.accepted

    def _authority(self) -> Sequence[Step]:
        step = Step(
            ask="give the program the authority",
            send=self._carrier.authority,
            done=lambda seen: self._hearing.authority,
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=key.AUTHORITY,
            again=ASK_AGAIN,
            advice="the pilot's mode switch must be at F (P on aircraft that have no F)",
        )
        return (step,)

    def arm(self) -> Sequence[Step]:
        """Start the motors."""
        step = Step(
            ask="start the motors",
            send=lambda: self._carrier.motors(True),
            done=lambda seen: seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=key.MOTORS,
            again=ASK_AGAIN,
            leads_to=STARTS,
        )
        return (*self._activated(), *self._authority(), step)

    def _activated(self) -> Sequence[Step]:
        return self.ready(READY_WITHIN)[:1]

    def disarm(self, force: bool) -> Sequence[Step]:
        """Stop the motors. In the air the aircraft would fall: that takes *force*."""
        if self.telemetry.flying and not force:
            raise Refused(self.name, "disarm", "it flies, and would fall; land() first, or force it")
        step = Step(
            ask="stop the motors",
            send=lambda: self._carrier.motors(False, force=force),
            done=lambda seen: not seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=key.MOTORS,
            again=ASK_AGAIN,
        )
        alone = force and self._carrier.names.kills_without_authority
        return (*(self._authority() if self.telemetry.armed and not alone else ()), step)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Task 4, which starts the motors and goes to its own height; then to *height* by set-points."""
        self._check_height(height, f"take off to {height:g} m")

        def off(seen: Telemetry) -> bool:
            if self._carrier.is_m100 and not seen.above_home >= M100_GAINS_M:
                return False
            return seen.flying and seen.mode not in {mode.name for mode in TAKES_OFF}

        def up(seen: Telemetry) -> bool:
            near = abs(seen.above_home - height) <= NEAR_UP_M
            return seen.flying and near and abs(seen.velocity.up) <= STANDING_M_S

        lift = Step(
            ask="take off",
            send=lambda: self._carrier.task(TAKE_OFF, DisplayMode.AUTO_TAKEOFF),
            done=off,
            within=UP_WITHIN,
            answer=key.TASK,
            again=ASK_AGAIN,
            enters=TAKING_OFF,
            leads_to=STARTS,
            armed=True,
        )
        climb = self._to_point(f"climb to {height:g} m", lambda: self._over_here(height), up, within)
        return (*self.ready(READY_WITHIN), *self._authority(), lift, *climb)

    # -- by set-points

    def _check_height(self, height: float, asked: str) -> None:
        low, high = SETPOINT_HEIGHTS
        if not low <= height <= high:
            what = f"{height:.1f} m above home; set-points of DJI aircraft go from {low:g} to {high:g} m"
            raise OutOfBounds(self.name, asked, what)

    def _over_here(self, height: float) -> Point | None:
        here = self.telemetry.position
        return None if here is None else Point(here.latitude, here.longitude, height, yaw_of(self.telemetry))

    def _to_point(
        self,
        ask: str,
        point: Callable[[], Point | None],
        done: Callable[[Telemetry], bool],
        within: Ns,
    ) -> Sequence[Step]:
        def send() -> None:
            aim = point()
            if aim is not None:
                self._aim(aim)

        step = Step(
            ask=ask,
            send=send,
            done=done,
            within=within,
            enters=SDK,
            leads_to=(WAITS,),
            armed=True,
        )
        return (*self._free(), *self._authority(), step, at_once("hover", self._stream.stop))

    def _aim(self, aim: Point | Moving | ByHand) -> None:
        self._hearing.asked = SDK
        self._stream.aim(aim)
        self._carrier.stir()

    def _free(self) -> Sequence[Step]:
        """Out of a landing or a way home that was asked for before, where that takes a task."""
        doing = self._hearing.asked
        task = GO_HOME if doing == DisplayMode.NAVI_GO_HOME.name else LAND
        ask = self._carrier.names.interrupt(task) if doing in self.comes_down else None
        if ask is None or not self.telemetry.flying or self.telemetry.mode != doing:
            return ()
        return (
            Step(
                ask=f"leave {doing}",
                send=lambda: self._carrier.ask(key.TASK, ask),
                done=lambda seen: seen.mode in {WAITS, SDK},
                within=ANSWERED_WITHIN,
                answer=key.TASK,
                again=ASK_AGAIN,
                enters=WAITS,
                leads_to=(doing,),
            ),
        )

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        """Remaining offsets, streamed; the height counts from the point of take-off."""
        home = self.telemetry.home
        if home is None:
            raise Refused(self.name, f"go to {goal}", "it is not known where it took off")
        height = above_home(goal, home)
        self._check_height(height, f"go to {goal}")

        def there() -> Point:
            return Point(goal.latitude, goal.longitude, height, yaw_of(self.telemetry), speed)

        return self._to_point(f"reach {goal}", there, at(goal, False), within)

    def hold(self) -> Sequence[Step]:
        """Zero velocity until it stands; then it hovers by itself. Without a position it cannot."""
        if self.telemetry.flying and not self.telemetry.ready:
            raise Refused(self.name, "hold", f"it has no position ({self.telemetry.fix}) and drifts; land()")
        brake = Step(
            ask="stop",
            send=lambda: self._follow(STILL, 0.0, STOPPED_WITHIN),
            done=lambda seen: standing(seen) and not self._stream.fresh,
            within=STOPPED_WITHIN,
            enters=SDK,
            leads_to=(WAITS,),
            armed=True,
        )
        return (*self._free(), *self._authority(), brake, at_once("hover", self._stream.stop))

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """Streamed for as long as it lasts; then it stops."""
        follow = at_once("fly on", lambda: self._follow(velocity, yaw_rate, lasting), enters=SDK)
        return (*self._free(), *self._authority(), follow)

    def _follow(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> None:
        self._aim(Moving(velocity, -radians(yaw_rate), self._kernel.now() + lasting))

    def heading(self, degrees: float) -> Sequence[Step]:
        """In place."""

        def turn() -> Point | None:
            here = self._over_here(self.telemetry.above_home)
            return here._replace(yaw=heading_to_yaw(radians(degrees))) if here is not None else None

        return self._to_point(f"turn to {degrees:g} degrees", turn, heads(degrees), TURNED_WITHIN)

    # -- tasks

    def return_home(self, within: Ns) -> Sequence[Step]:
        """Task 1: it climbs, goes home and lands; near home it lands at once."""
        return self._until_down(GO_HOME, DisplayMode.NAVI_GO_HOME, "return home and land", within)

    def land(self, within: Ns) -> Sequence[Step]:
        """Task 6, until the motors have stopped."""
        return self._until_down(LAND, DisplayMode.AUTO_LANDING, "land", within)

    def _until_down(self, task: int, mode: DisplayMode, ask: str, within: Ns) -> Sequence[Step]:
        if not self.telemetry.armed:
            return ()
        if not self.telemetry.flying:
            return self.disarm(force=False)
        begin = Step(
            ask=ask,
            send=lambda: self._carrier.task(task, mode),
            done=lambda seen: seen.mode == mode.name or not seen.armed,
            within=ANSWERED_WITHIN,
            answer=key.TASK,
            again=ASK_AGAIN,
            enters=mode.name,
            leads_to=(WAITS, SDK),
        )
        down = Step(ask=ask, send=nothing, done=lambda seen: not seen.armed, within=within, mode=mode.name)
        return (self._quiet(), begin, down)

    def _quiet(self) -> Step:
        """A set-point still on its way would end what is asked for next. Who takes it meanwhile has it."""
        return Step(
            ask="send no more set-points",
            send=self._stream.stop,
            done=lambda seen: self._carrier.quiet,
            within=ANSWERED_WITHIN,
            skippable=True,
            mode=self.telemetry.mode,
            leads_to=(WAITS, SDK),
        )

    # -- by sticks

    def stabilize(self) -> Sequence[Step]:
        """Lean angles, turn rate and thrust."""
        check_not_idle(self.telemetry, self._stream.held or Sticks(), LOW_THROTTLE)
        return self._by_hand("fly stabilized", ByHand(keeps_height=False))

    def altitude_hold(self) -> Sequence[Step]:
        """Lean angles, turn rate and climb rate."""
        return self._by_hand("hold the altitude", ByHand(keeps_height=True))

    def _by_hand(self, ask: str, aim: ByHand) -> Sequence[Step]:
        def send() -> None:
            if self._stream.held is None:
                self._stream.held = Sticks() if self.telemetry.flying else Sticks(throttle=0.0)
            self._aim(aim)

        step = Step(
            ask=ask,
            send=send,
            done=lambda seen: not seen.armed or seen.mode == SDK,
            within=ANSWERED_WITHIN,
            enters=SDK,
            leads_to=STARTS,
        )
        return (*self._activated(), *self._free(), *self._authority(), step)

    def manual(self) -> Sequence[Step]:
        """There are no DJI rovers."""
        raise CapabilityError(f"{self.name} is a drone; manual control of wheels is for rovers")

    def sticks(self, sticks: Sticks | None) -> None:
        """They are sent while it is flown by them."""
        if sticks is None:
            if self._stream.by_hand:
                self._stream.stop()
            self._stream.held = None
            return
        self._stream.held = sticks
        if self._stream.by_hand:
            self._stream.fresh = True
            self._carrier.stir()

    def stop(self) -> None:
        """Nothing is sent any more: it brakes and hovers."""
        self._stream.stop()

    # -- missions

    def upload(self, mission: Sequence[MissionItem]) -> Sequence[Step]:
        """As waypoints above the point of take-off."""
        seen = self.telemetry
        home, here = seen.home, seen.position
        if home is None or here is None:
            raise Refused(
                self.name, "upload a mission", "it does not know where it is yet; wait_ready() first"
            )
        plan = plan_of(self.name, self._carrier.names.package, mission, home, here)

        def keep() -> None:
            self._plan = plan

        step = Step(
            ask=f"take a mission of {len(plan.task.mission_waypoint)} waypoints",
            send=lambda: self._carrier.ask(key.MISSION, self._carrier.names.mission(plan.task), keep),
            done=lambda seen: self._accepted(key.MISSION),
            within=30 * S + len(plan.task.mission_waypoint) * 2 * S,
            answer=key.MISSION,
            again=5 * S,
        )
        return (*self._activated(), step)

    def start_mission(self, within: Ns) -> Sequence[Step]:
        """Take off, start it; to its end: down, or standing at the last point."""
        plan = self._plan
        if plan is None:
            raise Refused(self.name, "start the mission", "none was uploaded by this program")
        lift: Sequence[Step] = ()
        if not self.telemetry.flying:
            if plan.takeoff is None:
                raise Refused(
                    self.name, "start the mission", "it is on the ground, and no TakeOff comes first"
                )
            lift = self.takeoff(plan.takeoff, within)
        begin = Step(
            ask="start the mission",
            send=self._begin_mission,
            done=lambda seen: self._accepted(key.START),
            within=ANSWERED_WITHIN,
            answer=key.START,
            again=ASK_AGAIN,
            enters=DisplayMode.NAVI_MISSION.name,
            leads_to=(WAITS, SDK),
            armed=True,
        )
        return (*lift, *self._authority(), self._quiet(), begin, self._mission_over(plan, within))

    def _begin_mission(self) -> None:
        self._stream.stop()
        self._hearing.asked = DisplayMode.NAVI_MISSION.name
        self._carrier.ask(key.START, self._carrier.names.mission_action(START_MISSION))

    def _mission_over(self, plan: Plan, within: Ns) -> Step:
        """Without an end in the air it is over when it is down."""
        flying = DisplayMode.NAVI_MISSION.name
        end = plan.end

        def over(seen: Telemetry) -> bool:
            if not seen.armed:
                return True
            return end is not None and at(end, False)(seen) and (seen.mode != flying or self._carrier.is_m100)

        return Step(
            ask="finish the mission",
            send=nothing,
            done=over,
            within=within,
            mode=flying,
            leads_to=(WAITS, *sorted(self.comes_down)),
        )
