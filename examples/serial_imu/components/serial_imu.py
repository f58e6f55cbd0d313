"""An inertial sensor on a serial port: reads its lines and publishes ``sensor_msgs/Imu`` on ``/serial_imu``.

Damaged lines are counted; ``sensor_lines`` knows what is in one.
"""

from __future__ import annotations

import rospy
import serial
from sensor_lines import numbers_of
from sensor_msgs.msg import Imu

RATE_HZ = 100.0


class SerialImu:
    """``port`` is the device, ``baud`` its speed; the message has the time at which its line was read."""

    def __init__(self, port, baud):
        self._port, self._baud = port, baud
        self.damaged = 0

    def run(self):
        """Read and publish until the end."""
        rospy.init_node("serial_imu")
        readings = rospy.Publisher("/serial_imu", Imu, queue_size=10)
        rate, rest = rospy.Rate(RATE_HZ), b""
        with serial.Serial(self._port, self._baud, timeout=0) as port:
            while not rospy.is_shutdown():
                *lines, rest = (rest + port.read(port.in_waiting)).split(b"\n")
                for line in lines:
                    numbers = numbers_of(line)
                    if numbers is None:
                        self.damaged += 1
                        rospy.logwarn_once("serial_imu: a damaged line: %r", line)
                        continue
                    readings.publish(self._message(numbers))
                rate.sleep()

    def _message(self, numbers):
        message = Imu()
        message.header.stamp, message.header.frame_id = rospy.Time.now(), "serial_imu"
        message.orientation_covariance[0] = -1.0  # it has none
        force, turning = message.linear_acceleration, message.angular_velocity
        force.x, force.y, force.z = numbers[3], -numbers[4], -numbers[5]  # forward, left, up (REP 103)
        turning.x, turning.y, turning.z = numbers[6], -numbers[7], -numbers[8]
        return message
