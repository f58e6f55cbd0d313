"""What compiled code costs on a core: the figures of a model of its pipeline.

Law: ``volery.cost.native.core_model`` executes what ran. Here stand the figures that it needs: for each class of
operations how long it takes and how many a core starts per cycle, how wide the core is, how far it looks
ahead, what a wrong prediction costs, and what calls of libraries cost.

Cycles of the core, its caches included, do not depend on its frequency; the time that memory behind them
takes does not depend on it either.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from volery.base.errors import EstimateError
from volery.cost.figure import Stated

__all__ = ["Cache", "CoreLaw", "LibraryLaw", "MemoryLaw", "Operation"]


class Operation(BaseModel):
    """One class of operations: ``latency`` in cycles; ``per_cycle`` of them may start in a cycle."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    latency: float
    per_cycle: float


class LibraryLaw(Stated):
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


class MemoryLaw(Stated):
    """What lies behind the first cache, from there on: ``caches`` with the first, then memory.

    ``latency_ns``: from a load that memory serves to its use; ``bytes_per_ns`` it gives to one core at most.
    """

    caches: tuple[Cache, ...] = Field(min_length=1, max_length=4)
    latency_ns: float
    bytes_per_ns: float = Field(gt=0.0)


class CoreLaw(Stated):
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
    operations: dict[str, Operation]
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
