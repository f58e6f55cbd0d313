"""The loop that a plain bridge is: frames by pymavlink, roscopter's topics by rospy.

    plain.py blocking|asking PORT

``blocking`` waits for frames; ``asking`` asks for them a thousand times a second, as roscopter does.
"""

from __future__ import annotations

import sys

import rospy
from pymavlink import mavutil
from roscopter.msg import RC, VFR_HUD, Attitude, Mavlink_RAW_IMU, State
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import Header


def publish(way: str, port: int) -> None:
    asking = way == "asking"
    rospy.init_node("plain", anonymous=True)
    kinds = {
        "gps": NavSatFix,
        "rc": RC,
        "state": State,
        "vfr_hud": VFR_HUD,
        "attitude": Attitude,
        "raw_imu": Mavlink_RAW_IMU,
    }
    to = {name: rospy.Publisher(f"/{way}/{name}", kind, queue_size=10) for name, kind in kinds.items()}
    master = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    while not rospy.is_shutdown():
        if asking:
            rospy.sleep(0.001)
        message = master.recv_match(blocking=not asking)
        if message is None:
            continue
        kind = message.get_type()
        if kind == "RC_CHANNELS":
            to["rc"].publish([getattr(message, f"chan{number}_raw") for number in range(1, 9)])
        elif kind == "HEARTBEAT":
            armed, guided = bool(message.base_mode & 128), bool(message.base_mode & 8)
            to["state"].publish(armed, guided, mavutil.mode_string_v10(message))
        elif kind == "VFR_HUD":
            hud = (message.airspeed, message.groundspeed, message.heading)
            to["vfr_hud"].publish(*hud, message.throttle, message.alt, message.climb)
        elif kind == "GPS_RAW_INT":
            fix = NavSatStatus(NavSatStatus.STATUS_FIX if message.fix_type >= 3 else -1, 1)
            degrees = {"latitude": message.lat / 1e7, "longitude": message.lon / 1e7}
            to["gps"].publish(NavSatFix(status=fix, altitude=message.alt / 1e3, **degrees))
        elif kind == "ATTITUDE":
            rates = (message.rollspeed, message.pitchspeed, message.yawspeed)
            to["attitude"].publish(message.roll, message.pitch, message.yaw, *rates)
        elif kind == "RAW_IMU":
            measured = [getattr(message, axis + what) for what in ("acc", "gyro", "mag") for axis in "xyz"]
            to["raw_imu"].publish(Header(), message.time_usec, *measured)


if __name__ == "__main__":
    publish(sys.argv[1], int(sys.argv[2]))
