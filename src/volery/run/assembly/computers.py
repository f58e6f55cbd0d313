"""Processors and networks of a run: what serves computing, what computing costs there, what travels between.

Graph and components report what they do; ``cost`` prices it; this module joins the two for the processors of
one allocation. Nodes and components that are allocated to no processor compute and communicate in no time.

What else runs on a computer: the model's ``load``, a share of each core that components do not get.

It is more urgent than any component, as interrupts and a reserved share are, and comes in pieces: one each
``LOAD_PERIOD`` and core, of the stated share of it on average. How the pieces differ is seeded, so the same run
has the same load, whatever runs on the machine that simulates it.

On-board computers drain the battery of the vehicle that feeds them.

Their busy time is looked at once a period, and what they drew on average goes to the vehicle's body as
payload power for the next period: the battery is late by one period and misses nothing but the last one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING

from volery.base.errors import EstimateError
from volery.base.seeds import stream
from volery.base.time import MS, Ns, S
from volery.components.instance import Allocation
from volery.components.ports import Transfer
from volery.cost import FREE, Price, Pricing, ProcessorPrices, StatedCost, Tariff, load_catalogue
from volery.kernel.api import Action, Kernel
from volery.kernel.network import Network
from volery.kernel.processor import QUANTUM, Processor
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.model.components import CPP_LANGUAGES, ROS_LANGUAGES, Figure
from volery.model.instances import Instance, TargetKind
from volery.model.system import Network as NetworkModel
from volery.model.system import Processor as ProcessorModel
from volery.model.system import System
from volery.ros.graph.interface import NodeId, Route
from volery.run.assembly.cpp import core_of

if TYPE_CHECKING:
    from volery.run.assembly.simulated_fleet import SimulatedFleet

LOAD_PERIOD: Ns = 10 * MS
LOAD_PRIORITY = 1 << 30
"""Above the priority of any component."""
LOAD_VARIATION = 0.5
"""By so much of what it may be, a piece is shorter or longer than the share of a period."""


def load_name(processor: str) -> str:
    """Under this name its computing stands among the components."""
    return f"{processor} (load)"


def start_background_load(kernel: Kernel, processor: Processor, model: ProcessorModel, seed: int) -> None:
    """Let the load of *model*, if it has one, run on *processor*; core after core begins within a period."""
    if model.load <= 0.0:
        return
    for core in range(model.cores):
        place = ExecutionContext(load_name(model.name), processor, LOAD_PRIORITY)
        pieces = _CoreLoad(kernel, processor, place, model.load, seed, core)
        kernel.call_at(kernel.now() + LOAD_PERIOD * core // model.cores, pieces.begin)


class _CoreLoad:
    """The load of one core."""

    def __init__(
        self,
        kernel: Kernel,
        processor: Processor,
        place: ExecutionContext,
        share: float,
        seed: int,
        core: int,
    ) -> None:
        self._kernel = kernel
        self._run = partial(processor.load, place)
        self._mean = share * LOAD_PERIOD
        self._most_off = LOAD_VARIATION * min(share, 1.0 - share) * LOAD_PERIOD
        self._random = stream(seed, f"load/{processor.name}/{core}")

    def begin(self) -> None:
        """From now on, each period."""
        self._kernel.every(LOAD_PERIOD, self._piece)

    def _piece(self) -> None:
        self._run(round(self._mean + self._random.uniform(-self._most_off, self._most_off)))


CALL_WITHIN: Ns = 10 * S
"""A call whose arguments or result have not arrived by then raises ``LinkLost`` at its caller."""

NO_COST = Price(0, 0)


def commanded_by(instance: Instance) -> tuple[str, ...]:
    """The vehicles that *instance* commands. A component of the environment sees bodies and commands none."""
    if instance.is_environment:
        return ()
    return tuple(
        target.name
        for connection in instance.connections.values()
        for target in connection.targets
        if target.kind is TargetKind.VEHICLE
    )


def is_node(instance: Instance) -> bool:
    """True if *instance* is a node of the graph: by its language, or because it commands a vehicle."""
    return bool(commanded_by(instance)) or instance.component.language in ROS_LANGUAGES


def ros_language(instance: Instance) -> str:
    """The language whose client library its calls into ROS are charged as."""
    language = instance.component.language
    return "roscpp" if language == "c++" else language


VEHICLE_NODE_LANGUAGE = "roscpp"
"""The node that serves a vehicle stands for MAVROS, which is written with roscpp."""


def _stated_costs(figures: Iterable[Figure]) -> tuple[StatedCost, ...]:
    return tuple(StatedCost(one.processor, one.frequency_hz, one.time_ns, one.energy_j) for one in figures)


class Platform:
    """The computers of one run."""

    def __init__(self, system: System, kernel: VirtualKernel, seed: int, fidelity: str) -> None:
        self._system = system
        self._kernel = kernel
        self._fidelity = fidelity
        self._models = {model.name: model for model in system.processors}
        known = load_catalogue(*system.catalogues)
        self.prices = {
            model.name: ProcessorPrices(model.name, known.processor(model.kind), model.frequency_hz)
            for model in system.processors
        }
        self.processors = {model.name: self._processor(model) for model in system.processors}
        for model in system.processors:
            start_background_load(kernel, self.processors[model.name], model, seed)
        self.networks = {model.name: self._network(model, seed) for model in system.networks}
        self._languages = {instance.name: ros_language(instance) for instance in system.instances}

        self._tariffs: dict[tuple[str, str], Tariff] = {}
        self.warnings: dict[str, None] = dict.fromkeys(system.warnings)  # an ordered set

    def _processor(self, model: ProcessorModel) -> Processor:
        return Processor(
            self._kernel,
            model.name,
            cores=model.cores,
            scheduler=model.scheduler,
            quantum=QUANTUM if model.quantum_ns is None else model.quantum_ns,
            context_switch=model.context_switch_ns,
        )

    def _network(self, model: NetworkModel, seed: int) -> Network:
        return Network(
            self._kernel,
            model.name,
            bandwidth_bit_s=round(model.bandwidth_bit_s),
            latency=model.latency_ns,
            loss=model.loss,
            stream=stream(seed, f"network/{model.name}"),
        )

    # -- what components are given

    def allocation(self, instance: Instance) -> Allocation:
        """Where *instance* computes."""
        activity = instance.activity
        priority = activity.priority if activity else None
        deadline = activity.deadline_ns if activity else None
        start = activity.start_ns if activity else 0
        if instance.processor is None:
            return Allocation(priority=priority, deadline=deadline, starts_at=start)
        frequency = self._models[instance.processor].frequency_mhz
        return Allocation(self.processors[instance.processor], frequency, priority, deadline, start)

    def pricing(self, instance: Instance) -> Pricing:
        """What the own computing of *instance* costs, at this run's fidelity."""
        if instance.processor is None:
            return FREE
        component, prices = instance.component, self.prices[instance.processor]
        if self._fidelity == "code" and component.path:
            if component.language not in CPP_LANGUAGES:
                pricing = prices.python_code()
                self.warnings.update(dict.fromkeys(pricing.warnings))
                return pricing
            if core_of(self._system, self._fidelity, instance) is not None:
                return prices.compiled_code()
            if not (component.activation or component.operations):
                what = f"what {instance.name} computes is not counted: it is C++"
                self.warnings[f"{what}; state times in the model, or call uc_add_times()"] = None
                return FREE
        operations = {name: _stated_costs(figures) for name, figures in component.operations.items()}
        return prices.stated(instance.name, operations, _stated_costs(component.activation or ()))

    # -- what the graph is given

    def tariff(self, node: NodeId) -> Tariff | None:
        """Return the prices of a node's calls into ROS; None if no processor executes it."""
        if not node.processor:
            return None
        return self._tariff(node.processor, self._languages.get(node.component, VEHICLE_NODE_LANGUAGE))

    def _tariff(self, processor: str, language: str) -> Tariff:
        known = self._tariffs.get((processor, language))
        if known is None:
            known = self._tariffs[processor, language] = self.prices[processor].ros_calls(language)
            self.warnings.update(dict.fromkeys(known.warnings))
        return known

    def foresee(self) -> None:
        """Look up every law that nodes will need, so that what is missing or doubtful is known before the
        start.
        """
        for instance in self._system.instances:
            self.pricing(instance)
            if instance.processor is not None and is_node(instance):
                self._tariff(instance.processor, ros_language(instance))
        for vehicle in self._system.vehicles:
            if vehicle.processor is not None:
                self._tariff(vehicle.processor, VEHICLE_NODE_LANGUAGE)

    def route(self, sender: NodeId, receiver: NodeId) -> Route | None:
        """How messages get from node to node: over the network between their processors, if there is one."""
        network = self._network_between(sender.processor, receiver.processor)
        if network is None:
            return None

        def way(size: int, reliable: bool, deliver: Action, lost: Action) -> None:
            if reliable:
                network.send_reliable(size, deliver, f"{sender.name}>{receiver.name}")
            else:
                network.send(size, deliver, lost)

        return way

    def travel(self, one: str | None, other: str | None) -> Transfer | None:
        """How the arguments of a call get from processor to processor; ``None`` where that takes no time."""
        network = self._network_between(one or "", other or "")
        if network is None:
            return None
        return lambda size: network.carry(size, self._kernel.now() + CALL_WITHIN)

    def _network_between(self, one: str, other: str) -> Network | None:
        if one == other or not one or not other:
            return None
        model = self._system.network_between(one, other)
        return self.networks[model.name] if model else None

    # -- power

    def powered_by(self) -> Mapping[str, tuple[str, ...]]:
        """Vehicle -> processors that drain its battery."""
        found: dict[str, tuple[str, ...]] = {}
        for model in self._system.processors:
            if model.powered_by is not None:
                found[model.powered_by] = (*found.get(model.powered_by, ()), model.name)
        return found

    def watts(self, processor: str, busy_cores: float) -> float:
        """What a processor draws with so many cores busy on average; ``EstimateError`` without figures."""
        return self.prices[processor].watts(busy_cores)


FEED_PERIOD: Ns = 500 * MS


class PowerFeed:
    """Feeds the computers of one platform from the batteries of one airfield."""

    def __init__(self, kernel: Kernel, platform: Platform, fleet: SimulatedFleet) -> None:
        self._kernel = kernel
        self._platform = platform
        self._fleet = fleet
        self._fed = platform.powered_by()
        self._busy: dict[str, Ns] = {name: 0 for names in self._fed.values() for name in names}
        self._then: Ns = kernel.now()
        for name in self._busy:
            self._check(name)
        for vehicle, names in self._fed.items():
            fleet.flights[vehicle].payload_power(sum(platform.watts(name, 0.0) for name in names))
        if self._fed:
            kernel.every(FEED_PERIOD, self._feed)

    def _check(self, processor: str) -> None:
        try:
            self._platform.watts(processor, 0.0)
        except EstimateError as error:
            raise EstimateError(f"{processor} is powered by a vehicle: {error}") from error

    def _feed(self) -> None:
        now = self._kernel.now()
        if now == self._then:
            return
        for vehicle, names in self._fed.items():
            self._fleet.flights[vehicle].payload_power(sum(self._watts(name, now) for name in names))
        self._then = now

    def _watts(self, processor: str, now: Ns) -> float:
        busy = self._platform.processors[processor].busy_ns(now)
        cores = (busy - self._busy[processor]) / (now - self._then)
        self._busy[processor] = busy
        return self._platform.watts(processor, cores)
