"""Drone_Control: flies one drone along a route.

A ROS node: all that it knows of the drone, and all that it makes it do, goes over topics and services with
MAVROS's names. Above the port Precision_Landing takes the drone over.
"""

from __future__ import annotations

from math import isnan

import rospy
from delivery_types import BUSY, DONE, FAILED, IDLE, VehicleStatus

from volery import AMSL, Position, VoleryError


class DroneControl:
    """Takes one job at a time. ``fly`` and ``status`` answer at once, the flying is done by ``run``.

    ``pad_east_m`` is where this drone's pad lies at each port.
    """

    def __init__(self, drone, landing, city, pad_east_m=0.0):
        self._drone = drone
        self._landing = landing
        self._frame = city.origin
        self._pad_east_m = pad_east_m
        self._state, self._job, self._outcome = IDLE, "", ""
        self._route = []
        self._position, self._battery = None, 1.0

    def fly(self, job, route):
        """Fly *route* as *job* and land at its end. False if it cannot now."""
        if self._state != IDLE or not route:
            return False
        self._state, self._job, self._outcome, self._route = BUSY, job, "", list(route)
        return True

    def status(self):
        """How it stands."""
        return VehicleStatus(
            self._drone.name, self._state, self._job, self._outcome, self._position, self._battery
        )

    def run(self):
        """The 10 Hz loop of the node."""
        rospy.init_node("drone_control")
        rate = rospy.Rate(10)
        self._attempt(self._drone.wait_ready)
        while not rospy.is_shutdown():
            if self._state != FAILED:
                self._observe()
            if self._state == BUSY:
                self._carry_out(rate)
            rate.sleep()

    def _carry_out(self, rate):
        if self._attempt(lambda: self._fly_route(rate)):
            self._outcome, self._state = DONE, IDLE
        elif self._drone.flying:
            self._attempt(self._drone.land)

    def _attempt(self, doing):
        """Whether it succeeded. If not, the drone is out of service."""
        try:
            doing()
        except VoleryError as error:
            rospy.logerr("%s", error)
            self._outcome, self._state = str(error), FAILED
            return False
        return True

    def _observe(self):
        self._position = self._drone.position
        remaining = self._drone.battery.remaining
        if not isnan(remaining):  # until it was measured
            self._battery = remaining

    def _fly_route(self, rate):
        self._drone.takeoff(self._route[0].altitude.metres - self._frame.amsl)
        for point in self._route[1:-1]:
            self._drone.goto(point)
            self._observe()
        port = self._pad(self._route[-1])
        self._drone.goto(port)
        self._hand_over(port, rate)

    def _pad(self, port):
        """The place above this drone's pad at *port*."""
        east, north, up = self._frame.to_enu(port.latitude, port.longitude, port.altitude.metres)
        latitude, longitude, amsl = self._frame.from_enu((east + self._pad_east_m, north, up))
        return Position(latitude, longitude, AMSL(amsl))

    def _hand_over(self, pad, rate):
        """Let Precision_Landing fly until the drone is down."""
        self._landing.take_over(self._job, pad)
        while not (outcome := self._landing.outcome(self._job)):
            self._observe()
            rate.sleep()
        if outcome != DONE:
            raise VoleryError(outcome)
