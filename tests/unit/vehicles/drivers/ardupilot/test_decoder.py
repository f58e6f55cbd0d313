"""What the driver makes of telemetry as ArduPilot 4.5.6 sent it: extracts of recorded flights."""

from __future__ import annotations

import pytest

from rigs.recorded import Recorded
from volery.vehicles.drivers.ardupilot.decoder import ArduPilotDecoder

RECORDED = Recorded("ardupilot_telemetry", ArduPilotDecoder)
replayed, changes = RECORDED.replayed, RECORDED.changes


def test_a_guided_flight() -> None:
    assert changes("arducopter-guided-flight", "mode", "armed", "flying") == [
        ("", False, False),
        ("STABILIZE", False, False),
        ("GUIDED", False, False),
        ("GUIDED", True, False),
        ("GUIDED", True, True),
        ("LAND", True, True),
        ("LAND", True, False),
        ("LAND", False, False),
    ]


def test_it_is_ready_only_once_it_has_a_position() -> None:
    ready = next(at for at, seen in replayed("arducopter-guided-flight") if seen.ready)
    armable = next(at for at, seen in replayed("arducopter-guided-flight") if seen.armable)
    assert 22 < armable < 24
    assert 41 < ready < 44  # the first position after the estimator has one


def test_zeros_before_there_is_a_position_are_no_position() -> None:
    for _, seen in replayed("arducopter-guided-flight"):
        assert seen.position is None or seen.position.latitude == pytest.approx(-35.36, abs=0.01)
    assert seen.home is not None
    assert seen.home.altitude.metres == pytest.approx(584.05)


def test_a_rover_has_no_altitude_before_its_estimator_has_one() -> None:
    altitudes = [seen.position.altitude.metres for _, seen in replayed("ardurover-drive") if seen.position]
    assert max(altitudes) - min(altitudes) < 2.0  # it sends 0, then 584


def test_a_failsafe_of_the_ground_station() -> None:
    states = changes("arducopter-gcs-failsafe", "mode", "failsafe")
    assert ("RTL", True) in states
    assert states.index(("RTL", True)) < states.index(("RTL", False))
    *_, (_, seen) = replayed("arducopter-gcs-failsafe")
    assert "GCS Failsafe" in [said.text for said in seen.texts]


def test_a_rover() -> None:
    modes = changes("ardurover-drive", "kind", "mode", "armed", "flying")
    driving = [state for state in modes if state[2]]
    assert driving[0] == ("rover", "MANUAL", True, True)
    assert driving[-1] == ("rover", "HOLD", True, False)
    assert {"GUIDED", "RTL"} <= {mode for _, mode, _, _ in driving}
