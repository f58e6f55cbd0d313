"""Execution of commands and set-points by a drone: one command or one set-point at a time.

A command replaces the command in progress and the set-points; set-points do not interrupt a command. A
command is accepted when it has finished, or when it has run without an error for ``ACCEPTED_AFTER``; later
errors are reported as texts, as all errors are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, NamedTuple, Protocol

from volery.base.errors import CapabilityError, LinkError, NotArrived, VoleryError
from volery.base.time import Ns, S
from volery.kernel.api import Action, Handle, Kernel
from volery.kernel.task import ExecutionContext, Scope
from volery.links.mavlink_messages import constant
from volery.vehicles.driver import Driver, ManualControl
from volery.vehicles.drone import Drone
from volery.vehicles.limits import Limits

ACCEPTED, BUSY, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS = (
    constant(f"MAV_RESULT_{name}")
    for name in ("ACCEPTED", "TEMPORARILY_REJECTED", "DENIED", "UNSUPPORTED", "FAILED", "IN_PROGRESS")
)
CANCELLED = 6
"""MAV_RESULT_CANCELLED, for which pymavlink has no name."""

NO_LIMITS = Limits(farthest=100_000.0, highest=10_000.0, lowest=-10_000.0)
"""Limits beyond those of any autopilot."""
ACCEPTED_AFTER: Ns = 3 * S
TICK: Ns = S
RETRY_AFTER: Ns = S
"""After a set-point that could not be flown, set-points are ignored for this time."""
MANUAL_CONTROL_TIMEOUT: Ns = 3 * S
"""Manual control that is not renewed for this time is released, as autopilots do."""

Answer = Callable[[int], None]
"""Receives the MAV_RESULT of a command."""
Report = Callable[[str], None]


class DroneOperation(NamedTuple):
    """A command, ready to be executed.

    Args:
        description: Infinitive phrase for messages, such as ``take off to 5 m``.
        body: Executes the command; it may block.
        answered_when_done: The command is accepted only when it has finished.
        waits: The command is rejected while another one is in progress, instead of replacing it.
        by_hand: The command starts a mode in which manual control flies the vehicle.
    """

    description: str
    body: Action
    answered_when_done: bool = False
    waits: bool = False
    by_hand: bool = False


class BridgeSetpoint(Protocol):
    """A set-point. ``persistent``: it is valid until the next one, so repeating it has no effect."""

    persistent: ClassVar[bool]

    def fly(self, drone: Drone) -> None:
        """Fly to the set-point; raise the errors of the drone's operations."""


@dataclass
class _RunningOperation:
    operation: DroneOperation
    answer: Answer
    began: Ns
    handle: Handle | None = None
    answered: bool = False


def result_of(error: VoleryError) -> int:
    """Return the MAV_RESULT of a command that ended with *error*."""
    if isinstance(error, CapabilityError):
        return UNSUPPORTED
    return FAILED if isinstance(error, NotArrived | LinkError) else DENIED


class CommandHandler:
    """Flies the vehicle of *driver* in tasks that execute in *context*; *report* receives error texts.

    All public methods are called as framework callbacks.
    """

    def __init__(self, kernel: Kernel, driver: Driver, context: ExecutionContext, report: Report) -> None:
        self.drone = Drone(kernel, driver.name, driver, limits=NO_LIMITS)
        self._kernel, self._driver, self._context, self._report = kernel, driver, context, report
        self._scope = self._new_scope()
        self._running: _RunningOperation | None = None
        self._target: BridgeSetpoint | None = None  # the valid set-point
        self._next: BridgeSetpoint | None = None
        self._flies_targets = False  # the task of set-points runs
        self._not_before: Ns = 0
        self._last_report = ""
        self._by_hand = False
        self._manual_control_at: Ns | None = None
        self._tick = kernel.every(TICK // 5, self._check_manual_control)

    def _new_scope(self) -> Scope:
        return self._kernel.root.child(f"commands of {self._driver.name}")

    def close(self) -> None:
        """Stop all operations. The vehicle continues what it does."""
        self._interrupt(f"{self._driver.name} is left alone")
        self._tick.cancel()
        self.drone.close()

    # -- commands

    def execute(self, operation: DroneOperation, answer: Answer) -> None:
        """Execute a command and answer with its result."""
        if operation.waits and self._running is not None:
            current = self._running.operation.description
            self._report(f"{self._driver.name}: {operation.description}: not while it is to {current}")
            answer(BUSY)
            return
        self._interrupt(f"{operation.description} took its place")
        self._by_hand = operation.by_hand
        running = self._running = _RunningOperation(operation, answer, self._kernel.now())
        running.handle = self._kernel.every(TICK, partial(self._acknowledge_progress, running))
        self._spawn(partial(self._run, running), operation.description)

    def _spawn(self, body: Action, description: str) -> None:
        name = f"{self._driver.name} ({description})"
        self._kernel.spawn(body, name, self._context, self._scope)

    def _acknowledge_progress(self, running: _RunningOperation) -> None:
        since = self._kernel.now() - running.began
        if running.operation.answered_when_done:
            if since > 0:
                running.answer(IN_PROGRESS)
        elif since >= ACCEPTED_AFTER:
            self._answer(running, ACCEPTED)

    def _answer(self, running: _RunningOperation, result: int) -> None:
        if running.handle is not None:
            running.handle.cancel()
        if not running.answered:
            running.answered = True
            running.answer(result)

    def _run(self, running: _RunningOperation) -> None:
        """Execute a command in its task."""
        result, problem = ACCEPTED, ""
        try:
            running.operation.body()
        except VoleryError as error:
            result, problem = result_of(error), str(error)
        with self._kernel.guard:
            if self._running is running:
                self._running = None
                if problem:
                    self._report(problem)
                self._answer(running, result)

    def _interrupt(self, why: str) -> None:
        """Abort the command and the set-points in progress."""
        if self._running is None and not self._flies_targets:
            self._target = None
            return
        self._kernel.cancel(self._scope, why)
        self._scope = self._new_scope()
        self._target = self._next = None
        self._flies_targets = False
        interrupted, self._running = self._running, None
        if interrupted is not None:
            self._answer(interrupted, CANCELLED)

    # -- set-points

    def set_target(self, target: BridgeSetpoint) -> None:
        """Fly to a set-point from now on, unless a command is in progress."""
        if self._running is not None:
            current = self._running.operation.description
            self.report(f"{self._driver.name}: set-points are not followed while it is to {current}")
            return
        if self._kernel.now() < self._not_before:
            return
        if target.persistent and target == self._target:
            return
        if self._flies_targets and self._target is not None and self._target.persistent:
            self._interrupt("another set-point took its place")
        self._target = self._next = target
        self._by_hand = False
        if not self._flies_targets:
            self._flies_targets = True
            self._spawn(partial(self._fly_targets, self._scope), "set-points")

    def _fly_targets(self, scope: Scope) -> None:
        """Fly set-points in their task until there are no more."""
        while True:
            with self._kernel.guard:
                if scope is not self._scope:
                    return
                target, self._next = self._next, None
                if target is None:
                    self._flies_targets = False
                    return
            problem = ""
            try:
                target.fly(self.drone)
            except VoleryError as error:
                problem = str(error)
            with self._kernel.guard:
                if scope is self._scope:
                    if problem:
                        self._target = self._next = None
                        self._not_before = self._kernel.now() + RETRY_AFTER
                    self.report(problem)

    def report(self, problem: str) -> None:
        """Report a problem with set-points or manual control once; ``""`` means that there is none now."""
        if problem and problem != self._last_report:
            self._report(problem)
        self._last_report = problem

    # -- manual control

    def manual_control(self, control: ManualControl | None) -> None:
        """Apply manual control, or release it with None. It takes effect in modes that are flown by hand."""
        if self._driver.telemetry.kind != Drone.kind:
            return  # the kind of vehicle is not known yet, and this method must not wait
        if control is None:
            self._release_manual_control()
            return
        self._manual_control_at = self._kernel.now()
        try:
            self.drone.manual_control(*control)
        except VoleryError as error:
            self.report(str(error))
        else:
            self.report("")

    def _check_manual_control(self) -> None:
        since = self._manual_control_at
        if since is None or self._kernel.now() - since < MANUAL_CONTROL_TIMEOUT:
            return
        if not self._by_hand:
            self._release_manual_control()
            return
        self._manual_control_at = None  # the hold operation releases manual control
        self._report(f"{self._driver.name}: no sticks for {MANUAL_CONTROL_TIMEOUT // S} s: it holds now")
        self.execute(DroneOperation("hold", self.drone.hold), lambda result: None)

    def _release_manual_control(self) -> None:
        if self._manual_control_at is not None:
            self._manual_control_at = None
            self._driver.manual_control(None)
