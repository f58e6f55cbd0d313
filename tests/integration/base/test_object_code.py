"""The object code of a wheel: a mission gives the same trace from it and from numba, byte for byte."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import volery
from volery.base import numeric_code

pytestmark = pytest.mark.integration
ROOT = Path(__file__).parents[3]


def test_a_mission_gives_the_same_trace_from_object_code_and_from_numba(tmp_path, monkeypatch):
    subprocess.run([sys.executable, str(ROOT / "scripts/compile_numerics.py")], check=True)
    traces = []
    for name, folder in (("shipped", numeric_code.OBJECT_CODE), ("numba", tmp_path / "none")):
        monkeypatch.setattr(numeric_code, "OBJECT_CODE", folder)
        options = volery.Options(seed=3, out=tmp_path / name)
        assert volery.fly(ROOT / "examples/mission.py", "sim:ardupilot", options).completed
        traces.append((tmp_path / name / "trace.mcap").read_bytes())
    assert traces[0] == traces[1]
