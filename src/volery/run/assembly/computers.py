"""Processors and networks of a run: who executes what, its price, background load, power draw.

Graph and components report what they do; ``cost`` prices it; this module joins the two for the processors of
one allocation. Nodes and components without a processor compute and communicate in no time.

The background load of a processor (``load`` in the model) is a share of each core that components do not get.
Its executions have a priority above any component, one each ``LOAD_PERIOD`` and core. Their lengths are
random and seeded, so the same run has the same load.

A computer on board drains the battery of its vehicle. Once each ``FEED_PERIOD`` its mean power of the last
period becomes the payload power of the next one.
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
from volery.model.components import CPP_LANGUAGES, ROS_LANGUAGES, StatedFigure
from volery.model.instances import Instance, TargetKind
from volery.model.system import NetworkSpec as NetworkModel
from volery.model.system import ProcessorSpec as ProcessorModel
from volery.model.system import System
from volery.ros.graph.interface import NodeId, Route
from volery.run.assembly.cpp import core_of

if TYPE_CHECKING:
    from volery.run.assembly.simulated_fleet import SimulatedFleet

LOAD_PERIOD: Ns = 10 * MS
LOAD_PRIORITY = 1 << 30
"""Greater than the priority of any component."""
LOAD_VARIATION = 0.5
"""Greatest variation of an execution, as a share of what keeps it between zero and the whole period."""


def load_name(processor: str) -> str:
    """Return the component name of the background load of *processor*."""
    return f"{processor} (load)"


def start_background_load(kernel: Kernel, processor: Processor, model: ProcessorModel, seed: int) -> None:
    """Start the load of *model*, if it has one; the cores start evenly spread over one period."""
    if model.load <= 0.0:
        return
    for core in range(model.cores):
        context = ExecutionContext(load_name(model.name), processor, LOAD_PRIORITY, deadline=0)
        load = _CoreLoad(kernel, processor, context, model.load, seed, core)
        kernel.call_at(kernel.now() + LOAD_PERIOD * core // model.cores, load.begin)


class _CoreLoad:
    """Background load of one core."""

    def __init__(
        self,
        kernel: Kernel,
        processor: Processor,
        context: ExecutionContext,
        share: float,
        seed: int,
        core: int,
    ) -> None:
        self._kernel = kernel
        self._run = partial(processor.load, context)
        self._mean = share * LOAD_PERIOD
        self._variation = LOAD_VARIATION * min(share, 1.0 - share) * LOAD_PERIOD
        self._random = stream(seed, f"load/{processor.name}/{core}")

    def begin(self) -> None:
        """Execute once each period, from now on."""
        self._kernel.every(LOAD_PERIOD, self._execute)

    def _execute(self) -> None:
        self._run(round(self._mean + self._random.uniform(-self._variation, self._variation)))


CALL_WITHIN: Ns = 10 * S
"""Deadline for the transfer of a call's arguments or result; after it the caller gets ``LinkLost``."""

NO_COST = Price(0, 0)


def commanded_by(instance: Instance) -> tuple[str, ...]:
    """Return the vehicles that *instance* commands. A component of the environment only observes vehicles."""
    if instance.is_environment:
        return ()
    return tuple(
        target.name
        for connection in instance.connections.values()
        for target in connection.targets
        if target.kind is TargetKind.VEHICLE
    )


def is_node(instance: Instance) -> bool:
    """Return True if *instance* is a node of the graph, by its language or because it commands a vehicle."""
    return bool(commanded_by(instance)) or instance.component.language in ROS_LANGUAGES


def ros_language(instance: Instance) -> str:
    """Return the language of the client library that its ROS calls are charged as."""
    language = instance.component.language
    return "roscpp" if language == "c++" else language


VEHICLE_NODE_LANGUAGE = "roscpp"
"""The node that serves a vehicle represents MAVROS, which uses roscpp."""


def _stated_costs(figures: Iterable[StatedFigure]) -> tuple[StatedCost, ...]:
    return tuple(
        StatedCost(figure.processor, figure.frequency_hz, figure.time_ns, figure.energy_j)
        for figure in figures
    )


class ComputingPlatform:
    """Processors and networks of one run, and the prices of computing on them."""

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
        self.warnings: dict[str, None] = dict.fromkeys(map(str, system.warnings))  # an ordered set

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

    # -- for components

    def allocation(self, instance: Instance) -> Allocation:
        """Return the processor, priority, deadline, start and period of an instance."""
        activity = instance.activity
        priority = activity.priority if activity else None
        deadline = activity.deadline_ns if activity else None
        start = activity.start_ns if activity else 0
        period = activity.period_ns if activity else None
        if instance.processor is None:
            return Allocation(priority=priority, deadline=deadline, starts_at=start, period=period)
        frequency = self._models[instance.processor].frequency_mhz
        return Allocation(self.processors[instance.processor], frequency, priority, deadline, start, period)

    def pricing(self, instance: Instance) -> Pricing:
        """Return the pricing of an instance's own computing at the fidelity of the run."""
        if instance.processor is None:
            return FREE
        component, prices = instance.component, self.prices[instance.processor]
        if self._fidelity != "times" and component.path:
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

    # -- for the graph

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

    def look_up_prices(self) -> None:
        """Look up every price that the run will need, so that errors and warnings come before the start."""
        for instance in self._system.instances:
            self.pricing(instance)
            if instance.processor is not None and is_node(instance):
                self._tariff(instance.processor, ros_language(instance))
        for vehicle in self._system.vehicles:
            if vehicle.processor is not None:
                self._tariff(vehicle.processor, VEHICLE_NODE_LANGUAGE)

    def route(self, sender: NodeId, receiver: NodeId) -> Route | None:
        """Return the route between two nodes over the network of their processors, or None without one."""
        network = self._network_between(sender.processor, receiver.processor)
        if network is None:
            return None

        def route(size: int, reliable: bool, deliver: Action, lost: Action) -> None:
            if reliable:
                network.send_reliable(size, deliver, f"{sender.name}>{receiver.name}")
            else:
                network.send(size, deliver, lost)

        return route

    def travel(self, one: str | None, other: str | None) -> Transfer | None:
        """Return the transfer of call arguments between two processors, or None if it takes no time."""
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
        """Return {vehicle: processors that drain its battery}."""
        found: dict[str, tuple[str, ...]] = {}
        for model in self._system.processors:
            if model.powered_by is not None:
                found[model.powered_by] = (*found.get(model.powered_by, ()), model.name)
        return found

    def watts(self, processor: str, busy_cores: float) -> float:
        """Return the power of a processor.

        Args:
            processor: Name of the processor.
            busy_cores: Mean number of busy cores.

        Raises:
            EstimateError: The catalogue has no power figures for the processor.
        """
        return self.prices[processor].watts(busy_cores)


FEED_PERIOD: Ns = 500 * MS


class PowerFeed:
    """Draws the power of the computers from the batteries of their vehicles."""

    def __init__(self, kernel: Kernel, platform: ComputingPlatform, fleet: SimulatedFleet) -> None:
        self._kernel = kernel
        self._platform = platform
        self._fleet = fleet
        self._fed = platform.powered_by()
        self._busy: dict[str, Ns] = {name: 0 for names in self._fed.values() for name in names}
        self._last: Ns = kernel.now()
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
        if now == self._last:
            return
        for vehicle, names in self._fed.items():
            self._fleet.flights[vehicle].payload_power(sum(self._watts(name, now) for name in names))
        self._last = now

    def _watts(self, processor: str, now: Ns) -> float:
        busy = self._platform.processors[processor].busy_ns(now)
        cores = (busy - self._busy[processor]) / (now - self._last)
        self._busy[processor] = busy
        return self._platform.watts(processor, cores)
