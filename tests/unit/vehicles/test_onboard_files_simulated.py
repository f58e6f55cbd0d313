"""Files of the simulated autopilots by MAVLink FTP, over links with and without losses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rigs.airstrip import Airstrip
from volery.base.errors import NotArrived, Refused, UsageError
from volery.links.frame import Frame
from volery.vehicles import Drone
from volery.vehicles.drivers.ardupilot import open_driver as open_ardupilot
from volery.vehicles.drivers.px4 import open_driver as open_px4


class ArduPilotStrip(Airstrip):
    firmware = "ardupilot"
    opener = staticmethod(open_ardupilot)


class Px4Strip(Airstrip):
    firmware = "px4"
    opener = staticmethod(open_px4)


STRIPS: dict[str, tuple[Any, str]] = {"ardupilot": (ArduPilotStrip, "/logs"), "px4": (Px4Strip, "/log")}


def flown(drone: Drone) -> None:
    drone.wait_ready()
    drone.takeoff(5)
    drone.land()


@pytest.mark.parametrize("firmware", STRIPS)
def test_a_log_arrives_by_ftp_as_by_the_log_protocol(firmware: str, tmp_path: Path) -> None:
    strip, folder = STRIPS[firmware]
    shown: list[tuple[int, int]] = []

    def mission(drone: Drone) -> str:
        flown(drone)
        drone.logs.download(drone.logs.list()[0], tmp_path / "by_log")
        assert [entry.name for entry in drone.files.list() if entry.is_folder] == [folder.strip("/")]
        path = folder
        while (first := drone.files.list(path)[0]).is_folder:
            path = f"{path}/{first.name}"
        path = f"{path}/{first.name}"
        drone.files.download(path, tmp_path / "by_ftp", lambda have, size: shown.append((have, size)))
        assert first.size == (tmp_path / "by_ftp").stat().st_size
        return path

    path = strip(logging=True).fly(mission)
    assert (tmp_path / "by_ftp").read_bytes() == (tmp_path / "by_log").read_bytes()
    assert shown[-1][0] == shown[-1][1]
    assert len(shown) == (1 if firmware == "ardupilot" else 2)  # bursts of 119 kB and of 40 kB
    assert path.startswith("/logs/00000001.BIN" if firmware == "ardupilot" else "/log/2026-01-01/00_")


@pytest.mark.parametrize("firmware", STRIPS)
def test_what_a_radio_loses_of_a_file_is_read_again(firmware: str, tmp_path: Path) -> None:
    strip, folder = STRIPS[firmware]

    def mission(drone: Drone) -> None:
        flown(drone)
        drone.logs.download(drone.logs.list()[0], tmp_path / "by_log")
        services: Any = drone._driver.services
        receive, counted = services.receive, [0]

        def lossy(frame: Frame) -> None:
            counted[0] += 1
            if counted[0] % 7:
                receive(frame)

        services.receive = lossy
        path = folder
        while (first := drone.files.list(path)[0]).is_folder:
            path = f"{path}/{first.name}"
        drone.files.download(f"{path}/{first.name}", tmp_path / "by_ftp")

    strip(logging=True).fly(mission)
    assert (tmp_path / "by_ftp").read_bytes() == (tmp_path / "by_log").read_bytes()


def test_a_download_goes_on_where_it_was_ended_and_overwrites_nothing(tmp_path: Path) -> None:
    def mission(drone: Drone) -> bytes:
        flown(drone)
        drone.files.download("/logs/00000001.BIN", tmp_path / "whole")
        whole = (tmp_path / "whole").read_bytes()
        (tmp_path / "half.part").write_bytes(whole[:20_000])
        began: list[int] = []
        drone.files.download("/logs/00000001.BIN", tmp_path / "half", lambda have, _size: began.append(have))
        assert began[0] > 20_000
        (tmp_path / "other.part").write_bytes(bytes(len(whole) + 1))
        drone.files.download("/logs/00000001.BIN", tmp_path / "other")
        with pytest.raises(UsageError, match="half exists; choose another name"):
            drone.files.download("/logs/00000001.BIN", tmp_path / "half")
        return whole

    whole = ArduPilotStrip(logging=True).fly(mission)
    assert (tmp_path / "half").read_bytes() == whole
    assert (tmp_path / "other").read_bytes() == whole


@pytest.mark.parametrize("firmware", STRIPS)
def test_a_missing_file_and_a_wrong_path_are_named(firmware: str, tmp_path: Path) -> None:
    def mission(drone: Drone) -> None:
        drone.wait_ready()
        with pytest.raises(Refused, match=r"open /nothing: there is no such file or folder"):
            drone.files.download("/nothing", tmp_path / "one")
        with pytest.raises(Refused, match=r"list /nothing: there is no such file or folder"):
            drone.files.list("/nothing")
        for wrong in ("", "a" * 240, "a\0b"):
            with pytest.raises(UsageError, match="is no path of a file on board: 1 to 239 bytes"):
                drone.files.list(wrong)
        assert not list(tmp_path.iterdir())

    STRIPS[firmware][0]().fly(mission)


def test_an_autopilot_that_serves_no_files_is_named(tmp_path: Path) -> None:
    def mission(drone: Drone) -> None:
        drone.wait_ready()
        services: Any = drone._driver.services
        services.receive = lambda _frame: None
        with pytest.raises(NotArrived, match=r"list /: no answer within 7\.5 s: it may not serve its files"):
            drone.files.list()

    Px4Strip().fly(mission)
