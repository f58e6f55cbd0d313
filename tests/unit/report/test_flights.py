"""The same flight is read from every kind of record."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigs.flight_log_files import tlog
from rigs.flown_records import SAID, Shape, write_dataflash, write_run, write_tlog, write_ulog
from volery.base.errors import UsageError
from volery.links.frame import Frame
from volery.report.flight_comparison import phases
from volery.report.flights import BATTERY, PITCH, ROLL, SPEED, YAW, VehicleFlight, read_flights

WRITERS = {
    "run": lambda folder, shape: write_run(folder / "run", shape),
    "1.tlog": lambda folder, shape: write_tlog(folder / "1.tlog", shape),
    "1.bin": lambda folder, shape: write_dataflash(folder / "1.bin", shape),
    "1.ulg": lambda folder, shape: write_ulog(folder / "1.ulg", shape),
}
LOGS = [name for name in WRITERS if name != "run"]


@pytest.fixture(params=WRITERS)
def flight(request: pytest.FixtureRequest, tmp_path: Path) -> VehicleFlight:
    (found,) = read_flights(WRITERS[request.param](tmp_path, Shape(east_m=8.0)))
    return found


def value(flight: VehicleFlight, name: str, time: float) -> float:
    return float(flight.values(name, np.array([time]))[0])


def test_the_track_is_about_the_place_of_arming(flight: VehicleFlight) -> None:
    tolerance = 0.02  # a tlog has centimetres
    for time, place in ((5.0, (0, 0, 0)), (10.0, (0, 0, 4)), (25.0, (4, 10, 10)), (40.0, (8, 20, 5))):
        assert flight.places(np.array([time]))[0] == pytest.approx(place, abs=tolerance)


def test_attitude_speed_and_battery_have_the_same_signs_and_units(flight: VehicleFlight) -> None:
    assert value(flight, ROLL, 25.0) == pytest.approx(0.0, abs=0.01)
    assert value(flight, PITCH, 25.0) == pytest.approx(-5.0, abs=0.01)  # nose down
    assert value(flight, YAW, 25.0) == pytest.approx(45.0, abs=0.01)
    assert value(flight, YAW, 45.0) == pytest.approx(90.0, abs=0.01)
    assert value(flight, SPEED, 10.0) == pytest.approx(2.0, abs=0.01)
    assert value(flight, BATTERY, 40.0) == pytest.approx(80.0, abs=0.5)


def test_phases_by_states(flight: VehicleFlight) -> None:
    found = {one.name: one.stretch for one in phases(flight, by_operations=False)}
    modes = [name for name in found if name.startswith("mode ")]
    assert modes in (["mode GUIDED", "mode LAND"], ["mode AUTO.LOITER", "mode AUTO.LAND"])
    assert found["armed"] == pytest.approx((5.0, 50.0), abs=0.11)
    assert found["take-off"] == pytest.approx((8.0, 13.0), abs=0.6)
    assert found[modes[1]] == pytest.approx((35.0, 50.0), abs=0.11)
    assert found["landing"] == pytest.approx((35.0, 45.0), abs=0.6)


def test_what_was_said(flight: VehicleFlight) -> None:
    (said,) = (one for one in flight.texts if SAID in one.text)
    assert said.time == pytest.approx(2.0, abs=0.01)
    assert not said.text.endswith("\t")


@pytest.mark.parametrize("name", LOGS)
def test_answers_of_logs_are_the_acknowledgements(tmp_path: Path, name: str) -> None:
    (found,) = read_flights(WRITERS[name](tmp_path, Shape()))
    assert [(one.asked, one.outcome) for one in found.answers] == [
        ("COMPONENT_ARM_DISARM", "ACCEPTED"),
        ("NAV_TAKEOFF", "DENIED"),
    ]
    assert [round(one.at, 1) for one in found.answers] == [5.0, 35.0]


def test_times_of_a_tlog_are_those_of_the_vehicle(tmp_path: Path) -> None:
    slow, fast = (
        read_flights(write_tlog(tmp_path / f"{pace}.tlog", pace=pace))[0].armed[0] for pace in (0.25, 4.0)
    )
    assert slow.end - slow.begin == pytest.approx(45.0, abs=0.11)
    assert fast.end - fast.begin == pytest.approx(45.0, abs=0.11)


def test_two_vehicles_of_a_tlog(tmp_path: Path) -> None:
    frames = []
    for time in range(10):
        for system in (1, 2):
            beat = {"type": 10, "autopilot": 3, "base_mode": 128 * (time > 2), "custom_mode": 15}
            place = {"time_boot_ms": 1000 * time, "lat": 10_000 + time * system, "lon": 10_000, "alt": 0}
            frames.append((float(time), Frame("HEARTBEAT", beat, system, 1)))
            frames.append((float(time), Frame("GLOBAL_POSITION_INT", place, system, 1)))
    first, second = read_flights(tlog(tmp_path / "1.tlog", frames))
    assert (first.vehicle, second.vehicle) == ("vehicle", "vehicle2")
    assert not first.flies
    assert [mode for mode, _ in second.modes(second.armed[0])] == ["GUIDED"]
    assert value(second, "north", 9.0) == pytest.approx(2.0 * value(first, "north", 9.0), rel=0.01)


def test_records_without_a_flight_name_the_remedy(tmp_path: Path) -> None:
    beat = {"type": 2, "autopilot": 3, "base_mode": 81, "custom_mode": 0}
    frames = [(float(time), Frame("HEARTBEAT", beat, 1, 1)) for time in range(5)]
    frames += [(float(time), Frame("ATTITUDE", {"time_boot_ms": 1000 * time}, 1, 1)) for time in range(5)]
    on_ground = tlog(tmp_path / "1.tlog", sorted(frames, key=lambda one: one[0]))
    with pytest.raises(UsageError, match="no vehicle arms in it; give a log from arming to landing"):
        read_flights(on_ground)
    with pytest.raises(UsageError, match=r"has no trace\.mcap.*--record trace"):
        read_flights(tmp_path)
    (tmp_path / "1.bag").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(UsageError, match=r"recording of ROS topics.*run folder"):
        read_flights(tmp_path / "1.bag")
    (tmp_path / "notes.txt").write_text("no log at all, only words of which there are some")
    with pytest.raises(UsageError, match="no flight log"):
        read_flights(tmp_path / "notes.txt")
