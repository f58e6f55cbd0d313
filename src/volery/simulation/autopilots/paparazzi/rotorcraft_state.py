"""State that only the rotorcraft firmware keeps: radio control, GPS fix, datalink counters.

There is no transmitter: sticks arrive by datalink (RC_UP, JOYSTICK_RAW). A frame makes the radio
control OK at once; silence makes it LOST, then REALLY_LOST. Sticks are -9600..9600, throttle 0..9600; right,
nose up and clockwise are positive.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from volery.base.frames import Vector
from volery.base.time import MS, Ns
from volery.simulation.autopilots.paparazzi.flight_plan import Navigation
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

RADIO_OK, RADIO_LOST, RADIO_REALLY_LOST = 0, 1, 2
FULL = 9600
"""Full deflection (MAX_PPRZ)."""
PER_COUNT = FULL // 128
"""Deflection of one count in RC_UP."""


class StickFrame(NamedTuple):
    """One frame of radio control. ``mode`` below -4800 is MANUAL, up to 4800 AUTO1, above AUTO2."""

    roll: int = 0
    pitch: int = 0
    yaw: int = 0
    throttle: int = 0
    mode: int = FULL


def bounded(value: float, low: int = -FULL) -> int:
    """Return a deflection within the range of a stick."""
    return round(min(FULL, max(low, value)))


class RadioControl:
    """Last frame of radio control, and its time."""

    def __init__(self) -> None:
        self.frame = StickFrame(throttle=0)
        self._last_frame_ns: Ns = NEVER

    def status(self, vehicle: AutopilotVehicle) -> int:
        """Return RADIO_OK, RADIO_LOST or RADIO_REALLY_LOST."""
        silence = vehicle.kernel.now() - self._last_frame_ns
        if silence < vehicle.seconds_parameter("RC_LOST_TIME"):
            return RADIO_OK
        return RADIO_LOST if silence < vehicle.seconds_parameter("RC_REALLY_LOST_TIME") else RADIO_REALLY_LOST

    def receive(self, vehicle: AutopilotVehicle, frame: StickFrame) -> None:
        """Store a frame and write it to the RC channels."""
        now = vehicle.kernel.now()
        self._last_frame_ns, self.frame = now, frame
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
    """State that only this firmware keeps about a vehicle (``AutopilotVehicle.firmware_state``)."""

    navigation: Navigation
    radio: RadioControl = field(default_factory=RadioControl)
    last_fix_ns: Ns = NEVER
    """Time of the last 3D fix."""
    frozen: tuple[Vector, Vector] | None = None
    """Position and velocity, north, east, down, at the last fix, while there is none."""
    last_uplink_ns: Ns = NEVER
    """Time of the last message from the ground."""
    uplink_messages: int = 0
    downlink_messages: int = 0
    last_sent_waypoint: int = 0
    """Number of the waypoint that was last sent periodically; likewise of settings."""
    last_sent_setting: int = -1
    telemetry_mode: int = 0
    """Setting ``telemetry_mode_Main``: 0 is the default list of periodic messages."""
    stored_settings: dict[int, float] = field(default_factory=dict)
    """What was written to numbers without a setting."""
    mode_since_ns: Ns = NEVER
    """Time of the last change of mode."""
    battery_good_ns: Ns = NEVER
    """Time at which the battery was last above its critical level."""
    touch_downs: int | None = None
    """Number of touch-downs before the one that block ``flare`` awaits, while it does."""


def state_of(vehicle: AutopilotVehicle) -> RotorcraftState:
    """Return the rotorcraft state of a vehicle."""
    state = vehicle.firmware_state
    assert isinstance(state, RotorcraftState)
    return state


FIX_3D = 3
ACQUIRED_AFTER = 300 * MS
"""Uptime of the first fix."""


def fix_type(vehicle: AutopilotVehicle) -> int:
    """Return the fix type of GPS_INT: 0 none, 3 3D, 4 differential, 5 RTK (MAVLink has two RTK types)."""
    if vehicle.uptime() < ACQUIRED_AFTER:
        return 0
    return min(5, vehicle.estimate.fix_type)


def fix_is_valid(vehicle: AutopilotVehicle) -> bool:
    """Return whether there is a 3D fix."""
    return fix_type(vehicle) >= FIX_3D


def update_fix(vehicle: AutopilotVehicle) -> None:
    """Store the time of a valid fix. The first fix sets the estimator's origin."""
    if fix_is_valid(vehicle):
        state_of(vehicle).last_fix_ns = vehicle.kernel.now()
        state_of(vehicle).frozen = None
        if not vehicle.estimate.position_ok and not vehicle.armed:
            vehicle.flight.set_origin()
    elif state_of(vehicle).frozen is None:
        state_of(vehicle).frozen = vehicle.estimate.position, vehicle.estimate.velocity


def known_motion(vehicle: AutopilotVehicle) -> tuple[Vector, Vector]:
    """Return position and velocity as the firmware has them: in the plane they keep those of the last fix."""
    estimate, frozen = vehicle.estimate, state_of(vehicle).frozen
    if frozen is None:
        return estimate.position, estimate.velocity
    (north, east, _), (vn, ve, _) = frozen
    return (north, east, estimate.position[2]), (vn, ve, estimate.velocity[2])


def gps_lost(vehicle: AutopilotVehicle) -> bool:
    """Return whether there was no fix for GPS_TIMEOUT."""
    return vehicle.kernel.now() - state_of(vehicle).last_fix_ns > vehicle.seconds_parameter("GPS_TIMEOUT")
