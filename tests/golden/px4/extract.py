"""Extract the facts that the conformance tests check from recordings of the real firmware.

    PYTHONPATH=tests python tests/golden/px4/extract.py FOLDER

FOLDER holds the telemetry logs (8-byte big-endian microseconds, then a MAVLink frame). Writes
``facts.json`` of the recordings of 1.14 beside this file, and ``replays-1.17.json`` of those of 1.17.
Times are seconds after the boot, worked out from the messages that carry it.
"""

from __future__ import annotations

import json
import sys
from itertools import groupby
from math import isfinite
from pathlib import Path
from typing import Any

from rigs.recordings import Row, changes, first, healthy_at, of, read

ARMED = 128
UNLISTED = 65535
OFFBOARD = 0x00060000
CLOCKS = ("LOCAL_POSITION_NED", "ATTITUDE")  # others say the time of something older


def sent(rows: list[Row], name: str) -> list[Row]:
    return [row for row in rows if row.name == name and row.ours]


def texts(rows: list[Row], start: float = 0.0) -> list[list[Any]]:
    """When, severity, words: pieces joined."""
    found: list[list[Any]] = []
    for row in of(rows, "STATUSTEXT"):
        if row.at < start:
            continue
        if row.fields["chunk_seq"]:
            found[-1][2] += row.fields["text"]
        else:
            found.append([row.at, row.fields["severity"], row.fields["text"]])
    return found


def events(rows: list[Row]) -> list[list[Any]]:
    """When, number, levels, arguments."""
    return [
        [
            row.at,
            row.fields["id"],
            row.fields["log_levels"],
            bytes(row.fields["arguments"]).rstrip(b"\0").hex(),
        ]
        for row in of(rows, "EVENT")
    ]


def streams(rows: list[Row]) -> dict[str, float]:
    """Messages a second, of what comes regularly."""
    rates = {}
    for name in sorted({row.name for row in rows if not row.ours}):
        times = [row.at for row in of(rows, name)]
        if len(times) < 3 or name in (
            "COMMAND_ACK",
            "EVENT",
            "STATUSTEXT",
            "PARAM_VALUE",
            "MISSION_ITEM_REACHED",
        ):
            continue
        mean = (len(times) - 1) / (times[-1] - times[0])
        rates[name] = round(mean, 2)
    return rates


def boot(rows: list[Row]) -> dict[str, Any]:
    healthy = healthy_at(rows)
    return {
        "first_heartbeat": first(rows, "HEARTBEAT"),
        "first": {
            name: first(rows, name) for name in ("ATTITUDE", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED")
        },
        "home": next(row.at for row in of(rows, "HOME_POSITION") if row.fields["z"]),
        "armable": healthy[0],
        "events": [event for event in events(rows) if 1.0 < event[0] < 9.0],
    }


CHATTER = (
    "HEARTBEAT",
    "SET_POSITION_TARGET_LOCAL_NED",
    "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_ATTITUDE_TARGET",
)
CHATTER += ("MANUAL_CONTROL", "PING", "TIMESYNC")


def held(rows: list[Row], name: str) -> list[list[Any]]:
    """From, to, how often, fields: for as long as the same was repeated without a pause."""
    found: list[list[Any]] = []
    for row in sent(rows, name):
        fields = {key: value for key, value in row.fields.items() if value and key != "time_boot_ms"}
        fields = {key: list(value) if isinstance(value, tuple) else value for key, value in fields.items()}
        gap = row.at - found[-1][1] if found else 0.0
        usual = (found[-1][1] - found[-1][0]) / (found[-1][2] - 1) if found and found[-1][2] > 1 else gap
        if found and found[-1][3] == fields and 0.6 * usual - 0.01 < gap < min(1.6, 3.0 * usual + 0.01):
            found[-1][1] = row.at
            found[-1][2] += 1
        else:
            found.append([row.at, row.at, 1, fields])
    return found


def plain(fields: dict[str, Any]) -> dict[str, Any]:
    """Without zeros; what is no number as text, for JSON knows none."""
    kept = {}
    for name, value in fields.items():
        if isinstance(value, float) and not isfinite(value):
            kept[name] = "nan"
        elif value:
            kept[name] = value
    return kept


def replay(rows: list[Row]) -> dict[str, Any]:
    """What the station sent and when, and what came back: enough to send it again to another autopilot."""
    streamed = [name for name in CHATTER if name.startswith("SET_") or name == "MANUAL_CONTROL"]
    return {
        "sent": [
            [row.at, row.name, plain(row.fields)] for row in rows if row.ours and row.name not in CHATTER
        ],
        "held": {name: held(rows, name) for name in streamed if sent(rows, name)},
        "beats": [sent(rows, "HEARTBEAT")[0].at, sent(rows, "HEARTBEAT")[-1].at],
        "acks": [[row.at, row.fields["command"], row.fields["result"]] for row in of(rows, "COMMAND_ACK")],
        "texts": [text for text in texts(rows) if "[logger]" not in text[2]],
        "states": changes(of(rows, "HEARTBEAT"), "base_mode", "custom_mode", "system_status"),
        "landed": changes(of(rows, "EXTENDED_SYS_STATE"), "landed_state"),
        "reached": [
            [seq, len(list(group))]
            for seq, group in groupby(row.fields["seq"] for row in of(rows, "MISSION_ITEM_REACHED"))
        ],
        "requests": [
            [row.name, row.fields["seq"]]
            for row in rows
            if not row.ours and row.name in ("MISSION_REQUEST", "MISSION_REQUEST_INT")
        ],
    }


def said(rows: list[Row], beginning: str, after: float = 0.0) -> float:
    return next(float(at) for at, _, text in texts(rows) if at >= after and text.startswith(beginning))


def commanded(rows: list[Row], number: int, after: float = 0.0, **params: float) -> float:
    return next(
        row.at
        for row in rows
        if row.ours
        and row.at >= after
        and row.name in ("COMMAND_LONG", "COMMAND_INT")
        and row.fields["command"] == number
        and all(row.fields[name] == value for name, value in params.items())
    )


def losses(rows: list[Row]) -> list[dict[str, Any]]:
    """Each time that a stream of set-points ended in OFFBOARD, and was noticed."""
    found = []
    stamps = [row.at for row in rows if row.ours and row.name.startswith("SET_")]
    for at, _, text in texts(rows):
        last = max((stamp for stamp in stamps if stamp < at), default=0.0)
        if text == "Failsafe activated\t" and 1.0 < at - last < 1.2:
            shown = next(
                (
                    row
                    for row in of(rows, "HEARTBEAT")
                    if row.at > at and row.fields["custom_mode"] != OFFBOARD
                ),
                None,
            )
            if shown is not None and shown.at - at < 1.1:
                found.append(
                    {
                        "silence": round(at - last, 3),
                        "shown": round(shown.at - last, 3),
                        "mode": shown.fields["custom_mode"],
                        "status": shown.fields["system_status"],
                    }
                )
    return found


def leg(rows: list[Row]) -> dict[str, float]:
    """50 m north in OFFBOARD."""
    there = next(row for row in held(rows, "SET_POSITION_TARGET_LOCAL_NED") if row[3].get("x", 0.0) > 45.0)
    on_leg = [row for row in of(rows, "LOCAL_POSITION_NED") if there[0] < row.at < there[1]]
    goal = there[3]["x"]
    return {
        "within_half_a_metre": round(
            next(row.at for row in on_leg if row.fields["x"] > goal - 0.5) - there[0], 2
        ),
        "overshoot": round(max(row.fields["x"] for row in on_leg) - goal, 2),
        "peak_speed": round(max(row.fields["vx"] for row in on_leg), 2),
    }


def height(rows: list[Row], at: float) -> float:
    return round(
        next(row.fields["relative_alt"] for row in of(rows, "GLOBAL_POSITION_INT") if row.at >= at) / 1000.0,
        2,
    )


def landing(rows: list[Row], start: float) -> dict[str, float]:
    detected = said(rows, "Landing detected", start)
    return {
        "from": height(rows, start),
        "seconds": round(detected - start, 2),
        "to_disarm": round(said(rows, "Disarmed by landing", start) - detected, 2),
    }


def flight(api: list[Row], offboard: list[Row], gcs: list[Row]) -> dict[str, Any]:
    takeoff = commanded(api, 22, 24.0)
    armed = said(api, "Armed", takeoff - 3.0)
    hold = next(
        row.at for row in of(api, "EXTENDED_SYS_STATE") if row.at > armed and row.fields["landed_state"] == 2
    )
    home = commanded(gcs, 20)
    return {
        "takeoff_detected": round(said(api, "Takeoff detected") - armed, 2),
        "takeoff": round(hold - armed, 2),
        "hover_after_10_m": height(api, hold + 10.0),
        "leg": leg(api),
        "landings": [
            landing(api, commanded(api, 176, 100.0, param2=4.0, param3=6.0)),
            landing(offboard, commanded(offboard, 21)),
        ],
        "rtl": round(said(gcs, "Disarmed by landing", home) - home, 2),
        "sink_without_sticks": sink(offboard),
        "mission": round(said(gcs, "Returning to launch") - said(gcs, "Takeoff detected"), 2),
    }


def sink(rows: list[Row]) -> float:
    """Metres per second down, from the loss with COM_OBL_RC_ACT = 0 until the stream is back."""
    shown = next(
        row.at for row in of(rows, "HEARTBEAT") if row.at > 70.0 and row.fields["custom_mode"] == 0x00030000
    )
    falling = [
        row.fields["vz"] for row in of(rows, "LOCAL_POSITION_NED") if shown + 1.0 < row.at < shown + 10.0
    ]
    return round(sum(falling) / len(falling), 2)


def shown_target(rows: list[Row]) -> dict[str, Any]:
    """Where DO_REPOSITION sent it, where it says next that it goes, and after how many seconds."""
    asked = next(row for row in sent(rows, "COMMAND_INT") if row.fields["command"] == 192)
    shown = next(row for row in of(rows, "POSITION_TARGET_GLOBAL_INT") if row.at > asked.at)
    return {
        "asked": [asked.fields[name] for name in ("x", "y", "z")],
        "shown": [shown.fields[name] for name in ("lat_int", "lon_int", "alt")],
        "after": round(shown.at - asked.at, 2),
    }


def parameters(rows: list[Row]) -> dict[str, Any]:
    values = of(rows, "PARAM_VALUE")
    listed = [row for row in values if row.at < values[0].at + 2.0]
    return {
        "count": listed[0].fields["param_count"],
        "first": [[row.fields["param_id"], row.fields["param_index"]] for row in listed[:3]],
        "seconds": round(listed[-1].at - listed[0].at, 2),
        "types": sorted({row.fields["param_type"] for row in listed}),
        "after_a_set": [
            [row.fields["param_id"], row.fields["param_index"], row.fields["param_value"]]
            for row in values[len(listed) :]
        ],
    }


def main(folder: Path) -> None:
    logs = {
        name: read(folder / f"px4-1.14-{name}.tlog", CLOCKS)
        for name in ("ground-api", "basic-api", "offboard-api", "auto-gcs", "manual-gcs")
    }
    ground, basic, offboard = logs["ground-api"], logs["basic-api"], logs["offboard-api"]
    gcs = logs["auto-gcs"]
    states = [row for rows in logs.values() for row in of(rows, "HEARTBEAT")]
    facts = {
        "modes": sorted({(row.fields["custom_mode"], row.fields["base_mode"]) for row in states}),
        "boot": {name: boot(logs[name]) for name in ("offboard-api", "auto-gcs")},
        "streams": {
            "onboard": streams([row for row in ground if row.at > 9.0]),
            "station": streams([row for row in gcs if row.at > 20.0]),
        },
        "flight": flight(basic, offboard, gcs),
        "target": shown_target(gcs),
        "losses": losses(basic) + losses(offboard),
        "parameters": parameters(gcs),
        "version": plain(
            {
                name: list(value) if isinstance(value, tuple) else value
                for name, value in of(basic, "AUTOPILOT_VERSION")[0].fields.items()
            }
        ),
        "events": {
            name: [event[1:] for event in events(rows) if event[0] > 9.0] for name, rows in logs.items()
        },
        "replays": {name: replay(rows) for name, rows in logs.items()},
    }
    newer = {
        name: replay(read(folder / f"px4-1.17-{name}.tlog", CLOCKS))
        for name in ("guided", "mission", "edges")
    }
    at = Path(__file__).with_name("replays-1.17.json")
    at.write_text(json.dumps(newer, allow_nan=False) + "\n", encoding="utf-8")
    target = Path(__file__).with_name("facts.json")
    target.write_text(json.dumps(facts, indent=1, allow_nan=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
