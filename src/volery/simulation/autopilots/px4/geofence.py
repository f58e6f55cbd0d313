"""PX4's geofence: the largest distance and height from home, what a point beyond it is told, and the breach.

Observed with GF_MAX_HOR_DIST and GF_ACTION 3: a DO_REPOSITION beyond the limit is acknowledged as accepted,
AUTO.LOITER is entered, and the vehicle stays where it is; two texts and two events say why. What a breach in
flight does follows the firmware's documentation.
"""

from __future__ import annotations

from math import dist

from volery.base.frames import Vector
from volery.simulation.autopilots.px4 import event_interface
from volery.simulation.autopilots.px4.modes import CRITICAL, commander_of
from volery.simulation.autopilots.vehicle_state import Vehicle

TOO_FAR, TOO_HIGH = "Maximum distance from home reached\t", "Maximum altitude above home reached\t"
OUTSIDE = "Reposition is outside geofence\t"


def breach(vehicle: Vehicle, point: Vector) -> str:
    """Return the text about a point that is outside the geofence, or an empty text.

    Args:
        vehicle: The vehicle; without a home position nothing is outside.
        point: North, east, down about the estimator's origin [m].
    """
    farthest, highest = vehicle.parameters["GF_MAX_HOR_DIST"], vehicle.parameters["GF_MAX_VER_DIST"]
    if vehicle.home is None:
        return ""
    if farthest > 0.0 and dist(point[:2], vehicle.home.ned[:2]) > farthest:
        return TOO_FAR
    if highest > 0.0 and vehicle.home.ned[2] - point[2] > highest:
        return TOO_HIGH
    return ""


def admits(vehicle: Vehicle, point: Vector) -> bool:
    """Return whether a reposition may go to that point, and report where it may not.

    Without GF_ACTION there is no geofence.
    """
    said = breach(vehicle, point) if vehicle.parameters["GF_ACTION"] else ""
    if not said:
        return True
    vehicle.send_text(CRITICAL, said)
    if said == TOO_FAR:
        commander_of(vehicle).log.send(event_interface.FENCE_DISTANCE)
    vehicle.send_text(CRITICAL, OUTSIDE)
    commander_of(vehicle).log.send(event_interface.REPOSITION_OUTSIDE)
    return False
