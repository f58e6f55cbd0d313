"""Radio control: there is no transmitter; sticks may come by datalink (RC_4CH, RC_UP, JOYSTICK_RAW).

A frame makes the radio control OK at once; silence makes it LOST, then REALLY_LOST. Values are the firmware's
-9600..9600, throttle 0..9600: right, nose up, clockwise are positive.
"""

from __future__ import annotations

from typing import NamedTuple

from volery.base.time import Ns
from volery.simulation.autopilots.manual_control import NEVER
from volery.simulation.autopilots.vehicle_state import Vehicle

OK, LOST, REALLY_LOST = 0, 1, 2
FULL = 9600
"""MAX_PPRZ."""
PER_COUNT = FULL // 128
"""Of a stick in RC_4CH and RC_UP."""


class StickFrame(NamedTuple):
    """One frame. ``mode``: position of the switch, below -4800 MANUAL, to 4800 AUTO1, above it AUTO2."""

    roll: int = 0
    pitch: int = 0
    yaw: int = 0
    throttle: int = 0
    mode: int = FULL


def bounded(value: float, low: int = -FULL) -> int:
    """Within the range of a stick."""
    return round(min(FULL, max(low, value)))


class Radio:
    """What the receiver last said, and when."""

    def __init__(self) -> None:
        self.frame = StickFrame(throttle=0)
        self._heard_at: Ns = NEVER

    def status(self, vehicle: Vehicle) -> int:
        """OK, LOST or REALLY_LOST."""
        silence = vehicle.kernel.now() - self._heard_at
        if silence < vehicle.seconds_parameter("RC_LOST_TIME"):
            return OK
        return LOST if silence < vehicle.seconds_parameter("RC_REALLY_LOST_TIME") else REALLY_LOST

    def hear(self, vehicle: Vehicle, frame: StickFrame) -> None:
        """A frame has come: it is the sticks from now on."""
        now = vehicle.kernel.now()
        self._heard_at, self.frame = now, frame
        sticks = vehicle.tuning.sticks
        roll, pitch, throttle, yaw = sticks.travels
        for channel, travel, share in (
            (sticks.roll, roll, 0.5 + 0.5 * frame.roll / FULL),
            (sticks.pitch, pitch, 0.5 + 0.5 * frame.pitch / FULL),
            (sticks.throttle, throttle, frame.throttle / FULL),
            (sticks.yaw, yaw, 0.5 + 0.5 * frame.yaw / FULL),
        ):
            vehicle.sticks.override(channel, travel.pulse(share), now)
