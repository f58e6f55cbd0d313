"""Hears roscopter's topics under several namespaces; prints ``ready`` when all are there, and in the end the
delays of each, in microseconds, as JSON.

    listener.py SETTLE_S SECONDS NAMESPACE...
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import rospy
from roscopter.msg import RC, VFR_HUD, Attitude, Mavlink_RAW_IMU, State
from sensor_msgs.msg import NavSatFix

TOPICS = {
    "gps": NavSatFix,
    "rc": RC,
    "state": State,
    "vfr_hud": VFR_HUD,
    "attitude": Attitude,
    "raw_imu": Mavlink_RAW_IMU,
}


def listen(settle: float, seconds: float, ways: list[str]) -> None:
    rospy.init_node("listener", anonymous=True)
    delays: dict[str, list[int]] = {way: [] for way in ways}
    received: dict[str, int] = dict.fromkeys(ways, 0)

    def hear(message: Any, which: tuple[str, str]) -> None:
        way, topic = which
        received[way] += 1
        if topic == "raw_imu":
            delays[way].append(time.monotonic_ns() // 1000 - message.time_usec)

    for way in ways:
        for topic, kind in TOPICS.items():
            rospy.Subscriber(f"/{way}/{topic}", kind, hear, (way, topic), tcp_nodelay=True)
    while not all(received.values()):
        time.sleep(0.1)
    time.sleep(settle)
    print("ready", flush=True)
    for way in ways:
        delays[way].clear()
        received[way] = 0
    time.sleep(seconds)
    print(json.dumps({"delays": delays, "received": received}), flush=True)


if __name__ == "__main__":
    listen(float(sys.argv[1]), float(sys.argv[2]), sys.argv[3:])
