"""The standard atmosphere's lowest layer (ISO 2533): pressure and height, up to 11 km.

The earth's magnetic field at a place: what a compass there points along.

* Law: the main field's scalar potential in spherical harmonics, Schmidt's semi-normalised, to degree 4.
* Coefficients: International Geomagnetic Reference Field, 13th generation, epoch 2020 (Alken et al., Earth,
  Planets and Space 73 (2021), table 2), in nanotesla.
* Valid: mid latitudes at the ground, to some 3 degrees and 5 % of the full model to degree 13; geographic
  latitude is taken for geocentric. Fit for a compass whose autopilot uses the same law, not for surveying.

The ground: heights over a square grid, bilinear between the posts, level beyond the edge.

Wind: a mean and gusts.

* Law: each component of a gust is first-order Gauss-Markov noise, the shape of Dryden's longitudinal spectrum
  (MIL-F-8785C): g' = -g/T + s sqrt(2/T) n, T = L / V. Its exact discrete form holds over one gust period.
* Simplified: Dryden's lateral and vertical spectra are second order; here they are as the longitudinal one,
  with the vertical deviation halved. T is a constant of the scene (the wind's own speed stands for the
  airspeed).
* Valid: below about 100 m over open ground; no shear, no wakes. Bodies feel gusts of their own, uncorrelated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians, sqrt

import numpy as np
from numba import njit

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame, Vector
from volery.simulation.world.arithmetic import exponential, gaussian, logarithm, sine_cosine
from volery.simulation.world.state_layout import P_GUST_DECAY, P_GUST_GAIN, S_GUST, U_GUST, Array

_SEA_LEVEL_PA = 101325.0
_SEA_LEVEL_K = 288.15
_LAPSE = 0.0065  # [K/m]
_EXPONENT = 5.255877  # g M / (R L)


@njit(cache=True)
def pressure_at(amsl: float) -> float:
    """Pascal at a height in metres above mean sea level: p0 (1 - L h / T0)^(g M / R L)."""
    warmth = 1.0 - _LAPSE * amsl / _SEA_LEVEL_K
    return _SEA_LEVEL_PA * exponential(_EXPONENT * logarithm(warmth))


@njit(cache=True)
def altitude_at(pressure: float) -> float:
    """Metres above mean sea level at a pressure in pascal: the inverse of ``pressure_at``."""
    return _SEA_LEVEL_K / _LAPSE * (1.0 - exponential(logarithm(pressure / _SEA_LEVEL_PA) / _EXPONENT))


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
    """Schmidt's functions of the colatitude whose sine and cosine are given, with their derivatives.

    By the usual recursions (Winch et al., Geophysical Journal International 160 (2005), section 2).
    """
    table = {(0, 0): (1.0, 0.0), (1, 0): (c, -s), (1, 1): (s, c)}
    for n in range(2, _DEGREE + 1):
        value, slope = table[n - 1, n - 1]
        scale = sqrt((2 * n - 1) / (2 * n))
        table[n, n] = scale * s * value, scale * (c * value + s * slope)
        for m in range(n):
            value, slope = table[n - 1, m]
            older, older_slope = table.get((n - 2, m), (0.0, 0.0))
            weight = sqrt(max((n - 1) ** 2 - m**2, 0))
            norm = sqrt(n**2 - m**2)
            table[n, m] = (
                ((2 * n - 1) * c * value - weight * older) / norm,
                ((2 * n - 1) * (c * slope - s * value) - weight * older_slope) / norm,
            )
    return table


def magnetic_field(frame: LocalFrame) -> Vector:
    """The field at the frame's origin: north, east, down in gauss."""
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


_HALF_CURVATURE = 0.5 / 6_371_008.8  # of the earth's mean radius (IUGG) [1/m]


@dataclass(frozen=True)
class Terrain:
    """Heights in metres above the level of the world's origin (AMSL less the frame's).

    The ground follows the globe: seen from the plane that touches it at the origin it falls by d^2 / 2 R (8 m
    in 10 km), so that ground at one level has one altitude AMSL.

    ``heights[row][column]`` is the height at north ``south_edge + row * spacing`` and east ``west_edge +
    column * spacing``. One post alone is level ground everywhere.
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
        """Metres up of the ground at a point: its ``up`` in the world's frame."""
        heights, grid = self.arrays()
        return float(ground_height(heights, grid, east, north))

    def arrays(self) -> tuple[Array, Array]:
        """The posts and (west edge, south edge, spacing), as compiled code takes them."""
        return (
            np.array(self.heights, dtype=np.float64),
            np.array((self.west_edge, self.south_edge, self.spacing), dtype=np.float64),
        )


@njit(cache=True)
def _relief(heights: Array, grid: Array, east: float, north: float) -> float:
    """Bilinear interpolation between the four posts around a point."""
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


@njit(cache=True)
def ground_height(heights: Array, grid: Array, east: float, north: float) -> float:
    """Metres up of the ground, over the plane that touches the globe at the world's origin."""
    drop = (east * east + north * north) * _HALF_CURVATURE
    if heights.size == 1:
        level: float = heights[0, 0] - drop
        return level
    return _relief(heights, grid, east, north) - drop


GUST_EVERY = 10  # steps: 50 Hz
_STREAM = 100


@dataclass(frozen=True)
class Wind:
    """Where the air goes: metres a second east, north and up; gusts' standard deviation and length scale in
    metres.
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


@njit(cache=False)
def advance_gust(row: Array, key: np.uint64, k: int) -> None:
    """Advance one body's gust by one gust period (call when k is a multiple of GUST_EVERY)."""
    deviation = row[U_GUST]
    if deviation == 0.0:
        return
    decay = row[P_GUST_DECAY]
    kick = row[P_GUST_GAIN] * deviation
    for axis in range(3):
        strength = kick if axis < 2 else 0.5 * kick
        row[S_GUST + axis] = decay * row[S_GUST + axis] + strength * gaussian(key, _STREAM + axis, k)
