"""Radio control: there is no transmitter; sticks may come by datalink (RC_4CH, RC_UP, JOYSTICK_RAW).

A frame makes the radio control OK at once; silence makes it LOST, then REALLY_LOST. Values are the firmware's
-9600..9600, throttle 0..9600: right, nose up, clockwise are positive.

What the rotorcraft firmware keeps about its vehicle beyond what all firmwares do.

What the firmware makes of its satellite receiver.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from volery.base.time import Ns, S
from volery.simulation.autopilots.manual_control import NEVER
from volery.simulation.autopilots.paparazzi.flight_plan import Navigation
from volery.simulation.autopilots.vehicle_state import Vehicle

RADIO_OK, RADIO_LOST, RADIO_REALLY_LOST = 0, 1, 2
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


class RadioControl:
    """What the receiver last said, and when."""

    def __init__(self) -> None:
        self.frame = StickFrame(throttle=0)
        self._heard_at: Ns = NEVER

    def status(self, vehicle: Vehicle) -> int:
        """OK, LOST or REALLY_LOST."""
        silence = vehicle.kernel.now() - self._heard_at
        if silence < vehicle.seconds_parameter("RC_LOST_TIME"):
            return RADIO_OK
        return RADIO_LOST if silence < vehicle.seconds_parameter("RC_REALLY_LOST_TIME") else RADIO_REALLY_LOST

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
            vehicle.rc.override(channel, travel.pulse(share), now)


@dataclass
class RotorcraftState:
    """``Vehicle.firmware_state`` of a Paparazzi rotorcraft."""

    navigation: Navigation
    radio: RadioControl = field(default_factory=RadioControl)
    refused: int | None = None
    """Arming status of the last wish for motors that was refused."""
    fix_seen: Ns = NEVER
    """When the receiver last had a 3-D fix."""
    uplink_at: Ns = NEVER
    """When the ground was last heard."""
    uplink_messages: int = 0
    downlink_messages: int = 0
    shown_waypoint: int = 0
    """The last one that was sent because its turn had come; likewise of settings."""
    shown_setting: int = -1


def state_of(vehicle: Vehicle) -> RotorcraftState:
    """What is kept about *vehicle*."""
    kept = vehicle.firmware_state
    assert isinstance(kept, RotorcraftState)
    return kept


FIX_3D = 3
ACQUIRED_AFTER = 12 * S
"""Uptime at which a receiver that was just switched on has its first fix."""


def fix_type(vehicle: Vehicle) -> int:
    """As in GPS_INT: 0 none, 3 three-dimensional, 4 differential, 5 RTK. MAVLink counts the two RTK kinds."""
    if vehicle.uptime() < ACQUIRED_AFTER:
        return 0
    return min(5, vehicle.estimate.gps.fix_type)


def fix_is_valid(vehicle: Vehicle) -> bool:
    """There is a fix in three dimensions."""
    return fix_type(vehicle) >= FIX_3D


def update_fix(vehicle: Vehicle) -> None:
    """Remember when there last was a fix. The estimator uses satellites from the first one on."""
    if fix_is_valid(vehicle):
        state_of(vehicle).fix_seen = vehicle.kernel.now()
        if not vehicle.estimate.position_ok and not vehicle.armed:
            vehicle.flight.set_origin()


def gps_lost(vehicle: Vehicle) -> bool:
    """No fix for GPS_TIMEOUT."""
    return vehicle.kernel.now() - state_of(vehicle).fix_seen > vehicle.seconds_parameter("GPS_TIMEOUT")
