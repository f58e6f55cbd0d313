"""The law of a rover: a bicycle on the ground.

* Speed: v' = (u v_top - v) / T_v, at most the tyres' grip a_max; steering angle d' = (s d_top - d) / T_d; heading' = v tan(d) / L, held
  to the grip by limiting the turn rate to a_max / v (Rajamani, Vehicle Dynamics and Control,
  2.2: the kinematic bicycle). A skid-steered one turns at s r_top with the lag T_d and needs no speed for it.
* Power: rolling resistance, drag and acceleration against the drive's efficiency; braking returns nothing.
* Valid: firm ground, slopes below about 15 degrees, no slip angle; the body follows the ground, level in
  attitude.
"""

from __future__ import annotations

from math import sqrt

from numba import njit

from volery.world.arithmetic import sine_cosine
from volery.world.columns import (
    P_DRAG_LINEAR,
    P_DRAG_QUADRATIC,
    P_DRIVE_EFFICIENCY,
    P_GRAVITY,
    P_GRIP,
    P_IDLE_POWER,
    P_MASS,
    P_ROLLING,
    P_SKID,
    P_SPEED_LAG,
    P_SPEED_TOP,
    P_STEER_LAG,
    P_STEER_TOP,
    P_TURN_TOP,
    P_WHEELBASE,
    S_ATTITUDE,
    S_CHARGE,
    S_ENERGY,
    S_POSITION,
    S_RATES,
    S_ROTORS,
    S_VELOCITY,
    U_PAYLOAD,
    Array,
    Work,
)
from volery.world.multirotor import volts_amps

S_STEER = S_ROTORS
S_SPEED = S_ROTORS + 1
_STANDING = 0.001  # [m/s] below which rolling resistance has no sign


@njit(cache=False)
def drive_power(speed: float, acceleration: float, parameters: Array) -> float:
    """Watts at the battery for the wheels at a speed [m/s] and an acceleration [m/s^2]."""
    pace = abs(speed)
    if pace < _STANDING:
        return 0.0
    drag = (parameters[P_DRAG_LINEAR] + parameters[P_DRAG_QUADRATIC] * pace) * pace
    resistance = parameters[P_ROLLING] * parameters[P_MASS] * parameters[P_GRAVITY] + drag
    push = acceleration if speed > 0.0 else -acceleration
    wheel = (resistance + parameters[P_MASS] * push) * pace
    power: float = max(0.0, wheel) / parameters[P_DRIVE_EFFICIENCY]
    return power


@njit(cache=False)
def turn_rate(speed: float, steer: float, parameters: Array) -> float:
    """Heading's rate of change [rad/s, anticlockwise] at a speed and a steering angle (skid: a turn rate)."""
    if parameters[P_SKID] > 0.5:
        rate = steer
    else:
        s, c = sine_cosine(steer)
        rate = speed * s / (c * parameters[P_WHEELBASE])
    most = parameters[P_GRIP] / max(abs(speed), 0.1)
    held: float = min(max(rate, -most), most)
    return held


@njit(cache=False)
def rover_slope(y: Array, inputs: Array, parameters: Array, work: Work, resting: bool) -> None:
    """The state's rate of change into ``work.slope``; commands: steering (left positive), throttle."""
    slope = work.slope
    slope[:] = 0.0
    speed = y[S_SPEED]
    skid = parameters[P_SKID] > 0.5
    top = parameters[P_TURN_TOP] if skid else parameters[P_STEER_TOP]
    power = parameters[P_IDLE_POWER] + inputs[U_PAYLOAD]
    if not resting:
        slope[S_STEER] = (work.throttle[0] * top - y[S_STEER]) / parameters[P_STEER_LAG]
        wanted = work.throttle[1] * parameters[P_SPEED_TOP]
        push = (wanted - speed) / parameters[P_SPEED_LAG]
        slope[S_SPEED] = min(max(push, -parameters[P_GRIP]), parameters[P_GRIP])
        rate = turn_rate(speed, y[S_STEER], parameters)
        w, z = y[S_ATTITUDE], y[S_ATTITUDE + 3]
        slope[S_ATTITUDE] = -0.5 * z * rate
        slope[S_ATTITUDE + 3] = 0.5 * w * rate
        slope[S_POSITION] = speed * (w * w - z * z)
        slope[S_POSITION + 1] = speed * 2.0 * w * z
        power += drive_power(speed, slope[S_SPEED], parameters)
    volts, amps = volts_amps(y, parameters, power)
    slope[S_CHARGE] = amps
    slope[S_ENERGY] = volts * amps


@njit(cache=False)
def follow_ground(state: Array, parameters: Array, ground: float, climb: float) -> None:
    """What the wheels dictate after a step: height, velocity and turn rate."""
    speed = state[S_SPEED]
    w, z = state[S_ATTITUDE], state[S_ATTITUDE + 3]
    norm = sqrt(w * w + z * z)
    w, z = w / norm, z / norm
    state[S_ATTITUDE], state[S_ATTITUDE + 3] = w, z
    state[S_POSITION + 2] = ground
    state[S_VELOCITY] = speed * (w * w - z * z)
    state[S_VELOCITY + 1] = speed * 2.0 * w * z
    state[S_VELOCITY + 2] = climb
    state[S_RATES + 2] = turn_rate(speed, state[S_STEER], parameters)
