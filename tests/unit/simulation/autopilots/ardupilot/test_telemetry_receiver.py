"""GPS_RAW_INT of a receiver without a fix: its position goes on, as on ArduCopter's simulator."""

from __future__ import annotations

from typing import Any

GPS_RAW_INT, REQUEST_MESSAGE, SET_MODE, GUIDED, ARM, TAKE_OFF, REBOOT = 24, 512, 176, 4, 400, 22, 246
ONE_METRE = 90  # in 1e-7 degrees of latitude


def receiver(rig: Any) -> dict[str, Any]:
    assert rig.command(REQUEST_MESSAGE, GPS_RAW_INT) == 0
    found: dict[str, Any] = rig.latest["GPS_RAW_INT"]
    return found


def test_without_a_fix_the_receiver_goes_on_stating_where_it_is(station: Any) -> None:
    rig = station(parameters={"FS_EKF_THRESH": 0})
    rig.run(0.5)
    rig.command(SET_MODE, 1, GUIDED)
    rig.command(ARM, 1)
    rig.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 10.0)
    rig.run(12.0)
    fixed = receiver(rig)
    rig.vehicle.set_parameter("SIM_GPS_DISABLE", 1.0)
    rig.run(1.0)
    lost = receiver(rig)
    assert (lost["fix_type"], lost["satellites_visible"]) == (1, 3)
    assert abs(lost["lat"] - fixed["lat"]) < ONE_METRE
    assert abs(lost["alt"] - fixed["alt"]) < 1000
    assert (lost["eph"], lost["epv"], lost["h_acc"], lost["vel_acc"]) == (121, 200, 300, 40)

    rig.flight.push(10.0, 0.0, 0.0)
    rig.run(4.0)
    moved = receiver(rig)
    assert abs(moved["lat"] - lost["lat"]) > 10 * ONE_METRE
    latitude, _, _ = rig.flight.frame.from_enu(rig.flight.truth().position)
    assert abs(moved["lat"] - latitude * 1e7) < ONE_METRE
    assert moved["time_usec"] == lost["time_usec"]  # that of the last fix


def test_a_receiver_that_boots_has_had_no_fix(station: Any) -> None:
    rig = station(warm=False)
    rig.run(9.7)
    found = receiver(rig)
    assert (found["fix_type"], found["time_usec"]) == (1, 0)
    assert abs(found["lat"] - 460_000_000) < ONE_METRE


def test_without_a_fix_since_the_boot_its_time_is_none(station: Any) -> None:
    rig = station(parameters={"SIM_GPS_DISABLE": 1.0, "ARMING_CHECK": 0.0})
    rig.run(30.0)
    rig.command(REBOOT, 1)
    rig.run(10.0)
    found = receiver(rig)
    assert (found["fix_type"], found["time_usec"]) == (1, 0)
