"""Between metres above mean sea level (the geoid) and metres above the WGS-84 ellipsoid.

Law: ellipsoidal = AMSL + N with one separation N for a whole world. N varies by about 0.1 m a kilometre
(EGM96, Lemoine et al., NASA/TP-1998-206861), so within 10 km of where N was taken the error stays below
about 1 m; with N left at 0 it is the separation itself, between -107 m and +86 m on Earth. Whoever compares
with real receivers states the real N.
"""

from __future__ import annotations

from dataclasses import dataclass

from volery.base.errors import UsageError

LEAST, GREATEST = -107.0, 86.0
"""The separations there are on Earth, metres (EGM96)."""


@dataclass(frozen=True, slots=True)
class Geoid:
    """``separation``: metres of the geoid above the ellipsoid, everywhere in this world."""

    separation: float = 0.0

    def __post_init__(self) -> None:
        if not LEAST <= self.separation <= GREATEST:
            raise UsageError(
                f"a geoid {self.separation:g} m above the ellipsoid: "
                f"on Earth it is {LEAST:g} to {GREATEST:g} m"
            )

    def to_ellipsoidal(self, amsl: float) -> float:
        """Metres AMSL as metres above the ellipsoid."""
        return amsl + self.separation

    def to_amsl(self, ellipsoidal: float) -> float:
        """Metres above the ellipsoid as metres AMSL."""
        return ellipsoidal - self.separation


SEA_LEVEL = Geoid()
"""Where nobody stated the separation."""
