"""State of the flight stack in a body's state row: its columns, and the estimate as a read-only view of them.

Columns ``C_`` are commands, ``K_`` the memory of estimator and loops. They continue the world's layout. Axes
are the autopilot's: north, east, down about the world's origin, and forward, right, down.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import inf, sqrt
from struct import Struct, unpack_from

from volery.base.frames import LocalFrame, Quaternion, Vector
from volery.base.time import Ns
from volery.simulation.world.environment_models import pressure_at
from volery.simulation.world.sensors import SensorSuite
from volery.simulation.world.state_layout import (
    FRD,
    M_ACCEL,
    M_BARO,
    M_GPS,
    M_GPS_COUNT,
    M_GPS_FIX,
    M_GPS_VELOCITY,
    M_GYRO,
    M_MAG,
    M_RANGE,
    MOTORS,
    NED,
    OCTETS,
    ROTORS,
    S_AMPS,
    S_CHARGE,
    S_ENERGY,
    S_VOLTS,
    WORLD,
    WORLD_LAYOUT,
    ColumnLayout,
)


class Control(IntEnum):
    """Quantities that the inner loops control.

    Multirotors take OFF to VELOCITY_HEIGHT, MOTOR and RATE; rovers take OFF, IDLE, POSITION, STEER and DRIVE;
    both take EXTERNAL.
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
    MOTOR = 10  # multirotor on the ground: one motor, the others stopped
    RATE = 11  # multirotor: body rates and throttle
    EXTERNAL = 12  # nothing: the motors are inputs, and the whole flight stack rests


OFF, IDLE, ATTITUDE, CLIMB, VELOCITY, POSITION, POSITION_CLIMB, VELOCITY_HEIGHT = range(8)
STEER, DRIVE, MOTOR, RATE, EXTERNAL = range(8, 13)

BY_POSES = 3
"""Value of ``C_AIDED``."""
REFUSE, FUSE, RESET = range(3)
"""Values of ``C_POSE_USE``."""
HOLD_HEADING, YAW_ANGLE, YAW_RATE, YAW_ANGLE_AND_RATE = range(4)
"""Values of ``C_YAW_MODE``."""

FLIGHT_LAYOUT = ColumnLayout(after=WORLD_LAYOUT)
_add = FLIGHT_LAYOUT.add
RPY = "roll, pitch, yaw"
assert FLIGHT_LAYOUT.start == WORLD

# --- scratch ---
W_DCM = _add("W_DCM", "1", f"matrix from body ({FRD}) to {NED}", 9, "3 x 3 by rows")

# --- commands: C_CONTROL to C_PITCH_RATE in the order of ``Setpoint.row`` ---
C_CONTROL = _add("C_CONTROL", "1", "a Control")
C_POSITION = _add("C_POSITION", "m", "about the estimator's origin", 3, NED)
C_VELOCITY = _add("C_VELOCITY", "m/s", "over the ground; rover DRIVE: the first is the forward speed", 3, NED)
C_ROLL = _add("C_ROLL", "rad", "roll angle")
C_PITCH = _add("C_PITCH", "rad", "pitch angle")
C_YAW = _add("C_YAW", "rad", "yaw angle, clockwise from north")
C_YAW_RATE = _add("C_YAW_RATE", "rad/s", "yaw rate, clockwise")
C_YAW_MODE = _add("C_YAW_MODE", "1", "HOLD_HEADING, YAW_ANGLE, YAW_RATE or both")
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
C_MOTOR = _add("C_MOTOR", "1", "MOTOR: number of the motor, from 0")
C_ROLL_RATE = _add("C_ROLL_RATE", "rad/s", "RATE: body rate about the forward axis")
C_PITCH_RATE = _add("C_PITCH_RATE", "rad/s", "RATE: body rate about the right axis")
C_AIDED = _add(
    "C_AIDED",
    "1",
    "1: use satellites; the origin is the position then; 2: with the origin as it is; 3: external poses",
)
C_YAW_P = _add("C_YAW_P", "s", "gain of the yaw rate loop on a filtered error; 0: another loop, unfiltered")
C_YAW_I = _add("C_YAW_I", "1", "integral gain of that loop")
C_YAW_FILTER = _add("C_YAW_FILTER", "rad/s", "corner frequency of its error's filter")
C_STICK = _add("C_STICK", "1", "rover: steering -1..1 that a pilot adds to that of the autopilot")
C_STICK_SHARE = _add(
    "C_STICK_SHARE", "1", "rover: share by which the autopilot's own steering is reduced then"
)
C_COASTS = _add("C_COASTS", "1", "1: a rover does not brake by its motor")
C_GPS_GATE = _add("C_GPS_GATE", "1", "distance from which a fix is refused, in its sigmas; 0: none is")
C_GPS_SIGMA = _add("C_GPS_SIGMA", "m", "least sigma of a fix in that comparison")
C_GPS_RADIUS = _add("C_GPS_RADIUS", "m", "twice the sigma of a position that is reset to a fix")
C_FULL_VOLTS = _add(
    "C_FULL_VOLTS", "V", "voltage for which thrust is computed; with a lower one motors turn faster; 0: none"
)
C_LEAST_VOLTS = _add("C_LEAST_VOLTS", "V", "least voltage that counts for that")
C_HOVER_KEPT = _add("C_HOVER_KEPT", "1", "1: the hover throttle is not learnt")
C_POSE_COUNT = _add("C_POSE_COUNT", "1", "number of external poses so far")
C_POSE_USE = _add("C_POSE_USE", "1", "REFUSE, FUSE or RESET: what is done with the last one")
C_POSE = _add("C_POSE", "m", "the last one less the estimate at its time", 3, NED)
C_POSE_TURN = _add("C_POSE_TURN", "rad", "its yaw less the estimated one at its time")
C_POSE_SIGMA = _add("C_POSE_SIGMA", "m", "its sigmas; 0: the height is not used", 2, "horizontal, vertical")
C_POSE_YAW = _add("C_POSE_YAW", "1", "1: the heading is that of the poses, not of the compass")

# --- memory that ``Estimate`` shows ---
K_POSITION = _add("K_POSITION", "m", "estimated, about the world's origin", 3, NED)
K_VELOCITY = _add("K_VELOCITY", "m/s", "estimated", 3, NED)
K_ATTITUDE = _add("K_ATTITUDE", "1", f"estimated quaternion from body ({FRD}) to {NED}", 4, "w, x, y, z")
K_EULER = _add("K_EULER", "rad", "estimated attitude as angles", 3, RPY)
K_RATES = _add("K_RATES", "rad/s", "estimated body rates", 3, FRD)
K_ACCEL = _add("K_ACCEL", "m/s^2", "estimated acceleration without gravity", 3, NED)
K_ORIGIN = _add("K_ORIGIN", "m", "the estimator's origin about the world's", 3, NED)
K_AIDED = _add("K_AIDED", "1", "1 once satellites or poses are used and positions are valid")
K_ALIGNED = _add("K_ALIGNED", "1", "1 once tilt and heading are initialised")
K_GPS_AGE = _add("K_GPS_AGE", "s", "time since a fix or a pose was last fused")
K_SIGMA = _add(
    "K_SIGMA",
    "m, m/s",
    "standard deviations",
    4,
    "horizontal, vertical position; the same of velocity",
)
K_HEADING_ERROR = _add("K_HEADING_ERROR", "rad", "last magnetometer heading less the estimate")
K_MOTORS = _add("K_MOTORS", "1", "motor commands 0..1; rover: steering, throttle -1..1", ROTORS, MOTORS)
K_LANDED = _add("K_LANDED", "1", "1: the landed detector reports landed")
K_THROTTLE = _add("K_THROTTLE", "1", "collective 0..1; rover: throttle -1..1")
K_HOVER_THROTTLE = _add("K_HOVER_THROTTLE", "1", "learnt collective in hover")
K_STORED_HOVER = _add("K_STORED_HOVER", "1", "the same, from a start and with a learning that are given")
K_RATE_TUNING = _add("K_RATE_TUNING", "1", "factor on the outputs of the rate loops", 3, FRD)
K_TARGET = _add("K_TARGET", "m", "shaped target position about the world's origin", 3, NED)
K_TARGET_VELOCITY = _add("K_TARGET_VELOCITY", "m/s", "shaped; rover: the first is the forward speed", 3, NED)
K_TARGET_ACCEL = _add("K_TARGET_ACCEL", "m/s^2", "shaped", 3, NED)
K_TARGET_EULER = _add("K_TARGET_EULER", "rad", "target of the attitude loop", 3, RPY)
K_GPS_INNOVATION = _add("K_GPS_INNOVATION", "1", "last horizontal innovation of a fix, in sigmas")
K_GPS_REFUSED = _add("K_GPS_REFUSED", "s", "time for which all fixes have been refused")

# --- private memory ---
K_GYRO_BIAS = _add("K_GYRO_BIAS", "rad/s", "estimated", 3, FRD)
K_ACCEL_BIAS = _add("K_ACCEL_BIAS", "m/s^2", "estimated", 3, NED)
K_COVARIANCE = _add(
    "K_COVARIANCE", "mixed", "of position p, velocity v and bias b", 18, "per axis of NED: pp pv pb vv vb bb"
)
K_USED_GPS = _add("K_USED_GPS", "1", "M_GPS_COUNT of the last fix fused")
K_USED_POSE = _add("K_USED_POSE", "1", "C_POSE_COUNT of the last pose used")
K_USED_BARO = _add("K_USED_BARO", "1", "M_BARO_COUNT of the last sample fused")
K_USED_MAG = _add("K_USED_MAG", "1", "M_MAG_COUNT of the last sample fused")
K_CONTROL = _add("K_CONTROL", "1", "the Control in force")
K_RATE_INTEGRAL = _add("K_RATE_INTEGRAL", "1", "integrators of the rate loops", 3, FRD)
K_LAST_RATES = _add("K_LAST_RATES", "rad/s", "rates at the step before", 3, FRD)
K_RATE_DERIVATIVE = _add("K_RATE_DERIVATIVE", "rad/s^2", "filtered derivative of the rates", 3, FRD)
K_VELOCITY_INTEGRAL = _add("K_VELOCITY_INTEGRAL", "m/s^2", "integrators of the velocity loops", 3, NED)
K_YAW_TARGET = _add("K_YAW_TARGET", "rad", "shaped yaw target, clockwise from north")
K_YAW_SPEED = _add("K_YAW_SPEED", "rad/s", "rate of the shaped yaw target")
K_YAW_MISS = _add("K_YAW_MISS", "rad/s", "filtered error of the yaw rate")
K_SPOOL = _add("K_SPOOL", "1", "0 idle .. 1 full authority of the loops")
K_LANDED_TIME = _add("K_LANDED_TIME", "s", "time for which the landed condition has been true")
K_TARGET_QUATERNION = _add("K_TARGET_QUATERNION", "1", "target attitude, as K_ATTITUDE", 4, "w, x, y, z")
K_BARO_OFFSET = _add("K_BARO_OFFSET", "m", "barometer reading at height zero, up")
K_FILTERED_ACCEL = _add("K_FILTERED_ACCEL", "m/s^2", "low-pass of K_ACCEL at 1 Hz", 3, NED)
K_SPEED_INTEGRAL = _add("K_SPEED_INTEGRAL", "1", "rover: integrator of the speed loop")
K_AT_LOWER_LIMIT = _add("K_AT_LOWER_LIMIT", "1", "1 while the collective is at its lower limit")
K_TILT_LIMITED = _add("K_TILT_LIMITED", "m/s^2", "wanted acceleration while the lean is at its limit", 2, NED)
K_LAST_MISS = _add("K_LAST_MISS", "m/s", "filtered error of the horizontal velocity loop", 2, NED)
K_VOLTS_SHARE = _add("K_VOLTS_SHARE", "1", "filtered voltage over C_FULL_VOLTS; 0: not yet known")
K_MISS_DERIVATIVE = _add("K_MISS_DERIVATIVE", "m/s^2", "its filtered derivative", 2, NED)
FLIGHT = FLIGHT_LAYOUT.end - FLIGHT_LAYOUT.start
"""Number of columns that the flight stack adds to a row."""

_THREE, _FOUR = Struct("3d"), Struct("4d")


@dataclass(frozen=True)
class GpsFix:
    """The receiver's last fix; without one, ``fix_type`` and ``satellites`` are 0 and the rest is outdated.

    Args:
        fix_type: MAVLink GPS_FIX_TYPE.
        latitude: Latitude [degrees].
        longitude: Longitude [degrees].
        amsl: Height above mean sea level [m].
        velocity: North, east, down [m/s].
        h_acc: Declared standard deviation of each horizontal axis [m]; likewise ``v_acc`` of the height.
        speed_acc: Declared standard deviation of the velocity [m/s].
        eph: Horizontal dilution of precision; likewise ``epv`` vertical.
        satellites: Number of satellites in use.
        count: Number of fixes so far.
    """

    fix_type: int
    latitude: float
    longitude: float
    amsl: float
    velocity: Vector
    h_acc: float
    v_acc: float
    speed_acc: float
    eph: float
    epv: float
    satellites: int
    count: int


@dataclass
class EstimateConstants:
    """Constants of a vehicle that are needed to read its estimate, and the estimator's last origin."""

    frame: LocalFrame
    flying: bool
    rotors: int
    capacity_as: float
    sensors: SensorSuite
    placed: LocalFrame | None = None
    """Frame of an origin that a user has placed, about which the estimator's positions are then."""
    _origin: tuple[Vector, Vector] | None = None

    @property
    def local(self) -> LocalFrame:
        """Frame of the estimator's positions."""
        return self.placed or self.frame

    def place(self, frame: LocalFrame | None) -> None:
        """Let the estimator's positions be about an origin that a user places, or about the world's again."""
        self.placed, self._origin = frame, None

    def origin_at(self, ned: Vector) -> Vector:
        """Return latitude, longitude [degrees] and height AMSL [m] of an origin [m], which seldom changes."""
        if self._origin is None or self._origin[0] != ned:
            self._origin = ned, self.local.from_ned(ned)
        return self._origin[1]


def _dilution(fix_type: int) -> float:
    return 1.21 if fix_type else inf


def _satellites(fix_type: int) -> int:
    return 10 if fix_type else 0


def _fix_of(about: EstimateConstants, row: Sequence[float]) -> GpsFix:
    """Return the receiver's last sample, of the columns of *row*, as a fix."""
    latitude, longitude, amsl = about.frame.from_ned((row[M_GPS], row[M_GPS + 1], row[M_GPS + 2]))
    kind = int(row[M_GPS_FIX])
    receiver = about.sensors.gps
    return GpsFix(
        fix_type=kind,
        latitude=latitude,
        longitude=longitude,
        amsl=amsl,
        velocity=(row[M_GPS_VELOCITY], row[M_GPS_VELOCITY + 1], row[M_GPS_VELOCITY + 2]),
        h_acc=sqrt(receiver.horizontal.variance) if kind else inf,
        v_acc=sqrt(receiver.vertical.variance) if kind else inf,
        speed_acc=sqrt(receiver.velocity.variance) if kind else inf,
        eph=_dilution(kind),
        epv=2.0 if kind else inf,
        satellites=_satellites(kind),
        count=int(row[M_GPS_COUNT]),
    )


class Estimate:
    """Estimate and measurements of one autopilot at one grid step; immutable, converted on access.

    Args:
        about: Constants of the vehicle.
        time: Time of the grid step [ns].
        row: The vehicle's row, as the bytes of its doubles; copying them is cheaper than making numbers.
    """

    __slots__ = ("_about", "_fix", "_geodetic", "_octets", "_position", "_row", "time")

    def __init__(self, about: EstimateConstants, time: Ns, row: bytes) -> None:
        self._about = about
        self.time = time
        self._octets = row
        self._row: Sequence[float] = memoryview(row).cast("d")
        self._position: Vector | None = None
        self._geodetic: Vector | None = None
        self._fix: GpsFix | None = None

    def _vector(self, column: int) -> Vector:
        x, y, z = _THREE.unpack_from(self._octets, OCTETS * column)
        return x, y, z

    def _four(self, column: int) -> tuple[float, float, float, float]:
        first, second, third, fourth = _FOUR.unpack_from(self._octets, OCTETS * column)
        return first, second, third, fourth

    def _about_origin(self, column: int) -> Vector:
        x, y, z = self._vector(column)
        north, east, down = self._vector(K_ORIGIN)
        return x - north, y - east, z - down

    @property
    def position(self) -> Vector:
        """Position north, east, down about the estimator's origin [m]."""
        if self._position is None:
            self._position = self._about_origin(K_POSITION)
        return self._position

    @property
    def geodetic(self) -> Vector:
        """Estimated latitude and longitude [degrees] and height AMSL [m]."""
        if self._geodetic is None:
            self._geodetic = self._about.local.from_ned(self._vector(K_POSITION))
        return self._geodetic

    @property
    def origin(self) -> Vector:
        """Latitude and longitude [degrees] and height AMSL [m] of the estimator's origin."""
        return self._about.origin_at(self._vector(K_ORIGIN))

    @property
    def origin_ned(self) -> Vector:
        """The estimator's origin, north, east, down about the world's [m]."""
        return self._vector(K_ORIGIN)

    @property
    def velocity(self) -> Vector:
        """Velocity north, east, down [m/s]."""
        return self._vector(K_VELOCITY)

    @property
    def acceleration(self) -> Vector:
        """Acceleration without gravity, north, east, down [m/s^2]."""
        return self._vector(K_ACCEL)

    @property
    def attitude(self) -> Vector:
        """Roll, pitch, yaw [rad]; yaw clockwise from north, in (-pi, pi]."""
        return self._vector(K_EULER)

    @property
    def quaternion(self) -> Quaternion:
        """Quaternion (w, x, y, z) from forward, right, down to north, east, down."""
        return self._four(K_ATTITUDE)

    @property
    def rates(self) -> Vector:
        """Body rates about forward, right, down, less the estimated gyro bias [rad/s]."""
        return self._vector(K_RATES)

    @property
    def attitude_ok(self) -> bool:
        """Whether tilt and heading are initialised."""
        return self._row[K_ALIGNED] > 0.5

    @property
    def position_ok(self) -> bool:
        """Whether horizontal position and velocity are aided, or were within ten seconds."""
        return self._row[K_AIDED] > 0.5 and self._row[K_GPS_AGE] < 10.0

    @property
    def gps_age(self) -> float:
        """Time since the estimator last fused a fix or a pose [s]."""
        return self._row[K_GPS_AGE]

    @property
    def by_poses(self) -> bool:
        """Whether the horizontal position is that of external poses, not of satellites."""
        return self._row[C_AIDED] > BY_POSES - 0.5

    @property
    def sigmas(self) -> tuple[float, float, float, float]:
        """Standard deviations: horizontal, vertical position [m]; the same of velocity [m/s]."""
        return self._four(K_SIGMA)

    @property
    def heading_error(self) -> float:
        """Last magnetometer heading less the estimate [rad]."""
        return self._row[K_HEADING_ERROR]

    @property
    def gps_innovation(self) -> float:
        """Last horizontal innovation of a fix, in its standard deviations."""
        return self._row[K_GPS_INNOVATION]

    @property
    def gps_refused(self) -> float:
        """Time for which the estimator has refused all fixes [s]; 0 while it fuses them."""
        return self._row[K_GPS_REFUSED]

    @property
    def gyro(self) -> Vector:
        """Gyroscope sample, forward, right, down [rad/s]."""
        return self._vector(M_GYRO)

    @property
    def accel(self) -> Vector:
        """Accelerometer sample, forward, right, down [m/s^2]; at rest (0, 0, -9.8)."""
        return self._vector(M_ACCEL)

    @property
    def mag(self) -> Vector:
        """Magnetometer sample, forward, right, down [gauss]."""
        return self._vector(M_MAG)

    @property
    def baro_altitude(self) -> float:
        """Barometer sample as height about the world's origin [m up]."""
        return self._row[M_BARO]

    @property
    def pressure(self) -> float:
        """Absolute pressure [hPa], by the standard atmosphere at the barometer's height AMSL."""
        return float(pressure_at(self._about.frame.amsl + self._row[M_BARO])) / 100.0

    @property
    def rangefinder(self) -> float | None:
        """Distance to the ground along the body's down axis [m]; None out of range."""
        distance = self._row[M_RANGE]
        return distance if distance >= 0.0 else None

    @property
    def fix_type(self) -> int:
        """MAVLink GPS_FIX_TYPE of the receiver's last sample."""
        return int(self._row[M_GPS_FIX])

    @property
    def satellites(self) -> int:
        """Number of satellites of the receiver's last sample."""
        return _satellites(self.fix_type)

    @property
    def horizontal_dilution(self) -> float:
        """Horizontal dilution of precision of the receiver's last sample; infinite without a fix."""
        return _dilution(self.fix_type)

    @property
    def gps(self) -> GpsFix:
        """The receiver's last fix."""
        if self._fix is None:
            self._fix = _fix_of(self._about, self._row)
        return self._fix

    @property
    def battery_volts(self) -> float:
        """Battery voltage at the terminals [V]."""
        return self._row[S_VOLTS]

    @property
    def battery_amps(self) -> float:
        """Battery current [A]."""
        return self._row[S_AMPS]

    @property
    def battery_used_mah(self) -> float:
        """Charge drawn since the battery was full [mAh]."""
        return self._row[S_CHARGE] / 3.6

    @property
    def battery_left(self) -> float:
        """Fraction of the battery charge left, 0..1."""
        return max(0.0, 1.0 - self._row[S_CHARGE] / self._about.capacity_as)

    @property
    def battery_energy_j(self) -> float:
        """Energy drawn from the battery since the start [J]."""
        return self._row[S_ENERGY]

    @property
    def motors(self) -> tuple[float, ...]:
        """Motor commands 0..1; rover: steering (right positive) and throttle -1..1."""
        return unpack_from(f"{self._about.rotors or 2}d", self._octets, OCTETS * K_MOTORS)

    @property
    def motor_pwm(self) -> tuple[int, ...]:
        """Motor outputs as pulse widths [us], 1000 to 2000; rover: steering and throttle about 1500."""
        if self._about.flying:
            return tuple(round(1000.0 + 1000.0 * motor) for motor in self.motors)
        steering, throttle = self.motors
        return round(1500.0 + 500.0 * steering), 0, round(1500.0 + 500.0 * throttle), 0

    @property
    def throttle(self) -> float:
        """Collective 0..1; rover: throttle -1..1."""
        return self._row[K_THROTTLE]

    @property
    def hover_throttle(self) -> float:
        """Learnt collective in hover, 0..1."""
        return self._row[K_HOVER_THROTTLE]

    @property
    def stored_hover(self) -> float:
        """The same, started by ``Flight.set_hover_throttle``, learnt as ``set_hover_learning`` admits."""
        return self._row[K_STORED_HOVER]

    @property
    def landed(self) -> bool:
        """Whether the landed detector reports landed."""
        return self._row[K_LANDED] > 0.5

    @property
    def target(self) -> Vector:
        """Shaped target position, north, east, down about the estimator's origin [m]."""
        return self._about_origin(K_TARGET)

    @property
    def target_velocity(self) -> Vector:
        """Velocity of the shaped target, north, east, down [m/s]."""
        return self._vector(K_TARGET_VELOCITY)

    @property
    def target_attitude(self) -> Vector:
        """Roll, pitch, yaw target of the attitude loop [rad]."""
        return self._vector(K_TARGET_EULER)
