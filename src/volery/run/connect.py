"""``connect`` and ``connect_fleet``: vehicles for a script or a REPL."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import TypeVar

from volery.base.errors import UsageError, VoleryError
from volery.kernel.wall import WallKernel
from volery.run.assembly.vehicles import OpenedVehicles, VehicleSettings, open_vehicles
from volery.vehicles import Drone, Fence, Fleet, Limits, Vehicle
from volery.vehicles.address import parse

V = TypeVar("V", bound=Vehicle)

SCRIPT = "script"


@contextmanager
def connect(
    url: str,
    kind: type[V] = Drone,  # type: ignore[assignment]  # type variables have no defaults before Python 3.13
    *,
    seed: int = 1,
    limits: Limits | None = None,
    fence: Fence | None = None,
) -> Iterator[V]:
    """The vehicle at *url*, heard of, for as long as the context lasts: a ``Drone``, or *kind*.

    Works in a plain script and in a REPL. A simulated vehicle (``sim:ardupilot``) lives in virtual time: that
    passes while a call blocks and stands still while the script thinks. A real one lives in real time. When
    the context is left, an armed vehicle that nobody else has is brought down.

    Raises ``UsageError`` for an address that makes no sense, ``LinkSilent`` or ``LinkGarbled`` if no
    autopilot is heard there, ``CapabilityError`` if what answers is of another kind.
    """
    name = parse(url).driver
    with _opened({name: url}, {name: kind}, VehicleSettings(seed=seed, limits=limits, fence=fence)) as opened:
        vehicle = opened.vehicles[0]
        assert isinstance(vehicle, kind)
        vehicle.wait_connected()
        try:
            yield vehicle
        finally:
            with suppress(VoleryError):
                vehicle.come_to_rest()


@contextmanager
def connect_fleet(
    urls: Mapping[str, str],
    kind: type[Vehicle] | Mapping[str, type[Vehicle]] = Drone,
    *,
    seed: int = 1,
    limits: Limits | None = None,
    fence: Fence | None = None,
) -> Iterator[Fleet]:
    """Several vehicles, by the names that *urls* gives them, all heard of: as ``connect`` does for one.

    ```python
    with connect_fleet({"a": "sim:px4", "b": "sim:ardupilot"}) as fleet:
        fleet.takeoff(10)
        fleet["a"].goto(...)
    ```

    Any mix of autopilots, all simulated (in one world, on one clock) or all real. Vehicles behind one radio
    or one UDP port say which they are: ``ardupilot+udp://:14550?system=2``. *kind* may differ by name; a
    vehicle that is not in it is a ``Drone``. *limits* and *fence* hold for each.

    Raises what ``connect`` raises; ``FleetError`` if some of them are not heard.
    """
    if not urls:
        raise UsageError("a fleet of no vehicles; give at least one name and its address")
    kinds = {name: kind if isinstance(kind, type) else kind.get(name, Drone) for name in urls}
    with _opened(urls, kinds, VehicleSettings(seed=seed, limits=limits, fence=fence)) as opened:
        fleet = Fleet({vehicle.name: vehicle for vehicle in opened.vehicles})
        fleet.each(lambda vehicle: vehicle.wait_connected(), "be heard")
        try:
            yield fleet
        finally:
            with suppress(VoleryError):
                fleet.each(lambda vehicle: vehicle.come_to_rest(), "come to rest")


@contextmanager
def _opened(
    urls: Mapping[str, str], kinds: Mapping[str, type[Vehicle]], stated: VehicleSettings
) -> Iterator[OpenedVehicles]:
    """Vehicles for the flow of control that calls this."""
    opened = open_vehicles(urls, kinds, stated)
    kernel = opened.kernel
    if isinstance(kernel, WallKernel):
        kernel.start()
    try:
        with kernel.adopt(SCRIPT):
            yield opened
    finally:
        for vehicle in opened.vehicles:
            vehicle.close()
        opened.leave()
        kernel.close()
