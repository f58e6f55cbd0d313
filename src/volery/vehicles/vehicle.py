"""What drones and rovers share: state, readiness, missions, and the ways to safety.

Every call is an interaction point. One that waits blocks until what was asked is *seen* on the telemetry, has
a time-out, and raises an error that names the vehicle, what was asked, what the autopilot said, what to do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from math import hypot, isfinite

from volery.base.errors import CapabilityError, OutOfBounds, UsageError
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.base.time import Ns, from_seconds
from volery.vehicles.commanded import Commanded
from volery.vehicles.driver import Capability
from volery.vehicles.goals import Goal
from volery.vehicles.limits import Home, violation
from volery.vehicles.manner import ANYHOW, LAST_RESORT, MISSION, SAFE
from volery.vehicles.mission import ChangeSpeed, Land, MissionItem, ReturnHome, TakeOff, Waypoint
from volery.vehicles.telemetry import Attitude, Battery, Said, Telemetry, Velocity

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
        self._operate("disarm", "disarm", lambda: self._driver.disarm(False), manner=ANYHOW)

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
        self._operate("hold", "hold", self._driver.hold, manner=SAFE)

    def upload_mission(self, mission: Sequence[MissionItem]) -> None:
        """Replace the mission on board. Limits and fence are checked for each leg, taken as straight."""
        self._require(Capability.MISSION)
        items = list(mission)
        if not items:
            raise UsageError(f"{self.name}: an empty mission; give at least one item")
        self._check_mission(items)
        asked = f"upload a mission of {len(items)} items"
        self._operate("upload_mission", asked, lambda: self._driver.upload(items), manner=ANYHOW)
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
            manner=MISSION,
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
        found = violation(start, goal, home, self.limits, self.fence)
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
        about = Home.at(home)
        start, end = about.local(here), about.local(goal)
        distance = hypot(end[0] - start[0], end[1] - start[1])
        return from_seconds(travel_within(distance, end[2] - start[2], speed))
