"""The table of versions, and which of its rows a vehicle is told."""

from __future__ import annotations

import re

import pytest

from volery.vehicles.drivers.ardupilot.versions import COVERAGE as ARDUPILOT
from volery.vehicles.drivers.px4.versions import COVERAGE as PX4
from volery.vehicles.firmware_versions import FirmwareVersion, Meaning, VersionRule, stated_version
from volery.vehicles.tried_versions import OPERATIONS, TABLE, row_of, tried


def test_each_version_that_the_rules_cover_has_a_row() -> None:
    for coverage in (ARDUPILOT, PX4):
        (first, oldest), (_, newest) = coverage.oldest, coverage.newest
        for minor in range(oldest, newest + 1):
            assert row_of(coverage.name, FirmwareVersion(first, minor, 0)) is not None
    assert all(len(row.known) == len(OPERATIONS) for row in TABLE)
    assert {row.autopilot for row in TABLE} == {"ArduPilot", "PX4", "Paparazzi", "DJI"}


@pytest.mark.parametrize(
    ("autopilot", "stated", "said"),
    [
        (
            "PX4",
            0x011100FF,
            r"^PX4 1\.17\.0: PX4 1\.17\.0 \(d6f12ad1c4f7, 2026-11-28\) flown: five-line",
        ),
        ("ArduPilot", 0x04070000, r"^ArduPilot 4\.7\.0-dev: 4\.7 .* read: five-line mission"),
        ("PX4", 0x021E00C0, r"^PX4 2\.30\.0-rc: this version was not tried with this driver$"),
        ("PX4", 0, r"^PX4: it states no version"),
        ("DJI", 0, r"^DJI: Onboard SDK .* reported: five-line mission; read: .*no aircraft was flown by us"),
    ],
)
def test_what_is_said_about_a_version(autopilot: str, stated: int, said: str) -> None:
    assert re.search(said, tried(autopilot, stated_version(stated)))


def test_a_version_that_no_meaning_covers_gets_the_newest() -> None:
    rule = VersionRule("a bit", Meaning((1, 13), "older", ""), Meaning((1, 16), "newer", ""))
    given = {(1, 12): "newer", (1, 13): "older", (1, 15): "older", (1, 16): "newer", (3, 0): "newer"}
    for (major, minor), meaning in given.items():
        assert rule.by(FirmwareVersion(major, minor, 9)) == meaning
    assert rule.by(None) == "newer"
    assert "not covered by this driver, which knows 1.13 to 1.18" in PX4.uncovered(FirmwareVersion(1, 12, 3))
    assert PX4.uncovered(FirmwareVersion(1, 17, 0)) == ""
