"""Budgets of a model without a run: memory of each process, energy of each computer, endurance of batteries.

A drone draws most in hover among the states that it stays in, so its endurance is computed for hovering all
the time, with all its computers at their static utilisation. Wind and manoeuvres are not included, and the
result says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from volery.analysis.system_analysis import Utilisation
from volery.base.errors import EstimateError
from volery.base.time import to_seconds
from volery.cost import ProcessorPrices, load_catalogue
from volery.model.environment import VehicleSpec
from volery.model.instances import Instance
from volery.model.system import System
from volery.run.assembly.bodies import body_of
from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.dynamics import battery_current, cell_voltage

RESERVE_OBSERVABLE = "battery_min"
_STEPS = 200
"""Steps of the discharge; the voltage is a broken line with five corners."""


@dataclass(frozen=True)
class Memory:
    """The memory of one process, bytes; ``why`` states what is missing."""

    process: str
    processor: str
    bytes: float | None
    why: str = ""


@dataclass(frozen=True)
class Energy:
    """Mean power and the energy over the duration of the run of one computer, with its relative error.

    ``greatest_watts`` is with all cores busy, where the utilisation is not known (``at_least``).
    """

    processor: str
    watts: float | None
    greatest_watts: float | None
    joules: float | None
    error: float | None
    at_least: bool
    why: str = ""


@dataclass(frozen=True)
class Endurance:
    """How long a drone can hover until its reserve, against the longest run.

    ``seconds`` is None where there is no figure; ``feasible`` whether it lasts for all of the run.
    """

    vehicle: str
    seconds: float | None
    watts: float | None
    reserve: float
    feasible: bool | None
    why: str = ""


@dataclass(frozen=True)
class Budgets:
    """All budgets of a system."""

    memory: tuple[Memory, ...]
    energy: tuple[Energy, ...]
    endurance: tuple[Endurance, ...]


def budgets(system: System, utilisations: Sequence[Utilisation]) -> Budgets:
    """Return the budgets of *system*, whose processors have these static *utilisations*."""
    catalogue = load_catalogue(*system.catalogues)
    shares = {utilisation.resource: utilisation for utilisation in utilisations}
    energy = tuple(
        _energy(
            system,
            ProcessorPrices(processor.name, catalogue.processor(processor.kind), processor.frequency_hz),
            shares[processor.name],
            processor.cores,
        )
        for processor in system.processors
    )
    return Budgets(
        tuple(memory(system)),
        energy,
        tuple(_endurance(system, vehicle, energy) for vehicle in system.vehicles),
    )


def memory(system: System) -> Iterator[Memory]:
    """Yield the memory of each process, and of each computer whose memory is stated.

    The instances of a memory space share its process; every other instance is deployed as one.
    """
    limits = {space.name: space.memory_b for space in system.memory_spaces}
    used: dict[str, list[Memory]] = {}
    for process, instances in _processes(system).items():
        missing = [instance.component.name for instance in instances if instance.component.memory_b is None]
        stated, limit = sum(instance.component.memory_b or 0.0 for instance in instances), limits.get(process)
        why = f"state `memory` of {', '.join(dict.fromkeys(missing))}" if missing else ""
        if limit is not None and stated > limit:
            why = f"more than the {limit:g} B of its memory space"
        made = Memory(process, instances[0].processor or "", None if missing else stated, why)
        used.setdefault(made.processor, []).append(made)
        yield made
    for processor in system.processors:
        mine = used.get(processor.name, [])
        if processor.memory_b is None or not mine:
            continue
        known = sum(one.bytes or 0.0 for one in mine)
        unknown = ", ".join(one.process for one in mine if one.bytes is None)
        why = f"without {unknown}" if unknown else ""
        if known > processor.memory_b:
            why = f"more than its {processor.memory_b:g} B"
        yield Memory(f"all of {processor.name}", processor.name, None if unknown else known, why)


def _processes(system: System) -> dict[str, list[Instance]]:
    found: dict[str, list[Instance]] = {}
    for instance in system.instances:
        if instance.processor is not None:
            found.setdefault(instance.memory_space or instance.name, []).append(instance)
    return found


def _energy(system: System, prices: ProcessorPrices, used: Utilisation, cores: int) -> Energy:
    try:
        watts = prices.watts(min(used.share, 1.0) * cores)
    except EstimateError as error:
        return Energy(used.resource, None, None, None, None, bool(used.not_counted), str(error))
    greatest = prices.watts(cores) if used.not_counted else watts
    joules = watts * to_seconds(system.limits.duration_ns)
    return Energy(
        used.resource,
        watts,
        greatest,
        joules,
        prices.entry.power_law().band() or None,
        bool(used.not_counted),
    )


def _reserve(system: System, vehicle: VehicleSpec) -> float:
    """Return the share of the charge that a requirement wants to be left; 0 without one."""
    wanted = f"{vehicle.name}.{RESERVE_OBSERVABLE}"
    bounds = (
        requirement.bound
        for requirement in system.requirements
        if (requirement.observe, requirement.relation) == (wanted, "min")
    )
    return max(bounds, default=0.0)


def _endurance(system: System, vehicle: VehicleSpec, energy: Sequence[Energy]) -> Endurance:
    body, reserve = body_of(vehicle), _reserve(system, vehicle)
    if not isinstance(body, Multirotor):
        why = "the power of a rover depends on its way; simulate it"
        return Endurance(vehicle.name, None, None, reserve, None, why)
    fed = [processor.name for processor in system.processors if processor.powered_by == vehicle.name]
    drawn = [one.greatest_watts for one in energy if one.processor in fed]
    if None in drawn:
        return Endurance(vehicle.name, None, None, reserve, None, f"no power figures for {', '.join(fed)}")
    watts = body.hover_power + sum(one for one in drawn if one is not None)
    seconds = hover_time(body, watts, reserve)
    longest = to_seconds(system.limits.duration_ns)
    return Endurance(vehicle.name, seconds, watts, reserve, seconds >= longest)


@dataclass(frozen=True)
class Hover:
    """What a multirotor's airframe gives in hover, without computers: command, power and time.

    ``throttle`` is the motor command 0..1 on a full battery; ``seconds`` until ``reserve`` of the charge.
    """

    vehicle: str
    frame: str
    mass_kg: float
    throttle: float
    watts: float
    seconds: float
    reserve: float


def hovers(system: System) -> tuple[Hover, ...]:
    """Return how each vehicle hovers whose airframe or payload the model states."""
    found = []
    for vehicle in system.vehicles:
        body, reserve = body_of(vehicle), _reserve(system, vehicle)
        if not isinstance(body, Multirotor) or not (body.frame or body.payload):
            continue
        seconds = hover_time(body, body.hover_power, reserve)
        mass = body.mass + body.payload
        made = (body.frame or "quad-x", mass, body.hover_throttle, body.hover_power, seconds, reserve)
        found.append(Hover(vehicle.name, *made))
    return tuple(found)


def hover_time(body: Multirotor, watts: float, reserve: float) -> float:
    """Return the time in s until the charge of the battery has fallen to the share *reserve* at *watts*.

    The current grows as the voltage falls, by the discharge curve of the simulated battery.
    """
    battery = body.battery
    used = battery.left - reserve
    if used <= 0.0:
        return 0.0
    charge = used * battery.capacity_ah * 3600.0 / _STEPS
    seconds = 0.0
    for number in range(_STEPS):
        left = battery.left - used * (number + 0.5) / _STEPS
        volts = battery.cells * cell_voltage(left)
        seconds += charge / battery_current(volts, battery.resistance_ohm, watts)
    return seconds
