"""Gimbal and camera of a simulated DJI aircraft: angles that follow a command, and a count of pictures."""

from __future__ import annotations

from collections.abc import Sequence

from volery.base.frames import Vector
from volery.base.time import Ns, from_seconds
from volery.kernel.api import Kernel
from volery.ros.messages.dji_constants import GIMBAL_PITCHES


class Gimbal:
    """A gimbal with a camera. Angles in degrees: roll, pitch up positive, yaw clockwise from the nose.

    Args:
        kernel: Clock.
    """

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._from: Vector = (0.0, 0.0, 0.0)
        self._to: Vector = (0.0, 0.0, 0.0)
        self._began: Ns = 0
        self._lasts: Ns = 0
        self.pictures = 0
        """Number of pictures since power-on."""

    def angles(self) -> Vector:
        """Return roll, pitch and yaw now."""
        passed = self._kernel.now() - self._began
        share = 1.0 if passed >= self._lasts else passed / self._lasts
        (r0, p0, y0), (r1, p1, y1) = self._from, self._to
        return r0 + share * (r1 - r0), p0 + share * (p1 - p0), y0 + share * (y1 - y0)

    def point(self, wanted: Sequence[float | None], seconds: float, *, relative: bool) -> None:
        """Turn to angles within a time.

        Args:
            wanted: Roll, pitch and yaw; ``None`` leaves an axis where it is. The pitch is limited.
            seconds: Time to get there.
            relative: Whether the angles count from where the gimbal is.
        """
        here = self.angles()
        low, high = GIMBAL_PITCHES
        roll, pitch, yaw = (
            now if angle is None else now * relative + angle for now, angle in zip(here, wanted, strict=True)
        )
        self._from, self._to = here, (roll, min(high, max(low, pitch)), yaw)
        self._began, self._lasts = self._kernel.now(), max(0, from_seconds(seconds))
