"""Builds the program of snippets, runs it, and gives each snippet's time in cycles with its spread."""

from __future__ import annotations

import math
import platform
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from statistics import median, quantiles
from typing import NamedTuple

from volery.base.errors import UsageError
from volery.calibration.processor.snippets import FORWARD, IF_ODD, NOTHING, PROLOGUE, SNIPPETS
from volery.cost.native.toolchain import run_tool, toolchain

CHAIN, FREE, LIBRARY, MEMORY = "chain_", "free_", "library_", "memory_"
RANDOM, NEVER, WIDTH, FORWARDED = "branches_random", "branches_never", "width", "forward"
SECOND, THIRD, BEHIND, ROW = "memory_second", "memory_third", "memory_behind", "memory_row"
LARGEST_THIRD = 32 << 20
"""A third cache that is larger is shared by many, and counts as memory."""
UNROLLED, PASSES = 48, 20
BRANCHES = CALLS = LOADS = 64
"""How many branches, calls and lines of memory a pass of ``measure.c`` has."""

ROUNDS, MOST_ROUNDS = 15, 150
TIGHT = 0.01
"""A median is tight if half its quartiles' distance, over the root of the rounds, is less, relatively."""


@dataclass(frozen=True)
class Taken:
    """``cycles`` of one operation: a median; ``spread``: its relative error; the frequency meanwhile."""

    cycles: float
    spread: float
    rounds: int
    mhz: float

    @property
    def tight(self) -> bool:
        """False if the machine was too noisy."""
        return self.spread <= TIGHT


def isa() -> str:
    """The instruction set of this machine. ``UsageError`` if there are no snippets for it."""
    here = platform.machine()
    if here not in SNIPPETS:
        raise UsageError(f"no snippets for {here} yet: code is calibrated on {' and '.join(SNIPPETS)} only")
    return here


def build(folder: Path) -> Path:
    """Compile the program; ``UsageError`` says which package brings the compiler."""
    here = files("volery.calibration.processor")
    measure = _generated(isa()) + here.joinpath("measure.c").read_text(encoding="utf-8")
    (folder / "measure.c").write_text(measure, encoding="utf-8")
    (folder / "library.h").write_text(_library(), encoding="utf-8")
    out = folder / "measure"
    options = ["-x", "c", "-O1", "-fno-builtin", "-fno-math-errno", "-w"]
    run_tool([toolchain().clang, *options, str(folder / "measure.c"), "-lm", "-o", str(out)])
    return out


def names() -> tuple[str, ...]:
    """All that is timed."""
    library = tuple(LIBRARY + name for name in _calls())
    memory = (SECOND, THIRD, BEHIND, ROW)
    return (*(name for name, _, _ in _loops(isa()) if name != "tick"), RANDOM, NEVER, *memory, *library)


def take(program: Path, name: str) -> Taken:
    """Time one snippet until its median is tight, or has been taken from ``MOST_ROUNDS`` rounds."""
    each = {RANDOM: BRANCHES, NEVER: BRANCHES}.get(name, UNROLLED * PASSES)
    each = CALLS if name.startswith((LIBRARY, MEMORY)) else each
    cycles: list[float] = []
    ticks: list[float] = []
    while True:
        for took, tick in _rounds(program, name):
            cycles.append(took / tick * UNROLLED * PASSES / each)
            ticks.append(tick)
        spread = _spread(cycles)
        if spread <= TIGHT or len(cycles) >= MOST_ROUNDS:
            mhz = 1000.0 * UNROLLED * PASSES / median(ticks)
            return Taken(median(cycles), spread, len(cycles), mhz)


def _rounds(program: Path, name: str) -> Iterator[tuple[float, float]]:
    for line in run_tool([str(program), name, str(ROUNDS)]).splitlines():
        _, took, tick = line.split()
        yield float(took), float(tick)


def _spread(values: list[float]) -> float:
    low, _, high = quantiles(values, n=4)
    return float((high - low) / 2.0 / math.sqrt(len(values)) / max(median(values), 1e-12))


def _loops(machine: str) -> list[tuple[str, str, int]]:
    """Every loop: its name, its snippet, how often the snippet stands in it."""
    loops = [("tick", SNIPPETS[machine]["alu"].chain, UNROLLED)]
    for name, snippet in SNIPPETS[machine].items():
        loops.append((CHAIN + name, snippet.chain, UNROLLED))
        eight = ";".join(snippet.free.format(number) for number in range(8, 16))
        loops.append((FREE + name, eight, UNROLLED // 8))
    loops.append((FORWARDED, FORWARD[machine], UNROLLED))
    loops.append((WIDTH, NOTHING[machine], UNROLLED))
    return loops


class Found(NamedTuple):
    """A cache of this machine."""

    bytes: int
    ways: int


def caches() -> tuple[Found, Found, Found]:
    """The caches for data of this machine, from the first on. One that the system says nothing of is taken to
    be as usual; where there is no third one that counts, it is as the second.
    """
    found = dict(_found())
    first, second = found.get(1, Found(32 << 10, 8)), found.get(2, Found(512 << 10, 8))
    third = found.get(3, second)
    return first, second, third if third.bytes <= LARGEST_THIRD else second


def behind() -> int:
    """So many bytes do not fit into the caches, and are not so many that finding their pages takes longer
    than memory does.
    """
    _, second, third = caches()
    return 2 * third.bytes if third != second else 8 * second.bytes


def _found() -> Iterator[tuple[int, Found]]:
    """What Linux says, by level."""
    for one in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        with suppress(OSError, ValueError):
            size, ways, level, kind = (
                (one / name).read_text(encoding="ascii").strip()
                for name in ("size", "ways_of_associativity", "level", "type")
            )
            if kind != "Instruction" and int(ways) > 0:
                yield int(level), Found(int(size.removesuffix("K")) << 10, int(ways))


def _library() -> str:
    return files("volery.calibration.processor").joinpath("library.h").read_text(encoding="utf-8")


def _calls() -> list[str]:
    return re.findall(r"^LIBRARY\((\w+),", _library(), re.MULTILINE)


def _generated(machine: str) -> str:
    """What stands before ``measure.c``: the loops, and the table of cases."""
    begin, end, (numbers, passes), changed = PROLOGUE[machine]
    first, second, third = caches()
    out = [
        f"#define IN_SECOND {min(4 * first.bytes, second.bytes // 2)}\n",
        f"#define IN_THIRD {third.bytes // 2}\n",
        f"#define BEHIND {behind()}\n",
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
    out += [f"static void {LIBRARY}{name}(long);\n" for name in _calls()]
    cases = [name for name, _, _ in _loops(machine)] + [LIBRARY + name for name in _calls()]
    return "".join(out) + "#define CASES " + ", ".join(f'{{"{name}", {name}}}' for name in cases) + ",\n"
