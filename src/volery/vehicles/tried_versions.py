"""Which versions of each firmware were tried with this driver, and how: one table for the docs and the tools.

``docs/reference/versions.md`` is made of it; ``volery doctor --vehicle`` and the first line of a connection
name the row that applies.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from volery.vehicles.firmware_versions import FirmwareVersion, MinorVersion


class How(Enum):
    """How something is known; the value is what the page says."""

    FLOWN = "flown"
    """On unmodified firmware, in its own simulator."""
    READ = "read"
    """In the sources of the firmware, or in the definitions of its protocol."""
    REPORTED = "reported"
    """By public reports of others."""
    UNTRIED = "–"


OPERATIONS = (
    "five-line mission",
    "single operations",
    "attitude set-points",
    "plans",
    "parameters",
    "conformance",
)
"""Columns: ``examples/mission.py``; each operation of the API; ``set_attitude`` without a heading; missions,
fences and rally points up and down; get, set, load, save; ``volery vehicle conformance --fly``.
"""


class TriedVersion(NamedTuple):
    """One version of a firmware.

    Args:
        autopilot: name of the autopilot, as telemetry has it.
        series: major and minor number; ``None`` where the vehicle states no version.
        version: the version in words.
        commit: commit of the firmware, or another source.
        date: day of the trial, or of what was read.
        known: how each of ``OPERATIONS`` is known.
        remark: what else is to be said.
    """

    autopilot: str
    series: MinorVersion | None
    version: str
    commit: str
    date: str
    known: Sequence[How]
    remark: str = ""


_FLOWN, _READ, _UNTRIED = How.FLOWN, How.READ, How.UNTRIED
_ALL = (_FLOWN,) * len(OPERATIONS)
_ONLY_READ = (*(_READ,) * (len(OPERATIONS) - 1), _UNTRIED)

TABLE: Sequence[TriedVersion] = (
    TriedVersion("ArduPilot", (4, 5), "ArduCopter, ArduRover 4.5", "main of 2024-01-30", "2026-11-28", _ALL),
    TriedVersion("ArduPilot", (4, 6), "ArduCopter 4.6.3", "92b0cd788e", "2026-11-28", _ALL),
    TriedVersion("ArduPilot", (4, 7), "4.7", "64a9c7877b has all of it", "2026-03-21", _ONLY_READ),
    TriedVersion(
        *("ArduPilot", (4, 8), "ArduCopter, ArduRover 4.8.0-dev", "64a9c7877b", "2026-11-28", _ALL),
        "mission-that-returns failed 1 of 4 times, before its mend",
    ),
    TriedVersion("PX4", (1, 13), "PX4 1.13", "v1.13.0", "2022-06-20", _ONLY_READ, "estimator and modes only"),
    TriedVersion("PX4", (1, 14), "PX4 1.14.3", "1dacb4cdef2d; main of 2023-05-31", "2026-11-28", _ALL),
    TriedVersion("PX4", (1, 15), "PX4 1.15.4", "99c40407ffd7", "2026-11-28", _ALL),
    TriedVersion("PX4", (1, 16), "PX4 1.16.2", "54f0455ffcd7", "2026-11-28", _ALL),
    TriedVersion(
        "PX4",
        (1, 17),
        "PX4 1.17.0",
        "d6f12ad1c4f7",
        "2026-11-28",
        _ALL,
        "1 of 59 checks failed once, before its mend",
    ),
    TriedVersion("PX4", (1, 18), "PX4 1.18", "release/1.18", "2026-07-08", _ONLY_READ, "not released yet"),
    TriedVersion(
        *("Paparazzi", None, "rotorcraft firmware, master", "f19834aaa, pprzlink ac28897", "2026-11-28"),
        (_FLOWN, _FLOWN, _UNTRIED, _UNTRIED, _FLOWN, _FLOWN),
        "in NPS, volery control go by set-points too; settings stand for parameters, blocks of its plan for "
        "missions",
    ),
    TriedVersion(
        *("DJI", None, "Onboard SDK 3.8 and 4.1", "definitions and nodes of both", "2026-11-28"),
        (How.REPORTED, _READ, _READ, _READ, _UNTRIED, _UNTRIED),
        "no aircraft was flown by us",
    ),
)


def row_of(autopilot: str, version: FirmwareVersion | None) -> TriedVersion | None:
    """Return the row of a vehicle; ``None`` if its version is in none, or not stated where others are."""
    series = version.series if version is not None else None
    return next((row for row in TABLE if row.autopilot == autopilot and row.series == series), None)


def tried(autopilot: str, version: FirmwareVersion | None) -> str:
    """Return what is known about a version, in one line.

    Args:
        autopilot: name of the autopilot, as telemetry has it.
        version: what it states; ``None`` if it states none.
    """
    called = f"{autopilot} {version}" if version is not None else autopilot
    row = row_of(autopilot, version)
    if row is None:
        if version is None:
            return f"{called}: it states no version; try it on the ground first"
        return f"{called}: this version was not tried with this driver"
    parts = []
    for how in (How.FLOWN, How.REPORTED, How.READ):
        what = [name for name, known in zip(OPERATIONS, row.known, strict=True) if known is how]
        if what:
            parts.append(f"{how.value}: {', '.join(what)}")
    remark = f" ({row.remark})" if row.remark else ""
    return f"{called}: {row.version} ({row.commit}, {row.date}) {'; '.join(parts)}{remark}"
