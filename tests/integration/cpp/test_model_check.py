"""``volery model check`` compiles C++ components: faults are found before a run, with file and line."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from volery.cli.main import application

pytestmark = pytest.mark.integration

MODEL = """
volery: 1
name: checks
interfaces:
  Routes:
    length: {args: {posts: int}, returns: float}
components:
  Right: {language: c++, path: right.cpp, provides: {routes: Routes}}
  NoOperation: {language: c++, path: no_operation.cpp, provides: {routes: Routes}}
  NoRun: {language: c++, path: no_run.cpp, active: {}}
  NotHere: {language: c++, path: other.cpp}
  Broken: {language: c++, path: broken.cpp}
  WrongPort: {language: c++, path: wrong_port.cpp, requires: {drone: Drone}}
application:
  right: {is: Right}
  no_operation: {is: NoOperation}
  no_run: {is: NoRun}
  not_here: {is: NotHere}
  broken: {is: Broken}
  wrong_port: {is: WrongPort, drone: drone_1}
platform:
  processors: {pc: {is: rpi4-cortex-a72, frequency: 1500 MHz}}
allocations:
  all: {right: pc, no_operation: pc, no_run: pc, not_here: pc, broken: pc, wrong_port: pc, drone_1: pc}
environment:
  places: {pad: {east: 0 m, north: 0 m}}
  vehicles: {drone_1: {kind: multirotor, autopilot: ardupilot, at: pad}}
run: {duration: 1 s}
"""
FILES = {
    "right.cpp": "class Right {\npublic:\n    double length(int posts) { return posts; }\n};\n",
    "no_operation.cpp": "// no\nclass NoOperation {\npublic:\n    int width(int at) { return at; }\n};\n",
    "no_run.cpp": "struct NoRun {};\n",
    "other.cpp": "struct Here {};\n",
    "broken.cpp": "struct Broken {\n    int x = nothing;\n};\n",
    "wrong_port.cpp": "struct WrongPort {\n    explicit WrongPort(int) {}\n};\n",
}
EXPECTED = (
    "no_operation.cpp:2: NoOperation: has no member function 'length', an operation",
    "no_run.cpp:1: NoRun: has no member function 'run', which an active component needs",
    "no class 'NotHere' in other.cpp",
    "broken.cpp:2:",
    "wrong_port.cpp:1: WrongPort: does not fit the ports and operations of the model",
)


def test_everything_that_does_not_fit_is_found_at_once(tmp_path: Path) -> None:
    (tmp_path / "model.yaml").write_text(MODEL, encoding="utf-8")
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    done = CliRunner().invoke(application(), ["model", "check", str(tmp_path)])
    said = " ".join(done.output.split())
    assert done.exit_code == 2, said
    assert "Right:" not in said
    for part in EXPECTED:
        assert part in said, (part, done.output)
