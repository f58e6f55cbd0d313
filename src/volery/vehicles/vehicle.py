"""What drones and rovers share: state, readiness, missions, and how every operation is carried out.

Every call is an interaction point. An operation blocks until telemetry shows that it is done; it has a
time-out, and an error names the vehicle, the operation, the autopilot's own text and the remedy. One
operation runs at a time, only while no other station has control, within the bounds, and it is recorded.

| what ends an operation | the caller gets | the vehicle |
|---|---|---|
| limits or fence are violated | ``OutOfBounds`` | holds where it has stopped |
| it is far off its commanded path or place for 3 s | ``OffTrack`` | holds where it has stopped |
| the battery falls below the reserve | ``LowBattery`` | holds where it has stopped |
| what is left suffices for a landing only | ``CriticalBattery`` | is landed where it is |
| the thrust is at its limit and it does not climb | ``ThrustSaturated`` | is landed where it is |
| the position is lost for 10 s in the air | ``PositionLost`` | is commanded to hold |
| it falls or has turned over, as with a motor lost | ``ControlLost`` | is left to its autopilot |
| a pilot or another station changes mode or target | ``Overridden``, ``Failsafe`` | gets no more messages |
| another task of this program holds, returns, lands or kills | ``Overridden`` | does that |
| the link times out | ``LinkLost`` | does what its parameters state: ``on_link_loss`` |

A drone in the air is monitored between two calls as well; the next call then raises the error. A drone that
does not hold is landed: see ``Escalation``. Nothing is commanded if another station has control; on the
ground the vehicle is disarmed instead.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import hypot, isfinite

from volery.base.errors import (
    CapabilityError,
    ControlLost,
    LinkLost,
    LinkSilent,
    LowBattery,
    NotArrived,
    OffTrack,
    OutOfBounds,
    PositionLost,
    Refused,
    ThrustSaturated,
    UsageError,
    VehicleError,
    VoleryError,
)
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.base.time import MINUTE, MS, Ns, S, from_seconds, to_seconds
from volery.kernel.api import Handle, Kernel
from volery.kernel.task import ExecutionContext, Task
from volery.trace.events import Operation, Text
from volery.vehicles.battery_monitor import low_battery
from volery.vehicles.driver import (
    Capability,
    Driver,
    Land,
    ManualControl,
    MissionItem,
    ReturnHome,
    Step,
    TakeOff,
    Waypoint,
    item_problem,
)
from volery.vehicles.escalation import Escalation, Reaction, escalate
from volery.vehicles.executor import (
    FLY_MISSION,
    IN_PLACE,
    LANDING,
    LAST_RESORT,
    LINK_TIMEOUT,
    MANUAL,
    MONITOR_PERIOD,
    NO_GOAL,
    PLAIN,
    TO_SAFETY,
    UNGUARDED,
    Check,
    Goal,
    OperationPolicy,
    StepExecutor,
    distance_to,
)
from volery.vehicles.flight_monitor import FlightMonitor
from volery.vehicles.limits import (
    Bounds,
    Fence,
    Limits,
    Path,
    is_number,
    states_amsl,
)
from volery.vehicles.serviced_vehicle import ServicedVehicle
from volery.vehicles.telemetry import (
    REFRESHED_AFTER,
    Attitude,
    Battery,
    StatusText,
    Telemetry,
    Velocity,
    describe_state,
)

FIRST_MESSAGE_WITHIN_S = 10.0
READY_WITHIN_S = 120.0
MISSION_WITHIN_S = 3600.0
BATTERY_MEASURED_WITHIN_S = 10.0
LINK_RETURN_S = 30.0
"""How long the end of a program waits for a lost link."""

SAID_AFTER: Ns = 5 * S
SAID_AGAIN_AFTER: Ns = 15 * S
"""Times after which a wait for a position is reported."""

ASK_PERIOD: Ns = 500 * MS
ASK_FOR: Ns = MINUTE
"""An autopilot that has not sent its parameters after this time will not send them."""
ON_LINK_LOSS = "if this program stops sending"
"""Beginning of the recorded line that states the vehicle's reaction to a lost link."""

MANUAL_CONTROL_FRESH: Ns = S
"""Manual flight does not begin with an older sample of manual control."""

SLOWEST_TRAVEL = 2.5
"""Speed over ground, m/s, that a time-out assumes where no speed is stated."""
SLOWEST_CLIMB = 0.5
MARGIN_S = 30.0

_MONITORED = (OutOfBounds, OffTrack, LowBattery, PositionLost, ThrustSaturated)
"""Errors of monitors to which the vehicle reacts."""

Truth = Callable[[], Position]
"""The true position (AMSL) of a simulated vehicle: for recorded errors, never for the operations."""


def travel_timeout(distance: float, climb: float, speed: float | None = None) -> Ns:
    """Return the time-out of a movement: half the speed, a climb rate of 0.5 m/s, and a margin.

    Args:
        distance: horizontal distance, m.
        climb: difference of height, m.
        speed: speed over ground, m/s; ``None`` means the autopilot's own.
    """
    across = distance / (speed / 2.0 if speed is not None else SLOWEST_TRAVEL)
    return from_seconds(MARGIN_S + across + abs(climb) / SLOWEST_CLIMB)


def path_timeout(path: Path, speed: float | None) -> Ns:
    """Return the time-out of a movement along a straight path at *speed* m/s."""
    start, end = path
    return travel_timeout(hypot(end[0] - start[0], end[1] - start[1]), end[2] - start[2], speed)


class Vehicle(ServicedVehicle):
    """A vehicle behind a driver. Use ``Drone`` or ``Rover``.

    Limits and fence are checked before anything is sent and at each position report while the vehicle
    travels. ``hold``, ``return_home``, ``land`` and ``kill`` are allowed outside the bounds and abort the
    operation of another task. A vehicle under the control of another station gets no messages; only ``kill``
    is always sent. ``escalation`` states the reactions to what a monitor has found; it may be replaced.

    Args:
        kernel: clock and tasks.
        name: name of the vehicle in messages and in the trace.
        driver: driver of its autopilot.
        limits: limits about home.
        fence: geofence, if any.
        truth: true position; known in simulation only.
        link_timeout: time without a message after which the link counts as lost, ns.
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
        link_timeout: Ns = LINK_TIMEOUT,
    ) -> None:
        self.name = name
        self.kernel = kernel
        self.limits = limits or Limits()
        self.fence = fence
        self._driver = driver
        driver.telemetry.detects_silence = driver.cycle is None
        self._executor = StepExecutor(kernel, driver, link_timeout)
        self.escalation = Escalation()
        self._flight_monitor = FlightMonitor(kernel, driver.telemetry)
        self._truth = truth
        self._supported: frozenset[Capability] = frozenset()  # as known once the vehicle was connected
        self._bounds: Bounds | None = None
        self._in_progress: tuple[Task | None, str] | None = None
        self._monitor: Handle | None = None  # monitors what goes on after a call has returned
        self._straying: VehicleError | None = None  # the same, while the vehicle is being held for it
        self._bounds_error: VehicleError | None = None  # found by the monitor; raised by the next call
        self._link_loss_query: Handle | None = None
        self._manual_control_at: Ns | None = None
        self._mission: Sequence[MissionItem] = ()  # on board, if this program has uploaded it

    # -- state, as last reported by the autopilot

    @property
    def position(self) -> Position:
        """Position (AMSL) estimated by the autopilot. Raises ``VehicleError`` before the first estimate."""
        return self._known("its position", self._poll().position)

    @property
    def home(self) -> Position:
        """Home position (AMSL), where it would return to. ArduPilot sets it anew each time it arms."""
        return self._known("its home", self._poll().home)

    @property
    def altitude(self) -> AboveHome:
        """Altitude above home. Raises ``VehicleError`` before the first estimate."""
        telemetry = self._poll()
        self._known("its altitude", telemetry.position)
        return AboveHome(telemetry.above_home)

    @property
    def velocity(self) -> Velocity:
        """Velocity over ground: north, east, up in m/s; NaN before the first estimate."""
        return self._poll().velocity

    @property
    def attitude(self) -> Attitude:
        """Roll, pitch and heading in degrees; NaN for values that the autopilot does not send.

        Over MAVROS the first call subscribes to ``imu/data`` and waits for it.
        """
        self._poll()
        self._driver.request_attitude()
        return self._poll().attitude

    @property
    def battery(self) -> Battery:
        """Remaining share 0..1, volts, amperes; NaN for values that are not measured."""
        return self._poll().battery

    @property
    def mode(self) -> str:
        """Flight mode by the autopilot's own name."""
        return self._poll().mode

    @property
    def status(self) -> str:
        """System status in MAVLink's terms: standby, active, critical ..."""
        return self._poll().status

    @property
    def armed(self) -> bool:
        """Whether the motors may turn."""
        return self._poll().armed

    @property
    def ready(self) -> bool:
        """Whether the vehicle could arm now and go to a position."""
        return self._poll().ready

    @property
    def stale(self) -> bool:
        """Whether the state below may be old: position, mode and all else are those before a silence.

        It is True from 2 s after the last message until 2 s after messages have returned, because a link that
        stalls delivers late what it has held back.
        """
        return self._poll().stale

    @property
    def texts(self) -> list[StatusText]:
        """Last status texts of the autopilot, oldest first."""
        return list(self._poll().texts)

    @property
    def telemetry(self) -> Telemetry:
        """All telemetry, for code that passes it on."""
        return self._poll()

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Operations that the vehicle supports; empty before the first message."""
        with self.kernel:
            return self._driver.capabilities

    @property
    def on_link_loss(self) -> str:
        """Reaction to a lost link in one line, from the parameters; empty until these are known."""
        self._poll()
        with self.kernel:
            return self._driver.on_link_loss()

    def _poll(self) -> Telemetry:
        """Process received messages and return the telemetry."""
        if self._driver.cycle is not None:
            self._driver.poll()
        with self.kernel:
            return self._driver.telemetry

    def _known(self, what: str, value: Position | None) -> Position:
        if value is None:
            raise self._unknown(what)
        return value

    def _unknown(self, what: str) -> VehicleError:
        return VehicleError(self.name, what, "the autopilot does not know it yet; wait_ready() first")

    # -- link

    def wait_connected(self, within: float = FIRST_MESSAGE_WITHIN_S) -> None:
        """Wait for the first message of the autopilot.

        Args:
            within: longest time to wait, s.

        Raises:
            LinkSilent: nothing was received.
            LinkGarbled: something else was received; the error says what.
            CapabilityError: the vehicle is of another kind, or its firmware is not supported.
        """
        telemetry = self._driver.telemetry

        def connected() -> bool:
            return telemetry.last_message_ns >= 0 and self._driver.problem() is None

        with self.kernel.joined():
            is_connected = self._executor.wait(connected, from_seconds(within))
        if not is_connected:
            with self.kernel:
                problem = self._driver.problem()
            if problem is not None:
                raise type(problem)(f"{self.name}: {problem}")
            raise LinkSilent(f"{self.name}: no message was received within {within:g} s")
        if not telemetry.kind:
            telemetry.kind = self.kind  # MAVROS does not report the kind of vehicle
            self._poll()  # the kind changes how messages are decoded
        if telemetry.kind != self.kind:
            raise CapabilityError(f"{self.name} is a {telemetry.kind}, not a {self.kind}")
        self._record_link_loss_reaction()

    def wait_located(self, within: float, tell: Callable[[str], object] | None = None) -> None:
        """Wait until the autopilot reports position and home.

        Args:
            within: longest time to wait, s; 0 does not wait.
            tell: receives what is missing, every few seconds.

        Raises:
            NotArrived: they are not known in time; the error names what is missing and what its GPS reports.
        """
        if within == 0.0 or not self._missing_place():
            return
        began = self.kernel.now()
        until, say_after = began + from_seconds(within), SAID_AFTER
        with self.kernel.joined():
            while self._missing_place():
                now = self.kernel.now()
                if now >= until:
                    what = f"{self._missing_place()} within {within:g} s; a wait of 0 s does not need it"
                    raise NotArrived(self.name, "connect", what)
                self._executor.wait(lambda: not self._missing_place(), min(until - now, say_after))
                missing, say_after = self._missing_place(), SAID_AGAIN_AFTER
                if missing and tell is not None:
                    tell(f"{self.name}: {missing} after {to_seconds(self.kernel.now() - began):.0f} s")

    def _missing_place(self) -> str:
        """Return what of position and home the autopilot does not report, in words; empty for nothing."""
        seen = self._poll()
        missing = [
            name for name, known in (("position", seen.position), ("home", seen.home)) if known is None
        ]
        if not missing:
            return ""
        gps = f"its GPS reports {seen.fix or 'nothing'}, {seen.satellites} satellites"
        return f"it has not reported its {' and its '.join(missing)} ({gps})"

    def _record_link_loss_reaction(self) -> None:
        """Record the reaction to a lost link as soon as it is known, without blocking."""
        if self._link_loss_query is not None:
            return
        until = self.kernel.now() + ASK_FOR

        def ask() -> None:
            line = self._driver.on_link_loss()
            if line:
                self.kernel.record(Text(self.kernel.now(), self.name, 6, f"{ON_LINK_LOSS}: {line}"))
            if line or self.kernel.now() >= until:
                query.cancel()

        with self.kernel.guard:
            self._link_loss_query = query = self.kernel.every(ASK_PERIOD, ask)

    def _connect(self, capability: Capability | None = None) -> None:
        """Process received messages; wait for the first one if there was none.

        Args:
            capability: what the vehicle must be able to do; ``CapabilityError`` if it cannot.
        """
        telemetry = self._poll()
        if telemetry.last_message_ns < 0 or telemetry.kind != self.kind:
            self.wait_connected()
        if capability is None:
            return
        problem = self._driver.problem()
        if isinstance(problem, CapabilityError):
            raise CapabilityError(f"{self.name}: {problem}")
        if capability not in self._supported:
            capabilities = self._driver.capabilities
            if capability not in capabilities:
                can = ", ".join(sorted(each.value for each in capabilities))
                raise CapabilityError(f"{self.name} cannot {capability.value}; it can {can}")
            self._supported |= capabilities

    def _wait_for_link(self) -> None:
        """If the link is or was lost, give it time to return and telemetry time to become fresh."""
        telemetry = self._driver.telemetry
        if not telemetry.stale and not self._executor.link_lost():
            return
        if not self._executor.wait(
            lambda: not (telemetry.stale or self._executor.link_lost()), from_seconds(LINK_RETURN_S)
        ):
            raise LinkLost(
                f"{self.name}: the link did not return; it is unknown whether it has come to rest; last: "
                f"{describe_state(telemetry)}{', FLYING' if telemetry.flying else ''}, {self._reaction()}"
            )
        if not telemetry.detects_silence:
            self._executor.wait(lambda: False, REFRESHED_AFTER)

    def _reaction(self) -> str:
        return self._driver.on_link_loss() or "its reaction to a lost link is not known"

    # -- operations common to all vehicles

    def wait_ready(self, within: float = READY_WITHIN_S) -> None:
        """Wait until the vehicle could arm and go to a position; the error states what is missing.

        Args:
            within: longest time to wait, s.
        """
        self._connect()
        self._operate("wait_ready", "be ready", lambda: self._driver.ready(from_seconds(within)))
        self._home_bounds()

    def arm(self) -> None:
        """Arm in the present mode. ``Refused`` quotes the arming checks that failed."""
        self._connect()
        self._operate("arm", "arm", self._driver.arm)

    def disarm(self) -> None:
        """Disarm. In the air the autopilot refuses."""
        self._connect()
        self._operate("disarm", "disarm", lambda: self._driver.disarm(False), policy=UNGUARDED)

    def kill(self, *, sure: bool) -> None:
        """Stop the motors now; a vehicle in the air falls.

        It is sent even while another station has control. The operation of another task is aborted.

        Args:
            sure: must be True.
        """
        if sure is not True:
            raise UsageError(f"{self.name}: kill() stops the motors in the air; if that is meant: sure=True")
        self._connect()
        self._operate("kill", "stop the motors", lambda: self._driver.disarm(True), policy=LAST_RESORT)

    def hold(self) -> None:
        """Stop and hold the position, also outside the bounds.

        The operation of another task is aborted. Raises ``Overridden`` if another station has control.
        """
        self._connect(Capability.HOLD)
        self._operate("hold", "hold", self._driver.hold, policy=TO_SAFETY)

    def resume(self) -> None:
        """Take the vehicle back after a failsafe that an interrupted stream of this program has caused.

        The vehicle then holds its position. Raises ``Failsafe`` or ``Overridden`` for any other failsafe, or
        if another station has control.
        """
        self._connect(Capability.HOLD)
        self._operate("resume", "take the vehicle back", self._driver.hold, policy=TO_SAFETY)

    def upload_mission(self, mission: Sequence[MissionItem]) -> None:
        """Replace the mission on board. Each leg is checked against limits and fence as a straight path.

        Args:
            mission: its items, in the order in which they are flown.

        Raises:
            UsageError: it is empty.
            OutOfBounds: a leg leaves limits or fence.
        """
        self._connect(Capability.MISSION)
        items = list(mission)
        if not items:
            raise UsageError(f"{self.name}: an empty mission; give at least one item")
        self._check_mission(items)
        asked = f"upload a mission of {len(items)} items"
        self._operate("upload_mission", asked, lambda: self._driver.upload(items), policy=UNGUARDED)
        self._mission = tuple(items)

    def start_mission(self, within: float = MISSION_WITHIN_S) -> None:
        """Arm, start the mission on board and return when it has ended.

        A mission uploaded by this program is checked against limits and fence again. The floor of the fence
        is not checked on the way.

        Args:
            within: longest duration of the mission, s.
        """
        self._connect(Capability.MISSION)
        if self._mission and self._driver.telemetry.position is not None:
            self._check_mission(self._mission)
        self._operate(
            "start_mission",
            "carry out the mission on board",
            lambda: self._driver.start_mission(from_seconds(within)),
            policy=FLY_MISSION,
        )

    @abstractmethod
    def come_to_rest(self) -> str:
        """Land or stop the vehicle unless another station has control; return what was done."""

    def close(self) -> None:
        """Stop all communication. The vehicle goes on with its present operation."""
        with self.kernel.guard:
            for handle in (self._link_loss_query, self._monitor):
                if handle is not None:
                    handle.cancel()
            self._driver.close()

    # -- checks before an operation

    def _home_bounds(self) -> Bounds | None:
        """Return the bounds about the present home; ``None`` without a home.

        Raises:
            UsageError: the fence excludes home.
        """
        home = self._driver.telemetry.home
        if home is None:
            return None
        bounds = self._bounds
        if (
            bounds is None
            or bounds.limits is not self.limits
            or bounds.fence is not self.fence
            or bounds.home != home
        ):
            bounds = self._bounds = Bounds(home, self.limits, self.fence)
        seen = self._driver.telemetry
        if not seen.amsl_known and self.fence is not None and states_amsl(self.fence):
            raise UsageError(f"{self.name}: the fence states altitudes AMSL: {seen.amsl_remedy}")
        if bounds.home_violation:
            raise UsageError(f"{self.name}: the fence excludes home: {bounds.home_violation}")
        return bounds

    def _usable_bounds(self) -> Bounds | None:
        """Return the bounds about the present home; ``None`` without a home, or if they exclude it."""
        try:
            return self._home_bounds()
        except UsageError:
            return None

    def _check_path(self, asked: str, start: Position | None, goal: Position) -> Path:
        """Return the straight path; raise ``OutOfBounds`` if it violates limits or fence. *start* is AMSL."""
        if start is None:
            raise self._unknown("its position")
        bounds = self._home_bounds()
        if bounds is None:
            raise self._unknown("its home")
        path = bounds.path(start, goal)
        violation = bounds.path_violation(path, goal)
        if violation:
            raise OutOfBounds(self.name, asked, violation)
        return path

    def _timeout_to(self, goal: Position, speed: float | None = None) -> Ns:
        """Return the time-out of a movement from the present position to *goal*."""
        here, bounds = self._driver.telemetry.position, self._home_bounds()
        if here is None or bounds is None:
            return from_seconds(MARGIN_S)
        return path_timeout(bounds.path(here, goal), speed)

    def _landing_timeout(self, climb: float) -> Ns:
        """Return the time-out of a landing at 0.5 m/s, as of ArduPilot; an unknown height is the highest."""
        height = self._driver.telemetry.above_home
        height = max(height, 0.0) if isfinite(height) else self.limits.highest
        return travel_timeout(0.0, 2.0 * (height + climb))

    def _check_leg(self, asked: str, place: Position) -> None:
        self._check_path(asked, self._amsl(place), place)

    def _check_altitude(self, goal: Position) -> None:
        if isinstance(goal.altitude, Ellipsoidal):
            raise CapabilityError(
                f"{self.name}: {goal.altitude} cannot be flown to: autopilots count from the geoid; "
                f"subtract its height there and say AMSL"
            )
        if isinstance(goal.altitude, AboveGround):
            self._connect(Capability.TERRAIN)
        seen = self._driver.telemetry
        if isinstance(goal.altitude, AMSL) and not seen.amsl_known:
            raise Refused(self.name, f"go to {goal}", seen.amsl_remedy)

    def _check_numbers(self, call: str, *numbers: object, example: str) -> None:
        """Raise ``UsageError`` unless all are finite numbers: programs and consoles have no type checker.

        Args:
            call: the call as it was written.
            numbers: the arguments that are numbers.
            example: a valid call.
        """
        for number in numbers:
            if not is_number(number):
                raise UsageError(
                    f"{self.name}: {call}: {number!r} is not a finite number; write it as in {example}"
                )

    def _check_speed(self, asked: str, speed: float) -> None:
        self._connect(Capability.SPEED)
        self._check_numbers(f"{asked}: speed={speed!r}", speed, example="speed=5.0, in m/s")
        if speed <= 0:
            raise UsageError(f"{self.name}: {asked}: a speed of {speed:g} m/s; give one above 0")

    def _check_mission(self, items: Sequence[MissionItem]) -> None:
        start = self._known("its position", self._driver.telemetry.position)
        for number, item in enumerate(items, 1):
            asked = f"mission item {number} ({type(item).__name__})"
            problem = item_problem(item)
            if problem:
                raise UsageError(f"{self.name}: {asked}: {problem}")
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

    def _is_out_of_bounds(self) -> bool:
        """Return whether the vehicle is out of bounds now, so that any way back is allowed."""
        here, bounds = self._driver.telemetry.position, self._home_bounds()
        return here is not None and bounds is not None and bool(bounds.violations(here))

    def _check_reserve(self, asked: str) -> None:
        """Raise ``LowBattery`` if the battery is below its reserve."""
        telemetry = self._driver.telemetry
        if self.limits.battery_reserve and not self._executor.wait(
            lambda: isfinite(telemetry.battery.remaining), from_seconds(BATTERY_MEASURED_WITHIN_S)
        ):
            raise CapabilityError(
                f"{self.name}: {asked}: its autopilot does not report how full the battery is, so a reserve "
                f"of {self.limits.reserve:.0%} cannot be kept; set its monitor up, or state no reserve"
            )
        battery = self._flight_monitor.battery
        battery.note(self.kernel.now())
        shortage = battery.shortage(self.limits)
        if shortage:
            raise low_battery(self.name, asked, shortage)

    def _amsl(self, position: Position) -> Position:
        """Return the same place with an AMSL altitude; above ground is taken as above home."""
        if isinstance(position.altitude, AMSL):
            return position
        home = self._known("its home", self._driver.telemetry.home)
        metres = position.altitude.metres + home.altitude.metres
        return Position(position.latitude, position.longitude, AMSL(metres))

    def _goal(self, position: Position) -> Goal:
        return Goal(position.latitude, position.longitude, self._amsl(position).altitude.metres)

    # -- carrying out an operation

    def _operate(
        self,
        operation: str,
        asked: str,
        plan: Callable[[], Sequence[Step]],
        *,
        policy: OperationPolicy = PLAIN,
        goal: Callable[[], Goal] = lambda: NO_GOAL,
        restarts: int = 0,
    ) -> None:
        """Carry out an operation under *policy* and record it.

        Args:
            operation: name of the method.
            asked: the operation in words, for errors and the record.
            plan: returns the driver's steps.
            policy: when it is allowed and what is monitored.
            goal: where the vehicle should be at the end.
            restarts: how often to start again after the sequence was undone before lift-off.
        """
        with self.kernel.joined():
            self._operate_as_task(operation, asked, plan, policy, goal, restarts)

    def _operate_as_task(
        self,
        operation: str,
        asked: str,
        plan: Callable[[], Sequence[Step]],
        policy: OperationPolicy,
        goal: Callable[[], Goal],
        restarts: int,
    ) -> None:
        with self.kernel as kernel:
            task = kernel.current()
            if self._in_progress is not None:
                self._abort_other(*self._in_progress, task, operation, policy)
            mine = self._in_progress = (task, operation)
            start = kernel.now()
        outcome, said = "ok", ""
        try:
            if policy.to_safety:
                self._bounds_error = None
            if self._bounds_error is not None:
                self._raise_bounds_error()
            self._executor.check_link(asked, policy.to_safety)
            if policy.needs_control and not (policy.to_safety and self._executor.take_back()):
                self._executor.check_ours(asked)
            if policy.travels:
                self._check_reserve(asked)
            self._execute(asked, plan, policy, goal, restarts)
        except BaseException as error:
            outcome, said = type(error).__name__, str(error)
            raise
        finally:
            with self.kernel.guard:
                if self._in_progress is mine:
                    self._in_progress = None
                if policy.recorded or outcome != "ok":
                    self._record(start, operation, asked, (outcome, said), goal())
                if self._monitor is None and not policy.unmonitored and self._straying is None:
                    self._monitor_in_place(asked)

    def _abort_other(
        self, holder: Task | None, running: str, task: Task | None, operation: str, policy: OperationPolicy
    ) -> None:
        """Abort what *holder* has *running*, or raise ``UsageError`` unless *operation* brings to safety."""
        if self._straying is not None and not policy.to_safety:
            raise type(self._straying)(self.name, operation, self._straying.what)
        if holder is not None and (holder.done or holder.scope.cancelled):
            return
        if not policy.to_safety:
            name = holder.name if holder is not None else "a framework callback"
            raise UsageError(f"{self.name}: {operation}: {name} has {running} under way")
        by = f" by {task.name}" if task is not None else ""
        self._executor.abort_for(f"{operation}(){by}")

    def _execute(
        self,
        asked: str,
        plan: Callable[[], Sequence[Step]],
        policy: OperationPolicy,
        goal: Callable[[], Goal],
        restarts: int,
    ) -> None:
        if not policy.manual:
            self._manual_control_at = None
        if self._monitor is not None:
            self._monitor.cancel()
            self._monitor = None
        if policy.unmonitored:
            self._executor.execute(asked, plan, restarts=restarts)
            return
        bounds = self._home_bounds() if policy.bounded else self._usable_bounds()
        check = self._flight_monitor.check_of(policy, self.limits, bounds, goal)
        upset = None if policy.to_safety else self._flight_monitor.upset.check(asked, self.kernel.now())
        if upset is not None:
            raise upset
        try:
            self._executor.execute(asked, plan, restarts=restarts, check=check)
        except _MONITORED as error:
            raise type(error)(self.name, asked, f"{error.what}; {self._react(error)}") from None
        if policy.goes_on:
            self._keep_monitoring(asked, check)

    def _record(self, start: Ns, operation: str, asked: str, end: tuple[str, str], goal: Goal) -> None:
        estimate = distance_to(goal, self._driver.telemetry.position)
        truth = distance_to(goal, self._truth() if self._truth is not None else None)
        self.kernel.record(
            Operation(start, self.kernel.now(), self.name, operation, asked, *end, *estimate, *truth)
        )

    def _react(self, error: VehicleError) -> str:
        """React to what a monitor has found, if no other station has control; return what was done."""
        telemetry = self._driver.telemetry
        if not self._executor.is_ours():
            return f"it is left to the station or pilot who has it in {telemetry.mode}"
        capabilities = self._driver.capabilities
        if not telemetry.flying and Capability.LAND in capabilities:
            try:
                if telemetry.armed:
                    self._executor.execute("land", lambda: self._driver.land(from_seconds(LINK_RETURN_S)))
            except VoleryError as problem:
                return f"it could not be disarmed: {problem}"
            return "it is on the ground"

        def perform(reaction: Reaction) -> None:
            self._executor.execute(reaction.value, lambda: self._reaction_steps(reaction))

        return escalate(self.escalation, error, capabilities, perform)

    def _reaction_steps(self, reaction: Reaction) -> Sequence[Step]:
        return self.escalation.steps(reaction, self._driver, self._landing_timeout(0.0))

    # -- monitoring after the call has returned: in place, velocities and manual flight

    def _monitor_in_place(self, asked: str) -> None:
        """Monitor a drone that flies between two calls."""
        seen = self._driver.telemetry
        if not (seen.flying and seen.armed) or seen.kind != "drone":
            return
        check = self._flight_monitor.check_of(IN_PLACE, self.limits, self._usable_bounds())
        self._keep_monitoring(f"after {asked}", check)

    def _keep_monitoring(self, asked: str, check: Check) -> None:
        """Check each ``MONITOR_PERIOD``, unless telemetry arrives in a node's loop that may not run."""
        if self._driver.cycle is not None:
            return

        waited = False

        def look() -> None:
            nonlocal waited
            if not waited or self._in_progress is not None:  # never twice at one time
                waited = True
                return
            error = check(asked, self.kernel.now())
            if error is None:
                return
            handle.cancel()
            if not self._executor.is_ours():
                return
            if isinstance(error, ControlLost):
                self._bounds_error = error
                return
            first = self.escalation.after(error, self._driver.capabilities)[0]
            what = f"{error.what}; it was commanded to {first.value}"
            found = self._bounds_error = type(error)(self.name, asked, what)
            name = f"safety of {self.name}"
            self.kernel.spawn(lambda: self._react_in_place(found), name, ExecutionContext(name))

        with self.kernel.guard:
            self._monitor = handle = self.kernel.every(MONITOR_PERIOD, look)

    def _react_in_place(self, error: VehicleError) -> None:
        self._straying = error

        def perform(reaction: Reaction) -> None:
            self._operate(
                reaction.name.lower(),
                f"{reaction.value}: it has strayed" if reaction is Reaction.HOLD else reaction.value,
                lambda: self._reaction_steps(reaction),
                policy=TO_SAFETY if reaction is Reaction.HOLD else LANDING,
            )
            if isinstance(error, PositionLost) and reaction is Reaction.HOLD:
                raise error  # it drifts all the same

        unread = self._bounds_error is not None  # else a call has raised it meanwhile
        try:
            escalate(self.escalation, error, self._driver.capabilities, perform)  # each is recorded
        finally:
            self._straying = None
            if unread:
                self._bounds_error = error
            self._monitor_in_place("a reaction")

    def _raise_bounds_error(self) -> None:
        error, self._bounds_error = self._bounds_error, None
        if error is not None:
            raise error

    # -- manual control

    def _set_manual_control(self, control: ManualControl) -> None:
        with self.kernel as kernel:
            self._raise_bounds_error()
            self._executor.check_ours("manual control")
            self._manual_control_at = kernel.now()
            self._driver.manual_control(control)

    def _enter_manual_mode(
        self, operation: str, asked: str, change_mode: Callable[[], Sequence[Step]]
    ) -> None:
        """Change to a mode that is flown by manual control; on the ground also arm."""
        at = self._manual_control_at
        if at is None or self.kernel.now() - at > MANUAL_CONTROL_FRESH:
            age = f"the last is {to_seconds(self.kernel.now() - at):.1f} s old" if at is not None else ""
            raise Refused(
                self.name,
                asked,
                f"no manual control is newer than 1 s ({age or 'there is none'}); call manual_control(...) "
                f"just before, and again whenever the operator moves the sticks",
            )

        def plan() -> Sequence[Step]:
            steps = tuple(change_mode())
            if self._driver.telemetry.flying:
                return steps
            mode = next((step.enters for step in reversed(steps) if step.enters), "")
            advice = "an autopilot arms with the throttle down: manual_control() with a lower one first"
            return (*steps, *(replace(step, mode=mode, advice=advice) for step in self._driver.arm()))

        self._operate(operation, asked, plan, policy=MANUAL)
