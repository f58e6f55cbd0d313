"""Figures of this machine's core, for the cost of compiled code, from microbenchmarks.

Snippets of assembly are compiled into one program with ``measure.c`` and timed in cycles: each against a loop
of dependent additions, one a cycle, since the frequency of the core is neither known nor constant. They give
latency and throughput of each class of operations, branches, caches and library calls. Results are kept after
each snippet, so that an interrupted calibration continues.
"""

from __future__ import annotations

import json
import math
import platform
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib.resources import files
from math import ceil
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory
from typing import NamedTuple

from volery.base.errors import UsageError
from volery.calibration.host_machine import Machine
from volery.calibration.queue_measurement import QueueSizes
from volery.cost import CoreLaw, LibraryLaw, MemoryLaw, OperationTiming, SimulatedCache
from volery.cost.native import llvm_toolchain, run_tool


@dataclass(frozen=True)
class AssemblySnippet:
    """Assembly of one class of operations, for the ``asm`` of GCC and clang.

    Attributes:
        chain: A link of a dependent chain, for the latency.
        free: An independent operation, for the throughput; ``{0}`` is the number of one of eight registers.
        links: Operations in ``chain``.
        less: Classes of other operations in ``chain``, whose latency is subtracted.
    """

    chain: str
    free: str
    links: int = 1
    less: tuple[str, ...] = ()


X86_64 = {
    "alu": AssemblySnippet("add %%rbx, %%rax", "add %%rbx, %%r{0}"),
    "increment": AssemblySnippet("add $1, %%rax", "add $1, %%r{0}"),
    "move": AssemblySnippet("mov %%rax, %%rcx; mov %%rcx, %%rax", "mov %%rbx, %%r{0}", links=2),
    "shift": AssemblySnippet("shl $3, %%rax", "shl $3, %%r{0}"),
    "shifted_alu": AssemblySnippet("lea 1(%%rax,%%rax,4), %%rax", "lea 1(%%rbx,%%rbx,4), %%r{0}"),
    "multiply": AssemblySnippet("imul %%rax, %%rax", "imul %%rbx, %%r{0}"),
    "divide32": AssemblySnippet(
        "xor %%edx, %%edx; div %%ebx", "mov %%r{0}d, %%eax; xor %%edx, %%edx; div %%ebx"
    ),
    "divide64": AssemblySnippet(
        "xor %%edx, %%edx; div %%rbx", "mov %%r{0}, %%rax; xor %%edx, %%edx; div %%rbx"
    ),
    "load": AssemblySnippet("mov 16(%%rsi,%%rcx), %%rcx", "mov 16+8*{0}(%%rsi), %%r{0}"),
    "transfer": AssemblySnippet("movq %%xmm0, %%rcx; movq %%rcx, %%xmm0", "movq %%rbx, %%xmm{0}", links=2),
    "load_vector": AssemblySnippet(
        "movsd 16(%%rsi,%%rcx), %%xmm0; movq %%xmm0, %%rcx",
        "movsd 16+8*{0}(%%rsi), %%xmm{0}",
        less=("transfer",),
    ),
    "store": AssemblySnippet("mov %%rbx, 256(%%rsi)", "mov %%rbx, 256+8*{0}(%%rsi)"),
    "branch": AssemblySnippet("jo 1f; 1:", "jo 1f; 1:"),
    "vector": AssemblySnippet("paddd %%xmm2, %%xmm3", "paddd %%xmm2, %%xmm{0}"),
    "vector_move": AssemblySnippet(
        "movaps %%xmm0, %%xmm4; movaps %%xmm4, %%xmm0", "movaps %%xmm0, %%xmm{0}", links=2
    ),
    "shuffle": AssemblySnippet("unpcklps %%xmm1, %%xmm0", "unpcklpd %%xmm0, %%xmm{0}"),
    "vector_multiply": AssemblySnippet("pmuludq %%xmm2, %%xmm3", "pmuludq %%xmm2, %%xmm{0}"),
    "fp_add": AssemblySnippet(
        "andpd %%xmm0, %%xmm0; addsd %%xmm1, %%xmm0", "addsd %%xmm0, %%xmm{0}", less=("vector",)
    ),
    "fp_multiply": AssemblySnippet("mulsd %%xmm1, %%xmm0", "mulsd %%xmm0, %%xmm{0}"),
    "fp_compare": AssemblySnippet("maxsd %%xmm1, %%xmm0", "maxsd %%xmm0, %%xmm{0}"),
    "fp_divide32": AssemblySnippet("divss %%xmm1, %%xmm0", "divss %%xmm0, %%xmm{0}"),
    "fp_divide64": AssemblySnippet("divsd %%xmm1, %%xmm0", "divsd %%xmm0, %%xmm{0}"),
    "fp_root32": AssemblySnippet("sqrtss %%xmm0, %%xmm0", "sqrtss %%xmm0, %%xmm{0}"),
    "fp_root64": AssemblySnippet("sqrtsd %%xmm0, %%xmm0", "sqrtsd %%xmm0, %%xmm{0}"),
    "convert": AssemblySnippet(
        "cvtps2pd %%xmm0, %%xmm0; cvtpd2ps %%xmm0, %%xmm0", "cvtps2pd %%xmm0, %%xmm{0}", links=2
    ),
    "conditional": AssemblySnippet("cmovo %%rbx, %%rax", "cmovo %%rbx, %%r{0}"),
    "convert_integer": AssemblySnippet(
        "cvtsi2sd %%rax, %%xmm0; cvttsd2si %%xmm0, %%rax", "cvttsd2si %%xmm0, %%r{0}", links=2
    ),
    "fp_flags": AssemblySnippet(
        "ucomisd %%xmm0, %%xmm1; setp %%cl; movq %%rcx, %%xmm0",
        "ucomisd %%xmm0, %%xmm{0}",
        less=("conditional", "transfer"),
    ),
    "vector_shift": AssemblySnippet("pslld $3, %%xmm0", "pslld $3, %%xmm{0}"),
    "store_vector": AssemblySnippet("movsd %%xmm0, 256(%%rsi)", "movsd %%xmm0, 256+8*{0}(%%rsi)"),
}
"""``rbx`` holds 3, ``rsi`` points to two numbers and zeros, ``rcx`` is 0, ``xmm1`` is a little above 1."""

SNIPPETS = {"x86_64": X86_64}

FORWARD = {"x86_64": "addsd %%xmm1, %%xmm0; movsd %%xmm0, 256(%%rsi); movsd 256(%%rsi), %%xmm0"}
"""A sum through memory: its latency less that of the sum is that of store-to-load forwarding."""

ACCESSES_OF = {"x86_64": "mov 16(%%rsi), %%r{0}; mov %%rbx, 256+8*{0}(%%rsi)"}
"""A load and a store."""

NOTHING = {"x86_64": "xor %%r{0}d, %%r{0}d"}
"""An instruction that enters and executes nowhere. Cores fuse ``nop`` with its neighbours."""

_CHANGED = ("rax", "rbx", "rcx", "rdx", *(f"r{n}" for n in range(8, 16)), *(f"xmm{n}" for n in range(16)))
PROLOGUE = {
    "x86_64": (
        "mov $3, %%ebx; mov $1, %%eax; mov $1, %%edx; movsd 8(%%rsi), %%xmm0; movsd (%%rsi), %%xmm1;"
        "xor %%ecx, %%ecx; movd %%ebx, %%xmm2; movd %%ebx, %%xmm3; .balign 64; 2:",
        "dec %%rdi; jnz 2b",
        ('"+S"', '"+D"'),
        ", ".join(f'"{name}"' for name in (*_CHANGED, "cc", "memory")),
    )
}
"""Text before a loop and at its end, constraints of the pointer and the passes, and changed registers."""

IF_ODD = {
    "x86_64": '__asm__ volatile("test $1, %b1; je 1f; add $1, %0; 1:" : "+r"(taken) : "r"(bits) : "cc")',
}
"""A branch by the lowest bit of a register whose value is available at once."""


CHAIN, FREE, LIBRARY, DELAY, MEMORY = "chain_", "free_", "library_", "delay_", "memory_"
RANDOM, NEVER, WIDTH, FORWARDED = "branches_random", "branches_never", "width", "forward"
ACCESSES, ONE_TARGET, MANY_TARGETS = "accesses", "jumps_one", "jumps_many"
SECOND, THIRD, BEHIND, ROW = "memory_second", "memory_third", "memory_behind", "memory_row"
LARGEST_THIRD = 32 << 20
"""Largest third cache, bytes: a larger one is shared by many cores and counts as memory."""
UNROLLED, PASSES = 240, 40
"""Links of a chain in a loop, so that its jump is negligible, and passes of the loop."""
BRANCHES = CALLS = LOADS = 64
"""Branches, calls and lines of memory in a pass of ``measure.c``."""

ROUNDS, MOST_ROUNDS = 15, 150
MAX_SPREAD = 0.01
"""Largest relative spread of a precise median: half its inter-quartile range over the root of the rounds."""


@dataclass(frozen=True)
class Timing:
    """Cycles of one operation (median), its relative spread, the rounds, and the frequency meanwhile, MHz."""

    cycles: float
    spread: float
    rounds: int
    mhz: float

    @property
    def tight(self) -> bool:
        """Whether the median is precise; False if the machine was too noisy."""
        return self.spread <= MAX_SPREAD


def isa() -> str:
    """Return the instruction set of this machine; raise ``UsageError`` if there are no snippets for it."""
    here = platform.machine()
    if here not in SNIPPETS:
        raise UsageError(f"no snippets for {here} yet: code is calibrated on {' and '.join(SNIPPETS)} only")
    return here


def build(folder: Path) -> Path:
    """Compile the program in ``folder``; raise ``UsageError`` if the compiler is missing."""
    (folder / "measure.c").write_text(source(), encoding="utf-8")
    (folder / "library.h").write_text(_library(), encoding="utf-8")
    out = folder / "measure"
    options = ["-x", "c", "-O1", "-fno-builtin", "-fno-math-errno", "-w"]
    run_tool([llvm_toolchain().clang, *options, str(folder / "measure.c"), "-lm", "-o", str(out)])
    return out


def source() -> str:
    """Return the program."""
    body = files("volery.calibration").joinpath("measure.c").read_text(encoding="utf-8")
    return _generated(isa()) + body


def snippet_names() -> tuple[str, ...]:
    """Return the names of all snippets."""
    library = (*(LIBRARY + name for name in _calls()), *(DELAY + name for name in _functions_of_x()))
    branches, memory = (RANDOM, NEVER, ONE_TARGET, MANY_TARGETS), (SECOND, THIRD, BEHIND, ROW)
    return (*(name for name, _, _ in _loops(isa()) if name != "tick"), *branches, *memory, *library)


def time_snippet(program: Path, name: str) -> Timing:
    """Time a snippet until its median is precise, for at most ``MOST_ROUNDS`` rounds."""
    each = BRANCHES if name in (RANDOM, NEVER, ONE_TARGET, MANY_TARGETS) else UNROLLED * PASSES
    each = CALLS if name.startswith((LIBRARY, DELAY, MEMORY)) else each
    cycles: list[float] = []
    ticks: list[float] = []
    while True:
        for took, tick in _rounds(program, name):
            cycles.append(took / tick * UNROLLED * PASSES / each)
            ticks.append(tick)
        spread = _spread(cycles)
        if spread <= MAX_SPREAD or len(cycles) >= MOST_ROUNDS:
            mhz = 1000.0 * UNROLLED * PASSES / median(ticks)
            return Timing(median(cycles), spread, len(cycles), mhz)


def _rounds(program: Path, name: str) -> Iterator[tuple[float, float]]:
    for line in run_tool([str(program), name, str(ROUNDS)]).splitlines():
        _, took, tick = line.split()
        yield float(took), float(tick)


def _spread(values: list[float]) -> float:
    low, _, high = quantiles(values, n=4)
    return float((high - low) / 2.0 / math.sqrt(len(values)) / max(median(values), 1e-12))


def _loops(machine: str) -> list[tuple[str, str, int]]:
    """Return all loops as (name, snippet, repetitions of the snippet)."""
    loops = [("tick", SNIPPETS[machine]["alu"].chain, UNROLLED)]
    for name, snippet in SNIPPETS[machine].items():
        loops.append((CHAIN + name, snippet.chain, UNROLLED))
        loops.append((FREE + name, _eight(snippet.free), UNROLLED // 8))
    loops.append((FORWARDED, FORWARD[machine], UNROLLED))
    loops.append((ACCESSES, _eight(ACCESSES_OF[machine]), UNROLLED // 16))
    loops.append((WIDTH, _eight(NOTHING[machine]), UNROLLED // 8))
    return loops


def _eight(snippet: str) -> str:
    """Return a snippet with each of eight registers."""
    return ";".join(snippet.format(number) for number in range(8, 16))


class CacheGeometry(NamedTuple):
    """Size and associativity of a cache of this machine."""

    bytes: int
    ways: int


def caches() -> tuple[CacheGeometry, CacheGeometry, CacheGeometry]:
    """Return the data caches of this machine, from the first on.

    A cache that the system does not report is taken to have a usual size. The third is equal to the second
    where there is none or where it counts as memory.
    """
    found = dict(_found())
    first, second = found.get(1, CacheGeometry(32 << 10, 8)), found.get(2, CacheGeometry(512 << 10, 8))
    third = found.get(3, second)
    return first, second, third if third.bytes <= LARGEST_THIRD else second


def memory_bytes() -> int:
    """Return a number of bytes that exceeds the caches, but not the reach of the translation buffer."""
    _, second, third = caches()
    return 2 * third.bytes if third != second else 8 * second.bytes


def _found() -> Iterator[tuple[int, CacheGeometry]]:
    """Yield the caches that Linux reports, with their levels."""
    for one in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        with suppress(OSError, ValueError):
            size, ways, level, kind = (
                (one / name).read_text(encoding="ascii").strip()
                for name in ("size", "ways_of_associativity", "level", "type")
            )
            if kind != "Instruction" and int(ways) > 0:
                yield int(level), CacheGeometry(int(size.removesuffix("K")) << 10, int(ways))


def _library() -> str:
    return files("volery.calibration").joinpath("library.h").read_text(encoding="utf-8")


def _calls() -> list[str]:
    return re.findall(r"^LIBRARY\((\w+),", _library(), re.MULTILINE)


def _functions_of_x() -> list[str]:
    """Return the names of calls whose result is a number that depends on X."""
    return re.findall(r"^LIBRARY\((?!snprintf)(\w+),.*\bX\b", _library(), re.MULTILINE)


def _generated(machine: str) -> str:
    """Return the text before ``measure.c``: the loops and the table of cases."""
    begin, end, (numbers, passes), changed = PROLOGUE[machine]
    first, second, third = caches()
    out = [
        f"#define IN_SECOND {min(4 * first.bytes, second.bytes // 2)}\n",
        f"#define IN_THIRD {third.bytes // 2}\n",
        f"#define BEHIND {memory_bytes()}\n",
        "static double numbers[64] = {1.0000137, 1.3719};\n",
        f"#define BRANCH_IF_ODD(bits, taken) {IF_ODD[machine]}\n",
    ]
    for name, snippet, times in _loops(machine):
        out.append(
            f"static void {name}(long passes) {{\n    for (; passes > 0; --passes) {{\n"
            f"        double *at = numbers;\n        long left = {PASSES};\n"
            f'        __asm__ volatile("{begin}; .rept {times}; {snippet}; .endr; {end}"\n'
            f"                         : {numbers}(at), {passes}(left) :: {changed});\n    }}\n}}\n"
        )
    calls = [LIBRARY + name for name in _calls()] + [DELAY + name for name in _functions_of_x()]
    out += [f"static void {name}(long);\n" for name in calls]
    cases = [name for name, _, _ in _loops(machine)] + calls
    return "".join(out) + "#define CASES " + ", ".join(f'{{"{name}", {name}}}' for name in cases) + ",\n"


ShowSnippet = Callable[[str, int, int], None]
"""Called after each snippet with its name, the number of completed snippets and the number of all."""


def measure(notes: Path, show: ShowSnippet) -> dict[str, Timing]:
    """Time every snippet that the file ``notes`` does not contain yet, and add it there."""
    taken = read_notes(notes)
    wanted = snippet_names()
    with TemporaryDirectory(prefix="volery-processor-") as folder:
        program = build(Path(folder))
        for number, name in enumerate(wanted, 1):
            if name not in taken:
                taken[name] = time_snippet(program, name)
                notes.write_text(
                    json.dumps({one: asdict(found) for one, found in taken.items()}), encoding="utf-8"
                )
            show(name, number, len(wanted))
    return {name: taken[name] for name in wanted}


def read_notes(notes: Path) -> dict[str, Timing]:
    """Return the results of an interrupted run; empty if there are none or they cannot be read."""
    try:
        found = json.loads(notes.read_text(encoding="utf-8"))
        return {name: Timing(**one) for name, one in found.items()}
    except (OSError, ValueError, TypeError, RecursionError):
        return {}


def noisy_snippets(taken: dict[str, Timing]) -> list[str]:
    """Return the names of snippets whose median is not precise."""
    return [name for name, one in taken.items() if not one.tight]


TABLES, HISTORY = 12, 60
"""Not measured: values of a large core's branch predictor, chosen on the kernels' first two inputs."""

LINE_BYTES = 64.0

SHARE_OF_REFILL = 2.0
"""Cycles of a misprediction in which the branch itself executes: the rest is the refill."""

PIPES_ARE_WHOLE = 0.2
"""Fraction that is rounded down: a core has whole pipes and noise only slows, so 2.6 a cycle are three pipes
and 2.1 are two."""

ALSO = {"malloc": "_Znwm", "free": "_ZdlPvm", "sin": "sincos"}
"""Symbols with the time of another one: operators new and delete, both functions of an angle."""


def core_law(machine: Machine, isa: str, taken: Mapping[str, Timing], queues: QueueSizes) -> CoreLaw:
    """Return the figures of the core. Latencies are whole cycles; below half a cycle nothing is executed.

    Args:
        machine: The computer.
        isa: Its instruction set.
        taken: Times of all snippets.
        queues: Sizes of the reorder buffer and the issue queues.
    """
    operations: dict[str, OperationTiming] = {}
    for name, snippet in SNIPPETS[isa].items():
        beside = sum(operations[one].latency for one in snippet.less)
        latency = max(0.0, (taken[CHAIN + name].cycles - beside) / snippet.links)
        operations[name] = OperationTiming(
            latency=round(latency), per_cycle=_pipes(taken[FREE + name].cycles)
        )
    for name in ("store", "store_vector", "branch"):  # no instruction depends on their end
        operations[name] = OperationTiming(latency=1.0, per_cycle=operations[name].per_cycle)
    operations["fp_fma"] = operations["fp_multiply"]
    mispredicted = 2.0 * (taken[RANDOM].cycles - taken[NEVER].cycles)
    mhz = round(sorted(one.mhz for one in taken.values())[len(taken) // 2])
    return CoreLaw(
        name=machine.name,
        isa=isa,
        cpu="x86-64" if isa == "x86_64" else "generic",
        provenance="measured",
        source=f"volery cost calibrate processor on {machine.description}",
        validity=f"assumed: {', '.join((*queues.assumed(), 'the prediction of branches'))}",
        least_mhz=mhz * 0.5,
        greatest_mhz=mhz,
        width=_pipes(min(taken[WIDTH].cycles, taken[FREE + "increment"].cycles)),
        refill=round(max(1.0, mispredicted - SHARE_OF_REFILL), 1),
        forward=round(max(0.0, taken[FORWARDED].cycles - operations["fp_add"].latency)),
        accesses=_accesses(taken[ACCESSES].cycles, operations),
        computed=round(max(1.0, 1.0 + taken[MANY_TARGETS].cycles - taken[ONE_TARGET].cycles), 1),
        operations=operations,
        library=_library_law(taken, operations),
        memory=_memory(taken, operations["load"].latency, mhz),
        window=queues.window,
        queues=queues.issue_queues(),
        tables=TABLES,
        history=HISTORY,
    )


def _accesses(cycles: float, operations: Mapping[str, OperationTiming]) -> float | None:
    """Return how many loads and stores start in a cycle together; None if neither hinders the other."""
    both = _pipes(cycles)
    alone = 2.0 * min(operations[name].per_cycle for name in ("load", "store"))
    return both if both < alone else None


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
        SimulatedCache(bytes=first.bytes, ways=first.ways, latency=load),
        SimulatedCache(bytes=second.bytes, ways=second.ways, latency=round(taken[SECOND].cycles)),
    ]
    if third != second:
        known.append(SimulatedCache(bytes=third.bytes, ways=third.ways, latency=round(taken[THIRD].cycles)))
    return MemoryLaw(
        provenance="measured",
        source=f"loads round a circle, and in a row, of {memory_bytes() >> 20} MiB; sizes by the system",
        caches=tuple(known),
        latency_ns=round(behind_ns, 1),
        bytes_per_ns=round(LINE_BYTES / row_ns, 2),
    )


def _library_law(taken: Mapping[str, Timing], operations: Mapping[str, OperationTiming]) -> LibraryLaw:
    calls = {
        name.removeprefix(LIBRARY): round(one.cycles, 1)
        for name, one in taken.items()
        if name.startswith(LIBRARY)
    }
    latencies = {}
    for name in _functions_of_x():
        beside = operations["fp_multiply"].latency + operations["fp_add"].latency
        beside += operations["convert"].latency * 2 * name.endswith("f")
        beside += operations["convert_integer"].latency * (name == "lround")
        latencies[name] = round(max(calls[name], taken[DELAY + name].cycles - beside), 1)
    both = calls.pop("malloc_free")
    calls |= {"malloc": round(both / 2.0, 1), "free": round(both / 2.0, 1)}
    for figures in (calls, latencies):
        figures |= {symbol: figures[name] for name, symbol in ALSO.items() if name in figures}
    return LibraryLaw(
        provenance="measured",
        source="calls in a row, with arguments as a robot's code has them",
        unknown=sorted(calls.values())[len(calls) // 2],
        calls=calls,
        latencies=latencies,
    )
