"""``examples/landing``: a drone lands on the marker that its camera sees; without one it comes home."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery import Options, simulate
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

EXAMPLE = Path(__file__).parents[3] / "examples" / "landing"

pytestmark = pytest.mark.integration


def test_it_lands_on_the_marker_and_the_same_seed_does_so_again():
    offsets = [
        simulate(EXAMPLE, Options(seed=3, record="summary")).observables["drone.landing_offset"]
        for _ in range(2)
    ]
    assert offsets[0] < 0.25
    assert offsets[0] == offsets[1]


def test_without_a_marker_it_comes_home_and_says_why():
    system = load(EXAMPLE, vocabulary(), scenario="away")
    run = simulate(system, Options(record="summary"))
    assert "no marker was seen within 10 s" in str(run.error)
    assert run.observables["drone.landing_offset"] < 2.0, "of home"
