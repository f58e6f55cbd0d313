"""Between metres above mean sea level (the geoid) and metres above the WGS-84 ellipsoid.

Law: ellipsoidal = AMSL + N, where N is how far the geoid is above the ellipsoid at that place. Receivers and
autopilots say AMSL, MAVROS says ellipsoidal; both sides must mean the same N, and by default it is EGM96's.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cache

from volery.base.egm96 import Egm96Grid, read_grid
from volery.base.errors import UsageError

LEAST, GREATEST = -107.0, 86.0
"""The separations there are on Earth, metres (EGM96)."""

BY_NAME = "egm96"


class Geoid(ABC):
    """Mean sea level, everywhere."""

    @abstractmethod
    def separation(self, latitude: float, longitude: float) -> float:
        """Metres of the geoid above the ellipsoid there; degrees. 0 where there is no such place."""

    def to_ellipsoidal(self, latitude: float, longitude: float, amsl: float) -> float:
        """Metres AMSL as metres above the ellipsoid."""
        return amsl + self.separation(latitude, longitude)

    def to_amsl(self, latitude: float, longitude: float, ellipsoidal: float) -> float:
        """Metres above the ellipsoid as metres AMSL."""
        return ellipsoidal - self.separation(latitude, longitude)


@dataclass(frozen=True, slots=True)
class LevelGeoid(Geoid):
    """The same N everywhere, ``metres``: where one knows it better, or wants none.

    N varies by up to 0.1 m a kilometre, so within 10 km of where it was taken it is right within 1 m.
    """

    metres: float = 0.0

    def __post_init__(self) -> None:
        if not LEAST <= self.metres <= GREATEST:
            raise UsageError(
                f"a geoid {self.metres:g} m above the ellipsoid: on Earth it is {LEAST:g} to {GREATEST:g} m"
            )

    def separation(self, latitude: float, longitude: float) -> float:
        """See ``Geoid``."""
        return self.metres


class Egm96(Geoid):
    """EGM96 as ``base.egm96`` keeps it; see there for its error. Read when it is first asked."""

    def separation(self, latitude: float, longitude: float) -> float:
        """See ``Geoid``."""
        return _grid().height(latitude, longitude)

    def __repr__(self) -> str:
        return "Egm96()"


@cache
def _grid() -> Egm96Grid:
    return read_grid()


EGM96: Geoid = Egm96()
SEA_LEVEL: Geoid = LevelGeoid()
"""The ellipsoid itself is sea level."""


def geoid_of(text: str) -> Geoid:
    """``egm96``, or metres of a ``LevelGeoid``. Raises ``UsageError``."""
    if text == BY_NAME:
        return EGM96
    try:
        return LevelGeoid(float(text))
    except ValueError:
        raise UsageError(
            f"geoid={text!r}: it is {BY_NAME}, or a number of metres above the ellipsoid"
        ) from None
