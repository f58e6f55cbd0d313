"""Columns of the flight stack in a body's state row: ``C_`` commands, ``K_`` memory of estimator and loops.

They continue the world's layout. Axes are the autopilot's: north, east, down about the world's origin, and
forward, right, down.
"""

from __future__ import annotations

from enum import IntEnum

from volery.simulation.world.state_layout import FRD, MOTORS, NED, WORLD, WORLD_LAYOUT, Layout


class Control(IntEnum):
    """Quantities that the inner loops control.

    Multirotors take OFF to VELOCITY_HEIGHT; rovers take OFF, IDLE, POSITION, STEER and DRIVE.
    """

    OFF = 0  # motors stopped: disarmed
    IDLE = 1  # armed on the ground: motors turn slowly, nothing is controlled
    ATTITUDE = 2  # roll, pitch, yaw and throttle
    CLIMB = 3  # roll, pitch, yaw and climb rate
    VELOCITY = 4  # north, east, down velocity
    POSITION = 5  # a point; rovers drive to it
    POSITION_CLIMB = 6  # horizontal position, and a climb rate
    VELOCITY_HEIGHT = 7  # horizontal velocity, and a height
    STEER = 8  # rover: steering and throttle, passed through
    DRIVE = 9  # rover: speed, and heading or turn rate


OFF, IDLE, ATTITUDE, CLIMB, VELOCITY, POSITION, POSITION_CLIMB, VELOCITY_HEIGHT, STEER, DRIVE = range(10)

HOLD_HEADING, YAW_ANGLE, YAW_RATE = range(3)
"""Values of ``C_YAW_MODE``."""

FLIGHT_LAYOUT = Layout(after=WORLD_LAYOUT)
_add = FLIGHT_LAYOUT.add
RPY = "roll, pitch, yaw"
assert FLIGHT_LAYOUT.start == WORLD

# --- scratch ---
W_DCM = _add("W_DCM", "1", f"matrix from body ({FRD}) to {NED}", 9, "3 x 3 by rows")

# --- commands: C_CONTROL to C_STRAIGHT in the order of ``Setpoint.row`` ---
C_CONTROL = _add("C_CONTROL", "1", "a Control")
C_POSITION = _add("C_POSITION", "m", "about the estimator's origin", 3, NED)
C_VELOCITY = _add("C_VELOCITY", "m/s", "over the ground; rover DRIVE: the first is the forward speed", 3, NED)
C_ROLL = _add("C_ROLL", "rad", "roll angle")
C_PITCH = _add("C_PITCH", "rad", "pitch angle")
C_YAW = _add("C_YAW", "rad", "yaw angle, clockwise from north")
C_YAW_RATE = _add("C_YAW_RATE", "rad/s", "yaw rate, clockwise")
C_YAW_MODE = _add("C_YAW_MODE", "1", "HOLD_HEADING, YAW_ANGLE or YAW_RATE")
C_THROTTLE = _add("C_THROTTLE", "1", "collective 0..1; rover -1..1")
C_STEERING = _add("C_STEERING", "1", "rover: -1..1, right positive")
C_CLIMB = _add("C_CLIMB", "m/s", "climb rate, up")
C_SPEED = _add("C_SPEED", "m/s", "limit of horizontal speed")
C_SPEED_UP = _add("C_SPEED_UP", "m/s", "limit of climb rate")
C_SPEED_DOWN = _add("C_SPEED_DOWN", "m/s", "limit of descent rate")
C_ACCEL = _add("C_ACCEL", "m/s^2", "limit of horizontal acceleration")
C_ACCEL_Z = _add("C_ACCEL_Z", "m/s^2", "limit of vertical acceleration")
C_TILT = _add("C_TILT", "rad", "limit of tilt")
C_JERK = _add("C_JERK", "m/s^3", "limit of the shaped target's jerk")
C_STRAIGHT = _add("C_STRAIGHT", "1", "1: height and horizontal position are approached along a straight line")
C_AIDED = _add("C_AIDED", "1", "1: use satellites; the estimator's origin is the position when this became 1")

# --- memory that ``Estimate`` shows ---
K_POSITION = _add("K_POSITION", "m", "estimated, about the world's origin", 3, NED)
K_VELOCITY = _add("K_VELOCITY", "m/s", "estimated", 3, NED)
K_ATTITUDE = _add("K_ATTITUDE", "1", f"estimated quaternion from body ({FRD}) to {NED}", 4, "w, x, y, z")
K_EULER = _add("K_EULER", "rad", "estimated attitude as angles", 3, RPY)
K_RATES = _add("K_RATES", "rad/s", "estimated body rates", 3, FRD)
K_ACCEL = _add("K_ACCEL", "m/s^2", "estimated acceleration without gravity", 3, NED)
K_ORIGIN = _add("K_ORIGIN", "m", "the estimator's origin about the world's", 3, NED)
K_AIDED = _add("K_AIDED", "1", "1 once satellites are used and positions are valid")
K_ALIGNED = _add("K_ALIGNED", "1", "1 once tilt and heading are initialised")
K_GPS_AGE = _add("K_GPS_AGE", "s", "time since a fix was last fused")
K_SIGMA = _add(
    "K_SIGMA",
    "m, m/s",
    "standard deviations",
    4,
    "horizontal, vertical position; the same of velocity",
)
K_HEADING_ERROR = _add("K_HEADING_ERROR", "rad", "last magnetometer heading less the estimate")
K_MOTORS = _add("K_MOTORS", "1", "motor commands 0..1; rover: steering, throttle -1..1, 0, 0", 4, MOTORS)
K_LANDED = _add("K_LANDED", "1", "1: the landed detector reports landed")
K_THROTTLE = _add("K_THROTTLE", "1", "collective 0..1; rover: throttle -1..1")
K_HOVER_THROTTLE = _add("K_HOVER_THROTTLE", "1", "learnt collective in hover")
K_TARGET = _add("K_TARGET", "m", "shaped target position about the world's origin", 3, NED)
K_TARGET_VELOCITY = _add("K_TARGET_VELOCITY", "m/s", "shaped; rover: the first is the forward speed", 3, NED)
K_TARGET_ACCEL = _add("K_TARGET_ACCEL", "m/s^2", "shaped", 3, NED)
K_TARGET_EULER = _add("K_TARGET_EULER", "rad", "target of the attitude loop", 3, RPY)
K_GPS_INNOVATION = _add("K_GPS_INNOVATION", "1", "last horizontal innovation of a fix, in sigmas")
VISIBLE = FLIGHT_LAYOUT.end
"""First column after the memory that ``Estimate`` shows."""

# --- private memory ---
K_GYRO_BIAS = _add("K_GYRO_BIAS", "rad/s", "estimated", 3, FRD)
K_ACCEL_BIAS = _add("K_ACCEL_BIAS", "m/s^2", "estimated", 3, NED)
K_COVARIANCE = _add(
    "K_COVARIANCE", "mixed", "of position p, velocity v and bias b", 18, "per axis of NED: pp pv pb vv vb bb"
)
K_USED_GPS = _add("K_USED_GPS", "1", "M_GPS_COUNT of the last fix fused")
K_USED_BARO = _add("K_USED_BARO", "1", "M_BARO_COUNT of the last sample fused")
K_USED_MAG = _add("K_USED_MAG", "1", "M_MAG_COUNT of the last sample fused")
K_CONTROL = _add("K_CONTROL", "1", "the Control in force")
K_RATE_INTEGRAL = _add("K_RATE_INTEGRAL", "1", "integrators of the rate loops", 3, FRD)
K_LAST_RATES = _add("K_LAST_RATES", "rad/s", "rates at the step before", 3, FRD)
K_RATE_DERIVATIVE = _add("K_RATE_DERIVATIVE", "rad/s^2", "filtered derivative of the rates", 3, FRD)
K_VELOCITY_INTEGRAL = _add("K_VELOCITY_INTEGRAL", "m/s^2", "integrators of the velocity loops", 3, NED)
K_YAW_TARGET = _add("K_YAW_TARGET", "rad", "shaped yaw target, clockwise from north")
K_YAW_SPEED = _add("K_YAW_SPEED", "rad/s", "rate of the shaped yaw target")
K_SPOOL = _add("K_SPOOL", "1", "0 idle .. 1 full authority of the loops")
K_LANDED_TIME = _add("K_LANDED_TIME", "s", "time for which the landed condition has been true")
K_TARGET_QUATERNION = _add("K_TARGET_QUATERNION", "1", "target attitude, as K_ATTITUDE", 4, "w, x, y, z")
K_BARO_OFFSET = _add("K_BARO_OFFSET", "m", "barometer reading at height zero, up")
K_FILTERED_ACCEL = _add("K_FILTERED_ACCEL", "m/s^2", "low-pass of K_ACCEL at 1 Hz", 3, NED)
K_SPEED_INTEGRAL = _add("K_SPEED_INTEGRAL", "1", "rover: integrator of the speed loop")
K_AT_LOWER_LIMIT = _add("K_AT_LOWER_LIMIT", "1", "1 while the collective is at its lower limit")
FLIGHT = FLIGHT_LAYOUT.end - FLIGHT_LAYOUT.start
"""Number of columns that the flight stack adds to a row."""
