"""The C++ compiler, with its cache of objects and libraries.

Cached files are in ``$XDG_CACHE_HOME/volery/cpp`` or ``~/.cache/volery/cpp``, named by the content of all
that went into them. An object is reused if its compiler, its options, its source and every header that it
included (the system's too) are unchanged. The folder may be deleted at any time.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

from volery.base.dependency_record import content_digest, is_current, rule_dependencies, write_record
from volery.base.errors import Location, ModelError, UsageError

COMPILERS = ("g++", "clang++", "c++")
FLAGS = ("-std=c++17", "-O2", "-g", "-fPIC", "-Wall", "-fdiagnostics-color=never")
COMPILER_HINT = "apt install g++ (or clang)"
_PACKAGE = Path(__file__).parents[2]
_SHOWN_LINES, _SHOWN_LETTERS = 12, 300
_COMPILE_ERROR = re.compile(
    r"^(?P<file>[^\s:][^:\n]*):(?P<line>\d+):(?:\d+:)? (?:fatal )?error: ", re.MULTILINE
)
_USE = re.compile(
    r"^(?P<file>[^\s:][^:\n]*):(?P<line>\d+):(?:\d+:)? +"
    r"(?:required from|note: in (?:expansion of macro|instantiation))",
    re.MULTILINE,
)
"""Where g++ and clang++ say that a template or macro is used."""
_LINK_ERROR = re.compile(
    r"^(?:\S*ld: )?(?P<file>[^\s:]+\.(?:cpp|cc|cxx|h|hpp)):(?P<line>\d+): ", re.MULTILINE
)

ReportProgress = Callable[[str], None]
"""Receives a line about a step that takes time."""


@dataclass(frozen=True)
class Compiler:
    """A compiler: its program and the first line of its version."""

    program: str
    version: str


def has_compiler() -> bool:
    """Return whether there is a C++ compiler."""
    try:
        compiler()
    except UsageError:
        return False
    return True


@cache
def compiler() -> Compiler:
    """Return ``$CXX``, or the first of g++, clang++ and c++ that is installed.

    Raises:
        UsageError: There is none; the error names what to install.
    """
    requested = os.environ.get("CXX", "")
    for name in (requested,) if requested else COMPILERS:
        program = shutil.which(name)
        if program is not None:
            done = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
            return Compiler(program, done.stdout.partition("\n")[0])
    missing = (
        f"$CXX is {requested!r}, which is not there" if requested else f"there is no {', '.join(COMPILERS)}"
    )
    raise UsageError(
        f"components in C++ need a compiler, but {missing}: {COMPILER_HINT}; "
        "without one they take their stated times at fidelity 'times' and do nothing else"
    )


def cache_folder() -> Path:
    """Return the folder of compiled code.

    Raises:
        UsageError: The folder cannot be written.
    """
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(base) / "volery" / "cpp"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"compiled components are kept in {folder}, which cannot be made: {error.strerror}; "
            "set XDG_CACHE_HOME to a folder of yours"
        ) from error
    return folder


@dataclass(frozen=True)
class CppToolchain:
    """Compiles and links for one component, which error messages name."""

    component: str
    report_progress: ReportProgress | None = None

    def object_file(self, source: Path, include: Sequence[Path] = (), flags: Sequence[str] = ()) -> Path:
        """Compile ``source`` and return its object file.

        Raises:
            ModelError: The source does not compile; the message is the compiler's.
        """
        folders = [option for folder in include for option in ("-I", str(folder))]
        command = [compiler().program, *FLAGS, *_extra_flags(), *flags, *folders, "-c", str(source)]
        names = [name for folder in include for name in _names_of_ours(folder)]
        place = cache_folder() / _digest(compiler().version, *command, *names, content_digest(source))
        made, record = place.with_suffix(".o"), place.with_suffix(".json")
        if made.exists() and is_current(record):
            return made
        if self.report_progress is not None:
            self.report_progress(f"compiling {source.name} of {self.component}")
        with tempfile.TemporaryDirectory(dir=cache_folder()) as scratch:
            new, depends = Path(scratch, "new.o"), Path(scratch, "new.d")
            self._run([*command, "-MD", "-MF", str(depends), "-o", str(new)])
            new_record = Path(scratch, "new.json")
            write_record(new_record, rule_dependencies(depends.read_text(encoding="utf-8")))
            new.replace(made)
            new_record.replace(record)
        return made

    def library(self, objects: Sequence[Path], options: Sequence[str] = ()) -> Path:
        """Link ``objects`` into a shared library without undefined symbols."""
        return self._link(("-shared", "-Wl,-Bsymbolic", "-Wl,-z,defs"), objects, options, ".so")

    def executable(self, objects: Sequence[Path], options: Sequence[str] = ()) -> Path:
        """Link ``objects`` into a program."""
        return self._link((), objects, options, ".out")

    def _link(
        self, kind: Sequence[str], objects: Sequence[Path], options: Sequence[str], suffix: str
    ) -> Path:
        command = [compiler().program, *kind]
        contents = map(content_digest, objects)
        place = cache_folder() / _digest(compiler().version, *command, *options, *contents)
        made = place.with_suffix(suffix)
        if not made.exists():
            with tempfile.TemporaryDirectory(dir=cache_folder()) as scratch:
                new = Path(scratch, f"new{suffix}")
                self._run([*command, *map(str, objects), *options, "-o", str(new)])
                new.replace(made)
        return made

    def _run(self, command: Sequence[str]) -> None:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env={**os.environ, "LC_ALL": "C"}
        )
        if done.returncode:
            raise self._error(Path(command[0]).name, done.stderr)

    def _error(self, program: str, output: str) -> ModelError:
        where = _place(output)
        lines = list(_essential(output))
        more = len(lines) - _SHOWN_LINES
        if more > 0:
            lines[_SHOWN_LINES:] = [f"... {more} more lines"]
        return ModelError("\n".join((f"does not compile; {program} says:", *lines)), self.component, where)


def _is_ours(file: str) -> bool:
    """Return whether a file is of the system, of volery, or generated, and so not the user's."""
    path = Path(file)
    return bool({Path("/usr"), _PACKAGE, cache_folder()} & {*path.parents})


def _place(output: str) -> Location | None:
    """Return the place of the first error; of one in a header that is not the user's, where it is used."""
    found = _COMPILE_ERROR.search(output)
    if found is None:
        found = _LINK_ERROR.search(output)
    elif _is_ours(found["file"]):
        used = [one for one in _USE.finditer(output) if not _is_ours(one["file"])]
        before = [one for one in used if one.start() < found.start()]
        found = (before[-1:] or used[:1] or [found])[0]
    return Location(found["file"], int(found["line"])) if found else None


def _essential(output: str) -> Iterator[str]:
    """Yield the errors, each with its line of the source, without what the compiler says beside them."""
    lines = output.strip().splitlines()
    if not _COMPILE_ERROR.search(output):
        yield from lines
        return
    left = 0
    for line in lines:
        if _COMPILE_ERROR.match(line):
            left = 3
        elif _USE.match(line):
            left = 1 if not _is_ours(line.partition(":")[0]) else 0
        elif not line.startswith(" "):
            left = 0
        if left > 0:
            left -= 1
            yield line if len(line) <= _SHOWN_LETTERS else f"{line[:_SHOWN_LETTERS]}..."


def _extra_flags() -> tuple[str, ...]:
    """Return the flags that keep static variables of templates separate in each copy of a library."""
    return () if "clang" in compiler().version else ("-fno-gnu-unique",)


@cache
def _names_of_ours(folder: Path) -> tuple[str, ...]:
    """Return the names of the headers in a folder that comes with volery, else none.

    A new one may be found before a header of the system that an object has been compiled with.
    """
    if _PACKAGE not in folder.parents:
        return ()
    return tuple(sorted(str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file()))


def _digest(*parts: str) -> str:
    return sha256("\0".join(parts).encode()).hexdigest()[:32]
