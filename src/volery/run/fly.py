"""``fly``: mission code on vehicles, simulated or real."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, get_type_hints

from volery.base.errors import ComponentError, UsageError, VoleryError, choices
from volery.base.position import AMSL, Position
from volery.components.instance import describe
from volery.components.loading import Loader
from volery.components.python import load_function
from volery.components.services import serve
from volery.components.stand_ins import stand_ins
from volery.kernel.task import Place
from volery.kernel.virtual import VirtualKernel
from volery.run.connect import Opened, open_vehicles
from volery.run.ending import Ending
from volery.run.progress import Reporter
from volery.run.recording import Recording
from volery.run.result import Run
from volery.run.setup import setup_of_flight
from volery.run.simulate import AS_USUAL, Options
from volery.run.simulated import HOME
from volery.trace.events import Failure
from volery.vehicles import Drone, Rover, Vehicle

Mission = Callable[[Any], object]
"""``def mission(drone: Drone)``, or ``def mission(rover: Rover)``."""

FUNCTION = "mission"


def fly(mission: Mission | str | Path, on: str | Sequence[str], options: Options = AS_USUAL) -> Run:
    """Fly *mission* (a function, or a file that defines ``mission``) on the vehicle at the address *on*.

    A file's ``HOME`` is where simulated vehicles stand. With several addresses each vehicle flies it, all at
    once. The parameter's annotation says whether the mission is for a ``Drone`` (also without one) or a
    ``Rover``. Simulated vehicles fly in virtual time, real ones in real time.

    Raises ``UsageError`` and ``ModelError`` before anything has started; what happens later is in the
    ``Run``.
    """
    urls = [on] if isinstance(on, str) else list(on)
    if not urls:
        raise UsageError("fly: no address to fly on; sim:ardupilot is one")
    return _Flight(mission, urls, options).run()


class _Flight:
    """One execution of ``fly``."""

    def __init__(self, mission: Mission | str | Path, urls: list[str], options: Options) -> None:
        self._path = None if callable(mission) else Path(mission)
        looked_at = mission if callable(mission) else load_function(Loader(), Path(mission), FUNCTION)
        self._opened: Opened = open_vehicles(
            urls, kind_of(looked_at), seed=options.seed, pace=options.pace, home=home_of(looked_at)
        )
        self._kernel = kernel = self._opened.kernel
        self._mission = self._load(mission, options.seed)
        self._ending = Ending(kernel)
        self._ending.vehicles = self._opened.vehicles
        setup, attachments = setup_of_flight(self._path, urls, self._opened, options.seed)
        self._recording = Recording(setup, options.out, attachments)
        kernel.record = self._recording.stream
        airfield = self._opened.airfield
        if airfield is not None:
            airfield.sample()
            if options.show is not None:
                self._recording.stream.tap(Reporter(kernel, airfield, 0, options.show))
        self._under_way = len(self._opened.vehicles)

    def _load(self, mission: Mission | str | Path, seed: int) -> Mission:
        """In virtual time a file gets stand-ins for ``time`` and ``random``, as a component's does."""
        if callable(mission):
            return mission
        modules = stand_ins(self._kernel, seed) if isinstance(self._kernel, VirtualKernel) else {}
        loaded: Mission = load_function(Loader(modules), Path(mission), FUNCTION)
        return loaded

    def run(self) -> Run:
        """Start, let time pass, end in order, close the books; also if the house itself has a fault."""
        kernel, ending = self._kernel, self._ending
        serve(kernel)
        for vehicle in self._opened.vehicles:
            name = f"mission of {vehicle.name}"
            kernel.spawn(partial(self._fly, vehicle), name, Place(FUNCTION), ending.users)
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
            if self._opened.airfield is not None:
                self._opened.airfield.record_states()
            record = self._recording.finish(ending.status, ending.reason, kernel.now(), ())
        return Run(record, self._recording.folder, ending.error, tuple(left), tuple(self._recording.problems))

    def _fly(self, vehicle: Vehicle) -> None:
        try:
            vehicle.wait_heard()
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


def home_of(mission: Mission) -> Position:
    """Where simulated vehicles stand: the ``HOME`` beside the mission in its file, if there is one."""
    home = getattr(mission, "__globals__", {}).get("HOME", HOME)
    if not isinstance(home, Position) or not isinstance(home.altitude, AMSL):
        raise UsageError(f"HOME is {home!r}; state it as Position(LATITUDE, LONGITUDE, AMSL(METRES))")
    return home
