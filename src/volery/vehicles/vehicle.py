"""What drones and rovers share: state, readiness, missions, and how an operation is carried out and recorded.

Every call is an interaction point. One that waits blocks until what was asked is *seen* on the telemetry, has
a time-out, and raises an error that names the vehicle, what was asked, what the autopilot said, what to do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from math import hypot, nan
from typing import NamedTuple

from volery.base.errors import (
    CapabilityError,
    LinkLost,
    LinkSilent,
    OutOfBounds,
    Refused,
    UsageError,
    VehicleError,
)
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.base.time import Ns, from_seconds
from volery.kernel.api import Kernel
from volery.kernel.task import Task
from volery.trace.events import Operation
from volery.vehicles.driver import Capability, Driver, Step
from volery.vehicles.limits import Fence, Home, Limits, violation
from volery.vehicles.mission import Land, MissionItem, ReturnHome, TakeOff, Waypoint
from volery.vehicles.perform import SILENCE, Performer
from volery.vehicles.telemetry import Attitude, Battery, Said, Telemetry, Velocity

Truth = Callable[[], Position]
"""Where a simulated vehicle really is (AMSL): for the errors that are recorded, never for the operations."""

HEARD_WITHIN_S = 10.0
READY_WITHIN_S = 120.0
MISSION_WITHIN_S = 3600.0
RETURN_OF_LINK_S = 30.0
SLOWEST_TRAVEL = 2.5
"""Metres per second over ground that a time-out reckons with where no speed is stated."""
MARGIN_S = 30.0


class Goal(NamedTuple):
    """What an operation is measured against at its end. NaN: not this coordinate."""

    latitude: float
    longitude: float
    amsl: float


NOWHERE = Goal(nan, nan, nan)


def travel_within(distance: float, climb: float, speed: float | None) -> float:
    """The time-out, in seconds, for so many metres: half the speed, a climb of 0.5 m/s, and ``MARGIN_S``."""
    across = distance / (speed / 2.0 if speed is not None else SLOWEST_TRAVEL)
    return MARGIN_S + across + abs(climb) / 0.5


class Vehicle(ABC):
    """A vehicle behind a driver. Use ``Drone`` or ``Rover``.

    *limits* and *fence* are checked before anything moves. *truth* is known in simulation only. A link that
    says nothing for *silence* is lost; one that returns earlier is as if nothing had happened.
    """

    kind = ""

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        driver: Driver,
        *,
        limits: Limits | None = None,
        fence: Fence | None = None,
        truth: Truth | None = None,
        silence: Ns = SILENCE,
    ) -> None:
        self.name = name
        self.limits = limits or Limits()
        self.fence = fence
        self._kernel = kernel
        self._driver = driver
        self._truth = truth
        self._performer = Performer(kernel, driver, silence)
        self._busy: tuple[Task | None, str] | None = None

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
    def texts(self) -> list[Said]:
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

    def _look(self) -> Telemetry:
        if self._driver.cycle is not None:
            self._driver.look()
        with self._kernel:
            return self._driver.telemetry

    def _known(self, what: str, value: Position | None) -> Position:
        if value is None:
            raise VehicleError(self.name, what, "the autopilot does not know it yet; wait_ready() first")
        return value

    # -- getting there

    def wait_heard(self, within: float = HEARD_WITHIN_S) -> None:
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
        if seen.kind != self.kind:
            raise CapabilityError(f"{self.name} is a {seen.kind}, not a {self.kind}")

    def wait_ready(self, within: float = READY_WITHIN_S) -> None:
        """Until it could arm and go by position, in at most *within* seconds; the error says what lacks."""
        self._hear()
        self._operate("wait_ready", "be ready", lambda: self._driver.ready(from_seconds(within)))

    def arm(self) -> None:
        """Arm in the mode it is in. ``Refused`` quotes the checks that failed."""
        self._hear()
        self._operate("arm", "arm", self._driver.arm)

    def disarm(self, *, force: bool = False) -> None:
        """Disarm. In the air the autopilot refuses, unless *force*: then the motors stop and it falls."""
        self._hear()
        self._operate("disarm", "disarm", lambda: self._driver.disarm(force), ours=False)

    def hold(self) -> None:
        """Stop and stay where it is."""
        self._require(Capability.HOLD)
        self._operate("hold", "hold", self._driver.hold)

    def upload_mission(self, mission: Sequence[MissionItem]) -> None:
        """Replace the mission on board. Limits and fence are checked for each leg, taken as straight."""
        self._require(Capability.MISSION)
        items = list(mission)
        if not items:
            raise UsageError(f"{self.name}: an empty mission; give at least one item")
        self._check_mission(items)
        asked = f"upload a mission of {len(items)} items"
        self._operate("upload_mission", asked, lambda: self._driver.upload(items), ours=False)

    def start_mission(self, within: float = MISSION_WITHIN_S) -> None:
        """Arm if need be, carry out the mission on board, and return at its end."""
        self._require(Capability.MISSION)
        asked = "carry out the mission on board"
        self._operate("start_mission", asked, lambda: self._driver.start_mission(from_seconds(within)))

    @abstractmethod
    def come_to_rest(self) -> str:
        """Bring it down, or to a halt, unless somebody else has it; says what was done. For the very end."""

    def close(self) -> None:
        """Stop talking to it. It goes on with what it does."""
        with self._kernel.guard:
            self._driver.close()

    # -- how an operation is carried out

    def _hear(self) -> None:
        """What comes before every operation: take in what has arrived, and wait if nothing ever has."""
        self._look()
        if self._driver.telemetry.heard < 0 or self._driver.telemetry.kind != self.kind:
            self.wait_heard()

    def _require(self, capability: Capability) -> None:
        self._hear()
        if capability not in self._driver.capabilities:
            can = ", ".join(sorted(each.value for each in self._driver.capabilities))
            raise CapabilityError(f"{self.name} cannot {capability.value}; it can {can}")

    def _operate(
        self,
        operation: str,
        asked: str,
        plan: Callable[[], Sequence[Step]],
        *,
        goal: Callable[[], Goal] = lambda: NOWHERE,
        restarts: int = 0,
        ours: bool = True,
        noted: bool = True,
    ) -> None:
        """Perform and record it. *ours*: refuse it while somebody else flies the vehicle.

        *noted* False: record it only if it fails; a loop of set-points is no list of operations.
        """
        with self._kernel as kernel:
            mine = self._take(kernel.current(), operation)
            start = kernel.now()
        outcome, said = "ok", ""
        try:
            if ours:
                self._performer.check_ours(asked)
            self._performer.perform(asked, plan, restarts=restarts)
        except BaseException as error:
            outcome, said = type(error).__name__, str(error)
            raise
        finally:
            with self._kernel.guard:
                if self._busy is mine:
                    self._busy = None
                if noted or outcome != "ok":
                    self._record(start, operation, asked, (outcome, said), goal())

    def _take(self, task: Task | None, operation: str) -> tuple[Task | None, str]:
        """One operation at a time: two tasks that command one vehicle is a fault of the program."""
        if self._busy is not None:
            holder, under_way = self._busy
            if holder is None or not (holder.done or holder.scope.cancelled):
                name = holder.name if holder is not None else "house code"
                raise UsageError(f"{self.name}: {operation}: {name} has {under_way} under way")
        mine = self._busy = (task, operation)
        return mine

    def _record(self, start: Ns, operation: str, asked: str, end: tuple[str, str], goal: Goal) -> None:
        estimate = _offset(self._driver.telemetry.position, goal)
        truth = _offset(self._truth() if self._truth is not None else None, goal)
        self._kernel.record(
            Operation(start, self._kernel.now(), self.name, operation, asked, *end, *estimate, *truth)
        )

    def _wait_for_link(self) -> None:
        """If it is lost at this moment, give it time to return."""
        if self._performer.silent() and not self._performer.wait(
            lambda: not self._performer.silent(), from_seconds(RETURN_OF_LINK_S)
        ):
            raise LinkLost(f"{self.name}: the link did not return; nobody knows whether it has come to rest")

    # -- bounds

    def _check_path(self, asked: str, start: Position, goal: Position) -> None:
        found = violation(
            start, goal, self._known("its home", self._driver.telemetry.home), self.limits, self.fence
        )
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
        about = Home.at(home)
        start, end = about.local(here), about.local(goal)
        distance = hypot(end[0] - start[0], end[1] - start[1])
        return from_seconds(travel_within(distance, end[2] - start[2], speed))

    def _not_on_ground(self, asked: str) -> None:
        if not self._driver.telemetry.flying:
            raise Refused(self.name, asked, "it is on the ground; takeoff(height) first")


def _offset(position: Position | None, goal: Goal) -> tuple[float, float]:
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
