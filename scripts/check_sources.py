"""Check circles, upward includes, names, words, the tests' folders, and mathematics.

    python scripts/check_sources.py

Each check returns one line per offender. The layers are those of the import-linter contract in
pyproject.toml, so that Python imports and C++ includes obey the same order. `make check` runs this script.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import grimp
import networkx as nx

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "src" / "volery"

WORDS = (
    r"heard",
    r"told",
    r"nobody",
    r"somebody",
    r"whoever",
    r"so long",
    r"comes? down",
    r"honoured",
    r"summons",
    r"portraits?",
    r"airfields?",
    r"(be)?sieged?",
    r"stand[-_]ins?",
    r"faces?",
    r"houses?",
    r"house code",
)
"""Words that docs/design/glossary.md replaces. A firmware's own texts and people's houses are in ALLOWED."""

PROSE = {".py", ".md", ".h", ".hpp", ".cpp", ".c", ".toml", ".yaml", ".j2", ".js", ".sh"}
WORDS_IN = ("src", "docs", "examples", "bench", "scripts", "README.md", "CONTRIBUTING.md", "SECURITY.md")
NOT_PROSE = (
    "src/volery/calibration/timed_programs.py",
    "scripts/check_sources.py",
    "docs/design/glossary.md",
)
ALLOWED = (re.compile(r"interfaces?|surfaces?|type\s*faces?|typefaces?", re.IGNORECASE),)

VARIANTS = (
    "vehicles/drivers",
    "simulation/autopilots",
    "ros/client_libraries",
    "ros/transports",
    "calibration",
)
"""Packages whose sub-packages are variants of one thing (one per firmware, client library, ROS version): a
module is named with its sub-package there. Modules of `cli` are named after their command."""

PRESCRIBED = (
    "ros/client_libraries",
    "components/virtual_stdlib",
    "calibration/ros/probes",
    "calibration/timed_programs.py",
)
"""Where names of classes are those of a library that is stood in for, or programs that nothing imports."""

INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^">]+)[">]', re.MULTILINE)


def tracked(*below: str) -> list[Path]:
    """Return the files that git tracks below the given paths."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", *below],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return [path for name in listed.stdout.split("\0") if name and (path := ROOT / name).is_file()]


def circles() -> Iterator[str]:
    """Yield the circles of imports among modules, imports for type checking and inside functions included."""
    graph = grimp.build_graph("volery", cache_dir=None)
    imports = nx.DiGraph(
        (module, other)
        for module in graph.modules
        for other in graph.find_modules_directly_imported_by(module)
    )
    for circle in nx.strongly_connected_components(imports):
        if len(circle) > 1:
            yield f"import circle: {', '.join(sorted(circle))}"


def layers() -> dict[str, int]:
    """Return the layer of each top-level package: 0 is the lowest."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    ordered = next(each for each in contracts if each["containers"] == ["volery"])["layers"]
    return {
        name.strip(): height for height, names in enumerate(reversed(ordered)) for name in names.split("|")
    }


def upward_includes() -> Iterator[str]:
    """Yield C and C++ files that include a file of a higher layer."""
    height = layers()
    sources = [path for path in tracked("src") if path.suffix in {".h", ".hpp", ".cpp", ".c"}]
    by_tail = defaultdict(list)
    for path in sources:
        parts = path.parts
        for start in range(1, len(parts)):
            by_tail["/".join(parts[start:])].append(path)
    for path in sources:
        package = path.relative_to(PACKAGE).parts[0]
        for name in INCLUDE.findall(path.read_text(encoding="utf-8")):
            for included in by_tail.get(name, ()) if "/" in name else ():
                other = included.relative_to(PACKAGE).parts[0]
                if other != package and height[other] >= height[package]:
                    yield f"{path.relative_to(ROOT)}: includes {name} of the higher package {other}"


def file_names() -> Iterator[str]:
    """Yield modules that share a name although they are not parallel variants of one thing."""
    named = defaultdict(list)
    for path in tracked("src"):
        place = path.relative_to(PACKAGE).parent
        variant = place.parts[:1] == ("cli",) or any(str(each) in VARIANTS for each in place.parents)
        if path.suffix == ".py" and path.name != "__init__.py" and not variant:
            named[path.name].append(str(path.relative_to(PACKAGE)))
    for name, paths in sorted(named.items()):
        if len(paths) > 1:
            yield f"{name} names different things: {', '.join(sorted(paths))}"


def class_names() -> Iterator[str]:
    """Yield names that several classes share."""
    named = defaultdict(list)
    for path in tracked("src"):
        name = str(path.relative_to(PACKAGE))
        if path.suffix == ".py" and not name.startswith(PRESCRIBED):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ClassDef):
                    named[node.name].append(f"{name}:{node.lineno}")
    for name, places in sorted(named.items()):
        if len(places) > 1:
            yield f"class {name} has several meanings: {', '.join(places)}"


def words() -> Iterator[str]:
    """Yield lines with a word that the glossary replaces."""
    pattern = re.compile(rf"\b(?:{'|'.join(WORDS)})\b", re.IGNORECASE)
    for path in tracked(*WORDS_IN):
        name = str(path.relative_to(ROOT))
        if path.suffix not in PROSE or name.startswith(NOT_PROSE):
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if found := pattern.search(line):
                yield f"{name}:{number}: {found[0]!r} is not a term of the glossary"


def mirror() -> Iterator[str]:
    """Yield unit tests whose folder or name has no counterpart in src/volery."""
    unit = ROOT / "tests" / "unit"
    for path in tracked("tests/unit"):
        folder = path.parent.relative_to(unit)
        if folder.parts[:1] == ("examples",) or path.suffix != ".py":
            continue
        if not (PACKAGE / folder).is_dir():
            yield f"{path.relative_to(ROOT)}: there is no src/volery/{folder}"
        elif path.name.startswith("test_"):
            stem = path.stem.removeprefix("test_")
            names = {each.stem for each in (PACKAGE / folder).iterdir()} | {folder.name, "interface"}
            if not any(stem == each or stem.startswith(f"{each}_") for each in names):
                yield f"{path.relative_to(ROOT)}: src/volery/{folder} has no module that it is named after"


C_LIBRARY = re.compile(r"a?(sin|cos|tan)h?|atan2|cbrt|pow|exp\w*|log\w*")
"""Functions of ``math`` whose last bit depends on the processor."""
UNTRACED = (
    *(f"src/volery/{name}/" for name in ("analysis", "calibration", "explore", "report", "testing")),
    "src/volery/base/units.py",  # exact fractions
    "src/volery/control/digital_twin.py",  # these two judge recordings
    "src/volery/control/tuning.py",
    "src/volery/cost/native/",  # measures this machine
)
"""Files whose results are not part of a trace."""


def depends_on_processor(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and name of what the C library computes otherwise on another processor."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module == "math":
            yield from ((node.lineno, one.name) for one in node.names if C_LIBRARY.fullmatch(one.name))
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) == "math":
            if C_LIBRARY.fullmatch(node.attr):
                yield node.lineno, node.attr
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            whole = isinstance(node.left, ast.Constant) and isinstance(node.left.value, int)
            if not whole:
                yield node.lineno, "**"


def processor_independence() -> Iterator[str]:
    """Yield mathematics by the C library in modules whose results are part of a trace."""
    for path in tracked("src/volery"):
        name = str(path.relative_to(ROOT))
        if path.suffix == ".py" and not name.startswith(UNTRACED):
            for line, function in depends_on_processor(path.read_text(encoding="utf-8")):
                remedy = "write a product" if function == "**" else f"take {function} of base.elementary"
                yield f"{name}:{line}: {function} depends on the processor; {remedy}"


def main() -> int:
    """Print all offenders; return 1 if there are any."""
    offenders = [line for check in CHECKS for line in check()]
    print("\n".join(offenders) or "sources: no circles, no upward includes, no stray names or words")
    return 1 if offenders else 0


CHECKS = (circles, upward_includes, file_names, words, mirror, processor_independence)

if __name__ == "__main__":
    sys.exit(main())
