"""Where each quantity stands in the arrays that the compiled step works on: one row a body, columns named
here.

Compiled code reads these names as constants, and one row a body keeps all that a step touches close together.
SI units; ``S_`` state, ``U_`` inputs, ``M_`` measurements, ``P_`` parameters, ``W_`` scratch. A composer (an
autopilot's flight loops) adds columns of its own from ``WORLD`` on.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# --- state: what RK4 integrates -----------------------------------------------------------------------------
S_POSITION = 0  # east, north, up about the world's origin [m]
S_VELOCITY = 3  # east, north, up [m/s]
S_ATTITUDE = 6  # quaternion w, x, y, z; body (forward, left, up) to east, north, up
S_RATES = 10  # body rates about forward, left, up [rad/s]
S_ROTORS = 13  # four rotor speeds [rad/s]; rover: steering angle [rad], wheel speed [m/s], 0, 0
S_CHARGE = 17  # charge drawn from the battery [A s]
S_ENERGY = 18  # energy drawn at the battery's terminals [J]
INTEGRATED = 19
# --- state: what follows from it at the end of a step -------------------------------------------------------
S_VOLTS = 19
S_AMPS = 20
S_ON_GROUND = 21  # 1 while any foot or wheel touches
S_RESTING = 22  # 1 while it neither moves nor can
S_CONTACT_SPEED = 23  # downward speed at the last touch-down [m/s]
S_CONTACTS = 24  # touch-downs so far
S_FORCE = 25  # specific force forward, left, up: what an ideal accelerometer feels [m/s^2]
S_GUST = 28  # east, north, up [m/s]
S_GROUND = 31  # height of the ground straight below [m up]
S_PAYLOAD_ENERGY = 32  # of the energy, that of the on-board computers [J]
S_DISTANCE = 33  # path length flown or driven [m]
S_AWAKE = 34  # 1 once the first samples are taken
STATE = 35
_U = STATE

# --- inputs -------------------------------------------------------------------------------------------------
U_THROTTLE = _U  # four motor commands 0..1; rover: steering -1..1, throttle -1..1 (used by `bodies` alone)
U_PAYLOAD = _U + 4  # electrical power of on-board computers [W]
U_WIND = _U + 5  # mean wind, east, north, up: where the air goes [m/s]
U_MOTOR_HEALTH = _U + 8  # four factors 0..1 on rotor thrust
U_GPS_BLOCKED = _U + 12  # 1: the receiver sees no satellites
U_GUST = _U + 13  # standard deviation of gusts [m/s]
U_BARO_BLOCKED = _U + 14
U_MAG_BLOCKED = _U + 15
INPUTS = _U + 16
_M = INPUTS

# --- measurements: the last sample of each sensor, in the autopilot's axes ----------------------------------
M_GYRO = _M  # rates forward, right, down [rad/s]
M_ACCEL = _M + 3  # specific force forward, right, down [m/s^2]
M_MAG = _M + 6  # field forward, right, down [gauss]
M_BARO = _M + 9  # pressure altitude about the world's origin [m up]
M_GPS = _M + 10  # north, east, down about the world's origin [m]
M_GPS_VELOCITY = _M + 13  # north, east, down [m/s]
M_GPS_FIX = _M + 16  # 0 none, 3 three-dimensional, 6 real-time kinematic, fixed (MAVLink's GPS_FIX_TYPE)
M_GPS_COUNT = _M + 17  # fixes so far: a new one when it grows
M_RANGE = _M + 18  # distance to the ground along the body's down axis [m]; -1 out of range
M_BARO_COUNT = _M + 19
M_MAG_COUNT = _M + 20
M_GYRO_BIAS = _M + 21  # the sensors' slowly varying errors: a composer must not read these
M_ACCEL_BIAS = _M + 24
M_MAG_BIAS = _M + 27
M_BARO_BIAS = _M + 30
M_GPS_BIAS = _M + 31
MEASUREMENTS = _M + 34
_P = MEASUREMENTS

# --- parameters of all bodies -------------------------------------------------------------------------------
MULTIROTOR = 0.0
ROVER = 1.0
P_KIND = _P
P_MASS = _P + 1
P_INERTIA = _P + 2  # about forward, left, up [kg m^2]
P_DRAG_LINEAR = _P + 5  # [N s/m]
P_DRAG_QUADRATIC = _P + 6  # [N s^2/m^2]
P_SPIN_DAMPING = _P + 7  # [N m s/rad]
P_FEET = _P + 8  # half length, half width, depth below the centre [m]
P_STIFFNESS = _P + 11  # of one foot [N/m]
P_DAMPING = _P + 12  # of one foot [N s/m]
P_FRICTION = _P + 13  # Coulomb's coefficient
P_CAPACITY = _P + 14  # [A s]
P_CELLS = _P + 15
P_RESISTANCE = _P + 16  # of the whole battery [ohm]
P_IDLE_POWER = _P + 17  # autopilot, receivers and sensors [W]
P_GUST_DECAY = _P + 18  # factor over one gust period
P_GUST_KICK = _P + 19
P_GRAVITY = _P + 20
P_SENSOR = _P + 21  # sigma, bias sigma, decay and kick of each sensor: see SENSOR columns below
# --- multirotor ---------------------------------------------------------------------------------------------
P_ROTOR_X = _P + 60  # four, forward of the centre [m]
P_ROTOR_Y = _P + 64  # four, left of the centre [m]
P_ROTOR_SPIN = (
    _P + 68
)  # four, +1 where the reaction torque is about +up (the rotor turns clockwise from above)
P_THRUST = _P + 72  # k_T, thrust = k_T w^2 [N s^2]
P_TORQUE = _P + 73  # k_Q, torque = k_Q w^2 [N m s^2]
P_ROTOR_LAG = _P + 74  # [s]
P_ROTOR_TOP = _P + 75  # speed at full throttle and full battery [rad/s]
P_EFFICIENCY = _P + 76  # of motor and speed controller
P_FULL_VOLTS = _P + 77
# --- rover --------------------------------------------------------------------------------------------------
P_WHEELBASE = _P + 60
P_STEER_TOP = _P + 61  # [rad]
P_STEER_LAG = _P + 62  # [s]
P_SPEED_TOP = _P + 63  # at full throttle [m/s]
P_SPEED_LAG = _P + 64  # [s]
P_ROLLING = _P + 65  # rolling resistance coefficient
P_DRIVE_EFFICIENCY = _P + 66
P_SKID = _P + 67  # 1: turns on the spot, steering is a turn rate
P_TURN_TOP = _P + 68  # skid: turn rate at full steering [rad/s]
P_GRIP = _P + 69  # largest lateral acceleration [m/s^2]
PARAMETERS = _P + 80

# --- parameters of sensors, from P_SENSOR on: white sigma, slow sigma, slow decay, slow kick ----------------
GYRO, ACCEL, MAG, BARO, GPS_LEVEL, GPS_HEIGHT, GPS_SPEED, RANGE = range(8)
SENSOR_WHITE, SENSOR_SLOW, SENSOR_DECAY, SENSOR_KICK = range(4)
P_GPS_PERIOD = _P + 53  # in steps
P_GPS_FIX = _P + 54
P_RANGE_TOP = _P + 55  # [m]
P_FIELD = _P + 56  # the earth's magnetic field, north, east, down [gauss]
P_PERFECT = _P + 59  # 1: sensors without error, estimate taken from the truth

# --- scratch: nothing in it outlives a step -----------------------------------------------------------
W_Y = PARAMETERS  # the state at which a slope is taken
W_SLOPE = W_Y + INTEGRATED
W_TOTAL = W_SLOPE + INTEGRATED
W_ROTATION = W_TOTAL + INTEGRATED  # 3 x 3 by rows: body axes to east, north, up
W_FORCE = W_ROTATION + 9  # east, north, up [N]
W_TORQUE = W_FORCE + 3  # forward, left, up [N m]
W_AIR = W_TORQUE + 3  # velocity of the air, held over a step [m/s]
W_GROUND = W_AIR + 3  # height of the ground, held over a step [m up]
W_THROTTLE = W_GROUND + 1  # the motor commands of a step
W_BEFORE = W_THROTTLE + 4  # velocity before the step [m/s]
W_BELIEF = W_BEFORE + 3  # 3 x 3 by rows: a composer's idea of forward, right, down to north, east, down
W_TURN = W_BELIEF + 9
WORLD = W_TURN + 3
"""Columns of the world; a composer's own begin here."""


class Bodies(NamedTuple):
    """All that the compiled step reads and writes.

    ``rows`` (bodies, WORLD + the composer's columns); ``keys`` (bodies) of noise; ``reached`` (bodies): the
    grid step each row stands at; ``heights`` (posts north, posts east) and ``grid`` (west edge, south edge,
    spacing) of the terrain.
    """

    rows: Array
    keys: NDArray[np.uint64]
    reached: NDArray[np.int64]
    heights: Array
    grid: Array


Advance = Callable[[Bodies, NDArray[np.int64]], None]
"""The compiled step: brings every body to its goal step. Composed by import, not by passing functions."""
