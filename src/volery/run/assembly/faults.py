"""Faults that a scenario injects: something of a vehicle breaks at a stated time, for good or for a while."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from volery.kernel.api import Kernel
from volery.model.faults import Fault
from volery.run.assembly.simulated_fleet import SimulatedFleet
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.trace.events import Text

Break = Callable[[Flight, bool], None]
"""Breaks something of a vehicle (True), or mends it (False)."""

WARNING = 4

KINDS: Mapping[str, Break] = {
    "gps-lost": lambda flight, broken: flight.block_gps(broken),
    "barometer-stuck": lambda flight, broken: flight.block_barometer(broken),
    "compass-stuck": lambda flight, broken: flight.block_compass(broken),
    "motor-dead": lambda flight, broken: flight.weaken_motor(0, 0.0 if broken else 1.0),
}
"""By the name that a model uses."""


def inject(kernel: Kernel, airfield: SimulatedFleet, faults: Iterable[Fault]) -> None:
    """Let every fault happen at its time, and end when it ends; both are told to the trace."""
    for fault in faults:
        kernel.call_at(fault.at_ns, _act(kernel, airfield, fault, broken=True))
        if fault.duration_ns is not None:
            kernel.call_at(fault.at_ns + fault.duration_ns, _act(kernel, airfield, fault, broken=False))


def _act(kernel: Kernel, airfield: SimulatedFleet, fault: Fault, *, broken: bool) -> Callable[[], None]:
    def act() -> None:
        words = f"fault {fault.name}: {fault.kind}" if broken else f"fault {fault.name} is over"
        kernel.record(Text(kernel.now(), fault.subject, WARNING, words))
        KINDS[fault.kind](airfield.flights[fault.subject], broken)

    return act
