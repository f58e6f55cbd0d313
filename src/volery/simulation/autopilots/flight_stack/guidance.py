"""Kinematic shaping: targets that a vehicle can follow, with limited speed, acceleration and jerk.

Guidance of a multirotor, 100 times a second: from a set-point to a demanded attitude and a collective.

A target moves ahead with limited speed, acceleration and jerk; the vehicle follows it by position and
velocity loops with the target's acceleration fed forward, and leans its thrust to where that acceleration
points. Gains are the documented defaults of ArduPilot 4.5's PSC_* parameters where one exists.
"""

from __future__ import annotations

from math import sqrt

from numba import njit

from volery.simulation.autopilots.flight_stack.flight_layout import (
    ATTITUDE,
    C_ACCEL,
    C_ACCEL_Z,
    C_CLIMB,
    C_CONTROL,
    C_JERK,
    C_PITCH,
    C_POSITION,
    C_ROLL,
    C_SPEED,
    C_SPEED_DOWN,
    C_SPEED_UP,
    C_THROTTLE,
    C_TILT,
    C_VELOCITY,
    C_YAW,
    C_YAW_MODE,
    C_YAW_RATE,
    CLIMB,
    IDLE,
    K_ACCEL,
    K_AT_LOWER_LIMIT,
    K_ATTITUDE,
    K_CONTROL,
    K_EULER,
    K_HOVER_THROTTLE,
    K_LANDED,
    K_ORIGIN,
    K_POSITION,
    K_SPOOL,
    K_TARGET,
    K_TARGET_ACCEL,
    K_TARGET_EULER,
    K_TARGET_QUATERNION,
    K_TARGET_VELOCITY,
    K_THROTTLE,
    K_VELOCITY,
    K_VELOCITY_INTEGRAL,
    K_YAW_SPEED,
    K_YAW_TARGET,
    OFF,
    POSITION,
    POSITION_CLIMB,
    VELOCITY,
    VELOCITY_HEIGHT,
)
from volery.simulation.world.arithmetic import arc_tangent2, clip, sine_cosine, wrap_angle
from volery.simulation.world.state_layout import Array


@njit(cache=False)
def approach(error: float, gain: float, brake: float) -> float:
    """The rate at which to close *error* so that *brake* suffices to stop at zero.

    Proportional (*gain*) near the goal; further out the square-root law v = sqrt(2 a (e - a / 2 gain^2)) that
    joins it with equal value and slope.
    """
    if brake <= 0.0:
        return error * gain
    linear = brake / (gain * gain)
    if error > linear:
        return sqrt(2.0 * brake * (error - 0.5 * linear))
    if error < -linear:
        return -sqrt(2.0 * brake * (-error - 0.5 * linear))
    return error * gain


@njit(cache=False)
def ramp(value: float, goal: float, most: float) -> float:
    """*value* moved towards *goal* by at most *most*."""
    return value + clip(goal - value, -most, most)


@njit(cache=False)
def shorten(x: float, y: float, most: float) -> tuple[float, float]:
    """The vector (x, y), scaled down where it is longer than *most*."""
    length = sqrt(x * x + y * y)
    if length <= most:
        return x, y
    scale = most / length
    return x * scale, y * scale


GUIDE_EVERY = 5  # steps
GUIDE_S = 0.01
_GRAVITY = 9.80665
_POSITION_GAIN = 1.0  # PSC_POSXY_P, PSC_POSZ_P
_VELOCITY_GAIN = 2.0  # PSC_VELXY_P
_VELOCITY_INTEGRAL = 1.0  # PSC_VELXY_I
_CLIMB_GAIN = 5.0  # PSC_VELZ_P
_CLIMB_INTEGRAL = 1.5
_SHAPING_GAIN = 2.5  # [1/s] of target speed
_BRAKE_SHARE = 0.5  # of the acceleration limit: how a height is approached
_PLANE_SHARE = 0.39  # the same for a point in the plane
_LEASH = 4.0  # [m] that the target may be ahead in the plane: in wind it waits
_HEIGHT_LEASH = 2.0  # [m] the same in height: on the ground it waits
_SLEW = 1.05  # [rad/s] of yaw: ATC_SLEW_YAW
_SLEW_BRAKE = 1.6  # [rad/s^2]
_TC = 0.15  # [s] ATC_INPUT_TC
_LEARN_TIME = 10.0  # [s] of hover throttle: MOT_THST_HOVER
_MOST_LIFT = 2.2  # of gravity


@njit(cache=False)
def in_plane(control: int) -> bool:
    """Does this control hold anything in the plane?"""
    return control in (VELOCITY, POSITION, POSITION_CLIMB, VELOCITY_HEIGHT)


@njit(cache=False)
def _vertical(control: int) -> bool:
    return in_plane(control) or control == CLIMB


@njit(cache=False)
def _upright(row: Array) -> float:
    """Cosine of the tilt, held above a half."""
    x, y = row[K_ATTITUDE + 1], row[K_ATTITUDE + 2]
    return clip(1.0 - 2.0 * (x * x + y * y), 0.5, 1.0)


@njit(cache=False)
def _disturbance(row: Array, axis: int) -> float:
    """What the thrust now balances besides inertia (drag, wind, a wrong hover throttle) [m/s^2]."""
    w, x, y, z = row[K_ATTITUDE], row[K_ATTITUDE + 1], row[K_ATTITUDE + 2], row[K_ATTITUDE + 3]
    lift = row[K_THROTTLE] / row[K_HOVER_THROTTLE] * _GRAVITY
    if axis == 0:
        thrust = -2.0 * (x * z + w * y) * lift
    elif axis == 1:
        thrust = -2.0 * (y * z - w * x) * lift
    else:
        thrust = _GRAVITY - _upright(row) * lift
    return clip(thrust - row[K_ACCEL + axis], -4.0, 4.0)


@njit(cache=False)
def _enter(row: Array, control: int, before: int) -> None:
    """A new control takes over where the vehicle is, as fast as it is, and with what holds it now."""
    grounded = before in (OFF, IDLE)
    for axis in range(3):
        known = in_plane(before) if axis < 2 else _vertical(before)
        if not known:
            row[K_TARGET + axis] = row[K_POSITION + axis]
            row[K_TARGET_VELOCITY + axis] = row[K_VELOCITY + axis]
            row[K_TARGET_ACCEL + axis] = 0.0
            row[K_VELOCITY_INTEGRAL + axis] = 0.0 if grounded else _disturbance(row, axis)
    if grounded:
        row[K_YAW_TARGET] = row[K_EULER + 2]
        row[K_YAW_SPEED] = 0.0
        row[K_TARGET_EULER] = 0.0
        row[K_TARGET_EULER + 1] = 0.0


@njit(cache=False)
def _stay(row: Array) -> None:
    """On the ground: the target is where the vehicle stands, nothing is wound up."""
    for axis in range(3):
        row[K_TARGET + axis] = row[K_POSITION + axis]
        row[K_TARGET_VELOCITY + axis] = 0.0
        row[K_TARGET_ACCEL + axis] = 0.0
        row[K_VELOCITY_INTEGRAL + axis] = 0.0


@njit(cache=False)
def _move_target(row: Array, axis: int, speed: float, accel: float) -> None:
    """Integrate one axis of the target towards a speed; *accel* is what the limits allow now."""
    target_accel = ramp(row[K_TARGET_ACCEL + axis], accel, row[C_JERK] * GUIDE_S)
    row[K_TARGET_ACCEL + axis] = target_accel
    before = row[K_TARGET_VELOCITY + axis]
    row[K_TARGET_VELOCITY + axis] = before + target_accel * GUIDE_S
    row[K_TARGET + axis] += (before + 0.5 * target_accel * GUIDE_S) * GUIDE_S


@njit(cache=False)
def _shape_plane(row: Array, control: int) -> None:
    limit = row[C_ACCEL]
    if control in (POSITION, POSITION_CLIMB):
        north = row[C_POSITION] + row[K_ORIGIN] - row[K_TARGET]
        east = row[C_POSITION + 1] + row[K_ORIGIN + 1] - row[K_TARGET + 1]
        distance = sqrt(north * north + east * east)
        speed = min(approach(distance, _POSITION_GAIN, _PLANE_SHARE * limit), row[C_SPEED])
        scale = speed / distance if distance > 1e-9 else 0.0
        north, east = north * scale, east * scale
    else:
        north, east = shorten(row[C_VELOCITY], row[C_VELOCITY + 1], row[C_SPEED])
    dn = north - row[K_TARGET_VELOCITY]
    de = east - row[K_TARGET_VELOCITY + 1]
    gap = sqrt(dn * dn + de * de)
    push = min(approach(gap, _SHAPING_GAIN, row[C_JERK]), limit)
    scale = push / gap if gap > 1e-9 else 0.0
    _move_target(row, 0, north, dn * scale)
    _move_target(row, 1, east, de * scale)
    ahead_n, ahead_e = shorten(
        row[K_TARGET] - row[K_POSITION], row[K_TARGET + 1] - row[K_POSITION + 1], _LEASH
    )
    row[K_TARGET] = row[K_POSITION] + ahead_n
    row[K_TARGET + 1] = row[K_POSITION + 1] + ahead_e


@njit(cache=False)
def _shape_height(row: Array, control: int) -> None:
    limit = row[C_ACCEL_Z]
    if control in (POSITION, VELOCITY_HEIGHT):
        left = row[C_POSITION + 2] + row[K_ORIGIN + 2] - row[K_TARGET + 2]
        down = approach(left, _POSITION_GAIN, _BRAKE_SHARE * limit)
    elif control == VELOCITY:
        down = row[C_VELOCITY + 2]
    else:
        down = -row[C_CLIMB]
    down = clip(down, -row[C_SPEED_UP], row[C_SPEED_DOWN])
    push = approach(down - row[K_TARGET_VELOCITY + 2], _SHAPING_GAIN, row[C_JERK])
    _move_target(row, 2, down, clip(push, -limit, limit))
    ahead = clip(row[K_TARGET + 2] - row[K_POSITION + 2], -_HEIGHT_LEASH, _HEIGHT_LEASH)
    row[K_TARGET + 2] = row[K_POSITION + 2] + ahead


@njit(cache=False)
def _wanted_accel(row: Array, axis: int, gain: float, integral: float, hold: bool) -> float:
    """Position and velocity loop of one axis [m/s^2]."""
    error = row[K_TARGET + axis] - row[K_POSITION + axis]
    speed = row[K_TARGET_VELOCITY + axis] + approach(error, _POSITION_GAIN, 2.5)
    miss = speed - row[K_VELOCITY + axis]
    if not hold:
        grown = row[K_VELOCITY_INTEGRAL + axis] + integral * miss * GUIDE_S
        row[K_VELOCITY_INTEGRAL + axis] = clip(grown, -4.0, 4.0)
    accel: float = row[K_TARGET_ACCEL + axis] + gain * miss + row[K_VELOCITY_INTEGRAL + axis]
    return accel


@njit(cache=False)
def _turn(row: Array) -> None:
    """Move the yaw target with limited rate and acceleration."""
    kind = int(row[C_YAW_MODE])
    if kind == 2:
        wanted = row[C_YAW_RATE]
    elif kind == 1:
        error = wrap_angle(row[C_YAW] - row[K_YAW_TARGET])
        wanted = clip(approach(error, 2.0, _SLEW_BRAKE), -_SLEW, _SLEW)
    else:
        wanted = 0.0
    row[K_YAW_SPEED] = ramp(row[K_YAW_SPEED], wanted, 2.0 * _SLEW_BRAKE * GUIDE_S)
    ahead = wrap_angle(row[K_YAW_TARGET] - row[K_EULER + 2])
    if abs(ahead) > 0.5:
        row[K_YAW_TARGET] = wrap_angle(row[K_EULER + 2] + clip(ahead, -0.5, 0.5))
    row[K_YAW_TARGET] = wrap_angle(row[K_YAW_TARGET] + row[K_YAW_SPEED] * GUIDE_S)


@njit(cache=False)
def _demand_angles(row: Array, roll: float, pitch: float) -> None:
    """Demand a roll, a pitch and the yaw target."""
    yaw = row[K_YAW_TARGET]
    row[K_TARGET_EULER] = roll
    row[K_TARGET_EULER + 1] = pitch
    row[K_TARGET_EULER + 2] = yaw
    sr, cr = sine_cosine(0.5 * roll)
    sp, cp = sine_cosine(0.5 * pitch)
    sy, cy = sine_cosine(0.5 * yaw)
    row[K_TARGET_QUATERNION] = cr * cp * cy + sr * sp * sy
    row[K_TARGET_QUATERNION + 1] = sr * cp * cy - cr * sp * sy
    row[K_TARGET_QUATERNION + 2] = cr * sp * cy + sr * cp * sy
    row[K_TARGET_QUATERNION + 3] = cr * cp * sy - sr * sp * cy


@njit(cache=False)
def _lean(row: Array, north: float, east: float, lift: float) -> None:
    """Demand the attitude whose thrust gives an acceleration in the plane at a *lift* [m/s^2 up, with
    gravity].
    """
    sy, cy = sine_cosine(row[K_YAW_TARGET])
    most = row[C_TILT]
    st, ct = sine_cosine(most)
    north, east = shorten(north, east, max(lift, 3.0) * st / ct)
    forward = north * cy + east * sy
    right = east * cy - north * sy
    pitch = arc_tangent2(-forward, max(lift, 3.0))
    _, cp = sine_cosine(pitch)
    roll = arc_tangent2(right * cp, max(lift, 3.0))
    _demand_angles(row, clip(roll, -most, most), clip(pitch, -most, most))


@njit(cache=False)
def _learn_hover(row: Array) -> None:
    """Learn the collective that carries the weight, while the vehicle hardly accelerates."""
    steady = row[K_LANDED] < 0.5 and row[K_SPOOL] >= 1.0 and abs(row[K_VELOCITY + 2]) < 0.6
    level = row[K_ATTITUDE + 1] ** 2 + row[K_ATTITUDE + 2] ** 2 < 0.002
    if steady and level and abs(row[K_ACCEL + 2]) < 1.0:
        learnt = row[K_HOVER_THROTTLE] + GUIDE_S / _LEARN_TIME * (row[K_THROTTLE] - row[K_HOVER_THROTTLE])
        learnt = clip(learnt, 0.125, 0.6875)
        row[K_VELOCITY_INTEGRAL + 2] += _GRAVITY * (learnt / row[K_HOVER_THROTTLE] - 1.0)
        row[K_HOVER_THROTTLE] = learnt


@njit(cache=False)
def _rest(row: Array) -> None:
    """Nothing is held: the vehicle stands or falls."""
    _stay(row)
    row[K_THROTTLE] = 0.0
    row[K_YAW_TARGET] = row[K_EULER + 2]
    _demand_angles(row, 0.0, 0.0)


@njit(cache=False)
def _follow_angles(row: Array) -> None:
    """Roll and pitch as told, smoothed."""
    share = GUIDE_S / _TC
    roll = row[K_TARGET_EULER] + share * (row[C_ROLL] - row[K_TARGET_EULER])
    pitch = row[K_TARGET_EULER + 1] + share * (row[C_PITCH] - row[K_TARGET_EULER + 1])
    _demand_angles(row, roll, pitch)


@njit(cache=False)
def _follow_plane(row: Array, control: int) -> None:
    """Lean so that the vehicle follows the target in the plane."""
    _shape_plane(row, control)
    landed = row[K_LANDED] > 0.5
    north = _wanted_accel(row, 0, _VELOCITY_GAIN, _VELOCITY_INTEGRAL, landed)
    east = _wanted_accel(row, 1, _VELOCITY_GAIN, _VELOCITY_INTEGRAL, landed)
    _lean(row, north, east, _GRAVITY)


@njit(cache=False)
def _follow_height(row: Array, control: int) -> None:
    """Lift so that the vehicle follows the target in height."""
    _shape_height(row, control)
    lower = row[K_AT_LOWER_LIMIT] > 0.5
    down = _wanted_accel(row, 2, _CLIMB_GAIN, _CLIMB_INTEGRAL, lower)
    lift = clip(_GRAVITY - down, 0.0, _MOST_LIFT * _GRAVITY)
    row[K_THROTTLE] = clip(row[K_HOVER_THROTTLE] * lift / _GRAVITY / _upright(row), 0.0, 1.0)
    _learn_hover(row)


@njit(cache=False)
def guide_multirotor(row: Array) -> None:
    """One guidance period."""
    control = int(row[C_CONTROL])
    before = int(row[K_CONTROL])
    if control != before:
        _enter(row, control, before)
        row[K_CONTROL] = control
    if control in (OFF, IDLE):
        _rest(row)
        return
    _turn(row)
    if row[K_SPOOL] < 1.0 and row[K_LANDED] > 0.5:
        _stay(row)
    if in_plane(control):
        _follow_plane(row, control)
    else:
        _follow_angles(row)
    if control == ATTITUDE:
        row[K_THROTTLE] = clip(row[C_THROTTLE] / _upright(row), 0.0, 1.0)
    else:
        _follow_height(row, control)
