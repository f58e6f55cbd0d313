"""Compile the modules of the event path, into a folder that is laid over the package.

The modules are those of ``[tool.volery-wheel]`` in pyproject.toml: ``compiled`` by mypyc, ``in-c`` from a
twin in C beside the Python file. They stay ordinary Python: where the shared libraries are beside them,
Python imports these instead, with the same results. ``make wheel`` runs this; ``pip install -e .`` does not.
Needs mypy, setuptools and a C compiler.

    python scripts/compile_modules.py --into FOLDER [--level 2] [--only-c]
"""

from __future__ import annotations

import argparse
import os
import tempfile
import tomllib
from pathlib import Path

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


def settings() -> dict[str, list[str]]:
    """Return the table of what is compiled: paths of modules in the package."""
    table: dict[str, list[str]] = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["volery-wheel"]
    return table


def by_mypyc(scratch: Path, level: int) -> list[Extension]:
    """Return the modules as mypyc translates them to C."""
    options = scratch / "mypy.ini"
    options.write_text(MYPY_SETTINGS)
    modules = [f"volery/{name}" for name in settings()["compiled"]]
    return mypycify(
        ["--config-file", str(options), "--cache-dir", os.devnull, *modules],
        opt_level=str(level),
        group_name="volery",
        target_dir=str(scratch),
    )


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
        os.chdir(ROOT / "src")
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
