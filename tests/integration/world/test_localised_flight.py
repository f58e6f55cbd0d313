"""``examples/mapping/localised.yaml``: a drone without satellites finds itself in a map, and flies by it."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery import Options, simulate

MODEL = Path(__file__).parents[3] / "examples" / "mapping" / "localised.yaml"

pytestmark = pytest.mark.integration


@pytest.mark.parametrize("scenario", ["", pytest.param("px4", marks=pytest.mark.long)])
def test_it_comes_back(scenario: str, tmp_path: Path) -> None:
    run = simulate(MODEL, Options(out=tmp_path / "run"), scenario=scenario or None)
    assert run.ok, run.error or run.verdicts
