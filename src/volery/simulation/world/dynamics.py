"""Equations of motion and power of multirotors and rovers, and the battery.

Battery: Thevenin's circuit without its RC branch (Tremblay and Dessaint, World Electric Vehicle Journal 3
(2009), call it the static part).

* V = OCV(s) - R I, P = V I, hence I = (OCV - sqrt(OCV^2 - 4 R P)) / (2 R).
* OCV(s), s = fraction left: piecewise linear, within 0.1 V of the measured cell of Chen and Rincon-Mora,
  IEEE Trans. Energy Conversion 21 (2006), eq. 2, from 5 % on; that cell was charged to 4.1 V, this to 4.2 V.
  Valid from 0 to 40 degrees C, at currents up to about 20 C. Voltage recovers at once after a load; ageing
  and self-discharge are not modelled.
* Voltage and current are those of the power at the end of a step, and hold over the next one.
* Beyond the battery's largest power (OCV^2 / 4R) the current stays at OCV / 2R: the battery browns out.

Multirotor: a rigid body under its rotors, drag, gravity and the ground.

* Rigid body: m v' = m g + R F, q' = q (0, w) / 2, I w' = M - w x I w (Newton and Euler), I diagonal.
* Rotor: w' = (u w_top V / V_full - w) / T, thrust k_T w^2, reaction torque k_Q w^2 with k_Q = k_T^1.5 / (FM
  sqrt(2 rho A)): momentum theory's induced power at the figure of merit FM (Leishman, Principles of
  Helicopter Aerodynamics, 2.3). Shaft power k_Q w^3; electrical power is that over the efficiency of motor
  and controller. Valid in hover and slow flight; the power of inflow, flapping, ground effect and the
  rotors' gyroscopic torque are not modelled.
* Drag: F = -c_1 (w_m / w_h) v - c_2 (|v_p| v_p + |v_a| v_a), v relative to the air, v_p its part in the plane
  of the rotors and v_a along their axis, w_m the rotors' mean speed and w_h that of hover. The first term is
  the momentum drag of turning rotors, as in ArduPilot's simulator (SIM_Motor, SIM_Frame), which takes the
  roots of the thrusts; valid to about 20 m/s. Rotation is damped by -c_w w.
* Inflow: in a climb along their axis the rotors lose c_3 v_a^2, also those that stand, by that simulator's
  law of the jet, k_T w^2 = c_3 v_out^2 with the speed v_out = 2 P / T of hover at the electrical power P.
* Ground: a spring and damper under each of four feet. A foot that rises is damped three times as much: an
  airframe yields and does not rebound, so that a fall without thrust ends on the feet unless the body leans
  far. ArduPilot's simulator sets a copter level at the first contact (SIM_Aircraft). Coulomb friction is
  smoothed below 5 cm/s, and stops a foot within a step at most. Upside down the body lies on four points as
  far above the centre.

Rover: a kinematic bicycle on the ground (Rajamani, Vehicle Dynamics and Control, 2.2).

* Speed: v' = (u v_top - v) / T_v, limited to the tyres' grip a_max; steering angle d' = (s d_top - d) / T_d;
  heading' = v tan(d) / L, limited to a_max / v. A skid-steered rover turns at s r_top with the lag T_d, at
  any speed.
* Power: rolling resistance, drag and acceleration over the drive's efficiency; braking recovers nothing.
* Valid on firm ground, on slopes below about 15 degrees, without slip; the body follows the ground, level in
  attitude.
"""

from __future__ import annotations

from math import sqrt

from volery.base.elementary import sine_cosine
from volery.base.numeric_code import numeric
from volery.simulation.world.state_layout import (
    OWN_LAWS,
    P_CAPACITY,
    P_CELLS,
    P_DAMPING,
    P_DRAG_LINEAR,
    P_DRAG_QUADRATIC,
    P_DRIVE_EFFICIENCY,
    P_EFFICIENCY,
    P_FEET,
    P_FRICTION,
    P_FULL_VOLTS,
    P_GRAVITY,
    P_GRIP,
    P_HOVER_SPEED,
    P_IDLE_POWER,
    P_INERTIA,
    P_INFLOW,
    P_MASS,
    P_MAX_ROTOR_SPEED,
    P_MAX_SPEED,
    P_MAX_STEERING,
    P_MAX_TURN_RATE,
    P_RESISTANCE,
    P_ROLLING,
    P_ROTOR_DECAY,
    P_ROTOR_SPIN,
    P_ROTOR_X,
    P_ROTOR_Y,
    P_ROTORS,
    P_SKID_STEERED,
    P_SPEED_DECAY,
    P_SPIN_DAMPING,
    P_STEERING_DECAY,
    P_STIFFNESS,
    P_THRUST,
    P_TORQUE,
    P_WHEELBASE,
    S_ATTITUDE,
    S_CHARGE,
    S_POSITION,
    S_RATES,
    S_ROTORS,
    S_VELOCITY,
    S_VOLTS,
    STEP_S,
    U_CURRENT,
    U_MOTOR_HEALTH,
    U_MOVED,
    U_PAYLOAD,
    U_PUSH,
    W_AIR_VELOCITY,
    W_FORCE,
    W_GROUND,
    W_ROTATION,
    W_SLOPE,
    W_STATE,
    W_THROTTLE,
    W_TORQUE,
    Array,
)

# --- battery ---

CELL_FULL_VOLTS = 4.2


@numeric
def cell_voltage(left: float) -> float:
    """Return the open-circuit voltage of one cell [V] with the fraction *left* of its charge.

    Below zero the cell breaks down.
    """
    if left >= 0.9:
        volts = 4.06 + (min(left, 1.0) - 0.9) * 1.4
    elif left >= 0.5:
        volts = 3.84 + (left - 0.5) * 0.55
    elif left >= 0.2:
        volts = 3.73 + (left - 0.2) * (11.0 / 30.0)
    elif left >= 0.1:
        volts = 3.67 + (left - 0.1) * 0.6
    elif left >= 0.05:
        volts = 3.52 + (left - 0.05) * 3.0
    else:
        volts = 3.0 + left * (10.4 if left >= 0.0 else 60.0)
    return max(0.0, volts)


@numeric
def battery_current(open_volts: float, resistance: float, power: float) -> float:
    """Return the current [A] at which the terminals give a power.

    Args:
        open_volts: Open-circuit voltage of the battery [V].
        resistance: Resistance of the battery [ohm].
        power: Power at the terminals [W].
    """
    room = open_volts * open_volts - 4.0 * resistance * power
    if room <= 0.0:
        return 0.5 * open_volts / resistance
    return 2.0 * power / (open_volts + sqrt(room))


# --- multirotor ---

_SLIP = 0.05  # [m/s] below which friction grows linearly with speed
_REBOUND = 3.0  # damping of a rising foot over that of a sinking one: no bounce at 15 m/s


@numeric
def electrical_power(row: Array) -> float:
    """Return the power [W] that rotors, autopilot and payload draw."""
    if row[U_MOVED] != OWN_LAWS and row[U_CURRENT] == row[U_CURRENT]:
        given: float = row[U_CURRENT] * row[S_VOLTS] + row[P_IDLE_POWER] + row[U_PAYLOAD]
        return given
    cubes = 0.0
    for i in range(int(row[P_ROTORS])):
        speed = row[S_ROTORS + i]
        cubes += speed * speed * speed
    shaft = row[P_TORQUE] * cubes
    power: float = shaft / row[P_EFFICIENCY] + row[P_IDLE_POWER] + row[U_PAYLOAD]
    return power


@numeric
def volts_amps(row: Array, power: float) -> tuple[float, float]:
    """Return voltage [V] and current [A] at the terminals at a power [W]."""
    left = 1.0 - row[S_CHARGE] / row[P_CAPACITY]
    open_volts = cell_voltage(left) * row[P_CELLS]
    amps = battery_current(open_volts, row[P_RESISTANCE], power)
    return open_volts - row[P_RESISTANCE] * amps, amps


@numeric
def rotation_matrix(row: Array, at: int, to: int) -> None:
    """Write the matrix of the quaternion in column *at* to column *to*: body axes to world axes."""
    w, x, y, z = row[at], row[at + 1], row[at + 2], row[at + 3]
    row[to] = 1.0 - 2.0 * (y * y + z * z)
    row[to + 1] = 2.0 * (x * y - w * z)
    row[to + 2] = 2.0 * (x * z + w * y)
    row[to + 3] = 2.0 * (x * y + w * z)
    row[to + 4] = 1.0 - 2.0 * (x * x + z * z)
    row[to + 5] = 2.0 * (y * z - w * x)
    row[to + 6] = 2.0 * (x * z - w * y)
    row[to + 7] = 2.0 * (y * z + w * x)
    row[to + 8] = 1.0 - 2.0 * (x * x + y * y)


@numeric
def write_quaternion(row: Array, to: int, roll: float, pitch: float, yaw: float) -> None:
    """Write the quaternion of roll, pitch and yaw [rad] to column *to*."""
    sr, cr = sine_cosine(0.5 * roll)
    sp, cp = sine_cosine(0.5 * pitch)
    sy, cy = sine_cosine(0.5 * yaw)
    row[to] = cr * cp * cy + sr * sp * sy
    row[to + 1] = sr * cp * cy - cr * sp * sy
    row[to + 2] = cr * sp * cy + sr * cp * sy
    row[to + 3] = cr * cp * sy - sr * sp * cy


@numeric
def _to_world(row: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Rotate a vector from body axes to east, north, up."""
    return (
        row[W_ROTATION] * x + row[W_ROTATION + 1] * y + row[W_ROTATION + 2] * z,
        row[W_ROTATION + 3] * x + row[W_ROTATION + 4] * y + row[W_ROTATION + 5] * z,
        row[W_ROTATION + 6] * x + row[W_ROTATION + 7] * y + row[W_ROTATION + 8] * z,
    )


@numeric
def _to_body(row: Array, east: float, north: float, up: float) -> tuple[float, float, float]:
    """Rotate a vector from east, north, up to body axes."""
    return (
        row[W_ROTATION] * east + row[W_ROTATION + 3] * north + row[W_ROTATION + 6] * up,
        row[W_ROTATION + 1] * east + row[W_ROTATION + 4] * north + row[W_ROTATION + 7] * up,
        row[W_ROTATION + 2] * east + row[W_ROTATION + 5] * north + row[W_ROTATION + 8] * up,
    )


@numeric
def _add_foot_contact(row: Array, x: float, y: float, z: float) -> None:
    """Add the force and torque of the ground on a foot at x, y, z in body axes [m]."""
    _, _, height = _to_world(row, x, y, z)
    depth = row[W_GROUND] - row[W_STATE + S_POSITION + 2] - height
    if depth <= 0.0:
        return
    p, q, r = row[W_STATE + S_RATES], row[W_STATE + S_RATES + 1], row[W_STATE + S_RATES + 2]
    east, north, up = _to_world(row, q * z - r * y, r * x - p * z, p * y - q * x)
    east += row[W_STATE + S_VELOCITY]
    north += row[W_STATE + S_VELOCITY + 1]
    up += row[W_STATE + S_VELOCITY + 2]
    damping = row[P_DAMPING] * (_REBOUND if up > 0.0 else 1.0)
    normal = max(0.0, row[P_STIFFNESS] * depth - damping * up)
    grip = row[P_FRICTION] * normal / max(sqrt(east * east + north * north), _SLIP)
    grip = min(grip, row[P_MASS] / (4.0 * STEP_S))
    row[W_FORCE] -= grip * east
    row[W_FORCE + 1] -= grip * north
    row[W_FORCE + 2] += normal
    fx, fy, fz = _to_body(row, -grip * east, -grip * north, normal)
    row[W_TORQUE] += y * fz - z * fy
    row[W_TORQUE + 1] += z * fx - x * fz
    row[W_TORQUE + 2] += x * fy - y * fx


@numeric
def _add_ground_contact(row: Array) -> None:
    """Add the force and torque of the ground on the four feet, or on four points above if upside down."""
    depth = -row[P_FEET + 2] if row[W_ROTATION + 8] >= 0.0 else row[P_FEET + 2]
    for foot in range(4):
        x = row[P_FEET] if foot < 2 else -row[P_FEET]
        y = row[P_FEET + 1] if foot % 2 == 0 else -row[P_FEET + 1]
        _add_foot_contact(row, x, y, depth)


@numeric
def turn_rotors(row: Array, at: int, to: int) -> None:
    """Advance the rotor speeds by half a step, from the state in column *at* to that in column *to*.

    Exact, because motor commands and voltage hold over a step.
    """
    top = row[P_MAX_ROTOR_SPEED] * row[S_VOLTS] / row[P_FULL_VOLTS]
    for i in range(int(row[P_ROTORS])):
        target = row[W_THROTTLE + i] * top
        row[to + S_ROTORS + i] = target + row[P_ROTOR_DECAY] * (row[at + S_ROTORS + i] - target)


@numeric
def is_pushed(row: Array) -> bool:
    """Return whether a force from outside acts on a multirotor."""
    pushed: bool = row[U_PUSH] != 0.0 or row[U_PUSH + 1] != 0.0 or row[U_PUSH + 2] != 0.0
    return pushed


@numeric
def _add_rotor_and_air_loads(row: Array) -> None:
    """Compute force (east, north, up, without gravity) and torque (forward, left, up) of rotors and air."""
    lift, turning = 0.0, 0.0
    for axis in range(3):
        row[W_TORQUE + axis] = 0.0
    for i in range(int(row[P_ROTORS])):
        turning += row[W_STATE + S_ROTORS + i]
        square = row[W_STATE + S_ROTORS + i] * row[W_STATE + S_ROTORS + i]
        thrust = row[P_THRUST] * square * row[U_MOTOR_HEALTH + i]
        lift += thrust
        row[W_TORQUE] += row[P_ROTOR_Y + i] * thrust
        row[W_TORQUE + 1] -= row[P_ROTOR_X + i] * thrust
        row[W_TORQUE + 2] += row[P_ROTOR_SPIN + i] * row[P_TORQUE] * square
    ve = row[W_STATE + S_VELOCITY] - row[W_AIR_VELOCITY]
    vn = row[W_STATE + S_VELOCITY + 1] - row[W_AIR_VELOCITY + 1]
    vu = row[W_STATE + S_VELOCITY + 2] - row[W_AIR_VELOCITY + 2]
    ae, an, au = row[W_ROTATION + 2], row[W_ROTATION + 5], row[W_ROTATION + 8]
    along = ve * ae + vn * an + vu * au
    plane = sqrt(max(0.0, ve * ve + vn * vn + vu * vu - along * along))
    momentum = row[P_DRAG_LINEAR] * turning / (row[P_ROTORS] * row[P_HOVER_SPEED])
    drag = momentum + row[P_DRAG_QUADRATIC] * plane
    lift -= row[P_DRAG_QUADRATIC] * (abs(along) - plane) * along
    if along > 0.0:
        lift -= row[P_INFLOW] * along * along
    row[W_FORCE] = ae * lift - drag * ve
    row[W_FORCE + 1] = an * lift - drag * vn
    row[W_FORCE + 2] = au * lift - drag * vu
    if is_pushed(row):
        for axis in range(3):
            for part in range(3):
                row[W_FORCE + axis] += row[P_MASS] * row[W_ROTATION + 3 * axis + part] * row[U_PUSH + part]
    for axis in range(3):
        row[W_TORQUE + axis] -= row[P_SPIN_DAMPING] * row[W_STATE + S_RATES + axis]


@numeric
def _attitude_slope(row: Array) -> None:
    """Compute the slopes of attitude quaternion and body rates, by Euler's equations."""
    p, q, r = row[W_STATE + S_RATES], row[W_STATE + S_RATES + 1], row[W_STATE + S_RATES + 2]
    w, x = row[W_STATE + S_ATTITUDE], row[W_STATE + S_ATTITUDE + 1]
    y, z = row[W_STATE + S_ATTITUDE + 2], row[W_STATE + S_ATTITUDE + 3]
    row[W_SLOPE + S_ATTITUDE] = 0.5 * (-x * p - y * q - z * r)
    row[W_SLOPE + S_ATTITUDE + 1] = 0.5 * (w * p + y * r - z * q)
    row[W_SLOPE + S_ATTITUDE + 2] = 0.5 * (w * q - x * r + z * p)
    row[W_SLOPE + S_ATTITUDE + 3] = 0.5 * (w * r + x * q - y * p)
    ix, iy, iz = row[P_INERTIA], row[P_INERTIA + 1], row[P_INERTIA + 2]
    row[W_SLOPE + S_RATES] = (row[W_TORQUE] + (iy - iz) * q * r) / ix
    row[W_SLOPE + S_RATES + 1] = (row[W_TORQUE + 1] + (iz - ix) * r * p) / iy
    row[W_SLOPE + S_RATES + 2] = (row[W_TORQUE + 2] + (ix - iy) * p * q) / iz


@numeric
def multirotor_slope(row: Array) -> None:
    """Compute the slope of a multirotor's motion in ``W_SLOPE``, at the state in ``W_STATE``."""
    rotation_matrix(row, W_STATE + S_ATTITUDE, W_ROTATION)
    _add_rotor_and_air_loads(row)
    reach = row[P_FEET] + row[P_FEET + 1] + row[P_FEET + 2]
    if row[W_STATE + S_POSITION + 2] - row[W_GROUND] < reach:
        _add_ground_contact(row)
    for axis in range(3):
        row[W_SLOPE + S_POSITION + axis] = row[W_STATE + S_VELOCITY + axis]
        row[W_SLOPE + S_VELOCITY + axis] = row[W_FORCE + axis] / row[P_MASS]
    row[W_SLOPE + S_VELOCITY + 2] -= row[P_GRAVITY]
    _attitude_slope(row)


@numeric
def total_thrust(row: Array) -> float:
    """Return the thrust of all rotors [N]."""
    squares = 0.0
    for i in range(int(row[P_ROTORS])):
        squares += row[S_ROTORS + i] * row[S_ROTORS + i]
    thrust: float = row[P_THRUST] * squares
    return thrust


# --- rover ---

S_STEER = S_ROTORS
"""Steering angle [rad]; skid-steered: turn rate [rad/s]."""
S_SPEED = S_ROTORS + 1
"""Forward speed of the wheels [m/s]."""
_STANDING = 0.001  # [m/s] below which rolling resistance has no sign


@numeric
def drive_power(row: Array, speed: float, acceleration: float) -> float:
    """Return the power [W] that the wheels draw from the battery.

    Args:
        row: State row.
        speed: Forward speed [m/s].
        acceleration: Forward acceleration [m/s^2].
    """
    pace = abs(speed)
    if pace < _STANDING:
        return 0.0
    drag = (row[P_DRAG_LINEAR] + row[P_DRAG_QUADRATIC] * pace) * pace
    resistance = row[P_ROLLING] * row[P_MASS] * row[P_GRAVITY] + drag
    push = acceleration if speed > 0.0 else -acceleration
    wheel = (resistance + row[P_MASS] * push) * pace
    power: float = max(0.0, wheel) / row[P_DRIVE_EFFICIENCY]
    return power


@numeric
def turn_rate(row: Array, speed: float, steer: float) -> float:
    """Return the rate of change of the heading [rad/s, anticlockwise].

    Args:
        row: State row.
        speed: Forward speed [m/s].
        steer: Steering angle [rad]; skid-steered: turn rate [rad/s].
    """
    if row[P_SKID_STEERED] > 0.5:
        rate = steer
    else:
        s, c = sine_cosine(steer)
        rate = speed * s / (c * row[P_WHEELBASE])
    most = row[P_GRIP] / max(abs(speed), 0.1)
    held: float = min(max(rate, -most), most)
    return held


@numeric
def turn_wheels(row: Array, at: int, to: int) -> None:
    """Advance steering and speed by half a step, from the state in column *at* to that in column *to*.

    The commands are steering (left positive) and throttle. Exact, because they hold over a step.
    """
    top = row[P_MAX_TURN_RATE] if row[P_SKID_STEERED] > 0.5 else row[P_MAX_STEERING]
    steer = row[W_THROTTLE] * top
    row[to + S_STEER] = steer + row[P_STEERING_DECAY] * (row[at + S_STEER] - steer)
    speed = row[at + S_SPEED]
    gain = (1.0 - row[P_SPEED_DECAY]) * (row[W_THROTTLE + 1] * row[P_MAX_SPEED] - speed)
    most = 0.5 * STEP_S * row[P_GRIP]
    row[to + S_SPEED] = speed + min(max(gain, -most), most)


@numeric
def rover_slope(row: Array) -> None:
    """Compute the slope of a rover's motion in ``W_SLOPE``, at the state in ``W_STATE``."""
    speed = row[W_STATE + S_SPEED]
    rate = turn_rate(row, speed, row[W_STATE + S_STEER])
    w, z = row[W_STATE + S_ATTITUDE], row[W_STATE + S_ATTITUDE + 3]
    row[W_SLOPE + S_ATTITUDE] = -0.5 * z * rate
    row[W_SLOPE + S_ATTITUDE + 3] = 0.5 * w * rate
    row[W_SLOPE + S_POSITION] = speed * (w * w - z * z)
    row[W_SLOPE + S_POSITION + 1] = speed * 2.0 * w * z


@numeric
def follow_ground(row: Array, ground: float, climb: float) -> None:
    """Write height, velocity and turn rate of a rover after a step: its wheels follow the ground."""
    speed = row[S_SPEED]
    w, z = row[S_ATTITUDE], row[S_ATTITUDE + 3]
    norm = sqrt(w * w + z * z)
    w, z = w / norm, z / norm
    row[S_ATTITUDE], row[S_ATTITUDE + 3] = w, z
    row[S_POSITION + 2] = ground
    row[S_VELOCITY] = speed * (w * w - z * z)
    row[S_VELOCITY + 1] = speed * 2.0 * w * z
    row[S_VELOCITY + 2] = climb
    row[S_RATES + 2] = turn_rate(row, speed, row[S_STEER])
