"""Guidance of a rover, 100 times a second: from a set-point to steering and throttle."""

from __future__ import annotations

from math import sqrt

from numba import njit

from volery.autopilots.simulated.flight_columns import (
    C_ACCEL,
    C_CONTROL,
    C_POSITION,
    C_SPEED,
    C_STEERING,
    C_THROTTLE,
    C_VELOCITY,
    C_YAW,
    C_YAW_IS,
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
from volery.autopilots.simulated.flight_shaping import approach, ramp
from volery.world.arithmetic import arc_tangent2, clip, sine_cosine, wrap_angle
from volery.world.columns import P_SKID, P_SPEED_TOP, P_STEER_TOP, P_TURN_TOP, P_WHEELBASE, Array

_PERIOD = 0.01  # [s]
_TURN_GAIN = 1.5  # [1/s]
_SPEED_GAIN = 0.2  # ATC_SPEED_P [1/(m/s)]
_SPEED_INTEGRAL = 0.2  # ATC_SPEED_I
_POINT_GAIN = 0.7  # [1/s] of speed on the last metre
_BRAKE_SHARE = 0.6  # of the acceleration limit: how a point is approached
_CLOSE = 0.3  # [m]: where a rover stops chasing the point


@njit(cache=False)
def _forward_speed(memory: Array) -> float:
    s, c = sine_cosine(memory[K_EULER + 2])
    speed: float = memory[K_VELOCITY] * c + memory[K_VELOCITY + 1] * s
    return speed


@njit(cache=False)
def _steer_for(parameters: Array, rate: float, speed: float) -> float:
    """Steering -1..1, right positive, that turns at *rate* clockwise [rad/s] at a *speed*."""
    if parameters[P_SKID] > 0.5:
        return clip(rate / parameters[P_TURN_TOP], -1.0, 1.0)
    pace = speed if abs(speed) > 0.3 else (0.3 if speed >= 0.0 else -0.3)
    angle = arc_tangent2(rate * parameters[P_WHEELBASE] * (1.0 if pace > 0.0 else -1.0), abs(pace))
    return clip(angle / parameters[P_STEER_TOP], -1.0, 1.0)


@njit(cache=False)
def _throttle_for(memory: Array, parameters: Array, wanted: float) -> float:
    """A speed controller: feed-forward and PI."""
    miss = wanted - _forward_speed(memory)
    if wanted == 0.0 and abs(miss) < 0.05:
        memory[K_SPEED_INTEGRAL] = 0.0
        return 0.0
    grown = memory[K_SPEED_INTEGRAL] + _SPEED_INTEGRAL * miss * _PERIOD
    memory[K_SPEED_INTEGRAL] = clip(grown, -0.3, 0.3)
    return clip(wanted / parameters[P_SPEED_TOP] + _SPEED_GAIN * miss + memory[K_SPEED_INTEGRAL], -1.0, 1.0)


@njit(cache=False)
def _to_point(memory: Array, command: Array) -> tuple[float, float]:
    """Speed and turn rate on the way to a point."""
    north = command[C_POSITION] + memory[K_ORIGIN] - memory[K_POSITION]
    east = command[C_POSITION + 1] + memory[K_ORIGIN + 1] - memory[K_POSITION + 1]
    distance = sqrt(north * north + east * east)
    for axis in range(3):
        memory[K_TARGET + axis] = command[C_POSITION + axis] + memory[K_ORIGIN + axis]
    if distance < _CLOSE:
        return 0.0, 0.0
    error = wrap_angle(arc_tangent2(east, north) - memory[K_EULER + 2])
    _, ahead = sine_cosine(error)
    speed = min(approach(distance, _POINT_GAIN, _BRAKE_SHARE * command[C_ACCEL]), command[C_SPEED])
    return speed * clip(ahead, 0.2, 1.0), clip(_TURN_GAIN * error, -1.5, 1.5)


@njit(cache=False)
def _along(memory: Array, command: Array) -> tuple[float, float]:
    """Speed and turn rate as told."""
    kind = int(command[C_YAW_IS])
    rate = 0.0
    if kind == 1:
        rate = clip(_TURN_GAIN * wrap_angle(command[C_YAW] - memory[K_EULER + 2]), -1.5, 1.5)
    elif kind == 2:
        rate = command[C_YAW_RATE]
    return clip(command[C_VELOCITY], -command[C_SPEED], command[C_SPEED]), rate


@njit(cache=False)
def guide_rover(memory: Array, command: Array, parameters: Array) -> None:
    """One guidance period."""
    control = int(command[C_CONTROL])
    if control != int(memory[K_CONTROL]):
        memory[K_CONTROL] = control
        memory[K_SPEED_INTEGRAL] = 0.0
        memory[K_TARGET_VELOCITY] = _forward_speed(memory)
    if control in (OFF, IDLE):
        memory[K_MOTORS] = 0.0
        memory[K_MOTORS + 1] = 0.0
    elif control == STEER:
        memory[K_MOTORS] = clip(command[C_STEERING], -1.0, 1.0)
        memory[K_MOTORS + 1] = clip(command[C_THROTTLE], -1.0, 1.0)
    else:
        speed, rate = _along(memory, command) if control == DRIVE else _to_point(memory, command)
        memory[K_TARGET_VELOCITY] = ramp(memory[K_TARGET_VELOCITY], speed, command[C_ACCEL] * _PERIOD)
        wanted = memory[K_TARGET_VELOCITY]
        memory[K_MOTORS] = _steer_for(parameters, rate, wanted)
        memory[K_MOTORS + 1] = _throttle_for(memory, parameters, wanted)
    memory[K_THROTTLE] = memory[K_MOTORS + 1]
