"""The law of a rover: a bicycle on the ground.

* Speed: v' = (u v_top - v) / T_v, at most the tyres' grip a_max; steering angle d' = (s d_top - d) / T_d;
  heading' = v tan(d) / L, held to the grip by limiting the turn rate to a_max / v (Rajamani, Vehicle
  Dynamics and Control, 2.2: the kinematic bicycle). A skid-steered one turns at s r_top with the lag T_d, at
  any speed.
* Power: rolling resistance, drag and acceleration against the drive's efficiency; braking returns nothing.
* Valid: firm ground, slopes below about 15 degrees, no slip angle; the body follows the ground, level in
  attitude.
"""

from __future__ import annotations

from math import sqrt

from numba import njit

from volery.simulation.world.arithmetic import sine_cosine
from volery.simulation.world.columns import (
    INTEGRATED,
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
    W_SLOPE,
    W_THROTTLE,
    W_Y,
    Array,
)
from volery.simulation.world.multirotor import volts_amps

S_STEER = S_ROTORS
S_SPEED = S_ROTORS + 1
_STANDING = 0.001  # [m/s] below which rolling resistance has no sign


@njit(cache=False)
def drive_power(row: Array, speed: float, acceleration: float) -> float:
    """Watts at the battery for the wheels at a speed [m/s] and an acceleration [m/s^2]."""
    pace = abs(speed)
    if pace < _STANDING:
        return 0.0
    drag = (row[P_DRAG_LINEAR] + row[P_DRAG_QUADRATIC] * pace) * pace
    resistance = row[P_ROLLING] * row[P_MASS] * row[P_GRAVITY] + drag
    push = acceleration if speed > 0.0 else -acceleration
    wheel = (resistance + row[P_MASS] * push) * pace
    power: float = max(0.0, wheel) / row[P_DRIVE_EFFICIENCY]
    return power


@njit(cache=False)
def turn_rate(row: Array, speed: float, steer: float) -> float:
    """Heading's rate of change [rad/s, anticlockwise] at a speed and a steering angle (skid: a turn rate)."""
    if row[P_SKID] > 0.5:
        rate = steer
    else:
        s, c = sine_cosine(steer)
        rate = speed * s / (c * row[P_WHEELBASE])
    most = row[P_GRIP] / max(abs(speed), 0.1)
    held: float = min(max(rate, -most), most)
    return held


@njit(cache=False)
def rover_slope(row: Array, resting: bool) -> None:
    """The state's rate of change; commands are steering (left positive) and throttle."""
    for i in range(INTEGRATED):
        row[W_SLOPE + i] = 0.0
    speed = row[W_Y + S_SPEED]
    skid = row[P_SKID] > 0.5
    top = row[P_TURN_TOP] if skid else row[P_STEER_TOP]
    power = row[P_IDLE_POWER] + row[U_PAYLOAD]
    if not resting:
        row[W_SLOPE + S_STEER] = (row[W_THROTTLE] * top - row[W_Y + S_STEER]) / row[P_STEER_LAG]
        wanted = row[W_THROTTLE + 1] * row[P_SPEED_TOP]
        push = (wanted - speed) / row[P_SPEED_LAG]
        row[W_SLOPE + S_SPEED] = min(max(push, -row[P_GRIP]), row[P_GRIP])
        rate = turn_rate(row, speed, row[W_Y + S_STEER])
        w, z = row[W_Y + S_ATTITUDE], row[W_Y + S_ATTITUDE + 3]
        row[W_SLOPE + S_ATTITUDE] = -0.5 * z * rate
        row[W_SLOPE + S_ATTITUDE + 3] = 0.5 * w * rate
        row[W_SLOPE + S_POSITION] = speed * (w * w - z * z)
        row[W_SLOPE + S_POSITION + 1] = speed * 2.0 * w * z
        power += drive_power(row, speed, row[W_SLOPE + S_SPEED])
    volts, amps = volts_amps(row, W_Y, power)
    row[W_SLOPE + S_CHARGE] = amps
    row[W_SLOPE + S_ENERGY] = volts * amps


@njit(cache=False)
def follow_ground(row: Array, ground: float, climb: float) -> None:
    """What the wheels dictate after a step: height, velocity and turn rate."""
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
