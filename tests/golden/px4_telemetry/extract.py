"""Extract from recordings of PX4 what its driver listens to and what brought a change.

    python tests/golden/px4_telemetry/extract.py FOLDER

FOLDER holds the telemetry logs (8-byte big-endian microseconds, then a MAVLink frame). Writes one file of
``[milliseconds, message, fields]`` for each, beside this file. Positions and set-points are thinned.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from volery.links.tlog import read_tlog

STATION = 255
THINNED_MS = {"GLOBAL_POSITION_INT": 1000, "ATTITUDE": 10_000, "SYS_STATUS": 1000}
KEPT = {
    "HEARTBEAT": ("custom_mode", "type", "autopilot", "base_mode", "system_status"),
    "GLOBAL_POSITION_INT": ("lat", "lon", "alt", "relative_alt", "vx", "vy", "vz", "hdg"),
    "SYS_STATUS": (
        "onboard_control_sensors_health",
        "voltage_battery",
        "current_battery",
        "battery_remaining",
    ),
    "ESTIMATOR_STATUS": ("flags",),
    "EXTENDED_SYS_STATE": ("landed_state",),
    "HOME_POSITION": ("latitude", "longitude", "altitude"),
    "GPS_RAW_INT": ("fix_type", "satellites_visible"),
    "STATUSTEXT": ("severity", "text", "id", "chunk_seq"),
    "EVENT": ("id", "sequence", "log_levels", "arguments"),
    "COMMAND_ACK": ("command", "result"),
    "MISSION_CURRENT": ("seq", "mission_state"),
    "MISSION_ITEM_REACHED": ("seq",),
}
NAMES = {
    "auto-gcs": "px4-1.14-auto-gcs",
    "manual-gcs": "px4-1.14-manual-gcs",
    "offboard-api": "px4-1.14-offboard-api",
    "guided-1.17": "px4-1.17-guided",
}
UNTIL_MS = {"offboard-api": 150_000}


def extract(path: Path, until: int) -> Iterator[list[Any]]:
    last: dict[str, Any] = {}
    told: dict[str, int] = {}
    start: int | None = None
    for at_us, frame in read_tlog(path):
        start = at_us if start is None else start
        ms = (at_us - start) // 1000
        if frame.system == STATION or frame.name not in KEPT or ms > until:
            continue
        fields = {name: frame.fields[name] for name in KEPT[frame.name]}
        once = frame.name in {"STATUSTEXT", "EVENT", "COMMAND_ACK"}
        if not once and last.get(frame.name) == fields:
            continue
        if ms - told.get(frame.name, -100_000) < THINNED_MS.get(frame.name, 0):
            continue
        last[frame.name], told[frame.name] = fields, ms
        if frame.name == "EVENT":
            fields["arguments"] = list(fields["arguments"][:5])
        yield [ms, frame.name, fields]


def main(folder: Path) -> None:
    for name, recording in NAMES.items():
        rows = extract(folder / f"{recording}.tlog", UNTIL_MS.get(name, 10**9))
        lines = ",\n".join(json.dumps(row, separators=(",", ":")) for row in rows)
        (Path(__file__).parent / f"{name}.json").write_text(f"[\n{lines}\n]\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
