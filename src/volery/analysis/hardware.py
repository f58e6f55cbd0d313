"""The hardware of a model and its price: computers, radios, batteries, airframes, as often as each is there.

A price is that of the model, else that of the catalogue, which says whether it is an estimate and on which
basis. A search minimises ``hardware_price``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from volery.cost import Catalogue, ListPrice, load_catalogue
from volery.model.environment import VehicleSpec
from volery.model.prices import StatedPrice
from volery.model.system import System
from volery.run.assembly.bodies import CELL_NOMINAL_VOLTS, body_of
from volery.simulation.world.body_specs import Multirotor


@dataclass(frozen=True)
class PricedPart:
    """A part with its price, or several equal ones with the price of all.

    ``what`` says what it is; ``year`` is None where the model does not state it.
    """

    name: str
    what: str
    amount: float
    currency: str
    year: int | None
    source: str
    estimated: bool


def hardware(system: System) -> tuple[PricedPart, ...]:
    """Return the parts of a system in the order of the model: computers, radios, vehicles, batteries.

    Raises:
        EstimateError: A processor is not in the catalogue.
    """
    return tuple(_parts(system, load_catalogue(*system.catalogues)))


def hardware_price(parts: Sequence[PricedPart]) -> dict[str, float]:
    """Return the sum of the prices by currency; currencies are not converted."""
    found: dict[str, float] = {}
    for part in parts:
        found[part.currency] = found.get(part.currency, 0.0) + part.amount
    return found


def _parts(system: System, catalogue: Catalogue) -> Iterator[PricedPart]:
    for processor in system.processors:
        listed = catalogue.processor(processor.kind).price
        if processor.price is not None or listed is not None:
            yield _part(processor.name, processor.kind, processor.price, listed)
    for network in system.networks:
        ends = len(network.between)
        listed = catalogue.hardware["radio"].price
        yield _part(network.name, f"{ends} radios", network.price, listed, ends)
    for vehicle in system.vehicles:
        yield from _vehicle(vehicle, catalogue)


def _vehicle(vehicle: VehicleSpec, catalogue: Catalogue) -> Iterator[PricedPart]:
    airframe = vehicle.airframe
    own = vehicle.price or (airframe.price if airframe else None)
    body = body_of(vehicle)
    kilograms = body.mass if isinstance(body, Multirotor) and own is None else 1.0
    yield _part(vehicle.name, vehicle.kind, own, catalogue.hardware[vehicle.kind].price, kilograms)
    stated = vehicle.battery or (airframe.battery if airframe else None)
    battery = body.battery
    watt_hours = battery.capacity_ah * battery.cells * CELL_NOMINAL_VOLTS
    price = stated.price if stated else None
    listed = catalogue.hardware["battery"].price
    times = 1.0 if price is not None else watt_hours
    yield _part(vehicle.name, f"battery of {watt_hours:.0f} Wh", price, listed, times)


def _part(
    name: str, what: str, own: StatedPrice | None, listed: ListPrice | None, times: float = 1.0
) -> PricedPart:
    if own is not None:
        amount = own.amount
        return PricedPart(name, what, times * amount.value, amount.currency, own.year, own.source, False)
    assert listed is not None  # one of the two is there
    amount_listed = times * listed.amount
    return PricedPart(
        name, what, amount_listed, listed.currency, listed.year, listed.source, listed.estimated
    )
