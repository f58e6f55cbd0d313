"""``fly``: mission code on simulated or real vehicles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from volery.base.errors import ComponentError, UsageError, VoleryError, choices
from volery.base.garbage import seldom_collected
from volery.base.position import AMSL, Position
from volery.components.component_api import register_kernel
from volery.components.instance import describe
from volery.components.loader import Loader
from volery.components.programs import load_function
from volery.components.virtual_stdlib import virtual_modules
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.requirements.accounts import FRAMEWORK
from volery.run.assembly.observed_vehicles import ObservedVehicles
from volery.run.assembly.vehicles import OpenedVehicles, VehicleSettings, open_vehicles
from volery.run.ending import Ending
from volery.run.last_defence import LastDefence
from volery.run.recording import Recording
from volery.run.result import DEFAULT_OPTIONS, LostLinkReporter, Options, ProgressReporter, Run, Tell
from volery.trace.attachments import (
    WORLD_ATTACHMENT,
    Origin,
    RunSetup,
    Scenery,
    VehicleSetup,
    to_json,
)
from volery.trace.events import WARNING, Failure, Text
from volery.trace.mcap_writer import Attachment
from volery.vehicles import Drone, Fence, Limits, Rover, Vehicle
from volery.vehicles.address import parse

Mission = Callable[[Any], object]
"""``def mission(drone: Drone)``, or ``def mission(rover: Rover)``."""

FUNCTION = "mission"


@dataclass(frozen=True, kw_only=True)
class Restrictions:
    """Limits that override those of a mission file.

    Attributes:
        fence: Geofence in the place of the file's ``FENCE``.
        highest: Greatest height above home in metres.
        battery_reserve: Battery reserve, 0 to 1.
    """

    fence: Fence | None = None
    highest: float | None = None
    battery_reserve: float | None = None

    def applied_to(self, limits: Limits | None) -> Limits | None:
        """Return *limits* with these restrictions."""
        stated = {"highest": self.highest, "battery_reserve": self.battery_reserve}
        changed = {name: value for name, value in stated.items() if value is not None}
        return replace(limits or Limits(), **changed) if changed else limits


NO_RESTRICTIONS = Restrictions()


@seldom_collected()
def fly(
    mission: Mission | str | Path,
    on: str | Sequence[str],
    options: Options = DEFAULT_OPTIONS,
    restrictions: Restrictions = NO_RESTRICTIONS,
) -> Run:
    """Fly a mission on one or several vehicles and return its record.

    Simulated vehicles fly in virtual time, real ones in real time. The annotation of the mission's parameter
    chooses ``Drone`` (also without an annotation) or ``Rover``.

    Args:
        mission: A function of one vehicle, or a Python file that defines ``mission``. The file may also
            define ``HOME`` (of simulated vehicles), ``FENCE`` and ``LIMITS``.
        on: Address of the vehicle, such as ``sim:ardupilot``, or several. With several addresses all vehicles
            fly the mission at the same time.
        options: Seed, pace, run folder and progress reports.
        restrictions: Override ``FENCE`` and ``LIMITS`` of the file.

    Returns:
        The run. An error during the flight is its ``error`` and is not raised.

    Raises:
        UsageError: An address, the file or its definitions are wrong; nothing has started.
        CapabilityError: The vehicles cannot be flown together or in this way; nothing has started.
    """
    if options.record_topics:
        raise UsageError(
            f"record {options.record}: a mission has no topics of its own; record those of a real graph "
            "with `volery ros bag record`, and those of a model with `volery simulate --record`"
        )
    urls = [on] if isinstance(on, str) else list(on)
    if not urls:
        raise UsageError("fly: no address is given; sim:ardupilot is one")
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
        function = mission if callable(mission) else load_function(Loader(), Path(mission), FUNCTION)
        stated = VehicleSettings(
            seed=options.seed,
            pace=options.pace,
            home=home_of(function),
            limits=restrictions.applied_to(_global_of(function, "LIMITS", Limits)),
            fence=restrictions.fence or _global_of(function, "FENCE", Fence),
            run_folder=options.folder,
            tell=options.tell,
        )
        named = names_of(urls)
        self._opened: OpenedVehicles = open_vehicles(named, dict.fromkeys(named, kind_of(function)), stated)
        self._kernel = kernel = self._opened.kernel
        self._mission = self._load(mission, options.seed)
        self._ending = Ending(kernel)
        self._defences: dict[str, LastDefence] = {}
        if options.if_killed is not None:
            self._defences = {
                vehicle.name: LastDefence(vehicle, options.if_killed) for vehicle in self._opened.vehicles
            }
        self._ending.vehicles = [
            self._defences.get(vehicle.name, vehicle) for vehicle in self._opened.vehicles
        ]
        setup, attachments = self._setup(urls, options.seed)
        self._recording = Recording(setup, options.folder, attachments, traced=options.traced)
        kernel.record = self._recording.stream
        if options.log is not None:
            self._recording.log_into(options.log)
        if options.tell is not None:
            self._recording.stream.tap(LostLinkReporter(options.tell))
            self._tell_home(options.tell, urls, stated.home)
        self._states = self._opened.fleet or ObservedVehicles(kernel, self._opened.vehicles)
        self._states.sample()
        if options.show is not None:
            self._recording.stream.tap(ProgressReporter(kernel, 0, self._states.progress, options.show))
        self._flying = len(self._opened.vehicles)

    def _tell_home(self, tell: Tell, urls: Sequence[str], home: Position | None) -> None:
        """Report where simulated vehicles fly if neither the mission nor an address states it."""
        if (
            self._opened.fleet is None
            or home is not None
            or all("home" in parse(url).options for url in urls)
        ):
            return
        here = self._opened.fleet.frame
        position = Position(here.latitude, here.longitude, AMSL(here.amsl))
        by_file = "HOME = Position(...) in the mission's file" if self._path is not None else ""
        moves = by_file or "home=LATITUDE,LONGITUDE,ALTITUDE in the address"
        tell(f"no HOME is stated: it flies at {position}; {moves} moves it")

    def _load(self, mission: Mission | str | Path, seed: int) -> Mission:
        """Return the mission; in virtual time a file gets virtual ``time`` and ``random`` modules."""
        if callable(mission):
            return mission
        modules = virtual_modules(self._kernel, seed) if isinstance(self._kernel, VirtualKernel) else {}
        loaded: Mission = load_function(Loader(modules), Path(mission), FUNCTION)
        return loaded

    def _setup(self, urls: Sequence[str], seed: int) -> tuple[RunSetup, list[Attachment]]:
        """Return the header of the trace, the map, and the text of the mission file."""
        opened, path = self._opened, self._path
        vehicles = tuple(
            VehicleSetup(
                vehicle.name,
                parse(url).driver,
                "multirotor" if isinstance(vehicle, Drone) else "rover",
                opened.fleet.program(vehicle.name) if opened.fleet else "",
            )
            for vehicle, url in zip(opened.vehicles, urls, strict=True)
        )
        fidelity = "hardware"
        if opened.fleet is not None:
            fidelity = "firmware" if any(vehicle.firmware for vehicle in vehicles) else "code"
        setup = RunSetup(path.stem if path else "mission", fidelity, seed=seed, vehicles=vehicles)
        attachments = []
        if opened.fleet is not None:
            origin = opened.fleet.frame
            scenery = Scenery(Origin(origin.latitude, origin.longitude, origin.amsl))
            attachments.append(Attachment(WORLD_ATTACHMENT, "application/json", to_json(scenery)))
        if path is not None:
            attachments.append(Attachment(path.name, "text/x-python", path.read_bytes()))
        return setup, attachments

    def run(self) -> Run:
        """Start, let time pass, end in order and finish the recording, even after an internal error."""
        kernel, ending = self._kernel, self._ending
        register_kernel(kernel)
        for vehicle in self._opened.vehicles:
            name = f"mission of {vehicle.name}"
            kernel.spawn(partial(self._fly, vehicle), name, ExecutionContext(FUNCTION), ending.users)
        left: Sequence[str] = ()
        with ending.signals():  # a terminal that is closed does not end the writing of the record either
            try:
                left = ending.pass_time()
            except BaseException as fault:
                ending.stop_hard("failed", f"{type(fault).__name__}: {fault}")
                raise
            finally:
                for vehicle in self._opened.vehicles:
                    vehicle.close()
                self._opened.leave()
                self._states.record_states()
                for remark in self._opened.fleet.remarks() if self._opened.fleet else ():
                    kernel.record(Text(kernel.now(), FRAMEWORK, WARNING, remark))
                record = self._recording.finish(ending.status, ending.reason, kernel.now(), ())
        return Run(
            record,
            self._recording.folder,
            ending.error,
            tuple(left),
            tuple(self._recording.problems),
            tuple(self._recording.notes),
            self._recording.accounts.observables(kernel.now()),
        )

    def _fly(self, vehicle: Vehicle) -> None:
        try:
            vehicle.wait_connected()
            if vehicle.name in self._defences:
                self._defences[vehicle.name].ask()
            self._mission(vehicle)
        except VoleryError as error:
            self._fail(error)
        except Exception as error:
            failed = ComponentError(FUNCTION, describe(error))
            failed.__cause__ = error
            self._fail(failed)
        self._flying -= 1
        if not self._flying:
            with self._kernel.guard:
                self._ending.begin("completed", "the mission is over")

    def _fail(self, error: VoleryError) -> None:
        with self._kernel.guard:
            self._kernel.record(Failure(self._kernel.now(), FUNCTION, str(error)))
            self._ending.failed(FUNCTION, error)


def kind_of(mission: Mission) -> type[Vehicle]:
    """Return ``Rover`` if the mission's parameter is annotated so, else ``Drone``."""
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
    """Return the addresses by vehicle name: that of the driver, with a number if there are several."""
    if len(urls) == 1:
        return {parse(urls[0]).driver: urls[0]}
    return {f"{parse(url).driver}_{number}": url for number, url in enumerate(urls, 1)}


def home_of(mission: Mission) -> Position | None:
    """Return the home of simulated vehicles: ``HOME`` of the mission's file, or None."""
    home = getattr(mission, "__globals__", {}).get("HOME")
    if home is not None and not (isinstance(home, Position) and isinstance(home.altitude, AMSL)):
        raise UsageError(f"HOME is {home!r}; write Position(LATITUDE, LONGITUDE, AMSL(METRES))")
    return home


T = TypeVar("T")


def _global_of(mission: Mission, name: str, kind: type[T]) -> T | None:
    """Return the global *name* of the mission's file, or None."""
    found = getattr(mission, "__globals__", {}).get(name)
    if found is not None and not isinstance(found, kind):
        raise UsageError(f"{name} is {found!r}; state it as volery.{kind.__name__}(...)")
    return found
