"""Between metres above mean sea level (the geoid) and metres above the WGS-84 ellipsoid.

Law: ellipsoidal = AMSL + N, where N is the height of the geoid above the ellipsoid at that place. Receivers
and autopilots report AMSL, MAVROS reports ellipsoidal; both sides must use the same N, by default EGM96's.

EGM96 is read from a grid of a quarter of a degree. Source: Lemoine et al., The Development of the Joint NASA
GSFC and NIMA Geopotential Model EGM96, NASA/TP-1998-206861; public domain. ``scripts/egm96_grid.py`` makes
``egm96.grid`` from the 5' grid: whole decimetres, bicubic in between. Against that grid it errs by at most
0.19 m, by 0.06 m at 99 % of all places and by 0.025 m root mean square; EGM96 itself errs by 0.5 to 1 m.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.resources import files

from volery.base.errors import UsageError
from volery.base.geoid_grid import Egm96Grid

GRID_FILE = "egm96.grid"


@cache
def read_grid() -> Egm96Grid:
    """Return the grid of the package; it is read once a process."""
    return Egm96Grid(files("volery.base").joinpath(GRID_FILE).read_bytes())


@lru_cache(maxsize=64)
def _height(latitude: float, longitude: float) -> float:
    return read_grid().height(latitude, longitude)


LOWEST_SEPARATION, HIGHEST_SEPARATION = -107.0, 86.0
"""Range of separations on Earth, metres (EGM96)."""

EGM96_NAME = "egm96"


class Geoid(ABC):
    """Model of mean sea level."""

    @abstractmethod
    def separation(self, latitude: float, longitude: float) -> float:
        """Return the height of the geoid above the ellipsoid in metres.

        Args:
            latitude: Degrees north.
            longitude: Degrees east.
        """

    def to_ellipsoidal(self, latitude: float, longitude: float, amsl: float) -> float:
        """Convert metres AMSL to metres above the ellipsoid."""
        return amsl + self.separation(latitude, longitude)

    def to_amsl(self, latitude: float, longitude: float, ellipsoidal: float) -> float:
        """Convert metres above the ellipsoid to metres AMSL."""
        return ellipsoidal - self.separation(latitude, longitude)


@dataclass(frozen=True, slots=True)
class LevelGeoid(Geoid):
    """The same separation everywhere, ``metres``; for a place where it is known better than by EGM96.

    N varies by up to 0.1 m per kilometre, so within 10 km the error is at most 1 m.
    """

    metres: float = 0.0

    def __post_init__(self) -> None:
        if not LOWEST_SEPARATION <= self.metres <= HIGHEST_SEPARATION:
            raise UsageError(
                f"a geoid {self.metres:g} m above the ellipsoid: on Earth it is {LOWEST_SEPARATION:g} to "
                f"{HIGHEST_SEPARATION:g} m"
            )

    def separation(self, latitude: float, longitude: float) -> float:
        """See ``Geoid``."""
        return self.metres


class Egm96(Geoid):
    """EGM96, read from its file at the first use."""

    def separation(self, latitude: float, longitude: float) -> float:
        """See ``Geoid``."""
        return _height(latitude, longitude)

    def __repr__(self) -> str:
        return "Egm96()"


EGM96: Geoid = Egm96()
SEA_LEVEL: Geoid = LevelGeoid()
"""Sea level equals the ellipsoid."""


def parse_geoid(text: str) -> Geoid:
    """Parse ``egm96`` or the metres of a ``LevelGeoid``. Raises ``UsageError``."""
    if text == EGM96_NAME:
        return EGM96
    try:
        return LevelGeoid(float(text))
    except ValueError:
        raise UsageError(
            f"geoid={text!r}: give {EGM96_NAME}, or a number of metres above the ellipsoid"
        ) from None
