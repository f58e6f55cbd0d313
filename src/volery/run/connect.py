"""``connect`` and ``connect_fleet``: vehicles for a script or an interactive session.

What they return is a session: it ends with its ``with`` block, by ``close()``, or when Python exits.
"""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from logging import getLogger
from typing import TypeVar, overload

from volery.base.errors import UsageError, VoleryError
from volery.base.process import interrupted_by_signals, without_hang_ups
from volery.kernel.wall import WallKernel
from volery.run.assembly.vehicles import OpenedVehicles, VehicleSettings, open_vehicles
from volery.run.ending import Landable
from volery.run.last_defence import LastDefence
from volery.vehicles import Drone, Fence, Fleet, Limits, Vehicle
from volery.vehicles.address import parse
from volery.vehicles.driver import LinkLossAction

V = TypeVar("V", bound=Vehicle)

SCRIPT = "script"

LOCATED_WITHIN_S = 90.0
"""Longest wait for a position: a receiver that has just been switched on takes about a minute."""


@overload
def connect(
    url: str,
    *,
    seed: int = 1,
    limits: Limits | None = None,
    fence: Fence | None = None,
    within: float = LOCATED_WITHIN_S,
    if_killed: LinkLossAction | None = None,
) -> Drone: ...


@overload
def connect(
    url: str,
    kind: type[V],
    *,
    seed: int = 1,
    limits: Limits | None = None,
    fence: Fence | None = None,
    within: float = LOCATED_WITHIN_S,
    if_killed: LinkLossAction | None = None,
) -> V: ...


def connect(
    url: str,
    kind: type[Vehicle] = Drone,
    *,
    seed: int = 1,
    limits: Limits | None = None,
    fence: Fence | None = None,
    within: float = LOCATED_WITHIN_S,
    if_killed: LinkLossAction | None = None,
) -> Vehicle:
    """Connect to the vehicle at *url* and return it as soon as it knows where it is.

    ```python
    drone = volery.connect("sim:px4")  # a notebook or a REPL
    with volery.connect("sim:px4") as drone:  # a script
        drone.takeoff(10)
    ```

    While a real one does not know where it is, the logger ``volery`` says every few seconds what is missing.
    A simulated vehicle (``sim:ardupilot``) lives in virtual time, which passes only while a call blocks. A
    real vehicle lives in real time. The connection ends with the ``with`` block, by ``close()``, or when
    Python exits: then an armed vehicle lands, unless an operator has taken it over. SIGTERM and a closed
    terminal (SIGHUP) interrupt the script as Ctrl-C does, if it has no handlers of its own.

    Args:
        url: Address, such as ``sim:px4`` or ``ardupilot+serial:///dev/ttyUSB0``.
        kind: ``Drone`` or ``Rover``.
        seed: Seed of the simulation.
        limits: Limits that every operation must keep.
        fence: Geofence that every operation must keep.
        within: Longest time to wait for position and home, s; 0 does not wait, as indoors.
        if_killed: What the autopilot does by itself if this program is killed: ``return``, ``land`` or
            ``hover``. Its parameters are set, and restored at the end.

    Raises:
        UsageError: The address is wrong, or the fence excludes home.
        NotArrived: Position or home are not known in time.
        LinkSilent: No autopilot answers at the address.
        LinkGarbled: Something else than the expected protocol arrives.
        CapabilityError: The autopilot that answers is of another kind, or cannot be asked for *if_killed*.
    """
    name = parse(url).driver
    with ExitStack() as opening:
        settings = VehicleSettings(seed=seed, limits=limits, fence=fence)
        opened = opening.enter_context(_opened({name: url}, {name: kind}, settings))
        vehicle = opened.vehicles[0]
        assert isinstance(vehicle, kind)
        vehicle.wait_connected()
        vehicle.wait_located(within, _teller(opened))
        opening.enter_context(_ending(_defended(vehicle, if_killed).come_to_rest))
        vehicle.at_end = _until_exit(opening, opened)
    return vehicle


def attach(url: str, kind: type[Vehicle] = Drone, *, seed: int = 1) -> Vehicle:
    """Connect to the vehicle at *url* without commanding it: an armed vehicle flies on at the end.

    For tools that read or set parameters, plans and logs. It does not wait for a position.

    Args:
        url: Address, as of ``connect``.
        kind: ``Drone`` or ``Rover``.
        seed: Seed of the simulation.

    Raises:
        VoleryError: As for ``connect``.
    """
    name = parse(url).driver
    with ExitStack() as opening:
        opened = opening.enter_context(_opened({name: url}, {name: kind}, VehicleSettings(seed=seed)))
        vehicle = opened.vehicles[0]
        assert isinstance(vehicle, kind)
        vehicle.wait_connected()
        vehicle.at_end = _until_exit(opening, opened)
    return vehicle


def connect_fleet(
    urls: Mapping[str, str],
    kind: type[Vehicle] | Mapping[str, type[Vehicle]] = Drone,
    *,
    seed: int = 1,
    limits: Limits | None = None,
    fence: Fence | None = None,
    within: float = LOCATED_WITHIN_S,
    if_killed: LinkLossAction | None = None,
) -> Fleet:
    """Connect to several vehicles, as ``connect`` does to one, and return them as a fleet.

    ```python
    with connect_fleet({"a": "sim:px4", "b": "sim:ardupilot"}) as fleet:
        fleet.takeoff(10)
        fleet["a"].goto(...)
    ```

    The autopilots may differ. Either all vehicles are simulated, in one world and on one clock, or all are
    real. Vehicles behind one radio or one UDP port need a system id: ``ardupilot+udp://:14550?system=2``.

    Args:
        urls: Addresses by vehicle name.
        kind: Kind of all vehicles, or of each by name; a vehicle without an entry is a ``Drone``.
        seed: Seed of the simulation.
        limits: Limits of each vehicle.
        fence: Geofence of each vehicle.
        within: Longest time to wait for positions and homes, s; 0 does not wait.
        if_killed: What each autopilot does by itself if this program is killed, as of ``connect``.

    Raises:
        FleetError: Some of the vehicles do not answer, or do not know where they are in time.
        VoleryError: As for ``connect``.
    """
    if not urls:
        raise UsageError("a fleet needs at least one vehicle; give its name and its address")
    kinds = {name: kind if isinstance(kind, type) else kind.get(name, Drone) for name in urls}
    with ExitStack() as opening:
        settings = VehicleSettings(seed=seed, limits=limits, fence=fence)
        opened = opening.enter_context(_opened(urls, kinds, settings))
        fleet = Fleet({vehicle.name: vehicle for vehicle in opened.vehicles})
        fleet.each(lambda vehicle: vehicle.wait_connected(), "connect")
        fleet.each(lambda vehicle: vehicle.wait_located(within, _teller(opened)), "know where they are")
        defended = {vehicle.name: _defended(vehicle, if_killed) for vehicle in opened.vehicles}
        opening.enter_context(
            _ending(lambda: fleet.each(lambda one: defended[one.name].come_to_rest(), "come to rest"))
        )
        fleet.at_end = _until_exit(opening, opened)
    return fleet


def _defended(vehicle: Vehicle, if_killed: LinkLossAction | None) -> Landable:
    """Ask the autopilot for its last line of defence, if one is wanted, and return what brings it to rest."""
    if if_killed is None:
        return vehicle
    defence = LastDefence(vehicle, if_killed)
    defence.ask()
    return defence


def _teller(opened: OpenedVehicles) -> Callable[[str], object] | None:
    """Return what reports a wait; None in virtual time, where it takes no time."""
    return getLogger("volery").warning if isinstance(opened.kernel, WallKernel) else None


def _until_exit(opening: ExitStack, opened: OpenedVehicles) -> ExitStack:
    """Return what *opening* has opened, to be ended by a session; by the exit of Python at the latest.

    Virtual time passes in its own thread only, so a simulated vehicle of another thread is left to end with
    the process.
    """
    kept = opening.pop_all()
    thread = None if isinstance(opened.kernel, WallKernel) else threading.get_ident()

    def end() -> None:
        if thread in (None, threading.get_ident()):
            try:
                kept.close()
            except VoleryError as error:
                getLogger("volery").error("at the end of the program: %s", error)

    atexit.register(end)
    kept.callback(atexit.unregister, end)
    return kept


@contextmanager
def _ending(come_to_rest: Callable[[], object]) -> Iterator[None]:
    """Bring vehicles to rest at the end of the context.

    If that fails they may still fly, so the error is raised, or added as a note to the one under way.
    """
    try:
        yield
    except BaseException as failure:
        try:
            with without_hang_ups():
                come_to_rest()
        except VoleryError as error:
            failure.add_note(f"at the end of the program: {error}")
        raise
    with without_hang_ups():
        come_to_rest()


@contextmanager
def _opened(
    urls: Mapping[str, str], kinds: Mapping[str, type[Vehicle]], stated: VehicleSettings
) -> Iterator[OpenedVehicles]:
    """Open vehicles for the calling thread and close them at the end."""
    opened = open_vehicles(urls, kinds, stated)
    kernel = opened.kernel
    if isinstance(kernel, WallKernel):
        kernel.start()
    try:
        with interrupted_by_signals(), kernel.adopt(SCRIPT):
            yield opened
    finally:
        for vehicle in opened.vehicles:
            vehicle.disconnect()
        opened.leave()
        kernel.close()
