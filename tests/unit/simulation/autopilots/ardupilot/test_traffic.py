"""Other aircraft: which are a threat, what the copter does, and how it goes on afterwards."""

from __future__ import annotations

from typing import Any

import pytest

pytestmark = pytest.mark.optional

ARM, TAKEOFF, MODE = 400, 22, 176
AVOIDING = {"AVD_ENABLE": 1, "ADSB_TYPE": 1, "AVD_F_ACTION": 2, "ARMING_CHECK": 1}
GUIDED, LOITER, RTL, AVOID_ADSB = 4, 5, 6, 19
HIGH = 2


@pytest.fixture
def avoiding(station: Any) -> Any:
    """Makes a copter that avoids other aircraft."""

    def made(**parameters: float) -> Any:
        rig = station(parameters={**AVOIDING, **parameters})
        rig.run(0.5)
        return rig

    return made


def report(rig: Any, above: float, north: float = 0.0, **fields: Any) -> None:
    """Report an aircraft above the home position [m], and wait for the next tick."""
    given = {"heading": 0, "hor_velocity": 0, "ver_velocity": 0, "tslc": 1, "flags": 0xFFFF, **fields}
    place = {"lat": round((46.0 + north / 111_200.0) * 1e7), "lon": round(7.0 * 1e7)}
    height = {"altitude_type": 0, "altitude": round((500.0 + above) * 1000)}
    blank = {"callsign": "bob", "emitter_type": 1, "squawk": 17}
    rig.send("ADSB_VEHICLE", **{"ICAO_address": 37, **place, **height, **blank, **given})
    rig.run(0.2)


def flying(rig: Any) -> Any:
    """Take off to 20 m in GUIDED."""
    rig.command(MODE, 1.0, GUIDED)
    assert rig.command(ARM, 1.0) == 0
    rig.command(TAKEOFF, param7=20.0)
    rig.run(20.0)
    return rig


def mode(rig: Any) -> int:
    return int(rig.latest["HEARTBEAT"]["custom_mode"])


def test_arming_is_refused_beside_another_aircraft_until_it_is_not_reported_any_more(avoiding: Any) -> None:
    rig = avoiding()
    report(rig, 10.0)
    rig.command(MODE, 1.0, GUIDED)
    assert rig.command(ARM, 1.0) == 4
    assert "Arm: ADSB threat detected" in rig.texts()
    rig.run(8.0)
    assert rig.command(ARM, 1.0) == 0


def test_below_the_least_height_other_aircraft_are_reported_only(avoiding: Any) -> None:
    rig = avoiding(AVD_F_ALT_MIN=516)
    report(rig, 10.0)
    rig.command(MODE, 1.0, GUIDED)
    assert rig.command(ARM, 1.0) == 0
    assert rig.latest["COLLISION"]["threat_level"] == HIGH


@pytest.mark.parametrize(
    "fields",
    [{"flags": 0}, {"ICAO_address": 1 << 24}, {"tslc": 6}, {"north": 2500.0}, {"above": 300.0}],
    ids=["no place", "no address", "outdated", "beyond the list's radius", "far above"],
)
def test_reports_that_are_no_threat(avoiding: Any, fields: dict[str, Any]) -> None:
    rig = avoiding()
    report(rig, **{"above": 10.0, **fields})
    rig.command(MODE, 1.0, GUIDED)
    assert rig.command(ARM, 1.0) == 0


def test_an_aircraft_on_its_way_here_is_a_threat_and_one_that_leaves_is_none(avoiding: Any) -> None:
    rig = avoiding()
    report(rig, 10.0, 1000.0, hor_velocity=5000, heading=0)
    assert "COLLISION" not in rig.latest
    report(rig, 10.0, 1000.0, hor_velocity=5000, heading=18_000)
    assert rig.latest["COLLISION"]["threat_level"] == HIGH
    assert rig.latest["COLLISION"]["horizontal_minimum_delta"] == pytest.approx(0.0, abs=10.0)


@pytest.mark.parametrize(("above", "climbs"), [(10.0, True), (30.0, False)])
def test_the_copter_climbs_over_a_lower_aircraft_and_never_sinks_below_the_return_height(
    avoiding: Any, above: float, climbs: bool
) -> None:
    rig = flying(avoiding(RTL_ALT=3000))
    start = rig.vehicle.height
    for _ in range(10):
        report(rig, above)
    assert mode(rig) == AVOID_ADSB
    assert (rig.vehicle.height > start + 1.5) == climbs
    assert rig.vehicle.height > start - 0.5


def test_the_copter_flies_away_from_an_aircraft_that_stands(avoiding: Any) -> None:
    rig = flying(avoiding(AVD_F_ACTION=3))
    for _ in range(15):
        report(rig, 20.0, 30.0)
    north, _, _ = rig.vehicle.estimate.velocity
    assert north < -4.0


@pytest.mark.parametrize(("action", "entered"), [(5, RTL), (6, LOITER)])
def test_the_copter_returns_or_hovers(avoiding: Any, action: int, entered: int) -> None:
    rig = flying(avoiding(AVD_F_ACTION=action))
    report(rig, 25.0)
    rig.run(0.5)
    assert mode(rig) == entered


@pytest.mark.parametrize(("recovery", "then"), [(0, AVOID_ADSB), (1, GUIDED), (2, RTL), (3, AVOID_ADSB)])
def test_after_the_threat_the_mode_is_the_one_that_the_parameter_names(
    avoiding: Any, recovery: int, then: int
) -> None:
    rig = flying(avoiding(AVD_F_RCVRY=recovery))
    report(rig, 15.0)
    rig.run(1.0)
    assert mode(rig) == AVOID_ADSB
    rig.run(8.0)
    assert mode(rig) == then


def test_a_mode_that_was_chosen_meanwhile_stays(avoiding: Any) -> None:
    rig = flying(avoiding())
    report(rig, 15.0)
    rig.command(MODE, 1.0, LOITER)
    rig.run(8.0)
    assert mode(rig) == LOITER


def test_position_reports_of_other_systems_count_too(avoiding: Any) -> None:
    rig = avoiding()
    place = {"lat": 460_000_000, "lon": 70_000_000, "alt": 505_000, "relative_alt": 5000}
    velocity = {"vx": 0, "vy": 0, "vz": 0, "hdg": 0}
    rig.send("GLOBAL_POSITION_INT", time_boot_ms=1, **place, **velocity)
    rig.run(0.3)
    assert rig.latest["COLLISION"]["id"] != 37
    assert rig.latest["COLLISION"]["threat_level"] == HIGH
