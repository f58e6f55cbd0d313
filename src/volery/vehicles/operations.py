"""How every operation of a vehicle is carried out, monitored and recorded, one at a time.

An operation is begun only under its policy: while no other station has control, over a link that is not lost,
with a battery and sensors that suffice. The monitors run until it ends, and between two calls. What they find
ends it, the vehicle reacts as ``Escalation`` says, and the caller, or the next call, gets the error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import Enum
from math import hypot, isfinite, nan
from typing import NamedTuple

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
from volery.base.frames import LocalFrame
from volery.base.position import Position
from volery.base.time import Ns, S, from_seconds, to_seconds
from volery.kernel.api import Handle, Kernel
from volery.kernel.task import ExecutionContext, Task
from volery.trace.events import Operation
from volery.vehicles.driver import Capability, Driver, ManualControl, Step
from volery.vehicles.escalation import Escalation, Reaction, escalate
from volery.vehicles.executor import MONITOR_PERIOD, Check, StepExecutor
from volery.vehicles.monitors import NO_GOAL, FlightMonitor, Goal, Movement, StreamedSetpoint, low_battery
from volery.vehicles.vehicle_bounds import VehicleBounds
from volery.vehicles.vehicle_connection import LINK_RETURN_S

BATTERY_MEASURED_WITHIN_S = 10.0
RANGES_WITHIN_S = 10.0

MANUAL_CONTROL_FRESH: Ns = S
"""Manual flight does not begin with an older sample of manual control."""

_MONITORED = (OutOfBounds, OffTrack, ObstacleNear, LowBattery, PositionLost, ThrustSaturated)
"""Errors of monitors to which the vehicle reacts."""

_BY_STICKS = {Movement.NONE, Movement.FLOWN_BY_HAND}
"""Movements that leave the manual control as it is; others end it."""

Truth = Callable[[], Position]
"""The true position (AMSL) of a simulated vehicle: for recorded errors, never for the operations."""


class Precedence(Enum):
    """Who else must not have the vehicle when an operation begins.

    Attributes:
        needs_control: it is refused while another station has control.
        to_safety: it aborts the operation of another task; the others are refused beside one.
    """

    ORDINARY = "gives way to others", True, False
    UNMOVED = "moves nothing: another station may have control", False, False
    SAFETY = "brings the vehicle to safety", True, True
    LAST_RESORT = "gives way to nothing", False, True

    def __init__(self, _meaning: str, needs_control: bool, to_safety: bool) -> None:
        self.needs_control = needs_control
        self.to_safety = to_safety


class OperationPolicy(NamedTuple):
    """When a kind of operation is allowed, and what the vehicle does in it."""

    movement: Movement = Movement.NONE
    precedence: Precedence = Precedence.ORDINARY


PLAIN = OperationPolicy()
UNGUARDED = OperationPolicy(precedence=Precedence.UNMOVED)
TURN = OperationPolicy(Movement.TURNS)
TRAVEL = OperationPolicy(Movement.FOLLOWS_PATH)
FLY_MISSION = OperationPolicy(Movement.FLIES_MISSION)
STREAM = OperationPolicy(Movement.FOLLOWS_SETPOINTS)
MANUAL = OperationPolicy(Movement.FLOWN_BY_HAND)
TO_SAFETY = OperationPolicy(Movement.RETREATS, Precedence.SAFETY)
LANDING = OperationPolicy(Movement.LANDS, Precedence.SAFETY)
LAST_RESORT = OperationPolicy(Movement.LANDS, Precedence.LAST_RESORT)


def distance_to(goal: Goal, position: Position | None) -> tuple[float, float]:
    """Return horizontal and vertical distance (m) of *position* (AMSL) from *goal*; NaN where unknown."""
    if position is None:
        return nan, nan
    height = position.altitude.metres
    vertical = abs(height - goal.amsl)
    if goal.latitude != goal.latitude:
        return nan, vertical
    frame = LocalFrame(goal.latitude, goal.longitude, height)
    east, north, _ = frame.to_enu(position.latitude, position.longitude, height)
    return hypot(east, north), vertical


class Operations:
    """The operations of one vehicle.

    Args:
        kernel: clock, tasks and record.
        name: name of the vehicle in messages and in the trace.
        driver: driver of its autopilot.
        executor: executes the driver's steps.
        bounds: limits and fence of the vehicle.
        truth: true position; known in simulation only.

    Attributes:
        escalation: reactions to what a monitor has found; may be replaced.
        bounds_error: found by a monitor between two calls, and raised by the next one.
    """

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        driver: Driver,
        executor: StepExecutor,
        bounds: VehicleBounds,
        truth: Truth | None,
    ) -> None:
        self.escalation = Escalation()
        self.bounds_error: VehicleError | None = None
        self._kernel = kernel
        self._name = name
        self._driver = driver
        self._telemetry = driver.telemetry
        self._executor = executor
        self._bounds = bounds
        self._truth = truth
        self._monitors = FlightMonitor(kernel, driver.telemetry)
        self._in_progress: tuple[Task | None, str] | None = None
        self._monitor: Handle | None = None  # monitors what goes on after a call has returned
        self._looked_at: Ns = -MONITOR_PERIOD  # last check of a stream
        self._straying: VehicleError | None = None  # the same, while the vehicle is being held for it
        self._manual_control_at: Ns | None = None

    @property
    def monitoring(self) -> bool:
        """Whether what goes on after a call is monitored."""
        return self._monitor is not None

    def note_streamed(self, demand: StreamedSetpoint, lasting: float) -> None:
        """Note what is streamed from now on, for *lasting* s; the vehicle must follow it."""
        with self._kernel.guard:
            self._monitors.following.ask(demand, from_seconds(lasting))

    def end(self) -> None:
        """End the monitoring, with the kernel's guard held."""
        if self._monitor is not None:
            self._monitor.cancel()

    def run(
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
        with self._kernel.joined():
            kernel = self._kernel
            with kernel.interact():
                task = kernel.current()
                if self._in_progress is not None:
                    self._abort_other(*self._in_progress, task, operation, policy)
                mine = self._in_progress = (task, operation)
                start = kernel.now()
            outcome, said = "ok", ""
            try:
                if policy.precedence.to_safety:
                    self.bounds_error = None
                if self.bounds_error is not None:
                    self.raise_bounds_error()
                self._executor.check_link(asked, policy.precedence.to_safety)
                if policy.precedence.needs_control and not (
                    policy.precedence.to_safety and self._executor.take_back()
                ):
                    self._executor.check_ours(asked)
                self._check_measured(asked, policy)
                self._execute(asked, plan, policy, goal, restarts)
            except BaseException as error:
                outcome, said = type(error).__name__, str(error)
                raise
            finally:
                with self._kernel.guard:
                    if self._in_progress is mine:
                        self._in_progress = None
                    if policy.movement is not Movement.FOLLOWS_SETPOINTS or outcome != "ok":
                        self._record(start, operation, asked, (outcome, said), goal())
                    if (
                        self._monitor is None
                        and policy.movement is not Movement.LANDS
                        and self._straying is None
                    ):
                        self._monitor_in_place(asked)

    def _check_reserve(self, asked: str) -> None:
        """Raise ``LowBattery`` if the battery is below its reserve."""
        telemetry = self._telemetry
        if self._bounds.limits.battery_reserve and not self._executor.wait(
            lambda: isfinite(telemetry.battery.remaining), from_seconds(BATTERY_MEASURED_WITHIN_S)
        ):
            raise CapabilityError(
                f"{self._name}: {asked}: its autopilot does not report how full the battery is, so a "
                f"reserve of {self._bounds.limits.reserve:.0%} cannot be kept; set its monitor up, or state "
                "no reserve"
            )
        battery = self._monitors.battery
        battery.note(self._kernel.now())
        shortage = battery.shortage(self._bounds.limits)
        if shortage:
            raise low_battery(self._name, asked, shortage)

    def _abort_other(
        self, holder: Task | None, running: str, task: Task | None, operation: str, policy: OperationPolicy
    ) -> None:
        """Abort what *holder* has *running*, or raise ``UsageError`` unless *operation* brings to safety."""
        if self._straying is not None and not policy.precedence.to_safety:
            raise type(self._straying)(self._name, operation, self._straying.what)
        if holder is not None and (holder.done or holder.scope.cancelled):
            return
        if not policy.precedence.to_safety:
            name = holder.name if holder is not None else "a framework callback"
            raise UsageError(f"{self._name}: {operation}: {name} has {running} under way")
        by = f" by {task.name}" if task is not None else ""
        self._executor.abort_for(f"{operation}(){by}")

    def _check_measured(self, asked: str, policy: OperationPolicy) -> None:
        """Check what must be measured for the operation: the battery, and distances of obstacles."""
        if policy.movement.travels:
            self._check_reserve(asked)
        if policy.movement.bounded and self._bounds.limits.clearance:
            self._check_range_sensors(asked)

    def _check_range_sensors(self, asked: str) -> None:
        """Raise ``CapabilityError`` if no range sensor reports, so that no clearance can be kept."""
        seen = self._telemetry
        if seen.obstacles_ns >= 0:
            return
        self._driver.request_obstacles()
        if not self._executor.wait(lambda: seen.obstacles_ns >= 0, from_seconds(RANGES_WITHIN_S)):
            raise CapabilityError(
                f"{self._name}: {asked}: its autopilot reports no distances of obstacles, so a clearance of "
                f"{self._bounds.limits.clearance:g} m cannot be kept; set its range sensors up, or state no "
                "clearance"
            )

    def _execute(
        self,
        asked: str,
        plan: Callable[[], Sequence[Step]],
        policy: OperationPolicy,
        goal: Callable[[], Goal],
        restarts: int,
    ) -> None:
        if policy.movement not in _BY_STICKS:
            self._manual_control_at = None
        if self._monitor is not None:
            self._monitor.cancel()
            self._monitor = None
        if policy.movement is Movement.LANDS:
            self._executor.execute(asked, plan, restarts=restarts)
            return
        bounds = self._bounds.home_bounds() if policy.movement.bounded else self._bounds.usable_bounds()
        check = self._monitors.check_of(policy.movement, self._bounds.limits, bounds, goal)
        upset = None if policy.precedence.to_safety else self._monitors.upset.check(asked, self._kernel.now())
        if upset is not None:
            raise upset
        try:
            if policy.movement.goes_on:
                self._look(asked, check)
            self._executor.execute(asked, plan, restarts=restarts, check=check)
        except _MONITORED as error:
            raise type(error)(self._name, asked, f"{error.what}; {self.react(error)}") from None
        if policy.movement.goes_on:
            self._keep_monitoring(asked, check)

    def _record(self, start: Ns, operation: str, asked: str, end: tuple[str, str], goal: Goal) -> None:
        estimate = distance_to(goal, self._telemetry.position)
        truth = distance_to(goal, self._truth() if self._truth is not None else None)
        self._kernel.record(
            Operation(start, self._kernel.now(), self._name, operation, asked, *end, *estimate, *truth)
        )

    def react(self, error: VehicleError) -> str:
        """React to what a monitor has found, if no other station has control; return what was done."""
        telemetry = self._telemetry
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
        return self.escalation.steps(reaction, self._driver, self._bounds.landing_timeout(0.0))

    # -- monitoring after the call has returned: in place, velocities and manual flight

    def _monitor_in_place(self, asked: str) -> None:
        """Monitor a drone that flies between two calls."""
        seen = self._telemetry
        if not (seen.flying and seen.armed) or seen.kind != "drone":
            return
        check = self._monitors.check_of(Movement.STAYS, self._bounds.limits, self._bounds.usable_bounds())
        self._keep_monitoring(f"after {asked}", check)

    def _look(self, asked: str, check: Check) -> None:
        """Check at a call, if that is due: in a quick loop each call replaces the monitor before it looks."""
        now = self._kernel.now()
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
            error = check(asked, self._kernel.now())
            if error is None:
                return
            handle.cancel()
            if not self._executor.is_ours():
                return
            if isinstance(error, ControlLost):
                self.bounds_error = error
                return
            first = self.escalation.after(error, self._driver.capabilities)[0]
            what = f"{error.what}; it was commanded to {first.value}"
            found = self.bounds_error = type(error)(self._name, asked, what)
            name = f"safety of {self._name}"
            self._kernel.spawn(lambda: self._react_in_place(found), name, ExecutionContext(name))

        with self._kernel.guard:
            self._monitor = handle = self._kernel.every(MONITOR_PERIOD, look)

    def _react_in_place(self, error: VehicleError) -> None:
        self._straying = error

        def perform(reaction: Reaction) -> None:
            self.run(
                reaction.name.lower(),
                f"{reaction.value}: it has strayed" if reaction is Reaction.HOLD else reaction.value,
                lambda: self._reaction_steps(reaction),
                policy=TO_SAFETY if reaction is Reaction.HOLD else LANDING,
            )
            if isinstance(error, PositionLost) and reaction is Reaction.HOLD:
                raise error  # it drifts all the same

        unread = self.bounds_error is not None  # else a call has raised it meanwhile
        try:
            escalate(self.escalation, error, self._driver.capabilities, perform)  # each is recorded
        finally:
            self._straying = None
            if unread:
                self.bounds_error = error
            self._monitor_in_place("a reaction")

    def raise_bounds_error(self) -> None:
        """Raise, once, what a monitor has found since the last call."""
        error, self.bounds_error = self.bounds_error, None
        if error is not None:
            raise error

    # -- manual control

    def set_manual_control(self, control: ManualControl) -> None:
        """Let the driver repeat *control*, unless another station has control."""
        kernel = self._kernel
        with kernel.interact():
            self.raise_bounds_error()
            self._executor.check_ours("manual control")
            self._manual_control_at = kernel.now()
            self._driver.manual_control(control)

    def enter_manual_mode(
        self, operation: str, asked: str, change_mode: Callable[[], Sequence[Step]]
    ) -> None:
        """Change to a mode that is flown by manual control; on the ground also arm."""
        at = self._manual_control_at
        if at is None or self._kernel.now() - at > MANUAL_CONTROL_FRESH:
            age = f"the last is {to_seconds(self._kernel.now() - at):.1f} s old" if at is not None else ""
            raise Refused(
                self._name,
                asked,
                f"no manual control is newer than 1 s ({age or 'there is none'}); call manual_control(...) "
                f"just before, and again whenever the operator moves the sticks",
            )

        def plan() -> Sequence[Step]:
            steps = tuple(change_mode())
            if self._telemetry.flying:
                return steps
            mode = next((step.enters for step in reversed(steps) if step.enters), "")
            advice = "an autopilot arms with the throttle down: manual_control() with a lower one first"
            return (*steps, *(replace(step, mode=mode, advice=advice) for step in self._driver.arm()))

        self.run(operation, asked, plan, policy=MANUAL)
