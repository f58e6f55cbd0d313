"""Compile the modules of the event path, into a folder that is laid over the package.

The modules are those of ``[tool.volery-wheel]`` in pyproject.toml: ``compiled`` by mypyc, ``in-c`` from a
twin in C beside the Python file. They stay ordinary Python: where the shared libraries are beside them,
Python imports these instead, with the same results. ``make wheel`` runs this; ``pip install -e .`` does not.
Needs mypy, setuptools and a C compiler.

What mypyc compiles is a copy in which constants of modules are declared ``Final``: their values become part
of the code, or are read from C memory, where any other name of a module is looked up in a dictionary.

    python scripts/compile_modules.py --into FOLDER [--level 2] [--only-c]
"""

from __future__ import annotations

import argparse
import ast
import os
import re
import shutil
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from mypyc.build import mypycify
from setuptools import Distribution, Extension

ROOT = Path(__file__).resolve().parent.parent
MYPY_SETTINGS = """[mypy]
python_version = 3.11
ignore_missing_imports = True
follow_imports = silent
"""
"""As for ``make check``, but whatever is not installed where the wheel is built counts as ``Any``."""
FLAGS = "-g0 -ffp-contract=off"
"""Without debugging information; a product and a sum are two operations, as in Python. GCC fuses them on
AArch64 by default, and a fused operation rounds once."""

CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]+\Z")
"""Names that count as constants; a single letter is a type variable."""


def settings() -> dict[str, list[str]]:
    """Return the table of what is compiled: paths of modules in the package."""
    table: dict[str, list[str]] = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["volery-wheel"]
    return table


def with_final_constants(source: str) -> str:
    """Return a module's source with the constants that it assigns once declared ``Final``, line for line."""
    tree = ast.parse(source)
    stores = [
        node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    ]
    changing = {name for node in ast.walk(tree) if isinstance(node, ast.Global) for name in node.names}
    constants = {name for name in stores if CONSTANT.match(name) and stores.count(name) == 1} - changing
    lines = source.encode().splitlines(keepends=True)

    def replace(node: ast.AST, text: str) -> None:
        at: Any = node
        line, begin, end = lines[at.lineno - 1], at.col_offset, at.end_col_offset
        lines[at.lineno - 1] = line[:begin] + text.encode() + line[end:]

    for statement in tree.body:
        match statement:
            case ast.Assign(value=ast.Tuple(), targets=[ast.Name()]) | ast.AnnAssign(value=ast.Tuple()):
                pass  # see ``_check_statics``
            case ast.Assign(targets=[ast.Name(id=name) as target]) if name in constants:
                replace(target, f"{name}: _Final")
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
                if constants.issuperset(map(ast.unparse, names)) and statement.lineno == statement.end_lineno:
                    pairs = zip(map(ast.unparse, names), map(ast.unparse, values), strict=True)
                    replace(statement, "; ".join(f"{name}: _Final = {value}" for name, value in pairs))
            case ast.AnnAssign(target=ast.Name(id=name), annotation=kind, value=ast.expr()) if (
                name in constants
            ):
                if kind.lineno == kind.end_lineno and not ast.unparse(kind).startswith("Final"):
                    replace(kind, f"_Final[{ast.unparse(kind)}]")
    future = b"from __future__ import annotations"
    return b"".join(lines).replace(future, future + b"; from typing import Final as _Final", 1).decode()


def by_mypyc(scratch: Path, level: int) -> list[Extension]:
    """Return the modules of the current folder as mypyc translates them to C."""
    options = scratch / "mypy.ini"
    options.write_text(MYPY_SETTINGS)
    modules = [f"volery/{name}" for name in settings()["compiled"]]
    for module in map(Path, modules):
        module.write_text(with_final_constants(module.read_text()))
    extensions: list[Extension] = mypycify(
        ["--config-file", str(options), "--cache-dir", os.devnull, *modules],
        opt_level=str(level),
        group_name="volery",
        target_dir=str(scratch),
    )
    _check_statics(scratch)
    return extensions


def _check_statics(scratch: Path) -> None:
    """End where a constant is a tuple that begins with a float: mypyc takes it for one without a value."""
    declared = re.compile(r"extern tuple_T\d+F\w* CPyStatic_(\w+);")
    wrong = {name for header in scratch.glob("*.h") for name in declared.findall(header.read_text())}
    if wrong:
        sys.exit(f"mypyc cannot read these constants; declare them as tuple[float, ...]: {sorted(wrong)}")


def in_c(level: int) -> list[Extension]:
    """Return the modules that have a twin in C."""
    names = [f"volery/{name.removesuffix('.py')}" for name in settings()["in-c"]]
    return [
        Extension(name.replace("/", "."), [f"{name}.c"], extra_compile_args=[f"-O{level}"]) for name in names
    ]


def compile_into(folder: Path, level: int, *, only_c: bool) -> None:
    """Build the shared libraries in *folder*, as they lie beside the package's modules."""
    folder = folder.resolve()
    with tempfile.TemporaryDirectory() as scratch:
        os.environ["CFLAGS"] = f"{os.environ.get('CFLAGS', '')} {FLAGS}"
        os.chdir(shutil.copytree(ROOT / "src", Path(scratch, "src")))
        modules = in_c(level) + ([] if only_c else by_mypyc(Path(scratch), level))
        building = Distribution({"name": "volery", "ext_modules": modules}).get_command_obj("build_ext")
        building.build_lib, building.build_temp = str(folder), scratch
        building.ensure_finalized()
        building.run()


def main() -> None:
    """Compile all modules of the list."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--into", type=Path, required=True, help="where the shared libraries go")
    options.add_argument("--level", type=int, default=2, choices=range(4), help="of the C compiler")
    options.add_argument(
        "--only-c", action="store_true", help="only the twins in C: a second instead of minutes"
    )
    given = options.parse_args()
    compile_into(given.into, given.level, only_c=given.only_c)


if __name__ == "__main__":
    main()
