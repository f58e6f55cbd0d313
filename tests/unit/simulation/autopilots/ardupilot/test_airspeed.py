"""An airspeed sensor: what VFR_HUD and SYS_STATUS report of it."""

from __future__ import annotations

from math import hypot
from typing import Any

import pytest

pytestmark = pytest.mark.optional

REQUEST, VFR_HUD, SYS_STATUS = 512, 74, 1
DIFFERENTIAL_PRESSURE, GPS, PROXIMITY, BATTERY = 1 << 4, 1 << 5, 1 << 26, 1 << 25


def asked(rig: Any, number: int, name: str) -> dict[str, Any]:
    assert rig.command(REQUEST, number) == 0
    rig.run(0.1)
    fields: dict[str, Any] = rig.latest[name]
    return fields


def sensor_bits(rig: Any) -> tuple[int, int, int]:
    fields = asked(rig, SYS_STATUS, "SYS_STATUS")
    present, enabled, healthy = (
        fields[f"onboard_control_sensors_{kind}"] for kind in ("present", "enabled", "health")
    )
    return present, enabled, healthy


@pytest.mark.parametrize(("comes_from", "speed"), [(0.0, 8.0), (180.0, 0.0), (60.0, 4.0)])
def test_it_measures_the_wind_from_ahead(comes_from: float, speed: float, station: Any) -> None:
    rig = station(
        parameters={"ARSPD_ENABLE": 1, "ARSPD_TYPE": 1, "SIM_WIND_SPD": 8.0, "SIM_WIND_DIR": comes_from}
    )
    rig.run(1.0)
    hud = asked(rig, VFR_HUD, "VFR_HUD")
    assert hud["airspeed"] == pytest.approx(speed, abs=0.01)
    assert hud["groundspeed"] < 0.1
    present, _, healthy = sensor_bits(rig)
    assert present & healthy & DIFFERENTIAL_PRESSURE


@pytest.mark.parametrize("parameters", [{"ARSPD_TYPE": 7}, {"ARSPD_ENABLE": 1}])
def test_without_one_the_speed_is_that_over_ground(parameters: dict[str, float], station: Any) -> None:
    rig = station(parameters={**parameters, "SIM_WIND_SPD": 8.0, "SIM_WIND_DIR": 0.0})
    rig.run(1.0)
    north, east, down = rig.vehicle.estimate.velocity
    assert asked(rig, VFR_HUD, "VFR_HUD")["airspeed"] == pytest.approx(hypot(north, east, down), abs=0.1)
    assert not any(bits & DIFFERENTIAL_PRESSURE for bits in sensor_bits(rig))


def test_a_receiver_that_sends_nothing_is_not_there_after_four_seconds(station: Any) -> None:
    rig = station()
    rig.run(0.5)
    rig.vehicle.set_parameter("SIM_GPS_TYPE", 0.0)
    rig.run(3.0)
    assert all(bits & GPS for bits in sensor_bits(rig))
    rig.run(2.0)
    assert not any(bits & GPS for bits in sensor_bits(rig))
    rig.vehicle.set_parameter("SIM_GPS_TYPE", 1.0)
    rig.run(1.0)
    assert all(bits & GPS for bits in sensor_bits(rig))


def test_a_receiver_without_a_fix_is_healthy(station: Any) -> None:
    """As seen on ArduCopter in its own simulator: any status but that of no receiver is healthy."""
    rig = station(parameters={"SIM_GPS_DISABLE": 1})
    rig.run(8.0)
    assert all(bits & GPS for bits in sensor_bits(rig))


def test_a_proximity_sensor_without_data_is_unhealthy_and_the_battery_is_not(station: Any) -> None:
    rig = station(parameters={"PRX1_TYPE": 2})
    rig.run(2.0)
    present, enabled, healthy = sensor_bits(rig)
    assert present & enabled & PROXIMITY
    assert not healthy & PROXIMITY
    assert healthy & BATTERY
