"""What the vehicle does for whoever commands it: one command or one set-point at a time.

A command takes the place of the one that is under way, and of set-points; set-points do not interrupt a
command. A command has been accepted when it is done, or when nothing has gone wrong with it for a while: what
goes wrong later is told in words, as everything that goes wrong is.
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
"""MAV_RESULT; pymavlink has no name for the last."""

NO_LIMITS = Limits(farthest=100_000.0, highest=10_000.0, lowest=-10_000.0)
"""No limits but the autopilot's own."""
ACCEPTED_AFTER: Ns = 3 * S
TICK: Ns = S
RETRY_AFTER: Ns = S
"""After a set-point that could not be flown the next one is looked at so much later."""
MANUAL_CONTROL_TIMEOUT: Ns = 3 * S
"""Sticks that nobody moves for so long are let go, as autopilots do it."""

Answer = Callable[[int], None]
"""Told a MAV_RESULT."""
Say = Callable[[str], None]


class Operation(NamedTuple):
    """A command, ready to be carried out. ``asked`` says what, in words.

    ``body`` blocks. ``answered_when_done``: it has not been accepted before. ``waits``: it does not take the
    place of another command, but is turned down meanwhile. ``by_hand``: from then on sticks fly it.
    """

    asked: str
    body: Action
    answered_when_done: bool = False
    waits: bool = False
    by_hand: bool = False


class Target(Protocol):
    """A set-point. ``stays``: it holds until the next one, so that the same one once more says nothing."""

    stays: ClassVar[bool]

    def fly(self, drone: Drone) -> None:
        """Raises what the drone's operations raise."""


@dataclass
class _RunningOperation:
    order: Operation
    answer: Answer
    began: Ns
    handle: Handle | None = None
    answered: bool = False


def result_of(error: VoleryError) -> int:
    """The MAV_RESULT of a command that ended so."""
    if isinstance(error, CapabilityError):
        return UNSUPPORTED
    return FAILED if isinstance(error, NotArrived | LinkError) else DENIED


class CommandHandler:
    """Flies *driver*'s vehicle, in tasks at *place*. *say* tells in words what went wrong."""

    def __init__(self, kernel: Kernel, driver: Driver, place: ExecutionContext, say: Say) -> None:
        self.drone = Drone(kernel, driver.name, driver, limits=NO_LIMITS)
        self._kernel, self._driver, self._place, self._say = kernel, driver, place, say
        self._scope = self._new_scope()
        self._command: _RunningOperation | None = None
        self._aim: Target | None = None  # the set-point that holds
        self._next: Target | None = None
        self._flies = False  # a task flies set-points
        self._not_before: Ns = 0
        self._complaint = ""
        self._by_hand = False
        self._sticks_at: Ns | None = None
        self._tick = kernel.every(TICK // 5, self._look_at_sticks)

    def _new_scope(self) -> Scope:
        return self._kernel.root.child(f"commands of {self._driver.name}")

    def close(self) -> None:
        """Do nothing any more. The vehicle goes on with what it does."""
        self._interrupt(f"{self._driver.name} is left alone")
        self._tick.cancel()
        self.drone.close()

    # -- commands; house code

    def command(self, order: Operation, answer: Answer) -> None:
        """Carry it out and answer with its result."""
        if order.waits and self._command is not None:
            self._say(f"{self._driver.name}: {order.asked}: not while it is to {self._command.order.asked}")
            answer(BUSY)
            return
        self._interrupt(f"{order.asked} took its place")
        self._by_hand = order.by_hand
        under_way = self._command = _RunningOperation(order, answer, self._kernel.now())
        under_way.handle = self._kernel.every(TICK, partial(self._accept, under_way))
        self._spawn(partial(self._carry_out, under_way), order.asked)

    def _spawn(self, body: Action, asked: str) -> None:
        name = f"{self._driver.name} ({asked})"
        self._kernel.spawn(body, name, self._place, self._scope)

    def _accept(self, under_way: _RunningOperation) -> None:
        since = self._kernel.now() - under_way.began
        if under_way.order.answered_when_done:
            if since > 0:
                under_way.answer(IN_PROGRESS)
        elif since >= ACCEPTED_AFTER:
            self._answer(under_way, ACCEPTED)

    def _answer(self, under_way: _RunningOperation, result: int) -> None:
        if under_way.handle is not None:
            under_way.handle.cancel()
        if not under_way.answered:
            under_way.answered = True
            under_way.answer(result)

    def _carry_out(self, under_way: _RunningOperation) -> None:
        """The task of a command."""
        result, wrong = ACCEPTED, ""
        try:
            under_way.order.body()
        except VoleryError as error:
            result, wrong = result_of(error), str(error)
        with self._kernel.guard:
            if self._command is under_way:
                self._command = None
                if wrong:
                    self._say(wrong)
                self._answer(under_way, result)

    def _interrupt(self, why: str) -> None:
        """End what is under way."""
        if self._command is None and not self._flies:
            self._aim = None
            return
        self._kernel.cancel(self._scope, why)
        self._scope = self._new_scope()
        self._aim = self._next = None
        self._flies = False
        interrupted, self._command = self._command, None
        if interrupted is not None:
            self._answer(interrupted, CANCELLED)

    # -- set-points; house code

    def aim(self, aim: Target) -> None:
        """Fly there, or so, from now on. Not while a command is under way."""
        if self._command is not None:
            asked = self._command.order.asked
            self.complain(f"{self._driver.name}: set-points are not followed while it is to {asked}")
            return
        if self._kernel.now() < self._not_before:
            return
        if aim.stays and aim == self._aim:
            return
        if self._flies and self._aim is not None and self._aim.stays:
            self._interrupt("another set-point took its place")
        self._aim = self._next = aim
        self._by_hand = False
        if not self._flies:
            self._flies = True
            self._spawn(partial(self._fly, self._scope), "set-points")

    def _fly(self, scope: Scope) -> None:
        """The task of set-points, for as long as there are any."""
        while True:
            with self._kernel.guard:
                if scope is not self._scope:
                    return
                aim, self._next = self._next, None
                if aim is None:
                    self._flies = False
                    return
            wrong = ""
            try:
                aim.fly(self.drone)
            except VoleryError as error:
                wrong = str(error)
            with self._kernel.guard:
                if scope is self._scope:
                    self._flown(wrong)

    def _flown(self, wrong: str) -> None:
        if wrong:
            self._aim = self._next = None
            self._not_before = self._kernel.now() + RETRY_AFTER
        self.complain(wrong)

    def complain(self, wrong: str) -> None:
        """Tell once what is wrong with set-points and sticks; empty: nothing is any more."""
        if wrong and wrong != self._complaint:
            self._say(wrong)
        self._complaint = wrong

    # -- sticks; house code

    def sticks(self, sticks: ManualControl | None) -> None:
        """Hold them so; ``None`` lets go of them. They take effect in modes that are flown by hand."""
        if self._driver.telemetry.kind != Drone.kind:
            return  # it would have to be waited for
        if sticks is None:
            self._let_go()
            return
        self._sticks_at = self._kernel.now()
        try:
            self.drone.manual_control(*sticks)
        except VoleryError as error:
            self.complain(str(error))
        else:
            self.complain("")

    def _look_at_sticks(self) -> None:
        if self._sticks_at is None or self._kernel.now() - self._sticks_at < MANUAL_CONTROL_TIMEOUT:
            return
        if not self._by_hand:
            self._let_go()
            return
        self._sticks_at = None  # what holds it lets go of them
        self._say(f"{self._driver.name}: no sticks for {MANUAL_CONTROL_TIMEOUT // S} s: it is told to hold")
        self.command(Operation("hold", self.drone.hold), lambda result: None)

    def _let_go(self) -> None:
        if self._sticks_at is not None:
            self._sticks_at = None
            self._driver.manual_control(None)
