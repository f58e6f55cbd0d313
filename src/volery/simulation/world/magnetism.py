"""The earth's magnetic field at a place: what a compass there points along.

* Law: the main field's scalar potential in spherical harmonics, Schmidt's semi-normalised, to degree 4.
* Coefficients: International Geomagnetic Reference Field, 13th generation, epoch 2020 (Alken et al., Earth,
  Planets and Space 73 (2021), table 2), in nanotesla.
* Valid: mid latitudes at the ground, to some 3 degrees and 5 % of the full model to degree 13; geographic
  latitude is taken for geocentric. Fit for a compass whose autopilot uses the same law, not for surveying.
"""

from __future__ import annotations

from math import radians, sqrt

from volery.base.frames import LocalFrame, Vector
from volery.simulation.world.arithmetic import sine_cosine

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
