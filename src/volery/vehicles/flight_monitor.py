"""All monitors of one vehicle as one check, which runs five times a second, also between two calls.

Which of them count depends on the policy of the operation. The first error in this order ends it: control is
lost, the battery is low, the thrust is at its limit, an obstacle is near, the vehicle is off its track, does
not follow its set-points, is out of its bounds, or has lost its position.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

from volery.base.errors import VehicleError
from volery.base.position import AMSL, Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.trace.events import Text
from volery.vehicles.battery_monitor import BatteryMonitor
from volery.vehicles.control_monitors import FollowMonitor, ThrustMonitor, TrackMonitor, UpsetMonitor
from volery.vehicles.escalation import SINKING_M_S
from volery.vehicles.executor import NO_GOAL, Check, Goal, OperationPolicy
from volery.vehicles.limits import Bounds, BoundsMonitor, Limits, Path
from volery.vehicles.obstacle_monitor import ObstacleMonitor
from volery.vehicles.telemetry import Telemetry

JUMPED = 4
"""Severity of the text that reports a jump of the estimate: a warning, as in syslog."""


class FlightMonitor:
    """The monitors of one vehicle.

    Args:
        kernel: clock and record.
        telemetry: telemetry of the vehicle.

    Attributes:
        battery: judges the battery, also before an operation.
        upset: notices a loss of control, also before an operation.
        following: notices a stream of set-points that has no effect.
    """

    def __init__(self, kernel: Kernel, telemetry: Telemetry) -> None:
        self._kernel = kernel
        self._telemetry = telemetry
        self.battery = BatteryMonitor(telemetry)
        self.upset = UpsetMonitor(telemetry)
        self.following = FollowMonitor(telemetry)
        self._thrust = ThrustMonitor(telemetry)
        self._track = TrackMonitor(telemetry)
        self._obstacles = ObstacleMonitor(telemetry)

    def check_of(
        self,
        policy: OperationPolicy,
        limits: Limits,
        bounds: Bounds | None,
        goal: Callable[[], Goal] = lambda: NO_GOAL,
    ) -> Check:
        """Return the check of an operation that begins now.

        Args:
            policy: policy of the operation.
            limits: limits with the reserves of the battery.
            bounds: bounds about home, or ``None`` without a home.
            goal: where the operation should end.
        """
        seen = self._telemetry
        monitor = BoundsMonitor(
            seen,
            bounds if policy.bounded else None,
            policy.ignored,
            needs_position=policy.travels or policy.holds_place,
        )
        if policy.holds_place:
            self._track.stay(bounds)
        else:
            self._track.follow(None)
        if not policy.streams:
            self.following.stop()
        follows = policy.on_track and seen.kind == "drone"

        def check(operation: str, now: Ns) -> VehicleError | None:
            nonlocal follows
            if follows and seen.flying and bounds is not None and seen.located:
                follows = False  # from lift-off on
                self._track.follow(self._path_to(bounds, goal()))
            battery = self.battery.check(operation, now, limits, travels=policy.travels)
            if policy.to_safety:  # one that sinks lands already
                return None if seen.velocity.up < -SINKING_M_S else battery
            off_track = self._track.check(operation, now, bounds)
            if self._track.jumped_m:
                said = f"its estimate of the position has jumped by {self._track.jumped_m:.0f} m"
                self._kernel.record(Text(now, seen.name, JUMPED, said))
            thrust = self._thrust.check(operation, now) if seen.flying or policy.travels else None
            upset = self.upset.check(operation, now)
            obstacle = self._obstacles.check(operation, now, limits.clearance if policy.bounded else 0.0)
            ignored = self.following.check(operation, now)
            return (
                upset
                or battery
                or thrust
                or obstacle
                or off_track
                or ignored
                or monitor.check(operation, now)
            )

        return check

    def _path_to(self, bounds: Bounds, goal: Goal) -> Path | None:
        """Return the straight path from here to *goal*; ``None`` if either is unknown."""
        here = self._telemetry.position
        if here is None or not (isfinite(goal.latitude) and isfinite(goal.amsl)):
            return None
        return bounds.path(here, Position(goal.latitude, goal.longitude, AMSL(goal.amsl)))
