"""Drone_Control: flies one drone along a route.

A ROS node: all that it knows of the drone, and all that it makes it do, goes over topics and services with
MAVROS's names. Above the port Precision_Landing takes the drone over.
"""

from __future__ import annotations

from delivery_types import DONE
from vehicle_control import VehicleControl

from volery import AMSL, Position, VoleryError


class DroneControl(VehicleControl):
    """Takes one job at a time. ``fly`` and ``status`` answer at once, the flying is done by ``run``.

    ``pad_east_m`` is where this drone's pad lies at each port.
    """

    node = "drone_control"

    def __init__(self, drone, landing, city, pad_east_m=0.0):
        super().__init__(drone)
        self._drone = drone
        self._landing = landing
        self._frame = city.origin
        self._pad_east_m = pad_east_m

    def fly(self, job, route):
        """Fly *route* as *job* and land at its end. False if it cannot now."""
        return self._start(job, route)

    def _follow(self, rate):
        self._drone.takeoff(self._route[0].altitude.metres - self._frame.amsl)
        for point in self._route[1:-1]:
            self._drone.goto(point)
            self._observe()
        port = self._pad(self._route[-1])
        self._drone.goto(port)
        self._hand_over(port, rate)

    def _make_safe(self):
        if self._drone.flying:
            self._attempt(self._drone.land)

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
