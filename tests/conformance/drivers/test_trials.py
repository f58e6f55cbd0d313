"""Every driver before its simulated autopilot: all checks, and one fault trial in four, as the docs show.

What changes on purpose is taken over with ``python scripts/gather_trials.py``.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from volery.testing import conformance
from volery.testing.fault_trials import FAULTS, PHASES, try_fault

AUTOPILOTS = ("ardupilot", "px4", "paparazzi", "dji")
REFERENCE = Path(__file__).parents[3] / "docs" / "reference" / "trials.json"
SHARE = 4
"""One trial in so many; which, differs by autopilot, so that all faults meet all phases."""


@pytest.fixture(scope="module")
def reference() -> Any:
    return json.loads(REFERENCE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_driver_conforms(autopilot: str, reference: Any) -> None:
    report = conformance(f"sim:{autopilot}")
    assert report.conforms, [(one.check, one.detail) for one in report.faults]
    found = {one.check: one.outcome.value for one in report.results}
    assert found == {one["check"]: one["outcome"] for one in reference[autopilot]["checks"]}


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_rover_conforms(autopilot: str) -> None:
    report = conformance(f"sim:{autopilot}?kind=rover", kind="rover")
    assert report.conforms, [(one.check, one.detail) for one in report.faults]


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_faults(autopilot: str, reference: Any) -> None:
    shown = {(one["fault"], one["phase"]): one for one in reference[autopilot]["faults"]}
    turn = AUTOPILOTS.index(autopilot)
    assert shown.keys() == {(fault, phase) for fault in FAULTS for phase in PHASES}
    assert not [one for one in shown.values() if one["broken"]]
    for row, fault in enumerate(FAULTS):
        for column, phase in enumerate(PHASES):
            if (row + column) % SHARE != turn:
                continue
            trial = try_fault(autopilot, fault, phase)
            assert not trial.broken, (fault, phase, trial.broken, trial.said)
            expected = shown[fault, phase]
            found = trial.caller, list(trial.aircraft)
            assert found == (expected["caller"], expected["aircraft"]), (fault, phase)


def test_a_landing_without_a_position_is_no_return_home() -> None:
    trial = try_fault("dji", "gps-lost", "return")
    assert (trial.caller, trial.broken) == ("PositionLost", "")
    assert trial.landing is not None
    assert trial.landing.away_m > 20.0
