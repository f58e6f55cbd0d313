"""Do external poses move as the autopilot's own velocity says? If not, its position estimate must not follow.

A pose that has frozen, jumped or runs away looks valid by itself. Fused, it takes the vehicle along: a frozen
one holds the estimate, and the velocity in it, back while the vehicle flies on and on. Slow drift is not
found.
"""

from __future__ import annotations

from collections import deque
from math import hypot, isfinite

from volery.base.time import Ns, S, to_seconds
from volery.vehicles.external_pose import ExternalPose
from volery.vehicles.telemetry import Telemetry

WINDOW: Ns = 2 * S
"""Time over which both are compared."""
FROZEN_ABOVE_M = 1.0
"""Height above home from which on that counts: on the ground a vehicle may stand still."""
LATE_S = 0.25
"""Time by which the reported velocity may be late."""
FROZEN_AFTER: Ns = S
"""Time without the least change of a place in flight after which its source has frozen."""
TOLERANCE_M = 0.75
"""Distance that is allowed beside that: errors of the poses, and of the velocity over the window."""


class PoseWatch:
    """Compares the poses that are to be sent with the velocity that the vehicle reports.

    Args:
        telemetry: telemetry of the vehicle.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._past: deque[tuple[Ns, float, float, float, float, float]] = deque()
        self._resets = 0
        self._gone = (0.0, 0.0)  # by the velocity since the watch began [m]
        self._found = ""

    def problem(self, pose: ExternalPose, now: Ns) -> str:
        """Return how the poses have disagreed with the motion of the vehicle; empty: they agree.

        A disagreement stays until the source says with ``resets`` that it has found itself anew.
        """
        seen = self._telemetry
        velocity, past = seen.velocity, self._past
        if pose.resets != self._resets:
            past.clear()
            self._resets, self._found = pose.resets, ""
        known = isfinite(velocity.north) and isfinite(velocity.east) and seen.flying and seen.estimate_valid
        if self._found or not known:
            past.clear()
            return self._found
        if past:
            passed = to_seconds(now - past[-1][0])
            self._gone = self._gone[0] + velocity.north * passed, self._gone[1] + velocity.east * passed
        speed = hypot(velocity.north, velocity.east)
        past.append((now, pose.north, pose.east, *self._gone, speed))
        while past[0][0] < now - WINDOW:
            past.popleft()
        self._found = self._difference()
        return self._found

    def _difference(self) -> str:
        """Return how the poses of the window differ from the way by the velocity, if they do."""
        last = self._past[-1]
        since = next((one[0] for one in reversed(self._past) if one[1:3] != last[1:3]), self._past[0][0])
        if last[0] - since >= FROZEN_AFTER and self._telemetry.above_home > FROZEN_ABOVE_M:
            return f"they have not changed in the least for {to_seconds(last[0] - since):.1f} s in flight"
        fastest = max(one[5] for one in self._past)
        allowed = TOLERANCE_M + LATE_S * fastest
        for first in self._past:
            posed = last[1] - first[1], last[2] - first[2]
            gone = last[3] - first[3], last[4] - first[4]
            if hypot(posed[0] - gone[0], posed[1] - gone[1]) > allowed:
                passed = to_seconds(last[0] - first[0])
                return (
                    f"in {passed:.1f} s they have moved by {hypot(*posed):.2f} m, where its own velocity "
                    f"says {hypot(*gone):.2f} m"
                )
        return ""
