"""Prices of computing: the only way from a law of the catalogue to a component, a call or a block count.

``ProcessorPrices`` joins one entry of the catalogue with the frequency of a processor. It returns execution
time in ns on that processor and energy in J, and the ``Basis`` of each: law, source, provenance, validity.
Stated figures (fidelity ``times``), counted Python and counted compiled code (fidelity ``code``), calls into
ROS and electrical power all pass through here. A missing figure is an ``EstimateError``, never zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from volery.base.errors import EstimateError, choices
from volery.base.time import Ns
from volery.cost.catalogue import ProcessorEntry
from volery.cost.code_laws import BRANCHES, SHORT, SHORTEST
from volery.cost.figures import Provenance, WithProvenance, scale_energy, scale_time
from volery.cost.tariff import Tariff

STEPS_PER_CYCLE = 1000
"""Steps of a cycle of compiled code. Costs are whole steps, so that sums are exact on every machine."""


@dataclass(frozen=True, slots=True)
class Cost:
    """Execution time on the target, ns, and energy, J, where the model states it."""

    time: Ns
    energy: float = 0.0


ZERO_COST = Cost(0)


@dataclass(frozen=True)
class Basis:
    """The law behind a price, for reports. ``warning`` is empty where the law is valid without reserve."""

    law: str
    source: str
    provenance: Provenance
    validity: str
    warning: str = ""

    @classmethod
    def of(cls, law: str, figures: WithProvenance, *, reserve: str = "", warning: str = "") -> Basis:
        """Return the basis of a law with these figures; ``reserve`` is appended to the validity."""
        validity = f"{figures.validity}; {reserve}" if reserve else figures.validity
        return cls(law, figures.source, figures.provenance, validity, warning)


class Pricing(Protocol):
    """What the own computing of a component costs."""

    @property
    def ns_per_step(self) -> float:
        """Execution time of a counted step on the target, ns; 0.0 where code is not counted."""

    def operation(self, component: str, operation: str) -> Cost:
        """Return the cost of serving a call of ``operation``, without what is counted."""

    def activation(self, component: str) -> Cost:
        """Return the cost of an activation, without what is counted."""

    def check(self, component: str, operations: Iterable[str], active: bool) -> None:
        """Raise ``EstimateError`` if a figure is missing that a run may need."""


@dataclass(frozen=True)
class StatedPricing:
    """Fidelity ``times``: the figures of the model by operation, and for an activation (None: not stated)."""

    operations: Mapping[str, Cost] = field(default_factory=dict)
    per_activation: Cost | None = None
    ns_per_step: float = 0.0

    def operation(self, component: str, operation: str) -> Cost:
        """Return the stated figure; raise ``EstimateError`` if there is none."""
        if operation not in self.operations:
            raise EstimateError(
                f"{component}: no time is stated for its operation {operation!r} on the processor it is "
                f"allocated to (stated: {choices(self.operations)}); state one in the model, or run with "
                "fidelity 'code'"
            )
        return self.operations[operation]

    def activation(self, component: str) -> Cost:
        """Return the stated figure; raise ``EstimateError`` if there is none."""
        if self.per_activation is None:
            raise EstimateError(
                f"{component}: it is active, but no time is stated for an activation on the processor it is "
                f"allocated to; state 'activation' in the model, or run with fidelity 'code'"
            )
        return self.per_activation

    def check(self, component: str, operations: Iterable[str], active: bool) -> None:
        """Raise ``EstimateError`` if a figure is missing."""
        for operation in operations:
            self.operation(component, operation)
        if active:
            self.activation(component)


@dataclass(frozen=True)
class CountedPricing:
    """Fidelity ``code``: counted steps of the component's code at ``ns_per_step`` each, and nothing else."""

    ns_per_step: float
    warnings: tuple[str, ...] = ()

    def operation(self, component: str, operation: str) -> Cost:
        """Return zero: everything is counted."""
        return ZERO_COST

    def activation(self, component: str) -> Cost:
        """Return zero: everything is counted."""
        return ZERO_COST

    def check(self, component: str, operations: Iterable[str], active: bool) -> None:
        """Accept: no figure can be missing."""


FREE: Pricing = CountedPricing(0.0)
"""For components of the environment and for real hardware, whose computing takes no simulated time."""


@dataclass(frozen=True)
class StatedCost:
    """A figure of a model: a cost on a kind of processor at a frequency; ``energy`` None: not stated."""

    processor: str
    frequency_hz: float
    time: Ns
    energy: float | None = None


class ProcessorPrices:
    """All prices on one processor.

    Args:
        name: Name of the processor in the model, for error messages.
        entry: The catalogue's entry for its kind.
        frequency_hz: Frequency that it runs at, Hz.
    """

    def __init__(self, name: str, entry: ProcessorEntry, frequency_hz: float) -> None:
        self.name = name
        self.entry = entry
        self._frequency_hz = frequency_hz
        self._frequency_mhz = frequency_hz / 1e6
        self._tariffs: dict[str, Tariff] = {}

    # -- a component's own computing

    def python_code(self) -> CountedPricing:
        """Return the price of counted Python; raise ``EstimateError`` without figures."""
        law = self.entry.code_law()
        return CountedPricing(law.ns_per_step(self._frequency_mhz), law.warnings())

    def compiled_code(self) -> CountedPricing:
        """Return the price of counted compiled code, whose steps ``native.BlockCosts.steps`` gives.

        Raises:
            EstimateError: There are no figures, or the frequency is outside their range.
        """
        self.entry.core_law().check_frequency(self._frequency_mhz)
        return CountedPricing(1000.0 / self._frequency_mhz / STEPS_PER_CYCLE)

    def stated(
        self,
        component: str,
        operations: Mapping[str, Sequence[StatedCost]],
        activation: Sequence[StatedCost],
    ) -> StatedPricing:
        """Return the prices of figures that a model states, scaled to the frequency of this processor.

        Args:
            component: Name of the instance, for error messages.
            operations: Stated figures by operation.
            activation: Stated figures of an activation; empty if there are none.
        """
        return StatedPricing(
            {name: self._scaled(component, name, figures) for name, figures in operations.items()},
            self._scaled(component, "activation", activation) if activation else None,
        )

    def _scaled(self, component: str, what: str, figures: Sequence[StatedCost]) -> Cost:
        """Return the figure for this kind of processor that is stated at the nearest frequency, scaled."""
        kind = self.entry.name
        fitting = [figure for figure in figures if figure.processor == kind]
        if not fitting:
            stated = choices({figure.processor for figure in figures})
            raise EstimateError(
                f"{component}: the time of {what!r} is stated for {stated}, but it is allocated to "
                f"{self.name}, of kind {kind}: state one for {kind} as well"
            )
        figure = min(fitting, key=lambda one: abs(one.frequency_hz - self._frequency_hz))
        stated_at, here = (kind, figure.frequency_hz / 1e6), (kind, self._frequency_mhz)
        time = scale_time(figure.time, stated_at, here)
        if figure.energy is None:
            return Cost(time)
        return Cost(time, scale_energy(figure.energy, stated_at, here, self.entry.power_law()))

    # -- calls into ROS, and power

    def ros_calls(self, client: str) -> Tariff:
        """Return the prices of calls into ROS with a client library (``roscpp``, ``rospy``, ``rclpy``)."""
        if client not in self._tariffs:
            self._tariffs[client] = Tariff(self.entry.ros_law(client), self._frequency_mhz)
        return self._tariffs[client]

    def watts(self, busy_cores: float) -> float:
        """Return the power with ``busy_cores`` cores busy on average, W.

        Raises:
            EstimateError: There are no figures.
        """
        return self.entry.power_law().watts(busy_cores, self._frequency_mhz)

    # -- where the prices come from

    def ros_basis(self) -> Iterator[Basis]:
        """Yield the bases of calls into ROS, one a client library."""
        for law in self.entry.ros.values():
            named = law.model_copy(update={"processor": self.entry.name})
            warning = "; ".join(named.warnings(self._frequency_mhz))
            yield Basis.of(f"{law.client} calls on {self.entry.name}", law, warning=warning)

    def code_basis(self) -> Iterator[Basis]:
        """Yield the bases of counted code, one an interpreted language."""
        for law in self.entry.code.values():
            warning = "; ".join(law.model_copy(update={"processor": self.entry.name}).warnings())
            name = f"counted {law.language} code on {self.entry.name}"
            yield Basis.of(name, law, reserve=law.how_good(), warning=warning)

    def compiled_code_basis(self) -> Basis:
        """Return the basis of compiled code."""
        law = self.entry.core_law()
        short = "; ".join(f"measured were {band}" for band in (SHORT, SHORTEST, BRANCHES))
        validity = f"code whose data stay in the first cache; {law.how_good()}; {short}"
        return Basis(f"counted C++ code on {self.entry.name}", law.source, law.provenance, validity)

    def power_basis(self) -> Iterator[Basis]:
        """Yield the basis of the power, if there are figures."""
        if self.entry.power is not None:
            power = self.entry.power
            yield Basis.of(f"power of {self.entry.name}", power, reserve=power.how_good())
