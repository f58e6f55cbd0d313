"""Compilation with LLVM: sources become one optimised module for a core.

From the module come the core's machine code and the objects that run on this machine: counted, traced or
plain. LLVM's programs are run as processes; bindings to its libraries would tie volery to one version.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

from volery.base.errors import UsageError
from volery.cost.code_laws import CoreLaw
from volery.cost.native.llvm_ir import BasicBlock, basic_blocks, retarget, with_counters, with_trace_calls
from volery.cost.native.machine_code import MachineBlock, machine_blocks
from volery.cost.native.target_macros import HOST_ISA, SHOWN, foreign_code, overlay_options, without_hints

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

METHOD = "3"
"""Version of the method that finds costs; a new version makes kept costs invalid."""

C_SUFFIXES = {".c"}
LANGUAGES = {".c", ".cc", ".cpp", ".cxx", ".C"}


@dataclass(frozen=True)
class Program:
    """Code optimised for a core: LLVM's intermediate code and its basic blocks, whose order numbers them."""

    text: str
    law: CoreLaw
    blocks: tuple[BasicBlock, ...]

    @cached_property
    def key(self) -> str:
        """Digest of the code and the core."""
        text = METHOD + self.text + self.law.model_dump_json()
        return hashlib.sha256(text.encode()).hexdigest()[:24]

    @cached_property
    def assembly(self) -> str:
        """Assembly for the core."""
        options = ["-O2", f"-mcpu={self.law.cpu}", "-relocation-model=pic"]
        notation = ["-x86-asm-syntax=intel"] if self.law.isa == "x86_64" else []
        return run_tool([llvm_toolchain().llc, *options, *notation, "-o", "-"], self.text)

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
        run_tool(
            [llvm_toolchain().llc, "-O2", "-relocation-model=pic", "-filetype=obj", "-o", str(out)], here
        )


def compile_program(sources: Sequence[Path], law: CoreLaw, flags: Sequence[str] = ()) -> Program:
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
    tools = llvm_toolchain()
    with TemporaryDirectory(prefix="volery-native-") as folder:
        modules = []
        for number, source in enumerate(sources):
            plain = _front_end(source, law.isa, flags, Path(folder, str(number)))
            module = Path(folder, f"{number}.ll")
            retargeted = retarget(plain, *TARGETS[law.isa])
            run_tool(
                [tools.opt, f"-passes={OPTIMISE}", f"-mcpu={law.cpu}", "-S", "-o", str(module)], retargeted
            )
            modules.append(str(module))
        text = run_tool([tools.link, "-S", "-o", "-", *modules])
    return Program(text, law, tuple(basic_blocks(text)))


def _front_end(source: Path, isa: str, flags: Sequence[str], folder: Path) -> str:
    """Return the intermediate code of a source before any optimisation.

    Code for another instruction set is first compiled as code for it, then as code for neither.

    Raises:
        CompilerError: The source does not compile, or a part of it is of one instruction set only.
    """
    language = "c" if source.suffix in C_SUFFIXES else "c++"
    command = [llvm_toolchain().clang, "-x", language, *flags]

    def compiled(*options: str) -> str:
        return run_tool([*command, *FRONT_END_OPTIONS, *options, str(source), "-o", "-"])

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
