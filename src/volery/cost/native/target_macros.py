"""Code that asks what machine it is on: the target's macros for the user, the host's for the system.

Code that is estimated for another instruction set is compiled for it and also runs here, against the
libraries of this machine. So the headers of the system have to be this machine's, which rules out clang's
``--target``. Instead the user's files are compiled as copies, in place of the originals by an overlay of
clang's file system: in their preprocessor lines the macros of this machine's instruction set are replaced by
names that are not defined, and the target's by a name that is. Macros of the target's vector extensions stay
undefined: their intrinsics cannot run here, and the portable branch can.

What no macro guards is found in the intermediate code and reported with file and line.
"""

from __future__ import annotations

import json
import os
import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

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
    folder.mkdir()
    known: set[str] = {_absolute(source)}
    options: list[str] = []
    for _ in range(_MOST_PASSES):
        options = _overlay(sorted(known), isa, folder)
        found = {_absolute(one) for one in _files(dependencies(options))}
        if found <= known:
            break
        known |= found
    return options


def _absolute(path: str | Path) -> str:
    """Return the path by which the front end finds the file; links are not followed."""
    return os.path.normpath(Path.cwd() / path)


def _files(rule: str) -> list[str]:
    """Return the files after the colon of a rule for make."""
    return shlex.split(rule.partition(":")[2].replace("\\\n", " "))


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
        if found := _ASSEMBLY.search(line):
            yield f"{_place(text, line)}: inline assembly {found[1]!r}"
        elif found := _INTRINSIC.search(line):
            yield _call_of_intrinsic(text, line, function, found[1])


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
    found = re.search(_FIELD.format(name), body)
    return (found[1] or found[2] or found[3] or "") if found else ""


def _plain_name(symbol: str) -> str:
    """Return the name of a function without namespace in a symbol of C or C++."""
    mangled = re.match(r"_ZL?(\d+)", symbol)
    return symbol[mangled.end() :][: int(mangled[1])] if mangled else symbol
