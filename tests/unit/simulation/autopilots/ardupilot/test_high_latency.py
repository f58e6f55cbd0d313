"""Links of high latency: HIGH_LATENCY2, CONTROL_HIGH_LATENCY and SERIALn_PROTOCOL 43."""

from __future__ import annotations

from typing import Any

import pytest

pytestmark = pytest.mark.optional

REQUEST, INTERVAL, CONTROL, ARM, TAKEOFF, MODE = 512, 511, 2600, 400, 22, 176
HIGH_LATENCY2, HEARTBEAT = 235, 0
GPS, DIFFERENTIAL_PRESSURE = 1, 2
"""HL_FAILURE_FLAG."""


def received(rig: Any, link: Any) -> list[Any]:
    """Frames on a link from now on."""
    frames: list[Any] = []
    link.receive(lambda frame: frames.append((rig.now, frame)))
    return frames


def times(frames: list[Any], name: str) -> list[float]:
    return [at for at, frame in frames if frame.name == name]


@pytest.fixture
def modem(station: Any) -> Any:
    """Makes a vehicle whose second link is of high latency: the rig, and what that link carries."""

    def made(kind: str = "copter") -> Any:
        rig = station(kind, parameters={"SERIAL1_PROTOCOL": 43, "ARMING_CHECK": 0})
        frames = received(rig, rig.another_link())
        rig.vehicle.restart()
        rig.run(40.0)
        return rig, frames

    return made


@pytest.mark.parametrize("kind", ["copter", "rover"])
def test_a_link_of_high_latency_is_silent_until_a_command_switches_it_on(kind: str, modem: Any) -> None:
    rig, frames = modem(kind)
    assert frames == []
    assert rig.command(CONTROL, 1.0) == 0
    assert "High Latency enabled" in rig.texts()
    start = rig.now
    rig.run(20.0)
    assert len(times(frames, "HIGH_LATENCY2")) == 4
    assert times(frames, "HEARTBEAT") == []
    assert rig.of("HIGH_LATENCY2") == []
    assert len([one for one in rig.of("HEARTBEAT") if one.at > start]) == 20
    assert rig.command_int(CONTROL, param1=0.0) == 0
    frames.clear()
    rig.run(20.0)
    assert frames == []
    assert "High Latency disabled" in rig.texts()


def test_neither_on_nor_off_is_refused(modem: Any) -> None:
    rig, _ = modem()
    assert rig.command(CONTROL, 2.0) == 4


def test_a_boot_switches_it_off_and_reads_the_protocol_anew(modem: Any) -> None:
    rig, frames = modem()
    rig.command(CONTROL, 1.0)
    rig.vehicle.set_parameter("SERIAL1_PROTOCOL", 2.0)
    frames.clear()
    rig.run(6.0)
    assert times(frames, "HEARTBEAT") == []
    rig.vehicle.restart()
    frames.clear()
    rig.run(20.0)
    assert len(times(frames, "HEARTBEAT")) > 10
    assert times(frames, "HIGH_LATENCY2") == []


def test_another_link_streams_it_on_request_whether_they_are_on_or_not(modem: Any) -> None:
    rig, _ = modem()
    assert rig.command(INTERVAL, HIGH_LATENCY2, 200_000.0) == 0
    for on in (1.0, 0.0):
        rig.command(CONTROL, on)
        count = len(rig.of("HIGH_LATENCY2"))
        rig.run(10.0)
        assert len(rig.of("HIGH_LATENCY2")) - count == 50


def reported(rig: Any) -> dict[str, Any]:
    assert rig.command(REQUEST, HIGH_LATENCY2) == 0
    rig.run(0.1)
    fields: dict[str, Any] = rig.latest["HIGH_LATENCY2"]
    return fields


def test_it_reports_the_flight_in_coarse_units(station: Any) -> None:
    rig = station(parameters={"ARMING_CHECK": 0})
    rig.run(0.5)
    standing = reported(rig)
    assert (standing["type"], standing["autopilot"], standing["custom_mode"]) == (2, 3, 0)
    assert (standing["latitude"], standing["longitude"]) == pytest.approx((46e7, 7e7), abs=50)
    assert standing["altitude"] in (499, 500, 501)
    assert (standing["temperature_air"], standing["battery"]) == (-128, 99)
    assert standing["custom0"] == 81
    for number, params in ((MODE, (1.0, 4.0)), (ARM, (1.0,)), (TAKEOFF, (0, 0, 0, 0, 0, 0, 20.0))):
        assert rig.command(number, *params) == 0
    rig.run(5.0)
    climbing = reported(rig)
    assert climbing["custom_mode"] == 4
    assert climbing["custom0"] == 81 + 8 + 128 - 256  # GUIDED, armed: the byte has a sign
    rig.run(20.0)
    assert reported(rig)["target_altitude"] in (519, 520, 521)
    rig.send(
        "SET_POSITION_TARGET_LOCAL_NED",
        target_system=1,
        target_component=1,
        coordinate_frame=1,
        type_mask=0b1101_1111_1000,
        x=0.0,
        y=200.0,
        z=-50.0,
    )
    rig.run(8.0)
    flying = reported(rig)
    assert flying["target_altitude"] - flying["altitude"] > 5
    assert flying["target_heading"] in (44, 45)
    assert 10 <= flying["target_distance"] <= 17
    speed = rig.latest["VFR_HUD"]["groundspeed"] if "VFR_HUD" in rig.latest else 9.0
    assert flying["groundspeed"] == pytest.approx(speed * 5.0, abs=8.0)


def test_failures_are_those_of_the_sensors(station: Any) -> None:
    rig = station()
    rig.run(0.5)
    assert reported(rig)["failure_flags"] & GPS == 0
    assert reported(rig)["failure_flags"] & DIFFERENTIAL_PRESSURE
    rig.vehicle.set_parameter("SIM_GPS_TYPE", 0.0)
    rig.run(10.0)
    assert reported(rig)["failure_flags"] & GPS
    rig.vehicle.set_parameter("SIM_GPS_TYPE", 1.0)
    rig.run(10.0)
    assert reported(rig)["failure_flags"] & GPS == 0


def test_an_airspeed_sensor_gives_the_temperature(station: Any) -> None:
    rig = station("rover", parameters={"ARSPD_ENABLE": 1, "ARSPD_TYPE": 7})
    rig.run(0.5)
    found = reported(rig)
    assert found["temperature_air"] == 36  # 15 - 0.0065 * 500, and 25 of the sensor
    assert found["failure_flags"] & DIFFERENTIAL_PRESSURE == 0
