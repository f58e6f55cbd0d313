"""The programs that compile: found by name, run with a limit, their complaints passed on as theirs.

Sources become one optimised module for a core, and from it what runs here: counted, traced or plain.
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
from volery.cost.native.assembly import MachineBlock, machine_blocks
from volery.cost.native.llvm_ir import BasicBlock, basic_blocks, retarget, with_counters, with_trace_calls

VERSIONS = ("-19", "-18", "-17", "")
"""Suffixes of LLVM's programs that are tried, best first; 19 is what Debian 12 brings and tests use."""

PACKAGES = {"clang++": "clang-19", "opt": "llvm-19", "llc": "llvm-19", "llvm-link": "llvm-19"}
LIMIT_S = 300.0


class CompilerError(UsageError):
    """A compiler refused; the message is the compiler's own."""


@dataclass(frozen=True)
class LlvmToolchain:
    """LLVM's front end, optimiser, code generator and linker of its intermediate code, of one version."""

    clang: str
    opt: str
    llc: str
    link: str


@cache
def llvm_toolchain() -> LlvmToolchain:
    """The best version that is complete. ``UsageError`` names the Debian package of what is missing."""
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
    """What a program prints. ``CompilerError`` with its own words if it fails."""
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
"""Triple and data layout of LLVM 19, by the instruction set."""

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
"""Ways from a branch to where other ways come in have a block of their own. It is empty: what is made of it
is the same machine code, but how often the way was taken is counted.
"""
PROMOTE = "function(loop-mssa(licm))"
"""Counters of a loop live in registers while it runs; calls see them up to date."""

METHOD = "3"
"""Another one whenever costs are found in another way: what was kept before counts no more."""

C_SUFFIXES = {".c"}
LANGUAGES = {".c", ".cc", ".cpp", ".cxx", ".C"}


@dataclass(frozen=True)
class Program:
    """Code optimised for a core: ``text`` is LLVM's intermediate code, with the numbering of its blocks."""

    text: str
    law: CoreLaw
    blocks: tuple[BasicBlock, ...]

    @cached_property
    def key(self) -> str:
        """The same for the same code on the same core."""
        told = METHOD + self.text + self.law.model_dump_json()
        return hashlib.sha256(told.encode()).hexdigest()[:24]

    @cached_property
    def assembly(self) -> str:
        """The target's assembly."""
        notation = ["-x86-asm-syntax=intel"] if self.law.isa == "x86_64" else []
        return run_tool([llvm_toolchain().llc, *generator(self.law), *notation, "-o", "-"], self.text)

    @cached_property
    def pieces(self) -> tuple[MachineBlock, ...]:
        """The target's machine code."""
        return tuple(machine_blocks(self.assembly, 4 if self.law.isa == "aarch64" else 0))

    @cached_property
    def defined(self) -> frozenset[str]:
        """The symbols of its functions."""
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


def generator(law: CoreLaw) -> tuple[str, ...]:
    """The options of LLVM's code generator for a core."""
    return ("-O2", f"-mcpu={law.cpu}", "-relocation-model=pic")


def compile_program(sources: Sequence[Path], law: CoreLaw, flags: Sequence[str] = ()) -> Program:
    """Compile C and C++ sources and optimise them for a core.

    *flags* go to the front end. ``CompilerError`` has the compiler's words.
    """
    for source in sources:
        if not source.is_file():
            raise UsageError(f"{source}: there is no such file")
        if source.suffix not in LANGUAGES:
            raise UsageError(f"{source}: C or C++ is wanted ({', '.join(sorted(LANGUAGES))})")
    tools = llvm_toolchain()
    with TemporaryDirectory(prefix="volery-native-") as folder:
        modules = []
        for number, source in enumerate(sources):
            plain = run_tool(
                [tools.clang, *_language(source), *FRONT_END_OPTIONS, *flags, str(source), "-o", "-"]
            )
            module = Path(folder, f"{number}.ll")
            retargeted = retarget(plain, *TARGETS[law.isa])
            run_tool(
                [tools.opt, f"-passes={OPTIMISE}", f"-mcpu={law.cpu}", "-S", "-o", str(module)], retargeted
            )
            modules.append(str(module))
        text = run_tool([tools.link, "-S", "-o", "-", *modules])
    return Program(text, law, tuple(basic_blocks(text)))


def _language(source: Path) -> tuple[str, ...]:
    return ("-x", "c") if source.suffix in C_SUFFIXES else ("-x", "c++")
