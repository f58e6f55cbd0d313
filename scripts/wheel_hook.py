"""Hook of the wheel build: carries the object code of ``compile_numerics.py``, compiled now on demand.

``pip install -e .`` and a plain ``pip install .`` need no compiler: without object code a wheel is pure
Python and numba compiles at the first use. With ``VOLERY_COMPILE=1`` the wheel is one for this architecture.
"""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

OBJECT_CODE = "src/volery/base/object_code"


def _wanted() -> bool:
    return os.environ.get("VOLERY_COMPILE", "") not in ("", "0")


class ObjectCodeHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds the object code and the architecture to a wheel."""

    def dependencies(self) -> list[str]:
        """Return what the compilation imports."""
        if not _wanted():
            return []
        core = self.metadata.core
        return [*core.dependencies, *core.optional_dependencies["model"], "numba>=0.60"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile if wanted; state the architecture if there is object code."""
        if version == "editable" or not _wanted():
            return
        root = Path(self.root)
        subprocess.run([sys.executable, str(root / "scripts/compile_numerics.py")], check=True)
        machine = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{machine}"
        for file in (root / OBJECT_CODE).glob("*.so"):
            build_data["force_include"][str(file)] = f"volery/base/object_code/{file.name}"
