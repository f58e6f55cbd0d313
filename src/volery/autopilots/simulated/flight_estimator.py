"""The estimator, compiled: attitude from gyros with accelerometer, compass and satellites; position by
Kalman.
"""

from __future__ import annotations

from numba import njit

from volery.autopilots.simulated.flight_columns import (
    C_AIDED,
    K_ACCEL,
    K_AIDED,
    K_ALIGNED,
    K_ATTITUDE,
    K_EULER,
    K_GPS_AGE,
    K_ORIGIN,
    K_POSITION,
    K_RATES,
    K_VELOCITY,
)
from volery.world.arithmetic import arc_tangent2
from volery.world.columns import P_GRAVITY, S_ATTITUDE, S_FORCE, S_POSITION, S_RATES, S_VELOCITY, Array

_HALF = 0.7071067811865476


@njit(cache=False)
def _euler(memory: Array) -> None:
    """Roll, pitch and yaw of the estimated quaternion."""
    w, x, y, z = memory[K_ATTITUDE], memory[K_ATTITUDE + 1], memory[K_ATTITUDE + 2], memory[K_ATTITUDE + 3]
    sine = min(max(2.0 * (w * y - z * x), -1.0), 1.0)
    memory[K_EULER] = arc_tangent2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    memory[K_EULER + 1] = arc_tangent2(sine, (1.0 - sine * sine) ** 0.5)
    memory[K_EULER + 2] = arc_tangent2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@njit(cache=False)
def know(memory: Array, state: Array, command: Array, parameters: Array, rotation: Array) -> None:
    """The estimate of a vehicle with perfect instruments: the truth, in the autopilot's axes."""
    memory[K_POSITION] = state[S_POSITION + 1]
    memory[K_POSITION + 1] = state[S_POSITION]
    memory[K_POSITION + 2] = -state[S_POSITION + 2]
    memory[K_VELOCITY] = state[S_VELOCITY + 1]
    memory[K_VELOCITY + 1] = state[S_VELOCITY]
    memory[K_VELOCITY + 2] = -state[S_VELOCITY + 2]
    w, x, y, z = state[S_ATTITUDE], state[S_ATTITUDE + 1], state[S_ATTITUDE + 2], state[S_ATTITUDE + 3]
    memory[K_ATTITUDE] = _HALF * (w + z)
    memory[K_ATTITUDE + 1] = _HALF * (x + y)
    memory[K_ATTITUDE + 2] = _HALF * (x - y)
    memory[K_ATTITUDE + 3] = _HALF * (w - z)
    for axis in range(3):
        sign = 1.0 if axis == 0 else -1.0
        memory[K_RATES + axis] = sign * state[S_RATES + axis]
    fx, fy, fz = state[S_FORCE], state[S_FORCE + 1], state[S_FORCE + 2]
    memory[K_ACCEL] = rotation[1, 0] * fx + rotation[1, 1] * fy + rotation[1, 2] * fz
    memory[K_ACCEL + 1] = rotation[0, 0] * fx + rotation[0, 1] * fy + rotation[0, 2] * fz
    up = rotation[2, 0] * fx + rotation[2, 1] * fy + rotation[2, 2] * fz
    memory[K_ACCEL + 2] = parameters[P_GRAVITY] - up
    memory[K_ALIGNED] = 1.0
    memory[K_GPS_AGE] = 0.0
    if command[C_AIDED] > 0.5 and memory[K_AIDED] < 0.5:
        for axis in range(3):
            memory[K_ORIGIN + axis] = memory[K_POSITION + axis]
    memory[K_AIDED] = command[C_AIDED]
    _euler(memory)
