"""The files of a C++ component: what is compiled, what it includes of its own, where its class is."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from volery.base.errors import Location, ModelError

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
