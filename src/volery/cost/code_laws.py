"""What counted code costs on a processor.

Law: time = reference time x slowdown x at_mhz / f. The reference time is what the code's operations take on
the machine of the table in ``interpreter``; the slowdown is how many times as long a processor takes that
runs at ``at_mhz``. That it goes with 1/f is what a Raspberry Pi 4 showed: 158.3 s at 1500 MHz and 401.5 s at
600 MHz for the same Python program, 2.54 for 2.5 (C. Mehta, *Performance Analysis of Languages on Raspberry
Pi*).

Validity: pure Python, in files that are counted, with warm caches. The error has two parts: that of the
operations, measured on whole programs, and that of the slowdown.

What compiled code costs on a core: the figures of a model of its pipeline.

Law: ``volery.cost.native.core_model`` executes what ran. Here stand the figures that it needs: for each class of
operations how long it takes and how many a core starts per cycle, how wide the core is, how far it looks
ahead, what a wrong prediction costs, and what calls of libraries cost.

Cycles of the core, its caches included, do not depend on its frequency; the time that memory behind them
takes does not depend on it either.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from volery.base.errors import EstimateError
from volery.cost.figures import Figure, WithProvenance
from volery.cost.python_operations import STEPS_PER_NS, OperationTable, operation_table


class CodeLaw(WithProvenance):
    """The law of one language on one kind of processor."""

    language: str
    slowdown: Figure
    at_mhz: float
    processor: str = ""

    def ns_per_step(self, frequency_mhz: float) -> float:
        """Target time of one counted step, ns."""
        return self.slowdown.value * self.at_mhz / frequency_mhz / STEPS_PER_NS

    @property
    def operations(self) -> OperationTable:
        """The table behind it."""
        return operation_table()

    @property
    def error(self) -> float | None:
        """Relative, to be expected of a program's time; ``None`` where the slowdown's is not known."""
        if self.slowdown.error is None:
            return None
        return self.operations.mean_error + self.slowdown.error

    def how_good(self) -> str:
        """In words: the error and what it consists of."""
        table, slowdown = self.operations, self.slowdown
        whole = "unknown" if self.error is None else f"{self.error:.0%}"
        factor = "" if slowdown.error is None else f" within {slowdown.error:.0%}"
        return (
            f"expected error {whole}: operations {table.provenance} ({table.mean_error:.0%} on average, "
            f"{table.worst_error:.0%} at worst, over {table.programs} programs), "
            f"the factor to this processor {slowdown.provenance}{factor}"
        )

    def warnings(self) -> tuple[str, ...]:
        """What a report has to say where this law is used."""
        if self.slowdown.provenance == "measured":
            return ()
        return (
            f"the time of counted {self.language} code on {self.processor}: {self.how_good()}; "
            "run volery calibrate python on such a computer for a measured one",
        )


__all__ = ["Cache", "CoreLaw", "LibraryLaw", "MemoryLaw", "OperationTiming"]


class OperationTiming(BaseModel):
    """One class of operations: ``latency`` in cycles; ``per_cycle`` of them may start in a cycle."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    latency: float
    per_cycle: float


class LibraryLaw(WithProvenance):
    """Cycles of calls into libraries, by symbol; any other takes ``unknown``, and a report names it."""

    unknown: float
    calls: dict[str, float] = Field(default_factory=dict)


class Cache(BaseModel):
    """A cache of lines of 64 bytes, the one that was not used for longest leaves first.

    ``latency``: cycles from a load that it serves to its use; the first one's is that of the operations.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    bytes: int = Field(gt=0)
    ways: int = Field(gt=0)
    latency: float = Field(ge=0.0)


class MemoryLaw(WithProvenance):
    """What lies behind the first cache, from there on: ``caches`` with the first, then memory.

    ``latency_ns``: from a load that memory serves to its use; ``bytes_per_ns`` it gives to one core at most.
    """

    caches: tuple[Cache, ...] = Field(min_length=1, max_length=4)
    latency_ns: float
    bytes_per_ns: float = Field(gt=0.0)


class CoreLaw(WithProvenance):
    """A kind of core.

    ``isa`` and ``cpu`` are LLVM's names; code is made for ``cpu``. ``window``: how many instructions may be
    under way; ``refill``: cycles from the end of a mispredicted branch to the next instruction; ``forward``:
    from a store to a load of the same place; ``tables``, ``history``: of the prediction of branches, and how
    many taken ones it looks back on. ``error`` is the honest relative band, ``None`` where it is not known.
    Without ``memory`` every access is taken to hit the first cache.
    """

    name: str = ""
    isa: str
    cpu: str
    least_mhz: float
    greatest_mhz: float
    width: float
    window: int
    refill: float
    forward: float
    tables: int
    history: int
    error: float | None = None
    operations: dict[str, OperationTiming]
    library: LibraryLaw
    memory: MemoryLaw | None = None

    def how_good(self) -> str:
        """The honest band, in words."""
        return "its error is not known" if self.error is None else f"within {self.error:.0%}"

    def check_frequency(self, frequency_mhz: float) -> None:
        """``EstimateError`` for a frequency at which this core does not run."""
        if not self.least_mhz <= frequency_mhz <= self.greatest_mhz:
            raise EstimateError(
                f"{self.name}: {frequency_mhz:g} MHz is outside the range of its laws, "
                f"{self.least_mhz:g} to {self.greatest_mhz:g} MHz"
            )
