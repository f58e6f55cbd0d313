"""Telemetry logs of real firmware, read for their facts: which frame came when after the boot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from volery.links.frame import Frame
from volery.links.tlog import read_tlog

STATION = 255


class Row(NamedTuple):
    """One frame: seconds after boot, who sent it, what it says."""

    at: float
    system: int
    name: str
    fields: dict[str, Any]

    @property
    def ours(self) -> bool:
        """Whether the ground station sent it."""
        return self.system == STATION


def read(path: Path, clocks: Sequence[str] = ()) -> list[Row]:
    """All frames; simulated time drifts against the stamps, so each takes the offset last seen before it.

    *clocks* are the messages whose boot clock is believed; without them every message's is.
    """
    stamped = [(one.at_us / 1e6, one.frame) for one in read_tlog(path)]
    start = stamped[0][0]
    offsets = [_offset(stamp - start, frame, clocks) for stamp, frame in stamped]
    offset = next(filter(None, offsets))
    rows = []
    for (stamp, frame), found in zip(stamped, offsets, strict=True):
        offset = found or offset
        rows.append(Row(round(stamp - start + offset, 3), frame.system, frame.name, frame.fields))
    return rows


def _offset(seconds: float, frame: Frame, clocks: Sequence[str]) -> float:
    """Boot clock less stamp; 0 where the message does not say."""
    boot_ms = frame.fields.get("time_boot_ms", 0)
    if frame.system == STATION or not boot_ms or (clocks and frame.name not in clocks):
        return 0.0
    return float(boot_ms / 1000.0 - seconds)


def of(rows: list[Row], name: str) -> list[Row]:
    """What the vehicle sent of that name."""
    return [row for row in rows if row.name == name and not row.ours]


def first(rows: list[Row], name: str) -> float | None:
    """When the vehicle sent it first."""
    found = of(rows, name)
    return found[0].at if found else None


def changes(rows: list[Row], *names: str) -> list[list[Any]]:
    """When these fields took new values, and which."""
    found: list[list[Any]] = []
    for row in rows:
        values = [row.fields[name] for name in names]
        if not found or found[-1][1:] != values:
            found.append([row.at, *values])
    return found


def healthy_at(rows: list[Row]) -> list[float]:
    """When the arming checks passed."""
    arming = 1 << 28
    health = "onboard_control_sensors_health"
    return [row.at for row in of(rows, "SYS_STATUS") if row.fields[health] & arming]
