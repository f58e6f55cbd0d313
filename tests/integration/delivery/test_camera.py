"""The delivery service whose drones land on markers that their own cameras see."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery import Options, simulate

pytestmark = pytest.mark.integration

DELIVERY = Path(__file__).parents[3] / "examples" / "delivery"


def test_a_drone_lands_on_the_marker_of_its_pad_and_pays_for_its_pictures():
    run = simulate(DELIVERY, Options(seed=7, record="summary"), scenario="camera")
    assert run.error is None
    assert run.observables["drone_1.landing_offset"] < 0.25
    unmet = {name for name, one in run.record.requirements.items() if not one.met}
    assert not unmet, "landing_in_time_1 among them: a picture each 100 ms"
    landing = run.record.components["landing_1"]
    assert landing.cpu_s - landing.ros_cpu_s > 1.0, "pictures of ten seconds, each of some 27 ms"
    assert 0.015 < landing.response_s.p95 < 0.055, "a picture, and faster than the paper's"
    assert run.record.components["landing_2"].cpu_s < 0.1, "its drone stays on the ground"
