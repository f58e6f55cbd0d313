"""When an obstacle ends an operation: a range sensor measures it nearer than the clearance.

The counterpart of the bumper of the MRS UAV System (Baca et al., J. Intell. Robot. Syst. 102 (2021)). It does
not plan a way round: the vehicle stops, and the program decides.
"""

from __future__ import annotations

from math import degrees, isfinite

from volery.base.elementary import atan2
from volery.base.errors import ObstacleNear
from volery.base.time import Ns, S, to_seconds
from volery.vehicles.telemetry import Obstacle, Telemetry

FRESH_FOR: Ns = S
"""Age up to which a measured distance counts."""
SILENT_FOR: Ns = 3 * S
"""Time without any measurement after which the sensors count as failed."""
APPROACHES_M_S = 0.2
"""Closing speed from which the vehicle approaches an obstacle; a way along it or away from it is allowed."""
BRAKING_M_S2 = 2.0
"""Deceleration with which a vehicle stops: PX4's MPC_DEC_HOR_SLOW and ArduPilot's WPNAV_ACCEL are near it."""

REACTION_S = 0.4
"""Age of a measurement and of the last check, at most, s: each is repeated five times a second."""

_COMPASS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")


class ObstacleMonitor:
    """Compares the distances of obstacles in the direction of motion with a clearance.

    What counts is the distance that is left once the vehicle has stopped.

    Args:
        telemetry: telemetry of the vehicle.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry

    def check(self, operation: str, now: Ns, clearance: float) -> ObstacleNear | None:
        """Return the error that must end the operation, or ``None``.

        Args:
            operation: what the vehicle is doing, for the error message.
            now: the present time, ns.
            clearance: least distance from an obstacle, m; 0 checks nothing.
        """
        seen = self._telemetry
        if not clearance or not seen.flying or seen.stale:
            return None
        age = now - seen.obstacles_ns
        if age > SILENT_FOR:
            what = f"its range sensors have measured nothing for {to_seconds(age):.0f} s"
            return ObstacleNear(seen.name, operation, f"{what}; a clearance of {clearance:g} m is stated")
        near = [
            (obstacle.metres, closing, obstacle)
            for obstacle in seen.obstacles.values()
            if now - obstacle.at <= FRESH_FOR
            and (closing := self._closing(obstacle)) > APPROACHES_M_S
            and obstacle.metres - _stopping_distance(closing) < clearance
        ]
        if not near:
            return None
        metres, closing, obstacle = min(near)
        what = f"an obstacle is {metres:.1f} m {_whither(obstacle)}, approached at {closing:.1f} m/s"
        limit = f"it must stop {clearance:g} m before it (Limits.clearance)"
        return ObstacleNear(seen.name, operation, f"{what}: {limit}")

    def _closing(self, obstacle: Obstacle) -> float:
        """Return the speed towards an obstacle, m/s; 0 where the velocity is unknown."""
        velocity, (east, north, up) = self._telemetry.velocity, obstacle.direction
        speed = velocity.east * east + velocity.north * north + velocity.up * up
        return speed if isfinite(speed) else 0.0


def _stopping_distance(speed: float) -> float:
    """Return the distance in which a vehicle at *speed* m/s stops, m, from its last measurement on."""
    return speed * REACTION_S + speed * speed / (2.0 * BRAKING_M_S2)


def _whither(obstacle: Obstacle) -> str:
    """Return the direction of an obstacle in words."""
    east, north, up = obstacle.direction
    if up > 0.5:
        return "above"
    return f"to the {_COMPASS[round(degrees(atan2(east, north)) / 45.0) % 8]}"
