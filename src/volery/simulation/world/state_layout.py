"""Declared layout of the state rows that the compiled step works on: one row of floats per body.

Each field is declared once, in order, with its width, unit and axes; its column follows from the fields
before it, so two fields cannot overlap and a new field only shifts the later ones. The columns are module
constants, which numba compiles into the code as literals. Structured arrays are as fast (measured), but were
rejected: the integrator treats the first columns as one vector, for which records need overlapping fields.

Prefixes: ``S_`` state, ``U_`` inputs, ``M_`` measurements, ``P_`` parameters, ``W_`` scratch. The flight
stack continues the layout with ``ColumnLayout(after=WORLD_LAYOUT)``. SI units.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP_S = 0.002
"""Grid step of the world [s]: 500 Hz."""
OCTETS = 8
"""Size of a value in a row."""


class StateField(NamedTuple):
    """One declared field: it takes *width* columns from *column* on."""

    name: str
    column: int
    width: int
    unit: str
    axes: str
    meaning: str


class ColumnLayout:
    """Allots consecutive columns to fields in the order of their declaration.

    Args:
        after: The layout that this one continues; ``None``: columns start at 0.
    """

    def __init__(self, after: ColumnLayout | None = None) -> None:
        self.start: int = after.end if after else 0
        self.end: int = self.start
        self.fields: list[StateField] = []

    def add(self, name: str, unit: str, meaning: str, width: int = 1, axes: str = "") -> int:
        """Declare a field and return its first column.

        Args:
            name: Name of the module constant that holds the column.
            unit: SI unit, ``1`` for a ratio, a flag or a count.
            meaning: What the field holds.
            width: Number of columns, at least 1.
            axes: What the columns stand for, in order, where there are several.
        """
        field = StateField(name, self.end, width, unit, axes, meaning)
        self.fields.append(field)
        self.end += width
        return field.column


ENU = "east, north, up"
FLU = "forward, left, up"
NED = "north, east, down"
FRD = "forward, right, down"
ROTORS = 8
"""The most rotors of a body; those that it lacks stand still."""
MOTORS = "motor 0 to motor 7"

WORLD_LAYOUT = ColumnLayout()
_add = WORLD_LAYOUT.add

# --- state that a step advances ---
S_POSITION = _add("S_POSITION", "m", "about the world's origin", 3, ENU)
S_VELOCITY = _add("S_VELOCITY", "m/s", "over the ground", 3, ENU)
S_ATTITUDE = _add("S_ATTITUDE", "1", f"quaternion from body ({FLU}) to world ({ENU})", 4, "w, x, y, z")
S_RATES = _add("S_RATES", "rad/s", "body rates", 3, FLU)
MOTION = WORLD_LAYOUT.end
"""Number of columns that are integrated by their slopes; they are the first of a row."""
S_ROTORS = _add(
    "S_ROTORS", "rad/s", "rotor speeds; rover: steering angle [rad], wheel speed [m/s], 0 …", ROTORS, MOTORS
)
ADVANCED = WORLD_LAYOUT.end
"""Number of columns that describe motion and rotors; they are the first of a row."""

# --- state derived at the end of a step ---
S_CHARGE = _add("S_CHARGE", "A s", "charge drawn from the battery")
S_ENERGY = _add("S_ENERGY", "J", "energy drawn at the battery's terminals")
S_VOLTS = _add("S_VOLTS", "V", "at the battery's terminals")
S_AMPS = _add("S_AMPS", "A", "drawn from the battery")
S_ON_GROUND = _add("S_ON_GROUND", "1", "1 while a foot or a wheel touches the ground")
S_RESTING = _add("S_RESTING", "1", "1 while the body stands still and its thrust cannot lift it")
S_CONTACT_SPEED = _add("S_CONTACT_SPEED", "m/s", "downward speed at the last touch-down")
S_CONTACTS = _add("S_CONTACTS", "1", "number of touch-downs")
S_SPECIFIC_FORCE = _add("S_SPECIFIC_FORCE", "m/s^2", "reading of an ideal accelerometer", 3, FLU)
S_GUST = _add("S_GUST", "m/s", "gust velocity at the body", 3, ENU)
S_GROUND = _add("S_GROUND", "m", "height of the ground straight below, up")
S_PAYLOAD_ENERGY = _add("S_PAYLOAD_ENERGY", "J", "part of S_ENERGY that the on-board computers used")
S_DISTANCE = _add("S_DISTANCE", "m", "length of the path flown or driven")
S_COLLISIONS = _add("S_COLLISIONS", "1", "number of collisions with a solid of the scene")
S_COLLISION = _add(
    "S_COLLISION", "mixed", "the last one", 6, "grid step, solid, speed into it [m/s], east, north, up [m]"
)
S_STARTED = _add("S_STARTED", "1", "1 once the first samples are taken")
STATE = WORLD_LAYOUT.end
"""Number of columns of the state; they come before all others."""

# --- inputs ---
U_THROTTLE = _add(
    "U_THROTTLE",
    "1",
    "motor commands 0..1 without a flight stack; rover: steering, throttle -1..1",
    ROTORS,
    MOTORS,
)
U_PAYLOAD = _add("U_PAYLOAD", "W", "electrical power of the on-board computers")
U_WIND = _add("U_WIND", "m/s", "mean velocity of the air", 3, ENU)
U_MOTOR_HEALTH = _add("U_MOTOR_HEALTH", "1", "factor 0..1 on rotor thrust", ROTORS, MOTORS)
U_GPS_BLOCKED = _add("U_GPS_BLOCKED", "1", "1: the receiver sees no satellites")
U_GUST = _add("U_GUST", "m/s", "standard deviation of gusts")
U_BARO_BLOCKED = _add("U_BARO_BLOCKED", "1", "1: the barometer gives no new samples")
U_MAG_BLOCKED = _add("U_MAG_BLOCKED", "1", "1: the magnetometer gives no new samples")
U_GPS_DRIFT = _add("U_GPS_DRIFT", "m/s", "speed at which the reported position drifts", 2, "north, east")
U_GPS_DRIFT_START = _add("U_GPS_DRIFT_START", "1", "grid step at which the drift began")
U_GPS_OFFSET = _add("U_GPS_OFFSET", "m", "error that is added to the reported position", 2, "north, east")
U_PUSH = _add("U_PUSH", "m/s^2", "acceleration by a force from outside; multirotors only", 3, FLU)
OWN_LAWS, MOTION_AWAITED, MOTION_GIVEN = 0.0, 1.0, 2.0
"""What moves a multirotor in its next step: the world's laws, or motion from outside, awaited or given."""
U_MOVED = _add("U_MOVED", "1", "OWN_LAWS, MOTION_AWAITED or MOTION_GIVEN")
U_MOTION = _add("U_MOTION", "mixed", "given motion at the end of the step", MOTION, "as the first columns")
U_SPEEDS = _add("U_SPEEDS", "rad/s", "given rotor speeds; NaN: by the world's own law", ROTORS, MOTORS)
U_FORCE = _add("U_FORCE", "m/s^2", "given specific force; NaN: that of the velocities", 3, FLU)
U_CURRENT = _add("U_CURRENT", "A", "given current of the rotors; NaN: by the world's own law")
U_MAG_TURN = _add("U_MAG_TURN", "rad", "turn of the magnetometer on its mount, clockwise from above")
U_GYRO_OFFSET = _add("U_GYRO_OFFSET", "rad/s", "error that is added to each axis of the gyroscope")
U_ACCEL_OFFSET = _add("U_ACCEL_OFFSET", "m/s^2", "error that is added to each axis of the accelerometer")
U_GYRO_NOISE = _add("U_GYRO_NOISE", "rad/s", "standard deviation of more white noise of the gyroscope")
U_ACCEL_NOISE = _add("U_ACCEL_NOISE", "m/s^2", "standard deviation of more white noise of the accelerometer")
U_RC_BLOCKED = _add("U_RC_BLOCKED", "1", "1: the receiver hears no transmitter")

# --- measurements: last sample of each sensor, in the axes of autopilots ---
M_GYRO = _add("M_GYRO", "rad/s", "body rates", 3, FRD)
M_ACCEL = _add("M_ACCEL", "m/s^2", "specific force", 3, FRD)
M_MAG = _add("M_MAG", "gauss", "magnetic field", 3, FRD)
M_BARO = _add("M_BARO", "m", "pressure altitude about the world's origin, up")
M_GPS = _add("M_GPS", "m", "position about the world's origin", 3, NED)
M_GPS_VELOCITY = _add("M_GPS_VELOCITY", "m/s", "velocity over the ground", 3, NED)
M_GPS_FIX = _add("M_GPS_FIX", "1", "MAVLink GPS_FIX_TYPE: 0 none, 3 three-dimensional, 6 RTK fixed")
M_GPS_COUNT = _add("M_GPS_COUNT", "1", "number of fixes; grows with each new one")
M_RANGE = _add("M_RANGE", "m", "distance to the ground along the body's down axis; -1 out of range")
M_BARO_COUNT = _add("M_BARO_COUNT", "1", "number of barometer samples")
M_MAG_COUNT = _add("M_MAG_COUNT", "1", "number of magnetometer samples")
SAMPLES_END = WORLD_LAYOUT.end
"""First column after the samples that an autopilot may read."""
M_GYRO_BIAS = _add("M_GYRO_BIAS", "rad/s", "true bias; not for autopilots, as the four below", 3, FRD)
M_ACCEL_BIAS = _add("M_ACCEL_BIAS", "m/s^2", "true bias", 3, FRD)
M_MAG_BIAS = _add("M_MAG_BIAS", "gauss", "true bias", 3, FRD)
M_BARO_BIAS = _add("M_BARO_BIAS", "m", "true bias, up")
M_GPS_BIAS = _add("M_GPS_BIAS", "m", "true bias", 3, NED)
M_GPS_VELOCITY_BIAS = _add("M_GPS_VELOCITY_BIAS", "m/s", "true bias", 3, NED)

# --- parameters of all bodies ---
MULTIROTOR = 0.0
ROVER = 1.0
P_KIND = _add("P_KIND", "1", "MULTIROTOR or ROVER")
P_MASS = _add("P_MASS", "kg", "mass")
P_INERTIA = _add("P_INERTIA", "kg m^2", "principal moments of inertia", 3, FLU)
P_DRAG_LINEAR = _add(
    "P_DRAG_LINEAR", "N s/m", "linear drag coefficient; multirotor: with its rotors in hover"
)
P_HOVER_SPEED = _add(
    "P_HOVER_SPEED", "rad/s", "multirotor: rotor speed at which the thrust equals the weight"
)
P_INFLOW = _add(
    "P_INFLOW", "N s^2/m^2", "multirotor: loss of thrust over the square of the climb along the axis"
)
P_DRAG_QUADRATIC = _add("P_DRAG_QUADRATIC", "N s^2/m^2", "quadratic drag coefficient")
P_SPIN_DAMPING = _add("P_SPIN_DAMPING", "N m s/rad", "damping of body rates")
P_REACH = _add("P_REACH", "m", "radius of the upright cylinder that a body collides with")
P_FEET = _add("P_FEET", "m", "position of the feet", 3, "half length, half width, depth below the centre")
P_STIFFNESS = _add("P_STIFFNESS", "N/m", "spring of one foot")
P_DAMPING = _add("P_DAMPING", "N s/m", "damper of one foot")
P_FRICTION = _add("P_FRICTION", "1", "Coulomb friction coefficient")
P_CAPACITY = _add("P_CAPACITY", "A s", "battery capacity")
P_CELLS = _add("P_CELLS", "1", "battery cells in series")
P_RESISTANCE = _add("P_RESISTANCE", "ohm", "resistance of the whole battery")
P_IDLE_POWER = _add("P_IDLE_POWER", "W", "power of autopilot, receivers and sensors")
P_GUST_DECAY = _add("P_GUST_DECAY", "1", "factor on a gust over one gust period")
P_GUST_GAIN = _add("P_GUST_GAIN", "1", "gain on a gust's driving noise")
P_GRAVITY = _add("P_GRAVITY", "m/s^2", "acceleration of gravity")
P_MAGNETIC_FIELD = _add("P_MAGNETIC_FIELD", "gauss", "the earth's field at the world's origin", 3, NED)

# --- parameters of sensors: four columns of error parameters for each measured quantity ---
WHITE_SIGMA, BIAS_SIGMA, BIAS_DECAY, BIAS_GAIN = range(4)
"""Offsets into the error parameters of one quantity."""
ERROR = "white sigma, bias sigma, bias decay per period [1], gain on the bias's driving noise"
P_GYRO_ERROR = _add("P_GYRO_ERROR", "rad/s", "gyroscope", 4, ERROR)
P_ACCEL_ERROR = _add("P_ACCEL_ERROR", "m/s^2", "accelerometer", 4, ERROR)
P_MAG_ERROR = _add("P_MAG_ERROR", "gauss", "magnetometer", 4, ERROR)
P_BARO_ERROR = _add("P_BARO_ERROR", "m", "barometer", 4, ERROR)
P_GPS_HORIZONTAL_ERROR = _add("P_GPS_HORIZONTAL_ERROR", "m", "GPS position, per horizontal axis", 4, ERROR)
P_GPS_VERTICAL_ERROR = _add("P_GPS_VERTICAL_ERROR", "m", "GPS height", 4, ERROR)
P_GPS_VELOCITY_ERROR = _add("P_GPS_VELOCITY_ERROR", "m/s", "GPS velocity, per axis", 4, ERROR)
P_RANGE_ERROR = _add("P_RANGE_ERROR", "m", "range finder", 4, ERROR)
P_GPS_PERIOD = _add("P_GPS_PERIOD", "1", "grid steps between two fixes")
P_GPS_FIX = _add("P_GPS_FIX", "1", "MAVLink GPS_FIX_TYPE that the receiver reaches")
P_MAX_RANGE = _add("P_MAX_RANGE", "m", "reach of the range finder")
P_PERFECT = _add("P_PERFECT", "1", "1: sensors without error, and the estimate is the true state")

# --- parameters of multirotors ---
P_ROTORS = _add("P_ROTORS", "1", "number of rotors")
P_ROTOR_X = _add("P_ROTOR_X", "m", "rotor positions forward of the centre", ROTORS, MOTORS)
P_ROTOR_Y = _add("P_ROTOR_Y", "m", "rotor positions left of the centre", ROTORS, MOTORS)
P_ROTOR_SPIN = _add(
    "P_ROTOR_SPIN",
    "1",
    "+1: reaction torque about up (rotor turns clockwise from above), or -1",
    ROTORS,
    MOTORS,
)
P_THRUST = _add("P_THRUST", "N s^2", "k_T in thrust = k_T w^2")
P_TORQUE = _add("P_TORQUE", "N m s^2", "k_Q in torque = k_Q w^2")
P_ROTOR_DECAY = _add("P_ROTOR_DECAY", "1", "factor on a rotor's distance from its target over half a step")
P_MAX_ROTOR_SPEED = _add("P_MAX_ROTOR_SPEED", "rad/s", "at full throttle and full battery")
P_EFFICIENCY = _add("P_EFFICIENCY", "1", "efficiency of motor and speed controller")
P_FULL_VOLTS = _add("P_FULL_VOLTS", "V", "open-circuit voltage of the full battery")

# --- parameters of rovers ---
P_WHEELBASE = _add("P_WHEELBASE", "m", "distance between the axles")
P_MAX_STEERING = _add("P_MAX_STEERING", "rad", "largest steering angle")
P_STEERING_DECAY = _add("P_STEERING_DECAY", "1", "the same factor of the steering angle")
P_MAX_SPEED = _add("P_MAX_SPEED", "m/s", "at full throttle")
P_SPEED_DECAY = _add("P_SPEED_DECAY", "1", "the same factor of the speed")
P_ROLLING = _add("P_ROLLING", "1", "rolling resistance coefficient")
P_DRIVE_EFFICIENCY = _add("P_DRIVE_EFFICIENCY", "1", "efficiency of the drive")
P_SKID_STEERED = _add("P_SKID_STEERED", "1", "1: turns on the spot; steering commands a turn rate")
P_MAX_TURN_RATE = _add("P_MAX_TURN_RATE", "rad/s", "skid-steered: turn rate at full steering")
P_GRIP = _add("P_GRIP", "m/s^2", "largest acceleration that the tyres give")

# --- scratch: not kept from one step to the next ---
W_STATE = _add("W_STATE", "mixed", "state at which a slope is taken", ADVANCED, "as the first columns")
W_SLOPE = _add("W_SLOPE", "mixed", "rate of change of the motion", MOTION, "as the first columns")
W_ROTATION = _add("W_ROTATION", "1", f"matrix from body ({FLU}) to world ({ENU})", 9, "3 x 3 by rows")
W_FORCE = _add("W_FORCE", "N", "force without gravity", 3, ENU)
W_TORQUE = _add("W_TORQUE", "N m", "torque", 3, FLU)
W_AIR_VELOCITY = _add("W_AIR_VELOCITY", "m/s", "velocity of the air, constant over a step", 3, ENU)
W_GROUND = _add("W_GROUND", "m", "height of the ground, constant over a step, up")
W_THROTTLE = _add("W_THROTTLE", "1", "motor commands of a step, as U_THROTTLE", ROTORS, MOTORS)
W_LAST_VELOCITY = _add("W_LAST_VELOCITY", "m/s", "velocity before the step", 3, ENU)
WORLD = WORLD_LAYOUT.end
"""Number of columns of the world; the flight stack's columns begin here."""


ACTIVE_STEPS = 500
"""A body that was read within this many grid steps is advanced together with the others."""


class Bodies(NamedTuple):
    """All arrays that the compiled step reads and writes.

    ``rows`` (bodies, WORLD + the flight stack's columns); ``keys`` (bodies) of the noise; ``reached``
    (bodies): grid step of each row; ``heights`` (posts north, posts east) and ``grid`` (west edge, south
    edge, spacing) of the terrain, in metres; ``read`` (bodies): grid step at which each was last read;
    ``span``: first body to advance, the body after the last one, and the grid step to advance to. ``solids``,
    ``edges``, ``cells`` and ``lattice`` are the scene's, see ``SceneArrays``.
    """

    rows: Array
    keys: NDArray[np.uint64]
    reached: NDArray[np.int64]
    heights: Array
    grid: Array
    read: NDArray[np.int64]
    span: NDArray[np.int64]
    solids: Array
    edges: Array
    cells: NDArray[np.int64]
    lattice: Array


BODIES_ARGUMENTS = (
    "float64[:,::1]", "uint64[::1]", "int64[::1]", "float64[:,::1]", "float64[::1]",
    "int64[::1]", "int64[::1]", "float64[:,::1]", "float64[:,::1]", "int64[::1]", "float64[::1]",
)  # fmt: skip
"""Types of the arguments of a compiled step: the arrays of ``Bodies``."""
