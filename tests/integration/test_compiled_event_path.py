"""The event path compiled by mypyc and as plain Python: the same bytes from the same runs."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.integration, pytest.mark.long, pytest.mark.timeout(3600)]
ROOT = Path(__file__).parents[2]
RUNS = (
    ("simulate", "examples/starter", "--seed", "3"),
    *(
        ("fly", "examples/mission.py", "--on", f"sim:{autopilot}", "--seed", "3")
        for autopilot in ("ardupilot", "px4", "paparazzi", "dji")
    ),
)
COMMAND = "from volery.cli.main import main; main()"
MODULES = (
    "kernel.virtual",
    "requirements.ledgers",
    "trace.chunk",
    "trace.spans",
    "cost.ticks",
)
WHICH = f"from importlib import import_module as i; print(*(i('volery.' + m).__file__ for m in {MODULES}))"


def run(package: Path, *arguments: str, accepted: tuple[int, ...] = (0,)) -> str:
    """Run a Python of which *package* is the folder of volery; return what it prints."""
    surroundings = {**os.environ, "PYTHONPATH": str(package)}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env=surroundings, check=False, capture_output=True, text=True
    )
    assert done.returncode in accepted, done.stderr
    return done.stdout


def test_compiled_and_plain_modules_give_the_same_traces(tmp_path: Path) -> None:
    plain, compiled = ROOT / "src", tmp_path / "compiled"
    scripts = ROOT / "scripts"
    run(plain, str(scripts / "compile_numerics.py"))  # otherwise numba compiles in each of the two folders
    shutil.copytree(plain / "volery", compiled / "volery")
    run(plain, str(scripts / "compile_modules.py"), "--into", str(compiled), "--level", "0")
    assert run(plain, "-c", WHICH).count("/virtual.py") == 1
    assert all(one.endswith(".so") for one in run(compiled, "-c", WHICH).split())
    for number, arguments in enumerate(RUNS):
        files = []
        for name, package in (("plain", plain), ("compiled", compiled)):
            folder = tmp_path / f"{name}-{number}"
            options = ("--quiet", "--out", str(folder))
            run(package, "-c", COMMAND, *arguments, *options, accepted=(0, 1))  # 1: a requirement is not met
            files.append([(folder / file).read_bytes() for file in ("trace.mcap", "timeline.json")])
        assert files[0] == files[1]
