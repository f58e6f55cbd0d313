"""A fleet: vehicles by name, and what one would ask of all of them at once. No more than that."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

from volery.base.errors import FleetError, UsageError, choices, did_you_mean
from volery.kernel.api import Kernel
from volery.kernel.task import Scope, Task
from volery.kernel.waiting import Signal, current_task
from volery.vehicles.drone import Drone
from volery.vehicles.vehicle import READY_WITHIN_S, Vehicle

R = TypeVar("R")


class Fleet(Mapping[str, Vehicle]):
    """Vehicles by name, on one clock, of any kinds and autopilots.

    A group operation is asked of all vehicles at once and returns when the last has done it. One that fails
    does not stop the others; then ``FleetError`` says which failed and how. To ask only some of them, make a
    fleet of those: ``Fleet({name: fleet[name] for name in ("a", "b")})``.
    """

    def __init__(self, vehicles: Mapping[str, Vehicle]) -> None:
        if not vehicles:
            raise UsageError("a fleet of no vehicles; give at least one")
        self._vehicles = dict(vehicles)
        kernels = {id(vehicle.kernel): vehicle.kernel for vehicle in self._vehicles.values()}
        if len(kernels) > 1:
            raise UsageError("a fleet whose vehicles are not on one clock; connect them with connect_fleet")
        (self._kernel,) = kernels.values()

    def __getitem__(self, name: str) -> Vehicle:
        if name not in self._vehicles:
            hint = did_you_mean(name, self._vehicles)
            raise UsageError(f"no vehicle {name!r} in the fleet{hint}; there is {choices(self._vehicles)}")
        return self._vehicles[name]

    def __contains__(self, name: object) -> bool:
        return name in self._vehicles

    def __iter__(self) -> Iterator[str]:
        return iter(self._vehicles)

    def __len__(self) -> int:
        return len(self._vehicles)

    def each(self, function: Callable[[Any], R], asked: str = "") -> dict[str, R]:
        """``function(vehicle)`` for all at once, each in a flow of control of its own; what they return, by
        name.

        *asked* names it in messages, else the function does. Raises ``FleetError`` after the last has ended.
        """
        named = getattr(function, "__name__", "each")
        asked = asked or (named if named.isidentifier() else "each")
        return _Round(self._kernel, asked, self._vehicles, function).run()

    def wait_ready(self, within: float = READY_WITHIN_S) -> None:
        """Until each could arm and go by position."""
        self.each(lambda vehicle: vehicle.wait_ready(within), "be ready")

    def takeoff(self, height: float) -> None:
        """All drones, to *height* metres above the home of each; rovers stay where they are."""
        self._drones(f"take off to {height:g} m", lambda drone: drone.takeoff(height))

    def hold(self) -> None:
        """Each stops and stays."""
        self.each(lambda vehicle: vehicle.hold(), "hold")

    def return_home(self) -> None:
        """Each to its own home: drones land there, rovers stop."""
        self.each(lambda vehicle: vehicle.return_home(), "return home")

    def land(self) -> None:
        """All drones, where they are; rovers stop."""
        self.each(lambda one: one.land() if isinstance(one, Drone) else one.hold(), "land")

    def _drones(self, asked: str, function: Callable[[Drone], None]) -> None:
        self.each(lambda one: function(one) if isinstance(one, Drone) else None, asked)


class _Round:
    """One group operation under way."""

    def __init__(
        self,
        kernel: Kernel,
        asked: str,
        vehicles: Mapping[str, Vehicle],
        function: Callable[[Any], Any],
    ) -> None:
        self._kernel = kernel
        self._asked = asked
        self._vehicles = vehicles
        self._function = function
        self._returned: dict[str, Any] = {}
        self._failed: dict[str, Exception] = {}
        self._changed = Signal(kernel, f"{asked}: {', '.join(vehicles)}")

    def run(self) -> dict[str, Any]:
        """Start all, wait for all."""
        with self._kernel as kernel:
            caller = current_task(kernel)
            scope = caller.scope.child(self._asked)
            tasks = [self._start(name, caller, scope) for name in self._vehicles]
        try:
            self._changed.wait_for(lambda: all(task.done for task in tasks) or self._complete())
        except BaseException:
            with self._kernel.guard:
                self._kernel.cancel(scope, f"{self._asked}: whoever asked for it was stopped")
            raise
        finally:
            with self._kernel.guard:
                if self._complete() and scope in caller.scope.children:
                    caller.scope.children.remove(scope)
        if self._failed:
            raise FleetError(self._asked, {name: self._failed[name] for name in self._in_order(self._failed)})
        return {name: self._returned[name] for name in self._in_order(self._returned)}

    def _in_order(self, found: Mapping[str, Any]) -> list[str]:
        return [name for name in self._vehicles if name in found]

    def _complete(self) -> bool:
        return len(self._returned) + len(self._failed) == len(self._vehicles)

    def _start(self, name: str, caller: Task, scope: Scope) -> Task:
        def body() -> None:
            try:
                returned = self._function(self._vehicles[name])
            except Exception as error:
                with self._kernel.guard:
                    self._failed[name] = error
            else:
                with self._kernel.guard:
                    self._returned[name] = returned
            self._changed.notify()

        return self._kernel.spawn(body, f"{self._asked}: {name}", caller.context, scope)
