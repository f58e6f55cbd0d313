"""Laws of the execution time of code: counted interpreted code, and compiled code on a model of a core."""

from __future__ import annotations

from typing import Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from volery.base.errors import EstimateError
from volery.cost.figures import Figure, WithProvenance
from volery.cost.python_operations import STEPS_PER_NS, operation_table


class CodeLaw(WithProvenance):
    """The law of counted code in one language on one kind of processor.

    Law: time = reference time x slowdown x at_mhz / f. The reference time is what the code's operations take
    on the machine of ``operation_table``; the slowdown is the quotient of the times of a processor that runs
    at ``at_mhz`` and of that machine. The dependence on 1/f was confirmed on a Raspberry Pi 4: 158.3 s at
    1500 MHz and 401.5 s at 600 MHz for the same Python program, 2.54 for 2.5 (C. Mehta, *Performance Analysis
    of Languages on Raspberry Pi*).

    Validity: pure Python, in files that are counted, with warm caches. The error has two parts: that of the
    operations, measured on whole programs, and that of the slowdown.
    """

    language: str
    slowdown: Figure
    at_mhz: float
    processor: str = ""

    def ns_per_step(self, frequency_mhz: float) -> float:
        """Return the execution time of one counted step on the target, ns."""
        return self.slowdown.value * self.at_mhz / frequency_mhz / STEPS_PER_NS

    @property
    def error(self) -> float | None:
        """Relative error to be expected of a program's time; None where the slowdown's is not known."""
        if self.slowdown.error is None:
            return None
        return operation_table().mean_error + self.slowdown.error

    def how_good(self) -> str:
        """Return the expected error and its parts as a phrase."""
        table, slowdown = operation_table(), self.slowdown
        whole = "unknown" if self.error is None else f"{self.error:.0%}"
        factor = "" if slowdown.error is None else f" within {slowdown.error:.0%}"
        return (
            f"expected error {whole}: operations {table.provenance} ({table.mean_error:.0%} on average, "
            f"{table.worst_error:.0%} at worst, over {table.programs} programs), "
            f"the factor to this processor {slowdown.provenance}{factor}"
        )

    def warnings(self) -> tuple[str, ...]:
        """Return the warnings of a report that uses this law."""
        if self.slowdown.provenance == "measured":
            return ()
        return (
            f"the time of counted {self.language} code on {self.processor}: {self.how_good()}; "
            "run volery cost calibrate python on such a computer for a measured one",
        )


class OperationTiming(BaseModel):
    """One class of operations: ``latency`` in cycles, and how many may start in a cycle."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    latency: float
    per_cycle: float


PipeGroup = Literal["integer", "branch", "multiply", "divide", "load", "store", "vector", "slow"]


class IssueQueue(BaseModel):
    """Operations that wait for their operands before the pipes of these groups."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    entries: int = Field(gt=0)
    pipes: tuple[PipeGroup, ...] = Field(min_length=1)


class LibraryLaw(WithProvenance):
    """Cycles of calls into libraries by symbol; any other takes ``unknown`` cycles, and a report names it.

    Attributes:
        unknown: Cycles of any other call.
        calls: Cycles of a call in a row of independent ones.
        latencies: Cycles from the argument to the result; twice the cycles where it is not stated.
    """

    unknown: float
    calls: dict[str, float] = Field(default_factory=dict)
    latencies: dict[str, float] = Field(default_factory=dict)

    def cycles(self, symbol: str) -> tuple[float, float]:
        """Return the cycles of a call and its latency."""
        own = self.calls.get(symbol, self.unknown)
        return own, self.latencies.get(symbol, 2.0 * own)


class SimulatedCache(BaseModel):
    """A set-associative cache with lines of 64 bytes and least-recently-used replacement.

    ``latency`` is in cycles from a load that it serves to the use of the value. The first cache's latency is
    that of the load operations.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    bytes: int = Field(gt=0)
    ways: int = Field(gt=0)
    latency: float = Field(ge=0.0)


class MemoryLaw(WithProvenance):
    """The memory hierarchy: ``caches`` from the first one on, then memory.

    Attributes:
        latency_ns: Time from a load that memory serves to the use of the value, ns.
        bytes_per_ns: Bandwidth of memory for one core, bytes/ns.
    """

    caches: tuple[SimulatedCache, ...] = Field(min_length=1, max_length=4)
    latency_ns: float
    bytes_per_ns: float = Field(gt=0.0)


class TimeBand(NamedTuple):
    """Measured times over estimates: from ``low`` to ``high``, of code of one ``kind``."""

    low: float
    high: float
    kind: str

    def __str__(self) -> str:
        return f"{self.low:g} to {self.high:g} times this for {self.kind}"


SHORT_CYCLES, SHORTEST_CYCLES = 20_000.0, 2_000.0
BRANCHY = 0.3
"""Share of the cycles lost to mispredicted branches from which on code is of that kind."""

BRANCHES = TimeBand(0.58, 1.3, "code of mispredicted branches")
SHORTEST = TimeBand(0.5, 9.0, "an activation below 2,000 cycles, whose library calls and branches are cold")
SHORT = TimeBand(0.5, 2.2, "an activation below 20,000 cycles, whose library calls and branches are cold")
LONGER = TimeBand(0.7, 1.45, "an activation of its size")
"""Extremes of single activations that followed other code, on a Zen 4 and a Zen 5 with figures of their own
(``volery cost calibrate processor``): eighteen kernels and programs; see docs/native-simulation.md."""


def time_band(cycles: float, lost: float) -> TimeBand:
    """Return how far measured times lie from an estimate of compiled code.

    Args:
        cycles: Estimated cycles of the activation.
        lost: Share of them that is lost to mispredicted branches, 0..1.
    """
    if cycles < SHORTEST_CYCLES:
        return SHORTEST
    if cycles < SHORT_CYCLES:
        return SHORT
    return BRANCHES if lost > BRANCHY else LONGER


class CoreLaw(WithProvenance):
    """Figures of a kind of core for ``native.core_model``, which executes the machine code that ran.

    Cycles of a core and its caches do not depend on its frequency; the time of memory behind them does not
    depend on it either. Without ``memory`` every access hits the first cache.

    Attributes:
        isa: Instruction set, LLVM's name.
        cpu: Processor that code is generated for, LLVM's name.
        width: Instructions that enter per cycle.
        window: Entries of the reorder buffer.
        queues: Issue queues; operations of a group of pipes without one never wait for a free entry.
        refill: Cycles from the end of a mispredicted branch to the next instruction.
        accesses: Loads and stores that start in a cycle together, where that is fewer than both alone.
        forward: Cycles from a store to a load of the same address (store-to-load forwarding).
        computed: Cycles from a computed jump to the instruction at its target, where the history predicted
            another one than the usual.
        tables: Tagged tables of the branch predictor.
        history: Taken branches in the longest history of the branch predictor.
        error: Relative error band, None where it is not known.
    """

    name: str = ""
    isa: str
    cpu: str
    least_mhz: float
    greatest_mhz: float
    width: float
    window: int
    queues: tuple[IssueQueue, ...] = ()
    refill: float
    forward: float
    accesses: float | None = None
    computed: float = 1.0
    tables: int
    history: int
    error: float | None = None
    operations: dict[str, OperationTiming]
    library: LibraryLaw
    memory: MemoryLaw | None = None

    def how_good(self) -> str:
        """Return the error band as a phrase."""
        return "its error is not known" if self.error is None else f"within {self.error:.0%}"

    def check_frequency(self, frequency_mhz: float) -> None:
        """Raise ``EstimateError`` for a frequency outside the range of the figures."""
        check_range(self.name, frequency_mhz, self.least_mhz, self.greatest_mhz)


def check_range(name: str, frequency_mhz: float, least_mhz: float, greatest_mhz: float) -> None:
    """Raise ``EstimateError`` for a frequency of processor ``name`` outside the range of its laws."""
    if not least_mhz <= frequency_mhz <= greatest_mhz:
        raise EstimateError(
            f"{name}: {frequency_mhz:g} MHz is outside the range of its laws, "
            f"{least_mhz:g} to {greatest_mhz:g} MHz"
        )
