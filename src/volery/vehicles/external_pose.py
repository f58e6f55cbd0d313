"""An external position estimate: where a program says that a vehicle is, for its autopilot's estimator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, isfinite, pi, radians

from volery.base.errors import UsageError
from volery.base.frames import (
    map_covariance_to_ned,
    map_to_north_east,
    pose_covariance_neu_to_ned,
    wrap,
)
from volery.base.time import Ns

FARTHEST_M = 100_000.0
"""Distance from the origin within which a pose counts: the frame is a plane."""
LARGEST_TURN_RAD2 = pi * pi
"""Variance of an angle beyond which nothing is known of it."""
VALUES = 6
LEVEL_DEG = 2.0
"""Standard deviation of roll and pitch of a pose that states neither."""
_IN_PLANE = (0, 1, 5)


@dataclass(frozen=True)
class ExternalPose:
    """Where the vehicle was, about the origin of its estimator.

    Args:
        time: when it was there, by the program's clock, ns.
        north: metres from the origin; likewise ``east`` and ``up``.
        heading: degrees clockwise from north.
        covariance: of north, east, up (m) and roll, pitch, heading (rad); 6 rows of 6.
        roll: degrees, right positive; ``pitch``: degrees, nose up positive.
        resets: how often the estimate has jumped so far, as after it was lost.

    Example: ``drone.send_external_pose(ExternalPose.on_map(now, (3.2, 1.5, 0.1), of_x_y_yaw, up=1.5))``
    """

    time: Ns
    north: float
    east: float
    up: float
    heading: float
    covariance: Sequence[Sequence[float]]
    roll: float = 0.0
    pitch: float = 0.0
    resets: int = 0

    @classmethod
    def on_map(
        cls,
        time: Ns,
        pose: tuple[float, float, float],
        covariance: Sequence[Sequence[float]],
        *,
        up: float,
        up_variance: float = 0.01,
        x_heading: float = 90.0,
        resets: int = 0,
    ) -> ExternalPose:
        """Return the pose of a place on a map whose origin is that of the estimator.

        Args:
            time: when it was there, ns.
            pose: x, y (m) and yaw (rad, anticlockwise from the x axis) on the map.
            covariance: of the three; 3 rows of 3.
            up: height above the origin, m.
            up_variance: its variance, m².
            x_heading: where the map's x axis points, degrees clockwise from north; 90: east, as in ROS.
            resets: see the class.
        """
        turn = radians(x_heading)
        north, east = map_to_north_east((pose[0], pose[1]), turn)
        flat = map_covariance_to_ned(covariance, turn)
        level = radians(LEVEL_DEG) * radians(LEVEL_DEG)
        rows = [[0.0] * VALUES for _ in range(VALUES)]
        for row, place in enumerate(_IN_PLANE):
            for column, other in enumerate(_IN_PLANE):
                rows[place][other] = flat[row][column]
        rows[2][2], rows[3][3], rows[4][4] = up_variance, level, level
        heading = degrees(wrap(turn - pose[2])) % 360.0
        return cls(time, north, east, up, heading, rows, resets=resets)

    def check(self, vehicle: str) -> None:
        """Raise ``UsageError`` if it is not a pose with a covariance in the stated units."""
        asked = f"{vehicle}: send_external_pose()"
        for name in ("north", "east", "up", "heading", "roll", "pitch"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or not isfinite(value):
                raise UsageError(f"{asked}: {name} is {value!r}; send nothing while the place is not known")
        far = max(abs(self.north), abs(self.east), abs(self.up))
        if far > FARTHEST_M:
            raise UsageError(f"{asked}: {far:g} m from the origin; give metres about the estimator's origin")
        if not (abs(self.heading) <= 360.0 and abs(self.roll) <= 180.0 and abs(self.pitch) <= 90.0):
            raise UsageError(
                f"{asked}: a heading of {self.heading:g}, roll of {self.roll:g}, pitch of {self.pitch:g}; "
                "give degrees"
            )
        if not isinstance(self.time, int) or self.time < 0:
            raise UsageError(
                f"{asked}: the time {self.time!r}; give whole nanoseconds of the program's clock"
            )
        self._check_covariance(asked)

    def _check_covariance(self, asked: str) -> None:
        rows = self.covariance
        try:
            whole = len(rows) == VALUES and all(len(row) == VALUES for row in rows)
        except TypeError:
            whole = False
        if not whole:
            raise UsageError(f"{asked}: no covariance of 6 rows of 6: the autopilot weighs the pose by it")
        if not all(isfinite(value) for row in rows for value in row):
            raise UsageError(f"{asked}: a covariance that is not of finite numbers; give what is known")
        for number in range(VALUES):
            if rows[number][number] <= 0.0:
                raise UsageError(f"{asked}: variance {number} is {rows[number][number]:g}; give one above 0")
            for other in range(number):
                least = 1e-6 * (rows[number][number] + rows[other][other])
                if abs(rows[number][other] - rows[other][number]) > least:
                    raise UsageError(f"{asked}: a covariance that is not symmetric at {number}, {other}")
        if rows[5][5] > LARGEST_TURN_RAD2:
            raise UsageError(f"{asked}: a variance of the heading of {rows[5][5]:g}; give rad²")

    def covariance_ned(self) -> list[float]:
        """Return the covariance of north, east, down, roll, pitch, heading, 36 values by rows."""
        return pose_covariance_neu_to_ned(self.covariance)

    def attitude_ned(self) -> tuple[float, float, float]:
        """Return roll, pitch and yaw clockwise from north, rad."""
        return radians(self.roll), radians(self.pitch), wrap(radians(self.heading))
