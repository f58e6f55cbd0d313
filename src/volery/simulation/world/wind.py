"""Wind: a mean and gusts.

* Law: each component of a gust is first-order Gauss-Markov noise, the shape of Dryden's longitudinal spectrum
  (MIL-F-8785C): g' = -g/T + s sqrt(2/T) n, T = L / V. Its exact discrete form holds over one gust period.
* Simplified: Dryden's lateral and vertical spectra are second order; here they are as the longitudinal one,
  with the vertical deviation halved. T is a constant of the scene (the wind's own speed stands for the
  airspeed).
* Valid: below about 100 m over open ground; no shear, no wakes. Bodies feel gusts of their own, uncorrelated.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numba import njit

from volery.base.errors import UsageError
from volery.simulation.world.columns import P_GUST_DECAY, P_GUST_KICK, S_GUST, U_GUST, Array
from volery.simulation.world.noise import gaussian

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
def blow(row: Array, key: np.uint64, k: int) -> None:
    """Advance one body's gust by one gust period (call when k is a multiple of GUST_EVERY)."""
    deviation = row[U_GUST]
    if deviation == 0.0:
        return
    decay = row[P_GUST_DECAY]
    kick = row[P_GUST_KICK] * deviation
    for axis in range(3):
        strength = kick if axis < 2 else 0.5 * kick
        row[S_GUST + axis] = decay * row[S_GUST + axis] + strength * gaussian(key, _STREAM + axis, k)
