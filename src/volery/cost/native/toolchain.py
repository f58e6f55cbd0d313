"""The programs that compile: found by name, run with a limit, their complaints passed on as theirs."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from volery.base.errors import UsageError

VERSIONS = ("-19", "-18", "-17", "")
"""Suffixes of LLVM's programs that are tried, best first; 19 is what Debian 12 brings and tests use."""

PACKAGES = {"clang++": "clang-19", "opt": "llvm-19", "llc": "llvm-19", "llvm-link": "llvm-19"}
LIMIT_S = 300.0


class CompilerError(UsageError):
    """A compiler refused; the message is the compiler's own."""


@dataclass(frozen=True)
class Toolchain:
    """LLVM's front end, optimiser, code generator and linker of its intermediate code, of one version."""

    clang: str
    opt: str
    llc: str
    link: str


@cache
def toolchain() -> Toolchain:
    """The best version that is complete. ``UsageError`` names the Debian package of what is missing."""
    names = tuple(PACKAGES)
    for suffix in VERSIONS:
        found = [shutil.which(name + suffix) for name in names]
        if all(found):
            return Toolchain(*(str(path) for path in found))
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
