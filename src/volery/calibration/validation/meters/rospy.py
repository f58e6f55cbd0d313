"""Runs a node's script, and notes before that the CPU time that Python and the imports have taken.

A program of its own: ``rospy.py SCRIPT ARGUMENT..``. It imports what the script will import of ROS and of the
standard library, since that is no part of what the node does.
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
    """The modules of ROS and of the standard library that a script names."""
    for node in ast.walk(ast.parse(source)):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module]
        for name in names:
            first = name.partition(".")[0]
            if first == "rospy" or name.endswith((".msg", ".srv")) or first in sys.stdlib_module_names:
                yield name


def main(script: str, *arguments: str) -> None:
    """Import, note, run."""
    sys.path[0] = str(Path(script).parent)
    for name in imported(Path(script).read_text(encoding="utf-8")):
        with suppress(ImportError):  # the script itself is to say so
            import_module(name)
    sys.argv = [script, *arguments]
    noted = f"{time.monotonic_ns()} {time.process_time_ns()}\n"
    Path(os.environ["VOLERY_METER"]).write_text(noted, encoding="ascii")
    runpy.run_path(script, run_name="__main__")


if __name__ == "__main__":
    main(*sys.argv[1:])
