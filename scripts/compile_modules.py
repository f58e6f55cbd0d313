"""Compile the modules of the event path with mypyc, into a folder that is laid over the package.

The modules are those of ``[tool.volery-wheel] compiled`` in pyproject.toml. They stay ordinary Python: where
the shared libraries are beside them, Python imports these instead, with the same results. ``make wheel``
runs this; ``pip install -e .`` does not. Needs mypy, setuptools and a C compiler.

    python scripts/compile_modules.py --into FOLDER [--level 2]
"""

from __future__ import annotations

import argparse
import os
import tempfile
import tomllib
from pathlib import Path

from mypyc.build import mypycify
from setuptools import Distribution

ROOT = Path(__file__).resolve().parent.parent
MYPY_SETTINGS = """[mypy]
python_version = 3.11
ignore_missing_imports = True
follow_imports = silent
"""
"""As for ``make check``, but whatever is not installed where the wheel is built counts as ``Any``."""


def compiled_modules() -> list[str]:
    """Return the paths of the modules that are compiled, relative to src/."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    return [f"volery/{name}" for name in settings["tool"]["volery-wheel"]["compiled"]]


def compile_into(folder: Path, level: int) -> None:
    """Build the shared libraries in *folder*, as they lie beside the package's modules."""
    folder = folder.resolve()
    with tempfile.TemporaryDirectory() as scratch:
        settings = Path(scratch) / "mypy.ini"
        settings.write_text(MYPY_SETTINGS)
        os.environ["CFLAGS"] = f"{os.environ.get('CFLAGS', '')} -g0"
        os.chdir(ROOT / "src")
        modules = mypycify(
            ["--config-file", str(settings), "--cache-dir", os.devnull, *compiled_modules()],
            opt_level=str(level),
            group_name="volery",
            target_dir=scratch,
        )
        building = Distribution({"name": "volery", "ext_modules": modules}).get_command_obj("build_ext")
        building.build_lib, building.build_temp = str(folder), scratch
        building.ensure_finalized()
        building.run()


def main() -> None:
    """Compile all modules of the list."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--into", type=Path, required=True, help="where the shared libraries go")
    options.add_argument("--level", type=int, default=2, choices=range(4), help="of the C compiler")
    given = options.parse_args()
    compile_into(given.into, given.level)


if __name__ == "__main__":
    main()
