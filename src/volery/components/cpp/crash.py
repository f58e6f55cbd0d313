"""Report of a crash in a C++ component, from the one line that its dying process has written."""

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

_LINE_BYTES = 4096
_FRAMEWORK_FOLDERS = tuple(
    f"{Path(package.__file__).parent}/" for package in (components, client_libraries) if package.__file__
)
_DESCRIPTIONS = {
    "stack": "its stack is full: it recurses without end, or keeps too much in local variables",
    "frozen": "virtual time is frozen: it computes and makes no request any more",
    str(int(signal.SIGSEGV)): "segmentation fault",
    str(int(signal.SIGBUS)): "bus error",
    str(int(signal.SIGFPE)): "arithmetic fault, such as a division of whole numbers by zero",
    str(int(signal.SIGILL)): "illegal instruction",
    str(int(signal.SIGABRT)): "aborted: abort(), a failed assertion or an exception that nothing catches",
}


@dataclass(frozen=True)
class Crash:
    """A crash: the component, what happened, the source line and the last output (empty: not known)."""

    component: str
    what: str
    source_line: str = ""
    last_output: str = ""

    def error(self) -> ComponentError:
        """Return the crash as an error of the component."""
        where = f", in {self.source_line}" if self.source_line else ""
        output = f"; it said: {self.last_output}" if self.last_output else ""
        return ComponentError(self.component, f"{self.what}{where}{output}")


def read_crash(report: int, libraries: Mapping[str, Path]) -> Crash | None:
    """Read the crash report, or return None if there is none.

    Args:
        report: File descriptor of the report; its other end must be closed.
        libraries: Library of each instance by its name, to look source lines up in.
    """
    line = os.read(report, _LINE_BYTES).decode(errors="replace").removesuffix("\n")
    if not line:
        return None
    component, what, address, frames, output = line.split("\t", 4)
    description = _DESCRIPTIONS.get(what, f"signal {what}")
    if what == str(int(signal.SIGSEGV)):
        description = f"{description} at address {'0' if address == '(nil)' else address}"
    library = libraries.get(component)
    source_line = _source_line(library, frames.split()) if library else ""
    return Crash(component, description, source_line, " ".join(output.split()))


def _source_line(library: Path, frames: list[str]) -> str:
    """Return ``Pilot::run() (pilot.cpp:12)`` for the innermost frame in the component's own files.

    Empty without ``addr2line`` or without debug information.
    """
    program = shutil.which("addr2line")
    if program is None or not frames:
        return ""
    command = [program, "-C", "-f", "-i", "-e", str(library), *(f"0x{frame}" for frame in frames)]
    lines = subprocess.run(command, capture_output=True, text=True, check=False).stdout.splitlines()
    for function, place in zip(lines[::2], lines[1::2], strict=False):
        file, _, line = place.partition(" ")[0].rpartition(":")
        if not file.startswith(("?", "/usr/", *_FRAMEWORK_FOLDERS)):
            return f"{function} ({Path(file).name}:{line})"
    return ""
