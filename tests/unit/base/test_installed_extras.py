"""Optional dependencies: what works without them, and the error when one is missing."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from volery.base import installed
from volery.base.errors import UsageError
from volery.base.installed import EXTRAS, MissingExtraError, missing_extra, require_extra

PROJECT = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_a_missing_extra_names_the_command_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installed, "EXTRAS", {"flying": ("no_such_module", "no.such_module", "sys")})
    with pytest.raises(MissingExtraError, match=r'pip install "volery\[flying\]"') as caught:
        require_extra("flying", "wings")
    assert str(caught.value).startswith("wings: no_such_module and no.such_module are not installed")
    assert isinstance(caught.value, UsageError)


def test_extras_that_are_installed_raise_nothing() -> None:
    for extra in EXTRAS:
        require_extra(extra, "a test")


@pytest.mark.parametrize(
    ("module", "extra"),
    [("numba", "simulation"), ("rosbags.rosbag1", "ros"), ("ruamel", "model"), ("x", None)],
)
def test_a_failed_import_is_traced_to_its_extra(module: str, extra: str | None) -> None:
    found = missing_extra(ModuleNotFoundError(module, name=module))
    assert (found.extra if found else None) == extra


def test_every_extra_is_declared_by_the_package() -> None:
    declared = PROJECT["optional-dependencies"]
    assert set(EXTRAS) == set(declared) - {"all"}
    for extra, modules in EXTRAS.items():
        listed = " ".join(declared[extra])
        assert all({"cv2": "opencv"}.get(module, module) in listed for module in modules)


@pytest.mark.parametrize(
    "module", ["volery.run.fly", "volery.run.connect", "volery.vehicles.drivers.ardupilot"]
)
def test_flying_a_real_vehicle_needs_no_extra(module: str) -> None:
    optional = sorted({name.partition(".")[0] for names in EXTRAS.values() for name in names} - {"lz4"})
    script = f"import sys, {module}; print([name for name in {optional} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"  # lz4 comes with mcap, which the core needs
