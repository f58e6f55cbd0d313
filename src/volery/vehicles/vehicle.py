"""What drones and rovers share: readiness, missions, and how every operation is carried out.

Every call is an interaction point. An operation blocks until telemetry shows that it is done; it has a
time-out, and an error names the vehicle, the operation, the autopilot's own text and the remedy. One
operation runs at a time, only while no other station has control, within the bounds, and it is recorded.

| what ends an operation | the caller gets | the vehicle |
|---|---|---|
| limits or fence are violated | ``OutOfBounds`` | holds where it has stopped |
| an obstacle is nearer than the stated clearance | ``ObstacleNear`` | holds where it has stopped |
| it is far off its commanded path or place for 3 s | ``OffTrack`` | holds where it has stopped |
| set-points show no effect for 3 s | ``OffTrack`` | holds where it has stopped |
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

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isfinite

from volery.base.errors import (
    CapabilityError,
    ControlLost,
    LowBattery,
    ObstacleNear,
    OffTrack,
    OutOfBounds,
    PositionLost,
    Refused,
    ThrustSaturated,
    UsageError,
    VehicleError,
    VoleryError,
)
from volery.base.position import Position
from volery.base.time import Ns, S, from_seconds, to_seconds
from volery.kernel.api import Handle, Kernel
from volery.kernel.task import ExecutionContext, Task
from volery.trace.events import Operation
from volery.vehicles.battery_monitor import low_battery
from volery.vehicles.driver import Capability, Driver, ManualControl, MissionItem, Step
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
    distance_to,
)
from volery.vehicles.flight_monitor import FlightMonitor
from volery.vehicles.limits import Fence, Limits
from volery.vehicles.observed_vehicle import LINK_RETURN_S
from volery.vehicles.serviced_vehicle import ServicedVehicle
from volery.vehicles.session import Session

READY_WITHIN_S = 120.0
MISSION_WITHIN_S = 3600.0
BATTERY_MEASURED_WITHIN_S = 10.0
RANGES_WITHIN_S = 10.0

MANUAL_CONTROL_FRESH: Ns = S
"""Manual flight does not begin with an older sample of manual control."""

_MONITORED = (OutOfBounds, OffTrack, ObstacleNear, LowBattery, PositionLost, ThrustSaturated)
"""Errors of monitors to which the vehicle reacts."""

Truth = Callable[[], Position]
"""The true position (AMSL) of a simulated vehicle: for recorded errors, never for the operations."""


class Vehicle(ServicedVehicle, Session, ABC):
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
        super().__init__(kernel, name, driver, link_timeout, limits or Limits(), fence)
        Session.__init__(self, self.disconnect)
        self.escalation = Escalation()
        self._flight_monitor = FlightMonitor(kernel, driver.telemetry)
        self._truth = truth
        self._in_progress: tuple[Task | None, str] | None = None
        self._monitor: Handle | None = None  # monitors what goes on after a call has returned
        self._looked_at: Ns = -MONITOR_PERIOD  # last check of a stream
        self._straying: VehicleError | None = None  # the same, while the vehicle is being held for it
        self._bounds_error: VehicleError | None = None  # found by the monitor; raised by the next call
        self._manual_control_at: Ns | None = None
        self._mission: Sequence[MissionItem] = ()  # on board, if this program has uploaded it

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

    def take_over(self) -> None:
        """Take the present mode as commanded by this program: the station that commanded it is gone."""
        self._executor.set_commanded(self._driver.telemetry.mode)

    def disconnect(self) -> None:
        """Stop all communication. The vehicle goes on with its present operation."""
        with self.kernel.guard:
            for handle in (self._link_loss_query, self._monitor):
                if handle is not None:
                    handle.cancel()
            self._driver.close()

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
            self._check_measured(asked, policy)
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

    def _check_measured(self, asked: str, policy: OperationPolicy) -> None:
        """Check what must be measured for the operation: the battery, and distances of obstacles."""
        if policy.travels:
            self._check_reserve(asked)
        if policy.bounded and self.limits.clearance:
            self._check_range_sensors(asked)

    def _check_range_sensors(self, asked: str) -> None:
        """Raise ``CapabilityError`` if no range sensor reports, so that no clearance can be kept."""
        seen = self._driver.telemetry
        if seen.obstacles_ns >= 0:
            return
        self._driver.request_obstacles()
        if not self._executor.wait(lambda: seen.obstacles_ns >= 0, from_seconds(RANGES_WITHIN_S)):
            raise CapabilityError(
                f"{self.name}: {asked}: its autopilot reports no distances of obstacles, so a clearance of "
                f"{self.limits.clearance:g} m cannot be kept; set its range sensors up, or state no clearance"
            )

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
            if policy.goes_on:
                self._look(asked, check)
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

    def _look(self, asked: str, check: Check) -> None:
        """Check at a call, if that is due: in a quick loop each call replaces the monitor before it looks."""
        now = self.kernel.now()
        if now - self._looked_at < MONITOR_PERIOD:
            return
        self._looked_at = now
        error = check(asked, now)
        if error is not None:
            raise error

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
