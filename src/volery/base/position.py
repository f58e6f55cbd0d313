"""Places on the globe. Latitude and longitude are WGS-84 degrees; an altitude always says what it is above.

The worst accidents users report come from mixing altitudes, so the four kinds are four types and none
converts into another without the reference that this takes.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from volery.base.errors import UsageError


@dataclass(frozen=True, slots=True)
class _Altitude:
    metres: float

    def __post_init__(self) -> None:
        if not isfinite(self.metres):
            raise UsageError(f"an altitude of {self.metres} m is not a number one can fly to")

    def __str__(self) -> str:
        return f"{self.metres:g} m {self.reference}"

    @property
    def reference(self) -> str:
        """What it is measured above, for messages."""
        raise TypeError("a bare altitude; use AMSL, Ellipsoidal, AboveHome or AboveGround")


class AMSL(_Altitude):
    """Metres above mean sea level (the geoid): what maps, charts and autopilots call altitude."""

    reference = "AMSL"


class Ellipsoidal(_Altitude):
    """Metres above the WGS-84 ellipsoid: what a bare GNSS receiver and ROS's NavSatFix give."""

    reference = "above the ellipsoid"


class AboveHome(_Altitude):
    """Metres above the vehicle's home position."""

    reference = "above home"


class AboveGround(_Altitude):
    """Metres above the terrain straight below."""

    reference = "above ground"


Altitude = AMSL | Ellipsoidal | AboveHome | AboveGround


@dataclass(frozen=True, slots=True)
class Position:
    """A point: WGS-84 degrees, north and east positive, and a typed altitude."""

    latitude: float
    longitude: float
    altitude: Altitude

    def __post_init__(self) -> None:
        if not -90.0 <= self.latitude <= 90.0:
            raise UsageError(f"latitude {self.latitude} is off the globe: -90 to 90 degrees, north positive")
        if not -180.0 <= self.longitude <= 180.0:
            raise UsageError(
                f"longitude {self.longitude} is off the globe: -180 to 180 degrees, east positive"
            )

    def __str__(self) -> str:
        return f"{self.latitude:.7f}, {self.longitude:.7f}, {self.altitude}"
