"""Runs of an instrumented program on this machine: counts of its blocks, and traces.

A trace has the blocks that were entered, the values of switches, and the accesses to memory. The runtime in
``runtime/`` is linked with the program and writes both.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
from collections.abc import Container, Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from volery.base.errors import UsageError, choices, did_you_mean
from volery.cost.code_laws import MemoryLaw
from volery.cost.native.build_cache import cached_file, digest
from volery.cost.native.compilation import OptimisedCode, llvm_toolchain, run_tool

_SWITCHED, _ACCESSED = 1 << 31, 1 << 30


Array = np.ndarray[Any, np.dtype[Any]]

# columns of the table of accesses
POSITION, NUMBER, LEVEL, AHEAD, ADDRESS = range(5)


def no_accesses() -> Array:
    """Return an empty table of accesses."""
    return np.zeros((0, 5), dtype=np.int64)


@dataclass(frozen=True)
class BlockTrace:
    """Record of a run.

    Attributes:
        blocks: Numbers of the blocks in the order in which they were entered.
        switches: Value of a switch before the block at a position was entered, by position.
        edges: Edge block that ``only`` has removed before a position, by position.
        accesses: Accesses to memory, one a row: position of the block entered last, number of the access in
            the program, level that served it (0 for the first cache), whether it was prefetched, and address.
            Pages have numbers in the order of their first access.
    """

    blocks: list[int]
    switches: dict[int, int] = field(default_factory=dict)
    edges: dict[int, int] = field(default_factory=dict)
    accesses: Array = field(default_factory=no_accesses, compare=False)

    def then(self, other: BlockTrace) -> BlockTrace:
        """Return this trace followed by another."""
        first = len(self.blocks)
        moved = other.accesses + np.array([first, 0, 0, 0, 0])
        return BlockTrace(
            self.blocks + other.blocks,
            self.switches | {first + place: value for place, value in other.switches.items()},
            accesses=np.concatenate([self.accesses, moved]),
        )

    def until(self, length: int) -> BlockTrace:
        """Return the first ``length`` blocks."""
        accesses = self.accesses[self.accesses[:, POSITION] < length]
        return replace(self, blocks=self.blocks[:length], accesses=accesses)

    def only(self, wanted: Container[int]) -> BlockTrace:
        """Remove all but the ``wanted`` blocks.

        The first block that is removed at a position becomes an edge. Accesses of removed blocks are assigned
        to the block before.
        """
        kept: list[int] = []
        switches: dict[int, int] = {}
        edges: dict[int, int] = {}
        new_positions = np.zeros(len(self.blocks), dtype=np.int64)
        for place, block in enumerate(self.blocks):
            if place in self.switches:
                switches.setdefault(len(kept), self.switches[place])
            if block in wanted:
                kept.append(block)
            else:
                edges.setdefault(len(kept), block)
            new_positions[place] = len(kept) - 1
        accesses = self.accesses.copy()
        accesses[:, POSITION] = new_positions[accesses[:, POSITION]]
        return BlockTrace(kept, switches, edges, accesses)

    def at_their_blocks(self, access_blocks: Sequence[int]) -> BlockTrace:
        """Return the trace with each access at the last entry of its own block.

        Args:
            access_blocks: Block of each access of the program.
        """
        blocks, accesses = np.array(self.blocks, dtype=np.int64), self.accesses.copy()
        own = np.array(access_blocks, dtype=np.int64)[accesses[:, NUMBER]]
        for block in np.unique(own[blocks[accesses[:, POSITION]] != own]):
            entries, rows = np.flatnonzero(blocks == block), np.flatnonzero(own == block)
            last = np.searchsorted(entries, accesses[rows, POSITION], side="right") - 1
            known = rows[last >= 0]
            accesses[known, POSITION] = entries[last[last >= 0]]
        return replace(self, accesses=accesses)


def read_trace(file: Path) -> BlockTrace:
    """Read a trace that the runtime has written."""
    return trace_of(np.fromfile(file, dtype=np.uint32))


def trace_of(words: np.ndarray[Any, np.dtype[np.uint32]]) -> BlockTrace:
    """Decode a trace as ``runtime.c`` encodes it; records before the first block are dropped."""
    words = words.astype(np.int64)
    is_block, is_access = words < _ACCESSED, (words >= _ACCESSED) & (words < _SWITCHED)
    entered = np.cumsum(is_block)
    switches = {
        int(place): ((int(word) & (_SWITCHED - 1)) ^ (1 << 30)) - (1 << 30)  # 31 bits with their sign
        for place, word in zip(entered[words >= _SWITCHED], words[words >= _SWITCHED], strict=True)
    }
    what, where = (words[is_access][first::2] - _ACCESSED for first in (0, 1))
    what, position = what[: len(where)], entered[is_access][::2][: len(where)] - 1
    accesses = np.stack([position, what >> 5, what & 7, what >> 3 & 1, where], axis=1)
    return BlockTrace(words[is_block].tolist(), switches, accesses=accesses[position >= 0])


RUN_LIMIT_S = 120.0
WINDOW = 4096
"""Blocks that are traced in succession; a long run is sampled in windows."""

RUNTIME = ("runtime.c", "caches.c")
"""Files that are linked with an instrumented program."""

_CALL = re.compile(r"^\s*([A-Za-z_]\w*)\s*(?:\((.*)\))?\s*$")
_DEFINE = re.compile(r"^define [^@]*?([\w*]+|ptr) @([\w.$]+)\(([^)]*)\)", re.MULTILINE)
_C_TYPES = {"void": "void", "i1": "_Bool", "i8": "signed char", "i16": "short", "i32": "int", "i64": "long",
            "float": "float", "double": "double"}  # fmt: skip


@dataclass(frozen=True)
class Invocation:
    """A run of a program.

    Attributes:
        entry: Call to measure, such as ``kernel(3)``; empty for the program's ``main``.
        before: Calls before it, which are not measured.
        arguments: Arguments of ``main``.
        links: Options of the linker.
        times: Number of calls of the entry.
    """

    entry: str = ""
    before: Sequence[str] = ()
    arguments: Sequence[str] = ()
    links: Sequence[str] = ()
    times: int = 1


_BEGINNING = """\
void volery_fix_addresses(char **);
void volery_begin(void);
void volery_end(void);
__attribute__((constructor(101))) static void start(int count, char **arguments) {
    volery_fix_addresses(arguments);
}
"""


def driver(program: OptimisedCode, invocation: Invocation) -> str:
    """Return the C text that makes the calls between ``volery_begin`` and ``volery_end``."""
    declared = {"": _BEGINNING}
    calls = [
        _call(program, text, declared)
        for text in (*invocation.before, *([invocation.entry] if invocation.entry else []))
    ]
    if not invocation.entry:
        if "main" not in program.defined:
            raise UsageError("no main() in it: say with --entry NAME which function to cost")
        own = "__attribute__((constructor)) static void begin(void) { volery_begin(); }\n"
        return declared[""] + own + "__attribute__((destructor)) static void end(void) { volery_end(); }\n"
    *first, last = calls
    body = "".join(f"    {one};\n" for one in first)
    loop = f"    for (int i = 0; i < {invocation.times}; ++i)\n        {last};\n"
    return (
        "".join(declared.values())
        + f"int main(void) {{\n{body}    volery_begin();\n{loop}    volery_end();\n}}\n"
    )


def timing_driver(program: OptimisedCode, invocation: Invocation) -> str:
    """Return the C text before ``timing.c``: the activation, and the calls that prepare it."""
    if not invocation.entry:
        raise UsageError("only a function can be timed repeatedly: state one as the entry")
    declared: dict[str, str] = {}
    before = "; ".join(_call(program, text, declared) for text in invocation.before) or "(void)0"
    activation = _call(program, invocation.entry, declared)
    return "".join(declared.values()) + f"#define PREPARE() {before}\n#define ACTIVATE() {activation}\n"


def build_executable(
    program: OptimisedCode, invocation: Invocation, instrumented: Path, folder: Path
) -> Path:
    """Link an instrumented object with its driver and the runtime.

    Returns:
        The executable: a file of the cache, or of ``folder`` if the user's libraries are linked, which may
        change, or if there is no cache.
    """
    source = folder / "driver.c"
    source.write_text(driver(program, invocation), encoding="utf-8")
    objects = [instrumented, *runtime_objects(folder)]
    command = [llvm_toolchain().clang, "-O2", "-x", "c", str(source), "-x", "none", *map(str, objects)]
    options = _link_options(program, invocation)

    def make(out: Path) -> None:
        run_tool([*command, *options, "-o", str(out)])

    if invocation.links:
        make(folder / "program")
        return folder / "program"
    contents = [one.read_bytes() for one in (source, *objects)]
    return cached_file(f"{digest(*contents, *options)}.program", folder, make, runs=True)


def runtime_objects(folder: Path) -> list[Path]:
    """Return the runtime's objects, which shared libraries may contain as well.

    They are files of the cache, or of ``folder`` where there is no cache.
    """
    clang = llvm_toolchain().clang
    with as_file(files("volery.cost.native").joinpath("runtime")) as runtime:
        sources = [runtime / name for name in RUNTIME]
        made_of = digest(clang, *(one.read_bytes() for one in sorted(runtime.iterdir()) if one.is_file()))

        def compiled(source: Path) -> Path:
            command = [clang, "-O2", "-fPIC", "-x", "c", "-c", str(source), "-o"]
            name = f"{made_of}.{source.name}.o"
            return cached_file(name, folder, lambda out: run_tool([*command, str(out)]))

        return [compiled(source) for source in sources]


def _link_options(program: OptimisedCode, invocation: Invocation) -> tuple[str, ...]:
    """Return the linker's options; the driver's ``main`` takes precedence over the program's."""
    first = ("-Wl,-z,muldefs",) if invocation.entry and "main" in program.defined else ()
    return (*first, *invocation.links, "-lm")


def build_timing(program: OptimisedCode, invocation: Invocation, code: Path, folder: Path) -> Path:
    """Link an object with ``timing.c``; the executable takes the number of activations as its argument."""
    source = folder / "timing.c"
    timing = files("volery.cost.native").joinpath("runtime/timing.c").read_text(encoding="utf-8")
    source.write_text(timing_driver(program, invocation) + timing, encoding="utf-8")
    out = folder / "timing"
    command = [llvm_toolchain().clang, "-O1", "-w", "-x", "c", str(source), "-x", "none", str(code)]
    run_tool([*command, *_link_options(program, invocation), "-o", str(out)])
    return out


def time_activations(executable: Path, activations: int) -> list[float]:
    """Return the cycles of each activation on this machine's core."""
    return [float(line) for line in run_tool([str(executable), str(activations)]).split()]


def block_counts(executable: Path, invocation: Invocation, folder: Path) -> Array:
    """Run a counting program and return the entries of each block."""
    out = folder / "counts"
    _run(executable, invocation, {"VOLERY_COUNTS": str(out)})
    return np.fromfile(out, dtype=np.uint64)


def trace_blocks(
    executable: Path, invocation: Invocation, folder: Path, stride: int, memory: MemoryLaw | None = None
) -> BlockTrace:
    """Run a tracing program and return its trace.

    Args:
        executable: A program that was linked with a tracing object.
        invocation: The run.
        folder: Folder for the trace.
        stride: ``WINDOW`` of every ``stride`` blocks are recorded.
        memory: Caches whose misses are recorded.
    """
    out = folder / "trace"
    _run(
        executable,
        invocation,
        {
            "VOLERY_TRACE": str(out),
            "VOLERY_WINDOW": str(WINDOW),
            "VOLERY_STRIDE": str(stride),
            "VOLERY_CACHES": cache_settings(memory),
        },
    )
    return read_trace(out)


def cache_settings(memory: MemoryLaw | None) -> str:
    """Return the setting of ``caches.c``: bytes and ways of each cache."""
    return ",".join(f"{cache.bytes}/{cache.ways}" for cache in memory.caches) if memory else ""


def _run(executable: Path, invocation: Invocation, settings: dict[str, str]) -> None:
    """Run a program with environment variables, the first of which names the file that it must write."""
    command = [str(executable), *invocation.arguments]
    try:
        done = subprocess.run(
            command, env={**os.environ, **settings}, capture_output=True, timeout=RUN_LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise UsageError(f"the program has not ended within {RUN_LIMIT_S:g} s") from error
    if done.returncode < 0:
        raise UsageError(
            f"the program was ended by {signal.Signals(-done.returncode).name}: it must run to its end"
        )
    if not Path(next(iter(settings.values()))).exists():
        output = done.stderr.decode(errors="replace").strip()[-500:]
        raise UsageError(f"the program ended with {done.returncode} before anything was counted: {output}")


def _call(program: OptimisedCode, text: str, declared: dict[str, str]) -> str:
    """Return the C call of a function by its C++ name and add its declaration to ``declared``."""
    parsed = _CALL.match(text)
    if parsed is None:
        raise UsageError(f"{text!r} is not a call such as step or step(3, 0.5)")
    name, arguments = parsed[1], parsed[2] or ""
    symbol, returned, parameters = _function(program, name)
    given = [word.strip() for word in arguments.split(",")] if arguments.strip() else []
    if len(given) != len(parameters):
        raise UsageError(
            f"{name} takes {len(parameters)} arguments, not {len(given)}: {name}({', '.join(parameters)})"
        )
    for one in given:
        if not re.fullmatch(r"[-+]?[\d.]+(?:[eE][-+]?\d+)?", one):
            raise UsageError(f"{name}: argument {one!r} is no number")
    declared[symbol] = f'extern {returned} f_{name}({", ".join(parameters) or "void"}) __asm__("{symbol}");\n'
    return f"f_{name}({', '.join(given)})"


def _function(program: OptimisedCode, name: str) -> tuple[str, str, list[str]]:
    """Return the symbol of a function, its result type and its parameter types in C."""
    callable_here: dict[str, tuple[str, str, list[str]]] = {}
    for returned, symbol, parameters in _DEFINE.findall(program.text):
        took = [_C_TYPES.get(word.split()[0], "") for word in parameters.split(",") if word.strip()]
        back = _C_TYPES.get(returned, "")
        if back and all(took) and not symbol.startswith("_GLOBAL_"):
            callable_here[_plain(symbol)] = (symbol, back, took)
    if name not in callable_here:
        raise UsageError(
            f"no function {name!r} that takes and returns numbers{did_you_mean(name, callable_here)}; "
            f"there is {choices(callable_here)}"
        )
    return callable_here[name]


def _plain(symbol: str) -> str:
    """Return ``step`` for ``_Z4stepid``: the name of a free function without its mangling."""
    mangled = re.match(r"_Z(\d+)", symbol)
    if mangled is None:
        return symbol
    start = mangled.end()
    return symbol[start : start + int(mangled[1])]
