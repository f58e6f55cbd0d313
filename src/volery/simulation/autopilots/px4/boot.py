"""What PX4 does by itself after it is switched on, and what all kinds of vehicles have in common."""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.time import MS, Ns
from volery.simulation.autopilots.firmware import BootEvent
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.autopilots.px4.commander import READY_AFTER, Commander, of
from volery.simulation.autopilots.vehicle_state import Vehicle

ORIGIN: Ns = 6_200 * MS
"""Recorded: positions from 6.4 s on."""

HOME: Ns = 7_600 * MS
"""Recorded: the first home 7.59 to 7.60 s after boot."""

STREAMS: Ns = 500 * MS
"""Recorded: streams half a second after boot, the first heartbeat later."""

FIRST_HEARTBEAT: Ns = 1_252 * MS
"""Recorded: 1.19 to 1.34 s after boot."""


def _origin_set(vehicle: Vehicle) -> None:
    vehicle.flight.set_origin()


def home_set(vehicle: Vehicle) -> None:
    """The position is good enough for a home."""
    if vehicle.estimate.position_ok and vehicle.home is None:
        vehicle.home_is_here()


def stand(vehicle: Vehicle) -> None:
    """On the ground, disarmed."""
    vehicle.landed = True


EVENTS = (
    BootEvent(0, stand),
    BootEvent(ORIGIN, _origin_set),
    BootEvent(HOME, home_set),
    BootEvent(READY_AFTER - 50 * MS, home_set),
)


def on_position(vehicle: Vehicle) -> None:
    """A warm vehicle has found its place."""
    home_set(vehicle)
    of(vehicle).reported = of(vehicle).checks()


def memory(vehicle: Vehicle) -> Commander:
    """What PX4 alone keeps."""
    return Commander(vehicle)


def nothing(_vehicle: Vehicle) -> None:
    """There is nothing to do then."""


def own_parameters(system: int, _flight: Flight) -> Mapping[str, float]:
    """What follows from the vehicle."""
    return {"MAV_SYS_ID": system}
