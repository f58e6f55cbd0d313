"""Faults that a scenario injects, on the starter model."""

from pathlib import Path

import pytest

import volery
from volery.base.errors import Failsafe, ModelError

STARTER = Path(__file__).parents[3] / "examples" / "starter"


def fly_with(fault: str, **more: str) -> volery.Run:
    entries = ", ".join(
        f"{key}: {value}" for key, value in {"kind": fault, "vehicle": "drone_1", **more}.items()
    )
    return volery.simulate(STARTER, overrides=[f"environment.faults.trouble={{{entries}}}"])


def test_without_satellites_the_autopilot_lands_and_the_mission_fails():
    run = fly_with("gps-lost", at="30 s")
    assert isinstance(run.error, Failsafe)
    assert "EKF Failsafe" in str(run.error)
    assert run.record.vehicles["drone_1"].landed


def test_a_short_loss_of_satellites_is_flown_through():
    run = fly_with("gps-lost", at="30 s", duration="3 s")
    assert run.completed
    assert run.record.outcome.requirements_met


def test_an_unknown_kind_of_fault_is_refused_with_the_known_ones():
    with pytest.raises(ModelError, match="gps-lost"):
        fly_with("gps-gone", at="30 s")
