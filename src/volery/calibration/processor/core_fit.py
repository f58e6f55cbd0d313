"""From the times of microbenchmarks to the figures of a core."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil

from volery.calibration.host_machine import Machine
from volery.calibration.processor.microbenchmarks import (
    BEHIND,
    CHAIN,
    FORWARDED,
    FREE,
    LIBRARY,
    NEVER,
    RANDOM,
    ROW,
    SECOND,
    SNIPPETS,
    THIRD,
    WIDTH,
    Timing,
    caches,
    memory_bytes,
)
from volery.cost import Cache, CoreLaw, LibraryLaw, MemoryLaw, OperationTiming

WINDOW, TABLES, HISTORY = 512, 12, 60
"""Not measured: values of a large core; the predictor's were chosen on the kernels' first two inputs."""

LINE_BYTES = 64.0

SHARE_OF_REFILL = 2.0
"""Cycles of a misprediction in which the branch itself executes: the rest is the refill."""

PIPES_ARE_WHOLE = 0.2
"""Fraction that is rounded down: a core has whole pipes and noise only slows, so 2.6 a cycle are three pipes
and 2.1 are two."""

ALSO = {"malloc": "_Znwm", "free": "_ZdlPvm", "sin": "sincos"}
"""Symbols with the time of another one: operators new and delete, both functions of an angle."""


def core_law(machine: Machine, isa: str, taken: Mapping[str, Timing]) -> CoreLaw:
    """Return the figures of the core. Latencies are whole cycles; below half a cycle nothing is executed.

    Args:
        machine: The computer.
        isa: Its instruction set.
        taken: Times of all snippets.
    """
    operations: dict[str, OperationTiming] = {}
    for name, snippet in SNIPPETS[isa].items():
        beside = sum(operations[one].latency for one in snippet.less)
        latency = max(0.0, (taken[CHAIN + name].cycles - beside) / snippet.links)
        operations[name] = OperationTiming(
            latency=round(latency), per_cycle=_pipes(taken[FREE + name].cycles)
        )
    for name in ("store", "branch"):  # no instruction depends on their end
        operations[name] = OperationTiming(latency=1.0, per_cycle=operations[name].per_cycle)
    operations["fp_fma"] = operations["fp_multiply"]
    mispredicted = 2.0 * (taken[RANDOM].cycles - taken[NEVER].cycles)
    mhz = round(sorted(one.mhz for one in taken.values())[len(taken) // 2])
    return CoreLaw(
        name=machine.name,
        isa=isa,
        cpu="x86-64" if isa == "x86_64" else "generic",
        provenance="measured",
        source=f"volery calibrate processor on {machine.description}",
        validity="the window and the prediction of branches are assumed",
        least_mhz=mhz * 0.5,
        greatest_mhz=mhz,
        width=_pipes(min(taken[WIDTH].cycles, taken[FREE + "increment"].cycles)),
        refill=round(max(1.0, mispredicted - SHARE_OF_REFILL), 1),
        forward=round(max(0.0, taken[FORWARDED].cycles - operations["fp_add"].latency)),
        operations=operations,
        library=_library(taken),
        memory=_memory(taken, operations["load"].latency, mhz),
        window=WINDOW,
        tables=TABLES,
        history=HISTORY,
    )


def _pipes(cycles: float) -> float:
    per_cycle = 1.0 / max(cycles, 1e-3)
    whole = per_cycle > 1.0 - PIPES_ARE_WHOLE
    return float(max(1, ceil(per_cycle - PIPES_ARE_WHOLE))) if whole else round(per_cycle, 3)


def _memory(taken: Mapping[str, Timing], load: float, mhz: float) -> MemoryLaw:
    """Return the caches with the sizes that the system reports, and memory."""
    first, second, third = caches()
    behind_ns = taken[BEHIND].cycles * 1000.0 / mhz
    row_ns = taken[ROW].cycles * 1000.0 / mhz
    known = [
        Cache(bytes=first.bytes, ways=first.ways, latency=load),
        Cache(bytes=second.bytes, ways=second.ways, latency=round(taken[SECOND].cycles)),
    ]
    if third != second:
        known.append(Cache(bytes=third.bytes, ways=third.ways, latency=round(taken[THIRD].cycles)))
    return MemoryLaw(
        provenance="measured",
        source=f"loads round a circle, and in a row, of {memory_bytes() >> 20} MiB; sizes by the system",
        caches=tuple(known),
        latency_ns=round(behind_ns, 1),
        bytes_per_ns=round(LINE_BYTES / row_ns, 2),
    )


def _library(taken: Mapping[str, Timing]) -> LibraryLaw:
    calls = {
        name.removeprefix(LIBRARY): round(one.cycles, 1)
        for name, one in taken.items()
        if name.startswith(LIBRARY)
    }
    both = calls.pop("malloc_free")
    calls |= {"malloc": round(both / 2.0, 1), "free": round(both / 2.0, 1)}
    calls |= {symbol: calls[name] for name, symbol in ALSO.items()}
    return LibraryLaw(
        provenance="measured",
        source="calls in a row, with arguments as a robot's code has them",
        unknown=sorted(calls.values())[len(calls) // 2],
        calls=calls,
    )
