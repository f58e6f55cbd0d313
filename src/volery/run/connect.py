"""``connect``: a vehicle for a script or a REPL."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TypeVar

from volery.base.errors import CapabilityError, UsageError, VoleryError
from volery.base.position import Position
from volery.kernel.api import Kernel
from volery.kernel.virtual import VirtualKernel
from volery.kernel.wall import WallKernel
from volery.links.link import Link
from volery.run.airfield import Airfield
from volery.run.simulated import HOME, Simulated, airfield_of, link_to, simulated
from volery.vehicles import Drone, Rover, Vehicle
from volery.vehicles.address import Address, parse
from volery.vehicles.carriers import open_link
from volery.vehicles.driver import drivers

V = TypeVar("V", bound=Vehicle)

GRAPHS = ("graph", "ros1", "ros2")
SCRIPT = "script"
SIMULATED = {"texts": "unrecorded"}
"""Options of the driver of a simulated vehicle: its autopilot records its texts itself."""
KINDS: Mapping[type[Vehicle], str] = {Drone: "multirotor", Rover: "rover"}


@dataclass(frozen=True)
class Opened:
    """A kernel and the vehicles that were opened on it; ``airfield`` is ``None`` for vehicles that are out
    there.
    """

    kernel: VirtualKernel | WallKernel
    vehicles: tuple[Vehicle, ...]
    airfield: Airfield | None = None


@contextmanager
def connect(
    url: str,
    kind: type[V] = Drone,  # type: ignore[assignment]  # type variables have no defaults before Python 3.13
    *,
    seed: int = 1,
) -> Iterator[V]:
    """The vehicle at *url*, heard of, for as long as the context lasts: a ``Drone``, or *kind*.

    Works in a plain script and in a REPL. A simulated vehicle (``sim:ardupilot``) lives in virtual time: that
    passes while a call blocks and stands still while the script thinks. A real one lives in real time. When
    the context is left, an armed vehicle that nobody else has is brought down.

    Raises ``UsageError`` for an address that makes no sense, ``LinkSilent`` or ``LinkGarbled`` if no
    autopilot is heard there, ``CapabilityError`` if what answers is of another kind.
    """
    opened = open_vehicles([url], kind, seed=seed, pace=None)
    vehicle = opened.vehicles[0]
    assert isinstance(vehicle, kind)
    kernel = opened.kernel
    if isinstance(kernel, WallKernel):
        kernel.start()
    try:
        with kernel.adopt(SCRIPT):
            vehicle.wait_heard()
            try:
                yield vehicle
            finally:
                with suppress(VoleryError):
                    vehicle.come_to_rest()
    finally:
        vehicle.close()
        kernel.close()


def open_vehicles(
    urls: list[str], kind: type[Vehicle], *, seed: int, pace: float | None, home: Position = HOME
) -> Opened:
    """Open all of *urls*: either simulated ones, in one world at *home*, or real ones."""
    addresses = [parse(url) for url in urls]
    names = _names(addresses)
    if any(address.carrier != "sim" for address in addresses):
        return _open_real(addresses, names, kind)
    wanted = [
        simulated(address, name, KINDS[kind], home) for address, name in zip(addresses, names, strict=True)
    ]
    kernel = VirtualKernel(pace=pace)
    airfield = airfield_of(kernel, wanted, seed)
    vehicles = tuple(_simulated_vehicle(kernel, airfield, one, kind, seed) for one in wanted)
    return Opened(kernel, vehicles, airfield)


def _names(addresses: list[Address]) -> list[str]:
    if len(addresses) == 1:
        return [addresses[0].driver]
    return [f"{address.driver}_{number}" for number, address in enumerate(addresses, start=1)]


def _simulated_vehicle(
    kernel: Kernel, airfield: Airfield, wanted: Simulated, kind: type[Vehicle], seed: int
) -> Vehicle:
    name, autopilot = wanted.vehicle.name, wanted.vehicle.autopilot
    open_driver = drivers.load(autopilot).on_link
    if open_driver is None:
        raise CapabilityError(f"{name}: {autopilot} is reached over a graph only")
    driver = open_driver(kernel, link_to(kernel, airfield, wanted, seed), name, SIMULATED)
    return kind(kernel, name, driver, truth=airfield.truth(name))


def _open_real(addresses: list[Address], names: list[str], kind: type[Vehicle]) -> Opened:
    for address in addresses:
        if address.carrier == "sim":
            raise CapabilityError(
                f"{address}: simulated and real vehicles do not share a clock; fly them apart"
            )
        if address.carrier in GRAPHS:
            raise CapabilityError(f"{address}: vehicles on a graph are commanded by components of a model")
    kernel = WallKernel()
    links: list[Link] = []
    try:
        vehicles = []
        for address, name in zip(addresses, names, strict=True):
            factory = drivers.load(address.driver)
            if factory.on_link is None:
                raise UsageError(f"{address}: {address.driver} is reached over a graph, not over bytes")
            links.append(open_link(kernel, address, factory.codec))
            driver = factory.on_link(kernel, links[-1], name, _for_driver(address))
            vehicles.append(kind(kernel, name, driver))
    except VoleryError:
        for link in links:
            link.close()
        raise
    return Opened(kernel, tuple(vehicles))


def _for_driver(address: Address) -> dict[str, str]:
    """Options of the address that are not for the carrier."""
    return {key: value for key, value in address.options.items() if key != "baud"}
