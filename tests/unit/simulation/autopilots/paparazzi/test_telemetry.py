"""What it sends regularly: periods, scales, frames; settings and pings that it answers."""

from __future__ import annotations

from collections.abc import Callable
from math import dist
from typing import Any

import pytest

from rigs.effects import fingerprint
from volery.base.frames import LocalFrame, ecef_to_geodetic
from volery.base.time import S
from volery.links.paparazzi_aircraft import stock_aircraft
from volery.links.pprzlink_codec import PPRZLINK
from volery.simulation.autopilots.paparazzi.parameters import read_setting
from volery.simulation.world.body_specs import BatteryPack

Make = Callable[..., Any]

PERIODS = {
    "ROTORCRAFT_FP": 0.25,
    "INS": 0.25,
    "GPS_INT": 0.25,
    "AHRS_REF_QUAT": 0.5,
    "AIR_DATA": 1.3,
    "ROTORCRAFT_STATUS": 1.2,
    "ROTORCRAFT_NAV_STATUS": 1.6,
    "ALIVE": 2.1,
    "ENERGY": 2.5,
    "STATE_FILTER_STATUS": 3.2,
    "INS_REF": 5.1,
    "DATALINK_REPORT": 5.1,
    "AUTOPILOT_VERSION": 11.1,
}


@pytest.mark.parametrize("name", PERIODS)
def test_the_default_periods(craft: Any, name: str) -> None:
    craft.run(3.0)
    craft.received.clear()
    craft.run(51.0)
    assert craft.count(name) == pytest.approx(51.0 / PERIODS[name], abs=1.0)


def test_position_velocity_and_attitude_have_their_scales(craft: Any) -> None:
    craft.guided()
    craft.guide(0x60, 1.5, -2.5, -0.5, 0.75)
    craft.run(16.0)
    fp, estimate = craft.last("ROTORCRAFT_FP"), craft.autopilot.vehicle.estimate
    north, east, down = estimate.position
    assert [fp["east"] / 256, fp["north"] / 256, fp["up"] / 256] == pytest.approx(
        [east, north, -down], abs=1.0
    )
    velocity = [fp[f"v{axis}"] / 2**19 for axis in ("east", "north", "up")]
    assert velocity == pytest.approx([-2.5, 1.5, 0.5], abs=0.15)
    assert fp["psi"] / 4096 == pytest.approx(0.75, abs=0.03)
    assert fp["flight_time"] > 5
    assert 2000 < fp["thrust"] < 7000


def test_the_estimate_is_also_sent_as_ins_and_quaternion(craft: Any) -> None:
    craft.guided()
    craft.guide(0x00, 10.0, 5.0, -12.0, 0.3)
    craft.run(20.0)
    seen, attitude, air = (craft.last(name) for name in ("INS", "AHRS_REF_QUAT", "AIR_DATA"))
    assert seen["ins_x"] / 256 == pytest.approx(10.0, abs=0.5)
    assert seen["ins_z"] / 256 == pytest.approx(-12.0, abs=0.5)
    size = sum((attitude[f"body_q{part}"] / 32768) ** 2 for part in "ixyz")
    assert size == pytest.approx(1.0, abs=1e-3)
    assert 80_000.0 < air["pressure"] < 102_000.0


def test_local_frame_and_satellites_name_the_same_place(craft: Any) -> None:
    craft.guided()
    craft.guide(0x00, 30.0, 20.0, -12.0)
    craft.run(20.0)
    reference, fix, fp = craft.last("INS_REF"), craft.last("GPS_INT"), craft.last("ROTORCRAFT_FP")
    frame = LocalFrame(reference["lat0"] / 1e7, reference["lon0"] / 1e7, reference["hmsl0"] / 1e3)
    seen = frame.to_enu(fix["lat"] / 1e7, fix["lon"] / 1e7, fix["hmsl"] / 1e3)
    assert seen == pytest.approx([fp[axis] / 256 for axis in ("east", "north", "up")], abs=0.3)
    for place, names in (
        (reference, ("ecef_x0", "ecef_y0", "ecef_z0", "lat0", "lon0", "alt0")),
        (fix, ("ecef_x", "ecef_y", "ecef_z", "lat", "lon", "alt")),
    ):
        x, y, z, lat, lon, alt = (place[name] for name in names)
        geodetic = ecef_to_geodetic((x / 100.0, y / 100.0, z / 100.0))
        assert geodetic[:2] == pytest.approx((lat / 1e7, lon / 1e7), abs=3e-7)
        assert geodetic[2] == pytest.approx(alt / 1e3, abs=0.02)


def test_the_fixs_velocity_is_along_the_earths_axes(craft: Any) -> None:
    craft.guided()
    craft.guide(0x60, 3.0, 1.0, -0.5)
    craft.run(16.0)
    first = craft.last("GPS_INT")
    craft.run(2.0)
    second = craft.last("GPS_INT")
    moved = [(second[f"ecef_{axis}"] - first[f"ecef_{axis}"]) / 2.0 for axis in "xyz"]
    assert [second[f"ecef_{axis}d"] for axis in "xyz"] == pytest.approx(moved, abs=15.0)


def test_the_battery(make: Make) -> None:
    craft = make(battery=BatteryPack(capacity_ah=4.0, left=0.5))
    craft.guided()
    craft.run(10.0)
    energy, status = craft.last("ENERGY"), craft.last("ROTORCRAFT_STATUS")
    assert energy["voltage"] == pytest.approx(craft.autopilot.vehicle.estimate.battery_volts, abs=0.05)
    assert energy["power"] == pytest.approx(energy["voltage"] * energy["current"], rel=0.01)
    assert energy["charge"] > 2.0
    assert status["vsupply"] == pytest.approx(energy["voltage"], abs=0.1)


def test_settings_are_read_and_written_by_number(craft: Any) -> None:
    auto2 = stock_aircraft().setting("auto2").number
    craft.received.clear()
    craft.send("GET_SETTING", index=auto2)
    craft.run(0.05)
    assert craft.last("DL_VALUE") == {"index": auto2, "value": 13.0}
    craft.set("auto2", 19.0)
    assert craft.last("DL_VALUE") == {"index": auto2, "value": 19.0}
    assert craft.mode == "NAV"  # it says what the switch means, and there is no switch
    craft.received.clear()
    craft.send("SETTING", index=200, value=1.0)
    craft.send("GET_SETTING", index=200)
    craft.send("SETTING", index=auto2, value=float("nan"))
    craft.run(0.05)
    answers = [frame.fields for frame in craft.received if frame.name == "DL_VALUE"]
    assert [one["value"] for one in answers if one["index"] == 200] == [1.0, 1.0]  # recorded: answered, too
    assert [one["value"] for one in answers if one["index"] == auto2] == [19.0]


def test_a_setting_without_effect_keeps_its_value(craft: Any) -> None:
    """All of the stock rotorcraft, each set to another value."""
    vehicle, kept = craft.autopilot.vehicle, set()
    for setting in stock_aircraft().settings:
        now = read_setting(vehicle, setting.number)
        before = fingerprint(vehicle), vehicle.parameters.changes
        craft.send("SETTING", index=setting.number, value=setting.high if now == setting.low else setting.low)
        craft.run(0.05)
        if read_setting(vehicle, setting.number) == now:
            kept.add(setting.name)
        assert (fingerprint(vehicle), vehicle.parameters.changes) != before, setting.name  # it has heard it
    assert kept == {"video_periodic_status", "gps_periodic_status"}


def test_settings_are_numbered_as_generated_for_the_stock_aircraft() -> None:
    """Observed of ardrone2: the telemetry mode is 0; kill_throttle has no shortname."""
    named = {one.variable: one.number for one in stock_aircraft().settings}
    assert named["telemetry_mode_Main"] == 0
    assert [named[f"autopilot{rest}"] for rest in ("_mode_auto2", ".kill_throttle", ".mode")] == [3, 4, 5]


@pytest.mark.parametrize(
    ("mode", "silent"), [(3, {"ROTORCRAFT_FP", "ROTORCRAFT_NAV_STATUS"}), (19, set(PERIODS))]
)
def test_another_telemetry_mode_is_another_list(craft: Any, mode: int, silent: set[str]) -> None:
    """Recorded of scaled_sensors (3); observed of a number that is no mode: all periodic telemetry stops."""
    craft.set("telemetry_mode_Main", mode)
    craft.received.clear()
    craft.run(12.0)
    assert {name for name in PERIODS if not craft.count(name)} == silent
    craft.send("PING")
    craft.run(0.05)
    assert craft.count("PONG") == 1


def test_settings_and_waypoints_are_sent_in_turn(craft: Any) -> None:
    craft.run(15.0)
    reported = {frame.fields["index"] for frame in craft.received if frame.name == "DL_VALUE"}
    assert reported == {one.number for one in stock_aircraft().settings}
    places = {frame.fields["wp_id"] for frame in craft.received if frame.name == "WP_MOVED_ENU"}
    assert places == set(range(10))


def test_a_ping_is_answered(craft: Any) -> None:
    craft.send("PING")
    craft.run(0.05)
    assert craft.count("PONG") == 1


def test_the_datalink_report_counts_the_silence_of_the_ground(craft: Any) -> None:
    craft.send("PING")
    craft.run(5.2)
    report = craft.last("DATALINK_REPORT")
    assert report["uplink_nb_msgs"] == 1
    craft.run(20.4)
    assert craft.last("DATALINK_REPORT")["uplink_lost_time"] >= report["uplink_lost_time"] + 20


def test_every_message_fits_its_definition_and_carries_its_number(make: Make) -> None:
    craft = make(through_bytes=True)
    craft.guided()
    craft.run(10.0)
    assert {frame.system for frame in craft.received} == {7}
    assert set(PERIODS) <= {frame.name for frame in craft.received} | {"AUTOPILOT_VERSION"}
    assert (
        craft.link.statistics.corrupt == craft.link.statistics.unknown == craft.link.statistics.garbage == 0
    )
    assert craft.link.problem() == ""


def test_values_and_bytes_fly_the_same(make: Make) -> None:
    received = []
    for through_bytes in (False, True):
        craft = make(through_bytes=through_bytes)
        craft.guided()
        craft.guide(0x00, 10.0, 5.0, -12.0, 0.3)
        craft.run(10.0)
        received.append([PPRZLINK.encode(frame, 0) for frame in craft.received])
    assert received[0] == received[1]


def test_a_flight_repeats_byte_for_byte(make: Make) -> None:
    flown = []
    for _ in range(2):
        craft = make()
        craft.in_the_air()
        craft.block("route")
        craft.run(20.0)
        flown.append(b"".join(PPRZLINK.encode(frame, 0) for frame in craft.received))
    assert flown[0] == flown[1]


def test_far_from_its_origin_numbers_stay_within_their_fields(craft: Any) -> None:
    craft.guided()
    craft.guide(0x00, 1e30, -1e30, -1e30)
    craft.run(2.0)
    fp = craft.last("ROTORCRAFT_FP")
    assert fp["carrot_north"] == 2**31 - 1
    assert fp["carrot_east"] == -(2**31 - 1)
    assert dist(craft.position[:2], (0.0, 0.0)) < 50.0


def test_counters_of_16_bits_and_the_week_begin_anew(craft: Any) -> None:
    """As the original's: nothing ends or stops after 18 hours, or after a week."""
    vehicle = craft.autopilot.vehicle
    vehicle.boot_at -= 7 * 86_400 * S
    craft.run(3.0)
    assert craft.last("GPS_INT")["tow"] < 100_000
    now = vehicle.uptime() // S % 65_536
    assert now - 4 <= craft.last("ROTORCRAFT_STATUS")["cpu_time"] <= now
