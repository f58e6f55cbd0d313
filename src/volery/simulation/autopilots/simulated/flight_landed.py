"""The landed detector of a multirotor: motors at their lower limit and nothing moves for a second.

The rule is ArduCopter's as documented: while flying, lower limit and acceleration below 1 m/s^2 and vertical
speed below 1 m/s for one second; on the ground, flight begins when the collective leaves the lower half of
hover.
"""

from __future__ import annotations

from numba import njit

from volery.simulation.autopilots.simulated.flight_columns import (
    IDLE,
    K_ACCEL,
    K_ACCEL_SMOOTH,
    K_HOVER,
    K_LANDED,
    K_LANDED_FOR,
    K_LOWER_LIMIT,
    K_SPOOL,
    K_THROTTLE,
    K_VELOCITY,
    OFF,
)
from volery.simulation.world.columns import Array

_PERIOD = 0.01  # [s]
_SURE = 1.0  # [s]


@njit(cache=False)
def detect_landing(row: Array, control: int) -> None:
    """One guidance period of the detector."""
    motion = 0.0
    for axis in range(3):
        smooth = row[K_ACCEL_SMOOTH + axis]
        smooth += 0.06 * (row[K_ACCEL + axis] - smooth)  # 1 Hz
        row[K_ACCEL_SMOOTH + axis] = smooth
        motion += smooth * smooth
    if row[K_LANDED] > 0.5:
        row[K_LANDED_FOR] = 0.0
        flying = control not in (OFF, IDLE) and row[K_SPOOL] >= 1.0
        if flying and row[K_THROTTLE] > 0.8 * row[K_HOVER]:
            row[K_LANDED] = 0.0
        return
    quiet = motion < 1.0 and abs(row[K_VELOCITY + 2]) < 1.0
    low = row[K_LOWER_LIMIT] > 0.5 or row[K_THROTTLE] < 0.3 * row[K_HOVER]
    if quiet and low:
        row[K_LANDED_FOR] += _PERIOD
        if row[K_LANDED_FOR] >= _SURE:
            row[K_LANDED] = 1.0
    else:
        row[K_LANDED_FOR] = 0.0
