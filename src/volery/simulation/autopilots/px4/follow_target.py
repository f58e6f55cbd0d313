"""PX4's AUTO.FOLLOW_TARGET: stay at a distance and an angle from a target that sends its position.

The target is a phone or a tracker with FOLLOW_TARGET. The rules are those of the firmware's documentation and
parameters; no recording shows them.
"""

from __future__ import annotations

from math import hypot, radians
from typing import Any

from volery.base.elementary import atan2, cos, sin
from volery.base.frames import Vector, wrap
from volery.simulation.autopilots.manoeuvres.to_point import bearing
from volery.simulation.autopilots.mavlink.messages import FARTHEST, all_within, finite
from volery.simulation.autopilots.onboard_mission import GLOBAL_INT
from volery.simulation.autopilots.px4.flight_modes import Hold
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

HAS_POSITION = 1
"""Bit of ``est_capabilities``."""

COURSE_FROM = 1.0
"""Speed of the target from which its velocity states its course [m/s]."""


class FollowTarget(Hold):
    """Hold until a target is received, then stay at FLW_TGT_DST, FLW_TGT_FA and FLW_TGT_HT from it.

    The height is above home. The angle counts from the course of the target, from north until it has moved.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._course = 0.0
        self._followed: Vector | None = None

    def receive(self, place: Vector, velocity: Vector) -> None:
        """Follow a target.

        Args:
            place: Where it is: north, east, down about the estimator's origin [m].
            velocity: Its velocity, north, east, down [m/s].
        """
        parameters = self.vehicle.parameters
        if hypot(*velocity[:2]) >= COURSE_FROM:
            self._course = atan2(velocity[1], velocity[0])
        away, angle = parameters["FLW_TGT_DST"], self._course + radians(parameters["FLW_TGT_FA"])
        ground = self.vehicle.home.ned[2] if self.vehicle.home else 0.0
        self._followed = place
        self.speed = parameters["FLW_TGT_MAX_VEL"]
        self.point = self.target = (
            place[0] + away * cos(angle),
            place[1] + away * sin(angle),
            ground - parameters["FLW_TGT_HT"],
        )

    def step(self) -> None:
        """Fly to the point beside the target with the nose towards it."""
        if self._followed is not None:
            self.yaw = wrap(bearing(self.vehicle.estimate.position, self._followed))
        super().step()


def on_follow_target(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle FOLLOW_TARGET, which counts while AUTO.FOLLOW_TARGET is flown."""
    following = vehicle.manoeuvre
    if not isinstance(following, FollowTarget) or not fields["est_capabilities"] & HAS_POSITION:
        return
    if abs(fields["lat"]) > 900_000_000 or abs(fields["lon"]) > 1_800_000_000:
        return
    place = vehicle.point(GLOBAL_INT, fields["lat"] / 1e7, fields["lon"] / 1e7, 0.0)
    north, east, down = (finite(speed) for speed in fields["vel"])
    if all_within(place[:2], FARTHEST):
        following.receive(place, (north, east, down))
