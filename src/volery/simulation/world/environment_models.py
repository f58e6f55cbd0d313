"""Models of the surroundings: standard atmosphere, magnetic field, terrain and wind.

* Atmosphere: the lowest layer of ISO 2533, up to 11 km.
* Magnetic field: the main field's scalar potential in Schmidt semi-normalised spherical harmonics to degree
  4, with the coefficients of the International Geomagnetic Reference Field, 13th generation, epoch 2020
  (Alken et al., Earth, Planets and Space 73 (2021), table 2). Valid at mid latitudes at the ground, to some 3
  degrees and 5 % of the full model; geographic latitude is taken for geocentric. Sufficient for a
  magnetometer whose autopilot uses the same model, not for surveying.
* Terrain: heights over a square grid, bilinear between the posts, level beyond the edge.
* Wind: a mean and gusts. Each component of a gust is first-order Gauss-Markov noise, the shape of Dryden's
  longitudinal spectrum (MIL-F-8785C): g' = -g/T + s sqrt(2/T) n, T = L / V, in its exact discrete form.
  Dryden's lateral and vertical spectra are of second order; here all are as the longitudinal one, with the
  vertical deviation halved, and V is the mean wind's speed. Valid below about 100 m over open ground; no
  shear, no wakes; gusts at different bodies are uncorrelated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians, sqrt

import numpy as np

from volery.base.elementary import exp, log, sine_cosine
from volery.base.errors import UsageError
from volery.base.frames import LocalFrame, Vector
from volery.base.numeric_code import numeric
from volery.simulation.world.arithmetic import gaussian
from volery.simulation.world.state_layout import P_GUST_DECAY, P_GUST_GAIN, S_GUST, U_GUST, Array

# --- atmosphere ---

_SEA_LEVEL_PA = 101325.0
_SEA_LEVEL_K = 288.15
_LAPSE = 0.0065  # [K/m]
_EXPONENT = 5.255877  # g M / (R L)


@numeric
def pressure_at(amsl: float) -> float:
    """Return the pressure [Pa] at a height above mean sea level [m]: p0 (1 - L h / T0)^(g M / R L)."""
    warmth = 1.0 - _LAPSE * amsl / _SEA_LEVEL_K
    return _SEA_LEVEL_PA * exp(_EXPONENT * log(warmth))


@numeric
def altitude_at(pressure: float) -> float:
    """Return the height above mean sea level [m] at a pressure [Pa]: the inverse of ``pressure_at``."""
    return _SEA_LEVEL_K / _LAPSE * (1.0 - exp(log(pressure / _SEA_LEVEL_PA) / _EXPONENT))


# --- magnetic field ---

_G_H = {
    (1, 0): (-29404.8, 0.0),
    (1, 1): (-1450.9, 4652.5),
    (2, 0): (-2499.6, 0.0),
    (2, 1): (2982.0, -2991.6),
    (2, 2): (1677.0, -734.6),
    (3, 0): (1363.2, 0.0),
    (3, 1): (-2381.2, -82.1),
    (3, 2): (1236.2, 241.9),
    (3, 3): (525.7, -543.4),
    (4, 0): (903.0, 0.0),
    (4, 1): (809.5, 281.9),
    (4, 2): (86.3, -158.4),
    (4, 3): (-309.4, 199.7),
    (4, 4): (48.0, -349.7),
}
_DEGREE = 4
_GAUSS = 1e-5  # of a nanotesla


def _legendre(s: float, c: float) -> dict[tuple[int, int], tuple[float, float]]:
    """Return Schmidt's functions of the colatitude and their derivatives, by (degree, order).

    By the recursions of Winch et al., Geophysical Journal International 160 (2005), section 2.

    Args:
        s: Sine of the colatitude.
        c: Cosine of the colatitude.
    """
    table = {(0, 0): (1.0, 0.0), (1, 0): (c, -s), (1, 1): (s, c)}
    for n in range(2, _DEGREE + 1):
        value, slope = table[n - 1, n - 1]
        scale = sqrt((2 * n - 1) / (2 * n))
        table[n, n] = scale * s * value, scale * (c * value + s * slope)
        for m in range(n):
            value, slope = table[n - 1, m]
            older, older_slope = table.get((n - 2, m), (0.0, 0.0))
            weight = sqrt(max((n - 1) * (n - 1) - m * m, 0))
            norm = sqrt(n * n - m * m)
            table[n, m] = (
                ((2 * n - 1) * c * value - weight * older) / norm,
                ((2 * n - 1) * (c * slope - s * value) - weight * older_slope) / norm,
            )
    return table


def magnetic_field(frame: LocalFrame) -> Vector:
    """Return the magnetic field at the frame's origin: north, east, down [gauss]."""
    north = east = down = 0.0
    cosine, sine = sine_cosine(radians(frame.latitude))  # of the colatitude
    sine = max(sine, 1e-9)  # at a pole east has no direction
    table = _legendre(sine, cosine)
    for (degree, order), (g, h) in _G_H.items():
        value, slope = table[degree, order]
        sin_m, cos_m = sine_cosine(order * radians(frame.longitude))
        along = g * cos_m + h * sin_m
        north += along * slope
        east += order * (g * sin_m - h * cos_m) * value / sine
        down -= (degree + 1) * along * value
    return north * _GAUSS, east * _GAUSS, down * _GAUSS


# --- terrain ---

HALF_CURVATURE = 0.5 / 6_371_008.8  # of the earth's mean radius (IUGG) [1/m]


@dataclass(frozen=True)
class Terrain:
    """Heights of the ground above the level of the world's origin (AMSL less the frame's).

    The ground follows the globe: relative to the plane that touches the globe at the origin it is lower by
    d^2 / 2 R (8 m in 10 km), so that level ground has one altitude AMSL.

    Args:
        heights: Heights [m] by row and column: ``heights[row][column]`` stands at north ``south_edge + row *
            spacing`` and east ``west_edge + column * spacing``. A single post is level ground everywhere.
        west_edge: East coordinate of the first column [m].
        south_edge: North coordinate of the first row [m].
        spacing: Distance between posts [m].
    """

    heights: Sequence[Sequence[float]] = ((0.0,),)
    west_edge: float = 0.0
    south_edge: float = 0.0
    spacing: float = 1.0

    def __post_init__(self) -> None:
        widths = {len(row) for row in self.heights}
        if len(widths) != 1 or 0 in widths:
            raise UsageError("terrain: every row of heights needs the same number of posts, at least one")
        if self.spacing <= 0.0:
            raise UsageError(f"terrain: a spacing of {self.spacing} m between posts; give more than 0")

    def height(self, east: float, north: float) -> float:
        """Return the height of the ground at a point [m up in the world's frame].

        Args:
            east: East of the world's origin [m].
            north: North of the world's origin [m].
        """
        heights, grid = self.arrays()
        return float(ground_height(heights, grid, east, north))

    def arrays(self) -> tuple[Array, Array]:
        """Return the posts and (west edge, south edge, spacing) as arrays for compiled code."""
        return (
            np.array(self.heights, dtype=np.float64),
            np.array((self.west_edge, self.south_edge, self.spacing), dtype=np.float64),
        )


@numeric
def _relief(heights: Array, grid: Array, east: float, north: float) -> float:
    """Interpolate bilinearly between the four posts around a point."""
    rows, columns = heights.shape
    x = min(max((east - grid[0]) / grid[2], 0.0), columns - 1.0)
    y = min(max((north - grid[1]) / grid[2], 0.0), rows - 1.0)
    column = min(int(x), max(columns - 2, 0))
    row = min(int(y), max(rows - 2, 0))
    right = min(column + 1, columns - 1)
    above = min(row + 1, rows - 1)
    fx = x - column
    fy = y - row
    south_side = heights[row, column] * (1.0 - fx) + heights[row, right] * fx
    north_side = heights[above, column] * (1.0 - fx) + heights[above, right] * fx
    height: float = south_side * (1.0 - fy) + north_side * fy
    return height


@numeric
def ground_height(heights: Array, grid: Array, east: float, north: float) -> float:
    """Return the height of the ground over the plane that touches the globe at the world's origin [m]."""
    drop = (east * east + north * north) * HALF_CURVATURE
    if heights.size == 1:
        level: float = heights[0, 0] - drop
        return level
    return _relief(heights, grid, east, north) - drop


# --- wind ---

GUST_EVERY = 10  # steps: 50 Hz
_STREAM = 100


@dataclass(frozen=True)
class Wind:
    """Mean velocity of the air, and gusts.

    Args:
        east: Mean velocity towards the east [m/s]; likewise ``north`` and ``up``.
        gust: Standard deviation of the horizontal components of gusts [m/s].
        gust_length: Length scale of gusts [m].
    """

    east: float = 0.0
    north: float = 0.0
    up: float = 0.0
    gust: float = 0.0
    gust_length: float = 60.0

    def __post_init__(self) -> None:
        if self.gust < 0.0 or self.gust_length <= 0.0:
            raise UsageError("wind: a gust's deviation is at least 0 m/s and its length scale above 0 m")

    @property
    def gust_time(self) -> float:
        """Correlation time T = L / V in seconds, V at least 2 m/s."""
        speed = sqrt(self.east * self.east + self.north * self.north + self.up * self.up)
        return self.gust_length / max(speed, 2.0)


@numeric
def advance_gust(row: Array, key: np.uint64, k: int) -> None:
    """Advance one body's gust by one gust period; to be called when k is a multiple of GUST_EVERY."""
    deviation = row[U_GUST]
    if deviation == 0.0:
        return
    decay = row[P_GUST_DECAY]
    kick = row[P_GUST_GAIN] * deviation
    for axis in range(3):
        strength = kick if axis < 2 else 0.5 * kick
        row[S_GUST + axis] = decay * row[S_GUST + axis] + strength * gaussian(key, _STREAM + axis, k)
