"""What a crash in a component was, from the one line that its dying process wrote."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from volery import components
from volery.base.errors import ComponentError
from volery.ros import client_libraries

_LINE = 4096
_OURS = tuple(
    f"{Path(package.__file__).parent}/" for package in (components, client_libraries) if package.__file__
)
_WORDS = {
    "stack": "its stack is full: it recurses without end, or keeps too much in local variables",
    "frozen": "virtual time is frozen: it computes and asks nothing any more",
    str(int(signal.SIGSEGV)): "segmentation fault",
    str(int(signal.SIGBUS)): "bus error",
    str(int(signal.SIGFPE)): "arithmetic fault, such as a division of whole numbers by zero",
    str(int(signal.SIGILL)): "illegal instruction",
    str(int(signal.SIGABRT)): "aborted: abort(), a failed assertion or an exception that nothing catches",
}


@dataclass(frozen=True)
class Crash:
    """Whose doing it was, what happened, where in the source and with which last words (empty: not known)."""

    component: str
    what: str
    where: str = ""
    said: str = ""

    def error(self) -> ComponentError:
        """It in words."""
        where = f", in {self.where}" if self.where else ""
        said = f"; it said: {self.said}" if self.said else ""
        return ComponentError(self.component, f"{self.what}{where}{said}")


def read_crash(report: int, libraries: Mapping[str, Path]) -> Crash | None:
    """The crash that was reported to the file descriptor *report*, ``None`` if none was.

    *libraries* are the components' by the instances' names, to find source lines in. The other end must be
    closed.
    """
    line = os.read(report, _LINE).decode(errors="replace").removesuffix("\n")
    if not line:
        return None
    component, what, address, frames, said = line.split("\t", 4)
    words = _WORDS.get(what, f"signal {what}")
    if what == str(int(signal.SIGSEGV)):
        words = f"{words} at address {'0' if address == '(nil)' else address}"
    library = libraries.get(component)
    where = _source_line(library, frames.split()) if library else ""
    return Crash(component, words, where, " ".join(said.split()))


def _source_line(library: Path, frames: list[str]) -> str:
    """``Pilot::run() (pilot.cpp:12)``, of the innermost frame that is the user's.

    Empty without ``addr2line`` or where that knows nothing.
    """
    program = shutil.which("addr2line")
    if program is None or not frames:
        return ""
    command = [program, "-C", "-f", "-i", "-e", str(library), *(f"0x{frame}" for frame in frames)]
    said = subprocess.run(command, capture_output=True, text=True, check=False).stdout.splitlines()
    for function, place in zip(said[::2], said[1::2], strict=False):
        file, _, line = place.partition(" ")[0].rpartition(":")
        if not file.startswith(("?", "/usr/", *_OURS)):
            return f"{function} ({Path(file).name}:{line})"
    return ""
