"""Guidance of a multirotor, 100 times a second: from a set-point to a target attitude and a collective.

The structure is that of ArduPilot 4.5's position controller. A target moves to the set-point with limited
speed, acceleration and jerk; its gains follow from those limits, and a point is approached with half of the
acceleration limit. The vehicle follows the target by a proportional position loop and a PID velocity loop
with the target's acceleration fed forward, and tilts its thrust towards the resulting acceleration. While the
lean is at its limit, target and integrator do not grow further in that direction. The integrator balances the
drag of the cruise; at the end of a leg it unwinds, which is the recorded overshoot. Gains are the defaults of
the PSC_* parameters.
"""

from __future__ import annotations

from math import pi, sqrt

from volery.base.elementary import atan2, sine_cosine
from volery.base.numeric_code import numeric
from volery.simulation.autopilots.flight_stack.flight_state import (
    ATTITUDE,
    C_ACCEL,
    C_ACCEL_Z,
    C_CLIMB,
    C_CONTROL,
    C_HOVER_KEPT,
    C_JERK,
    C_PITCH,
    C_POSITION,
    C_ROLL,
    C_SPEED,
    C_SPEED_DOWN,
    C_SPEED_UP,
    C_STRAIGHT,
    C_THROTTLE,
    C_TILT,
    C_VELOCITY,
    C_YAW,
    C_YAW_MODE,
    C_YAW_P,
    C_YAW_RATE,
    CLIMB,
    IDLE,
    K_ACCEL,
    K_AT_LOWER_LIMIT,
    K_ATTITUDE,
    K_CONTROL,
    K_EULER,
    K_FILTERED_ACCEL,
    K_HOVER_THROTTLE,
    K_LANDED,
    K_LAST_MISS,
    K_MISS_DERIVATIVE,
    K_ORIGIN,
    K_POSITION,
    K_SPOOL,
    K_STORED_HOVER,
    K_TARGET,
    K_TARGET_ACCEL,
    K_TARGET_EULER,
    K_TARGET_QUATERNION,
    K_TARGET_VELOCITY,
    K_THROTTLE,
    K_TILT_LIMITED,
    K_VELOCITY,
    K_VELOCITY_INTEGRAL,
    K_YAW_SPEED,
    K_YAW_TARGET,
    MOTOR,
    OFF,
    POSITION,
    POSITION_CLIMB,
    RATE,
    VELOCITY,
    VELOCITY_HEIGHT,
)
from volery.simulation.world.arithmetic import clip, wrap_angle
from volery.simulation.world.dynamics import write_quaternion
from volery.simulation.world.state_layout import Array

GUIDE_EVERY = 5  # grid steps
GUIDE_S = 0.01  # guidance period [s]
_GRAVITY = 9.80665
_POSITION_GAIN = 1.0  # PSC_POSXY_P, PSC_POSZ_P
_VELOCITY_GAIN = 2.0  # PSC_VELXY_P
_VELOCITY_INTEGRAL = 1.0  # PSC_VELXY_I
_VELOCITY_DERIVATIVE = 0.5  # PSC_VELXY_D
_MOST_INTEGRAL = 10.0  # [m/s^2] PSC_VELXY_IMAX
_FILTER_SHARE = GUIDE_S / (GUIDE_S + 1.0 / (2.0 * pi * 5.0))  # PSC_VELXY_FLTE, PSC_VELXY_FLTD: 5 Hz
_ERROR_BRAKE = 2.5  # [m/s^2] with which the position loop closes a large error
_CLIMB_GAIN = 5.0  # PSC_VELZ_P
_CLIMB_INTEGRAL = 1.5
_HELD = 2.0  # [m/s^2] by which a vehicle falls short of its acceleration downwards while something holds it
_HELD_INTEGRAL = 2.8  # [1/s] PSC_ACCZ_I of 1.0 over a hover throttle of 0.35
_APPROACH_SHARE = 0.5  # share of the acceleration limit, and of jerk over acceleration, to approach a point
_LEASH = 20.0  # [m] largest horizontal distance of target and vehicle, against run-away in strong wind
_HEIGHT_LEASH = 2.0  # [m] the same in height: on the ground the target waits
_SLEW = 1.05  # [rad/s] of yaw: ATC_SLEW_YAW
_SLEW_BRAKE = 1.6  # [rad/s^2]
_YAW_AHEAD = 0.5  # [rad] of the target over the heading
_YAW_AHEAD_FILTERED = 0.785  # [rad]: 45 degrees
_INPUT_GAIN = 1.0 / 0.15  # [1/s]: ATC_INPUT_TC
_YAW_ACCEL = 4.71  # [rad/s^2]: ATC_ACCEL_Y_MAX
_TC = 0.15  # [s] ATC_INPUT_TC
_LEARN_TIME = 10.0  # [s] of hover throttle: MOT_THST_HOVER
_OVERSPEED_GAIN = 2.0  # POSCONTROL_OVERSPEED_GAIN_Z
_MAX_LIFT = 2.2  # in multiples of gravity


@numeric
def approach(error: float, gain: float, brake: float) -> float:
    """Return the rate at which to close *error* so that a deceleration of *brake* suffices to stop at zero.

    Proportional (*gain*) near zero; farther away the square-root law v = sqrt(2 a (e - a / 2 gain^2)), which
    continues it with equal value and slope.

    Args:
        error: Distance to close.
        gain: Gain near zero [1/s].
        brake: Largest deceleration; not above 0: proportional everywhere.
    """
    if brake <= 0.0:
        return error * gain
    linear = brake / (gain * gain)
    if error > linear:
        return sqrt(2.0 * brake * (error - 0.5 * linear))
    if error < -linear:
        return -sqrt(2.0 * brake * (-error - 0.5 * linear))
    return error * gain


@numeric
def ramp(value: float, goal: float, most: float) -> float:
    """Return *value* moved towards *goal* by at most *most*."""
    return value + clip(goal - value, -most, most)


@numeric
def shorten(x: float, y: float, most: float) -> tuple[float, float]:
    """Return the vector (x, y), scaled to the length *most* where it is longer."""
    length = sqrt(x * x + y * y)
    if length <= most:
        return x, y
    scale = most / length
    return x * scale, y * scale


@numeric
def controls_horizontal(control: int) -> bool:
    """Return whether a control determines horizontal motion."""
    return control in (VELOCITY, POSITION, POSITION_CLIMB, VELOCITY_HEIGHT)


@numeric
def _cos_tilt(row: Array) -> float:
    """Return the cosine of the tilt, at least one half."""
    x, y = row[K_ATTITUDE + 1], row[K_ATTITUDE + 2]
    return clip(1.0 - 2.0 * (x * x + y * y), 0.5, 1.0)


@numeric
def _disturbance(row: Array, axis: int) -> float:
    """Return the acceleration that the present thrust balances besides inertia [m/s^2].

    Its causes are drag, wind and a wrong hover throttle.
    """
    w, x, y, z = row[K_ATTITUDE], row[K_ATTITUDE + 1], row[K_ATTITUDE + 2], row[K_ATTITUDE + 3]
    lift = row[K_THROTTLE] / row[K_HOVER_THROTTLE] * _GRAVITY
    if axis == 0:
        thrust = -2.0 * (x * z + w * y) * lift
    elif axis == 1:
        thrust = -2.0 * (y * z - w * x) * lift
    else:
        thrust = _GRAVITY - _cos_tilt(row) * lift
    return clip(thrust - row[K_ACCEL + axis], -4.0, 4.0)


@numeric
def _enter_control(row: Array, control: int, before: int) -> None:
    """Initialise a new control at the present position and velocity.

    The integrators start with the acceleration that the thrust balances now.
    """
    grounded = before in (OFF, IDLE)
    if not controls_horizontal(before):
        for axis in range(2):
            row[K_TILT_LIMITED + axis] = 0.0
            row[K_MISS_DERIVATIVE + axis] = 0.0
            row[K_LAST_MISS + axis] = 0.0
    for axis in range(3):
        known = controls_horizontal(before) or (axis == 2 and before == CLIMB)
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


@numeric
def _reset_target(row: Array) -> None:
    """Put the target where the vehicle stands and reset the integrators, on the ground."""
    for axis in range(3):
        row[K_TARGET + axis] = row[K_POSITION + axis]
        row[K_TARGET_VELOCITY + axis] = 0.0
        row[K_TARGET_ACCEL + axis] = 0.0
        row[K_VELOCITY_INTEGRAL + axis] = 0.0


@numeric
def _move_target(row: Array, axis: int, accel: float, jerk: float) -> None:
    """Integrate one axis of the target; *accel* is the acceleration that the limits allow."""
    target_accel = ramp(row[K_TARGET_ACCEL + axis], accel, jerk * GUIDE_S)
    row[K_TARGET_ACCEL + axis] = target_accel
    before = row[K_TARGET_VELOCITY + axis]
    row[K_TARGET_VELOCITY + axis] = before + target_accel * GUIDE_S
    row[K_TARGET + axis] += (before + 0.5 * target_accel * GUIDE_S) * GUIDE_S


@numeric
def _move_horizontally(row: Array, north: float, east: float) -> None:
    """Integrate the horizontal target; while the lean is at its limit it waits in that direction."""
    jerk = row[C_JERK] * GUIDE_S
    dn, de = shorten(north - row[K_TARGET_ACCEL], east - row[K_TARGET_ACCEL + 1], jerk)
    an, ae = row[K_TARGET_ACCEL] + dn, row[K_TARGET_ACCEL + 1] + de
    row[K_TARGET_ACCEL], row[K_TARGET_ACCEL + 1] = an, ae
    vn, ve = row[K_TARGET_VELOCITY], row[K_TARGET_VELOCITY + 1]
    ln, le = row[K_TILT_LIMITED], row[K_TILT_LIMITED + 1]
    behind_n, behind_e = row[K_TARGET] - row[K_POSITION], row[K_TARGET + 1] - row[K_POSITION + 1]
    if not (vn * ln + ve * le > 0.0 and behind_n * ln + behind_e * le > 0.0):
        row[K_TARGET] += (vn + 0.5 * an * GUIDE_S) * GUIDE_S
        row[K_TARGET + 1] += (ve + 0.5 * ae * GUIDE_S) * GUIDE_S
    slower = row[K_LAST_MISS] * ln + row[K_LAST_MISS + 1] * le > 0.0 and vn * ln + ve * le >= 0.0
    if not (slower and an * ln + ae * le > 0.0):
        row[K_TARGET_VELOCITY] = vn + an * GUIDE_S
        row[K_TARGET_VELOCITY + 1] = ve + ae * GUIDE_S
    ahead_n, ahead_e = shorten(
        row[K_TARGET] - row[K_POSITION], row[K_TARGET + 1] - row[K_POSITION + 1], _LEASH
    )
    row[K_TARGET] = row[K_POSITION] + ahead_n
    row[K_TARGET + 1] = row[K_POSITION + 1] + ahead_e


@numeric
def _speed_along(row: Array) -> tuple[float, float]:
    """Return the limits of horizontal and vertical speed towards the commanded point [m/s].

    Where the set-point asks for a straight line, both axes share the speed at which neither exceeds its own
    limit, as in ArduPilot's input shaping of positions; else each axis has its own limit.
    """
    speed = row[C_SPEED]
    north = row[C_POSITION] + row[K_ORIGIN] - row[K_TARGET]
    east = row[C_POSITION + 1] + row[K_ORIGIN + 1] - row[K_TARGET + 1]
    down = row[C_POSITION + 2] + row[K_ORIGIN + 2] - row[K_TARGET + 2]
    vertical = row[C_SPEED_DOWN] if down > 0.0 else row[C_SPEED_UP]
    if row[C_STRAIGHT] < 0.5:
        return speed, vertical
    level = sqrt(north * north + east * east)
    if level < 1e-3 or abs(down) < 1e-3:
        return speed, vertical
    if speed * abs(down) > vertical * level:
        return vertical * level / abs(down), vertical
    return speed, speed * abs(down) / level


@numeric
def _shape_horizontal(row: Array, control: int) -> None:
    """Move the horizontal target by one guidance period."""
    limit, stiffness = row[C_ACCEL], row[C_JERK] / row[C_ACCEL]
    if control in (POSITION, POSITION_CLIMB):
        north = row[C_POSITION] + row[K_ORIGIN] - row[K_TARGET]
        east = row[C_POSITION + 1] + row[K_ORIGIN + 1] - row[K_TARGET + 1]
        distance = sqrt(north * north + east * east)
        most = row[C_SPEED] if control == POSITION_CLIMB else _speed_along(row)[0]
        speed = min(approach(distance, _APPROACH_SHARE * stiffness, _APPROACH_SHARE * limit), most)
        scale = speed / distance if distance > 1e-9 else 0.0
        north, east = north * scale, east * scale
    else:
        north, east = shorten(row[C_VELOCITY], row[C_VELOCITY + 1], row[C_SPEED])
    dn = north - row[K_TARGET_VELOCITY]
    de = east - row[K_TARGET_VELOCITY + 1]
    gap = sqrt(dn * dn + de * de)
    push = min(approach(gap, stiffness, row[C_JERK]), limit)
    scale = push / gap if gap > 1e-9 else 0.0
    _move_horizontally(row, dn * scale, de * scale)


@numeric
def _overspeed(row: Array) -> float:
    """Return the factor on vertical acceleration and jerk of a target that is beyond its speed limits.

    ArduPilot brakes the harder, the faster the vehicle is: twice the speed over its limit.
    """
    down = row[K_TARGET_VELOCITY + 2]
    limit = row[C_SPEED_DOWN] if down > 0.0 else row[C_SPEED_UP]
    if limit <= 0.0 or abs(down) <= limit:
        return 1.0
    factor: float = _OVERSPEED_GAIN * abs(down) / limit
    return factor


@numeric
def _shape_vertical(row: Array, control: int) -> None:
    """Move the vertical target by one guidance period."""
    harder = _overspeed(row)
    limit, jerk = row[C_ACCEL_Z] * harder, row[C_JERK] * harder
    most = _speed_along(row)[1] if control == POSITION else 1e9
    if control in (POSITION, VELOCITY_HEIGHT):
        left = row[C_POSITION + 2] + row[K_ORIGIN + 2] - row[K_TARGET + 2]
        gain = _APPROACH_SHARE * row[C_JERK] / row[C_ACCEL_Z]
        down = clip(approach(left, gain, _APPROACH_SHARE * row[C_ACCEL_Z]), -most, most)
    elif control == VELOCITY:
        down = row[C_VELOCITY + 2]
    else:
        down = -row[C_CLIMB]
    down = clip(down, -row[C_SPEED_UP], row[C_SPEED_DOWN])
    push = approach(down - row[K_TARGET_VELOCITY + 2], jerk / limit, jerk)
    _move_target(row, 2, clip(push, -limit, limit), jerk)
    ahead = clip(row[K_TARGET + 2] - row[K_POSITION + 2], -_HEIGHT_LEASH, _HEIGHT_LEASH)
    row[K_TARGET + 2] = row[K_POSITION + 2] + ahead


@numeric
def _speed_miss(row: Array, axis: int) -> float:
    """Return the error of the velocity loop of one axis: the position loop's velocity minus the flown one."""
    error = row[K_TARGET + axis] - row[K_POSITION + axis]
    speed = row[K_TARGET_VELOCITY + axis] + approach(error, _POSITION_GAIN, _ERROR_BRAKE)
    miss: float = speed - row[K_VELOCITY + axis]
    return miss


@numeric
def _horizontal_accel(row: Array) -> tuple[float, float]:
    """Return the horizontal acceleration north, east [m/s^2] that the position and velocity loops request."""
    last_n, last_e = row[K_LAST_MISS], row[K_LAST_MISS + 1]
    mn = last_n + _FILTER_SHARE * (_speed_miss(row, 0) - last_n)
    me = last_e + _FILTER_SHARE * (_speed_miss(row, 1) - last_e)
    row[K_LAST_MISS], row[K_LAST_MISS + 1] = mn, me
    gn, ge = row[K_VELOCITY_INTEGRAL], row[K_VELOCITY_INTEGRAL + 1]
    if row[K_LANDED] < 0.5:
        grows = mn * row[K_TILT_LIMITED] + me * row[K_TILT_LIMITED + 1] > 0.0
        most = sqrt(gn * gn + ge * ge) if grows else _MOST_INTEGRAL
        step = _VELOCITY_INTEGRAL * GUIDE_S
        gn, ge = shorten(gn + step * mn, ge + step * me, most)
        row[K_VELOCITY_INTEGRAL], row[K_VELOCITY_INTEGRAL + 1] = gn, ge
    row[K_MISS_DERIVATIVE] += _FILTER_SHARE * ((mn - last_n) / GUIDE_S - row[K_MISS_DERIVATIVE])
    row[K_MISS_DERIVATIVE + 1] += _FILTER_SHARE * ((me - last_e) / GUIDE_S - row[K_MISS_DERIVATIVE + 1])
    north = _VELOCITY_GAIN * mn + gn + _VELOCITY_DERIVATIVE * row[K_MISS_DERIVATIVE]
    east = _VELOCITY_GAIN * me + ge + _VELOCITY_DERIVATIVE * row[K_MISS_DERIVATIVE + 1]
    return row[K_TARGET_ACCEL] + north, row[K_TARGET_ACCEL + 1] + east


@numeric
def _vertical_accel(row: Array, control: int) -> float:
    """Return the acceleration down [m/s^2] that the position and climb loops request.

    In a descent that the ground has ended, the integral of ArduPilot's acceleration loop closes the throttle:
    recorded 0.6 s after touch-down. In flight the vehicle has the acceleration that it is given.
    """
    miss = _speed_miss(row, 2)
    quick = row[K_TARGET_ACCEL + 2] + _CLIMB_GAIN * miss
    held = quick + row[K_VELOCITY_INTEGRAL + 2] - row[K_FILTERED_ACCEL + 2]
    if held > _HELD and control in (CLIMB, POSITION_CLIMB) and row[C_CLIMB] < 0.0:
        grown = row[K_VELOCITY_INTEGRAL + 2] + _HELD_INTEGRAL * held * GUIDE_S
        row[K_VELOCITY_INTEGRAL + 2] = clip(grown, -4.0, 4.0)
    elif row[K_AT_LOWER_LIMIT] < 0.5:
        grown = row[K_VELOCITY_INTEGRAL + 2] + _CLIMB_INTEGRAL * miss * GUIDE_S
        row[K_VELOCITY_INTEGRAL + 2] = clip(grown, -4.0, 4.0)
    accel: float = quick + row[K_VELOCITY_INTEGRAL + 2]
    return accel


@numeric
def _shape_yaw(row: Array) -> None:
    """Move the yaw target with limited rate and acceleration."""
    kind = int(row[C_YAW_MODE])
    if kind == 2:
        target = row[C_YAW_RATE]
    elif kind == 1:
        error = wrap_angle(row[C_YAW] - row[K_YAW_TARGET])
        target = clip(approach(error, 2.0, _SLEW_BRAKE), -_SLEW, _SLEW)
    elif kind == 3:
        error = wrap_angle(row[C_YAW] - row[K_YAW_TARGET])
        target = approach(error, _INPUT_GAIN, _YAW_ACCEL) + row[C_YAW_RATE]
    else:
        target = 0.0
    accel, most = 2.0 * _SLEW_BRAKE, _YAW_AHEAD
    if row[C_YAW_P] > 0.0:
        accel, most = _YAW_ACCEL, _YAW_AHEAD_FILTERED
    row[K_YAW_SPEED] = ramp(row[K_YAW_SPEED], target, accel * GUIDE_S)
    ahead = wrap_angle(row[K_YAW_TARGET] - row[K_EULER + 2])
    if abs(ahead) > most:
        row[K_YAW_TARGET] = wrap_angle(row[K_EULER + 2] + clip(ahead, -most, most))
    row[K_YAW_TARGET] = wrap_angle(row[K_YAW_TARGET] + row[K_YAW_SPEED] * GUIDE_S)


@numeric
def _set_target_angles(row: Array, roll: float, pitch: float) -> None:
    """Set the target attitude from roll, pitch and the yaw target."""
    yaw = row[K_YAW_TARGET]
    row[K_TARGET_EULER] = roll
    row[K_TARGET_EULER + 1] = pitch
    row[K_TARGET_EULER + 2] = yaw
    write_quaternion(row, K_TARGET_QUATERNION, roll, pitch, yaw)


@numeric
def _tilt_thrust(row: Array, north: float, east: float, lift: float) -> None:
    """Set the target attitude whose thrust gives a horizontal acceleration.

    Args:
        row: State row.
        north: Acceleration to the north [m/s^2].
        east: Acceleration to the east [m/s^2].
        lift: Vertical specific force, gravity included [m/s^2, up].
    """
    sy, cy = sine_cosine(row[K_YAW_TARGET])
    most = row[C_TILT]
    st, ct = sine_cosine(most)
    wanted_n, wanted_e = north, east
    north, east = shorten(north, east, max(lift, 3.0) * st / ct)
    limited = north != wanted_n or east != wanted_e
    row[K_TILT_LIMITED] = wanted_n if limited else 0.0
    row[K_TILT_LIMITED + 1] = wanted_e if limited else 0.0
    forward = north * cy + east * sy
    right = east * cy - north * sy
    pitch = atan2(-forward, max(lift, 3.0))
    _, cp = sine_cosine(pitch)
    roll = atan2(right * cp, max(lift, 3.0))
    _set_target_angles(row, clip(roll, -most, most), clip(pitch, -most, most))


@numeric
def _learn_hover_throttle(row: Array) -> None:
    """Adapt the hover throttle while the vehicle hardly accelerates."""
    steady = row[K_LANDED] < 0.5 and row[K_SPOOL] >= 1.0 and abs(row[K_VELOCITY + 2]) < 0.6
    x, y = row[K_ATTITUDE + 1], row[K_ATTITUDE + 2]
    level = x * x + y * y < 0.002
    if steady and level and abs(row[K_ACCEL + 2]) < 1.0:
        share = GUIDE_S / _LEARN_TIME
        if row[C_HOVER_KEPT] < 0.5:
            row[K_STORED_HOVER] += share * (row[K_THROTTLE] - row[K_STORED_HOVER])
        learnt = row[K_HOVER_THROTTLE] + share * (row[K_THROTTLE] - row[K_HOVER_THROTTLE])
        learnt = clip(learnt, 0.125, 0.6875)
        row[K_VELOCITY_INTEGRAL + 2] += _GRAVITY * (learnt / row[K_HOVER_THROTTLE] - 1.0)
        row[K_HOVER_THROTTLE] = learnt


@numeric
def _hold_nothing(row: Array) -> None:
    """Reset target and attitude: the vehicle stands, or falls."""
    _reset_target(row)
    row[K_THROTTLE] = 0.0
    row[K_YAW_TARGET] = row[K_EULER + 2]
    _set_target_angles(row, 0.0, 0.0)


@numeric
def _follow_angles(row: Array) -> None:
    """Low-pass the commanded roll and pitch into the target attitude."""
    share = GUIDE_S / _TC
    roll = row[K_TARGET_EULER] + share * (row[C_ROLL] - row[K_TARGET_EULER])
    pitch = row[K_TARGET_EULER + 1] + share * (row[C_PITCH] - row[K_TARGET_EULER + 1])
    _set_target_angles(row, roll, pitch)


@numeric
def _follow_horizontal(row: Array, control: int) -> None:
    """Tilt so that the vehicle follows the horizontal target."""
    _shape_horizontal(row, control)
    north, east = _horizontal_accel(row)
    _tilt_thrust(row, north, east, _GRAVITY)


@numeric
def _follow_vertical(row: Array, control: int) -> None:
    """Set the collective so that the vehicle follows the vertical target."""
    _shape_vertical(row, control)
    down = _vertical_accel(row, control)
    lift = clip(_GRAVITY - down, 0.0, _MAX_LIFT * _GRAVITY)
    row[K_THROTTLE] = clip(row[K_HOVER_THROTTLE] * lift / _GRAVITY / _cos_tilt(row), 0.0, 1.0)
    _learn_hover_throttle(row)


@numeric
def guide_multirotor(row: Array) -> None:
    """Run one guidance period: update the targets, the target attitude and the collective."""
    control = int(row[C_CONTROL])
    before = int(row[K_CONTROL])
    if control != before:
        _enter_control(row, control, before)
        row[K_CONTROL] = control
    if control in (OFF, IDLE, MOTOR):
        _hold_nothing(row)
        return
    if control == RATE:
        row[K_THROTTLE] = clip(row[C_THROTTLE], 0.0, 1.0)
        row[K_YAW_SPEED] = 0.0
        _set_target_angles(row, 0.0, 0.0)  # from which the next control begins
        return
    _shape_yaw(row)
    if row[K_SPOOL] < 1.0 and row[K_LANDED] > 0.5:
        _reset_target(row)
    if controls_horizontal(control):
        _follow_horizontal(row, control)
    else:
        _follow_angles(row)
    if control == ATTITUDE:
        row[K_THROTTLE] = clip(row[C_THROTTLE] / _cos_tilt(row), 0.0, 1.0)
    else:
        _follow_vertical(row, control)
