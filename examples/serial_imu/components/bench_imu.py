"""The other end of the cable: an inertial sensor that writes lines to a pseudo-terminal.

It measures what the second inertial sensor of the simulated drone does. Every fiftieth line is damaged.
"""

from __future__ import annotations

import os
import pty
import tty
from fcntl import ioctl
from functools import reduce
from pathlib import Path
from struct import unpack
from termios import FIONREAD

import rospy
from sensor_msgs.msg import Imu

DAMAGED_EVERY = 50


class BenchImu:
    """``port`` is the path under which the pseudo-terminal is found."""

    def __init__(self, port):
        self._port = Path(port)
        self._written = 0
        self._own, self._cable = pty.openpty()
        tty.setraw(self._cable)
        if self._port.is_symlink():  # of a run that was killed
            self._port.unlink()
        self._port.symlink_to(os.ttyname(self._cable))

    def run(self):
        """Write a line for each sample until the end."""
        rospy.init_node("bench_imu")
        rospy.Subscriber("/drone/imu_external", Imu, self._write, queue_size=10)
        try:
            rospy.spin()
        finally:
            self._port.unlink()

    def _write(self, message):
        force, turning = message.linear_acceleration, message.angular_velocity
        numbers = (0.2, 0.0, 0.4, force.x, -force.y, -force.z, turning.x, -turning.y, -turning.z, 25.0, 101.3)
        body = "VNIMU," + ",".join(f"{number:+.6f}" for number in numbers)
        checksum = reduce(lambda one, other: one ^ other, body.encode())
        self._written += 1
        if self._written % DAMAGED_EVERY == 0:
            checksum ^= 1
        line = f"${body}*{checksum:02X}\r\n".encode()
        before = self._waiting()
        os.write(self._own, line)
        while self._waiting() < before + len(line):  # the line is on the cable before time goes on
            pass

    def _waiting(self):
        return unpack("i", ioctl(self._cable, FIONREAD, b"\0\0\0\0"))[0]
