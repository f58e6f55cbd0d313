"""Rover_Control: drives one rover along a route.

A ROS node: all that it knows of the rover, and all that it makes it do, goes over topics and services with
MAVROS's names.
"""

from __future__ import annotations

from vehicle_control import VehicleControl


class RoverControl(VehicleControl):
    """Takes one job at a time. ``drive`` and ``status`` answer at once, the driving is done by ``run``."""

    node = "rover_control"

    def __init__(self, rover):
        super().__init__(rover)
        self._rover = rover

    def drive(self, job, route):
        """Drive *route* as *job*. False if it cannot now."""
        return self._start(job, route)

    def _follow(self, rate):
        for point in self._route:
            self._rover.drive(point)
            self._observe()
