"""What Rover_Control and Drone_Control share: one job at a time, carried out by the loop of a ROS node."""

from __future__ import annotations

from math import isnan

import rospy
from delivery_types import BUSY, DONE, FAILED, IDLE, VehicleStatus

from volery import VoleryError


class VehicleControl:
    """Takes one job at a time. ``_start`` and ``status`` answer at once, the moving is done by ``run``.

    How a route is followed is said by ``_follow`` of the controller of each kind of vehicle.
    """

    node = ""
    """The name of the ROS node."""

    def __init__(self, vehicle):
        self._vehicle = vehicle
        self._state, self._job, self._outcome = IDLE, "", ""
        self._route = []
        self._position, self._battery = None, 1.0

    def _start(self, job, route):
        """Follow *route* as *job*. False if it cannot now."""
        if self._state != IDLE or not route:
            return False
        self._state, self._job, self._outcome, self._route = BUSY, job, "", list(route)
        return True

    def status(self):
        """How it stands."""
        return VehicleStatus(
            self._vehicle.name, self._state, self._job, self._outcome, self._position, self._battery
        )

    def run(self):
        """The 10 Hz loop of the node."""
        rospy.init_node(self.node)
        rate = rospy.Rate(10)
        self._attempt(self._vehicle.wait_ready)
        while not rospy.is_shutdown():
            if self._state != FAILED:
                self._observe()
            if self._state == BUSY:
                self._carry_out(rate)
            rate.sleep()

    def _carry_out(self, rate):
        if self._attempt(lambda: self._follow(rate)):
            self._outcome, self._state = DONE, IDLE
        else:
            self._make_safe()

    def _attempt(self, doing):
        """Whether it succeeded. If not, the vehicle is out of service."""
        try:
            doing()
        except VoleryError as error:
            rospy.logerr("%s", error)
            self._outcome, self._state = str(error), FAILED
            return False
        return True

    def _observe(self):
        self._position = self._vehicle.position
        remaining = self._vehicle.battery.remaining
        if not isnan(remaining):  # until it was measured
            self._battery = remaining

    def _follow(self, rate):
        """Move along the route to its end."""
        raise NotImplementedError

    def _make_safe(self):
        """What to do with a vehicle whose job failed; one that stands needs nothing."""
