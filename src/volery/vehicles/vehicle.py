"""What an operation is measured against at its end.

Kinds of operations: who may ask for them when, and what is looked after meanwhile.

A vehicle as something that is heard: whether it is there, of the right kind, and able.

How an operation is carried out, the same for drones and rovers: one at a time, only while nobody else has
the vehicle, within bounds, and recorded.

What ends an operation and what is then done with the vehicle:

| what | the caller sees | the vehicle |
|---|---|---|
| it strays out of limits or fence | ``OutOfBounds`` | holds where it has stopped |
| the battery falls below the reserve | ``LowBattery`` | holds where it has stopped |
| somebody else changes its mode or target | ``Overridden``, ``Failsafe`` | is theirs; nothing is sent to it |
| another task of this program asks for hold, return home, land or kill | ``Overridden`` | does that |
| the link falls silent | ``LinkLost`` | does what its parameters say: ``if_silent`` |

A vehicle that nobody else has is held; one that has not left the ground is landed, that is disarmed.

What drones and rovers share: state, readiness, missions, and the ways to safety.

Every call is an interaction point. One that waits blocks until what was asked is *seen* on the telemetry, has
a time-out, and raises an error that names the vehicle, what was asked, what the autopilot said, what to do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import hypot, isfinite, nan
from typing import NamedTuple

from volery.base.errors import (
    CapabilityError,
    LinkLost,
    LinkSilent,
    LowBattery,
    OutOfBounds,
    Refused,
    UsageError,
    VehicleError,
    VoleryError,
)
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.base.time import MINUTE, MS, Ns, S, from_seconds, to_seconds
from volery.kernel.api import Handle, Kernel
from volery.kernel.task import ExecutionContext, Task
from volery.trace.events import Operation, Text
from volery.vehicles.driver import Capability, Driver, ManualControl, Step
from volery.vehicles.executor import LINK_TIMEOUT, StepExecutor
from volery.vehicles.limits import (
    FLOOR,
    Bounds,
    BoundsMonitor,
    Fence,
    HomeFrame,
    Limits,
    home_violation,
    low_battery,
    path_violation,
)
from volery.vehicles.mission import ChangeSpeed, Land, MissionItem, ReturnHome, TakeOff, Waypoint
from volery.vehicles.telemetry import Attitude, Battery, StatusText, Telemetry, Velocity


class Goal(NamedTuple):
    """What an operation is measured against at its end. NaN: not this coordinate."""

    latitude: float
    longitude: float
    amsl: float


NO_GOAL = Goal(nan, nan, nan)


def goal_offset(position: Position | None, goal: Goal) -> tuple[float, float]:
    """How far *position* (AMSL) is from *goal*: horizontally and vertically, metres; NaN where unknown."""
    if position is None:
        return nan, nan
    vertical = abs(position.altitude.metres - goal.amsl)
    if goal.latitude != goal.latitude:
        return nan, vertical
    height = position.altitude.metres
    east, north, _ = LocalFrame(goal.latitude, goal.longitude, height).to_enu(
        position.latitude, position.longitude, height
    )
    return hypot(east, north), vertical


@dataclass(frozen=True, kw_only=True)
class OperationPolicy:
    """What kind of operation it is.

    ``ours``: refused while somebody else has the vehicle. ``noted`` False: recorded only if it fails; a loop
    of set-points is no list of operations. ``bounded``: watched for bounds; ``goes_on``: still so after it
    has returned, until the next one. ``travels``: not below the battery's reserve. ``by_hand``: sticks keep
    what they are. ``safe``: brings it to safety, so it takes the place of what another task has under way.
    ``excused`` are bounds that do not count.
    """

    ours: bool = True
    noted: bool = True
    bounded: bool = False
    goes_on: bool = False
    travels: bool = False
    by_hand: bool = False
    safe: bool = False
    excused: frozenset[str] = frozenset()


PLAIN = OperationPolicy(by_hand=True)
UNGUARDED = OperationPolicy(by_hand=True, ours=False)
TURN = OperationPolicy(bounded=True)
TRAVEL = OperationPolicy(bounded=True, travels=True)
FLY_MISSION = OperationPolicy(bounded=True, travels=True, excused=frozenset({FLOOR}))
STREAM = OperationPolicy(bounded=True, travels=True, goes_on=True, noted=False)
MANUAL = OperationPolicy(bounded=True, goes_on=True, by_hand=True)
TO_SAFETY = OperationPolicy(safe=True)
LAST_RESORT = OperationPolicy(safe=True, ours=False)


FIRST_MESSAGE_WITHIN_S = 10.0
LINK_RETURN_S = 30.0
REFRESHED_WITHIN_S = 2.0
"""After a link has returned everything that counts has been said again within this time."""

ASK_PERIOD: Ns = 500 * MS
ASK_FOR: Ns = MINUTE
"""An autopilot that has not told its parameters by then will not."""

ON_LINK_LOSS = "if this program falls silent"
"""How the line begins that says what a vehicle then does."""


class Heard:
    """``Commanded`` adds what it is told to do."""

    kind = ""

    def __init__(self, kernel: Kernel, name: str, driver: Driver, silence: Ns) -> None:
        self.name = name
        self._kernel = kernel
        self._driver = driver
        self._performer = StepExecutor(kernel, driver, silence)
        self._asking: Handle | None = None

    @property
    def kernel(self) -> Kernel:
        """The clock that it lives on."""
        return self._kernel

    def _look(self) -> Telemetry:
        if self._driver.cycle is not None:
            self._driver.look()
        with self._kernel:
            return self._driver.telemetry

    def _known(self, what: str, value: Position | None) -> Position:
        if value is None:
            raise VehicleError(self.name, what, "the autopilot does not know it yet; wait_ready() first")
        return value

    def wait_heard(self, within: float = FIRST_MESSAGE_WITHIN_S) -> None:
        """Until the autopilot is heard. Raises ``LinkSilent`` or ``LinkGarbled``: what is there instead."""
        seen = self._driver.telemetry

        def well_heard() -> bool:
            return seen.heard >= 0 and self._driver.problem() is None

        if not self._performer.wait(well_heard, from_seconds(within)):
            with self._kernel:
                problem = self._driver.problem()
            if problem is not None:
                raise type(problem)(f"{self.name}: {problem}")
            raise LinkSilent(f"{self.name}: nothing was heard within {within:g} s")
        if not seen.kind:
            seen.kind = self.kind  # MAVROS does not say what it is
            self._look()  # what was heard may mean another thing now
        if seen.kind != self.kind:
            raise CapabilityError(f"{self.name} is a {seen.kind}, not a {self.kind}")
        self._tell_if_silent()

    def _tell_if_silent(self) -> None:
        """Record what it does if its commander falls silent, as soon as that is known. Nobody waits."""
        if self._asking is not None:
            return

        until = self._kernel.now() + ASK_FOR

        def ask() -> None:
            line = self._driver.if_silent()
            if line:
                self._kernel.record(Text(self._kernel.now(), self.name, 6, f"{ON_LINK_LOSS}: {line}"))
            if line or self._kernel.now() >= until:
                asking.cancel()

        with self._kernel.guard:
            self._asking = asking = self._kernel.every(ASK_PERIOD, ask)

    def _hear(self) -> None:
        """What comes before every operation: take in what has arrived, and wait if nothing ever has."""
        self._look()
        if self._driver.telemetry.heard < 0 or self._driver.telemetry.kind != self.kind:
            self.wait_heard()

    def _require(self, capability: Capability) -> None:
        self._hear()
        problem = self._driver.problem()
        if isinstance(problem, CapabilityError):
            raise CapabilityError(f"{self.name}: {problem}")
        if capability not in self._driver.capabilities:
            can = ", ".join(sorted(each.value for each in self._driver.capabilities))
            raise CapabilityError(f"{self.name} cannot {capability.value}; it can {can}")

    def _wait_for_link(self) -> None:
        """If it is lost at this moment, give it time to return, and then to say what it does meanwhile."""
        if not self._performer.silent():
            return
        if not self._performer.wait(lambda: not self._performer.silent(), from_seconds(LINK_RETURN_S)):
            raise LinkLost(f"{self.name}: the link did not return; nobody knows whether it has come to rest")
        self._performer.wait(lambda: False, from_seconds(REFRESHED_WITHIN_S))


Truth = Callable[[], Position]
"""Where a simulated vehicle really is (AMSL): for the errors that are recorded, never for the operations."""

MEASURED_WITHIN_S = 10.0
STICKS_FRESH: Ns = S
"""A stick sample that is older is none to begin flying by hand with."""

STRAY_PERIOD: Ns = 200 * MS


class Commanded(Heard):
    """A vehicle as something that is told what to do. ``Vehicle`` adds its state and its operations."""

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        driver: Driver,
        *,
        limits: Limits | None = None,
        fence: Fence | None = None,
        truth: Truth | None = None,
        silence: Ns = LINK_TIMEOUT,
    ) -> None:
        super().__init__(kernel, name, driver, silence)
        self.limits = limits or Limits()
        self.fence = fence
        self._truth = truth
        self._busy: tuple[Task | None, str] | None = None
        self._bounds: tuple[Bounds, Limits, Fence | None] | None = None
        self._straying: Handle | None = None  # looks after what goes on when a call has returned
        self._strayed: VehicleError | None = None  # for whoever commands it next
        self._sticks_at: Ns | None = None

    def _in_flight(self, asked: str) -> None:
        """It flies, and if it has strayed since the last call, that is told first."""
        self._tell_strayed()
        if not self._driver.telemetry.flying:
            raise Refused(self.name, asked, "it is on the ground; takeoff(height) first")

    # -- carrying out

    def _operate(
        self,
        operation: str,
        asked: str,
        plan: Callable[[], Sequence[Step]],
        *,
        manner: OperationPolicy = PLAIN,
        goal: Callable[[], Goal] = lambda: NO_GOAL,
        restarts: int = 0,
    ) -> None:
        """Perform it in that *manner* and record it."""
        with self._kernel as kernel:
            mine = self._take(kernel.current(), operation, manner)
            start = kernel.now()
        outcome, said = "ok", ""
        try:
            self._admit(asked, manner)
            self._go(asked, plan, manner, restarts)
        except BaseException as error:
            outcome, said = type(error).__name__, str(error)
            raise
        finally:
            with self._kernel.guard:
                if self._busy is mine:
                    self._busy = None
                if manner.noted or outcome != "ok":
                    self._record(start, operation, asked, (outcome, said), goal())

    def _take(self, task: Task | None, operation: str, manner: OperationPolicy) -> tuple[Task | None, str]:
        """One operation at a time: two tasks that command one vehicle is a fault of the program, unless one
        brings it to safety.
        """
        if self._busy is not None:
            holder, under_way = self._busy
            if holder is None or not (holder.done or holder.scope.cancelled):
                if not manner.safe:
                    name = holder.name if holder is not None else "house code"
                    raise UsageError(f"{self.name}: {operation}: {name} has {under_way} under way")
                by = f" by {task.name}" if task is not None else ""
                self._performer.give_way(f"{operation}(){by}")
        mine = self._busy = (task, operation)
        return mine

    def _admit(self, asked: str, manner: OperationPolicy) -> None:
        """Whether it may begin."""
        if manner.safe:
            self._strayed = None
        self._tell_strayed()
        if manner.ours:
            self._performer.check_ours(asked)
        if manner.travels:
            self._check_reserve(asked)

    def _go(
        self, asked: str, plan: Callable[[], Sequence[Step]], manner: OperationPolicy, restarts: int
    ) -> None:
        if not manner.by_hand:
            self._sticks_at = None
        if self._straying is not None:
            self._straying.cancel()
            self._straying = None
        if not manner.bounded:
            self._performer.perform(asked, plan, restarts=restarts)
            return
        watch = self._watch(manner)
        try:
            self._performer.perform(asked, plan, restarts=restarts, look=watch.look)
        except (OutOfBounds, LowBattery) as error:
            raise type(error)(self.name, asked, f"{error.what}; {self._hold_back()}") from None
        if manner.goes_on and self._driver.cycle is None:
            self._watch_on(asked, watch)

    def _record(self, start: Ns, operation: str, asked: str, end: tuple[str, str], goal: Goal) -> None:
        estimate = goal_offset(self._driver.telemetry.position, goal)
        truth = goal_offset(self._truth() if self._truth is not None else None, goal)
        self._kernel.record(
            Operation(start, self._kernel.now(), self.name, operation, asked, *end, *estimate, *truth)
        )

    # -- bounds and battery, while it travels

    def _bounds_now(self) -> Bounds | None:
        """About the home of now; ``None`` while there is none. Raises ``UsageError`` if the fence excludes
        it.
        """
        home = self._driver.telemetry.home
        if home is None:
            return None
        made = self._bounds
        if made is None or made[0].home != home or made[1] is not self.limits or made[2] is not self.fence:
            self._check_fence(home)
            made = self._bounds = Bounds(home, self.limits, self.fence), self.limits, self.fence
        return made[0]

    def _check_fence(self, home: Position) -> None:
        found = home_violation(self.fence, home) if self.fence is not None else ""
        if found:
            raise UsageError(f"{self.name}: the fence excludes home: {found}")

    def _watch(self, manner: OperationPolicy) -> BoundsMonitor:
        reserve = self.limits.battery_reserve if manner.travels else 0.0
        return BoundsMonitor(self._driver.telemetry, self._bounds_now(), reserve, manner.excused)

    def _check_reserve(self, asked: str) -> None:
        reserve, seen = self.limits.battery_reserve, self._driver.telemetry
        if reserve == 0.0:
            return
        if not isfinite(seen.battery.remaining) and not self._performer.wait(
            lambda: isfinite(seen.battery.remaining), from_seconds(MEASURED_WITHIN_S)
        ):
            raise CapabilityError(
                f"{self.name}: {asked}: its autopilot does not say how full the battery is, so a reserve of "
                f"{reserve:.0%} cannot be kept; set its battery monitor up, or state no reserve"
            )
        if seen.battery.remaining < reserve:
            raise low_battery(self.name, asked, seen.battery.remaining, reserve)

    def _hold_back(self) -> str:
        """Stop it if it is still ours; says what was done."""
        seen = self._driver.telemetry
        if not self._performer.is_ours():
            return f"it is left to whoever has it in {seen.mode}"
        stays = seen.flying or Capability.LAND not in self._driver.capabilities
        try:
            if stays:
                self._performer.perform("hold", self._driver.hold)
            elif seen.armed:
                self._performer.perform("land", lambda: self._driver.land(from_seconds(LINK_RETURN_S)))
        except VoleryError as error:
            return f"it could not be held: {error}"
        return "it holds there" if stays else "it is on the ground"

    def _watch_on(self, asked: str, watch: BoundsMonitor) -> None:
        """Look after what goes on when the call has returned: a velocity, sticks."""

        def look() -> None:
            error = watch.look(asked, self._kernel.now())
            if error is None or self._busy is not None:
                return
            handle.cancel()
            self._strayed = type(error)(self.name, asked, f"{error.what}; it was told to hold")
            name = f"safety of {self.name}"
            self._kernel.spawn(self._hold_strayed, name, ExecutionContext(name))

        with self._kernel.guard:
            self._straying = handle = self._kernel.every(STRAY_PERIOD, look)

    def _tell_strayed(self) -> None:
        strayed, self._strayed = self._strayed, None
        if strayed is not None:
            raise strayed

    def _hold_strayed(self) -> None:
        strayed = self._strayed
        with suppress(VoleryError):  # recorded; and told to whoever commands it next
            self._operate("hold", "hold: it has strayed", self._driver.hold, manner=TO_SAFETY)
        self._strayed = strayed

    # -- sticks

    def _move_sticks(self, sticks: ManualControl) -> None:
        with self._kernel as kernel:
            self._tell_strayed()
            self._performer.check_ours("manual control")
            self._sticks_at = kernel.now()
            self._driver.sticks(sticks)

    def _check_sticks(self, asked: str) -> None:
        """Sticks that nobody has touched for a while are no way to begin flying by hand."""
        at = self._sticks_at
        if at is not None and self._kernel.now() - at <= STICKS_FRESH:
            return
        last = (
            f"the last is {to_seconds(self._kernel.now() - at):.1f} s old"
            if at is not None
            else "there is none"
        )
        raise Refused(
            self.name,
            asked,
            f"no stick sample is newer than 1 s ({last}); call manual_control(...) just before, again and "
            f"again as the operator moves the sticks",
        )

    def _by_hand(self, operation: str, asked: str, change: Callable[[], Sequence[Step]]) -> None:
        """Change to a mode that is flown by sticks, and arm it there if it is on the ground."""
        self._check_sticks(asked)

        def plan() -> Sequence[Step]:
            steps = tuple(change())
            if self._driver.telemetry.flying:
                return steps
            mode = next((step.enters for step in reversed(steps) if step.enters), "")
            advice = "an autopilot arms with the throttle down: manual_control() with a lower one first"
            return (*steps, *(replace(step, mode=mode, advice=advice) for step in self._driver.arm()))

        self._operate(operation, asked, plan, manner=MANUAL)


READY_WITHIN_S = 120.0
MISSION_WITHIN_S = 3600.0
SLOWEST_TRAVEL = 2.5
"""Metres per second over ground that a time-out reckons with where no speed is stated."""
MARGIN_S = 30.0


def travel_within(distance: float, climb: float, speed: float | None) -> float:
    """The time-out, in seconds, for so many metres: half the speed, a climb of 0.5 m/s, and ``MARGIN_S``."""
    across = distance / (speed / 2.0 if speed is not None else SLOWEST_TRAVEL)
    return MARGIN_S + across + abs(climb) / 0.5


class Vehicle(Commanded, ABC):
    """A vehicle behind a driver. Use ``Drone`` or ``Rover``.

    *limits* and *fence* are checked before anything moves and, with each position that the vehicle reports,
    while it travels: one that strays is held and the call raises ``OutOfBounds``; below
    ``Limits.battery_reserve`` it is held and the call raises ``LowBattery``. ``hold``, ``return_home``,
    ``land`` and ``kill`` are allowed then, too, and take the place of what another task has under way.
    Whatever happens, a vehicle that somebody else has taken is left alone; only ``kill`` does not ask.

    *truth* is known in simulation only. A link that says nothing for *silence* is lost; one that returns
    earlier is as if nothing had happened.
    """

    _mission: Sequence[MissionItem] = ()  # on board, as far as this program put it there

    # -- state, as the autopilot last told it

    @property
    def position(self) -> Position:
        """Where it is by its autopilot's estimate, AMSL. Raises ``VehicleError`` while it knows none."""
        return self._known("its position", self._look().position)

    @property
    def home(self) -> Position:
        """Where it would return to, AMSL. ArduPilot sets it anew each time it arms."""
        return self._known("its home", self._look().home)

    @property
    def altitude(self) -> AboveHome:
        """Above home. Raises ``VehicleError`` while it knows none."""
        self._known("its altitude", self._look().position)
        return AboveHome(self._driver.telemetry.above_home)

    @property
    def velocity(self) -> Velocity:
        """North, east, up in m/s over ground; NaN while it knows none."""
        return self._look().velocity

    @property
    def attitude(self) -> Attitude:
        """Roll, pitch and heading in degrees; NaN for what the autopilot does not send."""
        return self._look().attitude

    @property
    def battery(self) -> Battery:
        """Remaining share 0..1, volts, amperes; NaN for what it does not measure."""
        return self._look().battery

    @property
    def mode(self) -> str:
        """The autopilot's mode by its own name."""
        return self._look().mode

    @property
    def status(self) -> str:
        """The autopilot's system status in MAVLink's words: standby, active, critical ..."""
        return self._look().status

    @property
    def armed(self) -> bool:
        """The motors may turn."""
        return self._look().armed

    @property
    def ready(self) -> bool:
        """It could arm now and go by position."""
        return self._look().ready

    @property
    def texts(self) -> list[StatusText]:
        """The autopilot's last texts, oldest first."""
        return list(self._look().texts)

    @property
    def telemetry(self) -> Telemetry:
        """Everything that was heard of it, for those who bridge it to something else."""
        return self._look()

    @property
    def capabilities(self) -> frozenset[Capability]:
        """What it can be asked for."""
        with self._kernel:
            return self._driver.capabilities

    @property
    def if_silent(self) -> str:
        """In one line, from the aircraft's own parameters: what it will do if this program falls silent.

        Empty until they are known. A run records the line as soon as it is.
        """
        self._look()
        with self._kernel:
            return self._driver.if_silent()

    # -- getting there

    def wait_ready(self, within: float = READY_WITHIN_S) -> None:
        """Until it could arm and go by position, in at most *within* seconds; the error says what lacks."""
        self._hear()
        self._operate("wait_ready", "be ready", lambda: self._driver.ready(from_seconds(within)))
        if self._driver.telemetry.home is not None:
            self._check_fence(self._driver.telemetry.home)

    def arm(self) -> None:
        """Arm in the mode it is in. ``Refused`` quotes the checks that failed."""
        self._hear()
        self._operate("arm", "arm", self._driver.arm)

    def disarm(self) -> None:
        """Disarm. In the air the autopilot refuses."""
        self._hear()
        self._operate("disarm", "disarm", lambda: self._driver.disarm(False), manner=UNGUARDED)

    def kill(self, *, sure: bool) -> None:
        """Stop the motors now, wherever it is: in the air it falls. For when that is the lesser harm.

        The one thing that is sent whoever has the vehicle. What another task has under way ends with
        ``Overridden``. Returns when it is seen to be disarmed. ``kill(sure=True)`` says that it is meant.
        """
        if sure is not True:
            raise UsageError(f"{self.name}: kill() stops the motors in the air; if that is meant: sure=True")
        self._hear()
        self._operate("kill", "stop the motors", lambda: self._driver.disarm(True), manner=LAST_RESORT)

    def hold(self) -> None:
        """Stop and stay where it is, also out of bounds. What another task has under way ends with
        ``Overridden``; a vehicle that somebody else has is left alone.
        """
        self._require(Capability.HOLD)
        self._operate("hold", "hold", self._driver.hold, manner=TO_SAFETY)

    def upload_mission(self, mission: Sequence[MissionItem]) -> None:
        """Replace the mission on board. Limits and fence are checked for each leg, taken as straight."""
        self._require(Capability.MISSION)
        items = list(mission)
        if not items:
            raise UsageError(f"{self.name}: an empty mission; give at least one item")
        self._check_mission(items)
        asked = f"upload a mission of {len(items)} items"
        self._operate("upload_mission", asked, lambda: self._driver.upload(items), manner=UNGUARDED)
        self._mission = tuple(items)

    def start_mission(self, within: float = MISSION_WITHIN_S) -> None:
        """Arm if need be, carry out the mission on board, and return at its end.

        What was uploaded by this program is checked against limits and fence once more; the fence's floor
        does not count on the way.
        """
        self._require(Capability.MISSION)
        if self._mission and self._driver.telemetry.position is not None:
            self._check_mission(self._mission)
        asked = "carry out the mission on board"
        self._operate(
            "start_mission",
            asked,
            lambda: self._driver.start_mission(from_seconds(within)),
            manner=FLY_MISSION,
        )

    @abstractmethod
    def come_to_rest(self) -> str:
        """Bring it down, or to a halt, unless somebody else has it; says what was done. For the very end."""

    def close(self) -> None:
        """Stop talking to it. It goes on with what it does."""
        with self._kernel.guard:
            for handle in (self._asking, self._straying):
                if handle is not None:
                    handle.cancel()
            self._driver.close()

    # -- bounds, before it travels

    def _check_path(self, asked: str, start: Position, goal: Position) -> None:
        home = self._known("its home", self._driver.telemetry.home)
        self._check_fence(home)
        found = path_violation(start, goal, home, self.limits, self.fence)
        if found:
            raise OutOfBounds(self.name, asked, found)

    def _check_altitude(self, goal: Position) -> None:
        if isinstance(goal.altitude, Ellipsoidal):
            raise CapabilityError(
                f"{self.name}: {goal.altitude} cannot be flown to: autopilots count from the geoid; "
                f"subtract its height there and say AMSL"
            )
        if isinstance(goal.altitude, AboveGround):
            self._require(Capability.TERRAIN)

    def _check_mission(self, items: Sequence[MissionItem]) -> None:
        start = self._known("its position", self._driver.telemetry.position)
        for number, item in enumerate(items, 1):
            asked = f"mission item {number} ({type(item).__name__})"
            self._check_numbers(asked, item)
            if isinstance(item, TakeOff):
                start = Position(start.latitude, start.longitude, AboveHome(item.height))
                self._check_path(asked, self._amsl(start), start)
            elif isinstance(item, Waypoint | Land) and item.position is not None:
                self._check_altitude(item.position)
                self._check_path(asked, self._amsl(start), item.position)
                start = item.position
            elif isinstance(item, ReturnHome):
                home = self._known("its home", self._driver.telemetry.home)
                goal = Position(home.latitude, home.longitude, self._amsl(start).altitude)
                self._check_path(asked, self._amsl(start), goal)
                start = home

    def _check_numbers(self, asked: str, item: MissionItem) -> None:
        if isinstance(item, ChangeSpeed) and not (isfinite(item.speed) and item.speed > 0):
            raise UsageError(f"{self.name}: {asked}: a speed of {item.speed:g} m/s; give one above 0")
        if isinstance(item, TakeOff) and not (isfinite(item.height) and item.height > 0):
            raise UsageError(f"{self.name}: {asked}: a height of {item.height:g} m; give one above 0")
        if isinstance(item, Waypoint) and not (isfinite(item.stay_s) and item.stay_s >= 0):
            raise UsageError(f"{self.name}: {asked}: a stay of {item.stay_s:g} s; give 0 or more")

    def _check_speed(self, asked: str, speed: float | None) -> None:
        if speed is None:
            return
        self._require(Capability.SPEED)
        if not (isfinite(speed) and speed > 0):
            raise UsageError(f"{self.name}: {asked}: a speed of {speed:g} m/s; give one above 0")

    def _strayed_already(self) -> bool:
        """It is out of bounds now, so any way back is allowed."""
        here, bounds = self._driver.telemetry.position, self._bounds_now()
        return here is not None and bounds is not None and bool(bounds.left(here))

    def _amsl(self, position: Position) -> Position:
        """The same place with an AMSL altitude; above ground is taken as above home."""
        if isinstance(position.altitude, AMSL):
            return position
        home = self._known("its home", self._driver.telemetry.home)
        metres = position.altitude.metres + home.altitude.metres
        return Position(position.latitude, position.longitude, AMSL(metres))

    def _goal(self, position: Position) -> Goal:
        amsl = self._amsl(position).altitude.metres
        return Goal(position.latitude, position.longitude, amsl)

    def _within(self, goal: Position, speed: float | None) -> Ns:
        here = self._driver.telemetry.position
        home = self._driver.telemetry.home
        if here is None or home is None:
            return from_seconds(MARGIN_S)
        about = HomeFrame.at(home)
        start, end = about.local(here), about.local(goal)
        distance = hypot(end[0] - start[0], end[1] - start[1])
        return from_seconds(travel_within(distance, end[2] - start[2], speed))
