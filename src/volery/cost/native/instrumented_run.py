"""What a traced program says of itself: the blocks that it entered, the values that its switches used, and
the accesses to memory that the first cache did not serve.

Runs an instrumented program on this machine: what each block counted, which blocks were entered.
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
from typing import Any, NamedTuple

import numpy as np

from volery.base.errors import UsageError, choices, did_you_mean
from volery.cost.code_laws import MemoryLaw
from volery.cost.native.compilation import Program, llvm_toolchain, run_tool

_SWITCHED, _ACCESSED = 1 << 31, 1 << 30


class Access(NamedTuple):
    """An access to memory that the first cache did not serve.

    ``number`` of it in its block; ``level`` of what served it: 1 for the second cache; ``ahead``: it was
    fetched before it was asked for.
    """

    number: int
    store: bool
    level: int
    ahead: bool


@dataclass(frozen=True)
class BlockTrace:
    """``blocks`` by number, in the order in which they were entered; ``switches``: the value that a switch
    used before the block of that place was entered; ``edges``: the block that was left out there;
    ``accesses`` of the block of that place.
    """

    blocks: list[int]
    switches: dict[int, int] = field(default_factory=dict)
    edges: dict[int, int] = field(default_factory=dict)
    accesses: dict[int, list[Access]] = field(default_factory=dict)

    def then(self, other: BlockTrace) -> BlockTrace:
        """Both, one after the other."""
        first = len(self.blocks)
        return BlockTrace(
            self.blocks + other.blocks,
            self.switches | {first + place: value for place, value in other.switches.items()},
            accesses=self.accesses | {first + place: told for place, told in other.accesses.items()},
        )

    def until(self, length: int) -> BlockTrace:
        """The first *length* blocks."""
        return replace(self, blocks=self.blocks[:length])

    def only(self, wanted: Container[int]) -> BlockTrace:
        """Without the other blocks; of several left out in one place the first is an edge. Their accesses
        count as made in the block before.
        """
        kept: list[int] = []
        switches: dict[int, int] = {}
        edges: dict[int, int] = {}
        accesses: dict[int, list[Access]] = {}
        for place, block in enumerate(self.blocks):
            if place in self.switches:
                switches.setdefault(len(kept), self.switches[place])
            if block in wanted:
                kept.append(block)
            else:
                edges.setdefault(len(kept), block)
            if place in self.accesses and kept:
                accesses.setdefault(len(kept) - 1, []).extend(self.accesses[place])
        return BlockTrace(kept, switches, edges, accesses)


def read_trace(file: Path) -> BlockTrace:
    """A trace that the runtime has written."""
    return trace_of(np.fromfile(file, dtype=np.uint32))


def _access(word: int) -> Access:
    """As ``caches.c`` puts it into a word."""
    return Access(word >> 5, bool(word >> 4 & 1), word & 7, bool(word & 8))


def trace_of(words: np.ndarray[Any, np.dtype[np.uint32]]) -> BlockTrace:
    """A trace as the runtime writes it; what stands before its first block is left out."""
    blocks: list[int] = []
    switches: dict[int, int] = {}
    accesses: dict[int, list[Access]] = {}
    for word in words.tolist():
        if word < _ACCESSED:
            blocks.append(word)
        elif word >= _SWITCHED:  # 31 bits with their sign
            switches[len(blocks)] = ((word & (_SWITCHED - 1)) ^ (1 << 30)) - (1 << 30)
        elif blocks:
            accesses.setdefault(len(blocks) - 1, []).append(_access(word - _ACCESSED))
    return BlockTrace(blocks, switches, accesses=accesses)


Array = np.ndarray[Any, np.dtype[Any]]

RUN_LIMIT_S = 120.0
WINDOW = 4096
"""Blocks that are traced in a row; windows are spread over a program that enters more than are wanted."""

RUNTIME = ("runtime.c", "caches.c")
"""What is linked with an instrumented program."""

_CALL = re.compile(r"^\s*([A-Za-z_]\w*)\s*(?:\((.*)\))?\s*$")
_DEFINE = re.compile(r"^define [^@]*?([\w*]+|ptr) @([\w.$]+)\(([^)]*)\)", re.MULTILINE)
_C_TYPES = {"void": "void", "i1": "_Bool", "i8": "signed char", "i16": "short", "i32": "int", "i64": "long",
            "float": "float", "double": "double"}  # fmt: skip


@dataclass(frozen=True)
class Invocation:
    """What is to be run: ``entry``, a call such as ``kernel(3)``, after the calls of ``before``.

    Without an entry the program's own ``main`` with ``arguments``. ``links`` are options of the linker.
    """

    entry: str = ""
    before: Sequence[str] = ()
    arguments: Sequence[str] = ()
    links: Sequence[str] = ()
    times: int = 1


def driver(program: Program, wanted: Invocation) -> str:
    """The C text that calls what is wanted between ``volery_begin`` and ``volery_end``."""
    declared = {"": "void volery_begin(void);\nvoid volery_end(void);\n"}
    calls = [
        _call(program, text, declared) for text in (*wanted.before, *([wanted.entry] if wanted.entry else []))
    ]
    if not wanted.entry:
        if "main" not in program.defined:
            raise UsageError("no main() in it: say with --entry NAME which function to cost")
        own = "__attribute__((constructor)) static void begin(void) { volery_begin(); }\n"
        return declared[""] + own + "__attribute__((destructor)) static void end(void) { volery_end(); }\n"
    *first, last = calls
    body = "".join(f"    {one};\n" for one in first)
    loop = f"    for (int i = 0; i < {wanted.times}; ++i)\n        {last};\n"
    return (
        "".join(declared.values())
        + f"int main(void) {{\n{body}    volery_begin();\n{loop}    volery_end();\n}}\n"
    )


def timing_driver(program: Program, wanted: Invocation) -> str:
    """What stands before ``timing.c``: the activation, and what prepares it."""
    if not wanted.entry:
        raise UsageError("only a function can be timed again and again: say which, with an entry")
    declared: dict[str, str] = {}
    before = "; ".join(_call(program, text, declared) for text in wanted.before) or "(void)0"
    activation = _call(program, wanted.entry, declared)
    return "".join(declared.values()) + f"#define PREPARE() {before}\n#define ACTIVATE() {activation}\n"


def build_executable(program: Program, wanted: Invocation, instrumented: Path, folder: Path) -> Path:
    """Link an instrumented object with its driver; the executable in *folder*."""
    source = folder / "driver.c"
    source.write_text(driver(program, wanted), encoding="utf-8")
    out = folder / "program"
    clang = llvm_toolchain().clang
    with as_file(files("volery.cost.native").joinpath("runtime")) as runtime:
        ours = [str(runtime / name) for name in RUNTIME]
        command = [clang, "-O2", "-x", "c", str(source), *ours, "-x", "none", str(instrumented)]
        run_tool([*command, *_linked(program, wanted), "-o", str(out)])
    return out


def runtime_objects(folder: Path) -> list[Path]:
    """The runtime compiled in *folder*, for code that is loaded by another program."""
    with as_file(files("volery.cost.native").joinpath("runtime")) as runtime:
        for name in RUNTIME:
            compiled = ["-x", "c", "-c", str(runtime / name), "-o", str(folder / f"{name}.o")]
            run_tool([llvm_toolchain().clang, "-O2", "-fPIC", *compiled])
    return [folder / f"{name}.o" for name in RUNTIME]


def _linked(program: Program, wanted: Invocation) -> tuple[str, ...]:
    """The linker's options; where a function is called, the driver's main comes before the program's own."""
    first = ("-Wl,-z,muldefs",) if wanted.entry and "main" in program.defined else ()
    return (*first, *wanted.links, "-lm")


def build_timing(program: Program, wanted: Invocation, code: Path, folder: Path) -> Path:
    """Link an object with what times its activations here; run it with how often."""
    source = folder / "timing.c"
    timing = files("volery.cost.native").joinpath("runtime/timing.c").read_text(encoding="utf-8")
    source.write_text(timing_driver(program, wanted) + timing, encoding="utf-8")
    out = folder / "timing"
    command = [llvm_toolchain().clang, "-O1", "-w", "-x", "c", str(source), "-x", "none", str(code)]
    run_tool([*command, *_linked(program, wanted), "-o", str(out)])
    return out


def time_activations(executable: Path, activations: int) -> list[float]:
    """Cycles of this machine's core, of each activation."""
    return [float(line) for line in run_tool([str(executable), str(activations)]).split()]


def block_counts(executable: Path, wanted: Invocation, folder: Path) -> Array:
    """How often each block was entered."""
    out = folder / "counts"
    _run(executable, wanted, {"VOLERY_COUNTS": str(out)})
    return np.fromfile(out, dtype=np.uint64)


def trace_blocks(
    executable: Path, wanted: Invocation, folder: Path, stride: int, memory: MemoryLaw | None = None
) -> BlockTrace:
    """What was entered, ``WINDOW`` of every ``stride`` blocks, and what *memory*'s caches did not serve."""
    out = folder / "trace"
    _run(
        executable,
        wanted,
        {
            "VOLERY_TRACE": str(out),
            "VOLERY_WINDOW": str(WINDOW),
            "VOLERY_STRIDE": str(stride),
            "VOLERY_CACHES": cache_settings(memory),
        },
    )
    return read_trace(out)


def cache_settings(memory: MemoryLaw | None) -> str:
    """The caches as ``caches.c`` reads them."""
    return ",".join(f"{one.bytes}/{one.ways}" for one in memory.caches) if memory else ""


def _run(executable: Path, wanted: Invocation, told: dict[str, str]) -> None:
    command = [str(executable), *wanted.arguments]
    try:
        done = subprocess.run(
            command, env={**os.environ, **told}, capture_output=True, timeout=RUN_LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise UsageError(f"the program has not ended within {RUN_LIMIT_S:g} s") from error
    if done.returncode < 0:
        raise UsageError(
            f"the program was ended by {signal.Signals(-done.returncode).name}: it must run to its end"
        )
    if not Path(next(iter(told.values()))).exists():
        said = done.stderr.decode(errors="replace").strip()[-500:]
        raise UsageError(f"the program ended with {done.returncode} before anything was counted: {said}")


def _call(program: Program, text: str, declared: dict[str, str]) -> str:
    """A C call of a function by its C++ name, its declaration added to *declared*."""
    parsed = _CALL.match(text)
    if parsed is None:
        raise UsageError(f"{text!r}: a call such as step or step(3, 0.5) is wanted")
    name, arguments = parsed[1], parsed[2] or ""
    symbol, returned, parameters = _function(program, name)
    given = [one.strip() for one in arguments.split(",")] if arguments.strip() else []
    if len(given) != len(parameters):
        raise UsageError(
            f"{name} takes {len(parameters)} arguments, not {len(given)}: {name}({', '.join(parameters)})"
        )
    for one in given:
        if not re.fullmatch(r"[-+]?[\d.]+(?:[eE][-+]?\d+)?", one):
            raise UsageError(f"{name}: argument {one!r} is no number")
    declared[symbol] = f'extern {returned} f_{name}({", ".join(parameters) or "void"}) __asm__("{symbol}");\n'
    return f"f_{name}({', '.join(given)})"


def _function(program: Program, name: str) -> tuple[str, str, list[str]]:
    """The symbol of a function, what it returns and takes, in C."""
    callable_here: dict[str, tuple[str, str, list[str]]] = {}
    for returned, symbol, parameters in _DEFINE.findall(program.text):
        took = [_C_TYPES.get(one.split()[0], "") for one in parameters.split(",") if one.strip()]
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
    """``step`` for ``_Z4stepid``: the name of a free function without its namespace's mark."""
    mangled = re.match(r"_Z(\d+)", symbol)
    if mangled is None:
        return symbol
    start = mangled.end()
    return symbol[start : start + int(mangled[1])]
