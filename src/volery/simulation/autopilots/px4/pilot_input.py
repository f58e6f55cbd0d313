"""Manual control by MANUAL_CONTROL: availability, loss and movement of the sticks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from volery.base.time import MS, Ns, to_seconds
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import Vehicle

INVALID = 32_767
CENTRE = 500
"""``z`` of a centred throttle stick."""

TAKEN_IN_AFTER: Ns = 250 * MS
"""Time from the first sample until manual control counts for modes and arming.

Observed: a mode of sticks is refused at the first sample (4 of 4) and accepted 0.3 s later; a report of the
arming checks 0.24 s after the first sample still misses manual control.
"""

ROLL, PITCH, THROTTLE, YAW = 1, 2, 3, 4
NEUTRAL = (1500,) * 4 + (0,) * 12
"""RC channels without manual control [us]."""


class StickDeflection(NamedTuple):
    """Sticks -1..1: forward, right, up, clockwise."""

    pitch: float = 0.0
    roll: float = 0.0
    throttle: float = 0.0
    yaw: float = 0.0


def deflection(fields: Mapping[str, Any]) -> StickDeflection | None:
    """Return the sticks of a MANUAL_CONTROL, or None if an axis is not given."""
    x, y, z, r = (fields[axis] for axis in "xyzr")
    if INVALID in (x, y, z, r):
        return None
    within = [min(1.0, max(-1.0, axis / 1000.0)) for axis in (x, y, 2 * (z - CENTRE), r)]
    return StickDeflection(*within)


class Joystick:
    """State of one vehicle's manual control."""

    def __init__(self) -> None:
        self.now = StickDeflection()
        self.last_received_ns: Ns = NEVER
        self.valid = False
        self._valid_since_ns: Ns = NEVER
        self.lost_when_armed = True
        """Whether manual control was missing at arming and since, which is no failsafe."""
        self._reference = StickDeflection()
        self._moved = False

    @property
    def ever_received(self) -> bool:
        """Whether manual control was ever received."""
        return self.last_received_ns != NEVER

    def taken_in(self, now: Ns) -> bool:
        """Return whether manual control has been received long enough to fly and to arm by it."""
        return self.valid and now - self._valid_since_ns >= TAKEN_IN_AFTER

    def set_reference(self) -> None:
        """Measure stick movement from the present deflection on."""
        self._reference = self.now
        self._moved = False

    def receive(self, given: StickDeflection, now: Ns) -> float:
        """Store a sample, and return for how long manual control was lost [s]; 0 if it was not."""
        lost_for = to_seconds(now - self.last_received_ns) if self.ever_received and not self.valid else 0.0
        if not self.valid:
            self._reference = given
            self._valid_since_ns = now
        self.now, self.last_received_ns, self.valid = given, now, True
        self.lost_when_armed = False
        return lost_for

    def moved(self, share: float) -> bool:
        """Return whether a stick moved by more than this share of its range since the reference."""
        pairs = zip(self.now, self._reference, strict=True)
        return self.valid and any(abs(value - rested) > share for value, rested in pairs)


def set_rc_channels(vehicle: Vehicle, given: StickDeflection) -> None:
    """Write the sticks to the RC channels, which the generic manoeuvres read."""
    now = vehicle.kernel.now()
    axes = {ROLL: given.roll, PITCH: -given.pitch, THROTTLE: given.throttle, YAW: given.yaw}
    for channel, value in axes.items():
        vehicle.rc.override(channel, round(1500.0 + 500.0 * value), now)
