"""A fleet: vehicles by name, and operations for all of them at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

from volery.base.errors import FleetError, UsageError, choices, did_you_mean
from volery.kernel.api import Kernel
from volery.kernel.task import Scope, Task
from volery.kernel.waiting import Signal, current_task
from volery.vehicles.drone import Drone
from volery.vehicles.session import Session
from volery.vehicles.vehicle import READY_WITHIN_S, Vehicle

R = TypeVar("R")


class Fleet(Mapping[str, Vehicle], Session):
    """Vehicles by name, on one clock, of any kinds and autopilots.

    A group operation starts on all vehicles at once and returns when the last one is done. A failure does not
    stop the others; ``FleetError`` then names the vehicles that failed and their errors. For a part of the
    vehicles, make a fleet of these: ``Fleet({name: fleet[name] for name in ("a", "b")})``.

    Args:
        vehicles: vehicles by name; at least one.
    """

    def __init__(self, vehicles: Mapping[str, Vehicle]) -> None:
        if not vehicles:
            raise UsageError("a fleet of no vehicles; give at least one")
        self._vehicles = dict(vehicles)
        kernels = {id(vehicle.kernel): vehicle.kernel for vehicle in self._vehicles.values()}
        if len(kernels) > 1:
            raise UsageError("a fleet whose vehicles are not on one clock; connect them with connect_fleet")
        (self._kernel,) = kernels.values()
        Session.__init__(self, lambda: None)  # the vehicles of a part belong to the whole fleet

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
        """Call ``function(vehicle)`` for all vehicles at once, each in its own task.

        Args:
            function: operation on one vehicle.
            asked: the operation in words, for messages; by default the function's name.

        Returns:
            What the calls returned, by name of the vehicle.

        Raises:
            FleetError: at least one call raised an error; raised after the last call has ended.
        """
        named = getattr(function, "__name__", "each")
        asked = asked or (named if named.isidentifier() else "each")
        return _GroupOperation(self._kernel, asked, self._vehicles, function).run()

    def wait_ready(self, within: float = READY_WITHIN_S) -> None:
        """Wait until each vehicle could arm and go to a position.

        Args:
            within: time-out, s.
        """
        self.each(lambda vehicle: vehicle.wait_ready(within), "be ready")

    def takeoff(self, height: float) -> None:
        """Take off with all drones; rovers stay.

        Args:
            height: height above the home of each, m.
        """
        asked = f"take off to {height:g} m"
        self.each(lambda one: one.takeoff(height) if isinstance(one, Drone) else None, asked)

    def hold(self) -> None:
        """Stop all vehicles and hold their positions."""
        self.each(lambda vehicle: vehicle.hold(), "hold")

    def return_home(self) -> None:
        """Return each vehicle to its own home; drones land there, rovers stop."""
        self.each(lambda vehicle: vehicle.return_home(), "return home")

    def land(self) -> None:
        """Land all drones in place; rovers stop."""
        self.each(lambda one: one.land() if isinstance(one, Drone) else one.hold(), "land")


class _GroupOperation:
    """One group operation in progress."""

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
        """Start all tasks and wait for all of them."""
        with self._kernel.joined():
            return self._run()

    def _run(self) -> dict[str, Any]:
        kernel = self._kernel
        with kernel.interact():
            caller = current_task(kernel)
            scope = caller.scope.child(self._asked)
            tasks = [self._start(name, caller, scope) for name in self._vehicles]
        try:
            self._changed.wait_for(lambda: all(task.done for task in tasks) or self._complete())
        except BaseException:
            with self._kernel.guard:
                self._kernel.cancel(scope, f"{self._asked}: its caller was stopped")
            raise
        finally:
            with self._kernel.guard:
                if self._complete() and scope in caller.scope.children:
                    caller.scope.children.remove(scope)
        if self._failed:
            raise FleetError(self._asked, self._in_order(self._failed))
        return self._in_order(self._returned)

    def _in_order(self, found: Mapping[str, Any]) -> dict[str, Any]:
        return {name: found[name] for name in self._vehicles if name in found}

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
