"""Hook of the wheel build: carries the machine code of ``compile_numerics.py`` and ``compile_modules.py``.

``pip install -e .`` and a plain ``pip install .`` need no compiler: without machine code a wheel is pure
Python and numba compiles at the first use. With ``VOLERY_COMPILE=1`` the wheel is one for this architecture
and this version of Python.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

OBJECT_CODE = "src/volery/base/object_code"


def _wanted() -> bool:
    return os.environ.get("VOLERY_COMPILE", "") not in ("", "0")


class MachineCodeHook(BuildHookInterface[Any]):
    """Adds the machine code and the architecture to a wheel."""

    _modules: tempfile.TemporaryDirectory[str] | None = None

    def dependencies(self) -> list[str]:
        """Return what the compilation imports."""
        if not _wanted():
            return []
        core = self.metadata.core
        return [
            *core.dependencies,
            *core.optional_dependencies["model"],
            "numba>=0.60",
            "mypy>=1.18",
            "setuptools",
        ]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile if wanted; state the architecture and the version of Python then."""
        if version == "editable" or not _wanted():
            return
        root = Path(self.root)
        self._modules = tempfile.TemporaryDirectory()
        compiled = Path(self._modules.name)
        for script, *options in (("compile_numerics.py",), ("compile_modules.py", "--into", str(compiled))):
            subprocess.run([sys.executable, str(root / "scripts" / script), *options], check=True)
        build_data["pure_python"] = False
        build_data["infer_tag"] = True
        for file in (root / OBJECT_CODE).glob("*.so"):
            build_data["force_include"][str(file)] = f"volery/base/object_code/{file.name}"
        for file in compiled.rglob("*.so"):
            build_data["force_include"][str(file)] = str(file.relative_to(compiled))

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what was compiled for the wheel."""
        if self._modules is not None:
            self._modules.cleanup()
