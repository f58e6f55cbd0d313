"""The files of a C++ component: what is compiled, what it includes of its own, where its class is.

The compiler, and what it has made before: objects and libraries by the content of all that went into them.

What is cached stands in the user's cache folder, ``$XDG_CACHE_HOME/volery/cpp`` or ``~/.cache/volery/cpp``.
An object is used again if its compiler, its options, its source and every header that it included (the
system's too) are as they were. The folder may be deleted at any time.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

from volery.base.errors import Location, ModelError, UsageError

_SOURCES = (".cpp", ".cc", ".cxx", ".c++")
_HEADERS = (".h", ".hpp", ".hh", ".hxx")
_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*[<"]([^>"\n]+)[>"]', re.MULTILINE)
_COMMENT = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.DOTALL)
_MAIN = re.compile(r"^\s*(?:extern\s+\"C\"\s+)?(?:auto|int)\s+main\s*\(", re.MULTILINE)


@dataclass(frozen=True)
class Sources:
    """*compiled* are translation units, *own* those and the headers beside them."""

    folder: Path
    compiled: tuple[Path, ...]
    own: tuple[Path, ...]

    def includes(self) -> list[str]:
        """What its files include, each once, in order."""
        found = (name for file in self.own for name in _INCLUDE.findall(_text(file)))
        return list(dict.fromkeys(found))

    def defines_main(self) -> bool:
        """Whether it is a program of its own."""
        return any(_MAIN.search(_code(file)) for file in self.compiled)

    def file_of_class(self, name: str) -> Path | None:
        """The file that defines the class, headers first."""
        defined = re.compile(
            rf"\b(?:class|struct)\s+{re.escape(name)}\b(?:\s+final)?\s*(?::[^:;{{][^;{{]*)?\{{"
        )
        in_order = sorted(self.own, key=lambda file: file.suffix not in _HEADERS)
        return next((file for file in in_order if defined.search(_code(file))), None)


def find_sources(path: Path, where: Location | None = None) -> Sources:
    """The component at *path*, a file or a folder; ``ModelError`` at *where* if there is nothing to compile.

    Of a folder all sources are compiled, those of folders inside too. Of a file, that file; headers beside it
    and below belong to it.
    """
    folder = path if path.is_dir() else path.parent
    if not path.exists():
        raise ModelError(f"no file or folder {path}", where=where)
    around = list(_files(folder))
    compiled = [file for file in around if file.suffix in _SOURCES] if path.is_dir() else [path]
    if not compiled:
        raise ModelError(f"no source file in {path}: one that ends in {', '.join(_SOURCES)}", where=where)
    headers = [file for file in around if file.suffix in _HEADERS]
    return Sources(folder.resolve(), tuple(file.resolve() for file in compiled), _own(compiled, headers))


def _own(compiled: list[Path], headers: list[Path]) -> tuple[Path, ...]:
    return tuple(file.resolve() for file in (*compiled, *headers))


def _files(folder: Path) -> Iterator[Path]:
    return (file for file in sorted(folder.rglob("*")) if file.is_file())


def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8", errors="replace")


def _code(file: Path) -> str:
    """Its text without comments and strings."""
    return _COMMENT.sub(" ", _text(file))


COMPILERS = ("g++", "clang++", "c++")
FLAGS = ("-std=c++17", "-O2", "-g", "-fPIC", "-Wall", "-fdiagnostics-color=never")
COMPILER_HINT = "apt install g++ (or clang)"
_SHOWN_LINES = 30
_ERROR = re.compile(r"^(?P<file>[^\s:][^:\n]*):(?P<line>\d+):(?:\d+:)? (?:fatal )?error: ", re.MULTILINE)
_LINKED = re.compile(r"^(?:\S*ld: )?(?P<file>[^\s:]+\.(?:cpp|cc|cxx|h|hpp)):(?P<line>\d+): ", re.MULTILINE)

ReportProgress = Callable[[str], None]


@dataclass(frozen=True)
class Compiler:
    """A compiler: how it is called, and what it says of its version."""

    program: str
    version: str


def has_compiler() -> bool:
    """Whether there is one."""
    try:
        compiler()
    except UsageError:
        return False
    return True


@cache
def compiler() -> Compiler:
    """The first of ``$CXX``, g++, clang++ and c++ that is there; ``UsageError`` names what to install."""
    asked = os.environ.get("CXX", "")
    for name in (asked,) if asked else COMPILERS:
        program = shutil.which(name)
        if program is not None:
            said = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
            return Compiler(program, said.stdout.partition("\n")[0])
    missing = f"$CXX is {asked!r}, which is not there" if asked else f"there is no {', '.join(COMPILERS)}"
    raise UsageError(
        f"components in C++ need a compiler, but {missing}: {COMPILER_HINT}; "
        "without one they take their stated times at fidelity 'times' and do nothing else"
    )


def cache_folder() -> Path:
    """Where compiled code is kept; ``UsageError`` if nothing can be written there."""
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
    """Compiles and links for one component, which errors name. *tell* is told what takes time."""

    component: str
    tell: ReportProgress | None = None

    def object_file(self, source: Path, include: Iterable[Path] = (), flags: Sequence[str] = ()) -> Path:
        """*source* compiled. ``ModelError`` with the compiler's own words if it does not compile."""
        seen = [option for folder in include for option in ("-I", str(folder))]
        command = [compiler().program, *FLAGS, *_own_flags(), *flags, *seen, "-c", str(source)]
        place = cache_folder() / _digest(compiler().version, *command, _content(source))
        made, record = place.with_suffix(".o"), place.with_suffix(".json")
        if made.exists() and _still_true(record):
            return made
        if self.tell is not None:
            self.tell(f"compiling {source.name} of {self.component}")
        with tempfile.TemporaryDirectory(dir=cache_folder()) as scratch:
            new, depends = Path(scratch, "new.o"), Path(scratch, "new.d")
            self._run([*command, "-MD", "-MF", str(depends), "-o", str(new)])
            headers = _read_dependencies(depends.read_text(encoding="utf-8"))
            kept = Path(scratch, "new.json")
            kept.write_text(json.dumps({name: _content(Path(name)) for name in headers}), encoding="utf-8")
            new.replace(made)
            kept.replace(record)
        return made

    def library(self, objects: Sequence[Path], options: Sequence[str] = ()) -> Path:
        """*objects* linked into a shared library that lacks nothing."""
        how = ("-shared", "-Wl,-Bsymbolic", "-Wl,-z,defs")
        return self._linked(how, objects, options, ".so")

    def executable(self, objects: Sequence[Path], options: Sequence[str] = ()) -> Path:
        """*objects* linked into a program."""
        return self._linked((), objects, options, ".out")

    def _linked(
        self, how: Sequence[str], objects: Sequence[Path], options: Sequence[str], suffix: str
    ) -> Path:
        command = [compiler().program, *how]
        place = cache_folder() / _digest(compiler().version, *command, *options, *map(_content, objects))
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
            raise self._does_not_compile(Path(command[0]).name, done.stderr)

    def _does_not_compile(self, program: str, said: str) -> ModelError:
        found = _ERROR.search(said) or _LINKED.search(said)
        where = Location(found["file"], int(found["line"])) if found else None
        lines = said.strip().splitlines()
        if len(lines) > _SHOWN_LINES:
            lines = [*lines[:_SHOWN_LINES], f"... {len(lines) - _SHOWN_LINES} more lines"]
        return ModelError("\n".join((f"does not compile; {program} says:", *lines)), self.component, where)


def _own_flags() -> tuple[str, ...]:
    """g++ would make templates' static variables one for all copies of a library."""
    return () if "clang" in compiler().version else ("-fno-gnu-unique",)


def _digest(*parts: str) -> str:
    return sha256("\0".join(parts).encode()).hexdigest()[:32]


def _content(path: Path) -> str:
    try:
        return sha256(path.read_bytes()).hexdigest()
    except OSError:
        return "gone"


def _still_true(record: Path) -> bool:
    try:
        known = json.loads(record.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return all(_content(Path(name)) == content for name, content in known.items())


def _read_dependencies(text: str) -> list[str]:
    """The files of a make rule: ``a.o: b.cpp c.h \\``."""
    _, _, files = text.replace("\\\n", " ").partition(": ")
    return [name.replace("\\ ", " ") for name in re.split(r"(?<!\\)\s+", files.strip()) if name]
