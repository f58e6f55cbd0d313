"""Control loops that end in actuator commands: attitude loops and mixer of a multirotor, loops of a rover.

* Attitude and rates, every grid step: the attitude error as a quaternion, limited by a square-root law, gives
  rates; a PID on each rate has its derivative on the measurement. The mixer gives roll and pitch precedence
  over yaw, and yaw over collective; in a descent torques hardly raise the collective, so that a vehicle on
  the ground stays there. Motor output is linear in thrust through ArduPilot's thrust curve
  (MOT_THST_EXPO, MOT_SPIN_MIN, MOT_SPIN_MAX), and independent of the voltage where C_FULL_VOLTS is above 0
  (MOT_BAT_VOLT_MAX, MOT_BAT_VOLT_MIN: apply_thrust_curve_and_volt_scaling of AP_MotorsMulticopter).
* Where C_YAW_P is above 0 yaw is ArduCopter's, which swings: angle gain ATC_ANG_YAW_P, its braking limited to
  120 degrees/s^2, and a rate loop on an error that is filtered at ATC_RAT_YAW_FLTE, 2.5 Hz. With its default
  gains on its own simulator's quadrotor the loop has a natural frequency of 5 rad/s and a damping of 0.36.
* Landed detector, every guidance period: ArduCopter's documented rule. In flight: collective at its lower
  limit, acceleration below 1 m/s^2 and vertical speed below 1 m/s for one second. On the ground, flight
  begins when the collective exceeds 0.8 of hover.
* Rover, every guidance period: from a set-point to steering and throttle.
"""

from __future__ import annotations

from math import pi, sqrt

from volery.base.elementary import atan2, sine_cosine
from volery.base.numeric_code import numeric
from volery.simulation.autopilots.flight_stack.flight_state import (
    C_ACCEL,
    C_CLIMB,
    C_COASTS,
    C_CONTROL,
    C_FULL_VOLTS,
    C_LEAST_VOLTS,
    C_MOTOR,
    C_PITCH_RATE,
    C_POSITION,
    C_ROLL_RATE,
    C_SPEED,
    C_STEERING,
    C_STICK,
    C_STICK_SHARE,
    C_THROTTLE,
    C_VELOCITY,
    C_YAW,
    C_YAW_FILTER,
    C_YAW_I,
    C_YAW_MODE,
    C_YAW_P,
    C_YAW_RATE,
    CLIMB,
    DRIVE,
    IDLE,
    K_ACCEL,
    K_AT_LOWER_LIMIT,
    K_ATTITUDE,
    K_CONTROL,
    K_EULER,
    K_FILTERED_ACCEL,
    K_HOVER_THROTTLE,
    K_LANDED,
    K_LANDED_TIME,
    K_LAST_RATES,
    K_MOTORS,
    K_ORIGIN,
    K_POSITION,
    K_RATE_DERIVATIVE,
    K_RATE_INTEGRAL,
    K_RATE_TUNING,
    K_RATES,
    K_SPEED_INTEGRAL,
    K_SPOOL,
    K_TARGET,
    K_TARGET_QUATERNION,
    K_TARGET_VELOCITY,
    K_THROTTLE,
    K_VELOCITY,
    K_VOLTS_SHARE,
    K_YAW_MISS,
    K_YAW_SPEED,
    MOTOR,
    OFF,
    POSITION_CLIMB,
    RATE,
    STEER,
    VELOCITY,
)
from volery.simulation.autopilots.flight_stack.guidance import GUIDE_S, approach, ramp
from volery.simulation.world.arithmetic import clip, wrap_angle
from volery.simulation.world.state_layout import (
    P_MAX_SPEED,
    P_MAX_STEERING,
    P_MAX_TURN_RATE,
    P_ROTOR_SPIN,
    P_ROTOR_X,
    P_ROTOR_Y,
    P_ROTORS,
    P_SKID_STEERED,
    P_WHEELBASE,
    S_VOLTS,
    STEP_S,
    Array,
)

_SURE = 1.0  # [s]
_ATTITUDE_GAIN = 4.5  # [1/s]
_YAW_GAIN = 4.0  # [1/s]
_TILT_BRAKE = 19.2  # [rad/s^2]: 1100 degrees
_YAW_BRAKE = 4.7  # [rad/s^2]: 270 degrees
_YAW_GAIN_FILTERED = 4.5  # [1/s]: ATC_ANG_YAW_P
_YAW_BRAKE_FILTERED = 2.09  # [rad/s^2]: 120 degrees
_TOP_RATE = 3.84  # [rad/s]: 220 degrees
_P = (0.11, 0.11, 0.5)
_I = (0.11, 0.11, 0.05)
_D = (0.0022, 0.0022, 0.0)
_I_MOST = 0.25
_SLOPE_FILTER = 0.2  # share of a new sample: 20 Hz
_SPIN_ARM = 0.10
_SPIN_MIN = 0.15
_SPIN_MAX = 0.95
_EXPO = 0.65
_VOLTS_FILTER = STEP_S / (STEP_S + 1.0 / (2.0 * pi * 0.5))  # AP_MOTORS_BATT_VOLT_FILT_HZ: 0.5 Hz
_SPOOL_TIME = 0.5  # [s]
_THROTTLE_MIX = 0.1  # ATC_THR_MIX_MIN: share of the hover throttle up to which torques raise the collective
_YAW_ROOM = 0.2  # of full thrust that yaw may always have


@numeric
def detect_landing(row: Array, control: int) -> None:
    """Update the landed detector: one guidance period."""
    motion = 0.0
    for axis in range(3):
        smooth = row[K_FILTERED_ACCEL + axis]
        smooth += 0.06 * (row[K_ACCEL + axis] - smooth)  # 1 Hz
        row[K_FILTERED_ACCEL + axis] = smooth
        motion += smooth * smooth
    if row[K_LANDED] > 0.5:
        row[K_LANDED_TIME] = 0.0
        flying = control not in (OFF, IDLE) and row[K_SPOOL] >= 1.0
        if flying and row[K_THROTTLE] > 0.8 * row[K_HOVER_THROTTLE]:
            row[K_LANDED] = 0.0
        return
    quiet = motion < 1.0 and abs(row[K_VELOCITY + 2]) < 1.0
    low = row[K_AT_LOWER_LIMIT] > 0.5 or row[K_THROTTLE] < 0.3 * row[K_HOVER_THROTTLE]
    if quiet and low:
        row[K_LANDED_TIME] += GUIDE_S
        if row[K_LANDED_TIME] >= _SURE:
            row[K_LANDED] = 1.0
    else:
        row[K_LANDED_TIME] = 0.0


@numeric
def _rate_targets(row: Array) -> tuple[float, float, float]:
    """Return the rates that turn the attitude into the target, forward, right, down [rad/s]."""
    w, x, y, z = row[K_ATTITUDE], row[K_ATTITUDE + 1], row[K_ATTITUDE + 2], row[K_ATTITUDE + 3]
    tw, tx, ty, tz = (
        row[K_TARGET_QUATERNION],
        row[K_TARGET_QUATERNION + 1],
        row[K_TARGET_QUATERNION + 2],
        row[K_TARGET_QUATERNION + 3],
    )
    ew = w * tw + x * tx + y * ty + z * tz
    sign = 2.0 if ew >= 0.0 else -2.0
    roll = sign * (w * tx - x * tw - y * tz + z * ty)
    pitch = sign * (w * ty + x * tz - y * tw - z * tx)
    yaw = sign * (w * tz - x * ty + y * tx - z * tw)
    gain, brake = _YAW_GAIN, _YAW_BRAKE
    if row[C_YAW_P] > 0.0:
        gain, brake = _YAW_GAIN_FILTERED, _YAW_BRAKE_FILTERED
    return (
        clip(approach(roll, _ATTITUDE_GAIN, _TILT_BRAKE), -_TOP_RATE, _TOP_RATE),
        clip(approach(pitch, _ATTITUDE_GAIN, _TILT_BRAKE), -_TOP_RATE, _TOP_RATE),
        clip(approach(yaw, gain, brake) + row[K_YAW_SPEED], -_TOP_RATE, _TOP_RATE),
    )


@numeric
def _torque(row: Array, axis: int, target: float) -> float:
    """Return the output of one rate's PID as a share of full thrust by which motors differ."""
    rate = row[K_RATES + axis]
    error = target - rate
    if row[K_LANDED] > 0.5 or row[K_SPOOL] < 1.0:
        row[K_RATE_INTEGRAL + axis] *= 1.0 - STEP_S / 0.2
    else:
        grown = row[K_RATE_INTEGRAL + axis] + _I[axis] * error * STEP_S
        row[K_RATE_INTEGRAL + axis] = clip(grown, -_I_MOST, _I_MOST)
    slope = (rate - row[K_LAST_RATES + axis]) / STEP_S
    row[K_LAST_RATES + axis] = rate
    row[K_RATE_DERIVATIVE + axis] += _SLOPE_FILTER * (slope - row[K_RATE_DERIVATIVE + axis])
    torque: float = _P[axis] * error + row[K_RATE_INTEGRAL + axis] - _D[axis] * row[K_RATE_DERIVATIVE + axis]
    return torque


@numeric
def _filtered_yaw_torque(row: Array, target: float) -> float:
    """Return the output of the yaw rate's PI on its filtered error."""
    share = 1.0 - 1.0 / (1.0 + row[C_YAW_FILTER] * STEP_S)
    row[K_YAW_MISS] += share * (target - row[K_RATES + 2] - row[K_YAW_MISS])
    if row[K_LANDED] > 0.5 or row[K_SPOOL] < 1.0:
        row[K_RATE_INTEGRAL + 2] *= 1.0 - STEP_S / 0.2
    else:
        grown = row[K_RATE_INTEGRAL + 2] + row[C_YAW_I] * row[K_YAW_MISS] * STEP_S
        row[K_RATE_INTEGRAL + 2] = clip(grown, -_I_MOST, _I_MOST)
    torque: float = row[C_YAW_P] * row[K_YAW_MISS] + row[K_RATE_INTEGRAL + 2]
    return torque


@numeric
def motor_output(thrust: float, volts_share: float) -> float:
    """Return the motor command 0..1 for a share of full thrust, at a share of the voltage of full thrust."""
    linear = 1.0 - _EXPO
    curve = (sqrt(linear * linear + 4.0 * _EXPO * clip(thrust, 0.0, 1.0)) - linear) / (2.0 * _EXPO)
    return _SPIN_MIN + (_SPIN_MAX - _SPIN_MIN) * min(1.0, curve / volts_share)


def thrust_share(command: float) -> float:
    """Return the share of full thrust for which ``motor_output`` gives a motor command, at full voltage."""
    curve = clip((command - _SPIN_MIN) / (_SPIN_MAX - _SPIN_MIN), 0.0, 1.0)
    share: float = _EXPO * curve * curve + (1.0 - _EXPO) * curve
    return share


@numeric
def _volts_share(row: Array) -> float:
    """Return the filtered voltage over that of full thrust: one grid step."""
    full = row[C_FULL_VOLTS]
    if full <= 0.0:
        return 1.0
    now = clip(row[S_VOLTS], max(row[C_LEAST_VOLTS], 0.6 * full), full) / full
    if row[K_VOLTS_SHARE] == 0.0:
        row[K_VOLTS_SHARE] = now
    row[K_VOLTS_SHARE] += _VOLTS_FILTER * (now - row[K_VOLTS_SHARE])
    share: float = row[K_VOLTS_SHARE]
    return share


@numeric
def _sinks(row: Array, control: int) -> bool:
    """Return whether a descent is demanded."""
    if control == VELOCITY:
        return bool(row[C_VELOCITY + 2] > 0.0)
    return control in (CLIMB, POSITION_CLIMB) and bool(row[C_CLIMB] < 0.0)


@numeric
def _mix(row: Array, roll: float, pitch: float, yaw: float) -> None:
    """Write motor commands from three torques and the collective."""
    reach = 1e-9
    count = int(row[P_ROTORS])
    for i in range(count):
        reach = max(reach, abs(row[P_ROTOR_X + i]), abs(row[P_ROTOR_Y + i]))
    low, high = 0.0, 0.0
    for i in range(count):
        share = (roll * row[P_ROTOR_Y + i] + pitch * row[P_ROTOR_X + i]) / reach
        row[K_MOTORS + i] = share
        low, high = min(low, share), max(high, share)
    scale = 1.0 if high - low <= 1.0 else 1.0 / (high - low)
    target = row[K_THROTTLE] * row[K_SPOOL]
    room = target + max(0.0, _THROTTLE_MIX * (row[K_HOVER_THROTTLE] - target))
    if -low * scale > room and _sinks(row, int(row[C_CONTROL])):
        scale = room / -low
    low, high = low * scale, high * scale
    collective = clip(target, -low, max(1.0 - high, -low))
    row[K_AT_LOWER_LIMIT] = 1.0 if target <= 0.01 - low else 0.0
    share = _volts_share(row)
    room = max(min(collective + low, 1.0 - collective - high), _YAW_ROOM * 0.5)
    yaw = clip(yaw, -room, room)
    for i in range(count):
        thrust = collective + scale * row[K_MOTORS + i] - yaw * row[P_ROTOR_SPIN + i]
        row[K_MOTORS + i] = motor_output(thrust, share)


@numeric
def run_attitude_loops(row: Array, control: int) -> None:
    """Run one grid step of the inner loops, from target attitude and collective to motor commands."""
    if control in (OFF, IDLE, MOTOR):
        idle = _SPIN_ARM if control == IDLE else 0.0
        for i in range(int(row[P_ROTORS])):
            row[K_MOTORS + i] = min(idle, row[K_MOTORS + i] + STEP_S / _SPOOL_TIME)
        for axis in range(3):
            row[K_RATE_INTEGRAL + axis] = 0.0
            row[K_LAST_RATES + axis] = row[K_RATES + axis]
            row[K_RATE_DERIVATIVE + axis] = 0.0
        row[K_YAW_MISS] = 0.0
        row[K_SPOOL] = 0.0
        row[K_AT_LOWER_LIMIT] = 1.0
        if control == MOTOR:
            row[K_MOTORS + int(row[C_MOTOR])] = row[C_THROTTLE]
        return
    row[K_SPOOL] = min(1.0, row[K_SPOOL] + STEP_S / _SPOOL_TIME)
    if control == RATE:
        roll_rate, pitch_rate, yaw_rate = row[C_ROLL_RATE], row[C_PITCH_RATE], row[C_YAW_RATE]
    else:
        roll_rate, pitch_rate, yaw_rate = _rate_targets(row)
    roll = _torque(row, 0, roll_rate)
    pitch = _torque(row, 1, pitch_rate)
    yaw = _filtered_yaw_torque(row, yaw_rate) if row[C_YAW_P] > 0.0 else _torque(row, 2, yaw_rate)
    spool = row[K_SPOOL]
    roll, pitch, yaw = (
        roll * row[K_RATE_TUNING],
        pitch * row[K_RATE_TUNING + 1],
        yaw * row[K_RATE_TUNING + 2],
    )
    _mix(row, roll * spool, pitch * spool, yaw * spool)


_TURN_GAIN = 1.5  # [1/s]
_SPEED_GAIN = 0.2  # ATC_SPEED_P [1/(m/s)]
_SPEED_INTEGRAL = 0.2  # ATC_SPEED_I
_POINT_GAIN = 0.7  # [1/s] of speed on the last metre
_BRAKE_SHARE = 0.6  # of the acceleration limit: how a point is approached
_CLOSE = 0.3  # [m] to a point, within which the rover stops


@numeric
def _forward_speed(row: Array) -> float:
    """Return the estimated speed along the heading [m/s]."""
    s, c = sine_cosine(row[K_EULER + 2])
    speed: float = row[K_VELOCITY] * c + row[K_VELOCITY + 1] * s
    return speed


@numeric
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
    angle = atan2(rate * row[P_WHEELBASE] * (1.0 if pace > 0.0 else -1.0), abs(pace))
    return clip(angle / row[P_MAX_STEERING], -1.0, 1.0)


@numeric
def _throttle_for(row: Array, target: float) -> float:
    """Return the throttle -1..1 for a speed [m/s]: feed-forward and PI."""
    miss = target - _forward_speed(row)
    if target == 0.0 and abs(miss) < 0.05:
        row[K_SPEED_INTEGRAL] = 0.0
        return 0.0
    grown = row[K_SPEED_INTEGRAL] + _SPEED_INTEGRAL * miss * GUIDE_S
    row[K_SPEED_INTEGRAL] = clip(grown, -0.3, 0.3)
    throttle: float = clip(target / row[P_MAX_SPEED] + _SPEED_GAIN * miss + row[K_SPEED_INTEGRAL], -1.0, 1.0)
    if row[C_COASTS] > 0.5 and throttle * (1.0 if target >= 0.0 else -1.0) < 0.0:
        return 0.0
    return throttle


@numeric
def _to_point(row: Array) -> tuple[float, float]:
    """Return speed [m/s] and turn rate [rad/s] on the way to the commanded point."""
    north = row[C_POSITION] + row[K_ORIGIN] - row[K_POSITION]
    east = row[C_POSITION + 1] + row[K_ORIGIN + 1] - row[K_POSITION + 1]
    distance = sqrt(north * north + east * east)
    for axis in range(3):
        row[K_TARGET + axis] = row[C_POSITION + axis] + row[K_ORIGIN + axis]
    if distance < _CLOSE:
        return 0.0, 0.0
    error = wrap_angle(atan2(east, north) - row[K_EULER + 2])
    _, ahead = sine_cosine(error)
    speed = min(approach(distance, _POINT_GAIN, _BRAKE_SHARE * row[C_ACCEL]), row[C_SPEED])
    return speed * clip(ahead, 0.2, 1.0), clip(_TURN_GAIN * error, -1.5, 1.5)


@numeric
def _along(row: Array) -> tuple[float, float]:
    """Return the commanded speed [m/s] and turn rate [rad/s]."""
    kind = int(row[C_YAW_MODE])
    rate = 0.0
    if kind == 1:
        rate = clip(_TURN_GAIN * wrap_angle(row[C_YAW] - row[K_EULER + 2]), -1.5, 1.5)
    elif kind == 2:
        rate = row[C_YAW_RATE]
    return clip(row[C_VELOCITY], -row[C_SPEED], row[C_SPEED]), rate


@numeric
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
        if row[C_STICK_SHARE] > 0.0:
            mixed = row[K_MOTORS] * (1.0 - row[C_STICK_SHARE]) + row[C_STICK]
            row[K_MOTORS] = clip(mixed, -1.0, 1.0)
        row[K_MOTORS + 1] = _throttle_for(row, target)
    row[K_THROTTLE] = row[K_MOTORS + 1]
