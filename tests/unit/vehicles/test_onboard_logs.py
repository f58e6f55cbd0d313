"""Download of a log from an end of the link that keeps one, with losses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rigs.missions import carried_out
from volery.base.errors import UsageError
from volery.base.time import MS
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.vehicles.drivers.mavlink.services import MavlinkServices
from volery.vehicles.onboard_files import OVERLAP
from volery.vehicles.onboard_logs import OnboardLogs
from volery.vehicles.telemetry import Telemetry

LOG = bytes(range(256)) * 100
LOST = 7
"""One message in so many is lost."""


class LogKeeper:
    """The protocol of LOG_REQUEST_*, on the far end of a link."""

    def __init__(self) -> None:
        self.kernel = VirtualKernel()
        self.link, self._end = in_process_pair(self.kernel, 5 * MS)
        self._end.receive(self._receive)
        self._sent = 0
        self.asked: list[Frame] = []
        telemetry = Telemetry(self.kernel, "craft_1")
        services = MavlinkServices(
            self.kernel, telemetry, self._send, self._send, bytewise=False, home_first=True
        )
        self.link.receive(services.receive)
        self.logs = OnboardLogs(telemetry, services)

    def _send(self, name: str, **fields: Any) -> None:
        to = {"target_system": 1, "target_component": 1}
        self.link.send(Frame(name, to | fields, 255, 190))

    def _receive(self, frame: Frame) -> None:
        self.asked.append(frame)
        if frame.name == "LOG_REQUEST_LIST":
            for number, size in ((1, 40), (2, len(LOG))):
                entry = {"id": number, "num_logs": 2, "last_log_num": 2, "time_utc": 1_700_000_000}
                self._answer("LOG_ENTRY", size=size, **entry)
        elif frame.name == "LOG_REQUEST_DATA":
            start = frame.fields["ofs"]
            for at in range(start, start + frame.fields["count"], 90):
                piece = LOG[at : min(at + 90, start + frame.fields["count"])]
                data = list(piece.ljust(90, b"\0"))
                self._answer("LOG_DATA", id=frame.fields["id"], ofs=at, count=len(piece), data=data)

    def _answer(self, name: str, **fields: Any) -> None:
        self._sent += 1
        if self._sent % LOST:
            self._end.send(Frame(name, fields, 1, 1))


def test_a_log_is_downloaded_whole_over_a_link_that_loses_messages(tmp_path: Path) -> None:
    keeper = LogKeeper()
    seen: list[int] = []

    def download() -> Path:
        first, second = keeper.logs.list()
        assert (first.size, second.size) == (40, len(LOG))
        return keeper.logs.download(second, tmp_path / "two.bin", lambda have, _size: seen.append(have))

    path = carried_out(keeper.kernel, download)
    assert path.read_bytes() == LOG
    assert seen[-1] == len(LOG)
    assert keeper.asked[-1].name == "LOG_REQUEST_END"


def test_a_download_goes_on_where_it_was_ended_and_overwrites_nothing(tmp_path: Path) -> None:
    keeper = LogKeeper()
    (tmp_path / "two.bin.part").write_bytes(LOG[:20_000])

    def download() -> None:
        second = keeper.logs.list()[1]
        path = keeper.logs.download(second, tmp_path / "two.bin")
        assert path.read_bytes() == LOG
        with pytest.raises(UsageError, match="exists; choose another name"):
            keeper.logs.download(second, path)

    carried_out(keeper.kernel, download)
    first = next(frame for frame in keeper.asked if frame.name == "LOG_REQUEST_DATA")
    assert first.fields["ofs"] == 20_000 - OVERLAP  # which must be the same
