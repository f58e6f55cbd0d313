"""Where each quantity of the flight loops stands: ``C_`` commands among a body's inputs, ``K_`` its memory.

Axes here are the autopilot's: north, east, down about the world's origin; forward, right, down.
"""

from __future__ import annotations

from enum import IntEnum

from volery.simulation.world.state_layout import WORLD


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
C_CONTROL = WORLD
C_POSITION = WORLD + 1  # north, east, down about the estimator's origin [m]
C_VELOCITY = WORLD + 4  # north, east, down [m/s]
C_ROLL = WORLD + 7  # [rad]
C_PITCH = WORLD + 8  # [rad]
C_YAW = WORLD + 9  # [rad], clockwise from north
C_YAW_RATE = WORLD + 10  # [rad/s]
C_YAW_IS = WORLD + 11  # 0 hold the present heading, 1 go to C_YAW, 2 turn at C_YAW_RATE
C_THROTTLE = WORLD + 12  # 0..1; rover -1..1
C_STEERING = WORLD + 13  # rover -1..1, right positive
C_CLIMB = WORLD + 14  # [m/s] up
C_SPEED = WORLD + 15  # limit in the plane [m/s]
C_SPEED_UP = WORLD + 16  # limit [m/s]
C_SPEED_DOWN = WORLD + 17  # limit [m/s]
C_ACCEL = WORLD + 18  # limit in the plane [m/s^2]
C_ACCEL_Z = WORLD + 19  # limit [m/s^2]
C_TILT = WORLD + 20  # limit [rad]
C_JERK = WORLD + 21  # limit of the target in the plane and in height [m/s^3]
C_AIDED = WORLD + 22  # 1: the estimator uses satellites; its origin is where it was when this became 1
_K = WORLD + 23

# --- memory: what the estimator believes (visible through ``Estimate``) -------------------------------------
K_POSITION = _K  # north, east, down about the world's origin [m]
K_VELOCITY = _K + 3
K_ATTITUDE = _K + 6  # quaternion w, x, y, z: forward, right, down to north, east, down
K_EULER = _K + 10  # roll, pitch, yaw [rad]
K_RATES = _K + 13  # forward, right, down [rad/s]
K_ACCEL = _K + 16  # north, east, down, without gravity [m/s^2]
K_ORIGIN = _K + 19  # of the estimate, north, east, down about the world's origin [m]
K_AIDED = _K + 22  # 1 once satellites are used and positions are good
K_ALIGNED = _K + 23  # 1 once tilt and heading are known
K_GPS_AGE = _K + 24  # [s] since the last fix was used
K_SPREAD = _K + 25  # estimator's own standard deviation: plane, height [m], speed in the plane, up [m/s]
K_HEADING_ERROR = _K + 29  # last difference of compass and estimate [rad]
K_MOTORS = _K + 30  # four motor commands 0..1 (rover: steering, throttle -1..1)
K_LANDED = _K + 34  # 1: the landed detector is sure
K_THROTTLE = _K + 35  # collective, 0..1
K_HOVER = _K + 36  # learnt collective in hover
K_TARGET = _K + 37  # shaped target position, north, east, down about the world's origin [m]
K_TARGET_VELOCITY = _K + 40
K_TARGET_ACCEL = _K + 43
K_TARGET_EULER = _K + 46  # attitude asked for: roll, pitch, yaw [rad]
K_GPS_LEVEL = _K + 49  # difference of the last fix and the estimate in the plane, in sigmas
VISIBLE = _K + 50
# --- memory: private ----------------------------------------------------------------------------------------
K_GYRO_BIAS = _K + 50
K_ACCEL_BIAS = _K + 53  # north, east, down [m/s^2]
K_COVARIANCE = _K + 56  # three axes of pp pv pb vv vb bb
K_SEEN_GPS = _K + 74
K_SEEN_BARO = _K + 75
K_SEEN_MAG = _K + 76
K_CONTROL = _K + 77  # the control in force
K_RATE_INTEGRAL = _K + 79
K_RATE_BEFORE = _K + 82
K_RATE_SLOPE = _K + 85
K_VELOCITY_INTEGRAL = _K + 88
K_YAW_TARGET = _K + 91
K_YAW_SPEED = _K + 92
K_SPOOL = _K + 93  # 0 idle .. 1 full authority
K_LANDED_FOR = _K + 94  # [s]
K_DEMAND = _K + 95  # target attitude quaternion
K_HEIGHT_ZERO = _K + 99  # barometer's offset: its reading where height is zero [m up]
K_ACCEL_SMOOTH = _K + 100
K_SPEED_INTEGRAL = _K + 103
K_LOWER_LIMIT = _K + 104  # 1 while the collective is at its lower limit
FLIGHT = _K + 105 - WORLD
"""Columns that the flight loops add to a body's row."""
