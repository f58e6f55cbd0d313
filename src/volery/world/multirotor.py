"""The law of a multirotor: a rigid body under four rotors, drag, gravity and the ground.

* Rigid body: m v' = m g + R F, q' = q (0, w) / 2, I w' = M - w x I w (Newton and Euler), I diagonal.
* Rotor: w' = (u w_top V / V_full - w) / T, thrust k_T w^2, reaction torque k_Q w^2 with
  k_Q = k_T^1.5 / (FM sqrt(2 rho A)): momentum theory's induced power at the figure of merit FM
  (Leishman, Principles of Helicopter Aerodynamics, 2.3). Shaft power k_Q w^3, electrical power that over the
  efficiency of motor and controller. Valid: hover and slow flight; inflow of climb or fast flight is left
  out, so are flapping, ground effect and the rotors' gyroscopic torque.
* Drag: F = -(c_1 + c_2 |v|) v, v relative to the air; valid to about 20 m/s. Spinning is damped by -c_w w.
* Ground: a spring and damper under each of four feet, Coulomb friction smoothed below 5 cm/s.
"""

from __future__ import annotations

from math import sqrt

from numba import njit

from volery.world.battery import cell_voltage, current
from volery.world.columns import (
    P_CAPACITY,
    P_CELLS,
    P_DAMPING,
    P_DRAG_LINEAR,
    P_DRAG_QUADRATIC,
    P_EFFICIENCY,
    P_FEET,
    P_FRICTION,
    P_FULL_VOLTS,
    P_GRAVITY,
    P_IDLE_POWER,
    P_INERTIA,
    P_MASS,
    P_RESISTANCE,
    P_ROTOR_LAG,
    P_ROTOR_SPIN,
    P_ROTOR_TOP,
    P_ROTOR_X,
    P_ROTOR_Y,
    P_SPIN_DAMPING,
    P_STIFFNESS,
    P_THRUST,
    P_TORQUE,
    S_ATTITUDE,
    S_CHARGE,
    S_ENERGY,
    S_POSITION,
    S_RATES,
    S_ROTORS,
    S_VELOCITY,
    U_MOTOR_HEALTH,
    U_PAYLOAD,
    Array,
    Work,
)

_SLIP = 0.05  # [m/s] below which friction grows linearly with speed


@njit(cache=False)
def electrical_power(state: Array, inputs: Array, parameters: Array) -> float:
    """Watts drawn at the battery's terminals: rotors, autopilot and payload."""
    cubes = 0.0
    for i in range(4):
        speed = state[S_ROTORS + i]
        cubes += speed * speed * speed
    shaft = parameters[P_TORQUE] * cubes
    power: float = shaft / parameters[P_EFFICIENCY] + parameters[P_IDLE_POWER] + inputs[U_PAYLOAD]
    return power


@njit(cache=False)
def volts_amps(state: Array, parameters: Array, power: float) -> tuple[float, float]:
    """Terminal volts and amperes at a state of charge and a power."""
    left = 1.0 - state[S_CHARGE] / parameters[P_CAPACITY]
    open_volts = cell_voltage(left) * parameters[P_CELLS]
    amps = current(open_volts, parameters[P_RESISTANCE], power)
    return open_volts - parameters[P_RESISTANCE] * amps, amps


@njit(cache=False)
def _feet(y: Array, parameters: Array, work: Work, ground: float) -> None:
    """Add what the ground does to four feet to work's force (east, north, up) and torque (body)."""
    rotation, force, torque = work.rotation, work.force, work.torque
    for foot in range(4):
        x = parameters[P_FEET] if foot < 2 else -parameters[P_FEET]
        left = parameters[P_FEET + 1] if foot % 2 == 0 else -parameters[P_FEET + 1]
        up = -parameters[P_FEET + 2]
        height = y[S_POSITION + 2] + rotation[2, 0] * x + rotation[2, 1] * left + rotation[2, 2] * up
        depth = ground - height
        if depth <= 0.0:
            continue
        spin_x = y[S_RATES + 1] * up - y[S_RATES + 2] * left
        spin_y = y[S_RATES + 2] * x - y[S_RATES] * up
        spin_z = y[S_RATES] * left - y[S_RATES + 1] * x
        ve = y[S_VELOCITY] + rotation[0, 0] * spin_x + rotation[0, 1] * spin_y + rotation[0, 2] * spin_z
        vn = y[S_VELOCITY + 1] + rotation[1, 0] * spin_x + rotation[1, 1] * spin_y + rotation[1, 2] * spin_z
        vu = y[S_VELOCITY + 2] + rotation[2, 0] * spin_x + rotation[2, 1] * spin_y + rotation[2, 2] * spin_z
        normal = max(0.0, parameters[P_STIFFNESS] * depth - parameters[P_DAMPING] * vu)
        grip = parameters[P_FRICTION] * normal / max(sqrt(ve * ve + vn * vn), _SLIP)
        fe, fn = -grip * ve, -grip * vn
        force[0] += fe
        force[1] += fn
        force[2] += normal
        bx = rotation[0, 0] * fe + rotation[1, 0] * fn + rotation[2, 0] * normal
        by = rotation[0, 1] * fe + rotation[1, 1] * fn + rotation[2, 1] * normal
        bz = rotation[0, 2] * fe + rotation[1, 2] * fn + rotation[2, 2] * normal
        torque[0] += left * bz - up * by
        torque[1] += up * bx - x * bz
        torque[2] += x * by - left * bx


@njit(cache=False)
def rotation_matrix(state: Array, rotation: Array) -> None:
    """The attitude quaternion in *state* as a matrix that takes body axes to east, north, up."""
    w, x, y, z = state[S_ATTITUDE], state[S_ATTITUDE + 1], state[S_ATTITUDE + 2], state[S_ATTITUDE + 3]
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
def _spin_up(y: Array, throttle: Array, inputs: Array, parameters: Array, out: Array) -> None:
    """Rotor speeds, charge and energy: what changes even in a body at rest."""
    power = electrical_power(y, inputs, parameters)
    volts, amps = volts_amps(y, parameters, power)
    top = parameters[P_ROTOR_TOP] * volts / parameters[P_FULL_VOLTS]
    for i in range(4):
        out[S_ROTORS + i] = (throttle[i] * top - y[S_ROTORS + i]) / parameters[P_ROTOR_LAG]
    out[S_CHARGE] = amps
    out[S_ENERGY] = volts * amps


@njit(cache=False)
def _loads(y: Array, inputs: Array, parameters: Array, work: Work) -> None:
    """Rotor and air loads into work: force east, north, up without gravity; torque forward, left, up."""
    rotation, force, torque, air = work.rotation, work.force, work.torque, work.air
    lift = 0.0
    torque[:] = 0.0
    for i in range(4):
        square = y[S_ROTORS + i] * y[S_ROTORS + i]
        thrust = parameters[P_THRUST] * square * inputs[U_MOTOR_HEALTH + i]
        lift += thrust
        torque[0] += parameters[P_ROTOR_Y + i] * thrust
        torque[1] -= parameters[P_ROTOR_X + i] * thrust
        torque[2] += parameters[P_ROTOR_SPIN + i] * parameters[P_TORQUE] * square
    ve = y[S_VELOCITY] - air[0]
    vn = y[S_VELOCITY + 1] - air[1]
    vu = y[S_VELOCITY + 2] - air[2]
    drag = parameters[P_DRAG_LINEAR] + parameters[P_DRAG_QUADRATIC] * sqrt(ve * ve + vn * vn + vu * vu)
    force[0] = rotation[0, 2] * lift - drag * ve
    force[1] = rotation[1, 2] * lift - drag * vn
    force[2] = rotation[2, 2] * lift - drag * vu
    for axis in range(3):
        torque[axis] -= parameters[P_SPIN_DAMPING] * y[S_RATES + axis]


@njit(cache=False)
def multirotor_slope(y: Array, inputs: Array, parameters: Array, work: Work, resting: bool) -> None:
    """The state's rate of change into ``work.slope``. A resting body keeps its place; its rotors may spin."""
    slope, rotation, force, torque = work.slope, work.rotation, work.force, work.torque
    _spin_up(y, work.throttle, inputs, parameters, slope)
    if resting:
        slope[:S_ROTORS] = 0.0
        return
    rotation_matrix(y, rotation)
    _loads(y, inputs, parameters, work)
    ground = work.ground[0]
    reach = parameters[P_FEET] + parameters[P_FEET + 1] + parameters[P_FEET + 2]
    if y[S_POSITION + 2] - ground < reach:
        _feet(y, parameters, work, ground)
    for axis in range(3):
        slope[S_POSITION + axis] = y[S_VELOCITY + axis]
        slope[S_VELOCITY + axis] = force[axis] / parameters[P_MASS]
    slope[S_VELOCITY + 2] -= parameters[P_GRAVITY]
    p, q, r = y[S_RATES], y[S_RATES + 1], y[S_RATES + 2]
    w, x, z = y[S_ATTITUDE], y[S_ATTITUDE + 1], y[S_ATTITUDE + 3]
    left = y[S_ATTITUDE + 2]
    slope[S_ATTITUDE] = 0.5 * (-x * p - left * q - z * r)
    slope[S_ATTITUDE + 1] = 0.5 * (w * p + left * r - z * q)
    slope[S_ATTITUDE + 2] = 0.5 * (w * q - x * r + z * p)
    slope[S_ATTITUDE + 3] = 0.5 * (w * r + x * q - left * p)
    ix, iy, iz = parameters[P_INERTIA], parameters[P_INERTIA + 1], parameters[P_INERTIA + 2]
    slope[S_RATES] = (torque[0] + (iy - iz) * q * r) / ix
    slope[S_RATES + 1] = (torque[1] + (iz - ix) * r * p) / iy
    slope[S_RATES + 2] = (torque[2] + (ix - iy) * p * q) / iz


@njit(cache=False)
def lift(state: Array, parameters: Array) -> float:
    """The rotors' thrust together [N]."""
    squares = 0.0
    for i in range(4):
        squares += state[S_ROTORS + i] * state[S_ROTORS + i]
    thrust: float = parameters[P_THRUST] * squares
    return thrust
