"""A recorded flight as PX4's ULog: definitions, parameters, then the samples in time.

Topics and fields are those of PX4 1.14 that log reviews and pyulog read by name; source: the format's
description in PX4's user guide ("ULog File Format").
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from volery.base.frames import euler_to_quaternion
from volery.simulation.autopilots.autopilot_parameters import REAL32
from volery.simulation.autopilots.onboard_log import FlightLog, LogSample

_MAGIC = b"ULog\x01\x12\x35\x01"
NAV_STATES = {
    (1, 0): 0,
    (2, 0): 1,
    (3, 0): 2,
    (4, 4): 3,
    (4, 3): 4,
    (4, 5): 5,
    (5, 0): 10,
    (6, 0): 14,
    (7, 0): 15,
    (4, 2): 17,
    (4, 6): 18,
    (4, 8): 19,
    (3, 1): 21,
}
"""Main mode and sub-mode of ``custom_mode`` to ``nav_state`` of VehicleStatus."""
DISARMED, ARMED = 1, 2
"""``arming_state`` of VehicleStatus."""


class _Topic(NamedTuple):
    """A topic: its number, its name, its fields without padding, and the ``struct`` format of these."""

    number: int
    name: str
    fields: str
    form: str

    def row(self, time_us: int, *values: float) -> bytes:
        return _message(b"D", struct.pack("<HQ" + self.form, self.number, time_us, *values))


ATTITUDE = _Topic(0, "vehicle_attitude", "float[4] q", "4f")
RATES = _Topic(1, "vehicle_angular_velocity", "float[3] xyz", "3f")
LOCAL = _Topic(
    2, "vehicle_local_position", "float x;float y;float z;float vx;float vy;float vz;float heading", "7f"
)
GLOBAL = _Topic(3, "vehicle_global_position", "double lat;double lon;float alt", "ddf")
STATUS = _Topic(4, "vehicle_status", "uint8_t arming_state;uint8_t nav_state", "BB")
BATTERY = _Topic(
    5, "battery_status", "float voltage_v;float current_a;float discharged_mah;float remaining", "4f"
)
SATELLITES = _Topic(6, "vehicle_gps_position", "float hdop;uint8_t fix_type;uint8_t satellites_used", "fBB")
TOPICS = (ATTITUDE, RATES, LOCAL, GLOBAL, STATUS, BATTERY, SATELLITES)


def _message(kind: bytes, content: bytes) -> bytes:
    return struct.pack("<Hc", len(content), kind) + content


def _keyed(kind: bytes, key: str, value: bytes) -> bytes:
    return _message(kind, bytes([len(key)]) + key.encode() + value)


def _information(name: str, text: str) -> bytes:
    return _keyed(b"I", f"char[{len(text)}] {name}", text.encode())


def encode(log: FlightLog) -> bytes:
    """Return a log in ULog format."""
    samples = list(log.samples())
    start = round(samples[0].time_us) if samples else 0
    out = [_MAGIC + struct.pack("<Q", start), _message(b"B", bytes(40))]
    out += [_information("sys_name", "PX4"), _information("ver_sw_release_str", "v1.14.0")]
    out += [_message(b"F", f"{topic.name}:uint64_t timestamp;{topic.fields};".encode()) for topic in TOPICS]
    for parameter in log.parameters:
        real = parameter.type == REAL32
        value = struct.pack("<f", parameter.value) if real else struct.pack("<i", int(parameter.value))
        out.append(_keyed(b"P", f"{'float' if real else 'int32_t'} {parameter.name}", value))
    out += [_message(b"A", struct.pack("<BH", 0, topic.number) + topic.name.encode()) for topic in TOPICS]
    for sample in samples:
        out += _rows(sample)
    if samples:
        last = samples[-1]
        out.append(STATUS.row(round(last.time_us), DISARMED, _nav_state(last)))
    return b"".join(out)


def _nav_state(sample: LogSample) -> int:
    number = int(sample.mode)
    return NAV_STATES[number >> 16 & 0xFF, number >> 24 & 0xFF]


def _rows(one: LogSample) -> list[bytes]:
    time = round(one.time_us)
    place = one.north, one.east, one.down, one.v_north, one.v_east, one.v_down, one.yaw
    return [
        ATTITUDE.row(time, *euler_to_quaternion(one.roll, one.pitch, one.yaw)),
        RATES.row(time, one.roll_rate, one.pitch_rate, one.yaw_rate),
        LOCAL.row(time, *place),
        GLOBAL.row(time, one.latitude, one.longitude, one.amsl),
        STATUS.row(time, ARMED, _nav_state(one)),
        BATTERY.row(time, one.volts, one.amps, one.used_mah, one.left),
        SATELLITES.row(time, one.hdop, int(one.fix), int(one.satellites)),
    ]
