"""Guidance of a rover, 100 times a second: from a set-point to steering and throttle."""

from __future__ import annotations

from math import sqrt

from numba import njit

from volery.simulation.autopilots.flight_stack.flight_state import (
    C_ACCEL,
    C_CONTROL,
    C_POSITION,
    C_SPEED,
    C_STEERING,
    C_THROTTLE,
    C_VELOCITY,
    C_YAW,
    C_YAW_MODE,
    C_YAW_RATE,
    DRIVE,
    IDLE,
    K_CONTROL,
    K_EULER,
    K_MOTORS,
    K_ORIGIN,
    K_POSITION,
    K_SPEED_INTEGRAL,
    K_TARGET,
    K_TARGET_VELOCITY,
    K_THROTTLE,
    K_VELOCITY,
    OFF,
    STEER,
)
from volery.simulation.autopilots.flight_stack.guidance import GUIDE_S, approach, ramp
from volery.simulation.world.arithmetic import arc_tangent2, clip, sine_cosine, wrap_angle
from volery.simulation.world.state_layout import (
    P_MAX_SPEED,
    P_MAX_STEERING,
    P_MAX_TURN_RATE,
    P_SKID_STEERED,
    P_WHEELBASE,
    Array,
)

_TURN_GAIN = 1.5  # [1/s]
_SPEED_GAIN = 0.2  # ATC_SPEED_P [1/(m/s)]
_SPEED_INTEGRAL = 0.2  # ATC_SPEED_I
_POINT_GAIN = 0.7  # [1/s] of speed on the last metre
_BRAKE_SHARE = 0.6  # of the acceleration limit: how a point is approached
_CLOSE = 0.3  # [m] to a point, within which the rover stops


@njit(cache=False)
def _forward_speed(row: Array) -> float:
    """Return the estimated speed along the heading [m/s]."""
    s, c = sine_cosine(row[K_EULER + 2])
    speed: float = row[K_VELOCITY] * c + row[K_VELOCITY + 1] * s
    return speed


@njit(cache=False)
def _steer_for(row: Array, rate: float, speed: float) -> float:
    """Return the steering -1..1, right positive, that turns at a rate.

    Args:
        row: State row.
        rate: Turn rate [rad/s, clockwise].
        speed: Forward speed [m/s].
    """
    if row[P_SKID_STEERED] > 0.5:
        return clip(rate / row[P_MAX_TURN_RATE], -1.0, 1.0)
    pace = speed if abs(speed) > 0.3 else (0.3 if speed >= 0.0 else -0.3)
    angle = arc_tangent2(rate * row[P_WHEELBASE] * (1.0 if pace > 0.0 else -1.0), abs(pace))
    return clip(angle / row[P_MAX_STEERING], -1.0, 1.0)


@njit(cache=False)
def _throttle_for(row: Array, target: float) -> float:
    """Return the throttle -1..1 for a speed [m/s]: feed-forward and PI."""
    miss = target - _forward_speed(row)
    if target == 0.0 and abs(miss) < 0.05:
        row[K_SPEED_INTEGRAL] = 0.0
        return 0.0
    grown = row[K_SPEED_INTEGRAL] + _SPEED_INTEGRAL * miss * GUIDE_S
    row[K_SPEED_INTEGRAL] = clip(grown, -0.3, 0.3)
    return clip(target / row[P_MAX_SPEED] + _SPEED_GAIN * miss + row[K_SPEED_INTEGRAL], -1.0, 1.0)


@njit(cache=False)
def _to_point(row: Array) -> tuple[float, float]:
    """Return speed [m/s] and turn rate [rad/s] on the way to the commanded point."""
    north = row[C_POSITION] + row[K_ORIGIN] - row[K_POSITION]
    east = row[C_POSITION + 1] + row[K_ORIGIN + 1] - row[K_POSITION + 1]
    distance = sqrt(north * north + east * east)
    for axis in range(3):
        row[K_TARGET + axis] = row[C_POSITION + axis] + row[K_ORIGIN + axis]
    if distance < _CLOSE:
        return 0.0, 0.0
    error = wrap_angle(arc_tangent2(east, north) - row[K_EULER + 2])
    _, ahead = sine_cosine(error)
    speed = min(approach(distance, _POINT_GAIN, _BRAKE_SHARE * row[C_ACCEL]), row[C_SPEED])
    return speed * clip(ahead, 0.2, 1.0), clip(_TURN_GAIN * error, -1.5, 1.5)


@njit(cache=False)
def _along(row: Array) -> tuple[float, float]:
    """Return the commanded speed [m/s] and turn rate [rad/s]."""
    kind = int(row[C_YAW_MODE])
    rate = 0.0
    if kind == 1:
        rate = clip(_TURN_GAIN * wrap_angle(row[C_YAW] - row[K_EULER + 2]), -1.5, 1.5)
    elif kind == 2:
        rate = row[C_YAW_RATE]
    return clip(row[C_VELOCITY], -row[C_SPEED], row[C_SPEED]), rate


@njit(cache=False)
def guide_rover(row: Array) -> None:
    """Run one guidance period."""
    control = int(row[C_CONTROL])
    if control != int(row[K_CONTROL]):
        row[K_CONTROL] = control
        row[K_SPEED_INTEGRAL] = 0.0
        row[K_TARGET_VELOCITY] = _forward_speed(row)
    if control in (OFF, IDLE):
        row[K_MOTORS] = 0.0
        row[K_MOTORS + 1] = 0.0
    elif control == STEER:
        row[K_MOTORS] = clip(row[C_STEERING], -1.0, 1.0)
        row[K_MOTORS + 1] = clip(row[C_THROTTLE], -1.0, 1.0)
    else:
        speed, rate = _along(row) if control == DRIVE else _to_point(row)
        row[K_TARGET_VELOCITY] = ramp(row[K_TARGET_VELOCITY], speed, row[C_ACCEL] * GUIDE_S)
        target = row[K_TARGET_VELOCITY]
        row[K_MOTORS] = _steer_for(row, rate, target)
        row[K_MOTORS + 1] = _throttle_for(row, target)
    row[K_THROTTLE] = row[K_MOTORS + 1]
