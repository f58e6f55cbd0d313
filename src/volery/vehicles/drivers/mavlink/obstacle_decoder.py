"""Decoder of the messages of range sensors: DISTANCE_SENSOR and OBSTACLE_DISTANCE.

It is used only where a clearance is stated, so that other flights neither request nor decode them. ArduPilot
sends eight sectors as DISTANCE_SENSOR, PX4 72 as OBSTACLE_DISTANCE.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite, radians
from typing import Any

from volery.base.elementary import cos, sin
from volery.base.frames import Vector
from volery.links.mavlink_messages import constant
from volery.vehicles.telemetry import Telemetry

MESSAGES = ("DISTANCE_SENSOR", "OBSTACLE_DISTANCE")
SECTOR_DEG = 45.0
_LAST_SECTOR = constant("MAV_SENSOR_ROTATION_YAW_315")
_UP = constant("MAV_SENSOR_ROTATION_PITCH_90")
_NORTH_REFERENCED = constant("MAV_FRAME_GLOBAL")
_UNKNOWN_CM = 65535


class ObstacleDecoder:
    """Writes measured distances into telemetry. A sensor that looks down measures the ground: it is left out.

    Args:
        telemetry: telemetry of the vehicle; its heading turns directions from the body into north and east.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self.handlers = {"DISTANCE_SENSOR": self._distance_sensor, "OBSTACLE_DISTANCE": self._sectors}

    def _distance_sensor(self, fields: Mapping[str, Any]) -> None:
        orientation: int = fields["orientation"]
        metres = _metres(fields["current_distance"], fields["max_distance"])
        if orientation <= _LAST_SECTOR:
            self._note("DISTANCE_SENSOR", orientation, self._direction(orientation * SECTOR_DEG), metres)
        elif orientation == _UP:
            self._note("DISTANCE_SENSOR", orientation, (0.0, 0.0, 1.0), metres)

    def _sectors(self, fields: Mapping[str, Any]) -> None:
        step: float = fields["increment_f"] or fields["increment"]
        first: float = fields["angle_offset"]
        if fields["frame"] == _NORTH_REFERENCED:
            first -= self._telemetry.attitude.heading
        for number, distance in enumerate(fields["distances"]):
            direction = self._direction(first + number * step)
            self._note("OBSTACLE_DISTANCE", number, direction, _metres(distance, fields["max_distance"]))

    def _direction(self, degrees: float) -> Vector:
        """Return the unit vector (east, north, up) of an angle to the right of the nose, in degrees."""
        bearing = radians(self._telemetry.attitude.heading + degrees)
        return sin(bearing), cos(bearing), 0.0

    def _note(self, message: str, sector: int, direction: Vector, metres: float) -> None:
        if isfinite(direction[0]):
            self._telemetry.note_obstacle((message, sector), direction, metres)


def _metres(distance: int, largest: int) -> float:
    """Return the distance of an obstacle, m; infinite where none is seen or nothing is known."""
    return distance / 100.0 if 0 < distance < min(largest, _UNKNOWN_CM) else float("inf")
