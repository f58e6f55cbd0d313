"""``fly``: mission code on vehicles, simulated or real."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from volery.base.errors import ComponentError, UsageError, VoleryError, choices
from volery.base.position import AMSL, Position
from volery.components.component_api import register_kernel
from volery.components.instance import describe
from volery.components.loader import Loader
from volery.components.programs import load_function
from volery.components.virtual_stdlib import virtual_modules
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.run.assembly.simulated_vehicles import HOME
from volery.run.assembly.vehicles import ObservedVehicles, OpenedVehicles, VehicleSettings, open_vehicles
from volery.run.ending import Ending
from volery.run.progress import LostLinkReporter, ProgressReporter
from volery.run.recording import Recording
from volery.run.result import DEFAULT_OPTIONS, Options, Run
from volery.run.trace_setup import setup_of_flight
from volery.trace.events import Failure
from volery.vehicles import Drone, Fence, Limits, Rover, Vehicle
from volery.vehicles.address import parse

Mission = Callable[[Any], object]
"""``def mission(drone: Drone)``, or ``def mission(rover: Rover)``."""

FUNCTION = "mission"


@dataclass(frozen=True, kw_only=True)
class Restrictions:
    """What holds instead of what a mission's file states: ``fence`` for its ``FENCE``; ``highest`` (metres
    above home) and ``battery_reserve`` (0..1) for those of its ``LIMITS``.
    """

    fence: Fence | None = None
    highest: float | None = None
    battery_reserve: float | None = None

    def applied_to(self, limits: Limits | None) -> Limits | None:
        """*limits* with what is stated here."""
        stated = {"highest": self.highest, "battery_reserve": self.battery_reserve}
        changed = {name: value for name, value in stated.items() if value is not None}
        return replace(limits or Limits(), **changed) if changed else limits


NO_RESTRICTIONS = Restrictions()


def fly(
    mission: Mission | str | Path,
    on: str | Sequence[str],
    options: Options = DEFAULT_OPTIONS,
    restrictions: Restrictions = NO_RESTRICTIONS,
) -> Run:
    """Fly *mission* (a function, or a file that defines ``mission``) on the vehicle at the address *on*.

    A file's ``HOME`` is where simulated vehicles stand, its ``FENCE`` and ``LIMITS`` hold for all vehicles;
    *restrictions* override these. With several addresses each vehicle flies it, all at once. The parameter's
    annotation says whether the mission is for a ``Drone`` (also without one) or a ``Rover``. Simulated
    vehicles fly in virtual time, real ones in real time.

    Raises ``UsageError`` and ``ModelError`` before anything has started; what happens later is in the
    ``Run``.
    """
    urls = [on] if isinstance(on, str) else list(on)
    if not urls:
        raise UsageError("fly: no address to fly on; sim:ardupilot is one")
    return _Flight(mission, urls, options, restrictions).run()


class _Flight:
    """One execution of ``fly``."""

    def __init__(
        self,
        mission: Mission | str | Path,
        urls: list[str],
        options: Options,
        restrictions: Restrictions,
    ) -> None:
        self._path = None if callable(mission) else Path(mission)
        looked_at = mission if callable(mission) else load_function(Loader(), Path(mission), FUNCTION)
        stated = VehicleSettings(
            seed=options.seed,
            pace=options.pace,
            home=home_of(looked_at),
            limits=restrictions.applied_to(_beside(looked_at, "LIMITS", Limits)),
            fence=restrictions.fence or _beside(looked_at, "FENCE", Fence),
        )
        named = names_of(urls)
        self._opened: OpenedVehicles = open_vehicles(named, dict.fromkeys(named, kind_of(looked_at)), stated)
        self._kernel = kernel = self._opened.kernel
        self._mission = self._load(mission, options.seed)
        self._ending = Ending(kernel)
        self._ending.vehicles = self._opened.vehicles
        setup, attachments = setup_of_flight(self._path, urls, self._opened, options.seed)
        self._recording = Recording(setup, options.out, attachments)
        kernel.record = self._recording.stream
        if options.tell is not None:
            self._recording.stream.tap(LostLinkReporter(options.tell))
        self._states = self._opened.fleet or ObservedVehicles(kernel, self._opened.vehicles)
        self._states.sample()
        if options.show is not None:
            self._recording.stream.tap(ProgressReporter(kernel, 0, self._states.progress, options.show))
        self._under_way = len(self._opened.vehicles)

    def _load(self, mission: Mission | str | Path, seed: int) -> Mission:
        """In virtual time a file gets stand-ins for ``time`` and ``random``, as a component's does."""
        if callable(mission):
            return mission
        modules = virtual_modules(self._kernel, seed) if isinstance(self._kernel, VirtualKernel) else {}
        loaded: Mission = load_function(Loader(modules), Path(mission), FUNCTION)
        return loaded

    def run(self) -> Run:
        """Start, let time pass, end in order, close the books; also if the house itself has a fault."""
        kernel, ending = self._kernel, self._ending
        register_kernel(kernel)
        for vehicle in self._opened.vehicles:
            name = f"mission of {vehicle.name}"
            kernel.spawn(partial(self._fly, vehicle), name, ExecutionContext(FUNCTION), ending.users)
        left: Sequence[str] = ()
        try:
            with ending.signals():
                left = ending.pass_time()
        except BaseException as fault:
            ending.stop_hard("failed", f"{type(fault).__name__}: {fault}")
            raise
        finally:
            for vehicle in self._opened.vehicles:
                vehicle.close()
            self._opened.leave()
            self._states.record_states()
            record = self._recording.finish(ending.status, ending.reason, kernel.now(), ())
        return Run(record, self._recording.folder, ending.error, tuple(left), tuple(self._recording.problems))

    def _fly(self, vehicle: Vehicle) -> None:
        try:
            vehicle.wait_connected()
            self._mission(vehicle)
        except VoleryError as error:
            self._fail(error)
        except Exception as error:
            failed = ComponentError(FUNCTION, describe(error))
            failed.__cause__ = error
            self._fail(failed)
        self._under_way -= 1
        if not self._under_way:
            with self._kernel.guard:
                self._ending.begin("completed", "the mission is over")

    def _fail(self, error: VoleryError) -> None:
        with self._kernel.guard:
            self._kernel.record(Failure(self._kernel.now(), FUNCTION, str(error)))
            self._ending.failed(FUNCTION, error)


def kind_of(mission: Mission) -> type[Vehicle]:
    """``Drone`` or ``Rover``: what the mission's first parameter is annotated with, a drone if it is not."""
    try:
        names = list(signature(mission).parameters)
        hints = get_type_hints(mission)
    except (TypeError, ValueError, NameError):
        return Drone
    if len(names) != 1:
        raise UsageError(
            f"a mission takes one vehicle, as in mission(drone: Drone); this one takes {choices(names)}"
        )
    hint = hints.get(names[0], Drone)
    return Rover if hint is Rover else Drone


def names_of(urls: Sequence[str]) -> dict[str, str]:
    """The addresses by the names of their vehicles: the autopilot's, with a number if there are several."""
    autopilots = [parse(url).driver for url in urls]
    if len(urls) == 1:
        return {autopilots[0]: urls[0]}
    return {
        f"{autopilot}_{number}": url
        for number, (autopilot, url) in enumerate(zip(autopilots, urls, strict=True), 1)
    }


def home_of(mission: Mission) -> Position:
    """Where simulated vehicles stand: the ``HOME`` beside the mission in its file, if there is one."""
    home = getattr(mission, "__globals__", {}).get("HOME", HOME)
    if not isinstance(home, Position) or not isinstance(home.altitude, AMSL):
        raise UsageError(f"HOME is {home!r}; state it as Position(LATITUDE, LONGITUDE, AMSL(METRES))")
    return home


T = TypeVar("T")


def _beside(mission: Mission, name: str, kind: type[T]) -> T | None:
    """What the mission's file states under that *name*; ``None`` if it does not."""
    found = getattr(mission, "__globals__", {}).get(name)
    if found is not None and not isinstance(found, kind):
        raise UsageError(f"{name} is {found!r}; state it as volery.{kind.__name__}(...)")
    return found
