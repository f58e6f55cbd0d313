"""The pilot's sticks as MANUAL_CONTROL brings them: when they are there, are lost, move."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.manual_control import NEVER
from volery.simulation.autopilots.vehicle_state import Vehicle

INVALID = 32_767
CENTRE = 500
"""``z`` of a throttle stick in its middle."""

ROLL, PITCH, THROTTLE, YAW = 1, 2, 3, 4
NEUTRAL = (1500,) * 4 + (0,) * 12
"""The channels while there is nobody at the sticks."""


class StickDeflection(NamedTuple):
    """-1..1 each: forward, right, up, clockwise."""

    pitch: float = 0.0
    roll: float = 0.0
    throttle: float = 0.0
    yaw: float = 0.0


def deflection(fields: Mapping[str, Any]) -> StickDeflection | None:
    """What a MANUAL_CONTROL says; ``None`` where an axis is not given."""
    x, y, z, r = (fields[axis] for axis in "xyzr")
    if INVALID in (x, y, z, r):
        return None
    within = [min(1.0, max(-1.0, axis / 1000.0)) for axis in (x, y, 2 * (z - CENTRE), r)]
    return StickDeflection(*within)


class Joystick:
    """Of one vehicle."""

    def __init__(self) -> None:
        self.now = StickDeflection()
        self.last_received_ns: Ns = NEVER
        self.valid = False
        self.lost_when_armed = True
        """Whether they were missing when it was armed and have not come since: then their absence is no
        failsafe.
        """
        self._reference = StickDeflection()
        self._moved = False

    @property
    def ever_received(self) -> bool:
        """Whether they have ever been heard."""
        return self.last_received_ns != NEVER

    def set_reference(self) -> None:
        """From now on movement is counted from here."""
        self._reference = self.now
        self._moved = False

    def receive(self, given: StickDeflection, now: Ns) -> float:
        """A sample came. Returns the seconds for which they had been lost; 0 if they had not."""
        lost_for = to_seconds(now - self.last_received_ns) if self.ever_received and not self.valid else 0.0
        if not self.valid:
            self._reference = given
        self.now, self.last_received_ns, self.valid = given, now, True
        self.lost_when_armed = False
        return lost_for

    def moved(self, share: float) -> bool:
        """Whether any stick has moved by more than that share of its way since it rested."""
        pairs = zip(self.now, self._reference, strict=True)
        return self.valid and any(abs(value - rested) > share for value, rested in pairs)


def set_rc_channels(vehicle: Vehicle, given: StickDeflection) -> None:
    """Let the manoeuvres that fly by channels see them."""
    now = vehicle.kernel.now()
    axes = {ROLL: given.roll, PITCH: -given.pitch, THROTTLE: given.throttle, YAW: given.yaw}
    for channel, value in axes.items():
        vehicle.rc.override(channel, round(1500.0 + 500.0 * value), now)
