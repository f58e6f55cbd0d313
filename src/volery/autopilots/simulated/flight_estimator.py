"""The estimator, compiled: what an autopilot believes, from its instruments alone.

Attitude: gyros integrated every step; heading held by the compass; tilt held by what the velocity filter finds
wrong with the acceleration (it takes a lean that is not known for an acceleration that is not there), or by
gravity itself while no satellites help. Position and velocity: one Kalman filter for each axis, of position,
velocity and acceleration error (Gelb, Applied Optimal Estimation, 4.2), fed by satellites in the plane and by
the barometer in height, or by satellites alone where they are the better (a real-time kinematic fix).
"""

from __future__ import annotations

from math import sqrt

from numba import njit

from volery.autopilots.simulated.flight_columns import (
    C_AIDED,
    K_ACCEL,
    K_ACCEL_BIAS,
    K_AIDED,
    K_ALIGNED,
    K_ATTITUDE,
    K_COVARIANCE,
    K_EULER,
    K_GPS_AGE,
    K_GPS_LEVEL,
    K_GYRO_BIAS,
    K_HEADING_ERROR,
    K_HEIGHT_ZERO,
    K_ORIGIN,
    K_POSITION,
    K_RATES,
    K_SEEN_BARO,
    K_SEEN_GPS,
    K_SEEN_MAG,
    K_SPREAD,
    K_VELOCITY,
)
from volery.world.arithmetic import arc_tangent2, sine_cosine, wrap_angle
from volery.world.bodies import STEP_S
from volery.world.columns import (
    BARO,
    GPS_HEIGHT,
    GPS_LEVEL,
    GPS_SPEED,
    M_ACCEL,
    M_BARO,
    M_BARO_COUNT,
    M_GPS,
    M_GPS_COUNT,
    M_GPS_FIX,
    M_GPS_VELOCITY,
    M_GYRO,
    M_MAG,
    M_MAG_COUNT,
    P_FIELD,
    P_GRAVITY,
    P_PERFECT,
    P_SENSOR,
    S_ATTITUDE,
    S_FORCE,
    S_POSITION,
    S_RATES,
    S_VELOCITY,
    SENSOR_SLOW,
    SENSOR_WHITE,
    Array,
    Bodies,
    Work,
)

FUSE_EVERY = 25  # steps: 20 Hz, where the barometer's, the compass' and the receiver's samples fall
_FUSE_S = FUSE_EVERY * STEP_S
_HALF_ROOT = 0.7071067811865476
_ACCEL_DENSITY = 0.03  # (m/s^2)^2/Hz that velocity may wander
_BIAS_DENSITY = 0.0004  # (m/s^2)^2/s that the acceleration error may wander
_TILT_GAIN = 0.5  # [1/s]
_TILT_INTEGRAL = 0.01  # [1/s^2]
_HEADING_GAIN = 0.4  # [1/s]
_HEADING_INTEGRAL = 0.01  # [1/s^2]
_GRAVITY_GAIN = 0.3  # [1/s] while nothing better is known
_STALE = 1.0  # [s] after which a fix no longer holds the tilt
_RTK = 5.5  # fix types above this are better in height than a barometer


@njit(cache=False)
def _euler(memory: Array) -> None:
    """Roll, pitch and yaw of the estimated quaternion."""
    w, x, y, z = memory[K_ATTITUDE], memory[K_ATTITUDE + 1], memory[K_ATTITUDE + 2], memory[K_ATTITUDE + 3]
    sine = min(max(2.0 * (w * y - z * x), -1.0), 1.0)
    memory[K_EULER] = arc_tangent2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    memory[K_EULER + 1] = arc_tangent2(sine, sqrt(1.0 - sine * sine))
    memory[K_EULER + 2] = arc_tangent2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@njit(cache=False)
def _matrix(memory: Array, rotation: Array) -> None:
    """The estimated attitude as a matrix that takes forward, right, down to north, east, down."""
    w, x, y, z = memory[K_ATTITUDE], memory[K_ATTITUDE + 1], memory[K_ATTITUDE + 2], memory[K_ATTITUDE + 3]
    rotation[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    rotation[0, 1] = 2.0 * (x * y - w * z)
    rotation[0, 2] = 2.0 * (x * z + w * y)
    rotation[1, 0] = 2.0 * (x * y + w * z)
    rotation[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    rotation[1, 2] = 2.0 * (y * z - w * x)
    rotation[2, 0] = 2.0 * (x * z - w * y)
    rotation[2, 1] = 2.0 * (y * z + w * x)
    rotation[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@njit(cache=False)
def _turn_body(memory: Array, x: float, y: float, z: float) -> None:
    """Turn the attitude by a small angle about body axes [rad]."""
    w0, x0, y0, z0 = (
        memory[K_ATTITUDE],
        memory[K_ATTITUDE + 1],
        memory[K_ATTITUDE + 2],
        memory[K_ATTITUDE + 3],
    )
    x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
    w1 = w0 - x0 * x - y0 * y - z0 * z
    x1 = x0 + w0 * x + y0 * z - z0 * y
    y1 = y0 + w0 * y - x0 * z + z0 * x
    z1 = z0 + w0 * z + x0 * y - y0 * x
    scale = 1.5 - 0.5 * (w1 * w1 + x1 * x1 + y1 * y1 + z1 * z1)
    memory[K_ATTITUDE] = w1 * scale
    memory[K_ATTITUDE + 1] = x1 * scale
    memory[K_ATTITUDE + 2] = y1 * scale
    memory[K_ATTITUDE + 3] = z1 * scale


@njit(cache=False)
def _correct(memory: Array, rotation: Array, turn: Array, integral: float) -> None:
    """Turn the attitude by *turn* about north, east, down and move the gyro bias the other way."""
    for axis in range(3):
        angle = rotation[0, axis] * turn[0] + rotation[1, axis] * turn[1] + rotation[2, axis] * turn[2]
        memory[K_GYRO_BIAS + axis] -= integral * angle
    bx = rotation[0, 0] * turn[0] + rotation[1, 0] * turn[1] + rotation[2, 0] * turn[2]
    by = rotation[0, 1] * turn[0] + rotation[1, 1] * turn[1] + rotation[2, 1] * turn[2]
    bz = rotation[0, 2] * turn[0] + rotation[1, 2] * turn[1] + rotation[2, 2] * turn[2]
    _turn_body(memory, bx, by, bz)


@njit(cache=False)
def _predict(memory: Array, measured: Array, parameters: Array, rotation: Array) -> None:
    """One grid step of dead reckoning."""
    for axis in range(3):
        memory[K_RATES + axis] = measured[M_GYRO + axis] - memory[K_GYRO_BIAS + axis]
    _turn_body(memory, memory[K_RATES] * STEP_S, memory[K_RATES + 1] * STEP_S, memory[K_RATES + 2] * STEP_S)
    _matrix(memory, rotation)
    fx, fy, fz = measured[M_ACCEL], measured[M_ACCEL + 1], measured[M_ACCEL + 2]
    aided = memory[K_AIDED] > 0.5
    for axis in range(3):
        accel = rotation[axis, 0] * fx + rotation[axis, 1] * fy + rotation[axis, 2] * fz
        if axis == 2:
            accel += parameters[P_GRAVITY]
        accel += memory[K_ACCEL_BIAS + axis]
        memory[K_ACCEL + axis] = accel
        if axis == 2 or aided:
            memory[K_POSITION + axis] += (memory[K_VELOCITY + axis] + 0.5 * accel * STEP_S) * STEP_S
            memory[K_VELOCITY + axis] += accel * STEP_S


@njit(cache=False)
def _spread(memory: Array, axis: int) -> None:
    """Propagate one axis' covariance (pp pv pb vv vb bb) over a fusion period."""
    at = K_COVARIANCE + 6 * axis
    t = _FUSE_S
    pp, pv, pb = memory[at], memory[at + 1], memory[at + 2]
    vv, vb, bb = memory[at + 3], memory[at + 4], memory[at + 5]
    memory[at] = pp + t * (2.0 * pv + t * (vv + pb + t * (vb + 0.25 * t * bb)))
    memory[at + 1] = pv + t * (vv + pb + t * (1.5 * vb + 0.5 * t * bb))
    memory[at + 2] = pb + t * (vb + 0.5 * t * bb)
    memory[at + 3] = vv + t * (2.0 * vb + t * bb) + _ACCEL_DENSITY * t
    memory[at + 4] = vb + t * bb
    memory[at + 5] = bb + _BIAS_DENSITY * t


@njit(cache=False)
def _fuse_position(memory: Array, axis: int, innovation: float, variance: float) -> float:
    """Kalman's update of one axis by a position; returns the innovation in sigmas."""
    at = K_COVARIANCE + 6 * axis
    pp, pv, pb = memory[at], memory[at + 1], memory[at + 2]
    total = pp + variance
    gain_p, gain_v, gain_b = pp / total, pv / total, pb / total
    memory[K_POSITION + axis] += gain_p * innovation
    memory[K_VELOCITY + axis] += gain_v * innovation
    memory[K_ACCEL_BIAS + axis] += gain_b * innovation
    memory[at + 3] -= gain_v * pv
    memory[at + 4] -= gain_v * pb
    memory[at + 5] -= gain_b * pb
    memory[at] = (1.0 - gain_p) * pp
    memory[at + 1] = (1.0 - gain_p) * pv
    memory[at + 2] = (1.0 - gain_p) * pb
    return abs(innovation) / sqrt(total)


@njit(cache=False)
def _fuse_velocity(memory: Array, axis: int, innovation: float, variance: float) -> None:
    """Kalman's update of one axis by a velocity."""
    at = K_COVARIANCE + 6 * axis
    pv, vv, vb = memory[at + 1], memory[at + 3], memory[at + 4]
    total = vv + variance
    gain_p, gain_v, gain_b = pv / total, vv / total, vb / total
    memory[K_POSITION + axis] += gain_p * innovation
    memory[K_VELOCITY + axis] += gain_v * innovation
    memory[K_ACCEL_BIAS + axis] += gain_b * innovation
    memory[at] -= gain_p * pv
    memory[at + 2] -= gain_p * vb
    memory[at + 5] -= gain_b * vb
    memory[at + 1] = (1.0 - gain_v) * pv
    memory[at + 3] = (1.0 - gain_v) * vv
    memory[at + 4] = (1.0 - gain_v) * vb


@njit(cache=False)
def _variance(parameters: Array, sensor: int) -> float:
    """What the instrument's maker declares: white and slow error together."""
    white = parameters[P_SENSOR + 4 * sensor + SENSOR_WHITE]
    slow = parameters[P_SENSOR + 4 * sensor + SENSOR_SLOW]
    declared: float = white * white + slow * slow
    return declared


@njit(cache=False)
def _trust(memory: Array, axis: int, position: float, velocity: float) -> None:
    """Start one axis' covariance with two variances."""
    at = K_COVARIANCE + 6 * axis
    for i in range(6):
        memory[at + i] = 0.0
    memory[at] = position
    memory[at + 3] = velocity
    memory[at + 5] = 0.04


@njit(cache=False)
def _aid(memory: Array, measured: Array, command: Array, parameters: Array) -> None:
    """Begin or end the use of satellites as told."""
    wanted = command[C_AIDED] > 0.5
    if wanted and memory[K_AIDED] < 0.5 and measured[M_GPS_FIX] > 2.5:
        memory[K_AIDED] = 1.0
        memory[K_GPS_AGE] = 0.0
        for axis in range(3):
            memory[K_POSITION + axis] = measured[M_GPS + axis]
            memory[K_ORIGIN + axis] = measured[M_GPS + axis]
        for axis in range(2):
            memory[K_VELOCITY + axis] = measured[M_GPS_VELOCITY + axis]
            memory[K_ACCEL_BIAS + axis] = 0.0
            _trust(memory, axis, _variance(parameters, GPS_LEVEL), _variance(parameters, GPS_SPEED))
        memory[K_HEIGHT_ZERO] = measured[M_BARO] + measured[M_GPS + 2]
    if not wanted and memory[K_AIDED] > 0.5:
        memory[K_AIDED] = 0.0
        for axis in range(2):
            memory[K_VELOCITY + axis] = 0.0
            memory[K_ACCEL_BIAS + axis] = 0.0


@njit(cache=False)
def _hear_satellites(memory: Array, measured: Array, parameters: Array, rotation: Array, turn: Array) -> None:
    """Fuse a new fix, and let the tilt take over part of what the filter calls an acceleration error."""
    level, speed = _variance(parameters, GPS_LEVEL), _variance(parameters, GPS_SPEED)
    worst = 0.0
    for axis in range(2):
        missed = measured[M_GPS + axis] - memory[K_POSITION + axis]
        worst = max(worst, _fuse_position(memory, axis, missed, level))
        _fuse_velocity(memory, axis, measured[M_GPS_VELOCITY + axis] - memory[K_VELOCITY + axis], speed)
    memory[K_GPS_LEVEL] = worst
    if measured[M_GPS_FIX] > _RTK:
        _fuse_position(
            memory, 2, measured[M_GPS + 2] - memory[K_POSITION + 2], _variance(parameters, GPS_HEIGHT)
        )
        memory[K_HEIGHT_ZERO] = measured[M_BARO] + memory[K_POSITION + 2]
    _fuse_velocity(memory, 2, measured[M_GPS_VELOCITY + 2] - memory[K_VELOCITY + 2], 4.0 * speed)
    share = _TILT_GAIN * min(memory[K_GPS_AGE], _STALE)
    north, east = share * memory[K_ACCEL_BIAS], share * memory[K_ACCEL_BIAS + 1]
    memory[K_ACCEL_BIAS] -= north
    memory[K_ACCEL_BIAS + 1] -= east
    turn[0] = east / parameters[P_GRAVITY]
    turn[1] = -north / parameters[P_GRAVITY]
    turn[2] = 0.0
    _correct(memory, rotation, turn, _TILT_INTEGRAL / _TILT_GAIN)
    memory[K_GPS_AGE] = 0.0


@njit(cache=False)
def _feel_gravity(memory: Array, rotation: Array, measured: Array, turn: Array, gravity: float) -> None:
    """Without satellites: what the accelerometer calls up is up."""
    fx, fy, fz = measured[M_ACCEL], measured[M_ACCEL + 1], measured[M_ACCEL + 2]
    north = rotation[0, 0] * fx + rotation[0, 1] * fy + rotation[0, 2] * fz
    east = rotation[1, 0] * fx + rotation[1, 1] * fy + rotation[1, 2] * fz
    share = _GRAVITY_GAIN * _FUSE_S / gravity
    turn[0] = -east * share
    turn[1] = north * share
    turn[2] = 0.0
    _correct(memory, rotation, turn, 0.02)


@njit(cache=False)
def _hear_compass(memory: Array, measured: Array, parameters: Array, rotation: Array, turn: Array) -> None:
    """Turn towards the heading in which the measured field points as the earth's does here."""
    mx, my, mz = measured[M_MAG], measured[M_MAG + 1], measured[M_MAG + 2]
    north = rotation[0, 0] * mx + rotation[0, 1] * my + rotation[0, 2] * mz
    east = rotation[1, 0] * mx + rotation[1, 1] * my + rotation[1, 2] * mz
    declination = arc_tangent2(parameters[P_FIELD + 1], parameters[P_FIELD])
    error = wrap_angle(arc_tangent2(east, north) - declination)
    memory[K_HEADING_ERROR] = error
    turn[0] = 0.0
    turn[1] = 0.0
    turn[2] = -_HEADING_GAIN * _FUSE_S * error
    _correct(memory, rotation, turn, _HEADING_INTEGRAL / _HEADING_GAIN)


@njit(cache=False)
def _fuse(bodies: Bodies, body: int, work: Work) -> None:
    """What falls due twenty times a second."""
    memory, measured, parameters = bodies.memory[body], bodies.measured[body], bodies.parameters[body]
    rotation, turn = work.belief, work.turn
    _aid(memory, measured, bodies.inputs[body], parameters)
    memory[K_GPS_AGE] += _FUSE_S
    for axis in range(3):
        if axis == 2 or memory[K_AIDED] > 0.5:
            _spread(memory, axis)
    if measured[M_BARO_COUNT] != memory[K_SEEN_BARO]:
        memory[K_SEEN_BARO] = measured[M_BARO_COUNT]
        if not (measured[M_GPS_FIX] > _RTK and memory[K_AIDED] > 0.5):
            missed = memory[K_HEIGHT_ZERO] - measured[M_BARO] - memory[K_POSITION + 2]
            _fuse_position(memory, 2, missed, _variance(parameters, BARO))
    if measured[M_MAG_COUNT] != memory[K_SEEN_MAG]:
        memory[K_SEEN_MAG] = measured[M_MAG_COUNT]
        _hear_compass(memory, measured, parameters, rotation, turn)
    if measured[M_GPS_COUNT] != memory[K_SEEN_GPS] and memory[K_AIDED] > 0.5:
        memory[K_SEEN_GPS] = measured[M_GPS_COUNT]
        _hear_satellites(memory, measured, parameters, rotation, turn)
    if memory[K_AIDED] < 0.5 or memory[K_GPS_AGE] > _STALE:
        _feel_gravity(memory, rotation, measured, turn, parameters[P_GRAVITY])
    for index in range(2):
        at = K_COVARIANCE + 12 * index
        memory[K_SPREAD + index] = sqrt(max(memory[at], 0.0))
        memory[K_SPREAD + 2 + index] = sqrt(max(memory[at + 3], 0.0))


@njit(cache=False)
def _align(memory: Array, measured: Array, parameters: Array, rotation: Array) -> None:
    """The first attitude: level by the accelerometer, heading by the compass."""
    fx, fy, fz = measured[M_ACCEL], measured[M_ACCEL + 1], measured[M_ACCEL + 2]
    roll = arc_tangent2(-fy, -fz)
    pitch = arc_tangent2(fx, sqrt(fy * fy + fz * fz))
    sr, cr = sine_cosine(0.5 * roll)
    sp, cp = sine_cosine(0.5 * pitch)
    memory[K_ATTITUDE] = cr * cp
    memory[K_ATTITUDE + 1] = sr * cp
    memory[K_ATTITUDE + 2] = cr * sp
    memory[K_ATTITUDE + 3] = -sr * sp
    _matrix(memory, rotation)
    mx, my, mz = measured[M_MAG], measured[M_MAG + 1], measured[M_MAG + 2]
    north = rotation[0, 0] * mx + rotation[0, 1] * my + rotation[0, 2] * mz
    east = rotation[1, 0] * mx + rotation[1, 1] * my + rotation[1, 2] * mz
    yaw = arc_tangent2(parameters[P_FIELD + 1], parameters[P_FIELD]) - arc_tangent2(east, north)
    sy, cy = sine_cosine(0.5 * yaw)
    memory[K_ATTITUDE] = cr * cp * cy + sr * sp * sy
    memory[K_ATTITUDE + 1] = sr * cp * cy - cr * sp * sy
    memory[K_ATTITUDE + 2] = cr * sp * cy + sr * cp * sy
    memory[K_ATTITUDE + 3] = cr * cp * sy - sr * sp * cy
    memory[K_ALIGNED] = 1.0


@njit(cache=False)
def _know(bodies: Bodies, body: int, rotation: Array) -> None:
    """The belief of a vehicle with perfect instruments: the truth, in the autopilot's axes."""
    memory, state, command = bodies.memory[body], bodies.state[body], bodies.inputs[body]
    for axis in range(3):
        source = 1 - axis if axis < 2 else 2
        sign = 1.0 if axis < 2 else -1.0
        memory[K_POSITION + axis] = sign * state[S_POSITION + source]
        memory[K_VELOCITY + axis] = sign * state[S_VELOCITY + source]
        force = 0.0
        for body_axis in range(3):
            force += rotation[source, body_axis] * state[S_FORCE + body_axis]
        gravity = bodies.parameters[body, P_GRAVITY] if axis == 2 else 0.0
        memory[K_ACCEL + axis] = sign * force + gravity
        memory[K_RATES + axis] = state[S_RATES + axis] if axis == 0 else -state[S_RATES + axis]
    w, x, y, z = state[S_ATTITUDE], state[S_ATTITUDE + 1], state[S_ATTITUDE + 2], state[S_ATTITUDE + 3]
    memory[K_ATTITUDE] = _HALF_ROOT * (w + z)
    memory[K_ATTITUDE + 1] = _HALF_ROOT * (x + y)
    memory[K_ATTITUDE + 2] = _HALF_ROOT * (x - y)
    memory[K_ATTITUDE + 3] = _HALF_ROOT * (w - z)
    memory[K_ALIGNED] = 1.0
    memory[K_GPS_AGE] = 0.0
    if command[C_AIDED] > 0.5 and memory[K_AIDED] < 0.5:
        for axis in range(3):
            memory[K_ORIGIN + axis] = memory[K_POSITION + axis]
    memory[K_AIDED] = command[C_AIDED]


@njit(cache=False)
def first_belief(bodies: Bodies, body: int, work: Work) -> None:
    """What the estimator makes of the first samples."""
    memory, measured = bodies.memory[body], bodies.measured[body]
    if bodies.parameters[body, P_PERFECT] > 0.5:
        _know(bodies, body, work.rotation)
    else:
        _align(memory, measured, bodies.parameters[body], work.belief)
        memory[K_HEIGHT_ZERO] = measured[M_BARO]
        _trust(memory, 2, _variance(bodies.parameters[body], BARO), 0.01)
    _euler(memory)


@njit(cache=False)
def believe(bodies: Bodies, body: int, work: Work) -> None:
    """The estimate of the grid step just reached."""
    memory = bodies.memory[body]
    if bodies.parameters[body, P_PERFECT] > 0.5:
        _know(bodies, body, work.rotation)
    else:
        _predict(memory, bodies.measured[body], bodies.parameters[body], work.belief)
        if bodies.reached[body] % FUSE_EVERY == 0:
            _fuse(bodies, body, work)
    _euler(memory)
