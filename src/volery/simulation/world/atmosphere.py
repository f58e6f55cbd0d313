"""The standard atmosphere's lowest layer (ISO 2533): pressure and height, up to 11 km."""

from __future__ import annotations

from numba import njit

from volery.simulation.world.arithmetic import exponential, logarithm

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
