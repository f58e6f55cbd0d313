"""A flight during which the serial sensor is compared with the autopilot's own."""

from __future__ import annotations

from math import sqrt

import rospy
from mavros_msgs.srv import MessageInterval
from sensor_msgs.msg import Imu

import volery

WINDOW_S = 1.0
"""The two sample at different times: their means over such a time are compared."""
RAW_IMU, RAW_IMU_HZ = 27, 50.0
"""MAVLink's message of the autopilot's own sensor; without a request ArduPilot sends it once a second."""


class Comparison:
    """``most_rad_s`` and ``most_m_s2`` are the root mean square differences up to which the two agree."""

    def __init__(self, drone, most_rad_s, most_m_s2):
        self._drone, self._most = drone, (most_rad_s, most_m_s2)
        self._own, self._serial = [], []
        self._sums, self._windows, self._readings = [0.0, 0.0], 0, 0

    def run(self):
        """Fly a square, then state the differences."""
        rospy.init_node("comparison")
        rospy.Subscriber(f"/{self._drone.name}/imu/data_raw", Imu, lambda one: self._own.append(_values(one)))
        rospy.Subscriber("/serial_imu", Imu, lambda one: self._serial.append(_values(one)))
        rospy.Timer(rospy.Duration(WINDOW_S), self._compare)
        self._drone.wait_ready()
        name = f"/{self._drone.name}/set_message_interval"
        rospy.wait_for_service(name)
        rospy.ServiceProxy(name, MessageInterval)(message_id=RAW_IMU, message_rate=RAW_IMU_HZ)
        self._drone.takeoff(5.0)
        for north, east in ((2.0, 0.0), (0.0, 2.0), (-2.0, 0.0), (0.0, -2.0)):
            self._drone.set_velocity(north, east)
            rospy.sleep(3.0)
        self._drone.land()
        apart = [sqrt(total / max(self._windows, 1)) for total in self._sums]
        agrees = self._windows > 0 and all(one <= most for one, most in zip(apart, self._most, strict=True))
        volery.log(
            f"{self._readings} readings in {self._windows} windows: rates {apart[0]:.4f} rad/s and forces "
            f"{apart[1]:.3f} m/s^2 from the autopilot's own (root mean square)"
        )
        volery.note("imu", "serial", "agrees" if agrees else "differs")

    def _compare(self, _):
        own, self._own = self._own, []
        serial, self._serial = self._serial, []
        if not own or not serial:
            return
        apart = [one - other for one, other in zip(_means(serial), _means(own), strict=True)]
        self._sums[0] += sum(value * value for value in apart[:3])
        self._sums[1] += sum(value * value for value in apart[3:])
        self._windows += 1
        self._readings += len(serial)


def _values(message):
    turning, force = message.angular_velocity, message.linear_acceleration
    return turning.x, turning.y, turning.z, force.x, force.y, force.z


def _means(rows):
    return [sum(column) / len(rows) for column in zip(*rows, strict=True)]
