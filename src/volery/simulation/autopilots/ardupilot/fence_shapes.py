"""Polygons and circles of ArduPilot's fence, seen from above, that a vehicle stays inside or outside of."""

from __future__ import annotations

from itertools import pairwise
from math import hypot
from typing import NamedTuple

from volery.simulation.autopilots.ardupilot.fence_points import (
    CIRCLE_EXCLUSION,
    CIRCLE_INCLUSION,
    EXCLUSION,
    FENCE,
    INCLUSION,
)
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

Level = tuple[float, float]
"""North and east about the estimator's origin [m], or a velocity likewise [m/s]."""


class FencePolygon(NamedTuple):
    """A polygon.

    Args:
        corners: Its corners; the last is joined to the first.
        inside: Whether the vehicle stays inside; else outside.
    """

    corners: tuple[Level, ...]
    inside: bool

    def admits(self, place: Level) -> bool:
        """Return whether the vehicle may be at *place*."""
        within = False
        for (north, east), (before_north, before_east) in self.edges():
            if (east > place[1]) != (before_east > place[1]):
                along = (place[1] - east) / (before_east - east)
                within ^= place[0] < north + along * (before_north - north)
        return within == self.inside

    def edges(self) -> list[tuple[Level, Level]]:
        """Return the two ends of each edge."""
        return list(pairwise((*self.corners, self.corners[0])))


class FenceCircle(NamedTuple):
    """A circle.

    Args:
        centre: Its centre.
        radius: Its radius [m].
        inside: Whether the vehicle stays inside; else outside.
    """

    centre: Level
    radius: float
    inside: bool

    def admits(self, place: Level) -> bool:
        """Return whether the vehicle may be at *place*."""
        away = hypot(place[0] - self.centre[0], place[1] - self.centre[1])
        return (away <= self.radius) == self.inside


Shape = FencePolygon | FenceCircle


def shapes(vehicle: AutopilotVehicle) -> list[Shape]:
    """Return the polygons and circles that were uploaded, in their order."""
    found: list[Shape] = []
    corners: list[Level] = []
    for item in vehicle.points.get(FENCE, []):
        north, east, _ = vehicle.point(item.frame, item.x / 1e7, item.y / 1e7, item.z)
        if item.command in (CIRCLE_INCLUSION, CIRCLE_EXCLUSION):
            found.append(FenceCircle((north, east), item.param1, item.command == CIRCLE_INCLUSION))
        elif item.command in (INCLUSION, EXCLUSION):
            corners.append((north, east))
            if len(corners) == round(item.param1):
                found.append(FencePolygon(tuple(corners), item.command == INCLUSION))
                corners = []
    return found
