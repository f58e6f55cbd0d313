"""The two programs of ``examples/cpp`` fly the same mission."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.run.result import Options
from volery.run.simulate import simulate

pytestmark = pytest.mark.integration

EXAMPLE = Path(__file__).parents[3] / "examples" / "cpp"


def test_the_same_mission_twice(tmp_path):
    together = ["application.by_hand.active.start=0 s", "run.duration=100 s"]
    run = simulate(EXAMPLE, Options("times", out=tmp_path), overrides=together)
    assert run.ok, run.record.outcome
    one, other = (run.record.vehicles[name] for name in ("drone_1", "drone_2"))
    assert one.landed
    assert other.landed
    assert one.distance_m == pytest.approx(other.distance_m, abs=10.0)
    assert one.distance_m > 200.0
    for name in ("few_calls", "by_hand"):
        cost = run.record.components[name]
        assert 0.0 < cost.ros_cpu_s < cost.cpu_s, "ROS takes a part of it, and the report can say which"
        assert cost.ros_calls["publish"] > 0


def test_a_vehicle_commanded_by_messages_is_landed_at_the_end(tmp_path):
    early = ["application.by_hand.active.start=0 s", "run.duration=10 s"]
    run = simulate(EXAMPLE, Options("times", out=tmp_path), overrides=early)
    assert run.completed
    vehicle = run.record.vehicles["drone_2"]
    assert vehicle.airborne_s > 0.0
    assert vehicle.landed
