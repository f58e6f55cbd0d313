"""How a run ends, whatever ends it: time, a goal, a failure, Ctrl-C, SIGTERM, a closed terminal (SIGHUP).

The order is always the same. The components are cancelled. Safety tasks land every armed vehicle that no
operator controls, while components execute their final callbacks. The rest is cancelled, and the kernel names
the tasks that did not end. The first signal starts this; a second one stops at once, but for SIGHUP.
"""

from __future__ import annotations

import gc
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING, Protocol

from volery.base.errors import ComponentError, VoleryError
from volery.base.process import on_ending_signals
from volery.base.time import MINUTE, Ns, S
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext, Scope
from volery.trace.events import Collision, Failure

if TYPE_CHECKING:
    from volery.requirements.record import Status

FOREVER: Ns = 2**63 - 1

SAFETY_WITHIN: Ns = 10 * MINUTE
"""Run time until a vehicle that has not landed is left to its autopilot and reported."""

FAREWELL_WITHIN: Ns = 5 * S
"""Run time until a final callback that has not returned is cancelled and reported."""


class Landable(Protocol):
    """A vehicle, or a process that commands vehicles."""

    @property
    def name(self) -> str:
        """Name in messages."""

    def come_to_rest(self) -> object:
        """Block until every armed vehicle that no operator controls has landed."""


def _reason(who: str, error: Exception) -> str:
    return f"{error}" if who in str(error) else f"{who}: {error}"


class Ending:
    """Ends a run, for the first reason that is reported."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self.users: Scope = kernel.root.child("components")
        self._safety: Scope = kernel.root.child("safety")
        self.vehicles: Sequence[Landable] = ()
        self.status: Status = "completed"
        self.reason = ""
        self.error: VoleryError | None = None
        self.begun = False
        self.signalled = False
        """Whether a signal has asked for the end, which begins when time passes next."""
        self.status_by_signal: Status = "interrupted"
        """Status of a run that a signal ends."""
        self._farewells: list[tuple[ExecutionContext, Callable[[], object]]] = []
        self._failures: list[str] = []
        self._landing: set[str] = set()
        self._pending = 0
        self._broken = False

    def failed(self, who: str, error: Exception) -> None:
        """End the run because a task of *who* has raised *error*."""
        self._keep(error)
        self.begin("failed", _reason(who, error))

    def component_failed(self, who: str, error: Exception) -> None:
        """Let the run's outcome be failed because component *who* has; the others go on."""
        self._keep(error)
        self._failures.append(_reason(who, error))

    def vehicle_hit(self, event: Collision) -> None:
        """Let the run's outcome be failed because a vehicle has hit something; the run goes on."""
        self._failures.append(f"{event.vehicle} {event}")

    def check_over(self) -> None:
        """End the run if a component has failed and none is left that runs."""
        if self._failures and all(task.scope.cancelled for task in self.users.all_tasks()):
            self.begin("failed", "")

    def _keep(self, error: Exception) -> None:
        if isinstance(error, VoleryError) and self.error is None:
            self.error = error

    def begin(self, status: Status, reason: str) -> None:
        """End the run. Later calls have no effect."""
        if self.begun:
            return
        self.begun = True
        if self._failures and status == "completed":
            status = "failed"
        if self._failures and status == "failed":
            more = f" (and {len(self._failures) - 1} more failures)" if len(self._failures) > 1 else ""
            reason = f"{self._failures[0]}{more}"
        self.status, self.reason = status, reason
        self._kernel.cancel(self.users, reason)
        self._pending = len(self.vehicles) + len(self._farewells)
        for vehicle in self.vehicles:
            self.land(vehicle)
        for context, last in self._farewells:
            self._run_farewell(context, last)
        if not self._pending:
            self._kernel.cancel(self._kernel.root, reason)
        self._kernel.call_at(self._kernel.now() + SAFETY_WITHIN, self._give_up)

    def land(self, vehicle: Landable) -> None:
        """Bring a vehicle to rest; the run need not have ended."""
        if vehicle.name not in self._landing:
            self._landing.add(vehicle.name)
            name = f"safety of {vehicle.name}"
            self._kernel.spawn(partial(self._land, vehicle), name, ExecutionContext(name), self._safety)

    def farewell(self, context: ExecutionContext, last: Callable[[], object]) -> None:
        """Call *last* in *context* when the run ends, after the components have been cancelled."""
        self._farewells.append((context, last))

    def say_farewell(self, component: str) -> None:
        """Execute the final callbacks of a component now, in its own flow, the last one first."""
        while own := [one for one in self._farewells if one[0].component == component]:
            self._farewells.remove(own[-1])
            try:
                own[-1][1]()
            except (Exception, SystemExit) as error:
                self._record_farewell(component, error)

    def forget_farewells(self, component: str) -> None:
        """Forget the final callbacks of a component that was killed."""
        self._farewells = [one for one in self._farewells if one[0].component != component]

    def _record_farewell(self, who: str, error: BaseException) -> None:
        if isinstance(error, ComponentError):  # what it finds of the component at its end
            self._kernel.record(Failure(self._kernel.now(), who, error.what))
            self.component_failed(who, error)
            if self.begun and self.status == "completed":
                self.status, self.reason = "failed", self._failures[0]
        elif not isinstance(error, SystemExit):
            what = f"failed at the end of the run: {type(error).__name__}: {error}"
            self._kernel.record(Failure(self._kernel.now(), who, what))

    def _run_farewell(self, context: ExecutionContext, last: Callable[[], object]) -> None:
        who = context.component
        scope = self._safety.child(f"farewell of {who}")

        def body() -> None:
            try:
                last()
            except (Exception, SystemExit) as error:
                self._record_farewell(who, error)
            finally:
                self._finish_one()

        def cancel() -> None:
            if scope.tasks:
                what = f"was not through {FAREWELL_WITHIN // S} s after the end of the run"
                self._kernel.record(Failure(self._kernel.now(), who, what))
                self._kernel.cancel(scope, self.reason)

        self._kernel.spawn(
            body, f"{who} (at the end)", replace(context, deadline=None, period=None, on_release=None), scope
        )
        self._kernel.call_at(self._kernel.now() + FAREWELL_WITHIN, cancel)

    def _land(self, vehicle: Landable) -> None:
        try:
            vehicle.come_to_rest()
        except VoleryError as error:
            self._kernel.record(Failure(self._kernel.now(), vehicle.name, f"not brought down: {error}"))
        self._landing.discard(vehicle.name)
        if self.begun:
            self._finish_one()

    def _finish_one(self) -> None:
        self._pending -= 1
        if not self._pending:
            self._kernel.cancel(self._kernel.root, self.reason)

    def _give_up(self) -> None:
        if not self._kernel.root.cancelled:
            what = "was not down ten minutes after the end of the run"
            self._kernel.record(Failure(self._kernel.now(), "safety", what))
            self._kernel.cancel(self._kernel.root, self.reason)

    def pass_time(self) -> list[str]:
        """Execute the run to its end. Return the names of tasks that did not end."""
        gc.freeze()  # what exists now stays until the end: collections need not look at it
        try:
            while self.advance(FOREVER):
                pass  # it goes on after an error
        finally:
            gc.unfreeze()
        return self._kernel.close(self.reason)

    def advance(self, until: Ns) -> bool:
        """Execute the run up to *until*, ns; return whether it goes on.

        The first error of the run itself ends it in order; a second one is raised.
        """
        try:
            self._kernel.run(until)
        except VoleryError as error:  # a deadlock, or code that froze time: the vehicles still land
            if self._broken:
                raise
            self._broken = True
            self.failed("run", error)
            return True
        except KeyboardInterrupt:
            self.stop_hard("interrupted", "stopped at once by a second signal")
            return False
        return not self._kernel.root.cancelled and self._kernel.now() >= until

    def stop_hard(self, status: Status, reason: str) -> None:
        """Stop at once; vehicles are left where they are."""
        self.begun = True
        self.status, self.reason = status, reason

    @contextmanager
    def signals(self) -> Iterator[None]:
        """Let SIGINT, SIGTERM and SIGHUP end the run in order.

        A second SIGINT or SIGTERM raises ``KeyboardInterrupt``; so does the first one if the run ends
        already, but for the reason of a SIGHUP: who closes a session may send both.
        """
        received: list[int] = []

        def handle(number: int, frame: FrameType | None) -> None:
            second = signal.SIGINT in received or signal.SIGTERM in received
            if number != signal.SIGHUP and (second or (self.begun and not received)):
                raise KeyboardInterrupt
            received.append(number)
            self.signalled = True
            if not self.begun:
                self._kernel.post(
                    lambda: self.begin(self.status_by_signal, f"{signal.Signals(number).name} received")
                )

        with on_ending_signals(handle):
            yield
