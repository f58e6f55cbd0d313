"""Hook of the wheel build: carries the machine code of ``compile_numerics.py``.

``pip install -e .`` and a plain ``pip install .`` need no compiler: without machine code a wheel is pure
Python and numba compiles at the first use. With ``VOLERY_COMPILE=1`` the wheel is one for this architecture;
the machine code calls nothing of Python, so that all versions share it.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

OBJECT_CODE = "src/volery/base/object_code"


def _wanted() -> bool:
    return os.environ.get("VOLERY_COMPILE", "") not in ("", "0")


class MachineCodeHook(BuildHookInterface[Any]):
    """Adds the machine code and the architecture to a wheel."""

    def dependencies(self) -> list[str]:
        """Return what the compilation imports."""
        if not _wanted():
            return []
        core = self.metadata.core
        extras = ("simulation", "model", "ros", "autonomy")
        needed = [*core.dependencies, *(one for extra in extras for one in core.optional_dependencies[extra])]
        return [one for one in needed if not one.startswith("volery[")]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile if wanted; state the architecture then."""
        if version == "editable" or not _wanted():
            return
        root = Path(self.root)
        subprocess.run([sys.executable, str(root / "scripts/compile_numerics.py")], check=True)
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{re.sub('[-.]', '_', sysconfig.get_platform())}"
        for file in (root / OBJECT_CODE).glob("*.so"):
            build_data["force_include"][str(file)] = f"volery/base/object_code/{file.name}"
