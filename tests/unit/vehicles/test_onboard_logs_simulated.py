"""Logs of the simulated autopilots, downloaded by volery and read by the autopilots' own readers."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink import DFReader, mavutil
from pyulog import ULog

from rigs.airstrip import Airstrip, at
from volery.base.time import S
from volery.control.log_signals import read_signals
from volery.kernel.waiting import sleep
from volery.links.frame import Frame
from volery.report.flight_comparison import phases
from volery.report.flights import read_flights
from volery.vehicles import Drone
from volery.vehicles.drivers.ardupilot import open_driver as open_ardupilot
from volery.vehicles.drivers.px4 import open_driver as open_px4
from volery.vehicles.services import LogEntry


class ArduPilotStrip(Airstrip):
    firmware = "ardupilot"
    opener = staticmethod(open_ardupilot)


class Px4Strip(Airstrip):
    firmware = "px4"
    opener = staticmethod(open_px4)


def two_flights(strip: Airstrip, file: Path) -> list[LogEntry]:
    """Fly twice, to 12 m and to 5 m, and download the first log."""

    def mission(drone: Drone) -> list[LogEntry]:
        drone.wait_ready()
        assert drone.logs.list() == []
        drone.takeoff(12)
        drone.goto(at(0, 15, 12))
        drone.land()
        drone.takeoff(5)
        drone.land()
        found = drone.logs.list()
        drone.logs.download(found[0], file)
        return found

    logs: list[LogEntry] = strip.fly(mission)
    return logs


@pytest.fixture(scope="module")
def dataflash(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[LogEntry], Path]:
    file = tmp_path_factory.mktemp("logs") / "1.bin"
    return two_flights(ArduPilotStrip(logging=True), file), file


@pytest.fixture(scope="module")
def ulog(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[LogEntry], Path]:
    file = tmp_path_factory.mktemp("logs") / "0.ulg"
    return two_flights(Px4Strip(logging=True), file), file


def messages(file: Path) -> dict[str, list[Any]]:
    log = DFReader.DFReader_binary(str(file))
    found: dict[str, list[Any]] = {}
    while (message := log.recv_msg()) is not None:
        found.setdefault(message.get_type(), []).append(message)
    return found


def test_pymavlink_reads_the_log_of_an_ardupilot(dataflash: tuple[list[LogEntry], Path]) -> None:
    logs, file = dataflash
    assert [log.number for log in logs] == [1, 2]
    assert logs[0].size == file.stat().st_size
    assert logs[0].utc < logs[1].utc
    found = messages(file)
    heights = [one.RelHomeAlt for one in found["POS"]]
    assert max(heights) == pytest.approx(12.0, abs=0.7)
    assert abs(heights[-1]) < 0.7
    north = (found["POS"][-1].Lat - found["POS"][0].Lat) * 111_200.0
    assert north == pytest.approx(15.0, abs=2.0)
    fixes = [(one.TimeUS / 1e6, one.Lat * 111_200.0, one.Spd) for one in found["GPS"]]
    gone = sum(speed * (b - a) for (a, _, speed), (b, _, _) in pairwise(fixes))
    assert gone == pytest.approx(north, abs=4.0)  # speed and position agree
    assert {one.Name: one.Value for one in found["PARM"]}["RTL_ALT_M"] == 15.0
    used = [one.CurrTot for one in found["BAT"]]
    assert used == sorted(used)
    assert used[-1] > used[0]
    assert [one.ArmState for one in found["ARM"]] == [1, 0]
    steps = {round(b.TimeUS - a.TimeUS, -3) for a, b in pairwise(found["ATT"])}
    assert steps == {200_000}
    assert len(found["ATT"]) == len(found["POS"]) == len(found["BAT"])
    assert [one.Id for one in found["EV"]] == [10, 11]  # armed, disarmed
    assert "PRX" not in found  # no proximity sensor


def test_pymavlink_knows_vehicle_modes_and_time(dataflash: tuple[list[LogEntry], Path]) -> None:
    logs, file = dataflash
    log = mavutil.mavlink_connection(str(file))
    modes = []
    while (message := log.recv_match(type="MODE")) is not None:
        modes.append(log.flightmode)
        started = message._timestamp
    assert log.mav_type == mavutil.mavlink.MAV_TYPE_QUADROTOR
    assert modes[0] == "GUIDED"
    assert modes[-1] == "LAND"
    assert -30.0 < started - logs[0].utc < 0.0  # the last mode begins before the log ends


def test_pyulog_reads_the_log_of_a_px4(ulog: tuple[list[LogEntry], Path]) -> None:
    logs, file = ulog
    assert [log.number for log in logs] == [0, 1]
    log = ULog(str(file))
    assert not log.file_corruption
    data = {topic.name: topic.data for topic in log.data_list}
    assert -data["vehicle_local_position"]["z"].min() == pytest.approx(12.0, abs=0.7)
    assert data["vehicle_local_position"]["x"][-1] == pytest.approx(15.0, abs=2.0)
    norm = sum(data["vehicle_attitude"][f"q[{axis}]"] ** 2 for axis in range(4))
    assert norm == pytest.approx(1.0, abs=1e-5)
    assert log.initial_parameters["MPC_XY_CRUISE"] == 5.0
    assert isinstance(log.initial_parameters["COM_RC_IN_MODE"], int)
    assert data["vehicle_status"]["nav_state"][-1] == 18  # AUTO_LAND
    assert {17, 4} < set(data["vehicle_status"]["nav_state"])  # AUTO_TAKEOFF, AUTO_LOITER
    assert data["battery_status"]["remaining"][-1] < data["battery_status"]["remaining"][0]
    assert log.msg_info_dict["sys_name"] == "PX4"


def test_volery_judges_them(
    dataflash: tuple[list[LogEntry], Path], ulog: tuple[list[LogEntry], Path]
) -> None:
    assert {"roll", "pitch", "yaw"} <= {signal.name for signal in read_signals(dataflash[1])}
    assert {"roll", "pitch", "yaw", "north"} <= {signal.name for signal in read_signals(ulog[1])}


@pytest.mark.parametrize("log", ["dataflash", "ulog"])
def test_volery_finds_the_flight_in_them(log: str, request: pytest.FixtureRequest) -> None:
    (flight,) = read_flights(request.getfixturevalue(log)[1])
    found = {one.name: one.stretch for one in phases(flight, by_operations=False)}
    assert {"armed", "take-off", "landing"} <= set(found)
    assert found["mode LAND" if log == "dataflash" else "mode AUTO.LAND"].end == found["armed"].end
    _, north, height = flight.places(np.array([found["landing"].begin]))[0]
    assert (north, height) == pytest.approx((15.0, 12.0), abs=2.0)


def test_an_interrupted_download_an_unknown_log_and_erasing() -> None:
    strip = ArduPilotStrip(logging=True)
    arrived: list[Frame] = []
    strip._pilot.receive(arrived.append)

    def request(name: str, **fields: int) -> list[Frame]:
        del arrived[:]
        strip.station_sends(name, 0.0, **fields)
        sleep(strip.kernel, S)
        return [frame for frame in arrived if frame.name.startswith("LOG_")]

    def mission(drone: Drone) -> None:
        drone.takeoff(3)
        drone.land()
        (entry,) = request("LOG_REQUEST_LIST", start=0, end=0xFFFF)
        size = entry.fields["size"]
        assert request("LOG_REQUEST_LIST", start=2, end=9) == []
        assert request("LOG_REQUEST_DATA", id=2, ofs=0, count=90) == []
        (last,) = request("LOG_REQUEST_DATA", id=1, ofs=size + 5, count=90)
        assert (last.fields["count"], last.fields["ofs"]) == (0, size)
        whole = request("LOG_REQUEST_DATA", id=1, ofs=0, count=0xFFFF_FFFF)
        assert sum(frame.fields["count"] for frame in whole) == size
        strip.station_sends("LOG_REQUEST_END", 0.015)
        assert 0 < len(request("LOG_REQUEST_DATA", id=1, ofs=0, count=0xFFFF_FFFF)) < len(whole)
        request("LOG_ERASE")
        (entry,) = request("LOG_REQUEST_LIST", start=0, end=0xFFFF)
        assert entry.fields["num_logs"] == 0

    strip.fly(mission)


def test_no_log_is_kept_unless_wanted() -> None:
    strip = Px4Strip()

    def mission(drone: Drone) -> list[LogEntry]:
        drone.takeoff(3)
        drone.land()
        return drone.logs.list()

    assert strip.fly(mission) == []
