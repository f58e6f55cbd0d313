"""How an operation is carried out, the same for drones and rovers: one at a time, only while nobody else has
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
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from math import isfinite

from volery.base.errors import (
    CapabilityError,
    LowBattery,
    OutOfBounds,
    Refused,
    UsageError,
    VehicleError,
    VoleryError,
)
from volery.base.position import Position
from volery.base.time import MS, Ns, S, from_seconds, to_seconds
from volery.kernel.api import Handle, Kernel
from volery.kernel.task import Place, Task
from volery.trace.events import Operation
from volery.vehicles.bounds import Bounds, Watch, low_battery
from volery.vehicles.driver import Capability, Driver, Step, Sticks
from volery.vehicles.goals import NOWHERE, Goal, offset
from volery.vehicles.heard import RETURN_OF_LINK_S, Heard
from volery.vehicles.limits import Fence, Limits, excludes_home
from volery.vehicles.manner import BY_HAND, PLAIN, SAFE, Manner
from volery.vehicles.perform import SILENCE

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
        silence: Ns = SILENCE,
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
        manner: Manner = PLAIN,
        goal: Callable[[], Goal] = lambda: NOWHERE,
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

    def _take(self, task: Task | None, operation: str, manner: Manner) -> tuple[Task | None, str]:
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

    def _admit(self, asked: str, manner: Manner) -> None:
        """Whether it may begin."""
        if manner.safe:
            self._strayed = None
        self._tell_strayed()
        if manner.ours:
            self._performer.check_ours(asked)
        if manner.travels:
            self._check_reserve(asked)

    def _go(self, asked: str, plan: Callable[[], Sequence[Step]], manner: Manner, restarts: int) -> None:
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
        estimate = offset(self._driver.telemetry.position, goal)
        truth = offset(self._truth() if self._truth is not None else None, goal)
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
        found = excludes_home(self.fence, home) if self.fence is not None else ""
        if found:
            raise UsageError(f"{self.name}: the fence excludes home: {found}")

    def _watch(self, manner: Manner) -> Watch:
        reserve = self.limits.battery_reserve if manner.travels else 0.0
        return Watch(self._driver.telemetry, self._bounds_now(), reserve, manner.excused)

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
                self._performer.perform("land", lambda: self._driver.land(from_seconds(RETURN_OF_LINK_S)))
        except VoleryError as error:
            return f"it could not be held: {error}"
        return "it holds there" if stays else "it is on the ground"

    def _watch_on(self, asked: str, watch: Watch) -> None:
        """Look after what goes on when the call has returned: a velocity, sticks."""

        def look() -> None:
            error = watch.look(asked, self._kernel.now())
            if error is None or self._busy is not None:
                return
            handle.cancel()
            self._strayed = type(error)(self.name, asked, f"{error.what}; it was told to hold")
            name = f"safety of {self.name}"
            self._kernel.spawn(self._hold_strayed, name, Place(name))

        with self._kernel.guard:
            self._straying = handle = self._kernel.every(STRAY_PERIOD, look)

    def _tell_strayed(self) -> None:
        strayed, self._strayed = self._strayed, None
        if strayed is not None:
            raise strayed

    def _hold_strayed(self) -> None:
        strayed = self._strayed
        with suppress(VoleryError):  # recorded; and told to whoever commands it next
            self._operate("hold", "hold: it has strayed", self._driver.hold, manner=SAFE)
        self._strayed = strayed

    # -- sticks

    def _move_sticks(self, sticks: Sticks) -> None:
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

        self._operate(operation, asked, plan, manner=BY_HAND)
