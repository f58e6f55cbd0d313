"""State estimator: a complementary attitude filter, and a Kalman filter for position and velocity.

Attitude: gyroscope integration, corrected by the magnetometer's heading and by the acceleration error that
the position filter finds (without satellites: by the accelerometer's direction), with a gyro bias. Position:
three axes, each with a Kalman filter of position, velocity and acceleration bias (Brown and Hwang,
Introduction to Random Signals and Applied Kalman Filtering, 4.2), fed by satellites horizontally and by the
barometer in height, or by satellites alone where they are better (a real-time kinematic fix). External poses
come as innovations, in place of satellites and, if commanded, of barometer and compass.
"""

from __future__ import annotations

from math import sqrt

from volery.base.elementary import atan2
from volery.base.numeric_code import numeric
from volery.simulation.autopilots.flight_stack.flight_state import (
    BY_POSES,
    C_AIDED,
    C_GPS_GATE,
    C_GPS_RADIUS,
    C_GPS_SIGMA,
    C_POSE,
    C_POSE_COUNT,
    C_POSE_SIGMA,
    C_POSE_TURN,
    C_POSE_USE,
    C_POSE_YAW,
    FUSE,
    K_ACCEL,
    K_ACCEL_BIAS,
    K_AIDED,
    K_ALIGNED,
    K_ATTITUDE,
    K_BARO_OFFSET,
    K_COVARIANCE,
    K_EULER,
    K_GPS_AGE,
    K_GPS_INNOVATION,
    K_GPS_REFUSED,
    K_GYRO_BIAS,
    K_HEADING_ERROR,
    K_ORIGIN,
    K_POSITION,
    K_RATES,
    K_SIGMA,
    K_TARGET,
    K_USED_BARO,
    K_USED_GPS,
    K_USED_MAG,
    K_USED_POSE,
    K_VELOCITY,
    RESET,
    W_DCM,
)
from volery.simulation.world.arithmetic import wrap_angle
from volery.simulation.world.dynamics import rotation_matrix, write_quaternion
from volery.simulation.world.sensors import RTK_FIX
from volery.simulation.world.state_layout import (
    BIAS_SIGMA,
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
    P_BARO_ERROR,
    P_GPS_HORIZONTAL_ERROR,
    P_GPS_VELOCITY_ERROR,
    P_GPS_VERTICAL_ERROR,
    P_GRAVITY,
    P_MAGNETIC_FIELD,
    P_PERFECT,
    S_ATTITUDE,
    S_POSITION,
    S_RATES,
    S_SPECIFIC_FORCE,
    S_VELOCITY,
    STEP_S,
    W_ROTATION,
    WHITE_SIGMA,
    Array,
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
_RESET_AFTER = 10.0  # [s] posRetryTimeUseVel_ms of EKF3
_STALE = 1.0  # [s] after which a fix no longer holds the tilt


@numeric
def estimate_angles(row: Array) -> None:
    """Compute roll, pitch and yaw of the estimated quaternion."""
    w, x, y, z = row[K_ATTITUDE], row[K_ATTITUDE + 1], row[K_ATTITUDE + 2], row[K_ATTITUDE + 3]
    sine = min(max(2.0 * (w * y - z * x), -1.0), 1.0)
    row[K_EULER] = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    row[K_EULER + 1] = atan2(sine, sqrt(1.0 - sine * sine))
    row[K_EULER + 2] = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@numeric
def _rotate_attitude(row: Array, x: float, y: float, z: float) -> None:
    """Rotate the attitude by a small angle about body axes [rad]."""
    w0, x0, y0, z0 = row[K_ATTITUDE], row[K_ATTITUDE + 1], row[K_ATTITUDE + 2], row[K_ATTITUDE + 3]
    x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
    w1 = w0 - x0 * x - y0 * y - z0 * z
    x1 = x0 + w0 * x + y0 * z - z0 * y
    y1 = y0 + w0 * y - x0 * z + z0 * x
    z1 = z0 + w0 * z + x0 * y - y0 * x
    scale = 1.5 - 0.5 * (w1 * w1 + x1 * x1 + y1 * y1 + z1 * z1)
    row[K_ATTITUDE] = w1 * scale
    row[K_ATTITUDE + 1] = x1 * scale
    row[K_ATTITUDE + 2] = y1 * scale
    row[K_ATTITUDE + 3] = z1 * scale


@numeric
def _horizontal(row: Array, x: float, y: float, z: float) -> tuple[float, float]:
    """Return the north and east components of a vector in body axes."""
    return (
        row[W_DCM] * x + row[W_DCM + 1] * y + row[W_DCM + 2] * z,
        row[W_DCM + 3] * x + row[W_DCM + 4] * y + row[W_DCM + 5] * z,
    )


@numeric
def _correct_attitude(row: Array, north: float, east: float, down: float, share: float) -> None:
    """Rotate the attitude by a small rotation, and move the gyro bias by -*share* of it.

    Args:
        row: State row.
        north: Rotation about north [rad].
        east: Rotation about east [rad].
        down: Rotation about down [rad].
        share: Share of the rotation that is attributed to the bias [1/s].
    """
    x = row[W_DCM] * north + row[W_DCM + 3] * east + row[W_DCM + 6] * down
    y = row[W_DCM + 1] * north + row[W_DCM + 4] * east + row[W_DCM + 7] * down
    z = row[W_DCM + 2] * north + row[W_DCM + 5] * east + row[W_DCM + 8] * down
    row[K_GYRO_BIAS] -= share * x
    row[K_GYRO_BIAS + 1] -= share * y
    row[K_GYRO_BIAS + 2] -= share * z
    _rotate_attitude(row, x, y, z)


@numeric
def _predict(row: Array) -> None:
    """Advance the estimate by one grid step of dead reckoning."""
    for axis in range(3):
        row[K_RATES + axis] = row[M_GYRO + axis] - row[K_GYRO_BIAS + axis]
    _rotate_attitude(row, row[K_RATES] * STEP_S, row[K_RATES + 1] * STEP_S, row[K_RATES + 2] * STEP_S)
    rotation_matrix(row, K_ATTITUDE, W_DCM)
    fx, fy, fz = row[M_ACCEL], row[M_ACCEL + 1], row[M_ACCEL + 2]
    aided = row[K_AIDED] > 0.5
    for axis in range(3):
        accel = row[W_DCM + 3 * axis] * fx + row[W_DCM + 3 * axis + 1] * fy + row[W_DCM + 3 * axis + 2] * fz
        if axis == 2:
            accel += row[P_GRAVITY]
        accel += row[K_ACCEL_BIAS + axis]
        row[K_ACCEL + axis] = accel
        if axis == 2 or aided:
            row[K_POSITION + axis] += (row[K_VELOCITY + axis] + 0.5 * accel * STEP_S) * STEP_S
            row[K_VELOCITY + axis] += accel * STEP_S


@numeric
def _propagate_covariance(row: Array, axis: int) -> None:
    """Propagate one axis' covariance (pp pv pb vv vb bb) over a fusion period."""
    at = K_COVARIANCE + 6 * axis
    t = _FUSE_S
    pp, pv, pb = row[at], row[at + 1], row[at + 2]
    vv, vb, bb = row[at + 3], row[at + 4], row[at + 5]
    row[at] = pp + t * (2.0 * pv + t * (vv + pb + t * (vb + 0.25 * t * bb)))
    row[at + 1] = pv + t * (vv + pb + t * (1.5 * vb + 0.5 * t * bb))
    row[at + 2] = pb + t * (vb + 0.5 * t * bb)
    row[at + 3] = vv + t * (2.0 * vb + t * bb) + _ACCEL_DENSITY * t
    row[at + 4] = vb + t * bb
    row[at + 5] = bb + _BIAS_DENSITY * t


@numeric
def _fuse_position(row: Array, axis: int, innovation: float, variance: float) -> float:
    """Update one axis by a position measurement and return the innovation in its standard deviations.

    Args:
        row: State row.
        axis: 0 north, 1 east, 2 down.
        innovation: Measurement less estimate [m].
        variance: Variance of the measurement [m^2].
    """
    at = K_COVARIANCE + 6 * axis
    pp, pv, pb = row[at], row[at + 1], row[at + 2]
    total = pp + variance
    gain_p, gain_v, gain_b = pp / total, pv / total, pb / total
    row[K_POSITION + axis] += gain_p * innovation
    row[K_VELOCITY + axis] += gain_v * innovation
    row[K_ACCEL_BIAS + axis] += gain_b * innovation
    row[at + 3] -= gain_v * pv
    row[at + 4] -= gain_v * pb
    row[at + 5] -= gain_b * pb
    row[at] = (1.0 - gain_p) * pp
    row[at + 1] = (1.0 - gain_p) * pv
    row[at + 2] = (1.0 - gain_p) * pb
    return abs(innovation) / sqrt(total)


@numeric
def _fuse_velocity(row: Array, axis: int, innovation: float, variance: float) -> None:
    """Update one axis by a velocity measurement [m/s] with its variance."""
    at = K_COVARIANCE + 6 * axis
    pv, vv, vb = row[at + 1], row[at + 3], row[at + 4]
    total = vv + variance
    gain_p, gain_v, gain_b = pv / total, vv / total, vb / total
    row[K_POSITION + axis] += gain_p * innovation
    row[K_VELOCITY + axis] += gain_v * innovation
    row[K_ACCEL_BIAS + axis] += gain_b * innovation
    row[at] -= gain_p * pv
    row[at + 2] -= gain_p * vb
    row[at + 5] -= gain_b * vb
    row[at + 1] = (1.0 - gain_v) * pv
    row[at + 3] = (1.0 - gain_v) * vv
    row[at + 4] = (1.0 - gain_v) * vb


@numeric
def _variance(row: Array, error: int) -> float:
    """Return the declared variance of the sensor whose error parameters are in column *error*."""
    white = row[error + WHITE_SIGMA]
    bias = row[error + BIAS_SIGMA]
    declared: float = white * white + bias * bias
    return declared


@numeric
def _reset_covariance(row: Array, axis: int, position: float, velocity: float) -> None:
    """Reset one axis' covariance to a variance of position and of velocity."""
    at = K_COVARIANCE + 6 * axis
    for i in range(6):
        row[at + i] = 0.0
    row[at] = position
    row[at + 3] = velocity
    row[at + 5] = 0.04


@numeric
def _switch_aiding(row: Array) -> None:
    """Begin or end the use of satellites as commanded by C_AIDED."""
    commanded = row[C_AIDED] > 0.5
    if commanded and row[C_AIDED] != BY_POSES and row[K_AIDED] < 0.5 and row[M_GPS_FIX] > 2.5:
        row[K_AIDED] = 1.0
        row[K_GPS_AGE] = 0.0
        for axis in range(3):
            row[K_POSITION + axis] = row[M_GPS + axis]
            if row[C_AIDED] < 1.5:
                row[K_ORIGIN + axis] = row[M_GPS + axis]
        for axis in range(2):
            row[K_VELOCITY + axis] = row[M_GPS_VELOCITY + axis]
            row[K_ACCEL_BIAS + axis] = 0.0
            _reset_covariance(
                row, axis, _variance(row, P_GPS_HORIZONTAL_ERROR), _variance(row, P_GPS_VELOCITY_ERROR)
            )
        row[K_BARO_OFFSET] = row[M_BARO] + row[M_GPS + 2]
    if not commanded and row[K_AIDED] > 0.5:
        row[K_AIDED] = 0.0
        for axis in range(2):
            row[K_VELOCITY + axis] = 0.0
            row[K_ACCEL_BIAS + axis] = 0.0


@numeric
def _refuses(row: Array, north: float, east: float, variance: float) -> bool:
    """Return whether a fix is too far from the estimate, and count the time for which all have been.

    The test of EKF3 (AP_NavEKF3_PosVelFusion): both innovations over the gate (EK3_POS_I_GATE) and their
    variances, that of the fix at least EK3_POSNE_M_NSE. After ten seconds the position is reset to the fix,
    and the shaped target moves with it, so that the vehicle does not.

    Args:
        row: State row.
        north: Innovation of the fix [m].
        east: Innovation of the fix [m].
        variance: Declared variance of each axis of a fix [m^2].
    """
    gate = row[C_GPS_GATE]
    if gate <= 0.0:
        return False
    least = max(variance, row[C_GPS_SIGMA] * row[C_GPS_SIGMA])
    total = row[K_COVARIANCE] + row[K_COVARIANCE + 6] + 2.0 * least
    if north * north + east * east < gate * gate * total:
        row[K_GPS_REFUSED] = 0.0
        return False
    row[K_GPS_REFUSED] += row[K_GPS_AGE]
    if row[K_GPS_REFUSED] < _RESET_AFTER:
        return True
    row[K_GPS_REFUSED] = 0.0
    sigma = 0.5 * row[C_GPS_RADIUS]
    for axis in range(2):
        jump = row[M_GPS + axis] - row[K_POSITION + axis]
        row[K_POSITION + axis] += jump
        row[K_TARGET + axis] += jump
        speed = row[K_COVARIANCE + 6 * axis + 3]
        _reset_covariance(row, axis, max(sigma * sigma, variance), speed)
    return True


@numeric
def _fuse_gps(row: Array) -> None:
    """Fuse a new fix, and correct the tilt by part of the estimated acceleration bias."""
    level, speed = _variance(row, P_GPS_HORIZONTAL_ERROR), _variance(row, P_GPS_VELOCITY_ERROR)
    worst = 0.0
    north, east = row[M_GPS] - row[K_POSITION], row[M_GPS + 1] - row[K_POSITION + 1]
    refused = _refuses(row, north, east, level)
    for axis in range(2):
        missed = north if axis == 0 else east
        if refused:
            total = row[K_COVARIANCE + 6 * axis] + max(level, row[C_GPS_SIGMA] * row[C_GPS_SIGMA])
            worst = max(worst, abs(missed) / sqrt(total))
        else:
            worst = max(worst, _fuse_position(row, axis, missed, level))
        _fuse_velocity(row, axis, row[M_GPS_VELOCITY + axis] - row[K_VELOCITY + axis], speed)
    row[K_GPS_INNOVATION] = worst
    if row[M_GPS_FIX] >= RTK_FIX:
        _fuse_position(row, 2, row[M_GPS + 2] - row[K_POSITION + 2], _variance(row, P_GPS_VERTICAL_ERROR))
        row[K_BARO_OFFSET] = row[M_BARO] + row[K_POSITION + 2]
    _fuse_velocity(row, 2, row[M_GPS_VELOCITY + 2] - row[K_VELOCITY + 2], 4.0 * speed)
    _level(row)
    row[K_GPS_AGE] = 0.0


@numeric
def _level(row: Array) -> None:
    """Correct the tilt by part of the estimated acceleration bias."""
    share = _TILT_GAIN * min(row[K_GPS_AGE], _STALE)
    north, east = share * row[K_ACCEL_BIAS], share * row[K_ACCEL_BIAS + 1]
    row[K_ACCEL_BIAS] -= north
    row[K_ACCEL_BIAS + 1] -= east
    _correct_attitude(row, east / row[P_GRAVITY], -north / row[P_GRAVITY], 0.0, _TILT_INTEGRAL / _TILT_GAIN)


@numeric
def _use_pose(row: Array) -> None:
    """Use a new external pose: its distance from the estimate was judged when it came."""
    variance = row[C_POSE_SIGMA] * row[C_POSE_SIGMA]
    resets = row[C_POSE_USE] == RESET
    starts = resets and row[K_AIDED] < 0.5
    row[K_GPS_INNOVATION] = max(abs(row[C_POSE]), abs(row[C_POSE + 1])) / sqrt(row[K_COVARIANCE] + variance)
    if row[C_POSE_USE] < FUSE or not (resets or row[K_AIDED] > 0.5):
        return
    for axis in range(2):
        if not resets:
            _fuse_position(row, axis, row[C_POSE + axis], variance)
            continue
        speed = row[K_COVARIANCE + 6 * axis + 3]
        row[K_POSITION + axis] += row[C_POSE + axis]
        row[K_TARGET + axis] += row[C_POSE + axis]
        if starts:
            row[K_VELOCITY + axis] = row[K_ACCEL_BIAS + axis] = 0.0
            speed = 1.0
        _reset_covariance(row, axis, variance, speed)
    row[K_AIDED] = 1.0
    if row[C_POSE_SIGMA + 1] > 0.0:
        if resets:
            row[K_POSITION + 2] += row[C_POSE + 2]
            row[K_TARGET + 2] += row[C_POSE + 2]
        else:
            _fuse_position(row, 2, row[C_POSE + 2], row[C_POSE_SIGMA + 1] * row[C_POSE_SIGMA + 1])
        row[K_BARO_OFFSET] = row[M_BARO] + row[K_POSITION + 2]
    if row[C_POSE_YAW] > 0.5:
        row[K_HEADING_ERROR] = -row[C_POSE_TURN]
        if starts:
            _correct_attitude(row, 0.0, 0.0, row[C_POSE_TURN], 0.0)
        else:
            _correct_heading(row, row[C_POSE_TURN])
    if not starts:
        _level(row)
    row[K_GPS_AGE] = 0.0


@numeric
def _fuse_gravity(row: Array, gravity: float) -> None:
    """Correct the tilt by the accelerometer: without satellites its mean direction is up."""
    fx, fy, fz = row[M_ACCEL], row[M_ACCEL + 1], row[M_ACCEL + 2]
    north, east = _horizontal(row, fx, fy, fz)
    share = _GRAVITY_GAIN * _FUSE_S / gravity
    _correct_attitude(row, -east * share, north * share, 0.0, 0.02)


@numeric
def _fuse_heading(row: Array) -> None:
    """Correct the heading by the difference of the measured field's direction and the declination."""
    mx, my, mz = row[M_MAG], row[M_MAG + 1], row[M_MAG + 2]
    north, east = _horizontal(row, mx, my, mz)
    declination = atan2(row[P_MAGNETIC_FIELD + 1], row[P_MAGNETIC_FIELD])
    error = wrap_angle(atan2(east, north) - declination)
    row[K_HEADING_ERROR] = error
    _correct_heading(row, -error)


@numeric
def _correct_heading(row: Array, turn: float) -> None:
    """Correct the heading by a share of what it is measured to be off, clockwise [rad]."""
    _correct_attitude(row, 0.0, 0.0, _HEADING_GAIN * _FUSE_S * turn, _HEADING_INTEGRAL / _HEADING_GAIN)


@numeric
def _fuse_height(row: Array) -> None:
    """Correct the height by the barometer, unless better satellites are used."""
    if row[M_GPS_FIX] >= RTK_FIX and row[K_AIDED] > 0.5 and row[C_AIDED] != BY_POSES:
        return
    missed = row[K_BARO_OFFSET] - row[M_BARO] - row[K_POSITION + 2]
    _fuse_position(row, 2, missed, _variance(row, P_BARO_ERROR))


@numeric
def _fuse_place(row: Array) -> None:
    """Fuse a new pose or fix, whichever is used."""
    if row[C_AIDED] == BY_POSES:
        if row[C_POSE_COUNT] != row[K_USED_POSE]:
            row[K_USED_POSE] = row[C_POSE_COUNT]
            _use_pose(row)
    elif row[M_GPS_COUNT] != row[K_USED_GPS] and row[K_AIDED] > 0.5:
        row[K_USED_GPS] = row[M_GPS_COUNT]
        _fuse_gps(row)


@numeric
def _fuse(row: Array) -> None:
    """Fuse the measurements that are new: 20 times a second."""
    _switch_aiding(row)
    row[K_GPS_AGE] += _FUSE_S
    for axis in range(3):
        if axis == 2 or row[K_AIDED] > 0.5:
            _propagate_covariance(row, axis)
    if row[M_BARO_COUNT] != row[K_USED_BARO]:
        row[K_USED_BARO] = row[M_BARO_COUNT]
        _fuse_height(row)
    if row[M_MAG_COUNT] != row[K_USED_MAG]:
        row[K_USED_MAG] = row[M_MAG_COUNT]
        if row[C_POSE_YAW] < 0.5:
            _fuse_heading(row)
    _fuse_place(row)
    if row[K_AIDED] < 0.5 or row[K_GPS_AGE] > _STALE:
        _fuse_gravity(row, row[P_GRAVITY])
    for index in range(2):
        at = K_COVARIANCE + 12 * index
        row[K_SIGMA + index] = sqrt(max(row[at], 0.0))
        row[K_SIGMA + 2 + index] = sqrt(max(row[at + 3], 0.0))


@numeric
def _align(row: Array) -> None:
    """Initialise the attitude: tilt from the accelerometer, heading from the magnetometer."""
    fx, fy, fz = row[M_ACCEL], row[M_ACCEL + 1], row[M_ACCEL + 2]
    roll = atan2(-fy, -fz)
    pitch = atan2(fx, sqrt(fy * fy + fz * fz))
    write_quaternion(row, K_ATTITUDE, roll, pitch, 0.0)
    rotation_matrix(row, K_ATTITUDE, W_DCM)
    mx, my, mz = row[M_MAG], row[M_MAG + 1], row[M_MAG + 2]
    north, east = _horizontal(row, mx, my, mz)
    yaw = atan2(row[P_MAGNETIC_FIELD + 1], row[P_MAGNETIC_FIELD]) - atan2(east, north)
    write_quaternion(row, K_ATTITUDE, roll, pitch, yaw)
    row[K_ALIGNED] = 1.0


@numeric
def _copy_truth(row: Array) -> None:
    """Set the estimate of a vehicle with perfect sensors: the true state in the autopilot's axes."""
    for axis in range(3):
        source = 1 - axis if axis < 2 else 2
        sign = 1.0 if axis < 2 else -1.0
        row[K_POSITION + axis] = sign * row[S_POSITION + source]
        row[K_VELOCITY + axis] = sign * row[S_VELOCITY + source]
        force = 0.0
        for body_axis in range(3):
            force += row[W_ROTATION + 3 * source + body_axis] * row[S_SPECIFIC_FORCE + body_axis]
        gravity = row[P_GRAVITY] if axis == 2 else 0.0
        row[K_ACCEL + axis] = sign * force + gravity
        row[K_RATES + axis] = row[S_RATES + axis] if axis == 0 else -row[S_RATES + axis]
    w, x, y, z = row[S_ATTITUDE], row[S_ATTITUDE + 1], row[S_ATTITUDE + 2], row[S_ATTITUDE + 3]
    row[K_ATTITUDE] = _HALF_ROOT * (w + z)
    row[K_ATTITUDE + 1] = _HALF_ROOT * (x + y)
    row[K_ATTITUDE + 2] = _HALF_ROOT * (x - y)
    row[K_ATTITUDE + 3] = _HALF_ROOT * (w - z)
    row[K_ALIGNED] = 1.0
    row[K_GPS_AGE] = 0.0
    if 0.5 < row[C_AIDED] < 1.5 and row[K_AIDED] < 0.5:
        for axis in range(3):
            row[K_ORIGIN + axis] = row[K_POSITION + axis]
    row[K_AIDED] = row[C_AIDED]


@numeric
def initialise_estimate(row: Array) -> None:
    """Initialise the estimate from the first samples."""
    if row[P_PERFECT] > 0.5:
        _copy_truth(row)
    else:
        _align(row)
        row[K_BARO_OFFSET] = row[M_BARO]
        _reset_covariance(row, 2, _variance(row, P_BARO_ERROR), 0.01)
    estimate_angles(row)


@numeric
def update_estimate(row: Array, k: int) -> None:
    """Compute the estimate of grid step *k*, just reached."""
    if row[P_PERFECT] > 0.5:
        _copy_truth(row)
    else:
        _predict(row)
        if k % FUSE_EVERY == 0:
            _fuse(row)
