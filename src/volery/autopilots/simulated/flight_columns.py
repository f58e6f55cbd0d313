"""Where each quantity of the flight loops stands: ``C_`` commands among a body's inputs, ``K_`` its memory.

Axes here are the autopilot's: north, east, down about the world's origin; forward, right, down.
"""

from __future__ import annotations

from enum import IntEnum

from volery.world.columns import INPUTS


class Control(IntEnum):
    """What the inner loops hold. Multirotors know the first eight, rovers OFF, IDLE, POSITION, STEER and
    DRIVE.
    """

    OFF = 0  # motors stand still: disarmed
    IDLE = 1  # armed on the ground: motors turn slowly, nothing is held
    ATTITUDE = 2  # roll, pitch, yaw and throttle
    CLIMB = 3  # roll, pitch, yaw and climb rate
    VELOCITY = 4  # north, east, down velocity
    POSITION = 5  # a point; rovers: drive there
    POSITION_CLIMB = 6  # hold a point in the plane, climb or sink at a rate
    VELOCITY_HEIGHT = 7  # velocity in the plane, hold a height
    STEER = 8  # rover: steering and throttle as given
    DRIVE = 9  # rover: speed, and heading or turn rate


OFF, IDLE, ATTITUDE, CLIMB, VELOCITY, POSITION, POSITION_CLIMB, VELOCITY_HEIGHT, STEER, DRIVE = range(10)

# --- commands ----------------------------------------------------------------------------------------------
C_CONTROL = INPUTS
C_POSITION = INPUTS + 1  # north, east, down about the estimator's origin [m]
C_VELOCITY = INPUTS + 4  # north, east, down [m/s]
C_ROLL = INPUTS + 7  # [rad]
C_PITCH = INPUTS + 8  # [rad]
C_YAW = INPUTS + 9  # [rad], clockwise from north
C_YAW_RATE = INPUTS + 10  # [rad/s]
C_YAW_IS = INPUTS + 11  # 0 hold the present heading, 1 go to C_YAW, 2 turn at C_YAW_RATE
C_THROTTLE = INPUTS + 12  # 0..1; rover -1..1
C_STEERING = INPUTS + 13  # rover -1..1, right positive
C_CLIMB = INPUTS + 14  # [m/s] up
C_SPEED = INPUTS + 15  # limit in the plane [m/s]
C_SPEED_UP = INPUTS + 16  # limit [m/s]
C_SPEED_DOWN = INPUTS + 17  # limit [m/s]
C_ACCEL = INPUTS + 18  # limit in the plane [m/s^2]
C_ACCEL_Z = INPUTS + 19  # limit [m/s^2]
C_TILT = INPUTS + 20  # limit [rad]
C_AIDED = INPUTS + 21  # 1: the estimator uses satellites; its origin is where it was when this became 1
C_SERIAL = INPUTS + 22  # counts set-points: a change starts the shaping anew where the control changed
COMMANDS = 23

# --- memory: what the estimator believes (visible through ``Estimate``) -------------------------------------
K_POSITION = 0  # north, east, down about the world's origin [m]
K_VELOCITY = 3
K_ATTITUDE = 6  # quaternion w, x, y, z: forward, right, down to north, east, down
K_EULER = 10  # roll, pitch, yaw [rad]
K_RATES = 13  # forward, right, down [rad/s]
K_ACCEL = 16  # north, east, down, without gravity [m/s^2]
K_ORIGIN = 19  # of the estimate, north, east, down about the world's origin [m]
K_AIDED = 22  # 1 once satellites are used and positions are good
K_ALIGNED = 23  # 1 once tilt and heading are known
K_GPS_AGE = 24  # [s] since the last fix was used
K_SPREAD = 25  # estimator's own standard deviation: plane, height [m], speed in the plane, up [m/s]
K_HEADING_ERROR = 29  # last difference of compass and estimate [rad]
K_MOTORS = 30  # four motor commands 0..1 (rover: steering, throttle -1..1)
K_LANDED = 34  # 1: the landed detector is sure
K_THROTTLE = 35  # collective, 0..1
K_HOVER = 36  # learnt collective in hover
K_TARGET = 37  # shaped target position, north, east, down about the world's origin [m]
K_TARGET_VELOCITY = 40
K_TARGET_ACCEL = 43
K_TARGET_EULER = 46  # attitude asked for: roll, pitch, yaw [rad]
K_GPS_LEVEL = 49  # difference of the last fix and the estimate in the plane, in sigmas
VISIBLE = 50
# --- memory: private ----------------------------------------------------------------------------------------
K_GYRO_BIAS = 50
K_ACCEL_BIAS = 53  # north, east, down [m/s^2]
K_COVARIANCE = 56  # three axes of pp pv pb vv vb bb
K_SEEN_GPS = 74
K_SEEN_BARO = 75
K_SEEN_MAG = 76
K_CONTROL = 77  # the control in force
K_SERIAL = 78
K_RATE_INTEGRAL = 79
K_RATE_BEFORE = 82
K_RATE_SLOPE = 85
K_VELOCITY_INTEGRAL = 88
K_YAW_TARGET = 91
K_YAW_SPEED = 92
K_SPOOL = 93  # 0 idle .. 1 full authority
K_LANDED_FOR = 94  # [s]
K_DEMAND = 95  # target attitude quaternion
K_HEIGHT_ZERO = 99  # barometer's offset: its reading where height is zero [m up]
K_ACCEL_SMOOTH = 100
K_SPEED_INTEGRAL = 103
K_LOWER_LIMIT = 104  # 1 while the collective is at its lower limit
MEMORY = 105
