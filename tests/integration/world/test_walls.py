"""Buildings are solid: ``examples/walls`` in virtual time, as it is and with its way round."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery import Options, simulate
from volery.trace.events import Collision, VehicleState
from volery.trace.reader import OpenTrace

EXAMPLE = Path(__file__).parents[3] / "examples" / "walls"

pytestmark = pytest.mark.integration


def test_a_drone_and_a_rover_hit_what_stands_in_their_way_and_one_passes_under_the_bridge(tmp_path, capfd):
    run = simulate(EXAMPLE, Options(out=tmp_path / "run"))
    assert run.record.outcome.status == "failed"
    assert "rover_1 hit shed at" in run.record.outcome.reason
    assert [(one.who, one.what.split(" at ")[0]) for one in run.record.failures][:2] == [
        ("rover_1", "hit shed"),
        ("drone_1", "hit tower"),
    ]
    verdicts = {name: verdict.observed for name, verdict in run.record.requirements.items()}
    assert verdicts == {"flies_free": 1.0, "passes_under": 0.0, "drives_free": 1.0}
    with OpenTrace(tmp_path / "run" / "trace.mcap") as reading:
        events = list(reading.events({Collision, VehicleState}))
    hit = next(one for one in events if isinstance(one, Collision) and one.vehicle == "drone_1")
    assert hit.solid == "tower"
    assert hit.x == pytest.approx(20.0, abs=0.6)
    last = {one.vehicle: one for one in events if isinstance(one, VehicleState)}
    assert last["drone_1"].x < 20.0
    assert last["drone_1"].z < 0.5
    assert not last["drone_1"].armed
    assert last["rover_1"].x == pytest.approx(19.7, abs=0.1)
    assert last["drone_2"].x == pytest.approx(40.0, abs=2.0)
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "drone_1: hit tower at" in page


def test_the_same_services_arrive_by_the_way_round(tmp_path):
    run = simulate(EXAMPLE, Options(out=tmp_path / "run", record="summary"), scenario="round")
    assert run.ok, run.record.outcome.reason
