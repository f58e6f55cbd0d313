"""Expressions with messages, times and durations have the same values with our client libraries."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from rigs.requirements import lacking
from volery.ros.messages import definition
from volery.ros.transports.ros1 import available
from volery.run.result import Options
from volery.run.simulate import simulate

from .conftest import HERE, LIMIT_S, python_of, surroundings

pytestmark = pytest.mark.integration

FILES = HERE / "ros_files" / "values"
MODEL = """
volery: 1
name: values
files_from: {folder}
components: {{Values: {{language: {library}, path: {folder}/values.py, active: true}}}}
application: {{values: {{is: Values, arguments: [{library}, {folder}/{library}.txt]}}}}
platform: {{processors: {{pc: {{is: intel-i5-3470, frequency: 3000 MHz}}}}}}
allocations: {{only: {{values: pc}}}}
run: {{duration: 1 s}}
"""


def of_output(text: str) -> list[str]:
    [line] = [one for one in text.splitlines() if one.startswith("VALUES ")]
    return list(json.loads(line.removeprefix("VALUES ")))


@pytest.mark.parametrize("library", ["rclpy", "rospy"])
def test_the_same_values(library: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    python = python_of("jazzy") if library == "rclpy" else sys.executable
    if library == "rospy" and not available():
        lacking("no rospy here (scripts/debian-packages ros1, scripts/ros1-modules)")
    program = [python, str(FILES / "values.py"), library, str(FILES / f"{library}.txt")]
    done = subprocess.run(
        program, env=surroundings(), capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    assert done.returncode == 0, done.stderr
    model = tmp_path / "model.yaml"
    model.write_text(MODEL.format(folder=FILES, library=library), encoding="utf-8")
    capfd.readouterr()
    simulate(model, Options(out=tmp_path / "run"))
    ours = of_output("".join(capfd.readouterr()))
    expressions = [one for one in (FILES / f"{library}.txt").read_text(encoding="utf-8").splitlines() if one]
    pairs = zip(expressions, of_output(done.stdout), ours, strict=True)
    differ = [f"{one}\n  real {real}\n  ours {our}" for one, real, our in pairs if real != our]
    assert not differ, "\n".join(differ)


FIELDS = """
import importlib, json, pathlib, sys
found = {}
for folder in pathlib.Path(sys.argv[1]).glob("*/msg"):
    module = importlib.import_module(f"{folder.parent.name}.msg")
    for name, cls in vars(module).items():
        if hasattr(cls, "get_fields_and_field_types") and folder.parent.name != "rosidl_adapter":
            found[f"{folder.parent.name}/msg/{name}"] = list(cls.get_fields_and_field_types())
print(json.dumps(found))
"""


def test_every_message_of_the_distribution_is_there_with_its_fields() -> None:
    python = python_of("jazzy")
    packages = Path(python).parents[1] / f"lib/python{sys.version_info.major}.{sys.version_info.minor}"
    done = subprocess.run(
        [python, "-c", FIELDS, str(packages / "site-packages")],
        env=surroundings(),
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=True,
    )
    theirs: dict[str, list[str]] = json.loads(done.stdout)
    assert len(theirs) > 100
    for name, fields in theirs.items():
        lines = definition(name).partition("\n===")[0].splitlines()
        ours = [line.split()[1] for line in lines if re.match(r"[^#=]+ [^#=]+$", line.replace("<=", ""))]
        assert ours == fields, name
