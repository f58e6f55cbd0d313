"""Conversion of frames, attitudes and geodetic coordinates. No other module converts them.

Names: ``enu`` = east, north, up metres about an origin; ``ned`` = north, east, down about the same origin;
``flu``/``frd`` = body axes forward, left, up / forward, right, down (REP-103 on the ROS side, MAVLink on the
other). Yaw: ENU yaw is radians anticlockwise from east, NED heading radians clockwise from north. Quaternions
are (w, x, y, z) and rotate body into world.

Geodetic to local goes through earth-centred coordinates of the WGS-84 ellipsoid (NIMA TR8350.2) and is exact
to floating point at any distance. Heights here are one kind throughout: give AMSL and get AMSL. The geoid is
taken as parallel to the ellipsoid within the local frame, and as if it were the ellipsoid: over 10 km that
costs up to about 1 m of height and, N / 6371 km, 0.16 m of distance where the geoid is N = 100 m away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import degrees, hypot, pi, radians, remainder, sqrt

from volery.base.elementary import atan2, cos, sine_cosine
from volery.base.position import AMSL, Altitude, Position

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

EQUATOR_M = 6_378_137.0
FLATTENING = 1.0 / 298.257223563
_E2 = FLATTENING * (2.0 - FLATTENING)
_HALF = sqrt(0.5)
_AXES, _SIGNS = (1, 0, 2, 4, 3, 5), (1.0, 1.0, -1.0, 1.0, 1.0, -1.0)


def enu_to_ned(v: Vector) -> Vector:
    """Convert a vector from east, north, up to north, east, down. Its own inverse."""
    return v[1], v[0], -v[2]


ned_to_enu = enu_to_ned


def flu_to_frd(v: Vector) -> Vector:
    """Convert a vector from forward, left, up to forward, right, down. Its own inverse."""
    return v[0], -v[1], -v[2]


frd_to_flu = flu_to_frd


def wrap(angle: float) -> float:
    """Return the same angle in (-pi, pi], radians."""
    wrapped = remainder(angle, 2.0 * pi)
    return pi if wrapped == -pi else wrapped


def heading_to_yaw(heading: float) -> float:
    """Convert a NED heading (clockwise from north) to ENU yaw (anticlockwise from east), radians.

    Its own inverse.
    """
    return wrap(pi / 2.0 - heading)


yaw_to_heading = heading_to_yaw


def turn_clockwise(vector: tuple[float, float], angle: float) -> tuple[float, float]:
    """Turn a horizontal vector (north, east) clockwise by *angle* [rad].

    Ahead and right of a body become north and east when they are turned by its heading; its negative does the
    opposite.
    """
    sine, cosine = sine_cosine(angle)
    return vector[0] * cosine - vector[1] * sine, vector[0] * sine + vector[1] * cosine


def map_to_north_east(point: tuple[float, float], x_heading: float) -> tuple[float, float]:
    """Convert a point of a plane map, or a vector, to north and east. Its own inverse.

    Args:
        point: Along the map's x axis and along its y axis, which is to the left of that.
        x_heading: Where the x axis points, clockwise from north, radians.
    """
    sine, cosine = sine_cosine(x_heading)
    return cosine * point[0] + sine * point[1], sine * point[0] - cosine * point[1]


def map_covariance_to_ned(
    covariance: Sequence[Sequence[float]], x_heading: float
) -> tuple[tuple[float, float, float], ...]:
    """Convert the covariance (3 rows of 3) of x, y, yaw on a map to that of north, east, heading.

    Args:
        covariance: In m and radians, yaw anticlockwise.
        x_heading: See ``map_to_north_east``.
    """
    sine, cosine = sine_cosine(x_heading)
    turn = ((cosine, sine, 0.0), (sine, -cosine, 0.0), (0.0, 0.0, -1.0))
    half = [[sum(row[k] * covariance[k][j] for k in range(3)) for j in range(3)] for row in turn]
    first, second, third = ([sum(row[k] * other[k] for k in range(3)) for other in turn] for row in half)
    return (
        (first[0], first[1], first[2]),
        (second[0], second[1], second[2]),
        (third[0], third[1], third[2]),
    )


def pose_covariance_ned_to_enu(covariance: Sequence[float]) -> list[float]:
    """Convert the covariance of a pose, 36 values by rows, from NED to ENU. Its own inverse.

    Its rows are the three axes of position, then turns about the three axes.
    """
    return [
        _SIGNS[row] * _SIGNS[column] * covariance[6 * _AXES[row] + _AXES[column]]
        for row in range(6)
        for column in range(6)
    ]


pose_covariance_enu_to_ned = pose_covariance_ned_to_enu


def pose_covariance_neu_to_ned(rows: Sequence[Sequence[float]]) -> list[float]:
    """Convert the covariance of north, east, up, roll, pitch, heading (6 rows of 6) to 36 values of NED."""
    return [
        (-1.0 if (row == 2) != (column == 2) else 1.0) * float(rows[row][column])
        for row in range(6)
        for column in range(6)
    ]


def upper_triangle(covariance: Sequence[float]) -> list[float]:
    """Return the 21 values of the upper right triangle of a 6 by 6 matrix, by rows, as MAVLink has it."""
    return [covariance[6 * row + column] for row in range(6) for column in range(row, 6)]


def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return the Hamilton product p q: the rotation by q, then by p."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def world_to_body(attitude: Quaternion, v: Vector) -> Vector:
    """Rotate a world-frame vector into body axes.

    Args:
        attitude: Unit quaternion that rotates body into world.
        v: Vector in the axes of that world.
    """
    w, x, y, z = attitude
    _, bx, by, bz = multiply(multiply((w, -x, -y, -z), (0.0, *v)), attitude)
    return bx, by, bz


def body_to_world(attitude: Quaternion, v: Vector) -> Vector:
    """Rotate *v* from the body's axes to the world's, by the quaternion from body to world."""
    w, x, y, z = attitude
    return world_to_body((w, -x, -y, -z), v)


def attitude_ned_to_enu(q: Quaternion) -> Quaternion:
    """Convert the attitude of a FRD body in NED to that of the FLU body in ENU. Its own inverse."""
    w, x, y, z = q
    w, x, y, z = _HALF * w, _HALF * x, _HALF * y, _HALF * z
    # the product (0, sqrt(1/2), sqrt(1/2), 0) q (0, 1, 0, 0), without the terms that are zero
    return -w - z, 0.0 - x - y, y - x, z - w


attitude_enu_to_ned = attitude_ned_to_enu


def attitude_frd_to_flu(q: Quaternion) -> Quaternion:
    """Convert an attitude of FRD axes in other FRD axes to that of FLU in FLU. Its own inverse."""
    w, x, y, z = q
    return w, x, -y, -z


def euler_to_quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Convert intrinsic yaw, pitch, roll (z, y', x'') in radians to a quaternion."""
    sr, cr = sine_cosine(roll / 2)
    sp, cp = sine_cosine(pitch / 2)
    sy, cy = sine_cosine(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def quaternion_to_euler(q: Quaternion) -> Vector:
    """Convert a quaternion to roll, pitch, yaw in radians. At a pitch of +-pi/2 the roll is zero."""
    w, x, y, z = q
    sine = 2.0 * (w * y - z * x)
    if abs(sine) > 1.0 - 1e-12:
        up = 1.0 if sine > 0 else -1.0
        return 0.0, up * pi / 2.0, wrap(-up * 2.0 * atan2(x, w))
    cosine = hypot(1.0 - 2.0 * (x * x + y * y), 2.0 * (w * x + y * z))
    return (
        atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        atan2(sine, cosine),
        atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def geodetic_to_ecef(latitude: float, longitude: float, height: float) -> Vector:
    """Convert WGS-84 degrees and metres to earth-centred, earth-fixed metres."""
    sin_lat, cos_lat = sine_cosine(radians(latitude))
    sin_lon, cos_lon = sine_cosine(radians(longitude))
    normal = EQUATOR_M / sqrt(1.0 - _E2 * sin_lat * sin_lat)
    across = (normal + height) * cos_lat
    return (
        across * cos_lon,
        across * sin_lon,
        (normal * (1.0 - _E2) + height) * sin_lat,
    )


def ecef_to_geodetic(ecef: Vector) -> Vector:
    """Convert earth-centred metres to WGS-84 latitude, longitude (degrees) and height (metres).

    Bowring's method, iterated on the reduced latitude: to 1e-9 degrees and 1e-6 m, from 10 km below to 50 km
    above the ellipsoid.
    """
    x, y, z = ecef
    polar = EQUATOR_M * (1.0 - FLATTENING)
    from_axis = sqrt(x * x + y * y)
    up, across = z, from_axis
    sine, cosine = _unit(EQUATOR_M * up, polar * across)  # of the reduced latitude
    for _ in range(2):
        up = z + _E2 / (1.0 - _E2) * polar * sine * sine * sine  # (across, up) has the slope of the latitude
        across = from_axis - _E2 * EQUATOR_M * cosine * cosine * cosine
        sine, cosine = _unit((1.0 - FLATTENING) * up, across)
    sine, cosine = _unit(up, across)
    height = from_axis * cosine + z * sine - EQUATOR_M * sqrt(1.0 - _E2 * sine * sine)
    return degrees(atan2(up, across)), degrees(atan2(y, x)), height


def _unit(sine: float, cosine: float) -> tuple[float, float]:
    """Return sine and cosine of the direction of a vector; zeros of none."""
    length = sqrt(sine * sine + cosine * cosine) or 1.0
    return sine / length, cosine / length


@dataclass(frozen=True)
class LocalFrame:
    """Tangent plane at an origin: converts between WGS-84 degrees with AMSL and local metres.

    Attributes:
        latitude: Of the origin, degrees north.
        longitude: Of the origin, degrees east.
        amsl: Altitude of the origin, metres above mean sea level.
    """

    latitude: float
    longitude: float
    amsl: float = 0.0
    _origin: Vector = field(init=False, repr=False, compare=False)
    _axes: tuple[Vector, Vector, Vector] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("latitude", "longitude", "amsl"):  # compiled, a float is one; plain, it may be an int
            object.__setattr__(self, name, float(getattr(self, name)))
        sin_lat, cos_lat = sine_cosine(radians(self.latitude))
        sin_lon, cos_lon = sine_cosine(radians(self.longitude))
        axes = (
            (-sin_lon, cos_lon, 0.0),
            (-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat),
            (cos_lat * cos_lon, cos_lat * sin_lon, sin_lat),
        )
        object.__setattr__(self, "_origin", geodetic_to_ecef(self.latitude, self.longitude, self.amsl))
        object.__setattr__(self, "_axes", axes)

    def to_enu(self, latitude: float, longitude: float, amsl: float) -> Vector:
        """Convert degrees and metres AMSL to east, north, up metres from the origin."""
        x, y, z = geodetic_to_ecef(latitude, longitude, amsl)
        dx, dy, dz = x - self._origin[0], y - self._origin[1], z - self._origin[2]
        east, north, up = self._axes
        return (
            east[0] * dx + east[1] * dy + east[2] * dz,
            north[0] * dx + north[1] * dy + north[2] * dz,
            up[0] * dx + up[1] * dy + up[2] * dz,
        )

    def from_enu(self, enu: Vector) -> Vector:
        """Convert east, north, up metres to latitude, longitude (degrees) and metres AMSL."""
        east, north, up = self._axes
        return ecef_to_geodetic(
            (
                self._origin[0] + east[0] * enu[0] + north[0] * enu[1] + up[0] * enu[2],
                self._origin[1] + east[1] * enu[0] + north[1] * enu[1] + up[1] * enu[2],
                self._origin[2] + east[2] * enu[0] + north[2] * enu[1] + up[2] * enu[2],
            )
        )

    def to_ned(self, latitude: float, longitude: float, amsl: float) -> Vector:
        """Convert degrees and metres AMSL to north, east, down metres from the origin."""
        return enu_to_ned(self.to_enu(latitude, longitude, amsl))

    def to_ned_flat(self, latitude: float, longitude: float, amsl: float) -> Vector:
        """Convert degrees and metres AMSL to north, east, down metres on a map unrolled from the origin.

        For points beyond the horizon, where the tangent plane lies far above the ground: directions and
        heights are those in which a vehicle sets off, lengths are rough.
        """
        mean = radians((latitude + self.latitude) / 2.0)
        north = radians(latitude - self.latitude) * EQUATOR_M
        east = wrap(radians(longitude - self.longitude)) * EQUATOR_M * cos(mean)
        return north, east, self.amsl - amsl

    def from_ned(self, ned: Vector) -> Vector:
        """Convert north, east, down metres to latitude, longitude (degrees) and metres AMSL."""
        return self.from_enu(ned_to_enu(ned))


class HomeFrame:
    """The frame in which a vehicle is commanded and judged: metres east and north of home, metres above home.

    Args:
        home: Home position with an AMSL altitude.
    """

    def __init__(self, home: Position) -> None:
        self.home = home
        self._amsl = home.altitude.metres
        self._plane = LocalFrame(home.latitude, home.longitude, self._amsl)
        nowhere: tuple[Position | None, Vector] = None, (0.0, 0.0, 0.0)
        self._converted = nowhere, nowhere  # the last two: where a vehicle is, and where it goes

    def local(self, position: Position) -> Vector:
        """Return metres east and north of home and metres above home.

        The third value is the difference of altitudes, not the coordinate in the tangent plane. An altitude
        of another kind (above ground) is taken as above home: the best estimate without a terrain model.
        """
        last, before = self._converted
        if position is last[0]:
            return last[1]
        if position is before[0]:
            return before[1]
        height = self.above_home(position.altitude)
        east, north, _ = self._plane.to_enu(position.latitude, position.longitude, self._amsl + height)
        self._converted = (position, (east, north, height)), last
        return east, north, height

    def above_home(self, altitude: Altitude) -> float:
        """Return an altitude as metres above home."""
        return altitude.metres - self._amsl if isinstance(altitude, AMSL) else altitude.metres

    def distance(self, here: Position, there: Position) -> float:
        """Return the horizontal distance of two positions, m."""
        one, other = self.local(here), self.local(there)
        return hypot(one[0] - other[0], one[1] - other[1])
