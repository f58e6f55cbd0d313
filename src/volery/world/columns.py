"""Where each quantity stands in the arrays that the compiled step works on: one row a body, columns named
here.

Compiled code reads these names as constants. SI units; ``S_`` state, ``P_`` parameters, ``U_`` inputs, ``M_``
measurements. A composer (an autopilot's flight loops) may add columns of its own to the inputs, from
``INPUTS`` on, and has a row of memory in which it alone decides.
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

# --- inputs -------------------------------------------------------------------------------------------------
U_THROTTLE = 0  # four motor commands 0..1; rover: steering -1..1, throttle -1..1 (used by `bodies` alone)
U_PAYLOAD = 4  # electrical power of on-board computers [W]
U_WIND = 5  # mean wind, east, north, up: where the air goes [m/s]
U_MOTOR_HEALTH = 8  # four factors 0..1 on rotor thrust
U_GPS_BLOCKED = 12  # 1: the receiver sees no satellites
U_GUST = 13  # standard deviation of gusts [m/s]
U_BARO_BLOCKED = 14
U_MAG_BLOCKED = 15
INPUTS = 16

# --- measurements: the last sample of each sensor, in the autopilot's axes ----------------------------------
M_GYRO = 0  # rates forward, right, down [rad/s]
M_ACCEL = 3  # specific force forward, right, down [m/s^2]
M_MAG = 6  # field forward, right, down [gauss]
M_BARO = 9  # pressure altitude about the world's origin [m up]
M_GPS = 10  # north, east, down about the world's origin [m]
M_GPS_VELOCITY = 13  # north, east, down [m/s]
M_GPS_FIX = 16  # 0 none, 3 three-dimensional, 6 real-time kinematic, fixed (MAVLink's GPS_FIX_TYPE)
M_GPS_COUNT = 17  # fixes so far: a new one when it grows
M_RANGE = 18  # distance to the ground along the body's down axis [m]; -1 out of range
M_BARO_COUNT = 19
M_MAG_COUNT = 20
M_GYRO_BIAS = 21  # the sensors' slowly varying errors: a composer must not read these
M_ACCEL_BIAS = 24
M_MAG_BIAS = 27
M_BARO_BIAS = 30
M_GPS_BIAS = 31
MEASUREMENTS = 34

# --- parameters of all bodies -------------------------------------------------------------------------------
MULTIROTOR = 0.0
ROVER = 1.0
P_KIND = 0
P_MASS = 1
P_INERTIA = 2  # about forward, left, up [kg m^2]
P_DRAG_LINEAR = 5  # [N s/m]
P_DRAG_QUADRATIC = 6  # [N s^2/m^2]
P_SPIN_DAMPING = 7  # [N m s/rad]
P_FEET = 8  # half length, half width, depth below the centre [m]
P_STIFFNESS = 11  # of one foot [N/m]
P_DAMPING = 12  # of one foot [N s/m]
P_FRICTION = 13  # Coulomb's coefficient
P_CAPACITY = 14  # [A s]
P_CELLS = 15
P_RESISTANCE = 16  # of the whole battery [ohm]
P_IDLE_POWER = 17  # autopilot, receivers and sensors [W]
P_GUST_DECAY = 18  # factor over one gust period
P_GUST_KICK = 19
P_GRAVITY = 20
P_SENSOR = 21  # sigma, bias sigma, decay and kick of each sensor: see SENSOR columns below
# --- multirotor ---------------------------------------------------------------------------------------------
P_ROTOR_X = 60  # four, forward of the centre [m]
P_ROTOR_Y = 64  # four, left of the centre [m]
P_ROTOR_SPIN = 68  # four, +1 where the reaction torque is about +up (the rotor turns clockwise from above)
P_THRUST = 72  # k_T, thrust = k_T w^2 [N s^2]
P_TORQUE = 73  # k_Q, torque = k_Q w^2 [N m s^2]
P_ROTOR_LAG = 74  # [s]
P_ROTOR_TOP = 75  # speed at full throttle and full battery [rad/s]
P_EFFICIENCY = 76  # of motor and speed controller
P_FULL_VOLTS = 77
# --- rover --------------------------------------------------------------------------------------------------
P_WHEELBASE = 60
P_STEER_TOP = 61  # [rad]
P_STEER_LAG = 62  # [s]
P_SPEED_TOP = 63  # at full throttle [m/s]
P_SPEED_LAG = 64  # [s]
P_ROLLING = 65  # rolling resistance coefficient
P_DRIVE_EFFICIENCY = 66
P_SKID = 67  # 1: turns on the spot, steering is a turn rate
P_TURN_TOP = 68  # skid: turn rate at full steering [rad/s]
P_GRIP = 69  # largest lateral acceleration [m/s^2]
PARAMETERS = 80

# --- parameters of sensors, from P_SENSOR on: white sigma, slow sigma, slow decay, slow kick ----------------
GYRO, ACCEL, MAG, BARO, GPS_LEVEL, GPS_HEIGHT, GPS_SPEED, RANGE = range(8)
SENSOR_WHITE, SENSOR_SLOW, SENSOR_DECAY, SENSOR_KICK = range(4)
P_GPS_PERIOD = 53  # in steps
P_GPS_FIX = 54
P_RANGE_TOP = 55  # [m]
P_FIELD = 56  # the earth's magnetic field, north, east, down [gauss]
P_PERFECT = 59  # 1: sensors without error, estimate taken from the truth

assert P_SENSOR + 8 * 4 == P_GPS_PERIOD


class Bodies(NamedTuple):
    """All that the compiled step reads and writes; row i of each array belongs to body i.

    ``state`` (n, STATE), ``inputs`` (n, INPUTS + the composer's), ``measured`` (n, MEASUREMENTS), ``memory``
    (n, the composer's), ``parameters`` (n, PARAMETERS), ``keys`` (n) uint64 noise keys, ``reached`` (n)
    int64: the grid step each row stands at; ``heights`` (rows, columns) and ``grid`` (east, north, spacing):
    terrain.
    """

    state: Array
    inputs: Array
    measured: Array
    memory: Array
    parameters: Array
    keys: NDArray[np.uint64]
    reached: NDArray[np.int64]
    heights: Array
    grid: Array


Advance = Callable[[Bodies, NDArray[np.int64]], None]
"""The compiled step: brings every body to its goal step. Composed by import, not by passing functions."""


class Work(NamedTuple):
    """Scratch of one compiled call; nothing in it outlives a step, over which ``air`` and ``ground`` hold."""

    y: Array
    slope: Array
    total: Array
    rotation: Array
    force: Array
    torque: Array
    air: Array
    ground: Array
    throttle: Array
    before: Array
    belief: Array
    turn: Array
