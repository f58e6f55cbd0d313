"""State of PX4's position control in one row of numbers: its columns.

Columns ``I_`` are inputs of a call, ``G_`` limits and gains, ``T_`` the trajectory, ``A_`` the airframe of
the loops and what EKF2 states of it, ``E_`` the error of that statement. Axes are north, east, down.
"""

from __future__ import annotations

from typing import Final

from volery.simulation.world.state_layout import NED, ColumnLayout

SUBSTEP: Final = 0.02
"""Step of trajectory and loops [s]; PX4's flight tasks run at 50 Hz."""

GRAVITY: Final = 9.80665

STATES: Final = 21
"""Number of the states of EKF2 whose errors matter."""

DIRECT, TO_POINT, SINK, REST = 0.0, 1.0, 2.0, 3.0
"""Values of ``I_TASK``: set-points are controlled, the trajectory moves to a point, or down over it; only the
estimate is advanced, of a vehicle at rest."""

LOOP_LAYOUT = ColumnLayout()
_add = LOOP_LAYOUT.add

# --- inputs ---
I_TASK = _add("I_TASK", "1", "DIRECT, TO_POINT or SINK")
I_POSITION = _add("I_POSITION", "m", "wanted position; DIRECT: NaN where not given", 3, NED)
I_VELOCITY = _add("I_VELOCITY", "m/s", "DIRECT: wanted velocity, NaN where not given", 3, NED)
I_ACCEL = _add("I_ACCEL", "m/s^2", "DIRECT: wanted acceleration, NaN where not given", 3, NED)
I_SPEED = _add("I_SPEED", "m/s", "limit of the trajectory's speed in the plane")
I_UP = _add("I_UP", "m/s", "limit of its climb")
I_DOWN = _add("I_DOWN", "m/s", "limit of its descent; SINK: the descent")
I_LIFT = _add("I_LIFT", "m/s^2", "limit of its acceleration while it climbs")
I_AT_VEHICLE = _add("I_AT_VEHICLE", "1", "1: its height is that of the vehicle, as while taking off")
I_YAW = _add("I_YAW", "rad", "wanted heading; NaN: with a trajectory the last one, else none")
I_YAW_RATE = _add("I_YAW_RATE", "rad/s", "DIRECT: wanted rate of turn; NaN: none")
I_NOISY = _add("I_NOISY", "1", "1: the sensors have the noise of SIH's")

# --- limits and gains ---
G_JERK = _add("G_JERK", "m/s^3", "MPC_JERK_AUTO")
G_PUSH = _add("G_PUSH", "m/s^2", "MPC_ACC_HOR")
G_BEHIND = _add("G_BEHIND", "m", "MPC_XY_ERR_MAX")
G_SINK = _add("G_SINK", "m/s^2", "MPC_ACC_DOWN_MAX")
G_PLACE = _add("G_PLACE", "1/s", "MPC_XY_P, MPC_Z_P", 3, NED)
G_SPEED = _add("G_SPEED", "1/s", "MPC_XY_VEL_P_ACC, MPC_Z_VEL_P_ACC", 3, NED)
G_INTEGRAL = _add("G_INTEGRAL", "1/s^2", "MPC_XY_VEL_I_ACC, MPC_Z_VEL_I_ACC", 3, NED)
G_SLOPE = _add("G_SLOPE", "1", "MPC_XY_VEL_D_ACC, MPC_Z_VEL_D_ACC", 3, NED)
G_LEAN = _add("G_LEAN", "m/s^2", "largest acceleration in the plane, by MPC_TILTMAX_AIR")
G_FAST = _add("G_FAST", "m/s", "MPC_XY_VEL_MAX")
G_UP = _add("G_UP", "m/s", "limit of the loops' climb")
G_DOWN = _add("G_DOWN", "m/s", "limit of the loops' descent")
G_RAMP = _add("G_RAMP", "s", "MPC_TKO_RAMP_T")
G_HOVER = _add("G_HOVER", "1", "MPC_THR_HOVER")
G_TURN = _add("G_TURN", "rad/s", "MPC_YAWRAUTO_MAX")

# --- constants of the airframe ---
G_DRAG = _add("G_DRAG", "1/s", "its linear drag over its mass")
G_SQUARE_DRAG = _add("G_SQUARE_DRAG", "1/m", "its quadratic drag over its mass")
G_OWN_HOVER = _add("G_OWN_HOVER", "1", "thrust with which it really hovers")

# --- trajectory ---
T_POSITION = _add("T_POSITION", "m", "of the trajectory", 3, NED)
T_VELOCITY = _add("T_VELOCITY", "m/s", "of the trajectory", 3, NED)
T_ACCEL = _add("T_ACCEL", "m/s^2", "of the trajectory", 3, NED)
T_YAW = _add("T_YAW", "rad", "set-point of the heading")
T_YAW_RATE = _add("T_YAW_RATE", "rad/s", "its rate, filtered")

# --- airframe ---
A_POSITION = _add("A_POSITION", "m", "that EKF2 states", 3, NED)
A_VELOCITY = _add("A_VELOCITY", "m/s", "that EKF2 states", 3, NED)
A_MOVING = _add("A_MOVING", "m/s", "rate at which the stated position moves", 3, NED)
A_FLOWN = _add("A_FLOWN", "m/s", "true velocity", 3, NED)
A_ACCEL = _add("A_ACCEL", "m/s^2", "true acceleration", 3, NED)
A_SLOPE = _add("A_SLOPE", "m/s^2", "derivative of the stated velocity, filtered", 3, NED)
A_THRUST = _add("A_THRUST", "m/s^2", "acceleration by the thrust; down: gravity included", 3, NED)
A_HEADING = _add("A_HEADING", "rad", "heading")
A_TURN = _add("A_TURN", "rad/s", "rate of the heading")
A_YAWING = _add("A_YAWING", "SI", "rate about the thrust's axis, torque and integral of its loop", 3)
A_AXES = _add("A_AXES", "1", "of its forward, right and down axis what points north, then east, down", 9)
A_INTEGRAL = _add("A_INTEGRAL", "m/s^2", "integral of the velocity loop", 3, NED)
A_GROUNDED = _add("A_GROUNDED", "1", "1 while it stands on the ground")
A_RAMP = _add("A_RAMP", "1", "progress of the take-off's ramp; 1 in flight")
A_HOVER = _add("A_HOVER", "1", "thrust that hovers, as the loops know it")
A_ESTIMATE = _add("A_ESTIMATE", "1", "thrust that hovers, as it is estimated")
A_VARIANCE = _add("A_VARIANCE", "1", "variance of that estimate")
A_SCATTER = _add("A_SCATTER", "m^2/s^4", "variance of the measured acceleration, as it is learnt")
A_ESTIMATED_FOR = _add("A_ESTIMATED_FOR", "s", "time for which it has been estimated in this flight")

# --- error of EKF2's statement ---
E_STATES = _add("E_STATES", "SI", "errors of the filter's states", STATES, "as in estimate_error")
E_COVARIANCE = _add("E_COVARIANCE", "SI", "their covariance as the filter has it", STATES * STATES, "by rows")
E_BARO = _add("E_BARO", "m", "what the filter takes for the bias of the barometer, less the height's error")
E_PUSH = _add("E_PUSH", "m/s^2", "acceleration by the wrong tilt and heading", 3, NED)
E_POSITION = _add("E_POSITION", "m", "error of the stated position", 3, NED)
E_VELOCITY = _add("E_VELOCITY", "m/s", "error of the stated velocity", 3, NED)
E_RATE = _add("E_RATE", "m/s", "rate of the stated position's error", 3, NED)
E_FIX = _add("E_FIX", "s", "time since the last fix")
E_FIELD = _add("E_FIELD", "s", "time since the last readings of magnetometer and barometer")
E_PRODUCT = _add("E_PRODUCT", "SI", "covariance times what a measurement sees", STATES)
E_SEEN = _add("E_SEEN", "SI", "how much a measurement sees of each state", STATES)

# --- fusion of the magnetometer ---
E_FUSES_FIELD = _add("E_FUSES_FIELD", "1", "1: its three axes are fused; 0: its heading")
E_ALIGNED = _add("E_ALIGNED", "1", "1: the heading has been set anew in this flight")
E_KNOWS_DECLINATION = _add("E_KNOWS_DECLINATION", "1", "1: the declination has been fused since then")
E_KEPT = _add("E_KEPT", "gauss^2", "variances of field and bias, covariance of north and east, kept", 7)
E_FILTERED = _add("E_FILTERED", "gauss", "filtered readings, less Earth's field", 3, NED)
E_GROUND = _add("E_GROUND", "m", "height of the ground, downwards")
E_ACCEL = _add("E_ACCEL", "m/s^2", "filtered acceleration as EKF2 sees it, north, east", 2)
E_ACCELERATES = _add("E_ACCELERATES", "1", "1: that is large")
E_TURN = _add("E_TURN", "rad/s", "filtered turn rate")
E_TURNED = _add("E_TURNED", "rad", "turn since the last reading")
E_TURNS = _add("E_TURNS", "1", "1: it turns")
E_STEADY_FOR = _add("E_STEADY_FOR", "s", "time since it last turned or accelerated")

LOOP_COLUMNS: Final = LOOP_LAYOUT.end
