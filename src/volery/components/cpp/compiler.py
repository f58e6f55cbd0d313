"""Sources of a C++ component, and the compiler with its cache of objects and libraries.

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
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

from volery.base.dependency_record import content_digest, is_current, rule_dependencies, write_record
from volery.base.errors import Location, ModelError, UsageError

_SOURCE_SUFFIXES = (".cpp", ".cc", ".cxx", ".c++")
_HEADER_SUFFIXES = (".h", ".hpp", ".hh", ".hxx")
_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*[<"]([^>"\n]+)[>"]', re.MULTILINE)
_COMMENT = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.DOTALL)
_MAIN = re.compile(r"^\s*(?:extern\s+\"C\"\s+)?(?:auto|int)\s+main\s*\(", re.MULTILINE)

COMPILERS = ("g++", "clang++", "c++")
FLAGS = ("-std=c++17", "-O2", "-g", "-fPIC", "-Wall", "-fdiagnostics-color=never")
COMPILER_HINT = "apt install g++ (or clang)"
_SHOWN_LINES = 30
_COMPILE_ERROR = re.compile(
    r"^(?P<file>[^\s:][^:\n]*):(?P<line>\d+):(?:\d+:)? (?:fatal )?error: ", re.MULTILINE
)
_LINK_ERROR = re.compile(
    r"^(?:\S*ld: )?(?P<file>[^\s:]+\.(?:cpp|cc|cxx|h|hpp)):(?P<line>\d+): ", re.MULTILINE
)

ReportProgress = Callable[[str], None]
"""Receives a line about a step that takes time."""


@dataclass(frozen=True)
class Sources:
    """Files of a component: ``compiled`` are translation units, ``own`` those and the headers beside them."""

    folder: Path
    compiled: tuple[Path, ...]
    own: tuple[Path, ...]

    def includes(self) -> list[str]:
        """Return the names that the files include, each once, in order."""
        found = (name for file in self.own for name in _INCLUDE.findall(_text(file)))
        return list(dict.fromkeys(found))

    def defines_main(self) -> bool:
        """Return whether the component is a program with a ``main``."""
        return any(_MAIN.search(_code(file)) for file in self.compiled)

    def file_of_class(self, name: str) -> Path | None:
        """Return the file that defines a class, headers first, or None."""
        definition = _definition(name)
        in_order = sorted(self.own, key=lambda file: file.suffix not in _HEADER_SUFFIXES)
        return next((file for file in in_order if definition.search(_code(file))), None)

    def mentions(self, function: str) -> bool:
        """Return whether a file declares, defines or calls a function of this name."""
        return any(re.search(rf"\b{re.escape(function)}\s*\(", _code(file)) for file in self.own)

    def place_of_class(self, name: str) -> Location | None:
        """Return file and line of the definition of a class, or None."""
        file = self.file_of_class(name)
        found = _definition(name).search(_text(file)) if file is not None else None
        return Location(str(file), _text(file).count("\n", 0, found.start()) + 1) if file and found else None


def _definition(name: str) -> re.Pattern[str]:
    return re.compile(rf"\b(?:class|struct)\s+{re.escape(name)}\b(?:\s+final)?\s*(?::[^:;{{][^;{{]*)?\{{")


def find_sources(path: Path, where: Location | None = None) -> Sources:
    """Find the sources of the component at ``path``, a file or a folder.

    All sources in a folder and its subfolders are compiled. Of a file only that file is compiled; headers
    beside it and in subfolders belong to it.

    Raises:
        ModelError: There is nothing to compile; the error names ``where``.
    """
    folder = path if path.is_dir() else path.parent
    if not path.exists():
        raise ModelError(f"no file or folder {path}", where=where)
    around = [file for file in sorted(folder.rglob("*")) if file.is_file()]
    compiled = [file for file in around if file.suffix in _SOURCE_SUFFIXES] if path.is_dir() else [path]
    if not compiled:
        suffixes = ", ".join(_SOURCE_SUFFIXES)
        raise ModelError(f"no source file in {path}: one that ends in {suffixes}", where=where)
    headers = [file for file in around if file.suffix in _HEADER_SUFFIXES]
    own = tuple(file.resolve() for file in (*compiled, *headers))
    return Sources(folder.resolve(), own[: len(compiled)], own)


def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8", errors="replace")


def _code(file: Path) -> str:
    """Return a file's text without comments and strings."""
    return _COMMENT.sub(" ", _text(file))


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

    def object_file(self, source: Path, include: Iterable[Path] = (), flags: Sequence[str] = ()) -> Path:
        """Compile ``source`` and return its object file.

        Raises:
            ModelError: The source does not compile; the message is the compiler's.
        """
        folders = [option for folder in include for option in ("-I", str(folder))]
        command = [compiler().program, *FLAGS, *_extra_flags(), *flags, *folders, "-c", str(source)]
        place = cache_folder() / _digest(compiler().version, *command, content_digest(source))
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
        found = _COMPILE_ERROR.search(output) or _LINK_ERROR.search(output)
        where = Location(found["file"], int(found["line"])) if found else None
        lines = output.strip().splitlines()
        if len(lines) > _SHOWN_LINES:
            lines = [*lines[:_SHOWN_LINES], f"... {len(lines) - _SHOWN_LINES} more lines"]
        return ModelError("\n".join((f"does not compile; {program} says:", *lines)), self.component, where)


def _extra_flags() -> tuple[str, ...]:
    """Return the flags that keep static variables of templates separate in each copy of a library."""
    return () if "clang" in compiler().version else ("-fno-gnu-unique",)


def _digest(*parts: str) -> str:
    return sha256("\0".join(parts).encode()).hexdigest()[:32]
