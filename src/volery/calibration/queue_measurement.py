"""Sizes of this machine's reorder buffer and issue queues, by the method of Wong.

Two loads that miss every cache overlap if the core reaches the second before the first has ended. Between
them are ``n`` other instructions: the reorder buffer holds all of them, an issue queue those that wait for
the first load. The largest ``n`` for which the two still overlap is the number of entries (H. Wong,
*Measuring Reorder Buffer Capacity*, 2013). Two kinds of operations that alternate fill one queue, or two:
that shows which pipes share a queue.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from statistics import median_low
from tempfile import TemporaryDirectory

from volery.cost import IssueQueue, PipeGroup
from volery.cost.native import llvm_toolchain, run_tool

WINDOW, INTEGER, VECTOR, LOADS, INTEGER_VECTOR, INTEGER_LOADS = (
    "window", "integer", "vector", "loads", "integer_vector", "integer_loads",
)  # fmt: skip

_INTEGER = tuple(f"add %%rcx, %%r{number}" for number in range(8, 12))
_VECTOR = tuple(f"addsd %%xmm0, %%xmm{number}" for number in range(1, 5))
_LOAD = ("mov (%%rdx,%%rax), %%r12",)
FILLERS = {
    WINDOW: ("mov $1, %%r8d", "addsd %%xmm0, %%xmm1", "jc 1f; 1:", "mov $1, %%r9d"),
    INTEGER: _INTEGER,
    VECTOR: _VECTOR,
    LOADS: _LOAD,
    INTEGER_VECTOR: tuple(one for pair in zip(_INTEGER, _VECTOR, strict=True) for one in pair),
    INTEGER_LOADS: tuple(one for add in _INTEGER for one in (add, *_LOAD)),
}
"""Instructions between the two loads; those that fill a queue depend on the first load by rcx, rax or xmm0.

Those that fill the reorder buffer execute at once, and no more of them write registers of one file than it
has. A ``nop`` would do, but an AMD Zen 4 keeps two of them, or two zeros, in one entry.
"""
_TO_INTEGER, _TO_VECTOR = ("mov {0}, %%rcx",), ("movq {0}, %%xmm0",)
_TO_ADDRESS = ("mov {0}, %%rax", "and $0, %%eax")
LINKS: dict[str, tuple[str, ...]] = {
    WINDOW: (),
    INTEGER: _TO_INTEGER,
    VECTOR: _TO_VECTOR,
    LOADS: _TO_ADDRESS,
    INTEGER_VECTOR: _TO_INTEGER + _TO_VECTOR,
    INTEGER_LOADS: _TO_INTEGER + _TO_ADDRESS,
}
"""How the value of the first load, ``{0}``, reaches the instructions."""

STEPS = {WINDOW: tuple(range(48, 817, 16))}
QUEUE_STEPS = tuple(range(12, 301, 4))
ATTEMPTS = 5
ONE_QUEUE = 1.4
"""Two queues of one size hold twice as many alternating operations as each alone; one queue holds as many."""
ASSUMED_WINDOW = 512
"""Entries of a large core, where the reorder buffer is not found."""
COMPUTING: tuple[PipeGroup, ...] = ("integer", "branch", "multiply", "divide")
FLOATING: tuple[PipeGroup, ...] = ("vector", "slow")


@dataclass(frozen=True)
class QueueSizes:
    """Entries by kind of filler; a kind without an edge between its smallest and largest number is absent."""

    found: dict[str, int]

    @property
    def window(self) -> int:
        """Entries of the reorder buffer, assumed where they were not found."""
        return self.found.get(WINDOW, ASSUMED_WINDOW)

    def assumed(self) -> tuple[str, ...]:
        """Return the names of the figures that are assumed."""
        return () if WINDOW in self.found else ("the window",)

    def issue_queues(self) -> tuple[IssueQueue, ...]:
        """Return the queues; operations that share one are together in it."""
        queues: list[IssueQueue] = []
        integer = self.found.get(INTEGER)
        if integer is None:
            return ()
        shared: tuple[PipeGroup, ...] = COMPUTING
        pools: tuple[tuple[str, str, tuple[PipeGroup, ...]], ...] = (
            (VECTOR, INTEGER_VECTOR, FLOATING), (LOADS, INTEGER_LOADS, ("load",)),
        )  # fmt: skip
        for alone, both, pipes in pools:
            own = self.found.get(alone)
            if own is None:
                continue
            if both in self.found and self.found[both] < ONE_QUEUE * min(integer, own):
                shared += pipes
            else:
                queues.append(IssueQueue(entries=own, pipes=pipes))
        return (IssueQueue(entries=integer, pipes=shared), *queues)


def measure_queues() -> QueueSizes:
    """Measure the sizes: the median of several attempts each, since other processes disturb some."""
    found: dict[str, list[int]] = {}
    with TemporaryDirectory(prefix="volery-queues-") as made:
        folder = Path(made)
        (folder / "queues.c").write_text(source(), encoding="utf-8")
        out = folder / "queues"
        run_tool([llvm_toolchain().clang, "-x", "c", "-O1", "-w", str(folder / "queues.c"), "-o", str(out)])
        for line in run_tool([str(out), str(ATTEMPTS)]).splitlines():
            name, entries = line.split()
            found.setdefault(name, []).append(int(entries))
    return QueueSizes({name: size for name, sizes in found.items() if (size := median_low(sizes)) > 0})


def source() -> str:
    """Return the program: functions by kind and number of instructions, and the search for the edge."""
    kinds = [
        f"static const Probe {kind}[] = {{{', '.join(f'{{{n}, {kind}_{n}}}' for n in steps_of(kind))}}};\n"
        f"#define {kind}_count {len(steps_of(kind))}\n"
        for kind in FILLERS
    ]
    named = ", ".join(f'{{"{kind}", {kind}, {kind}_count}}' for kind in FILLERS)
    body = files("volery.calibration").joinpath("queues.c").read_text(encoding="utf-8")
    return body.replace("/* PROBES */", "".join(_functions()) + "".join(kinds) + f"#define KINDS {named}\n")


def steps_of(kind: str) -> tuple[int, ...]:
    """Return the numbers of instructions that are tried."""
    return STEPS.get(kind, QUEUE_STEPS)


def _functions() -> Iterator[str]:
    for kind, fillers in FILLERS.items():
        for count in steps_of(kind):
            body = [fillers[number % len(fillers)] for number in range(count)]
            text: list[str] = []
            for pointer in ("%%rsi", "%%rdi"):
                text += [f"mov ({pointer}), {pointer}", *(one.format(pointer) for one in LINKS[kind]), *body]
            yield f'static void {kind}_{count}(long passes) {{ CHASE("{"; ".join(text)}"); }}\n'
