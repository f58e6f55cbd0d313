"""Compilation with LLVM: sources become one optimised module for a core.

From the module come the core's machine code and the objects that run on this machine: counted, traced or
plain. LLVM's programs are run as processes; bindings to its libraries would tie volery to one version.

Code that is estimated for another instruction set is compiled for it and also runs here, against the
libraries of this machine. So the headers of the system have to be this machine's, which rules out clang's
``--target``. Instead the user's files are compiled as copies, in place of the originals by an overlay of
clang's file system: in their preprocessor lines the macros of this machine's instruction set are replaced by
names that are not defined, and the target's by a name that is. Macros of the target's vector extensions stay
undefined: their intrinsics cannot run here, and the portable branch can. What no macro guards is found in the
intermediate code and reported with file and line.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

from volery.base.dependency_record import is_current, rule_dependencies, write_record
from volery.base.errors import UsageError
from volery.cost.code_laws import CoreLaw
from volery.cost.native.build_cache import cached_file, cached_path, digest, keep_file
from volery.cost.native.llvm_ir import (
    BasicBlock,
    basic_blocks,
    retarget,
    with_access_columns,
    with_counters,
    with_trace_calls,
)
from volery.cost.native.machine_code import MachineBlock, machine_blocks

HOST_ISA = "x86_64"
SHOWN = {"aarch64": "VOLERY_TARGET_AARCH64"}
"""Names that stand for the macros of a target in the copies, by instruction set."""

_MACROS = {
    "x86_64": re.compile(
        r"\b(?:__x86_64(?:__)?|__amd64(?:__)?|__i[3-6]86(?:__)?|_M_X64|_M_AMD64|_M_IX86|__MMX__|__SSE\w*__|"
        r"__SSSE3__|__AVX\w*__|__FMA4?__|__F16C__|__BMI2?__|__LZCNT__|__POPCNT__|__AES__|__PCLMUL__)\b"
    ),
    "aarch64": re.compile(r"\b(?:__aarch64__|__AARCH64EL__|_M_ARM64)\b"),
}
_CONDITION = re.compile(r"\s*#\s*(?:if|ifdef|ifndef|elif|elifdef|elifndef|define)\b")
_MOST_PASSES = 4

_ASSEMBLY = re.compile(r'\basm (?:sideeffect |alignstack |inteldialect |unwind )*"([^"]+)", ')
_INTRINSIC = re.compile(r"\bcall .*?@(llvm\.x86\.[\w.]+)\(")
_DEFINE = re.compile(r'^define .*?@("[^"]+"|[-\w.$]+)\(')
_DEFINE_BEFORE = re.compile(_DEFINE.pattern, re.MULTILINE)
_HEADERS, _NOWHERE = "/lib/clang/", "a place without a line"
_PAUSE = re.compile(r"^.*\bcall void @llvm\.x86\.sse2\.pause\(\).*\n", re.MULTILINE)
_METADATA = re.compile(r"^!(\d+) = (?:distinct )?!(DI\w+)\((.*)\)$", re.MULTILINE)
_REFERENCE = re.compile(r"!dbg !(\d+)")
_FIELD = r'(?:^|, ){}: (?:!(\d+)|"([^"]*)"|(\d+))'

Dependencies = Callable[[Sequence[str]], str]
"""Runs the front end with ``-MM`` and further options; returns the rule for make that it prints."""


def with_target_macros(text: str, isa: str) -> str:
    """Return a file of the user with the target's conditions; lines keep their numbers."""
    lines, inside = [], False
    for line in text.splitlines(keepends=True):
        if inside or _CONDITION.match(line):
            inside = line.rstrip("\r\n").endswith("\\")
            without = _MACROS[HOST_ISA].sub("VOLERY_NOT_THE_TARGET", line)
            lines.append(_MACROS[isa].sub(SHOWN[isa], without))
        else:
            lines.append(line)
    return "".join(lines)


def overlay_options(source: Path, isa: str, folder: Path, dependencies: Dependencies) -> list[str]:
    """Return the options of the front end that put copies of the user's files in place of the originals.

    Args:
        source: C or C++ file.
        isa: Instruction set of the target, another one than this machine's.
        folder: Empty folder for the copies.
        dependencies: Lists the files, the system's excepted, that the source includes.
    """
    known: set[str] = {_absolute(source)}
    options: list[str] = []
    for _ in range(_MOST_PASSES):
        options = _overlay(sorted(known), isa, folder)
        found = {_absolute(dependency) for dependency in rule_dependencies(dependencies(options))}
        if found <= known:
            break
        known |= found
    return options


def _absolute(path: str | Path) -> str:
    """Return the path by which the front end finds the file; links are not followed."""
    return os.path.normpath(Path.cwd() / path)


def _overlay(files: Sequence[str], isa: str, folder: Path) -> list[str]:
    roots = []
    for number, name in enumerate(files):
        copy = folder / f"{number}{Path(name).suffix}"
        text = Path(name).read_text(encoding="utf-8", errors="surrogateescape")
        copy.write_text(with_target_macros(text, isa), encoding="utf-8", errors="surrogateescape")
        roots.append({"type": "file", "name": name, "external-contents": str(copy)})
    listed = folder / "overlay.json"
    listed.write_text(
        json.dumps({"version": 0, "use-external-names": False, "roots": roots}), encoding="utf-8"
    )
    return ["-ivfsoverlay", str(listed)]


def without_hints(text: str) -> str:
    """Return the code without instructions that only advise the processor, such as pauses of spin locks."""
    return _PAUSE.sub("", text)


def foreign_code(text: str) -> str:
    """Return what in the code is of one instruction set only, with file and line; empty if there is nothing.

    That is inline assembly that is not empty, which compiler barriers are, and intrinsics of this machine.
    """
    return next(_foreign(text), "")


def _foreign(text: str) -> Iterator[str]:
    function = ""
    for line in text.splitlines():
        if define := _DEFINE.match(line):
            function = define[1]
        if match := _ASSEMBLY.search(line):
            yield f"{_place(text, line)}: inline assembly {match[1]!r}"
        elif match := _INTRINSIC.search(line):
            yield _call_of_intrinsic(text, line, function, match[1])


def _call_of_intrinsic(text: str, line: str, function: str, name: str) -> str:
    """Describe the user's line that calls an intrinsic, mostly through functions of a header."""
    seen = {function}
    while _place(text, line) == _NOWHERE or _HEADERS in _place(text, line):  # the headers have no lines
        call = re.compile(rf"^.*\bcall .*@{re.escape(function)}\(.*$", re.MULTILINE).search(text)
        if call is None:
            break
        line, name = call[0], function
        function = _DEFINE_BEFORE.findall(text[: call.start()])[-1]
        if function in seen:
            break
        seen.add(function)
    return f"{_place(text, line)}: the intrinsic {_plain_name(name)}"


def _place(text: str, line: str) -> str:
    """Return file and line of an instruction by its debug location."""
    reference = _REFERENCE.search(line)
    if reference is None:
        return _NOWHERE
    nodes = {number: (kind, body) for number, kind, body in _METADATA.findall(text)}
    number = _field(nodes[reference[1]][1], "line")
    scope = _field(nodes[reference[1]][1], "scope")
    while scope in nodes and not _field(nodes[scope][1], "file"):
        scope = _field(nodes[scope][1], "scope")
    file = _field(nodes[scope][1], "file") if scope in nodes else ""
    name = _field(nodes[file][1], "filename") if file in nodes else "?"
    return f"{name}:{number}"


def _field(body: str, name: str) -> str:
    """Return the value of a field of debug information."""
    match = re.search(_FIELD.format(name), body)
    return (match[1] or match[2] or match[3] or "") if match else ""


def _plain_name(symbol: str) -> str:
    """Return the name of a function without namespace in a symbol of C or C++."""
    mangled = re.match(r"_ZL?(\d+)", symbol)
    return symbol[mangled.end() :][: int(mangled[1])] if mangled else symbol


VERSIONS = ("-19", "-18", "-17", "")
"""Suffixes of LLVM's programs in the order of preference; Debian 12 and the tests use 19."""

PACKAGES = {"clang++": "clang-19", "opt": "llvm-19", "llc": "llvm-19", "llvm-link": "llvm-19"}
LIMIT_S = 300.0


class CompilerError(UsageError):
    """A compiler has failed; the message is the compiler's."""


@dataclass(frozen=True)
class LlvmToolchain:
    """Programs of one version of LLVM: front end, optimiser, code generator, linker of intermediate code."""

    clang: str
    opt: str
    llc: str
    link: str

    @cached_property
    def versions(self) -> tuple[str, ...]:
        """What changes with another version of the programs."""
        paths = [Path(one) for one in (self.clang, self.opt, self.llc, self.link)]
        return tuple(f"{path} {path.stat().st_mtime_ns} {path.stat().st_size}" for path in paths)


@cache
def llvm_toolchain() -> LlvmToolchain:
    """Return the preferred version that is complete.

    Raises:
        UsageError: There is none; the error names the Debian packages to install.
    """
    names = tuple(PACKAGES)
    for suffix in VERSIONS:
        found = [shutil.which(name + suffix) for name in names]
        if all(found):
            return LlvmToolchain(*(str(path) for path in found))
    missing = [name for name in names if not any(shutil.which(name + suffix) for suffix in VERSIONS)] or names
    packages = " ".join(dict.fromkeys(PACKAGES[name] for name in missing))
    raise UsageError(
        f"counting compiled code needs LLVM 17 to 19, and {', '.join(missing)} is missing: "
        f"apt install {packages}; stated times (fidelity 'times') need no compiler"
    )


def run_tool(command: Sequence[str], text: str | None = None) -> str:
    """Run a program with ``text`` as its input and return its output.

    Raises:
        CompilerError: The program fails or takes longer than ``LIMIT_S``; the message is the program's.
    """
    try:
        done = subprocess.run(
            command, input=text, capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise CompilerError(f"{command[0]} has not finished within {LIMIT_S:g} s") from error
    if done.returncode != 0:
        raise CompilerError(done.stderr.strip() or f"{command[0]} ended with {done.returncode}")
    return done.stdout


HOST_TARGET = (
    "x86_64-unknown-linux-gnu",
    "e-m:e-p270:32:32-p271:32:32-p272:64:64-i64:64-i128:128-f80:128-n8:16:32:64-S128",
)
TARGETS = {
    "x86_64": HOST_TARGET,
    "aarch64": ("aarch64-unknown-linux-gnu", "e-m:e-i8:8:32-i16:16:32-i64:64-i128:128-n32:64-S128-Fn32"),
}
"""Triple and data layout of LLVM 19 by instruction set."""

FRONT_END_OPTIONS = (
    "-O2",
    "-Xclang",
    "-disable-llvm-passes",
    "-fno-discard-value-names",
    "-gline-tables-only",
    "-S",
    "-emit-llvm",
)
OPTIMISE = "default<O2>,break-crit-edges"
"""Passes of the optimiser. Critical edges become empty blocks: the machine code stays the same, and the
counters tell how often an edge was taken."""
PROMOTE = "function(loop-mssa(licm))"
"""Pass after the insertion of counters: those of a loop stay in registers while it runs."""

METHOD = "5"
"""Version of the method that finds costs; a new version makes kept costs invalid."""

_RULE = "read.d"
"""File with the rule for make that the front end writes."""
_SEARCH_PATHS = ("CPATH", "C_INCLUDE_PATH", "CPLUS_INCLUDE_PATH")

C_SUFFIXES = {".c"}
LANGUAGES = {".c", ".cc", ".cpp", ".cxx", ".C"}


@dataclass(frozen=True)
class OptimisedCode:
    """Code optimised for a core: LLVM's intermediate code and its basic blocks, whose order numbers them."""

    text: str
    law: CoreLaw
    blocks: tuple[BasicBlock, ...]

    @cached_property
    def key(self) -> str:
        """Digest of the code and the core."""
        return digest(METHOD, self.text, self.law.model_dump_json())

    @cached_property
    def assembly(self) -> str:
        """Assembly for the core."""
        options = [*generator_options(self.law.isa), f"-mcpu={self.law.cpu}"]
        notation = ["-x86-asm-syntax=intel"] if self.law.isa == "x86_64" else []
        command = [llvm_toolchain().llc, *options, *notation, "-o"]

        def make(out: Path) -> None:
            run_tool([*command, str(out)], with_access_columns(self.text))

        with TemporaryDirectory(prefix="volery-native-") as folder:
            return cached_file(f"{self.key}.s", Path(folder), make).read_text(encoding="utf-8")

    @cached_property
    def machine_blocks(self) -> tuple[MachineBlock, ...]:
        """Machine code for the core."""
        return tuple(machine_blocks(self.assembly, 4 if self.law.isa == "aarch64" else 0))

    @cached_property
    def defined(self) -> frozenset[str]:
        """Symbols of the functions."""
        return frozenset(block.function for block in self.blocks)

    def counted_object(self, out: Path) -> None:
        """Write an object for this machine that counts its blocks in ``volery_counters``."""
        text = with_counters(self.text)
        promoted = run_tool([llvm_toolchain().opt, f"-passes={PROMOTE}", "-S", "-o", "-"], text)
        self._object(promoted, out)

    def traced_object(self, out: Path) -> None:
        """Write an object for this machine that calls ``volery_trace`` at each block."""
        self._object(with_trace_calls(self.text), out)

    def plain_object(self, out: Path) -> None:
        """Write an object for this machine without counters."""
        self._object(self.text, out)

    def _object(self, text: str, out: Path) -> None:
        here = retarget(text, *HOST_TARGET)
        options = generator_options(HOST_ISA)
        run_tool([llvm_toolchain().llc, *options, "-filetype=obj", "-o", str(out)], here)


def generator_options(isa: str) -> tuple[str, ...]:
    """Return the options of the code generator.

    A choice between two values stays a conditional move: it has no block in the trace, so the direction of a
    branch in its place would not be known.
    """
    moves = ("-x86-cmov-converter=false",) if isa == "x86_64" else ()
    return ("-O2", "-relocation-model=pic", "-disable-cgp-select2branch", *moves)


def compile_program(sources: Sequence[Path], law: CoreLaw, flags: Sequence[str] = ()) -> OptimisedCode:
    """Compile C and C++ sources and optimise them for a core.

    Args:
        sources: C and C++ files.
        law: The core.
        flags: Options of the front end.

    Raises:
        CompilerError: The sources do not compile; the message is the compiler's.
        UsageError: A file is missing, is neither C nor C++, or LLVM is missing.
    """
    for source in sources:
        if not source.is_file():
            raise UsageError(f"{source}: there is no such file")
        if source.suffix not in LANGUAGES:
            raise UsageError(f"{source}: not a C or C++ file ({', '.join(sorted(LANGUAGES))})")
    with TemporaryDirectory(prefix="volery-native-") as scratch:
        text = _optimised(sources, law, flags, Path(scratch))
    return OptimisedCode(text, law, tuple(basic_blocks(text)))


def _optimised(sources: Sequence[Path], law: CoreLaw, flags: Sequence[str], scratch: Path) -> str:
    """Return the intermediate code of the program, from the cache while no file that was read has changed."""
    tools = llvm_toolchain()
    place = [str(Path.cwd()), *(os.environ.get(one, "") for one in _SEARCH_PATHS), *map(str, sources)]
    name = digest(METHOD, *tools.versions, law.isa, law.cpu, *flags, "", *place)
    record, cached = cached_path(f"{name}.json"), cached_path(f"{name}.ll")
    if is_current(record):
        with suppress(OSError):
            return cached.read_text(encoding="utf-8")
    modules, read = [], set[str]()
    for number, source in enumerate(sources):
        folder = scratch / str(number)
        folder.mkdir()
        plain = _front_end(source, law.isa, flags, folder)
        read.update(rule_dependencies((folder / _RULE).read_text(encoding="utf-8")))
        module = scratch / f"{number}.ll"
        retargeted = retarget(plain, *TARGETS[law.isa])
        run_tool([tools.opt, f"-passes={OPTIMISE}", f"-mcpu={law.cpu}", "-S", "-o", str(module)], retargeted)
        modules.append(module)
    out = modules[0] if len(modules) == 1 else scratch / "linked.ll"
    if len(modules) > 1:
        run_tool([tools.link, "-S", "-o", str(out), *map(str, modules)])
    text = out.read_text(encoding="utf-8")
    write_record(scratch / record.name, sorted(read))
    keep_file(out, cached.name)
    keep_file(scratch / record.name, record.name)
    return text


def _front_end(source: Path, isa: str, flags: Sequence[str], folder: Path) -> str:
    """Return the intermediate code of a source before any optimisation.

    Code for another instruction set is first compiled as code for it, then as code for neither.

    Raises:
        CompilerError: The source does not compile, or a part of it is of one instruction set only.
    """
    language = "c" if source.suffix in C_SUFFIXES else "c++"
    command = [llvm_toolchain().clang, "-x", language, *flags]

    def compiled(*options: str) -> str:
        rule = ("-MD", "-MF", str(folder / _RULE))
        return run_tool([*command, *FRONT_END_OPTIONS, *rule, *options, str(source), "-o", "-"])

    if isa == HOST_ISA:
        return compiled()

    def included(options: Sequence[str]) -> str:
        try:
            return run_tool([*command, "-MM", *options, str(source)])
        except CompilerError:  # it is reported by the compilation itself
            return ""

    copies = overlay_options(source, isa, folder, included)
    try:
        text = without_hints(compiled(*copies, f"-D{SHOWN[isa]}=1"))
        if not foreign_code(text):
            return text
    except CompilerError:
        pass
    text = without_hints(compiled(*copies))
    foreign = foreign_code(text)
    if foreign:
        raise CompilerError(
            f"{foreign} is of one instruction set, and the code has to run on this machine ({HOST_ISA}) and "
            f"to be compiled for {isa}: put it behind a macro of its instruction set, such as __x86_64__ or "
            "__SSE2__, with a portable branch beside it (#else), or switch it off with the library's "
            "own macro (--flag -D...)"
        )
    return text
