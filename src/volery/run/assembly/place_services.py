"""What vehicles get at places of a simulated world: other batteries, charge, and loads for their grippers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from math import hypot
from operator import itemgetter
from typing import TYPE_CHECKING

from volery.base.time import MS, Ns, S, to_seconds
from volery.kernel.api import Kernel
from volery.model.environment import CarriedLoad, PlaceSpec
from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.world import Truth
from volery.trace.events import NOTICE, WARNING, BatteryService, Failure, Text

if TYPE_CHECKING:
    from volery.run.assembly.simulated_fleet import SimulatedFleet


SERVICE_PERIOD: Ns = 1 * S
REACH_M = 5.0
"""Distance from a place [m] within which its batteries and its charger are brought to a vehicle."""
USED = 0.95
"""Share of the charge from which on a battery is not worth swapping."""

GRIP_PERIOD: Ns = 100 * MS
GRIP_REACH_M, GRIP_HEIGHT_M = 2.0, 1.5
"""Distance in the plane, and height of a vehicle above the ground, within which its gripper takes a load."""
RELEASED, GRABBED = 0, 1
"""States of a gripper."""


def serve_batteries(kernel: Kernel, fleet: SimulatedFleet, places: Iterable[PlaceSpec]) -> None:
    """Swap and charge batteries at *places*, from now on: those of vehicles that stand there disarmed."""
    serving = [one for one in places if one.battery_swap_ns is not None or one.charging_w > 0.0]
    if serving:
        kernel.every(SERVICE_PERIOD, partial(_serve, kernel, fleet, serving, {}))


def _serve(kernel: Kernel, fleet: SimulatedFleet, places: Sequence[PlaceSpec], since: dict[str, Ns]) -> None:
    """Do the work of one period; *since* has the time from which each vehicle has been standing."""
    now = kernel.now()
    for name, autopilot in fleet.autopilots.items():
        flight = fleet.flights[name]
        truth = flight.truth()
        place = None if not truth.on_ground or autopilot.state().armed else _nearest(places, truth)
        if place is None:
            since.pop(name, None)
            continue
        arrived, left = since.setdefault(name, now), truth.battery_left
        swapping = place.battery_swap_ns
        if swapping is not None and now - arrived >= swapping and left < USED:
            autopilot.swap_battery()
            since[name] = now
            text = f"battery swapped at {place.name}: {left:.0%} was left"
            kernel.record(Text(now, name, NOTICE, text))
            kernel.record(BatteryService(now, name, place.name, "swap", 0, left))
        elif place.charging_w > 0.0 and left < 1.0:
            share = place.charging_w * to_seconds(SERVICE_PERIOD) / (truth.volts * flight.capacity_as)
            flight.set_charge(min(1.0, left + share))
            kernel.record(BatteryService(now, name, place.name, "charge", SERVICE_PERIOD, left))


def _nearest(places: Sequence[PlaceSpec], truth: Truth) -> PlaceSpec | None:
    """Return the place that a vehicle stands at, None if it is at none of them."""
    east, north, _ = truth.position
    away, place = min(
        ((hypot(one.east_m - east, one.north_m - north), one) for one in places), key=itemgetter(0)
    )
    return place if away <= REACH_M else None


def serve_loads(kernel: Kernel, fleet: SimulatedFleet, loads: Sequence[CarriedLoad]) -> None:
    """Let grippers take and release *loads*, from now on."""
    if loads:
        kernel.every(GRIP_PERIOD, _Loads(kernel, fleet, loads).look)


class _Loads:
    """Where the loads are: on the ground, or with a vehicle. Their mass is part of it then.

    A gripper that closes takes the nearest load within its reach, unless that is too heavy to fly with; one
    that opens lets it fall.
    """

    def __init__(self, kernel: Kernel, fleet: SimulatedFleet, loads: Sequence[CarriedLoad]) -> None:
        self._kernel = kernel
        self._fleet = fleet
        self._lying = {load.name: (load.at.east_m, load.at.north_m) for load in loads}
        self._masses = {load.name: load.mass_kg for load in loads}
        self._carried: dict[str, str] = {}
        self._grippers: dict[str, int | None] = {}

    def look(self) -> None:
        """Take and release what grippers have taken and released since the last look."""
        for name, flight in self._fleet.flights.items():
            gripper = flight.gripper
            if gripper is None or gripper == self._grippers.get(name):
                continue
            self._grippers[name] = gripper
            truth = flight.truth()
            if gripper == GRABBED:
                self._take(name, truth)
            elif gripper == RELEASED and name in self._carried:
                self._release(name, truth)

    def _take(self, vehicle: str, truth: Truth) -> None:
        east, north, up = truth.position
        near = [
            (hypot(east - x, north - y), load)
            for load, (x, y) in self._lying.items()
            if hypot(east - x, north - y) <= GRIP_REACH_M
        ]
        if not near or up - truth.ground > GRIP_HEIGHT_M:
            self._say(vehicle, WARNING, "the gripper closed on nothing: no load is within its reach")
            return
        load = min(near)[1]
        flight, mass = self._fleet.flights[vehicle], self._masses[load]
        if isinstance(flight.spec, Multirotor) and mass > flight.spec.spare_lift - flight.spec.payload:
            spare = max(0.0, flight.spec.spare_lift - flight.spec.payload)
            text = f"{load} stays: its {mass:g} kg are too heavy, {spare:.2g} kg more can be lifted"
            self._kernel.record(Failure(self._kernel.now(), vehicle, text))
            return
        del self._lying[load]
        self._carried[vehicle] = load
        flight.carry(mass)
        self._say(vehicle, NOTICE, f"took {load}: {mass:g} kg")

    def _release(self, vehicle: str, truth: Truth) -> None:
        load = self._carried.pop(vehicle)
        east, north, up = truth.position
        self._lying[load] = east, north
        self._fleet.flights[vehicle].carry(0.0)
        height = up - truth.ground
        falls = f", from {height:.1f} m up" if height > GRIP_HEIGHT_M else ""
        self._say(vehicle, NOTICE, f"left {load} at east {east:.1f} m, north {north:.1f} m{falls}")

    def _say(self, vehicle: str, severity: int, text: str) -> None:
        self._kernel.record(Text(self._kernel.now(), vehicle, severity, text))
