"""Sends the frames of all of ArduPilot's streams to UDP ports, spread over the period, until it is ended.

source.py RATE PORT...
"""

from __future__ import annotations

import socket
import sys
import time

from volery.links.frame import Frame
from volery.links.mavlink_codec import encode

PUBLISHED = ("ATTITUDE", "GPS_RAW_INT", "RC_CHANNELS", "VFR_HUD", "RAW_IMU")
OTHERS = (
    "AHRS2",
    "BATTERY_STATUS",
    "EKF_STATUS_REPORT",
    "GLOBAL_POSITION_INT",
    "LOCAL_POSITION_NED",
    "MEMINFO",
    "MISSION_CURRENT",
    "NAV_CONTROLLER_OUTPUT",
    "POWER_STATUS",
    "SCALED_IMU2",
    "SCALED_PRESSURE",
    "SERVO_OUTPUT_RAW",
    "SYSTEM_TIME",
    "SYS_STATUS",
    "VIBRATION",
)


def send(rate: float, ports: list[int]) -> None:
    """The source: to each of *ports*, spread over the period."""
    names = (*PUBLISHED, *OTHERS)
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    beat = Frame("HEARTBEAT", {"type": 2, "autopilot": 3, "base_mode": 81, "system_status": 3}, 1, 1)
    due, sent = time.monotonic(), 0
    while True:
        if sent % round(rate * len(names)) == 0:
            frames = [beat]
        name = names[sent % len(names)]
        fields = {"time_usec": time.monotonic_ns() // 1000} if name == "RAW_IMU" else {}
        frames.append(Frame(name, fields, 1, 1))
        for frame in frames:
            for port in ports:
                line.sendto(encode(frame, sent), ("127.0.0.1", port))
        frames = []
        sent += 1
        due += 1.0 / (rate * len(names))
        time.sleep(max(0.0, due - time.monotonic()))


if __name__ == "__main__":
    send(float(sys.argv[1]), [int(port) for port in sys.argv[2:]])
