"""``examples/landing``: a drone lands on the marker that its camera sees; without one it comes home."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery import Options, simulate
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

EXAMPLE = Path(__file__).parents[3] / "examples" / "landing"

SMALL = (
    "environment.vehicles.drone.added_sensors="
    "[{camera: {pitch: 90 deg, width: 320, height: 240, field: 60 deg}}]"
)
"""A camera whose pictures take little time."""

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


@pytest.mark.parametrize(
    ("kind", "at", "said"),
    [
        ("camera-black", 22, "the marker was lost"),
        ("sensor-stuck", 20, "the pictures stay the same"),
    ],
)
@pytest.mark.long
def test_with_a_camera_that_breaks_in_the_descent_it_comes_home_and_says_why(kind, at, said):
    broken = f"environment.faults={{eye: {{kind: {kind}, vehicle: drone, sensor: camera, at: {at} s}}}}"
    run = simulate(load(EXAMPLE, vocabulary(), overrides=[broken, SMALL]), Options(seed=3, record="summary"))
    assert said in str(run.error)
    assert run.observables["drone.landing_offset"] < 2.0, "of home"
