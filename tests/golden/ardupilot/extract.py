"""Extract the facts that the conformance tests check from recordings of the real firmware.

    PYTHONPATH=tests python tests/golden/ardupilot/extract.py FOLDER

FOLDER holds the telemetry logs (8-byte big-endian microseconds, then a MAVLink frame). Writes
``facts.json`` of 4.5.6 and ``replays-4.8.json`` beside this file. Times are seconds after the boot, from
the messages that carry it.
"""

from __future__ import annotations

import json
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

from rigs.recordings import STATION, Row, changes, first, healthy_at, of, read

UNLISTED = 65535
ARMED = 128


def boot(rows: list[Row]) -> dict[str, Any]:
    healthy = healthy_at(rows)
    unlisted = [
        row for row in of(rows, "PARAM_VALUE") if row.fields["param_index"] == UNLISTED and row.at < 42.5
    ]
    return {
        "texts": [
            [row.at, row.fields["severity"], row.fields["text"]]
            for row in of(rows, "STATUSTEXT")
            if row.at < 42.5
        ],
        "parameters": [[row.at, row.fields["param_id"]] for row in unlisted],
        "heartbeats": changes(of(rows, "HEARTBEAT")[:8], "base_mode", "custom_mode", "system_status"),
        "first_heartbeat": of(rows, "HEARTBEAT")[0].at,
        "ekf_flags": changes([row for row in of(rows, "EKF_STATUS_REPORT") if row.at < 45.0], "flags"),
        "gps_fix": changes(of(rows, "GPS_RAW_INT")[:400], "fix_type"),
        "sensors": changes(
            [row for row in of(rows, "SYS_STATUS") if row.at < 43.0],
            "onboard_control_sensors_present",
            "onboard_control_sensors_enabled",
            "onboard_control_sensors_health",
        ),
        "home": first(rows, "HOME_POSITION"),
        "local_position": first(rows, "LOCAL_POSITION_NED"),
        "armable": healthy[0] if healthy else None,
        "time_requests": [row.at for row in of(rows, "TIMESYNC")[:3]],
    }


def streams(rows: list[Row]) -> dict[str, Any]:
    late = [row for row in rows if row.system == 1 and row.at > 45.0]
    names = list(dict.fromkeys(row.name for row in late))
    rates = {}
    for name in names:
        times = [row.at for row in late if row.name == name]
        if len(times) > 40:
            rates[name] = round((len(times) - 1) / (times[-1] - times[0]), 1)
    return rates


def unasked(rows: list[Row]) -> list[str]:
    """What is sent before anything was asked for."""
    asked = next(row.at for row in rows if row.system == STATION and row.name != "HEARTBEAT")
    return sorted({row.name for row in rows if row.system == 1 and row.at < asked})


SENT = (
    "PARAM_REQUEST_LIST",
    "COMMAND_LONG",
    "PARAM_SET",
    "PARAM_REQUEST_READ",
    "SET_POSITION_TARGET_GLOBAL_INT",
    "REQUEST_DATA_STREAM",
)
HEARD = ("COMMAND_ACK", "STATUSTEXT", "HEARTBEAT", "MISSION_ITEM_REACHED")


def replay(rows: list[Row], streamed: tuple[str, ...] = ()) -> dict[str, Any]:
    """What the station sent and when, and what came back: enough to send it again to another autopilot."""
    return {
        "sent": [
            [row.at, row.name, {name: value for name, value in row.fields.items() if value}]
            for row in rows
            if row.system == STATION
            and (row.name in SENT or row.name.startswith("MISSION") or row.name in streamed)
        ],
        "beats": [row.at for row in rows if row.system == STATION and row.name == "HEARTBEAT"],
        "sticks": held_sticks(rows),
        "acks": [[row.at, row.fields["command"], row.fields["result"]] for row in of(rows, "COMMAND_ACK")],
        "texts": [[row.at, row.fields["severity"], row.fields["text"]] for row in of(rows, "STATUSTEXT")],
        "states": changes(of(rows, "HEARTBEAT"), "base_mode", "custom_mode", "system_status"),
        "reached": [[row.at, row.fields["seq"]] for row in of(rows, "MISSION_ITEM_REACHED")],
    }


def held_sticks(rows: list[Row]) -> list[list[Any]]:
    """From, to, pulses of the first four channels, for as long as they were repeated without a gap."""
    held: list[list[Any]] = []
    for row in rows:
        if row.system != STATION or row.name != "RC_CHANNELS_OVERRIDE":
            continue
        pulses = [row.fields[f"chan{number}_raw"] for number in range(1, 5)]
        if held and held[-1][2] == pulses and row.at - held[-1][1] < 1.0:
            held[-1][1] = row.at
        else:
            held.append([row.at, row.at, pulses])
    return held


def modes(rows: list[Row]) -> list[list[int]]:
    """custom_mode, base_mode: every pair that was seen."""
    return sorted({(row.fields["custom_mode"], row.fields["base_mode"]) for row in of(rows, "HEARTBEAT")})


def height(rows: list[Row], start: float, metres: float) -> float:
    return next(
        row.at
        for row in of(rows, "GLOBAL_POSITION_INT")
        if row.at > start and row.fields["relative_alt"] >= metres * 1000.0
    )


def text_at(rows: list[Row], beginning: str, after: float = 0.0) -> float:
    return next(
        row.at
        for row in of(rows, "STATUSTEXT")
        if row.at >= after and row.fields["text"].startswith(beginning)
    )


def sent(rows: list[Row], name: str, **fields: float) -> list[float]:
    return [
        row.at
        for row in rows
        if row.system == STATION
        and row.name == name
        and all(row.fields[key] == value for key, value in fields.items())
    ]


def guided(rows: list[Row]) -> dict[str, Any]:
    """Take-off to 10 m, 50 m north, landing."""
    takeoff = sent(rows, "COMMAND_LONG", command=22)[0]
    leg = sent(rows, "SET_POSITION_TARGET_GLOBAL_INT")[0]
    land = sent(rows, "COMMAND_LONG", command=176, param2=9)[0]
    disarmed = text_at(rows, "Disarming motors")
    touched = text_at(rows, "SIM Hit ground")
    on_leg = [row for row in of(rows, "LOCAL_POSITION_NED") if leg < row.at < land]
    outside = [row.at for row in on_leg if abs(row.fields["x"] - 50.0) > 0.3]
    states = changes(of(rows, "EXTENDED_SYS_STATE"), "landed_state")
    return {
        "lift_off": round(height(rows, takeoff, 0.2) - takeoff, 2),
        "up_to_9_5_m": round(height(rows, takeoff, 9.5) - takeoff, 2),
        "leg_settled": round(outside[-1] - leg, 2),
        "leg_peak_speed": round(max(row.fields["vx"] for row in on_leg), 2),
        "leg_overshoot": round(max(row.fields["x"] for row in on_leg) - 50.0, 2),
        "land_to_disarm": round(disarmed - land, 2),
        "touch_down_to_disarm": round(disarmed - touched, 2),
        "landed_states": [[round(state[0] - takeoff, 2), state[1]] for state in states],
        "status_active": round(
            next(
                row.at
                for row in of(rows, "HEARTBEAT")
                if row.at > takeoff and row.fields["system_status"] == 4
            )
            - takeoff,
            2,
        ),
    }


def failsafe(rows: list[Row]) -> dict[str, Any]:
    beats = sent(rows, "HEARTBEAT")
    tripped = text_at(rows, "GCS Failsafe")
    cleared = text_at(rows, "GCS Failsafe Cleared")
    last = max(beat for beat in beats if beat < tripped)
    again = min(beat for beat in beats if beat > tripped)
    after = [row for row in of(rows, "HEARTBEAT") if row.at >= tripped - 0.01]
    return {
        "silence": round(tripped - last, 2),
        "cleared_after": round(cleared - again, 2),
        "mode": after[0].fields["custom_mode"],
        "status": after[0].fields["system_status"],
        "mode_after_cleared": next(row for row in after if row.at > cleared).fields["custom_mode"],
        "texts": [row.fields["text"] for row in of(rows, "STATUSTEXT") if "Failsafe" in row.fields["text"]],
    }


def sticks(rows: list[Row]) -> dict[str, Any]:
    overrides = [row for row in rows if row.system == STATION and row.name == "RC_CHANNELS_OVERRIDE"]
    gaps = [
        (before, after)
        for before, after in pairwise(overrides)
        if after.at - before.at > 3.0 and before.fields["chan1_raw"] == 1600
    ]
    last = gaps[0][0].at
    fell = next(
        row.at for row in of(rows, "RC_CHANNELS") if row.at > last and row.fields["chan1_raw"] != 1600
    )
    disarmed = text_at(rows, "Disarming motors")
    return {
        "override_timeout": round(fell - last, 2),
        "transmitter": [of(rows, "RC_CHANNELS")[0].fields[f"chan{number}_raw"] for number in range(1, 17)],
        "disarm_after_touch_down": round(disarmed - text_at(rows, "SIM Hit ground"), 2),
        "responses": responses(rows, overrides),
    }


def responses(rows: list[Row], overrides: list[Row]) -> list[dict[str, Any]]:
    """Sticks held for at least 1.5 s in the air, and what the vehicle did at the end."""
    held: list[tuple[float, float, tuple[int, ...]]] = []
    for row in overrides:
        pulses = tuple(row.fields[f"chan{number}_raw"] for number in range(1, 5))
        if held and held[-1][2] == pulses:
            held[-1] = (held[-1][0], row.at, pulses)
        else:
            held.append((row.at, row.at, pulses))
    found = []
    for start, end, pulses in held:
        if end - start < 1.4 or not 92.0 < start < 160.0:
            continue
        now = [row for row in rows if row.system == 1 and start < row.at <= end]
        beat = [row for row in of(rows, "HEARTBEAT") if row.at <= end][-1].fields["custom_mode"]
        attitude, position = of(now, "ATTITUDE")[-1].fields, of(now, "LOCAL_POSITION_NED")[-1].fields
        turned = of(now, "ATTITUDE")[-1].fields["yawspeed"]
        found.append(
            {
                "mode": beat,
                "pulses": list(pulses),
                "seconds": round(end - start, 2),
                "roll": round(attitude["roll"], 3),
                "pitch": round(attitude["pitch"], 3),
                "yaw_rate": round(turned, 3),
                "climb": round(-position["vz"], 3),
            }
        )
    return found


def mission(rows: list[Row]) -> dict[str, Any]:
    kinds = {
        "MISSION_COUNT",
        "MISSION_REQUEST",
        "MISSION_ITEM_INT",
        "MISSION_ACK",
        "MISSION_REQUEST_LIST",
        "MISSION_REQUEST_INT",
    }
    talk = [row for row in rows if row.name in kinds]
    start = text_at(rows, "Mission: 1")
    events = [
        [round(row.at - start, 1), row.name, row.fields.get("text", row.fields.get("seq"))]
        for row in rows
        if row.system == 1
        and row.at >= start
        and (
            row.name == "MISSION_ITEM_REACHED"
            or (row.name == "STATUSTEXT" and "ission" in row.fields["text"])
        )
    ]
    return {
        "uploaded": [row.fields for row in talk if row.system == STATION and row.name == "MISSION_ITEM_INT"],
        "downloaded": [row.fields for row in talk if row.system == 1 and row.name == "MISSION_ITEM_INT"],
        "talk": [["<" if row.system == 1 else ">", row.name, row.fields.get("seq")] for row in talk],
        "events": events,
        "states": [
            value[1:]
            for value in changes(of(rows, "MISSION_CURRENT"), "seq", "total", "mission_state", "mission_mode")
        ],
        "seconds": round(text_at(rows, "Disarming motors") - start, 1),
    }


def rover(rows: list[Row]) -> dict[str, Any]:
    target = sent(rows, "SET_POSITION_TARGET_GLOBAL_INT")[0]
    velocities = sent(rows, "SET_POSITION_TARGET_LOCAL_NED")
    home = sent(rows, "COMMAND_LONG", command=176, param2=11)[0]
    reached = of(rows, "MISSION_ITEM_REACHED")[0]
    near = [
        row.at
        for row in of(rows, "LOCAL_POSITION_NED")
        if row.at > target and (row.fields["x"] - 50.0) ** 2 + row.fields["y"] ** 2 < 9.0
    ]
    back = [
        row.at
        for row in of(rows, "LOCAL_POSITION_NED")
        if row.at > home and row.fields["x"] ** 2 + row.fields["y"] ** 2 < 9.0
    ]
    return {
        "start": next(
            [row.fields["x"], row.fields["y"]] for row in of(rows, "LOCAL_POSITION_NED") if row.at > target
        ),
        "within_3_m": round(near[0] - target, 2),
        "reached": [round(reached.at - target, 2), reached.fields["seq"]],
        "stale_after": round(text_at(rows, "target not received") - velocities[-1], 2),
        "home_within_3_m": round(back[0] - home, 2),
        "words": [row.fields["text"] for row in of(rows, "STATUSTEXT") if "hrottle" in row.fields["text"]],
    }


def main(folder: Path) -> None:
    logs = {path.stem: read(path) for path in sorted(folder.glob("ardu*.tlog")) if "4.8" not in path.stem}
    copter = {name: rows for name, rows in logs.items() if name.startswith("arducopter")}
    flight = logs["arducopter-guided-flight"]
    refused = logs["arducopter-arm-refused"]
    facts = {
        "source": "ArduCopter and ArduRover 4.5.6, software in the loop, recorded over TCP",
        "boot": {
            "copter": boot(flight),
            "rover": boot(logs["ardurover-drive"]),
            "copter_guided": boot(refused),
        },
        "unasked": unasked(flight),
        "rates": {
            "copter": streams(logs["arducopter-gcs-failsafe"]),
            "copter_10": streams(logs["arducopter-rc-override-stabilize-althold"]),
            "copter_asked": streams(flight),
            "rover": streams(logs["ardurover-drive"]),
        },
        "replays": {
            "arm-refused": replay(refused),
            "takeoff-refused": replay(logs["arducopter-takeoff-refused"]),
            "guided-flight": replay(flight),
            "gcs-failsafe": replay(logs["arducopter-gcs-failsafe"]),
            "params-mission": replay(logs["arducopter-params-mission"]),
            "rover-drive": replay(logs["ardurover-drive"], ("SET_POSITION_TARGET_LOCAL_NED",)),
        },
        "modes": {
            "copter": sorted({pair for rows in copter.values() for pair in modes(rows)}),
            "rover": modes(logs["ardurover-drive"]),
        },
        "guided": guided(flight),
        "failsafe": failsafe(logs["arducopter-gcs-failsafe"]),
        "idle_disarm": round(
            text_at(refused, "Disarming motors", 50.0) - text_at(refused, "Arming motors", 48.5), 2
        ),
        "sticks": sticks(logs["arducopter-rc-override-stabilize-althold"]),
        "mission": mission(logs["arducopter-params-mission"]),
        "rover": rover(logs["ardurover-drive"]),
    }
    newer = {
        "guided": replay(
            read(folder / "arducopter-4.8dev-guided.tlog"),
            ("SET_POSITION_TARGET_LOCAL_NED", "SET_ATTITUDE_TARGET", "COMMAND_INT"),
        )
    }
    at = Path(__file__).with_name("replays-4.8.json")
    at.write_text(json.dumps(newer) + "\n", encoding="utf-8")
    target = Path(__file__).with_name("facts.json")
    lines = ",\n".join(
        f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in facts.items()
    )
    target.write_text("{\n" + lines + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
