"""Rover_Control: drives one rover along a route.

A ROS node: all that it knows of the rover, and all that it makes it do, goes over topics and services with
MAVROS's names.
"""

from __future__ import annotations

from math import isnan

import rospy
from delivery_types import BUSY, DONE, FAILED, IDLE, VehicleStatus

from volery import VoleryError


class RoverControl:
    """Takes one job at a time. ``drive`` and ``status`` answer at once, the driving is done by ``run``."""

    def __init__(self, rover):
        self._rover = rover
        self._state, self._job, self._outcome = IDLE, "", ""
        self._route = []
        self._position, self._battery = None, 1.0

    def drive(self, job, route):
        """Drive *route* as *job*. False if it cannot now."""
        if self._state != IDLE or not route:
            return False
        self._state, self._job, self._outcome, self._route = BUSY, job, "", list(route)
        return True

    def status(self):
        """How it stands."""
        return VehicleStatus(
            self._rover.name, self._state, self._job, self._outcome, self._position, self._battery
        )

    def run(self):
        """The 10 Hz loop of the node."""
        rospy.init_node("rover_control")
        rate = rospy.Rate(10)
        self._attempt(self._rover.wait_ready)
        while not rospy.is_shutdown():
            if self._state != FAILED:
                self._observe()
            if self._state == BUSY and self._attempt(self._drive_route):
                self._outcome, self._state = DONE, IDLE
            rate.sleep()

    def _attempt(self, doing):
        """Whether it succeeded. If not, the rover is out of service."""
        try:
            doing()
        except VoleryError as error:
            rospy.logerr("%s", error)
            self._outcome, self._state = str(error), FAILED
            return False
        return True

    def _observe(self):
        self._position = self._rover.position
        remaining = self._rover.battery.remaining
        if not isnan(remaining):  # until it was measured
            self._battery = remaining

    def _drive_route(self):
        for point in self._route:
            self._rover.drive(point)
            self._observe()
