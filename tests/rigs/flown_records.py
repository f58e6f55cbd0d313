"""One flight of a known shape in every kind of record: a run folder, a tlog, a DataFlash log, a ULog.

Armed from 5 s to 50 s, it climbs from 8 s on, flies 20 m north from 20 s to 30 s with the nose down, has
turned to the east by then, and descends from 35 s on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path

import numpy as np

from rigs.flight_log_files import dataflash, tlog, ulog
from volery.base.frames import euler_to_quaternion
from volery.base.time import MS
from volery.links.frame import Frame
from volery.trace.attachments import RunSetup, VehicleSetup
from volery.trace.events import Operation, Text, VehicleState
from volery.trace.mcap_writer import McapWriter

STEP_S, END_S = 0.1, 60.0
ARMED, DISARMED = 5.0, 50.0
HEIGHT_M, NORTH_M, NOSE_DOWN = 10.0, 20.0, -5.0
GUIDED, LAND = 4, 9
SAID = "EKF3 IMU0 is using GPS"


@dataclass(frozen=True)
class Shape:
    """What a flight may differ in: rate of the climb [m/s], metres east at its end, what else is said."""

    climb_m_s: float = 2.0
    east_m: float = 0.0
    also_said: str = ""

    def rows(self) -> list[tuple[float, ...]]:
        """Return time, east, north, up [m], roll, pitch, heading [deg], speed [m/s] and battery [%]."""
        times = np.arange(0.0, END_S, STEP_S)
        climb = np.clip((times - 8.0) * self.climb_m_s, 0.0, HEIGHT_M)
        up = climb - np.clip(times - 35.0, 0.0, HEIGHT_M)
        way = np.clip((times - 20.0) / 10.0, 0.0, 1.0)
        east, north = way * self.east_m, way * NORTH_M
        pitch = np.where((way > 0.0) & (way < 1.0), NOSE_DOWN, 0.0)
        heading = 90.0 * way
        speed = np.hypot(
            np.hypot(np.gradient(east, times), np.gradient(north, times)), np.gradient(up, times)
        )
        columns = (times, east, north, up, 0.0 * times, pitch, heading, speed, 100.0 - times / 2.0)
        return [tuple(row) for row in np.array(columns).T.tolist()]


def _mode(time: float) -> int:
    return GUIDED if time < 35.0 else LAND


def _is_armed(time: float) -> bool:
    return ARMED <= time < DISARMED


def _texts(shape: Shape) -> list[tuple[float, str]]:
    return [(2.0, SAID), *([(12.0, shape.also_said)] if shape.also_said else [])]


def write_run(
    folder: Path, shape: Shape = Shape(), operations: Sequence[tuple[str, float, float]] = ()
) -> Path:
    """Write a run folder with a trace; *operations* are names, begins and ends [s]."""
    folder.mkdir()
    setup = RunSetup("flight", "code", vehicles=(VehicleSetup("drone", "ardupilot", "multirotor"),))
    writer = McapWriter(folder / "trace.mcap", setup)
    for time, east, north, up, roll, pitch, heading, speed, battery in shape.rows():
        attitude = euler_to_quaternion(radians(roll), radians(-pitch), radians(90.0 - heading))
        place = east + 500.0, north - 200.0, up + 3.0  # the place of arming is not the world's origin
        at, volts = round(time * 1000) * MS, (12.0, 1.0)
        mode = "GUIDED" if _mode(time) == GUIDED else "LAND"
        moves = 0.0, speed, 0.0
        writer(
            VehicleState(
                at, "drone", *place, *attitude, *moves, *place, battery / 100.0, *volts, _is_armed(time), mode
            )
        )
    for time, text in _texts(shape):
        writer(Text(round(time * 1000) * MS, "drone", 6, text))
    for name, begin, end in operations:
        errors = (0.0,) * 4
        when = round(begin * 1000) * MS, round(end * 1000) * MS
        writer(Operation(*when, "drone", name, f"{name} as asked", "ok", "", *errors))
    writer.outcome("completed", "")
    writer.close()
    return folder


def _degrees(east: float, north: float) -> tuple[float, float]:
    """Return latitude and longitude near 0, 0, where single precision has millimetres."""
    return 0.001 + north / 110_574.0, 0.001 + east / 111_320.0


def write_tlog(path: Path, shape: Shape = Shape(), pace: float = 0.5) -> Path:
    """Write a tlog of a simulator that runs at *pace*; its stamps are those of a station's clock."""
    frames = []
    for index, (time, east, north, up, roll, pitch, heading, speed, battery) in enumerate(shape.rows()):
        arrived, boot = time / pace, 1000 + round(time * 1000)
        if index % 10 == 0:
            base = 217 if _is_armed(time) else 89
            fields = {"type": 2, "autopilot": 3, "base_mode": base, "custom_mode": _mode(time)}
            frames.append((arrived, Frame("HEARTBEAT", fields, 1, 1)))
            left = {"battery_remaining": round(battery)}
            frames.append((arrived, Frame("SYS_STATUS", left, 1, 1)))
        angles = {name: radians(one) for name, one in (("roll", roll), ("pitch", pitch), ("yaw", heading))}
        frames.append((arrived, Frame("ATTITUDE", {"time_boot_ms": boot, **angles}, 1, 1)))
        latitude, longitude = _degrees(east, north)
        place = {"lat": round(latitude * 1e7), "lon": round(longitude * 1e7), "alt": round(900e3 + up * 1e3)}
        moves = {"vx": round(speed * 100.0)}
        fields = {"time_boot_ms": boot, **place, **moves}
        frames.append((arrived, Frame("GLOBAL_POSITION_INT", fields, 1, 1)))
    for time, text in _texts(shape):
        said = {"severity": 6, "text": text, "id": 0, "chunk_seq": 0}
        frames.append((time / pace, Frame("STATUSTEXT", said, 1, 1)))
    frames.append((ARMED / pace, Frame("COMMAND_ACK", {"command": 400, "result": 5}, 1, 1)))
    frames.append((ARMED / pace, Frame("COMMAND_ACK", {"command": 400, "result": 0}, 1, 1)))
    frames.append((35.0 / pace, Frame("COMMAND_ACK", {"command": 22, "result": 2}, 1, 1)))
    return tlog(path, sorted(frames, key=lambda one: one[0]))


def write_dataflash(path: Path, shape: Shape = Shape()) -> Path:
    """Write a DataFlash log of a copter."""
    rows = shape.rows()
    tables = {
        "MODE": ("Mode,ModeNum,Rsn", [(0.0, GUIDED, GUIDED, 0), (35.0, LAND, LAND, 0)]),
        "EV": ("Id", [(ARMED, 10), (DISARMED, 11)]),
        "ATT": ("Roll,Pitch,Yaw", [(one[0], *one[4:7]) for one in rows]),
        "POS": ("Lat,Lng,Alt", [(one[0], *_degrees(one[1], one[2]), one[3]) for one in rows]),
        "GPS": ("Spd,VZ", [(one[0], one[7], 0.0) for one in rows]),
        "BAT": ("RemPct", [(one[0], one[8]) for one in rows]),
        "MAVC": ("Cmd,Res", [(ARMED, 400, 0), (35.0, 22, 2)]),
    }
    return dataflash(path, tables, [(0.0, "ArduCopter V4.6.3"), *_texts(shape)])


def write_ulog(path: Path, shape: Shape = Shape()) -> Path:
    """Write a ULog, with the modes AUTO.LOITER and AUTO.LAND."""
    rows = shape.rows()
    attitudes = [(one[0], *euler_to_quaternion(*map(radians, one[4:7]))) for one in rows]
    places = [(one[0], one[2], one[1], -one[3], one[7], 0.0, 0.0) for one in rows]
    states = [
        (float(time), 2.0 if _is_armed(time) else 1.0, 4.0 if time < 35.0 else 18.0) for time in range(60)
    ]
    tables = {
        "vehicle_attitude": ("float[4] q", attitudes),
        "vehicle_local_position": ("float x;float y;float z;float vx;float vy;float vz", places),
        "vehicle_status": ("float arming_state;float nav_state", states),
        "battery_status": ("float remaining", [(one[0], one[8] / 100.0) for one in rows]),
        "vehicle_command_ack": ("float command;float result", [(ARMED, 400.0, 0.0), (35.0, 22.0, 2.0)]),
    }
    return ulog(path, tables, [(one, f"[module] {text}\t") for one, text in _texts(shape)])
