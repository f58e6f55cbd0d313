"""How a run ends, whatever ends it: time, a goal that is reached, a failure, Ctrl-C, SIGTERM.

The order is always the same: components are cancelled; safety tasks bring every armed vehicle down that no
operator has taken, while components do what they want done last; the rest is cancelled; the kernel names
whoever would not go. The first signal does this, a second one is hard.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from types import FrameType
from typing import Protocol

from volery.base.errors import VoleryError
from volery.base.time import MINUTE, Ns, S
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext, Scope
from volery.requirements.record import Status
from volery.trace.events import Failure

FOREVER: Ns = 2**63 - 1

SAFETY_WITHIN: Ns = 10 * MINUTE
"""Of run time: a vehicle that is not down by then is left to its autopilot, and named."""

FAREWELL_WITHIN: Ns = 5 * S
"""Of run time: what a component does last and has not done by then is cut off, and named."""


class Landable(Protocol):
    """A vehicle, or whoever answers for some."""

    @property
    def name(self) -> str:
        """Who."""

    def come_to_rest(self) -> object:
        """Bring down what is armed and nobody else's; blocks until that is done."""


class Ending:
    """Decides once why a run ends, and ends it."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self.users: Scope = kernel.root.child("components")
        self._safety: Scope = kernel.root.child("safety")
        self.vehicles: Sequence[Landable] = ()
        self.status: Status = "completed"
        self.reason = ""
        self.error: VoleryError | None = None
        self.begun = False
        self._farewells: list[tuple[ExecutionContext, Callable[[], object]]] = []
        self._left = 0

    def failed(self, who: str, error: Exception) -> None:
        """A component's flow of control has ended with *error*."""
        if isinstance(error, VoleryError) and self.error is None:
            self.error = error
        self.begin("failed", f"{error}" if who in str(error) else f"{who}: {error}")

    def begin(self, status: Status, reason: str) -> None:
        """End the run, for the first reason that is given."""
        if self.begun:
            return
        self.begun = True
        self.status, self.reason = status, reason
        self._kernel.cancel(self.users, reason)
        self._left = len(self.vehicles) + len(self._farewells)
        for vehicle in self.vehicles:
            name = f"safety of {vehicle.name}"
            self._kernel.spawn(partial(self._bring_down, vehicle), name, ExecutionContext(name), self._safety)
        for place, last in self._farewells:
            self._part_with(place, last)
        if not self._left:
            self._kernel.cancel(self._kernel.root, reason)
        self._kernel.call_at(self._kernel.now() + SAFETY_WITHIN, self._give_up)

    def farewell(self, place: ExecutionContext, last: Callable[[], object]) -> None:
        """Have *last* done at *place* when the run ends, after the components have been cancelled."""
        self._farewells.append((place, last))

    def _part_with(self, place: ExecutionContext, last: Callable[[], object]) -> None:
        who = place.component
        scope = self._safety.child(f"farewell of {who}")

        def body() -> None:
            try:
                last()
            except Exception as error:
                what = f"failed at the end of the run: {type(error).__name__}: {error}"
                self._kernel.record(Failure(self._kernel.now(), who, what))
            finally:
                self._one_less()

        def cut_off() -> None:
            if scope.tasks:
                what = f"was not through {FAREWELL_WITHIN // S} s after the end of the run"
                self._kernel.record(Failure(self._kernel.now(), who, what))
                self._kernel.cancel(scope, self.reason)

        self._kernel.spawn(body, f"{who} (at the end)", replace(place, deadline=None, on_release=None), scope)
        self._kernel.call_at(self._kernel.now() + FAREWELL_WITHIN, cut_off)

    def _bring_down(self, vehicle: Landable) -> None:
        try:
            vehicle.come_to_rest()
        except VoleryError as error:
            self._kernel.record(Failure(self._kernel.now(), vehicle.name, f"not brought down: {error}"))
        self._one_less()

    def _one_less(self) -> None:
        self._left -= 1
        if not self._left:
            self._kernel.cancel(self._kernel.root, self.reason)

    def _give_up(self) -> None:
        if not self._kernel.root.cancelled:
            what = "was not down ten minutes after the end of the run"
            self._kernel.record(Failure(self._kernel.now(), "safety", what))
            self._kernel.cancel(self._kernel.root, self.reason)

    def pass_time(self) -> list[str]:
        """Let things happen until the run has ended; returns the flows of control that would not go."""
        try:
            self._kernel.run(FOREVER)
        except VoleryError as error:  # a deadlock, or code that froze time: the vehicles still come down
            self.failed("run", error)
            self._kernel.run(FOREVER)
        except KeyboardInterrupt:
            self.stop_hard("interrupted", "stopped at once by a second signal")
        return self._kernel.close(self.reason)

    def stop_hard(self, status: Status, reason: str) -> None:
        """Nothing more happens; vehicles stay where they are."""
        self.begun = True
        self.status, self.reason = status, reason

    @contextmanager
    def signals(self) -> Iterator[None]:
        """SIGINT and SIGTERM end the run in order; a second one raises ``KeyboardInterrupt`` where it
        strikes.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def strike(number: int, frame: FrameType | None) -> None:
            if self.begun or struck:
                raise KeyboardInterrupt
            struck.append(number)
            self._kernel.post(lambda: self.begin("interrupted", f"{signal.Signals(number).name} received"))

        struck: list[int] = []
        before = {number: signal.signal(number, strike) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
