"""What a component's own computing costs: stated (fidelity ``times``), counted (fidelity ``code``) or
nothing.

Amounts are target time: what the processor of the component's place takes at its frequency. Whoever builds
the run scales them before; this module only says which amount belongs to what. A missing figure is an error,
never zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from volery.base.errors import EstimateError, choices
from volery.base.time import Ns


@dataclass(frozen=True, slots=True)
class Cost:
    """Execution time in ns on the target and, where the model states it, energy in joules."""

    time: Ns
    energy: float = 0.0


ZERO_COST = Cost(0)


class Pricing(Protocol):
    """Asked at each visit and at each release of an activation."""

    @property
    def ns_per_step(self) -> float:
        """What a counted step of Python takes on the target, ns; 0.0 where code is not counted."""

    def operation(self, component: str, operation: str) -> Cost:
        """What serving a call of *operation* costs, beside what is counted."""

    def activation(self, component: str) -> Cost:
        """What an activation costs, beside what is counted."""

    def check(self, component: str, operations: Iterable[str], active: bool) -> None:
        """Raise ``EstimateError`` if a figure is missing that a run may ask for."""


@dataclass(frozen=True)
class StatedPricing:
    """Fidelity ``times``: the figures of the model, by operation and for an activation (``None``: not
    stated).
    """

    operations: Mapping[str, Cost] = field(default_factory=dict)
    per_activation: Cost | None = None
    ns_per_step: float = 0.0

    def operation(self, component: str, operation: str) -> Cost:
        """The stated figure; ``EstimateError`` if there is none."""
        if operation not in self.operations:
            raise EstimateError(
                f"{component}: no time is stated for its operation {operation!r} on the processor it is "
                f"allocated to (stated: {choices(self.operations)}); state one in the model, or run with "
                "fidelity 'code'"
            )
        return self.operations[operation]

    def activation(self, component: str) -> Cost:
        """The stated figure; ``EstimateError`` if there is none."""
        if self.per_activation is None:
            raise EstimateError(
                f"{component}: it is active, but no time is stated for an activation on the processor it is "
                f"allocated to; state 'activation' in the model, or run with fidelity 'code'"
            )
        return self.per_activation

    def check(self, component: str, operations: Iterable[str], active: bool) -> None:
        """Ask for everything once."""
        for operation in operations:
            self.operation(component, operation)
        if active:
            self.activation(component)


@dataclass(frozen=True)
class CountedPricing:
    """Fidelity ``code``: the steps of the component's Python code are counted, ``ns_per_step`` each."""

    ns_per_step: float

    def operation(self, component: str, operation: str) -> Cost:
        """Nothing but what is counted."""
        return ZERO_COST

    def activation(self, component: str) -> Cost:
        """Nothing but what is counted."""
        return ZERO_COST

    def check(self, component: str, operations: Iterable[str], active: bool) -> None:
        """Nothing can be missing."""


FREE: Pricing = CountedPricing(0.0)
"""For what surrounds the system (requesters, provider) and for real hardware, where computing takes its own
time.
"""
