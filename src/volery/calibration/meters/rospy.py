"""Run a node's script after recording the CPU time of Python's start and of the imports.

A program of its own: ``rospy.py SCRIPT ARGUMENT..``. It imports the ROS and standard library modules
that the script imports, since their import does not belong to the cost of the node.
"""

from __future__ import annotations

import ast
import os
import runpy
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path


def imported(source: str) -> Iterator[str]:
    """Yield the modules of ROS and of the standard library that a script imports."""
    for node in ast.walk(ast.parse(source)):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module]
        for name in names:
            first = name.partition(".")[0]
            if first == "rospy" or name.endswith((".msg", ".srv")) or first in sys.stdlib_module_names:
                yield name


def main(script: str, *arguments: str) -> None:
    """Import the modules, record the clocks and run the script."""
    sys.path[0] = str(Path(script).parent)
    for name in imported(Path(script).read_text(encoding="utf-8")):
        with suppress(ImportError):  # the script itself reports it
            import_module(name)
    sys.argv = [script, *arguments]
    noted = f"{time.monotonic_ns()} {time.process_time_ns()}\n"
    Path(os.environ["VOLERY_METER"]).write_text(noted, encoding="ascii")
    runpy.run_path(script, run_name="__main__")


if __name__ == "__main__":
    main(*sys.argv[1:])
