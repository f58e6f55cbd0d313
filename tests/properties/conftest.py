"""The modules that have a twin in C, compiled as in a wheel."""

import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts/compile_modules.py"


@pytest.fixture(scope="session")
def twins_in_c(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ModuleType]:
    """Return the compiled modules by name, beside those in Python, which stay imported."""
    folder = tmp_path_factory.mktemp("compiled")
    subprocess.run([sys.executable, SCRIPT, "--into", folder, "--only-c"], check=True, capture_output=True)
    modules = {}
    for library in folder.rglob("*.so"):
        name = library.name.partition(".")[0]
        spec = spec_from_file_location(f"volery.{library.parent.name}.{name}", library)
        assert spec is not None
        assert spec.loader is not None
        modules[name] = module_from_spec(spec)
        spec.loader.exec_module(modules[name])
    return modules
